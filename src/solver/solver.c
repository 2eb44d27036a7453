/* Solver: one mesh on one device, set up once; then any number of sources: see point.c and transport.c. */
#include "solver/memory.h"
#include "solver/solver.h"

#include "mesh/mollify.h"
#include "solver/acl.h"
#include "solver/sell.h"
#include "solver/setup.h"

#include <math.h>
#include <stdlib.h>

static void forget_component(dmk_solver *s)
{
    dmk_system_destroy(&s->system);
    if (s->order && s->order->order.mesh) dmk_mollify_free(s->order->order.mesh, &s->mollified);
    dmk_shared_order_release(&s->order);
    s->component = -1;
    free(s->f);
    s->f = NULL;
    s->lean = s->planted = false;
    dmk_plot_free(&s->plot);
}

/* A mesh that was given serves one solve. */
static void spend(dmk_solver *s)
{
    if (!s->given) return;
    s->mesh = NULL;
    s->spent = true;
}

/* The component in order; a mesh that was given goes on the way. */
static int order_mesh(dmk_context *ctx, dmk_solver *s, int32_t component)
{
    if (!s->given) return dmk_order_create(ctx, s->mesh, component, &s->order->order);
    spend(s);
    return dmk_order_adopt(ctx, &s->given, component, &s->order->order);
}

/* The component's mesh in the order of the device, not packed yet. */
int dmk_solver_order(dmk_context *ctx, dmk_solver *s, int32_t component)
{
    int rc;
    if (component == s->component) {
        spend(s);
        dmk_mesh_destroy(&s->given);
        return DMK_OK;
    }
    forget_component(s);
    /* Of several components the size of this one is not known yet. */
    if (s->device && s->mesh->n_components == 1)
        DMK_TRY(dmk_memory_check(ctx, s->device, s->mesh->n_triangles));
    DMK_TRY(dmk_stage_begin(ctx, "levels"));
    DMK_TRY(DMK_NEW(ctx, s->order, 1));
    atomic_init(&s->order->users, 1);
    DMK_TRY(order_mesh(ctx, s, component));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_mollify(ctx, s->order->order.mesh, &s->mollified));
    if (s->ranks.size > 1) DMK_TRY(dmk_share_check_devices(ctx, &s->ranks, s->device));
    s->component = component;
done:
    if (rc != DMK_OK) forget_component(s);
    return rc;
}

int dmk_solver_create(dmk_context *ctx, dmk_device *device, const dmk_mesh *mesh,
                      dmk_solver **solver)
{
    int rc;
    dmk_solver *s = NULL;
    if (dmk_missing(ctx, "mesh", mesh, "solver", solver)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_edges(ctx, mesh));
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->mesh = mesh;
    s->component = -1; /* the first source decides which one to pack */
    if (device)
        DMK_TRY(dmk_solver_set_device(ctx, s, device));
    else if (mesh->n_components == 1)
        DMK_TRY(dmk_solver_order(ctx, s, 0));
    *solver = s;
    s = NULL;
done:
    dmk_stage_end(ctx);
    dmk_solver_destroy(&s);
    return rc;
}

int dmk_solver_set_device(dmk_context *ctx, dmk_solver *s, dmk_device *device)
{
    int rc;
    if (dmk_missing(ctx, "solver", s, "device", device)) return DMK_E_ARG;
    if (s->device) return dmk_fail(ctx, DMK_E_ARG, "the solver has a device already");
    DMK_TRY(dmk_device_owned(ctx, device));
    if (s->order) DMK_TRY(dmk_memory_check(ctx, device, s->mesh->n_triangles));
    s->device = device;
done:
    return rc;
}

int dmk_solver_begin(dmk_context *ctx, dmk_solver *s, bool density_alone)
{
    if (!s->device) return dmk_fail(ctx, DMK_E_ARG, "the solver has no device yet");
    if (s->spent) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "the solver's mesh was given to it for one solve, and is gone");
    }
    if (s->pieces && !density_alone) {
        return dmk_fail(
            ctx, DMK_E_ARG,
            "of a mesh in pieces there is a density from a point alone: density_only = 1");
    }
    if (s->lean) forget_component(s); /* its right-hand side is another source's */
    return dmk_device_owned(ctx, s->device);
}

