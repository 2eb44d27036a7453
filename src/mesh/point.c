/* Points on the surface: the nearest one, a vertex's, and their positions in space. */
#include "mesh/box.h"

#include "base/vec3.h"

#include <math.h>

/* Weights below this are rounding and become exactly 0: the point then lies on an edge or at a
 * vertex. */
#define SNAP 1e-9

static double distance2(const double *const corner[3], const double w[3], const double x[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        double d = w[0] * (corner[0][k] - x[k]) + w[1] * (corner[1][k] - x[k]) +
                   w[2] * (corner[2][k] - x[k]);
        sum += d * d;
    }
    return sum;
}

/* The nearest point of the side from corner i to j. */
static void project_side(const double *const corner[3], int i, int j, const double x[3],
                         double w[3])
{
    double side[3], to[3];
    dmk_subtract(corner[j], corner[i], side);
    dmk_subtract(x, corner[i], to);
    double s = dmk_dot(side, to) / dmk_dot(side, side);
    s = s < 0 ? 0 : s > 1 ? 1 : s;
    w[0] = w[1] = w[2] = 0;
    w[i] = 1 - s;
    w[j] = s;
}

/* Take from h what it has along p, as exactly as it can be told from h. */
static void take_along(const double p[3], double h[3])
{
    const double part = dmk_dot(p, h) / dmk_dot(p, p);
    for (int k = 0; k < 3; k++) h[k] -= part * p[k];
}

/* The foot of the perpendicular in barycentric weights: x - a = p (b-a) + q (c-a) + what is normal to both, solved
 * by the height h of c over a and b. Of a needle h is a small difference of long sides: what it has along them by
 * rounding, the foot would be off, and so it is taken twice. */
static void project_plane(const double *const corner[3], const double x[3], double w[3])
{
    double p[3], q[3], r[3], h[3];
    dmk_subtract(corner[1], corner[0], p);
    dmk_subtract(corner[2], corner[0], q);
    dmk_subtract(x, corner[0], r);
    dmk_subtract(corner[2], corner[0], h);
    take_along(p, h);
    take_along(p, h);
    w[2] = dmk_dot(h, r) / dmk_dot(h, h);
    w[1] = (dmk_dot(p, r) - w[2] * dmk_dot(p, q)) / dmk_dot(p, p);
    w[0] = 1 - w[1] - w[2];
}

/* The nearest point of a triangle: the foot if it lies inside, else the nearest one of the sides.
 * Gives the squared distance. */
double dmk_project_corners(const double *const corner[3], const double x[3], double w[3])
{
    project_plane(corner, x, w);
    if (w[0] >= 0 && w[1] >= 0 && w[2] >= 0) return distance2(corner, w, x);
    double best = INFINITY;
    for (int k = 0; k < 3; k++) {
        double side[3];
        project_side(corner, k, (k + 1) % 3, x, side);
        double d = distance2(corner, side, x);
        if (!(d < best)) continue;
        best = d;
        for (int i = 0; i < 3; i++) w[i] = side[i];
    }
    return best;
}

/* The box around a triangle. */
static dmk_box box_of(const double *const corner[3])
{
    dmk_box b = dmk_box_none();
    for (int k = 0; k < 3; k++) dmk_box_take(&b, corner[k], corner[k]);
    return b;
}

void dmk_point_snap(double w[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        if (w[k] < SNAP) w[k] = 0;
        sum += w[k];
    }
    for (int k = 0; k < 3; k++) w[k] /= sum;
}

static void get_corners(const dmk_mesh *m, int64_t t, const double *corner[3])
{
    for (int k = 0; k < 3; k++) corner[k] = m->xyz + 3 * (size_t)m->triangle[3 * t + k];
}

int dmk_point_check(dmk_context *ctx, const dmk_mesh *m, const char *what, const dmk_point *point)
{
    const double *w = point->weight;
    if (point->triangle < 0 || point->triangle >= m->n_triangles) {
        return dmk_fail(ctx, DMK_E_ARG, "%s: triangle %lld is out of range [0, %d]", what,
                        (long long)point->triangle, m->n_triangles - 1);
    }
    if (!(w[0] >= 0 && w[1] >= 0 && w[2] >= 0 && fabs(w[0] + w[1] + w[2] - 1) <= SNAP)) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "%s: weights %g %g %g: they must not be negative and their sum must be 1",
                        what, w[0], w[1], w[2]);
    }
    return DMK_OK;
}

