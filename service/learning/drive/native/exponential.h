/* exp without libm: short enough to stand inside loops, where compilers turn it into vector instructions, and the same
 * bits on every machine. Within 1 unit in the last place of the true value. */
#ifndef ROVER_EXPONENTIAL_H
#define ROVER_EXPONENTIAL_H

#include <stdint.h>
#include <string.h>

#include "engine.h"

/* x = k ln 2 + r with |r| <= ln(2)/2: gives 2^k and exp(r) - 1. For x in [-708, 709]; others are held there. */
ROVER_INLINE void rover_split_exp(double x, double *power, double *rest)
{
    const double per_ln2 = 0x1.71547652b82fep+0, ln2_high = 0x1.62e42fec00000p-1, ln2_low = 0x1.d1cf79abc9e3bp-32;
    const double round = 0x1.8p52; /* adding it leaves the nearest whole number in the last bits */
    x = -708.0 > x ? -708.0 : x;
    x = 709.0 < x ? 709.0 : x;
    double shifted = x * per_ln2 + round;
    double k = shifted - round;
    double r = (x - k * ln2_high) - k * ln2_low;
    /* (exp(r) - 1 - r) / r^2: interpolated at Chebyshev's points, off by 1.3e-17 at most */
    double r2 = r * r, r4 = r2 * r2;
    double a = 0x1.0000000000001p-1 + r * 0x1.5555555555556p-3, b = 0x1.5555555553d63p-5 + r * 0x1.11111111109b3p-7;
    double c = 0x1.6c16c1788bd90p-10 + r * 0x1.a01a01a7c41d5p-13, d = 0x1.a019b90d2ae7ap-16 + r * 0x1.71de0dae63bb3p-19;
    double e = 0x1.289185613a3d6p-22 + r * 0x1.af38a9b0ec855p-26;
    double sum = (a + r2 * b) + r4 * ((c + r2 * d) + r4 * e);
    *rest = r + r2 * sum;
    uint64_t bits;
    memcpy(&bits, &shifted, sizeof bits);
    bits = (bits + 1023u) << 52;
    memcpy(power, &bits, sizeof bits);
}

ROVER_INLINE double rover_exp(double x)
{
    double power, rest;
    rover_split_exp(x, &power, &rest);
    return power + power * rest;
}

/* exp(x) - 1 without cancellation near zero */
ROVER_INLINE double rover_expm1(double x)
{
    double power, rest;
    rover_split_exp(x, &power, &rest);
    return power * rest + (power - 1.0);
}

ROVER_INLINE double rover_tanh(double x)
{
    double twice = x < 0.0 ? -2.0 * x : 2.0 * x;
    if (twice > 40.0) /* all bits are those of 1 */
        return x < 0.0 ? -1.0 : 1.0;
    double more = rover_expm1(twice), found = more / (more + 2.0);
    return x < 0.0 ? -found : found;
}

#endif
