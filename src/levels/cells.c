/* Samples of a graph's vertices and the cells around them; see coarsen.h. */
#include "levels/coarsen.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A sample covers what lies within this many times the mean length of its own edges. The radius is
 * local, so that graded meshes are thinned out evenly. Against 1.3 (which thins out by 3.5 instead
 * of 6), 2 halves the Galerkin tables and saves a tenth of a V-cycle and a third of the levels; to
 * a residual of 1e-4 CG takes the same number of iterations or one more, to 1e-8 up to two more. */
#define RADIUS 2.0f

enum { MOST_ENTRIES = 32 };

static float mean_length(const dmk_adjacency *g, int32_t v)
{
    float sum = 0;
    int32_t degree = g->row[v + 1] - g->row[v];
    for (int32_t i = g->row[v]; i < g->row[v + 1]; i++) sum += g->length[i];
    return degree ? sum / (float)degree : 0;
}

typedef struct edge {
    float length;
    int32_t to;
} edge;

static int compare_edges(const void *a, const void *b)
{
    const edge *p = a, *q = b;
    if (p->length != q->length) return p->length < q->length ? -1 : 1;
    return (p->to > q->to) - (p->to < q->to);
}

/* The edges of hubs, the shortest first. */
static int sort_hubs(dmk_context *ctx, dmk_adjacency *g)
{
    int rc = DMK_OK;
    edge *list = NULL;
    for (int32_t v = 0; v < g->n; v++) {
        int32_t from = g->row[v], n = g->row[v + 1] - from;
        if (n <= DMK_HUB) continue;
        free(list);
        DMK_TRY(DMK_NEW(ctx, list, (size_t)n));
        for (int32_t i = 0; i < n; i++) list[i] = (edge){g->length[from + i], g->to[from + i]};
        qsort(list, (size_t)n, sizeof *list, compare_edges);
        for (int32_t i = 0; i < n; i++) {
            g->length[from + i] = list[i].length;
            g->to[from + i] = list[i].to;
        }
    }
done:
    free(list);
    return rc;
}

/* Greedy sampling's record of what is covered. */
typedef struct cover {
    const dmk_adjacency *g;
    uint8_t *covered; /* n */
    int32_t *next;    /* n: for a hub, its edges before this one lead to what is covered */
} cover;

/* Cover the ends of the edges of w no longer than `rest`. */
static void cover_around(const cover *c, int32_t w, float rest)
{
    const dmk_adjacency *g = c->g;
    int32_t end = g->row[w + 1];
    if (end - g->row[w] > DMK_HUB) {
        while (c->next[w] < end && g->length[c->next[w]] <= rest) {
            c->covered[g->to[c->next[w]++]] = 1;
        }
        return;
    }
    for (int32_t k = g->row[w]; k < end; k++) {
        if (g->length[k] <= rest) c->covered[g->to[k]] = 1;
    }
}

/* Mark what lies within the radius of sample v, which is not asked for again, over paths of one or two edges. */
static void cover_sample(const cover *c, int32_t v)
{
    const dmk_adjacency *g = c->g;
    float radius = RADIUS * mean_length(g, v);
    for (int32_t i = g->row[v]; i < g->row[v + 1]; i++) {
        float rest = radius - g->length[i];
        if (rest < 0) continue;
        c->covered[g->to[i]] = 1;
        cover_around(c, g->to[i], rest);
    }
}

/* Greedy disk sampling: each vertex not yet covered, in increasing order, becomes a sample. */
static int sample_vertices(dmk_context *ctx, const dmk_adjacency *g, dmk_cells *cells)
{
    int rc;
    cover c = {.g = g};
    DMK_TRY(DMK_NEW(ctx, c.covered, (size_t)g->n));
    DMK_TRY(DMK_NEW(ctx, c.next, (size_t)g->n));
    DMK_TRY(DMK_NEW(ctx, cells->sample, (size_t)g->n));
    memcpy(c.next, g->row, (size_t)g->n * sizeof *c.next);
    cells->n = 0;
    for (int32_t v = 0; v < g->n; v++) {
        if (c.covered[v]) continue;
        cells->sample[cells->n++] = v;
        cover_sample(&c, v);
    }
done:
    free(c.covered);
    free(c.next);
    return rc;
}

