/* A rank's share of an ordered mesh, from a mesh in pieces: the numbers of mesh/order.c, vertices and edges by first
 * touch, found by asking those that look after the input's. */
#include "ranks/pieces.h"

#include "base/sort.h"
#include "base/vec3.h"

#include <stdlib.h>
#include <string.h>

/* ---- the component's elements, where they belong -------------------------------------------------- */

/* Without the triangles of other components, in an order of its own. */
static int keep_component(dmk_context *ctx, dmk_pieces *p, int64_t triangle)
{
    int rc;
    int64_t here = INT64_MIN, *all = NULL;
    double *xyz = NULL;
    size_t n = 0;
    if (!p->component) return DMK_OK;
    for (size_t t = 0; t < p->n_tiles; t++) {
        if (p->tile[t].number == triangle) here = p->component[t];
    }
    DMK_TRY(dmk_gather_each(ctx, &p->ranks, sizeof here, &here, (void **)&all));
    for (int r = 0; r < p->ranks.size; r++) here = all[r] > here ? all[r] : here;
    for (size_t t = 0; t < p->n_tiles; t++) {
        if (p->component[t] == here) p->tile[n++] = p->tile[t];
    }
    p->n_tiles = n;
    free(p->component);
    p->component = NULL;
    DMK_TRY(dmk_pieces_corners(ctx, p, &xyz));
    rc = dmk_pieces_sort(ctx, p, xyz);
done:
    free(xyz);
    free(all);
    return rc;
}

/* Each tile to the rank that owns its place in the order. */
static int ship_to_owners(dmk_context *ctx, dmk_pieces *p, int32_t part, dmk_plot *plot)
{
    int rc;
    const int size = p->ranks.size;
    int64_t *at = NULL;
    int32_t *count = NULL;
    DMK_TRY(DMK_NEW(ctx, at, (size_t)size + 1));
    DMK_TRY(DMK_NEW(ctx, count, (size_t)size));
    DMK_TRY(dmk_ranks_bound(ctx, &p->ranks, (int64_t)p->n_tiles, at));
    DMK_TRY(DMK_NEW(ctx, plot->bound[0], (size_t)size + 1));
    for (int r = 0; r <= size; r++) plot->bound[0][r] = dmk_bound_elements(part, at[size], r, size);
    const int64_t first = at[p->ranks.rank], end = at[p->ranks.rank + 1];
    for (int r = 0; r < size; r++) {
        const int64_t *bound = plot->bound[0] + r, from = bound[0] > first ? bound[0] : first,
                      to = bound[1] < end ? bound[1] : end;
        count[r] = to > from ? (int32_t)(to - from) : 0;
    }
    rc = dmk_pieces_ship(ctx, p, count);
done:
    free(at);
    free(count);
    return rc;
}

/* ---- numbers by first touch --------------------------------------------------------------------- */

/* An item of the input at a place in the order, 3 * element + k. */
typedef struct touch {
    int64_t item, place;
} touch;

/* Vertices or edges of own tiles, each once, by their numbers in the input. */
typedef struct items {
    touch *list; /* with their first places here */
    size_t n;
    int32_t *which; /* 3 for each tile: the item there */
    dmk_mail asked; /* at those who look after them: by whom */
} items;

static void items_free(items *t)
{
    free(t->list);
    free(t->which);
    dmk_mail_free(&t->asked);
}

static int list_items(dmk_context *ctx, const dmk_pieces *p, bool edges, int64_t first, items *t)
{
    int rc;
    const size_t all = 3 * p->n_tiles;
    dmk_keyed *ids = NULL;
    DMK_TRY(DMK_NEW(ctx, ids, all));
    DMK_TRY(DMK_NEW(ctx, t->which, all));
    for (size_t i = 0; i < all; i++) {
        const dmk_tile *tile = &p->tile[i / 3];
        ids[i] = (dmk_keyed){(uint64_t)(edges ? tile->edge : tile->vertex)[i % 3], (int32_t)i};
    }
    DMK_TRY(dmk_sort_keyed(ctx, ids, all));
    for (size_t i = 0; i < all; i++) t->n += i == 0 || ids[i].key != ids[i - 1].key;
    DMK_TRY(DMK_NEW(ctx, t->list, t->n));
    t->n = 0;
    for (size_t i = 0; i < all; i++) {
        if (i == 0 || ids[i].key != ids[i - 1].key)
            t->list[t->n++] = (touch){(int64_t)ids[i].key, 3 * first + ids[i].item};
        t->which[ids[i].item] = (int32_t)t->n - 1;
    }
done:
    free(ids);
    return rc;
}

