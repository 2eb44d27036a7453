/* Meshes: topology, what is refused and how it is said, counts, points on the surface. */
#include "mesh/mesh.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define COUNT(a) (sizeof(a) / sizeof *(a))

static void assert_near(double x, double y, double tolerance)
{
    if (!(fabs(x - y) <= tolerance)) fail_msg("%.17g is not %.17g", x, y);
}

static int setup(void **state)
{
    return dmk_context_create((dmk_context **)state);
}

static int teardown(void **state)
{
    dmk_context_destroy((dmk_context **)state);
    return 0;
}

/* A tetrahedron, outward; vertices 4 and up are spare ones for tests to use. */
static const double tetra_xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0,  0,  1,
                                   2, 0, 0, 0, 2, 0, 0, 0, 2, -1, -1, -1};
#define N_SPARE 8
static const int32_t tetra[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};

static dmk_mesh *create(dmk_context *ctx, size_t n_vertices, const double *xyz, size_t n_triangles,
                        const int32_t *triangles)
{
    dmk_mesh *mesh = NULL;
    if (dmk_mesh_create(ctx, n_vertices, xyz, n_triangles, triangles, &mesh) != DMK_OK) {
        fail_msg("%s", dmk_context_message(ctx));
    }
    return mesh;
}

/* The mesh must be refused with a message that has all the blank-separated words of `words`, where
 * '_' stands for a blank. */
static void check_refused(dmk_context *ctx, size_t n_vertices, const double *xyz,
                          size_t n_triangles, const int32_t *triangles, int status,
                          const char *words)
{
    dmk_mesh *mesh = NULL;
    int rc = dmk_mesh_create(ctx, n_vertices, xyz, n_triangles, triangles, &mesh);
    const char *message = dmk_context_message(ctx);
    assert_int_equal(rc, status);
    assert_null(mesh);
    while (*words) {
        char word[128];
        size_t n = strcspn(words, " ");
        snprintf(word, sizeof word, "%.*s", (int)n, words);
        for (char *p = word; *p; p++) *p = *p == '_' ? ' ' : *p;
        if (!strstr(message, word)) fail_msg("'%s' is not in: %s", word, message);
        words += n + (words[n] == ' ');
    }
}

/* A rows x columns grid of squares, split in two triangles each, wrapped by `wrap`: bit 0 joins the
 * columns' ends, bit 1 the rows' ends, bit 2 turns the join of the columns over. Places are those
 * of the flat sheet, bent a little, and of no interest. */
typedef struct grid {
    size_t n_vertices, n_triangles;
    double xyz[3 * 200];
    int32_t triangle[3 * 400];
} grid;

static int32_t grid_vertex(int rows, int columns, int wrap, int i, int j)
{
    if (wrap & 1 && j == columns) {
        j = 0;
        if (wrap & 4) i = rows - i;
    }
    if (wrap & 2) i = i % rows;
    return (int32_t)(i * (wrap & 1 ? columns : columns + 1) + j);
}

static void make_grid(int rows, int columns, int wrap, grid *g)
{
    memset(g, 0, sizeof *g);
    int n_i = wrap & 2 ? rows : rows + 1, n_j = wrap & 1 ? columns : columns + 1;
    g->n_vertices = (size_t)(n_i * n_j);
    for (int v = 0; v < n_i * n_j; v++) {
        g->xyz[3 * v] = v / n_j;
        g->xyz[3 * v + 1] = v % n_j;
        g->xyz[3 * v + 2] = 0.1 * sin(v);
    }
    for (int i = 0; i < rows; i++) {
        for (int j = 0; j < columns; j++) {
            int32_t a = grid_vertex(rows, columns, wrap, i, j);
            int32_t b = grid_vertex(rows, columns, wrap, i + 1, j);
            int32_t c = grid_vertex(rows, columns, wrap, i + 1, j + 1);
            int32_t d = grid_vertex(rows, columns, wrap, i, j + 1);
            const int32_t two[6] = {a, b, c, a, c, d};
            memcpy(g->triangle + 3 * g->n_triangles, two, sizeof two);
            g->n_triangles += 2;
        }
    }
}

/* ---- accepted ---- */

static void test_topology_there_and_back(void **state)
{
    grid g;
    make_grid(4, 5, 3, &g);
    dmk_mesh *m = create(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle);
    assert_int_equal(m->n_edges, 60);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        for (int k = 0; k < 3; k++) {
            const int32_t *c = m->triangle + 3 * t, *pair, *ends;
            int32_t e = m->triangle_edge[3 * t + k], from = c[(k + 1) % 3], to = c[(k + 2) % 3];
            pair = m->edge_triangle + 2 * e;
            ends = m->edge_vertex + 2 * e;
            assert_true(ends[0] < ends[1]);
            assert_true((ends[0] == from && ends[1] == to) || (ends[0] == to && ends[1] == from));
            /* the first triangle runs the edge from the smaller end to the larger */
            assert_int_equal(pair[ends[0] == from ? 0 : 1], t);
        }
    }
    assert_memory_equal(dmk_mesh_vertices(m), g.xyz, 3 * g.n_vertices * sizeof *g.xyz);
    assert_memory_equal(dmk_mesh_triangles(m), g.triangle, 3 * g.n_triangles * sizeof *g.triangle);
    assert_ptr_equal(dmk_mesh_edges(m), m->edge_vertex);
    dmk_mesh_destroy(&m);
    assert_null(m);
    dmk_mesh_destroy(&m);
}

