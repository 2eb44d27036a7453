/* The life of a process, by a robust mutex: see life.h. */
#include "life.h"

#include <errno.h>

int cli_life_begin(cli_life *life, int rank)
{
    pthread_mutexattr_t attributes;
    life->rank = rank;
    atomic_init(&life->lost, false);
    int rc = pthread_mutexattr_init(&attributes);
    if (rc != 0) return rc;
    pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED);
    pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST);
    rc = pthread_mutex_init(&life->held, &attributes);
    pthread_mutexattr_destroy(&attributes);
    return rc == 0 ? pthread_mutex_lock(&life->held) : rc;
}

/* The flag is for all: of a mutex that is given back as it was left the C library may not let go again. */
bool cli_life_lost(cli_life *life)
{
    if (atomic_load(&life->lost)) return true;
    const int rc = pthread_mutex_trylock(&life->held);
    if (rc == EOWNERDEAD) {
        atomic_store(&life->lost, true);
        pthread_mutex_consistent(&life->held);
    }
    if (rc == 0 || rc == EOWNERDEAD) pthread_mutex_unlock(&life->held);
    return rc == EOWNERDEAD;
}

void cli_life_end(cli_life *life)
{
    pthread_mutex_unlock(&life->held);
}
