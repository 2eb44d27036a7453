/* Finding, opening and closing OpenCL devices. */
#include "device/internal.h"

#include "dmk_shared.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>
#include <unistd.h>

/* The process that first asked for OpenCL, or 0; less than 0 as long as it does; kept for the whole
 * process. Drivers start threads of their own and keep their locks; in a child that was forked then, they wait for
 * ever. And PoCL 3.1 hands out devices that are not ready while another thread's first call makes them. */
static _Atomic pid_t opencl_process;

/* *first: no other thread has asked; the others wait until opencl_process is the process. */
static int claim_opencl(dmk_context *ctx, bool *first)
{
    const struct timespec step = {.tv_nsec = 1000000};
    const pid_t own = getpid();
    pid_t seen = 0;
    *first = atomic_compare_exchange_strong(&opencl_process, &seen, -own);
    if (!*first && seen != own && seen != -own) {
        return dmk_fail(ctx, DMK_E_DEVICE,
                        "OpenCL was used in process %ld before it forked this one, %ld: OpenCL "
                        "drivers do not support that; fork first, then open devices",
                        labs((long)seen), (long)own);
    }
    while (!*first && atomic_load(&opencl_process) == -own) nanosleep(&step, NULL);
    return DMK_OK;
}

enum { MAX_PLATFORMS = 16, MAX_DEVICES = 64 };

typedef struct found {
    cl_platform_id platform;
    cl_device_id id;
} found;

static void device_text(cl_device_id id, cl_device_info what, char *text, size_t size)
{
    text[0] = 0;
    char long_text[1024] = "";
    if (clGetDeviceInfo(id, what, sizeof long_text - 1, long_text, NULL) == CL_SUCCESS) {
        snprintf(text, size, "%.*s", (int)size - 1, long_text);
    }
}

static void describe(const found *f, dmk_device_info *info)
{
    cl_device_type type = 0;
    cl_uint units = 0;
    cl_ulong memory = 0;
    cl_device_fp_config fp64 = 0;
    memset(info, 0, sizeof *info);
    device_text(f->id, CL_DEVICE_NAME, info->name, sizeof info->name);
    device_text(f->id, CL_DRIVER_VERSION, info->driver, sizeof info->driver);
    clGetPlatformInfo(f->platform, CL_PLATFORM_NAME, sizeof info->platform - 1, info->platform,
                      NULL);
    clGetDeviceInfo(f->id, CL_DEVICE_TYPE, sizeof type, &type, NULL);
    clGetDeviceInfo(f->id, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL);
    clGetDeviceInfo(f->id, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL);
    clGetDeviceInfo(f->id, CL_DEVICE_DOUBLE_FP_CONFIG, sizeof fp64, &fp64, NULL);
    snprintf(info->type, sizeof info->type, "%s",
             type & CL_DEVICE_TYPE_CPU   ? "CPU"
             : type & CL_DEVICE_TYPE_GPU ? "GPU"
                                         : "accelerator");
    info->compute_units = (int)units;
    info->memory = memory;
    info->fp64 = fp64 != 0;
}

static bool is_pocl(const char *platform)
{
    return strcmp(platform, "Portable Computing Language") == 0;
}

/* More than any machine's processors; systems let a user have some 30,000 threads. */
enum { MOST_THREADS = 4096 };

/* PoCL ends the whole program, or crashes, where it is started like this. */
static int check_pocl(dmk_context *ctx)
{
    const char *threads = getenv("POCL_MAX_PTHREAD_COUNT");
    const long n = threads ? strtol(threads, NULL, 10) : 1;
    if (n < 0 || n > MOST_THREADS) {
        return dmk_fail(
            ctx, DMK_E_DEVICE,
            "PoCL crashes with POCL_MAX_PTHREAD_COUNT=%.60s; set it to a number from 1 to %d",
            threads, (int)MOST_THREADS);
    }
    if (access("/sys/devices/system/cpu", F_OK) != 0) {
        return dmk_fail(ctx, DMK_E_DEVICE,
                        "PoCL does not start without /sys/devices/system/cpu: mount /sys here");
    }
    return DMK_OK;
}

static int name_platform(cl_platform_id platform, char name[128])
{
    memset(name, 0, 128);
    return clGetPlatformInfo(platform, CL_PLATFORM_NAME, 127, name, NULL) == CL_SUCCESS;
}

