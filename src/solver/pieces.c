/* A solve of a mesh in pieces: no rank has all of it, from its range of a file to its part of the result. */
#include "solver/memory.h"
#include "solver/setup.h"
#include "solver/solver.h"

#include "mesh/mollify.h"

#include <stdlib.h>
#include <string.h>

int dmk_solver_create_of_pieces(dmk_context *ctx, dmk_device *device, dmk_pieces **pieces,
                                dmk_solver **solver)
{
    int rc;
    dmk_solver *s = NULL;
    if (dmk_missing(ctx, "device", device, "pieces", pieces, "solver", solver)) return DMK_E_ARG;
    if (dmk_missing(ctx, "*pieces", *pieces)) return DMK_E_ARG;
    DMK_TRY(dmk_device_owned(ctx, device));
    DMK_TRY(DMK_NEW(ctx, s, 1));
    const dmk_pieces *p = *pieces;
    s->counts = (dmk_mesh){.n_vertices = (int32_t)p->n_vertices,
                           .n_triangles = (int32_t)p->n_triangles,
                           .n_edges = (int32_t)p->n_edges,
                           .n_components = (int32_t)p->n_components};
    s->mesh = &s->counts;
    s->device = device;
    s->ranks = p->ranks;
    s->component = -1;
    s->pieces = *pieces;
    *pieces = NULL;
    *solver = s;
done:
    return rc;
}

/* ---- order ------------------------------------------------------------------------------------ */

/* The share's place is taken by the whole, on every rank. */
static int unite(dmk_context *ctx, dmk_solver *s)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->order, 1));
    atomic_init(&s->order->users, 1);
    DMK_TRY(dmk_plot_unite(ctx, &s->ranks, &s->plot, &s->order->order));
    DMK_TRY(dmk_mollify(ctx, s->order->order.mesh, &s->mollified));
    s->planted = false;
done:
    return rc;
}

int dmk_solver_plant(dmk_context *ctx, dmk_solver *s, int64_t triangle)
{
    int rc;
    const int32_t part = (int32_t)dmk_launch_part(s->device);
    const dmk_plot *plot = &s->plot;
    DMK_TRY(dmk_stage_begin(ctx, "levels"));
    DMK_TRY(dmk_memory_check(ctx, s->device, s->counts.n_triangles / s->ranks.size));
    DMK_TRY(dmk_share_check_devices(ctx, &s->ranks, s->device));
    s->spent = true;
    DMK_TRY(dmk_plot_create(ctx, s->pieces, triangle, part, &s->plot));
    DMK_TRY(dmk_poll(ctx));
    s->component = 0;
    s->planted = true;
    s->mollified = (dmk_mesh){.n_triangles = (int32_t)plot->bound[0][s->ranks.size],
                              .n_edges = (int32_t)plot->bound[1][s->ranks.size],
                              .n_vertices = (int32_t)plot->bound[2][s->ranks.size],
                              .n_components = 1};
    if (s->ranks.size == 1) return unite(ctx, s);
    rc = DMK_OK;
done:
    return rc;
}

/* Each of n values becomes the largest of all ranks. */
static int agree(dmk_context *ctx, const dmk_solver *s, int n, int64_t *value)
{
    int rc;
    const size_t size = (size_t)s->ranks.size, count = (size_t)n;
    int64_t *all = NULL;
    DMK_TRY(dmk_gather_each(ctx, &s->ranks, count * sizeof *value, value, (void **)&all));
    for (size_t i = 0; i < size * count; i++) {
        if (all[i] > value[i % count]) value[i % count] = all[i];
    }
done:
    free(all);
    return rc;
}

/* ---- the system ------------------------------------------------------------------------------- */

/* The source's element among the own ones: its place, or -1. */
static int32_t find_own(const dmk_plot *plot, int64_t old)
{
    for (int64_t t = 0; t < plot->own[1] - plot->own[0]; t++) {
        if (plot->element_old[t] == old) return (int32_t)t;
    }
    return -1;
}

/* The local slot of the source's element, wherever it is a ghost too; or -1. */
static int find_source(dmk_context *ctx, const dmk_solver *s, int64_t old, int32_t *slot)
{
    int rc;
    const dmk_share *share = s->system->share;
    const int32_t own = find_own(&s->plot, old);
    int64_t whole = own < 0 ? -1 : s->plot.own[0] + own;
    DMK_TRY(agree(ctx, s, 1, &whole));
    *slot = whole < 0 ? -1 : dmk_space_slot(&share->element, whole);
done:
    return rc;
}

/* What a share is wanted for beyond its system. */
static int keep_planted(dmk_context *ctx, void *user, dmk_system *sys)
{
    int rc;
    dmk_solver *s = ((void **)user)[0];
    const dmk_point *source = ((void **)user)[1];
    int32_t slot;
    s->system = sys; /* for a moment */
    rc = find_source(ctx, s, source->triangle, &slot);
    s->system = NULL;
    if (rc != DMK_OK) return rc;
    dmk_plot_free_mesh(&s->plot);
    DMK_TRY(DMK_NEW(ctx, s->f, (size_t)sys->n_rows_pad));
    dmk_fill_right_hand_side(&sys->share->mesh, &sys->share->element, sys->vertex_row, sys->unit,
                             slot, source->weight, s->f); /* elements at own rows are all here */
    DMK_TRY(dmk_share_ghosts(ctx, sys->share, s->f));
    s->lean = true;
done:
    return rc;
}

