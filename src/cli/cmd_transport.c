/* dmkcl transport: from one measure on a mesh to another. */
#include "solve.h"
#include "transport.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

typedef struct transport_request {
    solve_request solve; /* mesh, device, method, files of the result, report */
    const char *from, *to;
    bool normalise;
} transport_request;

typedef struct transport_run {
    dmk_context *context;
    dmk_mesh *mesh;
    dmk_repairs repairs;
    dmk_device *device;
    dmk_solver *solver;
    dmk_transport *transport;
    cli_measure from, to;
    double begin, read, device_seconds, write; /* seconds */
    cli_progress progress;
} transport_run;

/* ---- the run -------------------------------------------------------------------------------- */

static int fail(transport_run *run, int rc)
{
    cli_progress_end(&run->progress);
    return cli_library_error(run->context, rc);
}

/* The library's words about a part of a measure, with the line of its file instead of its number; false: they are about
 * no part that has a line. */
static bool tell_line(const char *path, const cli_measure *m, const char *text)
{
    char kind[16];
    long long given;
    int used = 0;
    if (sscanf(text, ": %15[a-z] %lld%n", kind, &given, &used) != 2) return false;
    int64_t number = given;
    const int64_t line = cli_measure_line(m, kind, &number);
    if (line > 0)
        cli_error(EXIT_USAGE, "%s:%lld: %s %lld%s", path, (long long)line, kind, (long long)number,
                  text + used);
    return line > 0;
}

/* The library counts measures, and its words may begin with one. */
static int fail_measure(const transport_request *r, transport_run *run, int rc)
{
    static const char *const names[2] = {"the first measure", "the second measure"};
    const char *text = dmk_context_message(run->context);
    for (int k = 0; k < 2 && rc == DMK_E_ARG; k++) {
        const size_t n = strlen(names[k]);
        if (strncmp(text, names[k], n) != 0) continue;
        const char *path = k == 0 ? r->from : r->to;
        cli_progress_end(&run->progress);
        if (tell_line(path, k == 0 ? &run->from : &run->to, text + n)) return cli_exit_code(rc);
        return cli_error(cli_exit_code(rc), "--%s %s%s", k == 0 ? "from" : "to", path, text + n);
    }
    return fail(run, rc);
}

/* Points without masses need what has some. */
static int check_masses(const transport_request *r, const transport_run *run)
{
    if (!run->from.is_free || (r->to && !run->to.is_free)) return EXIT_OK;
    if (r->to)
        return cli_error(
            EXIT_USAGE,
            "--from %s and --to %s are points without a mass: one of the two needs masses", r->from,
            r->to);
    return cli_error(EXIT_USAGE,
                     "--from %s: points without a mass take what another measure has nearest to "
                     "them: give --to FILE",
                     r->from);
}

static int read_all(const transport_request *r, transport_run *run)
{
    const cli_reading how = {
        .repair = r->solve.repair, .quiet = r->solve.quiet, .progress = &run->progress};
    const int rc = cli_read_mesh(run->context, r->solve.mesh, &how, &run->repairs, &run->mesh);
    if (rc != DMK_OK) return fail(run, rc);
    const cli_ground ground = {run->context, run->mesh, &run->repairs, r->solve.quiet};
    int code = cli_measure_read(&ground, r->from, !r->to, &run->from);
    if (code == EXIT_OK && r->to) code = cli_measure_read(&ground, r->to, false, &run->to);
    if (code == EXIT_OK) code = check_masses(r, run);
    run->read = cli_seconds() - run->begin;
    return code;
}

