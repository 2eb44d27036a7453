/* Exact distances by windows, depth first.
 *
 * A window runs on from triangle to triangle, its rest waiting on a small stack, until some corner
 * V beside all its rays has d(V) + |V P| < D(P), P the end of the window on the other side: then
 * the way over V is shorter for all of its rays (Xin and Wang's filter). d is at first an upper
 * bound, the length of paths along edges, and so no window that is needed is ever dropped, whatever
 * the order. Of the windows that enter an angle, only the one with the shortest path to its vertex
 * may leave it on both sides (Chen and Han). When all have run down, the nearest pseudo-source that
 * has not radiated has its exact distance, and sends windows into the directions that make no angle
 * below pi with the path to it. */
#include "geodesic/front.h"
#include "geodesic/heap.h"

#include "base/parallel.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* An interval of a half-edge, all of whose points see the root straight, unfolded at (x, y), y < 0: the last
 * pseudo-source, or the source. */
typedef struct window {
    double lo, hi, x, y;
    double base; /* length of the path up to the root */
    double turn; /* direction of the frame's x axis at a source that is the root */
    int32_t half;
    int32_t root; /* the pseudo-source, or ~number of the source */
} window;

/* The path that gave a vertex its distance. */
typedef struct trace {
    double at;    /* where it crosses the half-edge */
    double x, y;  /* from the root to the vertex, in its frame; else directions at source, vertex */
    double turn;  /* of the window */
    int32_t half; /* entered last; one of the two below */
    int32_t root; /* of the window */
} trace;
/* Only bounded so far; by no window: inside the source's triangle, or along an edge from the root. */
enum { UNREACHED = -2, STRAIGHT = -1 };

/* What the rule of one split asks of a vertex, kept apart for the cache. `turn` is odd while it is written. */
typedef struct split {
    double at;
    int32_t half;
    uint32_t turn;
} split;

typedef struct engine {
    dmk_front front;
    trace *trace;
    split *split;
    dmk_heap pseudo_sources; /* reached, to radiate */
    bool shared;             /* by several threads at the moment */
    int64_t limit;           /* of windows */
    _Atomic int64_t n_made;  /* windows, in pieces of 65,536 */
} engine;

/* A thread's own, in cache lines that no other thread's share: it is written at each step. */
typedef struct worker {
    dmk_context *ctx;
    engine *e;
    window *stack;
    size_t n_stack, capacity;
    dmk_heap_item *reached; /* pseudo-sources */
    size_t n_reached, reached_room;
    int64_t n_made;
    char apart[128];
} worker;

static const double eps = DMK_SAME_LENGTH;

/* Windows to make at most, over edges times the square root of triangles: 152 meshes, scans, CAD and smooth ones, need
 * 0.21 and less. Around needles and on thin tubes there may be a million times as many, of ways that hardly differ:
 * there wave.c is better, since it compares windows with each other. Small meshes need some more. */
static const double most_windows = 0.4;
enum { always = 1000000 };

static bool spent(const engine *e)
{
    return e->n_made > e->limit;
}

static int engine_create(dmk_context *ctx, dmk_geodesics *g, engine *e)
{
    int rc;
    memset(e, 0, sizeof *e);
    DMK_TRY(dmk_front_create(ctx, g, &e->front));
    DMK_TRY(DMK_NEW(ctx, e->trace, (size_t)g->mesh->n_vertices));
    DMK_TRY(DMK_NEW(ctx, e->split, (size_t)g->mesh->n_vertices));
    e->limit = always + (int64_t)(most_windows * sqrt(g->mesh->n_triangles) * g->mesh->n_edges);
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        e->trace[v] = (trace){.half = UNREACHED, .root = ~g->n_sources};
        e->split[v].half = UNREACHED;
    }
done:
    return rc;
}

static void engine_free(engine *e)
{
    dmk_front_free(&e->front);
    free(e->trace);
    free(e->split);
    dmk_heap_free(&e->pseudo_sources);
}

/* ---- upper bounds ---------------------------------------------------------------------------- */

static int offer(dmk_context *ctx, engine *e, dmk_heap *q, int32_t v, double d)
{
    if (!(d < e->front.d[v])) return DMK_OK;
    e->front.d[v] = d;
    return dmk_heap_push(ctx, q, d, v);
}

