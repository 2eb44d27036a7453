/* The operator on T/2 as a graph of its rows, of which coarse levels are made without T between them. On a mesh of
 * needles T is no coarse grid of T/2: midpoints of long edges side by side are coupled strongly to each other alone,
 * and a function that is the same on all of them and 0 on the vertices is neither damped by smoothing nor on T.
 *
 * Element t couples each two of its six rows. The three midpoints and, across, each corner and the midpoint opposite
 * are coupled by this element alone: edges elements_at + dmk_slot(t, k, 6), k = 0..2 the midpoints but the k-th, k =
 * 3..5 corner k - 3 and the midpoint opposite. Mesh edge e has three more, 3e and 3e + 1 from its midpoint to its ends
 * and 3e + 2 between these, of which both triangles have a share: dmk_slot(t, 3k + i, 9), where e is opposite corner k,
 * i = 0, 1 the end that is corner k + 1, k + 2, i = 2 both ends. */
#ifndef DMK_FINE_GRAPH_H
#define DMK_FINE_GRAPH_H

#include "levels/coarsen.h"
#include "solver/slots.h"

/* Bytes per triangle that it takes for a while, at most, beside those of a system with T: 1,090 to 1,470 were measured
 * on five meshes of 20,000 to 269,000 triangles. */
enum { DMK_FINE_GRAPH_BYTES = 1500 };

/* A triangle with an angle below 5 degrees, of these cotangents. */
static inline bool dmk_is_needle(const double cot[3])
{
    const double cot_5 = 11.43;
    return cot[0] > cot_5 || cot[1] > cot_5 || cot[2] > cot_5;
}

/* Whether it is worth while on a mesh with so many needles whose largest cotangent is `sharpest`. */
bool dmk_fine_graph_pays(int32_t n_triangles, int64_t n_needles, double sharpest);

typedef struct dmk_fine_graph {
    int32_t n_edges, elements_at;
    int32_t *edge; /* 2 * n_edges: rows; twice the same where there is no such element */
    /* 2 * dmk_padded(3 * mesh edges): the shares of edge i at dmk_slot(i, 0 or 1, 2). */
    int32_t *slot;
    /* Its level[0] is from the rows; none if the mesh does not become coarse enough. */
    dmk_hierarchy hierarchy;
} dmk_fine_graph;

/* Of an ordered, connected mesh. */
int dmk_fine_graph_create(dmk_context *context, const dmk_counts *counts, const dmk_mesh *mesh,
                          int32_t coarsest, dmk_fine_graph *graph);
void dmk_fine_graph_free(dmk_fine_graph *graph);

#endif
