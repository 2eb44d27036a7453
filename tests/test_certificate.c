/* The bounds of the cost: on the right side of known optima and close to them, also where needles
 * and single precision would spoil them. */
#include "../src/solver/bounds.c" /* for their static functions; the library's own are then left out */
#include "../src/solver/certificate.c"
#include "../src/solver/repair.c"

#include "iterating.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

/* Minimisers of the discrete problem by an interior-point method, to 1e-10. */
static const struct {
    const char *mesh;
    double cost;
} optima[] = {
    {"tests/data/torus_5440.off.gz", 320.77738653815756},
    {"tests/data/quartic_5000.off.gz", 32.958367411652105},
    {"tests/data/sphere_1280.off", 19.721385630439578},
};
enum { N_OPTIMA = sizeof optima / sizeof *optima };

/* A run that ends with this gap fails if either bound is off by as much. */
static const double close_gap = 3e-5;

static void bounds_enclose_known_optima(void **state)
{
    for (int i = 0; i < N_OPTIMA; i++) {
        problem p = problem_file(*state, optima[i].mesh);
        p.options.tolerance = 1e-9;
        p.options.gap_tolerance = close_gap;
        p.options.max_steps = 100;
        problem_solve(&p);
        double upper = p.stats.cost_upper / optima[i].cost - 1,
               lower = p.stats.cost_lower / optima[i].cost - 1;
        print_message("# %s: %d steps, lower %.2e, upper %.2e, %d sweeps\n", optima[i].mesh,
                      p.stats.steps, lower, upper, p.stats.sweeps);
        assert_true(p.stats.gap <= close_gap);
        if (!(lower <= 1e-9 && upper >= -1e-9)) fail_msg("lower %g, upper %g", lower, upper);
        problem_free(&p);
    }
}

static void bounds_are_close_at_the_default_stop(void **state)
{
    for (int i = 0; i < N_OPTIMA; i++) {
        problem p = problem_file(*state, optima[i].mesh);
        problem_solve(&p);
        print_message("# %s: gap %.2e, %d sweeps\n", optima[i].mesh, p.stats.gap, p.stats.sweeps);
        assert_true(p.stats.cost_lower <= optima[i].cost * (1 + 1e-9));
        assert_true(p.stats.cost_upper >= optima[i].cost * (1 - 1e-9));
        if (!(p.stats.gap <= 1e-3)) fail_msg("gap %g", p.stats.gap);
        problem_free(&p);
    }
}

/* In single precision the density is no better than its rounding; the bounds hold all the same. */
static void bounds_hold_in_single_precision(void **state)
{
    (void)state;
    bench b;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    o.single_precision = 1;
    bench_open(&b, &o);
    for (int i = 0; i < N_OPTIMA; i++) {
        problem p = problem_file(&b, optima[i].mesh);
        problem_solve(&p);
        double upper = p.stats.cost_upper / optima[i].cost - 1,
               lower = p.stats.cost_lower / optima[i].cost - 1;
        print_message("# %s: lower %.2e, upper %.2e\n", optima[i].mesh, lower, upper);
        assert_false(p.stats.double_precision);
        if (!(lower <= 0 && upper >= 0 && p.stats.gap <= 3e-3))
            fail_msg("lower %g, upper %g", lower, upper);
        problem_free(&p);
    }
    bench_close(&b);
}

/* ---- the upper bound ------------------------------------------------------------------------- */

/* A bound that comes no nearer is given up after four better u. */
static void bounds_are_given_up(void **state)
{
    problem p = problem_file(*state, optima[0].mesh);
    problem_solve(&p);
    dmk_iteration o = problem_iteration(&p);
    search s = {.upper = INFINITY, .tolerance = first_tolerance};
    const double never = -0.5;
    bench_ok(p.b, find_upper(&o, &s, never));
    assert_int_equal(s.solves, 4);
    free(s.own);
    free(s.solved);
    problem_free(&p);
}

/* ---- rounding -------------------------------------------------------------------------------- */

/* |grad|^2 as steepness() has it, but for rounding. */
static long double exact_steepness(const double l[3], double area, const double x[3])
{
    const int k = l[0] >= l[1] && l[0] >= l[2] ? 0 : l[1] >= l[2] ? 1 : 2;
    const long double a = l[(k + 1) % 3], b = l[(k + 2) % 3], c = l[k];
    const long double part = (b * b + c * c - a * a) / (2 * c * c);
    const long double side = (long double)x[(k + 2) % 3] - x[(k + 1) % 3],
                      off = (long double)x[k] - x[(k + 1) % 3];
    const long double across = (off - part * side) * c / (2 * (long double)area);
    return side * side / (c * c) + across * across;
}

