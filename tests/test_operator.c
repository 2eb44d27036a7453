/* The macro-element operators and the V-cycle against a dense assembly. */
#include "solver/kernels.h"
#include "solver/setup.h"
#include "solver/iteration.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

/* One small problem: the ordered sphere_1280 mesh on the device, with an arbitrary density. */
typedef struct fixture {
    dmk_context *ctx;
    dmk_device *dev;
    dmk_mesh *input;
    dmk_order order;
    dmk_system *sys;
    size_t n;      /* rows */
    double *mu;    /* n_elements */
    double *dense; /* n * n: A(mu), padding rows 0 */
} fixture;

static uint32_t random_state;
static double random_unit(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) / 16777216.0;
}

static void ok(const fixture *x, int rc)
{
    if (rc != DMK_OK) fail_msg("%d: %s", rc, dmk_context_message(x->ctx));
}

/* Edge k of sub-triangle s of element t: its two rows; back comes its weight in the P1 stiffness matrix. */
static double stiff_edge(const fixture *x, int32_t t, int s, int k, size_t *i, size_t *j)
{
    /* Corners of each sub-triangle in the order that is similar to the parent. */
    static const int sub[4][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}, {3, 4, 5}};
    const dmk_mesh *m = x->order.mesh;
    size_t row[6];
    for (int c = 0; c < 3; c++) {
        row[c] = (size_t)(x->sys->vertex_row + m->triangle[3 * t + c]);
        row[3 + c] = (size_t)m->triangle_edge[3 * t + c];
    }
    *i = row[sub[s][(k + 1) % 3]];
    *j = row[sub[s][(k + 2) % 3]];
    return 0.5 * x->mu[t] * dmk_cot(m, 3 * t + k);
}

/* The 15 entries per element straight from the four sub-triangles' P1 stiffness matrices. */
static void assemble(fixture *x)
{
    x->dense = calloc(x->n * x->n, sizeof *x->dense);
    for (int32_t n = 0; n < 12 * x->order.mesh->n_triangles; n++) {
        size_t i, j;
        const double w = stiff_edge(x, n / 12, n / 3 % 4, n % 3, &i, &j);
        x->dense[i * x->n + i] += w;
        x->dense[j * x->n + j] += w;
        x->dense[i * x->n + j] -= w;
        x->dense[j * x->n + i] -= w;
    }
}

static fixture *open_shape(void **state, dmk_shape shape)
{
    fixture *x = calloc(1, sizeof *x);
    dmk_device_options o;
    *state = x;
    dmk_context_create(&x->ctx);
    dmk_device_options_init(&o, sizeof o);
    o.shape = shape;
    ok(x, dmk_device_open(x->ctx, &o, &x->dev));
    return x;
}

/* The input's system, and a density. */
static void pack(fixture *x)
{
    ok(x, dmk_order_create(x->ctx, x->input, 0, &x->order));
    ok(x, dmk_system_create(x->ctx, x->dev, x->order.mesh, &x->sys));
    ok(x, dmk_system_allocate(x->ctx, x->sys));
    x->n = (size_t)x->sys->n_rows_pad;
    x->mu = calloc((size_t)x->sys->n_elements_pad, sizeof *x->mu);
    random_state = 7;
    for (int32_t t = 0; t < x->sys->n_elements; t++) x->mu[t] = pow(10, 3 * random_unit() - 2);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, x->sys->mu,
                                (size_t)x->sys->n_elements_pad, x->mu));
}

static int setup_shape(void **state, dmk_shape shape)
{
    fixture *x = open_shape(state, shape);
    ok(x, dmk_mesh_read(x->ctx, "tests/data/sphere_1280.off", &x->input));
    pack(x);
    assemble(x);
    return 0;
}

static int setup(void **state)
{
    return setup_shape(state, DMK_SHAPE_AUTO);
}
static int setup_gpu(void **state)
{
    return setup_shape(state, DMK_SHAPE_GPU);
}

/* A torus of `round` times `across` pairs of triangles. */
static void open_torus(void **state, dmk_shape shape, int32_t round, int32_t across)
{
    const double turn = 6.283185307179586;
    const int32_t n = round * across;
    fixture *x = open_shape(state, shape);
    double *xyz = calloc(3 * (size_t)n, sizeof *xyz);
    int32_t *triangle = calloc(6 * (size_t)n, sizeof *triangle);
    for (int32_t v = 0; v < n; v++) {
        const int32_t i = v / across, j = v % across, up = (i + 1) % round * across,
                      right = (j + 1) % across;
        const double a = turn * i / round, b = turn * j / across, r = 2 + cos(b);
        const int32_t corner[] = {v, up + j, up + right, v, up + right, i * across + right};
        const double at[] = {r * cos(a), r * sin(a), sin(b)};
        memcpy(xyz + 3 * v, at, sizeof at);
        memcpy(triangle + 6 * v, corner, sizeof corner);
    }
    ok(x, dmk_mesh_create(x->ctx, (size_t)n, xyz, 2 * (size_t)n, triangle, &x->input));
    free(xyz);
    free(triangle);
    pack(x);
}

/* With more than DMK_FAR rows. */
static int setup_far(void **state)
{
    open_torus(state, DMK_SHAPE_CPU, 512, 512);
    return 0;
}

