/* Jumps, the spanning tree of least jump and the crossings of the locus: see cotree.h. */
#include "base/parallel.h"
#include "base/sets.h"
#include "base/sort.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The image of v's family, seen from v along an edge whose direction at v is `along`. */
static dmk_image image_from(const dmk_geodesics *g, int32_t v, double along)
{
    const dmk_arrival *a = g->arrival + v;
    const double turn = g->star.total[v];
    double b = a->back - along;
    if (!g->star.border[v]) b -= turn * rint(b / turn);
    double before = a->source < 0 ? 0 : g->source[a->source].offset;
    if (a->pseudo_source >= 0) before = g->distance[a->pseudo_source];
    const double r = (g->distance[v] - before) / g->star.unit;
    return (dmk_image){r * cos(b), r * sin(b), before / g->star.unit};
}

static double length_of(const dmk_geodesics *g, int32_t h)
{
    return g->mesh->length[g->mesh->triangle_edge[h]] / g->star.unit;
}

dmk_image dmk_image_at_start(const dmk_geodesics *g, int32_t h)
{
    const int32_t c = dmk_next(h);
    return image_from(g, g->mesh->triangle[c], g->star.angle[c]);
}

/* From its end the edge runs the other way. */
dmk_image dmk_image_at_end(const dmk_geodesics *g, int32_t h)
{
    const int32_t c = dmk_previous(h);
    dmk_image i = image_from(g, g->mesh->triangle[c], g->star.angle[c] + g->star.corner_angle[c]);
    i.x = length_of(g, h) - i.x;
    i.y = -i.y;
    return i;
}

double dmk_image_length(const dmk_image *i, double x, double y)
{
    return i->before + sqrt((x - i->x) * (x - i->x) + (y - i->y) * (y - i->y));
}

void dmk_apex(const dmk_geodesics *g, int32_t h, double *x, double *y)
{
    const double base = length_of(g, h), area = g->mesh->area[h / 3] / g->star.unit / g->star.unit;
    const double a = length_of(g, dmk_previous(h)), b = length_of(g, dmk_next(h));
    *x = 0.5 * (base + (a - b) * (a + b) / base);
    *y = 2 * area / base;
}

double dmk_jump(const dmk_geodesics *g, int32_t h)
{
    const dmk_mesh *m = g->mesh;
    const double length = length_of(g, h), unit = g->star.unit;
    const int32_t v = m->triangle[dmk_next(h)], w = m->triangle[dmk_previous(h)],
                  twin = g->star.twin[h];
    const dmk_image a = dmk_image_at_start(g, h), b = dmk_image_at_end(g, h);
    double at[4][2] = {{0, 0}, {length, 0}}, differ = 0;
    dmk_apex(g, h, &at[2][0], &at[2][1]);
    if (twin >= 0) {
        dmk_apex(g, twin, &at[3][0], &at[3][1]);
        at[3][0] = length - at[3][0];
        at[3][1] = -at[3][1];
    }
    for (int k = 0; k < (twin >= 0 ? 4 : 3); k++)
        differ = dmk_max(differ, fabs(dmk_image_length(&a, at[k][0], at[k][1]) -
                                      dmk_image_length(&b, at[k][0], at[k][1])));
    return dmk_max(0, dmk_image_length(&a, length, 0) - g->distance[w] / unit) +
           dmk_max(0, dmk_image_length(&b, 0, 0) - g->distance[v] / unit) + dmk_rules.tie * differ;
}

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

typedef struct jumps {
    const dmk_geodesics *geodesics;
    double unit;
    dmk_keyed *edge;
} jumps;

/* Jumps as keys: the bits of a float keep the order of numbers that are not negative. Edges between the cells of
 * two sources come behind all others, so that the tree of a source takes its own cell. */
