/* Device memory, as opaque buffers. */
#include "base/parallel.h"
#include "device/internal.h"

#include <stdlib.h>
#include <string.h>

/* A dmk_buffer* is a cl_mem in disguise. */
static cl_mem mem_of(const dmk_buffer *b)
{
    return (cl_mem)(uintptr_t)b;
}

bool dmk_device_cpu_shape(const dmk_device *dev)
{
    return dev->cpu_shape;
}

size_t dmk_device_real(const dmk_device *dev, dmk_program program)
{
    return program == DMK_OUTER && dev->double_precision ? sizeof(double) : sizeof(float);
}

static bool is_cpu(const dmk_device *dev)
{
    return strcmp(dev->info.type, "CPU") == 0;
}

static int map(dmk_context *ctx, dmk_device *dev, cl_mem mem, cl_map_flags how, size_t bytes,
               void **at)
{
    cl_int error;
    *at = clEnqueueMapBuffer(dev->queue, mem, CL_TRUE, how, 0, bytes, 0, NULL, NULL, &error);
    return dmk_cl_check(ctx, error, "clEnqueueMapBuffer");
}

typedef struct first_touch {
    char *to;
    const char *from; /* or NULL for zeros */
    size_t bytes;
    int threads;
} first_touch;

static int touch_piece(dmk_context *own, int32_t i, void *data)
{
    (void)own;
    const first_touch *w = data;
    const int64_t n = (int64_t)w->bytes, at = dmk_even_bound(n, i, w->threads);
    const size_t bytes = (size_t)(dmk_even_bound(n, i + 1, w->threads) - at);
    if (w->from)
        memcpy(w->to + at, w->from + at, bytes);
    else
        memset(w->to + at, 0, bytes);
    return DMK_OK;
}

/* A large buffer that is host memory, with what it is to hold: in huge pages, and each thread takes its part of them,
 * for what the system does with a page on its first use may be slow: virtual machines were seen to give 0.6 GB/s to one
 * thread and 1.6 to two. */
static int fill_first(dmk_context *ctx, dmk_device *dev, cl_mem mem, size_t bytes, const void *init)
{
    int rc;
    first_touch work = {.from = init, .bytes = bytes, .threads = dmk_parallel_threads(ctx)};
    void *at;
    DMK_TRY(map(ctx, dev, mem, CL_MAP_WRITE_INVALIDATE_REGION, bytes, &at));
    dmk_huge_pages(at, bytes);
    work.to = at;
    DMK_TRY(dmk_parallel_pieces(ctx, work.threads, touch_piece, &work));
    DMK_CL(clEnqueueUnmapMemObject(dev->queue, mem, at, 0, NULL, NULL));
done:
    return rc;
}

/* PoCL 3.1 takes a buffer's memory when it is first used, and ends the process if there is none: so it is asked for
 * here before, and given back. */
static int check_room(dmk_context *ctx, size_t bytes)
{
    char *room = NULL;
    const int rc = DMK_NEW_UNSET(ctx, room, bytes);
    free(room);
    return rc;
}

int dmk_buffer_create(dmk_context *ctx, dmk_device *dev, size_t bytes, const void *init,
                      dmk_buffer **buffer)
{
    int rc;
    cl_int error;
    if (bytes == 0) { /* there are no empty buffers */
        bytes = 8;
        init = NULL;
    }
    if (is_cpu(dev)) DMK_TRY(check_room(ctx, bytes));
    cl_mem mem = clCreateBuffer(dev->cl, CL_MEM_READ_WRITE, bytes, NULL, &error);
    DMK_TRY(dmk_cl_check(ctx, error, "clCreateBuffer"));
    *buffer = (dmk_buffer *)mem;
    if (bytes >= DMK_HUGE && is_cpu(dev))
        rc = fill_first(ctx, dev, mem, bytes, init);
    else if (init)
        DMK_CL(clEnqueueWriteBuffer(dev->queue, mem, CL_TRUE, 0, bytes, init, 0, NULL, NULL));
    else
        rc = dmk_buffer_clear(ctx, dev, *buffer, bytes);
done:
    return rc;
}

int dmk_buffer_create_real(dmk_context *ctx, dmk_device *dev, dmk_program program, size_t n,
                           dmk_buffer **buffer)
{
    return dmk_buffer_create(ctx, dev, n * dmk_device_real(dev, program), NULL, buffer);
}

static int fill(dmk_context *ctx, dmk_device *dev, dmk_buffer *buffer, size_t bytes,
                const void *pattern, size_t size)
{
    return dmk_cl_check(
        ctx,
        clEnqueueFillBuffer(dev->queue, mem_of(buffer), pattern, size, 0, bytes, 0, NULL, NULL),
        "clEnqueueFillBuffer");
}

int dmk_buffer_clear(dmk_context *ctx, dmk_device *dev, dmk_buffer *buffer, size_t bytes)
{
    const cl_uint zero = 0;
    return fill(ctx, dev, buffer, bytes, &zero, sizeof zero);
}

int dmk_buffer_fill_real(dmk_context *ctx, dmk_device *dev, dmk_program program, dmk_buffer *buffer,
                         size_t n, double value)
{
    const float narrow = (float)value;
    const size_t size = dmk_device_real(dev, program);
    const void *pattern = size == sizeof value ? (const void *)&value : &narrow;
    return fill(ctx, dev, buffer, n * size, pattern, size);
}

