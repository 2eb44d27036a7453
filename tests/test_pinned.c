/* Numbers of fixed problems, as they were when they were looked at last: a change that moves one of them fails here
 * and says which. Arrays come as one sum with a weight of its own for each entry. tests/data/pinned.txt holds them;
 * after a change that is meant to move them:
 *     PINNED_WRITE=tests/data/pinned.txt build/release/tests/test_pinned     (and read what git says has changed)
 * Tolerances: what gcc -O0 without fused multiplications and the work shape of GPUs change stays five times below. */
#include "solving.h"

#include "geodesic/geodesic.h"
#include "solver/measure.h"
#include "solver/solver.h"
#include "solver/start.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The host's arithmetic; and what follows from steps of the device that end at a tolerance. */
static const double host = 1e-9, solved = 5e-6;

/* ---- the numbers ------------------------------------------------------------------------------ */

enum { MOST_PINS = 2000 };
typedef struct pin {
    char name[80];
    double value;
} pin;
static pin stored[MOST_PINS];
static size_t n_stored;
static FILE *fresh; /* they are written instead */
static int n_moved; /* in this test */

static int read_pins(void **state)
{
    const char *path = getenv("PINNED_WRITE");
    if (path) {
        fresh = fopen(path, "w");
        return fresh ? bench_setup(state) : -1;
    }
    FILE *file = fopen("tests/data/pinned.txt", "r");
    if (!file) return -1;
    while (n_stored < MOST_PINS &&
           fscanf(file, "%79s %lf", stored[n_stored].name, &stored[n_stored].value) == 2)
        n_stored++;
    fclose(file);
    return n_stored > 0 && n_stored < MOST_PINS ? bench_setup(state) : -1;
}

static int close_pins(void **state)
{
    if (fresh && fclose(fresh) != 0) return -1;
    return bench_teardown(state);
}

/* "group.name" is `value` to within `most`. What is computed in GPUs' work shape is compared, but not written. */
static bool gpu_shape;
static void pin_near(const char *group, const char *name, double value, double most)
{
    char full[80];
    snprintf(full, sizeof full, "%s.%s", group, name);
    if (fresh && gpu_shape) return;
    if (fresh) {
        fprintf(fresh, "%s %.12g\n", full, value);
        return;
    }
    for (size_t i = 0; i < n_stored; i++) {
        if (strcmp(stored[i].name, full) != 0) continue;
        if (fabs(value - stored[i].value) <= most) return;
        print_error("%s: %.12g, pinned at %.12g to %.1g\n", full, value, stored[i].value, most);
        n_moved++;
        return;
    }
    print_error("%s: not in tests/data/pinned.txt\n", full);
    n_moved++;
}

static void pin_one(const char *group, const char *name, double value, double relative)
{
    pin_near(group, name, value, relative * fabs(value));
}

static void pin_count(const char *group, const char *name, double count)
{
    pin_near(group, name, count, 0);
}

/* sum w_i x_i, w_i in 0.5 to 1.5, to within `relative` of the sum of the sizes. */
static void pin_doubles(const char *group, const char *name, size_t n, const double *x,
                        double relative)
{
    double sum = 0, size = 0;
    for (size_t i = 0; i < n; i++) {
        const double w = 0.5 + fmod(0.6180339887498949 * (double)(i + 1), 1);
        sum += w * x[i];
        size += fabs(w * x[i]);
    }
    pin_near(group, name, sum, relative * size);
}

static void pin_floats(const char *group, const char *name, size_t n, const float *x)
{
    double *copy = malloc((n + 1) * sizeof *copy);
    assert_non_null(copy);
    for (size_t i = 0; i < n; i++) copy[i] = x[i];
    pin_doubles(group, name, n, copy, 1e-6);
    free(copy);
}

static void pin_ints(const char *group, const char *name, size_t n, const int32_t *x)
{
    double *copy = malloc((n + 1) * sizeof *copy);
    assert_non_null(copy);
    for (size_t i = 0; i < n; i++) copy[i] = x[i];
    pin_doubles(group, name, n, copy, 1e-11);
    free(copy);
}

