/* Items sorted by integer keys; numbers. */
#ifndef DMK_SORT_H
#define DMK_SORT_H

#include "base/base.h"

typedef struct dmk_keyed {
    uint64_t key;
    int32_t item;
} dmk_keyed;

enum { DMK_KEY_BITS = 48 };

/* Stable sort by the low DMK_KEY_BITS bits of the keys, in time linear in n. */
int dmk_sort_keyed(dmk_context *context, dmk_keyed *a, size_t n);

void dmk_sort_doubles(double *a, size_t n);

#endif
