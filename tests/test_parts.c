/* What ranks make of a mesh together against what one makes alone: the order, and the levels; and numbers that 32 bits
 * do not hold. */
#include "meeting.h"
#include "ranks/pieces.h"

#include "levels/coarsen.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { PART = 64, BELOW = 60 };

typedef struct task {
    const dmk_mesh *mesh; /* as given */
    const dmk_order *order;
    const dmk_hierarchy *hierarchy; /* of its mesh */
} task;

typedef struct seat {
    const task *t;
    member m;
    dmk_mesh_info info;
    dmk_plot plot;
    dmk_share share; /* its levels' bounds alone */
    dmk_parts parts;
    int rc;
    char message[300];
} seat;

static int plot_on(seat *s, dmk_context *ctx, const dmk_ranks *ranks)
{
    const dmk_mesh *m = s->t->mesh;
    const int r = ranks->rank, size = ranks->size;
    const int64_t v = dmk_even_bound(m->n_vertices, r, size),
                  t = dmk_even_bound(m->n_triangles, r, size),
                  end = dmk_even_bound(m->n_triangles, r + 1, size);
    dmk_pieces *pieces = NULL;
    int64_t *triangle = malloc((size_t)(3 * (end - t) + 1) * sizeof *triangle);
    if (!triangle) return DMK_E_NOMEM;
    for (int64_t i = 3 * t; i < 3 * end; i++) triangle[i - 3 * t] = m->triangle[i];
    int rc = dmk_pieces_create(ctx, ranks, m->n_vertices, m->xyz + 3 * v, m->n_triangles, triangle,
                               &pieces);
    free(triangle);
    dmk_pieces_get_info(pieces, &s->info);
    if (rc == DMK_OK) rc = dmk_plot_create(ctx, pieces, 0, PART, &s->plot);
    dmk_pieces_destroy(&pieces);
    return rc;
}

static int coarsen_on(seat *s, dmk_context *ctx, const dmk_ranks *ranks)
{
    int rc;
    dmk_space *space[3] = {&s->share.element, &s->share.edge, &s->share.vertex[0]};
    s->share.ranks = *ranks;
    for (int k = 0; k < 3; k++) {
        DMK_TRY(DMK_NEW(ctx, space[k]->bound, (size_t)ranks->size + 1));
        memcpy(space[k]->bound, s->plot.bound[k], ((size_t)ranks->size + 1) * sizeof(int64_t));
        space[k]->n_whole = space[k]->bound[ranks->size];
        space[k]->first = space[k]->bound[ranks->rank];
        space[k]->end = space[k]->bound[ranks->rank + 1];
    }
    const dmk_ground ground = dmk_plot_ground(&s->plot);
    rc = dmk_share_coarsen(ctx, &s->share, &ground, 10, &s->parts);
done:
    return rc;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    const dmk_ranks ranks = ranks_of(&s->m, BELOW);
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = plot_on(s, ctx, &ranks);
    if (s->rc == DMK_OK) s->rc = coarsen_on(s, ctx, &ranks);
    snprintf(s->message, sizeof s->message, "%s", dmk_context_message(ctx));
    dmk_context_destroy(&ctx);
    return NULL;
}

static void leave(seat *s)
{
    dmk_plot_free(&s->plot);
    dmk_parts_free(&s->parts);
    dmk_space_free(&s->share.element);
    dmk_space_free(&s->share.edge);
    for (int l = 0; l < DMK_SHARE_LEVELS; l++) {
        dmk_space_free(&s->share.vertex[l]);
        dmk_space_free(&s->share.level_edge[l]);
    }
}

/* ---- the order -------------------------------------------------------------------------------- */

static void same_order(const dmk_order *o, const seat *s)
{
    const dmk_plot *p = &s->plot;
    const dmk_mesh *m = &p->mesh, *whole = o->mesh;
    int64_t own = 0;
    assert_int_equal(p->bound[0][s->m.all->size], whole->n_triangles);
    assert_int_equal(p->bound[1][s->m.all->size], whole->n_edges);
    assert_int_equal(p->bound[2][s->m.all->size], whole->n_vertices);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        for (size_t k = 0; k < 3; k++) {
            const size_t at = 3 * (size_t)t + k, there = 3 * (size_t)p->element[t] + k;
            assert_int_equal(p->vertex[m->triangle[at]], whole->triangle[there]);
            assert_int_equal(p->edge[m->triangle_edge[at]], whole->triangle_edge[there]);
        }
        assert_true(m->area[t] == whole->area[p->element[t]]);
        own += dmk_plot_owns(p, t);
    }
    assert_int_equal(own, p->own[1] - p->own[0]);
    for (int32_t e = 0; e < m->n_edges; e++) {
        assert_true(m->length[e] == whole->length[p->edge[e]]);
        for (size_t k = 0; k < 2; k++)
            assert_int_equal(p->vertex[m->edge_vertex[2 * (size_t)e + k]],
                             whole->edge_vertex[2 * p->edge[e] + (int64_t)k]);
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        assert_memory_equal(m->xyz + 3 * (size_t)v, whole->xyz + 3 * p->vertex[v],
                            3 * sizeof(double));
    const int r = s->m.rank;
    for (int64_t i = p->bound[0][r]; i < p->bound[0][r + 1]; i++)
        assert_int_equal(p->element_old[i - p->bound[0][r]], o->triangle_old[i]);
    for (int64_t i = p->bound[1][r]; i < p->bound[1][r + 1]; i++)
        assert_int_equal(p->edge_old[i - p->bound[1][r]], o->edge_old[i]);
    for (int64_t i = p->bound[2][r]; i < p->bound[2][r + 1]; i++)
        assert_int_equal(p->vertex_old[i - p->bound[2][r]], o->vertex_old[i]);
}

