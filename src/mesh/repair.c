/* Mending a triangle soup until it is a manifold, in seven steps: equal vertices become one; a triangle without
 * area gives way by a flip of its longest edge; triangles with a repeated corner, without area still, or there
 * twice go; triangles are turned to agree with their neighbours over edges of two, and where a surface has one
 * side only it is cut along the edges at which the turning fails; at an edge of more than two triangles those two
 * that fit best belong together, and so on; what is there twice by that, an edge between the same two vertices,
 * is joined in another way; a vertex whose triangles do not hang together becomes several. No edge of two
 * triangles is parted but on those cuts, and any soup is a manifold then. The last three steps are manifold.c's. */
#include "mesh/manifold.h"

#include "base/sets.h"
#include "base/vec3.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Rows of flat triangles are flipped one after another, in at most so many rounds. */
enum { MOST_PASSES = 64 };

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

/* Ends of an edge that is nothing but rounding are one vertex, too. */
static void join_near(soup *s, int32_t *first)
{
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) {
        const int32_t a = dmk_set_find(first, from_of(s, h)), b = dmk_set_find(first, to_of(s, h));
        if (a == b || !dmk_is_same_place(point(s, a), point(s, b))) continue;
        dmk_set_unite(first, a, b);
        s->count->merged_vertices++;
    }
    for (int32_t v = 0; v < s->n_vertices; v++) first[v] = dmk_set_find(first, v);
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
    join_near(s, first);
    for (int32_t h = 0; h < 3 * s->n_triangles; h++) s->triangle[h] = first[s->triangle[h]];
done:
    free(used);
    free(list);
    return rc;
}

/* ---- edges ---------------------------------------------------------------------------------- */

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
    /* The middle one by exclusion; the sum of three of 31 bits fits 64. */
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
    if (n == 0 && s->n_triangles > 0)
        rc = dmk_fail(s->ctx, DMK_E_MESH, "nothing to repair: no triangle has an area");
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
    DMK_TRY(dmk_repair_pair_edges(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_repair_settle_edges(&s));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_repair_number_vertices(&s, first, &n_new));
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
