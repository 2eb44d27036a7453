/* Sums over all ranks in an order that does not depend on them, and whole vectors. */
#include "ranks/post.h"

#include "dmk_shared.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A run of parts: of the edges, the vertices or the elements. */
typedef struct run {
    const dmk_space *space;
    int32_t local; /* the local part with the own first item */
    int32_t whole; /* the whole mesh's part with its first item */
} run;

static int32_t parts(const dmk_share *s, int64_t items)
{
    return (int32_t)((items + s->part - 1) / s->part);
}

/* Parts of rank r. */
static int32_t parts_of(const dmk_share *s, const dmk_space *space, int r)
{
    return parts(s, space->bound[r + 1] - space->bound[r]);
}

/* The runs of a launch; returns their number. *whole: all parts. */
static int list_runs(const dmk_share *s, dmk_items items, run list[2], int32_t *whole)
{
    if (items == DMK_VERTICES) {
        list[0] = (run){&s->vertex[0], s->vertex[0].at_first / s->part, 0};
        *whole = parts(s, s->vertex[0].n_whole);
        return 1;
    }
    if (items == DMK_ELEMENTS) {
        list[0] = (run){&s->element, s->element.at_first / s->part, 0};
        *whole = parts(s, s->element.n_whole);
        return 1;
    }
    /* Behind the edges there is at least one row that stays 0. */
    int32_t edges = parts(s, s->edge.n_whole + 1);
    list[0] = (run){&s->edge, s->edge.at_first / s->part, 0};
    list[1] = (run){&s->vertex[0], (s->vertex_row + s->vertex[0].at_first) / s->part, edges};
    *whole = edges + parts(s, s->vertex[0].n_whole);
    return 2;
}

/* Sums of one launch on their way. A rank's message has quantity by quantity, run by run, the sums of the blocks that
 * are its own, and the parts of those that it has with others. */
typedef struct passing {
    const run *list;
    int n, count, maxima;
    size_t item;
    int32_t block, n_blocks; /* parts of a block; blocks of the whole */
} passing;

static passing find_passing(const dmk_share *s, dmk_items items, run list[2])
{
    int32_t whole;
    passing p = {.list = list, .count = 1, .item = dmk_device_real(s->device, DMK_OUTER)};
    p.n = list_runs(s, items, list, &whole);
    p.block = whole > DMK_SUM_SHORT ? DMK_SUM_BLOCK : 1;
    p.n_blocks = (whole + p.block - 1) / p.block;
    return p;
}

size_t dmk_share_most_parts(const dmk_share *s)
{
    run list[2];
    if (!s) return 0;
    return (size_t)dmk_max_i(find_passing(s, DMK_ROWS, list).n_blocks,
                             find_passing(s, DMK_ELEMENTS, list).n_blocks);
}

/* Whether a block begins at part i, and ends before `end`. */
static bool has_block(const passing *p, int32_t i, int32_t end)
{
    return i % p->block == 0 && end - i >= p->block;
}

/* Rank r's parts of a run in the whole. */
static int32_t first_part(const dmk_share *s, const run *one, int r)
{
    return one->whole + (int32_t)(one->space->bound[r] / s->part);
}

static int32_t end_part(const dmk_share *s, const run *one, int r)
{
    return first_part(s, one, r) + parts_of(s, one->space, r);
}

/* Numbers of a run in rank r's message. */
static size_t count_run(const dmk_share *s, const passing *p, const run *one, int r)
{
    size_t n = 0;
    const int32_t end = end_part(s, one, r);
    for (int32_t i = first_part(s, one, r); i < end; n++) i += has_block(p, i, end) ? p->block : 1;
    return n;
}

/* One more for a sum, or a maximum of numbers from 0 on; either begins at 0. */
static void add_number(const passing *p, bool top, const char *more, char *sum)
{
    if (p->item == sizeof(double)) {
        double x, y;
        memcpy(&x, more, sizeof x);
        memcpy(&y, sum, sizeof y);
        y = top ? fmax(y, x) : y + x;
        memcpy(sum, &y, sizeof y);
    } else {
        float x, y;
        memcpy(&x, more, sizeof x);
        memcpy(&y, sum, sizeof y);
        y = top ? fmaxf(y, x) : y + x;
        memcpy(sum, &y, sizeof y);
    }
}

static bool is_maximum(const passing *p, int k)
{
    return k >= p->count - p->maxima;
}

