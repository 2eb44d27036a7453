/* What is said of a triangle that the cut cannot split, and of a cut that is no disk; what a cut takes over. */
#include "../src/api/api.c" /* for their static functions; the library's own are then left out */
#include "../src/cut/cut.c"

#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* Of the split triangles the flattest counts, and the triangle of the mesh that it is a part of is named, by the number
 * that it had before the mesh was ordered. */
static void the_thinnest_triangle_is_named(void **state)
{
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0.5, 1e-3, 0};
    static const int32_t split[] = {0, 1, 2, 1, 3, 2, 0, 1, 4, 4, 3, 2}, of[] = {0, 1, 8, 3};
    int32_t of_mesh[27];
    for (int32_t i = 0; i < 27; i++) of_mesh[i] = 100 + i;
    double at[3 * 127] = {0}; /* of the mesh: all corners at 1 but the last one */
    at[3 * 124] = at[3 * 125] = 1;
    const dmk_mesh mesh = {.n_triangles = 9, .triangle = of_mesh, .xyz = at};
    const dmk_geodesics geodesics = {.mesh = &mesh};
    splitter k = {.geodesics = &geodesics,
                  .xyz = (double *)xyz,
                  .triangle = (int32_t *)split,
                  .least = INFINITY};
    for (int32_t i = 0; i < 4; i++) {
        k.n_triangles = i + 1;
        watch_thin(&k, of[i], i);
    }
    assert_int_equal(refuse_thin(*state, &k), DMK_E_MESH);
    const char *said = dmk_context_message(*state);
    if (!strstr(said, "triangle 8 (vertices 124 125 126) ")) fail_msg("%s", said);
    if (!strstr(said, "join its nearest vertices, as a repair does")) fail_msg("%s", said);
    at[3 * 125] = 1 + 1e-13;
    int32_t triangle_old[9], vertex_old[127];
    for (int32_t i = 0; i < 9; i++) triangle_old[i] = 1000 + i;
    for (int32_t i = 0; i < 127; i++) vertex_old[i] = 2000 + i;
    const dmk_order order = {.triangle_old = triangle_old, .vertex_old = vertex_old};
    splitter sorted = k;
    sorted.order = &order;
    assert_int_equal(refuse_thin(*state, &sorted), DMK_E_MESH);
    said = dmk_context_message(*state);
    if (!strstr(said, "triangle 1008 (vertices 2124 2125 2126) ")) fail_msg("%s", said);
    if (!strstr(said, "join its nearest vertices, or move them apart")) fail_msg("%s", said);
}

/* Not disks: a tetrahedron, a ring of six triangles, two triangles apart. */
static void only_disks_are_cuts(void **state)
{
    static const double xyz[] = {0, 0,   0,   3, 0,   0,   0, 3, 0, 0.5, 0.5,
                                 0, 1.5, 0.5, 0, 0.5, 1.5, 0, 0, 0, 2};
    static const struct {
        size_t n;
        int32_t triangle[18];
        const char *said; /* NULL: a disk */
    } cases[] = {
        {1, {0, 1, 2}, NULL},
        {4, {0, 1, 2, 0, 6, 1, 1, 6, 2, 2, 6, 0}, "Euler characteristic 2, 0 border loops, 1 comp"},
        {6,
         {0, 1, 4, 0, 4, 3, 1, 2, 5, 1, 5, 4, 2, 0, 3, 2, 3, 5},
         "Euler characteristic 0, 2 border loops, 1 comp"},
        {2, {0, 1, 2, 3, 4, 5}, "Euler characteristic 2, 2 border loops, 2 comp"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        dmk_mesh *m;
        assert_int_equal(dmk_mesh_create(*state, 7, xyz, cases[i].n, cases[i].triangle, &m),
                         DMK_OK);
        assert_int_equal(check_disk(*state, m), cases[i].said ? DMK_E_MESH : DMK_OK);
        if (cases[i].said) assert_non_null(strstr(dmk_context_message(*state), cases[i].said));
        dmk_mesh_destroy(&m);
    }
}

/* Two edges at the vertex below an octahedron's source, the only one so far away, that lead away from each other. */
static void a_slit_is_at_the_farthest_vertex(void **state)
{
    static const double xyz[] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1.5};
    static const int32_t triangle[] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4,
                                       2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    const dmk_point top = {0, {0, 0, 1}};
    dmk_mesh *m, *cut;
    dmk_geodesics *g;
    int32_t *origin;
    double *plane;
    const dmk_seam none = {.is_tree = true};
    int n = 0, ends = 0;
    assert_int_equal(dmk_mesh_create(*state, 6, xyz, 8, triangle, &m), DMK_OK);
    assert_int_equal(dmk_geodesics_create(*state, m, 1, &top, NULL, &g), DMK_OK);
    assert_int_equal(dmk_seam_cut(*state, g, &none, NULL, &cut, &origin, &plane), DMK_OK);
    for (int32_t e = 0; e < cut->n_edges; e++) {
        if (cut->edge_triangle[2 * e + 1] >= 0) continue;
        const int32_t a = origin[cut->edge_vertex[2 * e]], b = origin[cut->edge_vertex[2 * e + 1]];
        n++;
        assert_true((a == 5) != (b == 5));
        ends |= 1 << (a == 5 ? b : a);
    }
    assert_int_equal(n, 4); /* both sides of two edges */
    assert_true(ends == (1 << 0 | 1 << 1) || ends == (1 << 2 | 1 << 3));
    free(origin);
    free(plane);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&cut);
    dmk_mesh_destroy(&m);
}