static void test_info_of_tetrahedron(void **state)
{
    dmk_mesh *m = create(*state, N_SPARE, tetra_xyz, 4, tetra);
    dmk_mesh_info info;
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_vertices, N_SPARE);
    assert_int_equal(info.n_triangles, 4);
    assert_int_equal(info.n_edges, 6);
    assert_int_equal(info.n_unused_vertices, N_SPARE - 4);
    assert_int_equal(info.n_border_edges, 0);
    assert_int_equal(info.n_border_loops, 0);
    assert_int_equal(info.n_components, 1);
    assert_int_equal(info.euler, 2);
    assert_near(info.area, 1.5 + sqrt(3) / 2, 1e-14);
    assert_near(info.min_edge, 1, 0);
    assert_near(info.max_edge, sqrt(2), 1e-15);
    assert_near(info.mean_edge, (3 + 3 * sqrt(2)) / 6, 1e-15);
    assert_near(info.min_angle, 45, 1e-12);
    assert_near(info.max_angle, 90, 1e-12);
    for (int k = 0; k < 3; k++) { /* unused vertices do not count */
        assert_near(info.box_min[k], 0, 0);
        assert_near(info.box_max[k], 1, 0);
    }
    dmk_mesh_destroy(&m);
}

static void test_borders_and_components(void **state)
{
    static const struct {
        int rows, columns, wrap;
        size_t border_edges, border_loops;
        int64_t euler;
    } cases[] = {{3, 4, 0, 14, 1, 1}, /* sheet */
                 {3, 5, 1, 10, 2, 0}, /* tube */
                 {4, 5, 3, 0, 0, 0}}; /* torus */
    for (size_t i = 0; i < COUNT(cases); i++) {
        grid g;
        dmk_mesh_info info;
        make_grid(cases[i].rows, cases[i].columns, cases[i].wrap, &g);
        dmk_mesh *m = create(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle);
        dmk_mesh_get_info(m, &info);
        assert_int_equal(info.n_border_edges, cases[i].border_edges);
        assert_int_equal(info.n_border_loops, cases[i].border_loops);
        assert_int_equal(info.euler, cases[i].euler);
        assert_int_equal(info.n_components, 1);
        dmk_mesh_destroy(&m);
    }
    int32_t two[24];
    memcpy(two, tetra, sizeof tetra);
    for (int k = 0; k < 12; k++) two[12 + k] = tetra[k] + 4;
    dmk_mesh_info info;
    dmk_mesh *m = create(*state, N_SPARE, tetra_xyz, 8, two);
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_components, 2);
    assert_int_equal(info.euler, 4);
    assert_int_equal(dmk_mesh_component(m, 3), 0);
    assert_int_equal(dmk_mesh_component(m, 4), 1);
    dmk_mesh_destroy(&m);
}

/* Two holes of a sheet that meet at a vertex make that vertex's fan two chains; two holes that do
 * not meet are two loops. */
static void test_holes(void **state)
{
    grid g;
    dmk_mesh_info info;
    make_grid(6, 6, 0, &g);
    const int drop[] = {2 * (1 * 6 + 1), 2 * (1 * 6 + 1) + 1, 2 * (4 * 6 + 4), 2 * (4 * 6 + 4) + 1};
    for (int i = 3; i >= 0; i--) {
        g.n_triangles--;
        memmove(g.triangle + 3 * drop[i], g.triangle + 3 * drop[i] + 3,
                3 * (g.n_triangles - (size_t)drop[i]) * sizeof *g.triangle);
    }
    dmk_mesh *m = create(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle);
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_border_loops, 3);
    assert_int_equal(info.n_border_edges, 24 + 8);
    assert_int_equal(info.euler, -1);
    dmk_mesh_destroy(&m);
}

/* ---- refused ---- */

static void test_refuses_bad_places(void **state)
{
    double xyz[3 * N_SPARE];
    memcpy(xyz, tetra_xyz, sizeof xyz);
    xyz[3 * 2 + 1] = NAN;
    check_refused(*state, N_SPARE, xyz, 4, tetra, DMK_E_MESH, "vertex_2 nan finite");
    xyz[3 * 2 + 1] = -INFINITY;
    check_refused(*state, N_SPARE, xyz, 4, tetra, DMK_E_MESH, "vertex_2 -inf finite");
    memcpy(xyz, tetra_xyz, sizeof xyz);
    for (int i = 0; i < 12; i++) xyz[i] *= 1e200;
    check_refused(*state, N_SPARE, xyz, 4, tetra, DMK_E_MESH, "triangle_0 scale_the_mesh");
    for (int i = 0; i < 12; i++) xyz[i] = tetra_xyz[i] * 1e-100;
    check_refused(*state, N_SPARE, xyz, 4, tetra, DMK_E_MESH, "triangle_0 scale_the_mesh");
}

static void test_refuses_bad_indices(void **state)
{
    int32_t t[12];
    memcpy(t, tetra, sizeof t);
    t[7] = 99;
    check_refused(*state, N_SPARE, tetra_xyz, 4, t, DMK_E_MESH, "triangle_2 vertex_99 there_are_8");
    t[7] = N_SPARE;
    check_refused(*state, N_SPARE, tetra_xyz, 4, t, DMK_E_MESH, "triangle_2 vertex_8 there_are_8");
    for (int k = 6; k < 9; k++) {
        memcpy(t, tetra, sizeof t);
        t[k] = -1;
        check_refused(*state, N_SPARE, tetra_xyz, 4, t, DMK_E_MESH, "triangle_2 vertex_-1");
    }
    memcpy(t, tetra, sizeof t);
    t[7] = t[6];
    check_refused(*state, N_SPARE, tetra_xyz, 4, t, DMK_E_MESH, "triangle_2 degenerate repeated");
    check_refused(*state, N_SPARE, tetra_xyz, 0, t, DMK_E_MESH, "nothing_to_solve");
    check_refused(*state, N_SPARE, tetra_xyz, (size_t)1 << 40, t, DMK_E_MESH, "too_many");
    check_refused(*state, (size_t)1 << 62, tetra_xyz, 4, t, DMK_E_MESH, "too_many");
    check_refused(*state, N_SPARE, NULL, 4, t, DMK_E_ARG, "argument_`xyz`_is_NULL");
    check_refused(*state, N_SPARE, tetra_xyz, 4, NULL, DMK_E_ARG, "argument_`triangles`_is_NULL");
}

