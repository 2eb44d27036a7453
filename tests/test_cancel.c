/* Calls that take long ask again and again whether to go on, and end at once when asked to. */
#include "base/base.h"
#include "solving.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct question {
    const char *stage;
    int asked, stop_at; /* -1: never */
} question;

static int answer(const dmk_progress *progress, void *user)
{
    question *q = user;
    if (strcmp(progress->stage, q->stage) != 0) return 0;
    return q->asked++ == q->stop_at;
}

static int locus(problem *p)
{
    dmk_locus *l = NULL;
    int rc = dmk_locus_compute(p->b->ctx, p->mesh, p->result, NULL, &l);
    assert_true((rc == DMK_OK) == (l != NULL));
    dmk_locus_destroy(&l);
    return rc;
}

static int cut(problem *p)
{
    dmk_mesh *m = NULL;
    int32_t *origin = NULL;
    int rc = dmk_cut(p->b->ctx, p->mesh, p->result, NULL, &m, &origin, NULL);
    assert_true((rc == DMK_OK) == (m != NULL) && (rc == DMK_OK) == (origin != NULL));
    dmk_mesh_destroy(&m);
    free(origin);
    return rc;
}

static int path(problem *p)
{
    dmk_path line = {0};
    dmk_point end;
    bench_ok(p->b, dmk_mesh_project(p->b->ctx, p->mesh, (double[3]){-1, 1, 0.5}, &end));
    int rc = dmk_path_compute(p->b->ctx, p->mesh, p->result, 1, &end, &line);
    assert_true((rc == DMK_OK) == (line.n > 0));
    dmk_path_free(&line);
    return rc;
}

static int levels(problem *p)
{
    dmk_solver_destroy(&p->solver);
    bench_ok(p->b, dmk_solver_create(p->b->ctx, p->b->dev, p->mesh, &p->solver));
    return problem_try(p);
}

/* A file of the test's own. */
static const char *file_name(void)
{
    static char name[64];
    snprintf(name, sizeof name, "/tmp/dmkcl-cancel-%d.off", (int)getpid());
    return name;
}

static int reading(problem *p)
{
    dmk_mesh *m = NULL;
    int rc = dmk_mesh_read(p->b->ctx, file_name(), &m);
    assert_true((rc == DMK_OK) == (m != NULL));
    dmk_mesh_destroy(&m);
    return rc;
}

static int mending(problem *p)
{
    dmk_mesh *m = NULL;
    dmk_repairs did = {0};
    int rc = dmk_mesh_read_repaired(p->b->ctx, file_name(), &did, &m);
    assert_true((rc == DMK_OK) == (m != NULL));
    dmk_repairs_free(&did);
    dmk_mesh_destroy(&m);
    return rc;
}

static int sampling(problem *p)
{
    int64_t vertex[8];
    return dmk_mesh_sample(p->b->ctx, p->mesh, 8, 0, vertex);
}

/* 2,500 points, in pieces. */
static int projecting(problem *p)
{
    enum { N = 2500 };
    double *xyz = calloc(3 * N, sizeof *xyz);
    dmk_point *point = calloc(N, sizeof *point);
    assert_true(xyz && point);
    for (int i = 0; i < N; i++) xyz[3 * i] = 3 + 0.01 * i;
    int rc = dmk_mesh_project_all(p->b->ctx, p->mesh, N, xyz, point);
    free(xyz);
    free(point);
    return rc;
}

/* What is not written to its end is not there. */
static int writing(problem *p)
{
    unlink(file_name());
    int rc = dmk_mesh_write(p->b->ctx, p->mesh, file_name());
    assert_true((rc == DMK_OK) == (access(file_name(), F_OK) == 0));
    return rc;
}

/* The least number of questions is that of the steps that take longest on a million triangles; those of
 * the path's search come as it goes on. */
static const struct {
    const char *stage;
    int (*call)(problem *p);
    int least;
    bool chance; /* has threads of its own: how many questions there are is never the same */
} stages[] = {
    {"locus", locus, 5, false},        {"cut", cut, 10, false},
    {"path", path, 2, false},          {"levels", levels, 5, false},
    {"write", writing, 2, false},      {"read", reading, 6, false},
    {"repair", mending, 6, false},     {"sample", sampling, 7, false},
    {"project", projecting, 4, false},
};

