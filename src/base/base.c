#include "base/base.h"

#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

void dmk_print_text(char *text, size_t size, const char *format, va_list args)
{
    const locale_t c = newlocale(LC_ALL_MASK, "C", (locale_t)0), before = uselocale(c);
    vsnprintf(text, size, format, args);
    uselocale(before);
    if (c) freelocale(c);
}

int dmk_fail(dmk_context *context, int status, const char *format, ...)
{
    if (!context) return status;
    va_list args;
    va_start(args, format);
    dmk_print_text(context->message, sizeof context->message, format, args);
    va_end(args);
    return status;
}

int dmk_ranks_given(dmk_context *ctx, const dmk_ranks *ranks)
{
    if (ranks->size >= 1 && ranks->rank >= 0 && ranks->rank < ranks->size &&
        ranks->gather_below >= 0 && ranks->exchange && ranks->gather && ranks->largest &&
        !ranks->begin == !ranks->finish)
        return DMK_OK;
    return dmk_fail(
        ctx, DMK_E_ARG,
        "rank %d of %d, gather_below %lld: expected a rank of 0 to size - 1, gather_below "
        "of 0 or more, all calls, and begin and finish both or neither",
        ranks->rank, ranks->size, (long long)ranks->gather_below);
}

int dmk_ranks_check(dmk_context *ctx, const dmk_ranks *ranks, int status)
{
    if (status == 0) return DMK_OK;
    if (status == DMK_E_CANCELLED) return dmk_fail(ctx, status, "interrupted");
    return dmk_fail(ctx, DMK_E_DEVICE, "rank %d of %d lost touch with the others (%d)", ranks->rank,
                    ranks->size, status);
}

bool dmk_any_missing(dmk_context *context, ...)
{
    const char *missing = NULL;
    va_list args;
    va_start(args, context);
    for (const char *name; !missing && (name = va_arg(args, const char *)) != NULL;) {
        if (!va_arg(args, const void *)) missing = name;
    }
    va_end(args);
    if (missing) dmk_fail(context, DMK_E_ARG, "the argument `%s` is NULL", missing);
    return missing || !context;
}

/* Bytes; no option struct gets longer: a size above is none. */
enum { LONGEST_OPTIONS = 4096 };

void dmk_options_fill(void *options, size_t size, const void *defaults, size_t known)
{
    if (!options || size < sizeof size || size > LONGEST_OPTIONS) return;
    memset(options, 0, size);
    memcpy(options, defaults, size < known ? size : known);
    memcpy(options, &size, sizeof size);
}

int dmk_options_take(dmk_context *context, const char *type, const void *options, void *taken,
                     size_t known)
{
    size_t size;
    if (!options) return DMK_OK;
    memcpy(&size, options, sizeof size);
    if (size <= sizeof size || size > LONGEST_OPTIONS || size % sizeof size != 0) {
        return dmk_fail(context, DMK_E_ARG,
                        "%s: struct_size is %zu; fill the options by their init function first",
                        type, size);
    }
    for (size_t i = known; i < size; i++) {
        if (((const char *)options)[i] == 0) continue;
        return dmk_fail(
            context, DMK_E_ARG,
            "%s: byte %zu is set, but this library knows %zu bytes only: the program was "
            "compiled against a newer dmkcl.h",
            type, i, known);
    }
    memcpy(taken, options, size < known ? size : known);
    memcpy(taken, &known, sizeof known);
    return DMK_OK;
}

void dmk_huge_pages(void *memory, size_t bytes)
{
#ifdef MADV_HUGEPAGE
    enum { PAGE = 2 << 20 };
    const size_t skipped = PAGE - (uintptr_t)memory % PAGE;
    if (bytes < DMK_HUGE) return;
    madvise((char *)memory + skipped, (bytes - skipped) / PAGE * PAGE, MADV_HUGEPAGE);
#endif
}

int dmk_alloc(dmk_context *context, const char *what, size_t count, size_t size, void **memory)
{
    if (count == 0) count = 1;
    void *p = count <= SIZE_MAX / size ? calloc(count, size) : NULL;
    if (!p) {
        return dmk_fail(context, DMK_E_NOMEM, "out of memory: %zu x %zu bytes for %s", count, size,
                        what);
    }
    dmk_huge_pages(p, count * size);
    *memory = p;
    return DMK_OK;
}

int dmk_grow(dmk_context *context, const char *what, size_t wanted, size_t size, size_t *capacity,
             void **memory)
{
    if (wanted <= *capacity) return DMK_OK;
    size_t room = 2 * *capacity > wanted ? 2 * *capacity : wanted;
    void *p = room <= SIZE_MAX / size ? realloc(*memory, room * size) : NULL;
    if (!p) {
        return dmk_fail(context, DMK_E_NOMEM, "out of memory: %zu x %zu bytes for %s", room, size,
                        what);
    }
    dmk_huge_pages(p, room * size);
    *memory = p;
    *capacity = room;
    return DMK_OK;
}

void dmk_trim_memory(void)
{
#ifdef __GLIBC__
    malloc_trim(0);
#endif
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
    return dmk_report(context, &(dmk_progress){.stage = context->stage,
                                               .change = NAN,
                                               .gap = NAN,
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
