/* Texts: files that are read as such, figures for people, what the operating system knows of the run. */
#include "cli.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

FILE *cli_open_text(const char *path)
{
    FILE *file = fopen(strcmp(path, "-") == 0 ? "/dev/stdin" : path, "r");
    if (!file) cli_error(EXIT_IO, "cannot open '%s': %s", path, strerror(errno));
    return file;
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
