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
/* The steps of it: whether all triangles begin .. end - 1 are harmless; one round over them, in their order, the
 * number of those that were too thin; whether the whole area, before and after, is still about the same. */
enum {
    DMK_MOLLIFY_ROUNDS = 40
}; /* what is given to one triangle may be taken from the next one: a few */
bool dmk_needs_no_mollifying(const dmk_mesh *mesh, int32_t begin, int32_t end);
int32_t dmk_lengthen(const dmk_mesh *mesh, int32_t begin, int32_t end, double *length);
bool dmk_mollified_is_good(double before, double after);
void dmk_mollify_free(const dmk_mesh *mesh, dmk_mesh *mollified);

#endif
