/* Bounds of the optimal cost W = min over mu of F(mu) = 1/2 f.A(mu)^-1 f + 1/2 sum mu |T|.
 *
 * Upper: F at the best multiple of mu, sqrt(f.A^-1 f * sum mu |T|), see dmk_iteration_solve. What
 * CG leaves of r.A^-1 r is estimated by r.z, z = V-cycle(r), and counted four times. Lower: f.v /
 * sqrt(max q(v)) for any v. Tried are u; phi(u) with phi' = 1 / max sqrt(q) over the elements that
 * meet a level band of u, so that one bad element spoils its band only; and, where that leaves a
 *     gap, the same of u repaired (repair.c). The best one counts. */
#include "solver/iteration.h"

#include <math.h>

/* Where the gap is above this, u is repaired. */
static const double usual_goal = 1e-3;

/* Of a bound, far above what sums of up to 1e8 terms round. */
static const double bound_rounding = 1e-7;

int dmk_certify_gap(dmk_iteration *o, bool last)
{
    dmk_stats *stats = o->stats;
    if (last && stats->cost_lower > (1 + bound_rounding) * stats->cost_upper)
        return dmk_iteration_diverged(o, stats->steps, "the cost's bounds contradict each other");
    stats->cost_lower = fmin(stats->cost_lower, stats->cost_upper);
    stats->gap = (stats->cost_upper - stats->cost_lower) / stats->cost_upper;
    return DMK_OK;
}

static int certify(dmk_iteration *o, bool last)
{
    int rc;
    double energy, plain, banded, asked = o->options->gap_tolerance;
    double tolerance = o->options->cg_tolerance > 0 ? o->options->cg_tolerance : 1e-3;
    dmk_stats *stats = o->stats;
    const bool wanted = asked >= DMK_GAP_SHOWN;
    const double goal = wanted ? fmin(asked, usual_goal) : usual_goal;
    DMK_TRY(dmk_bound_plain(o, o->sys->u, &plain));
    DMK_TRY(dmk_bound_banded(o, o->sys->u, &banded));
    /* A bound from an earlier pair is one of this problem, too. */
    stats->cost_lower = fmax(stats->cost_lower, fmax(plain, banded));
    /* The iteration's own u obeys |grad u| <= 1 better than mu's exact potential, which is free
     * where mu is next to 0: so the solve's correction is not added. */
    DMK_TRY(dmk_iteration_measure(o, 1));
    DMK_TRY(dmk_iteration_solve(o, NULL, tolerance, 200, &energy));
    stats->cost_upper = sqrt(energy * o->mass);
    /* The repaired u will not get far above f.u: in between it is worth it only when that is
     * enough. */
    const bool hopeful = last || (wanted && o->fu >= (1 - goal) * stats->cost_upper);
    if (hopeful && stats->cost_lower < (1 - goal) * stats->cost_upper)
        DMK_TRY(dmk_repair(o, goal, last));
    DMK_TRY(dmk_certify_gap(o, last));
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
