/* Where the locus lies: on an edge, where the two families of geodesics are equally long; in a
 * triangle where three families meet, where all three are. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>

dmk_sheet dmk_sheet_between(const dmk_chart *c, const dmk_sheet *a, const dmk_sheet *b, double s)
{
    return (dmk_sheet){a->angle + s * dmk_chart_turn(c, a->angle, b->angle),
                       a->distance + s * (b->distance - a->distance),
                       a->spread + s * (b->spread - a->spread)};
}

/* The geodesics of two families at a point: angles, their separation, the distance. */
static void set_pair(const dmk_chart *c, const dmk_sheet *a, const dmk_sheet *b,
                     dmk_locus_vertex *at)
{
    at->angle[0] = a->angle;
    at->angle[1] = b->angle;
    at->strength = fabs(dmk_chart_turn(c, a->angle, b->angle));
    at->distance = 0.5 * (a->distance + b->distance);
}

void dmk_net_set_place(const dmk_mesh *m, dmk_point place, dmk_locus_vertex *at)
{
    at->place = place;
    for (int i = 0; i < 3; i++) {
        at->xyz[i] = 0;
        for (int k = 0; k < 3; k++) {
            size_t v = (size_t)m->triangle[3 * place.triangle + k];
            at->xyz[i] += place.weight[k] * m->xyz[3 * v + (size_t)i];
        }
    }
}

/* The point on edge e, at the fraction s from its first vertex. */
static void place_on_edge(const dmk_mesh *m, int32_t e, double s, dmk_locus_vertex *at)
{
    dmk_point place = {.triangle = m->edge_triangle[2 * e]};
    for (int k = 0; k < 3; k++) {
        int32_t v = m->triangle[3 * place.triangle + k];
        if (v == m->edge_vertex[2 * e]) place.weight[k] = 1 - s;
        if (v == m->edge_vertex[2 * e + 1]) place.weight[k] = s;
    }
    dmk_net_set_place(m, place, at);
}

/* With a the family of the first vertex and b that of the second, f = a - b is <= 0 at the first
 * and
 * >= 0 at the second; its zero by linear interpolation. */
static void cross_edge(const dmk_rays *r, int32_t e, dmk_node *n)
{
    const dmk_mesh *m = r->mesh;
    int32_t v = m->edge_vertex[2 * e], w = m->edge_vertex[2 * e + 1];
    double length = m->length[e], s = 0.5;
    const dmk_sheet *av = dmk_rays_first(r, v), *bw = dmk_rays_first(r, w);
    int32_t i = dmk_rays_continue(r, av, length, w), j = dmk_rays_continue(r, bw, length, v);
    if (i == r->row[w] ||
        j == r->row[v]) { /* one family after all, or two too near to be told apart */
        n->weak = true;
        i = j = -1;
    }
    const dmk_sheet *aw = i >= 0 ? r->sheet + i : av, *bv = j >= 0 ? r->sheet + j : bw;
    if (i >= 0 && j >= 0) {
        double fv = av->distance - bv->distance, fw = aw->distance - bw->distance;
        if (fw - fv > 0) s = fmin(1, fmax(0, -fv / (fw - fv)));
    }
    dmk_sheet a = dmk_sheet_between(&r->chart, av, aw, s);
    dmk_sheet b = dmk_sheet_between(&r->chart, bv, bw, s);
    n->guess = i < 0 || j < 0;
    set_pair(&r->chart, &a, &b, &n->at);
    place_on_edge(m, e, s, &n->at);
    n->size = 0.5 * (r->size[v] + r->size[w]);
    n->width = dmk_rays_width(r, &a, &b) / n->size;
}

/* The three families of a triangle's corners at all its corners: d[family][corner]. */
static bool gather(const dmk_rays *r, int32_t t, dmk_sheet d[3][3])
{
    const dmk_mesh *m = r->mesh;
    for (int f = 0; f < 3; f++) {
        d[f][f] = *dmk_rays_first(r, m->triangle[3 * t + f]);
        for (int k = 1; k < 3; k++) {
            int c = (f + k) % 3, e = m->triangle_edge[3 * t + (f + 3 - k) % 3];
            int32_t i = dmk_rays_continue(r, &d[f][f], m->length[e], m->triangle[3 * t + c]);
            if (i < 0) return false;
            d[f][c] = r->sheet[i];
        }
    }
    return true;
}

/* Barycentric weights where the three distances, linear in the triangle, agree; brought into the
 * triangle if they fall outside. */
