#include "solver/fine_graph.h"

#include "solver/sell.h"

#include <stdlib.h>
#include <string.h>

/* 334 solves on libcgal-demo take 3,732 steps and 38.0 s with this part, 4,234 and 39.1 with 0.1, 3,567 and 39.0 with
 * 0.005: on meshes with few needles a step takes 1.7 to 2.5 times as long as through T, and up to a fifth as many do.
 * Beds of printers and other CAD parts have 0.06 to 0.99. */
static const double part_from = 0.02;

/* Single precision, which the graph is in, loses what couples a needle's far ends beside what couples its near ones
 * where cotangents are larger. 428 small hostile meshes take 50 s, with 1e5 for this 71, with 1e7 52, and without a
 * limit 59, and two more have a gap above 0.3 %. */
static const double too_sharp = 1e6;

/* The tables of the first step have up to six entries for each of ten edges a triangle, with 32-bit places. */
enum { MOST_TRIANGLES = 1 << 24 };

bool dmk_fine_graph_pays(int32_t n_triangles, int64_t n_needles, double sharpest)
{
    return (double)n_needles > part_from * n_triangles && sharpest < too_sharp &&
           n_triangles <= MOST_TRIANGLES;
}

/* The graph as the hierarchy is made of it: midpoints 0 .. n_edges-1, then the vertices, at mu = 1. */
typedef struct plain {
    dmk_graph graph;
    double *conductance;
} plain;

static void plain_free(plain *g)
{
    free(g->graph.edge);
    free(g->graph.xyz);
    free(g->conductance);
}

static void set_edge(plain *g, int32_t k, int32_t a, int32_t b, double conductance)
{
    g->graph.edge[2 * (size_t)k] = dmk_min_i(a, b);
    g->graph.edge[2 * (size_t)k + 1] = dmk_max_i(a, b);
    g->conductance[k] += conductance;
}

static void set_places(const dmk_mesh *m, double *xyz)
{
    for (int32_t e = 0; e < m->n_edges; e++) {
        const double *p = m->xyz + 3 * (size_t)m->edge_vertex[2 * e];
        const double *q = m->xyz + 3 * (size_t)m->edge_vertex[2 * e + 1];
        for (int k = 0; k < 3; k++) xyz[3 * (size_t)e + k] = (p[k] + q[k]) / 2;
    }
    memcpy(xyz + 3 * (size_t)m->n_edges, m->xyz, 3 * (size_t)m->n_vertices * sizeof *xyz);
}

static void set_edges(const dmk_mesh *m, int32_t elements_at, plain *g)
{
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const int32_t t = h / 3, k = h % 3, e = m->triangle_edge[h];
        const int32_t i = m->triangle_edge[dmk_next(h)], j = m->triangle_edge[dmk_previous(h)];
        const int32_t *end = m->edge_vertex + 2 * (size_t)e;
        const double cot = dmk_cot(m, h);
        set_edge(g, elements_at + (int32_t)dmk_slot(t, k, 6), i, j, cot);
        set_edge(g, elements_at + (int32_t)dmk_slot(t, 3 + k, 6), e, m->n_edges + m->triangle[h],
                 0);
        for (int side = 0; side < 2; side++)
            set_edge(g, 3 * e + side, e, m->n_edges + end[side], cot / 2);
        set_edge(g, 3 * e + 2, m->n_edges + end[0], m->n_edges + end[1], 0);
    }
}

static int plain_create(dmk_context *ctx, const dmk_mesh *m, const dmk_fine_graph *f, plain *g)
{
    int rc;
    const size_t n = (size_t)f->n_edges;
    g->graph.n = m->n_edges + m->n_vertices;
    g->graph.n_edges = f->n_edges;
    DMK_TRY(DMK_NEW(ctx, g->graph.edge, 2 * n));
    DMK_TRY(DMK_NEW(ctx, g->conductance, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, g->graph.xyz, 3 * (size_t)g->graph.n));
    set_places(m, g->graph.xyz);
    set_edges(m, f->elements_at, g);
done:
    return rc;
}

