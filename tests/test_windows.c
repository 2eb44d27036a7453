/* The constants of the geodesic engines: each case fails when its constant is doubled or halved. */
#include "context.h"
#include "geodesic/front.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const double pi = 3.14159265358979323846;

/* ---- meshes ---------------------------------------------------------------------------------- */

static double noise(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state / 4294967296.0 - 0.5;
}

/* A grid of n x m vertices, closed both ways; where they lie is set by the caller. */
static dmk_mesh *make(dmk_context *ctx, int32_t n, int32_t m,
                      void (*place)(double, double, double[3]), double jitter)
{
    dmk_mesh *mesh;
    uint32_t state = 7;
    double *xyz = calloc(3 * (size_t)n * (size_t)m, sizeof *xyz);
    int32_t *triangle = calloc(6 * (size_t)n * (size_t)m, sizeof *triangle), *t = triangle;
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j < m; j++) {
            const int32_t up = (i + 1) % n * m, next = (j + 1) % m;
            const int32_t two[6] = {i * m + j, up + j,    up + next,
                                    i * m + j, up + next, i * m + next};
            memcpy(t, two, sizeof two);
            t += 6;
            place((i + jitter * noise(&state)) / n, (j + jitter * noise(&state)) / m,
                  xyz + 3 * (i * m + j));
        }
    }
    const int rc = dmk_mesh_create(ctx, (size_t)n * (size_t)m, xyz, 2 * (size_t)n * (size_t)m,
                                   triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(triangle);
    return mesh;
}

static void on_torus(double a, double b, double x[3])
{
    const double r = 2 + cos(2 * pi * b);
    x[0] = r * cos(2 * pi * a), x[1] = r * sin(2 * pi * a), x[2] = sin(2 * pi * b);
}

static dmk_geodesics *run(dmk_context *ctx, const dmk_mesh *m, double tolerance)
{
    dmk_geodesics *g;
    dmk_geodesics_options options;
    const dmk_point source = {4321, {0.2, 0.3, 0.5}};
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = tolerance;
    const int rc = dmk_geodesics_create(ctx, m, 1, &source, &options, &g);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    return g;
}

/* ---- merged windows ---------------------------------------------------------------------------- */

/* The number of windows, within a hundredth. */
static void check_count(dmk_context *ctx, const dmk_mesh *m, double tolerance, double windows)
{
    dmk_geodesics *g = run(ctx, m, tolerance);
    if (fabs((double)g->n_windows - windows) > 0.01 * windows)
        fail_msg("%lld windows for %g", (long long)g->n_windows, windows);
    dmk_geodesics_destroy(&g);
}

/* With a small tolerance the change of the slopes counts, with a large one the jumps at gaps and the least curvature:
 * doubled or halved, they change the counts by 1.5 to 12 %. */
static void merging(void **state)
{
    dmk_mesh *m = make(*state, 160, 80, on_torus, 0.4);
    check_count(*state, m, 1e-6, 415506);
    check_count(*state, m, 1e-4, 93875);
    dmk_mesh_destroy(&m);
}

/* Exact up to 300,000 triangles, with a tolerance of 1e-6 beyond. */
static void line_between_engines(void **state)
{
    static const int32_t n[2] = {546, 548};
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m = make(*state, n[i], 274, on_torus, 0.4);
        dmk_geodesics *g = run(*state, m, 0);
        assert_true(g->tolerance == (i == 0 ? 0 : 1e-6));
        assert_true((g->error != NULL) == (i == 1));
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* ---- rounding ---------------------------------------------------------------------------------- */

/* Two triangles, a square of side 1 with the source at corner 0 of the first. */
static dmk_mesh *make_square(dmk_context *ctx, double last)
{
    dmk_mesh *m;
    const double xyz[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, last, 0};
    const int32_t triangle[6] = {0, 1, 2, 0, 2, 3};
    assert_int_equal(dmk_mesh_create(ctx, 4, xyz, 2, triangle, &m), DMK_OK);
    return m;
}

static dmk_geodesics *from_corner(dmk_context *ctx, const dmk_mesh *m, double weight)
{
    dmk_geodesics *g;
    const dmk_point p = {0, {1 - 2 * weight, weight, weight}};
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, NULL, &g), DMK_OK);
    return g;
}

/* A source within 1e-12 of a vertex lies there. */
static void source_at_a_vertex(void **state)
{
    dmk_mesh *m = make_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0.7e-12), *off = from_corner(*state, m, 1.4e-12);
    assert_true(g->source->vertex == 0 && off->source->vertex == -1);
    dmk_geodesics_destroy(&g);
    dmk_geodesics_destroy(&off);
    dmk_mesh_destroy(&m);
}

/* Distances at the ends of an edge may differ by its length and 1e-11 of the largest distance. */
static void slack_of_the_check(void **state)
{
    dmk_mesh *m = make_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    g->distance[1] = 1 + 0.7e-11 * sqrt(2);
    assert_int_equal(dmk_geodesics_check(*state, g), DMK_OK);
    g->distance[1] = 1 + 1.4e-11 * sqrt(2);
    assert_int_equal(dmk_geodesics_check(*state, g), DMK_E_MESH);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Edges within 1e-9 of a range of directions are in it; a beam is 1e-9 wider, unless it is narrower than 1e-12. */
static void rays_of_a_sector(void **state)
{
    dmk_mesh *m = make_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    dmk_front front;
    dmk_end end;
    dmk_beam beam;
    assert_int_equal(dmk_front_create(*state, g, &front), DMK_OK);
    const dmk_sector s = dmk_front_corner(&front, 4); /* at vertex 2, towards the diagonal */
    assert_true(dmk_front_end(&front, &s, false, s.angle + 0.7e-9, 9, &end));
    assert_false(dmk_front_end(&front, &s, false, s.angle + 1.4e-9, 9, &end));
    dmk_sector c = dmk_front_corner(&front, 1);
    assert_int_equal(front.facet[0].twin[1], 5); /* the diagonal, seen from vertex 1 */
    const double middle = c.angle + c.span / 2;
    assert_true(dmk_front_beam(&front, &c, middle, middle + 1.4e-12, &beam));
    const double width = beam.hi - beam.lo, length = front.facet[0].length[1];
    assert_true(width > 1.4e-9 * length && width < 2.8e-9 * length);
    assert_false(dmk_front_beam(&front, &c, middle, middle + 0.7e-12, &beam));
    dmk_front_free(&front);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* At a border vertices count as pseudo-sources from 1e-6 below pi on. */
static void straight_border(void **state)
{
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m;
        dmk_front front;
        const double xyz[12] = {-1, 0, 0, 0, i == 0 ? -0.35e-6 : -0.7e-6, 0, 1, 0, 0, 0, 1, 0};
        const int32_t triangle[6] = {0, 1, 3, 1, 2, 3};
        assert_int_equal(dmk_mesh_create(*state, 4, xyz, 2, triangle, &m), DMK_OK);
        dmk_geodesics *g = from_corner(*state, m, 0.3);
        assert_int_equal(dmk_front_create(*state, g, &front), DMK_OK);
        assert_true(front.pseudo_source[1] == (i == 0));
        dmk_front_free(&front);
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

static int setup(void **state)
{
    if (context_setup(state) != 0) return -1;
    dmk_context_set_threads(*state, 1);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(merging),
        cmocka_unit_test(line_between_engines),
        cmocka_unit_test(source_at_a_vertex),
        cmocka_unit_test(slack_of_the_check),
        cmocka_unit_test(rays_of_a_sector),
        cmocka_unit_test(straight_border),
    };
    return cmocka_run_group_tests(tests, setup, context_teardown);
}
