/* One straight ray across the triangles. */
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>

/* In mean edges at the vertex. */
static const double bend_width = 0.8;

static int push(dmk_ray *r, double x, double y, int32_t vertex, double spread, int32_t half)
{
    if (r->n == r->capacity) {
        int32_t capacity = r->capacity ? 2 * r->capacity : 512;
        dmk_pass *grown = realloc(r->pass, (size_t)capacity * sizeof *grown);
        if (!grown) return DMK_E_NOMEM;
        r->pass = grown;
        r->capacity = capacity;
    }
    r->pass[r->n++] = (dmk_pass){x, y, vertex, (float)fmax(spread, 0), half};
    return DMK_OK;
}

static const dmk_chart_sector *find_sector(const dmk_chart *c, double angle)
{
    int32_t lo = 0, hi = c->n_sectors - 1;
    while (lo < hi) {
        int32_t mid = (lo + hi) / 2;
        if (angle < c->sector[mid].angle[1])
            hi = mid;
        else
            lo = mid + 1;
    }
    return c->sector + lo;
}

/* The slack counts in edges of the mesh or of the place, whichever are longer: the guide may be off
 * by the coarse ones. */
bool dmk_ray_ended(const dmk_rays *rays, double slack, double x, int32_t v)
{
    double excess = x - rays->distance[v] - 0.02 * x;
    return excess > slack * rays->mean && excess > slack * rays->size[v];
}

/* A polyhedron is flat but for its vertices: rays on the two sides of one are bent towards each
 * other by its whole curvature k, however near they pass, and so neighbouring rays part or cross by
 * chance. The surface meant has its curvature spread out. With k spread evenly over the width 2 b,
 * a ray at the offset y is bent by k y / 2b instead of k sign(y) / 2; the difference is made up
 * here, by turning the plane around the foot of the vertex, points a and b with it. Sharp corners
 * are left as they are. */
static void spread_bend(const dmk_rays *rays, int32_t v, double x, double y, double *ax, double *ay,
                        double *bx, double *by)
{
    if (!rays->bend) return;
    double k = rays->bend[v], width = bend_width * rays->size[v];
    if (fabs(y) >= width || fabs(k) > dmk_sharp) return;
    double turn = 0.5 * k * (1 - fabs(y) / width) * (y > 0 ? 1 : -1);
    double c = 1 - 0.5 * turn * turn, s = turn;
    double px = *ax - x, py = *ay, qx = *bx - x, qy = *by;
    *ax = x + c * px - s * py;
    *ay = s * px + c * py;
    *bx = x + c * qx - s * qy;
    *by = s * qx + c * qy;
}

/* The row of triangles is unfolded into the plane, the ray lying on the x axis. The ray enters each
 * triangle through the edge from a, above the ray, to b, below; the third corner w then takes the
 * place of the end on its own side. No angle and no intersection is computed. */
typedef struct walk {
    double ax, ay, bx, by, wx, wy;
    int32_t half;   /* to be entered; -1 at a border */
    int32_t inside; /* the half-edge last entered, w being its opposite corner */
} walk;

static void begin(const dmk_rays *rays, double angle, walk *k, const dmk_chart_sector **sector)
{
    double whole = rays->chart.total;
    double local = rays->chart.closed ? angle - whole * floor(angle / whole) : angle;
    const dmk_chart_sector *s = find_sector(&rays->chart, local);
    double above = s->angle[1] - local, below = s->angle[0] - local;
    k->ax = s->radius[1] * cos(above);
    k->ay = s->radius[1] * sin(above);
    k->bx = s->radius[0] * cos(below);
    k->by = s->radius[0] * sin(below);
    k->half = s->beyond;
    k->inside = -1;
    *sector = s;
}

/* Unfold the next triangle: sets w. */
static void enter(const dmk_rays *rays, walk *k)
{
    int32_t base = k->half / 3 * 3;
    int c = k->half - base, c1 = c == 2 ? 0 : c + 1, c2 = c == 0 ? 2 : c - 1;
    double beta = 1 / (dmk_cot(rays->mesh, base + c1) + dmk_cot(rays->mesh, base + c2));
    double alpha = dmk_cot(rays->mesh, base + c1) * beta;
    double dx = k->bx - k->ax, dy = k->by - k->ay;
    k->wx = k->ax + alpha * dx - beta * dy;
    k->wy = k->ay + alpha * dy + beta * dx;
    k->inside = k->half;
}

/* Leave it through the edge that crosses the axis. */
static void leave(const dmk_rays *rays, walk *k)
{
    int32_t base = k->inside / 3 * 3;
    int c = k->inside - base;
    if (k->wy > 0) {
        k->ax = k->wx, k->ay = k->wy;
        k->half = rays->across[base + (c == 2 ? 0 : c + 1)];
    } else {
        k->bx = k->wx, k->by = k->wy;
        k->half = rays->across[base + (c == 0 ? 2 : c - 1)];
    }
    spread_bend(rays, rays->mesh->triangle[k->inside], k->wx, k->wy, &k->ax, &k->ay, &k->bx,
                &k->by);
}

/* Distance of neighbouring rays over their angle, and its slope. */
typedef struct jacobi {
    double x, j, slope;
} jacobi;

