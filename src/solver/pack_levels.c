/* The hierarchy's levels as the kernels read them: see packer.h and kernels/multigrid.cl. */
#include "solver/packer.h"
#include "solver/sell.h"

#include "dmk_shared.h"

#include <stdlib.h>
#include <string.h>

static int upload_slices(const packer *p, const dmk_sell *s, dmk_buffer **slice, dmk_buffer **entry,
                         dmk_buffer **weight)
{
    int rc;
    size_t n_slots = (size_t)s->slice[s->n_slices] * DMK_WIDTH;
    DMK_TRY(dmk_pack(p, (size_t)s->n_slices + 1, sizeof *s->slice, s->slice, slice));
    DMK_TRY(dmk_pack(p, n_slots, sizeof *s->entry, s->entry, entry));
    if (weight) DMK_TRY(dmk_pack(p, n_slots, sizeof *s->weight, s->weight, weight));
done:
    return rc;
}

/* Compressed rows to sliced rows on the device. */
static int pack_rows(const packer *p, int32_t n, const int32_t *row, const int32_t *entry,
                     const float *value, int32_t filler, dmk_buffer **slice, dmk_buffer **entries,
                     dmk_buffer **weight)
{
    dmk_sell s;
    int rc = dmk_sell_create(p->ctx, n, row, entry, value, filler, &s);
    if (rc != DMK_OK) return rc;
    rc = upload_slices(p, &s, slice, entries, value ? weight : NULL);
    dmk_sell_free(&s);
    return rc;
}

int dmk_pack_vectors(const packer *p, dmk_level *l)
{
    int rc;
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)l->n_pad, &l->rhs));
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)l->n_pad, &l->x));
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)l->n_pad, &l->x_old));
done:
    return rc;
}

int dmk_pack_graph(const packer *p, int32_t n, int32_t n_edges, const int32_t *edge_vertex,
                   dmk_level *l)
{
    int rc;
    int32_t *row = NULL, *fill = NULL, *neighbour = NULL, *number = NULL;
    dmk_sell s = {0};
    l->n = n;
    l->n_pad = dmk_padded(n);
    l->n_edges = n_edges;
    DMK_TRY(DMK_NEW(p->ctx, row, (size_t)n + 1));
    DMK_TRY(DMK_NEW_UNSET(p->ctx, fill, (size_t)n + 1));
    DMK_TRY(DMK_NEW_UNSET(p->ctx, neighbour, 2 * (size_t)n_edges + 1));
    DMK_TRY(DMK_NEW_UNSET(p->ctx, number, 2 * (size_t)n_edges + 1));
    for (int32_t i = 0; i < 2 * n_edges; i++)
        row[edge_vertex[i] + 1] += edge_vertex[i] != edge_vertex[i ^ 1];
    for (int32_t i = 0; i < n; i++) row[i + 1] += row[i];
    for (int32_t i = 0; i < n; i++) fill[i] = row[i];
    for (int32_t k = 0; k < n_edges; k++) {
        if (edge_vertex[2 * k] == edge_vertex[2 * k + 1]) continue;
        for (int side = 0; side < 2; side++) {
            int32_t at = fill[edge_vertex[2 * k + side]]++;
            neighbour[at] = edge_vertex[2 * k + !side];
            number[at] = k;
        }
    }
    DMK_TRY(pack_rows(p, n, row, neighbour, NULL, -1, &l->slice, &l->neighbour, NULL));
    DMK_TRY(dmk_sell_create(p->ctx, n, row, number, NULL, n_edges, &s));
    size_t n_slots = (size_t)s.slice[s.n_slices] * DMK_WIDTH;
    DMK_TRY(dmk_pack(p, n_slots, sizeof *s.entry, s.entry, &l->number));
    DMK_TRY(dmk_pack_work(p, DMK_INNER, n_slots, &l->weight));
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)dmk_padded(n_edges), &l->edge));
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)l->n_pad, &l->inv_diag));
done:
    dmk_sell_free(&s);
    free(row);
    free(fill);
    free(neighbour);
    free(number);
    return rc;
}

