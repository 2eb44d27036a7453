/* The upper bound's spanning tree by itself: on random graphs, dealt out to threads in random runs, some of them empty
 * and some without a path of their own. */
#include "context.h"
#include "meeting.h"
#include "solver/tree.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

enum { N = 40, M = 70, GRAPHS = 200, N_BINS = 6 };

/* A connected graph, its vertices' loads and its edges' bins. */
typedef struct graph {
    int32_t n, m, end[2 * M];
    int bin[M];
    double load[N], error[N];
} graph;

/* What its tree carries. */
typedef struct flow {
    bool chosen[M];
    double sent[M], carried[M];
} flow;

static uint32_t draw(uint32_t *state, uint32_t n)
{
    *state = *state * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)*state * n >> 32);
}

/* Its first edges are a tree in a random order of the vertices; a twig where m = n - 1. */
static graph make_graph(uint32_t *state)
{
    graph g = {.n = 2 + (int32_t)draw(state, N - 2)};
    int32_t order[N] = {0};
    g.m = g.n - 1 + (int32_t)draw(state, M - N + 1);
    for (int32_t v = 0; v < g.n; v++) {
        const int32_t at = (int32_t)draw(state, (uint32_t)v + 1);
        order[v] = order[at];
        order[at] = v;
    }
    for (int32_t e = 0; e < g.m; e++) {
        const int32_t a = e < g.n - 1 ? e + 1 : 1 + (int32_t)draw(state, (uint32_t)g.n - 1);
        const int32_t b = (int32_t)draw(state, (uint32_t)a), turned = (int32_t)draw(state, 2);
        g.end[2 * e + turned] = order[a];
        g.end[2 * e + 1 - turned] = order[b];
        g.bin[e] = (int)draw(state, N_BINS) * (DMK_TREE_BINS - 1) / (N_BINS - 1);
    }
    for (int32_t v = 0; v < g.n; v++) {
        g.load[v] = draw(state, 1000003) / 1000003. - 0.5;
        g.error[v] = 1e-9 * draw(state, 1000);
    }
    return g;
}

/* ---- on ranks -------------------------------------------------------------------------------------- */

typedef struct seat {
    member m;
    const graph *g;
    int32_t vertices[MOST_RANKS + 1], edges[MOST_RANKS + 1]; /* bounds of the runs */
    flow flow;                                               /* of the own edges */
    bool lone; /* it has no two vertices that others have, too */
    int rc;
} seat;

typedef struct local {
    const graph *g;
    dmk_share share;
    dmk_mesh mesh;
    int bin[M + 8];
    int32_t end[2 * (M + 8)];
    double load[N + 8], error[N + 8], sent[M + 8], carried[M + 8];
} local;

static int bin_of(const void *user, int32_t e)
{
    const local *l = user;
    return l->bin[e];
}

/* The marked items that others own are ghosts. */
static int create_space(dmk_context *ctx, int32_t n, const uint8_t *mark, dmk_space *space)
{
    int64_t ghost[M + N];
    size_t n_ghosts = 0;
    for (int32_t i = 0; i < n; i++) {
        if (mark[i] && !dmk_space_owns(space, i)) ghost[n_ghosts++] = i;
    }
    return dmk_space_create(ctx, n_ghosts, ghost, 1, 0, space);
}

/* The own runs, the edges that meet own vertices, and all ends. */
static int mark(dmk_context *ctx, const seat *s, local *l)
{
    int rc;
    const graph *g = s->g;
    const int r = s->m.rank;
    uint8_t vertex[N] = {0}, edge[M] = {0};
    dmk_space *own = &l->share.vertex[0], *edges = &l->share.edge;
    *own = (dmk_space){.n_whole = g->n, .first = s->vertices[r], .end = s->vertices[r + 1]};
    *edges = (dmk_space){.n_whole = g->m, .first = s->edges[r], .end = s->edges[r + 1]};
    for (int32_t e = 0; e < g->m; e++) {
        const int32_t *v = g->end + 2 * e;
        edge[e] =
            dmk_space_owns(edges, e) || dmk_space_owns(own, v[0]) || dmk_space_owns(own, v[1]);
        if (edge[e]) vertex[v[0]] = vertex[v[1]] = 1;
    }
    DMK_TRY(create_space(ctx, g->n, vertex, own));
    DMK_TRY(create_space(ctx, g->m, edge, edges));
done:
    return rc;
}

