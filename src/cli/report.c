/* dmkcl solve: the JSON report, and the summary for a person. */
#include "solve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- report --------------------------------------------------------------------------------- */

static void write_source(cli_json *json, const solve_run *run)
{
    double xyz[3] = {NAN, NAN, NAN};
    dmk_mesh_point_xyz(run->context, run->mesh, &run->source, xyz);
    json_open(json, "source", '{');
    json_numbers(json, "xyz", xyz, 3);
    json_integer(json, "triangle", run->source.triangle);
    json_numbers(json, "weight", run->source.weight, 3);
    json_close(json, '{');
}

void solve_report_stats(cli_json *json, const dmk_device_info *device, const dmk_stats *stats,
                        bool exact)
{
    json_open(json, "device", '{');
    json_text(json, "name", device->name);
    json_text(json, "platform", device->platform);
    json_text(json, "driver", device->driver);
    json_text(json, "type", device->type);
    json_integer(json, "compute_units", device->compute_units);
    json_close(json, '{');
    json_text(json, "precision", stats->double_precision ? "double" : "single");
    json_integer(json, "steps", stats->steps);
    json_integer(json, "cg_iterations", stats->cg_iterations);
    json_integer(json, "v_cycles", stats->v_cycles);
    json_integer(json, "levels", stats->levels);
    json_number(json, "change", stats->change);
    json_number(json, "cost_upper", stats->cost_upper);
    json_number(json, "cost_lower", stats->cost_lower);
    json_number(json, "gap", stats->gap);
    if (exact) {
        json_number(json, "cost_exact", stats->cost_exact);
        json_number(json, "cost_exact_error", stats->cost_exact_error);
    }
    json_integer(json, "sweeps", stats->sweeps);
    json_integer(json, "n_steep", stats->n_steep);
    json_open(json, "steep", '[');
    for (int k = 0; k < DMK_N_STEEP && stats->steep[k] >= 0; k++)
        json_integer(json, NULL, stats->steep[k]);
    json_close(json, '[');
}

static void write_seconds(cli_json *json, const solve_times *seconds, const dmk_stats *stats)
{
    json_open(json, "seconds", '{');
    json_number(json, "read", seconds->read);
    json_number(json, "device", seconds->device);
    json_number(json, "setup", seconds->setup);
    json_number(json, "distance", stats->seconds[DMK_STAGE_DISTANCE]);
    json_number(json, "start", stats->seconds[DMK_STAGE_START]);
    json_number(json, "solve", stats->seconds[DMK_STAGE_SOLVE]);
    json_number(json, "certify", stats->seconds[DMK_STAGE_CERTIFY]);
    json_number(json, "locus", seconds->locus);
    json_number(json, "write", seconds->write);
    json_number(json, "total", seconds->total);
    json_close(json, '{');
}

void solve_report_locus(cli_json *json, const dmk_locus *locus)
{
    dmk_locus_info info;
    dmk_locus_get_info(locus, &info);
    json_open(json, "locus", '{');
    json_number(json, "length", info.length);
    json_integer(json, "loops", info.loops);
    json_integer(json, "components", (int64_t)info.components);
    json_integer(json, "endpoints", (int64_t)info.endpoints);
    json_integer(json, "branch_points", (int64_t)info.branch_points);
    json_number(json, "strength", info.strength);
    json_integer(json, "n_vertices", (int64_t)info.n_vertices);
    json_integer(json, "n_edges", (int64_t)info.n_edges);
    json_integer(json, "n_polylines", (int64_t)info.n_polylines);
    json_close(json, '{');
}

static void write_ranks(cli_json *json, const solve_run *run)
{
    if (run->n_ranks == 0) return;
    json_open(json, "ranks", '[');
    for (int r = 0; r < run->n_ranks; r++) {
        const dmk_traffic *t = &run->ranks[r].traffic;
        json_open(json, NULL, '{');
        json_integer(json, "own_rows", t->own_rows);
        json_integer(json, "ghost_rows", t->ghost_rows);
        json_integer(json, "exchanges", t->exchanges);
        json_integer(json, "overlapped", t->overlapped);
        json_integer(json, "messages", t->messages);
        json_integer(json, "bytes", t->bytes);
        json_integer(json, "sums", t->sums);
        json_integer(json, "sum_bytes", t->sum_bytes);
        json_integer(json, "peak_memory", (int64_t)run->ranks[r].peak_memory);
        json_close(json, '{');
    }
    json_close(json, '[');
}

