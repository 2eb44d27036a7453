/* The kernels as typed calls: the only place that launches any. A call takes from the system what
 * is always the same and as arguments what varies; what a kernel reads, writes and computes stands
 * above it in kernels/. All only queue their work; a failure names the kernel. */
#ifndef DMK_KERNELS_H
#define DMK_KERNELS_H

#include "solver/system.h"

/* Get the system's kernels from its device. */
int dmk_kernels_create(dmk_context *context, dmk_device *device, struct dmk_kernels **kernels);
void dmk_kernels_destroy(struct dmk_kernels **kernels);

/* ---- operator.cl ----------------------------------------------------------------------------- */

/* The elements' parts of A x, into out or, in the outer program, out_real. */
int dmk_element_stiffness(dmk_context *context, dmk_system *s, dmk_program program,
                          const dmk_buffer *x);
/* The elements' parts of Newton's M x, into out. */
int dmk_element_newton(dmk_context *context, dmk_system *s, const dmk_buffer *x);
/* y = the rows' sums of the elements' parts (out or out_real); partial sums of x.y. */
int dmk_rows_apply(dmk_context *context, dmk_system *s, dmk_program program, const dmk_buffer *x,
                   dmk_buffer *y);
/* residual = rhs - the rows' sums of out. */
int dmk_rows_residual(dmk_context *context, dmk_system *s, const dmk_buffer *rhs);

/* A Chebyshev step x_old <- x + momentum (x - keep x_old) + step D^-1 (rhs - A x). */
typedef struct dmk_chebyshev_step {
    double momentum, keep, step;
} dmk_chebyshev_step;

/* On T/2, A x in out by its elements' parts. */
int dmk_rows_chebyshev(dmk_context *context, dmk_system *s, const dmk_buffer *rhs,
                       const dmk_buffer *x, dmk_buffer *x_old, dmk_chebyshev_step c);

/* ---- vector.cl ------------------------------------------------------------------------------- */

/* One iteration of conjugate gradients on cg[program]; z: the preconditioned residual. */
int dmk_cg_dots(dmk_context *context, dmk_system *s, dmk_program program, const dmk_buffer *z);
int dmk_cg_beta(dmk_context *context, dmk_system *s, dmk_program program, bool first);
int dmk_cg_direction(dmk_context *context, dmk_system *s, dmk_program program, const dmk_buffer *z);
int dmk_cg_alpha(dmk_context *context, dmk_system *s, dmk_program program);
int dmk_cg_step(dmk_context *context, dmk_system *s, dmk_program program, dmk_buffer *x);

/* Partial sums of a.b, over the rows, in the outer program. */
int dmk_dot(dmk_context *context, dmk_system *s, const dmk_buffer *a, const dmk_buffer *b);
/* Partial maxima of u and of -u. */
int dmk_rows_range(dmk_context *context, dmk_system *s, const dmk_buffer *u);
/* scalars[at .. at + count) = the sums, the last `maxima` the maxima, of what a kernel over `items` items
 * left in partial. */
int dmk_sum_partials(dmk_context *context, dmk_system *s, size_t items, int count, int maxima,
                     int at);
/* u <- alpha u + w. */
int dmk_scale_add(dmk_context *context, dmk_system *s, double alpha);

/* ---- multigrid.cl ---------------------------------------------------------------------------- */

/* x = step D^-1 rhs on T/2: the first smoothing step from 0. */
int dmk_smooth_first(dmk_context *context, dmk_system *s, const dmk_buffer *rhs, double step);
/* residual = rhs - A x on a graph level. */
int dmk_graph_residual(dmk_context *context, dmk_system *s, int32_t level, const dmk_buffer *x);
int dmk_graph_chebyshev(dmk_context *context, dmk_system *s, int32_t level, const dmk_buffer *x,
                        dmk_buffer *x_old, dmk_chebyshev_step c);
/* rhs of the level = the restricted residual of the next finer one; x = step D^-1 rhs. */
int dmk_restrict(dmk_context *context, dmk_system *s, int32_t level, double step);
/* x of the next finer level += the level's prolonged x_old. */
int dmk_prolong(dmk_context *context, dmk_system *s, int32_t level, dmk_buffer *x);
/* x_old = coarse_inverse * rhs on the coarsest level. */
int dmk_coarse_solve(dmk_context *context, dmk_system *s);
/* coarse_inverse from the coarsest level's weights; where s->dense is. */
int dmk_coarse_inverse(dmk_context *context, dmk_system *s);
/* Link weights of a level from the triangles' (level 0) or from those of the next finer one. */
int dmk_links(dmk_context *context, dmk_system *s, int32_t level);
/* Link weights by row, and the inverse diagonal from the rows' sums. */
int dmk_graph_weights(dmk_context *context, dmk_system *s, int32_t level);
/* The inverse diagonals from the elements' bounds: of T/2 from out, of T from diag_coarse. */
int dmk_inverse_diagonal_fine(dmk_context *context, dmk_system *s);
int dmk_inverse_diagonal_coarse(dmk_context *context, dmk_system *s);