static void fill(const graph *g, local *l)
{
    const dmk_space *vertex = &l->share.vertex[0], *edge = &l->share.edge;
    l->mesh = (dmk_mesh){.n_vertices = vertex->n, .n_edges = edge->n, .edge_vertex = l->end};
    for (int32_t e = 0; e < edge->n; e++) {
        const int64_t whole = dmk_space_whole(edge, e);
        for (int k = 0; k < 2; k++)
            l->end[2 * e + k] = dmk_space_slot(vertex, g->end[2 * whole + k]);
        l->bin[e] = g->bin[whole];
    }
    for (int32_t v = 0; v < vertex->n; v++) { /* of ghosts whatever there is */
        const bool own = dmk_space_owns(vertex, dmk_space_whole(vertex, v));
        l->load[v] = own ? g->load[dmk_space_whole(vertex, v)] : 1e9;
        l->error[v] = own ? g->error[dmk_space_whole(vertex, v)] : 1e9;
    }
}

static void take(const local *l, const dmk_tree *t, flow *f)
{
    const dmk_space *edge = &l->share.edge;
    for (int32_t e = t->edges[0]; e < t->edges[1]; e++) {
        f->sent[dmk_space_whole(edge, e)] = l->sent[e];
        f->carried[dmk_space_whole(edge, e)] = l->carried[e];
        f->chosen[dmk_space_whole(edge, e)] =
            l->carried[e] > 0; /* by rounding, if by nothing else */
    }
}

static bool is_lone(const dmk_tree *t)
{
    int32_t kept = 0;
    for (int32_t v = 0; v < t->mesh->n_vertices; v++) kept += t->degree[v] > 2;
    return kept < 2;
}

static int send_on(seat *s, dmk_context *ctx, local *l, bool shared)
{
    int rc;
    const dmk_space *vertex = &l->share.vertex[0], *edge = &l->share.edge;
    dmk_tree t = {.share = shared ? &l->share : NULL,
                  .mesh = &l->mesh,
                  .bin = bin_of,
                  .user = l,
                  .load = l->load,
                  .error = l->error,
                  .sent = l->sent,
                  .carried = l->carried};
    DMK_TRY(mark(ctx, s, l));
    fill(s->g, l);
    t.vertices[0] = vertex->at_first, t.edges[0] = edge->at_first;
    t.vertices[1] = vertex->at_first + vertex->end - vertex->first;
    t.edges[1] = edge->at_first + edge->end - edge->first;
    DMK_TRY(dmk_tree_grow(ctx, &t));
    DMK_TRY(dmk_tree_send(ctx, &t));
    take(l, &t, &s->flow);
    s->lone = is_lone(&t);
done:
    dmk_tree_free(&t);
    dmk_space_free(&l->share.vertex[0]);
    dmk_space_free(&l->share.edge);
    return rc;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    const dmk_ranks ranks = ranks_of(&s->m, 0);
    local l = {.share.ranks = ranks};
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = send_on(s, ctx, &l, true);
    dmk_context_destroy(&ctx);
    return NULL;
}

/* Bounds of runs of n items, now and then empty ones. */
static void deal(uint32_t *state, int size, int32_t n, int32_t bound[MOST_RANKS + 1])
{
    bound[0] = 0;
    for (int r = 1; r < size; r++)
        bound[r] = bound[r - 1] + (int32_t)draw(state, (uint32_t)(n - bound[r - 1]) + 1);
    bound[size] = n;
}

/* ---- what has to hold ------------------------------------------------------------------------------ */

/* The edge before which v was reached from `from` along chosen edges, for all v; -1: not reached. */
static void reach(const graph *g, const bool *chosen, int32_t from, int32_t *by)
{
    bool more = true;
    for (int32_t v = 0; v < g->n; v++) by[v] = v == from ? M : -1;
    while (more) {
        more = false;
        for (int32_t e = 0; e < g->m; e++) {
            const int32_t *v = g->end + 2 * e;
            if (!chosen[e] || (by[v[0]] < 0) == (by[v[1]] < 0)) continue;
            by[by[v[0]] < 0 ? v[0] : v[1]] = e;
            more = true;
        }
    }
}

