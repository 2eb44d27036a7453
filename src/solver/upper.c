/* The upper bound: the cost of a flux that delivers f, the sum over the triangles T of |T| times the root mean
 * square of the flux over T's four parts. The flux is mu grad u, and what that fails to deliver,
 * r = f - A(mu) u, is sent along edges: each midpoint's r in halves to both ends, then the vertices' along a
 * spanning tree of T's edges, of heavy mu first (tree.c). A flow a from i to j in a part s is the constant field
 * a (x_i - x_j) / |s|, whose cost alone is a times twice the length; the triangles beside an edge share it in the
 * ratio of their mu. What rounding may hide of r, row by row, goes the same ways. So the bound holds whatever the
 * iteration, the linear solver and single precision did; a u that solves A(mu) u = f makes it sharp. */
#include "solver/iteration.h"

#include "base/parallel.h"
#include "solver/tree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Added to densities, so that they can be divided by. */
static const double tiny = 1e-30;

/* begin .. end - 1 */
typedef struct span {
    int32_t begin, end;
} span;

/* A device buffer in whose memory an array lies. */
typedef struct loan {
    dmk_buffer *from;
    double *at;
} loan;

enum { LOANS = 5 };

typedef struct router {
    dmk_iteration *o;
    dmk_share *share; /* NULL: all is the whole mesh's; else local, with ghosts */
    const dmk_mesh *mesh;
    dmk_counts n;         /* of `mesh` */
    span elements, edges; /* the own ones */
    double *mu, *u;       /* elements, rows */
    double *r, *rounding; /* rows: what is to be sent, and a bound of the rounding error in it */
    double *half, *sent;  /* edges: from the ends to the midpoint go half + sent and half - sent */
    double *beside;       /* edges, once the rounding is sent: 1 over the sum of both sides' mu */
    double *cost;         /* of each own triangle */
    double *mean;         /* 3 for each triangle: the flux; NULL: not wanted */
    loan loan[LOANS];     /* all of mu, u, r, rounding and sent, or none */
    int n_loans;
} router;

/* What triangle t's part of the flux takes from its corners, 0 to 2, and from the middles of its edges, 3 to 5: of
 * mu grad u and, if they are not NULL, of the flows at its corners, see flows_of. `size`: the sum of their sizes. */
static void leave(const router *p, int32_t t, double (*flow)[3], double net[6], double size[6])
{
    const int32_t *corner = p->mesh->triangle + 3 * (size_t)t,
                  *edge = p->mesh->triangle_edge + 3 * (size_t)t;
    double end[3], mid[3], cot[3];
    dmk_cots(p->mesh, t, cot);
    for (int k = 0; k < 3; k++) {
        end[k] = p->u[p->n.vertex_row + corner[k]];
        mid[k] = p->u[edge[k]];
        net[k] = net[3 + k] = size[k] = size[3 + k] = 0;
    }
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double w = p->mu[t] * cot[k];
        const double across = w * (mid[i] - mid[j]),
                     from_i = 0.5 * w * (end[i] - mid[k]) + (flow ? flow[i][k] : 0),
                     from_j = 0.5 * w * (end[j] - mid[k]) + (flow ? flow[j][k] : 0);
        net[i] += from_i;
        net[j] += from_j;
        net[3 + k] -= from_i + from_j;
        net[3 + i] += across;
        net[3 + j] -= across;
        size[i] += fabs(from_i);
        size[j] += fabs(from_j);
        size[3 + k] += fabs(from_i) + fabs(from_j);
        size[3 + i] += fabs(across);
        size[3 + j] += fabs(across);
    }
}

