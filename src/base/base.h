/* What every room needs: the error record, checked allocation, the clock, progress. */
#ifndef DMK_BASE_H
#define DMK_BASE_H

#include "dmkcl.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct dmk_context {
    char message[1024];
    dmk_progress_fn progress;
    void *progress_user;
    const char *stage;       /* that dmk_poll reports, or NULL */
    double began, polled;    /* seconds: when the stage began, when it was last reported */
    double poll_every;       /* seconds */
    int threads;             /* 0: one for each processor; see parallel.h */
    struct dmk_pool *pool;   /* NULL until it is needed */
    bool borrows_pool;       /* the pool is another context's */
    struct dmk_meter *meter; /* that counts the time of what the context posts, or NULL */
    const char *format;      /* of files whose name has no suffix: a name in the table, or NULL */
};

/* vsnprintf with decimal points, as all numbers here have them, whatever the program's locale. */
void dmk_print_text(char *text, size_t size, const char *format, va_list args)
    __attribute__((format(printf, 3, 0)));
/* Put a message in the record, unless that is NULL, and return `status`; the printf-like text says what
 * is wrong and what to do. An earlier message is replaced. */
int dmk_fail(dmk_context *context, int status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* DMK_OK, or DMK_E_ARG if ranks are not what the header asks for. */
int dmk_ranks_given(dmk_context *context, const dmk_ranks *ranks);
/* Rank r's even share of n items begins here. */
static inline int64_t dmk_even_bound(int64_t n, int r, int size)
{
    return (int64_t)((uint64_t)n * (uint64_t)r / (uint64_t)size);
}
/* DMK_OK, or the failure of a call of ranks->... that gave `status`. */
int dmk_ranks_check(dmk_context *context, const dmk_ranks *ranks, int status);
/* Whether an argument is missing, of pairs of a name and a pointer. Then the message names the first one
 * that is NULL, and the call is to return DMK_E_ARG; a missing context has no message.
 *     if (dmk_missing(ctx, "mesh", mesh, "point", point)) return DMK_E_ARG; */
#define dmk_missing(context, ...) dmk_any_missing((context), __VA_ARGS__, (const char *)NULL)
bool dmk_any_missing(dmk_context *context, ...) __attribute__((sentinel));
#ifdef DMK_ANALYZER /* which sees one file at a time and must know what the call returns */
void dmk_known(const dmk_context *context, ...);
#define dmk_fail(context, status, ...) (dmk_known((context), __VA_ARGS__), (status))
#endif

/* Option structs, which begin with their size: see the public header. fill: the defaults, in a struct of the caller
 * that is `size` bytes long. take: what the caller chose over the defaults in `taken`, `known` bytes long, which stay
 * where the caller's struct is older and ends before, or is NULL; DMK_E_ARG where its size is none, or it is newer and
 * chooses what is not known here. */
void dmk_options_fill(void *options, size_t size, const void *defaults, size_t known);
int dmk_options_take(dmk_context *context, const char *type, const void *options, void *taken,
                     size_t known);

/* The only macro that jumps: needs `int rc` and a label `done` in the function. */
#define DMK_TRY(call)                                                                              \
    do {                                                                                           \
        rc = (call);                                                                               \
        if (rc != DMK_OK) goto done;                                                               \
    } while (0)

/* DMK_OK and *memory = count * size zeroed bytes (never NULL, even for 0), or DMK_E_NOMEM with the
 * message naming `what`. Freed with free(). */
int dmk_alloc(dmk_context *context, const char *what, size_t count, size_t size, void **memory);
/* Typed form: int32_t *a; DMK_TRY(DMK_NEW(ctx, a, n)); */
#define DMK_NEW(context, pointer, count)                                                           \
    dmk_alloc((context), #pointer, (count), sizeof *(pointer), (void **)&(pointer))

/* DMK_OK and room for at least `wanted` items of `size` bytes in *memory, which keeps its contents (what
 * is new is not zeroed) and at least doubles; or DMK_E_NOMEM, and it stays as it was. */
int dmk_grow(dmk_context *context, const char *what, size_t wanted, size_t size, size_t *capacity,
             void **memory);
/* Typed form: size_t room = 0; int32_t *a = NULL; DMK_TRY(DMK_GROW(ctx, a, n + 1, room)); */
#define DMK_GROW(context, pointer, wanted, capacity)                                               \
    dmk_grow((context), #pointer, (wanted), sizeof *(pointer), &(capacity), (void **)&(pointer))

/* Of triples, which are counted: at least 3 * wanted items. */
#define DMK_GROW_TRIPLES(context, pointer, wanted, capacity)                                       \
    dmk_grow((context), #pointer, (wanted), 3 * sizeof *(pointer), &(capacity), (void **)&(pointer))

/* DMK_NEW without zeroing, for arrays of one item or more that are filled at once; the pointer is NULL before. */
#define DMK_NEW_UNSET(context, pointer, count)                                                     \
    dmk_grow((context), #pointer, (count), sizeof *(pointer), (size_t[]){0}, (void **)&(pointer))

/* Memory of so many bytes or more is to lie in huge pages, speed only: the system takes a fault for each 2 MB that are
 * written, not for each 4 kB. A solve of 4,375,000 triangles has 180,000 faults so and takes 24 s, with 64 MB 970,000
 * and 25, without 1,930,000 and 28. The calls above see to it; for memory of others, before it is written. */
enum { DMK_HUGE = 16 << 20 };
void dmk_huge_pages(void *memory, size_t bytes);

/* What is free on the heap goes back to the system, where the C library can do that. */
void dmk_trim_memory(void);

/* Seconds of a monotonic clock. */
double dmk_seconds(void);

/* Call the progress callback, if any; DMK_E_CANCELLED if it asks to stop. */
int dmk_report(dmk_context *context, const dmk_progress *progress);

/* A stage without steps. Its begin is reported at once; dmk_poll, to be called within it at least each
 * 50 milliseconds of work on a million triangles, reports it again when 50 milliseconds have passed,
 * so that the callback can ask to stop. Outside of such a stage dmk_poll does nothing. */
int dmk_stage_begin(dmk_context *context, const char *stage);
int dmk_poll(dmk_context *context);
void dmk_stage_end(dmk_context *context);

#define DMK_DEGREES 57.295779513082320877 /* of a radian */

static inline int32_t dmk_min_i(int32_t a, int32_t b)
{
    return a < b ? a : b;
}
static inline int32_t dmk_max_i(int32_t a, int32_t b)
{
    return a > b ? a : b;
}
/* Of two numbers, `a` where b is not one: instructions, where the C library's fmin and fmax are calls. */
static inline double dmk_min(double a, double b)
{
    return b < a ? b : a;
}
static inline double dmk_max(double a, double b)
{
    return b > a ? b : a;
}

#endif
