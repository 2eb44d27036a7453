/* The surface cut open along the locus: the triangles that it crosses are split, and the points on it have a vertex
 * for each side. */
#include "base/parallel.h"
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
    const dmk_seam *seam;   /* on their mesh; NULL: the locus opens nothing */
    const dmk_order *order; /* numbers that the mesh had before; NULL: its own */
    int32_t *number;        /* geodesics->mesh->n_vertices: those vertices in the cut mesh */
    int32_t *on;            /* 3 geodesics->mesh->n_triangles: point of the seam, or -1 */
    int32_t (*side)[2];     /* seam->n: vertices beside the half-edge's start and end */
    double *turn;           /* geodesics->mesh->n_vertices: see dmk_cut_sides; NULL: none turns */
    double back;            /* directions turn back by so much */
    int32_t *kin;           /* new vertices: the mesh's corner whose family they are of */
    double *xyz, *plane;    /* 3 and 2 per vertex of the cut mesh */
    int32_t *origin;        /* vertices of the cut mesh */
    int32_t *triangle;      /* 3 per triangle of the cut mesh */
    int32_t n_vertices, n_triangles;
    int32_t n_old; /* vertices of the mesh that was given, which are the first of the geodesics' */
    int32_t thin;  /* the triangle with the thinnest piece */
    double least;  /* altitude ratio of that */
} splitter;

/* A new vertex, of the family of that corner. */
static int32_t add_vertex(splitter *k, int32_t kin, const double xyz[3])
{
    const int32_t v = k->n_vertices++;
    k->kin[v - k->geodesics->mesh->n_vertices] = kin;
    k->origin[v] = -1;
    memcpy(k->xyz + 3 * (size_t)v, xyz, 3 * sizeof *xyz);
    return v;
}

static void add(splitter *k, int32_t a, int32_t b, int32_t c)
{
    int32_t *v = k->triangle + 3 * (size_t)k->n_triangles++;
    v[0] = a;
    v[1] = b;
    v[2] = c;
}

/* Three points on the edges: a star around a point between them, which has a vertex for each of the corners. */
static void split_in_six(splitter *k, int32_t t, const int32_t *v, int32_t p[3][2])
{
    double xyz[3];
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int j = 0; j < 3; j++) sum += k->xyz[3 * (size_t)p[j][0] + i];
        xyz[i] = sum / 3;
    }
    for (int i = 0; i < 3; i++) {
        const int32_t c = add_vertex(k, 3 * t + i, xyz);
        add(k, c, v[i], p[(i + 2) % 3][0]);
        add(k, c, p[(i + 1) % 3][1], v[i]);
    }
}

/* The part of a triangle between the corners b, c and the points q on the side a-b and r on c-a, which
 * the cut joins: by the diagonal that leaves the better triangles. */
static void split_rest(splitter *k, int32_t b, int32_t c, int32_t q, int32_t r)
{
    const double *xb = k->xyz + 3 * (size_t)b, *xc = k->xyz + 3 * (size_t)c;
    const double *xq = k->xyz + 3 * (size_t)q, *xr = k->xyz + 3 * (size_t)r;
    if (fmin(dmk_altitude_ratio(xq, xb, xc), dmk_altitude_ratio(xq, xc, xr)) >=
        fmin(dmk_altitude_ratio(xr, xq, xb), dmk_altitude_ratio(xr, xb, xc))) {
        add(k, q, b, c);
        add(k, q, c, r);
    } else {
        add(k, r, q, b);
        add(k, r, b, c);
    }
}

/* How many of a triangle's edges the seam crosses. */
static int count_crossed(const splitter *k, int32_t t)
{
    const int32_t *on = k->on + 3 * (size_t)t;
    return (on[0] >= 0) + (on[1] >= 0) + (on[2] >= 0);
}

/* The pieces of triangle t, from the first one on. */
static void watch_thin(splitter *k, int32_t t, int32_t first)
{
    for (int32_t i = first; i < k->n_triangles; i++) {
        const int32_t *v = k->triangle + 3 * (size_t)i;
        const double ratio = dmk_altitude_ratio(
            k->xyz + 3 * (size_t)v[0], k->xyz + 3 * (size_t)v[1], k->xyz + 3 * (size_t)v[2]);
        if (ratio < k->least) k->thin = t;
        k->least = fmin(k->least, ratio);
    }
}

