/* The topology of a mesh, from its triangles. For create.c. */
#ifndef DMK_EDGES_H
#define DMK_EDGES_H

#include "mesh/mesh.h"

/* n_edges, triangle_edge, edge_vertex and edge_triangle; DMK_E_MESH as dmk_check_explain_edges says. */
int dmk_mesh_build_edges(dmk_context *context, dmk_mesh *mesh);
/* n_components and component of a mesh with edges whose stars have been checked. */
int dmk_mesh_build_components(dmk_context *context, dmk_mesh *mesh);

#endif
