/* dmkcl solve: from a mesh and a point to density, distance and cut locus. */
#include "solve.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <string.h>
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
    if (o->rc == DMK_OK) o->rc = dmk_device_open(o->context, o->options, &o->device);
    o->seconds = cli_seconds() - begin;
    return NULL;
}

static void begin_opening(opening *o, const dmk_device_options *options)
{
    *o = (opening){.options = options};
    o->threaded = pthread_create(&o->thread, NULL, open_device, o) == 0;
}

/* Hand the device over to `run`; EXIT_OK or the exit code with the error told, unless `silent`. */
static int end_opening(opening *o, solve_run *run, bool silent)
{
    int code = EXIT_OK;
    if (o->threaded) pthread_join(o->thread, NULL);
    if (!o->threaded) open_device(o);
    run->device = o->device;
    run->seconds.device = o->seconds;
    if (o->rc != DMK_OK && !silent) code = cli_library_error(o->context, o->rc);
    dmk_context_destroy(&o->context);
    return code;
}

/* ---- the run -------------------------------------------------------------------------------- */

/* Seconds since *mark, which becomes now. */
static double lap(double *mark)
{
    const double before = *mark;
    *mark = cli_seconds();
    return *mark - before;
}

static int read_mesh(const solve_order *order, solve_run *run)
{
    double mark = run->seconds.begin;
    int rc = dmk_mesh_read(run->context, order->mesh, &run->mesh);
    if (rc == DMK_OK && order->vertex >= 0) {
        rc = dmk_mesh_vertex_point(run->context, run->mesh, order->vertex, &run->source);
    } else if (rc == DMK_OK) {
        rc = dmk_mesh_project(run->context, run->mesh, order->source.value, &run->source);
    }
    run->seconds.read = lap(&mark);
    return rc;
}

static int compute(const solve_order *order, solve_run *run)
{
    dmk_context *context = run->context;
    double mark = cli_seconds();
    int rc = dmk_solver_create(context, run->device, run->mesh, &run->solver);
    run->seconds.setup = lap(&mark);
    if (rc != DMK_OK) return rc;
    rc = dmk_solve(context, run->solver, &run->source, &order->solve, &run->result);
    lap(&mark);
    if (rc != DMK_OK) return rc;
    dmk_locus_options options;
    dmk_locus_options_init(&options);
    rc = dmk_locus_compute(context, run->mesh, run->result, &options, &run->locus);
    run->seconds.locus = lap(&mark);
    return rc == DMK_OK && cli_interrupted() ? DMK_E_CANCELLED : rc;
}

/* The library writes each file under another name first, so that it is whole or not there. */
static int write_files(const solve_order *order, solve_run *run)
{
    int rc = DMK_OK;
    double mark = cli_seconds();
    for (int i = 0; i < order->out.n && rc == DMK_OK; i++) {
        rc = dmk_result_write(run->context, run->mesh, run->result, order->out.path[i]);
    }
    for (int i = 0; i < order->locus.n && rc == DMK_OK; i++) {
        rc = dmk_locus_write(run->context, run->locus, order->locus.path[i]);
    }
    run->seconds.write = lap(&mark);
    run->seconds.total = mark - run->seconds.begin;
    return rc;
}

static int tell(const solve_order *order, const solve_run *run)
{
    const bool summary = !order->quiet && !(order->report && strcmp(order->report, "-") == 0);
    int code = order->report ? solve_report(order, run) : EXIT_OK;
    if (code == EXIT_OK && summary) {
        solve_summary(order, run);
        code = cli_flush();
    }
    return code;
}

static void free_run(solve_run *run)
{
    dmk_locus_destroy(&run->locus);
    dmk_result_destroy(&run->result);
    dmk_solver_destroy(&run->solver);
    dmk_mesh_destroy(&run->mesh);
    dmk_device_destroy(&run->device);
    dmk_context_destroy(&run->context);
}

