/* The flat triangle mesh: vertices, triangles, the edges between them, and the intrinsic geometry.
 *
 * Corners are numbered 0, 1, 2 counterclockwise. Corner and half-edge h = 3t + k: half-edge h of
 * triangle t lies opposite corner k and runs from corner (k+1)%3 to (k+2)%3. */
#ifndef DMK_MESH_H
#define DMK_MESH_H

#include "base/base.h"
#include "base/sort.h"

struct dmk_mesh {
    int32_t n_vertices, n_triangles, n_edges;
    double *xyz;            /* 3*n_vertices, in the input's order */
    int32_t *triangle;      /* 3*n_triangles: corner vertices, consistently oriented */
    int32_t *triangle_edge; /* 3*n_triangles: edge opposite corner k */
    int32_t *edge_vertex;   /* 2*n_edges: end vertices, the smaller first */
    int32_t *edge_triangle; /* 2*n_edges: the triangles on it, the one that runs it from
                               edge_vertex[2e] to [2e+1] first if it exists; -1 on a border
                               (always in slot 1) */
    int32_t *corner;    /* n_vertices: the first triangle's corner at each, -1: in no triangle */
    int32_t *component; /* n_triangles: connected component, numbered by first triangle; NULL if
                               there is only one: see dmk_mesh_component */
    int32_t n_components;
    double *length;  /* n_edges */
    double *area;    /* n_triangles; cotangents: dmk_cot */
    double sharpest; /* the largest cotangent, of either sign; of a mesh that has been described */
    int32_t n_used_vertices, n_border_edges, n_border_loops;
    dmk_mesh_info info; /* none of a rank's share */
};

/* The next half-edge (or corner) of the triangle, counterclockwise, and the one before. */
static inline int32_t dmk_next(int32_t h)
{
    return h % 3 == 2 ? h - 2 : h + 1;
}
static inline int32_t dmk_previous(int32_t h)
{
    return h % 3 == 0 ? h + 2 : h - 1;
}

/* The half-edge of triangle t on its edge e. */
static inline int32_t dmk_half_edge_on(const dmk_mesh *m, int32_t t, int32_t e)
{
    int32_t h = 3 * t;
    while (m->triangle_edge[h] != e) h++;
    return h;
}

/* The other triangle on edge e of t; -1 at a border. */
static inline int32_t dmk_twin_triangle(const dmk_mesh *m, int32_t t, int32_t e)
{
    const int32_t *pair = m->edge_triangle + 2 * (size_t)e;
    return pair[0] == t ? pair[1] : pair[0];
}

static inline int32_t dmk_mesh_component(const dmk_mesh *m, int32_t t)
{
    return m->component ? m->component[t] : 0;
}

/* The cotangent of the angle at corner k of triangle t, h = 3 t + k: of dmk_measure_sides, to the bit. Three
 * numbers per triangle less to keep and to read. */
static inline double dmk_cot(const dmk_mesh *m, int32_t h)
{
    const int32_t t = h / 3, *edge = m->triangle_edge + 3 * (size_t)t;
    const int k = h % 3, i = k == 2 ? 0 : k + 1, j = k == 0 ? 2 : k - 1;
    const double o = m->length[edge[k]], p = m->length[edge[i]], q = m->length[edge[j]];
    return (p * p + q * q - o * o) / (4 * m->area[t]);
}

/* Those of the angles at t's corners 0, 1 and 2: dmk_cot of 3 t, 3 t + 1 and 3 t + 2. */
static inline void dmk_cots(const dmk_mesh *m, int32_t t, double cot[3])
{
    const int32_t *edge = m->triangle_edge + 3 * (size_t)t;
    const double a = m->length[edge[0]], b = m->length[edge[1]], c = m->length[edge[2]],
                 part = 4 * m->area[t];
    cot[0] = (b * b + c * c - a * a) / part;
    cot[1] = (c * c + a * a - b * b) / part;
    cot[2] = (a * a + b * b - c * c) / part;
}

