/* Minimal geodesics from the source to any points: exact shortest paths of the polyhedron. */
#ifndef DMK_LOCUS_PATH_H
#define DMK_LOCUS_PATH_H

#include "locus/locus.h"

/* The paths to n_points points `to` on in->mesh; paths[i] is freed by dmk_path_free. in->distance
 * tells where to look; as long as it is right to 2 % and 3 edges, no shorter path is overlooked. */
int dmk_path_trace(dmk_context *ctx, const dmk_locus_input *in, size_t n_points,
                   const dmk_point *to, dmk_path *paths);

#endif
