/* Sums over all ranks in an order that does not depend on them, and whole vectors. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

/* A run of parts: of the edges, the vertices or the elements. */
typedef struct run {
    const dmk_space *space;
    int32_t local; /* the local part with the own first item */
    int32_t whole; /* the whole mesh's part with its first item */
} run;

static int32_t parts(const dmk_share *s, int32_t items)
{
    return (items + s->part - 1) / s->part;
}

/* Parts of rank r. */
static int32_t parts_of(const dmk_share *s, const dmk_space *space, int r)
{
    return parts(s, space->bound[r + 1] - space->bound[r]);
}

/* The runs of a launch over rows or elements; returns their number. *whole: all parts. */
static int list_runs(const dmk_share *s, bool rows, run list[2], int32_t *whole)
{
    if (!rows) {
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

size_t dmk_share_most_parts(const dmk_share *s)
{
    run list[2];
    int32_t rows, elements;
    if (!s) return 0;
    list_runs(s, true, list, &rows);
    list_runs(s, false, list, &elements);
    return (size_t)dmk_max_i(rows, elements);
}

/* Own parts of the local sums, or everybody's to their slots in the whole: `mine` and `all` hold
 * rank by rank, quantity by quantity, run by run. */
typedef struct exchange {
    const run *list;
    int n, count;
    size_t item;
    int32_t stride;
    char *table; /* count * stride items: quantity k's part p at k * stride + p */
} exchange;

static size_t copy_rank(const dmk_share *s, const exchange *e, int r, bool out, char *packed)
{
    char *at = packed;
    for (int k = 0; k < e->count; k++) {
        for (int i = 0; i < e->n; i++) {
            const run *one = &e->list[i];
            int32_t first = out ? one->local : one->whole + one->space->bound[r] / s->part;
            size_t bytes = e->item * (size_t)parts_of(s, one->space, r);
            char *slot = e->table + e->item * ((size_t)k * (size_t)e->stride + (size_t)first);
            if (out)
                memcpy(at, slot, bytes);
            else
                memcpy(slot, at, bytes);
            at += bytes;
        }
    }
    return (size_t)(at - packed);
}

/* The sums of all ranks at their slots in `to`. */
static int gather_parts(dmk_context *ctx, dmk_share *s, const exchange *from, const exchange *to)
{
    int rc;
    size_t *bytes = NULL, sum = 0;
    char *mine = NULL, *all = NULL, *at;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)s->ranks.size));
    for (int r = 0; r < s->ranks.size; r++) {
        for (int i = 0; i < from->n; i++) {
            bytes[r] +=
                from->item * (size_t)from->count * (size_t)parts_of(s, from->list[i].space, r);
        }
        sum += bytes[r];
    }
    DMK_TRY(DMK_NEW(ctx, mine, bytes[s->ranks.rank]));
    DMK_TRY(DMK_NEW(ctx, all, sum));
    copy_rank(s, from, s->ranks.rank, true, mine);
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, mine, all, bytes)));
    at = all;
    for (int r = 0; r < s->ranks.size; r++) at += copy_rank(s, to, r, false, at);
    s->traffic.sums++;
    s->traffic.sum_bytes += (int64_t)bytes[s->ranks.rank];
done:
    free(bytes);
    free(mine);
    free(all);
    return rc;
}

int dmk_share_parts(dmk_context *ctx, dmk_share *s, bool rows, int count, const dmk_buffer *partial,
                    int32_t *n_parts)
{
    int rc;
    run list[2];
    int32_t whole;
    if (!s) return DMK_OK;
    exchange from = {.list = list, .count = count, .item = dmk_device_real(s->device, DMK_OUTER)};
    from.n = list_runs(s, rows, list, &whole);
    from.stride = *n_parts;
    exchange to = from;
    to.stride = whole;
    size_t local_bytes = from.item * (size_t)count * (size_t)from.stride;
    size_t whole_bytes = from.item * (size_t)count * (size_t)whole;
    DMK_TRY(DMK_NEW(ctx, from.table, local_bytes));
    DMK_TRY(DMK_NEW(ctx, to.table, whole_bytes));
    DMK_TRY(dmk_buffer_read(ctx, s->device, partial, 0, local_bytes, from.table));
    DMK_TRY(gather_parts(ctx, s, &from, &to));
    DMK_TRY(dmk_buffer_write(ctx, s->device, (dmk_buffer *)(uintptr_t)partial, 0, whole_bytes,
                             to.table));
    *n_parts = whole;
done:
    free(from.table);
    free(to.table);
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

int dmk_share_in_turn(dmk_context *ctx, dmk_share *s, double *sum,
                      void (*add)(void *data, double *sum), void *data)
{
    int rc = DMK_OK;
    if (!s) {
        add(data, sum);
        return DMK_OK;
    }
    for (int r = 0; r < s->ranks.size; r++) {
        if (r == s->ranks.rank) add(data, sum);
        DMK_TRY(dmk_ranks_spread_from(ctx, &s->ranks, r, sum, sizeof *sum));
    }
done:
    return rc;
}

int dmk_share_join(dmk_context *ctx, dmk_share *s, size_t n, size_t item, const void *own,
                   int32_t *n_all, void **all)
{
    int rc;
    const size_t size = (size_t)s->ranks.size;
    size_t *count = NULL, *bytes = NULL, sum = 0;
    DMK_TRY(DMK_NEW(ctx, count, size));
    DMK_TRY(DMK_NEW(ctx, bytes, size));
    for (size_t r = 0; r < size; r++) bytes[r] = sizeof n;
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, &n, count, bytes)));
    for (size_t r = 0; r < size; r++) {
        bytes[r] = item * count[r];
        sum += count[r];
    }
    DMK_TRY(dmk_alloc(ctx, "items of all ranks", sum, item, all));
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, own, *all, bytes)));
    *n_all = (int32_t)sum;
done:
    free(count);
    free(bytes);
    return rc;
}

/* ---- whole vectors --------------------------------------------------------------------------- */

static void take(const dmk_space *space, const double *whole, double *local)
{
    for (int32_t i = 0; i < space->n; i++) {
        if (space->whole[i] >= 0) local[i] = whole[space->whole[i]];
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

int dmk_share_give_vertices(dmk_context *ctx, dmk_share *s, const double *local, double *whole)
{
    return give(ctx, s, &s->vertex[0], local, whole);
}
