/* Samples of a graph's vertices and the cells around them; see cells.h. */
#include "levels/cells.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

void dmk_adjacency_free(dmk_adjacency *g)
{
    free(g->row);
    free(g->to);
    free(g->length);
    memset(g, 0, sizeof *g);
}

/* A sample covers what lies within this many times the mean length of its own edges. The radius is
 * local, so that graded meshes are thinned out evenly. Against 1.3 (which thins out by 3.5 instead
 * of 6), 2 halves the Galerkin tables and saves a tenth of a V-cycle and a third of the levels; to
 * a residual of 1e-4 CG takes the same number of iterations or one more, to 1e-8 up to two more. */
#define RADIUS 2.0f

/* All paths are a few edges long: so many rounds are enough. (On a path of many short edges a hub would fall again and
 * again; a cell that is not quite the nearest does no harm.) */
enum { MOST_ROUNDS = 32 };

/* Of resistances their harmonic mean, to which strong edges alone count. */
static float mean_length(const dmk_adjacency *g, int32_t v)
{
    float sum = 0;
    const float n = (float)(g->row[v + 1] - g->row[v]);
    for (int32_t i = g->row[v]; i < g->row[v + 1]; i++)
        sum += g->resists ? 1 / g->length[i] : g->length[i];
    return n == 0 ? 0 : g->resists ? n / sum : sum / n;
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
int dmk_cells_sort_hubs(dmk_context *ctx, dmk_adjacency *g)
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
int dmk_cells_sample(dmk_context *ctx, const dmk_adjacency *g, int32_t first, int32_t end,
                     uint8_t *covered, int32_t *sample, int32_t *n)
{
    int rc;
    cover c = {.g = g, .covered = covered};
    DMK_TRY(DMK_NEW_UNSET(ctx, c.next, (size_t)g->n));
    if (g->n > 0) memcpy(c.next, g->row, (size_t)g->n * sizeof *c.next);
    *n = 0;
    for (int32_t v = first; v < end; v++) {
        if (c.covered[v]) continue;
        sample[(*n)++] = v;
        cover_sample(&c, v);
    }
done:
    free(c.next);
    return rc;
}

static int sample_vertices(dmk_context *ctx, const dmk_adjacency *g, dmk_cells *cells)
{
    int rc;
    uint8_t *covered = NULL;
    DMK_TRY(DMK_NEW(ctx, covered, (size_t)g->n));
    DMK_TRY(DMK_NEW_UNSET(ctx, cells->sample, (size_t)g->n));
    rc = dmk_cells_sample(ctx, g, 0, g->n, covered, cells->sample, &cells->n);
done:
    free(covered);
    return rc;
}

int dmk_growth_begin(dmk_context *ctx, const dmk_adjacency *g, dmk_growth *w)
{
    int rc;
    const size_t n = (size_t)g->n;
    w->g = g;
    DMK_TRY(DMK_NEW_UNSET(ctx, w->label, n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, w->frozen, n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, w->front, n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, w->next, n + 1));
    DMK_TRY(DMK_NEW(ctx, w->entered, n));
    for (size_t v = 0; v < n; v++) w->label[v] = (dmk_label){.distance = INFINITY};
done:
    return rc;
}

void dmk_growth_set(dmk_growth *w, int32_t v, dmk_label label)
{
    if (!dmk_label_before(label, w->label[v])) return;
    w->label[v] = label;
    if (w->entered[v] == w->round + 1) return;
    w->entered[v] = (uint8_t)(w->round + 1);
    w->next[w->n_next++] = v;
}

bool dmk_growth_ends(const dmk_growth *w)
{
    return w->round == MOST_ROUNDS || w->n_next == 0;
}

void dmk_growth_round(dmk_growth *w, int32_t first, int32_t end)
{
    int32_t *const front = w->next;
    const int32_t n = w->n_next;
    w->next = w->front;
    w->front = front;
    w->n_next = 0;
    w->round++;
    for (int32_t i = 0; i < n; i++) w->frozen[i] = w->label[front[i]];
    for (int32_t i = 0; i < n; i++) {
        for (int32_t k = w->g->row[front[i]]; k < w->g->row[front[i] + 1]; k++) {
            if (w->g->to[k] < first || w->g->to[k] >= end) continue;
            dmk_label here = w->frozen[i];
            here.distance += w->g->length[k];
            here.steps++;
            dmk_growth_set(w, w->g->to[k], here);
        }
    }
}

void dmk_growth_end(dmk_growth *w)
{
    free(w->label);
    free(w->frozen);
    free(w->front);
    free(w->next);
    free(w->entered);
    memset(w, 0, sizeof *w);
}

/* Each vertex goes to the sample that is nearest along the edges. */
static int grow_cells(dmk_context *ctx, const dmk_adjacency *g, dmk_cells *cells)
{
    int rc;
    dmk_growth w = {.round = 0};
    DMK_TRY(dmk_growth_begin(ctx, g, &w));
    for (int32_t a = 0; a < cells->n; a++)
        dmk_growth_set(&w, cells->sample[a], (dmk_label){.cell = a});
    while (!dmk_growth_ends(&w)) dmk_growth_round(&w, 0, g->n);
    for (int32_t v = 0; v < g->n; v++) cells->owner[v] = (int32_t)w.label[v].cell;
done:
    dmk_growth_end(&w);
    return rc;
}

int dmk_cells_list_members(dmk_context *ctx, dmk_cells *cells)
{
    int rc;
    int32_t *fill = NULL;
    DMK_TRY(DMK_NEW(ctx, cells->row, (size_t)cells->n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, cells->member, (size_t)cells->n_fine));
    DMK_TRY(DMK_NEW_UNSET(ctx, fill, (size_t)cells->n));
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
    DMK_TRY(DMK_NEW_UNSET(ctx, cells->owner, (size_t)fine->n));
    DMK_TRY(dmk_cells_sort_hubs(ctx, fine));
    DMK_TRY(sample_vertices(ctx, fine, cells));
    DMK_TRY(grow_cells(ctx, fine, cells));
    DMK_TRY(dmk_cells_list_members(ctx, cells));
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
