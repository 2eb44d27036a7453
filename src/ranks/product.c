/* The Galerkin product of a level that is dealt out: each rank makes the rows of its own coarse vertices and edges,
 * from all fine edges that have to do with them. */
#include "ranks/part.h"

#include <stdlib.h>
#include <string.h>

/* A row of the prolongation. */
typedef struct weights {
    int64_t index[3];
    float weight[3];
} weights;

/* A fine edge with those of its ends, for other ranks. */
typedef struct bond {
    int64_t number, end[2];
    weights row[2];
} bond;

static weights own_row(const dmk_part *part, int64_t i)
{
    weights w;
    memcpy(w.index, part->prolong_index + 3 * i, sizeof w.index);
    memcpy(w.weight, part->prolong_weight + 3 * i, sizeof w.weight);
    return w;
}

/* The prolongation's rows at ends that are not own ones. */
typedef struct beyond {
    dmk_list vertex;
    weights *row;
} beyond;

static int find_beyond(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                       const dmk_part *part, beyond *b)
{
    int rc = DMK_OK;
    weights *own = NULL;
    const int32_t n = dmk_space_own(fine->vertex);
    for (int32_t e = 0; e < fine->n_edges; e++)
        DMK_TRY(dmk_list_add_ghost(ctx, &b->vertex, fine->vertex, fine->edge[3 * (size_t)e + 2]));
    dmk_list_sort(&b->vertex);
    DMK_TRY(DMK_NEW(ctx, own, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, b->row, b->vertex.n));
    for (int32_t i = 0; i < n; i++) own[i] = own_row(part, i);
    rc = dmk_fetch(ctx, ranks, fine->vertex->bound, b->vertex.n, b->vertex.at, sizeof *own, own,
                   b->row);
done:
    free(own);
    return rc;
}

static weights row_of(const dmk_side *fine, const dmk_part *part, const beyond *b, int64_t v)
{
    if (dmk_space_owns(fine->vertex, v)) return own_row(part, v - fine->vertex->first);
    return b->row[dmk_list_place(&b->vertex, v)];
}

/* To each other rank that owns a coarse vertex in a row of the bond. */
static int mail_bond(dmk_context *ctx, const dmk_ranks *ranks, const dmk_space *coarse,
                     const bond *b, dmk_mail *mail)
{
    int owner[6];
    for (int k = 0; k < 6; k++) {
        const int64_t v = b->row[k / 3].index[k % 3];
        owner[k] =
            dmk_space_owns(coarse, v) ? ranks->rank : dmk_owner(coarse->bound, ranks->size, v);
    }
    return dmk_mail_add_to(ctx, mail, ranks->rank, 6, owner, b);
}

static int compare_bonds(const void *a, const void *b)
{
    const bond *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

/* All of other ranks' fine edges that have to do with own coarse vertices, by their numbers. */
static int gather_bonds(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                        const dmk_space *coarse, const dmk_part *part, const beyond *far,
                        dmk_mail *mail)
{
    int rc = DMK_OK;
    for (int32_t e = 0; e < fine->n_edges; e++) {
        const int64_t *edge = fine->edge + 3 * (size_t)e;
        bond b = {.number = edge[0], .end = {edge[1], edge[2]}};
        for (int k = 0; k < 2; k++) b.row[k] = row_of(fine, part, far, b.end[k]);
        DMK_TRY(mail_bond(ctx, ranks, coarse, &b, mail));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, mail));
    if (mail->n > 0) qsort(mail->data, mail->n, mail->item, compare_bonds);
done:
    return rc;
}

/* These and the own edges, with their ends and rows in numbers of their own, which have the order of the whole ones. */
typedef struct local {
    dmk_space fine, coarse;
    int64_t *number; /* whole one of each edge */
    int32_t n_edges, *edge;
    dmk_coarsening c;
} local;

static void local_free(local *l)
{
    free(l->fine.ghost);
    free(l->coarse.ghost);
    free(l->number);
    free(l->edge);
    dmk_coarsening_free(&l->c);
}

static int add_row(dmk_context *ctx, const dmk_space *coarse, const weights *w, dmk_list *cells)
{
    int rc = DMK_OK;
    for (int k = 0; k < 3; k++) DMK_TRY(dmk_list_add_ghost(ctx, cells, coarse, w->index[k]));
done:
    return rc;
}

