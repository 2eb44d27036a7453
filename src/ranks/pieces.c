/* A mesh in pieces, from ranges of its vertices and triangles; see pieces.h. */
#include "ranks/pieces.h"

#include "base/vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- checks ----------------------------------------------------------------------------------- */

static int check_vertices(dmk_context *ctx, const dmk_pieces *p)
{
    const int64_t first = p->vertex_bound[p->ranks.rank],
                  n = p->vertex_bound[p->ranks.rank + 1] - first;
    int64_t bad = INT64_MAX;
    for (int64_t v = 0; v < n && bad == INT64_MAX; v++) {
        const double *x = p->xyz + 3 * v;
        if (isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2])) continue;
        bad = first + v;
        dmk_fail(ctx, DMK_E_MESH,
                 "vertex %lld lies at (%g, %g, %g): coordinates must be finite; give it a "
                 "place or remove it",
                 (long long)bad, x[0], x[1], x[2]);
    }
    return dmk_fail_first(ctx, &p->ranks, bad);
}

/* Whether a message says what is wrong with it. */
static bool triangle_is_bad(dmk_context *ctx, int64_t t, const int64_t v[3], int64_t n_vertices)
{
    for (int k = 0; k < 3; k++) {
        if (v[k] >= 0 && v[k] < n_vertices) continue;
        dmk_fail(
            ctx, DMK_E_MESH,
            "triangle %lld names vertex %lld; vertices are numbered from 0, and there are %lld",
            (long long)t, (long long)v[k], (long long)n_vertices);
        return true;
    }
    if (v[0] != v[1] && v[1] != v[2] && v[2] != v[0]) return false;
    dmk_fail(ctx, DMK_E_MESH,
             "triangle %lld (vertices %lld %lld %lld) is degenerate: a vertex is repeated; remove "
             "it, as a repair does",
             (long long)t, (long long)v[0], (long long)v[1], (long long)v[2]);
    return true;
}

static int check_triangles(dmk_context *ctx, const dmk_pieces *p)
{
    int64_t bad = INT64_MAX;
    for (size_t t = 0; t < p->n_tiles && bad == INT64_MAX; t++) {
        if (triangle_is_bad(ctx, p->tile[t].number, p->tile[t].vertex, p->n_vertices))
            bad = p->tile[t].number;
    }
    return dmk_fail_first(ctx, &p->ranks, bad);
}

/* The first triangle here that mesh.c would not measure, or INT64_MAX, by the corners of tiles in the input's order. */
static int64_t find_unmeasured(const dmk_pieces *p, const double *xyz, double l[3], int64_t v[3])
{
    double area;
    for (size_t t = 0; t < p->n_tiles; t++) {
        const double *x = xyz + 9 * t;
        l[0] = dmk_distance(x + 3, x + 6);
        l[1] = dmk_distance(x + 6, x);
        l[2] = dmk_distance(x, x + 3);
        memcpy(v, p->tile[t].vertex, sizeof p->tile[t].vertex);
        if (dmk_measure_checked(NULL, l, p->tile[t].number, v, &area) != DMK_OK)
            return p->tile[t].number;
    }
    return INT64_MAX;
}

/* ---- all together ----------------------------------------------------------------------------- */

static int take_triangles(dmk_context *ctx, const int64_t *triangle, dmk_pieces *p)
{
    int rc;
    const int size = p->ranks.size, r = p->ranks.rank;
    const int64_t first = dmk_even_bound(p->n_triangles, r, size);
    p->n_tiles = (size_t)(dmk_even_bound(p->n_triangles, r + 1, size) - first);
    DMK_TRY(DMK_NEW(ctx, p->tile, p->n_tiles));
    DMK_TRY(DMK_NEW(ctx, p->vertex_bound, (size_t)size + 1));
    for (int k = 0; k <= size; k++) p->vertex_bound[k] = dmk_even_bound(p->n_vertices, k, size);
    for (size_t t = 0; t < p->n_tiles; t++) {
        p->tile[t].number = first + (int64_t)t;
        memcpy(p->tile[t].vertex, triangle + 3 * t, sizeof p->tile[t].vertex);
    }
done:
    return rc;
}

