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
    bool all; /* triangle i is item i; else the items are there */
    double lo[3], scale;
    dmk_keyed *keys;
} key_job;

static void key_range(int32_t begin, int32_t end, void *data)
{
    const key_job *job = data;
    const double *xyz = job->mesh->xyz;
    for (int32_t i = begin; i < end; i++) {
        if (job->all) job->keys[i].item = i;
        const int32_t *c = job->mesh->triangle + 3 * (size_t)job->keys[i].item;
        job->keys[i].key = dmk_morton_key(xyz + 3 * (size_t)c[0], xyz + 3 * (size_t)c[1],
                                          xyz + 3 * (size_t)c[2], job->lo, job->scale);
    }
}

/* The component's triangles, *n of them, and their box. */
static void list_component(key_job *job, int32_t component, double hi[3], int32_t *n)
{
    const dmk_mesh *m = job->mesh;
    for (int k = 0; k < 3; k++) {
        job->lo[k] = INFINITY;
        hi[k] = -INFINITY;
    }
    *n = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (dmk_mesh_component(m, t) != component) continue;
        job->keys[(*n)++].item = t;
        for (int j = 0; j < 3; j++) {
            const double *x = m->xyz + 3 * (size_t)m->triangle[3 * t + j];
            for (int k = 0; k < 3; k++) {
                if (x[k] < job->lo[k]) job->lo[k] = x[k];
                if (x[k] > hi[k]) hi[k] = x[k];
            }
        }
    }
}

int dmk_morton_order(dmk_context *ctx, const dmk_mesh *m, int32_t component, dmk_keyed **sorted,
                     int32_t *n)
{
    int rc;
    key_job job = {.mesh = m, .all = component == DMK_ALL_COMPONENTS || m->n_components == 1};
    double hi[3];
    DMK_TRY(DMK_NEW_UNSET(ctx, job.keys, (size_t)m->n_triangles));
    if (job.all) {
        memcpy(job.lo, m->info.box_min, sizeof job.lo);
        memcpy(hi, m->info.box_max, sizeof hi);
        *n = m->n_triangles;
    } else {
        list_component(&job, component, hi, n);
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

/* New numbers of the old mesh's parts that are in the component. */
typedef struct renumbering {
    int32_t *vertex, *edge, *triangle;
} renumbering;

static int new_numbers(dmk_context *ctx, int32_t n, int32_t **number)
{
    int rc;
    DMK_TRY(DMK_NEW_UNSET(ctx, *number, (size_t)n));
    for (int32_t i = 0; i < n; i++) (*number)[i] = -1;
done:
    return rc;
}

/* Vertices, or edges, are numbered as the triangles in their order touch them. */
typedef struct touching {
    const dmk_keyed *sorted;
    int32_t n_triangles;
    const int32_t *from; /* 3 to each old triangle */
    int32_t *to;         /* 3 to each new one */
    int32_t n_old, n;
    int32_t *number, *old_of;
} touching;

static int touch_all(dmk_context *ctx, int32_t k, void *data)
{
    int rc;
    touching *w = (touching *)data + k;
    DMK_TRY(new_numbers(ctx, w->n_old, &w->number));
    DMK_TRY(DMK_NEW_UNSET(ctx, w->old_of, (size_t)w->n_old));
    for (int32_t t = 0; t < w->n_triangles; t++) {
        const int32_t *from = w->from + 3 * (size_t)w->sorted[t].item;
        for (int j = 0; j < 3; j++) {
            int32_t *number = w->number + from[j];
            if (*number < 0) {
                *number = w->n++;
                w->old_of[*number] = from[j];
            }
            w->to[3 * (size_t)t + (size_t)j] = *number;
        }
    }
done:
    return rc;
}

/* Neither knows of the other. */
static int renumber(dmk_context *ctx, const dmk_mesh *m, const dmk_keyed *sorted, renumbering *r,
                    dmk_order *o)
{
    int rc;
    struct dmk_mesh *fresh = o->mesh;
    const size_t n = (size_t)fresh->n_triangles;
    touching part[2] = {{.from = m->triangle_edge, .n_old = m->n_edges},
                        {.from = m->triangle, .n_old = m->n_vertices}};
    DMK_TRY(DMK_NEW_UNSET(ctx, fresh->triangle_edge, 3 * n));
    DMK_TRY(DMK_NEW_UNSET(ctx, fresh->triangle, 3 * n));
    part[0].to = fresh->triangle_edge;
    part[1].to = fresh->triangle;
    for (int k = 0; k < 2; k++) {
        part[k].sorted = sorted;
        part[k].n_triangles = fresh->n_triangles;
    }
    rc = dmk_parallel_pieces(ctx, 2, touch_all, part);
    fresh->n_edges = part[0].n;
    fresh->n_vertices = part[1].n;
    r->edge = part[0].number;
    r->vertex = part[1].number;
    o->edge_old = part[0].old_of;
    o->vertex_old = part[1].old_of;
done:
    return rc;
}

typedef struct gather_job {
    const dmk_mesh *from;
    const renumbering *number;
    const dmk_order *order;
    const dmk_keyed *sorted;
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
        const int32_t old = job->sorted[t].item;
        job->order->triangle_old[t] = old;
        job->number->triangle[old] = t;
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
    gather_job job = {m, number, o, NULL};
    size_t n_v = (size_t)to->n_vertices, n_e = (size_t)to->n_edges;
    DMK_TRY(DMK_NEW_UNSET(ctx, to->xyz, 3 * n_v));
    DMK_TRY(DMK_NEW_UNSET(ctx, to->edge_vertex, 2 * n_e));
    DMK_TRY(DMK_NEW_UNSET(ctx, to->edge_triangle, 2 * n_e));
    DMK_TRY(DMK_NEW_UNSET(ctx, to->length, n_e));
    to->n_components = 1;
    dmk_parallel(ctx, to->n_vertices, gather_vertices, &job);
    dmk_parallel(ctx, to->n_edges, gather_edges, &job);
    if (m->n_border_edges > 0)
        DMK_TRY(dmk_mesh_count(ctx, to));
    else
        to->n_used_vertices = to->n_vertices;
    DMK_TRY(dmk_mesh_describe(ctx, to, m->n_components == 1 ? m : NULL));
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
    DMK_TRY(DMK_NEW_UNSET(ctx, number.triangle, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW_UNSET(ctx, o->triangle_old, (size_t)o->mesh->n_triangles));
    DMK_TRY(DMK_NEW_UNSET(ctx, o->mesh->area, (size_t)o->mesh->n_triangles));
    dmk_parallel(ctx, o->mesh->n_triangles, gather_triangles, &(gather_job){m, &number, o, sorted});
    free(sorted);
    sorted = NULL;
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
