/* Calls that take long ask again and again whether to go on, and end at once when told not to. */
#include "base/base.h"
#include "solving.h"

#include <stdlib.h>
#include <string.h>

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
    int rc = dmk_cut(p->b->ctx, p->mesh, p->result, NULL, &m, &origin);
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

/* The least number of questions is that of the steps that take longest on a million triangles; those of
 * the path's search come as it goes on. */
static const struct {
    const char *stage;
    int (*call)(problem *p);
    int least;
} stages[] = {
    {"locus", locus, 10},
    {"cut", cut, 20},
    {"path", path, 5},
    {"levels", levels, 5},
};

static void long_calls_end_when_told(void **state)
{
    bench *b = *state;
    dmk_surface_options torus;
    dmk_surface_options_init(&torus);
    torus.name = "torus";
    torus.n_triangles = 2000;
    problem p = problem_surface(b, &torus);
    problem_solve(&p);
    b->ctx->poll_every = 0; /* else small meshes are never asked about */
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        question q = {stages[i].stage, 0, -1};
        dmk_context_set_progress(b->ctx, answer, &q);
        assert_int_equal(stages[i].call(&p), DMK_OK);
        if (q.asked < stages[i].least) fail_msg("%s: asked %d times", q.stage, q.asked);
        int n = q.asked, n_stopped = 0, n_tried = 0;
        for (q.stop_at = 0; q.stop_at < n; q.stop_at += 1 + n / 50, n_tried++) {
            q.asked = 0;
            int rc = stages[i].call(&p);
            if (q.asked <= q.stop_at) { /* the caller's thread had less of the work than before */
                assert_int_equal(rc, DMK_OK);
                continue;
            }
            assert_int_equal(rc, DMK_E_CANCELLED);
            assert_int_equal(q.asked, q.stop_at + 1); /* not asked again */
            assert_non_null(strstr(dmk_context_message(b->ctx), q.stage));
            n_stopped++;
        }
        assert_true(2 * n_stopped > n_tried);
        dmk_context_set_progress(b->ctx, NULL, NULL);
        assert_int_equal(stages[i].call(&p), DMK_OK);
    }
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
    assert_int_equal(q.asked, 0); /* no stage, nothing to tell */
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
        cmocka_unit_test(short_calls_only_tell_their_stage),
    };
    return cmocka_run_group_tests_name("cancel", tests, bench_setup, bench_teardown);
}
