/* A heap of numbered keys, the least first; equal keys by number. */
#ifndef DMK_HEAP_H
#define DMK_HEAP_H

#include "base/base.h"

typedef struct dmk_heap_item {
    double key;
    int32_t item;
} dmk_heap_item;

typedef struct dmk_heap {
    dmk_heap_item *at;
    size_t n, capacity;
} dmk_heap;

int dmk_heap_push(dmk_context *context, dmk_heap *heap, double key, int32_t item);
/* From a heap that is not empty. */
dmk_heap_item dmk_heap_pop(dmk_heap *heap);
void dmk_heap_free(dmk_heap *heap);

#endif