/* The own message from the launch's sums, `stride` of them for each quantity. */
static void fill_message(const dmk_share *s, const passing *p, const char *table, size_t stride,
                         char *message)
{
    for (int k = 0; k < p->count; k++) {
        for (int j = 0; j < p->n; j++) {
            const run *one = &p->list[j];
            const char *at = table + p->item * ((size_t)k * stride + (size_t)one->local);
            const int32_t end = end_part(s, one, s->ranks.rank);
            for (int32_t i = first_part(s, one, s->ranks.rank); i < end; message += p->item) {
                const int32_t n = has_block(p, i, end) ? p->block : 1;
                if (n == 1) memcpy(message, at, p->item);
                for (int32_t g = 0; n > 1 && g < n; g++)
                    add_number(p, is_maximum(p, k), at + p->item * (size_t)g, message);
                at += p->item * (size_t)n;
                i += n;
            }
        }
    }
}

/* Rank r's numbers of one quantity and run to the blocks; those before it have come. */
static void join_message(const dmk_share *s, const passing *p, int k, const run *one, int r,
                         const char *message, char *blocks)
{
    const int32_t end = end_part(s, one, r);
    for (int32_t i = first_part(s, one, r); i < end; message += p->item) {
        char *sum = blocks + p->item * (size_t)(i / p->block);
        const int32_t n = has_block(p, i, end) ? p->block : 1;
        if (n == p->block)
            memcpy(sum, message, p->item);
        else
            add_number(p, is_maximum(p, k), message, sum);
        i += n;
    }
}

/* All ranks' messages, and from them the blocks of the whole, quantity by quantity. */
static int gather_parts(dmk_context *ctx, dmk_share *s, const passing *p, const char *table,
                        size_t stride, char *blocks)
{
    int rc;
    const size_t size = (size_t)s->ranks.size;
    size_t *bytes = NULL, *length = NULL, sum = 0;
    char *mine = NULL, *all = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, size));
    DMK_TRY(DMK_NEW(ctx, length, 2 * size)); /* of a run, in numbers */
    for (int r = 0; r < s->ranks.size; r++) {
        size_t *own = length + 2 * r;
        for (int j = 0; j < p->n; j++) own[j] = count_run(s, p, &p->list[j], r);
        bytes[r] = p->item * (size_t)p->count * (own[0] + own[1]);
        sum += bytes[r];
    }
    DMK_TRY(DMK_NEW(ctx, mine, bytes[s->ranks.rank]));
    DMK_TRY(DMK_NEW(ctx, all, sum));
    fill_message(s, p, table, stride, mine);
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, mine, all, bytes)));
    for (int k = 0; k < p->count; k++) {
        for (int j = 0; j < p->n; j++) {
            const char *message = all;
            for (int r = 0; r < s->ranks.size; message += bytes[r++]) {
                const size_t *own = length + 2 * r,
                             before = (size_t)k * (own[0] + own[1]) + (j > 0 ? own[0] : 0);
                join_message(s, p, k, &p->list[j], r, message + p->item * before,
                             blocks + p->item * (size_t)k * (size_t)p->n_blocks);
            }
        }
    }
    s->traffic.sums++;
    s->traffic.sum_bytes += (int64_t)bytes[s->ranks.rank];
done:
    free(bytes);
    free(length);
    free(mine);
    free(all);
    return rc;
}

int dmk_share_parts(dmk_context *ctx, dmk_share *s, dmk_items items, int count, int maxima,
                    dmk_buffer *partial, int32_t *n_parts)
{
    int rc;
    run list[2];
    char *table = NULL, *blocks = NULL;
    if (!s) return DMK_OK;
    passing p = find_passing(s, items, list);
    p.count = count;
    p.maxima = maxima;
    const size_t stride = (size_t)*n_parts, table_bytes = p.item * (size_t)count * stride,
                 block_bytes = p.item * (size_t)count * (size_t)p.n_blocks;
    DMK_TRY(DMK_NEW(ctx, table, table_bytes));
    DMK_TRY(DMK_NEW(ctx, blocks, block_bytes));
    DMK_TRY(dmk_buffer_read(ctx, s->device, partial, 0, table_bytes, table));
    DMK_TRY(gather_parts(ctx, s, &p, table, stride, blocks));
    DMK_TRY(dmk_buffer_write(ctx, s->device, partial, 0, block_bytes, blocks));
    *n_parts = p.n_blocks;
done:
    free(table);
    free(blocks);
    return rc;
}

int dmk_share_largest(dmk_context *ctx, dmk_share *s, size_t n, int32_t *value)
{
    if (!s) return DMK_OK;
    return dmk_share_check(ctx, s, s->ranks.largest(s->ranks.user, value, n));
}

