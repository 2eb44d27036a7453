/* One mesh on several ranks, threads of this process that talk through a barrier: the bits of one
 * rank, whatever their number, also where levels are dealt out, on a mesh with borders, in single
 * precision and with explicit steps. */
#include "meeting.h"
#include "solving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- a solve on each rank -------------------------------------------------------------------- */

typedef struct task {
    const dmk_mesh *mesh;
    bool given; /* each rank gives its solver a mesh of its own */
    dmk_device_options device;
    dmk_solve_options options;
    int32_t gather_below;
    bool at_once; /* exchanges are not in two halves */
} task;

typedef struct seat {
    const task *t;
    member m;
    dmk_result *result;
    dmk_stats stats;
    dmk_traffic traffic;
    int rc, locus_rc, second_rc;
    bool same_locus;
    char message[300];
} seat;

/* A locus of one point has no edges, and no array of them. */
static bool same_bytes(const void *a, const void *b, size_t size)
{
    return size == 0 || !memcmp(a, b, size);
}

static bool same_locus(const dmk_locus *a, const dmk_locus *b)
{
    size_t n, other;
    const int32_t *from, *to;
    const dmk_locus_vertex *vertex = dmk_locus_vertices(a, &n),
                           *its_vertex = dmk_locus_vertices(b, &other);
    if (n != other || !same_bytes(vertex, its_vertex, n * sizeof *vertex)) return false;
    const dmk_locus_edge *edge = dmk_locus_edges(a, &n), *its_edge = dmk_locus_edges(b, &other);
    if (n != other || !same_bytes(edge, its_edge, n * sizeof *edge)) return false;
    const int32_t *index = dmk_locus_polylines(a, &from, &n),
                  *its = dmk_locus_polylines(b, &to, &other);
    if (n != other || !same_bytes(from, to, (n + 1) * sizeof *from)) return false;
    return same_bytes(index, its, (size_t)from[n] * sizeof *index);
}

/* The cut locus that each rank traces against the last one's. */
static int share_locus(seat *s, dmk_context *ctx, const dmk_ranks *ranks, dmk_locus *own)
{
    const int last = ranks->size - 1;
    dmk_locus *theirs = ranks->rank == last ? own : NULL;
    if (dmk_locus_spread(ctx, ranks, ranks->size, &theirs) != DMK_E_ARG ||
        !strstr(dmk_context_message(ctx), "there are"))
        return DMK_E_CANCELLED;
    const int rc = dmk_locus_spread(ctx, ranks, last, &theirs);
    s->same_locus = rc == DMK_OK && same_locus(own, theirs);
    if (theirs != own) dmk_locus_destroy(&theirs);
    return rc;
}

