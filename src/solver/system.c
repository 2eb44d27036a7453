#include "solver/system.h"

#include "solver/fine_graph.h"
#include "solver/kernels.h"
#include "solver/memory.h"
#include "solver/sell.h"

#include "base/parallel.h"

#include "dmk_shared.h"

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

/* The packer's state: shorter calls below. */
typedef struct packer {
    dmk_context *ctx;
    dmk_device *dev;
    const dmk_mesh *mesh;
    const dmk_ground *ground; /* with ranks: that mesh, or this one's part of it */
    dmk_system *sys;
    bool spend; /* free the hierarchy's arrays as soon as they are packed */
} packer;

static int upload(const packer *p, size_t count, size_t size, const void *data, dmk_buffer **b)
{
    return dmk_buffer_create(p->ctx, p->dev, count * size, data, b);
}

/* Zeroed work arrays of n numbers. */
static int work(const packer *p, dmk_program program, size_t n, dmk_buffer **b)
{
    return dmk_buffer_create(p->ctx, p->dev, n * dmk_device_real(p->dev, program), NULL, b);
}

static int upload_real(const packer *p, size_t n, const double *data, dmk_buffer **b)
{
    int rc = work(p, DMK_OUTER, n, b);
    return rc ? rc : dmk_buffer_write_real(p->ctx, p->dev, DMK_OUTER, *b, n, data);
}

typedef struct element_job {
    const packer *p;
    int32_t *index;     /* 6 per element */
    double *cot, *area; /* 3, 1 */
} element_job;

static void element_range(int32_t begin, int32_t end, void *data)
{
    const element_job *job = data;
    const dmk_mesh *m = job->p->mesh;
    const dmk_system *s = job->p->sys;
    for (int32_t t = begin; t < end; t++) {
        double cot[3];
        dmk_cots(m, t, cot);
        for (int k = 0; k < 3; k++) {
            job->index[dmk_slot(t, k, 6)] = s->vertex_row + m->triangle[3 * t + k];
            job->index[dmk_slot(t, 3 + k, 6)] = m->triangle_edge[3 * t + k];
            job->cot[dmk_slot(t, k, 3)] = cot[k];
        }
        job->area[t] = m->area[t] / (s->unit * s->unit);
    }
}

/* Elements: rows of corners and midpoints, cotangents, areas in units of the total. */
static int pack_elements(const packer *p)
{
    int rc;
    dmk_system *s = p->sys;
    size_t n = (size_t)s->n_elements_pad;
    element_job job = {.p = p};
    DMK_TRY(DMK_NEW(p->ctx, job.index, 6 * n));
    DMK_TRY(DMK_NEW(p->ctx, job.cot, 3 * n));
    DMK_TRY(DMK_NEW(p->ctx, job.area, n));
    for (int32_t t = s->n_elements; t < s->n_elements_pad; t++) {
        for (int k = 0; k < 3; k++) job.index[dmk_slot(t, k, 6)] = s->vertex_row;
        job.area[t] = 1;
    }
    dmk_parallel(p->ctx, s->n_elements, element_range, &job);
    DMK_TRY(upload(p, 6 * n, sizeof *job.index, job.index, &s->index));
    DMK_TRY(upload_real(p, 3 * n, job.cot, &s->cot));
    DMK_TRY(upload_real(p, n, job.area, &s->area));
done:
    free(job.index);
    free(job.cot);
    free(job.area);
    return rc;
}

/* Triangles with an element bound above 2.5 (see stiffness_bound in density.cl): flatter than a right angle by far. Few
 * do no harm, as a flat triangle damps its own nodes only. Those with an angle below 5 degrees. And the largest
 * cotangent. */
typedef struct needles {
    const dmk_mesh *mesh;
    int32_t begin, end; /* of its triangles */
    int64_t n_flat, n_sharp;
    double sharpest;
    pthread_mutex_t lock;
} needles;

static void needle_range(int32_t begin, int32_t end, void *data)
{
    needles *f = data;
    const dmk_mesh *m = f->mesh;
    int64_t n_flat = 0, n_sharp = 0;
    double sharpest = 0;
    for (int32_t t = f->begin + begin; t < f->begin + end; t++) {
        double c[3];
        dmk_cots(m, t, c);
        sharpest = dmk_max(sharpest, dmk_max(fabs(c[0]), dmk_max(fabs(c[1]), fabs(c[2]))));
        n_sharp += dmk_is_needle(c);
        if (c[0] >= 0 && c[1] >= 0 && c[2] >= 0) continue; /* s is 2 or more */
        const double s = 1 / (1 + c[0] * c[0]) + 1 / (1 + c[1] * c[1]) + 1 / (1 + c[2] * c[2]);
        n_flat += 1.5 + sqrt(dmk_max(2.25 - s, 0)) > 2.5;
    }
    pthread_mutex_lock(&f->lock);
    f->n_flat += n_flat;
    f->n_sharp += n_sharp;
    f->sharpest = fmax(f->sharpest, sharpest);
    pthread_mutex_unlock(&f->lock);
}

static void add_needles(void *data, double *sum)
{
    const needles *f = data;
    *sum += (double)f->n_flat;
}

