/* Exact distances on shapes that windows do not like: thin tubes, needles, stretched spheres, hubs. They take about
 * as many windows as other meshes of their size, or the test would not end. */
#include "context.h"
#include "geodesic/geodesic.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const double pi = 3.14159265358979323846;

/* ---- meshes ---------------------------------------------------------------------------------- */

/* n_rings rings of n vertices each, joined to the next, and the last to the first if `closed`. */
typedef struct rings {
    int32_t n, n_rings, n_triangles;
    double *xyz;
    int32_t *triangle; /* room for two caps, too */
} rings;

static rings make_rings(int32_t n, int32_t n_rings, bool closed)
{
    rings r = {n, n_rings, 0, calloc(3 * ((size_t)n * (size_t)n_rings + 2), sizeof(double)),
               calloc(6 * (size_t)n * (size_t)(n_rings + 1), sizeof(int32_t))};
    assert_true(r.xyz && r.triangle);
    for (int32_t j = 0; j < (closed ? n_rings : n_rings - 1); j++) {
        for (int32_t i = 0; i < n; i++) {
            const int32_t a = j * n + i, b = j * n + (i + 1) % n, up = (j + 1) % n_rings * n;
            const int32_t two[6] = {a, b, up + (i + 1) % n, a, up + (i + 1) % n, up + i};
            memcpy(r.triangle + 3 * r.n_triangles, two, sizeof two);
            r.n_triangles += 2;
        }
    }
    return r;
}

/* Triangles from the ring that begins with vertex `first` to vertex `tip`, above it or below. */
static void add_cap(rings *r, int32_t first, int32_t tip, bool above)
{
    for (int32_t i = 0; i < r->n; i++) {
        int32_t *t = r->triangle + 3 * r->n_triangles++;
        t[0] = tip, t[1 + above] = first + (i + 1) % r->n, t[2 - above] = first + i;
    }
}

static dmk_mesh *finish(dmk_context *ctx, rings *r, int32_t n_vertices)
{
    dmk_mesh *m;
    const int rc =
        dmk_mesh_create(ctx, (size_t)n_vertices, r->xyz, (size_t)r->n_triangles, r->triangle, &m);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(r->xyz);
    free(r->triangle);
    return m;
}

static void set(rings *r, int32_t v, double x, double y, double z)
{
    r->xyz[3 * v] = x, r->xyz[3 * v + 1] = y, r->xyz[3 * v + 2] = z;
}

/* Not more than `most` windows for each edge. */
static dmk_geodesics *run(dmk_context *ctx, const dmk_mesh *m, int32_t from, double most)
{
    dmk_geodesics *g;
    dmk_point p;
    dmk_geodesics_info info;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, (size_t)from, &p), DMK_OK);
    const int rc = dmk_geodesics_create(ctx, m, 1, &p, NULL, &g);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    dmk_geodesics_get_info(g, &info);
    if ((double)info.n_windows > most * m->n_edges)
        fail_msg("%zu windows on %d edges", info.n_windows, m->n_edges);
    return g;
}

/* From each of a few vertices to the others and back. */
static void check_both_ways(dmk_context *ctx, const dmk_mesh *m, const int32_t vertex[3],
                            double most)
{
    double far = 0;
    dmk_geodesics *g[3];
    for (int i = 0; i < 3; i++) {
        g[i] = run(ctx, m, vertex[i], most);
        for (int32_t v = 0; v < m->n_vertices; v++) far = fmax(far, g[i]->distance[v]);
    }
    for (int i = 0; i < 3; i++) {
        const double there = g[i]->distance[vertex[(i + 1) % 3]],
                     back = g[(i + 1) % 3]->distance[vertex[i]];
        if (fabs(there - back) > 1e-11 * far)
            fail_msg("from %d: %.17g, back %.17g", vertex[i], there, back);
    }
    for (int i = 0; i < 3; i++) dmk_geodesics_destroy(g + i);
}

/* ---- tests ----------------------------------------------------------------------------------- */