/* Of needles with angles of 1 to 4 degrees. */
static int setup_needles(void **state)
{
    open_torus(state, DMK_SHAPE_AUTO, 8, 128);
    return 0;
}
static int setup_needles_gpu(void **state)
{
    open_torus(state, DMK_SHAPE_GPU, 8, 128);
    return 0;
}

static int teardown(void **state)
{
    fixture *x = *state;
    dmk_system_destroy(&x->sys);
    dmk_order_free(&x->order);
    dmk_mesh_destroy(&x->input);
    dmk_device_destroy(&x->dev);
    dmk_context_destroy(&x->ctx);
    free(x->mu);
    free(x->dense);
    free(x);
    return 0;
}

static double *random_rows(const fixture *x)
{
    double *v = calloc(x->n, sizeof *v);
    for (int32_t i = 0; i < x->sys->n_rows; i++) {
        if (i < x->sys->n_edges || i >= x->sys->vertex_row) v[i] = random_unit() - 0.5;
    }
    return v;
}

static double dot(size_t n, const double *a, const double *b)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

static void prepare(const fixture *x)
{
    dmk_system *s = x->sys;
    ok(x, dmk_element_prepare(x->ctx, s));
    ok(x, dmk_inverse_diagonal(x->ctx, s));
    ok(x, dmk_multigrid_refresh(x->ctx, s, DMK_STIFFNESS));
}

/* y = A v by the device, in the outer precision. */
static double *apply(const fixture *x, const double *v)
{
    dmk_system *s = x->sys;
    double *y = calloc(x->n, sizeof *y);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->cg[DMK_OUTER].p, x->n, v));
    ok(x, dmk_element_stiffness(x->ctx, s, DMK_OUTER, s->cg[DMK_OUTER].p));
    ok(x, dmk_rows_apply(x->ctx, s, s->cg[DMK_OUTER].p, s->cg[DMK_OUTER].ap));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->cg[DMK_OUTER].ap, x->n, y));
    return y;
}

/* The 32-bit numbers of a buffer. */
static void *read_words(const fixture *x, const dmk_buffer *b, size_t n)
{
    void *words = calloc(n, sizeof(int32_t));
    ok(x, dmk_buffer_read(x->ctx, x->dev, b, 0, n * sizeof(int32_t), words));
    return words;
}

static void operator_equals_dense(void **state)
{
    fixture *x = *state;
    prepare(x);
    double *v = random_rows(x), *y = apply(x, v), worst = 0, size = 0;
    for (size_t i = 0; i < x->n; i++) {
        double exact = dot(x->n, x->dense + i * x->n, v);
        worst = fmax(worst, fabs(exact - y[i]));
        size = fmax(size, fabs(exact));
    }
    assert_true(worst <= 1e-13 * size);
    free(v);
    free(y);
}

/* Rows that ask ahead sum what belongs to them, and the lists are long enough for it. */
static void operator_of_far_rows_equals_its_edges(void **state)
{
    fixture *x = *state;
    const dmk_system *s = x->sys;
    assert_true(s->n_rows > DMK_FAR);
    prepare(x);
    double *v = random_rows(x), *y = apply(x, v), *exact = calloc(x->n, sizeof *exact);
    for (int32_t n = 0; n < 12 * x->order.mesh->n_triangles; n++) {
        size_t i, j;
        const double w = stiff_edge(x, n / 12, n / 3 % 4, n % 3, &i, &j);
        exact[i] += w * (v[i] - v[j]);
        exact[j] += w * (v[j] - v[i]);
    }
    double worst = 0, size = 0;
    for (size_t i = 0; i < x->n; i++) {
        worst = fmax(worst, fabs(exact[i] - y[i]));
        size = fmax(size, fabs(exact[i]));
    }
    assert_true(worst <= 1e-13 * size);
    const size_t slices = x->n / DMK_WIDTH;
    int32_t *slice = read_words(x, s->slice, slices + 1);
    const size_t n_slots = DMK_WIDTH * (size_t)(slice[slices] + DMK_AHEAD);
    int32_t *slot = read_words(x, s->slot, n_slots);
    for (size_t i = 0; i < n_slots; i++) assert_in_range(slot[i], 0, 6 * s->n_elements_pad - 1);
    free(v);
    free(y);
    free(exact);
    free(slice);
    free(slot);
}

static void operator_is_symmetric_with_constants_in_its_null_space(void **state)
{
    fixture *x = *state;
    prepare(x);
    double *v = random_rows(x), *w = random_rows(x), *av = apply(x, v), *aw = apply(x, w);
    double wav = dot(x->n, w, av), vaw = dot(x->n, v, aw);
    assert_true(fabs(wav - vaw) <= 1e-12 * fabs(wav));
    for (size_t i = 0; i < x->n; i++) v[i] = 1;
    double *zero = apply(x, v);
    for (int32_t i = 0; i < x->sys->n_rows; i++) assert_true(fabs(zero[i]) < 1e-12);
    free(v);
    free(w);
    free(av);
    free(aw);
    free(zero);
}

static double *v_cycle(const fixture *x, const double *rhs)
{
    dmk_system *s = x->sys;
    double *z = calloc(x->n, sizeof *z);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->cg[DMK_INNER].r, x->n, rhs));
    ok(x, dmk_v_cycle(x->ctx, s, DMK_STIFFNESS, s->cg[DMK_INNER].r, false));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_INNER, s->x_old, x->n, z));
    return z;
}

