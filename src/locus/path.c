/* Minimal geodesics: see path.h. window.c searches from the end to the source; here the windows are
 * followed back, from the source to the end, and become points on edges. */
#include "locus/path.h"
#include "locus/rays.h"
#include "locus/window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

typedef struct trail {
    const dmk_search *search;
    dmk_path *path;
    size_t capacity;
    double last[3];
} trail;

/* A path through a vertex meets several edges there: one point is enough. */
static int append(dmk_context *ctx, trail *t, dmk_point p)
{
    double x[3];
    dmk_path *path = t->path;
    int rc = dmk_mesh_point_xyz(ctx, t->search->mesh, &p, x);
    if (rc != DMK_OK) return rc;
    if (path->n > 0) {
        double dx = x[0] - t->last[0], dy = x[1] - t->last[1], dz = x[2] - t->last[2];
        double piece = sqrt(dx * dx + dy * dy + dz * dz);
        path->length += piece;
        if (path->n > 1 && piece <= t->search->eps) path->n--;
    }
    memcpy(t->last, x, sizeof x);
    if (path->n == t->capacity) {
        size_t capacity = t->capacity ? 2 * t->capacity : 64;
        dmk_point *grown = realloc(path->point, capacity * sizeof *grown);
        if (!grown) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory for the points of a path");
        path->point = grown;
        t->capacity = capacity;
    }
    path->point[path->n++] = p;
    return DMK_OK;
}

/* From (x, y) above the edge of window i straight to the window's bend: the points on the edges. */
static int follow_window(dmk_context *ctx, trail *t, int32_t i, double x, double y)
{
    const dmk_search *s = t->search;
    const dmk_mesh *m = s->mesh;
    for (; i >= 0; i = s->window[i].parent) {
        const dmk_window *w = s->window + i;
        int k = w->half % 3;
        double length = m->length[m->triangle_edge[w->half]];
        double at = fmin(length, fmax(0, w->x + (x - w->x) * w->y / (w->y - y)));
        dmk_point p = {.triangle = w->half / 3};
        p.weight[(k + 1) % 3] = 1 - at / length;
        p.weight[(k + 2) % 3] = at / length;
        int rc = append(ctx, t, p);
        if (rc != DMK_OK || w->parent < 0) return rc;
        /* The point in the parent's plane, where this edge is one of the two above. */
        int32_t entered = s->window[w->parent].half;
        double cx, cy, base = m->length[m->triangle_edge[entered]];
        dmk_corner_above(m, entered, &cx, &cy);
        double part = w->shared == 0 ? at / length : 1 - at / length;
        x = w->shared == 0 ? part * cx : base + part * (cx - base);
        y = part * cy;
    }
    return DMK_OK;
}

/* The corner of the window's triangle opposite its edge, or the goal inside it. */
static void end_of_window(const dmk_search *s, int32_t i, const dmk_point *inside, double *x,
                          double *y)
{
    const dmk_mesh *m = s->mesh;
    int32_t h = s->window[i].half;
    dmk_corner_above(m, h, x, y);
    if (!inside) return;
    *x = inside->weight[h % 3] * *x +
         inside->weight[(h % 3 + 2) % 3] * m->length[m->triangle_edge[h]];
    *y *= inside->weight[h % 3];
}

static dmk_point vertex_place(const dmk_search *s, int32_t v)
{
    int32_t i = s->fan.triangle[s->fan.row[v]];
    int k = i % 4;
    return (dmk_point){i / 4, {k == 0, k == 1, k == 2}};
}

/* From the goal over the bends to the start. */
static int follow(dmk_context *ctx, trail *t, const dmk_point *to)
{
    int rc;
    const dmk_search *s = t->search;
    dmk_reach r = s->end;
    const dmk_point *inside = NULL;
    for (int32_t k = 0; r.window >= 0 && s->goal.vertex < 0 && k < s->goal.n; k++) {
        if (s->goal.in[k].triangle == s->window[r.window].half / 3) inside = s->goal.in + k;
    }
    DMK_TRY(append(ctx, t, s->goal.in[0]));
    for (;;) {
        if (r.window >= 0) {
            double x, y;
            end_of_window(s, r.window, inside, &x, &y);
            DMK_TRY(follow_window(ctx, t, r.window, x, y));
        }
        inside = NULL;
        if (r.bend < 0) break;
        DMK_TRY(append(ctx, t, vertex_place(s, r.bend)));
        r = s->reach[r.bend];
    }
    DMK_TRY(append(ctx, t, *to));
done:
    return rc;
}

/* Direction from the source to the path's second point, which lies in one of its triangles: by the
 * sector of the chart that sees it between its sides. */
