/* The cotree by itself: jumps and crossings where they are known, and what leaves hand on along a tree made by hand. */
#include "../src/geodesic/meeting.c" /* for their static functions; the library's own are then left out */
#include "../src/locus/cotree.c"
#include "../src/locus/places.c"
#include "../src/locus/strength.c"

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* ---- a flat torus -------------------------------------------------------------------------------- */

enum { N = 14, N_RINGS = 20 };
static const double width = 1.4, height = 2;

/* Where vertex v lies on the sheet, as seen from the source at (x, y). */
static void unfold(int32_t v, const double source[2], double at[2])
{
    at[0] = remainder(width * (v % N) / N - source[0], width);
    at[1] = remainder(height * (v / N) / N_RINGS - source[1], height);
}

/* A sheet whose opposite sides are one, folded flat in four along lines of the mesh. */
static dmk_mesh *make_torus(dmk_context *ctx)
{
    static double xyz[3 * N * N_RINGS];
    static int32_t triangle[6 * N * N_RINGS];
    dmk_mesh *m;
    const double zero[2] = {0, 0};
    for (int32_t v = 0; v < N * N_RINGS; v++) {
        double at[2];
        unfold(v, zero, at);
        xyz[3 * v] = fabs(at[0]), xyz[3 * v + 1] = fabs(at[1]);
        const int32_t next = v / N * N + (v + 1) % N, up = (v + N) % (N * N_RINGS),
                      both = (next + N) % (N * N_RINGS);
        memcpy(triangle + 6 * v, (int32_t[]){v, next, both, v, both, up}, 6 * sizeof *triangle);
    }
    const int rc = dmk_mesh_create(ctx, N * N_RINGS, xyz, 2 * N * N_RINGS, triangle, &m);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    return m;
}

/* The cut locus of a flat torus is a rectangle around the source: all crossings of loops but those next to its corners,
 * where the tree chooses among three families, lie on it, and their families meet as straight lines do. */
static void crossings_of_a_flat_torus(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_torus(ctx);
    dmk_geodesics *g;
    dmk_cotree t;
    const double weight[3] = {0.31, 0.22,
                              0.47}; /* of vertices (0, 0), (1, 0), (1, 1) of the grid */
    const double source[2] = {(weight[1] + weight[2]) * width / N, weight[2] * height / N_RINGS};
    const dmk_point at = {0, {weight[0], weight[1], weight[2]}};
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &at, NULL, &g), DMK_OK);
    assert_int_equal(dmk_cotree_create(ctx, g, m->info.mean_edge, &t), DMK_OK);
    assert_int_equal(t.n, m->n_edges - (m->n_vertices - 1));
    assert_int_equal(t.n_loops, 0);
    assert_int_equal(dmk_cotree_peel(ctx, &t), DMK_OK);
    int n_far = 0, n_loop = 0;
    for (int32_t i = 0; i < t.n; i++) {
        const dmk_crossing *c = &t.crossing[i];
        double a[2], b[2];
        unfold(m->triangle[dmk_next(c->half)], source, a);
        unfold(m->triangle[dmk_previous(c->half)], source, b);
        assert_true(t.on[c->half] == i && t.on[g->star.twin[c->half]] == i);
        assert_true(c->node[0] == c->half / 3 && c->node[1] == g->star.twin[c->half] / 3);
        if (c->excess < HUGE_VAL) continue;
        n_loop++;
        const double x = a[0] + c->share * remainder(b[0] - a[0], width),
                     y = a[1] + c->share * remainder(b[1] - a[1], height);
        const double off_x = fabs(fabs(x) - width / 2), off_y = fabs(fabs(y) - height / 2);
        if (fmax(off_x, off_y) < 0.2) continue; /* near a corner */
        n_far++;
        const bool side = off_x < off_y;
        const double along = side ? y : x, across = side ? width / 2 : height / 2;
        assert_true(fmin(off_x, off_y) < 1e-12);
        assert_true(fabs(c->distance - hypot(along, across)) < 1e-12);
        assert_true(fabs(c->alpha - 2 * atan2(across, fabs(along))) < 1e-11);
    }
    assert_true(n_far >= 2 * (N + N_RINGS) - 24 && n_far < n_loop);
    assert_true(t.last == -1);
    dmk_cotree_free(&t);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Crossings that are found many at once are those of one edge. Vertices at half a turn are tied; from the middle of an
 * edge only those across it, and lines meet beside them. */
