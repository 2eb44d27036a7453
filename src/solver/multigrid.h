/* The V(2,2)-cycle that preconditions A(mu) and Newton's M; in single precision on the device. */
#ifndef DMK_MULTIGRID_H
#define DMK_MULTIGRID_H

#include "solver/system.h"

/* The inner operator, whose coefficients element_prepare or newton_prepare left in the system. */
typedef enum dmk_operator { DMK_STIFFNESS, DMK_NEWTON_MATRIX } dmk_operator;

/* First phase of the inner operator: system->out = the elements' parts of operator * x. */
int dmk_inner_elements(dmk_context *context, dmk_system *system, dmk_operator op,
                       const dmk_buffer *x);

/* Bring diagonals and coarse operators up to date with the prepared coefficients. `out` must hold the
 * elements' weighted diagonals. Reads the coarsest links back: the only host work of the cycle. */
int dmk_multigrid_refresh(dmk_context *context, dmk_system *system);

/* system->x_old = V-cycle applied to rhs (a row vector in single precision). */
int dmk_v_cycle(dmk_context *context, dmk_system *system, dmk_operator op, const dmk_buffer *rhs);

#endif
