#include "solver/kernels.h"

#include <stdlib.h>

enum { IN_INNER = 1 << DMK_INNER, IN_OUTER = 1 << DMK_OUTER, IN_BOTH = IN_INNER | IN_OUTER };

/* X(name, the programs it is used from). */
#define KERNEL_LIST(X)                                                                             \
    X(element_stiffness, IN_BOTH)                                                                  \
    X(element_newton, IN_BOTH)                                                                     \
    X(rows_apply, IN_OUTER)                                                                        \
    X(rows_chebyshev, IN_INNER)                                                                    \
    X(cg_dots, IN_OUTER)                                                                           \
    X(cg_beta, IN_OUTER)                                                                           \
    X(cg_direction, IN_OUTER)                                                                      \
    X(cg_alpha, IN_OUTER)                                                                          \
    X(cg_step, IN_OUTER)                                                                           \
    X(inner_apply, IN_INNER)                                                                       \
    X(inner_scalars, IN_INNER)                                                                     \
    X(inner_step, IN_INNER)                                                                        \
    X(dot_real, IN_OUTER)                                                                          \
    X(rows_range, IN_OUTER)                                                                        \
    X(sum_partials, IN_OUTER)                                                                      \
    X(inner_finish, IN_OUTER)                                                                      \
    X(smooth_first, IN_INNER)                                                                      \
    X(element_down, IN_INNER)                                                                      \
    X(element_up, IN_INNER)                                                                        \
    X(rows_up, IN_INNER)                                                                           \
    X(graph_chebyshev, IN_INNER)                                                                   \
    X(restrict_midpoints, IN_INNER)                                                                \
    X(restrict_rows, IN_INNER)                                                                     \
    X(prolong_rows, IN_INNER)                                                                      \
    X(prolong_chebyshev, IN_INNER)                                                                 \
    X(coarse_solve, IN_INNER)                                                                      \
    X(coarse_inverse, IN_INNER)                                                                    \
    X(edges_from_triangles, IN_INNER)                                                              \
    X(fine_elements, IN_INNER)                                                                     \
    X(fine_edges, IN_INNER)                                                                        \
    X(graph_refresh, IN_INNER)                                                                     \
    X(mesh_refresh, IN_INNER)                                                                      \
    X(inverse_diagonal, IN_INNER)                                                                  \
    X(tail_cycle, IN_INNER)                                                                        \
    X(tail_refresh, IN_INNER)                                                                      \
    X(element_energy, IN_OUTER)                                                                    \
    X(element_prepare, IN_OUTER)                                                                   \
    X(element_scale, IN_OUTER)                                                                     \
    X(newton_prepare, IN_OUTER)                                                                    \
    X(newton_prepare_wide, IN_OUTER)                                                               \
    X(newton_update_wide, IN_OUTER)                                                                \
    X(rows_scale, IN_OUTER)                                                                        \
    X(newton_diagonal, IN_OUTER)                                                                   \
    X(newton_update, IN_OUTER)                                                                     \
    X(nested_load, IN_OUTER)                                                                       \
    X(nested_energy, IN_OUTER)                                                                     \
    X(nested_prepare, IN_OUTER)                                                                    \
    X(nested_rhs, IN_OUTER)                                                                        \
    X(nested_update, IN_OUTER)                                                                     \
    X(nested_refine, IN_OUTER)                                                                     \
    X(nested_apply, IN_INNER)                                                                      \
    X(explicit_update, IN_OUTER)                                                                   \
    X(rows_rhs, IN_OUTER)                                                                          \
    X(newton_rows, IN_OUTER)                                                                       \
    X(rows_outer_residual, IN_OUTER)                                                               \
    X(band_slopes, IN_OUTER)                                                                       \
    X(band_map, IN_OUTER)                                                                          \
    X(repair_start, IN_OUTER)                                                                      \
    X(repair_mark, IN_OUTER)                                                                       \
    X(repair_grow, IN_OUTER)                                                                       \
    X(repair_list_elements, IN_OUTER)                                                              \
    X(repair_list_rows, IN_OUTER)                                                                  \
    X(repair_elements, IN_OUTER)                                                                   \
    X(repair_rows, IN_OUTER)

#define KERNEL_NUMBER(name, programs) K_##name,
#define KERNEL_ENTRY(name, programs) {#name, programs},

enum { KERNEL_LIST(KERNEL_NUMBER) N_KERNELS };

struct dmk_kernels {
    dmk_kernel *of[DMK_N_PROGRAMS][N_KERNELS];
};

int dmk_kernels_create(dmk_context *ctx, dmk_device *device, struct dmk_kernels **kernels)
{
    static const struct {
        const char *name;
        int programs;
    } list[] = {KERNEL_LIST(KERNEL_ENTRY)};
    int rc;
    struct dmk_kernels *k = NULL;
    DMK_TRY(DMK_NEW(ctx, k, 1));
    for (int i = 0; i < N_KERNELS; i++) {
        for (int p = 0; p < DMK_N_PROGRAMS; p++) {
            if (!(list[i].programs >> p & 1)) continue;
            DMK_TRY(dmk_kernel_get(ctx, device, (dmk_program)p, list[i].name, &k->of[p][i]));
        }
    }
    *kernels = k;
    k = NULL;
done:
    free(k);
    return rc;
}

void dmk_kernels_destroy(struct dmk_kernels **kernels)
{
    free(*kernels);
    *kernels = NULL;
}

/* With a share of the mesh (ranks/), what a launch gathers from other items than its own is asked
 * for before it, and partial sums become those of all ranks before they are added. */

