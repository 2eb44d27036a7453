/* Samples and cells of a level that is dealt out: those that one rank finds, from the same steps (levels/cells.c). */
#include "ranks/part.h"

#include "base/sort.h"

#include <stdlib.h>
#include <string.h>

/* Own vertices, those one and two links away, and the links of all but the latter. */
typedef struct surroundings {
    dmk_space space;
    dmk_adjacency g;        /* by slots */
    dmk_inquiry border;     /* ghosts by owner, and by rank the own vertices that are its ghosts; */
    int32_t *ghost, *shown; /* their slots */
} surroundings;

static void surroundings_free(surroundings *a)
{
    dmk_adjacency_free(&a->g);
    dmk_inquiry_free(&a->border);
    free(a->ghost);
    free(a->shown);
    free(a->space.ghost);
    memset(a, 0, sizeof *a);
}

static int32_t n_own(const dmk_side *side)
{
    return dmk_space_own(side->vertex);
}

/* The links of the vertices one link away. */
typedef struct ring {
    dmk_list vertex;
    int32_t *row;
    struct dmk_link *link;
} ring;

static void ring_free(ring *r)
{
    dmk_list_free(&r->vertex);
    free(r->row);
    free(r->link);
}

static int find_ring(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *side, ring *r)
{
    int rc = DMK_OK;
    for (int32_t i = 0; i < side->row[n_own(side)]; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, &r->vertex, side->vertex, side->link[i].to));
    dmk_list_sort(&r->vertex);
    rc = dmk_fetch_rows(ctx, ranks, side->vertex->bound, r->vertex.n, r->vertex.at,
                        sizeof *side->link, side->row, side->link, &r->row, (void **)&r->link);
done:
    return rc;
}

static int create_space(dmk_context *ctx, const dmk_side *side, const ring *r, dmk_space *space)
{
    int rc = DMK_OK;
    dmk_list all = {0};
    for (size_t i = 0; i < r->vertex.n; i++) DMK_TRY(dmk_list_add(ctx, &all, r->vertex.at[i]));
    for (int32_t i = 0; i < r->row[r->vertex.n]; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, &all, side->vertex, r->link[i].to));
    dmk_list_sort(&all);
    *space = *side->vertex;
    space->ghost = NULL;
    rc = dmk_space_create(ctx, all.n, all.at, 1, 0, space);
done:
    dmk_list_free(&all);
    return rc;
}

static void put_links(const dmk_space *s, int32_t n, const struct dmk_link *link, int32_t at,
                      dmk_adjacency *g)
{
    for (int32_t i = 0; i < n; i++) {
        g->to[at + i] = dmk_space_slot(s, link[i].to);
        g->length[at + i] = link[i].length;
    }
}

static int create_graph(dmk_context *ctx, const dmk_side *side, const ring *r, surroundings *a)
{
    int rc;
    const dmk_space *s = &a->space;
    dmk_adjacency *g = &a->g;
    const int32_t own = n_own(side);
    g->n = s->n;
    DMK_TRY(DMK_NEW(ctx, g->row, (size_t)s->n + 1));
    for (int32_t v = 0; v < own; v++) g->row[s->at_first + v + 1] = side->row[v + 1] - side->row[v];
    for (size_t k = 0; k < r->vertex.n; k++)
        g->row[dmk_space_slot(s, r->vertex.at[k]) + 1] = r->row[k + 1] - r->row[k];
    for (int32_t v = 0; v < s->n; v++) g->row[v + 1] += g->row[v];
    DMK_TRY(DMK_NEW(ctx, g->to, (size_t)g->row[s->n]));
    DMK_TRY(DMK_NEW(ctx, g->length, (size_t)g->row[s->n]));
    put_links(s, side->row[own], side->link, g->row[s->at_first], g);
    for (size_t k = 0; k < r->vertex.n; k++) {
        put_links(s, r->row[k + 1] - r->row[k], r->link + r->row[k],
                  g->row[dmk_space_slot(s, r->vertex.at[k])], g);
    }
    rc = dmk_cells_sort_hubs(ctx, g);
done:
    return rc;
}

