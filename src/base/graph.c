#include "base/graph.h"

#include <stdlib.h>

typedef struct graph {
    int32_t *first, *next; /* neighbours of vertex v: next[first[v]..first[v + 1]) */
    bool *seen;
    int32_t at, *index;
} graph;

static int32_t degree_of(const graph *g, int32_t v)
{
    return g->first[v + 1] - g->first[v];
}

static int set_neighbours(dmk_context *ctx, size_t n_vertices, size_t n_edges, const int32_t *end,
                          size_t stride, graph *g)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, g->first, n_vertices + 2));
    DMK_TRY(DMK_NEW(ctx, g->next, 2 * n_edges));
    for (size_t i = 0; i < 2 * n_edges; i++) g->first[end[stride * (i / 2) + i % 2] + 2]++;
    for (size_t v = 0; v < n_vertices; v++) g->first[v + 2] += g->first[v + 1];
    /* first[v + 1] goes from where v's begin to where they end */
    for (size_t i = 0; i < 2 * n_edges; i++) {
        const int32_t *v = end + stride * (i / 2);
        g->next[g->first[v[i % 2] + 1]++] = v[1 - i % 2];
    }
done:
    return rc;
}

/* Follow the line that leaves `from` towards `to` up to a vertex of degree other than 2 or back to the start. */
static void follow(graph *g, int32_t from, int32_t to)
{
    const int32_t start = from;
    g->index[g->at++] = from;
    for (;;) {
        g->index[g->at++] = to;
        g->seen[to] = true;
        if (degree_of(g, to) != 2 || to == start) return;
        const int32_t *next = g->next + g->first[to], after = next[next[0] == from];
        from = to;
        to = after;
    }
}

int dmk_graph_lines(dmk_context *ctx, size_t n_vertices, size_t n_edges, const int32_t *end,
                    size_t stride, size_t *n_lines, int32_t **offset, int32_t **index)
{
    int rc;
    graph g = {0};
    *n_lines = 0;
    DMK_TRY(set_neighbours(ctx, n_vertices, n_edges, end, stride, &g));
    DMK_TRY(DMK_NEW(ctx, g.seen, n_vertices));
    DMK_TRY(DMK_NEW(ctx, *index, 2 * n_edges + 1));
    DMK_TRY(DMK_NEW(ctx, *offset, n_edges + 2));
    g.index = *index;
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t v = 0; v < (int32_t)n_vertices; v++) {
            const int32_t degree = degree_of(&g, v);
            const bool starts = pass == 0 ? degree != 2 : degree == 2 && !g.seen[v];
            for (int32_t k = 0; starts && k < (pass == 0 ? degree : 1); k++) {
                const int32_t to = g.next[g.first[v] + k]; /* seen, or less: written from there */
                if (degree_of(&g, to) == 2 ? g.seen[to] : to < v) continue;
                follow(&g, v, to);
                (*offset)[++*n_lines] = g.at;
            }
        }
    }
done:
    free(g.first);
    free(g.next);
    free(g.seen);
    return rc;
}
