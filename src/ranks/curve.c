/* The order of a mesh in pieces: triangles along the Morton curve, by a sort of samples. */
#include "ranks/pieces.h"

#include "base/sort.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { SAMPLES = 64 }; /* of each rank: no rank then has more than some 3 % above the mean */

/* ---- the corners ------------------------------------------------------------------------------ */

static int sort_ids(dmk_context *ctx, size_t n, const dmk_tile *tile, dmk_keyed **ids)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *ids, 3 * n));
    for (size_t i = 0; i < 3 * n; i++)
        (*ids)[i] = (dmk_keyed){(uint64_t)tile[i / 3].vertex[i % 3], (int32_t)i};
    rc = dmk_sort_keyed(ctx, *ids, 3 * n);
done:
    return rc;
}

int dmk_pieces_corners(dmk_context *ctx, const dmk_pieces *p, double **xyz)
{
    int rc;
    dmk_keyed *ids = NULL;
    dmk_list vertex = {0};
    double *at = NULL;
    const size_t n = 3 * p->n_tiles;
    DMK_TRY(sort_ids(ctx, p->n_tiles, p->tile, &ids));
    for (size_t i = 0; i < n; i++) DMK_TRY(dmk_list_add(ctx, &vertex, (int64_t)ids[i].key));
    DMK_TRY(DMK_NEW(ctx, at, 3 * vertex.n));
    DMK_TRY(dmk_fetch(ctx, &p->ranks, p->vertex_bound, vertex.n, vertex.at, 3 * sizeof *at, p->xyz,
                      at));
    DMK_TRY(DMK_NEW(ctx, *xyz, 3 * n));
    for (size_t i = 0, k = 0; i < n; i++) {
        k += i > 0 && ids[i].key != ids[i - 1].key;
        memcpy(*xyz + 3 * (size_t)ids[i].item, at + 3 * k, 3 * sizeof *at);
    }
done:
    free(ids);
    dmk_list_free(&vertex);
    free(at);
    return rc;
}

/* ---- keys ------------------------------------------------------------------------------------- */

/* Of all corners. */
static int find_box(dmk_context *ctx, const dmk_ranks *ranks, size_t n, const double *xyz,
                    double lo[3], double hi[3])
{
    int rc;
    double box[6], *all = NULL;
    for (int k = 0; k < 3; k++) box[k] = lo[k] = INFINITY, box[3 + k] = hi[k] = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            box[k] = dmk_min(box[k], xyz[3 * i + (size_t)k]);
            box[3 + k] = dmk_max(box[3 + k], xyz[3 * i + (size_t)k]);
        }
    }
    DMK_TRY(dmk_gather_each(ctx, ranks, sizeof box, box, (void **)&all));
    for (int r = 0; r < ranks->size; r++) {
        for (int k = 0; k < 3; k++) {
            lo[k] = dmk_min(lo[k], all[6 * r + k]);
            hi[k] = dmk_max(hi[k], all[6 * r + 3 + k]);
        }
    }
done:
    free(all);
    return rc;
}

static int find_keys(dmk_context *ctx, const dmk_pieces *p, const double *xyz)
{
    int rc;
    double lo[3], hi[3];
    DMK_TRY(find_box(ctx, &p->ranks, 3 * p->n_tiles, xyz, lo, hi));
    const double scale = dmk_morton_scale(lo, hi);
    for (size_t t = 0; t < p->n_tiles; t++) {
        const double *x = xyz + 9 * t;
        p->tile[t].key = dmk_morton_key(x, x + 3, x + 6, lo, scale);
    }
done:
    return rc;
}

/* ---- the sort --------------------------------------------------------------------------------- */

static int compare_numbers(const void *a, const void *b)
{
    const dmk_tile *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

/* By keys, and where these are the same by numbers. */
static int sort_tiles(dmk_context *ctx, size_t n, dmk_tile **tile)
{
    int rc;
    dmk_keyed *order = NULL;
    dmk_tile *sorted = NULL;
    DMK_TRY(DMK_NEW(ctx, order, n));
    DMK_TRY(DMK_NEW(ctx, sorted, n));
    for (size_t i = 0; i < n; i++) order[i] = (dmk_keyed){(*tile)[i].key, (int32_t)i};
    DMK_TRY(dmk_sort_keyed(ctx, order, n));
    for (size_t i = 0; i < n; i++) sorted[i] = (*tile)[order[i].item];
    for (size_t i = 0, end; i < n; i = end) {
        for (end = i + 1; end < n && sorted[end].key == sorted[i].key;) end++;
        if (end > i + 1) qsort(sorted + i, end - i, sizeof *sorted, compare_numbers);
    }
    free(*tile);
    *tile = sorted;
    sorted = NULL;
done:
    free(order);
    free(sorted);
    return rc;
}

static int compare_keys(const void *a, const void *b)
{
    const uint64_t *x = a, *y = b;
    return (*x > *y) - (*x < *y);
}

/* first[r]: rank r's keys are from there on. */
static int find_splitters(dmk_context *ctx, const dmk_pieces *p, uint64_t *first)
{
    int rc;
    const dmk_ranks *ranks = &p->ranks;
    uint64_t mine[SAMPLES], *all = NULL;
    size_t n = 0;
    for (size_t k = 0; k < SAMPLES; k++)
        mine[k] = p->n_tiles > 0 ? p->tile[p->n_tiles * k / SAMPLES].key : UINT64_MAX;
    DMK_TRY(dmk_gather_each(ctx, ranks, sizeof mine, mine, (void **)&all));
    qsort(all, SAMPLES * (size_t)ranks->size, sizeof *all, compare_keys);
    while (n < SAMPLES * (size_t)ranks->size && all[n] != UINT64_MAX) n++;
    for (size_t r = 0; r < (size_t)ranks->size; r++)
        first[r] = r > 0 && n > 0 ? all[n * r / (size_t)ranks->size] : 0;
done:
    free(all);
    return rc;
}

int dmk_pieces_ship(dmk_context *ctx, dmk_pieces *p, const int32_t *count)
{
    dmk_mail mail = {.item = sizeof *p->tile, .data = (void *)p->tile};
    p->tile = NULL;
    const int rc = dmk_mail_pass(ctx, &p->ranks, &mail, count);
    if (rc == DMK_OK) {
        p->tile = (void *)mail.data;
        p->n_tiles = mail.n;
        mail.data = NULL;
    }
    dmk_mail_free(&mail);
    return rc;
}

static int ship_tiles(dmk_context *ctx, dmk_pieces *p, const uint64_t *first)
{
    int rc, to = 0;
    int32_t *count = NULL;
    DMK_TRY(DMK_NEW(ctx, count, (size_t)p->ranks.size));
    for (size_t i = 0; i < p->n_tiles; i++) {
        while (to + 1 < p->ranks.size && p->tile[i].key >= first[to + 1]) to++;
        count[to]++;
    }
    rc = dmk_pieces_ship(ctx, p, count);
done:
    free(count);
    return rc;
}

int dmk_pieces_sort(dmk_context *ctx, dmk_pieces *p, const double *xyz)
{
    int rc;
    uint64_t *first = NULL;
    DMK_TRY(DMK_NEW(ctx, first, (size_t)p->ranks.size));
    DMK_TRY(find_keys(ctx, p, xyz));
    DMK_TRY(sort_tiles(ctx, p->n_tiles, &p->tile));
    DMK_TRY(find_splitters(ctx, p, first));
    DMK_TRY(ship_tiles(ctx, p, first));
    rc = sort_tiles(ctx, p->n_tiles, &p->tile);
done:
    free(first);
    return rc;
}
