/* A graph as lines. */
#ifndef DMK_GRAPH_H
#define DMK_GRAPH_H

#include "base/base.h"

/* The lines, each edge in one: between vertices of degree other than 2, in the order of their first vertices and of the
 * edges, then the closed curves without such. Edge i joins end[stride * i] and the next; line k is the vertices
 * index[offset[k]..offset[k + 1]), the first again at the end of a closed one. On failure, too, both arrays are to be
 * freed. No edge joins a vertex to itself. */
int dmk_graph_lines(dmk_context *context, size_t n_vertices, size_t n_edges, const int32_t *end,
                    size_t stride, size_t *n_lines, int32_t **offset, int32_t **index);

#endif
