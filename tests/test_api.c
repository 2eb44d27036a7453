/* What the public header says of results, seen from outside. */
#include "solving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static problem solved(void **state)
{
    problem p = problem_file(*state, "tests/data/torus_5440.off.gz");
    problem_solve(&p);
    return p;
}

static void potential_is_minus_the_distance_and_a_constant(void **state)
{
    problem p = solved(state);
    size_t n_u, n_d, n_um;
    dmk_mesh_info info;
    dmk_mesh_get_info(p.mesh, &info);
    const double *u = dmk_result_potential(p.result, &n_u);
    const double *d = dmk_result_distance(p.result, &n_d);
    assert_non_null(dmk_result_potential_mid(p.result, &n_um));
    assert_int_equal(n_u, info.n_vertices);
    assert_int_equal(n_d, info.n_vertices);
    assert_int_equal(n_um, info.n_edges);
    /* Away from p the distance is nearly -u and a constant, as u's peak at p is blunt. */
    double low = INFINITY, high = -INFINITY;
    for (size_t v = 0; v < n_u; v++) {
        if (d[v] < 2) continue;
        low = fmin(low, d[v] + u[v]);
        high = fmax(high, d[v] + u[v]);
    }
    assert_true(high - low < info.mean_edge && fabs(low) < info.mean_edge);
    assert_true(d[0] == 0);
    problem_free(&p);
}

/* A midpoint is half an edge from its ends, so its potential differs from theirs by no more, but for
 * the discretisation: within one edge length. */
static void midpoints_lie_between_their_ends(void **state)
{
    problem p = solved(state);
    size_t n;
    const double *u = dmk_result_potential(p.result, NULL),
                 *um = dmk_result_potential_mid(p.result, &n);
    const double *xyz = dmk_mesh_vertices(p.mesh);
    const int32_t *edge = dmk_mesh_edges(p.mesh);
    for (size_t e = 0; e < n; e++) {
        double square = 0;
        for (int k = 0; k < 3; k++) {
            square += pow(xyz[3 * edge[2 * e] + k] - xyz[3 * edge[2 * e + 1] + k], 2);
        }
        assert_true(fabs(um[e] - 0.5 * (u[edge[2 * e]] + u[edge[2 * e + 1]])) < sqrt(square));
    }
    problem_free(&p);
}

static void the_source_is_given_back(void **state)
{
    problem p = problem_file(*state, "tests/data/torus_5440.off.gz");
    p.source = (dmk_point){77, {0.25, 0.5, 0.25}};
    problem_solve(&p);
    dmk_point point;
    double asked[3], got[3];
    dmk_result_source(p.result, &point);
    bench_ok(p.b, dmk_mesh_point_xyz(p.b->ctx, p.mesh, &p.source, asked));
    bench_ok(p.b, dmk_mesh_point_xyz(p.b->ctx, p.mesh, &point, got));
    for (int k = 0; k < 3; k++) assert_true(fabs(asked[k] - got[k]) < 1e-12);
    problem_free(&p);
}

/* A vertex is a corner of several triangles, any of which may name it. */
static void a_vertex_is_one_source_by_any_triangle(void **state)
{
    problem p = solved(state);
    size_t bytes = problem_vertices(&p) * sizeof(double);
    double *first = malloc(bytes);
    assert_non_null(first);
    memcpy(first, problem_distance(&p), bytes);
    for (size_t t = 0; t < problem_triangles(&p); t++) {
        for (int k = 0; k < 3; k++) {
            if (dmk_mesh_triangles(p.mesh)[3 * t + (size_t)k] != 0) continue;
            p.source = (dmk_point){.triangle = (int64_t)t};
            p.source.weight[k] = 1;
            problem_solve(&p);
            for (size_t v = 0; v < problem_vertices(&p); v++) {
                assert_true(fabs(problem_distance(&p)[v] - first[v]) < 1e-9);
            }
        }
    }
    free(first);
    problem_free(&p);
}

