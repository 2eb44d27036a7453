/* dmkcl solve, and the commands that begin as it does: the run that run.c makes and report.c
 * describes. */
#ifndef DMK_CLI_SOLVE_H
#define DMK_CLI_SOLVE_H

#include "cli.h"

#include <pthread.h>

typedef struct solve_request {
    const char *command; /* in the errors */
    const char *mesh;
    cli_numbers source;
    int64_t vertex;      /* -1: not given */
    const char *sources; /* file of many sources, or NULL */
    bool resume;         /* of many sources: leave out those whose files are there */
    cli_files out, locus, tangent;
    const char *format; /* of files without a suffix, or NULL */
    const char *report; /* NULL: none; "-": standard output */
    dmk_solve_options solve;
    dmk_locus_options trace; /* of the cut locus */
    dmk_device_options device;
    int64_t threads, max_steps; /* these go to `device` and `solve` when the command line is read */
    int method, start;
    bool single;
    bool repair, json;
    bool once;         /* one source: solver and device go before its cut locus is traced */
    bool bare;         /* the command needs no device and no solver */
    bool dealt;        /* several ranks read the mesh together */
    bool density_only; /* no distance, no cut locus */
    bool dry;          /* report what the run would take, and end */
    bool quiet, verbose;
} solve_request;

/* Seconds by stage; those that run inside dmk_solve are in dmk_stats. The device is opened while
 * the mesh is read, so that the sum may be above the total. Of many sources on one mesh the first
 * one solved carries what they share: read, device, setup. */
typedef struct solve_times {
    double begin; /* of the clock */
    double read, device, setup, locus, write, total;
} solve_times;

/* What one of several ranks has done. */
typedef struct solve_rank {
    dmk_traffic traffic;
    uint64_t peak_memory;
    int locus_rc;
} solve_rank;

typedef struct solve_run {
    dmk_context *context;
    dmk_mesh *mesh;
    dmk_pieces *
        pieces; /* in its place, of a density alone on ranks: the first one reads the mesh at the end */
    bool apart;           /* the mesh has been in pieces */
    dmk_mesh_info counts; /* of the mesh that has been so */
    dmk_repairs repairs;
    dmk_device *device;
    dmk_device_info opened; /* of the device, which may be closed by then */
    pthread_t closer;       /* closes it */
    bool closing;
    dmk_solver *solver;
    dmk_result *result;
    dmk_locus *locus;
    dmk_point source;
    solve_times seconds;
    cli_progress progress;
    solve_rank
        *ranks; /* n_ranks, filled on all of them; n_ranks is 0 where this one solves alone */
    int n_ranks;
    dmk_traffic traffic; /* on ranks, of this one's solver, which may be closed by then */
    int locus_rc;        /* on ranks, of the cut locus */
    const char *where;   /* of the source, in front of errors: "FILE:LINE: ", or "" */
} solve_run;

/* ---- request.c: options that several commands share ------------------------------------------- */

/* Options by the piece, for a table. */
typedef struct solve_table {
    cli_option row[CLI_MAX_OPTIONS];
    size_t n;
} solve_table;

void solve_request_init(solve_request *request, const char *command);
void solve_add(solve_table *table, const cli_option *rows, size_t n);
void solve_add_source(solve_table *table, solve_request *request);
void solve_add_strength(solve_table *table, solve_request *request);
/* --report and --json, which makes the report "-" in solve_request_convert. */
void solve_add_report(solve_table *table, solve_request *request);
/* For commands that need no device. */
void solve_add_host(solve_table *table, solve_request *request);
void solve_add_device(solve_table *table, solve_request *request);
/* Method, steps, tolerances; solve_add_method: these, and the start and the threshold. */
void solve_add_iteration(solve_table *table, solve_request *request);
void solve_add_method(solve_table *table, solve_request *request);
/* After parsing: what is in types of the command line to those of the library. EXIT_OK, or the code of options
 * that do not go together, with the error printed. */
int solve_request_convert(solve_request *request);
/* And, of a command with one source or a file of them, what the rows of these two have in common. EXIT_OK
 * or the code with the error printed. */
int solve_request_settle(solve_request *request);
/* Of these, whether the report can be written. */
int solve_request_check_report(const solve_request *request);
/* Whether the report is a file: neither left out nor printed. */
bool solve_reports_to_file(const solve_request *request);
/* Whether all files of its results are there; then they are whole. */
bool solve_has_files(const solve_request *request);
/* The files that the request reads and writes. */
void solve_request_uses(const solve_request *request, cli_uses *uses);

