/* The meshes of a batch: files, folders with all that is below them, lists of files. */
#include "batch.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

typedef struct lister {
    batch_list *list;
    size_t room;
    struct stat out; /* the folder of results, where nothing is looked for */
    bool has_out;
} lister;

/* Length of `path` without a mesh's suffix, or 0 if it has none. */
static size_t stem_length(const char *path)
{
    dmk_format_info format;
    size_t n = strlen(path);
    if (n > 3 && strcasecmp(path + n - 3, ".gz") == 0) n -= 3;
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++) {
        const char *s = format.suffixes;
        while (format.reads_mesh && *s) {
            const size_t length = strcspn(s, " ");
            if (length > 0 && n > length && strncasecmp(path + n - length, s, length) == 0)
                return n - length;
            s += length + (s[length] == ' ');
        }
    }
    return 0;
}

static const char *base_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

/* `name`: the end of `path` that its files are named by. */
static int add(lister *l, const char *path, const char *name)
{
    batch_list *list = l->list;
    if (list->n == l->room) {
        const size_t room = 2 * l->room + 64;
        batch_mesh *more = realloc(list->mesh, room * sizeof *more);
        if (!more) return cli_library_error(NULL, DMK_E_NOMEM);
        list->mesh = more;
        l->room = room;
    }
    batch_mesh *m = &list->mesh[list->n];
    *m = (batch_mesh){.path = strdup(path), .name = strdup(name), .bytes = -1};
    list->n++;
    return m->path && m->name ? EXIT_OK : cli_library_error(NULL, DMK_E_NOMEM);
}

static int add_path(lister *l, const char *path, bool from_list);

/* All meshes below a folder; `head` characters of a path in it do not go into names. */
static int add_folder(lister *l, const char *folder, size_t head)
{
    DIR *dir = opendir(folder);
    if (!dir) return cli_error(EXIT_IO, "cannot open '%s': %s", folder, strerror(errno));
    int code = EXIT_OK;
    struct dirent *entry;
    while (code == EXIT_OK && (entry = readdir(dir)) != NULL) {
        char path[PATH_MAX];
        struct stat file;
        if (entry->d_name[0] == '.') continue; /* hidden, and the folder itself */
        if (snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) >= PATH_MAX) {
            code = cli_error(EXIT_IO, "the name '%s/%s' is too long", folder, entry->d_name);
        } else if (stat(path, &file) != 0) {
            code = cli_error(EXIT_IO, "cannot look at '%s': %s", path, strerror(errno));
        } else if (S_ISDIR(file.st_mode)) {
            const bool own =
                l->has_out && file.st_dev == l->out.st_dev && file.st_ino == l->out.st_ino;
            if (!own) code = add_folder(l, path, head);
        } else if (stem_length(entry->d_name) > 0) {
            code = add(l, path, path + head);
        }
    }
    closedir(dir);
    return code;
}

/* A list is a file of paths, a line each; "#" begins a comment. */
static int take_line(char *line, int64_t number, void *data)
{
    (void)number;
    return *line && *line != '#' ? add_path(data, line, true) : EXIT_OK;
}

static bool is_list(const char *path)
{
    const char *dot = strrchr(path, '.');
    return strcmp(path, "-") == 0 ||
           (dot && (strcasecmp(dot, ".txt") == 0 || strcasecmp(dot, ".list") == 0));
}

static int add_path(lister *l, const char *path, bool from_list)
{
    struct stat file;
    if (!from_list && is_list(path)) return cli_read_lines(path, take_line, l);
    if (stat(path, &file) == 0 && S_ISDIR(file.st_mode))
        return add_folder(l, path, strlen(path) + 1);
    return add(l, path, base_of(path)); /* that it is no mesh is for its reader to say */
}

static int by_name(const void *a, const void *b)
{
    const batch_mesh *x = a, *y = b;
    const int sign = strcmp(x->name, y->name);
    return sign ? sign : strcmp(x->path, y->path);
}

/* Names without their suffix, but where two would become the same. The meshes are sorted by name. */
static int shorten_names(batch_list *list)
{
    bool *alike = calloc(list->n + 1, sizeof *alike);
    if (!alike) return cli_library_error(NULL, DMK_E_NOMEM);
    for (size_t i = 1; i < list->n; i++) {
        const char *a = list->mesh[i - 1].name, *b = list->mesh[i].name;
        const size_t n = stem_length(a);
        if (n > 0 && n == stem_length(b) && strncmp(a, b, n) == 0) alike[i - 1] = alike[i] = true;
    }
    for (size_t i = 0; i < list->n; i++) {
        const size_t n = stem_length(list->mesh[i].name);
        if (n > 0 && !alike[i]) list->mesh[i].name[n] = '\0';
    }
    free(alike);
    return EXIT_OK;
}

static int check_names(batch_list *list)
{
    qsort(list->mesh, list->n, sizeof *list->mesh, by_name);
    for (size_t i = 1; i < list->n; i++) {
        const batch_mesh *a = &list->mesh[i - 1], *b = &list->mesh[i];
        if (strcmp(a->name, b->name) != 0) continue;
        return cli_error(
            EXIT_USAGE,
            "batch: '%s' and '%s' would have files of the same name; name the folder that holds "
            "both, or do them one by one",
            a->path, b->path);
    }
    return EXIT_OK;
}

int batch_list_create(const cli_words *operands, const char *out_folder, batch_list *list)
{
    int code = EXIT_OK;
    *list = (batch_list){0};
    lister l = {.list = list};
    l.has_out = out_folder && stat(out_folder, &l.out) == 0;
    for (size_t i = 0; i < operands->n && code == EXIT_OK; i++) {
        char path[PATH_MAX];
        size_t n = (size_t)snprintf(path, sizeof path, "%s", operands->word[i]);
        if (n >= sizeof path)
            return cli_error(EXIT_IO, "the name '%.60s...' is too long", operands->word[i]);
        while (n > 1 && path[n - 1] == '/') path[--n] = '\0';
        code = add_path(&l, path, false);
    }
    if (code == EXIT_OK && list->n == 0) code = cli_error(EXIT_IO, "batch: no mesh found");
    if (code == EXIT_OK) code = check_names(list);
    if (code == EXIT_OK) code = shorten_names(list);
    if (code == EXIT_OK) code = check_names(list); /* "a" beside "a.off" */
    return code;
}

void batch_list_free(batch_list *list)
{
    for (size_t i = 0; i < list->n; i++) {
        free(list->mesh[i].path);
        free(list->mesh[i].name);
    }
    free(list->mesh);
    *list = (batch_list){0};
}