/* Who has which own vertices among its ghosts. */
static int show_own(dmk_context *ctx, const dmk_ranks *ranks, surroundings *a)
{
    int rc;
    const dmk_space *s = &a->space;
    const size_t n = (size_t)s->n_ghosts;
    DMK_TRY(dmk_ask(ctx, ranks, s->bound, n, s->ghost, &a->border));
    const int64_t *shown = (const void *)a->border.mail.data;
    DMK_TRY(DMK_NEW(ctx, a->ghost, n));
    DMK_TRY(DMK_NEW(ctx, a->shown, a->border.mail.n));
    for (size_t i = 0; i < n; i++) a->ghost[i] = dmk_space_slot(s, s->ghost[i]);
    for (size_t i = 0; i < a->border.mail.n; i++) a->shown[i] = dmk_space_slot(s, shown[i]);
done:
    return rc;
}

static int surround(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *side, surroundings *a)
{
    int rc;
    ring r = {.row = NULL};
    DMK_TRY(find_ring(ctx, ranks, side, &r));
    DMK_TRY(create_space(ctx, side, &r, &a->space));
    DMK_TRY(create_graph(ctx, side, &r, a));
    rc = show_own(ctx, ranks, a);
done:
    ring_free(&r);
    return rc;
}

/* ---- samples ---------------------------------------------------------------------------------- */

/* What rank r has covered of later ranks' vertices goes to them. */
static int tell_covered(dmk_context *ctx, const dmk_ranks *ranks, const surroundings *a, int r,
                        uint8_t *covered)
{
    int rc;
    const bool tells = ranks->rank == r;
    int32_t *out = NULL, *in = NULL, at = 0, n = 0;
    uint8_t *sent = NULL, *came = NULL;
    DMK_TRY(DMK_NEW(ctx, out, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, in, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, sent, (size_t)a->space.n_ghosts));
    if (r < ranks->rank) in[r] = a->border.asks[r];
    DMK_TRY(DMK_NEW(ctx, came, (size_t)in[r]));
    for (int q = 0; q < ranks->size; at += a->border.asked[q++]) {
        if (!tells || q <= r) continue;
        out[q] = a->border.asked[q];
        for (int32_t i = 0; i < out[q]; i++) sent[n++] = covered[a->ghost[at + i]];
    }
    DMK_TRY(dmk_exchange(ctx, ranks, out, in, 1, sent, came));
    const int32_t *shown = a->shown + a->border.mail.first[r];
    for (int32_t i = 0; i < in[r]; i++) covered[shown[i]] |= came[i];
done:
    free(out);
    free(in);
    free(sent);
    free(came);
    return rc;
}

/* Rank after rank, as vertices become samples in their order. */
static int find_samples(dmk_context *ctx, const dmk_ranks *ranks, const surroundings *a,
                        dmk_grown *grown, int32_t *n)
{
    int rc;
    const int32_t first = a->space.at_first, end = first + dmk_space_own(&a->space);
    uint8_t *covered = NULL;
    DMK_TRY(DMK_NEW(ctx, covered, (size_t)a->space.n));
    DMK_TRY(DMK_NEW(ctx, grown->sample, (size_t)(end - first)));
    for (int r = 0; r < ranks->size; r++) {
        if (r == ranks->rank)
            DMK_TRY(dmk_cells_sample(ctx, &a->g, first, end, covered, grown->sample, n));
        DMK_TRY(tell_covered(ctx, ranks, a, r, covered));
    }
    for (int32_t k = 0; k < *n; k++) grown->sample[k] -= first;
done:
    free(covered);
    return rc;
}

/* ---- cells ------------------------------------------------------------------------------------ */

