/* The levels below a mesh that is dealt out: each rank makes its part of each, down to the first that is whole on
 * all of them. */
#include "ranks/part.h"

#include <stdlib.h>
#include <string.h>

void dmk_part_free(dmk_part *p)
{
    free(p->prolong_index);
    free(p->prolong_weight);
    free(p->restrict_row);
    free(p->restrict_fine);
    free(p->restrict_weight);
    free(p->edge);
    free(p->galerkin_row);
    free(p->galerkin_edge);
    free(p->galerkin_coef);
    free(p->other);
    memset(p, 0, sizeof *p);
}

void dmk_parts_free(dmk_parts *p)
{
    for (int l = 0; l < DMK_MAX_LEVELS; l++) dmk_part_free(&p->part[l]);
    dmk_hierarchy_free(&p->whole);
}

void dmk_side_free(dmk_side *s)
{
    free(s->row);
    free(s->link);
    free(s->xyz);
    free(s->edge);
    memset(s, 0, sizeof *s);
}

/* ---- T --------------------------------------------------------------------------------------- */

static int64_t vertex_of(const dmk_ground *t, int32_t e, int k)
{
    return dmk_whole_number(t->vertex, t->mesh->edge_vertex[2 * (size_t)e + (size_t)k]);
}

/* The links of own vertices, by the numbers of the edges. */
static int ground_links(dmk_context *ctx, const dmk_ground *t, dmk_side *side)
{
    int rc;
    const dmk_space *s = side->vertex;
    const int32_t n = dmk_space_own(s);
    int32_t *fill = NULL;
    DMK_TRY(DMK_NEW(ctx, side->row, (size_t)n + 1));
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)n));
    for (int32_t e = 0; e < t->mesh->n_edges; e++) {
        for (int k = 0; k < 2; k++) {
            const int64_t v = vertex_of(t, e, k);
            if (dmk_space_owns(s, v)) side->row[v - s->first + 1]++;
        }
    }
    for (int32_t v = 0; v < n; v++) {
        fill[v] = side->row[v];
        side->row[v + 1] += side->row[v];
    }
    DMK_TRY(DMK_NEW(ctx, side->link, (size_t)side->row[n]));
    for (int32_t e = 0; e < t->mesh->n_edges; e++) {
        for (int k = 0; k < 2; k++) {
            const int64_t v = vertex_of(t, e, k);
            if (dmk_space_owns(s, v))
                side->link[fill[v - s->first]++] =
                    (struct dmk_link){vertex_of(t, e, !k), dmk_narrow_length(t->mesh->length[e])};
        }
    }
done:
    free(fill);
    return rc;
}

static int ground_edges(dmk_context *ctx, const dmk_ground *t, dmk_side *side)
{
    int rc;
    int32_t n = 0;
    for (int32_t e = 0; e < t->mesh->n_edges; e++)
        n += dmk_space_owns(side->vertex, vertex_of(t, e, 0));
    DMK_TRY(DMK_NEW(ctx, side->edge, 3 * (size_t)n));
    for (int32_t e = 0; e < t->mesh->n_edges; e++) {
        int64_t *edge = side->edge + 3 * (size_t)side->n_edges;
        if (!dmk_space_owns(side->vertex, vertex_of(t, e, 0))) continue;
        edge[0] = dmk_whole_number(t->edge, e);
        edge[1] = vertex_of(t, e, 0);
        edge[2] = vertex_of(t, e, 1);
        side->n_edges++;
    }
done:
    return rc;
}

static int ground_side(dmk_context *ctx, const dmk_ground *t, dmk_side *side)
{
    int rc;
    const dmk_space *s = side->vertex;
    DMK_TRY(ground_links(ctx, t, side));
    DMK_TRY(ground_edges(ctx, t, side));
    DMK_TRY(DMK_NEW(ctx, side->xyz, 3 * (size_t)dmk_space_own(s)));
    for (int32_t v = 0; v < t->mesh->n_vertices; v++) {
        const int64_t whole = dmk_whole_number(t->vertex, v);
        if (!dmk_space_owns(s, whole)) continue;
        memcpy(side->xyz + 3 * (whole - s->first), t->mesh->xyz + 3 * (size_t)v,
               3 * sizeof *side->xyz);
    }
done:
    return rc;
}

/* ---- one step --------------------------------------------------------------------------------- */

