/* The meshes of a batch: files, folders with all that is below them, lists of files. */
#include "batch.h"

#include <dirent.h>
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

static bool is_list(const char *path)
{
    struct stat file;
    const char *dot = strrchr(path, '.');
    const bool named = dot && (strcasecmp(dot, ".txt") == 0 || strcasecmp(dot, ".list") == 0);
    return strcmp(path, "-") == 0 || (named && !(stat(path, &file) == 0 && S_ISDIR(file.st_mode)));
}

/* Nothing is found in any operand: the first one says where was looked, and for what. */
static int none_found(const char *operand)
{
    char suffixes[256] = "";
    dmk_format_info format;
    if (is_list(operand)) return cli_error(EXIT_IO, "batch: the list '%s' names no mesh", operand);
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++) {
        const size_t used = strlen(suffixes);
        if (format.reads_mesh)
            snprintf(suffixes + used, sizeof suffixes - used, " %s", format.suffixes);
    }
    return cli_error(EXIT_IO, "batch: no mesh in the folder '%s' or below it: no file ends in%s",
                     operand, suffixes);
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

/* A folder on the way to the one that is being looked at; the first one has no `above`. */
typedef struct folder_way {
    const struct folder_way *above;
    struct stat here;
} folder_way;

/* A link may lead back to a folder above it. */
static bool is_on_way(const folder_way *way, const struct stat *folder)
{
    while (way && !dmk_is_same_file(&way->here, folder)) way = way->above;
    return way != NULL;
}

/* All meshes below a folder; `head` characters of a path in it do not go into names. */
static int add_folder(lister *l, const char *folder, size_t head, const folder_way *way)
{
    DIR *dir = opendir(folder);
    if (!dir) /* its reader says why, as of a mesh */
        return add(l, folder, way->above ? folder + head : base_of(folder));
    int code = EXIT_OK;
    struct dirent *entry;
    while (code == EXIT_OK && (entry = readdir(dir)) != NULL) {
        char path[PATH_MAX];
        struct stat file;
        if (entry->d_name[0] == '.') continue; /* hidden, and the folder itself */
        if (snprintf(path, sizeof path, "%s/%s", folder, entry->d_name) >= PATH_MAX) {
            code = cli_error(EXIT_IO, "the name '%s/%s' is too long", folder, entry->d_name);
        } else if (stat(path, &file) == 0 && S_ISDIR(file.st_mode)) {
            const folder_way below = {way, file};
            if (!(l->has_out && dmk_is_same_file(&file, &l->out)) && !is_on_way(way, &file))
                code = add_folder(l, path, head, &below);
        } else if (stem_length(entry->d_name) > 0) { /* of a link to nowhere its reader says so */
            code = add(l, path, path + head);
        }
    }
    closedir(dir);
    return code;
}

/* "#" begins a comment, behind a blank only where a mesh or folder stands before it: names with " #" in them stay. */
static void drop_comment(char *line)
{
    struct stat file;
    if (*line == '#') *line = '\0';
    for (char *blank = line; stat(line, &file) != 0 && (blank = strpbrk(blank, " \t")); blank++) {
        if (blank[strspn(blank, " \t")] != '#') continue;
        const char kept = *blank;
        *blank = '\0';
        if (stat(line, &file) == 0 || stem_length(line) > 0) return;
        *blank = kept;
    }
}

/* A list is a file of paths, a line each, blanks around which are none of theirs. */
static int take_line(char *line, int64_t number, void *data)
{
    (void)number;
    line += strspn(line, " \t");
    size_t n = strlen(line);
    while (n > 0 && strchr(" \t", line[n - 1])) line[--n] = '\0';
    drop_comment(line);
    return *line ? add_path(data, line, true) : EXIT_OK;
}

static int add_path(lister *l, const char *path, bool from_list)
{
    folder_way way = {.above = NULL};
    if (!from_list && is_list(path)) return cli_read_lines(path, take_line, l);
    if (stat(path, &way.here) == 0 && S_ISDIR(way.here.st_mode)) {
        if (l->has_out && dmk_is_same_file(&way.here, &l->out))
            return cli_error(EXIT_USAGE,
                             "--out-dir: '%s' is looked through for meshes, and would have results "
                             "among them; choose another folder",
                             path);
        return add_folder(l, path, strlen(path) + 1, &way);
    }
    return add(l, path, base_of(path)); /* that it is no mesh is for its reader to say */
}

