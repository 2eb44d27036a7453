/* The built-in surfaces: counts, quality, points on the surface, source, refinement, areas. */
#include "mesh/mesh.h"
#include "surfaces/refine.h"
#include "surfaces/relax.h"
#include "surfaces/surface.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

typedef struct expected {
    const char *name;
    size_t n_vertices, n_triangles;
    int euler;
    double area; /* exact; the first three by quadrature to 1e-14, the sphere's is 4 pi */
    double source[3];
} expected;

static const expected surfaces[] = {
    {"torus", 2712, 5424, 0, 78.9568352087149, {3, 0, 0}},
    {"ellipsoid", 534, 1064, 2, 4.3450753157968, {-0.151128, -0.350718, 0.295520}},
    {"quartic", 2138, 4272, 2, 17.5871890690978, {0.533843, 0.800764, 0.844080}},
    {"sphere", 642, 1280, 2, 12.566370614359172, {0, 0.6, -0.8}},
};
enum {
    n_surfaces = sizeof surfaces / sizeof *surfaces,
    n_shipped = 4 /* the first of them, as files in meshes/ */
};

/* Shared by all tests: the default coarse meshes take the most time to make. */
typedef struct fixture {
    dmk_context *ctx;
    dmk_mesh *coarse[n_surfaces];
} fixture;

static dmk_mesh *make(dmk_context *ctx, const dmk_surface_options *o)
{
    dmk_mesh *mesh = NULL;
    int rc = dmk_mesh_surface(ctx, o, &mesh);
    if (rc != DMK_OK) fail_msg("%s: %s", o->name, dmk_context_message(ctx));
    return mesh;
}

static dmk_surface_options options_of(const expected *e, int refine)
{
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = e->name;
    o.refine = refine;
    return o;
}

static int setup(void **state)
{
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    if (!f || dmk_context_create(&f->ctx) != DMK_OK) return 1;
    for (size_t i = 0; i < n_surfaces; i++) {
        dmk_surface_options o = options_of(&surfaces[i], 0);
        f->coarse[i] = make(f->ctx, &o);
    }
    return 0;
}

static int teardown(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) dmk_mesh_destroy(&f->coarse[i]);
    dmk_context_destroy(&f->ctx);
    free(f);
    return 0;
}

static dmk_body body_of(const char *name)
{
    dmk_body body = {0};
    for (size_t i = 0; dmk_surface_get(i); i++) {
        if (!strcmp(dmk_surface_get(i)->name, name)) body.surface = dmk_surface_get(i);
    }
    memcpy(body.size, body.surface->size, sizeof body.size);
    return body;
}

static double value_at(const dmk_body *body, const double x[3])
{
    double g[3];
    return body->surface->value(body->size, x, g);
}

/* 2 inradius / circumradius: 1 if equilateral. */
static double quality(const dmk_mesh *m, int32_t t)
{
    const int32_t *e = m->triangle_edge + 3 * t;
    double a = m->length[e[0]], b = m->length[e[1]], c = m->length[e[2]];
    return (b + c - a) * (c + a - b) * (a + b - c) / (a * b * c);
}

static double total_area(const dmk_mesh *m)
{
    double sum = 0;
    for (int32_t t = 0; t < m->n_triangles; t++) sum += m->area[t];
    return sum;
}

static void names_are_listed(void **state)
{
    (void)state;
    for (size_t i = 0; i < n_surfaces; i++) {
        assert_string_equal(dmk_surface_name(i), surfaces[i].name);
    }
    assert_null(dmk_surface_name(n_surfaces));
}

static void gradients_are_derivatives(void **state)
{
    (void)state;
    for (size_t i = 0; i < n_surfaces; i++) {
        dmk_body body = body_of(surfaces[i].name);
        double x[3] = {0.31, -0.42, 0.53}, g[3], unused[3], h = 1e-6;
        body.surface->value(body.size, x, g);
        for (int k = 0; k < 3; k++) {
            double left[3] = {x[0], x[1], x[2]}, right[3] = {x[0], x[1], x[2]};
            left[k] -= h;
            right[k] += h;
            double slope = (body.surface->value(body.size, right, unused) -
                            body.surface->value(body.size, left, unused)) /
                           (2 * h);
            assert_true(fabs(slope - g[k]) < 1e-7);
        }
    }
}

