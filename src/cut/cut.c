/* The surface cut open along the locus: the triangles that it crosses are split, then the corners of each
 * vertex that no uncut edge joins are separated. */
#include "base/sets.h"
#include "base/vec3.h"
#include "cut/cut.h"
#include "geodesic/finer.h"
#include "locus/cotree.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Share of an edge: the cut keeps away from its ends. tests/test_locus.c holds what more or less would give. */
static const double margin = 0.15;

typedef struct splitter {
    const dmk_geodesics *geodesics;
    const dmk_cotree *cotree; /* of these geodesics; NULL: the locus opens nothing */
    const dmk_order *order;   /* numbers that the mesh had before; NULL: its own */
    int32_t *point;           /* cotree->n: the new vertex on a crossing, or -1 */
    double *turn;             /* geodesics->mesh->n_vertices: see dmk_cut_sides; NULL: none turns */
    double *xyz;              /* 3 per vertex of the split mesh */
    int32_t *triangle;        /* 3 per triangle of the split mesh */
    int32_t *kin;  /* 3 per triangle: the mesh's corner (3t + k) whose family the corner is of */
    uint8_t *side; /* 3 per triangle: edge opposite the corner is to be cut */
    int32_t n_vertices, n_triangles,
        n_kept; /* n_kept: vertices of the geodesics' mesh, which come first */
} splitter;

/* A corner of a split triangle: a vertex, and the corner of the mesh on whose side of the cut it lies. */
typedef struct corner {
    int32_t vertex, kin;
} corner;

/* cut: the corner whose opposite edge is to be cut, or -1. */
static void add(splitter *k, corner a, corner b, corner c, int cut)
{
    const corner x[3] = {a, b, c};
    for (int i = 0; i < 3; i++) {
        k->triangle[3 * k->n_triangles + i] = x[i].vertex;
        k->kin[3 * k->n_triangles + i] = x[i].kin;
        k->side[3 * k->n_triangles + i] = i == cut;
    }
    k->n_triangles++;
}

/* Three points on the edges: a star around a point between them. */
static void split_in_six(splitter *k, int32_t t, const int32_t *v, const int32_t *p)
{
    const int32_t c = k->n_vertices++;
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int j = 0; j < 3; j++) sum += k->xyz[3 * (size_t)p[j] + i];
        k->xyz[3 * (size_t)c + i] = sum / 3;
    }
    for (int i = 0; i < 3; i++) {
        const int32_t kin = 3 * t + i;
        add(k, (corner){c, kin}, (corner){v[i], kin}, (corner){p[(i + 2) % 3], kin}, 1);
        add(k, (corner){c, kin}, (corner){p[(i + 1) % 3], kin}, (corner){v[i], kin}, 2);
    }
}

/* The part of a triangle between the corners b, c and the points q on the side a-b and r on c-a, which
 * the cut joins: by the diagonal that leaves the better triangles. */
static void split_rest(splitter *k, corner b, corner c, int32_t on_ab, int32_t on_ca)
{
    const corner q = {on_ab, b.kin}, r = {on_ca, c.kin};
    const double *xb = k->xyz + 3 * (size_t)b.vertex, *xc = k->xyz + 3 * (size_t)c.vertex;
    const double *xq = k->xyz + 3 * (size_t)on_ab, *xr = k->xyz + 3 * (size_t)on_ca;
    if (fmin(dmk_altitude_ratio(xq, xb, xc), dmk_altitude_ratio(xq, xc, xr)) >=
        fmin(dmk_altitude_ratio(xr, xq, xb), dmk_altitude_ratio(xr, xb, xc))) {
        add(k, q, b, c, -1);
        add(k, q, c, r, 1);
    } else {
        add(k, r, q, b, 2);
        add(k, r, b, c, -1);
    }
}

/* p[i]: the point on the edge opposite corner i, or -1. */
static void split(splitter *k, int32_t t, const int32_t *p)
{
    const int32_t *v = k->geodesics->mesh->triangle + 3 * t;
    const int n = (p[0] >= 0) + (p[1] >= 0) + (p[2] >= 0);
    corner c[3];
    for (int i = 0; i < 3; i++) c[i] = (corner){v[i], 3 * t + i};
    if (n == 3) {
        split_in_six(k, t, v, p);
    } else if (n == 0) {
        add(k, c[0], c[1], c[2], -1);
    } else if (n == 1) { /* the cut ends here */
        const int i = p[0] >= 0 ? 0 : p[1] >= 0 ? 1 : 2, i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        add(k, c[i], c[i1], (corner){p[i], c[i1].kin}, -1);
        add(k, c[i], (corner){p[i], c[i2].kin}, c[i2], -1);
    } else {
        const int i = p[0] < 0 ? 0 : p[1] < 0 ? 1 : 2, i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        add(k, c[i], (corner){p[i2], c[i].kin}, (corner){p[i1], c[i].kin}, 0);
        split_rest(k, c[i1], c[i2], p[i2], p[i1]);
    }
}

