/* The paper asks how to choose eps in {mu <= eps}. mu is a length, what is left of the ray: next to the locus
 * it is small where rays end there at a steep angle, but may be many triangles' sizes where they graze it,
 * so a bound that takes in all of the locus takes in far too much beside it. The potential knows more, and
 * in pure numbers. Where two families of rays meet at an angle alpha,
 *   - the mean of grad u over a triangle is shorter than 1: cos(alpha/2), whatever the units;
 *   - rays converge: div grad u is a line of strength 2 sin(alpha/2).
 * With s_T the sine that belongs to the mean's length, sqrt(1 - |mean grad u|^2), and k_T the sum of
 * -int grad u . grad phi_i over the triangle's corners over the root of that of int phi_i, phi_i their hat
 * functions, marked are
 *     s_T >= 0.07 g_T,   s_T + k_T >= 0.12 g_T,   g_T = max(1, sqrt(|T| / mean area)):
 * a front that is curved turns by more within a larger triangle, and a faint line of the locus may run anywhere
 * in it. The second leaves out what bends without converging: the source's blunt peak, ridges, noise.
 * At long ends, where the paths meet at 0.2 to 0.4 rad and graze the locus, the discrete u turns within several
 * triangles, and no one of them shows it; but the rays converge more there than around. With c and C the means of
 * -div grad u over about 2 and 8 rings of triangles, and x = (c - C) sqrt(area around a vertex / 3), marked are also
 *     x >= 0.018 g_T^2,   x >= 0.92 of the largest x within 8 steps across edges where u differs by 2 sqrt |T| at most,
 *     mu <= 25 sqrt |T|:
 * a crest of the convergence, on a strip along the level line of u, for there the locus runs nearly along the rays. The
 * strip has a width because x is larger towards the middle of the locus: slowly on a long end, but fast before a
 * short one, where rays focus that have not met yet. Rays that end far away converge faintly, too, on a camel's
 * belly: the last bound leaves that out. It needs mu as a length, what is left of a ray.
 * Lengths are what it is made of, no coordinates, no tolerance. bench/results/acl.md has what it finds, what
 * lies beside the locus, and the rules that were worse. */
#include "solver/acl.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double least_sine = 0.07;
static const double least_sum = 0.12;
static const double least_crest = 0.018;
static const double crest_share = 0.92; /* of the largest on its level line */
static const double level_width = 2;    /* in square roots of the area, to each side */
static const double most_mu = 25;       /* in the same */
enum { FINE = 2, COARSE = 8, STEPS = 8 };
enum { MOST_AROUND = 128 }; /* triangles on a strip; of equal ones there are some 40 */

/* Of a vertex, or around it: -int grad u . grad phi, and int phi. */
typedef struct gathering {
    double flow, area;
} gathering;

typedef struct convergence {
    const dmk_acl_input *in;
    dmk_vertex_stars star;
    gathering *at;     /* vertices */
    gathering *spread; /* vertices: means around them */
    gathering *mean;   /* triangles: of their corners */
    double *fine;  /* vertices: the density within FINE, then x: that above the one within COARSE */
    double *crest; /* triangles: x; NULL without mu */
    double mean_area;
    uint8_t *acl;
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
static int sum_convergence(dmk_context *ctx, convergence *c)
{
    int rc;
    const dmk_mesh *m = c->in->mesh;
    DMK_TRY(DMK_NEW(ctx, c->at, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double x[3];
        mean_gradient(c->in, t, x);
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const int32_t *corner = m->triangle + 3 * (size_t)t;
            const double flow = 0.5 * dmk_cot(m, 3 * t + k) * (x[i] - x[j]);
            c->at[corner[i]].flow -= flow;
            c->at[corner[j]].flow += flow;
            c->at[corner[k]].area += m->area[t] / 3;
        }
        c->mean_area += m->area[t] / m->n_triangles;
    }
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        for (int k = 0; k < 2; k++) c->at[m->edge_vertex[2 * (size_t)e + (size_t)k]].flow = 0;
    }
done:
    return rc;
}

/* ---- from vertices to triangles and back ------------------------------------------------------------ */

static void means_of_corners(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    const gathering *f = c->spread;
    for (int32_t t = begin; t < end; t++) {
        const int32_t *v = c->in->mesh->triangle + 3 * (size_t)t;
        c->mean[t] = (gathering){(f[v[0]].flow + f[v[1]].flow + f[v[2]].flow) / 3,
                                 (f[v[0]].area + f[v[1]].area + f[v[2]].area) / 3};
    }
}

static void means_of_triangles(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    for (int32_t v = begin; v < end; v++) {
        const int32_t first = c->star.row[v], last = c->star.row[v + 1];
        gathering sum = {0, 0};
        for (int32_t i = first; i < last; i++) {
            sum.flow += c->mean[c->star.triangle[i] / 4].flow;
            sum.area += c->mean[c->star.triangle[i] / 4].area;
        }
        if (last > first)
            c->spread[v] = (gathering){sum.flow / (last - first), sum.area / (last - first)};
    }
}

/* `times` there and back. */
static void spread(dmk_context *ctx, convergence *c, int times)
{
    for (int n = 0; n < times; n++) {
        dmk_parallel(ctx, c->in->mesh->n_triangles, means_of_corners, c);
        dmk_parallel(ctx, c->in->mesh->n_vertices, means_of_triangles, c);
    }
}