static void v_cycle_is_nearly_symmetric_and_contracts(void **state)
{
    fixture *x = *state;
    prepare(x);
    double *v = random_rows(x), *w = random_rows(x), *av = apply(x, v), *aw = apply(x, w);
    double *bv = v_cycle(x, av), *bw = v_cycle(x, aw);
    double p = dot(x->n, aw, bv), q = dot(x->n, av, bw);
    assert_true(fabs(p - q) <= 1e-4 * fmax(fabs(p), fabs(dot(x->n, av, bv))));
    /* Energy norm of the error after one cycle. */
    for (size_t i = 0; i < x->n; i++) bv[i] = v[i] - bv[i];
    double *e = apply(x, bv), ratio = sqrt(dot(x->n, bv, e) / dot(x->n, v, av));
    if (!(ratio < 0.5)) fail_msg("one V-cycle leaves %.3f of the energy error", ratio);
    free(v);
    free(w);
    free(av);
    free(aw);
    free(bv);
    free(bw);
    free(e);
}

/* Without T the cycle's finest graph is Newton's matrix, element by element. */
static void the_fine_graph_is_newtons_matrix(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_level *l = &s->level[0];
    const dmk_mesh *m = x->order.mesh;
    assert_true(s->without_T && s->n_levels > 2);
    prepare(x);
    double *v = random_rows(x), *exact = calloc(x->n, sizeof *exact),
           *size = calloc(x->n, sizeof *size);
    for (int32_t n = 0; n < 12 * m->n_triangles; n++) {
        size_t i, j;
        const double w = stiff_edge(x, n / 12, n / 3 % 4, n % 3, &i, &j);
        exact[i] += w * (v[i] - v[j]);
        exact[j] += w * (v[j] - v[i]);
        size[i] += fabs(w);
        size[j] += fabs(w);
    }
    float *g = calloc(6 * (size_t)s->n_elements_pad, sizeof *g);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        float part[6], sum = 0, along = 0;
        size_t row[6];
        for (int k = 0; k < 6; k++) {
            row[k] = (size_t)(k < 3 ? s->vertex_row + m->triangle[3 * t + k]
                                    : m->triangle_edge[3 * t + k - 3]);
            part[k] = k < 5 ? (float)(random_unit() - 0.5) : -sum;
            sum += part[k];
            g[dmk_slot(t, k, 6)] = part[k];
            along += part[k] * (float)v[row[k]];
        }
        for (int k = 0; k < 6; k++) exact[row[k]] += part[k] * along;
        for (int k = 0; k < 6; k++) size[row[k]] += 1;
    }
    ok(x, dmk_buffer_write(x->ctx, x->dev, s->rank_one, 0,
                           6 * sizeof *g * (size_t)s->n_elements_pad, g));
    ok(x, dmk_multigrid_refresh(x->ctx, s, DMK_NEWTON_MATRIX));
    int32_t *slice = read_words(x, l->slice, x->n / 8 + 1);
    int32_t *neighbour = read_words(x, l->neighbour, 8 * (size_t)slice[x->n / 8]);
    float *weight = read_words(x, l->weight, 8 * (size_t)slice[x->n / 8]);
    for (size_t i = 0; i < (size_t)s->n_rows; i++) {
        double y = 0;
        for (int32_t j = slice[i / 8]; j < slice[i / 8 + 1]; j++) {
            const size_t at = 8 * (size_t)j + i % 8;
            y += (double)weight[at] * (v[i] - v[neighbour[at]]);
        }
        if (!(fabs(y - exact[i]) <= 2e-6 * size[i])) fail_msg("row %zu: %g for %g", i, y, exact[i]);
    }
    void *all[] = {v, exact, size, g, slice, neighbour, weight};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

/* On needles the cycle without T contracts as on other meshes. Through T it leaves all of what is the same on
 * midpoints side by side and 0 on the vertices. */
static void the_cycle_without_t_contracts_on_needles(void **state)
{
    fixture *x = *state;
    prepare(x);
    double *v = calloc(x->n, sizeof *v);
    for (int32_t e = 0; e < x->sys->n_edges; e++) v[e] = x->order.mesh->length[e] > 0.2;
    double *av = apply(x, v), *z = v_cycle(x, av);
    for (size_t i = 0; i < x->n; i++) z[i] = v[i] - z[i];
    double *e = apply(x, z), ratio = sqrt(dot(x->n, z, e) / dot(x->n, v, av));
    if (!(ratio < 0.5)) fail_msg("one V-cycle leaves %.3f of the energy error", ratio);
    free(v);
    free(av);
    free(z);
    free(e);
}

/* Newton's matrix without its rank-one part, which is A; its weights lie where rank_one comes. */
static void no_rank_one(const fixture *x)
{
    prepare(x);
    ok(x, dmk_buffer_clear(x->ctx, x->dev, x->sys->rank_one,
                           6 * sizeof(float) * (size_t)x->sys->n_elements_pad));
}

static double *newton_cycle(const fixture *x, const double *rhs)
{
    dmk_system *s = x->sys;
    double *z = calloc(x->n, sizeof *z);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->cg[DMK_INNER].r, x->n, rhs));
    ok(x, dmk_v_cycle(x->ctx, s, DMK_NEWTON_MATRIX, s->cg[DMK_INNER].r, false));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_INNER, s->x_old, x->n, z));
    return z;
}