static void all_pins_hold(void)
{
    const int moved = n_moved;
    n_moved = 0;
    if (moved > 0) fail_msg("%d numbers have moved", moved);
}

/* ---- meshes ----------------------------------------------------------------------------------- */

static double noise(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 16777216.0 - 0.5;
}

/* A hilly sheet with a border and obtuse triangles, n by n squares. */
static dmk_mesh *sheet(dmk_context *ctx, int n)
{
    const int side = n + 1;
    double *xyz = calloc(3 * (size_t)(side * side), sizeof *xyz);
    int32_t *triangle = calloc(6 * (size_t)(n * n), sizeof *triangle), *t = triangle;
    uint32_t random = 5;
    dmk_mesh *mesh = NULL;
    assert_true(xyz && triangle);
    for (int i = 0; i < side * side; i++) {
        xyz[3 * i] = i % side + 0.6 * noise(&random);
        xyz[3 * i + 1] = i / side + 0.6 * noise(&random);
        xyz[3 * i + 2] = 0.15 * n * sin(6.0 * xyz[3 * i] / n) * cos(5.0 * xyz[3 * i + 1] / n);
    }
    for (int i = 0; i < n * n; i++, t += 6) {
        const int a = i % n + i / n * side, b = a + 1, c = a + side, d = c + 1;
        const int32_t up[6] = {a, b, d, a, d, c}, down[6] = {a, b, c, b, d, c};
        memcpy(t, i % 3 ? up : down, sizeof up);
    }
    assert_int_equal(
        dmk_mesh_adopt(ctx, (size_t)(side * side), xyz, 2 * (size_t)(n * n), triangle, &mesh),
        DMK_OK);
    return mesh;
}

static const dmk_point places[] = {{101, {0.2, 0.55, 0.25}}, {177, {0.4, 0, 0.6}}, {42, {0, 1, 0}}};
static const char *const place_name[] = {"face", "edge", "vertex"};

/* ---- the start -------------------------------------------------------------------------------- */

static void pin_start(const char *mesh_name, dmk_context *ctx, const dmk_mesh *m)
{
    double *mid = calloc((size_t)m->n_edges, sizeof *mid);
    double *mu = calloc((size_t)m->n_triangles, sizeof *mu);
    for (size_t i = 0; i < 3; i++) {
        char group[64];
        double integral, error;
        dmk_geodesics *g = NULL;
        snprintf(group, sizeof group, "start.%s.%s", mesh_name, place_name[i]);
        assert_int_equal(dmk_geodesics_create(ctx, m, 1, &places[i], NULL, &g), DMK_OK);
        dmk_geodesics_midpoints(ctx, g, mid);
        assert_int_equal(dmk_start_density(ctx, m, g, mid, mu, NULL), DMK_OK);
        assert_int_equal(dmk_geodesics_integrate(ctx, g, &integral, &error), DMK_OK);
        pin_doubles(group, "distance", (size_t)m->n_vertices, g->distance, host);
        pin_doubles(group, "mid", (size_t)m->n_edges, mid, host);
        pin_doubles(group, "mu", (size_t)m->n_triangles, mu, host);
        pin_one(group, "integral", integral, host);
        pin_one(group, "integral_error", error, 1e-4);
        dmk_geodesics_destroy(&g);
    }
    free(mid);
    free(mu);
}

static void the_start_is_pinned(void **state)
{
    const bench *b = *state;
    dmk_mesh *m = sheet(b->ctx, 20), *rough = NULL;
    bench_ok(b, dmk_mesh_read(b->ctx, "tests/data/rough.off", &rough));
    pin_start("sheet", b->ctx, m);
    pin_start("rough", b->ctx, rough);
    dmk_mesh_destroy(&m);
    dmk_mesh_destroy(&rough);
    all_pins_hold();
}

/* ---- distances: several sources, lines, borders, any point ------------------------------------ */

