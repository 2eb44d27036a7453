/* Exact distances: closed forms, and what holds on every mesh. */
#include "context.h"
#include "geodesic/front.h"
#include "geodesic/geodesic.h"

#include "base/vec3.h"

#include <limits.h>
#include <malloc.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const double pi = 3.14159265358979323846;

/* ---- meshes ---------------------------------------------------------------------------------- */

enum { most_vertices = 4000, most_triangles = 8000 };

/* A mesh under construction: equal places are one vertex. */
typedef struct soup {
    int32_t n_vertices, n_triangles;
    double xyz[3 * most_vertices];
    int32_t triangle[3 * most_triangles];
} soup;

static int32_t vertex_at(soup *s, const double x[3])
{
    for (int32_t v = 0; v < s->n_vertices; v++) {
        const double *y = s->xyz + 3 * v;
        if (fabs(x[0] - y[0]) + fabs(x[1] - y[1]) + fabs(x[2] - y[2]) < 1e-9) return v;
    }
    assert_true(s->n_vertices < most_vertices);
    memcpy(s->xyz + 3 * s->n_vertices, x, 3 * sizeof *x);
    return s->n_vertices++;
}

static void add_triangle(soup *s, int32_t a, int32_t b, int32_t c)
{
    const int32_t corner[3] = {a, b, c};
    assert_true(s->n_triangles < most_triangles);
    memcpy(s->triangle + 3 * s->n_triangles++, corner, sizeof corner);
}

static double noise(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state / 4294967296.0 - 0.5;
}

/* n x m squares, o + i/n p + j/m q, cut along diagonals; the inner vertices moved within the plane.
 */
static void add_grid(soup *s, const double o[3], const double p[3], const double q[3], int n, int m,
                     double jitter, uint32_t *state)
{
    int32_t *number = malloc((size_t)(n + 1) * (size_t)(m + 1) * sizeof *number);
    for (int j = 0; j <= m; j++) {
        for (int i = 0; i <= n; i++) {
            bool inner = i > 0 && j > 0 && i < n && j < m;
            double x[3], a = (i + (inner ? jitter * noise(state) : 0)) / n;
            double b = (j + (inner ? jitter * noise(state) : 0)) / m;
            for (int k = 0; k < 3; k++) x[k] = o[k] + a * p[k] + b * q[k];
            number[j * (n + 1) + i] = vertex_at(s, x);
        }
    }
    for (int j = 0; j < m; j++) {
        for (int i = 0; i < n; i++) {
            const int32_t *v = number + j * (n + 1) + i;
            add_triangle(s, v[0], v[1], v[n + 2]);
            add_triangle(s, v[0], v[n + 2], v[n + 1]);
        }
    }
    free(number);
}

static dmk_mesh *finish(dmk_context *ctx, soup *s)
{
    dmk_mesh *m;
    int rc = dmk_mesh_create(ctx, (size_t)s->n_vertices, s->xyz, (size_t)s->n_triangles,
                             s->triangle, &m);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(s);
    return m;
}

static soup *new_soup(void)
{
    soup *s = calloc(1, sizeof *s);
    assert_non_null(s);
    return s;
}

static dmk_mesh *make_cube(dmk_context *ctx, int n, double jitter)
{
    static const double face[6][9] = {
        {0, 0, 0, 0, 1, 0, 1, 0, 0}, {0, 0, 1, 1, 0, 0, 0, 1, 0}, {0, 0, 0, 1, 0, 0, 0, 0, 1},
        {0, 1, 0, 0, 0, 1, 1, 0, 0}, {0, 0, 0, 0, 0, 1, 0, 1, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1},
    };
    uint32_t state = 3;
    soup *s = new_soup();
    for (int f = 0; f < 6; f++)
        add_grid(s, face[f], face[f] + 3, face[f] + 6, n, n, jitter, &state);
    return finish(ctx, s);
}

static dmk_mesh *make_square(dmk_context *ctx, int n, double jitter)
{
    static const double o[3] = {0}, p[3] = {1, 0, 0}, q[3] = {0, 1, 0};
    uint32_t state = 5;
    soup *s = new_soup();
    add_grid(s, o, p, q, n, n, jitter, &state);
    return finish(ctx, s);
}

/* ---- the object ------------------------------------------------------------------------------ */

/* What holds of every result: nothing negative, everything reached, no edge violated. */
static dmk_geodesics *run(dmk_context *ctx, const dmk_mesh *m, size_t n, const dmk_point *source,
                          const double *offset)
{
    dmk_geodesics *g;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.offset = offset;
    if (dmk_geodesics_create(ctx, m, n, source, &options, &g) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    for (int32_t e = 0; e < m->n_edges; e++) {
        double a = g->distance[m->edge_vertex[2 * e]], b = g->distance[m->edge_vertex[2 * e + 1]];
        assert_true(a >= 0 && b >= 0 && fabs(a - b) <= m->length[e] + 1e-12 * (a + b));
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const dmk_arrival *r = g->arrival + v;
        assert_true(r->source >= 0 && r->source < (int32_t)n && r->pseudo_source < m->n_vertices);
        assert_true(r->direction >= 0 && r->direction <= g->source[r->source].total);
        assert_true(r->back >= 0 && r->back <= g->star.total[v]);
    }
    return g;
}

static dmk_geodesics *run_with(dmk_context *ctx, const dmk_mesh *m, size_t n,
                               const dmk_point *source, const dmk_geodesics_options *options)
{
    dmk_geodesics *g;
    if (dmk_geodesics_create(ctx, m, n, source, options, &g) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    return g;
}

static dmk_point at_vertex(dmk_context *ctx, const dmk_mesh *m, int64_t v)
{
    dmk_point p;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, v, &p), DMK_OK);
    return p;
}

/* ---- closed forms ---------------------------------------------------------------------------- */

/* How far the angle of the path to v is from the direction of its distance. */
static double off_path(dmk_context *ctx, const dmk_geodesics *g, int32_t v)
{
    const dmk_point to = at_vertex(ctx, g->mesh, v);
    dmk_path path;
    assert_int_equal(dmk_geodesics_paths(ctx, g, 1, &to, &path), DMK_OK);
    const double off = remainder(path.angle - g->arrival[v].direction, 2 * pi);
    dmk_path_free(&path);
    return fabs(off);
}

/* From a corner, an edge and inside a triangle of a flat square, also close to an edge: Euclid's; the log map too, and
 * the directions of paths. */
static void flat_square(void **state)
{
    dmk_context *ctx = *state;
    const dmk_point source[] = {{0, {1, 0, 0}},
                                {40, {0.3, 0, 0.7}},
                                {71, {0.2, 0.5, 0.3}},
                                {71, {1e-13, 0.5, 0.5}},
                                {71, {1e-10, 0.5, 0.5 - 1e-10}}};
    dmk_mesh *m = make_square(ctx, 7, 0.5);
    for (size_t i = 0; i < sizeof source / sizeof *source; i++) {
        double p[3], turned = HUGE_VAL;
        dmk_geodesics *g = run(ctx, m, 1, source + i, NULL);
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i, p), DMK_OK);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double x = m->xyz[3 * v] - p[0], y = m->xyz[3 * v + 1] - p[1];
            if (fabs(g->distance[v] - hypot(x, y)) > 1e-12) {
                fail_msg("source %zu, vertex %d: %.15g, not %.15g", i, v, g->distance[v],
                         hypot(x, y));
            }
            if (hypot(x, y) < 1e-3 || g->arrival[v].pseudo_source >= 0) continue;
            double turn = remainder(g->arrival[v].direction - atan2(y, x), 2 * pi);
            if (turned == HUGE_VAL) turned = turn;
            assert_true(fabs(remainder(turn - turned, 2 * pi)) < 1e-6);
            assert_true(off_path(ctx, g, v) < 1e-7);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* From a point of a border's edge directions go from 0 to pi, and not round: along the border they are 0 on one side,
 * pi on the other. */
