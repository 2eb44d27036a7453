/* The paper asks how to choose eps in {mu <= eps}. mu is a length, what is left of the ray: next to the locus
 * it is small where rays end there at a steep angle, but may be many triangles' sizes where they graze it,
 * so a bound that takes in all of the locus takes in far too much beside it. The potential knows more, and
 * in pure numbers. Where two families of rays meet at an angle alpha,
 *   - the mean of grad u over a triangle is shorter than 1: cos(alpha/2), whatever the units;
 *   - rays converge: div grad u is a line of strength 2 sin(alpha/2).
 * With s_T the sine that belongs to the mean's length, sqrt(1 - |mean grad u|^2), and k_T the sum of
 * -int grad u . grad phi_i over the triangle's corners over the root of that of int phi_i, phi_i their hat
 * functions, marked are
 *     s_T >= 0.066 g_T,   s_T + k_T >= 0.12 g_T,   g_T = max(1, sqrt(|T| / mean area)):
 * a front that is curved turns by more within a larger triangle, and a faint line of the locus may run anywhere
 * in it. The second leaves out what bends without converging: the source's blunt peak, ridges, noise.
 * At long ends, where the paths meet at 0.2 to 0.4 rad and graze the locus, the discrete u turns within several
 * triangles, and no one of them shows it; but the rays converge more there than around. With c and C the means of
 * -div grad u over about 2 and 8 rings of triangles, and x = (c - C) sqrt(area around a vertex / 3), marked are also
 *     x >= 0.012 g_T^2,   x >= 0.76 of the largest x within 5 rings,   k_T >= 0.06 g_T,   mu <= 25 sqrt |T|:
 * a crest of the convergence. Rays that end far away converge faintly, too, on a camel's belly: the last bound leaves
 * that out. It needs mu as a length, what is left of a ray.
 * Lengths are what it is made of, no coordinates, no tolerance. bench/results/acl.md has what it finds, what
 * lies beside the locus, and the rules that were worse. */
#include "solver/acl.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double least_sine = 0.066;
static const double least_sum = 0.12;
static const double least_crest = 0.012;
static const double crest_share = 0.76; /* of the largest around */
static const double most_mu = 25;       /* in square roots of the area */
enum { FINE = 2, COARSE = 8, RINGS = 5 };

/* Of a vertex, or around it: -int grad u . grad phi, and int phi. */
typedef struct gathering {
    double flow, area;
} gathering;

typedef struct convergence {
    gathering *at;  /* vertices */
    double *crest;  /* triangles: x; NULL without mu */
    double *around; /* the largest of it within RINGS */
    double mean;    /* area of a triangle */
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
    DMK_TRY(DMK_NEW(ctx, c->at, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double x[3];
        mean_gradient(in, t, x);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const int32_t *corner = m->triangle + 3 * (size_t)t;
            const double flow = 0.5 * dmk_cot(m, 3 * t + k) * (x[i] - x[j]);
            c->at[corner[i]].flow -= flow;
            c->at[corner[j]].flow += flow;
            c->at[corner[k]].area += m->area[t] / 3;
        }
        c->mean += m->area[t] / m->n_triangles;
    }
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        for (int k = 0; k < 2; k++) c->at[m->edge_vertex[2 * (size_t)e + (size_t)k]].flow = 0;
    }
done:
    return rc;
}

/* `times`: each vertex takes the mean of its triangles, and these have that of their corners. */
static void spread(const dmk_mesh *m, const int32_t *degree, int times, gathering *f,
                   gathering *next)
{
    for (int n = 0; n < times; n++) {
        memset(next, 0, (size_t)m->n_vertices * sizeof *next);
        for (int32_t t = 0; t < m->n_triangles; t++) {
            const int32_t *v = m->triangle + 3 * (size_t)t;
            const gathering mean = {(f[v[0]].flow + f[v[1]].flow + f[v[2]].flow) / 3,
                                    (f[v[0]].area + f[v[1]].area + f[v[2]].area) / 3};
            for (int k = 0; k < 3; k++) {
                next[v[k]].flow += mean.flow;
                next[v[k]].area += mean.area;
            }
        }
        for (int32_t v = 0; v < m->n_vertices; v++) {
            if (degree[v] > 0)
                f[v] = (gathering){next[v].flow / degree[v], next[v].area / degree[v]};
        }
    }
}

