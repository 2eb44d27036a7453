/* Minimal geodesics from the source to any points, traced exactly over the triangles. */
#ifndef DMK_LOCUS_PATH_H
#define DMK_LOCUS_PATH_H

#include "locus/locus.h"

typedef struct dmk_path {
    size_t n;
    dmk_point *point; /* n: the source, a point on each edge crossed, the end */
    double length;
    double angle; /* direction at the source, radians, a full turn being 2 pi */
} dmk_path;

/* The paths to n_points points `to` on in->mesh; paths[i] is freed by dmk_path_free. DMK_E_MESH if
 * no straight path reaches a point (it lies in the shadow of a border or of a sharp saddle). */
int dmk_path_trace(dmk_context *ctx, const dmk_locus_input *in, size_t n_points,
                   const dmk_point *to, dmk_path *paths);
void dmk_path_free(dmk_path *path);

#endif