static void lengths_need_not_be_asked_for(void **state)
{
    problem p = solved(state);
    assert_non_null(dmk_result_density(p.result, NULL));
    assert_non_null(dmk_result_acl(p.result, NULL));
    assert_non_null(dmk_result_potential(p.result, NULL));
    assert_non_null(dmk_result_potential_mid(p.result, NULL));
    assert_non_null(dmk_result_distance(p.result, NULL));
    problem_free(&p);
}

/* A result made again from its arrays gives the same path and the same locus. */
static void a_result_is_restored(void **state)
{
    problem p = problem_file(*state, "tests/data/torus_5440.off.gz");
    p.source = (dmk_point){77, {0.25, 0.5, 0.25}};
    problem_solve(&p);
    const dmk_result_data data = result_data(p.result);
    dmk_result *again = NULL;
    bench_ok(p.b, dmk_result_restore(p.b->ctx, p.mesh, &data, &again));
    const dmk_result_data copy = result_data(again);
    assert_ptr_not_equal(copy.density, data.density);
    assert_memory_equal(copy.density, data.density, problem_triangles(&p) * sizeof(double));
    assert_memory_equal(copy.acl, data.acl, problem_triangles(&p));
    assert_memory_equal(copy.potential, data.potential, problem_vertices(&p) * sizeof(double));
    assert_memory_equal(copy.distance, data.distance, problem_vertices(&p) * sizeof(double));
    assert_memory_equal(copy.potential_mid, data.potential_mid, p.info.n_edges * sizeof(double));
    assert_true(copy.source.triangle == 77 && copy.stats.cost_upper == data.stats.cost_upper);
    dmk_point to = {1234, {0.2, 0.3, 0.5}};
    dmk_path path[2];
    dmk_locus *locus[2];
    dmk_locus_info info[2];
    for (int i = 0; i < 2; i++) {
        const dmk_result *r = i == 0 ? p.result : again;
        bench_ok(p.b, dmk_path_compute(p.b->ctx, p.mesh, r, 1, &to, &path[i]));
        bench_ok(p.b, dmk_locus_compute(p.b->ctx, p.mesh, r, NULL, &locus[i]));
        dmk_locus_get_info(locus[i], &info[i]);
        dmk_locus_destroy(&locus[i]);
    }
    assert_true(path[0].length == path[1].length && path[0].n == path[1].n);
    assert_true(info[0].length == info[1].length && info[0].n_vertices == info[1].n_vertices);
    dmk_path_free(&path[0]);
    dmk_path_free(&path[1]);
    dmk_result_destroy(&again);
    /* Without distance and acl it is one of density_only; one of them alone is missing the other. */
    dmk_result_data lean = data;
    lean.distance = NULL;
    assert_int_equal(dmk_result_restore(p.b->ctx, p.mesh, &lean, &again), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(p.b->ctx), "`distance`"));
    lean.acl = NULL;
    bench_ok(p.b, dmk_result_restore(p.b->ctx, p.mesh, &lean, &again));
    assert_true(!dmk_result_distance(again, NULL) && !dmk_result_acl(again, NULL));
    assert_memory_equal(dmk_result_density(again, NULL), data.density,
                        problem_triangles(&p) * sizeof(double));
    assert_int_equal(dmk_locus_compute(p.b->ctx, p.mesh, again, NULL, &locus[0]), DMK_E_ARG);
    dmk_result_destroy(&again);
    problem_free(&p);
}

/* The density at a vertex of the locus is that of the triangle in which it lies, in the input's order. */
static void the_locus_has_the_density_of_its_triangles(void **state)
{
    problem p = solved(state);
    dmk_locus *locus;
    size_t n;
    bench_ok(p.b, dmk_locus_compute(p.b->ctx, p.mesh, p.result, NULL, &locus));
    const dmk_locus_vertex *v = dmk_locus_vertices(locus, &n);
    assert_true(n > 100);
    for (size_t i = 0; i < n; i++) {
        double xyz[3];
        assert_true(v[i].mu == problem_mu(&p)[v[i].place.triangle]);
        bench_ok(p.b, dmk_mesh_point_xyz(p.b->ctx, p.mesh, &v[i].place, xyz));
        for (int k = 0; k < 3; k++) assert_true(fabs(xyz[k] - v[i].xyz[k]) < 1e-12);
    }
    dmk_locus_destroy(&locus);
    problem_free(&p);
}

