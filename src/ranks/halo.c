/* Halos: who sends which items to whom, found once, and the exchanges of every operator
 * application. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

int dmk_share_check(dmk_context *ctx, const dmk_share *share, int status)
{
    return dmk_ranks_check(ctx, &share->ranks, status);
}

/* ---- who needs what -------------------------------------------------------------------------- */

/* Items of all spaces as one list of numbers: those of space i behind those of the ones before. */
static int32_t first_of(const dmk_need *need, int i)
{
    int32_t sum = 0;
    for (int k = 0; k < i; k++) sum += need[k].space->n_whole;
    return sum;
}

/* Numbers and places of what rank r owns and this one needs, from `to` on (or NULL: count). */
static int32_t list_needs(int n, const dmk_need *need, int r, int32_t *number, int32_t *place)
{
    int32_t count = 0;
    for (int i = 0; i < n; i++) {
        const dmk_space *s = need[i].space;
        if (s->bound[r] == s->first && s->bound[r + 1] == s->end) continue;
        for (int32_t g = s->bound[r]; g < s->bound[r + 1]; g++) {
            if (!need[i].mark[g]) continue;
            if (number) {
                number[count] = first_of(need, i) + g;
                place[count] = need[i].offset + s->at[g];
            }
            count++;
        }
    }
    return count;
}

/* receive_count from the marks, send_count from everybody's receive_count. */
static int count_all(dmk_context *ctx, const dmk_share *share, int n, const dmk_need *need,
                     dmk_halo *halo)
{
    int rc;
    size_t size = (size_t)share->ranks.size, me = (size_t)share->ranks.rank, *bytes = NULL;
    int32_t *all = NULL;
    DMK_TRY(DMK_NEW(ctx, halo->send_count, size));
    DMK_TRY(DMK_NEW(ctx, halo->receive_count, size));
    DMK_TRY(DMK_NEW(ctx, all, size * size));
    DMK_TRY(DMK_NEW(ctx, bytes, size));
    for (size_t r = 0; r < size; r++) {
        bytes[r] = size * sizeof *all;
        if (r == me) continue;
        halo->receive_count[r] = list_needs(n, need, (int)r, NULL, NULL);
        halo->n_receive += halo->receive_count[r];
    }
    DMK_TRY(dmk_share_check(
        ctx, share, share->ranks.gather(share->ranks.user, halo->receive_count, all, bytes)));
    for (size_t r = 0; r < size; r++) {
        halo->send_count[r] = all[r * size + me];
        halo->n_send += halo->send_count[r];
    }
done:
    free(all);
    free(bytes);
    return rc;
}

typedef int call(void *user, const void *const *send, const size_t *send_bytes,
                 void *const *receive, const size_t *receive_bytes);

/* Send and receive `item` bytes for each item of the halo (back: the other way round), or begin to. */
static int exchange_by(call *by, dmk_context *ctx, const dmk_share *share, const dmk_halo *halo,
                       bool back, size_t item, const void *send, void *receive)
{
    int rc;
    size_t size = (size_t)share->ranks.size, at_send = 0, at_receive = 0;
    const int32_t *out = back ? halo->receive_count : halo->send_count;
    const int32_t *in = back ? halo->send_count : halo->receive_count;
    const void **sends = NULL;
    void **receives = NULL;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, sends, size));
    DMK_TRY(DMK_NEW(ctx, receives, size));
    DMK_TRY(DMK_NEW(ctx, bytes, 2 * size));
    for (size_t r = 0; r < size; r++) {
        sends[r] = (const char *)send + at_send;
        receives[r] = (char *)receive + at_receive;
        at_send += bytes[r] = item * (size_t)out[r];
        at_receive += bytes[size + r] = item * (size_t)in[r];
    }
    DMK_TRY(
        dmk_share_check(ctx, share, by(share->ranks.user, sends, bytes, receives, bytes + size)));
done:
    free(sends);
    free(receives);
    free(bytes);
    return rc;
}

static int exchange(dmk_context *ctx, const dmk_share *share, const dmk_halo *halo, bool back,
                    size_t item, const void *send, void *receive)
{
    return exchange_by(share->ranks.exchange, ctx, share, halo, back, item, send, receive);
}

/* Numbers that others asked for to places. */
static void find_places(int n, const dmk_need *need, int32_t count, const int32_t *number,
                        int32_t *place)
{
    for (int32_t k = 0; k < count; k++) {
        int i = n - 1;
        while (number[k] < first_of(need, i)) i--;
        place[k] = need[i].offset + need[i].space->at[number[k] - first_of(need, i)];
    }
}

