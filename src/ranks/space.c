/* Local numbers of a rank's items. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

/* The next slot that begins a part. */
static int32_t align(int32_t slot, int32_t part)
{
    return (slot + part - 1) / part * part;
}

int dmk_space_create(dmk_context *ctx, size_t n, const int64_t *ghost, int32_t part, int32_t spare,
                     dmk_space *s)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->ghost, n));
    if (n > 0) memcpy(s->ghost, ghost, n * sizeof *ghost);
    s->n_ghosts = (int32_t)n;
    s->n_before = 0;
    while (s->n_before < s->n_ghosts && ghost[s->n_before] < s->first) s->n_before++;
    s->at_first = align(s->n_before, part);
    s->after = align(s->at_first + dmk_space_own(s), part);
    s->n = s->after + s->n_ghosts - s->n_before + spare;
done:
    return rc;
}

size_t dmk_count_below(const int64_t *number, size_t n, int64_t x)
{
    size_t begin = 0;
    while (begin < n) {
        const size_t middle = begin + (n - begin) / 2;
        if (number[middle] < x)
            begin = middle + 1;
        else
            n = middle;
    }
    return begin;
}

int32_t dmk_space_slot(const dmk_space *s, int64_t whole)
{
    if (dmk_space_owns(s, whole)) return s->at_first + (int32_t)(whole - s->first);
    const int32_t i = (int32_t)dmk_count_below(s->ghost, (size_t)s->n_ghosts, whole);
    if (i == s->n_ghosts || s->ghost[i] != whole) return -1;
    return i < s->n_before ? i : s->after + i - s->n_before;
}

int64_t dmk_space_whole(const dmk_space *s, int32_t slot)
{
    if (slot < s->n_before) return s->ghost[slot];
    if (slot < s->at_first) return -1;
    if (slot - s->at_first < dmk_space_own(s)) return s->first + (slot - s->at_first);
    const int32_t ghost = slot - s->after + s->n_before;
    return slot < s->after || ghost >= s->n_ghosts ? -1 : s->ghost[ghost];
}

void dmk_space_free(dmk_space *s)
{
    free(s->ghost);
    free(s->bound);
    memset(s, 0, sizeof *s);
}