static int solve_on(seat *s, dmk_context *ctx, dmk_device **device, dmk_solver **solver)
{
    dmk_point source;
    const dmk_ranks ranks = ranks_of(&s->m, s->t->gather_below);
    dmk_mesh *own = NULL;
    const dmk_mesh *mesh = s->t->mesh;
    int rc = dmk_device_open(ctx, &s->t->device, device);
    if (rc == DMK_OK && s->t->given) {
        dmk_mesh_info info;
        dmk_mesh_get_info(mesh, &info);
        rc = dmk_mesh_create(ctx, info.n_vertices, dmk_mesh_vertices(mesh), info.n_triangles,
                             dmk_mesh_triangles(mesh), &own);
        mesh = own;
    }
    if (rc == DMK_OK) rc = dmk_solver_create(ctx, *device, mesh, solver);
    if (rc == DMK_OK && own) rc = dmk_solver_give_mesh(ctx, *solver, &own);
    if (rc == DMK_OK) rc = dmk_solver_set_ranks(ctx, *solver, &ranks);
    if (rc == DMK_OK) rc = dmk_mesh_vertex_point(ctx, s->t->mesh, 5, &source);
    if (rc == DMK_OK) rc = dmk_solve(ctx, *solver, &source, &s->t->options, &s->result);
    if (rc == DMK_OK) dmk_result_get_stats(s->result, &s->stats);
    dmk_solver_get_traffic(*solver, &s->traffic);
    if (rc == DMK_OK && s->t->given) {
        dmk_result *second = NULL;
        s->second_rc = dmk_solve(ctx, *solver, &source, &s->t->options, &second);
        dmk_result_destroy(&second);
    }
    if (rc == DMK_OK) {
        dmk_locus *locus = NULL;
        s->locus_rc = dmk_locus_compute(ctx, s->t->mesh, s->result, NULL, &locus);
        if (s->locus_rc == DMK_OK) rc = share_locus(s, ctx, &ranks, locus);
        dmk_locus_destroy(&locus);
    }
    return rc;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    dmk_device *device = NULL;
    dmk_solver *solver = NULL;
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = solve_on(s, ctx, &device, &solver);
    snprintf(s->message, sizeof s->message, "%s", dmk_context_message(ctx));
    dmk_solver_destroy(&solver);
    dmk_device_destroy(&device);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void sit_all(const task *t, int size, bool broken, seat seats[MOST_RANKS])
{
    meeting all = {.size = size, .broken = broken};
    for (int k = 0; k < size; k++)
        seats[k] = (seat){.t = t, .m = {.all = &all, .rank = k, .at_once = t->at_once}};
    assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
}

static void same_numbers(const double *a, const double *b, size_t n)
{
    assert_memory_equal(a, b, n * sizeof *a);
}

static void same_results(const seat *a, const seat *b)
{
    size_t n;
    const double *x = dmk_result_density(a->result, &n);
    same_numbers(x, dmk_result_density(b->result, NULL), n);
    x = dmk_result_potential(a->result, &n);
    same_numbers(x, dmk_result_potential(b->result, NULL), n);
    x = dmk_result_potential_mid(a->result, &n);
    same_numbers(x, dmk_result_potential_mid(b->result, NULL), n);
    const uint8_t *acl = dmk_result_acl(b->result, &n);
    const bool has_acl = b->m.rank == 0 && dmk_result_acl(a->result, NULL);
    assert_true(has_acl == (acl != NULL));
    if (acl) assert_memory_equal(dmk_result_acl(a->result, NULL), acl, n);
    x = dmk_result_distance(a->result, &n);
    if (x) same_numbers(x, dmk_result_distance(b->result, NULL), n);
    same_numbers(&a->stats.cost_exact, &b->stats.cost_exact, 1);
    same_numbers(&a->stats.cost_upper, &b->stats.cost_upper, 1);
    same_numbers(&a->stats.cost_lower, &b->stats.cost_lower, 1);
    assert_int_equal(a->stats.steps, b->stats.steps);
    assert_int_equal(a->stats.cg_iterations, b->stats.cg_iterations);
}

/* Ranks from `least` to MOST_RANKS against one. */
static void try_ranks(const task *t, int least)
{
    seat one[MOST_RANKS], many[MOST_RANKS];
    sit_all(t, 1, false, one);
    if (one[0].rc != DMK_OK) print_message("%s\n", one[0].message);
    assert_int_equal(one[0].rc, DMK_OK);
    assert_int_equal(one[0].traffic.exchanges, 0);
    for (int size = least; size <= MOST_RANKS; size++) {
        sit_all(t, size, false, many);
        for (int k = 0; k < size; k++) {
            if (many[k].rc != DMK_OK) print_message("%s\n", many[k].message);
            assert_int_equal(many[k].rc, DMK_OK);
            const dmk_traffic *sent = &many[k].traffic;
            assert_true(sent->exchanges > 0 && sent->bytes > 0);
            /* Those of operators on T/2 and the larger levels; the last ranks of few parts have no interior. */
            if (t->at_once)
                assert_int_equal(sent->overlapped, 0);
            else if (k == 0)
                assert_true(20 * sent->overlapped > sent->exchanges);
            same_results(&one[0], &many[k]);
            assert_true(many[k].same_locus == (t->options.density_only == 0));
            assert_int_equal(many[k].locus_rc, t->options.density_only ? DMK_E_ARG : DMK_OK);
            assert_int_equal(many[k].second_rc, t->given ? DMK_E_ARG : DMK_OK);
            dmk_result_destroy(&many[k].result);
        }
    }
    dmk_result_destroy(&one[0].result);
}

static dmk_mesh *surface(bench *b, const char *name, size_t n_triangles)
{
    dmk_mesh *mesh;
    dmk_surface_options options;
    dmk_surface_options_init(&options, sizeof options);
    options.name = name;
    options.n_triangles = n_triangles;
    bench_ok(b, dmk_mesh_surface(b->ctx, &options, &mesh));
    return mesh;
}

/* ---- tests ----------------------------------------------------------------------------------- */

static void test_same_bits(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "quartic", 20000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device, .gather_below = 300};
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, 2);
    dmk_mesh_destroy(&mesh);
}

