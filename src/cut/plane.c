/* The disk in the plane: distance times direction at the source. On a polyhedron directions are not those of the
 * surface that it stands for: behind a saddle vertex all paths start in one direction, and near a conjugate point
 * they jump. So triangles turn over, or are flat, in the plane; around these, directions are averaged. */
#include "cut/cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double turn = 2 * M_PI;

typedef struct disk {
    const dmk_mesh *cut;
    double *plane;           /* 2 for each vertex */
    double *direction, *sum; /* vertices; sum: of how far the neighbours are off */
    int32_t *neighbours;     /* vertices: with a direction; counted where `moves` */
    bool *turned, *moves;    /* vertices: of a triangle that is turned over; what moves with it */
} disk;

static bool is_source(const disk *d, int32_t v)
{
    return d->plane[2 * v] == 0 && d->plane[2 * v + 1] == 0;
}

size_t dmk_plane_flipped(const dmk_mesh *cut, const double *plane, bool *turned)
{
    size_t n = 0;
    for (int32_t t = 0; t < cut->n_triangles; t++) {
        const int32_t *v = cut->triangle + 3 * (size_t)t;
        const double *a = plane + 2 * (size_t)v[0], *b = plane + 2 * (size_t)v[1],
                     *c = plane + 2 * (size_t)v[2];
        if ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0) continue;
        n++;
        for (int k = 0; turned && k < 3; k++) turned[v[k]] = true;
    }
    return n;
}

static void add_turn(disk *d, int32_t v, int32_t w)
{
    if (!d->moves[v] || is_source(d, w)) return;
    d->sum[v] += dmk_turn_between(turn, d->direction[v], d->direction[w]);
    d->neighbours[v]++;
}

/* Neighbours of what moves move, too. */
static void widen(disk *d)
{
    const dmk_mesh *m = d->cut;
    for (int32_t e = 0; e < m->n_edges; e++) {
        const int32_t a = m->edge_vertex[2 * e], b = m->edge_vertex[2 * e + 1];
        if (d->turned[a]) d->moves[b] = true;
        if (d->turned[b]) d->moves[a] = true;
    }
    memcpy(d->turned, d->moves, (size_t)m->n_vertices * sizeof *d->moves);
}

/* The mean of the own direction and the neighbours', for the vertices of turned triangles and some rings around. */
static void average(disk *d, int rings)
{
    const dmk_mesh *m = d->cut;
    for (int32_t v = 0; v < m->n_vertices; v++) {
        d->moves[v] = d->turned[v] = d->turned[v] && !is_source(d, v);
        d->sum[v] = 0;
        d->neighbours[v] = 0;
    }
    for (int r = 0; r < rings; r++) widen(d);
    for (int32_t e = 0; e < m->n_edges; e++) {
        add_turn(d, m->edge_vertex[2 * e], m->edge_vertex[2 * e + 1]);
        add_turn(d, m->edge_vertex[2 * e + 1], m->edge_vertex[2 * e]);
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        if (!d->moves[v] || is_source(d, v)) continue;
        const double distance = hypot(d->plane[2 * v], d->plane[2 * v + 1]);
        d->direction[v] += d->sum[v] / (d->neighbours[v] + 1);
        d->plane[2 * v] = distance * cos(d->direction[v]);
        d->plane[2 * v + 1] = distance * sin(d->direction[v]);
    }
}

int dmk_plane_unfold(dmk_context *ctx, const dmk_mesh *cut, double *plane)
{
    int rc;
    const size_t n = (size_t)cut->n_vertices, bytes = 2 * n * sizeof *plane;
    disk d = {.cut = cut};
    DMK_TRY(DMK_NEW(ctx, d.plane, 2 * n));
    DMK_TRY(DMK_NEW(ctx, d.direction, n));
    DMK_TRY(DMK_NEW(ctx, d.sum, n));
    DMK_TRY(DMK_NEW(ctx, d.neighbours, n));
    DMK_TRY(DMK_NEW(ctx, d.turned, n));
    DMK_TRY(DMK_NEW(ctx, d.moves, n));
    memcpy(d.plane, plane, bytes);
    for (size_t v = 0; v < n; v++) d.direction[v] = atan2(plane[2 * v + 1], plane[2 * v]);
    size_t least = dmk_plane_flipped(cut, plane, d.turned);
    int rings = 1; /* 2: once more, farther around, after a round in vain */
    while (least > 0 && rings <= 2) {
        DMK_TRY(dmk_poll(ctx));
        average(&d, rings);
        memset(d.turned, 0, n * sizeof *d.turned);
        const size_t left = dmk_plane_flipped(cut, d.plane, d.turned);
        rings = left < least ? 1 : rings + 1;
        if (left >= least) continue;
        least = left;
        memcpy(plane, d.plane, bytes);
    }
done:
    free(d.plane);
    free(d.direction);
    free(d.sum);
    free(d.neighbours);
    free(d.turned);
    free(d.moves);
    return rc;
}
