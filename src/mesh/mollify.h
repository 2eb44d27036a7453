/* Intrinsic mollification: the metric that is computed with is the mesh's own, but for triangles next to
 * degenerate (Sharp and Crane, "A Laplacian for Nonmanifold Triangle Meshes", Computer Graphics Forum 39(5),
 * 2020, section 4.5; here it is kept to the triangles that need it). */
#ifndef DMK_MOLLIFY_H
#define DMK_MOLLIFY_H

#include "mesh/mesh.h"

/* A shallow copy of `mesh` with sides, areas and cotangents of its own where some triangle is so thin
 * that single precision would lose it: there the two shorter sides are made longer, by less than a
 * millionth of the longest. All else is borrowed from `mesh`, which must outlive it. */
int dmk_mollify(dmk_context *context, const dmk_mesh *mesh, dmk_mesh *mollified);
void dmk_mollify_free(const dmk_mesh *mesh, dmk_mesh *mollified);

#endif
