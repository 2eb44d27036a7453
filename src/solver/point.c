/* All of the mass from a point: the distance, the start that belongs to it, the iteration and the result. */
#include "solver/sell.h"
#include "solver/setup.h"
#include "solver/solver.h"
#include "solver/start.h"

#include "base/parallel.h"
#include "mesh/mollify.h"

#include <math.h>
#include <stdlib.h>

static int32_t find_triangle(const dmk_order *order, int64_t old)
{
    for (int32_t t = 0; t < order->mesh->n_triangles; t++) {
        if (order->triangle_old[t] == old) return t;
    }
    return -1;
}

/* The source, and the distance from it, on the ordered mesh. */
typedef struct start {
    dmk_solver *solver;
    const dmk_mesh *mesh; /* with the metric that is computed with */
    const dmk_mesh *own;  /* with that of the input; NULL: no distance is wanted */
    dmk_point *source;    /* in the order, once there is one */
    dmk_result *result;   /* which shares the order */
    dmk_start from;
    dmk_geodesics *geodesics; /* of `own` */
    double *mid;              /* n_edges: distance at the midpoints */
    double *mu; /* padded: the density that belongs to the distance, in the mesh's units */
    double integral, integral_error;
    dmk_meter distance, packing; /* of what set-up does at once */
} start;

static void free_start(start *near)
{
    dmk_geodesics_destroy(&near->geodesics);
    free(near->mid);
    free(near->mu);
    near->mid = near->mu = NULL;
}

/* The distance is the first rank's work. */
static bool measures(const dmk_solver *s)
{
    return s->ranks.rank == 0;
}

/* What is made of it to start from is the last one's, which has packed its share by then. */
static bool makes_density(const dmk_solver *s)
{
    return s->ranks.size <= 1 || s->ranks.rank == s->ranks.size - 1;
}

/* On the other ranks all but the distance itself. */
static int measure(dmk_context *ctx, void *data)
{
    start *near = data;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    return (measures(near->solver) ? dmk_geodesics_compute : dmk_geodesics_prepare)(
        ctx, near->own, near->solver->order->order.triangle_old, 1, near->source, &options,
        &near->geodesics);
}

static int integrate(dmk_context *ctx, void *data)
{
    int rc;
    start *near = data;
    double *error = &near->integral_error;
    DMK_TRY(dmk_geodesics_integrate_from(ctx, near->geodesics, near->mid, &near->integral, error));
    rc = dmk_geodesics_integrate_finer(ctx, near->geodesics, &near->integral, error);
done:
    return rc;
}

typedef struct integration {
    start *near;
    dmk_task task;
} integration;

static void begin_integral(dmk_context *ctx, void *user)
{
    integration *i = user;
    dmk_task_begin(ctx, &i->task, integrate, i->near);
}

/* mid and mu; without ranks the integral while one thread sweeps. */
static int make_density(dmk_context *ctx, start *near)
{
    int rc;
    const dmk_mesh *m = near->mesh;
    integration integral = {.near = near};
    const dmk_meanwhile meanwhile = {begin_integral, &integral};
    const bool alone = near->solver->ranks.size <= 1;
    DMK_TRY(DMK_NEW_UNSET(ctx, near->mid, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, near->mu, (size_t)dmk_padded(m->n_triangles)));
    dmk_geodesics_midpoints(ctx, near->geodesics, near->mid);
    rc = dmk_start_density(ctx, m, near->geodesics, near->mid, near->mu, alone ? &meanwhile : NULL);
    rc = dmk_task_end(ctx, &integral.task, rc);
done:
    return rc;
}

/* ---- the distance on all ranks ---------------------------------------------------------------- */

