/* What is said of a triangle that the cut cannot split. */
#include "../src/locus/cut.c" /* for its static functions; the library's own are then left out */

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Of the split triangles the flattest counts, and the triangle of the mesh that it is a part of is named. */
static void the_thinnest_triangle_is_named(void **state)
{
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0.5, 1e-3, 0};
    static const int32_t split[] = {0, 1, 2, 1, 3, 2, 0, 1, 4, 4, 3, 2},
                         kin[] = {0, 1, 2, 3, 4, 5, 24, 25, 26, 9, 10, 11};
    int32_t of_mesh[27];
    for (int32_t i = 0; i < 27; i++) of_mesh[i] = 100 + i;
    const dmk_mesh mesh = {.n_triangles = 9, .triangle = of_mesh};
    const dmk_geodesics geodesics = {.mesh = &mesh};
    const dmk_cotree cotree = {.geodesics = &geodesics};
    const splitter k = {.cotree = &cotree,
                        .xyz = (double *)xyz,
                        .triangle = (int32_t *)split,
                        .kin = (int32_t *)kin,
                        .n_vertices = 5,
                        .n_triangles = 4};
    assert_int_equal(refuse_thin(*state, &k), DMK_E_MESH);
    const char *said = dmk_context_message(*state);
    if (!strstr(said, "triangle 8 (vertices 124 125 126) ")) fail_msg("%s", said);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_thinnest_triangle_is_named)};
    return cmocka_run_group_tests_name("cut", tests, context_setup, context_teardown);
}
