/* The pool: what is done, by how many threads, and what a failure says. */
#include "base/crew.h"

#include <pthread.h>
#include <unistd.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

enum { N = 100000, MOST_SEEN = 64 };

/* How often each item was met, and by which threads. */
typedef struct record {
    dmk_context *ctx;
    _Atomic uint8_t met[N];
    pthread_mutex_t lock;
    pthread_t seen[MOST_SEEN];
    int n_seen;
} record;

static record *record_create(int threads)
{
    record *r = calloc(1, sizeof *r);
    assert_non_null(r);
    assert_int_equal(dmk_context_create(&r->ctx), DMK_OK);
    assert_int_equal(dmk_context_set_threads(r->ctx, threads), DMK_OK);
    pthread_mutex_init(&r->lock, NULL);
    return r;
}

static void record_free(record *r)
{
    dmk_context_destroy(&r->ctx);
    pthread_mutex_destroy(&r->lock);
    free(r);
}

static void see(record *r)
{
    pthread_mutex_lock(&r->lock);
    int i = 0;
    while (i < r->n_seen && !pthread_equal(r->seen[i], pthread_self())) i++;
    if (i == r->n_seen && r->n_seen < MOST_SEEN) r->seen[r->n_seen++] = pthread_self();
    pthread_mutex_unlock(&r->lock);
}

static void rest(void)
{
    nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
}

static void meet(int32_t begin, int32_t end, void *data)
{
    record *r = data;
    see(r);
    for (int32_t i = begin; i < end; i++) r->met[i]++;
    rest(); /* so that others come as well */
}

static void assert_met(const record *r, int32_t n, int times)
{
    for (int32_t i = 0; i < n; i++) assert_int_equal(r->met[i], times);
}

static void test_each_item_once(void **state)
{
    (void)state;
    const int32_t length[] = {0, 1, 4095, 8191, 8192, 12345, N};
    for (int threads = 0; threads <= 5; threads++) {
        for (size_t k = 0; k < sizeof length / sizeof *length; k++) {
            record *r = record_create(threads);
            dmk_parallel(r->ctx, length[k], meet, r);
            assert_met(r, length[k], 1);
            record_free(r);
        }
    }
}

static void test_as_many_threads_as_asked(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 4; threads++) {
        record *r = record_create(threads);
        assert_int_equal(dmk_parallel_threads(r->ctx), threads);
        for (int i = 0; i < 5; i++) dmk_parallel(r->ctx, N, meet, r);
        assert_met(r, N, 5);
        assert_int_equal(r->n_seen, threads);
        record_free(r);
    }
}

/* Two loops and a task at a time do not take more threads than there are. */
static int loop_within(dmk_context *own, void *data)
{
    dmk_parallel(own, N, meet, data);
    return DMK_OK;
}

static void test_loops_in_tasks_share_the_threads(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 3; threads++) {
        record *r = record_create(threads), *other = record_create(threads);
        dmk_task task, second;
        dmk_task_begin(r->ctx, &task, loop_within, r);
        dmk_task_begin(r->ctx, &second, loop_within, other);
        dmk_parallel(r->ctx, N, meet, r);
        assert_int_equal(dmk_task_end(r->ctx, &second, DMK_OK), DMK_OK);
        assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_OK);
        assert_met(r, N, 2);
        assert_met(other, N, 1);
        for (int i = 0; i < other->n_seen; i++) { /* count both records' threads in one */
            int k = 0;
            while (k < r->n_seen && !pthread_equal(r->seen[k], other->seen[i])) k++;
            if (k == r->n_seen) r->seen[r->n_seen++] = other->seen[i];
        }
        assert_in_range(r->n_seen, 1, threads);
        record_free(other);
        record_free(r);
    }
}

static bool is_bad(int32_t i, void *data)
{
    const int32_t *bad = data;
    return i == bad[0] || i == bad[1];
}

static void test_the_first_culprit(void **state)
{
    (void)state;
    record *r = record_create(4);
    assert_int_equal(dmk_parallel_first(r->ctx, N, is_bad, (int32_t[]){99999, 60000}), 60000);
    assert_int_equal(dmk_parallel_first(r->ctx, N, is_bad, (int32_t[]){0, 60000}), 0);
    assert_int_equal(dmk_parallel_first(r->ctx, N, is_bad, (int32_t[]){N, -1}), -1);
    record_free(r);
}

/* All ranges but the first fail, the last at once. */
static int fail_late(dmk_context *own, int32_t begin, int32_t end, void *data)
{
    (void)data;
    if (begin == 0) return DMK_OK;
    if (end < N) rest();
    return dmk_fail(own, end < N ? DMK_E_MESH : DMK_E_LIMIT, "from %d", begin);
}

