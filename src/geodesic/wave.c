/* Distances by merged windows: nearly linear time, within a tolerance; exact with tolerance 0: from lines, and on
 * meshes where windows depth first are too many.
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
#include "geodesic/front.h"
#include "geodesic/heap.h"

#include "base/crew.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A bucket, in mean edges: wider ones cost visits of half-edges, narrower ones empty buckets. */
static const double bucket_width = 0.1;
/* Rounding, over the length of the edge, of comparisons with ways over vertices. */
static const double rounding = 1e-9;

/* What the tolerance allows; lengths over the edge's. */
typedef struct allowance {
    double error; /* of the distance, over the distance */
    double step;  /* jump of the distance where a gap between neighbours is closed */
    double slope; /* change of the slope at a merged window's ends: more leaves gaps behind */
} allowance;
/* The tolerance of exact runs: what is left of rounding after ten thousand steps. Windows that flat vertices have
 * parted are one again, or tubes and ellipsoids of 1 : 10,000 would have hundreds for each edge. */
static const double exact_tolerance = 1e-11;
/* At least: the front's curvature times the edge, so that it focuses 20 edges ahead at least. */
static const double least_curvature = -0.05;
/* A gap's jump, over the tolerance and the length of the edge. Larger jumps let the rays of one face run on into the
 * next: without a bound distances on CAD parts are off by 7e-4. */
static const double most_jump = 30;

typedef struct wave {
    double lo, hi, o, ux, uy, k, D;
    double direction,
        turn; /* at the source: direction + turn * psi, psi the angle of the front seen from o */
    double error;
    int32_t half, next; /* next in the half-edge's list, or in the list of free ones */
    int32_t source, root;
} wave;

typedef struct mark {
    double direction, x, y,
        at;       /* (x, y): the ray at the vertex in the frame of c-a; at: where it crosses */
    int32_t half; /* STRAIGHT: x is the direction back; UNREACHED */
    int32_t source, root;
} mark;
enum { UNREACHED = -2, STRAIGHT = -1 };

/* Half-edges of a bucket, in their order, so many together that a chain of them costs few cache misses. */
enum { BLOCK = 30 };
typedef struct block {
    int32_t half[BLOCK], n, next; /* next: of the bucket, or of the free blocks; -1: none */
} block;

typedef struct bucket {
    int32_t first, last; /* blocks, -1: none */
} bucket;

/* What a visit sends to the next half-edges: see `worker`. */
typedef struct child {
    wave wave;
    double key;
} child;

typedef struct hit {
    mark mark;
    double d, error;
    int32_t vertex;
} hit;

typedef struct chain { /* of windows in the pool */
    int32_t first, last;
} chain;

/* Half-edges of a bucket are visited in chunks, on all threads. Visits read the state as it was when the round began,
 * and what they find is entered when all have ended, in the order of the half-edges: the result does not depend on the
 * threads. */
enum { CHUNK = 32 }; /* half-edges; speed only: 16 takes the same time */

typedef struct counts {
    size_t spent, child, hit, kept;
} counts;

/* What one thread finds in its chunks of a round. */
typedef struct worker {
    dmk_context own;
    int rc;
    wave *list, *merged; /* of the half-edge that is visited */
    size_t list_room, merged_room;
    chain *spent; /* windows to give back */
    child *child;
    hit *hit;
    wave *kept;
    counts n, room;
    int64_t n_looks;
    bool keeps; /* a half-edge wants to keep windows */
} worker;

/* Where a chunk's finds lie. */
typedef struct finds {
    int member;
    counts from, to;
} finds;

typedef struct engine {
    dmk_front front;
    allowance allow;
    double *error;    /* n_vertices */
    mark *mark;       /* n_vertices */
    double *radiated; /* n_vertices: at this distance */
    int32_t *head;    /* of each half-edge: its windows */
    int32_t *kept;    /* of each half-edge: windows that have run on; NULL while none keeps them */
    uint8_t *visits;  /* of each half-edge, up to `often` */
    wave *pool;
    size_t n_pool, pool_room;
    int32_t free;
    block *block;
    size_t n_blocks, block_room;
    int32_t free_block;
    bucket *bucket;
    size_t n_buckets, bucket_room, current;
    double width, least;
    size_t most_buckets; /* the last one has the rest, far behind other sources' offsets */
    dmk_heap pseudo_sources;
    int32_t *taken; /* half-edges of the bucket */
    size_t n_taken, taken_room;
    finds *finds; /* of each chunk of them */
    size_t finds_room;
    worker *worker;
    dmk_crew crew;
    int64_t n_made, n_looks;
    double closed; /* angle around the source if it is one point inside: directions are mod that;
                      else 0 */
} engine;

/* Around a needle or a thin tube windows come back to a half-edge again and again, each hardly longer than the one
 * before, and no vertex is near enough to show that they are of no use. From so many visits on, a half-edge keeps
 * what has run on from it, for the lower envelope. Other half-edges are visited some four times. */
enum { often = 32 };
/* Looks at windows at most, over half-edges: meshes of all kinds need 35 and less, from borders or with a tolerance of
 * 1e-9, too. On spikes a billion times as high as wide, ways that wind around them differ less than what rounding
 * leaves, and there is no end. Small meshes may need some more. */
