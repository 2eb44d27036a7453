/* Continuous Dijkstra over windows: see window.h. */
#include "locus/window.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
/* How far the guide may be off, a part of it and some mesh edges: what the discrete distance keeps
 * on good meshes, on rough ones, and no guide at all (then the distance in space is the least). */
static const dmk_trust trusts[] = {{0.0015, 0.8}, {0.01, 2}, {0.05, 6}, {1, HUGE_VAL}};
enum { n_trusts = sizeof trusts / sizeof *trusts };
/* On tori, the quartic and scanned meshes a search keeps fewer than six windows for each triangle.
 * Where triangles are so thin that rounding decides which way is shorter, there may be more than fit into
 * memory. */
enum { most_windows = 1000000, most_for_triangle = 30 };
/* Rounding: lengths over that of the path, places over the length of the edge. */
static const double same_length = 1e-12, same_place = 1e-12;

/* ---- create --------------------------------------------------------------------------------- */

/* More than 2 pi around an interior vertex, or pi at a border. Border vertices of just pi count,
 * there are few. */
static int find_bends(dmk_context *ctx, dmk_search *s)
{
    int rc;
    const dmk_mesh *m = s->mesh;
    double *angle = NULL;
    bool *border = NULL;
    DMK_TRY(DMK_NEW(ctx, angle, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, border, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, s->bends, (size_t)m->n_vertices));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        angle[m->triangle[h]] += atan2(1, dmk_cot(m, h));
        if (s->across[h] >= 0) continue;
        border[m->triangle[h / 3 * 3 + (h % 3 + 1) % 3]] = true;
        border[m->triangle[h / 3 * 3 + (h % 3 + 2) % 3]] = true;
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        s->bends[v] = angle[v] > (border[v] ? pi - 1e-6 : 2 * pi + 1e-10);
    }
done:
    free(angle);
    free(border);
    return rc;
}

int dmk_search_create(dmk_context *ctx, const dmk_locus_input *in, const int32_t *across,
                      dmk_search *s)
{
    int rc;
    const dmk_mesh *m = in->mesh;
    size_t n_half = 3 * (size_t)m->n_triangles;
    memset(s, 0, sizeof *s);
    s->mesh = m;
    s->across = across;
    s->guide = in->distance;
    for (int32_t e = 0; e < m->n_edges; e++)
        s->mean += m->length[e] / m->n_edges;
    DMK_TRY(find_bends(ctx, s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_vertex_stars_create(ctx, m, &s->fan));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(DMK_NEW(ctx, s->reach, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, s->vertex_round, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, s->split, 2 * n_half));
    DMK_TRY(DMK_NEW(ctx, s->half_round, n_half));
    DMK_TRY(dmk_spot_set(ctx, m, across, &s->fan, &in->source, &s->goal));
    DMK_TRY(dmk_mesh_point_xyz(ctx, m, &in->source, s->goal_xyz));
done:
    if (rc != DMK_OK) dmk_search_free(s);
    return rc;
}

void dmk_search_free(dmk_search *s)
{
    dmk_vertex_stars_free(&s->fan);
    free(s->bends);
    free(s->start.in);
    free(s->goal.in);
    free(s->reach);
    free(s->vertex_round);
    free(s->split);
    free(s->half_round);
    free(s->window);
    free(s->queue);
    memset(s, 0, sizeof *s);
}

/* ---- the queue ------------------------------------------------------------------------------ */

/* Room for one more. */
static int grow(dmk_context *ctx, void **array, size_t n, size_t *capacity, size_t size)
{
    if (n < *capacity) return DMK_OK;
    size_t wanted = *capacity ? 2 * *capacity : 4096;
    void *grown = wanted < INT32_MAX ? realloc(*array, wanted * size) : NULL;
    if (!grown) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory for the windows of a path");
    *array = grown;
    *capacity = wanted;
    return DMK_OK;
}

static int push(dmk_context *ctx, dmk_search *s, double key, int32_t item)
{
    int rc = grow(ctx, (void **)&s->queue, s->n_queued, &s->queue_capacity, sizeof *s->queue);
    if (rc != DMK_OK) return rc;
    size_t i = s->n_queued++;
    for (; i > 0 && s->queue[(i - 1) / 2].key > key; i = (i - 1) / 2)
        s->queue[i] = s->queue[(i - 1) / 2];
    s->queue[i] = (dmk_queued){key, item};
    return DMK_OK;
}

static dmk_queued pop(dmk_search *s)
{
    dmk_queued *q = s->queue, first = q[0], last = q[--s->n_queued];
    size_t i = 0, n = s->n_queued;
    for (size_t c = 1; c < n; c = 2 * i + 1) {
        if (c + 1 < n && q[c + 1].key < q[c].key) c++;
        if (q[c].key >= last.key) break;
        q[i] = q[c];
        i = c;
    }
    q[i] = last;
    return first;
}

/* ---- what is known -------------------------------------------------------------------------- */

static double known(const dmk_search *s, int32_t v)
{
    return s->vertex_round[v] == s->round ? s->reach[v].distance : HUGE_VAL;
}

static double to_goal(const dmk_search *s, int32_t v)
{
    const double *x = s->mesh->xyz + 3 * (size_t)v, *y = s->goal_xyz;
    return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) +
                (x[2] - y[2]) * (x[2] - y[2]));
}

