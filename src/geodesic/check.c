/* What must hold of every distance. */
#include "geodesic/geodesic.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>

typedef struct audit {
    const dmk_geodesics *g;
    const bool *component; /* has a source */
    double slack;
} audit;

/* Whether no source reaches a corner of triangle t, though one lies in its component; or a corner has a distance below
 * zero, or none. */
static bool bad_triangle(int32_t t, void *data)
{
    const audit *a = data;
    const dmk_mesh *m = a->g->mesh;
    for (int k = 0; k < 3; k++) {
        const double d = a->g->distance[m->triangle[3 * (size_t)t + (size_t)k]];
        if (!(d >= 0) || (a->component[dmk_mesh_component(m, t)] && d == INFINITY)) return true;
    }
    return false;
}

static double violation(const audit *a, int32_t e)
{
    const int32_t *v = a->g->mesh->edge_vertex + 2 * (size_t)e;
    const double x = a->g->distance[v[0]], y = a->g->distance[v[1]], *error = a->g->error;
    double excess = fabs(x - y) - a->g->mesh->length[e] - (error ? error[v[0]] + error[v[1]] : 0);
    return x == y ? -1 : excess; /* both may be infinite */
}

static bool bad_edge(int32_t e, void *data)
{
    const audit *a = data;
    return violation(a, e) > a->slack;
}

static int name_triangle(dmk_context *ctx, const dmk_geodesics *g, int32_t t)
{
    for (int k = 0; k < 3; k++) {
        const int32_t v = g->mesh->triangle[3 * (size_t)t + (size_t)k];
        if (g->distance[v] >= 0 && g->distance[v] < INFINITY) continue;
        return dmk_fail(ctx, DMK_E_MESH,
                        g->distance[v] == INFINITY
                            ? "no path reached vertex %d, which is joined to a source: "
                              "this is an error of the program, please report the mesh"
                            : "the distance of vertex %d is negative: this is an error of the "
                              "program, please report the mesh",
                        v);
    }
    return DMK_OK;
}

/* Over the mesh's extent. With offsets of 1e9 distances are off by what rounds a number of their size, of 1e11 by six
 * times as much, and of 1e13 windows end early and leave vertices out. */
static const double most_offset = 1e9;

/* Large offsets do no harm where a nearer source reaches all. */
int dmk_geodesics_check_offsets(dmk_context *ctx, const dmk_geodesics *g)
{
    int rc;
    bool *near = NULL;
    const dmk_mesh *m = g->mesh;
    DMK_TRY(DMK_NEW(ctx, near, (size_t)m->n_components));
    for (size_t i = 0; i < g->n_lines; i++) near[dmk_mesh_component(m, g->line[i] / 3)] = true;
    for (int32_t i = 0; i < g->n_sources; i++) {
        const dmk_site *p = g->source + i;
        if (p->offset <= most_offset * g->star.unit)
            near[dmk_mesh_component(m, (int32_t)p->point.triangle)] = true;
    }
    for (int32_t i = 0; i < g->n_sources && rc == DMK_OK; i++) {
        const dmk_site *p = g->source + i;
        if (near[dmk_mesh_component(m, (int32_t)p->point.triangle)]) continue;
        rc = dmk_fail(
            ctx, DMK_E_ARG,
            "source %d has the offset %g, and no source of its component has one below %g, "
            "%g times the mesh's extent: distances of that size have no digits left for "
            "the mesh; subtract the least offset from all, and add it to the distances",
            i, p->offset, most_offset * g->star.unit, most_offset);
    }
done:
    free(near);
    return rc;
}

int dmk_geodesics_check(dmk_context *ctx, const dmk_geodesics *g)
{
    int rc;
    bool *component = NULL;
    const dmk_mesh *m = g->mesh;
    audit a = {.g = g, .slack = 0};
    DMK_TRY(DMK_NEW(ctx, component, (size_t)m->n_components));
    a.component = component;
    for (size_t i = 0; i < g->n_lines; i++) component[dmk_mesh_component(m, g->line[i] / 3)] = true;
    for (int32_t i = 0; i < g->n_sources; i++)
        component[dmk_mesh_component(m, (int32_t)g->source[i].point.triangle)] = true;
    int32_t t = dmk_parallel_first(ctx, m->n_triangles, bad_triangle, &a);
    if (t >= 0) {
        rc = name_triangle(ctx, g, t);
        goto done;
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        if (g->distance[v] < INFINITY) a.slack = dmk_max(a.slack, 1e-11 * g->distance[v]);
    }
    int32_t e = dmk_parallel_first(ctx, m->n_edges, bad_edge, &a);
    if (e >= 0) {
        rc = dmk_fail(ctx, DMK_E_MESH,
                      "the distances of vertices %d and %d differ by %g more than their edge is "
                      "long: this is an "
                      "error of the program, please report the mesh",
                      m->edge_vertex[2 * (size_t)e], m->edge_vertex[2 * (size_t)e + 1],
                      violation(&a, e));
    }
done:
    free(component);
    return rc;
}
