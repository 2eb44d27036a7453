/* The windows of a half-edge: the lower envelope, merging, and a step into the triangle: see wave.c. */
#include "geodesic/wave_engine.h"

/* Rounding, over the length of the edge, of comparisons with ways over vertices. */
static const double rounding = 1e-9;
/* At least: the front's curvature times the edge, so that it focuses 20 edges ahead at least. */
static const double least_curvature = -0.05;
/* Around a needle or a thin tube windows come back to a half-edge again and again, each hardly longer than the one
 * before, and no vertex is near enough to show that they are of no use. From so many visits on, a half-edge keeps
 * what has run on from it, for the lower envelope. Other half-edges are visited some four times. */
enum { often = 32 };

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

double dmk_wave_key(const wave *w, double length, double most)
{
    return dmk_min(dmk_max(value(w, 0), value(w, length)), most);
}

/* ---- one step -------------------------------------------------------------------------------- */

typedef struct angle {
    double length, left, right;
    double ca, sa, cb, sb, cx, cy, at;
    int32_t a, b, c, through_left, through_right;
    double d_a, d_b, d_c, error,
        detour; /* what is known of the vertices, with the finds of this visit; error, detour: of c */
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
    s->error = e->error[s->c], s->detour = e->detour[s->c], s->known = e->mark + s->c;
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
    c->error = w->error, c->detour = w->detour;
    c->source = w->source, c->root = w->root;
    c->D = w->D + (2 * xi + w->k * (dx * dx + dy * dy)) / (1 + n);
    c->k = w->k * i;
    c->ux = (qx * ex + qy * ey) * i, c->uy = (qy * ex - qx * ey) * i;
    c->turn = w->turn * i;
    c->direction = w->turn != 0 ? w->direction + w->turn * psi(w->k, xi, eta) : w->direction;
    return c->uy > 0 && (w->k >= 0 || 1 + w->k * xi > 0);
}

static int add_child(shard *me, const wave *w, double key)
{
    finds *f = me->finds + dmk_waves_shard(w->half);
    const int rc = DMK_GROW(&me->own, f->child, f->n_children + 1, f->child_room);
    if (rc == DMK_OK) f->child[f->n_children++] = (child){*w, key};
    return rc;
}

static int step_left(shard *me, const wave *w, const angle *s, double last)
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

static int step_right(shard *me, const wave *w, const angle *s, double first)
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
    if (!(d < s->d_c || w->error + s->d_c - d > s->error || w->detour + d - s->d_c < s->detour))
        return;
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
    if (dmk_wave_improve(&s->d_c, &s->error, &s->detour, d, w->error, w->detour + excess)) {
        s->mark = m;
        s->known = &s->mark;
    }
    s->reached = true;
}