static double slack_of(const dmk_trust *trust, double guide, double edge)
{
    return trust->part * guide + trust->edges * edge;
}

/* The least length from any point of a half-edge's edge to the goal. */
static double least_left(const dmk_search *s, int32_t half)
{
    const dmk_mesh *m = s->mesh;
    int32_t a = m->triangle[half / 3 * 3 + (half % 3 + 1) % 3];
    int32_t b = m->triangle[half / 3 * 3 + (half % 3 + 2) % 3];
    double length = m->length[m->triangle_edge[half]];
    double least = 0.5 * (to_goal(s, a) + to_goal(s, b) - length);
    double guide = 0.5 * (s->guide[a] + s->guide[b] - length);
    return fmax(least, guide - slack_of(s->trust, guide, fmax(s->mean, length)));
}

static void reach_goal(dmk_search *s, double distance, int32_t window, int32_t bend)
{
    if (distance >= s->end.distance) return;
    s->end = (dmk_reach){distance, window, bend};
    s->bound = fmin(s->bound, distance);
}

static int reach_vertex(dmk_context *ctx, dmk_search *s, int32_t v, double distance, int32_t window,
                        int32_t bend)
{
    if (distance >= known(s, v)) return DMK_OK;
    s->reach[v] = (dmk_reach){distance, window, bend};
    s->vertex_round[v] = s->round;
    if (v == s->goal.vertex) reach_goal(s, distance, window, bend);
    if (!s->bends[v] || distance + to_goal(s, v) > s->bound) return DMK_OK;
    return push(ctx, s, distance, ~v);
}

/* ---- windows -------------------------------------------------------------------------------- */

void dmk_corner_above(const dmk_mesh *m, int32_t half, double *x, double *y)
{
    *y = 2 * m->area[half / 3] / m->length[m->triangle_edge[half]];
    *x = dmk_cot(m, half / 3 * 3 + (half % 3 + 1) % 3) * *y;
}

/* Some corner of the triangles at the edge is reached so early that from there all points of the
 * window are, across all its rays. */
static bool is_late(const dmk_search *s, const dmk_window *w)
{
    const dmk_mesh *m = s->mesh;
    double length = m->length[m->triangle_edge[w->half]], x, y;
    double lo = w->base + hypot(w->lo - w->x, w->y) - s->eps;
    double hi = w->base + hypot(w->hi - w->x, w->y) - s->eps;
    if (known(s, m->triangle[w->half / 3 * 3 + (w->half % 3 + 1) % 3]) + w->hi < hi) return true;
    if (known(s, m->triangle[w->half / 3 * 3 + (w->half % 3 + 2) % 3]) + length - w->lo < lo)
        return true;
    if (w->shared < 0) return false;
    int32_t behind = s->across[w->half];
    dmk_corner_above(m, behind, &x, &y);
    double third = known(s, m->triangle[behind]);
    double end = w->shared == 0 ? w->lo : w->hi;
    return third + hypot(length - x - end, y) < (w->shared == 0 ? lo : hi);
}

static int add_window(dmk_context *ctx, dmk_search *s, const dmk_window *w)
{
    double length = s->mesh->length[s->mesh->triangle_edge[w->half]];
    if (w->hi - w->lo <= same_place * length || is_late(s, w)) return DMK_OK;
    double aside = fmax(0, fmax(w->lo - w->x, w->x - w->hi));
    double key = w->base + hypot(aside, w->y);
    if (key + least_left(s, w->half) > s->bound) return DMK_OK;
    if (s->n_windows >= most_windows + most_for_triangle * (size_t)s->mesh->n_triangles) {
        return dmk_fail(ctx, DMK_E_MESH, "the path leads over triangles so thin that rounding does not tell "
                        "which of %zu ways is the shortest; remesh there", s->n_windows);
    }
    int rc = grow(ctx, (void **)&s->window, s->n_windows, &s->window_capacity, sizeof *w);
    if (rc != DMK_OK) return rc;
    s->window[s->n_windows] = *w;
    return push(ctx, s, key, (int32_t)s->n_windows++);
}

