/* Items sorted by integer keys; numbers. */
#ifndef DMK_SORT_H
#define DMK_SORT_H

#include "base/base.h"

#include <string.h>

typedef struct dmk_keyed {
    uint64_t key;
    int32_t item;
} dmk_keyed;

enum { DMK_KEY_BITS = 48 };

/* The bits of a number that is not negative: they keep the order. */
static inline uint32_t dmk_float_key(float x)
{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Stable sort by the low DMK_KEY_BITS bits of the keys, in time linear in n. */
int dmk_sort_keyed(dmk_context *context, dmk_keyed *a, size_t n);

void dmk_sort_doubles(double *a, size_t n);

/* Lists longer than this are handed to qsort. */
enum { DMK_SHORT_LIST = 64 };
void dmk_sort_long(int32_t n, int32_t *a);

/* Sort a list that is most often short: by insertion. */
static inline void dmk_sort(int32_t n, int32_t *a)
{
    if (n > DMK_SHORT_LIST) {
        dmk_sort_long(n, a);
        return;
    }
    for (int32_t i = 1; i < n; i++) {
        int32_t x = a[i], k = i;
        for (; k > 0 && a[k - 1] > x; k--) a[k] = a[k - 1];
        a[k] = x;
    }
}

/* Whether one of n numbers in ascending order is x. */
static inline bool dmk_sorted_has(int32_t n, const int32_t *a, int32_t x)
{
    int32_t low = 0, high = n;
    while (low < high) {
        const int32_t mid = low + (high - low) / 2;
        if (a[mid] < x)
            low = mid + 1;
        else
            high = mid;
    }
    return low < n && a[low] == x;
}

#endif
