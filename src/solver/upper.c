/* The upper bound: the cost of a flux that delivers f, the sum over the triangles T of |T| times the root mean
 * square of the flux over T's four parts. The flux is mu grad u, and what that fails to deliver,
 * r = f - A(mu) u, is sent along edges: each midpoint's r in halves to both ends, then the vertices' along a
 * spanning tree of T's edges, of heavy mu first. A flow a from i to j in a part s is the constant field
 * a (x_i - x_j) / |s|, whose cost alone is a times twice the length; the triangles beside an edge share it in the
 * ratio of their mu. What rounding may hide of r, row by row, goes the same ways. So the bound holds whatever the
 * iteration, the linear solver and single precision did; a u that solves A(mu) u = f makes it sharp. */
#include "solver/iteration.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Added to densities, so that they can be divided by. */
static const double tiny = 1e-30;
/* Of f, where the device has no double precision: of a float. */
static const double float_rounding = 6e-8;

enum { BINS = 1 << 11 }; /* of the bits of a float: eight for each power of 2 */

typedef struct router {
    dmk_iteration *o;
    const dmk_mesh *mesh;
    const dmk_counts *n;
    double *mu, *u;       /* elements, rows */
    double *r, *doubt;    /* rows: what is to be sent, and what rounding may hide of it */
    double *flow;         /* 2 for each edge, from its ends to its midpoint */
    double *cost;         /* of each triangle */
    double *mean;         /* 3 for each triangle: the flux; NULL: not wanted */
    int32_t *order;       /* edges, heavy ones first */
    int32_t *root;        /* vertices: the union-find forest */
    int32_t *links, *key; /* vertices: number of tree edges at it, and their exclusive or */
} router;

/* The rows of triangle t's nine links, at whose ends the flows below enter and leave. */
static void links_of(const router *p, int32_t t, int32_t a[9], int32_t b[9])
{
    const int32_t *corner = p->mesh->triangle + 3 * (size_t)t,
                  *mid = p->mesh->triangle_edge + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        a[3 * k] = p->n->vertex_row + corner[i];
        a[3 * k + 1] = p->n->vertex_row + corner[j];
        b[3 * k] = b[3 * k + 1] = mid[k];
        a[3 * k + 2] = mid[i];
        b[3 * k + 2] = mid[j];
    }
}

/* r = f - A(mu) u and its doubt, from f in r. */
static void subtract(const router *p)
{
    const bool wide = dmk_device_real(p->o->sys->device, DMK_OUTER) == sizeof(double);
    for (int32_t i = 0; i < p->n->n_rows; i++)
        p->doubt[i] = fabs(p->r[i]) * (wide ? DMK_ENERGY_ROUNDING : float_rounding);
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        int32_t a[9], b[9];
        links_of(p, t, a, b);
        for (int l = 0; l < 9; l++) {
            const double w = p->mu[t] * dmk_cot(p->mesh, 3 * t + l / 3);
            const double flow = (l % 3 < 2 ? 0.5 : 1) * w * (p->u[a[l]] - p->u[b[l]]);
            p->r[a[l]] -= flow;
            p->r[b[l]] += flow;
            p->doubt[a[l]] += DMK_ENERGY_ROUNDING * fabs(flow);
            p->doubt[b[l]] += DMK_ENERGY_ROUNDING * fabs(flow);
        }
    }
}

/* The midpoints' r to the ends; the cost of the doubt. */
static double send_midpoints(const router *p)
{
    const dmk_mesh *m = p->mesh;
    double cost = 0;
    for (int32_t e = 0; e < m->n_edges; e++) {
        cost += m->length[e] * p->doubt[e];
        for (int k = 0; k < 2; k++) {
            const int32_t v = p->n->vertex_row + m->edge_vertex[2 * (size_t)e + (size_t)k];
            p->flow[2 * (size_t)e + (size_t)k] = -0.5 * p->r[e];
            p->r[v] += 0.5 * p->r[e];
            p->doubt[v] += 0.5 * p->doubt[e];
        }
    }
    return cost;
}

/* The bin of the larger mu beside an edge; large ones come first. */
static int bin_of(const router *p, int32_t e)
{
    const int32_t *t = p->mesh->edge_triangle + 2 * (size_t)e;
    const double mu = t[1] < 0 ? p->mu[t[0]] : fmax(p->mu[t[0]], p->mu[t[1]]);
    const union {
        float f;
        uint32_t bits;
    } key = {.f = (float)fmax(mu, tiny)};
    return BINS - 1 - (int)(key.bits >> 20);
}

static void sort_edges(const router *p)
{
    int32_t first[BINS + 1] = {0};
    for (int32_t e = 0; e < p->mesh->n_edges; e++) first[bin_of(p, e) + 1]++;
    for (int b = 0; b < BINS; b++) first[b + 1] += first[b];
    for (int32_t e = 0; e < p->mesh->n_edges; e++) p->order[first[bin_of(p, e)]++] = e;
}

static int32_t find(int32_t *root, int32_t v)
{
    while (root[v] != v) {
        root[v] = root[root[v]];
        v = root[v];
    }
    return v;
}