static void pin_geodesics(const char *group, dmk_context *ctx, const dmk_mesh *m,
                          const dmk_geodesics_options *options)
{
    dmk_geodesics *g = NULL;
    dmk_geodesics_info info;
    dmk_value value[3];
    dmk_path path[3] = {{0}};
    double *angle = calloc(2 * (size_t)m->n_vertices, sizeof *angle);
    int32_t *number = calloc(2 * (size_t)m->n_vertices, sizeof *number);
    const dmk_point to[3] = {{7, {0.3, 0.3, 0.4}}, {311, {0.1, 0.2, 0.7}}, {250, {0, 0, 1}}};
    assert_int_equal(dmk_geodesics_create(ctx, m, 3, places, options, &g), DMK_OK);
    dmk_geodesics_get_info(g, &info);
    const dmk_arrival *a = dmk_geodesics_arrivals(g, NULL);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        angle[2 * v] = cos(a[v].direction);
        angle[2 * v + 1] = cos(a[v].back);
        number[2 * v] = a[v].source;
        number[2 * v + 1] = a[v].pseudo_source + 1;
    }
    pin_doubles(group, "distance", (size_t)m->n_vertices, dmk_geodesics_distance(g, NULL), host);
    pin_doubles(group, "angles", 2 * (size_t)m->n_vertices, angle, 1e-7);
    pin_ints(group, "sources", 2 * (size_t)m->n_vertices, number);
    pin_one(group, "farthest", info.farthest, host);
    assert_int_equal(dmk_geodesics_at(ctx, g, 3, to, value), DMK_OK);
    assert_int_equal(dmk_geodesics_paths(ctx, g, 3, to, path), DMK_OK);
    for (int i = 0; i < 3; i++) {
        char one[80];
        snprintf(one, sizeof one, "%s.to%d", group, i);
        pin_one(one, "distance", value[i].distance, host);
        pin_near(one, "cosine", cos(value[i].direction), 1e-8);
        pin_count(one, "source", value[i].source);
        pin_count(one, "path.n", (double)path[i].n);
        pin_one(one, "path.length", path[i].length, host);
        pin_near(one, "path.cosine", cos(path[i].angle), 1e-8);
        dmk_path_free(&path[i]);
    }
    dmk_geodesics_destroy(&g);
    free(angle);
    free(number);
}

static void distances_are_pinned(void **state)
{
    const bench *b = *state;
    dmk_mesh *m = sheet(b->ctx, 20);
    static const double offset[3] = {0.5, 0, 1.25};
    const int32_t line[4] = {m->edge_vertex[300], m->edge_vertex[301], m->edge_vertex[900],
                             m->edge_vertex[901]};
    dmk_geodesics_options o;
    dmk_geodesics_options_init(&o, sizeof o);
    pin_geodesics("distance.points", b->ctx, m, &o);
    o.offset = offset;
    pin_geodesics("distance.offset", b->ctx, m, &o);
    o.n_lines = 2;
    o.line = line;
    pin_geodesics("distance.lines", b->ctx, m, &o);
    o.border = 1;
    pin_geodesics("distance.border", b->ctx, m, &o);
    dmk_geodesics_options_init(&o, sizeof o);
    o.tolerance = 1e-3;
    dmk_geodesics *g = NULL;
    bench_ok(b, dmk_geodesics_create(b->ctx, m, 3, places, &o, &g));
    pin_doubles("distance.merged", "distance", (size_t)m->n_vertices,
                dmk_geodesics_distance(g, NULL), host);
    pin_doubles("distance.merged", "error", (size_t)m->n_vertices, dmk_geodesics_error(g, NULL),
                1e-6);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
    all_pins_hold();
}

/* ---- loads ------------------------------------------------------------------------------------ */

/* A measure with all parts: line 0 crosses edges, line 1 runs through a vertex. */
typedef struct parts {
    double *vertex_mass, *triangle_density;
    dmk_point atoms[4], line_points[7];
    double atom_mass[4], line_density[2];
    int32_t line_first[3];
} parts;

