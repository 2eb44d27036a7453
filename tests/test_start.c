/* The start: distance and density against surfaces where both are known. */
#include "../src/solver/start.c" /* for its static functions; the library's own are then left out */

#include "geodesic/geodesic.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

typedef struct fixture {
    dmk_context *ctx;
    dmk_mesh *mesh;
    double *d, *mid, *mu; /* n_vertices, n_edges, n_triangles */
} fixture;

static void fixture_free(fixture *f)
{
    dmk_mesh_destroy(&f->mesh);
    dmk_context_destroy(&f->ctx);
    free(f->d);
    free(f->mid);
    free(f->mu);
}

static void start_from(fixture *f, dmk_point source)
{
    size_t n_vertices = (size_t)f->mesh->n_vertices, n_edges = (size_t)f->mesh->n_edges;
    f->d = calloc(n_vertices, sizeof *f->d);
    f->mid = calloc(n_edges, sizeof *f->mid);
    f->mu = calloc((size_t)f->mesh->n_triangles, sizeof *f->mu);
    dmk_geodesics *g;
    assert_int_equal(dmk_geodesics_create(f->ctx, f->mesh, 1, &source, NULL, &g), DMK_OK);
    dmk_geodesics_midpoints(f->ctx, g, f->mid);
    assert_int_equal(dmk_start_density(f->ctx, f->mesh, g, f->mid, f->mu, NULL), DMK_OK);
    memcpy(f->d, g->distance, n_vertices * sizeof *f->d);
    dmk_geodesics_destroy(&g);
    for (int32_t t = 0; t < f->mesh->n_triangles; t++) {
        assert_true(isfinite(f->mu[t]) && f->mu[t] > 0);
    }
}

/* A vertex as a point, by its first triangle. */
static dmk_point at_vertex(const dmk_mesh *mesh, int32_t vertex)
{
    int32_t h = 0;
    while (mesh->triangle[h] != vertex) h++;
    dmk_point p = {.triangle = h / 3};
    p.weight[h % 3] = 1;
    return p;
}

static void point_xyz(const dmk_mesh *mesh, dmk_point p, double xyz[3])
{
    memset(xyz, 0, 3 * sizeof *xyz);
    for (int h = 0; h < 9; h++) {
        xyz[h % 3] +=
            p.weight[h / 3] * mesh->xyz[3 * mesh->triangle[3 * p.triangle + h / 3] + h % 3];
    }
}

static double distance3(const double *a, const double *b)
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* ---- meshes ---------------------------------------------------------------------------------- */

static double noise(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state / 4294967296.0 - 0.5;
}

/* The rectangle 0..1 x 0..height of n x n squares, cut in two, inner vertices moved by `jitter`. */
static void make_square(fixture *f, int n, double height, double jitter)
{
    size_t n_vertices = (size_t)(n + 1) * (size_t)(n + 1), n_triangles = 2 * (size_t)n * (size_t)n;
    double *xyz = calloc(3 * n_vertices, sizeof *xyz);
    int32_t *tri = calloc(3 * n_triangles, sizeof *tri), *to = tri;
    uint32_t state = 7;
    for (int i = 0; i < (n + 1) * (n + 1); i++) {
        int x = i % (n + 1), y = i / (n + 1);
        bool inner = x > 0 && x < n && y > 0 && y < n;
        xyz[3 * i] = (x + (inner ? jitter * noise(&state) : 0)) / n;
        xyz[3 * i + 1] = height * (y + (inner ? jitter * noise(&state) : 0)) / n;
    }
    for (int i = 0; i < n * n; i++) {
        int a = i % n + i / n * (n + 1), b = a + 1, c = a + n + 1, d = c + 1;
        int32_t two[6] = {a, b, d, a, d, c};
        memcpy(to, two, sizeof two);
        to += 6;
    }
    assert_int_equal(dmk_context_create(&f->ctx), DMK_OK);
    assert_int_equal(dmk_mesh_adopt(f->ctx, n_vertices, xyz, n_triangles, tri, &f->mesh), DMK_OK);
}

/* Number of the lattice point (i, j, k), |i| + |j| + |k| = n, pushed out to the unit sphere. */
static int32_t lattice(int32_t *table, int n, int i, int j, int k, double *xyz, int32_t *count)
{
    int side = 2 * n + 1;
    int32_t *slot = table + ((i + n) * side + j + n) * side + k + n;
    if (*slot < 0) {
        double r = sqrt((double)(i * i + j * j + k * k));
        xyz[3 * *count] = i / r;
        xyz[3 * *count + 1] = j / r;
        xyz[3 * *count + 2] = k / r;
        *slot = (*count)++;
    }
    return *slot;
}

