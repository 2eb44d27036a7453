/* The coarse levels of a share: what a rank owns of a hierarchy that is whole on another one, which vertices and edges
 * it needs, and its tables. */
#include "ranks/levels.h"

#include <stdlib.h>
#include <string.h>

/* ---- parts of a hierarchy that is whole ------------------------------------------------------- */

/* The fine vertex that takes most of coarse vertex a. */
static int32_t main_vertex(const dmk_coarsening *c, int32_t a)
{
    int32_t best = c->restrict_row[a];
    for (int32_t k = best + 1; k < c->restrict_row[a + 1]; k++) {
        if (c->restrict_weight[k] > c->restrict_weight[best]) best = k;
    }
    return c->restrict_fine[best];
}

/* A rank owns as many coarse vertices as have their main vertices among its fine ones. */
static int bound_vertices(dmk_context *ctx, dmk_share *s, const dmk_coarsening *c, int32_t level)
{
    int rc, size = s->ranks.size;
    dmk_space *vertex = &s->vertex[level];
    DMK_TRY(DMK_NEW(ctx, vertex->bound, (size_t)size + 1));
    for (int32_t a = 0; a < c->coarse.n; a++)
        vertex->bound[dmk_owner(s->vertex[level - 1].bound, size, main_vertex(c, a)) + 1]++;
    for (int r = 0; r < size; r++) vertex->bound[r + 1] += vertex->bound[r];
    dmk_space_set_own(&s->ranks, vertex);
done:
    return rc;
}

/* And the edges whose smaller end it owns. */
static int bound_edges(dmk_context *ctx, dmk_share *s, const dmk_graph *g, int32_t level)
{
    int rc;
    int32_t k = 0;
    dmk_space *edge = &s->level_edge[level];
    DMK_TRY(DMK_NEW(ctx, edge->bound, (size_t)s->ranks.size + 1));
    for (int r = 0; r < s->ranks.size; r++) {
        while (k < g->n_edges && g->edge[2 * (size_t)k] < s->vertex[level].bound[r + 1]) k++;
        edge->bound[r + 1] = k;
    }
    dmk_space_set_own(&s->ranks, edge);
done:
    return rc;
}

int dmk_share_bound(dmk_context *ctx, dmk_share *s, const dmk_hierarchy *h)
{
    int rc = DMK_OK;
    for (int32_t l = 0; l < h->n; l++) {
        if (l > 0 && s->vertex[l].n_whole < dmk_gather_below(s)) break;
        s->first_whole = l + 1;
        DMK_TRY(bound_vertices(ctx, s, &h->level[l], l + 1));
        DMK_TRY(bound_edges(ctx, s, &h->level[l].coarse, l + 1));
    }
done:
    return rc;
}

/* Integers begin .. end - 1 as whole numbers. */
static int cut_numbers(dmk_context *ctx, const int32_t *from, int64_t begin, int64_t end,
                       int64_t **to)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *to, (size_t)(end - begin)));
    for (int64_t i = begin; i < end; i++) (*to)[i - begin] = from[i];
done:
    return rc;
}

static int cut_weights(dmk_context *ctx, const float *from, int64_t begin, int64_t end, float **to)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *to, (size_t)(end - begin)));
    memcpy(*to, from + begin, (size_t)(end - begin) * sizeof **to);
done:
    return rc;
}

/* Rows begin .. end - 1 of a table. */
static int cut_rows(dmk_context *ctx, const int32_t *row, const int32_t *entry, const float *value,
                    int64_t begin, int64_t end, int32_t **rows, int64_t **entries, float **values)
{
    int rc;
    const int32_t from = row[begin];
    DMK_TRY(DMK_NEW(ctx, *rows, (size_t)(end - begin) + 1));
    for (int64_t i = begin; i <= end; i++) (*rows)[i - begin] = row[i] - from;
    DMK_TRY(cut_numbers(ctx, entry, from, row[end], entries));
    rc = cut_weights(ctx, value, from, row[end], values);
done:
    return rc;
}

/* Those of earlier ranks: later ranks' have both ends behind the own vertices. */
int dmk_levels_others(dmk_context *ctx, const dmk_share *s, const dmk_graph *g, int32_t level,
                      int r, dmk_part *part)
{
    int rc = DMK_OK;
    size_t room = 0;
    const int64_t begin = s->vertex[level].bound[r], end = s->vertex[level].bound[r + 1];
    for (int64_t k = 0; k < s->level_edge[level].bound[r]; k++) {
        const int32_t *ends = g->edge + 2 * k;
        if (ends[1] < begin || ends[1] >= end) continue;
        DMK_TRY(DMK_GROW(ctx, part->other, 3 * (size_t)part->n_others + 3, room));
        int64_t *at = part->other + 3 * (size_t)part->n_others++;
        at[0] = k;
        at[1] = ends[0];
        at[2] = ends[1];
    }
done:
    return rc;
}

