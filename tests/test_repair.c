/* dmk_mesh_repair: what is broken in one way each, and what the maps say. */
#include "solving.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

typedef struct mended {
    dmk_mesh *mesh;
    dmk_repairs did;
    dmk_mesh_info info;
} mended;

static mended mend(bench *b, size_t n_vertices, const double *xyz, size_t n_triangles,
                   const int32_t *triangles)
{
    mended m = {0};
    bench_ok(b, dmk_mesh_repair(b->ctx, n_vertices, xyz, n_triangles, triangles, &m.did, &m.mesh));
    dmk_mesh_get_info(m.mesh, &m.info);
    assert_int_equal(m.did.n_old_vertices, n_vertices);
    assert_int_equal(m.did.n_vertices, m.info.n_vertices);
    assert_int_equal(m.did.n_triangles, m.info.n_triangles);
    for (size_t v = 0; v < m.info.n_vertices; v++) { /* where it was */
        const double *new = dmk_mesh_vertices(m.mesh) + 3 * v;
        const double *old = xyz + 3 * (size_t)m.did.vertex_old[v];
        for (int k = 0; k < 3; k++) assert_true(new[k] == old[k]);
    }
    for (size_t v = 0; v < n_vertices; v++) { /* and where it has gone */
        int32_t to = m.did.vertex_new[v];
        assert_true(to >= 0 && (size_t)to < m.info.n_vertices);
        for (int k = 0; k < 3; k++) {
            assert_true(dmk_mesh_vertices(m.mesh)[3 * to + k] == xyz[3 * v + (size_t)k]);
        }
    }
    return m;
}

static void forget(mended *m)
{
    dmk_repairs_free(&m->did);
    dmk_mesh_destroy(&m->mesh);
}

static const double cube_xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0,
                                  0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
static const int32_t cube[] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                               2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

static void a_good_mesh_stays_as_it_is(void **state)
{
    mended m = mend(*state, 8, cube_xyz, 12, cube);
    assert_memory_equal(dmk_mesh_triangles(m.mesh), cube, sizeof cube);
    for (int32_t i = 0; i < 12; i++) {
        assert_true(m.did.triangle_old[i] == i && (i >= 8 || m.did.vertex_old[i] == i));
    }
    assert_true(m.did.merged_vertices + m.did.turned_triangles + m.did.split_edges +
                    m.did.split_vertices + m.did.flipped_triangles + m.did.degenerate_triangles +
                    m.did.duplicate_triangles + m.did.seam_edges ==
                0);
    forget(&m);
}

/* Every triangle with vertices of its own, every third one turned, one there twice, one a point, one a line. */
static void a_soup_becomes_the_cube(void **state)
{
    double xyz[3 * 36 + 9];
    int32_t triangle[3 * 15];
    for (int h = 0; h < 36; h++) {
        int from = h / 3 % 3 == 0 ? 3 * (h / 3) + (3 - h % 3) % 3 : h;
        memcpy(xyz + 3 * h, cube_xyz + 3 * cube[from], 3 * sizeof *xyz);
        triangle[h] = h;
    }
    xyz[0] = -0.0;
    memcpy(triangle + 36, (int32_t[]){5, 3, 4, 0, 0, 1, 0, 1, 0}, 9 * sizeof *triangle);
    mended m = mend(*state, 36, xyz, 15, triangle);
    assert_int_equal(m.did.merged_vertices, 28);
    assert_int_equal(m.did.duplicate_triangles, 1);
    assert_int_equal(m.did.degenerate_triangles, 2);
    assert_int_equal(m.did.turned_triangles, 4);
    assert_true(m.info.n_vertices == 8 && m.info.n_triangles == 12 && m.info.euler == 2);
    assert_true(m.info.n_border_edges == 0 && m.info.n_components == 1);
    forget(&m);
}