/* Unit sphere: an octahedron, each face cut in n x n. */
static void make_sphere(fixture *f, int n)
{
    int side = 2 * n + 1;
    size_t n_table = (size_t)side * (size_t)side * (size_t)side;
    int32_t n_vertices = 0, n_tri = 0;
    int32_t *table = malloc(n_table * sizeof *table),
            *tri = calloc(24 * (size_t)n * (size_t)n, sizeof *tri);
    double *xyz = calloc(3 * (4 * (size_t)n * (size_t)n + 2), sizeof *xyz);
    memset(table, 0xff, n_table * sizeof *table);
    for (int octant = 0; octant < 8; octant++) {
        int sx = octant & 1 ? -1 : 1, sy = octant & 2 ? -1 : 1, sz = octant & 4 ? -1 : 1;
        bool turn = sx * sy * sz < 0;
        for (int i = 0; i < n; i++) {
            for (int j = 0; i + j < n; j++) {
                for (int up = 0; up <= (i + j < n - 1); up++) {
                    int c[3][2] = {{i + up, j + up}, {i + 1, j}, {i, j + 1}};
                    for (int k = 0; k < 3; k++) {
                        int p = k == 0 ? 0 : ((turn ? 1 : 0) ^ up) ? 3 - k : k;
                        tri[n_tri++] = lattice(table, n, sx * c[p][0], sy * c[p][1],
                                               sz * (n - c[p][0] - c[p][1]), xyz, &n_vertices);
                    }
                }
            }
        }
    }
    free(table);
    assert_int_equal(dmk_context_create(&f->ctx), DMK_OK);
    assert_int_equal(
        dmk_mesh_adopt(f->ctx, (size_t)n_vertices, xyz, (size_t)n_tri / 3, tri, &f->mesh), DMK_OK);
}

/* ---- distance -------------------------------------------------------------------------------- */

static void check_flat(double height, double jitter, dmk_point source, double bound)
{
    fixture f = {0};
    make_square(&f, 12, height, jitter);
    start_from(&f, source);
    double p[3], m[3];
    point_xyz(f.mesh, source, p);
    for (int32_t v = 0; v < f.mesh->n_vertices; v++) {
        assert_true(fabs(f.d[v] - distance3(p, f.mesh->xyz + 3 * v)) < bound);
    }
    for (int32_t e = 0; e < f.mesh->n_edges; e++) {
        const double *a = f.mesh->xyz + 3 * f.mesh->edge_vertex[2 * e];
        const double *b = f.mesh->xyz + 3 * f.mesh->edge_vertex[2 * e + 1];
        for (int i = 0; i < 3; i++) m[i] = (a[i] + b[i]) / 2;
        assert_true(fabs(f.mid[e] - distance3(p, m)) < bound);
    }
    fixture_free(&f);
}

/* On an edge, or next to a vertex, the source's place off the line through two vertices comes from
 * a difference that cancels: rounding enters by its root. */
static void test_flat_is_exact(void **state)
{
    (void)state;
    const dmk_point corner = {0, {1, 0, 0}}, inside = {101, {0.2, 0.5, 0.3}};
    const dmk_point on_edge = {101, {0.4, 0, 0.6}}, near_corner = {150, {1e-9, 1 - 2e-9, 1e-9}};
    const double heights[] = {1, 0.2};
    for (int i = 0; i < 4; i++) {
        check_flat(heights[i / 2], 0.6 * (i % 2), corner, 1e-14);
        check_flat(heights[i / 2], 0.6 * (i % 2), inside, 1e-11);
        check_flat(heights[i / 2], 0.6 * (i % 2), on_edge, 1e-7);
        check_flat(heights[i / 2], 0.6 * (i % 2), near_corner, 1e-7);
    }
}

/* Obtuse angles up to 179 degrees. */
static void test_flat_with_needles(void **state)
{
    (void)state;
    check_flat(0.02, 0.6, (dmk_point){0, {1, 0, 0}}, 1e-3);
    check_flat(0.02, 0.6, (dmk_point){101, {0.2, 0.5, 0.3}}, 1e-3);
}