void dmk_solver_destroy(dmk_solver **solver)
{
    dmk_solver *s = solver ? *solver : NULL;
    if (!s) return;
    forget_component(s);
    dmk_mesh_destroy(&s->given);
    dmk_pieces_destroy(&s->pieces);
    free(s);
    *solver = NULL;
}

int dmk_solver_give_mesh(dmk_context *ctx, dmk_solver *s, dmk_mesh **mesh)
{
    if (dmk_missing(ctx, "solver", s, "mesh", mesh)) return DMK_E_ARG;
    if (*mesh != s->mesh)
        return dmk_fail(ctx, DMK_E_ARG, "the mesh is not the one that the solver was made for");
    s->given = *mesh;
    *mesh = NULL;
    return DMK_OK;
}

int dmk_solver_set_ranks(dmk_context *ctx, dmk_solver *s, const dmk_ranks *ranks)
{
    if (dmk_missing(ctx, "solver", s)) return DMK_E_ARG;
    if (ranks && dmk_ranks_given(ctx, ranks) != DMK_OK) return DMK_E_ARG;
    if (s->pieces) return dmk_fail(ctx, DMK_E_ARG, "the ranks are those of the mesh's pieces");
    forget_component(s);
    s->ranks = ranks ? *ranks : (dmk_ranks){0};
    return DMK_OK;
}

void dmk_solver_get_traffic(const dmk_solver *s, dmk_traffic *traffic)
{
    if (!traffic) return;
    *traffic = (dmk_traffic){0};
    if (s && s->system && s->system->share) *traffic = s->system->share->traffic;
}

static const dmk_solve_options defaults = {.struct_size = sizeof defaults, .inertia = -1};

void dmk_solve_options_init(dmk_solve_options *options, size_t size)
{
    dmk_options_fill(options, size, &defaults, sizeof defaults);
}

int dmk_solver_take_options(dmk_context *ctx, const dmk_solve_options *given, dmk_solve_options *o)
{
    *o = defaults;
    if (dmk_options_take(ctx, "dmk_solve_options", given, o, sizeof *o) != DMK_OK) return DMK_E_ARG;
    if (!(o->dt >= 0 && o->dt <= 1)) {
        return dmk_fail(ctx, DMK_E_ARG, "dt = %g: expected 0 < dt <= 1", o->dt);
    }
    if (!(o->inertia < 1)) {
        return dmk_fail(ctx, DMK_E_ARG, "inertia = %g: expected 0 <= inertia < 1", o->inertia);
    }
    const double bounds[] = {o->tolerance, o->gap_tolerance, o->cg_tolerance};
    for (size_t i = 0; i < sizeof bounds / sizeof *bounds; i++) {
        if (bounds[i] >= 0 && bounds[i] <= 1) continue;
        return dmk_fail(ctx, DMK_E_ARG, "%s = %g: expected a number from 0 to 1",
                        (const char *[]){"tolerance", "gap_tolerance", "cg_tolerance"}[i],
                        bounds[i]);
    }
    if (!(o->threshold >= 0 && isfinite(o->threshold)))
        return dmk_fail(ctx, DMK_E_ARG, "threshold = %g: expected a finite number from 0",
                        o->threshold);
    if (o->max_steps < 0)
        return dmk_fail(ctx, DMK_E_ARG, "max_steps = %d: expected 0 or more", o->max_steps);
    if ((int)o->method < DMK_NEWTON || o->method > DMK_EULER) {
        return dmk_fail(ctx, DMK_E_ARG, "method = %d: expected a dmk_method", (int)o->method);
    }
    if ((int)o->start < DMK_START_DISTANCE || o->start > DMK_START_UNIFORM) {
        return dmk_fail(ctx, DMK_E_ARG, "start = %d: expected a dmk_start", (int)o->start);
    }
    if (o->density_only != 0 && o->density_only != 1)
        return dmk_fail(ctx, DMK_E_ARG, "density_only = %d: expected 0 or 1", o->density_only);
    if (o->density_only) o->start = DMK_START_UNIFORM;
    return DMK_OK;
}