typedef struct disk {
    dmk_mesh *mesh;
    int32_t *origin;
    double *plane;
} disk;

static void free_disk(disk *d)
{
    dmk_mesh_destroy(&d->mesh);
    free(d->origin);
    free(d->plane);
}

static void assert_same_disk(const disk *a, const disk *b)
{
    const size_t n = (size_t)b->mesh->n_vertices, m = (size_t)b->mesh->n_triangles;
    assert_int_equal(a->mesh->n_vertices, n);
    assert_int_equal(a->mesh->n_triangles, m);
    assert_memory_equal(a->mesh->xyz, b->mesh->xyz, 3 * n * sizeof(double));
    assert_memory_equal(a->mesh->triangle, b->mesh->triangle, 3 * m * sizeof(int32_t));
    assert_memory_equal(a->plane, b->plane, 2 * n * sizeof(double));
    assert_memory_equal(a->origin, b->origin, n * sizeof(int32_t));
}

/* Both results are cut alike, whatever was traced of them before. */
static void check_same(dmk_context *ctx, const dmk_mesh *m, const dmk_result *result,
                       const dmk_result *fresh, const dmk_locus_options *o)
{
    disk a, b;
    assert_int_equal(dmk_cut(ctx, m, result, o, &a.mesh, &a.origin, &a.plane), DMK_OK);
    assert_int_equal(dmk_cut(ctx, m, fresh, o, &b.mesh, &b.origin, &b.plane), DMK_OK);
    assert_same_disk(&a, &b);
    free_disk(&a);
    free_disk(&b);
}

/* The cut runs along the locus that was traced before, if that is of the strength that it asks for. */
static void check_seam(dmk_context *ctx, size_t n_triangles)
{
    dmk_surface_options torus;
    dmk_locus_options weak;
    dmk_mesh *m;
    dmk_result *result, *fresh;
    dmk_locus *l;
    dmk_surface_options_init(&torus, sizeof torus);
    torus.name = "torus";
    torus.n_triangles = n_triangles;
    assert_int_equal(dmk_mesh_surface(ctx, &torus, &m), DMK_OK);
    double *zero = calloc((size_t)m->n_triangles + (size_t)m->n_edges, sizeof *zero);
    uint8_t *acl = calloc((size_t)m->n_triangles, sizeof *acl);
    const dmk_result_data data = {zero, zero, zero, zero, acl, .source = {17, {0.3, 0.3, 0.4}}};
    assert_int_equal(dmk_result_restore(ctx, m, &data, &result), DMK_OK);
    assert_int_equal(dmk_result_restore(ctx, m, &data, &fresh), DMK_OK);
    dmk_locus_options_init(&weak, sizeof weak);
    weak.strength = 1e-4;
    assert_null(dmk_result_seam(result));
    assert_int_equal(dmk_locus_compute(ctx, m, result, &weak, &l), DMK_OK);
    const dmk_seam *seam = dmk_result_seam(result);
    assert_true(seam && seam->asked == 1e-4 && seam->n > 0);
    check_same(ctx, m, result, fresh, &weak);
    check_same(ctx, m, result, fresh, NULL);
    /* and not along another one: none at all, of a torus no disk */
    ((dmk_seam *)seam)->n = 0;
    dmk_mesh *cut;
    assert_int_equal(dmk_cut(ctx, m, result, &weak, &cut, NULL, NULL), DMK_E_MESH);
    dmk_locus_destroy(&l);
    dmk_result_destroy(&result);
    dmk_result_destroy(&fresh);
    dmk_mesh_destroy(&m);
    free(zero);
    free(acl);
}

