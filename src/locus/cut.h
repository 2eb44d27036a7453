/* The surface cut open along its cut locus. */
#ifndef DMK_LOCUS_CUT_H
#define DMK_LOCUS_CUT_H

#include "locus/locus.h"

/* A disk: one border loop, Euler characteristic 1. The triangles that the locus crosses are split
 * so that it runs along edges; its vertices are there once for each side. A locus that is one point
 * becomes a slit of two edges, on a closed surface; a disk with a border needs no cut. The vertices
 * of in->mesh that stay single keep their numbers' order; *origin, if origin is not NULL, tells for
 * each vertex the one of in->mesh at the same place, or -1 where it is new (the caller frees). */
int dmk_locus_cut(dmk_context *ctx, const dmk_locus_input *in, const dmk_locus_options *opt,
                  dmk_mesh **cut, int32_t **origin);

#endif
