/* dmkcl distance: exact geodesic distances from points and from the border. */
#include "solve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct distance_request {
    solve_request solve; /* what it shares with the commands that solve */
    bool border, exact;
    double tolerance; /* 0: not given */
} distance_request;

typedef struct distance_run {
    dmk_context *context;
    dmk_mesh *mesh;
    dmk_repairs repairs;
    dmk_geodesics *geodesics;
    dmk_locus *locus;  /* of the sources as a set; NULL: not asked for */
    dmk_point *source; /* n */
    size_t n;
    bool border;                                /* is a source: asked for, and there */
    double begin, read, distance, trace, write; /* seconds */
    bool quiet;
    cli_progress progress;
} distance_run;

static int fail(distance_run *run, int rc)
{
    cli_progress_end(&run->progress);
    return cli_library_error(run->context, rc);
}

/* ---- the run -------------------------------------------------------------------------------- */

static int find_source(distance_run *run, const solve_source *s, dmk_point *point)
{
    if (s->vertex >= 0)
        return dmk_repairs_vertex_point(run->context, run->mesh, &run->repairs, s->vertex, point);
    return cli_project(run->context, run->mesh, s->xyz, run->quiet, point);
}

/* Whether the border is a source; a mesh without one is warned of, if there are other sources. */
static bool place_border(const distance_request *request, const distance_run *run)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(run->mesh, &info);
    if (request->border && info.n_border_edges == 0 && run->n > 0 && !run->quiet)
        fprintf(stderr,
                "dmkcl: warning: %s is closed, and has no border that --border could take\n",
                request->solve.mesh);
    return request->border && info.n_border_edges > 0;
}

/* All sources of the command line, as one set. */
static int place_all(const distance_request *request, distance_run *run)
{
    int code = EXIT_OK, rc = DMK_OK;
    solve_source *list = NULL, one = {.line = 0, .vertex = request->solve.vertex};
    size_t n = request->solve.vertex >= 0 || request->solve.source.n > 0;
    memcpy(one.xyz, request->solve.source.value, sizeof one.xyz);
    if (request->solve.sources) code = solve_read_sources(request->solve.sources, &list, &n);
    if (code == EXIT_OK && n > 0) {
        run->source = calloc(n, sizeof *run->source);
        if (!run->source) code = cli_library_error(NULL, DMK_E_NOMEM);
    }
    for (size_t i = 0; code == EXIT_OK && i < n; i++) {
        rc = find_source(run, list ? list + i : &one, run->source + i);
        if (rc == DMK_OK) continue;
        if (list) {
            code = cli_error(cli_exit_code(rc), "%s:%lld: %s", request->solve.sources,
                             (long long)list[i].line, dmk_context_message(run->context));
        } else {
            code = fail(run, rc);
        }
    }
    run->n = code == EXIT_OK ? n : 0;
    run->border = code == EXIT_OK && place_border(request, run);
    free(list);
    return code;
}

static int trace(const distance_request *request, distance_run *run)
{
    if (request->solve.locus.n == 0) return DMK_OK;
    return dmk_geodesics_locus(run->context, run->geodesics, &request->solve.trace, &run->locus);
}

static int write_files(const distance_request *request, const distance_run *run)
{
    int rc = DMK_OK;
    for (int i = 0; rc == DMK_OK && i < request->solve.out.n; i++)
        rc =
            dmk_geodesics_write(run->context, run->geodesics, cli_path(request->solve.out.path[i]));
    for (int i = 0; rc == DMK_OK && i < request->solve.locus.n; i++)
        rc = dmk_locus_write(run->context, run->locus, cli_path(request->solve.locus.path[i]));
    return rc;
}

static int compute(const distance_request *request, distance_run *run)
{
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    options.border = request->border;
    options.exact = request->exact;
    options.tolerance = request->tolerance;
    double mark = cli_seconds();
    int rc = dmk_geodesics_create(run->context, run->mesh, run->n, run->source, &options,
                                  &run->geodesics);
    run->distance = cli_seconds() - mark;
    mark = cli_seconds();
    if (rc == DMK_OK) rc = trace(request, run);
    run->trace = cli_seconds() - mark;
    mark = cli_seconds();
    if (rc == DMK_OK) rc = write_files(request, run);
    run->write = cli_seconds() - mark;
    cli_progress_end(&run->progress);
    return rc == DMK_OK ? EXIT_OK : fail(run, rc);
}

/* ---- what is printed ------------------------------------------------------------------------ */

