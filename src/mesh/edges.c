/* Edges, components and stars from the triangles. */
#include "mesh/edges.h"
#include "mesh/check.h"

#include "base/parallel.h"
#include "base/sets.h"

#include <stdlib.h>
#include <string.h>

/* Fill rows so that row[key] .. row[key+1] spans the items of each key, by counting. */
static void count_to_rows(int32_t n, int32_t *row)
{
    int32_t sum = 0;
    for (int32_t i = 0; i <= n; i++) {
        int32_t count = row[i];
        row[i] = sum;
        sum += count;
    }
}

/* A half-edge run by triangle t opposite corner k goes from corner k+1 to k+2. */
static void half_edge(const int32_t *tri, int32_t half, int32_t *from, int32_t *to)
{
    const int32_t *c = tri + 3 * (half / 3);
    int k = half % 3;
    *from = c[(k + 1) % 3];
    *to = c[(k + 2) % 3];
}

/* Give back what lies behind the first n numbers. */
static void shrink(int32_t **array, size_t n)
{
    int32_t *smaller = realloc(*array, n * sizeof *smaller);
    if (smaller) *array = smaller; /* else the longer one does as well */
}

/* The edge from the vertex whose edges begin at `first` to `other`, or n_edges if there is none yet. Few are
 * looked through; of many, as at the centre of a large star, last[other] names the only one it can be. */
static int32_t find_edge(const struct dmk_mesh *m, int32_t first, int32_t n_edges, bool many,
                         const int32_t *last, int32_t other)
{
    int32_t e = many ? last[other] : first;
    if (many) return e >= first && e < n_edges && m->edge_vertex[2 * e + 1] == other ? e : n_edges;
    while (e < n_edges && m->edge_vertex[2 * e + 1] != other) e++;
    return e;
}

/* Edges are built by ranges of vertices, each range those whose smaller end it holds. Subdivision numbers new vertices
 * last, so that early ones have most of the edges: once they are counted, ranges have as many half-edges each. */
enum { MOST_RANGES = 8, LONG_RANGE = 20000 };

typedef struct edging {
    struct dmk_mesh *mesh;
    int32_t *row, *fill, *half;               /* half-edges by smaller end */
    int32_t n_ranges, first[MOST_RANGES + 1]; /* vertex of each range */
    int32_t n_edges[MOST_RANGES]; /* from row[first[k]] on, until all are moved together */
    bool clash[MOST_RANGES];      /* more than two triangles at an edge, or two of one direction */
} edging;

static void set_ranges_by_vertices(edging *w)
{
    for (int32_t k = 0; k <= w->n_ranges; k++)
        w->first[k] = dmk_range_begin(w->mesh->n_vertices, k, w->n_ranges);
}

static void set_ranges_by_half_edges(edging *w)
{
    const int32_t n = w->mesh->n_vertices;
    for (int32_t v = 0, k = 1; k < w->n_ranges; k++) {
        while (v < n && w->row[v] < dmk_range_begin(w->row[n], k, w->n_ranges)) v++;
        w->first[k] = v;
    }
}

/* Of all half-edges those of the range: into row how many each vertex has; or, with `fill`, themselves into half. */
static void sort_halves(const edging *w, int32_t k, bool fill)
{
    const struct dmk_mesh *m = w->mesh;
    const int32_t lo = w->first[k], hi = w->first[k + 1];
    for (int32_t t = 0; t < m->n_triangles; t++) {
        for (int32_t h = 3 * t; h < 3 * t + 3; h++) {
            int32_t a, b;
            half_edge(m->triangle, h, &a, &b);
            const int32_t v = dmk_min_i(a, b);
            if (v < lo || v >= hi) continue;
            if (fill)
                w->half[w->fill[v]++] = h;
            else
                w->row[v]++;
        }
    }
}

static int count_piece(dmk_context *ctx, int32_t k, void *data)
{
    (void)ctx;
    sort_halves(data, k, false);
    return DMK_OK;
}

static int fill_piece(dmk_context *ctx, int32_t k, void *data)
{
    (void)ctx;
    sort_halves(data, k, true);
    return DMK_OK;
}

/* Half-edges, speed only: their triangles lie anywhere, and are asked for so long before. Those of 273,000 are matched
 * in 12 ms on one thread; in 18 with 4, 28 with 1, 11 with 64. */
