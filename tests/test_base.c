/* Sorting, graphs as lines, small dense matrices, and what a mesh reports of itself, by their definitions. */
#include "base/dense.h"
#include "base/graph.h"
#include "base/heading.h"
#include "base/heap.h"
#include "base/sort.h"
#include "io/values.h"
#include "mesh/mesh.h"
#include "context.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static dmk_context *ctx;

static uint32_t random_state = 11;
static uint32_t random_bits(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8;
}

static void numbers_are_sorted(void **state)
{
    (void)state;
    enum { MOST = 300, VALUES = 60 };
    for (int32_t n = 0; n < MOST; n++) { /* both sides of DMK_SHORT_LIST */
        int32_t a[MOST], count[VALUES] = {0};
        double d[MOST], sum = 0;
        for (int32_t i = 0; i < n; i++) {
            a[i] = (int32_t)(random_bits() % VALUES) - VALUES / 2;
            count[a[i] + VALUES / 2]++;
            d[i] = (random_bits() - 8388608.0) / 1e3;
            sum += d[i];
        }
        dmk_sort(n, a);
        dmk_sort_doubles(d, (size_t)n);
        for (int32_t i = 0; i < n; i++) {
            assert_true(i == 0 || (a[i - 1] <= a[i] && d[i - 1] <= d[i]));
            count[a[i] + VALUES / 2]--;
            sum -= d[i];
        }
        for (int32_t k = 0; k < VALUES; k++) assert_int_equal(count[k], 0);
        assert_true(fabs(sum) < 1e-6);
    }
}

/* A curve of three edges that is closed, a cross of four edges with one of its arms longer and another one ending where
 * two more edges do, a double edge there, and a vertex alone. */
static void graphs_are_lines(void **state)
{
    (void)state;
    static const int32_t end[][2] = {{7, 8}, {0, 1}, {0, 2}, {8, 9}, {3, 0},
                                     {4, 5}, {0, 4}, {6, 3}, {9, 7}, {3, 6}};
    static const int32_t line[] = {0, 1,      /**/ 0, 2, /**/ 0, 3, /**/ 0, 4,
                                   5, /**/ 3, 6,      3, /**/ 7, 8, 9,      7};
    static const int32_t begin[] = {0, 2, 4, 6, 9, 12, 16};
    size_t n;
    int32_t *offset = NULL, *index = NULL;
    assert_int_equal(
        dmk_graph_lines(ctx, 11, sizeof end / sizeof *end, end[0], 2, &n, &offset, &index), DMK_OK);
    assert_int_equal(n, 6);
    assert_memory_equal(offset, begin, sizeof begin);
    assert_memory_equal(index, line, sizeof line);
    free(offset);
    free(index);
    assert_int_equal(dmk_graph_lines(ctx, 1, 0, NULL, 2, &n, &offset, &index), DMK_OK);
    assert_int_equal(n, 0);
    free(offset);
    free(index);
}

/* On one thread and on several; of the digit in the middle one item alone has another value. */
/* By number where keys are equal, in whatever order they came. */
static void heaps_give_the_least(void **state)
{
    enum { N = 60 };
    (void)state;
    dmk_heap heap = {0};
    for (int32_t i = 0; i < N; i++) {
        const int32_t item = i * 37 % N;
        assert_int_equal(dmk_heap_push(ctx, &heap, (double)(item / 10), item), DMK_OK);
    }
    for (int32_t i = 0; i < N; i++) assert_int_equal(dmk_heap_pop(&heap).item, i);
    assert_int_equal(heap.n, 0);
    dmk_heap_free(&heap);
}

/* Of numbers that 63 bits do not hold there is none. */
static void numbers_of_files_are_integers(void **state)
{
    static const double none[] = {9.3e18, -9.3e18, INFINITY, NAN};
    const uint64_t large = UINT64_C(1) << 63, fits = large - 1;
    const double whole = -9007199254740991.0;
    (void)state;
    for (size_t i = 0; i < sizeof none / sizeof *none; i++)
        assert_true(dmk_decode_integer(DMK_FLOAT64, (const char *)&none[i], false) == -1);
    assert_true(dmk_decode_integer(DMK_FLOAT64, (const char *)&whole, false) == -9007199254740991);
    assert_true(dmk_decode_integer(DMK_UINT64, (const char *)&large, false) == -1);
    assert_true(dmk_decode_integer(DMK_UINT64, (const char *)&fits, false) == INT64_MAX);
}