/* One step leaves more of the error than two, and not all of it. */
static void cycles_of_newton_contract(void **state)
{
    fixture *x = *state;
    double left[3];
    prepare(x);
    double *v = random_rows(x), *r = apply(x, v);
    for (int degree = 1; degree <= 2; degree++) {
        x->sys->newton_degree = degree;
        no_rank_one(x);
        double *z = newton_cycle(x, r);
        prepare(x);
        for (size_t i = 0; i < x->n; i++) z[i] = v[i] - z[i];
        double *e = apply(x, z);
        left[degree] = sqrt(dot(x->n, z, e) / dot(x->n, v, r));
        free(z);
        free(e);
    }
    if (!(left[2] < left[1] && left[1] < 0.4))
        fail_msg("one step leaves %.3f of the energy error, two %.3f", left[1], left[2]);
    free(v);
    free(r);
}

/* So many iterations of conjugate gradients as they are written down, with the device's cycle. */
static double *solved_plainly(const fixture *x, const double *rhs, int iterations)
{
    const size_t n = x->n;
    double *r = calloc(n, sizeof *r), *p = calloc(n, sizeof *p), *ap = calloc(n, sizeof *ap),
           *w = calloc(n, sizeof *w), before = 0, alpha = 0;
    memcpy(r, rhs, n * sizeof *r);
    for (int k = 0; k < iterations; k++) {
        double *z = newton_cycle(x, r);
        const double rz = dot(n, r, z), beta = k == 0 ? 0 : -alpha * dot(n, ap, z) / before;
        for (size_t i = 0; i < n; i++) p[i] = z[i] + beta * p[i];
        for (size_t i = 0; i < n; i++) ap[i] = dot(n, x->dense + i * n, p);
        alpha = rz / dot(n, p, ap);
        for (size_t i = 0; i < n; i++) w[i] += alpha * p[i];
        for (size_t i = 0; i < n; i++) r[i] -= alpha * ap[i];
        before = rz;
        free(z);
    }
    free(r);
    free(p);
    free(ap);
    return w;
}

/* The inner solve and what comes after it, whatever its vectors hold before. */
static void the_inner_solve_is_conjugate_gradients(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const size_t n = x->n;
    prepare(x);
    double *v = random_rows(x), *r = apply(x, v), *f = random_rows(x), *u = calloc(n, sizeof *u),
           *w = calloc(n, sizeof *w), *nan = calloc(n, sizeof *nan);
    for (size_t i = 0; i < n; i++) nan[i] = NAN;
    no_rank_one(x);
    for (int iterations = 1; iterations <= 3; iterations++) {
        dmk_stats stats = {0};
        double *wanted = solved_plainly(x, r, iterations), off = 0, fu;
        dmk_buffer *const vectors[] = {s->w, s->cg[DMK_INNER].p, s->cg[DMK_INNER].ap};
        for (int k = 0; k < 3; k++)
            ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, vectors[k], (size_t)s->n_rows,
                                        nan));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->state, 5, nan));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, n, v));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->f, n, f));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->cg[DMK_INNER].r, n, r));
        ok(x, dmk_smooth_first(x->ctx, s, s->cg[DMK_INNER].r, dmk_first_step()));
        ok(x, dmk_inner_solve(x->ctx, s, DMK_ROWS, iterations, &stats));
        ok(x, dmk_inner_finish(x->ctx, s, DMK_ROWS, iterations == 1, 0.5, 0));
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_INNER, s->w, n, w));
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->u, n, u));
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->scalars, 1, &fu));
        assert_int_equal(stats.v_cycles, iterations);
        assert_int_equal(stats.cg_iterations, iterations);
        for (size_t i = 0; i < n; i++) {
            off += (w[i] - wanted[i]) * (w[i] - wanted[i]);
            assert_true(fabs(u[i] - (0.5 * v[i] + w[i])) <= 1e-15);
        }
        assert_true(sqrt(off) <= 1e-5 * sqrt(dot(n, wanted, wanted)));
        assert_true(fabs(fu - dot(n, f, u)) <= 1e-12 * sqrt(dot(n, f, f) * dot(n, u, u)));
        free(wanted);
    }
    free(v);
    free(r);
    free(f);
    free(u);
    free(w);
    free(nan);
}

static void two_runs_give_the_same_bits(void **state)
{
    fixture *x = *state;
    prepare(x);
    double *v = random_rows(x), *a = v_cycle(x, v), *b = v_cycle(x, v);
    assert_memory_equal(a, b, x->n * sizeof *a);
    free(v);
    free(a);
    free(b);
}

/* ---- Newton's steps on T ---------------------------------------------------------------------- */

static const dmk_newton_step step = {.alpha = 0.9, .D = 3, .bend = 0.7, .relax = 1, .lowest = 2};

/* One element with u linear on T, by the formulas: its rows, K u, q of u, and the step that is its own. */
typedef struct linear {
    size_t row[3];
    double g[3]; /* alpha K u, without mu */
    double q, slope, step;
} linear;

static double slope_of(double q)
{
    return fmax(-1, fmin(1, 0.5 * log(q)));
}