/* p[i]: the vertices on the edge opposite corner i, beside corners i + 1 and i + 2. */
static void split(splitter *k, int32_t t)
{
    int32_t v[3], p[3][2] = {{0}};
    const int32_t first = k->n_triangles;
    const int n = count_crossed(k, t);
    for (int i = 0; i < 3; i++) {
        const int32_t at = k->on[3 * t + i];
        v[i] = k->number[k->geodesics->mesh->triangle[3 * t + i]];
        if (at < 0) continue;
        const bool own = k->seam->point[at].half == 3 * t + i;
        p[i][0] = k->side[at][own ? 0 : 1];
        p[i][1] = k->side[at][own ? 1 : 0];
    }
    if (n == 3) {
        split_in_six(k, t, v, p);
    } else if (n == 0) {
        add(k, v[0], v[1], v[2]);
    } else { /* the edge opposite corner i is the only one that is crossed, or that is not */
        int i = 0;
        while ((k->on[3 * t + i] >= 0) != (n == 1)) i++;
        const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        if (n == 1) { /* the cut ends here: both vertices are one */
            add(k, v[i], v[i1], p[i][0]);
            add(k, v[i], p[i][0], v[i2]);
        } else {
            add(k, v[i], p[i2][0], p[i1][1]);
            split_rest(k, v[i1], v[i2], p[i2][1], p[i1][0]);
        }
    }
    if (n > 0) watch_thin(k, t, first);
}

/* A slit of two edges at the farthest vertex, roughly opposite each other: the corners between them have another
 * vertex. */
static void slit(splitter *k)
{
    const dmk_geodesics *g = k->geodesics;
    int32_t far = 0, n = 0;
    for (int32_t v = 0; v < g->mesh->n_vertices; v++) {
        if (g->distance[v] > g->distance[far]) far = v;
    }
    const int32_t first = g->star.first[far];
    for (int32_t c = first; n == 0 || c != first; n++) c = dmk_star_next(&g->star, c);
    const int32_t old = k->number[far];
    const int32_t other = add_vertex(k, first, k->xyz + 3 * (size_t)old);
    k->origin[other] = k->origin[old];
    for (int32_t i = 0, c = first; i < n / 2; i++) {
        c = dmk_star_next(&g->star, c);
        k->triangle[c] = other;
    }
}

/* How far directions turn to be those of their sides. */
static int find_turns(dmk_context *ctx, splitter *k)
{
    int rc;
    const dmk_mesh *m = k->geodesics->mesh;
    bool *crossed = NULL;
    DMK_TRY(DMK_NEW_UNSET(ctx, crossed, 3 * (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, k->turn, (size_t)m->n_vertices));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) crossed[h] = k->on[h] >= 0;
    rc = dmk_cut_sides(ctx, k->geodesics, crossed, k->turn);
done:
    free(crossed);
    return rc;
}

/* The vertices of the mesh in the cut one: those that had a number before, in the order of these, then the others. */
static int number_vertices(dmk_context *ctx, splitter *k)
{
    int rc;
    const int32_t n = k->geodesics->mesh->n_vertices, n_old = k->n_old;
    int32_t *at = NULL, end = 0;
    DMK_TRY(DMK_NEW_UNSET(ctx, k->number, (size_t)n));
    for (int32_t v = 0; v < n; v++) k->number[v] = v;
    for (int32_t v = 0; k->order && v < n_old; v++)
        end = dmk_max_i(end, k->order->vertex_old[v] + 1);
    DMK_TRY(DMK_NEW(ctx, at, (size_t)end));
    for (int32_t v = 0; v < n_old && end > 0; v++) at[k->order->vertex_old[v]] = v + 1;
    for (int32_t old = 0, next = 0; old < end; old++)
        if (at[old] > 0) k->number[at[old] - 1] = next++;
done:
    free(at);
    return rc;
}

