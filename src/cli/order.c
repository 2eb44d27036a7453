/* What the commands that solve are asked for: the options that they share. */
#include "solve.h"

#include <limits.h>
#include <string.h>

void solve_order_init(solve_order *order, const char *command)
{
    *order = (solve_order){.command = command, .vertex = -1};
    dmk_solve_options_init(&order->solve);
    dmk_device_options_init(&order->device);
}

void solve_add(solve_table *table, const cli_option *rows, size_t n)
{
    for (size_t i = 0; i < n && table->n < SOLVE_MAX_OPTIONS; i++)
        table->row[table->n++] = rows[i];
}

void solve_add_source(solve_table *table, solve_order *order)
{
    const cli_option rows[] = {
        {.name = "source",
         .value = "X,Y,Z",
         .help = "the source: the point of the surface nearest to this one",
         .kind = CLI_POINT,
         .target = &order->source},
        {.name = "vertex",
         .value = "I",
         .help = "the source is vertex I, counted from 0",
         .kind = CLI_INTEGER,
         .target = &order->vertex,
         .lo = 0,
         .hi = INT_MAX,
         .expected = "a vertex number, from 0"},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

void solve_add_device(solve_table *table, solve_order *order)
{
    const cli_option rows[] = {
        {.name = "device",
         .value = "N|NAME",
         .help = "number of the device in `dmkcl devices`, or part of its name",
         .kind = CLI_TEXT,
         .target = &order->device.select},
        {.name = "threads",
         .value = "N",
         .help = "threads of the host, and of a CPU that is the device;\ndefault: one for each core",
         .kind = CLI_INTEGER,
         .target = &order->threads,
         .lo = 1,
         .hi = INT_MAX,
         .expected = "a whole number from 1"},
        {.name = "single",
         .help = "no double precision on the device",
         .kind = CLI_FLAG,
         .target = &order->single},
        {.name = "cache",
         .value = "DIR",
         .help = "folder for compiled kernels; '' keeps none; default: the user's\ncache folder",
         .kind = CLI_TEXT,
         .target = &order->device.cache},
        {.name = "quiet",
         .help = "print nothing but errors",
         .kind = CLI_FLAG,
         .target = &order->quiet},
        {.name = "verbose",
         .help = "a line for each step, on the standard error",
         .kind = CLI_FLAG,
         .target = &order->verbose},
    };
    solve_add(table, rows, sizeof rows / sizeof *rows);
}

int solve_order_settle(solve_order *order)
{
    const int n = (order->source.n > 0) + (order->vertex >= 0) + (order->sources != NULL);
    order->device.threads = (int)order->threads;
    order->device.single_precision = order->single;
    if (n == 0) {
        return cli_error(EXIT_USAGE, "%s: where is the source? Give --source X,Y,Z or --vertex I",
                         order->command);
    }
    if (n > 1) {
        return cli_error(EXIT_USAGE, "%s: give --source or --vertex%s, not both", order->command,
                         order->sources ? " or --sources" : "");
    }
    if (order->quiet && order->verbose) {
        return cli_error(EXIT_USAGE, "%s: give --quiet or --verbose, not both", order->command);
    }
    return EXIT_OK;
}
