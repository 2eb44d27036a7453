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
    double *beside;       /* edges, once the rounding is sent: the sum of both sides' mu */
    double *cost;         /* of each own triangle */
    double *mean;         /* 3 for each triangle: the flux; NULL: not wanted */
    int32_t *order;       /* own edges, heavy ones first; room for two numbers a vertex at least */
    int32_t *root;        /* vertices: see `tree` */
    loan loan[LOANS];     /* all of mu, u, r, rounding and sent, or none */
    int n_loans;
} router;

/* A spanning tree of some vertices among edges that are given as a list. */
typedef struct tree {
    int32_t n_vertices;
    const int32_t *end; /* edge e's end vertices are end[stride * e] and the next number */
    size_t stride;
    const double *length; /* of edge e at length_stride * e */
    size_t length_stride;
    const int32_t
        *slot; /* of edge e's flow, at stride * e, negative where they are not wanted; NULL: e */
    int32_t *root;         /* vertices: the union-find forest */
    int32_t *degree, *key; /* vertices: number of tree edges at it, and their exclusive or */
} tree;

/* The rows of triangle t's nine edges, at whose ends the flows below enter and leave. */
static void edges_of(const router *p, int32_t t, int32_t a[9], int32_t b[9])
{
    const int32_t *corner = p->mesh->triangle + 3 * (size_t)t,
                  *mid = p->mesh->triangle_edge + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        a[3 * k] = p->n.vertex_row + corner[i];
        a[3 * k + 1] = p->n.vertex_row + corner[j];
        b[3 * k] = b[3 * k + 1] = mid[k];
        a[3 * k + 2] = mid[i];
        b[3 * k + 2] = mid[j];
    }
}

