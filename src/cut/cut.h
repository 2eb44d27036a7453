/* The surface cut open along its cut locus, and laid out in the plane. Host arrays in and out; no device. */
#ifndef DMK_CUT_H
#define DMK_CUT_H

#include "geodesic/image.h"
#include "locus/locus.h"

/* cut.c: a disk, with one border loop and Euler characteristic 1.
 * The triangles that the locus crosses are split so that it runs along edges; its vertices are doubled,
 * one for each side. It is the mesh on which the locus is traced that is cut (geodesic/finer.h). A locus that crosses
 * fewer than three edges of a sphere becomes a slit of two edges of geodesics->mesh; where a disk has none, that stays
 * as it is. The mesh begins with the vertices of geodesics->mesh.
 * order (NULL: none): these stand in the order that they had before, and so do the numbers that are given.
 * *origin: for each vertex the one of that mesh at the same place, or -1 where it is new; *plane: 2 for each
 * vertex, distance times the direction at the source of the geodesics on its side, averaged as dmk_plane_unfold does
 * (the caller frees both). */
int dmk_locus_cut(dmk_context *ctx, const dmk_geodesics *geodesics, const dmk_locus_options *opt,
                  const dmk_order *order, dmk_mesh **cut, int32_t **origin, double **plane);
/* The same along the seam that dmk_locus_trace gave. */
int dmk_seam_cut(dmk_context *ctx, const dmk_geodesics *geodesics, const dmk_seam *seam,
                 const dmk_order *order, dmk_mesh **cut, int32_t **origin, double **plane);

/* sides.c: turn, n_vertices: by how much the direction of each vertex' path turns to be one of its side of the cut, as
 * its neighbours nearer to the source on that side have it; 0 for most. crossed: 3 n_triangles, half-edges cut. */
int dmk_cut_sides(dmk_context *ctx, const dmk_geodesics *geodesics, const bool *crossed,
                  double *turn);

/* The logarithmic map in polar coordinates: a length, and a direction at the source, of which a full turn is 2 pi. */
typedef struct dmk_polar {
    double distance, direction;
} dmk_polar;
/* Of the point (x, y) in the frame of a half-edge with vertex v at (at, 0), reached by the geodesics of v's family,
 * which comes from the image. In the shadow of a pseudo-source, where all paths start in one direction, v's is turned
 * as if its path were straight. */
dmk_polar dmk_polar_of(const dmk_geodesics *g, int32_t v, const dmk_image *image, double at,
                       double x, double y);

/* plane.c: directions averaged around triangles that lie the other way round, or are flat, in the plane, then such that
 * theirs do not; where that ends in vain what had the fewest. Distances stay. plane: 2 for each vertex of the cut
 * mesh. */
int dmk_plane_unfold(dmk_context *ctx, const dmk_mesh *cut, double *plane);
/* How many such triangles there are. */
size_t dmk_plane_flipped(const dmk_mesh *cut, const double *plane);

#endif
