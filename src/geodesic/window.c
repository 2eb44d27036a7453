/* Exact distances by windows, depth first.
 *
 * A window runs on from triangle to triangle, its rest waiting on a small stack, until some corner
 * V beside all its rays has d(V) + |V P| < D(P), P the end of the window on the other side: then
 * the way over V is shorter for all of its rays (Xin and Wang's filter). d is at first an upper
 * bound, the length of paths along edges, and so no window that is needed is ever dropped, whatever
 * the order. Of the windows that enter an angle, only the one with the shortest path to its vertex
 * may leave it on both sides unchanged: of another one the rays that cross this path end there, and
 * those beyond it, none of which are of use from one source (Chen and Han), must beat the way over
 * the place where it entered. When all have run down, the nearest pseudo-source that has not radiated
 * has its exact distance, and sends windows into the directions that make no angle below pi with the
 * path to it; so do some that come next. lanes.c takes most of the steps.
 *
 * Edges that are sources send windows of parallel rays to both sides, and their vertices rays into the angles between.
 */
#include "geodesic/window_engine.h"

#include "base/heading.h"
#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

/* To ask for memory ahead, of vertices or triangles; speed only. */
enum { AHEAD = 12 };

static void clear_range(int32_t begin, int32_t end, void *data)
{
    const engine *e = data;
    for (int32_t v = begin; v < end; v++) {
        e->trace[v] = (trace){.half = UNREACHED, .root = ~e->front.g->n_sources};
        e->split[v] = (split){.half = UNREACHED};
    }
}

static int engine_create(dmk_context *ctx, dmk_geodesics *g, int64_t most, engine *e)
{
    int rc;
    *e = (engine){.limit = most, .n_threads = 1};
    DMK_TRY(dmk_front_create(ctx, g, &e->front));
    DMK_TRY(DMK_NEW_UNSET(ctx, e->trace, (size_t)g->mesh->n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, e->split, (size_t)g->mesh->n_vertices));
    dmk_parallel(ctx, g->mesh->n_vertices, clear_range, e);
done:
    return rc;
}

static void engine_free(engine *e)
{
    dmk_front_free(&e->front);
    free(e->trace);
    free(e->split);
    dmk_lanes_free(e);
    dmk_heap_free(&e->pseudo_sources);
}

/* ---- upper bounds ---------------------------------------------------------------------------- */

/* Triangles in the order of a search in breadth. */
typedef struct bounds {
    engine *e;
    int32_t *list, n;
    bool *listed; /* n_triangles */
} bounds;

static void list_triangle(bounds *q, int32_t t)
{
    if (q->listed[t]) return;
    q->listed[t] = true;
    q->list[q->n++] = t;
}

static void offer(const engine *e, int32_t v, double d)
{
    e->front.d[v] = dmk_min(e->front.d[v], d);
}

static void list_sources(bounds *q)
{
    const dmk_front *front = &q->e->front;
    const double unit = front->g->star.unit;
    for (size_t i = 0; i < front->g->n_lines; i++) {
        const int32_t h = front->g->line[i];
        const dmk_facet *f = front->facet + h / 3;
        offer(q->e, f->vertex[(h + 1) % 3], 0);
        offer(q->e, f->vertex[(h + 2) % 3], 0);
        list_triangle(q, h / 3);
    }
    for (int32_t i = 0; i < front->g->n_sources; i++) {
        const dmk_site *p = front->g->source + i;
        if (p->vertex >= 0) offer(q->e, p->vertex, p->offset / unit);
        for (int32_t k = 0; k < p->n_sectors; k++) {
            const dmk_sector c = dmk_front_site(front, p, k);
            const dmk_facet *f = front->facet + c.half / 3;
            const int h = c.half % 3;
            offer(q->e, f->vertex[(h + 1) % 3], p->offset / unit + hypot(c.x, c.y));
            offer(q->e, f->vertex[(h + 2) % 3], p->offset / unit + hypot(f->length[h] - c.x, c.y));
            list_triangle(q, c.half / 3);
        }
    }
}

/* Paths along the sides of a triangle. */
static void offer_sides(bounds *q, int32_t t)
{
    const dmk_facet *f = q->e->front.facet + t;
    const double *d = q->e->front.d;
    for (int k = 0; k < 3; k++) {
        const int a = k == 2 ? 0 : k + 1, b = k == 0 ? 2 : k - 1;
        offer(q->e, f->vertex[k], d[f->vertex[a]] + f->length[b]);
        offer(q->e, f->vertex[k], d[f->vertex[b]] + f->length[a]);
        if (f->twin[k] >= 0) list_triangle(q, f->twin[k] / 3);
    }
}

