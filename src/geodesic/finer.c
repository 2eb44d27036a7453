/* The same surface with finer triangles. Flat: distances, paths and the cut locus are those of the mesh. */
#include "base/heap.h"
#include "base/vec3.h"
#include "geodesic/finer.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* No edge is longer afterwards, in mean edges; on a mesh of few triangles in those of one of so many. That is asked for
 * by few triangles, or by a share of all length in edges of more than twice that: scans have up to 0.07 there, machine
 * parts 0.1 and more. bench/results/finer.md */
static const double longest = 2, share = 0.1;
enum { FEW = 5000, MOST = 8 }; /* MOST: times as many triangles; printers' beds take 6 */

typedef struct bisection {
    double *xyz, length; /* no edge longer */
    int32_t *triangle, *twin, *parent,
        *next; /* next: triangle that follows in its parent, -1: none */
    size_t n_vertices, n_triangles, vertex_room, room[4];
    dmk_heap heap; /* half-edges by length, the longest first; those that have become others, too */
} bisection;

static double length_of(const bisection *b, int32_t h)
{
    return dmk_distance(b->xyz + 3 * (size_t)b->triangle[dmk_next(h)],
                        b->xyz + 3 * (size_t)b->triangle[dmk_previous(h)]);
}

static int push(dmk_context *ctx, bisection *b, int32_t h)
{
    const double length = length_of(b, h);
    return length > b->length ? dmk_heap_push(ctx, &b->heap, -length, h) : DMK_OK;
}

static void join(bisection *b, int32_t h, int32_t o)
{
    b->twin[h] = o;
    if (o >= 0) b->twin[o] = h;
}

/* From the corner opposite half-edge h to m on it: the half at the start of h stays in place, and the other follows, so
 * that corners at a vertex keep their order. Returns the new triangle's half-edge on h. */
static int32_t split(bisection *b, int32_t h, int32_t m)
{
    const int32_t t = h / 3, u = (int32_t)b->n_triangles++, g = 3 * u + h % 3;
    b->parent[u] = b->parent[t];
    b->next[u] = b->next[t];
    b->next[t] = u;
    b->triangle[g] = b->triangle[h];
    b->triangle[dmk_next(g)] = m;
    b->triangle[dmk_previous(g)] = b->triangle[dmk_previous(h)];
    b->triangle[dmk_previous(h)] = m;
    join(b, dmk_next(g), b->twin[dmk_next(h)]);
    join(b, dmk_next(h), dmk_previous(g));
    return g;
}

static int make_room(dmk_context *ctx, bisection *b, size_t n_vertices, size_t n_triangles)
{
    int rc;
    DMK_TRY(DMK_GROW(ctx, b->xyz, 3 * n_vertices, b->vertex_room));
    DMK_TRY(DMK_GROW(ctx, b->triangle, 3 * n_triangles, b->room[0]));
    DMK_TRY(DMK_GROW(ctx, b->twin, 3 * n_triangles, b->room[1]));
    DMK_TRY(DMK_GROW(ctx, b->parent, n_triangles, b->room[2]));
    DMK_TRY(DMK_GROW(ctx, b->next, n_triangles, b->room[3]));
done:
    return rc;
}

static int bisect(dmk_context *ctx, bisection *b, int32_t h)
{
    int rc;
    const int32_t o = b->twin[h], m = (int32_t)b->n_vertices++;
    const int32_t start = b->triangle[dmk_next(h)], end = b->triangle[dmk_previous(h)];
    DMK_TRY(make_room(ctx, b, b->n_vertices, b->n_triangles + 2));
    for (int k = 0; k < 3; k++)
        b->xyz[3 * m + k] = 0.5 * (b->xyz[3 * start + k] + b->xyz[3 * end + k]);
    const int32_t g = split(b, h, m), p = o < 0 ? -1 : split(b, o, m);
    join(b, h, p);
    join(b, g, o);
    const int32_t changed[] = {h, g, dmk_next(h), dmk_next(g), dmk_next(o), dmk_next(p)};
    for (int k = 0; k < (o < 0 ? 4 : 6); k++) DMK_TRY(push(ctx, b, changed[k]));
done:
    return rc;
}

