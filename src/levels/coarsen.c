/* The hierarchy of coarse graphs; see coarsen.h. Each step: samples and their cells (cells.c), the
 * adjacency of the cells with each cell's mean position, interpolation weights (prolong.c), tables of
 * the Galerkin product (galerkin.c). */
#include "levels/coarsen.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void dmk_coarsening_free(dmk_coarsening *c)
{
    free(c->coarse.edge);
    free(c->coarse.xyz);
    free(c->prolong_index);
    free(c->prolong_weight);
    free(c->restrict_row);
    free(c->restrict_fine);
    free(c->restrict_weight);
    free(c->galerkin_row);
    free(c->galerkin_edge);
    free(c->galerkin_coef);
    memset(c, 0, sizeof *c);
}

void dmk_hierarchy_free(dmk_hierarchy *h)
{
    for (int l = 0; l < DMK_MAX_LEVELS; l++) dmk_coarsening_free(&h->level[l]);
    memset(h, 0, sizeof *h);
}

/* What resists so much, or conducts the wrong way, joins nothing that is not joined otherwise. */
static const float weak = 1e9f;

static float resistance(double conductance)
{
    return conductance * weak > 1 ? (float)(1 / conductance) : weak;
}

float dmk_narrow_length(double length)
{
    return (float)fmin(length, 1e30);
}

/* By the edges' lengths or, if it resists, their conductances. */
static int graph_adjacency(dmk_context *ctx, const dmk_graph *graph, const double *of_edge,
                           bool resists, dmk_adjacency *g)
{
    int rc;
    int32_t *fill = NULL;
    *g = (dmk_adjacency){.n = graph->n, .resists = resists};
    DMK_TRY(DMK_NEW(ctx, g->row, (size_t)g->n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, g->to, 2 * (size_t)graph->n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, g->length, 2 * (size_t)graph->n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, fill, (size_t)g->n));
    for (int32_t h = 0; h < 2 * graph->n_edges; h++) {
        if (!resists || of_edge[h / 2] != 0) g->row[graph->edge[h] + 1]++;
    }
    for (int32_t v = 0; v < g->n; v++) {
        fill[v] = g->row[v];
        g->row[v + 1] += g->row[v];
    }
    for (int32_t h = 0; h < 2 * graph->n_edges; h++) {
        const double x = of_edge[h / 2];
        if (resists && x == 0) continue;
        const int32_t at = fill[graph->edge[h]]++;
        g->to[at] = graph->edge[h ^ 1];
        g->length[at] = resists ? resistance(x) : dmk_narrow_length(x);
    }
done:
    free(fill);
    if (rc != DMK_OK) dmk_adjacency_free(g);
    return rc;
}

/* The adjacency of cells, made in pieces: cells one after another. */
typedef struct joining {
    const dmk_adjacency *fine;
    const dmk_cells *cells;
    dmk_adjacency *g;
    int32_t n_pieces;
    int32_t **to; /* n_pieces: neighbours of a piece's cells */
} joining;

static int32_t first_of(const joining *j, int32_t piece)
{
    return dmk_range_begin(j->cells->n, piece, j->n_pieces);
}

/* The neighbours of cell a, increasing. Returns their number. stamp: for each cell, a + 1 where it is one. */
static int32_t list_neighbours(const joining *j, int32_t a, int32_t *stamp, int32_t *to)
{
    const dmk_adjacency *fine = j->fine;
    int32_t n = 0;
    for (int32_t m = j->cells->row[a]; m < j->cells->row[a + 1]; m++) {
        const int32_t v = j->cells->member[m];
        for (int32_t i = fine->row[v]; i < fine->row[v + 1]; i++) {
            const int32_t b = j->cells->owner[fine->to[i]];
            if (b == a || stamp[b] == a + 1) continue;
            stamp[b] = a + 1;
            to[n++] = b;
        }
    }
    dmk_sort(n, to);
    return n;
}

/* Of a piece's cells, the neighbours, and their numbers in g->row[cell + 1]. */
static int join_piece(dmk_context *own, int32_t piece, void *data)
{
    int rc;
    const joining *j = data;
    const int32_t begin = first_of(j, piece), end = first_of(j, piece + 1);
    int32_t *stamp = NULL, n = 0;
    size_t most = 1;
    for (int32_t m = j->cells->row[begin]; m < j->cells->row[end]; m++) {
        const int32_t *row = j->fine->row + j->cells->member[m];
        most += (size_t)(row[1] - row[0]);
    }
    DMK_TRY(DMK_NEW(own, stamp, (size_t)j->cells->n));
    DMK_TRY(DMK_NEW_UNSET(own, j->to[piece], most));
    for (int32_t a = begin; a < end; a++) {
        const int32_t found = list_neighbours(j, a, stamp, j->to[piece] + n);
        j->g->row[a + 1] = found;
        n += found;
    }
done:
    free(stamp);
    return rc;
}