/* The Galerkin table's coefficients, which lie between -1 and 1, as whole numbers: 21 bytes per triangle less. */
static int pack_coefficients(const packer *p, size_t n, const float *coef, dmk_buffer **b)
{
    int rc;
    int16_t *whole = NULL;
    _Static_assert(DMK_GALERKIN_PARTS == DMK_WEIGHT_PARTS * DMK_WEIGHT_PARTS, "exact");
    _Static_assert(DMK_GALERKIN_PARTS <= INT16_MAX && 4 * DMK_GALERKIN_PARTS > INT16_MAX,
                   "as fine as can be");
    DMK_TRY(DMK_NEW_UNSET(p->ctx, whole, n + 1));
    for (size_t i = 0; i < n; i++) whole[i] = (int16_t)(DMK_GALERKIN_PARTS * coef[i]);
    DMK_TRY(dmk_pack(p, n, sizeof *whole, whole, b));
done:
    free(whole);
    return rc;
}

/* What is on the device now. */
#define SPEND(p, array)                                                                            \
    do {                                                                                           \
        if ((p)->spend) {                                                                          \
            free(array);                                                                           \
            (array) = NULL;                                                                        \
        }                                                                                          \
    } while (0)

/* The Galerkin table; 120 bytes per triangle come and go here, most of them of the first level. */
static int pack_galerkin(const packer *p, dmk_coarsening *c, dmk_level *l)
{
    int rc;
    const size_t table = (size_t)c->galerkin_row[c->coarse.n_edges];
    DMK_TRY(dmk_pack(p, table, sizeof(int32_t), c->galerkin_edge, &l->galerkin_edge));
    SPEND(p, c->galerkin_edge);
    DMK_TRY(pack_coefficients(p, table, c->galerkin_coef, &l->galerkin_coef));
    SPEND(p, c->galerkin_coef);
    DMK_TRY(dmk_pack(p, (size_t)c->coarse.n_edges + 1, sizeof(int32_t), c->galerkin_row,
                     &l->galerkin_row));
    SPEND(p, c->galerkin_row);
done:
    return rc;
}

/* Prolongation and restriction from a level of n_fine vertices to the next. */
static int pack_transfer(const packer *p, int32_t n_fine, dmk_coarsening *c, dmk_level *l)
{
    int rc;
    int32_t pad = dmk_padded(n_fine), *index = NULL;
    float *weight = NULL;
    /* A row's filler is any fine row: its weight is 0. */
    DMK_TRY(pack_rows(p, c->coarse.n, c->restrict_row, c->restrict_fine, c->restrict_weight, 0,
                      &l->restrict_slice, &l->restrict_entry, &l->restrict_weight));
    SPEND(p, c->restrict_fine);
    SPEND(p, c->restrict_weight);
    DMK_TRY(DMK_NEW(p->ctx, index, 3 * (size_t)pad));
    DMK_TRY(DMK_NEW(p->ctx, weight, 3 * (size_t)pad));
    for (int32_t i = 0; i < n_fine; i++) {
        for (int k = 0; k < 3; k++) {
            index[dmk_slot(i, k, 3)] = c->prolong_index[3 * i + k];
            weight[dmk_slot(i, k, 3)] = c->prolong_weight[3 * i + k];
        }
    }
    SPEND(p, c->prolong_index);
    SPEND(p, c->prolong_weight);
    DMK_TRY(dmk_pack(p, 3 * (size_t)pad, sizeof *index, index, &l->prolong_index));
    DMK_TRY(dmk_pack(p, 3 * (size_t)pad, sizeof *weight, weight, &l->prolong_weight));
done:
    free(index);
    free(weight);
    return rc;
}