static int fail_task(dmk_context *own, void *data)
{
    (void)data;
    return dmk_fail(own, DMK_E_IO, "the task's words");
}

static void test_failures_tell_of_the_first(void **state)
{
    (void)state;
    dmk_task task;
    record *r = record_create(4);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(dmk_parallel_try(r->ctx, N, fail_late, NULL), DMK_E_MESH);
        assert_string_equal(dmk_context_message(r->ctx), "from 25000");
    }
    dmk_task_begin(r->ctx, &task, fail_task, NULL);
    assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_E_IO);
    assert_string_equal(dmk_context_message(r->ctx), "the task's words");
    dmk_task_begin(r->ctx, &task, fail_task, NULL);
    int rc = dmk_task_end(r->ctx, &task, dmk_fail(r->ctx, DMK_E_ARG, "the caller's"));
    assert_int_equal(rc, DMK_E_ARG);
    assert_string_equal(dmk_context_message(r->ctx), "the caller's");
    assert_int_equal(dmk_context_set_threads(r->ctx, -1), DMK_E_ARG);
    record_free(r);
}

static int count_range(dmk_context *own, int32_t begin, int32_t end, void *data)
{
    _Atomic int *n = data;
    (void)own;
    *n += begin < end;
    return DMK_OK;
}

/* A cell of a coarse level is worth a thread from fewer on than a number is. */
static void test_short_tries_are_not_shared(void **state)
{
    (void)state;
    record *r = record_create(2);
    const int32_t length[] = {511, 512, 513};
    const int wanted[] = {1, 2, 2};
    for (int i = 0; i < 3; i++) {
        _Atomic int n = 0;
        assert_int_equal(dmk_parallel_try(r->ctx, length[i], count_range, &n), DMK_OK);
        assert_int_equal(n, wanted[i]);
    }
    record_free(r);
}

static void test_a_task_ends_once(void **state)
{
    (void)state;
    record *r = record_create(2);
    dmk_task task = {0};
    assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_OK);
    assert_int_equal(dmk_task_end(r->ctx, &task, DMK_E_ARG), DMK_E_ARG);
    dmk_task_begin(r->ctx, &task, fail_task, NULL);
    assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_E_IO);
    assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_OK);
    record_free(r);
}

/* ---- crews ---------------------------------------------------------------------------------- */

enum { ROUNDS = 1000 };

typedef struct rounds {
    int32_t number;              /* of the round, written between rounds */
    int32_t met[DMK_MOST_PARTS]; /* the round in which each part was met last */
    _Atomic bool twice, late;    /* a part met twice; one of another round */
    _Atomic int by_others;
    pthread_t caller;
} rounds;

static void meet_part(int32_t k, void *data)
{
    rounds *r = data;
    if (r->met[k] == r->number) r->twice = true;
    if (r->met[k] > r->number) r->late = true;
    r->met[k] = r->number;
    if (!pthread_equal(pthread_self(), r->caller)) r->by_others++;
}

/* Each part once in each round, whatever the number of threads, and never behind the round's end. */
static void test_crews_do_each_part_once(void **state)
{
    static const int32_t n_parts[4] = {1, 2, 7, DMK_MOST_PARTS};
    (void)state;
    for (int i = 0; i < 24; i++) {
        const int threads = 1 + i / 4, n = n_parts[i % 4];
        record *r = record_create(threads);
        rounds all = {.number = 0, .caller = pthread_self()};
        dmk_crew crew;
        dmk_crew_begin(r->ctx, &crew, n, meet_part, &all);
        assert_int_equal(crew.n_members, threads < DMK_MOST_CREW ? threads : DMK_MOST_CREW);
        for (all.number = 1; all.number <= ROUNDS; all.number++) {
            dmk_crew_round(&crew);
            for (int32_t k = 0; k < n; k++) assert_int_equal(all.met[k], all.number);
        }
        dmk_crew_end(r->ctx, &crew);
        assert_false(all.twice || all.late);
        if (threads == 1) assert_int_equal(all.by_others, 0);
        record_free(r);
    }
}

/* The parts of members that never come are done too. */
static void test_crews_do_without(void **state)
{
    (void)state;
    record *r = record_create(1);
    rounds all = {.caller = pthread_self()};
    dmk_crew crew;
    dmk_crew_begin(r->ctx, &crew, 7, meet_part, &all);
    crew.n_members = 3;
    alarm(20); /* or the round waits for ever */
    for (all.number = 1; all.number <= 5; all.number++) {
        dmk_crew_round(&crew);
        for (int32_t k = 0; k < 7; k++) assert_int_equal(all.met[k], all.number);
    }
    alarm(0);
    crew.n_members = 1;
    dmk_crew_end(r->ctx, &crew);
    record_free(r);
}

static void rest_part(int32_t k, void *data)
{
    (void)k;
    see(data);
    rest();
}