static int begin(dmk_context *ctx, const dmk_geodesics *g, bisection *b)
{
    int rc;
    const dmk_mesh *m = g->mesh;
    const size_t nt = (size_t)m->n_triangles, nv = (size_t)m->n_vertices;
    DMK_TRY(make_room(ctx, b, nv, nt));
    memcpy(b->xyz, m->xyz, 3 * nv * sizeof *b->xyz);
    memcpy(b->triangle, m->triangle, 3 * nt * sizeof *b->triangle);
    memcpy(b->twin, g->star.twin, 3 * nt * sizeof *b->twin);
    b->n_vertices = nv;
    b->n_triangles = nt;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        b->parent[t] = t;
        b->next[t] = -1;
    }
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (b->twin[h] < h) DMK_TRY(push(ctx, b, h));
    }
done:
    return rc;
}

/* Into the order of the parents. */
static int finish(dmk_context *ctx, bisection *b, int32_t n_parents, dmk_finer *f)
{
    int rc;
    int32_t *triangle = NULL, n = 0;
    DMK_TRY(DMK_NEW(ctx, f->first, (size_t)n_parents + 1));
    DMK_TRY(DMK_NEW(ctx, f->parent, b->n_triangles));
    DMK_TRY(DMK_NEW(ctx, triangle, 3 * b->n_triangles));
    for (int32_t parent = 0; parent < n_parents; parent++) {
        for (int32_t t = parent; t >= 0; t = b->next[t]) {
            memcpy(triangle + 3 * (size_t)n, b->triangle + 3 * (size_t)t, 3 * sizeof *triangle);
            f->parent[n++] = parent;
        }
        f->first[parent + 1] = n;
    }
    rc = dmk_mesh_adopt(ctx, b->n_vertices, b->xyz, b->n_triangles, triangle, &f->mesh);
    b->xyz = NULL;
    triangle = NULL;
done:
    free(triangle);
    return rc;
}

static int make_mesh(dmk_context *ctx, const dmk_geodesics *g, double length, dmk_finer *f)
{
    int rc;
    bisection b = {.length = length};
    const int32_t n = dmk_max_i(g->mesh->n_triangles, FEW);
    const int32_t most = dmk_min_i(n, DMK_EXACT_TRIANGLES / MOST) * MOST;
    DMK_TRY(begin(ctx, g, &b));
    while (b.heap.n > 0 && b.n_triangles < (size_t)most) {
        const dmk_heap_item next = dmk_heap_pop(&b.heap);
        if (length_of(&b, next.item) == -next.key) DMK_TRY(bisect(ctx, &b, next.item));
    }
    DMK_TRY(finish(ctx, &b, g->mesh->n_triangles, f));
done:
    free(b.xyz);
    free(b.triangle);
    free(b.twin);
    free(b.parent);
    free(b.next);
    dmk_heap_free(&b.heap);
    return rc;
}

/* The point in the finer mesh. */
static dmk_point place_in(const dmk_finer *f, const dmk_point *at, const double xyz[3])
{
    dmk_point best = {f->first[at->triangle], {1, 0, 0}};
    double least = HUGE_VAL, w[3];
    for (int32_t t = f->first[at->triangle]; t < f->first[at->triangle + 1]; t++) {
        const double d = dmk_mesh_nearest_in(f->mesh, t, xyz, w);
        if (!(d < least)) continue;
        least = d;
        best = (dmk_point){t, {w[0], w[1], w[2]}};
    }
    dmk_point_snap(best.weight);
    return best;
}