static void test_at_once(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "torus", 9000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device, .gather_below = 300};
    t.at_once = true;
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, 3);
    dmk_mesh_destroy(&mesh);
}

static void test_usual_levels(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "torus", 16000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device};
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, 3);
    dmk_mesh_destroy(&mesh);
}

/* Levels behind T are dealt out on both sides of DMK_TAIL_MOST rows, and smoothed as on one rank. */
static void test_large_levels(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "quartic", 70000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device, .gather_below = 500};
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, MOST_RANKS);
    dmk_mesh_destroy(&mesh);
}

static void test_single_precision(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "ellipsoid", 16000);
    task t = {.mesh = mesh,
              .device = {.struct_size = sizeof t.device, .single_precision = 1},
              .gather_below = 1000};
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, 4);
    dmk_mesh_destroy(&mesh);
}

static void test_explicit_steps(void **state)
{
    bench *b = *state;
    dmk_mesh *mesh = surface(b, "torus", 16000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device, .gather_below = 500};
    dmk_solve_options_init(&t.options, sizeof t.options);
    t.options.method = DMK_INERTIAL;
    t.options.start = DMK_START_UNIFORM;
    t.options.tolerance = 0.3;
    try_ranks(&t, 3);
    dmk_mesh_destroy(&mesh);
}

/* The part of a surface below a height: one border. */
static void test_borders(void **state)
{
    bench *b = *state;
    dmk_mesh *whole = surface(b, "quartic", 24000), *mesh;
    dmk_mesh_info info;
    dmk_mesh_get_info(whole, &info);
    const double *xyz = dmk_mesh_vertices(whole);
    const int32_t *corner = dmk_mesh_triangles(whole);
    int32_t *kept = malloc(3 * info.n_triangles * sizeof *kept);
    size_t n = 0;
    assert_non_null(kept);
    for (size_t t = 0; t < info.n_triangles; t++) {
        const int32_t *c = corner + 3 * t;
        if (xyz[3 * c[0] + 2] + xyz[3 * c[1] + 2] + xyz[3 * c[2] + 2] > 1.5) continue;
        memcpy(kept + 3 * n++, c, 3 * sizeof *kept);
    }
    bench_ok(b, dmk_mesh_create(b->ctx, info.n_vertices, xyz, n, kept, &mesh));
    free(kept);
    dmk_mesh_get_info(mesh, &info);
    assert_true(info.n_border_loops == 1);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device, .gather_below = 400};
    dmk_solve_options_init(&t.options, sizeof t.options);
    try_ranks(&t, 4);
    dmk_mesh_destroy(&mesh);
    dmk_mesh_destroy(&whole);
}

/* Too small to be dealt out: every rank does all of it, and nothing is sent. */
static void test_small_mesh(void **state)
{
    bench *b = *state;
    seat many[MOST_RANKS];
    dmk_mesh *mesh = surface(b, "sphere", 1000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device};
    dmk_solve_options_init(&t.options, sizeof t.options);
    sit_all(&t, 2, false, many);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(many[k].rc, DMK_OK);
        assert_int_equal(many[k].traffic.exchanges, 0);
    }
    same_results(&many[0], &many[1]);
    for (int k = 0; k < 2; k++) dmk_result_destroy(&many[k].result);
    dmk_mesh_destroy(&mesh);
}

