/* The loop of plain steps. It is compiled once for each kind of vector, since compilers take vectors apart before they
 * put functions in line: lanes.c includes it with FORM(name), what names become; FOR, the attributes of functions; and
 * VECTOR, the vectors' size in bytes; FETCH and LOOKS if there are better ways for these vectors. All forms do the same
 * operations on each lane. */
#include "geodesic/lanes.h"

#ifdef FORM /* alone it is nothing */

#undef INLINE
#define INLINE static inline __attribute__((always_inline))

/* Of each lane a number; a whole number, or what a comparison leaves, all bits or none; bits. */
typedef double FORM(reals) __attribute__((vector_size(VECTOR), may_alias));
typedef int64_t FORM(integers) __attribute__((vector_size(VECTOR), may_alias));
typedef uint64_t FORM(patterns) __attribute__((vector_size(VECTOR), may_alias));
#define reals FORM(reals)
#define integers FORM(integers)
#define patterns FORM(patterns)
#define fields FORM(fields)
#define passed FORM(passed)
#define sides FORM(sides)
enum { FORM(WIDTH) = VECTOR / sizeof(double) };

/* A field of w from lane i on; and of each lane a where the set has it, else b. */
#undef REALS
#undef INTEGERS
#undef SELECT
#define REALS(field) (*(reals *)(void *)(w->field + i))
#define INTEGERS(field) (*(integers *)(void *)(w->field + i))
#define SELECT(set, a, b) ((reals)(((set) & (integers)(a)) | (~(set) & (integers)(b))))

/* The strides of lanes, field by field. */
typedef struct fields {
    reals p, q, rest;
    integers next;
} fields;

/* What a step has passed: the half-edge it began at; whether the triangle's corner above lies to the left of the rays;
 * and the corner that is not on the next half-edge, seen from the start of that. */
typedef struct passed {
    integers at, left;
    reals x, y;
} passed;

/* What the filter asks of the mesh. */
typedef struct sides {
    reals length;            /* of the half-edge */
    reals start, end, other; /* distances of the corners of the triangle behind it */
} sides;

FOR INLINE fields FORM(fetch)(const engine *e, const lanes *w, int i)
{
#ifdef FETCH
    reals field[4];
    FETCH(e->stride, w->at + i, field);
    return (fields){field[0], field[1], field[2], (integers)field[3]};
#else
    _Alignas(VECTOR) double p[FORM(WIDTH)], q[FORM(WIDTH)], rest[FORM(WIDTH)];
    _Alignas(VECTOR) int64_t next[FORM(WIDTH)];
    for (int k = 0; k < FORM(WIDTH); k++) {
        const stride *s = e->stride + w->at[i + k];
        p[k] = s->p;
        q[k] = s->q;
        rest[k] = s->rest;
        next[k] = s->next;
    }
    return (fields){*(reals *)(void *)p, *(reals *)(void *)q, *(reals *)(void *)rest,
                    *(integers *)(void *)next};
#endif
}

/* One step of each lane. A step is not plain where the corner passes a ray by less than paths around its end ask for,
 * which is more at the corner than on the half-edge. At the shortest edges rounding, which goes with the mesh's extent,
 * is more. */
FOR INLINE passed FORM(stride_on)(lanes *w, int i, const fields *f)
{
    const reals vx = REALS(vx), vy = REALS(vy), qx = f->q * vx, qy = f->q * vy;
    /* from the start to the corner above; from there to the end */
    const reals cx = f->p * vx - qy, cy = f->p * vy + qx, ex = f->rest * vx + qy,
                ey = f->rest * vy - qx;
    const reals start_lo = REALS(off_lo), start_hi = REALS(off_hi);
    const reals lo = start_lo + (REALS(lx) * cy - REALS(ly) * cx),
                hi = start_hi + (REALS(hx) * cy - REALS(hy) * cx);
    const integers was = INTEGERS(state), at = INTEGERS(at), left = lo > 0,
                   positive = (integers){0} + INT64_MAX;
    const reals size = (reals)((integers)vx & positive) + (reals)((integers)vy & positive);
    const integers plain =
        SELECT(left, lo, -hi) >= DMK_FARTHER * DMK_BESIDE * size + DMK_SAME_LENGTH;
    const integers next = (integers)SELECT(left, (patterns)f->next >> 32, f->next & DMK_NOWHERE);
    const integers goes = (was == PLAIN) & plain & (next != DMK_NOWHERE), shifts = goes & left;
    REALS(sx) = SELECT(shifts, REALS(sx) + cx, REALS(sx));
    REALS(sy) = SELECT(shifts, REALS(sy) + cy, REALS(sy));
    REALS(vx) = SELECT(goes, SELECT(left, ex, cx), vx);
    REALS(vy) = SELECT(goes, SELECT(left, ey, cy), vy);
    REALS(off_lo) = SELECT(shifts, lo, start_lo);
    REALS(off_hi) = SELECT(shifts, hi, start_hi);
    INTEGERS(at) = (integers)SELECT(goes, next, at);
    const integers ends = (integers)SELECT(plain, (integers){0} + DROPPED, (integers){0} + ODD);
    INTEGERS(state) = (integers)SELECT(was == PLAIN, ~goes & ends, was);
    return (passed){at, left, SELECT(left, -cx, vx), SELECT(left, -cy, vy)};
}