static void take_sharpest(void *data, double *sharpest)
{
    const needles *f = data;
    *sharpest = fmax(*sharpest, f->sharpest);
}

/* What the smoother's degree and the levels hang on; with a part of the mesh here, of all ranks. */
static int look_at_angles(dmk_context *ctx, const dmk_ranks *ranks, const dmk_ground *g,
                          dmk_system *s)
{
    int rc = DMK_OK;
    needles f = {.mesh = g->mesh, .end = g->mesh->n_triangles};
    double n;
    if (g->element) {
        while (f.begin < f.end && g->element[f.begin] < g->bound[0][ranks->rank]) f.begin++;
        f.end = f.begin + (int32_t)(g->bound[0][ranks->rank + 1] - g->bound[0][ranks->rank]);
    }
    pthread_mutex_init(&f.lock, NULL);
    dmk_parallel(ctx, f.end - f.begin, needle_range, &f);
    pthread_mutex_destroy(&f.lock);
    n = (double)f.n_flat;
    s->sharpest = f.sharpest;
    s->of_needles = !g->element && dmk_device_real(s->device, DMK_OUTER) == sizeof(double) &&
                    dmk_fine_graph_pays(s->whole.n_elements, f.n_sharp, f.sharpest);
    if (s->of_needles) DMK_TRY(dmk_memory_check_needles(ctx, s->whole.n_elements));
    if (g->element) {
        n = 0;
        DMK_TRY(dmk_ranks_in_turn(ctx, ranks, &n, add_needles, &f));
        DMK_TRY(dmk_ranks_in_turn(ctx, ranks, &s->sharpest, take_sharpest, &f));
    }
    s->usual_degree = n / s->whole.n_elements > 0.05 ? 3 : 2;
done:
    return rc;
}