/* Of a piece the fewer are turned, whichever they are and however the file begins. */
static void the_fewer_are_turned(void **state)
{
    for (int32_t odd = 0; odd < 12; odd++) {
        for (int most = 0; most < 2; most++) {
            int32_t triangle[36];
            for (int32_t t = 0; t < 12; t++) {
                const bool turned = (t == odd) != most;
                for (int k = 0; k < 3; k++)
                    triangle[3 * t + k] = cube[3 * t + (turned ? (3 - k) % 3 : k)];
            }
            mended m = mend(*state, 8, cube_xyz, 12, triangle);
            assert_int_equal(m.did.turned_triangles, 1);
            for (int32_t t = 0; t < 12; t++) { /* where most were */
                const int32_t *v = dmk_mesh_triangles(m.mesh) + 3 * t, *c = cube + 3 * t;
                const bool same = (v[0] == c[0] && v[1] == c[1]) ||
                                  (v[1] == c[0] && v[2] == c[1]) || (v[2] == c[0] && v[0] == c[1]);
                assert_int_equal(same, !most);
            }
            forget(&m);
        }
    }
}

/* A vertex on the side of its neighbour, a flat triangle between: the side is flipped, whatever the numbers. */
static void flat_triangles_are_flipped(void **state)
{
    static const double xyz[] = {0, 0, 0, 2, 0, 0, 1, 0, 0, 1, 1, 0, 1, -1, 0};
    static const int32_t four[] = {0, 1, 2, 1, 0, 4, 0, 2, 3, 2, 1, 3};
    for (int first = 0; first < 4; first++) {
        for (int turn = 0; turn < 9; turn++) {
            int32_t triangle[12];
            for (int t = 0; t < 4; t++) {
                const int32_t *c = four + 3 * ((t + first) % 4);
                for (int k = 0; k < 3; k++)
                    triangle[3 * t + (k + (t % 2 ? turn / 3 : turn)) % 3] = c[k];
            }
            mended m = mend(*state, 5, xyz, 4, triangle);
            assert_int_equal(m.did.flipped_triangles, 1);
            assert_true(m.info.n_triangles == 4 && m.info.n_border_edges == 4 && m.info.euler == 1);
            assert_true(fabs(m.info.area - 2) < 1e-12 && m.did.degenerate_triangles == 0);
            forget(&m);
        }
    }
}

/* The cube with its last corner twice, the second one `apart` from the first. */
static void repair_with_twin(bench *b, double apart, dmk_repairs *did)
{
    double xyz[27];
    int32_t triangle[42];
    dmk_mesh *mesh = NULL;
    memcpy(xyz, cube_xyz, sizeof cube_xyz);
    memcpy(xyz + 24, (const double[]){1, 1, 1 + apart}, 3 * sizeof *xyz);
    memcpy(triangle, cube, sizeof cube);
    triangle[3 * 3 + 1] = 8; /* of 5 7 6 */
    memcpy(triangle + 36, (const int32_t[]){6, 8, 7, 8, 5, 7}, 6 * sizeof *triangle);
    bench_ok(b, dmk_mesh_create(b->ctx, 9, xyz, 14, triangle, &mesh));
    dmk_mesh_destroy(&mesh);
    bench_ok(b, dmk_mesh_repair(b->ctx, 9, xyz, 14, triangle, did, &mesh));
    dmk_mesh_destroy(&mesh);
}

/* Marching cubes leave vertices as far apart as rounding goes, and triangles between them of which nothing is left
 * when they are cut. */
static void vertices_apart_by_rounding(void **state)
{
    dmk_repairs did;
    repair_with_twin(*state, 40 * DBL_EPSILON, &did);
    assert_true(did.merged_vertices == 1 && did.degenerate_triangles == 2 && did.n_triangles == 12);
    assert_true(did.vertex_new[8] == 7 && did.n_vertices == 8);
    dmk_repairs_free(&did);
    repair_with_twin(*state, 100 * DBL_EPSILON, &did);
    assert_true(did.merged_vertices == 0 && did.n_triangles == 14);
    dmk_repairs_free(&did);
}

