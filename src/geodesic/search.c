/* Windows from a point back to the sources. What leads farther than some way found is dropped, by the least that the
 * distances at the ends of an edge and at the corner behind it leave for its points; so few triangles beside the path
 * are looked at. */
#include "geodesic/search.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* On smooth meshes a search keeps some ten windows for each edge that the path crosses. */
enum { most_windows = 1 << 22 };
/* In units: lengths that are equal. */
static const double same_length = 1e-11;

/* ---- set-up ---------------------------------------------------------------------------------- */

static int by_triangle(const void *a, const void *b)
{
    const source_point *p = a, *q = b;
    if (p->triangle != q->triangle) return p->triangle < q->triangle ? -1 : 1;
    return (p->source > q->source) - (p->source < q->source);
}

size_t dmk_site_points(const dmk_geodesics *g, const dmk_site *site, int32_t number,
                       source_point *to)
{
    size_t n = 0;
    if (site->vertex >= 0) {
        for (int32_t k = 0; k < site->n_sectors; k++) {
            int32_t c = site->sector[k].half;
            to[n] = (source_point){c / 3, number, {0}};
            to[n++].weight[c % 3] = 1;
        }
        return n;
    }
    const dmk_point *p = &site->point;
    to[n] =
        (source_point){(int32_t)p->triangle, number, {p->weight[0], p->weight[1], p->weight[2]}};
    n++;
    int32_t other = site->sector[site->n_sectors - 1].half;
    if (other / 3 == p->triangle) return n;
    /* The last sector lies before the edge in the triangle across. */
    int32_t edge = dmk_next(other), own = g->star.twin[edge];
    to[n] = (source_point){edge / 3, number, {0}};
    to[n].weight[dmk_next(edge) % 3] = p->weight[dmk_previous(own) % 3];
    to[n++].weight[dmk_previous(edge) % 3] = p->weight[dmk_next(own) % 3];
    return n;
}

int dmk_tracer_create(dmk_context *ctx, const dmk_geodesics *g, dmk_tracer **tracer)
{
    int rc;
    dmk_tracer *t = NULL;
    DMK_TRY(DMK_NEW(ctx, t, 1));
    t->g = g;
    t->vertex = t->own[0] = t->own[1] = -1;
    t->slack = -same_length;
    t->most = most_windows;
    DMK_TRY(DMK_NEW(ctx, t->point, 2 * (size_t)g->n_sources));
    for (int32_t i = 0; i < g->n_sources; i++) {
        if (g->source[i].vertex < 0)
            t->n_points += dmk_site_points(g, g->source + i, i, t->point + t->n_points);
    }
    qsort(t->point, t->n_points, sizeof *t->point, by_triangle);
    *tracer = t;
    t = NULL;
done:
    dmk_tracer_destroy(&t);
    return rc;
}

void dmk_tracer_destroy(dmk_tracer **tracer)
{
    dmk_tracer *t = *tracer;
    if (!t) return;
    free(t->point);
    free(t->sight);
    free(t);
    *tracer = NULL;
}

/* ---- the search ------------------------------------------------------------------------------ */

/* Whether the path may end here: a source or a pseudo-source. */
static bool is_bend(const dmk_geodesics *g, int32_t v)
{
    const dmk_arrival *a = g->arrival + v;
    if (dmk_front_bends(&g->star, v)) return true;
    return a->source >= 0 && a->source < g->n_sources && g->source[a->source].vertex == v;
}

static void finish_at(dmk_tracer *t, finish f, double length)
{
    const dmk_geodesics *g = t->g;
    f.length = f.key = length;
    if (f.vertex >= 0 && !is_bend(g, f.vertex))
        f.key += same_length + dmk_search_doubt(g, f.vertex); /* others are better to end at */
    else
        t->least =
            dmk_min(t->least, f.vertex >= 0 ? length - dmk_search_doubt(g, f.vertex) : length);
    if (f.key < t->best.key) t->best = f;
    t->bound = dmk_min(t->bound, f.key);
}

void dmk_angle_above(const dmk_geodesics *g, int32_t h, angle *s)
{
    const dmk_mesh *m = g->mesh;
    const double scale = 1 / g->star.unit;
    int k = h % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    double area2, dot[3], length[3];
    const int32_t *v = m->triangle + h / 3 * 3;
    dmk_measure_corners(m, scale, h / 3, &area2, dot);
    for (int i = 0; i < 3; i++) length[i] = m->length[m->triangle_edge[h / 3 * 3 + i]] * scale;
    s->length = length[k], s->left = length[k2], s->right = length[k1];
    s->ca = dot[k1] / (s->length * s->left), s->sa = area2 / (s->length * s->left);
    s->cb = dot[k2] / (s->length * s->right), s->sb = area2 / (s->length * s->right);
    s->cx = s->left * s->ca, s->cy = s->left * s->sa;
    s->a = v[k1], s->b = v[k2], s->c = v[k];
}

