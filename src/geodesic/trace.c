/* Paths back to the sources, and distances anywhere: what a search (search.h) finds, piece by piece from pseudo-source
 * to pseudo-source, whose distances are known. */
#include "geodesic/search.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

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
    dmk_angle_above(g, to.half, &s);
    dmk_place_above(to.half, &s, p->weight, &to.x, &to.y);
    return to;
}

/* In the frame of another half-edge of its triangle. */
static void seen_from(const dmk_geodesics *g, const target *to, int32_t half, double *x, double *y)
{
    angle s;
    *x = to->x, *y = to->y;
    if (half == to->half) return;
    dmk_angle_above(g, to->half, &s);
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
        dmk_angle_above(t->g, w->half, &s);
        double at = dmk_min(s.length, dmk_max(0, w->x - (x - w->x) * w->y / (y - w->y)));
        dmk_point p = {.triangle = w->half / 3};
        p.weight[dmk_next(w->half) % 3] = 1 - at / s.length;
        p.weight[dmk_previous(w->half) % 3] = at / s.length;
        if (*n == room) DMK_TRY(DMK_GROW(ctx, *list, *n + 1, room));
        (*list)[(*n)++] = p;
        if (w->parent < 0) break;
        dmk_angle_above(t->g, t->sight[w->parent].half, &s);
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
    dmk_angle_above(g, w->half, &s);
    *x = s.cx, *y = s.cy;
    if (f->vertex >= 0) return;
    if (f->source >= g->n_sources) dmk_place_above(w->half, &s, f->foot.weight, x, y);
    for (size_t k = dmk_first_point(t, w->half / 3); f->source < g->n_sources && k < t->n_points;
         k++) {
        const source_point *p = t->point + k;
        if (p->triangle != w->half / 3) break;
        if (p->source == f->source) dmk_place_above(w->half, &s, p->weight, x, y);
    }
}

/* A site as a point of one of the triangles that it lies in. */
static dmk_point seen_in(const dmk_geodesics *g, const dmk_site *at, int32_t triangle)
{
    dmk_point p = at->point;
    source_point own[2];
    if (at->vertex < 0 && p.triangle == triangle) return p;
    if (at->vertex < 0 && dmk_site_points(g, at, 0, own) == 2) {
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
        DMK_TRY(dmk_search(ctx, t, at));
        const finish f = t->best;
        DMK_TRY(append_piece(ctx, t, at, l, &back));
        int32_t source = f.source;
        dmk_point end = f.vertex >= 0           ? dmk_corner_point(g, f.vertex)
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
    DMK_TRY(dmk_search(ctx, t, &site));
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
    DMK_TRY(dmk_search(ctx, t, &site));
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