static void counts_and_topology(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) {
        const dmk_mesh *m = f->coarse[i];
        assert_int_equal(m->n_vertices, surfaces[i].n_vertices);
        assert_int_equal(m->n_triangles, surfaces[i].n_triangles);
        assert_int_equal(m->n_vertices - m->n_edges + m->n_triangles, surfaces[i].euler);
        assert_int_equal(2 * m->n_edges, 3 * m->n_triangles);
        assert_int_equal(m->n_components, 1);
        for (int32_t e = 0; e < m->n_edges; e++) assert_true(m->edge_triangle[2 * e + 1] >= 0);
    }
}

static void triangles_are_well_shaped(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) {
        const dmk_mesh *m = f->coarse[i];
        double mean = 0, largest_cot = 0, shortest = INFINITY, longest = 0;
        for (int32_t t = 0; t < m->n_triangles; t++) {
            mean += quality(m, t) / m->n_triangles;
            for (int k = 0; k < 3; k++) largest_cot = fmax(largest_cot, dmk_cot(m, 3 * t + k));
        }
        for (int32_t e = 0; e < m->n_edges; e++) {
            shortest = fmin(shortest, m->length[e]);
            longest = fmax(longest, m->length[e]);
        }
        assert_true(mean > 0.95);
        assert_true(largest_cot < sqrt(3.0)); /* every angle above 30 degrees */
        assert_true(longest < 2.5 * shortest);
    }
}

static void normals_point_outwards(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) {
        dmk_body body = body_of(surfaces[i].name);
        const dmk_mesh *m = f->coarse[i];
        for (int32_t t = 0; t < m->n_triangles; t++) {
            const double *a = m->xyz + 3 * m->triangle[3 * t];
            const double *b = m->xyz + 3 * m->triangle[3 * t + 1];
            const double *c = m->xyz + 3 * m->triangle[3 * t + 2];
            double middle[3], p[3], q[3], g[3];
            for (int k = 0; k < 3; k++) {
                middle[k] = (a[k] + b[k] + c[k]) / 3;
                p[k] = b[k] - a[k];
                q[k] = c[k] - a[k];
            }
            body.surface->value(body.size, middle, g);
            assert_true((p[1] * q[2] - p[2] * q[1]) * g[0] + (p[2] * q[0] - p[0] * q[2]) * g[1] +
                            (p[0] * q[1] - p[1] * q[0]) * g[2] >
                        0);
        }
    }
}

static void check_residuals(const dmk_mesh *m, const char *name)
{
    dmk_body body = body_of(name);
    for (int32_t v = 0; v < m->n_vertices; v++) {
        assert_true(fabs(value_at(&body, m->xyz + 3 * v)) < 1e-14);
    }
}

static void refinement_converges_on_the_surface(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) {
        double error[3] = {1 - total_area(f->coarse[i]) / surfaces[i].area};
        check_residuals(f->coarse[i], surfaces[i].name);
        for (int refine = 1; refine < 3; refine++) {
            dmk_surface_options o = options_of(&surfaces[i], refine);
            dmk_mesh *m = make(f->ctx, &o);
            assert_int_equal(m->n_triangles, surfaces[i].n_triangles << 2 * refine);
            assert_int_equal(m->n_vertices, m->n_triangles / 2 + surfaces[i].euler);
            check_residuals(m, o.name);
            error[refine] = 1 - total_area(m) / surfaces[i].area;
            dmk_mesh_destroy(&m);
        }
        /* The area's error is of second order in the length of the edges. */
        assert_true(fabs(error[0]) < 0.02);
        for (int k = 0; k < 2; k++) {
            assert_true(error[k] / error[k + 1] > 3.5 && error[k] / error[k + 1] < 4.6);
        }
    }
}

