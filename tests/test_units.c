/* Parts of the solver by themselves: the multigrid's rate, conjugate gradients, the control of the pseudo time
 * step, sliced rows; and what a solver keeps from one solve to the next. Bounds are what was measured and a tenth. */
#include "../src/solver/bounds.c" /* for their static functions; the library's own are then left out */
#include "../src/solver/newton.c"
#include "../src/solver/upper.c"

#include "solver/fine_graph.h"
#include "solver/pcg.h"
#include "solver/sell.h"
#include "solver/setup.h"
#include "solver/solver.h"
#include "iterating.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct fixture {
    bench b;
    dmk_mesh *input;
    dmk_order order;
    dmk_system *sys;
    size_t n; /* rows */
    double *mu;
} fixture;

static void ok(const fixture *x, int rc)
{
    bench_ok(&x->b, rc);
}

static uint32_t random_state;
static double random_unit(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) / 16777216.0;
}

static int setup(void **state)
{
    static fixture x;
    *state = &x;
    dmk_surface_options torus;
    dmk_surface_options_init(&torus, sizeof torus);
    torus.name = "torus";
    torus.n_triangles = 8000;
    bench_open(&x.b, NULL);
    ok(&x, dmk_mesh_surface(x.b.ctx, &torus, &x.input));
    ok(&x, dmk_order_create(x.b.ctx, x.input, 0, &x.order));
    ok(&x, dmk_system_create(x.b.ctx, x.b.dev, x.order.mesh, &x.sys));
    ok(&x, dmk_system_allocate(x.b.ctx, x.sys));
    x.n = (size_t)x.sys->n_rows_pad;
    x.mu = calloc((size_t)x.sys->n_elements_pad, sizeof *x.mu);
    random_state = 7;
    return 0;
}

static int teardown(void **state)
{
    fixture *x = *state;
    free(x->mu);
    dmk_system_destroy(&x->sys);
    dmk_order_free(&x->order);
    dmk_mesh_destroy(&x->input);
    bench_close(&x->b);
    return 0;
}

/* ---- rows ---- */

static double *new_rows(const fixture *x)
{
    double *v = calloc(x->n, sizeof *v);
    assert_non_null(v);
    return v;
}

static bool is_row(const fixture *x, int32_t i)
{
    return i < x->sys->n_edges || i >= x->sys->vertex_row;
}

/* Random, of mean 0. */
static double *random_rows(const fixture *x)
{
    double *v = new_rows(x), mean = 0;
    int32_t n = 0;
    for (int32_t i = 0; i < x->sys->n_rows; i++) {
        if (!is_row(x, i)) continue;
        v[i] = random_unit() - 0.5;
        mean += v[i];
        n++;
    }
    for (int32_t i = 0; i < x->sys->n_rows; i++) v[i] -= is_row(x, i) ? mean / n : 0;
    return v;
}

static double dot(const fixture *x, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < x->n; i++) sum += a[i] * b[i];
    return sum;
}

/* Density: `decades` of it by chance, element by element. */
static void set_density(fixture *x, double decades)
{
    for (int32_t t = 0; t < x->sys->n_elements; t++) x->mu[t] = pow(10, -decades * random_unit());
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, x->sys->mu,
                                (size_t)x->sys->n_elements_pad, x->mu));
    ok(x, dmk_element_prepare(x->b.ctx, x->sys));
    ok(x, dmk_inverse_diagonal(x->b.ctx, x->sys));
    ok(x, dmk_multigrid_refresh(x->b.ctx, x->sys, DMK_STIFFNESS));
}

static double *apply(const fixture *x, const double *v)
{
    dmk_system *s = x->sys;
    double *y = new_rows(x);
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->cg[DMK_OUTER].p, x->n, v));
    ok(x, dmk_element_stiffness(x->b.ctx, s, DMK_OUTER, s->cg[DMK_OUTER].p));
    ok(x, dmk_rows_apply(x->b.ctx, s, s->cg[DMK_OUTER].p, s->cg[DMK_OUTER].ap));
    ok(x, dmk_buffer_read_real(x->b.ctx, x->b.dev, DMK_OUTER, s->cg[DMK_OUTER].ap, x->n, y));
    return y;
}

/* ---- multigrid ---- */

/* What a V-cycle leaves of the energy norm of an error, in the worst of 12 cycles: they turn to the modes that it
 * damps least. */
static double v_cycle_rate(const fixture *x)
{
    dmk_system *s = x->sys;
    double *v = random_rows(x), *z = new_rows(x), worst = 0;
    for (int cycle = 0; cycle < 12; cycle++) {
        double *av = apply(x, v), before = dot(x, v, av);
        ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_INNER, s->cg[DMK_INNER].r, x->n, av));
        ok(x, dmk_v_cycle(x->b.ctx, s, DMK_STIFFNESS, s->cg[DMK_INNER].r, false));
        ok(x, dmk_buffer_read_real(x->b.ctx, x->b.dev, DMK_INNER, s->x_old, x->n, z));
        for (size_t i = 0; i < x->n; i++) v[i] -= z[i];
        free(av);
        av = apply(x, v);
        double after = dot(x, v, av), scale = 1 / sqrt(after);
        worst = fmax(worst, sqrt(after / before));
        for (size_t i = 0; i < x->n; i++) v[i] *= scale;
        free(av);
    }
    free(v);
    free(z);
    return worst;
}

