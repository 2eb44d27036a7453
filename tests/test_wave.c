/* Merged windows from within: what counts as rounding, and what exact runs allow. Each case fails when its constant is
 * doubled or halved. */
#include "context.h"
#include "../src/geodesic/wave.c" /* for its static functions; the library's own are then left out */

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Two triangles, a square of side 1, the source at a corner of both. */
typedef struct square {
    dmk_mesh *mesh;
    dmk_geodesics *geodesics;
    engine e;
} square;

static square begin(dmk_context *ctx, double tolerance)
{
    square s;
    const double xyz[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const int32_t triangle[6] = {0, 1, 2, 0, 2, 3};
    const dmk_point p = {0, {1, 0, 0}};
    assert_int_equal(dmk_mesh_create(ctx, 4, xyz, 2, triangle, &s.mesh), DMK_OK);
    assert_int_equal(dmk_geodesics_create(ctx, s.mesh, 1, &p, NULL, &s.geodesics), DMK_OK);
    assert_int_equal(engine_create(ctx, s.geodesics, tolerance, &s.e), DMK_OK);
    return s;
}

static void end(square *s)
{
    engine_free(&s->e);
    dmk_geodesics_destroy(&s->geodesics);
    dmk_mesh_destroy(&s->mesh);
}

/* The front around a point at (x, y) of half-edge 0's frame, on lo..hi of it. */
static wave around(double x, double y, double lo, double hi)
{
    const double o = 0.5 * (lo + hi), r = hypot(o - x, y);
    return (wave){lo, hi, o, (o - x) / r, -y / r, 1 / r, r, 0, 0, 0, 0, -1, 0, -1};
}

/* A window is of no use if a way over an end of its edge is shorter by more than 1e-9 of the edge. */
static void rounding_of_filters(void **state)
{
    static const double shorter[2] = {0.7e-9, 1.4e-9};
    for (int end_of = 0; end_of < 2; end_of++) {
        for (int i = 0; i < 2; i++) {
            angle s;
            size_t n = 0;
            square q = begin(*state, 1e-6);
            look(&q.e, 0, &s);
            const double length = s.length;
            const wave w = around(0.5 * length, -length, 0.25 * length, 0.75 * length);
            double *d = q.e.front.d;
            d[s.a] = d[s.b] = 9;
            if (end_of == 0)
                d[s.a] = value(&w, w.hi) - w.hi - shorter[i] * length;
            else
                d[s.b] = value(&w, w.lo) - (length - w.lo) - shorter[i] * length;
            assert_int_equal(store(*state, &q.e, &w, q.e.head), DMK_OK);
            assert_int_equal(gather(*state, &q.e, q.e.head, false, &s, &n), DMK_OK);
            assert_int_equal(n, i == 0);
            end(&q);
        }
    }
}

/* Two touching windows whose points lie apart by `apart` become one: how much it changes, over the distance, or -1. */
static double merged_change(const engine *e, double apart)
{
    wave one, r[2] = {around(0.5, -1 - apart, 0, 0.5), around(0.5, -1 + apart, 0.5, 1)};
    r[0].D += apart; /* equal at the middle */
    r[1].D -= apart;
    r[0].D = r[0].D - value(&r[0], 0.5) + 1, r[1].D = r[1].D - value(&r[1], 0.5) + 1;
    return merge(e, r, 2, 1, &one) ? one.error / one.D : -1;
}

/* Exact runs merge what changes by up to 1e-11 of the distance. */
static void tolerance_of_exact_runs(void **state)
{
    square q = begin(*state, 0);
    double most = 0, apart = 1e-13;
    for (int i = 0; i < 190; i++, apart *= 1.05) /* up to 1e-9 */
        most = fmax(most, merged_change(&q.e, apart));
    if (!(most > 0.8e-11 && most <= 1.0e-11)) fail_msg("merged up to %g", most);
    end(&q);
}

/* Of equally placed windows that which is kept comes first, or the same ones would run on again and again. */
static void order_of_windows(void **state)
{
    (void)state;
    wave l[40];
    for (int i = 0; i < 40; i++) {
        l[i] = around(0, -1, (i * 7 % 20) / 20., 1);
        l[i].next = i < 20 ? -1 : KEPT;
    }
    sort(l, 40);
    for (int i = 0; i < 40; i++) {
        assert_true(l[i].lo == (i / 2) / 20.);
        assert_int_equal(l[i].next, i % 2 ? -1 : KEPT);
    }
}

/* No bucket is farther than all edges in a row, whatever the offsets of sources. */
static void last_bucket(void **state)
{
    square q = begin(*state, 1e-6);
    q.e.least = 0;
    assert_int_equal(schedule(*state, &q.e, 3, 1e30), DMK_OK);
    assert_int_equal(schedule(*state, &q.e, 4, 5), DMK_OK);
    assert_int_equal(q.e.n_buckets, q.e.most_buckets + 1);
    assert_true(q.e.most_buckets * q.e.width >= 5 * q.e.front.facet[0].length[0]);
    end(&q);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rounding_of_filters),
        cmocka_unit_test(tolerance_of_exact_runs),
        cmocka_unit_test(order_of_windows),
        cmocka_unit_test(last_bucket),
    };
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