void dmk_place_above(int32_t h, const angle *s, const double weight[3], double *x, double *y)
{
    *x = weight[h % 3] * s->cx + weight[dmk_previous(h) % 3] * s->length;
    *y = weight[h % 3] * s->cy;
}

/* A corner of the triangle before the interval, in the frame of the half-edge, y < 0; vertex -1: none. */
typedef struct behind {
    double x, y;
    int32_t vertex;
} behind;

/* The least length of a way through the interval, from what distances can be at its points X, as they change by no
 * more than the way. From both ends of the half-edge that bound falls towards one place and grows behind it, and by
 * more than |X - (x, y)| changes: that place, or the end nearest to it, has the least. Where a source may lie on the
 * half-edge itself the bound is 0 for a stretch, of which the nearest point to (x, y) has. From the corner behind,
 * |X - (x, y)| - |X - corner| grows towards the ray through that corner and falls behind it: one of the ends has. */
static double least(const dmk_geodesics *g, const sight *w, const behind *c)
{
    const dmk_mesh *m = g->mesh;
    const double unit = g->star.unit, *d = g->distance;
    const double length = m->length[m->triangle_edge[w->half]] / unit;
    const int32_t first_end = m->triangle[dmk_next(w->half)],
                  last_end = m->triangle[dmk_previous(w->half)];
    double a = d[first_end] / unit - dmk_search_doubt(g, first_end),
           b = d[last_end] / unit - dmk_search_doubt(g, last_end);
    const double least_at =
        a + b < length ? dmk_min(length - b, dmk_max(a, w->x)) : 0.5 * (a - b + length);
    double at = dmk_min(w->hi, dmk_max(w->lo, least_at)), x = at - w->x;
    double way = sqrt(x * x + w->y * w->y) + dmk_max(0, dmk_max(a - at, b - length + at));
    if (c->vertex < 0) return way;
    double first = sqrt((w->lo - w->x) * (w->lo - w->x) + w->y * w->y) -
                   sqrt((w->lo - c->x) * (w->lo - c->x) + c->y * c->y);
    double last = sqrt((w->hi - w->x) * (w->hi - w->x) + w->y * w->y) -
                  sqrt((w->hi - c->x) * (w->hi - c->x) + c->y * c->y);
    return dmk_max(way,
                   d[c->vertex] / unit - dmk_search_doubt(g, c->vertex) + dmk_min(first, last));
}

/* No shortest way enters a triangle twice. Around a tip of 1e-6 radians they would turn three million times to come
 * away from a point beside it. */
static bool comes_back(const dmk_tracer *t, int32_t triangle)
{
    const int32_t *v = t->g->mesh->triangle + 3 * (size_t)triangle;
    if (t->vertex < 0) return triangle == t->own[0] || triangle == t->own[1];
    return v[0] == t->vertex || v[1] == t->vertex || v[2] == t->vertex;
}

static int keep(dmk_context *ctx, dmk_tracer *t, sight *w, const behind *c)
{
    if (w->half < 0 || !(w->y < 0) || !(w->hi - w->lo > 1e-12 * (fabs(w->hi) + fabs(w->lo))))
        return DMK_OK;
    if (comes_back(t, w->half / 3)) return DMK_OK;
    w->least = least(t->g, w, c);
    if (w->least > t->bound - t->slack) return DMK_OK;
    if (t->n_sights >= t->most) {
        t->lost = dmk_min(t->lost, w->least);
        return DMK_OK;
    }
    if (t->n_sights == t->room) {
        int rc = DMK_GROW(ctx, t->sight, t->n_sights + 1, t->room);
        if (rc != DMK_OK) return rc;
    }
    t->sight[t->n_sights++] = *w;
    return DMK_OK;
}

/* Through a side: along it the direction (dx, dy) from (ox, oy); rays from lo to hi of the base. */
static sight child(const sight *w, int32_t i, bool right, double lo, double hi, const angle *s)
{
    double ox = right ? s->cx : 0, oy = right ? s->cy : 0, length = right ? s->right : s->left;
    double dx = right ? s->cb : s->ca, dy = right ? -s->sb : s->sa, px = w->x - ox, py = w->y - oy;
    double end[2] = {lo, hi};
    for (int k = 0; k < 2; k++) {
        double rx = end[k] - w->x, ry = -w->y;
        end[k] = dmk_min(length, dmk_max(0, (px * ry - py * rx) / (dx * ry - dy * rx)));
    }
    return (sight){.lo = end[0],
                   .hi = end[1],
                   .x = px * dx + py * dy,
                   .y = py * dx - px * dy,
                   .parent = i,
                   .right = right};
}