/* Over `range`: kernel `name` of `program` with these arguments. */
#define RUN(program, name, range, ...)                                                             \
    DMK_LAUNCH(ctx, s->device, s->kernels->of[program][K_##name], (range), __VA_ARGS__)

/* The rows: midpoints, then vertices, which follow the mesh each by itself. */
static dmk_range rows(const dmk_system *s)
{
    return (dmk_range){.items = (size_t)s->n_rows, .first = (size_t)s->vertex_row};
}

static dmk_range items(int32_t n)
{
    return (dmk_range){.items = (size_t)n};
}

static dmk_range elements(const dmk_system *s)
{
    return items(s->n_elements);
}

/* T's vertices, and the first slice of theirs among the rows. */
static dmk_range vertices(const dmk_system *s)
{
    return items(s->level[0].n);
}

static int32_t first_slice(const dmk_system *s)
{
    return s->vertex_row / DMK_WIDTH;
}

/* With the padding, where what short rows read of its elements must be 0, and their memory had another
 * use before. */
static dmk_range padded_elements(const dmk_system *s)
{
    return items(s->n_elements_pad);
}

/* Sums that a kernel leaves, over the rows or the elements: where to, or nowhere yet (-1). */
static int32_t slot_of_sums(const dmk_system *s, int at)
{
    return s->share ? -1 : at;
}
#define SUMS(at, to)                                                                               \
    DMK_BUF(s->partial), DMK_INT(slot_of_sums(s, at)), DMK_BUF(to), DMK_BUF(s->done)

/* With a share: the partial sums of all ranks; *parts: their number. */
static int all_parts(dmk_context *ctx, dmk_system *s, dmk_items over, int count, int maxima,
                     int32_t *parts)
{
    const int32_t n = over == DMK_ROWS       ? s->n_rows
                      : over == DMK_VERTICES ? s->level[0].n
                                             : s->n_elements;
    *parts = (int32_t)dmk_launch_parts(s->device, (size_t)n);
    return dmk_share_parts(ctx, s->share, over, count, maxima, s->partial, parts);
}

/* What a kernel leaves in partial: without a share it has added it up itself. */
static int finish_sums(dmk_context *ctx, dmk_system *s, dmk_items over, int count, int maxima,
                       int at)
{
    int rc;
    int32_t parts;
    if (!s->share) return DMK_OK;
    DMK_TRY(all_parts(ctx, s, over, count, maxima, &parts));
    rc = RUN(DMK_OUTER, sum_partials, items(1), DMK_INT(parts), DMK_INT(count), DMK_INT(maxima),
             DMK_BUF(s->partial), DMK_BUF(s->scalars), DMK_INT(at));
done:
    return rc;
}

/* Parts of a launch that go ahead while ghosts are on their way; none where n is 0. */
static dmk_range ahead(const dmk_split *split, dmk_range all)
{
    all.parts = split ? split->interior : NULL;
    all.n_parts = split ? split->n_interior : 0;
    return all;
}

/* And the others, which are all of them without such. */
static dmk_range behind(const dmk_split *split, dmk_range all)
{
    if (!split || split->n_interior == 0) return all;
    all.parts = split->boundary;
    all.n_parts = split->n_boundary;
    return all;
}

static const dmk_split *split_elements(const dmk_system *s)
{
    return s->share && s->share->ranks.begin ? &s->share->elements : NULL;
}

static const dmk_split *split_level(const dmk_system *s, int32_t level)
{
    return s->share && s->share->ranks.begin && level < s->share->first_whole
               ? &s->share->graph[level]
               : NULL;
}

/* RUN over `range` once the ghosts of a shipment have come; a split's interior while they are under way. */
#define RUN_WITH(shipment, split, program, name, range, ...)                                       \
    do {                                                                                           \
        const dmk_shipment ghosts = (shipment);                                                    \
        const dmk_split *parts = (split);                                                          \
        const dmk_range early = ahead(parts, range), late = behind(parts, range);                  \
        DMK_TRY(dmk_send_begin(ctx, ghosts));                                                      \
        if (early.n_parts > 0) DMK_TRY(RUN(program, name, early, __VA_ARGS__));                    \
        DMK_TRY(dmk_send_end(ctx, ghosts, early.n_parts > 0));                                     \
        if (!late.parts || late.n_parts > 0) DMK_TRY(RUN(program, name, late, __VA_ARGS__));       \
    } while (0)

/* ---- operator.cl ----------------------------------------------------------------------------- */

/* The elements' parts in the program's precision. */
static dmk_buffer *out_of(const dmk_system *s, dmk_program p)
{
    return p == DMK_INNER ? s->out : s->out_real;
}

int dmk_element_stiffness(dmk_context *ctx, dmk_system *s, dmk_program p, const dmk_buffer *x)
{
    int rc;
    const dmk_buffer *weight = p == DMK_INNER ? s->weight : s->weight_real;
    RUN_WITH(dmk_ship_rows(s->share, p, x), split_elements(s), p, element_stiffness,
             padded_elements(s), DMK_INT(s->n_elements_pad), DMK_BUF(s->index), DMK_BUF(weight),
             DMK_BUF(x), DMK_BUF(out_of(s, p)));
done:
    return rc;
}

int dmk_element_newton(dmk_context *ctx, dmk_system *s, dmk_program p, const dmk_buffer *x)
{
    int rc;
    const bool inner = p == DMK_INNER;
    RUN_WITH(dmk_ship_rows(s->share, p, x), split_elements(s), p, element_newton,
             padded_elements(s), DMK_INT(s->n_elements_pad), DMK_BUF(s->index),
             DMK_BUF(inner ? s->weight : s->weight_real),
             DMK_BUF(inner ? s->rank_one : s->rank_one_real), DMK_BUF(x), DMK_BUF(out_of(s, p)));
done:
    return rc;
}

int dmk_rows_apply(dmk_context *ctx, dmk_system *s, const dmk_buffer *x, dmk_buffer *y)
{
    int rc;
    int32_t parts;
    DMK_TRY(RUN(DMK_OUTER, rows_apply, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->slice),
                DMK_BUF(s->slot), DMK_BUF(s->out_real), DMK_BUF(x), DMK_BUF(y), SUMS(1, s->state)));
    if (!s->share) return DMK_OK;
    DMK_TRY(all_parts(ctx, s, DMK_ROWS, 1, 0, &parts));
    rc = RUN(DMK_OUTER, cg_alpha, items(1), DMK_INT(parts), DMK_BUF(s->partial), DMK_BUF(s->state));
done:
    return rc;
}

int dmk_rows_chebyshev(dmk_context *ctx, dmk_system *s, const dmk_buffer *rhs, const dmk_buffer *x,
                       dmk_buffer *x_old, dmk_chebyshev_step c)
{
    return RUN(DMK_INNER, rows_chebyshev, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->slice),
               DMK_BUF(s->slot), DMK_BUF(s->out), DMK_BUF(rhs), DMK_BUF(s->inv_diag), DMK_BUF(x),
               DMK_BUF(x_old), DMK_FLOAT(c.momentum), DMK_FLOAT(c.keep), DMK_FLOAT(c.step));
}