static int cut_level(dmk_context *ctx, const dmk_share *s, const dmk_coarsening *c, int32_t level,
                     dmk_part *part)
{
    int rc;
    const int r = s->ranks.rank;
    const int64_t *fine = s->vertex[level].bound + r, *coarse = s->vertex[level + 1].bound + r,
                  *edge = s->level_edge[level + 1].bound + r;
    DMK_TRY(cut_numbers(ctx, c->prolong_index, 3 * fine[0], 3 * fine[1], &part->prolong_index));
    DMK_TRY(cut_weights(ctx, c->prolong_weight, 3 * fine[0], 3 * fine[1], &part->prolong_weight));
    DMK_TRY(cut_rows(ctx, c->restrict_row, c->restrict_fine, c->restrict_weight, coarse[0],
                     coarse[1], &part->restrict_row, &part->restrict_fine, &part->restrict_weight));
    DMK_TRY(cut_numbers(ctx, c->coarse.edge, 2 * edge[0], 2 * edge[1], &part->edge));
    DMK_TRY(cut_rows(ctx, c->galerkin_row, c->galerkin_edge, c->galerkin_coef, edge[0], edge[1],
                     &part->galerkin_row, &part->galerkin_edge, &part->galerkin_coef));
    rc = dmk_levels_others(ctx, s, &c->coarse, level + 1, r, part);
done:
    return rc;
}

int dmk_share_cut(dmk_context *ctx, const dmk_share *s, dmk_parts *parts)
{
    int rc = DMK_OK;
    for (int32_t l = 0; l < s->first_whole; l++)
        DMK_TRY(cut_level(ctx, s, &parts->whole.level[l], l, &parts->part[l]));
done:
    return rc;
}

/* ---- who needs what -------------------------------------------------------------------------- */

/* All that others own. */
static int need_all(dmk_context *ctx, const dmk_space *s, dmk_list *list)
{
    int rc = DMK_OK;
    for (int64_t i = 0; i < s->n_whole; i++) DMK_TRY(dmk_list_add_ghost(ctx, list, s, i));
done:
    return rc;
}

static int need_each(dmk_context *ctx, const dmk_space *s, size_t n, const int64_t *number,
                     dmk_list *list)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < n; i++) DMK_TRY(dmk_list_add_ghost(ctx, list, s, number[i]));
done:
    return rc;
}

/* Edges at own vertices of a coarse level, their other ends, and what a finer level's own vertices are interpolated
 * from. */
static int need_of_step(dmk_context *ctx, const dmk_share *s, const dmk_part *p, int32_t level,
                        dmk_list *vertex, dmk_list *edge)
{
    int rc;
    const dmk_space *v = &s->vertex[level], *e = &s->level_edge[level];
    DMK_TRY(need_each(ctx, v, 2 * (size_t)dmk_space_own(e), p->edge, vertex));
    for (int32_t k = 0; k < p->n_others; k++) {
        DMK_TRY(need_each(ctx, e, 1, p->other + 3 * (size_t)k, edge));
        DMK_TRY(need_each(ctx, v, 2, p->other + 3 * (size_t)k + 1, vertex));
    }
    rc = need_each(ctx, v, 3 * (size_t)dmk_space_own(&s->vertex[level - 1]), p->prolong_index,
                   vertex);
done:
    return rc;
}

/* What the coarser level's own vertices and edges are computed from. */
static int need_sources(dmk_context *ctx, const dmk_share *s, const dmk_part *p, int32_t level,
                        dmk_list *vertex, dmk_list *edge)
{
    int rc;
    const int32_t *row = p->restrict_row, *galerkin = p->galerkin_row;
    DMK_TRY(need_each(ctx, &s->vertex[level], (size_t)row[dmk_space_own(&s->vertex[level + 1])],
                      p->restrict_fine, vertex));
    rc = need_each(ctx, &s->level_edge[level],
                   (size_t)galerkin[dmk_space_own(&s->level_edge[level + 1])], p->galerkin_edge,
                   edge);
done:
    return rc;
}

int dmk_levels_need(dmk_context *ctx, const dmk_share *s, const dmk_parts *p, int32_t level,
                    dmk_list *vertex, dmk_list *edge)
{
    int rc = DMK_OK;
    if (level == s->first_whole) {
        DMK_TRY(need_all(ctx, &s->vertex[level], vertex));
        return need_all(ctx, &s->level_edge[level], edge);
    }
    DMK_TRY(need_sources(ctx, s, &p->part[level], level, vertex, edge));
    if (level > 0) rc = need_of_step(ctx, s, &p->part[level - 1], level, vertex, edge);
done:
    dmk_list_sort(vertex);
    dmk_list_sort(edge);
    return rc;
}

/* ---- the local tables ------------------------------------------------------------------------ */

static void put_edge(const dmk_space *vertex, int32_t at, const int64_t end[2], dmk_graph *g)
{
    for (size_t k = 0; k < 2; k++) g->edge[2 * (size_t)at + k] = dmk_space_slot(vertex, end[k]);
}

