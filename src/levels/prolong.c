/* The prolongation: each fine vertex takes the linear interpolation of the nearest triangle of
 * mutually adjacent cells around its own cell, or of the nearest edge where there is no triangle;
 * see coarsen.h. */
#include "levels/coarsen.h"

#include "base/parallel.h"
#include "base/sort.h"
#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Weights below this are left out and the others scaled up. It shortens the Galerkin tables by a
 * quarter and costs no CG iteration; 0.1 shortens them by half and costs one now and then. */
#define SMALLEST 0.05f

/* Fine vertices of a cell are looked at so many at most together, whole vectors of the processor's, in plain loops.
 * Speed only: 16 and 64, and vectors of 4 and 16, take the same time; one vertex after another takes twice as long. */
enum { ABREAST = 32, VECTOR = 8 };

typedef struct points {
    int n; /* whole vectors */
    double x[ABREAST], y[ABREAST], z[ABREAST];
} points;

/* For each point p a point s q_i + t q_k of the star, with its squared distance from p, less the constant p.p. */
typedef struct nearest {
    double distance2[ABREAST], s[ABREAST], t[ABREAST];
    double at[ABREAST]; /* spoke i = k, or n_spokes and a triangle; as wide as the others */
} nearest;

/* The surroundings of one cell c, all relative to the position of c. Arrays grow as needed. */
typedef struct star {
    int32_t n_spokes, n_triangles;
    size_t spoke_room, triangle_room;
    int32_t *cell;         /* n_spokes: adjacent cells */
    double (*q)[3];        /* n_spokes: their positions minus that of c */
    double *qq;            /* n_spokes: q.q */
    double (*qp)[ABREAST]; /* n_spokes: q.p of the fine vertices p at hand */
    int32_t (*tri)[2];     /* n_triangles: spokes i < k such that c, i, k are mutually adjacent */
    double *qiqk;          /* n_triangles: q_i.q_k */
} star;

static void star_free(star *st)
{
    free(st->cell);
    free(st->q);
    free(st->qq);
    free(st->qp);
    free(st->tri);
    free(st->qiqk);
}

static int star_reserve_spokes(dmk_context *ctx, star *st, size_t n)
{
    int rc = DMK_OK;
    if (n <= st->spoke_room) return DMK_OK;
    free(st->cell);
    free(st->q);
    free(st->qq);
    free(st->qp);
    st->cell = NULL;
    st->q = NULL;
    st->qq = NULL;
    st->qp = NULL;
    st->spoke_room = 2 * n;
    DMK_TRY(DMK_NEW(ctx, st->cell, 2 * n));
    DMK_TRY(DMK_NEW(ctx, st->q, 2 * n));
    DMK_TRY(DMK_NEW(ctx, st->qq, 2 * n));
    DMK_TRY(DMK_NEW(ctx, st->qp, 2 * n));
done:
    return rc;
}

static int star_add_triangle(dmk_context *ctx, star *st, int32_t i, int32_t k)
{
    size_t n = (size_t)st->n_triangles;
    if (n == st->triangle_room) {
        size_t room = 2 * n + 16;
        void *tri = realloc(st->tri, room * sizeof *st->tri);
        if (tri) st->tri = tri;
        void *qiqk = realloc(st->qiqk, room * sizeof *st->qiqk);
        if (qiqk) st->qiqk = qiqk;
        if (!tri || !qiqk) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: prolongation");
        st->triangle_room = room;
    }
    st->tri[n][0] = i;
    st->tri[n][1] = k;
    st->qiqk[n] = dmk_dot(st->q[i], st->q[k]);
    st->n_triangles++;
    return DMK_OK;
}

/* The triangles of spoke i with later ones: by the row of its cell, or where that is a hub by a look into
 * it for each of the spokes. */