static void from_an_edge_of_the_border(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_square(ctx, 9, 0.5);
    dmk_point p = {-1, {0}};
    for (int32_t t = 0; t < m->n_triangles && p.triangle < 0; t++) {
        for (int k = 0; k < 3; k++) {
            const int32_t a = m->triangle[3 * t + (k + 1) % 3],
                          b = m->triangle[3 * t + (k + 2) % 3];
            if (m->xyz[3 * a + 1] > 0 || m->xyz[3 * b + 1] > 0 || m->xyz[3 * a] < 0.4) continue;
            p.triangle = t;
            p.weight[(k + 1) % 3] = 0.25;
            p.weight[(k + 2) % 3] = 0.75;
        }
    }
    double at[3];
    assert_int_equal(dmk_mesh_point_xyz(ctx, m, &p, at), DMK_OK);
    for (int merged = 0; merged < 2; merged++) {
        dmk_geodesics_options options;
        dmk_geodesics_options_init(&options, sizeof options);
        options.tolerance = merged ? 1e-9 : 0;
        dmk_geodesics *g = run_with(ctx, m, 1, &p, &options);
        assert_true(dmk_turn_around(g, 0) == HUGE_VAL);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double x = m->xyz[3 * v] - at[0], y = m->xyz[3 * v + 1];
            assert_true(fabs(g->distance[v] - hypot(x, y)) < 1e-8);
            assert_true(fabs(g->arrival[v].direction - atan2(y, x)) < 1e-7);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

static void cube_from_a_corner(void **state)
{
    dmk_context *ctx = *state;
    for (int jitter = 0; jitter < 2; jitter++) {
        dmk_mesh *m = make_cube(ctx, 9, 0.6 * jitter);
        dmk_point source = at_vertex(ctx, m, 0);
        dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double *x = m->xyz + 3 * v;
            double best =
                x[0] * x[1] * x[2] == 0 ? sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) : HUGE_VAL;
            for (int k = 0; k < 3; k++) {
                double y = x[(k + 1) % 3], z = x[(k + 2) % 3];
                if (x[k] == 1) best = fmin(best, fmin(hypot(1 + y, z), hypot(y, 1 + z)));
            }
            assert_true(fabs(g->distance[v] - best) < 1e-12);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Two squares, one on the other, joined along their border. */
static void doubled_square(void **state)
{
    dmk_context *ctx = *state;
    static const double o[3] = {0}, x[3] = {1, 0, 0}, y[3] = {0, 1, 0}, left[3] = {-1, 0, 0};
    uint32_t noisy = 9;
    soup *s = new_soup();
    add_grid(s, o, x, y, 6, 6, 0, &noisy);
    int32_t front = s->n_vertices;
    for (int32_t v = 0; v < front; v++)
        s->xyz[3 * v + 2] = s->xyz[3 * v] * s->xyz[3 * v + 1] == 0 ? 0 : 1;
    for (int32_t v = 0; v < front; v++) {
        if (s->xyz[3 * v] == 1 || s->xyz[3 * v + 1] == 1) s->xyz[3 * v + 2] = 0;
    }
    add_grid(s, x, left, y, 6, 6, 0.4, &noisy);
    for (int32_t v = 0; v < front; v++) s->xyz[3 * v + 2] = 0;
    dmk_mesh *m = finish(ctx, s);
    dmk_point source = at_vertex(ctx, m, 16);
    const double a = m->xyz[48], b = m->xyz[49];
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double p = m->xyz[3 * v], q = m->xyz[3 * v + 1];
        double best = fmin(fmin(hypot(p + a, q - b), hypot(2 - p - a, q - b)),
                           fmin(hypot(p - a, q + b), hypot(p - a, 2 - q - b)));
        if (v < front) best = hypot(p - a, q - b);
        assert_true(fabs(g->distance[v] - best) < 1e-12);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Around a reentrant corner of a border: a pseudo-source. */
static void around_a_corner(void **state)
{
    dmk_context *ctx = *state;
    static const double at[3][3] = {{-1, -1, 0}, {-1, 0, 0}, {0, 0, 0}}, x[3] = {1, 0, 0},
                        y[3] = {0, 1, 0};
    uint32_t noisy = 1;
    soup *s = new_soup();
    for (int i = 0; i < 3; i++) add_grid(s, at[i], x, y, 5, 5, 0.3, &noisy);
    dmk_mesh *m = finish(ctx, s);
    dmk_point source = at_vertex(ctx, m, 8);
    const double *p = m->xyz + 24;
    int n_behind = 0;
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double *q = m->xyz + 3 * v;
        bool behind =
            q[0] > 0 && p[0] * q[1] - p[1] * q[0] > 0; /* the ray passes below the corner */
        behind = q[0] > 0 && q[1] >= 0 && q[0] * -p[1] > q[1] * -p[0];
        double best =
            behind ? hypot(p[0], p[1]) + hypot(q[0], q[1]) : hypot(p[0] - q[0], p[1] - q[1]);
        n_behind += behind;
        assert_true(fabs(g->distance[v] - best) < 1e-12);
        if (behind) assert_true(g->arrival[v].pseudo_source >= 0);
    }
    assert_true(n_behind > 5);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* ---- surfaces that unroll -------------------------------------------------------------------- */

/* The plane angle between two vectors. */
static double angle_between(const double a[3], const double b[3])
{
    double normal[3];
    dmk_cross(a, b, normal);
    return atan2(sqrt(dmk_dot(normal, normal)), dmk_dot(a, b));
}

enum { n_sides = 11 };

/* The open tube over a regular polygon: rectangles side by side. */
static dmk_mesh *make_tube(dmk_context *ctx, double height)
{
    const double up[3] = {0, 0, height};
    uint32_t noisy = 2;
    soup *s = new_soup();
    for (int i = 0; i < n_sides; i++) {
        const double a = 2 * pi * i / n_sides, b = 2 * pi * (i + 1) / n_sides;
        const double corner[3] = {cos(a), sin(a), 0};
        const double along[3] = {cos(b) - cos(a), sin(b) - sin(a), 0};
        add_grid(s, corner, along, up, 3, 7, 0.5, &noisy);
    }
    return finish(ctx, s);
}

/* How far around the tube a point lies. */
static double around_tube(const double x[3])
{
    const double phi = atan2(x[1], x[0]) + (x[1] < 0 ? 2 * pi : 0), side = 2 * sin(pi / n_sides);
    const int i = (int)(phi * n_sides / (2 * pi));
    const double a = 2 * pi * i / n_sides;
    return i * side + hypot(x[0] - cos(a), x[1] - sin(a));
}

/* A tube unrolls to a strip: the nearest of the source's copies, a girth apart, is Euclid's. */
static void tube(void **state)
{
    dmk_context *ctx = *state;
    static const double height[2] = {0.7, 5};
    const double girth = n_sides * 2 * sin(pi / n_sides);
    const dmk_point source[] = {{0, {1, 0, 0}}, {40, {0.3, 0, 0.7}}, {170, {0.2, 0.5, 0.3}}};
    for (int i = 0; i < 6; i++) {
        dmk_mesh *m = make_tube(ctx, height[i / 3]);
        double p[3];
        dmk_geodesics *g = run(ctx, m, 1, source + i % 3, NULL);
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i % 3, p), DMK_OK);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double *x = m->xyz + 3 * v;
            const double turn = remainder(around_tube(x) - around_tube(p), girth);
            assert_true(fabs(g->distance[v] - hypot(turn, x[2] - p[2])) < 1e-12);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

enum { n_slices = 10, slice_cuts = 6 };

/* Direction i of the cone's rim from its apex. */
static void rim(const double lift[2], int i, double u[3])
{
    const double a = 2 * pi * i / n_slices, z = lift[i % 2];
    u[0] = cos(a) * sqrt(1 - z * z), u[1] = sin(a) * sqrt(1 - z * z), u[2] = z;
}

/* Equal triangles around the origin, cut into smaller ones; the rim's directions have the heights
 * lift[0], lift[1] in turns. */
static dmk_mesh *make_cone(dmk_context *ctx, const double lift[2])
{
    enum { n = slice_cuts };
    uint32_t noisy = 4;
    soup *s = new_soup();
    for (int slice = 0; slice < n_slices; slice++) {
        double u[3], w[3], x[3];
        int32_t number[n + 1][n + 1];
        rim(lift, slice, u), rim(lift, slice + 1, w);
        for (int i = 0; i <= n; i++) {
            for (int j = 0; i + j <= n; j++) {
                const double moved = i > 0 && j > 0 && i + j < n ? 0.5 : 0;
                const double a = (i + moved * noise(&noisy)) / n;
                const double b = (j + moved * noise(&noisy)) / n;
                for (int k = 0; k < 3; k++) x[k] = a * u[k] + b * w[k];
                number[i][j] = vertex_at(s, x);
            }
        }
        for (int i = 0; i < n; i++) {
            for (int j = 0; i + j < n; j++) {
                add_triangle(s, number[i][j], number[i + 1][j], number[i][j + 1]);
                if (i + j + 1 == n) continue;
                add_triangle(s, number[i + 1][j], number[i + 1][j + 1], number[i][j + 1]);
            }
        }
    }
    return finish(ctx, s);
}

/* The angle of a point of the cone around the apex, within the slice that it lies in: the one whose
 * two sides it is between. */
static double around_cone(const double lift[2], const double x[3])
{
    double least = HUGE_VAL, angle = 0, u[3], w[3];
    for (int i = 0; i < n_slices; i++) {
        rim(lift, i, u), rim(lift, i + 1, w);
        const double slice = angle_between(u, w), first = angle_between(u, x);
        if (first + angle_between(x, w) >= least) continue;
        least = first + angle_between(x, w);
        angle = i * slice + first;
    }
    return angle;
}

/* Over the apex where both ways around it turn by pi or more, else the third side of a triangle. */
static double on_cone(double total, double r, double s, double turn)
{
    turn = fabs(remainder(turn, total));
    return turn >= pi ? r + s : hypot(r - s * cos(turn), s * sin(turn));
}

/* Around an apex with less than 2 pi and around one with more, where paths bend; from there, too. */
static void cone(void **state)
{
    dmk_context *ctx = *state;
    static const double lift[4][2] = {{0.9, 0.9}, {0.3, 0.3}, {0.25, -0.25}, {0.5, -0.5}};
    const dmk_point source[] = {{0, {1, 0, 0}}, {70, {0, 0.4, 0.6}}, {200, {0.2, 0.5, 0.3}}};
    for (int i = 0; i < 12; i++) {
        const double *z = lift[i / 3];
        double p[3], u[3], w[3];
        int n_bent = 0;
        dmk_mesh *m = make_cone(ctx, z);
        dmk_geodesics *g = run(ctx, m, 1, source + i % 3, NULL);
        rim(z, 0, u), rim(z, 1, w);
        const double total = n_slices * angle_between(u, w);
        assert_true((total > 2 * pi) == (z[1] < 0));
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i % 3, p), DMK_OK);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double *x = m->xyz + 3 * v, turn = around_cone(z, x) - around_cone(z, p);
            const double best = on_cone(total, sqrt(dmk_dot(x, x)), sqrt(dmk_dot(p, p)), turn);
            assert_true(fabs(g->distance[v] - best) < 1e-12);
            n_bent += g->arrival[v].pseudo_source == 0;
        }
        assert_true((n_bent > 0) == (z[1] < 0 && i % 3 > 0));
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* ---- any mesh -------------------------------------------------------------------------------- */

/* A surface of genus 3, full of saddles, against pygeodesic 0.1.11, an implementation of
 * Mitchell, Mount and Papadimitriou's algorithm by other people: its distances from vertex 7. */
static void stored_distances(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m;
    double stored;
    int n_bent = 0;
    assert_int_equal(dmk_mesh_read(ctx, "tests/data/triple_torus.off.gz", &m), DMK_OK);
    FILE *file = fopen("tests/data/triple_torus_distance.txt", "r");
    assert_non_null(file);
    const dmk_point source = at_vertex(ctx, m, 7);
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        assert_int_equal(fscanf(file, "%lf", &stored), 1);
        if (fabs(g->distance[v] - stored) > 1e-12 * (1 + stored))
            fail_msg("vertex %d: %.17g, not %.17g", v, g->distance[v], stored);
        n_bent += g->arrival[v].pseudo_source >= 0;
    }
    assert_int_equal(fscanf(file, "%lf", &stored), EOF);
    assert_true(n_bent > 100);
    fclose(file);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

static void both_ways(void **state)
{
    dmk_context *ctx = *state;
    static const char *const file[] = {"meshes/torus.off", "meshes/quartic.off",
                                       "tests/data/triple_torus.off.gz"};
    for (int i = 0; i < 3; i++) {
        dmk_mesh *m;
        assert_int_equal(dmk_mesh_read(ctx, file[i], &m), DMK_OK);
        const int32_t a = 7, b = m->n_vertices / 2;
        dmk_point p = at_vertex(ctx, m, a), q = at_vertex(ctx, m, b);
        dmk_geodesics *there = run(ctx, m, 1, &p, NULL), *back = run(ctx, m, 1, &q, NULL);
        assert_true(fabs(there->distance[b] - back->distance[a]) < 1e-13 * there->distance[b]);
        dmk_geodesics_destroy(&there);
        dmk_geodesics_destroy(&back);
        dmk_mesh_destroy(&m);
    }
}

/* Distances of vertices are the lengths of paths to them; with a tolerance, too, where merged windows miss it. */
static void check_paths(dmk_context *ctx, const dmk_mesh *m, const dmk_geodesics *g)
{
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = 1e-6;
    dmk_geodesics *merged = run_with(ctx, m, 1, &g->source->point, &options);
    assert_null(merged->error);
    for (int32_t v = 1; v < m->n_vertices; v += 7) {
        dmk_path path;
        const dmk_point to = at_vertex(ctx, m, v);
        assert_int_equal(dmk_geodesics_paths(ctx, g, 1, &to, &path), DMK_OK);
        assert_true(fabs(path.length - g->distance[v]) <= 1e-11 * g->distance[v]);
        assert_true(merged->distance[v] == g->distance[v]);
        dmk_path_free(&path);
    }
    dmk_geodesics_destroy(&merged);
}

/* Spikes 200 times as high as the ground is wide: the estimates of trimmed windows are below 1e-11 of the farthest
 * distance, and some distances are off by 6e-10. */
static void spiky_terrain(void **state)
{
    enum { N = 46 };
    dmk_context *ctx = *state;
    uint32_t random = 55;
    soup *s = new_soup();
    for (int v = 0; v < (N + 1) * (N + 1); v++) {
        double *x = s->xyz + 3 * s->n_vertices++;
        x[0] = (double)(v % (N + 1)) / N;
        x[1] = (double)(v / (N + 1)) / N;
        x[2] = 200 * pow(noise(&random) + 0.5, 8);
    }
    for (int i = 0; i < N * N; i++) {
        const int32_t a = i / N * (N + 1) + i % N, b = a + 1, c = a + N + 2, d = a + N + 1;
        const bool other = noise(&random) < 0;
        add_triangle(s, a, b, other ? d : c);
        add_triangle(s, other ? b : a, c, d);
    }
    dmk_mesh *m = finish(ctx, s);
    const dmk_point from = at_vertex(ctx, m, 610);
    dmk_geodesics *g = run(ctx, m, 1, &from, NULL);
    check_paths(ctx, m, g);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Terrain 400 times as high as it is wide. Windows that are trimmed against each other leave up to 1e-7 there,
 * and of merged ones some run past a vertex: distances are exact all the same. */
static void rough_terrain(void **state)
{
    enum { N = 50, MANY = 6 };
    static const double o[3] = {0}, p[3] = {1, 0, 0}, q[3] = {0, 1, 0};
    dmk_context *ctx = *state;
    uint32_t random = 11;
    soup *s = new_soup();
    add_grid(s, o, p, q, N, N, 0, &random);
    for (int32_t v = 0; v < s->n_vertices; v++) s->xyz[3 * v + 2] = 400 * noise(&random);
    dmk_mesh *m = finish(ctx, s);
    double d[MANY][MANY];
    for (int i = 0; i < MANY; i++) {
        const dmk_point from = at_vertex(ctx, m, i * m->n_vertices / MANY);
        dmk_geodesics *g = run(ctx, m, 1, &from, NULL);
        assert_null(g->error);
        for (int k = 0; k < MANY; k++) d[i][k] = g->distance[k * m->n_vertices / MANY];
        if (i == 0) check_paths(ctx, m, g);
        dmk_geodesics_destroy(&g);
    }
    for (int i = 0; i < MANY; i++)
        for (int k = 0; k < i; k++) assert_true(fabs(d[i][k] - d[k][i]) < 1e-11 * d[i][k]);
    dmk_mesh_destroy(&m);
}

/* Several sources: the least of what each gives, and its number. */
static void several_sources(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_read(ctx, "meshes/torus.off", &m), DMK_OK);
    const dmk_point source[4] = {
        {10, {1, 0, 0}}, {999, {0.2, 0.3, 0.5}}, {3000, {0, 0.5, 0.5}}, {11, {0, 0, 1}}};
    const double offset[4] = {0.1, 0, 0.3, 5};
    dmk_geodesics *all = run(ctx, m, 4, source, offset), *one[4];
    for (int i = 0; i < 4; i++) one[i] = run(ctx, m, 1, source + i, NULL);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        double best = HUGE_VAL,
               own = one[all->arrival[v].source]->distance[v] + offset[all->arrival[v].source];
        for (int i = 0; i < 4; i++) best = fmin(best, one[i]->distance[v] + offset[i]);
        assert_true(fabs(all->distance[v] - best) < 1e-12 && fabs(own - best) < 1e-12);
    }
    for (int i = 0; i < 4; i++) dmk_geodesics_destroy(one + i);
    dmk_geodesics_destroy(&all);
    dmk_mesh_destroy(&m);
}

/* Two sources in a flat convex polygon around one vertex: the one behind the other has a longer way to the vertex above
 * a half-edge, and yet the shorter one to a vertex beside it. Both ways around, by exact and by merged windows. */
static void one_source_behind_another(void **state)
{
    dmk_context *ctx = *state;
    static const double corner[7][2] = {{-1, 4},   {16, 12}, {15, 13}, {10, 17},
                                        {-19, -6}, {7, -19}, {15, -14}};
    static const double tolerance[2] = {0, 1e-6};
    for (int i = 0; i < 4; i++) {
        const bool turned = i % 2 == 1;
        double xyz[21] = {0}, at[2][3];
        int32_t triangle[18];
        dmk_point source[2] = {{2, {0.625, 0.25, 0.125}}, {1, {0.75, 0.125, 0.125}}};
        dmk_geodesics_options options;
        dmk_geodesics *g;
        dmk_mesh *m;
        for (int v = 0; v < 7; v++) {
            xyz[3 * v] = turned ? -corner[v][0] : corner[v][0];
            xyz[3 * v + 1] = corner[v][1];
        }
        for (int t = 0; t < 6; t++) {
            triangle[3 * t] = 0;
            triangle[3 * t + 1] = 1 + (turned ? (t + 1) % 6 : t);
            triangle[3 * t + 2] = 1 + (turned ? t : (t + 1) % 6);
        }
        assert_int_equal(dmk_mesh_create(ctx, 7, xyz, 6, triangle, &m), DMK_OK);
        for (int k = 0; k < 2; k++) {
            const double *w = source[k].weight, swapped[3] = {w[0], w[2], w[1]};
            if (turned) memcpy(source[k].weight, swapped, sizeof swapped);
            assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + k, at[k]), DMK_OK);
        }
        dmk_geodesics_options_init(&options, sizeof options);
        options.tolerance = tolerance[i / 2];
        assert_int_equal(dmk_geodesics_create(ctx, m, 2, source, &options, &g), DMK_OK);
        for (int v = 0; v < 7; v++) {
            double best = HUGE_VAL;
            for (int k = 0; k < 2; k++)
                best = fmin(best, hypot(xyz[3 * v] - at[k][0], xyz[3 * v + 1] - at[k][1]));
            assert_true(fabs(g->distance[v] - best) < 1e-12 * 40);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Lengths whose squares would overflow or vanish. */
static void any_scale(void **state)
{
    dmk_context *ctx = *state;
    static const double scale[2] = {1e-40, 1e40};
    dmk_mesh *m = make_cube(ctx, 3, 0);
    dmk_point p = {5, {0.2, 0.3, 0.5}};
    dmk_geodesics *one = run(ctx, m, 1, &p, NULL);
    for (int i = 0; i < 2; i++) {
        dmk_mesh *other;
        double *xyz = calloc(3 * (size_t)m->n_vertices, sizeof *xyz);
        for (int32_t k = 0; k < 3 * m->n_vertices; k++) xyz[k] = m->xyz[k] * scale[i];
        assert_int_equal(dmk_mesh_create(ctx, (size_t)m->n_vertices, xyz, (size_t)m->n_triangles,
                                         m->triangle, &other),
                         DMK_OK);
        dmk_geodesics *g = run(ctx, other, 1, &p, NULL);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            assert_true(fabs(g->distance[v] / scale[i] - one->distance[v]) < 1e-12);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&other);
        free(xyz);
    }
    dmk_geodesics_destroy(&one);
    dmk_mesh_destroy(&m);
}

/* The least offset of a component may be a billion times the mesh's extent, and no more; others may be of any size. */
static void offsets_beside_the_mesh(void **state)
{
    dmk_context *ctx = *state;
    dmk_surface_options surface;
    dmk_mesh *m;
    dmk_geodesics *g, *plain;
    dmk_geodesics_options options;
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "sphere";
    surface.n_triangles = 2000;
    assert_int_equal(dmk_mesh_surface(ctx, &surface, &m), DMK_OK);
    const dmk_point p[2] = {at_vertex(ctx, m, 0), at_vertex(ctx, m, 5)};
    plain = run(ctx, m, 2, p, NULL);
    const double unit = plain->star.unit, large = 0.75e9 * unit;
    g = run(ctx, m, 2, p, (double[]){large, large});
    for (int32_t v = 0; v < m->n_vertices; v++)
        assert_true(fabs(g->distance[v] - large - plain->distance[v]) < 1e-6);
    dmk_geodesics_destroy(&g);
    dmk_geodesics_destroy(&plain);
    plain = run(ctx, m, 1, p, NULL);
    g = run(ctx, m, 2, p, (double[]){0, 1e15});
    assert_memory_equal(g->distance, plain->distance, (size_t)m->n_vertices * sizeof *g->distance);
    dmk_geodesics_destroy(&g);
    dmk_geodesics_destroy(&plain);
    dmk_geodesics_options_init(&options, sizeof options);
    options.offset = (double[]){1.5e9 * unit, 1e15};
    assert_int_equal(dmk_geodesics_create(ctx, m, 2, p, &options, &g), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "source 0 has the offset "));
    assert_non_null(strstr(dmk_context_message(ctx), "subtract the least offset from all"));
    dmk_mesh_destroy(&m);
}

/* As many threads as there are: the same bits, of distances and of the ways. */
static void check_threads_with(dmk_context *ctx, const dmk_mesh *m, size_t n_points,
                               const dmk_point *p, const dmk_geodesics_options *options)
{
    const size_t n_vertices = (size_t)m->n_vertices;
    assert_int_equal(dmk_context_set_threads(ctx, 1), DMK_OK);
    dmk_geodesics *one = run_with(ctx, m, n_points, p, options);
    for (int n = 2; n <= 8; n++) {
        assert_int_equal(dmk_context_set_threads(ctx, n), DMK_OK);
        dmk_geodesics *g = run_with(ctx, m, n_points, p, options);
        assert_memory_equal(g->distance, one->distance, n_vertices * sizeof *g->distance);
        assert_memory_equal(g->arrival, one->arrival, n_vertices * sizeof *g->arrival);
        assert_int_equal(g->n_ties, one->n_ties);
        if (options->tolerance > 0)
            assert_memory_equal(g->error, one->error, n_vertices * sizeof *g->error);
        dmk_geodesics_destroy(&g);
    }
    dmk_geodesics_destroy(&one);
    dmk_context_set_threads(ctx, 0);
}

static void check_threads(dmk_context *ctx, const dmk_mesh *m, const dmk_point *p, double tolerance)
{
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = tolerance;
    check_threads_with(ctx, m, 1, p, &options);
}

/* A curve of n edges along the mesh, from vertex v, that never runs back at once: pairs of vertices. */
static void walk(const dmk_mesh *m, int32_t v, int n, int32_t *line)
{
    dmk_star star;
    dmk_context *ctx = NULL;
    int32_t before = -1;
    assert_int_equal(dmk_context_create(&ctx), DMK_OK);
    assert_int_equal(dmk_star_create(ctx, m, NULL, &star), DMK_OK);
    for (int i = 0; i < n; i++) {
        int32_t c = star.first[v];
        for (int k = 0; k < 1 + i * i % 5 || m->triangle[dmk_next(c)] == before; k++) {
            const int32_t next = dmk_star_next(&star, c);
            c = next < 0 ? star.first[v] : next;
        }
        before = line[2 * i] = v;
        v = line[2 * i + 1] = m->triangle[dmk_next(c)];
    }
    dmk_star_free(&star);
    dmk_context_destroy(&ctx);
}

/* By exact and by merged windows. */
static void any_number_of_threads(void **state)
{
    dmk_context *ctx = *state;
    dmk_surface_options surface;
    dmk_mesh *m;
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "quartic";
    surface.n_triangles = 30000;
    assert_int_equal(dmk_mesh_surface(ctx, &surface, &m), DMK_OK);
    const dmk_point p = {999, {0.2, 0.3, 0.5}};
    check_threads(ctx, m, &p, 0);
    check_threads(ctx, m, &p, 1e-6);
    int32_t line[2 * 30];
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.line = line, options.n_lines = 30;
    walk(m, 700, 30, line);
    check_threads_with(ctx, m, 1, &p, &options);
    dmk_mesh_destroy(&m);
}

/* A wavy grid, where parallel rays run along edges and through vertices, and many ways to a vertex are as long. */
static void curves_on_a_grid_and_any_number_of_threads(void **state)
{
    enum { N = 200, EDGES = 24, ALL = (N + 1) * (N + 1) };
    static double xyz[3 * ALL];
    static int32_t triangle[6 * N * N];
    int32_t line[2 * EDGES];
    dmk_context *ctx = *state;
    dmk_mesh *m;
    size_t n = 0;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.line = line, options.n_lines = EDGES;
    for (int32_t v = 0; v < ALL; v++) {
        const int32_t i = v % (N + 1), k = v / (N + 1), up = v + N + 1;
        const double x = i / (double)N, at[3] = {x, k / (double)N, 0.1 * sin(6 * x)};
        memcpy(xyz + 3 * v, at, sizeof at);
        if (i == N || k == N) continue;
        const int32_t two[6] = {v, v + 1, up + 1, v, up + 1, up};
        memcpy(triangle + 6 * n++, two, sizeof two);
    }
    assert_int_equal(dmk_mesh_create(ctx, ALL, xyz, 2 * n, triangle, &m), DMK_OK);
    walk(m, ALL / 3, EDGES, line);
    check_threads_with(ctx, m, 0, NULL, &options);
    dmk_mesh_destroy(&m);
}

/* A wavy strip of triangles 1,000 times as long as wide, where many ways to a vertex differ by rounding alone. */
static void thin_triangles_and_any_number_of_threads(void **state)
{
    enum { COLUMNS = 401, ROWS = 21, ALL = COLUMNS * ROWS };
    static double xyz[3 * ALL];
    static int32_t triangle[6 * (COLUMNS - 1) * (ROWS - 1)];
    dmk_context *ctx = *state;
    dmk_mesh *m;
    dmk_point p;
    size_t n = 0;
    for (int32_t v = 0; v < ALL; v++) {
        const int32_t i = v / ROWS, k = v % ROWS, next = v + ROWS;
        const double x = i / (COLUMNS - 1.0);
        memcpy(xyz + 3 * v, (double[]){x, 50 * (k / (ROWS - 1.0)), 0.02 * sin(9 * x)},
               3 * sizeof *xyz);
        if (i + 1 == COLUMNS || k + 1 == ROWS) continue;
        memcpy(triangle + 6 * n++, (int32_t[]){v, next, v + 1, v + 1, next, next + 1},
               6 * sizeof *triangle);
    }
    assert_int_equal(dmk_mesh_create(ctx, ALL, xyz, 2 * n, triangle, &m), DMK_OK);
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, 0, &p), DMK_OK);
    check_threads(ctx, m, &p, 0);
    dmk_mesh_destroy(&m);
}