/* r = f - A(mu) u and a bound of its rounding error, from f in r. */
static void subtract(const router *p)
{
    const bool wide = dmk_device_real(p->o->sys->device, DMK_OUTER) == sizeof(double);
    for (int32_t i = 0; i < p->n.n_rows; i++)
        p->rounding[i] = fabs(p->r[i]) * (wide ? DMK_ENERGY_ROUNDING : float_rounding);
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        int32_t a[9], b[9];
        edges_of(p, t, a, b);
        for (int l = 0; l < 9; l++) {
            const double w = p->mu[t] * dmk_cot(p->mesh, 3 * t + l / 3);
            const double flow = (l % 3 < 2 ? 0.5 : 1) * w * (p->u[a[l]] - p->u[b[l]]);
            p->r[a[l]] -= flow;
            p->r[b[l]] += flow;
            p->rounding[a[l]] += DMK_ENERGY_ROUNDING * fabs(flow);
            p->rounding[b[l]] += DMK_ENERGY_ROUNDING * fabs(flow);
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
        p->half[e] = -0.5 * p->r[e]; /* may be r[e] itself */
        p->sent[e] = 0;
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
    return BINS - 1 - (int)(key.bits >> 20);
}

/* begin .. end - 1 into `order` by their bins, in each by their numbers. */
static void sort_by_bin(const void *data, int32_t begin, int32_t end,
                        int (*bin)(const void *data, int32_t i), int32_t *order)
{
    int32_t first[BINS + 1] = {0};
    for (int32_t i = begin; i < end; i++) first[bin(data, i) + 1]++;
    for (int b = 0; b < BINS; b++) first[b + 1] += first[b];
    for (int32_t i = begin; i < end; i++) order[first[bin(data, i)]++] = i;
}

static void sort_edges(const router *p)
{
    sort_by_bin(p, p->edges.begin, p->edges.end, bin_of, p->order);
}

static int32_t find(int32_t *root, int32_t v)
{
    while (root[v] != v) {
        root[v] = root[root[v]];
        v = root[v];
    }
    return v;
}

/* Kruskal's spanning tree, or forest, of n edges in this order, in which the chosen ones come first then; their
 * number. */
static int32_t grow_tree(const tree *t, int32_t n, int32_t *order)
{
    int32_t chosen = 0;
    for (int32_t v = 0; v < t->n_vertices; v++) t->root[v] = v;
    for (int32_t i = 0; chosen < t->n_vertices - 1 && i < n; i++) {
        const int32_t e = order[i], *end = t->end + t->stride * (size_t)e;
        const int32_t a = find(t->root, end[0]), b = find(t->root, end[1]);
        if (a == b) continue;
        t->root[a] = b;
        order[chosen++] = e;
    }
    return chosen;
}

static void join_tree(const tree *t, int32_t n, const int32_t *chosen)
{
    for (int32_t i = 0; i < n; i++) {
        const int32_t e = chosen[i], *end = t->end + t->stride * (size_t)e;
        for (int k = 0; k < 2; k++) {
            t->degree[end[k]]++;
            t->key[end[k]] ^= e;
        }
    }
}

/* The vertices' r along the tree, of which leaf after leaf is cut off; the cost of the rounding errors. */
static double send_vertices(const tree *t, double *r, double *rounding, double *sent)
{
    double cost = 0;
    for (int32_t i = 0; i < t->n_vertices; i++) {
        for (int32_t v = i; t->degree[v] == 1;) {
            const int32_t e = t->key[v], *end = t->end + t->stride * (size_t)e;
            const int32_t w = end[0] == v ? end[1] : end[0];
            const int32_t slot = t->slot ? t->slot[t->stride * (size_t)e] : e;
            if (slot >= 0) sent[slot] = end[0] == v ? r[v] : -r[v];
            cost += 2 * t->length[t->length_stride * (size_t)e] * rounding[v];
            r[w] += r[v];
            rounding[w] += rounding[v];
            t->degree[v]--;
            t->degree[w]--;
            t->key[w] ^= e;
            v = w;
        }
    }
    return cost;
}

/* The tree of the whole mesh. The forest, and the edges that are not chosen, give their room to it. */
static tree whole_tree(const router *p)
{
    const dmk_mesh *m = p->mesh;
    return (tree){.n_vertices = m->n_vertices,
                  .end = m->edge_vertex,
                  .stride = 2,
                  .length = m->length,
                  .length_stride = 1,
                  .root = p->root,
                  .degree = p->root,
                  .key = p->order + m->n_vertices};
}

static int plant(dmk_context *ctx, void *data)
{
    (void)ctx;
    const router *p = data;
    const size_t bytes = (size_t)p->mesh->n_vertices * sizeof(int32_t);
    const tree t = whole_tree(p);
    sort_edges(p);
    const int32_t chosen = grow_tree(&t, p->mesh->n_edges, p->order);
    memset(t.degree, 0, bytes);
    memset(t.key, 0, bytes);
    join_tree(&t, chosen, p->order);
    return DMK_OK;
}

/* All r on the whole mesh, by a tree that is made while r is. */
static int send_on_whole(router *p, double *cost)
{
    int rc;
    dmk_task task;
    const tree t = whole_tree(p);
    dmk_task_begin(p->o->ctx, &task, plant, p);
    subtract(p);
    add_rounding(p, cost);
    send_midpoints(p);
    DMK_TRY(dmk_task_end(p->o->ctx, &task, DMK_OK));
    *cost += send_vertices(&t, p->r + p->n.vertex_row, p->rounding + p->n.vertex_row, p->sent);
done:
    return rc;
}

/* ---- the tree of a mesh that is dealt out ------------------------------------------------------ */

/* An edge of the own edges' heaviest forest. The heaviest tree of the whole mesh is made of such edges alone, as
 * an edge that closes a circle of heavier ones is in neither. */
typedef struct branch {
    int32_t edge, end[2], bin; /* in the whole mesh */
    double length;
} branch;

/* Those of all ranks in the order of the whole mesh's edges, and the tree of them. */
typedef struct canopy {
    branch *branch;
    int32_t n;
    int32_t *order, *root, *degree, *key;
    double *r, *rounding; /* of the whole mesh's vertices */
} canopy;

static void canopy_free(canopy *c)
{
    free(c->branch);
    free(c->order);
    free(c->root);
    free(c->degree);
    free(c->key);
    free(c->r);
    free(c->rounding);
}

static int compare_branches(const void *a, const void *b)
{
    const branch *x = a, *y = b;
    return (x->edge > y->edge) - (x->edge < y->edge);
}

/* The own forest; *n branches, the caller's to free. */
static int list_branches(const router *p, branch **list, int32_t *n)
{
    int rc;
    const dmk_mesh *m = p->mesh;
    const tree t = {
        .n_vertices = m->n_vertices, .end = m->edge_vertex, .stride = 2, .root = p->root};
    sort_edges(p);
    *n = grow_tree(&t, p->edges.end - p->edges.begin, p->order);
    DMK_TRY(DMK_NEW(p->o->ctx, *list, (size_t)*n));
    for (int32_t i = 0; i < *n; i++) {
        const int32_t e = p->order[i], *end = m->edge_vertex + 2 * (size_t)e;
        const dmk_space *vertex = &p->share->vertex[0];
        (*list)[i] = (branch){p->share->edge.whole[e],
                              {vertex->whole[end[0]], vertex->whole[end[1]]},
                              bin_of(p, e),
                              m->length[e]};
    }
    qsort(*list, (size_t)*n, sizeof **list, compare_branches);
done:
    return rc;
}

static int branch_bin(const void *data, int32_t i)
{
    const canopy *c = data;
    return c->branch[i].bin;
}

static tree branch_tree(const router *p, const canopy *c)
{
    return (tree){.n_vertices = p->o->sys->whole.n_vertices,
                  .end = c->branch[0].end,
                  .stride = sizeof(branch) / sizeof(int32_t),
                  .length = &c->branch[0].length,
                  .length_stride = sizeof(branch) / sizeof(double),
                  .slot = &c->branch[0].edge,
                  .root = c->root,
                  .degree = c->degree,
                  .key = c->key};
}

/* r and rounding of all vertices; the own ones are not read again, nor is u for a while. */
static int gather_loads(router *p, canopy *c)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    const size_t vertices = (size_t)p->o->sys->whole.n_vertices;
    free(p->u);
    p->u = NULL;
    DMK_TRY(DMK_NEW(ctx, c->r, vertices));
    DMK_TRY(dmk_share_give_vertices(ctx, p->share, p->r + p->n.vertex_row, c->r));
    free(p->r);
    p->r = NULL;
    DMK_TRY(DMK_NEW(ctx, c->rounding, vertices));
    DMK_TRY(dmk_share_give_vertices(ctx, p->share, p->rounding + p->n.vertex_row, c->rounding));
    free(p->rounding);
    p->rounding = NULL;
done:
    return rc;
}

