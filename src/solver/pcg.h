/* Conjugate gradients with the V-cycle as preconditioner, scalars kept on the device. */
#ifndef DMK_PCG_H
#define DMK_PCG_H

#include "solver/multigrid.h"

/* Add to x the solution of A dx = r. On entry cg[DMK_OUTER].r and narrow hold the right-hand side and the multigrid is
 * fresh; r is lost.
 * Runs max_iterations, or fewer once r.z <= tolerance^2 * max(energy, r.z at the start), or will be after one more if
 * that gains as much as the last one (tolerance 0: no look). Those done, and their V-cycles, are counted in `stats`.
 * Constants, the null space, take no part: r sums to 0 and the V-cycle is symmetric. */
int dmk_pcg(dmk_context *context, dmk_system *system, dmk_operator op, dmk_buffer *x,
            int max_iterations, double tolerance, double energy, dmk_stats *stats);
/* The same for Newton's matrix and system->w, by so many iterations, at least one, in single precision: on entry the
 * right-hand side and its first smoothing step, for DMK_ROWS cg[DMK_INNER].r and system->x, for DMK_VERTICES those of T
 * from dmk_nested_rhs, on return all but the last step, which is dmk_inner_finish's. */
int dmk_inner_solve(dmk_context *context, dmk_system *system, dmk_items over, int iterations,
                    dmk_stats *stats);

#endif
