#include "solver/multigrid.h"

#include "base/dense.h"

#include <math.h>
#include <stdlib.h>

/* Chebyshev smoothing on [1/6, 1]: the weighted diagonals make 1 a rigorous bound of the spectrum on
 * T/2 and T (elements) and on the graph levels (row sums). Three-term recurrence:
 *     x1 = x0 + first D^-1 r0,   x_{k+1} = x_k + momentum_k (x_k - x_{k-1}) + step_k D^-1 r_k. */
static const double low = 1.0 / 6, high = 1.0;

typedef struct chebyshev {
    int degree;
    double first, momentum[3], step[3];
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

int dmk_inner_elements(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *x)
{
    if (op == DMK_STIFFNESS) {
        return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, element_stiffness),
                          s->n_elements, DMK_INT(s->n_elements), DMK_BUF(s->index),
                          DMK_BUF(s->weight), DMK_BUF(x), DMK_BUF(s->out));
    }
    return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, element_newton), s->n_elements,
                      DMK_INT(s->n_elements), DMK_BUF(s->index), DMK_BUF(s->weight),
                      DMK_BUF(s->rank_one), DMK_BUF(x), DMK_BUF(s->out));
}

/* ---- refresh --------------------------------------------------------------------------------- */

static int refresh_coarsest(dmk_context *ctx, dmk_system *s)
{
    int rc;
    const dmk_level *l = &s->level[s->n_levels - 1];
    size_t n = (size_t)l->n, links = (size_t)s->n_coarse_links;
    float *link = NULL, *columns = NULL;
    double *laplacian = NULL, *inverse = NULL;
    DMK_TRY(DMK_NEW(ctx, link, links));
    DMK_TRY(DMK_NEW(ctx, laplacian, n * n));
    DMK_TRY(DMK_NEW(ctx, inverse, n * n));
    DMK_TRY(DMK_NEW(ctx, columns, n * (size_t)l->n_pad));
    DMK_TRY(dmk_buffer_read(ctx, s->device, l->link, 0, links * sizeof *link, link));
    for (size_t k = 0; k < links; k++) {
        size_t i = (size_t)s->coarse_link_vertex[2 * k], j = (size_t)s->coarse_link_vertex[2 * k + 1];
        laplacian[i * n + i] += link[k];
        laplacian[j * n + j] += link[k];
        laplacian[i * n + j] -= link[k];
        laplacian[j * n + i] -= link[k];
    }
    DMK_TRY(dmk_laplacian_inverse(ctx, l->n, laplacian, inverse));
    for (size_t c = 0; c < n; c++) {
        for (size_t i = 0; i < n; i++) columns[c * (size_t)l->n_pad + i] = (float)inverse[c * n + i];
    }
    DMK_TRY(dmk_buffer_write(ctx, s->device, s->coarse_inverse, 0,
                             n * (size_t)l->n_pad * sizeof *columns, columns));
done:
    free(link);
    free(laplacian);
    free(inverse);
    free(columns);
    return rc;
}

