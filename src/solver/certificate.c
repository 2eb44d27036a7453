/* Bounds of the optimal cost W = min over mu of F(mu) = 1/2 f.A(mu)^-1 f + 1/2 sum mu |T|.
 *
 * Upper: F at the best multiple of mu, sqrt(f.A^-1 f * sum mu |T|), see dmk_iteration_solve. What CG leaves
 *     of r.A^-1 r is estimated by r.z, z = V-cycle(r), and counted four times.
 * Lower: f.v / sqrt(max q(v)) for any v; here v = phi(u) with phi' = 1 / max sqrt(q) over the elements
 *     that meet a level band of u, so that one bad element spoils its band only. */
#include "solver/kernels.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdlib.h>

enum { MAX_BANDS = 1 << 16 };

/* An interval that holds all values of u, and 0. */
static int range(dmk_iteration *o, double *low, double *high)
{
    int rc;
    double ends[2];
    dmk_system *s = o->sys;
    DMK_TRY(dmk_rows_range(o->ctx, s, s->u));
    DMK_TRY(dmk_iteration_sums(o, (size_t)s->n_rows, 2, 2, ends));
    *low = -ends[1];
    *high = ends[0];
done:
    return rc;
}

/* phi at the band's ends: slope 1 / (largest sqrt(q)), 1 where a band meets no element. */
static void integrate_bands(int n, const int32_t *bits, double width, double *phi)
{
    phi[0] = 0;
    for (int l = 0; l < n; l++) {
        union {
            int32_t i;
            float f;
        } slope = {.i = bits[l]};
        phi[l + 1] = phi[l] + width * (slope.f > 0 ? 1 / (double)slope.f : 1);
    }
}

static int lower_bound(dmk_iteration *o, double *bound)
{
    int rc;
    dmk_system *s = o->sys;
    double low, high, *phi = NULL;
    int32_t *bits = NULL;
    dmk_buffer *slopes = NULL, *knots = NULL, *v = s->cg[DMK_OUTER].p;
    DMK_TRY(range(o, &low, &high));
    /* Bands of about a quarter of the mean element size. */
    double width = 0.38 / sqrt((double)s->n_elements);
    int n = (int)fmin(MAX_BANDS, ceil((high - low) / width) + 1);
    const dmk_bands bands = {n, (float)(low - 0.5 * width),
                             (float)((n - 1) / fmax(high - low, 1e-30))};
    DMK_TRY(DMK_NEW(o->ctx, bits, (size_t)n));
    DMK_TRY(DMK_NEW(o->ctx, phi, (size_t)n + 1));
    DMK_TRY(dmk_buffer_create(o->ctx, s->device, (size_t)n * sizeof *bits, bits, &slopes));
    DMK_TRY(dmk_buffer_create(o->ctx, s->device, ((size_t)n + 1) * sizeof *phi, phi, &knots));
    DMK_TRY(dmk_band_slopes(o->ctx, s, &bands, slopes));
    DMK_TRY(dmk_buffer_read(o->ctx, s->device, slopes, 0, (size_t)n * sizeof *bits, bits));
    integrate_bands(n, bits, 1 / (double)bands.inverse, phi);
    DMK_TRY(dmk_buffer_write_real(o->ctx, s->device, DMK_OUTER, knots, (size_t)n + 1, phi));
    DMK_TRY(dmk_band_map(o->ctx, s, &bands, knots, v));
    double fv, vav;
    DMK_TRY(dmk_iteration_energies_of(o, v, &fv, &vav));
    DMK_TRY(dmk_iteration_measure(o, 1));
    *bound = fv / sqrt(o->top);
done:
    free(bits);
    free(phi);
    dmk_buffer_destroy(&slopes);
    dmk_buffer_destroy(&knots);
    return rc;
}

int dmk_certify(dmk_iteration *o)
{
    int rc;
    double energy, plain, banded;
    double tolerance = o->options->cg_tolerance > 0 ? o->options->cg_tolerance : 1e-3;
    DMK_TRY(dmk_iteration_energies(o));
    DMK_TRY(dmk_iteration_measure(o, 1));
    plain = o->fu / sqrt(o->top);
    DMK_TRY(lower_bound(o, &banded));
    o->stats->cost_lower = fmax(plain, banded);
    /* The iteration's own u obeys |grad u| <= 1 better than mu's exact potential, which is free where
     * mu is next to 0: so the solve's correction goes to a scratch vector. */
    DMK_TRY(dmk_iteration_solve(o, o->sys->g, tolerance, 200, &energy));
    o->stats->cost_upper = sqrt(energy * o->mass);
    o->stats->gap = (o->stats->cost_upper - o->stats->cost_lower) / o->stats->cost_upper;
done:
    return rc;
}