/* Each triangle cut in four, flat: nothing changes. Vertex v keeps its number. */
static dmk_mesh *cut_in_four(dmk_context *ctx, const dmk_mesh *m)
{
    dmk_mesh *fine;
    size_t n_vertices = (size_t)m->n_vertices + (size_t)m->n_edges,
           n_triangles = 4 * (size_t)m->n_triangles;
    double *xyz = calloc(3 * n_vertices, sizeof *xyz);
    int32_t *triangle = calloc(3 * n_triangles, sizeof *triangle), *to = triangle;
    memcpy(xyz, m->xyz, 3 * (size_t)m->n_vertices * sizeof *xyz);
    for (int32_t e = 0; e < m->n_edges; e++) {
        for (int k = 0; k < 3; k++) {
            const double *a = m->xyz + 3 * m->edge_vertex[2 * e],
                         *b = m->xyz + 3 * m->edge_vertex[2 * e + 1];
            xyz[3 * (m->n_vertices + e) + k] = 0.5 * (a[k] + b[k]);
        }
    }
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * t, *e = m->triangle_edge + 3 * t, n = m->n_vertices;
        const int32_t four[12] = {v[0], n + e[2], n + e[1], v[1],     n + e[0], n + e[2],
                                  v[2], n + e[1], n + e[0], n + e[0], n + e[1], n + e[2]};
        memcpy(to, four, sizeof four);
        to += 12;
    }
    assert_int_equal(dmk_mesh_create(ctx, n_vertices, xyz, n_triangles, triangle, &fine), DMK_OK);
    free(xyz);
    free(triangle);
    return fine;
}

