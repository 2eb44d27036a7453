/* Lower bounds of the optimal cost: f.v / sqrt(max q(v)) for any v; see certificate.c. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

enum { MAX_BANDS = 1 << 16 };

/* The largest cotangent with which the device's q, in double precision, is as good as the host's: it squares them,
 * so here the bound is lower by 1e-5 at most. */
static const double most_cot = 3e4;

/* An interval that holds all values of u, and 0. */
static int range(dmk_iteration *o, const dmk_buffer *u, double *low, double *high)
{
    int rc;
    double ends[2];
    DMK_TRY(dmk_rows_range(o->ctx, o->sys, u, 0));
    DMK_TRY(dmk_iteration_scalars(o, 2, ends));
    *low = -ends[1];
    *high = ends[0];
done:
    return rc;
}

static double slope_of(int32_t bits)
{
    union {
        int32_t i;
        float f;
    } top = {.i = bits};
    return top.f > 0 ? 1 / (double)top.f : 1;
}

/* phi at the bands' ends from slopes 1 / (largest sqrt(q)), 1 where a band meets no element. A
 * triangle that reaches over a kink of phi may become steeper there, so the slope of a band is the
 * mean of three, each the least of three. */
static void integrate_bands(int n, const int32_t *bits, double width, double *phi)
{
    phi[0] = 0;
    for (int l = 0; l < n; l++) {
        double sum = 0;
        for (int k = l - 1; k <= l + 1; k++) {
            double least = 1;
            for (int j = k - 1; j <= k + 1; j++) {
                if (j >= 0 && j < n) least = fmin(least, slope_of(bits[j]));
            }
            sum += least;
        }
        phi[l + 1] = phi[l] + width * sum / 3;
    }
}

/* |grad|^2 of the linear function with the values x at the corners of a triangle with the sides l, opposite them,
 * and the area; with its rounding on top. Along the longest side and across it, so that nothing cancels but
 * differences of the values, however flat the triangle is: with cotangents c it would be c^2 times as much. */
static double steepness(const double l[3], double area, const double x[3])
{
    const int k = l[0] >= l[1] && l[0] >= l[2] ? 0 : l[1] >= l[2] ? 1 : 2;
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    const double share = (l[j] * l[j] + l[k] * l[k] - l[i] * l[i]) / (2 * l[k] * l[k]);
    const double side = x[j] - x[i], off = x[k] - x[i];
    const double rounding = 8 * DBL_EPSILON * (fabs(side) + fabs(off));
    const double across = (fabs(off - share * side) + rounding) * l[k] / (2 * area),
                 along = side / l[k];
    return (1 + 16 * DBL_EPSILON) * (along * along + across * across);
}

/* q of triangle t of the packed mesh m: the mean over its four parts. */
static double q_of(const dmk_iteration *o, const dmk_mesh *m, int32_t t, const double *x)
{
    const double unit = o->sys->unit;
    double l[3], value[6], sum = 0;
    for (int k = 0; k < 3; k++) {
        const size_t h = 3 * (size_t)t + (size_t)k;
        l[k] = 0.5 * m->length[m->triangle_edge[h]] / unit;
        value[k] = x[o->sys->vertex_row + m->triangle[h]];
        value[3 + k] = x[m->triangle_edge[h]];
    }
    for (int p = 0; p < 4; p++) {
        const int *node = dmk_quarter[p];
        const double at[3] = {value[node[0]], value[node[1]], value[node[2]]};
        sum += 0.25 * steepness(l, 0.25 * m->area[t] / (unit * unit), at);
    }
    return sum;
}

/* f.v and the size of its terms over own rows begin .. end - 1. */
typedef struct product {
    const double *f, *x;
    int32_t begin, end;
} product;

static void add_product(void *data, double *sum)
{
    const product *p = data;
    for (int32_t i = p->begin; i < p->end; i++) *sum += p->f[i] * p->x[i];
}

static void add_sizes(void *data, double *sum)
{
    const product *p = data;
    for (int32_t i = p->begin; i < p->end; i++) *sum += fabs(p->f[i] * p->x[i]);
}

/* The largest q of the own elements. */
typedef struct steepest {
    const dmk_iteration *o;
    const dmk_mesh *mesh;
    const double *x;
    int32_t begin, end;
} steepest;

static void find_top(void *data, double *top)
{
    const steepest *s = data;
    for (int32_t t = s->begin; t < s->end; t++) *top = fmax(*top, q_of(s->o, s->mesh, t, s->x));
}