static int star_close(dmk_context *ctx, star *st, const dmk_adjacency *g, int32_t i,
                      const int32_t *spoke_of)
{
    int rc = DMK_OK;
    int32_t a = st->cell[i], degree = g->row[a + 1] - g->row[a];
    if (degree > DMK_HUB && degree / 16 > st->n_spokes) {
        for (int32_t k = i + 1; k < st->n_spokes && rc == DMK_OK; k++) {
            if (dmk_sorted_has(degree, g->to + g->row[a], st->cell[k]))
                rc = star_add_triangle(ctx, st, i, k);
        }
        return rc;
    }
    for (int32_t k = g->row[a]; k < g->row[a + 1] && rc == DMK_OK; k++) {
        int32_t other = spoke_of[g->to[k]];
        if (other > i) rc = star_add_triangle(ctx, st, i, other);
    }
    return rc;
}

/* Set the star of cell c. spoke_of has an entry per cell, all -1 before and after. */
static int star_set(dmk_context *ctx, star *st, const dmk_adjacency *g, const double *xyz,
                    int32_t c, int32_t *spoke_of)
{
    int rc;
    int32_t begin = g->row[c], n = g->row[c + 1] - begin;
    DMK_TRY(star_reserve_spokes(ctx, st, (size_t)n));
    st->n_spokes = n;
    st->n_triangles = 0;
    for (int32_t i = 0; i < n; i++) {
        int32_t a = st->cell[i] = g->to[begin + i];
        spoke_of[a] = i;
        for (int x = 0; x < 3; x++) st->q[i][x] = xyz[3 * (size_t)a + x] - xyz[3 * (size_t)c + x];
        st->qq[i] = dmk_dot(st->q[i], st->q[i]);
    }
    for (int32_t i = 0; i < n && rc == DMK_OK; i++) rc = star_close(ctx, st, g, i, spoke_of);
    for (int32_t i = 0; i < n; i++) spoke_of[st->cell[i]] = -1;
done:
    return rc;
}

/* Without branches: a comparison within one would keep the loops from the processor's vectors. */
static double clamp01(double x)
{
    const double y = x < 0 ? 0 : x;
    return y > 1 ? 1 : y;
}

/* Loads come first, lest there be branches. */
static void keep_nearer(int n, const nearest *other, double at, nearest *best)
{
    for (int m = 0; m < n; m++) {
        const double distance2 = other->distance2[m], s = other->s[m], t = other->t[m];
        const double best2 = best->distance2[m], best_s = best->s[m], best_t = best->t[m],
                     best_at = best->at[m];
        best->s[m] = distance2 < best2 ? s : best_s;
        best->t[m] = distance2 < best2 ? t : best_t;
        best->at[m] = distance2 < best2 ? at : best_at;
        best->distance2[m] = distance2 < best2 ? distance2 : best2;
    }
}

static void try_spoke(const star *st, int32_t i, const points *p, nearest *best)
{
    const int n = p->n;
    const double *q = st->q[i], qq = st->qq[i], divisor = qq > 0 ? qq : INFINITY;
    double *qp = st->qp[i];
    nearest on;
    for (int m = 0; m < n; m++) {
        qp[m] = q[0] * p->x[m] + q[1] * p->y[m] + q[2] * p->z[m];
        const double s = clamp01(qp[m] / divisor);
        on.distance2[m] = s * (s * qq - 2 * qp[m]);
        on.s[m] = s;
        on.t[m] = 0;
    }
    keep_nearer(n, &on, i, best);
}

/* Of the plane of 0, q_i and q_k: x = q_i.p, y = q_k.p, a = q_i.q_i, b = q_k.q_k, g = q_i.q_k. */
static void find_within(int n, const double *x, const double *y, double a, double b, double g,
                        nearest *in)
{
    const double det = a * b - g * g;
    for (int m = 0; m < n; m++) {
        in->s[m] = (x[m] * b - y[m] * g) / det;
        in->t[m] = (y[m] * a - x[m] * g) / det;
        in->distance2[m] = -(in->s[m] * x[m] + in->t[m] * y[m]);
    }
}

