/* The public object: numbering, polylines, counts. */
#include "base/sets.h"
#include "base/vec3.h"
#include "geodesic/finer.h"
#include "locus/cotree.h"

#include <stdlib.h>
#include <string.h>

void dmk_locus_options_init(dmk_locus_options *options, size_t size)
{
    const dmk_locus_options defaults = {.struct_size = sizeof defaults};
    dmk_options_fill(options, size, &defaults, sizeof defaults);
}

/* The locus while it is put together. A vertex lies on a crossing or in a triangle with three at most. */
typedef struct sketch {
    dmk_locus *locus;
    int32_t (*next)[3]; /* neighbours of each vertex, degree of them */
    int32_t *number;    /* vertex on each crossing, -1: none */
    size_t vertex_room, edge_room, next_room;
} sketch;

/* A new vertex, still to be filled in. */
static int add_vertex(dmk_context *ctx, sketch *s, int32_t *v)
{
    int rc;
    dmk_locus *l = s->locus;
    const size_t n = l->info.n_vertices + 1;
    DMK_TRY(DMK_GROW(ctx, l->vertex, n, s->vertex_room));
    DMK_TRY(DMK_GROW(ctx, s->next, n, s->next_room));
    *v = (int32_t)l->info.n_vertices++;
    memset(&l->vertex[*v], 0, sizeof *l->vertex);
done:
    return rc;
}

static int join(dmk_context *ctx, sketch *s, int32_t a, int32_t b, double strength)
{
    dmk_locus *l = s->locus;
    int rc = DMK_GROW(ctx, l->edge, l->info.n_edges + 1, s->edge_room);
    if (rc != DMK_OK) return rc;
    l->edge[l->info.n_edges++] = (dmk_locus_edge){{a, b}, strength};
    s->next[a][l->vertex[a].degree++] = b;
    s->next[b][l->vertex[b].degree++] = a;
    l->vertex[a].strength = fmax(l->vertex[a].strength, strength);
    l->vertex[b].strength = fmax(l->vertex[b].strength, strength);
    l->info.length += dmk_distance(l->vertex[a].xyz, l->vertex[b].xyz);
    return DMK_OK;
}

/* The crossings kept in a triangle are joined to a vertex in it, an end point or a fork, or to each other. The vertex
 * does not depend on the strength asked for; forks with branches weaker than the default lie on straight lines. */
static int join_triangle(dmk_context *ctx, const dmk_cotree *t, int32_t triangle, sketch *s)
{
    int rc = DMK_OK, n = 0;
    int32_t kept[3], v = -1;
    for (int k = 0; k < 3; k++) {
        const int32_t i = t->on[3 * triangle + k];
        if (i >= 0 && s->number[i] >= 0) kept[n++] = i;
    }
    if (n == 0) return DMK_OK;
    const dmk_end_point *end = dmk_end_in(t, triangle);
    const bool is_end = end && !t->is_point && s->number[end->crossing] >= 0;
    if (is_end || n == 3 || (n == 2 && dmk_is_fork(t, triangle))) {
        DMK_TRY(add_vertex(ctx, s, &v));
        if (is_end)
            dmk_place_end(t, end, &s->locus->vertex[v]);
        else
            dmk_place_fork(t, triangle, &s->locus->vertex[v]);
        for (int k = 0; k < n; k++)
            DMK_TRY(join(ctx, s, s->number[kept[k]], v, t->crossing[kept[k]].strength));
    } else if (n == 2) {
        const double weaker = fmin(t->crossing[kept[0]].strength, t->crossing[kept[1]].strength);
        rc = join(ctx, s, s->number[kept[0]], s->number[kept[1]], weaker);
    }
done:
    return rc;
}

/* A locus that is one point; also what is left of a tree when all of it is too weak. */
static int draw_point(dmk_context *ctx, const dmk_cotree *t, sketch *s)
{
    int32_t v;
    int rc = add_vertex(ctx, s, &v);
    if (rc != DMK_OK) return rc;
    if (t->is_point)
        dmk_place_end(t, &t->end[0], &s->locus->vertex[v]);
    else
        dmk_place_crossing(t, t->last, &s->locus->vertex[v]);
    s->locus->vertex[v].strength = t->crossing[t->last].excess;
    return DMK_OK;
}