/* On needles, over which the values change along the longest side only. */
static void steepness_has_its_rounding_on_top(void **state)
{
    (void)state;
    uint32_t seed = 1;
    for (int i = 0; i < 100000; i++) {
        double r[3];
        for (int k = 0; k < 3; k++)
            r[k] = ((seed = seed * 1664525u + 1013904223u) + 0.5) / 4294967296.0;
        const double height = pow(10, -12 * r[0]), foot = sqrt(r[1]), low = sqrt(r[2]);
        const double l[3] = {hypot(foot, height), hypot(1 - foot, height), 1};
        const double x[3] = {low, low + 1, low + 1 - foot};
        if (!((long double)steepness(l, 0.5 * height, x) >= exact_steepness(l, 0.5 * height, x)))
            fail_msg("height %g, foot %g, %.17g", height, foot, low);
    }
}

/* The bound of w + shift, row by row of p's device; the shift changes nothing but rounding. */
static double bound_of_shifted(problem *p, const double *w, double shift)
{
    dmk_system *s = p->solver->system;
    dmk_buffer *v = s->cg[DMK_OUTER].p;
    dmk_iteration o = {
        .ctx = p->b->ctx, .sys = s, .mesh = &p->solver->mollified, .stats = &p->stats};
    double bound = 0, *x = calloc((size_t)s->n_rows_pad, sizeof *x);
    assert_non_null(x);
    for (int32_t i = 0; i < s->n_rows; i++) x[i] = w[i] + shift;
    bench_ok(p->b, dmk_buffer_write_real(o.ctx, s->device, DMK_OUTER, v, (size_t)s->n_rows_pad, x));
    bench_ok(p->b, dmk_bound_plain(&o, v, &bound));
    free(x);
    return bound;
}

/* f is rounded to single precision, and with it f.v, all the more the larger v is: the bound stays one all the same.
 * w: u in numbers that single precision holds with the shift, too. */
static void bounds_hold_for_shifted_functions(void **state)
{
    bench b;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.single_precision = 1;
    bench_open(&b, &options);
    problem p = problem_file(*state, optima[2].mesh), q = problem_file(&b, optima[2].mesh);
    problem_solve(&p);
    problem_solve(&q);
    const dmk_system *s = p.solver->system;
    double *w = calloc((size_t)s->n_rows_pad, sizeof *w);
    assert_non_null(w);
    assert_int_equal(s->n_rows, q.solver->system->n_rows);
    bench_ok(p.b,
             dmk_buffer_read_real(p.b->ctx, s->device, DMK_OUTER, s->u, (size_t)s->n_rows_pad, w));
    for (int32_t i = 0; i < s->n_rows; i++) {
        assert_true(fabs(w[i]) < 2);
        w[i] = ldexp(nearbyint(ldexp(w[i], 16)), -16);
    }
    const double exact = bound_of_shifted(&p, w, 0);
    for (int sign = -1; sign <= 1; sign++) {
        const double bound = bound_of_shifted(&q, w, 64 * sign);
        print_message("# shift %d: %.3e\n", 64 * sign, bound / exact - 1);
        assert_true(bound <= exact * (1 + 1e-12) && bound > exact * (1 - 1e-3));
    }
    free(w);
    problem_free(&p);
    problem_free(&q);
    bench_close(&b);
}

/* ---- needles --------------------------------------------------------------------------------- */

/* The torus with every 5th triangle's first corner, unless a neighbour has moved, next to the
 * second: at that part of the way. */
static problem needles(bench *b, double part)
{
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "torus";
    o.n_triangles = 6000;
    problem plain = problem_surface(b, &o);
    const int32_t *t = dmk_mesh_triangles(plain.mesh);
    size_t nv = problem_vertices(&plain), nt = problem_triangles(&plain);
    double *x = malloc(3 * nv * sizeof *x);
    char *moved = calloc(nv, 1);
    assert_true(x && moved);
    memcpy(x, dmk_mesh_vertices(plain.mesh), 3 * nv * sizeof *x);
    moved[0] = 1;
    for (size_t i = 0; i < nt; i += 5) {
        const int32_t *c = t + 3 * i;
        if (moved[c[0]] || moved[c[1]] || moved[c[2]]) continue;
        for (int k = 0; k < 3; k++)
            x[3 * c[0] + k] = (1 - part) * x[3 * c[1] + k] + part * x[3 * c[0] + k];
        moved[c[0]] = moved[c[1]] = moved[c[2]] = 1;
    }
    problem p = problem_create(b, nv, x, nt, t);
    problem_free(&plain);
    free(x);
    free(moved);
    return p;
}