/* "; try without NAME=VALUE" for what is set of the variables that choose drivers and devices. */
static void hint_at_steering(char hint[400])
{
    static const char *const steer[] = {"POCL_DEVICES", "OCL_ICD_VENDORS", "OPENCL_VENDOR_PATH",
                                        "LP_PLATFORM",  "HWLOC_XMLFILE",   "HWLOC_SYNTHETIC"};
    hint[0] = 0;
    for (size_t i = 0; i < sizeof steer / sizeof *steer; i++) {
        const char *value = getenv(steer[i]);
        size_t used = strlen(hint);
        if (value) snprintf(hint + used, 400 - used, "; try without %s=%.60s", steer[i], value);
    }
}

/* The reason, as far as it is known. */
static int no_device(dmk_context *ctx, const cl_platform_id *platforms, cl_uint n)
{
    char name[128] = "", hint[400];
    for (cl_uint p = 0; p < n; p++) {
        int rc =
            name_platform(platforms[p], name) && is_pocl(name) ? dmk_cache_check_pocl(ctx) : DMK_OK;
        if (rc != DMK_OK) return rc;
    }
    hint_at_steering(hint);
    return dmk_fail(ctx, DMK_E_DEVICE, "%u OpenCL platform%s (%s), but no device%s", n,
                    n == 1 ? "" : "s", name, hint);
}

static int no_platform(dmk_context *ctx, cl_int error)
{
    char hint[400];
    hint_at_steering(hint);
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "no OpenCL platform (%s); install one, for instance the package "
                    "pocl-opencl-icd%s%s",
                    dmk_cl_text(error), hint, dmk_space_hint());
}

/* All devices of all platforms, in the order the loader gives them. */
static int ask_all(dmk_context *ctx, found *all, size_t *count)
{
    cl_platform_id platforms[MAX_PLATFORMS];
    cl_uint n_platforms = 0;
    int rc = DMK_OK;
    cl_int error = clGetPlatformIDs(MAX_PLATFORMS, platforms, &n_platforms);
    if (error != CL_SUCCESS || n_platforms == 0) return no_platform(ctx, error);
    if (n_platforms > MAX_PLATFORMS) n_platforms = MAX_PLATFORMS;
    for (cl_uint p = 0; p < n_platforms; p++) {
        cl_device_id ids[MAX_DEVICES];
        cl_uint n = 0;
        char name[128];
        if (name_platform(platforms[p], name) && is_pocl(name) && check_pocl(ctx) != DMK_OK) {
            rc = DMK_E_DEVICE; /* unless there is another device */
            continue;
        }
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, MAX_DEVICES, ids, &n) != CL_SUCCESS) {
            continue;
        }
        for (cl_uint i = 0; i < n && i < MAX_DEVICES && *count < MAX_DEVICES; i++) {
            all[(*count)++] = (found){platforms[p], ids[i]};
        }
    }
    if (*count == 0) return rc != DMK_OK ? rc : no_device(ctx, platforms, n_platforms);
    return DMK_OK;
}

static int find_all(dmk_context *ctx, found *all, size_t *count)
{
    bool first;
    *count = 0;
    int rc = claim_opencl(ctx, &first);
    if (rc == DMK_OK) rc = ask_all(ctx, all, count);
    if (first) atomic_store(&opencl_process, getpid());
    return rc;
}

int dmk_device_list(dmk_context *ctx, dmk_device_info *infos, size_t capacity, size_t *count)
{
    found all[MAX_DEVICES];
    size_t n;
    if (dmk_missing(ctx, "count", count, "infos", capacity ? (void *)infos : count))
        return DMK_E_ARG;
    dmk_opening(1);
    int rc = find_all(ctx, all, &n);
    dmk_opening(-1);
    if (rc != DMK_OK) return rc;
    for (size_t i = 0; i < n && i < capacity; i++) describe(&all[i], &infos[i]);
    *count = n;
    return DMK_OK;
}

static int rank_of(const dmk_device_info *info)
{
    return strcmp(info->type, "GPU") == 0 ? 2 : strcmp(info->type, "CPU") == 0 ? 1 : 0;
}

size_t dmk_device_best(const dmk_device_info *infos, size_t n, const char *type)
{
    size_t best = n;
    for (size_t i = 0; i < n; i++) {
        if (type && strcasecmp(infos[i].type, type) != 0) continue;
        const dmk_device_info *a = &infos[i], *b = best < n ? &infos[best] : NULL;
        bool better = !b;
        if (b && a->fp64 != b->fp64)
            better = a->fp64 > b->fp64;
        else if (b && rank_of(a) != rank_of(b))
            better = rank_of(a) > rank_of(b);
        else if (b)
            better = a->compute_units > b->compute_units;
        if (better) best = i;
    }
    return best;
}