/* The same of the edge opposite c, q_i + t (q_k - q_i). */
static void find_opposite(int n, const double *x, const double *y, double a, double b, double g,
                          nearest *on)
{
    const double edge2 = a + b - 2 * g, divisor = edge2 > 0 ? edge2 : INFINITY;
    for (int m = 0; m < n; m++) {
        const double along = y[m] - x[m] + a - g, t = clamp01(along / divisor);
        on->s[m] = 1 - t;
        on->t[m] = t;
        on->distance2[m] = a - 2 * x[m] + t * (t * edge2 - 2 * along);
    }
}

/* Nearest point of the triangle (0, q_i, q_k) unless it lies on a spoke: those come apart. With
 * g = q_i.q_k: minimise s^2 q_i.q_i + 2 s t g + t^2 q_k.q_k - 2 s q_i.p - 2 t q_k.p. */
static void try_triangle(const star *st, int32_t triangle, int n, nearest *best)
{
    const int32_t i = st->tri[triangle][0], k = st->tri[triangle][1];
    const double a = st->qq[i], b = st->qq[k], g = st->qiqk[triangle];
    const double det = a * b - g * g, inside = det > 1e-12 * a * b ? det : 0;
    const double *x = st->qp[i], *y = st->qp[k];
    nearest within, to;
    find_opposite(n, x, y, a, b, g, &to);
    find_within(n, x, y, a, b, g, &within);
    for (int m = 0; m < n; m++) {
        const double s = x[m] * b - y[m] * g, t = y[m] * a - x[m] * g;
        if (s > 0 && t > 0 && s + t < inside) {
            to.distance2[m] = within.distance2[m];
            to.s[m] = within.s[m];
            to.t[m] = within.t[m];
        }
    }
    keep_nearer(n, &to, st->n_spokes + triangle, best);
}

static void find_nearest(const star *st, const points *p, nearest *best)
{
    memset(best, 0, sizeof *best); /* c itself */
    for (int32_t i = 0; i < st->n_spokes; i++) try_spoke(st, i, p, best);
    for (int32_t j = 0; j < st->n_triangles; j++) try_triangle(st, j, p->n, best);
}

/* Store the weights on c and two spokes that count, by increasing cell, scaled to sum to 1, in whole parts. */
static void store_row(const star *st, int32_t c, const nearest *best, int m, int32_t *index,
                      float *weight)
{
    const int32_t at = (int32_t)best->at[m], n_spokes = st->n_spokes;
    const int32_t *tri = at < n_spokes ? (const int32_t[]){at, at} : st->tri[at - n_spokes];
    const float s = (float)best->s[m], t = (float)best->t[m];
    float w[3] = {(float)fmax(0, 1.0 - s - t), s, t};
    int32_t cell[3] = {c, n_spokes ? st->cell[tri[0]] : c, n_spokes ? st->cell[tri[1]] : c};
    float sum = 0, rest = 1;
    int n = 0;
    for (int k = 0; k < 3; k++) {
        if (!(w[k] > SMALLEST)) continue;
        int slot = n++;
        for (; slot > 0 && index[slot - 1] > cell[k]; slot--) {
            index[slot] = index[slot - 1];
            weight[slot] = weight[slot - 1];
        }
        index[slot] = cell[k];
        weight[slot] = w[k];
        sum += w[k];
    }
    for (int k = 1; k < n; k++)
        rest -= weight[k] = rintf(DMK_WEIGHT_PARTS * weight[k] / sum) / DMK_WEIGHT_PARTS;
    weight[0] = rest;
    for (int k = n; k < 3; k++) {
        index[k] = index[0];
        weight[k] = 0;
    }
}

void dmk_prolong_point(int32_t c, int32_t *index, float *weight)
{
    for (int k = 0; k < 3; k++) {
        index[k] = c;
        weight[k] = k == 0;
    }
}