/* Lengths of paths along edges, and a little more: a bound must be reached, not only met. Each triangle is looked at
 * once, so these need not be the shortest of such paths. Bounds 1.3 times as long take no more windows on quartics and
 * 20 % more on scans, none at all 10 % and up to twice as many. The shortest ones take 26 ms for 273,000 triangles,
 * these 10. */
static int bound(dmk_context *ctx, void *data)
{
    int rc;
    engine *e = data;
    const dmk_mesh *m = e->front.g->mesh;
    bounds q = {.e = e};
    DMK_TRY(DMK_NEW_UNSET(ctx, q.list, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, q.listed, (size_t)m->n_triangles));
    list_sources(&q);
    for (int32_t i = 0; i < q.n; i++) {
        if (i + AHEAD < q.n) {
            const dmk_facet *f = e->front.facet + q.list[i + AHEAD];
            __builtin_prefetch(f);
            __builtin_prefetch(f->vertex);
        }
        offer_sides(&q, q.list[i]);
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        e->front.d[v] = e->front.d[v] * (1 + DMK_SAME_LENGTH) + 1000 * DMK_SAME_LENGTH;
done:
    free(q.list);
    free(q.listed);
    return rc;
}

/* ---- threads --------------------------------------------------------------------------------- */

/* Threads run windows down in any order. What the filters drop is longer than some way by more than rounding,
 * whenever they look, so the least value at each vertex and the way it comes are the same. */
typedef struct pool {
    engine *e;
    shares shares;
    worker *own; /* of each thread */
    int n_threads;
} pool;
/* Steps by one thread before others come: how many windows several make depends on when they see each other's
 * distances, on stretched meshes by a factor of three. */
enum { alone = 500000 };

static int run_share(dmk_context *ctx, int32_t i, void *data)
{
    int rc;
    pool *c = data;
    worker *me = c->own + i;
    me->ctx = ctx;
    me->e = c->e;
    me->shares = &c->shares;
    DMK_TRY(dmk_shares_begin(me, c->n_threads));
    for (bool more = true; more;) {
        DMK_TRY(dmk_lanes_run(me, INT64_MAX));
        DMK_TRY(dmk_shares_wait(me, &more));
    }
done:
    if (rc != DMK_OK) { /* those that have windows end as if there were too many */
        c->e->n_made = c->e->limit + 1;
        dmk_shares_stop(&c->shares);
    }
    return rc;
}

static int absorb(worker *me, worker *from)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < from->n_reached; i++) {
        DMK_TRY(dmk_heap_push(me->ctx, &me->e->pseudo_sources, from->reached[i].key,
                              from->reached[i].item));
    }
    from->n_reached = 0;
done:
    return rc;
}

static int absorb_tied(worker *me, const worker *from)
{
    int rc = DMK_OK;
    if (from->n_tied == 0) goto done;
    DMK_TRY(DMK_GROW(me->ctx, me->tied, me->n_tied + from->n_tied, me->tied_room));
    memcpy(me->tied + me->n_tied, from->tied, from->n_tied * sizeof *from->tied);
    me->n_tied += from->n_tied;
done:
    return rc;
}

static void worker_free(worker *me)
{
    free(me->stack);
    free(me->reached);
    free(me->tied);
}

static int run_shared(worker *me, int n_threads)
{
    int rc;
    pool c = {.e = me->e,
              .n_threads = n_threads,
              .shares = {.window = me->stack, .n = me->n_stack, .room = me->capacity}};
    me->stack = NULL;
    me->n_stack = me->capacity = 0;
    me->e->front.g->n_shared += (int64_t)c.shares.n;
    DMK_TRY(DMK_NEW(me->ctx, c.own, (size_t)n_threads));
    me->e->shared = true;
    rc = dmk_parallel_pieces(me->ctx, n_threads, run_share, &c);
    me->e->shared = false;
    for (int i = 0; i < n_threads; i++) {
        if (rc == DMK_OK) rc = absorb(me, c.own + i);
        if (rc == DMK_OK) rc = absorb_tied(me, c.own + i);
        const int64_t rest = c.own[i].n_made % DMK_PIECE;
        me->n_made += c.own[i].n_made - rest;
        if (rc == DMK_OK) rc = dmk_windows_count(me, rest);
        worker_free(c.own + i);
    }
done:
    free(c.own);
    free(c.shares.window);
    return rc;
}