void solve_report_names(cli_json *json, const char *key, const cli_files *files)
{
    json_open(json, key, '[');
    for (int i = 0; i < files->n; i++) json_text(json, NULL, files->path[i]);
    json_close(json, '[');
}

/* What needs no solver. */
static void write_mesh(cli_json *json, const solve_request *request, const solve_run *run)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(run->mesh, &info);
    json_text(json, "dmkcl", dmk_version());
    json_open(json, "mesh", '{');
    json_text(json, "file", request->mesh);
    json_mesh(json, &info);
    json_repairs(json, &run->repairs);
    json_close(json, '{');
    json_integer(json, "euler", info.euler);
}

void solve_report_fields(cli_json *json, const solve_request *request, const solve_run *run)
{
    dmk_stats stats;
    write_mesh(json, request, run);
    if (request->bare) {
        if (!request->sources) write_source(json, run);
        json_integer(json, "peak_memory", (int64_t)cli_peak_memory());
        return;
    }
    dmk_result_get_stats(run->result, &stats);
    json_number(json, "area", stats.area); /* of the component with the source */
    write_source(json, run);
    solve_report_stats(json, &run->opened, &stats, true);
    write_seconds(json, &run->seconds, &stats);
    json_integer(json, "peak_memory", (int64_t)cli_peak_memory());
    write_ranks(json, run);
    if (run->locus) solve_report_locus(json, run->locus);
    solve_report_names(json, "out", &request->out);
    solve_report_names(json, "locus_out", &request->locus);
    solve_report_names(json, "tangent_out", &request->tangent);
}

void solve_report_seconds(cli_json *json, const solve_run *run, const char *stage, double seconds)
{
    json_open(json, "seconds", '{');
    json_number(json, "read", run->seconds.read);
    json_number(json, stage, seconds);
    json_number(json, "write", run->seconds.write);
    json_number(json, "total", cli_seconds() - run->seconds.begin);
    json_close(json, '{');
}

static void write_report(FILE *file, bool one_line, const solve_request *request,
                         const solve_run *run, solve_more more, const void *data)
{
    cli_json json = {.file = file, .one_line = one_line};
    json_open(&json, NULL, '{');
    solve_report_fields(&json, request, run);
    if (more) more(&json, run, data);
    json_close(&json, '{');
}

int solve_report_more(const solve_request *request, const solve_run *run, solve_more more,
                      const void *data)
{
    cli_file file;
    const int code = cli_report_open(request->report, &file);
    if (code != EXIT_OK) return code;
    const bool one_line = request->sources && file.stream == stdout;
    write_report(file.stream, one_line, request, run, more, data);
    return cli_file_close(&file);
}

int solve_report(const solve_request *request, const solve_run *run)
{
    return solve_report_more(request, run, NULL, NULL);
}

double solve_offset(const solve_request *request, const solve_run *run)
{
    if (request->source.n == 0) return 0;
    return cli_offset(run->context, run->mesh, request->source.value, &run->source);
}

bool solve_prints_summary(const solve_request *request)
{
    return !request->quiet && !(request->report && strcmp(request->report, "-") == 0);
}

/* ---- summary -------------------------------------------------------------------------------- */

static void print_label(const char *label)
{
    printf("%s%-10s%s ", cli_bold(), label, cli_plain());
}

static void print_mesh(const solve_request *request, const dmk_mesh_info *info)
{
    char v[CLI_TEXT_SIZE], t[CLI_TEXT_SIZE];
    const int64_t n_loops = (int64_t)info->n_border_loops;
    print_label("mesh");
    printf("%s: %s, %s, ", request->mesh,
           cli_counted((int64_t)info->n_vertices, "vertex", "vertices", v),
           cli_counted((int64_t)info->n_triangles, "triangle", "triangles", t));
    if (n_loops == 0) printf("closed");
    if (n_loops > 0) printf("%s", cli_counted(n_loops, "border loop", "border loops", v));
    if (info->n_components == 1) {
        printf(", genus %lld\n", (long long)(2 - n_loops - info->euler) / 2);
    } else {
        printf(", %s components\n", cli_count((int64_t)info->n_components, v));
    }
    if (info->n_components > 1) {
        print_label("");
        printf("only the component with the source takes part\n");
    }
    if (info->n_unused_vertices > 0) {
        print_label("");
        printf("%s in no triangle\n",
               cli_counted((int64_t)info->n_unused_vertices, "vertex is", "vertices are", v));
    }
}