enum { AHEAD = 16 };

/* The edges of vertex v behind *n_edges; false where triangles clash. */
static bool match_halves(const edging *w, int32_t v, int32_t *last, int32_t *n_edges)
{
    const struct dmk_mesh *m = w->mesh;
    const int32_t first = *n_edges, last_half = w->row[m->n_vertices] - 1;
    for (int32_t i = w->row[v]; i < w->row[v + 1]; i++) {
        int32_t a, b, h = w->half[i], later = w->half[dmk_min_i(i + AHEAD, last_half)];
        __builtin_prefetch(m->triangle + later);
        __builtin_prefetch(m->triangle_edge + later, 1);
        half_edge(m->triangle, h, &a, &b);
        const int32_t other = dmk_max_i(a, b), side = a < b ? 0 : 1;
        const int32_t e = find_edge(m, first, *n_edges, last != NULL, last, other);
        if (e == *n_edges) {
            if (last) last[other] = e;
            m->edge_vertex[2 * e] = v;
            m->edge_vertex[2 * e + 1] = other;
            m->edge_triangle[2 * e] = m->edge_triangle[2 * e + 1] = -1;
            (*n_edges)++;
        }
        int32_t *slot = &m->edge_triangle[2 * e + side];
        if (*slot >= 0) return false;
        *slot = h / 3;
        m->triangle_edge[h] = e;
    }
    return true;
}

static int edge_piece(dmk_context *ctx, int32_t k, void *data)
{
    enum { MANY = 64 };
    int rc = DMK_OK;
    edging *w = data;
    const int32_t lo = w->first[k], hi = w->first[k + 1], base = w->row[lo];
    int32_t n_edges = base, *last = NULL;
    for (int32_t v = lo; v < hi && !w->clash[k]; v++) {
        const bool many = w->row[v + 1] - w->row[v] > MANY;
        if (many && !last) DMK_TRY(DMK_NEW(ctx, last, (size_t)w->mesh->n_vertices));
        w->clash[k] = !match_halves(w, v, many ? last : NULL, &n_edges);
    }
    /* A border edge keeps its only triangle in slot 0. */
    for (int32_t e = base; e < n_edges; e++) {
        int32_t *t = w->mesh->edge_triangle + 2 * e;
        if (t[0] < 0) {
            t[0] = t[1];
            t[1] = -1;
        }
    }
    w->n_edges[k] = n_edges - base;
done:
    free(last);
    return rc;
}

static void renumber_range(int32_t begin, int32_t end, void *data)
{
    const edging *w = data;
    int32_t base[MOST_RANGES] = {0}, shift[MOST_RANGES] = {0}, sum = 0;
    for (int32_t k = 0; k < w->n_ranges; k++) {
        base[k] = w->row[w->first[k]];
        shift[k] = base[k] - sum;
        sum += w->n_edges[k];
    }
    for (int32_t h = begin; h < end; h++) {
        int32_t *e = w->mesh->triangle_edge + h, k = w->n_ranges - 1;
        while (*e < base[k]) k--;
        *e -= shift[k];
    }
}

/* The ranges' edges behind each other. */
static void join_ranges(dmk_context *ctx, edging *w)
{
    struct dmk_mesh *m = w->mesh;
    if (w->n_ranges > 1) dmk_parallel(ctx, 3 * m->n_triangles, renumber_range, w);
    for (int32_t k = 0; k < w->n_ranges; k++) {
        const size_t from = 2 * (size_t)w->row[w->first[k]], to = 2 * (size_t)m->n_edges,
                     bytes = 2 * (size_t)w->n_edges[k] * sizeof(int32_t);
        if (from > to) {
            memmove(m->edge_vertex + to, m->edge_vertex + from, bytes);
            memmove(m->edge_triangle + to, m->edge_triangle + from, bytes);
        }
        m->n_edges += w->n_edges[k];
    }
    shrink(&m->edge_vertex, 2 * (size_t)m->n_edges);
    shrink(&m->edge_triangle, 2 * (size_t)m->n_edges);
}

/* Group the half-edges by their smaller end vertex, then match equal larger ends within each
 * group: linear in the mesh's size. Edges are numbered by (smaller end, first half-edge). */