static void multigrid_keeps_its_rate(void **state)
{
    fixture *x = *state;
    static const struct {
        double decades, rate;
    } cases[] = {{0, 0.152}, {1, 0.284}, {3, 0.757}};
    assert_true(x->sys->n_levels >= 2);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        set_density(x, cases[i].decades);
        const double rate = v_cycle_rate(x);
        print_message("density over %g decades: a V-cycle leaves %.3f\n", cases[i].decades, rate);
        if (!(rate <= 1.1 * cases[i].rate))
            fail_msg("%.3f, measured once %.3f", rate, cases[i].rate);
    }
}

/* The host's inverse of the coarsest operator, for devices without double precision, is that of the device. */
static void both_kinds_of_coarsest_inverse_agree(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_level *l = &s->level[s->n_levels - 1];
    const size_t n = (size_t)l->n, size = n * (size_t)l->n_pad * sizeof(float);
    float *inverse[2], largest = 0;
    dmk_buffer *dense = s->dense;
    assert_true(dense && n > 8);
    for (int k = 0; k < 2; k++) {
        inverse[k] = malloc(size);
        assert_non_null(inverse[k]);
        s->dense = k == 0 ? dense : NULL;
        random_state = 7; /* the same density */
        set_density(x, 2);
        ok(x, dmk_buffer_read(x->b.ctx, x->b.dev, s->coarse_inverse, 0, size, inverse[k]));
    }
    s->dense = dense;
    for (size_t c = 0; c < n; c++) {
        for (size_t i = 0; i < n; i++)
            largest = fmaxf(largest, fabsf(inverse[0][c * (size_t)l->n_pad + i]));
    }
    for (size_t c = 0; c < n; c++) {
        for (size_t i = 0; i < n; i++) {
            const size_t at = c * (size_t)l->n_pad + i;
            assert_true(fabsf(inverse[0][at] - inverse[1][at]) <= 1e-5f * largest);
        }
    }
    free(inverse[0]);
    free(inverse[1]);
}

/* ---- conjugate gradients ---- */

/* Solve A dx = A v from 0; the energy norm of the error, relative to v's. */
static double solve(fixture *x, const double *v, int most, double tolerance, dmk_stats *stats)
{
    dmk_system *s = x->sys;
    double *rhs = apply(x, v), *found = new_rows(x), *zero = new_rows(x);
    dmk_buffer *unknown = NULL;
    ok(x, dmk_buffer_create(x->b.ctx, x->b.dev, x->n * sizeof(double), NULL, &unknown));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, unknown, x->n, zero));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->cg[DMK_OUTER].r, x->n, rhs));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_INNER, s->cg[DMK_OUTER].narrow, x->n, rhs));
    *stats = (dmk_stats){0};
    ok(x, dmk_pcg(x->b.ctx, s, DMK_STIFFNESS, unknown, most, tolerance, 0, stats));
    ok(x, dmk_buffer_read_real(x->b.ctx, x->b.dev, DMK_OUTER, unknown, x->n, found));
    for (size_t i = 0; i < x->n; i++) found[i] -= v[i];
    double *error = apply(x, found), left = sqrt(fmax(0, dot(x, found, error)) / dot(x, v, rhs));
    dmk_buffer_destroy(&unknown);
    free(rhs);
    free(found);
    free(zero);
    free(error);
    return left;
}

static void conjugate_gradients_converge(void **state)
{
    fixture *x = *state;
    static const struct {
        double decades, tolerance;
        int iterations;
    } cases[] = {{0, 1e-2, 2}, {0, 1e-8, 6}, {3, 1e-2, 2}, {3, 1e-8, 16}};
    int spared = 0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        dmk_stats stats;
        set_density(x, cases[i].decades);
        double *v = random_rows(x);
        const double left = solve(x, v, 100, cases[i].tolerance, &stats);
        print_message("%g decades to %g: %d iterations, %d V-cycles, error %.2g\n",
                      cases[i].decades, cases[i].tolerance, stats.cg_iterations, stats.v_cycles,
                      left);
        assert_true(left <= 3 * cases[i].tolerance);
        assert_true(stats.cg_iterations <= cases[i].iterations && stats.cg_iterations >= 1);
        assert_in_range(stats.v_cycles - stats.cg_iterations, 0, 1);
        spared += stats.v_cycles == stats.cg_iterations;
        free(v);
    }
    assert_true(spared >= 2); /* where the last iteration was known to be enough */
}

static void conjugate_gradients_stop(void **state)
{
    fixture *x = *state;
    dmk_stats stats, fewer;
    set_density(x, 1);
    double *v = random_rows(x);
    const double one = solve(x, v, 1, 0, &stats);
    assert_int_equal(stats.cg_iterations, 1);
    const double four = solve(x, v, 4, 0, &stats);
    assert_int_equal(stats.cg_iterations, 4);
    assert_true(four < one && one < 1);
    solve(x, v, 100, 1e-6, &stats);
    solve(x, v, 100, 1e-3, &fewer);
    assert_true(fewer.cg_iterations < stats.cg_iterations);
    v[0] = NAN;
    dmk_system *s = x->sys;
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->cg[DMK_OUTER].r, x->n, v));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_INNER, s->cg[DMK_OUTER].narrow, x->n, v));
    assert_int_equal(dmk_pcg(x->b.ctx, s, DMK_STIFFNESS, s->u, 20, 1e-6, 0, &stats),
                     DMK_E_DIVERGED);
    assert_non_null(strstr(dmk_context_message(x->b.ctx), "broke down"));
    free(v);
}

