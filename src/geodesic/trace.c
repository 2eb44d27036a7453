/* Paths back to the sources, and distances anywhere: windows from the point asked for, back to the next pseudo-source
 * or source, whose distance is known. What leads farther than some way found is dropped, by the least that the
 * distances at the ends of an edge and at the corner behind it leave for its points; so few triangles beside the path
 * are looked at. */
#include "geodesic/trace.h"

#include "geodesic/front.h"

#include "base/parallel.h"
#include "base/vec3.h"

#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* On smooth meshes a search keeps some ten windows for each edge that the path crosses. */
enum { most_windows = 1 << 22 };

/* A source inside a triangle or on an edge, as one of its triangles sees it. */
typedef struct source_point {
    int32_t triangle, source;
    double weight[3];
} source_point;

/* An interval of a half-edge seen straight from the point, unfolded at (x, y), y < 0. */
typedef struct sight {
    double lo, hi, x, y;
    double least; /* length of a way through it */
    int32_t half, parent;
    bool right; /* through which side of the parent's triangle */
} sight;

/* How the best way ends: at a vertex, or else at a source that is none, at `foot` if that is a line; seen through a
 * window, or else within the point's own triangles, `triangle` then. */
typedef struct finish {
    double length, key;
    int32_t window, vertex, source, triangle;
    dmk_point foot; /* in the last triangle that the way enters */
} finish;

struct dmk_tracer {
    const dmk_geodesics *g;
    source_point *point; /* by triangle */
    size_t n_points;
    int32_t vertex; /* that is the point asked for, or -1 */
    int32_t own[2]; /* else the triangles that it lies in, or -1 */
    sight *sight;
    size_t n_sights, room, most; /* most: that are kept */
    finish best;
    double bound; /* nothing longer is of use */
    double slack; /* nor what is shorter than `bound` by less than this */
    double lost;  /* the least length of a way that there was no room for */
    double least; /* of the ways to a source or a bend, less what is in doubt there */
};

/* In units: lengths that are equal. */
static const double same_length = 1e-11;

/* ---- set-up ---------------------------------------------------------------------------------- */

static int by_triangle(const void *a, const void *b)
{
    const source_point *p = a, *q = b;
    if (p->triangle != q->triangle) return p->triangle < q->triangle ? -1 : 1;
    return (p->source > q->source) - (p->source < q->source);
}

