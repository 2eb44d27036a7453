/* dmkcl solve: the run that cmd_solve.c makes and report.c tells of. */
#ifndef DMK_CLI_SOLVE_H
#define DMK_CLI_SOLVE_H

#include "cli.h"

typedef struct solve_order {
    const char *mesh;
    cli_numbers source;
    int64_t vertex; /* -1: not given */
    cli_files out, locus;
    const char *report; /* NULL: none; "-": standard output */
    dmk_solve_options solve;
    dmk_device_options device;
    bool quiet, verbose;
} solve_order;

/* Seconds by stage; those that run inside dmk_solve are in dmk_stats. The device is opened while
 * the mesh is read, so that the sum may be above the total. */
typedef struct solve_times {
    double begin; /* of the clock */
    double read, device, setup, locus, write, total;
} solve_times;

typedef struct solve_run {
    dmk_context *context;
    dmk_mesh *mesh;
    dmk_device *device;
    dmk_solver *solver;
    dmk_result *result;
    dmk_locus *locus;
    dmk_point source;
    solve_times seconds;
} solve_run;

/* The JSON report, whole or not at all. The exit code. */
int solve_report(const solve_order *order, const solve_run *run);
/* The summary for a person, on the standard output. */
void solve_summary(const solve_order *order, const solve_run *run);

#endif