static void make_parts(const bench *b, const dmk_mesh *m, parts *p)
{
    dmk_geodesics *g = NULL;
    dmk_path path = {0};
    const dmk_point to = {200, {0.15, 0.25, 0.6}};
    memset(p, 0, sizeof *p);
    p->vertex_mass = calloc((size_t)m->n_vertices, sizeof(double));
    p->triangle_density = calloc((size_t)m->n_triangles, sizeof(double));
    for (int32_t v = 0; v < m->n_vertices; v += 3) p->vertex_mass[v] = 0.01 * (v % 7);
    for (int32_t t = 0; t < m->n_triangles; t += 2) p->triangle_density[t] = 0.02 * (t % 5);
    for (int i = 0; i < 3; i++) p->atoms[i] = places[i];
    p->atoms[3] = to;
    for (int i = 0; i < 4; i++) p->atom_mass[i] = 0.4 + 0.3 * i;
    bench_ok(b, dmk_geodesics_create(b->ctx, m, 1, places, NULL, &g));
    bench_ok(b, dmk_geodesics_paths(b->ctx, g, 1, &to, &path));
    assert_true(path.n >= 4);
    memcpy(p->line_points, path.point, 4 * sizeof *path.point);
    const int32_t v =
        m->triangle[3 * 301 + 1]; /* a star of triangles: in one, through v, out in another */
    p->line_points[4] = (dmk_point){301, {0.3, 0.1, 0.6}};
    p->line_points[5] = (dmk_point){301, {0, 1, 0}};
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (m->triangle[h] != v || h / 3 == 301) continue;
        p->line_points[6].triangle = h / 3;
        for (int k = 0; k < 3; k++) p->line_points[6].weight[k] = k == h % 3 ? 0.25 : 0.5 - 0.125;
    }
    p->line_first[1] = 4;
    p->line_first[2] = 7;
    p->line_density[0] = 0.7;
    p->line_density[1] = 1.9;
    dmk_path_free(&path);
    dmk_geodesics_destroy(&g);
}

static void pin_load(const char *group, const bench *b, const dmk_solver *s,
                     const dmk_measure *from, const dmk_measure *to)
{
    double mass = 0, atom[4] = {0};
    const dmk_system *sys = s->system;
    double *f = calloc((size_t)sys->whole.n_rows_pad, sizeof *f);
    bench_ok(b, dmk_measure_load(b->ctx, (size_t)s->mesh->n_triangles, &s->order->order, sys, from,
                                 to, true, f, &mass, atom));
    pin_doubles(group, "edges", (size_t)sys->whole.n_edges, f, host);
    pin_doubles(group, "vertices", (size_t)sys->whole.n_vertices, f + sys->whole.vertex_row, host);
    pin_one(group, "mass", mass, host);
    pin_doubles(group, "atoms", 4, atom, host);
    free(f);
}

static void loads_are_pinned(void **state)
{
    bench *b = *state;
    parts all;
    problem p = problem_of(b, sheet(b->ctx, 20));
    problem_solve(&p);
    make_parts(b, p.mesh, &all);
    const dmk_measure even = {.uniform = 2},
                      one = {.n_atoms = 3, .atoms = all.atoms, .atom_mass = all.atom_mass},
                      two = {.vertex_mass = all.vertex_mass},
                      three = {.triangle_density = all.triangle_density},
                      four = {.n_lines = 2,
                              .line_first = all.line_first,
                              .line_points = all.line_points,
                              .line_density = all.line_density},
                      free_atoms = {.n_atoms = 4, .atoms = all.atoms};
    pin_load("load.atoms", b, p.solver, &one, &even);
    pin_load("load.vertices", b, p.solver, &two, &even);
    pin_load("load.triangles", b, p.solver, &three, &one);
    pin_load("load.lines", b, p.solver, &even, &four);
    pin_load("load.free", b, p.solver, &free_atoms, &three);
    pin_load("load.free_target", b, p.solver, &two, &free_atoms);
    free(all.vertex_mass);
    free(all.triangle_density);
    problem_free(&p);
    all_pins_hold();
}

/* ---- solves ----------------------------------------------------------------------------------- */