/* The same mesh, its vertices and triangles in the opposite order and the corners turned. */
static dmk_mesh *renumber(dmk_context *ctx, const dmk_mesh *m)
{
    dmk_mesh *other;
    const int32_t n = m->n_vertices, n_t = m->n_triangles;
    double *xyz = calloc(3 * (size_t)n, sizeof *xyz);
    int32_t *triangle = calloc(3 * (size_t)n_t, sizeof *triangle);
    for (int32_t v = 0; v < n; v++) memcpy(xyz + 3 * (n - 1 - v), m->xyz + 3 * v, 3 * sizeof *xyz);
    for (int32_t t = 0; t < n_t; t++) {
        for (int k = 0; k < 3; k++)
            triangle[3 * (n_t - 1 - t) + (k + 1) % 3] = n - 1 - m->triangle[3 * t + k];
    }
    assert_int_equal(dmk_mesh_create(ctx, (size_t)n, xyz, (size_t)n_t, triangle, &other), DMK_OK);
    free(xyz);
    free(triangle);
    return other;
}

/* The surface is what counts, not its triangles nor their numbers. */
static void another_mesh_of_the_surface(void **state)
{
    dmk_context *ctx = *state;
    static const char *const file[] = {"meshes/torus.off", "meshes/ellipsoid.off"};
    for (int i = 0; i < 2; i++) {
        dmk_mesh *m;
        assert_int_equal(dmk_mesh_read(ctx, file[i], &m), DMK_OK);
        dmk_mesh *fine = cut_in_four(ctx, m), *other = renumber(ctx, m);
        const int32_t n = m->n_vertices;
        dmk_point p = at_vertex(ctx, m, 11), q = at_vertex(ctx, fine, 11),
                  r = at_vertex(ctx, other, n - 1 - 11);
        dmk_geodesics *a = run(ctx, m, 1, &p, NULL), *b = run(ctx, fine, 1, &q, NULL),
                      *c = run(ctx, other, 1, &r, NULL);
        for (int32_t v = 0; v < n; v++) {
            assert_true(fabs(a->distance[v] - b->distance[v]) <= 1e-12 * (1 + a->distance[v]));
            assert_true(fabs(a->distance[v] - c->distance[n - 1 - v]) <=
                        1e-12 * (1 + a->distance[v]));
        }
        dmk_geodesics_destroy(&a);
        dmk_geodesics_destroy(&b);
        dmk_geodesics_destroy(&c);
        dmk_mesh_destroy(&m);
        dmk_mesh_destroy(&fine);
        dmk_mesh_destroy(&other);
    }
}

/* From a curve, too, and these by exact windows. */
static void another_mesh_around_a_curve(void **state)
{
    enum { N = 25 };
    dmk_context *ctx = *state;
    dmk_mesh *m;
    int32_t line[2 * N], halves[4 * N];
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    assert_int_equal(dmk_mesh_read(ctx, "meshes/torus.off", &m), DMK_OK);
    dmk_mesh *fine = cut_in_four(ctx, m);
    walk(m, 11, N, line);
    for (int i = 0; i < N; i++) {
        int32_t e = 0;
        const int32_t a = line[2 * i], b = line[2 * i + 1], *v = m->edge_vertex;
        while (!((v[2 * e] == a && v[2 * e + 1] == b) || (v[2 * e] == b && v[2 * e + 1] == a))) e++;
        const int32_t both[4] = {a, m->n_vertices + e, m->n_vertices + e, b};
        memcpy(halves + 4 * i, both, sizeof both);
    }
    options.line = line, options.n_lines = N;
    dmk_geodesics *a = run_with(ctx, m, 0, NULL, &options);
    options.line = halves, options.n_lines = 2 * N;
    dmk_geodesics *b = run_with(ctx, fine, 0, NULL, &options);
    for (int32_t v = 0; v < m->n_vertices; v++)
        assert_true(fabs(a->distance[v] - b->distance[v]) <= 1e-13 * (1 + a->distance[v]));
    dmk_geodesics_destroy(&a);
    dmk_geodesics_destroy(&b);
    dmk_mesh_destroy(&m);
    dmk_mesh_destroy(&fine);
}

/* ---- paths and values ------------------------------------------------------------------------ */

/* Length of the line through a path's points, which must be the one that it names. */
static void check_line(dmk_context *ctx, const dmk_mesh *m, const dmk_path *path)
{
    double x[3], y[3], sum = 0;
    assert_true(path->n >= 2);
    for (size_t i = 0; i < path->n; i++) {
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, path->point + i, y), DMK_OK);
        if (i > 0) sum += sqrt(pow(x[0] - y[0], 2) + pow(x[1] - y[1], 2) + pow(x[2] - y[2], 2));
        memcpy(x, y, sizeof x);
    }
    assert_true(fabs(sum - path->length) <= 1e-12 * (1 + sum));
}

