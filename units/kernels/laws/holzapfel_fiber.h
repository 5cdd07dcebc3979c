/* mechanics/laws/holzapfel_fiber.py. Parameters: k_1, k_2. */

static void VARIANT(holzapfel_fiber)(const double *parameters, const struct strain *at, int with_energy, int with_tangent,
                                     struct response *response)
{
    double stiffness = parameters[0], exponent = parameters[1];
    double squared[LANES], isochoric[LANES], first[LANES], second[LANES], factor[LANES], gradient[VOIGT][LANES];
    VARIANT(contract)(at->structure, at->cauchy_green, squared);
    LANE {
        isochoric[l] = VARIANT(exponential)(-2.0 / 3.0 * at->log_volume[l]);
        double extension = isochoric[l] * squared[l] - 1.0;
        extension = extension > 0.0 ? extension : 0.0;
        double growth = VARIANT(exponential)(exponent * extension * extension);
        first[l] = stiffness * growth * extension;
        second[l] = extension > 0.0 ? stiffness * growth * (1.0 + 2.0 * exponent * extension * extension) : 0.0;
        factor[l] = 2.0 * first[l];
        if (with_energy)
            response->energy[l] += 0.5 * stiffness / exponent * (growth - 1.0);
    }
    for (int c = 0; c < VOIGT; c++)
        LANE gradient[c][l] = isochoric[l] * (at->structure[c][l] - squared[l] / 3.0 * at->inverse[c][l]);
    VARIANT(add_scaled)(factor, gradient, response->stress);
    if (with_tangent) {
        double on_dyads[LANES], on_dyad[LANES], on_product[LANES];
        LANE {
            double curvature = 4.0 * first[l] * isochoric[l];
            factor[l] = 4.0 * second[l];
            on_dyads[l] = -curvature / 3.0;
            on_dyad[l] = curvature * squared[l] / 9.0;
            on_product[l] = 0.5 * curvature * squared[l] / 3.0;
        }
        VARIANT(add_dyad)(factor, gradient, response->tangent);
        VARIANT(add_dyads)(on_dyads, at->structure, at->inverse, response->tangent);
        VARIANT(add_dyad)(on_dyad, at->inverse, response->tangent);
        VARIANT(add_symmetric)(on_product, at->inverse, at->inverse, response->tangent);
    }
}
