/* See faults.h. A program without fault_arm of its own is steered by the environment:
 *     DMK_FAULT=KIND:AT[:lasting[:renewed]][:code=N][:signal=N]   with KIND memory, file or opencl
 *     DMK_FAULT_LOG=FILE   gets "CALLS LIVE": calls of that kind, and what was not given back */
#include "faults.h"

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <errno.h>
#include <fcntl.h>
#include <hwloc.h>
#include <locale.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

static fault armed;
static atomic_long calls, live;

void fault_arm(const fault *f)
{
    armed = *f;
    atomic_store(&calls, 0);
}

long fault_disarm(void)
{
    armed.kind = FAULT_NONE;
    return atomic_load(&calls);
}

long fault_live(void)
{
    return atomic_load(&live);
}

/* Whether this call is to fail. */
static bool fails(fault_kind kind)
{
    if (armed.kind != kind) return false;
    long n = atomic_fetch_add(&calls, 1) + 1;
    if (n != armed.at && !(armed.lasting && n > armed.at)) return false;
    if (armed.signal)
        kill(getpid(), armed.signal); /* to the program: which thread takes it is its own affair */
    return !armed.signal;
}

static void got(void)
{
    atomic_fetch_add(&live, 1);
}
static void gave(void)
{
    atomic_fetch_sub(&live, 1);
}

/* ---- steering by the environment ---- */

static void read_order(const char *text)
{
    fault f = {.code = -5};
    const char *option;
    f.kind = strncmp(text, "memory", 6) == 0 ? FAULT_MEMORY
             : strncmp(text, "file", 4) == 0 ? FAULT_FILE
                                             : FAULT_OPENCL;
    f.at = atol(strchr(text, ':') + 1);
    f.lasting = strstr(text, ":lasting") != NULL;
    f.renewed = strstr(text, ":renewed") != NULL;
    if ((option = strstr(text, ":code=")) != NULL) f.code = atoi(option + 6);
    if ((option = strstr(text, ":signal=")) != NULL) f.signal = atoi(option + 8);
    if (f.kind == FAULT_FILE && f.code < 0) f.code = ENOSPC;
    fault_arm(&f);
}

__attribute__((constructor)) static void begin(void)
{
    const char *order = getenv("DMK_FAULT");
    if (order && strchr(order, ':')) read_order(order);
}

__attribute__((destructor)) static void end(void)
{
    const char *log = getenv("DMK_FAULT_LOG");
    if (!log) return;
    long n = fault_disarm();
    char text[64];
    int fd = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0600); /* counts itself: one less below */
    int size = snprintf(text, sizeof text, "%ld %ld\n", n, fault_live() - 1);
    if (fd >= 0 && write(fd, text, (size_t)size) == size) close(fd);
}

/* ---- memory ---- */

#define WRAP(type, name, ...)                                                                      \
    type __real_##name(__VA_ARGS__);                                                               \
    type __wrap_##name(__VA_ARGS__);                                                               \
    type __wrap_##name(__VA_ARGS__)

static void *keep(void *p)
{
    if (p) got();
    return p;
}

static void *no_memory(void)
{
    errno = ENOMEM;
    return NULL;
}