static int upload_slices(const packer *p, const dmk_sell *s, dmk_buffer **slice, dmk_buffer **entry,
                         dmk_buffer **weight)
{
    int rc;
    size_t n_slots = (size_t)s->slice[s->n_slices] * DMK_WIDTH;
    DMK_TRY(upload(p, (size_t)s->n_slices + 1, sizeof *s->slice, s->slice, slice));
    DMK_TRY(upload(p, n_slots, sizeof *s->entry, s->entry, entry));
    if (weight) DMK_TRY(upload(p, n_slots, sizeof *s->weight, s->weight, weight));
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

/* The corners (4 * triangle + k) at each vertex, as sliced rows; filled up with one that stays 0. */
static int corners_create(const packer *p, dmk_sell *corners)
{
    int rc;
    dmk_vertex_stars star = {0};
    DMK_TRY(dmk_vertex_stars_create(p->ctx, p->mesh, &star));
    DMK_TRY(dmk_sell_create(p->ctx, p->mesh->n_vertices, star.row, star.triangle, NULL,
                            4 * (p->sys->n_elements_pad - 1), corners));
done:
    dmk_vertex_stars_free(&star);
    return rc;
}

/* Places among the elements' numbers, 6 or 3 for each, of what belongs to an edge or a corner. */
typedef struct slot_job {
    const dmk_mesh *mesh;
    const dmk_sell *corners;
    int32_t *edge;   /* 2 for each edge: its sides k in its triangles; a border edge has one */
    int32_t *corner; /* for each slot of `corners` */
} slot_job;

static void edge_slot_range(int32_t begin, int32_t end, void *data)
{
    const slot_job *job = data;
    const dmk_mesh *m = job->mesh;
    for (int32_t e = begin; e < end; e++) {
        for (int side = 0; side < 2; side++) {
            int32_t t = m->edge_triangle[2 * e + side];
            if (t < 0) continue;
            const int32_t k = dmk_half_edge_on(m, t, e) - 3 * t;
            job->edge[dmk_slot(e, side, 2)] = (int32_t)dmk_slot(t, 3 + k, 6);
        }
    }
}

static void corner_slot_range(int32_t begin, int32_t end, void *data)
{
    const slot_job *job = data;
    for (int32_t s = begin; s < end; s++) {
        int32_t first = DMK_WIDTH * job->corners->slice[s],
                last = DMK_WIDTH * job->corners->slice[s + 1];
        for (int32_t i = first; i < last; i++) {
            int32_t t = job->corners->entry[i] / 4, k = job->corners->entry[i] % 4;
            job->corner[i] = (int32_t)dmk_slot(t, k, 6);
        }
    }
}

/* Rows of T/2, midpoints in two columns, then vertices: where the elements leave what each row sums up.
 * Edges and vertices of T find theirs among 3 numbers per element by these slots, see density.cl. */
static int pack_slots(const packer *p)
{
    int rc;
    dmk_system *s = p->sys;
    dmk_sell corners = {0};
    int32_t *slice = NULL, *slot = NULL;
    int32_t edge_slices = s->vertex_row / DMK_WIDTH;
    size_t edges = 2 * (size_t)s->vertex_row;
    DMK_TRY(corners_create(p, &corners));
    size_t n_slices = (size_t)(edge_slices + corners.n_slices);
    size_t n_slots = DMK_WIDTH * (size_t)corners.slice[corners.n_slices];
    const size_t ahead = DMK_WIDTH * DMK_AHEAD; /* any place of `out` */
    DMK_TRY(DMK_NEW_UNSET(p->ctx, slice, n_slices + 1));
    DMK_TRY(DMK_NEW_UNSET(p->ctx, slot, edges + n_slots + ahead));
    memset(slot + edges + n_slots, 0, ahead * sizeof *slot);
    for (int32_t k = 0; k < edge_slices; k++) slice[k] = 2 * k;
    for (int32_t k = 0; k <= corners.n_slices; k++) {
        slice[edge_slices + k] = 2 * edge_slices + corners.slice[k];
    }
    for (size_t i = 0; i < edges; i++) slot[i] = (int32_t)dmk_slot(s->n_elements_pad - 1, 3, 6);
    slot_job job = {p->mesh, &corners, slot, slot + edges};
    dmk_parallel(p->ctx, s->n_edges, edge_slot_range, &job);
    dmk_parallel(p->ctx, corners.n_slices, corner_slot_range, &job);
    DMK_TRY(upload(p, n_slices + 1, sizeof *slice, slice, &s->slice));
    DMK_TRY(upload(p, edges + n_slots + ahead, sizeof *slot, slot, &s->slot));
done:
    dmk_sell_free(&corners);
    free(slice);
    free(slot);
    return rc;
}

/* The two vertices of T whose mean a row of T/2 takes: a midpoint's edge, twice the vertex itself. */
static int pack_ends(const packer *p)
{
    int rc;
    const dmk_mesh *m = p->mesh;
    dmk_system *s = p->sys;
    int32_t *ends = NULL;
    DMK_TRY(DMK_NEW_UNSET(p->ctx, ends, 2 * (size_t)s->n_rows_pad));
    for (int32_t i = 0; i < 2 * s->n_rows_pad; i++) ends[i] = m->n_vertices; /* stays 0 on T */
    for (int32_t e = 0; e < m->n_edges; e++) {
        for (int k = 0; k < 2; k++) ends[dmk_slot(e, k, 2)] = m->edge_vertex[2 * e + k];
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        for (int k = 0; k < 2; k++) ends[dmk_slot(s->vertex_row + v, k, 2)] = v;
    }
    DMK_TRY(upload(p, 2 * (size_t)s->n_rows_pad, sizeof *ends, ends, &s->ends));
done:
    free(ends);
    return rc;
}

static int make_vectors(const packer *p, dmk_level *l)
{
    int rc;
    DMK_TRY(work(p, DMK_INNER, (size_t)l->n_pad, &l->rhs));
    DMK_TRY(work(p, DMK_INNER, (size_t)l->n_pad, &l->x));
    DMK_TRY(work(p, DMK_INNER, (size_t)l->n_pad, &l->x_old));
done:
    return rc;
}

/* A graph's rows: neighbours with their edge numbers. Edges from a row to itself are none. */
static int pack_graph(const packer *p, int32_t n, int32_t n_edges, const int32_t *edge_vertex,
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
    DMK_TRY(upload(p, n_slots, sizeof *s.entry, s.entry, &l->number));
    DMK_TRY(work(p, DMK_INNER, n_slots, &l->weight));
    DMK_TRY(work(p, DMK_INNER, (size_t)dmk_padded(n_edges), &l->edge));
    DMK_TRY(work(p, DMK_INNER, (size_t)l->n_pad, &l->inv_diag));
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
    DMK_TRY(upload(p, n, sizeof *whole, whole, b));
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
    DMK_TRY(upload(p, table, sizeof(int32_t), c->galerkin_edge, &l->galerkin_edge));
    SPEND(p, c->galerkin_edge);
    DMK_TRY(pack_coefficients(p, table, c->galerkin_coef, &l->galerkin_coef));
    SPEND(p, c->galerkin_coef);
    DMK_TRY(upload(p, (size_t)c->coarse.n_edges + 1, sizeof(int32_t), c->galerkin_row,
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
    DMK_TRY(upload(p, 3 * (size_t)pad, sizeof *index, index, &l->prolong_index));
    DMK_TRY(upload(p, 3 * (size_t)pad, sizeof *weight, weight, &l->prolong_weight));
done:
    free(index);
    free(weight);
    return rc;
}

/* In the order of dmk_shared.h. */
enum { TAIL_ARRAYS = DMK_TAIL_FIELDS - DMK_TAIL_SLICE };
static void list_tail(dmk_level *l, dmk_buffer **list[TAIL_ARRAYS])
{
    dmk_buffer **all[TAIL_ARRAYS] = {&l->slice,
                                     &l->neighbour,
                                     &l->number,
                                     &l->weight,
                                     &l->edge,
                                     &l->inv_diag,
                                     &l->rhs,
                                     &l->x,
                                     &l->x_old,
                                     &l->restrict_slice,
                                     &l->restrict_entry,
                                     &l->restrict_weight,
                                     &l->prolong_index,
                                     &l->prolong_weight,
                                     &l->galerkin_row,
                                     &l->galerkin_edge,
                                     &l->galerkin_coef};
    memcpy(list, all, sizeof all);
}

/* The arrays of the coarsest levels become parts of one buffer, and a table holds where they lie. */
static int pack_tail(const packer *p)
{
    int rc = DMK_OK;
    dmk_system *s = p->sys;
    dmk_buffer **list[DMK_SYSTEM_LEVELS * TAIL_ARRAYS];
    size_t offset[DMK_SYSTEM_LEVELS * TAIL_ARRAYS];
    int32_t table[DMK_SYSTEM_LEVELS * DMK_TAIL_FIELDS];
    int n = s->share ? dmk_max_i(1, s->share->first_whole) : 1;
    while (n < s->n_levels && s->level[n].n > DMK_TAIL_MOST) n++;
    s->tail = n;
    n = s->n_levels - s->tail;
    if (n <= 0) goto done;
    for (int i = 0; i < n; i++) list_tail(&s->level[s->tail + i], list + i * TAIL_ARRAYS);
    DMK_TRY(
        dmk_buffer_gather(p->ctx, p->dev, (size_t)n * TAIL_ARRAYS, list, offset, &s->tail_arena));
    for (int i = 0; i < n; i++) {
        dmk_level *l = &s->level[s->tail + i];
        int32_t *field = table + i * DMK_TAIL_FIELDS;
        field[DMK_TAIL_ROWS] = l->n;
        field[DMK_TAIL_PAD] = l->n_pad;
        field[DMK_TAIL_EDGES] = l->n_edges;
        for (int k = 0; k < TAIL_ARRAYS; k++) {
            field[DMK_TAIL_SLICE + k] = (int32_t)(offset[i * TAIL_ARRAYS + k] / sizeof(int32_t));
        }
    }
    DMK_TRY(upload(p, (size_t)n * DMK_TAIL_FIELDS, sizeof *table, table, &s->tail_table));
done:
    return rc;
}

/* The hierarchy's level i, which is the system's next one, and the transfer to it. */
static int pack_level(const packer *p, dmk_hierarchy *h, int32_t i)
{
    int rc;
    dmk_coarsening *c = &h->level[i];
    dmk_level *l = &p->sys->level[i + 1];
    const int32_t finest = p->sys->without_T ? p->sys->n_rows : p->mesh->n_vertices;
    DMK_TRY(pack_galerkin(p, c, l));
    DMK_TRY(pack_transfer(p, i > 0 ? h->level[i - 1].coarse.n : finest, c, l));
    DMK_TRY(pack_graph(p, c->coarse.n, c->coarse.n_edges, c->coarse.edge, l));
    rc = make_vectors(p, l);
done:
    return rc;
}

/* What follows from all levels. */
static int pack_coarsest(const packer *p, const dmk_hierarchy *h)
{
    int rc;
    dmk_system *s = p->sys;
    const dmk_level *last = &s->level[h->n];
    const int32_t *edges = h->n > 0 ? h->level[h->n - 1].coarse.edge : p->mesh->edge_vertex;
    s->n_levels = h->n + 1;
    s->n_coarse_edges = last->n_edges;
    DMK_TRY(DMK_NEW(p->ctx, s->coarse_edge_vertex, 2 * (size_t)last->n_edges));
    memcpy(s->coarse_edge_vertex, edges, 2 * (size_t)last->n_edges * sizeof *edges);
    DMK_TRY(work(p, DMK_INNER, (size_t)last->n * (size_t)last->n_pad, &s->coarse_inverse));
    if (last->n <= DMK_DENSE && dmk_device_real(p->dev, DMK_OUTER) == sizeof(double)) {
        DMK_TRY(work(p, DMK_OUTER, (size_t)last->n * (size_t)last->n, &s->dense));
    }
    rc = pack_tail(p);
done:
    return rc;
}

static int pack_levels(const packer *p, dmk_hierarchy *h)
{
    int rc = DMK_OK;
    for (int32_t i = 0; i < h->n; i++) {
        DMK_TRY(pack_level(p, h, i));
        DMK_TRY(dmk_poll(p->ctx));
    }
    rc = pack_coarsest(p, h);
done:
    return rc;
}

/* The hierarchy, made beside the packing of the fine level; each of its levels is packed at once. */
typedef struct coarsener {
    const packer *packer;
    dmk_hierarchy hierarchy;
    dmk_task task;    /* packs the level that came last */
    int32_t n_handed; /* levels that have come */
} coarsener;

static int pack_made(dmk_context *own, void *data)
{
    coarsener *c = data;
    packer p = *c->packer;
    p.ctx = own;
    return pack_level(&p, &c->hierarchy, c->n_handed - 1);
}

static int take_level(dmk_context *ctx, void *user, dmk_coarsening *level)
{
    coarsener *c = user;
    const int rc = dmk_task_end(ctx, &c->task, DMK_OK);
    if (rc != DMK_OK || !level) return rc;
    c->n_handed++;
    dmk_task_begin(ctx, &c->task, pack_made, c);
    return DMK_OK;
}

static int coarsen(dmk_context *own, void *data)
{
    coarsener *c = data;
    const dmk_level_taker taker = {take_level, c};
    return dmk_hierarchy_hand_over(own, c->packer->mesh, DMK_COARSEST, &taker, &c->hierarchy);
}

/* Inner and outer solves take turns, so the inner vectors lie in the outer ones' memory; and the elements'
 * shares of T's operator, which the refresh alone reads, in that of CG's p and ap, which it begins with
 * writing. */
static int allocate_cg(const packer *p)
{
    int rc;
    dmk_system *s = p->sys;
    size_t n = (size_t)s->n_rows_pad;
    bool wide = dmk_device_real(p->dev, DMK_OUTER) == sizeof(double);
    const size_t vector = n * dmk_device_real(p->dev, DMK_OUTER);
    const size_t shares = 3 * (size_t)s->n_elements_pad * sizeof(float);
    const size_t shared = vector > shares ? vector : shares;
    DMK_TRY(work(p, DMK_OUTER, n, &s->cg[DMK_OUTER].r));
    DMK_TRY(dmk_buffer_create(p->ctx, p->dev, shared, NULL, &s->cg[DMK_OUTER].p));
    DMK_TRY(dmk_buffer_create(p->ctx, p->dev, shared, NULL, &s->cg[DMK_OUTER].ap));
    s->edge = s->cg[DMK_OUTER].p;
    s->diag_coarse = s->cg[DMK_OUTER].ap;
    if (wide)
        DMK_TRY(work(p, DMK_INNER, n, &s->cg[DMK_OUTER].narrow));
    else
        s->cg[DMK_OUTER].narrow = s->cg[DMK_OUTER].r;
    s->cg[DMK_INNER] = s->cg[DMK_OUTER];
    s->cg[DMK_INNER].r = s->cg[DMK_INNER].narrow;
    s->w = s->cg[DMK_OUTER].r; /* the inner solution, while the outer residual is not needed */
    if (!wide) DMK_TRY(work(p, DMK_INNER, n, &s->w));
done:
    return rc;
}

static int allocate_work(const packer *p)
{
    int rc;
    dmk_system *s = p->sys;
    size_t e = (size_t)s->n_elements_pad, n = (size_t)s->n_rows_pad;
    size_t parts = dmk_launch_parts(p->dev, n > e ? n : e), all = dmk_share_most_parts(s->share);
    if (all > parts) parts = all;
    DMK_TRY(work(p, DMK_OUTER, e, &s->q));
    DMK_TRY(work(p, DMK_OUTER, 6 * e, &s->out_real));
    DMK_TRY(work(p, DMK_INNER, 3 * e, &s->weight));
    const size_t load = (size_t)s->level[0].n_pad * dmk_device_real(p->dev, DMK_OUTER),
                 rank_one = 6 * e * sizeof(float);
    DMK_TRY(
        dmk_buffer_create(p->ctx, p->dev, load > rank_one ? load : rank_one, NULL, &s->rank_one));
    s->load = s->rank_one;        /* Newton's steps on T have no use for that */
    s->weight_real = s->rank_one; /* A's operator in double, Newton's in single: in turn */
    if (s->without_T) {           /* at once, for Newton's is in both */
        DMK_TRY(work(p, DMK_OUTER, 6 * e, &s->rank_one_real));
        DMK_TRY(work(p, DMK_OUTER, 3 * e, &s->weight_wide));
        s->weight_real = s->weight_wide;
    }
    s->out =
        s->out_real; /* what one program puts there is summed up before the other puts anything */
    DMK_TRY(work(p, DMK_INNER, n, &s->inv_diag));
    DMK_TRY(work(p, DMK_INNER, n, &s->x));
    DMK_TRY(work(p, DMK_INNER, n, &s->x_old));
    DMK_TRY(allocate_cg(p));
    if (s->without_T) {
        s->level[0].rhs = s->cg[DMK_OUTER].narrow;
        s->level[0].x = s->x;
        s->level[0].x_old = s->x_old;
    }
    DMK_TRY(work(p, DMK_OUTER, DMK_MOST_SUMS * parts, &s->partial));
    DMK_TRY(work(p, DMK_OUTER, 8, &s->state));
    DMK_TRY(work(p, DMK_INNER, 1, &s->done));
    DMK_TRY(work(p, DMK_OUTER, 16, &s->scalars));
done:
    return rc;
}

int dmk_system_allocate_state(dmk_context *ctx, dmk_system *s)
{
    int rc = DMK_OK;
    packer p = {.ctx = ctx, .dev = s->device, .sys = s};
    if (s->f) return DMK_OK; /* the last one made */
    DMK_TRY(work(&p, DMK_OUTER, (size_t)s->n_elements_pad, &s->mu));
    DMK_TRY(work(&p, DMK_OUTER, (size_t)s->n_rows_pad, &s->u));
    DMK_TRY(work(&p, DMK_OUTER, (size_t)s->n_rows_pad, &s->f));
done:
    if (rc != DMK_OK) dmk_system_release(s);
    return rc;
}

int dmk_system_allocate(dmk_context *ctx, dmk_system *s)
{
    packer p = {.ctx = ctx, .dev = s->device, .sys = s};
    if (s->scalars) return DMK_OK; /* the last one made */
    int rc = dmk_system_allocate_state(ctx, s);
    if (rc == DMK_OK) rc = allocate_work(&p);
    if (rc != DMK_OK) dmk_system_release(s);
    return rc;
}

void dmk_system_release(dmk_system *s)
{
    dmk_buffer **all[] = {&s->mu,     &s->u,       &s->f,        &s->q,           &s->out_real,
                          &s->before, &s->weight,  &s->rank_one, &s->inv_diag,    &s->x,
                          &s->x_old,  &s->partial, &s->state,    &s->weight_wide, &s->rank_one_real,
                          &s->done,   &s->scalars};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) dmk_buffer_destroy(all[i]);
    if (s->w != s->cg[DMK_OUTER].r) dmk_buffer_destroy(&s->w);
    if (s->cg[DMK_OUTER].narrow != s->cg[DMK_OUTER].r) dmk_buffer_destroy(&s->cg[DMK_OUTER].narrow);
    dmk_buffer_destroy(&s->cg[DMK_OUTER].r);
    dmk_buffer_destroy(&s->cg[DMK_OUTER].p);
    dmk_buffer_destroy(&s->cg[DMK_OUTER].ap);
    s->w = s->cg[DMK_OUTER].narrow = NULL;
    if (s->without_T) s->level[0].rhs = s->level[0].x = s->level[0].x_old = NULL;
}

static int pack_elements_and_rows(const packer *p)
{
    int rc;
    DMK_TRY(pack_elements(p));
    DMK_TRY(dmk_poll(p->ctx));
    DMK_TRY(pack_slots(p));
    DMK_TRY(dmk_poll(p->ctx));
    DMK_TRY(pack_ends(p));
    rc = dmk_poll(p->ctx);
done:
    return rc;
}

static int pack_fine(const packer *p)
{
    int rc;
    const dmk_mesh *m = p->mesh;
    dmk_level *l = &p->sys->level[0];
    DMK_TRY(pack_elements_and_rows(p));
    DMK_TRY(pack_graph(p, m->n_vertices, m->n_edges, m->edge_vertex, l));
    rc = make_vectors(p, l);
done:
    return rc;
}

/* Coarse levels of T/2 itself; nothing is made if it does not become coarse enough. */
static int pack_without_T(const packer *p)
{
    int rc;
    dmk_fine_graph f;
    dmk_system *s = p->sys;
    DMK_TRY(dmk_fine_graph_create(p->ctx, &s->whole, p->mesh, DMK_COARSEST, &f));
    s->without_T = f.hierarchy.n > 0;
    if (!s->without_T) goto done;
    s->elements_at = f.elements_at;
    DMK_TRY(pack_elements_and_rows(p));
    DMK_TRY(upload(p, 2 * (size_t)f.elements_at, sizeof *f.slot, f.slot, &s->share_slot));
    DMK_TRY(pack_graph(p, s->n_rows, f.n_edges, f.edge, &s->level[0]));
    rc = pack_levels(p, &f.hierarchy);
done:
    dmk_fine_graph_free(&f);
    return rc;
}

static int pack_all(const packer *p)
{
    int rc;
    dmk_task task;
    coarsener c = {.packer = p};
    if (p->sys->of_needles) {
        rc = pack_without_T(p);
        if (rc != DMK_OK || p->sys->without_T) return rc;
    }
    dmk_task_begin(p->ctx, &task, coarsen, &c);
    rc = pack_fine(p);
    DMK_TRY(dmk_task_end(p->ctx, &task, rc));
    DMK_TRY(pack_coarsest(p, &c.hierarchy));
done:
    dmk_hierarchy_free(&c.hierarchy);
    return rc;
}

static void set_counts(dmk_system *s, const dmk_mesh *packed)
{
    dmk_counts c = dmk_system_counts(s->device, packed);
    s->n_elements = c.n_elements;
    s->n_elements_pad = c.n_elements_pad;
    s->n_edges = c.n_edges;
    s->n_vertices = c.n_vertices;
    s->vertex_row = c.vertex_row;
    s->n_rows = c.n_rows;
    s->n_rows_pad = c.n_rows_pad;
}

/* The share in the mesh's place, whose neighbours are not known yet. */
static int pack_own(const packer *p, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    dmk_local local = {.first_whole = 0};
    packer mine = *p;
    mine.spend = false; /* two hierarchies have the levels that are whole */
    mine.mesh = &share->mesh;
    DMK_TRY(dmk_share_levels(p->ctx, share, parts, &local));
    DMK_TRY(pack_fine(&mine));
    DMK_TRY(pack_levels(&mine, &local.hierarchy));
done:
    dmk_local_free(&local);
    return rc;
}

static int pack_whole(const packer *p, dmk_hierarchy *whole)
{
    int rc;
    dmk_share_destroy(&p->sys->share);
    DMK_TRY(pack_fine(p));
    DMK_TRY(pack_levels(p, whole));
done:
    return rc;
}

static int fill_share(const packer *p)
{
    const int rc = dmk_share_fill(p->ctx, p->sys->share, p->ground);
    if (rc == DMK_OK) set_counts(p->sys, &p->sys->share->mesh);
    return rc;
}

/* All ranks at the same step. */
static int pack_together(const packer *p, const dmk_system_dealt *dealt, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    if (!share) {
        if (p->ground->element) return DMK_OK;
        DMK_TRY(dmk_hierarchy_create(p->ctx, p->mesh, DMK_COARSEST, &parts->whole));
        return pack_whole(p, &parts->whole);
    }
    DMK_TRY(dmk_share_coarsen(p->ctx, share, p->ground, DMK_COARSEST, parts));
    if (parts->whole.n == 0) {
        if (!p->ground->element) return pack_whole(p, &parts->whole);
        dmk_share_destroy(&p->sys->share);
        return DMK_OK;
    }
    DMK_TRY(dmk_share_deal(p->ctx, share, p->ground, parts));
    DMK_TRY(dmk_share_connect(p->ctx, share));
    DMK_TRY(fill_share(p));
    DMK_TRY(dealt->call(p->ctx, dealt->user, p->sys));
    rc = pack_own(p, parts);
    dmk_share_forget(share);
done:
    return rc;
}

static int deal_own(const packer *p, dmk_parts *parts)
{
    int rc;
    DMK_TRY(dmk_share_deal(p->ctx, p->sys->share, p->ground, parts));
    DMK_TRY(fill_share(p));
    rc = pack_own(p, parts);
done:
    return rc;
}

/* The last rank's, before the others come. */
static int make_first(const packer *p, dmk_parts *parts)
{
    int rc;
    dmk_share *share = p->sys->share;
    DMK_TRY(dmk_hierarchy_create(p->ctx, p->mesh, DMK_COARSEST, &parts->whole));
    if (!share || parts->whole.n == 0) return DMK_OK;
    DMK_TRY(dmk_share_bound(p->ctx, share, &parts->whole));
    DMK_TRY(dmk_share_cut(p->ctx, share, parts));
    rc = deal_own(p, parts);
done:
    return rc;
}

/* The first rank comes later: the last one has coarsened the mesh and packed its own share by then, and after the
 * call it has time, while the others do. */
static int pack_handed(const packer *p, const dmk_system_dealt *dealt, dmk_parts *parts)
{
    int rc = DMK_OK;
    dmk_share *share = p->sys->share;
    const bool makes = !share || share->ranks.rank == share->ranks.size - 1;
    if (makes) DMK_TRY(make_first(p, parts));
    if (share) DMK_TRY(dmk_share_hand(p->ctx, share, parts));
    if (dealt->call) DMK_TRY(dealt->call(p->ctx, dealt->user, p->sys));
    if (!share || parts->whole.n == 0) return pack_whole(p, &parts->whole);
    if (!makes) DMK_TRY(deal_own(p, parts));
    DMK_TRY(dmk_share_connect(p->ctx, share));
    dmk_share_forget(share);
done:
    return rc;
}

static int pack_share(const packer *p, const dmk_ranks *ranks, const dmk_system_dealt *dealt)
{
    int rc;
    dmk_parts *parts = NULL;
    if (p->sys->of_needles) { /* each rank has all of it: without T there are no shares */
        rc = pack_all(p);
        return rc == DMK_OK && dealt->handed && dealt->call
                   ? dealt->call(p->ctx, dealt->user, p->sys)
                   : rc;
    }
    DMK_TRY(DMK_NEW(p->ctx, parts, 1));
    DMK_TRY(dmk_share_begin(p->ctx, ranks, p->dev, p->ground, &p->sys->share));
    rc = dealt->handed ? pack_handed(p, dealt, parts) : pack_together(p, dealt, parts);
done:
    if (parts) dmk_parts_free(parts);
    free(parts);
    return rc;
}

dmk_counts dmk_system_counts(const dmk_device *device, const dmk_mesh *mesh)
{
    int32_t part = (int32_t)dmk_launch_part(device);
    dmk_counts c = {
        .n_elements = mesh->n_triangles, .n_edges = mesh->n_edges, .n_vertices = mesh->n_vertices};
    c.n_elements_pad = dmk_padded(mesh->n_triangles);
    c.vertex_row = (mesh->n_edges / part + 1) * part; /* a padding row: filler edges read it */
    c.n_rows = c.vertex_row + mesh->n_vertices;
    c.n_rows_pad = dmk_padded(c.n_rows);
    return c;
}

static dmk_counts count_whole(const dmk_device *device, const dmk_ranks *ranks, const dmk_ground *g)
{
    if (!g->element) return dmk_system_counts(device, g->mesh);
    const dmk_mesh whole = {.n_triangles = (int32_t)g->bound[0][ranks->size],
                            .n_edges = (int32_t)g->bound[1][ranks->size],
                            .n_vertices = (int32_t)g->bound[2][ranks->size]};
    return dmk_system_counts(device, &whole);
}

int dmk_system_create(dmk_context *ctx, dmk_device *device, const dmk_mesh *mesh,
                      dmk_system **system)
{
    const dmk_ground ground = {.mesh = mesh};
    return dmk_system_deal(ctx, device, &ground, NULL, NULL, system);
}

int dmk_system_deal(dmk_context *ctx, dmk_device *device, const dmk_ground *given,
                    const dmk_ranks *ranks, const dmk_system_dealt *dealt, dmk_system **system)
{
    int rc;
    dmk_system *s = NULL;
    dmk_ground ground = *given;
    const dmk_mesh *mesh = ground.mesh;
    for (int32_t t = 0; t < mesh->n_triangles && !ground.element; t++) ground.area += mesh->area[t];
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->device = device;
    s->unit = sqrt(ground.area);
    s->whole = count_whole(device, ranks, &ground);
    DMK_TRY(look_at_angles(ctx, ranks, &ground, s));
    s->fine_degree = s->usual_degree;
    s->newton_degree = 2;
    set_counts(s, mesh);
    packer p = {ctx, device, mesh, &ground, s, true};
    if (dealt)
        DMK_TRY(pack_share(&p, ranks, dealt));
    else
        DMK_TRY(pack_all(&p));
    if (ground.element && !s->share) goto done;
    DMK_TRY(dmk_kernels_create(ctx, device, &s->kernels)); /* they may have been built meanwhile */
    *system = s;
    s = NULL;
done:
    dmk_system_destroy(&s);
    return rc;
}

/* ---- whole vectors --------------------------------------------------------------------------- */

static int write_whole(dmk_context *ctx, dmk_system *s, bool rows, dmk_buffer *b,
                       const double *whole)
{
    int rc;
    double *local = NULL;
    size_t n = (size_t)(rows ? s->n_rows_pad : s->n_elements_pad);
    if (!s->share) return dmk_buffer_write_real(ctx, s->device, DMK_OUTER, b, n, whole);
    DMK_TRY(DMK_NEW(ctx, local, n));
    dmk_share_take(s->share, rows, s->whole.vertex_row, whole, local);
    DMK_TRY(dmk_buffer_write_real(ctx, s->device, DMK_OUTER, b, n, local));
done:
    free(local);
    return rc;
}

static int read_whole(dmk_context *ctx, dmk_system *s, bool rows, const dmk_buffer *b,
                      double *whole)
{
    int rc;
    double *local = NULL;
    size_t n = (size_t)(rows ? s->n_rows_pad : s->n_elements_pad);
    if (!s->share) return dmk_buffer_read_real(ctx, s->device, DMK_OUTER, b, n, whole);
    DMK_TRY(DMK_NEW(ctx, local, n));
    DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, b, n, local));
    DMK_TRY(dmk_share_give(ctx, s->share, rows, s->whole.vertex_row, local, whole));
done:
    free(local);
    return rc;
}

