/* Mending a triangle soup until it is a manifold, in seven steps: equal vertices become one; a triangle without
 * area gives way by a flip of its longest edge; triangles with a repeated corner, without area still, or there
 * twice go; triangles are turned to agree with their neighbours over edges of two, and where a surface has one
 * side only it is cut along the edges at which the turning fails; at an edge of more than two triangles those two
 * that fit best belong together, and so on; what is there twice by that, an edge between the same two vertices,
 * is joined in another way; a vertex whose triangles do not hang together becomes several. No edge of two
 * triangles is parted but on those cuts, and any soup is a manifold then.
 *
 * Half-edges and corners are numbered as in mesh.h; twin[h]: the half-edge that h is joined to, or -1. */
#include "mesh/mesh.h"

#include "base/sets.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct side {
    int32_t a, b, half; /* a < b: the ends */
} side;

typedef struct soup {
    dmk_context *ctx;
    int32_t n_vertices, n_triangles;
    const double *xyz;
    int32_t *triangle; /* 3*n_triangles: corners, as far as they are mended */
    int32_t *old;      /* n_triangles: number in the input */
    int32_t *twin;     /* 3*n_triangles */
    side *crowd;       /* n_crowd: those at edges of more than two triangles, edge by edge */
    int32_t n_crowd;
    int32_t *piece;  /* n_triangles: the first one that hangs together with it over edges of two */
    uint8_t *turned; /* n_triangles: against the input */
    dmk_repairs *count;
} soup;

static const double *point(const soup *s, int32_t v)
{
    return s->xyz + 3 * (size_t)v;
}

/* Rows of flat triangles are flipped one after another, in at most so many rounds. */
enum { MOST_PASSES = 64 };

static bool is_finite(const double *x)
{
    return isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
}

/* ---- equal vertices ------------------------------------------------------------------------- */

typedef struct positioned {
    double x[3];
    int32_t vertex;
} positioned;

static int by_position(const void *left, const void *right)
{
    const positioned *a = left, *b = right;
    for (int k = 0; k < 3; k++) {
        if (a->x[k] != b->x[k]) return a->x[k] < b->x[k] ? -1 : 1;
    }
    return (a->vertex > b->vertex) - (a->vertex < b->vertex);
}

/* Name every vertex by the first one at its position: first[v] <= v. Vertices in no triangle stay out of it. */
static int merge_vertices(soup *s, int32_t *first)
{
    int rc;
    positioned *list = NULL;
    bool *used = NULL;
    int32_t n = 0;
    DMK_TRY(DMK_NEW(s->ctx, used, (size_t)s->n_vertices));
    DMK_TRY(DMK_NEW(s->ctx, list, (size_t)s->n_vertices));
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) used[s->triangle[h]] = true;
    for (int32_t v = 0; v < s->n_vertices; v++) {
        first[v] = v;
        if (!used[v]) continue;
        for (int k = 0; k < 3; k++) list[n].x[k] = point(s, v)[k] + 0.0; /* -0 is 0 */
        list[n++].vertex = v;
    }
    qsort(list, (size_t)n, sizeof *list, by_position);
    for (int32_t i = 1; i < n; i++) {
        if (memcmp(list[i].x, list[i - 1].x, sizeof list[i].x) != 0) continue;
        first[list[i].vertex] = first[list[i - 1].vertex];
        s->count->merged_vertices++;
    }
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) s->triangle[h] = first[s->triangle[h]];
done:
    free(used);
    free(list);
    return rc;
}

/* ---- edges ---------------------------------------------------------------------------------- */

static int by_ends(const void *left, const void *right)
{
    const side *p = left, *q = right;
    if (p->a != q->a) return p->a < q->a ? -1 : 1;
    if (p->b != q->b) return p->b < q->b ? -1 : 1;
    return (p->half > q->half) - (p->half < q->half);
}

static int32_t from_of(const soup *s, int32_t h)
{
    return s->triangle[dmk_next(h)];
}
static int32_t to_of(const soup *s, int32_t h)
{
    return s->triangle[dmk_previous(h)];
}

static void join(soup *s, int32_t g, int32_t h)
{
    s->twin[g] = h;
    s->twin[h] = g;
}

