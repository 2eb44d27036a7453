/* Tubes of needles, on which Newton's usual steps come to no end: others do that are solved better. */
#include "solver/iteration.h"

static int (*newton)(dmk_iteration *, bool, int,
                     int) = dmk_newton; /* others in scripted attempts */
static int (*certify)(dmk_iteration *, bool) = dmk_certify;
#define dmk_newton newton
#define dmk_certify certify
#include "../src/solver/attempts.c" /* for its static functions; the library's own are then left out */
#undef dmk_newton
#undef dmk_certify
#include "iterating.h"

#include <stdio.h>
#include <string.h>

/* Rings of n vertices around the z axis, over this length; the source is in the middle of the last but one. */
static problem tube(bench *b, int32_t n, int32_t n_rings, double length)
{
    const double step = 2 * 3.14159265358979323846 / n;
    const int32_t n_triangles = 2 * n * (n_rings - 1);
    double *xyz = calloc(3 * (size_t)n * (size_t)n_rings, sizeof *xyz);
    int32_t *triangle = calloc(3 * (size_t)n_triangles, sizeof *triangle);
    assert_true(xyz && triangle);
    for (int32_t v = 0; v < n * n_rings; v++) {
        xyz[3 * v] = cos(step * (v % n));
        xyz[3 * v + 1] = sin(step * (v % n));
        xyz[3 * v + 2] = length * (v / n) / (n_rings - 1);
    }
    for (int32_t v = 0; v < n * (n_rings - 1); v++) {
        const int32_t next = v / n * n + (v + 1) % n,
                      two[6] = {v, next, next + n, v, next + n, v + n};
        memcpy(triangle + 6 * v, two, sizeof two);
    }
    problem p = problem_create(b, (size_t)n * (size_t)n_rings, xyz, (size_t)n_triangles, triangle);
    bench_ok(b, dmk_mesh_vertex_point(b->ctx, p.mesh, n * n_rings / 2, &p.source));
    free(xyz);
    free(triangle);
    return p;
}

enum { USUAL = 60 }; /* steps of the first attempt */

static void solved_better_steps_end(void **state)
{
    static const struct {
        int32_t n, n_rings;
        double length;
    } of[] = {{3, 3, 0.01}, {3, 5, 0.01}, {3, 5, 0.001}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        problem p = tube(*state, of[i].n, of[i].n_rings, of[i].length);
        problem_solve(&p);
        assert_true(p.stats.steps > USUAL);
        assert_true(p.stats.gap < 1e-3);
        problem_free(&p);
    }
}

/* Without T between T/2 and the coarse levels the usual steps are solved well enough. */
static void needles_settle_in_the_first_attempt(void **state)
{
    static const struct {
        int32_t n, n_rings;
        double length;
    } of[] = {{6, 5, 0.01}, {64, 5, 200}, {256, 2, 50}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        problem p = tube(*state, of[i].n, of[i].n_rings, of[i].length);
        problem_solve(&p);
        assert_true(p.stats.steps < USUAL);
        assert_true(p.stats.gap < 1e-3);
        problem_free(&p);
    }
}

/* Steps that are to be solved well take all their iterations: up to 1e-6 of the energy the gap would be 5 %. */
static void the_sharpest_are_solved_to_the_end(void **state)
{
    problem p = tube(*state, 200, 2, 3e4);
    bench_ok(p.b, dmk_mesh_vertex_point(p.b->ctx, p.mesh, 100, &p.source));
    problem_solve(&p);
    print_message("# %d steps, gap %.1e\n", p.stats.steps, p.stats.gap);
    assert_true(p.stats.steps > USUAL);
    assert_true(p.stats.gap < 1e-2);
    problem_free(&p);
}

/* Where mu goes on changing but the cost has settled, that is enough, unless a smaller gap is asked for. */
static void a_settled_cost_is_enough(void **state)
{
    problem p = tube(*state, 6, 2, 200);
    problem_solve(&p);
    assert_int_equal(p.stats.steps, USUAL);
    assert_true(p.stats.gap < 1e-3 && p.stats.gap > 1e-4);
    p.options.gap_tolerance = 1e-4;
    problem_solve(&p);
    assert_true(p.stats.steps > USUAL);
    assert_true(p.stats.gap < 1e-4);
    problem_free(&p);
}