/* The triangles that a site lies in and its weights there: at a vertex all around, two on an edge. */
static size_t list_points(const dmk_geodesics *g, const dmk_site *site, int32_t number,
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
            t->n_points += list_points(g, g->source + i, i, t->point + t->n_points);
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

/* What may be wrong with the distance at a vertex: merged windows estimate their errors. Not more than that, as paths
 * are looked for as wide as the root of it: of a million triangles, a vertex whose error is 1e-5 takes 200,000
 * windows. */
static inline double doubt(const dmk_geodesics *g, int32_t v)
{
    return g->error ? g->error[v] / g->star.unit : 0;
}

static void finish_at(dmk_tracer *t, finish f, double length)
{
    const dmk_geodesics *g = t->g;
    f.length = f.key = length;
    if (f.vertex >= 0 && !is_bend(g, f.vertex))
        f.key += same_length + doubt(g, f.vertex); /* others are better to end at */
    else
        t->least = dmk_min(t->least, f.vertex >= 0 ? length - doubt(g, f.vertex) : length);
    if (f.key < t->best.key) t->best = f;
    t->bound = dmk_min(t->bound, f.key);
}

/* The triangle above half-edge h, with its base on the x axis from (0, 0). */
typedef struct angle {
    double length, left, right, ca, sa, cb, sb, cx, cy;
    int32_t a, b, c;
} angle;

static void look(const dmk_geodesics *g, int32_t h, angle *s)
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

/* Weights of the triangle above half-edge h, in its frame. */
static void place_above(int32_t h, const angle *s, const double weight[3], double *x, double *y)
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
    double a = d[first_end] / unit - doubt(g, first_end),
           b = d[last_end] / unit - doubt(g, last_end);
    const double least_at =
        a + b < length ? dmk_min(length - b, dmk_max(a, w->x)) : 0.5 * (a - b + length);
    double at = dmk_min(w->hi, dmk_max(w->lo, least_at)), x = at - w->x;
    double way = sqrt(x * x + w->y * w->y) + dmk_max(0, dmk_max(a - at, b - length + at));
    if (c->vertex < 0) return way;
    double first = sqrt((w->lo - w->x) * (w->lo - w->x) + w->y * w->y) -
                   sqrt((w->lo - c->x) * (w->lo - c->x) + c->y * c->y);
    double last = sqrt((w->hi - w->x) * (w->hi - w->x) + w->y * w->y) -
                  sqrt((w->hi - c->x) * (w->hi - c->x) + c->y * c->y);
    return dmk_max(way, d[c->vertex] / unit - doubt(g, c->vertex) + dmk_min(first, last));
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

/* The first of the sources inside a triangle, if there are some. */
static size_t first_point(const dmk_tracer *t, int32_t triangle)
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
    size_t lo = first_point(t, w->half / 3);
    for (; lo < t->n_points && t->point[lo].triangle == w->half / 3; lo++) {
        const double *p = t->point[lo].weight;
        double x, y;
        if (p[w->half % 3] == 0) continue; /* on the edge: seen from the triangle before */
        place_above(w->half, s, p, &x, &y);
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
    look(g, w.half, &s);
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
    look(g, 3 * own->triangle, &s);
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
    for (size_t i = first_point(t, own->triangle); i < t->n_points; i++) {
        const source_point *p = t->point + i;
        if (p->triangle != own->triangle) break;
        double px = 0, py = 0;
        for (int k = 0; k < 3; k++) px += p->weight[k] * at[k][0], py += p->weight[k] * at[k][1];
        finish_at(
            t, (finish){.window = -1, .vertex = -1, .source = p->source, .triangle = p->triangle},
            hypot(px - x, py - y) + g->source[p->source].offset / unit);
    }
}

/* Whether a way that there was no room for may be shorter than the best one found. */
static bool has_lost(const dmk_tracer *t)
{
    return t->lost <= t->bound - t->slack;
}

/* The end of the first straight piece of the way back from the site, in t->best, as far as there is room for ways. */
static int look_for_best(dmk_context *ctx, dmk_tracer *t, const dmk_site *site)
{
    int rc;
    const dmk_geodesics *g = t->g;
    const double unit = g->star.unit;
    source_point *own = NULL;
    t->best =
        (finish){.length = INFINITY, .key = INFINITY, .window = -1, .vertex = -1, .source = -1};
    t->bound = t->lost = t->least = INFINITY;
    if (site->vertex >= 0)
        t->bound = g->distance[site->vertex] / unit + same_length + doubt(g, site->vertex);
    DMK_TRY(DMK_NEW(ctx, own, (size_t)site->n_sectors + 2));
    size_t n = list_points(g, site, 0, own);
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

/* The same, or none. */
static int search(dmk_context *ctx, dmk_tracer *t, const dmk_site *site)
{
    const int rc = look_for_best(ctx, t, site);
    if (rc != DMK_OK || !has_lost(t)) return rc;
    const bool vertex = site->vertex >= 0;
    return dmk_fail(ctx, DMK_E_MESH,
                    "more than %zu ways lead away from %s %lld, any of which may be the shortest: "
                    "the mesh has needles or tubes that they wind around; improve its worst "
                    "triangles",
                    t->most, vertex ? "vertex" : "triangle",
                    (long long)(vertex ? site->vertex : site->point.triangle));
}

/* ---- directions ------------------------------------------------------------------------------ */

/* What a path leads to, in the frame of a half-edge of the triangle in which it leaves; it may lie far behind it. */
typedef struct target {
    int32_t half;
    double x, y;
} target;

static target target_at(const dmk_geodesics *g, const dmk_point *p)
{
    target to = {.half = 3 * p->triangle};
    angle s;
    look(g, to.half, &s);
    place_above(to.half, &s, p->weight, &to.x, &to.y);
    return to;
}

/* In the frame of another half-edge of its triangle. */
static void seen_from(const dmk_geodesics *g, const target *to, int32_t half, double *x, double *y)
{
    angle s;
    *x = to->x, *y = to->y;
    if (half == to->half) return;
    look(g, to->half, &s);
    const bool is_next =
        half == dmk_next(to->half); /* from the end to the corner above, or from there */
    const double px = to->x - (is_next ? s.length : s.cx), py = to->y - (is_next ? 0 : s.cy);
    const double ex = is_next ? s.cx - s.length : -s.cx, ey = is_next ? s.cy : -s.cy;
    const double length = hypot(ex, ey);
    *x = (px * ex + py * ey) / length;
    *y = (py * ex - px * ey) / length;
}

/* The direction at a site of a path's target. */
static double direction_to(const dmk_geodesics *g, const dmk_site *site, const target *to)
{
    double best = INFINITY, angle_there = 0, x, y;
    for (int32_t k = 0; k < site->n_sectors; k++) {
        const dmk_sector *c = site->sector + k;
        if (c->half / 3 != to->half / 3) continue;
        seen_from(g, to, c->half, &x, &y);
        double ax = -c->x / g->star.unit, ay = -c->y / g->star.unit;
        double dx = x + ax, dy = y + ay, turn = atan2(ax * dy - ay * dx, ax * dx + ay * dy);
        double off = dmk_max(0, dmk_max(-turn, turn - c->span));
        if (off < best) best = off, angle_there = c->angle + dmk_min(dmk_max(turn, 0), c->span);
    }
    if (angle_there >= site->total && !site->on_border) return 0;
    return angle_there;
}

/* ---- paths ----------------------------------------------------------------------------------- */

typedef struct trail {
    dmk_context *ctx;
    const dmk_mesh *mesh;
    dmk_path *path;
    size_t room;
    double last[3], near; /* points so near are one */
} trail;

/* A path through a vertex meets several edges there: one point is enough. */
static int append(trail *l, dmk_point p)
{
    double x[3];
    dmk_path *path = l->path;
    int rc = dmk_mesh_point_xyz(l->ctx, l->mesh, &p, x);
    if (rc != DMK_OK) return rc;
    if (path->n > 0) {
        double piece = dmk_distance(x, l->last);
        path->length += piece;
        if (path->n > 1 && piece <= l->near) path->n--;
    }
    memcpy(l->last, x, sizeof x);
    if (path->n == l->room) {
        rc = DMK_GROW(l->ctx, path->point, path->n + 1, l->room);
        if (rc != DMK_OK) return rc;
    }
    path->point[path->n++] = p;
    return DMK_OK;
}

/* Where a straight way crosses the half-edges of windows i and before it, from (x, y) above the last: the
 * points from the far end to the point asked for, in the order of the list. */
static int list_crossings(dmk_tracer *t, dmk_context *ctx, int32_t i, double x, double y,
                          dmk_point **list, size_t *n)
{
    size_t room = 0;
    int rc = DMK_OK;
    for (*n = 0; i >= 0; i = t->sight[i].parent) {
        const sight *w = t->sight + i;
        angle s;
        look(t->g, w->half, &s);
        double at = dmk_min(s.length, dmk_max(0, w->x - (x - w->x) * w->y / (y - w->y)));
        dmk_point p = {.triangle = w->half / 3};
        p.weight[dmk_next(w->half) % 3] = 1 - at / s.length;
        p.weight[dmk_previous(w->half) % 3] = at / s.length;
        if (*n == room) DMK_TRY(DMK_GROW(ctx, *list, *n + 1, room));
        (*list)[(*n)++] = p;
        if (w->parent < 0) break;
        look(t->g, t->sight[w->parent].half, &s);
        double part = w->right ? 1 - at / s.right : at / s.left; /* from the base */
        x = w->right ? s.length + part * (s.cx - s.length) : part * s.cx;
        y = part * s.cy;
    }
done:
    return rc;
}

/* The far end of the piece above window i: a vertex, a source inside, or the foot on a line. */
static void end_of_sight(const dmk_tracer *t, int32_t i, double *x, double *y)
{
    const dmk_geodesics *g = t->g;
    const finish *f = &t->best;
    const sight *w = t->sight + i;
    angle s;
    look(g, w->half, &s);
    *x = s.cx, *y = s.cy;
    if (f->vertex >= 0) return;
    if (f->source >= g->n_sources) place_above(w->half, &s, f->foot.weight, x, y);
    for (size_t k = first_point(t, w->half / 3); f->source < g->n_sources && k < t->n_points; k++) {
        const source_point *p = t->point + k;
        if (p->triangle != w->half / 3) break;
        if (p->source == f->source) place_above(w->half, &s, p->weight, x, y);
    }
}

static dmk_point corner_point(const dmk_geodesics *g, int32_t v)
{
    int32_t c = g->star.first[v];
    dmk_point p = {.triangle = c / 3};
    p.weight[c % 3] = 1;
    return p;
}

/* A site as a point of one of the triangles that it lies in. */
static dmk_point seen_in(const dmk_geodesics *g, const dmk_site *at, int32_t triangle)
{
    dmk_point p = at->point;
    source_point own[2];
    if (at->vertex < 0 && p.triangle == triangle) return p;
    if (at->vertex < 0 && list_points(g, at, 0, own) == 2) {
        p = (dmk_point){triangle, {own[1].weight[0], own[1].weight[1], own[1].weight[2]}};
    }
    for (int32_t k = 0; at->vertex >= 0 && k < at->n_sectors; k++) {
        if (at->sector[k].half / 3 != triangle) continue;
        p = (dmk_point){triangle, {0}};
        p.weight[at->sector[k].half % 3] = 1;
    }
    return p;
}

/* The inner points of the piece that the last search found from `at`; *back: `at` itself, seen from the far end. */
static int append_piece(dmk_context *ctx, dmk_tracer *t, const dmk_site *at, trail *l, target *back)
{
    int rc = DMK_OK;
    size_t n = 0;
    double x, y;
    dmk_point *list = NULL;
    const finish *f = &t->best;
    if (f->window < 0) {
        const dmk_point here = seen_in(t->g, at, f->triangle);
        *back = target_at(t->g, &here);
        return DMK_OK;
    }
    end_of_sight(t, f->window, &x, &y);
    DMK_TRY(list_crossings(t, ctx, f->window, x, y, &list, &n));
    for (size_t i = n; i-- > 0;) DMK_TRY(append(l, list[i]));
    const sight *w = t->sight + f->window;
    *back = (target){w->half, w->x, w->y};
done:
    free(list);
    return rc;
}

/* From the point asked for to the source, one piece after the other; the first piece's end at the source is in
 * *direction. */
static int follow(dmk_context *ctx, dmk_tracer *t, const dmk_site *from, trail *l,
                  double *direction)
{
    int rc;
    const dmk_geodesics *g = t->g;
    const dmk_site *at = from;
    dmk_site stop = {0};
    target back = {0};
    *direction = 0;
    DMK_TRY(append(l, from->point));
    while (!(at->vertex >= 0 && dmk_is_source(g, at->vertex))) {
        DMK_TRY(search(ctx, t, at));
        const finish f = t->best;
        DMK_TRY(append_piece(ctx, t, at, l, &back));
        int32_t source = f.source;
        dmk_point end = f.vertex >= 0           ? corner_point(g, f.vertex)
                        : source < g->n_sources ? g->source[source].point
                                                : f.foot;
        DMK_TRY(append(l, end));
        if (f.vertex >= 0 && dmk_is_source(g, f.vertex)) source = g->arrival[f.vertex].source;
        if (source >= 0) {
            if (source < g->n_sources) *direction = direction_to(g, g->source + source, &back);
            break;
        }
        dmk_site_free(&stop);
        DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, &end, 0, &stop));
        at = &stop;
    }
done:
    dmk_site_free(&stop);
    return rc;
}

