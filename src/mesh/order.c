/* Locality ordering: see dmk_order in mesh.h. */
#include "mesh/mesh.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { BITS = DMK_KEY_BITS / 3 }; /* of a key for each axis */

/* Spread the low bits of x to every third bit. */
static uint64_t spread3(uint64_t x)
{
    x = (x | x << 16) & 0x0000ff0000ffULL;
    x = (x | x << 8) & 0x00f00f00f00fULL;
    x = (x | x << 4) & 0x0c30c30c30c3ULL;
    x = (x | x << 2) & 0x249249249249ULL;
    return x;
}

double dmk_morton_scale(const double lo[3], const double hi[3])
{
    double span = 0;
    for (int k = 0; k < 3; k++) span = fmax(span, hi[k] - lo[k]);
    return ((1 << BITS) - 1) / (3.0 * span);
}

uint64_t dmk_morton_key(const double a[3], const double b[3], const double c[3], const double lo[3],
                        double scale)
{
    uint64_t key = 0;
    for (int k = 0; k < 3; k++) {
        const double sum = (a[k] - lo[k]) + (b[k] - lo[k]) + (c[k] - lo[k]);
        key |= spread3((uint64_t)(sum * scale)) << k;
    }
    return key;
}

typedef struct key_job {
    const dmk_mesh *mesh;
    double lo[3], scale;
    dmk_keyed *keys;
} key_job;

static void key_range(int32_t begin, int32_t end, void *data)
{
    const key_job *job = data;
    const double *xyz = job->mesh->xyz;
    for (int32_t i = begin; i < end; i++) {
        const int32_t *c = job->mesh->triangle + 3 * (size_t)job->keys[i].item;
        job->keys[i].key = dmk_morton_key(xyz + 3 * (size_t)c[0], xyz + 3 * (size_t)c[1],
                                          xyz + 3 * (size_t)c[2], job->lo, job->scale);
    }
}

int dmk_morton_order(dmk_context *ctx, const dmk_mesh *m, int32_t component, dmk_keyed **sorted,
                     int32_t *n)
{
    int rc;
    key_job job = {.mesh = m, .lo = {INFINITY, INFINITY, INFINITY}};
    double hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    *n = 0;
    DMK_TRY(DMK_NEW(ctx, job.keys, (size_t)m->n_triangles));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (component != DMK_ALL_COMPONENTS && dmk_mesh_component(m, t) != component) continue;
        job.keys[(*n)++].item = t;
        for (int j = 0; j < 3; j++) {
            const double *x = m->xyz + 3 * (size_t)m->triangle[3 * t + j];
            for (int k = 0; k < 3; k++) {
                if (x[k] < job.lo[k]) job.lo[k] = x[k];
                if (x[k] > hi[k]) hi[k] = x[k];
            }
        }
    }
    job.scale = dmk_morton_scale(job.lo, hi);
    dmk_parallel(ctx, *n, key_range, &job);
    DMK_TRY(dmk_sort_keyed(ctx, job.keys, (size_t)*n));
    *sorted = job.keys;
    job.keys = NULL;
done:
    free(job.keys);
    return rc;
}

/* New numbers of the old mesh's parts; -1 for those outside of the component. */
typedef struct renumbering {
    int32_t *vertex, *edge, *triangle;
} renumbering;

static int new_numbers(dmk_context *ctx, int32_t n, int32_t **number)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *number, (size_t)n));
    for (int32_t i = 0; i < n; i++) (*number)[i] = -1;
done:
    return rc;
}

/* Give `old` the next number, if it has none, and return its number. */
static int32_t touch(int32_t old, int32_t *number, int32_t *old_of, int32_t *n)
{
    if (number[old] < 0) {
        number[old] = *n;
        old_of[(*n)++] = old;
    }
    return number[old];
}

static int renumber(dmk_context *ctx, const dmk_mesh *m, const dmk_keyed *sorted, renumbering *r,
                    dmk_order *o)
{
    int rc;
    struct dmk_mesh *fresh = o->mesh;
    size_t n = (size_t)fresh->n_triangles;
    DMK_TRY(new_numbers(ctx, m->n_vertices, &r->vertex));
    DMK_TRY(new_numbers(ctx, m->n_edges, &r->edge));
    DMK_TRY(new_numbers(ctx, m->n_triangles, &r->triangle));
    DMK_TRY(DMK_NEW(ctx, o->triangle_old, n));
    DMK_TRY(DMK_NEW(ctx, o->vertex_old, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, o->edge_old, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, fresh->triangle, 3 * n));
    DMK_TRY(DMK_NEW(ctx, fresh->triangle_edge, 3 * n));
    for (size_t t = 0; t < n; t++) {
        int32_t old = o->triangle_old[t] = sorted[t].item;
        r->triangle[old] = (int32_t)t;
        for (size_t k = 0; k < 3; k++) {
            fresh->triangle[3 * t + k] = touch(m->triangle[3 * (size_t)old + k], r->vertex,
                                               o->vertex_old, &fresh->n_vertices);
            fresh->triangle_edge[3 * t + k] =
                touch(m->triangle_edge[3 * (size_t)old + k], r->edge, o->edge_old, &fresh->n_edges);
        }
    }
done:
    return rc;
}

