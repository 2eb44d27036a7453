/* dmkcl batch: density, distance and cut locus on each of many meshes. */
#include "batch.h"

#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static void add_batch(solve_table *table, batch_request *request)
{
    const cli_option rows[] = {
        {.name = "sources",
         .value = "N",
         .help = "N sources on each mesh, far from each other: the first is --vertex\n"
                 "(default 0), each further one the vertex farthest from those before",
         .kind = CLI_INTEGER,
         .target = &request->samples,
         .lo = 1,
         .hi = 1000000,
         .expected = "a whole number",
         .hint = "; batch takes a number N of sources on each mesh; a file of sources is for "
                 "`dmkcl solve`"},
        {.name = "out-dir",
         .value = "DIR",
         .help = "folder for the files and the report; made if it is missing, with the\n"
                 "folders above it",
         .kind = CLI_TEXT,
         .target = &request->folder},
        {.name = "out",
         .value = "SUFFIX",
         .help = "write DIR/NAME.SUFFIX with mesh, mu, acl, u and distance, for instance\n"
                 ".vtp; may be given again",
         .kind = CLI_FILES,
         .target = &request->each.out},
        {.name = "locus",
         .value = "SUFFIX",
         .help = "write DIR/NAME.locus.SUFFIX with the cut locus, for instance .obj;\n"
                 "may be given again",
         .kind = CLI_FILES,
         .target = &request->each.locus},
        {.name = "tangent",
         .value = "SUFFIX",
         .help = "write DIR/NAME.tangent.SUFFIX with the tangent cut locus as CSV",
         .kind = CLI_FILES,
         .target = &request->each.tangent},
        {.name = "report",
         .value = "FILE",
         .help = "a line of JSON for each source, as they come; - is the standard output\n"
                 "(default: report.jsonl in the folder of --out-dir, else -)",
         .kind = CLI_TEXT,
         .target = &request->each.report},
        {.name = "json",
         .help = "the same as --report -",
         .kind = CLI_FLAG,
         .target = &request->each.json},
        {.name = "resume",
         .help = "do only what the report lacks: a source is skipped if its files exist\n"
                 "and are its own, and mesh (by content), source and options are those of\n"
                 "its line",
         .kind = CLI_FLAG,
         .target = &request->each.resume},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

/* An option that changes a result belongs into digest_options of record.c, too, or --resume keeps what another value
 * gave. */
static int parse(batch_request *request, cli_words *meshes, int argc, char **argv)
{
    const char *first;
    solve_table table = {.n = 0};
    solve_add_source(&table, &request->each);
    add_batch(&table, request);
    solve_add_strength(&table, &request->each);
    solve_add_method(&table, &request->each);
    solve_add_device(&table, &request->each);
    const cli_syntax syntax = {
        .command = "batch",
        .usage = "MESH|FOLDER|LIST... [OPTIONS]",
        .summary = "What `dmkcl solve` does, for many meshes in one process: mesh files, folders "
                   "with all\n"
                   "meshes below them, and lists (.txt, .list, or - for the standard input) with a "
                   "mesh or\n"
                   "folder on each line, by its name from the current folder; # at the beginning "
                   "of a line,\n"
                   "or with a blank before it behind a name, begins a comment. Without a source "
                   "it is\n"
                   "vertex 0 of each mesh.",
        .operand = "MESH",
        .operands = meshes,
        .notes =
            "Files are DIR/NAME.SUFFIX, with several sources DIR/NAME-0000.SUFFIX and so on; "
            "without\n"
            "--out, --locus and --tangent they are .vtp and .locus.obj. NAME is the mesh's in its "
            "folder\n"
            "without its suffix, or with it where two would have one name. A mesh or source that "
            "fails is\n"
            "reported and has a line with its error; the rest are solved. The exit code is that of "
            "the first\n"
            "failure. However the run ends, what the report lists is complete, and --resume "
            "does the\n"
            "rest, what failed, and what has changed since.",
        .options = table.row,
        .n_options = table.n,
    };
    return cli_parse(&syntax, argc, argv, &first);
}

/* The option holds a suffix: as a file's name it must be of a format for `what`. */
static int check_suffixes(const char *option, cli_files *files, cli_what what)
{
    char suffixes[512];
    cli_suffixes(what, suffixes, sizeof suffixes);
    for (int i = 0; i < files->n; i++) {
        const char *s = files->path[i];
        char padded[520], wanted[64];
        snprintf(padded, sizeof padded, " %s ", suffixes);
        snprintf(wanted, sizeof wanted, " %.60s ", s);
        if (*s == '.' && strstr(padded, wanted)) continue;
        return cli_error(EXIT_USAGE, "--%s: '%s' is not one of %s", option, s, suffixes);
    }
    return EXIT_OK;
}

static int make_folder(const char *folder)
{
    struct stat file;
    const int code = batch_make_folders(folder);
    if (code != EXIT_OK) return code;
    if (mkdir(folder, 0777) == 0) return EXIT_OK;
    if (errno == EEXIST && stat(folder, &file) == 0 && S_ISDIR(file.st_mode)) return EXIT_OK;
    return cli_error(EXIT_IO, "--out-dir: cannot make the folder '%s': %s", folder,
                     strerror(errno));
}

/* What is not given takes its default. `report` has room for a name. */
static int settle(batch_request *request, char report[PATH_MAX])
{
    solve_request *each = &request->each;
    const int n_files = each->out.n + each->locus.n + each->tangent.n;
    if (!request->folder && n_files > 0)
        return cli_error(EXIT_USAGE, "batch: files need --out-dir DIR");
    if (each->vertex >= 0 && each->source.n > 0) {
        return cli_error(EXIT_USAGE, "batch: give --source or --vertex, not both");
    }
    if (request->samples > 0 && each->source.n > 0) {
        return cli_error(EXIT_USAGE,
                         "batch: --sources begins with a vertex: give --vertex I, not --source");
    }
    if (each->vertex < 0) each->vertex = 0;
    if (request->folder && n_files == 0) {
        each->out = (cli_files){{".vtp"}, 1};
        each->locus = (cli_files){{".obj"}, 1};
    }
    if (!each->report && !request->folder) each->report = "-";
    if (!each->report && !each->json) {
        if (snprintf(report, PATH_MAX, "%s/report.jsonl", request->folder) >= PATH_MAX) {
            return cli_error(EXIT_IO, "--out-dir: the name is too long");
        }
        each->report = report;
    }
    int code = solve_request_convert(each);
    if (code != EXIT_OK) return code;
    if (each->resume && strcmp(each->report, "-") == 0) {
        return cli_error(EXIT_USAGE,
                         "batch: --resume reads the report of the run before; give --report FILE");
    }
    code = cli_check_report(each->report);
    if (code == EXIT_OK) code = check_suffixes("out", &each->out, CLI_RESULT);
    if (code == EXIT_OK) code = check_suffixes("locus", &each->locus, CLI_LOCUS);
    if (code == EXIT_OK) code = check_suffixes("tangent", &each->tangent, CLI_TANGENT);
    if (code == EXIT_OK && request->folder) code = make_folder(request->folder);
    return code;
}

int cmd_batch(int argc, char **argv)
{
    batch_request request = {.samples = 0};
    batch_list list = {0};
    cli_words meshes;
    char report[PATH_MAX];
    solve_request_init(&request.each, "batch");
    int code = parse(&request, &meshes, argc, argv);
    if (code != CLI_GO_ON) return code;
    code = settle(&request, report);
    if (code == EXIT_OK) code = batch_list_create(&meshes, request.folder, &list);
    if (code == EXIT_OK) code = batch_run(&request, &list);
    batch_list_free(&list);
    return code;
}