/* On a border's edge nothing is, where the rest of its branch is too weak: no line is drawn there. */
static bool is_joined(const dmk_cotree *t, int32_t i, double strength)
{
    for (int k = 0; k < 6; k++) {
        const int32_t node = t->crossing[i].node[k / 3];
        const int32_t j = node < t->geodesics->mesh->n_triangles ? t->on[3 * node + k % 3] : -1;
        const dmk_end_point *end = j == i ? dmk_end_in(t, node) : NULL;
        if (j == i ? end && end->crossing == i : j >= 0 && dmk_is_drawn(t, j, strength))
            return true;
    }
    return false;
}

/* Crossings of `strength` or more and what joins them. */
static int draw(dmk_context *ctx, const dmk_cotree *t, double strength, sketch *s)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->number, (size_t)t->n));
    for (int32_t i = 0; i < t->n; i++) {
        s->number[i] = -1;
        if (!dmk_is_drawn(t, i, strength) || !is_joined(t, i, strength)) continue;
        DMK_TRY(add_vertex(ctx, s, &s->number[i]));
        dmk_place_crossing(t, i, &s->locus->vertex[s->number[i]]);
    }
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < t->geodesics->mesh->n_triangles && s->locus->info.n_vertices > 0; i++)
        DMK_TRY(join_triangle(ctx, t, i, s));
    if (s->locus->info.n_vertices == 0 && t->last >= 0) DMK_TRY(draw_point(ctx, t, s));
done:
    return rc;
}

/* From the finer mesh back to the geodesics' own. */
static void place_back(const dmk_geodesics *g, const dmk_finer *f, dmk_locus *l)
{
    for (size_t i = 0; i < l->info.n_vertices && f->mesh; i++) {
        dmk_locus_vertex *v = &l->vertex[i];
        v->place.triangle = f->parent[v->place.triangle];
        dmk_mesh_nearest_in(g->mesh, (int32_t)v->place.triangle, v->xyz, v->place.weight);
        dmk_point_snap(v->place.weight);
        for (int k = 0; k < 2; k++) v->angle[k] -= f->turn[v->source[k]];
    }
}

/* Angles at the source scaled to a full turn of 2 pi; kinds and their counts. */
static void finish_vertices(const dmk_cotree *t, dmk_locus *l)
{
    static const dmk_locus_kind kind[] = {DMK_LOCUS_POINT, DMK_LOCUS_END, DMK_LOCUS_ORDINARY,
                                          DMK_LOCUS_BRANCH}; /* by degree */
    const double full = dmk_full_turn(t->geodesics), scale = full < HUGE_VAL ? 2 * M_PI / full : 1;
    for (size_t i = 0; i < l->info.n_vertices; i++) {
        dmk_locus_vertex *v = &l->vertex[i];
        v->source_angle *= scale;
        for (int k = 0; k < 2; k++) {
            v->angle[k] *= scale;
            if (full < HUGE_VAL) v->angle[k] -= 2 * M_PI * floor(v->angle[k] / (2 * M_PI));
        }
        v->kind = kind[v->degree];
        l->info.endpoints += v->degree == 1;
        l->info.branch_points += v->degree > 2;
    }
}

/* Follow the line that leaves `from` towards `to` up to a vertex of degree other than 2 or back to the start. */
static int32_t write_line(const sketch *s, int32_t from, int32_t to, bool *seen, int32_t at)
{
    dmk_locus *l = s->locus;
    const int32_t first = from;
    l->index[at++] = from;
    for (;;) {
        l->index[at++] = to;
        seen[to] = true;
        if (l->vertex[to].degree != 2 || to == first) return at;
        const int32_t next = s->next[to][0] == from ? s->next[to][1] : s->next[to][0];
        from = to;
        to = next;
    }
}