/* Carry it on to where the ray leaves the triangle. Returns the place of the zero on the way, or
 * HUGE_VAL. */
static double advance(const dmk_rays *rays, const walk *k, jacobi *a)
{
    double x = k->wy > 0 ? k->bx : k->ax, y = k->wy > 0 ? k->by : k->ay;
    double to = x + (k->wx - x) * y / (y - k->wy), step = to - a->x;
    a->j += 0.5 * step * a->slope;
    a->slope -= rays->curvature[k->inside / 3] * a->j * step;
    a->j += 0.5 * step * a->slope;
    a->x = to;
    return a->j <= 0 ? to - a->j / a->slope : HUGE_VAL;
}

int dmk_ray_shoot(const dmk_rays *rays, double angle, double slack, dmk_ray *ray)
{
    walk k;
    const dmk_chart_sector *s;
    begin(rays, angle, &k, &s);
    double start = k.ax + (k.bx - k.ax) * k.ay / (k.ay - k.by);
    jacobi a = {start, start, 1};
    ray->angle = angle;
    ray->n = 0;
    ray->until = HUGE_VAL;
    ray->widest = 0;
    int rc = push(ray, k.bx, k.by, s->vertex[0], start, -1);
    if (rc == DMK_OK) rc = push(ray, k.ax, k.ay, s->vertex[1], start, -1);
    while (rc == DMK_OK && k.half >= 0 && ray->n < rays->mesh->n_triangles) {
        enter(rays, &k);
        int32_t w = rays->mesh->triangle[k.inside];
        rc = push(ray, k.wx, k.wy, w, a.j, k.inside);
        if (dmk_ray_ended(rays, slack, k.wx, w)) break;
        if (ray->until == HUGE_VAL) {
            ray->until = advance(rays, &k, &a);
            if (a.j > ray->widest) ray->widest = a.j;
        }
        leave(rays, &k);
    }
    return rc;
}

/* Barycentric weights of (x, 0) in the triangle a, b, w, brought inside. */
static void locate(const walk *k, double x, dmk_point *place)
{
    int c = k->inside % 3;
    double a = k->by * (k->wx - x) - (k->bx - x) * k->wy; /* twice the areas, opposite a, b, w */
    double b = k->wy * (k->ax - x) - (k->wx - x) * k->ay;
    double w = k->ay * (k->bx - x) - (k->ax - x) * k->by;
    double sum = a + b + w;
    a = fmax(0, a / sum), b = fmax(0, b / sum), w = fmax(0, w / sum);
    sum = a + b + w;
    place->triangle = k->inside / 3;
    place->weight[c] = w / sum;
    place->weight[(c + 1) % 3] = a / sum;
    place->weight[(c + 2) % 3] = b / sum;
}

bool dmk_ray_points(const dmk_rays *rays, double angle, int n, const double *distance,
                    dmk_point *place)
{
    walk k;
    const dmk_chart_sector *s;
    int i = 0;
    begin(rays, angle, &k, &s);
    for (int32_t n_left = rays->mesh->n_triangles; k.half >= 0 && n_left > 0; n_left--) {
        enter(rays, &k);
        double x = k.wy > 0 ? k.bx : k.ax, y = k.wy > 0 ? k.by : k.ay;
        bool near = x >= distance[i] || k.wx >= distance[i]; /* else it leaves before, for sure */
        double out = near ? x + (k.wx - x) * y / (y - k.wy) : 0;
        for (; out >= distance[i]; i++) {
            locate(&k, distance[i], &place[i]);
            if (i + 1 == n) return true;
        }
        leave(rays, &k);
    }
    return false;
}

/* Barycentric weights of the point of t's plane nearest to xyz. */
static void project(const dmk_mesh *m, int64_t t, const double *xyz, double *weight)
{
    const double *a = m->xyz + 3 * (size_t)m->triangle[3 * t];
    const double *b = m->xyz + 3 * (size_t)m->triangle[3 * t + 1];
    const double *c = m->xyz + 3 * (size_t)m->triangle[3 * t + 2];
    double uu = 0, uv = 0, vv = 0, ux = 0, vx = 0;
    for (int k = 0; k < 3; k++) {
        double u = b[k] - a[k], v = c[k] - a[k], x = xyz[k] - a[k];
        uu += u * u, uv += u * v, vv += v * v, ux += u * x, vx += v * x;
    }
    double det = uu * vv - uv * uv;
    weight[1] = (vv * ux - uv * vx) / det;
    weight[2] = (uu * vx - uv * ux) / det;
    weight[0] = 1 - weight[1] - weight[2];
}

void dmk_rays_go_to(const dmk_rays *rays, const double xyz[3], dmk_point *place)
{
    double *w = place->weight;
    for (int step = 0; step < 64; step++) {
        int k = 0;
        project(rays->mesh, place->triangle, xyz, w);
        for (int i = 1; i < 3; i++) {
            if (w[i] < w[k]) k = i;
        }
        int32_t over = rays->across[3 * place->triangle + k];
        if (w[k] >= 0 || over < 0 || step == 63) break;
        place->triangle = over / 3;
    }
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += w[k] = fmax(0, w[k]);
    for (int k = 0; k < 3; k++)
        w[k] /= sum;
}
