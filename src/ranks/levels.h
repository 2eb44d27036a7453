/* Inside the ranks room: what a rank has of each level. */
#ifndef DMK_RANKS_LEVELS_H
#define DMK_RANKS_LEVELS_H

#include "ranks/part.h"

/* The vertices and edges of a level that the rank reads for the levels beside it, and on a coarse one for its
 * own vertices; sorted. */
int dmk_levels_need(dmk_context *context, const dmk_share *share, const dmk_parts *parts,
                    int32_t level, dmk_list *vertex, dmk_list *edge);
/* The edges of other ranks at rank r's vertices of a coarse level. */
int dmk_levels_others(dmk_context *context, const dmk_share *share, const dmk_graph *graph,
                      int32_t level, int r, dmk_part *part);

#endif