static size_t even_share(const dmk_ranks *ranks, int64_t n)
{
    return (size_t)(dmk_even_bound(n, ranks->rank + 1, ranks->size) -
                    dmk_even_bound(n, ranks->rank, ranks->size));
}

/* The checks have the order of mesh.c's. Edges come first, while triangles are where the input has them: near each
 * other's vertices most often. */
static int prepare(dmk_context *ctx, dmk_pieces *p)
{
    int rc;
    double *xyz = NULL, l[3], area;
    int64_t v[3];
    DMK_TRY(check_vertices(ctx, p));
    DMK_TRY(check_triangles(ctx, p));
    DMK_TRY(dmk_pieces_corners(ctx, p, &xyz));
    const int64_t bad = find_unmeasured(p, xyz, l, v);
    DMK_TRY(dmk_pieces_connect(ctx, p));
    DMK_TRY(dmk_poll(ctx));
    if (bad < INT64_MAX) dmk_measure_checked(ctx, l, bad, v, &area);
    DMK_TRY(dmk_fail_first(ctx, &p->ranks, bad));
    DMK_TRY(dmk_pieces_measure(ctx, p, xyz));
    DMK_TRY(dmk_pieces_sort(ctx, p, xyz));
    free(xyz);
    xyz = NULL;
    DMK_TRY(dmk_poll(ctx));
    rc = dmk_pieces_find_components(ctx, p);
done:
    free(xyz);
    return rc;
}

int dmk_pieces_adopt(dmk_context *ctx, const dmk_ranks *ranks, int64_t n_vertices, double *xyz,
                     int64_t n_triangles, int64_t *triangle, dmk_pieces **pieces)
{
    int rc;
    dmk_pieces *p = NULL;
    DMK_TRY(DMK_NEW(ctx, p, 1));
    p->ranks = *ranks;
    p->n_vertices = n_vertices;
    p->n_triangles = n_triangles;
    p->xyz = xyz;
    xyz = NULL;
    DMK_TRY(take_triangles(ctx, triangle, p));
    free(triangle);
    triangle = NULL;
    DMK_TRY(prepare(ctx, p));
    *pieces = p;
    p = NULL;
done:
    free(xyz);
    free(triangle);
    dmk_pieces_destroy(&p);
    return rc;
}

int dmk_pieces_create(dmk_context *ctx, const dmk_ranks *ranks, int64_t n_vertices,
                      const double *xyz, int64_t n_triangles, const int64_t *triangles,
                      dmk_pieces **pieces)
{
    int rc;
    double *x = NULL;
    int64_t *t = NULL;
    if (dmk_missing(ctx, "ranks", ranks, "xyz", xyz, "triangles", triangles, "pieces", pieces))
        return DMK_E_ARG;
    DMK_TRY(dmk_ranks_given(ctx, ranks));
    DMK_TRY(dmk_mesh_check_counts(ctx, (size_t)n_vertices, (size_t)n_triangles));
    const size_t n[2] = {even_share(ranks, n_vertices), even_share(ranks, n_triangles)};
    DMK_TRY(DMK_NEW(ctx, x, 3 * n[0]));
    DMK_TRY(DMK_NEW(ctx, t, 3 * n[1]));
    memcpy(x, xyz, 3 * n[0] * sizeof *x);
    memcpy(t, triangles, 3 * n[1] * sizeof *t);
    return dmk_pieces_adopt(ctx, ranks, n_vertices, x, n_triangles, t, pieces);
done:
    free(x);
    free(t);
    return rc;
}

void dmk_pieces_get_info(const dmk_pieces *p, dmk_mesh_info *info)
{
    if (!info) return;
    *info = (dmk_mesh_info){0};
    if (!p) return;
    info->n_vertices = (size_t)p->n_vertices;
    info->n_triangles = (size_t)p->n_triangles;
    info->n_edges = (size_t)p->n_edges;
    info->n_unused_vertices = (size_t)(p->n_vertices - p->n_used);
    info->n_border_edges = (size_t)p->n_border_edges;
    info->n_border_loops = (size_t)p->n_border_loops;
    info->n_components = (size_t)p->n_components;
    info->euler = p->n_used - p->n_edges + p->n_triangles;
    dmk_measures_tell(&p->measures, info);
}

