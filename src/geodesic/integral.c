/* The integral of the distance, and the distances between the vertices that it asks for. */
#include "geodesic/finer.h"
#include "geodesic/trace.h"

#include "base/heading.h"
#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>

/* An estimate beyond this, over the integral, is worth little: of 2 to 32 triangles some errors were 1 to 4 times as
 * large, below it 0.9 at most. */
static const double coarse = 1e-3;

/* Of the source that vertex v's path comes from. */
static double offset_of(const dmk_geodesics *g, int32_t v)
{
    const int32_t source = g->arrival[v].source;
    return source >= 0 && source < g->n_sources ? g->source[source].offset : 0;
}

/* Ways straight on from vertices, many at once in plain loops for the processor's vectors. A multiple of two, for both
 * ends of an edge, and of three, for the corners of a triangle. */
enum { WAYS = 48 };
typedef struct ways {
    int n;
    double x[WAYS], y[WAYS]; /* unit vectors to go along, */
    double turn[WAYS];       /* whose x axis is turned by so much from the way back */
    double ahead[WAYS];      /* how far, in the star's unit */
    double straight[WAYS];   /* from the last pseudo-source, in the star's unit */
    double before[WAYS];     /* from the source to there; infinite where none reaches */
    double line[WAYS];       /* 1: that is a line, whose front is straight; else 0 */
    double length[WAYS];     /* the answer: from the source */
} ways;

static void add_way(const dmk_geodesics *g, ways *w, int32_t v, double turn, double x, double y,
                    double ahead)
{
    const dmk_arrival *a = g->arrival + v;
    const int k = w->n++;
    double before = offset_of(g, v);
    if (a->pseudo_source >= 0) before = g->distance[a->pseudo_source];
    const bool reaches = a->source >= 0;
    w->turn[k] = turn;
    w->x[k] = x;
    w->y[k] = y;
    w->ahead[k] = ahead;
    w->straight[k] = reaches ? (g->distance[v] - before) / g->star.unit : 0;
    w->before[k] = reaches ? before : INFINITY;
    w->line[k] = a->pseudo_source < 0 && a->source >= g->n_sources;
}

static void follow_ways(double unit, ways *w)
{
    for (int k = 0; k < w->n; k++) {
        const dmk_heading to = dmk_heading_of(w->turn[k]);
        const double along = w->x[k] * to.x - w->y[k] * to.y, r = w->ahead[k], d = w->straight[k];
        const double front = fabs(d - r * along),
                     round = sqrt(dmk_max(0, d * d + r * (r - 2 * d * along)));
        w->length[k] = w->before[k] + unit * (w->line[k] * front + (1 - w->line[k]) * round);
    }
}

/* The turn from direction `angle` of vertex v to the way back, the short way around. */
static double turn_back(const dmk_geodesics *g, int32_t v, double angle)
{
    const double turn = fabs(angle - g->arrival[v].back);
    return g->star.border[v] ? turn : dmk_min(turn, g->star.total[v] - turn);
}

typedef struct halving {
    const dmk_geodesics *g;
    double *mid;
} halving;

/* Each edge by the first of its triangles, from both ends. */
static void halve_range(int32_t begin, int32_t end, void *data)
{
    const halving *work = data;
    const dmk_geodesics *g = work->g;
    const dmk_mesh *m = g->mesh;
    int32_t edge[WAYS / 2];
    ways w;
    for (int32_t h = 3 * begin; h < 3 * end;) {
        for (w.n = 0; h < 3 * end && w.n < WAYS; h++) {
            const int32_t e = m->triangle_edge[h], from = dmk_next(h), to = dmk_previous(h);
            if (m->edge_triangle[2 * (size_t)e] != h / 3) continue;
            const int32_t a = m->triangle[from], b = m->triangle[to];
            const double at_b = g->star.angle[to] + g->star.corner_angle[to];
            const double half = 0.5 * m->length[e] / g->star.unit;
            edge[w.n / 2] = e;
            add_way(g, &w, a, turn_back(g, a, g->star.angle[from]), 1, 0, half);
            add_way(g, &w, b, turn_back(g, b, at_b), 1, 0, half);
        }
        follow_ways(g->star.unit, &w);
        for (int k = 0; k < w.n; k += 2)
            work->mid[edge[k / 2]] = dmk_min(w.length[k], w.length[k + 1]);
    }
}