/* 1 : 10,000. Unrolled it is a strip, on which the nearest of the source's copies counts. */
static void thin_tube(void **state)
{
    enum { n = 12, n_rings = 5001 };
    dmk_context *ctx = *state;
    const double step = 2, side = 2 * sin(pi / n);
    rings r = make_rings(n, n_rings, false);
    for (int32_t v = 0; v < n * n_rings; v++)
        set(&r, v, cos(2 * pi * (v % n) / n), sin(2 * pi * (v % n) / n), step * (v / n));
    dmk_mesh *m = finish(ctx, &r, n * n_rings);
    const int32_t source[2] = {5, n * (n_rings / 2) + 3};
    for (int i = 0; i < 2; i++) {
        dmk_geodesics *g = run(ctx, m, source[i], 20);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const int around = abs(v % n - source[i] % n);
            const double d = hypot(side * (around > n / 2 ? n - around : around),
                                   step * (v / n - source[i] / n));
            assert_true(fabs(g->distance[v] - d) < 1e-10 * step * n_rings);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* A sphere stretched 1 : 10,000 and flattened as much. Where trimmed windows may be off by 1e-11 exact ones go on. */
static void stretched_sphere(void **state)
{
    enum { n = 40, n_rings = 39 };
    dmk_context *ctx = *state;
    static const double height[2] = {1e4, 1e-4};
    for (int i = 0; i < 2; i++) {
        rings r = make_rings(n, n_rings, false);
        for (int32_t v = 0; v < n * n_rings; v++) {
            const double a = pi * (v / n + 1) / (n_rings + 1), b = 2 * pi * (v % n) / n;
            set(&r, v, sin(a) * cos(b), sin(a) * sin(b), -height[i] * cos(a));
        }
        set(&r, n * n_rings, 0, 0, -height[i]);
        set(&r, n * n_rings + 1, 0, 0, height[i]);
        add_cap(&r, 0, n * n_rings, false);
        add_cap(&r, n * (n_rings - 1), n * n_rings + 1, true);
        dmk_mesh *m = finish(ctx, &r, n * n_rings + 2);
        check_both_ways(ctx, m, (const int32_t[3]){n * n_rings, n * 20 + 3, 7}, 1000);
        dmk_mesh_destroy(&m);
    }
}

/* A torus with one vertex pulled out to a needle of 1 : 100,000,000: windows wind around it. */
static void needle(void **state)
{
    enum { n = 6, n_rings = 9, pulled = 25 };
    dmk_context *ctx = *state;
    rings r = make_rings(n, n_rings, true);
    for (int32_t v = 0; v < n * n_rings; v++) {
        const double a = 2 * pi * (v / n) / n_rings, b = 2 * pi * (v % n) / n;
        set(&r, v, 1e-8 * (2 + cos(b)) * cos(a), 1e-8 * (2 + cos(b)) * sin(a), -1e-8 * sin(b));
    }
    r.xyz[3 * pulled] += 1;
    dmk_mesh *m = finish(ctx, &r, n * n_rings);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        dmk_geodesics *g = run(ctx, m, v, 1000);
        const double tip = g->distance[pulled];
        if (v != pulled && !(fabs(tip - 1) < 1e-7)) fail_msg("from %d to the tip: %g", v, tip);
        dmk_geodesics_destroy(&g);
    }
    check_both_ways(ctx, m, (const int32_t[3]){pulled, 52, 0}, 1000);
    /* With a tolerance, too. A half-edge keeps what has run on from its 32nd visit on: 846 windows are made, and 654 or
     * 1,230 if it were the 16th or the 64th. */
    dmk_geodesics *g;
    dmk_point p;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = 1e-6;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, 3, &p), DMK_OK);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, &options, &g), DMK_OK);
    assert_in_range(g->n_windows, 740, 1000);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Noise 200,000 times as high as wide: an exact run goes on to as many windows as its triangles' aspect allows. */
