/* The spanning tree of the upper bound. On a share each rank knows its own edges' heaviest forest, in which the whole
 * mesh's tree lies but for a few edges that close a circle through other ranks. Which ones shows in small: of a forest
 * only the paths between vertices that several ranks have are told, each with its worst edge (Anderson, Blelloch and
 * Tangwongsan 2020 call it the compressed path tree), and the tree of all these paths lacks the same edges. What the
 * vertices inside send is told along with it; so every rank solves the small tree, and fills its own paths. */
#include "solver/tree.h"

#include "base/sets.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Trees of which leaf after leaf is cut off. */
typedef struct forest {
    int32_t n;          /* vertices */
    const int32_t *end; /* of edge e at 2 * e */
    int32_t *order;     /* edges, the chosen ones first */
    int32_t n_chosen;
    int32_t *degree, *key;  /* vertices: number of chosen edges, and their exclusive or */
    double *load, *error;   /* vertices */
    double *sent, *carried; /* edges */
    int32_t *leaf;          /* edges: which end was the leaf, or -1; NULL: not wanted */
    const double *along[2]; /* edges: load and error on the way, or NULL */
} forest;

/* Of degrees: this vertex is no leaf. */
enum { KEPT = 1 << 30 };

/* A path between two vertices that are kept, or at which more than two edges meet. */
typedef struct path {
    int64_t end[2]; /* whole numbers */
    int64_t edge;   /* its worst edge, the last one in the order of the tree; whole number */
    int32_t bin;
    double load[2], error[2]; /* of the vertices inside, before and behind that edge */
} path;

/* The same in local numbers. */
typedef struct trail {
    int32_t vertex[2], edge[2]; /* where it begins and ends */
    int32_t worst, before;      /* that edge, and its end on the side of vertex[0] */
    path path;
} trail;

/* What sits at an end of paths, or what one rank knows of it. */
typedef struct node {
    int64_t vertex;
    double load, error;
} node;

/* The paths of all ranks. */
typedef struct sketch {
    path *path;
    node *node;
    int32_t n_paths, n_nodes;
    forest forest; /* edges are paths, vertices nodes */
} sketch;

static int32_t other_end(const forest *f, int32_t e, int32_t v)
{
    const int32_t *end = f->end + 2 * (size_t)e;
    return end[0] == v ? end[1] : end[0];
}

/* ---- a forest --------------------------------------------------------------------------------- */

/* begin .. end - 1 into `order` by their bins, in each by their numbers. */
static int sort_by_bin(dmk_context *ctx, const void *user, int32_t begin, int32_t end,
                       int (*bin)(const void *user, int32_t i), int32_t *order)
{
    int rc;
    int32_t first[DMK_TREE_BINS + 1] = {0};
    uint16_t *of = NULL; /* found once: a bin's triangles lie far apart */
    DMK_TRY(DMK_NEW_UNSET(ctx, of, (size_t)(end - begin)));
    for (int32_t i = begin; i < end; i++) {
        of[i - begin] = (uint16_t)bin(user, i);
        first[of[i - begin] + 1]++;
    }
    for (int b = 0; b < DMK_TREE_BINS; b++) first[b + 1] += first[b];
    for (int32_t i = begin; i < end; i++) order[first[of[i - begin]]++] = i;
done:
    free(of);
    return rc;
}

/* Kruskal's forest of n edges in their order. The union-find forest and the degrees take turns in the same room, and
 * the edges that are not chosen give theirs to the keys. */