static int fill_empty_columns(dmk_context *ctx, const dmk_cells *cells, dmk_coarsening *c)
{
    int rc;
    uint8_t *used = NULL;
    bool changed = true;
    DMK_TRY(DMK_NEW(ctx, used, (size_t)cells->n));
    while (changed) {
        changed = false;
        memset(used, 0, (size_t)cells->n);
        for (size_t k = 0; k < 3 * (size_t)cells->n_fine; k++) {
            if (c->prolong_weight[k] > 0) used[c->prolong_index[k]] = 1;
        }
        for (int32_t a = 0; a < cells->n; a++) {
            size_t at = 3 * (size_t)cells->sample[a];
            if (used[a]) continue;
            dmk_prolong_point(a, c->prolong_index + at, c->prolong_weight + at);
            changed = true;
        }
    }
done:
    free(used);
    return rc;
}

typedef struct prolong_job {
    const dmk_cells *cells;
    const dmk_adjacency *coarse;
    const double *fine_xyz;
    dmk_coarsening *c;
} prolong_job;

static void prolong_cell(const prolong_job *job, star *st, int32_t a)
{
    dmk_coarsening *c = job->c;
    const double *center = c->coarse.xyz + 3 * (size_t)a;
    const int32_t end = job->cells->row[a + 1];
    for (int32_t first = job->cells->row[a]; first < end; first += ABREAST) {
        const int32_t *member = job->cells->member + first;
        const int n = dmk_min_i(end - first, ABREAST);
        nearest best;
        points p = {.n = (n + VECTOR - 1) / VECTOR * VECTOR};
        for (int m = 0; m < n; m++) {
            const double *x = job->fine_xyz + 3 * (size_t)member[m];
            p.x[m] = x[0] - center[0];
            p.y[m] = x[1] - center[1];
            p.z[m] = x[2] - center[2];
        }
        find_nearest(st, &p, &best);
        for (int m = 0; m < n; m++) {
            const size_t at = 3 * (size_t)member[m];
            store_row(st, a, &best, m, c->prolong_index + at, c->prolong_weight + at);
        }
    }
}

static int prolong_range(dmk_context *own, int32_t begin, int32_t end, void *data)
{
    int rc;
    const prolong_job *job = data;
    star st = {0};
    int32_t *spoke_of = NULL;
    DMK_TRY(DMK_NEW(own, spoke_of, (size_t)job->cells->n));
    for (int32_t a = 0; a < job->cells->n; a++) spoke_of[a] = -1;
    for (int32_t a = begin; a < end; a++) {
        if (job->cells->row[a] == job->cells->row[a + 1]) continue; /* only surroundings */
        DMK_TRY(star_set(own, &st, job->coarse, job->c->coarse.xyz, a, spoke_of));
        prolong_cell(job, &st, a);
    }
done:
    star_free(&st);
    free(spoke_of);
    return rc;
}

int dmk_prolong_weights(dmk_context *ctx, const dmk_cells *cells, const dmk_adjacency *coarse,
                        const double *fine_xyz, dmk_coarsening *c)
{
    int rc;
    prolong_job job = {.cells = cells, .coarse = coarse, .fine_xyz = fine_xyz, .c = c};
    DMK_TRY(DMK_NEW(ctx, c->prolong_index, 3 * (size_t)cells->n_fine));
    DMK_TRY(DMK_NEW(ctx, c->prolong_weight, 3 * (size_t)cells->n_fine));
    rc = dmk_parallel_try(ctx, cells->n, prolong_range, &job);
done:
    return rc;
}

int dmk_prolong_create(dmk_context *ctx, const dmk_cells *cells, const dmk_adjacency *coarse,
                       const double *fine_xyz, dmk_coarsening *c)
{
    const int rc = dmk_prolong_weights(ctx, cells, coarse, fine_xyz, c);
    return rc == DMK_OK ? fill_empty_columns(ctx, cells, c) : rc;
}
