/* A mesh of which no rank has more than a piece: the density of the plain program, to the bit, on any number of
 * ranks; and the first culprit of a mesh that is refused. */
#include "meeting.h"
#include "solving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A mesh as arrays, and what is asked of it. */
typedef struct task {
    int64_t n_vertices, n_triangles;
    const double *xyz;
    const int64_t *triangle;
    int64_t vertex; /* the source, or -1: the point */
    double point[3];
    int32_t gather_below;
    dmk_solve_options options;
} task;

typedef struct seat {
    const task *t;
    member m;
    dmk_result *result;
    dmk_stats stats;
    dmk_traffic traffic;
    dmk_mesh_info info;
    dmk_point source;
    dmk_result *second;
    int rc, second_rc; /* no more than one solve is possible, */
    int moved_rc;      /* and nothing can be moved */
    char message[400];
} seat;

static int64_t first_of(int64_t n, const seat *s, int more)
{
    return n * (s->m.rank + more) / s->m.all->size;
}

static int solve_on(seat *s, dmk_context *ctx, dmk_device **device, dmk_pieces **pieces,
                    dmk_solver **solver)
{
    const task *t = s->t;
    const dmk_ranks ranks = ranks_of(&s->m, t->gather_below);
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    int rc =
        dmk_pieces_create(ctx, &ranks, t->n_vertices, t->xyz + 3 * first_of(t->n_vertices, s, 0),
                          t->n_triangles, t->triangle + 3 * first_of(t->n_triangles, s, 0), pieces);
    if (rc != DMK_OK) return rc;
    dmk_pieces_get_info(*pieces, &s->info);
    rc = t->vertex < 0 ? dmk_pieces_project(ctx, *pieces, t->point, &s->source)
                       : dmk_pieces_vertex_point(ctx, *pieces, t->vertex, &s->source);
    if (rc == DMK_OK) rc = dmk_device_open(ctx, &options, device);
    if (rc == DMK_OK) rc = dmk_solver_create_of_pieces(ctx, *device, pieces, solver);
    if (rc == DMK_OK) {
        dmk_transport *none = NULL;
        const dmk_measure even = {.uniform = 1};
        s->moved_rc = dmk_solve_measures(ctx, *solver, &even, &even, NULL, &none);
    }
    if (rc == DMK_OK) rc = dmk_solve(ctx, *solver, &s->source, &t->options, &s->result);
    if (rc == DMK_OK) dmk_result_get_stats(s->result, &s->stats);
    dmk_solver_get_traffic(*solver, &s->traffic);
    if (rc == DMK_OK && s->traffic.exchanges > 0)
        s->second_rc = dmk_solve(ctx, *solver, &s->source, &t->options, &s->second);
    return rc;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    dmk_device *device = NULL;
    dmk_pieces *pieces = NULL;
    dmk_solver *solver = NULL;
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = solve_on(s, ctx, &device, &pieces, &solver);
    snprintf(s->message, sizeof s->message, "%s", dmk_context_message(ctx));
    dmk_solver_destroy(&solver);
    dmk_pieces_destroy(&pieces);
    dmk_device_destroy(&device);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void sit_all(const task *t, int size, seat seats[MOST_RANKS])
{
    meeting all = {.size = size};
    for (int k = 0; k < size; k++) seats[k] = (seat){.t = t, .m = {.all = &all, .rank = k}};
    assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
}

/* The same of the whole mesh in one process. */
static int solve_whole(bench *b, const task *t, dmk_point *source, dmk_mesh_info *info,
                       dmk_result **result)
{
    int32_t *triangle = malloc(3 * (size_t)t->n_triangles * sizeof *triangle);
    dmk_mesh *mesh = NULL;
    dmk_solver *solver = NULL;
    assert_non_null(triangle);
    for (int64_t i = 0; i < 3 * t->n_triangles; i++) triangle[i] = (int32_t)t->triangle[i];
    int rc = dmk_mesh_create(b->ctx, (size_t)t->n_vertices, t->xyz, (size_t)t->n_triangles,
                             triangle, &mesh);
    free(triangle);
    if (rc != DMK_OK) return rc;
    dmk_mesh_get_info(mesh, info);
    bench_ok(b, t->vertex < 0 ? dmk_mesh_project(b->ctx, mesh, t->point, source)
                              : dmk_mesh_vertex_point(b->ctx, mesh, t->vertex, source));
    bench_ok(b, dmk_solver_create(b->ctx, b->dev, mesh, &solver));
    bench_ok(b, dmk_solve(b->ctx, solver, source, &t->options, result));
    dmk_solver_destroy(&solver);
    dmk_mesh_destroy(&mesh);
    return rc;
}

static void same_results(const dmk_result *a, const dmk_result *b)
{
    size_t n;
    const double *x = dmk_result_density(a, &n);
    assert_memory_equal(x, dmk_result_density(b, NULL), n * sizeof *x);
    x = dmk_result_potential(a, &n);
    assert_memory_equal(x, dmk_result_potential(b, NULL), n * sizeof *x);
    x = dmk_result_potential_mid(a, &n);
    assert_memory_equal(x, dmk_result_potential_mid(b, NULL), n * sizeof *x);
}

/* Every number of ranks against the whole; from two to `dealt` ranks something is sent while the solver runs, with 0
 * never. Of more it depends on the device: a share that is too small for it leaves the whole to each. */
static void try_ranks(bench *b, task *t, int dealt)
{
    seat seats[MOST_RANKS];
    dmk_point source;
    dmk_mesh_info info;
    dmk_result *whole = NULL;
    dmk_stats stats;
    dmk_solve_options_init(&t->options, sizeof t->options);
    t->options.density_only = 1;
    bench_ok(b, solve_whole(b, t, &source, &info, &whole));
    dmk_result_get_stats(whole, &stats);
    for (int size = 1; size <= MOST_RANKS; size++) {
        sit_all(t, size, seats);
        for (int k = 0; k < size; k++) {
            if (seats[k].rc != DMK_OK) print_message("%s\n", seats[k].message);
            assert_int_equal(seats[k].rc, DMK_OK);
            assert_memory_equal(&seats[k].source, &source, sizeof source);
            assert_int_equal(seats[k].info.n_edges, info.n_edges);
            assert_int_equal(seats[k].info.n_components, info.n_components);
            assert_int_equal(seats[k].info.n_border_edges, info.n_border_edges);
            assert_int_equal(seats[k].info.euler, info.euler);
            assert_int_equal(seats[k].stats.steps, stats.steps);
            assert_int_equal(seats[k].stats.cg_iterations, stats.cg_iterations);
            assert_memory_equal(&seats[k].stats.cost_upper, &stats.cost_upper, sizeof(double));
            assert_memory_equal(&seats[k].stats.cost_lower, &stats.cost_lower, sizeof(double));
            const bool shared = seats[k].traffic.exchanges > 0;
            if (dealt == 0 || size <= dealt) assert_true(shared == (dealt > 1 && size > 1));
            for (int i = 0; i < DMK_N_STEEP; i++)
                assert_true(seats[k].stats.steep[i] == stats.steep[i]);
            assert_int_equal(seats[k].moved_rc, DMK_E_ARG);
            assert_int_equal(seats[k].second_rc, shared ? DMK_E_ARG : DMK_OK);
            assert_true((dmk_result_density(seats[k].result, NULL) != NULL) == (k == 0 || !shared));
            if (k == 0 || !shared) same_results(whole, seats[k].result);
            dmk_result_destroy(&seats[k].result);
        }
    }
    dmk_result_destroy(&whole);
}

/* ---- meshes ---------------------------------------------------------------------------------- */

/* The arrays of a task, to be freed. */
typedef struct soup {
    double *xyz;
    int64_t *triangle;
    int64_t n_vertices, n_triangles;
} soup;

static soup body(bench *b, const char *name, size_t n_triangles)
{
    dmk_mesh *mesh;
    dmk_mesh_info info;
    dmk_surface_options options;
    dmk_surface_options_init(&options, sizeof options);
    options.name = name;
    options.n_triangles = n_triangles;
    bench_ok(b, dmk_mesh_surface(b->ctx, &options, &mesh));
    dmk_mesh_get_info(mesh, &info);
    soup s = {.n_vertices = (int64_t)info.n_vertices, .n_triangles = (int64_t)info.n_triangles};
    s.xyz = malloc(3 * info.n_vertices * sizeof *s.xyz);
    s.triangle = malloc(3 * info.n_triangles * sizeof *s.triangle);
    assert_true(s.xyz && s.triangle);
    memcpy(s.xyz, dmk_mesh_vertices(mesh), 3 * info.n_vertices * sizeof *s.xyz);
    for (size_t i = 0; i < 3 * info.n_triangles; i++) s.triangle[i] = dmk_mesh_triangles(mesh)[i];
    dmk_mesh_destroy(&mesh);
    return s;
}

static void soup_free(soup *s)
{
    free(s->xyz);
    free(s->triangle);
}

static task task_of(const soup *s)
{
    return (task){.n_vertices = s->n_vertices,
                  .n_triangles = s->n_triangles,
                  .xyz = s->xyz,
                  .triangle = s->triangle,
                  .vertex = 5,
                  .gather_below = 300};
}

/* Triangles in an order without any sense, so that each rank's range is all over the mesh. */
static void shuffle(soup *s)
{
    uint64_t x = 1;
    for (int64_t t = s->n_triangles - 1; t > 0; t--) {
        int64_t one[3], k;
        x = x * 6364136223846793005u + 1442695040888963407u;
        k = (int64_t)(x >> 33) % (t + 1);
        memcpy(one, s->triangle + 3 * t, sizeof one);
        memcpy(s->triangle + 3 * t, s->triangle + 3 * k, sizeof one);
        memcpy(s->triangle + 3 * k, one, sizeof one);
    }
}

/* ---- tests ------------------------------------------------------------------------------------ */

static void test_closed(void **state)
{
    soup s = body(*state, "quartic", 14000);
    task t = task_of(&s);
    try_ranks(*state, &t, MOST_RANKS);
    soup_free(&s);
}

static void test_shuffled(void **state)
{
    soup s = body(*state, "torus", 9000);
    shuffle(&s);
    task t = task_of(&s);
    t.vertex = -1;
    t.point[0] = 2;
    t.point[2] = 0.3;
    try_ranks(*state, &t, MOST_RANKS);
    soup_free(&s);
}

/* A belt: two borders, and vertices that are in no triangle. */
static void try_borders(bench *b, int n_triangles, int dealt)
{
    soup s = body(b, "quartic", n_triangles);
    int64_t n = 0;
    for (int64_t t = 0; t < s.n_triangles; t++) {
        const int64_t *c = s.triangle + 3 * t;
        if (fabs(s.xyz[3 * c[0] + 2] + s.xyz[3 * c[1] + 2] + s.xyz[3 * c[2] + 2]) > 1.5) continue;
        memmove(s.triangle + 3 * n++, s.triangle + 3 * t, 3 * sizeof *s.triangle);
    }
    s.n_triangles = n;
    task t = task_of(&s);
    t.vertex = s.triangle[3 * (n / 2)];
    try_ranks(b, &t, dealt);
    soup_free(&s);
}

/* The smaller one is too small for four shares on a wide device, which is seen only when they are made. */
static void test_borders(void **state)
{
    try_borders(*state, 12000, 3);
    try_borders(*state, 24000, MOST_RANKS);
}

/* Two bodies, of which the source's is the second and comes in the midst of the first. */
static void test_components(void **state)
{
    soup a = body(*state, "sphere", 6000), c = body(*state, "torus", 9000);
    soup s = {.n_vertices = a.n_vertices + c.n_vertices,
              .n_triangles = a.n_triangles + c.n_triangles};
    s.xyz = malloc(3 * (size_t)s.n_vertices * sizeof *s.xyz);
    s.triangle = malloc(3 * (size_t)s.n_triangles * sizeof *s.triangle);
    assert_true(s.xyz && s.triangle);
    memcpy(s.xyz, a.xyz, 3 * (size_t)a.n_vertices * sizeof *s.xyz);
    for (int64_t i = 0; i < 3 * c.n_vertices; i++) s.xyz[3 * a.n_vertices + i] = c.xyz[i] + 5;
    memcpy(s.triangle, a.triangle, 3 * (size_t)a.n_triangles * sizeof *s.triangle);
    for (int64_t i = 0; i < 3 * c.n_triangles; i++)
        s.triangle[3 * a.n_triangles + i] = c.triangle[i] + a.n_vertices;
    shuffle(&s);
    task t = task_of(&s);
    t.vertex = a.n_vertices + 7;
    try_ranks(*state, &t, MOST_RANKS);
    soup_free(&s);
    soup_free(&a);
    soup_free(&c);
}

/* Here and there triangles are all but flat, one corner on the side between the others: sides are made longer in turn,
 * across ranks too. */
static void test_flat(void **state)
{
    soup s = body(*state, "quartic", 14000);
    uint8_t *moved = calloc((size_t)s.n_vertices, 1);
    assert_non_null(moved);
    for (int64_t t = 0; t < s.n_triangles; t += 100) {
        const int64_t *c = s.triangle + 3 * t;
        if (moved[c[0]] || moved[c[1]] || moved[c[2]]) continue;
        double *x = s.xyz + 3 * c[0];
        const double *y = s.xyz + 3 * c[1], *z = s.xyz + 3 * c[2];
        for (int k = 0; k < 3; k++) x[k] = 0.5 * (y[k] + z[k]) + 1e-5 * (x[k] - y[k]);
        moved[c[0]] = moved[c[1]] = moved[c[2]] = 1;
    }
    free(moved);
    task t = task_of(&s);
    try_ranks(*state, &t, MOST_RANKS);
    soup_free(&s);
}

/* Thin triangles, so many that nothing is made longer, but fewer than make levels without T, which pieces do not
 * have. */
static void test_needles(void **state)
{
    soup s = body(*state, "sphere", 8000);
    for (int64_t v = 0; v < s.n_vertices; v++) {
        /* Rings of vertices move along the meridian to all but the same height. */
        double *x = s.xyz + 3 * v, z = floor(x[2] * 10) / 10;
        if (x[2] < 0) x[2] = z + 1e-7 * (x[2] - z);
    }
    task t = task_of(&s);
    try_ranks(*state, &t, MOST_RANKS);
    soup_free(&s);
}

/* Too small to be dealt out: gathered, and solved by every rank. */
static void test_small(void **state)
{
    soup s = body(*state, "sphere", 900);
    task t = task_of(&s);
    try_ranks(*state, &t, 0);
    soup_free(&s);
}

/* Refused with the words of the whole mesh's checks, by all ranks. */
static void refuse(bench *b, const soup *s)
{
    seat seats[MOST_RANKS];
    task t = task_of(s);
    dmk_point source;
    dmk_mesh_info info;
    dmk_result *whole = NULL;
    assert_int_equal(solve_whole(b, &t, &source, &info, &whole), DMK_E_MESH);
    const char *said = dmk_context_message(b->ctx);
    for (int size = 1; size <= MOST_RANKS; size++) {
        sit_all(&t, size, seats);
        for (int k = 0; k < size; k++) {
            assert_int_equal(seats[k].rc, DMK_E_MESH);
            /* How many triangles to turn over is not counted. */
            const char *end = strstr(said, "; turning");
            const size_t n = end ? (size_t)(end - said) : sizeof seats[k].message;
            if (strncmp(seats[k].message, said, n) != 0)
                print_message("%s\n%s\n", seats[k].message, said);
            assert_int_equal(strncmp(seats[k].message, said, n), 0);
        }
    }
}

static void test_refused(void **state)
{
    bench *b = *state;
    for (int kind = 0; kind < 8; kind++) {
        soup s = body(b, "torus", 2000);
        int64_t *a = s.triangle + 3 * 1500, *c = s.triangle + 3 * 700,
                *last = s.triangle + 3 * (s.n_triangles - 1);
        const int64_t turned = a[0];
        switch (kind) {
        case 0: s.xyz[3 * 600 + 1] = NAN; break;
        case 1: a[1] = s.n_vertices; break;
        case 2: a[1] = a[0]; break;
        case 3: memcpy(a, c, 3 * sizeof *a); break;
        case 4: /* a third triangle at an edge */
            last[0] = c[0];
            last[1] = c[1];
            last[2] = a[2];
            break;
        case 5: a[0] = a[1], a[1] = turned; break;
        case 6: /* two vertices become one */
            for (int64_t i = 0; i < 3 * s.n_triangles; i++)
                if (s.triangle[i] == a[0]) s.triangle[i] = c[0];
            break;
        case 7: memcpy(s.xyz + 3 * a[0], s.xyz + 3 * a[1], 3 * sizeof *s.xyz); break;
        }
        refuse(b, &s);
        soup_free(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed),  cmocka_unit_test(test_shuffled),
        cmocka_unit_test(test_borders), cmocka_unit_test(test_components),
        cmocka_unit_test(test_needles), cmocka_unit_test(test_flat),
        cmocka_unit_test(test_small),   cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests_name("pieces", tests, bench_setup, bench_teardown);
}