/* ---- bounds ---- */

/* The bounds of the problem f = A(mu) v from u = share * v: both must hold for any u. */
static void bounds_of(fixture *x, const double *v, double share, double *lower, double *upper)
{
    dmk_system *s = x->sys;
    double *f = apply(x, v), *u = new_rows(x), balance;
    dmk_stats stats = {0};
    dmk_iteration o = {.ctx = x->b.ctx, .sys = s, .mesh = x->order.mesh, .stats = &stats};
    for (size_t i = 0; i < x->n; i++) u[i] = share * v[i];
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->f, x->n, f));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->u, x->n, u));
    ok(x, dmk_bound_upper(&o, NULL, &balance, INFINITY, upper));
    assert_true(balance <= 1e-10);
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->u, x->n, v));
    ok(x, dmk_bound_plain(&o, s->u, lower));
    free(f);
    free(u);
}

/* Sum of |T| mu sqrt(q) for v: the cost of mu grad v, and what Cauchy and Schwarz make of it. */
static double flux_cost(const fixture *x, const double *v)
{
    const dmk_mesh *m = x->order.mesh;
    double sum = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double energy = 0;
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const int32_t *corner = m->triangle + 3 * t, *edge = m->triangle_edge + 3 * t;
            const double *at = v + x->sys->vertex_row;
            energy += dmk_cot(m, 3 * t + k) *
                      (0.5 * pow(at[corner[i]] - v[edge[k]], 2) +
                       0.5 * pow(at[corner[j]] - v[edge[k]], 2) + pow(v[edge[i]] - v[edge[j]], 2));
        }
        sum += x->mu[t] * sqrt(energy * m->area[t]) / x->sys->unit;
    }
    return sum;
}

/* Of a v with the same slope everywhere the lower bound is the optimum: here, of a v that rises along x. */
static void bounds_hold_for_any_potential(void **state)
{
    fixture *x = *state;
    static const double decades[] = {0, 2, 8};
    const dmk_mesh *m = x->order.mesh;
    for (size_t i = 0; i < sizeof decades / sizeof *decades; i++) {
        double *v = random_rows(x), lower = 0, upper[3];
        for (int32_t e = 0; e < m->n_edges; e++) {
            v[e] = 1e-4 * v[e] + m->xyz[3 * m->edge_vertex[2 * e]] / 2 +
                   m->xyz[3 * m->edge_vertex[2 * e + 1]] / 2;
        }
        for (int32_t p = 0; p < m->n_vertices; p++) v[x->sys->vertex_row + p] = m->xyz[3 * p];
        set_density(x, decades[i]);
        for (int k = 0; k < 3; k++) bounds_of(x, v, 0.5 * k, &lower, &upper[k]);
        const double cost = flux_cost(x, v);
        print_message("density over %g decades: lower %.4g, flux %.4g; upper from nothing %.4g, "
                      "from half %.4g\n",
                      decades[i], lower, cost, upper[0], upper[1]);
        assert_true(fabs(upper[2] / cost - 1) < 1e-9);
        for (int k = 0; k < 3; k++) assert_true(upper[k] >= lower);
        assert_true(upper[0] >= upper[1] && upper[1] <= 0.5 * (upper[0] + upper[2]) * (1 + 1e-9));
        free(v);
    }
}