/* Other threads come, and end with the crew. */
static void test_crews_share(void **state)
{
    (void)state;
    record *r = record_create(3);
    dmk_crew crew;
    dmk_crew_begin(r->ctx, &crew, 12, rest_part, r);
    for (int i = 0; i < 50; i++) dmk_crew_round(&crew);
    dmk_crew_end(r->ctx, &crew);
    assert_int_equal(r->n_seen, 3);
    record_free(r);
}

/* ---- who waits for a task --------------------------------------------------------------------- */

typedef struct encounter {
    _Atomic int begun, inside;
    bool alone; /* for five seconds */
} encounter;

/* Waits for the other piece to come. */
static int meet_once(dmk_context *own, int32_t i, void *data)
{
    encounter *m = data;
    const time_t late = time(NULL) + 5;
    (void)own;
    (void)i;
    atomic_fetch_add(&m->inside, 1);
    while (atomic_load(&m->inside) < 2 && time(NULL) < late) continue;
    if (time(NULL) >= late) m->alone = true;
    return DMK_OK;
}

static int meet_within(dmk_context *own, void *data)
{
    encounter *m = data;
    atomic_store(&m->begun, 1);
    return dmk_parallel_pieces(own, 2, meet_once, m);
}

/* The only other thread does the task, whose loop is offered to the one that waits. */
static void test_who_waits_for_a_task_helps(void **state)
{
    record *r = record_create(2);
    (void)state;
    for (int k = 0; k < 50; k++) {
        encounter m = {.alone = false};
        dmk_task task;
        dmk_task_begin(r->ctx, &task, meet_within, &m);
        while (!atomic_load(&m.begun)) continue;
        assert_int_equal(dmk_task_end(r->ctx, &task, DMK_OK), DMK_OK);
        assert_false(m.alone);
    }
    record_free(r);
}

static int64_t processor_time(clockid_t clock)
{
    struct timespec t;
    assert_int_equal(clock_gettime(clock, &t), 0);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

enum { BURNT = 10000000 }; /* nanoseconds */

/* So much of this thread's time. */
static void burn(int32_t k, void *data)
{
    const int64_t end = processor_time(CLOCK_THREAD_CPUTIME_ID) + BURNT;
    (void)k;
    (void)data;
    while (processor_time(CLOCK_THREAD_CPUTIME_ID) < end) continue;
}

static int burn_piece(dmk_context *own, int32_t k, void *data)
{
    (void)own;
    burn(k, data);
    return DMK_OK;
}

static int burn_twice(dmk_context *own, int32_t k, void *data)
{
    (void)k;
    return dmk_parallel_pieces(own, 2, burn_piece, data);
}

typedef struct fire {
    dmk_meter outer, inner;
} fire;

static int burn_once(dmk_context *own, void *data)
{
    (void)own;
    burn(0, data);
    return DMK_OK;
}

static int burn_task(dmk_context *own, void *data)
{
    fire *f = data;
    return dmk_metered(own, &f->inner, burn_once, f);
}

/* Four pieces of two each, and beside them a task with a meter of its own. */
static int burn_all(dmk_context *own, void *data)
{
    dmk_task task;
    dmk_task_begin(own, &task, burn_task, data);
    return dmk_task_end(own, &task, dmk_parallel_pieces(own, 4, burn_twice, data));
}

static void test_meters_count_what_is_theirs(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 3; threads++) {
        fire f = {.outer = {0}};
        record *r = record_create(threads);
        const int64_t before = processor_time(CLOCK_PROCESS_CPUTIME_ID);
        assert_int_equal(dmk_metered(r->ctx, &f.outer, burn_all, &f), DMK_OK);
        burn(0, NULL); /* is nobody's */
        const int64_t all = processor_time(CLOCK_PROCESS_CPUTIME_ID) - before;
        assert_true(f.outer.nanoseconds >= 8 * BURNT && f.inner.nanoseconds >= BURNT);
        assert_true(f.outer.nanoseconds + f.inner.nanoseconds <= all - BURNT);
        assert_null(r->ctx->meter);
        record_free(r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_item_once),
        cmocka_unit_test(test_as_many_threads_as_asked),
        cmocka_unit_test(test_loops_in_tasks_share_the_threads),
        cmocka_unit_test(test_the_first_culprit),
        cmocka_unit_test(test_failures_tell_of_the_first),
        cmocka_unit_test(test_short_tries_are_not_shared),
        cmocka_unit_test(test_a_task_ends_once),
        cmocka_unit_test(test_crews_do_each_part_once),
        cmocka_unit_test(test_crews_do_without),
        cmocka_unit_test(test_crews_share),
        cmocka_unit_test(test_who_waits_for_a_task_helps),
        cmocka_unit_test(test_meters_count_what_is_theirs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
