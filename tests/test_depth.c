/* Exact windows from within: what counts as equally long, and as the same place. Each case fails when its constant is
 * doubled or halved. */
#include "context.h"
#include "../src/geodesic/window.c" /* for their static functions; the library's own are then left out */
#include "../src/geodesic/lanes.c"
#include "../src/geodesic/step.c"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* A way over a vertex counts as shorter, and a path around the end of an interval as no longer, by 1e-12. */
static void same_length(void **state)
{
    (void)state;
    const window w = {.lo = 0, .hi = 1, .x = 0.5, .y = -1, .base = 2};
    const double q = hypot(0.5, 1),
                 most = w.base + q - 1; /* of an end's distance, the edge's length added */
    assert_false(beats(&w, w.base + q - 0.7e-12, 1));
    assert_true(beats(&w, w.base + q - 1.4e-12, 1));
    assert_false(late(&w, 1, most - 0.7e-12, 9));
    assert_true(late(&w, 1, most - 1.4e-12, 9));
    assert_false(late(&w, 1, 9, most - 0.7e-12));
    assert_true(late(&w, 1, 9, most - 1.4e-12));
    const window p = {.lo = 0, .hi = 1, .x = -0.6, .y = -0.8, .base = 2, .parallel = true};
    assert_false(beats(&p, 2.6 - 0.7e-12, 1));
    assert_true(beats(&p, 2.6 - 1.4e-12, 1));
    assert_false(late(&p, 1, 1.6 - 0.7e-12, 9));
    assert_true(late(&p, 1, 1.6 - 1.4e-12, 9));
    assert_false(late(&p, 1, 9, 1 - 0.7e-12));
    assert_true(late(&p, 1, 9, 1 - 1.4e-12));
}

/* A second way to a vertex is another path if it is no longer than the first by more than 1e-12, and arrives by more
 * than 1e-6 from another direction. */
