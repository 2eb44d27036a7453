/* The OpenCL device: choice, programs and their cache, buffers, launches. The only room that sees
 * CL/cl.h; above it a device is opaque and work is queued in order on its one queue. */
#ifndef DMK_DEVICE_H
#define DMK_DEVICE_H

#include "base/base.h"

/* Kernels come in two programs made from the same source: the inner one works in single precision
 * (preconditioner, Newton's inner solves), the outer one in the precision of the result. */
typedef enum dmk_program { DMK_INNER = 0, DMK_OUTER = 1, DMK_N_PROGRAMS } dmk_program;

/* The best of n devices, of a type ("GPU") or of any (NULL): first those with double precision, without
 * which results are less accurate, then GPUs, CPUs and others, then by compute units, then the first. n if
 * there is none. */
size_t dmk_device_best(const dmk_device_info *infos, size_t n, const char *type);

typedef struct dmk_buffer dmk_buffer; /* device memory */
typedef struct dmk_kernel dmk_kernel;

/* Bytes of one number of the program's working type: 4, or 8 for a double-precision outer one. */
size_t dmk_device_real(const dmk_device *device, dmk_program program);

/* Work-items of the CPU shape run over blocks of items, those of the GPU shape are one each. */
bool dmk_device_cpu_shape(const dmk_device *device);

/* Drivers' threads do not live on in a forked child: there an open device is refused. */
int dmk_device_owned(dmk_context *context, const dmk_device *device);

/* Zeroed if `init` is NULL, and `bytes` then a multiple of 4, else a copy of it. */
int dmk_buffer_create(dmk_context *context, dmk_device *device, size_t bytes, const void *init,
                      dmk_buffer **buffer);
/* n numbers of the program's working type, all 0. */
int dmk_buffer_create_real(dmk_context *context, dmk_device *device, dmk_program program, size_t n,
                           dmk_buffer **buffer);
void dmk_buffer_destroy(dmk_buffer **buffer);
/* Move n buffers into a new one: each becomes a part of it, from the byte offset[i] on. */
int dmk_buffer_gather(dmk_context *context, dmk_device *device, size_t n,
                      dmk_buffer **const *buffers, size_t *offset, dmk_buffer **whole);
/* Queue the filling of a buffer's first `bytes` with 0. */
int dmk_buffer_clear(dmk_context *context, dmk_device *device, dmk_buffer *buffer, size_t bytes);
/* Queue: its first n numbers of the program's working type become `value`. */
int dmk_buffer_fill_real(dmk_context *context, dmk_device *device, dmk_program program,
                         dmk_buffer *buffer, size_t n, double value);
/* Blocking: all queued work is done when these return. */
int dmk_buffer_write(dmk_context *context, dmk_device *device, dmk_buffer *buffer, size_t offset,
                     size_t bytes, const void *from);
int dmk_buffer_read(dmk_context *context, dmk_device *device, const dmk_buffer *buffer,
                    size_t offset, size_t bytes, void *to);
/* n numbers of the program's working type from offset 0, given and taken as double. */
int dmk_buffer_write_real(dmk_context *context, dmk_device *device, dmk_program program,
                          dmk_buffer *buffer, size_t n, const double *from);
int dmk_buffer_read_real(dmk_context *context, dmk_device *device, dmk_program program,
                         const dmk_buffer *buffer, size_t n, double *to);

/* The first n numbers of the outer program's working type where they lie, to read and to write, until they are
 * unmapped; kernels must leave the buffer alone meanwhile. *numbers = NULL, and nothing to unmap, where that would
 * take memory of its own: on a device other than a CPU, and where they are not double. Blocking. */
int dmk_buffer_map(dmk_context *context, dmk_device *device, dmk_buffer *buffer, size_t n,
                   double **numbers);
void dmk_buffer_unmap(dmk_device *device, dmk_buffer *buffer, double *numbers);

/* The kernel `name` of a program. Kernels live as long as the device. */
int dmk_kernel_get(dmk_context *context, dmk_device *device, dmk_program program, const char *name,
                   dmk_kernel **kernel);

/* One kernel argument: a buffer, or `bytes` of a value. */
typedef struct dmk_arg {
    size_t bytes; /* 0: `value` is a const dmk_buffer* */
    const void *value;
} dmk_arg;
#define DMK_BUF(buffer) ((dmk_arg){0, (buffer)})
#define DMK_INT(x) ((dmk_arg){sizeof(int32_t), &(const int32_t){(int32_t)(x)}})
#define DMK_FLOAT(x) ((dmk_arg){sizeof(float), &(const float){(float)(x)}})
#define DMK_FLOAT8(x) ((dmk_arg){8 * sizeof(float), (x)})

/* What a launch goes over: `items` items in one range, or in two, the first of `first` items, that
 * follow the mesh each by itself (midpoints, then vertices): on a CPU a thread's share is then a piece of
 * both. */
typedef struct dmk_range {
    size_t items, first;     /* first: 0 for one range */
    const dmk_buffer *parts; /* n_parts numbers of parts, which alone are done; NULL: all of them */
    size_t n_parts;
} dmk_range;

/* What was asked of the device so far, for benchmarks and tests. */
typedef struct dmk_device_work {
    int64_t launches, reads, writes; /* reads and writes are those that block */
} dmk_device_work;
dmk_device_work dmk_device_get_work(const dmk_device *device);

/* Queue a kernel over a range; kernels see items in blocks of DMK_WIDTH. */
int dmk_launch(dmk_context *context, dmk_device *device, const dmk_kernel *kernel, dmk_range range,
               size_t n_args, const dmk_arg *args);
#define DMK_LAUNCH(context, device, kernel, range, ...)                                            \
    dmk_launch((context), (device), (kernel), (range),                                             \
               sizeof((dmk_arg[]){__VA_ARGS__}) / sizeof(dmk_arg), (dmk_arg[]){__VA_ARGS__})
/* Begin what is queued, without waiting for it. */
int dmk_device_flush(dmk_context *context, dmk_device *device);
/* Parts of a launch over `items` items: the number of partial sums a reduction leaves. */
size_t dmk_launch_parts(const dmk_device *device, size_t items);
/* Items of each part but the last. */
size_t dmk_launch_part(const dmk_device *device);

#endif
