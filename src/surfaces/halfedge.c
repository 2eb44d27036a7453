/* Changing triangulations: see halfedge.h. */
#include "surfaces/halfedge.h"

#include <stdlib.h>
#include <string.h>

static void link_halves(dmk_halfedge *m, int32_t g, int32_t h)
{
    m->twin[g] = h;
    m->twin[h] = g;
}

static void set_triangle(dmk_halfedge *m, int32_t t, int32_t a, int32_t b, int32_t c)
{
    int32_t v[3] = {a, b, c};
    for (int k = 0; k < 3; k++) {
        m->triangle[3 * t + k] = v[k];
        m->corner[v[k]] = 3 * t + k;
    }
}

/* The vertex where half-edge h starts. */
static int32_t origin(const dmk_halfedge *m, int32_t h)
{
    return m->triangle[dmk_next(h)];
}

/* Match the half-edges, of which each has one twin, through one list per start vertex. */
static int find_twins(dmk_context *ctx, dmk_halfedge *m)
{
    int rc = DMK_OK;
    int32_t *first = NULL, *next = NULL;
    DMK_TRY(DMK_NEW(ctx, first, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, next, 3 * (size_t)m->n_triangles));
    for (int32_t v = 0; v < m->n_vertices; v++) first[v] = -1;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        next[h] = first[origin(m, h)];
        first[origin(m, h)] = h;
    }
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        m->twin[h] = first[origin(m, dmk_next(h))];
        while (origin(m, dmk_next(m->twin[h])) != origin(m, h)) m->twin[h] = next[m->twin[h]];
    }
done:
    free(first);
    free(next);
    return rc;
}

int dmk_halfedge_create(dmk_context *ctx, int32_t n_vertices, const double *xyz,
                        int32_t n_triangles, const int32_t *triangle, int32_t max_vertices,
                        dmk_halfedge *m)
{
    int rc;
    size_t room = (size_t)dmk_max_i(n_vertices, max_vertices);
    /* A split adds one vertex and two triangles. */
    size_t max_triangles = (size_t)n_triangles + 2 * (room - (size_t)n_vertices);
    memset(m, 0, sizeof *m);
    m->n_vertices = n_vertices;
    m->n_triangles = n_triangles;
    DMK_TRY(DMK_NEW(ctx, m->xyz, 3 * room));
    DMK_TRY(DMK_NEW(ctx, m->corner, room));
    DMK_TRY(DMK_NEW(ctx, m->degree, room));
    DMK_TRY(DMK_NEW(ctx, m->triangle, 3 * max_triangles));
    DMK_TRY(DMK_NEW(ctx, m->twin, 3 * max_triangles));
    memcpy(m->xyz, xyz, 3 * (size_t)n_vertices * sizeof *xyz);
    for (int32_t t = 0; t < n_triangles; t++) {
        set_triangle(m, t, triangle[3 * t], triangle[3 * t + 1], triangle[3 * t + 2]);
    }
    for (int32_t c = 0; c < 3 * n_triangles; c++) m->degree[triangle[c]]++;
    DMK_TRY(find_twins(ctx, m));
done:
    if (rc != DMK_OK) dmk_halfedge_free(m);
    return rc;
}

void dmk_halfedge_free(dmk_halfedge *m)
{
    free(m->xyz);
    free(m->triangle);
    free(m->twin);
    free(m->corner);
    free(m->degree);
    memset(m, 0, sizeof *m);
}

bool dmk_halfedge_joined(const dmk_halfedge *m, int32_t a, int32_t b)
{
    int32_t c = m->corner[a];
    do {
        if (m->triangle[dmk_next(c)] == b) return true;
        c = dmk_next_corner(m, c);
    } while (c != m->corner[a]);
    return false;
}

/*        d                 d
 *      / | \             /   \          h runs b -> d in t = (a, b, d),
 *     a t|s c    ->     a-----c         its twin d -> b in s = (c, d, b);
 *      \ | /             \   /          then t = (a, b, c), s = (c, d, a).
 *        b                 b                                              */
void dmk_halfedge_flip(dmk_halfedge *m, int32_t h)
{
    int32_t g = m->twin[h], t = h / 3, s = g / 3;
    int32_t a = m->triangle[h], b = origin(m, h), c = m->triangle[g], d = origin(m, g);
    int32_t da = m->twin[dmk_next(h)], ab = m->twin[dmk_previous(h)];
    int32_t bc = m->twin[dmk_next(g)], cd = m->twin[dmk_previous(g)];
    set_triangle(m, t, a, b, c);
    set_triangle(m, s, c, d, a);
    link_halves(m, 3 * t, bc);
    link_halves(m, 3 * t + 1, 3 * s + 1);
    link_halves(m, 3 * t + 2, ab);
    link_halves(m, 3 * s, da);
    link_halves(m, 3 * s + 2, cd);
    m->degree[a]++;
    m->degree[b]--;
    m->degree[c]++;
    m->degree[d]--;
}

/* With the letters above and the new vertex v on b-d: t = (a, b, v), s = (c, d, v), and new
 * p = (a, v, d), q = (c, v, b). */
void dmk_halfedge_split(dmk_halfedge *m, int32_t h, const double xyz[3])
{
    int32_t g = m->twin[h], t = h / 3, s = g / 3, p = m->n_triangles, q = p + 1;
    int32_t a = m->triangle[h], b = origin(m, h), c = m->triangle[g], d = origin(m, g);
    int32_t da = m->twin[dmk_next(h)], ab = m->twin[dmk_previous(h)];
    int32_t bc = m->twin[dmk_next(g)], cd = m->twin[dmk_previous(g)];
    int32_t v = m->n_vertices++;
    m->n_triangles += 2;
    memcpy(m->xyz + 3 * v, xyz, 3 * sizeof *xyz);
    set_triangle(m, t, a, b, v);
    set_triangle(m, s, c, d, v);
    set_triangle(m, p, a, v, d);
    set_triangle(m, q, c, v, b);
    link_halves(m, 3 * t, 3 * q);
    link_halves(m, 3 * t + 1, 3 * p + 2);
    link_halves(m, 3 * t + 2, ab);
    link_halves(m, 3 * s, 3 * p);
    link_halves(m, 3 * s + 1, 3 * q + 2);
    link_halves(m, 3 * s + 2, cd);
    link_halves(m, 3 * p + 1, da);
    link_halves(m, 3 * q + 1, bc);
    m->degree[a]++;
    m->degree[c]++;
    m->degree[v] = 4;
}