/* Edges of which only the weights are wanted lead from the last vertex, a gap, to itself. */
static int local_edges(dmk_context *ctx, const dmk_space *vertex, const dmk_space *edge,
                       const dmk_part *part, dmk_graph *local)
{
    int rc;
    local->n = vertex->n;
    local->n_edges = edge->n;
    DMK_TRY(DMK_NEW(ctx, local->edge, 2 * (size_t)edge->n));
    for (size_t k = 0; k < 2 * (size_t)edge->n; k++) local->edge[k] = vertex->n - 1;
    for (int32_t k = 0; k < dmk_space_own(edge); k++)
        put_edge(vertex, edge->at_first + k, part->edge + 2 * (size_t)k, local);
    for (int32_t k = 0; k < part->n_others; k++) {
        const int64_t *other = part->other + 3 * (size_t)k;
        put_edge(vertex, dmk_space_slot(edge, other[0]), other + 1, local);
    }
done:
    return rc;
}

static int copy_edges(dmk_context *ctx, const dmk_graph *whole, dmk_graph *local)
{
    int rc;
    *local = (dmk_graph){.n = whole->n, .n_edges = whole->n_edges};
    DMK_TRY(DMK_NEW(ctx, local->edge, 2 * (size_t)whole->n_edges));
    memcpy(local->edge, whole->edge, 2 * (size_t)whole->n_edges * sizeof *whole->edge);
done:
    return rc;
}

/* Rows of own fine vertices; the others' stay without weights. */
static int local_prolongation(dmk_context *ctx, const dmk_space *fine, const dmk_space *coarse,
                              const dmk_part *part, dmk_coarsening *local)
{
    int rc;
    const size_t n = 3 * (size_t)dmk_space_own(fine), at = 3 * (size_t)fine->at_first;
    DMK_TRY(DMK_NEW(ctx, local->prolong_index, 3 * (size_t)fine->n));
    DMK_TRY(DMK_NEW(ctx, local->prolong_weight, 3 * (size_t)fine->n));
    for (size_t k = 0; k < n; k++)
        local->prolong_index[at + k] = dmk_space_slot(coarse, part->prolong_index[k]);
    memcpy(local->prolong_weight + at, part->prolong_weight, n * sizeof *part->prolong_weight);
done:
    return rc;
}

/* A table of own rows as one of all local rows, with their entries' local slots. */
static int local_table(dmk_context *ctx, const dmk_space *rows, const dmk_space *entries,
                       const int32_t *own_row, const int64_t *own_entry, int32_t **row,
                       int32_t **entry)
{
    int rc;
    const int32_t own = dmk_space_own(rows), n = own_row[own];
    DMK_TRY(DMK_NEW(ctx, *row, (size_t)rows->n + 1));
    DMK_TRY(DMK_NEW(ctx, *entry, (size_t)n));
    for (int32_t i = 0; i < rows->n; i++) {
        const int32_t k = i + 1 - rows->at_first;
        (*row)[i + 1] = own_row[k < 0 ? 0 : k > own ? own : k];
    }
    for (int32_t k = 0; k < n; k++) (*entry)[k] = dmk_space_slot(entries, own_entry[k]);
done:
    return rc;
}

static int local_level(dmk_context *ctx, const dmk_share *s, int32_t level, dmk_parts *p,
                       dmk_coarsening *local)
{
    int rc;
    const dmk_space *fine = &s->vertex[level], *coarse = &s->vertex[level + 1],
                    *edge = &s->level_edge[level + 1];
    dmk_part *part = &p->part[level];
    if (level + 1 == s->first_whole)
        DMK_TRY(copy_edges(ctx, &p->whole.level[level].coarse, &local->coarse));
    else
        DMK_TRY(local_edges(ctx, coarse, edge, part, &local->coarse));
    DMK_TRY(local_prolongation(ctx, fine, coarse, part, local));
    DMK_TRY(local_table(ctx, coarse, fine, part->restrict_row, part->restrict_fine,
                        &local->restrict_row, &local->restrict_fine));
    DMK_TRY(local_table(ctx, edge, &s->level_edge[level], part->galerkin_row, part->galerkin_edge,
                        &local->galerkin_row, &local->galerkin_edge));
    local->restrict_weight = part->restrict_weight;
    local->galerkin_coef = part->galerkin_coef;
    part->restrict_weight = part->galerkin_coef = NULL;
done:
    return rc;
}

int dmk_share_levels(dmk_context *ctx, dmk_share *s, dmk_parts *p, dmk_local *local)
{
    int rc = DMK_OK;
    local->first_whole = s->first_whole;
    local->hierarchy.n = p->whole.n;
    for (int32_t i = s->first_whole; i < p->whole.n; i++)
        local->hierarchy.level[i] = p->whole.level[i];
    for (int32_t i = 0; i < s->first_whole; i++) {
        const dmk_graph *g = &local->hierarchy.level[i].coarse;
        DMK_TRY(local_level(ctx, s, i, p, &local->hierarchy.level[i]));
        if (i + 1 < s->first_whole) DMK_TRY(dmk_split_graph(ctx, s, i + 1, g->n_edges, g->edge));
        dmk_part_free(&p->part[i]);
    }
done:
    return rc;
}
