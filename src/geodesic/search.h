/* The search that paths and repairs begin with: windows from a point back to the next pseudo-source or source.
 * Internal to src/geodesic. */
#ifndef DMK_GEODESIC_SEARCH_H
#define DMK_GEODESIC_SEARCH_H

#include "geodesic/front.h"
#include "geodesic/trace.h"

/* A source inside a triangle or on an edge, as one of its triangles sees it. */
typedef struct source_point {
    int32_t triangle, source;
    double weight[3];
} source_point;

/* An interval of a half-edge seen straight from the point, unfolded at (x, y), y < 0. */
typedef struct sight {
    double lo, hi, x, y;
    double least; /* length of a way through it */
    int32_t half, parent;
    bool right; /* through which side of the parent's triangle */
} sight;

/* How the best way ends: at a vertex, or else at a source that is none, at `foot` if that is a line; seen through a
 * window, or else within the point's own triangles, `triangle` then. */
typedef struct finish {
    double length, key;
    int32_t window, vertex, source, triangle;
    dmk_point foot; /* in the last triangle that the way enters */
} finish;

struct dmk_tracer {
    const dmk_geodesics *g;
    source_point *point; /* by triangle */
    size_t n_points;
    int32_t vertex; /* that is the point asked for, or -1 */
    int32_t own[2]; /* else the triangles that it lies in, or -1 */
    sight *sight;
    size_t n_sights, room, most; /* most: that are kept */
    finish best;
    double bound; /* nothing longer is of use */
    double slack; /* nor what is shorter than `bound` by less than this */
    double lost;  /* the least length of a way that there was no room for */
    double least; /* of the ways to a source or a bend, less what is in doubt there */
};

/* The triangle above half-edge h, with its base on the x axis from (0, 0). */
typedef struct angle {
    double length, left, right, ca, sa, cb, sb, cx, cy;
    int32_t a, b, c;
} angle;

/* What may be wrong with the distance at a vertex: merged windows estimate their errors. Not more than that, as paths
 * are looked for as wide as the root of it: of a million triangles, a vertex whose error is 1e-5 takes 200,000
 * windows. */
static inline double dmk_search_doubt(const dmk_geodesics *g, int32_t v)
{
    return g->error ? g->error[v] / g->star.unit : 0;
}

/* Whether a way that there was no room for may be shorter than the best one found. */
static inline bool dmk_search_lost(const dmk_tracer *t)
{
    return t->lost <= t->bound - t->slack;
}

static inline dmk_point dmk_corner_point(const dmk_geodesics *g, int32_t v)
{
    int32_t c = g->star.first[v];
    dmk_point p = {.triangle = c / 3};
    p.weight[c % 3] = 1;
    return p;
}

/* The triangles that a site lies in and its weights there: at a vertex all around, two on an edge. */
size_t dmk_site_points(const dmk_geodesics *g, const dmk_site *site, int32_t number,
                       source_point *to);
void dmk_angle_above(const dmk_geodesics *g, int32_t h, angle *s);
/* Weights of the triangle above half-edge h, in its frame. */
void dmk_place_above(int32_t h, const angle *s, const double weight[3], double *x, double *y);
/* The first of the sources inside a triangle, if there are some. */
size_t dmk_first_point(const dmk_tracer *t, int32_t triangle);
/* The end of the first straight piece of the way back from the site, in t->best, as far as there is room for ways. */
int dmk_search_best(dmk_context *context, dmk_tracer *tracer, const dmk_site *site);
/* The same; DMK_E_MESH if there is no room for all that may be the shortest. */
int dmk_search(dmk_context *context, dmk_tracer *tracer, const dmk_site *site);

#endif