/* Kruskal's spanning tree. */
static void grow_tree(const router *p)
{
    int32_t left = p->mesh->n_vertices - 1;
    sort_edges(p);
    for (int32_t v = 0; v < p->mesh->n_vertices; v++) p->root[v] = v;
    for (int32_t i = 0; left > 0 && i < p->mesh->n_edges; i++) {
        const int32_t e = p->order[i], *end = p->mesh->edge_vertex + 2 * (size_t)e;
        const int32_t a = find(p->root, end[0]), b = find(p->root, end[1]);
        if (a == b) continue;
        p->root[a] = b;
        left--;
        for (int k = 0; k < 2; k++) {
            p->links[end[k]]++;
            p->key[end[k]] ^= e;
        }
    }
}

/* The vertices' r along the tree, of which leaf after leaf is cut off; the cost of the doubt. */
static double send_vertices(const router *p)
{
    const dmk_mesh *m = p->mesh;
    double *r = p->r + p->n->vertex_row, *doubt = p->doubt + p->n->vertex_row, cost = 0;
    for (int32_t i = 0; i < m->n_vertices; i++) {
        for (int32_t v = i; p->links[v] == 1;) {
            const int32_t e = p->key[v], *end = m->edge_vertex + 2 * (size_t)e;
            const size_t mine = 2 * (size_t)e + (end[1] == v),
                         other = 2 * (size_t)e + (end[0] == v);
            const int32_t w = end[0] == v ? end[1] : end[0];
            p->flow[mine] += r[v];
            p->flow[other] -= r[v];
            cost += 2 * m->length[e] * doubt[v];
            r[w] += r[v];
            doubt[w] += doubt[v];
            p->links[v]--;
            p->links[w]--;
            p->key[w] ^= e;
            v = w;
        }
    }
    return cost;
}

/* What triangle t has of the flows at its corner k, along its edges i and j. */
static void corner_flows(const router *p, int32_t t, int k, double flow[2])
{
    const dmk_mesh *m = p->mesh;
    const int32_t here = m->triangle[3 * (size_t)t + (size_t)k];
    for (int side = 0; side < 2; side++) {
        const int32_t e = m->triangle_edge[3 * (size_t)t + (size_t)((k + 1 + side) % 3)],
                      *beside = m->edge_triangle + 2 * (size_t)e;
        const double sum = p->mu[beside[0]] + (beside[1] < 0 ? -tiny : p->mu[beside[1]]);
        flow[side] = p->flow[2 * (size_t)e + (m->edge_vertex[2 * (size_t)e + 1] == here)] *
                     (p->mu[t] + tiny) / (sum + 2 * tiny);
    }
}

/* |T| times the root mean square of the flux, with its rounding on top. */
static double cost_of(const router *p, int32_t t)
{
    const dmk_mesh *m = p->mesh;
    const int32_t *edge = m->triangle_edge + 3 * (size_t)t;
    const double area = m->area[t], mu = p->mu[t];
    double sum = 0, size = 0, flow[2], square[3];
    int32_t a[9], b[9];
    links_of(p, t, a, b);
    for (int k = 0; k < 3; k++) square[k] = m->length[edge[k]] * m->length[edge[k]];
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        double steep = 0;
        for (int l = 0; l < 3; l++) {
            const double d = p->u[a[3 * k + l]] - p->u[b[3 * k + l]];
            steep += (l < 2 ? 0.5 : 1) * d * d;
        }
        corner_flows(p, t, k, flow);
        const double here = p->u[p->n->vertex_row + m->triangle[3 * (size_t)t + (size_t)k]];
        const double term = mu * mu * dmk_cot(m, 3 * t + k) * steep;
        const double mixed =
            2 * mu * (flow[0] * (here - p->u[edge[i]]) + flow[1] * (here - p->u[edge[j]]));
        const double own = (flow[0] * flow[0] * square[i] + flow[1] * flow[1] * square[j] +
                            flow[0] * flow[1] * (square[i] + square[j] - square[k])) /
                           area;
        sum += term + mixed + own;
        size += fabs(term) + fabs(mixed) + fabs(own);
    }
    return sqrt(area * (fmax(sum, 0) + DMK_ENERGY_ROUNDING * size));
}

static void cost_range(int32_t begin, int32_t end, void *data)
{
    const router *p = data;
    for (int32_t t = begin; t < end; t++) p->cost[t] = cost_of(p, t);
}

/* ---- the flux itself -------------------------------------------------------------------------- */