static double dot3(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* -mu grad u and the flows from the corner in part k of triangle t, or, k = 3, in the middle one, where there are none;
 * returns its square. value, place: at the corners, then the midpoints. */
static double flux_in(const router *p, int32_t t, int k, double value[6], double place[6][3],
                      double flux[3])
{
    const int i = (k + 1) % 3, j = (k + 2) % 3, at = k < 3 ? 3 + j : 4, then = k < 3 ? 3 + i : 5;
    double flow[3][3], a[3], b[3];
    flows_of(p, t, flow);
    for (int c = 0; c < 3; c++) {
        a[c] = place[at][c] - place[k][c];
        b[c] = place[then][c] - place[k][c];
    }
    const double aa = dot3(a, a), bb = dot3(b, b), ab = dot3(a, b), det = aa * bb - ab * ab,
                 along_a = value[at] - value[k], along_b = value[then] - value[k],
                 part = p->mesh->area[t] / 4;
    for (int c = 0; c < 3; c++) {
        flux[c] = -p->mu[t] *
                  ((along_a * bb - along_b * ab) * a[c] + (along_b * aa - along_a * ab) * b[c]) /
                  det;
        if (k < 3) flux[c] += (flow[k][j] * a[c] + flow[k][i] * b[c]) / part;
    }
    return dot3(flux, flux);
}

/* The cost and the mean of the flux against the four parts of triangle t. */
static void check_flux(const router *p, int32_t t)
{
    const dmk_mesh *m = p->mesh;
    double value[6], place[6][3], off[3], flux[3], square = 0;
    for (int k = 0; k < 6; k++) {
        const int32_t corner = m->triangle[3 * t + k % 3], e = m->triangle_edge[3 * t + k % 3];
        const double *a = m->xyz + 3 * (k < 3 ? corner : m->edge_vertex[2 * e]),
                     *b = m->xyz + 3 * (k < 3 ? corner : m->edge_vertex[2 * e + 1]);
        value[k] = p->u[k < 3 ? p->n.vertex_row + corner : e];
        for (int c = 0; c < 3; c++) place[k][c] = (a[c] + b[c]) / 2;
    }
    for (int c = 0; c < 3; c++) off[c] = p->mean[3 * t + c];
    for (int k = 0; k < 4; k++) {
        square += flux_in(p, t, k, value, place, flux) / 4;
        for (int c = 0; c < 3; c++) off[c] -= flux[c] / 4;
    }
    assert_true(fabs(cost_of(p, t) / (m->area[t] * sqrt(square)) - 1) < 1e-11);
    assert_true(dot3(off, off) < 1e-22 * square);
}

/* What triangle t takes from its corners and midpoints, edge by edge of its four parts: halves of its sides, and what
 * lies between two midpoints and so in two parts. */
static void check_leaving(const router *p, int32_t t, double (*flow)[3])
{
    static const int end[9][2] = {{1, 3}, {2, 3}, {4, 5}, {2, 4}, {0, 4},
                                  {5, 3}, {0, 5}, {1, 5}, {3, 4}};
    double value[6], net[6], size[6], sum[6] = {0}, sizes[6] = {0};
    for (int k = 0; k < 3; k++) {
        value[k] = p->u[p->n.vertex_row + p->mesh->triangle[3 * t + k]];
        value[3 + k] = p->u[p->mesh->triangle_edge[3 * t + k]];
    }
    for (int l = 0; l < 9; l++) {
        const int a = end[l][0], b = end[l][1], k = l / 3;
        const bool is_half = l % 3 < 2;
        const double by =
            (is_half ? 0.5 : 1) * p->mu[t] * dmk_cot(p->mesh, 3 * t + k) * (value[a] - value[b]) +
            (flow && is_half ? flow[a][k] : 0);
        sum[a] += by;
        sum[b] -= by;
        sizes[a] += fabs(by);
        sizes[b] += fabs(by);
    }
    leave(p, t, flow, net, size);
    for (int k = 0; k < 6; k++) {
        assert_true(fabs(net[k] - sum[k]) <= 1e-14 * sizes[k]);
        assert_true(fabs(size[k] - sizes[k]) <= 1e-14 * sizes[k]);
    }
}

/* Whatever flows and potential are. */
static void the_cost_is_that_of_the_flux(void **state)
{
    fixture *x = *state;
    const dmk_mesh *m = x->order.mesh;
    double *u = random_rows(x), *half = random_rows(x), *sent = random_rows(x),
           *beside = new_rows(x), *mean = calloc(3 * (size_t)m->n_triangles, sizeof *mean);
    router p = {.mesh = m,
                .n = dmk_system_counts(x->b.dev, m),
                .edges = {0, m->n_edges},
                .mu = x->mu,
                .u = u,
                .half = half,
                .sent = sent,
                .beside = beside,
                .mean = mean};
    set_density(x, 1);
    add_sides(&p);
    mean_range(0, m->n_triangles, &p);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double flow[3][3];
        flows_of(&p, t, flow);
        check_flux(&p, t);
        check_leaving(&p, t, NULL);
        check_leaving(&p, t, flow);
    }
    free(u);
    free(half);
    free(sent);
    free(beside);
    free(mean);
}

/* An edge goes by the heavier of its sides, or by its only one, eight bins to a power of 2. */
static void heavy_edges_come_first(void **state)
{
    (void)state;
    int32_t sides[] = {0, 1, 1, -1, 2, 0, 2, -1};
    double mu[] = {1e9, 1, 4, 0.25}; /* the first belongs to none */
    const dmk_mesh m = {.n_edges = 4, .edge_triangle = sides};
    const router p = {.mesh = &m, .mu = mu + 1};
    const int bin = bin_of(&p, 0);
    assert_int_equal(bin_of(&p, 1), bin);
    assert_int_equal(bin_of(&p, 2), bin + 16);
    assert_int_equal(bin_of(&p, 3), bin + 32);
}

/* A gap that more steps will answer is told without an upper bound: of a rough v, whose slopes are nowhere alike. */
static void a_gap_ahead_is_told(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_solve_options options = {.struct_size = sizeof options};
    dmk_stats stats = {0};
    dmk_iteration o = {.ctx = x->b.ctx,
                       .sys = s,
                       .mesh = x->order.mesh,
                       .options = &options,
                       .stats = &stats,
                       .goes_on = true};
    random_state = 7; /* the gap is that of these numbers */
    set_density(x, 2);
    double *v = random_rows(x), *f = apply(x, v);
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->f, x->n, f));
    ok(x, dmk_buffer_write_real(x->b.ctx, x->b.dev, DMK_OUTER, s->u, x->n, v));
    ok(x, dmk_certify(&o, true));
    assert_true(stats.cost_lower > 0 && stats.cost_upper == 0 && !o.certified);
    assert_true(stats.gap > 0.54 && stats.gap < 0.67);
    free(v);
    free(f);
}

/* The host's q, which stands in for the device's where cotangents are large, is the same where they are not; here it is
 * below 1. */