size_t dmk_first_point(const dmk_tracer *t, int32_t triangle)
{
    size_t lo = 0, hi = t->n_points;
    while (lo < hi) {
        size_t middle = (lo + hi) / 2;
        if (t->point[middle].triangle < triangle)
            lo = middle + 1;
        else
            hi = middle;
    }
    return lo;
}

/* Sources inside the triangle above window i. */
static void look_for_sources(dmk_tracer *t, int32_t i, const angle *s)
{
    const dmk_geodesics *g = t->g;
    const sight *w = t->sight + i;
    size_t lo = dmk_first_point(t, w->half / 3);
    for (; lo < t->n_points && t->point[lo].triangle == w->half / 3; lo++) {
        const double *p = t->point[lo].weight;
        double x, y;
        if (p[w->half % 3] == 0) continue; /* on the edge: seen from the triangle before */
        dmk_place_above(w->half, s, p, &x, &y);
        double at = w->x - (x - w->x) * w->y / (y - w->y);
        if (at < w->lo - DMK_SAME_PLACE * s->length || at > w->hi + DMK_SAME_PLACE * s->length)
            continue;
        double length =
            hypot(x - w->x, y - w->y) + g->source[t->point[lo].source].offset / g->star.unit;
        finish_at(t, (finish){.window = i, .vertex = -1, .source = t->point[lo].source}, length);
    }
}

/* The foot on half-edge h, if that is a line: a side of the last triangle that is entered, the one above window i or,
 * if that is -1, the point's own. w: its rays, as the triangle behind the half-edge sees them. */
static void look_for_foot(dmk_tracer *t, const sight *w, int32_t h, int32_t i)
{
    const dmk_mesh *m = t->g->mesh;
    if (!dmk_lines_have(t->g, h) || !(w->x >= w->lo && w->x <= w->hi)) return;
    const double part = w->x * t->g->star.unit / m->length[m->triangle_edge[h]];
    finish f = {.window = i, .vertex = -1, .source = t->g->n_sources, .triangle = h / 3};
    f.foot.triangle = h / 3;
    f.foot.weight[dmk_previous(h) % 3] = 1 - dmk_min(part, 1);
    f.foot.weight[dmk_next(h) % 3] = dmk_min(part, 1);
    finish_at(t, f, -w->y);
}

static int advance(dmk_context *ctx, dmk_tracer *t, int32_t i)
{
    int rc;
    angle s;
    const sight w = t->sight[i];
    const dmk_geodesics *g = t->g;
    if (w.least > t->bound - t->slack) return DMK_OK;
    dmk_angle_above(g, w.half, &s);
    if (t->n_points > 0) look_for_sources(t, i, &s);
    double at = w.x - (s.cx - w.x) * w.y / (s.cy - w.y), slack = DMK_SAME_PLACE * s.length;
    if (at >= w.lo - slack && at <= w.hi + slack) {
        double length = hypot(s.cx - w.x, s.cy - w.y) + g->distance[s.c] / g->star.unit;
        finish_at(t, (finish){.window = i, .vertex = s.c, .source = -1}, length);
    }
    sight l = child(&w, i, false, w.lo, dmk_min(w.hi, at), &s),
          r = child(&w, i, true, dmk_max(w.lo, at), w.hi, &s);
    l.half = w.lo < at ? g->star.twin[dmk_previous(w.half)] : -1;
    r.half = w.hi > at ? g->star.twin[dmk_next(w.half)] : -1;
    if (w.hi >= at) l.hi = s.left; /* not by rounding */
    if (w.lo <= at) r.lo = 0;
    if (w.lo < at) look_for_foot(t, &l, dmk_previous(w.half), i);
    if (w.hi > at) look_for_foot(t, &r, dmk_next(w.half), i);
    DMK_TRY(keep(ctx, t, &l, &(behind){s.length * s.ca, -s.length * s.sa, s.b}));
    DMK_TRY(keep(ctx, t, &r, &(behind){s.right - s.length * s.cb, -s.length * s.sb, s.a}));
done:
    return rc;
}

