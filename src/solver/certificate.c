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

/* Where the gap is above this, u is repaired. */
static const double usual_goal = 1e-3;

/* What the upper bound may be above F at its best multiple of mu, relative, if the gap asked for is not small. */
static const double usual_slack = 1e-5;

enum { SOLVES = 4 };

void dmk_certify_gap(dmk_stats *stats)
{
    /* Both are proven, so they can pass each other by the rounding of their sums only. */
    stats->cost_lower = fmin(stats->cost_lower, stats->cost_upper);
    stats->gap = (stats->cost_upper - stats->cost_lower) / stats->cost_upper;
}

/* The upper bound from the present pair; of F at the best multiple of mu, sqrt(f.A^-1 f * sum mu |T|), what is
 * known from below: f.A^-1 f >= 2 f.u - u.Au. */
static int try_upper(dmk_iteration *o, double *upper, double *least)
{
    int rc;
    double bound;
    DMK_TRY(dmk_iteration_energies(o));
    DMK_TRY(dmk_iteration_measure(o, 1));
    DMK_TRY(dmk_bound_upper(o, o->flux, o->balance, &bound));
    *upper = fmin(*upper, bound);
    *least = sqrt(fmax(2 * o->fu - o->uau, 0) * o->mass);
done:
    return rc;
}

/* The upper bound within `slack` of F at the best multiple of mu. u stays as it is. */
static int find_upper(dmk_iteration *o, double slack)
{
    int rc;
    const size_t n = (size_t)o->sys->n_rows_pad;
    double *own = NULL, upper = INFINITY, least = 0;
    double tolerance = o->options->cg_tolerance > 0 ? o->options->cg_tolerance : 1e-3;
    if (!o->loose) DMK_TRY(try_upper(o, &upper, &least));
    for (int k = 0; k < SOLVES && !(upper <= (1 + slack) * least); k++, tolerance /= 10) {
        if (!own) {
            DMK_TRY(DMK_NEW(o->ctx, own, n));
            DMK_TRY(dmk_buffer_read_real(o->ctx, o->sys->device, DMK_OUTER, o->sys->u, n, own));
        }
        rc = dmk_iteration_solve(o, tolerance, 200);
        if (rc == DMK_E_DIVERGED) break; /* the bound from u is one all the same */
        if (rc != DMK_OK) goto done;
        DMK_TRY(try_upper(o, &upper, &least));
    }
    if (own) DMK_TRY(dmk_buffer_write_real(o->ctx, o->sys->device, DMK_OUTER, o->sys->u, n, own));
    if (upper == INFINITY) DMK_TRY(try_upper(o, &upper, &least));
    o->fresh = false;
    /* A bound from an earlier mu is one of this problem, too. */
    o->stats->cost_upper = o->stats->cost_upper > 0 ? fmin(upper, o->stats->cost_upper) : upper;
    rc =
        upper < INFINITY ? DMK_OK : dmk_iteration_diverged(o, o->stats->steps, "mu or u overflows");
done:
    free(own);
    return rc;
}

static int certify(dmk_iteration *o, bool last)
{
    int rc;
    double plain, banded, asked = o->options->gap_tolerance;
    dmk_stats *stats = o->stats;
    const bool wanted = asked >= DMK_GAP_SHOWN;
    const double goal = wanted ? fmin(asked, usual_goal) : usual_goal;
    DMK_TRY(dmk_bound_plain(o, o->sys->u, &plain));
    DMK_TRY(dmk_bound_banded(o, o->sys->u, &banded));
    /* A bound from an earlier pair is one of this problem, too. */
    stats->cost_lower = fmax(stats->cost_lower, fmax(plain, banded));
    /* The iteration's own u obeys |grad u| <= 1 better than mu's exact potential, which is free
     * where mu is next to 0: so the lower bound is that of the first, the upper of the second. */
    DMK_TRY(find_upper(o, wanted ? fmin(0.1 * asked, usual_slack) : usual_slack));
    /* The repaired u will not get far above f.u: in between it is worth it only when that is
     * enough. */
    const bool hopeful = last || (wanted && o->fu >= (1 - goal) * stats->cost_upper);
    if (hopeful && stats->cost_lower < (1 - goal) * stats->cost_upper)
        DMK_TRY(dmk_repair(o, goal, last));
    dmk_certify_gap(stats);
    o->certified = hopeful;
done:
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