static char *whole_file(const char *path, size_t *n)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    *n = (size_t)ftell(file);
    rewind(file);
    char *text = calloc(*n + 1, 1);
    assert_non_null(text);
    assert_int_equal(fread(text, 1, *n, file), *n);
    fclose(file);
    return text;
}

/* As a table: the distances are lengths from the path's beginning. */
static void check_table(const char *text, const dmk_path *path)
{
    double before = -1, distance = 0;
    for (size_t i = 0; i < path->n; i++) {
        text = strchr(text, '\n') + 1;
        assert_int_equal(
            sscanf(text, "%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%lf", &distance), 1);
        assert_true(distance > before);
        before = distance;
    }
    assert_true(fabs(distance - path->length) < 1e-12 * path->length);
    assert_string_equal(strchr(text, '\n'), "\n");
}

/* As lines: of each two points one after the other. */
static void check_lines(const char *text, const dmk_path *path)
{
    char count[60];
    snprintf(count, sizeof count, "NumberOfVerts=\"0\" NumberOfLines=\"%zu\"", path->n - 1);
    assert_non_null(strstr(text, count));
    const char *lines = strstr(strstr(text, "<Lines>"), "offset=\"");
    const char *data = strstr(text, "<AppendedData");
    assert_non_null(data);
    data = strchr(data, '_') + 1 + strtol(lines + 8, NULL, 10) + sizeof(uint64_t);
    for (size_t i = 0; i + 1 < path->n; i++) {
        int32_t end[2];
        memcpy(end, data + i * sizeof end, sizeof end);
        assert_true(end[0] == (int32_t)i && end[1] == (int32_t)i + 1);
    }
}

static void a_path_is_written_in_order(void **state)
{
    problem p = solved(state);
    const dmk_point to = {1234, {0.2, 0.3, 0.5}};
    dmk_path path;
    bench_ok(p.b, dmk_path_compute(p.b->ctx, p.mesh, p.result, 1, &to, &path));
    assert_true(path.n > 10);
    const struct {
        const char *name;
        void (*check)(const char *text, const dmk_path *path);
    } formats[] = {{"path.csv", check_table}, {"path.vtp", check_lines}};
    for (int i = 0; i < 2; i++) {
        char file[300];
        size_t n;
        snprintf(file, sizeof file, "%s/%s", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp",
                 formats[i].name);
        bench_ok(p.b, dmk_path_write(p.b->ctx, p.mesh, &path, file));
        char *text = whole_file(file, &n);
        formats[i].check(text, &path);
        free(text);
        unlink(file);
    }
    dmk_path_free(&path);
    problem_free(&p);
}

/* The mesh of a file with its triangles in the opposite order, which is not that of the device. */
static problem backwards(bench *b, const char *path)
{
    problem file = problem_file(b, path);
    const size_t n = problem_triangles(&file);
    const int32_t *triangle = dmk_mesh_triangles(file.mesh);
    int32_t *back = malloc(3 * n * sizeof *back);
    assert_non_null(back);
    for (size_t t = 0; t < n; t++)
        memcpy(back + 3 * t, triangle + 3 * (n - 1 - t), 3 * sizeof *back);
    problem p = problem_create(b, problem_vertices(&file), dmk_mesh_vertices(file.mesh), n, back);
    free(back);
    problem_free(&file);
    return p;
}

/* Paths from a vertex leave in the directions of the distance on the user's mesh: both count from the same edge. */
static void check_directions(const problem *p, const dmk_result *result, const dmk_arrival *arrival)
{
    for (int32_t v = 0; v < 2000; v += 97) {
        dmk_point to;
        dmk_path path;
        bench_ok(p->b, dmk_mesh_vertex_point(p->b->ctx, p->mesh, v, &to));
        bench_ok(p->b, dmk_path_compute(p->b->ctx, p->mesh, result, 1, &to, &path));
        assert_true(fabs(path.angle - arrival[v].direction) < 1e-9);
        dmk_path_free(&path);
    }
}