/* ---- crests -------------------------------------------------------------------------------------- */

static double density(gathering g)
{
    return g.area > 0 ? g.flow / g.area : 0;
}

static void fine_range(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    for (int32_t v = begin; v < end; v++) c->fine[v] = density(c->spread[v]);
}

static void above_range(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    for (int32_t v = begin; v < end; v++)
        c->fine[v] = (c->fine[v] - density(c->spread[v])) * sqrt(c->at[v].area);
}

/* x at the triangles, the mean of their corners'. */
static void crest_range(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    for (int32_t t = begin; t < end; t++) {
        const int32_t *v = c->in->mesh->triangle + 3 * (size_t)t;
        c->crest[t] = (c->fine[v[0]] + c->fine[v[1]] + c->fine[v[2]]) / 3;
    }
}

static int find_crests(dmk_context *ctx, convergence *c)
{
    int rc;
    const dmk_mesh *m = c->in->mesh;
    const size_t nv = (size_t)m->n_vertices, nt = (size_t)m->n_triangles;
    DMK_TRY(dmk_vertex_stars_create(ctx, m, &c->star));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->spread, nv));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->mean, nt));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->fine, nv));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->crest, nt));
    memcpy(c->spread, c->at, nv * sizeof *c->at);
    spread(ctx, c, FINE);
    dmk_parallel(ctx, m->n_vertices, fine_range, c);
    spread(ctx, c, COARSE - FINE);
    dmk_parallel(ctx, m->n_vertices, above_range, c);
    dmk_parallel(ctx, m->n_triangles, crest_range, c);
done:
    return rc;
}

/* ---- triangles ------------------------------------------------------------------------------------ */

static double mean_u(const dmk_acl_input *in, int32_t t)
{
    const int32_t *v = in->mesh->triangle + 3 * (size_t)t;
    return (in->u[v[0]] + in->u[v[1]] + in->u[v[2]]) / 3;
}

static bool has(int n, const int32_t *list, int32_t t)
{
    for (int i = 0; i < n; i++)
        if (list[i] == t) return true;
    return false;
}

/* Whether x of a triangle is about the largest along its level line. */
static bool is_crest(const convergence *c, int32_t t)
{
    const dmk_acl_input *in = c->in;
    const dmk_mesh *m = in->mesh;
    const double u = mean_u(in, t), width = level_width * sqrt(m->area[t]);
    int32_t around[MOST_AROUND] = {t};
    int steps[MOST_AROUND] = {0}, n = 1;
    for (int i = 0; i < n && steps[i] < STEPS; i++) {
        for (int k = 0; k < 3 && n < MOST_AROUND; k++) {
            const int32_t next =
                dmk_twin_triangle(m, around[i], m->triangle_edge[3 * around[i] + k]);
            if (next < 0 || fabs(mean_u(in, next) - u) > width || has(n, around, next)) continue;
            if (c->crest[t] < crest_share * c->crest[next]) return false;
            around[n] = next;
            steps[n++] = steps[i] + 1;
        }
    }
    return true;
}

static bool is_marked(const convergence *c, int32_t t)
{
    double x[3], square = 0, flow = 0, area = 0;
    const dmk_acl_input *in = c->in;
    const dmk_mesh *m = in->mesh;
    mean_gradient(in, t, x);
    for (int k = 0; k < 3; k++) {
        const gathering *v = &c->at[m->triangle[3 * (size_t)t + (size_t)k]];
        const double d = x[(k + 1) % 3] - x[(k + 2) % 3];
        square += 0.5 * dmk_cot(m, 3 * t + k) * d * d / m->area[t];
        flow += v->flow;
        area += v->area;
    }
    const double sine = sqrt(dmk_max(0, 1 - square)),
                 size = dmk_max(1, sqrt(m->area[t] / c->mean_area)), sum = flow / sqrt(area);
    if (sine >= least_sine * size && sine + sum >= least_sum * size) return true;
    return c->crest && c->crest[t] >= least_crest * size * size &&
           in->mu[t] <= most_mu * sqrt(m->area[t]) && is_crest(c, t);
}

static void mark_range(int32_t begin, int32_t end, void *data)
{
    const convergence *c = data;
    for (int32_t t = begin; t < end; t++) c->acl[t] = is_marked(c, t);
}

int dmk_acl_mark(dmk_context *ctx, const dmk_acl_input *in, double threshold, uint8_t *acl)
{
    int rc = DMK_OK;
    const int32_t n = in->mesh->n_triangles;
    convergence c = {.in = in, .acl = acl};
    if (threshold > 0) {
        for (int32_t t = 0; t < n; t++) acl[t] = in->mu[t] <= threshold;
        return DMK_OK;
    }
    DMK_TRY(sum_convergence(ctx, &c));
    if (in->mu) DMK_TRY(find_crests(ctx, &c));
    dmk_parallel(ctx, n, mark_range, &c);
done:
    dmk_vertex_stars_free(&c.star);
    free(c.at);
    free(c.spread);
    free(c.mean);
    free(c.fine);
    free(c.crest);
    return rc;
}
