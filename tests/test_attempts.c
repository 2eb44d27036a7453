/* Tubes of needles, on which Newton's usual steps come to no end: others do that are solved better. */
#include "solving.h"

#include <math.h>
#include <stdlib.h>
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
    } of[] = {{3, 3, 0.01}, {3, 5, 0.01}, {6, 5, 0.01}, {64, 5, 200}, {256, 2, 50}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++) {
        problem p = tube(*state, of[i].n, of[i].n_rings, of[i].length);
        problem_solve(&p);
        assert_true(p.stats.steps > USUAL);
        assert_true(p.stats.gap < 1e-3);
        problem_free(&p);
    }
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(solved_better_steps_end),
                                       cmocka_unit_test(a_settled_cost_is_enough),
                                       cmocka_unit_test(limits_hold)};
    return cmocka_run_group_tests_name("attempts", tests, bench_setup, bench_teardown);
}