/* A slit of two edges at the farthest vertex, roughly opposite each other. */
static void slit(splitter *k)
{
    const dmk_geodesics *g = k->geodesics;
    int32_t far = 0, n = 0;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (g->distance[v] > g->distance[far]) far = v;
    }
    const int32_t first = g->star.first[far];
    for (int32_t c = first; n == 0 || c != first; n++) c = dmk_star_next(&g->star, c);
    for (int32_t i = 0, c = first; i < n; i++, c = dmk_star_next(&g->star, c)) {
        if (i != 0 && i != n / 2) continue;
        k->side[dmk_next(c)] = k->side[g->star.twin[dmk_next(c)]] = 1;
    }
}

/* How far directions turn to be those of their sides. */
static int find_turns(dmk_context *ctx, splitter *k)
{
    int rc;
    const dmk_mesh *m = k->geodesics->mesh;
    bool *crossed = NULL;
    DMK_TRY(DMK_NEW(ctx, crossed, 3 * (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, k->turn, (size_t)m->n_vertices));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++)
        crossed[h] = k->cotree->on[h] >= 0 && k->point[k->cotree->on[h]] >= 0;
    rc = dmk_cut_sides(ctx, k->geodesics, crossed, k->turn);
done:
    free(crossed);
    return rc;
}

static int allocate(dmk_context *ctx, int32_t n_points, splitter *k)
{
    int rc;
    const dmk_mesh *m = k->geodesics->mesh;
    const size_t corners = 3 * ((size_t)m->n_triangles + 4 * (size_t)n_points);
    if (k->cotree) DMK_TRY(DMK_NEW(ctx, k->point, (size_t)k->cotree->n));
    DMK_TRY(DMK_NEW(ctx, k->xyz, 3 * ((size_t)m->n_vertices + 2 * (size_t)n_points)));
    DMK_TRY(DMK_NEW(ctx, k->triangle, corners));
    DMK_TRY(DMK_NEW(ctx, k->kin, corners));
    DMK_TRY(DMK_NEW(ctx, k->side, corners));
    k->n_vertices = m->n_vertices;
    memcpy(k->xyz, m->xyz, 3 * (size_t)m->n_vertices * sizeof *k->xyz);
done:
    return rc;
}

/* The new vertex of crossing i, not too near to the ends of its edge. */
static void add_point(splitter *k, int32_t i)
{
    const dmk_mesh *m = k->geodesics->mesh;
    const int32_t h = k->cotree->crossing[i].half;
    dmk_locus_vertex v;
    dmk_place_crossing(k->cotree, i, &v);
    const double s = fmin(1 - margin, fmax(margin, v.place.weight[dmk_previous(h) % 3]));
    for (int j = 0; j < 3; j++) {
        k->xyz[3 * (size_t)k->n_vertices + j] =
            (1 - s) * m->xyz[3 * (size_t)m->triangle[dmk_next(h)] + j] +
            s * m->xyz[3 * (size_t)m->triangle[dmk_previous(h)] + j];
    }
    k->point[i] = k->n_vertices++;
}

static int32_t count_drawn(const dmk_cotree *t, double strength)
{
    int32_t n = 0;
    for (int32_t i = 0; i < t->n; i++) n += dmk_is_drawn(t, i, strength);
    return n;
}

/* Points on the edges that the locus crosses, then the split triangles. */
static int split_all(dmk_context *ctx, double strength, splitter *k)
{
    const dmk_cotree *t = k->cotree;
    int rc = allocate(ctx, t ? count_drawn(t, strength) : 0, k);
    if (rc != DMK_OK) return rc;
    for (int32_t i = 0; t && i < t->n; i++) {
        k->point[i] = -1;
        if (dmk_is_drawn(t, i, strength)) add_point(k, i);
    }
    for (int32_t i = 0; i < k->geodesics->mesh->n_triangles; i++) {
        int32_t p[3];
        for (int j = 0; j < 3; j++)
            p[j] = t && t->on[3 * i + j] >= 0 ? k->point[t->on[3 * i + j]] : -1;
        split(k, i, p);
    }
    return DMK_OK;
}

