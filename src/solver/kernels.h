/* The kernels as typed calls: the only place that launches any, but for those of ranks.cl, which ranks/halo.c does. A
 * call takes from the system what is always the same and as arguments what varies; what a kernel reads, writes and
 * computes stands above it in kernels/. All only queue their work; a failure names the kernel. */
#ifndef DMK_KERNELS_H
#define DMK_KERNELS_H

#include "solver/system.h"

#include "dmk_shared.h"

/* Get the system's kernels from its device. */
int dmk_kernels_create(dmk_context *context, dmk_device *device, struct dmk_kernels **kernels);
void dmk_kernels_destroy(struct dmk_kernels **kernels);

/* ---- operator.cl ----------------------------------------------------------------------------- */

/* The elements' parts of A x, into out or, in the outer program, out_real. */
int dmk_element_stiffness(dmk_context *context, dmk_system *s, dmk_program program,
                          const dmk_buffer *x);
/* The elements' parts of Newton's M x, into out. */
int dmk_element_newton(dmk_context *context, dmk_system *s, dmk_program p, const dmk_buffer *x);
/* y = the rows' sums of the elements' parts out_real, and of x.y CG's alpha (vector.cl). */
int dmk_rows_apply(dmk_context *context, dmk_system *s, const dmk_buffer *x, dmk_buffer *y);

/* A Chebyshev step x_old <- x + momentum (x - keep x_old) + step D^-1 (rhs - A x). */
typedef struct dmk_chebyshev_step {
    double momentum, keep, step;
} dmk_chebyshev_step;

/* On T/2, A x in out by its elements' parts. */
int dmk_rows_chebyshev(dmk_context *context, dmk_system *s, const dmk_buffer *rhs,
                       const dmk_buffer *x, dmk_buffer *x_old, dmk_chebyshev_step c);

/* Sums over rows or elements go to scalars[at ..], one number for each that is named. */

/* ---- vector.cl ------------------------------------------------------------------------------- */

/* One iteration of conjugate gradients on cg[DMK_OUTER]; z: the preconditioned residual. dots: beta, and at
 * the first iteration the rest of state, too. */
int dmk_cg_dots(dmk_context *context, dmk_system *s, bool first, const dmk_buffer *z);
int dmk_cg_direction(dmk_context *context, dmk_system *s, const dmk_buffer *z);
/* But for the last step, s->x = step D^-1 r, where the next cycle begins. */
int dmk_cg_step(dmk_context *context, dmk_system *s, dmk_buffer *x, double step, bool last);

/* The same for w by cg[DMK_INNER]'s p and ap: on T/2 (DMK_ROWS) with its r, z being x_old, or on T (DMK_VERTICES) with
 * level 0's rhs for r. apply: x = A z, on T/2 from the elements' parts in out, alpha and beta. Then step makes the
 * vectors and x as there; after the last iteration finish, where `first` tells that it was the only one, makes w,
 * u <- scale u + w, and f.u. */
int dmk_inner_apply(dmk_context *context, dmk_system *s, dmk_items over, bool first);
int dmk_inner_step(dmk_context *context, dmk_system *s, dmk_items over, bool first, double step);
int dmk_inner_finish(dmk_context *context, dmk_system *s, dmk_items over, bool first, double scale,
                     int at);

/* a.b over the rows, in the outer program. */
int dmk_dot(dmk_context *context, dmk_system *s, const dmk_buffer *a, const dmk_buffer *b, int at);
/* The maxima of u and of -u. */
int dmk_rows_range(dmk_context *context, dmk_system *s, const dmk_buffer *u, int at);

/* ---- multigrid.cl ---------------------------------------------------------------------------- */

