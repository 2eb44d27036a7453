/* A small swallowtail of the rays gives a branch whose beams are hardly wider than the mesh edges
 * all along. Its width alone cannot be told from the noise of the mesh; but many rays together show
 * the cusp at its end, and the cusp tells how fast the branch opens. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>

/* In mesh edges: such a branch is longer than `least_length`, and its beam wider than
 * `least_width` where it begins. */
static const double least_length = 3, least_width = 1;
/* The opening by the cusp over the one seen where the branch begins, or the inverse. */
static const double same_opening = 3;
/* Points tried from the junction on. */
enum { n_tried = 3 };

/* The points of the branch that ends at `end`, the nearest to its junction first; fewer than n_tried
 * if it is short, none if it leads to another end. */
static int find_bases(const dmk_net *net, int32_t end, int32_t *base)
{
    int32_t last[n_tried] = {end, -1, -1}, b = net->node[end].next[0];
    while (net->node[b].at.degree == 2) {
        int32_t c = dmk_net_onward(net, last[0], b);
        for (int k = n_tried - 1; k > 0; k--)
            last[k] = last[k - 1];
        last[0] = b;
        b = c;
    }
    int n = 0;
    for (; n < n_tried && last[n] >= 0; n++)
        base[n] = last[n];
    return net->node[b].at.degree > 2 ? n : 0;
}

static bool leads_to_cusp(const dmk_rays *r, const dmk_node *base)
{
    const dmk_locus_vertex *v = &base->at;
    dmk_cusp cusp;
    if (base->width < least_width) return false;
    if (v->strength < dmk_rays_walk(r, v->distance, base->size)) return false;
    if (!dmk_cusp_find(r, v, base->size, &cusp)) return false;
    double way = v->distance - cusp.distance;
    double ratio = cusp.opening * way / (v->strength * v->strength);
    return way > least_length * base->size && ratio < same_opening && ratio * same_opening > 1;
}

int dmk_dual_hold_narrow(dmk_context *ctx, const dmk_rays *r, double threshold, dmk_dual *d)
{
    int rc;
    dmk_net net = {0};
    DMK_TRY(dmk_net_create(ctx, r, d, threshold, &net));
    for (int32_t i = 0; i < net.n; i++) {
        const dmk_node *node = net.node + i;
        if (node->at.degree != 1 || node->border || !node->weak) continue;
        int32_t base[n_tried];
        int n = find_bases(&net, i, base);
        for (int k = 0; k < n; k++) {
            if (!leads_to_cusp(r, &net.node[base[k]])) continue;
            d->held[net.node[base[k]].edge] = true;
            break;
        }
    }
done:
    dmk_net_free(&net);
    return rc;
}
