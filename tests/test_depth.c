/* Exact windows from within: what counts as equally long, and as the same place. Each case fails when its constant is
 * doubled or halved. */
#include "context.h"
#include "../src/geodesic/window.c" /* for their static functions; the library's own are then left out */
#include "../src/geodesic/lanes.c"
#include "../src/geodesic/step.c"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* A way over a vertex counts as shorter, and a path around the end of an interval as no longer, by 1e-12. */
static void same_length(void **state)
{
    (void)state;
    const window w = {.lo = 0, .hi = 1, .x = 0.5, .y = -1, .base = 2};
    const double q = hypot(0.5, 1),
                 most = w.base + q - 1; /* of an end's distance, the edge's length added */
    assert_false(beats(w.base + q - 1 - 0.7e-12, 1, w.base, q * q));
    assert_true(beats(w.base + q - 1 - 1.4e-12, 1, w.base, q * q));
    assert_false(late(&w, 1, most - 0.7e-12, 9));
    assert_true(late(&w, 1, most - 1.4e-12, 9));
    assert_false(late(&w, 1, 9, most - 0.7e-12));
    assert_true(late(&w, 1, 9, most - 1.4e-12));
}

/* A ray to the vertex above that passes the interval by 1e-11 of its edge is in it. */
static void same_place(void **state)
{
    static const double off[2] = {0.7e-11, 1.4e-11};
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    for (int i = 0; i < 2; i++) {
        engine e;
        window o[2];
        int n;
        worker me = {.ctx = *state, .e = &e};
        assert_int_equal(engine_create(*state, g, &e), DMK_OK);
        /* Half-edge 0 runs from vertex 1 to 2, vertex 0 above it; from below, (1/2, -1), the ray to it crosses at a
         * place that is found as the engine does. */
        const dmk_facet *f = e.front.facet;
        const double length = f->length[0], cx = f->length[2] * f->cosine[1],
                     cy = f->length[2] * f->sine[1], x = 0.5 * length, y = -length;
        const double at = x - (cx - x) * y / (cy - y);
        const window w = {at + off[i] * length, length, x, y, 0, 0, 0, ~0};
        assert_int_equal(dmk_windows_step(&me, &w, o, &n), DMK_OK);
        assert_int_equal(e.trace[0].half, 0);
        assert_true(isnan(e.trace[0].at) == (i == 1)); /* else around the end */
        worker_free(&me);
        engine_free(&e);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A ray that passes the interval by 1e-6 of its edge goes around its end. The edge is short, so that the path is no
 * longer for it; its end is at 0 or at the edge's length. */
static void beside(void **state)
{
    static const double off[2] = {0.7e-6, 1.4e-6};
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    for (int i = 0; i < 4; i++) {
        engine e;
        window o[2];
        lanes lane = {0};
        int n;
        worker me = {.ctx = *state, .e = &e};
        assert_int_equal(engine_create(*state, g, &e), DMK_OK);
        assert_int_equal(dmk_lanes_create(*state, &e), DMK_OK);
        dmk_facet *f = e.front.facet;
        for (int k = 0; k < 3; k++) f->length[k] *= 1e-3;
        const double length = f->length[0], cx = f->length[2] * f->cosine[1],
                     cy = f->length[2] * f->sine[1], x = 0.5 * length, y = -length;
        const double at = x - (cx - x) * y / (cy - y), away = off[i % 2] * length;
        const window w = {i < 2 ? at + away : 0, i < 2 ? length : at - away, x, y, 0, 0, 0, ~0};
        assert_true(put(&e, &lane, 0, &w) == (i % 2 == 1)); /* nearer, and its step is not plain */
        assert_int_equal(dmk_windows_step(&me, &w, o, &n), DMK_OK);
        assert_int_equal(e.trace[0].half, i % 2 == 0 ? 0 : UNREACHED);
        worker_free(&me);
        engine_free(&e);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* All distances and ways, with the loop of any processor or with this one's. */
static void run_down(dmk_context *ctx, dmk_geodesics *g, bool plain, engine *e)
{
    bool any = true;
    worker me = {.ctx = ctx, .e = e};
    assert_int_equal(engine_create(ctx, g, e), DMK_OK);
    assert_int_equal(dmk_lanes_create(ctx, e), DMK_OK);
    if (plain) e->advance = advance;
    assert_int_equal(bound(ctx, e), DMK_OK);
    assert_int_equal(radiate_source(&me, 0), DMK_OK);
    while (any) {
        assert_int_equal(run_all(&me), DMK_OK);
        assert_int_equal(radiate_next(&me, &any), DMK_OK);
    }
    worker_free(&me);
}

/* Whatever the width of the processor's vectors, the bits are the same. */
static void forms_of_the_loop(void **state)
{
    dmk_mesh *m;
    dmk_surface_options surface;
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "torus";
    surface.n_triangles = 4000;
    assert_int_equal(dmk_mesh_surface(*state, &surface, &m), DMK_OK);
    dmk_geodesics *g[2] = {from_corner(*state, m, 0), from_corner(*state, m, 0)};
    engine e[2];
    for (int i = 0; i < 2; i++) run_down(*state, g[i], i == 0, e + i);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const trace *a = e[0].trace + v, *b = e[1].trace + v;
        assert_true(g[0]->distance[v] == g[1]->distance[v]);
        assert_true(a->x == b->x && a->y == b->y && a->turn == b->turn && a->half == b->half);
    }
    for (int i = 0; i < 2; i++) {
        engine_free(e + i);
        dmk_geodesics_destroy(g + i);
    }
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_length), cmocka_unit_test(same_place),
                                       cmocka_unit_test(beside),
                                       cmocka_unit_test(forms_of_the_loop)};
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
