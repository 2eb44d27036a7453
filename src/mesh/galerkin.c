/* Tables of the Galerkin product P'AP for operators given as weighted links; see coarsen.h.
 *
 * The energy of the fine link (i,j) is w (x_i - x_j)^2, and with x = P c
 *     x_i - x_j = sum_a d_a c_a,   d = row i of P - row j of P,   sum_a d_a = 0,
 * so that w (x_i - x_j)^2 = sum_{a<b} (-w d_a d_b) (c_a - c_b)^2: the fine link's share of the
 * coarse link (a,b) is -w d_a d_b. */
#include "mesh/coarsen.h"

#include <math.h>
#include <stdlib.h>

/* Differences of two float weights below this are rounding. */
#define TINY 1e-6f

/* The nonzero entries of d for each fine link, as compressed rows. */
typedef struct difference {
    int32_t n_links;
    int32_t *row;    /* n_links + 1 */
    int32_t *coarse; /* row[n_links]: coarse vertices, increasing in each row; at most 6 */
    float *value;    /* row[n_links] */
} difference;

static void difference_free(difference *d)
{
    free(d->row);
    free(d->coarse);
    free(d->value);
}

/* The number of weights in use in row i of P. */
static int row_length(const dmk_coarsening *c, int32_t i)
{
    const float *w = c->prolong_weight + 3 * (size_t)i;
    return w[1] == 0 ? 1 : w[2] == 0 ? 2 : 3;
}

/* Row i of P minus row j, without its zeros, by merging the two; returns the number of entries. */
static int subtract_rows(const dmk_coarsening *c, int32_t i, int32_t j, int32_t *coarse,
                         float *value)
{
    const int32_t *a = c->prolong_index + 3 * (size_t)i, *b = c->prolong_index + 3 * (size_t)j;
    const float *u = c->prolong_weight + 3 * (size_t)i, *v = c->prolong_weight + 3 * (size_t)j;
    int n_a = row_length(c, i), n_b = row_length(c, j), n = 0, k = 0, l = 0;
    while (k < n_a || l < n_b) {
        int32_t x = k < n_a ? a[k] : INT32_MAX, y = l < n_b ? b[l] : INT32_MAX;
        float d = 0;
        if (x <= y) d += u[k++];
        if (y <= x) d -= v[l++];
        coarse[n] = dmk_min_i(x, y);
        value[n] = d;
        n += fabsf(d) >= TINY;
    }
    return n;
}

static int difference_create(dmk_context *ctx, const dmk_coarsening *c, int32_t n_links,
                             const int32_t *link, difference *d)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, d->row, (size_t)n_links + 1));
    /* Room for the worst case, and one to write a zero into; pages never touched cost nothing. */
    DMK_TRY(DMK_NEW(ctx, d->coarse, 6 * (size_t)n_links + 1));
    DMK_TRY(DMK_NEW(ctx, d->value, 6 * (size_t)n_links + 1));
    d->n_links = n_links;
    for (int32_t e = 0; e < n_links; e++) {
        int32_t at = d->row[e];
        d->row[e + 1] = at + subtract_rows(c, link[2 * e], link[2 * e + 1], d->coarse + at,
                                           d->value + at);
    }
done:
    return rc;
}

/* By coarse vertex, the fine links in whose d it occurs and is not the largest, increasing; each as
 * link * 8 + the place of its entry in the row of d. */
static int bucket_create(dmk_context *ctx, const difference *d, int32_t n_coarse, int32_t **row,
                         uint32_t **bucket)
{
    int rc;
    int32_t *fill = NULL, sum = 0;
    DMK_TRY(DMK_NEW(ctx, *row, (size_t)n_coarse + 1));
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)n_coarse + 1));
    for (int32_t e = 0; e < d->n_links; e++) {
        for (int32_t p = d->row[e]; p + 1 < d->row[e + 1]; p++) fill[d->coarse[p]]++;
    }
    for (int32_t a = 0; a < n_coarse; a++) {
        (*row)[a] = sum;
        sum += fill[a];
        fill[a] = (*row)[a];
    }
    (*row)[n_coarse] = sum;
    DMK_TRY(DMK_NEW(ctx, *bucket, (size_t)sum));
    for (int32_t e = 0; e < d->n_links; e++) {
        for (int32_t p = d->row[e]; p + 1 < d->row[e + 1]; p++) {
            (*bucket)[fill[d->coarse[p]]++] = (uint32_t)e * 8 + (uint32_t)(p - d->row[e]);
        }
    }
done:
    free(fill);
    return rc;
}

static void sort_small(int32_t n, int32_t *a)
{
    for (int32_t i = 1; i < n; i++) {
        int32_t x = a[i], k = i;
        for (; k > 0 && a[k - 1] > x; k--) a[k] = a[k - 1];
        a[k] = x;
    }
}

/* Working space of emit_links. */
typedef struct scratch {
    int32_t *other; /* n_coarse: the larger ends of the links of one coarse vertex */
    int32_t *stamp; /* n_coarse: 1 + the vertex that met this one last, 0 = none */
    int32_t *fill;  /* n_coarse: number, then next free place, of the entries of that link */
} scratch;

