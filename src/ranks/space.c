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

int32_t dmk_space_slot(const dmk_space *s, int64_t whole)
{
    int32_t begin = 0, end = s->n_ghosts;
    if (dmk_space_owns(s, whole)) return s->at_first + (int32_t)(whole - s->first);
    while (begin < end) {
        const int32_t middle = begin + (end - begin) / 2;
        if (s->ghost[middle] < whole)
            begin = middle + 1;
        else
            end = middle;
    }
    if (begin == s->n_ghosts || s->ghost[begin] != whole) return -1;
    return begin < s->n_before ? begin : s->after + begin - s->n_before;
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
