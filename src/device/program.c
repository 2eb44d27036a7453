/* The two programs: options, build, build log. */
#include "device/internal.h"

#include "dmk_shared.h"

#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __x86_64__
#include <cpuid.h>
#endif

extern const char *const dmk_kernel_lines[];
extern const size_t dmk_kernel_n_lines;

/* Whether the processor gathers by one instruction at least as fast as by as many loads: a step takes 0.92 of the time
 * on Intel's from Sapphire Rapids on, which are known by their 16-bit floats. Microcode slows the gathers of those
 * before, and AMD's are slow (Zen 5: 1.16 of a solve). */
static bool gathers_fast(void)
{
#ifdef __x86_64__
    unsigned a, b, c, d;
    return __get_cpuid_count(7, 0, &a, &b, &c, &d) && (d >> 23 & 1);
#else
    return false;
#endif
}

/* -w: for processors without AVX-512 PoCL's compiler counts on stderr some 300 vectors of 8 that "change the ABI" of
 * functions that are in line. What it could say of the kernels themselves clang says in tests/test_layers.sh. */
static void build_options(const dmk_device *dev, dmk_program program, char *text, size_t size)
{
    int real_double = dmk_device_real(dev, program) == sizeof(double);
    snprintf(text, size,
             "-cl-std=CL1.2 -w -DDMK_CPU=%d -DDMK_CHUNK=%d -DDMK_DOUBLE=%d -DDMK_FP64=%d "
             "-DDMK_POCL=%d -DDMK_GATHERS=%d -DDMK_LONE_GROUP=%d",
             dev->cpu_shape, (int)dev->chunk, real_double, dev->double_precision, dev->pocl,
             dev->pocl && dev->cpu_shape && gathers_fast(), (int)dev->lone_group);
}

/* The build log goes into the message whole, as far as it fits. */
static int build_failure(dmk_context *ctx, dmk_device *dev, cl_program program, cl_int error)
{
    char log[800] = "";
    size_t size = 0;
    clGetProgramBuildInfo(program, dev->id, CL_PROGRAM_BUILD_LOG, 0, NULL, &size);
    char *whole = size ? calloc(size + 1, 1) : NULL;
    if (whole) {
        clGetProgramBuildInfo(program, dev->id, CL_PROGRAM_BUILD_LOG, size, whole, NULL);
        const char *first = strstr(whole, "error:");
        while (first && first > whole && first[-1] != '\n') first--;
        snprintf(log, sizeof log, "%s", first ? first : whole);
        free(whole);
    }
    return dmk_fail(ctx, DMK_E_BUILD, "%s (%d) for %s; the build log says: %s%s",
                    dmk_cl_text(error), error, dev->info.name, log, dmk_space_hint());
}

static int take_source(dmk_context *ctx, dmk_device *dev, cl_program *program)
{
    cl_int error;
    *program = clCreateProgramWithSource(dev->cl, (cl_uint)dmk_kernel_n_lines,
                                         (const char **)(uintptr_t)dmk_kernel_lines, NULL, &error);
    return dmk_cl_check(ctx, error, "clCreateProgramWithSource");
}

static int build_from_source(dmk_context *ctx, dmk_device *dev, const char *options,
                             cl_program *program)
{
    int rc;
    cl_int error;
    cl_program p = NULL;
    DMK_TRY(take_source(ctx, dev, &p));
    error = clBuildProgram(p, 1, &dev->id, options, NULL, NULL);
    if (error != CL_SUCCESS) {
        rc = build_failure(ctx, dev, p, error);
        goto done;
    }
    *program = p;
    p = NULL;
done:
    if (p) clReleaseProgram(p);
    return rc;
}

/* PoCL keeps every compiled kernel in a cache of its own, but finds the program there by its source as its compiler
 * has read it, 35 ms each; by its bitcode in 7 ms. That must be the bitcode before linking, for PoCL links what it is
 * given, and would have the variables of the built-in functions twice. (Asking for the binary of a linked program
 * makes it compile all kernels in general forms first: 12 s instead of 5.5 s at the first run.) */
static void keep_object(dmk_context *ctx, dmk_device *dev, const char *options)
{
    cl_program p = NULL;
    if (take_source(ctx, dev, &p) == DMK_OK &&
        clCompileProgram(p, 1, &dev->id, options, 0, NULL, NULL, NULL, NULL) == CL_SUCCESS)
        dmk_cache_store(dev, options, p);
    if (p) clReleaseProgram(p);
}

static int build_one(dmk_context *ctx, dmk_device *dev, const char *options, cl_program *program)
{
    if (dmk_cache_load(dev, options, program) == DMK_OK) return DMK_OK;
    if (dev->pocl && dev->cache[0]) {
        keep_object(ctx, dev, options);
        if (dmk_cache_load(dev, options, program) == DMK_OK) return DMK_OK;
    }
    int rc = build_from_source(ctx, dev, options, program);
    if (rc == DMK_OK && !dev->pocl) dmk_cache_store(dev, options, *program);
    return rc;
}

int dmk_programs_build(dmk_context *ctx, dmk_device *dev)
{
    int rc;
    char inner[256], outer[256];
    build_options(dev, DMK_INNER, inner, sizeof inner);
    build_options(dev, DMK_OUTER, outer, sizeof outer);
    DMK_TRY(build_one(ctx, dev, inner, &dev->program[DMK_INNER]));
    if (strcmp(inner, outer) == 0)
        dev->program[DMK_OUTER] = dev->program[DMK_INNER];
    else
        rc = build_one(ctx, dev, outer, &dev->program[DMK_OUTER]);
done:
    return rc;
}

static atomic_int n_opening;

void dmk_opening(int change)
{
    atomic_fetch_add(&n_opening, change);
}

int dmk_devices_opening(void)
{
    return atomic_load(&n_opening);
}

static void *build_beside(void *data)
{
    dmk_device *dev = data;
    dmk_building *b = &dev->building;
    b->rc = dmk_programs_build(&b->record, dev);
    dmk_opening(-1);
    return NULL;
}

/* Without a thread it is done at once. */
void dmk_programs_begin(dmk_device *dev)
{
    dmk_opening(1);
    dev->building.begun = pthread_create(&dev->building.thread, NULL, build_beside, dev) == 0;
    if (!dev->building.begun) build_beside(dev);
}

int dmk_programs_wait(dmk_context *ctx, dmk_device *dev)
{
    dmk_building *b = &dev->building;
    if (b->begun) pthread_join(b->thread, NULL);
    b->begun = false;
    if (b->rc == DMK_OK || !ctx) return b->rc;
    return dmk_fail(ctx, b->rc, "%s", b->record.message);
}
