/* dmk_mesh_surface: a coarse mesh of a built-in surface, then refinement. */
#include "surfaces/refine.h"
#include "surfaces/relax.h"
#include "surfaces/remesh.h"
#include "surfaces/surface.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static dmk_surface_options defaults(void)
{
    return (dmk_surface_options){.struct_size = sizeof(dmk_surface_options),
                                 .name = dmk_surface_name(0)};
}

void dmk_surface_options_init(dmk_surface_options *options, size_t size)
{
    const dmk_surface_options all = defaults();
    dmk_options_fill(options, size, &all, sizeof all);
}

static int find_surface(dmk_context *ctx, const char *name, const dmk_surface **surface)
{
    char known[256] = "";
    for (size_t i = 0; dmk_surface_get(i); i++) {
        const dmk_surface *s = dmk_surface_get(i);
        if (name && !strcmp(name, s->name)) {
            *surface = s;
            return DMK_OK;
        }
        strncat(known, i ? ", " : "", sizeof known - strlen(known) - 1);
        strncat(known, s->name, sizeof known - strlen(known) - 1);
    }
    return dmk_fail(ctx, DMK_E_ARG, "there is no surface '%s'; choose one of %s", name ? name : "",
                    known);
}

static int choose_sizes(dmk_context *ctx, const dmk_surface_options *o, dmk_body *body)
{
    const dmk_surface *s = body->surface;
    for (int i = 0; i < 3; i++) {
        double size = o->size[i];
        if (size != 0 && !(s->size[i] > 0)) {
            return dmk_fail(ctx, DMK_E_ARG, "the %s has no size %c; leave it 0", s->name, 'a' + i);
        }
        if (!(size >= 1e-6 && size <= 1e6) && size != 0) {
            return dmk_fail(ctx, DMK_E_ARG,
                            "size %c of the %s is %g; it must lie between 1e-6 and 1e6", 'a' + i,
                            s->name, size);
        }
        body->size[i] = size != 0 ? size : s->size[i];
    }
    const char *wrong = s->check ? s->check(body->size) : NULL;
    if (wrong) {
        return dmk_fail(ctx, DMK_E_ARG, "%s with sizes %g, %g: %s", s->name, body->size[0],
                        body->size[1], wrong);
    }
    return DMK_OK;
}

/* How many vertices: V = F / 2 + euler, F even. */
static int choose_count(dmk_context *ctx, const dmk_surface_options *o, const dmk_body *body,
                        const dmk_patch *start, int32_t *n_vertices)
{
    const size_t limit = DMK_MOST_TRIANGLES;
    const dmk_surface *s = body->surface;
    size_t n = o->n_triangles ? o->n_triangles : (size_t)s->n_triangles;
    if (n < (size_t)start->n_triangles) {
        return dmk_fail(ctx, DMK_E_ARG, "this %s takes at least %d triangles, not %zu", s->name,
                        start->n_triangles, n);
    }
    if (o->refine < 0 || o->refine > 12 || n > limit >> 2 * o->refine) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "%zu triangles refined %d times: the refinement must be 0 or more, and the "
                        "result have at most %zu triangles",
                        n, o->refine, limit);
    }
    n += n % 2;
    *n_vertices = (int32_t)(n / 2) + s->euler;
    return DMK_OK;
}

static int lift_source(dmk_context *ctx, const dmk_surface_options *o, const dmk_body *body,
                       double source[3])
{
    memcpy(source, o->source, sizeof o->source);
    if (isfinite(source[0]) && isfinite(source[1]) && isfinite(source[2]) &&
        dmk_body_nearest(body, source)) {
        return DMK_OK;
    }
    return dmk_fail(ctx, DMK_E_ARG,
                    "the source (%g, %g, %g) cannot be lifted to the %s: no direction leads there; "
                    "give a point on or near the surface",
                    o->source[0], o->source[1], o->source[2], body->surface->name);
}

/* Exchange the numbers of vertex 0 and v. */
static void number_first(dmk_mesh *m, int32_t v, double *xyz, int32_t *triangle)
{
    memcpy(xyz, m->xyz, 3 * (size_t)m->n_vertices * sizeof *xyz);
    memcpy(xyz, m->xyz + 3 * v, 3 * sizeof *xyz);
    memcpy(xyz + 3 * v, m->xyz, 3 * sizeof *xyz);
    for (int32_t i = 0; i < 3 * m->n_triangles; i++) {
        int32_t old = m->triangle[i];
        triangle[i] = old == v ? 0 : old == 0 ? v : old;
    }
}

