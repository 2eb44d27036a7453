/* Where a branch ends on the smooth surface that the mesh stands for. A point of the surface is a smooth function X of
 * the direction a and the length r of a geodesic from the source that leads there, also past the locus, where a point
 * has several. A branch ends in a cusp of the conjugate points: where X_a, the Jacobi field, and its derivative by a
 * vanish across the geodesic. Near a cusp a, r and the displacement across scale as 1 : 2 : 3, so X is fitted to the
 * vertices around by the monomials in a and r up to the weight 5. */
#include "base/dense.h"
#include "base/vec3.h"
#include "locus/cotree.h"

#include <stdlib.h>
#include <string.h>

enum { N_TERMS = 12, MAX_VERTICES = 600, MIN_VERTICES = 2 * N_TERMS, MAX_STEPS = 30 };

/* Exponents of a and r; those of weight 5 last. */
static const int power[N_TERMS][2] = {{0, 0}, {1, 0}, {2, 0}, {0, 1}, {3, 0}, {1, 1},
                                      {4, 0}, {2, 1}, {0, 2}, {5, 0}, {3, 1}, {1, 2}};

struct dmk_patch {
    const dmk_cotree *cotree;
    int32_t n, round, *seen;      /* seen: n_vertices, the round in which a vertex was met */
    int32_t source;               /* of all vertices: directions at two do not compare */
    int32_t vertex[MAX_VERTICES]; /* n: around the centre, nearest rings first */
    double centre[3], normal[3], radius;
};

int dmk_patch_create(dmk_context *ctx, const dmk_cotree *t, dmk_patch **patch)
{
    int rc = DMK_NEW(ctx, *patch, 1);
    if (rc != DMK_OK) return rc;
    (*patch)->cotree = t;
    return DMK_NEW(ctx, (*patch)->seen, (size_t)t->geodesics->mesh->n_vertices);
}

void dmk_patch_free(dmk_patch **patch)
{
    if (*patch) free((*patch)->seen);
    free(*patch);
    *patch = NULL;
}

/* The source itself has no direction. */
static void take(dmk_patch *p, int32_t v)
{
    const dmk_geodesics *g = p->cotree->geodesics;
    const double *x = g->mesh->xyz + 3 * (size_t)v;
    if (p->seen[v] == p->round || p->n == MAX_VERTICES) return;
    if (dmk_distance(x, p->centre) >= p->radius) return;
    if (g->arrival[v].source != p->source || dmk_is_source(g, v)) return;
    p->seen[v] = p->round;
    p->vertex[p->n++] = v;
}

/* Smooth weight, 0 at the rim. */
static double weight_of(const dmk_patch *p, const double x[3])
{
    const double s = dmk_distance(x, p->centre) / p->radius;
    return s < 1 ? (1 - s * s) * (1 - s * s) : 0;
}

static void add_normal(dmk_patch *p, int32_t triangle, double weight)
{
    const dmk_mesh *m = p->cotree->geodesics->mesh;
    double n[3];
    const int32_t *v = m->triangle + 3 * triangle;
    dmk_area_vector(m->xyz + 3 * (size_t)v[0], m->xyz + 3 * (size_t)v[1], m->xyz + 3 * (size_t)v[2],
                    n);
    for (int k = 0; k < 3; k++) p->normal[k] += weight * n[k] / m->area[triangle];
}

/* The vertices within `radius` of xyz, which lies in the triangle of half-edge h, with the source of its start, reached
 * from its ends ring by ring, and the mean normal around them, weighted as they are, whatever their order. Whole rings
 * alone: what there is room for of one would hang on how vertices are numbered. */
