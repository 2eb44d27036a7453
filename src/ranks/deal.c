/* A mesh dealt out to ranks: runs of the Morton order, ghosts around them, and the mesh that a rank
 * packs. */
#include "ranks/levels.h"

#include <stdlib.h>
#include <string.h>

/* Gaps behind the vertices: the corners of gap triangles are spread over them. */
enum { SPARE_VERTICES = 64 };

/* The ghosts that a rank reads. */
typedef struct dmk_needs {
    dmk_list element, edge, vertex; /* edges and vertices: of the elements here */
    dmk_list level_vertex[DMK_SHARE_LEVELS], level_edge[DMK_SHARE_LEVELS];
} needs;

static void needs_free(needs *n)
{
    if (!n) return;
    dmk_list_free(&n->element);
    dmk_list_free(&n->edge);
    dmk_list_free(&n->vertex);
    for (int l = 0; l < DMK_SHARE_LEVELS; l++) {
        dmk_list_free(&n->level_vertex[l]);
        dmk_list_free(&n->level_edge[l]);
    }
    free(n);
}

/* ---- own items ------------------------------------------------------------------------------- */

/* The nearest bound between parts. */
static int64_t nearest_part(int32_t part, int64_t item, int64_t n)
{
    const int64_t nearest = (item + part / 2) / part * part;
    return nearest < n ? nearest : n;
}

int64_t dmk_bound_elements(int32_t part, int64_t n, int r, int size)
{
    const int64_t parts = (n + part - 1) / part, end = parts * r / size * part;
    return end < n ? end : n;
}

int64_t dmk_bound_touched(int32_t part, int64_t touched, int64_t n, bool last)
{
    return last ? n : nearest_part(part, touched, n);
}

/* Of a mesh that is whole here. */
static void find_bounds(const dmk_share *s, const dmk_mesh *m)
{
    int32_t t = 0, edges = 0, vertices = 0;
    const int size = s->ranks.size;
    for (int r = 1; r <= size; r++) {
        const int64_t end = s->element.bound[r] =
            dmk_bound_elements(s->part, m->n_triangles, r, size);
        for (; t < end; t++) {
            for (int k = 0; k < 3; k++) {
                edges = dmk_max_i(edges, m->triangle_edge[3 * (size_t)t + (size_t)k] + 1);
                vertices = dmk_max_i(vertices, m->triangle[3 * (size_t)t + (size_t)k] + 1);
            }
        }
        s->edge.bound[r] = dmk_bound_touched(s->part, edges, m->n_edges, r == size);
        s->vertex[0].bound[r] = dmk_bound_touched(s->part, vertices, m->n_vertices, r == size);
    }
}

/* Elements by whole parts; edges and vertices, numbered by first touch, where those of the elements
 * begin, but by whole parts as well. */
static int own_items(dmk_context *ctx, dmk_share *s, const dmk_ground *g)
{
    int rc = DMK_OK;
    dmk_space *const space[3] = {&s->element, &s->edge, &s->vertex[0]};
    const size_t n = (size_t)s->ranks.size + 1;
    for (int k = 0; k < 3; k++) {
        DMK_TRY(DMK_NEW(ctx, space[k]->bound, n));
        if (g->bound[k]) memcpy(space[k]->bound, g->bound[k], n * sizeof *g->bound[k]);
    }
    if (!g->bound[0]) find_bounds(s, g->mesh);
    for (int k = 0; k < 3; k++) dmk_space_set_own(&s->ranks, space[k]);
    s->level_edge[0] = s->edge;
done:
    return rc;
}

/* ---- ghosts ---------------------------------------------------------------------------------- */

/* Whole numbers of a triangle's corners and edges. */
typedef struct six {
    int64_t vertex[3], edge[3];
} six;

static six whole_six(const dmk_ground *g, int32_t t)
{
    six x = {{0}, {0}};
    for (size_t k = 0; k < 3; k++) {
        x.vertex[k] = dmk_whole_number(g->vertex, g->mesh->triangle[3 * (size_t)t + k]);
        x.edge[k] = dmk_whole_number(g->edge, g->mesh->triangle_edge[3 * (size_t)t + k]);
    }
    return x;
}