/* Largest error of the distance to the north pole, and relative L1 error of mu = cot(r/2), the
 * triangle's value by its centroid, beyond r = 0.3. */
static void sphere_errors(int n, double *distance, double *density)
{
    fixture f = {0};
    make_sphere(&f, n);
    int32_t pole = 0;
    while (f.mesh->xyz[3 * pole + 2] < 1) pole++;
    start_from(&f, at_vertex(f.mesh, pole));
    double sum = 0, wrong = 0;
    *distance = 0;
    for (int32_t v = 0; v < f.mesh->n_vertices; v++) {
        *distance = fmax(*distance, fabs(f.d[v] - acos(f.mesh->xyz[3 * v + 2])));
    }
    for (int32_t t = 0; t < f.mesh->n_triangles; t++) {
        double c[3], origin[3] = {0, 0, 0};
        point_xyz(f.mesh, (dmk_point){t, {1 / 3.0, 1 / 3.0, 1 / 3.0}}, c);
        double r = acos(c[2] / distance3(c, origin)), mu = 1 / tan(r / 2);
        if (r < 0.3) continue;
        sum += f.mesh->area[t] * mu;
        wrong += f.mesh->area[t] * fabs(f.mu[t] - mu);
    }
    *density = wrong / sum;
    fixture_free(&f);
}

static void test_sphere_converges(void **state)
{
    (void)state;
    double d[3], mu[3];
    for (int i = 0; i < 3; i++) sphere_errors(8 << i, &d[i], &mu[i]);
    assert_true(d[0] < 0.15 && d[1] < 0.6 * d[0] && d[2] < 0.6 * d[1]);
    assert_true(mu[0] < 0.09 && mu[1] < mu[0] && mu[2] < 0.7 * mu[0]);
}

/* ---- density --------------------------------------------------------------------------------- */

/* All mass arrives: the integral of mu is that of the distance, each unit of area being counted
 * once per unit of its way. */
static void test_mass_is_kept(void **state)
{
    (void)state;
    const double jitters[] = {0, 0.6};
    for (int i = 0; i < 2; i++) {
        fixture f = {0};
        make_square(&f, 48, 0.7, jitters[i]);
        start_from(&f, (dmk_point){2000, {0.2, 0.5, 0.3}});
        double carried = 0, cost = 0;
        for (int32_t t = 0; t < f.mesh->n_triangles; t++) {
            const int32_t *e = f.mesh->triangle_edge + 3 * t;
            carried += f.mesh->area[t] * f.mu[t];
            cost += f.mesh->area[t] * (f.mid[e[0]] + f.mid[e[1]] + f.mid[e[2]]) / 3;
        }
        assert_true(fabs(carried / cost - 1) < 0.02);
        fixture_free(&f);
    }
}

/* ---- odd meshes ------------------------------------------------------------------------------ */

/* Every vertex but those of the source's triangle has a nearer neighbour. */
static void check_descent(const fixture *f, const dmk_point *source)
{
    for (int32_t v = 0; v < f->mesh->n_vertices; v++) {
        double least = INFINITY;
        bool seed = false;
        for (int32_t h = 0; h < 3 * f->mesh->n_triangles; h++) {
            if (f->mesh->triangle[h] != v) continue;
            for (int k = 0; k < 3; k++) least = fmin(least, f->d[f->mesh->triangle[h / 3 * 3 + k]]);
            seed = seed || h / 3 == source->triangle;
        }
        assert_true(isfinite(f->d[v]) && (seed || least < f->d[v]));
    }
}

static void test_tetrahedron(void **state)
{
    (void)state;
    const double corners[12] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1};
    const int32_t faces[12] = {0, 1, 2, 0, 3, 1, 0, 2, 3, 1, 3, 2};
    const dmk_point points[] = {{0, {1, 0, 0}}, {0, {0.5, 0.5, 0}}, {0, {0.2, 0.3, 0.5}}};
    for (int i = 0; i < 3; i++) {
        fixture f = {0};
        double *xyz = malloc(sizeof corners);
        int32_t *tri = malloc(sizeof faces);
        memcpy(xyz, corners, sizeof corners);
        memcpy(tri, faces, sizeof faces);
        assert_int_equal(dmk_context_create(&f.ctx), DMK_OK);
        assert_int_equal(dmk_mesh_adopt(f.ctx, 4, xyz, 4, tri, &f.mesh), DMK_OK);
        start_from(&f, points[i]);
        check_descent(&f, &points[i]);
        if (i == 0) {
            for (int v = 1; v < 4; v++) assert_true(fabs(f.d[v] - sqrt(8)) < 1e-14);
        }
        fixture_free(&f);
    }
}