void dmk_geodesics_midpoints(dmk_context *ctx, const dmk_geodesics *g, double *mid)
{
    dmk_parallel(ctx, g->mesh->n_triangles, halve_range, &(halving){g, mid});
}

/* From corner c towards (x, y), a unit vector in the frame whose x axis is the corner's first side. Without the angle
 * of (x, y), but where the short way around is not that of the whole corner. */
static void add_corner(const dmk_geodesics *g, ways *w, int32_t c, double x, double y, double ahead)
{
    const int32_t v = g->mesh->triangle[c];
    const double total = g->star.total[v], first = g->star.angle[c] - g->arrival[v].back;
    const double last = first + g->star.corner_angle[c], half = 0.5 * total;
    double turn = first;
    if (!g->star.border[v] && (first < -half || last > half)) {
        if (last <= -half) {
            turn += total;
        } else if (first >= half) {
            turn -= total;
        } else {
            turn = turn_back(g, v, g->star.angle[c] + dmk_angle_of(x, y));
            x = 1;
            y = 0;
        }
    }
    add_way(g, w, v, turn, x, y, ahead);
}

/* To the centre of gravity of triangle t from its corners. */
static void add_centre(const dmk_geodesics *g, ways *w, int32_t t)
{
    const dmk_mesh *m = g->mesh;
    const double unit = g->star.unit, area = m->area[t] / unit / unit;
    for (int32_t c = 3 * t; c < 3 * t + 3; c++) {
        const double p = m->length[m->triangle_edge[dmk_previous(c)]] / unit,
                     q = m->length[m->triangle_edge[dmk_next(c)]] / unit,
                     o = m->length[m->triangle_edge[c]] / unit;
        const double x = (p + (p * p + (q - o) * (q + o)) / (2 * p)) / 3, y = 2 * area / (3 * p);
        const double r = sqrt(x * x + y * y);
        add_corner(g, w, c, x / r, y / r, r);
    }
}

typedef struct integrand {
    const dmk_geodesics *g;
    const double *mid, *centre; /* centre: of each triangle, or NAN; NULL: of none */
    int32_t first;
    double *sum, *error; /* of triangles from `first` on */
} integrand;

/* Exact for polynomials of degree 3, and beside it for degree 2. */
static void integrate_triangle(const integrand *i, int32_t k, double centre)
{
    const dmk_mesh *m = i->g->mesh;
    const int32_t t = i->first + k;
    double corners = 0, mids = 0;
    if (i->centre && i->centre[t] >= 0) centre = i->centre[t];
    for (size_t h = 3 * (size_t)t; h < 3 * (size_t)t + 3; h++) {
        corners += i->g->distance[m->triangle[h]];
        mids += i->mid[m->triangle_edge[h]];
    }
    const bool reached = corners < INFINITY;
    i->sum[k] = reached ? m->area[t] * (3 * corners + 8 * mids + 27 * centre) / 60 : 0;
    i->error[k] = reached ? fabs(i->sum[k] - m->area[t] * mids / 3) : 0;
}

static void integrate_range(int32_t begin, int32_t end, void *data)
{
    const integrand *i = data;
    ways w;
    for (int32_t from = begin; from < end; from += WAYS / 3) {
        const int32_t to = dmk_min_i(end, from + WAYS / 3);
        w.n = 0;
        for (int32_t k = from; k < to; k++) add_centre(i->g, &w, i->first + k);
        follow_ways(i->g->star.unit, &w);
        for (int32_t k = from; k < to; k++) {
            const double *l = w.length + 3 * (k - from);
            integrate_triangle(i, k, dmk_min(l[0], dmk_min(l[1], l[2])));
        }
    }
}

void dmk_geodesics_integrate_parts(dmk_context *ctx, const dmk_geodesics *g, const double *mid,
                                   int32_t begin, int32_t end, double *sum, double *error)
{
    dmk_parallel(ctx, end - begin, integrate_range,
                 &(integrand){.g = g, .mid = mid, .first = begin, .sum = sum, .error = error});
}