/* Own elements and those at own edges and vertices; and their edges and vertices. */
static int need_elements(dmk_context *ctx, const dmk_share *s, const dmk_ground *g, needs *n)
{
    int rc = DMK_OK;
    for (int32_t t = 0; t < g->mesh->n_triangles; t++) {
        const six x = whole_six(g, t);
        const int64_t whole = dmk_whole_number(g->element, t);
        bool here = dmk_space_owns(&s->element, whole);
        for (int i = 0; i < 3; i++) {
            here = here || dmk_space_owns(&s->vertex[0], x.vertex[i]) ||
                   dmk_space_owns(&s->edge, x.edge[i]);
        }
        if (!here) continue;
        DMK_TRY(dmk_list_add_ghost(ctx, &n->element, &s->element, whole));
        for (int i = 0; i < 3; i++) {
            DMK_TRY(dmk_list_add_ghost(ctx, &n->vertex, &s->vertex[0], x.vertex[i]));
            DMK_TRY(dmk_list_add_ghost(ctx, &n->edge, &s->edge, x.edge[i]));
        }
    }
    dmk_list_sort(&n->element);
    dmk_list_sort(&n->edge);
    dmk_list_sort(&n->vertex);
done:
    return rc;
}

/* Edges at own vertices of T: they are of elements here. */
static int need_ground(dmk_context *ctx, const dmk_share *s, const dmk_ground *g, needs *n)
{
    int rc = DMK_OK;
    for (int32_t e = 0; e < g->mesh->n_edges; e++) {
        bool here = false;
        for (size_t k = 0; k < 2; k++) {
            const int32_t v = g->mesh->edge_vertex[2 * (size_t)e + k];
            here = here || dmk_space_owns(&s->vertex[0], dmk_whole_number(g->vertex, v));
        }
        if (here)
            DMK_TRY(
                dmk_list_add_ghost(ctx, &n->level_edge[0], &s->edge, dmk_whole_number(g->edge, e)));
    }
    for (size_t i = 0; i < n->vertex.n; i++)
        DMK_TRY(dmk_list_add(ctx, &n->level_vertex[0], n->vertex.at[i]));
done:
    return rc;
}

/* Local slots: T's elements, edges and vertices by parts, those of the levels below one after
 * another. */
static int create_spaces(dmk_context *ctx, dmk_share *s, const needs *n)
{
    int rc = DMK_OK;
    dmk_list edge = {0};
    const dmk_list *v = n->level_vertex, *e = n->level_edge;
    for (size_t i = 0; i < n->edge.n; i++) DMK_TRY(dmk_list_add(ctx, &edge, n->edge.at[i]));
    for (size_t i = 0; i < e[0].n; i++) DMK_TRY(dmk_list_add(ctx, &edge, e[0].at[i]));
    dmk_list_sort(&edge);
    DMK_TRY(dmk_space_create(ctx, n->element.n, n->element.at, s->part, 0, &s->element));
    DMK_TRY(dmk_space_create(ctx, edge.n, edge.at, s->part, 1, &s->edge));
    DMK_TRY(dmk_space_create(ctx, v[0].n, v[0].at, s->part, SPARE_VERTICES, &s->vertex[0]));
    for (int32_t l = 1; l <= s->first_whole; l++) {
        DMK_TRY(dmk_space_create(ctx, v[l].n, v[l].at, 1, l < s->first_whole, &s->vertex[l]));
        DMK_TRY(dmk_space_create(ctx, e[l].n, e[l].at, 1, 0, &s->level_edge[l]));
    }
    s->vertex_row = (s->edge.n / s->part + 1) * s->part;
    s->level_edge[0] = s->edge;
done:
    dmk_list_free(&edge);
    return rc;
}

static dmk_need need_of(const dmk_space *space, const dmk_list *list, int32_t offset)
{
    return (dmk_need){space, list->n, list->at, offset};
}