int dmk_mesh_project(dmk_context *ctx, const dmk_mesh *m, const double xyz[3], dmk_point *point)
{
    if (dmk_missing(ctx, "mesh", m, "xyz", xyz, "point", point)) return DMK_E_ARG;
    if (!isfinite(xyz[0]) || !isfinite(xyz[1]) || !isfinite(xyz[2])) {
        return dmk_fail(ctx, DMK_E_ARG, "the point (%g, %g, %g) is not finite", xyz[0], xyz[1],
                        xyz[2]);
    }
    double best = INFINITY, w[3];
    dmk_point nearest = {-1, {0, 0, 0}};
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const double *corner[3];
        get_corners(m, t, corner);
        const dmk_box box = box_of(corner);
        if (dmk_box_distance2(&box, xyz) >= best) continue;
        double d = dmk_project_corners(corner, xyz, w);
        if (!(d < best)) continue;
        best = d;
        nearest = (dmk_point){t, {w[0], w[1], w[2]}};
    }
    if (nearest.triangle < 0) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "the point (%g, %g, %g) is too far from the mesh for double precision",
                        xyz[0], xyz[1], xyz[2]);
    }
    dmk_point_snap(nearest.weight);
    *point = nearest;
    return DMK_OK;
}

double dmk_mesh_nearest_in(const dmk_mesh *m, int32_t triangle, const double xyz[3],
                           double weight[3])
{
    const double *corner[3];
    get_corners(m, triangle, corner);
    return sqrt(dmk_project_corners(corner, xyz, weight));
}

/* The first triangle's corner at a vertex, or -1; a mesh of which all is known keeps none. */
static int32_t first_corner(const dmk_mesh *m, int64_t vertex)
{
    int32_t h = 0;
    if (m->corner) return m->corner[vertex];
    while (h < 3 * m->n_triangles && m->triangle[h] != vertex) h++;
    return h < 3 * m->n_triangles ? h : -1;
}

/* The point at `vertex` of n, which is vertex `now` of the mesh, or none of it: -1. */
static int place_vertex(dmk_context *ctx, const dmk_mesh *m, size_t n, int64_t vertex, int64_t now,
                        dmk_point *point)
{
    if (vertex < 0 || (size_t)vertex >= n) {
        return dmk_fail(ctx, DMK_E_ARG, "vertex %lld is out of range [0, %zu]", (long long)vertex,
                        n - 1);
    }
    const int32_t h = now < 0 ? -1 : first_corner(m, now);
    if (h < 0) {
        return dmk_fail(ctx, DMK_E_ARG, "vertex %lld is in no triangle: choose one that is",
                        (long long)vertex);
    }
    *point = (dmk_point){h / 3, {0, 0, 0}};
    point->weight[h % 3] = 1;
    return DMK_OK;
}

int dmk_mesh_vertex_point(dmk_context *ctx, const dmk_mesh *m, int64_t vertex, dmk_point *point)
{
    if (dmk_missing(ctx, "mesh", m, "point", point)) return DMK_E_ARG;
    return place_vertex(ctx, m, (size_t)m->n_vertices, vertex, vertex, point);
}

int dmk_repairs_vertex_point(dmk_context *ctx, const dmk_mesh *m, const dmk_repairs *repair,
                             int64_t vertex, dmk_point *point)
{
    if (dmk_missing(ctx, "mesh", m, "repair", repair, "point", point)) return DMK_E_ARG;
    if (!repair->vertex_new) return dmk_mesh_vertex_point(ctx, m, vertex, point);
    const bool is_old = vertex >= 0 && (size_t)vertex < repair->n_old_vertices;
    return place_vertex(ctx, m, repair->n_old_vertices, vertex,
                        is_old ? repair->vertex_new[vertex] : -1, point);
}

int dmk_mesh_point_xyz(dmk_context *ctx, const dmk_mesh *m, const dmk_point *point, double xyz[3])
{
    if (dmk_missing(ctx, "mesh", m, "point", point, "xyz", xyz)) return DMK_E_ARG;
    int rc = dmk_point_check(ctx, m, "the point", point);
    if (rc != DMK_OK) return rc;
    const double *w = point->weight, *corner[3];
    get_corners(m, point->triangle, corner);
    for (int k = 0; k < 3; k++) {
        xyz[k] = w[0] * corner[0][k] + w[1] * corner[1][k] + w[2] * corner[2][k];
    }
    return DMK_OK;
}