static double first_angle(const dmk_mesh *m, const dmk_chart *c, const double *from,
                          const double *to)
{
    double best = -HUGE_VAL, angle = 0;
    for (int32_t i = 0; i < c->n_sectors; i++) {
        const dmk_chart_sector *s = c->sector + i;
        double e[2][3], d[3], g[2][2] = {{0}}, b[2] = {0}, dd = 0;
        for (int k = 0; k < 3; k++) {
            d[k] = to[k] - from[k];
            for (int j = 0; j < 2; j++) e[j][k] = m->xyz[3 * (size_t)s->vertex[j] + k] - from[k];
            for (int j = 0; j < 2; j++) {
                for (int l = 0; l < 2; l++) g[j][l] += e[j][k] * e[l][k];
                b[j] += e[j][k] * d[k];
            }
            dd += d[k] * d[k];
        }
        /* d = p e0 + q e1 as nearly as may be: inside, and in the plane of the sector. */
        double det = g[0][0] * g[1][1] - g[0][1] * g[0][1];
        double p = (b[0] * g[1][1] - b[1] * g[0][1]) / det;
        double q = (b[1] * g[0][0] - b[0] * g[0][1]) / det;
        double off = dd - p * b[0] - q * b[1];
        double good = fmin(0, fmin(p * s->radius[0], q * s->radius[1]) / sqrt(dd)) - fabs(off) / dd;
        if (!(good > best)) continue;
        double turn = s->angle[1] - s->angle[0];
        best = good;
        angle = s->angle[0] + atan2(q * s->radius[1] * sin(turn),
                                    p * s->radius[0] + q * s->radius[1] * cos(turn));
    }
    return angle * (c->closed ? 2 * pi / c->total : 1);
}

/* Both ends in one triangle: a segment. Those around a vertex increase, and may be many; at any other
 * place there are two at most. */
static bool is_beside(const dmk_search *s)
{
    if (s->start.vertex >= 0 && s->goal.vertex >= 0) {
        for (int32_t i = 0, k = 0; i < s->start.n && k < s->goal.n;) {
            const int64_t a = s->start.in[i].triangle, b = s->goal.in[k].triangle;
            if (a == b) return true;
            if (a < b) i++;
            else k++;
        }
        return false;
    }
    for (int32_t i = 0; i < s->start.n; i++) {
        for (int32_t k = 0; k < s->goal.n; k++) {
            if (s->start.in[i].triangle == s->goal.in[k].triangle) return true;
        }
    }
    return false;
}

static int trace_one(dmk_context *ctx, dmk_search *s, const dmk_chart *chart, const dmk_point *to,
                     dmk_path *path)
{
    int rc;
    double from[3], next[3];
    trail t = {.search = s, .path = path};
    DMK_TRY(dmk_spot_set(ctx, s->mesh, s->across, &s->fan, to, &s->start));
    if (is_beside(s)) {
        DMK_TRY(append(ctx, &t, s->goal.in[0]));
        DMK_TRY(append(ctx, &t, *to));
    } else {
        DMK_TRY(dmk_search_run(ctx, s));
        if (s->end.distance == HUGE_VAL) {
            rc = dmk_fail(ctx, DMK_E_MESH, "no path leads to triangle %lld",
                          (long long)to->triangle);
            goto done;
        }
        DMK_TRY(follow(ctx, &t, to));
    }
    DMK_TRY(dmk_mesh_point_xyz(ctx, s->mesh, &path->point[0], from));
    DMK_TRY(dmk_mesh_point_xyz(ctx, s->mesh, &path->point[1], next));
    if (path->length > 0) path->angle = first_angle(s->mesh, chart, from, next);
done:
    return rc;
}

int dmk_path_trace(dmk_context *ctx, const dmk_locus_input *in, size_t n_points,
                   const dmk_point *to, dmk_path *paths)
{
    int rc;
    int32_t *across = NULL;
    dmk_search search = {0};
    dmk_chart chart = {0};
    memset(paths, 0, n_points * sizeof *paths);
    DMK_TRY(dmk_find_across(ctx, in->mesh, &across));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_chart_create(ctx, in->mesh, across, &in->source, &chart));
    DMK_TRY(dmk_search_create(ctx, in, across, &search));
    for (size_t i = 0; i < n_points; i++) {
        DMK_TRY(trace_one(ctx, &search, &chart, &to[i], &paths[i]));
    }
done:
    for (size_t i = 0; rc != DMK_OK && i < n_points; i++)
        dmk_path_free(&paths[i]);
    dmk_search_free(&search);
    dmk_chart_free(&chart);
    free(across);
    return rc;
}

void dmk_path_free(dmk_path *path)
{
    if (!path) return;
    free(path->point);
    memset(path, 0, sizeof *path);
}
