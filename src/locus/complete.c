/* Where the shortest geodesics to the two ends of an edge belong to different families, the place
 * of the locus on the edge needs both families at both ends. The fan gives nearly all of them; the
 * rest is unfolded from the neighbours here. A geodesic found so may even be the shortest. */
#include "locus/rays.h"

#include <stdlib.h>

/* In lengths of an edge: a beam between its ends wider than this is no beam. */
static const double wide = 2.0;
/* In mean edges at a vertex: a geodesic longer by this is nearly the shortest. */
static const double nearly = 0.5;
/* In lengths of the edge: how far outside a beam it is continued. */
static const double beyond = 0.7;

/* Returns true if the new sheet is the vertex's shortest. */
static bool add_sheet(dmk_rays *r, int32_t v, dmk_sheet s)
{
    dmk_sheet *first = r->sheet + r->row[v], old = *first;
    if (r->row[v] + r->n_sheets[v] == r->row[v + 1]) return false;
    bool shortest = s.distance < old.distance;
    first[r->n_sheets[v]++] = shortest ? old : s;
    if (shortest) *first = s;
    return shortest;
}

/* Continue the shortest geodesic of w to v, the two corners k and j of triangle t, with the help of
 * the third corner. */
static bool continue_in(const dmk_rays *r, int32_t t, int k, int j, dmk_sheet *found)
{
    const dmk_mesh *m = r->mesh;
    const int32_t *v = m->triangle + 3 * t;
    int third = 3 - k - j;
    const dmk_sheet *w = dmk_rays_first(r, v[j]);
    double length = m->length[m->triangle_edge[3 * t + k]];
    int32_t i = dmk_rays_continue(r, w, length, v[third]);
    if (i < 0) return false;
    const dmk_sheet *x = r->sheet + i;
    if (j == (k + 1) % 3) return dmk_rays_unfold(r, t, k, w, x, beyond, found);
    return dmk_rays_unfold(r, t, k, x, w, beyond, found);
}

/* Make the shortest geodesic of w known at v. Returns true if that changes v's shortest. */
static bool complete_end(dmk_rays *r, int32_t e, int32_t v, int32_t w)
{
    const dmk_mesh *m = r->mesh;
    if (dmk_rays_continue(r, dmk_rays_first(r, w), m->length[e], v) >= 0) return false;
    for (int side = 0; side < 2; side++) {
        int32_t t = m->edge_triangle[2 * e + side];
        if (t < 0) continue;
        int k = 0, j = 0;
        dmk_sheet found;
        while (m->triangle[3 * t + k] != v)
            k++;
        while (m->triangle[3 * t + j] != w)
            j++;
        if (continue_in(r, t, k, j, &found)) return add_sheet(r, v, found);
    }
    return false;
}

/* Edges whose ends belong to one family, by vertex: does v have one? */
static void find_connected(const dmk_rays *r, bool *connected)
{
    const dmk_mesh *m = r->mesh;
    for (int32_t e = 0; e < m->n_edges; e++) {
        int32_t v = m->edge_vertex[2 * e], w = m->edge_vertex[2 * e + 1];
        double width = dmk_rays_width(r, dmk_rays_first(r, v), dmk_rays_first(r, w));
        if (width < wide * m->length[e]) connected[v] = connected[w] = true;
    }
}

/* A vertex that differs from all its neighbours, but is reached by one of their families hardly
 * farther: that one is its own. (Near the locus the order of the two is a matter of rounding.) */
static void join_neighbours(dmk_rays *r, const bool *connected)
{
    const dmk_mesh *m = r->mesh;
    for (int32_t h = 0; h < 2 * m->n_edges; h++) {
        int32_t v = m->edge_vertex[h], w = m->edge_vertex[h ^ 1];
        if (connected[v] || !connected[w]) continue;
        dmk_sheet *first = r->sheet + r->row[v];
        int32_t i = dmk_rays_continue(r, dmk_rays_first(r, w), m->length[h / 2], v);
        if (i <= r->row[v] || r->sheet[i].distance > first->distance + nearly * r->size[v])
            continue;
        dmk_sheet other = *first;
        *first = r->sheet[i];
        r->sheet[i] = other;
    }
}

static void complete_all(dmk_rays *r)
{
    const dmk_mesh *m = r->mesh;
    bool changed = true;
    for (int round = 0; changed && round < 4; round++) {
        changed = false;
        for (int32_t e = 0; e < m->n_edges; e++) {
            int32_t v = m->edge_vertex[2 * e], w = m->edge_vertex[2 * e + 1];
            double width = dmk_rays_width(r, dmk_rays_first(r, v), dmk_rays_first(r, w));
            if (width < wide * m->length[e]) continue;
            if (complete_end(r, e, v, w)) changed = true;
            if (complete_end(r, e, w, v)) changed = true;
        }
    }
}

int dmk_rays_complete(dmk_context *ctx, dmk_rays *r)
{
    int rc;
    bool *connected = NULL;
    complete_all(r);
    DMK_TRY(DMK_NEW(ctx, connected, (size_t)r->mesh->n_vertices));
    find_connected(r, connected);
    join_neighbours(r, connected);
done:
    free(connected);
    return rc;
}
