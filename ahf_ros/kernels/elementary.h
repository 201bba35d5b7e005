/* Elementary functions with the same bits on every machine.

   The C library's exp and log differ between systems in their last bits, numpy's between vector
   units. These use sums, products and quotients of doubles alone, which IEEE 754 rounds in one way
   only. The loops in which they stand have no branch, so that compilers can take several values at
   a time. */

#ifndef AHF_ELEMENTARY_H
#define AHF_ELEMENTARY_H

#include <stdint.h>
#include <string.h>

#define SQRT_HALF 0.70710678118654752440
#define LN_2_HIGH 6.93147180369123816490e-01 /* its last 32 bits are 0 */
#define LN_2_LOW 1.90821492927058770002e-10
#define LOG2_E 1.44269504088896338700

static inline double lesser(double a, double b) { return a < b ? a : b; }
static inline double greater(double a, double b) { return a > b ? a : b; }

static inline double of_bits(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline uint64_t bits_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* e^x to 3e-16 of itself, from -708 to 709; beyond these bounds it is as at the nearest one. A NaN
   gives the lower bound.

   x = n ln 2 + r with |r| <= ln(2) / 2; e^r is the sum of its Taylor series up to r^13. */
static inline double exponential(double x)
{
    static const double round = 6755399441055744.0; /* 1.5 2^52: added, it leaves an integer */
    x = greater(lesser(709.0, x), -708.0);
    double shifted = x * LOG2_E + round;
    double n = shifted - round;
    double r = (x - n * LN_2_HIGH) - n * LN_2_LOW;
    double sum = 1.0 / 6227020800;
    sum = sum * r + 1.0 / 479001600;
    sum = sum * r + 1.0 / 39916800;
    sum = sum * r + 1.0 / 3628800;
    sum = sum * r + 1.0 / 362880;
    sum = sum * r + 1.0 / 40320;
    sum = sum * r + 1.0 / 5040;
    sum = sum * r + 1.0 / 720;
    sum = sum * r + 1.0 / 120;
    sum = sum * r + 1.0 / 24;
    sum = sum * r + 1.0 / 6;
    sum = sum * r + 0.5;
    sum = sum * r * r + r;
    /* The lowest bits of `shifted` are n; 2^n is made of its exponent. */
    return (sum + 1.0) * of_bits((bits_of(shifted) + 1023) << 52);
}

/* ln x to 3e-16 of itself and of 1, from 1e-300 to 1e300; what is less, or NaN, is as the former.

   x = 2^n m with m from sqrt(1/2) to sqrt(2); ln m = 2 artanh s, s = (m - 1) / (m + 1), |s| < 0.172,
   is summed up to s^21. */
static inline double logarithm(double x)
{
    x = greater(lesser(1e300, x), 1e-300);
    /* Moved by the bits of sqrt(1/2), the exponent steps where m does. */
    uint64_t moved = bits_of(x) - bits_of(SQRT_HALF);
    uint64_t steps = moved & 0xfff0000000000000u;
    double m = of_bits(bits_of(x) - steps);
    double n = (double)(int32_t)((int64_t)steps >> 52);
    double s = (m - 1.0) / (m + 1.0), z = s * s;
    double sum = 2.0 / 21;
    sum = sum * z + 2.0 / 19;
    sum = sum * z + 2.0 / 17;
    sum = sum * z + 2.0 / 15;
    sum = sum * z + 2.0 / 13;
    sum = sum * z + 2.0 / 11;
    sum = sum * z + 2.0 / 9;
    sum = sum * z + 2.0 / 7;
    sum = sum * z + 2.0 / 5;
    sum = sum * z + 2.0 / 3;
    return n * LN_2_HIGH + (2.0 * s + (s * z * sum + n * LN_2_LOW));
}

static inline float lesser_f(float a, float b) { return a < b ? a : b; }
static inline float greater_f(float a, float b) { return a > b ? a : b; }

/* The same in single precision, four at a time: e^x to 2e-7 of itself, from -87 to 88. */
static inline float exponential_f(float x)
{
    static const float round = 12582912.0f; /* 1.5 2^23 */
    x = greater_f(lesser_f(88.0f, x), -87.0f);
    float shifted = x * (float)LOG2_E + round;
    float n = shifted - round;
    float r = (x - n * 0.693145751953125f) - n * 1.42860682030941723212e-6f;
    float sum = 1.0f / 5040;
    sum = sum * r + 1.0f / 720;
    sum = sum * r + 1.0f / 120;
    sum = sum * r + 1.0f / 24;
    sum = sum * r + 1.0f / 6;
    sum = sum * r + 0.5f;
    sum = sum * r * r + r;
    uint32_t bits;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 127) << 23;
    float power;
    memcpy(&power, &bits, sizeof power);
    return (sum + 1.0f) * power;
}

