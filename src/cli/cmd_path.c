/* dmkcl path: the minimal geodesic between a point of the surface and the source. */
#include "solve.h"

#include <limits.h>
#include <math.h>

typedef struct path_request {
    solve_request solve;
    cli_numbers to;
    int64_t to_vertex; /* -1: not given */
    cli_files out;
} path_request;

static int place_end(const path_request *request, const solve_run *run, dmk_point *end)
{
    if (request->to_vertex >= 0) {
        return dmk_repairs_vertex_point(run->context, run->mesh, &run->repairs, request->to_vertex,
                                        end);
    }
    return cli_project(run->context, run->mesh, request->to.value, request->solve.quiet, end);
}

static void print_path(const path_request *request, const solve_run *run, const dmk_path *path)
{
    char from[CLI_TEXT_SIZE], to[CLI_TEXT_SIZE], n[CLI_TEXT_SIZE];
    double a[3] = {0}, b[3] = {0};
    dmk_mesh_point_xyz(run->context, run->mesh, &path->point[0], a);
    dmk_mesh_point_xyz(run->context, run->mesh, &path->point[path->n - 1], b);
    printf("path from (%s) to (%s): length %.10g, %s\n", cli_point(a, from), cli_point(b, to),
           path->length, cli_counted((int64_t)path->n - 1, "triangle", "triangles", n));
    for (int i = 0; i < request->out.n; i++) printf("wrote %s\n", request->out.path[i]);
}

/* What the report says of the path. */
typedef struct outcome {
    const path_request *request;
    const dmk_path *path;
    double seconds; /* to find it */
} outcome;

static void report_path(cli_json *json, const solve_run *run, const void *data)
{
    const outcome *t = data;
    const dmk_path *path = t->path;
    const dmk_point *end = &path->point[path->n - 1];
    double xyz[3] = {NAN, NAN, NAN};
    dmk_mesh_point_xyz(run->context, run->mesh, end, xyz);
    json_open(json, "end", '{');
    json_numbers(json, "xyz", xyz, 3);
    json_integer(json, "triangle", end->triangle);
    json_numbers(json, "weight", end->weight, 3);
    json_close(json, '{');
    json_open(json, "path", '{');
    json_number(json, "length", path->length);
    json_integer(json, "n_triangles", (int64_t)path->n - 1);
    solve_report_names(json, "out", &t->request->out);
    json_close(json, '{');
    solve_report_seconds(json, run, "path", t->seconds);
}

/* The end is looked at before the long work begins. *seconds: to find the path. */
static int trace(const path_request *request, solve_run *run, dmk_path *path, double *seconds)
{
    double mark = cli_seconds();
    dmk_point end;
    int rc = place_end(request, run, &end);
    if (rc != DMK_OK) return solve_fail(run, rc);
    dmk_geodesics *geodesics = NULL;
    rc = dmk_geodesics_create(run->context, run->mesh, 1, &run->source, NULL, &geodesics);
    if (rc == DMK_OK) rc = solve_go_on();
    if (rc == DMK_OK) rc = dmk_geodesics_paths(run->context, geodesics, 1, &end, path);
    dmk_geodesics_destroy(&geodesics);
    *seconds = cli_seconds() - mark;
    mark = cli_seconds();
    for (int i = 0; i < request->out.n && rc == DMK_OK; i++) {
        rc = solve_go_on();
        if (rc == DMK_OK)
            rc = dmk_path_write(run->context, run->mesh, path, cli_path(request->out.path[i]));
    }
    run->seconds.write = cli_seconds() - mark;
    cli_progress_end(&run->progress);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int run_path(const path_request *request)
{
    solve_run run;
    dmk_path path = {0};
    double seconds = 0;
    int code = solve_begin(&request->solve, &run);
    if (code == EXIT_OK) code = trace(request, &run, &path, &seconds);
    if (code == EXIT_OK && request->solve.report) {
        const outcome t = {request, &path, seconds};
        code = solve_report_more(&request->solve, &run, report_path, &t);
    }
    if (code == EXIT_OK && solve_prints_summary(&request->solve)) {
        print_path(request, &run, &path);
        code = cli_flush();
    }
    dmk_path_free(&path);
    solve_end(&run);
    return code;
}

static int check_request(path_request *request)
{
    int code = solve_request_settle(&request->solve);
    if (code == EXIT_OK && request->to.n == 0 && request->to_vertex < 0)
        code = cli_error(EXIT_USAGE, "path: no end given: use --to X,Y,Z or --to-vertex J");
    if (code == EXIT_OK)
        code = cli_check_outputs("out", &request->out, CLI_LOCUS, request->solve.format);
    cli_uses uses = {.n = 0};
    solve_request_uses(&request->solve, &uses);
    cli_use_files(&uses, "out", &request->out);
    return code == EXIT_OK ? cli_check_uses(&uses) : code;
}

static int parse(path_request *request, const char *out_help, int argc, char **argv)
{
    solve_table table = {.n = 0};
    const cli_option rows[] = {
        {.name = "to",
         .value = "X,Y,Z",
         .help = "the end: the point of the surface nearest to this one",
         .kind = CLI_POINT,
         .target = &request->to},
        {.name = "to-vertex",
         .value = "J",
         .help = "the end is vertex J, counted from 0",
         .kind = CLI_INTEGER,
         .target = &request->to_vertex,
         .lo = 0,
         .hi = INT_MAX,
         .expected = "a vertex number"},
        {.name = "out",
         .value = "FILE",
         .help = out_help,
         .kind = CLI_FILES,
         .target = &request->out},
        cli_format_option(&request->solve.format, CLI_LOCUS, CLI_LOCUS),
    };
    solve_add_source(&table, &request->solve);
    solve_add(&table, rows, sizeof rows / sizeof *rows);
    solve_add_report(&table, &request->solve);
    solve_add_host(&table, &request->solve);
    const cli_syntax syntax = {
        .command = "path",
        .usage = "MESH (--source X,Y,Z | --vertex I) (--to X,Y,Z | --to-vertex J) [OPTIONS]",
        .summary =
            "A minimal geodesic from a point of the surface MESH back to the source, exact on the\n"
            "polyhedron, and its length. Needs no OpenCL device.",
        .operand = "MESH",
        .notes = "The line is straight in every triangle and over the edges; it bends at saddle "
                 "vertices\n"
                 "and at the border where they are in the way. The file begins at the source. Of\n"
                 "several minimal geodesics (the end lies on the cut locus) it is one.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &request->solve.mesh);
}

int cmd_path(int argc, char **argv)
{
    path_request request = {.to_vertex = -1};
    char suffixes[512], help[600];
    cli_suffixes(CLI_LOCUS, suffixes, sizeof suffixes);
    snprintf(help, sizeof help, "write the path as a line; may be given again:\n%s", suffixes);
    solve_request_init(&request.solve, "path");
    request.solve.bare = true;
    int code = parse(&request, help, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = check_request(&request);
    return code == EXIT_OK ? run_path(&request) : code;
}
