/* dmkcl solve: from a mesh and a point, or many, to density, distance and cut locus. */
#include "ranks.h"
#include "solve.h"

#include <stdlib.h>
#include <string.h>

static int solve(const solve_request *request)
{
    solve_run run;
    const bool summary = solve_prints_summary(request);
    int code = solve_begin(request, &run);
    if (code == EXIT_OK) code = solve_together(&run);
    if (code == EXIT_OK) code = solve_compute(request, &run);
    if (code == EXIT_OK) code = solve_write(request, &run);
    if (code == EXIT_OK && summary && cli_ranks_first()) {
        solve_summary(request, &run);
        code = cli_flush();
    }
    if (code == EXIT_OK) code = solve_check_gap(request, &run);
    solve_end(&run);
    return code;
}

/* Mesh and sources are read and looked at; no device is opened and nothing is written but the report. */
static int plan(solve_request *request)
{
    solve_run run;
    solve_source *sources = NULL;
    size_t n = 0;
    request->bare = true;
    int code = request->sources ? solve_read_sources(request->sources, &sources, &n) : EXIT_OK;
    if (code != EXIT_OK) return code;
    code = solve_begin(request, &run);
    if (code == EXIT_OK) {
        const int placed = solve_check_sources(request, &run, sources, n);
        cli_progress_end(&run.progress);
        if (cli_ranks_first()) code = solve_print_plan(request, &run);
        if (placed != EXIT_OK) code = placed;
    }
    free(sources);
    solve_end(&run);
    return code;
}

/* The files of many sources are numbered: one stream cannot be all of them, but it may swallow them. */
static int check_many(const solve_request *request)
{
    enum { N = 3 };
    const cli_files *const files[N] = {&request->out, &request->locus, &request->tangent};
    for (size_t k = 0; request->sources && k < N; k++) {
        for (int i = 0; i < files[k]->n; i++) {
            const char *path = files[k]->path[i];
            if (!cli_is_stream(path) || cli_is_sink(path)) continue;
            return cli_error(EXIT_USAGE,
                             "solve: --sources writes a file for each source, and '%s' "
                             "is one stream: give a name",
                             path);
        }
    }
    return EXIT_OK;
}

static int check_request(solve_request *request)
{
    const bool report = solve_reports_to_file(request);
    int code = solve_request_settle(request);
    if (code == EXIT_OK && request->resume && !report && request->out.n == 0 &&
        request->locus.n == 0 && request->tangent.n == 0) {
        code = cli_error(EXIT_USAGE, "solve: --resume skips sources whose files exist: give --out, "
                                     "--locus, --tangent or --report");
    }
    if (code == EXIT_OK)
        code = cli_check_outputs("out", &request->out, CLI_RESULT, request->format);
    if (code == EXIT_OK)
        code = cli_check_outputs("locus", &request->locus, CLI_LOCUS, request->format);
    if (code == EXIT_OK) code = cli_check_outputs("tangent", &request->tangent, CLI_TANGENT, NULL);
    if (code == EXIT_OK) code = check_many(request);
    cli_uses uses = {.n = 0};
    solve_request_uses(request, &uses);
    return code == EXIT_OK ? cli_check_uses(&uses) : code;
}

/* The options that are not of the library's types. */
typedef struct raw_options {
    char out_help[600], locus_help[600];
} raw_options;

static void add_files(solve_table *table, solve_request *request, raw_options *raw)
{
    const cli_option rows[] = {
        {.name = "sources",
         .value = "FILE",
         .help = "many sources, one per line: X,Y,Z or `vertex I`; # begins a comment",
         .kind = CLI_TEXT,
         .target = &request->sources},
        {.name = "resume",
         .help = "of --sources, skip those whose files all exist",
         .kind = CLI_FLAG,
         .target = &request->resume},
        {.name = "density-only",
         .help = "density, potential and cost alone, no distance and no cut locus; of\n"
                 "several ranks each then has a share of the mesh only",
         .kind = CLI_FLAG,
         .target = &request->density_only},
        {.name = "dry-run",
         .help = "read and check the mesh and each source, report how much memory a solve\n"
                 "takes on host and device, and end; opens no device",
         .kind = CLI_FLAG,
         .target = &request->dry},
        {.name = "out",
         .value = "FILE",
         .help = raw->out_help,
         .kind = CLI_FILES,
         .target = &request->out},
        {.name = "locus",
         .value = "FILE",
         .help = raw->locus_help,
         .kind = CLI_FILES,
         .target = &request->locus},
        {.name = "tangent",
         .value = "FILE",
         .help = "write the tangent cut locus as CSV, sorted by angle: direction at\n"
                 "the source in radians, cut time, position and kind of the point\n"
                 "(0 ordinary, 1 end, 2 branch point, 3 isolated)",
         .kind = CLI_FILES,
         .target = &request->tangent},
        cli_format_option(&request->format, CLI_RESULT, CLI_LOCUS),
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

static int parse(solve_request *request, raw_options *raw, int argc, char **argv)
{
    solve_table table = {.n = 0};
    solve_add_source(&table, request);
    add_files(&table, request, raw);
    solve_add_report(&table, request);
    solve_add_strength(&table, request);
    solve_add_method(&table, request);
    solve_add_device(&table, request);
    const cli_syntax syntax = {
        .command = "solve",
        .usage = "MESH (--source X,Y,Z | --vertex I | --sources FILE) [OPTIONS]",
        .summary =
            "The optimal transport density mu, the distance and the cut locus of a point on the\n"
            "surface MESH. The files are written at the end, each whole or not at all.",
        .operand = "MESH",
        .notes =
            "A terminal shows the progress. Ctrl-C ends the run, and nothing is written then.\n"
            "\n"
            "With --sources the mesh and the device are made ready once. The files of the first\n"
            "source are NAME-0000.SUFFIX, of the second NAME-0001.SUFFIX and so on, written as\n"
            "each is solved. A source that fails is reported, and the rest are solved; the exit "
            "code is\n"
            "that of the first failure. After an interruption --resume does what is left.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &request->mesh);
}

int cmd_solve(int argc, char **argv)
{
    solve_request request;
    raw_options raw = {0};
    char suffixes[512];
    cli_suffixes(CLI_RESULT, suffixes, sizeof suffixes);
    snprintf(raw.out_help, sizeof raw.out_help,
             "write mesh, mu, acl, u and distance; may be given again:\n%s", suffixes);
    cli_suffixes(CLI_LOCUS, suffixes, sizeof suffixes);
    snprintf(raw.locus_help, sizeof raw.locus_help,
             "write the cut locus as lines; may be given again:\n%s", suffixes);

    solve_request_init(&request, "solve");
    request.dealt = true;
    int code = parse(&request, &raw, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = check_request(&request);
    if (code != EXIT_OK) return code;
    if (request.dry) return plan(&request);
    request.once = !request.sources;
    return request.sources ? solve_batch(&request) : solve(&request);
}
