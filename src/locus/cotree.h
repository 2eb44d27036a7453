/* The cut locus of the polyhedron as a tree-cotree decomposition. Internal to src/locus and src/cut. Every vertex v is
 * reached by one shortest path; its last pseudo-source (or the source), unfolded into the plane around v, is the image
 * of v's family. The jump of a mesh edge vw is how much the family of one end is too long at the other. A spanning tree
 * of the vertices by least jump keeps families together; the mesh edges that it does not take, dual, are what families
 * meet across: a graph of the triangles that is connected and has first Betti number 2g, each border loop being one
 * node (tree-cotree decomposition: Eppstein 2003; as a cut graph: Erickson and Whittlesey 2005). */
#ifndef DMK_COTREE_H
#define DMK_COTREE_H

#include "base/sort.h"
#include "geodesic/image.h"
#include "locus/locus.h"

/* Where the locus crosses a mesh edge: the point at which the families of its ends are equally long. */
typedef struct dmk_crossing {
    int32_t half;    /* half-edge crossed, of the triangle node[0] */
    int32_t node[2]; /* the triangles it joins; n_triangles + i: border loop i */
    int32_t onward;  /* crossing to which its excess is handed on; -1: none */
    int8_t outer;    /* node[outer] was peeled: the branch's end lies behind it; -1: on a loop */
    bool heir;       /* `onward` is of the same branch */
    bool kept;       /* has the default strength in any case: see joints.c */
    double xyz[3];
    double share;    /* where on the half-edge, from its start, over the length */
    double distance; /* from the source */
    double alpha;    /* angle at which the two families meet, radians in [0, pi] */
    double excess;   /* P: by how much a path must grow to be moved from one family to the other */
    double worth;    /* P as far as it counts: see strength.c */
    double fall;     /* what both gain by falls of d as soon as these count */
} dmk_crossing;

/* Where a branch ends inside a triangle. */
typedef struct dmk_end_point {
    int32_t triangle, crossing; /* reached through this crossing */
    double weight[3];
} dmk_end_point;

typedef struct dmk_cotree {
    const dmk_geodesics *geodesics;
    double mean_edge;       /* h, of the mesh that was given */
    double noise;           /* median of the edges' jumps */
    double strength;        /* default: branches of less are the mesh's own */
    dmk_keyed *order;       /* edges by jump */
    int32_t n, n_loops;     /* crossings; border loops */
    int32_t *loop;          /* n_vertices: border loop, -1: none */
    dmk_crossing *crossing; /* n */
    double *strength_of;    /* n: that by which it is pruned; apart, as loops read no more */
    int32_t *on;            /* 3*n_triangles: crossing on each half-edge, -1: none */
    int32_t last; /* crossing peeled last, the middle of a locus without loops; -1: none */
    int32_t n_ends;
    size_t end_room;
    dmk_end_point *end; /* n_ends */
    bool is_point;      /* no line of default strength: the whole locus is end point 0 */
} dmk_cotree;

/* Jumps, spanning tree and crossings; mean_edge: the h of the rules. Freed also after a failure. */
int dmk_cotree_create(dmk_context *ctx, const dmk_geodesics *geodesics, double mean_edge,
                      dmk_cotree *cotree);
void dmk_cotree_free(dmk_cotree *cotree);
/* The spanning tree from the jumps again, but the edges to be kept out of it come last; crossings are to be peeled
 * anew. kept: n_edges. */
int dmk_cotree_keep(dmk_context *ctx, dmk_cotree *cotree, const bool *kept);
/* The cells of two sources meet across edge e. */
bool dmk_parts_cells(const dmk_geodesics *geodesics, int32_t e);

/* The jump of the k-th edge by jump, a length. */
double dmk_jump_of(const dmk_cotree *cotree, int32_t k);

/* strength.c: excess of every crossing, strength of every branch, the default strength. */
int dmk_cotree_peel(dmk_context *ctx, dmk_cotree *cotree);
/* Excess of the weakest way into a triangle where three meet, that of a branch which ends there; else 0. */
double dmk_branch_at(const dmk_cotree *cotree, int32_t triangle);

/* What less excess has is the mesh's own. */
static inline double dmk_least_excess(const dmk_cotree *t)
{
    return dmk_rules.strength / dmk_rules.gap * t->mean_edge;
}

/* joints.c: the strong parts joined by the shortest ways, and peeled again. */
int dmk_cotree_join(dmk_context *ctx, dmk_cotree *cotree);
/* ends.c: all of it, and the end points of all branches of default strength. */
int dmk_cotree_complete(dmk_context *ctx, const dmk_geodesics *geodesics, double mean_edge,
                        dmk_cotree *cotree);
static inline double dmk_strength_asked(const dmk_cotree *t, const dmk_locus_options *options)
{
    return options && options->strength > 0 ? options->strength : t->strength;
}

static inline bool dmk_is_drawn(const dmk_cotree *t, int32_t i, double strength)
{
    return t->strength_of[i] >= strength && !(t->is_point && strength >= t->strength);
}

static inline int32_t dmk_other_node(const dmk_crossing *c, int32_t node)
{
    return c->node[0] == node ? c->node[1] : c->node[0];
}

/* cusp.c. Where a branch ends, fitted to the geodesics around the point `xyz` on half-edge h, at `distance` in the
 * direction `angle` from the source of its start. False if they show no cusp, or not near. A patch is freed also after
 * a failure. */
typedef struct dmk_cusp {
    double xyz[3], angle, distance;
} dmk_cusp;
typedef struct dmk_patch dmk_patch;
int dmk_patch_create(dmk_context *ctx, const dmk_cotree *cotree, dmk_patch **patch);
void dmk_patch_free(dmk_patch **patch);
bool dmk_cusp_fit(dmk_patch *patch, int32_t h, dmk_cusp *cusp);
/* The middle of a short locus around `xyz` on half-edge `on`, and from there to one of its ends; what the fit leaves of
 * the distances, root mean square. */
bool dmk_focus_fit(dmk_patch *patch, int32_t on, double xyz[3], double half[3], double *left);

/* ---- places.c: crossings, forks and end points as vertices of the locus ------------------------------- */
/* All but kind, degree and mu; angles as in the source's chart. None depends on the strength asked for. */

/* On its edge, nearest to the mean of the line over a stretch to both sides. */
void dmk_place_crossing(const dmk_cotree *cotree, int32_t i, dmk_locus_vertex *vertex);
/* In a triangle with three crossings: where the families of its corners are equally long if three
 * branches of default strength meet, else on the straight line between the two strongest. */
void dmk_place_fork(const dmk_cotree *cotree, int32_t triangle, dmk_locus_vertex *vertex);
void dmk_place_end(const dmk_cotree *cotree, const dmk_end_point *end, dmk_locus_vertex *vertex);
/* Where the lines of the strength asked for cross edges. */
int dmk_seam_create(dmk_context *ctx, const dmk_cotree *cotree, const dmk_locus_options *options,
                    dmk_seam **seam);

/* Whether three branches of default strength meet in the triangle. */
bool dmk_is_fork(const dmk_cotree *cotree, int32_t triangle);
/* The end point in a triangle, or NULL: the end points are in the order of this comparison. */
int dmk_end_by_triangle(const void *a, const void *b);
const dmk_end_point *dmk_end_in(const dmk_cotree *cotree, int32_t triangle);

#endif