static int gather_branches(router *p, canopy *c)
{
    int rc;
    branch *own = NULL;
    int32_t n_own;
    DMK_TRY(list_branches(p, &own, &n_own));
    free(p->order);
    free(p->root);
    p->order = p->root = NULL;
    rc = dmk_share_join(p->o->ctx, p->share, (size_t)n_own, sizeof *own, own, &c->n,
                        (void **)&c->branch);
done:
    free(own);
    return rc;
}

/* The branches of all ranks, and the tree among them. */
static int gather_canopy(router *p, canopy *c)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    const size_t vertices = (size_t)p->o->sys->whole.n_vertices;
    DMK_TRY(gather_branches(p, c));
    DMK_TRY(DMK_NEW(ctx, c->order, (size_t)c->n));
    DMK_TRY(DMK_NEW(ctx, c->root, vertices));
    sort_by_bin(c, 0, c->n, branch_bin, c->order);
    tree t = branch_tree(p, c);
    const int32_t chosen = grow_tree(&t, c->n, c->order);
    free(c->root);
    c->root = NULL;
    DMK_TRY(DMK_NEW(ctx, c->degree, vertices));
    DMK_TRY(DMK_NEW(ctx, c->key, vertices));
    t = branch_tree(p, c);
    join_tree(&t, chosen, c->order);
    free(c->order);
    c->order = NULL;
