#include "base/heap.h"

#include <stdlib.h>
#include <string.h>

static bool before(dmk_heap_item a, dmk_heap_item b)
{
    return a.key < b.key || (a.key == b.key && a.item < b.item);
}

int dmk_heap_push(dmk_context *ctx, dmk_heap *h, double key, int32_t item)
{
    if (h->n == h->capacity) {
        int rc = DMK_GROW(ctx, h->at, h->n + 1, h->capacity);
        if (rc != DMK_OK) return rc;
    }
    dmk_heap_item x = {key, item};
    size_t i = h->n++;
    for (; i > 0 && before(x, h->at[(i - 1) / 2]); i = (i - 1) / 2) h->at[i] = h->at[(i - 1) / 2];
    h->at[i] = x;
    return DMK_OK;
}

dmk_heap_item dmk_heap_pop(dmk_heap *h)
{
    dmk_heap_item *q = h->at, first = q[0], last = q[--h->n];
    size_t i = 0;
    for (size_t c = 1; c < h->n; c = 2 * i + 1) {
        if (c + 1 < h->n && before(q[c + 1], q[c])) c++;
        if (!before(q[c], last)) break;
        q[i] = q[c];
        i = c;
    }
    q[i] = last;
    return first;
}

void dmk_heap_free(dmk_heap *h)
{
    free(h->at);
    memset(h, 0, sizeof *h);
}