/* Two pyramids on one base of 100 corners: their tips, the first two vertices, have far more edges than others. */
static void test_hubs(void **state)
{
    enum { N = 100 };
    double xyz[3 * (N + 2)] = {0, 0, 1, 0, 0, -1};
    int32_t t[6 * N];
    dmk_mesh_info info;
    for (int i = 0; i < N; i++) {
        const int32_t here = 2 + i, next = 2 + (i + 1) % N;
        const double angle = 2 * M_PI * i / N;
        memcpy(xyz + 3 * here, (const double[]){cos(angle), sin(angle), 0}, 3 * sizeof *xyz);
        memcpy(t + 6 * i, (const int32_t[]){0, here, next, 1, next, here}, 6 * sizeof *t);
    }
    dmk_mesh *m = create(*state, N + 2, xyz, 2 * N, t);
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_edges, 3 * N);
    assert_int_equal(info.n_border_edges, 0);
    assert_int_equal(info.euler, 2);
    dmk_mesh_destroy(&m);
}

/* A mesh in another order measures its edges and areas anew, and takes over the rest. */
static void test_info_in_another_order(void **state)
{
    dmk_order order;
    dmk_mesh *m = create(*state, N_SPARE, tetra_xyz, 4, tetra);
    assert_int_equal(dmk_order_create(*state, m, 0, &order), DMK_OK);
    const dmk_mesh_info *info = &order.mesh->info;
    assert_near(order.mesh->sharpest, m->sharpest, 0);
    assert_near(info->min_angle, 45, 1e-12);
    assert_near(info->max_angle, 90, 1e-12);
    for (int k = 0; k < 3; k++) {
        assert_near(info->box_min[k], 0, 0);
        assert_near(info->box_max[k], 1, 0);
    }
    dmk_order_free(&order);
    dmk_mesh_destroy(&m);
}

static void test_refuses_zero_area(void **state)
{
    /* corners on a line, whose rounded lengths do not quite add up; two at the same place */
    const double line[] = {-0.6, -0.4, 0.6, -0.3, 0.2, 0.3, 0.3, 1.4, -0.3, 5, 4, 5};
    const double same[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0};
    const int32_t t[] = {3, 1, 0, 0, 1, 2};
    check_refused(*state, 4, line, 2, t, DMK_E_MESH, "triangle_1 degenerate area_is_zero 0_1_2");
    const int32_t u[] = {0, 1, 2, 2, 1, 3};
    check_refused(*state, 4, same, 2, u, DMK_E_MESH, "triangle_1 degenerate area_is_zero merge");
    /* thin but sound */
    const double thin[] = {0, 0, 0, 1, 0, 0, 0.5, 1e-6, 0};
    dmk_mesh *m = create(*state, 3, thin, 1, (const int32_t[]){0, 1, 2});
    assert_near(m->area[0], 0.5e-6, 1e-9);
    dmk_mesh_destroy(&m);
}

static void test_refuses_duplicates(void **state)
{
    int32_t t[18];
    memcpy(t, tetra, sizeof tetra);
    memcpy(t + 12, (const int32_t[]){3, 1, 2}, 3 * sizeof *t); /* triangle 2 again */
    check_refused(*state, N_SPARE, tetra_xyz, 5, t, DMK_E_MESH,
                  "triangles_2_and_4 duplicates vertices_1_2_3");
    memcpy(t + 12, (const int32_t[]){2, 1, 3}, 3 * sizeof *t); /* turned over */
    check_refused(*state, N_SPARE, tetra_xyz, 5, t, DMK_E_MESH, "triangles_2_and_4 duplicates");
    /* two alone, back to back: every edge is fine */
    const int32_t pillow[] = {0, 1, 2, 2, 1, 0};
    check_refused(*state, N_SPARE, tetra_xyz, 2, pillow, DMK_E_MESH,
                  "triangles_0_and_1 duplicates vertices_0_2_1");
}

static void test_refuses_non_manifold_edges(void **state)
{
    const int32_t same_way[] = {0, 1, 2, 1, 0, 3, 0, 1, 4};
    check_refused(*state, N_SPARE, tetra_xyz, 3, same_way, DMK_E_MESH,
                  "non-manifold_edge_0-1 triangles_0,_1_and_2 separate");
    int32_t fin[15];
    memcpy(fin, tetra, sizeof tetra);
    memcpy(fin + 12, (const int32_t[]){1, 2, 4}, 3 * sizeof *fin);
    check_refused(*state, N_SPARE, tetra_xyz, 5, fin, DMK_E_MESH,
                  "non-manifold_edge_1-2 triangles_0,_2_and_4");
}

static void test_refuses_non_manifold_vertices(void **state)
{
    /* a bow-tie of two triangles, with its border */
    const int32_t tie[] = {0, 1, 2, 0, 4, 5};
    check_refused(*state, N_SPARE, tetra_xyz, 2, tie, DMK_E_MESH,
                  "non-manifold_vertex_0 triangles_0_and_1 copy");
    /* two closed tetrahedra that share vertex 3 only */
    int32_t two[24];
    static const int32_t place[] = {4, 5, 6, 3};
    memcpy(two, tetra, sizeof tetra);
    for (int k = 0; k < 12; k++) two[12 + k] = place[tetra[k]];
    check_refused(*state, N_SPARE, tetra_xyz, 8, two, DMK_E_MESH,
                  "non-manifold_vertex_3 triangles_1_and_5");
    /* a closed one and a flap */
    int32_t flap[15];
    memcpy(flap, tetra, sizeof tetra);
    memcpy(flap + 12, (const int32_t[]){3, 4, 5}, 3 * sizeof *flap);
    check_refused(*state, N_SPARE, tetra_xyz, 5, flap, DMK_E_MESH, "non-manifold_vertex_3 4");
}