/* Run down all windows on the stack; then the pseudo-sources that were reached wait in the heap. */
static int run_all(worker *me)
{
    int rc;
    const int n_threads = me->e->n_threads;
    DMK_TRY(dmk_lanes_run(me, n_threads > 1 ? alone : INT64_MAX));
    if (me->n_stack > 0) DMK_TRY(run_shared(me, n_threads));
    rc = absorb(me, me);
done:
    return rc;
}

/* ---- sources and pseudo-sources ------------------------------------------------------------------ */

/* Rays within the directions lo..hi, from a source or pseudo-source. */
typedef struct rays {
    double base, lo, hi;
    int32_t root;
    int n_ends; /* of a sector: 1, its first, or 2, its last, too */
} rays;

static int send(worker *me, const dmk_sector *c, const rays *a)
{
    const dmk_front *front = &me->e->front;
    int rc = DMK_OK;
    dmk_end end;
    dmk_beam b;
    for (int last = 0; last < a->n_ends; last++) {
        if (!dmk_front_end(front, c, last, a->lo, a->hi, &end)) continue;
        DMK_TRY(
            dmk_windows_reach(me, end.vertex, a->base + end.length,
                              (trace){HUGE_VAL, end.direction, end.back, 0, STRAIGHT, a->root}));
    }
    if (!dmk_front_beam(front, c, a->lo, a->hi, &b)) goto done;
    me->n_made++;
    const window first = {.lo = b.lo,
                          .hi = b.hi,
                          .x = b.x,
                          .y = b.y,
                          .base = a->base,
                          .turn = b.turn,
                          .length = front->facet[c->half / 3].length[c->half % 3],
                          .half = b.half,
                          .root = a->root};
    rc = dmk_windows_push(me, &first);
done:
    return rc;
}

static int radiate_source(worker *me, int32_t number)
{
    int rc = DMK_OK;
    engine *e = me->e;
    const dmk_site *p = e->front.g->source + number;
    double *d = e->front.d;
    rays a = {p->offset / e->front.g->star.unit, -1, p->total + 1, ~number, 2};
    if (p->vertex >= 0) {
        if (a.base >= d[p->vertex]) return DMK_OK;
        d[p->vertex] = a.base;
        e->trace[p->vertex] = (trace){HUGE_VAL, 0, 0, 0, STRAIGHT, ~number};
    }
    for (int32_t k = 0; k < p->n_sectors; k++) {
        dmk_sector c = dmk_front_site(&e->front, p, k);
        DMK_TRY(send(me, &c, &a));
    }
done:
    return rc;
}

/* Direction back along a path at vertex v. */
static double back_of(const engine *e, int32_t v, const trace *t)
{
    const dmk_star *s = &e->front.g->star;
    double back = t->y;
    if (t->half >= 0) {
        const dmk_facet *f = e->front.facet + t->half / 3;
        int k1 = (t->half + 1) % 3;
        if (t->half % 3 == 2) k1 = 0;
        double ax = -f->cosine[k1], ay = -f->sine[k1], bx = -t->x, by = -t->y;
        back = s->angle[t->half] + dmk_angle_of(ax * bx + ay * by, ax * by - ay * bx);
    }
    return dmk_front_turn(back, s->total[v], s->border[v]);
}

/* Into n ranges of directions. */
static int radiate_vertex(worker *me, int32_t v, int n, double range[][2])
{
    int rc = DMK_OK;
    const engine *e = me->e;
    const dmk_star *s = &e->front.g->star;
    const int turns = s->border[v] ? 0 : 1;
    int32_t c = s->first[v];
    do {
        dmk_sector sector = dmk_front_corner(&e->front, c);
        for (int i = 0; i < n; i++) {
            for (int k = -turns; k <= turns; k++) { /* the range may go around */
                double turn = k * s->total[v];
                rays a = {e->front.d[v], range[i][0] + turn, range[i][1] + turn, v,
                          s->border[v] ? 2 : 1};
                DMK_TRY(send(me, &sector, &a));
            }
        }
        c = dmk_star_next(s, c);
    } while (c >= 0 && c != s->first[v]);
done:
    return rc;
}

static int radiate_pseudo_source(worker *me, int32_t v)
{
    const engine *e = me->e;
    double range[2][2];
    const int n = dmk_front_directions(&e->front, v, back_of(e, v, e->trace + v), range);
    return radiate_vertex(me, v, n, range);
}

/* A vertex on a line, from one of its edges there to the next: into the directions that make no angle below pi/2 with
 * them, as the others are nearer to the edges. */
static int radiate_between(worker *me, int32_t v, double from, double to)
{
    double range[1][2] = {{from + M_PI_2, to - M_PI_2}};
    return radiate_vertex(me, v, 1, range);
}