static linear linear_of(const fixture *x, int32_t t, const double *u)
{
    const dmk_mesh *m = x->order.mesh;
    const double unit = x->sys->unit, area = m->area[t] / (unit * unit);
    linear l = {.q = 0};
    for (int k = 0; k < 3; k++) l.row[k] = (size_t)(x->sys->vertex_row + m->triangle[3 * t + k]);
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double flow = 0.5 * dmk_cot(m, 3 * t + k) * step.alpha * (u[l.row[i]] - u[l.row[j]]);
        l.g[i] += flow;
        l.g[j] -= flow;
        l.q += flow * step.alpha * (u[l.row[i]] - u[l.row[j]]) / area;
    }
    l.slope = slope_of(l.q);
    l.step = step.D / fmax(1, step.D * step.bend * fabs(l.slope));
    return l;
}

/* g.w / (area s) of it. */
static double along(const fixture *x, int32_t t, const linear *l, const double *w)
{
    const double unit = x->sys->unit, area = x->order.mesh->area[t] / (unit * unit);
    double sum = 0;
    for (int k = 0; k < 3; k++) sum += l->g[k] * w[l->row[k]];
    return sum / (area * fmax(l->q, 0.25));
}

/* Newton's matrix times w and its right-hand side without f, at the vertices' rows; the sum of u.Au. */
static double assemble_linear(const fixture *x, const double *u, const double *w, double *mw,
                              double *rhs)
{
    const dmk_mesh *m = x->order.mesh;
    double energy = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const linear l = linear_of(x, t, u);
        const double moved = l.step * along(x, t, &l, w);
        for (int k = 0; k < 3; k++) {
            const size_t i = l.row[(k + 1) % 3], j = l.row[(k + 2) % 3];
            const double flow = 0.5 * x->mu[t] * dmk_cot(m, 3 * t + k) * (w[i] - w[j]);
            mw[i] += flow;
            mw[j] -= flow;
            mw[l.row[k]] += x->mu[t] * moved * l.g[k];
            rhs[l.row[k]] -= x->mu[t] * (1 + l.step * l.slope) * l.g[k];
            energy += x->mu[t] * l.g[k] * u[l.row[k]] / step.alpha;
        }
    }
    return energy;
}

static void near_rows(const char *what, size_t n, const double *found, const double *expected)
{
    double size = 0, off = 0;
    for (size_t i = 0; i < n; i++) {
        size = fmax(size, fabs(expected[i]));
        off = fmax(off, fabs(found[i] - expected[i]));
    }
    if (!(size > 0 && off <= 1e-5 * size)) fail_msg("%s: off by %g of %g", what, off, size);
}

/* What a buffer has from its beginning on, in the place of the vertices' rows. */
static double *read_vertices(const fixture *x, dmk_program p, const dmk_buffer *b)
{
    double *v = calloc(x->n, sizeof *v);
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, p, b, (size_t)x->sys->n_vertices,
                               v + x->sys->vertex_row));
    return v;
}

static void write_vertices(const fixture *x, dmk_program p, dmk_buffer *b, const double *v)
{
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, p, b, (size_t)x->sys->n_vertices,
                                v + x->sys->vertex_row));
}

/* Matrix and right-hand side on T, its load from the midpoints, and the energy. */
static void steps_on_t_have_newtons_system(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_mesh *m = x->order.mesh;
    double *u = random_rows(x), *w = random_rows(x), *f = random_rows(x), slope = 0;
    double *mw = calloc(x->n, sizeof *mw), *rhs = calloc(x->n, sizeof *rhs);
    const double expected = assemble_linear(x, u, w, mw, rhs);
    for (int32_t v = 0; v < m->n_vertices; v++) rhs[s->vertex_row + v] += f[s->vertex_row + v];
    for (int32_t i = 0; i < 2 * m->n_edges; i++)
        rhs[s->vertex_row + m->edge_vertex[i]] += 0.5 * f[i / 2];
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, u));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->f, x->n, f));
    ok(x, dmk_nested_load(x->ctx, s));
    ok(x, dmk_nested_energy(x->ctx, s, step.alpha, 3));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->scalars, 6, f));
    assert_true(fabs(f[3] - expected) <= 1e-9 * expected);
    for (int32_t t = 0; t < m->n_triangles; t++)
        slope += x->mu[t] * m->area[t] / (s->unit * s->unit) * linear_of(x, t, u).slope;
    assert_true(fabs(f[5] - slope) <= 1e-6 * f[4]);
    ok(x, dmk_nested_prepare(x->ctx, s, &step));
    ok(x, dmk_multigrid_refresh(x->ctx, s, DMK_NEWTON_MATRIX));
    ok(x, dmk_nested_rhs(x->ctx, s));
    double *found = read_vertices(x, DMK_INNER, s->level[0].rhs);
    near_rows("right-hand side", x->n, found, rhs);
    free(found);
    write_vertices(x, DMK_INNER, s->level[0].x_old, w);
    ok(x, dmk_inner_apply(x->ctx, s, DMK_VERTICES, true));
    found = read_vertices(x, DMK_INNER, s->level[0].x);
    near_rows("matrix", x->n, found, mw);
    free(found);
    free(u);
    free(w);
    free(f);
    free(mw);
    free(rhs);
}

