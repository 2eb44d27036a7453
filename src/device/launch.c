/* Kernels by name, and their launches in the two work shapes. */
#include "device/internal.h"

#include "dmk_shared.h"

#include <stdio.h>
#include <string.h>

enum { FLUSH_EVERY = 16 };

dmk_device_work dmk_device_get_work(const dmk_device *dev)
{
    return dev->work;
}

int dmk_kernel_get(dmk_context *ctx, dmk_device *dev, dmk_program program, const char *name,
                   dmk_kernel **kernel)
{
    for (int i = 0; i < dev->n_kernels; i++) {
        if (dev->kernel[i].program == program && strcmp(dev->kernel[i].name, name) == 0) {
            *kernel = &dev->kernel[i];
            return DMK_OK;
        }
    }
    if (dev->n_kernels == DMK_MAX_KERNELS) {
        return dmk_fail(ctx, DMK_E_DEVICE, "more than %d kernels", DMK_MAX_KERNELS);
    }
    int rc = dmk_programs_wait(ctx, dev);
    if (rc != DMK_OK) return rc;
    cl_int error;
    cl_kernel cl = clCreateKernel(dev->program[program], name, &error);
    if (error != CL_SUCCESS) {
        return dmk_fail(ctx, DMK_E_BUILD, "%s (%d): no kernel '%s'", dmk_cl_text(error), error,
                        name);
    }
    size_t group[3];
    error = clGetKernelWorkGroupInfo(cl, dev->id, CL_KERNEL_COMPILE_WORK_GROUP_SIZE, sizeof group,
                                     group, NULL);
    if (error != CL_SUCCESS) {
        clReleaseKernel(cl);
        return dmk_cl_check(ctx, error, "clGetKernelWorkGroupInfo");
    }
    dev->kernel[dev->n_kernels] = (dmk_kernel){cl, program, name, group[0]};
    *kernel = &dev->kernel[dev->n_kernels++];
    return DMK_OK;
}

size_t dmk_launch_part(const dmk_device *dev)
{
    return dev->cpu_shape ? dev->chunk * DMK_WIDTH : DMK_GROUP;
}

size_t dmk_launch_parts(const dmk_device *dev, size_t items)
{
    size_t per_part = dmk_launch_part(dev);
    size_t parts = (items + per_part - 1) / per_part;
    return parts > 0 ? parts : 1;
}

static int launch_failed(dmk_context *ctx, cl_int error, const dmk_kernel *kernel, size_t items)
{
    char call[120];
    snprintf(call, sizeof call, "kernel %.60s over %zu items", kernel->name, items);
    return dmk_cl_check(ctx, error, call);
}

/* In the CPU shape some for each thread, as drivers may hand several to the thread that comes first, and always as
 * many: PoCL 3.1 loads a kernel anew for a launch that is wider than all before, and ends the process if three contexts
 * or more run it just then. */
size_t dmk_launch_groups(const dmk_device *dev, dmk_range range)
{
    if (dev->cpu_shape && range.items > 1) return 4 * (size_t)dev->info.compute_units;
    return range.parts ? range.n_parts : dmk_launch_parts(dev, range.items);
}

/* The last two arguments, the distribution of the work: see base.cl. */
static cl_int share_out(dmk_device *dev, const dmk_kernel *kernel, dmk_range range, cl_uint arg)
{
    const size_t most = 1 << 20; /* a word of `shares` counts to it */
    const size_t threads = (size_t)dev->info.compute_units;
    const size_t parts = dmk_launch_parts(dev, range.items);
    const bool shares = dev->cpu_shape && !range.parts && threads > 1 && parts >= 2 * threads &&
                        parts < most && threads < most / 1024;
    const dmk_buffer *table = range.parts ? range.parts : dev->shares;
    const size_t first = range.parts       ? range.n_parts
                         : range.first > 0 ? dmk_launch_parts(dev, range.first)
                                           : parts;
    if (shares) dev->tag = (dev->tag + 1) % 1023;
    cl_int4 launch = {{dev->tag,
                       range.parts ? -1
                       : shares    ? (cl_int)threads
                                   : 0,
                       (cl_int)first, (cl_int)parts}};
    cl_int error = clSetKernelArg(kernel->cl, arg, sizeof(cl_mem), &table);
    if (error != CL_SUCCESS) return error;
    return clSetKernelArg(kernel->cl, arg + 1, sizeof launch, &launch);
}

int dmk_device_flush(dmk_context *ctx, dmk_device *dev)
{
    return dmk_cl_check(ctx, clFlush(dev->queue), "clFlush");
}

int dmk_launch(dmk_context *ctx, dmk_device *dev, const dmk_kernel *kernel, dmk_range range,
               size_t n_args, const dmk_arg *args)
{
    for (size_t i = 0; i < n_args; i++) {
        cl_int error = args[i].bytes
                           ? clSetKernelArg(kernel->cl, (cl_uint)i, args[i].bytes, args[i].value)
                           : clSetKernelArg(kernel->cl, (cl_uint)i, sizeof(cl_mem), &args[i].value);
        if (error != CL_SUCCESS) {
            char call[120];
            snprintf(call, sizeof call, "argument %zu of kernel %.60s", i, kernel->name);
            return dmk_cl_check(ctx, error, call);
        }
    }
    const size_t local = kernel->group, global = dmk_launch_groups(dev, range) * local;
    cl_int error = share_out(dev, kernel, range, (cl_uint)n_args);
    if (error != CL_SUCCESS) return launch_failed(ctx, error, kernel, range.items);
    error = clEnqueueNDRangeKernel(dev->queue, kernel->cl, 1, NULL, &global, &local, 0, NULL, NULL);
    /* Drivers may keep what is queued until somebody waits; a device that is fed early idles less. */
    if (++dev->work.launches % FLUSH_EVERY == 0 && error == CL_SUCCESS) error = clFlush(dev->queue);
    return error == CL_SUCCESS ? DMK_OK : launch_failed(ctx, error, kernel, range.items);
}