/* Lines between vertices of degree other than 2, each once, then closed curves without such. */
static int write_polylines(dmk_context *ctx, sketch *s)
{
    int rc;
    bool *seen = NULL;
    int32_t at = 0;
    dmk_locus *l = s->locus;
    const int32_t n = (int32_t)l->info.n_vertices;
    DMK_TRY(DMK_NEW(ctx, seen, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, l->index, 2 * l->info.n_edges + 1));
    DMK_TRY(DMK_NEW(ctx, l->offset, l->info.n_edges + 2));
    for (int pass = 0; pass < 2; pass++) {
        for (int32_t i = 0; i < n; i++) {
            const int32_t degree = l->vertex[i].degree;
            const bool starts = pass == 0 ? degree != 2 : degree == 2 && !seen[i];
            for (int32_t k = 0; starts && k < (pass == 0 ? degree : 1); k++) {
                const int32_t to = s->next[i][k]; /* seen, or less: written from there */
                if (l->vertex[to].degree == 2 ? seen[to] : to < i) continue;
                at = write_line(s, i, to, seen, at);
                l->offset[++l->info.n_polylines] = at;
            }
        }
    }
done:
    free(seen);
    return rc;
}

static int count_components(dmk_context *ctx, dmk_locus *l)
{
    int32_t *parent = NULL;
    int rc = DMK_NEW(ctx, parent, l->info.n_vertices);
    if (rc != DMK_OK) return rc;
    for (size_t i = 0; i < l->info.n_vertices; i++) parent[i] = (int32_t)i;
    l->info.components = l->info.n_vertices;
    for (size_t i = 0; i < l->info.n_edges; i++)
        l->info.components -= dmk_set_unite(parent, l->edge[i].vertex[0], l->edge[i].vertex[1]);
    l->info.loops = (int64_t)(l->info.n_edges + l->info.components) - (int64_t)l->info.n_vertices;
    free(parent);
    return DMK_OK;
}

int dmk_locus_trace(dmk_context *ctx, const dmk_geodesics *g, const dmk_locus_options *opt,
                    dmk_locus **locus)
{
    int rc;
    dmk_cotree t = {0};
    dmk_finer f;
    sketch s = {0};
    DMK_TRY(dmk_finer_create(ctx, g, &f));
    DMK_TRY(DMK_NEW(ctx, s.locus, 1));
    DMK_TRY(dmk_cotree_complete(ctx, f.geodesics, f.mean_edge, &t));
    DMK_TRY(dmk_poll(ctx));
    s.locus->info.strength = dmk_strength_asked(&t, opt);
    DMK_TRY(draw(ctx, &t, s.locus->info.strength, &s));
    place_back(g, &f, s.locus);
    finish_vertices(&t, s.locus);
    DMK_TRY(write_polylines(ctx, &s));
    DMK_TRY(count_components(ctx, s.locus));
    *locus = s.locus;
    s.locus = NULL;
done:
    free(s.next);
    free(s.number);
    dmk_locus_destroy(&s.locus);
    dmk_cotree_free(&t);
    dmk_finer_free(&f);
    return rc;
}

void dmk_locus_renumber(dmk_locus *l, const int32_t *triangle_old, const double *density)
{
    for (size_t i = 0; i < l->info.n_vertices; i++) {
        dmk_locus_vertex *v = &l->vertex[i];
        v->place.triangle = triangle_old[v->place.triangle];
        if (density) v->mu = density[v->place.triangle];
    }
}

void dmk_locus_destroy(dmk_locus **locus)
{
    dmk_locus *l = locus ? *locus : NULL;
    if (!l) return;
    free(l->vertex);
    free(l->edge);
    free(l->offset);
    free(l->index);
    free(l);
    *locus = NULL;
}

void dmk_locus_get_info(const dmk_locus *locus, dmk_locus_info *info)
{
    if (info) *info = locus ? locus->info : (dmk_locus_info){0};
}

const dmk_locus_vertex *dmk_locus_vertices(const dmk_locus *locus, size_t *n)
{
    if (n) *n = locus ? locus->info.n_vertices : 0;
    return locus ? locus->vertex : NULL;
}

const dmk_locus_edge *dmk_locus_edges(const dmk_locus *locus, size_t *n)
{
    if (n) *n = locus ? locus->info.n_edges : 0;
    return locus ? locus->edge : NULL;
}

const int32_t *dmk_locus_polylines(const dmk_locus *locus, const int32_t **offset, size_t *n)
{
    if (offset) *offset = locus ? locus->offset : NULL;
    if (n) *n = locus ? locus->info.n_polylines : 0;
    return locus ? locus->index : NULL;
}
