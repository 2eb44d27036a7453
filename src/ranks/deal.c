/* A mesh dealt out to ranks: runs of the Morton order, ghosts around them, and the mesh that a rank
 * packs. */
#include "ranks/deal.h"

#include <stdlib.h>
#include <string.h>

/* Gaps behind the vertices: the corners of gap triangles are spread over them. */
enum { SPARE_VERTICES = 64 };

/* What a rank reads of a level beside its own items. */
typedef struct dmk_marks {
    uint8_t *element, *edge, *vertex; /* edges and vertices: of the marked elements */
    uint8_t *level_vertex[DMK_SHARE_LEVELS], *level_edge[DMK_SHARE_LEVELS];
} marks;

static void marks_free(marks *m)
{
    if (!m) return;
    free(m->element);
    free(m->edge);
    free(m->vertex);
    for (int l = 0; l < DMK_SHARE_LEVELS; l++) {
        free(m->level_vertex[l]);
        free(m->level_edge[l]);
    }
    free(m);
}

/* ---- own items ------------------------------------------------------------------------------- */

static void set_own(const dmk_share *s, dmk_space *space)
{
    space->first = space->bound[s->ranks.rank];
    space->end = space->bound[s->ranks.rank + 1];
}

/* The nearest bound between parts. */
static int32_t nearest_part(const dmk_share *s, int32_t item, int32_t n)
{
    return dmk_min_i((item + s->part / 2) / s->part * s->part, n);
}

/* Elements by whole parts; edges and vertices, numbered by first touch, where those of the elements
 * begin, but by whole parts as well. */
static int own_items(dmk_context *ctx, dmk_share *s, const dmk_mesh *m)
{
    int rc;
    int64_t size = s->ranks.size, parts = (m->n_triangles + s->part - 1) / s->part;
    int32_t t = 0, edges = 0, vertices = 0;
    s->element.n_whole = m->n_triangles;
    s->edge.n_whole = m->n_edges;
    s->vertex[0].n_whole = m->n_vertices;
    DMK_TRY(DMK_NEW(ctx, s->element.bound, (size_t)size + 1));
    DMK_TRY(DMK_NEW(ctx, s->edge.bound, (size_t)size + 1));
    DMK_TRY(DMK_NEW(ctx, s->vertex[0].bound, (size_t)size + 1));
    for (int64_t r = 1; r <= size; r++) {
        int32_t end = dmk_min_i((int32_t)(parts * r / size) * s->part, m->n_triangles);
        for (; t < end; t++) {
            for (int k = 0; k < 3; k++) {
                edges = dmk_max_i(edges, m->triangle_edge[3 * (size_t)t + (size_t)k] + 1);
                vertices = dmk_max_i(vertices, m->triangle[3 * (size_t)t + (size_t)k] + 1);
            }
        }
        s->element.bound[r] = end;
        s->edge.bound[r] = r < size ? nearest_part(s, edges, m->n_edges) : m->n_edges;
        s->vertex[0].bound[r] = r < size ? nearest_part(s, vertices, m->n_vertices) : m->n_vertices;
    }
    set_own(s, &s->element);
    set_own(s, &s->edge);
    set_own(s, &s->vertex[0]);
done:
    return rc;
}

/* ---- ghosts ---------------------------------------------------------------------------------- */

/* Own elements and those at own edges and vertices; and their edges and vertices. */
static int mark_elements(dmk_context *ctx, const dmk_share *s, const dmk_mesh *m, marks *k)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, k->element, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, k->edge, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, k->vertex, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * (size_t)t, *e = m->triangle_edge + 3 * (size_t)t;
        bool here = dmk_space_owns(&s->element, t);
        for (int i = 0; i < 3; i++) {
            here = here || dmk_space_owns(&s->vertex[0], v[i]) || dmk_space_owns(&s->edge, e[i]);
        }
        if (!here) continue;
        k->element[t] = 1;
        for (int i = 0; i < 3; i++) k->vertex[v[i]] = k->edge[e[i]] = 1;
    }
