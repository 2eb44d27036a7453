/* What a solve will need, and what there is. */
#include "solver/memory.h"

#include "geodesic/geodesic.h"
#include "solver/fine_graph.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Bytes per triangle of a closed mesh, which has half as many vertices and one and a half times as many
 * edges; counted from system.c, where single precision halves what the outer program owns, and measured
 * (peak resident size at 1.09 million triangles: 847 bytes with the 78 of the drivers). tests/test_memory.sh
 * compares them with what a run takes. */
enum {
    PER_TRIANGLE_PACKED = 266, /* operator, rows, hierarchy */
    PER_TRIANGLE_STATE = 212,  /* state and work arrays */
    SINGLE_SAVES = 72,
    PER_TRIANGLE_HOST = 300, /* the mesh twice, geodesics, maps, working space, result */
    PER_TRIANGLE_MESH = 80,  /* of these the mesh as given, which is there before a solve */
    PER_TRIANGLE_EXACT = 96, /* three strides of exact windows, while the system is packed */
    FIXED_HOST = 90 << 20    /* OpenCL drivers with their compilers, the kernels */
};

void dmk_solve_memory(size_t n_triangles, int single_precision, dmk_memory *memory)
{
    if (!memory) return;
    const uint64_t n = n_triangles;
    memory->device = n * (PER_TRIANGLE_PACKED + PER_TRIANGLE_STATE);
    if (single_precision) memory->device -= n * SINGLE_SAVES;
    memory->host = n * PER_TRIANGLE_HOST + FIXED_HOST;
    if (n <= DMK_EXACT_TRIANGLES) memory->host += n * PER_TRIANGLE_EXACT;
}

void dmk_mesh_memory(const dmk_mesh *mesh, int single_precision, dmk_memory *memory)
{
    if (!memory) return;
    *memory = (dmk_memory){0};
    if (!mesh) return;
    dmk_solve_memory((size_t)mesh->n_triangles, single_precision, memory);
    if (!mesh->length) return; /* nothing is known of angles */
    int64_t n = 0;
    for (int32_t t = 0; t < mesh->n_triangles; t++) {
        double cot[3];
        dmk_cots(mesh, t, cot);
        n += dmk_is_needle(cot);
    }
    if (!single_precision && dmk_fine_graph_pays(mesh->n_triangles, n, mesh->sharpest))
        memory->host += (uint64_t)mesh->n_triangles * DMK_FINE_GRAPH_BYTES;
}

/* The number behind `name` in a file of "name: number kB" lines or, with name "", at its beginning. */
static bool read_number(const char *path, const char *name, uint64_t *value)
{
    char line[256];
    unsigned long long number = 0;
    bool found = false;
    FILE *file = fopen(path, "r");
    if (!file) return false;
    while (!found && fgets(line, sizeof line, file)) {
        const size_t n = strlen(name);
        char *end = NULL;
        if (strncmp(line, name, n) != 0) continue;
        number = strtoull(line + n, &end, 10);
        found = end != line + n;
    }
    fclose(file);
    if (found) *value = number;
    return found;
}

/* Bytes that this process may still take, or UINT64_MAX where nobody says. */
static uint64_t available_memory(void)
{
    uint64_t free_ram = 0, swap = 0, most = 0, used = 0;
    if (!read_number("/proc/meminfo", "MemAvailable:", &free_ram)) return UINT64_MAX;
    read_number("/proc/meminfo", "SwapFree:", &swap);
    uint64_t available = 1024 * (free_ram + swap);
    if (read_number("/sys/fs/cgroup/memory.max", "", &most) &&
        read_number("/sys/fs/cgroup/memory.current", "", &used)) {
        const uint64_t left = most > used ? most - used : 0;
        if (left < available) available = left;
    }
    return available;
}

/* n triangles of that kind; single: less is needed in single precision. */
static int refuse(dmk_context *ctx, const char *where, int64_t n, const char *kind, bool single,
                  uint64_t needed, uint64_t there)
{
    return dmk_fail(
        ctx, DMK_E_NOMEM,
        "%lld triangles%s need about %.1f GB of memory on the %s, and %.1f GB are available; "
        "use a coarser mesh, more memory%s",
        (long long)n, kind, 1e-9 * (double)needed, where, 1e-9 * (double)there,
        single ? ", or single precision" : "");
}

int dmk_memory_check(dmk_context *ctx, const dmk_device *device, int64_t n_triangles)
{
    dmk_memory m;
    dmk_device_info info;
    dmk_device_get_info(device, &info);
    dmk_solve_memory((size_t)n_triangles, dmk_device_real(device, DMK_OUTER) == sizeof(float), &m);
    /* The mesh and the drivers have theirs already. */
    uint64_t taken = FIXED_HOST + (uint64_t)n_triangles * PER_TRIANGLE_MESH,
             available = available_memory();
    uint64_t host = m.host > taken ? m.host - taken : 0;
    const bool same = strcmp(info.type, "CPU") == 0;
    if (!same && info.memory > 0 && m.device > info.memory) {
        return refuse(ctx, "device", n_triangles, "", true, m.device, info.memory);
    }
    if (same) host += m.device;
    if (host <= available) return DMK_OK;
    return refuse(ctx, "host", n_triangles, "", false, host, available);
}

int dmk_memory_check_needles(dmk_context *ctx, int64_t n_triangles)
{
    const uint64_t needed = (uint64_t)n_triangles * DMK_FINE_GRAPH_BYTES,
                   available = available_memory();
    if (needed <= available) return DMK_OK;
    return refuse(ctx, "host", n_triangles, ", many of them needles,", true, needed, available);
}
