/* Checks of a mesh while it is built; each names the first offender and the way out. */
#ifndef DMK_CHECK_H
#define DMK_CHECK_H

#include "mesh/mesh.h"

/* Before topology: finite coordinates, vertex indices in range, three different corners. */
int dmk_check_input(dmk_context *context, dmk_mesh *mesh);

/* When edges could not be built because more than two triangles, or two of the same direction, meet
 * at one: say which case it is (duplicates, a non-manifold edge, a surface without two sides, or
 * only some triangles turned over). Always fails. */
int dmk_check_explain_edges(dmk_context *context, const dmk_mesh *mesh);

/* With edges: no two triangles back to back on the same corners, and around every vertex one chain
 * or one cycle of triangles. `ranks`, which have the mesh, too, share the work; or NULL. */
int dmk_check_stars(dmk_context *context, const dmk_ranks *ranks, dmk_mesh *mesh);

#endif