static void find_jumps(int32_t begin, int32_t end, void *data)
{
    jumps *j = data;
    for (int32_t h = begin; h < end; h++) {
        if (!is_first(j->geodesics, h)) continue;
        const int32_t e = j->geodesics->mesh->triangle_edge[h];
        const float jump = (float)(dmk_jump(j->geodesics, h) / j->unit);
        uint32_t bits;
        memcpy(&bits, &jump, sizeof bits);
        if (dmk_parts_cells(j->geodesics, e)) bits |= UINT32_C(1) << 31;
        j->edge[e] = (dmk_keyed){bits, e};
    }
}

double dmk_jump_of(const dmk_cotree *t, int32_t k)
{
    float jump;
    const uint32_t bits = t->order[k].key & ~(UINT32_C(1) << 31);
    memcpy(&jump, &bits, sizeof jump);
    return t->mean_edge * jump;
}

/* Where the families of both ends are equally long: by Newton's method from where their images are equally far, by
 * bisection where that leaves the bracket or does not end. */
static double meeting(const dmk_image *a, const dmk_image *b, double length)
{
    double lo = 0, hi = length;
    const double small = 1e-12 * length;
    const double flo = dmk_image_length(a, 0, 0) - dmk_image_length(b, 0, 0);
    const double fhi = dmk_image_length(a, length, 0) - dmk_image_length(b, length, 0);
    if (flo >= 0) return 0; /* the start's own family is not the shorter one there */
    if (fhi <= 0) return length;
    double x = 0.5 * (b->x * b->x + b->y * b->y - a->x * a->x - a->y * a->y) / (b->x - a->x);
    if (!(x > 0 && x < length)) x = -flo * length / (fhi - flo);
    for (int i = 0; i < 60; i++) {
        const double la = dmk_image_length(a, x, 0), lb = dmk_image_length(b, x, 0), f = la - lb;
        if (f == 0) break;
        if (f < 0)
            lo = x;
        else
            hi = x;
        const double slope = (x - a->x) / (la - a->before) - (x - b->x) / (lb - b->before);
        double next = x - f / slope;
        if (!(i < 10 && next > lo && next < hi)) next = 0.5 * (lo + hi);
        const bool ends = fabs(next - x) <= small;
        x = next;
        if (ends) break;
    }
    return x < small ? 0 : x > length - small ? length : x; /* not beside where a family begins */
}

double dmk_meeting_angle(const dmk_image *a, const dmk_image *b, double x, double y)
{
    const double ax = a->x - x, ay = a->y - y, bx = b->x - x, by = b->y - y, cx = ax - bx,
                 cy = ay - by;
    if (fmin(ax * ax + ay * ay, bx * bx + by * by) < 1e-18 * (cx * cx + cy * cy)) return 0;
    return fabs(atan2(ax * by - ay * bx, ax * bx + ay * by));
}

static void set_crossing(const dmk_geodesics *g, const int32_t *loop, int32_t h, dmk_crossing *c)
{
    const dmk_mesh *m = g->mesh;
    const double length = length_of(g, h);
    const int32_t v = m->triangle[dmk_next(h)], w = m->triangle[dmk_previous(h)],
                  twin = g->star.twin[h];
    const dmk_image a = dmk_image_at_start(g, h), b = dmk_image_at_end(g, h);
    double x = meeting(&a, &b, length);
    /* behind a pseudo-source the paths are those to it, continued */
    if (g->arrival[w].pseudo_source == v) x = 0;
    if (g->arrival[v].pseudo_source == w) x = length;
    c->half = h;
    c->node[0] = h / 3;
    c->node[1] = twin >= 0 ? twin / 3 : m->n_triangles + loop[v];
    c->onward = c->outer = -1;
    c->at = x / length;
    for (int k = 0; k < 3; k++)
        c->xyz[k] = (1 - c->at) * m->xyz[3 * (size_t)v + k] + c->at * m->xyz[3 * (size_t)w + k];
    c->distance = 0.5 * g->star.unit * (dmk_image_length(&a, x, 0) + dmk_image_length(&b, x, 0));
    c->alpha = dmk_meeting_angle(&a, &b, x, 0);
    c->excess = c->worth = c->strength = HUGE_VAL;
}