/* *side becomes the coarse one; without enough gain coarse->n_whole is 0, and nothing is made. */
static int step(dmk_context *ctx, const dmk_ranks *ranks, dmk_side *side, dmk_space *coarse,
                dmk_space *edges, dmk_part *part)
{
    int rc;
    dmk_grown grown = {0};
    dmk_side next = {.vertex = coarse};
    DMK_TRY(dmk_grow_cells(ctx, ranks, side, coarse, &grown));
    if (dmk_gains_nothing(coarse->n_whole, side->vertex->n_whole)) {
        dmk_space_free(coarse);
        goto done;
    }
    DMK_TRY(dmk_grow_side(ctx, ranks, side, &grown, &next));
    DMK_TRY(dmk_part_weights(ctx, ranks, side, &grown, &next, part));
    DMK_TRY(dmk_part_product(ctx, ranks, side, &next, edges, part));
    dmk_side_free(side);
    *side = next;
    next = (dmk_side){0};
    rc = dmk_poll(ctx);
done:
    dmk_grown_free(&grown);
    dmk_side_free(&next);
    return rc;
}

/* ---- the first level that is whole -------------------------------------------------------------- */

/* All ranks' rows one after another. */
static int join_links(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *side,
                      dmk_adjacency *g)
{
    int rc;
    const dmk_space *s = side->vertex;
    const int32_t n = dmk_space_own(s);
    int32_t *length = NULL, *all = NULL;
    int64_t *bound = NULL;
    struct dmk_link *link = NULL;
    DMK_TRY(DMK_NEW(ctx, length, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, bound, (size_t)ranks->size + 1));
    for (int32_t v = 0; v < n; v++) length[v] = side->row[v + 1] - side->row[v];
    DMK_TRY(dmk_join_all(ctx, ranks, s->bound, sizeof *all, length, (void **)&all));
    DMK_TRY(dmk_ranks_bound(ctx, ranks, side->row[n], bound));
    DMK_TRY(dmk_join_all(ctx, ranks, bound, sizeof *link, side->link, (void **)&link));
    const size_t n_links = (size_t)bound[ranks->size];
    g->n = (int32_t)s->n_whole;
    DMK_TRY(DMK_NEW(ctx, g->row, (size_t)g->n + 1));
    DMK_TRY(DMK_NEW(ctx, g->to, n_links));
    DMK_TRY(DMK_NEW(ctx, g->length, n_links));
    for (int32_t v = 0; v < g->n; v++) g->row[v + 1] = g->row[v] + all[v];
    for (size_t i = 0; i < n_links; i++) {
        g->to[i] = (int32_t)link[i].to;
        g->length[i] = link[i].length;
    }
done:
    free(length);
    free(all);
    free(bound);
    free(link);
    return rc;
}

static int join_graph(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *side,
                      const dmk_space *edges, const dmk_part *part, dmk_graph *g)
{
    int rc;
    int64_t *edge = NULL;
    g->n = (int32_t)side->vertex->n_whole;
    g->n_edges = (int32_t)edges->n_whole;
    DMK_TRY(dmk_join_all(ctx, ranks, side->vertex->bound, 3 * sizeof *g->xyz, side->xyz,
                         (void **)&g->xyz));
    DMK_TRY(dmk_join_all(ctx, ranks, edges->bound, 2 * sizeof *edge, part->edge, (void **)&edge));
    DMK_TRY(DMK_NEW(ctx, g->edge, 2 * (size_t)g->n_edges));
    for (size_t i = 0; i < 2 * (size_t)g->n_edges; i++) g->edge[i] = (int32_t)edge[i];
done:
    free(edge);
    return rc;
}

/* ---- all levels ------------------------------------------------------------------------------- */

int dmk_share_coarsen(dmk_context *ctx, dmk_share *s, const dmk_ground *ground, int32_t coarsest,
                      dmk_parts *p)
{
    int rc;
    const int32_t below = dmk_gather_below(s);
    const dmk_ranks *ranks = &s->ranks;
    dmk_side side = {.vertex = &s->vertex[0]};
    dmk_adjacency rest = {0};
    int32_t l = 0;
    DMK_TRY(ground_side(ctx, ground, &side));
    for (; l < DMK_MAX_LEVELS; l++) {
        const int64_t n = s->vertex[l].n_whole;
        if (n <= coarsest || (l > 0 && n < below)) break;
        DMK_TRY(step(ctx, ranks, &side, &s->vertex[l + 1], &s->level_edge[l + 1], &p->part[l]));
        if (s->vertex[l + 1].n_whole == 0) break;
    }
    s->first_whole = p->whole.n = l;
    if (l == 0) goto done;
    DMK_TRY(join_links(ctx, ranks, &side, &rest));
    DMK_TRY(join_graph(ctx, ranks, &side, &s->level_edge[l], &p->part[l - 1],
                       &p->whole.level[l - 1].coarse));
    rc = dmk_hierarchy_go_on(ctx, NULL, coarsest, NULL, &rest, &p->whole);
done:
    dmk_side_free(&side);
    dmk_adjacency_free(&rest);
    return rc;
}