static void crossings_are_met_one_by_one(void **state)
{
    dmk_context *ctx = *state;
    static const dmk_point source[2] = {{0, {1, 0, 0}}, {0, {0, 0.5, 0.5}}};
    dmk_mesh *m = make_torus(ctx);
    for (int k = 0; k < 2; k++) {
        dmk_geodesics *g;
        dmk_cotree t;
        int n_tied[3] = {0};
        assert_int_equal(dmk_geodesics_create(ctx, m, 1, &source[k], NULL, &g), DMK_OK);
        assert_int_equal(dmk_cotree_create(ctx, g, 1, &t), DMK_OK);
        for (int32_t i = 0; i < t.n; i++) {
            const dmk_crossing *c = &t.crossing[i];
            const dmk_meeting one = dmk_meet(g, c->half);
            assert_true(fabs(c->share - one.x / one.length) < 1e-13);
            assert_true(fabs(c->alpha - one.alpha) < 1e-12);
            const bool start = dmk_geodesics_tie(g, m->triangle[dmk_next(c->half)]),
                       end = dmk_geodesics_tie(g, m->triangle[dmk_previous(c->half)]);
            if (start || end) n_tied[start + 2 * end - 1]++;
        }
        assert_true(n_tied[0] > 10 && n_tied[1] > 10 && n_tied[2] > 10);
        dmk_cotree_free(&t);
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* Within one family there is no jump; across two it is by how much each is too long at the other's end. */
static void jumps_of_a_flat_torus(void **state)
{
    dmk_context *ctx = *state;
    dmk_mesh *m = make_torus(ctx);
    dmk_geodesics *g;
    const double source[2] = {0, 0};
    dmk_point at;
    int n[2] = {0, 0};
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, 0, &at), DMK_OK);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &at, NULL, &g), DMK_OK);
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        double a[2], b[2];
        unfold(m->triangle[dmk_next(h)], source, a);
        unfold(m->triangle[dmk_previous(h)], source, b);
        /* vertices at half a turn have two families */
        if (fmax(fabs(a[0]), fabs(b[0])) > 0.49 * width ||
            fmax(fabs(a[1]), fabs(b[1])) > 0.49 * height)
            continue;
        const bool crosses = fabs(b[0] - a[0]) > width / 2 || fabs(b[1] - a[1]) > height / 2;
        n[crosses]++;
        double jump;
        dmk_jumps(g, 1, &h, dmk_rules.tie, &jump);
        if (!crosses && !(jump * g->star.unit < 1e-12)) fail_msg("%g", jump * g->star.unit);
    }
    assert_true(n[0] > 900 && n[1] == 0);
    dmk_geodesics_destroy(&g);
    const double weight[3] = {0.31, 0.22, 0.47};
    const double inside[2] = {(weight[1] + weight[2]) * width / N, weight[2] * height / N_RINGS};
    at = (dmk_point){0, {weight[0], weight[1], weight[2]}};
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &at, NULL, &g), DMK_OK);
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        double a[2], b[2];
        unfold(m->triangle[dmk_next(h)], inside, a);
        unfold(m->triangle[dmk_previous(h)], inside, b);
        const double dx = remainder(b[0] - a[0], width), dy = remainder(b[1] - a[1], height);
        const double a_at_b = hypot(a[0] + dx, a[1] + dy), b_at_a = hypot(b[0] - dx, b[1] - dy);
        const double jump = a_at_b - hypot(b[0], b[1]) + b_at_a - hypot(a[0], a[1]);
        double found;
        dmk_jumps(g, 1, &h, dmk_rules.tie, &found);
        found *= g->star.unit;
        /* beside it a share of the largest difference at the four corners, which is below the edges' length */
        assert_true(found >= jump - 1e-12 &&
                    found <= jump + 2 * dmk_rules.tie * m->length[m->triangle_edge[h]] + 1e-12);
        n[1] += jump > 0.01;
    }
    assert_true(n[1] > 100);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* Two points with a start: a hyperbola, met from either side; at an end where one of them is shorter all along, or
 * where they differ more if each is the shorter one at the other's end; one family in the middle. */
static void families_meet(void **state)
{
    (void)state;
    const dmk_image a = {-1, -2, 0.3}, b = {2.5, -1.5, 0};
    const double x = find_meeting(&a, &b, 3);
    assert_true(x > 0 && x < 3 &&
                fabs(dmk_image_length(&a, x, 0) - dmk_image_length(&b, x, 0)) < 1e-11);
    const dmk_image c = {2.5, -1.5, 0.3}; /* starts as a: a straight line between both */
    const double alike = find_meeting(&a, &c, 3);
    assert_true(alike > 0 && alike < 3 &&
                fabs(dmk_image_length(&a, alike, 0) - dmk_image_length(&c, alike, 0)) < 1e-15);
    const dmk_image left = {-1, -2, 0}, right = {4, -2, 0};
    assert_true(fabs(find_meeting(&left, &right, 3) - 1.5) < 3e-12);
    assert_true(find_meeting(&right, &(dmk_image){-1.5, -2, 0}, 3) == 3);
    assert_true(find_meeting(&(dmk_image){4.5, -2, 0}, &left, 3) == 0);
    assert_true(find_meeting(&left, &left, 3) == 1.5);
    assert_true(find_meeting(&(dmk_image){-1, -2, 9}, &right, 3) == 0);
    assert_true(find_meeting(&left, &(dmk_image){4, -2, 9}, 3) == 3);
    assert_true(fabs(dmk_meeting_angle(&left, &right, 1.5, 0) - 2 * atan2(2.5, 2)) < 1e-15);
    assert_true(dmk_meeting_angle(&left, &right, -1, -2) == 0);
}

/* ---- a tree of three arms ------------------------------------------------------------------------- */

