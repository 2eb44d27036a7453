/* The cut locus of a set of points: on a sphere the Voronoi diagram, elsewhere with each cell's own locus; against the
 * closed form and the nearest sources of the exact distances. */
#include "geodesic/geodesic.h"
#include "mesh/mesh.h"
#include "context.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static dmk_context *ctx;

enum { MOST = 12 };
typedef struct scene {
    dmk_mesh *mesh;
    dmk_geodesics *geodesics;
    dmk_locus *locus;
    dmk_locus_info info;
    double h;
    size_t n;
    double at[MOST][3]; /* sources */
} scene;

static void ok(int rc)
{
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
}

/* From the points of the surface nearest to these. */
static scene scene_of(const char *name, size_t n, const double (*at)[3])
{
    scene s = {.n = n};
    dmk_surface_options o;
    dmk_point source[MOST];
    dmk_surface_options_init(&o, sizeof o);
    o.name = name;
    o.n_triangles = 5000;
    ok(dmk_mesh_surface(ctx, &o, &s.mesh));
    for (int32_t e = 0; e < s.mesh->n_edges; e++) s.h += s.mesh->length[e] / s.mesh->n_edges;
    for (size_t i = 0; i < n; i++) {
        ok(dmk_mesh_project(ctx, s.mesh, at[i], &source[i]));
        ok(dmk_mesh_point_xyz(ctx, s.mesh, &source[i], s.at[i]));
    }
    ok(dmk_geodesics_create(ctx, s.mesh, n, source, NULL, &s.geodesics));
    ok(dmk_geodesics_locus(ctx, s.geodesics, NULL, &s.locus));
    dmk_locus_get_info(s.locus, &s.info);
    return s;
}

static void free_scene(scene *s)
{
    dmk_locus_destroy(&s->locus);
    dmk_geodesics_destroy(&s->geodesics);
    dmk_mesh_destroy(&s->mesh);
}

/* The locus crosses every edge between two cells, and where its sides have two sources lines have infinite
 * strength. */
static void check_labels(const scene *s)
{
    size_t n_vertices, n_edges;
    const dmk_locus_vertex *v = dmk_locus_vertices(s->locus, &n_vertices);
    const dmk_locus_edge *e = dmk_locus_edges(s->locus, &n_edges);
    const dmk_arrival *to = dmk_geodesics_arrivals(s->geodesics, NULL);
    char *crossed = calloc((size_t)s->mesh->n_edges, 1);
    assert_non_null(crossed);
    for (size_t i = 0; i < n_vertices; i++) {
        const dmk_point *p = &v[i].place;
        for (int k = 0; k < 3; k++) {
            if (p->weight[k] != 0) continue;
            const int32_t edge = s->mesh->triangle_edge[3 * p->triangle + k];
            const int32_t a = to[s->mesh->edge_vertex[2 * edge]].source,
                          b = to[s->mesh->edge_vertex[2 * edge + 1]].source;
            assert_true((v[i].source[0] == a && v[i].source[1] == b) ||
                        (v[i].source[0] == b && v[i].source[1] == a));
            crossed[edge] = 1;
        }
    }
    for (int32_t i = 0; i < s->mesh->n_edges; i++) {
        const int32_t *end = s->mesh->edge_vertex + 2 * i;
        if (to[end[0]].source != to[end[1]].source) assert_true(crossed[i]);
    }
    for (size_t i = 0; i < n_edges; i++) {
        const dmk_locus_vertex *a = &v[e[i].vertex[0]], *b = &v[e[i].vertex[1]];
        if (a->source[0] != a->source[1] && b->source[0] != b->source[1])
            assert_true(e[i].strength == HUGE_VAL);
    }
    free(crossed);
}

static double angle_between(const double *a, const double *b)
{
    const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]};
    return atan2(sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]),
                 a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
}