/* ---- density.cl ------------------------------------------------------------------------------ */

/* q = v.g / area with g = K v, which goes to out_real if it is to be kept; partial sums of mu v.g. slack:
 * the rounding that v.g is raised by, relative to its terms. */
int dmk_element_energy(dmk_context *context, dmk_system *s, const dmk_buffer *v, bool keep,
                       double slack);
/* Partial sums of area mu L^2 and area mu, and maxima of alpha^2 q, L = 1/2 log(alpha^2 q). */
int dmk_element_measure(dmk_context *context, dmk_system *s, double alpha);
/* out_real: g becomes mu g. */
int dmk_element_scale(dmk_context *context, dmk_system *s);
/* weight, weight_real, link, diag_coarse and, in out, the weighted diagonals of A(mu). */
int dmk_element_prepare(dmk_context *context, dmk_system *s);
/* The same of Newton's M at pseudo-time step D, its rank_one, and its right-hand side's parts in
 * out_real, which has g before; all but its weighted diagonals. */
int dmk_newton_prepare(dmk_context *context, dmk_system *s, double alpha, double D);
/* These, in out: the right-hand side must have been summed up. */
int dmk_newton_diagonal(dmk_context *context, dmk_system *s);
/* The inner right-hand side cg[DMK_INNER].r = f + the rows' sums of out_real. */
int dmk_rows_rhs(dmk_context *context, dmk_system *s);
/* The outer residual cg[DMK_OUTER].r (and narrow) = f - the rows' sums of out_real. */
int dmk_rows_outer_residual(dmk_context *context, dmk_system *s);
/* mu after a Newton step w, of which rank_one knows the rest; partial sums of area |change of mu| and of area mu. */
int dmk_newton_update(dmk_context *context, dmk_system *s, double alpha, double D, double lowest);
/* mu after an explicit step (see density.cl); the same sums. */
int dmk_explicit_update(dmk_context *context, dmk_system *s, bool inertial, double dt, double beta,
                        double lowest);

/* Level bands of u: band i holds the values from start + i / inverse on. */
typedef struct dmk_bands {
    int32_t n;
    float start, inverse;
} dmk_bands;

/* slopes[i] = the largest sqrt(q) of the elements that meet band i, as the bits of a float. */
int dmk_band_slopes(dmk_context *context, dmk_system *s, const dmk_bands *bands,
                    const dmk_buffer *u, dmk_buffer *slopes);
/* v = phi(u), phi linear between its values at the bands' ends. */
int dmk_band_map(dmk_context *context, dmk_system *s, const dmk_bands *bands, const dmk_buffer *phi,
                 const dmk_buffer *u, dmk_buffer *v);

/* ---- certificate.cl -------------------------------------------------------------------------- */

/* The repair of a potential under way. */
typedef struct dmk_repair_work {
    dmk_buffer *u, *before; /* rows, real; before: without the momentum */
    dmk_buffer *mark;       /* per element: its places in out_real are not 0 */
    dmk_buffer *ring,
        *moved; /* per row: ring around the hot ones; stamp of the last that moved it */
    dmk_buffer *elements, *rows; /* the lists */
    dmk_buffer *count;           /* their lengths on the device, and here: */
    int32_t n_elements, n_rows;
    dmk_buffer *broken; /* per sweep since the lists were made: elements above 1 */
} dmk_repair_work;

/* u = before = scale * from. */
int dmk_repair_start(dmk_context *context, dmk_system *s, const dmk_repair_work *w, double scale,
                     const dmk_buffer *from);
/* ring = 1 on the rows of elements with q > 1, of marked ones and of those with a row that moves. */
int dmk_repair_mark(dmk_context *context, dmk_system *s, const dmk_repair_work *w);
/* Elements at rows of rings up to `ring` put their other rows into the next. */
int dmk_repair_grow(dmk_context *context, dmk_system *s, const dmk_repair_work *w, int ring);
/* The elements at rows of rings up to `ring`, and all rows of any, which are cleared; count. */
int dmk_repair_list(dmk_context *context, dmk_system *s, const dmk_repair_work *w, int ring);
/* Sweep number `sweep` since the lists were made: elements leave their moves to sqrt(q) <= target in
 * out_real, rows take the means of the moves. Does nothing after a sweep that found none above 1. */
int dmk_repair_elements(dmk_context *context, dmk_system *s, const dmk_repair_work *w, int sweep,
                        int stamp, double target);
int dmk_repair_rows(dmk_context *context, dmk_system *s, const dmk_repair_work *w, int sweep,
                    int stamp, double momentum);

#endif