static void needles_are_repaired(void **state)
{
    problem p = needles(*state, 0.006);
    problem_solve(&p);
    print_message("# least angle %.2g degrees: gap %.2e, %d sweeps\n", p.info.min_angle,
                  p.stats.gap, p.stats.sweeps);
    assert_true(p.info.min_angle < 1);
    assert_true(p.stats.sweeps > 0);
    if (!(p.stats.gap <= 3e-3)) fail_msg("gap %g", p.stats.gap);
    problem_free(&p);
}

/* For its first bound A(mu) u = f is solved neither much better than pays nor so loosely that it is no good. */
static void first_bounds_are_cheap(void **state)
{
    static const double part[] = {0.006, 0.003};
    int iterations = 0;
    for (int i = 0; i < 2; i++) {
        problem p = needles(*state, part[i]);
        problem_solve(&p);
        dmk_iteration o = problem_iteration(&p);
        const dmk_system *s = o.sys;
        search found = {.upper = INFINITY, .tolerance = first_tolerance};
        o.loose = true;
        bench_ok(p.b,
                 dmk_buffer_clear(o.ctx, s->device, s->u,
                                  (size_t)s->n_rows_pad * dmk_device_real(s->device, DMK_OUTER)));
        bench_ok(p.b, find_upper(&o, &found, 0.1));
        assert_int_equal(found.solves, 1);
        iterations += p.stats.cg_iterations;
        free(found.own);
        free(found.solved);
        problem_free(&p);
    }
    /* Twice as loosely it is 42, to half of it 60. */
    print_message("# %d iterations of CG for two bounds\n", iterations);
    assert_true(iterations > 45 && iterations < 55);
}

/* A u of loose solves gives the first bound itself where its slopes have settled. */
static void settled_slopes_need_no_solve(void **state)
{
    static const double slopes[] = {1.5e-3, 2.5e-3};
    problem p = needles(*state, 0.006);
    problem_solve(&p);
    for (int i = 0; i < 2; i++) {
        dmk_iteration o = problem_iteration(&p);
        search found = {.upper = INFINITY, .tolerance = first_tolerance};
        o.loose = true;
        o.rho = slopes[i];
        bench_ok(p.b, find_upper(&o, &found, 0.1));
        assert_int_equal(found.solves, i);
        free(found.own);
        free(found.solved);
    }
    problem_free(&p);
}

static void repair_gives_the_same_bits(void **state)
{
    problem a = needles(*state, 0.006), b = needles(*state, 0.006);
    problem_solve(&a);
    problem_solve(&b);
    problem_solve(&b);
    assert_true(a.stats.sweeps > 0);
    assert_true(a.stats.cost_lower == b.stats.cost_lower);
    assert_int_equal(a.stats.sweeps, b.stats.sweeps);
    problem_free(&a);
    problem_free(&b);
}

static void repair_is_the_same_in_the_gpu_shape(void **state)
{
    /* Among the sharper needles of the second the repair ends where the gap is good enough, which another rounding may
     * reach a batch or an attempt sooner. */
    static const double part[] = {0.01, 0.006}, close[] = {3e-5, 3e-4};
    bench b;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    o.shape = DMK_SHAPE_GPU;
    bench_open(&b, &o);
    for (int i = 0; i < 2; i++) {
        problem p = needles(*state, part[i]), q = needles(&b, part[i]);
        problem_solve(&p);
        problem_solve(&q);
        print_message("# gpu shape: gap %.2e, %d sweeps\n", q.stats.gap, q.stats.sweeps);
        assert_true(q.stats.sweeps > 0 && q.stats.gap <= 3e-3);
        assert_true(fabs(q.stats.cost_lower / p.stats.cost_lower - 1) < close[i]);
        problem_free(&p);
        problem_free(&q);
    }
    bench_close(&b);
}

/* A gap that cannot be reached in the time that the repair gives itself: the triangles are named.
 */
