#include "mesh/check.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>

static bool vertex_is_bad(int32_t v, void *data)
{
    const dmk_mesh *m = data;
    const double *x = m->xyz + 3 * (size_t)v;
    return !isfinite(x[0]) || !isfinite(x[1]) || !isfinite(x[2]);
}

static bool names_no_vertex(const dmk_mesh *m, int32_t v)
{
    return v < 0 || v >= m->n_vertices;
}

static bool triangle_is_bad(int32_t t, void *data)
{
    const dmk_mesh *m = data;
    const int32_t *c = m->triangle + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        if (names_no_vertex(m, c[k])) return true;
    }
    return c[0] == c[1] || c[1] == c[2] || c[2] == c[0];
}

static int explain_triangle(dmk_context *ctx, const dmk_mesh *m, int32_t t)
{
    const int32_t *c = m->triangle + 3 * (size_t)t;
    for (int k = 0; k < 3; k++) {
        if (!names_no_vertex(m, c[k])) continue;
        return dmk_fail(
            ctx, DMK_E_MESH,
            "triangle %d names vertex %d; vertices are numbered from 0, and there are %d", t, c[k],
            m->n_vertices);
    }
    return dmk_fail(
        ctx, DMK_E_MESH,
        "triangle %d (vertices %d %d %d) is degenerate: a vertex is repeated; remove it, "
        "as a repair does",
        t, c[0], c[1], c[2]);
}

int dmk_check_input(dmk_context *ctx, dmk_mesh *m)
{
    int32_t v = dmk_parallel_first(ctx, m->n_vertices, vertex_is_bad, m);
    if (v >= 0) {
        const double *x = m->xyz + 3 * (size_t)v;
        return dmk_fail(ctx, DMK_E_MESH,
                        "vertex %d lies at (%g, %g, %g): coordinates must be finite; give it a "
                        "place or remove it",
                        v, x[0], x[1], x[2]);
    }
    int32_t t = dmk_parallel_first(ctx, m->n_triangles, triangle_is_bad, m);
    return t >= 0 ? explain_triangle(ctx, m, t) : DMK_OK;
}

/* ---- why edges could not be built: slow and thorough ---- */

/* One side of a triangle: its ends a < b, the vertex opposite, the half-edge. */
typedef struct side {
    int32_t a, b, opposite, half;
} side;

static int compare_sides(const void *left, const void *right)
{
    const side *p = left, *q = right;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    if (p->b != q->b) return p->b < q->b ? -1 : 1;
    if (p->opposite != q->opposite) return p->opposite < q->opposite ? -1 : 1;
    return p->half < q->half ? -1 : p->half > q->half;
}

static bool same_edge(const side *p, const side *q)
{
    return p->a == q->a && p->b == q->b;
}

/* Does the half-edge run from the smaller end to the larger? */
static bool runs_up(const dmk_mesh *m, int32_t half)
{
    const int32_t *c = m->triangle + 3 * (size_t)(half / 3);
    return c[(half % 3 + 1) % 3] < c[(half % 3 + 2) % 3];
}

static side *sorted_sides(dmk_context *ctx, const dmk_mesh *m)
{
    side *s = NULL;
    size_t n = 3 * (size_t)m->n_triangles;
    if (DMK_NEW(ctx, s, n) != DMK_OK) return NULL;
    for (int32_t h = 0; h < (int32_t)n; h++) {
        const int32_t *c = m->triangle + 3 * (size_t)(h / 3);
        int32_t p = c[(h % 3 + 1) % 3], q = c[(h % 3 + 2) % 3];
        s[h] = (side){dmk_min_i(p, q), dmk_max_i(p, q), c[h % 3], h};
    }
    qsort(s, n, sizeof *s, compare_sides);
    return s;
}

static int explain_duplicate(dmk_context *ctx, const side *s, size_t n)
{
    for (size_t i = 1; i < n; i++) {
        if (!same_edge(&s[i - 1], &s[i]) || s[i - 1].opposite != s[i].opposite) continue;
        return dmk_fail(ctx, DMK_E_MESH,
                        "triangles %d and %d are duplicates: both have the vertices %d %d %d; "
                        "remove one of them, as a repair does",
                        s[i - 1].half / 3, s[i].half / 3, s[i].a, s[i].b, s[i].opposite);
    }
    return DMK_OK;
}

static int explain_third_triangle(dmk_context *ctx, const side *s, size_t n)
{
    for (size_t i = 2; i < n; i++) {
        if (!same_edge(&s[i - 2], &s[i])) continue;
        return dmk_fail(ctx, DMK_E_MESH,
                        "non-manifold edge %d-%d: triangles %d, %d and %d share it; remove or "
                        "separate the extra sheets, as a repair does",
                        s[i].a, s[i].b, s[i - 2].half / 3, s[i - 1].half / 3, s[i].half / 3);
    }
    return DMK_OK;
}

