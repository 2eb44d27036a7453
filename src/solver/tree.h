/* What vertices send each other along a spanning tree of the mesh, so that nothing is left: for the flux of the
 * upper bound, see upper.c. */
#ifndef DMK_TREE_H
#define DMK_TREE_H

#include "ranks/ranks.h"

/* Bins that edges are sorted by. */
enum { DMK_TREE_BINS = 1 << 11 };

typedef struct dmk_tree {
    dmk_share *share;              /* NULL: the whole mesh; else a rank's own items, and ghosts */
    const dmk_mesh *mesh;          /* of which edges and their ends are read; connected */
    int32_t vertices[2], edges[2]; /* the own ones: first, and end */
    /* Of an own edge; low ones come into the tree first. */
    int (*bin)(const void *user, int32_t edge);
    const void *user;
    /* Vertices: what each has to send, 0 in all, and a bound of the rounding in it; they are used up, and those of
     * ghosts not read. */
    double *load, *error;
    /* Edges, all 0: of own ones in the tree the flow from the first end to the second, and the errors that go with
     * it. */
    double *sent, *carried;
    /* Of dmk_tree_grow, freed by dmk_tree_free: own edges, those of the own forest first, and by vertices. */
    int32_t *order, n_chosen, *degree;
} dmk_tree;

/* The own edges' minimum spanning forest by bins, then by numbers. Reads no loads. */
int dmk_tree_grow(dmk_context *context, dmk_tree *tree);
/* All loads along the whole mesh's tree to its vertex 0. The same bits on any number of ranks: loads are rounded (and
 * `error` grows by that) to multiples of a power of 2 so small that all their sums are exact. Once; collective. */
int dmk_tree_send(dmk_context *context, dmk_tree *tree);
void dmk_tree_free(dmk_tree *tree);

#endif
