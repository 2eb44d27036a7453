/* The V-cycle that preconditions A(mu) and Newton's M, with one to three smoothing steps on T/2 before and after, and
 * on the other levels as multigrid.c says; in single precision on the device. */
#ifndef DMK_MULTIGRID_H
#define DMK_MULTIGRID_H

#include "solver/system.h"

/* First phase of the inner operator: system->out = the elements' parts of operator * x. */
int dmk_inner_elements(dmk_context *context, dmk_system *system, dmk_operator op,
                       const dmk_buffer *x);

/* Bring the coarse operators and their diagonals up to date with the prepared coefficients; that of T/2 is
 * dmk_inverse_diagonal's or dmk_newton_rows'. Without system->dense the host inverts the coarsest operator. */
int dmk_multigrid_refresh(dmk_context *context, dmk_system *system, dmk_operator op);

/* system->x_old = V-cycle applied to rhs (a row vector in single precision), in system->x another one. begun:
 * system->x has its first step from 0 (see dmk_first_step). */
int dmk_v_cycle(dmk_context *context, dmk_system *system, dmk_operator op, const dmk_buffer *rhs,
                bool begun);
/* x_old of T = the cycle's part from T on, applied to its rhs. */
int dmk_mesh_cycle(dmk_context *context, dmk_system *system);
/* The step that a cycle's first smoothing step takes: x = step D^-1 rhs. */
double dmk_first_step(void);

#endif
