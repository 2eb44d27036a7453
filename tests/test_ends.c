/* A branch around its end: the crossings that are looked at, and the triangle that it is led to. */
#include "../src/locus/ends.c" /* for its static functions; the library's own are then left out */

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

enum { N = 2 * MAX_ROUTE + 40 };

/* A line of N crossings, 1 apart: crossing i joins the nodes i and i + 1, and hands on to i + 1. */
static void make_line(dmk_cotree *t, dmk_crossing *crossing, double *strength, int32_t *on)
{
    memset(crossing, 0, N * sizeof *crossing);
    for (int32_t i = 0; i < 3 * (N + 1); i++) on[i] = -1;
    for (int32_t i = 0; i < N; i++) {
        crossing[i] = (dmk_crossing){.node = {i, i + 1},
                                     .onward = i + 1 < N ? i + 1 : -1,
                                     .worth = 5,
                                     .excess = 5,
                                     .distance = 9};
        strength[i] = 5;
        crossing[i].xyz[0] = i;
        on[3 * i] = i;
        on[3 * (i + 1) + 1] = i;
    }
    t->n = N;
    t->last = N - 1;
    t->crossing = crossing;
    t->strength_of = strength;
    t->on = on;
    t->strength = 1;
}

static void routes_have_their_room(void **state)
{
    (void)state;
    static dmk_crossing crossing[N];
    static double strength[N];
    static int32_t on[3 * (N + 1)];
    dmk_mesh mesh = {.n_triangles = N + 1};
    dmk_geodesics geodesics = {.mesh = &mesh};
    dmk_cotree t = {.geodesics = &geodesics};
    struct {
        route r;
        int32_t behind[MAX_ROUTE];
    } room;
    make_line(&t, crossing, strength, on);
    /* From the middle, without a bound: half of the room is for what lies inwards, the rest for what lies outwards. */
    find_route(&t, MAX_ROUTE + 10, MAX_ROUTE + 10, HUGE_VAL, &room.r);
    assert_int_equal(room.r.n, MAX_ROUTE);
    assert_int_equal(room.r.end, MAX_ROUTE / 2 - 1);
    for (int32_t k = 0; k < room.r.n; k++)
        assert_int_equal(room.r.crossing[k], MAX_ROUTE + 10 + MAX_ROUTE / 2 - 1 - k);
    /* Up to a reach: the first crossing that lies so far is the last one. */
    find_route(&t, 100, 100, 3, &room.r);
    assert_int_equal(room.r.end, 2);
    assert_int_equal(room.r.crossing[0], 102);
    assert_int_equal(room.r.n, 103);
}

/* Half a crossing, two and a half, and farther than the line goes. */
static void ways_lead_along_the_route(void **state)
{
    (void)state;
    static dmk_crossing crossing[N];
    static double strength[N];
    static int32_t on[3 * (N + 1)];
    dmk_cotree t = {0};
    const route r = {.n = 6, .end = 2, .crossing = {15, 14, 13, 12, 11, 10}};
    static const double way[] = {0, 0.5, 2.5, 4, HUGE_VAL}, x[] = {13, 12.5, 10.5, 10, 10};
    make_line(&t, crossing, strength, on);
    for (int i = 0; i < 5; i++) {
        double xyz[3];
        point_beyond(&t, &r, way[i], xyz);
        assert_true(fabs(xyz[0] - x[i]) < 1e-12 && xyz[1] == 0 && xyz[2] == 0);
    }
    memcpy(crossing[12].xyz, crossing[13].xyz, sizeof crossing[12].xyz); /* none apart */
    double xyz[3];
    point_beyond(&t, &r, 0, xyz);
    assert_true(xyz[0] == 13);
}

/* Behind the crossing lies a border, node n_triangles: no triangle to end in, though there is one in memory. */
static void borders_are_no_end(void **state)
{
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
    static const int32_t triangle[] = {0, 1, 2, 1, 3, 2};
    static const double area[] = {0.5, 0.5}, beyond[] = {0.7, 0.6, 0}, inside[] = {0.3, 0.2, 0};
    dmk_mesh mesh = {.n_triangles = 1,
                     .n_vertices = 4,
                     .xyz = (double *)xyz,
                     .triangle = (int32_t *)triangle,
                     .area = (double *)area};
    int32_t twin[] = {5, -1, -1, -1, -1, 0}, loop[] = {0, 0, 0, 0};
    dmk_geodesics geodesics = {.mesh = &mesh, .star = {.twin = twin}};
    dmk_crossing c = {.node = {0, 1}, .outer = 1, .onward = -1, .worth = 5, .xyz = {0.5, 0.5, 0}};
    double strength = 5;
    dmk_cotree t = {
        .geodesics = &geodesics, .crossing = &c, .strength_of = &strength, .loop = loop, .n = 1};
    const route r = {.n = 1, .end = 0, .crossing = {0}};
    assert_int_equal(lead_to(*state, &t, &r, beyond), DMK_OK);
    assert_int_equal(t.n_ends, 0);
    c.outer = 0;
    assert_int_equal(lead_to(*state, &t, &r, inside), DMK_OK);
    assert_int_equal(t.n_ends, 1);
    assert_non_null(t.end);
    assert_int_equal(t.end[0].triangle, 0);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(t.end[0].weight[k] - (const double[]){0.5, 0.3, 0.2}[k]) < 1e-15);
    free(t.end);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(routes_have_their_room),
        cmocka_unit_test(ways_lead_along_the_route),
        cmocka_unit_test(borders_are_no_end),
    };
    return cmocka_run_group_tests_name("ends", tests, context_setup, context_teardown);
}