static void grow(forest *f, int32_t n)
{
    int32_t *const parent = f->degree;
    f->n_chosen = 0;
    for (int32_t v = 0; v < f->n; v++) parent[v] = v;
    for (int32_t i = 0; f->n_chosen < f->n - 1 && i < n; i++) {
        const int32_t e = f->order[i], *end = f->end + 2 * (size_t)e;
        if (dmk_set_unite(parent, end[0], end[1])) f->order[f->n_chosen++] = e;
    }
    f->key = f->order + f->n;
    memset(f->degree, 0, (size_t)f->n * sizeof *f->degree);
    memset(f->key, 0, (size_t)f->n * sizeof *f->key);
    for (int32_t i = 0; i < 2 * f->n_chosen; i++) {
        const int32_t e = f->order[i / 2], v = f->end[2 * (size_t)e + (size_t)(i % 2)];
        f->degree[v]++;
        f->key[v] ^= e;
    }
}

/* Room for the order of n edges, the degrees and the keys. */
static int make_room(dmk_context *ctx, int32_t n, forest *f)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, f->order, (size_t)dmk_max_i(n, 2 * f->n)));
    DMK_TRY(DMK_NEW(ctx, f->degree, (size_t)f->n));
done:
    return rc;
}

static void send(const forest *f, int32_t e, int32_t from, double load, double error)
{
    const bool first = f->end[2 * (size_t)e] == from;
    f->sent[e] = first ? load : -load;
    f->carried[e] = error;
    if (f->leaf) f->leaf[e] = !first;
}

/* Leaf after leaf that is not kept gives all it has to its neighbour; degree 0 then. */
static void prune(const forest *f)
{
    for (int32_t i = 0; i < f->n; i++) {
        for (int32_t v = i; f->degree[v] == 1;) {
            const int32_t e = f->key[v], w = other_end(f, e, v);
            send(f, e, v, f->load[v], f->error[v]);
            f->load[w] += f->load[v] + (f->along[0] ? f->along[0][e] : 0);
            f->error[w] += f->error[v] + (f->along[1] ? f->along[1][e] : 0);
            f->degree[v]--;
            f->degree[w]--;
            f->key[w] ^= e;
            v = w;
        }
    }
}

/* ---- loads whose sums are exact ---------------------------------------------------------------- */

/* Sums of the own vertices' sizes. */
static void add_loads(void *user, double *sum)
{
    const dmk_tree *t = user;
    for (int32_t v = t->vertices[0]; v < t->vertices[1]; v++) *sum += fabs(t->load[v]);
}

static void add_errors(void *user, double *sum)
{
    const dmk_tree *t = user;
    for (int32_t v = t->vertices[0]; v < t->vertices[1]; v++) *sum += t->error[v];
}

/* The power of 2 of which numbers with that sum of sizes, rounded up, have less than 2^53 in all. */
static double unit_of(double sum)
{
    int exponent;
    if (!(sum > 0) || !isfinite(sum)) return 0; /* they stay as they are */
    frexp(sum, &exponent);
    return ldexp(1, exponent - 52);
}

static int make_exact(dmk_context *ctx, dmk_tree *t)
{
    int rc;
    double loads = 0, errors = 0;
    for (int32_t v = 0; v < t->mesh->n_vertices; v++) {
        if (v < t->vertices[0] || v >= t->vertices[1]) t->load[v] = t->error[v] = 0;
    }
    DMK_TRY(dmk_share_in_turn(ctx, t->share, &loads, add_loads, t));
    const double unit = unit_of(loads);
    for (int32_t v = t->vertices[0]; unit > 0 && v < t->vertices[1]; v++) {
        t->load[v] = rint(t->load[v] / unit) * unit;
        t->error[v] += 0.5 * unit;
    }
    DMK_TRY(dmk_share_in_turn(ctx, t->share, &errors, add_errors, t));
    const double step = unit_of(errors);
    for (int32_t v = t->vertices[0]; step > 0 && v < t->vertices[1]; v++)
        t->error[v] = ceil(t->error[v] / step) * step;
done:
    return rc;
}

/* ---- paths of the own forest ------------------------------------------------------------------- */

