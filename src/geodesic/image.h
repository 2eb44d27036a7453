/* Families of shortest paths as an edge sees them: what vertices know of their paths, unfolded beside it. In line, for
 * the loops over all edges. */
#ifndef DMK_GEODESIC_IMAGE_H
#define DMK_GEODESIC_IMAGE_H

#include "base/heading.h"
#include "geodesic/geodesic.h"

#include <math.h>

/* The last pseudo-source of a family (or the source), unfolded into the frame of half-edge h: h runs along the x axis
 * from (0, 0), its triangle lies above. The family's length at a point of the frame is `before` plus the distance
 * from here. In the star's unit. */
typedef struct dmk_image {
    double x, y, before;
} dmk_image;

/* In the star's unit: a power of two, of which the inverse does as well. */
static inline double dmk_in_units(const dmk_geodesics *g, double length)
{
    return length * (1 / g->star.unit);
}

/* How a family arrives at a vertex, seen along an edge: from the direction `turn` to it, of length `way`. */
typedef struct dmk_ray {
    double turn, way, before;
} dmk_ray;

/* The family that arrives at v so, seen from v along an edge whose direction at v is `along`. */
static inline dmk_ray dmk_ray_from(const dmk_geodesics *g, int32_t v, const dmk_arrival *a,
                                   double along)
{
    const double turn = g->star.total[v];
    double b = a->back - along;
    /* the nearest to 0: a->back and `along` lie in [0, turn] */
    if (!g->star.border[v]) b -= turn * ((b > 0.5 * turn) - (b < -0.5 * turn));
    double before = a->source < 0 ? 0 : g->source[a->source].offset;
    if (a->pseudo_source >= 0) before = g->distance[a->pseudo_source];
    return (dmk_ray){b, dmk_in_units(g, g->distance[v] - before), dmk_in_units(g, before)};
}

/* Its image, seen so. */
static inline dmk_image dmk_image_from(const dmk_geodesics *g, int32_t v, const dmk_arrival *a,
                                       double along)
{
    const dmk_ray ray = dmk_ray_from(g, v, a, along);
    const dmk_heading to = dmk_heading_of(ray.turn);
    return (dmk_image){ray.way * to.x, ray.way * to.y, ray.before};
}

/* Length of half-edge h in the star's unit. */
static inline double dmk_length_of(const dmk_geodesics *g, int32_t h)
{
    return dmk_in_units(g, g->mesh->length[g->mesh->triangle_edge[h]]);
}

/* In the frame of half-edge h: of a path that arrives at its start; at its end, from where the edge runs the other
 * way. */
static inline dmk_image dmk_image_from_start(const dmk_geodesics *g, int32_t h,
                                             const dmk_arrival *a)
{
    const int32_t c = dmk_next(h);
    return dmk_image_from(g, g->mesh->triangle[c], a, g->star.angle[c]);
}

static inline dmk_image dmk_image_from_end(const dmk_geodesics *g, int32_t h, const dmk_arrival *a)
{
    const int32_t c = dmk_previous(h);
    dmk_image i =
        dmk_image_from(g, g->mesh->triangle[c], a, g->star.angle[c] + g->star.corner_angle[c]);
    i.x = dmk_length_of(g, h) - i.x;
    i.y = -i.y;
    return i;
}

/* The same of the vertex's own path. */
static inline dmk_image dmk_image_at_start(const dmk_geodesics *g, int32_t h)
{
    return dmk_image_from_start(g, h, g->arrival + g->mesh->triangle[dmk_next(h)]);
}

static inline dmk_image dmk_image_at_end(const dmk_geodesics *g, int32_t h)
{
    return dmk_image_from_end(g, h, g->arrival + g->mesh->triangle[dmk_previous(h)]);
}

/* The family's length at a point of the frame. */
static inline double dmk_image_length(const dmk_image *i, double x, double y)
{
    return i->before + sqrt((x - i->x) * (x - i->x) + (y - i->y) * (y - i->y));
}

