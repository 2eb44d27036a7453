/* What the engines of window.c and wave.c share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_FRONT_H
#define DMK_GEODESIC_FRONT_H

#include "geodesic/geodesic.h"

#include <math.h>

/* Everything about a triangle but its angles. Half-edge h lies on the x axis from a (0, 0) to b
 * (length, 0), with the opposite corner c above; rays enter upwards. */
typedef struct dmk_facet {
    double length[3], cosine[3], sine[3]; /* of side k; of the angle at corner k */
    int32_t vertex[3], twin[3];
} dmk_facet;

/* What both engines stand on. Lengths are in the star's unit. */
typedef struct dmk_front {
    dmk_geodesics *g;
    dmk_facet *facet;    /* n_triangles */
    double *d;           /* n_vertices: the object's */
    bool *pseudo_source; /* n_vertices: paths may bend here */
} dmk_front;

/* Rounding, over the mesh's extent, the unit of length: ways so much longer count as equal. */
#define DMK_SAME_LENGTH 1e-12
/* Rounding, over the length of the edge: a ray so little beside an interval is in it; an interval
 * so narrow is none. */
#define DMK_SAME_PLACE 1e-11
#define DMK_NO_WIDTH 1e-12

/* Radians over 2 pi around a vertex at which shortest paths bend; and below pi at a border, whose straight vertices all
 * count. */
#define DMK_LEAST_EXCESS 1e-10
#define DMK_STRAIGHT 1e-6

/* Whether shortest paths may bend at vertex v. */
static inline bool dmk_front_bends(const dmk_star *star, int32_t v)
{
    return star->total[v] > (star->border[v] ? M_PI - DMK_STRAIGHT : 2 * M_PI + DMK_LEAST_EXCESS);
}

int dmk_front_create(dmk_context *context, dmk_geodesics *geodesics, dmk_front *front);
void dmk_front_free(dmk_front *front);

/* Site's sector k in units; the sector of corner c of a star. */
dmk_sector dmk_front_site(const dmk_front *front, const dmk_site *site, int32_t k);
dmk_sector dmk_front_corner(const dmk_front *front, int32_t corner);

/* The directions lo..hi that a pseudo-source radiates into, which a path reaches from the direction `back`:
 * those that make no angle below pi with it. How many intervals there are. */
int dmk_front_directions(const dmk_front *front, int32_t v, double back, double range[2][2]);

/* An end of a sector's half-edge, if it lies within the directions lo..hi: one path leads straight
 * there. */
typedef struct dmk_end {
    int32_t vertex;
    double length, direction, back;
} dmk_end;
bool dmk_front_end(const dmk_front *front, const dmk_sector *sector, bool last, double lo,
                   double hi, dmk_end *end);

/* The part of a sector's half-edge within the directions lo..hi, as the half-edge on its other side
 * sees it: the rays come from (x, y), y < 0, and `turn` is the direction of the x axis. False if
 * there is nothing of it, or a border. */
typedef struct dmk_beam {
    double lo, hi, x, y, turn;
    int32_t half;
} dmk_beam;
bool dmk_front_beam(const dmk_front *front, const dmk_sector *sector, double lo, double hi,
                    dmk_beam *beam);

/* A direction brought into the chart of a vertex or source. */
double dmk_front_turn(double direction, double total, bool border);

#endif