/* The direction, in the finer mesh's chart of a source, of what is 0 in the mesh's own. */
static double turn_of(const dmk_geodesics *g, const dmk_finer *f, const double xyz[3], int32_t i)
{
    const dmk_site *s = &f->geodesics->source[i];
    const int32_t zero = dmk_next(g->source[i].sector[0].half);
    double to[3], least = HUGE_VAL, turn = 0;
    dmk_subtract(g->mesh->xyz + 3 * (size_t)g->mesh->triangle[zero], xyz, to);
    for (int32_t k = 0; k < s->n_sectors; k++) {
        const int32_t h = s->sector[k].half;
        double a[3], b[3], across[3], side[3];
        if (f->parent[h / 3] != zero / 3) continue;
        dmk_subtract(f->mesh->xyz + 3 * (size_t)f->mesh->triangle[dmk_next(h)], xyz, a);
        dmk_subtract(f->mesh->xyz + 3 * (size_t)f->mesh->triangle[dmk_previous(h)], xyz, b);
        dmk_cross(a, to, across);
        dmk_cross(a, b, side);
        const double angle = atan2(sqrt(dmk_dot(across, across)), dmk_dot(a, to));
        const double within = dmk_dot(across, side) < 0 ? 0 : fmin(angle, s->sector[k].span);
        if (!(angle - within < least)) continue;
        least = angle - within;
        turn = s->sector[k].angle + within;
    }
    return turn;
}

static int run(dmk_context *ctx, const dmk_geodesics *g, dmk_finer *f)
{
    int rc;
    dmk_point *source = NULL;
    double *offset = NULL, xyz[3];
    bool finished;
    dmk_geodesics_options options;
    const size_t n = (size_t)g->n_sources;
    DMK_TRY(DMK_NEW(ctx, source, n));
    DMK_TRY(DMK_NEW(ctx, offset, n));
    DMK_TRY(DMK_NEW(ctx, f->turn, n));
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_mesh_point_xyz(ctx, g->mesh, &g->source[i].point, xyz));
        source[i] = place_in(f, &g->source[i].point, xyz);
        offset[i] = g->source[i].offset;
    }
    dmk_geodesics_options_init(&options, sizeof options);
    options.offset = offset;
    DMK_TRY(dmk_geodesics_prepare(ctx, f->mesh, NULL, n, source, &options, &f->own));
    DMK_TRY(dmk_windows_run(ctx, f->own, dmk_windows_usual(f->mesh), &finished));
    rc = finished ? dmk_geodesics_check(ctx, f->own) : DMK_E_MESH; /* needles: too many windows */
    if (rc != DMK_OK) goto done;
    f->geodesics = f->own;
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_mesh_point_xyz(ctx, g->mesh, &g->source[i].point, xyz));
        f->turn[i] = turn_of(g, f, xyz, (int32_t)i);
    }
done:
    free(source);
    free(offset);
    return rc;
}

static int make(dmk_context *ctx, const dmk_geodesics *g, double length, dmk_finer *f)
{
    int rc;
    DMK_TRY(make_mesh(ctx, g, length, f));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(run(ctx, g, f));
done:
    return rc;
}

int dmk_finer_create(dmk_context *ctx, const dmk_geodesics *g, dmk_finer *f)
{
    const dmk_mesh *m = g->mesh;
    const double mean_edge = m->info.mean_edge, length = longest * mean_edge;
    double in_long = 0;
    for (int32_t e = 0; m->info.max_edge > 2 * length && e < m->n_edges; e++)
        in_long += m->length[e] > 2 * length ? m->length[e] : 0;
    const bool few = m->n_triangles < FEW;
    const bool uneven =
        in_long > share * mean_edge * m->n_edges && m->n_triangles < DMK_EXACT_TRIANGLES;
    const dmk_finer none = {.geodesics = g, .mean_edge = mean_edge};
    *f = none;
    if (!uneven && !few) return DMK_OK;
    const int rc = make(ctx, g, length * (few ? sqrt(m->n_triangles / (double)FEW) : 1), f);
    if (rc != DMK_E_MESH) return rc;
    dmk_finer_free(f); /* parts of slivers may be flat, or paths wind around them */
    *f = none;
    return DMK_OK;
}

void dmk_finer_free(dmk_finer *f)
{
    dmk_geodesics_destroy(&f->own);
    dmk_mesh_destroy(&f->mesh);
    free(f->first);
    free(f->parent);
    free(f->turn);
    memset(f, 0, sizeof *f);
}