static int allocate(dmk_context *ctx, splitter *k)
{
    int rc;
    const dmk_mesh *m = k->geodesics->mesh;
    const size_t n_points = k->seam ? (size_t)k->seam->n : 0;
    const size_t n_new =
        4 * n_points + 1; /* three in a triangle where three of them meet; a slit's */
    const size_t n = (size_t)m->n_vertices + n_new;
    DMK_TRY(number_vertices(ctx, k));
    DMK_TRY(DMK_NEW_UNSET(ctx, k->on, 3 * (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, k->side, n_points));
    DMK_TRY(DMK_NEW(ctx, k->kin, n_new));
    DMK_TRY(DMK_NEW_UNSET(ctx, k->xyz, 3 * n));
    DMK_TRY(DMK_NEW_UNSET(ctx, k->plane, 2 * n));
    DMK_TRY(DMK_NEW_UNSET(ctx, k->origin, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, k->triangle, 3 * ((size_t)m->n_triangles + 4 * n_points)));
    for (int32_t v = 0; v < m->n_vertices; v++) {
        const size_t to = (size_t)k->number[v];
        memcpy(k->xyz + 3 * to, m->xyz + 3 * (size_t)v, 3 * sizeof *k->xyz);
        k->origin[to] = v >= k->n_old ? -1 : k->order ? k->order->vertex_old[v] : v;
    }
done:
    return rc;
}

/* The vertices on a point of the seam, not too near to the ends of its edge: one for each side, or one for both where
 * the cut ends behind the edge. */
static void add_point(splitter *k, int32_t i)
{
    const dmk_mesh *m = k->geodesics->mesh;
    const int32_t h = k->seam->point[i].half, twin = k->geodesics->star.twin[h];
    const double s = fmin(1 - margin, fmax(margin, k->seam->point[i].share));
    const double *a = m->xyz + 3 * (size_t)m->triangle[dmk_next(h)],
                 *b = m->xyz + 3 * (size_t)m->triangle[dmk_previous(h)];
    double xyz[3];
    for (int j = 0; j < 3; j++) xyz[j] = (1 - s) * a[j] + s * b[j];
    const bool ends =
        count_crossed(k, h / 3) == 1 || (twin >= 0 && count_crossed(k, twin / 3) == 1);
    k->side[i][0] = add_vertex(k, dmk_next(h), xyz);
    k->side[i][1] = ends ? k->side[i][0] : add_vertex(k, dmk_previous(h), xyz);
}

/* Points on the edges that the locus crosses, then the split triangles. */
static void split_all(splitter *k)
{
    const dmk_mesh *m = k->geodesics->mesh;
    const int32_t n_points = k->seam ? k->seam->n : 0;
    k->n_vertices = m->n_vertices;
    memset(k->on, -1, 3 * (size_t)m->n_triangles * sizeof *k->on);
    for (int32_t i = 0; i < n_points; i++) {
        const int32_t h = k->seam->point[i].half, twin = k->geodesics->star.twin[h];
        k->on[h] = i;
        if (twin >= 0) k->on[twin] = i;
    }
    for (int32_t i = 0; i < n_points; i++) add_point(k, i);
    for (int32_t t = 0; t < m->n_triangles; t++) split(k, t);
}

/* Pieces of a triangle that is almost flat may be flat. */
static int refuse_thin(dmk_context *ctx, const splitter *k)
{
    int32_t v[3];
    bool rounding = false;
    const dmk_mesh *m = k->geodesics->mesh;
    const dmk_order *order =
        k->n_old < m->n_vertices ? NULL : k->order; /* of a finer one none knows */
    for (int i = 0; i < 3; i++) {
        const int32_t *corner = m->triangle + 3 * (size_t)k->thin;
        const double *from = m->xyz + 3 * (size_t)corner[i];
        rounding |= dmk_is_same_place(from, m->xyz + 3 * (size_t)corner[(i + 1) % 3]);
        v[i] = corner[i];
        if (order) v[i] = order->vertex_old[v[i]];
    }
    return dmk_fail(
        ctx, DMK_E_MESH,
        "triangle %d (vertices %d %d %d) is so thin that a piece which the cut makes of it "
        "has no area; join its nearest vertices, %s",
        order ? order->triangle_old[k->thin] : k->thin, v[0], v[1], v[2],
        rounding ? "as a repair does" : "or move them apart");
}

/* By the family of the corner, at a point of its triangle. */
static dmk_polar map_point(const dmk_geodesics *g, int32_t corner, const double xyz[3])
{
    const int32_t h = dmk_previous(corner), v = g->mesh->triangle[corner]; /* h begins there */
    const double *origin = g->mesh->xyz + 3 * (size_t)v;
    const dmk_image image = dmk_image_at_start(g, h);
    double e[3], p[3];
    dmk_subtract(g->mesh->xyz + 3 * (size_t)g->mesh->triangle[dmk_previous(h)], origin, e);
    dmk_subtract(xyz, origin, p);
    const double x = dmk_in_units(g, dmk_dot(p, e) / sqrt(dmk_dot(e, e)));
    const double square = dmk_in_units(g, dmk_in_units(g, dmk_dot(p, p))) - x * x;
    const double y = square > 0 ? sqrt(square) : 0;
    double around = dmk_ray_from(g, v, g->arrival + v, g->star.angle[corner]).turn - atan2(y, x);
    if (!g->star.border[v]) around = remainder(around, g->star.total[v]);
    if (fabs(around) >= M_PI) { /* in the shadow of the corner itself */
        return (dmk_polar){g->distance[v] + dmk_distance(xyz, origin),
                           dmk_turn_scale(g) * g->arrival[v].direction};
    }
    return dmk_polar_of(g, v, &image, 0, x, y);
}

/* How near to the source a point of triangle t may lie, by the corners. */
static double least_distance(const dmk_geodesics *g, int32_t t, const double xyz[3])
{
    double least = 0;
    for (int i = 0; i < 3; i++) {
        const int32_t v = g->mesh->triangle[3 * (size_t)t + (size_t)i];
        least = fmax(least, g->distance[v] - dmk_distance(g->mesh->xyz + 3 * (size_t)v, xyz));
    }
    return least;
}

/* That, where the family reaches the point: else its straight way is shorter than any path. */
static dmk_polar place_new(const dmk_geodesics *g, int32_t corner, const double xyz[3])
{
    dmk_polar at = map_point(g, corner, xyz);
    at.distance = fmax(at.distance, least_distance(g, corner / 3, xyz));
    return at;
}

/* Vertices in the plane, each on its side of the cut. */
static void place(int32_t begin, int32_t end, void *data)
{
    const splitter *k = data;
    const dmk_geodesics *g = k->geodesics;
    const int32_t n = g->mesh->n_vertices;
    const double scale = dmk_turn_scale(g);
    for (int32_t i = begin; i < end; i++) {
        const int32_t to = i < n ? k->number[i] : i, kin = i < n ? -1 : k->kin[i - n];
        const int32_t v = i < n ? i : g->mesh->triangle[kin];
        const dmk_polar at = i < n ? (dmk_polar){g->distance[v], scale * g->arrival[v].direction}
                                   : place_new(g, kin, k->xyz + 3 * (size_t)i);
        const double direction = at.direction + (k->turn ? k->turn[v] : 0) - k->back;
        k->plane[2 * (size_t)to] = at.distance * cos(direction);
        k->plane[2 * (size_t)to + 1] = at.distance * sin(direction);
    }
}

/* The cut mesh takes over what it consists of. */
static int finish(dmk_context *ctx, splitter *k, dmk_mesh **cut)
{
    double *xyz = k->xyz;
    int32_t *triangle = k->triangle;
    k->xyz = NULL;
    k->triangle = NULL;
    return dmk_mesh_adopt(ctx, (size_t)k->n_vertices, xyz, (size_t)k->n_triangles, triangle, cut);
}

static void free_splitter(splitter *k)
{
    free(k->number);
    free(k->on);
    free(k->side);
    free(k->turn);
    free(k->kin);
    free(k->xyz);
    free(k->plane);
    free(k->origin);
    free(k->triangle);
}

/* What is made. */
typedef struct outcome {
    dmk_mesh **mesh;
    int32_t **origin;
    double **plane;
} outcome;

static bool opens(const dmk_seam *seam)
{
    return seam->n >
           (seam->is_tree ? 2 : 0); /* of a sphere: what crosses two edges opens nothing there */
}

/* The mesh of g, or a finer one of which directions turn back by so much. */
static int open_along(dmk_context *ctx, const dmk_geodesics *g, const dmk_seam *seam,
                      const dmk_order *order, int32_t n_old, double back, const outcome *out)
{
    int rc;
    splitter k = {.geodesics = g,
                  .seam = opens(seam) ? seam : NULL,
                  .order = order,
                  .n_old = n_old,
                  .back = back,
                  .least = INFINITY};
    DMK_TRY(allocate(ctx, &k));
    split_all(&k);
    DMK_TRY(dmk_poll(ctx));
    if (k.seam) DMK_TRY(find_turns(ctx, &k));
    if (!k.seam && seam->is_tree) slit(&k);
    DMK_TRY(dmk_poll(ctx));
    dmk_parallel(ctx, k.n_vertices, place, &k);
    DMK_TRY(dmk_poll(ctx));
    rc = finish(ctx, &k, out->mesh);
    if (rc == DMK_E_MESH && isfinite(k.least)) rc = refuse_thin(ctx, &k);
    if (rc == DMK_OK) rc = dmk_plane_unfold(ctx, *out->mesh, k.plane);
    if (rc != DMK_OK) goto done;
    *out->origin = k.origin;
    *out->plane = k.plane;
    k.origin = NULL;
    k.plane = NULL;
done:
    free_splitter(&k);
    return rc;
}

/* On the geodesics that the locus is traced on; where it opens nothing, on the mesh of g itself. */
static int open_finer(dmk_context *ctx, const dmk_geodesics *g, const dmk_finer *f,
                      const dmk_seam *seam, const dmk_order *order, const outcome *out)
{
    const bool finer = f->mesh && opens(seam);
    return open_along(ctx, finer ? f->geodesics : g, seam, order, g->mesh->n_vertices,
                      finer ? f->turn[0] * dmk_turn_scale(f->geodesics) : 0, out);
}

static int trace_and_open(dmk_context *ctx, const dmk_geodesics *g, const dmk_finer *f,
                          const dmk_locus_options *opt, const dmk_order *order, const outcome *out)
{
    int rc;
    dmk_cotree t = {0};
    dmk_seam *seam = NULL;
    DMK_TRY(dmk_cotree_complete(ctx, f->geodesics, f->mean_edge, &t));
    DMK_TRY(dmk_seam_create(ctx, &t, opt, &seam));
    dmk_cotree_free(&t);
    DMK_TRY(dmk_poll(ctx));
    rc = open_finer(ctx, g, f, seam, order, out);
done:
    dmk_cotree_free(&t);
    free(seam);
    return rc;
}

/* seam: NULL if it is still to be traced. */
static int cut_open(dmk_context *ctx, const dmk_geodesics *g, const dmk_seam *seam,
                    const dmk_locus_options *opt, const dmk_order *order, const outcome *out)
{
    int rc;
    const dmk_finer none = {.geodesics = g, .mean_edge = g->mesh->info.mean_edge};
    dmk_finer f = none;
    if (!seam || opens(seam)) DMK_TRY(dmk_finer_create(ctx, g, &f));
    rc = seam ? open_finer(ctx, g, &f, seam, order, out)
              : trace_and_open(ctx, g, &f, opt, order, out);
    if (rc == DMK_E_MESH && f.mesh) /* pieces of slivers' parts may be flat */
        rc = trace_and_open(ctx, g, &none, opt, order, out);
done:
    dmk_finer_free(&f);
    return rc;
}

int dmk_seam_cut(dmk_context *ctx, const dmk_geodesics *g, const dmk_seam *seam,
                 const dmk_order *order, dmk_mesh **cut, int32_t **origin, double **plane)
{
    const dmk_locus_options opt = {.strength = seam->asked};
    const outcome out = {cut, origin, plane};
    return cut_open(ctx, g, seam, &opt, order, &out);
}

int dmk_locus_cut(dmk_context *ctx, const dmk_geodesics *g, const dmk_locus_options *opt,
                  const dmk_order *order, dmk_mesh **cut, int32_t **origin, double **plane)
{
    const outcome out = {cut, origin, plane};
    return cut_open(ctx, g, NULL, opt, order, &out);
}