/* Two cells are adjacent when a fine edge joins them. Connected if the fine graph is. */
static int cell_adjacency(dmk_context *ctx, const dmk_adjacency *fine, const dmk_cells *cells,
                          dmk_adjacency *g)
{
    int rc;
    joining j = {.fine = fine, .cells = cells, .g = g, .n_pieces = dmk_parallel_threads(ctx)};
    *g = (dmk_adjacency){.n = cells->n};
    DMK_TRY(DMK_NEW(ctx, g->row, (size_t)g->n + 1));
    DMK_TRY(DMK_NEW(ctx, j.to, (size_t)j.n_pieces));
    DMK_TRY(dmk_parallel_pieces(ctx, j.n_pieces, join_piece, &j));
    for (int32_t a = 0; a < g->n; a++) g->row[a + 1] += g->row[a];
    DMK_TRY(DMK_NEW_UNSET(ctx, g->to, (size_t)g->row[g->n] + 1));
    for (int32_t piece = 0; piece < j.n_pieces; piece++) {
        const int32_t begin = g->row[first_of(&j, piece)], end = g->row[first_of(&j, piece + 1)];
        memcpy(g->to + begin, j.to[piece], (size_t)(end - begin) * sizeof *g->to);
    }
done:
    for (int32_t piece = 0; j.to && piece < j.n_pieces; piece++) free(j.to[piece]);
    free(j.to);
    if (rc != DMK_OK) dmk_adjacency_free(g);
    return rc;
}

float dmk_link_length(const double p[3], const double q[3])
{
    const double x = q[0] - p[0], y = q[1] - p[1], z = q[2] - p[2];
    return dmk_narrow_length(sqrt(x * x + y * y + z * z));
}

/* The cells' mean positions, then the lengths of their links. */
typedef struct placing {
    const dmk_cells *cells;
    const double *fine_xyz;
    double *xyz;
    dmk_adjacency *g;
} placing;

static void place_range(int32_t begin, int32_t end, void *data)
{
    const placing *p = data;
    const dmk_cells *cells = p->cells;
    for (int32_t a = begin; a < end; a++) {
        double mean[3] = {0}, n = cells->row[a + 1] - cells->row[a];
        for (int32_t m = cells->row[a]; m < cells->row[a + 1]; m++) {
            const double *x = p->fine_xyz + 3 * (size_t)cells->member[m];
            for (int k = 0; k < 3; k++) mean[k] += x[k] / n;
        }
        memcpy(p->xyz + 3 * (size_t)a, mean, sizeof mean);
    }
}

static void measure_range(int32_t begin, int32_t end, void *data)
{
    const placing *p = data;
    for (int32_t v = begin; v < end; v++) {
        for (int32_t i = p->g->row[v]; i < p->g->row[v + 1]; i++)
            p->g->length[i] =
                dmk_link_length(p->xyz + 3 * (size_t)v, p->xyz + 3 * (size_t)p->g->to[i]);
    }
}

static int place_cells(dmk_context *ctx, const dmk_cells *cells, const double *fine_xyz,
                       double **xyz, dmk_adjacency *g)
{
    int rc;
    DMK_TRY(DMK_NEW_UNSET(ctx, *xyz, 3 * (size_t)cells->n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, g->length, (size_t)g->row[g->n] + 1));
    placing p = {.cells = cells, .fine_xyz = fine_xyz, .xyz = *xyz, .g = g};
    dmk_parallel(ctx, cells->n, place_range, &p);
    dmk_parallel(ctx, cells->n, measure_range, &p);
done:
    return rc;
}

/* The coarse vertices and the prolongation; *fine becomes the adjacency of the coarse level. Without enough
 * gain nothing is made. */
static int make_weights(dmk_context *ctx, dmk_adjacency *fine, const double *xyz, dmk_coarsening *c)
{
    int rc;
    dmk_cells cells;
    dmk_adjacency coarse = {0};
    DMK_TRY(dmk_cells_create(ctx, fine, &cells));
    if (dmk_gains_nothing(cells.n, fine->n)) goto done;
    c->coarse.n = cells.n;
    DMK_TRY(cell_adjacency(ctx, fine, &cells, &coarse));
    dmk_adjacency_free(fine);
    DMK_TRY(place_cells(ctx, &cells, xyz, &c->coarse.xyz, &coarse));
    DMK_TRY(dmk_prolong_create(ctx, &cells, &coarse, xyz, c));
    *fine = coarse;
    memset(&coarse, 0, sizeof coarse);
done:
    dmk_adjacency_free(&coarse);
    dmk_cells_free(&cells);
    return rc;
}

/* One level of the descent; c->coarse.n is 0 without enough gain. */
static int coarsen(dmk_context *ctx, dmk_adjacency *fine, const dmk_graph *graph, dmk_coarsening *c)
{
    int rc = DMK_OK;
    const int32_t n_fine = fine->n;
    DMK_TRY(make_weights(ctx, fine, graph->xyz, c));
    fine->n = c->coarse.n;
    if (fine->n > 0)
        rc = dmk_galerkin_create(ctx, n_fine, graph->n_edges, graph->edge, 0, fine->n, c);
done:
    return rc;
}

