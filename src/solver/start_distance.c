/* Fast marching with spherical waves: two distances at the ends of an edge place a virtual source
 * in the plane of the triangle behind it, and the third corner's distance is the straight line from
 * there. Exact wherever the surface unfolds flat between the source and the triangle.
 *
 * In an obtuse triangle the ray to the third corner may cross an edge one end of which is farther
 * from the source, hence accepted later. So an accepted vertex whose distance falls is queued
 * again: the update never grows when its inputs fall, and the repetition ends. */
#include "solver/start.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>

enum { max_visits = 12, heap_arity = 4 };

typedef struct march {
    const dmk_mesh *mesh;
    const dmk_vertex_stars *stars;
    double *d;       /* n_vertices */
    int32_t *heap;   /* queued vertices, a heap of four children by d */
    int32_t *place;  /* n_vertices: index in the heap, -1 if not queued */
    uint8_t *visits; /* n_vertices: how often accepted */
    int32_t n_heap;
} march;

static void heap_put(march *m, int32_t i, int32_t v)
{
    m->heap[i] = v;
    m->place[v] = i;
}

/* Put v into the hole at i, or above. */
static void heap_rise(march *m, int32_t i, int32_t v)
{
    while (i > 0) {
        int32_t parent = (i - 1) / heap_arity;
        if (m->d[m->heap[parent]] <= m->d[v]) break;
        heap_put(m, i, m->heap[parent]);
        i = parent;
    }
    heap_put(m, i, v);
}

/* Put v into the hole at i, or below. */
static void heap_sink(march *m, int32_t i, int32_t v)
{
    for (;;) {
        int32_t first = heap_arity * i + 1, best = first;
        if (first >= m->n_heap) break;
        int32_t end = dmk_min_i(first + heap_arity, m->n_heap);
        for (int32_t c = first + 1; c < end; c++) {
            if (m->d[m->heap[c]] < m->d[m->heap[best]]) best = c;
        }
        if (m->d[v] <= m->d[m->heap[best]]) break;
        heap_put(m, i, m->heap[best]);
        i = best;
    }
    heap_put(m, i, v);
}

static int32_t heap_pop(march *m)
{
    int32_t top = m->heap[0], last = m->heap[--m->n_heap];
    m->place[top] = -1;
    if (m->n_heap > 0) heap_sink(m, 0, last);
    return top;
}

/* Distance of C over the edge AB of length c from da and db; a = |BC|, b = |AC|, area of ABC. The
 * straight line if it crosses AB, else along an edge. */
static double unfold(double da, double db, double a, double b, double c, double area)
{
    double xc = (b * b + c * c - a * a) / (2 * c), yc = 2 * area / c;
    double xs = ((da - db) * (da + db) + c * c) / (2 * c);
    double ys2 = da * da - xs * xs, ys = ys2 > 0 ? sqrt(ys2) : 0;
    double cross = xs * yc + xc * ys; /* times yc + ys: the place of the crossing on AB */
    if (cross >= 0 && cross <= c * (yc + ys) && ys + yc > 0) {
        return sqrt((xc - xs) * (xc - xs) + (yc + ys) * (yc + ys));
    }
    return fmin(da + b, db + a);
}

/* Lower d[v] to `value`, and queue v. On a curved surface virtual sources do not quite agree, and
 * vertices may lower each other in a ring for ever: so each visit asks for a larger fall, in parts
 * of the way `step` to v. */
static void march_offer(march *m, int32_t v, double value, double step)
{
    static const double least_fall[max_visits] = {0,    0,    0,    1e-12, 1e-9, 1e-7,
                                                  1e-5, 1e-4, 1e-3, 1e-2,  1e-1, 1};
    if (!(value < m->d[v])) return;
    int visits = m->visits[v];
    if (visits >= max_visits || (visits > 0 && value > m->d[v] - least_fall[visits] * step)) return;
    m->d[v] = value;
    if (m->place[v] < 0) m->place[v] = m->n_heap++;
    heap_rise(m, m->place[v], v);
}

/* Triangle t offers its corner `to` a distance through its corner `from`, just accepted, and the
 * third corner if that was accepted too. */
static void march_triangle(march *m, int32_t t, int from, int to)
{
    const dmk_mesh *mesh = m->mesh;
    const int32_t *corner = mesh->triangle + 3 * (size_t)t;
    const int32_t *edge = mesh->triangle_edge + 3 * (size_t)t;
    int third = 3 - from - to;
    int32_t v = corner[from], x = corner[to], y = corner[third];
    double b = mesh->length[edge[third]];
    if (m->visits[y] == 0) {
        march_offer(m, x, m->d[v] + b, b);
        return;
    }
    /* The ray to x crosses vy. If v is the farther and |Sv| >= |Sx|, the angle at x is at least
     * acos(b / 2|Sx|): no use of sharper ones. */
    if (m->visits[x] > 0 && m->d[x] <= m->d[v] && b < 0.4 * m->d[x] &&
        dmk_cot(mesh, 3 * t + (int32_t)to) > 0.5) {
        return;
    }
    march_offer(m, x,
                unfold(m->d[v], m->d[y], mesh->length[edge[from]], b, mesh->length[edge[to]],
                       mesh->area[t]),
                b);
}