WRAP(void *, malloc, size_t n)
{
    return fails(FAULT_MEMORY) ? no_memory() : keep(__real_malloc(n));
}
WRAP(void *, calloc, size_t n, size_t size)
{
    return fails(FAULT_MEMORY) ? no_memory() : keep(__real_calloc(n, size));
}
WRAP(void *, realloc, void *p, size_t n)
{
    if (fails(FAULT_MEMORY)) return no_memory();
    return p ? __real_realloc(p, n) : keep(__real_realloc(p, n));
}
WRAP(void, free, void *p)
{
    if (p) gave();
    __real_free(p);
}
WRAP(char *, strdup, const char *text)
{
    return fails(FAULT_MEMORY) ? no_memory() : keep(__real_strdup(text));
}
WRAP(char *, realpath, const char *path, char *resolved)
{
    return fails(FAULT_MEMORY) ? no_memory() : keep(__real_realpath(path, resolved));
}
WRAP(locale_t, newlocale, int mask, const char *name, locale_t base)
{
    if (fails(FAULT_MEMORY)) return no_memory();
    return keep(__real_newlocale(mask, name, base));
}
WRAP(void, freelocale, locale_t l)
{
    gave();
    __real_freelocale(l);
}
WRAP(int, pthread_create, pthread_t *t, const pthread_attr_t *a, void *(*body)(void *), void *user)
{
    return fails(FAULT_MEMORY) ? EAGAIN : __real_pthread_create(t, a, body, user);
}
WRAP(int, hwloc_topology_init, hwloc_topology_t *t)
{
    if (fails(FAULT_MEMORY)) return -1;
    int rc = __real_hwloc_topology_init(t);
    if (rc == 0) got();
    return rc;
}
WRAP(void, hwloc_topology_destroy, hwloc_topology_t t)
{
    gave();
    __real_hwloc_topology_destroy(t);
}
WRAP(int, inflateInit2_, z_stream *z, int bits, const char *version, int size)
{
    if (fails(FAULT_MEMORY)) return Z_MEM_ERROR;
    int rc = __real_inflateInit2_(z, bits, version, size);
    if (rc == Z_OK) got();
    return rc;
}
WRAP(int, inflate, z_stream *z, int flush)
{
    return fails(FAULT_MEMORY) ? Z_MEM_ERROR : __real_inflate(z, flush);
}
WRAP(int, inflateEnd, z_stream *z)
{
    gave();
    return __real_inflateEnd(z);
}
/* Their line comes from the C library and goes to free. An optimizing compiler makes the one the other. */
static ssize_t keep_line(char *before, char **line, ssize_t n)
{
    if (!before && *line) got();
    return n;
}
WRAP(ssize_t, getline, char **line, size_t *room, FILE *f)
{
    char *before = *line;
    if (fails(FAULT_MEMORY)) return no_memory() ? 0 : -1;
    return keep_line(before, line, __real_getline(line, room, f));
}
WRAP(ssize_t, __getdelim, char **line, size_t *room, int end, FILE *f)
{
    char *before = *line;
    if (fails(FAULT_MEMORY)) return no_memory() ? 0 : -1;
    return keep_line(before, line, __real___getdelim(line, room, end, f));
}

/* ---- files ---- */

static int no_file(void)
{
    errno = armed.code;
    return -1;
}

