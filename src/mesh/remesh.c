/* The mesh improver: see remesh.h.
 *
 * Vertices are tied by springs and slide on the surface; edges flip in between, first to bring the
 * vertex degrees near 6, then to make the triangulation Delaunay. A triangle must face as the
 * surface does: no move and no flip may turn one over, and whatever mends one that is turned over
 * is welcome.
 *
 * A coarse mesh of a thin body would slip off its rim. So it grows on a rounder body, and the full
 * mesh is then squeezed with the body, axis by axis, which keeps it valid, and relaxed again. */
#include "mesh/remesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Cosine between the normals of a triangle and of the surface below which it counts as turned. */
static const double min_facing = 0.3;
/* Moves that leave every triangle at least this good are free; worse ones must be improvements. */
static const double free_quality = 0.1;
/* A result with a triangle worse than this is refused. */
static const double least_quality = 0.01;
/* Split edges down to this part of the longest one in a round. */
static const double split_above = 0.7;
/* Length of the middle part of an edge in which it is split, as a part of the edge. */
static const double split_spread = 0.4;
/* The rounder body has no semi-axis below this part of the longest one; a squeeze takes at most
 * this part off an axis. */
static const double round_above = 0.3, squeeze_by = 0.5;
/* Rest length of the springs in sides of the equilateral triangle of mean area: slightly pressed
 * springs spread the vertices out to the rims. */
static const double stretch = 1.1;
static const int grow_sweeps = 4, squeeze_sweeps = 10, final_sweeps = 60, max_flip_passes = 20;

typedef struct remesher {
    dmk_context *context;
    dmk_body body;
    dmk_halfedge *mesh;
    int32_t fixed; /* vertex that keeps its place, or -1 */
    double rest;   /* length of the springs */
    uint64_t dice; /* state of the random numbers */
    double began;  /* dmk_seconds */
} remesher;

/* ---- geometry -------------------------------------------------------------------------------- */

static const double *point(const dmk_halfedge *m, int32_t v) { return m->xyz + 3 * (size_t)v; }

/* Where the vertex at corner c is. */
static const double *at(const dmk_halfedge *m, int32_t c) { return point(m, m->triangle[c]); }

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void subtract(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++) out[k] = a[k] - b[k];
}

static double square_distance(const double a[3], const double b[3])
{
    double d[3];
    subtract(a, b, d);
    return dot(d, d);
}

/* (b - a) x (c - a): along the normal, of length twice the area. */
static void area_vector(const double a[3], const double b[3], const double c[3], double n[3])
{
    double p[3], q[3];
    subtract(b, a, p);
    subtract(c, a, q);
    n[0] = p[1] * q[2] - p[2] * q[1];
    n[1] = p[2] * q[0] - p[0] * q[2];
    n[2] = p[0] * q[1] - p[1] * q[0];
}

static double double_area(const double a[3], const double b[3], const double c[3])
{
    double n[3];
    area_vector(a, b, c, n);
    return sqrt(dot(n, n));
}

/* Cosine between the triangle's normal and the surface's. */
static double facing(const dmk_body *body, const double a[3], const double b[3],
                     const double c[3])
{
    double n[3], g[3], middle[3];
    for (int k = 0; k < 3; k++) middle[k] = (a[k] + b[k] + c[k]) / 3.0;
    area_vector(a, b, c, n);
    dmk_body_normal(body, middle, g);
    double length = sqrt(dot(n, n));
    return length > 0 ? dot(n, g) / length : -1;
}

/* 4 sqrt(3) area / (sum of squared sides): 1 if equilateral, 0 if flat. */
static double quality(const double a[3], const double b[3], const double c[3])
{
    double sides = square_distance(a, b) + square_distance(b, c) + square_distance(c, a);
    return sides > 0 ? 2.0 * sqrt(3.0) * double_area(a, b, c) / sides : 0;
}

/* The quality; negative if turned, the less so the nearer to being mended. */
static double score(const dmk_body *body, const double a[3], const double b[3],
                    const double c[3])
{
    double cosine = facing(body, a, b, c);
    return cosine < min_facing ? cosine - min_facing : quality(a, b, c);
}

/* Cotangent of the angle at a. */
static double cotangent(const double a[3], const double b[3], const double c[3])
{
    double p[3], q[3];
    subtract(b, a, p);
    subtract(c, a, q);
    return dot(p, q) / double_area(a, b, c);
}

/* ---- flips ----------------------------------------------------------------------------------- */

/* The quadrangle of half-edge h: h runs b -> d in (a, b, d), its twin d -> b in (c, d, b). */
typedef struct quad {
    int32_t a, b, c, d;
} quad;

static quad quad_of(const dmk_halfedge *m, int32_t h)
{
    int32_t g = m->twin[h];
    return (quad){m->triangle[h], m->triangle[dmk_turn(h)], m->triangle[g],
                  m->triangle[dmk_turn(g)]};
}

/* Opposite angles that sum to more than pi; the slack keeps cocircular corners from flipping to
 * and fro. */
