#include "base/sort.h"

#include <stdlib.h>

enum { DIGIT = 12 }; /* bits of a digit: an even number of them is a key */

int dmk_sort_keyed(dmk_context *ctx, dmk_keyed *a, size_t n)
{
    int rc;
    dmk_keyed *b = NULL, *from = a;
    DMK_TRY(DMK_NEW(ctx, b, n));
    dmk_keyed *to = b;
    for (int shift = 0; shift < DMK_KEY_BITS; shift += DIGIT) {
        size_t offset[1 << DIGIT] = {0}, sum = 0;
        const uint64_t mask = (1 << DIGIT) - 1;
        for (size_t i = 0; i < n; i++) offset[from[i].key >> shift & mask]++;
        for (int k = 0; k < 1 << DIGIT; k++) {
            size_t count = offset[k];
            offset[k] = sum;
            sum += count;
        }
        for (size_t i = 0; i < n; i++) to[offset[from[i].key >> shift & mask]++] = from[i];
        dmk_keyed *swap = from;
        from = to;
        to = swap;
    }
    /* an even number of passes ends in a */
done:
    free(b);
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