static void both_kinds_of_slopes_agree(void **state)
{
    fixture *x = *state;
    double *v = random_rows(x), lower[2] = {0}, upper;
    for (size_t i = 0; i < x->n; i++) v[i] *= 1e-3;
    set_density(x, 1);
    bounds_of(x, v, 1, &lower[0], &upper);
    const double sharpest = x->sys->sharpest;
    assert_true(sharpest > 0.5 && sharpest < most_cot);
    x->sys->sharpest = 2 * most_cot;
    bounds_of(x, v, 1, &lower[1], &upper);
    x->sys->sharpest = sharpest;
    assert_true(fabs(lower[1] / lower[0] - 1) < 1e-11);
    free(v);
}

/* A right-hand side's parts are rounded only where no angle is below half a degree. */
static void needles_are_not_rounded(void **state)
{
    fixture *x = *state;
    const double degree = acos(-1) / 180, sharpest = x->sys->sharpest;
    x->sys->sharpest = 1 / tan(0.6 * degree);
    const bool above = is_paired(x->sys);
    x->sys->sharpest = 1 / tan(0.4 * degree);
    const bool below = is_paired(x->sys);
    x->sys->sharpest = sharpest;
    assert_true(above && !below);
}

/* Flat triangles, the slope along them being 1: never below it, and above by the rounding of the values only. */
static void slopes_of_flat_triangles(void **state)
{
    (void)state;
    static const double heights[] = {0.8, 1e-3, 1e-6, 1e-8};
    for (size_t i = 0; i < sizeof heights / sizeof *heights; i++) {
        const double h = heights[i], place = 0.3;
        const double side[3] = {hypot(1 - place, h), hypot(place, h), 1};
        for (int turn = 0; turn < 3; turn++) {
            double l[3], at[3];
            for (int k = 0; k < 3; k++) {
                l[(k + turn) % 3] = side[k];
                at[(k + turn) % 3] = 5 + (const double[]){0, 1, place}[k];
            }
            const double q = steepness(l, 0.5 * h, at);
            if (!(q >= 1 && q - 1 < 1e-14 + pow(1e-14 / h, 2)))
                fail_msg("height %g: q - 1 = %g", h, q - 1);
        }
    }
}

/* phi over bands, of which those beyond the ends do not count: a band's slope is the mean of three, each the least of
 * three around it. */
static void bands_end_at_the_ends(void **state)
{
    (void)state;
    enum { N = 6 };
    static const float q[N] = {0, 2, 0.5f, 4, 1, 8};
    double least[N + 2] = {0}, phi[N + 1], sum = 0;
    float around[N + 4] = {1e30f, 1e30f};
    int32_t bits[N + 4];
    memcpy(around + 2, q, sizeof q);
    around[N + 2] = around[N + 3] = 1e30f;
    memcpy(bits, around, sizeof bits);
    integrate_bands(N, bits + 2, 0.25, phi);
    for (int k = -1; k <= N; k++) {
        least[k + 1] = 1;
        for (int j = k < 1 ? 0 : k - 1; j < N && j <= k + 1; j++)
            if (q[j] > 0) least[k + 1] = fmin(least[k + 1], 1 / (double)q[j]);
    }
    for (int l = 0; l < N; l++) {
        assert_true(fabs(phi[l] - sum) < 1e-15);
        sum += 0.25 * (least[l] + least[l + 1] + least[l + 2]) / 3;
    }
    assert_true(fabs(phi[N] - sum) < 1e-15);
}

/* ---- pseudo time ---- */

static void the_fine_graph_is_for_needles(void **state)
{
    (void)state;
    assert_true(dmk_is_needle((double[]){0, 12, 0}));
    assert_false(dmk_is_needle((double[]){-20, 11, 1}));
    assert_true(dmk_fine_graph_pays(1000, 30, 9e5));
    assert_false(dmk_fine_graph_pays(1000, 15, 9e5));             /* too few */
    assert_false(dmk_fine_graph_pays(1000, 30, 1.1e6));           /* too sharp */
    assert_false(dmk_fine_graph_pays(INT32_MAX, INT32_MAX, 9e5)); /* too many */
}

static void steps_grow_and_shrink(void **state)
{
    (void)state;
    step_control p = control_of(&(dmk_iteration){.sys = &(dmk_system){.n_levels = 0}}, true);
    choose_step(&p, 1); /* nothing to compare with */
    assert_true(p.D == 50 && !p.shrunk && p.rho_before == 1 && p.iterations == 3);
    choose_step(&p, 0.89);
    assert_true(p.D == 75 && p.rho_before == 0.89 && p.iterations == 3);
    choose_step(&p, 0.89 * 0.91); /* not enough better */
    assert_true(p.D == 75);
    choose_step(&p, 0.5);
    assert_true(p.D == 112.5 && p.iterations == 4);
    choose_step(&p, 0.1);
    assert_true(p.D == 150);
    choose_step(&p, 0.12); /* worse within the noise */
    assert_true(p.D == 150 && !p.shrunk);
    choose_step(&p, 0.16);
    assert_true(p.D == 75 && p.shrunk);
    choose_step(&p, 0.16);
    assert_true(p.D == 75 && !p.shrunk);
    for (int i = 0; i < 20; i++) choose_step(&p, ldexp(1, i));
    assert_true(p.D == 5 && !p.shrunk && p.iterations == 3);
    step_control brief = {
        .D = 4, .longest = 150, .growth = 1.6, .brief = 5, .most = 3, .stiff = 100};
    choose_step(&brief, 1);
    assert_true(brief.D == 4 && brief.iterations == 1);
    choose_step(&brief, 0.5);
    assert_true(brief.D == 6.4 && brief.iterations == 2);
    brief.D = 12.45;
    choose_step(&brief, 0.25);
    assert_true(brief.D < 20 && brief.iterations == 2);
    choose_step(&brief, 0.125);
    assert_true(brief.D > 20 && brief.iterations == 3);
    for (int i = 0; i < 20; i++)
        choose_step(&brief, ldexp(1, i)); /* a step that shrinks is not brief */
    assert_true(brief.D == 5 && brief.iterations == 2);
    assert_true(error_estimate(&(step_control){.D = 50, .slow = 100}, 1) == 2);
    assert_true(error_estimate(&(step_control){.D = 100, .slow = 100}, 1) == 1);
    assert_true(error_estimate(&(step_control){.D = 150, .slow = 100}, 1) == 1);
}

