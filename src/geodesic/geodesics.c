/* The object: see geodesic.h. */
#include "geodesic/geodesic.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int set_sources(dmk_context *ctx, dmk_geodesics *g, size_t n, const dmk_point *point,
                       const double *offset)
{
    int rc = DMK_OK;
    DMK_TRY(DMK_NEW(ctx, g->source, n));
    for (size_t i = 0; i < n; i++) {
        double o = offset ? offset[i] : 0;
        if (!(o >= 0 && o < HUGE_VAL)) {
            rc =
                dmk_fail(ctx, DMK_E_ARG,
                         "source %zu has the offset %g: expected a finite number, 0 or more", i, o);
            goto done;
        }
        DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, point + i, o, g->source + i));
        g->n_sources++;
    }
done:
    return rc;
}

int dmk_geodesics_create(dmk_context *ctx, const dmk_mesh *mesh, size_t n_sources,
                         const dmk_point *source, const double *offset, dmk_geodesics **geodesics)
{
    int rc;
    dmk_geodesics *g = NULL;
    DMK_TRY(DMK_NEW(ctx, g, 1));
    g->mesh = mesh;
    DMK_TRY(DMK_NEW(ctx, g->distance, (size_t)mesh->n_vertices));
    DMK_TRY(DMK_NEW(ctx, g->arrival, (size_t)mesh->n_vertices));
    DMK_TRY(dmk_star_create(ctx, mesh, &g->star));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(set_sources(ctx, g, n_sources, source, offset));
    DMK_TRY(dmk_windows_run(ctx, g));
    *geodesics = g;
    g = NULL;
done:
    dmk_geodesics_destroy(&g);
    return rc;
}

void dmk_geodesics_destroy(dmk_geodesics **geodesics)
{
    dmk_geodesics *g = *geodesics;
    if (!g) return;
    for (int32_t i = 0; i < g->n_sources; i++)
        dmk_site_free(g->source + i);
    free(g->source);
    free(g->distance);
    free(g->arrival);
    free(g->error);
    dmk_star_free(&g->star);
    free(g);
    *geodesics = NULL;
}

/* From vertex v straight to what lies at the distance r in direction `angle` of its chart, seen
 * from the last bend. */
static double beyond(const dmk_geodesics *g, int32_t v, double angle, double r)
{
    const dmk_arrival *a = g->arrival + v;
    if (a->source < 0) return HUGE_VAL;
    double base =
        a->pseudo_source >= 0 ? g->distance[a->pseudo_source] : g->source[a->source].offset;
    double turn = fabs(angle - a->back), straight = g->distance[v] - base;
    if (!g->star.border[v]) turn = fmin(turn, g->star.total[v] - turn);
    return base + hypot(straight - r * cos(turn), r * sin(turn));
}

void dmk_geodesics_midpoints(const dmk_geodesics *g, double *mid)
{
    const dmk_mesh *m = g->mesh;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        int32_t e = m->triangle_edge[h], from = dmk_next(h), to = dmk_previous(h);
        if (m->edge_triangle[2 * (size_t)e] != h / 3) continue;
        double r = 0.5 * m->length[e];
        mid[e] = fmin(beyond(g, m->triangle[from], g->star.angle[from], r),
                      beyond(g, m->triangle[to], g->star.angle[to] + g->star.corner_angle[to], r));
    }
}
