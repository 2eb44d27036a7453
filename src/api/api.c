/* Public calls that join rooms. */
#include "locus/cut.h"
#include "locus/locus.h"
#include "geodesic/trace.h"
#include "mesh/mesh.h"
#include "solver/result.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The results of the source's component, in the order of its compact mesh. */
typedef struct component {
    const dmk_order *order; /* the result's */
    double *distance;       /* order->mesh->n_vertices */
    double *distance_mid;   /* order->mesh->n_edges */
    double *density;        /* order->mesh->n_triangles */
    dmk_locus_input in;     /* of these */
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
    if (result->n_triangles != (size_t)mesh->n_triangles ||
        result->n_vertices != (size_t)mesh->n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG, "the result belongs to another mesh");
    }
    if (!result->geodesics) {
        return dmk_fail(ctx, DMK_E_ARG, "of several ranks only the first one has the distance");
    }
    c->order = &result->order->order;
    const dmk_mesh *m = c->order->mesh;
    DMK_TRY(DMK_NEW(ctx, c->distance, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, c->distance_mid, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, c->density, (size_t)m->n_triangles));
    pick(dmk_result_distance(result, NULL), c->order->vertex_old, m->n_vertices, c->distance);
    pick(dmk_result_distance_mid(result, NULL), c->order->edge_old, m->n_edges, c->distance_mid);
    pick(dmk_result_density(result, NULL), c->order->triangle_old, m->n_triangles, c->density);
    c->in = (dmk_locus_input){m, result->source, c->distance, c->distance_mid, c->density};
    c->in.source.triangle = result->source_triangle; /* corners keep their places: so do the weights */
done:
    return rc;
}

static void component_free(component *c)
{
    free(c->distance);
    free(c->distance_mid);
    free(c->density);
}

static int check_options(dmk_context *ctx, const dmk_locus_options *o)
{
    if (!o || (o->strength >= 0 && isfinite(o->strength))) return DMK_OK;
    return dmk_fail(ctx, DMK_E_ARG, "strength = %g: expected a finite number from 0", o->strength);
}

int dmk_locus_compute(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                      const dmk_locus_options *options, dmk_locus **locus)
{
    int rc;
    component c = {0};
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "locus", locus, NULL)) return DMK_E_ARG;
    DMK_TRY(check_options(ctx, options));
    DMK_TRY(dmk_stage_begin(ctx, "locus"));
    DMK_TRY(component_create(ctx, mesh, result, &c));
    DMK_TRY(dmk_locus_trace(ctx, &c.in, options, locus));
    size_t n;
    dmk_locus_vertex *v = (dmk_locus_vertex *)dmk_locus_vertices(*locus, &n);
    for (size_t i = 0; i < n; i++)
        v[i].place.triangle = c.order->triangle_old[v[i].place.triangle];
done:
    dmk_stage_end(ctx);
    component_free(&c);
    return rc;
}

/* ---- paths ---------------------------------------------------------------------------------- */

/* New number of each triangle of the mesh, -1 outside of the component. */
static int number_triangles(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order,
                            int32_t **number)
{
    int rc = DMK_NEW(ctx, *number, (size_t)mesh->n_triangles);
    if (rc != DMK_OK) return rc;
    for (int32_t t = 0; t < mesh->n_triangles; t++)
        (*number)[t] = -1;
    for (int32_t t = 0; t < order->mesh->n_triangles; t++)
        (*number)[order->triangle_old[t]] = t;
    return DMK_OK;
}

/* The ends of the paths in the order of the component. */
static int renumber_ends(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order, size_t n,
                         const dmk_point *to, dmk_point *end)
{
    int rc;
    int32_t *number = NULL;
    DMK_TRY(number_triangles(ctx, mesh, order, &number));
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_point_check(ctx, mesh, "the end of a path", &to[i]));
        end[i] = to[i];
        end[i].triangle = number[to[i].triangle];
        if (end[i].triangle < 0) {
            rc = dmk_fail(ctx, DMK_E_ARG,
                          "triangle %lld is not on the component of the source: no path leads there",
                          (long long)to[i].triangle);
            goto done;
        }
    }
done:
    free(number);
    return rc;
}

int dmk_path_compute(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                     size_t n_points, const dmk_point *to, dmk_path *paths)
{
    int rc;
    component c = {0};
    dmk_point *end = NULL;
    dmk_tracer *tracer = NULL;
    size_t n = 0;
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "to", to, "paths", paths, NULL)) return DMK_E_ARG;
    memset(paths, 0, n_points * sizeof *paths);
    DMK_TRY(dmk_stage_begin(ctx, "path"));
    DMK_TRY(component_create(ctx, mesh, result, &c));
    DMK_TRY(DMK_NEW(ctx, end, n_points));
    DMK_TRY(renumber_ends(ctx, mesh, c.order, n_points, to, end));
    DMK_TRY(dmk_tracer_create(ctx, result->geodesics, &tracer));
    for (; n < n_points; n++) {
        DMK_TRY(dmk_tracer_path(ctx, tracer, end + n, paths + n));
        DMK_TRY(dmk_poll(ctx));
    }
    for (size_t i = 0; i < n_points; i++) {
        for (size_t k = 0; k < paths[i].n; k++) {
            dmk_point *p = &paths[i].point[k];
            p->triangle = c.order->triangle_old[p->triangle];
        }
    }
