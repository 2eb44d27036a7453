/* The least ways across edges that join parts of a mesh. */
#include "base/heap.h"
#include "base/sets.h"
#include "base/sort.h"
#include "geodesic/geodesic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static double to_middle(const dmk_mesh *m, int32_t h)
{
    const double a = m->length[m->triangle_edge[h]], b = m->length[m->triangle_edge[dmk_next(h)]],
                 c = m->length[m->triangle_edge[dmk_previous(h)]];
    return sqrt(fmax(0, 2 * b * b + 2 * c * c - a * a)) / 6;
}

double dmk_way_across(const dmk_geodesics *g, int32_t h)
{
    const int32_t twin = g->star.twin[h];
    return to_middle(g->mesh, h) + (twin >= 0 ? to_middle(g->mesh, twin) : 0);
}

/* Of a triangle: the length of the way to the part nearest to it, that part's name (-1: none found), and the half-edge
 * the way begins with (-1: it lies in the part). */
typedef struct place {
    double way;
    int32_t part, first;
} place;

typedef struct ways {
    const dmk_mesh *mesh;
    const dmk_star *star;
    const double *step;
    place *at; /* n_triangles */
    dmk_heap heap;
} ways;

/* A way to a part from the triangle of half-edge h across it. */
static int offer(dmk_context *ctx, ways *w, int32_t h, int32_t part, double way)
{
    if (!(way < w->at[h / 3].way)) return DMK_OK;
    w->at[h / 3] = (place){way, part, h};
    return dmk_heap_push(ctx, &w->heap, way, h / 3);
}

/* Parts begin with a way of 0 in their triangles, border loops with a step. */
static int begin(dmk_context *ctx, ways *w, const int32_t *loop, const bool *in_part,
                 int32_t *parent)
{
    int rc = DMK_OK;
    const int32_t n = w->mesh->n_triangles;
    for (int32_t i = 0; i < n; i++) {
        w->at[i] =
            (place){in_part[i] ? 0 : HUGE_VAL, in_part[i] ? dmk_set_find(parent, i) : -1, -1};
        if (in_part[i]) DMK_TRY(dmk_heap_push(ctx, &w->heap, 0, i));
    }
    for (int32_t h = 0; h < 3 * n; h++) {
        if (w->star->twin[h] >= 0) continue;
        const int32_t part = dmk_set_find(parent, n + loop[w->mesh->triangle[dmk_next(h)]]);
        DMK_TRY(offer(ctx, w, h, part, w->step[w->mesh->triangle_edge[h]]));
    }
done:
    return rc;
}

/* Dijkstra's algorithm. */
static int spread(dmk_context *ctx, ways *w)
{
    int rc = DMK_OK;
    while (w->heap.n > 0) {
        const dmk_heap_item from = dmk_heap_pop(&w->heap);
        for (int k = 0; k < 3 && from.key <= w->at[from.item].way; k++) {
            const int32_t h = 3 * from.item + k, twin = w->star->twin[h];
            if (twin < 0) continue;
            const double way = from.key + w->step[w->mesh->triangle_edge[h]];
            DMK_TRY(offer(ctx, w, twin, w->at[from.item].part, way));
        }
    }
done:
    return rc;
}

/* Mark the edges from a triangle to its part. */
static void mark(const ways *w, int32_t triangle, bool *kept)
{
    while (triangle >= 0 && w->at[triangle].first >= 0) {
        const int32_t h = w->at[triangle].first, twin = w->star->twin[h];
        kept[w->mesh->triangle_edge[h]] = true;
        triangle = twin >= 0 ? twin / 3 : -1;
    }
}

/* Kruskal's algorithm where the neighbourhoods of the parts meet. */
static int join(dmk_context *ctx, const ways *w, int32_t *parent, bool *kept)
{
    int rc;
    const dmk_mesh *m = w->mesh;
    dmk_keyed *way = NULL;
    size_t n = 0;
    DMK_TRY(DMK_NEW(ctx, way, (size_t)m->n_edges));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const int32_t twin = w->star->twin[h];
        if (twin < h) continue;
        const place *a = &w->at[h / 3], *b = &w->at[twin / 3];
        if (a->part == b->part) continue;
        const float length =
            (float)((a->way + w->step[m->triangle_edge[h]] + b->way) / w->star->unit);
        way[n++] = (dmk_keyed){dmk_float_key(length), h};
    }
    DMK_TRY(dmk_sort_keyed(ctx, way, n));
    for (size_t i = 0; i < n; i++) {
        const int32_t h = way[i].item, twin = w->star->twin[h];
        if (!dmk_set_unite(parent, w->at[h / 3].part, w->at[twin / 3].part)) continue;
        kept[m->triangle_edge[h]] = true;
        mark(w, h / 3, kept);
        mark(w, twin / 3, kept);
    }
done:
    free(way);
    return rc;
}

int dmk_join_parts(dmk_context *ctx, const dmk_geodesics *g, const int32_t *loop,
                   const double *step, const bool *in_part, int32_t *parent, bool *kept)
{
    int rc;
    ways w = {.mesh = g->mesh, .star = &g->star, .step = step};
    DMK_TRY(DMK_NEW(ctx, w.at, (size_t)g->mesh->n_triangles));
    DMK_TRY(begin(ctx, &w, loop, in_part, parent));
    DMK_TRY(spread(ctx, &w));
    rc = join(ctx, &w, parent, kept);
done:
    free(w.at);
    dmk_heap_free(&w.heap);
    return rc;
}