static void keyed_items_keep_their_order(void **state)
{
    (void)state;
    static const int32_t sizes[] = {1, 5000, 120001};
    for (int k = 0; k < 3; k++) {
        const int32_t n = sizes[k];
        dmk_keyed *a = calloc((size_t)n, sizeof *a);
        for (int32_t i = 0; i < n; i++) {
            const uint64_t high = (uint64_t)(random_bits() % 50) << (DMK_KEY_BITS - 8);
            a[i] = (dmk_keyed){high | (uint64_t)(i == n / 2) << 20 | random_bits() % 7, i};
        }
        assert_int_equal(dmk_sort_keyed(ctx, a, (size_t)n), DMK_OK);
        for (int32_t i = 1; i < n; i++) {
            assert_true(a[i - 1].key <= a[i].key);
            if (a[i - 1].key == a[i].key) assert_true(a[i - 1].item < a[i].item);
        }
        free(a);
    }
}

/* L X = I - J / n, and the rows of X sum to 0: that is the pseudo-inverse, whatever the unit. */
static void laplacians_are_inverted(void **state)
{
    (void)state;
    enum { MOST = 40 };
    static const double units[] = {1, 1e-15, 1e15};
    for (int32_t n = 1; n <= MOST; n += 13) {
        double *l = calloc((size_t)(n * n), sizeof *l), *x = calloc((size_t)(n * n), sizeof *x);
        const double unit = units[n / 13 % 3];
        for (int32_t i = 0; i + 1 < n; i++) {
            for (int32_t j = i + 1; j < n; j += 5) { /* a path, and some more */
                const double w = unit * (0.1 + random_bits() / 1e6);
                l[i * n + j] -= w;
                l[j * n + i] -= w;
                l[i * n + i] += w;
                l[j * n + j] += w;
            }
        }
        assert_int_equal(dmk_laplacian_inverse(ctx, n, l, x), DMK_OK);
        for (int32_t i = 0; i < n; i++) {
            double row = 0;
            for (int32_t j = 0; j < n; j++) {
                double sum = 0;
                for (int32_t k = 0; k < n; k++) sum += l[i * n + k] * x[k * n + j];
                assert_true(fabs(sum - ((i == j) - 1.0 / n)) < 1e-10);
                row += x[i * n + j] * unit;
            }
            assert_true(fabs(row) < 1e-10);
        }
        free(l);
        free(x);
    }
}

/* Two pairs without a link: the last pivot is rounding, and that unknown is left out. Right-hand sides that
 * sum to 0 on each pair are solved all the same, in any unit. */
static void loose_unknowns_are_left_out(void **state)
{
    (void)state;
    for (int power = -18; power <= 18; power += 3) {
        const double unit = pow(10, power), w[] = {0.7 * unit, 0.3 * unit};
        double l[16] = {0}, x[16];
        for (int p = 0; p < 2; p++) {
            l[10 * p] = l[10 * p + 5] = w[p];
            l[10 * p + 1] = l[10 * p + 4] = -w[p];
        }
        assert_int_equal(dmk_laplacian_inverse(ctx, 4, l, x), DMK_OK);
        for (int p = 0; p < 2; p++) { /* one unit in at 2p, out at 2p + 1 */
            const double *column = x + 2 * p;
            const double drop =
                column[8 * p] - column[8 * p + 1] - column[8 * p + 4] + column[8 * p + 5];
            assert_true(fabs(drop * w[p] - 1) < 1e-12);
        }
    }
}

/* A call without a context has nowhere to put its message, and still returns that it failed. */
static void a_missing_context_has_no_message(void **state)
{
    (void)state;
    assert_int_equal(dmk_fail(NULL, DMK_E_MESH, "triangle %d", 3), DMK_E_MESH);
    assert_true(dmk_missing(NULL, "mesh", (void *)NULL));
    assert_true(dmk_missing(NULL, "mesh", &ctx));
}

/* The regular octahedron around (1, 2, 3), of edge sqrt 2, and a vertex in no triangle far away. */
static const double octahedron[] = {2, 2, 3, 0, 2, 3, 1, 3,  3,   1, 1,
                                    3, 1, 2, 4, 1, 2, 2, 99, -99, 99};
static const int32_t faces[] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};