/* ---- the levels ------------------------------------------------------------------------------- */

/* Numbers at own[] against those of the whole from `first` on. */
static void same_integers(const int64_t *own, int64_t n, const int32_t *whole, int64_t first)
{
    for (int64_t i = 0; i < n; i++) assert_int_equal(own[i], whole[first + i]);
}

static void same_floats(const float *own, int64_t n, const float *whole, int64_t first)
{
    assert_memory_equal(own, whole + first, (size_t)n * sizeof *own);
}

static void same_rows(const int32_t *own, int64_t n, const int32_t *whole, int64_t first)
{
    for (int64_t i = 0; i <= n; i++) assert_int_equal(own[i], whole[first + i] - whole[first]);
}

static void same_step(const dmk_coarsening *c, const seat *s, int32_t l)
{
    const int r = s->m.rank;
    const dmk_part *p = &s->parts.part[l];
    const int64_t *fine = s->share.vertex[l].bound + r, *coarse = s->share.vertex[l + 1].bound + r,
                  *edge = s->share.level_edge[l + 1].bound + r;
    assert_int_equal(s->share.vertex[l + 1].n_whole, c->coarse.n);
    assert_int_equal(s->share.level_edge[l + 1].n_whole, c->coarse.n_edges);
    same_integers(p->prolong_index, 3 * (fine[1] - fine[0]), c->prolong_index, 3 * fine[0]);
    same_floats(p->prolong_weight, 3 * (fine[1] - fine[0]), c->prolong_weight, 3 * fine[0]);
    same_rows(p->restrict_row, coarse[1] - coarse[0], c->restrict_row, coarse[0]);
    const int32_t *row = c->restrict_row;
    same_integers(p->restrict_fine, row[coarse[1]] - row[coarse[0]], c->restrict_fine,
                  row[coarse[0]]);
    same_floats(p->restrict_weight, row[coarse[1]] - row[coarse[0]], c->restrict_weight,
                row[coarse[0]]);
    same_integers(p->edge, 2 * (edge[1] - edge[0]), c->coarse.edge, 2 * edge[0]);
    same_rows(p->galerkin_row, edge[1] - edge[0], c->galerkin_row, edge[0]);
    row = c->galerkin_row;
    same_integers(p->galerkin_edge, row[edge[1]] - row[edge[0]], c->galerkin_edge, row[edge[0]]);
    same_floats(p->galerkin_coef, row[edge[1]] - row[edge[0]], c->galerkin_coef, row[edge[0]]);
    /* The edges at own vertices that others own. */
    int32_t n = 0;
    for (int64_t e = 0; e < c->coarse.n_edges; e++) {
        const int32_t *end = c->coarse.edge + 2 * e;
        if (e >= edge[0] && e < edge[1]) continue;
        if (end[1] < coarse[0] || end[1] >= coarse[1]) continue;
        assert_int_equal(p->other[3 * n], e);
        assert_int_equal(p->other[3 * n + 1], end[0]);
        assert_int_equal(p->other[3 * n++ + 2], end[1]);
    }
    assert_int_equal(p->n_others, n);
}

static void same_levels(const dmk_hierarchy *h, const seat *s)
{
    const dmk_hierarchy *rest = &s->parts.whole;
    const int32_t first = s->share.first_whole;
    assert_int_equal(rest->n, h->n);
    assert_true(first >= 2); /* else it is no test */
    for (int32_t l = 0; l < first; l++) same_step(&h->level[l], s, l);
    for (int32_t l = first; l < h->n; l++) {
        const dmk_coarsening *a = &h->level[l], *b = &rest->level[l];
        const size_t n = 3 * (size_t)h->level[l - 1].coarse.n;
        assert_int_equal(a->coarse.n, b->coarse.n);
        assert_memory_equal(a->prolong_index, b->prolong_index, n * sizeof *a->prolong_index);
        assert_memory_equal(a->prolong_weight, b->prolong_weight, n * sizeof *a->prolong_weight);
    }
}

