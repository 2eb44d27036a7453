/* dmkcl mesh: a built-in surface as a mesh file, or a mesh file in another format. */
#include "cli.h"

#include <string.h>
#include <sys/stat.h>

enum { MAX_SURFACES = 32 };

/* Whether the operand is a file: no surface, and there, or written like one. */
static bool is_file(const char *word)
{
    struct stat st;
    for (size_t i = 0; dmk_surface_name(i); i++) {
        if (strcmp(word, dmk_surface_name(i)) == 0) return false;
    }
    return strpbrk(word, "./") || stat(word, &st) == 0;
}

/* The surface of that name, or NULL with the error printed. */
static const char *find_surface(const char *word)
{
    const char *names[MAX_SURFACES + 1] = {NULL};
    char list[256] = "";
    for (size_t i = 0; i < MAX_SURFACES && (names[i] = dmk_surface_name(i)); i++) {
        if (strcmp(word, names[i]) == 0) return names[i];
        const size_t used = strlen(list);
        snprintf(list + used, sizeof list - used, "%s%s", i ? ", " : "", names[i]);
    }
    const char *nearest = cli_nearest(word, names);
    if (nearest) {
        cli_error(EXIT_USAGE, "mesh: no surface '%s'; did you mean '%s'?", word, nearest);
    } else {
        cli_error(EXIT_USAGE, "mesh: no surface '%s'; expected one of %s", word, list);
    }
    return NULL;
}

static void describe_surfaces(char *text, size_t size)
{
    snprintf(text, size, "surfaces:");
    for (size_t i = 0; dmk_surface_name(i); i++) {
        const size_t used = strlen(text);
        snprintf(text + used, size - used, "\n  %-12s %s", dmk_surface_name(i),
                 dmk_surface_text(i));
    }
}

static void print_made(const char *path, const dmk_surface_options *surface, const dmk_mesh *mesh)
{
    char a[CLI_TEXT_SIZE], b[CLI_TEXT_SIZE], p[CLI_TEXT_SIZE];
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    printf("%s: %s, %s, mean edge %.3g, smallest angle %.0f degrees\n", path,
           cli_counted((int64_t)info.n_vertices, "vertex", "vertices", a),
           cli_counted((int64_t)info.n_triangles, "triangle", "triangles", b), info.mean_edge,
           info.min_angle);
    if (surface->has_source) {
        printf("%s: the source is vertex 0, at %s\n", path, cli_point(dmk_mesh_vertices(mesh), p));
    }
}

/* The source is lifted to the surface from wherever it was asked for. */
static void warn_of_lift(dmk_context *context, const dmk_surface_options *surface,
                         const dmk_mesh *mesh)
{
    char wanted[CLI_TEXT_SIZE], made[CLI_TEXT_SIZE];
    dmk_mesh_info info;
    dmk_point source;
    if (dmk_mesh_vertex_point(context, mesh, 0, &source) != DMK_OK) return;
    const double away = cli_offset(context, mesh, surface->source, &source);
    dmk_mesh_get_info(mesh, &info);
    if (!(away > info.mean_edge)) return;
    fprintf(stderr,
            "dmkcl: warning: (%s) is away from the surface; the source, (%s), is %.3g from it\n",
            cli_point(surface->source, wanted), cli_point(dmk_mesh_vertices(mesh), made), away);
}

typedef struct mesh_request {
    const char *name, *format;
    cli_files out;
    dmk_surface_options surface; /* its name is NULL for a file */
    cli_numbers size, source;
    int64_t n_triangles, refine;
    cli_reading how;
} mesh_request;

static int make(const mesh_request *request)
{
    dmk_context *context;
    dmk_mesh *mesh = NULL;
    cli_progress progress = {0};
    dmk_repairs repairs = {0};
    const dmk_surface_options *surface = &request->surface;
    int rc = dmk_context_create(&context);
    if (rc == DMK_OK) {
        cli_watch(context, &progress);
        dmk_context_set_format(context, request->format); /* checked when it was asked for */
        rc = surface->name ? dmk_mesh_surface(context, surface, &mesh)
                           : cli_read_mesh(context, request->name, &request->how, &repairs, &mesh);
    }
    if (rc == DMK_OK && surface->name && surface->has_source && !request->how.quiet)
        warn_of_lift(context, surface, mesh);
    if (rc == DMK_OK && cli_interrupted()) rc = DMK_E_CANCELLED;
    for (int i = 0; i < request->out.n && rc == DMK_OK; i++)
        rc = dmk_mesh_write(context, mesh, cli_path(request->out.path[i]));
    if (rc != DMK_OK) {
        rc = cli_library_error(context, rc);
    } else if (!request->how.quiet) {
        for (int i = 0; i < request->out.n; i++) print_made(request->out.path[i], surface, mesh);
        rc = cli_flush();
    }
    dmk_mesh_destroy(&mesh);
    dmk_repairs_free(&repairs);
    dmk_context_destroy(&context);
    return rc;
}

