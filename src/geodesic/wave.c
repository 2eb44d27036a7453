/* Distances by merged windows: nearly linear time, within a tolerance; exact with tolerance 0: on meshes where windows
 * depth first are too many.
 *
 * On smooth meshes the windows of each edge are as many as the vertices that the paths pass, which
 * makes n^1.5 in all, though neighbours differ by some h^2 only. Here a window carries a wave of
 * its own: at (o, 0) of the half-edge the distance D, the ray's direction u and the front's
 * curvature k, so that D(X) = D + (2 u.v + k v.v) / (1 + |u + k v|),  v = X - (o, 0),  direction
 * there (u + k v) / |u + k v|: exact for a point (k = 1/r) and a line (k = 0), and as good for what
 * is left of beams behind positive curvature (k < 0). Touching windows of a half-edge become one
 * wave where the values change by less than the tolerance.
 *
 * Windows wait at their half-edge; all of its windows are there when it is taken from its bucket,
 * by the larger distance of its ends. Then: the lower envelope, merging, and a step into the
 * triangle. Values at the ends of windows stay as they are, for shifting them makes neighbours
 * jump, and windows multiply. The vertex above gets a value from each window: straight if its ray
 * is in the beam, else around the interval's nearer end: always a path's length, so that no vertex
 * is missed; what it has over the straight one goes into the error's estimate. */
#include "geodesic/wave_engine.h"

#include "base/heading.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A bucket, in mean edges: wider ones cost visits of half-edges, narrower ones empty buckets. */
static const double bucket_width = 0.1;
/* The tolerance of exact runs: what is left of rounding after ten thousand steps. Windows that flat vertices have
 * parted are one again, or tubes and ellipsoids of 1 : 10,000 would have hundreds for each edge. */
static const double exact_tolerance = 1e-11;
/* A gap's jump, over the tolerance and the length of the edge. Larger jumps let the rays of one face run on into the
 * next: without a bound distances on CAD parts are off by 7e-4. */
static const double most_jump = 30;
/* A gap's width, over the root of the tolerance and the length of the edge. Wider ones are shadows mostly: closed too,
 * they let half as many vertices of terrain again miss the tolerance. Half the width leaves gaps open that merging has
 * made: three times as many miss it on smooth surfaces stretched up to 1:30. */
static const double most_gap = 30;

/* ---- set-up ---------------------------------------------------------------------------------- */

static void clear_range(int32_t begin, int32_t end, void *data)
{
    const engine *e = data;
    for (int32_t v = begin; v < end; v++) {
        e->mark[v].half = UNREACHED;
        e->radiated[v] = INFINITY;
    }
}

static void clear_halves(int32_t begin, int32_t end, void *data)
{
    const engine *e = data;
    memset(e->head + begin, 0xff, (size_t)(end - begin) * sizeof *e->head);
}

static int engine_create(dmk_context *ctx, dmk_geodesics *g, double tolerance, engine *e)
{
    int rc;
    size_t n = (size_t)g->mesh->n_vertices, n_half = 3 * (size_t)g->mesh->n_triangles;
    if (tolerance == 0) tolerance = exact_tolerance;
    memset(e, 0, sizeof *e);
    e->allow = (allowance){.error = tolerance,
                           .step = most_jump * tolerance,
                           .gap = most_gap * sqrt(tolerance),
                           .slope = sqrt(tolerance)};
    DMK_TRY(dmk_front_create(ctx, g, &e->front));
    DMK_TRY(DMK_NEW(ctx, e->error, n));
    DMK_TRY(DMK_NEW(ctx, e->detour, n));
    DMK_TRY(DMK_NEW(ctx, e->mark, n));
    DMK_TRY(DMK_NEW(ctx, e->radiated, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, e->head, n_half));
    DMK_TRY(DMK_NEW(ctx, e->visits, n_half));
    DMK_TRY(DMK_NEW(ctx, e->shard, SHARDS));
    for (int i = 0; i < SHARDS; i++) {
        dmk_context_lend(ctx, &e->shard[i].own);
        e->shard[i].free_block = -1;
    }
    dmk_parallel(ctx, g->mesh->n_vertices, clear_range, e);
    dmk_parallel(ctx, 3 * g->mesh->n_triangles, clear_halves, e);
    e->width = bucket_width * g->mesh->info.mean_edge / g->star.unit;
    e->most_buckets =
        (size_t)(g->mesh->n_edges / bucket_width); /* no way is longer than all edges */
    e->least = INFINITY;
    for (int32_t i = 0; i < g->n_sources; i++)
        e->least = dmk_min(e->least, g->source[i].offset / g->star.unit);
    if (g->n_lines > 0) e->least = 0;
done:
    return rc;
}