enum { most_looks = 1000, always = 5000000 };
/* What is kept has this in `next` while it is in the list of the half-edge that is visited. */
enum { KEPT = -2 };

/* ---- waves ----------------------------------------------------------------------------------- */

static inline double value(const wave *w, double t)
{
    double d = t - w->o, q = w->k * d + w->ux;
    return w->D + d * (2 * w->ux + w->k * d) / (1 + sqrt(q * q + w->uy * w->uy));
}

static inline double slope(const wave *w, double t)
{
    double q = w->k * (t - w->o) + w->ux;
    return q / sqrt(q * q + w->uy * w->uy);
}

/* Angle at the centre of the front, over its curvature, of the ray through what lies at xi along,
 * eta across the ray at o. */
static inline double psi(double k, double xi, double eta)
{
    double t = eta / (1 + k * xi), z2 = k * t * k * t;
    if (z2 < 1e-4) return t * (1 - z2 * (1. / 3 - z2 * (0.2 - z2 / 7)));
    return atan2(k * eta, 1 + k * xi) / k;
}

static double direction_at(const wave *w, double t)
{
    return w->direction + w->turn * psi(w->k, w->ux * (t - w->o), -w->uy * (t - w->o));
}

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
    e->allow = (allowance){tolerance, most_jump * tolerance, sqrt(tolerance)};
    e->free = e->free_block = -1;
    DMK_TRY(dmk_front_create(ctx, g, &e->front));
    DMK_TRY(DMK_NEW(ctx, e->error, n));
    DMK_TRY(DMK_NEW(ctx, e->mark, n));
    DMK_TRY(DMK_NEW(ctx, e->radiated, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, e->head, n_half));
    DMK_TRY(DMK_NEW(ctx, e->visits, n_half));
    DMK_TRY(DMK_NEW(ctx, e->worker, DMK_MOST_CREW));
    for (int i = 0; i < DMK_MOST_CREW; i++) dmk_context_lend(ctx, &e->worker[i].own);
    dmk_parallel(ctx, g->mesh->n_vertices, clear_range, e);
    dmk_parallel(ctx, 3 * g->mesh->n_triangles, clear_halves, e);
    e->width = bucket_width * g->mesh->info.mean_edge / g->star.unit;
    e->most_buckets =
        (size_t)(g->mesh->n_edges / bucket_width); /* no way is longer than all edges */
    e->least = INFINITY;
    for (int32_t i = 0; i < g->n_sources; i++)
        e->least = dmk_min(e->least, g->source[i].offset / g->star.unit);
    if (g->n_lines > 0) e->least = 0;
    const dmk_site *one = g->source;
    if (g->n_sources == 1 && !(one->vertex >= 0 && g->star.border[one->vertex]))
        e->closed = one->total;
done:
    return rc;
}

static void worker_free(worker *w)
{
    free(w->list);
    free(w->merged);
    free(w->spent);
    free(w->child);
    free(w->hit);
    free(w->kept);
}

static void engine_free(engine *e)
{
    dmk_front_free(&e->front);
    dmk_heap_free(&e->pseudo_sources);
    free(e->error);
    free(e->mark);
    free(e->radiated);
    free(e->head);
    free(e->kept);
    free(e->visits);
    free(e->pool);
    free(e->block);
    free(e->bucket);
    free(e->taken);
    free(e->finds);
    for (int i = 0; e->worker && i < DMK_MOST_CREW; i++) worker_free(e->worker + i);
    free(e->worker);
}

/* ---- the queue ------------------------------------------------------------------------------- */

/* An empty block at the end of a bucket. */
static int add_block(dmk_context *ctx, engine *e, bucket *b)
{
    int32_t i = e->free_block;
    if (i >= 0) {
        e->free_block = e->block[i].next;
    } else {
        if (e->n_blocks == e->block_room) {
            int rc = DMK_GROW(ctx, e->block, e->n_blocks + 1, e->block_room);
            if (rc != DMK_OK) return rc;
        }
        i = (int32_t)e->n_blocks++;
    }
    e->block[i].n = 0;
    e->block[i].next = -1;
    if (b->first < 0)
        b->first = i;
    else
        e->block[b->last].next = i;
    b->last = i;
    return DMK_OK;
}

static int schedule(dmk_context *ctx, engine *e, int32_t half, double key)
{
    double index = (key - e->least) / e->width;
    size_t i = index > 0 ? (size_t)dmk_min(index, (double)e->most_buckets) : 0;
    if (i < e->current) i = e->current;
    if (i >= e->bucket_room) {
        int rc = DMK_GROW(ctx, e->bucket, i + 1, e->bucket_room);
        if (rc != DMK_OK) return rc;
    }
    for (; e->n_buckets <= i; e->n_buckets++) e->bucket[e->n_buckets] = (bucket){-1, -1};
    bucket *b = e->bucket + i;
    if (b->last < 0 || e->block[b->last].n == BLOCK) {
        int rc = add_block(ctx, e, b);
        if (rc != DMK_OK) return rc;
    }
    block *k = e->block + b->last;
    k->half[k->n++] = half;
    return DMK_OK;
}