/* Two cubes that share an edge, four triangles at it, and two that share a corner. */
static void touching_bodies_part(void **state)
{
    const double shift[2][3] = {{1, 1, 0}, {1, 1, 1}};
    for (int i = 0; i < 2; i++) {
        double xyz[48];
        int32_t triangle[72];
        memcpy(xyz, cube_xyz, sizeof cube_xyz);
        memcpy(triangle, cube, sizeof cube);
        for (int k = 0; k < 24; k++) xyz[24 + k] = cube_xyz[k] + shift[i][k % 3];
        for (int h = 0; h < 36; h++) triangle[36 + h] = 8 + cube[h];
        mended m = mend(*state, 16, xyz, 24, triangle);
        assert_int_equal(m.did.merged_vertices, i == 0 ? 2 : 1);
        assert_int_equal(m.did.split_edges, i == 0 ? 1 : 0);
        assert_true(m.info.n_border_edges == 0 && m.info.n_triangles == 24);
        assert_true(m.info.euler == 4 && m.info.n_components == 2 &&
                    m.did.split_vertices == 2U - (unsigned)i);
        forget(&m);
    }
}

/* A fin on a plane: the plane stays whole, the fin gets an edge of its own. */
static void a_fin_comes_off(void **state)
{
    const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, -1, 0, 0.5, 0, 1};
    const int32_t triangle[] = {0, 1, 2, 0, 3, 1, 0, 1, 4};
    mended m = mend(*state, 5, xyz, 3, triangle);
    assert_int_equal(m.did.split_edges, 1);
    assert_int_equal(m.did.split_vertices, 2);
    assert_int_equal(m.info.n_components, 2);
    const int32_t *t = dmk_mesh_triangles(m.mesh);
    assert_true(t[0] == 0 && t[3] == 0 && t[6] >= 5); /* the fin is it that changes */
    forget(&m);
}

/* Vertex 1 lies where vertex 0 does, 6 in no triangle, and the fin's vertices are split. */
static void vertices_have_their_old_numbers(void **state)
{
    bench *b = *state;
    const double xyz[] = {0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 1, -1, 0, 0.5, 0, 1, 9, 9, 9};
    const int32_t triangle[] = {1, 2, 3, 0, 4, 2, 0, 2, 5};
    mended m = mend(b, 7, xyz, 3, triangle);
    assert_int_equal(m.did.split_vertices, 2);
    for (int v = 0; v < 6; v++) {
        dmk_point at;
        double x[3];
        bench_ok(b, dmk_repairs_vertex_point(b->ctx, m.mesh, &m.did, v, &at));
        bench_ok(b, dmk_mesh_point_xyz(b->ctx, m.mesh, &at, x));
        assert_memory_equal(x, xyz + 3 * v, sizeof x);
    }
    static const struct {
        int64_t vertex;
        const char *why;
    } none[] = {{6, "vertex 6 is in no triangle"},
                {7, "vertex 7 is out of range [0, 6]"},
                {-1, "vertex -1 is out of range"}};
    for (int i = 0; i < 3; i++) {
        dmk_point at;
        assert_int_equal(dmk_repairs_vertex_point(b->ctx, m.mesh, &m.did, none[i].vertex, &at),
                         DMK_E_ARG);
        assert_non_null(strstr(dmk_context_message(b->ctx), none[i].why));
    }
    forget(&m);
}

static void a_moebius_strip_is_cut(void **state)
{
    enum { N = 24 };
    double xyz[6 * N];
    int32_t triangle[6 * N];
    for (int i = 0; i < N; i++) {
        double t = 6.283185307179586 * i / N;
        for (int k = 0; k < 2; k++) {
            double w = k ? 0.3 : -0.3, r = 1 + w * cos(t / 2);
            double *x = xyz + 6 * i + 3 * k;
            x[0] = r * cos(t), x[1] = r * sin(t), x[2] = w * sin(t / 2);
        }
        int32_t a = 2 * i, b = 2 * i + 1, c = i + 1 < N ? a + 2 : 1, d = i + 1 < N ? b + 2 : 0;
        memcpy(triangle + 6 * i, (int32_t[]){a, c, b, b, c, d}, 6 * sizeof *triangle);
    }
    mended m = mend(*state, 2 * N, xyz, 2 * N, triangle);
    assert_true(m.did.seam_edges == 1 && m.did.split_edges == 0 && m.did.split_vertices == 2);
    assert_true(m.info.euler == 1 && m.info.n_border_loops == 1 && m.info.n_components == 1);
    forget(&m);
}

/* Two sheets cross in an edge: each stays as flat as it was, though others of their four sides come first, whichever
 * axis the edge runs along. */