/* Turn triangles over, from neighbour to neighbour, until they agree. mate[h] is the half-edge that
 * shares the edge of h, or -1; turned[t] becomes 0 or 1. Gives a half-edge over which no agreement
 * is possible, or -1; *n_turned is the number to turn over in all (the fewer, in each part). */
static int32_t try_to_orient(const dmk_mesh *m, const int32_t *mate, int8_t *turned, int32_t *stack,
                             int32_t *n_turned)
{
    *n_turned = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) turned[t] = -1;
    for (int32_t seed = 0; seed < m->n_triangles; seed++) {
        if (turned[seed] >= 0) continue;
        int32_t top = 0, size = 0, turns = 0;
        turned[seed] = 0;
        stack[top++] = seed;
        while (top > 0) {
            int32_t t = stack[--top];
            size++;
            turns += turned[t];
            for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
                if (mate[h] < 0) continue;
                int32_t other = mate[h] / 3;
                int8_t wanted = turned[t] ^ (runs_up(m, h) == runs_up(m, mate[h]));
                if (turned[other] < 0) {
                    turned[other] = wanted;
                    stack[top++] = other;
                } else if (turned[other] != wanted) {
                    return h;
                }
            }
        }
        *n_turned += dmk_min_i(turns, size - turns);
    }
    return -1;
}

/* At most two triangles at each edge, but some of the same direction. */
static int explain_orientation(dmk_context *ctx, const dmk_mesh *m, const side *s)
{
    int rc;
    int32_t *mate = NULL, *stack = NULL, n_turned;
    int8_t *turned = NULL;
    size_t n = 3 * (size_t)m->n_triangles, bad = 0;
    DMK_TRY(DMK_NEW(ctx, mate, n));
    DMK_TRY(DMK_NEW(ctx, stack, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, turned, (size_t)m->n_triangles));
    for (size_t i = 0; i < n; i++) mate[i] = -1;
    for (size_t i = 1; i < n; i++) {
        if (!same_edge(&s[i - 1], &s[i])) continue;
        mate[s[i - 1].half] = s[i].half;
        mate[s[i].half] = s[i - 1].half;
        if (!bad && runs_up(m, s[i - 1].half) == runs_up(m, s[i].half)) bad = i;
    }
    int32_t stuck = try_to_orient(m, mate, turned, stack, &n_turned);
    if (stuck >= 0) {
        rc = dmk_fail(ctx, DMK_E_MESH,
                      "the surface is not orientable (it has one side only, like a Moebius strip "
                      "or a Klein bottle; noticed between triangles %d and %d), which is not "
                      "treated; cut it open, as a repair does, or use its two-sided double cover",
                      stuck / 3, mate[stuck] / 3);
    } else {
        rc = dmk_fail(ctx, DMK_E_MESH,
                      "inconsistent orientation: triangles %d and %d run edge %d-%d in the same "
                      "direction; turning over %d of the %d triangles (swapping two of their "
                      "corners), as a repair does, makes all agree",
                      s[bad - 1].half / 3, s[bad].half / 3, s[bad].a, s[bad].b, n_turned,
                      m->n_triangles);
    }
done:
    free(mate);
    free(stack);
    free(turned);
    return rc;
}

int dmk_check_explain_edges(dmk_context *ctx, const dmk_mesh *m)
{
    size_t n = 3 * (size_t)m->n_triangles;
    side *s = sorted_sides(ctx, m);
    if (!s) return DMK_E_NOMEM;
    int rc = explain_duplicate(ctx, s, n);
    if (rc == DMK_OK) rc = explain_third_triangle(ctx, s, n);
    if (rc == DMK_OK) rc = explain_orientation(ctx, m, s);
    free(s);
    return rc;
}

/* ---- vertex stars ---- */

/* Corner (3*triangle + k) of vertex v in triangle t. */
static int32_t corner_of(const dmk_mesh *m, int32_t t, int32_t v)
{
    const int32_t *c = m->triangle + 3 * (size_t)t;
    return 3 * t + (c[0] == v ? 0 : c[1] == v ? 1 : 2);
}

/* The next corner counterclockwise around the same vertex, or -1 behind the last one of a chain:
 * the side that follows corner k counterclockwise lies opposite corner k+1. */
static int32_t next_corner(const dmk_mesh *m, int32_t corner)
{
    const int32_t t = corner / 3, e = m->triangle_edge[3 * t + (corner % 3 + 1) % 3],
                  other = dmk_twin_triangle(m, t, e);
    return other < 0 ? -1 : corner_of(m, other, m->triangle[corner]);
}

