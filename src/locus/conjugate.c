/* Conjugate points: where neighbouring rays first meet. A branch of the locus ends where they do so
 * first; two geodesics that end near each other belong to one family, with no locus between them,
 * if no ray between them has met its neighbours on the way (and none had to end before).
 *
 * Along a ray the distance J of its neighbours over their angle obeys Jacobi's equation J'' = -K J
 * with J(0) = 0, J'(0) = 1. On a polyhedron the Gaussian curvature K sits in the vertices, so
 * single rays tell little; here K is the angle defect of the vertices around over their area. */
#include "base/sort.h"
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>

typedef struct pair {
    float bend, area;
} pair;

/* Each vertex gives a third of its own to each corner of its triangles in equal parts. */
static void spread(const dmk_mesh *m, const float *share, pair *vertex, pair *triangle)
{
    for (int32_t t = 0; t < m->n_triangles; t++) {
        triangle[t] = (pair){0, 0};
        for (int k = 0; k < 3; k++) {
            int32_t v = m->triangle[3 * t + k];
            triangle[t].bend += share[v] * vertex[v].bend;
            triangle[t].area += share[v] * vertex[v].area;
        }
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        vertex[v] = (pair){0, 0};
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        vertex[m->triangle[h]].bend += triangle[h / 3].bend;
        vertex[m->triangle[h]].area += triangle[h / 3].area;
    }
}

/* Add `factor` times the mean curvature of the corners. */
static void average(const dmk_mesh *m, const pair *vertex, float factor, float *curvature)
{
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const pair *a = &vertex[m->triangle[3 * t]], *b = &vertex[m->triangle[3 * t + 1]];
        const pair *c = &vertex[m->triangle[3 * t + 2]];
        curvature[t] += factor * (a->bend + b->bend + c->bend) / (a->area + b->area + c->area);
    }
}

int dmk_rays_find_curvature(dmk_context *ctx, dmk_rays *r)
{
    int rc;
    const dmk_mesh *m = r->mesh;
    size_t n = (size_t)m->n_vertices, n_triangles = (size_t)m->n_triangles;
    pair *vertex = NULL, *triangle = NULL;
    float *share = NULL;
    DMK_TRY(DMK_NEW(ctx, r->curvature, n_triangles));
    DMK_TRY(DMK_NEW(ctx, vertex, n));
    DMK_TRY(DMK_NEW(ctx, triangle, n_triangles));
    DMK_TRY(DMK_NEW(ctx, share, n));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        vertex[m->triangle[h]].area += (float)(m->area[h / 3] / 3);
        share[m->triangle[h]]++;
    }
    for (size_t v = 0; v < n; v++) {
        vertex[v].bend = fabsf(r->bend[v]) < dmk_sharp ? r->bend[v] : 0;
        share[v] = 1 / (3 * share[v]);
    }
    spread(m, share, vertex, triangle);
    average(m, vertex, 3, r->curvature);
    spread(m, share, vertex, triangle);
    average(m, vertex, -2, r->curvature);
done:
    free(vertex);
    free(triangle);
    free(share);
    return rc;
}

/* ---- cusps ---- */

/* In mesh edges: a cusp is at least so much nearer than what lies beside it. */
static const double least_deep = 0.3, hardly_deep = 0.05;
/* What the noise of the curvature does: the values go up and down within a few rays. A cusp is
 * nearer by so many times the height of nearly all of that, where there is some. */
static const double noise_deep = 3;
enum { few_rays = 8, some = 3 };

/* The rays of a profile from an angle on: up to where several in a row have no conjugate point, or
 * all around. */
typedef struct run {
    const dmk_profile *p;
    int32_t first, n;
} run;

static const dmk_profile_ray *ray_of(const run *u, int32_t i)
{
    return &u->p->ray[(u->first + i) % u->p->n];
}

static double until(const run *u, int32_t i)
{
    const dmk_profile_ray *ray = ray_of(u, i);
    return fmin(ray->until, ray->end);
}

/* Lows and highs in turn, each `deep` beyond the one before: lows at even places. The run's ends
 * are high. Returns how many lows there are; turn has room for n + 1. */
static int32_t find_turns(const run *u, double deep, int32_t *turn)
{
    int32_t n = 0, low = 0, high = 0;
    bool falling = true;
    for (int32_t i = 1; i < u->n; i++) {
        double x = until(u, i);
        if (falling) {
            if (x < until(u, low)) low = i;
            if (x > until(u, low) + deep) {
                turn[n++] = low;
                high = i;
                falling = false;
            }
        } else {
            if (x > until(u, high)) high = i;
            if (x < until(u, high) - deep) {
                turn[n++] = high;
                low = i;
                falling = true;
            }
        }
    }
    if (falling) turn[n++] = low;
    return (n + 1) / 2;
}