/* A copy of the window at the head of a list. */
static int store(dmk_context *ctx, engine *e, const wave *w, int32_t *head)
{
    int32_t i = e->free;
    if (i >= 0) {
        e->free = e->pool[i].next;
    } else {
        if (e->n_pool == e->pool_room) {
            int rc = DMK_GROW(ctx, e->pool, e->n_pool + 1, e->pool_room);
            if (rc != DMK_OK) return rc;
        }
        i = (int32_t)e->n_pool++;
    }
    e->pool[i] = *w;
    e->pool[i].next = *head;
    *head = i;
    return DMK_OK;
}

/* When a half-edge of this length, whose ends are reached by `most`, is to be visited for this window. */
static double key_of(const wave *w, double length, double most)
{
    return dmk_min(dmk_max(value(w, 0), value(w, length)), most);
}

/* A window of its half-edge. */
static int put(dmk_context *ctx, engine *e, const wave *w, double key)
{
    const bool waits = e->head[w->half] >= 0;
    int rc = store(ctx, e, w, e->head + w->half);
    e->n_made++;
    return rc != DMK_OK || waits ? rc : schedule(ctx, e, w->half, key);
}

/* All values are lengths of paths up to their error, so the best estimate of any of them counts. Whether this one is
 * the shortest. */
static inline bool improve(double *known, double *error, double d, double its_error, double excess)
{
    if (!(d < *known)) {
        *error = dmk_min(*error, its_error + excess + d - *known);
        return false;
    }
    if (*known < INFINITY) excess = dmk_min(excess, *error + *known - d);
    *known = d;
    *error = its_error + excess;
    return true;
}

static int reach(dmk_context *ctx, engine *e, int32_t v, double d, const mark *m, double error)
{
    if (!improve(e->front.d + v, e->error + v, d, error, 0)) return DMK_OK;
    e->mark[v] = *m;
    return e->front.pseudo_source[v] ? dmk_heap_push(ctx, &e->pseudo_sources, d, v) : DMK_OK;
}

/* ---- one step -------------------------------------------------------------------------------- */

typedef struct angle {
    double length, left, right;
    double ca, sa, cb, sb, cx, cy, at;
    int32_t a, b, c, through_left, through_right;
    double d_a, d_b, d_c,
        error; /* what is known of the vertices, with the finds of this visit; error: of c */
    const mark *known; /* of c */
    mark mark;
    bool reached; /* c has another value now */
} angle;

static inline void look(const engine *e, int32_t half, angle *s)
{
    const dmk_facet *f = e->front.facet + half / 3;
    int k = half % 3, k1 = k == 2 ? 0 : k + 1, k2 = k == 0 ? 2 : k - 1;
    s->length = f->length[k], s->left = f->length[k2], s->right = f->length[k1];
    s->ca = f->cosine[k1], s->sa = f->sine[k1], s->cb = f->cosine[k2], s->sb = f->sine[k2];
    s->cx = s->left * s->ca, s->cy = s->left * s->sa;
    s->a = f->vertex[k1], s->b = f->vertex[k2], s->c = f->vertex[k];
    s->through_left = f->twin[k2], s->through_right = f->twin[k1];
    s->d_a = e->front.d[s->a], s->d_b = e->front.d[s->b], s->d_c = e->front.d[s->c];
    s->error = e->error[s->c], s->known = e->mark + s->c;
    s->reached = false;
}

/* The wave seen from the edge through (px, py) along (ex, ey), on lo..hi of it. */
static inline bool carry(const wave *w, double px, double py, double ex, double ey, double lo,
                         double hi, wave *c)
{
    double o = 0.5 * (lo + hi), dx = px + o * ex - w->o, dy = py + o * ey;
    double qx = w->k * dx + w->ux, qy = w->k * dy + w->uy, n = sqrt(qx * qx + qy * qy), i = 1 / n;
    double xi = w->ux * dx + w->uy * dy, eta = w->ux * dy - w->uy * dx;
    c->lo = lo, c->hi = hi, c->o = o;
    c->error = w->error;
    c->source = w->source, c->root = w->root;
    c->D = w->D + (2 * xi + w->k * (dx * dx + dy * dy)) / (1 + n);
    c->k = w->k * i;
    c->ux = (qx * ex + qy * ey) * i, c->uy = (qy * ex - qx * ey) * i;
    c->turn = w->turn * i;
    c->direction = w->turn != 0 ? w->direction + w->turn * psi(w->k, xi, eta) : w->direction;
    return c->uy > 0 && (w->k >= 0 || 1 + w->k * xi > 0);
}

static int add_child(worker *me, const wave *w, double key)
{
    int rc = DMK_GROW(&me->own, me->child, me->n.child + 1, me->room.child);
    if (rc == DMK_OK) me->child[me->n.child++] = (child){*w, key};
    return rc;
}

static int step_left(worker *me, const wave *w, const angle *s, double last)
{
    wave c;
    const double eps = DMK_SAME_LENGTH + rounding * s->length;
    if (s->through_left < 0) return DMK_OK;
    double lo = w->uy * w->lo / (w->uy * s->ca - s->sa * (w->ux + w->k * (w->lo - w->o)));
    double hi = last >= s->at
                    ? s->left
                    : w->uy * last / (w->uy * s->ca - s->sa * (w->ux + w->k * (last - w->o)));
    if (hi > s->left || !(hi >= 0)) hi = s->left;
    if (!(lo >= 0)) lo = 0;
    if (!(hi - lo > DMK_NO_WIDTH * s->left) || !carry(w, 0, 0, s->ca, s->sa, lo, hi, &c))
        return DMK_OK;
    double at_lo = value(&c, lo), at_hi = value(&c, hi), late = at_lo - s->d_b - eps;
    if (s->d_c + (s->left - lo) + eps <= at_lo || s->d_a + hi + eps <= at_hi) return DMK_OK;
    double bx = s->length * s->ca - lo, by = s->length * s->sa;
    if (late > 0 && late * late > bx * bx + by * by) return DMK_OK;
    c.half = s->through_left;
    return add_child(me, &c,
                     dmk_min(dmk_max(at_lo + lo, at_hi + (s->left - hi)), dmk_max(s->d_a, s->d_c)));
}

