/* Sources: points and their charts, see dmk_site; and lines. */
#include "geodesic/geodesic.h"

#include "base/sort.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A weight below this puts the source on the edge or vertex itself; it moves by so much of an edge. */
static const double on_edge = 1e-12;
/* So near to a vertex, over the mesh's extent, the source is that vertex: of its directions rounding leaves nothing. */
static const double at_corner = 1e-15;

static double side(const dmk_mesh *m, const dmk_star *s, int32_t h)
{
    return m->length[m->triangle_edge[h]] / s->unit;
}

/* Append the sector of half-edge h of the triangle, seen from the point with weights w in it. */
static void add_sector(const dmk_mesh *m, const dmk_star *s, int32_t h, const double w[3],
                       dmk_site *p)
{
    double length = side(m, s, h), left = side(m, s, dmk_previous(h));
    double angle = s->corner_angle[dmk_next(h)];
    double x = w[h % 3] * left * cos(angle) + w[dmk_previous(h) % 3] * length;
    double y = w[h % 3] * left * sin(angle);
    double span = w[h % 3] == 1 ? s->corner_angle[h] : atan2(y * length, x * (x - length) + y * y);
    p->sector[p->n_sectors++] = (dmk_sector){x * s->unit, y * s->unit, p->total, span, h};
    p->total += span;
}

static int at_vertex(dmk_context *ctx, const dmk_mesh *m, const dmk_star *s, dmk_site *p)
{
    int32_t n = 0, c = s->first[p->vertex];
    p->on_border = s->border[p->vertex];
    for (int32_t i = c; i >= 0 && (n == 0 || i != c); i = dmk_star_next(s, i)) n++;
    int rc = DMK_NEW(ctx, p->sector, (size_t)n);
    if (rc != DMK_OK) return rc;
    for (; n > 0; n--, c = dmk_star_next(s, c)) {
        const double w[3] = {c % 3 == 0, c % 3 == 1, c % 3 == 2};
        add_sector(m, s, c, w, p);
    }
    return DMK_OK;
}

/* On half-edge h of the point's triangle: the other two sides, then those of the triangle across.
 */
static int at_edge(dmk_context *ctx, const dmk_mesh *m, const dmk_star *s, int32_t h, dmk_site *p)
{
    int rc = DMK_NEW(ctx, p->sector, 4);
    if (rc != DMK_OK) return rc;
    int32_t o = s->twin[h];
    double w[3] = {0}, a = p->point.weight[dmk_next(h) % 3],
           b = p->point.weight[dmk_previous(h) % 3];
    w[dmk_next(h) % 3] = a / (a + b);
    w[dmk_previous(h) % 3] = b / (a + b);
    for (int k = 0; k < 3; k++) p->point.weight[k] = w[k]; /* just on the edge */
    add_sector(m, s, dmk_next(h), w, p);                   /* from corner k+2 to corner k */
    add_sector(m, s, dmk_previous(h), w, p);
    p->on_border = o < 0;
    if (o < 0) return DMK_OK;
    double across[3] = {0};
    across[dmk_next(o) % 3] = b / (a + b);
    across[dmk_previous(o) % 3] = a / (a + b);
    add_sector(m, s, dmk_next(o), across, p);
    add_sector(m, s, dmk_previous(o), across, p);
    return DMK_OK;
}

/* Inside a triangle: from corner 0 the sides opposite corners 2, 0 and 1. */
static int inside(dmk_context *ctx, const dmk_mesh *m, const dmk_star *s, dmk_site *p)
{
    int rc = DMK_NEW(ctx, p->sector, 3);
    if (rc != DMK_OK) return rc;
    for (int i = 0; i < 3; i++) {
        add_sector(m, s, (int32_t)(3 * p->point.triangle + (i + 2) % 3), p->point.weight, p);
    }
    return DMK_OK;
}

/* How far the point is from that corner of its triangle, at most. */
static double to_corner(const dmk_mesh *m, const dmk_star *s, const dmk_point *point, int corner)
{
    const int32_t h = (int32_t)(3 * point->triangle) + corner, i = dmk_next(h), j = dmk_previous(h);
    return point->weight[i % 3] * side(m, s, j) + point->weight[j % 3] * side(m, s, i);
}

int dmk_site_create(dmk_context *ctx, const dmk_mesh *m, const dmk_star *s, const dmk_point *point,
                    double offset, dmk_site *p)
{
    int big = 0, small = 0, n_small = 0;
    double xyz[3];
    int rc = dmk_mesh_point_xyz(ctx, m, point, xyz);
    if (rc != DMK_OK) return rc;
    for (int k = 0; k < 3; k++) {
        if (point->weight[k] > point->weight[big]) big = k;
        if (point->weight[k] < on_edge) n_small++, small = k;
    }
    *p = (dmk_site){.point = *point, .offset = offset, .vertex = -1};
    int32_t base = (int32_t)(3 * point->triangle);
    if (n_small == 2 || to_corner(m, s, point, big) < at_corner) {
        p->vertex = m->triangle[base + big];
        return at_vertex(ctx, m, s, p);
    }
    return n_small == 1 ? at_edge(ctx, m, s, base + small, p) : inside(ctx, m, s, p);
}

void dmk_site_free(dmk_site *p)
{
    free(p->sector);
    memset(p, 0, sizeof *p);
}

void dmk_lines_sort(dmk_geodesics *g)
{
    const size_t n = g->n_lines;
    dmk_sort((int32_t)n, g->line);
    g->n_lines = 0;
    for (size_t i = 0; i < n; i++)
        if (i == 0 || g->line[i] > g->line[i - 1]) g->line[g->n_lines++] = g->line[i];
}

bool dmk_lines_have(const dmk_geodesics *g, int32_t h)
{
    return dmk_sorted_has((int32_t)g->n_lines, g->line, h);
}

bool dmk_is_source(const dmk_geodesics *g, int32_t v)
{
    const dmk_arrival *a = g->arrival + v;
    if (a->pseudo_source >= 0 || a->source < 0) return false; /* < 0: of another component */
    if (a->source >= g->n_sources) return g->distance[v] == 0;
    return g->source[a->source].vertex == v;
}

double dmk_turn_around(const dmk_geodesics *g, int32_t source)
{
    const dmk_site *s = &g->source[source];
    return s->on_border ? HUGE_VAL : s->total;
}

double dmk_scale_around(const dmk_geodesics *g, int32_t source)
{
    const double full = dmk_turn_around(g, source);
    return full < HUGE_VAL ? 2 * M_PI / full : 1;
}

double dmk_turn_scale(const dmk_geodesics *g)
{
    return g->n_sources == 1 ? dmk_scale_around(g, 0) : 1;
}

double dmk_turn_between(double full, double a, double b)
{
    return full < HUGE_VAL ? remainder(b - a, full) : b - a;
}
