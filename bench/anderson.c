/* Anderson acceleration of the explicit iteration: density error after each step.
 *
 * usage: bench-anderson MESH.off [DEPTH [STEPS [ERROR]]]   (default: 5 100 0.002; source: vertex 0)
 * In y = log mu the inertial method without its inertia iterates the map
 *     G(y) = y + 1/2 log q(u(y)),   q the mean of |grad u|^2,   A(mu) u = f solved to 1e-4.
 * With r = G(y) - y, and the last DEPTH differences dy_j, dr_j of y and r, type II takes those c_j
 * that minimise sum area mu (r - sum c_j dr_j)^2 and steps by r - sum c_j (dy_j + dr_j).
 * The start is the library's, from a distance; the reference is its default method with tolerance
 * 1e-5 from that start. Ends after STEPS steps, or where the error is at most ERROR.
 * Prints a line per step: step, V-cycles, seconds, L1 error of mu relative to the reference's mass,
 * upper bound of the cost relative to the reference's less 1, gap. As in the tool's report
 * V-cycles include one certificate's, seconds do not. Vector arithmetic is on one thread. */
#include "solver/iteration.h"
#include "solver/setup.h"
#include "mesh/mollify.h"
#include "geodesic/geodesic.h"
#include "solver/start.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_DEPTH = 20 };

typedef struct bench {
    dmk_context *ctx;
    dmk_device *device;
    dmk_mesh *mesh;
    dmk_order order;
    dmk_mesh mollified; /* the ordered mesh with the metric that is computed with */
    dmk_system *sys;
    dmk_point source; /* on the ordered mesh */
    dmk_solve_options options;
    dmk_stats stats;
    dmk_iteration outer;

    size_t n; /* triangles: length of the arrays; units of the packed problem (area 1) */
    double *area, *mu, *y, *q, *r, *r_before;
    double *dy, *dr; /* DEPTH * n: differences, those of a step with number i in row i % DEPTH */
    double *best;    /* mu of the reference */
    double best_cost;
} bench;

/* ---- set-up --------------------------------------------------------------------------------- */

static int prepare(bench *b, const char *path, int depth)
{
    int rc;
    dmk_point p;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    DMK_TRY(dmk_device_open(b->ctx, &o, &b->device));
    DMK_TRY(dmk_mesh_read(b->ctx, path, &b->mesh));
    DMK_TRY(dmk_mesh_vertex_point(b->ctx, b->mesh, 0, &p));
    DMK_TRY(dmk_order_create(b->ctx, b->mesh, dmk_mesh_component(b->mesh, (int32_t)p.triangle),
                             &b->order));
    DMK_TRY(dmk_mollify(b->ctx, b->order.mesh, &b->mollified));
    DMK_TRY(dmk_system_create(b->ctx, b->device, &b->mollified, &b->sys));
    DMK_TRY(dmk_system_allocate(b->ctx, b->sys));
    b->source = p;
    b->source.triangle = 0;
    while (b->order.triangle_old[b->source.triangle] != p.triangle) b->source.triangle++;

    b->n = (size_t)b->sys->n_elements;
    double **one[] = {&b->area, &b->mu, &b->y, &b->r, &b->q, &b->r_before, &b->best};
    for (size_t i = 0; i < sizeof one / sizeof *one; i++) DMK_TRY(DMK_NEW(b->ctx, *one[i], b->n));
    DMK_TRY(DMK_NEW(b->ctx, b->dy, (size_t)depth * b->n));
    DMK_TRY(DMK_NEW(b->ctx, b->dr, (size_t)depth * b->n));
    DMK_TRY(dmk_buffer_read_real(b->ctx, b->device, DMK_OUTER, b->sys->area, b->n, b->area));
done:
    return rc;
}