int dmk_tracer_path(dmk_context *ctx, dmk_tracer *t, const dmk_point *to, dmk_path *path)
{
    int rc;
    dmk_site site = {0};
    trail l = {.ctx = ctx, .mesh = t->g->mesh, .path = path, .near = 1e-12 * t->g->star.unit};
    memset(path, 0, sizeof *path);
    DMK_TRY(dmk_site_create(ctx, t->g->mesh, &t->g->star, to, 0, &site));
    DMK_TRY(follow(ctx, t, &site, &l, &path->angle));
    if (path->n == 1) DMK_TRY(append(&l, *to));
    for (size_t i = 0; i < path->n / 2; i++) {
        dmk_point p = path->point[i];
        path->point[i] = path->point[path->n - 1 - i];
        path->point[path->n - 1 - i] = p;
    }
    path->point[path->n - 1] = *to;
done:
    dmk_site_free(&site);
    if (rc != DMK_OK) dmk_path_free(path);
    return rc;
}

int dmk_tracer_paths(dmk_context *ctx, const dmk_geodesics *g, size_t n, const dmk_point *to,
                     dmk_path *paths)
{
    int rc;
    dmk_tracer *t = NULL;
    DMK_TRY(dmk_tracer_create(ctx, g, &t));
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_tracer_path(ctx, t, to + i, paths + i));
        DMK_TRY(dmk_poll(ctx));
    }