/* Window i goes on through side `shared` (0: from the first end of its edge to the corner above,
 * 1: from there to the second end) with its rays from lo to hi. The corner is at c. */
static int add_child(dmk_context *ctx, dmk_search *s, int32_t i, int shared, double lo, double hi,
                     const double *c)
{
    const dmk_mesh *m = s->mesh;
    const dmk_window w = s->window[i];
    int32_t side = w.half / 3 * 3 + (w.half % 3 + (shared ? 1 : 2)) % 3;
    if (s->across[side] < 0) return DMK_OK;
    double length = m->length[m->triangle_edge[side]];
    double base = m->length[m->triangle_edge[w.half]];
    double ox = shared ? c[0] : 0, oy = shared ? c[1] : 0;
    double dx = (shared ? base - c[0] : c[0]) / length, dy = (shared ? -c[1] : c[1]) / length;
    double sx = w.x - ox, sy = w.y - oy, end[2] = {lo, hi};
    for (int k = 0; k < 2; k++) {
        double rx = end[k] - w.x, ry = -w.y;
        end[k] = fmin(length, fmax(0, (sx * ry - sy * rx) / (dx * ry - dy * rx)));
    }
    dmk_window n = {.lo = end[0], .hi = end[1], .x = sx * dx + sy * dy, .y = dx * sy - dy * sx,
                    .base = w.base, .half = s->across[side], .parent = i, .bend = w.bend,
                    .shared = shared};
    return n.y < 0 ? add_window(ctx, s, &n) : DMK_OK;
}

/* The ray to the corner above, through `at`, may not be the shortest path into that angle. Then
 * *useless is the side of it whose rays cross the shorter path, else -1; two windows may well meet
 * in one ray. */
static void take_angle(dmk_search *s, int32_t half, double distance, double at, int *useless)
{
    double *split = s->split + 2 * (size_t)half;
    double slack = 10 * same_place * s->mesh->length[s->mesh->triangle_edge[half]];
    if (s->half_round[half] == s->round && distance >= split[0]) {
        *useless = at < split[1] - slack ? 1 : at > split[1] + slack ? 0 : -1;
        return;
    }
    s->half_round[half] = s->round;
    split[0] = distance;
    split[1] = at;
    *useless = -1;
}

static void look_for_goal(dmk_search *s, int32_t i, const double *c)
{
    const dmk_window *w = s->window + i;
    if (s->goal.vertex >= 0) return;
    double length = s->mesh->length[s->mesh->triangle_edge[w->half]];
    for (int32_t k = 0; k < s->goal.n; k++) {
        const dmk_point *p = s->goal.in + k;
        if (p->triangle != w->half / 3) continue;
        double top = p->weight[w->half % 3];
        double x = top * c[0] + p->weight[(w->half % 3 + 2) % 3] * length, y = top * c[1];
        double at = w->x + (x - w->x) * w->y / (w->y - y), slack = same_place * length;
        if (at < w->lo - slack || at > w->hi + slack) continue;
        reach_goal(s, w->base + hypot(x - w->x, y - w->y), i, w->bend);
    }
}

static int go_on(dmk_context *ctx, dmk_search *s, int32_t i)
{
    int rc, useless;
    const dmk_window w = s->window[i];
    double c[2], length = s->mesh->length[s->mesh->triangle_edge[w.half]];
    double slack = same_place * length;
    dmk_corner_above(s->mesh, w.half, &c[0], &c[1]);
    look_for_goal(s, i, c);
    double at = w.x + (c[0] - w.x) * w.y / (w.y - c[1]);
    if (at < w.lo - slack) return add_child(ctx, s, i, 1, w.lo, w.hi, c);
    if (at > w.hi + slack) return add_child(ctx, s, i, 0, w.lo, w.hi, c);
    at = fmin(w.hi, fmax(w.lo, at));
    double distance = w.base + hypot(c[0] - w.x, c[1] - w.y);
    DMK_TRY(reach_vertex(ctx, s, s->mesh->triangle[w.half], distance, i, w.bend));
    take_angle(s, w.half, distance, at, &useless);
    if (useless != 0) DMK_TRY(add_child(ctx, s, i, 0, w.lo, at, c));
    if (useless != 1) DMK_TRY(add_child(ctx, s, i, 1, at, w.hi, c));
done:
    return rc;
}