static int step_right(worker *me, const wave *w, const angle *s, double first)
{
    wave c;
    const double eps = DMK_SAME_LENGTH + rounding * s->length;
    if (s->through_right < 0) return DMK_OK;
    double lo = first <= s->at ? s->right
                               : w->uy * (s->length - first) /
                                     (w->uy * s->cb + s->sb * (w->ux + w->k * (first - w->o)));
    double hi =
        w->uy * (s->length - w->hi) / (w->uy * s->cb + s->sb * (w->ux + w->k * (w->hi - w->o)));
    if (lo > s->right || !(lo >= 0)) lo = s->right;
    if (!(hi >= 0)) hi = 0;
    lo = s->right - lo, hi = s->right - hi; /* both were from b */
    if (!(hi - lo > DMK_NO_WIDTH * s->right) || !carry(w, s->cx, s->cy, s->cb, -s->sb, lo, hi, &c))
        return DMK_OK;
    double at_lo = value(&c, lo), at_hi = value(&c, hi), late = at_hi - s->d_a - eps;
    if (s->d_b + (s->right - lo) + eps <= at_lo || s->d_c + hi + eps <= at_hi) return DMK_OK;
    double ax = -s->cx * s->cb + s->cy * s->sb - hi, ay = -s->cy * s->cb - s->cx * s->sb;
    if (late > 0 && late * late > ax * ax + ay * ay) return DMK_OK;
    c.half = s->through_right;
    return add_child(
        me, &c, dmk_min(dmk_max(at_lo + lo, at_hi + (s->right - hi)), dmk_max(s->d_b, s->d_c)));
}

/* The vertex above by the ray through t of the edge: s->at, or the nearer end of the interval. */
static void reach_above(const wave *w, angle *s, double t)
{
    bool direct = t == s->at;
    double ax = s->cx - w->o, dx = direct ? ax : t - w->o, dy = direct ? s->cy : 0, excess = 0;
    double qx = w->k * dx + w->ux, qy = w->k * dy + w->uy, n = sqrt(qx * qx + qy * qy);
    double xi = w->ux * dx + w->uy * dy, d = w->D + (2 * xi + w->k * (dx * dx + dy * dy)) / (1 + n);
    double bx = direct ? qx : s->cx - t, by = direct ? qy : s->cy;
    if (!direct) d += sqrt(bx * bx + by * by);
    if (!(d < s->d_c || w->error + d - s->d_c < s->error)) return;
    if (!direct) {
        double px = w->k * ax + w->ux, py = w->k * s->cy + w->uy;
        excess = d - (w->D + (2 * (w->ux * ax + w->uy * s->cy) + w->k * (ax * ax + s->cy * s->cy)) /
                                 (1 + sqrt(px * px + py * py)));
    }
    const mark m = {w->direction +
                        (w->turn != 0 ? w->turn * psi(w->k, xi, w->ux * dy - w->uy * dx) : 0),
                    s->cx * bx + s->cy * by,
                    s->cx * by - s->cy * bx,
                    direct ? t : HUGE_VAL,
                    w->half,
                    w->source,
                    w->root};
    if (improve(&s->d_c, &s->error, d, w->error, excess)) {
        s->mark = m;
        s->known = &s->mark;
    }
    s->reached = true;
}

static int step(worker *me, const wave *w, angle *s)
{
    const double slack = DMK_SAME_PLACE * s->length, den = w->k * s->cy + w->uy;
    const double eps = DMK_SAME_LENGTH + rounding * s->length;
    int rc = DMK_OK;
    if (!(den > 0)) return rc; /* the rays meet before */
    s->at = ((w->o * w->k - w->ux) * s->cy + s->cx * w->uy) / den;
    bool left = w->lo<s->at, right = w->hi> s->at;
    double last = w->hi, first = w->lo, t = dmk_min(dmk_max(s->at, w->lo), w->hi);
    const double before = s->d_c;
    reach_above(w, s, t);
    const mark *m = s->known;
    if (t == s->at && s->d_c == before && m->half == w->half && m->at < HUGE_VAL) {
        double dx = s->cx - w->o, qx = w->k * dx + w->ux, qy = w->k * s->cy + w->uy;
        double d = w->D + (2 * (w->ux * dx + w->uy * s->cy) + w->k * (dx * dx + s->cy * s->cy)) /
                              (1 + sqrt(qx * qx + qy * qy));
        if (d > before + eps && s->at < m->at - slack)
            right = false; /* one angle, one split */
        else if (d > before + eps && s->at > m->at + slack)
            left = false;
    }
    if (s->at >= w->lo - slack && s->at <= w->hi + slack) {
        if (left) last = s->at;
        if (right) first = s->at;
    }
    if (left) rc = step_left(me, w, s, last);
    if (rc == DMK_OK && right) rc = step_right(me, w, s, first);
    return rc;
}

