/* The object: see geodesic.h. */
#include "geodesic/front.h"
#include "geodesic/trace.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const dmk_geodesics_options defaults = {.struct_size = sizeof defaults};

void dmk_geodesics_options_init(dmk_geodesics_options *options, size_t size)
{
    dmk_options_fill(options, size, &defaults, sizeof defaults);
}

static int check_options(dmk_context *ctx, const dmk_mesh *m, size_t n_sources,
                         const dmk_geodesics_options *o)
{
    if (n_sources + o->n_lines == 0 && !(o->border && m->n_border_edges > 0))
        return dmk_fail(ctx, DMK_E_ARG,
                        o->border ? "no source: the mesh is closed and has no border; give a point "
                                    "or line"
                                  : "no source: one point or line at least");
    if (n_sources > INT32_MAX / 2)
        return dmk_fail(ctx, DMK_E_ARG, "%zu sources are too many", n_sources);
    for (size_t i = 0; o->offset && i < n_sources; i++) {
        if (o->offset[i] >= 0 && o->offset[i] < INFINITY) continue;
        return dmk_fail(ctx, DMK_E_ARG,
                        "source %zu has the offset %g: expected a finite number, 0 or more", i,
                        o->offset[i]);
    }
    if (!(o->tolerance >= 0 && o->tolerance <= 0.01)) {
        return dmk_fail(ctx, DMK_E_ARG, "tolerance = %g: expected 0 to 0.01", o->tolerance);
    }
    if (o->n_lines > 0 && !o->line)
        return dmk_fail(ctx, DMK_E_ARG, "line is NULL, but n_lines is %zu", o->n_lines);
    for (size_t i = 0; i < 2 * o->n_lines; i++) {
        if (o->line[i] >= 0 && o->line[i] < m->n_vertices) continue;
        return dmk_fail(ctx, DMK_E_ARG, "line %zu: vertex %d is out of range [0, %d]", i / 2,
                        o->line[i], m->n_vertices - 1);
    }
    return DMK_OK;
}

static int set_sources(dmk_context *ctx, dmk_geodesics *g, size_t n, const dmk_point *point,
                       const double *offset)
{
    int rc = DMK_OK;
    DMK_TRY(DMK_NEW(ctx, g->source, n));
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_site_create(ctx, g->mesh, &g->star, point + i, offset ? offset[i] : 0,
                                g->source + i));
        g->n_sources++;
    }
done:
    return rc;
}

/* The half-edge from vertex a to b, or -1. */
static int32_t find_half(const dmk_geodesics *g, int32_t a, int32_t b)
{
    const dmk_star *s = &g->star;
    int32_t c = s->first[a];
    while (c >= 0) {
        if (g->mesh->triangle[dmk_next(c)] == b) return dmk_previous(c);
        c = dmk_star_next(s, c);
        if (c == s->first[a]) break;
    }
    return -1;
}

/* Half-edge h and its twin. */
static void add_line(dmk_geodesics *g, int32_t h)
{
    g->line[g->n_lines++] = h;
    if (g->star.twin[h] >= 0) g->line[g->n_lines++] = g->star.twin[h];
}

static int set_lines(dmk_context *ctx, dmk_geodesics *g, const dmk_geodesics_options *o)
{
    size_t n_border = o->border ? (size_t)g->mesh->n_border_edges : 0;
    int rc = DMK_NEW(ctx, g->line, 2 * (o->n_lines + n_border));
    if (rc != DMK_OK) return rc;
    for (size_t i = 0; i < o->n_lines; i++) {
        int32_t a = o->line[2 * i], b = o->line[2 * i + 1], h = find_half(g, a, b);
        if (h < 0) h = find_half(g, b, a);
        if (h < 0)
            return dmk_fail(ctx, DMK_E_ARG, "line %zu: no edge joins vertices %d and %d", i, a, b);
        add_line(g, h);
    }
    for (int32_t h = 0; n_border > 0 && h < 3 * g->mesh->n_triangles; h++) {
        if (g->star.twin[h] < 0) add_line(g, h);
    }
    dmk_lines_sort(g);
    return DMK_OK;
}

static const double usual_tolerance = 1e-6;

static double tolerance_of(const dmk_mesh *m, const dmk_geodesics_options *o)
{
    if (o->exact) return 0;
    if (o->tolerance > 0) return o->tolerance;
    return m->n_triangles > DMK_EXACT_TRIANGLES ? usual_tolerance : 0;
}

/* What may be tried for the distances: exact windows, as many as usual or far more of them; trimmed windows, that is
 * merged ones without a tolerance, exact or with estimates of their errors; merged ones with the tolerance asked for,
 * or the usual one. In the order in which they are tried. */
typedef enum attempt { ASKED, EXACT, TRIMMED, MORE, ESTIMATED, MERGED } attempt;

