/* The hierarchy of coarse graphs: prolongation, its transpose, the Galerkin tables. */
#include "../src/levels/coarsen.c" /* for their static functions; the library's own are then left out */
#include "../src/levels/prolong.c"

#include "levels/coarsen.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static dmk_context *ctx;

static double *zeros(int32_t n)
{
    double *a = calloc((size_t)dmk_max_i(n, 1), sizeof *a);
    assert_non_null(a);
    return a;
}

/* A bumpy square of n x n vertices, in memory order; `grade` > 1 shrinks it towards a corner, and a
 * twisted one is closed to a torus instead. */
static dmk_mesh *grid(int n, double grade, bool closed)
{
    double *xyz = calloc(3 * (size_t)(n * n), sizeof *xyz);
    int32_t *tri = calloc(6 * (size_t)(n * n), sizeof *tri), m = 0;
    dmk_mesh *plain = NULL;
    dmk_order order;
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) {
            double *x = xyz + 3 * (i * n + k), a = i / (n - 1.0), b = k / (n - 1.0);
            double scale = pow(grade, fmax(a, b) - 1);
            double p = 6.283185307179586 * i / n, q = 6.283185307179586 * k / n;
            x[0] = closed ? (2 + cos(q)) * cos(p) : scale * a;
            x[1] = closed ? (2 + cos(q)) * sin(p) : scale * b;
            x[2] = closed ? sin(q) : 0.1 * scale * sin(9 * a) * cos(7 * b);
        }
    }
    for (int i = 0; i < n - !closed; i++) {
        for (int k = 0; k < n - !closed; k++) {
            int i1 = (i + 1) % n, k1 = (k + 1) % n;
            int32_t c[4] = {i * n + k, i1 * n + k, i1 * n + k1, i * n + k1};
            int32_t six[6] = {c[0], c[1], c[2], c[0], c[2], c[3]};
            memcpy(tri + 6 * m++, six, sizeof six);
        }
    }
    int rc = dmk_mesh_create(ctx, (size_t)(n * n), xyz, 2 * (size_t)m, tri, &plain);
    assert_int_equal(rc, DMK_OK);
    assert_int_equal(dmk_order_create(ctx, plain, 0, &order), DMK_OK);
    dmk_mesh_destroy(&plain);
    dmk_mesh *mesh = order.mesh;
    order.mesh = NULL;
    dmk_order_free(&order);
    free(xyz);
    free(tri);
    return mesh;
}

/* The fine side of a level. */
static dmk_graph fine_graph(const dmk_mesh *m, const dmk_hierarchy *h, int l)
{
    if (l > 0) return h->level[l - 1].coarse;
    return (dmk_graph){m->n_vertices, m->n_edges, m->edge_vertex, m->xyz};
}

static void check_prolongation(const dmk_graph *fine, const dmk_coarsening *c)
{
    for (int32_t i = 0; i < fine->n; i++) {
        const float *w = c->prolong_weight + 3 * (size_t)i;
        const int32_t *index = c->prolong_index + 3 * (size_t)i;
        assert_true(w[0] + w[1] + w[2] == 1);
        assert_true(w[0] > 0);
        for (int k = 0; k < 3; k++) {
            assert_in_range(index[k], 0, c->coarse.n - 1);
            assert_true(w[k] >= 0);
            if (w[k] == 0) assert_int_equal(index[k], index[0]);
            for (int j = 0; j < k; j++) assert_true(w[k] == 0 || index[j] < index[k]);
        }
    }
    for (int32_t a = 0; a < c->coarse.n; a++) {
        assert_true(c->restrict_row[a + 1] > c->restrict_row[a]);
    }
}

/* The Galerkin coefficients are what 16 bits hold of them, exactly: those of a row of P less another's. */
static void check_whole(const dmk_coarsening *c)
{
    const float parts = DMK_WEIGHT_PARTS * DMK_WEIGHT_PARTS;
    for (int32_t k = 0; k < c->galerkin_row[c->coarse.n_edges]; k++) {
        const float n = parts * c->galerkin_coef[k];
        assert_true(n == (int16_t)n && n != 0);
    }
}

