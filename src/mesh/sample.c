/* Farthest-point samples: vertices far from each other, each the farthest from those before it.
 * Eldar, Lindenbaum, Porat, Zeevi, "The farthest point strategy for progressive image sampling", IEEE
 * Transactions on Image Processing 6 (1997). The distance is that along edges and across pairs of
 * triangles laid flat, some per cent above the geodesic one, which is good enough to spread points. */
#include "mesh/mesh.h"

#include "base/heap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct sampler {
    dmk_context *context;
    const dmk_mesh *mesh;
    dmk_vertex_stars star;
    double *distance; /* n_vertices: to the nearest sample; infinite where no path leads */
    dmk_heap heap;    /* of vertices by their distance; entries that are out of date are skipped */
} sampler;

static int reach(sampler *s, int32_t v, double distance)
{
    if (!(distance < s->distance[v])) return DMK_OK;
    s->distance[v] = distance;
    return dmk_heap_push(s->context, &s->heap, distance, v);
}

/* From corner k of t across the opposite edge, the neighbour laid flat: *length to its far corner, which
 * is returned; -1 at a border, or where the straight line would leave the two triangles. */
static int32_t unfold(const dmk_mesh *m, int32_t t, int k, double *length)
{
    const int32_t e = m->triangle_edge[3 * t + k], other = dmk_twin_triangle(m, t, e);
    if (other < 0) return -1;
    const int32_t h = dmk_half_edge_on(m, other, e);
    const double side = m->length[e];
    /* Heights over the edge and feet along it, from its end at corner k + 1 of t. */
    const double up = 2 * m->area[t] / side, down = 2 * m->area[other] / side;
    const double foot = dmk_cot(m, 3 * t + (k + 1) % 3) * up,
                 far = dmk_cot(m, dmk_previous(h)) * down;
    const double crossing = foot + (far - foot) * up / (up + down);
    if (!(crossing > 0 && crossing < side)) return -1;
    *length = hypot(far - foot, up + down);
    return m->triangle[h];
}

static int relax(sampler *s, dmk_heap_item from)
{
    int rc = DMK_OK;
    const dmk_mesh *m = s->mesh;
    for (int32_t i = s->star.row[from.item]; i < s->star.row[from.item + 1]; i++) {
        const int32_t t = s->star.triangle[i] / 4;
        const int k = s->star.triangle[i] % 4;
        for (int j = 1; j < 3; j++) {
            const int32_t e = m->triangle_edge[3 * t + (k + 3 - j) % 3];
            DMK_TRY(reach(s, m->triangle[3 * t + (k + j) % 3], from.key + m->length[e]));
        }
        double length;
        const int32_t far = unfold(m, t, k, &length);
        if (far >= 0) DMK_TRY(reach(s, far, from.key + length));
    }
done:
    return rc;
}

static int spread_from(sampler *s, int32_t v)
{
    int rc;
    DMK_TRY(reach(s, v, 0));
    while (s->heap.n > 0) {
        const dmk_heap_item q = dmk_heap_pop(&s->heap);
        if (q.key > s->distance[q.item]) continue;
        DMK_TRY(relax(s, q));
    }
    rc = dmk_poll(s->context);
done:
    return rc;
}

/* Of the vertices in triangles the farthest, the first of several; -1 if all are samples. */
static int32_t farthest(const sampler *s)
{
    int32_t best = -1;
    for (int32_t v = 0; v < s->mesh->n_vertices; v++) {
        if (s->star.row[v] == s->star.row[v + 1] || !(s->distance[v] > 0)) continue;
        if (best < 0 || s->distance[v] > s->distance[best]) best = v;
    }
    return best;
}

static int check(dmk_context *ctx, const sampler *s, size_t n, int64_t first)
{
    const dmk_mesh *m = s->mesh;
    if (first < 0 || first >= m->n_vertices || s->star.row[first] == s->star.row[first + 1]) {
        return dmk_fail(
            ctx, DMK_E_ARG, "vertex %lld cannot be the first sample: %s", (long long)first,
            first < 0 || first >= m->n_vertices ? "out of range" : "it is in no triangle");
    }
    if (n > (size_t)m->n_used_vertices) {
        return dmk_fail(ctx, DMK_E_ARG, "%zu samples are wanted of %d vertices in triangles", n,
                        m->n_used_vertices);
    }
    return DMK_OK;
}

int dmk_mesh_sample(dmk_context *ctx, const dmk_mesh *mesh, size_t n, int64_t first,
                    int64_t *vertex)
{
    int rc;
    if (dmk_missing(ctx, "mesh", mesh, "vertex", vertex)) return DMK_E_ARG;
    sampler s = {.context = ctx, .mesh = mesh};
    DMK_TRY(dmk_mesh_check_edges(ctx, mesh));
    DMK_TRY(dmk_stage_begin(ctx, "sample"));
    DMK_TRY(dmk_vertex_stars_create(ctx, mesh, &s.star));
    DMK_TRY(check(ctx, &s, n, first));
    DMK_TRY(DMK_NEW(ctx, s.distance, (size_t)mesh->n_vertices));
    for (int32_t v = 0; v < mesh->n_vertices; v++) s.distance[v] = INFINITY;
    for (size_t i = 0; i < n; i++) {
        vertex[i] = i == 0 ? first : farthest(&s);
        if (i + 1 < n) DMK_TRY(spread_from(&s, (int32_t)vertex[i]));
    }
done:
    dmk_stage_end(ctx);
    dmk_vertex_stars_free(&s.star);
    free(s.distance);
    dmk_heap_free(&s.heap);
    return rc;
}