/* first[i]: the first place of item i that this rank looks after, counted from bound[rank], on any rank. */
static int find_first(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, items *t,
                      int64_t **first)
{
    int rc = DMK_OK;
    const int64_t begin = bound[ranks->rank], own = bound[ranks->rank + 1] - begin;
    t->asked.item = sizeof *t->list;
    for (size_t i = 0; i < t->n; i++)
        DMK_TRY(dmk_mail_add(ctx, &t->asked, dmk_owner(bound, ranks->size, t->list[i].item),
                             &t->list[i]));
    DMK_TRY(dmk_mail_send(ctx, ranks, &t->asked));
    DMK_TRY(DMK_NEW(ctx, *first, (size_t)own));
    for (int64_t i = 0; i < own; i++) (*first)[i] = INT64_MAX;
    const touch *came = (const void *)t->asked.data;
    for (size_t i = 0; i < t->asked.n; i++) {
        int64_t *at = &(*first)[came[i].item - begin];
        *at = came[i].place < *at ? came[i].place : *at;
    }
done:
    return rc;
}

/* What `own` has, from bound[rank] on, of each item: those who look after them tell. */
static int ask_items(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound, const items *t,
                     size_t item, const void *own, void *came)
{
    int rc;
    char *answers = NULL;
    const touch *asked = (const void *)t->asked.data;
    DMK_TRY(dmk_alloc(ctx, "items", t->asked.n, item, (void **)&answers));
    for (size_t i = 0; i < t->asked.n; i++) {
        memcpy(answers + item * i,
               (const char *)own + item * (size_t)(asked[i].item - bound[ranks->rank]), item);
    }
    rc = dmk_mail_answer(ctx, ranks, &t->asked, item, answers, came);
done:
    free(answers);
    return rc;
}

/* The items that are touched here first get the next numbers, in the order of their places: old[] has the input's, and
 * those who look after them are told. `first` becomes the number of each of theirs. */
static int give_numbers(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound,
                        const items *t, size_t places, int64_t first_place, int64_t *first,
                        int64_t *touched, int64_t **old)
{
    int rc;
    int64_t *where = NULL, count = 0;
    dmk_mail mail = {.item = sizeof *t->list};
    DMK_TRY(DMK_NEW(ctx, where, t->n));
    DMK_TRY(ask_items(ctx, ranks, bound, t, sizeof *where, first, where));
    for (size_t i = 0; i < t->n; i++) count += where[i] == t->list[i].place;
    DMK_TRY(dmk_ranks_bound(ctx, ranks, count, touched));
    DMK_TRY(DMK_NEW(ctx, *old, (size_t)count));
    count = 0;
    for (size_t i = 0; i < places; i++) {
        if (where[t->which[i]] != first_place + (int64_t)i) continue;
        const int64_t item = t->list[t->which[i]].item;
        const touch number = {item, touched[ranks->rank] + count};
        (*old)[count++] = item;
        DMK_TRY(dmk_mail_add(ctx, &mail, dmk_owner(bound, ranks->size, item), &number));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail));
    const touch *came = (const void *)mail.data;
    for (size_t i = 0; i < mail.n; i++) first[came[i].item - bound[ranks->rank]] = came[i].place;
done:
    free(where);
    dmk_mail_free(&mail);
    return rc;
}

/* Numbers of all tiles' vertices, or edges, in the order; touched: by rank those that it touches first, old their
 * numbers in the input. Of vertices the places in space, too. */