done:
    for (size_t i = 0; rc != DMK_OK && i < n; i++) dmk_path_free(paths + i);
    dmk_tracer_destroy(&t);
    return rc;
}

void dmk_path_free(dmk_path *path)
{
    if (!path) return;
    free(path->point);
    memset(path, 0, sizeof *path);
}

int dmk_tracer_distance(dmk_context *ctx, dmk_tracer *t, const dmk_point *at, double *distance)
{
    int rc;
    dmk_site site = {0};
    DMK_TRY(dmk_site_create(ctx, t->g->mesh, &t->g->star, at, 0, &site));
    DMK_TRY(search(ctx, t, &site));
    *distance = t->best.length * t->g->star.unit;
done:
    dmk_site_free(&site);
    return rc;
}

/* The distance, its source, and the direction there, anywhere. */
static int value_at(dmk_context *ctx, dmk_tracer *t, const dmk_point *at, dmk_value *value)
{
    int rc;
    dmk_site site = {0};
    const dmk_geodesics *g = t->g;
    DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, at, 0, &site));
    *value = (dmk_value){INFINITY, 0, -1};
    if (site.vertex >= 0) {
        const dmk_arrival *a = g->arrival + site.vertex;
        *value = (dmk_value){g->distance[site.vertex], a->direction, a->source};
        goto done;
    }
    if (g->arrival[g->mesh->triangle[3 * at->triangle]].source < 0) goto done;
    DMK_TRY(search(ctx, t, &site));
    const finish f = t->best;
    value->distance = f.length * g->star.unit;
    value->source = f.vertex >= 0 ? g->arrival[f.vertex].source : f.source;
    if (f.vertex >= 0 && !dmk_is_source(g, f.vertex)) {
        value->direction = g->arrival[f.vertex].direction;
    } else {
        dmk_path path = {0};
        DMK_TRY(dmk_tracer_path(ctx, t, at, &path));
        value->direction = path.angle;
        dmk_path_free(&path);
    }
