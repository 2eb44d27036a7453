/* Inexact Newton (implicit Euler in y = log mu) on (u, mu): each step solves
 *     M w = f - sum_T mu_T (1 + D L_T) g_T,   M = A + sum_T c_T g_T g_T',  c_T = D mu_T / (|T| s_T)
 * by a few CG iterations, then u += w and y += D (L + g.w / (|T| s)). D is the pseudo time step: it
 * grows while the equation |grad u| = 1 gets better satisfied and shrinks when it does not. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

/* Pseudo-time step control (switched evolution relaxation: Mulder and van Leer 1985; Kelley and
 * Keyes, "Convergence analysis of pseudo-transient continuation", SIAM J. Numer. Anal. 35, 1998).
 */
typedef struct step_control {
    double D, longest, growth;
    double brief;      /* below it one iteration is enough, and below four times as much two */
    double light;      /* and up to this one smoothing step */
    int iterations;    /* of CG in each step */
    double rho_before; /* 0: none to compare with */
    bool shrunk;
} step_control;

/* The operator is stiffer along the rays the longer D is. */
static const double stiff = 100;

static void choose_step(step_control *p, double rho)
{
    p->shrunk = false;
    if (p->rho_before > 0) {
        if (rho < 0.9 * p->rho_before) {
            p->D = fmin(p->longest, p->growth * p->D);
        } else if (rho > 1.3 * p->rho_before) { /* less is noise once rho is small */
            p->shrunk = p->D > 5;
            p->D = fmax(5, p->D / 2);
        }
    }
    p->rho_before = rho;
    p->iterations = p->D > stiff ? 4 : p->D < p->brief ? 1 : p->D < 4 * p->brief ? 2 : 3;
}

/* The longest step: from a distance, and between measures, where the stiffer systems of longer steps take more
 * iterations than they save. With 150 for 130 and three iterations for two, 132 pairs on eleven meshes without small
 * angles take 41.2 of them for 37.6 and 14.1 steps for 14.0, 72 on six with thin triangles 54.3 for 51.0 and 17.6 for
 * 17.5; with 120 mu is up to 1.6 % off there for 0.9. */
static const double longest_from_distance = 150, longest_between = 130;

/* Whether one smoothing step before and after is as good as two: between measures, until D is long and where a system
 * is solved to a tolerance, on a mesh without small angles. 66 pairs on eleven of these take 16.2 steps for 16.7 and 51
 * iterations for 53, each for 0.7 of the time; 26 on six with thinner triangles would take 22.6 for 18.4. */
static bool is_light(const dmk_iteration *o, bool from_distance)
{
    const double cot_20 = 2.747; /* of an angle of 20 degrees */
    return !from_distance && o->sys->sharpest < cot_20;
}

/* Where the right-hand side's parts may be rounded to single precision, so that they go with the diagonals: needles'
 * parts are larger than their sums by the cotangent, here of half a degree. It saves three launches and, between
 * measures, 0.06 of the time. Without this limit 72 pairs on six meshes with thin triangles end up to 1.2 % off for
 * 0.9, and a gap on one of 0.025 degrees takes 2,000 sweeps (tests/test_certificate.c). */
static bool is_paired(const dmk_system *s)
{
    const double cot_half = 114.6;
    return s->sharpest < cot_half && dmk_device_real(s->device, DMK_OUTER) == sizeof(double);
}

/* Coefficients, the right-hand side, and its first smoothing step. */
static int prepare(dmk_iteration *o, double alpha, const step_control *p)
{
    int rc;
    dmk_system *s = o->sys;
    const bool paired = is_paired(s);
    DMK_TRY(dmk_newton_prepare(o->ctx, s, paired, alpha, p->D));
    if (paired) return dmk_newton_rows(o->ctx, s, dmk_first_step());
    DMK_TRY(dmk_rows_rhs(o->ctx, s));
    DMK_TRY(dmk_newton_diagonal(o->ctx, s));
    DMK_TRY(dmk_inverse_diagonal(o->ctx, s));
    rc = dmk_smooth_first(o->ctx, s, s->cg[DMK_INNER].r, dmk_first_step());
done:
    return rc;
}

/* That, and the inner solve but for its last step. */
static int solve_step(dmk_iteration *o, double alpha, const step_control *p)
{
    int rc;
    dmk_system *s = o->sys;
    DMK_TRY(prepare(o, alpha, p));
    DMK_TRY(dmk_multigrid_refresh(o->ctx, s));
    /* Few loose iterations gain nothing from a higher degree. */
    s->newton_degree = p->D > p->light ? 2 : 1;
    rc = dmk_inner_solve(o->ctx, s, p->iterations, o->stats);
done:
    return rc;
}