/* The log map is that of the traced paths: from a vertex, an edge and inside a triangle, on a mesh with saddles. */
static void paths_are_the_log_map(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_read(ctx, "meshes/torus.off", &m), DMK_OK);
    const dmk_point source[3] = {{10, {1, 0, 0}}, {999, {0.2, 0.3, 0.5}}, {77, {0.6, 0, 0.4}}};
    for (int i = 0; i < 3; i++) {
        int n_bent = 0;
        dmk_geodesics *g = run(ctx, m, 1, source + i, NULL);
        for (int32_t v = 3; v < m->n_vertices; v += 41) {
            dmk_path path;
            dmk_value value;
            const dmk_point p = at_vertex(ctx, m, v);
            assert_int_equal(dmk_geodesics_paths(ctx, g, 1, &p, &path), DMK_OK);
            check_line(ctx, m, &path);
            assert_true(fabs(path.length - g->distance[v]) < 1e-12);
            double turn = remainder(path.angle - g->arrival[v].direction, g->source[0].total);
            assert_true(fabs(turn) < 1e-9);
            assert_int_equal(dmk_geodesics_at(ctx, g, 1, &p, &value), DMK_OK);
            assert_true(value.distance == g->distance[v] && value.source == 0);
            n_bent += g->arrival[v].pseudo_source >= 0;
            dmk_path_free(&path);
        }
        assert_true(n_bent > 0);
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* The same mesh with triangle `first` as number 0, the others behind it, their corners turned; of a point too. */
static dmk_mesh *rotate(dmk_context *ctx, const dmk_mesh *m, int32_t first, dmk_point *p)
{
    dmk_mesh *other;
    const int32_t n_t = m->n_triangles;
    int32_t *triangle = calloc(3 * (size_t)n_t, sizeof *triangle);
    for (int32_t t = 0; t < n_t; t++) {
        const int32_t old = (t + first) % n_t;
        for (int k = 0; k < 3; k++) triangle[3 * t + (k + first) % 3] = m->triangle[3 * old + k];
    }
    assert_int_equal(
        dmk_mesh_create(ctx, (size_t)m->n_vertices, m->xyz, (size_t)n_t, triangle, &other), DMK_OK);
    const dmk_point old = *p;
    p->triangle = (old.triangle + n_t - first) % n_t;
    for (int k = 0; k < 3; k++) p->weight[(k + first) % 3] = old.weight[k];
    free(triangle);
    return other;
}

/* In the triangle of the source paths are straight. */
static void check_own_triangle(dmk_context *ctx, const dmk_geodesics *g, const dmk_point *source)
{
    static const double weights[3][3] = {{0.5, 0.2, 0.3}, {0.1, 0.1, 0.8}, {0.1, 0.7, 0.2}};
    double x[3], y[3];
    assert_int_equal(dmk_mesh_point_xyz(ctx, g->mesh, source, x), DMK_OK);
    for (int i = 0; i < 3; i++) {
        dmk_path path[2], untouched; /* a call for one path leaves the next place alone */
        memset(path, 0x5a, sizeof path);
        memset(&untouched, 0x5a, sizeof untouched);
        const dmk_point end[2] = {{source->triangle, {weights[i][0], weights[i][1], weights[i][2]}},
                                  *source};
        assert_int_equal(dmk_mesh_point_xyz(ctx, g->mesh, end, y), DMK_OK);
        assert_int_equal(dmk_geodesics_paths(ctx, g, 1, end, path), DMK_OK);
        assert_true(fabs(path[0].length - hypot(x[0] - y[0], x[1] - y[1])) < 1e-12);
        assert_memory_equal(&path[1], &untouched, sizeof untouched);
        dmk_path_free(path);
    }
}

/* Needles with angles of 1e-6: the small ones to all digits, wherever the long side is. */
static void angles_of_needles(void **state)
{
    dmk_context *ctx = *state;
    const double h = 1e-6, xyz[] = {0, 0, 0, 1, 0, 0, 0.25, h, 0};
    for (int turn = 0; turn < 3; turn++) {
        const int32_t triangle[3] = {turn, (turn + 1) % 3, (turn + 2) % 3};
        dmk_mesh *m;
        assert_int_equal(dmk_mesh_create(ctx, 3, xyz, 1, triangle, &m), DMK_OK);
        const dmk_point source = at_vertex(ctx, m, 0);
        dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
        const double left = atan(4 * h), right = atan(h / 0.75),
                     exact[] = {left, right, pi - left - right};
        for (int k = 0; k < 3; k++) {
            const double angle = g->star.corner_angle[k];
            assert_true(fabs(angle / exact[triangle[k]] - 1) < 1e-12);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Whichever triangle is number 0: a plane with two reentrant corners, from inside a triangle, from an edge and a
 * vertex; distances and paths of all vertices. */
static void any_triangle_may_be_the_first(void **state)
{
    dmk_context *ctx = *state;
    static const double at[5][3] = {{0, 1, 0}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 1, 0}},
                        x[3] = {1, 0, 0}, y[3] = {0, 1, 0};
    uint32_t noisy = 7;
    soup *s = new_soup();
    for (int i = 0; i < 5; i++) add_grid(s, at[i], x, y, 2, 2, 0.3, &noisy);
    dmk_mesh *m = finish(ctx, s);
    const dmk_point source[3] = {{6, {0.2, 0.3, 0.5}}, {7, {0.6, 0, 0.4}}, at_vertex(ctx, m, 7)};
    for (int i = 0; i < 3; i++) {
        dmk_geodesics *g = run(ctx, m, 1, source + i, NULL);
        int n_bent = 0;
        for (int32_t first = 0; first < m->n_triangles; first++) {
            dmk_point p = source[i];
            dmk_mesh *other = rotate(ctx, m, first, &p);
            dmk_geodesics *h = run(ctx, other, 1, &p, NULL);
            for (int32_t v = 0; v < m->n_vertices; v++) {
                dmk_path path;
                const dmk_point end = at_vertex(ctx, other, v);
                assert_true(fabs(g->distance[v] - h->distance[v]) < 1e-12);
                n_bent += h->arrival[v].pseudo_source >= 0;
                assert_int_equal(dmk_geodesics_paths(ctx, h, 1, &end, &path), DMK_OK);
                assert_true(fabs(path.length - g->distance[v]) < 1e-12);
                if (g->distance[v] > 0) check_line(ctx, other, &path);
                dmk_path_free(&path);
            }
            check_own_triangle(ctx, h, &p);
            const dmk_geodesics_options near = {.struct_size = sizeof near, .tolerance = 1e-6};
            dmk_geodesics *merged = run_with(ctx, other, 1, &p, &near);
            for (int32_t v = 0; v < m->n_vertices; v++)
                assert_true(fabs(g->distance[v] - merged->distance[v]) < 1e-5);
            dmk_geodesics_destroy(&merged);
            dmk_geodesics_destroy(&h);
            dmk_mesh_destroy(&other);
        }
        assert_true(n_bent > 5 * m->n_triangles);
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* Inside triangles: what the geodesics from there give at the source. */
static void values_inside_triangles(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_read(ctx, "meshes/quartic.off", &m), DMK_OK);
    const dmk_point source = at_vertex(ctx, m, 0);
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    for (int i = 0; i < 12; i++) {
        const dmk_point p = {(i * 389 + 5) % m->n_triangles, {0.1 + 0.05 * i, 0, 0}};
        dmk_point q = p;
        dmk_value value;
        q.weight[1] = i % 3 == 0 ? 0 : 0.4 * (1 - q.weight[0]);
        q.weight[2] = 1 - q.weight[0] - q.weight[1];
        assert_int_equal(dmk_geodesics_at(ctx, g, 1, &q, &value), DMK_OK);
        dmk_geodesics *back = run(ctx, m, 1, &q, NULL);
        assert_true(fabs(value.distance - back->distance[0]) < 1e-12);
        dmk_geodesics_destroy(&back);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Where no source leads the distance is infinite, and no path is found. */
/* Also where a source lies between the corners: on the border, all of whose points are sources, and close together in
 * one triangle. The paths are as long. */
static void values_between_sources(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_square(ctx, 5, 0.5);
    const dmk_point source[] = {
        {24, {0.8, 0.1, 0.1}}, {24, {0.1, 0.8, 0.1}}, {25, {0.3, 0.3, 0.4}}};
    double at[3][3];
    uint32_t random = 17;
    for (int i = 0; i < 3; i++)
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i, at[i]), DMK_OK);
    for (int border = 0; border < 2; border++) {
        dmk_geodesics_options options;
        dmk_geodesics_options_init(&options, sizeof options);
        options.border = border;
        dmk_geodesics *g = run_with(ctx, m, border ? 0 : 3, source, &options);
        for (int i = 0; i < 500; i++) {
            double a = noise(&random) + 0.5, b = i % 5 == 0 ? 0 : noise(&random) + 0.5, x[3];
            if (a + b > 1) a = 1 - a, b = b > 0 ? 1 - b : 0;
            dmk_point p = {.triangle = i % m->n_triangles};
            const double w[3] = {a, b, 1 - a - b};
            for (int k = 0; k < 3; k++) p.weight[(k + i) % 3] = w[k]; /* any side */
            dmk_value value;
            dmk_path path;
            assert_int_equal(dmk_mesh_point_xyz(ctx, m, &p, x), DMK_OK);
            assert_int_equal(dmk_geodesics_at(ctx, g, 1, &p, &value), DMK_OK);
            double d = fmin(fmin(x[0], 1 - x[0]), fmin(x[1], 1 - x[1]));
            for (int k = 0; k < 3 && !border; k++)
                d = fmin(k == 0 ? 9 : d, hypot(x[0] - at[k][0], x[1] - at[k][1]));
            assert_true(fabs(value.distance - d) < 1e-13);
            assert_int_equal(dmk_geodesics_paths(ctx, g, 1, &p, &path), DMK_OK);
            assert_true(fabs(path.length - d) < 1e-12);
            dmk_path_free(&path);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

static void several_components(void **state)
{
    dmk_context *ctx = *state;
    static const double at[2][3] = {{0, 0, 0}, {0, 0, 5}}, x[3] = {1, 0, 0}, y[3] = {0, 1, 0};
    uint32_t noisy = 1;
    soup *s = new_soup();
    add_grid(s, at[0], x, y, 3, 3, 0.3, &noisy);
    int32_t first = s->n_vertices, t = s->n_triangles;
    add_grid(s, at[1], x, y, 4, 4, 0.3, &noisy);
    dmk_mesh *m = finish(ctx, s);
    const dmk_point source = at_vertex(ctx, m, 2), other = {t, {0.3, 0.3, 0.4}};
    dmk_geodesics *g = run_with(ctx, m, 1, &source, NULL);
    dmk_geodesics_info info;
    dmk_path path;
    dmk_value value;
    for (int32_t v = 0; v < m->n_vertices; v++) {
        assert_true(isinf(g->distance[v]) == (v >= first));
        assert_int_equal(g->arrival[v].source, v >= first ? -1 : 0);
    }
    double *mid = calloc((size_t)m->n_edges, sizeof *mid);
    dmk_geodesics_midpoints(ctx, g, mid);
    for (int32_t e = 0; e < m->n_edges; e++)
        assert_true(isinf(mid[e]) == (m->edge_vertex[2 * e] >= first));
    free(mid);
    dmk_geodesics_get_info(g, &info);
    assert_int_equal(info.n_reached, first);
    assert_int_equal(dmk_geodesics_at(ctx, g, 1, &other, &value), DMK_OK);
    assert_true(isinf(value.distance) && value.source == -1);
    assert_int_equal(dmk_geodesics_paths(ctx, g, 1, &other, &path), DMK_E_ARG);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* What rounding or an error would do to a result is found, with the vertex. */
static void wrong_distances_are_found(void **state)
{
    dmk_context *ctx = *state;
    static const double wrong[3] = {-1e-9, INFINITY, 3};
    static const char *const message[3] = {"vertex 40 is negative", "reached vertex 40",
                                           "distances of vertices"};
    dmk_mesh *m = make_square(ctx, 8, 0.2);
    const dmk_point source = at_vertex(ctx, m, 2);
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    for (int i = 0; i < 3; i++) {
        const double right = g->distance[40];
        g->distance[40] = wrong[i];
        assert_int_equal(dmk_geodesics_check(ctx, g), DMK_E_MESH);
        assert_non_null(strstr(dmk_context_message(ctx), message[i]));
        g->distance[40] = right;
    }
    assert_int_equal(dmk_geodesics_check(ctx, g), DMK_OK);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Of the distance to a corner of the unit square. */
static double integral_from_corner(void)
{
    return (sqrt(2) + log(1 + sqrt(2))) / 3;
}

/* On n by m squares of two triangles each within the unit square, from weights w in the first triangle. */
static void integrate_coarse(dmk_context *ctx, int n, int m, const double w[3], double *integral,
                             double *error)
{
    static const double o[3] = {0}, p[3] = {1, 0, 0}, q[3] = {0, 1, 0};
    uint32_t state = 5;
    soup *s = new_soup();
    add_grid(s, o, p, q, n, m, 0, &state);
    dmk_mesh *mesh = finish(ctx, s);
    const dmk_point source = {0, {w[0], w[1], w[2]}};
    dmk_geodesics *g = run(ctx, mesh, 1, &source, NULL);
    assert_int_equal(dmk_geodesics_integrate(ctx, g, integral, error), DMK_OK);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&mesh);
}

/* Where the triangles are too coarse for an estimate of a thousandth it is that of finer ones. */
static void integral_on_coarse_meshes(void **state)
{
    static const double corner[3] = {1, 0, 0}, middle[3] = {0.5, 0, 0.5};
    double integral, error;
    integrate_coarse(*state, 1, 1, middle, &integral, &error);
    assert_true(fabs(integral - integral_from_corner() / 2) <= error && error < 1e-4);
    integrate_coarse(*state, 2, 3, corner, &integral, &error); /* 1.5e-3 of it */
    assert_true(fabs(integral - integral_from_corner()) <= error && error < 1e-4);
    integrate_coarse(*state, 3, 3, corner, &integral, &error); /* 0.8e-3 */
    assert_true(fabs(integral - integral_from_corner()) <= error && error > 5e-4);
}

/* The integral against that of hypot(x, y) over the square, within its own estimate. */
static void integral_of_the_distance(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_square(ctx, 12, 0.4);
    const dmk_point source = at_vertex(ctx, m, 0);
    const double exact = integral_from_corner();
    double integral, error;
    dmk_geodesics *g = run(ctx, m, 1, &source, NULL);
    assert_int_equal(dmk_geodesics_integrate(ctx, g, &integral, &error), DMK_OK);
    assert_true(fabs(integral - exact) <= error && error < 1e-3);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* ---- merged windows and lines ---------------------------------------------------------------- */

/* With a tolerance: within it but for single vertices, fewer windows, and an estimate that means something.
 */
static void merged_windows(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m;
    dmk_geodesics_options options;
    dmk_geodesics_info info;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = 1e-5;
    assert_int_equal(dmk_mesh_read(ctx, "meshes/torus.off", &m), DMK_OK);
    const dmk_point source[2] = {{10, {1, 0, 0}}, {999, {0.2, 0.3, 0.5}}};
    for (int i = 0; i < 2; i++) {
        dmk_geodesics *exact = run(ctx, m, 1, source + i, NULL);
        dmk_geodesics *merged = run_with(ctx, m, 1, source + i, &options);
        const double *error = dmk_geodesics_error(merged, NULL);
        assert_non_null(error);
        assert_null(dmk_geodesics_error(exact, NULL));
        for (int32_t v = 0; v < m->n_vertices; v++) {
            double off = fabs(merged->distance[v] - exact->distance[v]);
            assert_true(off <= 3e-5 * exact->distance[v] + 1e-14);
            assert_true(error[v] >= 0 && error[v] < 1e-3);
        }
        dmk_geodesics_get_info(merged, &info);
        assert_true(info.error > 1e-7 && info.error < 1e-3);
        size_t n_beyond = 0;
        for (int32_t v = 0; v < m->n_vertices; v++)
            n_beyond += error[v] > options.tolerance * merged->distance[v];
        assert_true(n_beyond > 0 && info.n_beyond == n_beyond && info.tolerance == 1e-5);
        dmk_geodesics_get_info(exact, &info);
        assert_true(info.n_beyond == 0 && info.tolerance == 0);
        assert_true((size_t)merged->n_windows < info.n_windows);
        dmk_geodesics_destroy(&exact);
        dmk_geodesics_destroy(&merged);
    }
    dmk_mesh_destroy(&m);
}

/* Directions at each of several sources close up there, with a tolerance, too: in a flat square they are those of the
 * plane, counted from the first corner of the source's triangle. */
static void directions_at_several_sources(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_square(ctx, 24, 0.4);
    dmk_point source[5];
    double at[5][3], corner[5];
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = 1e-4;
    for (int i = 0; i < 5; i++) {
        source[i] = (dmk_point){m->n_triangles * (2 * i + 1) / 11, {0.2, 0.3, 0.5}};
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i, at[i]), DMK_OK);
        const double *first = m->xyz + 3 * m->triangle[3 * source[i].triangle];
        corner[i] = atan2(first[1] - at[i][1], first[0] - at[i][0]);
    }
    dmk_geodesics *g = run_with(ctx, m, 5, source, &options);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const int32_t i = g->arrival[v].source;
        const double turn = atan2(m->xyz[3 * v + 1] - at[i][1], m->xyz[3 * v] - at[i][0]);
        assert_true(fabs(remainder(g->arrival[v].direction - turn + corner[i], 2 * pi)) < 0.02);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A flat fan: short and long triangles around vertex 0. */
static dmk_mesh *make_fan(dmk_context *ctx, int n, uint32_t *random)
{
    soup *s = new_soup();
    double step[16], sum = 0, angle = 0;
    for (int i = 0; i < n; i++) sum += step[i] = noise(random) + 0.5;
    s->n_vertices = 1;
    for (int i = 0; i < n; i++) {
        const double radius = exp(3 * (noise(random) + noise(random) + noise(random)));
        const double x[3] = {radius * cos(angle), radius * sin(angle), 0};
        memcpy(s->xyz + 3 * s->n_vertices++, x, sizeof x);
        angle += 2 * pi * step[i] / sum;
        add_triangle(s, 0, i + 1, (i + 1) % n + 1);
    }
    return finish(ctx, s);
}

/* With a tolerance: where short triangles meet long ones, too, errors are hardly above their estimates. */
static void estimates_in_fans(void **state)
{
    dmk_context *ctx = *state;
    enum { N = 6, RUNS = 4000 };
    uint32_t random = 1;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.tolerance = 1e-6;
    for (int i = 0; i < RUNS; i++) {
        dmk_mesh *m = make_fan(ctx, N, &random);
        const double a = noise(&random) + 0.5, b = (noise(&random) + 0.5) * (1 - a);
        const dmk_point source = {i % N, {a, b, 1 - a - b}};
        dmk_geodesics *exact = run(ctx, m, 1, &source, NULL);
        dmk_geodesics *merged = run_with(ctx, m, 1, &source, &options);
        const double *error = dmk_geodesics_error(merged, NULL);
        for (int32_t v = 0; v <= N; v++) {
            const double off = fabs(merged->distance[v] - exact->distance[v]);
            assert_true(off <= 2 * error[v] + 1e-11 * exact->distance[v]);
        }
        dmk_geodesics_destroy(&exact);
        dmk_geodesics_destroy(&merged);
        dmk_mesh_destroy(&m);
    }
}

/* Terrain of random heights, 0.1 to 1e4 times as high as its edges are long. */
static dmk_mesh *make_terrain(dmk_context *ctx, int n, uint32_t *random)
{
    static const double o[3] = {0}, p[3] = {1, 0, 0}, q[3] = {0, 1, 0};
    soup *s = new_soup();
    add_grid(s, o, p, q, n, n, 0, random);
    const double height = pow(10, 1.5 + 5 * noise(random)) / n;
    for (int32_t v = 0; v < s->n_vertices; v++) s->xyz[3 * v + 2] = height * noise(random);
    return finish(ctx, s);
}

/* Merged windows alone, with a tolerance of 1e-8 to 1e-3: the largest error over its estimate; *large: the largest
 * estimate over the largest error. Estimates are no bounds, but what has none is exact. */
static double compare_estimates(dmk_context *ctx, const dmk_mesh *m, uint32_t *random,
                                double *large)
{
    bool finished;
    double worst = 0, error = 0, estimate = 0, farthest = 0;
    dmk_geodesics *merged;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.exact = 1;
    const dmk_point source = at_vertex(ctx, m, m->n_vertices / 3);
    dmk_geodesics *exact = run_with(ctx, m, 1, &source, &options);
    assert_int_equal(dmk_geodesics_prepare(ctx, m, NULL, 1, &source, &options, &merged), DMK_OK);
    assert_int_equal(
        dmk_waves_run(ctx, merged, pow(10, -5.5 + 5 * noise(random)), 0, 1000, INT_MAX, &finished),
        DMK_OK);
    assert_true(finished);
    for (int32_t v = 0; v < m->n_vertices; v++) farthest = fmax(farthest, exact->distance[v]);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double off = fabs(merged->distance[v] - exact->distance[v]);
        worst = fmax(worst, off / (merged->error[v] + 1e-12 * farthest));
        error = fmax(error, off);
        estimate = fmax(estimate, merged->error[v]);
    }
    *large = estimate / (error + 1e-12 * farthest);
    dmk_geodesics_destroy(&exact);
    dmk_geodesics_destroy(&merged);
    return worst;
}

/* Windows of a run that more than `over` vertices over the tolerance end. */
static int64_t count_windows(dmk_context *ctx, const dmk_mesh *m, double tolerance, int over,
                             bool finishes)
{
    bool finished;
    dmk_geodesics *merged;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    const dmk_point source = at_vertex(ctx, m, 7);
    assert_int_equal(dmk_geodesics_prepare(ctx, m, NULL, 1, &source, &options, &merged), DMK_OK);
    assert_int_equal(dmk_waves_run(ctx, merged, tolerance, 0, 1000, over, &finished), DMK_OK);
    assert_int_equal(finished, finishes);
    const int64_t n = merged->n_windows;
    dmk_geodesics_destroy(&merged);
    return n;
}

/* Where merging misses the tolerance it ends early, and others get their turn. One vertex does on the first mesh; some
 * at the front of the second, but none behind it. */
static void merging_that_is_no_use_ends_early(void **state)
{
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_read(*state, "tests/data/triple_torus.off.gz", &m), DMK_OK);
    const int64_t all = count_windows(*state, m, 1e-6, INT_MAX, true),
                  few = count_windows(*state, m, 1e-6, 0, false);
    assert_in_range(few, 1, all - 1);
    dmk_mesh_destroy(&m);
    assert_int_equal(dmk_mesh_read(*state, "tests/data/quartic_5000.off.gz", &m), DMK_OK);
    assert_true(count_windows(*state, m, 1e-6, 0, true) ==
                count_windows(*state, m, 1e-6, INT_MAX, true));
    dmk_mesh_destroy(&m);
}

/* On terrain, where many ways are nearly the shortest: what one that is longer by less than its error hides is in the
 * estimate; and estimates remain of the errors' size. */
static void estimates_on_terrain(void **state)
{
    enum { RUNS = 200 };
    uint32_t random = 3;
    double sum = 0, most = 0;
    for (int i = 0; i < RUNS; i++) {
        double large;
        dmk_mesh *m = make_terrain(*state, 6 + i % 20, &random);
        most = fmax(most, compare_estimates(*state, m, &random, &large));
        sum += log10(fmax(large, 1e-3));
        dmk_mesh_destroy(&m);
    }
    assert_true(most < 100);
    assert_true(sum < RUNS);
}

/* No error is beyond its estimate, or hardly, on terrain of n x n squares. */
static void check_estimates(dmk_context *ctx, int n, uint32_t seed)
{
    double large;
    dmk_mesh *m = make_terrain(ctx, n, &seed);
    assert_true(compare_estimates(ctx, m, &seed, &large) < 1.5);
    dmk_mesh_destroy(&m);
}

/* A way with an error comes late to a vertex that has radiated already: all behind it share the error. */
static void estimates_behind_bends(void **state)
{
    check_estimates(*state, 21, 154240091);
    check_estimates(*state, 15, 2169486056);
}

/* Where rays may run on into wider gaps, or into all of them, errors are 45 or 11 times the estimates; where not even
 * into all that are this wide, four times. */
static void estimates_beside_shadows(void **state)
{
    check_estimates(*state, 25, 589751647);
    check_estimates(*state, 20, 3566719978);
    check_estimates(*state, 25, 1467114655);
}

/* From the border of a square, and from a line through it. */
static void lines(void **state)
{
    dmk_context *ctx = *state;
    dmk_geodesics_options options;
    dmk_mesh *m = make_square(ctx, 8, 0);
    dmk_geodesics_options_init(&options, sizeof options);
    options.border = 1;
    dmk_geodesics *g = run_with(ctx, m, 0, NULL, &options);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double x = m->xyz[3 * v], y = m->xyz[3 * v + 1];
        assert_true(fabs(g->distance[v] - fmin(fmin(x, 1 - x), fmin(y, 1 - y))) < 1e-13);
        assert_true(g->arrival[v].source == 0);
    }
    dmk_geodesics_destroy(&g);
    options.border = 0;
    options.n_lines = 3; /* y = 1/2, x from 1/4 to 1/2; one edge twice */
    options.line =
        (const int32_t[]){9 * 4 + 4, 9 * 4 + 3, 9 * 4 + 2, 9 * 4 + 3, 9 * 4 + 3, 9 * 4 + 4};
    const dmk_point far = {0, {1, 0, 0}};
    g = run_with(ctx, m, 1, &far, &options);
    assert_int_equal(g->n_lines, 4);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const double x = m->xyz[3 * v], y = m->xyz[3 * v + 1];
        double line = hypot(y - 0.5, fmax(0, fmax(0.25 - x, x - 0.5))),
               best = fmin(line, hypot(x, y));
        assert_true(fabs(g->distance[v] - best) < 1e-13);
        if (fabs(line - hypot(x, y)) > 1e-9)
            assert_int_equal(g->arrival[v].source, line < hypot(x, y));
    }
    dmk_geodesics_destroy(&g);
    options.n_lines = 2;
    options.line = (const int32_t[]){0, 1, 1, 20};
    assert_int_equal(dmk_geodesics_create(ctx, m, 0, NULL, &options, &g), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "vertices 1 and 20"));
    dmk_mesh_destroy(&m);
}

/* Where the line from a to b is nearest to x: the distance, and at which part of it. */
static double to_segment(const double *a, const double *b, const double *x, double *part)
{
    const double ux = b[0] - a[0], uy = b[1] - a[1];
    *part = ((x[0] - a[0]) * ux + (x[1] - a[1]) * uy) / (ux * ux + uy * uy);
    *part = fmin(1, fmax(0, *part));
    return hypot(x[0] - a[0] - *part * ux, x[1] - a[1] - *part * uy);
}

/* The nearest of curves and points of a square, by looking at all. */
typedef struct nearest {
    double d, second; /* second: of another source, another edge, or the other way to be at one */
    int32_t source, vertex; /* vertex: of the curves that is nearest, or -1 */
} nearest;

static void offer(nearest *n, double d, int32_t source, int32_t vertex)
{
    if (source == n->source && vertex == n->vertex && vertex >= 0 && fabs(d - n->d) < 1e-9) return;
    n->second = fmin(n->second, fmax(d, n->d));
    if (d < n->d) n->d = d, n->source = source, n->vertex = vertex;
}

static nearest look_at_all(const dmk_mesh *m, const dmk_geodesics_options *o, int n_points,
                           double at[][3], const double *x)
{
    nearest n = {HUGE_VAL, HUGE_VAL, -1, -1};
    for (int32_t i = 0; i < n_points; i++)
        offer(&n, o->offset[i] + hypot(x[0] - at[i][0], x[1] - at[i][1]), i, -1);
    for (size_t i = 0; i < o->n_lines; i++) {
        const int32_t a = o->line[2 * i], b = o->line[2 * i + 1];
        double part;
        const double d = to_segment(m->xyz + 3 * a, m->xyz + 3 * b, x, &part);
        offer(&n, d, n_points, part == 0 ? a : part == 1 ? b : -1);
    }
    return n;
}

/* Distance, source, last vertex and path of a point. */
static void check_nearest(dmk_context *ctx, const dmk_geodesics *g, const dmk_geodesics_options *o,
                          double at[][3], const dmk_point *p)
{
    double x[3], from[3];
    dmk_value value;
    dmk_path path;
    assert_int_equal(dmk_mesh_point_xyz(ctx, g->mesh, p, x), DMK_OK);
    const nearest n = look_at_all(g->mesh, o, g->n_sources, at, x);
    assert_int_equal(dmk_geodesics_at(ctx, g, 1, p, &value), DMK_OK);
    assert_int_equal(dmk_geodesics_paths(ctx, g, 1, p, &path), DMK_OK);
    assert_int_equal(dmk_mesh_point_xyz(ctx, g->mesh, path.point, from), DMK_OK);
    assert_true(fabs(value.distance - n.d) < 1e-13);
    if (n.second > n.d + 1e-9) {
        const double offset = n.source < g->n_sources ? o->offset[n.source] : 0;
        assert_int_equal(value.source, n.source);
        assert_true(fabs(path.length + offset - n.d) < 1e-12);
        assert_true(fabs(hypot(from[0] - x[0], from[1] - x[1]) + offset - n.d) < 1e-12);
        if (n.source == g->n_sources) assert_true(value.direction == 0 && path.angle == 0);
    }
    dmk_path_free(&path);
}

/* From curves that bend, cross and end anywhere, and points beside them, in a flat square: vertices, values and paths
 * are those of the nearest place. Vertices of curves are where paths around them last bend, and lie side by side with
 * what leaves their edges at right angles. */
static void curves_in_a_square(void **state)
{
    enum { N = 7, EDGES = 8, RUNS = 60 };
    dmk_context *ctx = *state;
    uint32_t random = 7;
    int n_round = 0, n_straight = 0;
    dmk_mesh *m = make_square(ctx, N, 0.5);
    for (int run = 0; run < RUNS; run++) {
        const int n = run % 3;
        int32_t line[2 * EDGES];
        double at[2][3], offset[2] = {0, 0.1};
        dmk_point source[2];
        dmk_geodesics_options options;
        dmk_geodesics_options_init(&options, sizeof options);
        options.offset = offset;
        options.line = line, options.n_lines = EDGES;
        const double vertex = (noise(&random) + 0.5) * m->n_vertices;
        walk(m, (int32_t)vertex, EDGES, line);
        for (int i = 0; i < n; i++) {
            source[i] =
                (dmk_point){(int64_t)((noise(&random) + 0.5) * m->n_triangles), {0.2, 0.3, 0.5}};
            assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i, at[i]), DMK_OK);
        }
        dmk_geodesics *g = run_with(ctx, m, (size_t)n, source, &options);
        assert_null(g->error);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const dmk_arrival *a = g->arrival + v;
            const dmk_point p = at_vertex(ctx, m, v);
            const nearest best = look_at_all(m, &options, n, at, m->xyz + 3 * v);
            check_nearest(ctx, g, &options, at, &p);
            if (best.source < n || best.d == 0 || best.second < best.d + 1e-9) continue;
            if (g->star.border[v]) continue; /* along it paths bend at each vertex */
            assert_int_equal(a->pseudo_source, best.vertex);
            n_round += best.vertex >= 0, n_straight += best.vertex < 0;
        }
        for (int i = 0; i < 40; i++) {
            const double a = noise(&random) + 0.5, b = (noise(&random) + 0.5) * (1 - a);
            const dmk_point p = {i * 2 % m->n_triangles, {a, b, 1 - a - b}};
            check_nearest(ctx, g, &options, at, &p);
        }
        dmk_geodesics_destroy(&g);
    }
    assert_true(n_round > 100 && n_straight > 100);
    dmk_mesh_destroy(&m);
}