/* On the unit sphere: both sources of a vertex, at a branch point three, are the nearest ones, equally far. */
static double worst_place(const scene *s, double *mean)
{
    size_t n;
    double worst = 0, sum = 0;
    const dmk_locus_vertex *v = dmk_locus_vertices(s->locus, &n);
    for (size_t i = 0; i < n; i++) {
        double least = HUGE_VAL;
        for (size_t k = 0; k < s->n; k++) least = fmin(least, angle_between(v[i].xyz, s->at[k]));
        int near = 0;
        for (size_t k = 0; k < s->n; k++)
            near += angle_between(v[i].xyz, s->at[k]) < least + 0.5 * s->h;
        if (v[i].kind == DMK_LOCUS_BRANCH) assert_true(near >= 3);
        assert_true(v[i].source[0] != v[i].source[1]);
        for (int k = 0; k < 2; k++) {
            const double more = angle_between(v[i].xyz, s->at[v[i].source[k]]) - least;
            worst = fmax(worst, more);
            sum += more;
        }
    }
    *mean = sum / (double)n / s->h;
    return worst / s->h;
}

static void a_voronoi_diagram(void **state)
{
    (void)state;
    const double at[8][3] = {{0.3, 0.2, 0.9},    {-0.8, 0.4, 0.3},  {0.7, -0.6, 0.2},
                             {-0.2, -0.9, 0.1},  {0.5, 0.8, -0.3},  {-0.4, 0.5, -0.8},
                             {0.6, -0.3, -0.75}, {-0.7, -0.5, -0.4}};
    scene s = scene_of("sphere", 8, at);
    double mean, worst = worst_place(&s, &mean);
    print_message("# places off by %.4f, at worst %.3f h\n", mean, worst);
    assert_int_equal(s.info.loops, 7);
    assert_int_equal(s.info.components, 1);
    assert_int_equal(s.info.endpoints, 0);
    assert_int_equal(s.info.branch_points, 12); /* three lines at each, by Euler's formula */
    assert_true(mean < 0.02 && worst < 0.5);
    check_labels(&s);
    free_scene(&s);
}

/* Their border is a great circle, on the far side of which their paths meet at 0.05. */
static void two_points_next_to_each_other(void **state)
{
    (void)state;
    const double at[2][3] = {{0.025, 0.3, 1}, {-0.025, 0.3, 1}};
    scene s = scene_of("sphere", 2, at);
    assert_int_equal(s.info.loops, 1);
    assert_int_equal(s.info.components, 1);
    check_labels(&s);
    free_scene(&s);
}

/* With each cell's own locus: 2g + k - 1 loops. */
static void on_a_torus(void **state)
{
    (void)state;
    const double at[3][3] = {{3, 0, 0}, {2, 0.4, 1}, {-2.5, -1.2, 0.3}};
    scene s = scene_of("torus", 3, at);
    size_t n, own = 0;
    const dmk_locus_vertex *v = dmk_locus_vertices(s.locus, &n);
    for (size_t i = 0; i < n; i++) own += v[i].source[0] == v[i].source[1];
    print_message("# %zu of %zu vertices within cells\n", own, n);
    assert_int_equal(s.info.loops, 4);
    assert_int_equal(s.info.components, 1);
    assert_true(own > 20 && own < n);
    check_labels(&s);
    free_scene(&s);
}

/* The torus' triangles, then those of a sphere a hundred times as large, far off. */
static dmk_mesh *beside_a_sphere(const dmk_mesh *torus)
{
    dmk_mesh *sphere = NULL, *both = NULL;
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "sphere";
    o.n_triangles = 500;
    o.size[0] = 100;
    ok(dmk_mesh_surface(ctx, &o, &sphere));
    const size_t v = (size_t)torus->n_vertices, t = (size_t)torus->n_triangles;
    const size_t nv = v + (size_t)sphere->n_vertices, nt = t + (size_t)sphere->n_triangles;
    double *xyz = malloc(3 * nv * sizeof *xyz);
    int32_t *triangle = malloc(3 * nt * sizeof *triangle);
    memcpy(xyz, torus->xyz, 3 * v * sizeof *xyz);
    memcpy(triangle, torus->triangle, 3 * t * sizeof *triangle);
    for (size_t i = 3 * v; i < 3 * nv; i++) xyz[i] = sphere->xyz[i - 3 * v] + 1000;
    for (size_t i = 3 * t; i < 3 * nt; i++)
        triangle[i] = sphere->triangle[i - 3 * t] + torus->n_vertices;
    ok(dmk_mesh_create(ctx, nv, xyz, nt, triangle, &both));
    free(xyz);
    free(triangle);
    dmk_mesh_destroy(&sphere);
    return both;
}

