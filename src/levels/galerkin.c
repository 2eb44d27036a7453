/* Tables of the Galerkin product P'AP for operators given as weighted edges; see coarsen.h.
 *
 * The energy of the fine edge (i,j) is w (x_i - x_j)^2, and with x = P c
 *     x_i - x_j = sum_a d_a c_a,   d = row i of P - row j of P,   sum_a d_a = 0,
 * so that w (x_i - x_j)^2 = sum_{a<b} (-w d_a d_b) (c_a - c_b)^2: the fine edge's share of the
 * coarse edge (a,b) is -w d_a d_b. */
#include "levels/coarsen.h"

#include "base/parallel.h"

#include <stdlib.h>
#include <string.h>

/* Arrays that are filled at once are not cleared before, and have room for one item more: there may be none. */

enum { MOST = 6 }; /* nonzero entries of a d */

typedef struct entry {
    int32_t coarse; /* vertex */
    float value;
} entry;

/* The nonzero entries of d for each fine edge. */
typedef struct difference {
    int32_t n_edges;
    int32_t first, end; /* the coarse vertices whose edges are wanted */
    int32_t *row;       /* n_edges: first slot of the edge's entries */
    uint8_t *length;    /* n_edges: their number */
    entry *entry;       /* MOST * n_edges, of which few are used; increasing for an edge */
} difference;

static void difference_free(difference *d)
{
    free(d->row);
    free(d->length);
    free(d->entry);
}

/* The number of weights in use in row i of P. */
static int row_length(const dmk_coarsening *c, int32_t i)
{
    const float *w = c->prolong_weight + 3 * (size_t)i;
    return w[1] == 0 ? 1 : w[2] == 0 ? 2 : 3;
}

/* Row i of P minus row j, without its zeros, by merging the two; returns the number of entries. */
static int subtract_rows(const dmk_coarsening *c, int32_t i, int32_t j, entry *to)
{
    const int32_t *a = c->prolong_index + 3 * (size_t)i, *b = c->prolong_index + 3 * (size_t)j;
    const float *u = c->prolong_weight + 3 * (size_t)i, *v = c->prolong_weight + 3 * (size_t)j;
    int n_a = row_length(c, i), n_b = row_length(c, j), n = 0, k = 0, l = 0;
    while (k < n_a || l < n_b) {
        int32_t x = k < n_a ? a[k] : INT32_MAX, y = l < n_b ? b[l] : INT32_MAX;
        float d = 0;
        if (x <= y) d += u[k++];
        if (y <= x) d -= v[l++];
        to[n] = (entry){dmk_min_i(x, y), d};
        n += d != 0; /* exact: DMK_WEIGHT_PARTS */
    }
    return n;
}

typedef struct difference_job {
    const dmk_coarsening *c;
    const int32_t *edge;
    difference *d;
} difference_job;

static bool is_wanted(const difference *d, int32_t a)
{
    return a >= d->first && a < d->end;
}

/* Whether an edge that has these n entries has a share of a wanted coarse edge. */
static bool has_wanted(const difference *d, int n, const entry *of)
{
    for (int k = 0; k + 1 < n; k++) {
        if (is_wanted(d, of[k].coarse)) return true;
    }
    return false;
}

/* A range's edges lie one after another from the slot of its first one on: pages behind the last one
 * are never touched. */
static void difference_range(int32_t begin, int32_t end, void *data)
{
    const difference_job *job = data;
    int32_t at = MOST * begin;
    entry of[MOST + 1] = {{0, 0}}; /* one more to write a zero into */
    for (int32_t e = begin; e < end; e++) {
        int n = subtract_rows(job->c, job->edge[2 * e], job->edge[2 * e + 1], of);
        if (!has_wanted(job->d, n, of)) n = 0;
        job->d->row[e] = at;
        job->d->length[e] = (uint8_t)n;
        /* All of them, a few instructions; those that are none are overwritten, or not read. */
        memcpy(job->d->entry + at, of, MOST * sizeof *of);
        at += n;
    }
}

