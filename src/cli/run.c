/* The run of dmkcl solve, and of the commands that begin as it does. */
#include "solve.h"

#include "ranks.h"

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <unistd.h>

/* ---- the device, opened while the mesh is read ---------------------------------------------- */

typedef struct opening {
    const dmk_device_options *options;
    dmk_context *context; /* of its own: a context belongs to one thread */
    dmk_device *device;
    double seconds;
    int rc;
    bool threaded;
    pthread_t thread;
} opening;

static void *open_device(void *argument)
{
    opening *o = argument;
    const double begin = cli_seconds();
    o->rc = dmk_context_create(&o->context);
    if (o->rc == DMK_OK) o->rc = cli_device_open(o->context, o->options, &o->device);
    o->seconds = cli_seconds() - begin;
    return NULL;
}

static void begin_opening(opening *o, const dmk_device_options *options)
{
    *o = (opening){.options = options};
    o->threaded = pthread_create(&o->thread, NULL, open_device, o) == 0;
}

/* Hand the device over to `run`; EXIT_OK or the exit code with the error printed, unless `silent`. */
static int end_opening(opening *o, solve_run *run, bool silent)
{
    int code = EXIT_OK;
    if (o->threaded) pthread_join(o->thread, NULL);
    if (!o->threaded) open_device(o);
    run->device = o->device;
    dmk_device_get_info(run->device, &run->opened);
    run->seconds.device = o->seconds;
    if (o->rc != DMK_OK && !silent) code = cli_library_error(o->context, o->rc);
    dmk_context_destroy(&o->context);
    return code;
}

/* ---- and closed while the cut locus is traced ------------------------------------------------ */

void solve_drop_device(solve_run *run)
{
    dmk_solver_destroy(&run->solver);
    dmk_device_destroy(&run->device);
}

static void *close_device(void *run)
{
    solve_drop_device(run);
    return NULL;
}

/* What PoCL has of the kernels takes 5 ms to free. */
static void begin_closing(solve_run *run)
{
    run->closing = pthread_create(&run->closer, NULL, close_device, run) == 0;
}

static void end_closing(solve_run *run)
{
    if (run->closing) pthread_join(run->closer, NULL);
    run->closing = false;
    solve_drop_device(run);
}

/* ---- the run -------------------------------------------------------------------------------- */

/* Seconds since *mark, which becomes now. */
static double lap(double *mark)
{
    const double before = *mark;
    *mark = cli_seconds();
    return *mark - before;
}

int solve_fail(solve_run *run, int rc)
{
    const char *message = dmk_context_message(run->context);
    cli_progress_end(&run->progress);
    if (!*message) message = dmk_status_text(rc);
    if (cli_interrupted()) rc = DMK_E_CANCELLED;
    if (rc == DMK_E_CANCELLED) message = dmk_status_text(rc); /* not that of a source before */
    return cli_error(cli_exit_code(rc), "%s%s", run->where, message);
}

static int find_source_in_pieces(const solve_request *request, solve_run *run)
{
    return request->vertex >= 0
               ? dmk_pieces_vertex_point(run->context, run->pieces, request->vertex, &run->source)
               : dmk_pieces_project(run->context, run->pieces, request->source.value, &run->source);
}

static int find_source(const solve_request *request, solve_run *run)
{
    if (run->pieces) return find_source_in_pieces(request, run);
    if (request->vertex >= 0) {
        return dmk_repairs_vertex_point(run->context, run->mesh, &run->repairs, request->vertex,
                                        &run->source);
    }
    const double *xyz = request->source.value;
    if (!request->quiet) cli_progress_end(&run->progress);
    return cli_project(run->context, run->mesh, xyz, request->quiet, &run->source);
}

int solve_place(const solve_request *request, solve_run *run)
{
    const int rc = find_source(request, run);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int read_mesh(const solve_request *request, solve_run *run)
{
    double mark = run->seconds.begin;
    const cli_reading how = {.repair = request->repair,
                             .quiet = request->quiet,
                             .progress = &run->progress,
                             .ranks = request->dealt ? cli_ranks() : NULL,
                             .shares = cli_ranks() && request->density_only};
    int rc = DMK_OK;
    if (how.ranks && request->density_only && !request->repair && !request->bare)
        rc = dmk_pieces_read(run->context, request->mesh, how.ranks, &run->pieces);
    run->apart = run->pieces != NULL;
    if (rc == DMK_OK && !run->pieces)
        rc = cli_read_mesh(run->context, request->mesh, &how, &run->repairs, &run->mesh);
    if (rc == DMK_OK && !request->sources) rc = find_source(request, run);
    run->seconds.read = lap(&mark);
    return rc;
}

/* Of one source nothing but the result is made of the mesh, which the solver has put in order: 61 of 923 MB of a
 * solve of 1,094,000 triangles. */
static void forget_edges(const solve_request *request, solve_run *run)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(run->mesh, &info);
    if (request->once && info.n_components == 1) dmk_mesh_forget_edges(run->mesh);
}