static void swap_corners(int32_t *t)
{
    int32_t a = t[0];
    t[0] = t[1];
    t[1] = a;
}

static void test_refuses_inconsistent_orientation(void **state)
{
    int32_t t[12];
    memcpy(t, tetra, sizeof t);
    swap_corners(t + 6);
    check_refused(*state, N_SPARE, tetra_xyz, 4, t, DMK_E_MESH,
                  "inconsistent_orientation triangles_0_and_2 edge_1-2 over_1_of_the_4");
    grid g;
    make_grid(4, 5, 3, &g);
    for (int i = 0; i < 30; i++) swap_corners(g.triangle + 3 * i);
    check_refused(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle, DMK_E_MESH,
                  "inconsistent_orientation over_10_of_the_40");
    make_grid(4, 5, 0, &g); /* the last square's second triangle */
    swap_corners(g.triangle + 3 * 39);
    check_refused(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle, DMK_E_MESH,
                  "inconsistent_orientation triangles_28_and_39 edge_22-23 over_1_of_the_40");
}

static void test_refuses_one_sided_surfaces(void **state)
{
    grid g;
    make_grid(3, 7, 1 | 4, &g);
    check_refused(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle, DMK_E_MESH,
                  "not_orientable Moebius cut_it_open triangles_17_and_18");
    make_grid(6, 7, 1 | 2 | 4, &g);
    check_refused(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle, DMK_E_MESH,
                  "not_orientable Klein cut_it_open");
}

/* ---- points ---- */

static void check_point(dmk_context *ctx, const dmk_mesh *m, const double xyz[3], int64_t triangle,
                        const double weight[3], double tolerance)
{
    dmk_point p = {-1, {0, 0, 0}};
    assert_int_equal(dmk_mesh_project(ctx, m, xyz, &p), DMK_OK);
    if (triangle >= 0) assert_int_equal(p.triangle, triangle);
    for (int k = 0; k < 3; k++) assert_near(p.weight[k], weight[k], tolerance);
}

static void test_projects_to_inside_edge_and_vertex(void **state)
{
    const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    dmk_mesh *m = create(*state, 3, xyz, 1, (const int32_t[]){0, 1, 2});
    static const struct {
        double xyz[3], weight[3];
    } cases[] = {{{0.25, 0.25, 3}, {0.5, 0.25, 0.25}}, /* above the inside */
                 {{0.25, -1, 1}, {0.75, 0.25, 0}},     /* beside an edge */
                 {{1, 1, -1}, {0, 0.5, 0.5}},          /* beside the long edge */
                 {{-1, -1, 0}, {1, 0, 0}},             /* behind a corner */
                 {{3, 0.5, 0}, {0, 1, 0}},
                 {{-0.5, 2, 0.1}, {0, 0, 1}},
                 {{1, 0, 0}, {0, 1, 0}}, /* a corner itself */
                 {{0.5, 0, 0}, {0.5, 0.5, 0}},
                 {{0.3, 1e-10, 0}, {0.7, 0.3, 0}},    /* nearly on an edge: snapped */
                 {{1 - 1e-10, 1e-11, 0}, {0, 1, 0}}}; /* nearly at a corner */
    for (size_t i = 0; i < COUNT(cases); i++) {
        check_point(*state, m, cases[i].xyz, 0, cases[i].weight, 1e-9);
        dmk_point p;
        assert_int_equal(dmk_mesh_project(*state, m, cases[i].xyz, &p), DMK_OK);
        for (int k = 0; k < 3; k++) {
            if (cases[i].weight[k] == 0) assert_true(p.weight[k] == 0);
            if (cases[i].weight[k] == 1) assert_true(p.weight[k] == 1);
        }
    }
    dmk_mesh_destroy(&m);
}

/* Against all triangles sampled finely: nothing on the surface is nearer. */
static void test_projects_to_the_nearest(void **state)
{
    grid g;
    make_grid(6, 6, 0, &g);
    dmk_mesh *m = create(*state, g.n_vertices, g.xyz, g.n_triangles, g.triangle);
    for (int i = 0; i < 200; i++) {
        const double x[3] = {3 + 5 * sin(1.7 * i), 3 + 5 * cos(2.3 * i), sin(0.9 * i)};
        dmk_point p;
        double y[3], best = INFINITY;
        assert_int_equal(dmk_mesh_project(*state, m, x, &p), DMK_OK);
        assert_int_equal(dmk_mesh_point_xyz(*state, m, &p, y), DMK_OK);
        double found = hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
        for (int32_t t = 0; t < m->n_triangles; t++) {
            for (int k = 0; k < 66; k++) { /* the points i/10, j/10 of the triangle */
                int a = 0, b = k;
                while (b > 10 - a) b -= 11 - a, a++;
                dmk_point q = {t, {a / 10.0, b / 10.0, (10 - a - b) / 10.0}};
                assert_int_equal(dmk_mesh_point_xyz(*state, m, &q, y), DMK_OK);
                best = fmin(best, hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]));
            }
        }
        assert_true(found <= best + 1e-12);
        assert_true(found >= best - 0.1);
    }
    dmk_mesh_destroy(&m);
}

