/* The solver's behaviour: the same answer in any order, unit and sequence; borders, components,
 * limits. */
#include "mesh/mesh.h"
#include "solving.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

static const char small[] = "tests/data/sphere_1280.off";
static const char large[] = "tests/data/quartic_5000.off.gz";
static const char large_mu[] = "tests/data/quartic_5000_mu.txt";

static uint32_t random_state = 1;
static size_t random_below(size_t n)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % n;
}

/* A permutation of 0 .. n-1. */
static int32_t *shuffle(size_t n)
{
    int32_t *p = malloc(n * sizeof *p);
    for (size_t i = 0; i < n; i++) p[i] = (int32_t)i;
    for (size_t i = n - 1; i > 0; i--) {
        size_t j = random_below(i + 1);
        int32_t keep = p[i];
        p[i] = p[j];
        p[j] = keep;
    }
    return p;
}

static void assert_near(double a, double b, double relative)
{
    if (!(fabs(a - b) <= relative * fabs(b))) fail_msg("%.17g is not %.17g", a, b);
}

static void assert_same_bits(const problem *p, const double *mu, const double *distance)
{
    assert_memory_equal(problem_mu(p), mu, problem_triangles(p) * sizeof *mu);
    assert_memory_equal(problem_distance(p), distance, problem_vertices(p) * sizeof *distance);
}

/* ---- numbering, units, repetition ------------------------------------------------------------ */

/* Triangle t becomes triangle to[t], vertex v becomes vertex name[v], and the corners turn. */
static void numbering_does_not_matter(void **state)
{
    problem a = problem_file(*state, small);
    a.options.tolerance = 1e-6;
    problem_solve(&a);
    size_t nv = problem_vertices(&a), nt = problem_triangles(&a);
    int32_t *name = shuffle(nv), *to = shuffle(nt), *triangle = calloc(3 * nt, sizeof *triangle);
    double *xyz = calloc(3 * nv, sizeof *xyz), *moved = calloc(nt, sizeof *moved);
    for (size_t v = 0; v < nv; v++) {
        memcpy(xyz + 3 * name[v], dmk_mesh_vertices(a.mesh) + 3 * v, 3 * sizeof *xyz);
    }
    for (size_t t = 0; t < nt; t++) {
        size_t turn = random_below(3);
        for (size_t k = 0; k < 3; k++) {
            int32_t old = dmk_mesh_triangles(a.mesh)[3 * t + k];
            triangle[3 * (size_t)to[t] + (k + turn) % 3] = name[old];
        }
        moved[to[t]] = problem_mu(&a)[t];
    }
    problem b = problem_create(*state, nv, xyz, nt, triangle);
    b.options.tolerance = 1e-6;
    bench_ok(b.b, dmk_mesh_vertex_point(b.b->ctx, b.mesh, name[0], &b.source));
    problem_solve(&b);
    double error = problem_l1(&b, moved);
    if (!(error <= 1e-6)) fail_msg("L1 difference %g", error);
    for (size_t v = 0; v < nv; v++) {
        assert_true(fabs(problem_distance(&b)[name[v]] - problem_distance(&a)[v]) < 1e-5);
    }
    assert_near(b.stats.cost_upper, a.stats.cost_upper, 1e-7);
    problem_free(&a);
    problem_free(&b);
    free(name);
    free(to);
    free(triangle);
    free(xyz);
    free(moved);
}

