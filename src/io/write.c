/* Writing results and cut loci: what the public accessors give, to a format's writer. */
#include "io/io.h"

int dmk_result_write(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                     const char *path)
{
    if (!mesh || !result || !path) {
        return dmk_fail(ctx, DMK_E_ARG, "no mesh, no result or no path to write to");
    }
    size_t n_mu, n_acl, n_u, n_distance;
    dmk_fields f = {.mesh = mesh};
    f.mu = dmk_result_density(result, &n_mu);
    f.acl = dmk_result_acl(result, &n_acl);
    f.u = dmk_result_potential(result, &n_u);
    f.distance = dmk_result_distance(result, &n_distance);
    dmk_result_source(result, &f.source);
    size_t n_triangles = (size_t)mesh->n_triangles, n_vertices = (size_t)mesh->n_vertices;
    if (n_mu != n_triangles || n_acl != n_triangles || n_u != n_vertices ||
        n_distance != n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "%s: the result has %zu triangles and %zu vertices, the mesh %zu and %zu: "
                        "pass the mesh that was solved on", path, n_mu, n_u, n_triangles,
                        n_vertices);
    }
    return dmk_fields_write(ctx, &f, path);
}

int dmk_locus_write(dmk_context *ctx, const dmk_locus *locus, const char *path)
{
    if (!locus || !path) return dmk_fail(ctx, DMK_E_ARG, "no cut locus or no path to write to");
    dmk_curves c = {0};
    c.vertex = dmk_locus_vertices(locus, &c.n_vertices);
    c.edge = dmk_locus_edges(locus, &c.n_edges);
    c.index = dmk_locus_polylines(locus, &c.offset, &c.n_polylines);
    return dmk_curves_write(ctx, &c, path);
}