/* Many at once as each alone, also where several triangles are equally near. */
/* A point of a needle is its own foot, however thin the needle is and whichever corner comes first. */
static void test_projects_to_needles(void **state)
{
    (void)state;
    const double a[3] = {0.1, 0.2, 0.3}, b[3] = {0.9, 0.3, 0.7}, side = 0.9,
                 out[3] = {0.3, 0.8, 0.5};
    for (double thin = 0.1; thin > 1e-14; thin /= 3) {
        double c[3], x[3], w[3];
        for (int k = 0; k < 3; k++) c[k] = a[k] + 0.37 * (b[k] - a[k]) + thin * out[k];
        const double *const corner[5] = {a, b, c, a, b};
        for (int i = 0; i < 3; i++) {
            double off = 0;
            for (int k = 0; k < 3; k++) x[k] = 0.2 * a[k] + 0.5 * b[k] + 0.3 * c[k];
            const double told = sqrt(dmk_project_corners(corner + i, x, w));
            for (int k = 0; k < 3; k++) {
                double y = 0;
                for (int j = 0; j < 3; j++) y += w[j] * corner[i + j][k];
                off = fmax(off, fabs(y - x[k]));
            }
            assert_true(off < 1e-14 * side && told < 1e-14 * side);
        }
    }
}

static void test_projects_many(void **state)
{
    enum { N = 600 };
    double x[3 * N];
    dmk_point all[N], one;
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_read(*state, "tests/data/rough.off", &m), DMK_OK);
    assert_true(m->n_triangles > 600); /* three larger boxes */
    for (int i = 0; i < N; i++) {
        const double *a = m->xyz + 3 * (size_t)(7 * i % m->n_vertices),
                     *b = m->xyz + 3 * (size_t)(11 * i % m->n_vertices), s = i % 3 / 2.0;
        for (int k = 0; k < 3; k++) x[3 * i + k] = a[k] + s * (b[k] - a[k]);
    }
    assert_int_equal(dmk_mesh_project_all(*state, m, N, x, all), DMK_OK);
    for (int i = 0; i < N; i++) {
        assert_int_equal(dmk_mesh_project(*state, m, x + 3 * i, &one), DMK_OK);
        assert_int_equal(all[i].triangle, one.triangle);
        assert_memory_equal(all[i].weight, one.weight, sizeof one.weight);
    }
    assert_int_equal(dmk_mesh_project_all(*state, m, 0, NULL, NULL), DMK_OK);
    for (size_t n = 5; n <= N; n += N - 5) { /* a few are looked for one at a time */
        x[9] = NAN;
        assert_int_equal(dmk_mesh_project_all(*state, m, n, x, all), DMK_E_ARG);
        assert_non_null(strstr(dmk_context_message(*state), "point 3: the point (nan,"));
    }
    dmk_mesh_destroy(&m);
}

static void test_vertex_points(void **state)
{
    dmk_mesh *m = create(*state, N_SPARE, tetra_xyz, 4, tetra);
    dmk_point p;
    double x[3];
    for (int64_t v = 0; v < 4; v++) {
        assert_int_equal(dmk_mesh_vertex_point(*state, m, v, &p), DMK_OK);
        assert_int_equal(dmk_mesh_point_xyz(*state, m, &p, x), DMK_OK);
        assert_memory_equal(x, tetra_xyz + 3 * v, sizeof x);
        for (int h = 0; h < 3 * p.triangle; h++) assert_int_not_equal(tetra[h], v); /* the first */
        /* projecting a vertex finds it exactly */
        assert_int_equal(dmk_mesh_project(*state, m, tetra_xyz + 3 * v, &p), DMK_OK);
        int k = p.weight[0] == 1 ? 0 : p.weight[1] == 1 ? 1 : 2;
        assert_true(p.weight[k] == 1);
        assert_int_equal(tetra[3 * p.triangle + k], v);
    }
    dmk_mesh_destroy(&m);
}

static void test_refuses_bad_points(void **state)
{
    dmk_mesh *m = create(*state, N_SPARE, tetra_xyz, 4, tetra);
    dmk_point p;
    double x[3];
    assert_int_equal(dmk_mesh_vertex_point(*state, m, 4, &p), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(*state), "vertex 4 is in no triangle"));
    assert_int_equal(dmk_mesh_vertex_point(*state, m, 8, &p), DMK_E_ARG);
    assert_int_equal(dmk_mesh_vertex_point(*state, m, -1, &p), DMK_E_ARG);
    assert_int_equal(dmk_mesh_project(*state, m, (const double[]){0, NAN, 0}, &p), DMK_E_ARG);
    assert_int_equal(dmk_mesh_project(*state, m, (const double[]){INFINITY, 0, 0}, &p), DMK_E_ARG);
    assert_int_equal(dmk_mesh_project(*state, m, (const double[]){1e300, 0, 0}, &p), DMK_E_ARG);
    static const dmk_point bad[] = {{-1, {1, 0, 0}},
                                    {4, {1, 0, 0}},
                                    {0, {0.5, 0.4, 0}},
                                    {0, {1.5, -0.5, 0}},
                                    {0, {NAN, 0.5, 0.5}}};
    for (size_t i = 0; i < COUNT(bad); i++) {
        assert_int_equal(dmk_mesh_point_xyz(*state, m, &bad[i], x), DMK_E_ARG);
    }
    dmk_mesh_destroy(&m);
}

/* ---- large meshes, whose edges are built on several threads ------------------------------------- */

enum {
    SIDE = 101,
    N_GRID = (SIDE + 1) * (SIDE + 1),
    ALL_TRIANGLES = 2 * SIDE * SIDE + 4 * SIDE - 3
};

