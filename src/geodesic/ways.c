/* The least ways across edges that join parts of a mesh. */
#include "base/heap.h"
#include "base/sets.h"
#include "geodesic/geodesic.h"

#include <math.h>
#include <stdlib.h>

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
    place *at;     /* n_triangles */
    dmk_heap heap; /* triangles by their ways */
    dmk_heap met;  /* half-edges across which two parts have met, by the way's length as a float */
    int32_t *parent;
    bool *kept;
    int32_t n_apart; /* parts to be joined still */
} ways;

/* A way to a part from the triangle of half-edge h across it. */
static int offer(dmk_context *ctx, ways *w, int32_t h, int32_t part, double way)
{
    if (!(way < w->at[h / 3].way)) return DMK_OK;
    w->at[h / 3] = (place){way, part, h};
    return dmk_heap_push(ctx, &w->heap, way, h / 3);
}

/* Parts begin with a way of 0 in their triangles, border loops with a step. */
static int begin(dmk_context *ctx, ways *w, const int32_t *loop, const bool *in_part)
{
    int rc = DMK_OK;
    const int32_t n = w->mesh->n_triangles;
    for (int32_t i = 0; i < n; i++) {
        w->at[i] =
            (place){in_part[i] ? 0 : HUGE_VAL, in_part[i] ? dmk_set_find(w->parent, i) : -1, -1};
        if (in_part[i]) DMK_TRY(dmk_heap_push(ctx, &w->heap, 0, i));
    }
    for (int32_t h = 0; h < 3 * n; h++) {
        if (w->star->twin[h] >= 0) continue;
        const int32_t part = dmk_set_find(w->parent, n + loop[w->mesh->triangle[dmk_next(h)]]);
        DMK_TRY(offer(ctx, w, h, part, w->step[w->mesh->triangle_edge[h]]));
    }
done:
    return rc;
}

/* Mark the edges from a triangle to its part. */
static void mark(const ways *w, int32_t triangle)
{
    while (triangle >= 0 && w->at[triangle].first >= 0) {
        const int32_t h = w->at[triangle].first, twin = w->star->twin[h];
        w->kept[w->mesh->triangle_edge[h]] = true;
        triangle = twin >= 0 ? twin / 3 : -1;
    }
}

static double as_float(const ways *w, double length)
{
    return (double)(float)(length / w->star->unit);
}

/* The neighbourhoods of two parts meet across half-edge h, if its triangles are of two. */
static int meet(dmk_context *ctx, ways *w, int32_t h)
{
    const int32_t twin = w->star->twin[h];
    if (twin < h) return meet(ctx, w, twin);
    const place *a = &w->at[h / 3], *b = &w->at[twin / 3];
    if (a->part == b->part) return DMK_OK;
    return dmk_heap_push(ctx, &w->met,
                         as_float(w, a->way + w->step[w->mesh->triangle_edge[h]] + b->way), h);
}

/* Kruskal's algorithm, as far as the ways of less than `length` go. */
static void join(ways *w, double length)
{
    while (w->n_apart > 1 && w->met.n > 0 && w->met.at[0].key < length) {
        const int32_t h = dmk_heap_pop(&w->met).item, twin = w->star->twin[h];
        if (!dmk_set_unite(w->parent, w->at[h / 3].part, w->at[twin / 3].part)) continue;
        w->n_apart--;
        w->kept[w->mesh->triangle_edge[h]] = true;
        mark(w, h / 3);
        mark(w, twin / 3);
    }
}

/* From a triangle that none comes nearer to: what this brings its neighbours, or where its part meets theirs. */
static int settle(dmk_context *ctx, ways *w, dmk_heap_item from)
{
    int rc = DMK_OK;
    const int32_t t = from.item;
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        const int32_t twin = w->star->twin[h];
        if (twin < 0) continue;
        const double there = w->at[twin / 3].way;
        if (there < from.key || (there == from.key && twin / 3 < t)) DMK_TRY(meet(ctx, w, h));
        DMK_TRY(offer(ctx, w, twin, w->at[t].part, from.key + w->step[w->mesh->triangle_edge[h]]));
    }
done:
    return rc;
}

/* Dijkstra's algorithm from all parts at once. Where two meet, each has come at most half of the way: so all ways of
 * less than twice the length at which it is are known, and it ends as soon as they join all. */
static int spread(dmk_context *ctx, ways *w)
{
    int rc = DMK_OK;
    while (w->heap.n > 0 && w->n_apart > 1) {
        const dmk_heap_item from = dmk_heap_pop(&w->heap);
        if (!(from.key <= w->at[from.item].way)) continue;
        join(w, as_float(w, 2 * from.key));
        DMK_TRY(settle(ctx, w, from));
    }
    join(w, HUGE_VAL);
done:
    return rc;
}

int dmk_join_parts(dmk_context *ctx, const dmk_geodesics *g, const int32_t *loop,
                   const double *step, const bool *in_part, int32_t n_parts, int32_t *parent,
                   bool *kept)
{
    int rc;
    ways w = {.mesh = g->mesh,
              .star = &g->star,
              .step = step,
              .parent = parent,
              .kept = kept,
              .n_apart = n_parts};
    DMK_TRY(DMK_NEW_UNSET(ctx, w.at, (size_t)g->mesh->n_triangles));
    DMK_TRY(begin(ctx, &w, loop, in_part));
    rc = spread(ctx, &w);
done:
    free(w.at);
    dmk_heap_free(&w.heap);
    dmk_heap_free(&w.met);
    return rc;
}
