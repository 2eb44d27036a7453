/* Midpoint subdivision. */
#ifndef DMK_REFINE_H
#define DMK_REFINE_H

#include "mesh/mesh.h"

/* Move xyz, the middle of an edge, to where the surface is. */
typedef void (*dmk_lift_fn)(const void *user, double xyz[3]);

/* Every triangle into four. Vertices of `mesh` keep their numbers; the midpoint of edge e becomes
 * vertex n_vertices + e, passed through `lift` (NULL: it stays on the edge). Triangle t becomes
 *     4t + k: corner j is the midpoint of corners k and j of t (corner k itself for j = k), k < 3,
 *     4t + 3: corner k is the midpoint of the edge opposite corner k,
 * so every child is oriented and cornered as its parent. DMK_E_ARG if the result is too big. */
int dmk_mesh_refine(dmk_context *context, const dmk_mesh *mesh, dmk_lift_fn lift, const void *user,
                    dmk_mesh **fine);

#endif