FOR INLINE sides FORM(look_behind)(const engine *e, const passed *p)
{
    /* The corners at the start and the end of the next half-edge, and the other one: for three half-edges whose rays
     * leave the corner above on their right, and for three that leave it on their left. */
    static const uint8_t corner[6][3] = {{1, 0, 2}, {2, 1, 0}, {0, 2, 1},
                                         {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    const reals zero = {0};
    sides s = {zero, zero, zero, zero};
    for (int k = 0; k < FORM(WIDTH); k++) {
        const uint32_t at = (uint32_t)p->at[k], t = at / 3;
        const uint8_t *c = corner[at - 3 * t + (3 & (uint32_t)p->left[k])];
        const dmk_facet *f = e->front.facet + t;
        s.length[k] = f->length[c[2]];
        s.start[k] = dmk_windows_known(e, f->vertex[c[0]]);
        s.end[k] = dmk_windows_known(e, f->vertex[c[1]]);
        s.other[k] = dmk_windows_known(e, f->vertex[c[2]]);
    }
    return s;
}

/* Windows may hold a shortest path yet, unless a way over a vertex of the triangle behind is shorter for all of their
 * rays. */
FOR INLINE void FORM(filter)(lanes *w, int i, const passed *p, const sides *s)
{
    const reals vx = REALS(vx), vy = REALS(vy), base = REALS(base) - DMK_SAME_LENGTH;
    const reals lo = 1 / (REALS(ly) * vx - REALS(lx) * vy),
                hi = 1 / (REALS(hy) * vx - REALS(hx) * vy);
    const reals height = REALS(sy) * vx - REALS(sx) * vy;
    /* Where the rays cross the half-edge, over its length; and at which distances. Where they graze it the places are
     * rough, but the distances are those of these places. */
    const reals by_lo = REALS(off_lo) * lo, by_hi = REALS(off_hi) * hi, none = {0}, all = none + 1;
    const reals at_lo = SELECT(by_lo > 0, by_lo, none), at_hi = SELECT(by_hi < 1, by_hi, all);
    const reals lo_x = REALS(sx) + at_lo * vx, lo_y = REALS(sy) + at_lo * vy,
                hi_x = REALS(sx) + at_hi * vx, hi_y = REALS(sy) + at_hi * vy;
    const reals d_lo = base + (REALS(lx) * lo_x + REALS(ly) * lo_y),
                d_hi = base + (REALS(hx) * hi_x + REALS(hy) * hi_y);
    const reals at = SELECT(p->left, at_hi, at_lo), late = SELECT(p->left, d_hi, d_lo) - s->other;
    const reals x = p->x - at * vx, y = p->y - at * vy;
    const integers lives =
        (at_hi - at_lo > DMK_NO_WIDTH) & (height > 0) & (s->end + (1 - at_lo) * s->length > d_lo) &
        (s->start + at_hi * s->length > d_hi) & ((late <= 0) | (x * x + y * y >= late * late));
    INTEGERS(state) |= (INTEGERS(state) == PLAIN) & ~lives & DROPPED;
}

/* To come: the strides, and the triangles before a filter. */
FOR INLINE void FORM(prefetch)(const engine *e, const int64_t *at, bool triangles)
{
    for (int k = 0; k < FORM(WIDTH); k++) __builtin_prefetch(e->stride + at[k]);
    for (int k = 0; triangles && k < FORM(WIDTH); k++) {
        const dmk_facet *f = e->front.facet + (uint32_t)at[k] / 3;
        __builtin_prefetch(f);
        __builtin_prefetch(f->vertex);
    }
}

FOR INLINE uint32_t FORM(looks)(const lanes *w, int i)
{
#ifdef LOOKS
    return LOOKS(w->state + i);
#else
    uint32_t set = 0;
    for (int k = 0; k < FORM(WIDTH); k++) set |= (uint32_t)(w->state[i + k] >= LOOK) << k;
    return set;
#endif
}

/* Steps of all lanes until there is one to look at, `most` at most; their number. */
FOR static int FORM(advance)(const engine *e, lanes *w, int most)
{
    int n = 0;
    for (w->look = 0; w->look == 0 && n < most; n++) {
        const bool filters = ++w->since >= w->period, soon = w->since + 1 == w->period;
        if (filters) w->since = 0;
        for (int i = 0; i < LANES; i += FORM(WIDTH)) {
            const fields f = FORM(fetch)(e, w, i);
            const passed p = FORM(stride_on)(w, i, &f);
            FORM(prefetch)(e, w->at + i, soon || w->period == 1);
            if (filters) {
                const sides s = FORM(look_behind)(e, &p);
                FORM(filter)(w, i, &p, &s);
            }
            w->look |= FORM(looks)(w, i) << i;
        }
    }
    return n;
}

#undef reals
#undef integers
#undef patterns
#undef fields
#undef passed
#undef sides
#endif
