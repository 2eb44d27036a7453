/* What tests of the solver share: a device, a mesh with its solver, solves that must succeed. */
#ifndef TEST_SOLVING_H
#define TEST_SOLVING_H

#include "dmkcl.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

typedef struct bench {
    dmk_context *ctx;
    dmk_device *dev;
} bench;

/* Group setup and teardown: a bench on the default device. */
int bench_setup(void **state);
int bench_teardown(void **state);
/* A device of its own options beside; the caller destroys it. */
void bench_open(bench *b, const dmk_device_options *options);
void bench_close(bench *b);
void bench_ok(const bench *b, int rc);

/* Its arrays, source and stats, borrowed. */
dmk_result_data result_data(const dmk_result *result);

typedef struct problem {
    bench *b;
    dmk_mesh *mesh;
    dmk_mesh_info info; /* of the mesh: asking goes through all of it */
    dmk_solver *solver;
    dmk_solve_options options; /* as _init leaves them; tests change them */
    dmk_point source;
    dmk_result *result; /* of the last solve */
    dmk_stats stats;    /* of the last solve */
} problem;

/* The problem takes the mesh; the source is vertex 0. */
problem problem_of(bench *b, dmk_mesh *mesh);
problem problem_file(bench *b, const char *path);
problem problem_create(bench *b, size_t n_vertices, const double *xyz, size_t n_triangles,
                       const int32_t *triangles);
problem problem_surface(bench *b, const dmk_surface_options *options);
/* Solve; a result of before is destroyed. problem_try gives the status; problem_solve wants DMK_OK
 * and checks what every result must satisfy. */
int problem_try(problem *p);
void problem_solve(problem *p);
void problem_free(problem *p);

size_t problem_triangles(const problem *p);
size_t problem_vertices(const problem *p);
const double *problem_mu(const problem *p);
const double *problem_distance(const problem *p);
double problem_area(const problem *p, size_t triangle);
/* sum |T| |mu - exact| / sum |T| exact; exact: one per triangle. */
double problem_l1(const problem *p, const double *exact);
/* A copy of mu, which the caller frees. */
double *problem_keep_mu(const problem *p);

/* Numbers of a text file in order, *n of them; the caller frees. */
double *read_numbers(const char *path, size_t *n);

#endif