static void source_is_vertex_0(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_surfaces; i++) {
        dmk_body body = body_of(surfaces[i].name);
        double place[2][3];
        for (int refine = 0; refine < 2; refine++) {
            dmk_surface_options o = options_of(&surfaces[i], refine);
            o.has_source = 1;
            memcpy(o.source, surfaces[i].source, sizeof o.source);
            dmk_mesh *m = make(f->ctx, &o);
            for (int k = 0; k < 3; k++) {
                place[refine][k] = m->xyz[k];
                /* The sources are given to 6 digits. */
                assert_true(fabs(m->xyz[k] - o.source[k]) < 2e-6);
            }
            assert_true(fabs(value_at(&body, m->xyz)) < 1e-14);
            for (int32_t t = 0; t < m->n_triangles; t++) assert_true(quality(m, t) > 0.5);
            dmk_mesh_destroy(&m);
        }
        assert_memory_equal(place[0], place[1], sizeof place[0]);
    }
}

/* Midpoints lifted over this rim turn triangles over; the mesh has the size asked for all the same, and the source. */
static void no_triangle_is_turned_at_a_sharp_rim(void **state)
{
    fixture *f = *state;
    dmk_surface_options o = options_of(&surfaces[1], 1);
    o.n_triangles = 2400;
    o.size[0] = 0.02;
    o.size[1] = 1;
    o.has_source = 1;
    o.source[2] = 1;
    dmk_mesh *m = make(f->ctx, &o);
    const dmk_body body = {.surface = body_of(o.name).surface, .size = {0.02, 1, 1}};
    assert_int_equal(m->n_triangles, 9600);
    assert_int_equal(m->n_vertices, 4802);
    assert_memory_equal(m->xyz, o.source, sizeof o.source);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * t;
        assert_true(
            dmk_relax_facing(&body, m->xyz + 3 * v[0], m->xyz + 3 * v[1], m->xyz + 3 * v[2]) > 0);
    }
    dmk_mesh_destroy(&m);
}

static void far_source_goes_to_the_nearest_point(void **state)
{
    fixture *f = *state;
    dmk_surface_options o = options_of(&surfaces[0], 0);
    o.has_source = 1;
    o.source[0] = 6;
    o.source[2] = 3; /* 5 from the tube's centre (2, 0, 0) */
    dmk_mesh *m = make(f->ctx, &o);
    assert_true(fabs(m->xyz[0] - 2.8) < 1e-8);
    assert_true(fabs(m->xyz[1]) < 1e-8);
    assert_true(fabs(m->xyz[2] - 0.6) < 1e-8);
    dmk_mesh_destroy(&m);
}

/* From a point of the ellipsoid straight out: it is convex, so back is the way we came. */
static void nearest_point_undoes_the_normal(void **state)
{
    (void)state;
    dmk_body body = body_of("ellipsoid");
    for (int i = 0; i < 50; i++) {
        double x[3] = {0.1 * sin(i), cos(3 * i), sin(5 * i)}, n[3], p[3];
        assert_true(dmk_body_lift(&body, x));
        dmk_body_normal(&body, x, n);
        for (int k = 0; k < 3; k++) p[k] = x[k] + 0.3 * n[k];
        assert_true(dmk_body_nearest(&body, p));
        for (int k = 0; k < 3; k++) assert_true(fabs(p[k] - x[k]) < 1e-6);
    }
}

static void triangle_count_is_honoured(void **state)
{
    fixture *f = *state;
    dmk_surface_options o = options_of(&surfaces[3], 0);
    for (o.n_triangles = 8; o.n_triangles < 3000; o.n_triangles = o.n_triangles * 3 + 1) {
        dmk_mesh *m = make(f->ctx, &o);
        assert_int_equal(m->n_triangles, o.n_triangles + o.n_triangles % 2);
        dmk_mesh_destroy(&m);
    }
}