static int32_t node(int i, int j)
{
    return 1 + i * (SIDE + 1) + j;
}

/* Vertex k of the grid's border, counterclockwise. */
static int32_t rim(int k)
{
    const int side = k / SIDE % 4, at = k % SIDE;
    return side == 0   ? node(at, 0)
           : side == 1 ? node(SIDE, at)
           : side == 2 ? node(SIDE - at, SIDE)
                       : node(0, SIDE - at);
}

/* A square, and below it a hub, vertex 0, joined to its border but for three edges. */
static dmk_mesh *square_with_hub(dmk_context *ctx)
{
    double *xyz = calloc(3 * (N_GRID + 1), sizeof *xyz);
    int32_t *triangle = malloc(3 * ALL_TRIANGLES * sizeof *triangle), *t = triangle;
    assert_true(xyz && triangle);
    xyz[0] = xyz[1] = 0.5 * SIDE, xyz[2] = -SIDE;
    for (int i = 0; i <= SIDE; i++) {
        for (int j = 0; j <= SIDE; j++) xyz[3 * node(i, j)] = i, xyz[3 * node(i, j) + 1] = j;
    }
    for (int i = 0; i < SIDE; i++) {
        for (int j = 0; j < SIDE; j++) {
            *t++ = node(i, j), *t++ = node(i + 1, j), *t++ = node(i + 1, j + 1);
            *t++ = node(i, j), *t++ = node(i + 1, j + 1), *t++ = node(i, j + 1);
        }
    }
    for (int k = 3; k < 4 * SIDE; k++) *t++ = rim(k + 1), *t++ = rim(k), *t++ = 0;
    dmk_mesh *m = create(ctx, N_GRID + 1, xyz, ALL_TRIANGLES, triangle);
    free(xyz);
    free(triangle);
    return m;
}

/* Every half-edge's edge has its ends, the smaller first, and its triangle, first the one that runs it from there. */
static void check_edges(const dmk_mesh *m)
{
    assert_int_equal(m->n_edges, (3 * m->n_triangles + 5) / 2);
    assert_int_equal(m->n_border_edges, 5);
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const int32_t a = m->triangle[dmk_next(h)], b = m->triangle[dmk_previous(h)];
        const int32_t e = m->triangle_edge[h], *pair = m->edge_triangle + 2 * e;
        assert_int_equal(m->edge_vertex[2 * e], a < b ? a : b);
        assert_int_equal(m->edge_vertex[2 * e + 1], a < b ? b : a);
        assert_int_equal(pair[a < b || pair[1] < 0 ? 0 : 1], h / 3);
    }
}

static void test_edges_on_any_number_of_threads(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *one = NULL;
    for (int threads = 1; threads <= 9; threads += 2) {
        assert_int_equal(dmk_context_set_threads(ctx, threads), DMK_OK);
        dmk_mesh *m = square_with_hub(ctx);
        check_edges(m);
        if (!one) {
            one = m;
            continue;
        }
        const size_t n = 3 * (size_t)m->n_triangles;
        assert_memory_equal(m->triangle_edge, one->triangle_edge, n * sizeof *m->triangle_edge);
        dmk_mesh_destroy(&m);
    }
    dmk_mesh_destroy(&one);
    assert_int_equal(dmk_context_set_threads(ctx, 0), DMK_OK);
}

/* ---- samples ---- */

enum { ACROSS = 7, PLACES = ACROSS * ACROSS, ALL = PLACES + 3 };

/* A plane of uneven squares, and a triangle beside it; returns the number of triangles. */
static int32_t scatter(double *xyz, int32_t *triangle)
{
    static const double beside[9] = {20, 0, 0, 21, 0, 0, 20, 1, 0};
    int32_t n = 0;
    uint32_t noise = 5;
    for (int v = 0; v < PLACES; v++) {
        for (int k = 0; k < 2; k++) {
            noise = noise * 1664525u + 1013904223u;
            xyz[3 * v + k] = (k ? v / ACROSS : v % ACROSS) + 0.5 * (noise / 4294967296.0 - 0.5);
        }
    }
    memcpy(xyz + 3 * PLACES, beside, sizeof beside);
    for (int32_t v = 0; v < PLACES - ACROSS; v++) {
        if (v % ACROSS == ACROSS - 1) continue;
        const int32_t two[6] = {v, v + 1, v + ACROSS + 1, v, v + ACROSS + 1, v + ACROSS};
        memcpy(triangle + 3 * n, two, sizeof two);
        n += 2;
    }
    memcpy(triangle + 3 * n, (int32_t[]){PLACES, PLACES + 1, PLACES + 2}, 3 * sizeof *triangle);
    return n + 1;
}