static int number_items(dmk_context *ctx, const dmk_pieces *p, bool edges, int64_t first_element,
                        int64_t **number, int64_t *touched, int64_t **old, double **xyz)
{
    int rc;
    const int64_t *bound = edges ? p->edge_bound : p->vertex_bound;
    items t = {.n = 0};
    int64_t *first = NULL, *each = NULL;
    double *at = NULL;
    DMK_TRY(list_items(ctx, p, edges, first_element, &t));
    DMK_TRY(find_first(ctx, &p->ranks, bound, &t, &first));
    DMK_TRY(give_numbers(ctx, &p->ranks, bound, &t, 3 * p->n_tiles, 3 * first_element, first,
                         touched, old));
    DMK_TRY(DMK_NEW(ctx, each, t.n));
    DMK_TRY(ask_items(ctx, &p->ranks, bound, &t, sizeof *each, first, each));
    DMK_TRY(DMK_NEW(ctx, *number, 3 * p->n_tiles));
    for (size_t i = 0; i < 3 * p->n_tiles; i++) (*number)[i] = each[t.which[i]];
    if (!xyz) goto done;
    DMK_TRY(DMK_NEW(ctx, at, 3 * t.n));
    DMK_TRY(ask_items(ctx, &p->ranks, bound, &t, 3 * sizeof *at, p->xyz, at));
    DMK_TRY(DMK_NEW(ctx, *xyz, 9 * p->n_tiles));
    for (size_t i = 0; i < 3 * p->n_tiles; i++)
        memcpy(*xyz + 3 * i, at + 3 * (size_t)t.which[i], 3 * sizeof *at);
done:
    items_free(&t);
    free(first);
    free(each);
    free(at);
    return rc;
}

/* What is touched by the ranks before a bound need not be what they own: old numbers to the owners. */
static int own_old(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *touched,
                   const int64_t *bound, int64_t **old)
{
    int rc = DMK_OK;
    dmk_mail mail = {.item = sizeof **old};
    for (int64_t i = touched[ranks->rank]; i < touched[ranks->rank + 1]; i++)
        DMK_TRY(dmk_mail_add(ctx, &mail, dmk_owner(bound, ranks->size, i),
                             &(*old)[i - touched[ranks->rank]]));
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail)); /* by rank, so by number */
    free(*old);
    *old = (void *)mail.data;
    mail.data = NULL;
done:
    dmk_mail_free(&mail);
    return rc;
}

static int number_kind(dmk_context *ctx, const dmk_pieces *p, bool edges, int32_t part,
                       dmk_plot *plot, int64_t **number, double **xyz)
{
    int rc;
    const int size = p->ranks.size;
    int64_t *touched = NULL, **bound = &plot->bound[edges ? 1 : 2],
            **old = edges ? &plot->edge_old : &plot->vertex_old;
    DMK_TRY(DMK_NEW(ctx, touched, (size_t)size + 1));
    DMK_TRY(number_items(ctx, p, edges, plot->bound[0][p->ranks.rank], number, touched, old, xyz));
    DMK_TRY(DMK_NEW(ctx, *bound, (size_t)size + 1));
    for (int r = 1; r <= size; r++)
        (*bound)[r] = dmk_bound_touched(part, touched[r], touched[size], r == size);
    rc = own_old(ctx, &p->ranks, touched, *bound, old);
done:
    free(touched);
    return rc;
}

/* ---- elements, and those around ------------------------------------------------------------------- */

/* An element in the numbers of the order, with its corners. */
typedef struct element {
    int64_t number, vertex[3], edge[3];
    double xyz[9];
} element;

/* Own elements to the others that own a corner or an edge of theirs. */
static int mail_element(dmk_context *ctx, const dmk_ranks *ranks, const dmk_plot *plot,
                        const element *e, dmk_mail *mail)
{
    int owner[6];
    for (int k = 0; k < 3; k++) {
        owner[k] = dmk_owner(plot->bound[2], ranks->size, e->vertex[k]);
        owner[3 + k] = dmk_owner(plot->bound[1], ranks->size, e->edge[k]);
    }
    return dmk_mail_add_to(ctx, mail, ranks->rank, 6, owner, e);
}

static int compare_elements(const void *a, const void *b)
{
    const element *x = a, *y = b;
    return (x->number > y->number) - (x->number < y->number);
}

/* Own elements, the first of which has the number `first`. */
typedef struct own_elements {
    size_t n;
    int64_t first;
    const int64_t *vertex, *edge;
    const double *xyz;
} own_elements;

