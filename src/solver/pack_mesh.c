/* The mesh's elements and rows as the kernels read them: see packer.h and kernels/operator.cl. */
#include "solver/packer.h"
#include "solver/sell.h"

#include "base/parallel.h"

#include "dmk_shared.h"

#include <stdlib.h>
#include <string.h>

static int upload_real(const packer *p, size_t n, const double *data, dmk_buffer **b)
{
    const int rc = dmk_pack_work(p, DMK_OUTER, n, b);
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
    DMK_TRY(dmk_pack(p, 6 * n, sizeof *job.index, job.index, &s->index));
    DMK_TRY(upload_real(p, 3 * n, job.cot, &s->cot));
    DMK_TRY(upload_real(p, n, job.area, &s->area));
done:
    free(job.index);
    free(job.cot);
    free(job.area);
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
 * Edges and vertices of T find theirs among 3 numbers per element by these slots: CORNER_PLACE in multigrid.cl. */
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
    DMK_TRY(dmk_pack(p, n_slices + 1, sizeof *slice, slice, &s->slice));
    DMK_TRY(dmk_pack(p, edges + n_slots + ahead, sizeof *slot, slot, &s->slot));
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
    DMK_TRY(dmk_pack(p, 2 * (size_t)s->n_rows_pad, sizeof *ends, ends, &s->ends));
done:
    free(ends);
    return rc;
}

int dmk_pack_mesh(const packer *p)
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