int dmk_multigrid_refresh(dmk_context *ctx, dmk_system *s)
{
    int rc;
    dmk_device *dev = s->device;
    dmk_level *t = &s->level[0];
    DMK_TRY(DMK_LAUNCH(ctx, dev, DMK_KERNEL(s, DMK_INNER, inverse_diagonal), s->n_rows,
                       DMK_INT(s->n_rows), DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out),
                       DMK_BUF(s->inv_diag)));
    DMK_TRY(DMK_LAUNCH(ctx, dev, DMK_KERNEL(s, DMK_INNER, links_from_triangles), t->n_links,
                       DMK_INT(t->n_links), DMK_BUF(s->edge_place), DMK_BUF(s->link),
                       DMK_BUF(t->link)));
    for (int32_t i = 0; i < s->n_levels; i++) {
        dmk_level *l = &s->level[i];
        if (i > 0) {
            DMK_TRY(DMK_LAUNCH(ctx, dev, DMK_KERNEL(s, DMK_INNER, links_from_links), l->n_links,
                               DMK_INT(l->n_links), DMK_BUF(l->galerkin_row),
                               DMK_BUF(l->galerkin_link), DMK_BUF(l->galerkin_coef),
                               DMK_BUF(s->level[i - 1].link), DMK_BUF(l->link)));
        }
        DMK_TRY(DMK_LAUNCH(ctx, dev, DMK_KERNEL(s, DMK_INNER, graph_weights), l->n, DMK_INT(l->n),
                           DMK_BUF(l->slice), DMK_BUF(l->number), DMK_BUF(l->link),
                           DMK_BUF(l->weight), DMK_BUF(l->inv_diag)));
    }
    /* On T the elements' bound is sharper than the rows'. */
    DMK_TRY(DMK_LAUNCH(ctx, dev, DMK_KERNEL(s, DMK_INNER, inverse_diagonal), t->n, DMK_INT(t->n),
                       DMK_BUF(s->corner_slice), DMK_BUF(s->corner_slot), DMK_BUF(s->diag_coarse),
                       DMK_BUF(t->inv_diag)));
    DMK_TRY(refresh_coarsest(ctx, s));
done:
    return rc;
}

/* ---- cycle ----------------------------------------------------------------------------------- */

/* x_old <- Chebyshev step from x on T/2; `keep` = 0 forgets the older iterate. */
static int fine_step(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *rhs,
                     const dmk_buffer *x, dmk_buffer *x_old, double momentum, double keep,
                     double step)
{
    int rc;
    DMK_TRY(dmk_inner_elements(ctx, s, op, x));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, rows_chebyshev), s->n_rows,
                       DMK_INT(s->n_rows), DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out),
                       DMK_BUF(rhs), DMK_BUF(s->inv_diag), DMK_BUF(x), DMK_BUF(x_old),
                       DMK_FLOAT(momentum), DMK_FLOAT(keep), DMK_FLOAT(step)));
done:
    return rc;
}

static int graph_step(dmk_context *ctx, dmk_system *s, dmk_level *l, const dmk_buffer *x,
                      dmk_buffer *x_old, double momentum, double keep, double step)
{
    return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, graph_chebyshev), l->n,
                      DMK_INT(l->n), DMK_BUF(l->slice), DMK_BUF(l->neighbour), DMK_BUF(l->weight),
                      DMK_BUF(l->rhs), DMK_BUF(l->inv_diag), DMK_BUF(x), DMK_BUF(x_old),
                      DMK_FLOAT(momentum), DMK_FLOAT(keep), DMK_FLOAT(step));
}

/* Restrict the finer level's residual to level i and take the first smoothing step there. */
static int restrict_to(dmk_context *ctx, dmk_system *s, int32_t i, double step)
{
    dmk_level *l = &s->level[i];
    if (i == 0) {
        return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, restrict_midpoints), l->n,
                          DMK_INT(l->n), DMK_INT(s->vertex_row), DMK_BUF(l->slice),
                          DMK_BUF(l->number), DMK_BUF(s->residual), DMK_FLOAT(step),
                          DMK_BUF(l->inv_diag), DMK_BUF(l->rhs), DMK_BUF(l->x));
    }
    return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, restrict_rows), l->n, DMK_INT(l->n),
                      DMK_BUF(l->restrict_slice), DMK_BUF(l->restrict_entry),
                      DMK_BUF(l->restrict_weight), DMK_BUF(s->level[i - 1].residual),
                      DMK_FLOAT(step), DMK_BUF(l->inv_diag), DMK_BUF(l->rhs), DMK_BUF(l->x));
}

/* Add level i's correction (in its x_old) to x of the finer level. */
static int prolong_from(dmk_context *ctx, dmk_system *s, int32_t i, dmk_buffer *x)
{
    dmk_level *l = &s->level[i];
    if (i == 0) {
        return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, prolong_midpoints), s->n_rows,
                          DMK_INT(s->n_rows), DMK_BUF(s->ends), DMK_BUF(l->x_old), DMK_BUF(x));
    }
    dmk_level *fine = &s->level[i - 1];
    return DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, prolong_rows), fine->n,
                      DMK_INT(fine->n), DMK_BUF(l->prolong_index), DMK_BUF(l->prolong_weight),
                      DMK_BUF(l->x_old), DMK_BUF(x));
}

