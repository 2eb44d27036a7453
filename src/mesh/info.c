/* Counts and sizes of a mesh, and the plain accessors. */
#include "base/parallel.h"
#include "mesh/mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
    DMK_TRY(DMK_NEW_UNSET(ctx, next, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, m->corner, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++) m->corner[v] = next[v] = -1;
    for (int32_t h = 3 * m->n_triangles - 1; h >= 0; h--) m->corner[m->triangle[h]] = h;
    for (int32_t v = 0; v < m->n_vertices; v++) m->n_used_vertices += m->corner[v] >= 0;
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        const int32_t h = dmk_half_edge_on(m, m->edge_triangle[2 * (size_t)e], e);
        next[m->triangle[dmk_next(h)]] = m->triangle[dmk_previous(h)];
        m->n_border_edges++;
    }
    if (m->n_border_edges > 0) m->n_border_loops = count_loops(next, m->n_vertices);
done:
    free(next);
    return rc;
}

typedef struct measuring {
    const dmk_mesh *mesh;
    bool corners;
    dmk_measures piece[DMK_MEASURE_PIECES];
} measuring;

static void measure_edges(const dmk_mesh *m, int32_t begin, int32_t end, dmk_measures *of)
{
    for (int32_t e = begin; e < end; e++) {
        of->edges += m->length[e];
        dmk_measures_edge(of, m->length[e]);
    }
}

static void measure_areas(const dmk_mesh *m, int32_t begin, int32_t end, dmk_measures *of)
{
    for (int32_t t = begin; t < end; t++) of->area += m->area[t];
}

static void measure_corners(const dmk_mesh *m, int32_t begin, int32_t end, dmk_measures *of)
{
    for (int32_t h = 3 * begin; h < 3 * end; h++)
        dmk_measures_corner(of, dmk_cot(m, h), m->xyz + 3 * (size_t)m->triangle[h]);
}

dmk_measures dmk_measures_none(void)
{
    return (dmk_measures){.min_edge = INFINITY,
                          .max_edge = -INFINITY,
                          .min_cot = INFINITY,
                          .max_cot = -INFINITY,
                          .box_min = {INFINITY, INFINITY, INFINITY},
                          .box_max = {-INFINITY, -INFINITY, -INFINITY}};
}

static int32_t part_of(int32_t n, int32_t k)
{
    return dmk_range_begin(n, k, DMK_MEASURE_PIECES);
}

static int measure_piece(dmk_context *ctx, int32_t k, void *data)
{
    (void)ctx;
    measuring *job = data;
    const dmk_mesh *m = job->mesh;
    dmk_measures of = dmk_measures_none();
    measure_edges(m, part_of(m->n_edges, k), part_of(m->n_edges, k + 1), &of);
    measure_areas(m, part_of(m->n_triangles, k), part_of(m->n_triangles, k + 1), &of);
    if (job->corners)
        measure_corners(m, part_of(m->n_triangles, k), part_of(m->n_triangles, k + 1), &of);
    job->piece[k] = of;
    return DMK_OK;
}

void dmk_measures_add(dmk_measures *to, const dmk_measures *p)
{
    to->edges += p->edges;
    to->area += p->area;
    to->min_edge = dmk_min(to->min_edge, p->min_edge);
    to->max_edge = dmk_max(to->max_edge, p->max_edge);
    to->min_cot = dmk_min(to->min_cot, p->min_cot);
    to->max_cot = dmk_max(to->max_cot, p->max_cot);
    for (int k = 0; k < 3; k++) {
        to->box_min[k] = dmk_min(to->box_min[k], p->box_min[k]);
        to->box_max[k] = dmk_max(to->box_max[k], p->box_max[k]);
    }
}

void dmk_measures_tell(const dmk_measures *all, dmk_mesh_info *info)
{
    info->min_edge = all->min_edge;
    info->max_edge = all->max_edge;
    info->mean_edge = all->edges / (double)info->n_edges;
    info->area = all->area;
    info->min_angle = DMK_DEGREES * atan2(1, all->max_cot); /* the cotangent falls with the angle */
    info->max_angle = DMK_DEGREES * atan2(1, all->min_cot);
    memcpy(info->box_min, all->box_min, sizeof info->box_min);
    memcpy(info->box_max, all->box_max, sizeof info->box_max);
}

static void take_corners(const dmk_mesh *same, dmk_mesh *m)
{
    m->sharpest = same->sharpest;
    m->info.min_angle = same->info.min_angle;
    m->info.max_angle = same->info.max_angle;
    memcpy(m->info.box_min, same->info.box_min, sizeof m->info.box_min);
    memcpy(m->info.box_max, same->info.box_max, sizeof m->info.box_max);
}

int dmk_mesh_describe(dmk_context *ctx, dmk_mesh *m, const dmk_mesh *same)
{
    int rc;
    measuring job = {.mesh = m, .corners = !same};
    dmk_measures all = dmk_measures_none();
    DMK_TRY(dmk_parallel_pieces(ctx, DMK_MEASURE_PIECES, measure_piece, &job));
    for (int k = 0; k < DMK_MEASURE_PIECES; k++) dmk_measures_add(&all, &job.piece[k]);
    m->info = (dmk_mesh_info){
        .n_vertices = (size_t)m->n_vertices,
        .n_triangles = (size_t)m->n_triangles,
        .n_edges = (size_t)m->n_edges,
        .n_unused_vertices = (size_t)(m->n_vertices - m->n_used_vertices),
        .n_border_edges = (size_t)m->n_border_edges,
        .n_border_loops = (size_t)m->n_border_loops,
        .n_components = (size_t)m->n_components,
        .euler = (int64_t)m->n_used_vertices - m->n_edges + m->n_triangles,
    };
    dmk_measures_tell(&all, &m->info);
    m->sharpest = dmk_max(all.max_cot, -all.min_cot);
    if (same) take_corners(same, m);
done:
    return rc;
}

void dmk_mesh_get_info(const dmk_mesh *m, dmk_mesh_info *info)
{
    if (info) *info = m ? m->info : (dmk_mesh_info){0};
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
