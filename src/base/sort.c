#include "base/sort.h"

#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

enum { DIGIT = 12, VALUES = 1 << DIGIT }; /* bits of a digit; what they can be */
enum { LONG = 50000 };                    /* items that are worth several threads */

/* A pass by one digit. Each part of the items goes behind the parts before it, so that the order does not depend on
 * how many there are. */
typedef struct pass {
    const dmk_keyed *from;
    dmk_keyed *to;
    size_t n;
    int shift;
    int32_t n_parts;
    size_t (*place)[VALUES]; /* n_parts: how many of each value; then where the next one goes */
} pass;

static size_t part_begin(const pass *p, int32_t part)
{
    return p->n * (size_t)part / (size_t)p->n_parts;
}

static size_t digit(const pass *p, size_t i)
{
    return p->from[i].key >> p->shift & (VALUES - 1);
}

static int count_part(dmk_context *ctx, int32_t part, void *data)
{
    const pass *p = data;
    size_t *count = p->place[part];
    (void)ctx;
    memset(count, 0, sizeof p->place[part]);
    for (size_t i = part_begin(p, part); i < part_begin(p, part + 1); i++) count[digit(p, i)]++;
    return DMK_OK;
}

static int move_part(dmk_context *ctx, int32_t part, void *data)
{
    const pass *p = data;
    size_t *place = p->place[part];
    (void)ctx;
    for (size_t i = part_begin(p, part); i < part_begin(p, part + 1); i++)
        p->to[place[digit(p, i)]++] = p->from[i];
    return DMK_OK;
}

/* False if all items have the same digit, and stay. */
static bool find_places(const pass *p)
{
    size_t sum = 0;
    for (int k = 0; k < VALUES; k++) {
        const size_t before = sum;
        for (int32_t part = 0; part < p->n_parts; part++) {
            const size_t count = p->place[part][k];
            p->place[part][k] = sum;
            sum += count;
        }
        if (sum - before == p->n) return false;
    }
    return true;
}

int dmk_sort_keyed(dmk_context *ctx, dmk_keyed *a, size_t n)
{
    int rc;
    dmk_keyed *b = NULL;
    pass p = {.from = a, .n = n, .n_parts = n < LONG ? 1 : dmk_parallel_threads(ctx)};
    DMK_TRY(DMK_NEW_UNSET(ctx, b, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, p.place, (size_t)p.n_parts));
    p.to = b;
    for (; p.shift < DMK_KEY_BITS; p.shift += DIGIT) {
        DMK_TRY(dmk_parallel_pieces(ctx, p.n_parts, count_part, &p));
        if (!find_places(&p)) continue;
        DMK_TRY(dmk_parallel_pieces(ctx, p.n_parts, move_part, &p));
        p.to = p.from == a ? a : b;
        p.from = p.from == a ? b : a;
    }
    if (p.from == b) memcpy(a, b, n * sizeof *a);
done:
    free(b);
    free(p.place);
    return rc;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void dmk_sort_doubles(double *a, size_t n)
{
    qsort(a, n, sizeof *a, by_value);
}

static int by_number(const void *a, const void *b)
{
    int32_t x = *(const int32_t *)a, y = *(const int32_t *)b;
    return (x > y) - (x < y);
}

void dmk_sort_long(int32_t n, int32_t *a)
{
    qsort(a, (size_t)n, sizeof *a, by_number);
}
