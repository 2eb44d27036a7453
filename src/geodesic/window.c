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
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
/* Rounding, over the mesh's extent, the unit of length here: ways so much longer count as equally
 * long. */
static const double same_length = 1e-12;
/* Rounding, over the length of the edge: a ray so little beside the interval is in it; a window so
 * narrow is none. */
static const double same_place = 1e-11, no_width = 1e-12;
/* Beside the interval by less, over the edge's length, a path bends at its end if it gets hardly
 * longer: behind vertices whose angle is 2 pi but for rounding the windows of the two sides part.
 */
static const double gap = 1e-6;
/* Radians over 2 pi that make a bend; and below pi at a border, whose straight vertices all count.
 */
static const double least_excess = 1e-10, straight = 1e-6;
/* Radians: an edge so near the rays is one. */
static const double same_direction = 1e-9;

typedef struct engine {
    dmk_geodesics *g;
    dmk_facet *facet;
    double *d;
    dmk_trace *trace;
    bool *bend;
    double eps;
    dmk_window *stack;
    size_t n_stack, capacity;
    dmk_heap bends; /* reached, to radiate */
    int64_t n_made;
} engine;

/* ---- set-up ---------------------------------------------------------------------------------- */

static void facet_range(int32_t begin, int32_t end, void *data)
{
    const engine *e = data;
    const dmk_mesh *m = e->g->mesh;
    const dmk_star *s = &e->g->star;
    for (int32_t t = begin; t < end; t++) {
        dmk_facet *f = e->facet + t;
        for (int k = 0; k < 3; k++) {
            size_t h = 3 * (size_t)t + (size_t)k;
            f->length[k] = m->length[m->triangle_edge[h]] / s->unit;
            f->angle[k] = s->corner_angle[h];
            f->cosine[k] = cos(f->angle[k]);
            f->sine[k] = sin(f->angle[k]);
            f->vertex[k] = m->triangle[h];
            f->twin[k] = s->twin[h];
        }
    }
}

static int engine_create(dmk_context *ctx, dmk_geodesics *g, engine *e)
{
    int rc;
    const dmk_mesh *m = g->mesh;
    size_t n = (size_t)m->n_vertices;
    memset(e, 0, sizeof *e);
    e->g = g;
    e->d = g->distance;
    e->eps = same_length;
    DMK_TRY(DMK_NEW(ctx, e->facet, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, e->trace, n));
    DMK_TRY(DMK_NEW(ctx, e->bend, n));
    dmk_parallel(ctx, m->n_triangles, facet_range, e);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const dmk_star *s = &g->star;
        e->bend[v] = s->first[v] >= 0 &&
                     s->total[v] > (s->border[v] ? pi - straight : 2 * pi + least_excess);
        e->d[v] = INFINITY;
        e->trace[v] = (dmk_trace){.half = DMK_UNREACHED, .root = ~g->n_sources};
    }
done:
    return rc;
}

static void engine_free(engine *e)
{
    free(e->facet);
    free(e->trace);
    free(e->bend);
    free(e->stack);
    dmk_heap_free(&e->bends);
}

/* ---- upper bounds ---------------------------------------------------------------------------- */

static dmk_sector in_units(const engine *e, const dmk_sector *s)
{
    double unit = e->g->star.unit;
    return (dmk_sector){s->x / unit, s->y / unit, s->angle, s->span, s->half};
}

static int offer(dmk_context *ctx, engine *e, dmk_heap *q, int32_t v, double d)
{
    if (!(d < e->d[v])) return DMK_OK;
    e->d[v] = d;
    return dmk_heap_push(ctx, q, d, v);
}

/* Lengths of paths along edges (Dijkstra), and a little more: a bound must be reached, not only
 * met. */
