/* What is said of a triangle that the cut cannot split, and of a cut that is no disk. */
#include "../src/api/api.c" /* for their static functions; the library's own are then left out */
#include "../src/cut/cut.c"

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Of the split triangles the flattest counts, and the triangle of the mesh that it is a part of is named, by the number
 * that it had before the mesh was ordered. */
static void the_thinnest_triangle_is_named(void **state)
{
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0.5, 1e-3, 0};
    static const int32_t split[] = {0, 1, 2, 1, 3, 2, 0, 1, 4, 4, 3, 2},
                         kin[] = {0, 1, 2, 3, 4, 5, 24, 25, 26, 9, 10, 11};
    int32_t of_mesh[27];
    for (int32_t i = 0; i < 27; i++) of_mesh[i] = 100 + i;
    const dmk_mesh mesh = {.n_triangles = 9, .triangle = of_mesh};
    const dmk_geodesics geodesics = {.mesh = &mesh};
    const splitter k = {.geodesics = &geodesics,
                        .xyz = (double *)xyz,
                        .triangle = (int32_t *)split,
                        .kin = (int32_t *)kin,
                        .n_vertices = 5,
                        .n_triangles = 4};
    assert_int_equal(refuse_thin(*state, &k), DMK_E_MESH);
    const char *said = dmk_context_message(*state);
    if (!strstr(said, "triangle 8 (vertices 124 125 126) ")) fail_msg("%s", said);
    int32_t triangle_old[9], vertex_old[127];
    for (int32_t i = 0; i < 9; i++) triangle_old[i] = 1000 + i;
    for (int32_t i = 0; i < 127; i++) vertex_old[i] = 2000 + i;
    const dmk_order order = {.triangle_old = triangle_old, .vertex_old = vertex_old};
    splitter sorted = k;
    sorted.order = &order;
    assert_int_equal(refuse_thin(*state, &sorted), DMK_E_MESH);
    said = dmk_context_message(*state);
    if (!strstr(said, "triangle 1008 (vertices 2124 2125 2126) ")) fail_msg("%s", said);
}

/* Not disks: a tetrahedron, a ring of six triangles, two triangles apart. */
static void only_disks_are_cuts(void **state)
{
    static const double xyz[] = {0, 0,   0,   3, 0,   0,   0, 3, 0, 0.5, 0.5,
                                 0, 1.5, 0.5, 0, 0.5, 1.5, 0, 0, 0, 2};
    static const struct {
        size_t n;
        int32_t triangle[18];
        const char *said; /* NULL: a disk */
    } cases[] = {
        {1, {0, 1, 2}, NULL},
        {4, {0, 1, 2, 0, 6, 1, 1, 6, 2, 2, 6, 0}, "Euler characteristic 2, 0 border loops, 1 comp"},
        {6,
         {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4, 2, 0, 3, 2, 3, 5},
         "Euler characteristic 0, 2 border loops, 1 comp"},
        {2, {0, 1, 2, 3, 4, 5}, "Euler characteristic 2, 2 border loops, 2 comp"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        dmk_mesh *m;
        assert_int_equal(dmk_mesh_create(*state, 7, xyz, cases[i].n, cases[i].triangle, &m),
                         DMK_OK);
        assert_int_equal(check_disk(*state, m), cases[i].said ? DMK_E_MESH : DMK_OK);
        if (cases[i].said) assert_non_null(strstr(dmk_context_message(*state), cases[i].said));
        dmk_mesh_destroy(&m);
    }
}

/* Two edges at the vertex below an octahedron's source, the only one so far away, that lead away from each other. */
static void a_slit_is_at_the_farthest_vertex(void **state)
{
    static const double xyz[] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1.5};
    static const int32_t triangle[] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                       2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    const dmk_point top = {0, {0, 0, 1}};
    dmk_mesh *m;
    dmk_geodesics *g;
    uint8_t side[24] = {0};
    int n = 0, ends = 0;
    assert_int_equal(dmk_mesh_create(*state, 6, xyz, 8, triangle, &m), DMK_OK);
    assert_int_equal(dmk_geodesics_create(*state, m, 1, &top, NULL, &g), DMK_OK);
    splitter k = {.geodesics = g, .side = side};
    slit(&k);
    for (int32_t c = 0; c < 24; c++) {
        if (!side[c]) continue;
        const int32_t a = triangle[dmk_next(c)], b = triangle[dmk_previous(c)];
        n++;
        assert_true((a == 5) != (b == 5));
        ends |= 1 << (a == 5 ? b : a);
    }
    assert_int_equal(n, 4); /* both sides of two edges */
    assert_true(ends == (1 << 0 | 1 << 1) || ends == (1 << 2 | 1 << 3));
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_thinnest_triangle_is_named),
                                       cmocka_unit_test(only_disks_are_cuts),
                                       cmocka_unit_test(a_slit_is_at_the_farthest_vertex)};
    return cmocka_run_group_tests_name("cut", tests, context_setup, context_teardown);
}