/* The own vertices' labels to the ranks that have them as ghosts. */
static int tell_labels(dmk_context *ctx, const dmk_ranks *ranks, const surroundings *a,
                       dmk_growth *w)
{
    int rc;
    const size_t n = a->border.mail.n;
    dmk_label *sent = NULL, *came = NULL;
    DMK_TRY(DMK_NEW(ctx, sent, n));
    DMK_TRY(DMK_NEW(ctx, came, (size_t)a->space.n_ghosts));
    for (size_t i = 0; i < n; i++) sent[i] = w->label[a->shown[i]];
    DMK_TRY(dmk_exchange(ctx, ranks, a->border.asks, a->border.asked, sizeof *sent, sent, came));
    for (int32_t i = 0; i < a->space.n_ghosts; i++) dmk_growth_set(w, a->ghost[i], came[i]);
done:
    free(sent);
    free(came);
    return rc;
}

static int grow(dmk_context *ctx, const dmk_ranks *ranks, const surroundings *a, int32_t n_cells,
                int64_t first_cell, dmk_grown *grown)
{
    int rc;
    const int32_t first = a->space.at_first, own = dmk_space_own(&a->space);
    dmk_growth w = {.round = 0};
    int32_t goes_on = 1;
    DMK_TRY(dmk_growth_begin(ctx, &a->g, &w));
    for (int32_t k = 0; k < n_cells; k++)
        dmk_growth_set(&w, first + grown->sample[k], (dmk_label){.cell = first_cell + k});
    for (;;) {
        DMK_TRY(tell_labels(ctx, ranks, a, &w));
        goes_on = !dmk_growth_ends(&w);
        DMK_TRY(dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &goes_on, 1)));
        if (!goes_on) break;
        dmk_growth_round(&w, first, first + own);
    }
    DMK_TRY(DMK_NEW(ctx, grown->cell, (size_t)own));
    for (int32_t v = 0; v < own; v++) grown->cell[v] = w.label[first + v].cell;
done:
    dmk_growth_end(&w);
    return rc;
}

int dmk_grow_cells(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                   dmk_space *coarse, dmk_grown *grown)
{
    int rc;
    int32_t n = 0;
    surroundings a = {.shown = NULL};
    DMK_TRY(surround(ctx, ranks, fine, &a));
    DMK_TRY(find_samples(ctx, ranks, &a, grown, &n));
    DMK_TRY(DMK_NEW(ctx, coarse->bound, (size_t)ranks->size + 1));
    DMK_TRY(dmk_ranks_bound(ctx, ranks, n, coarse->bound));
    dmk_space_set_own(ranks, coarse);
    if (!dmk_gains_nothing(coarse->n_whole, fine->vertex->n_whole))
        rc = grow(ctx, ranks, &a, n, coarse->first, grown);
done:
    surroundings_free(&a);
    return rc;
}

void dmk_grown_free(dmk_grown *grown)
{
    free(grown->cell);
    free(grown->sample);
    memset(grown, 0, sizeof *grown);
}

/* ---- the coarse side -------------------------------------------------------------------------- */

typedef struct pair {
    int64_t from, to;
} pair;

/* The cells of the own vertices' neighbours on other ranks. */
typedef struct outside {
    dmk_list vertex;
    int64_t *cell;
} outside;

static int find_outside(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                        const dmk_grown *grown, outside *o)
{
    int rc = DMK_OK;
    for (int32_t i = 0; i < fine->row[n_own(fine)]; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, &o->vertex, fine->vertex, fine->link[i].to));
    dmk_list_sort(&o->vertex);
    DMK_TRY(DMK_NEW(ctx, o->cell, o->vertex.n));
    rc = dmk_fetch(ctx, ranks, fine->vertex->bound, o->vertex.n, o->vertex.at, sizeof *o->cell,
                   grown->cell, o->cell);
done:
    return rc;
}

static int64_t cell_of(const dmk_side *fine, const dmk_grown *grown, const outside *o, int64_t v)
{
    if (dmk_space_owns(fine->vertex, v)) return grown->cell[v - fine->vertex->first];
    return o->cell[dmk_list_place(&o->vertex, v)];
}

