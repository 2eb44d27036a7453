/* Vertices that lie off the surface meant. Their noise is what a smooth surface has not: a height over
 * the neighbours that differs from the neighbours' own heights. Where it is found all over the mesh,
 * the rays run over a mesh whose vertices were moved along their normals until it is gone; places,
 * being triangles and weights, are those of the given mesh all the same. */
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A mesh is rough where half of the vertices differ by more than this many lengths of the edges
 * there. Smooth surfaces have less than 0.004 from 5,000 triangles up, vertices off by 2 % of an edge
 * give 0.01. */
static const double least_rough = 0.01;
/* Of the difference, in each round; rounds; no vertex goes farther in all, in mean edges. */
static const double step = 0.5, farthest = 0.3;
enum { n_rounds = 12 };

typedef struct smoothing {
    const dmk_mesh *mesh;
    const dmk_rays *rays;
    double *xyz, *normal; /* 3*n_vertices */
    double *height;       /* n_vertices: over the mean of the neighbours */
    double *rough;        /* n_vertices: height less the neighbours' mean height */
    int32_t *count;       /* n_vertices: neighbours; 0 at a border */
    bool *still;          /* n_vertices: not to be moved */
} smoothing;

static void find_normals(smoothing *s)
{
    const dmk_mesh *m = s->mesh;
    memset(s->normal, 0, 3 * (size_t)m->n_vertices * sizeof *s->normal);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * t;
        const double *a = s->xyz + 3 * (size_t)v[0], *b = s->xyz + 3 * (size_t)v[1];
        const double *c = s->xyz + 3 * (size_t)v[2];
        double p[3], q[3];
        for (int k = 0; k < 3; k++) {
            p[k] = b[k] - a[k];
            q[k] = c[k] - a[k];
        }
        for (int k = 0; k < 3; k++) {
            int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            double n = p[k1] * q[k2] - p[k2] * q[k1];
            for (int j = 0; j < 3; j++)
                s->normal[3 * (size_t)v[j] + k] += n;
        }
    }
    for (int32_t v = 0; v < m->n_vertices; v++) {
        double *n = s->normal + 3 * (size_t)v, length = hypot(hypot(n[0], n[1]), n[2]);
        for (int k = 0; k < 3; k++)
            n[k] = length > 0 ? n[k] / length : 0;
    }
}

static void find_roughness(smoothing *s)
{
    const dmk_mesh *m = s->mesh;
    find_normals(s);
    memset(s->height, 0, (size_t)m->n_vertices * sizeof *s->height);
    memset(s->rough, 0, (size_t)m->n_vertices * sizeof *s->rough);
    for (int32_t i = 0; i < 2 * m->n_edges; i++) {
        size_t v = (size_t)m->edge_vertex[i], w = (size_t)m->edge_vertex[i ^ 1];
        for (int k = 0; k < 3; k++)
            s->height[v] += (s->xyz[3 * v + k] - s->xyz[3 * w + k]) * s->normal[3 * v + k];
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        s->height[v] = s->count[v] ? s->height[v] / s->count[v] : 0;
    for (int32_t i = 0; i < 2 * m->n_edges; i++)
        s->rough[m->edge_vertex[i]] += s->height[m->edge_vertex[i ^ 1]];
    for (int32_t v = 0; v < m->n_vertices; v++)
        s->rough[v] = s->count[v] ? s->height[v] - s->rough[v] / s->count[v] : 0;
}

/* Half of the vertices, but for those at a border, are rough. */
static bool is_rough(const smoothing *s)
{
    int32_t n = 0, n_rough = 0;
    for (int32_t v = 0; v < s->mesh->n_vertices; v++) {
        n += s->count[v] > 0;
        n_rough += s->count[v] > 0 && fabs(s->rough[v]) > least_rough * s->rays->size[v];
    }
    return 2 * n_rough > n;
}

static void move(smoothing *s)
{
    const dmk_mesh *m = s->mesh;
    for (int round = 0; round < n_rounds; round++) {
        if (round > 0) find_roughness(s);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            double *x = s->xyz + 3 * (size_t)v, y[3], d = 0;
            const double *x0 = m->xyz + 3 * (size_t)v, *n = s->normal + 3 * (size_t)v;
            if (s->still[v]) continue;
            for (int k = 0; k < 3; k++) {
                y[k] = x[k] - step * s->rough[v] * n[k];
                d += (y[k] - x0[k]) * (y[k] - x0[k]);
            }
            if (sqrt(d) < farthest * s->rays->size[v]) memcpy(x, y, sizeof y);
        }
    }
}

static int prepare(dmk_context *ctx, smoothing *s)
{
    int rc;
    const dmk_mesh *m = s->mesh;
    size_t n = (size_t)m->n_vertices;
    DMK_TRY(DMK_NEW(ctx, s->xyz, 3 * n));
    DMK_TRY(DMK_NEW(ctx, s->normal, 3 * n));
    DMK_TRY(DMK_NEW(ctx, s->height, n));
    DMK_TRY(DMK_NEW(ctx, s->rough, n));
    DMK_TRY(DMK_NEW(ctx, s->count, n));
    DMK_TRY(DMK_NEW(ctx, s->still, n));
    memcpy(s->xyz, m->xyz, 3 * n * sizeof *s->xyz);
    for (int32_t i = 0; i < 2 * m->n_edges; i++)
        s->count[m->edge_vertex[i]]++;
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * e + 1] >= 0) continue;
        s->count[m->edge_vertex[2 * e]] = s->count[m->edge_vertex[2 * e + 1]] = 0;
    }
    for (size_t v = 0; v < n; v++)
        s->still[v] = s->count[v] == 0 || fabs(s->rays->bend[v]) > dmk_sharp;
done:
    return rc;
}

/* Give the edges of `smooth` the numbers that they have in m. */
static int number_edges_as(dmk_context *ctx, const dmk_mesh *m, dmk_mesh *smooth)
{
    double *length = NULL;
    int rc = DMK_NEW(ctx, length, (size_t)m->n_edges);
    if (rc != DMK_OK) return rc;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++)
        length[m->triangle_edge[h]] = smooth->length[smooth->triangle_edge[h]];
    free(smooth->length);
    smooth->length = length;
    memcpy(smooth->triangle_edge, m->triangle_edge,
           3 * (size_t)m->n_triangles * sizeof *m->triangle_edge);
    memcpy(smooth->edge_vertex, m->edge_vertex, 2 * (size_t)m->n_edges * sizeof *m->edge_vertex);
    memcpy(smooth->edge_triangle, m->edge_triangle,
           2 * (size_t)m->n_edges * sizeof *m->edge_triangle);
    return DMK_OK;
}

int dmk_rays_smooth(dmk_context *ctx, const dmk_rays *r, dmk_mesh **smooth)
{
    int rc;
    smoothing s = {.mesh = r->mesh, .rays = r};
    *smooth = NULL;
    DMK_TRY(prepare(ctx, &s));
    find_roughness(&s);
    if (!is_rough(&s)) goto done;
    move(&s);
    rc = dmk_mesh_create(ctx, (size_t)r->mesh->n_vertices, s.xyz, (size_t)r->mesh->n_triangles,
                         r->mesh->triangle, smooth);
    if (rc == DMK_E_MESH)
        rc = DMK_OK; /* a triangle has collapsed: stay with the given mesh */
    else if (rc == DMK_OK)
        rc = number_edges_as(ctx, r->mesh, *smooth);
done:
    free(s.xyz);
    free(s.normal);
    free(s.height);
    free(s.rough);
    free(s.count);
    free(s.still);
    return rc;
}
