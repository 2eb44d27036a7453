/* One step of a window, into the triangle above it: see window.c. */
#include "geodesic/window_engine.h"

#include "base/base.h"

static const double eps = DMK_SAME_LENGTH;

int dmk_windows_push(worker *me, const window *w)
{
    if (me->n_stack == me->capacity) {
        int rc = DMK_GROW(me->ctx, me->stack, me->n_stack + 1, me->capacity);
        if (rc != DMK_OK) return rc;
    }
    me->stack[me->n_stack++] = *w;
    return DMK_OK;
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

bool dmk_windows_first(const trace *a, const trace *b)
{
    if (a->half != b->half) return a->half > b->half;
    if (a->root != b->root) return a->root > b->root;
    return a->turn > b->turn;
}

/* What gives way to an equally short one, or does not come up to it. */
static int add_tied(worker *me, int32_t v, double d, const trace *t)
{
    const int rc = DMK_GROW(me->ctx, me->tied, me->n_tied + 1, me->tied_room);
    if (rc == DMK_OK) me->tied[me->n_tied++] = (tied){d, v, *t};
    return rc;
}

int dmk_windows_reach(worker *me, int32_t v, double d, trace t)
{
    int rc = DMK_OK;
    engine *e = me->e;
    split *s = e->split + v;
    if (!(d <= dmk_windows_known(e, v) + eps)) return DMK_OK;
    if (e->shared) lock(s);
    const double before = e->front.d[v];
    const trace was = e->trace[v];
    const bool better = d < before || (d == before && dmk_windows_first(&t, e->trace + v));
    if (better) {
        __atomic_store(e->front.d + v, &d, __ATOMIC_RELEASE);
        __atomic_store(&s->at, &t.at, __ATOMIC_RELEASE);
        __atomic_store_n(&s->half, t.half, __ATOMIC_RELEASE);
        e->trace[v] = t;
    }
    if (e->shared) unlock(s);
    if (was.half != UNREACHED && fabs(d - before) <= eps)
        DMK_TRY(add_tied(me, v, better ? before : d, better ? &was : &t));
    if (!better || !e->front.pseudo_source[v] || d == before) return DMK_OK;
    DMK_TRY(DMK_GROW(me->ctx, me->reached, me->n_reached + 1, me->reached_room));
    me->reached[me->n_reached++] = (dmk_heap_item){d, v};
done:
    return rc;
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
    bool shorter =
        d > dmk_windows_known(e, v) + eps && __atomic_load_n(&s->half, __ATOMIC_ACQUIRE) == half;
    bool whole = (turn & 1) == 0 && turn == __atomic_load_n(&s->turn, __ATOMIC_RELAXED);
    return whole && shorter ? at : NAN;
}

/* The ray that passes (x, y), in the frame of the window's half-edge. */
static inline double ray_x(const window *w, double x)
{
    return w->parallel ? -w->x : x - w->x;
}

static inline double ray_y(const window *w, double y)
{
    return w->parallel ? -w->y : y - w->y;
}

/* The length of the way straight there. */
static inline double way(const window *w, double x, double y)
{
    const double px = x - w->x, py = y - w->y;
    return w->parallel ? w->base - (w->x * x + w->y * y) : w->base + sqrt(px * px + py * py);
}

/* Whether a way of this length to that place of the half-edge is shorter than the window's. */
static inline bool beats(const window *w, double length, double at)
{
    double k = length - w->base + eps, p = at - w->x;
    if (w->parallel) return k < -w->x * at;
    return k < 0 || k * k < p * p + w->y * w->y;
}

/* Whether a window is late at its half-edge's own ends, which are reached by d0 and d1. */
static inline bool late(const window *w, double length, double d0, double d1)
{
    double pl = w->lo - w->x, ph = w->hi - w->x, y2 = w->y * w->y;
    double k1 = d1 + (length - w->lo) - w->base + eps, k0 = d0 + w->hi - w->base + eps;
    if (w->parallel) return !(k1 > -w->x * w->lo && k0 > -w->x * w->hi);
    return !(k1 > 0 && k1 * k1 > pl * pl + y2 && k0 > 0 && k0 * k0 > ph * ph + y2);
}

/* Rays from a root behind the half-edge, or none; parallel ones beside an edge along them have no width either. */
static inline bool grazes(const window *w)
{
    return w->parallel ? !((w->hi - w->lo) * -w->y > DMK_NO_WIDTH * w->length) : !(w->y < 0);
}

/* The triangle above a window. */
typedef struct angle {
    double length, left, right; /* sides a-b, a-c, c-b */
    double ca, sa, cb, sb;      /* cosine and sine of the angles at a and b */
    double cx, cy, at;          /* c; where the ray to it crosses a-b */
    double place, d;            /* on a-b, if it is known: its distance by a shorter way to c */
} angle;

/* At corner k of its triangle. */
static inline double angle_of(const engine *e, const window *w, int k)
{
    return e->front.g->star.corner_angle[w->half - w->half % 3 + k];
}

/* The part of w through side a-c; the rays reach up to `last` of a-b. */
static inline bool step_left(const engine *e, const window *w, const dmk_facet *f, const angle *s,
                             double last, window *o)
{
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (f->twin[k2] < 0) return false;
    const double ny = -w->y;
    double lo = ny * w->lo / (ny * s->ca - s->sa * ray_x(w, w->lo));
    double hi = last >= s->at ? s->left : ny * last / (ny * s->ca - s->sa * ray_x(w, last));
    if (hi > s->left || !(hi >= 0)) hi = s->left;
    if (!(lo >= 0)) lo = 0;
    if (!(hi - lo > DMK_NO_WIDTH * s->left)) return false;
    *o = (window){.lo = lo,
                  .hi = hi,
                  .x = w->x * s->ca + w->y * s->sa,
                  .y = w->y * s->ca - w->x * s->sa,
                  .base = w->base,
                  .turn = w->turn + angle_of(e, w, k1),
                  .length = s->left,
                  .half = f->twin[k2],
                  .root = w->root,
                  .parallel = w->parallel};
    if (grazes(o) ||
        late(o, s->left, dmk_windows_known(e, f->vertex[k1]), dmk_windows_known(e, f->vertex[k])))
        return false;
    double bx = s->length * s->ca - lo, by = s->length * s->sa;
    if (beats(o, dmk_windows_known(e, f->vertex[k2]) + sqrt(bx * bx + by * by), lo)) return false;
    bx = s->place * s->ca - lo, by = s->place * s->sa;
    return !beats(o, s->d + sqrt(bx * bx + by * by), lo);
}

/* The part through side c-b, from `first` of a-b on. */
static inline bool step_right(const engine *e, const window *w, const dmk_facet *f, const angle *s,
                              double first, window *o)
{
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (f->twin[k1] < 0) return false;
    const double ny = -w->y;
    double lo = first <= s->at ? s->right
                               : ny * (s->length - first) / (ny * s->cb + s->sb * ray_x(w, first));
    double hi = ny * (s->length - w->hi) / (ny * s->cb + s->sb * ray_x(w, w->hi)); /* both from b */
    if (lo > s->right || !(lo >= 0)) lo = s->right;
    if (!(hi >= 0)) hi = 0;
    lo = s->right - lo, hi = s->right - hi;
    if (!(hi - lo > DMK_NO_WIDTH * s->right)) return false;
    double px = w->x, py = w->y;
    if (!w->parallel) px -= s->cx, py -= s->cy;
    *o = (window){.lo = lo,
                  .hi = hi,
                  .x = px * s->cb - py * s->sb,
                  .y = py * s->cb + px * s->sb,
                  .base = w->parallel ? way(w, s->cx, s->cy) : w->base,
                  .turn = w->turn - angle_of(e, w, k2),
                  .length = s->right,
                  .half = f->twin[k1],
                  .root = w->root,
                  .parallel = w->parallel};
    if (grazes(o) ||
        late(o, s->right, dmk_windows_known(e, f->vertex[k]), dmk_windows_known(e, f->vertex[k2])))
        return false;
    double ax = -s->cx * s->cb + s->cy * s->sb - hi, ay = -s->cy * s->cb - s->cx * s->sb;
    if (beats(o, dmk_windows_known(e, f->vertex[k1]) + sqrt(ax * ax + ay * ay), hi)) return false;
    ax += s->place * s->cb, ay += s->place * s->sb;
    return !beats(o, s->d + sqrt(ax * ax + ay * ay), hi);
}

/* The ray to the vertex above passes beside the interval, but by so little that a path around its end is no longer:
 * behind vertices whose angle is 2 pi but for rounding the windows of the two sides part. What a path gets longer by
 * goes with the square of how far it bends. It counts against all that are equally short, whichever came first, so that
 * the result does not depend on the order. */
static int reach_around(worker *me, const window *w, const angle *s, int32_t v)
{
    double end = s->at < w->lo ? w->lo : w->hi;
    if (!(fabs(s->at - end) < DMK_BESIDE * s->length + DMK_SAME_LENGTH)) return DMK_OK;
    double px = ray_x(w, s->cx), py = ray_y(w, s->cy), direct = way(w, s->cx, s->cy);
    if (!(direct <= dmk_windows_known(me->e, v) + eps)) return DMK_OK;
    double d = (w->parallel ? way(w, end, 0) : w->base + hypot(end - w->x, w->y)) +
               hypot(s->cx - end, s->cy);
    d = dmk_max(d, direct); /* rounding may have made it less */
    if (d > direct + eps) return DMK_OK;
    return dmk_windows_reach(me, v, d, (trace){NAN, px, py, w->turn, w->half, w->root});
}

int dmk_windows_step(worker *me, const window *w, window *o, int *n)
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
               0,
               NAN,
               NAN};
    s.cx = s.left * s.ca, s.cy = s.left * s.sa;
    s.at = w->parallel ? s.cx - s.cy * w->x / w->y : w->x - (s.cx - w->x) * w->y / (s.cy - w->y);
    const double slack = DMK_SAME_PLACE * s.length;
    bool left = w->lo<s.at, right = w->hi> s.at;
    double last = w->hi, first = w->lo;
    if (s.at >= w->lo - slack && s.at <= w->hi + slack) {
        double px = ray_x(w, s.cx), py = ray_y(w, s.cy), d = way(w, s.cx, s.cy);
        double dv = dmk_windows_known(e, v);
        if (d <= dv + eps) {
            rc = dmk_windows_reach(me, v, d, (trace){s.at, px, py, w->turn, w->half, w->root});
        } else {
            const double at = better_way(e, v, w->half, d);
            /* Rays that cross the shorter way are of no use; nor are those beyond it (Chen and Han), but from a source
             * behind another one, which they pass. Not cut there, as that place depends on what is known by now. */
            const bool one_source = e->front.g->n_sources == 1 && e->front.g->n_lines == 0;
            if (s.at < at - slack && (one_source || at >= w->hi))
                first = w->hi;
            else if (s.at > at + slack && (one_source || at <= w->lo))
                last = w->lo;
            s.place = at;
            s.d = dv - hypot(s.cx - at, s.cy);
        }
        if (left) last = dmk_min(last, s.at);
        if (right) first = dmk_max(first, s.at);
    } else {
        rc = reach_around(me, w, &s, v);
    }
    *n = left && step_left(e, w, f, &s, last, o);
    *n += right && step_right(e, w, f, &s, first, o + *n);
    return rc;
}

int dmk_windows_count(worker *me, int64_t n)
{
    me->n_made += n;
    if (me->n_made % DMK_PIECE >= n) return DMK_OK;
    me->e->n_made += DMK_PIECE;
    return dmk_poll(me->ctx);
}