/* Behind the last of the n sides that has the ends of side i. */
static int32_t edge_end(const side *list, int32_t n, int32_t i)
{
    int32_t j = i + 1;
    while (j < n && list[j].a == list[i].a && list[j].b == list[i].b) j++;
    return j;
}

/* Edges of two triangles; the sides at those of more are kept. */
static int join_edges(soup *s)
{
    int rc;
    const int32_t n = 3 * s->n_triangles;
    free(s->crowd);
    s->crowd = NULL;
    s->n_crowd = 0;
    DMK_TRY(DMK_NEW(s->ctx, s->crowd, (size_t)n));
    side *list = s->crowd;
    for (int32_t h = 0; h < n; h++) {
        int32_t a = from_of(s, h), b = to_of(s, h);
        list[h] = (side){dmk_min_i(a, b), dmk_max_i(a, b), h};
        s->twin[h] = -1;
    }
    qsort(list, (size_t)n, sizeof *list, by_ends);
    for (int32_t i = 0, j; i < n; i = j) {
        j = edge_end(list, n, i);
        if (j - i == 2) join(s, list[i].half, list[i + 1].half);
        if (j - i <= 2) continue;
        memmove(list + s->n_crowd, list + i, (size_t)(j - i) * sizeof *list);
        s->n_crowd += j - i;
    }
    side *shorter = realloc(list, (size_t)dmk_max_i(s->n_crowd, 1) * sizeof *list);
    if (shorter) s->crowd = shorter; /* else the longer one does as well */
done:
    return rc;
}

/* ---- triangles without area ----------------------------------------------------------------- */

/* As the mesh will see it; *longest: half-edge of the longest side. */
static bool is_flat(const soup *s, int32_t t, int32_t *longest)
{
    const int32_t *c = s->triangle + 3 * (size_t)t;
    double l[3], most = -1;
    *longest = -1;
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) return true;
    for (int k = 0; k < 3; k++) {
        l[k] = dmk_distance(point(s, c[(k + 1) % 3]), point(s, c[(k + 2) % 3]));
        if (l[k] > most) *longest = 3 * t + k;
        most = fmax(most, l[k]);
    }
    if (most > DBL_MAX) return false; /* what no double holds the mesh refuses */
    return dmk_sides_are_flat(l);
}

/* A flat triangle, its corner b between a and c, and its neighbour over a and c, with corner d: instead of
 * these the triangles d a b and d b c, as the neighbour is turned. */
static void flip(soup *s, int32_t h)
{
    const int32_t g = s->twin[h], b = s->triangle[h], d = s->triangle[g];
    const int32_t from = from_of(s, g), to = to_of(s, g);
    const int32_t one[3] = {d, from, b}, other[3] = {d, b, to};
    memcpy(s->triangle + 3 * (size_t)(g / 3), one, sizeof one);
    memcpy(s->triangle + 3 * (size_t)(h / 3), other, sizeof other);
}

/* Flips mend the flat triangles that have no side of length 0: dropped, they would leave a slit. */
static int flip_flat(soup *s)
{
    int rc = DMK_OK;
    uint8_t *touched = NULL;
    size_t flips = 1;
    for (int pass = 0; pass < MOST_PASSES && flips > 0; pass++) {
        flips = 0;
        DMK_TRY(dmk_poll(s->ctx));
        free(touched);
        touched = NULL;
        DMK_TRY(DMK_NEW(s->ctx, touched, (size_t)s->n_triangles));
        for (int32_t t = 0, h, unused; t < s->n_triangles; t++) {
            if (touched[t] || !is_flat(s, t, &h) || h < 0) continue;
            if (flips == 0) DMK_TRY(join_edges(s)); /* the first of the pass */
            if (s->twin[h] < 0 || touched[s->twin[h] / 3] || is_flat(s, s->twin[h] / 3, &unused))
                continue;
            touched[t] = touched[s->twin[h] / 3] = 1;
            flip(s, h);
            flips++;
        }
        s->count->flipped_triangles += flips;
    }
done:
    free(touched);
    return rc;
}

/* ---- triangles that go ---------------------------------------------------------------------- */