/* ln x to 2e-7 of itself and of 1, from 1e-37 to 3e38; what is less, or NaN, is as the former. */
static inline float logarithm_f(float x)
{
    x = greater_f(lesser_f(3e38f, x), 1e-37f);
    uint32_t bits, moved;
    memcpy(&bits, &x, sizeof bits);
    moved = (bits - 0x3f3504f3u) & 0xff800000u; /* the bits of sqrt(1/2) */
    float n = (float)((int32_t)moved >> 23), m;
    bits -= moved;
    memcpy(&m, &bits, sizeof m);
    float s = (m - 1.0f) / (m + 1.0f), z = s * s;
    float sum = 2.0f / 9;
    sum = sum * z + 2.0f / 7;
    sum = sum * z + 2.0f / 5;
    sum = sum * z + 2.0f / 3;
    return n * 0.693145751953125f + (2.0f * s + (s * z * sum + n * 1.42860682030941723212e-6f));
}

/* tanh x, to 2e-7 of 1. */
static inline float hyperbolic_tangent_f(float x)
{
    float grown = exponential_f(2.0f * greater_f(lesser_f(x, 10.0f), -10.0f));
    return (grown - 1.0f) / (grown + 1.0f);
}

/* Density of a normal distribution of a deviation at a distance from its middle. */
static inline float normal_density_f(float distance, float deviation)
{
    float share = distance / deviation;
    return exponential_f(-0.5f * share * share) * (0.39894228f / deviation);
}

/* Cosine and sine of an angle, to 3e-16, from -1e5 to 1e5; beyond these, or for NaN, of a bound.

   x = n pi / 2 + r with |r| <= pi / 4, whose series are summed up to r^16. */
static inline void cosine_and_sine(double x, double *cosine, double *sine)
{
    static const double round = 6755399441055744.0; /* as for exponential */
    x = greater(lesser(1e5, x), -1e5);
    double shifted = x * 0.63661977236758134308 + round;
    double n = shifted - round;
    double r = (x - n * 1.57079632673412561417) - n * 6.07710050650619224932e-11, z = r * r;
    double even = 1.0, odd = 1.0;
    for (int k = 16; k > 0; k -= 2) {
        even = 1.0 - z / (k * (k - 1)) * even;
        odd = 1.0 - z / (k * (k + 1)) * odd;
    }
    odd *= r;
    uint64_t quarter = bits_of(shifted);
    double across = quarter & 1 ? odd : even, along = quarter & 1 ? even : odd;
    *cosine = (quarter + 1) & 2 ? -across : across;
    *sine = quarter & 2 ? -along : along;
}

/* Share of a normal distribution below x deviations, to 1e-7: 7.1.26 of Abramowitz & Stegun,
   Handbook of Mathematical Functions, 1964. */
static inline double normal_share(double x)
{
    double size = (x < 0 ? -x : x) * SQRT_HALF;
    double place = 1.0 / (1.0 + 0.3275911 * size);
    double sum = 1.061405429;
    sum = sum * place - 1.453152027;
    sum = sum * place + 1.421413741;
    sum = sum * place - 0.284496736;
    sum = sum * place + 0.254829592;
    double tail = 0.5 * sum * place * exponential(-size * size);
    return x > 0 ? 1.0 - tail : tail;
}

#endif
