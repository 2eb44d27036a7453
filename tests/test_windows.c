/* The geodesic engines: their waves by themselves, and their constants, each case of which fails when its constant is
 * doubled or halved. */
#include "../src/geodesic/envelope.c" /* for their static functions; the library's own are then left out */
#include "../src/geodesic/wave.c"

#include "context.h"
#include "geodesic/trace.h"
#include "surfaces/refine.h"

#include <limits.h>
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

/* An open tube of 12 sides. */
static dmk_mesh *make_tube(dmk_context *ctx, int32_t rings)
{
    enum { n = 12 };
    dmk_mesh *mesh;
    double *xyz = calloc(3 * n * (size_t)rings, sizeof *xyz);
    int32_t *triangle = calloc(6 * n * (size_t)rings, sizeof *triangle), *t = triangle;
    for (int32_t v = 0; v < n * rings; v++) {
        const double a = 2 * pi * (v % n) / n;
        memcpy(xyz + 3 * v, (const double[3]){cos(a), sin(a), 2 * (v / n)}, 3 * sizeof *xyz);
        const int32_t next = v / n * n + (v + 1) % n;
        const int32_t two[6] = {v, next, next + n, v, next + n, v + n};
        if (v < n * (rings - 1)) memcpy(t, two, sizeof two), t += 6;
    }
    const int rc =
        dmk_mesh_create(ctx, n * (size_t)rings, xyz, 2 * n * (size_t)(rings - 1), triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(triangle);
    return mesh;
}

static dmk_geodesics *from_vertex(dmk_context *ctx, const dmk_mesh *m, size_t v, double tolerance)
{
    dmk_geodesics *g;
    dmk_point source;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = tolerance;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, v, &source), DMK_OK);
    const int rc = dmk_geodesics_create(ctx, m, 1, &source, &options, &g);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    return g;
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

/* ---- waves of merged windows ------------------------------------------------------------------- */

/* From (x, -y) over lo..hi of a half-edge, seen from o. */
static wave wave_from(double x, double y, double lo, double hi, double o)
{
    const double r = hypot(o - x, y);
    return (wave){
        .lo = lo, .hi = hi, .o = o, .ux = (o - x) / r, .uy = y / r, .k = 1 / r, .D = r, .next = -1};
}

/* Distances of a point, their slopes, and of a line. */
static void waves_are_distances(void **state)
{
    (void)state;
    uint32_t random = 11;
    for (int trial = 0; trial < 1000; trial++) {
        const double x = 4 * noise(&random), y = 0.01 + 2 + 4 * noise(&random) * (trial % 2),
                     o = noise(&random), t = noise(&random), r = hypot(t - x, y);
        if (!(y > 0)) continue;
        const wave w = wave_from(x, y, 0, 1, o), line = {.o = o, .ux = 0.6, .uy = 0.8, .D = 5};
        assert_true(fabs(value(&w, t) - r) < 1e-14 * fmax(r, w.D));
        assert_true(fabs(slope(&w, t) - (t - x) / r) < 1e-14 * fmax(1, w.D / r));
        assert_true(fabs(value(&line, t) - 5 - 0.6 * (t - o)) < 1e-15 * 5);
    }
}

/* Where two of them are equally long, whichever is the shorter one at first. */
static void waves_cross(void **state)
{
    (void)state;
    const engine e = {.allow = {.error = 0}};
    uint32_t random = 3;
    int n[2] = {0, 0};
    for (int trial = 0; trial < 2000; trial++) {
        const double p[2] = {3 * noise(&random), 1.6 + 3 * noise(&random)},
                     q[2] = {3 * noise(&random), 1.6 + 3 * noise(&random)};
        /* |t - p|^2 = |t - q|^2 */
        const double at =
            0.5 * (q[0] * q[0] + q[1] * q[1] - p[0] * p[0] - p[1] * p[1]) / (q[0] - p[0]);
        const wave u = wave_from(p[0], p[1], 0, 1, 0.2), w = wave_from(q[0], q[1], 0, 1, 0.7);
        if (!(at > 0.01 && at < 0.99) || fabs(q[0] - p[0]) < 0.1) continue;
        const double t = crossing(&e, &u, &w, 0, 1, 1);
        if (fabs(t - at) > 1e-12) fail_msg("at %.17g, not %.17g", t, at);
        n[longer(&u, &w, 0) > 0]++;
    }
    assert_true(n[0] > 100 && n[1] > 100);
}

