/* dmkcl devices: the OpenCL devices, and the machine as hwloc sees it. */
#include "cli.h"

#include <stdlib.h>

static void print_devices(const dmk_device_info *devices, size_t n)
{
    char memory[CLI_TEXT_SIZE], units[CLI_TEXT_SIZE];
    printf("%sOpenCL devices%s (choose with --device N or a part of the name)\n", cli_bold(),
           cli_plain());
    for (size_t i = 0; i < n; i++) {
        const dmk_device_info *d = &devices[i];
        printf("  %zu  %s\n", i, d->name);
        printf("     %s, %s, %s, %s\n", d->type,
               cli_counted(d->compute_units, "compute unit", "compute units", units),
               cli_bytes(d->memory, memory),
               d->fp64 ? "double precision" : "single precision only");
        printf("     %s, driver %s\n", d->platform, d->driver);
    }
}

static void print_machine(const dmk_machine_info *machine)
{
    const uint64_t caches[] = {machine->l1, machine->l2, machine->l3}; /* 0: none, or not known */
    const char *before = "  caches: ";
    char memory[CLI_TEXT_SIZE], n[4][CLI_TEXT_SIZE];
    printf("%sMachine%s\n", cli_bold(), cli_plain());
    printf("  %s, %s, %s, %s, %s of memory\n",
           cli_counted(machine->packages, "package", "packages", n[0]),
           cli_counted(machine->numa_nodes, "NUMA node", "NUMA nodes", n[1]),
           cli_counted(machine->cores, "core", "cores", n[2]),
           cli_counted(machine->threads, "thread", "threads", n[3]),
           cli_bytes(machine->memory, memory));
    for (int i = 0; i < 3; i++) {
        if (caches[i] == 0) continue;
        printf("%sL%d %s", before, i + 1, cli_bytes(caches[i], memory));
        before = ", ";
    }
    if (*before == ',') printf("\n");
}

static void print_json(const dmk_device_info *devices, size_t n, const dmk_machine_info *machine)
{
    cli_json json = {.file = stdout};
    json_open(&json, NULL, '{');
    json_open(&json, "devices", '[');
    for (size_t i = 0; i < n; i++) {
        const dmk_device_info *d = &devices[i];
        json_open(&json, NULL, '{');
        json_integer(&json, "number", (int64_t)i);
        json_text(&json, "name", d->name);
        json_text(&json, "platform", d->platform);
        json_text(&json, "driver", d->driver);
        json_text(&json, "type", d->type);
        json_integer(&json, "compute_units", d->compute_units);
        json_bool(&json, "fp64", d->fp64);
        json_integer(&json, "memory", (int64_t)d->memory);
        json_close(&json, '{');
    }
    json_close(&json, '[');
    json_open(&json, "machine", '{');
    json_integer(&json, "packages", machine->packages);
    json_integer(&json, "numa_nodes", machine->numa_nodes);
    json_integer(&json, "cores", machine->cores);
    json_integer(&json, "threads", machine->threads);
    json_integer(&json, "l1", (int64_t)machine->l1);
    json_integer(&json, "l2", (int64_t)machine->l2);
    json_integer(&json, "l3", (int64_t)machine->l3);
    json_integer(&json, "memory", (int64_t)machine->memory);
    json_close(&json, '{');
    json_close(&json, '{');
}

static int show(bool as_json)
{
    enum { CAPACITY = 64 };
    dmk_context *context;
    dmk_device_info *devices = calloc(CAPACITY, sizeof *devices);
    dmk_machine_info machine;
    size_t n = 0;
    int rc = dmk_context_create(&context);
    if (rc == DMK_OK && !devices) rc = DMK_E_NOMEM;
    if (rc == DMK_OK) rc = cli_device_list(context, devices, CAPACITY, &n);
    if (rc == DMK_OK) rc = dmk_machine_get_info(context, &machine);
    if (n > CAPACITY) n = CAPACITY;
    if (rc != DMK_OK) {
        rc = cli_library_error(context, rc);
    } else {
        if (as_json) {
            print_json(devices, n, &machine);
        } else {
            print_devices(devices, n);
            print_machine(&machine);
        }
        rc = cli_flush();
    }
    free(devices);
    dmk_context_destroy(&context);
    return rc;
}

int cmd_devices(int argc, char **argv)
{
    bool as_json = false;
    const cli_option options[] = {
        {.name = "json", .help = "print JSON", .kind = CLI_FLAG, .target = &as_json},
    };
    const cli_syntax syntax = {
        .command = "devices",
        .usage = "[--json]",
        .summary = "The OpenCL devices by number, and the machine's cores, caches and memory.",
        .options = options,
        .n_options = sizeof options / sizeof *options,
    };
    const int code = cli_parse(&syntax, argc, argv, NULL);
    return code == CLI_GO_ON ? show(as_json) : code;
}