/* mu and u after a step, its sums, and u at the midpoints. */
static void steps_on_t_move_mu_and_u(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_mesh *m = x->order.mesh;
    const double unit = s->unit,
                 one[5] = {0, 0, 1, 0, 0}; /* alpha of the inner solve's last step */
    const size_t e = (size_t)s->n_elements_pad;
    double *u = random_rows(x), *w = random_rows(x), *f = random_rows(x), sums[7], want[7] = {0};
    double *next = calloc(e, sizeof *next), *mu = calloc(e, sizeof *mu);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, u));
    write_vertices(x, DMK_OUTER, s->load, f);
    write_vertices(x, DMK_INNER, s->level[0].x_old, w);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->state, 5, one));
    ok(x, dmk_nested_energy(x->ctx, s, 1, 0));
    ok(x, dmk_inner_finish(x->ctx, s, DMK_VERTICES, true, step.alpha, 6));
    ok(x, dmk_nested_update(x->ctx, s, &step, 0));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->scalars, 7, sums));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->mu, e, mu));
    ok(x, dmk_nested_refine(x->ctx, s));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const linear l = linear_of(x, t, u);
        const double area = m->area[t] / (unit * unit);
        const double dy = l.step * (l.slope + along(x, t, &l, w));
        next[t] = fmax(x->mu[t] * exp(fmax(-1, fmin(1, dy))), step.lowest * sqrt(area));
        want[4] += area * fabs(next[t] - x->mu[t]);
    }
    for (int32_t i = s->vertex_row; i < s->n_rows; i++) {
        u[i] = step.alpha * u[i] + w[i];
        want[6] += u[i] * f[i];
    }
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const double q = linear_of(x, t, u).q / (step.alpha * step.alpha), slope = slope_of(q);
        const double mass = m->area[t] / (unit * unit) * next[t];
        want[0] += mass * q;
        want[1] += mass;
        want[2] += mass * slope;
        want[3] += mass * slope * slope;
        want[5] = fmax(want[5], q);
    }
    for (int32_t i = 0; i < m->n_edges; i++)
        u[i] = 0.5 * (u[s->vertex_row + m->edge_vertex[2 * i]] +
                      u[s->vertex_row + m->edge_vertex[2 * i + 1]]);
    near_rows("mu", e, mu, next);
    for (int k = 0; k < 6; k++) assert_true(fabs(sums[k] - want[k]) <= 1e-5 * fabs(want[k]));
    assert_true(fabs(sums[6] - want[6]) <= 1e-5 * sqrt(dot(x->n, u, u) * dot(x->n, f, f)));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, w));
    near_rows("u", x->n, w, u);
    free(u);
    free(w);
    free(f);
    free(next);
    free(mu);
}

/* mu after one step by w from the fixture's mu and this u. */
static void update_mu(const fixture *x, const double *u, const dmk_newton_step *by, double *mu)
{
    dmk_system *s = x->sys;
    const size_t e = (size_t)s->n_elements_pad;
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->mu, e, x->mu));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, u));
    ok(x, dmk_element_energy(x->ctx, s, s->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0));
    ok(x, dmk_newton_prepare(x->ctx, s, false, by));
    ok(x, dmk_newton_update(x->ctx, s, by, 0));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->mu, e, mu));
}

/* It moves log mu by as much more, and no further than by 1. */
static void a_step_may_be_over_relaxed(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const size_t e = (size_t)s->n_elements_pad;
    const dmk_newton_step plain = {.alpha = 1, .D = 0.2, .relax = 1},
                          further = {.alpha = 1, .D = 0.2, .relax = 3};
    double *u = random_rows(x), *w = random_rows(x), *once = calloc(e, sizeof *once),
           *thrice = calloc(e, sizeof *thrice);
    size_t held = 0;
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->w, x->n, w));
    update_mu(x, u, &plain, once);
    update_mu(x, u, &further, thrice);
    for (size_t t = 0; t < e; t++) {
        if (!(x->mu[t] > 0)) continue;
        const double dy = 3 * log(once[t] / x->mu[t]);
        held += fabs(dy) > 1;
        once[t] = x->mu[t] * exp(fmax(-1, fmin(1, dy)));
    }
    assert_true(held > 0 && held < (size_t)s->n_elements / 2);
    near_rows("mu", e, thrice, once);
    free(u);
    free(w);
    free(once);
    free(thrice);
}

/* The change of mu that a step reports: of an over-relaxed one as of another, for a short way nearly the same. */
static double reported_change(const fixture *x, const double *u, double relax)
{
    dmk_system *s = x->sys;
    const dmk_newton_step by = {.alpha = 1, .D = 1e-3, .relax = relax};
    const double one[5] = {0, 0, 1, 0, 0}; /* alpha of the inner solve's last step */
    dmk_iteration o = {.ctx = x->ctx, .sys = s};
    double change;
    ok(x,
       dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->mu, (size_t)s->n_elements_pad, x->mu));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, u));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->state, 5, one));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->x, x->n, u));
    ok(x, dmk_element_energy(x->ctx, s, s->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0));
    ok(x, dmk_newton_prepare(x->ctx, s, false, &by));
    ok(x, dmk_iteration_update(&o, DMK_ROWS, true, &by, &change));
    return change;
}

static void the_change_is_that_of_a_plain_step(void **state)
{
    fixture *x = *state;
    double *u = random_rows(x);
    const double plain = reported_change(x, u, 1), relaxed = reported_change(x, u, 3);
    assert_true(plain > 0 && fabs(relaxed - plain) <= 0.02 * plain);
    free(u);
}

static double read_scalar(const fixture *x, size_t at)
{
    double sums[8];
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, x->sys->scalars, 8, sums));
    return sums[at];
}

