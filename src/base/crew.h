/* Threads that stay together for many short rounds of work, of tens of microseconds each, where waking them by
 * dmk_parallel for each round would cost as much as the work. They spin between rounds, so a crew is to be short-lived
 * and its rounds dense. */
#ifndef DMK_CREW_H
#define DMK_CREW_H

#include "base/parallel.h"

#include <stdatomic.h>

/* More threads would wait for each other. */
enum { DMK_MOST_CREW = 4, DMK_MOST_PARTS = 32 };

typedef struct dmk_crew {
    void (*part)(int32_t k, void *data);
    void *data;
    int32_t n_parts;
    int n_members;                          /* the caller is number 0 */
    _Atomic uint64_t round;                 /* from 1 on; 0: none yet; UINT64_MAX: no more */
    _Atomic int32_t done;                   /* parts of this round */
    _Atomic int32_t joined;                 /* members but the caller */
    _Atomic uint64_t begun[DMK_MOST_PARTS]; /* the round in which each part was begun last */
    dmk_task task[DMK_MOST_CREW - 1];
} dmk_crew;

/* As many members as threads, DMK_MOST_CREW at most. Those that no thread of the pool has time for never come. Each
 * round has n_parts, DMK_MOST_PARTS at most. The crew and data must outlive it: every begin needs its end. */
void dmk_crew_begin(dmk_context *context, dmk_crew *crew, int32_t n_parts,
                    void (*part)(int32_t k, void *data), void *data);
/* All of part(0, data) .. part(n_parts - 1, data), each once: by the same member as in the round before unless that is
 * late, so that its data is in that processor's cache. What is written before is seen by the parts, and what they
 * write is seen after. */
void dmk_crew_round(dmk_crew *crew);
void dmk_crew_end(dmk_context *context, dmk_crew *crew);

#endif
