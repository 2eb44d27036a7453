/* The edges of a mesh in pieces, and its components. For each vertex of the input one rank has all corners there: from
 * these it sees the vertex's star, and matches the half-edges of which it is the smaller end. */
#include "ranks/pieces.h"

#include "base/sets.h"
#include "base/sort.h"

#include <stdlib.h>
#include <string.h>

/* ---- failures --------------------------------------------------------------------------------- */

int dmk_fail_first(dmk_context *ctx, const dmk_ranks *ranks, int64_t key)
{
    int rc;
    int64_t *all = NULL;
    int first = 0;
    DMK_TRY(dmk_gather_each(ctx, ranks, sizeof key, &key, (void **)&all));
    for (int r = 1; r < ranks->size; r++) first = all[r] < all[first] ? r : first;
    if (all[first] == INT64_MAX) goto done;
    DMK_TRY(dmk_ranks_spread_from(ctx, ranks, first, ctx->message, sizeof ctx->message));
    rc = DMK_E_MESH;
done:
    free(all);
    return rc;
}

/* ---- corners by vertex ------------------------------------------------------------------------ */

/* A corner at `vertex`, of a triangle with the next and the previous one; half = 3 * triangle + k. */
typedef struct corner {
    int64_t vertex, next, previous, half;
} corner;

/* The half-edge from or to the vertex. */
typedef struct spoke {
    int64_t other, opposite, half;
    int32_t corner; /* 2 * corner, + 1 for the edge to the previous vertex, which runs here */
} spoke;

/* What the sender of a corner learns: the edges to the next and the previous vertex, of which this is the smaller
 * end. */
typedef struct pair {
    int64_t edge[2];
} pair;

/* The corners at own vertices. */
typedef struct stars {
    dmk_pieces *p;
    const corner *corner; /* as they have come */
    size_t n;
    dmk_keyed *order; /* by vertex */
    pair *pair;       /* for each corner, edges counted from the first one here */
    int64_t n_edges, n_border, n_used;
    spoke *spoke; /* of the vertex at hand, by other ends */
    size_t n_spokes, room;
    int64_t *border; /* the ends of each of n_border edges */
    size_t border_room;
} stars;

/* Each to the rank that looks after its vertex. */
static int mail_corners(dmk_context *ctx, const dmk_pieces *p, dmk_mail *mail)
{
    int rc;
    const size_t n = 3 * p->n_tiles;
    const int size = p->ranks.size;
    int32_t *count = NULL;
    corner *list = NULL, **at = NULL;
    DMK_TRY(DMK_NEW(ctx, count, (size_t)size));
    DMK_TRY(DMK_NEW(ctx, at, (size_t)size));
    DMK_TRY(DMK_NEW(ctx, list, n));
    for (size_t i = 0; i < n; i++)
        count[dmk_owner(p->vertex_bound, size, p->tile[i / 3].vertex[i % 3])]++;
    for (int r = 0; r < size; r++) at[r] = r == 0 ? list : at[r - 1] + count[r - 1];
    for (size_t i = 0; i < n; i++) {
        const int64_t *v = p->tile[i / 3].vertex;
        const size_t k = i % 3;
        *at[dmk_owner(p->vertex_bound, size, v[k])]++ =
            (corner){v[k], v[(k + 1) % 3], v[(k + 2) % 3], 3 * p->tile[i / 3].number + (int64_t)k};
    }
    mail->data = (void *)list;
    list = NULL;
    rc = dmk_mail_pass(ctx, &p->ranks, mail, count);
done:
    free(count);
    free(at);
    free(list);
    return rc;
}

static int compare_spokes(const void *a, const void *b)
{
    const spoke *x = a, *y = b;
    if (x->other != y->other) return x->other < y->other ? -1 : 1;
    if (x->opposite != y->opposite) return x->opposite < y->opposite ? -1 : 1;
    return (x->half > y->half) - (x->half < y->half);
}

/* Most often there are a dozen. */
static void sort_spokes(size_t n, spoke *s)
{
    if (n > DMK_SHORT_LIST) {
        qsort(s, n, sizeof *s, compare_spokes);
        return;
    }
    for (size_t i = 1; i < n; i++) {
        const spoke x = s[i];
        size_t k = i;
        for (; k > 0 && compare_spokes(&s[k - 1], &x) > 0; k--) s[k] = s[k - 1];
        s[k] = x;
    }
}

