/* Windows side by side, a lane each: what lanes.c and its loop, lanes_loop.h, share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_LANES_H
#define DMK_GEODESIC_LANES_H

#include "geodesic/window_engine.h"

/* While one vector of lanes computes, what the others need is on its way from memory: distances of 273k triangles, two
 * threads, vectors of 512 bits: 16 lanes 116 ms, 24 110, 32 106, 48 102, 64 103. Speed only: a lane's numbers do not
 * depend on its neighbours. */
enum { LANES = 48 };

/* Which windows are of no use is seen in looks, each as long as a step; they run on until the next one. So many pairs
 * of steps lie between two looks that one window in 2 SHARE is dropped at each, MOST at most; this is set anew after
 * OFTEN steps of windows. Distances of 273k triangles and of six scans, two threads, SHARE 4 / 6 / 9 / 12: 1.017, 1,
 * 0.988 and 1.013; MOST 4 / 8 / 16, the first alone: 163, 157, 162 ms. A look in each step takes twice as long, and a
 * sphere of 1 : 10,000 makes twice as many windows with rare ones. Speed only: what is dropped late gives no vertex its
 * distance. */
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
    bool parallel[LANES];
    uint64_t look; /* dropped or odd since the last look */
    uint64_t empty;
    int since, period; /* steps: since the last filter, and from one to the next */
} lanes;
_Static_assert(LANES <= 64, "a set of lanes fits into its type");

/* Beyond a border there is no half-edge: all 32 bits. */
#define DMK_NOWHERE ((int64_t)UINT32_MAX)

#endif