/* r = f - A(mu) u and a bound of its rounding error, from f in r. */
static void subtract(const router *p)
{
    const bool wide = dmk_device_real(p->o->sys->device, DMK_OUTER) == sizeof(double);
    for (int32_t i = 0; i < p->n.n_rows; i++)
        p->rounding[i] = fabs(p->r[i]) * (wide ? DMK_ENERGY_ROUNDING : DMK_FLOAT_ROUNDING);
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        double net[6], size[6];
        leave(p, t, NULL, net, size);
        for (int k = 0; k < 3; k++) {
            const int32_t v = p->n.vertex_row + p->mesh->triangle[3 * (size_t)t + (size_t)k],
                          e = p->mesh->triangle_edge[3 * (size_t)t + (size_t)k];
            p->r[v] -= net[k];
            p->r[e] -= net[3 + k];
            p->rounding[v] += DMK_ENERGY_ROUNDING * size[k];
            p->rounding[e] += DMK_ENERGY_ROUNDING * size[3 + k];
        }
    }
}

/* The midpoints' r to the ends. */
static void send_midpoints(const router *p)
{
    const dmk_mesh *m = p->mesh;
    for (int32_t e = 0; e < m->n_edges; e++) {
        for (int k = 0; k < 2; k++) {
            const int32_t v = p->n.vertex_row + m->edge_vertex[2 * (size_t)e + (size_t)k];
            p->r[v] += 0.5 * p->r[e];
            p->rounding[v] += 0.5 * p->rounding[e];
        }
        p->half[e] *= -0.5;
        p->sent[e] = p->rounding[e] = 0;
    }
}

/* What it costs to send the rounding errors of the midpoints. */
static void add_rounding(void *data, double *cost)
{
    const router *p = data;
    for (int32_t e = p->edges.begin; e < p->edges.end; e++)
        *cost += p->mesh->length[e] * p->rounding[e];
}

/* The bin of the larger mu beside an edge; large ones come first. */
static int bin_of(const void *data, int32_t e)
{
    const router *p = data;
    const int32_t *t = p->mesh->edge_triangle + 2 * (size_t)e;
    const double mu = t[1] < 0 ? p->mu[t[0]] : fmax(p->mu[t[0]], p->mu[t[1]]);
    const union {
        float f;
        uint32_t bits;
    } key = {.f = (float)fmax(mu, tiny)};
    return DMK_TREE_BINS - 1 - (int)(key.bits >> 20); /* eight for each power of 2 */
}

/* Of the vertices' r; the errors that edges carry take the place of the midpoints'. */
static dmk_tree tree_of(const router *p)
{
    dmk_tree tree = {.share = p->share,
                     .mesh = p->mesh,
                     .vertices = {0, p->mesh->n_vertices},
                     .edges = {p->edges.begin, p->edges.end},
                     .bin = bin_of,
                     .user = p,
                     .load = p->r + p->n.vertex_row,
                     .error = p->rounding + p->n.vertex_row,
                     .sent = p->sent,
                     .carried = p->rounding};
    if (p->share) {
        const dmk_space *vertex = &p->share->vertex[0];
        tree.vertices[0] = vertex->at_first;
        tree.vertices[1] = vertex->at_first + vertex->end - vertex->first;
    }
    return tree;
}

static int grow_tree(dmk_context *ctx, void *data)
{
    return dmk_tree_grow(ctx, data);
}

static void add_carried(void *data, double *cost)
{
    const router *p = data;
    for (int32_t e = p->edges.begin; e < p->edges.end; e++)
        *cost += 2 * p->mesh->length[e] * p->rounding[e];
}

/* ---- costs ------------------------------------------------------------------------------------ */

/* The inverse of what both sides of each own edge have of mu together. */
static void add_sides(const router *p)
{
    for (int32_t e = p->edges.begin; e < p->edges.end; e++) {
        const int32_t *t = p->mesh->edge_triangle + 2 * (size_t)e;
        p->beside[e] = 1 / (p->mu[t[0]] + (t[1] < 0 ? 0 : p->mu[t[1]] + tiny) + tiny);
    }
}