static void pin_stats(const char *group, const dmk_stats *s, double tolerance)
{
    pin_count(group, "steps", s->steps);
    pin_near(group, "cg_iterations", s->cg_iterations, 2);
    pin_near(group, "v_cycles", s->v_cycles, 2);
    pin_count(group, "levels", s->levels);
    pin_near(group, "sweeps", s->sweeps, 1);
    pin_near(group, "n_steep", (double)s->n_steep, 1);
    pin_count(group, "double", s->double_precision);
    pin_one(group, "change", s->change, 2e-3);
    pin_one(group, "cost_upper", s->cost_upper, 0.2 * tolerance);
    pin_one(group, "cost_lower", s->cost_lower, 0.2 * tolerance);
    pin_near(group, "gap", s->gap, 0.4 * tolerance);
    pin_one(group, "area", s->area, host);
    if (!isnan(s->cost_exact)) pin_one(group, "cost_exact", s->cost_exact, host);
    if (!isnan(s->cost_exact)) pin_one(group, "cost_exact_error", s->cost_exact_error, 1e-4);
}

/* What the first steps report. */
typedef struct told {
    int n, iterations[4];
    double change[4], seconds;
} told;

static int listen(const dmk_progress *p, void *user)
{
    told *t = user;
    if (strcmp(p->stage, "solve") != 0) return 0;
    assert_true(p->seconds >= t->seconds && p->seconds < 60);
    t->seconds = p->seconds;
    if (t->n < 4) {
        t->iterations[t->n] = p->cg_iterations;
        t->change[t->n++] = p->change;
    }
    return 0;
}

static void pin_solve(const char *group, problem *p)
{
    told t = {0};
    const double begin = dmk_seconds();
    dmk_context_set_progress(p->b->ctx, listen, &t);
    problem_solve(p);
    dmk_context_set_progress(p->b->ctx, NULL, NULL);
    const double wall = dmk_seconds() - begin;
    double sum = 0;
    for (int i = 0; i < DMK_N_STAGES; i++) {
        assert_true(p->stats.seconds[i] >= 0);
        sum += p->stats.seconds[i];
    }
    /* No stage but reading, the device, the locus is out of sight here; 0.1 s beside them on a busy machine. */
    assert_true(sum <= wall && sum >= 0.5 * wall - 0.1);
    assert_true(p->stats.seconds[DMK_STAGE_SOLVE] > 0 && p->stats.seconds[DMK_STAGE_CERTIFY] > 0 &&
                p->stats.seconds[DMK_STAGE_START] > 0);
    for (int i = 0; i < t.n; i++) {
        char name[32];
        snprintf(name, sizeof name, "step%d.iterations", i + 1);
        pin_near(group, name, t.iterations[i], 1);
        snprintf(name, sizeof name, "step%d.change", i + 1);
        pin_one(group, name, t.change[i], 1e-3);
    }
    pin_stats(group, &p->stats, solved);
    size_t n;
    const double *x = dmk_result_density(p->result, &n);
    pin_doubles(group, "density", n, x, solved);
    x = dmk_result_potential(p->result, &n);
    pin_doubles(group, "potential", n, x, solved);
    x = dmk_result_potential_mid(p->result, &n);
    pin_doubles(group, "potential_mid", n, x, solved);
    const uint8_t *acl = dmk_result_acl(p->result, &n);
    double marked = 0;
    for (size_t i = 0; acl && i < n; i++) marked += acl[i];
    pin_near(group, "acl", marked, 2);
}

static void pin_solves(bench *b, int n_ways)
{
    static const char *const method[] = {"newton", "inertial", "euler"};
    for (int mesh = 0; mesh < 2; mesh++) {
        problem p =
            mesh ? problem_file(b, "meshes/ellipsoid.off") : problem_of(b, sheet(b->ctx, 24));
        for (int i = 0; i < n_ways; i++) {
            char group[64];
            snprintf(group, sizeof group, "solve.%s.%s.%s", mesh ? "ellipsoid" : "sheet",
                     method[i % 3], i < 3 ? "distance" : "uniform");
            p.source = places[i % 3];
            p.options.method = (dmk_method)(i % 3);
            p.options.start = i < 3 ? DMK_START_DISTANCE : DMK_START_UNIFORM;
            pin_solve(group, &p);
        }
        dmk_solve_options_init(&p.options, sizeof p.options);
        p.options.gap_tolerance = 1e-4;
        p.source = places[2];
        pin_solve(mesh ? "solve.ellipsoid.gap" : "solve.sheet.gap", &p);
        problem_free(&p);
    }
}

