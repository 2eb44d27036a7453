/* Polygons as triangles: the fan around the first corner where that is right, as for convex ones, else the triangles
 * of which the thinnest is as thick as can be (Klincsek, "Minimal triangulations of polygonal domains", Annals of
 * Discrete Mathematics 9, 1980), by dynamic programming over pairs of corners. Triangles that all turn as the outline
 * of a simple polygon does cover it once, so that nothing needs to be asked about what lies inside of what. */
#include "mesh/mesh.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Corners of one that is no fan: 0.2 s, by the cube of their number, and 12 MB. */
enum { MOST = 1000 };

/* Corners for which no memory is asked for. */
enum { FEW = 16 };

/* A fan that has a thinner triangle is not right: six digits leave a corner within a straight side 1e-6 of it off. */
static const double FLAT = 1e-5;

typedef struct outline {
    int32_t n;
    double *at;    /* 2 n: the corners in the plane, in which the polygon turns counterclockwise */
    double *least; /* n * n, symmetric: the thinnest triangle's thickness from corner i to j */
    int32_t *apex; /* n * n, i < j: of the triangle over i and j */
} outline;

/* Corner i, seen from the first one. */
static void see(const double *xyz, const int32_t *corner, size_t i, double scale, double at[3])
{
    dmk_subtract(xyz + 3 * (size_t)corner[i], xyz + 3 * (size_t)corner[0], at);
    for (int k = 0; k < 3; k++) at[k] *= scale;
}

/* One over the farthest coordinate, so that squares neither vanish nor overflow. */
static double find_scale(const double *xyz, size_t n, const int32_t *corner)
{
    double farthest = 0, at[3];
    for (size_t i = 1; i < n; i++) {
        see(xyz, corner, i, 1, at);
        for (int k = 0; k < 3; k++) farthest = fmax(farthest, fabs(at[k]));
    }
    return 1 / farthest;
}

/* The plane along Newell's normal; false where there is none. */
static bool lay_flat(outline *o, const double *xyz, const int32_t *corner)
{
    double sum[3] = {0}, one[3], last[3], at[3], axis[2][3];
    const size_t n = (size_t)o->n;
    const double scale = find_scale(xyz, n, corner);
    see(xyz, corner, 1, scale, last);
    for (size_t i = 2; i < n; i++) {
        see(xyz, corner, i, scale, at);
        dmk_cross(last, at, one);
        for (int k = 0; k < 3; k++) sum[k] += one[k];
        memcpy(last, at, sizeof at);
    }
    const double length = sqrt(dmk_dot(sum, sum));
    if (!(length > 0 && isfinite(length))) return false;
    const int k = fabs(sum[0]) < 0.5 * length ? 0 : 1;
    dmk_cross(sum, (const double[3]){k == 0, k == 1, 0}, one);
    const double tilt = sqrt(dmk_dot(one, one));
    for (int j = 0; j < 3; j++) axis[0][j] = one[j] / tilt;
    dmk_cross(sum, axis[0], axis[1]);
    for (size_t i = 0; i < n; i++) {
        see(xyz, corner, i, scale, at);
        o->at[2 * i] = dmk_dot(axis[0], at);
        o->at[2 * i + 1] = dmk_dot(axis[1], at) / length;
    }
    return true;
}

/* Twice the area over the sum of the squared sides, below 0 where the triangle turns the other way. */
static double thickness(const outline *o, int32_t a, int32_t b, int32_t c)
{
    const double *p = o->at + 2 * (size_t)a, *q = o->at + 2 * (size_t)b, *r = o->at + 2 * (size_t)c;
    const double e[] = {q[0] - p[0], q[1] - p[1]}, f[] = {r[0] - p[0], r[1] - p[1]},
                 g[] = {r[0] - q[0], r[1] - q[1]};
    const double squares =
        e[0] * e[0] + e[1] * e[1] + f[0] * f[0] + f[1] * f[1] + g[0] * g[0] + g[1] * g[1];
    return squares > 0 ? (e[0] * f[1] - e[1] * f[0]) / squares : 0;
}

static bool is_fan(const outline *o)
{
    for (int32_t i = 1; i + 1 < o->n; i++)
        if (!(thickness(o, 0, i, i + 1) > FLAT)) return false;
    return true;
}