int dmk_share_flag(dmk_context *ctx, dmk_share *s, dmk_buffer *buffer, int32_t i)
{
    int rc;
    int32_t value;
    size_t at = (size_t)i * sizeof value;
    if (!s) return DMK_OK;
    DMK_TRY(dmk_buffer_read(ctx, s->device, buffer, at, sizeof value, &value));
    DMK_TRY(dmk_share_largest(ctx, s, 1, &value));
    DMK_TRY(dmk_buffer_write(ctx, s->device, buffer, at, sizeof value, &value));
done:
    return rc;
}

int dmk_ranks_spread_from(dmk_context *ctx, const dmk_ranks *ranks, int from, void *data,
                          size_t bytes)
{
    int rc;
    const bool sends = ranks->rank == from;
    const void **send = NULL;
    void **receive = NULL;
    size_t *count = NULL;
    if (ranks->size < 2) return DMK_OK;
    const size_t size = (size_t)ranks->size;
    DMK_TRY(DMK_NEW(ctx, send, size));
    DMK_TRY(DMK_NEW(ctx, receive, size));
    DMK_TRY(DMK_NEW(ctx, count, 2 * size));
    for (int r = 0; r < ranks->size; r++) {
        send[r] = receive[r] = data;
        count[r] = sends && r != from ? bytes : 0;
    }
    count[size + (size_t)from] = sends ? 0 : bytes;
    DMK_TRY(dmk_ranks_check(ctx, ranks,
                            ranks->exchange(ranks->user, send, count, receive, count + size)));
done:
    free(send);
    free(receive);
    free(count);
    return rc;
}

int dmk_ranks_spread(dmk_context *ctx, const dmk_ranks *ranks, void *data, size_t bytes)
{
    return dmk_ranks_spread_from(ctx, ranks, 0, data, bytes);
}

int dmk_ranks_in_turn(dmk_context *ctx, const dmk_ranks *ranks, double *sum,
                      void (*add)(void *data, double *sum), void *data)
{
    int rc = DMK_OK;
    for (int r = 0; r < ranks->size; r++) {
        if (r == ranks->rank) add(data, sum);
        DMK_TRY(dmk_ranks_spread_from(ctx, ranks, r, sum, sizeof *sum));
    }
done:
    return rc;
}

int dmk_share_in_turn(dmk_context *ctx, dmk_share *s, double *sum,
                      void (*add)(void *data, double *sum), void *data)
{
    if (s) return dmk_ranks_in_turn(ctx, &s->ranks, sum, add, data);
    add(data, sum);
    return DMK_OK;
}

int dmk_share_join(dmk_context *ctx, dmk_share *s, size_t n, size_t item, const void *own,
                   int32_t *n_all, void **all)
{
    size_t sum = 0;
    const int rc = dmk_join_some(ctx, &s->ranks, n, item, own, &sum, all);
    *n_all = (int32_t)sum;
    return rc;
}

/* ---- whole vectors --------------------------------------------------------------------------- */

static void take(const dmk_space *space, const double *whole, double *local)
{
    for (int32_t i = 0; i < space->n; i++) {
        const int64_t from = dmk_space_whole(space, i);
        if (from >= 0) local[i] = whole[from];
    }
}

void dmk_share_take(const dmk_share *s, bool rows, int32_t vertex_row, const double *whole,
                    double *local)
{
    if (!rows) {
        take(&s->element, whole, local);
        return;
    }
    take(&s->edge, whole, local);
    take(&s->vertex[0], whole + vertex_row, local + s->vertex_row);
}

/* Everybody's own items, which follow each other. */
static int give(dmk_context *ctx, const dmk_share *s, const dmk_space *space, const double *local,
                double *whole)
{
    int rc;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)s->ranks.size));
    for (int r = 0; r < s->ranks.size; r++) {
        bytes[r] = (size_t)(space->bound[r + 1] - space->bound[r]) * sizeof *whole;
    }
    DMK_TRY(dmk_share_check(ctx, s,
                            s->ranks.gather(s->ranks.user, local + space->at_first, whole, bytes)));
done:
    free(bytes);
    return rc;
}

int dmk_share_give(dmk_context *ctx, dmk_share *s, bool rows, int32_t vertex_row,
                   const double *local, double *whole)
{
    int rc;
    if (!rows) return give(ctx, s, &s->element, local, whole);
    DMK_TRY(give(ctx, s, &s->edge, local, whole));
    DMK_TRY(give(ctx, s, &s->vertex[0], local + s->vertex_row, whole + vertex_row));
done:
    return rc;
}