static void sheets_that_cross_stay_flat(void **state)
{
    static const double sheets[] = {0, 0, 0, 0, 0, 9, 1, 1, 5, 2, -2, 5, -3, 3, 5, -4, -4, 5};
    static const int32_t t[] = {0, 1, 2, 1, 0, 3, 0, 1, 4, 1, 0, 5};
    for (int turn = 0; turn < 3; turn++) {
        double xyz[18];
        for (int i = 0; i < 18; i++) xyz[i / 3 * 3 + (i + turn) % 3] = sheets[i];
        mended m = mend(*state, 6, xyz, 4, t);
        assert_int_equal(m.did.split_edges, 1);
        assert_int_equal(m.info.n_components, 2);
        const int32_t *now = dmk_mesh_triangles(m.mesh);
        assert_true(now[0] == now[10] && now[1] == now[9]);
        assert_true(now[3] == now[7] && now[4] == now[6]);
        assert_true(now[0] != now[4] && now[1] != now[3]);
        forget(&m);
    }
}

/* Three triangles at edge 2-3, the third of which hangs together with the others around both ends. */
static void a_third_sheet_comes_off_at_both_ends(void **state)
{
    const double xyz[] = {-3.3, 4.2, 0,   -2.7, 4.6, 0,   -0.2, 4.7, 0.4, 0.2, 4.7,
                          0.4,  0.5, 6.8, 0.6,  2.7, 4.6, 0.1,  3.3, 4.2, 0};
    const int32_t triangle[] = {5, 6, 3, 2, 3, 6, 2, 0, 1, 2, 6, 0, 2, 1, 3, 5, 3, 1, 4, 3, 2};
    mended m = mend(*state, 7, xyz, 7, triangle);
    assert_true(m.did.split_edges == 1 && m.did.split_vertices == 2 && m.did.seam_edges == 0);
    assert_true(m.info.n_triangles == 7 && m.info.n_edges == 14);
    forget(&m);
}

/* ---- soups ---------------------------------------------------------------------------------- */

static uint32_t draw(uint32_t *state, uint32_t n)
{
    *state = *state * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)*state * n >> 32);
}

enum { MOST_VERTICES = 40, MOST_TRIANGLES = 220 };

/* Of the soup, by the file's numbers: no corner twice, no three corners twice. */
static int32_t draw_soup(uint32_t *state, int32_t n_vertices, int32_t n, int32_t *triangle)
{
    bool there[MOST_VERTICES][MOST_VERTICES][MOST_VERTICES] = {0};
    int32_t kept = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t c[3];
        for (int k = 0; k < 3; k++) c[k] = (int32_t)draw(state, (uint32_t)n_vertices);
        if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0] || there[c[0]][c[1]][c[2]]) continue;
        for (int k = 0; k < 3; k++) {
            const int32_t x = c[k], y = c[(k + 1) % 3], z = c[(k + 2) % 3];
            there[x][y][z] = there[y][x][z] = true;
        }
        memcpy(triangle + 3 * kept++, c, sizeof c);
    }
    return kept;
}

/* At each pair of vertices of the file how many triangles there are, or, of a mesh, how many edges. */
typedef struct tally {
    int n[MOST_VERTICES][MOST_VERTICES];
} tally;

static void count_at(tally *at, int32_t a, int32_t b)
{
    at->n[a < b ? a : b][a < b ? b : a]++;
}