static int solve(const solve_order *order)
{
    solve_run run = {.seconds.begin = cli_seconds()};
    cli_progress progress = {
        .line = isatty(STDERR_FILENO) && !order->quiet,
        .steps = order->verbose,
        .gap = NAN,
    };
    opening device;
    int rc = dmk_context_create(&run.context);
    if (rc != DMK_OK) return cli_library_error(NULL, rc);
    cli_catch_interrupt();
    cli_watch(run.context, &progress);
    begin_opening(&device, &order->device);
    rc = read_mesh(order, &run);
    cli_progress_say(&progress, "opening the device and building its kernels");
    int code = end_opening(&device, &run, rc != DMK_OK);
    if (rc == DMK_OK && code == EXIT_OK) rc = compute(order, &run);
    if (rc == DMK_OK && code == EXIT_OK) rc = write_files(order, &run);
    cli_progress_end(&progress);
    if (rc != DMK_OK) code = cli_library_error(run.context, rc);
    if (code == EXIT_OK) code = tell(order, &run);
    free_run(&run);
    return code;
}

/* ---- the command line ----------------------------------------------------------------------- */

static int check_order(const solve_order *order)
{
    int code = EXIT_OK;
    if (order->source.n == 0 && order->vertex < 0) {
        return cli_error(EXIT_USAGE,
                         "solve: where is the source? Give --source X,Y,Z or --vertex I");
    }
    if (order->source.n > 0 && order->vertex >= 0) {
        return cli_error(EXIT_USAGE, "solve: give --source or --vertex, not both");
    }
    if (order->quiet && order->verbose) {
        return cli_error(EXIT_USAGE, "solve: give --quiet or --verbose, not both");
    }
    for (int i = 0; i < order->out.n && code == EXIT_OK; i++) {
        code = cli_check_output("out", order->out.path[i], CLI_RESULT);
    }
    for (int i = 0; i < order->locus.n && code == EXIT_OK; i++) {
        code = cli_check_output("locus", order->locus.path[i], CLI_LOCUS);
    }
    if (code == EXIT_OK && order->report && strcmp(order->report, "-") != 0) {
        code = cli_check_output("report", order->report, CLI_ANY);
    }
    return code;
}

/* The options that are not of the library's types. */
typedef struct raw_options {
    int64_t max_steps, threads;
    int method, start;
    bool single, json;
    char out_help[600], locus_help[600];
} raw_options;