static void set_slots(const dmk_counts *c, const dmk_mesh *m, int32_t *slot)
{
    const int32_t none =
        (int32_t)dmk_slot(c->n_elements_pad - 1, 0, 9); /* of no element: stays 0 */
    for (int32_t i = 0; i < 2 * dmk_padded(3 * m->n_edges); i++) slot[i] = none;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        const int32_t t = h / 3, k = h % 3, e = m->triangle_edge[h];
        const int second = m->edge_triangle[2 * e] != t;
        const bool turned = m->edge_vertex[2 * e] != m->triangle[dmk_next(h)];
        for (int i = 0; i < 3; i++) {
            const int part = i < 2 && turned ? 1 - i : i;
            slot[dmk_slot(3 * e + i, second, 2)] = (int32_t)dmk_slot(t, 3 * k + part, 9);
        }
    }
}

/* From numbers without a gap between midpoints and vertices to rows. */
static int32_t row_of(const dmk_counts *c, int32_t i)
{
    return i < c->n_edges ? i : i - c->n_edges + c->vertex_row;
}

/* The first step down, from the rows: those in the gap have no part in it. */
static int spread(dmk_context *ctx, const dmk_counts *counts, dmk_coarsening *c)
{
    int rc;
    int32_t *index = NULL;
    float *weight = NULL;
    DMK_TRY(DMK_NEW(ctx, index, 3 * (size_t)counts->n_rows));
    DMK_TRY(DMK_NEW(ctx, weight, 3 * (size_t)counts->n_rows));
    for (int32_t i = 0; i < counts->n_edges + counts->n_vertices; i++) {
        const size_t from = 3 * (size_t)i, to = 3 * (size_t)row_of(counts, i);
        memcpy(index + to, c->prolong_index + from, 3 * sizeof *index);
        memcpy(weight + to, c->prolong_weight + from, 3 * sizeof *weight);
    }
    for (int32_t i = 0; i < c->restrict_row[c->coarse.n]; i++)
        c->restrict_fine[i] = row_of(counts, c->restrict_fine[i]);
    free(c->prolong_index);
    free(c->prolong_weight);
    c->prolong_index = index;
    c->prolong_weight = weight;
    index = NULL;
    weight = NULL;
done:
    free(index);
    free(weight);
    return rc;
}

int dmk_fine_graph_create(dmk_context *ctx, const dmk_counts *c, const dmk_mesh *m,
                          int32_t coarsest, dmk_fine_graph *f)
{
    int rc;
    plain g = {.conductance = NULL};
    memset(f, 0, sizeof *f);
    f->elements_at = dmk_padded(3 * m->n_edges);
    f->n_edges = f->elements_at + 6 * c->n_elements_pad;
    DMK_TRY(plain_create(ctx, m, f, &g));
    DMK_TRY(dmk_hierarchy_of_conductances(ctx, &g.graph, &g.conductance, coarsest, &f->hierarchy));
    if (f->hierarchy.n == 0) goto done;
    DMK_TRY(spread(ctx, c, &f->hierarchy.level[0]));
    DMK_TRY(DMK_NEW_UNSET(ctx, f->slot, 2 * (size_t)f->elements_at));
    set_slots(c, m, f->slot);
    f->edge = g.graph.edge;
    g.graph.edge = NULL;
    for (size_t i = 0; i < 2 * (size_t)f->n_edges; i++) f->edge[i] = row_of(c, f->edge[i]);
done:
    plain_free(&g);
    if (rc != DMK_OK) dmk_fine_graph_free(f);
    return rc;
}

void dmk_fine_graph_free(dmk_fine_graph *f)
{
    free(f->edge);
    free(f->slot);
    dmk_hierarchy_free(&f->hierarchy);
    memset(f, 0, sizeof *f);
}