done:
    return rc;
}

/* Every rank sends along the whole tree, and keeps the flows of the edges that it has. */
static int send_along_branches(router *p, double *cost)
{
    int rc;
    canopy c = {.n = 0};
    DMK_TRY(gather_loads(p, &c));
    DMK_TRY(gather_canopy(p, &c));
    for (int32_t i = 0; i < c.n; i++)
        c.branch[i].edge = dmk_space_slot(&p->share->edge, c.branch[i].edge);
    const tree t = branch_tree(p, &c);
    *cost += send_vertices(&t, c.r, c.rounding, p->sent);
done:
    canopy_free(&c);
    return rc;
}

/* ---- costs ------------------------------------------------------------------------------------ */

/* What both sides of each own edge have of mu together. */
static void add_sides(const router *p)
{
    for (int32_t e = p->edges.begin; e < p->edges.end; e++) {
        const int32_t *t = p->mesh->edge_triangle + 2 * (size_t)e;
        p->beside[e] = p->mu[t[0]] + (t[1] < 0 ? -tiny : p->mu[t[1]]);
    }
}

/* What triangle t has of the flows at its corner k, along its edges i and j. */
static void corner_flows(const router *p, int32_t t, int k, double flow[2])
{
    const dmk_mesh *m = p->mesh;
    const int32_t here = m->triangle[3 * (size_t)t + (size_t)k];
    for (int side = 0; side < 2; side++) {
        const int32_t e = m->triangle_edge[3 * (size_t)t + (size_t)((k + 1 + side) % 3)];
        const double sent = m->edge_vertex[2 * (size_t)e + 1] == here ? -p->sent[e] : p->sent[e];
        flow[side] = (p->half[e] + sent) * (p->mu[t] + tiny) / (p->beside[e] + 2 * tiny);
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
    edges_of(p, t, a, b);
    for (int k = 0; k < 3; k++) square[k] = m->length[edge[k]] * m->length[edge[k]];
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        double steep = 0;
        for (int l = 0; l < 3; l++) {
            const double d = p->u[a[3 * k + l]] - p->u[b[3 * k + l]];
            steep += (l < 2 ? 0.5 : 1) * d * d;
        }
        corner_flows(p, t, k, flow);
        const double here = p->u[p->n.vertex_row + m->triangle[3 * (size_t)t + (size_t)k]];
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
    const int32_t first = p->elements.begin;
    for (int32_t i = begin; i < end; i++) p->cost[i] = cost_of(p, first + i);
}

static void add_costs(void *data, double *cost)
{
    const router *p = data;
    for (int32_t i = 0; i < p->elements.end - p->elements.begin; i++) *cost += p->cost[i];
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
            value[k] =
                0.5 * p->mu[t] *
                (p->u[p->n.vertex_row + corner[k]] + p->u[edge[i]] + p->u[edge[j]] - p->u[edge[k]]);
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
    for (int32_t i = 0; i < p->n.n_rows; i++) size = fmax(size, fabs(f[i]));
    for (int32_t t = 0; t < p->mesh->n_triangles; t++) {
        const int32_t *edge = p->mesh->triangle_edge + 3 * (size_t)t;
        int32_t a[9], b[9];
        edges_of(p, t, a, b);
        for (int k = 0; k < 3; k++) {
            const int32_t here = p->n.vertex_row + p->mesh->triangle[3 * (size_t)t + (size_t)k];
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
    /* With a share the buffers hold it alone, and what is sent takes turns with what is read again. */
    if (!s->share) DMK_TRY(dmk_buffer_map(ctx, s->device, from, n, at));
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
    dmk_context *ctx = p->o->ctx;
    const dmk_system *s = p->o->sys;
    const size_t rows = (size_t)p->n.n_rows_pad, edges = (size_t)p->n.n_edges,
                 vertices = (size_t)p->n.n_vertices;
    DMK_TRY(borrow(p, s->mu, (size_t)p->n.n_elements_pad, &p->mu));
    DMK_TRY(borrow(p, s->u, rows, &p->u));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].r, rows, &p->r));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].ap, rows, &p->rounding));
    DMK_TRY(borrow(p, s->cg[DMK_OUTER].p, edges, &p->sent));
    if (p->share)
        DMK_TRY(DMK_NEW(ctx, p->half, edges));
    else
        p->half = p->r;
    DMK_TRY(DMK_NEW(ctx, p->order, edges > 2 * vertices ? edges : 2 * vertices));
    DMK_TRY(DMK_NEW(ctx, p->root, vertices));