/* Modes of the error that relax slowly, at a rate r per unit time, lose r D / (1 + r D) of it in a
 * step: from D = 100 on the change of mu is about the error, below it is a part only. */
static double error_estimate(const step_control *p, double change)
{
    return change * fmax(1, 100 / p->D);
}

enum { TIGHTENED = 2 };

/* The change of mu is small enough. Where the gap shows that mu has not settled all the same, and
 * the tolerance is our own, it becomes smaller. */
static int has_settled(dmk_iteration *o, const step_control *p, double change, bool *settled)
{
    int rc = DMK_OK;
    *settled = error_estimate(p, change) <= o->tolerance && !p->shrunk;
    if (!*settled || o->options->tolerance > 0) return DMK_OK;
    o->goes_on = o->tolerance > DMK_DEFAULT_TOLERANCE / pow(3, TIGHTENED - 0.5);
    DMK_TRY(dmk_certify(o, true));
    *settled = o->stats->gap <= DMK_SETTLED_GAP || !o->goes_on;
    if (!*settled) o->tolerance /= 3;
    o->goes_on = false;
done:
    return rc;
}

/* From mu = 1, u = 0: the constant mu of least cost, sqrt(f.A(1)^-1 f), nearly, and its potential. */
static int start_cold(dmk_iteration *o)
{
    int rc;
    dmk_system *s = o->sys;
    /* 80 pairs on ten meshes without small angles take 46.9 iterations and 16.6 steps for 47.6 and 16.8 with 1e-2; 32
     * on four with thin triangles would take 62.1 for 58.8. */
    DMK_TRY(dmk_iteration_solve(o, o->light ? 5e-2 : 1e-2, 100));
    DMK_TRY(dmk_iteration_energies(o));
    const double least = o->fu > 0 ? sqrt(o->fu) : 1;
    DMK_TRY(dmk_elements_fill(o->ctx, s, s->mu, least));
    o->mass *= least;
done:
    return rc;
}

int dmk_newton(dmk_iteration *o, bool from_distance)
{
    int rc = DMK_OK;
    bool settled;
    const dmk_solve_options *opt = o->options;
    int max_steps = opt->max_steps ? opt->max_steps : DMK_NEWTON_STEPS;
    double change = 1;
    o->loose = !from_distance;
    o->tolerance = opt->tolerance > 0 ? opt->tolerance : DMK_DEFAULT_TOLERANCE;
    o->light = is_light(o, from_distance);
    step_control p = {.D = from_distance ? 50 : 1,
                      .longest = from_distance ? longest_from_distance : longest_between,
                      .growth = from_distance ? 1.5 : 1.6,
                      .brief = o->brief,
                      .light = o->light ? stiff : 0};
    if (!from_distance) DMK_TRY(start_cold(o));
    for (int step = 1; step <= max_steps; step++) {
        if (!o->fresh) DMK_TRY(dmk_iteration_energies(o));
        double alpha = o->uau > 0 ? o->fu / o->uau : 1;
        dmk_iteration_measure(o, alpha);
        choose_step(&p, o->rho);
        /* A distance satisfies |grad u| = 1 whatever mu is: the first rho is no measure. */
        if (step == 1 && from_distance) p.rho_before = 0;
        DMK_TRY(solve_step(o, alpha, &p));
        /* Not from a distance the way may be short, and mu small everywhere. */
        const double lowest = from_distance ? o->floor : o->mean_floor * o->mass;
        DMK_TRY(dmk_iteration_update(o, p.iterations == 1, alpha, p.D, lowest, &change));
        DMK_TRY(dmk_iteration_step_done(o, step, max_steps, p.iterations, change));
        DMK_TRY(has_settled(o, &p, change, &settled));
        if (settled) goto done;
        if (opt->gap_tolerance > 0) {
            DMK_TRY(dmk_certify(o, false));
            if (o->stats->gap <= opt->gap_tolerance) goto done;
        }
    }
    /* What our own tolerance was at first has been reached. */
    if (opt->tolerance > 0 || o->tolerance == DMK_DEFAULT_TOLERANCE)
        rc = dmk_iteration_limit(o, max_steps);
done:
    return rc;
}