done:
    return rc;
}

static int mark_levels(dmk_context *ctx, const dmk_share *s, const dmk_mesh *m,
                       const dmk_hierarchy *h, marks *k)
{
    int rc = DMK_OK;
    for (int32_t l = 0; l <= s->first_whole; l++) {
        size_t edges = (size_t)(l > 0 ? s->level_edge[l].n_whole : m->n_edges);
        DMK_TRY(DMK_NEW(ctx, k->level_vertex[l], (size_t)s->vertex[l].n_whole));
        DMK_TRY(DMK_NEW(ctx, k->level_edge[l], edges));
        dmk_deal_mark(s, m, h, l, k->level_vertex[l], k->level_edge[l]);
    }
    for (int32_t v = 0; v < m->n_vertices; v++) k->level_vertex[0][v] |= k->vertex[v];
done:
    return rc;
}

/* Local slots: T's elements, edges and vertices by parts, those of the levels below one after
 * another. */
static int create_spaces(dmk_context *ctx, dmk_share *s, const marks *k)
{
    int rc;
    uint8_t *edge = NULL;
    DMK_TRY(DMK_NEW(ctx, edge, (size_t)s->edge.n_whole));
    for (int32_t e = 0; e < s->edge.n_whole; e++) edge[e] = k->edge[e] | k->level_edge[0][e];
    DMK_TRY(dmk_space_create(ctx, k->element, s->part, 0, &s->element));
    DMK_TRY(dmk_space_create(ctx, edge, s->part, 1, &s->edge));
    DMK_TRY(dmk_space_create(ctx, k->level_vertex[0], s->part, SPARE_VERTICES, &s->vertex[0]));
    for (int32_t l = 1; l <= s->first_whole; l++) {
        DMK_TRY(dmk_space_create(ctx, k->level_vertex[l], 1, l < s->first_whole, &s->vertex[l]));
        DMK_TRY(dmk_space_create(ctx, k->level_edge[l], 1, 0, &s->level_edge[l]));
    }
    s->vertex_row = (s->edge.n / s->part + 1) * s->part;
    s->level_edge[0] = s->edge;
done:
    free(edge);
    return rc;
}

static int create_halos(dmk_context *ctx, dmk_share *s, const marks *k)
{
    int rc;
    const dmk_need rows[2] = {{&s->edge, k->edge, 0}, {&s->vertex[0], k->vertex, s->vertex_row}};
    DMK_TRY(dmk_halo_create(ctx, s, 2, rows, &s->rows));
    DMK_TRY(dmk_halo_keep(ctx, s, &s->rows));
    for (int32_t l = 0; l <= s->first_whole; l++) {
        const dmk_need vertices = {&s->vertex[l], k->level_vertex[l], 0};
        const dmk_need edges = {&s->level_edge[l], k->level_edge[l], 0};
        DMK_TRY(dmk_halo_create(ctx, s, 1, &vertices, &s->vertices[l]));
        DMK_TRY(dmk_halo_create(ctx, s, 1, &edges, &s->level_edges[l]));
    }
    s->traffic.own_rows = s->edge.end - s->edge.first + s->vertex[0].end - s->vertex[0].first;
    s->traffic.ghost_rows = s->rows.n_receive;
done:
    return rc;
}

/* ---- the mesh that is packed ----------------------------------------------------------------- */

/* The slots of a space that are gaps, in turn. */
static int32_t next_gap(const dmk_space *s, int32_t before)
{
    for (int32_t i = before + 1;; i = i + 1 < s->n ? i + 1 : 0) {
        if (i < s->n && s->whole[i] < 0) return i;
    }
}

