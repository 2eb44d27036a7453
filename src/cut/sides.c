/* Directions on the sides of the cut. It does not run just between the families of paths everywhere: where two that are
 * about as long reach the same vertices, as behind a saddle vertex on the cut locus, it leaves some with those that the
 * other one reaches. In the plane they would lie far off, among the triangles of the other side. So directions are
 * taken on from neighbour to neighbour on the same side, away from the source; a vertex has that of its own path where
 * that is of one family with a neighbour's, else that of the neighbours' family which is the shortest there. */
#include "base/sort.h"
#include "cut/cut.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>

/* Radians: directions of neighbours that differ by more are of two families, on tori by 2.1 to 2.4. 0.2 to 1.4 does as
 * well there; with 1.4 scans have 7 % more triangles turned over in the plane, with 0.35 2 % fewer. */
static const double apart = 0.7;

typedef struct sides {
    const dmk_geodesics *g;
    const bool *crossed; /* 3 n_triangles: half-edges that the cut crosses */
    double *turn;     /* n_vertices: from the direction of a vertex' own path to that of its side */
    bool *known;      /* n_vertices */
    double least, to; /* length of the shortest family of the neighbours; what it turns by */
} sides;

/* The family of the corner, as it is on its side, at vertex v of its triangle: true if v's own path is of it. */
static bool reaches(sides *s, int32_t corner, int32_t v)
{
    const dmk_geodesics *g = s->g;
    const dmk_mesh *m = g->mesh;
    const int32_t w = m->triangle[corner];
    double map[2];
    if (g->distance[w] == 0) return true;
    dmk_place_in_plane(g, corner, m->xyz + 3 * (size_t)v, map);
    const double length = hypot(map[0], map[1]);
    const double to = remainder(
        atan2(map[1], map[0]) + s->turn[w] - dmk_turn_scale(g) * g->arrival[v].direction, 2 * M_PI);
    if (length < s->least) {
        s->least = length;
        s->to = to;
    }
    return fabs(to) < apart;
}

/* From the neighbours on its side that are known, and nearer to the source if so wanted; false if there are none. */
static bool set_turn(sides *s, int32_t v, bool from_nearer)
{
    const dmk_geodesics *g = s->g;
    const int32_t *of = g->mesh->triangle, first = g->star.first[v];
    s->least = HUGE_VAL;
    for (int32_t c = first, n = 0; c >= 0 && (c != first || n == 0); n++) {
        const int32_t at[2] = {dmk_next(c), dmk_previous(c)};
        for (int k = 0; k < 2; k++) {
            if (s->crossed[at[1 - k]] || !s->known[of[at[k]]]) continue;
            if (from_nearer && g->distance[of[at[k]]] >= g->distance[v]) continue;
            if (reaches(s, at[k], v)) return true;
        }
        c = dmk_star_next(&g->star, c);
    }
    if (s->least < HUGE_VAL) s->turn[v] = s->to;
    return s->least < HUGE_VAL;
}

/* By distance; those around the source are known. */
static int begin(dmk_context *ctx, sides *s, dmk_keyed *order)
{
    const dmk_geodesics *g = s->g;
    const dmk_site *site = g->source;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        const float distance = (float)(g->distance[v] / g->star.unit);
        order[v] = (dmk_keyed){dmk_float_key(distance), v};
        s->turn[v] = 0;
    }
    for (int32_t i = 0; i < site->n_sectors; i++) {
        s->known[g->mesh->triangle[dmk_next(site->sector[i].half)]] = true;
        s->known[g->mesh->triangle[dmk_previous(site->sector[i].half)]] = true;
    }
    if (site->vertex >= 0) s->known[site->vertex] = true;
    return dmk_sort_keyed(ctx, order, (size_t)g->mesh->n_vertices);
}

int dmk_cut_sides(dmk_context *ctx, const dmk_geodesics *g, const bool *crossed, double *turn)
{
    int rc;
    const size_t n_vertices = (size_t)g->mesh->n_vertices;
    dmk_keyed *order = NULL;
    sides s = {.g = g, .crossed = crossed, .turn = turn};
    DMK_TRY(DMK_NEW(ctx, order, n_vertices));
    DMK_TRY(DMK_NEW(ctx, s.known, n_vertices));
    DMK_TRY(begin(ctx, &s, order));
    /* first from nearer neighbours; those without any then from all, until none is left that has some */
    for (int32_t n = g->mesh->n_vertices, before = INT32_MAX; n > 0 && n < before;) {
        const bool from_nearer = before == INT32_MAX;
        int32_t left = 0;
        DMK_TRY(dmk_poll(ctx));
        for (int32_t i = 0; i < n; i++) {
            const int32_t v = order[i].item;
            if (!s.known[v]) s.known[v] = set_turn(&s, v, from_nearer);
            if (!s.known[v]) order[left++].item = v;
        }
        before = n;
        n = left;
    }
done:
    free(order);
    free(s.known);
    return rc;
}