static int keep_file(int fd)
{
    if (fd >= 0) got();
    return fd;
}

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...)
{
    va_list args;
    va_start(args, flags);
    mode_t mode = flags & O_CREAT || (flags & O_TMPFILE) == O_TMPFILE ? va_arg(args, mode_t) : 0;
    va_end(args);
    return fails(FAULT_FILE) ? no_file() : keep_file(__real_open(path, flags, mode));
}
WRAP(int, dup, int fd)
{
    return fails(FAULT_FILE) ? no_file() : keep_file(__real_dup(fd));
}
WRAP(int, linkat, int a, const char *from, int b, const char *to, int flags)
{
    return fails(FAULT_FILE) ? no_file() : __real_linkat(a, from, b, to, flags);
}
WRAP(int, flock, int fd, int how)
{
    return fails(FAULT_FILE) ? no_file() : __real_flock(fd, how);
}
WRAP(ssize_t, readlink, const char *path, char *to, size_t n)
{
    return fails(FAULT_FILE) ? no_file() : __real_readlink(path, to, n);
}
WRAP(int, mkstemp, char *name)
{
    return fails(FAULT_FILE) ? no_file() : keep_file(__real_mkstemp(name));
}
WRAP(int, close, int fd)
{
    gave();
    int rc = __real_close(fd); /* as close does it: gone even where an error is reported */
    return fails(FAULT_FILE) ? no_file() : rc;
}
WRAP(int, fstat, int fd, struct stat *st)
{
    return fails(FAULT_FILE) ? no_file() : __real_fstat(fd, st);
}
WRAP(ssize_t, read, int fd, void *to, size_t n)
{
    return fails(FAULT_FILE) ? no_file() : __real_read(fd, to, n);
}
WRAP(ssize_t, write, int fd, const void *from, size_t n)
{
    return fails(FAULT_FILE) ? no_file() : __real_write(fd, from, n);
}
WRAP(int, fsync, int fd)
{
    return fails(FAULT_FILE) ? no_file() : __real_fsync(fd);
}
WRAP(int, fchmod, int fd, mode_t mode)
{
    return fails(FAULT_FILE) ? no_file() : __real_fchmod(fd, mode);
}
WRAP(int, rename, const char *from, const char *to)
{
    return fails(FAULT_FILE) ? no_file() : __real_rename(from, to);
}
WRAP(int, mkdir, const char *path, mode_t mode)
{
    return fails(FAULT_FILE) ? no_file() : __real_mkdir(path, mode);
}
WRAP(FILE *, fopen, const char *path, const char *mode)
{
    if (fails(FAULT_FILE)) {
        no_file();
        return NULL;
    }
    return keep(__real_fopen(path, mode));
}
/* The descriptor was counted when it was opened. */
WRAP(FILE *, fdopen, int fd, const char *mode)
{
    if (fails(FAULT_FILE)) {
        no_file();
        return NULL;
    }
    return __real_fdopen(fd, mode);
}
WRAP(int, fclose, FILE *f)
{
    gave();
    int rc = __real_fclose(f);
    return fails(FAULT_FILE) ? no_file() : rc;
}
WRAP(int, fflush, FILE *f)
{
    return fails(FAULT_FILE) ? no_file() : __real_fflush(f);
}
WRAP(size_t, fwrite, const void *from, size_t size, size_t n, FILE *f)
{
    if (fails(FAULT_FILE)) {
        no_file();
        return 0;
    }
    return __real_fwrite(from, size, n, f);
}
WRAP(size_t, fread, void *to, size_t size, size_t n, FILE *f)
{
    if (fails(FAULT_FILE)) {
        no_file();
        return 0;
    }
    return __real_fread(to, size, n, f);
}

/* ---- OpenCL ---- */

