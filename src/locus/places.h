/* The points of the lines: crossings and forks as vertices of the locus. Internal to src/locus. */
#ifndef DMK_PLACES_H
#define DMK_PLACES_H

#include "locus/cotree.h"

/* All but kind, degree and mu; angles as in the source's chart. None depends on the strength asked for. */

/* On its edge, nearest to the mean of the line over a stretch to both sides. */
void dmk_place_crossing(const dmk_cotree *cotree, int32_t i, dmk_locus_vertex *vertex);
/* In a triangle with three crossings: where the families of its corners are equally long if three
 * branches of default strength meet, else on the straight line between the two strongest. */
void dmk_place_fork(const dmk_cotree *cotree, int32_t triangle, dmk_locus_vertex *vertex);
void dmk_place_tip(const dmk_cotree *cotree, const dmk_tip *tip, dmk_locus_vertex *vertex);

/* The logarithmic map at xyz, a point of the corner's triangle reached by the geodesics of its family: length
 * times direction at the source, a full turn being 2 pi. In the shadow of a pseudo-source, where all paths start
 * in one direction, that of the corner is turned as if its path were straight. */
void dmk_place_in_plane(const dmk_cotree *cotree, int32_t corner, const double xyz[3], double plane[2]);

/* Whether three branches of default strength meet in the triangle. */
bool dmk_is_fork(const dmk_cotree *cotree, int32_t triangle);
/* The tip in a triangle, or NULL. */
const dmk_tip *dmk_tip_in(const dmk_cotree *cotree, int32_t triangle);

#endif