/* The spokes of the vertex whose corners are order[begin .. end - 1]. */
static int list_spokes(dmk_context *ctx, stars *s, size_t begin, size_t end)
{
    int rc;
    DMK_TRY(DMK_GROW(ctx, s->spoke, 2 * (end - begin), s->room));
    s->n_spokes = 0;
    for (size_t i = begin; i < end; i++) {
        const int32_t k = s->order[i].item;
        const corner *c = &s->corner[k];
        const int64_t t = c->half / 3, at = c->half % 3;
        s->spoke[s->n_spokes++] = (spoke){c->next, c->previous, 3 * t + (at + 2) % 3, 2 * k};
        s->spoke[s->n_spokes++] = (spoke){c->previous, c->next, 3 * t + (at + 1) % 3, 2 * k + 1};
    }
    sort_spokes(s->n_spokes, s->spoke);
done:
    return rc;
}

static size_t end_of_vertex(const stars *s, size_t begin)
{
    size_t end = begin;
    while (end < s->n && s->order[end].key == s->order[begin].key) end++;
    return end;
}

static size_t end_of_edge(const stars *s, size_t begin)
{
    size_t end = begin;
    while (end < s->n_spokes && s->spoke[end].other == s->spoke[begin].other) end++;
    return end;
}

/* ---- what is wrong with edges ----------------------------------------------------------------- */

/* The first of each kind here. */
typedef struct slips {
    int64_t duplicate, third, turned, pillow; /* the smaller end, or INT64_MAX */
    spoke at[4][3];
    bool clash;
} slips;

static bool runs_up(const spoke *s)
{
    return s->corner % 2 == 0;
}

static void note(int64_t *key, spoke at[3], int64_t v, size_t n, const spoke *s)
{
    if (*key != INT64_MAX) return;
    *key = v;
    memcpy(at, s, n * sizeof *s);
}

/* Spokes begin .. end - 1 are one edge. */
static void look_at_edge(const stars *s, int64_t v, size_t begin, size_t end, slips *f)
{
    const spoke *e = s->spoke + begin;
    const size_t n = end - begin;
    const bool turned = n == 2 && runs_up(&e[0]) == runs_up(&e[1]);
    if (n > 2 || turned) f->clash = true;
    for (size_t i = 1; i < n; i++) {
        if (e[i - 1].opposite != e[i].opposite) continue;
        note(&f->duplicate, f->at[0], v, 2, &e[i - 1]);
        if (n == 2 && !turned) note(&f->pillow, f->at[3], v, 2, &e[i - 1]);
    }
    if (n > 2) note(&f->third, f->at[1], v, 3, e);
    if (turned) note(&f->turned, f->at[2], v, 2, e);
}

static long long triangle_of(const spoke *s)
{
    return (long long)(s->half / 3);
}

static int64_t tell_duplicate(dmk_context *ctx, const slips *f, int64_t v, int kind)
{
    const spoke *s = f->at[kind];
    const long long a = triangle_of(&s[0]), b = triangle_of(&s[1]);
    if (v == INT64_MAX) return v;
    dmk_fail(ctx, DMK_E_MESH,
             "triangles %lld and %lld are duplicates%s: both have the vertices %lld %lld %lld; "
             "remove one of them, as a repair does%s",
             a < b ? a : b, a < b ? b : a, kind == 3 ? ", back to back" : "", (long long)v,
             (long long)s[0].other, (long long)s[0].opposite, kind == 3 ? ", or both" : "");
    return v;
}

static int64_t tell_third(dmk_context *ctx, const slips *f)
{
    const spoke *s = f->at[1];
    if (f->third != INT64_MAX) {
        dmk_fail(ctx, DMK_E_MESH,
                 "non-manifold edge %lld-%lld: triangles %lld, %lld and %lld share it; remove or "
                 "separate the extra sheets, as a repair does",
                 (long long)f->third, (long long)s[0].other, triangle_of(&s[0]), triangle_of(&s[1]),
                 triangle_of(&s[2]));
    }
    return f->third;
}