/* The best of all devices, or of a type. */
static int choose_best(dmk_context *ctx, const char *type, const found *all, size_t n,
                       size_t *chosen)
{
    dmk_device_info infos[MAX_DEVICES] = {{.fp64 = 0}};
    for (size_t i = 0; i < n; i++) describe(&all[i], &infos[i]);
    *chosen = dmk_device_best(infos, n, type);
    if (*chosen < n) return DMK_OK;
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "no OpenCL device is a %s; the list of devices shows those available", type);
}

static int choose(dmk_context *ctx, const char *select, const found *all, size_t n, size_t *chosen)
{
    if (!select) return choose_best(ctx, NULL, all, n, chosen);
    if (!*select)
        return dmk_fail(ctx, DMK_E_ARG, "device: '' is no number of a device, nor part of a name");
    if (strcasecmp(select, "cpu") == 0) return choose_best(ctx, "CPU", all, n, chosen);
    if (strcasecmp(select, "gpu") == 0) return choose_best(ctx, "GPU", all, n, chosen);
    char *end;
    const unsigned long number = strtoul(select, &end, 10);
    const bool is_number = *end == 0;
    if (is_number && number < n) {
        *chosen = number;
        return DMK_OK;
    }
    for (size_t i = 0; i < n; i++) {
        dmk_device_info info;
        describe(&all[i], &info);
        if (strcasestr(info.name, select) || strcasestr(info.platform, select)) {
            *chosen = i;
            return DMK_OK;
        }
    }
    if (is_number) {
        if (n == 1)
            return dmk_fail(ctx, DMK_E_DEVICE, "no device %s: there is one, number 0", select);
        return dmk_fail(ctx, DMK_E_DEVICE, "no device %s: there are %zu, numbered from 0", select,
                        n);
    }
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "no OpenCL device or platform has '%s' in its name; the list of devices shows "
                    "those available",
                    select);
}

/* A sub-device of `threads` compute units, where fewer than all are wanted. */
static int take_units(dmk_context *ctx, dmk_device *dev, int threads)
{
    if (threads <= 0 || threads >= dev->info.compute_units) return DMK_OK;
    if (strcmp(dev->info.type, "CPU") != 0) return DMK_OK; /* they are the host's only */
    cl_device_partition_property by_counts[] = {CL_DEVICE_PARTITION_BY_COUNTS, threads,
                                                CL_DEVICE_PARTITION_BY_COUNTS_LIST_END, 0};
    cl_device_id sub;
    cl_int error = clCreateSubDevices(dev->id, by_counts, 1, &sub, NULL);
    if (error != CL_SUCCESS) {
        return dmk_fail(ctx, DMK_E_DEVICE, "%s (%d): this device cannot be limited to %d threads",
                        dmk_cl_text(error), error, threads);
    }
    dev->id = sub;
    dev->is_sub_device = 1;
    dev->info.compute_units = threads;
    return DMK_OK;
}

/* Blocks of 8 elements per work-item on a CPU: what one work-item streams (about 64 bytes an element)
 * should fit the first-level cache, and a reduction leaves one partial sum per work-item. */
static size_t cpu_chunk(dmk_context *ctx)
{
    dmk_machine_info machine;
    if (dmk_machine_get_info(ctx, &machine) != DMK_OK || machine.l1 == 0) return 64;
    size_t chunk = machine.l1 / (8 * 64);
    return chunk < 16 ? 16 : chunk > 256 ? 256 : chunk;
}

/* A kernel that one work-group does waits for memory most of the time: with 1,024 work-items for 256 it takes 0.30 of
 * the time on a large GPU (H200). */
static size_t lone_group(const dmk_device *dev)
{
    const size_t wanted = 4 * (size_t)DMK_GROUP;
    size_t most = 0;
    clGetDeviceInfo(dev->id, CL_DEVICE_MAX_WORK_GROUP_SIZE, sizeof most, &most, NULL);
    return most >= wanted ? wanted : DMK_GROUP;
}

static const dmk_device_options defaults = {.struct_size = sizeof defaults};

void dmk_device_options_init(dmk_device_options *options, size_t size)
{
    dmk_options_fill(options, size, &defaults, sizeof defaults);
}

static int check_options(dmk_context *ctx, const dmk_device_options *o)
{
    if (o->threads < 0)
        return dmk_fail(ctx, DMK_E_ARG, "threads = %d: expected 0 or more", o->threads);
    if ((int)o->shape < DMK_SHAPE_AUTO || o->shape > DMK_SHAPE_GPU) {
        return dmk_fail(ctx, DMK_E_ARG, "shape = %d: expected a dmk_shape", (int)o->shape);
    }
    return DMK_OK;
}