static int compute(const transport_request *r, transport_run *run)
{
    dmk_solve_options options = r->solve.solve;
    options.normalise = r->normalise;
    double mark = cli_seconds();
    int rc = cli_device_open(run->context, &r->solve.device, &run->device);
    run->device_seconds = cli_seconds() - mark;
    if (rc == DMK_OK) rc = dmk_solver_create(run->context, run->device, run->mesh, &run->solver);
    if (rc == DMK_OK) {
        rc = dmk_solve_measures(run->context, run->solver, &run->from.measure,
                                r->to ? &run->to.measure : NULL, &options, &run->transport);
    }
    mark = cli_seconds();
    for (int i = 0; rc == DMK_OK && i < r->solve.out.n; i++)
        rc = dmk_transport_write(run->context, run->mesh, run->transport,
                                 cli_path(r->solve.out.path[i]));
    run->write = cli_seconds() - mark;
    cli_progress_end(&run->progress);
    return rc == DMK_OK ? EXIT_OK : fail_measure(r, run, rc);
}

/* ---- what is printed ------------------------------------------------------------------------ */

static void write_report(FILE *file, const transport_request *r, const transport_run *run)
{
    cli_json json = {.file = file};
    dmk_mesh_info mesh;
    dmk_device_info device;
    dmk_stats stats;
    dmk_transport_info info;
    dmk_mesh_get_info(run->mesh, &mesh);
    dmk_device_get_info(run->device, &device);
    dmk_transport_get_stats(run->transport, &stats);
    dmk_transport_get_info(run->transport, &info);
    json_open(&json, NULL, '{');
    json_text(&json, "dmkcl", dmk_version());
    json_open(&json, "mesh", '{');
    json_text(&json, "file", r->solve.mesh);
    json_mesh(&json, &mesh);
    json_repairs(&json, &run->repairs);
    json_close(&json, '{');
    json_text(&json, "from", r->from);
    if (r->to) json_text(&json, "to", r->to);
    json_number(&json, "mass", info.mass);
    json_number(&json, "area", stats.area);
    solve_report_stats(&json, &device, &stats, false);
    json_number(&json, "balance", info.balance);
    json_open(&json, "seconds", '{');
    json_number(&json, "read", run->read);
    json_number(&json, "device", run->device_seconds);
    json_number(&json, "setup", stats.seconds[DMK_STAGE_SETUP]);
    json_number(&json, "start", stats.seconds[DMK_STAGE_START]);
    json_number(&json, "solve", stats.seconds[DMK_STAGE_SOLVE]);
    json_number(&json, "certify", stats.seconds[DMK_STAGE_CERTIFY]);
    json_number(&json, "write", run->write);
    json_number(&json, "total", cli_seconds() - run->begin);
    json_close(&json, '{');
    json_integer(&json, "peak_memory", (int64_t)cli_peak_memory());
    solve_report_names(&json, "out", &r->solve.out);
    json_close(&json, '{');
}

static int report(const transport_request *r, const transport_run *run)
{
    cli_file file;
    if (!r->solve.report) return EXIT_OK;
    const int code = cli_report_open(r->solve.report, &file);
    if (code != EXIT_OK) return code;
    write_report(file.stream, r, run);
    return cli_file_close(&file);
}

static void print_time(const transport_run *run, const dmk_stats *stats)
{
    char memory[CLI_TEXT_SIZE];
    const double *seconds = stats->seconds;
    printf(
        "%-10s %.2f s: read %.2f, device %.2f, setup %.2f, start %.2f, solve %.2f, certify %.2f,\n",
        "time", cli_seconds() - run->begin, run->read, run->device_seconds,
        seconds[DMK_STAGE_SETUP], seconds[DMK_STAGE_START], seconds[DMK_STAGE_SOLVE],
        seconds[DMK_STAGE_CERTIFY]);
    printf("%-10s write %.2f; memory %s\n", "", run->write, cli_bytes(cli_peak_memory(), memory));
}