/* Lengths of paths along edges (Dijkstra), and a little more: a bound must be reached, not only
 * met. */
static int bound(dmk_context *ctx, engine *e)
{
    int rc = DMK_OK;
    dmk_heap q = {0};
    const dmk_star *s = &e->front.g->star;
    for (int32_t i = 0; i < e->front.g->n_sources; i++) {
        const dmk_site *p = e->front.g->source + i;
        if (p->vertex >= 0) DMK_TRY(offer(ctx, e, &q, p->vertex, p->offset / s->unit));
        for (int32_t k = 0; k < p->n_sectors; k++) {
            const dmk_sector in = dmk_front_site(&e->front, p, k), *c = &in;
            const dmk_facet *f = e->front.facet + c->half / 3;
            int h = c->half % 3;
            DMK_TRY(
                offer(ctx, e, &q, f->vertex[(h + 1) % 3], p->offset / s->unit + hypot(c->x, c->y)));
            DMK_TRY(offer(ctx, e, &q, f->vertex[(h + 2) % 3],
                          p->offset / s->unit + hypot(f->length[h] - c->x, c->y)));
        }
    }
    while (q.n > 0) {
        dmk_heap_item top = dmk_heap_pop(&q);
        if (top.key > e->front.d[top.item]) continue;
        for (int32_t c = s->first[top.item], n = 0; c >= 0 && (n == 0 || c != s->first[top.item]);
             n++) {
            const dmk_facet *f = e->front.facet + c / 3;
            int k = c % 3, a = (k + 1) % 3, b = (k + 2) % 3;
            DMK_TRY(offer(ctx, e, &q, f->vertex[a], top.key + f->length[b]));
            c = dmk_star_next(s, c);
            if (c < 0) DMK_TRY(offer(ctx, e, &q, f->vertex[b], top.key + f->length[a]));
        }
    }
    for (int32_t v = 0; v < e->front.g->mesh->n_vertices; v++)
        e->front.d[v] = e->front.d[v] * (1 + DMK_SAME_LENGTH) + 1000 * eps;
done:
    dmk_heap_free(&q);
    return rc;
}

/* ---- windows --------------------------------------------------------------------------------- */

static int push(worker *me, const window *w)
{
    if (me->n_stack == me->capacity) {
        int rc = DMK_GROW(me->ctx, me->stack, me->n_stack + 1, me->capacity);
        if (rc != DMK_OK) return rc;
    }
    me->stack[me->n_stack++] = *w;
    return DMK_OK;
}

/* The distance of v as other threads have left it. */
static inline double known(const engine *e, int32_t v)
{
    double d;
    __atomic_load(e->front.d + v, &d, __ATOMIC_ACQUIRE);
    return d;
}

static void lock(split *s)
{
    uint32_t turn = __atomic_load_n(&s->turn, __ATOMIC_RELAXED);
    while ((turn & 1) || !__atomic_compare_exchange_n(&s->turn, &turn, turn + 1, true,
                                                      __ATOMIC_ACQUIRE, __ATOMIC_RELAXED)) {
        turn = __atomic_load_n(&s->turn, __ATOMIC_RELAXED);
    }
}

static void unlock(split *s)
{
    __atomic_fetch_add(&s->turn, 1, __ATOMIC_RELEASE);
}

/* Of equally short ways one, whichever comes first. */
static bool comes_first(const trace *a, const trace *b)
{
    if (a->half != b->half) return a->half > b->half;
    if (a->root != b->root) return a->root > b->root;
    return a->turn > b->turn;
}

static int reach(worker *me, int32_t v, double d, trace t)
{
    engine *e = me->e;
    split *s = e->split + v;
    if (!(d <= known(e, v))) return DMK_OK;
    if (e->shared) lock(s);
    double before = e->front.d[v];
    bool better = d < before || (d == before && comes_first(&t, e->trace + v));
    if (better) {
        __atomic_store(e->front.d + v, &d, __ATOMIC_RELEASE);
        __atomic_store(&s->at, &t.at, __ATOMIC_RELEASE);
        __atomic_store_n(&s->half, t.half, __ATOMIC_RELEASE);
        e->trace[v] = t;
    }
    if (e->shared) unlock(s);
    if (!better || !e->front.pseudo_source[v] || d == before) return DMK_OK;
    if (me->n_reached == me->reached_room) {
        int rc = DMK_GROW(me->ctx, me->reached, me->n_reached + 1, me->reached_room);
        if (rc != DMK_OK) return rc;
    }
    me->reached[me->n_reached++] = (dmk_heap_item){d, v};
    return DMK_OK;
}