/* Rims much sharper than the triangles are long: the mesh must still go round all of the body. */
static void thin_bodies_are_covered(void **state)
{
    fixture *f = *state;
    static const struct {
        const char *name;
        double size[3], area; /* by quadrature */
    } thin[] = {{"ellipsoid", {0.05, 1, 1}, 6.3411928},
                {"ellipsoid", {0.05, 0.05, 1}, 0.4940720},
                {"quartic", {0.1, 1, 1}, 8.0292861},
                {"torus", {20, 1, 0}, 789.568352}};
    for (size_t i = 0; i < sizeof thin / sizeof *thin; i++) {
        dmk_surface_options o;
        dmk_surface_options_init(&o, sizeof o);
        o.name = thin[i].name;
        o.n_triangles = 2400;
        memcpy(o.size, thin[i].size, sizeof o.size);
        dmk_mesh *m = make(f->ctx, &o);
        assert_true(fabs(total_area(m) / thin[i].area - 1) < 0.04);
        double worst = 1;
        for (int32_t t = 0; t < m->n_triangles; t++) worst = fmin(worst, quality(m, t));
        /* Squeezed to a quarter at a time the first would have 0.37, to a half all have 0.64. */
        if (!(worst > 0.6)) fail_msg("%s: quality %g", thin[i].name, worst);
        dmk_mesh_destroy(&m);
    }
}

static void shipped_files_are_what_is_made(void **state)
{
    fixture *f = *state;
    for (size_t i = 0; i < n_shipped; i++) {
        const dmk_mesh *made = f->coarse[i];
        dmk_mesh *read = NULL;
        char path[64];
        snprintf(path, sizeof path, "meshes/%s.off", surfaces[i].name);
        if (dmk_mesh_read(f->ctx, path, &read) != DMK_OK) {
            fail_msg("%s", dmk_context_message(f->ctx));
        }
        assert_int_equal(read->n_vertices, made->n_vertices);
        assert_int_equal(read->n_triangles, made->n_triangles);
        assert_memory_equal(read->triangle, made->triangle,
                            3 * (size_t)made->n_triangles * sizeof *made->triangle);
        for (int32_t k = 0; k < 3 * made->n_vertices; k++) {
            assert_true(fabs(read->xyz[k] - made->xyz[k]) < 1e-12);
        }
        dmk_mesh_destroy(&read);
    }
}

static void sizes_are_used(void **state)
{
    fixture *f = *state;
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "sphere";
    o.refine = 1;
    o.size[0] = 3;
    dmk_mesh *m = make(f->ctx, &o);
    assert_true(fabs(total_area(m) / (36 * 3.14159265358979) - 1) < 0.01);
    dmk_mesh_destroy(&m);
}

static void children_follow_their_parents(void **state)
{
    fixture *f = *state;
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
    static const int32_t triangle[] = {0, 1, 2, 3, 2, 1};
    dmk_mesh *coarse = NULL, *fine = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 4, xyz, 2, triangle, &coarse), DMK_OK);
    assert_int_equal(dmk_mesh_refine(f->ctx, coarse, NULL, NULL, &fine), DMK_OK);
    assert_int_equal(fine->n_triangles, 8);
    assert_int_equal(fine->n_vertices, 9);
    assert_memory_equal(fine->xyz, xyz, sizeof xyz);
    for (int32_t t = 0; t < 2; t++) {
        for (int k = 0; k < 4; k++) {
            for (int j = 0; j < 3; j++) {
                /* Corner j of child k, and the two corners of the parent it is the middle of. */
                const double *x = fine->xyz + 3 * fine->triangle[3 * (4 * t + k) + j];
                const int32_t *v = coarse->triangle + 3 * t;
                const double *p = xyz + 3 * v[k < 3 ? k : (j + 1) % 3];
                const double *q = xyz + 3 * v[k < 3 ? j : (j + 2) % 3];
                for (int i = 0; i < 3; i++) assert_true(x[i] == 0.5 * (p[i] + q[i]));
            }
        }
    }
    dmk_mesh_destroy(&coarse);
    dmk_mesh_destroy(&fine);
}

static void refuse(dmk_context *ctx, const dmk_surface_options *o, const char *word)
{
    dmk_mesh *mesh = NULL;
    assert_int_equal(dmk_mesh_surface(ctx, o, &mesh), DMK_E_ARG);
    assert_null(mesh);
    if (!strstr(dmk_context_message(ctx), word)) {
        fail_msg("'%s' does not say '%s'", dmk_context_message(ctx), word);
    }
}

