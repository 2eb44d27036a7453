/* The paper asks how to choose eps in {mu <= eps}. mu is a length, what is left of the ray: next to the locus
 * it is small where rays end there at a steep angle, but may be many triangles' sizes where they graze it,
 * so a bound that takes in all of the locus takes in far too much beside it. The potential knows more, and
 * in pure numbers. Where two families of rays meet at an angle alpha,
 *   - the mean of grad u over a triangle is shorter than 1: cos(alpha/2), whatever the units;
 *   - rays converge: div grad u is a line of strength 2 sin(alpha/2).
 * With s_T the sine that belongs to the mean's length, sqrt(1 - |mean grad u|^2), and k_T the sum of
 * -int grad u . grad phi_i over the triangle's corners over the root of that of int phi_i, phi_i their hat
 * functions, marked are
 *     s_T >= 0.057 g_T,   s_T + k_T >= 0.12 g_T,   g_T = max(1, sqrt(|T| / mean area)):
 * a front that is curved turns by more within a larger triangle, and a faint line of the locus may run anywhere
 * in it. The second leaves out what bends without converging: the source's blunt peak, ridges, noise.
 * Lengths are what it is made of, no coordinates, no tolerance. bench/results/acl.md has what it finds, what
 * lies beside the locus, and the rules that were worse. */
#include "solver/acl.h"

#include <math.h>
#include <stdlib.h>

static const double least_sine = 0.057;
static const double least_sum = 0.12;

/* At vertices: -int grad u . grad phi, and int phi. */
typedef struct convergence {
    double *flow, *area;
    double mean; /* area of a triangle */
} convergence;

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

/* Nothing flows in at borders, where rays end. */
static int sum_convergence(dmk_context *ctx, const dmk_acl_input *in, convergence *c)
{
    int rc;
    const dmk_mesh *m = in->mesh;
    DMK_TRY(DMK_NEW(ctx, c->flow, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, c->area, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double x[3];
        mean_gradient(in, t, x);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const int32_t *corner = m->triangle + 3 * (size_t)t;
            const double flow = 0.5 * dmk_cot(m, 3 * t + k) * (x[i] - x[j]);
            c->flow[corner[i]] -= flow;
            c->flow[corner[j]] += flow;
            c->area[corner[k]] += m->area[t] / 3;
        }
        c->mean += m->area[t] / m->n_triangles;
    }
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        for (int k = 0; k < 2; k++) c->flow[m->edge_vertex[2 * (size_t)e + (size_t)k]] = 0;
    }
done:
    return rc;
}

static bool is_marked(const dmk_acl_input *in, const convergence *c, int32_t t)
{
    double x[3], square = 0, flow = 0, area = 0;
    const dmk_mesh *m = in->mesh;
    mean_gradient(in, t, x);
    for (int k = 0; k < 3; k++) {
        const int32_t v = m->triangle[3 * (size_t)t + (size_t)k];
        const double d = x[(k + 1) % 3] - x[(k + 2) % 3];
        square += 0.5 * dmk_cot(m, 3 * t + k) * d * d / m->area[t];
        flow += c->flow[v];
        area += c->area[v];
    }
    const double sine = sqrt(fmax(0, 1 - square)), size = fmax(1, sqrt(m->area[t] / c->mean));
    return sine >= least_sine * size && sine + flow / sqrt(area) >= least_sum * size;
}

int dmk_acl_mark(dmk_context *ctx, const dmk_acl_input *in, double threshold, uint8_t *acl)
{
    int rc = DMK_OK;
    convergence c = {.mean = 0};
    if (threshold <= 0) DMK_TRY(sum_convergence(ctx, in, &c));
    for (int32_t t = 0; t < in->mesh->n_triangles; t++)
        acl[t] = threshold > 0 ? in->mu[t] <= threshold : is_marked(in, &c, t);
done:
    free(c.flow);
    free(c.area);
    return rc;
}