/* Arms of these numbers of crossings, a step apart, from the middle of triangle 0; the angle is the same on all. */
typedef struct arms {
    dmk_mesh mesh;
    dmk_geodesics geodesics;
    dmk_cotree t;
    dmk_crossing crossing[40];
    double strength_of[40];
    int32_t on[3 * 41];
} arms;

static int32_t number_of(const int length[3], int arm,
                         int j) /* crossing j of the arm, 0: next to the middle */
{
    return (arm > 0 ? length[0] : 0) + (arm > 1 ? length[1] : 0) + j;
}

static void make_arms(arms *a, const int length[3], double step, double alpha)
{
    const int n = length[0] + length[1] + length[2];
    memset(a, 0, sizeof *a);
    a->mesh.n_triangles = n + 1;
    a->geodesics.mesh = &a->mesh;
    a->t = (dmk_cotree){.geodesics = &a->geodesics,
                        .mean_edge = 1e-3,
                        .n = n,
                        .crossing = a->crossing,
                        .strength_of = a->strength_of,
                        .on = a->on};
    for (int32_t i = 0; i < 3 * 41; i++) a->on[i] = -1;
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < length[k]; j++) {
            const int32_t i = number_of(length, k, j), in = j == 0 ? 0 : i, out = i + 1;
            const double r = step * (j + 0.5), angle = 2 * M_PI * k / 3;
            a->crossing[i] = (dmk_crossing){.node = {in, out},
                                            .onward = -1,
                                            .outer = -1,
                                            .alpha = alpha,
                                            .xyz = {r * cos(angle), r * sin(angle), 0},
                                            .excess = HUGE_VAL};
            a->on[3 * in + (j == 0 ? k : 1)] = i;
            a->on[3 * out] = i;
        }
    }
}

static void near(double found, double wanted)
{
    if (!(fabs(found - wanted) <= 1e-14 * wanted)) fail_msg("%.17g, not %.17g", found, wanted);
}

static void leaves_hand_on(void **state)
{
    static arms a;
    static const int length[3] = {12, 7, 4};
    const double step = 0.25, alpha = 0.9, across = step * cos(M_PI / 6);
    const double gain = 1 - cos(alpha / 2), kept = cos(dmk_rules.angle / 2) - cos(alpha / 2);
    make_arms(&a, length, step, alpha);
    assert_int_equal(dmk_cotree_peel(*state, &a.t), DMK_OK);
    /* The two shorter arms hand on inwards, each crossing a step's growth more than the one before. */
    for (int k = 1; k < 3; k++) {
        for (int j = 0; j < length[k]; j++) {
            const dmk_crossing *c = &a.crossing[number_of(length, k, j)];
            const int before = length[k] - 1 - j;
            near(c->excess, gain * step * before);
            near(c->worth, kept * step * before);
            assert_int_equal(c->onward,
                             j > 0 ? number_of(length, k, j - 1) : number_of(length, 0, 0));
            assert_int_equal(c->node[c->outer], number_of(length, k, j) + 1);
        }
    }
    /* The third arm is peeled from both ends, the weaker one first: from inwards the crossing 2 has 8.87 steps, from
     * outwards it would have 9. It is the last one. */
    const int last = 2;
    assert_int_equal(a.t.last, number_of(length, 0, last));
    for (int j = 0; j < length[0]; j++) {
        const double out = 11 - j, in = 6 + across / step + j;
        near(a.crossing[j].excess, gain * step * (j <= last ? in : out));
    }
    /* The weakest arm ends at the fork: all of it has the worth of its last crossing. The others are one line. */
    const double line = kept * (8 * step + across);
    near(a.crossing[a.t.last].worth, line);
    for (int k = 0; k < 3; k++) {
        for (int j = 0; j < length[k]; j++) {
            const int32_t i = number_of(length, k, j);
            const bool end = j == length[k] - 1; /* beyond its end a branch has no worth */
            near(a.strength_of[i], end ? 0 : k < 2 ? line : kept * step * 3);
        }
    }
}

/* From crossing 3 of an arm outwards to its end, or as far as the room for points or the length allows. */
static void walks_have_their_room(void **state)
{
    (void)state;
    static arms a;
    static const int length[3] = {38, 1, 1};
    static const struct {
        double length;
        int n;
    } cases[] = {{1e9, MAX_WALK + 1}, {3.5, 5}, {3, 4}, {0, 1}};
    make_arms(&a, length, 1, 0.9);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        walk w;
        go(&a.t, 3, a.crossing[3].node[1], cases[i].length, &w);
        assert_int_equal(w.n, cases[i].n);
        for (int k = 0; k < w.n; k++) {
            near(w.x[k][0], 3.5 + k);
            near(w.s[k], k);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crossings_of_a_flat_torus),
        cmocka_unit_test(crossings_are_met_one_by_one),
        cmocka_unit_test(jumps_of_a_flat_torus),
        cmocka_unit_test(families_meet),
        cmocka_unit_test(leaves_hand_on),
        cmocka_unit_test(walks_have_their_room),
    };
    return cmocka_run_group_tests_name("cotree", tests, context_setup, context_teardown);
}