static int64_t tell_turned(dmk_context *ctx, const slips *f)
{
    const spoke *s = f->at[2];
    if (f->turned != INT64_MAX) {
        dmk_fail(ctx, DMK_E_MESH,
                 "inconsistent orientation: triangles %lld and %lld run edge %lld-%lld in the same "
                 "direction; turning triangles over, as a repair does, makes all agree, unless the "
                 "surface has one side only",
                 triangle_of(&s[0]), triangle_of(&s[1]), (long long)f->turned,
                 (long long)s[0].other);
    }
    return f->turned;
}

static int explain(dmk_context *ctx, const dmk_ranks *ranks, const slips *f)
{
    int rc;
    int32_t clash = f->clash;
    DMK_TRY(dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &clash, 1)));
    if (!clash) return dmk_fail_first(ctx, ranks, tell_duplicate(ctx, f, f->pillow, 3));
    DMK_TRY(dmk_fail_first(ctx, ranks, tell_duplicate(ctx, f, f->duplicate, 0)));
    DMK_TRY(dmk_fail_first(ctx, ranks, tell_third(ctx, f)));
    rc = dmk_fail_first(ctx, ranks, tell_turned(ctx, f));
done:
    return rc;
}

/* ---- edges ------------------------------------------------------------------------------------ */

/* An edge of a vertex: its first half-edge, and where its spokes begin. */
typedef struct rung {
    int64_t half;
    size_t begin, end;
} rung;

static int compare_rungs(const void *a, const void *b)
{
    const rung *x = a, *y = b;
    return (x->half > y->half) - (x->half < y->half);
}

static void sort_rungs(size_t n, rung *r)
{
    if (n > DMK_SHORT_LIST) {
        qsort(r, n, sizeof *r, compare_rungs);
        return;
    }
    for (size_t i = 1; i < n; i++) {
        const rung x = r[i];
        size_t k = i;
        for (; k > 0 && r[k - 1].half > x.half; k--) r[k] = r[k - 1];
        r[k] = x;
    }
}

static int note_border(dmk_context *ctx, stars *s, int64_t v, int64_t other)
{
    int rc;
    DMK_TRY(DMK_GROW(ctx, s->border, 2 * (size_t)s->n_border + 2, s->border_room));
    s->border[2 * s->n_border] = v;
    s->border[2 * s->n_border++ + 1] = other;
done:
    return rc;
}

/* Edges of which v is the smaller end, numbered by their first half-edges. */
static int number_edges(dmk_context *ctx, stars *s, int64_t v, slips *f)
{
    int rc = DMK_OK;
    rung few[DMK_SHORT_LIST], *list = few, *more = NULL;
    size_t n = 0;
    if (s->n_spokes > DMK_SHORT_LIST) DMK_TRY(DMK_NEW(ctx, more, s->n_spokes));
    if (more) list = more;
    for (size_t i = 0, end; i < s->n_spokes; i = end) {
        end = end_of_edge(s, i);
        if (s->spoke[i].other < v) continue;
        look_at_edge(s, v, i, end, f);
        rung r = {s->spoke[i].half, i, end};
        for (size_t k = i; k < end; k++)
            r.half = r.half < s->spoke[k].half ? r.half : s->spoke[k].half;
        list[n++] = r;
    }
    sort_rungs(n, list);
    for (size_t i = 0; i < n; i++, s->n_edges++) {
        if (list[i].end - list[i].begin == 1)
            DMK_TRY(note_border(ctx, s, v, s->spoke[list[i].begin].other));
        for (size_t k = list[i].begin; k < list[i].end; k++)
            s->pair[s->spoke[k].corner / 2].edge[s->spoke[k].corner % 2] = s->n_edges;
    }
done:
    free(more);
    return rc;
}

/* ---- stars ------------------------------------------------------------------------------------ */

/* The corner whose next vertex is `other`, or -1. */
static int32_t corner_from(const stars *s, int64_t other)
{
    size_t begin = 0, end = s->n_spokes;
    while (begin < end) {
        const size_t middle = begin + (end - begin) / 2;
        if (s->spoke[middle].other < other)
            begin = middle + 1;
        else
            end = middle;
    }
    for (; begin < s->n_spokes && s->spoke[begin].other == other; begin++) {
        if (runs_up(&s->spoke[begin])) return s->spoke[begin].corner / 2;
    }
    return -1;
}