static int difference_create(dmk_context *ctx, const dmk_coarsening *c, int32_t n_edges,
                             const int32_t *edge, difference *d)
{
    int rc;
    difference_job job = {c, edge, d};
    d->n_edges = n_edges;
    DMK_TRY(DMK_NEW_UNSET(ctx, d->row, (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->length, (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->entry, MOST * (size_t)n_edges + 1));
    dmk_parallel(ctx, n_edges, difference_range, &job);
done:
    return rc;
}

/* By coarse vertex a, the fine edges in whose d it occurs and is not the largest. */
typedef struct bucket {
    int32_t *row;   /* n_coarse + 1 */
    uint32_t *edge; /* row[n_coarse], increasing for each a: edge * 8 + slot of a among its d */
    int32_t *entry; /* n_coarse + 1: table entries before those of the coarse edges (a, b > a) */
} bucket;

static void bucket_free(bucket *k)
{
    free(k->row);
    free(k->edge);
    free(k->entry);
}

/* Number of table entries: one for each pair within a d. */
static int64_t count_pairs(const difference *d)
{
    int64_t sum = 0;
    for (int32_t e = 0; e < d->n_edges; e++) {
        int64_t n = d->length[e];
        sum += n * (n - 1) / 2;
    }
    return sum;
}

/* The edges are dealt out in pieces: where each begins among those of a coarse vertex follows from their counts. */
typedef struct filling {
    const difference *d;
    bucket *k;
    int32_t n_coarse, n_pieces;
    /* n_pieces * n_coarse: a piece's edges at a coarse vertex, then where its next one goes */
    int32_t *next;
} filling;

/* Of a piece's edges: count them, or put them where they belong. */
static void visit_piece(const filling *f, int32_t piece, bool put)
{
    const difference *d = f->d;
    int32_t *next = f->next + (size_t)piece * (size_t)f->n_coarse;
    const int32_t begin = dmk_range_begin(d->n_edges, piece, f->n_pieces),
                  end = dmk_range_begin(d->n_edges, piece + 1, f->n_pieces);
    for (int32_t e = begin; e < end; e++) {
        for (int32_t p = d->row[e]; p + 1 < d->row[e] + d->length[e]; p++) {
            if (!is_wanted(d, d->entry[p].coarse)) continue;
            int32_t *at = next + d->entry[p].coarse;
            if (put) f->k->edge[*at] = (uint32_t)e * 8 + (uint32_t)(p - d->row[e]);
            ++*at;
        }
    }
}

static int count_piece(dmk_context *own, int32_t piece, void *data)
{
    (void)own;
    visit_piece(data, piece, false);
    return DMK_OK;
}

static int put_piece(dmk_context *own, int32_t piece, void *data)
{
    (void)own;
    visit_piece(data, piece, true);
    return DMK_OK;
}

static void entry_range(int32_t begin, int32_t end, void *data)
{
    const filling *f = data;
    for (int32_t a = begin; a < end; a++) {
        for (int32_t i = f->k->row[a]; i < f->k->row[a + 1]; i++) {
            const uint32_t e = f->k->edge[i] / 8, slot = f->k->edge[i] % 8;
            f->k->entry[a + 1] += f->d->length[e] - 1 - (int32_t)slot;
        }
    }
}

static int bucket_create(dmk_context *ctx, const difference *d, int32_t n_coarse, bucket *k)
{
    int rc;
    filling f = {.d = d, .k = k, .n_coarse = n_coarse, .n_pieces = dmk_parallel_threads(ctx)};
    int32_t sum = 0;
    DMK_TRY(DMK_NEW_UNSET(ctx, k->row, (size_t)n_coarse + 1));
    DMK_TRY(DMK_NEW(ctx, k->entry, (size_t)n_coarse + 1));
    DMK_TRY(DMK_NEW(ctx, f.next, (size_t)f.n_pieces * (size_t)n_coarse));
    DMK_TRY(dmk_parallel_pieces(ctx, f.n_pieces, count_piece, &f));
    for (int32_t a = 0; a < n_coarse; a++) {
        k->row[a] = sum;
        for (int32_t piece = 0; piece < f.n_pieces; piece++) {
            int32_t *next = f.next + (size_t)piece * (size_t)n_coarse + a;
            const int32_t n = *next;
            *next = sum;
            sum += n;
        }
    }
    k->row[n_coarse] = sum;
    DMK_TRY(DMK_NEW_UNSET(ctx, k->edge, (size_t)sum + 1));
    DMK_TRY(dmk_parallel_pieces(ctx, f.n_pieces, put_piece, &f));
    dmk_parallel(ctx, n_coarse, entry_range, &f);
    for (int32_t a = 0; a < n_coarse; a++) k->entry[a + 1] += k->entry[a];
done:
    free(f.next);
    return rc;
}

/* The coarse edges by their smaller end, before they are packed one after another. */
typedef struct emitter {
    dmk_coarsening *c;
    const difference *d;
    const bucket *by_end;
    int32_t *first; /* n_coarse: slot in the next two of the edges of a */
    int32_t *count; /* n_coarse: number of edges (a, b > a) */
    int32_t *other; /* room for as many as table entries: b, increasing */
    int32_t *begin; /* as many: the edge's first table entry */
} emitter;

/* Working space of one thread, for each coarse vertex. */
typedef struct meeting {
    int32_t stamp; /* 1 + the vertex that met this one last, 0 = none */
    int32_t fill;  /* number, then next free slot, of the entries of that edge */
} meeting;

/* The edges of a to slot `at`, and their table rows; returns their number. */
static int32_t emit_edges(const emitter *m, int32_t a, int32_t at, meeting *met)
{
    const difference *d = m->d;
    int32_t *other = m->other + at, n = 0, slots = m->by_end->entry[a];
    int32_t from = m->by_end->row[a], to = m->by_end->row[a + 1];
    for (int32_t i = from; i < to; i++) {
        uint32_t e = m->by_end->edge[i] / 8, slot = m->by_end->edge[i] % 8;
        const int32_t end = d->row[e] + d->length[e];
        for (int32_t p = d->row[e] + (int32_t)slot + 1; p < end; p++) {
            meeting *with = met + d->entry[p].coarse;
            if (with->stamp != a + 1) {
                *with = (meeting){a + 1, 0};
                other[n++] = d->entry[p].coarse;
            }
            with->fill++;
        }
    }
    dmk_sort(n, other);
    for (int32_t i = 0; i < n; i++) {
        const int32_t entries = met[other[i]].fill;
        m->begin[at + i] = met[other[i]].fill = slots;
        slots += entries;
    }
    for (int32_t i = from; i < to; i++) {
        uint32_t e = m->by_end->edge[i] / 8, slot = m->by_end->edge[i] % 8;
        int32_t p = d->row[e] + (int32_t)slot;
        const int32_t end = d->row[e] + d->length[e];
        const float da = d->entry[p].value;
        for (p++; p < end; p++) {
            const int32_t to_entry = met[d->entry[p].coarse].fill++;
            m->c->galerkin_edge[to_entry] = (int32_t)e;
            m->c->galerkin_coef[to_entry] = -da * d->entry[p].value;
        }
    }
    return n;
}

static int emit_range(dmk_context *own, int32_t begin, int32_t end, void *data)
{
    int rc;
    const emitter *m = data;
    meeting *met = NULL;
    begin += m->d->first;
    end += m->d->first;
    int32_t at = m->by_end->entry[begin]; /* there are no more edges than entries */
    DMK_TRY(DMK_NEW(own, met, (size_t)m->c->coarse.n));
    for (int32_t a = begin; a < end; a++) {
        m->first[a] = at;
        m->count[a] = emit_edges(m, a, at, met);
        at += m->count[a];
    }
done:
    free(met);
    return rc;
}

/* The edges of the wanted coarse vertices, one after another. */
static int pack_edges(dmk_context *ctx, const emitter *m)
{
    int rc;
    dmk_coarsening *c = m->c;
    int32_t n = 0;
    for (int32_t a = 0; a < c->coarse.n; a++) n += m->count[a];
    DMK_TRY(DMK_NEW_UNSET(ctx, c->galerkin_row, (size_t)n + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->coarse.edge, 2 * (size_t)n + 1));
    c->coarse.n_edges = n;
    n = 0;
    for (int32_t a = 0; a < c->coarse.n; a++) {
        for (int32_t i = m->first[a]; i < m->first[a] + m->count[a]; i++) {
            c->coarse.edge[2 * n] = a;
            c->coarse.edge[2 * n + 1] = m->other[i];
            c->galerkin_row[n++] = m->begin[i];
        }
    }
    c->galerkin_row[n] = m->by_end->entry[c->coarse.n];
done:
    return rc;
}

static int emit_all(dmk_context *ctx, const difference *d, const bucket *by_end, dmk_coarsening *c)
{
    int rc;
    size_t n = (size_t)c->coarse.n, n_entries = (size_t)by_end->entry[n];
    emitter m = {.c = c, .d = d, .by_end = by_end};
    DMK_TRY(DMK_NEW(ctx, m.first, n));
    DMK_TRY(DMK_NEW(ctx, m.count, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, m.other, n_entries + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, m.begin, n_entries + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->galerkin_edge, n_entries + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->galerkin_coef, n_entries + 1));
    DMK_TRY(dmk_parallel_try(ctx, d->end - d->first, emit_range, &m));
    DMK_TRY(pack_edges(ctx, &m));
done:
    free(m.first);
    free(m.count);
    free(m.other);
    free(m.begin);
    return rc;
}

static int galerkin_tables(dmk_context *ctx, int32_t n_edges, const int32_t *fine_edge,
                           int32_t first, int32_t end, dmk_coarsening *c)
{
    int rc;
    difference d = {.first = first, .end = end};
    bucket by_end = {0};
    DMK_TRY(difference_create(ctx, c, n_edges, fine_edge, &d));
    int64_t n_pairs = count_pairs(&d);
    if (n_pairs > INT32_MAX / 2) {
        rc = dmk_fail(ctx, DMK_E_MESH, "the mesh is too large for 32-bit tables: %lld entries",
                      (long long)n_pairs);
        goto done;
    }
    DMK_TRY(bucket_create(ctx, &d, c->coarse.n, &by_end));
    rc = emit_all(ctx, &d, &by_end, c);
done:
    difference_free(&d);
    bucket_free(&by_end);
    return rc;
}

static int transpose(dmk_context *ctx, int32_t n_fine, dmk_coarsening *c)
{
    int rc;
    size_t n = (size_t)c->coarse.n;
    int32_t *fill = NULL, sum = 0;
    DMK_TRY(DMK_NEW(ctx, fill, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->restrict_row, n + 1));
    for (size_t k = 0; k < 3 * (size_t)n_fine; k++) {
        if (c->prolong_weight[k] != 0) fill[c->prolong_index[k]]++;
    }
    for (size_t a = 0; a < n; a++) {
        c->restrict_row[a] = sum;
        sum += fill[a];
        fill[a] = c->restrict_row[a];
    }
    c->restrict_row[n] = sum;
    DMK_TRY(DMK_NEW_UNSET(ctx, c->restrict_fine, (size_t)sum + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, c->restrict_weight, (size_t)sum + 1));
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

/* The two halves of a coarsening's tables; neither reads what the other makes. */
typedef struct halves {
    int32_t n_fine, n_edges, first, end;
    const int32_t *edge;
    dmk_coarsening *c;
} halves;

static int make_half(dmk_context *own, int32_t k, void *data)
{
    const halves *h = data;
    return k == 0 ? galerkin_tables(own, h->n_edges, h->edge, h->first, h->end, h->c)
                  : transpose(own, h->n_fine, h->c);
}

int dmk_galerkin_create(dmk_context *ctx, int32_t n_fine, int32_t n_fine_edges,
                        const int32_t *fine_edge, int32_t first, int32_t end, dmk_coarsening *c)
{
    halves h = {n_fine, n_fine_edges, first, end, fine_edge, c};
    return dmk_parallel_pieces(ctx, 2, make_half, &h);
}
