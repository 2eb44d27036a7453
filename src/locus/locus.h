/* From distance to the cut locus as one graph. Plain host arrays in and out; no device.
 *
 * The way, each step one file:
 *   chart.c   the directions at the source p: which edge a ray leaves the source's triangles
 * through ray.c     one straight ray from p, unfolded triangle by triangle fan.c     the fan of
 * rays; a vertex between two neighbouring rays gets the direction, the length and the spread of the
 * geodesic that hits it. A ray ends where the given distance says that it is no longer minimal (and
 * a bit later, so that both families of rays are known on both sides of the locus) sheets.c  the
 * geodesics that reach each vertex, shortest first graph.c   strength of the mesh edges, spanning
 * tree of the vertices, dual graph, pruning place.c   where on an edge two families, in a triangle
 * three, are equally long tip.c     ends: the square of the angle between the two geodesics is
 * linear in the arc length point.c   a locus that is one point locus.c   the public object */
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