/* ---- run.c: the exit code, EXIT_OK or with the error printed -------------------------------- */

/* Mesh, device and solver; and the source as a surface point, if there is just one. */
int solve_begin(const solve_request *request, solve_run *run);
/* Without its device, and with another one: the mesh stays. */
void solve_drop_device(solve_run *run);
int solve_renew(const solve_request *request, solve_run *run);
/* The source as a surface point, when there are many. */
int solve_place(const solve_request *request, solve_run *run);
/* Where there are several ranks: let them solve together, each a share of the mesh. Every rank has the
 * result then, and the first one alone the cut locus and the files. */
int solve_together(solve_run *run);
/* Density, distance and cut locus of run->source; an earlier source's are given back. */
int solve_compute(const solve_request *request, solve_run *run);
int solve_write(const solve_request *request, solve_run *run);
int solve_fail(solve_run *run, int rc);
/* DMK_OK, or DMK_E_CANCELLED after Ctrl-C. */
int solve_go_on(void);
void solve_end(solve_run *run);

/* ---- sources.c, batch.c: many sources ------------------------------------------------------- */

typedef struct solve_source {
    int64_t line;   /* of the file, from 1 */
    int64_t vertex; /* or -1: then xyz */
    double xyz[3];
} solve_source;

/* *sources is the caller's to free. */
int solve_read_sources(const char *path, solve_source **sources, size_t *n);
int solve_batch(const solve_request *request);
/* Whether each is a point of the mesh: one that is not is reported as when it is solved. The code of the first. */
int solve_check_sources(const solve_request *request, solve_run *run, const solve_source *sources,
                        size_t n);

/* ---- report.c, tangent.c -------------------------------------------------------------------- */

/* From the point asked for to the source; 0 for a vertex. */
double solve_offset(const solve_request *request, const solve_run *run);
/* The report's fields, into an object that is open; of a bare request mesh, source and memory. */
void solve_report_fields(cli_json *json, const solve_request *request, const solve_run *run);
/* The JSON report, whole or not at all; of many sources on the standard output a line for each. The exit
 * code. */
int solve_report(const solve_request *request, const solve_run *run);
/* The same, with what a command adds to the object. */
typedef void (*solve_more)(cli_json *json, const solve_run *run, const void *data);
int solve_report_more(const solve_request *request, const solve_run *run, solve_more more,
                      const void *data);
/* Of a command without a solver, whose own stage takes so many of them. */
void solve_report_seconds(cli_json *json, const solve_run *run, const char *stage, double seconds);
/* Device, steps and bounds of a solve or a transport, which has no exact cost. */
void solve_report_stats(cli_json *json, const dmk_device_info *device, const dmk_stats *stats,
                        bool exact);
/* The names of files of one kind, as a list of a report. */
void solve_report_names(cli_json *json, const char *key, const cli_files *files);
/* The object `locus` of a report, and the line of a summary. */
void solve_report_locus(cli_json *json, const dmk_locus *locus);
void solve_summary_locus(const dmk_locus *locus);
/* Whether the summary is printed: neither --quiet nor a report on the standard output. */
bool solve_prints_summary(const solve_request *request);
/* The summary for a person, on the standard output. */
void solve_summary(const solve_request *request, const solve_run *run);
/* EXIT_OK, or EXIT_GAP with the words, when the gap that was asked for is not reached. */
int solve_check_gap(const solve_request *request, const solve_run *run);
/* The same of any gap; `where` stands before the words. */
int solve_tell_gap(const solve_request *request, const char *where, double gap);
/* Whether that would be its answer to this gap; and the gap in n bytes of a report, or NAN. */
bool solve_misses(const solve_request *request, double gap);
double solve_reported_gap(const char *text, size_t n);
/* Mesh, source and what a solve would take, as the request wants it: report or summary. */
int solve_print_plan(const solve_request *request, const solve_run *run);
/* Its part that holds for all sources: mesh and device. */
void solve_summary_mesh(const solve_request *request, const solve_run *run);
/* The tangent cut locus as CSV, whole or not at all. The exit code. */
int solve_tangent(const dmk_locus *locus, const char *path);

#endif