int dmk_mesh_build_edges(dmk_context *ctx, struct dmk_mesh *m)
{
    int rc;
    const size_t n_half = 3 * (size_t)m->n_triangles;
    edging w = {.mesh = m, .n_ranges = 1};
    if (m->n_triangles > LONG_RANGE) w.n_ranges = dmk_min_i(dmk_parallel_threads(ctx), MOST_RANGES);
    DMK_TRY(DMK_NEW(ctx, w.row, (size_t)m->n_vertices + 1));
    DMK_TRY(DMK_NEW(ctx, w.fill, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, w.half, n_half));
    DMK_TRY(DMK_NEW_UNSET(ctx, m->triangle_edge, n_half));
    DMK_TRY(DMK_NEW_UNSET(ctx, m->edge_vertex, 2 * n_half));
    DMK_TRY(DMK_NEW_UNSET(ctx, m->edge_triangle, 2 * n_half));
    set_ranges_by_vertices(&w);
    DMK_TRY(dmk_parallel_pieces(ctx, w.n_ranges, count_piece, &w));
    count_to_rows(m->n_vertices, w.row);
    set_ranges_by_half_edges(&w);
    memcpy(w.fill, w.row, (size_t)m->n_vertices * sizeof *w.fill);
    DMK_TRY(dmk_parallel_pieces(ctx, w.n_ranges, fill_piece, &w));
    DMK_TRY(dmk_parallel_pieces(ctx, w.n_ranges, edge_piece, &w));
    for (int32_t k = 0; k < w.n_ranges; k++) {
        if (w.clash[k]) DMK_TRY(dmk_check_explain_edges(ctx, m));
    }
    join_ranges(ctx, &w);
done:
    free(w.row);
    free(w.fill);
    free(w.half);
    return rc;
}

/* Number the components by their first triangles. Triangles that share a vertex are of one: those at it follow each
 * other over edges (dmk_check_stars). */
int dmk_mesh_build_components(dmk_context *ctx, struct dmk_mesh *m)
{
    int rc;
    int32_t *parent = NULL;
    DMK_TRY(DMK_NEW_UNSET(ctx, parent, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++) parent[v] = v;
    m->n_components = m->n_used_vertices;
    for (int32_t e = 0; e < m->n_edges; e++)
        m->n_components -= dmk_set_unite(parent, m->edge_vertex[2 * e], m->edge_vertex[2 * e + 1]);
    if (m->n_components == 1) goto done;
    DMK_TRY(DMK_NEW_UNSET(ctx, m->component, (size_t)m->n_triangles));
    for (int32_t t = 0; t < m->n_triangles; t++)
        m->component[t] = dmk_set_find(parent, m->triangle[3 * (size_t)t]);
    for (int32_t v = 0; v < m->n_vertices; v++) parent[v] = -1; /* now the number of a set */
    for (int32_t t = 0, n = 0; t < m->n_triangles; t++) {
        int32_t *number = parent + m->component[t];
        if (*number < 0) *number = n++;
        m->component[t] = *number;
    }
done:
    free(parent);
    return rc;
}

int dmk_vertex_stars_create(dmk_context *ctx, const dmk_mesh *m, dmk_vertex_stars *stars)
{
    int rc;
    int32_t *fill = NULL;
    memset(stars, 0, sizeof *stars);
    DMK_TRY(DMK_NEW(ctx, stars->row, (size_t)m->n_vertices + 1));
    DMK_TRY(DMK_NEW_UNSET(ctx, stars->triangle, 3 * (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)m->n_vertices));
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) stars->row[m->triangle[h]]++;
    count_to_rows(m->n_vertices, stars->row);
    for (int32_t v = 0; v < m->n_vertices; v++) fill[v] = stars->row[v];
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        stars->triangle[fill[m->triangle[h]]++] = 4 * (h / 3) + h % 3;
    }
    rc = DMK_OK;
done:
    free(fill);
    if (rc != DMK_OK) dmk_vertex_stars_free(stars);
    return rc;
}

void dmk_vertex_stars_free(dmk_vertex_stars *stars)
{
    free(stars->row);
    free(stars->triangle);
    memset(stars, 0, sizeof *stars);
}
