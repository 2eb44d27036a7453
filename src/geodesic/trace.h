/* Paths back to the sources, and distances anywhere. */
#ifndef DMK_GEODESIC_TRACE_H
#define DMK_GEODESIC_TRACE_H

#include "geodesic/geodesic.h"

typedef struct dmk_tracer dmk_tracer;

int dmk_tracer_create(dmk_context *context, const dmk_geodesics *geodesics, dmk_tracer **tracer);
void dmk_tracer_destroy(dmk_tracer **tracer);
/* The path from the nearest source to a point; DMK_E_ARG if there is none. The caller frees it. */
int dmk_tracer_path(dmk_context *context, dmk_tracer *tracer, const dmk_point *to, dmk_path *path);
/* One to each of n points; of a failure none is left. */
int dmk_tracer_paths(dmk_context *context, const dmk_geodesics *geodesics, size_t n,
                     const dmk_point *to, dmk_path *paths);

/* The distance of a point, no vertex, that a source reaches. */
int dmk_tracer_distance(dmk_context *context, dmk_tracer *tracer, const dmk_point *at,
                        double *distance);

/* mend.c: distances of merged windows whose estimated error exceeds twice the tolerance, anew, the nearest first: none
 * does then, but where there is no room for all ways that may be the shortest. Not *few, and nothing is done: there are
 * too many. */
int dmk_tracer_repair(dmk_context *context, dmk_geodesics *geodesics, bool *few);

#endif
