/* The cut locus from exact geodesics. Plain host arrays in and out; no device. The polyhedron's own cut locus is a
 * graph that is well defined on every mesh: where two shortest paths of different families meet. The way, each step one
 * file:
 * - cotree.c: how much too long neighbours' families are for each other; a spanning tree of the vertices by least jump;
 *   where the edges that it does not take are crossed.
 * - strength.c: the excess P of each crossing, branches, and which of them are the mesh's own.
 * - joints.c: strong parts joined the shortest way, and peeled again.
 * - cusp.c: where a branch ends on the surface that the mesh stands for.
 * - ends.c: ends moved there; a locus that is one point.
 * - places.c: the points of the lines: forks, and crossings without the zigzag of the mesh.
 * - locus.c: the public object. */
#ifndef DMK_LOCUS_H
#define DMK_LOCUS_H

#include "geodesic/geodesic.h"

/* The rules of this room. h: mean edge of the mesh, also where a finer one stands for it (geodesic/finer.h). Chosen
 * on the meshes of bench/accuracy.py and bench/scan.py; tests/test_locus.c holds the figures they give. */
typedef struct dmk_locus_rules {
    double strength; /* h: default strength */
    double gap;      /* ratio: own branches and the surface's differ by it or more; ends.c, too */
    double noise;    /* median jumps: the mesh's own branches have no more; ends.c, too */
    double angle;    /* radians: where families meet at less a branch loses strength */
    double tie;      /* ratio: share of the families' difference beside an edge in its jump */
    double window;   /* h: radius of the neighbourhood a cusp or a point is fitted to */
    double off;      /* ratio: a joint's length off the tree's lines counts so often */
    double width;    /* h: lines are averaged over so much to both sides */
} dmk_locus_rules;

static const dmk_locus_rules dmk_rules = {
    .strength = 0.2,
    .gap = 5,
    .noise = 45,
    .angle = 0.126,
    .tie = 0.03,
    .window = 4,
    .off = 3,
    .width = 0.5,
};

struct dmk_locus {
    dmk_locus_info info;
    dmk_locus_vertex *vertex; /* info.n_vertices */
    dmk_locus_edge *edge;     /* info.n_edges */
    int32_t *offset;          /* info.n_polylines + 1 */
    int32_t *index;           /* offset[n_polylines]: vertices of the polylines */
};

/* The edges that the lines cross, of the mesh where they are traced: all that a cut takes. free() gives it back. */
typedef struct dmk_seam {
    double asked; /* strength, as in the options */
    bool is_tree; /* of a sphere */
    int32_t n;
    struct dmk_seam_point {
        int32_t half;
        double share; /* where on the half-edge, from its start, over the length */
    } point[];
} dmk_seam;

/* The locus of the geodesics' sources. With borders each border loop counts as one point of the graph: lines may
 * end on a border, and the locus with every border loop contracted to a point is connected with first
 * Betti number 2g. Several sources count as one point.
 * *seam (NULL: not wanted): where its lines cross edges. */
int dmk_locus_trace(dmk_context *ctx, const dmk_geodesics *geodesics, const dmk_locus_options *opt,
                    dmk_locus **locus, dmk_seam **seam);

/* The numbers of the triangles at the vertices, from those of the geodesics' mesh to triangle_old of them, and the
 * density there, mu, if there is one. */
void dmk_locus_renumber(dmk_locus *locus, const int32_t *triangle_old, const double *density);

#endif