/* The caller's limit is kept. */
static void limits_hold(void **state)
{
    problem p = tube(*state, 3, 5, 0.01);
    p.options.max_steps = USUAL;
    assert_int_equal(problem_try(&p), DMK_E_LIMIT);
    problem_free(&p);
}

/* ---- their parts ----------------------------------------------------------------------------- */

static void pairs_come_back(void **state)
{
    problem p = tube(*state, 6, 5, 3);
    problem_solve(&p);
    dmk_system *s = p.solver->system;
    p.stats.gap = 0.25, p.stats.change = 0.5;
    dmk_iteration o = {.ctx = p.b->ctx,
                       .sys = s,
                       .stats = &p.stats,
                       .fresh = true,
                       .certified = true,
                       .ready = DMK_HIERARCHY};
    pair best = {0}, after = {0};
    bench_ok(p.b, keep(&o, true, &best));
    assert_true(best.gap == 0.25 && best.settled && best.mu[0] > 0);
    bench_ok(p.b, dmk_elements_fill(o.ctx, s, s->mu, 7));
    bench_ok(p.b, dmk_buffer_clear(o.ctx, s->device, s->u,
                                   rows(&o) * dmk_device_real(s->device, DMK_OUTER)));
    p.stats.change = 1;
    bench_ok(p.b, bring_back(&o, &best));
    assert_true(p.stats.change == 0.5);
    assert_true(!o.fresh && !o.certified && o.ready == DMK_NOTHING);
    bench_ok(p.b, keep(&o, false, &after));
    assert_memory_equal(after.u, best.u, rows(&o) * sizeof *best.u);
    assert_memory_equal(after.mu, best.mu, elements(&o) * sizeof *best.mu);
    free(best.u), free(best.mu), free(after.u), free(after.mu);
    problem_free(&p);
}

typedef struct beginning {
    pair first;
    int n; /* restarts */
    dmk_iteration *of;
} beginning;

static int begin_again(dmk_context *ctx, void *user)
{
    beginning *b = user;
    const dmk_system *s = b->of->sys;
    b->n++;
    const int rc = dmk_buffer_write_real(ctx, s->device, DMK_OUTER, s->u, rows(b->of), b->first.u);
    return rc ? rc
              : dmk_buffer_write_real(ctx, s->device, DMK_OUTER, s->mu, elements(b->of),
                                      b->first.mu);
}

/* A second attempt takes the steps, to the bit, that it would take without a first. */
static void attempts_begin_anew(void **state)
{
    problem p = tube(*state, 3, 5, 0.01);
    p.options.max_steps = 1;
    assert_int_equal(problem_try(&p), DMK_E_LIMIT);
    p.options.max_steps = 0;
    p.options.tolerance = 1e-3; /* no bounds in between, which leave nothing known either */
    dmk_iteration o = problem_iteration(&p);
    beginning b = {.of = &o};
    bench_ok(p.b, keep(&o, false, &b.first));
    o.restart = begin_again;
    o.user = &b;
    bench_ok(p.b, dmk_attempts(&o, true));
    const dmk_stats found = p.stats;
    assert_int_equal(b.n, 1);
    bench_ok(p.b, begin_again(o.ctx, &b));
    o = problem_iteration(&p);
    bench_ok(p.b, dmk_newton(&o, true, attempts[second(&o)].effort, attempts[second(&o)].steps));
    assert_int_equal(found.steps, USUAL + p.stats.steps);
    assert_true(found.change == p.stats.change);
    free(b.first.u), free(b.first.mu);
    problem_free(&p);
}

/* Bounds are of the problem, whichever pair gave them: the better ones stay. */
static void bounds_of_attempts_before_stay(void **state)
{
    problem p = tube(*state, 3, 5, 0.01);
    p.options.max_steps = 1;
    assert_int_equal(problem_try(&p), DMK_E_LIMIT);
    p.options.gap_tolerance = 1e-7; /* each step has bounds: about 5 and 6 */
    for (int good = 0; good < 2; good++) {
        dmk_iteration o = problem_iteration(&p);
        pair best = {0};
        bool done;
        p.stats.cost_lower = good ? 5.5 : 1;
        p.stats.cost_upper = good ? 5.6 : 100;
        assert_int_equal(attempt(&o, true, second(&o), &best, &done), DMK_E_LIMIT);
        const double lower = p.stats.cost_lower, upper = p.stats.cost_upper;
        if (!(good ? lower == 5.5 && upper == 5.6 : lower > 4 && upper < 7))
            fail_msg("%g, %g", lower, upper);
    }
    problem_free(&p);
}