/* The third vertex of a triangle on edge e, without a search. */
static int32_t third_vertex(const dmk_mesh *m, int32_t e, int32_t t)
{
    const int32_t *c = m->triangle + 3 * (size_t)t, *ends = m->edge_vertex + 2 * (size_t)e;
    return c[0] ^ c[1] ^ c[2] ^ ends[0] ^ ends[1];
}

/* Two triangles back to back share an edge and the vertex opposite to it. */
static bool edge_is_of_pillow(const dmk_mesh *m, int32_t e)
{
    const int32_t *t = m->edge_triangle + 2 * (size_t)e;
    return t[1] >= 0 && third_vertex(m, e, t[0]) == third_vertex(m, e, t[1]);
}

static int fail_pillow(dmk_context *ctx, const dmk_mesh *m, int32_t e)
{
    const int32_t *t = m->edge_triangle + 2 * (size_t)e, *ends = m->edge_vertex + 2 * (size_t)e;
    return dmk_fail(ctx, DMK_E_MESH,
                    "triangles %d and %d are duplicates, back to back: both have the vertices "
                    "%d %d %d; remove one of them, as a repair does, or both",
                    dmk_min_i(t[0], t[1]), dmk_max_i(t[0], t[1]), ends[0], ends[1],
                    third_vertex(m, e, t[0]));
}

/* Name a triangle of the part of the star that starts at `first` and one outside of it. */
static int fail_star(dmk_context *ctx, const dmk_mesh *m, int32_t first)
{
    int32_t v = m->triangle[first], outside = -1, c = first;
    bool *inside = NULL; /* 3*n_triangles: corners of that part */
    int rc = DMK_NEW(ctx, inside, 3 * (size_t)m->n_triangles);
    if (rc != DMK_OK) return rc;
    do {
        inside[c] = true;
        c = next_corner(m, c);
    } while (c >= 0 && c != first);
    for (int32_t h = 0; h < 3 * m->n_triangles && outside < 0; h++) {
        if (m->triangle[h] == v && !inside[h]) outside = h / 3;
    }
    free(inside);
    return dmk_fail(
        ctx, DMK_E_MESH,
        "non-manifold vertex %d: triangles %d and %d meet there, but not through "
        "shared edges; give each part of the surface its own copy of the vertex, as a repair does",
        v, dmk_min_i(first / 3, outside), dmk_max_i(first / 3, outside));
}

typedef struct star_job {
    const dmk_mesh *mesh;
    int32_t *first; /* corner from which to walk: where the chain begins if there is one */
    int32_t *count; /* corners at the vertex */
} star_job;

/* Not all corners of the vertex are met on a walk over shared edges. */
static bool star_is_split(const star_job *job, int32_t v)
{
    int32_t seen = 0, c = job->first[v];
    if (job->count[v] == 0) return false;
    do {
        seen++;
        c = next_corner(job->mesh, c);
    } while (c >= 0 && c != job->first[v]);
    return seen != job->count[v];
}

/* A star is walked from the triangle where it begins: those that follow each other lie side by side in memory, as
 * vertices of a subdivided mesh do not. */
static bool is_not_manifold(int32_t t, void *data)
{
    const star_job *job = data;
    const dmk_mesh *m = job->mesh;
    for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
        const int32_t e = m->triangle_edge[h], v = m->triangle[h];
        if (m->edge_triangle[2 * (size_t)e] == t && edge_is_of_pillow(m, e)) return true;
        if (job->first[v] == h && star_is_split(job, v)) return true;
    }
    return false;
}

static int fail_manifold(dmk_context *ctx, const star_job *job)
{
    const dmk_mesh *m = job->mesh;
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (edge_is_of_pillow(m, e)) return fail_pillow(ctx, m, e);
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        if (star_is_split(job, v)) return fail_star(ctx, m, job->first[v]);
    }
    return DMK_OK;
}

int dmk_check_stars(dmk_context *ctx, const dmk_ranks *ranks, dmk_mesh *m)
{
    int rc;
    int32_t bad;
    star_job job = {.mesh = m};
    DMK_TRY(DMK_NEW(ctx, job.first, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, job.count, (size_t)m->n_vertices));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (job.count[m->triangle[h]]++ == 0) job.first[m->triangle[h]] = h;
    }
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * (size_t)e + 1] >= 0) continue;
        int32_t h = dmk_half_edge_on(m, m->edge_triangle[2 * (size_t)e], e);
        job.first[m->triangle[dmk_next(h)]] = dmk_next(h);
    }
    DMK_TRY(dmk_parallel_first_of(ctx, ranks, m->n_triangles, is_not_manifold, &job, &bad));
    if (bad >= 0) rc = fail_manifold(ctx, &job);
done:
    free(job.first);
    free(job.count);
    return rc;
}
