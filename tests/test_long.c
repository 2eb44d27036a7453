/* Long runs: memory that stays flat over many solves in one process, and many threads at once, each
 * with a context, a device, a mesh and a solver of its own. DMKCL_LONG=N solves N times (1000 in
 * `make check-long`). */
#include "solving.h"

#include <malloc.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static const char mesh_file[] = "tests/data/sphere_1280.off";

static int n_solves(void)
{
    const char *text = getenv("DMKCL_LONG");
    return text ? atoi(text) : 120;
}

/* Resident bytes of this process. */
static size_t resident(void)
{
    unsigned long all, here;
    malloc_trim(0);
    FILE *file = fopen("/proc/self/statm", "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%lu %lu", &all, &here), 2);
    fclose(file);
    return here * (size_t)sysconf(_SC_PAGESIZE);
}

/* Sanitizers keep freed memory for a while, and shadows of it. */
#if defined __SANITIZE_ADDRESS__ || defined __SANITIZE_THREAD__
static const bool resident_counts = false;
#else
static const bool resident_counts = true;
#endif

/* Resident memory has not grown since it was `before`; each of n leaks of one solve's mesh, 1280
 * triangles, would add some 200 kB. */
static void assert_flat(size_t before, int n)
{
    size_t after = resident(), growth = after > before ? after - before : 0;
    print_message("# %d runs: %zu kB, then %zu kB\n", n, before / 1024, after / 1024);
    if (resident_counts && growth > 4096u * 1024) {
        fail_msg("memory grew by %zu kB in %d runs", growth / 1024, n);
    }
}

/* Everything a program makes and gives back for one solve, by turns with all methods. */
static void solve_and_give_back(bench *b, int k)
{
    static const dmk_method methods[] = {DMK_NEWTON, DMK_NEWTON, DMK_INERTIAL};
    dmk_locus_options options;
    dmk_locus *locus = NULL;
    problem p = problem_file(b, mesh_file);
    p.options.method = methods[k % 3];
    bench_ok(b, dmk_mesh_vertex_point(b->ctx, p.mesh, k % 642, &p.source));
    problem_solve(&p);
    dmk_locus_options_init(&options, sizeof options);
    bench_ok(b, dmk_locus_compute(b->ctx, p.mesh, p.result, &options, &locus));
    dmk_locus_destroy(&locus);
    problem_free(&p);
}

static void memory_stays_flat(void **state)
{
    const int n = n_solves(), warm = 20;
    size_t before = 0;
    for (int k = 0; k < warm + n; k++) {
        if (k == warm) before = resident();
        solve_and_give_back(*state, k);
    }
    assert_flat(before, n);
}

/* A solver that is kept, with many sources. */
static void memory_stays_flat_with_one_solver(void **state)
{
    const int n = n_solves(), warm = 20;
    size_t before = 0;
    problem p = problem_file(*state, mesh_file);
    for (int k = 0; k < warm + n; k++) {
        if (k == warm) before = resident();
        bench_ok(p.b, dmk_mesh_vertex_point(p.b->ctx, p.mesh, k % 642, &p.source));
        problem_solve(&p);
    }
    assert_flat(before, n);
    problem_free(&p);
}

/* Failures give back what they took. */
static void memory_stays_flat_over_failures(void **state)
{
    const int n = n_solves(), warm = 20;
    size_t before = 0;
    bench *b = *state;
    for (int k = 0; k < warm + n; k++) {
        if (k == warm) before = resident();
        problem p = problem_file(b, mesh_file);
        dmk_mesh *none = NULL;
        p.options.start = DMK_START_UNIFORM;
        p.options.max_steps = 1;
        assert_int_equal(problem_try(&p), DMK_E_LIMIT);
        p.source.triangle = -1;
        assert_int_equal(problem_try(&p), DMK_E_ARG);
        assert_int_not_equal(dmk_mesh_read(b->ctx, "tests/data/torus_samples.txt", &none), DMK_OK);
        assert_null(none);
        problem_free(&p);
    }
    assert_flat(before, n);
}

/* ---- eight threads ---------------------------------------------------------------------------- */

enum { N_THREADS = 8, N_VERTICES = 642 };

typedef struct job {
    pthread_t thread;
    int number, n_solves;
    const char *failed;          /* the call, or NULL */
    double distance[N_VERTICES]; /* of the last solve, from vertex 0 */
} job;

/* No assertion here: cmocka's belong to the main thread. */
static void *work(void *data)
{
    job *j = data;
    dmk_context *ctx = NULL;
    dmk_device *device = NULL;
    dmk_device_options options;
    dmk_solve_options solve;
    dmk_device_options_init(&options, sizeof options);
    dmk_solve_options_init(&solve, sizeof solve);
    if (dmk_context_create(&ctx) != DMK_OK)
        j->failed = "context";
    else if (dmk_device_open(ctx, &options, &device) != DMK_OK)
        j->failed = "device";
    for (int k = j->n_solves; !j->failed && k >= 0; k--) {
        dmk_mesh *mesh = NULL;
        dmk_solver *solver = NULL;
        dmk_result *result = NULL;
        dmk_point source;
        if (dmk_mesh_read(ctx, mesh_file, &mesh) != DMK_OK)
            j->failed = "mesh";
        else if (dmk_solver_create(ctx, device, mesh, &solver) != DMK_OK)
            j->failed = "solver";
        else if (dmk_mesh_vertex_point(ctx, mesh, (k * (j->number + 1)) % N_VERTICES, &source) !=
                 DMK_OK)
            j->failed = "source";
        else if (dmk_solve(ctx, solver, &source, &solve, &result) != DMK_OK)
            j->failed = "solve";
        else
            memcpy(j->distance, dmk_result_distance(result, NULL), sizeof j->distance);
        dmk_result_destroy(&result);
        dmk_solver_destroy(&solver);
        dmk_mesh_destroy(&mesh);
    }
    dmk_device_destroy(&device);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void threads_do_not_meet(void **state)
{
    static job alone, jobs[N_THREADS];
    (void)state;
    alone.n_solves = 0;
    work(&alone);
    if (alone.failed) fail_msg("%s failed", alone.failed);
    for (int i = 0; i < N_THREADS; i++) {
        jobs[i].number = i;
        jobs[i].n_solves = getenv("DMKCL_LONG") ? n_solves() / N_THREADS : 4;
        assert_int_equal(pthread_create(&jobs[i].thread, NULL, work, &jobs[i]), 0);
    }
    for (int i = 0; i < N_THREADS; i++) pthread_join(jobs[i].thread, NULL);
    for (int i = 0; i < N_THREADS; i++) {
        if (jobs[i].failed) fail_msg("thread %d: %s failed", i, jobs[i].failed);
        assert_memory_equal(jobs[i].distance, alone.distance, sizeof alone.distance);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_stays_flat),
        cmocka_unit_test(memory_stays_flat_with_one_solver),
        cmocka_unit_test(memory_stays_flat_over_failures),
        cmocka_unit_test(threads_do_not_meet),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
