/* The metric that is computed with: the mesh's own, but for triangles next to degenerate. */
#ifndef DMK_SOFTEN_H
#define DMK_SOFTEN_H

#include "mesh/mesh.h"

/* A shallow copy of `mesh` with sides, areas and cotangents of its own where some triangle is so thin
 * that single precision would lose it: there the two shorter sides are made longer, by less than a
 * millionth of the longest. All else is borrowed from `mesh`, which must outlive it. */
int dmk_soften(dmk_context *context, const dmk_mesh *mesh, dmk_mesh *soft);
void dmk_soften_free(const dmk_mesh *mesh, dmk_mesh *soft);

#endif
