/* An end of the locus is where neighbouring geodesics first meet: the cusp of the envelope of the
 * rays around one direction. Near it the surface is nearly flat and each ray a straight line,
 * y = m z + b with z along the middle ray and y across. With m and b as functions of the direction
 * the envelope lies at z = -b' / m'; the cusp is its nearest point. m and b are polynomials fitted
 * to a bundle of rays much wider than the mesh, so that the chance bends of single rays average
 * out. */
#include "base/sort.h"
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { n_rays = 41, n_steps = 5, m_degree = 3, b_degree = 5, max_degree = 6 };
/* Each line is fitted to points this many mesh edges apart. */
static const double line_step = 1.5;
/* The envelope is trusted in the inner part of the bundle. */
static const double inner = 0.5;
/* The lines are believed this far, in mesh edges; then a new frame is set up. */
static const double far_step = 8;
/* No cusp is looked for farther away, in mesh edges. */
static const double farthest = 15;

typedef struct bundle {
    double angle, width; /* of the middle; half the bundle's */
    double distance;     /* of the frame's origin */
    double origin[3], along[3], across[3];
    double m[max_degree], b[max_degree]; /* coefficients in (direction - angle) / width */
} bundle;

static double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c)
{
    for (int k = 0; k < 3; k++) {
        int i = (k + 1) % 3, j = (k + 2) % 3;
        c[k] = a[i] * b[j] - a[j] * b[i];
    }
}

static void normalize(double *a)
{
    double length = sqrt(dot(a, a));
    for (int k = 0; k < 3; k++)
        a[k] /= length;
}

static void normal_of(const dmk_mesh *m, int64_t t, double *n)
{
    const double *x[3];
    double u[3], v[3];
    for (int k = 0; k < 3; k++)
        x[k] = m->xyz + 3 * (size_t)m->triangle[3 * t + k];
    for (int k = 0; k < 3; k++) {
        u[k] = x[1][k] - x[0][k];
        v[k] = x[2][k] - x[0][k];
    }
    cross(u, v, n);
    normalize(n);
}

/* Points of a ray at `distance` + i * step, i centred on 0. */
static bool ray_points(const dmk_rays *r, double angle, double distance, double step,
                       double x[n_steps][3], dmk_point *middle)
{
    double d[n_steps];
    dmk_point place[n_steps];
    for (int i = 0; i < n_steps; i++)
        d[i] = distance + (i - n_steps / 2) * step;
    if (!dmk_ray_points(r, angle, n_steps, d, place)) return false;
    for (int i = 0; i < n_steps; i++) {
        dmk_locus_vertex at;
        dmk_net_set_place(r->mesh, place[i], &at);
        memcpy(x[i], at.xyz, sizeof x[i]);
    }
    *middle = place[n_steps / 2];
    return true;
}

static bool set_frame(const dmk_rays *r, double step, bundle *u)
{
    double x[n_steps][3], normal[3];
    dmk_point middle;
    if (!ray_points(r, u->angle, u->distance, step, x, &middle)) return false;
    memcpy(u->origin, x[n_steps / 2], sizeof u->origin);
    for (int k = 0; k < 3; k++)
        u->along[k] = x[n_steps - 1][k] - x[0][k];
    normal_of(r->mesh, middle.triangle, normal);
    cross(normal, u->along, u->across);
    normalize(u->across);
    cross(u->across, normal, u->along);
    return true;
}

/* The line of one ray in the frame. */
static bool fit_line(const dmk_rays *r, double angle, double step, const bundle *u, double *m,
                     double *b)
{
    double x[n_steps][3], sz = 0, sy = 0, szz = 0, szy = 0;
    dmk_point middle;
    if (!ray_points(r, angle, u->distance, step, x, &middle)) return false;
    for (int i = 0; i < n_steps; i++) {
        double d[3] = {x[i][0] - u->origin[0], x[i][1] - u->origin[1], x[i][2] - u->origin[2]};
        double z = dot(d, u->along), y = dot(d, u->across);
        sz += z / n_steps;
        sy += y / n_steps;
        szz += z * z / n_steps;
        szy += z * y / n_steps;
    }
    *m = (szy - sz * sy) / (szz - sz * sz);
    *b = sy - *m * sz;
    return true;
}