/* Heights over a tube's lower rim; over both, and inside a cone from its rim, in which slice the nearest edge is. */
static void from_rims(void **state)
{
    dmk_context *ctx = *state;
    static const double lift[][2] = {{0.3, 0.3}, {-0.7, 0.7}};
    int32_t line[2 * 100];
    dmk_geodesics_options options;
    dmk_mesh *m = make_tube(ctx, 2);
    for (int both = 0; both < 2; both++) {
        dmk_geodesics_options_init(&options, sizeof options);
        options.border = both;
        for (int32_t e = 0; e < m->n_edges && !both; e++) {
            const int32_t *v = m->edge_vertex + 2 * e;
            if (m->xyz[3 * v[0] + 2] > 0 || m->xyz[3 * v[1] + 2] > 0) continue;
            memcpy(line + 2 * options.n_lines++, v, 2 * sizeof *v);
        }
        options.line = line;
        dmk_geodesics *g = run_with(ctx, m, 0, NULL, &options);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double z = m->xyz[3 * v + 2];
            assert_true(fabs(g->distance[v] - (both ? fmin(z, 2 - z) : z)) < 1e-14);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
    for (int i = 0; i < 2; i++) {
        double u[3], w[3], chord = 0;
        m = make_cone(ctx, lift[i]);
        rim(lift[i], 0, u), rim(lift[i], 1, w);
        for (int k = 0; k < 3; k++) chord += (u[k] - w[k]) * (u[k] - w[k]);
        dmk_geodesics_options_init(&options, sizeof options);
        options.border = 1;
        dmk_geodesics *g = run_with(ctx, m, 0, NULL, &options);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            double best = HUGE_VAL, height = sqrt(1 - chord / 4);
            for (int slice = 0; slice < n_slices; slice++) { /* x = a u + b w */
                const double *x = m->xyz + 3 * v;
                rim(lift[i], slice, u), rim(lift[i], slice + 1, w);
                double uw = 0, ux = 0, wx = 0, xx = 0;
                for (int k = 0; k < 3; k++)
                    uw += u[k] * w[k], ux += u[k] * x[k], wx += w[k] * x[k], xx += x[k] * x[k];
                const double a = (ux - uw * wx) / (1 - uw * uw), b = (wx - uw * ux) / (1 - uw * uw);
                const double off = xx - a * a - b * b - 2 * a * b * uw;
                if (a > -1e-9 && b > -1e-9 && fabs(off) < 1e-9) best = (1 - a - b) * height;
            }
            assert_true(fabs(g->distance[v] - best) < 1e-14);
        }
        dmk_geodesics_destroy(&g);
        dmk_mesh_destroy(&m);
    }
}

