/* The last rank's hierarchy to all: to each its part of the levels that are dealt out, and all of the others. */
#include "ranks/ranks.h"

#include "ranks/deal.h"

#include <stdlib.h>
#include <string.h>

/* What goes to one rank, or comes from the last one: counted first, then copied. */
typedef struct parcel {
    enum { COUNTED, GIVEN, TAKEN } state;
    char *data;
    size_t at, bytes;
} parcel;

/* Items begin .. end - 1 of an array of `room` items, which the taker makes. */
static int carry(dmk_context *ctx, parcel *p, size_t item, size_t begin, size_t end, size_t room,
                 void **array)
{
    int rc = DMK_OK;
    const size_t bytes = (end - begin) * item;
    if (p->state == TAKEN) {
        if (!*array) DMK_TRY(dmk_alloc(ctx, "levels", room, item, array));
        if (p->at + bytes > p->bytes)
            return dmk_fail(ctx, DMK_E_DEVICE, "the last rank's levels have come in part only");
        memcpy((char *)*array + begin * item, p->data + p->at, bytes);
    } else if (p->state == GIVEN) {
        memcpy(p->data + p->at, (const char *)*array + begin * item, bytes);
    }
    p->at += bytes;
done:
    return rc;
}

static int carry_number(dmk_context *ctx, parcel *p, int32_t *number)
{
    void *at = number;
    return carry(ctx, p, sizeof *number, 0, 1, 1, &at);
}

#define CARRY(array, begin, end, room)                                                             \
    carry(ctx, p, sizeof *(array), (size_t)(begin), (size_t)(end), (size_t)(room),                 \
          (void **)&(array))

/* The rows begin .. end - 1 of a table with their entries, which keep their places. */
static int carry_rows(dmk_context *ctx, parcel *p, int32_t begin, int32_t end, int32_t n,
                      int32_t **row, int32_t **entry, float **value)
{
    int rc;
    DMK_TRY(CARRY(*row, begin, end + 1, n + 1));
    const int32_t from = (*row)[begin], to = (*row)[end];
    DMK_TRY(CARRY(*entry, from, to, to));
    DMK_TRY(CARRY(*value, from, to, to));
done:
    return rc;
}

/* The step from `fine` on, rank r's part if it is dealt out. */
static int carry_tables(dmk_context *ctx, parcel *p, const dmk_share *s, int r, int32_t level,
                        int32_t n_fine, dmk_coarsening *c)
{
    int rc;
    const bool dealt = level < s->first_whole;
    const int32_t *fine = s->vertex[level].bound, *coarse = s->vertex[level + 1].bound,
                  *edge = s->level_edge[level + 1].bound;
    const int32_t begin = dealt ? fine[r] : 0, end = dealt ? fine[r + 1] : n_fine;
    DMK_TRY(CARRY(c->prolong_index, 3 * (size_t)begin, 3 * (size_t)end, 3 * (size_t)n_fine));
    DMK_TRY(CARRY(c->prolong_weight, 3 * (size_t)begin, 3 * (size_t)end, 3 * (size_t)n_fine));
    DMK_TRY(carry_rows(ctx, p, dealt ? coarse[r] : 0, dealt ? coarse[r + 1] : c->coarse.n,
                       c->coarse.n, &c->restrict_row, &c->restrict_fine, &c->restrict_weight));
    rc = carry_rows(ctx, p, dealt ? edge[r] : 0, dealt ? edge[r + 1] : c->coarse.n_edges,
                    c->coarse.n_edges, &c->galerkin_row, &c->galerkin_edge, &c->galerkin_coef);
done:
    return rc;
}

static int carry_bounds(dmk_context *ctx, parcel *p, const dmk_share *s, int32_t n,
                        dmk_space *space)
{
    int rc;
    DMK_TRY(CARRY(space->bound, 0, s->ranks.size + 1, s->ranks.size + 1));
    space->n_whole = n;
    space->first = space->bound[s->ranks.rank];
    space->end = space->bound[s->ranks.rank + 1];
done:
    return rc;
}

