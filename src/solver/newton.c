/* Inexact Newton (implicit Euler in y = log mu) on (u, mu): each step solves
 *     M w = f - sum_T mu_T (1 + D L_T) g_T,   M = A + sum_T c_T g_T g_T',  c_T = D mu_T / (|T| s_T),
 *     s_T = max(q_T, 1/4),  L_T = 1/2 log q_T, kept in [-1, 1],
 * by a few CG iterations, then u += w and y += D (L + g.w / (|T| s)). D is the pseudo time step: it
 * grows while the equation |grad u| = 1 gets better satisfied and shrinks when it does not. Between measures the first
 * steps are taken with u linear on T (kernels/nested.cl), and elements whose slope is far from 1 take shorter ones. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

/* Pseudo-time step control (switched evolution relaxation: Mulder and van Leer 1985; Kelley and
 * Keyes, "Convergence analysis of pseudo-transient continuation", SIAM J. Numer. Anal. 35, 1998).
 */
typedef struct step_control {
    double D, longest, growth;
    double slow;       /* from this D on the change of mu is about the error */
    double bend;       /* see dmk_newton_prepare; 0: D is all elements' */
    double brief;      /* below it one iteration is enough, and below four times as much two; */
    int most;          /* then so many, and one more */
    double stiff;      /* above this: the longer D, the stiffer the operator along the rays */
    double light;      /* up to this one smoothing step */
    double relax;      /* what late steps are over-relaxed by; 1: none is */
    int effort;        /* the least number of iterations in a step */
    int iterations;    /* of CG in each step */
    double rho_before; /* 0: none to compare with */
    double change;     /* of mu, the last but one; */
    double relaxed_at; /* that before the last over-relaxed step */
    int late;          /* steps of the longest D so far, from -1 on */
    bool shrunk;
} step_control;

/* rho up to this comes and goes: D does not shrink for it. On 1.09 million triangles of a smooth surface 5 steps for 6,
 * 0.9 of the run; 72 loci on smooth and noisy surfaces take 22.7 CG iterations for 22.9, 106 on scans and CAD parts
 * 17.6 steps and 68.4 iterations for 17.7 and 68.1. With 1e-3 the latter are 69.4, with 2e-3 75; with 3e-4 nothing
 * changes. */
static const double settled_rho = 6e-4;

static void choose_step(step_control *p, double rho)
{
    p->shrunk = false;
    if (p->rho_before > 0) {
        if (rho < 0.9 * p->rho_before) {
            p->D = fmin(p->longest, p->growth * p->D);
        } else if (rho > fmax(1.3 * p->rho_before, settled_rho)) {
            p->shrunk = p->D > 5;
            p->D = fmax(5, p->D / 2);
        }
    }
    p->rho_before = rho;
    const int usual = p->D > p->stiff       ? p->most + 1
                      : p->D < p->brief     ? 1
                      : p->D < 4 * p->brief ? 2
                                            : p->most;
    p->iterations = p->effort > usual ? p->effort : usual;
}

/* Between measures: the figures that chose them are in bench/results/transport.md, "Steps that begin on T". */
static const double longest_between = 80, growth_between = 2, brief_between = 5;

/* And this in "Over-relaxed steps". */
static const double relax_between = 3;

/* By what the change of y is multiplied: every third step of the longest D is over-relaxed, until that gains nothing,
 * where no part of the error is turned over by it: a step leaves r >= 1 - 1 / relax of what is slowest, as the changes
 * of mu of the two plain steps before show. */
static double relaxation(step_control *p, double change)
{
    const double rate = change / p->change;
    p->change = change;
    if (p->D < p->longest || ++p->late % 3 != 0) return 1;
    if (p->late > 0 && change >= p->relaxed_at) p->relax = 1;
    p->relaxed_at = change;
    return rate >= 1 - 1 / p->relax ? p->relax : 1;
}

/* An element whose slope alone would take mu to e^-1.5 or e^1.5 of what it is goes by a shorter step of its own: the
 * linear system would else let it carry a flux the other way, or many times its own. */
static const double most_by_slope = 1.5;

/* With shorter steps in places the change of mu is less of the error. */
static const double slow_light = 120, slow_thin = 140;

/* The first steps are taken on T while D is below this: with u linear on T and a mu for each triangle there is more of
 * that than u determines, and from D = 10 or so on mu changes from triangle to triangle by what the steps gain. */
