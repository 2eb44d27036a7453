/* A file of sources: one a line, as X,Y,Z (or with blanks) or `vertex I`; # begins a comment. */
#include "solve.h"

#include <ctype.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

static bool read_vertex(const char *text, int64_t *vertex)
{
    char *end;
    errno = 0;
    *vertex = strtoll(text, &end, 10);
    return end != text && *cli_skip_blanks(end) == '\0' && *vertex >= 0 && errno == 0;
}

/* Fill source->vertex and xyz from a line without its comment. */
static bool read_source(const char *text, solve_source *source)
{
    static const char word[] = "vertex";
    const size_t n = sizeof word - 1;
    source->vertex = -1;
    if (strncmp(text, word, n) == 0 && isspace((unsigned char)text[n])) {
        return read_vertex(text + n, &source->vertex);
    }
    return cli_read_point(text, source->xyz);
}

typedef struct source_list {
    const char *path;
    solve_source *source;
    size_t n;
} source_list;

static int add(source_list *l, const solve_source *source)
{
    if ((l->n & (l->n - 1)) == 0) { /* full: the room is a power of two */
        solve_source *more = realloc(l->source, (l->n ? 2 * l->n : 1) * sizeof *more);
        if (!more) return cli_library_error(NULL, DMK_E_NOMEM);
        l->source = more;
    }
    l->source[l->n++] = *source;
    return EXIT_OK;
}

static int take_line(char *line, int64_t number, void *data)
{
    source_list *l = data;
    solve_source source = {.line = number};
    line[strcspn(line, "#")] = '\0';
    const char *text = cli_skip_blanks(line);
    if (!*text) return EXIT_OK;
    if (read_source(text, &source)) return add(l, &source);
    return cli_error(cli_exit_code(DMK_E_FORMAT),
                     "%s:%lld: '%.60s' is not a source; expected X,Y,Z or vertex I", l->path,
                     (long long)number, text);
}

int solve_read_sources(const char *path, solve_source **sources, size_t *n)
{
    source_list l = {.path = path};
    int code = cli_read_lines(path, take_line, &l);
    if (code == EXIT_OK && l.n == 0)
        code = cli_error(cli_exit_code(DMK_E_FORMAT), "%s: contains no sources", path);
    if (code != EXIT_OK) {
        free(l.source);
        l = (source_list){0};
    }
    *sources = l.source;
    *n = l.n;
    return code;
}