/* All ends there, and what several ranks' edges meet at. */
static void keep_ends(const dmk_tree *t, const forest *f)
{
    if (!t->share) {
        f->degree[0] |= KEPT;
        return;
    }
    const dmk_space *vertex = &t->share->vertex[0];
    if (dmk_space_owns(vertex, 0)) f->degree[dmk_space_slot(vertex, 0)] |= KEPT;
    for (int32_t e = 0; e < t->mesh->n_edges; e++) {
        const bool own = e >= t->edges[0] && e < t->edges[1];
        for (size_t k = 0; k < 2; k++) {
            const int32_t v = t->mesh->edge_vertex[2 * (size_t)e + k];
            if (own != dmk_space_owns(vertex, dmk_space_whole(vertex, v))) f->degree[v] |= KEPT;
        }
    }
}

/* From vertex[0] along edge[0] to the next node. */
static void follow(const dmk_tree *t, const forest *f, trail *way)
{
    int32_t e = way->edge[0], v = way->vertex[0];
    path *p = &way->path;
    p->bin = -1;
    for (;;) {
        const int bin = t->bin(t->user, e);
        if (bin > p->bin || (bin == p->bin && e > way->worst)) {
            p->bin = bin;
            way->worst = e;
            way->before = v;
            p->load[0] += p->load[1];
            p->error[0] += p->error[1];
            p->load[1] = p->error[1] = 0;
        }
        v = other_end(f, e, v);
        if (f->degree[v] > 2) break;
        p->load[1] += f->load[v];
        p->error[1] += f->error[v];
        e ^= f->key[v];
    }
    way->vertex[1] = v;
    way->edge[1] = e;
    p->edge = dmk_space_whole(&t->share->edge, way->worst);
    for (int k = 0; k < 2; k++) p->end[k] = dmk_space_whole(&t->share->vertex[0], way->vertex[k]);
}

static int compare_trails(const void *a, const void *b)
{
    const trail *x = a, *y = b;
    return (x->worst > y->worst) - (x->worst < y->worst);
}

/* What is left of the pruned forest, by the worst edges' numbers; the caller frees *list. */
static int list_trails(dmk_context *ctx, const dmk_tree *t, const forest *f, trail **list,
                       int32_t *n)
{
    int rc = DMK_OK;
    size_t room = 0;
    *n = 0;
    for (int32_t i = 0; i < 2 * f->n_chosen; i++) {
        const int32_t e = f->order[i / 2], v = f->end[2 * (size_t)e + (size_t)(i % 2)];
        if (f->degree[v] <= 2 || f->degree[other_end(f, e, v)] == 0) continue;
        trail way = {.vertex[0] = v, .edge[0] = e};
        follow(t, f, &way);
        if (way.vertex[0] > way.vertex[1]) continue; /* it comes from the other end, too */
        DMK_TRY(DMK_GROW(ctx, *list, (size_t)*n + 1, room));
        (*list)[(*n)++] = way;
    }
    if (*n > 0) qsort(*list, (size_t)*n, sizeof **list, compare_trails);
done:
    return rc;
}

/* ---- those of all ranks ------------------------------------------------------------------------ */