/* The grown triangulation as a mesh in an order that keeps neighbours near, `first` as vertex 0. */
static int order_mesh(dmk_context *ctx, const dmk_halfedge *h, int32_t first, dmk_mesh **mesh)
{
    int rc;
    dmk_mesh *raw = NULL;
    dmk_order order = {0};
    double *xyz = NULL;
    int32_t *triangle = NULL, v = 0;
    DMK_TRY(dmk_mesh_create(ctx, (size_t)h->n_vertices, h->xyz, (size_t)h->n_triangles, h->triangle,
                            &raw));
    DMK_TRY(dmk_order_create(ctx, raw, 0, &order));
    while (first >= 0 && order.vertex_old[v] != first) v++;
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)h->n_vertices));
    DMK_TRY(DMK_NEW(ctx, triangle, 3 * (size_t)h->n_triangles));
    number_first(order.mesh, v, xyz, triangle);
    rc = dmk_mesh_adopt(ctx, (size_t)h->n_vertices, xyz, (size_t)h->n_triangles, triangle, mesh);
    xyz = NULL;
    triangle = NULL;
done:
    free(xyz);
    free(triangle);
    dmk_order_free(&order);
    dmk_mesh_destroy(&raw);
    return rc;
}

static int coarse_mesh(dmk_context *ctx, const dmk_surface_options *o, const dmk_body *body,
                       dmk_mesh **mesh)
{
    int rc;
    dmk_patch start = {0};
    dmk_halfedge half = {0};
    double source[3];
    int32_t n_vertices = 0, first = -1;
    if (o->has_source) DMK_TRY(lift_source(ctx, o, body, source));
    DMK_TRY(body->surface->start(ctx, body, &start));
    DMK_TRY(choose_count(ctx, o, body, &start, &n_vertices));
    DMK_TRY(dmk_halfedge_create(ctx, start.n_vertices, start.xyz, start.n_triangles, start.triangle,
                                n_vertices, &half));
    DMK_TRY(dmk_remesh(ctx, body, n_vertices, o->has_source ? source : NULL, &half, &first));
    DMK_TRY(order_mesh(ctx, &half, first, mesh));
done:
    free(start.xyz);
    free(start.triangle);
    dmk_halfedge_free(&half);
    return rc;
}

static void lift(const void *body, double xyz[3])
{
    dmk_body_lift(body, xyz);
}

static bool is_turned(const dmk_body *body, const dmk_mesh *m)
{
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * (size_t)t;
        if (dmk_relax_facing(body, m->xyz + 3 * (size_t)v[0], m->xyz + 3 * (size_t)v[1],
                             m->xyz + 3 * (size_t)v[2]) <= 0)
            return true;
    }
    return false;
}

/* Over a rim much sharper than the edges are long the lifted midpoints fold the surface, however many triangles there
 * are: then as many are made at once, which are relaxed. */
static int refine_mesh(dmk_context *ctx, dmk_surface_options *o, const dmk_body *body,
                       dmk_mesh **mesh)
{
    int rc = DMK_OK;
    for (int level = 0; level < o->refine; level++) {
        dmk_mesh *fine = NULL;
        DMK_TRY(dmk_mesh_refine(ctx, *mesh, lift, body, &fine));
        dmk_mesh_destroy(mesh);
        *mesh = fine;
    }
    if (o->refine == 0 || !is_turned(body, *mesh)) return DMK_OK;
    o->n_triangles = (size_t)(*mesh)->n_triangles;
    o->refine = 0;
    dmk_mesh_destroy(mesh);
    rc = coarse_mesh(ctx, o, body, mesh);
done:
    return rc;
}

int dmk_mesh_surface(dmk_context *ctx, const dmk_surface_options *options, dmk_mesh **mesh)
{
    int rc;
    dmk_body body = {0};
    dmk_mesh *now = NULL;
    dmk_surface_options chosen = defaults(), *o = &chosen;
    if (dmk_missing(ctx, "options", options, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_options_take(ctx, "dmk_surface_options", options, o, sizeof *o));
    DMK_TRY(find_surface(ctx, o->name, &body.surface));
    DMK_TRY(choose_sizes(ctx, o, &body));
    DMK_TRY(coarse_mesh(ctx, o, &body, &now));
    DMK_TRY(refine_mesh(ctx, o, &body, &now));
    *mesh = now;
    now = NULL;
done:
    dmk_mesh_destroy(&now);
    return rc;
}
