#include "solver/outer.h"

#include <math.h>

int dmk_outer_sums(dmk_outer *o, size_t items, int count, int maxima, double *sums)
{
    int rc;
    dmk_system *s = o->sys;
    int32_t parts = (int32_t)dmk_launch_parts(s->device, items);
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, sum_partials), 1,
                       DMK_INT(parts), DMK_INT(count), DMK_INT(maxima), DMK_BUF(s->partial),
                       DMK_BUF(s->scalars), DMK_INT(0)));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, s->scalars, (size_t)count, sums));
done:
    return rc;
}

int dmk_outer_energies_of(dmk_outer *o, const dmk_buffer *u, double *fu, double *uau)
{
    int rc;
    dmk_system *s = o->sys;
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, element_energy), s->n_elements,
                       DMK_INT(s->n_elements), DMK_BUF(s->index), DMK_BUF(s->cot), DMK_BUF(s->area),
                       DMK_BUF(s->mu), DMK_BUF(u), DMK_BUF(s->g), DMK_BUF(s->q),
                       DMK_BUF(s->partial)));
    DMK_TRY(dmk_outer_sums(o, (size_t)s->n_elements, 1, 0, uau));
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, dot_real), s->n_rows,
                       DMK_INT(s->n_rows), DMK_BUF(s->f), DMK_BUF(u), DMK_BUF(s->partial)));
    DMK_TRY(dmk_outer_sums(o, (size_t)s->n_rows, 1, 0, fu));
done:
    return rc;
}

int dmk_outer_energies(dmk_outer *o) { return dmk_outer_energies_of(o, o->sys->u, &o->fu, &o->uau); }

int dmk_outer_measure(dmk_outer *o, double alpha)
{
    int rc;
    double sums[3];
    dmk_system *s = o->sys;
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, element_measure), s->n_elements,
                       DMK_INT(s->n_elements), DMK_FLOAT(alpha), DMK_BUF(s->area), DMK_BUF(s->mu),
                       DMK_BUF(s->q), DMK_BUF(s->partial)));
    DMK_TRY(dmk_outer_sums(o, (size_t)s->n_elements, 3, 1, sums));
    o->mass = sums[1];
    o->rho = sqrt(sums[0] / sums[1]);
    o->top = sums[2];
done:
    return rc;
}

/* The outer residual f - A u for CG, and A's coefficients and coarse operators. */
static int prepare_solve(dmk_outer *o)
{
    int rc;
    dmk_system *s = o->sys;
    DMK_TRY(dmk_outer_energies(o));
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, element_scale), s->n_elements,
                       DMK_INT(s->n_elements), DMK_BUF(s->mu), DMK_BUF(s->g)));
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, rows_outer_residual), s->n_rows,
                       DMK_INT(s->n_rows), DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->g),
                       DMK_BUF(s->f), DMK_BUF(s->cg[DMK_OUTER].r),
                       DMK_BUF(s->cg[DMK_OUTER].narrow)));
    DMK_TRY(DMK_LAUNCH(o->ctx, s->device, DMK_KERNEL(s, DMK_OUTER, element_prepare), s->n_elements,
                       DMK_INT(s->n_elements), DMK_BUF(s->cot), DMK_BUF(s->mu),
                       DMK_BUF(s->weight_real), DMK_BUF(s->weight), DMK_BUF(s->out),
                       DMK_BUF(s->link), DMK_BUF(s->diag_coarse)));
    DMK_TRY(dmk_multigrid_refresh(o->ctx, s));
done:
    return rc;
}

int dmk_outer_solve(dmk_outer *o, dmk_buffer *x, double tolerance, int max_iterations,
                    double *energy)
{
    int rc, before = o->stats->cg_iterations;
    double gain = 0;
    DMK_TRY(prepare_solve(o));
    /* f.A^-1 f = 2 f.u - u.Au + r.A^-1 r; the first two are short by the square of the error only. */
    double known = 2 * o->fu - o->uau;
    DMK_TRY(dmk_pcg(o->ctx, o->sys, DMK_OUTER, DMK_STIFFNESS, x, max_iterations, tolerance,
                    fabs(known), &o->stats->cg_iterations, &gain));
    o->stats->v_cycles += o->stats->cg_iterations - before + 1;
    if (energy) *energy = known + gain;
done:
    return rc;
}

int dmk_outer_step_done(dmk_outer *o, int step, int max_steps, int iterations, double change)
{
    o->stats->steps = step;
    o->stats->change = change;
    if (!(change < 1e6)) {
        return dmk_fail(o->ctx, DMK_E_DIVERGED,
                        "the iteration diverged at step %d (relative change of mu %g); try a "
                        "smaller --dt, --start uniform, or improve the mesh's worst triangles",
                        step, change);
    }
    dmk_progress report = {.stage = "solve", .step = step, .max_steps = max_steps,
                           .cg_iterations = iterations, .change = change,
                           .tolerance = o->tolerance, .gap = o->stats->gap,
                           .seconds = dmk_seconds() - o->began};
    return dmk_report(o->ctx, &report);
}

int dmk_outer_limit(dmk_outer *o, int max_steps)
{
    return dmk_fail(o->ctx, DMK_E_LIMIT,
                    "%d steps did not reach the tolerance: relative change of mu per unit time %.2g, "
                    "wanted %.2g; raise --max-steps or --tolerance",
                    max_steps, o->stats->change, o->tolerance);
}
