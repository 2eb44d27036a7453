/* Jumps, the spanning tree of least jump and the crossings of the locus: see cotree.h. */
#include "base/parallel.h"
#include "base/sets.h"
#include "base/sort.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool dmk_parts_cells(const dmk_geodesics *g, int32_t e)
{
    const int32_t *v = g->mesh->edge_vertex + 2 * (size_t)e;
    return g->arrival[v[0]].source != g->arrival[v[1]].source;
}

/* Of the half-edges of an edge, the first. */
static bool is_first(const dmk_geodesics *g, int32_t h)
{
    return g->star.twin[h] < 0 || h < g->star.twin[h];
}

/* Of edges that jump alike, by rounding where all is one family, the shorter one comes first: the locus does not hang
 * on how edges are numbered. Of their length, more than distances are rounded by and less than a jump that counts. */
static const double beside_jump = 1e-9;

/* Jumps as keys: the bits of a float keep the order of numbers that are not negative. Edges between the cells of two
 * sources come last, so that the tree of a source takes its own cell. */
static void find_jumps(int32_t begin, int32_t end, void *data)
{
    const dmk_cotree *t = data;
    const dmk_geodesics *g = t->geodesics;
    const double unit = t->mean_edge / g->star.unit;
    for (int32_t h = begin; h < end;) {
        int n = 0;
        int32_t half[DMK_EDGES];
        double jump[DMK_EDGES];
        for (; h < end && n < DMK_EDGES; h++) {
            half[n] = h;
            n += is_first(g, h);
        }
        dmk_jumps(g, n, half, dmk_rules.tie, jump);
        for (int k = 0; k < n; k++) {
            const int32_t e = g->mesh->triangle_edge[half[k]];
            const double all = jump[k] + beside_jump * dmk_length_of(g, half[k]);
            uint32_t bits = dmk_float_key((float)(all / unit));
            if (dmk_parts_cells(g, e)) bits |= UINT32_C(1) << 31;
            t->order[e] = (dmk_keyed){bits, e};
        }
    }
}

double dmk_jump_of(const dmk_cotree *t, int32_t k)
{
    float jump;
    const uint32_t bits = t->order[k].key & ~(UINT32_C(1) << 31);
    memcpy(&jump, &bits, sizeof jump);
    return t->mean_edge * jump;
}

/* What peeling begins with. */
static void reset(const dmk_cotree *t, int32_t i, bool kept)
{
    dmk_crossing *c = &t->crossing[i];
    c->onward = -1;
    c->outer = -1;
    c->heir = false;
    c->kept = kept;
    c->excess = c->worth = t->strength_of[i] = HUGE_VAL;
    c->fall = 0;
}

/* x, alpha, distance: of dmk_meet_many. Few edges ask for more: where families begin apart, as behind a pseudo-source,
 * and where ends are tied. */
static void set_crossing(const dmk_cotree *t, int32_t h, double x, double alpha, double distance)
{
    const dmk_geodesics *g = t->geodesics;
    const dmk_mesh *m = g->mesh;
    const int32_t start = m->triangle[dmk_next(h)], end = m->triangle[dmk_previous(h)],
                  twin = g->star.twin[h];
    dmk_crossing *c = &t->crossing[t->on[h]];
    if (isnan(x) || dmk_geodesics_tie(g, start) || dmk_geodesics_tie(g, end)) {
        const dmk_meeting found = dmk_meet(g, h);
        x = found.x;
        alpha = found.alpha;
        distance = dmk_image_length(&found.a.image, x, 0) + dmk_image_length(&found.b.image, x, 0);
    }
    const double at = x / dmk_length_of(g, h);
    *c = (dmk_crossing){.half = h,
                        .node = {h / 3, twin >= 0 ? twin / 3 : m->n_triangles + t->loop[start]},
                        .alpha = alpha,
                        .share = at,
                        .distance = 0.5 * g->star.unit * distance};
    for (int k = 0; k < 3; k++)
        c->xyz[k] = (1 - at) * m->xyz[3 * (size_t)start + k] + at * m->xyz[3 * (size_t)end + k];
    reset(t, t->on[h], false);
}