static int create_spaces(dmk_context *ctx, const dmk_side *fine, const dmk_space *coarse,
                         const dmk_part *part, const beyond *far, const dmk_mail *mail, local *l)
{
    int rc = DMK_OK;
    dmk_list ends = {0}, cells = {0};
    const bond *b = (const void *)mail->data;
    for (size_t i = 0; i < 2 * mail->n; i++) {
        DMK_TRY(dmk_list_add_ghost(ctx, &ends, fine->vertex, b[i / 2].end[i % 2]));
        DMK_TRY(add_row(ctx, coarse, &b[i / 2].row[i % 2], &cells));
    }
    for (size_t i = 0; i < far->vertex.n; i++) {
        DMK_TRY(dmk_list_add(ctx, &ends, far->vertex.at[i]));
        DMK_TRY(add_row(ctx, coarse, &far->row[i], &cells));
    }
    for (int32_t v = 0; v < dmk_space_own(fine->vertex); v++) {
        const weights w = own_row(part, v);
        DMK_TRY(add_row(ctx, coarse, &w, &cells));
    }
    dmk_list_sort(&ends);
    dmk_list_sort(&cells);
    l->fine = *fine->vertex;
    l->coarse = *coarse;
    l->fine.ghost = l->coarse.ghost = NULL;
    DMK_TRY(dmk_space_create(ctx, ends.n, ends.at, 1, 0, &l->fine));
    DMK_TRY(dmk_space_create(ctx, cells.n, cells.at, 1, 0, &l->coarse));
done:
    dmk_list_free(&ends);
    dmk_list_free(&cells);
    return rc;
}

static void put_row(local *l, int64_t v, const weights *w)
{
    const size_t at = 3 * (size_t)dmk_space_slot(&l->fine, v);
    for (size_t k = 0; k < 3; k++) {
        l->c.prolong_index[at + k] = dmk_space_slot(&l->coarse, w->index[k]);
        l->c.prolong_weight[at + k] = w->weight[k];
    }
}

static int put_rows(dmk_context *ctx, const dmk_part *part, const beyond *far, const dmk_mail *mail,
                    local *l)
{
    int rc;
    const bond *b = (const void *)mail->data;
    DMK_TRY(DMK_NEW(ctx, l->c.prolong_index, 3 * (size_t)l->fine.n));
    DMK_TRY(DMK_NEW(ctx, l->c.prolong_weight, 3 * (size_t)l->fine.n));
    l->c.coarse.n = l->coarse.n;
    for (int32_t v = 0; v < dmk_space_own(&l->fine); v++) {
        const weights w = own_row(part, v);
        put_row(l, l->fine.first + v, &w);
    }
    for (size_t i = 0; i < far->vertex.n; i++) put_row(l, far->vertex.at[i], &far->row[i]);
    for (size_t i = 0; i < 2 * mail->n; i++) put_row(l, b[i / 2].end[i % 2], &b[i / 2].row[i % 2]);
done:
    return rc;
}

static void put_edge(local *l, int64_t number, const int64_t end[2])
{
    for (size_t k = 0; k < 2; k++)
        l->edge[2 * (size_t)l->n_edges + k] = dmk_space_slot(&l->fine, end[k]);
    l->number[l->n_edges++] = number;
}

/* Own edges and others' by their numbers. */
static int put_edges(dmk_context *ctx, const dmk_side *fine, const dmk_mail *mail, local *l)
{
    int rc;
    const size_t n = mail->n + (size_t)fine->n_edges;
    const bond *b = (const void *)mail->data, *end = b + mail->n;
    DMK_TRY(DMK_NEW(ctx, l->number, n));
    DMK_TRY(DMK_NEW(ctx, l->edge, 2 * n));
    for (int32_t e = 0; e < fine->n_edges; e++) {
        const int64_t *edge = fine->edge + 3 * (size_t)e;
        for (; b < end && b->number < edge[0]; b++) put_edge(l, b->number, b->end);
        put_edge(l, edge[0], edge + 1);
    }
    for (; b < end; b++) put_edge(l, b->number, b->end);
done:
    return rc;
}

static int create_local(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                        const dmk_space *coarse, const dmk_part *part, local *l)
{
    int rc;
    beyond far = {.row = NULL};
    dmk_mail mail = {.item = sizeof(bond)};
    DMK_TRY(find_beyond(ctx, ranks, fine, part, &far));
    DMK_TRY(gather_bonds(ctx, ranks, fine, coarse, part, &far, &mail));
    DMK_TRY(create_spaces(ctx, fine, coarse, part, &far, &mail, l));
    DMK_TRY(put_rows(ctx, part, &far, &mail, l));
    rc = put_edges(ctx, fine, &mail, l);
done:
    dmk_list_free(&far.vertex);
    free(far.row);
    dmk_mail_free(&mail);
    return rc;
}

