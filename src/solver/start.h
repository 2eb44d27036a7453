/* The start of the nonlinear iteration: the density that belongs to the geodesic distance.
 *
 * The mesh is connected; the source is any point of it, inside a triangle, on an edge or at a
 * vertex. The result is the same bits for any number of threads. */
#ifndef DMK_START_H
#define DMK_START_H

#include "mesh/mesh.h"

/* Density that carries each triangle's area along the gradient of the geodesic distance at vertices and edge midpoints
 * to the source.
 * mu: n_triangles, > 0. */
int dmk_start_density(dmk_context *ctx, const dmk_mesh *mesh, const dmk_point *source,
                      const double *d_vertex, const double *d_mid, double *mu);

#endif
