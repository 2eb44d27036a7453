/* Vectors of three numbers. */
#ifndef DMK_VEC3_H
#define DMK_VEC3_H

#include <float.h>
#include <math.h>
#include <stdbool.h>

static inline double dmk_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* out = a - b; out may be a or b. */
static inline void dmk_subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

static inline void dmk_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double dmk_distance_squared(const double a[3], const double b[3])
{
    double d[3];
    dmk_subtract(a, b, d);
    return dmk_dot(d, d);
}

/* Squares of coordinates near 1e-300 and 1e300 would be 0 or infinite: then by hypot. */
static inline double dmk_distance(const double a[3], const double b[3])
{
    double square = dmk_distance_squared(a, b);
    if (square > 1e-290 && square < 1e300) return sqrt(square);
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* Whether a and b are no farther apart than rounding: marching cubes leave places that should be one up to 16 units of
 * rounding apart, and none from there to some 10 million. */
static inline bool dmk_is_same_place(const double a[3], const double b[3])
{
    double farthest = 0;
    for (int k = 0; k < 3; k++) farthest = fmax(farthest, fmax(fabs(a[k]), fabs(b[k])));
    return dmk_distance(a, b) <= 64 * DBL_EPSILON * farthest;
}

/* The least altitude of the triangle a b c over its longest side: small for slivers. */
static inline double dmk_altitude_ratio(const double a[3], const double b[3], const double c[3])
{
    double e[2][3], normal[3];
    dmk_subtract(b, a, e[0]);
    dmk_subtract(c, a, e[1]);
    dmk_cross(e[0], e[1], normal);
    double longest = fmax(dmk_dot(e[0], e[0]), dmk_dot(e[1], e[1]));
    return sqrt(dmk_dot(normal, normal)) / fmax(longest, dmk_distance_squared(b, c));
}

#endif