/* A gap is an element of no weight between gaps. */
static void local_triangles(const dmk_share *s, const dmk_mesh *m, double area, dmk_mesh *l)
{
    int32_t gap = next_gap(&s->vertex[0], -1), gap_edge = next_gap(&s->edge, -1);
    for (int32_t t = 0; t < l->n_triangles; t++) {
        int32_t whole = s->element.whole[t];
        l->area[t] = whole < 0 ? area : m->area[whole];
        for (size_t k = 0; k < 3; k++) {
            size_t to = 3 * (size_t)t + k, from = 3 * (size_t)whole + k;
            l->triangle[to] = whole < 0 ? gap : dmk_space_slot(&s->vertex[0], m->triangle[from]);
            l->triangle_edge[to] =
                whole < 0 ? gap_edge : dmk_space_slot(&s->edge, m->triangle_edge[from]);
        }
        if (whole < 0) gap = next_gap(&s->vertex[0], gap);
    }
}

/* A gap, and an edge of which only its weight is wanted, lead from a gap to itself. */
static void local_edges(const dmk_share *s, const dmk_mesh *m, dmk_mesh *l)
{
    int32_t gap = next_gap(&s->vertex[0], -1);
    for (int32_t e = 0; e < l->n_edges; e++) {
        int32_t whole = s->edge.whole[e], end[2] = {-1, -1};
        l->length[e] = whole < 0 ? 0 : m->length[whole];
        for (size_t k = 0; k < 2; k++) {
            int32_t t = whole < 0 ? -1 : m->edge_triangle[2 * (size_t)whole + k];
            l->edge_triangle[2 * (size_t)e + k] = t < 0 ? -1 : dmk_space_slot(&s->element, t);
            if (whole >= 0)
                end[k] = dmk_space_slot(&s->vertex[0], m->edge_vertex[2 * (size_t)whole + k]);
        }
        bool here = end[0] >= 0 && end[1] >= 0;
        if (!here) gap = next_gap(&s->vertex[0], gap);
        for (size_t k = 0; k < 2; k++) l->edge_vertex[2 * (size_t)e + k] = here ? end[k] : gap;
    }
}

static int local_mesh(dmk_context *ctx, const dmk_share *s, const dmk_mesh *m, dmk_mesh *l)
{
    int rc;
    double area = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) area += m->area[t];
    l->n_vertices = s->vertex[0].n;
    l->n_edges = s->edge.n;
    l->n_triangles = s->element.n;
    DMK_TRY(DMK_NEW(ctx, l->triangle, 3 * (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->triangle_edge, 3 * (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->length, (size_t)l->n_edges));
    DMK_TRY(DMK_NEW(ctx, l->area, (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->edge_vertex, 2 * (size_t)l->n_edges));
    DMK_TRY(DMK_NEW(ctx, l->edge_triangle, 2 * (size_t)l->n_edges));
    local_triangles(s, m, area, l);
    local_edges(s, m, l);
done:
    return rc;
}

static void local_mesh_free(dmk_mesh *m)
{
    free(m->triangle);
    free(m->triangle_edge);
    free(m->length);
    free(m->area);
    free(m->edge_vertex);
    free(m->edge_triangle);
    *m = (dmk_mesh){0};
}

void dmk_local_free(dmk_local *local)
{
    for (int32_t i = local->first_whole; i < DMK_MAX_LEVELS; i++) {
        local->hierarchy.level[i] = (dmk_coarsening){0};
    }
    dmk_hierarchy_free(&local->hierarchy);
    memset(local, 0, sizeof *local);
}

/* ---- share ----------------------------------------------------------------------------------- */

static int get_kernels(dmk_context *ctx, dmk_share *s)
{
    int rc = DMK_OK;
    for (int p = 0; p < DMK_N_PROGRAMS; p++) {
        DMK_TRY(dmk_kernel_get(ctx, s->device, (dmk_program)p, "halo_pack", &s->pack[p]));
        DMK_TRY(dmk_kernel_get(ctx, s->device, (dmk_program)p, "halo_unpack", &s->unpack[p]));
    }
done:
    return rc;
}

/* Sums go by the parts of launches, whose length is the device's. */
int dmk_share_check_devices(dmk_context *ctx, const dmk_ranks *ranks, const dmk_device *device)
{
    const int32_t part = (int32_t)dmk_launch_part(device);
    int32_t ends[2] = {part, -part};
    const int rc = dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, ends, 2));
    if (rc != DMK_OK || ends[0] == -ends[1]) return rc;
    return dmk_fail(ctx, DMK_E_DEVICE,
                    "the ranks' devices work in parts of %d to %d items: all must be of one kind",
                    -ends[1], ends[0]);
}