int dmk_rows_write(dmk_context *ctx, dmk_system *s, dmk_buffer *rows, const double *whole)
{
    return write_whole(ctx, s, true, rows, whole);
}

int dmk_rows_read(dmk_context *ctx, dmk_system *s, const dmk_buffer *rows, double *whole)
{
    return read_whole(ctx, s, true, rows, whole);
}

int dmk_elements_write(dmk_context *ctx, dmk_system *s, dmk_buffer *elements, const double *whole)
{
    return write_whole(ctx, s, false, elements, whole);
}

int dmk_elements_fill(dmk_context *ctx, dmk_system *s, dmk_buffer *elements, double value)
{
    int rc;
    double *local = NULL;
    const size_t n = (size_t)s->n_elements;
    if (!s->share) return dmk_buffer_fill_real(ctx, s->device, DMK_OUTER, elements, n, value);
    DMK_TRY(DMK_NEW(ctx, local, n));
    for (size_t t = 0; t < n; t++)
        local[t] = dmk_space_whole(&s->share->element, (int32_t)t) >= 0 ? value : 0;
    DMK_TRY(dmk_buffer_write_real(ctx, s->device, DMK_OUTER, elements, n, local));
done:
    free(local);
    return rc;
}

int dmk_system_start_even(dmk_context *ctx, dmk_system *s)
{
    int rc;
    DMK_TRY(dmk_system_allocate_state(ctx, s));
    DMK_TRY(dmk_buffer_fill_real(ctx, s->device, DMK_OUTER, s->u, (size_t)s->n_rows_pad, 0));
    /* The padding, too: what an iteration that ended in no numbers has left there would end this one. */
    DMK_TRY(dmk_buffer_fill_real(ctx, s->device, DMK_OUTER, s->mu, (size_t)s->n_elements_pad, 0));
    rc = dmk_elements_fill(ctx, s, s->mu, 1);
done:
    return rc;
}

int dmk_elements_read(dmk_context *ctx, dmk_system *s, const dmk_buffer *elements, double *whole)
{
    return read_whole(ctx, s, false, elements, whole);
}

static void free_level(dmk_level *l)
{
    dmk_buffer **all[TAIL_ARRAYS];
    list_tail(l, all);
    for (int i = 0; i < TAIL_ARRAYS; i++) dmk_buffer_destroy(all[i]);
}

void dmk_system_destroy(dmk_system **system)
{
    dmk_system *s = *system;
    if (!s) return;
    dmk_buffer **all[] = {&s->index,      &s->cot,        &s->area,           &s->slice,
                          &s->slot,       &s->ends,       &s->coarse_inverse, &s->dense,
                          &s->tail_arena, &s->tail_table, &s->share_slot};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) dmk_buffer_destroy(all[i]);
    dmk_system_release(s);
    for (int32_t i = 0; i < DMK_SYSTEM_LEVELS; i++) free_level(&s->level[i]);
    free(s->coarse_edge_vertex);
    dmk_kernels_destroy(&s->kernels);
    dmk_share_destroy(&s->share);
    free(s);
    *system = NULL;
}
