/* Lower bounds of the optimal cost: f.v / sqrt(max q(v)) for any v; see certificate.c. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

enum { MAX_BANDS = 1 << 16 };

/* An interval that holds all values of u, and 0. */
static int range(dmk_iteration *o, const dmk_buffer *u, double *low, double *high)
{
    int rc;
    double ends[2];
    dmk_system *s = o->sys;
    DMK_TRY(dmk_rows_range(o->ctx, s, u));
    DMK_TRY(dmk_iteration_sums(o, (size_t)s->n_rows, 2, 2, ends));
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

/* In single precision q and f.v are summed up again on the host: rounding of q would spoil the
 * bound. */
static int bound_by_host(dmk_iteration *o, const dmk_buffer *v, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    const dmk_mesh *m = o->mesh;
    double *x = NULL, *f = NULL, fv = 0, size = 0;
    DMK_TRY(DMK_NEW(o->ctx, x, (size_t)s->whole.n_rows_pad));
    DMK_TRY(DMK_NEW(o->ctx, f, (size_t)s->whole.n_rows_pad));
    DMK_TRY(dmk_rows_read(o->ctx, s, v, x));
    DMK_TRY(dmk_rows_read(o->ctx, s, s->f, f));
    o->top = 0;
    for (int32_t t = 0; t < s->whole.n_elements; t++) {
        const int32_t *corner = m->triangle + 3 * (size_t)t,
                      *edge = m->triangle_edge + 3 * (size_t)t;
        double e = 0, terms = 0;
        for (int k = 0; k < 3; k++) {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const double c = dmk_cot(m, 3 * t + k), mid = x[edge[k]];
            const double a = x[s->whole.vertex_row + corner[i]] - mid,
                         b = x[s->whole.vertex_row + corner[j]] - mid, d = x[edge[i]] - x[edge[j]];
            e += c * (0.5 * (a * a + b * b) + d * d);
            terms += fabs(c) * (0.5 * (a * a + b * b) + d * d);
        }
        e = fmax(e, 0) + DMK_ENERGY_ROUNDING * terms;
        o->top = fmax(o->top, e / m->area[t] * s->unit * s->unit);
    }
    for (int32_t i = 0; i < s->whole.n_rows; i++) {
        fv += f[i] * x[i];
        size += fabs(f[i] * x[i]);
    }
    *bound = (fv - 6e-8 * size) / sqrt(o->top); /* f is rounded, too */
done:
    free(x);
    free(f);
    return rc;
}

int dmk_bound_plain(dmk_iteration *o, const dmk_buffer *v, double *bound)
{
    int rc;
    double fv;
    DMK_TRY(dmk_iteration_energies_of(o, v, &fv));
    if (dmk_device_real(o->sys->device, DMK_OUTER) == sizeof(float))
        return bound_by_host(o, v, bound);
    DMK_TRY(dmk_iteration_measure(o, 1));
    *bound = fv / sqrt(o->top); /* q has its rounding on top */
done:
    return rc;
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
    DMK_TRY(dmk_bound_plain(o, v, bound));
done:
    return rc;
}