/* Pieces of a triangle that is almost flat may be flat: the culprit is that triangle. */
static int refuse_thin(dmk_context *ctx, const splitter *k)
{
    int32_t thin = 0;
    double least = INFINITY;
    for (int32_t i = 0; i < k->n_triangles; i++) {
        const int32_t *v = k->triangle + 3 * (size_t)i;
        double ratio = dmk_altitude_ratio(k->xyz + 3 * (size_t)v[0], k->xyz + 3 * (size_t)v[1],
                                          k->xyz + 3 * (size_t)v[2]);
        if (ratio < least) {
            least = ratio;
            thin = k->kin[3 * (size_t)i] / 3;
        }
    }
    int32_t v[3];
    for (int i = 0; i < 3; i++) {
        v[i] = k->geodesics->mesh->triangle[3 * (size_t)thin + i];
        if (k->order) v[i] = k->order->vertex_old[v[i]];
    }
    return dmk_fail(
        ctx, DMK_E_MESH,
        "triangle %d (vertices %d %d %d) is so thin that a piece which the cut makes of it "
        "has no area; join its nearest vertices, or move them apart",
        k->order ? k->order->triangle_old[thin] : thin, v[0], v[1], v[2]);
}

/* Sets of corners that uncut edges join. */
static int join_corners(dmk_context *ctx, const splitter *k, int32_t *parent)
{
    int rc;
    dmk_mesh *whole = NULL; /* the split mesh, for its edges */
    rc = dmk_mesh_create(ctx, (size_t)k->n_vertices, k->xyz, (size_t)k->n_triangles, k->triangle,
                         &whole);
    if (rc == DMK_E_MESH) rc = refuse_thin(ctx, k);
    if (rc != DMK_OK) goto done;
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < 3 * k->n_triangles; i++) parent[i] = i;
    for (int32_t e = 0; e < whole->n_edges; e++) {
        const int32_t *t = whole->edge_triangle + 2 * (size_t)e;
        int32_t at[2][2] = {{0}};
        bool uncut = t[1] >= 0;
        for (int s = 0; s < 2 && uncut; s++) {
            for (int32_t h = 3 * t[s]; h < 3 * t[s] + 3; h++) {
                if (whole->triangle_edge[h] == e && k->side[h]) uncut = false;
                if (whole->triangle[h] == whole->edge_vertex[2 * (size_t)e]) at[s][0] = h;
                if (whole->triangle[h] == whole->edge_vertex[2 * (size_t)e + 1]) at[s][1] = h;
            }
        }
        for (int i = 0; uncut && i < 2; i++) dmk_set_unite(parent, at[0][i], at[1][i]);
    }
done:
    dmk_mesh_destroy(&whole);
    return rc;
}

/* The vertices of the cut mesh: a corner that stands for each, those of the mesh first, in their order. */
static int number_corners(dmk_context *ctx, const splitter *k, int32_t *parent, int32_t **first,
                          int32_t *n)
{
    int rc;
    int32_t *number = NULL;
    const int32_t n_corners = 3 * k->n_triangles;
    DMK_TRY(DMK_NEW(ctx, number, (size_t)n_corners));
    DMK_TRY(DMK_NEW(ctx, *first, (size_t)k->n_vertices + (size_t)n_corners));
    for (int32_t v = 0; v < k->n_vertices; v++) (*first)[v] = -1;
    *n = k->n_vertices;
    for (int32_t c = 0; c < n_corners; c++) {
        const int32_t v = k->triangle[c], root = dmk_set_find(parent, c);
        if (root == c) {
            number[c] = (*first)[v] < 0 ? v : (*n)++;
            (*first)[number[c]] = c;
        }
        number[c] = number[root]; /* a set's name is its least member: numbered already */
    }
    memcpy(parent, number, (size_t)n_corners * sizeof *parent);
done:
    free(number);
    return rc;
}

static void rotate(double x[2], double angle)
{
    const double was = x[0];
    x[0] = cos(angle) * was - sin(angle) * x[1];
    x[1] = sin(angle) * was + cos(angle) * x[1];
}

