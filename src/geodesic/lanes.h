/* Windows side by side, a lane each: what lanes.c and its loop, lanes_loop.h, share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_LANES_H
#define DMK_GEODESIC_LANES_H

#include "geodesic/window.h"

/* While one vector of lanes computes, what the others need is on its way from memory: 136k vertices, two threads,
 * vectors of 512 bits: 24 lanes 3.4 ns a step, 32 3.1, 48 or 64 3.0. Speed only: a lane's numbers do not depend on its
 * neighbours. */
enum { LANES = 32 };

/* Which windows are of no use is seen in looks, each as long as a step; they run on until the next one. So many steps
 * lie between two looks that one window in SHARE is dropped at each, MOST at most; this is set anew after OFTEN steps
 * of windows. Quartic of 273k triangles, two threads, one in 6 / 10 / 20: 104, 109 and 118 ms, a look in each 4th / 8th
 * step always: 119 and 107; armadillo 73, 83, 84, 70 and 78; a sphere of 1 : 10,000 makes twice as many windows with
 * the last. Speed only: what is dropped late gives no vertex its distance. */
enum { SHARE = 9, MOST = 8, OFTEN = 4096 };

/* Where the corner above may be more than so many times as far from the root as the half-edge, as next to the root, a
 * step is not plain: paths around the end of an interval (reach_around of step.c), which plain steps leave out, would
 * count there far beside the rays (test_depth.c). */
#define DMK_FARTHER 4

/* Of a lane: to go on; no window; and, to be looked at: no shortest path among its rays; to go on by step.c, from the
 * half-edge `at`, or from the next one on the left or right side. */
enum { PLAIN, EMPTY, LOOK, DROPPED = LOOK, ODD, ODD_LEFT, ODD_RIGHT };

/* Windows as their roots see them: the root is the origin, and nothing turns but the half-edge. Sets of lanes have bit
 * i for lane i. */
typedef struct lanes {
    /* the first and the last ray, of length 1 */
    _Alignas(64) double lx[LANES], ly[LANES], hx[LANES], hy[LANES];
    /* the half-edge's start, and its end from there */
    double sx[LANES], sy[LANES], vx[LANES], vy[LANES];
    double off_lo[LANES], off_hi[LANES]; /* how far the start is to the left of them */
    double base[LANES], turn[LANES];
    int64_t state[LANES];
    int64_t at[LANES]; /* the half-edge */
    int32_t root[LANES];
    uint32_t look; /* dropped or odd since the last look */
    uint32_t empty;
    int since, period; /* steps: since the last filter, and from one to the next */
} lanes;
_Static_assert(LANES <= 32, "a set of lanes fits into its type");

/* Beyond a border there is no half-edge: all 32 bits. */
#define DMK_NOWHERE ((int64_t)UINT32_MAX)

#endif
