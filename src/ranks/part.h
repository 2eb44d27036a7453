/* Inside the ranks room: the levels below a mesh, each rank's part of them. All numbers are whole ones. */
#ifndef DMK_PART_H
#define DMK_PART_H

#include "ranks/post.h"

/* Levels of fewer vertices are on all ranks: there an exchange costs more than the work (a level of
 * 10,000 takes 10 us on a device that moves 100 GB/s, as long as one message). */
enum { DMK_GATHER_BELOW = 10000 };

static inline int32_t dmk_gather_below(const dmk_share *s)
{
    return s->ranks.gather_below > 0 ? s->ranks.gather_below : DMK_GATHER_BELOW;
}

/* n_whole, first and end from bound. */
static inline void dmk_space_set_own(const dmk_ranks *ranks, dmk_space *space)
{
    space->n_whole = space->bound[ranks->size];
    space->first = space->bound[ranks->rank];
    space->end = space->bound[ranks->rank + 1];
}

void dmk_part_free(dmk_part *part);

/* A level's own vertices, and what they are linked to. */
typedef struct dmk_side {
    const dmk_space *vertex; /* of which only the bounds are used */
    /* Own vertices' neighbours: with the links' lengths, in the order of a dmk_adjacency. */
    int32_t *row;
    struct dmk_link {
        int64_t to;
        float length;
    } * link;
    double *xyz;     /* 3 for each own vertex */
    int32_t n_edges; /* of which the smaller end is an own vertex */
    int64_t *edge;   /* 3 for each: its number and its ends */
} dmk_side;

void dmk_side_free(dmk_side *side);

/* cells.c: the step's coarse vertices; bound[ranks + 1] are theirs, the number of all is bound[ranks]. Without enough
 * gain that, nothing else. */
typedef struct dmk_grown {
    int64_t *cell;   /* of each own fine vertex */
    int32_t *sample; /* of each own cell: an own fine vertex, counted from the first own one */
} dmk_grown;
int dmk_grow_cells(dmk_context *context, const dmk_ranks *ranks, const dmk_side *fine,
                   dmk_space *coarse, dmk_grown *grown);
void dmk_grown_free(dmk_grown *grown);
/* The cells' adjacency, and their positions in space. */
int dmk_grow_side(dmk_context *context, const dmk_ranks *ranks, const dmk_side *fine,
                  const dmk_grown *grown, dmk_side *coarse);

/* weights.c: part->prolong_index and prolong_weight, from the coarse side's links and positions. */
int dmk_part_weights(dmk_context *context, const dmk_ranks *ranks, const dmk_side *fine,
                     const dmk_grown *grown, const dmk_side *coarse, dmk_part *part);
/* product.c: the rest, and the coarse side's edges, whose bounds come into `edges`. */
int dmk_part_product(dmk_context *context, const dmk_ranks *ranks, const dmk_side *fine,
                     dmk_side *coarse, dmk_space *edges, dmk_part *part);

#endif
