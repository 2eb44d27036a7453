/* Corners at exactly the same position become one vertex. By sorting, so that no file can make it slow,
 * as it can with a table of hashes: positions of equal hash only cost a second sort. */
#include "io/io.h"

#include "base/sort.h"

#include <stdlib.h>
#include <string.h>

typedef struct corner_key {
    double x[3];
    int32_t corner;
} corner_key;

static int compare_positions(const void *a, const void *b)
{
    const corner_key *p = a, *q = b;
    int order = memcmp(p->x, q->x, sizeof p->x);
    return order ? order : (p->corner > q->corner) - (p->corner < q->corner);
}

static uint64_t hash(const double x[3])
{
    uint64_t h = 0, b;
    for (int k = 0; k < 3; k++) {
        memcpy(&b, &x[k], sizeof b);
        h = (h ^ b) * 0x9e3779b97f4a7c15ULL;
        h ^= h >> 32;
    }
    return h & ((UINT64_C(1) << DMK_KEY_BITS) - 1);
}

typedef struct weld {
    double *xyz; /* 3 for each corner */
    size_t n_keys;
    dmk_keyed *key; /* n_keys: hash and number of each corner that is to be sorted */
    int32_t
        *first; /* for each corner one before it at the same position, or itself; then the vertex */
} weld;

enum { SEEN_BITS = 14 };

/* Triangles of one vertex mostly stand near each other in a file: a corner that is still among the last
 * ones seen needs no sorting. One that was pushed out does: nothing is searched for. */
static void look_back(weld *w, int32_t n)
{
    int32_t seen[1 << SEEN_BITS]; /* by hash: the last corner, or some other */
    memset(seen, 0, sizeof seen);
    for (int32_t i = 0; i < n; i++) {
        double *x = w->xyz + 3 * (size_t)i;
        for (int k = 0; k < 3; k++) x[k] += 0.0; /* -0 becomes 0 */
        uint64_t h = hash(x);
        int32_t *last = &seen[h & ((1 << SEEN_BITS) - 1)];
        if (*last < i && memcmp(w->xyz + 3 * (size_t)*last, x, 3 * sizeof *x) == 0) {
            w->first[i] = *last;
        } else {
            w->key[w->n_keys++] = (dmk_keyed){h, i};
            *last = i;
        }
    }
}

static const double *position_of(const weld *w, size_t i)
{
    return w->xyz + 3 * (size_t)w->key[i].item;
}

/* Different positions of one hash. */
static int weld_mixed(dmk_context *ctx, const weld *w, size_t begin, size_t end)
{
    int rc;
    corner_key *list = NULL;
    size_t n = end - begin, first = 0;
    DMK_TRY(DMK_NEW(ctx, list, n));
    for (size_t i = 0; i < n; i++) {
        memcpy(list[i].x, position_of(w, begin + i), sizeof list[i].x);
        list[i].corner = w->key[begin + i].item;
    }
    qsort(list, n, sizeof *list, compare_positions);
    for (size_t i = 0; i < n; i++) {
        if (memcmp(list[i].x, list[first].x, sizeof list[i].x) != 0) first = i;
        w->first[list[i].corner] = list[first].corner;
    }
done:
    free(list);
    return rc;
}

/* Corners of one hash, in increasing order: nearly always those of one position. */
static int weld_run(dmk_context *ctx, const weld *w, size_t begin, size_t end)
{
    for (size_t i = begin; i < end; i++) {
        if (memcmp(position_of(w, i), position_of(w, begin), 3 * sizeof(double)) != 0) {
            return weld_mixed(ctx, w, begin, end);
        }
        w->first[w->key[i].item] = w->key[begin].item;
    }
    return DMK_OK;
}

/* Vertices are numbered as they first appear, and take the first rows of xyz. */
static size_t number_vertices(const weld *w, size_t n_corners)
{
    size_t n = 0;
    for (size_t i = 0; i < n_corners; i++) {
        if (w->first[i] == (int32_t)i) {
            memmove(w->xyz + 3 * n, w->xyz + 3 * i, 3 * sizeof *w->xyz);
            w->first[i] = (int32_t)n++;
        } else {
            w->first[i] = w->first[w->first[i]];
        }
    }
    return n;
}

int dmk_soup_weld(dmk_context *ctx, dmk_soup *soup)
{
    int rc;
    size_t n = soup->n_vertices;
    weld w = {.xyz = soup->xyz};
    DMK_TRY(DMK_NEW(ctx, w.key, n));
    DMK_TRY(DMK_NEW(ctx, w.first, n));
    look_back(&w, (int32_t)n);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_sort_keyed(ctx, w.key, w.n_keys));
    DMK_TRY(dmk_poll(ctx));
    for (size_t begin = 0, end; begin < w.n_keys; begin = end) {
        for (end = begin + 1; end < w.n_keys && w.key[end].key == w.key[begin].key;) end++;
        DMK_TRY(weld_run(ctx, &w, begin, end));
    }
    soup->n_vertices = number_vertices(&w, n);
    for (size_t i = 0; i < 3 * soup->n_triangles; i++) {
        soup->triangle[i] = w.first[soup->triangle[i]];
    }
done:
    free(w.key);
    free(w.first);
    return rc;
}