static double density(gathering g)
{
    return g.area > 0 ? g.flow / g.area : 0;
}

/* x at the triangles, the mean of their corners'. */
static int find_crests(dmk_context *ctx, const dmk_mesh *m, convergence *c)
{
    int rc;
    const size_t nv = (size_t)m->n_vertices;
    int32_t *degree = NULL;
    gathering *f = NULL, *next = NULL;
    double *fine = NULL;
    DMK_TRY(DMK_NEW(ctx, degree, nv));
    DMK_TRY(DMK_NEW(ctx, f, nv));
    DMK_TRY(DMK_NEW(ctx, next, nv));
    DMK_TRY(DMK_NEW(ctx, fine, nv));
    DMK_TRY(DMK_NEW(ctx, c->crest, (size_t)m->n_triangles));
    for (size_t h = 0; h < 3 * (size_t)m->n_triangles; h++) degree[m->triangle[h]]++;
    memcpy(f, c->at, nv * sizeof *f);
    spread(m, degree, FINE, f, next);
    for (size_t v = 0; v < nv; v++) fine[v] = density(f[v]);
    spread(m, degree, COARSE - FINE, f, next);
    for (size_t v = 0; v < nv; v++) fine[v] = (fine[v] - density(f[v])) * sqrt(c->at[v].area);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * (size_t)t;
        c->crest[t] = (fine[v[0]] + fine[v[1]] + fine[v[2]]) / 3;
    }
done:
    free(degree);
    free(f);
    free(next);
    free(fine);
    return rc;
}

/* The largest crest within RINGS of each triangle. */
static int look_around(dmk_context *ctx, const dmk_mesh *m, convergence *c)
{
    int rc;
    double *top = NULL;
    DMK_TRY(DMK_NEW(ctx, top, (size_t)m->n_vertices)); /* 0: no lower crest counts */
    DMK_TRY(DMK_NEW(ctx, c->around, (size_t)m->n_triangles));
    memcpy(c->around, c->crest, (size_t)m->n_triangles * sizeof *c->around);
    for (int n = 0; n < RINGS; n++) {
        for (size_t h = 0; h < 3 * (size_t)m->n_triangles; h++)
            top[m->triangle[h]] = fmax(top[m->triangle[h]], c->around[h / 3]);
        for (int32_t t = 0; t < m->n_triangles; t++) {
            const int32_t *v = m->triangle + 3 * (size_t)t;
            c->around[t] = fmax(fmax(top[v[0]], top[v[1]]), top[v[2]]);
        }
    }
done:
    free(top);
    return rc;
}

static bool is_marked(const dmk_acl_input *in, const convergence *c, int32_t t)
{
    double x[3], square = 0, flow = 0, area = 0;
    const dmk_mesh *m = in->mesh;
    mean_gradient(in, t, x);
    for (int k = 0; k < 3; k++) {
        const gathering *v = &c->at[m->triangle[3 * (size_t)t + (size_t)k]];
        const double d = x[(k + 1) % 3] - x[(k + 2) % 3];
        square += 0.5 * dmk_cot(m, 3 * t + k) * d * d / m->area[t];
        flow += v->flow;
        area += v->area;
    }
    const double sine = sqrt(fmax(0, 1 - square)), size = fmax(1, sqrt(m->area[t] / c->mean)),
                 sum = flow / sqrt(area);
    if (sine >= least_sine * size && sine + sum >= least_sum * size) return true;
    return c->crest && c->crest[t] >= least_crest * size * size &&
           c->crest[t] >= crest_share * c->around[t] && sum >= 0.5 * least_sum * size &&
           in->mu[t] <= most_mu * sqrt(m->area[t]);
}

int dmk_acl_mark(dmk_context *ctx, const dmk_acl_input *in, double threshold, uint8_t *acl)
{
    int rc = DMK_OK;
    convergence c = {.mean = 0};
    if (threshold <= 0) DMK_TRY(sum_convergence(ctx, in, &c));
    if (threshold <= 0 && in->mu) {
        DMK_TRY(find_crests(ctx, in->mesh, &c));
        DMK_TRY(look_around(ctx, in->mesh, &c));
    }
    for (int32_t t = 0; t < in->mesh->n_triangles; t++)
        acl[t] = threshold > 0 ? in->mu[t] <= threshold : is_marked(in, &c, t);
done:
    free(c.at);
    free(c.crest);
    free(c.around);
    return rc;
}