/* In the plane, on the side of the cut on which this corner lies. */
static void place(const splitter *k, int32_t kin, const double xyz[3], double map[2])
{
    dmk_place_in_plane(k->geodesics, kin, xyz, map);
    const double turn = k->turn ? k->turn[k->geodesics->mesh->triangle[kin]] : 0;
    if (turn != 0) rotate(map, turn);
}

static int separate(dmk_context *ctx, const splitter *k, dmk_mesh **cut, int32_t **origin,
                    double **plane)
{
    int rc;
    int32_t *number = NULL, *first = NULL, n;
    double *xyz = NULL;
    DMK_TRY(DMK_NEW(ctx, number, 3 * (size_t)k->n_triangles));
    DMK_TRY(join_corners(ctx, k, number));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(number_corners(ctx, k, number, &first, &n));
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)n));
    DMK_TRY(DMK_NEW(ctx, *origin, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, *plane, 2 * (size_t)n));
    for (int32_t v = 0; v < n; v++) {
        const int32_t c = first[v], old = k->triangle[c];
        memcpy(xyz + 3 * (size_t)v, k->xyz + 3 * (size_t)old, 3 * sizeof *xyz);
        (*origin)[v] = old < k->n_kept ? old : -1;
        place(k, k->kin[c], xyz + 3 * (size_t)v, *plane + 2 * (size_t)v);
    }
    DMK_TRY(dmk_poll(ctx));
    rc = dmk_mesh_adopt(ctx, (size_t)n, xyz, (size_t)k->n_triangles, number, cut);
    xyz = NULL;
    number = NULL;
    if (rc == DMK_OK) rc = dmk_plane_unfold(ctx, *cut, *plane);
done:
    free(number);
    free(first);
    free(xyz);
    return rc;
}

/* Directions of the finer mesh to those of the geodesics' own. */
static void turn_back(const dmk_finer *f, size_t n, double *plane)
{
    const double angle = f->turn[0] * dmk_turn_scale(f->geodesics);
    for (size_t i = 0; i < n; i++) rotate(plane + 2 * i, -angle);
}

/* Along the locus of the finer geodesics; where it opens nothing, the mesh of g itself. */
static int open_along(dmk_context *ctx, const dmk_geodesics *g, const dmk_finer *f,
                      const dmk_locus_options *opt, const dmk_order *order, dmk_mesh **cut,
                      int32_t **origin, double **plane)
{
    int rc;
    dmk_cotree t = {0};
    splitter k = {.geodesics = g, .order = order, .n_kept = g->mesh->n_vertices};
    DMK_TRY(dmk_cotree_complete(ctx, f->geodesics, f->mean_edge, &t));
    DMK_TRY(dmk_poll(ctx));
    const double strength = dmk_strength_asked(&t, opt);
    const bool is_tree = t.last >= 0; /* of a sphere: what crosses two edges opens nothing there */
    if (count_drawn(&t, strength) > (is_tree ? 2 : 0)) {
        k.geodesics = f->geodesics;
        k.cotree = &t;
        if (f->mesh) k.order = NULL;
    }
    DMK_TRY(split_all(ctx, strength, &k));
    if (k.cotree) DMK_TRY(find_turns(ctx, &k));
    if (!k.cotree && is_tree) slit(&k);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(separate(ctx, &k, cut, origin, plane));
    if (k.geodesics != g) turn_back(f, (size_t)(*cut)->n_vertices, *plane);
done:
    if (rc != DMK_OK) {
        free(*origin);
        free(*plane);
        *origin = NULL;
        *plane = NULL;
    }
    free(k.point);
    free(k.turn);
    free(k.xyz);
    free(k.triangle);
    free(k.kin);
    free(k.side);
    dmk_cotree_free(&t);
    return rc;
}

int dmk_locus_cut(dmk_context *ctx, const dmk_geodesics *g, const dmk_locus_options *opt,
                  const dmk_order *order, dmk_mesh **cut, int32_t **origin, double **plane)
{
    int rc;
    dmk_finer f;
    const dmk_finer none = {.geodesics = g, .mean_edge = g->mesh->info.mean_edge};
    *origin = NULL;
    *plane = NULL;
    DMK_TRY(dmk_finer_create(ctx, g, &f));
    rc = open_along(ctx, g, &f, opt, order, cut, origin, plane);
    if (rc == DMK_E_MESH && f.mesh) /* pieces of slivers' parts may be flat */
        rc = open_along(ctx, g, &none, opt, order, cut, origin, plane);
done:
    dmk_finer_free(&f);
    return rc;
}
