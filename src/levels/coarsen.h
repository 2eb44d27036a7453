/* The hierarchy of coarse graphs below a mesh, and the tables that carry vectors and operators down
 * and up. Everything here depends on the mesh alone, never on the density.
 *
 * An operator is a list of weighted edges: y_i = sum_j w_ij (x_i - x_j). Its Galerkin coarsening
 * P'AP is again one, and linear in the weights, so a new density needs only gathers:
 *     w_coarse[k] = sum_{galerkin_row[k] <= i < galerkin_row[k+1]} coef[i] * w_fine[edge[i]]. */
#ifndef DMK_COARSEN_H
#define DMK_COARSEN_H

#include "base/sort.h"
#include "mesh/mesh.h"

/* What has more neighbours than this is a hub. A mesh may have one with all its vertices around it, and
 * no step may take the square of their number. */
enum { DMK_HUB = DMK_SHORT_LIST };

/* Vertices of one level and the edges between them. */
typedef struct dmk_graph {
    int32_t n, n_edges;
    int32_t *edge; /* 2*n_edges: end vertices, the smaller first; sorted lexicographically */
    double *xyz;   /* 3*n: the mean position of the fine vertices in each cell */
} dmk_graph;

/* From one level, the fine one, to the next coarser. */
typedef struct dmk_coarsening {
    dmk_graph coarse;       /* vertices in the order of the fine ones they come from */
    int32_t *prolong_index; /* 3*n_fine: coarse vertices, increasing; unused slots repeat slot 0 */
    float *prolong_weight;  /* 3*n_fine: >= 0, 0 in unused slots only; each row sums to 1 */
    int32_t *restrict_row;  /* coarse.n + 1: the transposed prolongation, by coarse vertex */
    int32_t *restrict_fine; /* restrict_row[coarse.n]: fine vertices, increasing in each row */
    float *restrict_weight; /* restrict_row[coarse.n] */
    int32_t *galerkin_row;  /* coarse.n_edges + 1 */
    int32_t *galerkin_edge; /* galerkin_row[coarse.n_edges]: fine edges, increasing in each row */
    float *galerkin_coef;   /* galerkin_row[coarse.n_edges]: never 0 */
    int32_t edge_first;     /* of a level that is dealt out, the tables are of the own edges alone,
                               from this one on; else 0 */
} dmk_coarsening;

#define DMK_MAX_LEVELS 32

typedef struct dmk_hierarchy {
    int32_t n;                            /* number of coarsenings; 0 for a small mesh */
    dmk_coarsening level[DMK_MAX_LEVELS]; /* the fine side of level[0] is the mesh's vertices and
                                             edges, of level[l] the coarse side of level[l-1] */
} dmk_hierarchy;

/* For a mesh that several processes coarsen together: each makes the Galerkin tables, by far the largest,
 * of its own part alone, and all have the same hierarchy. Both calls see the coarsening that is being made, with
 * its prolongation, transposed too. */
typedef struct dmk_dealing {
    void *user;
    /* The coarse vertices *first .. *end - 1 whose edges, by their smaller end, are wanted here. */
    int (*own)(dmk_context *context, void *user, const dmk_coarsening *c, int32_t *first,
               int32_t *end);
    /* coarse.edge, n_edges and edge_first of the whole level in place of those edges'. */
    int (*join)(dmk_context *context, void *user, dmk_coarsening *c);
} dmk_dealing;

/* Coarsen until at most `coarsest` vertices (0: 128) are left, or until a step would not bring the
 * number of vertices down to two thirds. The mesh should be in the order of dmk_order_create; a
 * connected mesh gives connected levels. On failure *h is empty. */
int dmk_hierarchy_create(dmk_context *context, const dmk_mesh *mesh, int32_t coarsest,
                         dmk_hierarchy *h);
/* With a dealing, or NULL. */
int dmk_hierarchy_deal(dmk_context *context, const dmk_mesh *mesh, int32_t coarsest,
                       const dmk_dealing *dealing, dmk_hierarchy *h);
void dmk_hierarchy_free(dmk_hierarchy *h);
void dmk_coarsening_free(dmk_coarsening *c);

/* ---- the steps of one coarsening, for coarsen.c only --------------------------------------- */

/* Who neighbours whom, as compressed rows. Below the mesh this is the adjacency of cells, with some
 * six neighbours a vertex, and not the Galerkin edges, which are two to three times as many. */
typedef struct dmk_adjacency {
    int32_t n;
    int32_t *row; /* n + 1 */
    int32_t
        *to; /* row[n]: neighbours, in increasing order below the mesh until there are cells; then
                      those of hubs are in the order of their distance */
    float *length; /* row[n]: distance of the two positions in space */
} dmk_adjacency;

/* A partition of the vertices of one level into cells, one for each coarse vertex. */
typedef struct dmk_cells {
    int32_t n_fine, n;
    int32_t *owner;  /* n_fine: cell of each fine vertex */
    int32_t *sample; /* n: a fine vertex of the cell, increasing */
    int32_t *row;    /* n + 1: the fine vertices of each cell, ... */
    int32_t *member; /* n_fine: ... increasing */
} dmk_cells;

/* cells.c: samples thinned out by a factor of about 6, and their graph Voronoi cells. */
int dmk_cells_create(dmk_context *context, dmk_adjacency *fine, dmk_cells *cells);
void dmk_cells_free(dmk_cells *cells);

/* prolong.c: the weights of the fine vertices at `fine_xyz` on the corners of the nearest triangle
 * of adjacent cells. Sets c->prolong_index and prolong_weight, from c->coarse.xyz. */
int dmk_prolong_create(dmk_context *context, const dmk_cells *cells, const dmk_adjacency *coarse,
                       const double *fine_xyz, dmk_coarsening *c);

/* galerkin.c: given the prolongation of c (rows of `n_fine` vertices) and the fine edges, fill its
 * coarse edges (coarse.edge), the transposed prolongation and the Galerkin tables. */
int dmk_galerkin_create(dmk_context *context, int32_t n_fine, int32_t n_fine_edges,
                        const int32_t *fine_edge, const dmk_dealing *dealing, dmk_coarsening *c);

#endif