/* What triangle t has of the flows at its corners: flow[k][i] at corner k towards the middle of edge i. */
static void flows_of(const router *p, int32_t t, double flow[3][3])
{
    const dmk_mesh *m = p->mesh;
    const int32_t *corner = m->triangle + 3 * (size_t)t, *edge = m->triangle_edge + 3 * (size_t)t;
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        const int32_t e = edge[i];
        const double share = (p->mu[t] + tiny) * p->beside[e], half = p->half[e],
                     sent = m->edge_vertex[2 * (size_t)e] == corner[j] ? p->sent[e] : -p->sent[e];
        flow[j][i] = (half + sent) * share;
        flow[k][i] = (half - sent) * share;
    }
}

/* |T| times the root mean square of the flux, with its rounding on top. */
static double cost_of(const router *p, int32_t t)
{
    const dmk_mesh *m = p->mesh;
    const int32_t *corner = m->triangle + 3 * (size_t)t, *edge = m->triangle_edge + 3 * (size_t)t;
    const double area = m->area[t], mu = p->mu[t], per_area = 1 / area;
    double sum = 0, size = 0, flow[3][3], square[3], end[3], mid[3], cot[3];
    flows_of(p, t, flow);
    dmk_cots(m, t, cot);
    for (int k = 0; k < 3; k++) {
        square[k] = m->length[edge[k]] * m->length[edge[k]];
        end[k] = p->u[p->n.vertex_row + corner[k]];
        mid[k] = p->u[edge[k]];
    }
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double a = end[i] - mid[k], b = end[j] - mid[k], c = mid[i] - mid[j];
        const double to_i = flow[k][i], to_j = flow[k][j];
        const double term = mu * mu * cot[k] * (0.5 * (a * a + b * b) + c * c);
        const double mixed = 2 * mu * (to_i * (end[k] - mid[i]) + to_j * (end[k] - mid[j]));
        const double own = (to_i * to_i * square[i] + to_j * to_j * square[j] +
                            to_i * to_j * (square[i] + square[j] - square[k])) *
                           per_area;
        sum += term + mixed + own;
        size += fabs(term) + fabs(mixed) + fabs(own);
    }
    return sqrt(area * (fmax(sum, 0) + DMK_ENERGY_ROUNDING * size));
}

static void cost_range(int32_t begin, int32_t end, void *data)
{
    const router *p = data;
    const int32_t first = p->elements.begin;
    for (int32_t i = begin; i < end; i++) p->cost[i] = cost_of(p, first + i);
}

static void add_costs(void *data, double *cost)
{
    const router *p = data;
    for (int32_t i = 0; i < p->elements.end - p->elements.begin; i++) *cost += p->cost[i];
}

/* ---- the flux itself -------------------------------------------------------------------------- */

/* mean[t] = the mean over triangle t of -mu grad u and the flows: grad u from the values at its six nodes. By the area
 * in space its corners receive what goes through the triangle also where lengths are those of a thicker one. */
static void mean_range(int32_t begin, int32_t end, void *data)
{
    const router *p = data;
    const dmk_mesh *m = p->mesh;
    for (int32_t t = begin; t < end; t++) {
        const double per_area = 0.5 / dmk_area_in_space(m, t);
        double x[3][3], cot[3], value[3], flow[3][3], *mean = p->mean + 3 * (size_t)t;
        const int32_t *corner = m->triangle + 3 * (size_t)t,
                      *edge = m->triangle_edge + 3 * (size_t)t;
        dmk_cots(m, t, cot);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            memcpy(x[k], m->xyz + 3 * (size_t)corner[k], sizeof x[k]);
            value[k] =
                0.5 * p->mu[t] *
                (p->u[p->n.vertex_row + corner[k]] + p->u[edge[i]] + p->u[edge[j]] - p->u[edge[k]]);
            mean[k] = 0;
        }
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            /* grad phi_k is half the sum of the sides at k, each times the cotangent opposite, over the area. */
            const double to_j = cot[j] * value[k], to_i = cot[i] * value[k];
            for (int c = 0; c < 3; c++)
                mean[c] -= (to_j * (x[k][c] - x[i][c]) + to_i * (x[k][c] - x[j][c])) * per_area;
        }
        flows_of(p, t, flow);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            /* Edge i joins k and j, edge j k and i; the flows go half the way. */
            for (int c = 0; c < 3; c++)
                mean[c] -= (flow[k][i] * (x[k][c] - x[j][c]) + flow[k][j] * (x[k][c] - x[i][c])) *
                           per_area;
        }
    }
}