static void noise(void **state)
{
    enum { n = 8 };
    dmk_context *ctx = *state;
    dmk_geodesics *g;
    dmk_point p;
    dmk_geodesics_options options;
    rings r = make_rings(n, n, false);
    uint32_t random = 2;
    int32_t *t = r.triangle;
    for (int32_t v = 0; v < n * n; v++) {
        random = random * 1664525u + 1013904223u;
        set(&r, v, v % n, v / n, 2e5 * (random / 4294967296.0));
    }
    for (int32_t i = 0; i < r.n_triangles; i++) { /* no ring is closed */
        const int32_t *a = r.triangle + 3 * i;
        if (abs(a[0] % n - a[1] % n) > 1 || abs(a[0] % n - a[2] % n) > 1) continue;
        memmove(t, a, 3 * sizeof *t);
        t += 3;
    }
    r.n_triangles = (int32_t)(t - r.triangle) / 3;
    dmk_mesh *m = finish(ctx, &r, n * n);
    dmk_geodesics_options_init(&options, sizeof options);
    options.exact = true;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, 0, &p), DMK_OK);
    if (dmk_geodesics_create(ctx, m, 1, &p, &options, &g) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    assert_null(g->error);
    assert_true(g->n_windows > 10000 * m->n_edges);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Two cones over a polygon of 10,000 sides. Unrolled, the way from one of its vertices to another is a chord. */
static void hub(void **state)
{
    enum { n = 10000, top = n, bottom = n + 1 };
    dmk_context *ctx = *state;
    const double height = 0.5, slant = hypot(1, height), slice = 2 * asin(sin(pi / n) / slant);
    rings r = make_rings(n, 1, false);
    for (int32_t v = 0; v < n; v++) set(&r, v, cos(2 * pi * v / n), sin(2 * pi * v / n), 0);
    set(&r, top, 0, 0, height);
    set(&r, bottom, 0, 0, -height);
    add_cap(&r, 0, top, true);
    add_cap(&r, 0, bottom, false);
    dmk_mesh *m = finish(ctx, &r, n + 2);
    dmk_geodesics *g = run(ctx, m, top, 100);
    for (int32_t v = 0; v < n; v++) assert_true(fabs(g->distance[v] - slant) < 1e-12);
    assert_true(fabs(g->distance[bottom] - 2 * slant * cos(slice / 2)) < 1e-12);
    dmk_geodesics_destroy(&g);
    g = run(ctx, m, 3, 100);
    for (int32_t v = 0; v < n; v++) {
        const int32_t turn = abs(v - 3), k = turn > n / 2 ? n - turn : turn;
        assert_true(fabs(g->distance[v] - 2 * slant * sin(k * slice / 2)) < 1e-10);
    }
    assert_true(fabs(g->distance[top] - slant) < 1e-12 &&
                fabs(g->distance[bottom] - slant) < 1e-12);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A sheet of 2 x 1.4 whose opposite sides are one, folded flat in four: inside it there is no curvature anywhere. */
static void flat_torus(void **state)
{
    enum { n = 14, n_rings = 20 };
    dmk_context *ctx = *state;
    const double width = 1.4, height = 2;
    rings r = make_rings(n, n_rings, true);
    for (int32_t v = 0; v < n * n_rings; v++)
        set(&r, v, fabs(remainder(width * (v % n) / n, width)),
            fabs(remainder(height * (v / n) / n_rings, height)), 0);
    dmk_mesh *m = finish(ctx, &r, n * n_rings);
    for (int32_t from = 0; from < n * n_rings; from += 37) {
        dmk_geodesics *g = run(ctx, m, from, 100);
        for (int32_t v = 0; v < n * n_rings; v++) {
            const double x = remainder(width * (v % n - from % n) / n, width);
            const double y = remainder(height * (v / n - from / n) / n_rings, height);
            assert_true(fabs(g->distance[v] - hypot(x, y)) < 1e-12);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(thin_tube), cmocka_unit_test(stretched_sphere),
        cmocka_unit_test(needle),    cmocka_unit_test(noise),
        cmocka_unit_test(hub),       cmocka_unit_test(flat_torus),
    };
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
