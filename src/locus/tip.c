/* The ends. Just behind an ordinary end, a conjugate point, the two geodesics part as the square
 * root of the way: with g the angle between them and s the arc length, g^2 is linear in s to first
 * order. The mesh resolves this only where g is large enough; from there the end is extrapolated,
 * and the branch is led on to it along the ray that reaches it. */
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>

enum { max_points = 200, min_points = 5 };
/* Fit where g is at most this, radians, but over `least_reach` mesh edges at least. */
static const double max_angle = 0.9, least_reach = 8;
/* In mesh edges: no end is moved farther. */
static const double max_move = 12;

typedef struct tail {
    int n;
    double size;
    int32_t node[max_points];
    double s[max_points], q[max_points]; /* arc length from the end; g^2 */
    double middle[max_points];           /* angle between the two geodesics', continuous */
    double distance[max_points];
} tail;

/* Weighted least squares y = c0 + c1 x + ... of degree 1 or 2 over the tail's points. */
static bool fit(int n, const double *x, const double *y, const double *weight, int degree,
                double *c)
{
    double a[3][4] = {{0}};
    int m = degree + 1;
    for (int i = 0; i < n; i++) {
        double p[3] = {1, x[i], x[i] * x[i]};
        for (int r = 0; r < m; r++) {
            for (int k = 0; k < m; k++)
                a[r][k] += weight[i] * p[r] * p[k];
            a[r][3] += weight[i] * p[r] * y[i];
        }
    }
    for (int k = 0; k < m; k++) {
        if (!(fabs(a[k][k]) > 1e-14 * a[0][0] * pow(fabs(x[n - 1]), 2 * k))) return false;
        for (int r = 0; r < m; r++) {
            double f = r == k ? 0 : a[r][k] / a[k][k];
            for (int j = 0; j < 4; j++)
                a[r][j] -= f * a[k][j];
        }
    }
    for (int k = 0; k < 3; k++)
        c[k] = k < m ? a[k][3] / a[k][k] : 0;
    return true;
}

/* The points from the end on. */
static void gather(const dmk_net *net, const dmk_chart *chart, int32_t end, tail *t)
{
    int32_t a = -1, b = end;
    t->n = 0;
    t->size = net->node[end].size;
    double s = 0;
    while (t->n < max_points && net->node[b].at.degree <= 2) {
        const dmk_locus_vertex *v = &net->node[b].at;
        if (a >= 0) s += dmk_net_distance(net, a, b);
        if (v->strength > max_angle && s > least_reach * t->size) break;
        double turn = dmk_chart_turn(chart, v->angle[0], v->angle[1]);
        double middle = v->angle[0] + 0.5 * turn;
        int i = t->n++;
        t->node[i] = b;
        t->s[i] = s;
        t->q[i] = v->strength * v->strength;
        t->middle[i] =
            i ? t->middle[i - 1] + dmk_chart_turn(chart, t->middle[i - 1], middle) : middle;
        t->distance[i] = v->distance;
        if (v->degree == 1 && a >= 0) break;
        int32_t c = a < 0 ? net->node[b].next[0] : dmk_net_onward(net, a, b);
        a = b;
        b = c;
    }
}

/* s as a function of q: s(0) is where the end belongs (negative: beyond the present one). The noise
 * of q is that of g times g, that of g falls as 1 / g^2: weights g^2. Outliers are dropped once. */
static bool fit_end(tail *t, double *c)
{
    double weight[max_points];
    int degree = t->n >= 2 * min_points ? 2 : 1;
    if (t->n < min_points) return false;
    for (int i = 0; i < t->n; i++)
        weight[i] = t->q[i];
    if (!fit(t->n, t->q, t->s, weight, degree, c)) return false;
    double sum = 0, total = 0;
    for (int i = 0; i < t->n; i++) {
        double e = t->s[i] - c[0] - t->q[i] * (c[1] + t->q[i] * c[2]);
        sum += weight[i] * e * e;
        total += weight[i];
    }
    for (int i = 0; i < t->n; i++) {
        double e = t->s[i] - c[0] - t->q[i] * (c[1] + t->q[i] * c[2]);
        if (e * e > 6 * sum / total) weight[i] = 0;
    }
    return fit(t->n, t->q, t->s, weight, degree, c) && c[1] > 0;
}

/* Drop the points nearer than s to the end, the last one kept becoming the end. */
static void cut_back(dmk_net *net, const tail *t, double s)
{
    for (int i = 0; i + 2 < t->n && t->s[i + 1] < s; i++) {
        dmk_net_unlink(net, t->node[i], t->node[i + 1]);
    }
}

/* Lead the branch to the end at -reach along one ray, in steps of about a mesh edge. */
static int lead_on(dmk_context *ctx, const dmk_rays *r, dmk_net *net, const tail *t, double reach,
                   const double *c)
{
    double one[max_points], middle[3], distance[3], angle;
    for (int i = 0; i < t->n; i++)
        one[i] = 1;
    if (!fit(t->n, t->s, t->middle, t->q, 1, middle)) return DMK_OK;
    if (!fit(t->n, t->s, t->distance, one, t->n >= 2 * min_points ? 2 : 1, distance)) return DMK_OK;
    angle = middle[0] - reach * middle[1];
    int steps = (int)ceil(reach / t->size);
    int32_t last = t->node[0];
    for (int i = 1; i <= steps; i++) {
        double s = -reach * i / steps, d = distance[0] + s * (distance[1] + s * distance[2]);
        dmk_node n = {.size = t->size};
        dmk_point place;
        int32_t next;
        if (!dmk_ray_point(r, angle, d, &place)) return DMK_OK;
        dmk_net_set_place(r->mesh, place, &n.at);
        n.at.distance = d;
        n.at.strength = sqrt(fmax(0, (s - c[0]) / c[1]));
        n.at.angle[0] = angle - 0.5 * n.at.strength;
        n.at.angle[1] = angle + 0.5 * n.at.strength;
        int rc = dmk_net_add(ctx, net, &next);
        if (rc != DMK_OK) return rc;
        net->node[next] = n;
        if (dmk_net_distance(net, last, next) > 2 * t->size + reach / steps) return DMK_OK;
        dmk_net_link(net, last, next);
        last = next;
    }
    return DMK_OK;
}

int dmk_net_fit_tips(dmk_context *ctx, const dmk_rays *r, dmk_net *net)
{
    int rc = DMK_OK;
    tail *t = NULL;
    int32_t n = net->n;
    DMK_TRY(DMK_NEW(ctx, t, 1));
    for (int32_t i = 0; i < n; i++) {
        double c[3];
        if (net->node[i].at.degree != 1 || net->node[i].border) continue;
        gather(net, &r->chart, i, t);
        if (!fit_end(t, c)) continue;
        double reach = fmin(-c[0], max_move * t->size);
        if (reach < 0)
            cut_back(net, t, fmin(-reach, 3 * t->size));
        else if (reach > 0.1 * t->size)
            DMK_TRY(lead_on(ctx, r, net, t, reach, c));
    }
done:
    free(t);
    return rc;
}