static int radiate_line_vertex(worker *me, int32_t v)
{
    int rc = DMK_OK;
    const dmk_geodesics *g = me->e->front.g;
    const dmk_star *s = &g->star;
    double first = NAN, last = s->border[v] ? -INFINITY : NAN;
    if (me->e->front.d[v] == 0) return DMK_OK; /* has radiated, or is a source itself */
    me->e->front.d[v] = 0;
    me->e->trace[v] = (trace){HUGE_VAL, 0, 0, 0, STRAIGHT, ~g->n_sources};
    for (int32_t c = s->first[v], next = c; next >= 0; c = next) {
        next = dmk_star_next(s, c);
        if (next == s->first[v]) next = -1;
        const double side[2] = {s->angle[c], s->angle[c] + s->corner_angle[c]};
        const int32_t half[2] = {dmk_previous(c), dmk_next(c)}; /* the next corner's first, too */
        for (int k = 0; k < (s->twin[half[1]] < 0 ? 2 : 1); k++) {
            if (!dmk_lines_have(g, half[k])) continue;
            if (isnan(first)) first = side[k];
            if (!isnan(last)) DMK_TRY(radiate_between(me, v, last, side[k]));
            last = side[k];
        }
    }
    rc = radiate_between(me, v, last, s->border[v] ? INFINITY : first + s->total[v]);
done:
    return rc;
}

/* From a half-edge at right angles into its own triangle, and from its ends. */
static int radiate_line(worker *me, int32_t h)
{
    int rc;
    const dmk_facet *f = me->e->front.facet + h / 3;
    const window first = {.hi = f->length[h % 3],
                          .y = -1,
                          .turn = h, /* tells such windows apart: dmk_windows_first */
                          .length = f->length[h % 3],
                          .half = h,
                          .root = ~me->e->front.g->n_sources,
                          .parallel = true};
    DMK_TRY(radiate_line_vertex(me, f->vertex[(h + 1) % 3]));
    DMK_TRY(radiate_line_vertex(me, f->vertex[(h + 2) % 3]));
    me->n_made++;
    rc = dmk_windows_push(me, &first);
done:
    return rc;
}

/* ---- arrivals -------------------------------------------------------------------------------- */

/* Source and direction come from the first pseudo-source of the path. */
static dmk_arrival arrival_by(const engine *e, int32_t v, const trace *t)
{
    dmk_arrival a = {0, back_of(e, v, t), t->root >= 0 ? t->root : -1, -1};
    while (t->root >= 0) t = e->trace + t->root;
    a.source = ~t->root;
    if (a.source == e->front.g->n_sources) return a; /* lines have no directions */
    const dmk_site *p = e->front.g->source + a.source;
    a.direction = dmk_front_turn(t->half >= 0 ? t->turn + dmk_angle_of(t->x, t->y) : t->x, p->total,
                                 p->on_border);
    return a;
}

static void arrive(const engine *e, int32_t v)
{
    const trace *t = e->trace + v;
    dmk_arrival *a = e->front.g->arrival + v;
    if (t->half == UNREACHED) {
        *a = (dmk_arrival){0, 0, -1, -1};
        e->front.d[v] = INFINITY;
        return;
    }
    e->front.d[v] *= e->front.g->star.unit;
    *a = arrival_by(e, v, t);
}

/* Where the path entered last lies anywhere; asked for ahead, 273,000 triangles take 4 ms for 11. */
static void arrive_range(int32_t begin, int32_t end, void *data)
{
    const engine *e = data;
    for (int32_t v = begin; v < end; v++) {
        if (v + AHEAD < end && e->trace[v + AHEAD].half >= 0) {
            const int32_t half = e->trace[v + AHEAD].half;
            const dmk_facet *f = e->front.facet + half / 3;
            __builtin_prefetch(f);
            __builtin_prefetch(f->sine);
            __builtin_prefetch(e->front.g->star.angle + half);
        }
        arrive(e, v);
    }
}

/* ---- ties ------------------------------------------------------------------------------------ */

static int by_vertex(const void *a, const void *b)
{
    const tied *p = a, *q = b;
    if (p->vertex != q->vertex) return p->vertex < q->vertex ? -1 : 1;
    return dmk_windows_first(&q->trace, &p->trace) - dmk_windows_first(&p->trace, &q->trace);
}

/* From another direction: through a flat vertex the same path comes by two windows. */
static bool is_another(const dmk_geodesics *g, const dmk_tie *t)
{
    const double turn = g->star.border[t->vertex] ? HUGE_VAL : g->star.total[t->vertex];
    return fabs(dmk_turn_between(turn, g->arrival[t->vertex].back, t->arrival.back)) > DMK_BESIDE;
}