static double turn_of(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static void link_two(double (*way)[ALL], const double *xyz, int32_t a, int32_t b)
{
    way[a][b] = way[b][a] = hypot(xyz[3 * a] - xyz[3 * b], xyz[3 * a + 1] - xyz[3 * b + 1]);
}

/* The shortest ways along edges and across pairs of triangles, by Floyd and Warshall. */
static void find_ways(const double *xyz, int32_t n, const int32_t *triangle, double (*way)[ALL])
{
    for (int a = 0; a < ALL; a++) {
        for (int b = 0; b < ALL; b++) way[a][b] = a == b ? 0 : INFINITY;
    }
    for (int32_t h = 0; h < 3 * n; h++) {
        const int32_t a = triangle[h], b = triangle[h % 3 == 2 ? h - 2 : h + 1];
        const int32_t c = triangle[h / 3 * 3 + (h + 2) % 3];
        link_two(way, xyz, a, b);
        for (int32_t g = 0; g < 3 * n; g++) { /* its twin, and the way from c across it */
            if (triangle[g] != b || triangle[g % 3 == 2 ? g - 2 : g + 1] != a) continue;
            const int32_t d = triangle[g / 3 * 3 + (g + 2) % 3];
            const double *x = xyz + 3 * c, *y = xyz + 3 * d;
            if (turn_of(x, y, xyz + 3 * a) * turn_of(x, y, xyz + 3 * b) < 0)
                link_two(way, xyz, c, d);
        }
    }
    for (int k = 0; k < ALL; k++) {
        for (int a = 0; a < ALL; a++) {
            for (int b = 0; b < ALL; b++) way[a][b] = fmin(way[a][b], way[a][k] + way[k][b]);
        }
    }
}

/* Each sample is the farthest from those before it; another component comes second, an unused vertex never. */
static void test_samples_are_the_farthest(void **state)
{
    static double way[ALL][ALL];
    double xyz[3 * (ALL + 1)] = {0}, away[ALL];
    int32_t triangle[6 * PLACES];
    int64_t sample[ALL];
    const int32_t n = scatter(xyz, triangle);
    find_ways(xyz, n, triangle, way);
    dmk_mesh *m = create(*state, ALL + 1, xyz, (size_t)n, triangle);
    assert_int_equal(dmk_mesh_sample(*state, m, ALL, 8, sample), DMK_OK);
    assert_true(sample[0] == 8 && sample[1] == PLACES);
    for (int b = 0; b < ALL; b++) away[b] = INFINITY;
    for (int i = 0; i < ALL; i++) {
        double most = 0;
        for (int b = 0; b < ALL; b++) most = fmax(most, away[b]);
        if (isinf(most))
            assert_true(isinf(away[sample[i]]));
        else
            assert_near(away[sample[i]], most, 1e-12);
        for (int b = 0; b < ALL; b++) away[b] = fmin(away[b], way[sample[i]][b]);
        assert_true(away[sample[i]] == 0);
    }
    dmk_mesh_destroy(&m);
}

/* Points and triangles stay; what would read the edges is refused, and what a solver has ordered before is not. */
static void test_forgets_edges(void **state)
{
    dmk_context *ctx = *state;
    int64_t vertex = -1;
    dmk_mesh_info info;
    dmk_geodesics *g = NULL, *earlier = NULL;
    dmk_locus *locus = NULL;
    dmk_path path;
    dmk_value value;
    double integral, error;
    dmk_solver *before = NULL, *after = NULL;
    const dmk_point p = {.weight = {1}};
    dmk_mesh *m = create(ctx, 4, tetra_xyz, 4, tetra);
    assert_int_equal(dmk_solver_create(ctx, NULL, m, &before), DMK_OK);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, NULL, &earlier), DMK_OK);
    dmk_mesh_forget_edges(m);
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_edges, 6);
    assert_memory_equal(dmk_mesh_triangles(m), tetra, sizeof tetra);
    assert_null(dmk_mesh_edges(m));
    assert_int_equal(dmk_mesh_sample(ctx, m, 1, 0, &vertex), DMK_E_ARG);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, NULL, &g), DMK_E_ARG);
    assert_int_equal(dmk_solver_create(ctx, NULL, m, &after), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(ctx), "no edges any more"));
    assert_true(before && !after && !g);
    assert_int_equal(dmk_geodesics_integrate(ctx, earlier, &integral, &error), DMK_E_ARG);
    assert_int_equal(dmk_geodesics_at(ctx, earlier, 1, &p, &value), DMK_E_ARG);
    assert_int_equal(dmk_geodesics_paths(ctx, earlier, 1, &p, &path), DMK_E_ARG);
    assert_int_equal(dmk_geodesics_locus(ctx, earlier, NULL, &locus), DMK_E_ARG);
    assert_null(locus);
    dmk_geodesics_destroy(&earlier);
    dmk_solver_destroy(&before);
    dmk_mesh_destroy(&m);
    dmk_mesh_forget_edges(NULL);
}

/* ---- polygons --------------------------------------------------------------------------------- */

