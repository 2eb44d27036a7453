/* The last rank's hierarchy to all: to each its part of the levels that are dealt out, and all of the others. */
#include "ranks/deal.h"

#include <stdlib.h>
#include <string.h>

/* What goes to one rank, or comes from the last one: counted first, then copied. */
typedef struct parcel {
    enum { COUNTED, GIVEN, TAKEN } state;
    char *data;
    size_t at, bytes;
} parcel;

/* An array of n items, which the taker makes. */
static int carry(dmk_context *ctx, parcel *p, size_t item, size_t n, void **array)
{
    int rc = DMK_OK;
    const size_t bytes = n * item;
    if (p->state == TAKEN) {
        if (!*array) DMK_TRY(dmk_alloc(ctx, "levels", n, item, array));
        if (p->at + bytes > p->bytes)
            return dmk_fail(ctx, DMK_E_DEVICE, "the last rank's levels have come in part only");
        memcpy(*array, p->data + p->at, bytes);
    } else if (p->state == GIVEN && bytes > 0) {
        memcpy(p->data + p->at, *array, bytes);
    }
    p->at += bytes;
done:
    return rc;
}

static int carry_number(dmk_context *ctx, parcel *p, int32_t *number)
{
    void *at = number;
    return carry(ctx, p, sizeof *number, 1, &at);
}

#define CARRY(array, n) carry(ctx, p, sizeof *(array), (size_t)(n), (void **)&(array))

/* Rank r's part of the step from a level on. */
static int carry_part(dmk_context *ctx, parcel *p, const dmk_share *s, int r, int32_t level,
                      dmk_part *part)
{
    int rc;
    const int64_t *fine = s->vertex[level].bound + r, *coarse = s->vertex[level + 1].bound + r,
                  *edge = s->level_edge[level + 1].bound + r;
    const int64_t n_fine = fine[1] - fine[0], n = coarse[1] - coarse[0],
                  n_edges = edge[1] - edge[0];
    DMK_TRY(CARRY(part->prolong_index, 3 * n_fine));
    DMK_TRY(CARRY(part->prolong_weight, 3 * n_fine));
    DMK_TRY(CARRY(part->restrict_row, n + 1));
    DMK_TRY(CARRY(part->restrict_fine, part->restrict_row[n]));
    DMK_TRY(CARRY(part->restrict_weight, part->restrict_row[n]));
    DMK_TRY(CARRY(part->edge, 2 * n_edges));
    DMK_TRY(CARRY(part->galerkin_row, n_edges + 1));
    DMK_TRY(CARRY(part->galerkin_edge, part->galerkin_row[n_edges]));
    DMK_TRY(CARRY(part->galerkin_coef, part->galerkin_row[n_edges]));
    DMK_TRY(carry_number(ctx, p, &part->n_others));
    rc = CARRY(part->other, 3 * (size_t)part->n_others);
done:
    return rc;
}

static int carry_graph(dmk_context *ctx, parcel *p, dmk_graph *g)
{
    int rc;
    DMK_TRY(carry_number(ctx, p, &g->n));
    DMK_TRY(carry_number(ctx, p, &g->n_edges));
    rc = CARRY(g->edge, 2 * (size_t)g->n_edges);
done:
    return rc;
}

/* A step that is whole on all ranks. */
static int carry_whole(dmk_context *ctx, parcel *p, int32_t n_fine, dmk_coarsening *c)
{
    int rc;
    DMK_TRY(CARRY(c->prolong_index, 3 * (size_t)n_fine));
    DMK_TRY(CARRY(c->prolong_weight, 3 * (size_t)n_fine));
    DMK_TRY(CARRY(c->restrict_row, c->coarse.n + 1));
    DMK_TRY(CARRY(c->restrict_fine, c->restrict_row[c->coarse.n]));
    DMK_TRY(CARRY(c->restrict_weight, c->restrict_row[c->coarse.n]));
    DMK_TRY(CARRY(c->galerkin_row, c->coarse.n_edges + 1));
    DMK_TRY(CARRY(c->galerkin_edge, c->galerkin_row[c->coarse.n_edges]));
    rc = CARRY(c->galerkin_coef, c->galerkin_row[c->coarse.n_edges]);
done:
    return rc;
}

static int carry_bounds(dmk_context *ctx, parcel *p, const dmk_share *s, dmk_space *space)
{
    int rc;
    DMK_TRY(CARRY(space->bound, s->ranks.size + 1));
    space->n_whole = space->bound[s->ranks.size];
    dmk_space_set_own(s, space);
done:
    return rc;
}

static int carry_all(dmk_context *ctx, parcel *p, dmk_share *s, int r, dmk_part *part,
                     dmk_hierarchy *h)
{
    int rc;
    DMK_TRY(carry_number(ctx, p, &h->n));
    DMK_TRY(carry_number(ctx, p, &s->first_whole));
    for (int32_t l = 0; l < s->first_whole; l++) {
        DMK_TRY(carry_bounds(ctx, p, s, &s->vertex[l + 1]));
        DMK_TRY(carry_bounds(ctx, p, s, &s->level_edge[l + 1]));
        DMK_TRY(carry_part(ctx, p, s, r, l, &part[l]));
    }
    for (int32_t l = dmk_max_i(s->first_whole - 1, 0); l < h->n; l++) {
        dmk_coarsening *c = &h->level[l];
        DMK_TRY(carry_graph(ctx, p, &c->coarse));
        if (l >= s->first_whole) DMK_TRY(carry_whole(ctx, p, h->level[l - 1].coarse.n, c));
    }
done:
    return rc;
}

static int give(dmk_context *ctx, dmk_share *s, int r, dmk_hierarchy *h, parcel *p)
{
    int rc;
    dmk_parts theirs = {.whole.n = 0};
    DMK_TRY(dmk_share_cut(ctx, s, h, r, theirs.part));
    DMK_TRY(carry_all(ctx, p, s, r, theirs.part, h));
    p->bytes = (p->at + 7) / 8 * 8;
    DMK_TRY(DMK_NEW(ctx, p->data, p->bytes));
    p->state = GIVEN;
    p->at = 0;
    rc = carry_all(ctx, p, s, r, theirs.part, h);
done:
    dmk_parts_free(&theirs);
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

int dmk_share_hand(dmk_context *ctx, dmk_share *s, dmk_parts *parts)
{
    int rc;
    const int maker = s->ranks.size - 1;
    parcel in = {.state = TAKEN}, *out = NULL;
    DMK_TRY(DMK_NEW(ctx, out, (size_t)s->ranks.size));
    for (int r = 0; r < maker && s->ranks.rank == maker; r++)
        DMK_TRY(give(ctx, s, r, &parts->whole, &out[r]));
    DMK_TRY(ship(ctx, s, out, &in));
    if (s->ranks.rank != maker)
        rc = carry_all(ctx, &in, s, s->ranks.rank, parts->part, &parts->whole);
done:
    for (int r = 0; out && r < s->ranks.size; r++) free(out[r].data);
    free(out);
    free(in.data);
    return rc;
}