static int integrate(dmk_context *ctx, const dmk_geodesics *g, const double *mid,
                     const double *centre, double *integral, double *error)
{
    int rc;
    double *sum = NULL, *off = NULL;
    const dmk_mesh *m = g->mesh;
    DMK_TRY(DMK_NEW(ctx, sum, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, off, (size_t)m->n_triangles));
    dmk_parallel(ctx, m->n_triangles, integrate_range, &(integrand){g, mid, centre, 0, sum, off});
    *integral = *error = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        *integral += sum[t];
        *error += off[t];
    }
done:
    free(sum);
    free(off);
    return rc;
}

int dmk_geodesics_integrate_from(dmk_context *ctx, const dmk_geodesics *g, const double *mid,
                                 double *integral, double *error)
{
    return integrate(ctx, g, mid, NULL, integral, error);
}

/* Of several sources, or lines, one may lie between the corners of a triangle, and none of their ways lead to it. */
static bool is_near_sources(const dmk_geodesics *g, int32_t t)
{
    const dmk_mesh *m = g->mesh;
    double longest = 0, nearest = HUGE_VAL;
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        const int32_t v = m->triangle[h];
        longest = dmk_max(longest, m->length[m->triangle_edge[h]]);
        nearest = dmk_min(nearest, g->distance[v] - offset_of(g, v));
    }
    return nearest < longest;
}

/* Exact distances at the centres of such triangles and at the middles of their edges. */
static int look_near_sources(dmk_context *ctx, const dmk_geodesics *g, double *mid, double *centre)
{
    int rc;
    dmk_tracer *t = NULL;
    DMK_TRY(dmk_tracer_create(ctx, g, &t));
    for (int32_t i = 0; i < g->mesh->n_triangles; i++) {
        centre[i] = NAN;
        if (!is_near_sources(g, i)) continue;
        const dmk_point inside = {i, {1 / 3., 1 / 3., 1 / 3.}};
        DMK_TRY(dmk_tracer_distance(ctx, t, &inside, centre + i));
        for (int k = 0; k < 3; k++) {
            const int32_t h = 3 * i + k, other = g->star.twin[h] / 3;
            if (g->star.twin[h] >= 0 && other < i && centre[other] >= 0)
                continue; /* has been looked at */
            dmk_point p = {i, {0.5, 0.5, 0.5}};
            p.weight[k] = 0;
            DMK_TRY(dmk_tracer_distance(ctx, t, &p, mid + g->mesh->triangle_edge[h]));
        }
        DMK_TRY(dmk_poll(ctx));
    }
done:
    dmk_tracer_destroy(&t);
    return rc;
}

static int integrate_all(dmk_context *ctx, const dmk_geodesics *g, double *integral, double *error)
{
    int rc;
    double *mid = NULL, *centre = NULL;
    DMK_TRY(DMK_NEW(ctx, mid, (size_t)g->mesh->n_edges));
    dmk_geodesics_midpoints(ctx, g, mid);
    if (g->n_sources > 1 || g->n_lines > 0) {
        DMK_TRY(DMK_NEW(ctx, centre, (size_t)g->mesh->n_triangles));
        DMK_TRY(look_near_sources(ctx, g, mid, centre));
    }
    rc = integrate(ctx, g, mid, centre, integral, error);
done:
    free(mid);
    free(centre);
    return rc;
}

int dmk_geodesics_integrate_finer(dmk_context *ctx, const dmk_geodesics *g, double *integral,
                                  double *error)
{
    int rc;
    dmk_finer f = {0};
    if (g->n_lines > 0 || !(*error > coarse * *integral)) return DMK_OK;
    DMK_TRY(dmk_finer_create(ctx, g, &f));
    if (f.own) rc = integrate_all(ctx, f.own, integral, error);
done:
    dmk_finer_free(&f);
    return rc;
}

int dmk_geodesics_integrate(dmk_context *ctx, const dmk_geodesics *g, double *integral,
                            double *error)
{
    int rc;
    if (dmk_missing(ctx, "geodesics", g, "integral", integral, "error", error)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_edges(ctx, g->mesh));
    DMK_TRY(integrate_all(ctx, g, integral, error));
    rc = dmk_geodesics_integrate_finer(ctx, g, integral, error);
done:
    return rc;
}