static int spread_geodesics(dmk_context *ctx, const dmk_ranks *ranks, dmk_geodesics *g)
{
    int rc;
    const size_t n = (size_t)g->mesh->n_vertices;
    double tolerance[2] = {g->tolerance, g->error != NULL};
    int64_t counts[3] = {g->n_windows, g->n_shared, (int64_t)g->n_ties};
    DMK_TRY(dmk_ranks_spread(ctx, ranks, tolerance, sizeof tolerance));
    DMK_TRY(dmk_ranks_spread(ctx, ranks, counts, sizeof counts));
    g->tolerance = tolerance[0];
    g->n_windows = counts[0];
    g->n_shared = counts[1];
    g->n_ties = (size_t)counts[2];
    if (!g->tie) DMK_TRY(DMK_NEW(ctx, g->tie, g->n_ties));
    DMK_TRY(dmk_ranks_spread(ctx, ranks, g->tie, g->n_ties * sizeof *g->tie));
    DMK_TRY(dmk_ranks_spread(ctx, ranks, g->distance, n * sizeof *g->distance));
    DMK_TRY(dmk_ranks_spread(ctx, ranks, g->arrival, n * sizeof *g->arrival));
    if (tolerance[1] == 0) goto done;
    if (!g->error) DMK_TRY(DMK_NEW(ctx, g->error, n));
    rc = dmk_ranks_spread(ctx, ranks, g->error, n * sizeof *g->error);
done:
    return rc;
}

/* As soon as the first rank has the distance. */
static int tell_distance(dmk_context *ctx, void *user, dmk_system *sys)
{
    int rc = DMK_OK;
    start *near = user;
    (void)sys;
    if (!near->own) return DMK_OK;
    DMK_TRY(spread_geodesics(ctx, &near->solver->ranks, near->geodesics));
    if (near->from == DMK_START_DISTANCE && makes_density(near->solver))
        rc = make_density(ctx, near);
done:
    return rc;
}

typedef struct terms {
    const double *term;
    int32_t n;
} terms;

static void add_terms(void *data, double *sum)
{
    const terms *t = data;
    for (int32_t i = 0; i < t->n; i++) *sum += t->term[i];
}

/* The integral, of own elements by each rank, added in the order of the whole mesh. */
static int integrate_in_turn(dmk_context *ctx, start *near)
{
    int rc;
    dmk_share *share = near->solver->system->share;
    const int32_t begin = share ? share->element.first : 0,
                  end = share ? share->element.end : near->own->n_triangles;
    double *sum = NULL, *off = NULL;
    DMK_TRY(DMK_NEW(ctx, sum, (size_t)(end - begin)));
    DMK_TRY(DMK_NEW(ctx, off, (size_t)(end - begin)));
    dmk_geodesics_integrate_parts(ctx, near->geodesics, near->mid, begin, end, sum, off);
    near->integral = near->integral_error = 0;
    DMK_TRY(dmk_share_in_turn(ctx, share, &near->integral, add_terms, &(terms){sum, end - begin}));
    DMK_TRY(dmk_share_in_turn(ctx, share, &near->integral_error, add_terms,
                              &(terms){off, end - begin}));
    rc =
        dmk_geodesics_integrate_finer(ctx, near->geodesics, &near->integral, &near->integral_error);
done:
    free(sum);
    free(off);
    return rc;
}

/* ---- a share of the mesh and no more ---------------------------------------------------------- */

/* Give the ordered mesh's arrays back; its counts and its numbers in the input stay. */
static void free_mesh(dmk_solver *s)
{
    struct dmk_mesh *m = s->order->order.mesh;
    dmk_mesh counts = {.n_vertices = m->n_vertices,
                       .n_triangles = m->n_triangles,
                       .n_edges = m->n_edges,
                       .n_components = m->n_components};
    dmk_mollify_free(m, &s->mollified);
    dmk_mesh_destroy(&s->order->order.mesh);
    s->mollified = counts;
}

/* What the right-hand side is not made from. */
static void free_edges(dmk_solver *s)
{
    struct dmk_mesh *m = s->order->order.mesh;
    free(m->xyz);
    free(m->edge_vertex);
    free(m->edge_triangle);
    m->xyz = s->mollified.xyz = NULL;
    m->edge_vertex = s->mollified.edge_vertex = NULL;
    m->edge_triangle = s->mollified.edge_triangle = NULL;
}

/* What is still wanted of the whole mesh when the share is made. */
typedef struct farewell {
    dmk_solver *solver;
    const dmk_point *source;
} farewell;