/* A corner before which there is none, or the first one. */
static int32_t first_corner(const stars *s)
{
    int32_t first = s->spoke[0].corner / 2;
    for (size_t i = 0, end; i < s->n_spokes; i = end) {
        end = end_of_edge(s, i);
        if (end - i == 1 && runs_up(&s->spoke[i])) return s->spoke[i].corner / 2;
        const int32_t c = s->spoke[i].corner / 2;
        if (s->corner[c].half < s->corner[first].half) first = c;
    }
    return first;
}

/* Whether not all corners of the vertex follow each other over edges. Where edges clash that means nothing. */
static bool star_is_split(const stars *s, size_t n)
{
    const int32_t first = first_corner(s);
    size_t seen = 0;
    int32_t c = first;
    do {
        seen++;
        c = corner_from(s, s->corner[c].previous);
    } while (c >= 0 && c != first && seen <= n);
    return seen != n;
}

/* One triangle of the part of the star that is walked over, and one outside of it. */
static int64_t tell_split(dmk_context *ctx, const stars *s, size_t begin, size_t end)
{
    const int64_t v = (int64_t)s->order[begin].key;
    const int32_t first = first_corner(s);
    int64_t outside = INT64_MAX;
    int32_t c = first;
    do { /* the edges' numbers are not wanted any more */
        s->pair[c].edge[0] = INT64_MIN;
        c = corner_from(s, s->corner[c].previous);
    } while (c >= 0 && c != first);
    for (size_t i = begin; i < end; i++) {
        const int32_t k = s->order[i].item;
        if (s->pair[k].edge[0] != INT64_MIN && s->corner[k].half / 3 < outside)
            outside = s->corner[k].half / 3;
    }
    const int64_t t = s->corner[first].half / 3;
    dmk_fail(ctx, DMK_E_MESH,
             "non-manifold vertex %lld: triangles %lld and %lld meet there, but not through "
             "shared edges; give each part of the surface its own copy of the vertex, as a repair "
             "does",
             (long long)v, (long long)(t < outside ? t : outside),
             (long long)(t < outside ? outside : t));
    return v;
}

static int make_edges(dmk_context *ctx, stars *s)
{
    int rc = DMK_OK;
    size_t split = SIZE_MAX;
    slips f = {
        .duplicate = INT64_MAX, .third = INT64_MAX, .turned = INT64_MAX, .pillow = INT64_MAX};
    for (size_t i = 0, end; i < s->n; i = end) {
        end = end_of_vertex(s, i);
        DMK_TRY(list_spokes(ctx, s, i, end));
        DMK_TRY(number_edges(ctx, s, (int64_t)s->order[i].key, &f));
        if (split == SIZE_MAX && star_is_split(s, end - i)) split = i;
        s->n_used++;
    }
    DMK_TRY(explain(ctx, &s->p->ranks, &f));
    int64_t key = INT64_MAX;
    if (split != SIZE_MAX) {
        const size_t end = end_of_vertex(s, split);
        DMK_TRY(list_spokes(ctx, s, split, end));
        key = tell_split(ctx, s, split, end);
    }
    rc = dmk_fail_first(ctx, &s->p->ranks, key);
done:
    return rc;
}

/* ---- all together ----------------------------------------------------------------------------- */

/* The numbers come back to the tiles in the order in which these have sent their corners. */
static int take_edges(dmk_context *ctx, dmk_pieces *p, const pair *came)
{
    int rc;
    size_t *at = NULL;
    const size_t size = (size_t)p->ranks.size;
    DMK_TRY(DMK_NEW(ctx, at, size + 1));
    for (size_t i = 0; i < 3 * p->n_tiles; i++)
        at[dmk_owner(p->vertex_bound, p->ranks.size, p->tile[i / 3].vertex[i % 3]) + 1]++;
    for (size_t r = 0; r < size; r++) at[r + 1] += at[r];
    for (size_t t = 0; t < p->n_tiles; t++) {
        for (int k = 0; k < 3; k++) {
            const pair *one =
                &came[at[dmk_owner(p->vertex_bound, p->ranks.size, p->tile[t].vertex[k])]++];
            if (one->edge[0] >= 0) p->tile[t].edge[(k + 2) % 3] = one->edge[0];
            if (one->edge[1] >= 0) p->tile[t].edge[(k + 1) % 3] = one->edge[1];
        }
    }
done:
    free(at);
    return rc;
}

