/* Texts: files that are read as such, figures for people, what the operating system knows of the run. */
#include "cli.h"

#include <ctype.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

/* What getline gives, which ends in "\n" or "\r\n", or is several lines if these end in "\r". */
static int take_lines(char *text, int64_t *number, cli_take *take, void *data)
{
    int code = EXIT_OK;
    for (char *line = text, *next; line && code == EXIT_OK; line = next) {
        char *end = line + strcspn(line, "\r\n");
        next = *end == '\r' && end[1] != '\0' && end[1] != '\n' ? end + 1 : NULL;
        *end = '\0';
        code = take(line, ++*number, data);
    }
    return code;
}

int cli_read_lines(const char *path, cli_take *take, void *data)
{
    static const char mark[] = "\xef\xbb\xbf"; /* what some editors write before a text in UTF-8 */
    const bool given = strcmp(path, "-") == 0 || strcmp(path, "/dev/stdin") == 0;
    FILE *file = given ? stdin : fopen(path, "r"); /* as the library takes it */
    if (!file) return cli_error(EXIT_IO, "cannot open '%s': %s", path, strerror(errno));
    char *text = NULL;
    size_t room = 0;
    int64_t number = 0;
    ssize_t length;
    int code = EXIT_OK;
    errno = 0;
    while (code == EXIT_OK && (length = getline(&text, &room, file)) >= 0) {
        const bool marked = number == 0 && strncmp(text, mark, strlen(mark)) == 0;
        code = strlen(text) == (size_t)length
                   ? take_lines(text + (marked ? strlen(mark) : 0), &number, take, data)
                   : cli_error(cli_exit_code(DMK_E_FORMAT),
                               "%s:%lld: a byte 0 is in the line: no text", path,
                               (long long)number + 1);
    }
    if (code == EXIT_OK && !feof(file)) { /* out of memory for a line is no error of the file */
        code = cli_error(errno == ENOMEM ? EXIT_MEMORY : EXIT_IO, "cannot read '%s': %s", path,
                         strerror(errno));
    }
    free(text);
    if (!given) fclose(file);
    return code;
}

double cli_decimal(const char *text, char **end)
{
    const char *digits = text + strspn(text, " \t");
    digits += *digits == '-' || *digits == '+';
    *end = (char *)text;
    if (digits[0] == '0' && (digits[1] == 'x' || digits[1] == 'X')) return 0;
    return strtod(text, end); /* the locale is C: see main */
}

const char *cli_skip_blanks(const char *text)
{
    while (isspace((unsigned char)*text)) text++;
    return text;
}

bool cli_read_point(const char *text, double xyz[3])
{
    for (int k = 0; k < 3; k++) {
        char *end;
        xyz[k] = cli_decimal(text, &end);
        if (end == text || !isfinite(xyz[k])) return false;
        text = cli_skip_blanks(end);
        if (k < 2 && *text == ',')
            text = cli_skip_blanks(text + 1);
        else if (k < 2 && text == end)
            return false;
    }
    return *text == '\0';
}

const char *cli_count(int64_t n, char text[CLI_TEXT_SIZE])
{
    char digits[CLI_TEXT_SIZE];
    const int length = snprintf(digits, sizeof digits, "%" PRId64, n);
    int j = 0;
    for (int i = 0; i < length; i++) {
        if (i > 0 && (length - i) % 3 == 0 && digits[i - 1] != '-') text[j++] = ',';
        text[j++] = digits[i];
    }
    text[j] = '\0';
    return text;
}

const char *cli_counted(int64_t n, const char *one, const char *many, char text[CLI_TEXT_SIZE])
{
    const size_t used = strlen(cli_count(n, text));
    snprintf(text + used, CLI_TEXT_SIZE - used, " %s", n == 1 ? one : many);
    return text;
}

const char *cli_left(size_t n, char text[CLI_TEXT_SIZE])
{
    text[0] = '\0';
    if (n > 0) snprintf(text, CLI_TEXT_SIZE, ", %zu left", n);
    return text;
}

const char *cli_bytes(uint64_t bytes, char text[CLI_TEXT_SIZE])
{
    static const char *const units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    double x = (double)bytes;
    int unit = 0;
    for (; x >= 1024 && unit < 4; unit++) x /= 1024;
    snprintf(text, CLI_TEXT_SIZE, x < 10 && unit > 0 ? "%.1f %s" : "%.0f %s", x, units[unit]);
    return text;
}

void cli_print_memory(const dmk_mesh *mesh, bool single)
{
    char all[CLI_TEXT_SIZE], host[CLI_TEXT_SIZE], device[CLI_TEXT_SIZE];
    dmk_memory memory;
    dmk_mesh_memory(mesh, single, &memory);
    printf("a solve takes about %s: %s on the host, %s on the device\n",
           cli_bytes(memory.host + memory.device, all), cli_bytes(memory.host, host),
           cli_bytes(memory.device, device));
}

const char *cli_point(const double xyz[3], char text[CLI_TEXT_SIZE])
{
    snprintf(text, CLI_TEXT_SIZE, "%.6g, %.6g, %.6g", xyz[0], xyz[1], xyz[2]);
    return text;
}

uint64_t cli_peak_memory(void)
{
    struct rusage usage;
    if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
    return (uint64_t)usage.ru_maxrss * 1024; /* Linux counts in KiB */
}

double cli_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