static int carry_all(dmk_context *ctx, parcel *p, dmk_share *s, int r, const dmk_mesh *mesh,
                     dmk_hierarchy *h)
{
    int rc;
    DMK_TRY(carry_number(ctx, p, &h->n));
    DMK_TRY(carry_number(ctx, p, &s->first_whole));
    for (int32_t i = 0; i < h->n; i++) {
        dmk_coarsening *c = &h->level[i];
        DMK_TRY(carry_number(ctx, p, &c->coarse.n));
        DMK_TRY(carry_number(ctx, p, &c->coarse.n_edges));
        DMK_TRY(
            CARRY(c->coarse.edge, 0, 2 * (size_t)c->coarse.n_edges, 2 * (size_t)c->coarse.n_edges));
        if (i < s->first_whole) {
            DMK_TRY(carry_bounds(ctx, p, s, c->coarse.n, &s->vertex[i + 1]));
            DMK_TRY(carry_bounds(ctx, p, s, c->coarse.n_edges, &s->level_edge[i + 1]));
        }
        DMK_TRY(
            carry_tables(ctx, p, s, r, i, i > 0 ? h->level[i - 1].coarse.n : mesh->n_vertices, c));
    }
done:
    return rc;
}

static int give(dmk_context *ctx, dmk_share *s, int r, const dmk_mesh *mesh, dmk_hierarchy *h,
                parcel *p)
{
    int rc;
    DMK_TRY(carry_all(ctx, p, s, r, mesh, h));
    p->bytes = (p->at + 7) / 8 * 8;
    DMK_TRY(DMK_NEW(ctx, p->data, p->bytes));
    p->state = GIVEN;
    p->at = 0;
    rc = carry_all(ctx, p, s, r, mesh, h);
done:
    return rc;
}

/* Everybody learns how much comes, then it does. */
static int ship(dmk_context *ctx, dmk_share *s, parcel *out, parcel *in)
{
    int rc;
    const size_t size = (size_t)s->ranks.size;
    const int maker = s->ranks.size - 1;
    size_t *bytes = NULL, *none = NULL;
    const void **send = NULL;
    void **receive = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, size));
    DMK_TRY(DMK_NEW(ctx, none, size));
    DMK_TRY(DMK_NEW(ctx, send, size));
    DMK_TRY(DMK_NEW(ctx, receive, size));
    for (size_t r = 0; r < size; r++) {
        bytes[r] = out[r].bytes;
        send[r] = out[r].data;
    }
    DMK_TRY(dmk_ranks_spread_from(ctx, &s->ranks, maker, bytes, size * sizeof *bytes));
    in->bytes = bytes[s->ranks.rank];
    DMK_TRY(DMK_NEW(ctx, in->data, in->bytes));
    receive[maker] = in->data;
    none[maker] = in->bytes;
    if (s->ranks.rank != maker) memset(bytes, 0, size * sizeof *bytes);
    rc = dmk_share_check(ctx, s, s->ranks.exchange(s->ranks.user, send, bytes, receive, none));
done:
    free(bytes);
    free(none);
    free(send);
    free(receive);
    return rc;
}

int dmk_share_hand(dmk_context *ctx, dmk_share *s, const dmk_mesh *mesh, dmk_hierarchy *h)
{
    int rc;
    const int maker = s->ranks.size - 1;
    parcel in = {.state = TAKEN}, *out = NULL;
    DMK_TRY(DMK_NEW(ctx, out, (size_t)s->ranks.size));
    for (int r = 0; r < maker && s->ranks.rank == maker; r++)
        DMK_TRY(give(ctx, s, r, mesh, h, &out[r]));
    DMK_TRY(ship(ctx, s, out, &in));
    if (s->ranks.rank != maker) rc = carry_all(ctx, &in, s, s->ranks.rank, mesh, h);
done:
    for (int r = 0; out && r < s->ranks.size; r++) free(out[r].data);
    free(out);
    free(in.data);
    return rc;
}