/* Without T nothing is dealt out either, and the bits are one rank's; with and without a distance. */
static void test_needles(void **state)
{
    bench *b = *state;
    seat many[MOST_RANKS], one[MOST_RANKS];
    dmk_mesh_info info;
    dmk_mesh *sphere = surface(b, "sphere", 9000), *mesh;
    dmk_mesh_get_info(sphere, &info);
    double *xyz = malloc(3 * info.n_vertices * sizeof *xyz);
    assert_non_null(xyz);
    memcpy(xyz, dmk_mesh_vertices(sphere), 3 * info.n_vertices * sizeof *xyz);
    for (size_t v = 0; v < info.n_vertices; v++) xyz[3 * v] *= 40;
    bench_ok(b, dmk_mesh_create(b->ctx, info.n_vertices, xyz, info.n_triangles,
                                dmk_mesh_triangles(sphere), &mesh));
    for (int density_only = 0; density_only < 2; density_only++) {
        task t = {.mesh = mesh, .device.struct_size = sizeof t.device};
        dmk_solve_options_init(&t.options, sizeof t.options);
        t.options.density_only = density_only;
        sit_all(&t, 1, false, one);
        sit_all(&t, 2, false, many);
        for (int k = 0; k < 2; k++) {
            assert_int_equal(many[k].rc, DMK_OK);
            assert_int_equal(many[k].traffic.exchanges, 0);
            same_results(&one[0], &many[k]);
            dmk_result_destroy(&many[k].result);
        }
        dmk_result_destroy(&one[0].result);
    }
    free(xyz);
    dmk_mesh_destroy(&mesh);
    dmk_mesh_destroy(&sphere);
}

static void test_lost_touch(void **state)
{
    bench *b = *state;
    seat many[MOST_RANKS];
    dmk_mesh *mesh = surface(b, "sphere", 16000);
    task t = {.mesh = mesh, .device.struct_size = sizeof t.device};
    dmk_solve_options_init(&t.options, sizeof t.options);
    sit_all(&t, 2, true, many);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(many[k].rc, DMK_E_DEVICE);
        assert_non_null(strstr(many[k].message, "lost touch"));
    }
    dmk_mesh_destroy(&mesh);
}

/* Without distance, a rank's mesh goes when it has its share: in double precision, and in single where the
 * lower bound is the host's, of needles too. */
static void test_density_only(void **state)
{
    bench *b = *state;
    for (int k = 0; k < 4; k++) {
        dmk_mesh *mesh = surface(b, k < 2 ? "quartic" : "ellipsoid", 9000);
        task t = {.mesh = mesh,
                  .given = k % 2 == 1,
                  .device = {.struct_size = sizeof t.device, .single_precision = k == 1},
                  .gather_below = 500};
        dmk_solve_options_init(&t.options, sizeof t.options);
        t.options.density_only = 1;
        if (k == 3) {
            t.options.method = DMK_INERTIAL;
            t.options.tolerance = 0.3;
        }
        try_ranks(&t, 2);
        dmk_mesh_destroy(&mesh);
    }
}

/* ---- between measures ------------------------------------------------------------------------- */

typedef struct mover {
    const dmk_mesh *mesh;
    const double *heap[2]; /* masses of the vertices */
    member m;
    dmk_transport *transport;
    int rc;
    char message[300];
} mover;

/* A density alone first, after which a rank has no more than its share of the mesh. */
static int solve_before(mover *s, dmk_context *ctx, dmk_solver *solver)
{
    dmk_point source;
    dmk_solve_options options;
    dmk_result *result = NULL;
    dmk_solve_options_init(&options, sizeof options);
    options.density_only = 1;
    int rc = dmk_mesh_vertex_point(ctx, s->mesh, 5, &source);
    if (rc == DMK_OK) rc = dmk_solve(ctx, solver, &source, &options, &result);
    dmk_result_destroy(&result);
    return rc;
}

static int move_on(mover *s, dmk_context *ctx, dmk_device **device, dmk_solver **solver)
{
    const dmk_measure from = {.vertex_mass = s->heap[0]}, to = {.vertex_mass = s->heap[1]};
    const dmk_ranks ranks = ranks_of(&s->m, 500);
    dmk_device_options open;
    dmk_solve_options options;
    dmk_device_options_init(&open, sizeof open);
    dmk_solve_options_init(&options, sizeof options);
    options.normalise = 1;
    int rc = dmk_device_open(ctx, &open, device);
    if (rc == DMK_OK) rc = dmk_solver_create(ctx, *device, s->mesh, solver);
    if (rc == DMK_OK) rc = dmk_solver_set_ranks(ctx, *solver, &ranks);
    if (rc == DMK_OK && s->m.all->size == 3) rc = solve_before(s, ctx, *solver);
    if (rc == DMK_OK) rc = dmk_solve_measures(ctx, *solver, &from, &to, &options, &s->transport);
    return rc;
}

