/* Minimal geodesics from the source to any points, traced exactly over the triangles. */
#ifndef DMK_LOCUS_PATH_H
#define DMK_LOCUS_PATH_H

#include "locus/locus.h"

/* The paths to n_points points `to` on in->mesh; paths[i] is freed by dmk_path_free. DMK_E_MESH if
 * no straight path reaches a point (it lies in the shadow of a border or of a sharp saddle). */
int dmk_path_trace(dmk_context *ctx, const dmk_locus_input *in, size_t n_points,
                   const dmk_point *to, dmk_path *paths);

#endif