static void triangles_that_hold_it_back_are_named(void **state)
{
    problem p = needles(*state, 0.003);
    p.options.gap_tolerance = 2e-7;
    p.options.tolerance = 1e-2;
    problem_solve(&p);
    assert_true(p.stats.gap > 2e-7);
    assert_true(p.stats.n_steep > 0);
    /* 40 between two steps, 60 at the end. */
    if (p.stats.sweeps > 900) fail_msg("%d sweeps", p.stats.sweeps);
    for (int k = 0; k < DMK_N_STEEP; k++) {
        assert_true(p.stats.steep[k] >= -1 && p.stats.steep[k] < (int64_t)problem_triangles(&p));
        assert_true((p.stats.steep[k] >= 0) == (k < p.stats.n_steep));
        for (int j = 0; j < k; j++)
            assert_true(p.stats.steep[k] < 0 || p.stats.steep[j] != p.stats.steep[k]);
    }
    problem_free(&p);
}

/* Sweeps that cannot reach their goal end at the second look. */
static void hopeless_repairs_end(void **state)
{
    problem p = needles(*state, 0.003);
    problem_solve(&p);
    dmk_iteration o = problem_iteration(&p);
    p.stats.sweeps = 0;
    bench_ok(p.b, dmk_repair(&o, (const double[]){1e-9, 1e-9}, INFINITY, false));
    assert_int_equal(p.stats.sweeps, 40);
    bench_ok(p.b, dmk_repair(&o, (const double[]){1e-9, 1e-9}, INFINITY, true));
    assert_int_equal(p.stats.sweeps, 40 + 100);
    problem_free(&p);
}

/* The gap of the present pair, by the last repair of all or by one that steps may follow. */
static double gap_after(problem *p, bool goes_on)
{
    dmk_iteration o = problem_iteration(p);
    o.loose = true;
    o.goes_on = goes_on;
    bench_ok(p->b, dmk_certify(&o, true));
    return p->stats.gap;
}

/* Where no steps follow a repair goes on to a gap that steps would have to bring otherwise. Which shapes of needles
 * need that depends on the processor's rounding: nearly every second one leaves twice the gap otherwise, none if the
 * last repair ends where others do. */
static void the_last_word_is_given_up_late(void **state)
{
    bool found = false;
    for (int k = 0; k < 24 && !found; k++) {
        problem p = needles(*state, 0.00024 * pow(1.06, k));
        p.options.tolerance = DMK_DEFAULT_TOLERANCE;
        problem_solve(&p);
        const double last = gap_after(&p, false), other = gap_after(&p, true);
        found = other > 2 * last;
        print_message("# shape %d: gap %.2g, where steps follow %.2g\n", k, last, other);
        problem_free(&p);
    }
    assert_true(found);
}

/* Of a lower bound below the least that an upper one can be, and of a gap, at a goal of 1e-3. */
static bool sharpens(double enough, double below, double gap)
{
    const dmk_stats stats = {.cost_lower = 1 - below, .gap = gap};
    return is_worth_sharpening(&stats, &(search){.least = 1}, 1e-3, enough);
}

static void upper_bounds_are_sharpened_where_that_may_do(void **state)
{
    (void)state;
    assert_false(sharpens(1e-3, 5e-4, 9e-4)); /* the goal is reached */
    assert_true(sharpens(1e-3, 9e-4, 1.1e-3) && sharpens(1e-3, 9e-4, 4e-3));
    assert_false(sharpens(1e-3, 1.1e-3, 1.2e-3)); /* it cannot be */
    assert_false(sharpens(1e-3, 1.1e-3, 2.9e-3));
    assert_true(sharpens(1e-3, 2.8e-3, 3.1e-3)); /* the second one may */
    assert_false(sharpens(3e-3, 9e-4, 2.9e-3));  /* settled, and that is enough */
    assert_true(sharpens(3e-3, 9e-4, 3.1e-3));
}

/* A settled gap is enough between measures, unless one is asked for. */
static void pairs_settle(void **state)
{
    (void)state;
    dmk_solve_options options = {.gap_tolerance = 0};
    dmk_iteration o = {.options = &options};
    assert_true(enough_of(&o, 1e-3) == 1e-3);
    o.between = true;
    assert_true(fabs(enough_of(&o, 1e-3) / DMK_SETTLED_GAP - 1) < 1e-12);
    options.gap_tolerance = 1e-4;
    assert_true(enough_of(&o, 1e-4) == 1e-4);
}

/* Whether a repair that steps follow ends when a batch has brought the gap down so. */
static bool ends(int sweeps, double before, double gap)
{
    dmk_stats stats = {.cost_lower = 1 - gap};
    dmk_iteration o = {.stats = &stats};
    repair r = {.o = &o, .sweeps = sweeps, .patience = 40, .gap = before, .upper = 1};
    return is_done(&r, (const double[]){1e-3, 3e-3});
}