/* Count the entries of the transposed rows and look each of them up in the prolongation. */
static void check_transpose(const dmk_graph *fine, const dmk_coarsening *c)
{
    int32_t n = 0;
    for (size_t k = 0; k < 3 * (size_t)fine->n; k++) n += c->prolong_weight[k] != 0;
    assert_int_equal(c->restrict_row[0], 0);
    assert_int_equal(c->restrict_row[c->coarse.n], n);
    for (int32_t a = 0; a < c->coarse.n; a++) {
        for (int32_t i = c->restrict_row[a]; i < c->restrict_row[a + 1]; i++) {
            size_t at = 3 * (size_t)c->restrict_fine[i];
            int found = 0;
            for (int k = 0; k < 3; k++) {
                found += c->prolong_index[at + k] == a &&
                         c->prolong_weight[at + k] == c->restrict_weight[i];
            }
            assert_int_equal(found, 1);
            if (i > c->restrict_row[a]) assert_true(c->restrict_fine[i] > c->restrict_fine[i - 1]);
        }
    }
}

static void check_edges(const dmk_graph *g)
{
    for (int32_t e = 0; e < g->n_edges; e++) {
        const int32_t *v = g->edge + 2 * (size_t)e;
        assert_true(0 <= v[0] && v[0] < v[1] && v[1] < g->n);
        if (e) assert_true(v[-2] < v[0] || (v[-2] == v[0] && v[-1] < v[1]));
    }
}

static void check_connected(const dmk_graph *g)
{
    int32_t *label = calloc((size_t)dmk_max_i(g->n, 1), sizeof *label);
    bool changed = true;
    for (int32_t v = 0; v < g->n; v++) label[v] = v;
    while (changed) {
        changed = false;
        for (int32_t e = 0; e < g->n_edges; e++) {
            int32_t *a = &label[g->edge[2 * e]], *b = &label[g->edge[2 * e + 1]];
            int32_t least = dmk_min_i(*a, *b);
            changed = changed || *a != *b;
            *a = *b = least;
        }
    }
    for (int32_t v = 0; v < g->n; v++) assert_int_equal(label[v], 0);
    free(label);
}

/* Weights of any sign. */
static double *random_weights(int32_t n)
{
    double *w = zeros(n);
    uint32_t state = 12345;
    for (int32_t e = 0; e < n; e++) {
        state = state * 1664525u + 1013904223u;
        w[e] = state / 4294967296.0 - 0.25;
    }
    return w;
}

/* y = A x for the edges of g with weights w. */
static void apply(const dmk_graph *g, const double *w, const double *x, double *y)
{
    memset(y, 0, (size_t)g->n * sizeof *y);
    for (int32_t e = 0; e < g->n_edges; e++) {
        int32_t i = g->edge[2 * e], k = g->edge[2 * e + 1];
        double flow = w[e] * (x[i] - x[k]);
        y[i] += flow;
        y[k] -= flow;
    }
}

static double *coarse_weights(const dmk_coarsening *c, const double *w)
{
    double *wc = zeros(c->coarse.n_edges);
    for (int32_t k = 0; k < c->coarse.n_edges; k++) {
        assert_true(c->galerkin_row[k + 1] > c->galerkin_row[k]);
        for (int32_t i = c->galerkin_row[k]; i < c->galerkin_row[k + 1]; i++) {
            assert_true(c->galerkin_coef[i] != 0);
            wc[k] += (double)c->galerkin_coef[i] * w[c->galerkin_edge[i]];
        }
    }
    return wc;
}

/* P'APx for every `stride`-th unit vector x, against the coarse edges. */
static void check_galerkin(const dmk_graph *fine, const dmk_coarsening *c, int32_t stride)
{
    const dmk_graph *g = &c->coarse;
    double *w = random_weights(fine->n_edges), *wc = coarse_weights(c, w);
    double *x = zeros(g->n), *y = zeros(g->n);
    double *px = zeros(fine->n), *apx = zeros(fine->n);
    for (int32_t unit = 0; unit < g->n; unit += stride) {
        x[unit] = 1;
        for (int32_t i = 0; i < fine->n; i++) {
            px[i] = 0;
            for (size_t k = 3 * (size_t)i; k < 3 * (size_t)i + 3; k++) {
                px[i] += (double)c->prolong_weight[k] * x[c->prolong_index[k]];
            }
        }
        apply(fine, w, px, apx);
        apply(g, wc, x, y);
        for (int32_t a = 0; a < g->n; a++) {
            double restricted = 0;
            for (int32_t i = c->restrict_row[a]; i < c->restrict_row[a + 1]; i++) {
                restricted += (double)c->restrict_weight[i] * apx[c->restrict_fine[i]];
            }
            assert_true(fabs(restricted - y[a]) < 1e-5);
        }
        x[unit] = 0;
    }
    /* Constants: zero on both levels. */
    for (int32_t a = 0; a < g->n; a++) x[a] = 1;
    apply(g, wc, x, y);
    for (int32_t a = 0; a < g->n; a++) assert_true(y[a] == 0);
    free(w);
    free(wc);
    free(x);
    free(y);
    free(px);
    free(apx);
}

