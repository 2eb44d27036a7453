/* Public calls that join rooms. */
#include "cut/cut.h"
#include "geodesic/trace.h"
#include "mesh/mesh.h"
#include "ranks/ranks.h"
#include "solver/result.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int check_mesh(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result)
{
    if (result->n_triangles != (size_t)mesh->n_triangles ||
        result->n_vertices != (size_t)mesh->n_vertices) {
        return dmk_fail(ctx, DMK_E_ARG, "the result belongs to another mesh");
    }
    if (!result->geodesics) {
        return dmk_fail(ctx, DMK_E_ARG, "the result is one of density_only, and has no distance");
    }
    return DMK_OK;
}

static int take_options(dmk_context *ctx, const dmk_locus_options *given, dmk_locus_options *o)
{
    dmk_locus_options_init(o, sizeof *o);
    if (dmk_options_take(ctx, "dmk_locus_options", given, o, sizeof *o) != DMK_OK) return DMK_E_ARG;
    if (o->strength >= 0 && isfinite(o->strength)) return DMK_OK;
    return dmk_fail(ctx, DMK_E_ARG, "strength = %g: expected a finite number from 0", o->strength);
}

int dmk_locus_compute(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                      const dmk_locus_options *options, dmk_locus **locus)
{
    int rc;
    dmk_seam *seam = NULL;
    dmk_locus_options chosen;
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "locus", locus)) return DMK_E_ARG;
    DMK_TRY(take_options(ctx, options, &chosen));
    DMK_TRY(check_mesh(ctx, mesh, result));
    DMK_TRY(dmk_stage_begin(ctx, "locus"));
    DMK_TRY(dmk_locus_trace(ctx, result->geodesics, &chosen, locus, &seam));
    dmk_locus_renumber(*locus, result->order->order.triangle_old, dmk_result_density(result, NULL));
    dmk_result_keep_seam(result, &seam);
done:
    dmk_stage_end(ctx);
    free(seam);
    return rc;
}

/* The points in the order of the component; triangle -1 where they lie outside of it. */
static int renumber_points(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order, size_t n,
                           dmk_point *point)
{
    int32_t *number = NULL;
    int rc = DMK_NEW(ctx, number, (size_t)mesh->n_triangles);
    if (rc != DMK_OK) return rc;
    for (int32_t t = 0; t < mesh->n_triangles; t++) number[t] = -1;
    for (int32_t t = 0; t < order->mesh->n_triangles; t++) number[order->triangle_old[t]] = t;
    for (size_t i = 0; i < n; i++) point[i].triangle = number[point[i].triangle];
    free(number);
    return DMK_OK;
}

/* The one that all sources lie on. */
static int find_component(dmk_context *ctx, const dmk_geodesics *g, int32_t *component)
{
    for (int32_t i = 0; i < g->n_sources; i++) {
        const int32_t own = dmk_mesh_component(g->mesh, (int32_t)g->source[i].point.triangle);
        if (i > 0 && own != *component)
            return dmk_fail(ctx, DMK_E_ARG,
                            "sources 0 and %d lie on two components of the mesh, and a cut locus "
                            "is one component's: trace that of each by itself",
                            i);
        *component = own;
    }
    return DMK_OK;
}

/* The sources' component by itself, in an order of its own: the rules of the locus count in mean edges, which are not
 * to be those of the others. Where it is all of the mesh these are the geodesics that were given, without an order. */
typedef struct part {
    dmk_order order;
    dmk_geodesics *own;
    const dmk_geodesics *geodesics; /* own, or those given */
} part;

static void free_part(part *p)
{
    dmk_geodesics_destroy(&p->own);
    dmk_order_free(&p->order);
}

static int measure_part(dmk_context *ctx, const dmk_geodesics *g, int32_t component, part *p)
{
    int rc;
    dmk_point *source = NULL;
    double *offset = NULL;
    dmk_geodesics_options options;
    const size_t n = (size_t)g->n_sources;
    dmk_geodesics_options_init(&options, sizeof options);
    options.exact = !g->error;
    options.tolerance = g->tolerance;
    DMK_TRY(dmk_order_create(ctx, g->mesh, component, &p->order));
    DMK_TRY(DMK_NEW(ctx, source, n));
    DMK_TRY(DMK_NEW(ctx, offset, n));
    for (size_t i = 0; i < n; i++) {
        source[i] = g->source[i].point;
        offset[i] = g->source[i].offset;
    }
    options.offset = offset;
    DMK_TRY(renumber_points(ctx, g->mesh, &p->order, n, source));
    DMK_TRY(dmk_geodesics_compute(ctx, p->order.mesh, p->order.triangle_old, n, source, &options,
                                  &p->own));
    p->geodesics = p->own;
done:
    free(source);
    free(offset);
    return rc;
}

