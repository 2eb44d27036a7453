/* Writing results and cut loci: what the public accessors give, to a format's writer. */
#include "geodesic/geodesic.h"
#include "io/io.h"

#include "base/vec3.h"

#include <stdlib.h>

int dmk_result_write(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                     const char *path)
{
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "path", path)) return DMK_E_ARG;
    size_t n_mu, n_u;
    dmk_fields f = {.mesh = mesh};
    f.mu = dmk_result_density(result, &n_mu);
    f.acl = dmk_result_acl(result, NULL);
    f.u = dmk_result_potential(result, &n_u);
    f.distance = dmk_result_distance(result, NULL);
    dmk_result_source(result, &f.source);
    if (!f.mu)
        return dmk_fail(ctx, DMK_E_ARG, "the result of a mesh in pieces is the first rank's alone");
    size_t n_triangles = (size_t)mesh->n_triangles, n_vertices = (size_t)mesh->n_vertices;
    if (n_mu != n_triangles || n_u != n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "%s: the result has %zu triangles and %zu vertices, the mesh %zu and %zu: "
                        "pass the mesh that was solved on",
                        path, n_mu, n_u, n_triangles, n_vertices);
    }
    return dmk_fields_write(ctx, &f, path);
}

int dmk_transport_write(dmk_context *ctx, const dmk_mesh *mesh, const dmk_transport *transport,
                        const char *path)
{
    if (dmk_missing(ctx, "mesh", mesh, "transport", transport, "path", path)) return DMK_E_ARG;
    size_t n_mu, n_flux, n_u;
    dmk_fields f = {.mesh = mesh};
    f.mu = dmk_transport_density(transport, &n_mu);
    f.flux = dmk_transport_flux(transport, &n_flux);
    f.u = dmk_transport_potential(transport, &n_u);
    f.acl = dmk_transport_acl(transport, NULL);
    if (n_mu != (size_t)mesh->n_triangles || n_u != (size_t)mesh->n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "%s: the transport has %zu triangles and %zu vertices, the mesh %d and %d: "
                        "pass the mesh that was solved on",
                        path, n_mu, n_u, (int)mesh->n_triangles, (int)mesh->n_vertices);
    }
    return dmk_fields_write(ctx, &f, path);
}

int dmk_geodesics_write(dmk_context *ctx, const dmk_geodesics *g, const char *path)
{
    int rc;
    size_t n;
    double *direction = NULL;
    int32_t *nearest = NULL;
    if (dmk_missing(ctx, "geodesics", g, "path", path)) return DMK_E_ARG;
    const dmk_arrival *arrival = dmk_geodesics_arrivals(g, &n);
    DMK_TRY(DMK_NEW(ctx, direction, n));
    DMK_TRY(DMK_NEW(ctx, nearest, n));
    for (size_t v = 0; v < n; v++) {
        direction[v] = arrival[v].direction;
        nearest[v] = arrival[v].source;
    }
    const dmk_fields f = {
        .mesh = g->mesh, .distance = g->distance, .direction = direction, .nearest = nearest};
    DMK_TRY(dmk_fields_write(ctx, &f, path));
done:
    free(direction);
    free(nearest);
    return rc;
}

int dmk_locus_write(dmk_context *ctx, const dmk_locus *locus, const char *path)
{
    if (dmk_missing(ctx, "locus", locus, "path", path)) return DMK_E_ARG;
    dmk_curves c = {0};
    c.vertex = dmk_locus_vertices(locus, &c.n_vertices);
    c.edge = dmk_locus_edges(locus, &c.n_edges);
    c.index = dmk_locus_polylines(locus, &c.offset, &c.n_polylines);
    return dmk_curves_write(ctx, &c, path);
}

/* The points of a path with their distances along it, joined one after the other. */
static int fill_path(dmk_context *ctx, const dmk_mesh *mesh, const dmk_path *path,
                     dmk_locus_vertex *vertex, dmk_locus_edge *edge, int32_t *index)
{
    for (size_t i = 0; i < path->n; i++) {
        dmk_locus_vertex *v = &vertex[i];
        v->place = path->point[i];
        v->degree = 1; /* of a line, not a point alone */
        index[i] = (int32_t)i;
        int rc = dmk_mesh_point_xyz(ctx, mesh, &v->place, v->xyz);
        if (rc != DMK_OK) return rc;
        if (i == 0) continue;
        v->distance = v[-1].distance + dmk_distance(v[-1].xyz, v->xyz);
        edge[i - 1].vertex[0] = (int32_t)i - 1;
        edge[i - 1].vertex[1] = (int32_t)i;
    }
    return DMK_OK;
}

int dmk_path_write(dmk_context *ctx, const dmk_mesh *mesh, const dmk_path *path, const char *file)
{
    int rc;
    dmk_locus_vertex *vertex = NULL;
    dmk_locus_edge *edge = NULL;
    int32_t *index = NULL;
    if (dmk_missing(ctx, "mesh", mesh, "path", path, "file", file)) return DMK_E_ARG;
    if (path->n < 2 || !path->point) {
        return dmk_fail(ctx, DMK_E_ARG, "the path has %zu points: a line has two or more", path->n);
    }
    const int32_t offset[2] = {0, (int32_t)path->n};
    DMK_TRY(DMK_NEW(ctx, vertex, path->n));
    DMK_TRY(DMK_NEW(ctx, edge, path->n));
    DMK_TRY(DMK_NEW(ctx, index, path->n));
    DMK_TRY(fill_path(ctx, mesh, path, vertex, edge, index));
    const dmk_curves c = {vertex, edge, index, offset, path->n, path->n - 1, 1, true};
    DMK_TRY(dmk_curves_write(ctx, &c, file));
done:
    free(vertex);
    free(edge);
    free(index);
    return rc;
}
