/* Growth by splitting the longest edges: see remesh.h.
 *
 * A coarse mesh of a thin body would slip off its rim. So it grows on a rounder body, and the full
 * mesh is then squeezed with the body, axis by axis, which keeps it valid, and relaxed again. */
#include "surfaces/remesh.h"

#include "base/vec3.h"
#include "surfaces/relax.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A result with a triangle worse than this (dmk_relax_quality) is refused: asked for by thousands, bodies up to 3,000
 * times as long as wide have 0.029. */
static const double least_quality = 0.01;
/* Split edges down to this part of the longest one in a round. */
static const double split_above = 0.7;
/* Length of the middle part of an edge in which it is split, as a part of the edge. */
static const double split_spread = 0.4;
/* The rounder body has no semi-axis below this part of the longest one; a squeeze takes at most
 * this part off an axis. */
static const double round_above = 0.3, squeeze_by = 0.5;
static const int grow_sweeps = 4, squeeze_sweeps = 10, final_sweeps = 60;

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
        edges[n++] = (ranked){
            dmk_distance_squared(dmk_point_at(m, dmk_next(h)), dmk_point_at(m, dmk_next(g))), h};
    }
    qsort(edges, (size_t)n, sizeof *edges, longest_first);
    return n;
}

typedef struct splitter {
    const dmk_body *body;
    dmk_halfedge *mesh;
    ranked *edges;    /* 3/2 of the final number of triangles */
    uint8_t *touched; /* per triangle: it was split in this round */
    uint64_t dice;    /* state of the random numbers */
} splitter;

/* In [0, 1), from a linear congruential generator modulo 2^64 (its upper bits). */
static double throw_dice(splitter *s)
{
    s->dice = s->dice * 6364136223846793005u + 1442695040888963407u;
    return (double)(s->dice >> 40) / 16777216.0;
}

/* Somewhere about the middle: a start as symmetric as the surface would stay so but for rounding,
 * and then rounding would decide between equal edges. */
static void split_edge(splitter *s, int32_t h)
{
    dmk_halfedge *m = s->mesh;
    const double *from = dmk_point_at(m, dmk_next(h)), *to = dmk_point_at(m, dmk_next(m->twin[h]));
    double x[3], part = 0.5 + split_spread * (throw_dice(s) - 0.5);
    for (int k = 0; k < 3; k++) x[k] = from[k] + part * (to[k] - from[k]);
    dmk_body_lift(s->body, x);
    dmk_halfedge_split(m, h, x);
}

/* One round: split the longest edges, each triangle at most once, so that no rank is stale. */
static void split_longest(splitter *s, int32_t n_vertices)
{
    dmk_halfedge *m = s->mesh;
    int32_t n = rank_edges(m, s->edges);
    double least = split_above * split_above * s->edges[0].square;
    memset(s->touched, 0, (size_t)m->n_triangles);
    for (int32_t i = 0; i < n && s->edges[i].square >= least && m->n_vertices < n_vertices; i++) {
        int32_t h = s->edges[i].half, g = m->twin[h];
        if (s->touched[h / 3] || s->touched[g / 3]) continue;
        s->touched[h / 3] = s->touched[g / 3] = 1;
        split_edge(s, h);
    }
}

static int grow(dmk_relaxer *r, int32_t n_vertices)
{
    int rc = DMK_OK;
    splitter s = {.body = &r->body, .mesh = r->mesh, .dice = 1};
    /* A split adds one vertex, two triangles, three edges. */
    size_t n_triangles =
        (size_t)r->mesh->n_triangles + 2 * (size_t)dmk_max_i(0, n_vertices - r->mesh->n_vertices);
    DMK_TRY(DMK_NEW(r->context, s.edges, n_triangles / 2 * 3));
    DMK_TRY(DMK_NEW(r->context, s.touched, n_triangles));
    while (r->mesh->n_vertices < n_vertices) {
        split_longest(&s, n_vertices);
        DMK_TRY(dmk_relax(r, grow_sweeps));
    }
done:
    free(s.edges);
    free(s.touched);
    return rc;
}

/* ---- all together ---------------------------------------------------------------------------- */

/* Move the vertex nearest to the source there; the final sweeps mend what that does. */
static int32_t snap_source(dmk_halfedge *m, const double source[3])
{
    int32_t nearest = 0;
    for (int32_t v = 1; v < m->n_vertices; v++) {
        if (dmk_distance_squared(dmk_point_of(m, v), source) <
            dmk_distance_squared(dmk_point_of(m, nearest), source)) {
            nearest = v;
        }
    }
    memcpy(m->xyz + 3 * (size_t)nearest, source, 3 * sizeof *source);
    return nearest;
}

static int check_triangles(const dmk_relaxer *r)
{
    const dmk_halfedge *m = r->mesh;
    for (int32_t c = 0; c < 3 * m->n_triangles; c += 3) {
        const double *x = dmk_point_at(m, c), *y = dmk_point_at(m, c + 1),
                     *z = dmk_point_at(m, c + 2);
        bool turned = dmk_relax_facing(&r->body, x, y, z) <= 0;
        if (!turned && dmk_relax_quality(x, y, z) >= least_quality) continue;
        return dmk_fail(
            r->context, DMK_E_ARG, "%d triangles are too few for this %s: one %s; ask for more",
            m->n_triangles, r->body.surface->name, turned ? "looks inwards" : "is a needle");
    }
    return DMK_OK;
}

/* Stretch the axes so that the body becomes one with these sizes. */
static void become(dmk_relaxer *r, const double size[3])
{
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        for (int k = 0; k < 3; k++) r->mesh->xyz[3 * (size_t)v + k] *= size[k] / r->body.size[k];
    }
    memcpy(r->body.size, size, sizeof r->body.size);
    for (int32_t v = 0; v < r->mesh->n_vertices; v++) {
        dmk_body_lift(&r->body, r->mesh->xyz + 3 * (size_t)v);
    }
}

static void make_round(dmk_relaxer *r)
{
    const double *s = r->body.size, longest = fmax(fmax(s[0], s[1]), s[2]);
    double size[3];
    for (int k = 0; k < 3; k++) size[k] = fmax(s[k], round_above * longest);
    become(r, size);
}

static int squeeze(dmk_relaxer *r, const double target[3])
{
    int rc = DMK_OK;
    while (memcmp(r->body.size, target, sizeof r->body.size) != 0) {
        double size[3];
        for (int k = 0; k < 3; k++) size[k] = fmax(target[k], squeeze_by * r->body.size[k]);
        become(r, size);
        DMK_TRY(dmk_relax(r, squeeze_sweeps));
    }
done:
    return rc;
}

int dmk_remesh(dmk_context *ctx, const dmk_body *body, int32_t n_vertices, const double *source,
               dmk_halfedge *mesh, int32_t *source_vertex)
{
    int rc;
    dmk_relaxer r = {.context = ctx, .body = *body, .mesh = mesh, .fixed = -1};
    r.began = dmk_seconds();
    if (body->surface->axes) make_round(&r);
    DMK_TRY(grow(&r, n_vertices));
    if (body->surface->axes) DMK_TRY(squeeze(&r, body->size));
    if (source) r.fixed = snap_source(mesh, source);
    DMK_TRY(dmk_relax(&r, final_sweeps));
    DMK_TRY(check_triangles(&r));
    *source_vertex = r.fixed;
done:
    return rc;
}
