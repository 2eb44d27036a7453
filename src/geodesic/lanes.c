/* Windows abreast. Most steps of a window (99 of 100 on smooth meshes) are plain: all of its rays leave the triangle
 * through the same side, well away from the corner above. Such steps ask nothing but arithmetic and are taken by many
 * windows side by side, one to a lane, in the processor's vector registers (lanes_loop.h); for the others see step.c.
 * Here the root stands still and the triangles turn, by one product of complex numbers each; the rays stay as they are.
 * The loop does the same operations on each lane in all its forms, so that the processor does not decide the result. */
#include "geodesic/lanes.h"

#include "base/heading.h"
#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

/* ---- strides --------------------------------------------------------------------------------- */

static int64_t link_of(int32_t left, int32_t right)
{
    return (int64_t)((uint64_t)(uint32_t)left | (uint64_t)(uint32_t)right << 32);
}

/* The half-edges on the other sides of the triangle above one. */
static int64_t next_of(const dmk_facet *f, int k)
{
    return link_of(f->twin[k == 0 ? 2 : k - 1], f->twin[k == 2 ? 0 : k + 1]);
}

static double along_of(double p, double rest)
{
    const bool turned = p > 0.5 && rest != 0;
    return dmk_real_of((dmk_bits_of(turned ? rest : p) & ~UINT64_C(1)) | turned);
}

static void corner_range(int32_t begin, int32_t end, void *data)
{
    engine *e = data;
    for (int32_t t = begin; t < end; t++) {
        const dmk_facet *f = e->front.facet + t;
        for (int k = 0; k < 3; k++) {
            const int a = (k + 1) % 3, b = (k + 2) % 3;
            const double scale = 1 / f->length[k];
            e->stride[3 * (size_t)t + (size_t)k].here = (corner){
                along_of(f->length[b] * f->cosine[a] * scale, f->length[a] * f->cosine[b] * scale),
                f->length[b] * f->sine[a] * scale};
        }
    }
}

/* What lies beyond each side of a triangle. Beyond a border, whatever the corner, no half-edge follows. */
static void beyond_range(int32_t begin, int32_t end, void *data)
{
    engine *e = data;
    for (int32_t t = begin; t < end; t++) {
        const int32_t *twin = e->front.facet[t].twin;
        stride *s = e->stride + 3 * (size_t)t;
        for (int k = 0; k < 3; k++) {
            const int32_t half = twin[k];
            stride *right_of = s + (k == 0 ? 2 : k - 1), *left_of = s + (k == 2 ? 0 : k + 1);
            const corner beyond = half >= 0 ? e->stride[half].here : (corner){0, 0};
            const int64_t next =
                half >= 0 ? next_of(e->front.facet + half / 3, half % 3) : link_of(-1, -1);
            right_of->beyond_right = left_of->beyond_left = beyond;
            right_of->next_right = left_of->next_left = next;
        }
    }
}

/* ---- plain steps ------------------------------------------------------------------------------ */

typedef double real_or_whole __attribute__((may_alias));

#define FORM(name) name##_plain
#define FOR
#define VECTOR 16
#define LANE(set, k) ((set)[k] != 0)
#include "geodesic/lanes_loop.h"

/* And for wider vectors, where the processor has them. Built for any processor of its kind, distances of 273k triangles
 * take 0.23 s with 128 bits, 0.14 with 256, 0.10 with 512. */
#ifdef __x86_64__
#define FORM(name) name##_middle
#define FOR __attribute__((target("avx2")))
#define VECTOR 32
#define LANE(set, k) ((set)[k] != 0)
#include "geodesic/lanes_loop.h"
#endif

#if defined(__x86_64__) && defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define WIDE_TARGET "avx512f,avx512dq,avx512vl,avx512bw"
#ifdef __clang__
#define FOR __attribute__((target(WIDE_TARGET), min_vector_width(512)))
#else
#define FOR __attribute__((target(WIDE_TARGET ",prefer-vector-width=512")))
#endif
#include <immintrin.h>

typedef double row __attribute__((vector_size(64), may_alias));

