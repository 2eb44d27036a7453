/* The metric of mesh/mollify.c on a mesh in ranks' shares: triangles take their turn in the order of the whole, rank
 * after rank, so that lengths have the same bits. */
#include "ranks/pieces.h"

#include "mesh/mollify.h"

#include <stdlib.h>
#include <string.h>

/* Edges that several ranks have: those here that others own, and those that others have of the own ones. */
typedef struct borders {
    const dmk_ranks *ranks;
    dmk_inquiry by_rank;
    size_t n_ghosts;
    int32_t *ghost, *shown; /* local edges */
} borders;

static void borders_free(borders *b)
{
    dmk_inquiry_free(&b->by_rank);
    free(b->ghost);
    free(b->shown);
}

static int find_edges(dmk_context *ctx, const dmk_plot *plot, size_t n, const int64_t *number,
                      int32_t **edge)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *edge, n));
    for (size_t i = 0; i < n; i++)
        (*edge)[i] = (int32_t)dmk_count_below(plot->edge, (size_t)plot->mesh.n_edges, number[i]);
done:
    return rc;
}

static int find_borders(dmk_context *ctx, const dmk_ranks *ranks, const dmk_plot *plot, borders *b)
{
    int rc = DMK_OK;
    const int64_t *bound = plot->bound[1];
    const dmk_space own = {.first = bound[ranks->rank], .end = bound[ranks->rank + 1]};
    const dmk_mail *shown = &b->by_rank.mail;
    dmk_list ghost = {0};
    for (int32_t e = 0; e < plot->mesh.n_edges; e++)
        DMK_TRY(dmk_list_add_ghost(ctx, &ghost, &own, plot->edge[e]));
    b->ranks = ranks;
    b->n_ghosts = ghost.n;
    DMK_TRY(dmk_ask(ctx, ranks, bound, ghost.n, ghost.at, &b->by_rank));
    DMK_TRY(find_edges(ctx, plot, ghost.n, ghost.at, &b->ghost));
    rc = find_edges(ctx, plot, shown->n, (const void *)shown->data, &b->shown);
done:
    dmk_list_free(&ghost);
    return rc;
}

/* Rank r's lengths to the owners of its edges. */
static int tell_owners(dmk_context *ctx, const borders *b, int r, double *length)
{
    int rc;
    const size_t size = (size_t)b->ranks->size;
    const bool tells = b->ranks->rank == r;
    const size_t n = tells ? b->n_ghosts : 0;
    int32_t *none = NULL, *in = NULL;
    double *sent = NULL, *came = NULL;
    DMK_TRY(DMK_NEW(ctx, none, size));
    DMK_TRY(DMK_NEW(ctx, in, size));
    if (!tells) in[r] = b->by_rank.asks[r];
    DMK_TRY(DMK_NEW(ctx, sent, n));
    DMK_TRY(DMK_NEW(ctx, came, (size_t)in[r]));
    for (size_t i = 0; i < n; i++) sent[i] = length[b->ghost[i]];
    DMK_TRY(
        dmk_exchange(ctx, b->ranks, tells ? b->by_rank.asked : none, in, sizeof *sent, sent, came));
    const int32_t *shown = b->shown + b->by_rank.mail.first[r];
    for (int32_t i = 0; i < in[r]; i++) length[shown[i]] = came[i];
done:
    free(none);
    free(in);
    free(sent);
    free(came);
    return rc;
}

/* The owners' lengths to all. */
static int tell_all(dmk_context *ctx, const borders *b, double *length)
{
    int rc;
    const size_t n_out = b->by_rank.mail.n, n_in = b->n_ghosts;
    double *sent = NULL, *came = NULL;
    DMK_TRY(DMK_NEW(ctx, sent, n_out));
    DMK_TRY(DMK_NEW(ctx, came, n_in));
    for (size_t i = 0; i < n_out; i++) sent[i] = length[b->shown[i]];
    DMK_TRY(
        dmk_exchange(ctx, b->ranks, b->by_rank.asks, b->by_rank.asked, sizeof *sent, sent, came));
    for (size_t i = 0; i < n_in; i++) length[b->ghost[i]] = came[i];
done:
    free(sent);
    free(came);
    return rc;
}

/* The own elements of the mesh here: they follow each other. */
static void own_range(const dmk_plot *plot, int32_t *begin, int32_t *end)
{
    *begin = 0;
    while (*begin < plot->mesh.n_triangles && !dmk_plot_owns(plot, *begin)) (*begin)++;
    *end = *begin + (int32_t)(plot->own[1] - plot->own[0]);
}

static int lengthen(dmk_context *ctx, const borders *b, const dmk_plot *plot, double *length)
{
    int rc = DMK_OK;
    int32_t begin, end, thin = 1;
    own_range(plot, &begin, &end);
    for (int round = 0; round < DMK_MOLLIFY_ROUNDS && thin > 0; round++) {
        thin = 0;
        for (int r = 0; r < b->ranks->size; r++) {
            if (r == b->ranks->rank) thin = dmk_lengthen(&plot->mesh, begin, end, length);
            DMK_TRY(tell_owners(ctx, b, r, length));
            DMK_TRY(tell_all(ctx, b, length));
        }
        DMK_TRY(dmk_ranks_check(ctx, b->ranks, b->ranks->largest(b->ranks->user, &thin, 1)));
    }
done:
    return rc;
}

int dmk_plot_mollify(dmk_context *ctx, const dmk_ranks *ranks, dmk_plot *plot)
{
    int rc;
    int32_t begin, end;
    double *length = NULL, *area = NULL, after;
    borders b = {.ghost = NULL};
    own_range(plot, &begin, &end);
    int32_t sharp = !dmk_needs_no_mollifying(&plot->mesh, begin, end);
    DMK_TRY(dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &sharp, 1)));
    if (!sharp) return DMK_OK;
    dmk_mesh *m = &plot->mesh;
    DMK_TRY(find_borders(ctx, ranks, plot, &b));
    DMK_TRY(DMK_NEW(ctx, length, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, area, (size_t)m->n_triangles));
    memcpy(length, m->length, (size_t)m->n_edges * sizeof *length);
    DMK_TRY(lengthen(ctx, &b, plot, length));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *e = m->triangle_edge + 3 * (size_t)t;
        const double l[3] = {length[e[0]], length[e[1]], length[e[2]]};
        double cot[3];
        dmk_measure_sides(l, &area[t], cot);
    }
    double *const old_length = m->length, *const old_area = m->area;
    m->area = area;
    rc = dmk_plot_add_areas(ctx, ranks, plot, &after);
    m->area = old_area;
    if (rc != DMK_OK || !dmk_mollified_is_good(plot->area, after)) goto done;
    m->length = length;
    m->area = area;
    plot->area = after;
    length = old_length;
    area = old_area;
done:
    borders_free(&b);
    free(length);
    free(area);
    return rc;
}
