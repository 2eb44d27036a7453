/* Bounds of the optimal cost W, which is the least of F(mu) = 1/2 f.A(mu)^-1 f + 1/2 sum mu |T| over the
 * densities, the least cost of a flux that delivers f, and the largest f.v of a v with q <= 1 everywhere.
 *
 * Upper: the cost of a flux that delivers f, see upper.c; where the iteration's u solves A(mu) u = f too loosely
 * for it to be sharp, of one with a better u. Lower: f.v / sqrt(max q(v)) for any v. Tried are u; phi(u) with
 * phi' = 1 / max sqrt(q) over the elements that meet a level band of u, so that one bad element spoils its band
 * only; and, where that leaves a gap, the same of u repaired (repair.c). The best one counts. */
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

/* Where the gap is above this, u is repaired; between measures see enough_of. */
static const double usual_goal = 1e-3;

/* What will do for a goal where the rest would take long: for the usual one, a settled gap. */
static double lenient(double goal)
{
    return DMK_SETTLED_GAP * (goal / usual_goal);
}

/* Of the gap aimed at, what the upper bound may be above F at its best multiple of mu. With 1e-5 the bounds of camel
 * and man take twice the time. */
static const double slack = 0.2;

/* How well A(mu) u = f is solved for the first bound from a better u, in the energy: with 1e-3 one pair in five on a
 * quartic of 273,000 triangles needs a second bound, which takes as long as five iterations of CG. */
static const double first_tolerance = 3e-4;

/* Up to this root mean square of log |grad u| a u of loose solves will do for the first bound as it is: on 17 meshes it
 * did in 55 of 58 pairs between measures below, and in 11 of 95 above. */
static const double settled_slopes = 2e-3;

/* Of A(mu) u = f, each better than the one before, for one bound: on a tube 256 needles around two leave a gap of
 * 8.6e-4, four 4.5e-4. */
enum { SOLVES = 4 };

/* The search for an upper bound: the best one of this pair, what it cannot get below, and how well A(mu) u = f is to
 * be solved next. */
typedef struct search {
    double upper, least, tolerance;
    int solves;
    /* Rows: the iteration's u, and the one that solves A(mu) u = f best; NULL: it is the first. */
    double *own, *solved;
    bool delivered; /* the flux is there, if it is wanted */
} search;

void dmk_certify_gap(dmk_stats *stats)
{
    /* Both are proven, so they can pass each other by the rounding of their sums only. */
    stats->cost_lower = fmin(stats->cost_lower, stats->cost_upper);
    stats->gap = (stats->cost_upper - stats->cost_lower) / stats->cost_upper;
}

/* Of F at the best multiple of mu, sqrt(f.A^-1 f * sum mu |T|), what is known from below: f.A^-1 f >= 2 f.u - u.Au. */
static int find_least(dmk_iteration *o, search *s)
{
    int rc = DMK_OK;
    if (!o->fresh) DMK_TRY(dmk_iteration_energies(o));
    s->least = sqrt(fmax(2 * o->fu - o->uau, 0) * o->mass);
done:
    return rc;
}

/* The upper bound from the present pair, too; the flux, if that is within `allowed`. */
static int try_upper(dmk_iteration *o, search *s, double allowed)
{
    int rc;
    double bound;
    DMK_TRY(find_least(o, s));
    const double enough = (1 + allowed) * s->least;
    DMK_TRY(dmk_bound_upper(o, o->flux, o->balance, enough, &bound));
    s->upper = fmin(s->upper, bound);
    s->delivered |= bound <= enough;
done:
    return rc;
}

/* The device's u to *from, and `to`, if it is not NULL, in its place. */
static int exchange(dmk_iteration *o, double **from, const double *to)
{
    int rc = DMK_OK;
    dmk_system *s = o->sys;
    const size_t n = (size_t)s->n_rows_pad;
    if (!*from) DMK_TRY(DMK_NEW(o->ctx, *from, n));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, s->u, n, *from));
    if (to) DMK_TRY(dmk_buffer_write_real(o->ctx, s->device, DMK_OUTER, s->u, n, to));
done:
    return rc;
}

/* As much closer as the bound has to come, twice over, but by ten at most; never looser, for a sharper bound may be
 * asked for. All of it is speed only: a gap of 1e-4 asked for on fifteen meshes takes 1,986 iterations of CG, with 20
 * in place of ten 2,014, with 5 1,958; not twice over on six 1,258 for 1,280, but 175 bounds for 165. The gaps are the
 * same to 1.5 %. */
static void tighten(search *s, double allowed)
{
    s->tolerance *= fmin(1, fmax(0.1, 0.5 * allowed * s->least / (s->upper - s->least)));
}

