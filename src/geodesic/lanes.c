/* Windows abreast. Most steps of a window (99 of 100 on smooth meshes) are plain: all of its rays leave the triangle
 * through the same side, well away from the corner above. Such steps ask nothing but arithmetic and are taken by many
 * windows side by side, one to a lane, in the processor's vector registers; for the others see step.c. All forms of
 * the loop do the same operations on each lane, so that the processor does not decide the result. */
#include "geodesic/window.h"

#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

/* A group is one vector wide; while one computes, what the others need is on its way from memory: 136k vertices, two
 * threads, vectors of 512 bits: two groups 0.149 s, three 0.140, four 0.134, six no less. Speed only: a lane's numbers
 * do not depend on its neighbours. */
enum { LANES = 8, GROUPS = 4, ALL_LANES = LANES * GROUPS };

/* Windows whose rays all cross the side at one end of their half-edge, the near end. They are seen from there: the
 * near end is the origin, the half-edge the x axis, mirrored if it is the half-edge's end. */
typedef struct group {
    double lo[LANES], hi[LANES], x[LANES], y[LANES], base[LANES], turn[LANES];
    double length[LANES]; /* of the half-edge */
    double d_near[LANES], d_far[LANES],
        d_up[LANES];     /* of the triangle's vertices, as last asked for */
    double state[LANES]; /* one of the below */
    int32_t at[LANES];   /* the stride that is next */
} group;
/* Of a lane: to go on; no window; and, to be looked at: no shortest path among its rays; to go on by step.c. */
enum { PLAIN, EMPTY, LOOK, DROPPED = LOOK, ODD };

/* Sets of lanes: bit k * LANES + i is lane i of group k. */
typedef struct lanes {
    group group[GROUPS];
    int32_t root[ALL_LANES];
    uint32_t look; /* dropped or odd since the last look */
    uint32_t empty;
} lanes;
_Static_assert(ALL_LANES <= 32, "a set of lanes fits into its type");

/* ---- strides --------------------------------------------------------------------------------- */

static void make_stride(const dmk_front *front, int32_t half, int mirrored, stride *s)
{
    const dmk_facet *f = front->facet + half / 3;
    const int near = (half + 1 + mirrored) % 3, far = (half + 2 - mirrored) % 3;
    const int32_t twin = f->twin[far];
    *s = (stride){.side = twin < 0 ? NAN : f->length[far],
                  .cosine = f->cosine[near],
                  .sine = f->sine[near],
                  .turn = mirrored ? -f->angle[near] : f->angle[near]};
    if (twin < 0) return;
    const dmk_facet *o = front->facet + twin / 3;
    const int there = (twin + 1 + mirrored) % 3, across = (twin + 2 - mirrored) % 3;
    s->x = o->length[across] * o->cosine[there];
    s->y = o->length[across] * o->sine[there];
    s->next = 2 * twin + mirrored;
    s->corner = o->vertex[twin % 3];
}

static void stride_range(int32_t begin, int32_t end, void *data)
{
    engine *e = data;
    for (int32_t i = 6 * begin; i < 6 * end; i++)
        make_stride(&e->front, i / 2, i % 2, e->stride + i);
}

/* ---- plain steps ------------------------------------------------------------------------------ */

/* Into the caller's loops, whatever the processor these are for. */
#define WITHIN static inline __attribute__((always_inline))

/* The strides of a group, field by field. */
typedef struct fields {
    double side[LANES], cosine[LANES], sine[LANES], turn[LANES], x[LANES], y[LANES], d[LANES];
    int32_t next[LANES];
} fields;

WITHIN void fetch(const engine *e, const group *g, fields *f)
{
    for (int i = 0; i < LANES; i++) {
        const stride *s = e->stride + g->at[i];
        f->side[i] = s->side;
        f->cosine[i] = s->cosine;
        f->sine[i] = s->sine;
        f->turn[i] = s->turn;
        f->x[i] = s->x;
        f->y[i] = s->y;
        f->next[i] = s->next;
        f->d[i] = dmk_windows_known(e, s->corner);
    }
}

/* Whether a window lo..hi of the side, the root at (x, y), may hold a shortest path yet: else a way over a vertex
 * of the triangle is shorter for all of its rays. */