/* Also where it was traced on finer triangles. */
static void the_seam_is_taken_over(void **state)
{
    check_seam(*state, 6000);
    check_seam(*state, 600);
}

/* Tori of 600 triangles beside each other, behind vertices of no triangle. */
static dmk_mesh *make_tori(dmk_context *ctx, size_t n_tori, size_t n_unused)
{
    dmk_surface_options torus;
    dmk_mesh *one, *all;
    dmk_surface_options_init(&torus, sizeof torus);
    torus.name = "torus";
    torus.n_triangles = 600;
    assert_int_equal(dmk_mesh_surface(ctx, &torus, &one), DMK_OK);
    const size_t n = (size_t)one->n_vertices, m = (size_t)one->n_triangles;
    double *xyz = calloc(3 * (n_tori * n + n_unused), sizeof *xyz);
    int32_t *triangle = calloc(3 * n_tori * m, sizeof *triangle);
    for (size_t i = 0; i < 3 * n_tori * n; i++)
        xyz[3 * n_unused + i] = one->xyz[i % (3 * n)] + (i % 3 ? 0 : 9 * (double)(i / (3 * n)));
    for (size_t i = 0; i < 3 * n_tori * m; i++)
        triangle[i] = one->triangle[i % (3 * m)] + (int32_t)(n_unused + i / (3 * m) * n);
    assert_int_equal(dmk_mesh_create(ctx, n_tori * n + n_unused, xyz, n_tori * m, triangle, &all),
                     DMK_OK);
    dmk_mesh_destroy(&one);
    free(xyz);
    free(triangle);
    return all;
}

/* By geodesics alone, from a triangle of the last torus: of the mesh with more on it the disk is that of its result,
 * bit for bit. */
static void cut_geodesics(dmk_context *ctx, size_t n_tori, size_t n_unused)
{
    dmk_mesh *m = make_tori(ctx, n_tori, n_unused);
    const dmk_point source[2] = {{m->n_triangles - 17, {0.3, 0.3, 0.4}},
                                 {m->n_triangles - 30, {0.3, 0.3, 0.4}}};
    dmk_geodesics *g, *two;
    dmk_locus *line, *same;
    disk d;
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, source, NULL, &g), DMK_OK);
    assert_int_equal(dmk_geodesics_cut(ctx, g, NULL, &d.mesh, &d.origin, &d.plane, &line), DMK_OK);
    assert_int_equal(dmk_geodesics_locus(ctx, g, NULL, &same), DMK_OK);
    assert_memory_equal(&line->info, &same->info, sizeof line->info);
    assert_memory_equal(line->vertex, same->vertex, line->info.n_vertices * sizeof *line->vertex);
    for (size_t i = 0; i < line->info.n_vertices; i++) { /* triangles are those of the mesh */
        double xyz[3];
        assert_int_equal(dmk_mesh_point_xyz(ctx, m, &line->vertex[i].place, xyz), DMK_OK);
        assert_true(dmk_distance(xyz, line->vertex[i].xyz) < 1e-12);
    }
    if (n_tori > 1 || n_unused > 0) {
        disk of_result, untraced;
        dmk_result *result;
        double *zero = calloc((size_t)m->n_triangles + (size_t)m->n_edges, sizeof *zero);
        uint8_t *acl = calloc((size_t)m->n_triangles, sizeof *acl);
        const dmk_result_data data = {zero, zero, zero, zero, acl, .source = source[0]};
        assert_int_equal(dmk_result_restore(ctx, m, &data, &result), DMK_OK);
        assert_int_equal(
            dmk_cut(ctx, m, result, NULL, &of_result.mesh, &of_result.origin, &of_result.plane),
            DMK_OK);
        assert_same_disk(&d, &of_result);
        assert_int_equal(dmk_geodesics_cut(ctx, g, NULL, &untraced.mesh, &untraced.origin,
                                           &untraced.plane, NULL),
                         DMK_OK);
        assert_same_disk(&d, &untraced);
        free_disk(&of_result);
        free_disk(&untraced);
        dmk_result_destroy(&result);
        free(zero);
        free(acl);
    }
    assert_int_equal(dmk_geodesics_create(ctx, m, 2, source, NULL, &two), DMK_OK);
    dmk_mesh *none = NULL;
    assert_int_equal(dmk_geodesics_cut(ctx, two, NULL, &none, NULL, NULL, NULL), DMK_E_ARG);
    assert_null(none);
    free_disk(&d);
    dmk_locus_destroy(&line);
    dmk_locus_destroy(&same);
    dmk_geodesics_destroy(&g);
    dmk_geodesics_destroy(&two);
    dmk_mesh_destroy(&m);
}

