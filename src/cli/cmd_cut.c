/* dmkcl cut: the surface cut open along the cut locus, a disk. */
#include "solve.h"

#include <stdlib.h>

typedef struct cut_request {
    solve_request solve; /* its `out` is that of the surface cut open */
    cli_files picture;
} cut_request;

static void print_cut(const cut_request *request, const dmk_mesh *cut, size_t flipped,
                      const dmk_locus *locus)
{
    char v[CLI_TEXT_SIZE], t[CLI_TEXT_SIZE], n[CLI_TEXT_SIZE];
    dmk_mesh_info info;
    dmk_locus_info line;
    dmk_mesh_get_info(cut, &info);
    dmk_locus_get_info(locus, &line);
    printf("cut locus of length %.6g with %s\n", line.length,
           cli_counted(line.loops, "loop", "loops", n));
    printf("cut open: %s, %s, Euler characteristic %lld, %s\n",
           cli_counted((int64_t)info.n_vertices, "vertex", "vertices", v),
           cli_counted((int64_t)info.n_triangles, "triangle", "triangles", t),
           (long long)info.euler,
           cli_counted((int64_t)info.n_border_loops, "border loop", "border loops", n));
    printf("in the plane %s turned over\n",
           cli_counted((int64_t)flipped, "triangle is", "triangles are", n));
    for (int i = 0; i < request->solve.out.n; i++) printf("wrote %s\n", request->solve.out.path[i]);
    for (int i = 0; i < request->picture.n; i++) printf("wrote %s\n", request->picture.path[i]);
}

/* What the report says of the cut. */
typedef struct outcome {
    const cut_request *request;
    const dmk_mesh *cut;
    size_t flipped;
    double seconds; /* for distance, cut locus and cut */
} outcome;

static void report_cut(cli_json *json, const solve_run *run, const void *data)
{
    const outcome *t = data;
    dmk_mesh_info info;
    dmk_mesh_get_info(t->cut, &info);
    solve_report_locus(json, run->locus);
    json_open(json, "cut", '{');
    json_integer(json, "n_vertices", (int64_t)info.n_vertices);
    json_integer(json, "n_triangles", (int64_t)info.n_triangles);
    json_integer(json, "n_border_loops", (int64_t)info.n_border_loops);
    json_integer(json, "euler", info.euler);
    json_integer(json, "flipped", (int64_t)t->flipped);
    solve_report_names(json, "out", &t->request->solve.out);
    solve_report_names(json, "picture", &t->request->picture);
    json_close(json, '{');
    solve_report_seconds(json, run, "cut", t->seconds);
}

static int cut_open(const cut_request *request, solve_run *run, dmk_mesh **cut, double **plane)
{
    dmk_geodesics *geodesics = NULL;
    int rc = dmk_geodesics_create(run->context, run->mesh, 1, &run->source, NULL, &geodesics);
    if (rc == DMK_OK) rc = solve_go_on();
    if (rc == DMK_OK)
        rc = dmk_geodesics_cut(run->context, geodesics, &request->solve.trace, cut, NULL, plane,
                               &run->locus);
    dmk_geodesics_destroy(&geodesics);
    return rc == DMK_OK ? EXIT_OK : solve_fail(run, rc);
}

static int write_files(const cut_request *request, solve_run *run, const dmk_mesh *cut,
                       const double *plane)
{
    int rc = DMK_OK, code = EXIT_OK;
    for (int i = 0; i < request->solve.out.n && rc == DMK_OK; i++) {
        rc = solve_go_on();
        if (rc == DMK_OK)
            rc = dmk_cut_write(run->context, cut, plane, cli_path(request->solve.out.path[i]));
    }
    for (int i = 0; i < request->picture.n && rc == DMK_OK && code == EXIT_OK; i++)
        code = cli_draw_plane(cut, plane, request->picture.path[i]);
    cli_progress_end(&run->progress);
    return rc == DMK_OK ? code : solve_fail(run, rc);
}

