/* The ends of the net: led to where the two geodesics that meet on the branch become one. The last
 * points before the end are noisy, their two geodesics being too near to each other for the mesh;
 * they are replaced. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In mesh edges: a beam this wide is resolved. Points looked at for narrower ones. */
static const double resolved = 8;
enum { max_unresolved = 8 };
/* Half the angle of the bundle of rays for the fit, over that between the two geodesics that meet
 * near by; or its greatest width on the way, in mesh edges. */
static const double bundle_width = 0.3, bundle_edges = 4;
/* In mesh edges: a fit this far from where the curvature lets the rays meet is wrong. */
static const double astray = 1.5;
/* In mesh edges: a cusp not known any better is of no help. */
static const double vague = 4;
/* Of the angle between the two geodesics: nearer to one of them is another branch's cusp. */
static const double margin = 0.15;
/* In mesh edges: ends with cusps so near to each other have one; branches so short may be twins. */
static const double one_tip = 1, twin = 10;
/* In mesh edges: no end is farther from its cusp. */
static const double far = 10;

/* The point of the branch behind which its beam is resolved. */
static int32_t find_resolved(const dmk_net *net, int32_t end)
{
    int32_t a = end, b = net->node[end].next[0], keep = end;
    for (int i = 0; i < max_unresolved && net->node[b].at.degree == 2; i++) {
        int32_t c = dmk_net_onward(net, a, b);
        if (net->node[a].width < resolved) keep = b;
        a = b;
        b = c;
    }
    return keep;
}

static void cut_at(dmk_net *net, int32_t end, int32_t keep)
{
    while (end != keep) {
        int32_t next = net->node[end].next[0];
        dmk_net_unlink(net, end, next);
        end = next;
    }
}

/* Drop the points that are nearer to the source than the end is. Returns the end left. */
static int32_t cut_back(dmk_net *net, int32_t end, double distance)
{
    while (net->node[end].at.distance < distance) {
        int32_t next = net->node[end].next[0];
        if (net->node[next].at.degree != 2) break;
        dmk_net_unlink(net, end, next);
        end = next;
    }
    return end;
}

/* Lead the branch from its end to the tip in steps of about an edge: along the ray of the tip, to
 * which it is tangent there, with the offset of the present end fading as the square of the way. */
static int lead_on(dmk_context *ctx, const dmk_rays *r, dmk_net *net, int32_t end, double angle,
                   double distance)
{
    const dmk_node from = net->node[end];
    double reach = from.at.distance - distance;
    int steps = (int)ceil(reach / from.size);
    dmk_locus_vertex beside;
    dmk_point place = {0};
    if (!dmk_ray_points(r, angle, 1, &from.at.distance, &place)) return DMK_OK;
    dmk_net_set_place(r->mesh, place, &beside);
    for (int i = steps - 1; i >= 0; i--) {
        double part = (double)i / steps, d = distance + reach * part, goal[3];
        dmk_node n = {.edge = -1, .size = from.size, .width = from.width * part};
        int32_t next;
        if (!dmk_ray_points(r, angle, 1, &d, &place)) return DMK_OK;
        dmk_net_set_place(r->mesh, place, &n.at);
        for (int k = 0; k < 3; k++) {
            goal[k] = n.at.xyz[k] + part * part * (from.at.xyz[k] - beside.xyz[k]);
        }
        dmk_rays_go_to(r, goal, &place);
        dmk_net_set_place(r->mesh, place, &n.at);
        n.at.distance = d;
        n.at.strength = from.at.strength * sqrt(part);
        n.at.angle[0] = angle - 0.5 * n.at.strength;
        n.at.angle[1] = angle + 0.5 * n.at.strength;
        int rc = dmk_net_add(ctx, net, &next);
        if (rc != DMK_OK) return rc;
        net->node[next] = n;
        dmk_net_link(net, end, next);
        end = next;
    }
    return DMK_OK;
}

typedef struct tip {
    int32_t end; /* of the net; -1: gone */
    bool found;
    dmk_cusp cusp;
    double xyz[3]; /* of the cusp */
} tip;

static double distance(const double *x, const double *y)
{
    return hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
}