static int keep_share(dmk_context *ctx, void *user, dmk_system *sys)
{
    int rc;
    const farewell *last = user;
    dmk_solver *s = last->solver;
    const dmk_mesh *m = &s->mollified;
    double *f = NULL;
    for (int k = 0; k < 3; k++) {
        const size_t h = 3 * (size_t)last->source->triangle + (size_t)k;
        s->node[k] = sys->whole.vertex_row + m->triangle[h];
        s->node[3 + k] = m->triangle_edge[h];
    }
    free_edges(s);
    DMK_TRY(DMK_NEW(ctx, f, (size_t)sys->whole.n_rows_pad));
    DMK_TRY(DMK_NEW(ctx, s->f, (size_t)sys->n_rows_pad));
    dmk_right_hand_side(m, sys, last->source, f);
    dmk_share_take(sys->share, true, sys->whole.vertex_row, f, s->f);
    free(f);
    f = NULL;
    free_mesh(s);
    s->lean = true;
done:
    free(f);
    return rc;
}

static int pack_lean(dmk_context *ctx, dmk_solver *s, const dmk_point *source)
{
    farewell last = {s, source};
    const dmk_system_dealt dealt = {.call = keep_share, .user = &last};
    const dmk_ground ground = {.mesh = &s->mollified};
    return dmk_system_deal(ctx, s->device, &ground, &s->ranks, &dealt, &s->system);
}

static int pack_for(dmk_context *ctx, void *data)
{
    start *near = data;
    return dmk_solver_pack(ctx, near->solver, tell_distance, near);
}

static int pack(dmk_context *ctx, void *data)
{
    start *near = data;
    return dmk_metered(ctx, &near->packing, pack_for, near);
}

/* The distance, and the system of the ordered mesh, if it is not there. What of either keeps one thread busy only, and
 * the wait for the device's kernels, leaves the others to the other. */
static int set_up_alone(dmk_context *ctx, dmk_solver *s, start *near)
{
    dmk_task task = {0};
    int rc = DMK_OK;
    if (!s->system) dmk_task_begin(ctx, &task, pack, near);
    if (near->own) rc = dmk_metered(ctx, &near->distance, measure, near);
    return dmk_task_end(ctx, &task, rc);
}

/* The source in the order, which the result shares. */
static void find_place(const dmk_solver *s, start *near)
{
    near->result->order = dmk_shared_order_keep(s->order);
    near->result->source_triangle = find_triangle(&s->order->order, near->source->triangle);
    near->source->triangle = near->result->source_triangle;
}

/* Ranks talk to each other, all in the same order. */
static int set_up(dmk_context *ctx, dmk_solver *s, start *near)
{
    int rc = DMK_OK;
    if (s->planted) {
        DMK_TRY(dmk_planted_pack(ctx, s, near->source));
        if (s->planted) return DMK_OK;
        find_place(s, near); /* the share was too small after all */
    }
    if (s->ranks.size <= 1) return set_up_alone(ctx, s, near);
    if (!near->own) return s->system ? DMK_OK : pack_lean(ctx, s, near->source);
    DMK_TRY(dmk_metered(ctx, &near->distance, measure, near));
    rc = s->system ? tell_distance(ctx, near, s->system) : pack(ctx, near);
done:
    return rc;
}

/* u and mu that belong to the distance; u as long as a vector over all rows, mu the caller's. */
static int start_from_distance(dmk_context *ctx, const dmk_solver *s, start *near, double *u,
                               double **mu)
{
    int rc = DMK_OK;
    const dmk_mesh *m = near->mesh;
    const dmk_system *sys = s->system;
    const dmk_ranks *ranks = &s->ranks;
    const double *vertex = near->geodesics->distance;
    if (makes_density(s) && !near->mu) DMK_TRY(make_density(ctx, near));
    DMK_TRY(dmk_poll(ctx));
    if (!near->mid) DMK_TRY(DMK_NEW(ctx, near->mid, (size_t)m->n_edges));
    if (!near->mu) DMK_TRY(DMK_NEW(ctx, near->mu, (size_t)sys->whole.n_elements_pad));
    DMK_TRY(dmk_ranks_spread_from(ctx, ranks, ranks->size - 1, near->mid,
                                  (size_t)m->n_edges * sizeof *near->mid));
    DMK_TRY(dmk_ranks_spread_from(ctx, ranks, ranks->size - 1, near->mu,
                                  (size_t)m->n_triangles * sizeof *near->mu));
    if (ranks->size > 1) DMK_TRY(integrate_in_turn(ctx, near));
    for (int32_t e = 0; e < m->n_edges; e++) u[e] = near->mid[e] / -sys->unit;
    for (int32_t v = 0; v < m->n_vertices; v++) {
        u[sys->whole.vertex_row + v] = vertex[v] / -sys->unit;
    }
    for (int32_t t = 0; t < m->n_triangles; t++) near->mu[t] /= sys->unit;
    *mu = near->mu;
    near->mu = NULL;
    free(near->mid);
    near->mid = NULL;
done:
    return rc;
}

