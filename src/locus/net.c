/* The graph under construction: see dmk_net in net.h. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In mesh edges. */
static const double twig = 1.5, blunt_twig = 5, too_near = 0.15, one_branch = 0.5;
/* A strong edge followed by a weak one within so many points is no end of the locus. */
enum { lookahead = 12 };

int dmk_net_add(dmk_context *ctx, dmk_net *net, int32_t *node)
{
    if (net->n == net->capacity) {
        int32_t capacity = net->capacity ? 2 * net->capacity : 256;
        dmk_node *grown = realloc(net->node, (size_t)capacity * sizeof *grown);
        if (!grown) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory for the cut locus' vertices");
        net->node = grown;
        net->capacity = capacity;
    }
    memset(&net->node[net->n], 0, sizeof *net->node);
    net->node[net->n].edge = -1;
    *node = net->n++;
    return DMK_OK;
}

void dmk_net_link(dmk_net *net, int32_t a, int32_t b)
{
    net->node[a].next[net->node[a].at.degree++] = b;
    net->node[b].next[net->node[b].at.degree++] = a;
}

static void drop(dmk_node *node, int32_t other)
{
    int32_t k = 0;
    while (node->next[k] != other)
        k++;
    node->next[k] = node->next[--node->at.degree];
}

void dmk_net_unlink(dmk_net *net, int32_t a, int32_t b)
{
    drop(&net->node[a], b);
    drop(&net->node[b], a);
}

int32_t dmk_net_onward(const dmk_net *net, int32_t a, int32_t b)
{
    const dmk_node *n = &net->node[b];
    return n->next[0] == a ? n->next[1] : n->next[0];
}

double dmk_net_distance(const dmk_net *net, int32_t a, int32_t b)
{
    const double *x = net->node[a].at.xyz, *y = net->node[b].at.xyz;
    double dx = x[0] - y[0], dy = x[1] - y[1], dz = x[2] - y[2];
    return sqrt(dx * dx + dy * dy + dz * dz);
}

double dmk_net_branch_length(const dmk_net *net, int32_t a, double limit)
{
    int32_t b = net->node[a].next[0];
    double length = dmk_net_distance(net, a, b) / net->node[a].size;
    while (net->node[b].at.degree == 2 && length < limit) {
        int32_t c = dmk_net_onward(net, a, b);
        length += dmk_net_distance(net, b, c) / net->node[b].size;
        a = b;
        b = c;
    }
    return net->node[b].at.degree > 2 ? length : HUGE_VAL;
}

void dmk_net_remove_branch(dmk_net *net, int32_t a)
{
    while (net->node[a].at.degree == 1) {
        int32_t b = net->node[a].next[0];
        dmk_net_unlink(net, a, b);
        a = b;
    }
}

/* How many points from the end a on are to go: up to the last weak one of the next few. */
static int count_weak(const dmk_net *net, int32_t a)
{
    int weak = 0;
    int32_t b = net->node[a].next[0];
    if (net->node[a].weak) weak = 1;
    for (int i = 2; i <= lookahead && net->node[b].at.degree == 2; i++) {
        if (net->node[b].weak) weak = i;
        int32_t c = dmk_net_onward(net, a, b);
        a = b;
        b = c;
    }
    return weak;
}

static void strip_weak(dmk_net *net)
{
    bool changed = true;
    while (changed) {
        changed = false;
        for (int32_t i = 0; i < net->n; i++) {
            int32_t a = i;
            while (net->node[a].at.degree == 1 && !net->node[a].border && !net->node[a].held) {
                int weak = count_weak(net, a);
                if (weak == 0) break;
                changed = true;
                for (; weak > 0 && net->node[a].at.degree == 1; weak--) {
                    int32_t b = net->node[a].next[0];
                    dmk_net_unlink(net, a, b);
                    a = b;
                }
            }
        }
    }
}

/* Shortest first, so that of two twigs at one junction the longer one may stay as the branch. */
static void remove_twigs(dmk_net *net, double limit, bool blunt_only)
{
    for (;;) {
        int32_t shortest = -1;
        double least = limit;
        for (int32_t a = 0; a < net->n; a++) {
            if (net->node[a].at.degree != 1 || net->node[a].border) continue;
            if (blunt_only ? !net->node[a].blunt : net->node[a].held) continue;
            double length = dmk_net_branch_length(net, a, limit);
            if (length >= least) continue;
            least = length;
            shortest = a;
        }
        if (shortest < 0) return;
        dmk_net_remove_branch(net, shortest);
    }
}