/* ---- the windows of a half-edge -------------------------------------------------------------- */

/* How much longer u is than w at t; of equally long ones that counts as shorter which is kept. */
static double longer(const wave *u, const wave *w, double t)
{
    return value(u, t) - value(w, t) + ((w->next == KEPT) - (u->next == KEPT)) * DMK_SAME_LENGTH;
}

/* Two windows, u before w, that overlap on a..b, where their difference changes its sign: the
 * place. */
static double crossing(const engine *e, const wave *u, const wave *w, double a, double b,
                       double length)
{
    double fa = longer(u, w, a), fb = longer(u, w, b), t = a;
    const double zero = dmk_max(1e-15 * w->D, 1e-2 * e->allow.error * length);
    for (int i = 0; i < 60 && b - a > DMK_NO_WIDTH * length;
         i++) { /* secants, each third time halves */
        t = i % 3 == 2 ? 0.5 * (a + b) : a + (b - a) * fa / (fa - fb);
        double f = longer(u, w, t);
        if (fabs(f) < zero) break;
        if ((f < 0) == (fa < 0))
            a = t, fa = f;
        else
            b = t, fb = f;
    }
    return t;
}

static void close_gap(const engine *e, wave *u, wave *w, double length)
{
    double g = w->lo - u->hi, middle = 0.5 * (w->lo + u->hi);
    if (!(g > 0)) return;
    double jump = fabs(value(u, middle) - value(w, middle)) +
                  0.5 * g * fabs(slope(u, middle) - slope(w, middle));
    if (jump > e->allow.step * length) return;
    u->hi = w->lo = middle;
    u->error += jump;
    w->error += jump;
}

/* Of u and w behind it the lower parts. False: w is of no use. *again: u was of none, look at the
 * one before. */
static bool trim_two(const engine *e, wave *u, wave *w, double length, bool *again)
{
    double a = w->lo, b = dmk_min(u->hi, w->hi);
    *again = false;
    if (b <= a) {
        close_gap(e, u, w, length);
        return true;
    }
    double fa = longer(u, w, a), fb = longer(u, w, b);
    if (fa <= 0 && fb <= 0) {
        if (w->hi <= u->hi) return false;
        w->lo = b;
    } else if (fa >= 0 && fb >= 0) {
        if (w->hi < u->hi) return true;
        u->hi = a;
        *again = u->hi - u->lo <= DMK_NO_WIDTH * length;
    } else {
        double t = crossing(e, u, w, a, b, length);
        if (fa < 0) {
            if (w->hi >= u->hi) u->hi = t;
            w->lo = t;
        } else if (w->hi <= u->hi) {
            w->hi = t;
        }
    }
    return true;
}

/* The lower envelope of neighbours in the list, sorted by lo. How many are left. */
static size_t trim(const engine *e, wave *l, size_t n, double length)
{
    size_t k = 0; /* l[0..k] are done */
    for (size_t i = 1; i < n; i++) {
        wave w = l[i];
        bool again = true, useful = true;
        while (again) {
            useful = trim_two(e, l + k, &w, length, &again);
            if (!again) break;
            if (k > 0) {
                k--;
            } else {
                l[0] = w;
                useful = again = false;
            }
        }
        if (useful && w.hi - w.lo > DMK_NO_WIDTH * length) l[++k] = w;
    }
    return k + 1;
}

/* The wave through the values of a run of windows at both ends and in the middle. False if there is
 * none. */
static bool interpolate(const wave *r, size_t n, double length, wave *o)
{
    const wave *last = r + n - 1;
    double a = r->lo, c = last->hi, middle = 0.5 * (a + c), half = 0.5 * (c - a);
    size_t j = 0;
    while (j + 1 < n && r[j].hi < middle) j++;
    double d = value(r + j, middle), al = value(r, a) - d, ga = value(last, c) - d;
    double q = 2 * half * half - al * al - ga * ga;
    if (!(q > 0)) return false;
    double k = 2 * (al + ga) / q, ux = (2 * (ga - al) + k * (ga * ga - al * al)) / (4 * half);
    if (!(fabs(ux) < 1) || k * length < least_curvature) return false;
    *o =
        (wave){a, c, middle, ux, sqrt(1 - ux * ux), k, d, 0, 0, 0, r->half, -1, r->source, r->root};
    return true;
}

/* Largest change of the values where windows meet and in their middles, and a fifth for what lies between: without it
 * neighbours on a disc of needles differ by 9e-5 more than their edge is long. */
static const double beyond_samples = 1.2;

static double change(const wave *r, size_t n, wave *o)
{
    double most = 0;
    for (size_t i = 0; i < n; i++) {
        double middle = 0.5 * (r[i].lo + r[i].hi);
        o->error = dmk_max(o->error, r[i].error);
        if (r[i].root != o->root) o->root = -1;
        most = dmk_max(most, fabs(value(o, middle) - value(r + i, middle)));
        if (i > 0) most = dmk_max(most, fabs(value(o, r[i].lo) - value(r + i, r[i].lo)));
        if (i + 1 < n) most = dmk_max(most, fabs(value(o, r[i].hi) - value(r + i, r[i].hi)));
    }
    return beyond_samples * most;
}