/* Pairs of adjacent cells to the owner of the first: own links make each a few times, and two of them one after another
 * most often. */
static int mail_pairs(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                      const dmk_grown *grown, const dmk_space *cells, dmk_mail *mail)
{
    int rc;
    outside o = {.cell = NULL};
    pair last = {-1, -1};
    DMK_TRY(find_outside(ctx, ranks, fine, grown, &o));
    for (int32_t v = 0; v < n_own(fine); v++) {
        for (int32_t i = fine->row[v]; i < fine->row[v + 1]; i++) {
            const pair p = {grown->cell[v], cell_of(fine, grown, &o, fine->link[i].to)};
            if (p.from == p.to || (p.from == last.from && p.to == last.to)) continue;
            last = p;
            DMK_TRY(dmk_mail_add(ctx, mail, dmk_owner(cells->bound, ranks->size, p.from), &p));
        }
    }
    rc = dmk_mail_send(ctx, ranks, mail);
done:
    dmk_list_free(&o.vertex);
    free(o.cell);
    return rc;
}

/* In increasing order, each once; returns how many there are. Most often those are half a dozen. */
static int32_t sort_row(int32_t n, int64_t *to)
{
    int32_t kept = 0;
    const bool few = n <= 8 * DMK_SHORT_LIST;
    if (!few) qsort(to, (size_t)n, sizeof *to, dmk_compare_numbers);
    for (int32_t i = 0; i < n; i++) {
        const int64_t x = to[i];
        int32_t at = kept;
        while (at > 0 && to[at - 1] > x) at--;
        if (at > 0 && to[at - 1] == x) continue;
        memmove(to + at + 1, to + at, (size_t)(kept++ - at) * sizeof *to);
        to[at] = x;
    }
    return kept;
}

/* Neighbours by own cell, as often as they have come: row and *to. */
static int sort_pairs(dmk_context *ctx, const dmk_mail *mail, const dmk_space *cells, int32_t *row,
                      int64_t **to)
{
    int rc;
    const int32_t n = dmk_space_own(cells);
    const pair *p = (const void *)mail->data;
    int32_t *fill = NULL;
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, *to, mail->n));
    for (size_t i = 0; i < mail->n; i++) row[p[i].from - cells->first + 1]++;
    for (int32_t a = 0; a < n; a++) {
        fill[a] = row[a];
        row[a + 1] += row[a];
    }
    for (size_t i = 0; i < mail->n; i++) (*to)[fill[p[i].from - cells->first]++] = p[i].to;
done:
    free(fill);
    return rc;
}

static int link_cells(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                      const dmk_grown *grown, dmk_side *coarse)
{
    int rc;
    dmk_mail mail = {.item = sizeof(pair)};
    int64_t *to = NULL;
    int32_t n = 0;
    DMK_TRY(mail_pairs(ctx, ranks, fine, grown, coarse->vertex, &mail));
    DMK_TRY(DMK_NEW(ctx, coarse->row, (size_t)n_own(coarse) + 1));
    DMK_TRY(sort_pairs(ctx, &mail, coarse->vertex, coarse->row, &to));
    for (int32_t a = 0, begin = 0, end; a < n_own(coarse); a++, begin = end) {
        end = coarse->row[a + 1];
        const int32_t kept = sort_row(end - begin, to + begin);
        memmove(to + n, to + begin, (size_t)kept * sizeof *to);
        coarse->row[a + 1] = n += kept;
    }
    DMK_TRY(DMK_NEW(ctx, coarse->link, (size_t)n));
    for (int32_t i = 0; i < n; i++) coarse->link[i].to = to[i];
done:
    dmk_mail_free(&mail);
    free(to);
    return rc;
}

/* A fine vertex of a cell. */
typedef struct member {
    int64_t cell;
    double xyz[3];
} member;

