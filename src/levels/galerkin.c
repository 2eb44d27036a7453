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
    int32_t n_pieces;   /* that the edges are dealt out in */
    int32_t *count;     /* n_pieces * n_coarse: a piece's edges in the bucket of a coarse vertex */
    entry *entry;       /* MOST * n_edges, of which few are used; increasing for an edge */
} difference;

static void difference_free(difference *d)
{
    free(d->row);
    free(d->length);
    free(d->count);
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

/* A piece's edges lie one after another from the slot of its first one on: pages behind the last one
 * are never touched. */
static int difference_piece(dmk_context *own, int32_t piece, void *data)
{
    const difference_job *job = data;
    difference *d = job->d;
    const int32_t begin = dmk_range_begin(d->n_edges, piece, d->n_pieces),
                  end = dmk_range_begin(d->n_edges, piece + 1, d->n_pieces);
    int32_t at = MOST * begin, *count = d->count + (size_t)piece * (size_t)job->c->coarse.n;
    entry of[MOST + 1] = {{0, 0}}; /* one more to write a zero into */
    (void)own;
    for (int32_t e = begin; e < end; e++) {
        int n = subtract_rows(job->c, job->edge[2 * e], job->edge[2 * e + 1], of);
        if (!has_wanted(d, n, of)) n = 0;
        d->row[e] = at;
        d->length[e] = (uint8_t)n;
        /* All of them, a few instructions; those that are none are overwritten, or not read. */
        memcpy(d->entry + at, of, MOST * sizeof *of);
        for (int k = 0; k + 1 < n; k++) count[of[k].coarse] += is_wanted(d, of[k].coarse);
        at += n;
    }
    return DMK_OK;
}

static int difference_create(dmk_context *ctx, const dmk_coarsening *c, int32_t n_edges,
                             const int32_t *edge, difference *d)
{
    int rc;
    difference_job job = {c, edge, d};
    d->n_edges = n_edges;
    d->n_pieces = dmk_parallel_threads(ctx);
    DMK_TRY(DMK_NEW_UNSET(ctx, d->row, (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->length, (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->entry, MOST * (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW(ctx, d->count, (size_t)d->n_pieces * (size_t)c->coarse.n));
    rc = dmk_parallel_pieces(ctx, d->n_pieces, difference_piece, &job);
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

/* Where a piece's edges begin among those of a coarse vertex follows from the counts of all pieces. */
typedef struct filling {
    const difference *d;
    bucket *k;
    int32_t n_coarse;
    int32_t *next; /* n_pieces * n_coarse: where the piece's next edge at a coarse vertex goes */
} filling;

/* Put a piece's edges where they belong. */
static int put_piece(dmk_context *own, int32_t piece, void *data)
{
    const filling *f = data;
    const difference *d = f->d;
    int32_t *next = f->next + (size_t)piece * (size_t)f->n_coarse;
    const int32_t begin = dmk_range_begin(d->n_edges, piece, d->n_pieces),
                  end = dmk_range_begin(d->n_edges, piece + 1, d->n_pieces);
    (void)own;
    for (int32_t e = begin; e < end; e++) {
        const entry *of = d->entry + d->row[e];
        for (int32_t k = 0; k + 1 < d->length[e]; k++) {
            if (is_wanted(d, of[k].coarse))
                f->k->edge[next[of[k].coarse]++] = (uint32_t)e * 8 + (uint32_t)k;
        }
    }
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
    filling f = {.d = d, .k = k, .n_coarse = n_coarse, .next = d->count};
    int32_t sum = 0;
    DMK_TRY(DMK_NEW_UNSET(ctx, k->row, (size_t)n_coarse + 1));
    DMK_TRY(DMK_NEW(ctx, k->entry, (size_t)n_coarse + 1));
    for (int32_t a = 0; a < n_coarse; a++) {
        k->row[a] = sum;
        for (int32_t piece = 0; piece < d->n_pieces; piece++) {
            int32_t *next = f.next + (size_t)piece * (size_t)n_coarse + a;
            const int32_t n = *next;
            *next = sum;
            sum += n;
        }
    }
    k->row[n_coarse] = sum;
    DMK_TRY(DMK_NEW_UNSET(ctx, k->edge, (size_t)sum + 1));
    DMK_TRY(dmk_parallel_pieces(ctx, d->n_pieces, put_piece, &f));
    dmk_parallel(ctx, n_coarse, entry_range, &f);
    for (int32_t a = 0; a < n_coarse; a++) k->entry[a + 1] += k->entry[a];
done:
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

/* A table entry of an edge (a, b > a). */
typedef struct meeting {
    int32_t b, edge;
    float coef;
} meeting;

/* Working space of one thread. */
typedef struct workspace {
    int32_t *fill; /* n_coarse: number, then next free slot, of the entries of (a, b); then 0 */
    meeting *met;  /* of the a at hand */
} workspace;

/* What the fine edges around a say, in their order, and which b there are. Returns their number. */
static int32_t meet(const emitter *m, int32_t a, workspace *w, int32_t *other)
{
    const difference *d = m->d;
    int32_t n = 0;
    meeting *met = w->met;
    for (int32_t i = m->by_end->row[a]; i < m->by_end->row[a + 1]; i++) {
        const uint32_t e = m->by_end->edge[i] / 8, slot = m->by_end->edge[i] % 8;
        const entry *of = d->entry + d->row[e];
        const float da = of[slot].value;
        for (uint32_t p = slot + 1; p < d->length[e]; p++) {
            const int32_t b = of[p].coarse;
            *met++ = (meeting){b, (int32_t)e, -da * of[p].value};
            other[n] = b;
            n += w->fill[b]++ == 0;
        }
    }
    return n;
}

/* The edges of a to slot `at`, and their table rows; returns their number. */
static int32_t emit_edges(const emitter *m, int32_t a, int32_t at, workspace *w)
{
    int32_t *other = m->other + at, slots = m->by_end->entry[a];
    const int32_t n_met = m->by_end->entry[a + 1] - slots, n = meet(m, a, w, other);
    dmk_sort(n, other);
    for (int32_t i = 0; i < n; i++) {
        const int32_t entries = w->fill[other[i]];
        m->begin[at + i] = w->fill[other[i]] = slots;
        slots += entries;
    }
    for (int32_t i = 0; i < n_met; i++) {
        const int32_t to = w->fill[w->met[i].b]++;
        m->c->galerkin_edge[to] = w->met[i].edge;
        m->c->galerkin_coef[to] = w->met[i].coef;
    }
    for (int32_t i = 0; i < n; i++) w->fill[other[i]] = 0;
    return n;
}

/* Room for the entries of each a of a range. */
static int workspace_create(dmk_context *own, const emitter *m, int32_t begin, int32_t end,
                            workspace *w)
{
    int rc;
    int32_t most = 0;
    const int32_t *before = m->by_end->entry;
    for (int32_t a = begin; a < end; a++) most = dmk_max_i(most, before[a + 1] - before[a]);
    DMK_TRY(DMK_NEW(own, w->fill, (size_t)m->c->coarse.n));
    DMK_TRY(DMK_NEW_UNSET(own, w->met, (size_t)most + 1));
done:
    return rc;
}

static int emit_range(dmk_context *own, int32_t begin, int32_t end, void *data)
{
    int rc;
    const emitter *m = data;
    workspace w = {0};
    begin += m->d->first;
    end += m->d->first;
    int32_t at = m->by_end->entry[begin]; /* there are no more edges than entries */
    DMK_TRY(workspace_create(own, m, begin, end, &w));
    for (int32_t a = begin; a < end; a++) {
        m->first[a] = at;
        m->count[a] = emit_edges(m, a, at, &w);
        at += m->count[a];
    }
done:
    free(w.fill);
    free(w.met);
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
