/* The public object: numbering, polylines, counts. */
#include "base/graph.h"
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
    int32_t *number; /* vertex on each crossing, -1: none */
    size_t vertex_room, edge_room;
} sketch;

/* A new vertex, still to be filled in. */
static int add_vertex(dmk_context *ctx, sketch *s, int32_t *v)
{
    dmk_locus *l = s->locus;
    int rc = DMK_GROW(ctx, l->vertex, l->info.n_vertices + 1, s->vertex_room);
    if (rc != DMK_OK) return rc;
    *v = (int32_t)l->info.n_vertices++;
    memset(&l->vertex[*v], 0, sizeof *l->vertex);
    return DMK_OK;
}

static int join(dmk_context *ctx, sketch *s, int32_t a, int32_t b, double strength)
{
    dmk_locus *l = s->locus;
    int rc = DMK_GROW(ctx, l->edge, l->info.n_edges + 1, s->edge_room);
    if (rc != DMK_OK) return rc;
    l->edge[l->info.n_edges++] = (dmk_locus_edge){{a, b}, strength};
    return DMK_OK;
}

/* The crossings kept in a triangle are joined to a vertex in it, an end point or a fork, or to each other. The vertex
 * does not depend on the strength asked for; forks with branches weaker than the default lie on straight lines. An edge
 * has the strength up to which it is drawn: that of the weaker one of its ends. */
static int join_triangle(dmk_context *ctx, const dmk_cotree *t, int32_t triangle, sketch *s)
{
    int rc = DMK_OK, n = 0;
    int32_t kept[3], v = -1;
    double worth[3] = {0};
    for (int k = 0; k < 3; k++) {
        const int32_t i = t->on[3 * triangle + k];
        if (i < 0 || s->number[i] < 0) continue;
        worth[n] = t->strength_of[i];
        kept[n++] = i;
    }
    if (n == 0) return DMK_OK;
    const dmk_end_point *end = dmk_end_in(t, triangle);
    const bool is_end = end && !t->is_point && s->number[end->crossing] >= 0;
    const double second = fmax(fmin(worth[0], worth[1]), fmin(fmax(worth[0], worth[1]), worth[2]));
    if (is_end || n == 3 || (n == 2 && dmk_is_fork(t, triangle))) {
        const double own = is_end ? t->strength_of[end->crossing] : second;
        DMK_TRY(add_vertex(ctx, s, &v));
        if (is_end)
            dmk_place_end(t, end, &s->locus->vertex[v]);
        else
            dmk_place_fork(t, triangle, &s->locus->vertex[v]);
        for (int k = 0; k < n; k++)
            DMK_TRY(join(ctx, s, s->number[kept[k]], v, fmin(worth[k], own)));
    } else if (n == 2) {
        rc = join(ctx, s, s->number[kept[0]], s->number[kept[1]], second);
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

/* Crossings of `strength` or more and what joins them. */
static int draw(dmk_context *ctx, const dmk_cotree *t, double strength, sketch *s)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, s->number, (size_t)t->n));
    for (int32_t i = 0; i < t->n; i++) {
        s->number[i] = -1;
        if (!dmk_is_drawn(t, i, strength)) continue;
        DMK_TRY(add_vertex(ctx, s, &s->number[i]));
        dmk_place_crossing(t, i, &s->locus->vertex[s->number[i]]);
    }
    DMK_TRY(dmk_poll(ctx));
    for (int32_t i = 0; i < t->geodesics->mesh->n_triangles && s->locus->info.n_vertices > 0; i++)
        DMK_TRY(join_triangle(ctx, t, i, s));
    if (s->locus->info.n_edges == 0) {
        s->locus->info.n_vertices = 0;
        if (t->last >= 0) rc = draw_point(ctx, t, s);
    }
done:
    return rc;
}

/* What lies at one place is one vertex, which tells of the families that part widest. A place without lines is one only
 * if there are no lines at all, as on a border's edge nothing is where the rest of its branch is too weak. */
