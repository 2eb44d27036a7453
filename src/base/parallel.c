/* Threads are started for each loop: 20 microseconds against loops of milliseconds. */
#include "base/parallel.h"

#include <stdatomic.h>
#include <unistd.h>

enum { max_threads = 16, shortest = 4096 };

typedef struct part {
    void (*body)(int32_t, int32_t, void *);
    void *data;
    int32_t begin, end;
} part;

static void *run_part(void *argument)
{
    const part *p = argument;
    p->body(p->begin, p->end, p->data);
    return NULL;
}

void dmk_parallel(int32_t n, void (*body)(int32_t begin, int32_t end, void *data), void *data)
{
    part parts[max_threads];
    pthread_t thread[max_threads];
    bool started[max_threads] = {false};
    long n_parts = sysconf(_SC_NPROCESSORS_ONLN);
    if (n_parts > max_threads) n_parts = max_threads;
    if (n_parts > n / shortest) n_parts = n / shortest;
    if (n_parts < 1) n_parts = 1;
    for (long i = 0; i < n_parts; i++) {
        parts[i] = (part){body, data, (int32_t)(n * (int64_t)i / n_parts),
                          (int32_t)(n * (int64_t)(i + 1) / n_parts)};
    }
    for (long i = 1; i < n_parts; i++) {
        started[i] = pthread_create(&thread[i], NULL, run_part, &parts[i]) == 0;
    }
    run_part(&parts[0]);
    for (long i = 1; i < n_parts; i++) {
        if (started[i]) {
            pthread_join(thread[i], NULL);
        } else {
            run_part(&parts[i]);
        }
    }
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
        int32_t first = atomic_load(&s->first);
        while (i < first && !atomic_compare_exchange_weak(&s->first, &first, i)) {}
        return;
    }
}

int32_t dmk_parallel_first(int32_t n, bool (*bad)(int32_t i, void *data), void *data)
{
    search s = {.bad = bad, .data = data};
    atomic_init(&s.first, n);
    dmk_parallel(n, search_range, &s);
    int32_t first = atomic_load(&s.first);
    return first < n ? first : -1;
}

typedef struct attempt {
    int (*body)(dmk_context *, int32_t, int32_t, void *);
    void *data;
    atomic_int rc;
} attempt;

static void attempt_range(int32_t begin, int32_t end, void *data)
{
    attempt *a = data;
    dmk_context own = {0};
    int none = DMK_OK, rc = a->body(&own, begin, end, a->data);
    if (rc != DMK_OK) atomic_compare_exchange_strong(&a->rc, &none, rc);
}

int dmk_parallel_try(int32_t n,
                     int (*body)(dmk_context *own, int32_t begin, int32_t end, void *data),
                     void *data)
{
    attempt a = {.body = body, .data = data};
    atomic_init(&a.rc, DMK_OK);
    dmk_parallel(n, attempt_range, &a);
    return atomic_load(&a.rc);
}

static void *run_task(void *argument)
{
    dmk_task *task = argument;
    task->rc = task->work(&task->own, task->data);
    return NULL;
}

void dmk_task_begin(dmk_task *task, int (*work)(dmk_context *own, void *data), void *data)
{
    *task = (dmk_task){.work = work, .data = data};
    task->threaded = pthread_create(&task->thread, NULL, run_task, task) == 0;
    if (!task->threaded) run_task(task);
}

int dmk_task_end(dmk_context *ctx, dmk_task *task, int rc)
{
    if (task->threaded) pthread_join(task->thread, NULL);
    if (rc != DMK_OK || task->rc == DMK_OK) return rc;
    return dmk_fail(ctx, task->rc, "%s", task->own.message);
}