static bool gather(dmk_patch *p, int32_t h, const double xyz[3], double radius)
{
    const dmk_mesh *m = p->cotree->geodesics->mesh;
    const dmk_star *star = &p->cotree->geodesics->star;
    p->source = p->cotree->geodesics->arrival[m->triangle[dmk_next(h)]].source;
    p->round++;
    p->n = 0;
    p->radius = radius;
    memcpy(p->centre, xyz, sizeof p->centre);
    memset(p->normal, 0, sizeof p->normal);
    take(p, m->triangle[dmk_next(h)]);
    take(p, m->triangle[dmk_previous(h)]);
    int32_t ring = p->n;
    for (int32_t i = 0; i < ring; i++) {
        const int32_t first = star->first[p->vertex[i]];
        const double weight = weight_of(p, m->xyz + 3 * (size_t)p->vertex[i]);
        for (int32_t c = first; c >= 0;) {
            take(p, m->triangle[dmk_next(c)]);
            take(p, m->triangle[dmk_previous(c)]);
            add_normal(p, c / 3, weight);
            c = dmk_star_next(star, c);
            if (c == first) break;
        }
        if (i + 1 == ring && p->n < MAX_VERTICES) ring = p->n;
    }
    p->n = ring;
    const double size = sqrt(dmk_dot(p->normal, p->normal));
    if (p->n < MIN_VERTICES || !(size > 0)) return false;
    for (int k = 0; k < 3; k++) p->normal[k] /= size;
    return true;
}

/* The monomials' derivatives, da times by a and dr times by r. */
static void terms(double a, double r, int da, int dr, double *value)
{
    const double x[2] = {a, r};
    const int times[2] = {da, dr};
    for (int i = 0; i < N_TERMS; i++) {
        value[i] = 1;
        for (int k = 0; k < 2; k++) {
            int n = power[i][k];
            for (int d = 0; d < times[k]; d++) value[i] *= n--;
            for (; n > 0; n--) value[i] *= x[k];
        }
    }
}

/* The derivative of the map in space. */
static void derive(const double *map, double a, double r, int da, int dr, double x[3])
{
    double term[N_TERMS];
    terms(a, r, da, dr, term);
    for (int k = 0; k < 3; k++) {
        x[k] = 0;
        for (int i = 0; i < N_TERMS; i++) x[k] += term[i] * map[3 * i + k];
    }
}

/* X - centre, in radii, as a polynomial of the direction and length in `spread` and radii, from those of the cusp. */
static bool fit_map(const dmk_patch *p, const dmk_cusp *c, double spread, double *map)
{
    const dmk_geodesics *g = p->cotree->geodesics;
    const double full = dmk_turn_around(g, p->source);
    double A[N_TERMS * N_TERMS] = {0}, term[N_TERMS];
    memset(map, 0, 3 * N_TERMS * sizeof *map);
    for (int32_t i = 0; i < p->n; i++) {
        const int32_t v = p->vertex[i];
        const double *x = g->mesh->xyz + 3 * (size_t)v, w = weight_of(p, x);
        terms(dmk_turn_between(full, c->angle, g->arrival[v].direction) / spread,
              (g->distance[v] - c->distance) / p->radius, 0, 0, term);
        for (int j = 0; j < N_TERMS; j++) {
            for (int k = 0; k <= j; k++) A[j * N_TERMS + k] += w * term[j] * term[k];
            for (int k = 0; k < 3; k++)
                map[3 * j + k] += w * term[j] * (x[k] - p->centre[k]) / p->radius;
        }
    }
    for (int j = 0; j < N_TERMS; j++) A[j * N_TERMS + j] += 1e-12 * A[0];
    return dmk_solve_symmetric(N_TERMS, 3, A, map);
}

/* Newton's method for J = J_a = 0, J the Jacobi field: the part of X_a across X_r. Geodesics converge
 * before the cusp and the conjugate points recede on both sides: -J_aa / J_r > 0. */
static bool find_cusp(const dmk_patch *p, const double *map, double *a, double *r)
{
    *a = *r = 0;
    for (int i = 0; i < MAX_STEPS && fabs(*a) < 2 && fabs(*r) < 2; i++) {
        double along[3], across[3], x[3], J[2][3]; /* J[i][j]: i times by r, j times by a */
        derive(map, *a, *r, 0, 1, along);
        dmk_cross(p->normal, along, across);
        for (int k = 0; k < 5; k++) {
            derive(map, *a, *r, 1 + (k < 3 ? k : k - 3), k < 3 ? 0 : 1, x);
            J[k / 3][k % 3] = dmk_dot(across, x);
        }
        const double det = J[0][1] * J[1][1] - J[1][0] * J[0][2];
        double da = -(J[0][0] * J[1][1] - J[1][0] * J[0][1]) / det;
        double dr = -(J[0][1] * J[0][1] - J[0][0] * J[0][2]) / det;
        const double size = fmax(fabs(da), fabs(dr));
        if (!(size < HUGE_VAL)) return false;
        if (size > 0.5) da *= 0.5 / size, dr *= 0.5 / size;
        *a += da;
        *r += dr;
        if (size < 1e-9) return J[0][2] * J[1][0] < 0;
    }
    return false;
}

