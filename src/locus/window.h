/* Shortest paths over the polyhedron, exactly, from one point to another. Internal to src/locus.
 *
 * A shortest path is straight across edges and bends at vertices only: at those with more than 2 pi
 * around them, and at reentrant ones of a border. All rays from one bend that cross the same edges
 * form a window on the last of these. Windows are continued from triangle to triangle, the nearest
 * first, and dropped where a path found already is shorter (Chen and Han's rule of one split for an
 * angle, Xin and Wang's filter), or where even the least length left leads beyond the bound. */
#ifndef DMK_LOCUS_WINDOW_H
#define DMK_LOCUS_WINDOW_H

#include "locus/locus.h"

/* The edge lies on the x axis from 0 to its length, as the triangle to be entered (above) runs it;
 * the bend is unfolded to (x, y), y < 0. */
typedef struct dmk_window {
    double lo, hi;  /* the part of the edge that the rays cross */
    double x, y;
    double base;    /* length of the path up to the bend */
    int32_t half;   /* half-edge 3t+k to be entered, opposite corner k of t */
    int32_t parent; /* window that it continues, -1: the bend is a corner opposite the edge */
    int32_t bend;   /* vertex, -1: the start */
    int32_t shared; /* the end in common with the parent's edge: 0 first, 1 second, -1 no parent */
} dmk_window;

/* How a point was reached: straight through `window`, or, if that is -1, inside a triangle of the
 * bend. */
typedef struct dmk_reach {
    double distance;
    int32_t window, bend;
} dmk_reach;

/* A point with the triangles it lies in: one, two on an edge, all around a vertex. */
typedef struct dmk_spot {
    int32_t n;
    dmk_point *in;  /* the point as seen from each of them */
    int32_t vertex; /* the vertex it is, or -1 */
} dmk_spot;

typedef struct dmk_queued {
    double key;
    int32_t item; /* window, or ~vertex that is a bend */
} dmk_queued;

/* The guide may be off by `part` of it and as many edges of the mesh. */
typedef struct dmk_trust {
    double part, edges;
} dmk_trust;

typedef struct dmk_search {
    const dmk_mesh *mesh;
    const int32_t *across; /* 3*n_triangles: half-edge on the other side, -1 on a border */
    const double *guide;   /* n_vertices: distance to the goal, nearly */
    dmk_vertex_stars fan;
    bool *bends;      /* n_vertices: paths may bend here */
    double mean;      /* edge */
    const dmk_trust *trust;
    double eps, bound; /* lengths: equal up to eps; nothing beyond the bound */
    double goal_xyz[3];
    dmk_spot start, goal;
    dmk_reach end;    /* how the goal was reached */
    uint32_t round;   /* of the arrays below, what is of another round counts as not set */
    uint32_t *vertex_round, *half_round;
    dmk_reach *reach; /* n_vertices */
    double *split;    /* 2*3*n_triangles: for the angle opposite a half-edge, the shortest length to
                         its vertex and where that path crosses the half-edge */
    dmk_window *window;
    dmk_queued *queue; /* heap, the least first */
    size_t n_windows, window_capacity, n_queued, queue_capacity;
} dmk_search;

int dmk_search_create(dmk_context *ctx, const dmk_locus_input *in, const int32_t *across,
                      dmk_search *search);
void dmk_search_free(dmk_search *search);

/* Corner k of triangle t as seen from its edge k, half = 3t+k, which runs from (0, 0) to (length, 0). */
void dmk_corner_above(const dmk_mesh *mesh, int32_t half, double *x, double *y);

/* spot.c: all triangles of a point. `fan` is that of the mesh. */
int dmk_spot_set(dmk_context *ctx, const dmk_mesh *mesh, const int32_t *across, const dmk_vertex_stars *fan,
                 const dmk_point *point, dmk_spot *spot);

/* From search->start, which shares no triangle with search->goal, to the goal: search->end and
 * search->reach then lead back. */
int dmk_search_run(dmk_context *ctx, dmk_search *search);

#endif