typedef struct cornered {
    int32_t corner[3]; /* increasing */
    int32_t triangle;
} cornered;

static int by_corners(const void *left, const void *right)
{
    const cornered *a = left, *b = right;
    for (int k = 0; k < 3; k++) {
        if (a->corner[k] != b->corner[k]) return a->corner[k] < b->corner[k] ? -1 : 1;
    }
    return (a->triangle > b->triangle) - (a->triangle < b->triangle);
}

static cornered sorted_corners(const soup *s, int32_t t)
{
    const int32_t *c = s->triangle + 3 * (size_t)t;
    int32_t low = dmk_min_i(c[0], dmk_min_i(c[1], c[2])),
            high = dmk_max_i(c[0], dmk_max_i(c[1], c[2]));
    /* The middle one by exclusion; the sum of two of 31 bits fits 64. */
    int32_t middle = (int32_t)((int64_t)c[0] + c[1] + c[2] - low - high);
    return (cornered){{low, middle, high}, t};
}

static int drop_triangles(soup *s)
{
    int rc;
    cornered *list = NULL;
    bool *gone = NULL;
    int32_t n = 0, unused;
    DMK_TRY(DMK_NEW(s->ctx, gone, (size_t)s->n_triangles));
    DMK_TRY(DMK_NEW(s->ctx, list, (size_t)s->n_triangles));
    for (int32_t t = 0; t < s->n_triangles; t++) {
        gone[t] = is_flat(s, t, &unused);
        if (gone[t])
            s->count->degenerate_triangles++;
        else
            list[n++] = sorted_corners(s, t);
    }
    qsort(list, (size_t)n, sizeof *list, by_corners);
    for (int32_t i = 1; i < n; i++) {
        if (memcmp(list[i].corner, list[i - 1].corner, sizeof list[i].corner) != 0) continue;
        gone[list[i].triangle] = true;
        s->count->duplicate_triangles++;
    }
    n = 0;
    for (int32_t t = 0; t < s->n_triangles; t++) {
        if (gone[t]) continue;
        memmove(s->triangle + 3 * (size_t)n, s->triangle + 3 * (size_t)t, 3 * sizeof *s->triangle);
        s->old[n++] = t;
    }
    s->n_triangles = n;
done:
    free(gone);
    free(list);
    return rc;
}

/* ---- orientation ---------------------------------------------------------------------------- */

/* Do the two triangles of half-edge h run along their edge in the same direction, as they should not? */
static bool clash(const soup *s, int32_t h)
{
    int32_t g = s->twin[h];
    bool same = from_of(s, h) == from_of(s, g);
    return same != (s->turned[h / 3] != s->turned[g / 3]);
}

/* From the first triangle of a piece on; `room`: for its triangles. */
static void spread_turn(soup *s, int32_t start, int32_t *room)
{
    int32_t n = 0;
    room[n++] = start;
    s->piece[start] = start;
    for (int32_t i = 0; i < n; i++) {
        for (int32_t h = 3 * room[i]; h < 3 * room[i] + 3; h++) {
            int32_t g = s->twin[h];
            if (g < 0 || s->piece[g / 3] >= 0) continue;
            if (clash(s, h)) s->turned[g / 3] = 1;
            s->piece[g / 3] = start;
            room[n++] = g / 3;
        }
    }
}

/* Turn the triangles of each piece as its first one, and part edges at which a turn does not help. */
static int orient(soup *s)
{
    int rc;
    int32_t *room = NULL;
    DMK_TRY(DMK_NEW(s->ctx, s->piece, (size_t)s->n_triangles));
    DMK_TRY(DMK_NEW(s->ctx, room, (size_t)s->n_triangles));
    for (int32_t t = 0; t < s->n_triangles; t++) s->piece[t] = -1;
    for (int32_t t = 0; t < s->n_triangles; t++) {
        if (s->piece[t] < 0) spread_turn(s, t, room);
    }
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) {
        if (s->twin[h] < 0 || !clash(s, h)) continue;
        s->count->seam_edges++;
        s->twin[s->twin[h]] = -1;
        s->twin[h] = -1;
    }
done:
    free(room);
    return rc;
}

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