static void solves_are_pinned(void **state)
{
    pin_solves(*state, 6);
    all_pins_hold();
}

/* Several levels. */
static void a_larger_solve_is_pinned(void **state)
{
    problem p = problem_file(*state, "tests/data/rough.off");
    pin_solve("solve.rough", &p);
    problem_free(&p);
    all_pins_hold();
}

static void pin_transport(const char *group, problem *p, const dmk_measure *from,
                          const dmk_measure *to)
{
    dmk_transport *t = NULL;
    dmk_stats stats;
    dmk_transport_info info;
    size_t n;
    bench_ok(p->b, dmk_solve_measures(p->b->ctx, p->solver, from, to, &p->options, &t));
    dmk_transport_get_stats(t, &stats);
    dmk_transport_get_info(t, &info);
    pin_stats(group, &stats, solved);
    pin_one(group, "mass", info.mass, host);
    assert_true(info.balance > 0 && info.balance < 1e-10);
    const double *x = dmk_transport_density(t, &n);
    pin_doubles(group, "density", n, x, solved);
    x = dmk_transport_flux(t, &n);
    pin_doubles(group, "flux", n, x, solved);
    x = dmk_transport_potential(t, &n);
    pin_doubles(group, "potential", n, x, solved);
    x = dmk_transport_potential_mid(t, &n);
    pin_doubles(group, "potential_mid", n, x, solved);
    x = dmk_transport_atom_mass(t, &n);
    pin_doubles(group, "atom_mass", n, x, host);
    const uint8_t *acl = dmk_transport_acl(t, &n);
    double marked = 0;
    for (size_t i = 0; i < n; i++) marked += acl[i];
    pin_near(group, "acl", marked, 2);
    assert_true(stats.seconds[DMK_STAGE_SOLVE] > 0 && stats.seconds[DMK_STAGE_START] > 0);
    dmk_transport_destroy(&t);
}

static void pin_transports(bench *b)
{
    parts all;
    problem p = problem_of(b, sheet(b->ctx, 20));
    make_parts(p.b, p.mesh, &all);
    p.options.normalise = 1;
    const dmk_measure even = {.uniform = 2},
                      one = {.n_atoms = 3, .atoms = all.atoms, .atom_mass = all.atom_mass},
                      two = {.vertex_mass = all.vertex_mass},
                      free_atoms = {.n_atoms = 4, .atoms = all.atoms};
    pin_transport("transport.atoms", &p, &one, &two);
    pin_transport("transport.free", &p, &free_atoms, &even);
    p.options.method = DMK_INERTIAL;
    p.options.gap_tolerance = 5e-3;
    pin_transport("transport.inertial", &p, &two, &even);
    free(all.vertex_mass);
    free(all.triangle_density);
    problem_free(&p);
}

static void transports_are_pinned(void **state)
{
    pin_transports(*state);
    all_pins_hold();
}

static void the_gpu_shape_has_the_same_numbers(void **state)
{
    (void)state;
    bench b;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    o.shape = DMK_SHAPE_GPU;
    bench_open(&b, &o);
    gpu_shape = true;
    pin_solves(&b, 2);
    pin_transports(&b);
    gpu_shape = false;
    bench_close(&b);
    all_pins_hold();
}

/* ---- locus, cut, plane ------------------------------------------------------------------------ */

