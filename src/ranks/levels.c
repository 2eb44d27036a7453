/* The coarse levels of a share: which vertices and edges a rank owns and needs, and its part of the
 * tables between two levels. */
#include "ranks/ranks.h"

#include "ranks/deal.h"

#include <stdlib.h>
#include <string.h>

/* ---- who owns what --------------------------------------------------------------------------- */

static int owner_of(const dmk_space *s, int n_ranks, int32_t item)
{
    int low = 0, high = n_ranks;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (s->bound[middle] <= item)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* The fine vertex that takes most of coarse vertex a. */
static int32_t main_vertex(const dmk_coarsening *c, int32_t a)
{
    int32_t best = c->restrict_row[a];
    for (int32_t k = best + 1; k < c->restrict_row[a + 1]; k++) {
        if (c->restrict_weight[k] > c->restrict_weight[best]) best = k;
    }
    return c->restrict_fine[best];
}

/* The rows of the own edges, which a level's table may have beside others. */
static const int32_t *own_rows(const dmk_coarsening *c, const dmk_space *edge)
{
    return c->galerkin_row + (edge->first - c->edge_first);
}

static int own_range(dmk_context *ctx, const dmk_share *s, int32_t n, dmk_space *space)
{
    space->n_whole = n;
    return DMK_NEW(ctx, space->bound, (size_t)s->ranks.size + 1);
}

static void set_own(const dmk_share *s, dmk_space *space)
{
    space->first = space->bound[s->ranks.rank];
    space->end = space->bound[s->ranks.rank + 1];
}

/* A rank owns as many coarse vertices as have their main vertices among its fine ones. */
static int bound_vertices(dmk_context *ctx, dmk_share *s, const dmk_coarsening *c, int32_t level)
{
    int rc, size = s->ranks.size;
    dmk_space *vertex = &s->vertex[level];
    DMK_TRY(own_range(ctx, s, c->coarse.n, vertex));
    for (int32_t a = 0; a < c->coarse.n; a++) {
        vertex->bound[owner_of(&s->vertex[level - 1], size, main_vertex(c, a)) + 1]++;
    }
    for (int r = 0; r < size; r++) vertex->bound[r + 1] += vertex->bound[r];
    set_own(s, vertex);
done:
    return rc;
}

int dmk_deal_own(dmk_context *ctx, void *user, const dmk_coarsening *c, int32_t *first,
                 int32_t *end)
{
    int rc = DMK_OK;
    dmk_share *s = user;
    const int32_t below = s->ranks.gather_below > 0 ? s->ranks.gather_below : DMK_GATHER_BELOW;
    s->deals = s->first_whole == 0 || (s->deals && s->vertex[s->first_whole].n_whole >= below);
    if (!s->deals) return DMK_OK;
    s->first_whole++;
    DMK_TRY(bound_vertices(ctx, s, c, s->first_whole));
    *first = s->vertex[s->first_whole].first;
    *end = s->vertex[s->first_whole].end;
done:
    return rc;
}

/* And the edges whose smaller end it owns, which are those that it has made. */
int dmk_deal_join(dmk_context *ctx, void *user, dmk_coarsening *c)
{
    int rc;
    dmk_share *s = user;
    dmk_space *edge = &s->level_edge[s->first_whole];
    int32_t *own = c->coarse.edge, *n = NULL;
    size_t *bytes = NULL;
    if (!s->deals) return DMK_OK;
    DMK_TRY(DMK_NEW(ctx, n, (size_t)s->ranks.size));
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)s->ranks.size));
    for (int r = 0; r < s->ranks.size; r++) bytes[r] = sizeof *n;
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, &c->coarse.n_edges, n, bytes)));
    DMK_TRY(own_range(ctx, s, 0, edge));
    for (int r = 0; r < s->ranks.size; r++) {
        edge->bound[r + 1] = edge->bound[r] + n[r];
        bytes[r] = 2 * (size_t)n[r] * sizeof *own;
    }
    edge->n_whole = c->coarse.n_edges = edge->bound[s->ranks.size];
    set_own(s, edge);
    c->edge_first = edge->first;
    c->coarse.edge = NULL;
    DMK_TRY(DMK_NEW(ctx, c->coarse.edge, 2 * (size_t)edge->n_whole));
    DMK_TRY(dmk_share_check(ctx, s, s->ranks.gather(s->ranks.user, own, c->coarse.edge, bytes)));
