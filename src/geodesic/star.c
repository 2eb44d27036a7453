/* Directions at the vertices: see dmk_star. */
#include "base/heading.h"
#include "base/sets.h"
#include "geodesic/geodesic.h"

#include "base/parallel.h"
#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct work {
    const dmk_mesh *mesh;
    dmk_star *star;
} work;

void dmk_measure_corners(const dmk_mesh *m, double unit, int32_t t, double *area2, double dot[3])
{
    double side[3][3], n[3];
    for (int k = 0; k < 3; k++) {
        const double *a = m->xyz + 3 * (size_t)m->triangle[3 * (size_t)t + (k + 1) % 3];
        const double *b = m->xyz + 3 * (size_t)m->triangle[3 * (size_t)t + (k + 2) % 3];
        for (int i = 0; i < 3; i++) side[k][i] = b[i] * unit - a[i] * unit;
    }
    dmk_cross(side[0], side[1], n);
    *area2 = sqrt(dmk_dot(n, n));
    for (int k = 0; k < 3; k++) dot[k] = -dmk_dot(side[(k + 1) % 3], side[(k + 2) % 3]);
}

/* Angles by the cross product: those of needles keep their digits. The largest, of the least dot product over its
 * sides, is what is left of pi. */
static void measure_range(int32_t begin, int32_t end, void *data)
{
    const work *w = data;
    const double unit = 1 / w->star->unit;
    for (int32_t t = begin; t < end; t++) {
        double area2, dot[3], *angle = w->star->corner_angle + 3 * (size_t)t;
        dmk_measure_corners(w->mesh, unit, t, &area2, dot);
        int k = dot[0] < dot[1] ? 0 : 1; /* opposite the longest side: the least product */
        if (dot[2] < dot[k]) k = 2;
        int i = (k + 1) % 3, j = (k + 2) % 3;
        angle[i] = dmk_angle_of(dot[i], area2);
        angle[j] = dmk_angle_of(dot[j], area2);
        angle[k] = M_PI - angle[i] - angle[j];
    }
}

static void pair_range(int32_t begin, int32_t end, void *data)
{
    const work *w = data;
    const dmk_mesh *m = w->mesh;
    for (int32_t t = begin; t < end; t++) {
        for (int k = 0; k < 3; k++) {
            const int32_t e = m->triangle_edge[3 * (size_t)t + k], o = dmk_twin_triangle(m, t, e);
            w->star->twin[3 * (size_t)t + k] = o < 0 ? -1 : dmk_half_edge_on(m, o, e);
        }
    }
}

/* The first corner of each star: the clockwise-most at a border, else that in the triangle of the least number. */
static void find_first(const dmk_mesh *m, const int32_t *old, dmk_star *s)
{
    for (int32_t v = 0; v < m->n_vertices; v++) s->first[v] = -1;
    for (int32_t c = 0; c < 3 * m->n_triangles; c++) {
        int32_t v = m->triangle[c];
        bool border = s->twin[dmk_previous(c)] < 0; /* the edge from v to the next corner */
        if (border) s->border[v] = true;
        bool before =
            s->first[v] < 0 || (old && !s->border[v] && old[c / 3] < old[s->first[v] / 3]);
        if (border || before) s->first[v] = c;
    }
}

static double turn(const dmk_star *s, int32_t first)
{
    double sum = 0;
    int32_t c = first;
    do {
        s->angle[c] = sum;
        sum += s->corner_angle[c];
        c = dmk_star_next(s, c);
    } while (c >= 0 && c != first);
    return sum;
}

/* By the triangle of the first corner: neighbours in memory, as vertices of a subdivided mesh are not. */
static void turn_range(int32_t begin, int32_t end, void *data)
{
    const work *w = data;
    for (int32_t c = 3 * begin; c < 3 * end; c++) {
        const int32_t v = w->mesh->triangle[c];
        if (w->star->first[v] == c) w->star->total[v] = turn(w->star, c);
    }
}

/* A power of two near half of the mesh's size. */
static double find_unit(const dmk_mesh *m)
{
    double most = 0;
    int exponent;
    for (int k = 0; k < 3; k++) most = fmax(most, m->info.box_max[k] / 2 - m->info.box_min[k] / 2);
    frexp(most, &exponent);
    return ldexp(1, exponent);
}

int dmk_star_create(dmk_context *ctx, const dmk_mesh *m, const int32_t *old, dmk_star *s)
{
    int rc;
    work w = {m, s};
    size_t n_half = 3 * (size_t)m->n_triangles, n_vertices = (size_t)m->n_vertices;
    memset(s, 0, sizeof *s);
    DMK_TRY(DMK_NEW_UNSET(ctx, s->angle, n_half));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->corner_angle, n_half));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->twin, n_half));
    DMK_TRY(DMK_NEW(ctx, s->total, n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->first, n_vertices));
    DMK_TRY(DMK_NEW(ctx, s->border, n_vertices));
    s->unit = find_unit(m);
    dmk_parallel(ctx, m->n_triangles, measure_range, &w);
    DMK_TRY(dmk_poll(ctx));
    dmk_parallel(ctx, m->n_triangles, pair_range, &w);
    find_first(m, old, s);
    DMK_TRY(dmk_poll(ctx));
    dmk_parallel(ctx, m->n_triangles, turn_range, &w);
done:
    if (rc != DMK_OK) dmk_star_free(s);
    return rc;
}

void dmk_star_free(dmk_star *s)
{
    free(s->angle);
    free(s->corner_angle);
    free(s->twin);
    free(s->total);
    free(s->first);
    free(s->border);
    memset(s, 0, sizeof *s);
}

int dmk_star_loops(dmk_context *ctx, const dmk_mesh *m, const dmk_star *star, int32_t *parent,
                   int32_t **loop, int32_t *n_loops)
{
    int rc = DMK_NEW(ctx, *loop, (size_t)m->n_vertices);
    if (rc != DMK_OK) return rc;
    for (int32_t v = 0; v < m->n_vertices; v++) parent[v] = v;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (star->twin[h] < 0)
            dmk_set_unite(parent, m->triangle[dmk_next(h)], m->triangle[dmk_previous(h)]);
    }
    *n_loops = 0;
    for (int32_t v = 0; v < m->n_vertices; v++) { /* a set's name is its least member */
        const int32_t first = star->border[v] ? dmk_set_find(parent, v) : -1;
        (*loop)[v] = first < 0 ? -1 : first == v ? (*n_loops)++ : (*loop)[first];
    }
    return DMK_OK;
}