static int create_solver(solve_run *run)
{
    if (run->solver) return dmk_solver_set_device(run->context, run->solver, run->device);
    if (!run->pieces) return dmk_solver_create(run->context, run->device, run->mesh, &run->solver);
    dmk_pieces_get_info(run->pieces, &run->counts);
    return dmk_solver_create_of_pieces(run->context, run->device, &run->pieces, &run->solver);
}

int solve_begin(const solve_request *request, solve_run *run)
{
    *run = (solve_run){
        .seconds.begin = cli_seconds(),
        .progress.line = isatty(STDERR_FILENO) && !request->quiet,
        .progress.steps = request->verbose,
        .progress.gap = NAN,
        .where = "",
    };
    opening device;
    int rc = dmk_context_create(&run->context);
    if (rc != DMK_OK) return cli_library_error(NULL, rc);
    dmk_context_set_threads(run->context, request->device.threads);
    dmk_context_set_format(run->context, request->format); /* checked when it was asked for */
    cli_watch(run->context, &run->progress);
    if (request->bare) {
        rc = read_mesh(request, run);
        return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
    }
    const int same = request->dealt ? cli_check_same_file(request->mesh) : EXIT_OK;
    if (same != EXIT_OK) return same;
    begin_opening(&device, &request->device);
    rc = read_mesh(request, run);
    double mark = cli_seconds();
    if (rc == DMK_OK && !cli_ranks()) /* who look at their devices before they order the mesh */
        rc = dmk_solver_create(run->context, NULL, run->mesh, &run->solver);
    if (rc == DMK_OK && run->solver) forget_edges(request, run);
    run->seconds.setup = lap(&mark);
    cli_progress_say(&run->progress, "opening the device and building its kernels");
    const int code = end_opening(&device, run, rc != DMK_OK);
    if (code != EXIT_OK) return code;
    if (rc == DMK_OK && run->mesh) cli_make_room(run->mesh);
    if (rc == DMK_OK) rc = create_solver(run);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

int solve_renew(const solve_request *request, solve_run *run)
{
    int rc = cli_device_open(run->context, &request->device, &run->device);
    dmk_device_get_info(run->device, &run->opened);
    if (rc == DMK_OK) rc = create_solver(run);
    if (rc != DMK_OK) solve_drop_device(run);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

/* The gap is computed in between only when it ends the run, and costs half a step: with --verbose,
 * and before a terminal's eyes on long runs, it is wanted without ending anything. */
static dmk_solve_options show_gap(const solve_request *request, const solve_run *run)
{
    enum { LONG = 500000 }; /* triangles, some seconds */
    dmk_solve_options solve = request->solve;
    dmk_mesh_info info = run->counts;
    if (solve.gap_tolerance > 0 || (!run->progress.steps && !run->progress.line)) return solve;
    if (!run->apart) dmk_mesh_get_info(run->mesh, &info);
    const bool is_long = solve.method != DMK_NEWTON || info.n_triangles > LONG;
    if (run->progress.steps || is_long) solve.gap_tolerance = DBL_MIN;
    return solve;
}

int solve_together(solve_run *run)
{
    const dmk_ranks *ranks = cli_ranks();
    if (!ranks) return EXIT_OK;
    run->ranks = calloc((size_t)ranks->size, sizeof *run->ranks);
    if (!run->ranks) return cli_library_error(NULL, DMK_E_NOMEM);
    run->n_ranks = ranks->size;
    const int rc = run->apart ? DMK_OK : dmk_solver_set_ranks(run->context, run->solver, ranks);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

/* What each rank has done, for the report and for the others; the exit code. */
static int gather_ranks(solve_run *run)
{
    const solve_rank mine = {run->traffic, cli_peak_memory(), run->locus_rc};
    const int rc = cli_ranks_gather(&mine, run->ranks, sizeof mine);
    if (rc != DMK_OK) cli_progress_end(&run->progress);
    return rc == DMK_OK ? EXIT_OK : cli_ranks_error(rc);
}

/* What was sent is kept: the solver may go before the others are told. */
static int solve(const dmk_solve_options *options, solve_run *run)
{
    const int rc = dmk_solve(run->context, run->solver, &run->source, options, &run->result);
    dmk_solver_get_traffic(run->solver, &run->traffic);
    return rc;
}

/* A share of the mesh is all that a rank keeps while it solves; the first one reads the mesh again at the end, when
 * the rest of its memory is free. */
static int solve_lean(const solve_request *request, solve_run *run)
{
    const dmk_solve_options options = show_gap(request, run);
    const cli_reading again = {.repair = request->repair, .quiet = !run->apart || request->quiet};
    int rc = DMK_OK, code = EXIT_OK;
    if (!run->apart) rc = dmk_solver_give_mesh(run->context, run->solver, &run->mesh);
    if (rc == DMK_OK) rc = solve(&options, run);
    if (rc == DMK_OK) code = gather_ranks(run);
    dmk_solver_destroy(&run->solver);
    cli_trim_memory();
    if (rc != DMK_OK) return solve_fail(run, rc);
    if (code != EXIT_OK || !cli_ranks_first()) return code;
    dmk_repairs_free(&run->repairs);
    /* Of several components something is said that hangs on the edges. */
    rc = run->apart && run->counts.n_components == 1
             ? dmk_mesh_read_known(run->context, request->mesh, &run->counts, &run->mesh)
             : cli_read_mesh(run->context, request->mesh, &again, &run->repairs, &run->mesh);
    if (rc == DMK_OK && !again.quiet && request->vertex < 0) {
        cli_progress_end(&run->progress);
        cli_warn_away(run->context, run->mesh, request->source.value, &run->source);
    }
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int solve_whole(const solve_request *request, solve_run *run)
{
    const dmk_solve_options options = show_gap(request, run);
    const int rc = solve(&options, run);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

/* Of several ranks the last one traces the cut locus, while the first one marks the approximate one and writes. */
static bool traces(const solve_run *run)
{
    const dmk_ranks *ranks = cli_ranks();
    return run->n_ranks == 0 || (ranks && ranks->rank == ranks->size - 1);
}

int solve_compute(const solve_request *request, solve_run *run)
{
    dmk_context *context = run->context;
    dmk_locus_destroy(&run->locus);
    dmk_result_destroy(&run->result);
    const int code = request->density_only && run->n_ranks > 0 ? solve_lean(request, run)
                                                               : solve_whole(request, run);
    if (code != EXIT_OK) return code;
    dmk_stats stats;
    dmk_result_get_stats(run->result, &stats);
    run->seconds.setup += stats.seconds[DMK_STAGE_SETUP];
    if (request->density_only || !traces(run)) return EXIT_OK;
    double mark = cli_seconds();
    if (request->once) begin_closing(run);
    int rc = dmk_locus_compute(context, run->mesh, run->result, &request->trace, &run->locus);
    run->seconds.locus = lap(&mark);
    if (rc == DMK_OK) rc = solve_go_on();
    if (run->n_ranks > 0) {
        run->locus_rc = rc; /* the others want to know */
        return EXIT_OK;
    }
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

/* The last rank's cut locus to all; of its failure it speaks itself. */
static int take_locus(solve_run *run)
{
    const dmk_ranks *ranks = cli_ranks();
    const int last = ranks->size - 1;
    const int code = gather_ranks(run);
    if (code != EXIT_OK) return code;
    const int theirs = run->ranks[last].locus_rc;
    if (theirs != DMK_OK && ranks->rank != last) return cli_exit_code(theirs);
    if (theirs != DMK_OK) {
        if (!cli_interrupted()) cli_ranks_speak();
        return solve_fail(run, theirs);
    }
    const int rc = dmk_locus_spread(run->context, ranks, last, &run->locus);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

int solve_go_on(void)
{
    return cli_interrupted() ? DMK_E_CANCELLED : DMK_OK;
}

static int write_result(const solve_request *request, solve_run *run)
{
    int rc = solve_go_on();
    for (int i = 0; i < request->out.n && rc == DMK_OK; i++) {
        rc = dmk_result_write(run->context, run->mesh, run->result, cli_path(request->out.path[i]));
        if (rc == DMK_OK) rc = solve_go_on();
    }
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int write_locus(const solve_request *request, solve_run *run)
{
    int rc = DMK_OK, code = EXIT_OK;
    for (int i = 0; i < request->locus.n && rc == DMK_OK; i++) {
        rc = dmk_locus_write(run->context, run->locus, cli_path(request->locus.path[i]));
        if (rc == DMK_OK) rc = solve_go_on();
    }
    for (int i = 0; i < request->tangent.n && rc == DMK_OK && code == EXIT_OK; i++) {
        code = solve_tangent(run->locus, request->tangent.path[i]);
        rc = solve_go_on();
    }
    return rc == DMK_OK ? code : solve_fail(run, rc);
}

/* Each file is written under another name first, so that it is whole or not there. */
int solve_write(const solve_request *request, solve_run *run)
{
    int code = EXIT_OK;
    double mark = cli_seconds();
    const bool first = run->n_ranks == 0 || cli_ranks_first();
    if (first) code = write_result(request, run);
    run->seconds.write = lap(&mark);
    if (run->n_ranks > 0 && !request->density_only) {
        const int theirs = take_locus(run);
        if (code == EXIT_OK) code = theirs;
        if (first) run->seconds.locus = lap(&mark);
    }
    if (!first || code != EXIT_OK) return code;
    code = write_locus(request, run);
    run->seconds.write += lap(&mark);
    run->seconds.total = mark - run->seconds.begin;
    cli_progress_end(&run->progress);
    if (code == EXIT_OK && request->report) code = solve_report(request, run);
    return code;
}

void solve_end(solve_run *run)
{
    cli_progress_end(&run->progress);
    end_closing(run);
    free(run->ranks);
    dmk_locus_destroy(&run->locus);
    dmk_result_destroy(&run->result);
    dmk_mesh_destroy(&run->mesh);
    dmk_pieces_destroy(&run->pieces);
    dmk_repairs_free(&run->repairs);
    dmk_context_destroy(&run->context);
}
