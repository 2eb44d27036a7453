/* The prolongation to own vertices of a level that is dealt out. */
#include "ranks/part.h"

#include <stdlib.h>
#include <string.h>

/* The cells of own fine vertices, and those beside them: all that the weights are made from. */
typedef struct local {
    dmk_space space; /* of the cells here */
    dmk_adjacency g; /* of them alone */
    dmk_coarsening c;
    dmk_cells cells;
    double *xyz; /* of ghosts */
} local;

static void local_free(local *l)
{
    free(l->space.ghost);
    dmk_adjacency_free(&l->g);
    dmk_coarsening_free(&l->c);
    dmk_cells_free(&l->cells);
    free(l->xyz);
}

/* The ghosts among own vertices' cells; then those among their neighbours as well. */
static int find_cells(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                      const dmk_grown *grown, const dmk_side *coarse, dmk_list *list)
{
    int rc = DMK_OK;
    const dmk_space *s = coarse->vertex;
    int32_t *row = NULL;
    struct dmk_link *link = NULL;
    for (int32_t v = 0; v < dmk_space_own(fine->vertex); v++)
        DMK_TRY(dmk_list_add_ghost(ctx, list, s, grown->cell[v]));
    dmk_list_sort(list);
    DMK_TRY(dmk_fetch_rows(ctx, ranks, s->bound, list->n, list->at, sizeof *link, coarse->row,
                           coarse->link, &row, (void **)&link));
    for (int32_t i = 0, n = row[list->n]; i < n; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, list, s, link[i].to));
    for (int32_t i = 0; i < coarse->row[dmk_space_own(s)]; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, list, s, coarse->link[i].to));
    dmk_list_sort(list);
done:
    free(row);
    free(link);
    return rc;
}

static void add_links(local *l, int32_t n, const struct dmk_link *link)
{
    for (int32_t i = 0; i < n; i++) {
        const int32_t slot = dmk_space_slot(&l->space, link[i].to);
        if (slot >= 0) l->g.to[l->g.row[l->g.n]++] = slot;
    }
}

/* Rows of all cells here, in the order of their slots, without what leads away from here. */
static int link_cells(dmk_context *ctx, const dmk_side *coarse, const int32_t *row,
                      const struct dmk_link *link, local *l)
{
    int rc;
    const dmk_space *s = &l->space;
    const int32_t own = dmk_space_own(s);
    DMK_TRY(DMK_NEW(ctx, l->g.row, (size_t)s->n + 1));
    DMK_TRY(DMK_NEW(ctx, l->g.to, (size_t)row[s->n_ghosts] + (size_t)coarse->row[own]));
    for (int32_t slot = 0; slot < s->n; slot++) {
        const bool is_own = slot >= s->at_first && slot < s->after;
        const int32_t k = is_own ? slot - s->at_first : slot < s->at_first ? slot : slot - own;
        const int32_t *r = is_own ? coarse->row : row;
        l->g.n = slot + 1;
        l->g.row[slot + 1] = l->g.row[slot];
        add_links(l, r[k + 1] - r[k], (is_own ? coarse->link : link) + r[k]);
    }
done:
    return rc;
}

/* Own cells' positions among the fetched ones. */
static int place_cells(dmk_context *ctx, const dmk_side *coarse, local *l)
{
    int rc;
    const dmk_space *s = &l->space;
    const size_t before = 3 * (size_t)s->n_before, own = 3 * (size_t)dmk_space_own(s),
                 behind = 3 * (size_t)(s->n_ghosts - s->n_before);
    double *xyz = NULL;
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)s->n));
    memcpy(xyz, l->xyz, before * sizeof *xyz);
    memcpy(xyz + before, coarse->xyz, own * sizeof *xyz);
    memcpy(xyz + before + own, l->xyz + before, behind * sizeof *xyz);
    l->c.coarse.n = s->n;
    l->c.coarse.xyz = xyz;
done:
    return rc;
}

/* Own fine vertices by the slots of their cells. */
static int list_members(dmk_context *ctx, int32_t n_fine, const dmk_grown *grown, local *l)
{
    int rc;
    dmk_cells *cells = &l->cells;
    cells->n = l->space.n;
    cells->n_fine = n_fine;
    DMK_TRY(DMK_NEW(ctx, cells->owner, (size_t)n_fine));
    for (int32_t v = 0; v < n_fine; v++)
        cells->owner[v] = dmk_space_slot(&l->space, grown->cell[v]);
    rc = dmk_cells_list_members(ctx, cells);
done:
    return rc;
}

