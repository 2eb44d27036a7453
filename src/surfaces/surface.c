/* The table of built-in surfaces: see surface.h. */
#include "surfaces/surface.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- implicit functions ---------------------------------------------------------------------- */

/* ((sqrt(x^2 + y^2) - a)^2 + z^2) / b^2 - 1 */
static double torus_value(const double s[3], const double x[3], double g[3])
{
    double rho = sqrt(x[0] * x[0] + x[1] * x[1]), d = rho - s[0], w = 1.0 / (s[1] * s[1]);
    double radial = rho > 0 ? 2.0 * w * d / rho : 0.0;
    g[0] = radial * x[0];
    g[1] = radial * x[1];
    g[2] = 2.0 * w * x[2];
    return (d * d + x[2] * x[2]) * w - 1.0;
}

/* (x/a)^2 + (y/b)^2 + (z/c)^2 - 1 */
static double ellipsoid_value(const double s[3], const double x[3], double g[3])
{
    double sum = -1.0;
    for (int i = 0; i < 3; i++) {
        double q = x[i] / s[i];
        g[i] = 2.0 * q / s[i];
        sum += q * q;
    }
    return sum;
}

/* (x/a)^4 + (y/b)^4 + (z/c)^4 - 1 */
static double quartic_value(const double s[3], const double x[3], double g[3])
{
    double sum = -1.0;
    for (int i = 0; i < 3; i++) {
        double q = x[i] / s[i];
        g[i] = 4.0 * q * q * q / s[i];
        sum += q * q * q * q;
    }
    return sum;
}

/* (x^2 + y^2 + z^2) / a^2 - 1 */
static double sphere_value(const double s[3], const double x[3], double g[3])
{
    double ball[3] = {s[0], s[0], s[0]};
    return ellipsoid_value(ball, x, g);
}

static const char *torus_check(const double s[3])
{
    return s[1] < s[0] && s[1] * 10000 >= s[0]
               ? NULL
               : "the tube radius b must be smaller than a, or it meets itself, and at least a "
                 "ten-thousandth of it, or too many triangles are needed";
}

/* ---- triangulations to start from ------------------------------------------------------------ */

static int new_patch(dmk_context *ctx, int32_t n_vertices, int32_t n_triangles, dmk_patch *p)
{
    int rc;
    p->n_vertices = n_vertices;
    p->n_triangles = n_triangles;
    DMK_TRY(DMK_NEW(ctx, p->xyz, 3 * (size_t)n_vertices));
    DMK_TRY(DMK_NEW(ctx, p->triangle, 3 * (size_t)n_triangles));
done:
    return rc;
}

/* A crooked octahedron, blown up to the surface's box and lifted: for surfaces that are star-shaped
 * about 0. No edge lies in a coordinate plane and no two are equal: the surfaces are symmetric to
 * those planes, and the mesh must not be. Corners 2i and 2i + 1 are about opposite. */