/* Least squares polynomial through y at n_rays equidistant points of [-1, 1]. */
static void fit_polynomial(const double *y, const bool *use, int degree, double *c)
{
    double a[max_degree][max_degree + 1] = {{0}};
    int n = degree + 1;
    for (int i = 0; i < n_rays; i++) {
        double x = 2.0 * i / (n_rays - 1) - 1, p[2 * max_degree] = {1};
        if (!use[i]) continue;
        for (int k = 1; k < 2 * max_degree; k++)
            p[k] = p[k - 1] * x;
        for (int j = 0; j < n; j++) {
            for (int k = 0; k < n; k++)
                a[j][k] += p[j + k];
            a[j][n] += p[j] * y[i];
        }
    }
    for (int k = 0; k < n; k++) {
        for (int j = 0; j < n; j++) {
            double f = j == k ? 0 : a[j][k] / a[k][k];
            for (int i = k; i <= n; i++)
                a[j][i] -= f * a[k][i];
        }
    }
    for (int k = 0; k < n; k++)
        c[k] = a[k][n] / a[k][k];
}

/* Fit b, drop the rays that a bad triangle has thrown off their way (farther from the fit than six
 * times the median), fit again; at most half of them. */
static void fit_bundle(const double *m, const double *b, bundle *u)
{
    bool use[n_rays];
    double error[n_rays], sorted[n_rays];
    for (int i = 0; i < n_rays; i++)
        use[i] = true;
    for (int round = 0; round < 4; round++) {
        fit_polynomial(b, use, b_degree, u->b);
        for (int i = 0; i < n_rays; i++) {
            double x = 2.0 * i / (n_rays - 1) - 1, y = 0;
            for (int k = b_degree; k >= 0; k--)
                y = y * x + u->b[k];
            sorted[i] = error[i] = fabs(b[i] - y);
        }
        dmk_sort_doubles(sorted, n_rays);
        for (int i = 0; i < n_rays; i++)
            use[i] = error[i] <= 6 * sorted[n_rays / 2];
    }
    fit_polynomial(b, use, b_degree, u->b);
    fit_polynomial(m, use, m_degree, u->m);
}

static double slope(const double *c, int degree, double x)
{
    double s = 0;
    for (int k = degree; k > 0; k--)
        s = s * x + k * c[k];
    return s;
}

/* One round: the envelope's nearest point, as a direction and a length. 0: inside the bundle, 1: at
 * its side, go on from there; -1: none. */
static int find_nearest(const dmk_rays *r, double size, bundle *u, dmk_cusp *cusp)
{
    double m[n_rays], b[n_rays], least = HUGE_VAL, at = 0;
    if (!set_frame(r, line_step * size, u)) return -1;
    for (int i = 0; i < n_rays; i++) {
        double a = u->angle + u->width * (2.0 * i / (n_rays - 1) - 1);
        if (!fit_line(r, a, line_step * size, u, &m[i], &b[i])) return -1;
    }
    fit_bundle(m, b, u);
    for (int i = -50; i <= 50; i++) {
        double x = inner * i / 50, dm = slope(u->m, m_degree, x), db = slope(u->b, b_degree, x);
        if (-db / dm >= least || dm * slope(u->m, m_degree, 0) <= 0) continue;
        least = -db / dm;
        at = x;
    }
    cusp->angle = u->angle + u->width * at;
    cusp->distance = u->distance + fmax(-far_step * size, fmin(far_step * size, least));
    return fabs(at) < 0.99 * inner ? 0 : 1;
}

bool dmk_cusp_fit(const dmk_rays *r, double width, double size, dmk_cusp *cusp)
{
    bundle u = {.width = width};
    double start = cusp->distance;
    for (int round = 0; round < 16; round++) {
        u.angle = cusp->angle;
        u.distance = cusp->distance;
        int side = find_nearest(r, size, &u, cusp);
        if (side < 0 || !(fabs(cusp->distance - start) < farthest * size)) return false;
        double step = fabs(cusp->distance - u.distance);
        if (side == 0 && step < (round < 10 ? 0.02 : 0.5) * size) return true;
    }
    return false;
}