typedef struct crossings {
    const bool *kept;
    dmk_cotree *cotree;
} crossings;

static void set_range(int32_t begin, int32_t end, void *data)
{
    const crossings *c = data;
    dmk_cotree *t = c->cotree;
    for (int32_t h = begin; h < end; h++) {
        if (t->on[h] < 0 || !is_first(t->geodesics, h)) continue;
        dmk_crossing *to = &t->crossing[t->on[h]];
        set_crossing(t->geodesics, t->loop, h, to);
        to->kept = c->kept && c->kept[t->geodesics->mesh->triangle_edge[h]];
    }
}

/* Crossings of the edges that are not in the tree, in place of others. */
static int set_crossings(dmk_context *ctx, const bool *in_tree, const bool *kept, dmk_cotree *t)
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
    if (!t->crossing) DMK_TRY(DMK_NEW(ctx, t->crossing, (size_t)t->n)); /* as many each time */
    dmk_parallel(ctx, 3 * m->n_triangles, set_range, &(crossings){kept, t});
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

/* Kruskal's algorithm: least jumps first, but the edges to be kept last. */
int dmk_cotree_span(dmk_context *ctx, dmk_cotree *t, const bool *kept)
{
    int rc;
    const dmk_mesh *m = t->geodesics->mesh;
    int32_t *parent = NULL, n_wanted;
    bool *in_tree = NULL;
    DMK_TRY(DMK_NEW(ctx, parent, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, in_tree, (size_t)m->n_edges));
    for (int32_t v = 0; v < m->n_vertices; v++) parent[v] = v;
    n_wanted = m->n_used_vertices - m->n_components - unite_sources(t->geodesics, parent);
    for (int32_t k = 0; k < 2 * m->n_edges && n_wanted > 0; k++) {
        const int32_t e = t->order[k < m->n_edges ? k : k - m->n_edges].item;
        if ((kept && kept[e]) != (k >= m->n_edges)) continue;
        in_tree[e] = dmk_set_unite(parent, m->edge_vertex[2 * e], m->edge_vertex[2 * e + 1]);
        n_wanted -= in_tree[e];
    }
    rc = set_crossings(ctx, in_tree, kept, t);
done:
    free(parent);
    free(in_tree);
    return rc;
}

int dmk_cotree_create(dmk_context *ctx, const dmk_geodesics *g, dmk_cotree *t)
{
    int rc;
    const dmk_mesh *m = g->mesh;
    int32_t *parent = NULL;
    memset(t, 0, sizeof *t);
    t->geodesics = g;
    for (int32_t e = 0; e < m->n_edges; e++) t->mean_edge += m->length[e] / m->n_edges;
    DMK_TRY(DMK_NEW(ctx, parent, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, t->on, 3 * (size_t)m->n_triangles));
    DMK_TRY(dmk_star_loops(ctx, m, &g->star, parent, &t->loop, &t->n_loops));
    DMK_TRY(DMK_NEW(ctx, t->order, (size_t)m->n_edges));
    jumps j = {g, t->mean_edge / g->star.unit, t->order};
    dmk_parallel(ctx, 3 * m->n_triangles, find_jumps, &j);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_sort_keyed(ctx, t->order, (size_t)m->n_edges));
    t->noise = dmk_jump_of(t, m->n_edges / 2);
    DMK_TRY(dmk_poll(ctx));
    rc = dmk_cotree_span(ctx, t, NULL);
done:
    free(parent);
    return rc;
}

void dmk_cotree_free(dmk_cotree *t)
{
    free(t->order);
    free(t->loop);
    free(t->crossing);
    free(t->on);
    free(t->end);
    memset(t, 0, sizeof *t);
}