/* One wave for the n touching windows r, if that changes little. */
static bool merge(const engine *e, const wave *r, size_t n, double length, wave *o)
{
    const wave *last = r + n - 1;
    if (last->source != r->source || !interpolate(r, n, length, o)) return false;
    double off = change(r, n, o), a = o->lo, c = o->hi;
    o->error += off;
    if (o->error > e->allow.error * o->D) return false;
    if (fabs(slope(o, a) - slope(r, a)) > e->allow.slope) return false;
    if (fabs(slope(o, c) - slope(last, c)) > e->allow.slope) return false;
    double from = direction_at(r, a), to = direction_at(last, c);
    if (e->closed > 0) to -= e->closed * round((to - from) / e->closed);
    double p = psi(o->k, o->ux * (a - o->o), -o->uy * (a - o->o)),
           q = psi(o->k, o->ux * (c - o->o), -o->uy * (c - o->o));
    o->turn = (to - from) / (q - p);
    o->direction = from - o->turn * p;
    return true;
}

/* Merge runs of the n windows l into `merged`. How many there are then. */
static size_t merge_all(const engine *e, const wave *l, size_t n, double length, wave *merged)
{
    size_t out = 0;
    for (size_t i = 0, j; i < n; i = j) {
        wave best = l[i], t;
        for (j = i + 1; j < n && fabs(l[j].lo - l[j - 1].hi) < rounding * length; j++) {
            if (!merge(e, l + i, j - i + 1, length, &t)) break;
            best = t;
        }
        merged[out++] = best;
    }
    return out;
}

/* By place; at the same one what is kept comes first, for what has run on again may be the same. */
static bool comes_before(const wave *a, const wave *b)
{
    return a->lo < b->lo || (a->lo == b->lo && a->next == KEPT && b->next != KEPT);
}

/* Shell's sort: mostly there are a few, around needles hundreds. */
static void sort(wave *l, size_t n)
{
    for (size_t step = n / 2; step > 0; step /= 2) {
        for (size_t i = step; i < n; i++) {
            wave w = l[i];
            size_t j = i;
            for (; j >= step && comes_before(&w, l + j - step); j -= step) l[j] = l[j - step];
            l[j] = w;
        }
    }
}

/* Take the windows of one of a half-edge's lists that are still of use into the worker's. */
static int gather(worker *me, const engine *e, int32_t *head, bool kept, const angle *s, size_t *n)
{
    int rc = DMK_OK;
    const double eps = DMK_SAME_LENGTH + rounding * s->length, at_a = s->d_a + eps;
    const double at_b = s->d_b + s->length + eps;
    chain all = {*head, -1};
    for (int32_t i = *head; i >= 0; i = e->pool[i].next) {
        const wave *w = e->pool + i;
        all.last = i;
        if (at_b - w->lo < value(w, w->lo) || at_a + w->hi < value(w, w->hi)) continue;
        DMK_TRY(DMK_GROW(&me->own, me->list, *n + 1, me->list_room));
        me->list[*n] = *w;
        me->list[(*n)++].next = kept ? KEPT : -1;
    }
    if (all.first < 0) goto done;
    DMK_TRY(DMK_GROW(&me->own, me->spent, me->n.spent + 1, me->room.spent));
    me->spent[me->n.spent++] = all;
    *head = -1;
done:
    return rc;
}

/* One more visit: whether the half-edge keeps its windows now. */
static bool keeps(worker *me, const engine *e, int32_t half)
{
    if (e->visits[half] < often) e->visits[half]++;
    if (e->visits[half] < often) return false;
    me->keeps = true;
    return e->kept != NULL;
}

static int visit(worker *me, const engine *e, int32_t half)
{
    int rc;
    size_t n = 0;
    angle s;
    const bool keep = keeps(me, e, half);
    look(e, half, &s);
    DMK_TRY(gather(me, e, e->head + half, false, &s, &n));
    if (keep) DMK_TRY(gather(me, e, e->kept + half, true, &s, &n));
    const wave *l = me->list;
    me->n_looks += (int64_t)n;
    if (n > 1) {
        sort(me->list, n);
        n = trim(e, me->list, n, s.length);
        DMK_TRY(DMK_GROW(&me->own, me->merged, n, me->merged_room));
        n = merge_all(e, me->list, n, s.length, me->merged);
        l = me->merged;
    }
    for (size_t i = 0; i < n; i++) {
        if (keep) {
            DMK_TRY(DMK_GROW(&me->own, me->kept, me->n.kept + 1, me->room.kept));
            me->kept[me->n.kept++] = l[i];
        }
        if (l[i].next != KEPT) DMK_TRY(step(me, l + i, &s));
    }
    if (!s.reached) goto done;
    DMK_TRY(DMK_GROW(&me->own, me->hit, me->n.hit + 1, me->room.hit));
    me->hit[me->n.hit++] = (hit){*s.known, s.d_c, s.error, s.c};
done:
    return rc;
}

/* ---- sources and pseudo-sources ------------------------------------------------------------------ */

