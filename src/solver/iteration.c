#include "solver/iteration.h"

#include "solver/kernels.h"

#include <math.h>
#include <stdio.h>

bool dmk_is_shapely(const dmk_system *s)
{
    const double cot_20 = 2.747; /* of an angle of 20 degrees */
    return s->sharpest < cot_20;
}

int dmk_iteration_scalars(dmk_iteration *o, size_t n, double *sums)
{
    return dmk_buffer_read_real(o->ctx, o->sys->device, DMK_OUTER, o->sys->scalars, n, sums);
}

/* Where sums come to: the energies' from 0 on, see dmk_element_energy, and those of a Newton step one more. */
enum { UAU, MASS, SLOPE, SQUARE, TOP, CHANGE = TOP, NEWTON_TOP, FU, N_SCALARS };

static void take(dmk_iteration *o, const double *sums, double top)
{
    o->scale = 1;
    o->uau = sums[UAU];
    o->fu = sums[FU];
    o->mass = sums[MASS];
    o->slope = sums[SLOPE] / o->mass;
    o->square = sums[SQUARE] / o->mass;
    o->top = o->largest = top;
}

int dmk_iteration_energies(dmk_iteration *o)
{
    int rc;
    double sums[N_SCALARS];
    o->fresh = true;
    DMK_TRY(dmk_dot(o->ctx, o->sys, o->sys->f, o->sys->u, FU));
    DMK_TRY(dmk_element_energy(o->ctx, o->sys, o->sys->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0));
    DMK_TRY(dmk_iteration_scalars(o, N_SCALARS, sums));
    take(o, sums, sums[TOP]);
done:
    return rc;
}

int dmk_iteration_update(dmk_iteration *o, dmk_items over, bool first, const dmk_newton_step *step,
                         double *change)
{
    int rc;
    double sums[N_SCALARS];
    o->fresh = over == DMK_ROWS;
    o->ready = DMK_NOTHING;
    if (o->sys->without_T) {
        DMK_TRY(dmk_dot(o->ctx, o->sys, o->sys->f, o->sys->u, FU));
        DMK_TRY(dmk_newton_update_wide(o->ctx, o->sys, step, 0));
    } else {
        DMK_TRY(dmk_inner_finish(o->ctx, o->sys, over, first, step->alpha, FU));
        DMK_TRY(over == DMK_ROWS ? dmk_newton_update(o->ctx, o->sys, step, 0)
                                 : dmk_nested_update(o->ctx, o->sys, step, 0));
    }
    DMK_TRY(dmk_iteration_scalars(o, N_SCALARS, sums));
    take(o, sums, sums[NEWTON_TOP]);
    *change = sums[CHANGE] / sums[MASS] / step->relax;
done:
    return rc;
}

int dmk_iteration_measure_nested(dmk_iteration *o, double scale)
{
    int rc;
    double sums[N_SCALARS];
    DMK_TRY(dmk_nested_energy(o->ctx, o->sys, scale, 0));
    DMK_TRY(dmk_iteration_scalars(o, N_SCALARS, sums));
    take(o, sums, sums[TOP]);
    o->scale = scale;
done:
    return rc;
}

int dmk_iteration_energies_of(dmk_iteration *o, const dmk_buffer *v, int keep, double *fv)
{
    int rc;
    double sums[N_SCALARS];
    const bool wide = dmk_device_real(o->sys->device, DMK_OUTER) == sizeof(double);
    o->fresh = false;
    DMK_TRY(dmk_dot(o->ctx, o->sys, o->sys->f, v, FU));
    DMK_TRY(dmk_element_energy(o->ctx, o->sys, v, keep, wide ? DMK_ENERGY_ROUNDING : 0, 0));
    DMK_TRY(dmk_iteration_scalars(o, N_SCALARS, sums));
    *fv = sums[FU];
    o->top = sums[TOP];
done:
    return rc;
}

void dmk_iteration_measure(dmk_iteration *o, double alpha)
{
    const double shift = log(fabs(alpha) / o->scale);
    o->rho = sqrt(fmax(0, o->square + shift * (2 * o->slope + shift)));
    o->top = alpha * alpha * o->largest;
}