static void *sit_moving(void *argument)
{
    mover *s = argument;
    dmk_context *ctx = NULL;
    dmk_device *device = NULL;
    dmk_solver *solver = NULL;
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = move_on(s, ctx, &device, &solver);
    snprintf(s->message, sizeof s->message, "%s", dmk_context_message(ctx));
    dmk_solver_destroy(&solver);
    dmk_device_destroy(&device);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void same_transports(const dmk_transport *a, const dmk_transport *b)
{
    size_t n;
    dmk_stats s, t;
    dmk_transport_get_stats(a, &s);
    dmk_transport_get_stats(b, &t);
    const double *x = dmk_transport_density(a, &n);
    same_numbers(x, dmk_transport_density(b, NULL), n);
    x = dmk_transport_flux(a, &n);
    same_numbers(x, dmk_transport_flux(b, NULL), n);
    x = dmk_transport_potential_mid(a, &n);
    same_numbers(x, dmk_transport_potential_mid(b, NULL), n);
    same_numbers(&s.cost_upper, &t.cost_upper, 1);
    same_numbers(&s.cost_lower, &t.cost_lower, 1);
    assert_int_equal(s.steps, t.steps);
}

/* Steps on T, too, whose sums go over its vertices. */
static void test_measures(void **state)
{
    dmk_mesh *mesh = surface(*state, "torus", 9000);
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    const double *xyz = dmk_mesh_vertices(mesh);
    double *heap[2];
    dmk_transport *alone = NULL;
    for (int k = 0; k < 2; k++) {
        heap[k] = calloc(info.n_vertices, sizeof *heap[k]);
        for (size_t v = 0; v < info.n_vertices; v++) heap[k][v] = exp(xyz[3 * v + (size_t)k]);
    }
    for (int size = 1; size <= MOST_RANKS; size++) {
        mover movers[MOST_RANKS];
        meeting all = {.size = size};
        for (int k = 0; k < size; k++)
            movers[k] =
                (mover){.mesh = mesh, .heap = {heap[0], heap[1]}, .m = {.all = &all, .rank = k}};
        assert_int_equal(meet(&all, sit_moving, movers, sizeof *movers), 0);
        for (int k = 0; k < size; k++) {
            if (movers[k].rc != DMK_OK) fail_msg("%d of %d: %s", k, size, movers[k].message);
            if (size == 1)
                alone = movers[k].transport;
            else
                same_transports(alone, movers[k].transport);
            if (size > 1) dmk_transport_destroy(&movers[k].transport);
        }
    }
    dmk_transport_destroy(&alone);
    for (int k = 0; k < 2; k++) free(heap[k]);
    dmk_mesh_destroy(&mesh);
}

static void test_wrong_ranks(void **state)
{
    bench *b = *state;
    dmk_solver *solver;
    dmk_mesh *mesh = surface(b, "sphere", 1000);
    const dmk_ranks good = {.size = 1, .exchange = exchange, .gather = gather, .largest = largest};
    dmk_ranks wrong[7];
    for (int i = 0; i < 7; i++) wrong[i] = good;
    wrong[0].size = 0;
    wrong[1].rank = 1;
    wrong[2].rank = -1;
    wrong[3].exchange = NULL;
    wrong[4].largest = NULL;
    wrong[5].gather_below = -1;
    wrong[6].begin = begin;
    bench_ok(b, dmk_solver_create(b->ctx, b->dev, mesh, &solver));
    for (int i = 0; i < 7; i++) {
        assert_int_equal(dmk_solver_set_ranks(b->ctx, solver, &wrong[i]), DMK_E_ARG);
    }
    bench_ok(b, dmk_solver_set_ranks(b->ctx, solver, &good));
    bench_ok(b, dmk_solver_set_ranks(b->ctx, solver, NULL));
    dmk_solver_destroy(&solver);
    dmk_mesh_destroy(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_bits),      cmocka_unit_test(test_usual_levels),
        cmocka_unit_test(test_large_levels),   cmocka_unit_test(test_single_precision),
        cmocka_unit_test(test_explicit_steps), cmocka_unit_test(test_borders),
        cmocka_unit_test(test_small_mesh),     cmocka_unit_test(test_lost_touch),
        cmocka_unit_test(test_needles),        cmocka_unit_test(test_measures),
        cmocka_unit_test(test_wrong_ranks),    cmocka_unit_test(test_density_only),
        cmocka_unit_test(test_at_once),
    };
    return cmocka_run_group_tests_name("ranks", tests, bench_setup, bench_teardown);
}