/* Where on the mesh the source sits. */
static void print_place(const solve_run *run)
{
    const dmk_point *p = &run->source;
    int corner = 0, n_corners = 0; /* with a weight */
    for (int k = 0; k < 3; k++) {
        if (p->weight[k] > 0) {
            corner = k;
            n_corners++;
        }
    }
    if (n_corners == 1) {
        printf(", vertex %ld", (long)dmk_mesh_triangles(run->mesh)[3 * p->triangle + corner]);
    } else {
        printf(", %s triangle %lld", n_corners == 2 ? "on an edge of" : "in",
               (long long)p->triangle);
    }
}

/* How the mesh was dealt out. */
static void print_ranks(const solve_run *run)
{
    char memory[CLI_TEXT_SIZE], sent[CLI_TEXT_SIZE], messages[CLI_TEXT_SIZE];
    int64_t own = 0, ghosts = 0, bytes = 0, n = 0;
    uint64_t most = 0;
    if (run->n_ranks == 0) return;
    for (int r = 0; r < run->n_ranks; r++) {
        const solve_rank *rank = &run->ranks[r];
        own += rank->traffic.own_rows;
        ghosts += rank->traffic.ghost_rows;
        bytes += rank->traffic.bytes;
        n += rank->traffic.messages;
        if (rank->peak_memory > most) most = rank->peak_memory;
    }
    print_label("ranks");
    if (own == 0) {
        printf("%d, each with all of this small mesh\n", run->n_ranks);
        return;
    }
    printf("%d, %.2g %% of the rows on two of them, %s in %s messages, memory up to %s\n",
           run->n_ranks, 100 * (double)ghosts / (double)own, cli_bytes((uint64_t)bytes, sent),
           cli_count(n, messages), cli_bytes(most, memory));
}

static void print_source(const solve_request *request, const solve_run *run)
{
    char text[CLI_TEXT_SIZE];
    double xyz[3];
    if (dmk_mesh_point_xyz(run->context, run->mesh, &run->source, xyz) != DMK_OK) return;
    print_label("source");
    printf("(%s)", cli_point(xyz, text));
    print_place(run);
    if (request->vertex < 0) {
        printf(", %.2g from the point asked for", solve_offset(request, run));
    }
    putchar('\n');
}

/* What holds the bounds apart, where they are so far that they say little. */
static void print_gap(const dmk_stats *stats)
{
    char n[CLI_TEXT_SIZE];
    if (!(stats->gap > 0.01)) return;
    print_label("");
    if (stats->n_steep == 0) {
        printf("the bounds are far apart as mu has not settled: a smaller --tolerance may bring "
               "them closer\n");
        return;
    }
    printf("the lower bound is held back by %s steeper than 1, most by",
           cli_counted(stats->n_steep, "triangle", "triangles", n));
    for (int k = 0; k < DMK_N_STEEP && stats->steep[k] >= 0; k++)
        printf("%s %lld", k > 0 ? "," : "", (long long)stats->steep[k]);
    printf(";\n");
    print_label("");
    printf("mu and the upper bound do not suffer from them\n");
}

static void print_cost(const dmk_stats *stats)
{
    char steps[CLI_TEXT_SIZE], iterations[CLI_TEXT_SIZE];
    print_label("solved");
    printf("in %s with %s, %s precision\n", cli_counted(stats->steps, "step", "steps", steps),
           cli_counted(stats->cg_iterations, "CG iteration", "CG iterations", iterations),
           stats->double_precision ? "double" : "single");
    print_label("cost");
    printf("between %.8g and %.8g", stats->cost_lower, stats->cost_upper);
    if (isfinite(stats->gap)) printf(" (gap %.2g %%)", 100 * stats->gap);
    printf(", of the discrete problem\n");
    if (isfinite(stats->cost_exact)) print_label("");
    if (isfinite(stats->cost_exact))
        printf(
            "%.8g on the polyhedron itself, the integral of the distance (quadrature error %.1g)\n",
            stats->cost_exact, stats->cost_exact_error);
    print_gap(stats);
}

bool solve_misses(const solve_request *request, double gap)
{
    return request->solve.gap_tolerance > 0 && gap > request->solve.gap_tolerance;
}

