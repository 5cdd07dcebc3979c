/* mechanics/laws/neo_hooke.py. Parameters: shear modulus, lambda, factor of ln J (the shear modulus, or minus that). */

static void VARIANT(neo_hooke)(const double *parameters, const struct strain *at, int with_energy, int with_tangent,
                               struct response *response)
{
    double shear = parameters[0], lambda = parameters[1], on_log = parameters[2];
    double on_inverse[LANES], on_product[LANES], on_dyad[LANES];
    LANE on_inverse[l] = lambda * at->log_volume[l] - on_log;
    for (int c = 0; c < 3; c++)
        LANE response->stress[c][l] += shear;
    VARIANT(add_scaled)(on_inverse, at->inverse, response->stress);
    if (with_energy)
        LANE {
            double first = at->cauchy_green[0][l] + at->cauchy_green[1][l] + at->cauchy_green[2][l] - 3.0;
            double log_volume = at->log_volume[l];
            response->energy[l] += 0.5 * shear * first - on_log * log_volume + 0.5 * lambda * log_volume * log_volume;
        }
    if (with_tangent) {
        LANE on_dyad[l] = lambda, on_product[l] = -on_inverse[l];
        VARIANT(add_dyad)(on_dyad, at->inverse, response->tangent);
        VARIANT(add_symmetric)(on_product, at->inverse, at->inverse, response->tangent);
    }
}