/* u, f and mu from the distance to the source, on the device, and new statistics. */
static int start(bench *b)
{
    int rc;
    dmk_system *s = b->sys;
    const dmk_mesh *m = &b->mollified;
    size_t n_rows = (size_t)dmk_system_counts(b->device, m).n_rows_pad;
    double *u = NULL, *f = NULL;
    dmk_geodesics *g = NULL;
    DMK_TRY(DMK_NEW(b->ctx, u, n_rows));
    DMK_TRY(DMK_NEW(b->ctx, f, n_rows));
    /* Midpoints are the first rows. */
    DMK_TRY(dmk_geodesics_create(b->ctx, m, 1, &b->source, NULL, &g));
    dmk_geodesics_midpoints(b->ctx, g, u);
    DMK_TRY(dmk_start_density(b->ctx, m, g, u, b->mu, NULL));
    for (int32_t e = 0; e < m->n_edges; e++) u[e] /= -s->unit;
    for (int32_t v = 0; v < m->n_vertices; v++) u[s->vertex_row + v] = g->distance[v] / -s->unit;
    for (size_t t = 0; t < b->n; t++) b->mu[t] /= s->unit;
    dmk_right_hand_side(m, s, &b->source, f);
    DMK_TRY(dmk_buffer_write_real(b->ctx, b->device, DMK_OUTER, s->u, n_rows, u));
    DMK_TRY(dmk_buffer_write_real(b->ctx, b->device, DMK_OUTER, s->f, n_rows, f));
    DMK_TRY(dmk_buffer_write_real(b->ctx, b->device, DMK_OUTER, s->mu, b->n, b->mu));
    memset(&b->stats, 0, sizeof b->stats);
    b->outer = (dmk_iteration){.ctx = b->ctx,
                               .sys = s,
                               .mesh = m,
                               .triangle_old = b->order.triangle_old,
                               .floor = DMK_FLOOR,
                               .mean_floor = DMK_FLOOR,
                               .options = &b->options,
                               .stats = &b->stats,
                               .began = dmk_seconds()};
done:
    dmk_geodesics_destroy(&g);
    free(u);
    free(f);
    return rc;
}

static int solve_reference(bench *b)
{
    int rc;
    dmk_solve_options_init(&b->options, sizeof b->options);
    b->options.tolerance = 1e-5;
    b->options.max_steps = 200;
    DMK_TRY(start(b));
    DMK_TRY(dmk_newton(&b->outer, true, 0, DMK_NEWTON_STEPS));
    DMK_TRY(dmk_certify(&b->outer, true));
    DMK_TRY(dmk_buffer_read_real(b->ctx, b->device, DMK_OUTER, b->sys->mu, b->n, b->best));
    b->best_cost = b->stats.cost_upper;
done:
    return rc;
}

/* ---- the iteration -------------------------------------------------------------------------- */

static double lowest(const bench *b, size_t t)
{
    return log(DMK_FLOOR * sqrt(b->area[t]));
}

/* r = G(y) - y, with G kept above the floor as y is. */
static int residual(bench *b)
{
    int rc;
    DMK_TRY(dmk_iteration_solve(&b->outer, 1e-4, 500));
    DMK_TRY(dmk_iteration_energies(&b->outer));
    DMK_TRY(dmk_buffer_read_real(b->ctx, b->device, DMK_OUTER, b->sys->q, b->n, b->q));
    for (size_t t = 0; t < b->n; t++) {
        double slope = fmin(fmax(0.5 * log(fmax(b->q[t], 1e-30)), -1), 1);
        b->r_before[t] = b->r[t];
        b->r[t] = fmax(slope, lowest(b, t) - b->y[t]);
    }
done:
    return rc;
}

/* sum area mu v w */
static double product(const bench *b, const double *v, const double *w)
{
    double sum = 0;
    for (size_t t = 0; t < b->n; t++) sum += b->area[t] * b->mu[t] * v[t] * w[t];
    return sum;
}

/* Solve H c = h by Cholesky's factors, in place; H (k x k) is positive definite. */
static void solve_dense(int k, double H[][MAX_DEPTH], double *h)
{
    for (int i = 0; i < k; i++) {
        for (int j = 0; j <= i; j++) {
            for (int l = 0; l < j; l++) H[i][j] -= H[i][l] * H[j][l];
            H[i][j] = j < i ? H[i][j] / H[j][j] : sqrt(H[i][i]);
        }
        for (int l = 0; l < i; l++) h[i] -= H[i][l] * h[l];
        h[i] /= H[i][i];
    }
    for (int i = k; i-- > 0;) {
        for (int l = i + 1; l < k; l++) h[i] -= H[l][i] * h[l];
        h[i] /= H[i][i];
    }
}