/* The most that the flux fails to deliver to a row, over the largest f. */
static double worst_balance(const router *p, double *f)
{
    double worst = 0, size = tiny;
    for (int32_t i = 0; i < p->n.n_rows; i++) size = fmax(size, fabs(f[i]));
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        double flow[3][3], net[6], size_of[6];
        flows_of(p, t, flow);
        leave(p, t, flow, net, size_of);
        for (int k = 0; k < 3; k++) {
            f[p->n.vertex_row + p->mesh->triangle[3 * (size_t)t + (size_t)k]] -= net[k];
            f[p->mesh->triangle_edge[3 * (size_t)t + (size_t)k]] -= net[3 + k];
        }
    }
    for (int32_t i = 0; i < p->n.n_rows; i++) worst = fmax(worst, fabs(f[i]));
    return worst / size;
}

/* ---- all of it -------------------------------------------------------------------------------- */

/* n numbers in a buffer's memory, as it stands, or new ones. */
static int borrow(router *p, dmk_buffer *from, size_t n, double **at)
{
    int rc = DMK_OK;
    dmk_context *ctx = p->o->ctx;
    dmk_system *s = p->o->sys;
    /* With a share the buffers hold it alone, which is not enough where all of the mesh is wanted. */
    if (p->share == s->share) DMK_TRY(dmk_buffer_map(ctx, s->device, from, n, at));
    if (*at)
        p->loan[p->n_loans++] = (loan){from, *at};
    else
        DMK_TRY(DMK_NEW(ctx, *at, n));
done:
    return rc;
}

static void give_back(router *p, double **at)
{
    bool lent = false;
    for (int i = 0; i < p->n_loans; i++) {
        if (*at != p->loan[i].at) continue;
        dmk_buffer_unmap(p->o->sys->device, p->loan[i].from, *at);
        lent = true;
    }
    if (!lent) free(*at);
    *at = NULL;
}

/* Conjugate gradients are at rest: their vectors' rows are free, but for the padding, which stays 0. */
static int allocate(router *p)
{
    int rc;
    const dmk_system *s = p->o->sys;
    const size_t rows = (size_t)p->n.n_rows_pad;
    DMK_TRY(borrow(p, s->mu, (size_t)p->n.n_elements_pad, &p->mu));
    DMK_TRY(borrow(p, s->u, rows, &p->u));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].r, rows, &p->r));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].ap, rows, &p->rounding));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].p, rows, &p->sent));
    p->half = p->r;
done:
    return rc;
}

static void release(router *p)
{
    give_back(p, &p->mu);
    give_back(p, &p->u);
    give_back(p, &p->r);
    give_back(p, &p->rounding);
    give_back(p, &p->sent);
    free(p->cost);
}

/* mu, u, and f as r. */
static int read_pair(const router *p)
{
    int rc = DMK_OK;
    dmk_context *ctx = p->o->ctx;
    dmk_system *s = p->o->sys;
    const size_t elements = (size_t)p->n.n_elements_pad, rows = (size_t)p->n.n_rows_pad;
    if (p->share != s->share) {
        DMK_TRY(dmk_elements_read(ctx, s, s->mu, p->mu));
        DMK_TRY(dmk_rows_read(ctx, s, s->u, p->u));
        return dmk_rows_read(ctx, s, s->f, p->r);
    }
    if (p->n_loans == 0) { /* else they lie there */
        DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->mu, elements, p->mu));
        DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->u, rows, p->u));
    }
    rc = dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->f, rows, p->r);
