/* The macro-element operators and the V-cycle against a dense assembly. */
#include "solver/kernels.h"
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

/* The 15 entries per element straight from the four sub-triangles' P1 stiffness matrices. */
static void assemble(fixture *x)
{
    const dmk_mesh *m = x->order.mesh;
    x->dense = calloc(x->n * x->n, sizeof *x->dense);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        size_t row[6];
        for (int k = 0; k < 3; k++) {
            row[k] = (size_t)(x->sys->vertex_row + m->triangle[3 * t + k]);
            row[3 + k] = (size_t)m->triangle_edge[3 * t + k];
        }
        /* Corners of each sub-triangle in the order that is similar to the parent. */
        static const int sub[4][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}, {3, 4, 5}};
        for (int s = 0; s < 4; s++) {
            for (int k = 0; k < 3; k++) {
                double w = 0.5 * x->mu[t] * dmk_cot(m, 3 * t + k);
                size_t i = row[sub[s][(k + 1) % 3]], j = row[sub[s][(k + 2) % 3]];
                x->dense[i * x->n + i] += w;
                x->dense[j * x->n + j] += w;
                x->dense[i * x->n + j] -= w;
                x->dense[j * x->n + i] -= w;
            }
        }
    }
}

static int setup_shape(void **state, dmk_shape shape)
{
    fixture *x = calloc(1, sizeof *x);
    dmk_device_options o;
    *state = x;
    dmk_context_create(&x->ctx);
    dmk_device_options_init(&o, sizeof o);
    o.shape = shape;
    ok(x, dmk_device_open(x->ctx, &o, &x->dev));
    ok(x, dmk_mesh_read(x->ctx, "tests/data/sphere_1280.off", &x->input));
    ok(x, dmk_order_create(x->ctx, x->input, 0, &x->order));
    ok(x, dmk_system_create(x->ctx, x->dev, x->order.mesh, &x->sys));
    ok(x, dmk_system_allocate(x->ctx, x->sys));
    x->n = (size_t)x->sys->n_rows_pad;
    x->mu = calloc((size_t)x->sys->n_elements_pad, sizeof *x->mu);
    random_state = 7;
    for (int32_t t = 0; t < x->sys->n_elements; t++) x->mu[t] = pow(10, 3 * random_unit() - 2);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, x->sys->mu,
                                (size_t)x->sys->n_elements_pad, x->mu));
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
    ok(x, dmk_multigrid_refresh(x->ctx, s));
}

/* y = A v by the device, in the outer precision. */
static double *apply(const fixture *x, const double *v)
{
    dmk_system *s = x->sys;
    double *y = calloc(x->n, sizeof *y);
    ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->cg[DMK_OUTER].p, x->n, v));
    ok(x, dmk_element_stiffness(x->ctx, s, DMK_OUTER, s->cg[DMK_OUTER].p));
    ok(x, dmk_rows_apply(x->ctx, s, DMK_OUTER, s->cg[DMK_OUTER].p, s->cg[DMK_OUTER].ap));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->cg[DMK_OUTER].ap, x->n, y));
    return y;
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
    ok(x, dmk_v_cycle(x->ctx, s, DMK_STIFFNESS, s->cg[DMK_INNER].r, (dmk_cycle){0}));
    ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_INNER, s->x_old, x->n, z));
    return z;
}

static void v_cycle_is_symmetric_and_contracts(void **state)
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

/* With either number of smoothing steps Newton's cycle finds what conjugate gradients go on with; here its matrix is
 * A. One step leaves more of the error than two, and not all of it. */
static void cycles_of_newton_find_the_sums(void **state)
{
    fixture *x = *state;
    dmk_system *s = x->sys;
    double left[3];
    prepare(x);
    double *v = random_rows(x), *r = apply(x, v), *ap = random_rows(x),
           *z = calloc(x->n, sizeof *z);
    for (int degree = 1; degree <= 2; degree++) {
        s->newton_degree = degree;
        ok(x, dmk_buffer_clear(x->ctx, x->dev, s->rank_one,
                               6 * sizeof(float) * (size_t)s->n_elements_pad));
        double sums[5] = {3, 0, 0.7, 0, 0}; /* r.z before, and alpha */
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->cg[DMK_INNER].r, x->n, r));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_INNER, s->cg[DMK_INNER].ap, x->n, ap));
        ok(x, dmk_buffer_write_real(x->ctx, x->dev, DMK_OUTER, s->state, 5, sums));
        ok(x, dmk_v_cycle(x->ctx, s, DMK_NEWTON_MATRIX, s->cg[DMK_INNER].r,
                          (dmk_cycle){.dots = true}));
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_INNER, s->x_old, x->n, z));
        ok(x, dmk_buffer_read_real(x->ctx, x->dev, DMK_OUTER, s->state, 5, sums));
        const double rz = dot(x->n, r, z), beta = -0.7 * dot(x->n, ap, z) / 3;
        assert_true(fabs(sums[0] - rz) <= 1e-5 * fabs(rz));
        assert_true(fabs(sums[3] - beta) <= 1e-5 * sqrt(dot(x->n, ap, ap) * dot(x->n, z, z)));
        prepare(x); /* A's weights lie where rank_one was */
        for (size_t i = 0; i < x->n; i++) z[i] = v[i] - z[i];
        double *e = apply(x, z);
        left[degree] = sqrt(dot(x->n, z, e) / dot(x->n, v, r));
        free(e);
    }
    if (!(left[2] < left[1] && left[1] < 0.4))
        fail_msg("one step leaves %.3f of the energy error, two %.3f", left[1], left[2]);
    free(v);
    free(r);
    free(ap);
    free(z);
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