WITHIN double lives(const group *g, const fields *f, int i, double lo, double hi, double x,
                    double y)
{
    const double base = g->base[i] - DMK_SAME_LENGTH, pl = lo - x, ph = hi - x, y2 = y * y;
    const double ql = pl * pl + y2, qh = ph * ph + y2;
    const double bx = g->length[i] * f->cosine[i] - lo, by = g->length[i] * f->sine[i];
    const double up = g->d_up[i] + (f->side[i] - lo) - base, near = g->d_near[i] + hi - base,
                 far = g->d_far[i] + sqrt(bx * bx + by * by) - base;
    double yes = PLAIN;
    yes = hi - lo > DMK_NO_WIDTH * f->side[i] ? yes : DROPPED;
    yes = y < 0 ? yes : DROPPED;
    yes = up > 0 ? yes : DROPPED;
    yes = up * up > ql ? yes : DROPPED;
    yes = near > 0 ? yes : DROPPED;
    yes = near * near > qh ? yes : DROPPED;
    yes = far >= 0 ? yes : DROPPED;
    return far * far >= ql ? yes : DROPPED;
}

/* One step of each lane. No branches: this becomes vector code. */
WITHIN void stride_on(const engine *e, group *g, const fields *f)
{
    double mirror[LANES];
    for (int i = 0; i < LANES; i++) {
        const double side = f->side[i], c = f->cosine[i], s = f->sine[i], x0 = g->x[i],
                     y0 = g->y[i];
        const double cut_lo = -y0 * g->lo[i] / (-y0 * c - s * (g->lo[i] - x0)),
                     cut_hi = -y0 * g->hi[i] / (-y0 * c - s * (g->hi[i] - x0));
        const double within = cut_hi <= side ? cut_hi : side;
        const double lo = cut_lo >= 0 ? cut_lo : 0, hi = within >= 0 ? within : side;
        const double x = x0 * c + y0 * s, y = y0 * c - x0 * s;
        const double found = lives(g, f, i, lo, hi, x, y);
        /* how far to the side of all rays the next corner up is, times its height above the root */
        const double rise = f->y[i] - y, shift = (f->x[i] - x) * y;
        const double below = (lo - x) * rise + shift, above = (x - hi) * rise - shift;
        const double off = below > 0 ? below : above;
        const double kind = off >= DMK_BESIDE * side * rise ? found : ODD;
        const double state = found == PLAIN ? kind : DROPPED, before = g->state[i];
        g->state[i] = before == PLAIN ? state : before;
        const double end_lo = side - hi, end_hi = side - lo, end_x = side - x;
        const double up = g->d_up[i], near = g->d_near[i];
        g->lo[i] = below > 0 ? end_lo : lo;
        g->hi[i] = below > 0 ? end_hi : hi;
        g->x[i] = below > 0 ? end_x : x;
        g->y[i] = y;
        g->length[i] = side;
        g->turn[i] += f->turn[i];
        g->d_near[i] = below > 0 ? up : near;
        g->d_far[i] = below > 0 ? near : up;
        g->d_up[i] = f->d[i];
        mirror[i] = below > 0 ? 1.0 : 0.0;
    }
    for (int i = 0; i < LANES; i++) g->at[i] = f->next[i] ^ (int32_t)mirror[i];
    for (int i = 0; i < LANES; i++) __builtin_prefetch(e->stride + g->at[i]);
}

/* The lanes to look at. */
WITHIN uint32_t looks(const group *g)
{
    uint32_t set = 0;
    for (int i = 0; i < LANES; i++) set |= (uint32_t)(g->state[i] >= LOOK) << i;
    return set;
}

/* Steps of all groups until there is a lane to look at, `most` at most; their number. */
WITHIN int steps(const engine *e, lanes *w, int most,
                 void (*fetch_fields)(const engine *, const group *, fields *),
                 uint32_t (*looks_of)(const group *))
{
    fields f;
    int n = 0;
    for (w->look = 0; w->look == 0 && n < most; n++) {
        for (int k = 0; k < GROUPS; k++) {
            fetch_fields(e, w->group + k, &f);
            stride_on(e, w->group + k, &f);
            w->look |= looks_of(w->group + k) << (k * LANES);
        }
    }
    return n;
}

static int advance(const engine *e, lanes *w, int most)
{
    return steps(e, w, most, fetch, looks);
}

/* ---- for wide vectors --------------------------------------------------------------------------- */

#if defined(__x86_64__) && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define WIDE_TARGET "avx512f,avx512dq,avx512vl,avx512bw"
#ifdef __clang__
#define WIDE __attribute__((target(WIDE_TARGET), min_vector_width(512)))
#else
#define WIDE __attribute__((target(WIDE_TARGET ",prefer-vector-width=512")))
#endif
#endif
#endif

