/* From distance to the cut locus as one graph. Plain host arrays in and out; no device.
 *
 * The way, each step one file:
 * - smooth.c: a mesh with vertex noise without it, for the rays to run over.
 * - chart.c: the directions at the source; through which edge a ray leaves its triangles.
 * - ray.c: one straight ray from the source, unfolded triangle by triangle.
 * - conjugate.c: where neighbouring rays first meet, by the curvature on their way; the cusps of
 * that.
 * - fan.c: the fan of rays. A vertex between two neighbouring rays gets direction, length and
 * spread of the geodesic that hits it. A ray ends where the given distance says that it is no
 * longer minimal, and some edges later, so that both families are known on both sides of the locus.
 * - sheets.c: the geodesics that reach each vertex, the shortest first.
 * - repair.c, complete.c: vertices the fan missed; families known at one end of an edge only.
 * - graph.c: strength of the mesh edges, spanning tree of the vertices, dual graph, pruning.
 * - place.c: where on an edge two families, in a triangle three, are equally long.
 * - net.c: the graph under construction: links, weak ends, twigs, merged branch points.
 * - cusp.c, tip.c: a cusp fitted to the rays around it, the place of an end; branches led there.
 * - point.c: a locus that is one point.
 * - locus.c: the public object.
 * - cut.c: the surface cut open.
 *
 * The given distance only tells where rays may end, with a slack of 3 edges and 2 %; the places
 * come from the rays. So it need not be accurate: the tests use one that is some 10 % too long. */
#ifndef DMK_LOCUS_H
#define DMK_LOCUS_H

#include "mesh/mesh.h"

typedef struct dmk_locus_input {
    const dmk_mesh *mesh; /* compact, connected, in locality (Morton) order */
    dmk_point source;
    const double *distance;     /* n_vertices: u(p) - u */
    const double *distance_mid; /* n_edges: the same at edge midpoints; may be NULL */
    const double *mu; /* n_triangles, only carried through to the vertices' mu; may be NULL */
} dmk_locus_input;

/* The cut locus on in->mesh. With borders, rays end at the border and each border loop counts as
 * one point of the graph: arcs may end on a border, and the locus with every border loop contracted
 * to a point is connected with first Betti number 2g. DMK_E_MESH if the checks of the topology
 * fail. */
int dmk_locus_trace(dmk_context *ctx, const dmk_locus_input *in, const dmk_locus_options *opt,
                    dmk_locus **locus);

/* The strength option as a width of beams, in mesh edges. */
double dmk_locus_threshold(const dmk_locus_options *opt);

#endif
