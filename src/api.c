/* Public calls that join rooms. */
#include "locus/locus.h"
#include "mesh/mesh.h"
#include "solver/result.h"

#include <stdlib.h>

/* The results of the source's component, in the order of its compact mesh. */
typedef struct component {
    const dmk_order *order; /* the result's */
    double *distance;       /* order->mesh->n_vertices */
    double *distance_mid;   /* order->mesh->n_edges */
    double *density;        /* order->mesh->n_triangles */
    dmk_point source;
} component;

static void pick(const double *from, const int32_t *old, int32_t n, double *to)
{
    for (int32_t i = 0; i < n; i++)
        to[i] = from[old[i]];
}

static int component_create(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                            component *c)
{
    int rc;
    dmk_result_source(result, &c->source);
    if (result->n_triangles != (size_t)mesh->n_triangles ||
        result->n_vertices != (size_t)mesh->n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG, "the result belongs to another mesh");
    }
    c->order = &result->order->order;
    const dmk_mesh *m = c->order->mesh;
    DMK_TRY(DMK_NEW(ctx, c->distance, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, c->distance_mid, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, c->density, (size_t)m->n_triangles));
    pick(dmk_result_distance(result, NULL), c->order->vertex_old, m->n_vertices, c->distance);
    pick(dmk_result_distance_mid(result, NULL), c->order->edge_old, m->n_edges, c->distance_mid);
    pick(dmk_result_density(result, NULL), c->order->triangle_old, m->n_triangles, c->density);
    c->source.triangle = result->source_triangle; /* corners keep their places, so the weights stay */
done:
    return rc;
}

static void component_free(component *c)
{
    free(c->distance);
    free(c->distance_mid);
    free(c->density);
}

int dmk_locus_compute(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                      const dmk_locus_options *options, dmk_locus **locus)
{
    int rc;
    component c = {0};
    DMK_TRY(component_create(ctx, mesh, result, &c));
    const dmk_locus_input in = {c.order->mesh, c.source, c.distance, c.distance_mid, c.density};
    DMK_TRY(dmk_locus_trace(ctx, &in, options, locus));
    size_t n;
    dmk_locus_vertex *v = (dmk_locus_vertex *)dmk_locus_vertices(*locus, &n);
    for (size_t i = 0; i < n; i++)
        v[i].place.triangle = c.order->triangle_old[v[i].place.triangle];
done:
    component_free(&c);
    return rc;
}