/* Half of a stride is half a row, loaded as one. */
FOR static inline __attribute__((always_inline)) row two_halves(const double *a, const double *b)
{
    return (row)_mm512_insertf64x4(_mm512_castpd256_pd512(_mm256_load_pd(a)), _mm256_load_pd(b), 1);
}

/* Field by field the first or the second halves of the strides of eight lanes. */
FOR static inline __attribute__((always_inline)) void fetch_half(const stride *s, const int64_t *at,
                                                                 int half, row field[4])
{
#define HALF(k) (&s[at[k]].here.along + 4 * half)
    const row r0 = two_halves(HALF(0), HALF(4)), r1 = two_halves(HALF(1), HALF(5)),
              r2 = two_halves(HALF(2), HALF(6)), r3 = two_halves(HALF(3), HALF(7));
#undef HALF
    const row a = __builtin_shufflevector(r0, r1, 0, 8, 2, 10, 4, 12, 6, 14),
              b = __builtin_shufflevector(r0, r1, 1, 9, 3, 11, 5, 13, 7, 15),
              c = __builtin_shufflevector(r2, r3, 0, 8, 2, 10, 4, 12, 6, 14),
              d = __builtin_shufflevector(r2, r3, 1, 9, 3, 11, 5, 13, 7, 15);
    field[0] = __builtin_shufflevector(a, c, 0, 1, 8, 9, 4, 5, 12, 13);
    field[1] = __builtin_shufflevector(b, d, 0, 1, 8, 9, 4, 5, 12, 13);
    field[2] = __builtin_shufflevector(a, c, 2, 3, 10, 11, 6, 7, 14, 15);
    field[3] = __builtin_shufflevector(b, d, 2, 3, 10, 11, 6, 7, 14, 15);
}

FOR static inline __attribute__((always_inline)) void fetch_rows(const stride *s, const int64_t *at,
                                                                 row field[8])
{
    fetch_half(s, at, 0, field);
    fetch_half(s, at, 1, field + 4);
}

#define FORM(name) name##_wide
#define VECTOR 64
#define FETCH fetch_rows
#define SET __mmask8
#define LESS(a, b) _mm512_cmp_pd_mask((__m512d)(a), (__m512d)(b), _CMP_LT_OQ)
#define AT_LEAST(a, b) _mm512_cmp_pd_mask((__m512d)(a), (__m512d)(b), _CMP_GE_OQ)
#define EQUAL(a, b) _mm512_cmpeq_epi64_mask((__m512i)(a), (__m512i)(b))
#define SELECT(set, a, b) ((reals)_mm512_mask_blend_pd((__mmask8)(set), (__m512d)(b), (__m512d)(a)))
#define LANE(set, k) ((set) >> (k)&1)
#define LOOKS(state) _mm512_cmpge_epi64_mask(_mm512_loadu_si512(state), _mm512_set1_epi64(LOOK))
#include "geodesic/lanes_loop.h"
#define WIDE
#endif
#endif

/* ---- the engine's part -------------------------------------------------------------------------- */

/* The forms of the loop that the processor has, the fastest one last; how many. */
static int list_forms(advance *form[DMK_FORMS])
{
    int n = 0;
    form[n++] = advance_plain;
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx2")) form[n++] = advance_middle;
#endif
#ifdef WIDE
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw"))
        form[n++] = advance_wide;
#endif
    return n;
}

int dmk_lanes_create(dmk_context *ctx, engine *e)
{
    int rc;
    const size_t line = sizeof(stride);
    char *room = NULL;
    const int32_t n = e->front.g->mesh->n_triangles;
    DMK_TRY(DMK_NEW_UNSET(ctx, room, (3 * (size_t)n + 1) * line));
    e->room = room;
    e->stride = (stride *)(void *)(room + (line - (uintptr_t)room % line) % line);
    dmk_parallel(ctx, n, corner_range, e);
    dmk_parallel(ctx, n, beyond_range, e);
    advance *form[DMK_FORMS];
    const int n_forms = list_forms(form);
    e->advance = form[n_forms - 1];
done:
    return rc;
}

void dmk_lanes_free(engine *e)
{
    free(e->room);
}

/* ---- windows into lanes and out ------------------------------------------------------------------- */