static void engine_free(engine *e)
{
    dmk_front_free(&e->front);
    dmk_heap_free(&e->pseudo_sources);
    free(e->error);
    free(e->detour);
    free(e->mark);
    free(e->radiated);
    free(e->head);
    free(e->kept);
    free(e->visits);
    for (int i = 0; e->shard && i < SHARDS; i++) dmk_shard_free(e->shard + i);
    free(e->shard);
}

/* ---- the queue ------------------------------------------------------------------------------- */

/* A window of its half-edge. */
static int put(dmk_context *ctx, const engine *e, const wave *w, double key)
{
    shard *s = e->shard + dmk_waves_shard(w->half);
    const bool waits = e->head[w->half] >= 0;
    int rc = dmk_shard_store(ctx, s, w, e->head + w->half);
    s->n_made++;
    return rc != DMK_OK || waits ? rc : dmk_shard_schedule(ctx, e, s, w->half, key);
}

static bool is_over(const engine *e, int32_t v)
{
    return dmk_is_over(e->allow.error, e->error[v] + e->detour[v], e->front.d[v]);
}

static int reach(dmk_context *ctx, const engine *e, int32_t v, double d, const mark *m,
                 double error, double detour)
{
    shard *s = e->shard + dmk_waves_shard_of_vertex(v);
    const bool was_over = is_over(e, v);
    const bool nearer =
        dmk_wave_improve(e->front.d + v, e->error + v, e->detour + v, d, error, detour);
    s->n_over += is_over(e, v) - was_over;
    if (!nearer) return DMK_OK;
    e->mark[v] = *m;
    if (!e->front.pseudo_source[v]) return DMK_OK;
    const int rc = DMK_GROW(ctx, s->reached, s->n_reached + 1, s->reached_room);
    if (rc == DMK_OK) s->reached[s->n_reached++] = (dmk_heap_item){d, v};
    return rc;
}

/* ---- sources and pseudo-sources ------------------------------------------------------------------ */

typedef struct rays {
    double base, lo, hi, direction, error, detour;
    int32_t source, root; /* root -1: directions are the rays' own */
    int n_ends;           /* of a sector: 1, its first, or 2, its last, too */
} rays;

static int send(dmk_context *ctx, engine *e, const dmk_sector *c, const rays *a)
{
    int rc = DMK_OK;
    dmk_end end;
    dmk_beam b;
    bool own = a->root < 0 && a->source < e->front.g->n_sources;
    for (int last = 0; last < a->n_ends; last++) {
        if (!dmk_front_end(&e->front, c, last, a->lo, a->hi, &end)) continue;
        mark m = {own ? end.direction : a->direction,
                  end.back,
                  0,
                  HUGE_VAL,
                  STRAIGHT,
                  a->source,
                  a->root};
        DMK_TRY(reach(ctx, e, end.vertex, a->base + end.length, &m, a->error, a->detour));
    }
    if (!dmk_front_beam(&e->front, c, a->lo, a->hi, &b)) goto done;
    double o = 0.5 * (b.lo + b.hi), x = o - b.x, r = hypot(x, b.y);
    const dmk_facet *f = e->front.facet + b.half / 3;
    int k = b.half % 3;
    wave w = {b.lo, b.hi,     o,         x / r,  -b.y / r, 1 / r,     a->base + r, a->direction,
              0,    a->error, a->detour, b.half, -1,       a->source, a->root};
    if (own) w.direction = b.turn + dmk_angle_of(x, -b.y), w.turn = w.k;
    const double most =
        dmk_max(e->front.d[f->vertex[(k + 1) % 3]], e->front.d[f->vertex[(k + 2) % 3]]);
    rc = put(ctx, e, &w, dmk_wave_key(&w, f->length[k], most));
done:
    return rc;
}