/* The mesh goes. */
static void compare(dmk_context *ctx, dmk_mesh *mesh)
{
    dmk_order order;
    dmk_hierarchy hierarchy;
    assert_int_equal(dmk_order_create(ctx, mesh, 0, &order), DMK_OK);
    assert_int_equal(dmk_hierarchy_create(ctx, order.mesh, 10, &hierarchy), DMK_OK);
    const task t = {mesh, &order, &hierarchy};
    for (int size = 1; size <= MOST_RANKS; size++) {
        seat *seats = calloc((size_t)size, sizeof *seats);
        meeting all = {.size = size};
        assert_non_null(seats);
        for (int k = 0; k < size; k++) seats[k] = (seat){.t = &t, .m = {.all = &all, .rank = k}};
        assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
        for (int k = 0; k < size; k++) {
            if (seats[k].rc != DMK_OK) print_message("%s\n", seats[k].message);
            assert_int_equal(seats[k].rc, DMK_OK);
            assert_memory_equal(&seats[k].info, &mesh->info, sizeof mesh->info);
            same_order(&order, &seats[k]);
            same_levels(&hierarchy, &seats[k]);
            leave(&seats[k]);
        }
        free(seats);
    }
    dmk_hierarchy_free(&hierarchy);
    dmk_order_free(&order);
    dmk_mesh_destroy(&mesh);
}

/* A square of n x n vertices. With a wave: regular, so that as far is as near in many places. Thin: every other of its
 * columns is a millionth from the next one. Crumpled: neighbours in the mesh are far from each other in space, and
 * some cells get no weight. Holed: with two borders more. Large: lengths that differ, and most of which are beyond
 * what cells know of a length. */
enum { WAVE, THIN, CRUMPLED, HOLED, LARGE };
static dmk_mesh *square(dmk_context *ctx, int n, int kind)
{
    dmk_mesh *mesh = NULL;
    double *xyz = malloc(3 * (size_t)(n * n) * sizeof *xyz);
    int32_t *tri = malloc(6 * (size_t)(n * n) * sizeof *tri), m = 0;
    assert_true(xyz && tri);
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) {
            double *x = xyz + 3 * (i * n + k);
            x[0] = kind == CRUMPLED ? (i * 37 + k * 11) % 53 : i;
            x[1] = kind == CRUMPLED ? (i * 5 + k * 29) % 47 : k;
            x[2] = kind == CRUMPLED ? (i * i + 3 * k) % 31
                   : kind == WAVE   ? ((i + k) % 7) * 0.125
                                    : 0;
            if (kind == THIN && k % 2 == 1) x[1] = k - 1 + 1e-6;
            for (int j = 0; kind == LARGE && j < 2; j++) x[j] = 1e34 * (x[j] + 0.3 * sin(i * k));
        }
    }
    for (int i = 0; i + 1 < n; i++) {
        for (int k = 0; k + 1 < n; k++) {
            const int32_t c = i * n + k, six[6] = {c, c + n, c + n + 1, c, c + n + 1, c + 1};
            if (kind == HOLED && i % 30 == 20 && k > 20 && k < 40) continue;
            memcpy(tri + 6 * m++, six, sizeof six);
        }
    }
    assert_int_equal(dmk_mesh_create(ctx, (size_t)(n * n), xyz, 2 * (size_t)m, tri, &mesh), DMK_OK);
    free(xyz);
    free(tri);
    return mesh;
}

/* Two cones over one ring: a hub on some rank, of which the others need the row. */
static dmk_mesh *cones(dmk_context *ctx, int n)
{
    dmk_mesh *mesh = NULL;
    double *xyz = calloc(3 * (size_t)(n + 2), sizeof *xyz);
    int32_t *tri = malloc(6 * (size_t)n * sizeof *tri);
    assert_true(xyz && tri);
    for (int32_t i = 0; i < n; i++) {
        const int32_t j = (i + 1) % n, two[6] = {i, j, n, j, i, n + 1};
        xyz[3 * i] = cos(6.283185307179586 * i / n);
        xyz[3 * i + 1] = sin(6.283185307179586 * i / n);
        memcpy(tri + 6 * i, two, sizeof two);
    }
    xyz[3 * n + 2] = 1;
    xyz[3 * n + 5] = -1;
    assert_int_equal(dmk_mesh_create(ctx, (size_t)n + 2, xyz, 2 * (size_t)n, tri, &mesh), DMK_OK);
    free(xyz);
    free(tri);
    return mesh;
}

static dmk_mesh *body(dmk_context *ctx, const char *name, size_t n)
{
    dmk_mesh *mesh = NULL;
    dmk_surface_options options;
    dmk_surface_options_init(&options, sizeof options);
    options.name = name;
    options.n_triangles = n;
    assert_int_equal(dmk_mesh_surface(ctx, &options, &mesh), DMK_OK);
    return mesh;
}