static int create_halos(dmk_context *ctx, dmk_share *s, const needs *n)
{
    int rc;
    const dmk_need rows[2] = {need_of(&s->edge, &n->edge, 0),
                              need_of(&s->vertex[0], &n->vertex, s->vertex_row)};
    DMK_TRY(dmk_halo_create(ctx, s, 2, rows, &s->rows));
    DMK_TRY(dmk_halo_keep(ctx, s, &s->rows));
    for (int32_t l = 0; l <= s->first_whole; l++) {
        const dmk_need vertices = need_of(&s->vertex[l], &n->level_vertex[l], 0);
        const dmk_need edges = need_of(&s->level_edge[l], &n->level_edge[l], 0);
        DMK_TRY(dmk_halo_create(ctx, s, 1, &vertices, &s->vertices[l]));
        DMK_TRY(dmk_halo_create(ctx, s, 1, &edges, &s->level_edges[l]));
    }
    s->traffic.own_rows = dmk_space_own(&s->edge) + dmk_space_own(&s->vertex[0]);
    s->traffic.ghost_rows = s->rows.n_receive;
done:
    return rc;
}

/* ---- the mesh that is packed ----------------------------------------------------------------- */

/* The slots of a space that are gaps, in turn. */
static int32_t next_gap(const dmk_space *s, int32_t before)
{
    for (int32_t i = before + 1;; i = i + 1 < s->n ? i + 1 : 0) {
        if (i < s->n && dmk_space_whole(s, i) < 0) return i;
    }
}

/* Where a whole number stands among n increasing ones, or -1 - i: it would stand at i. `from`: not before there. */
static int32_t find_here(const int64_t *number, int32_t n, int64_t whole, int32_t from)
{
    if (!number) return (int32_t)whole;
    int32_t i = from < 0 ? 0 : from;
    while (i < n && number[i] < whole) i++;
    return i < n && number[i] == whole ? i : -1 - i;
}

/* A gap is an element of no weight between gaps. */
static void local_triangles(const dmk_share *s, const dmk_ground *g, dmk_mesh *l)
{
    const dmk_mesh *m = g->mesh;
    int32_t gap = next_gap(&s->vertex[0], -1), gap_edge = next_gap(&s->edge, -1), at = 0;
    for (int32_t t = 0; t < l->n_triangles; t++) {
        const int64_t whole = dmk_space_whole(&s->element, t);
        if (whole >= 0) at = find_here(g->element, m->n_triangles, whole, at);
        const six x = whole < 0 ? (six){{0}, {0}} : whole_six(g, at);
        l->area[t] = whole < 0 ? g->area : m->area[at];
        for (size_t k = 0; k < 3; k++) {
            const size_t to = 3 * (size_t)t + k;
            l->triangle[to] = whole < 0 ? gap : dmk_space_slot(&s->vertex[0], x.vertex[k]);
            l->triangle_edge[to] = whole < 0 ? gap_edge : dmk_space_slot(&s->edge, x.edge[k]);
        }
        if (whole < 0) gap = next_gap(&s->vertex[0], gap);
    }
}

/* Edge `at` of the ground's mesh, or one that is not there: -1. */
static void local_edge(const dmk_share *s, const dmk_ground *g, int32_t at, int32_t e, dmk_mesh *l,
                       int32_t end[2])
{
    const dmk_mesh *m = g->mesh;
    l->length[e] = at < 0 ? 0 : m->length[at];
    for (size_t k = 0; k < 2; k++) {
        const int32_t t = at < 0 ? -1 : m->edge_triangle[2 * (size_t)at + k];
        l->edge_triangle[2 * (size_t)e + k] =
            t < 0 ? -1 : dmk_space_slot(&s->element, dmk_whole_number(g->element, t));
        end[k] =
            at < 0
                ? -1
                : dmk_space_slot(&s->vertex[0],
                                 dmk_whole_number(g->vertex, m->edge_vertex[2 * (size_t)at + k]));
    }
}