done:
    return rc;
}

static void release_tree(router *p)
{
    free(p->order);
    free(p->root);
    p->order = p->root = NULL;
}

static void release(router *p)
{
    if (p->share) free(p->half);
    give_back(p, &p->mu);
    give_back(p, &p->u);
    give_back(p, &p->r);
    give_back(p, &p->rounding);
    give_back(p, &p->sent);
    free(p->cost);
    release_tree(p);
}

/* mu, u, and f as r; of a share its own items' and ghosts'. */
static int read_pair(const router *p)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    dmk_system *s = p->o->sys;
    if (p->share) {
        DMK_TRY(dmk_share_rows(ctx, p->share, DMK_OUTER, s->u));
        DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->mu, (size_t)p->n.n_elements_pad,
                                     p->mu));
        DMK_TRY(
            dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->u, (size_t)p->n.n_rows_pad, p->u));
        return dmk_buffer_read_real(ctx, s->device, DMK_OUTER, s->f, (size_t)p->n.n_rows_pad, p->r);
    }
    if (p->n_loans == 0) { /* else they lie there */
        DMK_TRY(dmk_elements_read(ctx, s, s->mu, p->mu));
        DMK_TRY(dmk_rows_read(ctx, s, s->u, p->u));
    }
    DMK_TRY(dmk_rows_read(ctx, s, s->f, p->r));
done:
    return rc;
}

/* Of a share: u again, and room for what the edges have beside them. */
static int restore_rows(router *p)
{
    int rc;
    const size_t n = (size_t)p->n.n_rows_pad;
    DMK_TRY(DMK_NEW(p->o->ctx, p->u, n));
    DMK_TRY(DMK_NEW(p->o->ctx, p->rounding, n));
    rc = dmk_buffer_read_real(p->o->ctx, p->o->sys->device, DMK_OUTER, p->o->sys->u, n, p->u);
done:
    return rc;
}

/* All r of a share. */
static int send_of_share(router *p, double *cost)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    subtract(p);
    DMK_TRY(dmk_share_ghosts(ctx, p->share, p->r));
    DMK_TRY(dmk_share_ghosts(ctx, p->share, p->rounding));
    DMK_TRY(dmk_share_in_turn(ctx, p->share, cost, add_rounding, p));
    send_midpoints(p);
    DMK_TRY(send_along_branches(p, cost));
    rc = restore_rows(p);
done:
    return rc;
}

static int route(router *p, double *bound)
{
    int rc;
    dmk_context *ctx = p->o->ctx;
    double cost = 0;
    DMK_TRY(p->share ? send_of_share(p, &cost) : send_on_whole(p, &cost));
    release_tree(p);
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

static int find_balance(const router *p, double *balance)
{
    int rc;
    double *f = NULL;
    DMK_TRY(DMK_NEW(p->o->ctx, f, (size_t)p->n.n_rows_pad));
    DMK_TRY(dmk_rows_read(p->o->ctx, p->o->sys, p->o->sys->f, f));
    *balance = worst_balance(p, f);
done:
    free(f);
    return rc;
}

int dmk_bound_upper(dmk_iteration *o, double *flux, double *balance, double *bound)
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
    DMK_TRY(allocate(&p));
    DMK_TRY(read_pair(&p));
    DMK_TRY(route(&p, bound));
    if (flux) dmk_parallel(o->ctx, o->mesh->n_triangles, mean_range, &p);
    if (balance) rc = find_balance(&p, balance);
done:
    release(&p);
    return rc;
}
