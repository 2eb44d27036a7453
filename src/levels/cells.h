/* A level's vertices partitioned into cells, the vertices of the next one. For src/levels and src/ranks only. */
#ifndef DMK_LEVELS_CELLS_H
#define DMK_LEVELS_CELLS_H

#include "base/sort.h"

/* What has more neighbours than this is a hub. A mesh may have one with all its vertices around it, and
 * no step may take the square of their number. */
enum { DMK_HUB = DMK_SHORT_LIST };

/* Who neighbours whom, as compressed rows. Below the mesh this is the adjacency of cells, with some
 * six neighbours a vertex, and not the Galerkin edges, which are two to three times as many. */
typedef struct dmk_adjacency {
    int32_t n;
    int32_t *row; /* n + 1 */
    /* row[n]: neighbours, in increasing order below the mesh until there are cells; then those of hubs are in the
     * order of their distance */
    int32_t *to;
    float *length; /* row[n]: distance of the two positions in space, or resistance */
    bool resists;  /* the latter */
} dmk_adjacency;

/* A partition of the vertices of one level into cells, one for each coarse vertex. */
typedef struct dmk_cells {
    int32_t n_fine, n;
    int32_t *owner;  /* n_fine: cell of each fine vertex */
    int32_t *sample; /* n: a fine vertex of the cell, increasing */
    int32_t *row;    /* n + 1: where each cell's fine vertices begin in member */
    int32_t *member; /* n_fine: the fine vertices, increasing in each cell */
} dmk_cells;

void dmk_adjacency_free(dmk_adjacency *graph);
/* Samples thinned out by a factor of about 6, and their graph Voronoi cells. */
int dmk_cells_create(dmk_context *context, dmk_adjacency *fine, dmk_cells *cells);
/* Row and member from the owners. */
int dmk_cells_list_members(dmk_context *context, dmk_cells *cells);
void dmk_cells_free(dmk_cells *cells);

/* The steps of it, of which a rank that has some of the vertices and their surroundings does its part. First hubs'
 * edges are put in the order of their lengths. Then each vertex of first .. end - 1 that no sample covers becomes
 * one, in increasing order, and covers others. */
int dmk_cells_sort_hubs(dmk_context *context, dmk_adjacency *graph);
int dmk_cells_sample(dmk_context *context, const dmk_adjacency *graph, int32_t first, int32_t end,
                     uint8_t *covered, int32_t *sample, int32_t *n);

/* Then cells grow along the edges by rounds. What changed in one round tells its neighbours in the next, so that no
 * order matters, of vertices as little as of ranks. */
typedef struct dmk_label {
    float distance;
    int32_t
        steps; /* edges on the way: a sample keeps its cell, even if all are too short for floats */
    int64_t cell;
} dmk_label;

/* The nearer one; of two as near that over fewer edges, and then the first. */
static inline bool dmk_label_before(dmk_label a, dmk_label b)
{
    if (a.distance != b.distance) return a.distance < b.distance;
    return a.steps != b.steps ? a.steps < b.steps : a.cell < b.cell;
}

typedef struct dmk_growth {
    const dmk_adjacency *g;
    dmk_label *label;      /* n */
    dmk_label *frozen;     /* those of the front as the round begins */
    int32_t *front, *next; /* vertices that changed in the last round, and in this one */
    uint8_t *entered;      /* n: 1 + the last round in which it did */
    int32_t n_next, round;
} dmk_growth;

int dmk_growth_begin(dmk_context *context, const dmk_adjacency *graph, dmk_growth *growth);
/* A label from outside, of a sample or another rank's vertex; nothing if it is not nearer. */
void dmk_growth_set(dmk_growth *growth, int32_t vertex, dmk_label label);
/* Whether the last round was the last, as far as is seen here. */
bool dmk_growth_ends(const dmk_growth *growth);
/* Labels change at vertices first .. end - 1 alone. */
void dmk_growth_round(dmk_growth *growth, int32_t first, int32_t end);
void dmk_growth_end(dmk_growth *growth);

#endif
