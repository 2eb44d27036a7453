/* The surface cut open along its cut locus. */
#ifndef DMK_LOCUS_CUT_H
#define DMK_LOCUS_CUT_H

#include "locus/locus.h"

/* A disk: one border loop, Euler characteristic 1. The triangles that the locus crosses are split so that
 * it runs along edges; its vertices are there once for each side. A locus that crosses fewer than three
 * edges of a sphere becomes a slit of two edges; a disk with a border needs no cut. The mesh begins with the
 * vertices of geodesics->mesh in their order. *origin: for each vertex the one of that mesh at the same
 * place, or -1 where it is new; *plane: 2 for each vertex, distance times the direction at the source of
 * the geodesics on its side (the caller frees both). */
int dmk_locus_cut(dmk_context *ctx, const dmk_geodesics *geodesics, const dmk_locus_options *opt,
                  dmk_mesh **cut, int32_t **origin, double **plane);

#endif