/* Where the shortest way to v through half-edge `half` crosses it, if it is the shortest of all and shorter than
 * d; else NaN. */
static double better_way(const engine *e, int32_t v, int32_t half, double d)
{
    double at;
    const split *s = e->split + v;
    if (__atomic_load_n(&s->half, __ATOMIC_RELAXED) != half) return NAN;
    uint32_t turn = __atomic_load_n(&s->turn, __ATOMIC_ACQUIRE);
    __atomic_load(&s->at, &at, __ATOMIC_ACQUIRE);
    bool shorter = d > known(e, v) + eps && __atomic_load_n(&s->half, __ATOMIC_ACQUIRE) == half;
    bool whole = (turn & 1) == 0 && turn == __atomic_load_n(&s->turn, __ATOMIC_RELAXED);
    return whole && shorter ? at : NAN;
}

/* Whether dv and the way to a place from there, r2 its square, is less than base and a way with the
 * square q2. */
static inline bool beats(double dv, double r2, double base, double q2)
{
    double k = dv + sqrt(r2) - base + eps;
    return k < 0 || k * k < q2;
}

/* Whether a window of half-edge `half` with its ends at the squared distances ql, qh of the root is
 * late at the edge's own ends, d[0] and d[1]. */
static inline bool late(const window *w, double length, double d0, double d1)
{
    double pl = w->lo - w->x, ph = w->hi - w->x, y2 = w->y * w->y;
    double k1 = d1 + (length - w->lo) - w->base + eps, k0 = d0 + w->hi - w->base + eps;
    return !(k1 > 0 && k1 * k1 > pl * pl + y2 && k0 > 0 && k0 * k0 > ph * ph + y2);
}

/* The triangle above a window. */
typedef struct angle {
    double length, left, right; /* sides a-b, a-c, c-b */
    double ca, sa, cb, sb;      /* cosine and sine of the angles at a and b */
    double cx, cy, at;          /* c; where the ray to it crosses a-b */
} angle;

/* The part of w through side a-c; the rays reach up to `last` of a-b. */
static inline bool step_left(const engine *e, const window *w, const dmk_facet *f, const angle *s,
                             double last, window *o)
{
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (f->twin[k2] < 0) return false;
    const double ny = -w->y;
    double lo = ny * w->lo / (ny * s->ca - s->sa * (w->lo - w->x));
    double hi = last >= s->at ? s->left : ny * last / (ny * s->ca - s->sa * (last - w->x));
    if (hi > s->left || !(hi >= 0)) hi = s->left;
    if (!(lo >= 0)) lo = 0;
    if (!(hi - lo > DMK_NO_WIDTH * s->left)) return false;
    *o = (window){lo,
                  hi,
                  w->x * s->ca + w->y * s->sa,
                  w->y * s->ca - w->x * s->sa,
                  w->base,
                  w->turn + f->angle[k1],
                  f->twin[k2],
                  w->root};
    if (!(o->y < 0) || late(o, s->left, known(e, f->vertex[k1]), known(e, f->vertex[k])))
        return false;
    double bx = s->length * s->ca - lo, by = s->length * s->sa, pl = lo - o->x;
    return !beats(known(e, f->vertex[k2]), bx * bx + by * by, w->base, pl * pl + o->y * o->y);
}

