/* Relaxation of a closed triangulation on a surface: moves and flips, the count stays. */
#ifndef DMK_RELAX_H
#define DMK_RELAX_H

#include "surfaces/halfedge.h"
#include "surfaces/surface.h"

typedef struct dmk_relaxer {
    dmk_context *context;
    dmk_body body;
    dmk_halfedge *mesh; /* its vertices lie on the body */
    int32_t fixed;      /* vertex that keeps its position, or -1 */
    double rest;        /* length of the springs; dmk_relax sets it */
    double began;       /* dmk_seconds, for progress reports */
} dmk_relaxer;

/* `sweeps` rounds of moving each vertex and flipping edges: the first half for vertex degrees near
 * 6, the second half for a Delaunay triangulation. */
int dmk_relax(dmk_relaxer *relaxer, int sweeps);

/* Cosine between the normals of the triangle abc and of the surface near it. */
double dmk_relax_facing(const dmk_body *body, const double a[3], const double b[3],
                        const double c[3]);
/* 4 sqrt(3) area / (sum of squared sides): 1 if equilateral, 0 if flat. */
double dmk_relax_quality(const double a[3], const double b[3], const double c[3]);

#endif
