#include "solver/result.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

dmk_shared_order *dmk_shared_order_keep(dmk_shared_order *shared)
{
    atomic_fetch_add(&shared->users, 1);
    return shared;
}

void dmk_shared_order_release(dmk_shared_order **shared)
{
    if (*shared && atomic_fetch_sub(&(*shared)->users, 1) == 1) {
        dmk_order_free(&(*shared)->order);
        free(*shared);
    }
    *shared = NULL;
}

int dmk_result_create(dmk_context *ctx, const dmk_mesh *m, dmk_result **result)
{
    int rc;
    dmk_result *r = NULL;
    DMK_TRY(DMK_NEW(ctx, r, 1));
    r->n_vertices = (size_t)m->n_vertices;
    r->n_triangles = (size_t)m->n_triangles;
    r->n_edges = (size_t)m->n_edges;
    DMK_TRY(DMK_NEW(ctx, r->seam, 1));
    *result = r;
    r = NULL;
done:
    dmk_result_destroy(&r);
    return rc;
}

int dmk_result_allocate(dmk_context *ctx, dmk_result *r, bool with_distance)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, r->density, r->n_triangles));
    if (with_distance) {
        DMK_TRY(DMK_NEW(ctx, r->acl, r->n_triangles));
        DMK_TRY(DMK_NEW(ctx, r->distance, r->n_vertices));
    }
    DMK_TRY(DMK_NEW(ctx, r->potential, r->n_vertices));
    DMK_TRY(DMK_NEW(ctx, r->potential_mid, r->n_edges));
    for (size_t i = 0; i < r->n_vertices; i++) {
        r->potential[i] = -INFINITY;
        if (r->distance) r->distance[i] = INFINITY;
    }
    for (size_t i = 0; i < r->n_edges; i++) {
        r->potential_mid[i] = -INFINITY;
    }
done:
    return rc;
}

/* The source's component in its order, and the geodesics on it. */
static int restore_component(dmk_context *ctx, const dmk_mesh *m, dmk_result *r)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, r->order, 1));
    atomic_init(&r->order->users, 1);
    dmk_order *order = &r->order->order;
    DMK_TRY(dmk_order_create(ctx, m, dmk_mesh_component(m, (int32_t)r->source.triangle), order));
    dmk_point p = r->source;
    while (order->triangle_old[r->source_triangle] != p.triangle) r->source_triangle++;
    p.triangle = r->source_triangle;
    dmk_geodesics_options options;
    dmk_geodesics_options_init(&options, sizeof options);
    DMK_TRY(dmk_stage_begin(ctx, "distance"));
    DMK_TRY(dmk_geodesics_compute(ctx, order->mesh, order->triangle_old, 1, &p, &options,
                                  &r->geodesics));
done:
    dmk_stage_end(ctx);
    return rc;
}

int dmk_result_restore(dmk_context *ctx, const dmk_mesh *m, const dmk_result_data *data,
                       dmk_result **result)
{
    int rc;
    dmk_result *r = NULL;
    if (dmk_missing(ctx, "mesh", m, "data", data, "result", result)) return DMK_E_ARG;
    if (dmk_missing(ctx, "density", data->density, "potential", data->potential, "potential_mid",
                    data->potential_mid)) {
        return DMK_E_ARG;
    }
    const bool with_distance = data->distance || data->acl; /* else it is one of density_only */
    if (with_distance && dmk_missing(ctx, "distance", data->distance, "acl", data->acl)) {
        return DMK_E_ARG;
    }
    DMK_TRY(dmk_point_check(ctx, m, "source", &data->source));
    DMK_TRY(dmk_result_create(ctx, m, &r));
    DMK_TRY(dmk_result_allocate(ctx, r, with_distance));
    memcpy(r->density, data->density, r->n_triangles * sizeof *r->density);
    memcpy(r->potential, data->potential, r->n_vertices * sizeof *r->potential);
    memcpy(r->potential_mid, data->potential_mid, r->n_edges * sizeof *r->potential_mid);
    r->source = data->source;
    r->stats = data->stats;
    if (with_distance) {
        memcpy(r->acl, data->acl, r->n_triangles * sizeof *r->acl);
        memcpy(r->distance, data->distance, r->n_vertices * sizeof *r->distance);
        DMK_TRY(restore_component(ctx, m, r));
    }
    *result = r;
    r = NULL;
done:
    dmk_result_destroy(&r);
    return rc;
}

void dmk_result_destroy(dmk_result **result)
{
    dmk_result *r = result ? *result : NULL;
    if (!r) return;
    free(r->density);
    free(r->acl);
    free(r->potential);
    free(r->distance);
    free(r->potential_mid);
    dmk_geodesics_destroy(&r->geodesics);
    dmk_shared_order_release(&r->order);
    if (r->seam) free(atomic_load(r->seam));
    free(r->seam);
    free(r);
    *result = NULL;
}

void dmk_result_keep_seam(const dmk_result *r, struct dmk_seam **seam)
{
    struct dmk_seam *none = NULL;
    if (atomic_compare_exchange_strong(r->seam, &none, *seam)) *seam = NULL;
}

const struct dmk_seam *dmk_result_seam(const dmk_result *r)
{
    return atomic_load(r->seam);
}

void dmk_result_get_stats(const dmk_result *r, dmk_stats *stats)
{
    if (stats) *stats = r ? r->stats : (dmk_stats){0};
}

const double *dmk_result_density(const dmk_result *r, size_t *n)
{
    return dmk_borrow(r ? r->density : NULL, r ? r->n_triangles : 0, n);
}

const uint8_t *dmk_result_acl(const dmk_result *r, size_t *n)
{
    if (n) *n = r && r->acl ? r->n_triangles : 0;
    return r ? r->acl : NULL;
}

const double *dmk_result_potential(const dmk_result *r, size_t *n)
{
    return dmk_borrow(r ? r->potential : NULL, r ? r->n_vertices : 0, n);
}

const double *dmk_result_potential_mid(const dmk_result *r, size_t *n)
{
    return dmk_borrow(r ? r->potential_mid : NULL, r ? r->n_edges : 0, n);
}

const double *dmk_result_distance(const dmk_result *r, size_t *n)
{
    return dmk_borrow(r ? r->distance : NULL, r ? r->n_vertices : 0, n);
}

void dmk_result_source(const dmk_result *r, dmk_point *source)
{
    if (source) *source = r ? r->source : (dmk_point){.triangle = -1};
}