done:
    if (c->coarse.edge != own) free(own);
    free(n);
    free(bytes);
    return rc;
}

int dmk_share_bound(dmk_context *ctx, dmk_share *s, const dmk_hierarchy *h)
{
    int rc = DMK_OK;
    for (int32_t i = 0; i < h->n; i++) {
        const dmk_graph *g = &h->level[i].coarse;
        int32_t first, end, k = 0;
        DMK_TRY(dmk_deal_own(ctx, s, &h->level[i], &first, &end));
        if (!s->deals) break;
        dmk_space *edge = &s->level_edge[i + 1];
        DMK_TRY(own_range(ctx, s, g->n_edges, edge));
        for (int r = 0; r < s->ranks.size; r++) {
            while (k < g->n_edges && g->edge[2 * (size_t)k] < s->vertex[i + 1].bound[r + 1]) k++;
            edge->bound[r + 1] = k;
        }
        set_own(s, edge);
    }
done:
    return rc;
}

/* ---- who needs what -------------------------------------------------------------------------- */

/* Edges at own vertices, and their other ends. */
static void mark_neighbours(const dmk_space *own, int32_t n_edges, const int32_t *edge,
                            uint8_t *vertex_mark, uint8_t *edge_mark)
{
    for (int32_t k = 0; k < n_edges; k++) {
        const int32_t *end = edge + 2 * (size_t)k;
        if (!dmk_space_owns(own, end[0]) && !dmk_space_owns(own, end[1])) continue;
        edge_mark[k] = vertex_mark[end[0]] = vertex_mark[end[1]] = 1;
    }
}

/* What the coarser level's own vertices and edges are computed from. */
static void mark_sources(const dmk_coarsening *c, const dmk_space *vertex, const dmk_space *edge,
                         uint8_t *vertex_mark, uint8_t *edge_mark)
{
    for (int32_t k = c->restrict_row[vertex->first]; k < c->restrict_row[vertex->end]; k++) {
        vertex_mark[c->restrict_fine[k]] = 1;
    }
    const int32_t *row = own_rows(c, edge);
    for (int32_t k = row[0]; k < row[edge->end - edge->first]; k++) {
        edge_mark[c->galerkin_edge[k]] = 1;
    }
}

/* What the finer level's own vertices are interpolated from. */
static void mark_targets(const dmk_coarsening *c, const dmk_space *fine, uint8_t *vertex_mark)
{
    for (size_t k = 3 * (size_t)fine->first; k < 3 * (size_t)fine->end; k++) {
        vertex_mark[c->prolong_index[k]] = 1;
    }
}

void dmk_deal_mark(const dmk_share *s, const dmk_mesh *m, const dmk_hierarchy *h, int32_t level,
                   uint8_t *vertex_mark, uint8_t *edge_mark)
{
    if (level == s->first_whole) {
        memset(vertex_mark, 1, (size_t)s->vertex[level].n_whole);
        memset(edge_mark, 1, (size_t)s->level_edge[level].n_whole);
        return;
    }
    const dmk_graph *g = level > 0 ? &h->level[level - 1].coarse : NULL;
    mark_neighbours(&s->vertex[level], g ? g->n_edges : m->n_edges, g ? g->edge : m->edge_vertex,
                    vertex_mark, edge_mark);
    mark_sources(&h->level[level], &s->vertex[level + 1], &s->level_edge[level + 1], vertex_mark,
                 edge_mark);
    if (level > 0) mark_targets(&h->level[level - 1], &s->vertex[level - 1], vertex_mark);
}

/* ---- the local tables ------------------------------------------------------------------------ */

/* Edges of which an end is not here lead from the last vertex, a gap, to itself: only their weights
 * are wanted. */
static int local_edges(dmk_context *ctx, const dmk_space *vertex, const dmk_space *edge,
                       const dmk_graph *whole, dmk_graph *local)
{
    int rc;
    local->n = vertex->n;
    local->n_edges = edge->n;
    DMK_TRY(DMK_NEW(ctx, local->edge, 2 * (size_t)edge->n));
    for (int32_t k = 0; k < edge->n; k++) {
        const int32_t *end = whole->edge + 2 * (size_t)edge->whole[k];
        const int32_t a = dmk_space_slot(vertex, end[0]), b = dmk_space_slot(vertex, end[1]);
        bool here = a >= 0 && b >= 0;
        local->edge[2 * k] = here ? a : vertex->n - 1;
        local->edge[2 * k + 1] = here ? b : vertex->n - 1;
    }
done:
    return rc;
}