/* Window one into lane i; false if its next step is not plain. Parallel rays have their root where the one
 * through the half-edge's start begins. */
static bool put(const engine *e, lanes *w, int i, const window *one)
{
    if (one->odd) return false;
    double lx = one->lo - one->x, hx = one->hi - one->x, base = one->base;
    double sx = -one->x, sy = -one->y;
    const double y = sy;
    if (one->parallel) {
        lx = hx = sx;
        sx *= base;
        sy *= base;
        base = 0;
    } else if (e->stride[one->half].here.q * one->length > (DMK_FARTHER - 1) * y) {
        return false;
    }
    const double lo = 1 / sqrt(lx * lx + y * y), hi = 1 / sqrt(hx * hx + y * y);
    w->lx[i] = lx * lo;
    w->ly[i] = y * lo;
    w->hx[i] = hx * hi;
    w->hy[i] = y * hi;
    w->sx[i] = sx;
    w->sy[i] = sy;
    w->vx[i] = one->length;
    w->vy[i] = 0;
    w->off_lo[i] = one->lo * (y * lo);
    w->off_hi[i] = one->hi * (y * hi);
    w->base[i] = base;
    w->turn[i] = one->turn;
    w->state[i] = PLAIN;
    w->at[i] = one->half;
    w->root[i] = one->root;
    w->parallel[i] = one->parallel;
    return true;
}

/* The half-edge of lane i, whose next step is not plain; -1 beyond a border. */
static int32_t half_of(const engine *e, const lanes *w, int i)
{
    const int32_t half = (int32_t)w->at[i], k = half % 3;
    if (w->state[i] == ODD) return half;
    return e->front.facet[half / 3].twin[(k + (w->state[i] == ODD_LEFT ? 2 : 1)) % 3];
}

/* The window of lane i, whose next step from that half-edge is not plain. */
static window get(const lanes *w, int i, int32_t half)
{
    double x = w->sx[i], y = w->sy[i], base = w->base[i];
    if (w->parallel[i]) {
        base = w->lx[i] * x + w->ly[i] * y;
        x = w->lx[i], y = w->ly[i];
    }
    const double vx = w->vx[i], vy = w->vy[i];
    const double length = sqrt(vx * vx + vy * vy), scale = 1 / length;
    const double lo = w->off_lo[i] / (w->ly[i] * vx - w->lx[i] * vy),
                 hi = w->off_hi[i] / (w->hy[i] * vx - w->hx[i] * vy);
    return (window){.lo = length * dmk_max(lo, 0),
                    .hi = length * dmk_min(hi, 1),
                    .x = -(x * vx + y * vy) * scale,
                    .y = -(y * vx - x * vy) * scale,
                    .base = base,
                    .turn = w->turn[i] + dmk_angle_of(vx, vy),
                    .length = length,
                    .half = half,
                    .root = w->root[i],
                    .odd = true,
                    .parallel = w->parallel[i]};
}

static const window *late_one(const worker *me, uint32_t i)
{
    return me->late + (me->oldest + i) % LATE;
}

static window take_late(worker *me)
{
    const window *w = late_one(me, 0);
    me->oldest = (me->oldest + 1) % LATE;
    me->n_late--;
    return *w;
}

/* A window whose next step is not plain waits: what the step reads is asked for, in two parts, as where the second lies
 * is in the first. */
static int delay(worker *me, const window *w)
{
    const dmk_front *front = &me->e->front;
    if (me->n_late == LATE) {
        const window first = take_late(me);
        const int rc = dmk_windows_push(me, &first);
        if (rc != DMK_OK) return rc;
    }
    me->late[(me->oldest + me->n_late++) % LATE] = *w;
    __builtin_prefetch(front->facet + w->half / 3);
    __builtin_prefetch(front->facet[w->half / 3].vertex);
    if (me->n_late > LATE / 2) {
        const int32_t half = late_one(me, LATE / 2 - 1)->half;
        const int32_t *vertex = front->facet[half / 3].vertex, *twin = front->facet[half / 3].twin;
        for (int k = 0; k < 3; k++) {
            __builtin_prefetch(front->d + vertex[k]);
            if (k != half % 3 && twin[k] >= 0) __builtin_prefetch(me->e->stride + twin[k]);
        }
        __builtin_prefetch(me->e->split + vertex[half % 3]);
        __builtin_prefetch(me->e->trace + vertex[half % 3]);
        __builtin_prefetch(&me->e->trace[vertex[half % 3]].root);
        __builtin_prefetch(front->g->star.corner_angle + (half - half % 3));
    }
    return DMK_OK;
}