static void add_member(const member *m, const dmk_space *cells, const int32_t *n, double *xyz)
{
    const int64_t a = m->cell - cells->first;
    for (int k = 0; k < 3; k++) xyz[3 * a + k] += m->xyz[k] / n[a];
}

static member member_of(const dmk_side *fine, const dmk_grown *grown, int32_t v)
{
    member m = {.cell = grown->cell[v]};
    memcpy(m.xyz, fine->xyz + 3 * (size_t)v, sizeof m.xyz);
    return m;
}

/* Means of the members' positions, summed up in their order, which is that of the ranks. */
static int place_cells(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                       const dmk_grown *grown, dmk_side *coarse)
{
    int rc = DMK_OK;
    const dmk_space *cells = coarse->vertex;
    dmk_mail mail = {.item = sizeof(member)};
    int32_t *n = NULL;
    for (int32_t v = 0; v < n_own(fine); v++) {
        const member m = member_of(fine, grown, v);
        if (!dmk_space_owns(cells, m.cell))
            DMK_TRY(dmk_mail_add(ctx, &mail, dmk_owner(cells->bound, ranks->size, m.cell), &m));
    }
    DMK_TRY(dmk_mail_send(ctx, ranks, &mail));
    DMK_TRY(DMK_NEW(ctx, n, (size_t)n_own(coarse)));
    DMK_TRY(DMK_NEW(ctx, coarse->xyz, 3 * (size_t)n_own(coarse)));
    const member *m = (const void *)mail.data;
    for (size_t i = 0; i < mail.n; i++) n[m[i].cell - cells->first]++;
    for (int32_t v = 0; v < n_own(fine); v++)
        if (dmk_space_owns(cells, grown->cell[v])) n[grown->cell[v] - cells->first]++;
    const size_t before = mail.first[ranks->rank];
    for (size_t i = 0; i < before; i++) add_member(&m[i], cells, n, coarse->xyz);
    for (int32_t v = 0; v < n_own(fine); v++) {
        const member own = member_of(fine, grown, v);
        if (dmk_space_owns(cells, own.cell)) add_member(&own, cells, n, coarse->xyz);
    }
    for (size_t i = before; i < mail.n; i++) add_member(&m[i], cells, n, coarse->xyz);
done:
    dmk_mail_free(&mail);
    free(n);
    return rc;
}

static int measure_links(dmk_context *ctx, const dmk_ranks *ranks, dmk_side *side)
{
    int rc = DMK_OK;
    dmk_list ghost = {0};
    double *xyz = NULL;
    for (int32_t i = 0; i < side->row[n_own(side)]; i++)
        DMK_TRY(dmk_list_add_ghost(ctx, &ghost, side->vertex, side->link[i].to));
    dmk_list_sort(&ghost);
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * ghost.n));
    DMK_TRY(dmk_fetch(ctx, ranks, side->vertex->bound, ghost.n, ghost.at, 3 * sizeof *xyz,
                      side->xyz, xyz));
    for (int32_t v = 0; v < n_own(side); v++) {
        for (int32_t i = side->row[v]; i < side->row[v + 1]; i++) {
            const int64_t w = side->link[i].to;
            const double *q = dmk_space_owns(side->vertex, w)
                                  ? side->xyz + 3 * (w - side->vertex->first)
                                  : xyz + 3 * (size_t)dmk_list_place(&ghost, w);
            side->link[i].length = dmk_link_length(side->xyz + 3 * (size_t)v, q);
        }
    }
done:
    dmk_list_free(&ghost);
    free(xyz);
    return rc;
}

int dmk_grow_side(dmk_context *ctx, const dmk_ranks *ranks, const dmk_side *fine,
                  const dmk_grown *grown, dmk_side *coarse)
{
    int rc;
    DMK_TRY(link_cells(ctx, ranks, fine, grown, coarse));
    DMK_TRY(place_cells(ctx, ranks, fine, grown, coarse));
    rc = measure_links(ctx, ranks, coarse);
done:
    return rc;
}