/* Twice the area of the triangle a b c in the plane of z = 0, below 0 if it turns clockwise. */
static double turn(const double *a, const double *b, const double *c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* All triangles turn as the polygon does, and fill its area. */
static void check_split(dmk_context *ctx, size_t n, const double *xyz)
{
    int32_t *corner = calloc(n, sizeof *corner), *t = calloc(3 * n, sizeof *t);
    double area = 0, filled = 0;
    for (size_t i = 0; i < n; i++) corner[i] = (int32_t)i;
    assert_int_equal(dmk_polygons_split(ctx, n, xyz, 1, n, corner, t), DMK_OK);
    for (size_t i = 1; i + 1 < n; i++) area += turn(xyz, xyz + 3 * i, xyz + 3 * (i + 1));
    for (size_t i = 0; i < n - 2; i++) {
        const int32_t *v = t + 3 * i;
        const double one = turn(xyz + 3 * v[0], xyz + 3 * v[1], xyz + 3 * v[2]);
        assert_true(one / area > 0);
        filled += one;
    }
    assert_near(filled, area, 1e-12 * fabs(area));
    free(corner);
    free(t);
}

/* A wheel with teeth. */
static double *cog(size_t n)
{
    double *xyz = calloc(3 * n, sizeof *xyz);
    for (size_t i = 0; i < n; i++) {
        const double r = i % 4 < 2 ? 1 : 0.7, angle = 2 * 3.14159265358979 * (double)i / (double)n;
        xyz[3 * i] = r * cos(angle);
        xyz[3 * i + 1] = r * sin(angle);
    }
    return xyz;
}

static void test_polygons_without_fan(void **state)
{
    double *wheel = cog(40);
    check_split(*state, 40, wheel);
    for (size_t i = 0; i < 20; i++) { /* the other way round */
        for (size_t k = 0; k < 2; k++) {
            const double x = wheel[3 * i + k];
            wheel[3 * i + k] = wheel[3 * (39 - i) + k];
            wheel[3 * (39 - i) + k] = x;
        }
    }
    check_split(*state, 40, wheel);
    for (size_t i = 0; i < 120; i++) wheel[i] = ldexp(wheel[i], -500);
    check_split(*state, 40, wheel);
    free(wheel);
    /* A dart, from each of its corners. */
    static const double dart[] = {0, 0, 0, 2, 1, 0, 0, .5, 0, -2, 1, 0, 0, 0, 0, 2, 1, 0, 0, .5, 0};
    for (size_t i = 0; i < 4; i++) check_split(*state, 4, dart + 3 * i);
    /* Corners within straight sides. */
    static const double straight[] = {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0,
                                      0, 2, 1, 0, 1, 2, 0, 0, 3, 0};
    check_split(*state, 7, straight);
}

/* A corner that digits have moved off a straight side makes no sliver; one that is there on purpose has its fan. */
static void test_polygon_almost_flat(void **state)
{
    static const int32_t corner[] = {0, 1, 2, 3}, fan[] = {0, 1, 2, 0, 2, 3},
                         other[] = {0, 1, 3, 1, 2, 3};
    for (int bent = 0; bent < 2; bent++) {
        const double h = bent ? 4.2e-5 : 2.4e-5; /* thicknesses 1.4e-5 and 0.8e-5 */
        const double xyz[] = {0, 0, 0, 1, -h, 0, 2, 0, 0, 1, 2, 0};
        int32_t t[6];
        assert_int_equal(dmk_polygons_split(*state, 4, xyz, 1, 4, corner, t), DMK_OK);
        if (bent)
            assert_memory_equal(t, fan, sizeof fan);
        else
            assert_true(memcmp(t, other, sizeof other) == 0 || (t[2] == 3 && t[3] == 1));
    }
}

/* A polygon that crosses itself, or has no plane, is split all the same. */
static void test_polygon_crossing(void **state)
{
    static const int32_t corner[] = {0, 1, 2, 3};
    static const double all[][12] = {{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0},
                                     {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0, 0},
                                     {0, 0, 0, NAN, 0, 0, INFINITY, 0, 0, 1, 1, 0},
                                     {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1}};
    for (size_t i = 0; i < COUNT(all); i++) {
        int32_t t[6] = {-1, -1, -1, -1, -1, -1}, seen = 0;
        assert_int_equal(dmk_polygons_split(*state, 4, all[i], 1, 4, corner, t), DMK_OK);
        for (int k = 0; k < 6; k++) seen |= 1 << t[k];
        assert_int_equal(seen, 15);
    }
}

/* 1000 corners are the most, but of a fan. */
static void test_polygon_too_many(void **state)
{
    double *wheel = cog(1004);
    int32_t corner[1004], *t = calloc(3 * 1002, sizeof *t);
    for (int32_t i = 0; i < 1004; i++) corner[i] = i;
    assert_int_equal(dmk_polygons_split(*state, 1004, wheel, 1, 1004, corner, t), DMK_E_MESH);
    assert_string_equal(dmk_context_message(*state),
                        "a face of 1004 corners (0, 1, 2, ...) that is not convex; more than 1000 "
                        "are too many: split it into triangles first");
    check_split(*state, 1000, wheel);
    for (size_t i = 0; i < 3 * 1004; i += 3) { /* without teeth */
        const double r = hypot(wheel[i], wheel[i + 1]);
        wheel[i] /= r;
        wheel[i + 1] /= r;
    }
    assert_int_equal(dmk_polygons_split(*state, 1004, wheel, 1, 1003, corner, t), DMK_OK);
    corner[7] = 1004;
    assert_int_equal(dmk_polygons_split(*state, 1004, wheel, 2, 4, corner, t), DMK_E_MESH);
    assert_string_equal(
        dmk_context_message(*state),
        "polygon 1 names the vertex 1004, but there are 1004 vertices, counted from 0");
    free(wheel);
    free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_topology_there_and_back),
        cmocka_unit_test(test_info_of_tetrahedron),
        cmocka_unit_test(test_borders_and_components),
        cmocka_unit_test(test_holes),
        cmocka_unit_test(test_refuses_bad_places),
        cmocka_unit_test(test_refuses_bad_indices),
        cmocka_unit_test(test_hubs),
        cmocka_unit_test(test_info_in_another_order),
        cmocka_unit_test(test_refuses_zero_area),
        cmocka_unit_test(test_refuses_duplicates),
        cmocka_unit_test(test_refuses_non_manifold_edges),
        cmocka_unit_test(test_refuses_non_manifold_vertices),
        cmocka_unit_test(test_refuses_inconsistent_orientation),
        cmocka_unit_test(test_refuses_one_sided_surfaces),
        cmocka_unit_test(test_projects_to_inside_edge_and_vertex),
        cmocka_unit_test(test_projects_to_the_nearest),
        cmocka_unit_test(test_projects_to_needles),
        cmocka_unit_test(test_projects_many),
        cmocka_unit_test(test_vertex_points),
        cmocka_unit_test(test_refuses_bad_points),
        cmocka_unit_test(test_edges_on_any_number_of_threads),
        cmocka_unit_test(test_samples_are_the_farthest),
        cmocka_unit_test(test_forgets_edges),
        cmocka_unit_test(test_polygons_without_fan),
        cmocka_unit_test(test_polygon_almost_flat),
        cmocka_unit_test(test_polygon_crossing),
        cmocka_unit_test(test_polygon_too_many),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