/* Rough terrain a hundred times as high as its edges are long needs up to 7,000 windows for each edge, where other
 * meshes need a hundred, and a million times as high 87,000, a sixth of its triangles' aspect; around needles and on
 * thin tubes there may be a million times as many, of ways that hardly differ. There trimmed windows are better, which
 * are compared with each other: 35 looks for each half-edge are enough on meshes of all kinds but terrain, which has up
 * to 1,000. On spikes a billion times as high as wide, ways that wind around them differ less than what rounding
 * leaves, and there is no end to either. */
enum { MORE_WINDOWS = 10000, SOME_LOOKS = 100, MOST_LOOKS = 1000 };
/* Over the largest distance: what estimates of trimmed windows may be for distances that are called exact, at first and
 * where exact windows are too many. Needles and tubes have 1e-13, a few 1e-11; on terrain estimates may be 400 times
 * too small. */
static const double surely_exact = 1e-12, still_exact = 1e-10;

/* The mean of longest side over height. */
static double mean_aspect(const dmk_geodesics *g)
{
    const dmk_mesh *m = g->mesh;
    const double scale = 1 / g->star.unit;
    double sum = 0, area2, dot[3];
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double longest = 0;
        for (int k = 0; k < 3; k++)
            longest = dmk_max(longest, m->length[m->triangle_edge[3 * (size_t)t + (size_t)k]]);
        dmk_measure_corners(m, scale, t, &area2, dot);
        sum += longest * scale * longest * scale / area2;
    }
    return sum / m->n_triangles;
}

/* For each edge. Who wants nothing else than exact distances waits for as many as a mesh of its aspect may need. The
 * two ways around a spike differ by the square of width over height, which must not be the same length. */
static double more_windows(const dmk_geodesics *g, bool exact)
{
    const double aspect = exact ? mean_aspect(g) : 0;
    return aspect * aspect * DMK_SAME_LENGTH < 1 ? dmk_max(MORE_WINDOWS, aspect) : MORE_WINDOWS;
}

static int start(dmk_context *ctx, dmk_geodesics *g, attempt how, const dmk_geodesics_options *o,
                 bool *finished)
{
    g->tolerance = how == MERGED ? usual_tolerance : how == ASKED ? g->asked : 0;
    /* Where others may do better, an attempt ends when more vertices miss the tolerance than can be mended. */
    const int over = how == ASKED ? DMK_MOST_REPAIRS : INT_MAX;
    if (how == ASKED || how == ESTIMATED || how == MERGED)
        return dmk_waves_run(ctx, g, g->tolerance, still_exact, MOST_LOOKS, over, finished);
    if (how == TRIMMED) return dmk_waves_run(ctx, g, 0, surely_exact, SOME_LOOKS, over, finished);
    const int64_t most = how == MORE ? (int64_t)(more_windows(g, o->exact) * g->mesh->n_edges)
                                     : dmk_windows_usual(g->mesh);
    return dmk_windows_run(ctx, g, most, finished);
}

/* *finished: whether there are distances, as exact as the attempt promises. */
static int try_one(dmk_context *ctx, dmk_geodesics *g, attempt how, const dmk_geodesics_options *o,
                   bool *finished)
{
    int rc;
    bool few = true;
    *finished = false;
    free(g->error);
    g->error = NULL;
    free(g->tie);
    g->tie = NULL;
    g->n_ties = 0;
    DMK_TRY(start(ctx, g, how, o, finished));
    if (*finished && g->tolerance > 0) DMK_TRY(dmk_tracer_repair(ctx, g, &few));
    if (how == TRIMMED && g->error) *finished = false;
    if (how == ASKED && !few) *finished = false;
    if (*finished) rc = dmk_geodesics_check(ctx, g);
done:
    return rc;
}

static int refuse(dmk_context *ctx, const dmk_geodesics *g, bool exact)
{
    const double *angle = g->star.corner_angle;
    int32_t least = 0;
    for (int32_t h = 1; h < 3 * g->mesh->n_triangles; h++)
        if (angle[h] < angle[least]) least = h;
    return dmk_fail(ctx, DMK_E_MESH,
                    "paths wind around the mesh's spikes without end: %s its "
                    "worst triangles; its smallest angle is %.2g degrees, in triangle %d",
                    exact ? "do not ask for exact distances, or improve" : "improve",
                    angle[least] * DMK_DEGREES, least / 3);
}

/* One attempt after the other until one succeeds. A result that fails a check is none: scans cut 1:16, whose new
 * vertices are flat, with merged windows; triangles of 1e-8 of their height with exact ones. */
static int run(dmk_context *ctx, dmk_geodesics *g, const dmk_geodesics_options *o)
{
    bool finished = false;
    int rc = DMK_OK;
    g->asked = tolerance_of(g->mesh, o);
    for (attempt how = g->asked > 0 ? ASKED : EXACT; how <= (o->exact ? ESTIMATED : MERGED);
         how++) {
        rc = try_one(ctx, g, how, o, &finished);
        finished = finished && !(o->exact && g->error);
        if (rc == DMK_OK ? finished : rc != DMK_E_MESH) return rc;
    }
    return rc == DMK_OK ? refuse(ctx, g, o->exact) : rc;
}