/* Nothing is lost, and edges of two triangles are as they were but for the seam. */
static void check_soup(const mended *m, int32_t n, const int32_t *triangle)
{
    tally before = {0}, after = {0}; /* triangles at an edge, joined pairs of them */
    size_t parted = 0, crowded = 0;
    assert_int_equal(m->info.n_triangles, n);
    for (int32_t t = 0; t < n; t++) {
        const int32_t *c = dmk_mesh_triangles(m->mesh) + 3 * t, *old = triangle + 3 * t;
        int32_t now[3];
        assert_int_equal(m->did.triangle_old[t], t);
        for (int k = 0; k < 3; k++) now[k] = m->did.vertex_old[c[k]];
        const bool turned = now[1] != old[1];
        for (int k = 0; k < 3; k++) {
            assert_int_equal(now[k], old[turned ? (3 - k) % 3 : k]);
            count_at(&before, old[k], old[(k + 1) % 3]);
        }
    }
    const int32_t *end = dmk_mesh_edges(m->mesh);
    for (size_t e = 0; e < m->info.n_edges; e++)
        count_at(&after, m->did.vertex_old[end[2 * e]], m->did.vertex_old[end[2 * e + 1]]);
    for (int a = 0; a < MOST_VERTICES; a++) {
        for (int b = a + 1; b < MOST_VERTICES; b++) {
            crowded += before.n[a][b] > 2;
            parted += before.n[a][b] == 2 && after.n[a][b] == 2;
        }
    }
    assert_true(parted == m->did.seam_edges && crowded == m->did.split_edges);
}

/* Triangles drawn from few vertices: edges of many, Moebius strips everywhere, vertices of several stars. */
static void any_soup_becomes_a_mesh(void **state)
{
    uint32_t random = 7;
    for (int i = 0; i < 6000; i++) {
        const int32_t n_vertices = 4 + (int32_t)draw(&random, MOST_VERTICES - 3);
        double xyz[3 * MOST_VERTICES];
        int32_t triangle[3 * MOST_TRIANGLES];
        for (int k = 0; k < 3 * n_vertices; k++) xyz[k] = 1e-6 * draw(&random, 1000000);
        const int32_t wanted = 1 + (int32_t)draw(&random, i % 2 ? MOST_TRIANGLES : 30),
                      n = draw_soup(&random, n_vertices, wanted, triangle);
        if (n == 0) continue;
        mended m = mend(*state, (size_t)n_vertices, xyz, (size_t)n, triangle);
        check_soup(&m, n, triangle);
        forget(&m);
    }
}

/* The same on the points of a lattice: vertices that coincide, triangles without area, flips. */
static void any_soup_on_a_lattice_becomes_a_mesh(void **state)
{
    bench *b = *state;
    uint32_t random = 11;
    for (int i = 0; i < 6000; i++) {
        const uint32_t wide = 2 + draw(&random, 3);
        double xyz[3 * MOST_VERTICES];
        int32_t triangle[3 * MOST_TRIANGLES];
        for (int k = 0; k < 3 * MOST_VERTICES; k++) xyz[k] = draw(&random, wide);
        const uint32_t n = 1 + draw(&random, i % 2 ? MOST_TRIANGLES : 30);
        for (uint32_t k = 0; k < 3 * n; k++) triangle[k] = (int32_t)draw(&random, MOST_VERTICES);
        mended m = {0};
        if (dmk_mesh_repair(b->ctx, MOST_VERTICES, xyz, n, triangle, &m.did, &m.mesh) == DMK_OK)
            forget(&m);
        else
            assert_non_null(
                strstr(dmk_context_message(b->ctx), "nothing to repair: no triangle has an area"));
    }
}

/* Tetrahedra around one edge, more triangles than are paired there: each is closed. */
static void bodies_around_an_edge_come_apart(void **state)
{
    enum { N = 50 };
    double xyz[6 * (N + 1)] = {0, 0, 0, 0, 0, 1};
    int32_t triangle[12 * N];
    for (int32_t i = 0; i < N; i++) {
        const int32_t c = 2 * i + 2, d = c + 1;
        for (int k = 0; k < 2; k++) {
            const double t = 6.283185307179586 * (i + 0.5 * k) / N;
            memcpy(xyz + 3 * (c + k), (double[]){cos(t), sin(t), 0.5}, 3 * sizeof *xyz);
        }
        const int32_t body[] = {0, c, 1, 1, d, 0, 0, d, c, 1, c, d};
        memcpy(triangle + 12 * i, body, sizeof body);
    }
    mended m = mend(*state, 2 * N + 2, xyz, 4 * N, triangle);
    assert_true(m.did.split_edges == 1 && m.did.split_vertices == 2 * N - 2);
    assert_true(m.info.n_border_edges == 0 && m.info.n_components == N && m.info.euler == 2 * N);
    forget(&m);
}

