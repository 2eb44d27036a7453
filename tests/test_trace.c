/* Paths back to the sources from within: how many windows a search keeps. */
#include "../src/geodesic/trace.c" /* for its static functions; the library's own are then left out */

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Beyond some four million windows the ways found so far have to do: three million and one are kept, of six million
 * no more. Fails when the constant is doubled or halved. */
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
        t->bound = INFINITY;
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        assert_int_equal(t->n_sights, 1);
        free(t->sight);
        t->sight = malloc((n[i] + 1) * sizeof *t->sight); /* only the last one is touched */
        assert_non_null(t->sight);
        t->n_sights = n[i];
        t->room = n[i] + 1;
        assert_int_equal(keep(*state, t, &w, &(behind){.vertex = -1}), DMK_OK);
        assert_int_equal(t->n_sights, n[i] + (i == 0));
        dmk_tracer_destroy(&t);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(windows_are_limited)};
    return cmocka_run_group_tests_name("trace", tests, context_setup, context_teardown);
}
