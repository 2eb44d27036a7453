/* Loops on the host's threads. */
#ifndef DMK_PARALLEL_H
#define DMK_PARALLEL_H

#include "base/base.h"

#include <pthread.h>

/* Call body(begin, end, data) on disjoint ranges that cover 0..n, on one thread per processor;
 * short loops stay on the calling thread. The result must not depend on how the range is cut. */
void dmk_parallel(int32_t n, void (*body)(int32_t begin, int32_t end, void *data), void *data);

/* The smallest i in 0..n with bad(i, data), or -1: a check of many items that names the first culprit. */
int32_t dmk_parallel_first(int32_t n, bool (*bad)(int32_t i, void *data), void *data);

/* dmk_parallel for a body that may fail, with a context of its own for each range, since a context
 * serves one thread at a time. DMK_OK or the status of one that failed; the message is the caller's. */
int dmk_parallel_try(int32_t n,
                     int (*body)(dmk_context *own, int32_t begin, int32_t end, void *data),
                     void *data);

/* One piece of work beside the caller's, on a thread of its own (or at once, if there is none). The task
 * and data must outlive it: every begin needs its end. */
typedef struct dmk_task {
    int (*work)(dmk_context *own, void *data);
    void *data;
    dmk_context own;
    int rc;
    bool threaded;
    pthread_t thread;
} dmk_task;

void dmk_task_begin(dmk_task *task, int (*work)(dmk_context *own, void *data), void *data);
/* Wait for it. `rc` is what the caller's work came to: that, if it failed; else the task's status, with
 * its message in `context`. */
int dmk_task_end(dmk_context *context, dmk_task *task, int rc);

#endif