/* ---- vector.cl ------------------------------------------------------------------------------- */

int dmk_cg_dots(dmk_context *ctx, dmk_system *s, bool first, const dmk_buffer *z)
{
    int rc;
    int32_t parts;
    DMK_TRY(RUN(DMK_OUTER, cg_dots, rows(s), DMK_INT(s->n_rows), DMK_INT(first),
                DMK_BUF(s->cg[DMK_OUTER].r), DMK_BUF(s->cg[DMK_OUTER].ap), DMK_BUF(z),
                SUMS(1, s->state)));
    if (!s->share) return DMK_OK;
    DMK_TRY(all_parts(ctx, s, DMK_ROWS, 2, 0, &parts));
    rc = RUN(DMK_OUTER, cg_beta, items(1), DMK_INT(parts), DMK_INT(first), DMK_BUF(s->partial),
             DMK_BUF(s->state));
done:
    return rc;
}

int dmk_cg_direction(dmk_context *ctx, dmk_system *s, const dmk_buffer *z)
{
    return RUN(DMK_OUTER, cg_direction, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->state), DMK_BUF(z),
               DMK_BUF(s->cg[DMK_OUTER].p));
}

int dmk_cg_step(dmk_context *ctx, dmk_system *s, dmk_buffer *x, double step, bool last)
{
    return RUN(DMK_OUTER, cg_step, rows(s), DMK_INT(s->n_rows), DMK_INT(last), DMK_BUF(s->state),
               DMK_BUF(s->cg[DMK_OUTER].p), DMK_BUF(s->cg[DMK_OUTER].ap), DMK_BUF(x),
               DMK_BUF(s->cg[DMK_OUTER].r), DMK_BUF(s->cg[DMK_OUTER].narrow), DMK_FLOAT(step),
               DMK_BUF(s->inv_diag), DMK_BUF(s->x));
}

/* What the inner solve is of, on T/2 or on T. */
typedef struct unknowns {
    int32_t n;
    dmk_buffer *r, *z, *x, *inv_diag;
} unknowns;

static unknowns unknowns_of(const dmk_system *s, dmk_items over)
{
    const dmk_level *t = &s->level[0];
    return over == DMK_ROWS ? (unknowns){s->n_rows, s->cg[DMK_INNER].r, s->x_old, s->x, s->inv_diag}
                            : (unknowns){t->n, t->rhs, t->x_old, t->x, t->inv_diag};
}

int dmk_inner_apply(dmk_context *ctx, dmk_system *s, dmk_items over, bool first)
{
    int rc;
    int32_t parts;
    const dmk_level *t = &s->level[0];
    const unknowns v = unknowns_of(s, over);
    if (over == DMK_ROWS) {
        DMK_TRY(RUN(DMK_INNER, inner_apply, items(v.n), DMK_INT(v.n), DMK_INT(first),
                    DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out), DMK_BUF(v.r),
                    DMK_BUF(s->cg[DMK_INNER].ap), DMK_BUF(v.z), DMK_BUF(v.x), SUMS(1, s->state)));
    } else {
        DMK_TRY(dmk_send(ctx, dmk_ship_vertices(s->share, 0, v.z)));
        DMK_TRY(RUN(DMK_INNER, nested_apply, items(v.n), DMK_INT(v.n), DMK_INT(first),
                    DMK_BUF(t->slice), DMK_BUF(t->neighbour), DMK_BUF(t->weight), DMK_BUF(v.r),
                    DMK_BUF(s->cg[DMK_INNER].ap), DMK_BUF(v.z), DMK_BUF(v.x), SUMS(1, s->state)));
    }
    if (!s->share) return DMK_OK;
    DMK_TRY(all_parts(ctx, s, over, 3, 0, &parts));
    rc = RUN(DMK_INNER, inner_scalars, items(1), DMK_INT(parts), DMK_INT(first),
             DMK_BUF(s->partial), DMK_BUF(s->state));
done:
    return rc;
}