static bool meet(dmk_sheet d[3][3], double weight[3])
{
    double a[2][3];
    for (int f = 0; f < 2; f++) {
        for (int c = 0; c < 3; c++)
            a[f][c] = d[f][c].distance - d[f + 1][c].distance;
    }
    double sum = 0;
    for (int c = 0; c < 3; c++) {
        int c1 = (c + 1) % 3, c2 = (c + 2) % 3;
        weight[c] = a[0][c1] * a[1][c2] - a[0][c2] * a[1][c1];
        sum += weight[c];
    }
    double inside = 0;
    for (int c = 0; c < 3; c++)
        inside += weight[c] = fmax(0, weight[c] / sum);
    for (int c = 0; c < 3; c++)
        weight[c] /= inside;
    return isfinite(weight[0] + weight[1] + weight[2]);
}

static void meet_in_triangle(const dmk_rays *r, int32_t t, dmk_locus_vertex *at)
{
    dmk_sheet d[3][3], s[3];
    double weight[3] = {1.0 / 3, 1.0 / 3, 1.0 / 3};
    bool all = gather(r, t, d);
    if (!all || !meet(d, weight)) weight[0] = weight[1] = weight[2] = 1.0 / 3;
    for (int f = 0; f < 3; f++) {
        s[f] = *dmk_rays_first(r, r->mesh->triangle[3 * t + f]);
        if (!all) continue;
        dmk_sheet half = dmk_sheet_between(&r->chart, &d[f][0], &d[f][1],
                                           weight[1] / fmax(weight[0] + weight[1], 1e-300));
        s[f] = dmk_sheet_between(&r->chart, &half, &d[f][2], weight[2]);
    }
    int widest = 0;
    double turn = -1;
    for (int f = 0; f < 3; f++) {
        double x = fabs(dmk_chart_turn(&r->chart, s[f].angle, s[(f + 1) % 3].angle));
        if (x > turn) turn = x, widest = f;
    }
    set_pair(&r->chart, &s[widest], &s[(widest + 1) % 3], at);
    dmk_net_set_place(r->mesh, (dmk_point){t, {weight[0], weight[1], weight[2]}}, at);
}

static int add_crossings(dmk_context *ctx, const dmk_rays *r, const dmk_dual *dual,
                         double threshold, int32_t *node_of, dmk_net *net)
{
    const dmk_mesh *m = r->mesh;
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (!dual->kept[e]) continue;
        int rc = dmk_net_add(ctx, net, &node_of[e]);
        if (rc != DMK_OK) return rc;
        dmk_node *n = &net->node[node_of[e]];
        cross_edge(r, e, n);
        n->edge = e;
        n->weak |= dual->strength[e] < threshold;
        n->held = dual->held[e];
        n->border = m->edge_triangle[2 * e + 1] < 0;
    }
    return DMK_OK;
}

/* A triangle joins the points on its kept edges: two directly, three through a point inside. */
static int add_links(dmk_context *ctx, const dmk_rays *r, const dmk_dual *dual,
                     const int32_t *node_of, dmk_net *net)
{
    const dmk_mesh *m = r->mesh;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (dual->degree[t] < 2) continue;
        int32_t end[3], n = 0, middle;
        for (int k = 0; k < 3; k++) {
            int32_t e = m->triangle_edge[3 * t + k];
            if (dual->kept[e]) end[n++] = node_of[e];
        }
        if (n == 2) {
            dmk_net_link(net, end[0], end[1]);
            continue;
        }
        int rc = dmk_net_add(ctx, net, &middle);
        if (rc != DMK_OK) return rc;
        meet_in_triangle(r, t, &net->node[middle].at);
        net->node[middle].size = net->node[end[0]].size;
        net->node[middle].width = net->node[end[0]].width;
        for (int k = 0; k < 3; k++)
            dmk_net_link(net, middle, end[k]);
    }
    return DMK_OK;
}

int dmk_net_create(dmk_context *ctx, const dmk_rays *r, const dmk_dual *dual, double threshold,
                   dmk_net *net)
{
    int rc;
    int32_t *node_of = NULL;
    *net = (dmk_net){0};
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(DMK_NEW(ctx, node_of, (size_t)r->mesh->n_edges));
    DMK_TRY(add_crossings(ctx, r, dual, threshold, node_of, net));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(add_links(ctx, r, dual, node_of, net));
    DMK_TRY(dmk_poll(ctx));
done:
    free(node_of);
    if (rc != DMK_OK) dmk_net_free(net);
    return rc;
}
