/* Midpoint subdivision: see refine.h. */
#include "surfaces/refine.h"

#include <stdlib.h>
#include <string.h>

static void place_vertices(const dmk_mesh *m, dmk_lift_fn lift, const void *user, double *xyz)
{
    memcpy(xyz, m->xyz, 3 * (size_t)m->n_vertices * sizeof *xyz);
    for (int32_t e = 0; e < m->n_edges; e++) {
        const double *a = m->xyz + 3 * (size_t)m->edge_vertex[2 * e];
        const double *b = m->xyz + 3 * (size_t)m->edge_vertex[2 * e + 1];
        double *mid = xyz + 3 * ((size_t)m->n_vertices + (size_t)e);
        for (int i = 0; i < 3; i++) mid[i] = 0.5 * (a[i] + b[i]);
        if (lift) lift(user, mid);
    }
}

static void split_triangles(const dmk_mesh *m, int32_t *child)
{
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * t, *e = m->triangle_edge + 3 * t;
        int32_t *c = child + 12 * (size_t)t;
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < 3; j++) {
                c[3 * k + j] = j == k ? v[k] : m->n_vertices + e[3 - k - j];
            }
            c[9 + k] = m->n_vertices + e[k];
        }
    }
}

int dmk_mesh_refine(dmk_context *ctx, const dmk_mesh *m, dmk_lift_fn lift, const void *user,
                    dmk_mesh **fine)
{
    int rc;
    double *xyz = NULL;
    int32_t *triangle = NULL;
    size_t n_vertices = (size_t)m->n_vertices + (size_t)m->n_edges;
    size_t n_triangles = 4 * (size_t)m->n_triangles;
    if (n_triangles > DMK_MOST_TRIANGLES || n_vertices > DMK_MOST_TRIANGLES) {
        rc = dmk_fail(ctx, DMK_E_ARG,
                      "refining %d triangles would give %zu, more than 32-bit indices hold; refine "
                      "less",
                      m->n_triangles, n_triangles);
        goto done;
    }
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * n_vertices));
    DMK_TRY(DMK_NEW(ctx, triangle, 3 * n_triangles));
    place_vertices(m, lift, user, xyz);
    split_triangles(m, triangle);
    return dmk_mesh_adopt(ctx, n_vertices, xyz, n_triangles, triangle, fine);
done:
    free(xyz);
    free(triangle);
    return rc;
}