static void print_summary(const transport_request *r, const transport_run *run)
{
    char v[CLI_TEXT_SIZE], t[CLI_TEXT_SIZE];
    dmk_mesh_info mesh;
    dmk_stats stats;
    dmk_transport_info info;
    dmk_mesh_get_info(run->mesh, &mesh);
    dmk_transport_get_stats(run->transport, &stats);
    dmk_transport_get_info(run->transport, &info);
    printf("%-10s %s: %s, %s\n", "mesh", r->solve.mesh,
           cli_counted((int64_t)mesh.n_vertices, "vertex", "vertices", v),
           cli_counted((int64_t)mesh.n_triangles, "triangle", "triangles", t));
    printf("%-10s %.8g, from %s%s%s\n", "mass", info.mass, r->from,
           r->to ? " to " : ", positive to negative part", r->to ? r->to : "");
    printf("%-10s in %s with %s, %s precision\n", "solved",
           cli_counted(stats.steps, "step", "steps", v),
           cli_counted(stats.cg_iterations, "CG iteration", "CG iterations", t),
           stats.double_precision ? "double" : "single");
    printf(
        "%-10s between %.8g and %.8g (gap %.2g %%), mass times length, of the discrete problem\n",
        "W1", stats.cost_lower, stats.cost_upper, 100 * stats.gap);
    if (stats.gap > 0.01) {
        printf("%-10s %s\n", "",
               stats.n_steep > 0 ? "the lower bound is held back by triangles with |grad u| above 1"
                                 : "a smaller --tolerance may bring the bounds closer");
    }
    printf("%-10s %.6g on average\n", "way", info.mass > 0 ? stats.cost_upper / info.mass : 0);
    printf("%-10s the flux delivers every load within %.1g of the largest\n", "balance",
           info.balance);
    print_time(run, &stats);
    size_t n;
    const uint8_t *acl = dmk_transport_acl(run->transport, &n);
    if (acl) {
        int64_t marked = 0;
        for (size_t i = 0; i < n; i++) marked += acl[i];
        printf("%-10s %s, the cut locus of the points\n", "acl",
               cli_counted(marked, "triangle", "triangles", t));
    }
    for (int i = 0; i < r->solve.out.n; i++)
        printf("%-10s %s: mu, flux, u%s\n", "wrote", r->solve.out.path[i], acl ? ", acl" : "");
}

static int check_gap(const transport_request *r, const transport_run *run)
{
    dmk_stats stats;
    dmk_transport_get_stats(run->transport, &stats);
    return solve_tell_gap(&r->solve, "", stats.gap);
}

static int run_transport(const transport_request *r)
{
    transport_run run = {.begin = cli_seconds(),
                         .progress.line = isatty(STDERR_FILENO) && !r->solve.quiet,
                         .progress.steps = r->solve.verbose,
                         .progress.gap = NAN};
    const int rc = dmk_context_create(&run.context);
    if (rc != DMK_OK) return cli_library_error(NULL, rc);
    dmk_context_set_threads(run.context, r->solve.device.threads);
    dmk_context_set_format(run.context, r->solve.format); /* checked when it was asked for */
    cli_watch(run.context, &run.progress);
    int code = read_all(r, &run);
    if (code == EXIT_OK) code = compute(r, &run);
    if (code == EXIT_OK) code = report(r, &run);
    if (code == EXIT_OK && solve_prints_summary(&r->solve)) {
        print_summary(r, &run);
        code = cli_flush();
    }
    if (code == EXIT_OK) code = check_gap(r, &run);
    cli_progress_end(&run.progress);
    cli_measure_free(&run.from);
    cli_measure_free(&run.to);
    dmk_transport_destroy(&run.transport);
    dmk_solver_destroy(&run.solver);
    dmk_device_destroy(&run.device);
    dmk_mesh_destroy(&run.mesh);
    dmk_repairs_free(&run.repairs);
    dmk_context_destroy(&run.context);
    return code;
}

/* ---- the command line ----------------------------------------------------------------------- */