int dmk_planted_pack(dmk_context *ctx, dmk_solver *s, const dmk_point *source)
{
    int rc;
    void *user[2] = {s, (void *)(uintptr_t)source};
    const dmk_system_dealt dealt = {.call = keep_planted, .user = user};
    if (s->system) return DMK_OK;
    DMK_TRY(dmk_plot_mollify(ctx, &s->ranks, &s->plot));
    const dmk_ground ground = dmk_plot_ground(&s->plot);
    DMK_TRY(dmk_system_deal(ctx, s->device, &ground, &s->ranks, &dealt, &s->system));
    dmk_trim_memory(); /* of a million triangles 10 MB on each of four ranks */
    if (!s->system) rc = unite(ctx, s);
done:
    return rc;
}

/* ---- results ---------------------------------------------------------------------------------- */

/* Triangles of the whole order by their numbers in the input. */
static int name_steep(dmk_context *ctx, const dmk_solver *s, dmk_stats *stats)
{
    const dmk_plot *plot = &s->plot;
    for (int k = 0; k < DMK_N_STEEP; k++) {
        int64_t *t = &stats->steep[k];
        const bool own = k < stats->n_steep && *t >= plot->own[0] && *t < plot->own[1];
        *t = own ? plot->element_old[*t - plot->own[0]] : -1;
    }
    return agree(ctx, s, DMK_N_STEEP, stats->steep);
}

/* u at the source, by the rank that owns it. */
static void add_value(void *data, double *sum)
{
    void *const *user = data;
    const dmk_solver *s = user[0];
    const dmk_point *p = user[1];
    const double *u = user[2];
    const dmk_system *sys = s->system;
    const dmk_mesh *m = &sys->share->mesh;
    const int32_t own = find_own(&s->plot, p->triangle), t = own + sys->share->element.at_first;
    double w[6];
    if (own < 0) return;
    dmk_point_weights(p->weight, w);
    for (int k = 0; k < 3; k++) {
        *sum += w[k] * u[sys->vertex_row + m->triangle[3 * t + k]];
        *sum += w[3 + k] * u[m->triangle_edge[3 * t + k]];
    }
}

/* A number of the result, and where it belongs. */
typedef struct figure {
    int64_t at;
    double value;
} figure;

static void put(int64_t n, const figure *list, double *to)
{
    for (int64_t i = 0; i < n; i++) to[list[i].at] = list[i].value;
}

/* Own numbers of all ranks into `to` on the first one, rank after rank, so that it needs room for one. */
static int collect_kind(dmk_context *ctx, const dmk_solver *s, const int64_t *bound,
                        const int64_t *old, const double *own, double *to)
{
    int rc;
    const int me = s->ranks.rank;
    const int64_t n = bound[me + 1] - bound[me];
    figure *list = NULL, *theirs = NULL;
    int32_t *out = NULL, *in = NULL;
    DMK_TRY(DMK_NEW(ctx, list, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, out, 2 * (size_t)s->ranks.size));
    in = out + s->ranks.size;
    for (int64_t i = 0; i < n; i++) list[i] = (figure){old[i], own[i]};
    if (me == 0) put(n, list, to);
    for (int r = 1; r < s->ranks.size; r++) {
        const int64_t count = bound[r + 1] - bound[r];
        if (me == r) out[0] = (int32_t)count;
        if (me == 0) in[r] = (int32_t)count;
        if (me == 0) DMK_TRY(DMK_NEW(ctx, theirs, (size_t)count));
        DMK_TRY(dmk_exchange(ctx, &s->ranks, out, in, sizeof *list, list, theirs));
        out[0] = in[r] = 0;
        if (me == 0) put(count, theirs, to);
        free(theirs);
        theirs = NULL;
    }
done:
    free(list);
    free(theirs);
    free(out);
    return rc;
}

/* x becomes (x - base) times the unit. */
static void scale(int64_t n, double base, double unit, double *x)
{
    for (int64_t i = 0; i < n; i++) x[i] = (x[i] - base) * unit;
}

int dmk_planted_collect(dmk_context *ctx, dmk_solver *s, const dmk_point *source, dmk_result *r)
{
    int rc;
    dmk_system *sys = s->system;
    const dmk_share *share = sys->share;
    const dmk_plot *plot = &s->plot;
    const size_t rows = (size_t)sys->n_rows_pad, elements = (size_t)sys->n_elements_pad;
    double *u = NULL, *mu = NULL, base = 0;
    DMK_TRY(DMK_NEW(ctx, u, rows));
    DMK_TRY(DMK_NEW(ctx, mu, elements));
    DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, sys->u, rows, u));
    DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, sys->mu, elements, mu));
    dmk_system_release(sys);
    dmk_trim_memory(); /* before there is the result */
    DMK_TRY(dmk_ranks_in_turn(ctx, &s->ranks, &base, add_value,
                              (void *[]){s, (void *)(uintptr_t)source, u}));
    DMK_TRY(name_steep(ctx, s, &r->stats));
    if (s->ranks.rank == 0) DMK_TRY(dmk_result_allocate(ctx, r, false));
    double *const own_mu = mu + share->element.at_first, *const own_edge = u + share->edge.at_first,
                  *const own_vertex = u + sys->vertex_row + share->vertex[0].at_first;
    scale(dmk_space_own(&share->element), 0, sys->unit, own_mu);
    scale(dmk_space_own(&share->edge), base, sys->unit, own_edge);
    scale(dmk_space_own(&share->vertex[0]), base, sys->unit, own_vertex);
    DMK_TRY(collect_kind(ctx, s, plot->bound[0], plot->element_old, own_mu, r->density));
    DMK_TRY(collect_kind(ctx, s, plot->bound[1], plot->edge_old, own_edge, r->potential_mid));
    rc = collect_kind(ctx, s, plot->bound[2], plot->vertex_old, own_vertex, r->potential);
done:
    free(u);
    free(mu);
    return rc;
}