/* A triangle without area, its middle corner on the edge of the next one. */
static void a_flat_triangle_is_flipped(void **state)
{
    const double xyz[] = {0, 0, 0, 2, 0, 0, 1, 0, 0, 1, 1, 0, 1, -1, 0};
    const int32_t triangle[] = {0, 1, 3, 0, 2, 1, 0, 4, 2, 2, 4, 1};
    mended m = mend(*state, 5, xyz, 4, triangle);
    assert_true(m.did.flipped_triangles == 1 && m.did.degenerate_triangles == 0);
    assert_true(m.info.n_triangles == 4 && m.info.euler == 1 && fabs(m.info.area - 2) < 1e-12);
    forget(&m);
}

/* What the mesh calls flat a repair does, however lengths are rounded: no triangle is left to be refused. */
static void flat_is_what_the_mesh_calls_flat(void **state)
{
    bench *b = *state;
    const int32_t triangle[6] = {0, 2, 1, 0, 1, 3};
    for (int i = 0; i < 20000; i++) {
        mended m = {0};
        const double x = 0.1 + 0.9 * (i / 100) / 200, y = 1.2e-8 + 1.5e-10 * (i % 100);
        const double xyz[12] = {0, 0, 0, 1.1, 0, 0, x, y, 0, 0.5, -1, 0};
        bench_ok(b, dmk_mesh_repair(b->ctx, 4, xyz, 2, triangle, &m.did, &m.mesh));
        forget(&m);
    }
}

static void what_cannot_be_mended_is_refused(void **state)
{
    bench *b = *state;
    double xyz[24];
    dmk_mesh *mesh = NULL;
    memcpy(xyz, cube_xyz, sizeof xyz);
    xyz[5] = NAN;
    assert_int_equal(dmk_mesh_repair(b->ctx, 8, xyz, 12, cube, NULL, &mesh), DMK_E_MESH);
    assert_non_null(strstr(dmk_context_message(b->ctx), "not finite"));
    assert_int_equal(dmk_mesh_repair(b->ctx, 7, cube_xyz, 12, cube, NULL, &mesh), DMK_E_MESH);
    assert_non_null(strstr(dmk_context_message(b->ctx), "vertex 7, which does not exist"));
    const int32_t nothing[] = {0, 0, 1};
    assert_int_equal(dmk_mesh_repair(b->ctx, 8, cube_xyz, 1, nothing, NULL, &mesh), DMK_E_MESH);
    for (int far = 0; far < 2; far++) { /* no advice to repair once more */
        for (int k = 0; k < 24; k++) xyz[k] = cube_xyz[k] * (far ? 1.5e308 : 1e-70);
        xyz[0] = far ? -1.5e308 : 0;
        assert_int_equal(dmk_mesh_repair(b->ctx, 8, xyz, 12, cube, NULL, &mesh), DMK_E_MESH);
        assert_non_null(strstr(dmk_context_message(b->ctx), "scale the mesh"));
    }
    assert_int_equal(dmk_mesh_read_repaired(b->ctx, "tests/none.off", NULL, &mesh), DMK_E_IO);
    assert_null(mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_good_mesh_stays_as_it_is),
        cmocka_unit_test(a_soup_becomes_the_cube),
        cmocka_unit_test(the_fewer_are_turned),
        cmocka_unit_test(flat_triangles_are_flipped),
        cmocka_unit_test(vertices_apart_by_rounding),
        cmocka_unit_test(touching_bodies_part),
        cmocka_unit_test(a_fin_comes_off),
        cmocka_unit_test(vertices_have_their_old_numbers),
        cmocka_unit_test(a_moebius_strip_is_cut),
        cmocka_unit_test(sheets_that_cross_stay_flat),
        cmocka_unit_test(a_third_sheet_comes_off_at_both_ends),
        cmocka_unit_test(any_soup_becomes_a_mesh),
        cmocka_unit_test(any_soup_on_a_lattice_becomes_a_mesh),
        cmocka_unit_test(bodies_around_an_edge_come_apart),
        cmocka_unit_test(a_flat_triangle_is_flipped),
        cmocka_unit_test(flat_is_what_the_mesh_calls_flat),
        cmocka_unit_test(what_cannot_be_mended_is_refused),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
