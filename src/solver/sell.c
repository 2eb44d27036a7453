#include "solver/sell.h"

#include "base/parallel.h"

#include "dmk_shared.h"

#include <stdlib.h>
#include <string.h>

typedef struct fill_job {
    int32_t n, filler;
    const int32_t *row, *entry;
    const float *weight;
    dmk_sell *sell;
} fill_job;

static void fill_range(int32_t begin, int32_t end, void *data)
{
    const fill_job *job = data;
    const dmk_sell *s = job->sell;
    for (int32_t i = DMK_WIDTH * begin; i < DMK_WIDTH * end; i++) {
        int32_t first = s->slice[i / DMK_WIDTH], columns = s->slice[i / DMK_WIDTH + 1] - first;
        int32_t at = i < job->n ? job->row[i] : 0, length = i < job->n ? job->row[i + 1] - at : 0;
        for (int32_t j = 0; j < columns; j++) {
            size_t slot = (size_t)(first + j) * DMK_WIDTH + (size_t)(i % DMK_WIDTH);
            s->entry[slot] = j < length ? job->entry[at + j] : job->filler < 0 ? i : job->filler;
            if (job->weight && j < length) s->weight[slot] = job->weight[at + j];
        }
    }
}

int dmk_sell_create(dmk_context *ctx, int32_t n, const int32_t *row, const int32_t *entry,
                    const float *weight, int32_t filler, dmk_sell *s)
{
    int rc;
    memset(s, 0, sizeof *s);
    s->n_slices = dmk_padded(n) / DMK_WIDTH;
    DMK_TRY(DMK_NEW(ctx, s->slice, (size_t)s->n_slices + 1));
    for (int32_t k = 0; k < s->n_slices; k++) {
        int32_t longest = 1;
        for (int32_t i = DMK_WIDTH * k; i < dmk_min_i(DMK_WIDTH * (k + 1), n); i++) {
            longest = dmk_max_i(longest, row[i + 1] - row[i]);
        }
        s->slice[k + 1] = s->slice[k] + longest;
    }
    size_t n_slots = (size_t)s->slice[s->n_slices] * DMK_WIDTH;
    DMK_TRY(DMK_NEW_UNSET(ctx, s->entry, n_slots));
    if (weight) DMK_TRY(DMK_NEW(ctx, s->weight, n_slots));
    fill_job job = {n, filler, row, entry, weight, s};
    dmk_parallel(ctx, s->n_slices, fill_range, &job);
done:
    if (rc != DMK_OK) dmk_sell_free(s);
    return rc;
}

void dmk_sell_free(dmk_sell *s)
{
    free(s->slice);
    free(s->entry);
    free(s->weight);
    memset(s, 0, sizeof *s);
}