/* Ways within the point's own triangles: to their corners, and to sources there. */
static void look_around(dmk_tracer *t, const dmk_site *site, const source_point *own)
{
    const dmk_geodesics *g = t->g;
    angle s;
    dmk_angle_above(g, 3 * own->triangle, &s);
    const double at[3][2] = {{s.cx, s.cy}, {0, 0}, {s.length, 0}}, unit = g->star.unit;
    double x = 0, y = 0;
    for (int k = 0; k < 3; k++) x += own->weight[k] * at[k][0], y += own->weight[k] * at[k][1];
    for (int k = 0; k < 3; k++) {
        int32_t v = g->mesh->triangle[3 * own->triangle + k];
        if (v == site->vertex) continue;
        finish_at(t, (finish){.window = -1, .vertex = v, .source = -1, .triangle = own->triangle},
                  hypot(at[k][0] - x, at[k][1] - y) + g->distance[v] / unit);
    }
    for (int k = 0; k < 3 && site->vertex < 0; k++) { /* on a line itself */
        if (own->weight[k] != 0 || !dmk_lines_have(g, 3 * own->triangle + k)) continue;
        finish f = {.window = -1, .vertex = -1, .source = g->n_sources, .triangle = own->triangle};
        f.foot.triangle = own->triangle;
        memcpy(f.foot.weight, own->weight, sizeof f.foot.weight);
        finish_at(t, f, 0);
    }
    for (size_t i = dmk_first_point(t, own->triangle); i < t->n_points; i++) {
        const source_point *p = t->point + i;
        if (p->triangle != own->triangle) break;
        double px = 0, py = 0;
        for (int k = 0; k < 3; k++) px += p->weight[k] * at[k][0], py += p->weight[k] * at[k][1];
        finish_at(
            t, (finish){.window = -1, .vertex = -1, .source = p->source, .triangle = p->triangle},
            hypot(px - x, py - y) + g->source[p->source].offset / unit);
    }
}

int dmk_search_best(dmk_context *ctx, dmk_tracer *t, const dmk_site *site)
{
    int rc;
    const dmk_geodesics *g = t->g;
    const double unit = g->star.unit;
    source_point *own = NULL;
    t->best =
        (finish){.length = INFINITY, .key = INFINITY, .window = -1, .vertex = -1, .source = -1};
    t->bound = t->lost = t->least = INFINITY;
    if (site->vertex >= 0)
        t->bound =
            g->distance[site->vertex] / unit + same_length + dmk_search_doubt(g, site->vertex);
    DMK_TRY(DMK_NEW(ctx, own, (size_t)site->n_sectors + 2));
    size_t n = dmk_site_points(g, site, 0, own);
    t->vertex = site->vertex;
    t->own[0] = own[0].triangle;
    t->own[1] = n > 1 ? own[1].triangle : -1;
    for (size_t i = 0; i < n; i++) look_around(t, site, own + i);
    t->n_sights = 0;
    for (int32_t k = 0; k < site->n_sectors; k++) {
        const dmk_sector *c = site->sector + k;
        const double length = g->mesh->length[g->mesh->triangle_edge[c->half]] / unit;
        sight w = {.hi = length,
                   .x = length - c->x / unit,
                   .y = -c->y / unit,
                   .half = g->star.twin[c->half],
                   .parent = -1};
        look_for_foot(t, &w, c->half, -1);
        DMK_TRY(keep(ctx, t, &w, &(behind){.vertex = -1}));
    }
    for (size_t i = 0; i < t->n_sights; i++) DMK_TRY(advance(ctx, t, (int32_t)i));
    if (t->best.key == INFINITY) {
        const bool vertex = site->vertex >= 0;
        rc = dmk_fail(ctx, DMK_E_ARG,
                      "the end of the path %s %lld is not on the component of a source: no path "
                      "leads there",
                      vertex ? "at vertex" : "in triangle",
                      (long long)(vertex ? site->vertex : site->point.triangle));
    }
done:
    free(own);
    return rc;
}

int dmk_search(dmk_context *ctx, dmk_tracer *t, const dmk_site *site)
{
    const int rc = dmk_search_best(ctx, t, site);
    if (rc != DMK_OK || !dmk_search_lost(t)) return rc;
    const bool vertex = site->vertex >= 0;
    return dmk_fail(ctx, DMK_E_MESH,
                    "more than %zu ways lead away from %s %lld, any of which may be the shortest: "
                    "the mesh has needles or tubes that they wind around; improve its worst "
                    "triangles",
                    t->most, vertex ? "vertex" : "triangle",
                    (long long)(vertex ? site->vertex : site->point.triangle));
}
