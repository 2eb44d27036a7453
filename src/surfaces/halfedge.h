/* A closed triangulation that can change: edges flip and split in constant time.
 *
 * Corner c = 3t + k is corner k of triangle t; half-edge c lies opposite it and runs from corner
 * (k+1)%3 to (k+2)%3. twin[c] is the same edge run the other way, in the neighbour. */
#ifndef DMK_HALFEDGE_H
#define DMK_HALFEDGE_H

#include "mesh/mesh.h"

typedef struct dmk_halfedge {
    int32_t n_vertices, n_triangles;
    double *xyz;       /* 3 per vertex */
    int32_t *triangle; /* 3 per triangle: corner vertices, counterclockwise */
    int32_t *twin;     /* 3 per triangle: twin of half-edge c */
    int32_t *corner;   /* per vertex: one of its corners */
    int32_t *degree;   /* per vertex: its edges */
} dmk_halfedge;

/* Copy a closed, consistently oriented triangulation, with room to grow to max_vertices. */
int dmk_halfedge_create(dmk_context *context, int32_t n_vertices, const double *xyz,
                        int32_t n_triangles, const int32_t *triangle, int32_t max_vertices,
                        dmk_halfedge *mesh);
void dmk_halfedge_free(dmk_halfedge *mesh);

/* Where vertex v is. */
static inline const double *dmk_point_of(const dmk_halfedge *m, int32_t v)
{
    return m->xyz + 3 * (size_t)v;
}

/* Where the vertex at corner c is. */
static inline const double *dmk_point_at(const dmk_halfedge *m, int32_t c)
{
    return dmk_point_of(m, m->triangle[c]);
}

/* The next corner of the same vertex, counterclockwise. */
static inline int32_t dmk_next_corner(const dmk_halfedge *m, int32_t c)
{
    return dmk_next(m->twin[dmk_next(c)]);
}

/* True if an edge joins a and b. */
bool dmk_halfedge_joined(const dmk_halfedge *mesh, int32_t a, int32_t b);
/* Turn half-edge h in the quadrangle of its two triangles. The caller has checked that the new edge
 * does not exist yet. The two triangles keep their numbers. */
void dmk_halfedge_flip(dmk_halfedge *mesh, int32_t h);
/* Put a new vertex xyz on half-edge h; its number is the old n_vertices, and the two new triangles
 * are the last ones. The caller has seen to the room. */
void dmk_halfedge_split(dmk_halfedge *mesh, int32_t h, const double xyz[3]);

#endif
