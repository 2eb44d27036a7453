/* A triangle soup on its way to a manifold, what repair.c does to it first, and manifold.c then. Half-edges and corners
 * are numbered as in mesh.h; twin[h]: the half-edge that h is joined to, or -1. */
#ifndef DMK_MESH_MANIFOLD_H
#define DMK_MESH_MANIFOLD_H

#include "mesh/mesh.h"

#include <math.h>

typedef struct side {
    int32_t a, b, half; /* a < b: the ends */
} side;

typedef struct soup {
    dmk_context *ctx;
    int32_t n_vertices, n_triangles;
    const double *xyz;
    int32_t *triangle; /* 3*n_triangles: corners, as far as they are mended */
    int32_t *old;      /* n_triangles: number in the input */
    int32_t *twin;     /* 3*n_triangles */
    side *crowd;       /* n_crowd: those at edges of more than two triangles, edge by edge */
    int32_t n_crowd;
    int32_t *piece;  /* n_triangles: the first one that hangs together with it over edges of two */
    uint8_t *turned; /* n_triangles: against the input */
    dmk_repairs *count;
} soup;

static inline const double *point(const soup *s, int32_t v)
{
    return s->xyz + 3 * (size_t)v;
}

static inline bool is_finite(const double *x)
{
    return isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
}

static inline int by_ends(const void *left, const void *right)
{
    const side *p = left, *q = right;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    if (p->b != q->b) return p->b < q->b ? -1 : 1;
    return (p->half > q->half) - (p->half < q->half);
}

static inline int32_t from_of(const soup *s, int32_t h)
{
    return s->triangle[dmk_next(h)];
}
static inline int32_t to_of(const soup *s, int32_t h)
{
    return s->triangle[dmk_previous(h)];
}

static inline void join(soup *s, int32_t g, int32_t h)
{
    s->twin[g] = h;
    s->twin[h] = g;
}

/* Behind the last of the n sides that has the ends of side i. */
static inline int32_t edge_end(const side *list, int32_t n, int32_t i)
{
    int32_t j = i + 1;
    while (j < n && list[j].a == list[i].a && list[j].b == list[i].b) j++;
    return j;
}

/* In this order, after the edges of two triangles have been joined and turned. */
/* Pairs at edges of more than two triangles. */
int dmk_repair_pair_edges(soup *s);
/* What is there twice by that, an edge between the same two vertices, is joined in another way. */
int dmk_repair_settle_edges(soup *s);
/* A vertex whose triangles do not hang together becomes several. first[v]: the vertex that v has been merged into; *n:
 * how many there are. */
int dmk_repair_number_vertices(soup *s, const int32_t *first, int32_t *n);

#endif