/* Rows of own fine vertices; the others' stay without weights. */
static int local_prolongation(dmk_context *ctx, const dmk_space *fine, const dmk_space *coarse,
                              const dmk_coarsening *whole, dmk_coarsening *local)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, local->prolong_index, 3 * (size_t)fine->n));
    DMK_TRY(DMK_NEW(ctx, local->prolong_weight, 3 * (size_t)fine->n));
    for (int32_t i = fine->first; i < fine->end; i++) {
        for (int k = 0; k < 3; k++) {
            size_t to = 3 * (size_t)dmk_space_slot(fine, i) + (size_t)k,
                   from = 3 * (size_t)i + (size_t)k;
            local->prolong_index[to] = dmk_space_slot(coarse, whole->prolong_index[from]);
            local->prolong_weight[to] = whole->prolong_weight[from];
        }
    }
done:
    return rc;
}

/* A table of compressed rows: those of own items, `row` from the first one on; or with their entries' local
 * slots, of all local items. */
typedef struct table {
    int32_t *row, *entry;
    float *value;
} table;

static int local_table(dmk_context *ctx, const dmk_space *rows, const dmk_space *entries,
                       const table *own, table *local)
{
    int rc;
    const int32_t from = own->row[0], n = own->row[rows->end - rows->first] - from;
    int32_t at = 0;
    DMK_TRY(DMK_NEW(ctx, local->row, (size_t)rows->n + 1));
    DMK_TRY(DMK_NEW(ctx, local->entry, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, local->value, (size_t)n));
    for (int32_t i = 0; i < rows->n; i++) {
        int32_t g = rows->whole[i];
        const int32_t *row = own->row + (g - rows->first);
        if (g >= 0 && dmk_space_owns(rows, g)) at += row[1] - row[0];
        local->row[i + 1] = at;
    }
    for (int32_t k = 0; k < n; k++) {
        local->entry[k] = dmk_space_slot(entries, own->entry[from + k]);
        local->value[k] = own->value[from + k];
    }
done:
    return rc;
}

static int local_level(dmk_context *ctx, const dmk_share *s, int32_t level,
                       const dmk_coarsening *whole, dmk_coarsening *local)
{
    int rc;
    const dmk_space *fine = &s->vertex[level], *coarse = &s->vertex[level + 1];
    table restriction = {0}, galerkin = {0};
    DMK_TRY(local_edges(ctx, coarse, &s->level_edge[level + 1], &whole->coarse, &local->coarse));
    DMK_TRY(local_prolongation(ctx, fine, coarse, whole, local));
    rc = local_table(
        ctx, coarse, fine,
        &(table){whole->restrict_row + coarse->first, whole->restrict_fine, whole->restrict_weight},
        &restriction);
    local->restrict_row = restriction.row;
    local->restrict_fine = restriction.entry;
    local->restrict_weight = restriction.value;
    if (rc != DMK_OK) goto done;
    rc = local_table(ctx, &s->level_edge[level + 1], &s->level_edge[level],
                     &(table){(int32_t *)(uintptr_t)own_rows(whole, &s->level_edge[level + 1]),
                              whole->galerkin_edge, whole->galerkin_coef},
                     &galerkin);
    local->galerkin_row = galerkin.row;
    local->galerkin_edge = galerkin.entry;
    local->galerkin_coef = galerkin.value;
done:
    return rc;
}

int dmk_share_levels(dmk_context *ctx, dmk_share *s, dmk_hierarchy *h, bool keep, dmk_local *local)
{
    int rc = DMK_OK;
    local->first_whole = s->first_whole;
    local->hierarchy.n = h->n;
    for (int32_t i = s->first_whole; i < h->n; i++) local->hierarchy.level[i] = h->level[i];
    for (int32_t i = 0; i < s->first_whole; i++) {
        const dmk_graph *g = &local->hierarchy.level[i].coarse;
        DMK_TRY(local_level(ctx, s, i, &h->level[i], &local->hierarchy.level[i]));
        if (i + 1 < s->first_whole) DMK_TRY(dmk_split_graph(ctx, s, i + 1, g->n_edges, g->edge));
        if (!keep) dmk_coarsening_free(&h->level[i]);
    }
done:
    return rc;
}