/* Counts of all ranks. */
static int add_counts(dmk_context *ctx, const stars *s, int64_t *first_edge)
{
    int rc;
    dmk_pieces *p = s->p;
    const int size = p->ranks.size;
    int64_t *bound = NULL;
    DMK_TRY(DMK_NEW(ctx, bound, (size_t)size + 1));
    DMK_TRY(dmk_ranks_bound(ctx, &p->ranks, s->n_used, bound));
    p->n_used = bound[size];
    DMK_TRY(dmk_ranks_bound(ctx, &p->ranks, s->n_border, bound));
    p->n_border_edges = bound[size];
    DMK_TRY(dmk_ranks_bound(ctx, &p->ranks, s->n_edges, bound));
    p->n_edges = bound[size];
    *first_edge = bound[p->ranks.rank];
    DMK_TRY(DMK_NEW(ctx, p->edge_bound, (size_t)size + 1));
    for (int r = 0; r <= size; r++) p->edge_bound[r] = dmk_even_bound(p->n_edges, r, size);
done:
    free(bound);
    return rc;
}

int dmk_pieces_connect(dmk_context *ctx, dmk_pieces *p)
{
    int rc;
    dmk_mail mail = {.item = sizeof(corner)};
    stars s = {.p = p};
    pair *came = NULL;
    int64_t first = 0;
    DMK_TRY(mail_corners(ctx, p, &mail));
    s.corner = (const void *)mail.data;
    s.n = mail.n;
    DMK_TRY(DMK_NEW(ctx, s.order, s.n));
    DMK_TRY(DMK_NEW(ctx, s.pair, s.n));
    for (size_t i = 0; i < s.n; i++) {
        s.order[i] = (dmk_keyed){(uint64_t)s.corner[i].vertex, (int32_t)i};
        s.pair[i] = (pair){{-1, -1}};
    }
    DMK_TRY(dmk_sort_keyed(ctx, s.order, s.n));
    DMK_TRY(make_edges(ctx, &s));
    DMK_TRY(add_counts(ctx, &s, &first));
    DMK_TRY(dmk_pieces_count_loops(ctx, p, (size_t)s.n_border, s.border));
    for (size_t i = 0; i < 2 * s.n; i++) {
        if (s.pair[i / 2].edge[i % 2] >= 0) s.pair[i / 2].edge[i % 2] += first;
    }
    DMK_TRY(DMK_NEW(ctx, came, 3 * p->n_tiles));
    DMK_TRY(dmk_mail_answer(ctx, &p->ranks, &mail, sizeof *came, s.pair, came));
    rc = take_edges(ctx, p, came);
done:
    dmk_mail_free(&mail);
    free(s.order);
    free(s.pair);
    free(s.spoke);
    free(s.border);
    free(came);
    return rc;
}

/* ---- components ------------------------------------------------------------------------------- */

/* Own vertices, each once, and a forest over them. */
typedef struct forest {
    dmk_list vertex;
    int32_t *corner, *parent;
} forest;

static int grow_forest(dmk_context *ctx, const dmk_pieces *p, forest *f)
{
    int rc;
    dmk_keyed *ids = NULL;
    const size_t n = 3 * p->n_tiles;
    DMK_TRY(DMK_NEW(ctx, ids, n));
    DMK_TRY(DMK_NEW(ctx, f->corner, n));
    for (size_t i = 0; i < n; i++)
        ids[i] = (dmk_keyed){(uint64_t)p->tile[i / 3].vertex[i % 3], (int32_t)i};
    DMK_TRY(dmk_sort_keyed(ctx, ids, n));
    for (size_t i = 0; i < n; i++) {
        DMK_TRY(dmk_list_add(ctx, &f->vertex, (int64_t)ids[i].key));
        f->corner[ids[i].item] = (int32_t)f->vertex.n - 1;
    }
    DMK_TRY(DMK_NEW(ctx, f->parent, f->vertex.n));
    for (size_t v = 0; v < f->vertex.n; v++) f->parent[v] = (int32_t)v;
    for (size_t t = 0; t < p->n_tiles; t++) {
        dmk_set_unite(f->parent, f->corner[3 * t], f->corner[3 * t + 1]);
        dmk_set_unite(f->parent, f->corner[3 * t], f->corner[3 * t + 2]);
    }
done:
    free(ids);
    return rc;
}

