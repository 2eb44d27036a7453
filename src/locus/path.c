/* Minimal geodesics: see path.h. The fan tells the direction nearly; it is corrected until the
 * straight ray hits the point. */
#include "locus/path.h"
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;
static const double slack = 3;

typedef struct aim {
    const dmk_rays *rays;
    dmk_ray *ray;
    const dmk_point *to;
    double x, y; /* of the point in the plane of the last ray */
} aim;

/* Shoot a ray; where it passes the corners of the point's triangle, they tell the point's place
 * beside it. False if it passes none. */
static bool shoot(aim *a, double angle)
{
    const int32_t *corner = a->rays->mesh->triangle + 3 * a->to->triangle;
    double sum = 0;
    if (dmk_ray_shoot(a->rays, angle, slack, a->ray) != DMK_OK) return false;
    a->x = a->y = 0;
    for (int k = 0; k < 3; k++) {
        double weight = fmax(a->to->weight[k], 1e-9);
        for (int32_t i = a->ray->n; i-- > 0;) {
            const dmk_pass *p = a->ray->pass + i;
            if (p->vertex != corner[k]) continue;
            a->x += weight * p->x;
            a->y += weight * p->y;
            sum += weight;
            break;
        }
    }
    a->x /= sum;
    a->y /= sum;
    return sum > 0;
}

/* Direction and step to start with: the shortest geodesic to the corner that looks shortest from
 * the point, and its continuations at the other corners. */
static double first_angle(const dmk_rays *r, const dmk_point *to, double *step)
{
    const int32_t *corner = r->mesh->triangle + 3 * to->triangle;
    int best = 0;
    for (int k = 1; k < 3; k++) {
        if (to->weight[k] > to->weight[best]) best = k;
    }
    const dmk_sheet *from = dmk_rays_first(r, corner[best]);
    double angle = from->angle;
    for (int k = 0; k < 3; k++) {
        int32_t i = dmk_rays_continue(r, from, 2 * r->size[corner[best]], corner[k]);
        if (i < 0) continue;
        angle += to->weight[k] * dmk_chart_turn(&r->chart, from->angle, r->sheet[i].angle);
    }
    *step = 0.3 * r->size[corner[best]] / fmax(from->spread, 1e-3 * from->distance + 1e-300);
    *step = fmin(*step, 0.3);
    return angle;
}

/* Two directions, the point to the left of one and to the right of the other. */
static bool bracket(aim *a, double angle, double step, double side[2], double y[2])
{
    if (!shoot(a, angle)) return false;
    side[0] = side[1] = angle;
    y[0] = y[1] = a->y;
    for (int i = 0; i < 40; i++) {
        double next = angle + (y[0] > 0 ? step : -step) * (1 + i * i * 0.1);
        if (!shoot(a, next)) return false;
        side[1] = next;
        y[1] = a->y;
        if (y[0] * y[1] <= 0) return true;
        side[0] = side[1];
        y[0] = y[1];
        angle = next;
    }
    return false;
}

/* Regula falsi with bisection. The offset jumps where a vertex lies between: then the nearer side.
 */
static bool hit(aim *a, double angle, double step, double *found)
{
    double side[2], y[2];
    if (!bracket(a, angle, step, side, y)) return false;
    for (int i = 0; i < 80; i++) {
        double s = i % 3 == 2 ? 0.5 : y[0] / (y[0] - y[1]);
        double next = side[0] + s * (side[1] - side[0]);
        if (!(s > 0 && s < 1) || next == side[0] || next == side[1] || !shoot(a, next)) break;
        int same = a->y * y[0] > 0 ? 0 : 1;
        side[same] = next;
        y[same] = a->y;
        if (fabs(a->y) < 1e-13 * a->x) break;
    }
    *found = fabs(y[0]) < fabs(y[1]) ? side[0] : side[1];
    return shoot(a, *found);
}

/* In the source's own triangles the path is one segment. */
static bool is_beside(const dmk_chart *c, const dmk_point *to)
{
    for (int32_t i = 0; i < c->n_sectors; i++) {
        if (c->sector[i].triangle == to->triangle) return true;
    }
    return false;
}

static int straight(dmk_context *ctx, const dmk_locus_input *in, const dmk_point *to,
                    dmk_path *path)
{
    int rc;
    double a[3], b[3];
    DMK_TRY(DMK_NEW(ctx, path->point, 2));
    DMK_TRY(dmk_mesh_point_xyz(ctx, in->mesh, &in->source, a));
    DMK_TRY(dmk_mesh_point_xyz(ctx, in->mesh, to, b));
    path->point[0] = in->source;
    path->point[1] = *to;
    path->n = 2;
    path->length = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
done:
    return rc;
}

static int trace_one(dmk_context *ctx, const dmk_locus_input *in, const dmk_rays *r, dmk_ray *ray,
                     const dmk_point *to, dmk_path *path)
{
    int rc;
    aim a = {.rays = r, .ray = ray, .to = to};
    double step, angle = first_angle(r, to, &step);
    if (is_beside(&r->chart, to)) return straight(ctx, in, to, path);
    if (!hit(&a, angle, step, &angle)) {
        return dmk_fail(
            ctx, DMK_E_MESH,
            "no straight path reaches triangle %lld: it lies in the shadow of a border or "
            "of a saddle vertex",
            (long long)to->triangle);
    }
    DMK_TRY(DMK_NEW(ctx, path->point, (size_t)ray->n + 2));
    path->point[0] = in->source;
    path->n = 1 + dmk_ray_crossings(r, angle, to->triangle, a.x, path->point + 1, (size_t)ray->n);
    path->point[path->n++] = *to;
    path->length = hypot(a.x, a.y);
    path->angle = angle * (r->chart.closed ? 2 * pi / r->chart.total : 1);
done:
    return rc;
}

int dmk_path_trace(dmk_context *ctx, const dmk_locus_input *in, size_t n_points,
                   const dmk_point *to, dmk_path *paths)
{
    int rc;
    dmk_rays rays = {0}, flat;
    dmk_ray ray = {0};
    memset(paths, 0, n_points * sizeof *paths);
    DMK_TRY(dmk_rays_create(ctx, in, &rays));
    flat = rays;
    flat.bend = NULL; /* the exact geodesics of the polyhedron */
    for (size_t i = 0; i < n_points; i++) {
        DMK_TRY(trace_one(ctx, in, &flat, &ray, &to[i], &paths[i]));
    }
done:
    for (size_t i = 0; rc != DMK_OK && i < n_points; i++)
        dmk_path_free(&paths[i]);
    free(ray.pass);
    dmk_rays_free(&rays);
    return rc;
}

void dmk_path_free(dmk_path *path)
{
    free(path->point);
    memset(path, 0, sizeof *path);
}
