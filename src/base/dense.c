/* Cholesky factorisation: Golub and Van Loan, Matrix Computations, 4.2. */
#include "base/dense.h"

#include <math.h>
#include <stdlib.h>

/* The lower factor of laplacian + shift J. */
static void factor(int32_t n, const double *laplacian, double shift, double *chol)
{
    for (int32_t j = 0; j < n; j++) {
        for (int32_t i = j; i < n; i++) {
            double sum = laplacian[i * n + j] + shift;
            for (int32_t k = 0; k < j; k++) sum -= chol[i * n + k] * chol[j * n + k];
            if (i == j) {
                /* Rounding of single-precision links may leave a pivot at 0, or below: that
                 * unknown is left out. */
                double least = 1e-12 * (laplacian[j * n + j] + shift);
                chol[j * n + j] = sum > least ? sqrt(sum) : INFINITY;
            } else {
                chol[i * n + j] = sum / chol[j * n + j];
            }
        }
    }
}

/* Column `column` of the inverse by two triangular solves; that of the factor's starts at its row.
 */
static void solve_unit(int32_t n, const double *chol, int32_t column, double *x)
{
    for (int32_t i = 0; i < n; i++) {
        double sum = i == column ? 1 : 0;
        for (int32_t k = column; k < i; k++) sum -= chol[i * n + k] * x[k];
        x[i] = i < column ? 0 : sum / chol[i * n + i];
    }
    for (int32_t i = n - 1; i >= 0; i--) {
        double sum = x[i];
        for (int32_t k = i + 1; k < n; k++) sum -= chol[k * n + i] * x[k];
        x[i] = sum / chol[i * n + i];
    }
}

int dmk_laplacian_inverse(dmk_context *ctx, int32_t n, const double *laplacian, double *inverse)
{
    double *chol = NULL, shift = 0;
    int rc = DMK_NEW(ctx, chol, (size_t)n * (size_t)n);
    if (rc != DMK_OK) return rc;
    for (int32_t i = 0; i < n; i++) shift += laplacian[i * n + i];
    shift /= (double)n * n;
    if (!(shift > 0)) shift = 1;
    factor(n, laplacian, shift, chol);
    for (int32_t c = 0; c < n; c++) solve_unit(n, chol, c, inverse + (size_t)c * (size_t)n);
    for (int32_t i = 0; i < n * n; i++) inverse[i] -= 1 / (shift * n * n);
    free(chol);
    return DMK_OK;
}

bool dmk_solve_symmetric(int n, int n_right, double *A, double *b)
{
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double s = A[i * n + j];
            for (int k = 0; k < j; k++) s -= A[i * n + k] * A[j * n + k];
            if (i == j && !(s > 0)) return false;
            A[i * n + j] = i == j ? sqrt(s) : s / A[j * n + j];
        }
    }
    for (int c = 0; c < n_right; c++) {
        for (int i = 0; i < n; i++) {
            for (int k = 0; k < i; k++) b[i * n_right + c] -= A[i * n + k] * b[k * n_right + c];
            b[i * n_right + c] /= A[i * n + i];
        }
        for (int i = n - 1; i >= 0; i--) {
            for (int k = i + 1; k < n; k++) b[i * n_right + c] -= A[k * n + i] * b[k * n_right + c];
            b[i * n_right + c] /= A[i * n + i];
        }
    }
    return true;
}