static int bound(dmk_context *ctx, engine *e)
{
    int rc = DMK_OK;
    dmk_heap q = {0};
    const dmk_star *s = &e->g->star;
    for (int32_t i = 0; i < e->g->n_sources; i++) {
        const dmk_site *p = e->g->source + i;
        if (p->vertex >= 0) DMK_TRY(offer(ctx, e, &q, p->vertex, p->offset / s->unit));
        for (int32_t k = 0; k < p->n_sectors; k++) {
            const dmk_sector in = in_units(e, p->sector + k), *c = &in;
            const dmk_facet *f = e->facet + c->half / 3;
            int h = c->half % 3;
            DMK_TRY(
                offer(ctx, e, &q, f->vertex[(h + 1) % 3], p->offset / s->unit + hypot(c->x, c->y)));
            DMK_TRY(offer(ctx, e, &q, f->vertex[(h + 2) % 3],
                          p->offset / s->unit + hypot(f->length[h] - c->x, c->y)));
        }
    }
    while (q.n > 0) {
        dmk_heap_item top = dmk_heap_pop(&q);
        if (top.key > e->d[top.item]) continue;
        for (int32_t c = s->first[top.item], n = 0; c >= 0 && (n == 0 || c != s->first[top.item]);
             n++) {
            const dmk_facet *f = e->facet + c / 3;
            int k = c % 3, a = (k + 1) % 3, b = (k + 2) % 3;
            DMK_TRY(offer(ctx, e, &q, f->vertex[a], top.key + f->length[b]));
            DMK_TRY(offer(ctx, e, &q, f->vertex[b], top.key + f->length[a]));
            c = dmk_star_next(s, c);
        }
    }
    for (int32_t v = 0; v < e->g->mesh->n_vertices; v++)
        e->d[v] = e->d[v] * (1 + same_length) + 1000 * e->eps;
done:
    dmk_heap_free(&q);
    return rc;
}

/* ---- windows --------------------------------------------------------------------------------- */

static int push(dmk_context *ctx, engine *e, const dmk_window *w)
{
    if (e->n_stack == e->capacity) {
        int rc = DMK_GROW(ctx, e->stack, e->n_stack + 1, e->capacity);
        if (rc != DMK_OK) return rc;
    }
    e->stack[e->n_stack++] = *w;
    return DMK_OK;
}

static int reach(dmk_context *ctx, engine *e, int32_t v, double d, dmk_trace trace)
{
    if (!(d < e->d[v])) return DMK_OK;
    e->d[v] = d;
    e->trace[v] = trace;
    return e->bend[v] ? dmk_heap_push(ctx, &e->bends, d, v) : DMK_OK;
}

/* Whether dv and the way to a place from there, r2 its square, is less than base and a way with the
 * square q2. */
static inline bool beats(double dv, double r2, double base, double q2, double eps)
{
    double k = dv + sqrt(r2) - base + eps;
    return k < 0 || k * k < q2;
}

/* Whether a window of half-edge `half` with its ends at the squared distances ql, qh of the bend is
 * late at the edge's own ends, d[0] and d[1]. */
static inline bool late(const dmk_window *w, double length, double d0, double d1, double eps)
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
static inline bool step_left(const engine *e, const dmk_window *w, const dmk_facet *f,
                             const angle *s, double last, dmk_window *o)
{
    int k = w->half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    if (f->twin[k2] < 0) return false;
    const double ny = -w->y;
    double lo = ny * w->lo / (ny * s->ca - s->sa * (w->lo - w->x));
    double hi = last >= s->at ? s->left : ny * last / (ny * s->ca - s->sa * (last - w->x));
    if (hi > s->left || !(hi >= 0)) hi = s->left;
    if (!(lo >= 0)) lo = 0;
    if (!(hi - lo > no_width * s->left)) return false;
    *o = (dmk_window){lo,
                      hi,
                      w->x * s->ca + w->y * s->sa,
                      w->y * s->ca - w->x * s->sa,
                      w->base,
                      w->turn + f->angle[k1],
                      f->twin[k2],
                      w->root};
    if (!(o->y < 0) || late(o, s->left, e->d[f->vertex[k1]], e->d[f->vertex[k]], e->eps))
        return false;
    double bx = s->length * s->ca - lo, by = s->length * s->sa, pl = lo - o->x;
    return !beats(e->d[f->vertex[k2]], bx * bx + by * by, w->base, pl * pl + o->y * o->y, e->eps);
}