static int parse(mesh_request *r, int argc, char **argv)
{
    char formats[512], out_help[600], surfaces[2048];
    cli_suffixes(CLI_MESH, formats, sizeof formats);
    snprintf(out_help, sizeof out_help, "the mesh file to write; may be given again:\n%s", formats);
    describe_surfaces(surfaces, sizeof surfaces);
    const cli_option options[] = {
        {.name = "out", .value = "FILE", .help = out_help, .kind = CLI_FILES, .target = &r->out},
        cli_format_option(&r->format, CLI_MESH, CLI_MESH),
        {.name = "size",
         .value = "A[,B[,C]]",
         .help = "sizes of the surface (see below)",
         .kind = CLI_SIZES,
         .target = &r->size},
        {.name = "triangles",
         .value = "N",
         .help = "approximate number of triangles of the coarse mesh",
         .kind = CLI_INTEGER,
         .target = &r->n_triangles,
         .lo = 4,
         .hi = 1e9,
         .expected = "a whole number"},
        {.name = "refine",
         .value = "N",
         .help = "split every triangle in four, N times, and lift the new points\n"
                 "to the surface; where that would fold it over a sharp rim, as many\n"
                 "triangles are made at once",
         .kind = CLI_INTEGER,
         .target = &r->refine,
         .lo = 0,
         .hi = 15,
         .expected = "a whole number"},
        {.name = "source",
         .value = "X,Y,Z",
         .help = "make the point of the surface near X,Y,Z a vertex, number 0",
         .kind = CLI_POINT,
         .target = &r->source},
        {.name = "quiet", .help = CLI_QUIET_HELP, .kind = CLI_FLAG, .target = &r->how.quiet},
        {.name = "repair", .help = CLI_REPAIR_HELP, .kind = CLI_FLAG, .target = &r->how.repair},
    };
    const cli_syntax syntax = {
        .command = "mesh",
        .usage = "SURFACE|MESH --out FILE [OPTIONS]",
        .summary = "Make a mesh of a built-in surface, or write a mesh file in another format.",
        .operand = "SURFACE",
        .notes = surfaces,
        .options = options,
        .n_options = sizeof options / sizeof *options,
    };
    return cli_parse(&syntax, argc, argv, &r->name);
}

/* A surface or a file, with the options that go with it. */
static int settle(mesh_request *r)
{
    dmk_surface_options *surface = &r->surface;
    dmk_surface_options_init(surface, sizeof *surface);
    surface->name = NULL;
    if (!is_file(r->name)) {
        surface->name = find_surface(r->name);
        if (!surface->name) return EXIT_USAGE;
        if (r->how.repair)
            return cli_error(
                EXIT_USAGE, "mesh: --repair is for files, and '%s' is a built-in surface", r->name);
    } else if (r->size.n || r->n_triangles || r->refine || r->source.n) {
        return cli_error(EXIT_USAGE,
                         "mesh: '%s' is a file: --size, --triangles, --refine and "
                         "--source are for built-in surfaces",
                         r->name);
    }
    memcpy(surface->size, r->size.value, (size_t)r->size.n * sizeof *r->size.value);
    surface->n_triangles = (size_t)r->n_triangles;
    surface->refine = (int)r->refine;
    surface->has_source = r->source.n == 3;
    if (surface->has_source) memcpy(surface->source, r->source.value, sizeof surface->source);
    return EXIT_OK;
}

int cmd_mesh(int argc, char **argv)
{
    mesh_request r = {.name = NULL};
    int code = parse(&r, argc, argv);
    if (code != CLI_GO_ON) return code;
    if (r.out.n == 0) return cli_error(EXIT_USAGE, "mesh: --out FILE is missing");
    code = settle(&r);
    if (code != EXIT_OK) return code;
    code = cli_check_outputs("out", &r.out, CLI_MESH, r.format);
    cli_uses uses = {.n = 0};
    cli_use(&uses, NULL, r.surface.name ? NULL : r.name);
    cli_use_files(&uses, "out", &r.out);
    if (code == EXIT_OK) code = cli_check_uses(&uses);
    return code == EXIT_OK ? make(&r) : code;
}