static void put_element(const own_elements *own, size_t t, element *e)
{
    e->number = own->first + (int64_t)t;
    memcpy(e->vertex, own->vertex + 3 * t, sizeof e->vertex);
    memcpy(e->edge, own->edge + 3 * t, sizeof e->edge);
    memcpy(e->xyz, own->xyz + 9 * t, sizeof e->xyz);
}

/* Own ones, and others' at own edges and vertices, by their numbers. */
static int gather_elements(dmk_context *ctx, const dmk_ranks *ranks, const dmk_plot *plot,
                           const own_elements *own, element **list, size_t *n)
{
    int rc = DMK_OK;
    dmk_mail mail = {.item = sizeof **list};
    for (size_t t = 0; t < own->n; t++) {
        element e;
        put_element(own, t, &e);
        DMK_TRY(mail_element(ctx, ranks, plot, &e, &mail));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail));
    if (mail.n > 0) qsort(mail.data, mail.n, mail.item, compare_elements);
    *n = own->n + mail.n;
    DMK_TRY(DMK_NEW(ctx, *list, *n));
    const element *other = (const void *)mail.data;
    size_t before = 0;
    while (before < mail.n && other[before].number < own->first) before++;
    if (before > 0) memcpy(*list, other, before * sizeof *other);
    for (size_t t = 0; t < own->n; t++) put_element(own, t, *list + before + t);
    if (mail.n > before)
        memcpy(*list + before + own->n, other + before, (mail.n - before) * sizeof *other);
done:
    dmk_mail_free(&mail);
    return rc;
}

/* ---- the mesh here -------------------------------------------------------------------------------- */

static int64_t named(const element *list, bool edges, size_t i)
{
    return (edges ? list[i / 3].edge : list[i / 3].vertex)[i % 3];
}

/* Local numbers of what the elements name, in the order of the whole ones: own items, which are all here, and
 * others. */
static int number_here(dmk_context *ctx, size_t n, const element *list, bool edges,
                       const int64_t own[2], int64_t **number, int32_t *n_items, int32_t **of)
{
    int rc = DMK_OK;
    dmk_space here = {.first = own[0], .end = own[1]};
    dmk_list others = {0};
    for (size_t i = 0; i < 3 * n; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, &others, &here, named(list, edges, i)));
    dmk_list_sort(&others);
    DMK_TRY(dmk_space_create(ctx, others.n, others.at, 1, 0, &here));
    *n_items = here.n;
    DMK_TRY(DMK_NEW(ctx, *of, 3 * n));
    DMK_TRY(DMK_NEW(ctx, *number, (size_t)here.n));
    for (size_t i = 0; i < 3 * n; i++) (*of)[i] = dmk_space_slot(&here, named(list, edges, i));
    for (int32_t i = 0; i < here.n; i++) (*number)[i] = dmk_space_whole(&here, i);
done:
    dmk_space_free(&here);
    dmk_list_free(&others);
    return rc;
}

/* An edge's smaller end comes first, and the triangle that runs it from there; where only one is here it is first. */
static void put_edges(size_t n, const element *list, dmk_mesh *m)
{
    for (int32_t i = 0; i < 2 * m->n_edges; i++) m->edge_triangle[i] = -1;
    for (int32_t h = 0; h < 3 * (int32_t)n; h++) {
        const int32_t e = m->triangle_edge[h], a = m->triangle[dmk_next(h)],
                      b = m->triangle[dmk_previous(h)];
        const double *x = list[h / 3].xyz;
        m->edge_vertex[2 * e] = dmk_min_i(a, b);
        m->edge_vertex[2 * e + 1] = dmk_max_i(a, b);
        m->edge_triangle[2 * e + (a > b)] = h / 3;
        m->length[e] = dmk_distance(x + 3 * (dmk_next(h) % 3), x + 3 * (dmk_previous(h) % 3));
    }
    for (int32_t e = 0; e < m->n_edges; e++) {
        int32_t *t = m->edge_triangle + 2 * (size_t)e;
        if (t[0] >= 0) continue;
        t[0] = t[1];
        t[1] = -1;
    }
}