static void pin_locus(const char *group, const problem *p, double strength)
{
    dmk_locus *l = NULL;
    dmk_locus_info info;
    dmk_locus_options o;
    size_t n, n_edges, n_lines;
    const int32_t *offset;
    dmk_locus_options_init(&o, sizeof o);
    o.strength = strength;
    bench_ok(p->b, dmk_locus_compute(p->b->ctx, p->mesh, p->result, &o, &l));
    dmk_locus_get_info(l, &info);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    const dmk_locus_edge *e = dmk_locus_edges(l, &n_edges);
    const int32_t *index = dmk_locus_polylines(l, &offset, &n_lines);
    double *x = calloc(10 * n + n_edges + 1, sizeof *x), *to = x;
    for (size_t i = 0; i < n; i++) {
        const double strong = isfinite(v[i].strength) ? v[i].strength : -1;
        const double one[10] = {v[i].xyz[0],
                                v[i].xyz[1],
                                v[i].xyz[2],
                                v[i].distance,
                                strong,
                                cos(v[i].angle[0]),
                                cos(v[i].angle[1]),
                                v[i].kind + 4 * v[i].degree,
                                v[i].meeting_angle,
                                v[i].source_angle};
        memcpy(to, one, sizeof one);
        to += 10;
    }
    for (size_t i = 0; i < n_edges; i++) *to++ = isfinite(e[i].strength) ? e[i].strength : -1;
    pin_count(group, "vertices", (double)n);
    pin_count(group, "edges", (double)n_edges);
    pin_count(group, "polylines", (double)n_lines);
    pin_count(group, "loops", (double)info.loops);
    pin_count(group, "components", (double)info.components);
    pin_count(group, "endpoints", (double)info.endpoints);
    pin_count(group, "branch_points", (double)info.branch_points);
    pin_one(group, "length", info.length, host);
    pin_one(group, "strength", info.strength, host);
    pin_doubles(group, "numbers", 10 * n + n_edges, x, 1e-7);
    pin_ints(group, "index", (size_t)offset[n_lines], index);
    pin_ints(group, "offset", n_lines + 1, offset);
    free(x);
    dmk_locus_destroy(&l);
}

static void pin_cut(const char *group, const problem *p, double strength)
{
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    dmk_locus_options o;
    dmk_locus_options_init(&o, sizeof o);
    o.strength = strength;
    bench_ok(p->b, dmk_cut(p->b->ctx, p->mesh, p->result, &o, &cut, &origin, &plane));
    const size_t n = (size_t)cut->n_vertices;
    pin_count(group, "vertices", (double)n);
    pin_count(group, "triangles", cut->n_triangles);
    pin_doubles(group, "xyz", 3 * n, cut->xyz, host);
    pin_ints(group, "triangle", 3 * (size_t)cut->n_triangles, cut->triangle);
    pin_ints(group, "origin", n, origin);
    pin_doubles(group, "plane", 2 * n, plane, 1e-7);
    pin_count(group, "flipped", (double)dmk_cut_flipped(cut, plane));
    dmk_mesh_destroy(&cut);
    free(origin);
    free(plane);
}

static void loci_are_pinned(void **state)
{
    problem p = problem_file(*state, "tests/data/rough.off");
    p.source = places[0];
    problem_solve(&p);
    pin_locus("locus.rough", &p, 0);
    pin_locus("locus.rough.all", &p, 1e-3);
    pin_cut("cut.rough", &p, 0);
    problem_free(&p);
    p = problem_file(*state, "tests/data/torus_5440.off.gz");
    p.source = places[1];
    problem_solve(&p);
    pin_locus("locus.torus", &p, 0);
    pin_locus("locus.torus.all", &p, 1e-4);
    pin_cut("cut.torus", &p, 0);
    problem_free(&p);
    p = problem_of(*state, sheet(((bench *)*state)->ctx, 24));
    p.source = places[2];
    problem_solve(&p);
    pin_locus("locus.sheet", &p, 0);
    pin_cut("cut.sheet", &p, 1e-3);
    problem_free(&p);
    all_pins_hold();
}

/* ---- levels ----------------------------------------------------------------------------------- */