/* ---- points ----------------------------------------------------------------------------------- */

/* A point on a rank, and how far it is from where it should be. */
typedef struct offer {
    double distance2;
    dmk_point point; /* triangle -1: none */
} offer;

static bool is_better(const offer *a, const offer *b)
{
    if (a->point.triangle < 0 || b->point.triangle < 0) return a->point.triangle >= 0;
    if (a->distance2 != b->distance2) return a->distance2 < b->distance2;
    return a->point.triangle < b->point.triangle;
}

/* The best of all ranks'. */
static int take_best(dmk_context *ctx, const dmk_pieces *p, offer *best)
{
    int rc;
    offer *all = NULL;
    DMK_TRY(dmk_gather_each(ctx, &p->ranks, sizeof *best, best, (void **)&all));
    for (int r = 0; r < p->ranks.size; r++) {
        if (is_better(&all[r], best)) *best = all[r];
    }
done:
    free(all);
    return rc;
}

int dmk_pieces_vertex_point(dmk_context *ctx, const dmk_pieces *p, int64_t vertex, dmk_point *point)
{
    int rc;
    offer best = {.point.triangle = -1};
    if (dmk_missing(ctx, "pieces", p, "point", point)) return DMK_E_ARG;
    if (vertex < 0 || vertex >= p->n_vertices)
        return dmk_fail(ctx, DMK_E_ARG, "vertex %lld is out of range [0, %lld]", (long long)vertex,
                        (long long)p->n_vertices - 1);
    for (size_t h = 0; h < 3 * p->n_tiles; h++) {
        offer one = {.point.triangle = p->tile[h / 3].number};
        one.point.weight[h % 3] = 1;
        if (p->tile[h / 3].vertex[h % 3] == vertex && is_better(&one, &best)) best = one;
    }
    DMK_TRY(take_best(ctx, p, &best));
    if (best.point.triangle < 0)
        rc = dmk_fail(ctx, DMK_E_ARG, "vertex %lld is in no triangle: choose one that is",
                      (long long)vertex);
    else
        *point = best.point;
done:
    return rc;
}

int dmk_pieces_project(dmk_context *ctx, const dmk_pieces *p, const double xyz[3], dmk_point *point)
{
    int rc;
    double *corners = NULL;
    offer best = {.point.triangle = -1};
    if (dmk_missing(ctx, "pieces", p, "xyz", xyz, "point", point)) return DMK_E_ARG;
    if (!isfinite(xyz[0]) || !isfinite(xyz[1]) || !isfinite(xyz[2]))
        return dmk_fail(ctx, DMK_E_ARG, "the point (%g, %g, %g) is not finite", xyz[0], xyz[1],
                        xyz[2]);
    DMK_TRY(dmk_pieces_corners(ctx, p, &corners));
    for (size_t t = 0; t < p->n_tiles; t++) {
        offer one = {.point.triangle = p->tile[t].number};
        const double *x = corners + 9 * t, *corner[3] = {x, x + 3, x + 6};
        one.distance2 = dmk_project_corners(corner, xyz, one.point.weight);
        if (isfinite(one.distance2) && is_better(&one, &best)) best = one;
    }
    DMK_TRY(take_best(ctx, p, &best));
    if (best.point.triangle < 0) {
        rc = dmk_fail(ctx, DMK_E_ARG,
                      "the point (%g, %g, %g) is too far from the mesh for double precision",
                      xyz[0], xyz[1], xyz[2]);
        goto done;
    }
    dmk_point_snap(best.point.weight);
    *point = best.point;
done:
    free(corners);
    return rc;
}

void dmk_pieces_destroy(dmk_pieces **pieces)
{
    dmk_pieces *p = pieces ? *pieces : NULL;
    if (!p) return;
    free(p->vertex_bound);
    free(p->edge_bound);
    free(p->xyz);
    free(p->tile);
    free(p->component);
    free(p);
    *pieces = NULL;
}