static void put_triangles(size_t n, const element *list, dmk_mesh *m)
{
    for (size_t t = 0; t < n; t++) {
        const int32_t *e = m->triangle_edge + 3 * t;
        const double l[3] = {m->length[e[0]], m->length[e[1]], m->length[e[2]]};
        double cot[3];
        dmk_measure_sides(l, &m->area[t], cot);
        for (size_t k = 0; k < 3; k++) {
            memcpy(m->xyz + 3 * (size_t)m->triangle[3 * t + k], list[t].xyz + 3 * k,
                   3 * sizeof *m->xyz);
        }
    }
}

/* Own vertices and edges: from own[0] to own[1] - 1 each. */
static int make_mesh(dmk_context *ctx, size_t n, const element *list, const int64_t vertices[2],
                     const int64_t edges[2], dmk_plot *plot)
{
    int rc;
    dmk_mesh *m = &plot->mesh;
    m->n_triangles = (int32_t)n;
    m->n_components = 1;
    DMK_TRY(DMK_NEW(ctx, plot->element, n));
    for (size_t t = 0; t < n; t++) plot->element[t] = list[t].number;
    DMK_TRY(
        number_here(ctx, n, list, false, vertices, &plot->vertex, &m->n_vertices, &m->triangle));
    DMK_TRY(number_here(ctx, n, list, true, edges, &plot->edge, &m->n_edges, &m->triangle_edge));
    DMK_TRY(DMK_NEW(ctx, m->xyz, 3 * (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, m->edge_vertex, 2 * (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, m->edge_triangle, 2 * (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, m->length, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, m->area, n));
    put_edges(n, list, m);
    put_triangles(n, list, m);
done:
    return rc;
}

/* ---- all together --------------------------------------------------------------------------------- */

static void add_areas(void *data, double *sum)
{
    const dmk_plot *plot = data;
    for (int32_t t = 0; t < plot->mesh.n_triangles; t++) {
        if (dmk_plot_owns(plot, t)) *sum += plot->mesh.area[t];
    }
}

int dmk_plot_add_areas(dmk_context *ctx, const dmk_ranks *ranks, dmk_plot *plot, double *area)
{
    *area = 0;
    return dmk_ranks_in_turn(ctx, ranks, area, add_areas, plot);
}

static int take_numbers(dmk_context *ctx, const dmk_pieces *p, dmk_plot *plot)
{
    int rc;
    plot->own[0] = plot->bound[0][p->ranks.rank];
    plot->own[1] = plot->bound[0][p->ranks.rank + 1];
    DMK_TRY(DMK_NEW(ctx, plot->element_old, p->n_tiles));
    for (size_t t = 0; t < p->n_tiles; t++) plot->element_old[t] = p->tile[t].number;
done:
    return rc;
}

int dmk_plot_create(dmk_context *ctx, dmk_pieces *p, int64_t triangle, int32_t part, dmk_plot *plot)
{
    int rc;
    int64_t *vertex = NULL, *edge = NULL;
    double *xyz = NULL;
    element *list = NULL;
    size_t n = 0;
    DMK_TRY(keep_component(ctx, p, triangle));
    DMK_TRY(ship_to_owners(ctx, p, part, plot));
    DMK_TRY(take_numbers(ctx, p, plot));
    DMK_TRY(number_kind(ctx, p, false, part, plot, &vertex, &xyz));
    DMK_TRY(number_kind(ctx, p, true, part, plot, &edge, NULL));
    DMK_TRY(dmk_poll(ctx));
    const own_elements own = {p->n_tiles, plot->own[0], vertex, edge, xyz};
    DMK_TRY(gather_elements(ctx, &p->ranks, plot, &own, &list, &n));
    free(vertex);
    free(edge);
    free(xyz);
    vertex = edge = NULL;
    xyz = NULL;
    free(p->tile);
    p->tile = NULL;
    p->n_tiles = 0;
    free(p->xyz);
    p->xyz = NULL;
    DMK_TRY(make_mesh(ctx, n, list, plot->bound[2] + p->ranks.rank, plot->bound[1] + p->ranks.rank,
                      plot));
    rc = dmk_plot_add_areas(ctx, &p->ranks, plot, &plot->area);
done:
    free(vertex);
    free(edge);
    free(xyz);
    free(list);
    if (rc != DMK_OK) dmk_plot_free(plot);
    return rc;
}

/* ---- a small one is whole after all --------------------------------------------------------------- */

/* Own elements from the mesh here. */
static int list_own(dmk_context *ctx, const dmk_plot *plot, element **list)
{
    int rc;
    const dmk_mesh *m = &plot->mesh;
    size_t n = 0;
    DMK_TRY(DMK_NEW(ctx, *list, (size_t)(plot->own[1] - plot->own[0])));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (!dmk_plot_owns(plot, t)) continue;
        element *e = &(*list)[n++];
        e->number = plot->element[t];
        for (size_t k = 0; k < 3; k++) {
            const int32_t v = m->triangle[3 * (size_t)t + k];
            e->vertex[k] = plot->vertex[v];
            e->edge[k] = plot->edge[m->triangle_edge[3 * (size_t)t + k]];
            memcpy(e->xyz + 3 * k, m->xyz + 3 * (size_t)v, 3 * sizeof *e->xyz);
        }
    }
done:
    return rc;
}

static int join_old(dmk_context *ctx, const dmk_ranks *ranks, const int64_t *bound,
                    const int64_t *own, int32_t **all)
{
    int rc;
    int64_t *wide = NULL;
    DMK_TRY(dmk_join_all(ctx, ranks, bound, sizeof *wide, own, (void **)&wide));
    DMK_TRY(DMK_NEW(ctx, *all, (size_t)bound[ranks->size]));
    for (int64_t i = 0; i < bound[ranks->size]; i++) (*all)[i] = (int32_t)wide[i];
done:
    free(wide);
    return rc;
}

int dmk_plot_unite(dmk_context *ctx, const dmk_ranks *ranks, dmk_plot *plot, dmk_order *o)
{
    int rc;
    element *own = NULL, *all = NULL;
    dmk_plot whole = {.area = 0};
    DMK_TRY(join_old(ctx, ranks, plot->bound[0], plot->element_old, &o->triangle_old));
    DMK_TRY(join_old(ctx, ranks, plot->bound[1], plot->edge_old, &o->edge_old));
    DMK_TRY(join_old(ctx, ranks, plot->bound[2], plot->vertex_old, &o->vertex_old));
    DMK_TRY(list_own(ctx, plot, &own));
    DMK_TRY(dmk_join_all(ctx, ranks, plot->bound[0], sizeof *own, own, (void **)&all));
    const size_t n = (size_t)plot->bound[0][ranks->size];
    const int64_t vertices[2] = {0, plot->bound[2][ranks->size]},
                  edges[2] = {0, plot->bound[1][ranks->size]};
    dmk_plot_free(plot);
    DMK_TRY(make_mesh(ctx, n, all, vertices, edges, &whole));
    DMK_TRY(DMK_NEW(ctx, o->mesh, 1));
    *o->mesh = whole.mesh;
    whole.mesh = (dmk_mesh){0};
    DMK_TRY(dmk_mesh_count(ctx, o->mesh));
    rc = dmk_mesh_describe(ctx, o->mesh, NULL);
done:
    free(own);
    free(all);
    dmk_plot_free(&whole);
    return rc;
}

dmk_ground dmk_plot_ground(const dmk_plot *plot)
{
    return (dmk_ground){.mesh = &plot->mesh,
                        .area = plot->area,
                        .element = plot->element,
                        .edge = plot->edge,
                        .vertex = plot->vertex,
                        .bound = {plot->bound[0], plot->bound[1], plot->bound[2]}};
}

void dmk_plot_free_mesh(dmk_plot *plot)
{
    dmk_mesh *m = &plot->mesh;
    free(m->xyz);
    free(m->triangle);
    free(m->triangle_edge);
    free(m->edge_vertex);
    free(m->edge_triangle);
    free(m->length);
    free(m->area);
    free(plot->element);
    free(plot->edge);
    free(plot->vertex);
    plot->element = plot->edge = plot->vertex = NULL;
    *m = (dmk_mesh){0};
}

void dmk_plot_free(dmk_plot *plot)
{
    dmk_plot_free_mesh(plot);
    for (int k = 0; k < 3; k++) free(plot->bound[k]);
    free(plot->element_old);
    free(plot->edge_old);
    free(plot->vertex_old);
    *plot = (dmk_plot){0};
}