/* Nothing is known but what the source gives. */
static int start_uniform(dmk_context *ctx, const dmk_solver *s, start *near)
{
    int rc;
    DMK_TRY(dmk_system_start_even(ctx, s->system));
    if (!near->geodesics) goto done;
    if (!near->mid) DMK_TRY(DMK_NEW(ctx, near->mid, (size_t)near->mesh->n_edges));
    dmk_geodesics_midpoints(ctx, near->geodesics, near->mid);
    rc = s->ranks.size > 1 ? integrate_in_turn(ctx, near) : integrate(ctx, near);
done:
    return rc;
}

/* u = 0, mu = 1 and f on a share whose mesh is gone. */
static int set_lean_start(dmk_context *ctx, dmk_solver *s)
{
    int rc;
    dmk_system *sys = s->system;
    DMK_TRY(dmk_system_start_even(ctx, sys));
    if (s->f) { /* else it is there from an earlier try */
        DMK_TRY(dmk_buffer_write_real(ctx, sys->device, DMK_OUTER, sys->f, (size_t)sys->n_rows_pad,
                                      s->f));
    }
    free(s->f);
    s->f = NULL;
    rc = dmk_solver_clear(ctx, s);
done:
    return rc;
}

/* u and mu to start from, on the device. */
static int set_start(dmk_context *ctx, dmk_solver *s, start *near)
{
    int rc;
    dmk_system *sys = s->system;
    double *u = NULL, *mu = NULL;
    if (s->lean) return set_lean_start(ctx, s);
    DMK_TRY(DMK_NEW(ctx, u, (size_t)sys->whole.n_rows_pad));
    if (near->from == DMK_START_DISTANCE) {
        DMK_TRY(start_from_distance(ctx, s, near, u, &mu));
        DMK_TRY(dmk_system_allocate_state(ctx, sys));
        DMK_TRY(dmk_rows_write(ctx, sys, sys->u, u));
        DMK_TRY(dmk_elements_write(ctx, sys, sys->mu, mu));
    } else {
        DMK_TRY(start_uniform(ctx, s, near));
    }
    dmk_right_hand_side(near->mesh, sys, near->source, u);
    DMK_TRY(dmk_rows_write(ctx, sys, sys->f, u));
    free(u);
    free(mu);
    u = mu = NULL;
    DMK_TRY(dmk_solver_clear(ctx, s));
done:
    free(u);
    free(mu);
    return rc;
}

/* Of the time in which the distance and a new system are made at once, the distance's. */
static double share_of_distance(const start *near)
{
    const double distance = (double)near->distance.nanoseconds;
    return distance > 0 ? distance / (distance + (double)near->packing.nanoseconds) : 0;
}

/* System, u and mu, ready for the first step; the seconds go to set-up, distance and start. */
static int prepare(dmk_context *ctx, dmk_solver *s, start *near, bool newton, double began,
                   double seconds[])
{
    int rc;
    const bool is_fresh = !s->system;
    DMK_TRY(set_up(ctx, s, near));
    const double both = dmk_seconds() - began;
    seconds[DMK_STAGE_DISTANCE] = both * (is_fresh ? share_of_distance(near) : near->own ? 1 : 0);
    if (is_fresh) seconds[DMK_STAGE_SETUP] = both - seconds[DMK_STAGE_DISTANCE];
    DMK_TRY(dmk_poll(ctx));
    if (s->system->without_T && newton) near->from = DMK_START_UNIFORM;
    DMK_TRY(set_start(ctx, s, near));
    seconds[DMK_STAGE_START] =
        dmk_seconds() - began - seconds[DMK_STAGE_SETUP] - seconds[DMK_STAGE_DISTANCE];
    rc = dmk_poll(ctx);
done:
    return rc;
}