double solve_reported_gap(const char *text, size_t n)
{
    static const char name[] = "\"gap\": ";
    const char *found = memmem(text, n, name, sizeof name - 1);
    return found ? strtod(found + sizeof name - 1, NULL) : NAN; /* the locale is C: see main */
}

int solve_tell_gap(const solve_request *request, const char *where, double gap)
{
    if (!solve_misses(request, gap)) return EXIT_OK;
    return cli_error(EXIT_GAP,
                     "%sthe gap is %.2g, above the %.2g that --gap asked for; a smaller "
                     "--tolerance may bring it down",
                     where, gap, request->solve.gap_tolerance);
}

int solve_check_gap(const solve_request *request, const solve_run *run)
{
    dmk_stats stats;
    dmk_result_get_stats(run->result, &stats);
    return solve_tell_gap(request, run->where, stats.gap);
}

void solve_summary_locus(const dmk_locus *locus)
{
    char n[4][CLI_TEXT_SIZE];
    dmk_locus_info info;
    dmk_locus_get_info(locus, &info);
    print_label("cut locus");
    printf("length %.6g in %s, %s, %s, %s\n", info.length,
           cli_counted((int64_t)info.components, "piece", "pieces", n[0]),
           cli_counted(info.loops, "loop", "loops", n[1]),
           cli_counted((int64_t)info.endpoints, "end", "ends", n[2]),
           cli_counted((int64_t)info.branch_points, "branch point", "branch points", n[3]));
}

static void print_time(const solve_times *seconds, const dmk_stats *stats)
{
    char memory[CLI_TEXT_SIZE];
    print_label("time");
    printf("%.2f s: read %.2f, device %.2f, setup %.2f, distance %.2f, start %.2f, solve %.2f,\n",
           seconds->total, seconds->read, seconds->device, seconds->setup,
           stats->seconds[DMK_STAGE_DISTANCE], stats->seconds[DMK_STAGE_START],
           stats->seconds[DMK_STAGE_SOLVE]);
    print_label("");
    printf("certify %.2f, locus %.2f, write %.2f; memory %s\n", stats->seconds[DMK_STAGE_CERTIFY],
           seconds->locus, seconds->write, cli_bytes(cli_peak_memory(), memory));
}

static void print_files(const solve_request *request)
{
    for (int i = 0; i < request->out.n; i++) {
        print_label("wrote");
        printf("%s: mu, %s\n", request->out.path[i],
               request->density_only ? "u" : "acl, u, distance");
    }
    for (int i = 0; i < request->locus.n; i++) {
        print_label("wrote");
        printf("%s: cut locus\n", request->locus.path[i]);
    }
    for (int i = 0; i < request->tangent.n; i++) {
        print_label("wrote");
        printf("%s: tangent cut locus\n", request->tangent.path[i]);
    }
    if (request->report) {
        print_label("wrote");
        printf("%s: report\n", request->report);
    }
}

static void print_device(const solve_run *run)
{
    char units[CLI_TEXT_SIZE];
    print_label("device");
    printf("%s (%s), %s\n", run->opened.name, run->opened.platform,
           cli_counted(run->opened.compute_units, "compute unit", "compute units", units));
}

void solve_summary_mesh(const solve_request *request, const solve_run *run)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(run->mesh, &info);
    print_mesh(request, &info);
    print_device(run);
}

void solve_summary(const solve_request *request, const solve_run *run)
{
    dmk_mesh_info info;
    dmk_stats stats;
    dmk_mesh_get_info(run->mesh, &info);
    dmk_result_get_stats(run->result, &stats);
    print_mesh(request, &info);
    print_source(request, run);
    print_device(run);
    print_ranks(run);
    print_cost(&stats);
    if (run->locus) solve_summary_locus(run->locus);
    print_time(&run->seconds, &stats);
    print_files(request);
}

static void report_plan(cli_json *json, const solve_run *run, const void *data)
{
    const solve_request *request = data;
    json_memory(json, run->mesh, request->single);
}

int solve_print_plan(const solve_request *request, const solve_run *run)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(run->mesh, &info);
    if (request->report) {
        const int code = solve_report_more(request, run, report_plan, request);
        if (code != EXIT_OK) return code;
    }
    if (!solve_prints_summary(request)) return EXIT_OK;
    print_mesh(request, &info);
    if (!request->sources) print_source(request, run);
    print_label("memory");
    cli_print_memory(run->mesh, request->single);
    return cli_flush();
}
