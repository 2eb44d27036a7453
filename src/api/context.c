/* The version, status texts and the context. */
#include "base/pool.h"

#include <stdlib.h>

#define DMK_TEXT2(x) #x
#define DMK_TEXT(x) DMK_TEXT2(x)

const char *dmk_version(void)
{
    return DMK_TEXT(DMK_VERSION_MAJOR) "." DMK_TEXT(DMK_VERSION_MINOR) "." DMK_TEXT(
        DMK_VERSION_PATCH);
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
    if (!context) return DMK_E_ARG;
    *context = calloc(1, sizeof **context);
    if (!*context) return DMK_E_NOMEM;
    (*context)->poll_every = 0.05;
    return DMK_OK;
}

void dmk_context_destroy(dmk_context **context)
{
    if (!context || !*context) return;
    dmk_pool_destroy(&(*context)->pool);
    free(*context);
    *context = NULL;
}

int dmk_context_set_threads(dmk_context *context, int threads)
{
    if (!context) return DMK_E_ARG;
    if (threads < 0)
        return dmk_fail(context, DMK_E_ARG, "threads = %d: expected 0 or more", threads);
    dmk_pool_destroy(&context->pool);
    context->threads = threads;
    dmk_pool_of(context); /* now: none starts while a driver is being loaded */
    return DMK_OK;
}

const char *dmk_context_message(const dmk_context *context)
{
    return context ? context->message : "no context";
}

void dmk_context_set_progress(dmk_context *context, dmk_progress_fn fn, void *user)
{
    if (!context) return;
    context->progress = fn;
    context->progress_user = user;
}
