/* Threads that wait for jobs. Whoever posts a job works on it too, so a job ends even if no thread of
 * the pool is free or could be started, and jobs within jobs cannot wait for each other in a ring. */
#include "base/pool.h"

#include <pthread.h>
#include <sched.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

enum { MOST_THREADS = 256 };

struct dmk_pool {
    pid_t owner; /* process whose threads these are: a forked child has none of them */
    pthread_mutex_t lock;
    pthread_cond_t posted;   /* a job has come */
    pthread_cond_t progress; /* a job's last part is done; or, for who helps, that */
    dmk_job *first;          /* jobs with parts that nobody has taken, the newest first */
    bool stop;
    int n_threads, n_helpers;
    pthread_t thread[];
};

/* Take a job off the list. */
static void unlist(struct dmk_pool *pool, const dmk_job *job)
{
    for (dmk_job **p = &pool->first; *p; p = &(*p)->later) {
        if (*p != job) continue;
        *p = job->later;
        return;
    }
}

/* What this thread's time counts for, and from when on. */
static _Thread_local dmk_meter *counted_by;
static _Thread_local int64_t counted_from;

static int64_t thread_nanoseconds(void)
{
    struct timespec t = {0};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* From here on this thread's time counts for `meter`, or for none. Returns the one before. */
static dmk_meter *count_for(dmk_meter *meter)
{
    dmk_meter *before = counted_by;
    if (meter == before) return before;
    const int64_t now = thread_nanoseconds();
    if (before) before->nanoseconds += now - counted_from;
    counted_by = meter;
    counted_from = now;
    return before;
}

int dmk_metered(dmk_context *ctx, dmk_meter *meter, int (*work)(dmk_context *, void *), void *data)
{
    dmk_meter *outer = ctx->meter, *before = count_for(meter);
    ctx->meter = meter;
    const int rc = work(ctx, data);
    ctx->meter = outer;
    count_for(before);
    return rc;
}

/* Do one part of a job that has one left. The lock is held before and after, not meanwhile. */
static void do_part(struct dmk_pool *pool, dmk_job *job)
{
    int32_t k = job->next++;
    if (job->next == job->n_parts) unlist(pool, job);
    pthread_mutex_unlock(&pool->lock);
    dmk_meter *before = count_for(job->meter);
    job->part(k, job->data);
    count_for(before);
    pthread_mutex_lock(&pool->lock);
    if (++job->done == job->n_parts) pthread_cond_broadcast(&pool->progress);
}

static void *work(void *argument)
{
    struct dmk_pool *pool = argument;
    pthread_mutex_lock(&pool->lock);
    while (!pool->stop) {
        if (pool->first)
            do_part(pool, pool->first);
        else
            pthread_cond_wait(&pool->posted, &pool->lock);
    }
    pthread_mutex_unlock(&pool->lock);
    return NULL;
}

/* Processors that this process may use. */
static int count_processors(void)
{
    cpu_set_t allowed;
    if (sched_getaffinity(0, sizeof allowed, &allowed) == 0) return CPU_COUNT(&allowed);
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    return n < 1 ? 1 : n < MOST_THREADS ? (int)n : MOST_THREADS;
}

int dmk_pool_threads(const dmk_context *context)
{
    int n = context->threads > 0 ? context->threads : count_processors();
    return n < MOST_THREADS ? n : MOST_THREADS;
}

static struct dmk_pool *create(int threads)
{
    struct dmk_pool *pool = calloc(1, sizeof *pool + (size_t)threads * sizeof *pool->thread);
    if (!pool) return NULL;
    pool->owner = getpid();
    pthread_mutex_init(&pool->lock, NULL);
    pthread_cond_init(&pool->posted, NULL);
    pthread_cond_init(&pool->progress, NULL);
    while (pool->n_threads < threads &&
           pthread_create(&pool->thread[pool->n_threads], NULL, work, pool) == 0) {
        pool->n_threads++;
    }
    return pool;
}

struct dmk_pool *dmk_pool_of(dmk_context *context)
{
    if (context->pool && context->pool->owner != getpid()) dmk_pool_destroy(&context->pool);
    if (context->pool) return context->pool;
    int threads = dmk_pool_threads(context) - 1;
    if (threads == 0 || context->borrows_pool) return NULL;
    return context->pool = create(threads);
}

void dmk_context_lend(dmk_context *context, dmk_context *own)
{
    *own = (dmk_context){.threads = context->threads,
                         .pool = dmk_pool_of(context),
                         .borrows_pool = true,
                         .meter = context->meter};
}

void dmk_pool_post(struct dmk_pool *pool, dmk_job *job)
{
    pthread_mutex_lock(&pool->lock);
    job->later = pool->first;
    pool->first = job;
    if (job->n_parts == 1)
        pthread_cond_signal(&pool->posted);
    else
        pthread_cond_broadcast(&pool->posted);
    if (pool->n_helpers > 0) pthread_cond_broadcast(&pool->progress);
    pthread_mutex_unlock(&pool->lock);
}

void dmk_pool_finish(struct dmk_pool *pool, dmk_job *job)
{
    pthread_mutex_lock(&pool->lock);
    while (job->next < job->n_parts) do_part(pool, job);
    while (job->done < job->n_parts) pthread_cond_wait(&pool->progress, &pool->lock);
    pthread_mutex_unlock(&pool->lock);
}

/* Jobs wait for those alone that they have posted, so two threads that help cannot wait for what lies beneath, on each
 * other's stack: each would have begun before the other. */
void dmk_pool_finish_helping(struct dmk_pool *pool, dmk_job *job)
{
    pthread_mutex_lock(&pool->lock);
    while (job->next < job->n_parts) do_part(pool, job);
    pool->n_helpers++;
    while (job->done < job->n_parts) {
        dmk_job *other = pool->first;
        while (other && other->stays) other = other->later;
        if (other)
            do_part(pool, other);
        else
            pthread_cond_wait(&pool->progress, &pool->lock);
    }
    pool->n_helpers--;
    pthread_mutex_unlock(&pool->lock);
}

void dmk_pool_destroy(struct dmk_pool **pointer)
{
    struct dmk_pool *pool = *pointer;
    *pointer = NULL;
    if (!pool) return;
    if (pool->owner != getpid()) {
        free(pool);
        return;
    }
    pthread_mutex_lock(&pool->lock);
    pool->stop = true;
    pthread_cond_broadcast(&pool->posted);
    pthread_mutex_unlock(&pool->lock);
    for (int i = 0; i < pool->n_threads; i++) pthread_join(pool->thread[i], NULL);
    pthread_mutex_destroy(&pool->lock);
    pthread_cond_destroy(&pool->posted);
    pthread_cond_destroy(&pool->progress);
    free(pool);
}
