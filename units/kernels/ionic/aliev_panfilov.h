/* Aliev and Panfilov, the twin of electrophysiology/ionic/aliev_panfilov.py; constants as its fields. */

EXPORT int VARIANT(aliev_panfilov)(int64_t points, int64_t stride, const double *constants, const double *restrict values,
                                   double *restrict rates)
{
    const double c = constants[0], alpha = constants[1], gamma = constants[2], mu1 = constants[3], mu2 = constants[4];
    const double offset = constants[5];
    for (int64_t i = 0; i < points; i++) {
        double phi = values[i], r = values[stride + i];
        rates[i] = -(phi * (c * (phi - alpha) * (phi - 1.0) + r));
        rates[stride + i] = (gamma + mu1 * r / (mu2 + phi)) * (-c * phi * (phi - offset - 1.0) - r);
    }
    return 0;
}