/* Of a mesh that has been described. */
static inline bool dmk_mesh_is_disk(const dmk_mesh *m)
{
    return m->info.euler == 1 && m->info.n_border_loops == 1 && m->info.n_components == 1;
}

/* Vertex -> incident triangles, as compressed rows. */
typedef struct dmk_vertex_stars {
    int32_t *row;      /* n_vertices + 1 */
    int32_t *triangle; /* 3*n_triangles: triangle * 4 + corner; within a row in increasing order */
} dmk_vertex_stars;

/* edges.c. */
int dmk_vertex_stars_create(dmk_context *context, const dmk_mesh *mesh, dmk_vertex_stars *stars);
void dmk_vertex_stars_free(dmk_vertex_stars *stars);

/* create.c: take ownership of malloc'ed xyz and triangle (freed also on failure), build topology and
 * geometry, check (see dmk_mesh_create for what is refused). */
int dmk_mesh_adopt(dmk_context *context, size_t n_vertices, double *xyz, size_t n_triangles,
                   int32_t *triangle, dmk_mesh **mesh);
/* The same by several ranks together, each of which has all; or with NULL. */
int dmk_mesh_adopt_together(dmk_context *context, const dmk_ranks *ranks, size_t n_vertices,
                            double *xyz, size_t n_triangles, int32_t *triangle, dmk_mesh **mesh);

/* create.c: the same of a mesh of which `info` is known, from checks of an earlier time: without edges. */
int dmk_mesh_adopt_known(dmk_context *context, const dmk_mesh_info *info, double *xyz,
                         int32_t *triangle, dmk_mesh **mesh);

/* mesh.c: DMK_E_ARG after dmk_mesh_forget_edges. */
int dmk_mesh_check_edges(dmk_context *context, const dmk_mesh *mesh);

/* mesh.c: DMK_E_MESH if there is no triangle or 32 bits cannot number them. */
int dmk_mesh_check_counts(dmk_context *context, size_t n_vertices, size_t n_triangles);

/* Sides e of a triangle by their lengths, the longest first. */
static inline void dmk_sort_sides(const double *length, int32_t e[3])
{
    int32_t s;
    if (length[e[0]] < length[e[1]]) s = e[0], e[0] = e[1], e[1] = s;
    if (length[e[1]] < length[e[2]]) s = e[1], e[1] = e[2], e[2] = s;
    if (length[e[0]] < length[e[1]]) s = e[0], e[0] = e[1], e[1] = s;
}

/* mesh.c: whether the longest of the sides l is the sum of the others, as far as rounded lengths can show. */
bool dmk_sides_are_flat(const double l[3]);

/* mesh.c: area and cotangents of a triangle from its sides alone (Kahan's stable form of Heron's
 * formula), so that an intrinsic metric would do as well: cot at corner k, opposite side l[k], is
 * (b^2 + c^2 - a^2) / (4 area). */
void dmk_measure_sides(const double l[3], double *area, double cot[3]);

/* mesh.c: the area of triangle t between its corners. `area` comes from sides: of a thin triangle it has fewer digits,
 * or is that of the thicker one which stands for it (mollify.h). */
double dmk_area_in_space(const dmk_mesh *mesh, int32_t t);

/* mesh.c: dmk_measure_sides with the checks of a triangle that has sides l and the number t and corners v in the
 * input; without a context a failure says nothing. */
int dmk_measure_checked(dmk_context *context, const double l[3], int64_t t, const int64_t v[3],
                        double *area);

/* info.c: fill in corner, n_used_vertices, n_border_edges, n_border_loops of a mesh with edges. */
int dmk_mesh_count(dmk_context *context, dmk_mesh *mesh);

/* info.c: fill in `info` of a mesh that is complete else. same: one of the same triangles in another order that has
 * been described, so that there is no need to look at all angles again; or NULL. */
int dmk_mesh_describe(dmk_context *context, dmk_mesh *mesh, const dmk_mesh *same);

