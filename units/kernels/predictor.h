/* The first guess of mechanics/solvers/predictor.py, in one pass over the remembered changes. */

/* `load_changes` and `displacement_changes` are addresses of `count` arrays of `loads` and `size` numbers, the latest
   first; `change` is the new change of the loads. Loads from `heavy` on count `numbers`[0] times as much as the others, and
   what is left of a change has to be `numbers`[1] of it. `work` has room for count * (loads + size) numbers. The guess is
   added to `guess`, [size]. */
EXPORT int VARIANT(predictor_guess)(int64_t loads, int64_t size, int64_t count, int64_t heavy,
                                    const double *const *load_changes, const double *const *displacement_changes,
                                    const double *change, const double *numbers, double *work, double *guess)
{
    const double weight = numbers[0], least = numbers[1];
    int64_t kept = 0;
    for (int64_t k = 0; k < count; k++) {
        double *load = work + kept * (loads + size), *displacement = load + loads;
        memcpy(load, load_changes[k], loads * sizeof *load);
        for (int64_t i = heavy; i < loads; i++)
            load[i] *= weight;
        double before = VARIANT(dot)(loads, load, load);
        if (!(before > 0.0))
            continue;
        memcpy(displacement, displacement_changes[k], size * sizeof *displacement);
        for (int64_t j = 0; j < kept; j++) {
            const double *known = work + j * (loads + size);
            double part = VARIANT(dot)(loads, known, load);
            VARIANT(add_multiple)(loads + size, -part, known, load);
        }
        double left = sqrt(VARIANT(dot)(loads, load, load));
        if (left < least * sqrt(before))
            continue;
        for (int64_t i = 0; i < loads + size; i++)
            load[i] /= left;
        double along = 0.0;
        for (int64_t i = heavy; i < loads; i++)
            along += load[i] * weight * change[i];
        along += VARIANT(dot)(heavy, load, change);
        VARIANT(add_multiple)(size, along, displacement, guess);
        kept++;
    }
    return 1;
}
