/* Conjugate gradients with the V-cycle as preconditioner, scalars kept on the device. */
#ifndef DMK_PCG_H
#define DMK_PCG_H

#include "solver/multigrid.h"

/* Add to x the solution of operator * dx = r in the precision of `program`. On entry cg[program].r
 * (and narrow) hold the right-hand side and the multigrid is fresh; r is lost.
 * Runs max_iterations, or fewer once r.z <= tolerance^2 * max(energy, r.z at the start), or will be after one more if
 * that gains as much as the last one (tolerance 0: no look). Those done, and their V-cycles, are counted in `stats`.
 * Constants, the null space, take no part: r sums to 0 and the V-cycle is symmetric. The outer program
 * knows the stiffness operator only. */
int dmk_pcg(dmk_context *context, dmk_system *system, dmk_program program, dmk_operator op,
            dmk_buffer *x, int max_iterations, double tolerance, double energy, dmk_stats *stats);

/* The same on T alone, from dmk_nested_rhs: system->w += the solution by so many iterations, which are counted, too. */
int dmk_pcg_mesh(dmk_context *context, dmk_system *system, int iterations, dmk_stats *stats);

#endif