/* x += 1 in launch after launch, more of them than a launch's tag has values (base.cl), also with an end
 * that is not a whole part: after each every number has grown by 1, by no more and no less. */
static void every_part_is_done_once(void **state)
{
    fixture *x = *state;
    enum { N = 60003, LAUNCHES = 2100, LOOK = 70 };
    dmk_buffer *sum = NULL, *one = NULL, *partial = NULL;
    float *v = calloc(N, sizeof *v);
    for (int i = 0; i < N; i++) v[i] = 1;
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof *v, NULL, &sum));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof *v, NULL, &one));
    ok(x, dmk_buffer_write(x->ctx, x->dev, one, 0, N * sizeof *v, v));
    ok(x, dmk_buffer_create(x->ctx, x->dev, N * sizeof(double), NULL, &partial));
    dmk_kernel *add;
    ok(x, dmk_kernel_get(x->ctx, x->dev, DMK_INNER, "scale_add", &add));
    for (int k = 1; k <= LAUNCHES; k++) {
        ok(x, DMK_LAUNCH(x->ctx, x->dev, add, ((dmk_range){.items = N, .first = N / 3}), DMK_INT(N),
                         DMK_FLOAT(1), DMK_BUF(sum), DMK_BUF(one), DMK_BUF(one), DMK_BUF(partial),
                         DMK_INT(-1), DMK_BUF(partial), DMK_BUF(x->sys->done)));
        if (k % LOOK) continue;
        ok(x, dmk_buffer_read(x->ctx, x->dev, sum, 0, N * sizeof *v, v));
        for (int i = 0; i < N; i++) assert_true(v[i] == (float)k);
    }
    dmk_buffer_destroy(&sum);
    dmk_buffer_destroy(&one);
    dmk_buffer_destroy(&partial);
    free(v);
}

/* x += 1 over the listed parts alone, the last one, which is not a whole part, among them. */
static void listed_parts_alone_are_done(void **state)
{
    fixture *x = *state;
    enum { N = 60003 };
    const int part = (int)dmk_launch_part(x->dev), parts = (int)dmk_launch_parts(x->dev, N);
    dmk_buffer *sum = NULL, *one = NULL, *partial = NULL, *list = NULL;
    dmk_kernel *add;
    int n = 0;
    float *v = calloc(N, sizeof *v);
    int32_t *number = calloc((size_t)parts, sizeof *number);
    for (int i = 0; i < N; i++) v[i] = 1;
    for (int p = parts - 1; p >= 0; p -= 3) number[n++] = p;
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof *v, NULL, &sum));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (N + 8) * sizeof *v, NULL, &one));
    ok(x, dmk_buffer_write(x->ctx, x->dev, one, 0, N * sizeof *v, v));
    ok(x, dmk_buffer_create(x->ctx, x->dev, N * sizeof(double), NULL, &partial));
    ok(x, dmk_buffer_create(x->ctx, x->dev, (size_t)n * sizeof *number, number, &list));
    ok(x, dmk_kernel_get(x->ctx, x->dev, DMK_INNER, "scale_add", &add));
    const dmk_range range = {.items = N, .parts = list, .n_parts = (size_t)n};
    ok(x, DMK_LAUNCH(x->ctx, x->dev, add, range, DMK_INT(N), DMK_FLOAT(1), DMK_BUF(sum),
                     DMK_BUF(one), DMK_BUF(one), DMK_BUF(partial), DMK_INT(-1), DMK_BUF(partial),
                     DMK_BUF(x->sys->done)));
    ok(x, dmk_buffer_read(x->ctx, x->dev, sum, 0, N * sizeof *v, v));
    for (int i = 0; i < N; i++) assert_true(v[i] == (float)((parts - 1 - i / part) % 3 == 0));
    dmk_buffer_destroy(&sum);
    dmk_buffer_destroy(&one);
    dmk_buffer_destroy(&partial);
    dmk_buffer_destroy(&list);
    free(number);
    free(v);
}

int main(void)
{
#define BOTH(test)                                                                                 \
    {#test, test, setup, teardown, NULL},                                                          \
    {                                                                                              \
#test " (gpu shape)", test, setup_gpu, teardown, NULL                                      \
    }
    const struct CMUnitTest tests[] = {
        BOTH(operator_equals_dense),
        BOTH(operator_is_symmetric_with_constants_in_its_null_space),
        BOTH(v_cycle_is_symmetric_and_contracts),
        BOTH(cycles_of_newton_find_the_sums),
        BOTH(two_runs_give_the_same_bits),
        BOTH(every_part_is_done_once),
        BOTH(listed_parts_alone_are_done),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