int dmk_inner_step(dmk_context *ctx, dmk_system *s, dmk_items over, bool first, double step)
{
    const unknowns v = unknowns_of(s, over);
    return RUN(DMK_INNER, inner_step, items(v.n), DMK_INT(v.n), DMK_INT(first), DMK_FLOAT(step),
               DMK_BUF(s->state), DMK_BUF(v.z), DMK_BUF(v.inv_diag), DMK_BUF(s->cg[DMK_INNER].p),
               DMK_BUF(s->cg[DMK_INNER].ap), DMK_BUF(s->w), DMK_BUF(v.r), DMK_BUF(v.x));
}

int dmk_inner_finish(dmk_context *ctx, dmk_system *s, dmk_items over, bool first, double scale,
                     int at)
{
    int rc;
    const unknowns v = unknowns_of(s, over);
    const bool on_rows = over == DMK_ROWS;
    DMK_TRY(RUN(DMK_OUTER, inner_finish, items(v.n), DMK_INT(v.n),
                DMK_INT(on_rows ? 0 : s->vertex_row), DMK_INT(first), DMK_FLOAT(scale),
                DMK_BUF(s->state), DMK_BUF(v.z), DMK_BUF(s->cg[DMK_INNER].p), DMK_BUF(s->w),
                DMK_BUF(s->u), DMK_BUF(on_rows ? s->f : s->load), SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, over, 1, 0, at);
done:
    return rc;
}

int dmk_dot(dmk_context *ctx, dmk_system *s, const dmk_buffer *a, const dmk_buffer *b, int at)
{
    int rc;
    DMK_TRY(RUN(DMK_OUTER, dot_real, rows(s), DMK_INT(s->n_rows), DMK_BUF(a), DMK_BUF(b),
                SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ROWS, 1, 0, at);
done:
    return rc;
}

int dmk_rows_range(dmk_context *ctx, dmk_system *s, const dmk_buffer *u, int at)
{
    int rc;
    DMK_TRY(
        RUN(DMK_OUTER, rows_range, rows(s), DMK_INT(s->n_rows), DMK_BUF(u), SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ROWS, 2, 2, at);
done:
    return rc;
}

/* ---- multigrid.cl ---------------------------------------------------------------------------- */

int dmk_smooth_first(dmk_context *ctx, dmk_system *s, const dmk_buffer *rhs, double step)
{
    return RUN(DMK_INNER, smooth_first, rows(s), DMK_INT(s->n_rows), DMK_FLOAT(step),
               DMK_BUF(s->inv_diag), DMK_BUF(rhs), DMK_BUF(s->x));
}

int dmk_element_down(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *x)
{
    int rc;
    RUN_WITH(dmk_ship_rows(s->share, DMK_INNER, x), split_elements(s), DMK_INNER, element_down,
             padded_elements(s), DMK_INT(s->n_elements_pad), DMK_INT(op == DMK_NEWTON_MATRIX),
             DMK_BUF(s->index), DMK_BUF(s->weight), DMK_BUF(s->rank_one), DMK_BUF(x),
             DMK_BUF(s->out));
done:
    return rc;
}

int dmk_element_up(dmk_context *ctx, dmk_system *s, dmk_operator op, const dmk_buffer *x)
{
    int rc;
    const dmk_buffer *coarse = s->level[0].x_old;
    RUN_WITH(dmk_ship_up(s->share, x, coarse), split_elements(s), DMK_INNER, element_up,
             padded_elements(s), DMK_INT(s->n_elements_pad), DMK_INT(op == DMK_NEWTON_MATRIX),
             DMK_INT(s->vertex_row), DMK_BUF(s->index), DMK_BUF(s->weight), DMK_BUF(s->rank_one),
             DMK_BUF(x), DMK_BUF(coarse), DMK_BUF(s->out));
done:
    return rc;
}

int dmk_rows_up(dmk_context *ctx, dmk_system *s, const dmk_buffer *rhs, bool keep, dmk_buffer *x,
                dmk_buffer *x_old, double step)
{
    return RUN(DMK_INNER, rows_up, rows(s), DMK_INT(s->n_rows), DMK_INT(keep),
               DMK_INT(s->vertex_row), DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out),
               DMK_BUF(rhs), DMK_BUF(s->inv_diag), DMK_BUF(s->ends), DMK_BUF(s->level[0].x_old),
               DMK_BUF(x), DMK_BUF(x_old), DMK_FLOAT(step));
}

int dmk_graph_chebyshev(dmk_context *ctx, dmk_system *s, int32_t level, const dmk_buffer *x,
                        dmk_buffer *x_old, dmk_chebyshev_step c)
{
    int rc;
    dmk_level *l = &s->level[level];
    RUN_WITH(dmk_ship_vertices(s->share, level, x), split_level(s, level), DMK_INNER,
             graph_chebyshev, items(l->n), DMK_INT(l->n), DMK_BUF(l->slice), DMK_BUF(l->neighbour),
             DMK_BUF(l->weight), DMK_BUF(l->rhs), DMK_BUF(l->inv_diag), DMK_BUF(x), DMK_BUF(x_old),
             DMK_FLOAT(c.momentum), DMK_FLOAT(c.keep), DMK_FLOAT(c.step));
done:
    return rc;
}

int dmk_restrict_rows(dmk_context *ctx, dmk_system *s, const dmk_buffer *rhs)
{
    int rc;
    dmk_level *l = &s->level[0];
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_INNER, rhs)));
    rc = RUN(DMK_INNER, restrict_midpoints, vertices(s), DMK_INT(l->n), DMK_INT(s->vertex_row),
             DMK_BUF(l->slice), DMK_BUF(l->number), DMK_BUF(rhs), DMK_INT(first_slice(s)),
             DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out), DMK_BUF(l->rhs));
done:
    return rc;
}

