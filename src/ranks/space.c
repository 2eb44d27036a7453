/* Local numbers of a rank's items. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

/* The next slot that begins a part. */
static int32_t align(int32_t slot, int32_t part)
{
    return (slot + part - 1) / part * part;
}

static int32_t count_marks(const uint8_t *mark, int32_t begin, int32_t end)
{
    int32_t n = 0;
    for (int32_t i = begin; i < end; i++) n += mark[i] != 0;
    return n;
}

/* Slots from `slot` on for the items begin .. end - 1, all of them or the marked ones. */
static int32_t put(dmk_space *s, const uint8_t *mark, int32_t begin, int32_t end, int32_t slot)
{
    for (int32_t i = begin; i < end; i++) {
        if (mark && !mark[i]) continue;
        s->whole[slot++] = i;
    }
    return slot;
}

int dmk_space_create(dmk_context *ctx, const uint8_t *mark, int32_t part, int32_t spare,
                     dmk_space *s)
{
    int rc;
    int32_t before = count_marks(mark, 0, s->first), own = s->end - s->first;
    s->at_first = align(before, part);
    const int32_t after = s->after = align(s->at_first + own, part);
    s->n = after + count_marks(mark, s->end, s->n_whole) + spare;
    DMK_TRY(DMK_NEW(ctx, s->whole, (size_t)s->n));
    for (int32_t i = 0; i < s->n; i++) s->whole[i] = -1;
    put(s, mark, 0, s->first, 0);
    put(s, NULL, s->first, s->end, s->at_first);
    put(s, mark, s->end, s->n_whole, after);
done:
    return rc;
}

/* Where ghosts lie from `begin` on, before the first gap or `end`. */
static int32_t search(const dmk_space *s, int32_t begin, int32_t end, int32_t whole)
{
    while (begin < end) {
        const int32_t middle = begin + (end - begin) / 2, there = s->whole[middle];
        if (there == whole) return middle;
        if (there >= 0 && there < whole)
            begin = middle + 1;
        else
            end = middle;
    }
    return -1;
}

int32_t dmk_space_slot(const dmk_space *s, int32_t whole)
{
    if (dmk_space_owns(s, whole)) return s->at_first + whole - s->first;
    if (whole < s->first) return search(s, 0, s->at_first, whole);
    return search(s, s->after, s->n, whole);
}

void dmk_space_free(dmk_space *s)
{
    free(s->whole);
    free(s->bound);
    memset(s, 0, sizeof *s);
}