/* u at the source, by the macro-element's interpolation. */
static double value_at(const dmk_solver *s, const dmk_point *p, const double *u)
{
    double w[6], sum = 0;
    const dmk_mesh *m = &s->mollified;
    dmk_point_weights(p->weight, w);
    for (int k = 0; k < 3; k++) {
        const size_t h = 3 * (size_t)p->triangle + (size_t)k;
        sum += w[k] * u[s->lean ? s->node[k] : s->system->whole.vertex_row + m->triangle[h]];
        sum += w[3 + k] * u[s->lean ? s->node[3 + k] : m->triangle_edge[h]];
    }
    return sum;
}

/* Triangles from which on the state gives way to the result, 350 bytes per triangle against a fiftieth
 * of the time of the next source; small meshes keep it, for them its making is a tenth. */
enum { RELEASED = 100000 };

/* A vector of the whole mesh in place of a share's own and ghosts. */
static int make_whole(dmk_context *ctx, const dmk_system *sys, bool rows, double **x)
{
    int rc;
    double *whole = NULL;
    if (!sys->share) return DMK_OK;
    DMK_TRY(
        DMK_NEW(ctx, whole, (size_t)(rows ? sys->whole.n_rows_pad : sys->whole.n_elements_pad)));
    DMK_TRY(dmk_share_give(ctx, sys->share, rows, sys->whole.vertex_row, *x, whole));
    free(*x);
    *x = whole;
    whole = NULL;
done:
    free(whole);
    return rc;
}

/* u and mu of the whole mesh, the caller's to free; of a large one the state on the device goes on the way. */
static int take_pair(dmk_context *ctx, const dmk_solver *s, double **u, double **mu)
{
    int rc;
    dmk_system *sys = s->system;
    const size_t rows = (size_t)sys->n_rows_pad, elements = (size_t)sys->n_elements_pad;
    DMK_TRY(DMK_NEW(ctx, *u, rows));
    DMK_TRY(DMK_NEW(ctx, *mu, elements));
    DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, sys->u, rows, *u));
    DMK_TRY(dmk_buffer_read_real(ctx, s->device, DMK_OUTER, sys->mu, elements, *mu));
    if (sys->whole.n_elements >= RELEASED) dmk_system_release(sys);
    DMK_TRY(make_whole(ctx, sys, true, u));
    rc = make_whole(ctx, sys, false, mu);
done:
    return rc;
}

/* Read mu and u back once and put them in the input's order and units. */
static int collect(dmk_context *ctx, dmk_solver *s, const start *near, double threshold,
                   dmk_result *r)
{
    int rc;
    dmk_system *sys = s->system;
    const dmk_order *o = &s->order->order;
    double *u = NULL, *mu = NULL;
    DMK_TRY(take_pair(ctx, s, &u, &mu));
    DMK_TRY(dmk_result_allocate(ctx, r, near->own));
    double at_source = value_at(s, near->source, u);
    for (int32_t t = 0; t < sys->whole.n_elements; t++)
        r->density[o->triangle_old[t]] = mu[t] * sys->unit;
    for (int32_t v = 0; v < sys->whole.n_vertices; v++) {
        double x = u[sys->whole.vertex_row + v];
        r->potential[o->vertex_old[v]] = (x - at_source) * sys->unit;
        if (near->geodesics) r->distance[o->vertex_old[v]] = near->geodesics->distance[v];
    }
    for (int32_t e = 0; e < sys->whole.n_edges; e++) {
        r->potential_mid[o->edge_old[e]] = (u[e] - at_source) * sys->unit;
    }
    if (!near->own) goto done;
    if (!measures(s)) { /* one has it for all, and the last one may trace the cut locus meanwhile */
        free(r->acl);
        r->acl = NULL;
        goto done;
    }
    for (int32_t t = 0; t < sys->whole.n_elements; t++) mu[t] *= sys->unit;
    for (int32_t i = 0; i < sys->whole.n_rows; i++) u[i] *= sys->unit;
    rc = dmk_solver_mark_acl(ctx, s, threshold, mu, u, r->acl);
done:
    free(u);
    free(mu);
    return rc;
}