static void test_levels(void **state)
{
    dmk_context *ctx = *state;
    compare(ctx, body(ctx, "quartic", 12000));
    compare(ctx, body(ctx, "torus", 7000));
    compare(ctx, square(ctx, 60, WAVE));
    compare(ctx, square(ctx, 60, THIN));
    compare(ctx, square(ctx, 60, CRUMPLED));
    compare(ctx, square(ctx, 60, HOLED));
    compare(ctx, square(ctx, 60, LARGE));
    compare(ctx, cones(ctx, 4000));
}

/* ---- numbers beyond 32 bits --------------------------------------------------------------------- */

#define FAR ((int64_t)5 << 32)

/* Ghosts before and behind, gaps in between. */
static void test_far_space(void **state)
{
    dmk_context *ctx = *state;
    const int64_t ghost[] = {3, FAR - 2, FAR + 100, 2 * FAR};
    dmk_space s = {.n_whole = 3 * FAR, .first = FAR, .end = FAR + 10};
    assert_int_equal(dmk_space_create(ctx, 4, ghost, 8, 1, &s), DMK_OK);
    assert_int_equal(s.at_first, 8);
    assert_int_equal(s.after, 24);
    assert_int_equal(s.n, 27);
    int found = 0;
    for (int32_t i = 0; i < s.n; i++) {
        const int64_t whole = dmk_space_whole(&s, i);
        if (whole < 0) continue;
        found++;
        assert_int_equal(dmk_space_slot(&s, whole), i);
        assert_true(dmk_space_owns(&s, whole) == (whole >= FAR && whole < FAR + 10));
    }
    assert_int_equal(found, 14);
    assert_int_equal(dmk_space_slot(&s, 4), -1);
    assert_int_equal(dmk_space_slot(&s, FAR + 10), -1);
    assert_int_equal(dmk_space_slot(&s, 3), 0);
    assert_int_equal(dmk_space_slot(&s, FAR + 3), 11); /* of which the low 32 bits are 3 */
    dmk_space_free(&s);
}

/* Each rank has 1000 numbers from FAR on, and asks for some of everybody's. */
static void *ask(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    const dmk_ranks ranks = ranks_of(&s->m, 0);
    int64_t bound[MOST_RANKS + 1], own[1000], wanted[200], got[200], n = 0;
    int32_t row[1001] = {0}, *rows = NULL;
    int64_t *entries = NULL;
    bound[0] = FAR;
    for (int r = 0; r < ranks.size; r++) bound[r + 1] = bound[r] + 1000;
    for (int64_t i = 0; i < 1000; i++) {
        own[i] = 7 * (bound[ranks.rank] + i);
        row[i + 1] = row[i] + (i % 5 == 0);
    }
    for (int64_t i = FAR + ranks.rank; i < bound[ranks.size]; i += 35) wanted[n++] = i;
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK)
        s->rc = dmk_fetch(ctx, &ranks, bound, (size_t)n, wanted, sizeof *own, own, got);
    for (int64_t i = 0; i < n && s->rc == DMK_OK; i++) s->rc = got[i] == 7 * wanted[i] ? DMK_OK : 1;
    if (s->rc == DMK_OK)
        s->rc = dmk_fetch_rows(ctx, &ranks, bound, (size_t)n, wanted, sizeof *own, row, own, &rows,
                               (void **)&entries);
    for (int64_t i = 0; i < n && s->rc == DMK_OK; i++) {
        const int64_t at = (wanted[i] - FAR) % 1000, rank = (wanted[i] - FAR) / 1000;
        const bool one = at % 5 == 0;
        if (rows[i + 1] - rows[i] != one) s->rc = 2;
        if (one && entries[rows[i]] != 7 * (bound[rank] + at / 5)) s->rc = 3;
    }
    free(rows);
    free(entries);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void test_far_fetch(void **state)
{
    (void)state;
    for (int size = 1; size <= MOST_RANKS; size++) {
        static seat seats[MOST_RANKS];
        meeting all = {.size = size};
        for (int k = 0; k < size; k++) seats[k] = (seat){.m = {.all = &all, .rank = k}};
        assert_int_equal(meet(&all, ask, seats, sizeof *seats), 0);
        for (int k = 0; k < size; k++) assert_int_equal(seats[k].rc, DMK_OK);
    }
}

static int make_context(void **state)
{
    return dmk_context_create((dmk_context **)state);
}

static int drop_context(void **state)
{
    dmk_context_destroy((dmk_context **)state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_levels),
        cmocka_unit_test(test_far_space),
        cmocka_unit_test(test_far_fetch),
    };
    return cmocka_run_group_tests_name("parts", tests, make_context, drop_context);
}