/* Lengths times s: mu and distance times s, costs times s^3, area times s^2. */
static void check_scale(const problem *a, double s)
{
    size_t nv = problem_vertices(a), nt = problem_triangles(a);
    double *xyz = calloc(3 * nv, sizeof *xyz);
    for (size_t i = 0; i < 3 * nv; i++) xyz[i] = s * dmk_mesh_vertices(a->mesh)[i];
    problem b = problem_create(a->b, nv, xyz, nt, dmk_mesh_triangles(a->mesh));
    b.options.tolerance = a->options.tolerance;
    problem_solve(&b);
    assert_near(b.stats.area, a->stats.area * s * s, 1e-12);
    assert_near(b.stats.cost_upper, a->stats.cost_upper * s * s * s, 1e-7);
    assert_near(b.stats.cost_lower, a->stats.cost_lower * s * s * s, 1e-4);
    double *scaled = problem_keep_mu(a);
    for (size_t t = 0; t < nt; t++) scaled[t] *= s;
    double error = problem_l1(&b, scaled);
    if (!(error < 1e-4)) fail_msg("scale %g: L1 difference %g", s, error);
    for (size_t v = 1; v < nv; v++) {
        assert_near(problem_distance(&b)[v], s * problem_distance(a)[v], 1e-4);
    }
    problem_free(&b);
    free(scaled);
    free(xyz);
}

static void lengths_scale(void **state)
{
    problem a = problem_file(*state, small);
    a.options.tolerance = 1e-6;
    problem_solve(&a);
    check_scale(&a, 1e-3);
    check_scale(&a, 1e4);
    problem_free(&a);
}

static void two_runs_give_the_same_bits(void **state)
{
    for (int method = DMK_NEWTON; method <= DMK_EULER; method++) {
        problem a = problem_file(*state, small), b = problem_file(*state, small);
        a.options.method = b.options.method = (dmk_method)method;
        problem_solve(&a);
        problem_solve(&b);
        assert_same_bits(&b, problem_mu(&a), problem_distance(&a));
        assert_true(a.stats.cost_upper == b.stats.cost_upper);
        assert_true(a.stats.cost_lower == b.stats.cost_lower);
        problem_free(&a);
        problem_free(&b);
    }
}

static void a_used_solver_equals_a_fresh_one(void **state)
{
    problem fresh = problem_file(*state, large), used = problem_file(*state, large);
    problem_solve(&fresh);
    bench_ok(used.b, dmk_mesh_vertex_point(used.b->ctx, used.mesh, 1234, &used.source));
    problem_solve(&used);
    used.options.method = DMK_INERTIAL;
    problem_solve(&used);
    used.options.method = DMK_NEWTON;
    used.source = fresh.source;
    problem_solve(&used);
    assert_same_bits(&used, problem_mu(&fresh), problem_distance(&fresh));
    assert_int_equal(used.stats.cg_iterations, fresh.stats.cg_iterations);
    problem_free(&fresh);
    problem_free(&used);
}

static void its_device_may_come_later(void **state)
{
    problem first = problem_file(*state, large), later = problem_file(*state, large);
    dmk_context *ctx = later.b->ctx;
    problem_solve(&first);
    assert_int_equal(dmk_solver_set_device(ctx, later.solver, later.b->dev), DMK_E_ARG);
    dmk_solver_destroy(&later.solver);
    bench_ok(later.b, dmk_solver_create(ctx, NULL, later.mesh, &later.solver));
    assert_int_equal(problem_try(&later), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "no device"));
    const int32_t n = later.mesh->n_triangles;
    later.mesh->n_triangles = INT32_MAX; /* is refused now, not in the middle of a solve */
    assert_int_equal(dmk_solver_set_device(ctx, later.solver, later.b->dev), DMK_E_NOMEM);
    later.mesh->n_triangles = n;
    bench_ok(later.b, dmk_solver_set_device(ctx, later.solver, later.b->dev));
    problem_solve(&later);
    assert_same_bits(&later, problem_mu(&first), problem_distance(&first));
    problem_free(&first);
    problem_free(&later);
}

/* ---- solves that end early ------------------------------------------------------------------- */

static int stop_at_two(const dmk_progress *progress, void *user)
{
    int *calls = user;
    if (strcmp(progress->stage, "solve") != 0) return 0;
    *calls += 1;
    assert_int_equal(progress->step, *calls);
    return progress->step == 2;
}

