/* Explicit time steps of d mu / dt = mu (|grad u| - 1), one CG solve each: the paper's Euler scheme,
 * and steps in log mu with inertia. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>

static int update(dmk_iteration *o, bool inertial, double dt, double beta, double *change)
{
    int rc;
    double sums[2];
    dmk_system *s = o->sys;
    o->ready = DMK_NOTHING;
    DMK_TRY(dmk_explicit_update(o->ctx, s, inertial, dt, beta, o->floor, 0));
    DMK_TRY(dmk_iteration_scalars(o, 2, sums));
    *change = sums[0] / sums[1] / dt;
done:
    return rc;
}

/* mu of the step before: none yet. Only these methods need it. */
static int begin(dmk_iteration *o)
{
    dmk_system *s = o->sys;
    size_t bytes = (size_t)s->n_elements_pad * dmk_device_real(s->device, DMK_OUTER);
    if (s->before) return dmk_buffer_clear(o->ctx, s->device, s->before, bytes);
    return dmk_buffer_create(o->ctx, s->device, bytes, NULL, &s->before);
}

/* The limit of CG iterations in a step, and how many steps one after the other may end there: u is not solved for
 * then, and mu goes astray: with 30, a mesh of 244 triangles (tests/data/once/needles-441) goes on for minutes. */
enum { CG_LIMIT = 500, UNSOLVED = 10 };

int dmk_explicit(dmk_iteration *o)
{
    int rc;
    const dmk_solve_options *opt = o->options;
    bool inertial = opt->method == DMK_INERTIAL;
    int max_steps = opt->max_steps ? opt->max_steps : DMK_EXPLICIT_STEPS;
    o->tolerance = opt->tolerance > 0 ? opt->tolerance : inertial ? 2e-3 : 5e-4;
    double dt = inertial ? 1 : opt->dt > 0 ? opt->dt : 0.5;
    double inertia = opt->inertia >= 0 ? opt->inertia : 0.8;
    int unsolved = 0;
    double change = 1, cg = opt->cg_tolerance > 0 ? opt->cg_tolerance : 1e-4;
    o->loose = false;
    o->ready = DMK_NOTHING;
    DMK_TRY(begin(o));
    for (int step = 1; step <= max_steps; step++) {
        int before = o->stats->cg_iterations;
        DMK_TRY(dmk_iteration_solve(o, cg, CG_LIMIT));
        unsolved = o->stats->cg_iterations - before < CG_LIMIT ? 0 : unsolved + 1;
        if (unsolved == UNSOLVED) {
            return dmk_iteration_diverged(o, step,
                                          "CG reaches its limit of iterations in step after step");
        }
        DMK_TRY(dmk_iteration_energies(o));
        /* Inertia is raised over the first steps: at once it makes them rough. */
        double beta = step == 1 ? 0 : opt->inertia >= 0 ? inertia : fmin(inertia, 0.05 * step);
        DMK_TRY(update(o, inertial, dt, beta, &change));
        DMK_TRY(
            dmk_iteration_step_done(o, step, max_steps, o->stats->cg_iterations - before, change));
        if (change <= o->tolerance) goto done;
        if (opt->gap_tolerance > 0 && step % 10 == 0) {
            DMK_TRY(dmk_certify(o, false));
            if (o->stats->gap <= opt->gap_tolerance) goto done;
        }
    }
    rc = dmk_iteration_limit(o, max_steps, o->stats->change);
done:
    return rc;
}