static int check_request(const transport_request *r)
{
    if (!r->from && r->to) {
        return cli_error(EXIT_USAGE,
                         "transport: --to is given without --from: use --from FILE, too");
    }
    if (!r->from) {
        return cli_error(EXIT_USAGE,
                         "transport: no measure given: use --from FILE, and --to FILE unless the "
                         "first is signed");
    }
    int code = cli_check_outputs("out", &r->solve.out, CLI_RESULT, r->solve.format);
    if (code == EXIT_OK) code = solve_request_check_report(&r->solve);
    cli_uses uses = {.n = 0};
    cli_use(&uses, NULL, r->solve.mesh);
    if (strcmp(r->from, "uniform") != 0) cli_use(&uses, NULL, r->from);
    if (r->to && strcmp(r->to, "uniform") != 0) cli_use(&uses, NULL, r->to);
    cli_use_files(&uses, "out", &r->solve.out);
    cli_use(&uses, "report", r->solve.report);
    return code == EXIT_OK ? cli_check_uses(&uses) : code;
}

static int parse(transport_request *r, const char *out_help, int argc, char **argv)
{
    solve_table table = {.n = 0};
    const cli_option rows[] = {
        {.name = "from",
         .value = "FILE",
         .help = "the measure to be moved; `uniform` spreads the area evenly",
         .kind = CLI_TEXT,
         .target = &r->from},
        {.name = "to",
         .value = "FILE",
         .help = "where it goes; without it, the first measure is signed, and its positive\npart "
                 "goes to "
                 "the negative one",
         .kind = CLI_TEXT,
         .target = &r->to},
        {.name = "normalise",
         .help = "scale the second measure to the mass of the first",
         .kind = CLI_FLAG,
         .target = &r->normalise},
        {.name = "out",
         .value = "FILE",
         .help = out_help,
         .kind = CLI_FILES,
         .target = &r->solve.out},
        cli_format_option(&r->solve.format, CLI_RESULT, CLI_RESULT),
        {.name = "repair", .help = CLI_REPAIR_HELP, .kind = CLI_FLAG, .target = &r->solve.repair},
    };
    solve_add(&table, rows, sizeof rows / sizeof *rows);
    solve_add_report(&table, &r->solve);
    solve_add_iteration(&table, &r->solve);
    solve_add_device(&table, &r->solve);
    const cli_syntax syntax = {
        .command = "transport",
        .usage = "MESH --from FILE [--to FILE] [OPTIONS]",
        .summary = "The optimal transport between two measures on the surface MESH at the cost of "
                   "the distance:\n"
                   "the earth mover's distance W1 with bounds, the density mu, the flux and the "
                   "potential u.",
        .operand = "MESH",
        .notes =
            "A measure is a text file, # begins a comment: a number a line, as many as vertices\n"
            "(masses) or as triangles (mass per area); or lines `vertex I MASS` and `X,Y,Z MASS`.\n"
            "FILE.vtp:NAME or .vtu: an array of its points (masses) or faces (mass per area).\n"
            "Points without a mass take what the other measure has nearest to them; `acl` then "
            "marks the\n"
            "cut locus of their set, the borders of their Voronoi cells.\n"
            "Both measures have the same mass, all of it on one component of the mesh.\n"
            "The bounds are those of the discrete problem: between points a few edges apart W1 "
            "itself\n"
            "is smaller.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &r->solve.mesh);
}

int cmd_transport(int argc, char **argv)
{
    transport_request request = {.from = NULL};
    char suffixes[512], help[600];
    solve_request_init(&request.solve, "transport");
    cli_suffixes(CLI_RESULT, suffixes, sizeof suffixes);
    snprintf(help, sizeof help,
             "write mesh, mu, flux and u, of points without masses acl;\nmay be given again:\n%s",
             suffixes);
    int code = parse(&request, help, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = solve_request_convert(&request.solve);
    if (code == EXIT_OK) code = check_request(&request);
    return code == EXIT_OK ? run_transport(&request) : code;
}
