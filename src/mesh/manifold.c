/* The second half of a repair, see repair.c: edges of more than two triangles and vertices at which several surfaces
 * meet come apart, so that a manifold is left. */
#include "mesh/manifold.h"

#include "base/sets.h"
#include "base/vec3.h"

#include <stdlib.h>

/* ---- edges of more than two triangles ------------------------------------------------------- */

/* Sets say which pieces turn together: 2*p stands for piece p as its first triangle came, 2*p + 1 for it turned over,
 * and of two in one set both are so or neither. Where triangle t is as it came: */
static int32_t as_it_came(const soup *s, int32_t t)
{
    return 2 * s->piece[t] + s->turned[t];
}

/* And what is so, too, if g is joined to h, where the triangle of g is as it came. */
static int32_t follows(const soup *s, int32_t g, int32_t h)
{
    return as_it_came(s, h / 3) ^ (from_of(s, g) == from_of(s, h));
}

/* Is that the contrary of what is so already? */
static bool would_clash(const soup *s, int32_t *set, int32_t g, int32_t h)
{
    return dmk_set_find(set, as_it_came(s, g / 3)) == dmk_set_find(set, follows(s, g, h) ^ 1);
}

static void join_turned(soup *s, int32_t *set, int32_t g, int32_t h)
{
    join(s, g, h);
    dmk_set_unite(set, as_it_came(s, g / 3), follows(s, g, h));
    dmk_set_unite(set, as_it_came(s, g / 3) ^ 1, follows(s, g, h) ^ 1);
}

/* Direction of the triangle of side p away from its edge: a unit vector. */
static void away(const soup *s, const side *p, double out[3])
{
    double along[3], to[3];
    dmk_subtract(point(s, p->b), point(s, p->a), along);
    dmk_subtract(point(s, s->triangle[p->half]), point(s, p->a), to);
    double part = dmk_dot(to, along) / dmk_dot(along, along);
    for (int k = 0; k < 3; k++) out[k] = to[k] - part * along[k];
    double size = sqrt(dmk_dot(out, out));
    for (int k = 0; k < 3; k++) out[k] = size > 0 ? out[k] / size : 0;
}

/* How ill two sides of one edge fit, from -1: they should lie flat; else rather with the inside of a body
 * between them, so that bodies that touch in an edge come apart; and run the edge in two directions. */
static double misfit(const soup *s, const side *p, const side *q)
{
    double x[3], y[3], along[3], normal[3];
    const double *from = point(s, from_of(s, p->half)), *to = point(s, to_of(s, p->half));
    away(s, p, x);
    away(s, q, y);
    dmk_subtract(to, from, along);
    dmk_cross(along, x, normal);
    double outside = dmk_dot(normal, y) / sqrt(dmk_dot(along, along));
    bool same = from_of(s, p->half) == from_of(s, q->half);
    return dmk_dot(x, y) + 0.5 * outside + (same ? 4 : 0);
}

/* The n sides of one edge, more than two: again and again the pair that fits best, of those that can be turned to
 * agree. */
static void pair_sides(soup *s, int32_t *set, const side *p, int32_t n)
{
    for (;;) {
        double least = INFINITY;
        int32_t best[2] = {-1, -1};
        for (int32_t i = 0; i < n; i++) {
            for (int32_t j = i + 1; j < n && s->twin[p[i].half] < 0; j++) {
                if (s->twin[p[j].half] >= 0 || would_clash(s, set, p[i].half, p[j].half)) continue;
                double bad = misfit(s, &p[i], &p[j]);
                if (bad >= least) continue;
                least = bad;
                best[0] = p[i].half;
                best[1] = p[j].half;
            }
        }
        if (best[0] < 0) return;
        join_turned(s, set, best[0], best[1]);
    }
}

/* Of what hangs together now the fewer triangles are turned. A set is named by its first piece, as it is or turned. */
static int turn_fewer(soup *s, int32_t *set)
{
    int rc;
    int32_t *n = NULL; /* triangles of each set: as they came at the same time */
    DMK_TRY(DMK_NEW(s->ctx, n, 2 * (size_t)s->n_triangles));
    for (int32_t t = 0; t < s->n_triangles; t++) n[dmk_set_find(set, as_it_came(s, t))]++;
    for (int32_t t = 0; t < s->n_triangles; t++) {
        const int32_t name = dmk_set_find(set, as_it_came(s, t)), stay = name & ~1;
        s->turned[t] = (name != stay) != (n[stay + 1] > n[stay]);
        s->count->turned_triangles += s->turned[t];
    }
done:
    free(n);
    return rc;
}

