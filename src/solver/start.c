/* The density from the distance: mass flows down the distance to the source, each triangle adding
 * its area, and mu is the load per unit width across the flow.
 *
 * One flow direction per edge, the mean of its two sides, keeps the mass. Rays are straight within
 * a triangle, so a load that enters through a piece of one edge leaves through a known piece of
 * another. An edge carries the load as a linear profile, N + M (2s - 1) over its length s in 0..1:
 * a profile splits at the ray through the opposite corner, two join by projection, and a triangle's
 * own area adds a tent with its top on that ray. Constant profiles would blur mu across the rays.
 */
#include "solver/start.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>

typedef struct profile {
    double n, m; /* load and its slope; |m| <= n */
} profile;

typedef struct sweep {
    const dmk_mesh *mesh;
    const double *d, *mid;
    double *width;   /* n_edges: length times cosine of the flow to the normal, positive from the
                        first triangle to the second; 0 on a border */
    profile *load;   /* n_edges: along edge_vertex[2e] to [2e+1], area units; before the widths are
                        there, the flow out of the edge's two triangles */
    double *mu;      /* n_triangles */
    int8_t *waiting; /* n_triangles: inflow edges not yet known, 0 of sinks and what is done; before
                        that, 1 where there may be no way out */
    uint8_t *sink;   /* n_triangles: holds the source */
    int32_t *queue;  /* n_triangles */
    int32_t n_queue;
} sweep;

/* Of a way out of a triangle that has none, over its edge's length. */
static const double least_outlet = 1e-3;

static int sweep_create(dmk_context *ctx, sweep *s)
{
    int rc;
    size_t n_edges = (size_t)s->mesh->n_edges, n_triangles = (size_t)s->mesh->n_triangles;
    DMK_TRY(DMK_NEW_UNSET(ctx, s->width, n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->load, n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->waiting, n_triangles));
    DMK_TRY(DMK_NEW(ctx, s->sink, n_triangles));
    DMK_TRY(DMK_NEW_UNSET(ctx, s->queue, n_triangles));
done:
    return rc;
}

static void sweep_free(sweep *s)
{
    free(s->width);
    free(s->load);
    free(s->waiting);
    free(s->sink);
    free(s->queue);
}

/* Flow of -grad d out of triangle t through its edge k, times the edge's length. The gradient is
 * that of the quadratic through all six values, at the edge's midpoint, scaled to 1: there it is
 * the gradient of the linear function with value -dk - 2 mk + 2 mi + 2 mj at corner k. */
static double outflow(const sweep *s, int32_t t, int k, const double cot[3])
{
    const dmk_mesh *mesh = s->mesh;
    const int32_t *corner = mesh->triangle + 3 * (size_t)t;
    const int32_t *edge = mesh->triangle_edge + 3 * (size_t)t;
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double di = s->d[corner[i]], dj = s->d[corner[j]];
    double dk = 2 * (s->mid[edge[i]] + s->mid[edge[j]] - s->mid[edge[k]]) - s->d[corner[k]];
    double g2 = 0.5 * (cot[k] * (di - dj) * (di - dj) + cot[i] * (dj - dk) * (dj - dk) +
                       cot[j] * (dk - di) * (dk - di));
    double flow = cot[j] * (dk - di) + cot[i] * (dk - dj);
    return g2 > 0 ? flow * sqrt(mesh->area[t] / g2) : 0;
}

static void outflow_range(int32_t begin, int32_t end, void *data)
{
    const sweep *s = data;
    const dmk_mesh *mesh = s->mesh;
    for (int32_t t = begin; t < end; t++) {
        double cot[3];
        dmk_cots(mesh, t, cot);
        for (int k = 0; k < 3; k++) {
            const int32_t e = mesh->triangle_edge[3 * (size_t)t + (size_t)k];
            const double flow = outflow(s, t, k, cot);
            if (mesh->edge_triangle[2 * (size_t)e] == t)
                s->load[e].n = flow;
            else
                s->load[e].m = flow;
        }
    }
}

