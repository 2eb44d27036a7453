/* Springs and flips: see relax.h.
 *
 * Vertices are tied by springs and slide on the surface; edges flip in between. A triangle must
 * face as the surface does: no move and no flip may turn one over, and whatever mends one that is
 * turned over is welcome. */
#include "surfaces/relax.h"

#include "base/vec3.h"

#include <math.h>
#include <string.h>

/* Cosine between the normals of a triangle and of the surface below which it counts as turned. */
static const double min_facing = 0.3;
/* Moves that leave every triangle at least this good are free; worse ones must be improvements. */
static const double free_quality = 0.1;
/* Rest length of the springs in sides of the equilateral triangle of mean area: slightly pressed
 * springs spread the vertices out to the rims. */
static const double stretch = 1.1;
static const int max_flip_passes = 20;

/* ---- geometry -------------------------------------------------------------------------------- */

static double double_area(const double a[3], const double b[3], const double c[3])
{
    double n[3];
    dmk_area_vector(a, b, c, n);
    return sqrt(dmk_dot(n, n));
}

double dmk_relax_facing(const dmk_body *body, const double a[3], const double b[3],
                        const double c[3])
{
    double n[3], g[3], middle[3];
    for (int k = 0; k < 3; k++) middle[k] = (a[k] + b[k] + c[k]) / 3.0;
    dmk_area_vector(a, b, c, n);
    dmk_body_normal(body, middle, g);
    double length = sqrt(dmk_dot(n, n));
    return length > 0 ? dmk_dot(n, g) / length : -1;
}

double dmk_relax_quality(const double a[3], const double b[3], const double c[3])
{
    double sides =
        dmk_distance_squared(a, b) + dmk_distance_squared(b, c) + dmk_distance_squared(c, a);
    return sides > 0 ? 2.0 * sqrt(3.0) * double_area(a, b, c) / sides : 0;
}

/* The quality; negative if turned, the less so the nearer to being mended. */
static double score(const dmk_body *body, const double a[3], const double b[3], const double c[3])
{
    double cosine = dmk_relax_facing(body, a, b, c);
    return cosine < min_facing ? cosine - min_facing : dmk_relax_quality(a, b, c);
}

/* Cotangent of the angle at a. */
static double cotangent(const double a[3], const double b[3], const double c[3])
{
    double p[3], q[3];
    dmk_subtract(b, a, p);
    dmk_subtract(c, a, q);
    return dmk_dot(p, q) / double_area(a, b, c);
}

/* ---- flips ----------------------------------------------------------------------------------- */

/* The quadrangle of half-edge h: h runs b -> d in (a, b, d), its twin d -> b in (c, d, b). */
typedef struct quad {
    int32_t a, b, c, d;
} quad;

static quad quad_of(const dmk_halfedge *m, int32_t h)
{
    int32_t g = m->twin[h];
    return (quad){m->triangle[h], m->triangle[dmk_next(h)], m->triangle[g],
                  m->triangle[dmk_next(g)]};
}

/* Opposite angles that sum to more than pi; the slack keeps cocircular corners from flipping to
 * and fro. */
static bool wants_delaunay(const dmk_halfedge *m, quad q)
{
    const double *a = dmk_point_of(m, q.a), *b = dmk_point_of(m, q.b), *c = dmk_point_of(m, q.c),
                 *d = dmk_point_of(m, q.d);
    return cotangent(a, b, d) + cotangent(c, d, b) < -1e-9;
}

/* The sum of (degree - 6)^2 falls: a and c gain an edge, b and d lose one. */
static bool wants_degrees(const dmk_halfedge *m, quad q)
{
    return m->degree[q.a] + m->degree[q.c] + 2 < m->degree[q.b] + m->degree[q.d];
}

/* The flip makes no turned triangle, or a less turned one, and no second edge a-c. */
static bool may_flip(const dmk_relaxer *r, quad q)
{
    const dmk_halfedge *m = r->mesh;
    const double *a = dmk_point_of(m, q.a), *b = dmk_point_of(m, q.b), *c = dmk_point_of(m, q.c),
                 *d = dmk_point_of(m, q.d);
    double then = fmin(dmk_relax_facing(&r->body, a, b, c), dmk_relax_facing(&r->body, c, d, a));
    if (then < min_facing &&
        then <= fmin(dmk_relax_facing(&r->body, a, b, d), dmk_relax_facing(&r->body, c, d, b))) {
        return false;
    }
    return q.a != q.c && !dmk_halfedge_joined(m, q.a, q.c);
}