/* A value that is no number, of u, of a step or of q, shows in the energy, or in the change of mu. */
static void nan_is_not_hidden(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    const size_t e = (size_t)s->n_elements_pad;
    double *u = random_rows(x), *v = random_rows(x), *q = calloc(e, sizeof *q);
    const int32_t row = s->vertex_row + 5;
    for (int k = 0; k < 2; k++) { /* the second time */
        if (k == 1) u[row] = NAN;
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, u));
        ok(x, dmk_element_energy(x->ctx, s, s->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0));
        assert_true(isnan(read_scalar(x, 0)) == (k == 1));
    }
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, v));
    ok(x, dmk_element_energy(x->ctx, s, s->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0));
    ok(x, dmk_newton_prepare(x->ctx, s, false, &step));
    for (int k = 0; k < 2; k++) {
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->w, x->n, k == 0 ? v : u));
        ok(x, dmk_newton_update(x->ctx, s, &step, 0));
        assert_true(isnan(read_scalar(x, 4)) == (k == 1));
    }
    ok(x,
       dmk_buffer_create(x->ctx, x->dev, e * dmk_device_real(x->dev, DMK_OUTER), NULL, &s->before));
    for (size_t t = 0; t < e; t++) q[t] = 1;
    for (int k = 0; k < 4; k++) { /* with inertia; the second time of each */
        q[17] = k % 2 == 1 ? NAN : 1;
        ok(x, dmk_elements_fill(x->ctx, s, s->mu, 2));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->q, e, q));
        ok(x, dmk_explicit_update(x->ctx, s, k > 1, 0.5, 0.5, 1e-4, 0));
        assert_true(isnan(read_scalar(x, 0)) == (k % 2 == 1));
    }
    free(u);
    free(v);
    free(q);
}

/* Conjugate gradients on T: fourteen iterations solve A w = A v. */
static void steps_on_t_are_solved(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    dmk_stats stats = {.steps = 0};
    const dmk_newton_step even = {.alpha = 1};
    double *v = random_rows(x), *none = calloc(x->n, sizeof *none), mean = 0;
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->u, x->n, none));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->f, x->n, none));
    ok(x, dmk_nested_load(x->ctx, s));
    ok(x, dmk_nested_energy(x->ctx, s, 1, 0));
    ok(x, dmk_nested_prepare(x->ctx, s, &even));
    ok(x, dmk_multigrid_refresh(x->ctx, s, DMK_NEWTON_MATRIX));
    write_vertices(x, DMK_INNER, s->level[0].x_old, v);
    ok(x, dmk_inner_apply(x->ctx, s, DMK_VERTICES, true));
    double *load = read_vertices(x, DMK_INNER, s->level[0].x);
    write_vertices(x, DMK_OUTER, s->load, load);
    ok(x, dmk_nested_prepare(x->ctx, s, &even));
    ok(x, dmk_nested_rhs(x->ctx, s));
    ok(x, dmk_inner_solve(x->ctx, s, DMK_VERTICES, 14, &stats));
    ok(x, dmk_inner_finish(x->ctx, s, DMK_VERTICES, false, 0, 0));
    assert_int_equal(stats.cg_iterations, 14);
    double *found = read_vertices(x, DMK_INNER, s->w);
    for (int32_t i = s->vertex_row; i < s->n_rows; i++) mean += (v[i] - found[i]) / s->n_vertices;
    for (int32_t i = 0; i < s->n_rows; i++) {
        if (i < s->vertex_row) v[i] = 0;
        if (i >= s->vertex_row) found[i] += mean;
    }
    near_rows("solution", x->n, found, v);
    free(v);
    free(none);
    free(load);
    free(found);
}

/* x += 1 over `range` by a kernel; one: as many ones. */
static void add_one(const fixture *x, dmk_range range, dmk_buffer *sum, dmk_buffer *one)
{
    dmk_kernel *add; /* x = one + beta x */
    const double scalars[5] = {0, 0, 0, 1, 0};
    ok(x, dmk_kernel_get(x->ctx, x->dev, DMK_OUTER, "cg_direction", &add));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, x->sys->state, 5, scalars));
    ok(x, DMK_LAUNCH(x->ctx, x->dev, add, range, DMK_INT(range.items), DMK_BUF(x->sys->state),
                     DMK_BUF(one), DMK_BUF(sum)));
}

/* In launch after launch, more of them than a launch's tag has values (base.cl), also with an end
 * that is not a whole part: after each every number has grown by 1, by no more and no less. */
static void every_part_is_done_once(void **state)
{
    fixture *x = *state;
    enum { N = 60003, LAUNCHES = 2100, LOOK = 70 };
    dmk_buffer *sum = NULL, *one = NULL;
    double *v = calloc(N, sizeof *v);
    for (int i = 0; i < N; i++) v[i] = 1;
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof(double), NULL, &sum));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof(float), NULL, &one));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, one, N, v));
    for (int k = 1; k <= LAUNCHES; k++) {
        add_one(x, (dmk_range){.items = N, .first = N / 3}, sum, one);
        if (k % LOOK) continue;
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, sum, N, v));
        for (int i = 0; i < N; i++) assert_true(v[i] == k);
    }
    dmk_buffer_destroy(&sum);
    dmk_buffer_destroy(&one);
    free(v);
}

