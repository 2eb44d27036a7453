/* The loop of plain steps, two at a time. It is compiled once for each kind of vector, since compilers take vectors
 * apart before they put functions in line: lanes.c includes it with FORM(name), what names become; FOR, the attributes
 * of functions; and VECTOR, the vectors' size in bytes; SET and what goes with it, FETCH and LOOKS if there are better
 * ways for these vectors. All forms do the same operations on each lane. */
#include "geodesic/lanes.h"

#ifdef FORM /* alone it is nothing */

#undef INLINE
#define INLINE static inline __attribute__((always_inline))

/* Of each lane a number; a whole number; bits. */
typedef double FORM(reals) __attribute__((vector_size(VECTOR), may_alias));
typedef int64_t FORM(integers) __attribute__((vector_size(VECTOR), may_alias));
typedef uint64_t FORM(patterns) __attribute__((vector_size(VECTOR), may_alias));
#define reals FORM(reals)
#define integers FORM(integers)
#define patterns FORM(patterns)
#define fields FORM(fields)
#define place FORM(place)
#define view FORM(view)
#define passed FORM(passed)
#define sides FORM(sides)
enum { FORM(WIDTH) = VECTOR / sizeof(double) };

/* A set of lanes is what a comparison leaves, all bits or none. SELECT: of each lane a where the set has it, else b. */
#ifndef SET
#define SET integers
#define LESS(a, b) ((a) < (b))
#define AT_LEAST(a, b) ((a) >= (b))
#define EQUAL(a, b) ((a) == (b))
#define SELECT(set, a, b) ((reals)(((set) & (integers)(a)) | (~(set) & (integers)(b))))
#endif

/* A field of w from lane i on; the same for all lanes. */
#undef REALS
#undef INTEGERS
#undef ALL
#define REALS(field) (*(reals *)(void *)(w->field + i))
#define INTEGERS(field) (*(integers *)(void *)(w->field + i))
#define ALL(whole) ((integers){0} + (whole))

/* The strides of lanes, field by field. */
typedef struct fields {
    reals along, q, left_along, left_q, right_along, right_q;
    integers next_left, next_right;
} fields;

/* A corner seen from a half-edge's start, and the half-edge's end from there. */
typedef struct place {
    reals x, y, to_x, to_y;
} place;

/* A half-edge as the lanes have it. */
typedef struct view {
    reals sx, sy, vx, vy, off_lo, off_hi;
} view;

/* What the first step has passed: the half-edge it began at; whether the triangle's corner above lies to the left of
 * the rays; the corner that is not on the next half-edge, seen from the start of that; and the next half-edge. */
typedef struct passed {
    integers at;
    SET left;
    reals x, y;
    view next;
} passed;

/* What the filter asks of the mesh. */
typedef struct sides {
    reals length;            /* of the half-edge */
    reals start, end, other; /* distances of the corners of the triangle behind it */
} sides;

FOR INLINE fields FORM(fetch)(const engine *e, const lanes *w, int i)
{
#ifdef FETCH
    reals field[8];
    FETCH(e->stride, w->at + i, field);
#else
    _Alignas(VECTOR) double row[8][FORM(WIDTH)];
    for (int k = 0; k < FORM(WIDTH); k++) {
        const real_or_whole *s = (const void *)(e->stride + w->at[i + k]);
        for (int j = 0; j < 8; j++) row[j][k] = s[j];
    }
    const reals *field = (const void *)row;
#endif
    return (fields){field[0], field[1], field[2],           field[3],
                    field[4], field[5], (integers)field[6], (integers)field[7]};
}

FOR INLINE place FORM(corner_at)(reals along, reals q, const view *h)
{
    const reals other = 1 - along, qx = q * h->vx, qy = q * h->vy;
    const SET turned = EQUAL((integers)along & 1, ALL(1));
    const reals p = SELECT(turned, other, along), rest = SELECT(turned, along, other);
    return (place){p * h->vx - qy, p * h->vy + qx, rest * h->vx + qy, rest * h->vy - qx};
}

/* A step of the lanes that `go`, which are those then whose step is plain; *left: with the corner c on the left of
 * their rays. A step is not plain where the corner passes a ray by less than paths around its end ask for, which is
 * more at the corner than on the half-edge. At the shortest edges rounding, which goes with the mesh's extent, is more.
 */
FOR INLINE view FORM(step)(const lanes *w, int i, const view *h, const place *c, SET *go, SET *left)
{
    const reals lo = h->off_lo + (REALS(lx) * c->y - REALS(ly) * c->x),
                hi = h->off_hi + (REALS(hx) * c->y - REALS(hy) * c->x);
    const integers positive = ALL(INT64_MAX);
    const reals size = (reals)((integers)h->vx & positive) + (reals)((integers)h->vy & positive);
    *left = LESS((reals){0}, lo);
    *go = (SET)(*go & AT_LEAST(SELECT(*left, lo, -hi),
                               DMK_FARTHER * DMK_BESIDE * size + DMK_SAME_LENGTH));
    const SET shift = (SET)(*go & *left);
    return (view){SELECT(shift, h->sx + c->x, h->sx),
                  SELECT(shift, h->sy + c->y, h->sy),
                  SELECT(*go, SELECT(*left, c->to_x, c->x), h->vx),
                  SELECT(*go, SELECT(*left, c->to_y, c->y), h->vy),
                  SELECT(shift, lo, h->off_lo),
                  SELECT(shift, hi, h->off_hi)};
}