/* x = step D^-1 rhs on T/2: the first smoothing step from 0. */
int dmk_smooth_first(dmk_context *context, dmk_system *s, const dmk_buffer *rhs, double step);
/* T/2 to T: the elements' parts of P'(operator x), into out; then rhs of T = P'rhs - their sums. */
int dmk_element_down(dmk_context *context, dmk_system *s, dmk_operator op, const dmk_buffer *x);
int dmk_restrict_rows(dmk_context *context, dmk_system *s, const dmk_buffer *rhs);
/* T to T/2, c the x_old of T: the elements' parts of the operator on x + P c, into out; then x += P c, if it is to
 * be kept, and with these x_old = x + step D^-1 (rhs - A x). */
int dmk_element_up(dmk_context *context, dmk_system *s, dmk_operator op, const dmk_buffer *x);
int dmk_rows_up(dmk_context *context, dmk_system *s, const dmk_buffer *rhs, bool keep,
                dmk_buffer *x, dmk_buffer *x_old, double step);
int dmk_graph_chebyshev(dmk_context *context, dmk_system *s, int32_t level, const dmk_buffer *x,
                        dmk_buffer *x_old, dmk_chebyshev_step c);
/* rhs of a level below T = the restricted rhs of the next finer one. */
int dmk_restrict(dmk_context *context, dmk_system *s, int32_t level);
/* On the next finer level: x = the level's prolonged x_old, next = x + step D^-1 (rhs - A x). */
int dmk_prolong_chebyshev(dmk_context *context, dmk_system *s, int32_t level, dmk_buffer *x,
                          dmk_buffer *next, double step);
/* x_old = coarse_inverse * rhs on the coarsest level. */
int dmk_coarse_solve(dmk_context *context, dmk_system *s);
/* coarse_inverse from the weights of the coarsest level, which is not of the tail; where s->dense is. */
int dmk_coarse_inverse(dmk_context *context, dmk_system *s);
/* The cycle on the levels from s->tail on, with its restriction: x_old of the first of them, with these
 * steps on each. */
int dmk_tail_cycle(dmk_context *context, dmk_system *s,
                   const dmk_chebyshev_step step[DMK_TAIL_STEPS]);
/* Their edges and weights, and, where s->dense is, coarse_inverse. */
int dmk_tail_refresh(dmk_context *context, dmk_system *s);
/* The edge weights of T/2's graph, of a system without T. */
int dmk_fine_edges(dmk_context *context, dmk_system *s, dmk_operator op);
/* Of a level above: edge weights by row, on T first those from the triangles', the inverse diagonal, from the
 * rows' sums or on T from the elements' bounds, diag_coarse; and the next level's edge weights. */
int dmk_graph_refresh(dmk_context *context, dmk_system *s, int32_t level);
/* The inverse diagonal on T/2 from the elements' bounds in out. */
int dmk_inverse_diagonal(dmk_context *context, dmk_system *s);

/* ---- density.cl ------------------------------------------------------------------------------ */

/* q = v.g / area and g = K v, which go to q and out_real if they are to be kept; slack: the rounding that v.g is raised
 * by, relative to its terms. Sums of mu v.g, of area mu, of this times L and L^2, L = 1/2 log q; and q's maximum. */
int dmk_element_energy(dmk_context *context, dmk_system *s, const dmk_buffer *v, int keep,
                       double slack, int at);
/* out_real: g becomes mu g. */
int dmk_element_scale(dmk_context *context, dmk_system *s);
/* weight, weight_real, edge, diag_coarse and, in out, the weighted diagonals of A(mu). */
int dmk_element_prepare(dmk_context *context, dmk_system *s);
/* One of Newton's steps: what u is scaled by, pseudo-time D, where D times |L| of an element is kept below 1 / bend
 * (0: nowhere), what the change of log mu is multiplied by on T/2, and mu's lower bound for the root of an area. */
typedef struct dmk_newton_step {
    double alpha, D, bend, relax, lowest;
} dmk_newton_step;

/* The same of Newton's M, its rank_one, and its right-hand side's parts in
 * out_real, which has g before; all but its weighted diagonals. Paired: these, too, beside the parts. */