static bool is_conjugate(const run *u, int32_t i)
{
    return isfinite(ray_of(u, i)->until);
}

/* The heights of what lies within few rays between two lows. Returns how many. */
static int32_t find_heights(const run *u, double deep, int32_t *turn, double *height)
{
    int32_t n = 0, n_lows = find_turns(u, deep, turn);
    for (int32_t k = 0; k + 1 < n_lows; k++) {
        int32_t a = turn[2 * k], top = turn[2 * k + 1], b = turn[2 * k + 2];
        if (top - a > few_rays || b - top > few_rays) continue;
        if (is_conjugate(u, a) && is_conjugate(u, b))
            height[n++] = until(u, top) - fmax(until(u, a), until(u, b));
    }
    return n;
}

static void add_cusps(const run *u, double deep, int32_t *turn, dmk_profile *p)
{
    int32_t n = find_turns(u, deep, turn);
    for (int32_t k = 0; k < n; k++) {
        if (!is_conjugate(u, turn[2 * k])) continue;
        const dmk_profile_ray *ray = ray_of(u, turn[2 * k]);
        p->cusp[p->n_cusps++] = (dmk_cusp){ray->angle, ray->until, ray->widest, deep};
    }
}

/* A ray to begin with: one without a conjugate point, or the one with the farthest. */
static int32_t begin(const dmk_profile *p)
{
    const run all = {p, 0, p->n};
    int32_t far = 0;
    for (int32_t i = 0; i < p->n; i++) {
        if (until(&all, i) > until(&all, far)) far = i;
    }
    return far;
}

static int by_angle(const void *a, const void *b)
{
    double x = ((const dmk_cusp *)a)->angle, y = ((const dmk_cusp *)b)->angle;
    return (x > y) - (x < y);
}

/* Of n heights; 0 if there are not some. */
static double quantile(double *height, int32_t n, double part)
{
    dmk_sort_doubles(height, (size_t)n);
    return n < some ? 0 : height[(int32_t)(part * n)];
}

/* The next run from ray *i after the first one; *i moves on. */
static run next_run(const dmk_profile *p, int32_t first, int32_t *i)
{
    run u = {p, (first + *i) % p->n, 0};
    for (int32_t last = 0; *i + u.n < p->n && u.n <= last + few_rays; u.n++) {
        if (is_conjugate(&u, u.n)) last = u.n;
    }
    *i += u.n;
    return u;
}

int dmk_profile_find_cusps(dmk_context *ctx, double mean, dmk_profile *p)
{
    int rc;
    int32_t *turn = NULL, first = begin(p), n = 0;
    double *height = NULL;
    DMK_TRY(DMK_NEW(ctx, turn, (size_t)p->n + 1));
    DMK_TRY(DMK_NEW(ctx, height, (size_t)p->n + 1));
    DMK_TRY(DMK_NEW(ctx, p->cusp, (size_t)p->n + 1));
    for (int32_t i = 0; i < p->n;) {
        run u = next_run(p, first, &i);
        n += find_heights(&u, hardly_deep * mean, turn, height + n);
    }
    double all = quantile(height, n, 0.5);
    p->doubt = fmax(least_deep * mean, noise_deep * all);
    for (int32_t i = 0; i < p->n;) {
        run u = next_run(p, first, &i);
        n = find_heights(&u, hardly_deep * mean, turn, height);
        double noise = fmax(all, quantile(height, n, 0.9));
        add_cusps(&u, fmax(least_deep * mean, noise_deep * noise), turn, p);
    }
    qsort(p->cusp, (size_t)p->n_cusps, sizeof *p->cusp, by_angle);
done:
    free(turn);
    free(height);
    return rc;
}

void dmk_profile_free(dmk_profile *p)
{
    free(p->ray);
    free(p->cusp);
}

const dmk_cusp *dmk_rays_cusp(const dmk_rays *r, double a, double b, double least, double most)
{
    const dmk_profile *p = &r->profile;
    const dmk_cusp *best = NULL;
    double whole = r->chart.total, turn = dmk_chart_turn(&r->chart, a, b);
    if (turn < 0) {
        a = b;
        turn = -turn;
    }
    if (r->chart.closed) a -= whole * floor(a / whole);
    int32_t lo = 0, hi = p->n_cusps;
    while (lo < hi) {
        int32_t mid = (lo + hi) / 2;
        if (p->cusp[mid].angle < a)
            lo = mid + 1;
        else
            hi = mid;
    }
    for (int32_t i = 0; i < p->n_cusps; i++) {
        const dmk_cusp *w = &p->cusp[(lo + i) % p->n_cusps];
        double from = w->angle - a;
        if (from < 0 && r->chart.closed) from += whole;
        if (from < 0 || from > turn) break;
        if (w->distance <= least || w->distance >= most) continue;
        if (!best || w->distance < best->distance) best = w;
    }
    return best;
}