/* What more triangles than this meet at stays apart: pairs of them all would take too long. */
enum { MOST_AT_EDGE = 64 };

int dmk_repair_pair_edges(soup *s)
{
    int rc;
    int32_t *set = NULL;
    DMK_TRY(DMK_NEW(s->ctx, set, 2 * (size_t)s->n_triangles));
    for (int32_t i = 0; i < 2 * s->n_triangles; i++) set[i] = i;
    for (int32_t i = 0, j; i < s->n_crowd; i = j) {
        j = edge_end(s->crowd, s->n_crowd, i);
        s->count->split_edges++;
        if (j - i <= MOST_AT_EDGE) pair_sides(s, set, s->crowd + i, j - i);
    }
    DMK_TRY(turn_fewer(s, set));
done:
    free(set);
    return rc;
}

/* ---- vertices ------------------------------------------------------------------------------- */

/* The corner of h's triangle at vertex v, an end of h. */
static int32_t corner_at(const soup *s, int32_t h, int32_t v)
{
    return s->triangle[dmk_next(h)] == v ? dmk_next(h) : dmk_previous(h);
}

/* Sets of corners that hang together over joined edges. */
static void link_corners(const soup *s, int32_t *set)
{
    const int32_t n = 3 * s->n_triangles;
    for (int32_t c = 0; c < n; c++) set[c] = c;
    for (int32_t h = 0; h < n; h++) {
        if (s->twin[h] < h) continue;
        const int32_t end[2] = {from_of(s, h), to_of(s, h)};
        for (int k = 0; k < 2; k++) {
            dmk_set_unite(set, corner_at(s, h, end[k]), corner_at(s, s->twin[h], end[k]));
        }
    }
}

/* ---- edges that would be one ---------------------------------------------------------------- */

/* The half-edge behind h around vertex v, an end of h: across the triangle of h, and of the next one; or -1. */
static int32_t around(const soup *s, int32_t h, int32_t v)
{
    return s->twin[3 * (h / 3) + 3 - h % 3 - corner_at(s, h, v) % 3];
}

/* The corners around v that were of one vertex are of two now, those next to g and those next to h: the ones that
 * close a circle, of two the shorter, get the new name. Both are walked at the same time, which keeps the work at n log
 * n for n corners however often a vertex falls apart. */
static void name_part(const soup *s, int32_t *name, int32_t g, int32_t h, int32_t v, int32_t new)
{
    int32_t start[2] = {g, h}, at[2] = {g, h}, k = 0;
    for (;; k = 1 - k) {
        if (at[k] >= 0) at[k] = around(s, at[k], v);
        if (at[k] == start[k]) break;
    }
    do {
        name[corner_at(s, at[k], v)] = new;
        at[k] = around(s, at[k], v);
    } while (at[k] != start[k]);
}

static int32_t runs_from(const soup *s, int32_t h)
{
    return s->turned[h / 3] ? to_of(s, h) : from_of(s, h);
}

/* Two edges between the same two vertices, g of one and h of the other: one of the two ways in which their sides fit is
 * there, the other one parts both vertices. For around each the triangles are in a circle, or in a row with borders at
 * its ends, and turned alike: what is between g and h closes to a circle of its own. Where both edges are borders they
 * are the two ends of the row, and become one edge. */
static void join_otherwise(soup *s, int32_t *name, int32_t g, int32_t h, int32_t *n_names)
{
    if (runs_from(s, g) == runs_from(s, h)) {
        if (s->twin[h] >= 0)
            h = s->twin[h];
        else
            g = s->twin[g];
    }
    const int32_t p = s->twin[g], q = s->twin[h];
    join(s, g, h);
    if (p >= 0) s->twin[p] = q;
    if (q >= 0) s->twin[q] = p;
    if (p < 0 && q < 0) return;
    name_part(s, name, g, p >= 0 ? p : q, from_of(s, g), (*n_names)++);
    name_part(s, name, g, p >= 0 ? p : q, to_of(s, g), (*n_names)++);
}