#ifdef WIDE
#include <immintrin.h>

typedef double wide __attribute__((vector_size(64), may_alias));

/* Pairs of rows, then of pairs, then of halves change places. */
WITHIN void transpose(wide r[8])
{
    wide p[8], q[8];
    for (int i = 0; i < 8; i += 2) {
        p[i] = __builtin_shufflevector(r[i], r[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
        p[i + 1] = __builtin_shufflevector(r[i], r[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    }
    for (int i = 0; i < 6; i++) {
        if (i == 2 || i == 3) continue;
        q[i] = __builtin_shufflevector(p[i], p[i + 2], 0, 1, 4, 5, 8, 9, 12, 13);
        q[i + 2] = __builtin_shufflevector(p[i], p[i + 2], 2, 3, 6, 7, 10, 11, 14, 15);
    }
    for (int i = 0; i < 4; i++) {
        r[i] = __builtin_shufflevector(q[i], q[i + 4], 0, 1, 4, 5, 8, 9, 12, 13);
        r[i + 4] = __builtin_shufflevector(q[i], q[i + 4], 2, 3, 6, 7, 10, 11, 14, 15);
    }
}

/* A stride is a row of eight, loaded as one: what is stored in pieces is not to be had as a whole at once. */
WIDE WITHIN void fetch_rows(const engine *e, const group *g, fields *f)
{
    wide row[8];
    int64_t link[LANES];
    _Static_assert(LANES == 8 && sizeof(stride) == sizeof *row, "a stride fills a vector");
    for (int i = 0; i < LANES; i++) {
        const stride *s = e->stride + g->at[i];
        row[i] = *(const wide *)(const void *)s;
        f->d[i] = dmk_windows_known(e, s->corner);
    }
    transpose(row);
    memcpy(f->side, row, sizeof *row);
    memcpy(f->cosine, row + 1, sizeof *row);
    memcpy(f->sine, row + 2, sizeof *row);
    memcpy(f->turn, row + 3, sizeof *row);
    memcpy(f->x, row + 4, sizeof *row);
    memcpy(f->y, row + 5, sizeof *row);
    memcpy(link, row + 6, sizeof *row);
    for (int i = 0; i < LANES; i++) f->next[i] = (int32_t)link[i]; /* the lower half */
}

WIDE WITHIN uint32_t looks_wide(const group *g)
{
    return _mm512_cmp_pd_mask(_mm512_loadu_pd(g->state), _mm512_set1_pd(LOOK), _CMP_GE_OQ);
}

WIDE static int advance_wide(const engine *e, lanes *w, int most)
{
    return steps(e, w, most, fetch_rows, looks_wide);
}
#endif

int dmk_lanes_create(dmk_context *ctx, engine *e)
{
    int rc;
    const size_t line = sizeof(stride);
    char *room = NULL;
    const int32_t n = e->front.g->mesh->n_triangles;
    DMK_TRY(DMK_NEW_UNSET(ctx, room, (6 * (size_t)n + 1) * line)); /* a sixth of a run's memory */
    e->room = room;
    e->stride = (stride *)(void *)(room + (line - (uintptr_t)room % line) % line);
    dmk_parallel(ctx, n, stride_range, e);
    e->advance = advance;
#ifdef WIDE
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
        e->advance = advance_wide;
#endif
done:
    return rc;
}

void dmk_lanes_free(engine *e)
{
    free(e->room);
}

/* ---- windows into lanes and out ------------------------------------------------------------------- */

/* Window w into lane i; false if its next step is not plain. */
static bool put(const engine *e, lanes *all, int i, const window *w)
{
    group *g = all->group + i / LANES;
    const int lane = i % LANES, k = w->half % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    const dmk_facet *f = e->front.facet + w->half / 3;
    const double length = f->length[k], x = f->length[k2] * f->cosine[k1],
                 y = f->length[k2] * f->sine[k1];
    const double rise = y - w->y, shift = (x - w->x) * w->y;
    const double below = (w->lo - w->x) * rise + shift, above = (w->x - w->hi) * rise - shift;
    const bool mirrored = below > 0;
    const double off = mirrored ? below : above;
    if (!(off >= DMK_BESIDE * length * rise)) return false;
    g->lo[lane] = mirrored ? length - w->hi : w->lo;
    g->hi[lane] = mirrored ? length - w->lo : w->hi;
    g->x[lane] = mirrored ? length - w->x : w->x;
    g->y[lane] = w->y;
    g->base[lane] = w->base;
    g->turn[lane] = w->turn;
    g->length[lane] = length;
    g->d_near[lane] = dmk_windows_known(e, f->vertex[mirrored ? k2 : k1]);
    g->d_far[lane] = dmk_windows_known(e, f->vertex[mirrored ? k1 : k2]);
    g->d_up[lane] = dmk_windows_known(e, f->vertex[k]);
    g->state[lane] = PLAIN;
    g->at[lane] = 2 * w->half + mirrored;
    all->root[i] = w->root;
    return true;
}

static window get(const lanes *all, int i)
{
    const group *g = all->group + i / LANES;
    const int lane = i % LANES;
    const bool mirrored = g->at[lane] % 2;
    const double length = g->length[lane], lo = g->lo[lane], hi = g->hi[lane], x = g->x[lane];
    return (window){.lo = mirrored ? length - hi : lo,
                    .hi = mirrored ? length - lo : hi,
                    .x = mirrored ? length - x : x,
                    .y = g->y[lane],
                    .base = g->base[lane],
                    .turn = g->turn[lane],
                    .half = g->at[lane] / 2,
                    .root = all->root[i]};
}

/* The next window to run down. */
static bool take(worker *me, window *w)
{
    const shares *s = me->shares;
    if (me->n_stack > 0 && !me->spreads) {
        *w = me->stack[--me->n_stack];
        return true;
    }
    while (s && me->n_tried < s->n) {
        const size_t i = (me->first + me->n_tried++) % s->n;
        if (s->taken && atomic_exchange(s->taken + i, true)) continue;
        *w = s->window[i];
        return true;
    }
    return false;
}

/* A window into empty lane i. Those whose step is not plain take it here. */
static int fill(worker *me, lanes *w, int i, bool *filled)
{
    int rc = DMK_OK, n;
    window one, o[2];
    *filled = false;
    while (!dmk_windows_spent(me->e) && take(me, &one)) {
        *filled = put(me->e, w, i, &one);
        if (*filled) break;
        DMK_TRY(dmk_windows_step(me, &one, o, &n));
        DMK_TRY(dmk_windows_count(me, n));
        for (int k = 0; k < n; k++) DMK_TRY(dmk_windows_push(me, o + n - 1 - k));
    }
done:
    return rc;
}

/* Lanes that have dropped their window, or hold one whose next step is not plain, are empty then. *n_dropped: how many
 * have dropped it. */
static int clear(worker *me, lanes *w, int *n_dropped)
{
    int rc = DMK_OK;
    *n_dropped = 0;
    for (uint32_t set = w->look; set; set &= set - 1) {
        const int i = __builtin_ctz(set);
        double *state = &w->group[i / LANES].state[i % LANES];
        const window one = get(w, i);
        if (*state == ODD)
            DMK_TRY(dmk_windows_push(me, &one));
        else
            ++*n_dropped;
        *state = EMPTY;
    }
    w->empty |= w->look;
done:
    return rc;
}

/* However many steps are taken at a time, a window changes between the forms of a lane and of the stack where its next
 * step is not plain, and only there: so its numbers do not depend on who runs it down, and when. */
int dmk_lanes_run(worker *me, int64_t most)
{
    /* Steps, between looks at a full limit: speed only, and the same with 32 or 128. */
    enum { AT_ONCE = 64 };
    int rc = DMK_OK, n_dropped;
    lanes w = {.empty = UINT32_MAX >> (32 - ALL_LANES)};
    const uint32_t all = w.empty;
    for (int i = 0; i < ALL_LANES; i++) w.group[i / LANES].state[i % LANES] = EMPTY;
    while (!dmk_windows_spent(me->e)) {
        bool filled = most > 0;
        for (uint32_t set = w.empty; set && filled; set &= set - 1) {
            const int i = __builtin_ctz(set);
            DMK_TRY(fill(me, &w, i, &filled));
            if (filled) w.empty &= ~(UINT32_C(1) << i);
        }
        if (w.empty == all) break;
        const int64_t n =
            (int64_t)me->e->advance(me->e, &w, AT_ONCE) * __builtin_popcount(all & ~w.empty);
        DMK_TRY(clear(me, &w, &n_dropped));
        DMK_TRY(dmk_windows_count(me, n - n_dropped));
        most -= n;
    }
done:
    return rc;
}