static void check_hierarchy(const dmk_mesh *m, const dmk_hierarchy *h)
{
    for (int l = 0; l < h->n; l++) {
        dmk_graph fine = fine_graph(m, h, l);
        const dmk_coarsening *c = &h->level[l];
        assert_true(c->coarse.n <= fine.n / 3 * 2);
        check_prolongation(&fine, c);
        check_transpose(&fine, c);
        check_whole(c);
        check_edges(&c->coarse);
        check_connected(&c->coarse);
        check_galerkin(&fine, c, 1 + c->coarse.n / 40);
    }
}

static void check_mesh(dmk_mesh *m, int32_t coarsest, bool descends)
{
    dmk_hierarchy h;
    assert_int_equal(dmk_hierarchy_create(ctx, m, coarsest, &h), DMK_OK);
    check_hierarchy(m, &h);
    if (descends) assert_true(h.level[h.n - 1].coarse.n <= coarsest);
    dmk_hierarchy_free(&h);
    dmk_mesh_destroy(&m);
}

static void closed_surface(void **state)
{
    (void)state;
    check_mesh(grid(48, 1, true), DMK_COARSEST, true);
}

static void surface_with_border(void **state)
{
    (void)state;
    check_mesh(grid(45, 1, false), DMK_COARSEST, true);
}

static void graded_surface(void **state)
{
    (void)state;
    check_mesh(grid(60, 1000, false), DMK_COARSEST, true);
}

/* Its lengths are more than a float can hold. */
static void vast_surface(void **state)
{
    (void)state;
    dmk_hierarchy h;
    dmk_mesh *m = grid(60, 1, true);
    for (int32_t i = 0; i < 3 * m->n_vertices; i++) m->xyz[i] *= 1e40;
    assert_int_equal(dmk_hierarchy_create(ctx, m, DMK_COARSEST, &h), DMK_OK);
    for (int l = 0; l < h.n; l++) assert_true(20 * h.level[l].coarse.n > fine_graph(m, &h, l).n);
    dmk_hierarchy_free(&h);
    dmk_mesh_destroy(&m);
}

/* Coarsening as far as it goes ends cleanly, by a stall or at one vertex. */
static void coarse_to_the_end(void **state)
{
    (void)state;
    for (int n = 3; n < 13; n++) check_mesh(grid(n, 1, n % 2), 1, false);
}