int dmk_restrict(dmk_context *ctx, dmk_system *s, int32_t level)
{
    int rc;
    dmk_level *l = &s->level[level], *fine = l - 1;
    DMK_TRY(dmk_send(ctx, dmk_ship_vertices(s->share, level - 1, fine->rhs)));
    DMK_TRY(RUN(DMK_INNER, restrict_rows, items(l->n), DMK_INT(l->n), DMK_BUF(l->restrict_slice),
                DMK_BUF(l->restrict_entry), DMK_BUF(l->restrict_weight), DMK_BUF(fine->rhs),
                DMK_BUF(l->rhs)));
    DMK_TRY(dmk_send(ctx, dmk_ship_all(s->share, level, l->rhs)));
done:
    return rc;
}

/* On a GPU at once: a launch takes longer than the neighbours' prolongations, seven for one, for which a CPU needs four
 * times as long as for the step itself. */
int dmk_prolong_chebyshev(dmk_context *ctx, dmk_system *s, int32_t level, dmk_buffer *x,
                          dmk_buffer *next, double step)
{
    int rc;
    dmk_level *l = &s->level[level], *fine = l - 1;
    if (!s->share && !dmk_device_cpu_shape(s->device))
        return RUN(DMK_INNER, prolong_chebyshev, items(fine->n), DMK_INT(fine->n),
                   DMK_BUF(fine->slice), DMK_BUF(fine->neighbour), DMK_BUF(fine->weight),
                   DMK_BUF(l->prolong_index), DMK_BUF(l->prolong_weight), DMK_BUF(l->x_old),
                   DMK_BUF(fine->rhs), DMK_BUF(fine->inv_diag), DMK_BUF(x), DMK_BUF(next),
                   DMK_FLOAT(step));
    DMK_TRY(dmk_send(ctx, dmk_ship_vertices(s->share, level, l->x_old)));
    DMK_TRY(RUN(DMK_INNER, prolong_rows, items(fine->n), DMK_INT(fine->n),
                DMK_BUF(l->prolong_index), DMK_BUF(l->prolong_weight), DMK_BUF(l->x_old),
                DMK_BUF(x)));
    rc = dmk_graph_chebyshev(ctx, s, level - 1, x, next, (dmk_chebyshev_step){0, 1, step});
done:
    return rc;
}

int dmk_tail_cycle(dmk_context *ctx, dmk_system *s, const dmk_chebyshev_step step[DMK_TAIL_STEPS])
{
    int rc;
    float momentums[8] = {0}, steps[8] = {0};
    const dmk_level *above = &s->level[s->tail - 1];
    /* With ranks a level may be all of a mesh's and the one above a share of it. */
    const bool with_above = !s->share;
    if (!with_above) DMK_TRY(dmk_restrict(ctx, s, s->tail));
    for (int k = 0; k < DMK_TAIL_STEPS; k++) {
        momentums[k] = (float)step[k].momentum;
        steps[k] = (float)step[k].step;
    }
    rc = RUN(DMK_INNER, tail_cycle, items(1), DMK_INT(s->n_levels - s->tail), DMK_INT(with_above),
             DMK_BUF(s->tail_table), DMK_BUF(s->tail_arena), DMK_BUF(above->rhs),
             DMK_BUF(s->coarse_inverse), DMK_FLOAT8(momentums), DMK_FLOAT8(steps));
done:
    return rc;
}

int dmk_tail_refresh(dmk_context *ctx, dmk_system *s)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_edge_weights(s->share, s->tail, s->level[s->tail].edge)));
    rc = RUN(DMK_INNER, tail_refresh, items(1), DMK_INT(s->n_levels - s->tail),
             DMK_INT(s->dense != NULL), DMK_BUF(s->tail_table), DMK_BUF(s->tail_arena),
             DMK_BUF(s->dense ? s->dense : s->partial), DMK_BUF(s->coarse_inverse));
done:
    return rc;
}

int dmk_coarse_solve(dmk_context *ctx, dmk_system *s)
{
    dmk_level *l = &s->level[s->n_levels - 1];
    return RUN(DMK_INNER, coarse_solve, items(l->n_pad), DMK_INT(l->n), DMK_INT(l->n_pad),
               DMK_BUF(s->coarse_inverse), DMK_BUF(l->rhs), DMK_BUF(l->x_old));
}

int dmk_coarse_inverse(dmk_context *ctx, dmk_system *s)
{
    dmk_level *l = &s->level[s->n_levels - 1];
    return RUN(DMK_INNER, coarse_inverse, items(1), DMK_INT(l->n), DMK_INT(l->n_pad),
               DMK_BUF(l->slice), DMK_BUF(l->neighbour), DMK_BUF(l->weight), DMK_BUF(s->dense),
               DMK_BUF(s->coarse_inverse));
}

/* Its rows, and from a part of their own on the next level's edges. */
static dmk_range rows_and_edges(const dmk_system *s, const dmk_level *l, int32_t n_edges)
{
    const size_t first = dmk_launch_parts(s->device, (size_t)l->n) * dmk_launch_part(s->device);
    return n_edges > 0 ? (dmk_range){.items = first + (size_t)n_edges, .first = first}
                       : items(l->n);
}

/* The next level's edges, and tables for them; without one they are not read. */
#define EDGES_OF(next, n_edges)                                                                    \
    DMK_INT(n_edges), DMK_BUF((next)->galerkin_row), DMK_BUF((next)->galerkin_edge),               \
        DMK_BUF((next)->galerkin_coef), DMK_BUF((next)->edge)

