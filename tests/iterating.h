/* What tests of parts of a solve share: an iteration where none runs. */
#ifndef TEST_ITERATING_H
#define TEST_ITERATING_H

#include "solver/iteration.h"
#include "solver/solver.h"
#include "solving.h"

/* From the pair that p's device holds, without what is known of it. */
static inline dmk_iteration problem_iteration(problem *p)
{
    p->stats = (dmk_stats){0};
    return (dmk_iteration){.ctx = p->b->ctx,
                           .sys = p->solver->system,
                           .mesh = &p->solver->mollified,
                           .triangle_old = p->solver->order->order.triangle_old,
                           .options = &p->options,
                           .asked = DMK_NEWTON,
                           .stats = &p->stats,
                           .floor = DMK_FLOOR,
                           .mean_floor = DMK_FLOOR};
}

#endif
