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

/* (b - a) x (c - a): along the normal of the triangle a b c, of length twice the area. */
static inline void dmk_area_vector(const double a[3], const double b[3], const double c[3],
                                   double n[3])
{
    double p[3], q[3];
    dmk_subtract(b, a, p);
    dmk_subtract(c, a, q);
    dmk_cross(p, q, n);
}

/* The least altitude of the triangle a b c over its longest side: small for slivers. */
static inline double dmk_altitude_ratio(const double a[3], const double b[3], const double c[3])
{
    double n[3];
    dmk_area_vector(a, b, c, n);
    const double longest = fmax(dmk_distance_squared(a, b), dmk_distance_squared(a, c));
    return sqrt(dmk_dot(n, n)) / fmax(longest, dmk_distance_squared(b, c));
}

#endif