done:
    dmk_site_free(&site);
    return rc;
}

/* ---- repair --------------------------------------------------------------------------------- */

typedef struct mended {
    double distance, error;
    int32_t vertex;
    bool more; /* another search may find more: there is room for its ways */
} mended;

typedef struct repairs {
    const dmk_geodesics *g;
    dmk_tracer **tracer; /* one for each thread */
    int n_threads;
    mended *list;
    int32_t n;
    _Atomic int32_t next; /* of the list, to be taken: searches differ in length */
} repairs;

static bool is_over(const dmk_geodesics *g, int32_t v)
{
    return g->arrival[v].source >= 0 && !dmk_is_source(g, v) &&
           dmk_is_over(g->tolerance, g->error[v], g->distance[v]);
}

/* What two estimates leave of a distance: the old one, and that it lies in lo..hi, most likely at `length`. If they
 * exclude each other the old one was too small. */
static void narrow(const dmk_geodesics *g, mended *m, double lo, double length, double hi)
{
    const double d = g->distance[m->vertex], error = g->error[m->vertex];
    const bool agree = lo <= d + error && hi >= d - error;
    if (agree) lo = dmk_max(lo, d - error), hi = dmk_min(hi, d + error);
    m->distance = dmk_max(lo, dmk_min(length, hi));
    m->error = dmk_max(hi - m->distance, m->distance - lo);
    if (!agree || m->error < error) return;
    m->distance = d;
    m->error = error;
}

/* Vertex `m` by a path of its own, no longer than the shortest by more than the tolerance: ways that differ by less are
 * many near focal points, 100,000 to 700,000 windows for each of 15 vertices of a million triangles, and 18,000 to
 * 100,000 so. Paths end where distances are known, but for the errors there: the shortest may be as much longer than
 * the path that was found, and no shorter than what was found, dropped or without room. */
static int mend(dmk_context *ctx, dmk_tracer *t, mended *m)
{
    int rc;
    dmk_site site = {0};
    const dmk_geodesics *g = t->g;
    const double unit = g->star.unit;
    dmk_point p = corner_point(g, m->vertex);
    DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, &p, 0, &site));
    t->slack = g->tolerance * g->distance[m->vertex] / unit;
    DMK_TRY(look_for_best(ctx, t, &site));
    const double length = t->best.length,
                 above = t->best.vertex >= 0 ? doubt(g, t->best.vertex) : 0;
    const double least = dmk_min(t->least, dmk_min(t->lost, t->bound - t->slack));
    narrow(g, m, least * unit, length * unit, (length + above) * unit);
    m->more = !has_lost(t);
    rc = dmk_poll(ctx);