static void small_mesh_has_no_levels(void **state)
{
    (void)state;
    const double xyz[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    const int32_t tri[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    dmk_mesh *m = NULL;
    dmk_hierarchy h;
    assert_int_equal(dmk_mesh_create(ctx, 4, xyz, 4, tri, &m), DMK_OK);
    assert_int_equal(dmk_hierarchy_create(ctx, m, DMK_COARSEST, &h), DMK_OK);
    assert_int_equal(h.n, 0);
    dmk_hierarchy_free(&h);
    /* And down to one vertex: an operator without edges. */
    assert_int_equal(dmk_hierarchy_create(ctx, m, 1, &h), DMK_OK);
    assert_int_equal(h.n, 1);
    assert_int_equal(h.level[0].coarse.n, 1);
    assert_int_equal(h.level[0].coarse.n_edges, 0);
    dmk_hierarchy_free(&h);
    dmk_hierarchy_free(&h);
    dmk_mesh_destroy(&m);
}

/* Linear functions of the place are interpolated well, from near by. On a plane it would be exact
 * inside triangles if all weights were kept. */
static void linear_functions(void **state)
{
    (void)state;
    dmk_mesh *m = grid(64, 1, false);
    dmk_hierarchy h;
    double error2 = 0;
    for (int32_t i = 0; i < m->n_vertices; i++) m->xyz[3 * (size_t)i + 2] = 0;
    assert_int_equal(dmk_hierarchy_create(ctx, m, DMK_COARSEST, &h), DMK_OK);
    const dmk_coarsening *c = &h.level[0];
    for (size_t i = 0; i < (size_t)m->n_vertices; i++) {
        for (int x = 0; x < 2; x++) {
            double sum = -m->xyz[3 * i + x];
            for (size_t k = 3 * i; k < 3 * i + 3; k++) {
                sum += c->prolong_weight[k] * c->coarse.xyz[3 * (size_t)c->prolong_index[k] + x];
            }
            error2 += sum * sum;
        }
        for (size_t k = 3 * i; k < 3 * i + 3; k++) { /* cells are small */
            const double *p = m->xyz + 3 * i;
            const double *q = c->coarse.xyz + 3 * (size_t)c->prolong_index[k];
            assert_true(hypot(p[0] - q[0], p[1] - q[1]) * 63 < 6);
        }
    }
    /* In units of the mesh width: off mainly on the border, with nothing to interpolate between. */
    assert_true(sqrt(error2 / m->n_vertices) * 63 < 0.2);
    dmk_hierarchy_free(&h);
    dmk_mesh_destroy(&m);
}

static void assert_same(const void *a, const void *b, size_t n, size_t size)
{
    assert_memory_equal(a, b, n * size);
}

static void same_tables_twice(void **state)
{
    (void)state;
    dmk_mesh *m = grid(40, 10, true);
    dmk_hierarchy h[2];
    for (int k = 0; k < 2; k++)
        assert_int_equal(dmk_hierarchy_create(ctx, m, DMK_COARSEST, &h[k]), DMK_OK);
    assert_int_equal(h[0].n, h[1].n);
    for (int l = 0; l < h[0].n; l++) {
        const dmk_coarsening *a = &h[0].level[l], *b = &h[1].level[l];
        size_t n_fine = 3 * (size_t)fine_graph(m, &h[0], l).n, n_edges = (size_t)a->coarse.n_edges;
        size_t n_entries = (size_t)a->galerkin_row[n_edges];
        assert_int_equal(a->coarse.n, b->coarse.n);
        assert_int_equal(a->coarse.n_edges, b->coarse.n_edges);
        assert_same(a->coarse.edge, b->coarse.edge, 2 * n_edges, sizeof *a->coarse.edge);
        assert_same(a->prolong_index, b->prolong_index, n_fine, sizeof *a->prolong_index);
        assert_same(a->prolong_weight, b->prolong_weight, n_fine, sizeof *a->prolong_weight);
        assert_same(a->galerkin_row, b->galerkin_row, n_edges + 1, sizeof *a->galerkin_row);
        assert_same(a->galerkin_edge, b->galerkin_edge, n_entries, sizeof *a->galerkin_edge);
        assert_same(a->galerkin_coef, b->galerkin_coef, n_entries, sizeof *a->galerkin_coef);
    }
    for (int k = 0; k < 2; k++) dmk_hierarchy_free(&h[k]);
    dmk_mesh_destroy(&m);
}

/* Vertex 0 takes coarse vertex 0, which no other has; that leaves coarse vertex 1 without any, so vertex 1 takes it,
 * and so on to the last. */
static void columns_are_filled_again(void **state)
{
    (void)state;
    enum { N = 5 };
    int32_t sample[N], index[3 * N] = {0};
    float weight[3 * N] = {0};
    const dmk_cells cells = {.n_fine = N, .n = N, .sample = sample};
    dmk_coarsening c = {.prolong_index = index, .prolong_weight = weight};
    for (int i = 0; i < N; i++) {
        sample[i] = i;
        index[3 * i] = i + 1 < N ? i + 1 : i;
        weight[3 * i] = 1;
    }
    assert_int_equal(fill_empty_columns(ctx, &cells, &c), DMK_OK);
    for (int i = 0; i < N; i++) {
        assert_int_equal(index[3 * i], i);
        assert_true(weight[3 * i] == 1 && weight[3 * i + 1] == 0 && weight[3 * i + 2] == 0);
    }
}

/* Of a triangle whose corners lie on a line but for rounding the nearest point is one of its edges': where the weights
 * of two spokes come from a determinant that is rounding alone, they are not those of the distance beside them. */
static void flat_triangles_are_lines(void **state)
{
    (void)state;
    star st = {0};
    assert_int_equal(star_reserve_spokes(ctx, &st, 2), DMK_OK);
    st.n_spokes = 2;
    for (int trial = 0; trial < 5000; trial++) {
        points p = {.n = 1};
        for (int x = 0; x < 3; x++) {
            const double way = sin(1.0 + trial + 2 * x);
            st.q[0][x] = way;
            st.q[1][x] = (0.3 + 1e-4 * trial) * way;
        }
        p.x[0] = 0.2 * st.q[0][0] + 0.3 * cos(trial);
        p.y[0] = 0.2 * st.q[0][1] + 0.3 * sin(7.0 * trial);
        p.z[0] = 0.2 * st.q[0][2] + 0.3 * cos(3.0 * trial);
        for (int i = 0; i < 2; i++) st.qq[i] = dmk_dot(st.q[i], st.q[i]);
        st.n_triangles = 0;
        assert_int_equal(star_add_triangle(ctx, &st, 0, 1), DMK_OK);
        nearest best;
        find_nearest(&st, &p, &best);
        const int at = (int)best.at[0];
        const double *q = st.q[at < 2 ? at : 0], *r = st.q[1];
        double distance2 = 0;
        for (int x = 0; x < 3; x++) {
            const double to = best.s[0] * q[x] + best.t[0] * r[x];
            distance2 += to * (to - 2 * (const double[]){p.x[0], p.y[0], p.z[0]}[x]);
        }
        assert_true(fabs(distance2 - best.distance2[0]) < 1e-12);
    }
    star_free(&st);
}

/* Every edge of a graph by its ends, in either order, and no other pair: what is not there conducts nothing. */
static void check_found_edges(void)
{
    int32_t edge[] = {0, 2, 0, 5, 1, 2, 1, 4, 3, 4}, n_found = 0;
    const dmk_graph g = {.n = 6, .n_edges = 5, .edge = edge};
    for (int32_t a = 0; a < 6; a++) {
        for (int32_t b = 0; b < 6; b++) {
            const int32_t k = a == b ? -1 : find_edge(&g, a, b);
            n_found += k >= 0;
            if (k >= 0)
                assert_true(edge[2 * k] == dmk_min_i(a, b) && edge[2 * k + 1] == dmk_max_i(a, b));
        }
    }
    assert_int_equal(n_found, 10);
}

/* The edges of a hub by length, each with the vertex that it leads to, of equal ones the lower first; of a vertex with
 * one edge less they stay. */
static void check_sorted_hub(void)
{
    enum { N = DMK_HUB + 1 };
    int32_t row[3] = {0, N, 2 * N - 1}, to[2 * N - 1];
    float length[2 * N - 1];
    dmk_adjacency g = {.n = 2, .row = row, .to = to, .length = length};
    for (int32_t i = 0; i < 2 * N - 1; i++) {
        to[i] = 100 + i;
        length[i] = (float)(29 * i % N / 2);
    }
    assert_int_equal(dmk_cells_sort_hubs(ctx, &g), DMK_OK);
    for (int32_t i = 0; i < 2 * N - 1; i++) {
        const int32_t was = to[i] - 100;
        assert_true(i < N ? was >= 0 && was < N : was == i);
        assert_true(length[i] == (float)(29 * was % N / 2));
        if (i == 0 || i >= N) continue;
        assert_true(length[i - 1] < length[i] || (length[i - 1] == length[i] && to[i - 1] < to[i]));
    }
}

/* Two cones over one ring: every vertex of the ring beside two hubs. What is taken hub by hub for each
 * neighbour of a hub takes 4e10 steps here, and more. */
static void hubs(void **state)
{
    (void)state;
    enum { N = 400000 };
    double *xyz = zeros(3 * (N + 2));
    int32_t *tri = calloc(6 * (size_t)N, sizeof *tri);
    dmk_mesh *m = NULL;
    dmk_hierarchy h;
    for (int32_t i = 0; i < N; i++) {
        int32_t j = (i + 1) % N, two[6] = {i, j, N, j, i, N + 1};
        xyz[3 * i] = cos(6.283185307179586 * i / N);
        xyz[3 * i + 1] = sin(6.283185307179586 * i / N);
        memcpy(tri + 6 * i, two, sizeof two);
    }
    xyz[3 * N + 2] = 1;
    xyz[3 * N + 5] = -1;
    assert_int_equal(dmk_mesh_create(ctx, N + 2, xyz, 2 * N, tri, &m), DMK_OK);
    assert_int_equal(dmk_hierarchy_create(ctx, m, DMK_COARSEST, &h), DMK_OK);
    assert_true(h.n > 0 && h.level[h.n - 1].coarse.n < N / 100);
    dmk_hierarchy_free(&h);
    dmk_mesh_destroy(&m);
    free(xyz);
    free(tri);
    check_sorted_hub();
    check_found_edges();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closed_surface),
        cmocka_unit_test(surface_with_border),
        cmocka_unit_test(graded_surface),
        cmocka_unit_test(coarse_to_the_end),
        cmocka_unit_test(vast_surface),
        cmocka_unit_test(small_mesh_has_no_levels),
        cmocka_unit_test(linear_functions),
        cmocka_unit_test(same_tables_twice),
        cmocka_unit_test(hubs),
        cmocka_unit_test(columns_are_filled_again),
        cmocka_unit_test(flat_triangles_are_lines),
    };
    if (dmk_context_create(&ctx) != DMK_OK) return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    dmk_context_destroy(&ctx);
    return failed;
}