static void set_range(int32_t begin, int32_t end, void *data)
{
    const dmk_cotree *t = data;
    for (int32_t h = begin; h < end;) {
        int n = 0;
        int32_t half[DMK_EDGES];
        dmk_met met;
        for (; h < end && n < DMK_EDGES; h++) {
            half[n] = h;
            n += (t->on[h] >= 0) & is_first(t->geodesics, h);
        }
        dmk_meet_many(t->geodesics, n, half, &met);
        for (int k = 0; k < n; k++)
            set_crossing(t, half[k], met.x[k], met.alpha[k], met.distance[k]);
    }
}

/* Crossings of the edges that are not in the tree. */
static int set_crossings(dmk_context *ctx, const bool *in_tree, dmk_cotree *t)
{
    int rc = DMK_OK;
    const dmk_geodesics *g = t->geodesics;
    const dmk_mesh *m = g->mesh;
    t->n = 0;
    /* triangle by triangle: neighbours stay near in memory */
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (is_first(g, h))
            t->on[h] = in_tree[m->triangle_edge[h]] ? -1 : t->n++;
        else
            t->on[h] = t->on[g->star.twin[h]];
    }
    DMK_TRY(DMK_NEW_UNSET(ctx, t->crossing, (size_t)t->n));
    dmk_parallel(ctx, 3 * m->n_triangles, set_range, t);
done:
    return rc;
}

/* A vertex that has source i nearest, if one next to it does; else -1. */
static int32_t vertex_of(const dmk_geodesics *g, int32_t i)
{
    const dmk_site *s = g->source + i;
    if (s->vertex >= 0) return g->arrival[s->vertex].source == i ? s->vertex : -1;
    for (int32_t k = 0; k < s->n_sectors; k++) {
        const int32_t v = g->mesh->triangle[dmk_next(s->sector[k].half)];
        if (g->arrival[v].source == i) return v;
    }
    return -1;
}

/* Several sources are one root of the tree: their cells fall apart. Returns by how much there are fewer roots. */
static int32_t unite_sources(const dmk_geodesics *g, int32_t *parent)
{
    int32_t first = -1, n = 0;
    for (int32_t i = 0; i < g->n_sources; i++) {
        const int32_t v = vertex_of(g, i);
        if (first >= 0 && v >= 0) n += dmk_set_unite(parent, first, v);
        if (v >= 0) first = v;
    }
    return n;
}