int dmk_fine_edges(dmk_context *ctx, dmk_system *s, dmk_operator op)
{
    int rc;
    const dmk_buffer *edge = s->level[0].edge;
    DMK_TRY(RUN(DMK_INNER, fine_elements, padded_elements(s), DMK_INT(s->n_elements_pad),
                DMK_INT(op == DMK_NEWTON_MATRIX), DMK_BUF(s->weight), DMK_BUF(s->rank_one),
                DMK_INT(s->elements_at), DMK_BUF(edge), DMK_BUF(s->out)));
    rc = RUN(DMK_INNER, fine_edges, items(3 * s->n_edges), DMK_INT(3 * s->n_edges),
             DMK_BUF(s->share_slot), DMK_BUF(s->out), DMK_BUF(edge));
done:
    return rc;
}

int dmk_graph_refresh(dmk_context *ctx, dmk_system *s, int32_t level)
{
    int rc;
    const dmk_level *l = &s->level[level], *next = level + 1 < s->n_levels ? l + 1 : l;
    const int32_t n_edges = next != l ? next->n_edges : 0;
    const dmk_range range = rows_and_edges(s, l, n_edges);
    const bool of_mesh = level == 0 && !s->without_T;
    if (of_mesh)
        DMK_TRY(RUN(DMK_INNER, edges_from_triangles, items(l->n_edges), DMK_INT(l->n_edges),
                    DMK_BUF(s->slot), DMK_BUF(s->edge), DMK_BUF(l->edge)));
    DMK_TRY(dmk_send(ctx, dmk_ship_edge_weights(s->share, level, l->edge)));
    if (of_mesh)
        DMK_TRY(RUN(DMK_INNER, mesh_refresh, range, DMK_INT(l->n), DMK_BUF(l->slice),
                    DMK_BUF(l->number), DMK_BUF(l->edge), DMK_BUF(l->weight),
                    DMK_INT(first_slice(s)), DMK_BUF(s->slice), DMK_BUF(s->slot),
                    DMK_BUF(s->diag_coarse), DMK_BUF(l->inv_diag), EDGES_OF(next, n_edges)));
    else
        DMK_TRY(RUN(DMK_INNER, graph_refresh, range, DMK_INT(l->n), DMK_BUF(l->slice),
                    DMK_BUF(l->number), DMK_BUF(l->edge), DMK_BUF(l->weight), DMK_BUF(l->inv_diag),
                    EDGES_OF(next, n_edges)));
done:
    return rc;
}

int dmk_inverse_diagonal(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_INNER, inverse_diagonal, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->slice),
               DMK_BUF(s->slot), DMK_BUF(s->out), DMK_BUF(s->inv_diag));
}

/* ---- density.cl ------------------------------------------------------------------------------ */

int dmk_element_energy(dmk_context *ctx, dmk_system *s, const dmk_buffer *v, int keep, double slack,
                       int at)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_OUTER, v)));
    DMK_TRY(RUN(DMK_OUTER, element_energy, elements(s), DMK_INT(s->n_elements), DMK_INT(keep),
                DMK_FLOAT(slack), DMK_BUF(s->index), DMK_BUF(s->cot), DMK_BUF(s->area),
                DMK_BUF(s->mu), DMK_BUF(v), DMK_BUF(s->out_real), DMK_BUF(s->q),
                SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ELEMENTS, 5, 1, at);
done:
    return rc;
}

int dmk_element_scale(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, element_scale, elements(s), DMK_INT(s->n_elements), DMK_BUF(s->mu),
               DMK_BUF(s->out_real));
}

int dmk_element_prepare(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, element_prepare, padded_elements(s), DMK_INT(s->n_elements_pad),
               DMK_BUF(s->cot), DMK_BUF(s->mu), DMK_BUF(s->weight_real), DMK_BUF(s->weight),
               DMK_BUF(s->out), DMK_BUF(s->edge), DMK_BUF(s->diag_coarse));
}

int dmk_newton_prepare(dmk_context *ctx, dmk_system *s, bool paired, const dmk_newton_step *step)
{
    return RUN(DMK_OUTER, newton_prepare, padded_elements(s), DMK_INT(s->n_elements_pad),
               DMK_INT(paired), DMK_FLOAT(step->alpha), DMK_FLOAT(step->D), DMK_FLOAT(step->bend),
               DMK_BUF(s->cot), DMK_BUF(s->area), DMK_BUF(s->mu), DMK_BUF(s->q),
               DMK_BUF(s->out_real), DMK_BUF(s->weight), DMK_BUF(s->rank_one), DMK_BUF(s->edge),
               DMK_BUF(s->diag_coarse));
}

int dmk_newton_prepare_wide(dmk_context *ctx, dmk_system *s, const dmk_newton_step *step)
{
    return RUN(DMK_OUTER, newton_prepare_wide, padded_elements(s), DMK_INT(s->n_elements_pad),
               DMK_FLOAT(step->alpha), DMK_FLOAT(step->D), DMK_FLOAT(step->bend), DMK_BUF(s->cot),
               DMK_BUF(s->area), DMK_BUF(s->mu), DMK_BUF(s->q), DMK_BUF(s->out_real),
               DMK_BUF(s->weight), DMK_BUF(s->rank_one), DMK_BUF(s->weight_real),
               DMK_BUF(s->rank_one_real));
}

int dmk_rows_scale(dmk_context *ctx, dmk_system *s, double scale, dmk_buffer *x)
{
    return RUN(DMK_OUTER, rows_scale, rows(s), DMK_INT(s->n_rows), DMK_FLOAT(scale), DMK_BUF(x));
}

int dmk_newton_diagonal(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, newton_diagonal, padded_elements(s), DMK_INT(s->n_elements_pad),
               DMK_BUF(s->cot), DMK_BUF(s->mu), DMK_BUF(s->rank_one), DMK_BUF(s->out));
}