/* The part through side c-b, from `first` of a-b on. */
static inline bool step_right(const engine *e, const dmk_window *w, const dmk_facet *f,
                              const angle *s, double first, dmk_window *o)
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
    if (!(hi - lo > no_width * s->right)) return false;
    double px = w->x - s->cx, py = w->y - s->cy;
    *o = (dmk_window){lo,
                      hi,
                      px * s->cb - py * s->sb,
                      py * s->cb + px * s->sb,
                      w->base,
                      w->turn - f->angle[k2],
                      f->twin[k1],
                      w->root};
    if (!(o->y < 0) || late(o, s->right, e->d[f->vertex[k]], e->d[f->vertex[k2]], e->eps))
        return false;
    double ax = -s->cx * s->cb + s->cy * s->sb - hi, ay = -s->cy * s->cb - s->cx * s->sb,
           ph = hi - o->x;
    return !beats(e->d[f->vertex[k1]], ax * ax + ay * ay, w->base, ph * ph + o->y * o->y, e->eps);
}

/* The ray to the vertex above passes beside the interval, but by so little that a path around its
 * end is no longer. */
static int reach_around(dmk_context *ctx, engine *e, const dmk_window *w, const angle *s, int32_t v)
{
    double end = s->at < w->lo ? w->lo : w->hi;
    if (!(fabs(s->at - end) < gap * s->length)) return DMK_OK;
    double px = s->cx - w->x, py = s->cy - w->y, direct = w->base + sqrt(px * px + py * py);
    if (!(direct < e->d[v])) return DMK_OK;
    double d = w->base + hypot(end - w->x, w->y) + hypot(s->cx - end, s->cy);
    if (d > direct + e->eps) return DMK_OK;
    return reach(ctx, e, v, d, (dmk_trace){HUGE_VAL, px, py, w->turn, w->half, w->root});
}

/* Children of w into o[0..1]; the vertex above is reached. *n: how many. */
static inline int step(dmk_context *ctx, engine *e, const dmk_window *w, dmk_window *o, int *n)
{
    const dmk_facet *f = e->facet + w->half / 3;
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
    const double slack = same_place * s.length;
    bool left = w->lo<s.at, right = w->hi> s.at;
    double last = w->hi, first = w->lo;
    if (s.at >= w->lo - slack && s.at <= w->hi + slack) {
        double px = s.cx - w->x, py = s.cy - w->y, d = w->base + sqrt(px * px + py * py);
        if (d < e->d[v]) {
            rc = reach(ctx, e, v, d, (dmk_trace){s.at, px, py, w->turn, w->half, w->root});
        } else if (e->trace[v].half == w->half && d > e->d[v] + e->eps) {
            if (s.at < e->trace[v].at - slack)
                right = false; /* those rays cross the shorter path */
            else if (s.at > e->trace[v].at + slack && e->trace[v].at < HUGE_VAL)
                left = false;
        }
        if (left) last = fmin(w->hi, s.at);
        if (right) first = fmax(w->lo, s.at);
    } else {
        rc = reach_around(ctx, e, w, &s, v);
    }
    *n = left && step_left(e, w, f, &s, last, o);
    *n += right && step_right(e, w, f, &s, first, o + *n);
    return rc;
}

/* Run down all windows on the stack. */
static int run_down(dmk_context *ctx, engine *e)
{
    int rc = DMK_OK;
    dmk_window o[2];
    while (e->n_stack > 0) {
        dmk_window w = e->stack[--e->n_stack];
        for (int n = 1; n > 0; w = o[0]) {
            DMK_TRY(step(ctx, e, &w, o, &n));
            e->n_made += n;
            if ((e->n_made & 0xffff) < n) DMK_TRY(dmk_poll(ctx));
            if (n == 2) DMK_TRY(push(ctx, e, &o[1]));
        }
    }
done:
    return rc;
}

/* ---- sources and bends ----------------------------------------------------------------------- */