/* The upper bound within `allowed` of F at the best multiple of mu. u stays as it is. */
static int find_upper(dmk_iteration *o, search *s, double allowed)
{
    int rc = DMK_OK;
    bool away = false;
    const bool good = !o->loose || o->rho <= settled_slopes;
    if (good && s->upper == INFINITY) DMK_TRY(try_upper(o, s, allowed));
    for (; s->solves < SOLVES && !(s->upper <= (1 + allowed) * s->least); s->solves++) {
        if (!away) DMK_TRY(exchange(o, &s->own, s->solved));
        away = true;
        if (s->solves > 0) tighten(s, allowed);
        rc = dmk_iteration_solve(o, s->tolerance, 200);
        if (rc == DMK_E_DIVERGED) { /* the bound from u is one all the same */
            s->solves = SOLVES;
            break;
        }
        if (rc != DMK_OK) goto done;
        DMK_TRY(try_upper(o, s, s->solves + 1 < SOLVES ? allowed : INFINITY));
    }
    if (away) DMK_TRY(exchange(o, &s->solved, s->own));
    if (s->upper == INFINITY || (o->flux && !s->delivered)) DMK_TRY(try_upper(o, s, INFINITY));
    if (away) o->fresh = false;
    /* A bound from an earlier mu is one of this problem, too. */
    o->stats->cost_upper =
        o->stats->cost_upper > 0 ? fmin(s->upper, o->stats->cost_upper) : s->upper;
    rc = s->upper < INFINITY ? DMK_OK
                             : dmk_iteration_diverged(o, o->stats->steps, "mu or u overflows");
done:
    return rc;
}

/* stats->cost_lower from u as it is. */
static int try_lower(dmk_iteration *o)
{
    int rc;
    double plain, banded;
    DMK_TRY(dmk_bound_plain(o, o->sys->u, &plain));
    DMK_TRY(dmk_bound_banded(o, o->sys->u, &banded));
    /* A bound from an earlier pair is one of this problem, too. */
    o->stats->cost_lower = fmax(o->stats->cost_lower, fmax(plain, banded));
done:
    return rc;
}

/* Where more steps answer a large gap, and u nearly solves A(mu) u = f: is it one? What an upper bound cannot get
 * below says so without it, which takes as long as some 60 sweeps of the repair. The lower bound is to leave the upper
 * one its part of the goal. */
static int look_ahead(dmk_iteration *o, search *s, double goal, bool *large)
{
    int rc;
    dmk_stats *stats = o->stats;
    const double rest[2] = {(1 - slack) * goal, lenient(goal)};
    DMK_TRY(find_least(o, s));
    if (stats->cost_lower < (1 - rest[0]) * s->least) DMK_TRY(dmk_repair(o, rest, s->least, false));
    *large = stats->cost_lower < (1 - DMK_SETTLED_GAP) * s->least;
    if (*large) stats->gap = 1 - stats->cost_lower / s->least;
done:
    return rc;
}

/* The gap that needs no more work. Between measures a settled one where none is asked for: of blobs on a quartic of
 * 273,000 triangles a repair takes 25 ms of 450 then, and a sharper upper bound 70 of 540. */
static double enough_of(const dmk_iteration *o, double goal)
{
    return o->between && !(dmk_gap_asked(o->options) > 0) ? lenient(goal) : goal;
}

/* Whether a sharper upper bound may bring the gap to what is enough, or has to. */
static bool is_worth_sharpening(const dmk_stats *stats, const search *s, double goal, double enough)
{
    const bool may = stats->gap > enough && stats->cost_lower >= (1 - enough) * s->least;
    return may || stats->gap > lenient(goal);
}

static int certify(dmk_iteration *o, bool last)
{
    int rc;
    bool large = false;
    dmk_stats *stats = o->stats;
    const double asked = dmk_gap_asked(o->options);
    const bool wanted = asked > 0;
    /* Among the sharpest needles no one knows which pair's upper bound will be the best. */
    const bool ahead = o->goes_on && !o->loose && !dmk_bound_is_rough(o);
    const double goal = wanted ? fmin(asked, usual_goal) : usual_goal, enough = enough_of(o, goal);
    search s = {.upper = INFINITY,
                .tolerance =
                    o->options->cg_tolerance > 0 ? o->options->cg_tolerance : first_tolerance};
    DMK_TRY(try_lower(o));
    if (ahead) DMK_TRY(look_ahead(o, &s, goal, &large));
    o->certified = false;
    if (large) goto done;
    /* The iteration's own u obeys |grad u| <= 1 better than mu's exact potential, which is free
     * where mu is next to 0: so the lower bound is that of the first, the upper of the second. */
    DMK_TRY(find_upper(o, &s, slack * (o->goes_on ? DMK_SETTLED_GAP : goal)));
    /* The repaired u will not get far above f.u: in between it is worth it only when that is
     * enough. */
    const bool hopeful = last || (wanted && o->fu >= (1 - goal) * stats->cost_upper);
    if (hopeful && !ahead && stats->cost_lower < (1 - enough) * stats->cost_upper)
        DMK_TRY(dmk_repair(o, (const double[2]){goal, lenient(goal)}, stats->cost_upper,
                           last && !o->goes_on));
    dmk_certify_gap(stats);
    /* Where the iteration goes on, this mu's bound will not be the last. */
    if (last && !(o->goes_on && stats->gap > DMK_SETTLED_GAP) &&
        (wanted || is_worth_sharpening(stats, &s, goal, enough))) {
        DMK_TRY(find_upper(o, &s, slack * goal));
        dmk_certify_gap(stats);
    }
    o->certified = hopeful;
done:
    free(s.own);
    free(s.solved);
    return rc;
}

int dmk_certify(dmk_iteration *o, bool last)
{
    double begin = dmk_seconds();
    if (o->certified && last) return DMK_OK;
    int rc = certify(o, last);
    o->stats->seconds[DMK_STAGE_CERTIFY] += dmk_seconds() - begin;
    return rc;
}