/* Exact distances from the border of terrain far higher than wide: those of trimmed windows, where these are. */
static void from_the_border_of_terrain(void **state)
{
    enum { N = 20 };
    static const double o[3] = {0}, p[3] = {1, 0, 0}, q[3] = {0, 1, 0};
    dmk_context *ctx = *state;
    uint32_t random = 1;
    for (double height = 5; height < 1e4; height *= 10) {
        soup *s = new_soup();
        add_grid(s, o, p, q, N, N, 0, &random);
        for (int32_t v = 0; v < s->n_vertices; v++) s->xyz[3 * v + 2] = height * noise(&random);
        dmk_mesh *m = finish(ctx, s);
        dmk_geodesics_options options;
        dmk_geodesics_options_init(&options, sizeof options);
        options.border = options.exact = 1;
        dmk_geodesics *g = run_with(ctx, m, 0, NULL, &options), *near;
        bool finished;
        assert_null(g->error);
        assert_int_equal(dmk_geodesics_prepare(ctx, m, NULL, 0, NULL, &options, &near), DMK_OK);
        assert_int_equal(dmk_waves_run(ctx, near, 0, 0, 1000, INT_MAX, &finished), DMK_OK);
        for (int32_t v = 0; v < m->n_vertices; v++)
            assert_true(fabs(g->distance[v] - near->distance[v]) < 1e-9 * height);
        dmk_geodesics_destroy(&g);
        dmk_geodesics_destroy(&near);
        dmk_mesh_destroy(&m);
    }
}

