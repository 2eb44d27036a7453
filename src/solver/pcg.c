#include "solver/pcg.h"

#include "solver/kernels.h"

#include <math.h>

/* Whether r.z is small enough, or will be after one more iteration that gains as much as the last one: this one is the
 * last then, and saves the V-cycle that would show it. `before`: r.z of the iteration before, or 0. On extreme needles
 * single precision makes the V-cycle indefinite: r.z < 0 is no convergence. */
static bool is_done(double rz, double before, double wanted, bool *last)
{
    *last = rz > 0 && before > 0 && rz * (rz / before) <= wanted;
    return fabs(rz) <= wanted;
}

/* z = V-cycle(r), then beta and the new direction. */
static int direction(dmk_context *ctx, dmk_system *s, dmk_operator op, bool first)
{
    int rc;
    DMK_TRY(dmk_v_cycle(ctx, s, op, s->cg[DMK_OUTER].narrow, !first));
    DMK_TRY(dmk_cg_dots(ctx, s, first, s->x_old));
    DMK_TRY(dmk_cg_direction(ctx, s, s->x_old));
done:
    return rc;
}

/* ap = A p or M p, which gives alpha, and the step. */
static int step(dmk_context *ctx, dmk_system *s, dmk_operator op, dmk_buffer *x, bool last)
{
    int rc;
    const dmk_buffer *p = s->cg[DMK_OUTER].p;
    DMK_TRY(op == DMK_STIFFNESS ? dmk_element_stiffness(ctx, s, DMK_OUTER, p)
                                : dmk_element_newton(ctx, s, DMK_OUTER, p));
    DMK_TRY(dmk_rows_apply(ctx, s, s->cg[DMK_OUTER].p, s->cg[DMK_OUTER].ap));
    DMK_TRY(dmk_cg_step(ctx, s, x, dmk_first_step(), last));
done:
    return rc;
}

int dmk_pcg(dmk_context *ctx, dmk_system *s, dmk_operator op, dmk_buffer *x, int max_iterations,
            double tolerance, double energy, dmk_stats *stats)
{
    int rc = DMK_OK;
    double before = 0;
    bool last = false;
    for (int i = 0; i < max_iterations && !last; i++) {
        DMK_TRY(direction(ctx, s, op, i == 0));
        stats->v_cycles++;
        if (tolerance > 0) {
            double state[5];
            DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->state, 5, state));
            if (!(state[0] < 1e300)) {
                rc = dmk_fail(ctx, DMK_E_DIVERGED,
                              "conjugate gradients broke down after %d iterations (r.z = %g)", i,
                              state[0]);
                goto done;
            }
            const double reference = energy > state[4] ? energy : state[4];
            if (is_done(state[0], before, tolerance * tolerance * reference, &last)) break;
            before = state[0];
        }
        DMK_TRY(step(ctx, s, op, x, last || i == max_iterations - 1));
        stats->cg_iterations++;
    }
done:
    return rc;
}

int dmk_inner_solve(dmk_context *ctx, dmk_system *s, dmk_items over, int iterations,
                    dmk_stats *stats)
{
    int rc = DMK_OK;
    for (int i = 0; i < iterations; i++) {
        /* The right-hand side comes with its first smoothing step. */
        if (over == DMK_ROWS) {
            DMK_TRY(dmk_v_cycle(ctx, s, DMK_NEWTON_MATRIX, s->cg[DMK_INNER].r, true));
            DMK_TRY(dmk_element_newton(ctx, s, DMK_INNER, s->x_old));
        } else {
            DMK_TRY(dmk_mesh_cycle(ctx, s));
        }
        DMK_TRY(dmk_inner_apply(ctx, s, over, i == 0));
        if (i + 1 < iterations) DMK_TRY(dmk_inner_step(ctx, s, over, i == 0, dmk_first_step()));
        stats->v_cycles++;
        stats->cg_iterations++;
    }
done:
    return rc;
}