static void merge(dmk_locus *l, int32_t *set, int32_t *number)
{
    int32_t n = 0;
    for (size_t i = 0; i < 2 * l->info.n_edges; i++) {
        int32_t *v = &l->edge[i / 2].vertex[i % 2];
        *v = dmk_set_find(set, *v);
        dmk_locus_vertex *of = &l->vertex[*v];
        const double strength = l->edge[i / 2].strength;
        of->strength = of->degree++ > 0 ? fmax(of->strength, strength) : strength;
    }
    for (int32_t i = 0; i < (int32_t)l->info.n_vertices; i++) {
        const dmk_locus_vertex v = l->vertex[i];
        const int32_t first = dmk_set_find(set, i);
        if (first == i) {
            const bool is_one = v.degree > 0 || (l->info.n_edges == 0 && n == 0);
            number[i] = is_one ? n : -1;
            if (is_one) l->vertex[n++] = v;
        } else if (number[first] >= 0) {
            dmk_locus_vertex *of = &l->vertex[number[first]], was = *of;
            if (v.source_angle > was.source_angle) *of = v;
            of->place = was.place;
            of->degree = was.degree;
            of->strength = was.degree > 0 ? was.strength : fmax(v.strength, was.strength);
        }
    }
    l->info.components = l->info.n_vertices = (size_t)n;
    for (size_t i = 0; i < l->info.n_edges; i++) {
        int32_t *v = l->edge[i].vertex;
        l->info.components -= dmk_set_unite(set, v[0], v[1]);
        for (int k = 0; k < 2; k++) v[k] = number[v[k]];
    }
}

/* Lines that run through a vertex of the mesh cross several of its edges there: edges are none whose length is rounding
 * of the distances. */
static int weld(dmk_context *ctx, dmk_locus *l)
{
    int rc;
    size_t n = 0;
    int32_t *set = NULL, *number = NULL;
    DMK_TRY(DMK_NEW(ctx, set, l->info.n_vertices));
    DMK_TRY(DMK_NEW(ctx, number, l->info.n_vertices));
    for (size_t i = 0; i < l->info.n_vertices; i++) set[i] = (int32_t)i;
    for (size_t i = 0; i < l->info.n_edges; i++) {
        const int32_t *v = l->edge[i].vertex;
        const double length = dmk_distance(l->vertex[v[0]].xyz, l->vertex[v[1]].xyz);
        const bool is_none = dmk_snap(length, l->vertex[v[0]].distance) == 0;
        if (is_none) dmk_set_unite(set, v[0], v[1]);
        if (is_none) continue;
        l->info.length += length;
        l->edge[n++] = l->edge[i];
    }
    l->info.n_edges = n;
    merge(l, set, number);
    l->info.loops = (int64_t)(n + l->info.components) - (int64_t)l->info.n_vertices;
done:
    free(set);
    free(number);
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
    const double scale = dmk_turn_scale(t->geodesics);
    for (size_t i = 0; i < l->info.n_vertices; i++) {
        dmk_locus_vertex *v = &l->vertex[i];
        for (int k = 0; k < 2; k++) {
            const double full = dmk_turn_around(t->geodesics, v->source[k]);
            if (full < HUGE_VAL) v->angle[k] -= full * floor(v->angle[k] / full);
            v->angle[k] *= scale;
        }
        v->kind = kind[dmk_min_i(v->degree, 3)];
        l->info.endpoints += v->degree == 1;
        l->info.branch_points += v->degree > 2;
    }
}

int dmk_locus_trace(dmk_context *ctx, const dmk_geodesics *g, const dmk_locus_options *opt,
                    dmk_locus **locus, dmk_seam **seam)
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
    DMK_TRY(weld(ctx, s.locus));
    finish_vertices(&t, s.locus);
    dmk_locus *l = s.locus;
    DMK_TRY(dmk_graph_lines(ctx, l->info.n_vertices, l->info.n_edges,
                            l->edge ? l->edge->vertex : NULL, sizeof *l->edge / sizeof(int32_t),
                            &l->info.n_polylines, &l->offset, &l->index));
    if (seam) DMK_TRY(dmk_seam_create(ctx, &t, opt, seam));
    *locus = s.locus;
    s.locus = NULL;
done:
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