done:
    dmk_site_free(&site);
    return rc;
}

static int mend_share(dmk_context *ctx, int32_t thread, void *data)
{
    int rc = DMK_OK;
    repairs *r = data;
    for (int32_t i; (i = atomic_fetch_add(&r->next, 1)) < r->n;) {
        DMK_TRY(mend(ctx, r->tracer[thread], r->list + i));
    }
done:
    return rc;
}

/* All of the list from what is known so far, and what is found then. *better: some are no longer over the tolerance,
 * and may be the ends of paths of those that are. The list is of these then. */
static int mend_all(dmk_context *ctx, dmk_geodesics *g, repairs *r, bool *better)
{
    int rc;
    int32_t left = 0;
    r->next = 0;
    DMK_TRY(dmk_parallel_pieces(ctx, r->n_threads, mend_share, r));
    *better = false;
    for (int32_t i = 0; i < r->n; i++) {
        const mended m = r->list[i];
        g->distance[m.vertex] = m.distance;
        g->error[m.vertex] = m.error;
        *better = *better || !is_over(g, m.vertex);
        if (m.more && is_over(g, m.vertex)) r->list[left++] = m;
    }
    r->n = left;
done:
    return rc;
}

int dmk_tracer_repair(dmk_context *ctx, dmk_geodesics *g, bool *few)
{
    int rc = DMK_OK;
    mended list[DMK_MOST_REPAIRS];
    repairs r = {.g = g, .list = list};
    *few = true;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (!is_over(g, v)) continue;
        *few = r.n < DMK_MOST_REPAIRS;
        if (!*few) goto done;
        list[r.n++].vertex = v;
    }
    r.n_threads = dmk_min_i(dmk_parallel_threads(ctx), r.n);
    DMK_TRY(DMK_NEW(ctx, r.tracer, (size_t)r.n_threads));
    for (int i = 0; i < r.n_threads; i++) DMK_TRY(dmk_tracer_create(ctx, g, &r.tracer[i]));
    for (bool better = true; better && r.n > 0;) DMK_TRY(mend_all(ctx, g, &r, &better));
done:
    for (int i = 0; r.tracer && i < r.n_threads; i++) dmk_tracer_destroy(&r.tracer[i]);
    free(r.tracer);
    return rc;
}

/* ---- the public calls ------------------------------------------------------------------------ */

static int check(dmk_context *ctx, const dmk_geodesics *g, size_t n, const dmk_point *points)
{
    int rc = dmk_mesh_check_edges(ctx, g->mesh);
    for (size_t i = 0; i < n && rc == DMK_OK; i++)
        rc = dmk_point_check(ctx, g->mesh, "points", points + i);
    return rc;
}

int dmk_geodesics_at(dmk_context *ctx, const dmk_geodesics *g, size_t n_points,
                     const dmk_point *points, dmk_value *values)
{
    int rc;
    dmk_tracer *t = NULL;
    if (dmk_missing(ctx, "geodesics", g, "points", points, "values", values)) return DMK_E_ARG;
    DMK_TRY(check(ctx, g, n_points, points));
    DMK_TRY(dmk_stage_begin(ctx, "values"));
    DMK_TRY(dmk_tracer_create(ctx, g, &t));
    for (size_t i = 0; i < n_points; i++) {
        DMK_TRY(value_at(ctx, t, points + i, values + i));
        DMK_TRY(dmk_poll(ctx));
    }
done:
    dmk_stage_end(ctx);
    dmk_tracer_destroy(&t);
    return rc;
}

int dmk_geodesics_paths(dmk_context *ctx, const dmk_geodesics *g, size_t n_points,
                        const dmk_point *to, dmk_path *paths)
{
    int rc;
    if (dmk_missing(ctx, "geodesics", g, "to", to, "paths", paths)) return DMK_E_ARG;
    memset(paths, 0, n_points * sizeof *paths);
    DMK_TRY(check(ctx, g, n_points, to));
    DMK_TRY(dmk_stage_begin(ctx, "path"));
    rc = dmk_tracer_paths(ctx, g, n_points, to, paths);
done:
    dmk_stage_end(ctx);
    return rc;
}