static int32_t other_end(const graph *g, int32_t e, int32_t v)
{
    return g->end[2 * e] == v ? g->end[2 * e + 1] : g->end[2 * e];
}

/* n - 1 edges that reach all; what is left out is no better than any edge of the circle that it would close. */
static void is_spanning(const graph *g, const flow *f)
{
    int32_t n = 0;
    for (int32_t e = 0; e < g->m; e++) {
        int32_t by[N];
        n += f->chosen[e];
        if (f->chosen[e]) continue;
        reach(g, f->chosen, g->end[2 * e], by);
        for (int32_t v = g->end[2 * e + 1]; by[v] != M; v = other_end(g, by[v], v)) {
            assert_true(by[v] >= 0);
            assert_true(g->bin[by[v]] < g->bin[e] || (g->bin[by[v]] == g->bin[e] && by[v] < e));
        }
    }
    assert_int_equal(n, g->n - 1);
}

/* All that a vertex has and gets leaves it, but for the root's, and with it the errors of those it comes
 * from, and what rounding has changed. */
static void all_is_sent(const graph *g, const flow *f)
{
    long double left[N], passed[M] = {0}, load[M] = {0};
    int32_t by[N];
    for (int32_t v = 0; v < g->n; v++) left[v] = g->load[v];
    for (int32_t e = 0; e < g->m; e++) {
        if (!f->chosen[e]) assert_true(f->sent[e] == 0);
        left[g->end[2 * e]] -= f->sent[e];
        left[g->end[2 * e + 1]] += f->sent[e];
    }
    reach(g, f->chosen, 0, by);
    for (int32_t v = 1; v < g->n; v++) {
        assert_true(fabsl(left[v]) < 1e-13);
        for (int32_t w = v; w != 0; w = other_end(g, by[w], w)) {
            passed[by[w]] += g->error[v];
            load[by[w]] += g->end[2 * by[w]] == w ? g->load[v] : -g->load[v];
        }
    }
    for (int32_t e = 0; e < g->m; e++) {
        if (!f->chosen[e]) continue;
        passed[e] += fabsl(load[e] - f->sent[e]);
        assert_true(f->carried[e] >= passed[e] && f->carried[e] < passed[e] + 1e-12);
    }
}

/* The whole graph at once, and on every number of ranks: the same bits. */
static void same_on_ranks(void **state)
{
    uint32_t seed = 1;
    int n_lone = 0;
    for (int i = 0; i < GRAPHS; i++) {
        const graph g = make_graph(&seed);
        seat whole = {.g = &g, .vertices = {0, g.n}, .edges = {0, g.m}};
        static local l;
        memset(&l, 0, sizeof l);
        assert_int_equal(send_on(&whole, *state, &l, false), DMK_OK);
        is_spanning(&g, &whole.flow);
        all_is_sent(&g, &whole.flow);
        for (int size = 1; size <= MOST_RANKS; size++) {
            meeting all = {.size = size};
            seat seats[MOST_RANKS], ends = {.g = &g};
            deal(&seed, size, g.n, ends.vertices);
            deal(&seed, size, g.m, ends.edges);
            for (int r = 0; r < size; r++) {
                seats[r] = ends;
                seats[r].m = (member){.all = &all, .rank = r};
            }
            assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
            for (int r = 0; r < size; r++) {
                const size_t first = (size_t)ends.edges[r], n = (size_t)ends.edges[r + 1] - first;
                assert_int_equal(seats[r].rc, DMK_OK);
                assert_memory_equal(seats[r].flow.sent + first, whole.flow.sent + first,
                                    n * sizeof(double));
                assert_memory_equal(seats[r].flow.carried + first, whole.flow.carried + first,
                                    n * sizeof(double));
                n_lone += seats[r].lone;
            }
        }
    }
    assert_true(n_lone > GRAPHS); /* with edges or without */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_on_ranks)};
    return cmocka_run_group_tests_name("tree", tests, context_setup, context_teardown);
}