static int create_local(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                        const dmk_grown *grown, const dmk_side *coarse, local *l)
{
    int rc;
    dmk_list list = {0};
    int32_t *row = NULL;
    struct dmk_link *link = NULL;
    DMK_TRY(find_cells(ctx, ranks, fine, grown, coarse, &list));
    l->space = *coarse->vertex;
    l->space.ghost = NULL;
    DMK_TRY(dmk_space_create(ctx, list.n, list.at, 1, 0, &l->space));
    DMK_TRY(dmk_fetch_rows(ctx, ranks, coarse->vertex->bound, list.n, list.at, sizeof *link,
                           coarse->row, coarse->link, &row, (void **)&link));
    DMK_TRY(DMK_NEW(ctx, l->xyz, 3 * list.n));
    DMK_TRY(dmk_fetch(ctx, ranks, coarse->vertex->bound, list.n, list.at, 3 * sizeof *l->xyz,
                      coarse->xyz, l->xyz));
    DMK_TRY(link_cells(ctx, coarse, row, link, l));
    DMK_TRY(place_cells(ctx, coarse, l));
    rc = list_members(ctx, dmk_space_own(fine->vertex), grown, l);
done:
    dmk_list_free(&list);
    free(row);
    free(link);
    return rc;
}

/* Which own cells have any weight, of own fine vertices or of others'. */
static int find_used(dmk_context *ctx, const dmk_ranks *ranks, const local *l, int32_t n_fine,
                     uint8_t *used)
{
    int rc = DMK_OK;
    const dmk_space *s = &l->space;
    dmk_mail mail = {.item = sizeof(int64_t)};
    uint8_t *here = NULL;
    DMK_TRY(DMK_NEW(ctx, here, (size_t)s->n));
    for (size_t k = 0; k < 3 * (size_t)n_fine; k++) {
        if (l->c.prolong_weight[k] > 0) here[l->c.prolong_index[k]] = 1;
    }
    memcpy(used, here + s->at_first, (size_t)dmk_space_own(s));
    for (int32_t i = 0; i < s->n_ghosts; i++) {
        if (here[dmk_space_slot(s, s->ghost[i])])
            DMK_TRY(dmk_mail_add(ctx, &mail, dmk_owner(s->bound, ranks->size, s->ghost[i]),
                                 &s->ghost[i]));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail));
    const int64_t *number = (const void *)mail.data;
    for (size_t i = 0; i < mail.n; i++) used[number[i] - s->first] = 1;
done:
    dmk_mail_free(&mail);
    free(here);
    return rc;
}

/* As fill_empty_columns in levels/prolong.c. */
static int fill_empty(dmk_context *ctx, const dmk_ranks *ranks, const dmk_grown *grown, local *l,
                      int32_t n_fine)
{
    int rc;
    uint8_t *used = NULL;
    const int32_t own = dmk_space_own(&l->space);
    int32_t changed = 1;
    DMK_TRY(DMK_NEW(ctx, used, (size_t)own));
    while (changed) {
        changed = 0;
        DMK_TRY(find_used(ctx, ranks, l, n_fine, used));
        for (int32_t a = 0; a < own; a++) {
            const size_t at = 3 * (size_t)grown->sample[a];
            if (used[a]) continue;
            dmk_prolong_point(l->space.at_first + a, l->c.prolong_index + at,
                              l->c.prolong_weight + at);
            changed = 1;
        }
        DMK_TRY(dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &changed, 1)));
    }
done:
    free(used);
    return rc;
}

int dmk_part_weights(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                     const dmk_grown *grown, const dmk_side *coarse, dmk_part *part)
{
    int rc;
    local l = {.xyz = NULL};
    const int32_t n_fine = dmk_space_own(fine->vertex);
    DMK_TRY(create_local(ctx, ranks, fine, grown, coarse, &l));
    DMK_TRY(dmk_prolong_weights(ctx, &l.cells, &l.g, fine->xyz, &l.c));
    DMK_TRY(fill_empty(ctx, ranks, grown, &l, n_fine));
    DMK_TRY(DMK_NEW(ctx, part->prolong_index, 3 * (size_t)n_fine));
    for (size_t k = 0; k < 3 * (size_t)n_fine; k++)
        part->prolong_index[k] = dmk_space_whole(&l.space, l.c.prolong_index[k]);
    part->prolong_weight = l.c.prolong_weight;
    l.c.prolong_weight = NULL;
done:
    local_free(&l);
    return rc;
}