static void other_components_change_nothing(void **state)
{
    (void)state;
    const double at[][3] = {{3, 0, 0}, {-2, 0.3, 1}, {0.4, 1, 0}};
    scene s = scene_of("torus", 3, at);
    dmk_mesh *both = beside_a_sphere(s.mesh);
    dmk_geodesics *g = NULL;
    dmk_locus *l = NULL;
    dmk_locus_info info;
    dmk_point source[3];
    for (size_t i = 0; i < 3; i++) ok(dmk_mesh_project(ctx, both, s.at[i], &source[i]));
    ok(dmk_geodesics_create(ctx, both, 3, source, NULL, &g));
    ok(dmk_geodesics_locus(ctx, g, NULL, &l));
    dmk_locus_get_info(l, &info);
    assert_int_equal(info.n_vertices, s.info.n_vertices);
    assert_int_equal(info.loops, s.info.loops);
    assert_float_equal(info.length, s.info.length, 1e-9 * s.info.length);
    assert_float_equal(info.strength, s.info.strength, 1e-9 * s.info.strength);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    for (size_t i = 0; i < info.n_vertices; i++) {
        double xyz[3];
        assert_true(v[i].mu == 0 && v[i].place.triangle < s.mesh->n_triangles);
        ok(dmk_mesh_point_xyz(ctx, both, &v[i].place, xyz));
        for (int k = 0; k < 3; k++) assert_float_equal(xyz[k], v[i].xyz[k], 0.1 * s.h);
    }
    dmk_locus_destroy(&l);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&both);
    free_scene(&s);
}

static void lines_and_several_components_are_refused(void **state)
{
    (void)state;
    dmk_mesh *mesh = NULL;
    dmk_geodesics *g = NULL;
    dmk_locus *l = NULL;
    dmk_point p[2];
    dmk_geodesics_options o;
    const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 0, 0, 6, 0, 0, 5, 1, 0};
    const int32_t triangle[] = {0, 1, 2, 3, 4, 5};
    dmk_geodesics_options_init(&o, sizeof o);
    ok(dmk_mesh_create(ctx, 6, xyz, 2, triangle, &mesh));
    for (int i = 0; i < 2; i++) ok(dmk_mesh_vertex_point(ctx, mesh, 3 * i, &p[i]));
    ok(dmk_geodesics_create(ctx, mesh, 2, p, NULL, &g));
    assert_int_equal(dmk_geodesics_locus(ctx, g, NULL, &l), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "sources 0 and 1 lie on two components"));
    dmk_geodesics_destroy(&g);
    o.border = 1;
    ok(dmk_geodesics_create(ctx, mesh, 0, NULL, &o, &g));
    assert_int_equal(dmk_geodesics_locus(ctx, g, NULL, &l), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "borders"));
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&mesh);
}

static int setup(void **state)
{
    const int rc = context_setup(state);
    ctx = *state;
    return rc;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_voronoi_diagram),
        cmocka_unit_test(two_points_next_to_each_other),
        cmocka_unit_test(on_a_torus),
        cmocka_unit_test(other_components_change_nothing),
        cmocka_unit_test(lines_and_several_components_are_refused),
    };
    return cmocka_run_group_tests(tests, setup, context_teardown);
}
