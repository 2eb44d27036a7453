/* The start of the nonlinear iteration: a geodesic distance, and the density that belongs to it.
 *
 * The mesh is connected; the source is any point of it, inside a triangle, on an edge or at a
 * vertex. Both results are the same bits for any number of threads. */
#ifndef DMK_START_H
#define DMK_START_H

#include "mesh/mesh.h"

/* Geodesic distance from `source` at vertices (n_vertices) and edge midpoints (n_edges). */
int dmk_start_distance(dmk_context *ctx, const dmk_mesh *mesh, const dmk_point *source,
                       double *d_vertex, double *d_mid);

/* Density that carries each triangle's area along the gradient of that distance to the source.
 * mu: n_triangles, > 0. */
int dmk_start_density(dmk_context *ctx, const dmk_mesh *mesh, const dmk_point *source,
                      const double *d_vertex, const double *d_mid, double *mu);

#endif