/* A gap, and an edge of which only its weight is wanted, lead from a gap to itself. */
static void local_edges(const dmk_share *s, const dmk_ground *g, dmk_mesh *l)
{
    int32_t gap = next_gap(&s->vertex[0], -1), at = 0;
    for (int32_t e = 0; e < l->n_edges; e++) {
        const int64_t whole = dmk_space_whole(&s->edge, e);
        int32_t end[2], found = -1;
        if (whole >= 0) {
            found = find_here(g->edge, g->mesh->n_edges, whole, at);
            at = found < 0 ? -1 - found : found;
        }
        local_edge(s, g, found < 0 ? -1 : found, e, l, end);
        const bool here = end[0] >= 0 && end[1] >= 0;
        if (!here) gap = next_gap(&s->vertex[0], gap);
        for (size_t k = 0; k < 2; k++) l->edge_vertex[2 * (size_t)e + k] = here ? end[k] : gap;
    }
}

static int local_mesh(dmk_context *ctx, const dmk_share *s, const dmk_ground *g, dmk_mesh *l)
{
    int rc;
    l->n_vertices = s->vertex[0].n;
    l->n_edges = s->edge.n;
    l->n_triangles = s->element.n;
    DMK_TRY(DMK_NEW(ctx, l->triangle, 3 * (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->triangle_edge, 3 * (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->length, (size_t)l->n_edges));
    DMK_TRY(DMK_NEW(ctx, l->area, (size_t)l->n_triangles));
    DMK_TRY(DMK_NEW(ctx, l->edge_vertex, 2 * (size_t)l->n_edges));
    DMK_TRY(DMK_NEW(ctx, l->edge_triangle, 2 * (size_t)l->n_edges));
    local_triangles(s, g, l);
    local_edges(s, g, l);
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
                    const dmk_ground *ground, dmk_share **share)
{
    int rc;
    dmk_share *s = NULL;
    int32_t part = (int32_t)dmk_launch_part(device);
    const int64_t *bound = ground->bound[2];
    if ((bound ? bound[ranks->size] : ground->mesh->n_vertices) / part < ranks->size) return DMK_OK;
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->ranks = *ranks;
    s->device = device;
    s->part = part;
    DMK_TRY(get_kernels(ctx, s));
    DMK_TRY(own_items(ctx, s, ground));
    *share = s;
    s = NULL;
done:
    dmk_share_destroy(&s);
    return rc;
}

int dmk_share_deal(dmk_context *ctx, dmk_share *s, const dmk_ground *g, const dmk_parts *p)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->needs, 1));
    DMK_TRY(need_elements(ctx, s, g, s->needs));
    DMK_TRY(need_ground(ctx, s, g, s->needs));
    for (int32_t l = 0; l <= s->first_whole; l++)
        DMK_TRY(
            dmk_levels_need(ctx, s, p, l, &s->needs->level_vertex[l], &s->needs->level_edge[l]));
    DMK_TRY(create_spaces(ctx, s, s->needs));
done:
    return rc;
}

int dmk_share_connect(dmk_context *ctx, dmk_share *s)
{
    const int rc = create_halos(ctx, s, s->needs);
    needs_free(s->needs);
    s->needs = NULL;
    return rc;
}

int dmk_share_fill(dmk_context *ctx, dmk_share *s, const dmk_ground *ground)
{
    int rc;
    DMK_TRY(local_mesh(ctx, s, ground, &s->mesh));
    DMK_TRY(dmk_split_elements(ctx, s));
    DMK_TRY(dmk_split_graph(ctx, s, 0, s->mesh.n_edges, s->mesh.edge_vertex));
done:
    return rc;
}

void dmk_share_forget(dmk_share *s)
{
    s->level_edge[0] = (dmk_space){0};
    for (int l = 1; l < DMK_SHARE_LEVELS; l++) {
        const int64_t n = s->vertex[l].n_whole;
        dmk_space_free(&s->vertex[l]);
        dmk_space_free(&s->level_edge[l]);
        s->vertex[l].n_whole = n;
    }
}

void dmk_share_destroy(dmk_share **share)
{
    dmk_share *s = *share;
    if (!s) return;
    s->level_edge[0] = (dmk_space){0};
    needs_free(s->needs);
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
