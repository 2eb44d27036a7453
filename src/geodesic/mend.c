/* Distances of merged windows whose estimated error is too large, by searches from their vertices. */
#include "geodesic/search.h"

#include "base/parallel.h"

#include <stdatomic.h>
#include <stdlib.h>

typedef struct mended {
    double distance, error;
    int32_t vertex;
    bool more; /* another search may find more: there is room for its ways */
} mended;

typedef struct repairs {
    const dmk_geodesics *g;
    dmk_tracer **tracer; /* one for each thread */
    int n_threads;
    mended *list;
    int32_t n;
    _Atomic int32_t next; /* of the list, to be taken: searches differ in length */
} repairs;

static bool is_over(const dmk_geodesics *g, int32_t v)
{
    return g->arrival[v].source >= 0 && !dmk_is_source(g, v) &&
           dmk_is_over(g->tolerance, g->error[v], g->distance[v]);
}

/* What two estimates leave of a distance: the old one, and that it lies in lo..hi, most likely at `length`. If they
 * exclude each other the old one was too small. */
static void narrow(const dmk_geodesics *g, mended *m, double lo, double length, double hi)
{
    const double d = g->distance[m->vertex], error = g->error[m->vertex];
    const bool agree = lo <= d + error && hi >= d - error;
    if (agree) lo = dmk_max(lo, d - error), hi = dmk_min(hi, d + error);
    m->distance = dmk_max(lo, dmk_min(length, hi));
    m->error = dmk_max(hi - m->distance, m->distance - lo);
    if (!agree || m->error < error) return;
    m->distance = d;
    m->error = error;
}

/* Vertex `m` by a path of its own, no longer than the shortest by more than the tolerance: ways that differ by less are
 * many near focal points, 100,000 to 700,000 windows for each of 15 vertices of a million triangles, and 18,000 to
 * 100,000 so. Paths end where distances are known, but for the errors there: the shortest may be as much longer than
 * the path that was found, and no shorter than what was found, dropped or without room. */
static int mend(dmk_context *ctx, dmk_tracer *t, mended *m)
{
    int rc;
    dmk_site site = {0};
    const dmk_geodesics *g = t->g;
    const double unit = g->star.unit;
    dmk_point p = dmk_corner_point(g, m->vertex);
    DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, &p, 0, &site));
    t->slack = g->tolerance * g->distance[m->vertex] / unit;
    DMK_TRY(dmk_search_best(ctx, t, &site));
    const double length = t->best.length,
                 above = t->best.vertex >= 0 ? dmk_search_doubt(g, t->best.vertex) : 0;
    const double least = dmk_min(t->least, dmk_min(t->lost, t->bound - t->slack));
    narrow(g, m, least * unit, length * unit, (length + above) * unit);
    m->more = !dmk_search_lost(t);
    rc = dmk_poll(ctx);
done:
    dmk_site_free(&site);
    return rc;
}

static int mend_share(dmk_context *ctx, int32_t thread, void *data)
{
    int rc = DMK_OK;
    repairs *r = data;
    for (int32_t i; (i = atomic_fetch_add(&r->next, 1)) < r->n;) {
        DMK_TRY(mend(ctx, r->tracer[thread], r->list + i));
    }
done:
    return rc;
}

/* All of the list from what is known so far, and what is found then. *better: some are no longer over the tolerance,
 * and may be the ends of paths of those that are. The list is of these then. */
static int mend_all(dmk_context *ctx, dmk_geodesics *g, repairs *r, bool *better)
{
    int rc;
    int32_t left = 0;
    r->next = 0;
    DMK_TRY(dmk_parallel_pieces(ctx, r->n_threads, mend_share, r));
    *better = false;
    for (int32_t i = 0; i < r->n; i++) {
        const mended m = r->list[i];
        g->distance[m.vertex] = m.distance;
        g->error[m.vertex] = m.error;
        *better = *better || !is_over(g, m.vertex);
        if (m.more && is_over(g, m.vertex)) r->list[left++] = m;
    }
    r->n = left;
done:
    return rc;
}

int dmk_tracer_repair(dmk_context *ctx, dmk_geodesics *g, bool *few)
{
    int rc = DMK_OK;
    mended list[DMK_MOST_REPAIRS];
    repairs r = {.g = g, .list = list};
    *few = true;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (!is_over(g, v)) continue;
        *few = r.n < DMK_MOST_REPAIRS;
        if (!*few) goto done;
        list[r.n++].vertex = v;
    }
    r.n_threads = dmk_min_i(dmk_parallel_threads(ctx), r.n);
    DMK_TRY(DMK_NEW(ctx, r.tracer, (size_t)r.n_threads));
    for (int i = 0; i < r.n_threads; i++) DMK_TRY(dmk_tracer_create(ctx, g, &r.tracer[i]));
    for (bool better = true; better && r.n > 0;) DMK_TRY(mend_all(ctx, g, &r, &better));
done:
    for (int i = 0; r.tracer && i < r.n_threads; i++) dmk_tracer_destroy(&r.tracer[i]);
    free(r.tracer);
    return rc;
}