static int take_part(dmk_context *ctx, const dmk_geodesics *g, part *p)
{
    int rc;
    int32_t component = 0;
    *p = (part){.geodesics = g};
    DMK_TRY(dmk_mesh_check_edges(ctx, g->mesh));
    if (g->n_lines > 0)
        return dmk_fail(ctx, DMK_E_ARG,
                        "the cut locus of lines and borders is not traced: give points as sources");
    DMK_TRY(find_component(ctx, g, &component));
    if (g->mesh->n_components > 1 || g->mesh->info.n_unused_vertices > 0)
        rc = measure_part(ctx, g, component, p);
done:
    return rc;
}

static int trace_part(dmk_context *ctx, const part *p, const dmk_locus_options *chosen,
                      dmk_locus **locus, dmk_seam **seam)
{
    const int rc = dmk_locus_trace(ctx, p->geodesics, chosen, locus, seam);
    if (rc == DMK_OK && p->own) dmk_locus_renumber(*locus, p->order.triangle_old, NULL);
    return rc;
}

int dmk_geodesics_locus(dmk_context *ctx, const dmk_geodesics *geodesics,
                        const dmk_locus_options *options, dmk_locus **locus)
{
    int rc;
    part p = {0};
    dmk_locus_options chosen;
    if (dmk_missing(ctx, "geodesics", geodesics, "locus", locus)) return DMK_E_ARG;
    DMK_TRY(take_options(ctx, options, &chosen));
    DMK_TRY(dmk_stage_begin(ctx, "locus"));
    DMK_TRY(take_part(ctx, geodesics, &p));
    rc = trace_part(ctx, &p, &chosen, locus, NULL);
done:
    dmk_stage_end(ctx);
    free_part(&p);
    return rc;
}

/* n items of rank `from`'s array to all; on the others it is new. */
static int spread(dmk_context *ctx, const dmk_ranks *ranks, int from, size_t n, size_t item,
                  void **array)
{
    int rc;
    if (ranks->rank != from) DMK_TRY(dmk_alloc(ctx, "cut locus", n, item, array));
    rc = dmk_ranks_spread_from(ctx, ranks, from, *array, n * item);
done:
    return rc;
}

int dmk_locus_spread(dmk_context *ctx, const dmk_ranks *ranks, int from, dmk_locus **locus)
{
    int rc;
    dmk_locus *l = NULL;
    if (dmk_missing(ctx, "ranks", ranks, "locus", locus)) return DMK_E_ARG;
    if (dmk_ranks_given(ctx, ranks) != DMK_OK) return DMK_E_ARG;
    if (from < 0 || from >= ranks->size)
        return dmk_fail(ctx, DMK_E_ARG, "from = %d: there are %d ranks", from, ranks->size);
    const bool has_it = ranks->rank == from;
    if (has_it && dmk_missing(ctx, "*locus", *locus)) return DMK_E_ARG;
    if (has_it)
        l = *locus;
    else
        DMK_TRY(DMK_NEW(ctx, l, 1));
    const dmk_locus_info *info = &l->info;
    DMK_TRY(dmk_ranks_spread_from(ctx, ranks, from, &l->info, sizeof l->info));
    DMK_TRY(spread(ctx, ranks, from, info->n_vertices, sizeof *l->vertex, (void **)&l->vertex));
    DMK_TRY(spread(ctx, ranks, from, info->n_edges, sizeof *l->edge, (void **)&l->edge));
    DMK_TRY(
        spread(ctx, ranks, from, info->n_polylines + 1, sizeof *l->offset, (void **)&l->offset));
    rc = spread(ctx, ranks, from, (size_t)l->offset[info->n_polylines], sizeof *l->index,
                (void **)&l->index);
done:
    if (rc == DMK_OK)
        *locus = l;
    else if (!has_it)
        dmk_locus_destroy(&l);
    return rc;
}

/* ---- paths ---------------------------------------------------------------------------------- */

/* The ends of the paths in the order of the component. */
static int renumber_ends(dmk_context *ctx, const dmk_mesh *mesh, const dmk_order *order, size_t n,
                         const dmk_point *to, dmk_point *end)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_point_check(ctx, mesh, "the end of a path", &to[i]));
        end[i] = to[i];
    }
    DMK_TRY(renumber_points(ctx, mesh, order, n, end));
    for (size_t i = 0; i < n; i++) {
        if (end[i].triangle < 0)
            return dmk_fail(
                ctx, DMK_E_ARG,
                "the end of the path in triangle %lld is not on the component of the source: "
                "no path leads there",
                (long long)to[i].triangle);
    }
done:
    return rc;
}

