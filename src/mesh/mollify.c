/* Needles and caps have cotangents of any size, and with them the operator's coefficients. A triangle with
 * sides a >= b >= c has b + c - a = 0 if it is degenerate; here that is brought up to DMK_MOLLIFICATION a.
 * (Lengths alone make the operator, so no vertex moves.) */
#include "mesh/mollify.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Nothing to do where no cotangent is larger: b + c - a is then above 5e-6 a, but for obtuse triangles
 * that are small beside their longest side and do no harm. */
static const double harmless = 300;
/* Where all triangles are thin, as on a surface that was stretched, longer short sides would add up:
 * then the area would grow by more than this part, and the metric stays as it is. */
static const double area_slack = 1e-4;

/* How much b + c - a falls short; e sorted. */
static double lacks(const double *length, const int32_t e[3])
{
    return DMK_MOLLIFICATION * length[e[0]] - (length[e[2]] - (length[e[0]] - length[e[1]]));
}

bool dmk_needs_no_mollifying(const dmk_mesh *m, int32_t begin, int32_t end)
{
    for (int32_t i = 3 * begin; i < 3 * end; i++) {
        if (fabs(dmk_cot(m, i)) > harmless) return false;
    }
    return true;
}

int32_t dmk_lengthen(const dmk_mesh *m, int32_t begin, int32_t end, double *length)
{
    int32_t n = 0;
    for (int32_t t = begin; t < end; t++) {
        int32_t e[3];
        memcpy(e, m->triangle_edge + 3 * (size_t)t, sizeof e);
        dmk_sort_sides(length, e);
        double more = lacks(length, e);
        if (!(more > 0)) continue;
        n++;
        /* A little more than half each, so that rounding leaves nothing to do. */
        length[e[1]] += 0.5001 * more;
        length[e[2]] += 0.5001 * more;
    }
    return n;
}

bool dmk_mollified_is_good(double before, double after)
{
    return after <= (1 + area_slack) * before;
}

/* Areas and cotangents; whether the whole area is still about the same. */
static bool measure(const dmk_mesh *m, dmk_mesh *mollified)
{
    double before = 0, after = 0;
    for (int32_t t = 0; t < mollified->n_triangles; t++) {
        const int32_t *e = mollified->triangle_edge + 3 * (size_t)t;
        const double l[3] = {mollified->length[e[0]], mollified->length[e[1]],
                             mollified->length[e[2]]};
        double cot[3];
        dmk_measure_sides(l, &mollified->area[t], cot);
        before += m->area[t];
        after += mollified->area[t];
    }
    return dmk_mollified_is_good(before, after);
}

int dmk_mollify(dmk_context *ctx, const dmk_mesh *m, dmk_mesh *mollified)
{
    int rc;
    bool good = false;
    *mollified = *m;
    if (m->sharpest <= harmless) return DMK_OK;
    mollified->length = mollified->area = NULL;
    DMK_TRY(DMK_NEW(ctx, mollified->length, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, mollified->area, (size_t)m->n_triangles));
    memcpy(mollified->length, m->length, (size_t)m->n_edges * sizeof *m->length);
    for (int round = 0;
         round < DMK_MOLLIFY_ROUNDS && dmk_lengthen(m, 0, m->n_triangles, mollified->length) > 0;
         round++) {
    }
    good = measure(m, mollified);
done:
    if (!good) dmk_mollify_free(m, mollified);
    if (rc == DMK_OK && !good) *mollified = *m;
    return rc;
}

void dmk_mollify_free(const dmk_mesh *m, dmk_mesh *mollified)
{
    if (mollified->length != m->length) free(mollified->length);
    if (mollified->area != m->area) free(mollified->area);
    *mollified = (dmk_mesh){0};
}