static bool is_alike(const soup *s, const int32_t *name, int32_t g, int32_t h)
{
    const int32_t a = from_of(s, g), b = to_of(s, g);
    return s->twin[g] != h && name[corner_at(s, g, a)] == name[corner_at(s, h, a)] &&
           name[corner_at(s, g, b)] == name[corner_at(s, h, b)];
}

/* The n sides of one edge of the soup. Those that are not joined, but of the same two vertices, a mesh would take for
 * one edge, which it knows by its ends. Names are only ever added, so that what is unlike stays so. */
static void settle_edge(soup *s, int32_t *name, side *p, int32_t n, int32_t *n_names)
{
    /* Now by the names of the ends, so that there are few to compare. */
    for (int32_t i = 0; i < n; i++) {
        const int32_t h = p[i].half, a = corner_at(s, h, p[i].a), b = corner_at(s, h, p[i].b);
        p[i] = (side){name[a], name[b], h};
    }
    qsort(p, (size_t)n, sizeof *p, by_ends);
    for (int32_t i = 0, end = 0; i < n; i++) {
        if (i >= end) end = edge_end(p, n, i);
        for (int32_t j = i + 1; j < end; j++) {
            if (is_alike(s, name, p[i].half, p[j].half))
                join_otherwise(s, name, p[i].half, p[j].half, n_names);
        }
    }
}

int dmk_repair_settle_edges(soup *s)
{
    int rc;
    const int32_t n = 3 * s->n_triangles;
    int32_t *name = NULL, n_names = n;
    if (s->n_crowd == 0) return DMK_OK;
    DMK_TRY(DMK_NEW(s->ctx, name, (size_t)n));
    link_corners(s, name);
    for (int32_t c = 0; c < n; c++) name[c] = dmk_set_find(name, c);
    for (int32_t i = 0, j; i < s->n_crowd; i = j) {
        j = edge_end(s->crowd, s->n_crowd, i);
        settle_edge(s, name, s->crowd + i, j - i, &n_names);
    }
done:
    free(name);
    return rc;
}

/* ---- numbers -------------------------------------------------------------------------------- */

/* Numbers for the vertices that stay, as many as returned: not those that first[] merged away, nor unused
 * ones without a position. */
static int32_t keep_vertices(soup *s, const int32_t *first)
{
    int32_t n = 0, *old = s->count->vertex_old, *new = s->count->vertex_new;
    for (int32_t v = 0; v < s->n_vertices; v++) {
        if (first[v] != v) {
            new[v] = new[first[v]];
        } else if (is_finite(point(s, v))) {
            new[v] = n;
            old[n++] = v;
        } else {
            new[v] = -1;
        }
    }
    return n;
}

/* A vertex whose corners fall into several sets is there once for each; its first set keeps the number. */
int dmk_repair_number_vertices(soup *s, const int32_t *first, int32_t *n_new)
{
    int rc;
    int32_t *set = NULL, *name = NULL;
    bool *taken = NULL;
    const int32_t n = 3 * s->n_triangles;
    DMK_TRY(DMK_NEW(s->ctx, set, (size_t)n));
    DMK_TRY(DMK_NEW(s->ctx, name, (size_t)n));
    DMK_TRY(DMK_NEW(s->ctx, taken, (size_t)s->n_vertices));
    DMK_TRY(DMK_NEW(s->ctx, s->count->vertex_old, (size_t)s->n_vertices + (size_t)n));
    link_corners(s, set);
    *n_new = keep_vertices(s, first);
    for (int32_t c = 0; c < n; c++) name[c] = -1;
    for (int32_t c = 0; c < n; c++) {
        int32_t root = dmk_set_find(set, c), v = s->triangle[c];
        if (name[root] >= 0) continue;
        name[root] = taken[v] ? (*n_new)++ : s->count->vertex_new[v];
        s->count->split_vertices += taken[v];
        s->count->vertex_old[name[root]] = v;
        taken[v] = true;
    }
    for (int32_t c = 0; c < n; c++) s->triangle[c] = name[dmk_set_find(set, c)];
done:
    free(set);
    free(name);
    free(taken);
    return rc;
}