/* The c_j by the normal equations, with a little added so that they can be solved. */
static void weights(const bench *b, int k, double *c)
{
    double H[MAX_DEPTH][MAX_DEPTH], trace = 0;
    for (int i = 0; i < k; i++) {
        for (int j = 0; j <= i; j++) H[i][j] = product(b, b->dr + i * b->n, b->dr + j * b->n);
        trace += H[i][i];
        c[i] = product(b, b->dr + i * b->n, b->r);
    }
    for (int i = 0; i < k; i++) H[i][i] += 1e-10 * trace + 1e-300;
    solve_dense(k, H, c);
}

/* One step of y and mu: no y changes by more than 1. */
static int step(bench *b, int number, int depth)
{
    double c[MAX_DEPTH];
    double *dy = b->dy + (size_t)(number % depth) * b->n; /* replaces the oldest */
    int k = number < depth ? number : depth;
    if (number > 0) { /* what the step before has done to r is known only now */
        double *dr = b->dr + (size_t)((number - 1) % depth) * b->n;
        for (size_t t = 0; t < b->n; t++) dr[t] = b->r[t] - b->r_before[t];
    }
    weights(b, k, c);
    for (size_t t = 0; t < b->n; t++) {
        double d = b->r[t];
        for (int j = 0; j < k; j++) d -= c[j] * (b->dy[j * b->n + t] + b->dr[j * b->n + t]);
        double next = fmax(b->y[t] + fmin(fmax(d, -1), 1), lowest(b, t));
        dy[t] = next - b->y[t];
        b->y[t] = next;
        b->mu[t] = exp(next);
    }
    b->outer.ready = DMK_NOTHING;
    return dmk_buffer_write_real(b->ctx, b->device, DMK_OUTER, b->sys->mu, b->n, b->mu);
}

static double error_of(const bench *b)
{
    double sum = 0, mass = 0;
    for (size_t t = 0; t < b->n; t++) {
        sum += b->area[t] * fabs(b->mu[t] - b->best[t]);
        mass += b->area[t] * b->best[t];
    }
    return sum / mass;
}

static int iterate(bench *b, int depth, int steps, double error)
{
    int rc;
    double seconds = 0;
    DMK_TRY(start(b));
    for (size_t t = 0; t < b->n; t++) b->y[t] = log(b->mu[t]);
    for (int number = 0; number < steps; number++) {
        double began = dmk_seconds();
        DMK_TRY(residual(b));
        DMK_TRY(step(b, number, depth));
        seconds += dmk_seconds() - began;
        double now = error_of(b);
        int v_cycles = b->stats.v_cycles;
        b->outer.certified = false;
        DMK_TRY(dmk_certify(&b->outer, true));
        printf("%d,%d,%.4f,%.5f,%.3e,%.3e\n", number + 1, b->stats.v_cycles, seconds, now,
               b->stats.cost_upper / b->best_cost - 1, b->stats.gap);
        b->stats.v_cycles = v_cycles; /* the next step's certificate is another run's */
        if (now <= error) break;
    }
done:
    return rc;
}

int main(int argc, char **argv)
{
    int rc;
    bench b = {0};
    int depth = argc > 2 ? (int)strtol(argv[2], NULL, 10) : 5;
    int steps = argc > 3 ? (int)strtol(argv[3], NULL, 10) : 100;
    double error = argc > 4 ? strtod(argv[4], NULL) : 2e-3;
    if (argc < 2 || argc > 5 || depth < 1 || depth > MAX_DEPTH) {
        fprintf(stderr, "usage: bench-anderson MESH.off [DEPTH [STEPS [ERROR]]], DEPTH 1 to %d\n",
                MAX_DEPTH);
        return 2;
    }
    setenv("POCL_AFFINITY", "1", 0); /* as the tool does */
    DMK_TRY(dmk_context_create(&b.ctx));
    DMK_TRY(prepare(&b, argv[1], depth));
    DMK_TRY(solve_reference(&b));
    DMK_TRY(iterate(&b, depth, steps, error));
done:
    if (rc != DMK_OK) fprintf(stderr, "bench-anderson: %s\n", dmk_context_message(b.ctx));
    double *arrays[] = {b.area, b.mu, b.y, b.r, b.q, b.r_before, b.dy, b.dr, b.best};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free(arrays[i]);
    dmk_system_destroy(&b.sys);
    if (b.order.mesh) dmk_mollify_free(b.order.mesh, &b.mollified);
    dmk_order_free(&b.order);
    dmk_mesh_destroy(&b.mesh);
    dmk_device_destroy(&b.device);
    dmk_context_destroy(&b.ctx);
    return rc == DMK_OK ? 0 : 1;
}
