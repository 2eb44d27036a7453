/* Threads are started for each loop: 20 microseconds against loops of milliseconds. */
#include "base/parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
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