bool dmk_cusp_fit(dmk_patch *p, int32_t h, dmk_cusp *c)
{
    const dmk_geodesics *g = p->cotree->geodesics;
    double map[3 * N_TERMS], spread = 0, a, r, x[3];
    /* wider on a noisy mesh, whose own branches have raised the default */
    const double wider = sqrt(p->cotree->strength / (dmk_rules.strength * p->cotree->mean_edge));
    if (!gather(p, h, c->xyz, wider * dmk_rules.window * p->cotree->mean_edge)) return false;
    const double full = dmk_turn_around(g, p->source);
    for (int32_t i = 0; i < p->n; i++)
        spread = fmax(spread,
                      fabs(dmk_turn_between(full, c->angle, g->arrival[p->vertex[i]].direction)));
    if (!(spread > 0) || !fit_map(p, c, spread, map) || !find_cusp(p, map, &a, &r)) return false;
    derive(map, a, r, 0, 0, x);
    for (int k = 0; k < 3; k++) c->xyz[k] += p->radius * x[k];
    c->angle += spread * a;
    c->distance += p->radius * r;
    return true;
}

/* Around a short locus the distance falls off as d = d0 - |x - c| + A cos 2 phi + B sin 2 phi, phi the direction from
 * c: the waves that come in enclose an astroid, and the locus is the part of its longer axis between two of the cusps,
 * of the length 8 sqrt(A^2 + B^2). What is left of first order in phi moves c. */
bool dmk_focus_fit(dmk_patch *p, int32_t on, double xyz[3], double half[3], double *left)
{
    enum { N = 5 };
    const dmk_geodesics *g = p->cotree->geodesics;
    const double h = p->cotree->mean_edge;
    for (int round = 0; round < MAX_STEPS; round++) {
        double A[N * N] = {0}, b[N] = {0}, rhs[N], squares = 0, axis[2][3] = {{0}};
        if (!gather(p, on, xyz, dmk_rules.window * h)) return false;
        int least = 0;
        for (int k = 1; k < 3; k++) least = fabs(p->normal[k]) < fabs(p->normal[least]) ? k : least;
        const double unit[3] = {least == 0, least == 1, least == 2};
        dmk_cross(p->normal, unit, axis[0]);
        const double size = sqrt(dmk_dot(axis[0], axis[0]));
        for (int k = 0; k < 3; k++) axis[0][k] /= size;
        dmk_cross(p->normal, axis[0], axis[1]);
        for (int32_t i = 0; i < p->n; i++) {
            double x[3];
            const double *at = g->mesh->xyz + 3 * (size_t)p->vertex[i];
            dmk_subtract(at, p->centre, x);
            const double u = dmk_dot(x, axis[0]), v = dmk_dot(x, axis[1]), s = sqrt(dmk_dot(x, x));
            if (s < 0.4 * p->radius) continue; /* beside the locus the waves have met */
            const double phi = atan2(v, u), y = (g->distance[p->vertex[i]] + s) / h;
            const double term[N] = {1, cos(phi), sin(phi), cos(2 * phi), sin(2 * phi)};
            for (int j = 0; j < N; j++) {
                for (int k = 0; k <= j; k++) A[j * N + k] += term[j] * term[k];
                b[j] += term[j] * y;
            }
            squares += y * y;
        }
        const double n = A[0];
        memcpy(rhs, b, sizeof rhs);
        if (!dmk_solve_symmetric(N, 1, A, b) || hypot(b[1], b[2]) > dmk_rules.window) return false;
        for (int k = 0; k < 3; k++) xyz[k] += h * (b[1] * axis[0][k] + b[2] * axis[1][k]);
        const double phi = 0.5 * atan2(b[4], b[3]), reach = 4 * hypot(b[3], b[4]) * h;
        for (int k = 0; k < 3; k++)
            half[k] = reach * (cos(phi) * axis[0][k] + sin(phi) * axis[1][k]);
        for (int j = 0; j < N; j++) squares -= rhs[j] * b[j];
        *left = h * sqrt(dmk_max(squares, 0) / n);
        if (hypot(b[1], b[2]) < 1e-6) return true;
    }
    return false;
}