/* Staging memory for the largest halo. */
static int make_room(dmk_context *ctx, dmk_share *share, const dmk_halo *halo)
{
    int rc = DMK_OK;
    size_t n = (size_t)dmk_max_i(halo->n_send, halo->n_receive), bytes = n * sizeof(double);
    if (bytes <= share->staging_bytes) return DMK_OK;
    share->staging_bytes = 0;
    dmk_buffer_destroy(&share->staging);
    free(share->host);
    share->host = NULL;
    DMK_TRY(dmk_buffer_create(ctx, share->device, bytes, NULL, &share->staging));
    DMK_TRY(DMK_NEW(ctx, share->host, 2 * bytes));
    share->staging_bytes = bytes;
done:
    return rc;
}

int dmk_halo_create(dmk_context *ctx, dmk_share *share, int n, const dmk_need *need, dmk_halo *halo)
{
    int rc;
    int32_t *number = NULL, *place = NULL, *asked = NULL, at = 0;
    DMK_TRY(count_all(ctx, share, n, need, halo));
    DMK_TRY(DMK_NEW(ctx, number, (size_t)halo->n_receive));
    DMK_TRY(DMK_NEW(ctx, place, (size_t)dmk_max_i(halo->n_receive, halo->n_send)));
    DMK_TRY(DMK_NEW(ctx, asked, (size_t)halo->n_send));
    for (int r = 0; r < share->ranks.size; r++) {
        if (r != share->ranks.rank) at += list_needs(n, need, r, number + at, place + at);
    }
    DMK_TRY(exchange(ctx, share, halo, true, sizeof *number, number, asked));
    DMK_TRY(dmk_buffer_create(ctx, share->device, (size_t)halo->n_receive * sizeof *place, place,
                              &halo->receive));
    find_places(n, need, halo->n_send, asked, place);
    DMK_TRY(dmk_buffer_create(ctx, share->device, (size_t)halo->n_send * sizeof *place, place,
                              &halo->send));
    DMK_TRY(make_room(ctx, share, halo));
done:
    free(number);
    free(place);
    free(asked);
    return rc;
}

int dmk_halo_keep(dmk_context *ctx, const dmk_share *share, dmk_halo *halo)
{
    int rc;
    const size_t n[2] = {(size_t)halo->n_send, (size_t)halo->n_receive};
    DMK_TRY(DMK_NEW(ctx, halo->send_place, n[0]));
    DMK_TRY(DMK_NEW(ctx, halo->receive_place, n[1]));
    DMK_TRY(dmk_buffer_read(ctx, share->device, halo->send, 0, n[0] * sizeof *halo->send_place,
                            halo->send_place));
    DMK_TRY(dmk_buffer_read(ctx, share->device, halo->receive, 0,
                            n[1] * sizeof *halo->receive_place, halo->receive_place));
done:
    return rc;
}

void dmk_halo_free(dmk_halo *halo)
{
    free(halo->send_count);
    free(halo->receive_count);
    free(halo->send_place);
    free(halo->receive_place);
    dmk_buffer_destroy(&halo->send);
    dmk_buffer_destroy(&halo->receive);
    memset(halo, 0, sizeof *halo);
}

/* ---- an exchange ----------------------------------------------------------------------------- */

static dmk_range items(int32_t n)
{
    return (dmk_range){.items = (size_t)n};
}

static void count_traffic(dmk_share *share, const dmk_halo *halo, size_t item)
{
    share->traffic.exchanges++;
    for (int r = 0; r < share->ranks.size; r++) {
        share->traffic.messages += halo->send_count[r] > 0;
        share->traffic.bytes += (int64_t)item * halo->send_count[r];
    }
}

static bool is_empty(const dmk_halo *halo)
{
    return halo->n_send == 0 && halo->n_receive == 0;
}

/* One packed message to each neighbour, one from each: from here on they are on their way, if ranks can do that. */
static int begin(dmk_context *ctx, dmk_share *share, const dmk_halo *halo, dmk_program program,
                 const dmk_buffer *x)
{
    int rc = DMK_OK;
    dmk_device *dev = share->device;
    const size_t item = dmk_device_real(dev, program), sent = item * (size_t)halo->n_send;
    char *send = share->host, *receive = share->host + share->staging_bytes;
    if (is_empty(halo)) return DMK_OK;
    if (sent > 0) {
        DMK_TRY(DMK_LAUNCH(ctx, dev, share->pack[program], items(halo->n_send),
                           DMK_INT(halo->n_send), DMK_BUF(halo->send), DMK_BUF(x),
                           DMK_BUF(share->staging)));
        DMK_TRY(dmk_buffer_read(ctx, dev, share->staging, 0, sent, send));
    }
    if (share->ranks.begin)
        rc = exchange_by(share->ranks.begin, ctx, share, halo, false, item, send, receive);
done:
    return rc;
}