int dmk_rows_rhs(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, rows_rhs, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->slice),
               DMK_BUF(s->slot), DMK_BUF(s->out_real), DMK_BUF(s->f), DMK_BUF(s->cg[DMK_INNER].r));
}

int dmk_newton_rows(dmk_context *ctx, dmk_system *s, double step)
{
    return RUN(DMK_OUTER, newton_rows, rows(s), DMK_INT(s->n_rows), DMK_FLOAT(step),
               DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out_real), DMK_BUF(s->f),
               DMK_BUF(s->cg[DMK_INNER].r), DMK_BUF(s->inv_diag), DMK_BUF(s->x));
}

int dmk_rows_outer_residual(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, rows_outer_residual, rows(s), DMK_INT(s->n_rows), DMK_BUF(s->slice),
               DMK_BUF(s->slot), DMK_BUF(s->out_real), DMK_BUF(s->f), DMK_BUF(s->cg[DMK_OUTER].r),
               DMK_BUF(s->cg[DMK_OUTER].narrow));
}

int dmk_newton_update(dmk_context *ctx, dmk_system *s, const dmk_newton_step *step, int at)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_INNER, s->w)));
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_OUTER, s->u)));
    DMK_TRY(RUN(DMK_OUTER, newton_update, elements(s), DMK_INT(s->n_elements),
                DMK_FLOAT(step->alpha), DMK_FLOAT(step->D), DMK_FLOAT(step->bend),
                DMK_FLOAT(step->relax), DMK_FLOAT(step->lowest), DMK_BUF(s->index), DMK_BUF(s->cot),
                DMK_BUF(s->area), DMK_BUF(s->rank_one), DMK_BUF(s->w), DMK_BUF(s->u),
                DMK_BUF(s->mu), DMK_BUF(s->out_real), DMK_BUF(s->q), SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ELEMENTS, 6, 1, at);
done:
    return rc;
}

int dmk_newton_update_wide(dmk_context *ctx, dmk_system *s, const dmk_newton_step *step, int at)
{
    /* Without T there are no shares, and no sums of theirs to finish. */
    return RUN(DMK_OUTER, newton_update_wide, elements(s), DMK_INT(s->n_elements),
               DMK_FLOAT(step->alpha), DMK_FLOAT(step->D), DMK_FLOAT(step->bend),
               DMK_FLOAT(step->relax), DMK_FLOAT(step->lowest), DMK_BUF(s->index), DMK_BUF(s->cot),
               DMK_BUF(s->area), DMK_BUF(s->rank_one_real), DMK_BUF(s->u), DMK_BUF(s->mu),
               DMK_BUF(s->out_real), DMK_BUF(s->q), SUMS(at, s->scalars));
}

int dmk_explicit_update(dmk_context *ctx, dmk_system *s, bool inertial, double dt, double beta,
                        double lowest, int at)
{
    int rc;
    DMK_TRY(RUN(DMK_OUTER, explicit_update, elements(s), DMK_INT(s->n_elements), DMK_INT(inertial),
                DMK_FLOAT(dt), DMK_FLOAT(beta), DMK_FLOAT(lowest), DMK_BUF(s->area), DMK_BUF(s->q),
                DMK_BUF(s->mu), DMK_BUF(s->before), SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ELEMENTS, 2, 0, at);
done:
    return rc;
}

/* ---- nested.cl ------------------------------------------------------------------------------- */

int dmk_nested_load(dmk_context *ctx, dmk_system *s)
{
    int rc;
    const dmk_level *t = &s->level[0];
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_OUTER, s->f)));
    rc = RUN(DMK_OUTER, nested_load, vertices(s), DMK_INT(t->n), DMK_INT(s->vertex_row),
             DMK_BUF(t->slice), DMK_BUF(t->number), DMK_BUF(s->f), DMK_BUF(s->load));
done:
    return rc;
}

int dmk_nested_energy(dmk_context *ctx, dmk_system *s, double scale, int at)
{
    int rc;
    DMK_TRY(RUN(DMK_OUTER, nested_energy, elements(s), DMK_INT(s->n_elements), DMK_FLOAT(scale),
                DMK_BUF(s->index), DMK_BUF(s->cot), DMK_BUF(s->area), DMK_BUF(s->mu), DMK_BUF(s->u),
                DMK_BUF(s->q), SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ELEMENTS, 5, 1, at);
done:
    return rc;
}

int dmk_nested_prepare(dmk_context *ctx, dmk_system *s, const dmk_newton_step *step)
{
    return RUN(DMK_OUTER, nested_prepare, padded_elements(s), DMK_INT(s->n_elements_pad),
               DMK_FLOAT(step->alpha), DMK_FLOAT(step->D), DMK_FLOAT(step->bend), DMK_BUF(s->index),
               DMK_BUF(s->cot), DMK_BUF(s->area), DMK_BUF(s->mu), DMK_BUF(s->q), DMK_BUF(s->u),
               DMK_BUF(s->edge), DMK_BUF(s->diag_coarse), DMK_BUF(s->out));
}

int dmk_nested_rhs(dmk_context *ctx, dmk_system *s)
{
    const dmk_level *t = &s->level[0];
    return RUN(DMK_OUTER, nested_rhs, vertices(s), DMK_INT(t->n), DMK_INT(first_slice(s)),
               DMK_BUF(s->slice), DMK_BUF(s->slot), DMK_BUF(s->out), DMK_BUF(s->load),
               DMK_BUF(t->rhs));
}

int dmk_nested_update(dmk_context *ctx, dmk_system *s, const dmk_newton_step *step, int at)
{
    int rc;
    /* w and u are right at ghosts, too: so is each z that they are of. */
    DMK_TRY(RUN(DMK_OUTER, nested_update, elements(s), DMK_INT(s->n_elements),
                DMK_INT(s->vertex_row), DMK_FLOAT(step->alpha), DMK_FLOAT(step->D),
                DMK_FLOAT(step->bend), DMK_FLOAT(step->lowest), DMK_BUF(s->index), DMK_BUF(s->cot),
                DMK_BUF(s->area), DMK_BUF(s->w), DMK_BUF(s->u), DMK_BUF(s->mu), DMK_BUF(s->q),
                SUMS(at, s->scalars)));
    rc = finish_sums(ctx, s, DMK_ELEMENTS, 6, 1, at);
done:
    return rc;
}

int dmk_nested_refine(dmk_context *ctx, dmk_system *s)
{
    return RUN(DMK_OUTER, nested_refine, items(s->n_edges), DMK_INT(s->n_edges),
               DMK_INT(s->vertex_row), DMK_BUF(s->ends), DMK_BUF(s->u));
}

/* ---- certificate.cl -------------------------------------------------------------------------- */

int dmk_band_slopes(dmk_context *ctx, dmk_system *s, const dmk_bands *b, const dmk_buffer *u,
                    dmk_buffer *slopes)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_OUTER, u)));
    rc = RUN(DMK_OUTER, band_slopes, elements(s), DMK_INT(s->n_elements), DMK_INT(b->n),
             DMK_FLOAT(b->start), DMK_FLOAT(b->inverse), DMK_BUF(s->index), DMK_BUF(u),
             DMK_BUF(s->q), DMK_BUF(slopes));
