/* mechanics/laws/guccione.py. Parameters: C, the factors of (a0.E a0)^2, E:E and |E a0|^2 in Q, kappa. */

static void VARIANT(guccione)(const double *parameters, const struct strain *at, int with_energy, int with_tangent,
                              struct response *response)
{
    double stiffness = parameters[0], on_fiber = parameters[1], on_all = parameters[2], on_shear = parameters[3];
    double bulk = parameters[4];
    double strain[VOIGT][LANES], slope[VOIGT][LANES] = {{0.0}};
    double along[LANES], exponent[LANES], growth[LANES], factor[LANES], change[LANES];
    for (int c = 0; c < VOIGT; c++)
        LANE strain[c][l] = 0.5 * (at->cauchy_green[c][l] - (c < 3 ? 1.0 : 0.0));
    VARIANT(contract)(at->structure, strain, along);
    for (int c = 0; c < VOIGT; c++)
        LANE slope[c][l] = 2.0 * on_fiber * along[l] * at->structure[c][l] + 2.0 * on_all * strain[c][l];
    VARIANT(add_products)(on_shear, at->structure, strain, slope);
    VARIANT(contract)(slope, strain, exponent);
    LANE {
        exponent[l] *= 0.5;
        growth[l] = 0.5 * stiffness * VARIANT(exponential)(exponent[l]);
        change[l] = (at->volume_ratio[l] - 1.0) * (at->volume_ratio[l] + 1.0);
        factor[l] = 0.5 * bulk * change[l];
        if (with_energy)
            response->energy[l] += growth[l] - 0.5 * stiffness + 0.25 * bulk * (change[l] - 2.0 * at->log_volume[l]);
    }
    VARIANT(add_scaled)(growth, slope, response->stress);
    VARIANT(add_scaled)(factor, at->inverse, response->stress);
    if (with_tangent) {
        double on_structure[LANES], on_dyad[LANES], on_product[LANES], left[VOIGT][LANES], unity[VOIGT][LANES];
        LANE {
            on_structure[l] = 2.0 * on_fiber * growth[l];
            on_dyad[l] = bulk * (change[l] + 1.0);
            on_product[l] = -0.5 * bulk * change[l];
        }
        for (int c = 0; c < VOIGT; c++)
            LANE {
                unity[c][l] = c < 3 ? 1.0 : 0.0;
                left[c][l] = on_all * unity[c][l] + on_shear * at->structure[c][l];
            }
        VARIANT(add_dyad)(growth, slope, response->tangent);
        VARIANT(add_dyad)(on_structure, at->structure, response->tangent);
        VARIANT(add_symmetric)(growth, left, unity, response->tangent);
        VARIANT(add_dyad)(on_dyad, at->inverse, response->tangent);
        VARIANT(add_symmetric)(on_product, at->inverse, at->inverse, response->tangent);
    }
}
