#include "solver/pcg.h"

enum { LOOK_EVERY = 2 };

/* z = V-cycle(r), then beta and the new direction. */
static int direction(dmk_context *ctx, dmk_system *s, dmk_program p, dmk_operator op, int first)
{
    int rc;
    int32_t n = s->n_rows, parts = (int32_t)dmk_launch_parts(s->device, (size_t)n);
    DMK_TRY(dmk_v_cycle(ctx, s, op, s->cg[p].narrow));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, cg_dots), n, DMK_INT(n),
                       DMK_BUF(s->cg[p].r), DMK_BUF(s->cg[p].ap), DMK_BUF(s->x_old),
                       DMK_BUF(s->partial)));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, cg_beta), 1, DMK_INT(parts),
                       DMK_INT(first), DMK_BUF(s->partial), DMK_BUF(s->state)));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, cg_direction), n, DMK_INT(n),
                       DMK_BUF(s->state), DMK_BUF(s->x_old), DMK_BUF(s->cg[p].p)));
done:
    return rc;
}

/* ap = operator * p with partial sums of p.ap, then alpha and the step. */
static int step(dmk_context *ctx, dmk_system *s, dmk_program p, dmk_operator op, dmk_buffer *x)
{
    int rc;
    int32_t n = s->n_rows, parts = (int32_t)dmk_launch_parts(s->device, (size_t)n);
    dmk_buffer *out = p == DMK_INNER ? s->out : s->out_real;
    if (p == DMK_INNER) {
        DMK_TRY(dmk_inner_elements(ctx, s, op, s->cg[p].p));
    } else {
        DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL(s, DMK_OUTER, element_stiffness),
                           s->n_elements, DMK_INT(s->n_elements), DMK_BUF(s->index),
                           DMK_BUF(s->weight_real), DMK_BUF(s->cg[p].p), DMK_BUF(out)));
    }
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, rows_apply), n, DMK_INT(n),
                       DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(out), DMK_BUF(s->cg[p].p),
                       DMK_BUF(s->cg[p].ap), DMK_BUF(s->partial)));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, cg_alpha), 1, DMK_INT(parts),
                       DMK_BUF(s->partial), DMK_BUF(s->state)));
    DMK_TRY(DMK_LAUNCH(ctx, s->device, DMK_KERNEL_OF(s, p, cg_step), n, DMK_INT(n),
                       DMK_BUF(s->state), DMK_BUF(s->cg[p].p), DMK_BUF(s->cg[p].ap), DMK_BUF(x),
                       DMK_BUF(s->cg[p].r), DMK_BUF(s->cg[p].narrow)));
done:
    return rc;
}

int dmk_pcg(dmk_context *ctx, dmk_system *s, dmk_program p, dmk_operator op, dmk_buffer *x,
            int max_iterations, double tolerance, double energy, int *iterations, double *gain)
{
    int rc = DMK_OK;
    for (int i = 0; i < max_iterations; i++) {
        DMK_TRY(direction(ctx, s, p, op, i == 0));
        if (tolerance > 0 && i % LOOK_EVERY == 0) {
            double state[6];
            DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->state, 6, state));
            if (!(state[0] < 1e300)) {
                rc = dmk_fail(ctx, DMK_E_DIVERGED,
                              "the iteration diverged: conjugate gradients broke down after %d "
                              "iterations (r.z = %g); try a smaller --dt or --inertia, or improve "
                              "the mesh's worst triangles", i, state[0]);
                goto done;
            }
            if (gain) *gain = state[5] + 4 * state[0];
            double reference = energy > state[4] ? energy : state[4];
            if (state[0] <= tolerance * tolerance * reference) break;
        }
        DMK_TRY(step(ctx, s, p, op, x));
        ++*iterations;
    }
done:
    return rc;
}
