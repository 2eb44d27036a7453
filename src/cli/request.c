/* What the commands that solve are asked for: the options that they share. */
#include "solve.h"

#include <assert.h>
#include <float.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

void solve_request_init(solve_request *request, const char *command)
{
    *request = (solve_request){.command = command, .vertex = -1};
    dmk_solve_options_init(&request->solve, sizeof request->solve);
    dmk_device_options_init(&request->device, sizeof request->device);
    request->device.in_background = 1;
    dmk_locus_options_init(&request->trace, sizeof request->trace);
}

void solve_add(solve_table *table, const cli_option *rows, size_t n)
{
    assert(table->n + n <= CLI_MAX_OPTIONS);
    for (size_t i = 0; i < n; i++) table->row[table->n++] = rows[i];
}

void solve_add_source(solve_table *table, solve_request *request)
{
    const cli_option rows[] = {
        {.name = "source",
         .value = "X,Y,Z",
         .help = "the source: the point of the surface nearest to this one, as 3,0,0 or\n"
                 "'3 0 0'",
         .kind = CLI_POINT,
         .target = &request->source},
        {.name = "vertex",
         .value = "I",
         .help = "the source is vertex I, counted from 0",
         .kind = CLI_INTEGER,
         .target = &request->vertex,
         .lo = 0,
         .hi = INT_MAX,
         .expected = "a vertex number"},
        {.name = "repair", .help = CLI_REPAIR_HELP, .kind = CLI_FLAG, .target = &request->repair},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_strength(solve_table *table, solve_request *request)
{
    const cli_option row = {
        .name = "strength",
        .value = "LENGTH",
        .help = "leave out branches of the cut locus of less strength: by how much a path\n"
                "must lengthen to be moved around the branch's end; default: 0.2 mean edges,\n"
                "or just above the mesh's own branches where these stand apart from the\n"
                "rest (spheres, cubes, noise); the report has it as locus.strength",
        .kind = CLI_NUMBER,
        .target = &request->trace.strength,
        .lo = DBL_MIN,
        .hi = DBL_MAX,
        .expected = "a number above 0",
    };
    solve_add(table, &row, 1);
}

void solve_add_report(solve_table *table, solve_request *request)
{
    const cli_option rows[] = {
        {.name = "report",
         .value = "FILE",
         .help = "write the figures of the run as JSON; - is the standard output",
         .kind = CLI_TEXT,
         .target = &request->report},
        {.name = "json",
         .help = "the same as --report -",
         .kind = CLI_FLAG,
         .target = &request->json},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_host(solve_table *table, solve_request *request)
{
    const cli_option rows[] = {
        {.name = "threads",
         .value = "N",
         .help = "threads to use; default: one for each core",
         .kind = CLI_INTEGER,
         .target = &request->threads,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number"},
        {.name = "quiet", .help = CLI_QUIET_HELP, .kind = CLI_FLAG, .target = &request->quiet},
        {.name = "verbose",
         .help = "a line for each stage, on the standard error",
         .kind = CLI_FLAG,
         .target = &request->verbose},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_device(solve_table *table, solve_request *request)
{
    const cli_option rows[] = {
        {.name = "device",
         .value = "N|NAME",
         .help = "number of the device in `dmkcl devices`, part of its name, or `gpu`,\n"
                 "`cpu`; default: the best there is, a GPU before a CPU",
         .kind = CLI_TEXT,
         .target = &request->device.select},
        {.name = "threads",
         .value = "N",
         .help =
             "threads of the host, and of a CPU that is the device;\ndefault: one for each core",
         .kind = CLI_INTEGER,
         .target = &request->threads,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number"},
        {.name = "single",
         .help = "no double precision on the device",
         .kind = CLI_FLAG,
         .target = &request->single},
        {.name = "cache",
         .value = "DIR",
         .help = "folder for compiled kernels, also of PoCL, unless POCL_CACHE_DIR says\n"
                 "where; '' keeps none; default: $XDG_CACHE_HOME/dmkcl or ~/.cache/dmkcl",
         .kind = CLI_TEXT,
         .target = &request->device.cache},
        {.name = "quiet", .help = CLI_QUIET_HELP, .kind = CLI_FLAG, .target = &request->quiet},
        {.name = "verbose",
         .help = "a line for each step, on the standard error",
         .kind = CLI_FLAG,
         .target = &request->verbose},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_iteration(solve_table *table, solve_request *request)
{
    static const char *const methods[] = {"newton", "inertial", "euler", NULL}; /* as dmk_method */
    dmk_solve_options *solve_options = &request->solve;
    const cli_option rows[] = {
        {.name = "method",
         .value = "NAME",
         .help = "newton (default), inertial, euler (the paper's)",
         .kind = CLI_CHOICE,
         .target = &request->method,
         .choices = methods},
        {.name = "dt",
         .value = "STEP",
         .help = "time step for euler, in (0, 1]; default: 0.5",
         .kind = CLI_NUMBER,
         .target = &solve_options->dt,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "inertia",
         .value = "BETA",
         .help = "inertia for inertial, in [0, 1); default: 0.8, reached gradually",
         .kind = CLI_NUMBER,
         .target = &solve_options->inertia,
         .lo = 0,
         .hi = 1 - DBL_EPSILON,
         .expected = "a number in [0, 1)"},
        {.name = "tolerance",
         .value = "TOL",
         .help = "stop when the relative change of mu per unit time is less;\ndefault: 3e-3; "
                 "2e-3 for inertial, 5e-4 for euler",
         .kind = CLI_NUMBER,
         .target = &solve_options->tolerance,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "gap",
         .value = "GAP",
         .help = "stop also when the relative gap of the cost is less; if the run ends with\na "
                 "larger one, the exit code is 9; default: not used",
         .kind = CLI_NUMBER,
         .target = &solve_options->gap_tolerance,
         .lo = DBL_MIN,
         .hi = 1,
         .expected = "a number in (0, 1]"},
        {.name = "max-steps",
         .value = "N",
         .help = "give up after so many steps (exit code 7); default: 60, and 240\n"
                 "more where steps must be solved better; 2000 for inertial and euler",
         .kind = CLI_INTEGER,
         .target = &request->max_steps,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number"},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_method(solve_table *table, solve_request *request)
{
    static const char *const starts[] = {"distance", "uniform", NULL}; /* as dmk_start */
    const cli_option rows[] = {
        {.name = "threshold",
         .value = "EPS",
         .help = "bound of the approximate cut locus {mu <= EPS}, the array `acl`;\n"
                 "default: a rule from u that needs no bound",
         .kind = CLI_NUMBER,
         .target = &request->solve.threshold,
         .lo = DBL_MIN,
         .hi = DBL_MAX,
         .expected = "a number above 0"},
        {.name = "start",
         .value = "NAME",
         .help = "what the iteration starts from: distance (default), the exact\ndistance, or "
                 "uniform, mu = 1, as meshes of needles always do",
         .kind = CLI_CHOICE,
         .target = &request->start,
         .choices = starts},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
    solve_add_iteration(table, request);
}

/* PoCL keeps kernels of its own, and does not start where it cannot: those go below the folder as well. */
static int settle_cache(const solve_request *request)
{
    const char *folder = request->device.cache;
    char below[PATH_MAX];
    struct stat file;
    if (!folder || !*folder) return EXIT_OK;
    if (stat(folder, &file) == 0 && !S_ISDIR(file.st_mode))
        return cli_error(EXIT_USAGE, "--cache: '%s' is not a folder", folder);
    if (snprintf(below, sizeof below, "%s/pocl", folder) < PATH_MAX)
        setenv("POCL_CACHE_DIR", below, 0); /* not where it is set */
    return EXIT_OK;
}

int solve_request_convert(solve_request *request)
{
    request->device.threads = (int)request->threads;
    request->device.single_precision = request->single;
    request->solve.method = (dmk_method)request->method;
    request->solve.start = (dmk_start)request->start;
    request->solve.density_only = request->density_only;
    request->solve.max_steps = (int)request->max_steps;
    const bool file = request->report && !cli_is_stdout(request->report);
    if (request->json && file) {
        return cli_error(EXIT_USAGE, "%s: give --report FILE or --json, not both",
                         request->command);
    }
    if (request->json || request->report) request->report = file ? request->report : "-";
    if (request->solve.dt > 0 && request->solve.method != DMK_EULER) {
        return cli_error(EXIT_USAGE, "%s: --dt is for --method euler", request->command);
    }
    if (request->solve.inertia >= 0 && request->solve.method != DMK_INERTIAL) {
        return cli_error(EXIT_USAGE, "%s: --inertia is for --method inertial", request->command);
    }
    return settle_cache(request);
}

int solve_request_settle(solve_request *request)
{
    const int n = (request->source.n > 0) + (request->vertex >= 0) + (request->sources != NULL);
    const int code = solve_request_convert(request);
    if (code != EXIT_OK) return code;
    if (n == 0) {
        const bool many = strcmp(request->command, "solve") == 0;
        return cli_error(EXIT_USAGE, "%s: no source given: use --source X,Y,Z%s --vertex I%s",
                         request->command, many ? "," : " or", many ? " or --sources FILE" : "");
    }
    if (n > 1 && request->sources) {
        return cli_error(EXIT_USAGE, "%s: give one of --source, --vertex and --sources",
                         request->command);
    }
    if (n > 1) {
        return cli_error(EXIT_USAGE, "%s: give --source or --vertex, not both", request->command);
    }
    return solve_request_check_report(request);
}

bool solve_reports_to_file(const solve_request *request)
{
    return request->report && strcmp(request->report, "-") != 0;
}

int solve_request_check_report(const solve_request *request)
{
    const bool file = solve_reports_to_file(request);
    return file ? cli_check_output("report", request->report, CLI_REPORT, NULL) : EXIT_OK;
}

/* Whether the pieces that a PVTP file names, a line each, are there; of other files there are none. */
static bool has_pieces(const char *path)
{
    char *piece = cli_name_piece(path, 0), *line = NULL;
    size_t room = 0;
    bool whole = true;
    FILE *file = piece ? fopen(path, "r") : NULL;
    for (int k = 0; file && whole && getline(&line, &room, file) >= 0;) {
        if (!strstr(line, "<Piece ")) continue;
        free(piece);
        piece = cli_name_piece(path, k++);
        whole = piece && cli_is_file(piece);
    }
    if (file) fclose(file);
    free(line);
    free(piece);
    return whole;
}

static bool are_files(const cli_files *files)
{
    for (int i = 0; i < files->n; i++) {
        if (!cli_is_file(files->path[i]) || !has_pieces(files->path[i])) return false;
    }
    return true;
}

bool solve_has_files(const solve_request *request)
{
    return are_files(&request->out) && are_files(&request->locus) && are_files(&request->tangent);
}

void solve_request_uses(const solve_request *request, cli_uses *uses)
{
    cli_use(uses, NULL, request->mesh);
    cli_use(uses, NULL, request->sources);
    cli_use_files(uses, "out", &request->out);
    cli_use_files(uses, "locus", &request->locus);
    cli_use_files(uses, "tangent", &request->tangent);
    cli_use(uses, request->json ? "json" : "report", request->report);
}