/* Rays from a source or bend at (x, y) of the frame of half-edge `half` of its own triangle, where
 * they have the directions from `angle` on, as far as they lie within lo..hi: the window beyond,
 * and the ends of the half-edge. */
typedef struct fan {
    double base, lo, hi;
    int32_t root;
    bool both; /* the end of the half-edge too, not only its start */
} fan;

static int reach_ends(dmk_context *ctx, engine *e, const dmk_sector *c, const fan *a)
{
    const dmk_star *s = &e->g->star;
    int32_t h = c->half, from = dmk_next(h), to = dmk_previous(h);
    const dmk_facet *f = e->facet + h / 3;
    double length = f->length[h % 3], end = c->angle + c->span;
    int rc = DMK_OK;
    if (a->lo <= c->angle + same_direction && a->hi >= c->angle - same_direction) {
        double back = s->angle[from] + atan2(c->y, c->x);
        rc = reach(ctx, e, f->vertex[from % 3], a->base + hypot(c->x, c->y),
                   (dmk_trace){HUGE_VAL, c->angle, back, 0, DMK_STRAIGHT, a->root});
    }
    if (rc == DMK_OK && a->both && a->lo <= end + same_direction && a->hi >= end - same_direction) {
        double back = s->angle[to] + s->corner_angle[to] - atan2(c->y, length - c->x);
        rc = reach(ctx, e, f->vertex[to % 3], a->base + hypot(length - c->x, c->y),
                   (dmk_trace){HUGE_VAL, end, back, 0, DMK_STRAIGHT, a->root});
    }
    return rc;
}

static int send(dmk_context *ctx, engine *e, const dmk_sector *c, const fan *a)
{
    int rc = reach_ends(ctx, e, c, a);
    double l = fmax(a->lo - c->angle, 0), r = fmin(a->hi - c->angle, c->span);
    const dmk_facet *f = e->facet + c->half / 3;
    int32_t o = f->twin[c->half % 3];
    if (rc != DMK_OK || !(r - l >= no_width) || o < 0) return rc;
    /* Seen from the other triangle the half-edge runs backwards. From the direction of its start to
     * a ray turned by t: the ray meets it at radius sin(t) / sin(t + angle there) from the start.
     */
    double length = f->length[c->half % 3], radius = hypot(c->x, c->y), start = atan2(c->y, c->x);
    double hi = l <= 0 ? length : length - radius * sin(l) / sin(l + start);
    double lo = r >= c->span ? 0 : length - radius * sin(r) / sin(r + start);
    lo = fmax(0, lo - 1e-9 * length), hi = fmin(length, hi + 1e-9 * length);
    dmk_window w = {lo, hi, length - c->x, -c->y, a->base, c->angle - start, o, a->root};
    e->n_made++;
    return push(ctx, e, &w);
}

static int radiate_source(dmk_context *ctx, engine *e, int32_t number)
{
    int rc = DMK_OK;
    const dmk_site *p = e->g->source + number;
    fan a = {p->offset / e->g->star.unit, -1, p->total + 1, ~number, true};
    if (p->vertex >= 0) {
        if (a.base >= e->d[p->vertex]) return DMK_OK;
        e->d[p->vertex] = a.base;
        e->trace[p->vertex] = (dmk_trace){HUGE_VAL, 0, 0, 0, DMK_STRAIGHT, ~number};
    }
    for (int32_t k = 0; k < p->n_sectors; k++) {
        dmk_sector c = in_units(e, p->sector + k);
        DMK_TRY(send(ctx, e, &c, &a));
    }
done:
    return rc;
}

/* Direction back along the path at a vertex that was reached. */
static double back_of(const engine *e, int32_t v)
{
    const dmk_trace *t = e->trace + v;
    const dmk_star *s = &e->g->star;
    double total = s->total[v];
    double back = t->y;
    if (t->half >= 0) {
        const dmk_facet *f = e->facet + t->half / 3;
        int k = t->half % 3, k1 = (k + 1) % 3;
        double ax = -f->cosine[k1], ay = -f->sine[k1], bx = -t->x, by = -t->y;
        back = s->angle[t->half] + atan2(ax * by - ay * bx, ax * bx + ay * by);
    }
    if (s->border[v]) return fmin(fmax(back, 0), total);
    back -= total * floor(back / total);
    return back < total ? back : 0;
}