static int by_name(const void *a, const void *b)
{
    const batch_mesh *x = a, *y = b;
    const int sign = strcmp(x->name, y->name);
    return sign ? sign : strcmp(x->path, y->path);
}

typedef struct stem {
    char *name;
    size_t n;      /* without the suffix; 0: it has none */
    bool is_piece; /* of another one's PVTP file, if its name had no suffix */
} stem;

static int by_stem(const void *a, const void *b)
{
    const stem *x = a, *y = b;
    const int sign = memcmp(x->name, y->name, x->n < y->n ? x->n : y->n);
    return sign ? sign : (x->n > y->n) - (x->n < y->n);
}

static int stem_to_name(const void *a, const void *b)
{
    const stem *x = a;
    const batch_mesh *mesh = b;
    const int sign = strncmp(x->name, mesh->name, x->n);
    return sign ? sign : -(mesh->name[x->n] != '\0');
}

/* Whether files of a mesh by this name would be taken for the lines of another: see names.c. */
static bool is_of_lines(const stem *of)
{
    static const char *const kind[] = {".locus", ".tangent"};
    for (int k = 0; k < 2; k++) {
        const size_t n = strlen(kind[k]);
        if (of->n > n && memcmp(of->name + of->n - n, kind[k], n) == 0) return true;
    }
    return false;
}

/* Whether it would be the name of a piece of another mesh's PVTP file. Stems and meshes are sorted. */
static bool is_piece(const stem *of, const stem *all, const batch_list *list)
{
    const stem whole = {of->name, cli_piece_stem(of->name, of->n), false};
    return whole.n > 0 && (bsearch(&whole, all, list->n, sizeof *all, by_stem) ||
                           bsearch(&whole, list->mesh, list->n, sizeof *list->mesh, stem_to_name));
}

/* Names without their suffix, but where that is another's name or what becomes of it. The meshes are sorted by name. */
static int shorten_names(batch_list *list)
{
    stem *of = calloc(list->n + 1, sizeof *of);
    if (!of) return cli_library_error(NULL, DMK_E_NOMEM);
    for (size_t i = 0; i < list->n; i++)
        of[i] = (stem){list->mesh[i].name, stem_length(list->mesh[i].name), false};
    for (size_t i = 0; i < list->n; i++)
        if (is_of_lines(&of[i])) of[i].n = 0;
    qsort(of, list->n, sizeof *of, by_stem);
    for (size_t i = 0; i < list->n; i++) of[i].is_piece = is_piece(&of[i], of, list);
    for (size_t i = 0, end; i < list->n; i = end) {
        for (end = i + 1; end < list->n && by_stem(&of[i], &of[end]) == 0;) end++;
        const bool taken = bsearch(&of[i], list->mesh, list->n, sizeof *list->mesh, stem_to_name);
        for (size_t k = i; k < end && (taken || of[i].is_piece || end > i + 1); k++) of[k].n = 0;
    }
    for (size_t i = 0; i < list->n; i++)
        if (of[i].n > 0) of[i].name[of[i].n] = '\0';
    free(of);
    return EXIT_OK;
}

static int check_names(batch_list *list)
{
    qsort(list->mesh, list->n, sizeof *list->mesh, by_name);
    for (size_t i = 1; i < list->n; i++) {
        const batch_mesh *a = &list->mesh[i - 1], *b = &list->mesh[i];
        if (strcmp(a->name, b->name) != 0) continue;
        if (strcmp(a->path, b->path) == 0)
            return cli_error(EXIT_USAGE, "batch: '%s' is named twice; name it once", a->path);
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
    *list = (batch_list){.operands = operands};
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
    if (code == EXIT_OK && list->n == 0) code = none_found(operands->word[0]);
    if (code == EXIT_OK) code = check_names(list);
    if (code == EXIT_OK) code = shorten_names(list);
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
