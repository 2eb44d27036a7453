/* The tool as several processes, ranks, started together by mpirun. In a build without MPI there is one process,
 * and all of this is done at once. */
#ifndef DMK_CLI_RANKS_H
#define DMK_CLI_RANKS_H

#include "cli.h"

/* First of all in main. From here on only the first rank speaks: what the others print is held back. */
void cli_ranks_begin(int *argc, char ***argv);
/* Last of all: wait for the others; the exit code of all. A rank that alone has failed says so and ends the
 * whole job, since the others may wait for it in vain. */
int cli_ranks_end(int code);

/* To deal a mesh out; NULL: there is only this process. */
const dmk_ranks *cli_ranks(void);
/* Whether this rank writes what there is one of: files, reports. */
bool cli_ranks_first(void);
/* From now on all ranks speak: each does its own part of the work. */
void cli_ranks_speak(void);
/* 0, 1, 2 ...: a number that no other call on any rank has given, to take a piece of work by. */
size_t cli_ranks_next(void);
/* all[r * bytes] = what rank r has at `mine`; waits for all. DMK_OK or, when a rank is lost, DMK_E_DEVICE. */
int cli_ranks_gather(const void *mine, void *all, size_t bytes);
/* Print the error of such a call; the exit code. */
int cli_ranks_error(int rc);

#endif