done:
    return rc;
}

int dmk_band_map(dmk_context *ctx, dmk_system *s, const dmk_bands *b, const dmk_buffer *phi,
                 const dmk_buffer *u, dmk_buffer *v)
{
    return RUN(DMK_OUTER, band_map, rows(s), DMK_INT(s->n_rows), DMK_INT(b->n), DMK_FLOAT(b->start),
               DMK_FLOAT(b->inverse), DMK_BUF(phi), DMK_BUF(u), DMK_BUF(v));
}

int dmk_repair_start(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, double scale,
                     const dmk_buffer *from)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_INNER, s->inv_diag)));
    rc = RUN(DMK_OUTER, repair_start, rows(s), DMK_INT(s->n_rows), DMK_FLOAT(scale), DMK_BUF(from),
             DMK_BUF(w->u), DMK_BUF(w->before));
done:
    return rc;
}

int dmk_repair_mark(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, double limit)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_two_rows(s->share, DMK_OUTER, w->u, w->before)));
    rc = RUN(DMK_OUTER, repair_mark, elements(s), DMK_INT(s->n_elements), DMK_FLOAT(limit),
             DMK_BUF(s->index), DMK_BUF(s->q), DMK_BUF(w->mark), DMK_BUF(w->u), DMK_BUF(w->before),
             DMK_BUF(w->ring));
done:
    return rc;
}

int dmk_repair_grow(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, int ring)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_INNER, w->ring)));
    rc = RUN(DMK_OUTER, repair_grow, elements(s), DMK_INT(s->n_elements), DMK_INT(ring),
             DMK_BUF(s->index), DMK_BUF(w->ring));
done:
    return rc;
}

int dmk_repair_list(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, int ring)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_INNER, w->ring)));
    DMK_TRY(dmk_buffer_clear(ctx, s->device, w->count, 2 * sizeof(int32_t)));
    DMK_TRY(RUN(DMK_OUTER, repair_list_elements, elements(s), DMK_INT(s->n_elements), DMK_INT(ring),
                DMK_BUF(s->index), DMK_BUF(w->ring), DMK_BUF(w->count), DMK_BUF(w->elements)));
    DMK_TRY(RUN(DMK_OUTER, repair_list_rows, rows(s), DMK_INT(s->n_rows), DMK_BUF(w->ring),
                DMK_BUF(w->count), DMK_BUF(w->rows)));
done:
    return rc;
}

int dmk_repair_elements(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, int sweep,
                        int stamp, double target)
{
    int rc;
    DMK_TRY(dmk_send(ctx, dmk_ship_rows(s->share, DMK_OUTER, w->u)));
    DMK_TRY(RUN(DMK_OUTER, repair_elements, items(w->n_elements), DMK_INT(w->n_elements),
                DMK_INT(sweep), DMK_INT(stamp), DMK_FLOAT(target), DMK_BUF(w->elements),
                DMK_BUF(s->index), DMK_BUF(s->cot), DMK_BUF(s->area), DMK_BUF(s->inv_diag),
                DMK_BUF(w->u), DMK_BUF(s->out_real), DMK_BUF(w->mark), DMK_BUF(w->moved),
                DMK_BUF(w->broken)));
    DMK_TRY(dmk_share_flag(ctx, s->share, w->broken, sweep));
done:
    return rc;
}

int dmk_repair_rows(dmk_context *ctx, dmk_system *s, const dmk_repair_work *w, int sweep, int stamp,
                    double momentum)
{
    return RUN(DMK_OUTER, repair_rows, items(w->n_rows), DMK_INT(w->n_rows), DMK_INT(sweep),
               DMK_INT(stamp), DMK_FLOAT(momentum), DMK_BUF(w->rows), DMK_BUF(s->slice),
               DMK_BUF(s->slot), DMK_BUF(s->out_real), DMK_BUF(w->moved), DMK_BUF(w->broken),
               DMK_BUF(w->u), DMK_BUF(w->before));
}
