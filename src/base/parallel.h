/* Loops and tasks on the host's threads: one pool for each context, of dmk_context_set_threads threads
 * with the caller's. Contexts handed to bodies and tasks share it, so loops within tasks, and loops
 * within loops, use the threads that are free, and no more. */
#ifndef DMK_PARALLEL_H
#define DMK_PARALLEL_H

#include "base/pool.h"

/* Where range k of n_ranges begins; range n_ranges, where 0..n ends. */
static inline int32_t dmk_range_begin(int32_t n, int32_t k, int32_t n_ranges)
{
    return (int32_t)dmk_even_bound(n, k, n_ranges);
}

/* Call body(begin, end, data) on disjoint ranges that cover 0..n; short loops stay on the calling
 * thread. The result must not depend on how the range is cut. */
void dmk_parallel(dmk_context *context, int32_t n,
                  void (*body)(int32_t begin, int32_t end, void *data), void *data);

/* The smallest i in 0..n with bad(i, data), or -1: a check of many items that names the first culprit. */
int32_t dmk_parallel_first(dmk_context *context, int32_t n, bool (*bad)(int32_t i, void *data),
                           void *data);

/* The same with all ranks that have the same items: each looks at its even share of them. Collective. */
int dmk_parallel_first_of(dmk_context *context, const dmk_ranks *ranks, int32_t n,
                          bool (*bad)(int32_t i, void *data), void *data, int32_t *first);

/* dmk_parallel for a body that may fail, with a context of its own for each range, since a context
 * serves one thread at a time. There are at most as many ranges as threads, so that a range can have
 * working space of its own. DMK_OK, or the status of the first range that failed with its message in
 * `context`. A range that the calling thread takes may dmk_poll its own context; once it is told to stop, no range
 * begins. */
int dmk_parallel_try(dmk_context *context, int32_t n,
                     int (*body)(dmk_context *own, int32_t begin, int32_t end, void *data),
                     void *data);

/* The same for `n` pieces of work of any size, one range for each: pieces are long, so that even two of
 * them are worth two threads. */
int dmk_parallel_pieces(dmk_context *context, int32_t n,
                        int (*piece)(dmk_context *own, int32_t i, void *data), void *data);

/* Threads of the context's pool, the caller's among them. */
int dmk_parallel_threads(const dmk_context *context);

/* One piece of work beside the caller's, by a thread of the pool that is free, or within dmk_task_end. Threads take
 * the last offer first, so a loop that the caller begins meanwhile goes before the task: let the task be what has
 * loops. It and its data must outlive the work: every begin needs its end. One of zeros has not begun, and its end is
 * nothing. */
typedef struct dmk_task {
    int (*work)(dmk_context *own, void *data);
    void *data;
    dmk_context own;
    int rc;
    struct dmk_pool *pool; /* NULL: nobody else will */
    dmk_job job;
} dmk_task;

void dmk_task_begin(dmk_context *context, dmk_task *task, int (*work)(dmk_context *own, void *data),
                    void *data);
/* That stays as long as others work: who waits for another task and does what there is to do meanwhile does not take
 * it. */
void dmk_task_begin_staying(dmk_context *context, dmk_task *task,
                            int (*work)(dmk_context *own, void *data), void *data);
/* Wait for it, doing meanwhile what others offer, or do it if nobody has begun. `rc` is what the caller's work came
 * to: that, if it failed; else the task's status, with its message in `context`. */
int dmk_task_end(dmk_context *context, dmk_task *task, int rc);

#endif
