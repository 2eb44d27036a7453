#include "solving.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void bench_ok(const bench *b, int rc)
{
    if (rc != DMK_OK) fail_msg("%d: %s", rc, dmk_context_message(b->ctx));
}

void bench_open(bench *b, const dmk_device_options *options)
{
    dmk_device_options plain;
    dmk_device_options_init(&plain, sizeof plain);
    assert_int_equal(dmk_context_create(&b->ctx), DMK_OK);
    bench_ok(b, dmk_device_open(b->ctx, options ? options : &plain, &b->dev));
}

void bench_close(bench *b)
{
    dmk_device_destroy(&b->dev);
    dmk_context_destroy(&b->ctx);
}

int bench_setup(void **state)
{
    static bench b;
    bench_open(&b, NULL);
    *state = &b;
    return 0;
}

int bench_teardown(void **state)
{
    bench_close(*state);
    return 0;
}

problem problem_of(bench *b, dmk_mesh *mesh)
{
    problem p = {.b = b, .mesh = mesh, .source = {.weight = {1, 0, 0}}};
    dmk_mesh_get_info(mesh, &p.info);
    bench_ok(b, dmk_solver_create(b->ctx, b->dev, mesh, &p.solver));
    bench_ok(b, dmk_mesh_vertex_point(b->ctx, mesh, 0, &p.source));
    dmk_solve_options_init(&p.options, sizeof p.options);
    return p;
}

problem problem_file(bench *b, const char *path)
{
    dmk_mesh *mesh = NULL;
    bench_ok(b, dmk_mesh_read(b->ctx, path, &mesh));
    return problem_of(b, mesh);
}

problem problem_create(bench *b, size_t n_vertices, const double *xyz, size_t n_triangles,
                       const int32_t *triangles)
{
    dmk_mesh *mesh = NULL;
    bench_ok(b, dmk_mesh_create(b->ctx, n_vertices, xyz, n_triangles, triangles, &mesh));
    return problem_of(b, mesh);
}

problem problem_surface(bench *b, const dmk_surface_options *options)
{
    dmk_mesh *mesh = NULL;
    bench_ok(b, dmk_mesh_surface(b->ctx, options, &mesh));
    return problem_of(b, mesh);
}

int problem_try(problem *p)
{
    dmk_result_destroy(&p->result);
    int rc = dmk_solve(p->b->ctx, p->solver, &p->source, &p->options, &p->result);
    if (rc == DMK_OK)
        dmk_result_get_stats(p->result, &p->stats);
    else
        assert_null(p->result);
    return rc;
}

void problem_solve(problem *p)
{
    bench_ok(p->b, problem_try(p));
    size_t n;
    const double *mu = dmk_result_density(p->result, &n);
    assert_int_equal(n, problem_triangles(p));
    for (size_t t = 0; t < n; t++) assert_true(mu[t] >= 0 && isfinite(mu[t]));
    assert_true(p->stats.cost_lower > 0 && p->stats.cost_lower <= p->stats.cost_upper);
    assert_true(p->stats.steps > 0);
}

void problem_free(problem *p)
{
    dmk_result_destroy(&p->result);
    dmk_solver_destroy(&p->solver);
    dmk_mesh_destroy(&p->mesh);
}

size_t problem_triangles(const problem *p)
{
    return p->info.n_triangles;
}
size_t problem_vertices(const problem *p)
{
    return p->info.n_vertices;
}

const double *problem_mu(const problem *p)
{
    return dmk_result_density(p->result, NULL);
}
const double *problem_distance(const problem *p)
{
    return dmk_result_distance(p->result, NULL);
}

double problem_area(const problem *p, size_t triangle)
{
    const double *x = dmk_mesh_vertices(p->mesh);
    const int32_t *t = dmk_mesh_triangles(p->mesh) + 3 * triangle;
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
        a[k] = x[3 * t[1] + k] - x[3 * t[0] + k];
        b[k] = x[3 * t[2] + k] - x[3 * t[0] + k];
    }
    return 0.5 * sqrt(pow(a[1] * b[2] - a[2] * b[1], 2) + pow(a[2] * b[0] - a[0] * b[2], 2) +
                      pow(a[0] * b[1] - a[1] * b[0], 2));
}

double problem_l1(const problem *p, const double *exact)
{
    const double *mu = problem_mu(p);
    double error = 0, all = 0;
    for (size_t t = 0; t < problem_triangles(p); t++) {
        double area = problem_area(p, t);
        error += area * fabs(mu[t] - exact[t]);
        all += area * exact[t];
    }
    return error / all;
}

double *problem_keep_mu(const problem *p)
{
    size_t bytes = problem_triangles(p) * sizeof(double);
    double *copy = malloc(bytes);
    assert_non_null(copy);
    memcpy(copy, problem_mu(p), bytes);
    return copy;
}

double *read_numbers(const char *path, size_t *n)
{
    size_t room = 1 << 14;
    double *x = malloc(room * sizeof *x);
    FILE *file = fopen(path, "r");
    if (!file) fail_msg("%s is missing", path);
    for (*n = 0; *n < room && fscanf(file, "%lf", x + *n) == 1; ++*n) {
    }
    assert_true(*n > 0 && *n < room);
    fclose(file);
    return x;
}

dmk_result_data result_data(const dmk_result *result)
{
    dmk_result_data data = {.density = dmk_result_density(result, NULL),
                            .potential = dmk_result_potential(result, NULL),
                            .potential_mid = dmk_result_potential_mid(result, NULL),
                            .distance = dmk_result_distance(result, NULL),
                            .acl = dmk_result_acl(result, NULL)};
    dmk_result_source(result, &data.source);
    dmk_result_get_stats(result, &data.stats);
    return data;
}