static int run_cut(const cut_request *request)
{
    solve_run run;
    dmk_mesh *cut = NULL;
    double *plane = NULL;
    int code = solve_begin(&request->solve, &run);
    const double mark = cli_seconds();
    if (code == EXIT_OK) code = cut_open(request, &run, &cut, &plane);
    const double made = cli_seconds();
    if (code == EXIT_OK) code = write_files(request, &run, cut, plane);
    run.seconds.write = cli_seconds() - made;
    const size_t flipped = dmk_cut_flipped(cut, plane);
    if (code == EXIT_OK && request->solve.report) {
        const outcome t = {request, cut, flipped, made - mark};
        code = solve_report_more(&request->solve, &run, report_cut, &t);
    }
    if (code == EXIT_OK && solve_prints_summary(&request->solve)) {
        print_cut(request, cut, flipped, run.locus);
        code = cli_flush();
    }
    dmk_mesh_destroy(&cut);
    free(plane);
    solve_end(&run);
    return code;
}

static int check_request(cut_request *request)
{
    int code = solve_request_settle(&request->solve);
    if (code == EXIT_OK && request->solve.out.n == 0 && request->picture.n == 0 &&
        !request->solve.report) {
        code = cli_error(EXIT_USAGE, "cut: --out FILE or --picture FILE is missing");
    }
    if (code == EXIT_OK)
        code = cli_check_outputs("out", &request->solve.out, CLI_MESH, request->solve.format);
    if (code == EXIT_OK) code = cli_check_outputs("picture", &request->picture, CLI_PICTURE, NULL);
    cli_uses uses = {.n = 0};
    solve_request_uses(&request->solve, &uses);
    cli_use_files(&uses, "picture", &request->picture);
    return code == EXIT_OK ? cli_check_uses(&uses) : code;
}

static int parse(cut_request *request, const char *out_help, int argc, char **argv)
{
    solve_table table = {.n = 0};
    const cli_option out[] = {
        {.name = "out",
         .value = "FILE",
         .help = out_help,
         .kind = CLI_FILES,
         .target = &request->solve.out},
        {.name = "picture",
         .value = "FILE",
         .help = "write the surface laid out in the plane as a drawing in SVG format; its\n"
                 "outline is the tangent cut locus",
         .kind = CLI_FILES,
         .target = &request->picture},
        cli_format_option(&request->solve.format, CLI_MESH, CLI_MESH),
    };
    solve_add_source(&table, &request->solve);
    solve_add(&table, out, sizeof out / sizeof *out);
    solve_add_strength(&table, &request->solve);
    solve_add_report(&table, &request->solve);
    solve_add_host(&table, &request->solve);
    const cli_syntax syntax = {
        .command = "cut",
        .usage = "MESH (--source X,Y,Z | --vertex I) (--out FILE | --picture FILE) [OPTIONS]",
        .summary =
            "Cut the surface MESH open along the cut locus of the source: a disk, with one border\n"
            "loop and Euler characteristic 1. Needs no OpenCL device.",
        .operand = "MESH",
        .notes =
            "Triangles that the cut locus crosses are split, so that it runs along edges, and its\n"
            "points become vertices once for each side, no nearer to an edge's end than 0.15 of "
            "the\n"
            "edge. On a mesh of fewer than 5,000 triangles, and where many edges are long, edges "
            "are\n"
            "bisected before, as where the cut locus is traced. The vertices of the component "
            "with\n"
            "the source come first, in their old order. A cut locus that is one point becomes a\n"
            "slit of two edges at the farthest vertex. A disk without a cut locus stays as it is.\n"
            "\n"
            "Each vertex also has a position in the plane: its distance, times its direction at "
            "the\n"
            "source (the logarithmic map). OBJ has them as texture coordinates `vt`, VTP as the "
            "array\n"
            "`plane`; --picture draws them. On scans some triangles are turned over in it, and "
            "around\n"
            "a slit, for few vertices stand around the whole circle there; the summary and the "
            "report\n"
            "count them.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &request->solve.mesh);
}

int cmd_cut(int argc, char **argv)
{
    cut_request request = {.picture.n = 0};
    char suffixes[512], help[600];
    cli_suffixes(CLI_MESH, suffixes, sizeof suffixes);
    snprintf(help, sizeof help, "the mesh file to write; may be given again:\n%s", suffixes);
    solve_request_init(&request.solve, "cut");
    request.solve.bare = true;
    int code = parse(&request, help, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = check_request(&request);
    return code == EXIT_OK ? run_cut(&request) : code;
}