int dmk_share_begin(dmk_context *ctx, const dmk_ranks *ranks, dmk_device *device,
                    const dmk_mesh *mesh, dmk_share **share)
{
    int rc;
    dmk_share *s = NULL;
    int32_t part = (int32_t)dmk_launch_part(device);
    if (mesh->n_vertices / part < ranks->size) return DMK_OK;
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->ranks = *ranks;
    s->device = device;
    s->part = part;
    DMK_TRY(get_kernels(ctx, s));
    DMK_TRY(own_items(ctx, s, mesh));
    *share = s;
    s = NULL;
done:
    dmk_share_destroy(&s);
    return rc;
}

int dmk_share_coarsen(dmk_context *ctx, dmk_share *s, const dmk_mesh *mesh, int32_t coarsest,
                      dmk_hierarchy *hierarchy)
{
    const dmk_dealing dealing = {s, dmk_deal_own, dmk_deal_join};
    return dmk_hierarchy_deal(ctx, mesh, coarsest, &dealing, hierarchy);
}

int dmk_share_deal(dmk_context *ctx, dmk_share *s, const dmk_mesh *mesh, const dmk_hierarchy *h)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->marks, 1));
    DMK_TRY(mark_elements(ctx, s, mesh, s->marks));
    DMK_TRY(mark_levels(ctx, s, mesh, h, s->marks));
    DMK_TRY(create_spaces(ctx, s, s->marks));
done:
    return rc;
}

int dmk_share_connect(dmk_context *ctx, dmk_share *s)
{
    const int rc = create_halos(ctx, s, s->marks);
    marks_free(s->marks);
    s->marks = NULL;
    return rc;
}

int dmk_share_fill(dmk_context *ctx, dmk_share *s, const dmk_mesh *mesh)
{
    int rc;
    DMK_TRY(local_mesh(ctx, s, mesh, &s->mesh));
    DMK_TRY(dmk_split_elements(ctx, s));
    DMK_TRY(dmk_split_graph(ctx, s, 0, s->mesh.n_edges, s->mesh.edge_vertex));
done:
    return rc;
}

void dmk_share_forget(dmk_share *s)
{
    s->level_edge[0] = (dmk_space){0};
    for (int l = 1; l < DMK_SHARE_LEVELS; l++) {
        dmk_space_free(&s->vertex[l]);
        dmk_space_free(&s->level_edge[l]);
    }
}

void dmk_share_destroy(dmk_share **share)
{
    dmk_share *s = *share;
    if (!s) return;
    s->level_edge[0] = (dmk_space){0};
    marks_free(s->marks);
    local_mesh_free(&s->mesh);
    dmk_space_free(&s->element);
    dmk_space_free(&s->edge);
    dmk_halo_free(&s->rows);
    for (int l = 0; l < DMK_SHARE_LEVELS; l++) {
        dmk_space_free(&s->vertex[l]);
        dmk_space_free(&s->level_edge[l]);
        dmk_halo_free(&s->vertices[l]);
        dmk_halo_free(&s->level_edges[l]);
        dmk_split_free(&s->graph[l]);
    }
    dmk_split_free(&s->elements);
    dmk_buffer_destroy(&s->staging);
    free(s->host);
    free(s);
    *share = NULL;
}