/* The part through side c-b, from `first` of a-b on. */
static inline bool step_right(const engine *e, const window *w, const dmk_facet *f, const angle *s,
                              double first, window *o)
{
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (f->twin[k1] < 0) return false;
    const double ny = -w->y;
    double lo = first <= s->at ? s->right
                               : ny * (s->length - first) / (ny * s->cb + s->sb * (first - w->x));
    double hi = ny * (s->length - w->hi) / (ny * s->cb + s->sb * (w->hi - w->x)); /* both from b */
    if (lo > s->right || !(lo >= 0)) lo = s->right;
    if (!(hi >= 0)) hi = 0;
    lo = s->right - lo, hi = s->right - hi;
    if (!(hi - lo > DMK_NO_WIDTH * s->right)) return false;
    double px = w->x - s->cx, py = w->y - s->cy;
    *o = (window){lo,
                  hi,
                  px * s->cb - py * s->sb,
                  py * s->cb + px * s->sb,
                  w->base,
                  w->turn - f->angle[k2],
                  f->twin[k1],
                  w->root};
    if (!(o->y < 0) || late(o, s->right, known(e, f->vertex[k]), known(e, f->vertex[k2])))
        return false;
    double ax = -s->cx * s->cb + s->cy * s->sb - hi, ay = -s->cy * s->cb - s->cx * s->sb,
           ph = hi - o->x;
    return !beats(known(e, f->vertex[k1]), ax * ax + ay * ay, w->base, ph * ph + o->y * o->y);
}

/* The ray to the vertex above passes beside the interval, but by so little that a path around its end is no longer:
 * behind vertices whose angle is 2 pi but for rounding the windows of the two sides part. What a path gets longer by
 * goes with the square of how far it bends. */
static int reach_around(worker *me, const window *w, const angle *s, int32_t v)
{
    double end = s->at < w->lo ? w->lo : w->hi;
    if (!(fabs(s->at - end) < sqrt(DMK_SAME_LENGTH) * s->length)) return DMK_OK;
    double px = s->cx - w->x, py = s->cy - w->y, direct = w->base + sqrt(px * px + py * py);
    if (!(direct < known(me->e, v))) return DMK_OK;
    double d = w->base + hypot(end - w->x, w->y) + hypot(s->cx - end, s->cy);
    if (d > direct + eps) return DMK_OK;
    return reach(me, v, d, (trace){NAN, px, py, w->turn, w->half, w->root});
}

/* Children of w into o[0..1]; the vertex above is reached. *n: how many. */
static inline int step(worker *me, const window *w, window *o, int *n)
{
    const engine *e = me->e;
    const dmk_facet *f = e->front.facet + w->half / 3;
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1, rc = DMK_OK;
    const int32_t v = f->vertex[k];
    angle s = {f->length[k],
               f->length[k2],
               f->length[k1],
               f->cosine[k1],
               f->sine[k1],
               f->cosine[k2],
               f->sine[k2],
               0,
               0,
               0};
    s.cx = s.left * s.ca, s.cy = s.left * s.sa;
    s.at = w->x - (s.cx - w->x) * w->y / (s.cy - w->y);
    const double slack = DMK_SAME_PLACE * s.length;
    bool left = w->lo<s.at, right = w->hi> s.at;
    double last = w->hi, first = w->lo;
    if (s.at >= w->lo - slack && s.at <= w->hi + slack) {
        double px = s.cx - w->x, py = s.cy - w->y, d = w->base + sqrt(px * px + py * py);
        double dv = known(e, v);
        if (d <= dv) {
            rc = reach(me, v, d, (trace){s.at, px, py, w->turn, w->half, w->root});
        } else if (d > dv + eps) {
            double at = better_way(e, v, w->half, d);
            if (s.at < at - slack)
                right = false; /* those rays cross the shorter way */
            else if (s.at > at + slack)
                left = false;
        }
        if (left) last = fmin(w->hi, s.at);
        if (right) first = fmax(w->lo, s.at);
    } else {
        rc = reach_around(me, w, &s, v);
    }
    *n = left && step_left(e, w, f, &s, last, o);
    *n += right && step_right(e, w, f, &s, first, o + *n);
    return rc;
}

/* n windows more. */
static inline int count(worker *me, int n)
{
    me->n_made += n;
    if ((me->n_made & 0xffff) >= n) return DMK_OK;
    me->e->n_made += 0x10000;
    return dmk_poll(me->ctx);
}