/* The arrays of the coarsest levels become parts of one buffer, and a table holds where they lie. */
static int pack_tail(const packer *p)
{
    int rc = DMK_OK;
    dmk_system *s = p->sys;
    dmk_buffer **list[DMK_SYSTEM_LEVELS * DMK_LEVEL_ARRAYS];
    size_t offset[DMK_SYSTEM_LEVELS * DMK_LEVEL_ARRAYS];
    int32_t table[DMK_SYSTEM_LEVELS * DMK_TAIL_FIELDS];
    int n = s->share ? dmk_max_i(1, s->share->first_whole) : 1;
    while (n < s->n_levels && s->level[n].n > DMK_TAIL_MOST) n++;
    s->tail = n;
    n = s->n_levels - s->tail;
    if (n <= 0) goto done;
    for (int i = 0; i < n; i++)
        dmk_level_arrays(&s->level[s->tail + i], list + i * DMK_LEVEL_ARRAYS);
    DMK_TRY(dmk_buffer_gather(p->ctx, p->dev, (size_t)n * DMK_LEVEL_ARRAYS, list, offset,
                              &s->tail_arena));
    for (int i = 0; i < n; i++) {
        dmk_level *l = &s->level[s->tail + i];
        int32_t *field = table + i * DMK_TAIL_FIELDS;
        field[DMK_TAIL_ROWS] = l->n;
        field[DMK_TAIL_PAD] = l->n_pad;
        field[DMK_TAIL_EDGES] = l->n_edges;
        for (int k = 0; k < DMK_LEVEL_ARRAYS; k++) {
            field[DMK_TAIL_SLICE + k] =
                (int32_t)(offset[i * DMK_LEVEL_ARRAYS + k] / sizeof(int32_t));
        }
    }
    DMK_TRY(dmk_pack(p, (size_t)n * DMK_TAIL_FIELDS, sizeof *table, table, &s->tail_table));
done:
    return rc;
}

int dmk_pack_level(const packer *p, dmk_hierarchy *h, int32_t i)
{
    int rc;
    dmk_coarsening *c = &h->level[i];
    dmk_level *l = &p->sys->level[i + 1];
    const int32_t finest = p->sys->without_T ? p->sys->n_rows : p->mesh->n_vertices;
    DMK_TRY(pack_galerkin(p, c, l));
    DMK_TRY(pack_transfer(p, i > 0 ? h->level[i - 1].coarse.n : finest, c, l));
    DMK_TRY(dmk_pack_graph(p, c->coarse.n, c->coarse.n_edges, c->coarse.edge, l));
    rc = dmk_pack_vectors(p, l);
done:
    return rc;
}

int dmk_pack_coarsest(const packer *p, const dmk_hierarchy *h)
{
    int rc;
    dmk_system *s = p->sys;
    const dmk_level *last = &s->level[h->n];
    const int32_t *edges = h->n > 0 ? h->level[h->n - 1].coarse.edge : p->mesh->edge_vertex;
    s->n_levels = h->n + 1;
    s->n_coarse_edges = last->n_edges;
    DMK_TRY(DMK_NEW(p->ctx, s->coarse_edge_vertex, 2 * (size_t)last->n_edges));
    memcpy(s->coarse_edge_vertex, edges, 2 * (size_t)last->n_edges * sizeof *edges);
    DMK_TRY(dmk_pack_work(p, DMK_INNER, (size_t)last->n * (size_t)last->n_pad, &s->coarse_inverse));
    if (last->n <= DMK_DENSE && dmk_device_real(p->dev, DMK_OUTER) == sizeof(double)) {
        DMK_TRY(dmk_pack_work(p, DMK_OUTER, (size_t)last->n * (size_t)last->n, &s->dense));
    }
    rc = pack_tail(p);
done:
    return rc;
}

int dmk_pack_levels(const packer *p, dmk_hierarchy *h)
{
    int rc = DMK_OK;
    for (int32_t i = 0; i < h->n; i++) {
        DMK_TRY(dmk_pack_level(p, h, i));
        DMK_TRY(dmk_poll(p->ctx));
    }
    rc = dmk_pack_coarsest(p, h);
done:
    return rc;
}