/* q and f.v on the host: where single precision, or needles, would spoil the bound by the rounding of q. */
static int bound_by_host(dmk_iteration *o, const dmk_buffer *v, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    dmk_share *share = s->share;
    const size_t n = (size_t)s->n_rows_pad;
    const bool wide = dmk_device_real(s->device, DMK_OUTER) == sizeof(double);
    double *x = NULL, *f = NULL, fv = 0, size = 0;
    DMK_TRY(DMK_NEW(o->ctx, x, n));
    DMK_TRY(DMK_NEW(o->ctx, f, n));
    DMK_TRY(dmk_send(o->ctx, dmk_ship_rows(share, DMK_OUTER, v)));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, v, n, x));
    DMK_TRY(dmk_buffer_read_real(o->ctx, s->device, DMK_OUTER, s->f, n, f));
    steepest all = {o, share ? &share->mesh : o->mesh, x, 0, s->n_elements};
    product part[2] = {{f, x, 0, s->vertex_row}, {f, x, s->vertex_row, s->n_rows}};
    if (share) {
        const dmk_space *space[2] = {&share->edge, &share->vertex[0]};
        for (int k = 0; k < 2; k++) {
            part[k].begin += space[k]->at_first;
            part[k].end = part[k].begin + space[k]->end - space[k]->first;
        }
        all.begin = share->element.at_first;
        all.end = all.begin + share->element.end - share->element.first;
    }
    o->top = 0;
    DMK_TRY(dmk_share_in_turn(o->ctx, share, &o->top, find_top, &all));
    for (int k = 0; k < 2; k++) {
        DMK_TRY(dmk_share_in_turn(o->ctx, share, &fv, add_product, &part[k]));
        DMK_TRY(dmk_share_in_turn(o->ctx, share, &size, add_sizes, &part[k]));
    }
    *bound = (fv - (wide ? DMK_ENERGY_ROUNDING : DMK_FLOAT_ROUNDING) * size) /
             sqrt(o->top); /* f is rounded, too */
done:
    free(x);
    free(f);
    return rc;
}

bool dmk_bound_is_rough(const dmk_iteration *o)
{
    return o->sys->sharpest > most_cot;
}

static int bound_of(dmk_iteration *o, const dmk_buffer *v, int keep, double *bound)
{
    int rc;
    double fv;
    DMK_TRY(dmk_iteration_energies_of(o, v, keep, &fv));
    if (dmk_device_real(o->sys->device, DMK_OUTER) == sizeof(float) || dmk_bound_is_rough(o))
        return bound_by_host(o, v, bound);
    *bound = fv / sqrt(o->top); /* q has its rounding on top */
done:
    return rc;
}

int dmk_bound_plain(dmk_iteration *o, const dmk_buffer *v, double *bound)
{
    return bound_of(o, v, DMK_KEEP_Q, bound);
}

/* v = phi(u). */
static int map_bands(dmk_iteration *o, const dmk_buffer *u, const dmk_bands *bands, dmk_buffer *v)
{
    int rc;
    dmk_system *s = o->sys;
    const size_t n = (size_t)bands->n;
    double *phi = NULL;
    int32_t *bits = NULL;
    dmk_buffer *slopes = NULL, *knots = NULL;
    DMK_TRY(DMK_NEW(o->ctx, bits, n));
    DMK_TRY(DMK_NEW(o->ctx, phi, n + 1));
    DMK_TRY(dmk_buffer_create(o->ctx, s->device, n * sizeof *bits, bits, &slopes));
    DMK_TRY(dmk_buffer_create(o->ctx, s->device, (n + 1) * sizeof *phi, phi, &knots));
    DMK_TRY(dmk_band_slopes(o->ctx, s, bands, u, slopes));
    DMK_TRY(dmk_buffer_read(o->ctx, s->device, slopes, 0, n * sizeof *bits, bits));
    DMK_TRY(dmk_share_largest(o->ctx, s->share, n, bits));
    integrate_bands(bands->n, bits, 1 / (double)bands->inverse, phi);
    DMK_TRY(dmk_buffer_write_real(o->ctx, s->device, DMK_OUTER, knots, n + 1, phi));
    DMK_TRY(dmk_band_map(o->ctx, s, bands, knots, u, v));
done:
    free(bits);
    free(phi);
    dmk_buffer_destroy(&slopes);
    dmk_buffer_destroy(&knots);
    return rc;
}

int dmk_bound_banded(dmk_iteration *o, const dmk_buffer *u, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    double low, high;
    dmk_buffer *v = s->cg[DMK_OUTER].p;
    DMK_TRY(range(o, u, &low, &high));
    /* Bands of about a quarter of the mean element size. */
    double width = 0.38 / sqrt((double)s->whole.n_elements);
    int n = (int)fmin(MAX_BANDS, ceil((high - low) / width) + 1);
    const dmk_bands bands = {n, (float)(low - 0.5 * width),
                             (float)((n - 1) / fmax(high - low, 1e-30))};
    DMK_TRY(map_bands(o, u, &bands, v));
    DMK_TRY(bound_of(o, v, 0, bound));
done:
    return rc;
}
