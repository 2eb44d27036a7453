/* Grow a very coarse triangulation of a surface to a given size, with well-shaped triangles. */
#ifndef DMK_REMESH_H
#define DMK_REMESH_H

#include "surfaces/halfedge.h"
#include "surfaces/surface.h"

/* Grow `mesh` to n_vertices (room for them must be there) and relax it. All vertices lie on the
 * surface. With a source (a point of the surface; NULL: none), *source_vertex is the vertex that
 * sits exactly there, else -1. Equal input gives an equal result.
 * DMK_E_ARG if the triangles are too few to follow the surface. */
int dmk_remesh(dmk_context *context, const dmk_body *body, int32_t n_vertices, const double *source,
               dmk_halfedge *mesh, int32_t *source_vertex);

#endif
