/* Inside the device room. */
#ifndef DMK_DEVICE_INTERNAL_H
#define DMK_DEVICE_INTERNAL_H

#include "device/device.h"

#include <CL/cl.h>
#include <pthread.h>
#include <sys/types.h>

struct dmk_kernel {
    cl_kernel cl;
    dmk_program program;
    const char *name;
    size_t group; /* work-items of a work-group */
};

enum { DMK_MAX_KERNELS = 128 };

/* Programs that a thread of their own builds. */
typedef struct dmk_building {
    bool begun;
    pthread_t thread;
    struct dmk_context record; /* the message */
    int rc;
} dmk_building;

struct dmk_device {
    pid_t owner; /* process that opened it */
    cl_platform_id platform;
    cl_device_id id; /* what the queue runs on: the root device or a sub-device of it */
    int is_sub_device;
    bool pocl; /* the platform is PoCL */
    cl_context cl;
    cl_command_queue queue;
    cl_program program[DMK_N_PROGRAMS]; /* the same one twice when both are in single precision */
    dmk_building building;              /* until it has ended nobody else looks at them */
    dmk_kernel kernel[DMK_MAX_KERNELS];
    int n_kernels;
    dmk_device_info info;
    int cpu_shape;      /* 1: one work-item per chunk of blocks; 0: one per item, groups of 256 */
    size_t chunk;       /* blocks per work-item in the CPU shape */
    size_t lone_group;  /* work-items of a kernel that one work-group does */
    dmk_buffer *shares; /* CPU shape: each thread's progress in a launch (base.cl) */
    int tag;            /* of the last launch that used it */
    int double_precision;
    dmk_device_work work;
    char cache[512]; /* folder for binaries, "" = none */
};

/* "CL_OUT_OF_RESOURCES" and the like. */
const char *dmk_cl_text(cl_int error);
/* The end of a sentence where the address space is bounded, which drivers do not take well; else nothing. */
const char *dmk_space_hint(void);
/* launch.c: work-groups of a launch over the range. */
size_t dmk_launch_groups(const dmk_device *device, dmk_range range);
/* DMK_OK, or a failure that names the call. */
int dmk_cl_check(dmk_context *context, cl_int error, const char *call);
#define DMK_CL(call) DMK_TRY(dmk_cl_check(ctx, (call), #call))

/* program.c: build or load both programs; begin to, and wait until they are there. */
int dmk_programs_build(dmk_context *context, dmk_device *device);
void dmk_programs_begin(dmk_device *device);
int dmk_programs_wait(dmk_context *context, dmk_device *device);
/* One more, or with -1 one less, of dmk_devices_opening. */
void dmk_opening(int change);
/* cache.c: the binary kept under a key made of everything it depends on. For PoCL the program is one that has been
 * compiled and not linked, and its bitcode is kept. */
int dmk_cache_load(dmk_device *device, const char *options, cl_program *program);
void dmk_cache_store(dmk_device *device, const char *options, cl_program program);
/* That PoCL's own cache can be written to, which it does in every run; DMK_E_DEVICE with the folder's name. */
int dmk_cache_check_pocl(dmk_context *context);
/* The folder to use: `wanted`, or the user's cache folder if it is NULL; "" means no cache. */
int dmk_cache_folder(dmk_context *context, const char *wanted, char *folder, size_t size);

#endif
