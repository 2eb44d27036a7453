/* Kernels by name, and their launches in the two work shapes. */
#include "device/internal.h"

#include "dmk_shared.h"

#include <string.h>

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
    cl_int error;
    cl_kernel cl = clCreateKernel(dev->program[program], name, &error);
    if (error != CL_SUCCESS) {
        return dmk_fail(ctx, DMK_E_BUILD, "%s (%d): no kernel '%s'", dmk_cl_text(error), error,
                        name);
    }
    dev->kernel[dev->n_kernels] = (dmk_kernel){cl, program, name};
    *kernel = &dev->kernel[dev->n_kernels++];
    return DMK_OK;
}

size_t dmk_launch_groups(const dmk_device *dev, size_t items)
{
    size_t per_group = dev->cpu_shape ? dev->chunk * DMK_WIDTH : DMK_GROUP;
    size_t groups = (items + per_group - 1) / per_group;
    return groups > 0 ? groups : 1;
}

int dmk_launch(dmk_context *ctx, dmk_device *dev, const dmk_kernel *kernel, size_t items,
               size_t n_args, const dmk_arg *args)
{
    for (size_t i = 0; i < n_args; i++) {
        cl_int error = args[i].bytes
                           ? clSetKernelArg(kernel->cl, (cl_uint)i, args[i].bytes, args[i].value)
                           : clSetKernelArg(kernel->cl, (cl_uint)i, sizeof(cl_mem), &args[i].value);
        if (error != CL_SUCCESS) {
            return dmk_fail(ctx, DMK_E_DEVICE, "%s (%d) from argument %zu of kernel %s",
                            dmk_cl_text(error), error, i, kernel->name);
        }
    }
    size_t local = dev->cpu_shape ? 1 : DMK_GROUP;
    size_t global = dmk_launch_groups(dev, items) * local;
    cl_int error =
        clEnqueueNDRangeKernel(dev->queue, kernel->cl, 1, NULL, &global, &local, 0, NULL, NULL);
    if (error == CL_SUCCESS) return DMK_OK;
    return dmk_fail(ctx, DMK_E_DEVICE, "%s (%d) from kernel %s over %zu items", dmk_cl_text(error),
                    error, kernel->name, items);
}