static void march_run(march *m)
{
    while (m->n_heap > 0) {
        int32_t v = heap_pop(m);
        m->visits[v]++;
        for (int32_t i = m->stars->row[v]; i < m->stars->row[v + 1]; i++) {
            int32_t t = m->stars->triangle[i] >> 2;
            int k = m->stars->triangle[i] & 3;
            march_triangle(m, t, k, (k + 1) % 3);
            march_triangle(m, t, k, (k + 2) % 3);
        }
    }
}

static double distance3(const double *x, const double *y)
{
    double dx = x[0] - y[0], dy = x[1] - y[1], dz = x[2] - y[2];
    return sqrt(dx * dx + dy * dy + dz * dz);
}

static void source_xyz(const dmk_mesh *mesh, const dmk_point *p, double *xyz)
{
    for (int i = 0; i < 3; i++) {
        xyz[i] = 0;
        for (int k = 0; k < 3; k++) {
            xyz[i] += p->weight[k] * mesh->xyz[3 * (size_t)mesh->triangle[3 * p->triangle + k] + i];
        }
    }
}

/* Exact distances in the source's own triangle. */
static void march_seed(march *m, const dmk_point *source)
{
    double p[3];
    source_xyz(m->mesh, source, p);
    for (int k = 0; k < 3; k++) {
        int32_t v = m->mesh->triangle[3 * source->triangle + k];
        march_offer(m, v, distance3(p, m->mesh->xyz + 3 * (size_t)v), 0);
    }
}

static int vertex_distance(dmk_context *ctx, const dmk_mesh *mesh, const dmk_point *source,
                           double *d)
{
    int rc;
    dmk_vertex_stars stars = {0};
    march m = {.mesh = mesh, .stars = &stars, .d = d};
    DMK_TRY(dmk_vertex_stars_create(ctx, mesh, &stars));
    DMK_TRY(DMK_NEW(ctx, m.heap, (size_t)mesh->n_vertices));
    DMK_TRY(DMK_NEW(ctx, m.place, (size_t)mesh->n_vertices));
    DMK_TRY(DMK_NEW(ctx, m.visits, (size_t)mesh->n_vertices));
    for (int32_t v = 0; v < mesh->n_vertices; v++) {
        d[v] = INFINITY;
        m.place[v] = -1;
    }
    march_seed(&m, source);
    march_run(&m);
done:
    dmk_vertex_stars_free(&stars);
    free(m.heap);
    free(m.place);
    free(m.visits);
    return rc;
}

typedef struct mid_job {
    const dmk_mesh *mesh;
    const double *d;
    double *mid;
} mid_job;

/* Distance of the midpoint of edge e, over the two other edges of triangle t: ABm and the others
 * are halves of it. */
static double midpoint_through(const mid_job *job, int32_t e, int32_t t)
{
    const dmk_mesh *mesh = job->mesh;
    const int32_t *edge = mesh->triangle_edge + 3 * (size_t)t;
    const int32_t *corner = mesh->triangle + 3 * (size_t)t;
    int k = edge[0] == e ? 0 : edge[1] == e ? 1 : 2, i = (k + 1) % 3, j = (k + 2) % 3;
    double a = mesh->length[edge[i]], b = mesh->length[edge[j]], c = mesh->length[e];
    double median = 0.5 * sqrt(fmax(0, 2 * a * a + 2 * b * b - c * c));
    double dk = job->d[corner[k]];
    return fmin(unfold(job->d[corner[i]], dk, median, 0.5 * c, b, 0.5 * mesh->area[t]),
                unfold(job->d[corner[j]], dk, median, 0.5 * c, a, 0.5 * mesh->area[t]));
}

static void midpoint_range(int32_t begin, int32_t end, void *data)
{
    const mid_job *job = data;
    for (int32_t e = begin; e < end; e++) {
        const int32_t *t = job->mesh->edge_triangle + 2 * (size_t)e;
        double d = midpoint_through(job, e, t[0]);
        if (t[1] >= 0) d = fmin(d, midpoint_through(job, e, t[1]));
        job->mid[e] = d;
    }
}

/* Midpoints of the source's triangle see the source itself, not a virtual one. */
static void midpoint_seed(const dmk_mesh *mesh, const dmk_point *source, double *mid)
{
    double p[3], m[3];
    source_xyz(mesh, source, p);
    for (int k = 0; k < 3; k++) {
        int32_t e = mesh->triangle_edge[3 * source->triangle + k];
        const double *a = mesh->xyz + 3 * (size_t)mesh->edge_vertex[2 * e];
        const double *b = mesh->xyz + 3 * (size_t)mesh->edge_vertex[2 * e + 1];
        for (int i = 0; i < 3; i++)
            m[i] = 0.5 * (a[i] + b[i]);
        mid[e] = fmin(mid[e], distance3(p, m));
    }
}

int dmk_start_distance(dmk_context *ctx, const dmk_mesh *mesh, const dmk_point *source,
                       double *d_vertex, double *d_mid)
{
    int rc;
    mid_job job = {mesh, d_vertex, d_mid};
    DMK_TRY(vertex_distance(ctx, mesh, source, d_vertex));
    dmk_parallel(ctx, mesh->n_edges, midpoint_range, &job);
    midpoint_seed(mesh, source, d_mid);
done:
    return rc;
}
