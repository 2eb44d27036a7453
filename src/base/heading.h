/* The unit vector at an angle, and the angle of a vector. Without calls or branches, so that loops fill the processor's
 * vectors. */
#ifndef DMK_HEADING_H
#define DMK_HEADING_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

typedef struct dmk_heading {
    double x, y;
} dmk_heading;

static inline uint64_t dmk_bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static inline double dmk_real_of(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* (cos, sin) of a turn of at most 1e5 radians, both to 1.5e-16: distances on 273,000 triangles and their locus take
 * three million. By their series around the nearest quarter turn; of that the first 33 bits apart, so that n * quarter
 * is exact. */
static inline dmk_heading dmk_heading_of(double turn)
{
    enum { TERMS = 7 };
    static const double
        sine[TERMS] = {-1. / 6,        1. / 120,        -1. / 5040,         1. / 362880,
                       -1. / 39916800, 1. / 6227020800, -1. / 1307674368000},
        cosine[TERMS] = {1. / 24,        -1. / 720,         1. / 40320,         -1. / 3628800,
                         1. / 479001600, -1. / 87178291200, 1. / 20922789888000};
    /* `shifted` ends in the bits of the nearest whole number of quarters */
    const double quarter = 0x1.921fb544p+0, rest = 0x1.0b4611a626331p-34, shift = 0x1.8p+52,
                 shifted = turn * (2 / M_PI) + shift, n = shifted - shift;
    const double first = turn - n * quarter, r = first - n * rest, left = first - r - n * rest;
    const double z = r * r;
    double s = 0, c = 0;
    for (int k = TERMS - 1; k >= 0; k--) {
        s = s * z + sine[k];
        c = c * z + cosine[k];
    }
    s = r + (r * z * s + left);
    const double most = 1 - 0.5 * z;
    c = most + (1 - most - 0.5 * z + (z * z * c - r * left));
    /* an odd number swaps both, bit 1 of n is the sign of y, and of n + 1 that of x */
    const uint64_t bits = dmk_bits_of(shifted),
                   swap = (dmk_bits_of(s) ^ dmk_bits_of(c)) & -(bits & 1);
    return (dmk_heading){dmk_real_of(dmk_bits_of(c) ^ swap ^ (((bits + 1) >> 1) << 63)),
                         dmk_real_of(dmk_bits_of(s) ^ swap ^ ((bits >> 1) << 63))};
}

/* atan2(y, x) to two units in the last place. By the series of the arc tangent around 0, 1 / 2 or 1, whichever is
 * nearest to the smaller coordinate over the larger one: the differences are exact. All comparisons come before the
 * choices, for compilers leave loops scalar whose branches compute. */
static inline double dmk_angle_of(double x, double y)
{
    enum { TERMS = 12 };
    static const double inverse[TERMS] = {-1. / 3,  1. / 5,  -1. / 7,  1. / 9,  -1. / 11, 1. / 13,
                                          -1. / 15, 1. / 17, -1. / 19, 1. / 21, -1. / 23, 1. / 25};
    const double across = fabs(x), up = fabs(y);
    const bool is_steep = up > across, is_back = x < 0;
    const double most = is_steep ? up : across, least = is_steep ? across : up;
    /* as far from the one as from the other: 0.2361 and 0.7208 */
    const bool is_small = least <= 0.2361 * most, is_large = least > 0.7208 * most;
    const double nearer = is_large ? 1 : 0.5, centre = is_small ? 0 : nearer;
    const double whole = most + centre * least, over = whole > 0 ? whole : 1;
    const double t = (least - centre * most) / over;
    const double z = t * t;
    double s = 0;
    for (int k = TERMS - 1; k >= 0; k--) s = s * z + inverse[k];
    s = t + t * (z * s);
    /* atan(1 / 2) or atan(1), pi / 2 and pi, and what they leave */
    const double at_nearer = is_large ? 0x1.921fb54442d18p-1 : 0x1.dac670561bb4fp-2,
                 at_nearer_rest = is_large ? 0x1.1a62633145c07p-55 : 0x1.a2b7f222f65e2p-56;
    const double base = is_small ? 0 : at_nearer, rest = is_small ? 0 : at_nearer_rest;
    const double turn = is_steep ? -1 : 1, right = is_steep ? 0x1.921fb54442d18p+0 : 0,
                 right_rest = is_steep ? 0x1.1a62633145c07p-54 : 0;
    const double back = is_back ? -1 : 1, half = is_back ? 0x1.921fb54442d18p+1 : 0,
                 half_rest = is_back ? 0x1.1a62633145c07p-53 : 0;
    const double sum = half + back * (right + turn * base);
    return copysign(sum + (half_rest + back * (right_rest + turn * (s + rest))), y);
}

#endif