/* A small change of mu ends the steps where the gap is small, too; else the tolerance becomes a third, twice. */
static void steps_go_on_for_a_gap(void **state)
{
    fixture *x = *state;
    static const struct {
        double gap, tolerance;
        bool settled;
    } cases[] = {
        {2.1e-3, 3e-3, true}, {4.2e-3, 3e-3, false}, {4.2e-3, 1e-3, false}, {4.2e-3, 3.4e-4, true}};
    const step_control p = {.D = 100, .slow = 100};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        dmk_stats stats = {.gap = cases[i].gap};
        const dmk_solve_options options = {.struct_size = sizeof options};
        dmk_iteration o = {.ctx = x->b.ctx,
                           .stats = &stats,
                           .options = &options,
                           .tolerance = cases[i].tolerance,
                           .certified = true}; /* the gap is there */
        bool settled;
        ok(x, has_settled(&o, &p, 1.01 * cases[i].tolerance, &settled));
        assert_true(!settled && o.tolerance == cases[i].tolerance);
        ok(x, has_settled(&o, &p, 0.99 * cases[i].tolerance, &settled));
        assert_true(settled == cases[i].settled && !o.goes_on);
        assert_true(o.tolerance == cases[i].tolerance / (settled ? 1 : 3));
    }
}

/* The work of whole solves, from a distance and from nothing. */
static void solves_take_their_steps(void **state)
{
    fixture *x = *state;
    static const struct {
        dmk_start start;
        int steps, iterations;
    } cases[] = {{DMK_START_DISTANCE, 12, 41}, {DMK_START_UNIFORM, 23, 80}};
    problem p = problem_file(&x->b, "tests/data/sphere_1280.off");
    problem q = problem_file(&x->b, "meshes/torus.off");
    for (size_t i = 0; i < 2; i++) {
        p.options.start = q.options.start = cases[i].start;
        problem_solve(&p);
        problem_solve(&q);
        const int steps = p.stats.steps + q.stats.steps,
                  cg = p.stats.cg_iterations + q.stats.cg_iterations;
        print_message("start %zu: %d steps, %d iterations\n", i, steps, cg);
        assert_true(steps <= cases[i].steps && cg <= cases[i].iterations);
        assert_true(p.stats.v_cycles >= p.stats.cg_iterations &&
                    p.stats.v_cycles <= 2 * p.stats.cg_iterations + 10);
    }
    problem_free(&p);
    problem_free(&q);
}

static void fill_with_nan(bench *b, dmk_program p, dmk_buffer *to, int32_t n)
{
    bench_ok(b, dmk_buffer_fill_real(b->ctx, b->dev, p, to, (size_t)n, NAN));
}

/* All that a solve works with. */
static void leave_nan(bench *b, const dmk_system *s)
{
    const int32_t row = s->n_rows_pad, element = s->n_elements_pad;
    for (int32_t i = 0; i < s->n_levels; i++) {
        const dmk_level *l = &s->level[i];
        dmk_buffer *all[] = {l->x, l->x_old, l->rhs, l->inv_diag};
        for (int k = 0; k < 4; k++) fill_with_nan(b, DMK_INNER, all[k], l->n_pad);
    }
    dmk_buffer *narrow[] = {s->x, s->x_old, s->inv_diag, s->cg[DMK_INNER].r};
    for (int k = 0; k < 4; k++) fill_with_nan(b, DMK_INNER, narrow[k], row);
    dmk_buffer *wide[] = {s->u, s->cg[DMK_OUTER].r, s->cg[DMK_OUTER].p, s->cg[DMK_OUTER].ap};
    for (int k = 0; k < 4; k++) fill_with_nan(b, DMK_OUTER, wide[k], row);
    fill_with_nan(b, DMK_OUTER, s->mu, element);
    fill_with_nan(b, DMK_OUTER, s->q, element);
    fill_with_nan(b, DMK_OUTER, s->out_real, 6 * element);
    fill_with_nan(b, DMK_INNER, s->out, 6 * element); /* the first half of the same, or all */
    fill_with_nan(b, DMK_INNER, s->weight, 3 * element);
    fill_with_nan(b, DMK_INNER, s->rank_one, 6 * element);
}