static void ties(void **state)
{
    static const struct {
        double longer, turn, shorter; /* shorter: of a third way, that comes later */
        size_t n;
    } way[] = {{0.7e-12, 1, 0, 1}, {1.4e-12, 1, 0, 0},  {0, 0.7e-6, 0, 0},  {0, 1.4e-6, 0, 1},
               {0, 1, 1, 0},       {-0.7e-12, 1, 0, 1}, {0, 1, 0.7e-12, 1}, {0, 1, 1.4e-12, 0}};
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    const int32_t v = 2;
    for (size_t i = 0; i < sizeof way / sizeof *way; i++) {
        engine e;
        worker me = {.ctx = *state, .e = &e};
        const trace first = {.y = 0.1, .half = STRAIGHT, .root = ~0, .turn = 3};
        trace second = first, third = first;
        second.y += way[i].turn, second.turn = 2;
        third.y += 0.4, third.turn = 1;
        assert_int_equal(engine_create(*state, g, INT64_MAX, &e), DMK_OK);
        assert_int_equal(dmk_windows_reach(&me, v, 0.5, first), DMK_OK);
        assert_int_equal(dmk_windows_reach(&me, v, 0.5 + way[i].longer, second), DMK_OK);
        if (way[i].shorter > 0)
            assert_int_equal(dmk_windows_reach(&me, v, 0.5 - way[i].shorter, third), DMK_OK);
        arrive(&e, v);
        free(g->tie);
        g->tie = NULL;
        g->n_ties = 0;
        assert_int_equal(list_ties(&me, g), DMK_OK);
        assert_int_equal(g->n_ties, way[i].n);
        assert_true((dmk_geodesics_tie(g, v) != NULL) == (way[i].n > 0));
        worker_free(&me);
        engine_free(&e);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A ray to the vertex above that passes the interval by 1e-11 of its edge is in it. */
static void same_place(void **state)
{
    static const double off[2] = {0.7e-11, 1.4e-11};
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    for (int i = 0; i < 2; i++) {
        engine e;
        window o[2];
        int n;
        worker me = {.ctx = *state, .e = &e};
        assert_int_equal(engine_create(*state, g, INT64_MAX, &e), DMK_OK);
        /* Half-edge 0 runs from vertex 1 to 2, vertex 0 above it; from below, (1/2, -1), the ray to it crosses at a
         * place that is found as the engine does. */
        const dmk_facet *f = e.front.facet;
        const double length = f->length[0], cx = f->length[2] * f->cosine[1],
                     cy = f->length[2] * f->sine[1], x = 0.5 * length, y = -length;
        const double at = x - (cx - x) * y / (cy - y);
        const window w = {
            .lo = at + off[i] * length, .hi = length, .x = x, .y = y, .length = length, .root = ~0};
        assert_int_equal(dmk_windows_step(&me, &w, o, &n), DMK_OK);
        assert_int_equal(e.trace[0].half, 0);
        assert_true(isnan(e.trace[0].at) == (i == 1)); /* else around the end */
        worker_free(&me);
        engine_free(&e);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A ray that passes the interval by 1e-6 of its edge goes around its end. The edge is short, so that the path is no
 * longer for it; its end is at 0 or at the edge's length. */
static void beside(void **state)
{
    static const double off[2] = {0.7e-6, 1.4e-6};
    dmk_mesh *m = unit_square(*state, 1);
    dmk_geodesics *g = from_corner(*state, m, 0);
    for (int i = 0; i < 4; i++) {
        engine e;
        window o[2];
        int n;
        worker me = {.ctx = *state, .e = &e};
        assert_int_equal(engine_create(*state, g, INT64_MAX, &e), DMK_OK);
        dmk_facet *f = e.front.facet;
        for (int k = 0; k < 3; k++) f->length[k] *= 1e-3;
        const double length = f->length[0], cx = f->length[2] * f->cosine[1],
                     cy = f->length[2] * f->sine[1], x = 0.5 * length, y = -length;
        const double at = x - (cx - x) * y / (cy - y), away = off[i % 2] * length;
        const window w = {.lo = i < 2 ? at + away : 0,
                          .hi = i < 2 ? length : at - away,
                          .x = x,
                          .y = y,
                          .length = length,
                          .root = ~0};
        assert_int_equal(dmk_windows_step(&me, &w, o, &n), DMK_OK);
        assert_int_equal(e.trace[0].half, i % 2 == 0 ? 0 : UNREACHED);
        worker_free(&me);
        engine_free(&e);
    }
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

/* A step is plain where the corner above is farther from all rays than 4e-6 of the half-edge; here it is right above
 * the half-edge's middle, half of its length high, and the root as far below. The corner beyond lies amidst the rays,
 * or on that corner's side of them. What is not plain stays as it was, and comes back as the window that was put there,
 * or as that of the half-edge where its plain step ends. */
static void plain_steps(void **state)
{
    static const double off[2] = {0.7 * 4e-6, 1.4 * 4e-6};
    stride flat[5] = {
        {.here.q = 0.5}, {.here.q = 0.5}, {.here.q = 0.5}, {.here.q = 0.5}, {.here.q = 0.5}};
    const engine e = {.stride = flat};
    (void)state;
    for (int i = 0; i < 8; i++) {
        const bool left = i % 4 < 2, first = i % 2 == 1, second = i >= 4;
        lanes lane = {.look = 0};
        const fields_plain f = {.along = {0.5},
                                .q = {0.5},
                                .left_along = {second ? 3 : 0.5},
                                .left_q = {0.5},
                                .right_along = {second ? -2 : 0.5},
                                .right_q = {0.5},
                                .next_left = {link_of(6 + i, 20 + i)},
                                .next_right = {link_of(40 + i, 60 + i)}};
        /* the corner is twice as far from the root as the half-edge */
        const double at = 0.5 + (left ? 1 : -1) * off[i % 2] / 2;
        const window w = {.lo = left ? at : 0,
                          .hi = left ? 1 : at,
                          .x = 0.5,
                          .y = -0.5,
                          .base = 3,
                          .turn = 0.25,
                          .length = 1,
                          .half = 4,
                          .root = ~0};
        assert_true(put(&e, &lane, 0, &w));
        stride_on_plain(&lane, 0, &f);
        assert_int_equal(lane.state[0], !first   ? ODD
                                        : second ? PLAIN
                                        : left   ? ODD_RIGHT
                                                 : ODD_LEFT);
        assert_int_equal(lane.at[0], !(first && second) ? 4 : left ? 60 + i : 6 + i);
        const window back = get(&lane, 0, 4);
        if (first) { /* the next half-edge is at 45 degrees, seen from its start, the second at 54.5 */
            const double turned = second ? atan(1.75 / 1.25) : atan(1);
            const double length = second ? hypot(1.75, 1.25) : sqrt(0.5);
            assert_true(fabs(back.length - length) < 1e-15);
            assert_true(fabs(back.turn - (left ? 0.25 - turned : 0.25 + turned)) < 1e-15);
            continue;
        }
        assert_true(back.odd && back.half == w.half && back.root == w.root);
        assert_true(fabs(back.lo - w.lo) < 1e-15 && fabs(back.hi - w.hi) < 1e-15);
        assert_true(back.x == w.x && back.y == w.y && back.base == w.base && back.turn == w.turn);
    }
}

/* Of two sides of a corner the short one is exact too, whichever it is. */
static void short_sides(void **state)
{
    const double small = 1e-9 / 3, q = 1e-10 / 7;
    (void)state;
    for (int i = 0; i < 2; i++) {
        const double p = i == 0 ? small : 1 - small, rest = i == 0 ? 1 - small : small;
        const view_plain h = {.vx = {0.75}, .vy = {0.5}};
        const reals_plain along = {along_of(p, rest)}, across = {q};
        const place_plain c = corner_at_plain(along, across, &h);
        const double x = i == 0 ? c.x[0] : c.to_x[0], y = i == 0 ? c.y[0] : c.to_y[0];
        const double sign = i == 0 ? 1 : -1;
        assert_true(fabs(x / (small * 0.75 - sign * q * 0.5) - 1) < 1e-15);
        assert_true(fabs(y / (small * 0.5 + sign * q * 0.75) - 1) < 1e-15);
        assert_true(fabs(c.x[0] + c.to_x[0] - 0.75) < 1e-15);
    }
}

/* Nor is a step where the corner above is four times as far from the root as the half-edge. */
static void next_to_a_root(void **state)
{
    stride high = {.here.q = 0.5};
    const engine e = {.stride = &high};
    (void)state;
    for (int i = 0; i < 2; i++) {
        lanes lane = {.look = 0};
        const window w = {
            .lo = 0, .hi = 1, .x = 0.5, .y = -0.5 / (i == 0 ? 2.9 : 3.1), .length = 1, .root = ~0};
        assert_true(put(&e, &lane, 0, &w) == (i == 0));
    }
}

/* Beyond a border there is nothing to go on for: of two triangles each way leads out within two steps. */
static void over_a_border(void **state)
{
    dmk_facet facet[2] = {
        {.length = {1, 1, 1}, .cosine = {0.5, 0.5, 0.5}, .sine = {0.9, 0.9, 0.9}},
        {.length = {1, 1, 1}, .cosine = {0.5, 0.5, 0.5}, .sine = {0.9, 0.9, 0.9}}};
    static const int32_t twin[2][3] = {{3, -1, -1}, {0, -1, -1}};
    _Alignas(64) stride s[6];
    engine e = {.stride = s};
    e.front.facet = facet;
    memcpy(facet[0].twin, twin[0], sizeof twin[0]);
    memcpy(facet[1].twin, twin[1], sizeof twin[1]);
    corner_range(0, 2, &e);
    beyond_range(0, 2, &e);
    for (int i = 0; i < 14; i++) {
        static const double at[4] = {0.3, 0.69, 0,
                                     0.99}; /* the last two at the ends, from half-edge 0 */
        worker me = {.ctx = *state, .e = &e};
        lanes lane = {.look = 1};
        int n_dropped, n_short;
        const double lo = at[i < 12 ? i / 6 : i - 10];
        const window w = {.lo = lo,
                          .hi = lo + 0.01,
                          .x = 0.5,
                          .y = -0.5,
                          .length = 1,
                          .half = i < 12 ? i % 6 : 0,
                          .root = ~0};
        assert_true(put(&e, &lane, 0, &w));
        const fields_plain f = fetch_plain(&e, &lane, 0);
        stride_on_plain(&lane, 0, &f);
        assert_true(lane.state[0] >= LOOK);
        assert_int_equal(clear(&me, &lane, &n_dropped, &n_short), DMK_OK);
        assert_true(n_dropped == 1 && n_short == 2 && me.n_late == 0);
    }
}

/* A window is dropped where a way over one of three corners is shorter by 1e-12: over the half-edge's ends to its
 * other end, and over the other corner to the end that is nearer to the side that the rays came through. */
static void filtered(void **state)
{
    stride flat = {.here.q = 0.5};
    const engine e = {.stride = &flat};
    (void)state;
    for (int i = 0; i < 8; i++) {
        const bool left = i / 2 == 3;
        const double late = i % 2 == 0 ? 0.7e-12 : 1.4e-12;
        lanes lane = {.look = 0};
        const window w = {
            .lo = 0.25, .hi = 0.5, .x = 0.5, .y = -1, .base = 2, .length = 1, .root = ~0};
        passed_plain p = {.left = {left ? -1 : 0}, .x = {left ? 0 : 1}, .y = {-0.5}};
        const double lo = 2 + hypot(0.25, 1), hi = 2 + 1;
        sides_plain s = {.length = {1}, .start = {9}, .end = {9}, .other = {9}};
        switch (i / 2) {
        case 0: s.end[0] = lo - 0.75 - late; break;
        case 1: s.start[0] = hi - 0.5 - late; break;
        case 2: s.other[0] = lo - hypot(0.75, 0.5) - late; break;
        default: s.other[0] = hi - hypot(0.5, 0.5) - late;
        }
        assert_true(put(&e, &lane, 0, &w));
        p.next = (view_plain){.sx = {lane.sx[0]},
                              .sy = {lane.sy[0]},
                              .vx = {lane.vx[0]},
                              .vy = {lane.vy[0]},
                              .off_lo = {lane.off_lo[0]},
                              .off_hi = {lane.off_hi[0]}};
        filter_plain(&lane, 0, &p, &s);
        assert_int_equal(lane.state[0], i % 2 == 0 ? PLAIN : DROPPED);
    }
}

/* All distances and ways, with that form of the loop. */
static void run_down(dmk_context *ctx, dmk_geodesics *g, advance *form, engine *e)
{
    bool any = true;
    worker me = {.ctx = ctx, .e = e};
    assert_int_equal(engine_create(ctx, g, INT64_MAX, e), DMK_OK);
    assert_int_equal(dmk_lanes_create(ctx, e), DMK_OK);
    e->advance = form;
    assert_int_equal(bound(ctx, e), DMK_OK);
    assert_int_equal(radiate_source(&me, 0), DMK_OK);
    while (any) {
        assert_int_equal(run_all(&me), DMK_OK);
        assert_int_equal(radiate_next(&me, &any), DMK_OK);
    }
    worker_free(&me);
}

/* Ten windows for three threads, the last ones first; then one gives what it had first to one that waits, and when
 * nobody has any there are no more. */
static void shared_windows(void **state)
{
    engine e = {.limit = 1};
    shares s = {.n = 0};
    worker w[3];
    bool more;
    for (int i = 0; i < 3; i++) w[i] = (worker){.ctx = *state, .e = &e, .shares = &s};
    assert_int_equal(DMK_GROW(*state, s.window, 10, s.room), DMK_OK);
    for (s.n = 0; s.n < 10; s.n++) s.window[s.n] = (window){.half = (int32_t)s.n};
    for (int i = 0; i < 3; i++) assert_int_equal(dmk_shares_begin(w + i, 3), DMK_OK);
    assert_true(w[0].n_stack == 3 && w[1].n_stack == 3 && w[2].n_stack == 4 && s.n == 0);
    assert_true(w[0].stack[0].half == 7 && w[1].stack[0].half == 4 && w[2].stack[0].half == 0);
    assert_int_equal(dmk_shares_give(w + 2), DMK_OK); /* nobody waits */
    assert_int_equal(w[2].n_stack, 4);
    s.n_waiting = 1;
    s.n_working = 2;
    assert_int_equal(dmk_shares_give(w + 2), DMK_OK);
    assert_true(w[2].n_stack == 2 && w[2].stack[0].half == 2 && s.n == 2);
    assert_int_equal(dmk_shares_give(w + 1), DMK_OK); /* they have some */
    assert_int_equal(w[1].n_stack, 3);
    s.n_waiting = 0;
    s.n_working = 3;
    w[0].n_stack = 0;
    assert_int_equal(dmk_shares_wait(w, &more), DMK_OK);
    assert_true(more && w[0].n_stack == 2 && w[0].stack[0].half == 0);
    assert_true(s.n == 0 && s.n_waiting == 0 && s.n_working == 3);
    s.n_working = 1;
    w[0].n_stack = 0;
    assert_int_equal(dmk_shares_wait(w, &more), DMK_OK);
    assert_true(!more && s.n_working == 0);
    for (int i = 0; i < 3; i++) free(w[i].stack);
    free(s.window);
}

/* A flat square whose vertices lie on lines, but for the sixth digit: rays that are to reach the next vertex of a line
 * graze its edges, and places on these are rough. */
static void grazing_rays(void **state)
{
    enum { n = 30 };
    double xyz[3 * n * n] = {0};
    int32_t triangle[6 * (n - 1) * (n - 1)], *t = triangle;
    uint32_t random = 5;
    for (int k = 0; k < 3 * n * n; k++) {
        const int v = k / 3, i = k % 3 == 0 ? v % n : v / n;
        random = random * 1664525u + 1013904223u;
        if (k % 3 < 2) xyz[k] = 0.0625 * i + 1e-6 * (random / 2147483648.0 - 1);
    }
    for (int v = 0; v < n * (n - 1); v++) {
        const int32_t two[6] = {v, v + 1, v + n + 1, v, v + n + 1, v + n};
        if (v % n == n - 1) continue;
        memcpy(t, two, sizeof two);
        t += 6;
    }
    dmk_mesh *m;
    assert_int_equal(dmk_mesh_create(*state, n * n, xyz, 2 * (n - 1) * (n - 1), triangle, &m),
                     DMK_OK);
    for (int32_t from = 0; from < n * n; from += 7) {
        dmk_geodesics *g;
        dmk_point source;
        assert_int_equal(dmk_mesh_vertex_point(*state, m, (size_t)from, &source), DMK_OK);
        if (dmk_geodesics_create(*state, m, 1, &source, NULL, &g) != DMK_OK)
            fail_msg("from %d: %s", from, dmk_context_message(*state));
        for (int32_t v = 0; v < n * n; v++) {
            const double d = hypot(xyz[3 * v] - xyz[3 * from], xyz[3 * v + 1] - xyz[3 * from + 1]);
            /* its sides are not straight: ways along them are longer by some 1e-12 */
            if (fabs(g->distance[v] - d) > 1e-10)
                fail_msg("from %d to %d: %.17g, not %.17g", from, v, g->distance[v], d);
        }
        dmk_geodesics_destroy(&g);
    }
    dmk_mesh_destroy(&m);
}

/* Whatever the width of the processor's vectors, the bits are the same. */
static void forms_of_the_loop(void **state)
{
    dmk_mesh *m;
    dmk_surface_options surface;
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "torus";
    surface.n_triangles = 4000;
    assert_int_equal(dmk_mesh_surface(*state, &surface, &m), DMK_OK);
    dmk_geodesics *g[DMK_FORMS];
    engine e[DMK_FORMS];
    advance *form[DMK_FORMS];
    const int n = list_forms(form);
    for (int i = 0; i < n; i++) run_down(*state, g[i] = from_corner(*state, m, 0), form[i], e + i);
    assert_ptr_equal(e[0].advance, advance_plain);
    for (int i = 1; i < n; i++) {
        assert_ptr_not_equal(form[i], form[i - 1]);
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const trace *a = e[0].trace + v, *b = e[i].trace + v;
            assert_true(g[0]->distance[v] == g[i]->distance[v]);
            assert_true(a->x == b->x && a->y == b->y && a->turn == b->turn && a->half == b->half);
        }
    }
    for (int i = 0; i < n; i++) {
        engine_free(e + i);
        dmk_geodesics_destroy(g + i);
    }
    dmk_mesh_destroy(&m);
}

/* An open tube 50 times as long as wide, on which several threads make 3 to 15 % fewer windows than one. */
static dmk_mesh *long_tube(dmk_context *ctx)
{
    enum { SIDES = 60, RINGS = 600 };
    dmk_mesh *m;
    double *xyz = calloc(3 * SIDES * RINGS, sizeof *xyz);
    int32_t *triangle = calloc(6 * SIDES * (RINGS - 1), sizeof *triangle), *t = triangle;
    for (int32_t v = 0; v < SIDES * RINGS; v++) {
        const double a = 2 * M_PI * (v % SIDES) / SIDES;
        memcpy(xyz + 3 * v, (const double[]){cos(a), sin(a), 0.5 * (v / SIDES)}, 3 * sizeof *xyz);
        const int32_t next = v / SIDES * SIDES + (v + 1) % SIDES;
        const int32_t two[] = {v, next, next + SIDES, v, next + SIDES, v + SIDES};
        if (v < SIDES * (RINGS - 1)) memcpy(t, two, sizeof two), t += 6;
    }
    assert_int_equal(
        dmk_mesh_create(ctx, SIDES * RINGS, xyz, 2 * SIDES * (RINGS - 1), triangle, &m), DMK_OK);
    free(xyz);
    free(triangle);
    return m;
}

/* Whether there are too many windows hangs on those that one thread makes, whatever the number of threads. */
static void too_many(void **state)
{
    static const double part[] = {0.96, 1.04};
    dmk_geodesics *g;
    dmk_point source;
    dmk_geodesics_options options;
    dmk_mesh *m = long_tube(*state);
    const int before = dmk_parallel_threads(*state);
    bool finished;
    assert_int_equal(dmk_mesh_vertex_point(*state, m, 0, &source), DMK_OK);
    dmk_geodesics_options_init(&options, sizeof options);
    assert_int_equal(dmk_geodesics_prepare(*state, m, NULL, 1, &source, &options, &g), DMK_OK);
    dmk_context_set_threads(*state, 1);
    assert_int_equal(dmk_windows_run(*state, g, INT64_MAX, &finished), DMK_OK);
    assert_true(finished);
    const double n = (double)g->n_windows;
    dmk_context_set_threads(*state, 8);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(dmk_windows_run(*state, g, (int64_t)(part[i] * n), &finished), DMK_OK);
        if (finished != (part[i] > 1)) fail_msg("%g of %g windows: %d", part[i], n, finished);
    }
    dmk_context_set_threads(*state, before);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(same_length),    cmocka_unit_test(ties),
        cmocka_unit_test(same_place),     cmocka_unit_test(beside),
        cmocka_unit_test(plain_steps),    cmocka_unit_test(short_sides),
        cmocka_unit_test(shared_windows), cmocka_unit_test(next_to_a_root),
        cmocka_unit_test(over_a_border),  cmocka_unit_test(filtered),
        cmocka_unit_test(grazing_rays),   cmocka_unit_test(forms_of_the_loop),
        cmocka_unit_test(too_many)};
    return cmocka_run_group_tests(tests, context_setup, context_teardown);
}
