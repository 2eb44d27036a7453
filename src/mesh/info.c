/* Counts and sizes of a mesh, and the plain accessors. */
#include "mesh/mesh.h"

#include <math.h>
#include <stdlib.h>

/* next[v] is where the border goes from v, or -1; each border vertex has one way on, since its
 * triangles form one chain. */
static int32_t count_loops(int32_t *next, int32_t n_vertices)
{
    int32_t n = 0;
    for (int32_t start = 0; start < n_vertices; start++) {
        if (next[start] < 0) continue;
        n++;
        for (int32_t v = start; next[v] >= 0;) {
            int32_t to = next[v];
            next[v] = -1;
            v = to;
        }
    }
    return n;
}

int dmk_mesh_count(dmk_context *ctx, dmk_mesh *m)
{
    int rc;
    int32_t *next = NULL;
    DMK_TRY(DMK_NEW(ctx, next, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++) next[v] = -2;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (next[m->triangle[h]] == -2) next[m->triangle[h]] = -1;
    }
    for (int32_t v = 0; v < m->n_vertices; v++) m->n_used_vertices += next[v] != -2;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (m->edge_triangle[2 * (size_t)m->triangle_edge[h] + 1] >= 0) continue;
        const int32_t *c = m->triangle + 3 * (size_t)(h / 3);
        next[c[(h % 3 + 1) % 3]] = c[(h % 3 + 2) % 3];
        m->n_border_edges++;
    }
    if (m->n_border_edges > 0) m->n_border_loops = count_loops(next, m->n_vertices);
done:
    free(next);
    return rc;
}

static void measure_edges(const dmk_mesh *m, dmk_mesh_info *info)
{
    double sum = 0;
    info->min_edge = INFINITY;
    for (int32_t e = 0; e < m->n_edges; e++) {
        double l = m->length[e];
        sum += l;
        if (l < info->min_edge) info->min_edge = l;
        if (l > info->max_edge) info->max_edge = l;
    }
    info->mean_edge = sum / m->n_edges;
}

/* The cotangent falls with the angle, so its extremes are those of the angle. */
static void measure_triangles(const dmk_mesh *m, dmk_mesh_info *info)
{
    double lo = INFINITY, hi = -INFINITY;
    for (int32_t t = 0; t < m->n_triangles; t++) info->area += m->area[t];
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const double cot = dmk_cot(m, h);
        if (cot < lo) lo = cot;
        if (cot > hi) hi = cot;
    }
    const double degree = 57.295779513082320877;
    info->min_angle = degree * atan2(1, hi);
    info->max_angle = degree * atan2(1, lo);
}

static void measure_box(const dmk_mesh *m, dmk_mesh_info *info)
{
    for (int k = 0; k < 3; k++) {
        info->box_min[k] = INFINITY;
        info->box_max[k] = -INFINITY;
    }
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const double *x = m->xyz + 3 * (size_t)m->triangle[h];
        for (int k = 0; k < 3; k++) {
            if (x[k] < info->box_min[k]) info->box_min[k] = x[k];
            if (x[k] > info->box_max[k]) info->box_max[k] = x[k];
        }
    }
}

void dmk_mesh_get_info(const dmk_mesh *m, dmk_mesh_info *info)
{
    if (!info) return;
    *info = (dmk_mesh_info){0};
    if (!m) return;
    *info = (dmk_mesh_info){.n_vertices = (size_t)m->n_vertices,
                            .n_triangles = (size_t)m->n_triangles,
                            .n_edges = (size_t)m->n_edges,
                            .n_unused_vertices = (size_t)(m->n_vertices - m->n_used_vertices),
                            .n_border_edges = (size_t)m->n_border_edges,
                            .n_border_loops = (size_t)m->n_border_loops,
                            .n_components = (size_t)m->n_components,
                            .euler = (int64_t)m->n_used_vertices - m->n_edges + m->n_triangles};
    measure_edges(m, info);
    measure_triangles(m, info);
    measure_box(m, info);
}

const double *dmk_mesh_vertices(const dmk_mesh *m)
{
    return m ? m->xyz : NULL;
}

const int32_t *dmk_mesh_triangles(const dmk_mesh *m)
{
    return m ? m->triangle : NULL;
}

const int32_t *dmk_mesh_edges(const dmk_mesh *m)
{
    return m ? m->edge_vertex : NULL;
}