/* Each vertex goes to the sample that is nearest along the edges: shortest paths by label
 * correction with a queue. All paths are a few edges long: each vertex enters only a few times, and is
 * not let in more often. (On a path of many short edges a hub would fall again and again; a cell that is
 * not quite the nearest does no harm.) */
static int grow_cells(dmk_context *ctx, const dmk_adjacency *g, dmk_cells *cells)
{
    int rc;
    int32_t *queue = NULL, head = 0, length = 0;
    uint8_t *queued = NULL, *entries = NULL;
    float *distance = NULL;
    DMK_TRY(DMK_NEW(ctx, queue, (size_t)g->n));
    DMK_TRY(DMK_NEW(ctx, queued, (size_t)g->n));
    DMK_TRY(DMK_NEW(ctx, entries, (size_t)g->n));
    DMK_TRY(DMK_NEW(ctx, distance, (size_t)g->n));
    for (int32_t v = 0; v < g->n; v++) distance[v] = INFINITY;
    for (int32_t a = 0; a < cells->n; a++) {
        int32_t v = cells->sample[a];
        distance[v] = 0;
        cells->owner[v] = a;
        queue[length++] = v;
        queued[v] = 1;
    }
    while (length > 0) {
        int32_t v = queue[head];
        head = head + 1 < g->n ? head + 1 : 0;
        length--;
        queued[v] = 0;
        for (int32_t i = g->row[v]; i < g->row[v + 1]; i++) {
            int32_t w = g->to[i];
            float d = distance[v] + g->length[i];
            if (d >= distance[w]) continue;
            distance[w] = d;
            cells->owner[w] = cells->owner[v];
            if (queued[w] || entries[w] == MOST_ENTRIES) continue;
            entries[w]++;
            int32_t tail = length < g->n - head ? head + length : length - (g->n - head);
            queue[tail] = w;
            queued[w] = 1;
            length++;
        }
    }
done:
    free(queue);
    free(queued);
    free(entries);
    free(distance);
    return rc;
}

static int list_members(dmk_context *ctx, dmk_cells *cells)
{
    int rc;
    int32_t *fill = NULL;
    DMK_TRY(DMK_NEW(ctx, cells->row, (size_t)cells->n + 1));
    DMK_TRY(DMK_NEW(ctx, cells->member, (size_t)cells->n_fine));
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)cells->n));
    for (int32_t v = 0; v < cells->n_fine; v++) cells->row[cells->owner[v] + 1]++;
    for (int32_t a = 0; a < cells->n; a++) {
        fill[a] = cells->row[a];
        cells->row[a + 1] += cells->row[a];
    }
    for (int32_t v = 0; v < cells->n_fine; v++) cells->member[fill[cells->owner[v]]++] = v;
done:
    free(fill);
    return rc;
}

int dmk_cells_create(dmk_context *ctx, dmk_adjacency *fine, dmk_cells *cells)
{
    int rc;
    memset(cells, 0, sizeof *cells);
    cells->n_fine = fine->n;
    DMK_TRY(DMK_NEW(ctx, cells->owner, (size_t)fine->n));
    DMK_TRY(sort_hubs(ctx, fine));
    DMK_TRY(sample_vertices(ctx, fine, cells));
    DMK_TRY(grow_cells(ctx, fine, cells));
    DMK_TRY(list_members(ctx, cells));
done:
    if (rc != DMK_OK) dmk_cells_free(cells);
    return rc;
}

void dmk_cells_free(dmk_cells *cells)
{
    free(cells->owner);
    free(cells->sample);
    free(cells->row);
    free(cells->member);
    memset(cells, 0, sizeof *cells);
}
