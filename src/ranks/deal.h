/* Inside the ranks room: how a mesh is dealt out. */
#ifndef DMK_DEAL_H
#define DMK_DEAL_H

#include "ranks/ranks.h"

/* Levels of fewer vertices are on all ranks: there an exchange costs more than the work (a level of
 * 10,000 takes 10 us on a device that moves 100 GB/s, as long as one message). */
enum { DMK_GATHER_BELOW = 10000 };

/* The calls of a dmk_dealing whose user is a share: own ranges of the levels below T, and the first level that
 * is whole. */
int dmk_deal_own(dmk_context *context, void *share, const dmk_coarsening *c, int32_t *first,
                 int32_t *end);
int dmk_deal_join(dmk_context *context, void *share, dmk_coarsening *c);
/* Mark the vertices and edges of a level that the rank reads; own ones may stay unmarked. */
void dmk_deal_mark(const dmk_share *share, const dmk_mesh *mesh, const dmk_hierarchy *hierarchy,
                   int32_t level, uint8_t *vertex_mark, uint8_t *edge_mark);

#endif