static void width_range(int32_t begin, int32_t end, void *data)
{
    sweep *s = data;
    for (int32_t e = begin; e < end; e++) {
        int32_t a = s->mesh->edge_triangle[2 * e], b = s->mesh->edge_triangle[2 * e + 1];
        const profile out = s->load[e];
        s->load[e] = (profile){0, 0};
        if (b < 0 || (s->sink[a] && s->sink[b])) {
            s->width[e] = 0;
            continue;
        }
        double w = 0.5 * (out.n - out.m);
        if (s->sink[a]) w = -dmk_max(-w, least_outlet * s->mesh->length[e]);
        if (s->sink[b]) w = dmk_max(w, least_outlet * s->mesh->length[e]);
        s->width[e] = w;
    }
}

/* Width of edge k of t, positive where the load leaves t. */
static double width_out(const sweep *s, int32_t t, int k)
{
    int32_t e = s->mesh->triangle_edge[3 * (size_t)t + k];
    return s->mesh->edge_triangle[2 * (size_t)e] == t ? s->width[e] : -s->width[e];
}

/* A load that comes in must leave: a triangle with no way out (a dent of the computed distance)
 * gets one through its edge nearest the source, and so may its neighbour in turn. */
static void open_triangle(sweep *s, int32_t t)
{
    for (int steps = 0; steps < 64; steps++) {
        const int32_t *edge = s->mesh->triangle_edge + 3 * (size_t)t;
        int best = -1;
        for (int k = 0; k < 3; k++) {
            if (width_out(s, t, k) > 0) return;
            if (dmk_twin_triangle(s->mesh, t, edge[k]) < 0) continue;
            if (best < 0 || s->mid[edge[k]] < s->mid[edge[best]]) best = k;
        }
        if (best < 0 || s->sink[t]) return;
        double w = least_outlet * s->mesh->length[edge[best]];
        s->width[edge[best]] = s->mesh->edge_triangle[2 * (size_t)edge[best]] == t ? w : -w;
        t = dmk_twin_triangle(s->mesh, t, edge[best]);
        if (s->sink[t]) return;
        s->waiting[t] = 1; /* it has one way less */
    }
}

static void closed_range(int32_t begin, int32_t end, void *data)
{
    const sweep *s = data;
    for (int32_t t = begin; t < end; t++) {
        const bool open =
            width_out(s, t, 0) > 0 || width_out(s, t, 1) > 0 || width_out(s, t, 2) > 0;
        s->waiting[t] = !open && !s->sink[t];
    }
}

/* Profile of edge e as run counterclockwise by triangle t (which is how edge_triangle's first
 * does), and back. */
static profile load_get(const sweep *s, int32_t t, int32_t e)
{
    profile p = s->load[e];
    if (s->mesh->edge_triangle[2 * (size_t)e] != t) p.m = -p.m;
    return p;
}

static void load_put(sweep *s, int32_t t, int32_t e, profile p)
{
    if (fabs(p.m) > p.n) p.m = copysign(p.n, p.m);
    if (s->mesh->edge_triangle[2 * (size_t)e] != t) p.m = -p.m;
    s->load[e] = p;
}

/* One edge in (k), two out: the inflow splits at the ray through corner k, at f of the edge from
 * corner k+2 (j) to k+1 (i) counted from i. Returns the load's mean over the triangle. */
static double split_load(sweep *s, int32_t t, int k, const double *w)
{
    const int32_t *edge = s->mesh->triangle_edge + 3 * (size_t)t;
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double wi = dmk_max(w[i], 0), wj = dmk_max(w[j], 0), area = s->mesh->area[t];
    double f = wj / (wi + wj), g = 1 - f;
    profile in = load_get(s, t, edge[k]); /* from corner i to corner j */
    /* edge j runs k to i: reversed; edge i runs j to k: reversed */
    profile pj = {f * (in.n - in.m * g + area), f * (f * in.m + area)};
    profile pi = {g * (in.n + in.m * f + area), g * (g * in.m - area)};
    load_put(s, t, edge[j], (profile){pj.n, -pj.m});
    load_put(s, t, edge[i], (profile){pi.n, -pi.m});
    return in.n + in.m * (f - g) / 3 + area * 2 / 3;
}

