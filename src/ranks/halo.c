/* Halos: who sends which items to whom, found once, and the exchanges of every operator
 * application. */
#include "ranks/post.h"

#include <stdlib.h>
#include <string.h>

int dmk_share_check(dmk_context *ctx, const dmk_share *share, int status)
{
    return dmk_ranks_check(ctx, &share->ranks, status);
}

/* ---- who needs what -------------------------------------------------------------------------- */

/* Items of all spaces as one list of numbers: those of space i behind those of the ones before. */
static int64_t first_of(const dmk_need *need, int i)
{
    int64_t sum = 0;
    for (int k = 0; k < i; k++) sum += need[k].space->n_whole;
    return sum;
}

/* Numbers and slots of what rank r owns and this one needs, from `to` on (or NULL: count). */
static int32_t list_needs(int n, const dmk_need *need, int r, int64_t *number, int32_t *slot)
{
    int32_t count = 0;
    for (int i = 0; i < n; i++) {
        const dmk_space *s = need[i].space;
        size_t g = dmk_count_below(need[i].ghost, need[i].n, s->bound[r]);
        for (; g < need[i].n && need[i].ghost[g] < s->bound[r + 1]; g++) {
            if (number) {
                number[count] = first_of(need, i) + need[i].ghost[g];
                slot[count] = need[i].offset + dmk_space_slot(s, need[i].ghost[g]);
            }
            count++;
        }
    }
    return count;
}

/* receive_count from the needs, send_count from everybody's receive_count. */
static int count_all(dmk_context *ctx, const dmk_share *share, int n, const dmk_need *need,
                     dmk_halo *halo)
{
    int rc;
    size_t size = (size_t)share->ranks.size, me = (size_t)share->ranks.rank;
    int32_t *all = NULL;
    DMK_TRY(DMK_NEW(ctx, halo->send_count, size));
    DMK_TRY(DMK_NEW(ctx, halo->receive_count, size));
    for (size_t r = 0; r < size; r++) {
        if (r == me) continue;
        halo->receive_count[r] = list_needs(n, need, (int)r, NULL, NULL);
        halo->n_receive += halo->receive_count[r];
    }
    DMK_TRY(dmk_gather_each(ctx, &share->ranks, size * sizeof *all, halo->receive_count,
                            (void **)&all));
    for (size_t r = 0; r < size; r++) {
        halo->send_count[r] = all[r * size + me];
        halo->n_send += halo->send_count[r];
    }
done:
    free(all);
    return rc;
}

/* Numbers that others asked for to slots. */
static void find_slots(int n, const dmk_need *need, int32_t count, const int64_t *number,
                       int32_t *slot)
{
    for (int32_t k = 0; k < count; k++) {
        int i = n - 1;
        while (number[k] < first_of(need, i)) i--;
        slot[k] = need[i].offset + dmk_space_slot(need[i].space, number[k] - first_of(need, i));
    }
}

/* Staging memory for two of the largest halo; on the host for what is sent and what comes, each as the device has it
 * and as the messages do. */
static int make_room(dmk_context *ctx, dmk_share *share, const dmk_halo *halo)
{
    int rc = DMK_OK;
    const size_t n = (size_t)dmk_max_i(halo->n_send, halo->n_receive),
                 bytes = DMK_PARCELS * n * sizeof(double);
    if (bytes <= share->staging_bytes) return DMK_OK;
    share->staging_bytes = 0;
    dmk_buffer_destroy(&share->staging);
    free(share->host);
    share->host = NULL;
    DMK_TRY(dmk_buffer_create(ctx, share->device, bytes, NULL, &share->staging));
    DMK_TRY(DMK_NEW(ctx, share->host, 4 * bytes));
    share->staging_bytes = bytes;
done:
    return rc;
}

