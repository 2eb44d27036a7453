/* A file of sources: one a line, as X,Y,Z (or with blanks) or `vertex I`; # begins a comment. */
#include "solve.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *skip_blanks(const char *text)
{
    while (isspace((unsigned char)*text)) text++;
    return text;
}

/* Three numbers with commas or blanks between them. */
static bool read_point(const char *text, double xyz[3])
{
    for (int k = 0; k < 3; k++) {
        char *end;
        xyz[k] = strtod(text, &end); /* the locale is C: see main */
        if (end == text || !isfinite(xyz[k])) return false;
        text = skip_blanks(end);
        if (k < 2 && *text == ',')
            text = skip_blanks(text + 1);
        else if (k < 2 && text == end)
            return false;
    }
    return *text == '\0';
}

static bool read_vertex(const char *text, int64_t *vertex)
{
    char *end;
    errno = 0;
    *vertex = strtoll(text, &end, 10);
    return end != text && *skip_blanks(end) == '\0' && *vertex >= 0 && errno == 0;
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
    return read_point(text, source->xyz);
}

static int add(solve_source **list, size_t *n, const solve_source *source)
{
    if ((*n & (*n - 1)) == 0) { /* full: the room is a power of two */
        solve_source *more = realloc(*list, (*n ? 2 * *n : 1) * sizeof *more);
        if (!more) return cli_library_error(NULL, DMK_E_NOMEM);
        *list = more;
    }
    (*list)[(*n)++] = *source;
    return EXIT_OK;
}

static int read_lines(FILE *file, const char *path, solve_source **list, size_t *n)
{
    char *line = NULL;
    size_t room = 0;
    int code = EXIT_OK;
    errno = 0;
    for (int64_t number = 1; code == EXIT_OK && getline(&line, &room, file) >= 0; number++) {
        solve_source source = {.line = number};
        line[strcspn(line, "#\r\n")] = '\0';
        const char *text = skip_blanks(line);
        if (!*text) continue;
        if (read_source(text, &source))
            code = add(list, n, &source);
        else {
            code = cli_error(cli_exit_code(DMK_E_FORMAT),
                             "%s:%lld: '%.60s' is not a source; expected X,Y,Z or vertex I", path,
                             (long long)number, text);
        }
    }
    if (code == EXIT_OK && !feof(file)) { /* out of memory for a line is no error of the file */
        code = cli_error(errno == ENOMEM ? EXIT_MEMORY : EXIT_IO, "cannot read '%s': %s", path,
                         strerror(errno));
    }
    free(line);
    return code;
}

int solve_read_sources(const char *path, solve_source **sources, size_t *n)
{
    *sources = NULL;
    *n = 0;
    FILE *file = cli_open_text(path);
    if (!file) return EXIT_IO;
    int code = read_lines(file, path, sources, n);
    fclose(file);
    if (code == EXIT_OK && *n == 0) {
        code = cli_error(cli_exit_code(DMK_E_FORMAT), "%s: contains no sources", path);
    }
    if (code != EXIT_OK) {
        free(*sources);
        *sources = NULL;
    }
    return code;
}