static void after_an_early_end_the_next_solve_is_right(void **state)
{
    int calls = 0;
    problem fresh = problem_file(*state, small), p = problem_file(*state, small);
    problem_solve(&fresh);
    dmk_context_set_progress(p.b->ctx, stop_at_two, &calls);
    int rc = problem_try(&p);
    dmk_context_set_progress(p.b->ctx, NULL, NULL);
    assert_int_equal(rc, DMK_E_CANCELLED);
    assert_int_equal(calls, 2);
    problem_solve(&p);
    assert_same_bits(&p, problem_mu(&fresh), problem_distance(&fresh));

    for (int method = DMK_NEWTON; method <= DMK_EULER; method++) {
        p.options.method = (dmk_method)method;
        p.options.max_steps = 1;
        p.options.start = DMK_START_UNIFORM;
        assert_int_equal(problem_try(&p), DMK_E_LIMIT);
        assert_non_null(strstr(dmk_context_message(p.b->ctx), "max_steps"));
    }
    dmk_solve_options_init(&p.options, sizeof p.options);
    problem_solve(&p);
    assert_same_bits(&p, problem_mu(&fresh), problem_distance(&fresh));
    problem_free(&fresh);
    problem_free(&p);
}

static void gap_tolerance_ends_explicit_steps(void **state)
{
    problem p = problem_file(*state, small);
    p.options.method = DMK_EULER;
    p.options.start = DMK_START_UNIFORM;
    p.options.tolerance = 1e-9;
    p.options.gap_tolerance = 0.01;
    problem_solve(&p);
    assert_true(p.stats.gap <= 0.01);
    assert_int_equal(p.stats.steps % 10, 0);
    problem_free(&p);
}