/* The second path to each vertex that has one; of several, the first. */
static int list_ties(worker *me, dmk_geodesics *g)
{
    int rc = DMK_OK;
    free(g->tie);
    g->tie = NULL;
    g->n_ties = 0;
    if (me->n_tied == 0) goto done;
    qsort(me->tied, me->n_tied, sizeof *me->tied, by_vertex);
    DMK_TRY(DMK_NEW(me->ctx, g->tie, me->n_tied));
    for (size_t i = 0; i < me->n_tied; i++) {
        const tied *p = me->tied + i;
        const double longer = p->d - g->distance[p->vertex] / g->star.unit;
        if (longer > DMK_SAME_LENGTH) continue; /* a shorter path came later */
        if (g->n_ties > 0 && g->tie[g->n_ties - 1].vertex == p->vertex) continue;
        const dmk_tie tie = {p->vertex, arrival_by(me->e, p->vertex, &p->trace)};
        if (is_another(g, &tie)) g->tie[g->n_ties++] = tie;
    }
done:
    return rc;
}

/* The nearest pseudo-sources radiate, until there are windows for all lanes; one that is reached by a shorter way later
 * does so again. Scans of 50,000 to 90,000 triangles: 0.13 to 0.20 s, one at a time 0.22 to 0.42, with 32 or 128
 * windows as with 64: speed only, for what comes too early is made again. */
static int radiate_next(worker *me, bool *any)
{
    enum { WINDOWS = 64 };
    int rc = DMK_OK;
    engine *e = me->e;
    *any = false;
    while (e->pseudo_sources.n > 0 && me->n_stack < WINDOWS) {
        dmk_heap_item top = dmk_heap_pop(&e->pseudo_sources);
        if (top.key > e->front.d[top.item]) continue;
        *any = true;
        DMK_TRY(radiate_pseudo_source(me, top.item));
    }
done:
    return rc;
}

/* Over edges times the square root of triangles: 152 meshes, scans, CAD and smooth ones, need 0.22 and less. Small
 * meshes need some more. */
int64_t dmk_windows_usual(const dmk_mesh *m)
{
    return 1000000 + (int64_t)(0.4 * sqrt(m->n_triangles) * m->n_edges);
}

static int run(dmk_context *ctx, dmk_geodesics *g, int64_t most, int n_threads, bool *finished)
{
    int rc;
    bool any = true;
    engine e;
    dmk_task task;
    worker me = {.ctx = ctx, .e = &e};
    DMK_TRY(engine_create(ctx, g, most, &e));
    e.n_threads = n_threads;
    dmk_task_begin(ctx, &task, bound, &e);
    rc = dmk_lanes_create(ctx, &e);
    DMK_TRY(dmk_task_end(ctx, &task, rc));
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < g->n_sources; i++) DMK_TRY(radiate_source(&me, i));
    for (size_t i = 0; i < g->n_lines; i++) DMK_TRY(radiate_line(&me, g->line[i]));
    while (any && !dmk_windows_spent(&e)) {
        DMK_TRY(run_all(&me));
        DMK_TRY(radiate_next(&me, &any));
    }
    *finished = !dmk_windows_spent(&e);
    g->n_windows = me.n_made;
    if (*finished) {
        dmk_parallel(ctx, g->mesh->n_vertices, arrive_range, &e);
        DMK_TRY(list_ties(&me, g));
    }
done:
    worker_free(&me);
    engine_free(&e);
    return rc;
}

/* Several threads make up to 15 % fewer windows than one, or 5 % more (tubes of 1 : 50, quartics): how many depends on
 * when they see each other's distances. Larger factors cost time only, the second one wherever there are too many. */
static const double surely_fewer = 1.5, surely_more = 1.15;
/* Where there may be but a few times as many as one thread makes alone, it makes all: speed only. */
enum { all_alone = 4 * alone };

/* Whether there are too many one thread decides, or the way in which distances are found, and their last bits, would
 * hang on who was faster; where several threads make far fewer or more, they know what it would find. */
int dmk_windows_run(dmk_context *ctx, dmk_geodesics *g, int64_t most, bool *finished)
{
    int rc;
    const int n = most < all_alone ? 1 : dmk_parallel_threads(ctx);
    DMK_TRY(run(ctx, g, n > 1 ? (int64_t)(surely_more * (double)most) : most, n, finished));
    if (n == 1 || !*finished || surely_fewer * (double)g->n_windows < (double)most) goto done;
    rc = run(ctx, g, most, 1, finished);
done:
    return rc;
}