static int pair_edges(soup *s)
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

static int settle_edges(soup *s)
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
static int number_vertices(soup *s, const int32_t *first, int32_t *n_new)
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

/* ---- the whole ------------------------------------------------------------------------------ */

static int take(soup *s, const double *xyz, const int32_t *triangles)
{
    int rc;
    size_t n = (size_t)s->n_triangles;
    s->xyz = xyz;
    DMK_TRY(DMK_NEW(s->ctx, s->triangle, 3 * n));
    DMK_TRY(DMK_NEW(s->ctx, s->old, n));
    DMK_TRY(DMK_NEW(s->ctx, s->twin, 3 * n));
    DMK_TRY(DMK_NEW(s->ctx, s->turned, n));
    DMK_TRY(DMK_NEW(s->ctx, s->count->vertex_new, (size_t)s->n_vertices));
    memcpy(s->triangle, triangles, 3 * n * sizeof *triangles);
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) {
        int32_t v = triangles[h];
        bool exists = v >= 0 && v < s->n_vertices;
        if (exists && is_finite(point(s, v))) continue;
        rc = dmk_fail(s->ctx, DMK_E_MESH,
                      "triangle %d names vertex %d, which %s: no repair mends that", h / 3, v,
                      exists ? "has a coordinate that is not finite" : "does not exist");
        goto done;
    }
done:
    return rc;
}

/* The mended arrays as a mesh. */
static int adopt(soup *s, int32_t n_vertices, dmk_mesh **mesh)
{
    double *xyz = NULL;
    int rc = DMK_NEW(s->ctx, xyz, 3 * (size_t)n_vertices);
    if (rc != DMK_OK) return rc;
    for (int32_t v = 0; v < n_vertices; v++) {
        memcpy(xyz + 3 * (size_t)v, point(s, s->count->vertex_old[v]), 3 * sizeof *xyz);
    }
    for (int32_t t = 0; t < s->n_triangles; t++) {
        int32_t *c = s->triangle + 3 * (size_t)t, swap = c[1];
        if (!s->turned[t]) continue;
        c[1] = c[2];
        c[2] = swap;
    }
    s->count->triangle_old = s->old;
    s->old = NULL;
    rc = dmk_mesh_adopt(s->ctx, (size_t)n_vertices, xyz, (size_t)s->n_triangles, s->triangle, mesh);
    s->triangle = NULL;
    return rc;
}

int dmk_mesh_repair(dmk_context *ctx, size_t n_vertices, const double *xyz, size_t n_triangles,
                    const int32_t *triangles, dmk_repairs *repair, dmk_mesh **mesh)
{
    int rc;
    int32_t *first = NULL, n_new = 0;
    dmk_repairs done_here = {0};
    soup s = {.ctx = ctx, .count = &done_here};
    if (dmk_missing(ctx, "xyz", xyz, "triangles", triangles, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_counts(ctx, n_vertices, n_triangles));
    s.n_vertices = (int32_t)n_vertices;
    s.n_triangles = (int32_t)n_triangles;
    DMK_TRY(take(&s, xyz, triangles));
    DMK_TRY(DMK_NEW(ctx, first, n_vertices));
    DMK_TRY(merge_vertices(&s, first));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(flip_flat(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(drop_triangles(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(join_edges(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(orient(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(pair_edges(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(settle_edges(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(number_vertices(&s, first, &n_new));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(adopt(&s, n_new, mesh));
    done_here.n_old_vertices = n_vertices;
    done_here.n_vertices = (size_t)n_new;
    done_here.n_triangles = (size_t)s.n_triangles;
    if (repair) {
        *repair = done_here;
        done_here = (dmk_repairs){0};
    }
done:
    dmk_repairs_free(&done_here);
    free(first);
    free(s.triangle);
    free(s.old);
    free(s.twin);
    free(s.crowd);
    free(s.piece);
    free(s.turned);
    return rc;
}

void dmk_repairs_free(dmk_repairs *repair)
{
    if (!repair) return;
    free(repair->vertex_old);
    free(repair->vertex_new);
    free(repair->triangle_old);
    *repair = (dmk_repairs){0};
}
