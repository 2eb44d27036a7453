#include "base.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define DMK_TEXT2(x) #x
#define DMK_TEXT(x) DMK_TEXT2(x)

const char *dmk_version(void)
{
    return DMK_TEXT(DMK_VERSION_MAJOR) "." DMK_TEXT(DMK_VERSION_MINOR) "." DMK_TEXT(DMK_VERSION_PATCH);
}

const char *dmk_status_text(int status)
{
    switch (status) {
    case DMK_OK: return "success";
    case DMK_E_ARG: return "bad argument";
    case DMK_E_NOMEM: return "out of memory";
    case DMK_E_IO: return "input or output failed";
    case DMK_E_FORMAT: return "bad file format";
    case DMK_E_MESH: return "unusable mesh";
    case DMK_E_DEVICE: return "OpenCL device failed";
    case DMK_E_BUILD: return "kernel did not build";
    case DMK_E_DIVERGED: return "the iteration diverged";
    case DMK_E_LIMIT: return "step limit reached";
    case DMK_E_CANCELLED: return "cancelled";
    default: return "unknown status";
    }
}

int dmk_context_create(dmk_context **context)
{
    *context = calloc(1, sizeof **context);
    if (!*context) return DMK_E_NOMEM;
    (*context)->poll_every = 0.05;
    return DMK_OK;
}

void dmk_context_destroy(dmk_context **context)
{
    free(*context);
    *context = NULL;
}

const char *dmk_context_message(const dmk_context *context)
{
    return context ? context->message : "no context";
}

void dmk_context_set_progress(dmk_context *context, dmk_progress_fn fn, void *user)
{
    context->progress = fn;
    context->progress_user = user;
}

int dmk_fail(dmk_context *context, int status, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(context->message, sizeof context->message, format, args);
    va_end(args);
    return status;
}

int dmk_alloc(dmk_context *context, const char *what, size_t count, size_t size, void **memory)
{
    if (count == 0) count = 1;
    void *p = count <= SIZE_MAX / size ? calloc(count, size) : NULL;
    if (!p) {
        return dmk_fail(context, DMK_E_NOMEM, "out of memory: %zu x %zu bytes for %s", count, size,
                        what);
    }
    *memory = p;
    return DMK_OK;
}

double dmk_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int dmk_report(dmk_context *context, const dmk_progress *progress)
{
    if (context->progress && context->progress(progress, context->progress_user) != 0) {
        return dmk_fail(context, DMK_E_CANCELLED, "cancelled in stage '%s'", progress->stage);
    }
    return DMK_OK;
}

static int report_stage(dmk_context *context)
{
    context->polled = dmk_seconds();
    return dmk_report(context, &(dmk_progress){.stage = context->stage, .change = NAN, .gap = NAN,
                                               .seconds = context->polled - context->began});
}

int dmk_stage_begin(dmk_context *context, const char *stage)
{
    context->stage = stage;
    context->began = dmk_seconds();
    return report_stage(context);
}

int dmk_poll(dmk_context *context)
{
    if (!context->stage || !context->progress) return DMK_OK;
    if (dmk_seconds() - context->polled < context->poll_every) return DMK_OK;
    return report_stage(context);
}

void dmk_stage_end(dmk_context *context)
{
    context->stage = NULL;
}