typedef struct rays {
    double base, lo, hi, direction, error;
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
        DMK_TRY(reach(ctx, e, end.vertex, a->base + end.length, &m, a->error));
    }
    if (!dmk_front_beam(&e->front, c, a->lo, a->hi, &b)) goto done;
    double o = 0.5 * (b.lo + b.hi), x = o - b.x, r = hypot(x, b.y);
    const dmk_facet *f = e->front.facet + b.half / 3;
    int k = b.half % 3;
    wave w = {b.lo,         b.hi, o,        x / r,  -b.y / r, 1 / r,     a->base + r,
              a->direction, 0,    a->error, b.half, -1,       a->source, a->root};
    if (own) w.direction = b.turn + atan2(-b.y, x), w.turn = w.k;
    const double most =
        dmk_max(e->front.d[f->vertex[(k + 1) % 3]], e->front.d[f->vertex[(k + 2) % 3]]);
    rc = put(ctx, e, &w, key_of(&w, f->length[k], most));
done:
    return rc;
}

static int radiate_source(dmk_context *ctx, engine *e, int32_t number)
{
    int rc = DMK_OK;
    const dmk_site *p = e->front.g->source + number;
    rays a = {p->offset / e->front.g->star.unit, -1, p->total + 1, 0, 0, number, -1, 2};
    if (p->vertex >= 0) {
        mark m = {0, 0, 0, HUGE_VAL, STRAIGHT, number, -1};
        if (a.base >= e->front.d[p->vertex]) return DMK_OK;
        e->radiated[p->vertex] = a.base;
        DMK_TRY(reach(ctx, e, p->vertex, a.base, &m, 0));
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
    double back = m->half == STRAIGHT ? m->x : s->angle[m->half] + atan2(m->y, m->x);
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
        rays a = {e->front.d[v], range[i][0], range[i][1], m->direction,
                  e->error[v],   m->source,   v,           s->border[v] ? 2 : 1};
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
        rays a = {0, -1, g->star.total[v] + 1, 0, 0, g->n_sources, -1, 2};
        mark m = {0, 0, 0, HUGE_VAL, STRAIGHT, g->n_sources, -1};
        if (e->radiated[v] == 0) continue;
        e->radiated[v] = 0;
        DMK_TRY(reach(ctx, e, v, 0, &m, 0));
        DMK_TRY(radiate_star(ctx, e, v, &a, 0));
    }
    rc = put(ctx, e, &(wave){0, length, length / 2, 0, 1, 0, 0, 0, 0, 0, h, -1, g->n_sources, -1},
             0);
done:
    return rc;
}

/* ---- the run --------------------------------------------------------------------------------- */

/* The half-edges of the current bucket, as they are now, into e->taken. */
static int take_bucket(dmk_context *ctx, engine *e)
{
    size_t *n = &e->n_taken;
    *n = 0;
    if (e->current >= e->n_buckets) return DMK_OK;
    bucket *b = e->bucket + e->current;
    for (int32_t i = b->first, next; i >= 0; i = next) {
        block *k = e->block + i;
        if (*n + BLOCK > e->taken_room) {
            int rc = DMK_GROW(ctx, e->taken, *n + BLOCK, e->taken_room);
            if (rc != DMK_OK) return rc;
        }
        for (int32_t j = 0; j < k->n; j++) e->taken[(*n)++] = k->half[j];
        next = k->next;
        k->next = e->free_block;
        e->free_block = i;
    }
    *b = (bucket){-1, -1};
    return DMK_OK;
}

/* Visits are mostly waits for memory: what the visits to come will read is fetched in two steps, as where the second
 * part lies is in the first. In line by all means: gcc takes a function that does nothing but this for one without
 * effect, and its calls away. */
enum { FAR = 8, NEAR = 4 }; /* visits ahead; speed only */
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

static inline __attribute__((always_inline)) void fetch_rest(const engine *e, int32_t half)
{
    const dmk_facet *f = e->front.facet + half / 3;
    if (e->head[half] >= 0) fetch_two(e->pool + e->head[half]);
    for (int32_t k = 0; k < 3; k++) __builtin_prefetch(e->front.d + f->vertex[k]);
    __builtin_prefetch(e->mark + f->vertex[half % 3]);
    __builtin_prefetch(e->error + f->vertex[half % 3]);
    for (int32_t k = 1; k < 3; k++) {
        const int32_t twin = f->twin[(half + k) % 3];
        if (twin >= 0) __builtin_prefetch(e->head + twin);
    }
}

static size_t chunk_end(const engine *e, int32_t k)
{
    const size_t end = (size_t)(k + 1) * CHUNK;
    return end < e->n_taken ? end : e->n_taken;
}

/* Visit the half-edges of a chunk. */
static void visit_chunk(int32_t k, int member, void *data)
{
    const engine *e = data;
    worker *me = e->worker + member;
    finds *f = e->finds + k;
    const size_t begin = (size_t)k * CHUNK, end = chunk_end(e, k);
    *f = (finds){.member = member, .from = me->n};
    for (size_t i = begin; i < end && i < begin + NEAR; i++) fetch_rest(e, e->taken[i]);
    for (size_t i = begin; i < end && me->rc == DMK_OK; i++) {
        if (i + FAR < e->n_taken) fetch_half(e, e->taken[i + FAR]);
        if (i + NEAR < end) fetch_rest(e, e->taken[i + NEAR]); /* others' are being taken */
        me->rc = visit(me, e, e->taken[i]);
    }
    f->to = me->n;
}