/* Sums and extremes, of a mesh or a piece of it. The sums are those of even ranges of the edges and of the triangles,
 * one after another: speed only, but their last bits hang on the number of the ranges. */
enum { DMK_MEASURE_PIECES = 64 };
typedef struct dmk_measures {
    double edges, min_edge, max_edge, area, min_cot, max_cot, box_min[3], box_max[3];
} dmk_measures;
dmk_measures dmk_measures_none(void);
/* Extremes only. */
static inline void dmk_measures_edge(dmk_measures *of, double length)
{
    of->min_edge = dmk_min(of->min_edge, length);
    of->max_edge = dmk_max(of->max_edge, length);
}
static inline void dmk_measures_corner(dmk_measures *of, double cot, const double xyz[3])
{
    of->min_cot = dmk_min(of->min_cot, cot);
    of->max_cot = dmk_max(of->max_cot, cot);
    for (int k = 0; k < 3; k++) {
        of->box_min[k] = dmk_min(of->box_min[k], xyz[k]);
        of->box_max[k] = dmk_max(of->box_max[k], xyz[k]);
    }
}
void dmk_measures_add(dmk_measures *to, const dmk_measures *more);
/* All of `info` but the counts, of which it needs that of the edges. */
void dmk_measures_tell(const dmk_measures *all, dmk_mesh_info *info);

/* order.c: the component `component` of `mesh` as a mesh of its own, in an order that keeps
 * neighbours near in memory: triangles along a space-filling (Morton) curve of their centroids,
 * vertices and edges by first touch. New index -> old index maps are the caller's to free. */
typedef struct dmk_order {
    dmk_mesh *mesh;
    int32_t *vertex_old; /* mesh->n_vertices */
    int32_t
        *triangle_old; /* mesh->n_triangles; corner k of the new triangle is corner k of the old */
    int32_t *edge_old; /* mesh->n_edges */
} dmk_order;
int dmk_order_create(dmk_context *context, const dmk_mesh *mesh, int32_t component,
                     dmk_order *order);
/* Of a mesh that is not wanted any more: it is freed on the way, also on failure. */
int dmk_order_adopt(dmk_context *context, dmk_mesh **mesh, int32_t component, dmk_order *order);
void dmk_order_free(dmk_order *order);
/* The place of a triangle with the corners a, b, c along the curve, DMK_KEY_BITS bits, in a box from lo to hi. */
double dmk_morton_scale(const double lo[3], const double hi[3]);
uint64_t dmk_morton_key(const double a[3], const double b[3], const double c[3], const double lo[3],
                        double scale);

/* The component's triangles along the curve, *n of them; the caller frees *sorted. */
enum { DMK_ALL_COMPONENTS = -1 };
/* Of triangles and of vertices: up to 12 numbers per triangle must be counted in 32 bits. */
enum { DMK_MOST_TRIANGLES = INT32_MAX / 16 };
int dmk_morton_order(dmk_context *context, const dmk_mesh *mesh, int32_t component,
                     dmk_keyed **sorted, int32_t *n);

/* point.c: the point of a triangle nearest to xyz, as weights of its corners, and how far it is from there. */
double dmk_mesh_nearest_in(const dmk_mesh *mesh, int32_t triangle, const double xyz[3],
                           double weight[3]);

/* point.c: the same of any corners, and the squared distance; small weights are rounding, and become 0. */
double dmk_project_corners(const double *const corner[3], const double xyz[3], double weight[3]);
void dmk_point_snap(double weight[3]);

/* polygon.c: the n - 2 triangles of a polygon of n corners (3 or more, each a vertex): the fan around its first
 * one where that is right. DMK_E_MESH if it has no such fan and too many corners. */
int dmk_polygon_split(dmk_context *context, const double *xyz, size_t n, const int32_t *corner,
                      int32_t *triangle);

/* point.c: DMK_E_ARG unless it is a point of the mesh; `what` names it in the message. */
int dmk_point_check(dmk_context *context, const dmk_mesh *mesh, const char *what,
                    const dmk_point *point);

#endif
