/* dmkcl info: what a mesh is. */
#include "cli.h"

static void print_topology(const dmk_mesh_info *info)
{
    char n[CLI_TEXT_SIZE], m[CLI_TEXT_SIZE];
    printf("%-11s Euler characteristic %lld", "topology", (long long)info->euler);
    if (info->n_components != 1) {
        printf(", %s components", cli_count((int64_t)info->n_components, n));
    }
    if (info->n_border_edges > 0) {
        printf(", %s of %s",
               cli_counted((int64_t)info->n_border_loops, "border loop", "border loops", n),
               cli_counted((int64_t)info->n_border_edges, "edge", "edges", m));
    } else {
        printf(", closed");
    }
    if (info->n_components == 1) {
        /* V - E + F = 2 - 2 genus - border loops, for an oriented surface */
        const long long loops = (long long)info->n_border_loops;
        printf(", genus %lld", (2 - loops - (long long)info->euler) / 2);
    }
    putchar('\n');
    if (info->n_unused_vertices > 0) {
        printf("%-11s %s in no triangle\n", "unused",
               cli_counted((int64_t)info->n_unused_vertices, "vertex is", "vertices are", n));
    }
}

static void print_info(const char *path, const dmk_mesh *mesh)
{
    dmk_mesh_info info;
    char a[CLI_TEXT_SIZE], b[CLI_TEXT_SIZE], c[CLI_TEXT_SIZE];
    dmk_mesh_get_info(mesh, &info);
    printf("%s%s%s\n", cli_bold(), path, cli_plain());
    printf("%-11s %s, %s, %s\n", "counts",
           cli_counted((int64_t)info.n_vertices, "vertex", "vertices", a),
           cli_counted((int64_t)info.n_triangles, "triangle", "triangles", b),
           cli_counted((int64_t)info.n_edges, "edge", "edges", c));
    print_topology(&info);
    printf("%-11s %.10g\n", "area", info.area);
    printf("%-11s mean %.4g, from %.4g to %.4g\n", "edges", info.mean_edge, info.min_edge,
           info.max_edge);
    printf("%-11s from %.1f to %.1f degrees\n", "angles", info.min_angle, info.max_angle);
    printf("%-11s (%s) to (%s)\n", "box", cli_point(info.box_min, a), cli_point(info.box_max, b));
    printf("%-11s ", "memory");
    cli_print_memory(mesh, false);
}

static void print_json(const char *path, const dmk_mesh *mesh, const dmk_repairs *repairs)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    cli_json json = {.file = stdout};
    json_open(&json, NULL, '{');
    json_text(&json, "file", path);
    json_mesh(&json, &info);
    json_memory(&json, mesh, false);
    json_repairs(&json, repairs);
    json_close(&json, '{');
}

static int show(const char *path, bool repair, bool as_json)
{
    dmk_context *context;
    dmk_mesh *mesh = NULL;
    int rc = dmk_context_create(&context);
    const cli_reading how = {.repair = repair, .quiet = as_json, .progress = NULL};
    dmk_repairs repairs = {0};
    if (rc == DMK_OK) rc = cli_read_mesh(context, path, &how, &repairs, &mesh);
    if (rc != DMK_OK) {
        rc = cli_library_error(context, rc);
    } else {
        if (as_json)
            print_json(path, mesh, &repairs);
        else
            print_info(path, mesh);
        rc = cli_flush();
    }
    dmk_mesh_destroy(&mesh);
    dmk_repairs_free(&repairs);
    dmk_context_destroy(&context);
    return rc;
}

int cmd_info(int argc, char **argv)
{
    bool as_json = false, repair = false;
    const char *path;
    const cli_option options[] = {
        {.name = "repair", .help = CLI_REPAIR_HELP, .kind = CLI_FLAG, .target = &repair},
        {.name = "json", .help = "print JSON", .kind = CLI_FLAG, .target = &as_json},
    };
    const cli_syntax syntax = {
        .command = "info",
        .usage = "MESH [--repair] [--json]",
        .summary =
            "Counts, topology and quality of a mesh file. A mesh that cannot be solved is refused\n"
            "with the first offending elements named.",
        .operand = "MESH",
        .options = options,
        .n_options = sizeof options / sizeof *options,
    };
    const int code = cli_parse(&syntax, argc, argv, &path);
    return code == CLI_GO_ON ? show(path, repair, as_json) : code;
}