/* What the visits of a chunk have found. */
static int enter(dmk_context *ctx, engine *e, const finds *f)
{
    int rc = DMK_OK;
    const worker *w = e->worker + f->member;
    for (size_t i = f->from.spent; i < f->to.spent; i++) {
        e->pool[w->spent[i].last].next = e->free;
        e->free = w->spent[i].first;
    }
    for (size_t i = f->from.hit; i < f->to.hit; i++) {
        const hit *h = w->hit + i;
        DMK_TRY(reach(ctx, e, h->vertex, h->d, &h->mark, h->error));
    }
    for (size_t i = f->from.kept; i < f->to.kept; i++)
        DMK_TRY(store(ctx, e, w->kept + i, e->kept + w->kept[i].half));
    for (size_t i = f->from.child; i < f->to.child; i++)
        DMK_TRY(put(ctx, e, &w->child[i].wave, w->child[i].key));
done:
    return rc;
}

/* Visit all half-edges that are taken. */
static int visit_all(dmk_context *ctx, engine *e)
{
    int rc;
    const size_t n_chunks = (e->n_taken + CHUNK - 1) / CHUNK;
    DMK_TRY(DMK_GROW(ctx, e->finds, n_chunks, e->finds_room));
    dmk_crew_round(&e->crew, (int32_t)n_chunks);
    for (int i = 0; i < DMK_MOST_CREW; i++) {
        worker *w = e->worker + i;
        if (w->rc != DMK_OK) return dmk_fail(ctx, w->rc, "%s", w->own.message);
        w->n = (counts){0, 0, 0, 0};
        e->n_looks += w->n_looks;
        w->n_looks = 0;
        if (w->keeps && !e->kept) {
            const size_t n_half = 3 * (size_t)e->front.g->mesh->n_triangles;
            DMK_TRY(DMK_NEW_UNSET(ctx, e->kept, n_half));
            memset(e->kept, 0xff, n_half * sizeof *e->kept);
        }
    }
    for (size_t k = 0; k < n_chunks; k++) DMK_TRY(enter(ctx, e, e->finds + k));
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
    while (e->pseudo_sources.n > 0 && e->pseudo_sources.at[0].key < limit) {
        dmk_heap_item top = dmk_heap_pop(&e->pseudo_sources);
        if (top.key > e->front.d[top.item] || !(top.key < e->radiated[top.item])) continue;
        *any = true;
        DMK_TRY(radiate_pseudo_source(ctx, e, top.item));
    }
done:
    return rc;
}

static bool spent(const engine *e)
{
    return e->n_looks > always + most_looks * 3LL * e->front.g->mesh->n_triangles;
}

static int sweep(dmk_context *ctx, engine *e)
{
    int rc = DMK_OK;
    bool any;
    while (e->current < e->n_buckets || e->pseudo_sources.n > 0) {
        if (e->current >= e->n_buckets) { /* only pseudo-sources are left: go to the first */
            double index = dmk_min((e->pseudo_sources.at[0].key - e->least) / e->width,
                                   (double)e->most_buckets);
            if (index > (double)e->current) e->current = (size_t)index;
        }
        do {
            DMK_TRY(take_bucket(ctx, e));
            any = e->n_taken > 0;
            if (any)
                DMK_TRY(visit_all(ctx, e));
            else
                DMK_TRY(radiate_pseudo_sources(ctx, e, &any));
            DMK_TRY(dmk_poll(ctx));
        } while (any && !spent(e));
        if (spent(e)) break;
        e->current++;
    }
done:
    return rc;
}

static void arrive(const engine *e, int32_t v)
{
    dmk_geodesics *g = e->front.g;
    const mark *m = e->mark + v;
    g->arrival[v] = (dmk_arrival){0, 0, -1, -1};
    if (m->half == UNREACHED) return;
    const dmk_site *p = m->source < g->n_sources ? g->source + m->source : NULL;
    double direction =
        p ? dmk_front_turn(m->direction, p->total, p->vertex >= 0 && g->star.border[p->vertex]) : 0;
    g->arrival[v] = (dmk_arrival){direction, back_of(e, v), m->root, m->source};
    g->distance[v] *= g->star.unit;
    e->error[v] *= g->star.unit;
}

static void arrive_range(int32_t begin, int32_t end, void *data)
{
    for (int32_t v = begin; v < end; v++) arrive(data, v);
}

int dmk_waves_run(dmk_context *ctx, dmk_geodesics *g, double tolerance, bool *finished)
{
    int rc;
    engine e;
    DMK_TRY(engine_create(ctx, g, tolerance, &e));
    for (int32_t i = 0; i < g->n_sources; i++) DMK_TRY(radiate_source(ctx, &e, i));
    for (size_t i = 0; i < g->n_lines; i++) DMK_TRY(radiate_line(ctx, &e, g->line[i]));
    dmk_crew_begin(ctx, &e.crew, visit_chunk, &e);
    rc = sweep(ctx, &e);
    dmk_crew_end(ctx, &e.crew);
    if (rc != DMK_OK) goto done;
    *finished = !spent(&e);
    if (*finished) dmk_parallel(ctx, g->mesh->n_vertices, arrive_range, &e);
    g->n_windows = e.n_made;
    if (tolerance > 0) {
        g->error = e.error;
        e.error = NULL;
    }
done:
    engine_free(&e);
    return rc;
}