static int radiate_source(dmk_context *ctx, engine *e, int32_t number)
{
    int rc = DMK_OK;
    const dmk_site *p = e->front.g->source + number;
    rays a = {p->offset / e->front.g->star.unit, -1, p->total + 1, 0, 0, 0, number, -1, 2};
    if (p->vertex >= 0) {
        mark m = {0, 0, 0, HUGE_VAL, STRAIGHT, number, -1};
        if (a.base >= e->front.d[p->vertex]) return DMK_OK;
        e->radiated[p->vertex] = a.base;
        DMK_TRY(reach(ctx, e, p->vertex, a.base, &m, 0, 0));
    }
    for (int32_t k = 0; k < p->n_sectors; k++) {
        dmk_sector c = dmk_front_site(&e->front, p, k);
        DMK_TRY(send(ctx, e, &c, &a));
    }
done:
    return rc;
}

static double back_of(const engine *e, int32_t v)
{
    const mark *m = e->mark + v;
    const dmk_star *s = &e->front.g->star;
    double back = m->half == STRAIGHT ? m->x : s->angle[m->half] + dmk_angle_of(m->x, m->y);
    return dmk_front_turn(back, s->total[v], s->border[v]);
}

static int radiate_star(dmk_context *ctx, engine *e, int32_t v, const rays *a, int turns)
{
    int rc = DMK_OK;
    const dmk_star *s = &e->front.g->star;
    int32_t c = s->first[v];
    do {
        dmk_sector sector = dmk_front_corner(&e->front, c);
        for (int k = -turns; k <= turns; k++) { /* the range may go around */
            rays b = *a;
            b.lo += k * s->total[v];
            b.hi += k * s->total[v];
            DMK_TRY(send(ctx, e, &sector, &b));
        }
        c = dmk_star_next(s, c);
    } while (c >= 0 && c != s->first[v]);
done:
    return rc;
}

static int radiate_pseudo_source(dmk_context *ctx, engine *e, int32_t v)
{
    int rc = DMK_OK;
    const dmk_star *s = &e->front.g->star;
    const mark *m = e->mark + v;
    double range[2][2];
    int n = dmk_front_directions(&e->front, v, back_of(e, v), range);
    e->radiated[v] = e->front.d[v];
    for (int i = 0; i < n; i++) {
        rays a = {e->front.d[v], range[i][0], range[i][1], m->direction,        e->error[v],
                  e->detour[v],  m->source,   v,           s->border[v] ? 2 : 1};
        DMK_TRY(radiate_star(ctx, e, v, &a, s->border[v] ? 0 : 1));
    }
done:
    return rc;
}

/* Rays at right angles from half-edge h into its own triangle, and from the vertices of its ends.
 */
static int radiate_line(dmk_context *ctx, engine *e, int32_t h)
{
    int rc = DMK_OK;
    const dmk_geodesics *g = e->front.g;
    double length = e->front.facet[h / 3].length[h % 3];
    for (int last = 0; last < 2; last++) {
        int32_t v = g->mesh->triangle[last ? dmk_previous(h) : dmk_next(h)];
        rays a = {0, -1, g->star.total[v] + 1, 0, 0, 0, g->n_sources, v, 2};
        mark m = {0, 0, 0, HUGE_VAL, STRAIGHT, g->n_sources, -1};
        if (e->radiated[v] == 0) continue;
        e->radiated[v] = 0;
        DMK_TRY(reach(ctx, e, v, 0, &m, 0, 0));
        DMK_TRY(radiate_star(ctx, e, v, &a, 0));
    }
    rc = put(ctx, e,
             &(wave){0, length, length / 2, 0, 1, 0, 0, 0, 0, 0, 0, h, -1, g->n_sources, -1}, 0);
done:
    return rc;
}