/* Of windows that overlap the shortest is kept everywhere. */
static void shortest_waves_are_kept(void **state)
{
    (void)state;
    enum { MOST = 12, SAMPLES = 500 };
    uint32_t random = 5;
    for (int trial = 0; trial < 500; trial++) {
        wave all[MOST] = {{0}}, list[MOST];
        const engine e = {.allow = {.error = 0}};
        size_t n = 0;
        double lo = 0;
        const int wanted = 2 + trial % (MOST - 1);
        for (int i = 0; i < wanted; i++, lo += 0.05 * (0.5 + noise(&random)))
            all[n++] = wave_from(2 * noise(&random), 0.6 + noise(&random), lo,
                                 fmin(1, lo + 0.6 + noise(&random)), 0.5);
        memcpy(list, all, n * sizeof *all);
        const size_t left = trim(&e, list, n, 1);
        for (int k = 0; k <= SAMPLES; k++) {
            const double t = (double)k / SAMPLES;
            double best = INFINITY, kept = INFINITY;
            for (size_t i = 0; i < n; i++)
                if (t >= all[i].lo && t <= all[i].hi) best = fmin(best, value(all + i, t));
            for (size_t i = 0; i < left; i++)
                if (t >= list[i].lo - 1e-12 && t <= list[i].hi + 1e-12)
                    kept = fmin(kept, value(list + i, t));
            if (best != kept && !(fabs(best - kept) < 1e-11))
                fail_msg("trial %d, at %g: %.17g, not %.17g", trial, t, kept, best);
        }
    }
}

/* One wave through neighbours that are parts of it is that wave; none focuses before it is 20 edges on. */
static void parts_become_whole(void **state)
{
    (void)state;
    static const double curvature[] = {0.5, 0.01, 0, -0.01, -0.049, -0.051};
    for (size_t i = 0; i < sizeof curvature / sizeof *curvature; i++) {
        wave part[3], found,
            whole = {
                .lo = 0.1, .hi = 0.9, .o = 0.5, .ux = 0.28, .uy = 0.96, .k = curvature[i], .D = 3};
        for (int j = 0; j < 3; j++) {
            part[j] = whole;
            part[j].lo = 0.1 + 0.8 * j / 3;
            part[j].hi = 0.1 + 0.8 * (j + 1) / 3;
        }
        const bool good = interpolate(part, 3, 1, &found);
        assert_true(good == (curvature[i] > -0.05));
        if (!good) continue;
        assert_true(found.lo == part[0].lo && found.hi == part[2].hi);
        for (int j = 1; j < 10; j++)
            assert_true(fabs(value(&found, 0.1 * j) - value(&whole, 0.1 * j)) < 1e-14);
        assert_true(fabs(found.k - whole.k) < 1e-13 && fabs(found.ux - whole.ux) < 1e-13);
    }
}

/* ---- merged windows ---------------------------------------------------------------------------- */

/* The number of windows, but for a share of them. */
static void check_count(dmk_context *ctx, const dmk_mesh *m, double tolerance, double windows,
                        double share)
{
    dmk_geodesics *g = run(ctx, m, tolerance);
    if (fabs((double)g->n_windows - windows) > share * windows)
        fail_msg("%lld windows for %g", (long long)g->n_windows, windows);
    dmk_geodesics_destroy(&g);
}

/* With a small tolerance the change of the slopes counts, with a large one the jumps at gaps and the least curvature:
 * doubled or halved, they change the counts by 1.5 to 12 %. */
static void merging(void **state)
{
    dmk_mesh *m = make(*state, 160, 80, on_torus, 0.4);
    check_count(*state, m, 1e-6, 403860, 0.01);
    check_count(*state, m, 1e-4, 89644, 0.01);
    dmk_mesh_destroy(&m);
}

/* The estimates of merged windows on a torus. What two of them differ in where they touch is there at every edge that
 * they cross, and counts once: else 298 vertices are over. */