int dmk_geodesics_prepare(dmk_context *ctx, const dmk_mesh *mesh, const int32_t *old,
                          size_t n_sources, const dmk_point *source,
                          const dmk_geodesics_options *options, dmk_geodesics **geodesics)
{
    int rc;
    dmk_geodesics *g = NULL;
    DMK_TRY(DMK_NEW(ctx, g, 1));
    g->mesh = mesh;
    DMK_TRY(DMK_NEW_UNSET(ctx, g->distance, (size_t)mesh->n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, g->arrival, (size_t)mesh->n_vertices));
    DMK_TRY(dmk_star_create(ctx, mesh, old, &g->star));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(set_sources(ctx, g, n_sources, source, options->offset));
    DMK_TRY(set_lines(ctx, g, options));
    *geodesics = g;
    g = NULL;
done:
    dmk_geodesics_destroy(&g);
    return rc;
}

int dmk_geodesics_compute(dmk_context *ctx, const dmk_mesh *mesh, const int32_t *old,
                          size_t n_sources, const dmk_point *source,
                          const dmk_geodesics_options *options, dmk_geodesics **geodesics)
{
    int rc;
    dmk_geodesics *g = NULL;
    DMK_TRY(dmk_geodesics_prepare(ctx, mesh, old, n_sources, source, options, &g));
    DMK_TRY(dmk_geodesics_check_offsets(ctx, g));
    DMK_TRY(run(ctx, g, options));
    *geodesics = g;
    g = NULL;
done:
    dmk_geodesics_destroy(&g);
    return rc;
}

int dmk_geodesics_create(dmk_context *ctx, const dmk_mesh *mesh, size_t n_sources,
                         const dmk_point *sources, const dmk_geodesics_options *options,
                         dmk_geodesics **geodesics)
{
    int rc;
    dmk_geodesics_options chosen = defaults;
    if (dmk_missing(ctx, "mesh", mesh, "geodesics", geodesics)) return DMK_E_ARG;
    if (n_sources > 0 && dmk_missing(ctx, "sources", sources)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_edges(ctx, mesh));
    DMK_TRY(dmk_options_take(ctx, "dmk_geodesics_options", options, &chosen, sizeof chosen));
    DMK_TRY(check_options(ctx, mesh, n_sources, &chosen));
    for (size_t i = 0; i < n_sources; i++)
        DMK_TRY(dmk_point_check(ctx, mesh, "sources", sources + i));
    DMK_TRY(dmk_stage_begin(ctx, "distance"));
    DMK_TRY(dmk_geodesics_compute(ctx, mesh, NULL, n_sources, sources, &chosen, geodesics));
done:
    dmk_stage_end(ctx);
    return rc;
}

void dmk_geodesics_destroy(dmk_geodesics **geodesics)
{
    dmk_geodesics *g = geodesics ? *geodesics : NULL;
    if (!g) return;
    for (int32_t i = 0; i < g->n_sources; i++) dmk_site_free(g->source + i);
    free(g->source);
    free(g->line);
    free(g->distance);
    free(g->arrival);
    free(g->tie);
    free(g->error);
    dmk_star_free(&g->star);
    free(g);
    *geodesics = NULL;
}

void dmk_geodesics_get_info(const dmk_geodesics *g, dmk_geodesics_info *info)
{
    if (!info) return;
    memset(info, 0, sizeof *info);
    if (!g) return;
    info->n_windows = (size_t)g->n_windows;
    info->tolerance = g->asked;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (g->arrival[v].source < 0) continue;
        info->n_reached++;
        info->farthest = dmk_max(info->farthest, g->distance[v]);
        if (!g->error || !(g->distance[v] > 0)) continue;
        info->error = dmk_max(info->error, g->error[v] / g->distance[v]);
        info->n_beyond += g->error[v] / g->distance[v] > g->asked;
    }
}

/* The length of a vertex array, if wanted. */
static bool count(const dmk_geodesics *g, size_t *n)
{
    if (n) *n = g ? (size_t)g->mesh->n_vertices : 0;
    return g != NULL;
}

const double *dmk_geodesics_distance(const dmk_geodesics *g, size_t *n)
{
    return count(g, n) ? g->distance : NULL;
}

static int by_vertex(const void *a, const void *b)
{
    const dmk_tie *s = a, *t = b;
    return (s->vertex > t->vertex) - (s->vertex < t->vertex);
}

const dmk_arrival *dmk_geodesics_tie(const dmk_geodesics *g, int32_t v)
{
    const dmk_tie *tie =
        g->n_ties > 0 ? bsearch(&(dmk_tie){.vertex = v}, g->tie, g->n_ties, sizeof *tie, by_vertex)
                      : NULL;
    return tie ? &tie->arrival : NULL;
}

const dmk_arrival *dmk_geodesics_arrivals(const dmk_geodesics *g, size_t *n)
{
    return count(g, n) ? g->arrival : NULL;
}

const double *dmk_geodesics_error(const dmk_geodesics *g, size_t *n)
{
    return count(g && g->error ? g : NULL, n) ? g->error : NULL;
}
