/* The last rank's hierarchy to all: to each its part of the levels that are dealt out, and all of the others. Array
 * after array from where it lies, so that nothing is made for the way. */
#include "ranks/levels.h"

#include <stdlib.h>
#include <string.h>

static int maker_of(const dmk_share *s)
{
    return s->ranks.size - 1;
}

static bool makes(const dmk_share *s)
{
    return s->ranks.rank == maker_of(s);
}

/* ---- to each its own --------------------------------------------------------------------------- */

/* Of each rank r the items at[2 r] .. at[2 r + 1] - 1 of an array. */
static int cut_by_bounds(dmk_context *ctx, const dmk_share *s, const int64_t *bound, int64_t per,
                         int64_t more, int64_t **at)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *at, 2 * (size_t)s->ranks.size));
    for (int r = 0; r < s->ranks.size; r++) {
        (*at)[2 * r] = per * bound[r];
        (*at)[2 * r + 1] = per * bound[r + 1] + more;
    }
done:
    return rc;
}

/* Those that the rows of each rank have; only the maker has the rows of all. */
static int cut_by_rows(dmk_context *ctx, const dmk_share *s, const int64_t *bound,
                       const int32_t *row, const int32_t *own_row, int64_t **at)
{
    int rc;
    const int me = s->ranks.rank;
    DMK_TRY(DMK_NEW(ctx, *at, 2 * (size_t)s->ranks.size));
    for (int r = 0; makes(s) && r < s->ranks.size; r++) {
        (*at)[2 * r] = row[bound[r]];
        (*at)[2 * r + 1] = row[bound[r + 1]];
    }
    if (!makes(s)) (*at)[2 * me + 1] = own_row[bound[me + 1] - bound[me]];
done:
    return rc;
}

static size_t length(const dmk_share *s, const int64_t *at)
{
    const int64_t *own = at + 2 * s->ranks.rank;
    return (size_t)(own[1] - own[0]);
}

/* The maker's array `whole` is not looked at by the others, nor theirs by the maker. */
static int deal(dmk_context *ctx, const dmk_share *s, const int64_t *at, size_t item,
                const void *whole, void *own)
{
    int rc;
    const size_t size = (size_t)s->ranks.size, maker = size - 1;
    const void **send = NULL;
    void **receive = NULL;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, send, size));
    DMK_TRY(DMK_NEW(ctx, receive, size));
    DMK_TRY(DMK_NEW(ctx, bytes, 2 * size));
    for (size_t r = 0; makes(s) && r < maker; r++) {
        send[r] = (const char *)whole + item * (size_t)at[2 * r];
        bytes[r] = item * (size_t)(at[2 * r + 1] - at[2 * r]);
    }
    receive[maker] = own;
    if (!makes(s)) bytes[size + maker] = item * length(s, at);
    rc = dmk_share_check(ctx, s,
                         s->ranks.exchange(s->ranks.user, send, bytes, receive, bytes + size));
done:
    free(send);
    free(receive);
    free(bytes);
    return rc;
}

/* 32 bits are enough for what is whole on one rank; parts have 64. */
static int deal_numbers(dmk_context *ctx, const dmk_share *s, const int64_t *at,
                        const int32_t *whole, int64_t **own)
{
    int rc;
    int32_t *narrow = NULL;
    if (makes(s)) return deal(ctx, s, at, sizeof *whole, whole, NULL);
    const size_t n = length(s, at);
    DMK_TRY(DMK_NEW(ctx, narrow, n));
    DMK_TRY(deal(ctx, s, at, sizeof *whole, NULL, narrow));
    DMK_TRY(DMK_NEW(ctx, *own, n));
    for (size_t i = 0; i < n; i++) (*own)[i] = narrow[i];
done:
    free(narrow);
    return rc;
}

static int deal_weights(dmk_context *ctx, const dmk_share *s, const int64_t *at, const float *whole,
                        float **own)
{
    int rc;
    if (!makes(s)) DMK_TRY(DMK_NEW(ctx, *own, length(s, at)));
    rc = deal(ctx, s, at, sizeof *whole, whole, *own);
done:
    return rc;
}

/* Rows by bounds, with their entries and values. */
static int deal_rows(dmk_context *ctx, const dmk_share *s, const int64_t *bound, const int32_t *row,
                     const int32_t *entry, const float *value, int32_t **own_row,
                     int64_t **own_entry, float **own_value)
{
    int rc;
    int64_t *rows = NULL, *entries = NULL;
    DMK_TRY(cut_by_bounds(ctx, s, bound, 1, 1, &rows));
    const size_t n = length(s, rows);
    if (!makes(s)) DMK_TRY(DMK_NEW(ctx, *own_row, n));
    DMK_TRY(deal(ctx, s, rows, sizeof *row, row, *own_row));
    for (size_t i = n; !makes(s) && i-- > 0;) (*own_row)[i] -= (*own_row)[0];
    DMK_TRY(cut_by_rows(ctx, s, bound, row, *own_row, &entries));
    DMK_TRY(deal_numbers(ctx, s, entries, entry, own_entry));
    rc = deal_weights(ctx, s, entries, value, own_value);
done:
    free(rows);
    free(entries);
    return rc;
}