static int step(shard *me, const wave *w, angle *s)
{
    const double slack = DMK_SAME_PLACE * s->length, den = w->k * s->cy + w->uy;
    const double eps = DMK_SAME_LENGTH + rounding * s->length;
    int rc = DMK_OK;
    if (den > 0)
        s->at = ((w->o * w->k - w->ux) * s->cy + s->cx * w->uy) / den;
    else if (1 + w->k * (w->ux * (s->cx - w->o) + w->uy * s->cy) > 0)
        s->at = w->ux > 0 ? -INFINITY : INFINITY; /* so flat that all rays pass it below */
    else
        return rc; /* the rays meet before */
    double last = w->hi, first = w->lo, t = dmk_min(dmk_max(s->at, w->lo), w->hi);
    if (s->at >= w->lo - slack && s->at <= w->hi + slack) last = first = s->at;
    const double before = s->d_c;
    reach_above(w, s, t);
    const mark *m = s->known;
    if (t == s->at && s->d_c == before && m->half == w->half && m->at < HUGE_VAL) {
        double dx = s->cx - w->o, qx = w->k * dx + w->ux, qy = w->k * s->cy + w->uy;
        double d = w->D + (2 * (w->ux * dx + w->uy * s->cy) + w->k * (dx * dx + s->cy * s->cy)) /
                              (1 + sqrt(qx * qx + qy * qy));
        if (d > before + eps && s->at < m->at - slack)
            first = m->at; /* those before cross the shorter way */
        else if (d > before + eps && s->at > m->at + slack)
            last = m->at;
    }
    const bool left = w->lo<dmk_min(s->at, last), right = w->hi> dmk_max(s->at, first);
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

/* Where the rays of one source pass another one, which has an offset or lies beside a line, that other one may be the
 * nearer one in the middle of a..b alone: a place where sign * (value of u - value of w), which is 0 or less at both
 * ends, is more; NaN if there is none. Two windows of one source have none: no vertex lies among the rays of a window.
 */
static double among(const wave *u, const wave *w, double a, double b, double sign, double length)
{
    if (u->source == w->source) return NAN;
    if (!(sign * (slope(u, a) - slope(w, a)) > 0 && sign * (slope(u, b) - slope(w, b)) < 0))
        return NAN;
    while (b - a > DMK_NO_WIDTH * length) {
        const double t = 0.5 * (a + b);
        if (sign * longer(u, w, t) > 0) return t;
        if (sign * (slope(u, t) - slope(w, t)) > 0)
            a = t;
        else
            b = t;
    }
    return NAN;
}

/* Each goes on to the middle of the gap: its error grows there by what their slopes differ, and is half of what they
 * differ in all or more. What they differ already when the next edge opens the gap anew has been counted. Wide gaps
 * stay: they are shadows, and paths around vertices lead there. */
static void close_gap(const engine *e, wave *u, wave *w, double length)
{
    const double gap = w->lo - u->hi, middle = 0.5 * (w->lo + u->hi);
    if (!(gap > 0) || gap > e->allow.gap * length) return;
    const double bend = 0.5 * gap * fabs(slope(u, middle) - slope(w, middle)),
                 jump = fabs(value(u, middle) - value(w, middle)) + bend;
    if (jump > e->allow.step * length) return;
    u->hi = w->lo = middle;
    u->error = dmk_max(u->error + bend, jump);
    w->error = dmk_max(w->error + bend, jump);
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
        const double t = among(u, w, a, b, 1, length);
        if (t > a) {
            if (w->hi <= u->hi) w->hi = crossing(e, u, w, t, b, length);
            w->lo = crossing(e, u, w, a, t, length);
            return true;
        }
        if (w->hi <= u->hi) return false;
        w->lo = b;
    } else if (fa >= 0 && fb >= 0) {
        if (w->hi < u->hi) return true;
        const double t = among(u, w, a, b, -1, length);
        u->hi = t > a ? crossing(e, u, w, t, b, length) : a;
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
    *o = (wave){a, c, middle,  ux, sqrt(1 - ux * ux), k,      d, 0, 0,
                0, 0, r->half, -1, r->source,         r->root};
    return true;
}

/* Largest change of the values where windows meet, in their middles and where they are least (beside a point near the
 * edge they bend in a small part of a long window), and a fifth for what lies between: without it neighbours on a disc
 * of needles differ by 9e-5 more than their edge is long. */
static const double beyond_samples = 1.2;

static double change(const wave *r, size_t n, wave *o)
{
    double most = 0;
    for (size_t i = 0; i < n; i++) {
        double middle = 0.5 * (r[i].lo + r[i].hi);
        o->error = dmk_max(o->error, r[i].error);
        o->detour = dmk_max(o->detour, r[i].detour);
        if (r[i].root != o->root) o->root = -1;
        most = dmk_max(most, fabs(value(o, middle) - value(r + i, middle)));
        if (i > 0) most = dmk_max(most, fabs(value(o, r[i].lo) - value(r + i, r[i].lo)));
        if (i + 1 < n) most = dmk_max(most, fabs(value(o, r[i].hi) - value(r + i, r[i].hi)));
        const double foot =
            r[i].o - r[i].ux / r[i].k; /* anywhere, or no number, of fronts that are straight */
        if (foot > r[i].lo && foot < r[i].hi)
            most = dmk_max(most, fabs(value(o, foot) - value(r + i, foot)));
    }
    return beyond_samples * most;
}

/* The same at places within windows that are a large part of the run: one that bends, as beside a point near the edge,
 * may be off by ten times as much there. On terrain 0.9 % of the vertices were off by more than their estimates without
 * this, 0.1 % are with 8 places or 16. At once, in the processor's vectors: no time. */
enum { PLACES = 8 };

static double change_within(const wave *r, size_t n, const wave *o)
{
    double most = 0, off[PLACES];
    for (size_t i = 0; i < n; i++) {
        const double lo = r[i].lo, step = (r[i].hi - lo) / PLACES;
        if (PLACES * PLACES * step < o->hi - o->lo) continue;
        for (int k = 0; k < PLACES; k++) {
            const double t = lo + (k + 0.5) * step;
            off[k] = fabs(value(o, t) - value(r + i, t));
        }
        for (int k = 0; k < PLACES; k++) most = dmk_max(most, off[k]);
    }
    return beyond_samples * most;
}

/* From direction a to b at a source, the short way around if directions close up there. */
static double turn_between(const dmk_geodesics *g, int32_t source, double a, double b)
{
    const dmk_site *p = source < g->n_sources ? g->source + source : NULL;
    return dmk_turn_between(p && !p->on_border ? p->total : HUGE_VAL, a, b);
}

/* One wave for the n touching windows r, if that changes little. */
static bool merge(const engine *e, const wave *r, size_t n, double length, wave *o)
{
    const wave *last = r + n - 1;
    if (last->source != r->source || !interpolate(r, n, length, o)) return false;
    double off = change(r, n, o), a = o->lo, c = o->hi;
    const double room = e->allow.error * o->D - o->error;
    if (off > room) return false;
    if (fabs(slope(o, a) - slope(r, a)) > e->allow.slope) return false;
    if (fabs(slope(o, c) - slope(last, c)) > e->allow.slope) return false;
    off = dmk_max(off, change_within(r, n, o));
    if (off > room) return false;
    o->error += off;
    const double from = direction_at(r, a);
    const double turn = turn_between(e->front.g, r->source, from, direction_at(last, c));
    double p = psi(o->k, o->ux * (a - o->o), -o->uy * (a - o->o)),
           q = psi(o->k, o->ux * (c - o->o), -o->uy * (c - o->o));
    o->turn = turn / (q - p);
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

/* Take the windows of one of a half-edge's lists that are still of use into the shard's. */
static int gather(shard *me, int32_t *head, bool kept, const angle *s, size_t *n)
{
    int rc = DMK_OK;
    const double eps = DMK_SAME_LENGTH + rounding * s->length, at_a = s->d_a + eps;
    const double at_b = s->d_b + s->length + eps;
    for (int32_t i = *head; i >= 0; i = me->pool[i].next) {
        const wave *w = me->pool + i;
        DMK_TRY(DMK_GROW(&me->own, me->free, me->n_free + 1, me->free_room));
        me->free[me->n_free++] = i;
        if (at_b - w->lo < value(w, w->lo) || at_a + w->hi < value(w, w->hi)) continue;
        DMK_TRY(DMK_GROW(&me->own, me->list, *n + 1, me->list_room));
        me->list[*n] = *w;
        me->list[(*n)++].next = kept ? KEPT : -1;
    }
    *head = -1;
done:
    return rc;
}

/* One more visit: whether the half-edge keeps its windows now. */
static bool keeps(shard *me, const engine *e, int32_t half)
{
    if (e->visits[half] < often) e->visits[half]++;
    if (e->visits[half] < often) return false;
    me->keeps = true;
    return e->kept != NULL;
}

int dmk_waves_visit(shard *me, const engine *e, int32_t half)
{
    int rc;
    size_t n = 0;
    angle s;
    const bool keep = keeps(me, e, half);
    look(e, half, &s);
    DMK_TRY(gather(me, e->head + half, false, &s, &n));
    if (keep) DMK_TRY(gather(me, e->kept + half, true, &s, &n));
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
        if (keep) DMK_TRY(dmk_shard_store(&me->own, me, l + i, e->kept + half));
        if (l[i].next != KEPT) DMK_TRY(step(me, l + i, &s));
    }
    if (!s.reached) goto done;
    finds *f = me->finds + dmk_waves_shard_of_vertex(s.c);
    DMK_TRY(DMK_GROW(&me->own, f->hit, f->n_hits + 1, f->hit_room));
    f->hit[f->n_hits++] = (hit){*s.known, s.d_c, s.error, s.detour, s.c};
done:
    return rc;
}