/* Run down the windows on the stack, `most` steps. */
static int run_down(worker *me, int64_t most)
{
    int rc = DMK_OK;
    window o[2];
    while (me->n_stack > 0 && most > 0 && !spent(me->e)) {
        window w = me->stack[--me->n_stack];
        for (int n = 1; n > 0; w = o[0]) {
            DMK_TRY(step(me, &w, o, &n));
            DMK_TRY(count(me, n));
            if (spent(me->e)) goto done;
            most--;
            if (n == 2) DMK_TRY(push(me, &o[1]));
        }
    }
done:
    return rc;
}

/* ---- threads --------------------------------------------------------------------------------- */

/* Threads run windows down in any order. What the filters drop is longer than some way by more than rounding,
 * whenever they look, so the least value at each vertex and the way it comes are the same. */
typedef struct pool {
    worker *one;         /* whose stack is shared out */
    worker *own;         /* of each thread */
    _Atomic bool *taken; /* of each window of the stack */
    int n_threads;
} pool;
/* Windows to share out, and the steps before, some 0.05 s, by one thread: how many windows several make depends on
 * when they see each other's distances, on stretched meshes by a factor of three, and few are left to share on small
 * ones. */
enum { shares = 2048, alone = 500000 };

/* Neighbours on the stack are neighbours on the surface: each thread begins at a place of its own, so that they seldom
 * write to each other's cache lines. */
static int run_share(dmk_context *ctx, int32_t i, void *data)
{
    int rc = DMK_OK;
    pool *c = data;
    worker *me = c->own + i;
    const size_t n = c->one->n_stack, first = n * (size_t)i / (size_t)c->n_threads;
    me->ctx = ctx;
    for (size_t k = 0; k < n && !spent(me->e); k++) {
        const size_t at = (first + k) % n;
        if (atomic_exchange(c->taken + at, true)) continue;
        DMK_TRY(push(me, c->one->stack + at));
        DMK_TRY(run_down(me, INT64_MAX));
    }
done:
    return rc;
}

