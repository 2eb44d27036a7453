/* The start of the nonlinear iteration: the density that belongs to the geodesic distance.
 *
 * The mesh is connected; the source is any point of it, inside a triangle, on an edge or at a
 * vertex. The result is the same bits for any number of threads. */
#ifndef DMK_START_H
#define DMK_START_H

#include "geodesic/geodesic.h"

/* What can be begun when all that is left is one thread's work. */
typedef struct dmk_meanwhile {
    void (*begin)(dmk_context *ctx, void *user);
    void *user;
} dmk_meanwhile;

/* Density that carries each triangle's area along the gradient of the distance to the geodesics' one source. The
 * mesh has the numbers of theirs; its lengths may differ.
 * mid: n_edges, the distance at the edges' midpoints; mu: n_triangles, > 0; meanwhile: or NULL. */
int dmk_start_density(dmk_context *ctx, const dmk_mesh *mesh, const dmk_geodesics *geodesics,
                      const double *mid, double *mu, const dmk_meanwhile *meanwhile);

#endif