static int octahedron_start(dmk_context *ctx, const dmk_body *body, dmk_patch *p)
{
    static const int8_t face[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                      {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    static const double direction[6][3] = {{0.83, 0.42, -0.33}, {-0.86, -0.38, 0.37},
                                           {-0.06, 0.65, 0.75}, {0.02, -0.72, -0.69},
                                           {0.56, -0.57, 0.61}, {-0.51, 0.63, -0.56}};
    int rc;
    DMK_TRY(new_patch(ctx, 6, 8, p));
    for (int v = 0; v < 6; v++) {
        double *x = p->xyz + 3 * v;
        for (int i = 0; i < 3; i++) {
            double extent = body->size[i] > 0 ? body->size[i] : body->size[0];
            x[i] = extent * direction[v][i];
        }
        dmk_body_lift(body, x);
    }
    for (int i = 0; i < 24; i++) p->triangle[i] = face[i / 3][i % 3];
done:
    return rc;
}

/* A crooked grid of quadrangles, cut along a diagonal: 5 around the tube, and along it so many that
 * they are about square (wider ones would pull the tube flat). Each ring is turned against the last
 * one by 1/n of a step, which closes after n rings, and the nodes are off the grid by up to a tenth
 * of a step, so that nothing is symmetric. */
static int torus_start(dmk_context *ctx, const dmk_body *body, dmk_patch *p)
{
    int rc;
    const double a = body->size[0], b = body->size[1];
    const int32_t n = (int32_t)ceil(6.0 * a / b), m = 5;
    DMK_TRY(new_patch(ctx, n * m, 2 * n * m, p));
    for (int32_t i = 0; i < n; i++) {
        for (int32_t j = 0; j < m; j++) {
            double off_u = (7 * i + 5 * j) % 11 / 110.0, off_v = (3 * i + 4 * j) % 13 / 130.0;
            double u = 2.0 * M_PI * (i + off_u) / n;
            double v = 2.0 * M_PI * (j + off_v + (double)i / n) / m;
            double *x = p->xyz + 3 * (i * m + j);
            x[0] = (a + b * cos(v)) * cos(u);
            x[1] = (a + b * cos(v)) * sin(u);
            x[2] = b * sin(v);
            int32_t next = (i + 1) % n, twist = i + 1 == n; /* the shifts add up to one step */
            int32_t p00 = i * m + j, p01 = i * m + (j + 1) % m;
            int32_t p10 = next * m + (j + twist) % m, p11 = next * m + (j + 1 + twist) % m;
            int32_t quad[6] = {p00, p10, p01, p10, p11, p01};
            memcpy(p->triangle + 6 * (i * m + j), quad, sizeof quad);
        }
    }
done:
    return rc;
}

/* ---- the table ------------------------------------------------------------------------------- */

static const dmk_surface surfaces[] = {
    {"torus",
     "A = 2: from the axis to the middle of the tube, B = 1: radius of the tube",
     {2, 1, 0},
     5424,
     0,
     false,
     torus_value,
     torus_check,
     torus_start},
    {"ellipsoid",
     "semi-axes A = 0.2, B = 0.6, C = 1",
     {0.2, 0.6, 1},
     1064,
     2,
     true,
     ellipsoid_value,
     NULL,
     octahedron_start},
    {"quartic",
     "(x/A)^4 + (y/B)^4 + (z/C)^4 = 1, A = B = C = 1",
     {1, 1, 1},
     4272,
     2,
     true,
     quartic_value,
     NULL,
     octahedron_start},
    {"sphere", "radius A = 1", {1, 0, 0}, 1280, 2, false, sphere_value, NULL, octahedron_start},
};

const dmk_surface *dmk_surface_get(size_t index)
{
    return index < sizeof surfaces / sizeof *surfaces ? &surfaces[index] : NULL;
}

const char *dmk_surface_name(size_t index)
{
    const dmk_surface *s = dmk_surface_get(index);
    return s ? s->name : NULL;
}

const char *dmk_surface_text(size_t index)
{
    const dmk_surface *s = dmk_surface_get(index);
    return s ? s->text : NULL;
}

/* ---- to the surface -------------------------------------------------------------------------- */

/* Newton on t -> F(x + t grad F): quadratic, so rounding is reached soon after |F| < 1e-8; there F
 * only flickers, and the best x seen is the answer. */
bool dmk_body_lift(const dmk_body *body, double x[3])
{
    double best = INFINITY, best_x[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < 200 && best > 0; i++) {
        double g[3];
        double f = body->surface->value(body->size, x, g);
        double square = g[0] * g[0] + g[1] * g[1] + g[2] * g[2];
        if (fabs(f) < best) {
            best = fabs(f);
            memcpy(best_x, x, sizeof best_x);
        } else if (best < 1e-8) {
            break;
        }
        if (!(square > 0) || !isfinite(f / square)) break;
        for (int k = 0; k < 3; k++) x[k] -= f / square * g[k];
    }
    memcpy(x, best_x, sizeof best_x);
    return best < 1e-8;
}

void dmk_body_normal(const dmk_body *body, const double x[3], double n[3])
{
    body->surface->value(body->size, x, n);
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int k = 0; k < 3; k++) n[k] = length > 0 ? n[k] / length : 0;
}

/* From the Newton point, descend |x - target|^2 along the surface: go by the tangential part of
 * target - x, halved until it helps, and lift. */
bool dmk_body_nearest(const dmk_body *body, double x[3])
{
    const double target[3] = {x[0], x[1], x[2]};
    if (!dmk_body_lift(body, x)) return false;
    double best = dmk_distance_squared(x, target);
    for (int i = 0; i < 2000; i++) {
        double n[3], tangent[3], along = 0, trial[3], now = best, step = 1.0;
        dmk_body_normal(body, x, n);
        for (int k = 0; k < 3; k++) along += (target[k] - x[k]) * n[k];
        for (int k = 0; k < 3; k++) tangent[k] = target[k] - x[k] - along * n[k];
        for (; step > 1e-6 && now >= best; step *= 0.5) {
            for (int k = 0; k < 3; k++) trial[k] = x[k] + step * tangent[k];
            if (dmk_body_lift(body, trial)) now = dmk_distance_squared(trial, target);
        }
        if (now >= best) break;
        best = now;
        memcpy(x, trial, sizeof trial);
    }
    return true;
}