/* Where the parts of `whole` begin, a multiple of what the device asks for; their sum. */
static int lay_out(dmk_context *ctx, const dmk_device *dev, size_t n, dmk_buffer **const *buffers,
                   size_t *bytes, size_t *offset, size_t *sum)
{
    int rc;
    cl_uint bits = 0;
    DMK_CL(clGetDeviceInfo(dev->id, CL_DEVICE_MEM_BASE_ADDR_ALIGN, sizeof bits, &bits, NULL));
    const size_t align = bits >= 64 ? bits / 8 : 8;
    *sum = 0;
    for (size_t i = 0; i < n; i++) {
        DMK_CL(
            clGetMemObjectInfo(mem_of(*buffers[i]), CL_MEM_SIZE, sizeof bytes[i], &bytes[i], NULL));
        offset[i] = *sum;
        *sum += (bytes[i] + align - 1) / align * align;
    }
done:
    return rc;
}

int dmk_buffer_gather(dmk_context *ctx, dmk_device *dev, size_t n, dmk_buffer **const *buffers,
                      size_t *offset, dmk_buffer **whole)
{
    int rc;
    size_t sum, *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, n));
    DMK_TRY(lay_out(ctx, dev, n, buffers, bytes, offset, &sum));
    DMK_TRY(dmk_buffer_create(ctx, dev, sum, NULL, whole));
    for (size_t i = 0; i < n; i++) {
        cl_int error;
        const cl_buffer_region part = {offset[i], bytes[i]};
        cl_mem from = mem_of(*buffers[i]);
        DMK_CL(clEnqueueCopyBuffer(dev->queue, from, mem_of(*whole), 0, offset[i], bytes[i], 0,
                                   NULL, NULL));
        cl_mem to = clCreateSubBuffer(mem_of(*whole), CL_MEM_READ_WRITE,
                                      CL_BUFFER_CREATE_TYPE_REGION, &part, &error);
        DMK_TRY(dmk_cl_check(ctx, error, "clCreateSubBuffer"));
        clReleaseMemObject(from);
        *buffers[i] = (dmk_buffer *)to;
    }
done:
    free(bytes);
    return rc;
}

void dmk_buffer_destroy(dmk_buffer **buffer)
{
    if (*buffer) clReleaseMemObject(mem_of(*buffer));
    *buffer = NULL;
}

int dmk_buffer_write(dmk_context *ctx, dmk_device *dev, dmk_buffer *buffer, size_t offset,
                     size_t bytes, const void *from)
{
    if (bytes == 0) return DMK_OK; /* an error of OpenCL, which PoCL 3.1 does not tell */
    dev->work.writes++;
    return dmk_cl_check(ctx,
                        clEnqueueWriteBuffer(dev->queue, mem_of(buffer), CL_TRUE, offset, bytes,
                                             from, 0, NULL, NULL),
                        "clEnqueueWriteBuffer");
}

int dmk_buffer_read(dmk_context *ctx, dmk_device *dev, const dmk_buffer *buffer, size_t offset,
                    size_t bytes, void *to)
{
    if (bytes == 0) return DMK_OK;
    dev->work.reads++;
    return dmk_cl_check(
        ctx,
        clEnqueueReadBuffer(dev->queue, mem_of(buffer), CL_TRUE, offset, bytes, to, 0, NULL, NULL),
        "clEnqueueReadBuffer");
}

int dmk_buffer_write_real(dmk_context *ctx, dmk_device *dev, dmk_program program,
                          dmk_buffer *buffer, size_t n, const double *from)
{
    int rc;
    float *narrow = NULL;
    if (dmk_device_real(dev, program) == sizeof(double)) {
        return dmk_buffer_write(ctx, dev, buffer, 0, n * sizeof(double), from);
    }
    DMK_TRY(DMK_NEW(ctx, narrow, n));
    for (size_t i = 0; i < n; i++) narrow[i] = (float)from[i];
    DMK_TRY(dmk_buffer_write(ctx, dev, buffer, 0, n * sizeof(float), narrow));
done:
    free(narrow);
    return rc;
}

int dmk_buffer_read_real(dmk_context *ctx, dmk_device *dev, dmk_program program,
                         const dmk_buffer *buffer, size_t n, double *to)
{
    int rc;
    float *narrow = NULL;
    if (dmk_device_real(dev, program) == sizeof(double)) {
        return dmk_buffer_read(ctx, dev, buffer, 0, n * sizeof(double), to);
    }
    DMK_TRY(DMK_NEW(ctx, narrow, n));
    DMK_TRY(dmk_buffer_read(ctx, dev, buffer, 0, n * sizeof(float), narrow));
    for (size_t i = 0; i < n; i++) to[i] = narrow[i];
done:
    free(narrow);
    return rc;
}

int dmk_buffer_map(dmk_context *ctx, dmk_device *dev, dmk_buffer *buffer, size_t n,
                   double **numbers)
{
    void *at;
    *numbers = NULL;
    if (!is_cpu(dev) || !dev->double_precision || n == 0) return DMK_OK;
    dev->work.reads++;
    const int rc =
        map(ctx, dev, mem_of(buffer), CL_MAP_READ | CL_MAP_WRITE, n * sizeof(double), &at);
    if (rc == DMK_OK) *numbers = at;
    return rc;
}

void dmk_buffer_unmap(dmk_device *dev, dmk_buffer *buffer, double *numbers)
{
    clEnqueueUnmapMemObject(dev->queue, mem_of(buffer), numbers, 0, NULL, NULL);
}