/* ---- the run --------------------------------------------------------------------------------- */

/* In line by all means: gcc takes a function that does nothing but this for one without effect, and its calls away. */
static inline __attribute__((always_inline)) void fetch_two(const void *at)
{
    __builtin_prefetch(at);
    __builtin_prefetch((const char *)at + 64);
}

static inline __attribute__((always_inline)) void fetch_half(const engine *e, int32_t half)
{
    fetch_two(e->front.facet + half / 3);
    __builtin_prefetch(e->head + half);
    __builtin_prefetch(e->visits + half);
}

static inline __attribute__((always_inline)) void fetch_rest(const engine *e, const shard *me,
                                                             int32_t half)
{
    const dmk_facet *f = e->front.facet + half / 3;
    if (e->head[half] >= 0) fetch_two(me->pool + e->head[half]);
    for (int32_t k = 0; k < 3; k++) __builtin_prefetch(e->front.d + f->vertex[k]);
    __builtin_prefetch(e->mark + f->vertex[half % 3]);
    __builtin_prefetch(e->error + f->vertex[half % 3]);
}

/* Visit a shard's half-edges. */
static int visit(const engine *e, shard *me)
{
    int rc;
    for (int k = 0; k < SHARDS; k++) me->finds[k].n_children = me->finds[k].n_hits = 0;
    DMK_TRY(dmk_shard_take(e, me));
    const size_t n = me->n_taken;
    for (size_t i = 0; i < n && i < NEAR; i++) fetch_rest(e, me, me->taken[i]);
    for (size_t i = 0; i < n; i++) {
        if (i + FAR < n) fetch_half(e, me->taken[i + FAR]);
        if (i + NEAR < n) fetch_rest(e, me, me->taken[i + NEAR]);
        DMK_TRY(dmk_waves_visit(me, e, me->taken[i]));
    }
done:
    return rc;
}

/* What the shard's next visits will read first. */
static void fetch_next(const engine *e, const shard *me)
{
    for (size_t i = e->current; i < me->n_buckets && i < e->current + 2; i++) {
        if (me->bucket[i].first < 0) continue;
        const block *k = me->block + me->bucket[i].first;
        for (int32_t j = 0; j < k->n && j < FAR; j++) fetch_half(e, k->half[j]);
        break;
    }
}

/* What is written with these finds another thread may have had last. */
static void fetch_for(const engine *e, const finds *f)
{
    for (size_t i = 0; i < f->n_hits; i++) {
        const int32_t v = f->hit[i].vertex;
        __builtin_prefetch(e->front.d + v, 1);
        __builtin_prefetch(e->error + v, 1);
        __builtin_prefetch(e->mark + v, 1);
    }
    for (size_t i = 0; i < f->n_children; i++)
        __builtin_prefetch(e->head + f->child[i].wave.half, 1);
}

/* What visits have found for a shard. */
static int enter(dmk_context *ctx, const engine *e, const finds *f)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < f->n_hits; i++) {
        const hit *h = f->hit + i;
        DMK_TRY(reach(ctx, e, h->vertex, h->d, &h->mark, h->error, h->detour));
    }
    for (size_t i = 0; i < f->n_children; i++)
        DMK_TRY(put(ctx, e, &f->child[i].wave, f->child[i].key));
done:
    return rc;
}

static void do_shard(int32_t k, void *data)
{
    const engine *e = data;
    shard *me = e->shard + k;
    if (!e->enters) {
        me->rc = visit(e, me);
        return;
    }
    fetch_for(e, e->shard[0].finds + k);
    for (int i = 0; i < SHARDS && me->rc == DMK_OK; i++) {
        if (i + 1 < SHARDS) fetch_for(e, e->shard[i + 1].finds + k);
        me->rc = enter(&me->own, e, e->shard[i].finds + k);
    }
    fetch_next(e, me);
}