/* Two edges in, one out (k). */
static double join_load(sweep *s, int32_t t, int k, const double *w)
{
    const int32_t *edge = s->mesh->triangle_edge + 3 * (size_t)t;
    int i = (k + 1) % 3, j = (k + 2) % 3;
    double wi = dmk_max(-w[i], 0), wj = dmk_max(-w[j], 0), area = s->mesh->area[t];
    double f = wi + wj > 0 ? wj / (wi + wj) : 0.5, g = 1 - f;
    profile pi = load_get(s, t, edge[i]), pj = load_get(s, t, edge[j]);
    pi.m = -pi.m; /* now both from corner i over k to j */
    pj.m = -pj.m;
    profile out = {pi.n + pj.n + area,
                   3 * (pi.n * f - pj.n * g) + f * pj.m + g * pi.m + area * (f - g)};
    load_put(s, t, edge[k], out);
    return pj.n + pi.n + (pj.m - pi.m) / 3 + area * 2 / 3;
}

/* Load on its way through triangle t, mean over its area; fills the out edges. */
static double pass_load(sweep *s, int32_t t, const double *w)
{
    const int32_t *edge = s->mesh->triangle_edge + 3 * (size_t)t;
    int n_in = 0, n_out = 0, in = 0, out = 0;
    double sum = 0, area = s->mesh->area[t];
    for (int k = 0; k < 3; k++) {
        if (w[k] < 0) n_in++, in = k;
        if (w[k] > 0) n_out++, out = k, sum += w[k];
    }
    if (n_out > 0 && n_in == 1) return split_load(s, t, in, w);
    if (n_out == 1) return join_load(s, t, out, w);
    for (int k = 0; k < 3; k++) {
        if (w[k] > 0) load_put(s, t, edge[k], (profile){area * w[k] / sum, 0});
    }
    return area * 2 / 3;
}

/* The shortest altitude: no direction sees less of the triangle. */
static double least_width(const dmk_mesh *mesh, int32_t t)
{
    const int32_t *edge = mesh->triangle_edge + 3 * (size_t)t;
    const double *length = mesh->length;
    return 2 * mesh->area[t] / dmk_max(dmk_max(length[edge[0]], length[edge[1]]), length[edge[2]]);
}

static void sweep_triangle(sweep *s, int32_t t)
{
    double w[3], sum = 0;
    for (int k = 0; k < 3; k++) {
        w[k] = width_out(s, t, k);
        int32_t other = dmk_twin_triangle(s->mesh, t, s->mesh->triangle_edge[3 * (size_t)t + k]);
        /* a ring of triangles that feed each other was cut open here */
        if (w[k] > 0 && !s->sink[other] && s->waiting[other] == 0) w[k] = 0;
        sum += fabs(w[k]);
    }
    double load = pass_load(s, t, w);
    s->mu[t] = load / dmk_max(0.5 * sum, least_width(s->mesh, t));
    s->waiting[t] = 0;
    for (int k = 0; k < 3; k++) {
        int32_t other = dmk_twin_triangle(s->mesh, t, s->mesh->triangle_edge[3 * (size_t)t + k]);
        if (w[k] > 0 && !s->sink[other] && --s->waiting[other] == 0) s->queue[s->n_queue++] = other;
    }
}

static void sweep_queue(sweep *s, int32_t *head)
{
    while (*head < s->n_queue) sweep_triangle(s, s->queue[(*head)++]);
}

static double height(const sweep *s, int32_t t)
{
    const int32_t *c = s->mesh->triangle + 3 * (size_t)t;
    return s->d[c[0]] + s->d[c[1]] + s->d[c[2]];
}

typedef struct stuck {
    double height;
    int32_t triangle;
} stuck;

/* Farther first; among equals the order of the mesh. */
static int compare_stuck(const void *a, const void *b)
{
    const stuck *x = a, *y = b;
    if (x->height != y->height) return x->height > y->height ? -1 : 1;
    return x->triangle < y->triangle ? -1 : 1;
}

/* Triangles that wait for each other in a ring, and all behind them: open the rings at their
 * farthest triangles. */
static int sweep_rings(dmk_context *ctx, sweep *s, int32_t *head)
{
    int rc;
    stuck *list = NULL;
    size_t n = 0;
    for (int32_t t = 0; t < s->mesh->n_triangles; t++) n += s->waiting[t] > 0 && !s->sink[t];
    DMK_TRY(DMK_NEW(ctx, list, n));
    n = 0;
    for (int32_t t = 0; t < s->mesh->n_triangles; t++) {
        if (s->waiting[t] > 0 && !s->sink[t]) list[n++] = (stuck){height(s, t), t};
    }
    qsort(list, n, sizeof *list, compare_stuck);
    for (size_t i = 0; i < n; i++) {
        if (s->waiting[list[i].triangle] == 0) continue;
        sweep_triangle(s, list[i].triangle);
        sweep_queue(s, head);
    }
done:
    free(list);
    return rc;
}