/* Until they are there, and at their places. */
static int end(dmk_context *ctx, dmk_share *share, const dmk_halo *halo, dmk_program program,
               const dmk_buffer *x, bool went_ahead)
{
    int rc = DMK_OK;
    dmk_device *dev = share->device;
    const size_t item = dmk_device_real(dev, program), received = item * (size_t)halo->n_receive;
    char *send = share->host, *receive = share->host + share->staging_bytes;
    if (is_empty(halo)) return DMK_OK;
    if (went_ahead) DMK_TRY(dmk_device_flush(ctx, dev));
    if (share->ranks.begin)
        DMK_TRY(dmk_share_check(ctx, share, share->ranks.finish(share->ranks.user)));
    else
        DMK_TRY(exchange(ctx, share, halo, false, item, send, receive));
    if (received > 0) {
        DMK_TRY(dmk_buffer_write(ctx, dev, share->staging, 0, received, receive));
        DMK_TRY(DMK_LAUNCH(ctx, dev, share->unpack[program], items(halo->n_receive),
                           DMK_INT(halo->n_receive), DMK_BUF(halo->receive),
                           DMK_BUF(share->staging), DMK_BUF(x)));
    }
    count_traffic(share, halo, item);
    share->traffic.overlapped += went_ahead && share->ranks.begin;
done:
    return rc;
}

static int fill(dmk_context *ctx, dmk_share *share, const dmk_halo *halo, dmk_program program,
                const dmk_buffer *x)
{
    const int rc = begin(ctx, share, halo, program, x);
    return rc == DMK_OK ? end(ctx, share, halo, program, x, false) : rc;
}

int dmk_share_ghosts(dmk_context *ctx, dmk_share *share, double *x)
{
    int rc;
    if (!share) return DMK_OK;
    const dmk_halo *halo = &share->rows;
    double *send = (double *)(void *)share->host,
           *receive = send + share->staging_bytes / sizeof *send;
    for (int32_t i = 0; i < halo->n_send; i++) send[i] = x[halo->send_place[i]];
    DMK_TRY(exchange(ctx, share, halo, false, sizeof *x, send, receive));
    for (int32_t i = 0; i < halo->n_receive; i++) x[halo->receive_place[i]] = receive[i];
    count_traffic(share, halo, sizeof *x);
done:
    return rc;
}

int dmk_share_rows_begin(dmk_context *ctx, dmk_share *share, dmk_program program,
                         const dmk_buffer *x)
{
    return share ? begin(ctx, share, &share->rows, program, x) : DMK_OK;
}

int dmk_share_rows_end(dmk_context *ctx, dmk_share *share, dmk_program program, const dmk_buffer *x,
                       bool went_ahead)
{
    return share ? end(ctx, share, &share->rows, program, x, went_ahead) : DMK_OK;
}

int dmk_share_rows(dmk_context *ctx, dmk_share *share, dmk_program program, const dmk_buffer *x)
{
    return share ? fill(ctx, share, &share->rows, program, x) : DMK_OK;
}

int dmk_share_vertices_begin(dmk_context *ctx, dmk_share *share, int32_t level, const dmk_buffer *x)
{
    if (!share || level >= share->first_whole) return DMK_OK;
    return begin(ctx, share, &share->vertices[level], DMK_INNER, x);
}

int dmk_share_vertices_end(dmk_context *ctx, dmk_share *share, int32_t level, const dmk_buffer *x,
                           bool went_ahead)
{
    if (!share || level >= share->first_whole) return DMK_OK;
    return end(ctx, share, &share->vertices[level], DMK_INNER, x, went_ahead);
}

int dmk_share_vertices(dmk_context *ctx, dmk_share *share, int32_t level, const dmk_buffer *x)
{
    if (!share || level >= share->first_whole) return DMK_OK;
    return fill(ctx, share, &share->vertices[level], DMK_INNER, x);
}

int dmk_share_gather(dmk_context *ctx, dmk_share *share, int32_t level, const dmk_buffer *x)
{
    if (!share || level != share->first_whole) return DMK_OK;
    return fill(ctx, share, &share->vertices[level], DMK_INNER, x);
}

int dmk_share_links(dmk_context *ctx, dmk_share *share, int32_t level, const dmk_buffer *link)
{
    if (!share || level > share->first_whole) return DMK_OK;
    return fill(ctx, share, &share->links[level], DMK_INNER, link);
}
