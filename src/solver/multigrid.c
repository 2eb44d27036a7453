#include "solver/multigrid.h"

#include "base/dense.h"
#include "solver/kernels.h"

#include <math.h>
#include <stdlib.h>

/* Chebyshev smoothing on [1/6, 1]: the weighted diagonals make 1 a rigorous bound of the spectrum on
 * T/2 and T (elements) and on the graph levels (row sums). Three-term recurrence:
 *     x1 = x0 + first D^-1 r0,   x_{k+1} = x_k + momentum_k (x_k - x_{k-1}) + step_k D^-1 r_k. */
static const double low = 1.0 / 6, high = 1.0;

typedef struct chebyshev {
    int degree;
    double first, momentum[DMK_TAIL_STEPS], step[DMK_TAIL_STEPS]; /* the highest degree */
} chebyshev;

static chebyshev polynomial(int degree)
{
    double theta = (high + low) / 2, delta = (high - low) / 2, sigma = theta / delta;
    double rho = 1 / sigma;
    chebyshev c = {.degree = degree, .first = 1 / theta};
    for (int k = 1; k < degree; k++) {
        double next = 1 / (2 * sigma - rho);
        c.momentum[k] = next * rho;
        c.step[k] = 2 * next / delta;
        rho = next;
    }
    return c;
}

/* Step k; `from_zero`: step 0 was taken from x = 0, so step 1 forgets the older iterate. */
static dmk_chebyshev_step step_of(const chebyshev *c, int k, bool from_zero)
{
    if (k == 0) return (dmk_chebyshev_step){0, 1, c->first};
    return (dmk_chebyshev_step){c->momentum[k], from_zero && k == 1 ? 0 : 1, c->step[k]};
}

int dmk_inner_elements(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *x)
{
    if (op == DMK_STIFFNESS) return dmk_element_stiffness(ctx, s, DMK_INNER, x);
    return dmk_element_newton(ctx, s, DMK_INNER, x);
}

/* ---- refresh --------------------------------------------------------------------------------- */

/* The coarsest inverse by the host, which waits for the device and makes it wait. */
static int refresh_coarsest(dmk_context *ctx, dmk_system *s)
{
    int rc;
    const dmk_level *l = &s->level[s->n_levels - 1];
    size_t n = (size_t)l->n, edges = (size_t)s->n_coarse_edges;
    float *edge = NULL, *columns = NULL;
    double *laplacian = NULL, *inverse = NULL;
    DMK_TRY(DMK_NEW(ctx, edge, edges));
    DMK_TRY(DMK_NEW(ctx, laplacian, n * n));
    DMK_TRY(DMK_NEW(ctx, inverse, n * n));
    DMK_TRY(DMK_NEW(ctx, columns, n * (size_t)l->n_pad));
    DMK_TRY(dmk_buffer_read(ctx, s->device, l->edge, 0, edges * sizeof *edge, edge));
    for (size_t k = 0; k < edges; k++) {
        size_t i = (size_t)s->coarse_edge_vertex[2 * k],
               j = (size_t)s->coarse_edge_vertex[2 * k + 1];
        laplacian[i * n + i] += edge[k];
        laplacian[j * n + j] += edge[k];
        laplacian[i * n + j] -= edge[k];
        laplacian[j * n + i] -= edge[k];
    }
    DMK_TRY(dmk_laplacian_inverse(ctx, l->n, laplacian, inverse));
    for (size_t c = 0; c < n; c++) {
        for (size_t i = 0; i < n; i++)
            columns[c * (size_t)l->n_pad + i] = (float)inverse[c * n + i];
    }
    DMK_TRY(dmk_buffer_write(ctx, s->device, s->coarse_inverse, 0,
                             n * (size_t)l->n_pad * sizeof *columns, columns));
done:
    free(edge);
    free(laplacian);
    free(inverse);
    free(columns);
    return rc;
}

int dmk_multigrid_refresh(dmk_context *ctx, dmk_system *s, dmk_operator op)
{
    int rc = DMK_OK;
    if (s->without_T) DMK_TRY(dmk_fine_edges(ctx, s, op));
    for (int32_t i = 0; i < s->tail && i < s->n_levels; i++) DMK_TRY(dmk_graph_refresh(ctx, s, i));
    if (s->tail < s->n_levels)
        DMK_TRY(dmk_tail_refresh(ctx, s));
    else if (s->dense)
        DMK_TRY(dmk_coarse_inverse(ctx, s));
    if (!s->dense) DMK_TRY(refresh_coarsest(ctx, s));
done:
    return rc;
}

/* ---- cycle ----------------------------------------------------------------------------------- */

double dmk_first_step(void)
{
    return polynomial(2).first; /* the same for all degrees */
}