static void a_mesh_is_measured(void **state)
{
    (void)state;
    dmk_mesh *mesh = NULL;
    dmk_mesh_info info;
    assert_int_equal(dmk_mesh_create(ctx, 7, octahedron, 8, faces, &mesh), DMK_OK);
    dmk_mesh_get_info(mesh, &info);
    assert_true(info.n_vertices == 7 && info.n_triangles == 8 && info.n_edges == 12 &&
                info.n_unused_vertices == 1);
    assert_true(info.n_border_edges == 0 && info.n_border_loops == 0 && info.n_components == 1 &&
                info.euler == 2);
    assert_true(fabs(info.area - 4 * sqrt(3)) < 1e-14);
    assert_true(fabs(info.mean_edge - sqrt(2)) < 1e-15 && info.min_edge == info.max_edge);
    assert_true(fabs(info.min_angle - 60) < 1e-12 && fabs(info.max_angle - 60) < 1e-12);
    for (int k = 0; k < 3; k++) {
        assert_true(info.box_min[k] == k && info.box_max[k] == k + 2);
    }
    dmk_mesh_destroy(&mesh);
}

static void numbers_that_are_none_are_refused(void **state)
{
    (void)state;
    static const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int32_t v = 0; v < 6; v++) {
        for (int k = 0; k < 3; k++) {
            double xyz[21];
            char word[32];
            dmk_mesh *mesh = NULL;
            memcpy(xyz, octahedron, sizeof xyz);
            xyz[3 * v + k] = bad[(v + k) % 3];
            assert_int_equal(dmk_mesh_create(ctx, 7, xyz, 8, faces, &mesh), DMK_E_MESH);
            snprintf(word, sizeof word, "vertex %d ", v);
            assert_non_null(strstr(dmk_context_message(ctx), word));
        }
    }
}

static int setup(void **state)
{
    const int rc = context_setup(state);
    ctx = *state;
    return rc;
}

/* Of small angles and large ones, and where the nearest quarter turn changes. */
static void headings_are_cosine_and_sine(void **state)
{
    (void)state;
    double worst = 0;
    for (double size = 1e-8; size <= 1e5; size *= 10) {
        for (int i = -20000; i <= 20000; i++) {
            const double at = (i % 2 ? i : round(0.5 * i) * M_PI / 4e4) * size / 20000;
            const dmk_heading to = dmk_heading_of(at);
            worst = fmax(worst, fmax(fabs(to.x - cos(at)), fabs(to.y - sin(at))));
        }
    }
    for (int i = -400; i <= 400; i++) {
        for (int k = -1; k <= 1; k++) {
            const double at = i * M_PI / 4 * (1 + k * 1e-15);
            const dmk_heading to = dmk_heading_of(at);
            worst = fmax(worst, fmax(fabs(to.x - cos(at)), fabs(to.y - sin(at))));
        }
    }
    print_message("# off by %.2g\n", worst);
    assert_true(worst < 1.2e-16); /* a unit in the last place of 1 / 2 to 1 */
    assert_true(dmk_heading_of(0).x == 1 && dmk_heading_of(0).y == 0);
}

/* All around, near the axes and near where the series change; the origin has the angle 0. */
static void angles_are_arc_tangents(void **state)
{
    (void)state;
    double worst = 0;
    static const double near[] = {0, 1e-300, 1e-17, 1e-9, 0.2361, 0.5, 0.7208, 1};
    for (int i = 0; i < 8; i++) {
        for (int k = -1000; k <= 1000; k++) {
            const double t = near[i] * (1 + 1e-15 * k) + 1e-3 * (k % 7 == 0 ? abs(k) : 0);
            for (int turn = 0; turn < 8; turn++) {
                const double u = turn & 1 ? 3 : 3 * t, v = turn & 1 ? 3 * t : 3,
                             x = turn & 2 ? -u : u, y = turn & 4 ? -v : v;
                const double right = atan2(y, x), off = fabs(dmk_angle_of(x, y) - right);
                if (off > 0) worst = fmax(worst, off / fabs(right));
            }
        }
    }
    print_message("# off by %.2g\n", worst);
    assert_true(worst < 3e-16);
    assert_true(dmk_angle_of(0, 0) == 0 && dmk_angle_of(1, 0) == 0);
    assert_true(dmk_angle_of(-1, 0) == M_PI && dmk_angle_of(0, -2) == -M_PI / 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_sorted),
        cmocka_unit_test(headings_are_cosine_and_sine),
        cmocka_unit_test(angles_are_arc_tangents),
        cmocka_unit_test(keyed_items_keep_their_order),
        cmocka_unit_test(graphs_are_lines),
        cmocka_unit_test(heaps_give_the_least),
        cmocka_unit_test(numbers_of_files_are_integers),
        cmocka_unit_test(laplacians_are_inverted),
        cmocka_unit_test(loose_unknowns_are_left_out),
        cmocka_unit_test(a_missing_context_has_no_message),
        cmocka_unit_test(a_mesh_is_measured),
        cmocka_unit_test(numbers_that_are_none_are_refused),
    };
    return cmocka_run_group_tests_name("base", tests, setup, context_teardown);
}
