#include "base/parallel.h"

#include <pthread.h>
#include <stdatomic.h>

/* Items of a loop below which a second thread costs more than it saves: waking it takes some 10
 * microseconds. Each thread gets several ranges where a loop is long enough, so that one that is held
 * up does not hold up all. */
enum { SHORTEST = 4096, RANGES_PER_THREAD = 4 };
/* The same where a body may fail: an item is a cell of a coarse level then, and takes microseconds. Set-up of 273,000
 * triangles takes 98.8 ms, with 64 98.6, with 1,024 99.5, with 4,096 103.3. */
enum { SHORTEST_TRIED = 256 };

int dmk_parallel_threads(const dmk_context *ctx)
{
    return dmk_pool_threads(ctx);
}

/* Run `job` on the context's threads. */
static void run(dmk_context *ctx, dmk_job *job)
{
    struct dmk_pool *pool = job->n_parts > 1 ? dmk_pool_of(ctx) : NULL;
    if (!pool) {
        for (int32_t k = 0; k < job->n_parts; k++) job->part(k, job->data);
        return;
    }
    job->meter = ctx->meter;
    dmk_pool_post(pool, job);
    dmk_pool_finish(pool, job);
}

typedef struct loop {
    int32_t n, n_ranges;
    void (*body)(int32_t, int32_t, void *);
    void *data;
} loop;

static int32_t range_begin(const loop *l, int32_t k)
{
    return dmk_range_begin(l->n, k, l->n_ranges);
}

static void run_range(int32_t k, void *data)
{
    const loop *l = data;
    l->body(range_begin(l, k), range_begin(l, k + 1), l->data);
}

/* Ranges of a loop over n items. */
static int32_t count_ranges(const dmk_context *ctx, int32_t n, int32_t shortest, int per_thread)
{
    int32_t threads = n < 2 * shortest ? 1 : dmk_pool_threads(ctx);
    return threads == 1 ? 1 : dmk_min_i(threads * per_thread, n / shortest);
}

void dmk_parallel(dmk_context *ctx, int32_t n, void (*body)(int32_t begin, int32_t end, void *data),
                  void *data)
{
    loop l = {n, count_ranges(ctx, n, SHORTEST, RANGES_PER_THREAD), body, data};
    run(ctx, &(dmk_job){.part = run_range, .data = &l, .n_parts = l.n_ranges});
}

typedef struct search {
    bool (*bad)(int32_t, void *);
    void *data;
    _Atomic int32_t first; /* n: none yet */
} search;

static void search_range(int32_t begin, int32_t end, void *data)
{
    search *s = data;
    for (int32_t i = begin; i < end; i++) {
        if (!s->bad(i, s->data)) continue;
        int32_t first = s->first;
        while (i < first && !atomic_compare_exchange_weak(&s->first, &first, i)) {
        }
        return;
    }
}

int32_t dmk_parallel_first(dmk_context *ctx, int32_t n, bool (*bad)(int32_t i, void *data),
                           void *data)
{
    search s = {.bad = bad, .data = data};
    atomic_init(&s.first, n);
    dmk_parallel(ctx, n, search_range, &s);
    int32_t first = s.first;
    return first < n ? first : -1;
}

/* Items of a share, by their numbers in it. */
typedef struct share {
    bool (*bad)(int32_t, void *);
    void *data;
    int32_t begin;
} share;

static bool is_bad_of(int32_t i, void *data)
{
    const share *s = data;
    return s->bad(s->begin + i, s->data);
}

int dmk_parallel_first_of(dmk_context *ctx, const dmk_ranks *ranks, int32_t n,
                          bool (*bad)(int32_t i, void *data), void *data, int32_t *first)
{
    share s = {.bad = bad, .data = data};
    if (!ranks || ranks->size < 2) {
        *first = dmk_parallel_first(ctx, n, bad, data);
        return DMK_OK;
    }
    s.begin = dmk_range_begin(n, ranks->rank, ranks->size);
    const int32_t end = dmk_range_begin(n, ranks->rank + 1, ranks->size),
                  i = dmk_parallel_first(ctx, end - s.begin, is_bad_of, &s);
    int32_t left = i < 0 ? 0 : n - (s.begin + i); /* the more, the earlier */
    const int rc = dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &left, 1));
    *first = left == 0 ? -1 : n - left;
    return rc;
}