static void bad_options_are_refused(void **state)
{
    fixture *f = *state;
    dmk_surface_options good = options_of(&surfaces[0], 0), o = good;
    o.name = "klein";
    refuse(f->ctx, &o, "choose one of torus, ellipsoid");
    o.name = NULL;
    refuse(f->ctx, &o, "torus");
    static const double wrong[] = {-1, NAN, INFINITY};
    for (int i = 0; i < 3; i++) {
        o = good;
        o.size[1] = wrong[i];
        refuse(f->ctx, &o, "size b");
    }
    o = good;
    o.size[2] = 1;
    refuse(f->ctx, &o, "no size c");
    o = good;
    o.size[1] = 2;
    refuse(f->ctx, &o, "smaller than a");
    o = good;
    o.n_triangles = 10;
    refuse(f->ctx, &o, "at least 120 triangles, not 10");
    o = options_of(&surfaces[2], 0);
    o.size[0] = 1e6; /* needles only */
    refuse(f->ctx, &o, "ask for more");
    o = good;
    o.refine = -1;
    refuse(f->ctx, &o, "refine");
    o.refine = 9;
    refuse(f->ctx, &o, "at most");
    o.refine = 0;
    o.n_triangles = SIZE_MAX;
    refuse(f->ctx, &o, "at most");
    o = good;
    o.has_source = 1;
    o.source[1] = NAN;
    refuse(f->ctx, &o, "source");
    o = options_of(&surfaces[3], 0);
    o.has_source = 1; /* the centre: every direction is as good */
    refuse(f->ctx, &o, "source");
}

/* Of a body a thousand times as long as wide 20 triangles are needles of 0.018 (quartic) and 0.006 (ellipsoid). */
static void needles_are_refused(void **state)
{
    fixture *f = *state;
    dmk_surface_options o = options_of(&surfaces[2], 0);
    o.size[0] = 1000;
    o.n_triangles = 20;
    dmk_mesh *m = make(f->ctx, &o);
    dmk_mesh_destroy(&m);
    o.name = "ellipsoid";
    o.size[1] = o.size[2] = 1;
    refuse(f->ctx, &o, "is a needle");
}

static int stop_at_once(const dmk_progress *progress, void *user)
{
    assert_string_equal(progress->stage, "mesh");
    return ++*(int *)user >= 3;
}

static void making_can_be_cancelled(void **state)
{
    fixture *f = *state;
    dmk_surface_options o = options_of(&surfaces[0], 0);
    dmk_mesh *mesh = NULL;
    int calls = 0;
    dmk_context_set_progress(f->ctx, stop_at_once, &calls);
    assert_int_equal(dmk_mesh_surface(f->ctx, &o, &mesh), DMK_E_CANCELLED);
    dmk_context_set_progress(f->ctx, NULL, NULL);
    assert_int_equal(calls, 3);
    assert_null(mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_listed),
        cmocka_unit_test(gradients_are_derivatives),
        cmocka_unit_test(counts_and_topology),
        cmocka_unit_test(triangles_are_well_shaped),
        cmocka_unit_test(normals_point_outwards),
        cmocka_unit_test(refinement_converges_on_the_surface),
        cmocka_unit_test(source_is_vertex_0),
        cmocka_unit_test(no_triangle_is_turned_at_a_sharp_rim),
        cmocka_unit_test(far_source_goes_to_the_nearest_point),
        cmocka_unit_test(nearest_point_undoes_the_normal),
        cmocka_unit_test(triangle_count_is_honoured),
        cmocka_unit_test(thin_bodies_are_covered),
        cmocka_unit_test(shipped_files_are_what_is_made),
        cmocka_unit_test(sizes_are_used),
        cmocka_unit_test(children_follow_their_parents),
        cmocka_unit_test(bad_options_are_refused),
        cmocka_unit_test(needles_are_refused),
        cmocka_unit_test(making_can_be_cancelled),
    };
    return cmocka_run_group_tests_name("surface", tests, setup, teardown);
}
