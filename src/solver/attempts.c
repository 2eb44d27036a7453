/* Newton's steps in up to four attempts: on meshes with many needles three or four iterations of CG gain next to
 * nothing, and the steps come to an end only if each is solved better. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

/* CG iterations in a step, at least, and steps, at most; the second one only where each iteration gains, on levels
 * without T: 36 solves on CAD parts take 10.8 s for 15.4, with 10 or 40 of them 11.6 and 10.9. Solved so well, mu may
 * become as small as from a distance where nothing moves, which between measures leaves little of the gap (transport.c
 * has the first attempt's floor). Of 428 small meshes (tubes and cylinders of needles, 113 of them chosen because the
 * first attempt fails; stretched spheres, clustered points, fans) 427 have a result, in 53 s; with all levels through T
 * 428 in 97 s, 420 without the last attempt, and 398 in 203 s with explicit steps in place of others. Of 218 pairs of
 * measures on these it is 215. */
static const struct {
    int effort, steps;
} attempts[] = {{0, DMK_NEWTON_STEPS},
                {20, DMK_NEWTON_STEPS},
                {100, 2 * DMK_NEWTON_STEPS},
                {500, DMK_NEWTON_STEPS}};
enum { ATTEMPTS = sizeof attempts / sizeof *attempts };

/* The number of the attempt after the first. */
static int second(const dmk_iteration *o)
{
    return o->sys->without_T ? 1 : 2;
}

/* Gaps. Up to the first, steps that came to our own limit are as good as settled: where many ways are equally long, as
 * between two poles, mu is not unique and wanders on, and where hardly anything moves it comes to rest slowly. Beyond
 * the second, the best pair of all is no result if it has not settled: of 78 sources on needles of 1e-5 degrees
 * (tests/test_once.sh) six have none with 0.01, and one with 0.1. */
static const double unique_enough = 1e-3, useless = 0.5;

/* The pair of an attempt, in the device's order. */
typedef struct pair {
    double *u, *mu; /* NULL: none yet */
    double gap, change;
    bool settled;
    bool is_last; /* more attempts would be in vain */
} pair;

static size_t rows(const dmk_iteration *o)
{
    return (size_t)o->sys->n_rows_pad;
}

static size_t elements(const dmk_iteration *o)
{
    return (size_t)o->sys->n_elements_pad;
}

static int keep(const dmk_iteration *o, bool settled, pair *best)
{
    int rc = DMK_OK;
    const dmk_system *s = o->sys;
    if (!best->u) DMK_TRY(DMK_NEW(o->ctx, best->u, rows(o)));
    if (!best->mu) DMK_TRY(DMK_NEW(o->ctx, best->mu, elements(o)));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, s->u, rows(o), best->u));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, s->mu, elements(o), best->mu));
    best->gap = o->stats->gap;
    best->change = o->stats->change;
    best->settled = settled;
done:
    return rc;
}

/* Of the pair before: u and mu are others now. */
static void forget(dmk_iteration *o)
{
    o->fresh = o->certified = o->goes_on = false;
    o->ready = DMK_NOTHING;
}

static int bring_back(dmk_iteration *o, const pair *best)
{
    int rc;
    const dmk_system *s = o->sys;
    DMK_TRY(dmk_buffer_write_real(o->ctx, s->device, DMK_OUTER, s->u, rows(o), best->u));
    DMK_TRY(dmk_buffer_write_real(o->ctx, s->device, DMK_OUTER, s->mu, elements(o), best->mu));
    o->stats->change = best->change;
    forget(o);
done:
    return rc;
}

/* Whether the caller has said where to stop: by steps, or by less of a change than usual. What has not come there is
 * then no result. */
static bool is_strict(const dmk_iteration *o)
{
    const dmk_solve_options *asked = o->options;
    return asked->max_steps > 0 ||
           (asked->tolerance > 0 && asked->tolerance < DMK_DEFAULT_TOLERANCE);
}

/* The most steps of the k-th attempt; those that are asked for are all attempts' together. */
static int steps_of(const dmk_iteration *o, int k)
{
    const int asked = o->options->max_steps;
    return asked > 0 ? asked - o->stats->steps : attempts[k].steps;
}

