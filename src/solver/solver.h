/* The solver's state, for those who solve with it: point.c from a point, transport.c between measures. */
#ifndef DMK_SOLVER_H
#define DMK_SOLVER_H

#include "ranks/pieces.h"
#include "solver/iteration.h"
#include "solver/result.h"

struct dmk_solver {
    dmk_device *device;
    const dmk_mesh *mesh;
    dmk_mesh *given;   /* the same, where it is the solver's to free; */
    bool spent;        /* and has been */
    dmk_ranks ranks;   /* size 0: none */
    int32_t component; /* the one that is packed, or -1 */
    dmk_shared_order *order;
    dmk_mesh mollified; /* the ordered mesh with the metric that is computed with */
    dmk_system *system;
    bool lean;          /* of the mesh there is a share only: */
    double *f;          /* its right-hand side */
    int32_t node[6];    /* whole rows of the source's nodes */
    dmk_pieces *pieces; /* in place of a mesh, of which there are the counts alone; */
    dmk_mesh counts;
    dmk_plot plot; /* then this rank's share of the component in order, until it is packed */
    bool planted;  /* it is that, and no rank has an order */
};

/* pieces.c: the component of a triangle of the input in order, of which each rank has its share; or all of a small one,
 * as if it had been read whole. */
int dmk_solver_plant(dmk_context *context, dmk_solver *solver, int64_t triangle);
/* The system of the share, and f. */
int dmk_planted_pack(dmk_context *context, dmk_solver *solver, const dmk_point *source);
/* The results on the first rank, in the input's order and units. */
int dmk_planted_collect(dmk_context *context, dmk_solver *solver, const dmk_point *source,
                        dmk_result *result);
/* DMK_E_ARG for options out of their range. */
int dmk_solver_take_options(dmk_context *context, const dmk_solve_options *given,
                            dmk_solve_options *options);
/* Order `component`, unless that was the last one; its system comes into being with the next call. A mesh that was
 * given is gone then. */
int dmk_solver_order(dmk_context *context, dmk_solver *solver, int32_t component);
/* The ordered component's system, if it is not there. With ranks `call` is that of dmk_system_dealt, or NULL. */
int dmk_solver_pack(dmk_context *context, dmk_solver *solver,
                    int (*call)(dmk_context *context, void *user, dmk_system *system), void *user);
/* DMK_OK if it can solve, for a density alone or more: it has a device of this process, and a mesh for that. */
int dmk_solver_begin(dmk_context *context, dmk_solver *solver, bool density_alone);
/* Work arrays may hold the NaN of an earlier solve that diverged: clear them. */
int dmk_solver_clear(dmk_context *context, const dmk_solver *solver);
/* The approximate cut locus (acl.h) from mu, or NULL, and u in the packed problem's order and the
 * mesh's units, at the mesh's own triangles in `marked`. */
int dmk_solver_mark_acl(dmk_context *context, const dmk_solver *solver, double threshold,
                        const double *mu, const double *u, uint8_t *marked);
/* Triangles in stats->steep by their numbers in the input; areas, costs from the packed problem's units, of
 * which `mass` is that of mass. */
void dmk_solver_name_steep(const dmk_solver *solver, dmk_stats *stats);
void dmk_solver_scale_stats(const dmk_solver *solver, double mass, dmk_stats *stats);

#endif
