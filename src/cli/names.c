/* The names of the files that a batch writes. */
#include "batch.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

void batch_number(bool several, size_t source, char number[BATCH_NUMBER_SIZE])
{
    number[0] = '\0';
    if (several) snprintf(number, BATCH_NUMBER_SIZE, "-%04zu", source);
}

/* DIR/NAME.vtp; of several sources DIR/NAME-0007.vtp. */
static bool name_file(const batch_request *request, const batch_mesh *mesh, size_t source,
                      const char *kind, const char **path)
{
    const char *suffix = *path;
    char number[BATCH_NUMBER_SIZE];
    batch_number(request->samples > 0, source, number);
    const size_t room = strlen(request->folder) + strlen(mesh->name) + strlen(suffix) + 64;
    char *name = malloc(room);
    if (name)
        snprintf(name, room, "%s/%s%s%s%s", request->folder, mesh->name, number, kind, suffix);
    *path = name;
    return name != NULL;
}

static bool name_files(const batch_request *request, const batch_mesh *mesh, size_t source,
                       const char *kind, cli_files *files)
{
    bool good = true;
    for (int i = 0; i < files->n; i++) {
        good = name_file(request, mesh, source, kind, &files->path[i]) && good;
    }
    return good;
}

bool batch_name_files(const batch_request *request, const batch_mesh *mesh, size_t source,
                      solve_request *one)
{
    *one = request->each;
    one->mesh = mesh->path;
    one->report = NULL;
    bool good = name_files(request, mesh, source, "", &one->out);
    good = name_files(request, mesh, source, ".locus", &one->locus) && good;
    return name_files(request, mesh, source, ".tangent", &one->tangent) && good;
}

int batch_make_folders(const char *file)
{
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s", file) >= PATH_MAX)
        return cli_error(EXIT_IO, "--out-dir: the name '%.60s...' is too long", file);
    for (char *p = path + 1; *p; p++) {
        if (*p != '/') continue;
        *p = '\0';
        if (mkdir(path, 0777) != 0 && errno != EEXIST) {
            return cli_error(EXIT_IO, "--out-dir: cannot make the folder '%s': %s", path,
                             strerror(errno));
        }
        *p = '/';
    }
    return EXIT_OK;
}

static void free_names(cli_files *files)
{
    for (int i = 0; i < files->n; i++) free((char *)files->path[i]);
    files->n = 0;
}

void batch_free_files(solve_request *one)
{
    free_names(&one->out);
    free_names(&one->locus);
    free_names(&one->tangent);
}

/* ---- what stays as it is -------------------------------------------------------------------- */

/* A file, whatever its name. */
typedef struct taken {
    dev_t device;
    ino_t inode;
    bool is_report;
} taken;

typedef struct takens {
    taken *file; /* sorted */
    size_t n;
} takens;

static bool find_file(const char *path, taken *at)
{
    struct stat file;
    const bool there = stat(path, &file) == 0;
    if (there) *at = (taken){.device = file.st_dev, .inode = file.st_ino};
    return there;
}

static int by_file(const void *a, const void *b)
{
    const taken *x = a, *y = b;
    if (x->device != y->device) return x->device < y->device ? -1 : 1;
    return (x->inode > y->inode) - (x->inode < y->inode);
}

/* What the batch reads, lists among it, and its report. */
static int list_taken(const batch_request *request, const batch_list *list, takens *all)
{
    const cli_words *operands = list->operands;
    *all = (takens){.file = calloc(list->n + operands->n + 1, sizeof *all->file)};
    if (!all->file) return cli_library_error(NULL, DMK_E_NOMEM);
    for (size_t i = 0; i < list->n; i++)
        all->n += find_file(list->mesh[i].path, &all->file[all->n]);
    for (size_t i = 0; i < operands->n; i++)
        all->n += find_file(operands->word[i], &all->file[all->n]);
    if (solve_reports_to_file(&request->each) &&
        find_file(request->each.report, &all->file[all->n]))
        all->file[all->n++].is_report = true;
    qsort(all->file, all->n, sizeof *all->file, by_file);
    return EXIT_OK;
}

/* A file of a result, which need not be there; *there: whether it is. */
static int check_name(const takens *all, const char *path, bool *there)
{
    taken at;
    *there = find_file(path, &at);
    const taken *is = *there ? bsearch(&at, all->file, all->n, sizeof *all->file, by_file) : NULL;
    if (!is) return EXIT_OK;
    return is->is_report
               ? cli_error(EXIT_USAGE,
                           "--report: '%s' is also a file of a result; choose another name", path)
               : cli_error(EXIT_USAGE, "--out-dir: '%s' is read by this run; choose another folder",
                           path);
}

static int check_files(const takens *all, const cli_files *files)
{
    int code = EXIT_OK;
    for (int i = 0; i < files->n && code == EXIT_OK; i++) {
        bool there;
        char *piece;
        code = check_name(all, files->path[i], &there);
        there = true;
        for (int k = 0; there && code == EXIT_OK && (piece = cli_name_piece(files->path[i], k));
             k++) {
            code = check_name(all, piece, &there);
            free(piece);
        }
    }
    return code;
}

int batch_check_names(const batch_request *request, const batch_list *list)
{
    takens all;
    int code = list_taken(request, list, &all);
    const size_t n = request->samples > 0 ? (size_t)request->samples : 1;
    for (size_t i = 0; i < n * list->n && code == EXIT_OK; i++) {
        solve_request one;
        if (!batch_name_files(request, &list->mesh[i / n], i % n, &one))
            code = cli_library_error(NULL, DMK_E_NOMEM);
        if (code == EXIT_OK) code = check_files(&all, &one.out);
        if (code == EXIT_OK) code = check_files(&all, &one.locus);
        if (code == EXIT_OK) code = check_files(&all, &one.tangent);
        batch_free_files(&one);
    }
    free(all.file);
    return code;
}