static int do_round(dmk_context *ctx, engine *e, bool enters)
{
    e->enters = enters;
    dmk_crew_round(&e->crew);
    for (int i = 0; i < SHARDS; i++) {
        const shard *s = e->shard + i;
        if (s->rc != DMK_OK) return dmk_fail(ctx, s->rc, "%s", s->own.message);
    }
    return DMK_OK;
}

/* From now on half-edges keep windows, if one wants to. */
static int keep(dmk_context *ctx, engine *e)
{
    bool any = false;
    for (int i = 0; i < SHARDS; i++) any = any || e->shard[i].keeps;
    if (e->kept || !any) return DMK_OK;
    const size_t n_half = 3 * (size_t)e->front.g->mesh->n_triangles;
    const int rc = DMK_NEW_UNSET(ctx, e->kept, n_half);
    if (rc == DMK_OK) memset(e->kept, 0xff, n_half * sizeof *e->kept);
    return rc;
}

/* Whether a half-edge waits in the current bucket. */
static bool any_waits(const engine *e)
{
    for (int i = 0; i < SHARDS; i++) {
        const shard *s = e->shard + i;
        if (e->current < s->n_buckets && s->bucket[e->current].first >= 0) return true;
    }
    return false;
}

/* Visit all half-edges of the current bucket. */
static int visit_all(dmk_context *ctx, engine *e)
{
    int rc;
    DMK_TRY(do_round(ctx, e, false));
    DMK_TRY(do_round(ctx, e, true));
    rc = keep(ctx, e);
done:
    return rc;
}

/* The pseudo-sources that the shards have found reached. */
static int collect(dmk_context *ctx, engine *e)
{
    int rc = DMK_OK;
    for (int i = 0; i < SHARDS; i++) {
        shard *s = e->shard + i;
        for (size_t k = 0; k < s->n_reached; k++)
            DMK_TRY(dmk_heap_push(ctx, &e->pseudo_sources, s->reached[k].key, s->reached[k].item));
        s->n_reached = 0;
    }
done:
    return rc;
}

/* Pseudo-sources of the current bucket: true if one radiated. */
static int radiate_pseudo_sources(dmk_context *ctx, engine *e, bool *any)
{
    int rc = DMK_OK;
    double limit =
        e->current < e->most_buckets ? e->least + (double)(e->current + 1) * e->width : INFINITY;
    *any = false;
    DMK_TRY(collect(ctx, e));
    while (e->pseudo_sources.n > 0 && e->pseudo_sources.at[0].key < limit) {
        dmk_heap_item top = dmk_heap_pop(&e->pseudo_sources);
        if (top.key > e->front.d[top.item] || !(top.key < e->radiated[top.item])) continue;
        *any = true;
        DMK_TRY(radiate_pseudo_source(ctx, e, top.item));
        DMK_TRY(collect(ctx, e));
    }
done:
    return rc;
}

static bool spent(const engine *e)
{
    int64_t n = 0;
    for (int i = 0; i < SHARDS; i++) n += e->shard[i].n_looks;
    return n > e->most_looks;
}

/* Whether too many vertices behind the front are over the tolerance. Many at it are, too, until their last windows
 * come, as the shards count them: when there may be enough, and again when there are twice as many, those behind it are
 * counted. */
static bool misses(engine *e)
{
    int64_t n = 0;
    for (int i = 0; i < SHARDS; i++) n += e->shard[i].n_over;
    if (n <= e->count_at) return false;
    e->count_at = 2 * n;
    n = 0;
    const double front = e->least + (double)e->current * e->width;
    for (int32_t v = 0; v < e->front.g->mesh->n_vertices; v++)
        n += e->front.d[v] < front && is_over(e, v);
    return n > e->most_over;
}

static size_t count_buckets(const engine *e)
{
    size_t n = 0;
    for (int i = 0; i < SHARDS; i++) n = e->shard[i].n_buckets > n ? e->shard[i].n_buckets : n;
    return n;
}