static void what_windows_differ_in_counts_once(void **state)
{
    bool finished;
    dmk_geodesics *g;
    dmk_geodesics_options options;
    int n = 0;
    dmk_mesh *m = make(*state, 640, 320, on_torus, 0.4);
    const dmk_point source = {.triangle = 0, .weight = {1, 0, 0}};
    dmk_geodesics_options_init(&options, sizeof options);
    assert_int_equal(dmk_geodesics_prepare(*state, m, NULL, 1, &source, &options, &g), DMK_OK);
    assert_int_equal(dmk_waves_run(*state, g, 1e-6, 0, 1000, INT_MAX, &finished), DMK_OK);
    for (int32_t v = 0; v < m->n_vertices; v++) n += dmk_is_over(1e-6, g->error[v], g->distance[v]);
    assert_in_range(n, 0, 20);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Exact windows, on one thread: as many as the filters leave, and how often those side by side look. The least of
 * them leaves out 1.6e-3 of all. */
static void exact_windows(void **state)
{
    dmk_mesh *m = make(*state, 100, 50, on_torus, 0.4);
    check_count(*state, m, 0, 313618, 5e-4);
    dmk_mesh_destroy(&m);
}

/* Cut 1:16, merged windows leave vertices of this mesh without a path: exact ones take their place. */
static void exact_where_merged_fail(void **state)
{
    dmk_mesh *m[3];
    assert_int_equal(dmk_mesh_read(*state, "tests/data/rough.off", &m[0]), DMK_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(dmk_mesh_refine(*state, m[i], NULL, NULL, &m[i + 1]), DMK_OK);
    dmk_geodesics *merged = run(*state, m[2], 1e-2), *exact = run(*state, m[2], 0);
    assert_true(merged->tolerance == 0 && !merged->error);
    for (int32_t v = 0; v < m[2]->n_vertices; v++)
        assert_true(merged->distance[v] == exact->distance[v]);
    dmk_geodesics_destroy(&merged);
    dmk_geodesics_destroy(&exact);
    for (int i = 0; i < 3; i++) dmk_mesh_destroy(&m[i]);
}

/* Exact up to 450,000 triangles, with a tolerance of 1e-6 beyond. */
static void line_between_engines(void **state)
{
    static const int32_t n[2] = {820, 822};
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m = make(*state, n[i], 274, on_torus, 0.4);
        dmk_geodesics *g = run(*state, m, 0);
        assert_true(g->tolerance == (i == 0 ? 0 : 1e-6));
        assert_true((g->error != NULL) == (i == 1));
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Buckets half as wide or twice as wide change these by 8 and 20 %. */
static void buckets(void **state)
{
    dmk_mesh *m = make(*state, 160, 80, on_torus, 0.4);
    dmk_geodesics *g = from_vertex(*state, m, 17, 1e-4);
    if (g->n_windows < 85200 || g->n_windows > 88700)
        fail_msg("%lld windows", (long long)g->n_windows);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* ---- exact windows ----------------------------------------------------------------------------- */

/* How many windows may be made: two constants say. With 480 rings 1.6 million are made of 1.7 that may be, and with
 * one of the constants halved that would be too many; with 640 rings it would be 2.9 of 2.1, and they stop; doubled,
 * either would let them go on.
 * Merged windows, made then, are far fewer. */
static void most_of_all(void **state)
{
    static const int32_t n[2] = {480, 640};
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m = make_tube(*state, n[i]);
        dmk_geodesics *g = from_vertex(*state, m, 5, 0);
        if ((g->n_windows > 1000000) != (i == 0))
            fail_msg("%d rings: %lld windows", n[i], (long long)g->n_windows);
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* One thread goes ahead with 500,000 steps, of 0.4 or 0.7 million; of the second some windows are left to share. Twice
 * as many steps leave none there, half as many some of the first. */
static void sharing(void **state)
{
    static const size_t n[2] = {15000, 22000};
    dmk_context_set_threads(*state, 2);
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m;
        dmk_surface_options surface;
        dmk_surface_options_init(&surface, sizeof surface);
        surface.name = "ellipsoid"; /* no pseudo-sources: all windows are the source's */
        surface.n_triangles = n[i];
        assert_int_equal(dmk_mesh_surface(*state, &surface, &m), DMK_OK);
        dmk_geodesics *g = from_vertex(*state, m, 5, 0);
        if (i == 0)
            assert_int_equal(g->n_shared, 0);
        else
            assert_true(g->n_shared > 1);
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
    dmk_context_set_threads(*state, 1);
}

typedef struct question {
    int asked, stop_at;
} question;

static int answer(const dmk_progress *progress, void *user)
{
    question *q = user;
    (void)progress;
    return q->asked++ == q->stop_at;
}

/* Twelve questions come while one thread goes ahead, and some fifty while two share the windows. */
static void sharing_ends_when_told(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = NULL;
    dmk_geodesics *g = NULL;
    question q = {0, 20};
    dmk_surface_options surface;
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "ellipsoid";
    surface.n_triangles = 90000;
    assert_int_equal(dmk_mesh_surface(ctx, &surface, &m), DMK_OK);
    const dmk_point p = {.triangle = 17, .weight = {1}};
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.exact = 1;
    dmk_context_set_threads(ctx, 2);
    ctx->poll_every = 0;
    dmk_context_set_progress(ctx, answer, &q);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, &options, &g), DMK_E_CANCELLED);
    assert_string_equal(dmk_context_message(ctx), "cancelled in stage 'distance'");
    assert_int_equal(q.asked, 21); /* not asked again */
    assert_null(g);
    dmk_context_set_progress(ctx, NULL, NULL);
    ctx->poll_every = 0.05;
    dmk_context_set_threads(ctx, 1);
    dmk_mesh_destroy(&m);
}

/* ---- repair -------------------------------------------------------------------------------------- */

/* 200 vertices of too large an error are looked at again; of more, none: other windows take their place. */
static void repairs(void **state)
{
    dmk_mesh *m = make(*state, 60, 40, on_torus, 0.4);
    dmk_geodesics *g = run(*state, m, 1e-4);
    const int32_t first = g->source->vertex == 0;
    bool few = true;
    for (int k = 201; k >= 200; k--) {
        int32_t mended = 0;
        for (int32_t v = 0; v < m->n_vertices; v++) g->error[v] = v - first < k ? 1 + 1e-6 * v : 0;
        assert_int_equal(dmk_tracer_repair(*state, g, &few), DMK_OK);
        for (int32_t v = first; v < k + first; v++) mended += g->error[v] != 1 + 1e-6 * v;
        assert_int_equal(few, k == 200);
        if (few)
            assert_in_range(mended, 190, 200);
        else
            assert_int_equal(mended, 0);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* ---- rounding ---------------------------------------------------------------------------------- */

/* Two triangles, a square of side 1 with the source at corner 0 of the first. */
/* A source within 1e-12 of a vertex lies there. */
static void source_at_a_vertex(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0.7e-12), *off = from_corner(*state, m, 1.4e-12);
    assert_true(g->source->vertex == 0 && off->source->vertex == -1);
    dmk_geodesics_destroy(&g);
    dmk_geodesics_destroy(&off);
    dmk_mesh_destroy(&m);
}

/* Distances at the ends of an edge may differ by its length and 1e-11 of the largest distance. */
static void slack_of_the_check(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    g->distance[1] = 1 + 0.7e-11 * sqrt(2);
    assert_int_equal(dmk_geodesics_check(*state, g), DMK_OK);
    g->distance[1] = 1 + 1.4e-11 * sqrt(2);
    assert_int_equal(dmk_geodesics_check(*state, g), DMK_E_MESH);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A vertex counts as a pseudo-source from 1e-10 more than 2 pi on: a star of six triangles, every other corner up and
 * the rest down, has some square of the height more. */
static void least_angle(void **state)
{
    double excess = 0, height = 1e-3;
    static const double wanted[3] = {0, 0.7e-10, 1.4e-10};
    for (int i = 0; i < 3; i++) {
        dmk_mesh *m;
        dmk_front front;
        double xyz[21] = {0};
        int32_t triangle[18];
        if (i > 0) height = 1e-3 * sqrt(wanted[i] / excess);
        for (int32_t k = 0; k < 6; k++) {
            double *x = xyz + 3 * (k + 1);
            x[0] = cos(pi * k / 3), x[1] = sin(pi * k / 3), x[2] = k % 2 ? height : -height;
            int32_t *t = triangle + 3 * k;
            t[0] = 0, t[1] = k + 1, t[2] = (k + 1) % 6 + 1;
        }
        assert_int_equal(dmk_mesh_create(*state, 7, xyz, 6, triangle, &m), DMK_OK);
        dmk_geodesics *g = from_corner(*state, m, 0.3);
        if (i == 0) excess = g->star.total[0] - 2 * pi;
        assert_int_equal(dmk_front_create(*state, g, &front), DMK_OK);
        assert_true(excess > 0 && front.pseudo_source[0] == (i != 1));
        dmk_front_free(&front);
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Edges within 1e-9 of a range of directions are in it; a beam is 1e-9 wider, unless it is narrower than 1e-12. */
static void rays_of_a_sector(void **state)
{
    dmk_mesh *m = unit_square(*state, 1);
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

/* ---- merged windows: what counts as rounding, and what exact runs allow ---- */

/* The unit square with the source at a corner of both triangles. */
typedef struct square {
    dmk_mesh *mesh;
    dmk_geodesics *geodesics;
    engine e;
} square;

static square begin(dmk_context *ctx, double tolerance)
{
    square s;
    s.mesh = unit_square(ctx, 1);
    s.geodesics = from_corner(ctx, s.mesh, 0);
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
    return (wave){lo, hi, o, (o - x) / r, -y / r, 1 / r, r, 0, 0, 0, 0, 0, -1, 0, -1};
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
            look(&q.e, 0, &s);
            assert_int_equal(dmk_shard_store(*state, q.e.shard, &w, q.e.head), DMK_OK);
            assert_int_equal(gather(q.e.shard, q.e.head, false, &s, &n), DMK_OK);
            assert_int_equal(n, i == 0);
            assert_int_equal(q.e.shard->n_free, 1);
            assert_int_equal(q.e.head[0], -1);
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

/* Of two touching windows, whose points lie anywhere, that become one: how much more values change somewhere than what
 * goes into the error, the worst of many with points down to a hundredth of the edge beside it: 1.66; with half as many
 * places to look at 3.3, with twice as many 1, without any more than 10. */
static void changes_within_windows(void **state)
{
    square q = begin(*state, 1e-3);
    double worst = 0;
    uint32_t random = 5;
    for (int i = 0; i < 200000; i++) {
        const double middle = 0.5 + 0.9 * noise(&random);
        wave one,
            r[2] = {around(4 * noise(&random), -pow(10, 3 * noise(&random) - 0.5), 0, middle),
                    around(4 * noise(&random), -pow(10, 3 * noise(&random) - 0.5), middle, 1)};
        r[1].D += value(&r[0], middle) - value(&r[1], middle);
        if (!merge(&q.e, r, 2, 1, &one)) continue;
        for (int k = 0; k <= 200; k++) {
            const double t = k / 200., off = value(&one, t) - value(r + (t > middle), t);
            worst = fmax(worst, fabs(off) / one.error);
        }
    }
    if (!(worst > 1.4 && worst < 2)) fail_msg("%g", worst);
    end(&q);
}

/* A front that narrows, along the edge: its rays never come as high as the corner above, and leave below it. */
static void rays_along_the_edge(void **state)
{
    for (int left = 0; left < 2; left++) {
        angle s;
        square q = begin(*state, 1e-6);
        const wave w = {.lo = 0.2,
                        .hi = 0.8,
                        .o = 0.5,
                        .ux = left ? -0.9999 : 0.9999,
                        .k = -0.05,
                        .uy = sqrt(1 - 0.9999 * 0.9999),
                        .D = 1,
                        .half = left ? 3 : 0,
                        .root = -1};
        double n = 0;
        q.e.front.d[0] = q.e.front.d[1] = q.e.front.d[2] = q.e.front.d[3] = 2;
        look(&q.e, w.half, &s);
        assert_true(w.k * s.cy + w.uy < 0);
        assert_int_equal(step(q.e.shard, &w, &s), DMK_OK);
        for (int k = 0; k < SHARDS; k++) n += (double)q.e.shard->finds[k].n_children;
        assert_true(n == 1);
        end(&q);
    }
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
    assert_int_equal(dmk_shard_schedule(*state, &q.e, q.e.shard, 3, 1e30), DMK_OK);
    assert_int_equal(dmk_shard_schedule(*state, &q.e, q.e.shard, 4, 5), DMK_OK);
    assert_int_equal(q.e.shard->n_buckets, q.e.most_buckets + 1);
    assert_true(q.e.most_buckets * q.e.width >= 5 * q.e.front.facet[0].length[0]);
    end(&q);
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
        cmocka_unit_test(waves_are_distances),
        cmocka_unit_test(waves_cross),
        cmocka_unit_test(shortest_waves_are_kept),
        cmocka_unit_test(parts_become_whole),
        cmocka_unit_test(merging),
        cmocka_unit_test(what_windows_differ_in_counts_once),
        cmocka_unit_test(exact_windows),
        cmocka_unit_test(buckets),
        cmocka_unit_test(most_of_all),
        cmocka_unit_test(sharing),
        cmocka_unit_test(sharing_ends_when_told),
        cmocka_unit_test(repairs),
        cmocka_unit_test(changes_within_windows),
        cmocka_unit_test(rays_along_the_edge),
        cmocka_unit_test(exact_where_merged_fail),
        cmocka_unit_test(line_between_engines),
        cmocka_unit_test(source_at_a_vertex),
        cmocka_unit_test(slack_of_the_check),
        cmocka_unit_test(least_angle),
        cmocka_unit_test(rays_of_a_sector),
        cmocka_unit_test(straight_border),
        cmocka_unit_test(rounding_of_filters),
        cmocka_unit_test(tolerance_of_exact_runs),
        cmocka_unit_test(order_of_windows),
        cmocka_unit_test(last_bucket),
    };
    return cmocka_run_group_tests(tests, setup, context_teardown);
}