static int parse(solve_order *order, raw_options *raw, int argc, char **argv)
{
    static const char *const methods[] = {"newton", "inertial", "euler", NULL}; /* as dmk_method */
    static const char *const starts[] = {"distance", "uniform", NULL};          /* as dmk_start */
    dmk_solve_options *solve_options = &order->solve;
    const cli_option options[] = {
        {.name = "source",
         .value = "X,Y,Z",
         .help = "the source: the point of the surface nearest to this one",
         .kind = CLI_POINT,
         .target = &order->source},
        {.name = "vertex",
         .value = "I",
         .help = "the source is vertex I, counted from 0",
         .kind = CLI_INTEGER,
         .target = &order->vertex,
         .lo = 0,
         .hi = INT_MAX,
         .expected = "a vertex number, from 0"},
        {.name = "out",
         .value = "FILE",
         .help = raw->out_help,
         .kind = CLI_FILES,
         .target = &order->out},
        {.name = "locus",
         .value = "FILE",
         .help = raw->locus_help,
         .kind = CLI_FILES,
         .target = &order->locus},
        {.name = "report",
         .value = "FILE",
         .help = "write the figures of the run as JSON; - is the standard output",
         .kind = CLI_TEXT,
         .target = &order->report},
        {.name = "json", .help = "the same as --report -", .kind = CLI_FLAG, .target = &raw->json},
        {.name = "threshold",
         .value = "EPS",
         .help = "bound of the approximate cut locus {mu <= EPS}, the array `acl`;\n"
                 "default: relative to the size of each triangle",
         .kind = CLI_NUMBER,
         .target = &solve_options->threshold,
         .lo = DBL_MIN,
         .hi = DBL_MAX,
         .expected = "a number above 0"},
        {.name = "method",
         .value = "NAME",
         .help = "newton (default), inertial, euler (the paper's)",
         .kind = CLI_CHOICE,
         .target = &raw->method,
         .choices = methods},
        {.name = "start",
         .value = "NAME",
         .help = "from a distance estimate (default: distance) or from mu = 1\n(uniform)",
         .kind = CLI_CHOICE,
         .target = &raw->start,
         .choices = starts},
        {.name = "dt",
         .value = "STEP",
         .help = "time step of euler, in (0, 1]",
         .kind = CLI_NUMBER,
         .target = &solve_options->dt,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "inertia",
         .value = "BETA",
         .help = "inertia of inertial, in [0, 1)",
         .kind = CLI_NUMBER,
         .target = &solve_options->inertia,
         .lo = 0,
         .hi = 1 - DBL_EPSILON,
         .expected = "a number in [0, 1)"},
        {.name = "tolerance",
         .value = "TOL",
         .help = "stop when the relative change of mu per unit time is below",
         .kind = CLI_NUMBER,
         .target = &solve_options->tolerance,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "gap",
         .value = "GAP",
         .help = "stop when the relative gap of the cost is below",
         .kind = CLI_NUMBER,
         .target = &solve_options->gap_tolerance,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "max-steps",
         .value = "N",
         .help = "give up after so many steps (exit code 7)",
         .kind = CLI_INTEGER,
         .target = &raw->max_steps,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number from 1"},
        {.name = "device",
         .value = "N|NAME",
         .help = "number of the device in `dmkcl devices`, or part of its name",
         .kind = CLI_TEXT,
         .target = &order->device.select},
        {.name = "threads",
         .value = "N",
         .help = "compute units of a CPU to use; default: one a core",
         .kind = CLI_INTEGER,
         .target = &raw->threads,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number from 1"},
        {.name = "single",
         .help = "no double precision on the device",
         .kind = CLI_FLAG,
         .target = &raw->single},
        {.name = "cache",
         .value = "DIR",
         .help = "folder for compiled kernels; '' keeps none; default: the user's\ncache folder",
         .kind = CLI_TEXT,
         .target = &order->device.cache},
        {.name = "quiet",
         .help = "print nothing but errors",
         .kind = CLI_FLAG,
         .target = &order->quiet},
        {.name = "verbose",
         .help = "a line for each step, on the standard error",
         .kind = CLI_FLAG,
         .target = &order->verbose},
    };
    const cli_syntax syntax = {
        .command = "solve",
        .usage = "MESH (--source X,Y,Z | --vertex I) [OPTIONS]",
        .summary =
            "The optimal transport density mu, the distance and the cut locus of a point on the\n"
            "surface MESH. The files are written at the end, each whole or not at all.",
        .operand = "MESH",
        .notes = "A terminal shows the progress. Ctrl-C ends the run, and nothing is written then.",
        .options = options,
        .n_options = sizeof options / sizeof *options,
    };
    return cli_parse(&syntax, argc, argv, &order->mesh);
}

int cmd_solve(int argc, char **argv)
{
    solve_order order = {.vertex = -1};
    raw_options raw = {0};
    char suffixes[512];
    cli_suffixes(CLI_RESULT, suffixes, sizeof suffixes);
    snprintf(raw.out_help, sizeof raw.out_help,
             "write mesh, mu, acl, u and distance; may be given again:\n%s", suffixes);
    cli_suffixes(CLI_LOCUS, suffixes, sizeof suffixes);
    snprintf(raw.locus_help, sizeof raw.locus_help,
             "write the cut locus as lines; may be given again:\n%s", suffixes);
    dmk_solve_options_init(&order.solve);
    dmk_device_options_init(&order.device);

    int code = parse(&order, &raw, argc, argv);
    if (code != CLI_GO_ON) return code;
    order.solve.method = (dmk_method)raw.method;
    order.solve.start = (dmk_start)raw.start;
    order.solve.max_steps = (int)raw.max_steps;
    order.device.threads = (int)raw.threads;
    order.device.single_precision = raw.single;
    if (raw.json) order.report = "-";
    code = check_order(&order);
    return code == EXIT_OK ? solve(&order) : code;
}
