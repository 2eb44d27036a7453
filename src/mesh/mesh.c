#include "mesh/mesh.h"

#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>

/* Sides whose fourth power neither overflows nor, for the thinnest triangle, underflows. */
#define LONGEST 1e75
#define SHORTEST 1e-65

bool dmk_sides_are_flat(const double l[3])
{
    int32_t e[3] = {0, 1, 2};
    dmk_sort_sides(l, e);
    return !(l[e[2]] - (l[e[0]] - l[e[1]]) > 4 * DBL_EPSILON * l[e[0]]);
}

void dmk_measure_sides(const double l[3], double *area, double cot[3])
{
    int32_t e[3] = {0, 1, 2};
    dmk_sort_sides(l, e);
    double a = l[e[0]], b = l[e[1]], c = l[e[2]];
    *area = 0.25 * sqrt((a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c)));
    for (int k = 0; k < 3; k++) {
        double o = l[k], p = l[(k + 1) % 3], q = l[(k + 2) % 3];
        cot[k] = (p * p + q * q - o * o) / (4 * *area);
    }
}

double dmk_area_in_space(const dmk_mesh *m, int32_t t)
{
    const int32_t *v = m->triangle + 3 * (size_t)t;
    double n[3];
    dmk_area_vector(m->xyz + 3 * (size_t)v[0], m->xyz + 3 * (size_t)v[1], m->xyz + 3 * (size_t)v[2],
                    n);
    const double area = 0.5 * dmk_distance(n, (const double[3]){0});
    return area > 0 ? area : m->area[t];
}

int dmk_measure_checked(dmk_context *ctx, const double l[3], int64_t t, const int64_t v[3],
                        double *area)
{
    double cot[3];
    const double a = dmk_max(l[0], dmk_max(l[1], l[2]));
    if (a > LONGEST || (a > 0 && a < SHORTEST)) {
        if (!ctx) return DMK_E_MESH;
        return dmk_fail(ctx, DMK_E_MESH,
                        "triangle %lld has a side of %g, too %s to compute with its powers; scale "
                        "the mesh",
                        (long long)t, a, a > 1 ? "long" : "short");
    }
    if (dmk_sides_are_flat(l)) {
        if (!ctx) return DMK_E_MESH;
        return dmk_fail(ctx, DMK_E_MESH,
                        "triangle %lld (vertices %lld %lld %lld) is degenerate: its area is zero; "
                        "remove it or merge its corners; a repair does that",
                        (long long)t, (long long)v[0], (long long)v[1], (long long)v[2]);
    }
    dmk_measure_sides(l, area, cot);
    return DMK_OK;
}

int dmk_mesh_check_counts(dmk_context *ctx, size_t n_vertices, size_t n_triangles)
{
    if (n_triangles > 0 && n_triangles <= DMK_MOST_TRIANGLES && n_vertices <= DMK_MOST_TRIANGLES) {
        return DMK_OK;
    }
    if (n_triangles == 0) {
        return dmk_fail(ctx, DMK_E_MESH, "%zu vertices and %zu triangles: nothing to solve",
                        n_vertices, n_triangles);
    }
    return dmk_fail(
        ctx, DMK_E_MESH,
        "%zu vertices and %zu triangles: too many for 32-bit indices, which count to %d of each",
        n_vertices, n_triangles, DMK_MOST_TRIANGLES);
}

void dmk_mesh_forget_edges(dmk_mesh *m)
{
    if (!m) return;
    free(m->triangle_edge);
    free(m->edge_vertex);
    free(m->edge_triangle);
    free(m->length);
    free(m->area);
    m->triangle_edge = m->edge_vertex = m->edge_triangle = NULL;
    m->length = m->area = NULL;
}

void dmk_mesh_destroy(dmk_mesh **mesh)
{
    struct dmk_mesh *m = mesh ? *mesh : NULL;
    if (!m) return;
    dmk_mesh_forget_edges(m);
    free(m->xyz);
    free(m->triangle);
    free(m->corner);
    free(m->component);
    free(m);
    *mesh = NULL;
}

int dmk_mesh_check_edges(dmk_context *ctx, const dmk_mesh *m)
{
    return m->length ? DMK_OK
                     : dmk_fail(ctx, DMK_E_ARG,
                                "the mesh has no edges any more, they were given back: make what "
                                "needs them before, or create the mesh anew");
}