/* The edges of other ranks at own vertices. */
static int deal_others(dmk_context *ctx, const dmk_share *s, const dmk_graph *g, int32_t level,
                       dmk_part *part)
{
    int rc = DMK_OK;
    dmk_part theirs = {.n_others = 0};
    dmk_mail mail = {.item = 3 * sizeof *part->other};
    for (int r = 0; makes(s) && r < maker_of(s); r++) {
        theirs.n_others = 0;
        DMK_TRY(dmk_levels_others(ctx, s, g, level, r, &theirs));
        for (size_t i = 0; i < (size_t)theirs.n_others; i++)
            DMK_TRY(dmk_mail_add(ctx, &mail, r, theirs.other + 3 * i));
        free(theirs.other);
        theirs.other = NULL;
    }
    DMK_TRY(dmk_mail_send(ctx, &s->ranks, &mail));
    if (makes(s)) goto done;
    part->n_others = (int32_t)mail.n;
    part->other = (void *)mail.data;
    mail.data = NULL;
done:
    free(theirs.other);
    dmk_mail_free(&mail);
    return rc;
}

/* The step from a level on. */
static int deal_step(dmk_context *ctx, const dmk_share *s, int32_t level, const dmk_coarsening *c,
                     dmk_part *part)
{
    int rc;
    const int64_t *coarse = s->vertex[level + 1].bound, *edge = s->level_edge[level + 1].bound;
    int64_t *fine = NULL, *ends = NULL;
    DMK_TRY(cut_by_bounds(ctx, s, s->vertex[level].bound, 3, 0, &fine));
    DMK_TRY(deal_numbers(ctx, s, fine, c->prolong_index, &part->prolong_index));
    DMK_TRY(deal_weights(ctx, s, fine, c->prolong_weight, &part->prolong_weight));
    DMK_TRY(deal_rows(ctx, s, coarse, c->restrict_row, c->restrict_fine, c->restrict_weight,
                      &part->restrict_row, &part->restrict_fine, &part->restrict_weight));
    DMK_TRY(cut_by_bounds(ctx, s, edge, 2, 0, &ends));
    DMK_TRY(deal_numbers(ctx, s, ends, c->coarse.edge, &part->edge));
    DMK_TRY(deal_rows(ctx, s, edge, c->galerkin_row, c->galerkin_edge, c->galerkin_coef,
                      &part->galerkin_row, &part->galerkin_edge, &part->galerkin_coef));
    rc = deal_others(ctx, s, &c->coarse, level + 1, part);
done:
    free(fine);
    free(ends);
    return rc;
}

/* ---- to all the same --------------------------------------------------------------------------- */

static int spread(dmk_context *ctx, const dmk_share *s, size_t item, size_t n, void **array)
{
    int rc;
    if (!*array) DMK_TRY(dmk_alloc(ctx, "levels", n, item, array));
    rc = dmk_ranks_spread_from(ctx, &s->ranks, maker_of(s), *array, n * item);
done:
    return rc;
}

#define SPREAD(array, n) spread(ctx, s, sizeof *(array), (size_t)(n), (void **)&(array))

static int spread_number(dmk_context *ctx, const dmk_share *s, int32_t *number)
{
    return dmk_ranks_spread_from(ctx, &s->ranks, maker_of(s), number, sizeof *number);
}

static int spread_bounds(dmk_context *ctx, const dmk_share *s, dmk_space *space)
{
    int rc;
    DMK_TRY(SPREAD(space->bound, s->ranks.size + 1));
    dmk_space_set_own(&s->ranks, space);
done:
    return rc;
}

static int spread_graph(dmk_context *ctx, const dmk_share *s, dmk_graph *g)
{
    int rc;
    DMK_TRY(spread_number(ctx, s, &g->n));
    DMK_TRY(spread_number(ctx, s, &g->n_edges));
    rc = SPREAD(g->edge, 2 * (size_t)g->n_edges);
done:
    return rc;
}

/* A step that is whole on all ranks. */
static int spread_step(dmk_context *ctx, const dmk_share *s, int32_t n_fine, dmk_coarsening *c)
{
    int rc;
    DMK_TRY(SPREAD(c->prolong_index, 3 * (size_t)n_fine));
    DMK_TRY(SPREAD(c->prolong_weight, 3 * (size_t)n_fine));
    DMK_TRY(SPREAD(c->restrict_row, c->coarse.n + 1));
    DMK_TRY(SPREAD(c->restrict_fine, c->restrict_row[c->coarse.n]));
    DMK_TRY(SPREAD(c->restrict_weight, c->restrict_row[c->coarse.n]));
    DMK_TRY(SPREAD(c->galerkin_row, c->coarse.n_edges + 1));
    DMK_TRY(SPREAD(c->galerkin_edge, c->galerkin_row[c->coarse.n_edges]));
    rc = SPREAD(c->galerkin_coef, c->galerkin_row[c->coarse.n_edges]);
done:
    return rc;
}

/* ---- all together ------------------------------------------------------------------------------ */

int dmk_share_hand(dmk_context *ctx, dmk_share *s, dmk_parts *parts)
{
    int rc;
    dmk_hierarchy *h = &parts->whole;
    DMK_TRY(spread_number(ctx, s, &h->n));
    DMK_TRY(spread_number(ctx, s, &s->first_whole));
    for (int32_t l = 0; l < s->first_whole; l++) {
        DMK_TRY(spread_bounds(ctx, s, &s->vertex[l + 1]));
        DMK_TRY(spread_bounds(ctx, s, &s->level_edge[l + 1]));
        DMK_TRY(deal_step(ctx, s, l, &h->level[l], &parts->part[l]));
    }
    for (int32_t l = dmk_max_i(s->first_whole - 1, 0); l < h->n; l++) {
        dmk_coarsening *c = &h->level[l];
        DMK_TRY(spread_graph(ctx, s, &c->coarse));
        if (l >= s->first_whole) DMK_TRY(spread_step(ctx, s, h->level[l - 1].coarse.n, c));
    }
done:
    return rc;
}