/* Bodies that may fail. */
typedef struct attempt {
    dmk_context *context;
    int32_t n, n_ranges;
    int (*body)(dmk_context *, int32_t, int32_t, void *);
    int (*piece)(dmk_context *, int32_t, void *); /* where body is NULL */
    void *data;
    pthread_t caller;
    atomic_bool cancelled; /* what has not begun is left out */
    pthread_mutex_t lock;
    int rc;
    int32_t failed; /* the first range that did; its message is the context's */
} attempt;

static int run_body(attempt *a, dmk_context *own, int32_t k)
{
    const loop l = {.n = a->n, .n_ranges = a->n_ranges};
    return a->body ? a->body(own, range_begin(&l, k), range_begin(&l, k + 1), a->data)
                   : a->piece(own, k, a->data);
}

/* On the caller's own thread dmk_poll asks as it does outside. */
static int run_polling(attempt *a, dmk_context *own, int32_t k)
{
    dmk_context *ctx = a->context;
    own->progress = ctx->progress;
    own->progress_user = ctx->progress_user;
    own->stage = ctx->stage;
    own->began = ctx->began;
    own->polled = ctx->polled;
    own->poll_every = ctx->poll_every;
    const int rc = run_body(a, own, k);
    ctx->polled = own->polled;
    return rc;
}

static void attempt_range(int32_t k, void *data)
{
    attempt *a = data;
    dmk_context own;
    if (atomic_load(&a->cancelled)) return;
    dmk_context_lend(a->context, &own);
    const bool is_caller = pthread_equal(pthread_self(), a->caller);
    const int rc = is_caller ? run_polling(a, &own, k) : run_body(a, &own, k);
    if (rc == DMK_OK) return;
    if (rc == DMK_E_CANCELLED) atomic_store(&a->cancelled, true);
    pthread_mutex_lock(&a->lock);
    if (a->rc == DMK_OK || k < a->failed) {
        a->rc = dmk_fail(a->context, rc, "%s", own.message);
        a->failed = k;
    }
    pthread_mutex_unlock(&a->lock);
}

static int run_attempt(dmk_context *ctx, attempt *a)
{
    pthread_mutex_init(&a->lock, NULL);
    atomic_init(&a->cancelled, false);
    a->caller = pthread_self();
    run(ctx, &(dmk_job){.part = attempt_range, .data = a, .n_parts = a->n_ranges});
    pthread_mutex_destroy(&a->lock);
    return a->rc;
}

int dmk_parallel_try(dmk_context *ctx, int32_t n,
                     int (*body)(dmk_context *own, int32_t begin, int32_t end, void *data),
                     void *data)
{
    attempt a = {.context = ctx,
                 .n = n,
                 .n_ranges = count_ranges(ctx, n, SHORTEST_TRIED, 1),
                 .body = body,
                 .data = data};
    return run_attempt(ctx, &a);
}

int dmk_parallel_pieces(dmk_context *ctx, int32_t n,
                        int (*piece)(dmk_context *own, int32_t i, void *data), void *data)
{
    attempt a = {.context = ctx, .n = n, .n_ranges = n, .piece = piece, .data = data};
    return run_attempt(ctx, &a);
}

static void run_task(int32_t k, void *data)
{
    dmk_task *task = data;
    (void)k;
    task->rc = task->work(&task->own, task->data);
}

static void begin(dmk_context *ctx, dmk_task *task, int (*work)(dmk_context *own, void *data),
                  void *data, bool stays)
{
    *task = (dmk_task){.work = work, .data = data, .pool = dmk_pool_of(ctx)};
    dmk_context_lend(ctx, &task->own);
    task->job = (dmk_job){
        .part = run_task, .data = task, .n_parts = 1, .meter = ctx->meter, .stays = stays};
    if (task->pool) dmk_pool_post(task->pool, &task->job);
}

void dmk_task_begin(dmk_context *ctx, dmk_task *task, int (*work)(dmk_context *own, void *data),
                    void *data)
{
    begin(ctx, task, work, data, false);
}

void dmk_task_begin_staying(dmk_context *ctx, dmk_task *task,
                            int (*work)(dmk_context *own, void *data), void *data)
{
    begin(ctx, task, work, data, true);
}

int dmk_task_end(dmk_context *ctx, dmk_task *task, int rc)
{
    if (!task->work) return rc;
    if (task->pool)
        (task->job.stays ? dmk_pool_finish : dmk_pool_finish_helping)(task->pool, &task->job);
    else
        run_task(0, task);
    task->work = NULL;
    if (rc != DMK_OK || task->rc == DMK_OK) return rc;
    return dmk_fail(ctx, task->rc, "%s", task->own.message);
}
