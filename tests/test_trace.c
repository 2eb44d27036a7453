/* Paths back to the sources from within: how many windows a search keeps, and what repairs leave. */
/* For their static functions; the library's own are then left out. */
#include "../src/geodesic/mend.c"
#include "../src/geodesic/search.c"

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Some four million windows are kept: three million and one are, of six million no more. Fails when the constant
 * is doubled or halved. */
static void windows_are_limited(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    static const size_t n[2] = {3 << 20, 6 << 20};
    for (int i = 0; i < 2; i++) {
        dmk_tracer *t = NULL;
        sight w = {.hi = 1, .x = 0.5, .y = -1};
        assert_int_equal(dmk_tracer_create(*state, g, &t), DMK_OK);
        if (!t) return; /* for the analyser, to which the assertion goes on */
        t->lost = t->bound = INFINITY;
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        assert_int_equal(t->n_sights, 1);
        free(t->sight);
        t->sight = malloc((n[i] + 1) * sizeof *t->sight); /* only the last one is touched */
        assert_non_null(t->sight);
        t->n_sights = n[i];
        t->room = n[i] + 1;
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        assert_int_equal(t->n_sights, n[i] + (i == 0));
        assert_true(i == 0 || t->lost < INFINITY);
        dmk_tracer_destroy(&t);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* From a point beside the tip of a needle, 5e-4 radians in all, windows turned around it, six thousand times before
 * they came away. */
static void no_way_comes_back(void **state)
{
    static const double xyz[] = {0, 0, 1, 1e-4, 0, 0, -5e-5, 8e-5, 0, -5e-5, -8e-5, 0};
    static const int32_t triangle[] = {1, 3, 2, 0, 1, 2, 0, 2, 3, 0, 3, 1};
    static const dmk_point to = {1, {1 - 1e-7, 7e-8, 3e-8}};
    dmk_mesh *m = NULL;
    dmk_tracer *t = NULL;
    dmk_path path;
    assert_int_equal(dmk_mesh_create(*state, 4, xyz, 4, triangle, &m), DMK_OK);
    dmk_geodesics *g = from_corner(*state, m, 0.3);
    assert_int_equal(dmk_tracer_create(*state, g, &t), DMK_OK);
    if (!t) return;
    t->most = 100;
    assert_int_equal(dmk_tracer_path(*state, t, &to, &path), DMK_OK);
    assert_true(fabs(path.length - g->distance[0] + 1e-7) < 1e-11);
    dmk_path_free(&path);
    dmk_tracer_destroy(&t);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A path is the shortest, or there is none: what there was no room for might have been it. A repair leaves such a
 * distance as it was. */
static void lost_ways_are_told(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0.2);
    dmk_tracer *t = NULL;
    dmk_path path;
    const dmk_point p = {.triangle = 1, .weight = {0.2, 0.3, 0.5}};
    assert_int_equal(dmk_tracer_create(*state, g, &t), DMK_OK);
    if (!t) return;
    assert_int_equal(dmk_tracer_path(*state, t, &p, &path), DMK_OK);
    dmk_path_free(&path);
    t->most = 0;
    assert_int_equal(dmk_tracer_path(*state, t, &p, &path), DMK_E_MESH);
    assert_non_null(
        strstr(dmk_context_message(*state), "more than 0 ways lead away from triangle 1"));
    g->tolerance = 0.01;
    g->error = calloc((size_t)m->n_vertices, sizeof *g->error);
    assert_non_null(g->error);
    g->error[3] = 0.25;
    mended one = {.vertex = 3};
    assert_int_equal(mend(*state, t, &one), DMK_OK);
    assert_true(one.distance == g->distance[3] && one.error == 0.25);
    dmk_tracer_destroy(&t);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A repaired distance may be longer than the shortest by the tolerance, and says so. */
static void repairs_end_within_the_tolerance(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    dmk_tracer *t = NULL;
    g->tolerance = 0.01;
    g->error = calloc((size_t)m->n_vertices, sizeof *g->error);
    assert_non_null(g->error);
    assert_int_equal(dmk_tracer_create(*state, g, &t), DMK_OK);
    if (!t) return;
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double exact = g->distance[v];
        mended one = {.vertex = v};
        if (dmk_is_source(g, v)) continue;
        g->error[v] = exact;
        assert_int_equal(mend(*state, t, &one), DMK_OK);
        assert_true(one.distance >= exact * (1 - 1e-14) && one.distance <= 1.01 * exact);
        assert_true(fabs(one.error - 0.01 * exact) < 1e-14);
        g->error[v] = 0;
    }
    for (int i = 0; i < 2; i++) {
        sight w = {.hi = 1, .x = 0.5, .y = -1};
        t->n_sights = 0;
        t->bound = INFINITY;
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        t->n_sights = 0;
        t->slack = 0.1;
        t->bound = w.least + (i == 0 ? 0.09 : 0.11);
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        assert_int_equal(t->n_sights, i);
    }
    dmk_tracer_destroy(&t);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* What is left of the old estimate, 10 +- 1, and of lo..hi: where both hold, or the new one if they exclude each
 * other; the old one stays where nothing is won. */
static void estimates_narrow(void **state)
{
    (void)state;
    double distance[1] = {10}, error[1] = {1};
    const dmk_geodesics g = {.distance = distance, .error = error};
    static const struct {
        double lo, length, hi, distance, error;
    } row[] = {{9.75, 10, 10.5, 10, 0.5},         {9.75, 10, 99, 10, 1},
               {10.5, 10.625, 99, 10.625, 0.375}, {9, 10.75, 10.75, 10, 1},
               {-99, 9, 9.25, 9, 0.25},           {10.75, 10.5, 99, 10.75, 0.25},
               {11.5, 11.75, 13.75, 11.75, 2},    {-1, 8.5, 8.75, 8.5, 9.5}};
    for (size_t i = 0; i < sizeof row / sizeof *row; i++) {
        mended m = {.vertex = 0};
        narrow(&g, &m, row[i].lo, row[i].length, row[i].hi);
        if (m.distance != row[i].distance || m.error != row[i].error)
            fail_msg("row %zu: %g, %g", i, m.distance, m.error);
    }
}

/* A corridor up and down, whose corners the shortest path follows. */
static dmk_mesh *make_corridor(dmk_context *ctx)
{
    enum { N = 12 };
    dmk_mesh *m;
    double xyz[6 * N] = {0};
    int32_t triangle[6 * (N - 1)];
    for (int i = 0; i < 2 * N; i++) xyz[3 * i] = i / 2, xyz[3 * i + 1] = i / 2 % 2 + 0.2 * (i % 2);
    for (int32_t i = 0; i < N - 1; i++) {
        const int32_t two[6] = {2 * i, 2 * i + 2, 2 * i + 3, 2 * i, 2 * i + 3, 2 * i + 1};
        memcpy(triangle + 6 * i, two, sizeof two);
    }
    assert_int_equal(dmk_mesh_create(ctx, (size_t)2 * N, xyz, (size_t)2 * (N - 1), triangle, &m),
                     DMK_OK);
    return m;
}

/* Where paths end at vertices whose distances are repaired, too, these are so first: all estimates are below twice
 * the tolerance then, and no error is above its estimate. */
static void repairs_follow_each_other(void **state)
{
    bool few;
    dmk_mesh *m = make_corridor(*state);
    dmk_geodesics *g = from_corner(*state, m, 0), *exact = from_corner(*state, m, 0);
    g->tolerance = 1e-4;
    g->error = calloc((size_t)m->n_vertices, sizeof *g->error);
    assert_non_null(g->error);
    for (int32_t v = 1; v < m->n_vertices; v++) {
        g->error[v] = 10 * g->tolerance * g->distance[v];
        g->distance[v] += (v % 3 - 1) * 0.5 * g->error[v];
    }
    assert_int_equal(dmk_tracer_repair(*state, g, &few), DMK_OK);
    assert_true(few);
    for (int32_t v = 1; v < m->n_vertices; v++) {
        assert_true(g->error[v] <= 2 * g->tolerance * g->distance[v]);
        assert_true(fabs(g->distance[v] - exact->distance[v]) <= g->error[v] + 1e-11);
    }
    dmk_geodesics_destroy(&exact);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(windows_are_limited), cmocka_unit_test(no_way_comes_back),
        cmocka_unit_test(lost_ways_are_told),  cmocka_unit_test(repairs_end_within_the_tolerance),
        cmocka_unit_test(estimates_narrow),    cmocka_unit_test(repairs_follow_each_other),
    };
    return cmocka_run_group_tests_name("trace", tests, context_setup, context_teardown);
}