/* Calls that return their error through a place, and give an object. */
#define WRAP_CREATE(type, name, params, args)                                                      \
    type __real_##name params;                                                                     \
    type __wrap_##name params;                                                                     \
    type __wrap_##name params                                                                      \
    {                                                                                              \
        if (fails(FAULT_OPENCL)) {                                                                 \
            if (error) *error = armed.code;                                                        \
            return NULL;                                                                           \
        }                                                                                          \
        return keep(__real_##name args);                                                           \
    }
/* Calls that give their error. */
#define WRAP_CALL(name, params, args)                                                              \
    cl_int __real_##name params;                                                                   \
    cl_int __wrap_##name params;                                                                   \
    cl_int __wrap_##name params                                                                    \
    {                                                                                              \
        return fails(FAULT_OPENCL) ? armed.code : __real_##name args;                              \
    }
/* Giving back is never made to fail: what then leaks is the driver's. */
#define WRAP_RELEASE(name, type)                                                                   \
    cl_int __real_##name(type);                                                                    \
    cl_int __wrap_##name(type);                                                                    \
    cl_int __wrap_##name(type object)                                                              \
    {                                                                                              \
        gave();                                                                                    \
        return __real_##name(object);                                                              \
    }

typedef void(CL_CALLBACK *context_fn)(const char *, const void *, size_t, void *);
typedef void(CL_CALLBACK *program_fn)(cl_program, void *);

WRAP_CREATE(cl_context, clCreateContext,
            (const cl_context_properties *p, cl_uint n, const cl_device_id *d, context_fn fn,
             void *user, cl_int *error),
            (p, n, d, fn, user, error))
WRAP_CREATE(cl_command_queue, clCreateCommandQueue,
            (cl_context c, cl_device_id d, cl_command_queue_properties p, cl_int *error),
            (c, d, p, error))
WRAP_CREATE(cl_mem, clCreateBuffer,
            (cl_context c, cl_mem_flags f, size_t n, void *host, cl_int *error),
            (c, f, n, host, error))
WRAP_CREATE(cl_mem, clCreateSubBuffer,
            (cl_mem whole, cl_mem_flags f, cl_buffer_create_type type, const void *region,
             cl_int *error),
            (whole, f, type, region, error))
WRAP_CREATE(cl_program, clCreateProgramWithSource,
            (cl_context c, cl_uint n, const char **text, const size_t *length, cl_int *error),
            (c, n, text, length, error))
WRAP_CREATE(cl_program, clCreateProgramWithBinary,
            (cl_context c, cl_uint n, const cl_device_id *d, const size_t *length,
             const unsigned char **binary, cl_int *status, cl_int *error),
            (c, n, d, length, binary, status, error))
WRAP_CREATE(cl_kernel, clCreateKernel, (cl_program p, const char *name, cl_int *error),
            (p, name, error))

void *__real_clEnqueueMapBuffer(cl_command_queue, cl_mem, cl_bool, cl_map_flags, size_t, size_t,
                                cl_uint, const cl_event *, cl_event *, cl_int *);
void *__wrap_clEnqueueMapBuffer(cl_command_queue, cl_mem, cl_bool, cl_map_flags, size_t, size_t,
                                cl_uint, const cl_event *, cl_event *, cl_int *);
void *__wrap_clEnqueueMapBuffer(cl_command_queue q, cl_mem m, cl_bool wait, cl_map_flags f,
                                size_t offset, size_t n, cl_uint ne, const cl_event *e,
                                cl_event *out, cl_int *error)
{
    if (fails(FAULT_OPENCL)) {
        *error = armed.code;
        return NULL;
    }
    return keep(__real_clEnqueueMapBuffer(q, m, wait, f, offset, n, ne, e, out, error));
}
/* Giving back, as above. */
cl_int __real_clEnqueueUnmapMemObject(cl_command_queue, cl_mem, void *, cl_uint, const cl_event *,
                                      cl_event *);
cl_int __wrap_clEnqueueUnmapMemObject(cl_command_queue, cl_mem, void *, cl_uint, const cl_event *,
                                      cl_event *);
cl_int __wrap_clEnqueueUnmapMemObject(cl_command_queue q, cl_mem m, void *at, cl_uint ne,
                                      const cl_event *e, cl_event *out)
{
    gave();
    return __real_clEnqueueUnmapMemObject(q, m, at, ne, e, out);
}

cl_int __real_clGetPlatformIDs(cl_uint, cl_platform_id *, cl_uint *);
cl_int __wrap_clGetPlatformIDs(cl_uint, cl_platform_id *, cl_uint *);
cl_int __wrap_clGetPlatformIDs(cl_uint n, cl_platform_id *p, cl_uint *count)
{
    if (armed.renewed && atomic_load(&calls) >= armed.at) armed.kind = FAULT_NONE;
    return fails(FAULT_OPENCL) ? armed.code : __real_clGetPlatformIDs(n, p, count);
}
WRAP_CALL(clGetPlatformInfo,
          (cl_platform_id p, cl_platform_info i, size_t n, void *v, size_t *size),
          (p, i, n, v, size))
WRAP_CALL(clGetDeviceIDs,
          (cl_platform_id p, cl_device_type t, cl_uint n, cl_device_id *d, cl_uint *count),
          (p, t, n, d, count))
WRAP_CALL(clGetDeviceInfo, (cl_device_id d, cl_device_info i, size_t n, void *v, size_t *size),
          (d, i, n, v, size))
WRAP_CALL(clGetMemObjectInfo, (cl_mem m, cl_mem_info i, size_t n, void *v, size_t *size),
          (m, i, n, v, size))
WRAP_CALL(clEnqueueCopyBuffer,
          (cl_command_queue q, cl_mem from, cl_mem to, size_t at, size_t there, size_t n,
           cl_uint ne, const cl_event *e, cl_event *out),
          (q, from, to, at, there, n, ne, e, out))
WRAP_CALL(clGetProgramInfo, (cl_program p, cl_program_info i, size_t n, void *v, size_t *size),
          (p, i, n, v, size))
WRAP_CALL(clGetProgramBuildInfo,
          (cl_program p, cl_device_id d, cl_program_build_info i, size_t n, void *v, size_t *size),
          (p, d, i, n, v, size))
WRAP_CALL(clBuildProgram,
          (cl_program p, cl_uint n, const cl_device_id *d, const char *options, program_fn fn,
           void *user),
          (p, n, d, options, fn, user))
WRAP_CALL(clCompileProgram,
          (cl_program p, cl_uint n, const cl_device_id *d, const char *options, cl_uint nh,
           const cl_program *h, const char **names, program_fn fn, void *user),
          (p, n, d, options, nh, h, names, fn, user))
WRAP_CALL(clSetKernelArg, (cl_kernel k, cl_uint i, size_t n, const void *v), (k, i, n, v))
WRAP_CALL(clGetKernelWorkGroupInfo,
          (cl_kernel k, cl_device_id d, cl_kernel_work_group_info i, size_t n, void *v,
           size_t *size),
          (k, d, i, n, v, size))
WRAP_CALL(clEnqueueFillBuffer,
          (cl_command_queue q, cl_mem m, const void *v, size_t size, size_t offset, size_t n,
           cl_uint ne, const cl_event *e, cl_event *out),
          (q, m, v, size, offset, n, ne, e, out))
WRAP_CALL(clEnqueueNDRangeKernel,
          (cl_command_queue q, cl_kernel k, cl_uint dims, const size_t *offset,
           const size_t *global, const size_t *local, cl_uint ne, const cl_event *e, cl_event *out),
          (q, k, dims, offset, global, local, ne, e, out))
WRAP_CALL(clEnqueueReadBuffer,
          (cl_command_queue q, cl_mem m, cl_bool wait, size_t offset, size_t n, void *to,
           cl_uint ne, const cl_event *e, cl_event *out),
          (q, m, wait, offset, n, to, ne, e, out))
WRAP_CALL(clEnqueueWriteBuffer,
          (cl_command_queue q, cl_mem m, cl_bool wait, size_t offset, size_t n, const void *from,
           cl_uint ne, const cl_event *e, cl_event *out),
          (q, m, wait, offset, n, from, ne, e, out))
cl_int __real_clCreateSubDevices(cl_device_id, const cl_device_partition_property *, cl_uint,
                                 cl_device_id *, cl_uint *);
cl_int __wrap_clCreateSubDevices(cl_device_id, const cl_device_partition_property *, cl_uint,
                                 cl_device_id *, cl_uint *);
cl_int __wrap_clCreateSubDevices(cl_device_id d, const cl_device_partition_property *p, cl_uint n,
                                 cl_device_id *out, cl_uint *count)
{
    if (fails(FAULT_OPENCL)) return armed.code;
    cl_int error = __real_clCreateSubDevices(d, p, n, out, count);
    if (error == CL_SUCCESS) got();
    return error;
}

/* Called to give back in peace, whatever it says. */
WRAP_CALL(clFlush, (cl_command_queue q), (q))
WRAP(cl_int, clFinish, cl_command_queue q)
{
    return __real_clFinish(q);
}
WRAP(cl_int, clGetCommandQueueInfo, cl_command_queue q, cl_command_queue_info i, size_t n, void *v,
     size_t *size)
{
    return __real_clGetCommandQueueInfo(q, i, n, v, size);
}
WRAP_RELEASE(clReleaseContext, cl_context)
WRAP_RELEASE(clReleaseCommandQueue, cl_command_queue)
WRAP_RELEASE(clReleaseMemObject, cl_mem)
WRAP_RELEASE(clReleaseProgram, cl_program)
WRAP_RELEASE(clReleaseKernel, cl_kernel)
WRAP_RELEASE(clReleaseDevice, cl_device_id)
