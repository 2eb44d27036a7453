/* The ends of the net: led to where the two geodesics that meet on the branch become one. The last
 * points before the end are noisy, their two geodesics being too near to each other for the mesh;
 * they are replaced. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>

/* In mesh edges: a beam this wide is resolved. Points looked at for narrower ones. */
static const double resolved = 8;
enum { max_unresolved = 8 };

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
    dmk_point place;
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

int dmk_net_fit_tips(dmk_context *ctx, const dmk_rays *r, dmk_net *net)
{
    int rc = DMK_OK;
    int32_t n = net->n;
    for (int32_t i = 0; i < n; i++) {
        if (net->node[i].at.degree != 1 || net->node[i].border) continue;
        int32_t keep = find_resolved(net, i);
        const dmk_locus_vertex *v = &net->node[keep].at;
        dmk_cusp cusp;
        if (!dmk_cusp_find(r, v, net->node[i].size, &cusp)) {
            net->node[i].blunt = true;
            continue;
        }
        if (cusp.distance < v->distance)
            cut_at(net, i, keep);
        else
            keep = cut_back(net, i, cusp.distance);
        DMK_TRY(lead_on(ctx, r, net, keep, cusp.angle, cusp.distance));
    }
    dmk_net_remove_blunt(net);
done:
    return rc;
}