static bool wants_delaunay(const dmk_halfedge *m, quad q)
{
    const double *a = point(m, q.a), *b = point(m, q.b), *c = point(m, q.c), *d = point(m, q.d);
    return cotangent(a, b, d) + cotangent(c, d, b) < -1e-9;
}

/* The sum of (degree - 6)^2 falls: a and c gain an edge, b and d lose one. */
static bool wants_degrees(const dmk_halfedge *m, quad q)
{
    return dmk_halfedge_degree(m, q.a) + dmk_halfedge_degree(m, q.c) + 2 <
           dmk_halfedge_degree(m, q.b) + dmk_halfedge_degree(m, q.d);
}

/* The flip makes no turned triangle, or a less turned one, and no second edge a-c. */
static bool may_flip(const remesher *r, quad q)
{
    const dmk_halfedge *m = r->mesh;
    const double *a = point(m, q.a), *b = point(m, q.b), *c = point(m, q.c), *d = point(m, q.d);
    double then = fmin(facing(&r->body, a, b, c), facing(&r->body, c, d, a));
    if (then < min_facing &&
        then <= fmin(facing(&r->body, a, b, d), facing(&r->body, c, d, b))) {
        return false;
    }
    return q.a != q.c && !dmk_halfedge_joined(m, q.a, q.c);
}

/* Passes over all edges until none wants to flip. */
static void flip_edges(const remesher *r, bool (*wants)(const dmk_halfedge *m, quad q))
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
static void mend_triangles(const remesher *r)
{
    dmk_halfedge *m = r->mesh;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        int32_t c = h / 3 * 3;
        if (facing(&r->body, at(m, c), at(m, c + 1), at(m, c + 2)) >= min_facing) {
            h = c + 2; /* on to the next triangle */
        } else if (may_flip(r, quad_of(m, h))) {
            dmk_halfedge_flip(m, h);
        }
    }
}

/* ---- moves ----------------------------------------------------------------------------------- */

/* The worst score around vertex v if it were at x. */
static double star_score(const remesher *r, int32_t v, const double x[3])
{
    const dmk_halfedge *m = r->mesh;
    double worst = 1;
    int32_t c = m->corner[v];
    do {
        int32_t next = dmk_turn(c);
        worst = fmin(worst, score(&r->body, x, at(m, next), at(m, dmk_turn(next))));
        c = dmk_next_corner(m, c);
    } while (c != m->corner[v]);
    return worst;
}

/* x = the vertex plus the mean force of its springs. */
static void pull(const remesher *r, int32_t v, double x[3])
{
    const dmk_halfedge *m = r->mesh;
    double force[3] = {0, 0, 0}, n = 0, d[3];
    int32_t c = m->corner[v];
    do {
        subtract(at(m, dmk_turn(c)), point(m, v), d);
        double length = sqrt(dot(d, d));
        for (int k = 0; k < 3 && length > 0; k++) force[k] += (length - r->rest) / length * d[k];
        n++;
        c = dmk_next_corner(m, c);
    } while (c != m->corner[v]);
    for (int k = 0; k < 3; k++) x[k] = point(m, v)[k] + force[k] / n;
}

static void move_vertices(const remesher *r)
{
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        double x[3];
        if (v == r->fixed) continue;
        pull(r, v, x);
        if (!dmk_body_lift(&r->body, x)) continue;
        double then = star_score(r, v, x);
        if (then > free_quality || then > star_score(r, v, point(r->mesh, v))) {
            memcpy(r->mesh->xyz + 3 * (size_t)v, x, sizeof x);
        }
    }
}

/* Side of the equilateral triangle of mean area. */
static double mean_side(const dmk_halfedge *m)
{
    double sum = 0;
    for (int32_t c = 0; c < 3 * m->n_triangles; c += 3) {
        sum += 0.5 * double_area(at(m, c), at(m, c + 1), at(m, c + 2));
    }
    return sqrt(4.0 / sqrt(3.0) * sum / m->n_triangles);
}

static int relax(remesher *r, int sweeps)
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

/* ---- growth ---------------------------------------------------------------------------------- */

typedef struct ranked {
    double square; /* of the length */
    int32_t half;
} ranked;

static int longest_first(const void *left, const void *right)
{
    const ranked *a = left, *b = right;
    if (a->square != b->square) return a->square > b->square ? -1 : 1;
    return (a->half > b->half) - (a->half < b->half);
}

static int32_t rank_edges(const dmk_halfedge *m, ranked *edges)
{
    int32_t n = 0;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        int32_t g = m->twin[h];
        if (h > g) continue;
        edges[n++] = (ranked){square_distance(at(m, dmk_turn(h)), at(m, dmk_turn(g))), h};
    }
    qsort(edges, (size_t)n, sizeof *edges, longest_first);
    return n;
}

/* In [0, 1), from a linear congruential generator modulo 2^64 (its upper bits). */
static double throw_dice(remesher *r)
{
    r->dice = r->dice * 6364136223846793005u + 1442695040888963407u;
    return (double)(r->dice >> 40) / 16777216.0;
}

/* Somewhere about the middle: a start as symmetric as the surface would stay so but for rounding,
 * and then rounding would decide between equal edges. */