/* Take steps level by level until there are `shares` windows on the stack, or none. */
static int spread(worker *me)
{
    int rc = DMK_OK, n;
    window o[2];
    worker other = {.ctx = me->ctx, .e = me->e};
    while (me->n_stack > 0 && me->n_stack < shares && !spent(me->e)) {
        for (size_t i = 0; i < me->n_stack; i++) {
            DMK_TRY(step(me, me->stack + i, o, &n));
            DMK_TRY(count(me, n));
            for (int k = 0; k < n; k++) DMK_TRY(push(&other, o + k));
        }
        window *taken = me->stack;
        size_t room = me->capacity;
        me->stack = other.stack, me->capacity = other.capacity, me->n_stack = other.n_stack;
        other.stack = taken, other.capacity = room, other.n_stack = 0;
    }
done:
    free(other.stack);
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

static void worker_free(worker *me)
{
    free(me->stack);
    free(me->reached);
}

static int run_shared(worker *me, int n_threads)
{
    int rc;
    pool c = {.one = me, .n_threads = n_threads};
    DMK_TRY(spread(me));
    dmk_geodesics *g = me->e->front.g;
    if (g->n_shared < (int64_t)me->n_stack) g->n_shared = (int64_t)me->n_stack;
    DMK_TRY(DMK_NEW(me->ctx, c.own, (size_t)n_threads));
    DMK_TRY(DMK_NEW(me->ctx, c.taken, me->n_stack));
    for (int i = 0; i < n_threads; i++) c.own[i].e = me->e;
    me->e->shared = true;
    rc = dmk_parallel_pieces(me->ctx, n_threads, run_share, &c);
    me->e->shared = false;
    me->n_stack = 0;
    for (int i = 0; i < n_threads; i++) {
        if (rc == DMK_OK) rc = absorb(me, c.own + i);
        me->n_made += c.own[i].n_made;
        worker_free(c.own + i);
    }
done:
    free(c.own);
    free(c.taken);
    return rc;
}

/* Run down all windows on the stack; then the pseudo-sources that were reached wait in the heap. */
static int run_all(worker *me)
{
    int rc, n_threads = dmk_parallel_threads(me->ctx);
    DMK_TRY(run_down(me, n_threads > 1 ? alone : INT64_MAX));
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
        DMK_TRY(reach(me, end.vertex, a->base + end.length,
                      (trace){HUGE_VAL, end.direction, end.back, 0, STRAIGHT, a->root}));
    }
    if (!dmk_front_beam(front, c, a->lo, a->hi, &b)) goto done;
    me->n_made++;
    rc = push(me, &(window){b.lo, b.hi, b.x, b.y, a->base, b.turn, b.half, a->root});
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

/* Direction back along the path at a vertex that was reached. */
static double back_of(const engine *e, int32_t v)
{
    const trace *t = e->trace + v;
    const dmk_star *s = &e->front.g->star;
    double back = t->y;
    if (t->half >= 0) {
        const dmk_facet *f = e->front.facet + t->half / 3;
        int k1 = (t->half + 1) % 3;
        if (t->half % 3 == 2) k1 = 0;
        double ax = -f->cosine[k1], ay = -f->sine[k1], bx = -t->x, by = -t->y;
        back = s->angle[t->half] + atan2(ax * by - ay * bx, ax * bx + ay * by);
    }
    return dmk_front_turn(back, s->total[v], s->border[v]);
}

static int radiate_pseudo_source(worker *me, int32_t v)
{
    int rc = DMK_OK;
    const engine *e = me->e;
    const dmk_star *s = &e->front.g->star;
    double range[2][2];
    int n_ranges = dmk_front_directions(&e->front, v, back_of(e, v), range),
        turns = s->border[v] ? 0 : 1;
    int32_t c = s->first[v];
    do {
        dmk_sector sector = dmk_front_corner(&e->front, c);
        for (int i = 0; i < n_ranges; i++) {
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

/* ---- arrivals -------------------------------------------------------------------------------- */

/* Source and direction come from the first pseudo-source of the path. */
static void arrive(const engine *e, int32_t v)
{
    const trace *t = e->trace + v;
    dmk_arrival *a = e->front.g->arrival + v;
    *a = (dmk_arrival){0, 0, -1, -1};
    if (t->half == UNREACHED) {
        e->front.d[v] = INFINITY;
        return;
    }
    e->front.d[v] *= e->front.g->star.unit;
    a->back = back_of(e, v);
    a->pseudo_source = t->root >= 0 ? t->root : -1;
    while (t->root >= 0) t = e->trace + t->root;
    a->source = ~t->root;
    const dmk_site *p = e->front.g->source + a->source;
    a->direction = dmk_front_turn(t->half >= 0 ? t->turn + atan2(t->y, t->x) : t->x, p->total,
                                  p->vertex >= 0 && e->front.g->star.border[p->vertex]);
}

static void arrive_range(int32_t begin, int32_t end, void *data)
{
    for (int32_t v = begin; v < end; v++) arrive(data, v);
}

/* All pseudo-sources within `width` of the nearest radiate at once, so that threads have windows to share; one that is
 * reached by a shorter way later does so again. */
static int radiate_next(worker *me, double width, bool *any)
{
    int rc = DMK_OK;
    engine *e = me->e;
    double until = INFINITY;
    *any = false;
    while (e->pseudo_sources.n > 0 && e->pseudo_sources.at[0].key <= until) {
        dmk_heap_item top = dmk_heap_pop(&e->pseudo_sources);
        if (top.key > e->front.d[top.item]) continue;
        if (!*any) until = top.key + width;
        *any = true;
        DMK_TRY(radiate_pseudo_source(me, top.item));
    }
done:
    return rc;
}

int dmk_windows_run(dmk_context *ctx, dmk_geodesics *g, bool *finished)
{
    int rc;
    bool any = true;
    engine e;
    worker me = {.ctx = ctx, .e = &e};
    DMK_TRY(engine_create(ctx, g, &e));
    DMK_TRY(bound(ctx, &e));
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < g->n_sources; i++) DMK_TRY(radiate_source(&me, i));
    while (any && !spent(&e)) {
        DMK_TRY(run_all(&me));
        DMK_TRY(radiate_next(&me, 0, &any));
    }
    *finished = !spent(&e);
    if (*finished) dmk_parallel(ctx, g->mesh->n_vertices, arrive_range, &e);
    g->n_windows = me.n_made;
done:
    worker_free(&me);
    engine_free(&e);
    return rc;
}
