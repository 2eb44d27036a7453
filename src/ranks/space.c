/* Local numbers of a rank's items. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

/* The next place that begins a part. */
static int32_t align(int32_t place, int32_t part)
{
    return (place + part - 1) / part * part;
}

static int32_t count_marks(const uint8_t *mark, int32_t begin, int32_t end)
{
    int32_t n = 0;
    for (int32_t i = begin; i < end; i++) n += mark[i] != 0;
    return n;
}

/* Places from `place` on for the items begin .. end - 1, all of them or the marked ones. */
static int32_t put(dmk_space *s, const uint8_t *mark, int32_t begin, int32_t end, int32_t place)
{
    for (int32_t i = begin; i < end; i++) {
        if (mark && !mark[i]) continue;
        s->whole[place] = i;
        s->at[i] = place++;
    }
    return place;
}

int dmk_space_create(dmk_context *ctx, const uint8_t *mark, int32_t part, int32_t spare,
                     dmk_space *s)
{
    int rc;
    int32_t before = count_marks(mark, 0, s->first), own = s->end - s->first;
    s->at_first = align(before, part);
    int32_t after = align(s->at_first + own, part);
    s->n = after + count_marks(mark, s->end, s->n_whole) + spare;
    DMK_TRY(DMK_NEW(ctx, s->whole, (size_t)s->n));
    DMK_TRY(DMK_NEW(ctx, s->at, (size_t)s->n_whole));
    for (int32_t i = 0; i < s->n; i++) s->whole[i] = -1;
    for (int32_t i = 0; i < s->n_whole; i++) s->at[i] = -1;
    put(s, mark, 0, s->first, 0);
    put(s, NULL, s->first, s->end, s->at_first);
    put(s, mark, s->end, s->n_whole, after);
done:
    return rc;
}

void dmk_space_free(dmk_space *s)
{
    free(s->whole);
    free(s->at);
    free(s->bound);
    memset(s, 0, sizeof *s);
}