static void split_edge(remesher *r, int32_t h)
{
    dmk_halfedge *m = r->mesh;
    const double *from = at(m, dmk_turn(h)), *to = at(m, dmk_turn(m->twin[h]));
    double x[3], part = 0.5 + split_spread * (throw_dice(r) - 0.5);
    for (int k = 0; k < 3; k++) x[k] = from[k] + part * (to[k] - from[k]);
    dmk_body_lift(&r->body, x);
    dmk_halfedge_split(m, h, x);
}

/* One round: split the longest edges, each triangle at most once, so that no rank is stale. */
static void split_longest(remesher *r, int32_t n_vertices, ranked *edges, uint8_t *touched)
{
    dmk_halfedge *m = r->mesh;
    int32_t n = rank_edges(m, edges);
    double least = split_above * split_above * edges[0].square;
    memset(touched, 0, (size_t)m->n_triangles);
    for (int32_t i = 0; i < n && edges[i].square >= least && m->n_vertices < n_vertices; i++) {
        int32_t h = edges[i].half, g = m->twin[h];
        if (touched[h / 3] || touched[g / 3]) continue;
        touched[h / 3] = touched[g / 3] = 1;
        split_edge(r, h);
    }
}

static int grow(remesher *r, int32_t n_vertices)
{
    int rc = DMK_OK;
    ranked *edges = NULL;
    uint8_t *touched = NULL;
    /* A split adds one vertex, two triangles, three edges. */
    size_t n_triangles = (size_t)r->mesh->n_triangles +
                         2 * (size_t)dmk_max_i(0, n_vertices - r->mesh->n_vertices);
    DMK_TRY(DMK_NEW(r->context, edges, n_triangles / 2 * 3));
    DMK_TRY(DMK_NEW(r->context, touched, n_triangles));
    while (r->mesh->n_vertices < n_vertices) {
        split_longest(r, n_vertices, edges, touched);
        DMK_TRY(relax(r, grow_sweeps));
    }
done:
    free(edges);
    free(touched);
    return rc;
}

/* ---- all together ---------------------------------------------------------------------------- */

/* Move the vertex nearest to the source there; the final sweeps mend what that does. */
static int32_t snap_source(dmk_halfedge *m, const double source[3])
{
    int32_t nearest = 0;
    for (int32_t v = 1; v < m->n_vertices; v++) {
        if (square_distance(point(m, v), source) < square_distance(point(m, nearest), source)) {
            nearest = v;
        }
    }
    memcpy(m->xyz + 3 * (size_t)nearest, source, 3 * sizeof *source);
    return nearest;
}

static int check_triangles(const remesher *r)
{
    const dmk_halfedge *m = r->mesh;
    for (int32_t c = 0; c < 3 * m->n_triangles; c += 3) {
        const double *x = at(m, c), *y = at(m, c + 1), *z = at(m, c + 2);
        bool turned = facing(&r->body, x, y, z) <= 0;
        if (!turned && quality(x, y, z) >= least_quality) continue;
        return dmk_fail(r->context, DMK_E_ARG,
                        "%d triangles are too few for this %s: one %s; ask for more",
                        m->n_triangles, r->body.surface->name,
                        turned ? "looks inwards" : "is a needle");
    }
    return DMK_OK;
}

/* Stretch the axes so that the body becomes one with these sizes. */
static void become(remesher *r, const double size[3])
{
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        for (int k = 0; k < 3; k++) r->mesh->xyz[3 * (size_t)v + k] *= size[k] / r->body.size[k];
    }
    memcpy(r->body.size, size, sizeof r->body.size);
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        dmk_body_lift(&r->body, r->mesh->xyz + 3 * (size_t)v);
    }
}

static void make_round(remesher *r)
{
    const double *s = r->body.size, longest = fmax(fmax(s[0], s[1]), s[2]);
    double size[3];
    for (int k = 0; k < 3; k++) size[k] = fmax(s[k], round_above * longest);
    become(r, size);
}

static int squeeze(remesher *r, const double target[3])
{
    int rc = DMK_OK;
    while (memcmp(r->body.size, target, sizeof r->body.size) != 0) {
        double size[3];
        for (int k = 0; k < 3; k++) size[k] = fmax(target[k], squeeze_by * r->body.size[k]);
        become(r, size);
        DMK_TRY(relax(r, squeeze_sweeps));
    }
done:
    return rc;
}

int dmk_remesh(dmk_context *ctx, const dmk_body *body, int32_t n_vertices, const double *source,
               dmk_halfedge *mesh, int32_t *source_vertex)
{
    int rc;
    remesher r = {.context = ctx, .body = *body, .mesh = mesh, .fixed = -1, .dice = 1};
    r.began = dmk_seconds();
    if (body->surface->axes) make_round(&r);
    DMK_TRY(grow(&r, n_vertices));
    if (body->surface->axes) DMK_TRY(squeeze(&r, body->size));
    if (source) r.fixed = snap_source(mesh, source);
    DMK_TRY(relax(&r, final_sweeps));
    DMK_TRY(check_triangles(&r));
    *source_vertex = r.fixed;
done:
    return rc;
}
