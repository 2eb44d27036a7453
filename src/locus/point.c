/* A locus that is one point (the antipode on a sphere, the point opposite an umbilic): rays of all
 * directions meet there, at one distance. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { n_rays = 64 };
/* In mean mesh edges: rays that come within `meeting` of one point (root mean square) meet there,
 * as far as the mesh can tell; a locus shorter than about four times that is not told from a point.
 * The length at which they do is looked for this far from that of the farthest vertex. */
static const double meeting = 1.0, search = 5.0;

typedef struct focus {
    double xyz[3];   /* where the rays come nearest to each other */
    double distance; /* the length at which they do */
    double scatter;  /* root mean square distance of their ends from there */
    dmk_point place; /* of the end that lies nearest to it */
} focus;

/* Ends of rays in all directions at the given length; false if one meets a border. */
static bool shoot_all(const dmk_rays *r, double length, double x[n_rays][3], dmk_point *place)
{
    for (int i = 0; i < n_rays; i++) {
        dmk_locus_vertex at;
        if (!dmk_ray_points(r, (i + 0.5) * r->chart.total / n_rays, 1, &length, &place[i]))
            return false;
        dmk_net_set_place(r->mesh, place[i], &at);
        memcpy(x[i], at.xyz, sizeof x[i]);
    }
    return true;
}

static double scatter(double x[n_rays][3], double mean[3])
{
    double sum = 0;
    for (int k = 0; k < 3; k++) {
        mean[k] = 0;
        for (int i = 0; i < n_rays; i++)
            mean[k] += x[i][k] / n_rays;
        for (int i = 0; i < n_rays; i++)
            sum += (x[i][k] - mean[k]) * (x[i][k] - mean[k]) / n_rays;
    }
    return sqrt(sum);
}

/* The length with the least scatter, by golden section between `lo` and `hi`. */
static bool find_focus(const dmk_rays *r, double lo, double hi, focus *f)
{
    const double g = 0.6180339887498949;
    double x[n_rays][3];
    dmk_point place[n_rays];
    double a = hi - g * (hi - lo), b = lo + g * (hi - lo), fa = -1, fb = -1;
    for (int i = 0; i < 24; i++) {
        if (fa < 0 && !shoot_all(r, a, x, place)) return false;
        if (fa < 0) fa = scatter(x, f->xyz);
        if (fb < 0 && !shoot_all(r, b, x, place)) return false;
        if (fb < 0) fb = scatter(x, f->xyz);
        if (fa < fb)
            hi = b, b = a, fb = fa, a = hi - g * (hi - lo), fa = -1;
        else
            lo = a, a = b, fa = fb, b = lo + g * (hi - lo), fb = -1;
    }
    f->distance = 0.5 * (lo + hi);
    if (!shoot_all(r, f->distance, x, place)) return false;
    f->scatter = scatter(x, f->xyz);
    double least = HUGE_VAL;
    for (int i = 0; i < n_rays; i++) {
        double d = hypot(hypot(x[i][0] - f->xyz[0], x[i][1] - f->xyz[1]), x[i][2] - f->xyz[2]);
        if (d < least) least = d, f->place = place[i];
    }
    return true;
}

/* The farthest vertex stands in where the rays do not meet but nothing of the graph is left. */
static void take_farthest(const dmk_rays *r, int32_t far, focus *f)
{
    const dmk_mesh *m = r->mesh;
    int32_t h = 0;
    while (m->triangle[h] != far)
        h++;
    f->distance = dmk_rays_first(r, far)->distance;
    f->place = (dmk_point){h / 3, {h % 3 == 0, h % 3 == 1, h % 3 == 2}};
}

static int become_point(dmk_context *ctx, const dmk_rays *r, const focus *f, dmk_net *net)
{
    int32_t i;
    net->n = 0;
    int rc = dmk_net_add(ctx, net, &i);
    if (rc != DMK_OK) return rc;
    dmk_locus_vertex *at = &net->node[i].at;
    dmk_net_set_place(r->mesh, f->place, at);
    at->kind = DMK_LOCUS_POINT;
    at->distance = f->distance;
    at->strength = 0.5 * r->chart.total;
    at->angle[1] = 0.5 * r->chart.total;
    return DMK_OK;
}

int dmk_net_shrink(dmk_context *ctx, const dmk_rays *r, const dmk_dual *dual, dmk_net *net)
{
    int32_t far = 0, links = 0;
    double x[n_rays][3], mean[3], h = r->mean;
    dmk_point place[n_rays];
    focus f;
    if (dual->betti > 0 || dual->n_loops > 0) return DMK_OK;
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        if (dmk_rays_first(r, v)->distance > dmk_rays_first(r, far)->distance) far = v;
    }
    for (int32_t i = 0; i < net->n; i++)
        links += net->node[i].at.degree;
    double d = dmk_rays_first(r, far)->distance;
    bool near = shoot_all(r, d, x, place) && scatter(x, mean) < search * h;
    if (near && find_focus(r, d - search * h, d + search * h, &f) && f.scatter < meeting * h) {
        return become_point(ctx, r, &f, net);
    }
    if (links > 0) return DMK_OK;
    take_farthest(r, far, &f);
    return become_point(ctx, r, &f, net);
}