/* Into the directions lo..hi of the chart of v. */
static int radiate_wedge(dmk_context *ctx, engine *e, int32_t v, double lo, double hi)
{
    int rc = DMK_OK;
    const dmk_star *s = &e->g->star;
    int turns = s->border[v] ? 0 : 1; /* the wedge may go around */
    for (int32_t c = s->first[v], n = 0; c >= 0 && (n == 0 || c != s->first[v]);
         n++, c = dmk_star_next(s, c)) {
        const dmk_facet *f = e->facet + c / 3;
        int k = c % 3, a = (k + 1) % 3, b = (k + 2) % 3;
        dmk_sector sector = {f->length[b] * f->cosine[a], f->length[b] * f->sine[a], s->angle[c],
                             f->angle[k], c};
        for (int i = -turns; i <= turns; i++) {
            fan w = {e->d[v], lo + i * s->total[v], hi + i * s->total[v], v, s->border[v]};
            DMK_TRY(send(ctx, e, &sector, &w));
        }
    }
done:
    return rc;
}

static int radiate_bend(dmk_context *ctx, engine *e, int32_t v)
{
    double total = e->g->star.total[v], back = back_of(e, v);
    if (!e->g->star.border[v]) {
        return radiate_wedge(ctx, e, v, fmod(back + pi, total),
                             fmod(back + pi, total) + total - 2 * pi);
    }
    int rc = DMK_OK;
    if (back - pi > -straight) rc = radiate_wedge(ctx, e, v, -straight, back - pi);
    if (rc == DMK_OK && back + pi < total + straight)
        rc = radiate_wedge(ctx, e, v, back + pi, total + straight);
    return rc;
}

/* ---- arrivals -------------------------------------------------------------------------------- */

/* Source and direction come from the first bend of the path. */
static void arrive(const engine *e, int32_t v)
{
    const dmk_trace *t = e->trace + v;
    dmk_arrival *a = e->g->arrival + v;
    *a = (dmk_arrival){0, 0, -1, -1};
    if (t->half == DMK_UNREACHED) return;
    a->back = back_of(e, v);
    a->pseudo_source = t->root >= 0 ? t->root : -1;
    while (t->root >= 0)
        t = e->trace + t->root;
    a->source = ~t->root;
    const dmk_site *p = e->g->source + a->source;
    double direction = t->half >= 0 ? t->turn + atan2(t->y, t->x) : t->x;
    if (p->vertex >= 0 && e->g->star.border[p->vertex]) {
        a->direction = fmin(fmax(direction, 0), p->total);
    } else {
        direction -= p->total * floor(direction / p->total);
        a->direction = direction < p->total ? direction : 0;
    }
}

static void arrive_range(int32_t begin, int32_t end, void *data)
{
    for (int32_t v = begin; v < end; v++)
        arrive(data, v);
}

int dmk_windows_run(dmk_context *ctx, dmk_geodesics *g)
{
    int rc;
    engine e;
    DMK_TRY(engine_create(ctx, g, &e));
    DMK_TRY(bound(ctx, &e));
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < g->n_sources; i++)
        DMK_TRY(radiate_source(ctx, &e, i));
    for (;;) {
        DMK_TRY(run_down(ctx, &e));
        while (e.bends.n > 0 && e.bends.at[0].key > e.d[e.bends.at[0].item])
            dmk_heap_pop(&e.bends);
        if (e.bends.n == 0) break;
        DMK_TRY(radiate_bend(ctx, &e, dmk_heap_pop(&e.bends).item));
    }
    dmk_parallel(ctx, g->mesh->n_vertices, arrive_range, &e);
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        g->distance[v] =
            e.trace[v].half == DMK_UNREACHED ? INFINITY : g->distance[v] * g->star.unit;
    }
    g->n_windows = e.n_made;
done:
    engine_free(&e);
    return rc;
}
