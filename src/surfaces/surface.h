/* The built-in surfaces: closed level sets F(x) = 0, with F < 0 inside. */
#ifndef DMK_SURFACE_H
#define DMK_SURFACE_H

#include "base/base.h"

struct dmk_body;

/* A bare closed triangulation; both arrays belong to whoever holds the struct. */
typedef struct dmk_patch {
    int32_t n_vertices, n_triangles;
    double *xyz;       /* 3*n_vertices */
    int32_t *triangle; /* 3*n_triangles, counterclockwise seen from outside */
} dmk_patch;

/* One row of the table of surfaces: this is all that a new surface needs. */
typedef struct dmk_surface {
    const char *name;
    const char *text;    /* on the sizes and their defaults */
    double size[3];      /* defaults of a, b, c; 0: the surface has no such size */
    int32_t n_triangles; /* default size of the coarse mesh */
    int32_t euler;       /* V - E + F */
    bool axes;           /* a, b, c are semi-axes: F depends on x/a, y/b, z/c alone */
    /* F(x) and its gradient; scaled so that F is of order 1 away from the surface. */
    double (*value)(const double size[3], const double x[3], double gradient[3]);
    /* NULL if the sizes (all positive) are fine, else what they must be. */
    const char *(*check)(const double size[3]);
    /* A very coarse triangulation to grow the mesh from: closed, of the right topology, without
     * symmetry planes; vertices on the surface, edges near enough for `lift` to find it. */
    int (*start)(dmk_context *context, const struct dmk_body *body, dmk_patch *patch);
} dmk_surface;

/* A surface with its sizes. */
typedef struct dmk_body {
    const dmk_surface *surface;
    double size[3];
} dmk_body;

/* Row `index` of the table, NULL past the last. */
const dmk_surface *dmk_surface_get(size_t index);

/* Move x along the gradient to the surface (Newton), until rounding. False if it cannot: x is at a
 * point where the gradient vanishes or is not finite. */
bool dmk_body_lift(const dmk_body *body, double x[3]);
/* The point of the surface nearest to x, at least locally. False as above. */
bool dmk_body_nearest(const dmk_body *body, double x[3]);
/* Outward unit normal of the level set through x; zero where the gradient vanishes. */
void dmk_body_normal(const dmk_body *body, const double x[3], double normal[3]);

#endif