/* mean[t] = the mean over triangle t of -mu grad u and the flows: grad u from the values at its six nodes. */
static void mean_range(int32_t begin, int32_t end, void *data)
{
    const router *p = data;
    const dmk_mesh *m = p->mesh;
    for (int32_t t = begin; t < end; t++) {
        double x[3][3], value[3], *mean = p->mean + 3 * (size_t)t;
        const int32_t *corner = m->triangle + 3 * (size_t)t,
                      *edge = m->triangle_edge + 3 * (size_t)t;
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            memcpy(x[k], m->xyz + 3 * (size_t)corner[k], sizeof x[k]);
            value[k] = 0.5 * p->mu[t] *
                       (p->u[p->n->vertex_row + corner[k]] + p->u[edge[i]] + p->u[edge[j]] -
                        p->u[edge[k]]);
            mean[k] = 0;
        }
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            /* grad phi_k is half the sum of the sides at k, each times the cotangent opposite, over the area. */
            const double to_j = dmk_cot(m, 3 * t + j) * value[k],
                         to_i = dmk_cot(m, 3 * t + i) * value[k];
            for (int c = 0; c < 3; c++)
                mean[c] -=
                    0.5 * (to_j * (x[k][c] - x[i][c]) + to_i * (x[k][c] - x[j][c])) / m->area[t];
        }
        for (int k = 0; k < 3; k++) {
            double flow[2];
            corner_flows(p, t, k, flow);
            /* Edge i joins k and j, edge j k and i; the flows go half the way. */
            for (int c = 0; c < 3; c++)
                mean[c] -= 0.5 *
                           (flow[0] * (x[k][c] - x[(k + 2) % 3][c]) +
                            flow[1] * (x[k][c] - x[(k + 1) % 3][c])) /
                           m->area[t];
        }
    }
}

/* The most that the flux fails to deliver to a row, over the largest f. */
static double worst_balance(const router *p, double *f)
{
    double worst = 0, size = tiny;
    for (int32_t i = 0; i < p->n->n_rows; i++) size = fmax(size, fabs(f[i]));
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        const int32_t *edge = p->mesh->triangle_edge + 3 * (size_t)t;
        int32_t a[9], b[9];
        links_of(p, t, a, b);
        for (int k = 0; k < 3; k++) {
            const int32_t here = p->n->vertex_row + p->mesh->triangle[3 * (size_t)t + (size_t)k];
            double flow[2];
            corner_flows(p, t, k, flow);
            for (int side = 0; side < 2; side++) {
                f[here] -= flow[side];
                f[edge[(k + 1 + side) % 3]] += flow[side];
            }
            for (int l = 3 * k; l < 3 * k + 3; l++) {
                const double w = p->mu[t] * dmk_cot(p->mesh, 3 * t + k);
                const double down = (l % 3 < 2 ? 0.5 : 1) * w * (p->u[a[l]] - p->u[b[l]]);
                f[a[l]] -= down;
                f[b[l]] += down;
            }
        }
    }
    for (int32_t i = 0; i < p->n->n_rows; i++) worst = fmax(worst, fabs(f[i]));
    return worst / size;
}

/* ---- all of it -------------------------------------------------------------------------------- */

static int allocate(router *p)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    const size_t rows = (size_t)p->n->n_rows_pad, edges = (size_t)p->n->n_edges,
                 vertices = (size_t)p->n->n_vertices;
    DMK_TRY(DMK_NEW(ctx, p->mu, (size_t)p->n->n_elements_pad));
    DMK_TRY(DMK_NEW(ctx, p->u, rows));
    DMK_TRY(DMK_NEW(ctx, p->r, rows));
    DMK_TRY(DMK_NEW(ctx, p->doubt, rows));
    p->cost = p->doubt; /* which are sent by then */
    DMK_TRY(DMK_NEW(ctx, p->flow, 2 * edges));
    DMK_TRY(DMK_NEW(ctx, p->order, edges));
    DMK_TRY(DMK_NEW(ctx, p->root, vertices));
    DMK_TRY(DMK_NEW(ctx, p->links, vertices));
    DMK_TRY(DMK_NEW(ctx, p->key, vertices));
done:
    return rc;
}

static void release(router *p)
{
    free(p->mu);
    free(p->u);
    free(p->r);
    free(p->doubt);
    free(p->flow);
    free(p->order);
    free(p->root);
    free(p->links);
    free(p->key);
}

static double route(router *p)
{
    double cost = 0;
    subtract(p);
    cost += send_midpoints(p);
    grow_tree(p);
    cost += send_vertices(p);
    dmk_parallel(p->o->ctx, p->mesh->n_triangles, cost_range, p);
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) cost += p->cost[t];
    return cost / p->o->sys->unit;
}

int dmk_bound_upper(dmk_iteration *o, double *flux, double *balance, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    router p = {.o = o, .mesh = o->mesh, .n = &s->whole, .mean = flux};
    DMK_TRY(allocate(&p));
    DMK_TRY(dmk_elements_read(o->ctx, s, s->mu, p.mu));
    DMK_TRY(dmk_rows_read(o->ctx, s, s->u, p.u));
    DMK_TRY(dmk_rows_read(o->ctx, s, s->f, p.r));
    *bound = route(&p);
    if (flux) dmk_parallel(o->ctx, o->mesh->n_triangles, mean_range, &p);
    if (balance) {
        DMK_TRY(dmk_rows_read(o->ctx, s, s->f, p.r));
        *balance = worst_balance(&p, p.r);
    }
done:
    release(&p);
    return rc;
}
