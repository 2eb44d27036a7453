/* Whether other processes of this machine still run: each holds a lock in memory that they share, which the
 * system gives up when its owner ends, however that happens. */
#ifndef DMK_CLI_LIFE_H
#define DMK_CLI_LIFE_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

typedef struct {
    pthread_mutex_t held;
    atomic_bool lost; /* one that looked has seen it */
    int rank;         /* what others call its owner */
} cli_life;

/* By the thread that lives as long as the process does; 0 or an error number. */
int cli_life_begin(cli_life *life, int rank);
/* Whether the owner has ended without cli_life_end; once true, always. After its cli_life_begin; by any process. */
bool cli_life_lost(cli_life *life);
/* By the same thread, before the memory goes. */
void cli_life_end(cli_life *life);

#endif