static void check_same(const problem *a, const problem *b)
{
    assert_memory_equal(problem_mu(a), problem_mu(b), problem_triangles(a) * sizeof(double));
    assert_true(a->stats.cost_lower == b->stats.cost_lower);
    assert_true(a->stats.cost_upper == b->stats.cost_upper);
}

/* NaN of a solve that diverged is not found again by the next: neither what such a solve leaves, nor any. */
static void divergence_leaves_nothing(void **state)
{
    (void)state;
    for (int k = 0; k < 4; k++) {
        bench b;
        bench_open(&b, &(dmk_device_options){.struct_size = sizeof(dmk_device_options),
                                             .single_precision = k % 2});
        const char *file = k < 2 ? "meshes/torus.off" : "meshes/ellipsoid.off";
        problem fresh = problem_file(&b, file), p = problem_file(&b, file);
        problem_solve(&fresh);
        p.options.method = DMK_INERTIAL;
        p.options.inertia = 0.9999;
        assert_int_equal(problem_try(&p), DMK_E_DIVERGED);
        dmk_solve_options_init(&p.options, sizeof p.options);
        problem_solve(&p);
        check_same(&p, &fresh);
        leave_nan(&b, p.solver->system);
        problem_solve(&p);
        check_same(&p, &fresh);
        problem_free(&p);
        problem_free(&fresh);
        bench_close(&b);
    }
}

/* The first explicit step, which has no inertia, leaves mu where |grad u| = 1, however large it is. */
static void the_first_step_has_none_before(void **state)
{
    bench b;
    double change;
    (void)state;
    bench_open(&b, &(dmk_device_options){.struct_size = sizeof(dmk_device_options),
                                         .single_precision = 1});
    problem p = problem_file(&b, "meshes/torus.off");
    p.options.method = DMK_INERTIAL;
    p.options.max_steps = 1;
    assert_int_equal(problem_try(&p), DMK_E_LIMIT);
    dmk_system *s = p.solver->system;
    bench_ok(&b, dmk_elements_fill(b.ctx, s, s->mu, 1000));
    bench_ok(&b, dmk_elements_fill(b.ctx, s, s->q, 1));
    bench_ok(&b, dmk_elements_fill(b.ctx, s, s->before, 0));
    bench_ok(&b, dmk_explicit_update(b.ctx, s, true, 1, 0, DMK_FLOOR, 0));
    bench_ok(&b, dmk_buffer_read_real(b.ctx, b.dev, DMK_OUTER, s->scalars, 1, &change));
    assert_true(change == 0);
    const dmk_iteration o = problem_iteration(&p);
    assert_int_equal(dmk_iteration_diverged(&o, 1, "so"), DMK_E_DIVERGED);
    assert_non_null(strstr(dmk_context_message(b.ctx), "compute in double precision"));
    problem_free(&p);
    bench_close(&b);
}

/* A change that is no number, or beyond all bounds, ends the steps. */
static void steps_that_diverge_are_told(void **state)
{
    fixture *x = *state;
    dmk_stats stats = {0};
    const dmk_solve_options options = {.struct_size = sizeof options};
    dmk_iteration o = {.ctx = x->b.ctx,
                       .sys = x->sys,
                       .mesh = x->order.mesh,
                       .triangle_old = x->order.triangle_old,
                       .stats = &stats,
                       .options = &options};
    static const double change[] = {NAN, INFINITY, 2.5e6, 5e5, 0};
    for (size_t i = 0; i < sizeof change / sizeof *change; i++) {
        const int rc = dmk_iteration_step_done(&o, 3, 9, 4, change[i]);
        assert_int_equal(rc, i < 3 ? DMK_E_DIVERGED : DMK_OK);
        if (i < 3) assert_non_null(strstr(dmk_context_message(x->b.ctx), "diverged at step 3"));
        if (i == 2) assert_non_null(strstr(dmk_context_message(x->b.ctx), "mu 2e+06)"));
    }
}

/* ---- the right-hand side ---- */

/* A point's weights on the corners and the opposite midpoints: not negative, of sum 1, on one of the four
 * sub-triangles, and such that linear functions come out right. */
static void points_are_weighted(void **state)
{
    (void)state;
    for (int trial = 0; trial < 500; trial++) {
        double b[3], w[6], sum = 0;
        for (int k = 0; k < 3; k++)
            b[k] = trial < 3 ? k == trial : trial < 6 ? 0.5 * (k != trial - 3) : random_unit();
        for (int k = 0; k < 3; k++) sum += b[k];
        for (int k = 0; k < 3; k++) b[k] /= sum;
        dmk_point_weights(b, w);
        int used = 0;
        double all = 0;
        for (int k = 0; k < 6; k++) {
            assert_true(w[k] >= -1e-15);
            used += w[k] > 1e-15;
            all += w[k];
        }
        assert_true(fabs(all - 1) < 1e-14 && used <= 3);
        for (int k = 0; k < 3; k++) { /* the barycentric coordinates themselves */
            const double value = w[k] + 0.5 * (w[3 + (k + 1) % 3] + w[3 + (k + 2) % 3]);
            assert_true(fabs(value - b[k]) < 1e-14);
        }
    }
}

/* ---- sliced rows ---- */