static void geodesics_are_cut_as_their_results(void **state)
{
    cut_geodesics(*state, 1, 0);
    cut_geodesics(*state, 1, 1);
    cut_geodesics(*state, 2, 0);
}

/* New points that lie nearer to the source in the plane than any path leads. */
static int count_nearer(dmk_context *ctx, const dmk_geodesics *g, const dmk_mesh *cut,
                        const int32_t *origin, const double *plane)
{
    int n = 0;
    for (int32_t v = 0; v < cut->n_vertices; v++) {
        dmk_point at;
        dmk_value value;
        if (origin[v] >= 0) continue;
        assert_int_equal(dmk_mesh_project(ctx, g->mesh, cut->xyz + 3 * v, &at), DMK_OK);
        assert_int_equal(dmk_geodesics_at(ctx, g, 1, &at, &value), DMK_OK);
        n +=
            hypot(plane[2 * v], plane[2 * v + 1]) < value.distance - 1e-6 * g->mesh->info.mean_edge;
    }
    return n;
}

/* Along an edge a distance changes by its length at most, also in the shadow of saddle vertices. By families that do
 * not reach the new points it would change by 0.6 mean edges more, and half again as many be too near. */
static void shadows_are_no_nearer(void **state)
{
    dmk_context *ctx = *state;
    static const dmk_point source = {0, {1, 0, 0}};
    dmk_mesh *m, *cut;
    dmk_geodesics *g;
    int32_t *origin;
    double *plane, worst = 0;
    dmk_locus_options opt;
    dmk_locus_options_init(&opt, sizeof opt);
    assert_int_equal(dmk_mesh_read(ctx, "tests/data/once/disc-76.off.gz", &m), DMK_OK);
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &source, NULL, &g), DMK_OK);
    assert_int_equal(dmk_locus_cut(ctx, g, &opt, NULL, &cut, &origin, &plane), DMK_OK);
    for (int32_t e = 0; e < cut->n_edges; e++) {
        const int32_t *v = cut->edge_vertex + 2 * (size_t)e;
        const double a = hypot(plane[2 * v[0]], plane[2 * v[0] + 1]),
                     b = hypot(plane[2 * v[1]], plane[2 * v[1] + 1]);
        if ((origin[v[0]] < 0) == (origin[v[1]] < 0)) continue;
        worst = fmax(worst, (origin[v[0]] < 0 ? b - a : a - b) - cut->length[e]);
    }
    worst /= m->info.mean_edge;
    const int n = count_nearer(ctx, g, cut, origin, plane);
    if (!(worst < 0.05 && n < 350)) fail_msg("%g mean edges, %d too near", worst, n);
    dmk_mesh_destroy(&cut);
    dmk_geodesics_destroy(&g);
    dmk_mesh_destroy(&m);
    free(origin);
    free(plane);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_thinnest_triangle_is_named),
                                       cmocka_unit_test(only_disks_are_cuts),
                                       cmocka_unit_test(a_slit_is_at_the_farthest_vertex),
                                       cmocka_unit_test(the_seam_is_taken_over),
                                       cmocka_unit_test(shadows_are_no_nearer),
                                       cmocka_unit_test(geodesics_are_cut_as_their_results)};
    return cmocka_run_group_tests_name("cut", tests, context_setup, context_teardown);
}