static void bad_options_are_refused(void **state)
{
    problem p = problem_file(*state, small);
    dmk_solve_options plain = p.options;
    dmk_point vertex = p.source;
    static const struct {
        double dt, inertia, tolerance, gap, cg, threshold;
        int max_steps;
    } bad[] = {{.dt = -0.1},     {.dt = 1.5},       {.dt = NAN},        {.inertia = 1},
               {.inertia = NAN}, {.tolerance = -1}, {.tolerance = NAN}, {.gap = -1},
               {.cg = -1},       {.threshold = -1}, {.max_steps = -1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        p.options = plain;
        p.options.dt = bad[i].dt;
        p.options.inertia = bad[i].inertia;
        p.options.tolerance = bad[i].tolerance;
        p.options.gap_tolerance = bad[i].gap;
        p.options.cg_tolerance = bad[i].cg;
        p.options.threshold = bad[i].threshold;
        p.options.max_steps = bad[i].max_steps;
        if (problem_try(&p) != DMK_E_ARG) fail_msg("bad option %zu is taken", i);
    }
    p.options = plain;
    static const dmk_point points[] = {{-1, {1, 0, 0}},
                                       {1280, {1, 0, 0}},
                                       {0, {0.5, 0.2, 0.2}},
                                       {0, {1.5, -0.5, 0}},
                                       {0, {NAN, 0.5, 0.5}}};
    for (size_t i = 0; i < sizeof points / sizeof *points; i++) {
        p.source = points[i];
        if (problem_try(&p) != DMK_E_ARG) fail_msg("bad source %zu is taken", i);
    }
    p.source = vertex;
    problem_solve(&p);
    problem_free(&p);
}

static void threshold_marks_the_approximate_locus(void **state)
{
    problem p = problem_file(*state, small);
    for (int k = 0; k < 3; k++) {
        size_t marked = 0;
        p.options.threshold = k == 0 ? 0.1 : k == 1 ? 0.3 : 1e9;
        problem_solve(&p);
        const uint8_t *acl = dmk_result_acl(p.result, NULL);
        for (size_t t = 0; t < problem_triangles(&p); t++) {
            double bound = p.options.threshold;
            if (fabs(problem_mu(&p)[t] - bound) < 1e-9 * bound) continue;
            assert_int_equal(acl[t], problem_mu(&p)[t] <= bound);
            marked += acl[t];
        }
        assert_true(marked > 0 && (k == 2) == (marked == problem_triangles(&p)));
    }
    problem_free(&p);
}

/* ---- shapes of meshes ------------------------------------------------------------------------ */

/* A square [0,1]^2 of 2 n n triangles, moved by dx. The last vertex is
 * the corner (dx + 1, 1). */
static void add_square(int n, double dx, int32_t first, double *xyz, int32_t *triangle)
{
    for (int j = 0; j <= n; j++) {
        for (int i = 0; i <= n; i++, xyz += 3) {
            xyz[0] = dx + (double)i / n;
            xyz[1] = (double)j / n;
            xyz[2] = 0;
        }
    }
    for (int j = 0; j < n; j++) {
        for (int i = 0; i < n; i++, triangle += 6) {
            int32_t a = first + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
            int32_t two[6] = {a, b, d, a, d, c};
            memcpy(triangle, two, sizeof two);
        }
    }
}

enum { SIDE = 24, SQUARE_VERTICES = (SIDE + 1) * (SIDE + 1), SQUARE_TRIANGLES = 2 * SIDE * SIDE };

/* Integral over the unit square of the distance to a corner: (sqrt 2 + asinh 1) / 3. */
static const double CORNER_COST = 0.76519571;

static void check_square(const problem *p, int32_t first, int32_t at)
{
    if (!(fabs(p->stats.cost_upper - CORNER_COST) < 0.02)) {
        fail_msg("the square costs %g", p->stats.cost_upper);
    }
    assert_near(p->stats.area, 1, 1e-12);
    const double *x = dmk_mesh_vertices(p->mesh) + 3 * first;
    const double *corner = dmk_mesh_vertices(p->mesh) + 3 * at;
    for (int v = 0; v < SQUARE_VERTICES; v++, x += 3) {
        double exact = hypot(x[0] - corner[0], x[1] - corner[1]);
        assert_true(fabs(problem_distance(p)[first + v] - exact) < 0.5 / SIDE);
    }
}

static void border_is_solved(void **state)
{
    double *xyz = calloc(3 * SQUARE_VERTICES, sizeof *xyz);
    int32_t *triangle = calloc(3 * SQUARE_TRIANGLES, sizeof *triangle);
    add_square(SIDE, 0, 0, xyz, triangle);
    problem p = problem_create(*state, SQUARE_VERTICES, xyz, SQUARE_TRIANGLES, triangle);
    /* The first row of the packed vertices and the last one. */
    for (int32_t corner = 0; corner < SQUARE_VERTICES; corner += SQUARE_VERTICES - 1) {
        bench_ok(p.b, dmk_mesh_vertex_point(p.b->ctx, p.mesh, corner, &p.source));
        problem_solve(&p);
        assert_true(p.stats.steps <= 20);
        check_square(&p, 0, corner);
    }
    problem_free(&p);
    free(xyz);
    free(triangle);
}

/* Two squares and a vertex in no triangle between them: each square is solved, by itself, and the
 * first again after the second. */
static void components_are_solved_apart(void **state)
{
    const int32_t second = SQUARE_VERTICES + 1;
    double *xyz = calloc(3 * (2 * SQUARE_VERTICES + 1), sizeof *xyz);
    int32_t *triangle = calloc(6 * SQUARE_TRIANGLES, sizeof *triangle);
    add_square(SIDE, 0, 0, xyz, triangle);
    add_square(SIDE, 3, second, xyz + 3 * second, triangle + 3 * SQUARE_TRIANGLES);
    problem p =
        problem_create(*state, 2 * SQUARE_VERTICES + 1, xyz, 2 * SQUARE_TRIANGLES, triangle);
    for (int k = 0; k < 3; k++) {
        int32_t first = k == 1 ? second : 0;
        size_t begin = k == 1 ? SQUARE_TRIANGLES : 0;
        int32_t corner = first + SQUARE_VERTICES - 1;
        bench_ok(p.b, dmk_mesh_vertex_point(p.b->ctx, p.mesh, corner, &p.source));
        problem_solve(&p);
        check_square(&p, first, corner);
        for (size_t t = 0; t < 2 * SQUARE_TRIANGLES; t++) {
            bool inside = t >= begin && t < begin + SQUARE_TRIANGLES;
            assert_true(inside ? problem_mu(&p)[t] > 0 : problem_mu(&p)[t] == 0);
        }
        for (int32_t v = 0; v < 2 * SQUARE_VERTICES + 1; v++) {
            bool inside = v >= first && v < first + SQUARE_VERTICES;
            assert_int_equal(isfinite(problem_distance(&p)[v]) != 0, inside);
            if (!inside) assert_true(problem_distance(&p)[v] == INFINITY);
        }
    }
    dmk_point none;
    assert_int_equal(dmk_mesh_vertex_point(p.b->ctx, p.mesh, SQUARE_VERTICES, &none), DMK_E_ARG);
    problem_free(&p);
    free(xyz);
    free(triangle);
}

static void tetrahedron_is_solved(void **state)
{
    static const double xyz[] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1};
    static const int32_t triangle[] = {0, 1, 2, 0, 2, 3, 0, 3, 1, 1, 3, 2};
    problem p = problem_create(*state, 4, xyz, 4, triangle);
    problem_solve(&p);
    assert_true(problem_distance(&p)[0] == 0);
    for (int v = 1; v < 4; v++) {
        assert_near(problem_distance(&p)[v], problem_distance(&p)[1], 1e-3);
        assert_near(problem_distance(&p)[v], sqrt(8), 0.25);
    }
    for (int t = 1; t < 3; t++) assert_near(problem_mu(&p)[t], problem_mu(&p)[0], 1e-3);
    assert_true(problem_mu(&p)[3] < problem_mu(&p)[0]);
    problem_free(&p);
}

