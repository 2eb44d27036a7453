/* A communicator whose ranks are threads of this process that meet at a barrier. */
#ifndef DMKCL_TESTS_MEETING_H
#define DMKCL_TESTS_MEETING_H

#include "dmkcl.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_RANKS = 5 };

typedef struct meeting {
    pthread_barrier_t barrier;
    int size;
    const void *mine[MOST_RANKS];
    const void *const *send[MOST_RANKS];
    const size_t *send_bytes[MOST_RANKS];
    bool broken; /* exchanges fail from now on */
} meeting;

typedef struct member {
    meeting *all;
    int rank;
    bool at_once;                 /* no exchange in two halves */
    const void *send[MOST_RANKS]; /* of the one that has begun */
    void *receive[MOST_RANKS];
    size_t send_bytes[MOST_RANKS], receive_bytes[MOST_RANKS];
} member;

static inline int exchange(void *user, const void *const *send, const size_t *send_bytes,
                           void *const *receive, const size_t *receive_bytes)
{
    const member *m = user;
    meeting *all = m->all;
    int wrong = all->broken;
    all->send[m->rank] = send;
    all->send_bytes[m->rank] = send_bytes;
    pthread_barrier_wait(&all->barrier);
    for (int k = 0; k < all->size; k++) {
        if (all->send_bytes[k][m->rank] != receive_bytes[k])
            wrong = 1;
        else if (receive_bytes[k] > 0)
            memcpy(receive[k], all->send[k][m->rank], receive_bytes[k]);
    }
    pthread_barrier_wait(&all->barrier);
    return wrong;
}

/* All of it happens at the end: until then what arrives has its old value. */
static inline int begin(void *user, const void *const *send, const size_t *send_bytes,
                        void *const *receive, const size_t *receive_bytes)
{
    member *m = user;
    memcpy(m->receive, receive, (size_t)m->all->size * sizeof *receive);
    memcpy(m->send, send, (size_t)m->all->size * sizeof *send);
    memcpy(m->send_bytes, send_bytes, (size_t)m->all->size * sizeof *send_bytes);
    memcpy(m->receive_bytes, receive_bytes, (size_t)m->all->size * sizeof *receive_bytes);
    return 0;
}

static inline int finish(void *user)
{
    member *m = user;
    return exchange(user, m->send, m->send_bytes, m->receive, m->receive_bytes);
}

static inline int gather(void *user, const void *mine, void *to, const size_t *bytes)
{
    const member *m = user;
    char *at = to;
    m->all->mine[m->rank] = mine;
    pthread_barrier_wait(&m->all->barrier);
    for (int k = 0; k < m->all->size; k++) {
        if (bytes[k] > 0) memcpy(at, m->all->mine[k], bytes[k]);
        at += bytes[k];
    }
    pthread_barrier_wait(&m->all->barrier);
    return 0;
}

static inline int largest(void *user, int32_t *value, size_t n)
{
    const member *m = user;
    int32_t *top = malloc(n * sizeof *top);
    if (!top) return 1;
    memcpy(top, value, n * sizeof *top);
    m->all->mine[m->rank] = value;
    pthread_barrier_wait(&m->all->barrier);
    for (int k = 0; k < m->all->size; k++) {
        const int32_t *one = m->all->mine[k];
        for (size_t i = 0; i < n; i++) top[i] = one[i] > top[i] ? one[i] : top[i];
    }
    pthread_barrier_wait(&m->all->barrier);
    memcpy(value, top, n * sizeof *top);
    free(top);
    return m->all->broken;
}

static inline dmk_ranks ranks_of(member *m, int32_t gather_below)
{
    return (dmk_ranks){.rank = m->rank,
                       .size = m->all->size,
                       .gather_below = gather_below,
                       .user = m,
                       .exchange = exchange,
                       .gather = gather,
                       .largest = largest,
                       .begin = m->at_once ? NULL : begin,
                       .finish = m->at_once ? NULL : finish};
}

/* All ranks of the meeting at once: sit is called with each of all->size seats of `each` bytes, on a thread of its own.
 * 0, or what pthreads failed with. */
static inline int meet(meeting *all, void *(*sit)(void *), void *seats, size_t each)
{
    pthread_t thread[MOST_RANKS];
    int rc = pthread_barrier_init(&all->barrier, NULL, (unsigned)all->size);
    for (int k = 0; k < all->size && rc == 0; k++)
        rc = pthread_create(&thread[k], NULL, sit, (char *)seats + (size_t)k * each);
    if (rc != 0) return rc; /* the others would wait for ever */
    for (int k = 0; k < all->size; k++) pthread_join(thread[k], NULL);
    pthread_barrier_destroy(&all->barrier);
    return 0;
}

#endif