/* Whether another attempt may follow steps that ended with `rc`: not where the caller's are used up, or the change is
 * small enough for a caller who is content with more than usual, or less of it than usual is asked for and they have
 * come as near as ever. */
static bool may_follow(const dmk_iteration *o, int rc)
{
    if (steps_of(o, 0) <= 0) return false;
    if (rc == DMK_OK) return o->options->tolerance <= DMK_DEFAULT_TOLERANCE;
    if (rc == DMK_E_LIMIT) return !is_strict(o) || o->stats->change > DMK_DEFAULT_TOLERANCE;
    return rc == DMK_E_DIVERGED;
}

/* The gap up to which none follows. */
static double enough(const dmk_iteration *o, bool settled)
{
    const double asked = dmk_gap_asked(o->options);
    if (settled) return fmax(asked, DMK_SETTLED_GAP);
    return asked > 0 ? fmin(asked, unique_enough) : unique_enough;
}

/* Two attempts have settled, and the one that was solved better at no less of a gap: a pair of measures on a gyroid by
 * marching cubes takes 12 s in place of 42. */
static bool is_in_vain(const pair *best, double gap, bool settled)
{
    return best->u && best->settled && settled && gap >= best->gap;
}

/* The gap of the present pair, which is kept if it is the best so far. */
static int judge(dmk_iteration *o, bool settled, pair *best, bool *done)
{
    int rc = dmk_certify(o, true);
    if (rc == DMK_E_DIVERGED) return DMK_OK; /* the pair has none, and another may follow */
    DMK_TRY(rc);
    *done = fabs(o->stats->gap) <= enough(o, settled);
    best->is_last = is_in_vain(best, o->stats->gap, settled);
    if (!*done && (!best->u || o->stats->gap < best->gap)) DMK_TRY(keep(o, settled, best));
done:
    return rc;
}

/* The k-th attempt. *done: no other one is to follow. Bounds of a pair before are of this problem, too. */
static int attempt(dmk_iteration *o, bool from_distance, int k, pair *best, bool *done)
{
    dmk_stats *stats = o->stats;
    const double upper = stats->cost_upper, lower = stats->cost_lower;
    stats->cost_upper = stats->cost_lower = 0;
    o->before = stats->steps;
    int rc = dmk_newton(o, from_distance, attempts[k].effort, steps_of(o, k));
    const bool stands = k + 1 == ATTEMPTS && rc == DMK_E_LIMIT && is_strict(o);
    *done = stands || !may_follow(o, rc);
    if (!*done && (rc == DMK_OK || (rc == DMK_E_LIMIT && !is_strict(o)))) {
        DMK_TRY(judge(o, rc == DMK_OK, best, done));
        rc = *done ? DMK_OK : DMK_E_LIMIT;
    }
    if (k == 0) return rc;
    const bool both = upper > 0 && stats->cost_upper > 0;
    stats->cost_upper = both ? fmin(upper, stats->cost_upper) : fmax(upper, stats->cost_upper);
    stats->cost_lower = fmax(lower, stats->cost_lower);
    dmk_certify_gap(stats);
done:
    return rc;
}

/* Where the last attempt's pair was not good enough. */
static int settle_for(dmk_iteration *o, const pair *best, bool done, int rc)
{
    if (rc != DMK_E_LIMIT && rc != DMK_E_DIVERGED) return rc;
    if (best->u && (best->settled || best->gap <= useless)) return bring_back(o, best);
    return rc == DMK_E_LIMIT && !done
               ? dmk_iteration_diverged(o, o->stats->steps, "mu keeps changing")
               : rc;
}

int dmk_attempts(dmk_iteration *o, bool from_distance)
{
    bool done;
    pair best = {0};
    int rc = attempt(o, from_distance, 0, &best, &done);
    for (int k = second(o); k < ATTEMPTS && !done && !best.is_last; k++) {
        DMK_TRY(o->restart(o->ctx, o->user));
        forget(o);
        rc = attempt(o, from_distance, k, &best, &done);
    }
    rc = settle_for(o, &best, done, rc);
done:
    free(best.u);
    free(best.mu);
    return rc;
}
