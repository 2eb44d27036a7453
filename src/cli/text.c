/* Texts: files that are read as such, figures for people, what the operating system knows of the run. */
#include "cli.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

int cli_read_lines(const char *path, cli_take *take, void *data)
{
    static const char mark[] = "\xef\xbb\xbf"; /* what some editors write before a text in UTF-8 */
    FILE *file = fopen(strcmp(path, "-") == 0 ? "/dev/stdin" : path, "r");
    if (!file) return cli_error(EXIT_IO, "cannot open '%s': %s", path, strerror(errno));
    char *line = NULL;
    size_t room = 0;
    int code = EXIT_OK;
    errno = 0;
    for (int64_t number = 1; code == EXIT_OK && getline(&line, &room, file) >= 0; number++) {
        const bool marked = number == 1 && strncmp(line, mark, strlen(mark)) == 0;
        line[strcspn(line, "\r\n")] = '\0';
        code = take(line + (marked ? strlen(mark) : 0), number, data);
    }
    if (code == EXIT_OK && !feof(file)) { /* out of memory for a line is no error of the file */
        code = cli_error(errno == ENOMEM ? EXIT_MEMORY : EXIT_IO, "cannot read '%s': %s", path,
                         strerror(errno));
    }
    free(line);
    fclose(file);
    return code;
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