static problem small_torus(bench *b)
{
    dmk_surface_options torus;
    dmk_surface_options_init(&torus, sizeof torus);
    torus.name = "torus";
    torus.n_triangles = 2000;
    problem p = problem_surface(b, &torus);
    problem_solve(&p);
    b->ctx->poll_every = 0; /* else small meshes are never asked about */
    return p;
}

/* Stop the call at question `stop_at`: true if it came so far. */
static bool stop(problem *p, size_t stage, int stop_at)
{
    bench *b = p->b;
    question q = {stages[stage].stage, 0, stop_at};
    dmk_context_set_progress(b->ctx, answer, &q);
    int rc = stages[stage].call(p);
    dmk_context_set_progress(b->ctx, NULL, NULL);
    if (q.asked <= stop_at) {
        assert_int_equal(rc, DMK_OK);
        return false;
    }
    assert_int_equal(rc, DMK_E_CANCELLED);
    assert_int_equal(q.asked, stop_at + 1); /* not asked again */
    assert_non_null(strstr(dmk_context_message(b->ctx), q.stage));
    return true;
}

/* With one thread the questions are the same in each run. */
static void long_calls_end_when_told(void **state)
{
    bench *b = *state;
    problem p = small_torus(b);
    bench_ok(b, dmk_context_set_threads(b->ctx, 1));
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        question q = {stages[i].stage, 0, -1};
        dmk_context_set_progress(b->ctx, answer, &q);
        assert_int_equal(stages[i].call(&p), DMK_OK);
        dmk_context_set_progress(b->ctx, NULL, NULL);
        if (q.asked < stages[i].least) fail_msg("%s: asked %d times", q.stage, q.asked);
        for (int at = 0; at < q.asked; at += 1 + q.asked / 50)
            assert_true(stop(&p, i, at) || stages[i].chance);
        assert_true(!stop(&p, i, q.asked) || stages[i].chance);
        assert_int_equal(stages[i].call(&p), DMK_OK);
    }
    bench_ok(b, dmk_context_set_threads(b->ctx, 0));
    b->ctx->poll_every = 0.05;
    unlink(file_name());
    problem_free(&p);
}

/* With several, how many come to the caller's thread is a matter of chance; the first always does. */
static void several_threads_end_too(void **state)
{
    bench *b = *state;
    problem p = small_torus(b);
    bench_ok(b, dmk_context_set_threads(b->ctx, 4));
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        assert_true(stop(&p, i, 0));
        for (int at = 1; at < 40; at += 3) stop(&p, i, at);
        assert_int_equal(stages[i].call(&p), DMK_OK);
    }
    bench_ok(b, dmk_context_set_threads(b->ctx, 0));
    b->ctx->poll_every = 0.05;
    unlink(file_name());
    problem_free(&p);
}

/* On its own a question comes each 50 ms: none within a stage that is over sooner. */
static void short_calls_only_tell_their_stage(void **state)
{
    (void)state;
    question q = {"locus", 0, -1};
    dmk_context *ctx;
    assert_int_equal(dmk_context_create(&ctx), DMK_OK);
    dmk_context_set_progress(ctx, answer, &q);
    assert_int_equal(dmk_poll(ctx), DMK_OK);
    assert_int_equal(q.asked, 0); /* no stage, nothing to report */
    assert_int_equal(dmk_stage_begin(ctx, "locus"), DMK_OK);
    assert_int_equal(q.asked, 1);
    ctx->poll_every = 1e9;
    for (int i = 0; i < 100; i++) assert_int_equal(dmk_poll(ctx), DMK_OK);
    assert_int_equal(q.asked, 1);
    dmk_stage_end(ctx);
    ctx->poll_every = 0;
    assert_int_equal(dmk_poll(ctx), DMK_OK);
    assert_int_equal(q.asked, 1);
    dmk_context_destroy(&ctx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(long_calls_end_when_told),
        cmocka_unit_test(several_threads_end_too),
        cmocka_unit_test(short_calls_only_tell_their_stage),
    };
    return cmocka_run_group_tests_name("cancel", tests, bench_setup, bench_teardown);
}
