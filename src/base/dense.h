/* Small dense matrices, row by row in an array. */
#ifndef DMK_DENSE_H
#define DMK_DENSE_H

#include "base/base.h"

/* Pseudo-inverse of the n x n Laplacian of a connected graph (symmetric, null space: the
 * constants), by Cholesky factorisation of L + c J, J all ones: (L + c J)^-1 - J / (c n^2), c the mean of
 * L's diagonal over n. n^3 operations. */
int dmk_laplacian_inverse(dmk_context *context, int32_t n, const double *laplacian,
                          double *inverse);

/* The symmetric, positive definite system A x = b for n_right right-hand sides, the columns of b (n rows of
 * n_right), by Cholesky: b becomes x, A is spoilt; of A only the lower triangle is read. False if A is not
 * positive definite. */
bool dmk_solve_symmetric(int n, int n_right, double *A, double *b);

#endif
