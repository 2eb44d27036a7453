/* Vertices with two shortest paths: on a symmetric mesh the cut locus runs through them. */
#include "geodesic/geodesic.h"

#include "context.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* A torus of the radii 2 and 1 in columns and rows, all diagonals one way; vertex 0 is (3, 0, 0). */
enum { COLUMNS = 72, ROWS = 36, N = COLUMNS * ROWS };

static double around(int32_t v)
{
    return 2 * M_PI * (v % COLUMNS) / COLUMNS;
}

static double across(int32_t v)
{
    return 2 * M_PI * (v / COLUMNS) / ROWS;
}

static dmk_mesh *make(dmk_context *ctx, size_t n, const double *xyz, size_t n_triangles,
                      const int32_t *triangle)
{
    dmk_mesh *m;
    const int rc = dmk_mesh_create(ctx, n, xyz, n_triangles, triangle, &m);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    return m;
}

static dmk_mesh *make_torus(dmk_context *ctx)
{
    static double xyz[3 * N];
    static int32_t triangle[6 * N];
    for (int32_t v = 0; v < N; v++) {
        const double r = 2 + cos(across(v));
        xyz[3 * v] = r * cos(around(v)), xyz[3 * v + 1] = r * sin(around(v)),
                xyz[3 * v + 2] = sin(across(v));
        const int32_t next = v / COLUMNS * COLUMNS + (v + 1) % COLUMNS, up = (v + COLUMNS) % N,
                      both = (next + COLUMNS) % N;
        memcpy(triangle + 6 * v, (int32_t[]){v, next, both, v, both, up}, 6 * sizeof *triangle);
    }
    return make(ctx, N, xyz, 2 * N, triangle);
}

static dmk_geodesics *from_vertex(dmk_context *ctx, const dmk_mesh *m, int32_t v)
{
    dmk_point at;
    dmk_geodesics *g;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, v, &at), DMK_OK);
    if (dmk_geodesics_create(ctx, m, 1, &at, NULL, &g) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    return g;
}

/* Turned by pi about the x axis the mesh is itself, and the column behind the source, too: all of its vertices have two
 * paths. Others that have lie on the columns and rows that the turn leaves where they are. */
static void the_column_behind_the_source(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_torus(ctx);
    dmk_tie *first = NULL;
    size_t n_first = 0;
    for (int threads = 1; threads <= 8; threads++) {
        assert_int_equal(dmk_context_set_threads(ctx, threads), DMK_OK);
        dmk_geodesics *g = from_vertex(ctx, m, 0);
        int n = 0;
        for (int32_t v = COLUMNS / 2; v < N; v += COLUMNS) n += dmk_geodesics_tie(g, v) != NULL;
        assert_int_equal(n, ROWS);
        for (size_t i = 0; i < g->n_ties; i++) {
            const dmk_arrival *own = g->arrival + g->tie[i].vertex, *other = &g->tie[i].arrival;
            assert_true(i == 0 || g->tie[i].vertex > g->tie[i - 1].vertex);
            assert_ptr_equal(dmk_geodesics_tie(g, (int32_t)g->tie[i].vertex), other);
            assert_true(own->back != other->back && other->source == 0);
            const int64_t column = g->tie[i].vertex % COLUMNS, row = g->tie[i].vertex / COLUMNS;
            assert_true(2 * column % COLUMNS == 0 || 2 * row % ROWS == 0);
        }
        assert_null(dmk_geodesics_tie(g, 1));
        if (first) {
            assert_int_equal(g->n_ties, n_first);
            assert_memory_equal(g->tie, first, n_first * sizeof *first);
        } else {
            n_first = g->n_ties;
            first = malloc(n_first * sizeof *first);
            memcpy(first, g->tie, n_first * sizeof *first);
        }
        dmk_geodesics_destroy(&g);
    }
    free(first);
    dmk_mesh_destroy(&m);
}

/* Lines through vertices are no farther off than the mesh is from the torus: the column behind the source, the inner
 * row, and a piece of the outer one. Without the second paths 0.05 h, with them 0.003. */
static void lines_run_through_the_vertices(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_torus(ctx);
    dmk_geodesics *g = from_vertex(ctx, m, 0);
    dmk_locus *l;
    size_t n;
    double off = 0;
    assert_int_equal(dmk_geodesics_locus(ctx, g, NULL, &l), DMK_OK);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    for (size_t i = 0; i < n; i++) {
        const double *x = v[i].xyz, r = hypot(x[0], x[1]);
        off += fmin(x[0] < 0 ? fabs(x[1]) : 1, fmin(hypot(r - 1, x[2]), hypot(r - 3, x[2]))) /
               (double)n;
    }
    assert_true(off < 0.01 * m->info.mean_edge);
    dmk_locus_info info;
    dmk_locus_get_info(l, &info);
    assert_int_equal(info.endpoints, 2);
    dmk_locus_destroy(&l);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Through the flat vertices of a sheet the same path comes by two windows, and is one. */
static void flat_vertices_are_no_ties(void **state)
{
    dmk_context *ctx = *state;
    enum { SIDE = 12 };
    double xyz[3 * SIDE * SIDE] = {0};
    int32_t triangle[6 * (SIDE - 1) * (SIDE - 1)], *t = triangle;
    for (int32_t v = 0; v < SIDE * SIDE; v++) {
        const int32_t i = v % SIDE, j = v / SIDE;
        xyz[3 * v] = i, xyz[3 * v + 1] = j;
        if (i + 1 == SIDE || j + 1 == SIDE) continue;
        memcpy(t, (int32_t[]){v, v + 1, v + SIDE + 1, v, v + SIDE + 1, v + SIDE}, 6 * sizeof *t);
        t += 6;
    }
    dmk_mesh *m = make(ctx, SIDE * SIDE, xyz, 2 * (SIDE - 1) * (SIDE - 1), triangle);
    for (int32_t v = 0; v < SIDE * SIDE; v += 5) {
        dmk_geodesics *g = from_vertex(ctx, m, v);
        assert_int_equal(g->n_ties, 0);
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_column_behind_the_source),
        cmocka_unit_test(lines_run_through_the_vertices),
        cmocka_unit_test(flat_vertices_are_no_ties),
    };
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
