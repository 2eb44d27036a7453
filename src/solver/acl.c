/* The paper asks how to choose eps in {mu <= eps}. mu is a length, what is left of the ray: next to the locus
 * it is small where rays end there at a steep angle, but may be many triangles' sizes where they graze it,
 * so a bound that takes in all of the locus takes in far too much beside it. The potential knows more, and
 * in pure numbers. Where two families of rays meet at an angle alpha,
 *   - the mean of grad u over a triangle is shorter than 1: cos(alpha/2), whatever the units;
 *   - rays converge: div grad u is a line of strength 2 sin(alpha/2).
 * With s_T the sine that belongs to the mean's length, sqrt(1 - |mean grad u|^2), and k_T the largest of
 * -int grad u . grad phi_i / sqrt(int phi_i) at the triangle's corners, phi_i their hat functions, marked are
 *     mu <= 28 sqrt|T|,   s_T >= 0.064,   s_T + k_T >= 0.095.
 * The first leaves out the blunt peak at the source, the last what bends without converging: ridges, noise.
 * Lengths are what it is made of, no coordinates. Of the strong exact locus (where the two shortest paths
 * differ by 0.3 edges and meet at 0.2 or more) farther than 1.5 edges from a marked triangle: 0.2 % on a
 * torus and 0 on a quartic and an ellipsoid of 65,000 to 87,000 triangles, 1 to 6 % on camel, ChineseDragon
 * and a brain, 3 to 6 and 20 to 22 % on bunny00 and armadillo, from two sources each; of the marked area
 * 3 % at most lies farther than 3 edges from the exact locus (one bunny: 6 %). mu <= sqrt|T| misses 0 to 25,
 * 9 to 34 and 32 to 55 % of these. */
#include "solver/acl.h"

#include <math.h>
#include <stdlib.h>

static const double most_mu = 28; /* in square roots of the area */
static const double least_sine = 0.064;
static const double least_sum = 0.095;

/* Corner values of the linear function with the mean of grad u over the four sub-triangles. */
static void mean_gradient(const dmk_acl_input *in, int32_t t, double x[3])
{
    const int32_t *corner = in->mesh->triangle + 3 * (size_t)t,
                  *edge = in->mesh->triangle_edge + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        const double *m = in->u_mid;
        x[k] = 0.5 * (in->u[corner[k]] + m[edge[(k + 1) % 3]] + m[edge[(k + 2) % 3]] - m[edge[k]]);
    }
}

/* convergence: -int grad u . grad phi over sqrt(int phi), at inner vertices; 0 on borders, where rays end. */
static int sum_convergence(dmk_context *ctx, const dmk_acl_input *in, double *convergence)
{
    int rc;
    const dmk_mesh *m = in->mesh;
    double *area = NULL;
    DMK_TRY(DMK_NEW(ctx, area, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double x[3];
        mean_gradient(in, t, x);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const int32_t *corner = m->triangle + 3 * (size_t)t;
            const double flow = 0.5 * dmk_cot(m, 3 * t + k) * (x[i] - x[j]);
            convergence[corner[i]] -= flow;
            convergence[corner[j]] += flow;
            area[corner[k]] += m->area[t] / 3;
        }
    }
    for (int32_t v = 0; v < m->n_vertices; v++) convergence[v] /= sqrt(fmax(area[v], 1e-300));
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        for (int k = 0; k < 2; k++) convergence[m->edge_vertex[2 * (size_t)e + (size_t)k]] = 0;
    }
done:
    free(area);
    return rc;
}

static bool is_marked(const dmk_acl_input *in, const double *convergence, int32_t t)
{
    double x[3], square = 0, top = -INFINITY;
    const dmk_mesh *m = in->mesh;
    if (!(in->mu[t] <= most_mu * sqrt(m->area[t]))) return false;
    mean_gradient(in, t, x);
    for (int k = 0; k < 3; k++) {
        const double d = x[(k + 1) % 3] - x[(k + 2) % 3];
        square += 0.5 * dmk_cot(m, 3 * t + k) * d * d / m->area[t];
        top = fmax(top, convergence[m->triangle[3 * (size_t)t + (size_t)k]]);
    }
    const double sine = sqrt(fmax(0, 1 - square));
    return sine >= least_sine && sine + top >= least_sum;
}

int dmk_acl_mark(dmk_context *ctx, const dmk_acl_input *in, double threshold, uint8_t *acl)
{
    int rc = DMK_OK;
    double *convergence = NULL;
    if (threshold <= 0) {
        DMK_TRY(DMK_NEW(ctx, convergence, (size_t)in->mesh->n_vertices));
        DMK_TRY(sum_convergence(ctx, in, convergence));
    }
    for (int32_t t = 0; t < in->mesh->n_triangles; t++)
        acl[t] = threshold > 0 ? in->mu[t] <= threshold : is_marked(in, convergence, t);
done:
    free(convergence);
    return rc;
}