done:
    for (size_t i = 0; rc != DMK_OK && i < n; i++) dmk_path_free(paths + i);
    dmk_stage_end(ctx);
    dmk_tracer_destroy(&tracer);
    free(end);
    component_free(&c);
    return rc;
}

/* ---- cutting -------------------------------------------------------------------------------- */

/* Place of each of the component's vertices among them in the input's order. */
static int rank_vertices(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order,
                         int32_t *rank)
{
    int32_t *number = NULL, next = 0;
    int rc = DMK_NEW(ctx, number, (size_t)mesh->n_vertices);
    if (rc != DMK_OK) return rc;
    for (int32_t v = 0; v < mesh->n_vertices; v++)
        number[v] = -1;
    for (int32_t v = 0; v < order->mesh->n_vertices; v++)
        number[order->vertex_old[v]] = v;
    for (int32_t v = 0; v < mesh->n_vertices; v++) {
        if (number[v] >= 0) rank[number[v]] = next++;
    }
    free(number);
    return DMK_OK;
}

/* The cut mesh again, its first vertices, those of the component, in the input's order. */
static int sort_cut(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order,
                    const dmk_mesh *raw, const int32_t *raw_origin, dmk_mesh **cut,
                    int32_t *origin)
{
    int rc;
    const int32_t n_old = order->mesh->n_vertices;
    int32_t *rank = NULL, *triangle = NULL;
    double *xyz = NULL;
    DMK_TRY(DMK_NEW(ctx, rank, (size_t)n_old));
    DMK_TRY(DMK_NEW(ctx, triangle, 3 * (size_t)raw->n_triangles));
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)raw->n_vertices));
    DMK_TRY(rank_vertices(ctx, mesh, order, rank));
    for (int32_t v = 0; v < raw->n_vertices; v++) {
        const int32_t to = v < n_old ? rank[v] : v;
        memcpy(xyz + 3 * (size_t)to, raw->xyz + 3 * (size_t)v, 3 * sizeof *xyz);
        origin[to] = raw_origin[v] < 0 ? -1 : order->vertex_old[raw_origin[v]];
    }
    for (int32_t h = 0; h < 3 * raw->n_triangles; h++) {
        triangle[h] = raw->triangle[h] < n_old ? rank[raw->triangle[h]] : raw->triangle[h];
    }
    rc = dmk_mesh_adopt(ctx, (size_t)raw->n_vertices, xyz, (size_t)raw->n_triangles, triangle, cut);
    xyz = NULL;
    triangle = NULL;
done:
    free(rank);
    free(triangle);
    free(xyz);
    return rc;
}

/* A disk is all that a cut may give. */
static int check_disk(dmk_context *ctx, const dmk_mesh *cut)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(cut, &info);
    if (info.euler == 1 && info.n_border_loops == 1 && info.n_components == 1) return DMK_OK;
    return dmk_fail(ctx, DMK_E_MESH,
                    "cut open the surface is no disk: Euler characteristic %lld, %zu border loops, "
                    "%zu components; a finer mesh may help",
                    (long long)info.euler, info.n_border_loops, info.n_components);
}

int dmk_cut(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
            const dmk_locus_options *options, dmk_mesh **cut, int32_t **origin)
{
    int rc;
    component c = {0};
    dmk_mesh *raw = NULL, *sorted = NULL;
    int32_t *raw_origin = NULL, *sorted_origin = NULL;
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "cut", cut, NULL)) return DMK_E_ARG;
    DMK_TRY(check_options(ctx, options));
    DMK_TRY(dmk_stage_begin(ctx, "cut"));
    DMK_TRY(component_create(ctx, mesh, result, &c));
    DMK_TRY(dmk_locus_cut(ctx, &c.in, options, &raw, &raw_origin));
    DMK_TRY(check_disk(ctx, raw));
    DMK_TRY(DMK_NEW(ctx, sorted_origin, (size_t)raw->n_vertices));
    DMK_TRY(sort_cut(ctx, mesh, c.order, raw, raw_origin, &sorted, sorted_origin));
    *cut = sorted;
    sorted = NULL;
    if (origin) {
        *origin = sorted_origin;
        sorted_origin = NULL;
    }
done:
    dmk_stage_end(ctx);
    dmk_mesh_destroy(&raw);
    dmk_mesh_destroy(&sorted);
    free(raw_origin);
    free(sorted_origin);
    component_free(&c);
    return rc;
}