void dmk_net_remove_blunt(dmk_net *net)
{
    remove_twigs(net, blunt_twig, true);
}

/* Whether points x and y share a neighbour or are neighbours: joining them would double an edge. */
static bool close_by(const dmk_net *net, int32_t x, int32_t y)
{
    const dmk_node *n = &net->node[x];
    for (int32_t k = 0; k < n->at.degree; k++) {
        if (n->next[k] == y) return true;
    }
    return x == y;
}

/* Also those whose place is only a guess. */
static void remove_near_points(dmk_net *net)
{
    for (int32_t b = 0; b < net->n; b++) {
        dmk_node *n = &net->node[b];
        if (n->at.degree != 2) continue;
        int32_t a = n->next[0], c = n->next[1];
        double least = fmin(dmk_net_distance(net, a, b), dmk_net_distance(net, b, c));
        if ((least > too_near * n->size && !n->guess) || close_by(net, a, c)) continue;
        dmk_net_unlink(net, a, b);
        dmk_net_unlink(net, b, c);
        dmk_net_link(net, a, c);
    }
}

void dmk_net_strip(dmk_net *net)
{
    strip_weak(net);
    remove_twigs(net, twig, false);
}

void dmk_net_tidy(dmk_net *net)
{
    dmk_net_strip(net);
    remove_near_points(net);
}

/* The branch point at the other end of the short branch that leaves a through its neighbour b; -1
 * if it is long, ends, or comes back. *before: the last point on the way. */
static int32_t follow_short(const dmk_net *net, int32_t a, int32_t b, int32_t *before)
{
    const double limit = one_branch * net->node[a].size;
    int32_t from = a;
    double length = dmk_net_distance(net, a, b);
    while (net->node[b].at.degree == 2 && length < limit) {
        int32_t c = dmk_net_onward(net, from, b);
        from = b;
        b = c;
        length += dmk_net_distance(net, from, b);
    }
    *before = from;
    return length < limit && net->node[b].at.degree > 2 && b != a ? b : -1;
}

/* Take b's other branches over to a; the short branch between them goes. */
static void absorb(const dmk_rays *r, dmk_net *net, int32_t a, int32_t first, int32_t b,
                   int32_t before)
{
    double middle[3];
    for (int k = 0; k < 3; k++)
        middle[k] = 0.5 * (net->node[a].at.xyz[k] + net->node[b].at.xyz[k]);
    dmk_net_unlink(net, before, b);
    for (int32_t i = a, next = first; before != a && i != before; i = next) {
        next = i == a ? first : net->node[i].next[0];
        dmk_net_unlink(net, i, next);
    }
    while (net->node[b].at.degree > 0) {
        int32_t c = net->node[b].next[0];
        dmk_net_unlink(net, b, c);
        dmk_net_link(net, a, c);
    }
    dmk_point place = net->node[a].at.place;
    dmk_rays_go_to(r, middle, &place);
    dmk_net_set_place(r->mesh, place, &net->node[a].at);
}

void dmk_net_merge_branches(const dmk_rays *r, dmk_net *net)
{
    for (int32_t a = 0; a < net->n; a++) {
        for (int32_t k = 0; net->node[a].at.degree > 2 && k < net->node[a].at.degree; k++) {
            int32_t before, first = net->node[a].next[k], b = follow_short(net, a, first, &before);
            if (b < 0 || net->node[a].at.degree + net->node[b].at.degree - 2 > max_branches)
                continue;
            bool twice = false;
            for (int32_t i = 0; i < net->node[b].at.degree; i++) {
                int32_t c = net->node[b].next[i];
                twice |= c != before && close_by(net, a, c);
            }
            if (twice) continue;
            absorb(r, net, a, first, b, before);
            k = -1;
        }
    }
}

void dmk_net_free(dmk_net *net)
{
    free(net->node);
    memset(net, 0, sizeof *net);
}