/* Around a line in a square: the way from its ends is not straight ahead. By exact and by merged windows. */
static void integral_around_a_line(void **state)
{
    enum { N = 8, PLACES = 400 };
    dmk_context *ctx = *state;
    const int32_t row = N / 2 * (N + 1), line[] = {row + 3, row + 4, row + 4, row + 5};
    double sum = 0, part, integral, error;
    dmk_geodesics_options options;
    dmk_mesh *m = make_square(ctx, N, 0);
    for (int i = 0; i < PLACES * PLACES; i++) {
        const double x[2] = {(i % PLACES + 0.5) / PLACES, (i / PLACES + 0.5) / PLACES};
        sum += to_segment(m->xyz + 3 * line[0], m->xyz + 3 * line[3], x, &part);
    }
    dmk_geodesics_options_init(&options, sizeof options);
    options.line = line, options.n_lines = 2;
    for (int merged = 0; merged < 2; merged++) {
        options.tolerance = merged * 1e-9;
        dmk_geodesics *g = run_with(ctx, m, 0, NULL, &options);
        assert_int_equal(dmk_geodesics_integrate(ctx, g, &integral, &error), DMK_OK);
        assert_true(fabs(integral - sum / (PLACES * PLACES)) < (merged ? 1e-4 : 2e-6));
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* A point among the rays of another source, nearer than that one in their middle alone: merged windows of points with
 * offsets, and of the square's left side. */
static void one_source_among_the_rays_of_another(void **state)
{
    dmk_context *ctx = *state;
    enum { N = 5, RUNS = 200 };
    int32_t side[2 * N];
    uint32_t random = 1;
    dmk_mesh *m = make_square(ctx, N, 0.5);
    for (int32_t i = 0; i < N; i++) side[2 * i] = i * (N + 1), side[2 * i + 1] = (i + 1) * (N + 1);
    for (int run = 0; run < 2 * RUNS; run++) {
        const int n = run < RUNS ? 2 : 1;
        double at[2][3], offset[2] = {0};
        dmk_point source[2];
        dmk_geodesics_options options;
        for (int i = 0; i < n; i++) {
            const double a = noise(&random) + 0.5, b = (noise(&random) + 0.5) * (1 - a);
            source[i] =
                (dmk_point){(int64_t)((noise(&random) + 0.5) * m->n_triangles), {a, b, 1 - a - b}};
            assert_int_equal(dmk_mesh_point_xyz(ctx, m, source + i, at[i]), DMK_OK);
        }
        dmk_geodesics_options_init(&options, sizeof options);
        options.tolerance = 1e-9;
        options.offset = offset;
        if (n == 2) offset[0] = 0.9 * hypot(at[0][0] - at[1][0], at[0][1] - at[1][1]);
        if (n == 1) options.line = side, options.n_lines = N;
        dmk_geodesics *g = run_with(ctx, m, (size_t)n, source, &options);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            double best = n == 1 ? m->xyz[3 * v] : HUGE_VAL;
            for (int i = 0; i < n; i++)
                best = fmin(best, offset[i] + hypot(m->xyz[3 * v] - at[i][0],
                                                    m->xyz[3 * v + 1] - at[i][1]));
            assert_true(fabs(g->distance[v] - best) < 2e-9);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* A vertex in the shadow of one that has 9e-11 more than 2 pi around it, too little to bend paths: the windows of
 * both sides pass it by 0.7e-6 of the last edge. */
static void behind_a_nearly_flat_vertex(void **state)
{
    enum { source, flat, up, down, over, under, behind };
    const double h = sqrt(9e-11 / 4), half = 32e-6, x = 1 - 50e-6;
    const double xyz[] = {-1, 0, -h,   0,  0, 0,     0,  1, h, 0, -1,
                          h,  x, half, -h, x, -half, -h, 1, 0, -h};
    const int32_t triangle[] = {source, flat, up,    source, down, flat, flat,   over,
                                up,     flat, under, over,   flat, down, under,  under,
                                behind, over, over,  behind, up,   down, behind, under};
    dmk_mesh *m;
    dmk_context *ctx = *state;
    assert_int_equal(dmk_mesh_create(ctx, 7, xyz, 8, triangle, &m), DMK_OK);
    const dmk_point p = {0, {1, 0, 0}};
    dmk_geodesics *g = run(ctx, m, 1, &p, NULL);
    const double excess = g->star.total[flat] - 2 * pi;
    assert_true(excess > 0.8e-10 && excess < 1e-10);
    assert_true(fabs(g->distance[behind] - 2) < 1e-10);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Three vertices 1e-13 apart: of a point that is nearer than rounding to one of them, the directions are those of the
 * vertex. */
static void beside_a_vertex_is_the_vertex(void **state)
{
    enum { a, b, c, A, B, C };
    const double e = 1e-13, w = 1e-4;
    const double xyz[] = {0, 0, 0, e, 0, 0, 0, e, 0, -1, -1, 0, 2, -1, 0, -1, 2, 0};
    const int32_t triangle[] = {a, b, c, b, a, A, b, A, B, c, b, B, c, B, C, a, c, C, a, C, A};
    dmk_mesh *m;
    dmk_star star;
    dmk_site site;
    dmk_context *ctx = *state;
    assert_int_equal(dmk_mesh_create(ctx, 6, xyz, 7, triangle, &m), DMK_OK);
    assert_int_equal(dmk_star_create(ctx, m, NULL, &star), DMK_OK);
    for (int k = 0; k < 2; k++) { /* 1e-17 from a; farther than rounding */
        const double far = k ? 0.25 : w;
        const dmk_point p = {0, {1 - 2 * far, far, far}};
        assert_int_equal(dmk_site_create(ctx, m, &star, &p, 0, &site), DMK_OK);
        assert_int_equal(site.vertex, k ? -1 : a);
        assert_int_equal(site.n_sectors, k ? 3 : 4);
        dmk_site_free(&site);
    }
    dmk_star_free(&star);
    dmk_mesh_destroy(&m);
}

/* Vertices in no triangle have no star, and no angle either: not what memory held before. As many as the C library
 * does fill with something else (those of small arrays it does not). */
static void vertices_in_no_triangle(void **state)
{
    enum { N = 1000 };
    double xyz[3 * N] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const int32_t triangle[] = {0, 1, 2};
    dmk_mesh *m;
    dmk_star star;
    dmk_context *ctx = *state;
    assert_int_equal(dmk_mesh_create(ctx, N, xyz, 1, triangle, &m), DMK_OK);
    mallopt(M_PERTURB, 0x5a);
    assert_int_equal(dmk_star_create(ctx, m, NULL, &star), DMK_OK);
    mallopt(M_PERTURB, 0);
    assert_true(fabs(star.total[0] - pi / 2) < 1e-15);
    for (int32_t v = 3; v < N; v++) assert_true(star.first[v] == -1 && star.total[v] == 0);
    dmk_star_free(&star);
    dmk_mesh_destroy(&m);
}

/* Rounding is not to make a flat vertex one at which paths bend, and all of a straight border are. */
static void paths_bend_beyond_rounding(void **state)
{
    (void)state;
    double total[] = {2 * pi + 0.7e-10, 2 * pi + 1.5e-10, pi - 1.5e-6, pi - 0.7e-6};
    bool border[] = {false, false, true, true};
    const dmk_star star = {.total = total, .border = border};
    for (int v = 0; v < 4; v++) assert_int_equal(dmk_front_bends(&star, v), v % 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(paths_bend_beyond_rounding),
        cmocka_unit_test(flat_square),
        cmocka_unit_test(from_an_edge_of_the_border),
        cmocka_unit_test(cube_from_a_corner),
        cmocka_unit_test(doubled_square),
        cmocka_unit_test(around_a_corner),
        cmocka_unit_test(tube),
        cmocka_unit_test(cone),
        cmocka_unit_test(stored_distances),
        cmocka_unit_test(both_ways),
        cmocka_unit_test(several_sources),
        cmocka_unit_test(one_source_behind_another),
        cmocka_unit_test(rough_terrain),
        cmocka_unit_test(spiky_terrain),
        cmocka_unit_test(any_scale),
        cmocka_unit_test(merged_windows),
        cmocka_unit_test(directions_at_several_sources),
        cmocka_unit_test(estimates_in_fans),
        cmocka_unit_test(merging_that_is_no_use_ends_early),
        cmocka_unit_test(merging_that_is_no_use_ends_early),
        cmocka_unit_test(estimates_on_terrain),
        cmocka_unit_test(estimates_behind_bends),
        cmocka_unit_test(estimates_beside_shadows),
        cmocka_unit_test(lines),
        cmocka_unit_test(one_source_among_the_rays_of_another),
        cmocka_unit_test(offsets_beside_the_mesh),
        cmocka_unit_test(curves_in_a_square),
        cmocka_unit_test(integral_around_a_line),
        cmocka_unit_test(from_rims),
        cmocka_unit_test(from_the_border_of_terrain),
        cmocka_unit_test(another_mesh_around_a_curve),
        cmocka_unit_test(any_number_of_threads),
        cmocka_unit_test(curves_on_a_grid_and_any_number_of_threads),
        cmocka_unit_test(thin_triangles_and_any_number_of_threads),
        cmocka_unit_test(another_mesh_of_the_surface),
        cmocka_unit_test(paths_are_the_log_map),
        cmocka_unit_test(behind_a_nearly_flat_vertex),
        cmocka_unit_test(angles_of_needles),
        cmocka_unit_test(beside_a_vertex_is_the_vertex),
        cmocka_unit_test(vertices_in_no_triangle),
        cmocka_unit_test(any_triangle_may_be_the_first),
        cmocka_unit_test(values_inside_triangles),
        cmocka_unit_test(values_between_sources),
        cmocka_unit_test(several_components),
        cmocka_unit_test(wrong_distances_are_found),
        cmocka_unit_test(integral_of_the_distance),
        cmocka_unit_test(integral_on_coarse_meshes),
    };
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
