/* The threads of a context, and the jobs they share. For parallel.c and base.c. */
#ifndef DMK_POOL_H
#define DMK_POOL_H

#include "base/base.h"

/* The processors' time of one piece of work among others on the same threads. */
typedef struct dmk_meter {
    _Atomic int64_t nanoseconds;
} dmk_meter;

/* `n_parts` calls of part(k, data), k = 0 .. n_parts - 1, each once and by whoever comes first. It lies
 * with who posted it, who waits for its end. */
typedef struct dmk_job {
    void (*part)(int32_t k, void *data);
    void *data;
    int32_t n_parts, next, done; /* next: the first that nobody has taken */
    dmk_meter *meter;            /* of the context that posts it */
    bool stays;                  /* as long as others work: who helps leaves it */
    struct dmk_job *later;       /* in the pool's list */
} dmk_job;

/* Threads that the context may use, the caller's among them. */
int dmk_pool_threads(const dmk_context *context);
/* The context's pool, started at its first call; NULL where there is only one thread. */
struct dmk_pool *dmk_pool_of(dmk_context *context);
/* Make `own` a context for work on another thread within a call on `context`: it shares the pool, says
 * nothing of progress, and need not be destroyed. */
void dmk_context_lend(dmk_context *context, dmk_context *own);
/* work(context, data) by the meter's count, on this thread and, of the jobs it posts, on others. */
int dmk_metered(dmk_context *context, dmk_meter *meter,
                int (*work)(dmk_context *context, void *data), void *data);
/* Offer the job to the pool's threads. */
void dmk_pool_post(struct dmk_pool *pool, dmk_job *job);
/* Do what nobody has taken of the job, and wait for the rest. */
void dmk_pool_finish(struct dmk_pool *pool, dmk_job *job);
/* The same, and meanwhile parts of other jobs: a long one has posted them, most likely. They may end later. */
void dmk_pool_finish_helping(struct dmk_pool *pool, dmk_job *job);
void dmk_pool_destroy(struct dmk_pool **pool);

#endif