static void write_report(FILE *file, const distance_request *request, const distance_run *run)
{
    cli_json json = {.file = file};
    dmk_mesh_info mesh;
    dmk_geodesics_info info;
    dmk_mesh_get_info(run->mesh, &mesh);
    dmk_geodesics_get_info(run->geodesics, &info);
    double integral = NAN, error = NAN;
    dmk_geodesics_integrate(run->context, run->geodesics, &integral, &error);
    json_open(&json, NULL, '{');
    json_text(&json, "dmkcl", dmk_version());
    json_open(&json, "mesh", '{');
    json_text(&json, "file", request->solve.mesh);
    json_mesh(&json, &mesh);
    json_repairs(&json, &run->repairs);
    json_close(&json, '{');
    json_integer(&json, "n_sources", (int64_t)run->n);
    json_bool(&json, "border", run->border);
    json_integer(&json, "n_reached", (int64_t)info.n_reached);
    json_number(&json, "farthest", info.farthest);
    json_number(&json, "error", info.error);
    json_number(&json, "tolerance", info.tolerance);
    json_integer(&json, "n_beyond", (int64_t)info.n_beyond);
    json_number(&json, "integral", integral);
    json_number(&json, "integral_error", error);
    json_integer(&json, "windows", (int64_t)info.n_windows);
    json_open(&json, "seconds", '{');
    json_number(&json, "read", run->read);
    json_number(&json, "distance", run->distance);
    if (run->locus) json_number(&json, "locus", run->trace);
    json_number(&json, "write", run->write);
    json_number(&json, "total", cli_seconds() - run->begin);
    json_close(&json, '{');
    json_integer(&json, "peak_memory", (int64_t)cli_peak_memory());
    if (run->locus) solve_report_locus(&json, run->locus);
    solve_report_names(&json, "out", &request->solve.out);
    if (run->locus) solve_report_names(&json, "locus_out", &request->solve.locus);
    json_close(&json, '{');
}

static void print_distance(const dmk_geodesics_info *info)
{
    char text[CLI_TEXT_SIZE];
    printf("%-10s farthest %.10g", "distance", info->farthest);
    cli_counted((int64_t)info->n_beyond, "vertex", "vertices", text);
    if (info->error <= 0)
        printf(", exact");
    else if (info->n_beyond == 0)
        printf(", within %.1g of each", info->error);
    else if (info->tolerance > 0)
        printf(", within %g of each but %s, there within %.3g", info->tolerance, text, info->error);
    else
        printf(", within %.1g of each, not exact at %s", info->error, text);
    putchar('\n');
}

static void print_summary(const distance_request *request, const distance_run *run)
{
    char text[CLI_TEXT_SIZE], more[CLI_TEXT_SIZE];
    dmk_mesh_info mesh;
    dmk_geodesics_info info;
    dmk_mesh_get_info(run->mesh, &mesh);
    dmk_geodesics_get_info(run->geodesics, &info);
    printf("%-10s %s: %s, %s\n", "mesh", request->solve.mesh,
           cli_counted((int64_t)mesh.n_vertices, "vertex", "vertices", text),
           cli_counted((int64_t)mesh.n_triangles, "triangle", "triangles", more));
    printf("%-10s ", "sources");
    if (run->n > 0) fputs(cli_counted((int64_t)run->n, "point", "points", text), stdout);
    if (run->border) printf("%sthe border", run->n > 0 ? " and " : "");
    putchar('\n');
    print_distance(&info);
    if (info.n_reached + mesh.n_unused_vertices < mesh.n_vertices) {
        printf("%-10s %s on components without a source\n", "",
               cli_counted((int64_t)(mesh.n_vertices - mesh.n_unused_vertices - info.n_reached),
                           "vertex lies", "vertices lie", text));
    }
    if (run->locus) solve_summary_locus(run->locus);
    printf("%-10s %.2f s: read %.2f, distance %.2f, ", "time", cli_seconds() - run->begin,
           run->read, run->distance);
    if (run->locus) printf("locus %.2f, ", run->trace);
    printf("write %.2f; memory %s\n", run->write, cli_bytes(cli_peak_memory(), text));
    for (int i = 0; i < request->solve.out.n; i++)
        printf("%-10s %s\n", "wrote", request->solve.out.path[i]);
    for (int i = 0; i < request->solve.locus.n; i++)
        printf("%-10s %s: cut locus\n", "wrote", request->solve.locus.path[i]);
}

static int report(const distance_request *request, const distance_run *run)
{
    cli_file file;
    if (!request->solve.report) return EXIT_OK;
    const int code = cli_report_open(request->solve.report, &file);
    if (code != EXIT_OK) return code;
    write_report(file.stream, request, run);
    return cli_file_close(&file);
}

static int run_distance(const distance_request *request)
{
    distance_run run = {.begin = cli_seconds(),
                        .quiet = request->solve.quiet,
                        .progress.line = isatty(STDERR_FILENO) && !request->solve.quiet,
                        .progress.steps = request->solve.verbose,
                        .progress.gap = NAN};
    int rc = dmk_context_create(&run.context);
    if (rc != DMK_OK) return cli_library_error(NULL, rc);
    dmk_context_set_threads(run.context, (int)request->solve.threads);
    dmk_context_set_format(run.context, request->solve.format); /* checked when it was asked for */
    cli_watch(run.context, &run.progress);
    const cli_reading how = {.repair = request->solve.repair,
                             .quiet = request->solve.quiet,
                             .progress = &run.progress,
                             .keep_memory = true};
    rc = cli_read_mesh(run.context, request->solve.mesh, &how, &run.repairs, &run.mesh);
    run.read = cli_seconds() - run.begin;
    int code = rc == DMK_OK ? place_all(request, &run) : fail(&run, rc);
    if (code == EXIT_OK) code = compute(request, &run);
    if (code == EXIT_OK) code = report(request, &run);
    const bool reported = request->solve.report && strcmp(request->solve.report, "-") == 0;
    if (code == EXIT_OK && !request->solve.quiet && !reported) {
        print_summary(request, &run);
        code = cli_flush();
    }
    free(run.source);
    dmk_locus_destroy(&run.locus);
    dmk_geodesics_destroy(&run.geodesics);
    dmk_mesh_destroy(&run.mesh);
    dmk_repairs_free(&run.repairs);
    dmk_context_destroy(&run.context);
    return code;
}