/* ---- back to whole numbers -------------------------------------------------------------------- */

static int take_restriction(dmk_context *ctx, const local *l, dmk_part *part)
{
    int rc;
    const int32_t first = l->coarse.at_first, n = dmk_space_own(&l->coarse);
    const int32_t *row = l->c.restrict_row + first;
    const size_t entries = (size_t)(row[n] - row[0]);
    DMK_TRY(DMK_NEW(ctx, part->restrict_row, (size_t)n + 1));
    DMK_TRY(DMK_NEW(ctx, part->restrict_fine, entries));
    DMK_TRY(DMK_NEW(ctx, part->restrict_weight, entries));
    for (int32_t a = 0; a <= n; a++) part->restrict_row[a] = row[a] - row[0];
    for (size_t i = 0; i < entries; i++)
        part->restrict_fine[i] = dmk_space_whole(&l->fine, l->c.restrict_fine[(size_t)row[0] + i]);
    memcpy(part->restrict_weight, l->c.restrict_weight + row[0],
           entries * sizeof *part->restrict_weight);
done:
    return rc;
}

static int take_edges(dmk_context *ctx, local *l, dmk_part *part)
{
    int rc;
    const size_t n = (size_t)l->c.coarse.n_edges, entries = (size_t)l->c.galerkin_row[n];
    DMK_TRY(DMK_NEW(ctx, part->edge, 2 * n));
    DMK_TRY(DMK_NEW(ctx, part->galerkin_edge, entries));
    for (size_t i = 0; i < 2 * n; i++)
        part->edge[i] = dmk_space_whole(&l->coarse, l->c.coarse.edge[i]);
    for (size_t i = 0; i < entries; i++) part->galerkin_edge[i] = l->number[l->c.galerkin_edge[i]];
    part->galerkin_row = l->c.galerkin_row;
    part->galerkin_coef = l->c.galerkin_coef;
    l->c.galerkin_row = NULL;
    l->c.galerkin_coef = NULL;
done:
    return rc;
}

/* The edges get their numbers; the owner of the larger end is told. */
static int number_edges(dmk_context *ctx, const dmk_ranks *ranks, int32_t n, dmk_side *coarse,
                        dmk_space *edges, dmk_part *part)
{
    int rc;
    dmk_mail mail = {.item = 3 * sizeof *part->other};
    DMK_TRY(DMK_NEW(ctx, edges->bound, (size_t)ranks->size + 1));
    DMK_TRY(dmk_ranks_bound(ctx, ranks, n, edges->bound));
    dmk_space_set_own(ranks, edges);
    coarse->n_edges = n;
    DMK_TRY(DMK_NEW(ctx, coarse->edge, 3 * (size_t)n));
    for (int32_t e = 0; e < n; e++) {
        int64_t *edge = coarse->edge + 3 * (size_t)e;
        edge[0] = edges->first + e;
        memcpy(edge + 1, part->edge + 2 * (size_t)e, 2 * sizeof *edge);
        if (dmk_space_owns(coarse->vertex, edge[2])) continue;
        DMK_TRY(
            dmk_mail_add(ctx, &mail, dmk_owner(coarse->vertex->bound, ranks->size, edge[2]), edge));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail));
    part->n_others = (int32_t)mail.n;
    part->other = (void *)mail.data;
    mail.data = NULL;
done:
    dmk_mail_free(&mail);
    return rc;
}

int dmk_part_product(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                     dmk_side *coarse, dmk_space *edges, dmk_part *part)
{
    int rc;
    local l = {.edge = NULL};
    DMK_TRY(create_local(ctx, ranks, fine, coarse->vertex, part, &l));
    DMK_TRY(dmk_galerkin_create(ctx, l.fine.n, l.n_edges, l.edge, l.coarse.at_first, l.coarse.after,
                                &l.c));
    const int32_t n = l.c.coarse.n_edges;
    DMK_TRY(take_restriction(ctx, &l, part));
    DMK_TRY(take_edges(ctx, &l, part));
    rc = number_edges(ctx, ranks, n, coarse, edges, part);
done:
    local_free(&l);
    return rc;
}
