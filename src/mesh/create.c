/* A mesh from vertices and triangles: checks, edges, components, geometry. */
#include "mesh/check.h"
#include "mesh/edges.h"

#include "base/parallel.h"
#include "base/vec3.h"

#include <stdlib.h>
#include <string.h>

static int measure_triangle(dmk_context *ctx, const struct dmk_mesh *m, int32_t t)
{
    const int32_t *e = m->triangle_edge + 3 * (size_t)t, *v = m->triangle + 3 * (size_t)t;
    const double l[3] = {m->length[e[0]], m->length[e[1]], m->length[e[2]]};
    const int64_t corner[3] = {v[0], v[1], v[2]};
    return dmk_measure_checked(ctx, l, t, corner, &m->area[t]);
}

static bool cannot_be_measured(int32_t t, void *data)
{
    return measure_triangle(NULL, data, t) != DMK_OK;
}

static void length_range(int32_t begin, int32_t end, void *data)
{
    const struct dmk_mesh *m = data;
    for (int32_t e = begin; e < end; e++) {
        const double *a = m->xyz + 3 * (size_t)m->edge_vertex[2 * e];
        const double *b = m->xyz + 3 * (size_t)m->edge_vertex[2 * e + 1];
        m->length[e] = dmk_distance(a, b);
    }
}

static int build_geometry(dmk_context *ctx, struct dmk_mesh *m)
{
    int rc;
    DMK_TRY(DMK_NEW_UNSET(ctx, m->length, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, m->area, (size_t)m->n_triangles));
    dmk_parallel(ctx, m->n_edges, length_range, m);
    int32_t t = dmk_parallel_first(ctx, m->n_triangles, cannot_be_measured, m);
    if (t >= 0) rc = measure_triangle(ctx, m, t);
done:
    return rc;
}

int dmk_mesh_adopt(dmk_context *ctx, size_t n_vertices, double *xyz, size_t n_triangles,
                   int32_t *triangle, dmk_mesh **mesh)
{
    return dmk_mesh_adopt_together(ctx, NULL, n_vertices, xyz, n_triangles, triangle, mesh);
}

int dmk_mesh_adopt_together(dmk_context *ctx, const dmk_ranks *ranks, size_t n_vertices,
                            double *xyz, size_t n_triangles, int32_t *triangle, dmk_mesh **mesh)
{
    int rc;
    struct dmk_mesh *m = NULL;
    DMK_TRY(DMK_NEW(ctx, m, 1));
    m->xyz = xyz;
    m->triangle = triangle;
    xyz = NULL;
    triangle = NULL;
    DMK_TRY(dmk_mesh_check_counts(ctx, n_vertices, n_triangles));
    m->n_vertices = (int32_t)n_vertices;
    m->n_triangles = (int32_t)n_triangles;
    DMK_TRY(dmk_check_input(ctx, m));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_mesh_build_edges(ctx, m));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_check_stars(ctx, ranks, m));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_mesh_count(ctx, m));
    DMK_TRY(dmk_mesh_build_components(ctx, m));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(build_geometry(ctx, m));
    DMK_TRY(dmk_mesh_describe(ctx, m, NULL));
    *mesh = m;
    m = NULL;
done:
    free(xyz);
    free(triangle);
    dmk_mesh_destroy(&m);
    return rc;
}

int dmk_mesh_adopt_known(dmk_context *ctx, const dmk_mesh_info *info, double *xyz,
                         int32_t *triangle, dmk_mesh **mesh)
{
    struct dmk_mesh *m = NULL;
    const int rc = DMK_NEW(ctx, m, 1);
    if (rc != DMK_OK) {
        free(xyz);
        free(triangle);
        return rc;
    }
    m->xyz = xyz;
    m->triangle = triangle;
    m->info = *info;
    m->n_vertices = (int32_t)info->n_vertices;
    m->n_triangles = (int32_t)info->n_triangles;
    m->n_edges = (int32_t)info->n_edges;
    m->n_components = (int32_t)info->n_components;
    m->n_used_vertices = (int32_t)(info->n_vertices - info->n_unused_vertices);
    m->n_border_edges = (int32_t)info->n_border_edges;
    m->n_border_loops = (int32_t)info->n_border_loops;
    *mesh = m;
    return DMK_OK;
}

int dmk_mesh_create(dmk_context *ctx, size_t n_vertices, const double *xyz, size_t n_triangles,
                    const int32_t *triangles, dmk_mesh **mesh)
{
    int rc;
    double *x = NULL;
    int32_t *t = NULL;
    if (dmk_missing(ctx, "xyz", xyz, "triangles", triangles, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_counts(ctx, n_vertices, n_triangles));
    DMK_TRY(DMK_NEW(ctx, x, 3 * n_vertices));
    DMK_TRY(DMK_NEW(ctx, t, 3 * n_triangles));
    memcpy(x, xyz, 3 * n_vertices * sizeof *x);
    memcpy(t, triangles, 3 * n_triangles * sizeof *t);
    return dmk_mesh_adopt(ctx, n_vertices, x, n_triangles, t, mesh);
done:
    free(x);
    free(t);
    return rc;
}