/* *finished: not ended before all is done. */
static int sweep(dmk_context *ctx, engine *e, bool *finished)
{
    int rc = DMK_OK;
    bool any;
    *finished = true;
    DMK_TRY(collect(ctx, e));
    while (e->current < count_buckets(e) || e->pseudo_sources.n > 0) {
        if (e->current >= count_buckets(e)) { /* only pseudo-sources are left: go to the first */
            double index = dmk_min((e->pseudo_sources.at[0].key - e->least) / e->width,
                                   (double)e->most_buckets);
            if (index > (double)e->current) e->current = (size_t)index;
        }
        do {
            any = any_waits(e);
            if (any)
                DMK_TRY(visit_all(ctx, e));
            else
                DMK_TRY(radiate_pseudo_sources(ctx, e, &any));
            DMK_TRY(dmk_poll(ctx));
        } while (any && !spent(e));
        *finished = !spent(e) && !misses(e);
        if (!*finished) break;
        e->current++;
    }
done:
    return rc;
}

/* A vertex at which paths bend may turn out to have a larger error after it has radiated. */
static void hand_on_errors(const engine *e)
{
    for (bool again = true; again;) {
        again = false;
        for (int32_t v = 0; v < e->front.g->mesh->n_vertices; v++) {
            const int32_t root = e->mark[v].root;
            if (root < 0 || e->error[root] <= e->error[v]) continue;
            e->error[v] = e->error[root];
            again = true;
        }
    }
}

static void arrive(const engine *e, int32_t v)
{
    dmk_geodesics *g = e->front.g;
    const mark *m = e->mark + v;
    g->arrival[v] = (dmk_arrival){0, 0, -1, -1};
    if (m->half == UNREACHED) return;
    const dmk_site *p = m->source < g->n_sources ? g->source + m->source : NULL;
    double direction = p ? dmk_front_turn(m->direction, p->total, p->on_border) : 0;
    g->arrival[v] = (dmk_arrival){direction, back_of(e, v), m->root, m->source};
    g->distance[v] *= g->star.unit;
    e->error[v] = (e->error[v] + e->detour[v]) * g->star.unit;
}

static void arrive_range(int32_t begin, int32_t end, void *data)
{
    for (int32_t v = begin; v < end; v++) arrive(data, v);
}

/* With no tolerance, too, rough terrain gives up to 1e-7: what merges there is not small over all that follows. */
static bool is_exact(const engine *e, double most)
{
    const dmk_geodesics *g = e->front.g;
    double error = 0, farthest = 0;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (g->arrival[v].source < 0) continue;
        error = dmk_max(error, e->error[v]);
        farthest = dmk_max(farthest, g->distance[v]);
    }
    return error <= most * farthest;
}

int dmk_waves_run(dmk_context *ctx, dmk_geodesics *g, double tolerance, double exact, int looks,
                  int over, bool *finished)
{
    int rc;
    engine e;
    DMK_TRY(engine_create(ctx, g, tolerance, &e));
    e.most_over = e.count_at = over;
    e.most_looks = looks * 3LL * g->mesh->n_triangles + 5000000; /* small meshes may need more */
    for (int32_t i = 0; i < g->n_sources; i++) DMK_TRY(radiate_source(ctx, &e, i));
    for (size_t i = 0; i < g->n_lines; i++) DMK_TRY(radiate_line(ctx, &e, g->line[i]));
    dmk_crew_begin(ctx, &e.crew, SHARDS, do_shard, &e);
    rc = sweep(ctx, &e, finished);
    dmk_crew_end(ctx, &e.crew);
    if (rc != DMK_OK) goto done;
    if (*finished) {
        hand_on_errors(&e);
        dmk_parallel(ctx, g->mesh->n_vertices, arrive_range, &e);
    }
    g->n_windows = 0;
    for (int i = 0; i < SHARDS; i++) g->n_windows += e.shard[i].n_made;
    if (tolerance > 0 || (*finished && !is_exact(&e, exact))) {
        g->error = e.error;
        e.error = NULL;
    }
done:
    engine_free(&e);
    return rc;
}