/* The start, for Newton to begin again. */
static int restart(dmk_context *ctx, void *user)
{
    start *near = user;
    return set_start(ctx, near->solver, near);
}

/* The source's component in order, or planted, and what is begun with. */
static int put_in_order(dmk_context *ctx, dmk_solver *s, const dmk_point *source,
                        const dmk_solve_options *chosen, start *near)
{
    int rc;
    if (s->pieces)
        DMK_TRY(dmk_solver_plant(ctx, s, source->triangle));
    else
        DMK_TRY(dmk_solver_order(ctx, s, dmk_mesh_component(s->mesh, (int32_t)source->triangle)));
    near->solver = s;
    near->from = chosen->start;
    near->mesh = &s->mollified;
    near->own = chosen->density_only ? NULL : s->order->order.mesh;
    if (!s->planted) find_place(s, near);
done:
    return rc;
}

/* The steps, and the bounds. */
static int iterate(dmk_context *ctx, start *near, const dmk_solve_options *chosen, double began)
{
    int rc;
    dmk_solver *s = near->solver;
    dmk_stats *stats = &near->result->stats;
    const double first = dmk_seconds();
    dmk_iteration o = {.ctx = ctx,
                       .sys = s->system,
                       .mesh = near->mesh,
                       .triangle_old = s->order ? s->order->order.triangle_old : NULL,
                       .options = chosen,
                       .asked = chosen->method,
                       .floor = DMK_FLOOR,
                       .mean_floor = DMK_FLOOR,
                       .restart = restart,
                       .user = near,
                       .stats = stats,
                       .began = began};
    dmk_stage_end(ctx);
    DMK_TRY(chosen->method == DMK_NEWTON ? dmk_attempts(&o, near->from == DMK_START_DISTANCE)
                                         : dmk_explicit(&o));
    DMK_TRY(dmk_certify(&o, true));
    stats->seconds[DMK_STAGE_SOLVE] = dmk_seconds() - first - stats->seconds[DMK_STAGE_CERTIFY];
done:
    return rc;
}

/* In the input's order and units. */
static int collect_all(dmk_context *ctx, const start *near, const dmk_point *source,
                       double threshold)
{
    int rc;
    dmk_solver *s = near->solver;
    dmk_result *r = near->result;
    if (s->planted) {
        DMK_TRY(dmk_planted_collect(ctx, s, source, r));
    } else {
        dmk_solver_name_steep(s, &r->stats);
        DMK_TRY(collect(ctx, s, near, threshold, r));
    }
    dmk_solver_scale_stats(s, s->system->unit * s->system->unit, &r->stats);
    r->stats.cost_exact = near->own ? near->integral : NAN;
    r->stats.cost_exact_error = near->own ? near->integral_error : NAN;
done:
    return rc;
}

int dmk_solve(dmk_context *ctx, dmk_solver *s, const dmk_point *source,
              const dmk_solve_options *options, dmk_result **result)
{
    int rc;
    dmk_result *r = NULL;
    start near = {0};
    dmk_solve_options chosen;
    if (dmk_missing(ctx, "solver", s, "source", source, "result", result)) return DMK_E_ARG;
    DMK_TRY(dmk_solver_take_options(ctx, options, &chosen));
    DMK_TRY(dmk_solver_begin(ctx, s, chosen.density_only));
    DMK_TRY(dmk_point_check(ctx, s->mesh, "the source", source));
    DMK_TRY(dmk_result_create(ctx, s->mesh, &r));
    r->stats.gap = NAN; /* until it is computed */
    r->source = *source;
    dmk_point p = *source;
    near.source = &p;
    near.result = r;
    const double began = dmk_seconds();
    DMK_TRY(put_in_order(ctx, s, source, &chosen, &near));
    DMK_TRY(prepare(ctx, s, &near, chosen.method == DMK_NEWTON, began, r->stats.seconds));
    DMK_TRY(iterate(ctx, &near, &chosen, began));
    DMK_TRY(collect_all(ctx, &near, source, chosen.threshold));
    r->geodesics = near.geodesics;
    near.geodesics = NULL;
    *result = r;
    r = NULL;
done:
    dmk_stage_end(ctx);
    dmk_result_destroy(&r);
    free_start(&near);
    return rc;
}