/* The next window to run down; *any: false if there is none. */
static int take(worker *me, window *w, bool *any)
{
    int rc = DMK_OK;
    if (me->n_late < LATE && me->n_stack == 0 && me->shares) DMK_TRY(dmk_shares_take(me));
    *any = me->n_late > 0 || me->n_stack > 0;
    if (me->n_late == LATE || (me->n_late > 0 && me->n_stack == 0))
        *w = take_late(me);
    else if (*any)
        *w = me->stack[--me->n_stack];
done:
    return rc;
}

/* A window into empty lane i. Those whose step is not plain take it here. */
static int fill(worker *me, lanes *w, int i, bool *filled)
{
    int rc = DMK_OK, n;
    window one, o[2];
    *filled = false;
    while (!dmk_windows_spent(me->e)) {
        bool any;
        DMK_TRY(take(me, &one, &any));
        if (!any) break;
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
 * have dropped it; *n_short: steps of their last pairs that have led to no window. */
static int clear(worker *me, lanes *w, int *n_dropped, int *n_short)
{
    int rc = DMK_OK;
    *n_dropped = *n_short = 0;
    for (uint64_t set = w->look; set; set &= set - 1) {
        const int i = __builtin_ctzll(set);
        const int32_t half = w->state[i] == DROPPED ? -1 : half_of(me->e, w, i);
        *n_short += w->state[i] == ODD || half < 0 ? 2 : 1;
        if (half < 0) {
            ++*n_dropped;
        } else {
            const window one = get(w, i, half);
            DMK_TRY(delay(me, &one));
        }
        w->state[i] = EMPTY;
    }
    w->empty |= w->look;
done:
    return rc;
}

/* The filter's period from how many windows it drops. */
static void adapt(worker *me, lanes *w, int64_t n, int n_dropped)
{
    me->n_run += n;
    me->n_dropped += n_dropped;
    if (me->n_run < OFTEN) return;
    const int64_t period = me->n_run / (SHARE * (me->n_dropped + 1));
    me->period = w->period = period < 1 ? 1 : period > MOST ? MOST : (int)period;
    me->n_run = me->n_dropped = 0;
}

/* However many steps are taken at a time, a window changes between the forms of a lane and of the stack where its next
 * step is not plain, and only there: so its numbers do not depend on who runs it down, and when. */
int dmk_lanes_run(worker *me, int64_t most)
{
    /* Steps, between looks at a full limit: speed only, and the same with 32 or 128. */
    enum { AT_ONCE = 64 };
    int rc = DMK_OK, n_dropped, n_short;
    lanes w = {.empty = UINT64_MAX >> (64 - LANES), .period = me->period > 0 ? me->period : 1};
    const uint64_t all = w.empty;
    for (int i = 0; i < LANES; i++) w.state[i] = EMPTY;
    while (!dmk_windows_spent(me->e)) {
        bool filled = most > 0;
        for (uint64_t set = w.empty; set && filled; set &= set - 1) {
            const int i = __builtin_ctzll(set);
            DMK_TRY(fill(me, &w, i, &filled));
            if (filled) w.empty &= ~(UINT64_C(1) << i);
        }
        if (w.empty == all) break;
        const int64_t n =
            (int64_t)me->e->advance(me->e, &w, AT_ONCE) * __builtin_popcountll(all & ~w.empty);
        DMK_TRY(clear(me, &w, &n_dropped, &n_short));
        DMK_TRY(dmk_windows_count(me, n - n_short));
        adapt(me, &w, n, n_dropped);
        if (me->shares) DMK_TRY(dmk_shares_give(me));
        most -= n;
    }
    while (me->n_late > 0) {
        const window one = take_late(me);
        DMK_TRY(dmk_windows_push(me, &one));
    }
done:
    return rc;
}