int dmk_halo_create(dmk_context *ctx, dmk_share *share, int n, const dmk_need *need, dmk_halo *halo)
{
    int rc;
    int64_t *number = NULL, *asked = NULL;
    int32_t *slot = NULL, at = 0;
    DMK_TRY(count_all(ctx, share, n, need, halo));
    DMK_TRY(DMK_NEW(ctx, number, (size_t)halo->n_receive));
    DMK_TRY(DMK_NEW(ctx, slot, (size_t)dmk_max_i(halo->n_receive, halo->n_send)));
    DMK_TRY(DMK_NEW(ctx, asked, (size_t)halo->n_send));
    for (int r = 0; r < share->ranks.size; r++) {
        if (r != share->ranks.rank) at += list_needs(n, need, r, number + at, slot + at);
    }
    DMK_TRY(dmk_exchange(ctx, &share->ranks, halo->receive_count, halo->send_count, sizeof *number,
                         number, asked));
    DMK_TRY(dmk_buffer_create(ctx, share->device, (size_t)halo->n_receive * sizeof *slot, slot,
                              &halo->receive));
    find_slots(n, need, halo->n_send, asked, slot);
    DMK_TRY(dmk_buffer_create(ctx, share->device, (size_t)halo->n_send * sizeof *slot, slot,
                              &halo->send));
    DMK_TRY(make_room(ctx, share, halo));
done:
    free(number);
    free(slot);
    free(asked);
    return rc;
}

int dmk_halo_keep(dmk_context *ctx, const dmk_share *share, dmk_halo *halo)
{
    int rc;
    const size_t n[2] = {(size_t)halo->n_send, (size_t)halo->n_receive};
    DMK_TRY(DMK_NEW(ctx, halo->send_slot, n[0]));
    DMK_TRY(DMK_NEW(ctx, halo->receive_slot, n[1]));
    DMK_TRY(dmk_buffer_read(ctx, share->device, halo->send, 0, n[0] * sizeof *halo->send_slot,
                            halo->send_slot));
    DMK_TRY(dmk_buffer_read(ctx, share->device, halo->receive, 0, n[1] * sizeof *halo->receive_slot,
                            halo->receive_slot));
done:
    return rc;
}

void dmk_halo_free(dmk_halo *halo)
{
    free(halo->send_count);
    free(halo->receive_count);
    free(halo->send_slot);
    free(halo->receive_slot);
    dmk_buffer_destroy(&halo->send);
    dmk_buffer_destroy(&halo->receive);
    memset(halo, 0, sizeof *halo);
}

/* ---- an exchange ----------------------------------------------------------------------------- */

static dmk_range items(int32_t n)
{
    return (dmk_range){.items = (size_t)n};
}

/* Items of all vectors together that rank r gets, or gives. */
static int32_t count(const dmk_shipment *s, bool out, int r)
{
    int32_t n = 0;
    for (int i = 0; i < s->n; i++)
        n += out ? s->halo[i]->send_count[r] : s->halo[i]->receive_count[r];
    return n;
}

static int32_t count_ranks(const dmk_shipment *s, bool out)
{
    int32_t n = 0;
    for (int i = 0; i < s->n; i++) n += out ? s->halo[i]->n_send : s->halo[i]->n_receive;
    return n;
}

static bool is_empty(const dmk_shipment *s)
{
    return s->n == 0 || (count_ranks(s, true) == 0 && count_ranks(s, false) == 0);
}

static void count_traffic(const dmk_shipment *s, size_t item)
{
    dmk_traffic *t = &s->share->traffic;
    t->exchanges++;
    for (int r = 0; r < s->share->ranks.size; r++) {
        t->messages += count(s, true, r) > 0;
        t->bytes += (int64_t)item * count(s, true, r);
    }
}

