/* Threads that stay together for many short rounds of work, of tens of microseconds each, where waking them by
 * dmk_parallel for each round would cost as much as the work. They spin between rounds, so a crew is to be short-lived
 * and its rounds dense. */
#ifndef DMK_CREW_H
#define DMK_CREW_H

#include "base/parallel.h"

#include <stdatomic.h>

/* More threads would wait for each other. */
enum { DMK_MOST_CREW = 4 };

typedef struct dmk_crew {
    void (*part)(int32_t k, int member, void *data);
    void *data;
    int n_members;          /* the caller is number 0 */
    _Atomic uint64_t round; /* see crew.c */
    _Atomic int32_t done;   /* parts of this round */
    _Atomic int32_t joined; /* members but the caller */
    dmk_task task[DMK_MOST_CREW - 1];
} dmk_crew;

/* As many members as threads, DMK_MOST_CREW at most. Those that no thread of the pool has time for never come. part(k,
 * member, data) does part k of a round; no two calls with the same member run at a time. The crew and data must
 * outlive it: every begin needs its end. */
void dmk_crew_begin(dmk_context *context, dmk_crew *crew,
                    void (*part)(int32_t k, int member, void *data), void *data);
/* All of part 0 .. n_parts - 1, each once and by whoever comes first; n_parts < 2^20. What is written before is seen
 * by the parts, and what they write is seen after. */
void dmk_crew_round(dmk_crew *crew, int32_t n_parts);
void dmk_crew_end(dmk_context *context, dmk_crew *crew);

#endif
