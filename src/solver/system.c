#include "solver/system.h"

#include "solver/kernels.h"
#include "solver/sell.h"

#include <stdlib.h>
#include <string.h>

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

void dmk_level_arrays(dmk_level *l, dmk_buffer **list[DMK_LEVEL_ARRAYS])
{
    dmk_buffer **all[DMK_LEVEL_ARRAYS] = {&l->slice,
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

static int work(dmk_context *ctx, const dmk_system *s, dmk_program program, size_t n,
                dmk_buffer **b)
{
    return dmk_buffer_create_real(ctx, s->device, program, n, b);
}

/* Inner and outer solves take turns, so the inner vectors lie in the outer ones' memory; and the elements'
 * shares of T's operator, which the refresh alone reads, in that of CG's p and ap, which it begins with
 * writing. */
static int allocate_cg(dmk_context *ctx, dmk_system *s)
{
    int rc;
    size_t n = (size_t)s->n_rows_pad;
    bool wide = dmk_device_real(s->device, DMK_OUTER) == sizeof(double);
    const size_t vector = n * dmk_device_real(s->device, DMK_OUTER);
    const size_t shares = 3 * (size_t)s->n_elements_pad * sizeof(float);
    const size_t shared = vector > shares ? vector : shares;
    DMK_TRY(work(ctx, s, DMK_OUTER, n, &s->cg[DMK_OUTER].r));
    DMK_TRY(dmk_buffer_create(ctx, s->device, shared, NULL, &s->cg[DMK_OUTER].p));
    DMK_TRY(dmk_buffer_create(ctx, s->device, shared, NULL, &s->cg[DMK_OUTER].ap));
    s->edge = s->cg[DMK_OUTER].p;
    s->diag_coarse = s->cg[DMK_OUTER].ap;
    if (wide)
        DMK_TRY(work(ctx, s, DMK_INNER, n, &s->cg[DMK_OUTER].narrow));
    else
        s->cg[DMK_OUTER].narrow = s->cg[DMK_OUTER].r;
    s->cg[DMK_INNER] = s->cg[DMK_OUTER];
    s->cg[DMK_INNER].r = s->cg[DMK_INNER].narrow;
    s->w = s->cg[DMK_OUTER].r; /* the inner solution, while the outer residual is not needed */
    if (!wide) DMK_TRY(work(ctx, s, DMK_INNER, n, &s->w));
done:
    return rc;
}

static int allocate_work(dmk_context *ctx, dmk_system *s)
{
    int rc;
    size_t e = (size_t)s->n_elements_pad, n = (size_t)s->n_rows_pad;
    size_t parts = dmk_launch_parts(s->device, n > e ? n : e), all = dmk_share_most_parts(s->share);
    if (all > parts) parts = all;
    DMK_TRY(work(ctx, s, DMK_OUTER, e, &s->q));
    DMK_TRY(work(ctx, s, DMK_OUTER, 6 * e, &s->out_real));
    DMK_TRY(work(ctx, s, DMK_INNER, 3 * e, &s->weight));
    const size_t load = (size_t)s->level[0].n_pad * dmk_device_real(s->device, DMK_OUTER),
                 rank_one = 6 * e * sizeof(float);
    DMK_TRY(
        dmk_buffer_create(ctx, s->device, load > rank_one ? load : rank_one, NULL, &s->rank_one));
    s->load = s->rank_one;        /* Newton's steps on T have no use for that */
    s->weight_real = s->rank_one; /* A's operator in double, Newton's in single: in turn */
    if (s->without_T) {           /* at once, for Newton's is in both */
        DMK_TRY(work(ctx, s, DMK_OUTER, 6 * e, &s->rank_one_real));
        DMK_TRY(work(ctx, s, DMK_OUTER, 3 * e, &s->weight_wide));
        s->weight_real = s->weight_wide;
    }
    s->out =
        s->out_real; /* what one program puts there is summed up before the other puts anything */
    DMK_TRY(work(ctx, s, DMK_INNER, n, &s->inv_diag));
    DMK_TRY(work(ctx, s, DMK_INNER, n, &s->x));
    DMK_TRY(work(ctx, s, DMK_INNER, n, &s->x_old));
    DMK_TRY(allocate_cg(ctx, s));
    if (s->without_T) {
        s->level[0].rhs = s->cg[DMK_OUTER].narrow;
        s->level[0].x = s->x;
        s->level[0].x_old = s->x_old;
    }
    DMK_TRY(work(ctx, s, DMK_OUTER, DMK_MOST_SUMS * parts, &s->partial));
    DMK_TRY(work(ctx, s, DMK_OUTER, 8, &s->state));
    DMK_TRY(work(ctx, s, DMK_INNER, 1, &s->done));
    DMK_TRY(work(ctx, s, DMK_OUTER, 16, &s->scalars));
done:
    return rc;
}

int dmk_system_allocate_state(dmk_context *ctx, dmk_system *s)
{
    int rc = DMK_OK;
    if (s->f) return DMK_OK; /* the last one made */
    DMK_TRY(work(ctx, s, DMK_OUTER, (size_t)s->n_elements_pad, &s->mu));
    DMK_TRY(work(ctx, s, DMK_OUTER, (size_t)s->n_rows_pad, &s->u));
    DMK_TRY(work(ctx, s, DMK_OUTER, (size_t)s->n_rows_pad, &s->f));
done:
    if (rc != DMK_OK) dmk_system_release(s);
    return rc;
}

int dmk_system_allocate(dmk_context *ctx, dmk_system *s)
{
    if (s->scalars) return DMK_OK; /* the last one made */
    int rc = dmk_system_allocate_state(ctx, s);
    if (rc == DMK_OK) rc = allocate_work(ctx, s);
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
    dmk_buffer **all[DMK_LEVEL_ARRAYS];
    dmk_level_arrays(l, all);
    for (int i = 0; i < DMK_LEVEL_ARRAYS; i++) dmk_buffer_destroy(all[i]);
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
