/* Geodesics on the same surface with finer triangles. What is found edge by edge, as the cut locus is, knows little of
 * edges that much of it crosses: on machine parts they are up to 100 mean edges long. */
#ifndef DMK_FINER_H
#define DMK_FINER_H

#include "geodesic/geodesic.h"

/* Its mesh begins with the vertices of the coarse one, and its triangles are in the order of theirs. Where that itself
 * will do there is none, and the geodesics are those given. */
typedef struct dmk_finer {
    double mean_edge;               /* of the coarse mesh */
    const dmk_geodesics *geodesics; /* from the same sources: `own` or those given */
    dmk_geodesics *own;
    dmk_mesh *mesh;
    int32_t *first;  /* n_triangles + 1 of the coarse mesh: the first of each triangle's parts */
    int32_t *parent; /* mesh->n_triangles: triangle of the coarse mesh */
    double *
        turn; /* n_sources: the direction at each source that is 0 in the geodesics of the coarse mesh */
} dmk_finer;

/* The longest edge is bisected until none has more than two mean edges of the geodesics' mesh, or of one of 5,000
 * triangles if it has fewer (M. C. Rivara, "Algorithms for refining triangular grids", 1984), or there are 300,000
 * triangles. The sources are points. Freed also after a failure. */
int dmk_finer_create(dmk_context *context, const dmk_geodesics *geodesics, dmk_finer *finer);
void dmk_finer_free(dmk_finer *finer);

#endif
