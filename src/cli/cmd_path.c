/* dmkcl path: the minimal geodesic between a point of the surface and the source. */
#include "solve.h"

#include <limits.h>

typedef struct path_order {
    solve_order solve;
    cli_numbers to;
    int64_t to_vertex; /* -1: not given */
    cli_files out;
} path_order;

static int place_end(const path_order *order, const solve_run *run, dmk_point *end)
{
    if (order->to_vertex >= 0) {
        return dmk_mesh_vertex_point(run->context, run->mesh, order->to_vertex, end);
    }
    return dmk_mesh_project(run->context, run->mesh, order->to.value, end);
}

static void print_path(const path_order *order, const solve_run *run, const dmk_path *path)
{
    char from[CLI_TEXT_SIZE], to[CLI_TEXT_SIZE];
    double a[3] = {0}, b[3] = {0};
    dmk_mesh_point_xyz(run->context, run->mesh, &path->point[0], a);
    dmk_mesh_point_xyz(run->context, run->mesh, &path->point[path->n - 1], b);
    printf("path from (%s) to (%s): length %.10g, %zu triangles\n", cli_point(a, from),
           cli_point(b, to), path->length, path->n - 1);
    for (int i = 0; i < order->out.n; i++)
        printf("wrote %s\n", order->out.path[i]);
}

/* The end is looked at before the long work begins. */
static int trace(const path_order *order, solve_run *run, dmk_path *path)
{
    dmk_point end;
    int rc = place_end(order, run, &end);
    if (rc != DMK_OK) return solve_fail(run, rc);
    const int code = solve_compute(&order->solve, run);
    if (code != EXIT_OK) return code;
    rc = dmk_path_compute(run->context, run->mesh, run->result, 1, &end, path);
    for (int i = 0; i < order->out.n && rc == DMK_OK; i++) {
        rc = solve_go_on();
        if (rc == DMK_OK) rc = dmk_path_write(run->context, run->mesh, path, order->out.path[i]);
    }
    cli_progress_end(&run->progress);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int run_path(const path_order *order)
{
    solve_run run;
    dmk_path path = {0};
    int code = solve_begin(&order->solve, &run);
    if (code == EXIT_OK) code = trace(order, &run, &path);
    if (code == EXIT_OK && !order->solve.quiet) {
        print_path(order, &run, &path);
        code = cli_flush();
    }
    dmk_path_free(&path);
    solve_end(&run);
    return code;
}

static int check_order(path_order *order)
{
    int code = solve_order_settle(&order->solve);
    if (code == EXIT_OK && (order->to.n > 0) + (order->to_vertex >= 0) != 1) {
        code = cli_error(EXIT_USAGE, "path: where to? Give one of --to X,Y,Z and --to-vertex J");
    }
    return code == EXIT_OK ? cli_check_outputs("out", &order->out, CLI_LOCUS) : code;
}

static int parse(path_order *order, const char *out_help, int argc, char **argv)
{
    solve_table table = {.n = 0};
    const cli_option rows[] = {
        {.name = "to",
         .value = "X,Y,Z",
         .help = "the end: the point of the surface nearest to this one",
         .kind = CLI_POINT,
         .target = &order->to},
        {.name = "to-vertex",
         .value = "J",
         .help = "the end is vertex J, counted from 0",
         .kind = CLI_INTEGER,
         .target = &order->to_vertex,
         .lo = 0,
         .hi = INT_MAX,
         .expected = "a vertex number, from 0"},
        {.name = "out",
         .value = "FILE",
         .help = out_help,
         .kind = CLI_FILES,
         .target = &order->out},
    };
    solve_add_source(&table, &order->solve);
    solve_add(&table, rows, sizeof rows / sizeof *rows);
    solve_add_device(&table, &order->solve);
    const cli_syntax syntax = {
        .command = "path",
        .usage = "MESH (--source X,Y,Z | --vertex I) (--to X,Y,Z | --to-vertex J) [OPTIONS]",
        .summary = "A minimal geodesic from a point of the surface MESH back to the source, exact on the\n"
                   "polyhedron, and its length.",
        .operand = "MESH",
        .notes = "The line is straight in every triangle and over the edges; it bends at saddle vertices\n"
                 "and at the border where they are in the way. The file begins at the source. Of\n"
                 "several minimal geodesics (the end lies on the cut locus) it is one.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &order->solve.mesh);
}

int cmd_path(int argc, char **argv)
{
    path_order order = {.to_vertex = -1};
    char suffixes[512], help[600];
    cli_suffixes(CLI_LOCUS, suffixes, sizeof suffixes);
    snprintf(help, sizeof help, "write the path as a line; may be given again:\n%s", suffixes);
    solve_order_init(&order.solve, "path");
    int code = parse(&order, help, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = check_order(&order);
    return code == EXIT_OK ? run_path(&order) : code;
}