/* The cusp at the end of the branch on which v lies. The curvature alone tells it to within an edge
 * or so, where the mesh is not too rough for that; the rays themselves, fitted, do better, unless
 * the fit goes astray. */
static bool find_cusp(const dmk_rays *r, const dmk_locus_vertex *v, double size, dmk_cusp *cusp)
{
    const double *angle = v->angle, turn = dmk_chart_turn(&r->chart, angle[0], angle[1]);
    double middle = angle[0] + 0.5 * turn;
    const double least = v->distance - far * size, most = v->distance + astray * size;
    const dmk_cusp *known =
        dmk_rays_cusp(r, angle[0] + margin * turn, angle[1] - margin * turn, least, most);
    if (known && known->doubt > vague * size) known = NULL;
    double near = known ? fmax(astray * size, known->doubt) : 0;
    *cusp = (dmk_cusp){.angle = middle, .distance = v->distance};
    bool found = dmk_cusp_fit(r, bundle_width * v->strength, size, cusp);
    if (!known || (found && fabs(cusp->distance - known->distance) < near)) return found;
    *cusp = *known;
    found = dmk_cusp_fit(r, bundle_edges * size / known->widest, size, cusp);
    if (!found || fabs(cusp->distance - known->distance) > near) *cusp = *known;
    return true;
}

static void look_for_tip(const dmk_rays *r, const dmk_net *net, tip *t)
{
    const dmk_node *end = &net->node[t->end];
    const dmk_locus_vertex *v = &net->node[find_resolved(net, t->end)].at;
    dmk_point place = {0};
    dmk_locus_vertex at;
    t->found = find_cusp(r, v, end->size, &t->cusp) &&
               dmk_ray_points(r, t->cusp.angle, 1, &t->cusp.distance, &place);
    if (!t->found) return;
    dmk_net_set_place(r->mesh, place, &at);
    memcpy(t->xyz, at.xyz, sizeof t->xyz);
    t->found = distance(end->at.xyz, at.xyz) < far * end->size;
}

static int move_tip(dmk_context *ctx, const dmk_rays *r, dmk_net *net, const tip *t)
{
    int32_t keep = find_resolved(net, t->end);
    if (t->cusp.distance < net->node[keep].at.distance)
        cut_at(net, t->end, keep);
    else
        keep = cut_back(net, t->end, t->cusp.distance);
    return lead_on(ctx, r, net, keep, t->cusp.angle, t->cusp.distance);
}

/* Near its end a branch may have come out as two side by side: of two ends with one cusp the one
 * that is nearer to its junction goes. */
static void drop_twins(dmk_net *net, tip *t, int32_t n)
{
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j < n && t[i].end >= 0 && t[i].found; j++) {
            if (j == i || t[j].end < 0 || !t[j].found) continue;
            double mine = dmk_net_branch_length(net, t[i].end, twin);
            double apart = distance(t[i].xyz, t[j].xyz);
            if (apart > one_tip * net->node[t[i].end].size || mine > twin) continue;
            if (mine > dmk_net_branch_length(net, t[j].end, twin)) continue;
            dmk_net_remove_branch(net, t[i].end);
            t[i].end = -1;
        }
    }
}

int dmk_net_fit_tips(dmk_context *ctx, const dmk_rays *r, dmk_net *net)
{
    int rc = DMK_OK;
    int32_t n = 0, n_nodes = net->n;
    tip *tips = NULL;
    for (int32_t i = 0; i < n_nodes; i++)
        n += net->node[i].at.degree == 1 && !net->node[i].border;
    DMK_TRY(DMK_NEW(ctx, tips, (size_t)n));
    for (int32_t i = n = 0; i < n_nodes; i++) {
        if (net->node[i].at.degree != 1 || net->node[i].border) continue;
        DMK_TRY(dmk_poll(ctx));
        tips[n].end = i;
        look_for_tip(r, net, &tips[n++]);
    }
    drop_twins(net, tips, n);
    for (int32_t i = 0; i < n; i++) {
        if (tips[i].end < 0) continue;
        if (tips[i].found)
            DMK_TRY(move_tip(ctx, r, net, &tips[i]));
        else
            net->node[tips[i].end].blunt = true;
    }
    dmk_net_remove_blunt(net);
done:
    free(tips);
    return rc;
}