/* An iteration in which everything becomes no number, down to the padding, leaves none to the next solve. */
static void no_solve_spoils_the_next(void **state)
{
    problem p = tube(*state, 3, 3, 3);
    p.options.start = DMK_START_UNIFORM;
    problem_solve(&p);
    const dmk_stats first = p.stats;
    dmk_system *s = p.solver->system;
    assert_true(s->n_elements < s->n_elements_pad);
    dmk_iteration o = problem_iteration(&p);
    o.between = true;
    bench_ok(p.b, dmk_system_start_even(o.ctx, s));
    bench_ok(p.b, dmk_buffer_fill_real(o.ctx, s->device, DMK_OUTER, s->f, rows(&o), NAN));
    assert_int_equal(dmk_newton(&o, false, 0, USUAL), DMK_E_DIVERGED);
    problem_solve(&p);
    assert_int_equal(p.stats.steps, first.steps);
    assert_true(p.stats.cost_upper == first.cost_upper && p.stats.cost_lower == first.cost_lower);
    problem_free(&p);
}

/* After 60 steps, 40 of them in attempts before. */
static bool follows(int max_steps, double tolerance, double change, int rc)
{
    const dmk_solve_options options = {.max_steps = max_steps, .tolerance = tolerance};
    dmk_stats stats = {.change = change, .steps = 60};
    return may_follow(&(dmk_iteration){.options = &options, .stats = &stats}, rc);
}

static void others_follow_what_failed(void **state)
{
    (void)state;
    for (int rc = DMK_OK; rc >= DMK_E_DIVERGED - 9; rc--) {
        const bool ended = rc == DMK_OK || rc == DMK_E_DIVERGED || rc == DMK_E_LIMIT;
        assert_false(follows(60, 0, 1, rc));
        assert_int_equal(follows(61, 0, 1, rc), ended);
        assert_int_equal(follows(0, 0, 1, rc), ended);
        assert_int_equal(follows(0, 1e-2, 1, rc), ended && rc != DMK_OK);
        assert_int_equal(follows(0, 1e-5, 1, rc), ended);
        assert_int_equal(follows(0, 1e-5, 1e-3, rc),
                         ended && rc != DMK_E_LIMIT); /* as near as ever */
    }
}

/* The gap up to which no attempt follows. */
static double limit(double gap_tolerance, bool settled)
{
    const dmk_solve_options options = {.gap_tolerance = gap_tolerance};
    return enough(&(dmk_iteration){.options = &options}, settled);
}

static void gaps_decide(void **state)
{
    (void)state;
    assert_true(limit(0, true) == 3e-3 && limit(1e-5, true) == 3e-3 && limit(0.02, true) == 0.02);
    assert_true(limit(0, false) == 1e-3 && limit(0.1, false) == 1e-3 && limit(1e-5, false) == 1e-5);
    assert_true(limit(1e-300, true) == 3e-3 && limit(1e-300, false) == 1e-3); /* only shown */
    const pair best = {.u = (double[1]){0}, .gap = 0.01, .settled = true};
    assert_true(is_in_vain(&best, 0.01, true) && !is_in_vain(&best, 0.0099, true));
    assert_true(!is_in_vain(&best, 0.02, false) && !is_in_vain(&(pair){.settled = true}, 1, true));
    assert_false(is_in_vain(&(pair){.u = best.u, .gap = 0.01}, 0.02, true));
    dmk_iteration o = {0};
    const pair poor = {.u = (double[1]){0}, .gap = 0.6};
    assert_int_equal(settle_for(&o, &(pair){0}, false, DMK_E_DIVERGED), DMK_E_DIVERGED);
    assert_int_equal(settle_for(&o, &poor, false, DMK_E_DIVERGED), DMK_E_DIVERGED);
    assert_int_equal(settle_for(&o, &poor, true, DMK_E_LIMIT), DMK_E_LIMIT);
    assert_int_equal(settle_for(&o, &best, true, DMK_E_NOMEM), DMK_E_NOMEM);
}