static void pin_levels(const char *mesh_name, dmk_context *ctx, const dmk_mesh *m)
{
    dmk_hierarchy h;
    assert_int_equal(dmk_hierarchy_create(ctx, m, 20, &h), DMK_OK);
    size_t n_fine = (size_t)m->n_vertices;
    for (int32_t i = 0; i < h.n; i++) {
        const dmk_coarsening *c = &h.level[i];
        const size_t n = (size_t)c->coarse.n, n_edges = (size_t)c->coarse.n_edges;
        char group[64];
        snprintf(group, sizeof group, "level.%s.%d", mesh_name, (int)i);
        pin_count(group, "n", (double)n);
        pin_ints(group, "edge", 2 * n_edges, c->coarse.edge);
        pin_doubles(group, "xyz", 3 * n, c->coarse.xyz, host);
        pin_ints(group, "prolong_index", 3 * n_fine, c->prolong_index);
        pin_floats(group, "prolong_weight", 3 * n_fine, c->prolong_weight);
        pin_ints(group, "restrict_row", n + 1, c->restrict_row);
        pin_ints(group, "restrict_fine", (size_t)c->restrict_row[n], c->restrict_fine);
        pin_floats(group, "restrict_weight", (size_t)c->restrict_row[n], c->restrict_weight);
        pin_ints(group, "galerkin_row", n_edges + 1, c->galerkin_row);
        pin_ints(group, "galerkin_edge", (size_t)c->galerkin_row[n_edges], c->galerkin_edge);
        pin_floats(group, "galerkin_coef", (size_t)c->galerkin_row[n_edges], c->galerkin_coef);
        n_fine = n;
    }
    dmk_hierarchy_free(&h);
}

static void levels_are_pinned(void **state)
{
    const bench *b = *state;
    static const char *const files[] = {"rough.off", "once/valence-132.off.gz",
                                        "once/disc-76.off.gz", "once/needles-441.off.gz",
                                        "once/spike-81.off.gz"};
    dmk_mesh *m = sheet(b->ctx, 24);
    pin_levels("sheet", b->ctx, m);
    dmk_mesh_destroy(&m);
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        char path[64];
        snprintf(path, sizeof path, "tests/data/%s", files[i]);
        bench_ok(b, dmk_mesh_read(b->ctx, path, &m));
        pin_levels(files[i], b->ctx, m);
        dmk_mesh_destroy(&m);
    }
    all_pins_hold();
}

/* ---- the built-in surfaces -------------------------------------------------------------------- */

static void surfaces_are_pinned(void **state)
{
    const bench *b = *state;
    for (size_t i = 0; dmk_surface_name(i); i++) {
        for (int k = 0; k < 3; k++) {
            char group[64];
            dmk_mesh *m = NULL;
            dmk_surface_options o;
            dmk_surface_options_init(&o, sizeof o);
            o.name = dmk_surface_name(i);
            o.n_triangles = 400;
            o.refine = k == 1;
            o.has_source = k == 2;
            o.source[0] = 1.1;
            o.source[1] = -0.4;
            o.source[2] = 0.3;
            bench_ok(b, dmk_mesh_surface(b->ctx, &o, &m));
            snprintf(group, sizeof group, "surface.%s.%d", o.name, k);
            pin_count(group, "vertices", m->n_vertices);
            pin_ints(group, "triangle", 3 * (size_t)m->n_triangles, m->triangle);
            pin_doubles(group, "xyz", 3 * (size_t)m->n_vertices, m->xyz, host);
            dmk_mesh_destroy(&m);
        }
    }
    all_pins_hold();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_start_is_pinned),
        cmocka_unit_test(distances_are_pinned),
        cmocka_unit_test(loads_are_pinned),
        cmocka_unit_test(solves_are_pinned),
        cmocka_unit_test(a_larger_solve_is_pinned),
        cmocka_unit_test(transports_are_pinned),
        cmocka_unit_test(the_gpu_shape_has_the_same_numbers),
        cmocka_unit_test(loci_are_pinned),
        cmocka_unit_test(levels_are_pinned),
        cmocka_unit_test(surfaces_are_pinned),
    };
    return cmocka_run_group_tests_name("pinned", tests, read_pins, close_pins);
}
