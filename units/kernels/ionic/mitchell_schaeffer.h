/* Mitchell and Schaeffer, the twin of electrophysiology/ionic/mitchell_schaeffer.py; constants as its fields. */

EXPORT int VARIANT(mitchell_schaeffer)(int64_t points, int64_t stride, const double *constants,
                                       const double *restrict values, double *restrict rates)
{
    const double inward = constants[0], outward = constants[1], opening = constants[2], closing = constants[3];
    const double threshold = constants[4];
    for (int64_t i = 0; i < points; i++) {
        double phi = values[i], gate = values[stride + i];
        rates[i] = gate * phi * phi * (1.0 - phi) / inward - phi / outward;
        rates[stride + i] = phi < threshold ? (1.0 - gate) / opening : -gate / closing;
    }
    return 0;
}