/* Kruskal's algorithm: to what is in the tree comes what joins by the least jumps; edges to be kept out come last. */
static int span(dmk_context *ctx, const dmk_cotree *t, const bool *kept, bool *in_tree)
{
    int rc;
    const dmk_mesh *m = t->geodesics->mesh;
    const int32_t *ends = m->edge_vertex;
    int32_t *parent = NULL, n_wanted;
    DMK_TRY(DMK_NEW_UNSET(ctx, parent, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++) parent[v] = v;
    n_wanted = m->n_used_vertices - m->n_components - unite_sources(t->geodesics, parent);
    for (int32_t e = 0; e < m->n_edges; e++)
        n_wanted -= in_tree[e] && dmk_set_unite(parent, ends[2 * e], ends[2 * e + 1]);
    for (int32_t k = 0; k < 2 * m->n_edges && n_wanted > 0; k++) {
        const int32_t i = k < m->n_edges ? k : k - m->n_edges, e = t->order[i].item;
        /* 3 of 69 ms on 273,000 triangles */
        __builtin_prefetch(ends + 2 * t->order[dmk_min_i(i + 16, m->n_edges - 1)].item);
        if (in_tree[e] || (kept && kept[e]) != (k >= m->n_edges)) continue;
        in_tree[e] = dmk_set_unite(parent, ends[2 * e], ends[2 * e + 1]);
        n_wanted -= in_tree[e];
    }
done:
    free(parent);
    return rc;
}

static int32_t first_half_of(const dmk_cotree *t, int32_t e)
{
    const dmk_geodesics *g = t->geodesics;
    const int32_t h = dmk_half_edge_on(g->mesh, g->mesh->edge_triangle[2 * e], e);
    return is_first(g, h) ? h : g->star.twin[h];
}

static void put_on(const dmk_cotree *t, int32_t h, int32_t crossing)
{
    t->on[h] = crossing;
    if (t->geodesics->star.twin[h] >= 0) t->on[t->geodesics->star.twin[h]] = crossing;
}

/* Edge `gone` leaves the tree for `come`, whose crossing becomes its own. */
static void exchange(const dmk_cotree *t, int32_t gone, int32_t come)
{
    const int32_t h = first_half_of(t, gone), was = first_half_of(t, come);
    dmk_met met;
    put_on(t, h, t->on[was]);
    put_on(t, was, -1);
    dmk_meet_many(t->geodesics, 1, &h, &met);
    set_crossing(t, h, met.x[0], met.alpha[0], met.distance[0]);
}

int dmk_cotree_keep(dmk_context *ctx, dmk_cotree *t, const bool *kept)
{
    int rc;
    const dmk_mesh *m = t->geodesics->mesh;
    bool *in_tree = NULL;
    int32_t come = 0;
    DMK_TRY(DMK_NEW_UNSET(ctx, in_tree, (size_t)m->n_edges));
    /* What else is in the first tree is in the second one, too. */
    for (int32_t e = 0; e < m->n_edges; e++)
        in_tree[e] = !kept[e] && t->on[first_half_of(t, e)] < 0;
    DMK_TRY(span(ctx, t, kept, in_tree));
    /* As many come as go. */
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (in_tree[e] || t->on[first_half_of(t, e)] >= 0) continue;
        while (!in_tree[come] || t->on[first_half_of(t, come)] < 0) come++;
        exchange(t, e, come);
    }
    for (int32_t i = 0; i < t->n; i++) reset(t, i, kept[m->triangle_edge[t->crossing[i].half]]);
done:
    free(in_tree);
    return rc;
}

int dmk_cotree_create(dmk_context *ctx, const dmk_geodesics *g, double mean_edge, dmk_cotree *t)
{
    int rc;
    const dmk_mesh *m = g->mesh;
    int32_t *parent = NULL;
    bool *in_tree = NULL;
    memset(t, 0, sizeof *t);
    t->geodesics = g;
    t->mean_edge = mean_edge;
    DMK_TRY(DMK_NEW_UNSET(ctx, parent, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, t->on, 3 * (size_t)m->n_triangles));
    DMK_TRY(dmk_star_loops(ctx, m, &g->star, parent, &t->loop, &t->n_loops));
    DMK_TRY(DMK_NEW_UNSET(ctx, t->order, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW_UNSET(ctx, t->strength_of, (size_t)m->n_edges));
    dmk_parallel(ctx, 3 * m->n_triangles, find_jumps, t);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_sort_keyed(ctx, t->order, (size_t)m->n_edges));
    t->noise = dmk_jump_of(t, m->n_edges / 2);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(DMK_NEW(ctx, in_tree, (size_t)m->n_edges));
    DMK_TRY(span(ctx, t, NULL, in_tree));
    rc = set_crossings(ctx, in_tree, t);
done:
    free(parent);
    free(in_tree);
    return rc;
}

void dmk_cotree_free(dmk_cotree *t)
{
    free(t->order);
    free(t->loop);
    free(t->crossing);
    free(t->strength_of);
    free(t->on);
    free(t->end);
    memset(t, 0, sizeof *t);
}