int dmk_iteration_operator(dmk_iteration *o, dmk_ready wanted)
{
    int rc = DMK_OK;
    if (o->ready >= wanted) return DMK_OK;
    DMK_TRY(dmk_element_prepare(o->ctx, o->sys));
    if (o->ready < DMK_DIAGONAL) DMK_TRY(dmk_inverse_diagonal(o->ctx, o->sys));
    if (wanted == DMK_HIERARCHY) DMK_TRY(dmk_multigrid_refresh(o->ctx, o->sys, DMK_STIFFNESS));
    o->ready = wanted;
done:
    return rc;
}

/* The outer residual f - A u for CG, and the operator. */
static int prepare_solve(dmk_iteration *o)
{
    int rc;
    dmk_system *s = o->sys;
    DMK_TRY(dmk_iteration_energies(o));
    o->fresh = false;
    DMK_TRY(dmk_element_scale(o->ctx, s));
    DMK_TRY(dmk_rows_outer_residual(o->ctx, s));
    DMK_TRY(dmk_iteration_operator(o, DMK_HIERARCHY));
done:
    return rc;
}

/* The message for a divergence: what happened, and what the caller can change in the method asked for. */
int dmk_iteration_diverged(const dmk_iteration *o, int step, const char *what)
{
    const bool is_single = dmk_device_real(o->sys->device, DMK_OUTER) < sizeof(double);
    const char *advice = o->asked == DMK_EULER      ? "try a smaller dt, or"
                         : o->asked == DMK_INERTIAL ? "try a smaller inertia, or"
                         : is_single
                             ? "Newton's steps do not converge in single precision: compute in "
                               "double precision, or"
                             : "Newton's steps do not converge, however well each is solved:";
    if (!o->mesh->triangle)
        return dmk_fail(
            o->ctx, DMK_E_DIVERGED,
            "the iteration diverged at step %d (%s); %s improve the mesh's worst triangles", step,
            what, advice);
    int32_t worst = 0; /* half-edge with the largest cotangent */
    for (int32_t h = 1; h < 3 * o->mesh->n_triangles; h++)
        if (dmk_cot(o->mesh, h) > dmk_cot(o->mesh, worst)) worst = h;
    const double angle = atan2(1, dmk_cot(o->mesh, worst)) * DMK_DEGREES;
    return dmk_fail(o->ctx, DMK_E_DIVERGED,
                    "the iteration diverged at step %d (%s); %s improve the mesh's worst "
                    "triangles: its smallest "
                    "angle is %.2g degrees, in triangle %d",
                    step, what, advice, angle, (int)o->triangle_old[worst / 3]);
}

int dmk_iteration_solve(dmk_iteration *o, double tolerance, int max_iterations)
{
    int rc;
    o->sys->fine_degree = o->light ? 1 : o->sys->usual_degree;
    DMK_TRY(prepare_solve(o));
    /* Of f.A^-1 f, which is short by the square of u's error only. */
    const double known = fabs(2 * o->fu - o->uau);
    rc = dmk_pcg(o->ctx, o->sys, DMK_STIFFNESS, o->sys->u, max_iterations, tolerance, known,
                 o->stats);
    if (rc == DMK_E_DIVERGED) {
        char what[200];
        snprintf(what, sizeof what, "%.199s", o->ctx->message);
        rc = dmk_iteration_diverged(o, o->stats->steps + 1, what);
    }
done:
    return rc;
}

int dmk_iteration_step_done(dmk_iteration *o, int step, int max_steps, int iterations,
                            double change)
{
    o->certified = false;
    step += o->before;
    o->stats->steps = step;
    o->stats->change = change;
    if (!(change < 1e6)) {
        char what[64];
        snprintf(what, sizeof what, "relative change of mu %.0e",
                 change); /* no comma in any locale */
        return dmk_iteration_diverged(o, step, what);
    }
    dmk_progress report = {.stage = "solve",
                           .step = step,
                           .max_steps = o->before + max_steps,
                           .cg_iterations = iterations,
                           .change = change,
                           .tolerance = o->tolerance,
                           .gap = o->stats->gap,
                           .seconds = dmk_seconds() - o->began};
    return dmk_report(o->ctx, &report);
}

int dmk_iteration_limit(dmk_iteration *o, int max_steps, double change)
{
    const int steps = o->before + max_steps;
    return dmk_fail(
        o->ctx, DMK_E_LIMIT,
        "%d step%s did not reach the tolerance: relative change of mu per unit time %.2g, "
        "wanted %.2g; raise max_steps or tolerance",
        steps, steps == 1 ? "" : "s", change, o->tolerance);
}
