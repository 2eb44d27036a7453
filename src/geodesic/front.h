/* What the engines of window.c share with those that seed them. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_FRONT_H
#define DMK_GEODESIC_FRONT_H

#include "geodesic/geodesic.h"

/* Everything about a triangle in two cache lines. Half-edge h lies on the x axis from a (0, 0) to b
 * (length, 0), with the opposite corner c above; rays enter upwards. */
typedef struct dmk_facet {
    double length[3], cosine[3], sine[3], angle[3]; /* of side k; of the angle at corner k */
    int32_t vertex[3], twin[3];
    double unused;
} dmk_facet;

/* An interval of a half-edge, all of whose points see the last bend (or source) straight, unfolded
 * at (x, y), y < 0. */
typedef struct dmk_window {
    double lo, hi, x, y;
    double base; /* length of the path up to the bend */
    double turn; /* direction at the source of the frame's x axis; of no meaning behind a bend */
    int32_t half;
    int32_t root; /* vertex that the path bends at, or ~number of the source */
} dmk_window;

/* The path that gave a vertex its distance. */
typedef struct dmk_trace {
    double at;    /* where it crosses the half-edge */
    double x, y;  /* from the bend to the vertex, in the frame of the half-edge; else directions at
                     source, vertex */
    double turn;  /* of the window */
    int32_t half; /* entered last; one of the two below */
    int32_t root; /* of the window */
} dmk_trace;
enum {
    DMK_UNREACHED = -2,
    DMK_STRAIGHT = -1
}; /* only bounded so far; by no window: inside the source's triangle,
      or along an edge from the bend */

#endif
