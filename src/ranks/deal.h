/* Inside the ranks room: how a mesh is dealt out. */
#ifndef DMK_DEAL_H
#define DMK_DEAL_H

#include "ranks/part.h"

static inline int32_t dmk_gather_below(const dmk_share *s)
{
    return s->ranks.gather_below > 0 ? s->ranks.gather_below : DMK_GATHER_BELOW;
}

/* first and end from bound. */
static inline void dmk_space_set_own(const dmk_share *s, dmk_space *space)
{
    space->first = space->bound[s->ranks.rank];
    space->end = space->bound[s->ranks.rank + 1];
}

/* levels.c: the vertices and edges of a level that the rank reads for the levels beside it, and on a coarse one for its
 * own vertices; sorted. */
int dmk_deal_need(dmk_context *context, const dmk_share *share, const dmk_parts *parts,
                  int32_t level, dmk_list *vertex, dmk_list *edge);
/* The edges of other ranks at rank r's vertices of a coarse level. */
int dmk_deal_others(dmk_context *context, const dmk_share *share, const dmk_graph *graph,
                    int32_t level, int r, dmk_part *part);

#endif