/* A vertex and a set of some rank that it is in, by the number of a vertex of the set. */
typedef struct tie {
    int64_t vertex, set;
} tie;

static int compare_ties(const void *a, const void *b)
{
    const tie *x = a, *y = b;
    if (x->vertex != y->vertex) return x->vertex < y->vertex ? -1 : 1;
    return (x->set > y->set) - (x->set < y->set);
}

/* Of the ranks' sets those that are one, as they share a vertex; and each rank's own ones. */
static int find_ties(dmk_context *ctx, const dmk_pieces *p, forest *f, dmk_list *sets, tie **ties,
                     size_t *n)
{
    int rc = DMK_OK;
    dmk_mail mail = {.item = sizeof(tie)};
    size_t room = 0;
    for (size_t v = 0; v < f->vertex.n; v++) {
        const tie t = {f->vertex.at[v], f->vertex.at[dmk_set_find(f->parent, (int32_t)v)]};
        DMK_TRY(dmk_list_add(ctx, sets, t.set));
        DMK_TRY(dmk_mail_add(ctx, &mail, dmk_owner(p->vertex_bound, p->ranks.size, t.vertex), &t));
    }
    dmk_list_sort(sets);
    DMK_TRY(dmk_mail_send(ctx, &p->ranks, &mail));
    tie *t = (void *)mail.data;
    if (mail.n > 0) qsort(t, mail.n, sizeof *t, compare_ties);
    for (size_t i = 1; i < mail.n; i++) {
        if (t[i].vertex != t[i - 1].vertex || t[i].set == t[i - 1].set) continue;
        DMK_TRY(DMK_GROW(ctx, *ties, *n + 1, room));
        (*ties)[(*n)++] = (tie){t[i - 1].set, t[i].set};
    }
    if (*n > 0) qsort(*ties, *n, sizeof **ties, compare_ties);
    size_t kept = 0;
    for (size_t i = 0; i < *n; i++) {
        if (kept == 0 || compare_ties(&(*ties)[kept - 1], &(*ties)[i]) != 0)
            (*ties)[kept++] = (*ties)[i];
    }
    *n = kept;
done:
    dmk_mail_free(&mail);
    return rc;
}

int dmk_pieces_find_components(dmk_context *ctx, dmk_pieces *p)
{
    int rc;
    forest f = {.corner = NULL};
    dmk_list sets = {0}, all = {0};
    tie *own = NULL;
    int64_t *ties = NULL; /* two numbers each */
    size_t n_own = 0, n = 0;
    int32_t *parent = NULL;
    DMK_TRY(grow_forest(ctx, p, &f));
    DMK_TRY(find_ties(ctx, p, &f, &sets, &own, &n_own));
    DMK_TRY(
        dmk_join_some(ctx, &p->ranks, sets.n, sizeof *sets.at, sets.at, &all.n, (void **)&all.at));
    DMK_TRY(dmk_join_some(ctx, &p->ranks, n_own, sizeof *own, own, &n, (void **)&ties));
    dmk_list_sort(&all);
    DMK_TRY(dmk_list_unite(ctx, &all, n, ties, &parent, &p->n_components));
    if (p->n_components < 2) goto done;
    DMK_TRY(DMK_NEW(ctx, p->component, p->n_tiles));
    for (size_t t = 0; t < p->n_tiles; t++) {
        const int64_t set = f.vertex.at[dmk_set_find(f.parent, f.corner[3 * t])];
        p->component[t] = all.at[dmk_set_find(parent, dmk_list_place(&all, set))];
    }
done:
    dmk_list_free(&f.vertex);
    free(f.corner);
    free(f.parent);
    dmk_list_free(&sets);
    dmk_list_free(&all);
    free(own);
    free(ties);
    free(parent);
    return rc;
}