/* Passes over all edges until none wants to flip. */
static void flip_edges(const dmk_relaxer *r, bool (*wants)(const dmk_halfedge *m, quad q))
{
    dmk_halfedge *m = r->mesh;
    bool flipped = true;
    for (int pass = 0; pass < max_flip_passes && flipped; pass++) {
        flipped = false;
        for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
            if (m->twin[h] < h) continue;
            quad q = quad_of(m, h);
            if (!wants(m, q) || !may_flip(r, q)) continue;
            dmk_halfedge_flip(m, h);
            flipped = true;
        }
    }
}

/* Flip edges of turned triangles where that turns them back. */
static void mend_triangles(const dmk_relaxer *r)
{
    dmk_halfedge *m = r->mesh;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        int32_t c = h / 3 * 3;
        if (dmk_relax_facing(&r->body, dmk_point_at(m, c), dmk_point_at(m, c + 1),
                             dmk_point_at(m, c + 2)) >= min_facing) {
            h = c + 2; /* on to the next triangle */
        } else if (may_flip(r, quad_of(m, h))) {
            dmk_halfedge_flip(m, h);
        }
    }
}

/* ---- moves ----------------------------------------------------------------------------------- */

/* The worst score around vertex v if it were at x. */
static double star_score(const dmk_relaxer *r, int32_t v, const double x[3])
{
    const dmk_halfedge *m = r->mesh;
    double worst = 1;
    int32_t c = m->corner[v];
    do {
        int32_t next = dmk_next(c);
        worst =
            fmin(worst, score(&r->body, x, dmk_point_at(m, next), dmk_point_at(m, dmk_next(next))));
        c = dmk_next_corner(m, c);
    } while (c != m->corner[v]);
    return worst;
}

/* x = the vertex plus the mean force of its springs. */
static void pull(const dmk_relaxer *r, int32_t v, double x[3])
{
    const dmk_halfedge *m = r->mesh;
    double force[3] = {0, 0, 0}, n = 0, d[3];
    int32_t c = m->corner[v];
    do {
        dmk_subtract(dmk_point_at(m, dmk_next(c)), dmk_point_of(m, v), d);
        double length = sqrt(dmk_dot(d, d));
        for (int k = 0; k < 3 && length > 0; k++) force[k] += (length - r->rest) / length * d[k];
        n++;
        c = dmk_next_corner(m, c);
    } while (c != m->corner[v]);
    for (int k = 0; k < 3; k++) x[k] = dmk_point_of(m, v)[k] + force[k] / n;
}

static void move_vertices(const dmk_relaxer *r)
{
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        double x[3];
        if (v == r->fixed) continue;
        pull(r, v, x);
        if (!dmk_body_lift(&r->body, x)) continue;
        double then = star_score(r, v, x);
        if (then > free_quality || then > star_score(r, v, dmk_point_of(r->mesh, v))) {
            memcpy(r->mesh->xyz + 3 * (size_t)v, x, sizeof x);
        }
    }
}

/* Side of the equilateral triangle of mean area. */
static double mean_side(const dmk_halfedge *m)
{
    double sum = 0;
    for (int32_t c = 0; c < 3 * m->n_triangles; c += 3) {
        sum +=
            0.5 * double_area(dmk_point_at(m, c), dmk_point_at(m, c + 1), dmk_point_at(m, c + 2));
    }
    return sqrt(4.0 / sqrt(3.0) * sum / m->n_triangles);
}

int dmk_relax(dmk_relaxer *r, int sweeps)
{
    int rc = DMK_OK;
    r->rest = stretch * mean_side(r->mesh);
    for (int i = 0; i < sweeps; i++) {
        DMK_TRY(dmk_report(r->context, &(dmk_progress){.stage = "mesh",
                                                       .step = i + 1,
                                                       .max_steps = sweeps,
                                                       .change = NAN,
                                                       .gap = NAN,
                                                       .seconds = dmk_seconds() - r->began}));
        move_vertices(r);
        mend_triangles(r);
        flip_edges(r, i < sweeps / 2 ? wants_degrees : wants_delaunay);
    }
done:
    return rc;
}