static void batches_foretell_the_next(void **state)
{
    (void)state;
    assert_false(ends(20, 0, 0.5)); /* nothing is known yet */
    assert_true(ends(40, 0.02, 0.0078) && !ends(40, 0.02, 0.0077));
    assert_true(ends(100, 0.02, 0.0078) && !ends(100, 0.02, 0.0077));
    assert_true(ends(20, 0, 0.0009));
    assert_true(!ends(20, 0, 0.0029) && ends(40, 0.02, 0.0029)); /* of the second goal */
}

/* After how many sweeps the last repair ends that leaves these gaps, batch by batch; a repair that steps follow would
 * have ended at the second. */
static int sweeps_of_the_last(const double *gap)
{
    dmk_stats stats = {0};
    dmk_iteration o = {.stats = &stats};
    repair r = {.o = &o, .last = true, .upper = 1};
    for (bool done = false; !done; gap++) {
        r.sweeps += 20;
        stats.cost_lower = 1 - *gap;
        done = is_done(&r, (const double[]){1e-3, 3e-3});
    }
    return r.sweeps;
}

static void the_last_repair_waits(void **state)
{
    (void)state;
    assert_int_equal(sweeps_of_the_last((const double[]){0.23, 0.23, 0.14, 5.6e-4}), 80);
    assert_int_equal(sweeps_of_the_last((const double[]){0.23, 0.12, 0.12, 0.12, 0.12}), 100);
    assert_int_equal(sweeps_of_the_last((const double[]){0.23, 0.11, 0.11, 0.11, 0.11, 0.11}), 120);
}

/* The steepest first, of equal ones the lower number, and no more than there are. */
static void the_steepest_come_first(void **state)
{
    problem p = problem_file(*state, "tests/data/sphere_1280.off");
    problem_solve(&p);
    dmk_system *s = p.solver->system;
    dmk_stats stats = {.sweeps = 1};
    dmk_iteration o = {.ctx = p.b->ctx, .sys = s, .stats = &stats};
    repair r = {.o = &o};
    double *q = calloc((size_t)s->n_elements_pad, sizeof *q);
    const int32_t *old = p.solver->order->order.triangle_old;
    q[1279] = 1;
    q[0] = 1.5;
    q[11] = 1.25;
    q[900] = q[7] = 2;
    for (int i = 0; i < 2; i++) {
        bench_ok(p.b, dmk_buffer_write_real(p.b->ctx, s->device, DMK_OUTER, s->q,
                                            (size_t)s->n_elements_pad, q));
        bench_ok(p.b, find_steep(&r));
        assert_int_equal(stats.n_steep, i == 0 ? 4 : 1);
        dmk_solver_name_steep(p.solver, &stats);
        assert_int_equal(stats.steep[0], old[i == 0 ? 7 : 0]);
        assert_int_equal(stats.steep[1], i == 0 ? old[900] : -1);
        assert_int_equal(stats.steep[2], i == 0 ? old[0] : -1);
        q[11] = q[900] = q[7] = 0;
    }
    /* Repaired once, and not looked at since. */
    stats = (dmk_stats){.sweeps = 20};
    dmk_solver_name_steep(p.solver, &stats);
    for (int k = 0; k < DMK_N_STEEP; k++) assert_int_equal(stats.steep[k], -1);
    free(q);
    problem_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bounds_enclose_known_optima),
        cmocka_unit_test(bounds_are_close_at_the_default_stop),
        cmocka_unit_test(bounds_hold_in_single_precision),
        cmocka_unit_test(bounds_are_given_up),
        cmocka_unit_test(first_bounds_are_cheap),
        cmocka_unit_test(settled_slopes_need_no_solve),
        cmocka_unit_test(steepness_has_its_rounding_on_top),
        cmocka_unit_test(bounds_hold_for_shifted_functions),
        cmocka_unit_test(needles_are_repaired),
        cmocka_unit_test(repair_gives_the_same_bits),
        cmocka_unit_test(repair_is_the_same_in_the_gpu_shape),
        cmocka_unit_test(triangles_that_hold_it_back_are_named),
        cmocka_unit_test(hopeless_repairs_end),
        cmocka_unit_test(the_last_word_is_given_up_late),
        cmocka_unit_test(upper_bounds_are_sharpened_where_that_may_do),
        cmocka_unit_test(pairs_settle),
        cmocka_unit_test(batches_foretell_the_next),
        cmocka_unit_test(the_last_repair_waits),
        cmocka_unit_test(the_steepest_come_first),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