static const double nested_longest = 8;

/* Of CG, for the potential to begin with there. */
enum { START_ITERATIONS = 4 };

/* Whether one smoothing step before and after is as good as two: on a mesh without small angles, between measures, and
 * from an even mu until D is long and where a system is solved to a tolerance. */
static bool is_light(const dmk_iteration *o, bool from_distance)
{
    return !from_distance && dmk_is_shapely(o->sys);
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
static int prepare(dmk_iteration *o, const dmk_newton_step *step)
{
    int rc;
    dmk_system *s = o->sys;
    const bool paired = is_paired(s);
    DMK_TRY(dmk_newton_prepare(o->ctx, s, paired, step));
    if (paired) return dmk_newton_rows(o->ctx, s, dmk_first_step());
    DMK_TRY(dmk_rows_rhs(o->ctx, s));
    DMK_TRY(dmk_newton_diagonal(o->ctx, s));
    DMK_TRY(dmk_inverse_diagonal(o->ctx, s));
    rc = dmk_smooth_first(o->ctx, s, s->cg[DMK_INNER].r, dmk_first_step());
done:
    return rc;
}

/* That, on T/2 (DMK_ROWS) or on T (DMK_VERTICES), and the inner solve but for its last step. */
static int solve_step(dmk_iteration *o, dmk_items over, const dmk_newton_step *step,
                      const step_control *p)
{
    int rc;
    dmk_system *s = o->sys;
    const bool nested = over == DMK_VERTICES;
    DMK_TRY(nested ? dmk_nested_prepare(o->ctx, s, step) : prepare(o, step));
    DMK_TRY(dmk_multigrid_refresh(o->ctx, s, DMK_NEWTON_MATRIX));
    if (nested) DMK_TRY(dmk_nested_rhs(o->ctx, s));
    /* Few loose iterations gain nothing from a higher degree. */
    s->newton_degree = p->D > p->light ? 2 : 1;
    rc = dmk_inner_solve(o->ctx, s, over, p->iterations, o->stats);
done:
    return rc;
}

/* The same in the outer precision on a mesh of needles: u += w. In single precision w loses what flows along a needle
 * beside what levels out across it, from D cot of some 1e6 on (bench/results/needles.md). */
static int solve_wide(dmk_iteration *o, const dmk_newton_step *step, const step_control *p)
{
    int rc;
    dmk_system *s = o->sys;
    DMK_TRY(dmk_newton_prepare_wide(o->ctx, s, step));
    DMK_TRY(dmk_rows_outer_residual(o->ctx, s));
    DMK_TRY(dmk_rows_scale(o->ctx, s, step->alpha, s->u));
    DMK_TRY(dmk_multigrid_refresh(o->ctx, s, DMK_NEWTON_MATRIX));
    rc = dmk_pcg(o->ctx, s, DMK_NEWTON_MATRIX, s->u, p->iterations, 0, 0, o->stats);
done:
    return rc;
}

/* The next step, by the energies of the last one. */
static dmk_newton_step next_step(dmk_iteration *o, bool from_distance, step_control *p)
{
    const double alpha = o->uau > 0 ? o->fu / o->uau : 1;
    const double mean_floor = p->effort > 0 ? o->floor : o->mean_floor; /* see attempts.c */
    dmk_iteration_measure(o, alpha);
    choose_step(p, o->rho);
    return (dmk_newton_step){
        .alpha = alpha,
        .D = p->D,
        .bend = p->bend,
        .relax = relaxation(p, o->stats->change),
        /* Not from a distance the way may be short, and mu small everywhere. */
        .lowest = from_distance ? o->floor : mean_floor * o->mass};
}

/* *change: mu's, relative. */
static int take_step(dmk_iteration *o, dmk_items over, const dmk_newton_step *step,
                     const step_control *p, double *change)
{
    const int rc = o->sys->without_T ? solve_wide(o, step, p) : solve_step(o, over, step, p);
    return rc ? rc : dmk_iteration_update(o, over, p->iterations == 1, step, change);
}

/* Modes of the error that relax slowly, at a rate r per unit time, lose r D / (1 + r D) of it in a
 * step: if D is long the change of mu is about the error, below it is a part only. */
static double error_estimate(const step_control *p, double change)
{
    return change * fmax(1, p->slow / p->D);
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

/* The constant mu of least cost, where u solves A(1) u = f. */
static double least_mu(const dmk_iteration *o)
{
    return o->fu > 0 ? sqrt(o->fu) : 1;
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
    const double least = least_mu(o);
    DMK_TRY(dmk_elements_fill(o->ctx, s, s->mu, least));
    o->ready = DMK_NOTHING;
    o->mass *= least;
done:
    return rc;
}

/* ---- steps on T ------------------------------------------------------------------------------- */

/* As start_cold: with D = 0 and u = 0 a step solves A(1) u = f, whatever q is, and leaves mu. */
static int start_nested(dmk_iteration *o)
{
    int rc;
    double change;
    const step_control even = {.iterations = START_ITERATIONS};
    DMK_TRY(dmk_nested_load(o->ctx, o->sys));
    DMK_TRY(take_step(o, DMK_VERTICES, &(dmk_newton_step){.alpha = 1, .relax = 1}, &even, &change));
    const double least = least_mu(o);
    DMK_TRY(dmk_elements_fill(o->ctx, o->sys, o->sys->mu, least));
    rc = dmk_iteration_measure_nested(o, 1 / least); /* the first step's scale */
done:
    return rc;
}

/* The first steps, until D is long or grows no more; *step: the next one's number. */
static int begin_nested(dmk_iteration *o, step_control *p, int max_steps, int *step)
{
    int rc;
    bool grows = true;
    DMK_TRY(start_nested(o));
    for (; *step < max_steps && grows && p->D < nested_longest; ++*step) {
        const double before = p->D;
        const dmk_newton_step next = next_step(o, false, p);
        double change;
        DMK_TRY(take_step(o, DMK_VERTICES, &next, p, &change));
        DMK_TRY(dmk_iteration_step_done(o, *step, max_steps, p->iterations, change));
        grows = *step == 1 || p->D > before;
    }
    DMK_TRY(dmk_nested_refine(o->ctx, o->sys));
    p->rho_before = 0; /* of another discretisation */
done:
    return rc;
}

/* ---- all steps -------------------------------------------------------------------------------- */

static step_control control_of(const dmk_iteration *o, bool from_distance)
{
    const step_control point = {.D = from_distance ? 50 : 1,
                                .longest = from_distance ? 150 : 130,
                                .growth = from_distance ? 1.5 : 1.6,
                                .slow = 100,
                                .relax = 1,
                                .bend = o->sys->without_T ? 1 / most_by_slope : 0,
                                .most = 3,
                                .stiff = 100,
                                .light = o->light ? 100 : 0};
    const step_control measures = {.D = 1,
                                   .longest = longest_between,
                                   .growth = growth_between,
                                   .slow = o->light ? slow_light : slow_thin,
                                   .bend = 1 / most_by_slope,
                                   .relax = relax_between,
                                   .late = -1,
                                   .brief = brief_between,
                                   .most = 4,
                                   .stiff = longest_between,
                                   .light = o->light ? longest_between : 0};
    return o->between ? measures : point;
}

int dmk_newton(dmk_iteration *o, bool from_distance, int effort, int max_steps)
{
    int rc = DMK_OK, first = 1;
    bool settled;
    const dmk_solve_options *opt = o->options;
    double change = 1;
    o->loose = !from_distance;
    o->tolerance = opt->tolerance > 0 ? opt->tolerance : DMK_DEFAULT_TOLERANCE;
    o->light = is_light(o, from_distance);
    step_control p = control_of(o, from_distance);
    p.effort = effort;
    if (o->between && !o->sys->without_T)
        DMK_TRY(begin_nested(o, &p, max_steps, &first));
    else if (!from_distance)
        DMK_TRY(start_cold(o));
    for (int step = first; step <= max_steps; step++) {
        if (!o->fresh) DMK_TRY(dmk_iteration_energies(o));
        const dmk_newton_step next = next_step(o, from_distance, &p);
        /* A distance satisfies |grad u| = 1 whatever mu is: the first rho is no measure. */
        if (step == 1 && from_distance) p.rho_before = 0;
        DMK_TRY(take_step(o, DMK_ROWS, &next, &p, &change));
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
        rc = dmk_iteration_limit(o, max_steps, error_estimate(&p, change));
done:
    return rc;
}