/* The device has vector after vector, each by rank; a message has all of a rank's. */
static void sort(const dmk_shipment *s, bool out, size_t item, const char *from, char *to)
{
    size_t before = 0;
    for (int i = 0; i < s->n; i++) {
        const int32_t *n = out ? s->halo[i]->send_count : s->halo[i]->receive_count;
        size_t message = 0;
        for (int r = 0; r < s->share->ranks.size; r++) {
            size_t slot = message;
            for (int k = 0; k < i; k++)
                slot +=
                    item * (size_t)(out ? s->halo[k]->send_count : s->halo[k]->receive_count)[r];
            const size_t bytes = item * (size_t)n[r];
            memcpy(to + (out ? slot : before), from + (out ? before : slot), bytes);
            before += bytes;
            message += item * (size_t)count(s, out, r);
        }
    }
}

/* Where on the host what is sent (0) and received (1) lies, and both in the device's order (2, 3). */
static char *room(const dmk_shipment *s, int which)
{
    return s->share->host + (size_t)which * s->share->staging_bytes;
}

static int pack(dmk_context *ctx, const dmk_shipment *s, size_t item)
{
    int rc = DMK_OK;
    dmk_share *share = s->share;
    size_t at = 0;
    for (int i = 0; i < s->n; i++) {
        const dmk_halo *halo = s->halo[i];
        const size_t bytes = item * (size_t)halo->n_send;
        if (bytes == 0) continue;
        DMK_TRY(DMK_LAUNCH(ctx, share->device, share->pack[s->program], items(halo->n_send),
                           DMK_INT(halo->n_send), DMK_BUF(halo->send), DMK_BUF(s->x[i]),
                           DMK_BUF(share->staging)));
        DMK_TRY(dmk_buffer_read(ctx, share->device, share->staging, 0, bytes, room(s, 2) + at));
        at += bytes;
    }
    sort(s, true, item, room(s, 2), room(s, 0));
done:
    return rc;
}

static int unpack(dmk_context *ctx, const dmk_shipment *s, size_t item)
{
    int rc = DMK_OK;
    dmk_share *share = s->share;
    size_t at = 0;
    sort(s, false, item, room(s, 1), room(s, 3));
    for (int i = 0; i < s->n; i++) {
        const dmk_halo *halo = s->halo[i];
        const size_t bytes = item * (size_t)halo->n_receive;
        if (bytes == 0) continue;
        DMK_TRY(dmk_buffer_write(ctx, share->device, share->staging, 0, bytes, room(s, 3) + at));
        DMK_TRY(DMK_LAUNCH(ctx, share->device, share->unpack[s->program], items(halo->n_receive),
                           DMK_INT(halo->n_receive), DMK_BUF(halo->receive),
                           DMK_BUF(share->staging), DMK_BUF(s->x[i])));
        at += bytes;
    }
done:
    return rc;
}

/* All messages, by one call, or begin to send and receive them by another. */
static int transfer(dmk_context *ctx, const dmk_shipment *s, dmk_exchange_call *by, size_t item)
{
    int rc;
    const int size = s->share->ranks.size;
    int32_t *n = NULL;
    DMK_TRY(DMK_NEW(ctx, n, 2 * (size_t)size));
    for (int r = 0; r < size; r++) {
        n[r] = count(s, true, r);
        n[size + r] = count(s, false, r);
    }
    rc = dmk_exchange_by(by, ctx, &s->share->ranks, n, n + size, item, room(s, 0), room(s, 1));
done:
    free(n);
    return rc;
}

/* One packed message to each neighbour, one from each: from here on they are on their way, if ranks can do that. */
static int begin(dmk_context *ctx, const dmk_shipment *s)
{
    int rc = DMK_OK;
    if (is_empty(s)) return DMK_OK;
    const size_t item = dmk_device_real(s->share->device, s->program);
    DMK_TRY(pack(ctx, s, item));
    if (s->share->ranks.begin) rc = transfer(ctx, s, s->share->ranks.begin, item);
done:
    return rc;
}