/* ---- precision and work shape ---------------------------------------------------------------- */

static void single_precision_is_usable(void **state)
{
    (void)state;
    bench b;
    size_t n;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    o.single_precision = 1;
    bench_open(&b, &o);
    double *mu = read_numbers(large_mu, &n);
    problem p = problem_file(&b, large);
    assert_int_equal(n, problem_triangles(&p));
    problem_solve(&p);
    assert_false(p.stats.double_precision);
    double error = problem_l1(&p, mu);
    print_message("# single precision: L1 %.2e, cost %+.2e, gap %.2e\n", error,
                  p.stats.cost_upper / 32.958367411652105 - 1, p.stats.gap);
    if (!(error <= 0.02)) fail_msg("L1 error %g", error);
    assert_near(p.stats.cost_upper, 32.958367411652105, 1e-4);
    problem_free(&p);
    bench_close(&b);
    free(mu);
}

static void gpu_shape_gives_the_same(void **state)
{
    bench b;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    o.shape = DMK_SHAPE_GPU;
    bench_open(&b, &o);
    for (int method = DMK_NEWTON; method <= DMK_INERTIAL; method++) {
        problem p = problem_file(*state, large), q = problem_file(&b, large);
        p.options.method = q.options.method = (dmk_method)method;
        problem_solve(&p);
        problem_solve(&q);
        assert_true(p.stats.double_precision);
        assert_int_equal(q.stats.steps, p.stats.steps);
        assert_near(q.stats.cost_upper, p.stats.cost_upper, 1e-6);
        assert_near(q.stats.cost_lower, p.stats.cost_lower, 1e-5);
        assert_true(problem_l1(&q, problem_mu(&p)) < 1e-4);
        problem_free(&p);
        problem_free(&q);
    }
    bench_close(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbering_does_not_matter),
        cmocka_unit_test(lengths_scale),
        cmocka_unit_test(two_runs_give_the_same_bits),
        cmocka_unit_test(a_used_solver_equals_a_fresh_one),
        cmocka_unit_test(its_device_may_come_later),
        cmocka_unit_test(after_an_early_end_the_next_solve_is_right),
        cmocka_unit_test(gap_tolerance_ends_explicit_steps),
        cmocka_unit_test(bad_options_are_refused),
        cmocka_unit_test(threshold_marks_the_approximate_locus),
        cmocka_unit_test(border_is_solved),
        cmocka_unit_test(components_are_solved_apart),
        cmocka_unit_test(tetrahedron_is_solved),
        cmocka_unit_test(single_precision_is_usable),
        cmocka_unit_test(gpu_shape_gives_the_same),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