static void sliced_rows_hold_all_entries(void **state)
{
    fixture *x = *state;
    enum { N = 21 };
    int32_t row[N + 1] = {0}, entry[N * N];
    float weight[N * N];
    for (int32_t i = 0; i < N; i++) { /* lengths 0 to 6, an empty slice's worth of them */
        const int32_t length = i >= 8 && i < 16 ? 0 : i % 7;
        row[i + 1] = row[i] + length;
        for (int32_t j = 0; j < length; j++) {
            entry[row[i] + j] = 100 * i + j;
            weight[row[i] + j] = (float)(i + 0.25 * j);
        }
    }
    for (int32_t filler = -1; filler < 4; filler += 4) {
        dmk_sell sell = {0};
        ok(x, dmk_sell_create(x->b.ctx, N, row, entry, weight, filler, &sell));
        assert_int_equal(sell.n_slices, 3);
        assert_int_equal(sell.slice[0], 0);
        assert_int_equal(sell.slice[1], 6);     /* its longest row */
        assert_int_equal(sell.slice[2], 6 + 1); /* no row has an entry, yet there is a column */
        for (int32_t i = 0; i < N; i++) {
            const int32_t columns = sell.slice[i / 8 + 1] - sell.slice[i / 8];
            for (int32_t j = 0; j < columns; j++) {
                const int32_t at = 8 * (sell.slice[i / 8] + j) + i % 8;
                const bool there = j < row[i + 1] - row[i];
                assert_int_equal(sell.entry[at], there        ? entry[row[i] + j]
                                                 : filler < 0 ? i
                                                              : filler);
                assert_true(sell.weight[at] == (there ? weight[row[i] + j] : 0));
            }
        }
        dmk_sell_free(&sell);
        ok(x, dmk_sell_create(x->b.ctx, N, row, entry, NULL, filler, &sell));
        assert_null(sell.weight);
        dmk_sell_free(&sell);
    }
    for (int32_t n = 0; n < 40; n++)
        assert_true(dmk_padded(n) % 8 == 0 && dmk_padded(n) > n && dmk_padded(n) <= n + 8);
}

/* ---- the first of many offenders, whatever thread finds one ---- */

static void the_first_offender_is_named(void **state)
{
    fixture *x = *state;
    enum { SIDE = 300, N = SIDE * SIDE };
    double *xyz = calloc(3 * N, sizeof *xyz);
    int32_t *triangle = calloc(6 * N, sizeof *triangle), *t = triangle;
    for (int32_t i = 0; i < N; i++) {
        xyz[3 * i] = i % SIDE;
        xyz[3 * i + 1] = i / SIDE;
    }
    for (int32_t i = 0; i + SIDE < N; i++) {
        if (i % SIDE == SIDE - 1) continue;
        const int32_t both[6] = {i, i + 1, i + SIDE + 1, i, i + SIDE + 1, i + SIDE};
        memcpy(t, both, sizeof both);
        t += 6;
    }
    const size_t n = (size_t)(t - triangle) / 3;
    static const size_t bad[] = {170001, 90002, 90005, 150000};
    char expected[64];
    for (int round = 0; round < 8; round++) {
        dmk_mesh *mesh = NULL;
        const int32_t kind = round % 2 ? N : -1; /* past the end, before the begin */
        size_t first = n;
        for (size_t k = 0; k < 4; k++) {
            triangle[3 * bad[k] + k % 3] = kind;
            if (bad[k] < first) first = bad[k];
        }
        ok(x, dmk_context_set_threads(x->b.ctx, 1 + round));
        assert_int_equal(dmk_mesh_create(x->b.ctx, N, xyz, n, triangle, &mesh), DMK_E_MESH);
        snprintf(expected, sizeof expected, "triangle %zu ", first);
        if (!strstr(dmk_context_message(x->b.ctx), expected)) {
            fail_msg("'%s' is not in: %s", expected, dmk_context_message(x->b.ctx));
        }
    }
    ok(x, dmk_context_set_threads(x->b.ctx, 0));
    free(xyz);
    free(triangle);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(multigrid_keeps_its_rate),
        cmocka_unit_test(conjugate_gradients_converge),
        cmocka_unit_test(conjugate_gradients_stop),
        cmocka_unit_test(bounds_hold_for_any_potential),
        cmocka_unit_test(a_gap_ahead_is_told),
        cmocka_unit_test(both_kinds_of_slopes_agree),
        cmocka_unit_test(needles_are_not_rounded),
        cmocka_unit_test(slopes_of_flat_triangles),
        cmocka_unit_test(bands_end_at_the_ends),
        cmocka_unit_test(the_fine_graph_is_for_needles),
        cmocka_unit_test(steps_grow_and_shrink),
        cmocka_unit_test(steps_go_on_for_a_gap),
        cmocka_unit_test(solves_take_their_steps),
        cmocka_unit_test(divergence_leaves_nothing),
        cmocka_unit_test(the_first_step_has_none_before),
        cmocka_unit_test(steps_that_diverge_are_told),
        cmocka_unit_test(points_are_weighted),
        cmocka_unit_test(sliced_rows_hold_all_entries),
        cmocka_unit_test(the_first_offender_is_named),
        cmocka_unit_test(both_kinds_of_coarsest_inverse_agree),
        cmocka_unit_test(the_cost_is_that_of_the_flux),
        cmocka_unit_test(heavy_edges_come_first),
    };
    return cmocka_run_group_tests_name("units", tests, setup, teardown);
}