/* Levels i and below, from the residual of the level above i to its corrected x. */
static int graph_cycle(dmk_context *ctx, dmk_system *s, int32_t i, const chebyshev *c, dmk_buffer *x)
{
    int rc;
    dmk_level *l = &s->level[i];
    DMK_TRY(restrict_to(ctx, s, i, c->first));
    if (i == s->n_levels - 1) {
        DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, coarse_solve), l->n_pad,
                           DMK_INT(l->n), DMK_INT(l->n_pad), DMK_BUF(s->coarse_inverse),
                           DMK_BUF(l->rhs), DMK_BUF(l->x_old)));
    } else {
        DMK_TRY(graph_step(ctx, s, l, l->x, l->x_old, c->momentum[1], 0, c->step[1]));
        DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, graph_residual), l->n,
                           DMK_INT(l->n), DMK_BUF(l->slice), DMK_BUF(l->neighbour),
                           DMK_BUF(l->weight), DMK_BUF(l->x_old), DMK_BUF(l->rhs),
                           DMK_BUF(l->residual)));
        DMK_TRY(graph_cycle(ctx, s, i + 1, c, l->x_old));
        DMK_TRY(graph_step(ctx, s, l, l->x_old, l->x, 0, 1, c->first));
        DMK_TRY(graph_step(ctx, s, l, l->x, l->x_old, c->momentum[1], 1, c->step[1]));
    }
    DMK_TRY(prolong_from(ctx, s, i, x));
done:
    return rc;
}

/* Smooth on T/2 from now (its older iterate in old) to the polynomial's degree; the first step of a
 * cycle starts from 0 and is done by smooth_first. The two take turns; *last is where x ends. */
static int smooth_fine(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *rhs,
                       const chebyshev *c, bool from_zero, dmk_buffer *now, dmk_buffer *old,
                       dmk_buffer **last)
{
    int rc = DMK_OK;
    for (int k = from_zero ? 1 : 0; k < c->degree; k++) {
        double keep = from_zero && k == 1 ? 0 : 1;
        if (k == 0) DMK_TRY(fine_step(ctx, s, op, rhs, now, old, 0, 1, c->first));
        else DMK_TRY(fine_step(ctx, s, op, rhs, now, old, c->momentum[k], keep, c->step[k]));
        dmk_buffer *swap = now;
        now = old;
        old = swap;
    }
    *last = now;
done:
    return rc;
}

int dmk_v_cycle(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *rhs)
{
    int rc;
    dmk_buffer *x;
    /* Newton's few loose iterations gain nothing from a higher degree. */
    chebyshev fine = polynomial(op == DMK_STIFFNESS ? s->fine_degree : 2), coarse = polynomial(2);
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, smooth_first), s->n_rows,
                       DMK_INT(s->n_rows), DMK_FLOAT(fine.first), DMK_BUF(s->inv_diag), DMK_BUF(rhs),
                       DMK_BUF(s->x)));
    DMK_TRY(smooth_fine(ctx, s, op, rhs, &fine, true, s->x, s->x_old, &x));
    DMK_TRY(dmk_inner_elements(ctx, s, op, x));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_INNER, rows_residual), s->n_rows,
                       DMK_INT(s->n_rows), DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out),
                       DMK_BUF(rhs), DMK_BUF(s->residual)));
    DMK_TRY(graph_cycle(ctx, s, 0, &coarse, x));
    /* As many steps again, so x ends in x_old whatever the degree. */
    DMK_TRY(smooth_fine(ctx, s, op, rhs, &fine, false, x, x == s->x ? s->x_old : s->x, &x));
done:
    return rc;
}