static int compare_nodes(const void *a, const void *b)
{
    const node *x = a, *y = b;
    return (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* Each vertex once, with what all ranks know of it. */
static void merge_nodes(sketch *s)
{
    int32_t n = 0;
    qsort(s->node, (size_t)s->n_nodes, sizeof *s->node, compare_nodes);
    for (int32_t i = 0; i < s->n_nodes; i++) {
        if (n > 0 && s->node[n - 1].vertex == s->node[i].vertex) {
            s->node[n - 1].load += s->node[i].load;
            s->node[n - 1].error += s->node[i].error;
        } else {
            s->node[n++] = s->node[i];
        }
    }
    s->n_nodes = n;
}

static int gather_nodes(dmk_context *ctx, const dmk_tree *t, const forest *f, sketch *s)
{
    int rc;
    node *own = NULL;
    size_t n = 0;
    for (int32_t v = 0; v < f->n; v++) n += f->degree[v] > 2;
    DMK_TRY(DMK_NEW(ctx, own, n));
    n = 0;
    for (int32_t v = 0; v < f->n; v++) {
        if (f->degree[v] > 2)
            own[n++] = (node){dmk_space_whole(&t->share->vertex[0], v), f->load[v], f->error[v]};
    }
    DMK_TRY(dmk_share_join(ctx, t->share, n, sizeof *own, own, &s->n_nodes, (void **)&s->node));
    merge_nodes(s);
done:
    free(own);
    return rc;
}

/* By rank, so in the order of their worst edges. */
static int gather_paths(dmk_context *ctx, const dmk_tree *t, const trail *trails, int32_t n,
                        sketch *s)
{
    int rc;
    path *own = NULL;
    DMK_TRY(DMK_NEW(ctx, own, (size_t)n));
    for (int32_t i = 0; i < n; i++) own[i] = trails[i].path;
    rc = dmk_share_join(ctx, t->share, (size_t)n, sizeof *own, own, &s->n_paths, (void **)&s->path);
done:
    free(own);
    return rc;
}

static int path_bin(const void *user, int32_t i)
{
    const path *p = user;
    return p[i].bin;
}

static int allocate(dmk_context *ctx, sketch *s)
{
    int rc;
    const size_t paths = (size_t)s->n_paths, nodes = (size_t)s->n_nodes;
    forest *f = &s->forest;
    int32_t *end = NULL;
    double *along = NULL;
    f->n = s->n_nodes;
    DMK_TRY(make_room(ctx, s->n_paths, f));
    DMK_TRY(DMK_NEW(ctx, end, 2 * paths));
    f->end = end;
    DMK_TRY(DMK_NEW(ctx, along, 2 * paths));
    f->along[0] = along;
    f->along[1] = along + paths;
    DMK_TRY(DMK_NEW(ctx, f->leaf, paths));
    DMK_TRY(DMK_NEW(ctx, f->load, 2 * nodes));
    DMK_TRY(DMK_NEW(ctx, f->sent, 2 * paths));
    f->error = f->load + nodes;
    f->carried = f->sent + paths;
    for (size_t i = 0; i < paths; i++) {
        f->leaf[i] = -1;
        for (size_t k = 0; k < 2; k++) {
            const node key = {.vertex = s->path[i].end[k]};
            const node *at = bsearch(&key, s->node, nodes, sizeof key, compare_nodes);
            end[2 * i + k] = (int32_t)(at - s->node);
        }
        along[i] = s->path[i].load[0] + s->path[i].load[1];
        along[paths + i] = s->path[i].error[0] + s->path[i].error[1];
    }
    for (size_t i = 0; i < nodes; i++) {
        f->load[i] = s->node[i].load;
        f->error[i] = s->node[i].error;
    }
done:
    return rc;
}

static void sketch_free(sketch *s)
{
    free(s->path);
    free(s->node);
    free(s->forest.order);
    free(s->forest.degree);
    free(s->forest.leaf);
    free(s->forest.load);
    free(s->forest.sent);
    free((void *)(uintptr_t)s->forest.end);
    free((void *)(uintptr_t)s->forest.along[0]);
}

/* The tree of the paths. One that is not in it is cut at its worst edge, and what is inside goes to its ends. */
static int solve_sketch(dmk_context *ctx, sketch *s)
{
    int rc;
    forest *f = &s->forest;
    uint8_t *chosen = NULL;
    DMK_TRY(allocate(ctx, s));
    DMK_TRY(DMK_NEW(ctx, chosen, (size_t)s->n_paths));
    DMK_TRY(sort_by_bin(ctx, s->path, 0, s->n_paths, path_bin, f->order));
    grow(f, s->n_paths);
    for (int32_t i = 0; i < f->n_chosen; i++) chosen[f->order[i]] = 1;
    for (int32_t i = 0; i < s->n_paths; i++) {
        for (size_t k = 0; k < 2 && !chosen[i]; k++) {
            f->load[f->end[2 * (size_t)i + k]] += s->path[i].load[k];
            f->error[f->end[2 * (size_t)i + k]] += s->path[i].error[k];
        }
    }
    f->degree[0] |= KEPT; /* nodes are in the order of the vertices */
    prune(f);
done:
    free(chosen);
    return rc;
}

/* ---- and back ---------------------------------------------------------------------------------- */

/* `load` and `error` leave v along edge e and others join them, up to `stop`. */
static void carry(const forest *f, int32_t v, int32_t e, double load, double error, int32_t stop)
{
    for (;;) {
        send(f, e, v, load, error);
        v = other_end(f, e, v);
        if (v == stop) return;
        load += f->load[v];
        error += f->error[v];
        e ^= f->key[v];
    }
}

/* Flows along an own path, of which the small tree has number i. */
static void fill(const forest *f, const trail *way, const forest *paths, int32_t i)
{
    const int32_t leaf = paths->leaf[i];
    if (leaf >= 0) {
        carry(f, way->vertex[leaf], way->edge[leaf], leaf == 0 ? paths->sent[i] : -paths->sent[i],
              paths->carried[i], way->vertex[1 - leaf]);
        return;
    }
    for (int k = 0; k < 2; k++) {
        const int32_t v = k == 0 ? way->before : other_end(f, way->worst, way->before);
        if (v != way->vertex[k])
            carry(f, v, f->key[v] ^ way->worst, f->load[v], f->error[v], way->vertex[k]);
    }
}

static int send_along_paths(dmk_context *ctx, const dmk_tree *t, const forest *f)
{
    int rc;
    sketch s = {.n_paths = 0};
    trail *own = NULL;
    int32_t n, first = 0;
    DMK_TRY(list_trails(ctx, t, f, &own, &n));
    DMK_TRY(gather_nodes(ctx, t, f, &s));
    DMK_TRY(gather_paths(ctx, t, own, n, &s));
    DMK_TRY(solve_sketch(ctx, &s));
    while (n > 0 && s.path[first].edge != own[0].path.edge) first++;
    for (int32_t i = 0; i < n; i++) fill(f, &own[i], &s.forest, first + i);
done:
    free(own);
    sketch_free(&s);
    return rc;
}

static forest own_forest(const dmk_tree *t)
{
    return (forest){.n = t->mesh->n_vertices,
                    .end = t->mesh->edge_vertex,
                    .order = t->order,
                    .n_chosen = t->n_chosen,
                    .degree = t->degree,
                    .key = t->order + t->mesh->n_vertices,
                    .load = t->load,
                    .error = t->error,
                    .sent = t->sent,
                    .carried = t->carried};
}

int dmk_tree_grow(dmk_context *ctx, dmk_tree *t)
{
    int rc;
    const int32_t n = t->edges[1] - t->edges[0];
    forest f = {.n = t->mesh->n_vertices, .end = t->mesh->edge_vertex};
    rc = make_room(ctx, n, &f);
    t->order = f.order;
    t->degree = f.degree;
    if (rc != DMK_OK) return rc;
    DMK_TRY(sort_by_bin(ctx, t->user, t->edges[0], t->edges[1], t->bin, f.order));
    grow(&f, n);
    t->n_chosen = f.n_chosen;
done:
    return rc;
}

int dmk_tree_send(dmk_context *ctx, dmk_tree *t)
{
    int rc;
    const forest f = own_forest(t);
    DMK_TRY(make_exact(ctx, t));
    keep_ends(t, &f);
    prune(&f);
    if (t->share) rc = send_along_paths(ctx, t, &f);
done:
    return rc;
}

void dmk_tree_free(dmk_tree *t)
{
    free(t->order);
    free(t->degree);
    t->order = t->degree = NULL;
}