/* An open surface, from its border. */
static void test_border(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        fixture f = {0};
        make_square(&f, 16, 0.6, 0.6);
        dmk_point source = i == 0 ? at_vertex(f.mesh, 8) : (dmk_point){20, {0.3, 0.7, 0}};
        start_from(&f, source);
        check_descent(&f, &source);
        fixture_free(&f);
    }
}

/* Heights by chance, up to `most`. */
static void roughen(fixture *f, double most, uint32_t *random)
{
    const size_t n_vertices = (size_t)f->mesh->n_vertices,
                 n_triangles = (size_t)f->mesh->n_triangles;
    double *xyz = malloc(3 * n_vertices * sizeof *xyz);
    int32_t *tri = malloc(3 * n_triangles * sizeof *tri);
    memcpy(xyz, f->mesh->xyz, 3 * n_vertices * sizeof *xyz);
    memcpy(tri, f->mesh->triangle, 3 * n_triangles * sizeof *tri);
    for (size_t v = 0; v < n_vertices; v++) xyz[3 * v + 2] = most * noise(random);
    dmk_mesh_destroy(&f->mesh);
    assert_int_equal(dmk_mesh_adopt(f->ctx, n_vertices, xyz, n_triangles, tri, &f->mesh), DMK_OK);
}

/* Needles: a rough height field over a rectangle of aspect 1:1000. */
static void test_needles(void **state)
{
    (void)state;
    fixture f = {0};
    make_square(&f, 20, 1e-3, 0.9);
    uint32_t random = 3;
    roughen(&f, 0.02, &random);
    dmk_point source = {333, {0.1, 0.1, 0.8}};
    start_from(&f, source);
    for (int32_t e = 0; e < f.mesh->n_edges; e++) {
        const int32_t *v = f.mesh->edge_vertex + 2 * e;
        assert_true(fabs(f.d[v[0]] - f.d[v[1]]) < 1.1 * f.mesh->length[e]);
        assert_true(f.mid[e] < fmin(f.d[v[0]], f.d[v[1]]) + 0.51 * f.mesh->length[e]);
    }
    fixture_free(&f);
}

/* On rough ground triangles wait for each other in rings, which are opened: the flow has been through all of them. */
static void test_rings_are_opened(void **state)
{
    (void)state;
    fixture f = {0};
    uint32_t random = 5;
    make_square(&f, 48, 1, 0);
    roughen(&f, 0.12, &random);
    start_from(&f, (dmk_point){2000, {0.2, 0.5, 0.3}});
    sweep s = {.mesh = f.mesh, .d = f.d, .mid = f.mid, .mu = f.mu};
    assert_int_equal(sweep_create(f.ctx, &s), DMK_OK);
    assert_int_equal(sweep_all(f.ctx, &s, NULL), DMK_OK);
    for (int32_t t = 0; t < f.mesh->n_triangles; t++) assert_true(s.waiting[t] <= 0);
    sweep_free(&s);
    fixture_free(&f);
}

/* Only triangles that may be closed are looked at, also where a way through so many of them ends before it has come
 * to one that is open: against the flow along a row of the square, each triangle's only way out is closed in turn. */
static void test_dents_are_found(void **state)
{
    (void)state;
    fixture f = {0};
    make_square(&f, 100, 1, 0);
    const dmk_mesh *m = f.mesh;
    const int32_t first = 10001, n = m->n_triangles, n_edges = m->n_edges;
    double *mid = calloc((size_t)n_edges, sizeof *mid);
    sweep s = {.mesh = m, .mid = mid}, all = s;
    assert_int_equal(sweep_create(f.ctx, &s), DMK_OK);
    assert_int_equal(sweep_create(f.ctx, &all), DMK_OK);
    for (int32_t e = 0; e < n_edges; e++) { /* to the right, and not into other rows */
        const double *a = m->xyz + 3 * m->edge_vertex[2 * e],
                     *b = m->xyz + 3 * m->edge_vertex[2 * e + 1];
        mid[e] = a[1] == b[1] ? 10 : -a[0] - b[0];
        s.width[e] = 1;
    }
    for (int32_t t = first - 1; t < first + 199; t++) {
        const int32_t *edge = m->triangle_edge + 3 * t;
        for (int k = 0; k < 3; k++) {
            const int32_t before = t % 2 ? t - 3 : t + 1; /* towards the left */
            if (t != first && dmk_twin_triangle(m, t, edge[k]) == before) continue;
            s.width[edge[k]] = m->edge_triangle[2 * edge[k]] == t ? -1 : 1;
        }
    }
    memcpy(all.width, s.width, (size_t)n_edges * sizeof *s.width);
    for (int32_t t = 0; t < n; t++) open_triangle(&all, t);
    open_all(f.ctx, &s);
    int32_t changed = 0;
    for (int32_t e = 0; e < n_edges; e++) changed += fabs(all.width[e]) != 1;
    assert_true(changed > 64);
    assert_memory_equal(s.width, all.width, (size_t)n_edges * sizeof *s.width);
    sweep_free(&s);
    sweep_free(&all);
    free(mid);
    fixture_free(&f);
}