int dmk_newton_prepare(dmk_context *context, dmk_system *s, bool paired,
                       const dmk_newton_step *step);
/* These, in out: the right-hand side must have been summed up. */
int dmk_newton_diagonal(dmk_context *context, dmk_system *s);
/* Without T: weight and rank_one in single precision, weight_real and rank_one_real, and in out_real the parts of A u
 * and the rest, for dmk_rows_outer_residual. */
int dmk_newton_prepare_wide(dmk_context *context, dmk_system *s, const dmk_newton_step *step);
/* x, of the outer program, times scale. */
int dmk_rows_scale(dmk_context *context, dmk_system *s, double scale, dmk_buffer *x);
/* The inner right-hand side cg[DMK_INNER].r = f + the rows' sums of out_real. */
int dmk_rows_rhs(dmk_context *context, dmk_system *s);
/* From pairs: that, the inverse diagonal on T/2, and in x the first smoothing step. */
int dmk_newton_rows(dmk_context *context, dmk_system *s, double step);
/* The outer residual cg[DMK_OUTER].r (and narrow) = f - the rows' sums of out_real. */
int dmk_rows_outer_residual(dmk_context *context, dmk_system *s);
/* mu after a Newton step w, of which rank_one knows the rest, and dmk_element_energy of u, kept; its four sums, that of
 * area |change of mu|, and the maximum. */
int dmk_newton_update(dmk_context *context, dmk_system *s, const dmk_newton_step *step, int at);
/* The same of a u that has w already, by rank_one_real. */
int dmk_newton_update_wide(dmk_context *context, dmk_system *s, const dmk_newton_step *step,
                           int at);
/* mu after an explicit step (see density.cl); sums of area |change of mu| and of area mu. */
int dmk_explicit_update(dmk_context *context, dmk_system *s, bool inertial, double dt, double beta,
                        double lowest, int at);

/* ---- nested.cl ------------------------------------------------------------------------------- */

/* Newton's steps with u linear on T: its values at the vertices' rows of s->u, what a step adds to them in s->w from
 * 0 on. load = P'f, once. */
int dmk_nested_load(dmk_context *context, dmk_system *s);
/* q, and dmk_element_energy's sums, but L of u at this scale. */
int dmk_nested_energy(dmk_context *context, dmk_system *s, double scale, int at);
/* Newton's edge, diag_coarse and, in out, the parts of its right-hand side; then rhs of T. */
int dmk_nested_prepare(dmk_context *context, dmk_system *s, const dmk_newton_step *step);
int dmk_nested_rhs(dmk_context *context, dmk_system *s);
/* As dmk_newton_update. */
int dmk_nested_update(dmk_context *context, dmk_system *s, const dmk_newton_step *step, int at);
/* u at the midpoints from the vertices'. */
int dmk_nested_refine(dmk_context *context, dmk_system *s);

/* ---- certificate.cl -------------------------------------------------------------------------- */

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

/* The repair of a potential under way. */
typedef struct dmk_repair_work {
    dmk_buffer *u, *before;      /* rows, real; before: without the momentum */
    dmk_buffer *mark;            /* per element: its slots in out_real are not 0 */
    dmk_buffer *ring;            /* per row: the ring around the hot ones that it is of */
    dmk_buffer *moved;           /* and the stamp of the last sweep that moved it */
    dmk_buffer *elements, *rows; /* the lists */
    dmk_buffer *count;           /* their lengths on the device, and here: */
    int32_t n_elements, n_rows;
    dmk_buffer *broken; /* per sweep since the lists were made: whether an element is above 1 */
} dmk_repair_work;

/* u = before = scale * from. */
int dmk_repair_start(dmk_context *context, dmk_system *s, const dmk_repair_work *w, double scale,
                     const dmk_buffer *from);
/* ring = 1 on the rows of elements with q > limit, of marked ones and of those with a row that moves. */
int dmk_repair_mark(dmk_context *context, dmk_system *s, const dmk_repair_work *w, double limit);
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