/* The best apex over corners i and j, once all that are nearer to each other have theirs. */
static void find_apex(outline *o, int32_t i, int32_t j)
{
    const size_t n = (size_t)o->n;
    const double *from_i = o->least + n * (size_t)i, *from_j = o->least + n * (size_t)j;
    double best = -INFINITY;
    int32_t apex = j - 1;
    for (int32_t k = j - 1; k > i; k--) {
        double least = dmk_min(from_i[k], from_j[k]);
        if (!(least > best)) continue;
        least = dmk_min(least, thickness(o, i, k, j));
        if (!(least > best)) continue;
        best = least;
        apex = k;
    }
    o->least[n * (size_t)i + (size_t)j] = o->least[n * (size_t)j + (size_t)i] = best;
    o->apex[n * (size_t)i + (size_t)j] = apex;
}

static int32_t *put(const outline *o, const int32_t *corner, int32_t i, int32_t j,
                    int32_t *triangle)
{
    if (j - i < 2) return triangle;
    const int32_t k = o->apex[(size_t)o->n * (size_t)i + (size_t)j];
    *triangle++ = corner[i];
    *triangle++ = corner[k];
    *triangle++ = corner[j];
    return put(o, corner, k, j, put(o, corner, i, k, triangle));
}

static int split_best(dmk_context *ctx, outline *o, const int32_t *corner, int32_t *triangle)
{
    int rc;
    const size_t n = (size_t)o->n;
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(DMK_NEW(ctx, o->least, n * n));
    DMK_TRY(DMK_NEW(ctx, o->apex, n * n));
    for (size_t i = 0; i + 1 < n; i++)
        o->least[n * i + i + 1] = o->least[n * (i + 1) + i] = INFINITY;
    for (int32_t apart = 2; apart < o->n; apart++)
        for (int32_t i = 0; i + apart < o->n; i++) find_apex(o, i, i + apart);
    put(o, corner, 0, o->n - 1, triangle);
done:
    free(o->least);
    free(o->apex);
    return rc;
}

int dmk_polygon_split(dmk_context *ctx, const double *xyz, size_t n, const int32_t *corner,
                      int32_t *triangle)
{
    int rc = DMK_OK;
    double few[2 * FEW];
    outline o = {.n = (int32_t)n, .at = few};
    if (n > FEW) DMK_TRY(DMK_NEW(ctx, o.at, 2 * n));
    for (size_t i = 0; i + 2 < n; i++) {
        triangle[3 * i] = corner[0];
        triangle[3 * i + 1] = corner[i + 1];
        triangle[3 * i + 2] = corner[i + 2];
    }
    if (!lay_flat(&o, xyz, corner) || is_fan(&o)) goto done;
    if (n <= MOST) {
        rc = split_best(ctx, &o, corner, triangle);
    } else {
        rc = dmk_fail(ctx, DMK_E_MESH,
                      "a face of %zu corners (%d, %d, %d, ...) that is not convex; more than %d "
                      "are too many: split it into triangles first",
                      n, corner[0], corner[1], corner[2], MOST);
    }
done:
    if (o.at != few) free(o.at);
    return rc;
}

int dmk_polygons_split(dmk_context *ctx, size_t n_vertices, const double *xyz, size_t n_polygons,
                       size_t n_corners, const int32_t *corners, int32_t *triangles)
{
    int rc = DMK_OK;
    if (dmk_missing(ctx, "xyz", xyz, "corners", corners, "triangles", triangles)) return DMK_E_ARG;
    if (n_corners < 3)
        return dmk_fail(ctx, DMK_E_ARG, "polygons of %zu corners; expected 3 or more", n_corners);
    if (n_corners > INT32_MAX || n_polygons > INT32_MAX / n_corners)
        return dmk_fail(ctx, DMK_E_ARG, "%zu polygons of %zu corners are too many", n_polygons,
                        n_corners);
    for (size_t i = 0; i < n_polygons * n_corners; i++) {
        if (corners[i] >= 0 && (size_t)corners[i] < n_vertices) continue;
        return dmk_fail(
            ctx, DMK_E_MESH,
            "polygon %zu names the vertex %d, but there are %zu vertices, counted from 0",
            i / n_corners, corners[i], n_vertices);
    }
    for (size_t i = 0; i < n_polygons; i++) {
        DMK_TRY(dmk_polygon_split(ctx, xyz, n_corners, corners + i * n_corners,
                                  triangles + 3 * i * (n_corners - 2)));
    }
done:
    return rc;
}