/* ---- the command line ----------------------------------------------------------------------- */

static int check_request(distance_request *r)
{
    const int n = (r->solve.source.n > 0) + (r->solve.vertex >= 0) + (r->solve.sources != NULL);
    if (n == 0 && !r->border) {
        return cli_error(
            EXIT_USAGE,
            "distance: no source given: use --source X,Y,Z, --vertex I, --sources FILE or "
            "--border");
    }
    if (n > 1) {
        return cli_error(
            EXIT_USAGE, "distance: give one of --source, --vertex and --sources; a file of sources "
                        "holds any number of both");
    }
    int code = solve_request_convert(&r->solve);
    if (code == EXIT_OK) code = solve_request_check_report(&r->solve);
    if (code == EXIT_OK)
        code = cli_check_outputs("out", &r->solve.out, CLI_RESULT, r->solve.format);
    if (code == EXIT_OK)
        code = cli_check_outputs("locus", &r->solve.locus, CLI_LOCUS, r->solve.format);
    cli_uses uses = {.n = 0};
    solve_request_uses(&r->solve, &uses);
    return code == EXIT_OK ? cli_check_uses(&uses) : code;
}

static void add_distance(solve_table *table, distance_request *r, const char *out_help,
                         const char *locus_help)
{
    const cli_option rows[] = {
        {.name = "sources",
         .value = "FILE",
         .help = "all sources of a file, as one set, one per line: X,Y,Z or `vertex I`",
         .kind = CLI_TEXT,
         .target = &r->solve.sources},
        {.name = "border",
         .help = "the border of the mesh is a source too",
         .kind = CLI_FLAG,
         .target = &r->border},
        {.name = "tolerance",
         .value = "T",
         .help = "allow an error of T times the distance; default: 0 up to 450,000\ntriangles, "
                 "1e-6 beyond",
         .kind = CLI_NUMBER,
         .target = &r->tolerance,
         .lo = 1e-9,
         .hi = 0.01,
         .expected = "a number from 1e-9 to 0.01"},
        {.name = "exact",
         .help = "no error, whatever the size",
         .kind = CLI_FLAG,
         .target = &r->exact},
        {.name = "out",
         .value = "FILE",
         .help = out_help,
         .kind = CLI_FILES,
         .target = &r->solve.out},
        {.name = "locus",
         .value = "FILE",
         .help = locus_help,
         .kind = CLI_FILES,
         .target = &r->solve.locus},
        cli_format_option(&r->solve.format, CLI_RESULT, CLI_LOCUS),
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

static int parse(distance_request *r, int argc, char **argv)
{
    solve_table table = {.n = 0};
    char suffixes[512], out[700], locus[700];
    cli_suffixes(CLI_RESULT, suffixes, sizeof suffixes);
    snprintf(out, sizeof out,
             "write mesh, distance, direction and nearest; may be given\nagain: %s", suffixes);
    cli_suffixes(CLI_LOCUS, suffixes, sizeof suffixes);
    snprintf(locus, sizeof locus,
             "write the cut locus of the sources as one set: borders of their\n"
             "Voronoi cells and what these have inside, as lines; may be given again:\n%s",
             suffixes);
    solve_add_source(&table, &r->solve);
    add_distance(&table, r, out, locus);
    solve_add_strength(&table, &r->solve);
    solve_add_report(&table, &r->solve);
    solve_add_host(&table, &r->solve);
    const cli_syntax syntax = {
        .command = "distance",
        .usage = "MESH (--source X,Y,Z | --vertex I | --sources FILE | --border) [OPTIONS]",
        .summary =
            "Exact geodesic distances from one or many points of the surface MESH, and from its\n"
            "border, to all vertices. Needs no OpenCL device.",
        .operand = "MESH",
        .notes =
            "Point data: distance; direction, the angle (radians) at the nearest source in which "
            "the\n"
            "shortest path leaves it; nearest, the number of that source, from 0 in the order of "
            "the\n"
            "file, the border last. Where no source reaches, the distance is infinite and nearest "
            "is -1.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &r->solve.mesh);
}

int cmd_distance(int argc, char **argv)
{
    distance_request request = {.border = false};
    solve_request_init(&request.solve, "distance");
    request.solve.bare = true;
    int code = parse(&request, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = check_request(&request);
    return code == EXIT_OK ? run_distance(&request) : code;
}
