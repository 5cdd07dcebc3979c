/* exp and log in plain arithmetic, so that a compiler vectorises the loops that call them, whatever the instruction set.
   To a few units in the last place; ordinary compiler flags only: -ffast-math would break the rounding trick below. */

/* 1.5 * 2^52: added to a number, it leaves that number, rounded to an integer, in the last bits of the sum. */
#ifndef ROUNDING_SHIFT
#define ROUNDING_SHIFT 6755399441055744.0
#define LN2_HIGH 6.93147180369123816490e-01
#define LN2_LOW 1.90821492927058770002e-10
#define LOG2_E 1.44269504088896340736
#endif

static inline double VARIANT(from_bits)(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline uint64_t VARIANT(bits_of)(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* e^x; infinite from 709.4 on, 0 below -708. NaN stays NaN. */
static inline double VARIANT(exponential)(double x)
{
    double inside = x < -708.0 ? -708.0 : x;
    inside = inside > 709.4 ? 709.4 : inside;
    double shifted = inside * LOG2_E + ROUNDING_SHIFT;
    double power = shifted - ROUNDING_SHIFT;
    double r = (inside - power * LN2_HIGH) - power * LN2_LOW;
    /* The Taylor polynomial: |r| <= ln(2)/2 leaves 4e-18. */
    double p = 1.0 / 6227020800.0;
    p = p * r + 1.0 / 479001600.0;
    p = p * r + 1.0 / 39916800.0;
    p = p * r + 1.0 / 3628800.0;
    p = p * r + 1.0 / 362880.0;
    p = p * r + 1.0 / 40320.0;
    p = p * r + 1.0 / 5040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    double scale = VARIANT(from_bits)((VARIANT(bits_of)(shifted) << 52) + ((uint64_t)1023 << 52));
    double value = p * scale;
    value = x > 709.4 ? (double)INFINITY : value;
    return x < -708.0 ? 0.0 : value;
}

/* ln x of a positive, normal number; of others a number that means nothing. */
static inline double VARIANT(logarithm)(double x)
{
    uint64_t bits = VARIANT(bits_of)(x);
    double mantissa = VARIANT(from_bits)((bits & 0x000fffffffffffffULL) | 0x3ff0000000000000ULL);
    double exponent = VARIANT(from_bits)((bits >> 52) | 0x4330000000000000ULL) - 4503599627370496.0 - 1023.0;
    int large = mantissa > 1.4142135623730951;
    mantissa = large ? 0.5 * mantissa : mantissa;
    exponent = large ? exponent + 1.0 : exponent;
    /* ln m = 2 artanh s, |s| < 0.172: the series to s^23 leaves 2e-18. */
    double s = (mantissa - 1.0) / (mantissa + 1.0);
    double z = s * s;
    double p = 1.0 / 23.0;
    p = p * z + 1.0 / 21.0;
    p = p * z + 1.0 / 19.0;
    p = p * z + 1.0 / 17.0;
    p = p * z + 1.0 / 15.0;
    p = p * z + 1.0 / 13.0;
    p = p * z + 1.0 / 11.0;
    p = p * z + 1.0 / 9.0;
    p = p * z + 1.0 / 7.0;
    p = p * z + 1.0 / 5.0;
    p = p * z + 1.0 / 3.0;
    p = p * z + 1.0;
    return exponent * LN2_HIGH + (exponent * LN2_LOW + 2.0 * s * p);
}