/* The number of an edge in a graph of sorted edges; -1: there is none. */
static int32_t find_edge(const dmk_graph *graph, int32_t a, int32_t b)
{
    int32_t lo = 0, hi = graph->n_edges;
    if (a > b) return find_edge(graph, b, a);
    while (lo < hi) {
        const int32_t mid = lo + (hi - lo) / 2, *edge = graph->edge + 2 * (size_t)mid;
        if (edge[0] < a || (edge[0] == a && edge[1] < b))
            lo = mid + 1;
        else
            hi = mid;
    }
    const int32_t *edge = graph->edge + 2 * (size_t)lo;
    return lo < graph->n_edges && edge[0] == a && edge[1] == b ? lo : -1;
}

/* The conductances of the coarse graph in place of those of the fine one, and the lengths of its adjacency. */
static int coarse_resistances(dmk_context *ctx, const dmk_coarsening *c, double **conductance,
                              dmk_adjacency *g)
{
    int rc;
    double *coarse = NULL;
    DMK_TRY(DMK_NEW(ctx, coarse, (size_t)c->coarse.n_edges + 1));
    for (int32_t k = 0; k < c->coarse.n_edges; k++) {
        for (int32_t i = c->galerkin_row[k]; i < c->galerkin_row[k + 1]; i++)
            coarse[k] += c->galerkin_coef[i] * (*conductance)[c->galerkin_edge[i]];
    }
    for (int32_t v = 0; v < g->n; v++) {
        for (int32_t i = g->row[v]; i < g->row[v + 1]; i++) {
            const int32_t k = find_edge(&c->coarse, v, g->to[i]);
            g->length[i] = k >= 0 ? resistance(coarse[k]) : weak;
        }
    }
    g->resists = true;
    free(*conductance);
    *conductance = coarse;
done:
    return rc;
}

/* Down to `coarsest`, by *conductance or, if that is NULL, by lengths. */
static int descend(dmk_context *ctx, const dmk_graph *graph, int32_t coarsest,
                   const dmk_level_taker *taker, double **conductance, dmk_adjacency *fine,
                   dmk_hierarchy *h)
{
    int rc = DMK_OK;
    while (fine->n > coarsest && h->n < DMK_MAX_LEVELS) {
        dmk_coarsening *c = &h->level[h->n];
        DMK_TRY(coarsen(ctx, fine, h->n ? &h->level[h->n - 1].coarse : graph, c));
        if (fine->n == 0) break;
        h->n++;
        if (conductance) DMK_TRY(coarse_resistances(ctx, c, conductance, fine));
        if (taker) DMK_TRY(taker->take(ctx, taker->user, c));
    }
done:
    return rc;
}

int dmk_hierarchy_go_on(dmk_context *ctx, const dmk_graph *mesh, int32_t coarsest,
                        const dmk_level_taker *taker, dmk_adjacency *fine, dmk_hierarchy *h)
{
    int rc = descend(ctx, mesh, coarsest, taker, NULL, fine, h);
    if (taker) {
        const int taken = taker->take(ctx, taker->user, NULL);
        if (rc == DMK_OK) rc = taken;
    }
    dmk_adjacency_free(fine);
    if (rc != DMK_OK) dmk_hierarchy_free(h);
    return rc;
}

int dmk_hierarchy_of_conductances(dmk_context *ctx, const dmk_graph *graph, double **conductance,
                                  int32_t coarsest, dmk_hierarchy *h)
{
    int rc;
    dmk_adjacency fine = {0};
    memset(h, 0, sizeof *h);
    DMK_TRY(graph_adjacency(ctx, graph, *conductance, true, &fine));
    DMK_TRY(descend(ctx, graph, coarsest, NULL, conductance, &fine, h));
    if (fine.n == 0 || fine.n > coarsest) dmk_hierarchy_free(h);
done:
    free(*conductance);
    *conductance = NULL;
    dmk_adjacency_free(&fine);
    if (rc != DMK_OK) dmk_hierarchy_free(h);
    return rc;
}

int dmk_hierarchy_hand_over(dmk_context *ctx, const dmk_mesh *m, int32_t coarsest,
                            const dmk_level_taker *taker, dmk_hierarchy *h)
{
    dmk_adjacency fine;
    const dmk_graph mesh = {m->n_vertices, m->n_edges, m->edge_vertex, m->xyz};
    memset(h, 0, sizeof *h);
    const int rc = graph_adjacency(ctx, &mesh, m->length, false, &fine);
    return rc == DMK_OK ? dmk_hierarchy_go_on(ctx, &mesh, coarsest, taker, &fine, h) : rc;
}

int dmk_hierarchy_create(dmk_context *ctx, const dmk_mesh *m, int32_t coarsest, dmk_hierarchy *h)
{
    return dmk_hierarchy_hand_over(ctx, m, coarsest, NULL, h);
}