/* Until they are there, and at their slots. */
static int end(dmk_context *ctx, const dmk_shipment *s, bool went_ahead)
{
    int rc = DMK_OK;
    dmk_share *share = s->share;
    if (is_empty(s)) return DMK_OK;
    const size_t item = dmk_device_real(share->device, s->program);
    if (went_ahead) DMK_TRY(dmk_device_flush(ctx, share->device));
    if (share->ranks.begin)
        DMK_TRY(dmk_share_check(ctx, share, share->ranks.finish(share->ranks.user)));
    else
        DMK_TRY(transfer(ctx, s, share->ranks.exchange, item));
    DMK_TRY(unpack(ctx, s, item));
    count_traffic(s, item);
    share->traffic.overlapped += went_ahead && share->ranks.begin;
done:
    return rc;
}

int dmk_send_begin(dmk_context *ctx, dmk_shipment shipment)
{
    return begin(ctx, &shipment);
}

int dmk_send_end(dmk_context *ctx, dmk_shipment shipment, bool went_ahead)
{
    return end(ctx, &shipment, went_ahead);
}

int dmk_send(dmk_context *ctx, dmk_shipment shipment)
{
    const int rc = begin(ctx, &shipment);
    return rc == DMK_OK ? end(ctx, &shipment, false) : rc;
}

int dmk_share_ghosts(dmk_context *ctx, dmk_share *share, double *x)
{
    int rc;
    if (!share) return DMK_OK;
    const dmk_halo *halo = &share->rows;
    double *send = (double *)(void *)share->host,
           *receive = send + share->staging_bytes / sizeof *send;
    for (int32_t i = 0; i < halo->n_send; i++) send[i] = x[halo->send_slot[i]];
    DMK_TRY(dmk_exchange(ctx, &share->ranks, halo->send_count, halo->receive_count, sizeof *x, send,
                         receive));
    for (int32_t i = 0; i < halo->n_receive; i++) x[halo->receive_slot[i]] = receive[i];
    count_traffic(&(dmk_shipment){share, DMK_OUTER, 1, {halo}, {NULL}}, sizeof *x);
done:
    return rc;
}

/* ---- what is shipped ------------------------------------------------------------------------- */

/* With one more vector. */
static dmk_shipment with(dmk_shipment s, const dmk_halo *halo, const dmk_buffer *x)
{
    s.halo[s.n] = halo;
    s.x[s.n++] = x;
    return s;
}

dmk_shipment dmk_ship_rows(dmk_share *share, dmk_program program, const dmk_buffer *x)
{
    const dmk_shipment none = {.share = share, .program = program};
    return share ? with(none, &share->rows, x) : none;
}

dmk_shipment dmk_ship_two_rows(dmk_share *share, dmk_program program, const dmk_buffer *x,
                               const dmk_buffer *y)
{
    const dmk_shipment one = dmk_ship_rows(share, program, x);
    return share ? with(one, &share->rows, y) : one;
}

dmk_shipment dmk_ship_up(dmk_share *share, const dmk_buffer *x, const dmk_buffer *coarse)
{
    const dmk_shipment one = dmk_ship_rows(share, DMK_INNER, x);
    return share ? with(one, &share->vertices[0], coarse) : one;
}

dmk_shipment dmk_ship_vertices(dmk_share *share, int32_t level, const dmk_buffer *x)
{
    const dmk_shipment none = {.share = share, .program = DMK_INNER};
    return share && level < share->first_whole ? with(none, &share->vertices[level], x) : none;
}

dmk_shipment dmk_ship_edge_weights(dmk_share *share, int32_t level, const dmk_buffer *edge)
{
    const dmk_shipment none = {.share = share, .program = DMK_INNER};
    return share && level <= share->first_whole ? with(none, &share->level_edges[level], edge)
                                                : none;
}

dmk_shipment dmk_ship_all(dmk_share *share, int32_t level, const dmk_buffer *x)
{
    const dmk_shipment none = {.share = share, .program = DMK_INNER};
    return share && level == share->first_whole ? with(none, &share->vertices[level], x) : none;
}