/* ---- bends ---------------------------------------------------------------------------------- */

/* All rays from the point p within its triangle, the path having the length `base` there. */
static int radiate(dmk_context *ctx, dmk_search *s, const dmk_point *p, double base, int32_t bend)
{
    int rc = DMK_OK;
    const dmk_mesh *m = s->mesh;
    const int32_t *v = m->triangle + 3 * p->triangle;
    double x[3], y[3];
    DMK_TRY(dmk_mesh_point_xyz(ctx, m, p, x));
    for (int32_t k = 0; bend >= 0 && s->goal.vertex < 0 && k < s->goal.n; k++) {
        if (s->goal.in[k].triangle != p->triangle) continue;
        reach_goal(s, base + to_goal(s, bend), -1, bend);
    }
    for (int k = 0; k < 3; k++) {
        memcpy(y, m->xyz + 3 * (size_t)v[k], sizeof y);
        double d = hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
        if (v[k] != bend) DMK_TRY(reach_vertex(ctx, s, v[k], base + d, -1, bend));
        int32_t h = 3 * (int32_t)p->triangle + k;
        if (p->weight[k] == 0 || s->across[h] < 0) continue;
        double cx, cy, length = m->length[m->triangle_edge[h]];
        dmk_corner_above(m, h, &cx, &cy);
        double px = p->weight[k] * cx + p->weight[(k + 2) % 3] * length, py = p->weight[k] * cy;
        DMK_TRY(add_window(ctx, s,
                           &(dmk_window){.lo = 0, .hi = length, .x = length - px, .y = -py,
                                         .base = base, .half = s->across[h], .parent = -1,
                                         .bend = bend, .shared = -1}));
    }
done:
    return rc;
}

static int radiate_vertex(dmk_context *ctx, dmk_search *s, int32_t v)
{
    for (int32_t i = s->fan.row[v]; i < s->fan.row[v + 1]; i++) {
        int k = s->fan.triangle[i] % 4;
        dmk_point p = {s->fan.triangle[i] / 4, {k == 0, k == 1, k == 2}};
        int rc = radiate(ctx, s, &p, s->reach[v].distance, v);
        if (rc != DMK_OK) return rc;
    }
    return DMK_OK;
}

static int search(dmk_context *ctx, dmk_search *s)
{
    int rc = DMK_OK;
    s->round++;
    s->n_windows = s->n_queued = 0;
    s->end = (dmk_reach){HUGE_VAL, -1, -1};
    for (int32_t k = 0; k < s->start.n; k++)
        DMK_TRY(radiate(ctx, s, &s->start.in[k], 0, -1));
    for (int32_t n = 0; s->n_queued > 0; n++) {
        if (n % 1024 == 0) DMK_TRY(dmk_poll(ctx));
        dmk_queued q = pop(s);
        if (q.key > s->bound + s->eps) break;
        if (q.item < 0) {
            if (q.key == known(s, ~q.item)) DMK_TRY(radiate_vertex(ctx, s, ~q.item));
            continue;
        }
        const dmk_window *w = s->window + q.item;
        if (w->bend >= 0 && w->base > known(s, w->bend)) continue;
        if (!is_late(s, w)) DMK_TRY(go_on(ctx, s, q.item));
    }
done:
    return rc;
}

/* The guide is trusted less where the path's length shows it to be off by half of what was allowed;
 * it is off by most at the path's end. */
int dmk_search_run(dmk_context *ctx, dmk_search *s)
{
    const dmk_point *p = &s->start.in[0];
    const dmk_mesh *m = s->mesh;
    double guide = 0, size = s->mean;
    for (int k = 0; k < 3; k++) {
        guide += p->weight[k] * s->guide[m->triangle[3 * p->triangle + k]];
        size = fmax(size, m->length[m->triangle_edge[3 * p->triangle + k]]);
    }
    s->eps = same_length * (guide + size);
    for (int i = 0; i < n_trusts; i++) {
        s->trust = &trusts[i];
        double slack = slack_of(s->trust, guide, size);
        s->bound = guide + slack;
        int rc = search(ctx, s);
        if (rc != DMK_OK || fabs(s->end.distance - guide) < 0.5 * slack) return rc;
    }
    return DMK_OK;
}