/* Two steps of each lane, if they are plain. */
FOR INLINE passed FORM(stride_on)(lanes *w, int i, const fields *f)
{
    const integers was = INTEGERS(state), at = INTEGERS(at);
    const view now = {REALS(sx), REALS(sy), REALS(vx), REALS(vy), REALS(off_lo), REALS(off_hi)};
    const SET lives = EQUAL(was, ALL(PLAIN));
    SET first = lives, left, turn;
    const place c = FORM(corner_at)(f->along, f->q, &now);
    const view middle = FORM(step)(w, i, &now, &c, &first, &left);
    SET second = first;
    const place d = FORM(corner_at)(SELECT(left, f->right_along, f->left_along),
                                    SELECT(left, f->right_q, f->left_q), &middle);
    const view end = FORM(step)(w, i, &middle, &d, &second, &turn);
    REALS(sx) = end.sx;
    REALS(sy) = end.sy;
    REALS(vx) = end.vx;
    REALS(vy) = end.vy;
    REALS(off_lo) = end.off_lo;
    REALS(off_hi) = end.off_hi;
    const patterns link = (patterns)SELECT(left, f->next_right, f->next_left);
    const integers next = (integers)SELECT(turn, link >> 32, link & DMK_NOWHERE);
    const SET border = EQUAL(next, ALL(DMK_NOWHERE)), goes = (SET)(second & ~border);
    INTEGERS(at) = (integers)SELECT(goes, next, at);
    const reals half = SELECT(left, ALL(ODD_RIGHT), ALL(ODD_LEFT)),
                ends = SELECT(second, ALL(DROPPED), SELECT(first, half, ALL(ODD)));
    INTEGERS(state) = (integers)SELECT(lives, SELECT(goes, ALL(PLAIN), ends), was);
    return (passed){at, left, SELECT(left, -c.x, now.vx), SELECT(left, -c.y, now.vy), middle};
}

FOR INLINE sides FORM(look_behind)(const engine *e, const passed *p)
{
    /* The corners at the start and the end of the next half-edge, and the other one: for three half-edges whose rays
     * leave the corner above on their right, and for three that leave it on their left. */
    static const uint8_t corners[6][3] = {{1, 0, 2}, {2, 1, 0}, {0, 2, 1},
                                          {0, 2, 1}, {1, 0, 2}, {2, 1, 0}};
    const reals zero = {0};
    sides s = {zero, zero, zero, zero};
    for (int k = 0; k < FORM(WIDTH); k++) {
        const uint32_t at = (uint32_t)p->at[k], t = at / 3;
        const uint8_t *c = corners[at - 3 * t + (LANE(p->left, k) ? 3 : 0)];
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
    const view *h = &p->next;
    const reals base = REALS(base) - DMK_SAME_LENGTH, none = {0}, all = none + 1;
    const reals lo = 1 / (REALS(ly) * h->vx - REALS(lx) * h->vy),
                hi = 1 / (REALS(hy) * h->vx - REALS(hx) * h->vy);
    /* Where the rays cross the half-edge, over its length; and at which distances. Where they graze it the places are
     * rough, but the distances are those of these places. */
    const reals by_lo = h->off_lo * lo, by_hi = h->off_hi * hi;
    const reals at_lo = SELECT(LESS(none, by_lo), by_lo, none),
                at_hi = SELECT(LESS(by_hi, all), by_hi, all);
    const reals lo_x = h->sx + at_lo * h->vx, lo_y = h->sy + at_lo * h->vy,
                hi_x = h->sx + at_hi * h->vx, hi_y = h->sy + at_hi * h->vy;
    const reals d_lo = base + (REALS(lx) * lo_x + REALS(ly) * lo_y),
                d_hi = base + (REALS(hx) * hi_x + REALS(hy) * hi_y);
    const reals at = SELECT(p->left, at_hi, at_lo), late = SELECT(p->left, d_hi, d_lo) - s->other;
    const reals x = p->x - at * h->vx, y = p->y - at * h->vy;
    const SET lives = (SET)(LESS(none + DMK_NO_WIDTH, at_hi - at_lo) & LESS(none, lo) &
                            LESS(d_lo, s->end + (1 - at_lo) * s->length) &
                            LESS(d_hi, s->start + at_hi * s->length) &
                            (AT_LEAST(none, late) | AT_LEAST(x * x + y * y, late * late)));
    const integers state = INTEGERS(state);
    INTEGERS(state) = (integers)SELECT(EQUAL(state, ALL(PLAIN)) & ~lives, ALL(DROPPED), state);
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

/* Steps of all lanes, two by two, until there is one to look at, `most` at most; their number. */
FOR static int FORM(advance)(const engine *e, lanes *w, int most)
{
    int n = 0;
    for (w->look = 0; w->look == 0 && n < most; n += 2) {
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
            w->look |= (uint64_t)FORM(looks)(w, i) << i;
        }
    }
    return n;
}

#undef reals
#undef integers
#undef patterns
#undef fields
#undef place
#undef view
#undef passed
#undef sides
#undef SET
#undef LESS
#undef AT_LEAST
#undef EQUAL
#undef SELECT
#undef FORM
#undef FOR
#undef VECTOR
#undef LANE
#endif