/* Append the coarse links (a, b > a) with their table rows, from a's bucket of n_links. */
static void emit_links(dmk_coarsening *c, const difference *d, int32_t a, int32_t n_links,
                       const uint32_t *bucket, scratch *s)
{
    int32_t n_other = 0, n_edges = c->coarse.n_edges;
    for (int32_t i = 0; i < n_links; i++) {
        uint32_t e = bucket[i] / 8, place = bucket[i] % 8;
        for (int32_t p = d->row[e] + (int32_t)place + 1; p < d->row[e + 1]; p++) {
            int32_t b = d->coarse[p];
            if (s->stamp[b] != a + 1) {
                s->stamp[b] = a + 1;
                s->fill[b] = 0;
                s->other[n_other++] = b;
            }
            s->fill[b]++;
        }
    }
    sort_small(n_other, s->other);
    for (int32_t i = 0; i < n_other; i++) {
        int32_t b = s->other[i], begin = c->galerkin_row[n_edges];
        c->coarse.edge[2 * n_edges] = a;
        c->coarse.edge[2 * n_edges + 1] = b;
        n_edges++;
        c->galerkin_row[n_edges] = begin + s->fill[b];
        s->fill[b] = begin;
    }
    c->coarse.n_edges = n_edges;
    for (int32_t i = 0; i < n_links; i++) {
        uint32_t e = bucket[i] / 8, place = bucket[i] % 8;
        int32_t p = d->row[e] + (int32_t)place;
        float da = d->value[p];
        for (p++; p < d->row[e + 1]; p++) {
            int32_t at = s->fill[d->coarse[p]]++;
            c->galerkin_edge[at] = (int32_t)e;
            c->galerkin_coef[at] = -da * d->value[p];
        }
    }
}

/* Number of table entries: one for each pair within a row of d. */
static int64_t count_pairs(const difference *d)
{
    int64_t sum = 0;
    for (int32_t e = 0; e < d->n_links; e++) {
        int64_t k = d->row[e + 1] - d->row[e];
        sum += k * (k - 1) / 2;
    }
    return sum;
}

static void shrink(int32_t **array, size_t n)
{
    void *smaller = realloc(*array, n ? n * sizeof **array : 1);
    if (smaller) *array = smaller;
}

static int galerkin_tables(dmk_context *ctx, int32_t n_links, const int32_t *fine_edge,
                           dmk_coarsening *c)
{
    int rc;
    size_t n = (size_t)c->coarse.n;
    difference d = {0};
    int32_t *row = NULL;
    uint32_t *bucket = NULL;
    scratch s = {0};
    DMK_TRY(difference_create(ctx, c, n_links, fine_edge, &d));
    DMK_TRY(bucket_create(ctx, &d, c->coarse.n, &row, &bucket));
    int64_t n_pairs = count_pairs(&d);
    if (n_pairs > INT32_MAX / 2) {
        rc = dmk_fail(ctx, DMK_E_MESH, "the mesh is too large for 32-bit tables: %lld entries",
                      (long long)n_pairs);
        goto done;
    }
    DMK_TRY(DMK_NEW(ctx, s.other, n));
    DMK_TRY(DMK_NEW(ctx, s.stamp, n));
    DMK_TRY(DMK_NEW(ctx, s.fill, n));
    DMK_TRY(DMK_NEW(ctx, c->galerkin_edge, (size_t)n_pairs));
    DMK_TRY(DMK_NEW(ctx, c->galerkin_coef, (size_t)n_pairs));
    /* Every coarse link has an entry; the room left over is given back. */
    DMK_TRY(DMK_NEW(ctx, c->galerkin_row, (size_t)n_pairs + 1));
    DMK_TRY(DMK_NEW(ctx, c->coarse.edge, 2 * (size_t)n_pairs));
    c->coarse.n_edges = 0;
    for (int32_t a = 0; a < c->coarse.n; a++) {
        emit_links(c, &d, a, row[a + 1] - row[a], bucket + row[a], &s);
    }
    shrink(&c->galerkin_row, (size_t)c->coarse.n_edges + 1);
    shrink(&c->coarse.edge, 2 * (size_t)c->coarse.n_edges);
done:
    difference_free(&d);
    free(row);
    free(bucket);
    free(s.other);
    free(s.stamp);
    free(s.fill);
    return rc;
}

static int transpose(dmk_context *ctx, int32_t n_fine, dmk_coarsening *c)
{
    int rc;
    size_t n = (size_t)c->coarse.n;
    int32_t *fill = NULL, sum = 0;
    DMK_TRY(DMK_NEW(ctx, fill, n));
    DMK_TRY(DMK_NEW(ctx, c->restrict_row, n + 1));
    for (size_t k = 0; k < 3 * (size_t)n_fine; k++) {
        if (c->prolong_weight[k] != 0) fill[c->prolong_index[k]]++;
    }
    for (size_t a = 0; a < n; a++) {
        c->restrict_row[a] = sum;
        sum += fill[a];
        fill[a] = c->restrict_row[a];
    }
    c->restrict_row[n] = sum;
    DMK_TRY(DMK_NEW(ctx, c->restrict_fine, (size_t)sum));
    DMK_TRY(DMK_NEW(ctx, c->restrict_weight, (size_t)sum));
    for (int32_t i = 0; i < n_fine; i++) {
        for (size_t k = 3 * (size_t)i; k < 3 * (size_t)i + 3; k++) {
            if (c->prolong_weight[k] == 0) continue;
            int32_t at = fill[c->prolong_index[k]]++;
            c->restrict_fine[at] = i;
            c->restrict_weight[at] = c->prolong_weight[k];
        }
    }
done:
    free(fill);
    return rc;
}

int dmk_galerkin_create(dmk_context *ctx, int32_t n_fine, int32_t n_fine_edges,
                        const int32_t *fine_edge, dmk_coarsening *c)
{
    int rc;
    DMK_TRY(transpose(ctx, n_fine, c));
    DMK_TRY(galerkin_tables(ctx, n_fine_edges, fine_edge, c));
done:
    return rc;
}
