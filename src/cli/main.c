/* dmkcl: the tool. */
#include "cli.h"
#include "ranks.h"

#include <fcntl.h>
#include <locale.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *summary;
    bool together; /* of several ranks each has a part of the work; else the first one does it */
} command;

static const command commands[] = {
    {"solve", cmd_solve, "density, distance and cut locus of a point on a mesh", true},
    {"batch", cmd_batch, "the same for many meshes, in one process that can be resumed", true},
    {"transport", cmd_transport, "optimal transport between two measures on a mesh", false},
    {"distance", cmd_distance, "exact geodesic distances from points or the border of a mesh",
     false},
    {"path", cmd_path, "a minimal geodesic from a point back to the source", false},
    {"cut", cmd_cut, "the surface cut open along the cut locus, a disk", false},
    {"mesh", cmd_mesh, "make a mesh of a built-in surface, or turn a file into another format",
     false},
    {"info", cmd_info, "describe a mesh: counts, topology, quality", false},
    {"devices", cmd_devices, "list the OpenCL devices and the machine", false},
};
enum { N_COMMANDS = sizeof commands / sizeof *commands };

static int print_help(void)
{
    printf("usage: dmkcl COMMAND [OPTIONS]\n"
           "\n"
           "The cut locus of a point on a triangulated surface, by optimal transport, on OpenCL.\n"
           "\n"
           "commands:\n");
    for (int i = 0; i < N_COMMANDS; i++) {
        printf("  %-10s %s\n", commands[i].name, commands[i].summary);
    }
    printf("\n"
           "`dmkcl COMMAND --help` or `dmkcl help COMMAND` lists the options of a command,\n"
           "`dmkcl --version` prints the version.\n"
           "\n"
           "exit codes:\n");
    cli_print_exit_codes(stdout);
    printf("\n"
           "environment:\n"
           "  NO_COLOR        no colours on a terminal, unless it is empty\n"
           "  XDG_CACHE_HOME  compiled kernels are kept below it; without it, below ~/.cache\n"
           "  POCL_CACHE_DIR  where PoCL keeps its own, whatever --cache says\n");
    return cli_flush();
}

static int unknown_command(const char *name)
{
    const char *names[N_COMMANDS + 1] = {NULL};
    for (int i = 0; i < N_COMMANDS; i++) names[i] = commands[i].name;
    const char *nearest = cli_nearest(name, names);
    if (nearest) {
        return cli_error(EXIT_USAGE, "no command '%s'; did you mean '%s'?", name, nearest);
    }
    return cli_error(EXIT_USAGE, "no command '%s'; `dmkcl --help` lists them", name);
}

/* PoCL reads POCL_AFFINITY once, when it starts its threads, and then pins thread i to processor i.
 * Left to wander they share a core when the machine does other work too, and every kernel waits for
 * the last one. But it gives up the whole program where processor i is not available, so this is for
 * those who may use all processors and have not asked for another number of threads. */
static void pin_device_threads(void)
{
    cpu_set_t allowed;
    long n = sysconf(_SC_NPROCESSORS_ONLN);
    if (getenv("POCL_MAX_PTHREAD_COUNT") || sched_getaffinity(0, sizeof allowed, &allowed) != 0)
        return;
    for (long i = 0; i < n; i++) {
        if (i >= CPU_SETSIZE || !CPU_ISSET((size_t)i, &allowed)) return;
    }
    setenv("POCL_AFFINITY", "1", 0);
}

/* A standard stream that the caller closed would lend its number to the next file opened, and messages
 * would run into that. Something that cannot be used takes its place: using it fails as before. */
static void fill_standard_streams(void)
{
    for (int fd = STDIN_FILENO; fd <= STDERR_FILENO; fd++) {
        if (fcntl(fd, F_GETFD) >= 0) continue;
        if (open("/dev/null", fd == STDIN_FILENO ? O_WRONLY : O_RDONLY) != fd) return;
    }
}

static bool asks_for_help(const char *word)
{
    return strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0 || strcmp(word, "help") == 0;
}

static int run(int argc, char **argv)
{
    if (argc < 2) {
        return cli_error(EXIT_USAGE, "a command is missing; `dmkcl --help` lists them");
    }
    const char *name = argv[1];
    char *of_command[] = {argv[0], argv[argc - 1], "--help", NULL}; /* `dmkcl help solve` */
    const bool help = asks_for_help(name);
    const bool version = strcmp(name, "--version") == 0;
    if (argc > 2 + help && (help || version))
        return cli_error(EXIT_USAGE, "%s: '%s' is one argument too many", name, argv[2 + help]);
    if (version) {
        printf("dmkcl %s\n", dmk_version());
        return cli_flush();
    }
    if (help && (argc == 2 || asks_for_help(argv[2]))) return print_help();
    if (help) {
        name = argv[2];
        argv = of_command;
    }
    for (int i = 0; i < N_COMMANDS; i++) {
        if (strcmp(name, commands[i].name) != 0) continue;
        if (!commands[i].together && !cli_ranks_first()) return EXIT_OK;
        return commands[i].run(argc - 1, argv + 1);
    }
    return unknown_command(name);
}

int main(int argc, char **argv)
{
    fill_standard_streams();
    cli_catch_signals();
    signal(
        SIGXFSZ,
        SIG_IGN); /* a file that grows too long is an error of the write, reported with its name */
    /* Decimal points whatever the user's language. The program never asks for another locale, but
     * an OpenCL driver might. */
    locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (c) uselocale(c);
    cli_ranks_begin(&argc, &argv);
    pin_device_threads();
    cli_keep_memory();
    return cli_ranks_end(run(argc, argv));
}