static void directions_are_those_of_the_distance(void **state)
{
    problem p = backwards(*state, "tests/data/torus_5440.off.gz");
    for (int32_t source = 100; source < 103; source++) {
        dmk_geodesics *geodesics = NULL;
        dmk_result *again = NULL;
        bench_ok(p.b, dmk_mesh_vertex_point(p.b->ctx, p.mesh, source, &p.source));
        problem_solve(&p);
        bench_ok(p.b, dmk_geodesics_create(p.b->ctx, p.mesh, 1, &p.source, NULL, &geodesics));
        check_directions(&p, p.result, dmk_geodesics_arrivals(geodesics, NULL));
        const dmk_result_data data = result_data(p.result);
        bench_ok(p.b, dmk_result_restore(p.b->ctx, p.mesh, &data, &again));
        check_directions(&p, again, dmk_geodesics_arrivals(geodesics, NULL));
        dmk_result_destroy(&again);
        dmk_geodesics_destroy(&geodesics);
    }
    problem_free(&p);
}

/* Of the ends of several paths the one without a path is named: here on the second of two tetrahedra. */
static void the_end_without_a_path_is_named(void **state)
{
    bench *b = *state;
    double xyz[24] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    int32_t triangle[24] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    for (int i = 0; i < 12; i++) xyz[12 + i] = xyz[i] + 5, triangle[12 + i] = triangle[i] + 4;
    problem p = problem_create(b, 8, xyz, 8, triangle);
    problem_solve(&p);
    for (int bad = 0; bad < 3; bad++) {
        dmk_point to[3] = {{1, {1, 0, 0}}, {2, {0, 1, 0}}, {3, {0.5, 0.5, 0}}};
        dmk_path path[3];
        to[bad].triangle = 4 + bad;
        assert_int_equal(dmk_path_compute(b->ctx, p.mesh, p.result, 3, to, path), DMK_E_ARG);
        char word[64];
        snprintf(word, sizeof word, "the end of the path in triangle %d is not on the component",
                 4 + bad);
        if (!strstr(dmk_context_message(b->ctx), word)) fail_msg("%s", dmk_context_message(b->ctx));
    }
    problem_free(&p);
}

/* Whoever goes from 0 to the length meets no NULL: of density_only, and of distances that are exact. */
static void what_is_not_there_has_length_0(void **state)
{
    problem p = problem_file(*state, "tests/data/torus_5440.off.gz");
    p.options.density_only = 1;
    problem_solve(&p);
    size_t n_distance = 1, n_acl = 1, n_error = 1, n_density = 1;
    assert_null(dmk_result_distance(p.result, &n_distance));
    assert_null(dmk_result_acl(p.result, &n_acl));
    assert_non_null(dmk_result_density(p.result, &n_density));
    dmk_geodesics *geodesics = NULL;
    bench_ok(p.b, dmk_geodesics_create(p.b->ctx, p.mesh, 1, &p.source, NULL, &geodesics));
    assert_null(dmk_geodesics_error(geodesics, &n_error));
    assert_int_equal(n_distance + n_acl + n_error, 0);
    assert_int_equal(n_density, 5440);
    dmk_geodesics_destroy(&geodesics);
    problem_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(potential_is_minus_the_distance_and_a_constant),
        cmocka_unit_test(midpoints_lie_between_their_ends),
        cmocka_unit_test(the_source_is_given_back),
        cmocka_unit_test(a_vertex_is_one_source_by_any_triangle),
        cmocka_unit_test(lengths_need_not_be_asked_for),
        cmocka_unit_test(a_result_is_restored),
        cmocka_unit_test(the_locus_has_the_density_of_its_triangles),
        cmocka_unit_test(a_path_is_written_in_order),
        cmocka_unit_test(directions_are_those_of_the_distance),
        cmocka_unit_test(the_end_without_a_path_is_named),
        cmocka_unit_test(what_is_not_there_has_length_0),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