int dmk_path_compute(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
                     size_t n_points, const dmk_point *to, dmk_path *paths)
{
    int rc;
    dmk_point *end = NULL;
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "to", to, "paths", paths))
        return DMK_E_ARG;
    memset(paths, 0, n_points * sizeof *paths);
    DMK_TRY(dmk_stage_begin(ctx, "path"));
    DMK_TRY(check_mesh(ctx, mesh, result));
    const dmk_order *order = &result->order->order;
    DMK_TRY(DMK_NEW(ctx, end, n_points));
    DMK_TRY(renumber_ends(ctx, mesh, order, n_points, to, end));
    DMK_TRY(dmk_tracer_paths(ctx, result->geodesics, n_points, end, paths));
    for (size_t i = 0; i < n_points; i++) {
        for (size_t k = 0; k < paths[i].n; k++) {
            dmk_point *p = &paths[i].point[k];
            p->triangle = order->triangle_old[p->triangle];
        }
    }
done:
    dmk_stage_end(ctx);
    free(end);
    return rc;
}

/* ---- cutting -------------------------------------------------------------------------------- */

/* A disk is all that a cut may give. */
static int check_disk(dmk_context *ctx, const dmk_mesh *cut)
{
    if (dmk_mesh_is_disk(cut)) return DMK_OK;
    return dmk_fail(ctx, DMK_E_MESH,
                    "cutting did not produce a disk: Euler characteristic %lld, %zu border loops, "
                    "%zu components; a finer mesh may help",
                    (long long)cut->info.euler, cut->info.n_border_loops, cut->info.n_components);
}

/* What a cut hands over. */
typedef struct cut_out {
    dmk_mesh **mesh;
    int32_t **origin; /* NULL: not wanted */
    double **plane;   /* NULL: not wanted */
} cut_out;

/* seam: NULL where the locus is still to be traced. */
static int open_disk(dmk_context *ctx, const dmk_geodesics *g, const dmk_seam *seam,
                     const dmk_locus_options *chosen, const dmk_order *order, const cut_out *out)
{
    int rc;
    dmk_mesh *open = NULL;
    int32_t *old = NULL;
    double *flat = NULL;
    DMK_TRY(dmk_stage_begin(ctx, "cut"));
    if (seam)
        DMK_TRY(dmk_seam_cut(ctx, g, seam, order, &open, &old, &flat));
    else
        DMK_TRY(dmk_locus_cut(ctx, g, chosen, order, &open, &old, &flat));
    DMK_TRY(check_disk(ctx, open));
    *out->mesh = open;
    open = NULL;
    if (out->origin) {
        *out->origin = old;
        old = NULL;
    }
    if (out->plane) {
        *out->plane = flat;
        flat = NULL;
    }
done:
    dmk_stage_end(ctx);
    dmk_mesh_destroy(&open);
    free(old);
    free(flat);
    return rc;
}

int dmk_cut(dmk_context *ctx, const dmk_mesh *mesh, const dmk_result *result,
            const dmk_locus_options *options, dmk_mesh **cut, int32_t **origin, double **plane)
{
    int rc;
    dmk_locus_options chosen;
    const cut_out out = {cut, origin, plane};
    if (dmk_missing(ctx, "mesh", mesh, "result", result, "cut", cut)) return DMK_E_ARG;
    DMK_TRY(take_options(ctx, options, &chosen));
    DMK_TRY(check_mesh(ctx, mesh, result));
    const dmk_seam *seam = dmk_result_seam(result);
    if (seam && seam->asked != chosen.strength) seam = NULL;
    rc = open_disk(ctx, result->geodesics, seam, &chosen, &result->order->order, &out);
done:
    return rc;
}

int dmk_geodesics_cut(dmk_context *ctx, const dmk_geodesics *geodesics,
                      const dmk_locus_options *options, dmk_mesh **cut, int32_t **origin,
                      double **plane, dmk_locus **locus)
{
    int rc;
    part p = {0};
    dmk_seam *seam = NULL;
    dmk_locus *line = NULL;
    dmk_locus_options chosen;
    const cut_out out = {cut, origin, plane};
    if (dmk_missing(ctx, "geodesics", geodesics, "cut", cut)) return DMK_E_ARG;
    if (geodesics->n_sources > 1)
        return dmk_fail(ctx, DMK_E_ARG,
                        "the cut locus of %d sources parts the surface: give one source",
                        geodesics->n_sources);
    DMK_TRY(take_options(ctx, options, &chosen));
    DMK_TRY(dmk_stage_begin(ctx, "locus"));
    DMK_TRY(take_part(ctx, geodesics, &p));
    if (locus) DMK_TRY(trace_part(ctx, &p, &chosen, &line, &seam));
    DMK_TRY(open_disk(ctx, p.geodesics, seam, &chosen, p.own ? &p.order : NULL, &out));
    if (locus) *locus = line;
    line = NULL;
done:
    dmk_stage_end(ctx);
    dmk_locus_destroy(&line);
    free(seam);
    free_part(&p);
    return rc;
}

size_t dmk_cut_flipped(const dmk_mesh *cut, const double *plane)
{
    return cut && plane ? dmk_plane_flipped(cut, plane) : 0;
}