static const double *script; /* gaps of attempts */
static int n_settled; /* of which the first ones settle; the others come to their limit, far off */

static int settle(dmk_iteration *o, bool from_distance, int effort, int steps)
{
    (void)from_distance, (void)effort, (void)steps;
    o->stats->steps = o->before + 1;
    o->stats->change = 1;
    return n_settled-- > 0 ? DMK_OK : dmk_iteration_limit(o, 1, 1);
}

static int read_script(dmk_iteration *o, bool last)
{
    (void)last;
    o->stats->gap = *script++;
    return DMK_OK;
}

/* How the attempts end with these gaps, so many of which settle; *n: how many are made. */
static int end_with(problem *p, int settled, const double *gaps, int *n)
{
    dmk_iteration o = problem_iteration(p);
    pair first = {0};
    bench_ok(p->b, keep(&o, false, &first));
    beginning b = {.first = first, .of = &o};
    o.restart = begin_again;
    o.user = &b;
    script = gaps;
    n_settled = settled;
    newton = settle;
    certify = read_script;
    const int rc = dmk_attempts(&o, true);
    newton = dmk_newton;
    certify = dmk_certify;
    free(b.first.u), free(b.first.mu);
    *n = b.n + 1;
    return rc;
}

/* How many attempts are made with these gaps, the rest of which would do. */
static int attempts_with(problem *p, const double *gaps)
{
    int n;
    bench_ok(p->b, end_with(p, ATTEMPTS, gaps, &n));
    return n;
}

/* One that was solved better and has settled at no less of a gap is the last. */
static void none_follows_in_vain(void **state)
{
    problem p = tube(*state, 6, 5, 3);
    problem_solve(&p);
    assert_int_equal(attempts_with(&p, (const double[]){0.1, 0.05, 1e-3}), 3);
    assert_int_equal(attempts_with(&p, (const double[]){0.1, 0.1, 1e-3}), 2);
    assert_int_equal(attempts_with(&p, (const double[]){1e-3}), 1);
    /* The steps that are asked for are those of all, each of which takes one here. */
    p.options.tolerance = DMK_DEFAULT_TOLERANCE / 3;
    assert_int_equal(attempts_with(&p, (const double[]){0.1, 0.05, 1e-3}), 3);
    p.options.max_steps = 2;
    assert_int_equal(attempts_with(&p, (const double[]){0.1, 0.05, 1e-3}), 2);
    problem_free(&p);
}

/* Where less of a change is asked for than usual a small gap is no result by itself, and what is missing is said. */
static void an_asked_change_is_reached(void **state)
{
    int n;
    problem p = tube(*state, 6, 5, 3);
    problem_solve(&p);
    const double gaps[ATTEMPTS] = {1e-2, 1e-2, 1e-2, 1e-2};
    assert_int_equal(end_with(&p, 0, gaps, &n), DMK_OK);
    p.options.tolerance = DMK_DEFAULT_TOLERANCE / 3;
    assert_int_equal(end_with(&p, 0, gaps, &n), DMK_E_LIMIT);
    char said[64];
    snprintf(said, sizeof said, "%d steps did not reach the tolerance", n);
    assert_non_null(strstr(dmk_context_message(p.b->ctx), said)); /* of all attempts */
    assert_int_equal(n, p.solver->system->without_T ? ATTEMPTS : ATTEMPTS - 1);
    assert_int_equal(end_with(&p, 1, gaps, &n), DMK_OK);
    problem_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(others_follow_what_failed),
                                       cmocka_unit_test(gaps_decide),
                                       cmocka_unit_test(an_asked_change_is_reached),
                                       cmocka_unit_test(none_follows_in_vain),
                                       cmocka_unit_test(pairs_come_back),
                                       cmocka_unit_test(attempts_begin_anew),
                                       cmocka_unit_test(bounds_of_attempts_before_stay),
                                       cmocka_unit_test(no_solve_spoils_the_next),
                                       cmocka_unit_test(solved_better_steps_end),
                                       cmocka_unit_test(needles_settle_in_the_first_attempt),
                                       cmocka_unit_test(the_sharpest_are_solved_to_the_end),
                                       cmocka_unit_test(a_settled_cost_is_enough),
                                       cmocka_unit_test(limits_hold)};
    return cmocka_run_group_tests_name("attempts", tests, bench_setup, bench_teardown);
}
