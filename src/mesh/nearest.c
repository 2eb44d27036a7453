/* Many points at once, each to the nearest one of the surface: boxes of triangles along the Morton curve, and larger
 * ones of these. */
#include "base/parallel.h"
#include "mesh/box.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Triangles in a box, and boxes in a larger one. Speed only: 100,000 points near a surface of 273,000 triangles take
 * 36 us each, one at a time 2 ms. */
enum { FAN = 16 };
/* Fewer points are looked for one at a time: the boxes take as long as some ten. Speed only. */
enum { FEW = 10 };
/* Points between two questions whether to stop: 0.1 s, where each is as far away as the surface is wide. */
enum { PIECE = 1000 };

typedef struct finder {
    const dmk_mesh *mesh;
    dmk_keyed *sorted; /* n_triangles: along the curve */
    int32_t n, n_boxes, n_large;
    dmk_box *box, *large;
    const double *xyz;
    dmk_point *point;
    int32_t from; /* of the points, the first one of the piece */
} finder;

static int32_t groups(int32_t n)
{
    return n / FAN + (n % FAN > 0);
}

static void box_range(int32_t begin, int32_t end, void *data)
{
    const finder *f = data;
    for (int32_t b = begin; b < end; b++) {
        f->box[b] = dmk_box_none();
        for (int32_t i = FAN * b; i < dmk_min_i(f->n, FAN * (b + 1)); i++) {
            const int32_t *corner = f->mesh->triangle + 3 * (size_t)f->sorted[i].item;
            for (int k = 0; k < 3; k++) {
                const double *x = f->mesh->xyz + 3 * (size_t)corner[k];
                dmk_box_take(f->box + b, x, x);
            }
        }
    }
}

static void large_range(int32_t begin, int32_t end, void *data)
{
    const finder *f = data;
    for (int32_t l = begin; l < end; l++) {
        f->large[l] = dmk_box_none();
        for (int32_t b = FAN * l; b < dmk_min_i(f->n_boxes, FAN * (l + 1)); b++)
            dmk_box_take(f->large + l, f->box[b].lo, f->box[b].hi);
    }
}

static int32_t nearest_of(const dmk_box *all, int32_t begin, int32_t end, const double x[3])
{
    int32_t found = begin;
    double least = INFINITY;
    for (int32_t b = begin; b < end; b++) {
        const double d = dmk_box_distance2(all + b, x);
        if (d < least) least = d, found = b;
    }
    return found;
}

/* A larger box's triangles, from the box that lies nearest on. Of equally near triangles the first one of the mesh
 * counts, as in dmk_mesh_project. */
static void search(const finder *f, int32_t large, const double x[3], double *best, dmk_point *p)
{
    const int32_t begin = FAN * large, n = dmk_min_i(f->n_boxes - begin, FAN);
    const int32_t first = nearest_of(f->box, begin, begin + n, x) - begin;
    for (int32_t j = 0; j < n; j++) {
        const int32_t b = begin + (first + j) % n;
        if (dmk_box_distance2(f->box + b, x) > *best) continue;
        for (int32_t i = FAN * b; i < dmk_min_i(f->n, FAN * (b + 1)); i++) {
            const int32_t t = f->sorted[i].item, *v = f->mesh->triangle + 3 * (size_t)t;
            const double *xyz = f->mesh->xyz;
            const double *const corner[3] = {xyz + 3 * (size_t)v[0], xyz + 3 * (size_t)v[1],
                                             xyz + 3 * (size_t)v[2]};
            double w[3];
            const double d = dmk_project_corners(corner, x, w);
            if (!(d < *best || (d == *best && t < p->triangle))) continue;
            *best = d;
            *p = (dmk_point){t, {w[0], w[1], w[2]}};
        }
    }
}

static void find_range(int32_t begin, int32_t end, void *data)
{
    const finder *f = data;
    for (int32_t i = f->from + begin; i < f->from + end; i++) {
        const double *x = f->xyz + 3 * (size_t)i;
        double best = INFINITY;
        dmk_point *p = f->point + i;
        p->triangle = -1;
        const int32_t first = nearest_of(f->large, 0, f->n_large, x);
        search(f, first, x, &best, p);
        for (int32_t l = 0; l < f->n_large; l++) {
            if (l != first && dmk_box_distance2(f->large + l, x) <= best) search(f, l, x, &best, p);
        }
        if (p->triangle >= 0) dmk_point_snap(p->weight);
    }
}

/* A point alone, with its number where that fails. */
static int project_one(dmk_context *ctx, const dmk_mesh *m, size_t i, const double xyz[3],
                       dmk_point *p)
{
    const int rc = dmk_mesh_project(ctx, m, xyz, p);
    if (rc == DMK_OK) return rc;
    char why[sizeof ctx->message];
    memcpy(why, ctx->message, sizeof why);
    return dmk_fail(ctx, rc, "point %zu: %s", i, why);
}

static int find_all(dmk_context *ctx, finder *f, int32_t n)
{
    int rc;
    DMK_TRY(dmk_morton_order(ctx, f->mesh, DMK_ALL_COMPONENTS, &f->sorted, &f->n));
    f->n_boxes = groups(f->n);
    f->n_large = groups(f->n_boxes);
    DMK_TRY(DMK_NEW_UNSET(ctx, f->box, (size_t)f->n_boxes));
    DMK_TRY(DMK_NEW_UNSET(ctx, f->large, (size_t)f->n_large));
    dmk_parallel(ctx, f->n_boxes, box_range, f);
    dmk_parallel(ctx, f->n_large, large_range, f);
    for (int32_t left = n; left > 0; left -= PIECE) {
        f->from = n - left;
        dmk_parallel(ctx, dmk_min_i(PIECE, left), find_range, f);
        DMK_TRY(dmk_poll(ctx));
    }
done:
    free(f->sorted);
    free(f->box);
    free(f->large);
    return rc;
}

int dmk_mesh_project_all(dmk_context *ctx, const dmk_mesh *m, size_t n, const double *xyz,
                         dmk_point *points)
{
    int rc = DMK_OK;
    if (dmk_missing(ctx, "mesh", m)) return DMK_E_ARG;
    if (n > 0 && dmk_missing(ctx, "xyz", xyz, "points", points)) return DMK_E_ARG;
    if (n > INT32_MAX) return dmk_fail(ctx, DMK_E_ARG, "%zu points are too many", n);
    const bool few = n < FEW;
    finder f = {.mesh = m, .xyz = xyz, .point = points};
    DMK_TRY(dmk_stage_begin(ctx, "project"));
    if (!few) DMK_TRY(find_all(ctx, &f, (int32_t)n));
    for (size_t i = 0; i < n; i++) {
        if (few || points[i].triangle < 0) DMK_TRY(project_one(ctx, m, i, xyz + 3 * i, points + i));
    }
done:
    dmk_stage_end(ctx);
    return rc;
}