/* x += 1 over the listed parts alone, the last one, which is not a whole part, among them. */
static void listed_parts_alone_are_done(void **state)
{
    fixture *x = *state;
    enum { N = 60003 };
    const int part = (int)dmk_launch_part(x->dev), parts = (int)dmk_launch_parts(x->dev, N);
    dmk_buffer *sum = NULL, *one = NULL, *list = NULL;
    int n = 0;
    double *v = calloc(N, sizeof *v);
    int32_t *number = calloc((size_t)parts, sizeof *number);
    for (int i = 0; i < N; i++) v[i] = 1;
    for (int p = parts - 1; p >= 0; p -= 3) number[n++] = p;
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof(double), NULL, &sum));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof(float), NULL, &one));
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, one, N, v));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (size_t)n * sizeof *number, number, &list));
    add_one(x, (dmk_range){.items = N, .parts = list, .n_parts = (size_t)n}, sum, one);
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, sum, N, v));
    for (int i = 0; i < N; i++) assert_true(v[i] == ((parts - 1 - i / part) % 3 == 0));
    dmk_buffer_destroy(&sum);
    dmk_buffer_destroy(&one);
    dmk_buffer_destroy(&list);
    free(number);
    free(v);
}

/* From the first graph level to T: x = P c and a step of the smoother, at once or one after the other. */
static void prolongs_and_smooths(void **state)
{
    const fixture *x = *state;
    dmk_system *s = x->sys;
    const dmk_level *t = &s->level[0], *l = &s->level[1];
    const size_t n = (size_t)t->n, words = sizeof(int32_t), slices = (size_t)t->n_pad / 8;
    assert_true(s->n_levels > 1);
    prepare(x);
    int32_t *slice = read_words(x, t->slice, slices + 1);
    int32_t *neighbour = read_words(x, t->neighbour, 8 * (size_t)slice[slices]);
    int32_t *index = read_words(x, l->prolong_index, 3 * (size_t)t->n_pad);
    float *weight = read_words(x, t->weight, 8 * (size_t)slice[slices]),
          *part = read_words(x, l->prolong_weight, 3 * (size_t)t->n_pad),
          *inverse = read_words(x, t->inv_diag, n), *c = calloc((size_t)l->n_pad, words),
          *rhs = calloc((size_t)t->n_pad, words), *p = calloc(n, words);
    for (int32_t i = 0; i < l->n; i++) c[i] = (float)(random_unit() - 0.5);
    for (int32_t i = 0; i < t->n; i++) rhs[i] = (float)(random_unit() - 0.5);
    ok(x, dmk_buffer_write(x->ctx, x->dev, l->x_old, 0, (size_t)l->n_pad * words, c));
    ok(x, dmk_buffer_write(x->ctx, x->dev, t->rhs, 0, (size_t)t->n_pad * words, rhs));
    ok(x, dmk_prolong_chebyshev(x->ctx, s, 1, t->x, t->x_old, 0.75));
    float *found = read_words(x, t->x, n), *next = read_words(x, t->x_old, n);
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < 3; k++)
            p[i] += part[i / 8 * 24 + 8 * k + i % 8] * c[index[i / 8 * 24 + 8 * k + i % 8]];
        assert_true(fabsf(found[i] - p[i]) <= 1e-6f);
    }
    for (size_t i = 0; i < n; i++) {
        double a = 0, size = fabs(rhs[i]);
        for (int32_t j = slice[i / 8]; j < slice[i / 8 + 1]; j++) {
            const size_t at = 8 * (size_t)j + i % 8;
            a += (double)weight[at] * (p[i] - p[neighbour[at]]);
            size += fabs(weight[at]);
        }
        const double gain = 0.75 * inverse[i];
        assert_true(fabs(next[i] - (p[i] + gain * (rhs[i] - a))) <= 1e-6 * (1 + gain * size));
    }
    void *all[] = {slice, neighbour, index, weight, part, inverse, c, rhs, p, found, next};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

int main(void)
{
#define BOTH(test)                                                                                 \
    {#test, test, setup, teardown, NULL},                                                          \
    {                                                                                              \
#test " (gpu shape)", test, setup_gpu, teardown, NULL                                      \
    }
#define NEEDLES(test)                                                                              \
    {#test, test, setup_needles, teardown, NULL},                                                  \
    {                                                                                              \
#test " (gpu shape)", test, setup_needles_gpu, teardown, NULL                              \
    }
    const struct CMUnitTest tests[] = {
        BOTH(operator_equals_dense),
        cmocka_unit_test_setup_teardown(operator_of_far_rows_equals_its_edges, setup_far, teardown),
        BOTH(operator_is_symmetric_with_constants_in_its_null_space),
        BOTH(v_cycle_is_nearly_symmetric_and_contracts),
        BOTH(cycles_of_newton_contract),
        NEEDLES(the_fine_graph_is_newtons_matrix),
        NEEDLES(the_cycle_without_t_contracts_on_needles),
        BOTH(prolongs_and_smooths),
        BOTH(the_inner_solve_is_conjugate_gradients),
        BOTH(steps_on_t_have_newtons_system),
        BOTH(steps_on_t_move_mu_and_u),
        BOTH(a_step_may_be_over_relaxed),
        BOTH(the_change_is_that_of_a_plain_step),
        BOTH(nan_is_not_hidden),
        BOTH(steps_on_t_are_solved),
        BOTH(two_runs_give_the_same_bits),
        BOTH(every_part_is_done_once),
        BOTH(listed_parts_alone_are_done),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