int dmk_solver_pack(dmk_context *ctx, dmk_solver *s,
                    int (*call)(dmk_context *ctx, void *user, dmk_system *sys), void *user)
{
    const dmk_system_dealt dealt = {.call = call, .user = user, .handed = true};
    const dmk_ground ground = {.mesh = &s->mollified};
    if (s->system) return DMK_OK;
    if (s->ranks.size <= 1) return dmk_system_create(ctx, s->device, &s->mollified, &s->system);
    return dmk_system_deal(ctx, s->device, &ground, &s->ranks, &dealt, &s->system);
}

/* What short rows read of the padding of the elements' parts: a product writes 0 times a row there, and NaN that it
 * leaves is read by what writes the elements alone, in the outer precision. */
static int clear_padding(dmk_context *ctx, const dmk_solver *s)
{
    static const double zero[6 * DMK_WIDTH] = {0};
    const size_t one = 6 * dmk_device_real(s->device, DMK_OUTER);
    return dmk_buffer_write(ctx, s->device, s->system->out_real,
                            one * (size_t)(s->system->n_elements_pad - DMK_WIDTH), one * DMK_WIDTH,
                            zero);
}

int dmk_solver_clear(dmk_context *ctx, const dmk_solver *s)
{
    int rc;
    const size_t bytes = (size_t)s->system->n_rows_pad * sizeof(float);
    DMK_TRY(dmk_system_allocate(ctx, s->system));
    DMK_TRY(clear_padding(ctx, s));
    DMK_TRY(dmk_buffer_clear(ctx, s->device, s->system->x_old, bytes));
    /* Potentials whose bounds are asked for lie there, and f.v has the padding in it. */
    DMK_TRY(
        dmk_buffer_clear(ctx, s->device, s->system->cg[DMK_OUTER].p,
                         (size_t)s->system->n_rows_pad * dmk_device_real(s->device, DMK_OUTER)));
    for (int32_t i = 0; i < s->system->n_levels; i++) {
        const dmk_level *l = &s->system->level[i];
        DMK_TRY(dmk_buffer_clear(ctx, s->device, l->x, (size_t)l->n_pad * sizeof(float)));
        DMK_TRY(dmk_buffer_clear(ctx, s->device, l->x_old, (size_t)l->n_pad * sizeof(float)));
    }
done:
    return rc;
}

int dmk_solver_mark_acl(dmk_context *ctx, const dmk_solver *s, double threshold, const double *mu,
                        const double *u, uint8_t *marked)
{
    int rc;
    const dmk_system *sys = s->system;
    const dmk_acl_input in = {&s->mollified, mu, u + sys->whole.vertex_row, u};
    uint8_t *acl = NULL;
    DMK_TRY(DMK_NEW(ctx, acl, (size_t)sys->whole.n_elements));
    DMK_TRY(dmk_acl_mark(ctx, &in, threshold, acl));
    for (int32_t t = 0; t < sys->whole.n_elements; t++)
        marked[s->order->order.triangle_old[t]] = acl[t];
done:
    free(acl);
    return rc;
}

void dmk_solver_name_steep(const dmk_solver *s, dmk_stats *stats)
{
    for (int k = 0; k < DMK_N_STEEP; k++) {
        const bool none = k >= stats->n_steep; /* or none was looked at */
        stats->steep[k] = none ? -1 : s->order->order.triangle_old[stats->steep[k]];
    }
}

void dmk_solver_scale_stats(const dmk_solver *s, double mass, dmk_stats *stats)
{
    const dmk_system *sys = s->system;
    stats->area = sys->unit * sys->unit;
    stats->cost_upper *= mass * sys->unit;
    stats->cost_lower *= mass * sys->unit;
    stats->levels = sys->n_levels + 1;
    stats->double_precision = dmk_device_real(sys->device, DMK_OUTER) == sizeof(double);
}