typedef struct gather_job {
    const dmk_mesh *from;
    const renumbering *number;
    const dmk_order *order;
} gather_job;

/* An edge's smaller end comes first, and the triangle that runs it from there. */
static void gather_edges(int32_t begin, int32_t end, void *data)
{
    const gather_job *job = data;
    const struct dmk_mesh *to = job->order->mesh;
    for (int32_t e = begin; e < end; e++) {
        int32_t old = job->order->edge_old[e];
        const int32_t *v = job->from->edge_vertex + 2 * (size_t)old;
        const int32_t *t = job->from->edge_triangle + 2 * (size_t)old;
        int32_t a = job->number->vertex[v[0]], b = job->number->vertex[v[1]];
        int swap = a > b, border = t[1] < 0;
        to->edge_vertex[2 * e + swap] = a;
        to->edge_vertex[2 * e + !swap] = b;
        to->edge_triangle[2 * e + (swap && !border)] = job->number->triangle[t[0]];
        to->edge_triangle[2 * e + !(swap && !border)] = border ? -1 : job->number->triangle[t[1]];
        to->length[e] = job->from->length[old];
    }
}

static void gather_triangles(int32_t begin, int32_t end, void *data)
{
    const gather_job *job = data;
    const struct dmk_mesh *to = job->order->mesh;
    for (int32_t t = begin; t < end; t++) {
        size_t old = (size_t)job->order->triangle_old[t];
        to->area[t] = job->from->area[old];
    }
}

static void gather_vertices(int32_t begin, int32_t end, void *data)
{
    const gather_job *job = data;
    const struct dmk_mesh *to = job->order->mesh;
    for (int32_t v = begin; v < end; v++) {
        memcpy(to->xyz + 3 * (size_t)v, job->from->xyz + 3 * (size_t)job->order->vertex_old[v],
               3 * sizeof *to->xyz);
    }
}

/* The rest of the renumbered mesh's topology and geometry: those of the old one, which has been checked. */
static int gather(dmk_context *ctx, const dmk_mesh *m, const renumbering *number, dmk_order *o)
{
    int rc;
    struct dmk_mesh *to = o->mesh;
    gather_job job = {m, number, o};
    size_t n_v = (size_t)to->n_vertices, n_e = (size_t)to->n_edges;
    DMK_TRY(DMK_NEW(ctx, to->xyz, 3 * n_v));
    DMK_TRY(DMK_NEW(ctx, to->edge_vertex, 2 * n_e));
    DMK_TRY(DMK_NEW(ctx, to->edge_triangle, 2 * n_e));
    DMK_TRY(DMK_NEW(ctx, to->length, n_e));
    to->n_components = 1;
    dmk_parallel(ctx, to->n_vertices, gather_vertices, &job);
    dmk_parallel(ctx, to->n_edges, gather_edges, &job);
    if (m->n_border_edges > 0)
        DMK_TRY(dmk_mesh_count(ctx, to));
    else
        to->n_used_vertices = to->n_vertices;
    DMK_TRY(dmk_mesh_describe(ctx, to));
done:
    return rc;
}

/* Its triangles are not read once everything has its new number. */
static void free_triangles(struct dmk_mesh *m)
{
    free(m->triangle);
    free(m->triangle_edge);
    free(m->area);
    m->triangle = m->triangle_edge = NULL;
    m->area = NULL;
}

static int create(dmk_context *ctx, const dmk_mesh *m, dmk_mesh *own, int32_t component,
                  dmk_order *o)
{
    int rc;
    dmk_keyed *sorted = NULL;
    renumbering number = {0};
    memset(o, 0, sizeof *o);
    DMK_TRY(dmk_mesh_check_edges(ctx, m));
    DMK_TRY(DMK_NEW(ctx, o->mesh, 1));
    DMK_TRY(dmk_morton_order(ctx, m, component, &sorted, &o->mesh->n_triangles));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(renumber(ctx, m, sorted, &number, o));
    free(sorted);
    sorted = NULL;
    DMK_TRY(DMK_NEW(ctx, o->mesh->area, (size_t)o->mesh->n_triangles));
    dmk_parallel(ctx, o->mesh->n_triangles, gather_triangles, &(gather_job){m, &number, o});
    if (own) free_triangles(own);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(gather(ctx, m, &number, o));
done:
    free(sorted);
    free(number.vertex);
    free(number.edge);
    free(number.triangle);
    if (rc != DMK_OK) dmk_order_free(o);
    return rc;
}

int dmk_order_create(dmk_context *ctx, const dmk_mesh *m, int32_t component, dmk_order *o)
{
    return create(ctx, m, NULL, component, o);
}

int dmk_order_adopt(dmk_context *ctx, dmk_mesh **mesh, int32_t component, dmk_order *o)
{
    const int rc = create(ctx, *mesh, *mesh, component, o);
    dmk_mesh_destroy(mesh);
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