static int open_device(dmk_context *ctx, const dmk_device_options *options, dmk_device **device)
{
    int rc;
    cl_int error;
    found all[MAX_DEVICES];
    size_t n, chosen;
    dmk_device *dev = NULL;
    dmk_device_options chosen_options = defaults, *o = &chosen_options;
    if (dmk_missing(ctx, "device", device)) return DMK_E_ARG;
    DMK_TRY(dmk_options_take(ctx, "dmk_device_options", options, o, sizeof *o));
    DMK_TRY(check_options(ctx, o));
    DMK_TRY(DMK_NEW(ctx, dev, 1));
    dev->owner = getpid();
    DMK_TRY(find_all(ctx, all, &n));
    DMK_TRY(choose(ctx, o->select, all, n, &chosen));
    describe(&all[chosen], &dev->info);
    dev->platform = all[chosen].platform;
    dev->id = all[chosen].id;
    DMK_TRY(take_units(ctx, dev, o->threads));
    dev->double_precision = dev->info.fp64 && !o->single_precision;
    dev->cpu_shape = o->shape ? o->shape == DMK_SHAPE_CPU : strcmp(dev->info.type, "CPU") == 0;
    dev->chunk = cpu_chunk(ctx);
    dev->lone_group = lone_group(dev);
    DMK_TRY(dmk_cache_folder(ctx, o->cache, dev->cache, sizeof dev->cache));
    dev->pocl = is_pocl(dev->info.platform);
    if (dev->pocl) DMK_TRY(dmk_cache_check_pocl(ctx));
    dev->cl = clCreateContext(NULL, 1, &dev->id, NULL, NULL, &error);
    DMK_TRY(dmk_cl_check(ctx, error, "clCreateContext"));
    dev->queue = clCreateCommandQueue(dev->cl, dev->id, 0, &error);
    DMK_TRY(dmk_cl_check(ctx, error, "clCreateCommandQueue"));
    if (o->in_background)
        dmk_programs_begin(dev);
    else
        DMK_TRY(dmk_programs_build(ctx, dev));
    DMK_TRY(dmk_buffer_create(ctx, dev,
                              (size_t)dev->info.compute_units * (DMK_LINE + 1) * sizeof(cl_int),
                              NULL, &dev->shares));
    *device = dev;
    dev = NULL;
done:
    dmk_device_destroy(&dev);
    return rc;
}

int dmk_device_open(dmk_context *ctx, const dmk_device_options *options, dmk_device **device)
{
    dmk_opening(1);
    const int rc = open_device(ctx, options, device);
    dmk_opening(-1);
    return rc;
}

void dmk_device_get_info(const dmk_device *device, dmk_device_info *info)
{
    if (info) *info = device ? device->info : (dmk_device_info){0};
}

int dmk_device_owned(dmk_context *ctx, const dmk_device *device)
{
    if (device->owner == getpid()) return DMK_OK;
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "the device was opened by process %ld, of which this one, %ld, is a forked "
                    "child: open devices after forking, in each process its own",
                    (long)device->owner, (long)getpid());
}

/* After clFinish threads of PoCL still release the events of what they have done, looking at the queue's device,
 * and neither the queue nor the context keeps a part of a device: it can go when no event holds the queue any more.
 * Another driver may hold the queue itself: after a second (in steps of 0.1 ms) that is taken to be so. */
static void wait_for_events(const dmk_device *dev)
{
    const struct timespec step = {.tv_nsec = 100000};
    cl_uint holders = 2;
    for (int i = 0; i < 10000 && holders > 1; i++) {
        if (clGetCommandQueueInfo(dev->queue, CL_QUEUE_REFERENCE_COUNT, sizeof holders, &holders,
                                  NULL) != CL_SUCCESS)
            return;
        if (holders > 1) nanosleep(&step, NULL);
    }
}

void dmk_device_destroy(dmk_device **device)
{
    dmk_device *dev = device ? *device : NULL;
    if (!dev) return;
    *device = NULL;
    if (dev->owner != getpid()) { /* the driver would wait for threads that only its process has */
        free(dev);
        return;
    }
    dmk_programs_wait(NULL, dev);
    if (dev->queue) clFinish(dev->queue); /* after an error there may be work under way */
    dmk_buffer_destroy(&dev->shares);     /* which keeps the last event that wrote to it */
    if (dev->queue && dev->is_sub_device) wait_for_events(dev);
    for (int i = 0; i < dev->n_kernels; i++) clReleaseKernel(dev->kernel[i].cl);
    const cl_program inner = dev->program[DMK_INNER], outer = dev->program[DMK_OUTER];
    if (inner) clReleaseProgram(inner);
    if (outer && outer != inner) clReleaseProgram(outer);
    if (dev->queue) clReleaseCommandQueue(dev->queue);
    if (dev->cl) clReleaseContext(dev->cl);
    if (dev->is_sub_device) clReleaseDevice(dev->id);
    free(dev);
}