/* Corner of h's triangle opposite it, in the frame of h and the star's unit. */
static inline void dmk_apex(const dmk_geodesics *g, int32_t h, double *x, double *y)
{
    const double base = dmk_length_of(g, h),
                 area = dmk_in_units(g, dmk_in_units(g, g->mesh->area[h / 3]));
    const double a = dmk_length_of(g, dmk_previous(h)), b = dmk_length_of(g, dmk_next(h));
    *x = 0.5 * (base + (a - b) * (a + b) / base);
    *y = 2 * area / base;
}

/* x on an edge of that length: what is beside an end by rounding is there. */
static inline double dmk_snap(double x, double length)
{
    const double beside = 1e-12 * length;
    const bool is_start = x < beside;
    const bool is_end = x > length - beside;
    const double end = is_end ? length : x;
    return is_start ? 0 : end;
}

/* x where the images are equally far. */
static inline double dmk_equally_far(const dmk_image *a, const dmk_image *b)
{
    return 0.5 * (b->x * b->x + b->y * b->y - a->x * a->x - a->y * a->y) / (b->x - a->x);
}

/* Where between the ends of an edge families that begin alike are equally long; NAN: they do not, or nowhere there. */
static inline double dmk_meeting_alike(const dmk_image *a, const dmk_image *b, double length)
{
    const double x = dmk_equally_far(a, b), at = dmk_snap(x, length);
    const bool is_between = (a->before == b->before) & (b->x > a->x) & (x > 0) & (x < length);
    return is_between ? at : NAN;
}

/* The angle between two families at a point; none where one of them begins. */
static inline double dmk_meeting_angle(const dmk_image *a, const dmk_image *b, double x, double y)
{
    const double ax = a->x - x, ay = a->y - y, bx = b->x - x, by = b->y - y, cx = ax - bx,
                 cy = ay - by;
    const bool begins = dmk_min(ax * ax + ay * ay, bx * bx + by * by) < 1e-18 * (cx * cx + cy * cy);
    const double counts = begins ? 0 : 1; /* a factor: a choice would leave loops scalar */
    return dmk_angle_of(counts * (ax * bx + ay * by), counts * fabs(ax * by - ay * bx));
}

/* ---- images.c: DMK_EDGES half-edges at once, or fewer ------------------------------------------------- */

/* Only speed hangs on it: jumps and crossings of 273,000 triangles take the processors 61 ms with 16, 53 with 32 and 52
 * with 64. */
enum { DMK_EDGES = 32 };

/* The jumps of n half-edges: by how much the family of each end is too long at the other, in the star's unit. Both are
 * equally long across a locus on which the ends themselves lie, so a share `tie` of the families' largest difference at
 * the corners of the two triangles is added. */
void dmk_jumps(const dmk_geodesics *g, int n, const int32_t *half, double tie, double *jump);

/* Where their ends' families meet that begin alike (dmk_meeting_alike), at what angle, and the length of both. */
typedef struct dmk_met {
    double x[DMK_EDGES], alpha[DMK_EDGES], distance[DMK_EDGES];
} dmk_met;
void dmk_meet_many(const dmk_geodesics *g, int n, const int32_t *half, dmk_met *met);

/* ---- meeting.c: one half-edge ----------------------------------------------------------------------- */

/* A family of shortest paths by what a vertex at x knows of it, in the frame of a half-edge. */
typedef struct dmk_family {
    dmk_image image;
    const dmk_arrival *arrival;
    double x[2];
} dmk_family;

/* Both families of a half-edge, and where on it they are equally long. alpha: of its ends' own families; by that of a
 * tie, side branches of a line through vertices would have an excess (a torus would have 12 ends for 2). */
typedef struct dmk_meeting {
    dmk_family a, b;
    double x, length, alpha;
} dmk_meeting;
dmk_meeting dmk_meet(const dmk_geodesics *geodesics, int32_t h);

#endif
