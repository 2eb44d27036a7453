/* What mesh/info.c tells of a mesh, of one in pieces: the same sums, from the same ranges in the same order. */
#include "ranks/pieces.h"

#include "base/vec3.h"

#include <stdlib.h>

/* ---- sums ------------------------------------------------------------------------------------- */

/* n numbers of all ranks, of which this one has those from `first` on. */
typedef struct numbers {
    int64_t n, first, n_own;
    const double *own;
} numbers;

/* To each range's sum what is here of the range. */
static void add_own(const numbers *x, double *sum)
{
    const int64_t end = x->first + x->n_own;
    for (int k = 0; k < DMK_MEASURE_PIECES; k++) {
        const int64_t to = dmk_even_bound(x->n, k + 1, DMK_MEASURE_PIECES);
        int64_t i = dmk_even_bound(x->n, k, DMK_MEASURE_PIECES);
        i = i > x->first ? i : x->first;
        for (; i < to && i < end; i++) sum[k] += x->own[i - x->first];
    }
}

/* Rank after rank, as a range may be of several. */
static int add_all(dmk_context *ctx, const dmk_ranks *ranks, const numbers *x, double *total)
{
    int rc = DMK_OK;
    double sum[DMK_MEASURE_PIECES] = {0};
    for (int r = 0; r < ranks->size; r++) {
        if (r == ranks->rank) add_own(x, sum);
        DMK_TRY(dmk_ranks_spread_from(ctx, ranks, r, sum, sizeof sum));
    }
    *total = 0;
    for (int k = 0; k < DMK_MEASURE_PIECES; k++) *total += sum[k];
done:
    return rc;
}

/* ---- triangles -------------------------------------------------------------------------------- */

static void measure_tile(const double *x, double *area, dmk_measures *of)
{
    double cot[3];
    const double l[3] = {dmk_distance(x + 3, x + 6), dmk_distance(x + 6, x),
                         dmk_distance(x, x + 3)};
    dmk_measure_sides(l, area, cot);
    for (int k = 0; k < 3; k++) {
        dmk_measures_edge(of, l[k]);
        dmk_measures_corner(of, cot[k], x + 3 * k);
    }
}

static int measure_tiles(dmk_context *ctx, const dmk_pieces *p, const double *xyz, dmk_measures *of)
{
    int rc;
    double *area = NULL;
    DMK_TRY(DMK_NEW(ctx, area, p->n_tiles));
    for (size_t t = 0; t < p->n_tiles; t++) measure_tile(xyz + 9 * t, &area[t], of);
    const numbers areas = {p->n_triangles,
                           dmk_even_bound(p->n_triangles, p->ranks.rank, p->ranks.size),
                           (int64_t)p->n_tiles, area};
    rc = add_all(ctx, &p->ranks, &areas, &of->area);
done:
    free(area);
    return rc;
}

/* ---- edges ------------------------------------------------------------------------------------ */

typedef struct side {
    int64_t edge;
    double length;
} side;

/* Each to the rank that looks after the edge: once, of two triangles by the one that runs it up; where there is a
 * border perhaps twice. */
static int mail_sides(dmk_context *ctx, const dmk_pieces *p, const double *xyz, dmk_mail *mail)
{
    int rc;
    const bool all = p->n_border_edges > 0;
    DMK_TRY(dmk_mail_expect(ctx, mail, all ? 3 * p->n_tiles : 3 * p->n_tiles / 2));
    for (size_t h = 0; h < 3 * p->n_tiles; h++) {
        const dmk_tile *t = &p->tile[h / 3];
        const size_t k = h % 3, a = (k + 1) % 3, b = (k + 2) % 3;
        const double *x = xyz + 9 * (h / 3);
        if (!all && t->vertex[a] > t->vertex[b]) continue;
        const side s = {t->edge[k], dmk_distance(x + 3 * a, x + 3 * b)};
        DMK_TRY(dmk_mail_add(ctx, mail, dmk_owner(p->edge_bound, p->ranks.size, s.edge), &s));
    }
    rc = dmk_mail_send(ctx, &p->ranks, mail);
done:
    return rc;
}

static int measure_edges(dmk_context *ctx, const dmk_pieces *p, const double *xyz, double *sum)
{
    int rc;
    const int64_t first = p->edge_bound[p->ranks.rank],
                  n = p->edge_bound[p->ranks.rank + 1] - first;
    dmk_mail mail = {.item = sizeof(side)};
    double *length = NULL;
    DMK_TRY(mail_sides(ctx, p, xyz, &mail));
    DMK_TRY(DMK_NEW(ctx, length, (size_t)n));
    const side *came = (const void *)mail.data;
    for (size_t i = 0; i < mail.n; i++) length[came[i].edge - first] = came[i].length;
    rc = add_all(ctx, &p->ranks, &(numbers){p->n_edges, first, n, length}, sum);
done:
    dmk_mail_free(&mail);
    free(length);
    return rc;
}

/* ---- all together ----------------------------------------------------------------------------- */

int dmk_pieces_measure(dmk_context *ctx, dmk_pieces *p, const double *xyz)
{
    int rc;
    const size_t size = (size_t)p->ranks.size;
    dmk_measures mine = dmk_measures_none(), *all = NULL;
    double area, edges;
    DMK_TRY(measure_tiles(ctx, p, xyz, &mine));
    DMK_TRY(measure_edges(ctx, p, xyz, &mine.edges));
    DMK_TRY(dmk_gather_each(ctx, &p->ranks, sizeof mine, &mine, (void **)&all));
    area = mine.area;
    edges = mine.edges; /* they are all ranks' already */
    p->measures = dmk_measures_none();
    for (size_t r = 0; r < size; r++) dmk_measures_add(&p->measures, &all[r]);
    p->measures.area = area;
    p->measures.edges = edges;
done:
    free(all);
    return rc;
}

/* Each vertex of the border has one edge before it and one behind, so loops are the border's components. */
int dmk_pieces_count_loops(dmk_context *ctx, dmk_pieces *p, size_t n, const int64_t *end)
{
    int rc;
    size_t n_edges;
    int64_t *all = NULL;
    int32_t *parent = NULL;
    dmk_list vertex = {0};
    DMK_TRY(dmk_join_some(ctx, &p->ranks, n, 2 * sizeof *end, end, &n_edges, (void **)&all));
    for (size_t i = 0; i < 2 * n_edges; i++) DMK_TRY(dmk_list_add(ctx, &vertex, all[i]));
    dmk_list_sort(&vertex);
    rc = dmk_list_unite(ctx, &vertex, n_edges, all, &parent, &p->n_border_loops);
done:
    free(all);
    free(parent);
    dmk_list_free(&vertex);
    return rc;
}