/* Triangles into which all edges run get a way out through the edge nearest the source, in turn until one has its own;
 * the widths in and out of a triangle are those of its edges. */
static void test_dents_are_opened(void **state)
{
    (void)state;
    fixture f = {0};
    make_square(&f, 6, 1, 0.4);
    const dmk_mesh *m = f.mesh;
    double *mid = calloc((size_t)m->n_edges, sizeof *mid),
           *width = calloc((size_t)m->n_edges, sizeof *width);
    uint8_t *sink = calloc((size_t)m->n_triangles, 1);
    int8_t *waiting = calloc((size_t)m->n_triangles, 1);
    sweep s = {.mesh = m, .mid = mid, .width = width, .sink = sink, .waiting = waiting};
    for (int32_t e = 0; e < m->n_edges; e++) mid[e] = m->xyz[3 * m->edge_vertex[2 * e]] + 0.01 * e;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *edge = m->triangle_edge + 3 * t;
        int best = -1;
        for (int32_t e = 0; e < m->n_edges; e++) width[e] = m->edge_triangle[2 * e] == t ? -1 : 1;
        for (int k = 0; k < 3; k++) {
            if (m->edge_triangle[2 * edge[k] + 1] >= 0 &&
                (best < 0 || mid[edge[k]] < mid[edge[best]]))
                best = k;
        }
        const int32_t next = dmk_twin_triangle(m, t, edge[best]);
        memset(sink, 0, (size_t)m->n_triangles);
        sink[next] = 1;
        open_triangle(&s, t);
        for (int k = 0; k < 3; k++) {
            const double out = width_out(&s, t, k);
            assert_true(k == best ? fabs(out - 1e-3 * m->length[edge[k]]) < 1e-15 : out == -1);
        }
        open_triangle(&s, t); /* it has a way out */
        for (int k = 0; k < 3; k++) assert_true((width_out(&s, t, k) > 0) == (k == best));
        width[edge[best]] = m->edge_triangle[2 * edge[best]] == t ? -1 : 1;
        sink[t] = 1;
        open_triangle(&s, t); /* what holds the source needs none */
        for (int k = 0; k < 3; k++) assert_true(width_out(&s, t, k) < 0);
        sink[t] = 0;
        sink[next] = 0; /* the neighbour gets one in turn */
        for (int k = 0; k < 3; k++) {
            const int32_t e = m->triangle_edge[3 * next + k];
            width[e] = m->edge_triangle[2 * e] == next ? -1 : 1;
        }
        width[edge[best]] = m->edge_triangle[2 * edge[best]] == t ? -1 : 1;
        open_triangle(&s, t);
        bool open = false;
        for (int k = 0; k < 3; k++) open = open || width_out(&s, next, k) > 0;
        assert_true(open);
    }
    free(mid);
    free(width);
    free(waiting);
    free(sink);
    fixture_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_flat_is_exact),    cmocka_unit_test(test_flat_with_needles),
        cmocka_unit_test(test_sphere_converges), cmocka_unit_test(test_mass_is_kept),
        cmocka_unit_test(test_tetrahedron),      cmocka_unit_test(test_needles),
        cmocka_unit_test(test_border),           cmocka_unit_test(test_dents_are_opened),
        cmocka_unit_test(test_rings_are_opened), cmocka_unit_test(test_dents_are_found),
    };
    return cmocka_run_group_tests_name("start", tests, NULL, NULL);
}
