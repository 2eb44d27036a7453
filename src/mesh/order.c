/* Locality ordering: see dmk_order in mesh.h. */
#include "mesh/mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct keyed {
    uint64_t key;
    int32_t item;
} keyed;

/* Spread the low 16 bits of x to every third bit. */
static uint64_t spread3(uint64_t x)
{
    x &= 0xffff;
    x = (x | x << 16) & 0x0000ff0000ffULL;
    x = (x | x << 8) & 0x00f00f00f00fULL;
    x = (x | x << 4) & 0x0c30c30c30c3ULL;
    x = (x | x << 2) & 0x249249249249ULL;
    return x;
}

/* Stable radix sort by 48-bit keys, 16 bits at a time. */
static int sort_keys(dmk_context *ctx, keyed *a, size_t n)
{
    int rc;
    keyed *b = NULL;
    size_t *count = NULL;
    DMK_TRY(DMK_NEW(ctx, b, n));
    DMK_TRY(DMK_NEW(ctx, count, 65536));
    keyed *from = a, *to = b;
    for (int pass = 0; pass < 3; pass++) {
        int shift = 16 * pass;
        memset(count, 0, 65536 * sizeof *count);
        for (size_t i = 0; i < n; i++) count[from[i].key >> shift & 0xffff]++;
        size_t sum = 0;
        for (int k = 0; k < 65536; k++) {
            size_t c = count[k];
            count[k] = sum;
            sum += c;
        }
        for (size_t i = 0; i < n; i++) to[count[from[i].key >> shift & 0xffff]++] = from[i];
        keyed *swap = from;
        from = to;
        to = swap;
    }
    memcpy(a, b, n * sizeof *a); /* three passes end in b */
done:
    free(b);
    free(count);
    return rc;
}

static int morton_order(dmk_context *ctx, const dmk_mesh *m, int32_t component, keyed **sorted,
                        size_t *n)
{
    int rc;
    keyed *keys = NULL;
    double lo[3] = {INFINITY, INFINITY, INFINITY}, span = 0;
    DMK_TRY(DMK_NEW(ctx, keys, (size_t)m->n_triangles));
    double hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (m->component[h / 3] != component) continue;
        const double *x = m->xyz + 3 * (size_t)m->triangle[h];
        for (int k = 0; k < 3; k++) {
            lo[k] = fmin(lo[k], x[k]);
            hi[k] = fmax(hi[k], x[k]);
        }
    }
    for (int k = 0; k < 3; k++) span = fmax(span, hi[k] - lo[k]);
    double scale = 65535.0 / (3.0 * span);
    *n = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (m->component[t] != component) continue;
        uint64_t key = 0;
        for (int k = 0; k < 3; k++) {
            double sum = 0;
            for (int c = 0; c < 3; c++) sum += m->xyz[3 * (size_t)m->triangle[3 * t + c] + k] - lo[k];
            key |= spread3((uint64_t)(sum * scale)) << k;
        }
        keys[(*n)++] = (keyed){key, t};
    }
    DMK_TRY(sort_keys(ctx, keys, *n));
    *sorted = keys;
    keys = NULL;
done:
    free(keys);
    return rc;
}

/* Old edge of each new edge: through the triangles, whose corners keep their places. */
static void map_edges(const dmk_mesh *old, dmk_order *o)
{
    for (int32_t h = 0; h < 3 * o->mesh->n_triangles; h++) {
        int32_t t = o->triangle_old[h / 3];
        o->edge_old[o->mesh->triangle_edge[h]] = old->triangle_edge[3 * t + h % 3];
    }
}

int dmk_order_create(dmk_context *ctx, const dmk_mesh *m, int32_t component, dmk_order *o)
{
    int rc;
    keyed *sorted = NULL;
    size_t n = 0;
    int32_t *vertex_new = NULL, *tri = NULL, n_vertices = 0;
    double *xyz = NULL;
    memset(o, 0, sizeof *o);
    DMK_TRY(morton_order(ctx, m, component, &sorted, &n));
    DMK_TRY(DMK_NEW(ctx, o->triangle_old, n));
    DMK_TRY(DMK_NEW(ctx, tri, 3 * n));
    DMK_TRY(DMK_NEW(ctx, vertex_new, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, o->vertex_old, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++) vertex_new[v] = -1;
    for (size_t t = 0; t < n; t++) {
        o->triangle_old[t] = sorted[t].item;
        for (int k = 0; k < 3; k++) {
            int32_t v = m->triangle[3 * sorted[t].item + k];
            if (vertex_new[v] < 0) {
                vertex_new[v] = n_vertices;
                o->vertex_old[n_vertices++] = v;
            }
            tri[3 * t + k] = vertex_new[v];
        }
    }
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)n_vertices));
    for (int32_t v = 0; v < n_vertices; v++) {
        memcpy(xyz + 3 * v, m->xyz + 3 * (size_t)o->vertex_old[v], 3 * sizeof *xyz);
    }
    rc = dmk_mesh_adopt(ctx, (size_t)n_vertices, xyz, n, tri, &o->mesh);
    xyz = NULL;
    tri = NULL;
    if (rc != DMK_OK) goto done;
    DMK_TRY(DMK_NEW(ctx, o->edge_old, (size_t)o->mesh->n_edges));
    map_edges(m, o);
done:
    free(sorted);
    free(vertex_new);
    free(xyz);
    free(tri);
    if (rc != DMK_OK) dmk_order_free(o);
    return rc;
}

void dmk_order_free(dmk_order *o)
{
    dmk_mesh_destroy(&o->mesh);
    free(o->vertex_old);
    free(o->triangle_old);
    free(o->edge_old);
    memset(o, 0, sizeof *o);
}