/* Two iterates take turns. */
typedef struct iterates {
    dmk_buffer *now, *old;
} iterates;

static void swap(iterates *x)
{
    *x = (iterates){x->old, x->now};
}

/* Smoothing steps on a graph level, on the way up only: on T three, or four for A and where T/2 has one step or no
 * part; on levels of more rows than the tail's two, for each of them is a launch; on smaller ones DMK_TAIL_STEPS. 93
 * solves on meshes of scans and CAD take 0.944 of the steps that they take with one before and two after on all these
 * levels (geometric mean), 0.954 with two and two, 0.950 with six on the small ones, 0.959 with four, 0.986 with three;
 * a fourth on T gains 0.03. A cycle that is not symmetric is borne by the beta of conjugate gradients (base.cl): with
 * three on T A's solves take 954 iterations for 941, and to 1e-8 7 for 6. */
enum { STEPS_ON_T = 3, MORE_ON_T = 4, STEPS_ON_LARGE = 2 };

/* By the rows of the whole mesh's level, so that ranks do the same. */
static int steps_on(const dmk_system *s, int32_t i, bool more)
{
    const bool dealt = s->share && i < s->share->first_whole;
    const int64_t n = dealt ? s->share->vertex[i].n_whole : s->level[i].n;
    if (i == 0) return more ? MORE_ON_T : STEPS_ON_T;
    return n > DMK_TAIL_MOST ? STEPS_ON_LARGE : DMK_TAIL_STEPS;
}

static int tail_cycle(dmk_context *ctx, dmk_system *s)
{
    const chebyshev c = polynomial(DMK_TAIL_STEPS);
    dmk_chebyshev_step step[DMK_TAIL_STEPS];
    for (int k = 0; k < DMK_TAIL_STEPS; k++) step[k] = step_of(&c, k, false);
    return dmk_tail_cycle(ctx, s, step);
}

/* Level i and those below: x_old of level i from its rhs. */
static int graph_cycle(dmk_context *ctx, dmk_system *s, int32_t i, bool more)
{
    int rc;
    const dmk_level *l = &s->level[i];
    const chebyshev c = polynomial(steps_on(s, i, more));
    iterates x = c.degree % 2 ? (iterates){l->x, l->x_old} : (iterates){l->x_old, l->x};
    if (i == s->tail) return tail_cycle(ctx, s);
    if (i == s->n_levels - 1) return dmk_coarse_solve(ctx, s);
    if (i + 1 < s->tail) DMK_TRY(dmk_restrict(ctx, s, i + 1));
    DMK_TRY(graph_cycle(ctx, s, i + 1, more));
    DMK_TRY(dmk_prolong_chebyshev(ctx, s, i + 1, x.now, x.old, c.first));
    for (int k = 1; k < c.degree; k++) {
        swap(&x);
        DMK_TRY(dmk_graph_chebyshev(ctx, s, i, x.now, x.old, step_of(&c, k, false)));
    }
done:
    return rc;
}

int dmk_mesh_cycle(dmk_context *ctx, dmk_system *s)
{
    return graph_cycle(ctx, s, 0, true);
}

/* The steps after the first one. `from_zero`: that was from 0. */
static int smooth(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *rhs,
                  const chebyshev *c, bool from_zero, iterates *x)
{
    int rc = DMK_OK;
    for (int k = 1; k < c->degree; k++) {
        DMK_TRY(dmk_inner_elements(ctx, s, op, x->now));
        DMK_TRY(dmk_rows_chebyshev(ctx, s, rhs, x->now, x->old, step_of(c, k, from_zero)));
        swap(x);
    }
done:
    return rc;
}

int dmk_v_cycle(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *rhs, bool begun)
{
    int rc = DMK_OK;
    iterates x = {s->x, s->x_old};
    if (s->without_T) return graph_cycle(ctx, s, 0, true);
    const chebyshev fine = polynomial(op == DMK_STIFFNESS ? s->fine_degree : s->newton_degree);
    if (!begun) DMK_TRY(dmk_smooth_first(ctx, s, rhs, fine.first));
    DMK_TRY(smooth(ctx, s, op, rhs, &fine, true, &x));
    DMK_TRY(dmk_element_down(ctx, s, op, x.now));
    DMK_TRY(dmk_restrict_rows(ctx, s, rhs));
    DMK_TRY(graph_cycle(ctx, s, 0, op == DMK_STIFFNESS || fine.degree == 1));
    DMK_TRY(dmk_element_up(ctx, s, op, x.now));
    DMK_TRY(dmk_rows_up(ctx, s, rhs, fine.degree > 1, x.now, x.old, fine.first));
    swap(&x);
    /* As many steps again, so x ends in x_old whatever the degree. */
    DMK_TRY(smooth(ctx, s, op, rhs, &fine, false, &x));
done:
    return rc;
}
