/* The hierarchy of coarse graphs below a mesh, and the tables that carry vectors and operators down
 * and up. Everything here depends on the mesh alone, never on the density.
 *
 * An operator is a list of weighted edges: y_i = sum_j w_ij (x_i - x_j). Its Galerkin coarsening
 * P'AP is again one, and linear in the weights, so a new density needs only gathers:
 *     w_coarse[k] = sum_{galerkin_row[k] <= i < galerkin_row[k+1]} coef[i] * w_fine[edge[i]]. */
#ifndef DMK_COARSEN_H
#define DMK_COARSEN_H

#include "levels/cells.h"
#include "mesh/mesh.h"

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
    float *galerkin_coef;   /* galerkin_row[coarse.n_edges]: see DMK_WEIGHT_PARTS; never 0 */
} dmk_coarsening;

/* Weights of the prolongation are whole numbers of 1 / this, and coefficients of the Galerkin table, products of two
 * differences of weights, of 1 / its square: the largest power of two with a square of 16 bits, in which the device has
 * them. So what cancels among the edges of strongly coupled rows cancels to the last bit: see
 * bench/results/needles.md. */
enum { DMK_WEIGHT_PARTS = 128 };

#define DMK_MAX_LEVELS 32

typedef struct dmk_hierarchy {
    int32_t n;                            /* number of coarsenings; 0 for a small mesh */
    dmk_coarsening level[DMK_MAX_LEVELS]; /* the fine side of level[0] is the mesh's vertices and
                                             edges, of level[l] the coarse side of level[l-1] */
} dmk_hierarchy;

/* Vertices of the solver's coarsest level, which is solved by its inverse. */
enum { DMK_COARSEST = 96 };

/* Coarsen until at most `coarsest` vertices are left, or until a step would not bring the
 * number of vertices down to two thirds. The mesh should be in the order of dmk_order_create; a
 * connected mesh gives connected levels. On failure *h is empty. */
int dmk_hierarchy_create(dmk_context *context, const dmk_mesh *mesh, int32_t coarsest,
                         dmk_hierarchy *h);
/* The same, and each level is handed over as soon as it is there, while the next ones are made of its graph: all
 * else in it is the taker's to free. The last call has NULL, by which the taker is to have ended what it began; after
 * a failure, too, upon which *h is emptied. */
typedef struct dmk_level_taker {
    int (*take)(dmk_context *context, void *user, dmk_coarsening *level);
    void *user;
} dmk_level_taker;
int dmk_hierarchy_hand_over(dmk_context *context, const dmk_mesh *mesh, int32_t coarsest,
                            const dmk_level_taker *taker, dmk_hierarchy *h);
/* The same of a connected graph whose edges have conductances, of either sign, those of 0 joining nothing: an edge is
 * as long as it resists, here and on all coarser levels, so that cells are long where the operator couples strongly one
 * way, as across needles. *conductance is used up. *h is empty where it does not come down to `coarsest`. */
int dmk_hierarchy_of_conductances(dmk_context *context, const dmk_graph *graph,
                                  double **conductance, int32_t coarsest, dmk_hierarchy *h);
void dmk_hierarchy_free(dmk_hierarchy *h);
void dmk_coarsening_free(dmk_coarsening *c);

/* ---- the steps of one coarsening, for coarsen.c and ranks/ only ----------------------------- */

/* An edge's length; sums of it are finite along any path, and of meshes as large as that only the steps count. */
float dmk_narrow_length(double length);
/* That of a link of cells that lie at p and q. */
float dmk_link_length(const double p[3], const double q[3]);
/* From the level h->n on, whose adjacency is `fine`, which is used up, and whose graph is that of the mesh or of
 * level[h->n - 1]; taker: or NULL; on failure *h is empty. */
int dmk_hierarchy_go_on(dmk_context *context, const dmk_graph *mesh, int32_t coarsest,
                        const dmk_level_taker *taker, dmk_adjacency *fine, dmk_hierarchy *h);
/* Whether so many coarse vertices are too many to be worth a level. */
static inline bool dmk_gains_nothing(int64_t n_coarse, int64_t n_fine)
{
    return n_coarse > n_fine / 3 * 2;
}

/* prolong.c: the weights of the fine vertices at `fine_xyz` on the corners of the nearest triangle
 * of adjacent cells. Sets c->prolong_index and prolong_weight, from c->coarse.xyz. */
int dmk_prolong_create(dmk_context *context, const dmk_cells *cells, const dmk_adjacency *coarse,
                       const double *fine_xyz, dmk_coarsening *c);
/* The same where some coarse vertices may be left without weights, which would make the operator singular. */
int dmk_prolong_weights(dmk_context *context, const dmk_cells *cells, const dmk_adjacency *coarse,
                        const double *fine_xyz, dmk_coarsening *c);
/* All weight on coarse vertex c. Each one that is left without is given to its sample alone by this; that may empty
 * others, so repeat, and each sample changes once at most. */
void dmk_prolong_point(int32_t c, int32_t *index, float *weight);

/* galerkin.c: given the prolongation of c (rows of `n_fine` vertices) and the fine edges, fill in the transposed
 * prolongation, and of the coarse vertices first .. end - 1 the coarse edges, by their smaller ends, (coarse.edge) with
 * the Galerkin tables. */
int dmk_galerkin_create(dmk_context *context, int32_t n_fine, int32_t n_fine_edges,
                        const int32_t *fine_edge, int32_t first, int32_t end, dmk_coarsening *c);

#endif