static void waiting_range(int32_t begin, int32_t end, void *data)
{
    const sweep *s = data;
    for (int32_t t = begin; t < end; t++) {
        int n_in = 0;
        for (int k = 0; k < 3 && !s->sink[t]; k++) n_in += width_out(s, t, k) < 0;
        s->waiting[t] = (int8_t)n_in;
    }
}

static int sweep_run(dmk_context *ctx, sweep *s)
{
    int32_t head = 0;
    for (int32_t t = 0; t < s->mesh->n_triangles; t++) {
        if (!s->sink[t] && s->waiting[t] == 0) s->queue[s->n_queue++] = t;
    }
    sweep_queue(s, &head);
    return sweep_rings(ctx, s, &head);
}

/* In the order of the mesh; most have one. */
static void open_all(dmk_context *ctx, sweep *s)
{
    const int32_t n = s->mesh->n_triangles;
    dmk_parallel(ctx, n, closed_range, s);
    for (int32_t t = 0; t < n; t++) {
        if (s->waiting[t]) open_triangle(s, t);
    }
}

/* The whole flow: the widths, a way out of every triangle, what each waits for, the loads. */
static int sweep_all(dmk_context *ctx, sweep *s, const dmk_meanwhile *meanwhile)
{
    const int32_t n = s->mesh->n_triangles;
    dmk_parallel(ctx, n, outflow_range, s);
    dmk_parallel(ctx, s->mesh->n_edges, width_range, s);
    open_all(ctx, s);
    dmk_parallel(ctx, n, waiting_range, s);
    if (meanwhile) meanwhile->begin(ctx, meanwhile->user);
    return sweep_run(ctx, s);
}

/* Where the source lies: mu = load / (r * angle), so the integral over the part of the triangle
 * seen through an edge is the load through the edge times the mean distance to it. */
static void sink_density(sweep *s, int32_t t)
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        int32_t e = s->mesh->triangle_edge[3 * (size_t)t + k];
        const int32_t *v = s->mesh->edge_vertex + 2 * (size_t)e;
        double reach = (s->d[v[0]] + s->d[v[1]] + 2 * s->mid[e]) / 4;
        sum += (s->load[e].n + s->mesh->area[t] / 3) * reach;
    }
    s->mu[t] = sum / s->mesh->area[t];
}

/* The triangles that hold the source: one, two at an edge, the star at a vertex. */
static void mark_sinks(const dmk_mesh *mesh, const dmk_point *source, uint8_t *sink)
{
    const double near = 1e-3; /* of the weights, which sum to 1 */
    sink[source->triangle] = 1;
    int32_t vertex = -1;
    for (int k = 0; k < 3; k++) {
        int32_t e = mesh->triangle_edge[3 * source->triangle + k];
        int32_t other = dmk_twin_triangle(mesh, (int32_t)source->triangle, e);
        if (source->weight[k] < near && other >= 0) sink[other] = 1;
        if (source->weight[k] > 1 - near) vertex = mesh->triangle[3 * source->triangle + k];
    }
    for (int32_t h = 0; vertex >= 0 && h < 3 * mesh->n_triangles; h++) {
        if (mesh->triangle[h] == vertex) sink[h / 3] = 1;
    }
}

int dmk_start_density(dmk_context *ctx, const dmk_mesh *mesh, const dmk_geodesics *geodesics,
                      const double *mid, double *mu, const dmk_meanwhile *meanwhile)
{
    int rc;
    sweep s = {.mesh = mesh, .d = geodesics->distance, .mid = mid, .mu = mu};
    DMK_TRY(sweep_create(ctx, &s));
    mark_sinks(mesh, &geodesics->source->point, s.sink);
    DMK_TRY(sweep_all(ctx, &s, meanwhile));
    for (int32_t t = 0; t < mesh->n_triangles; t++) {
        if (s.sink[t]) sink_density(&s, t);
        mu[t] = dmk_max(mu[t], 0.1 * sqrt(mesh->area[t]));
    }
done:
    sweep_free(&s);
    return rc;
}