done:
    return rc;
}

/* r, and the midpoints' sent. */
static int find_residuals(router *p, double *cost)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    subtract(p);
    DMK_TRY(dmk_share_ghosts(ctx, p->share, p->r));
    DMK_TRY(dmk_share_ghosts(ctx, p->share, p->rounding));
    DMK_TRY(dmk_share_in_turn(ctx, p->share, cost, add_rounding, p));
    send_midpoints(p);
done:
    return rc;
}

/* All r, by a tree that grows meanwhile. */
static int send_all(router *p, double *cost)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    dmk_tree tree = tree_of(p);
    dmk_task task;
    dmk_task_begin(ctx, &task, grow_tree, &tree);
    DMK_TRY(dmk_task_end(ctx, &task, find_residuals(p, cost)));
    DMK_TRY(dmk_tree_send(ctx, &tree));
    DMK_TRY(dmk_share_in_turn(ctx, p->share, cost, add_carried, p));
    rc = dmk_share_ghosts(ctx, p->share, p->sent);
done:
    dmk_tree_free(&tree);
    return rc;
}

static int route(router *p, double *bound)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    double cost = 0;
    DMK_TRY(send_all(p, &cost));
    p->beside = p->rounding; /* it is sent */
    DMK_TRY(DMK_NEW(ctx, p->cost, (size_t)(p->elements.end - p->elements.begin)));
    add_sides(p);
    DMK_TRY(dmk_share_ghosts(ctx, p->share, p->beside));
    dmk_parallel(ctx, p->elements.end - p->elements.begin, cost_range, p);
    DMK_TRY(dmk_share_in_turn(ctx, p->share, &cost, add_costs, p));
    *bound = cost / p->o->sys->unit;
done:
    return rc;
}

static int find_mean(dmk_context *own, void *data)
{
    const router *p = data;
    dmk_parallel(own, p->mesh->n_triangles, mean_range, data);
    return DMK_OK;
}

/* The mean flux and, by this thread meanwhile, the balance; either may be NULL. */
static int find_flux(router *p, double *balance)
{
    int rc = DMK_OK;
    dmk_context *ctx = p->o->ctx;
    dmk_task task = {0};
    double *f = NULL;
    if (p->mean) dmk_task_begin(ctx, &task, find_mean, p);
    if (balance) {
        DMK_TRY(DMK_NEW(ctx, f, (size_t)p->n.n_rows_pad));
        DMK_TRY(dmk_rows_read(ctx, p->o->sys, p->o->sys->f, f));
        *balance = worst_balance(p, f);
    }
done:
    rc = dmk_task_end(ctx, &task, rc);
    free(f);
    return rc;
}

int dmk_bound_upper(dmk_iteration *o, double *flux, double *balance, double enough, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    /* The flux itself is asked for over the whole mesh. */
    dmk_share *share = flux || balance ? NULL : s->share;
    router p = {.o = o, .share = share, .mesh = share ? &share->mesh : o->mesh, .mean = flux};
    p.n = dmk_system_counts(s->device, p.mesh);
    p.elements = (span){share ? share->element.at_first : 0, p.n.n_elements};
    p.edges = (span){share ? share->edge.at_first : 0, p.n.n_edges};
    if (share) {
        p.elements.end = p.elements.begin + share->element.end - share->element.first;
        p.edges.end = p.edges.begin + share->edge.end - share->edge.first;
    }
    DMK_TRY(dmk_send(o->ctx, dmk_ship_rows(share, DMK_OUTER, s->u)));
    DMK_TRY(allocate(&p));
    DMK_TRY(read_pair(&p));
    DMK_TRY(route(&p, bound));
    if (*bound <= enough) DMK_TRY(find_flux(&p, balance));
done:
    release(&p);
    return rc;
}
