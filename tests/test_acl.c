/* The approximate cut locus by the rule that needs no tolerance, against the locus of a torus: with tube
 * radius 1 around a circle of radius 2 and the source (3, 0, 0) it is the inner equator, the meridian
 * opposite, and the outer equator within pi / sqrt(3) of the point opposite. */
#include "solving.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>

static const double PI = 3.14159265358979323846;

typedef struct score {
    double
        missed; /* share of the locus farther than 1.5 edges from the centre of a marked triangle */
    double false_area; /* share of the marked area farther than 3 edges from the locus */
} score;

/* Points of the locus; its weak ends, where the rays meet at small angles, are left out unless `whole`. */
static size_t locus_points(bool whole, double (*x)[3])
{
    size_t n = 0;
    for (int i = 0; i < 400; i++) {
        const double a = 2 * PI * i / 400, c = cos(a), s = sin(a);
        const double tip = PI / sqrt(3) * (whole ? 1 : 0.8), b = PI + tip * (2 * i / 399.0 - 1);
        const double points[3][3] = {{c, s, 0}, {-2 + c, 0, s}, {3 * cos(b), 3 * sin(b), 0}};
        for (int k = 0; k < 3; k++, n++) {
            for (int j = 0; j < 3; j++) x[n][j] = points[k][j];
        }
    }
    return n;
}

static double apart(const double *a, const double *b)
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void centre(const problem *p, size_t t, double c[3])
{
    const double *x = dmk_mesh_vertices(p->mesh);
    const int32_t *v = dmk_mesh_triangles(p->mesh) + 3 * t;
    for (int k = 0; k < 3; k++) c[k] = (x[3 * v[0] + k] + x[3 * v[1] + k] + x[3 * v[2] + k]) / 3;
}

static score judge(const problem *p)
{
    static double x[1200][3];
    const uint8_t *acl = dmk_result_acl(p->result, NULL);
    const double h = p->info.mean_edge;
    double marked = 0, far = 0;
    size_t n = locus_points(true, x), missed = 0, nt = problem_triangles(p);
    for (size_t t = 0; t < nt; t++) {
        double c[3], nearest = INFINITY;
        if (!acl[t]) continue;
        centre(p, t, c);
        for (size_t i = 0; i < n; i++) nearest = fmin(nearest, apart(x[i], c));
        marked += problem_area(p, t);
        if (nearest > 3 * h) far += problem_area(p, t);
    }
    n = locus_points(false, x);
    for (size_t i = 0; i < n; i++) {
        bool found = false;
        for (size_t t = 0; t < nt && !found; t++) {
            double c[3];
            if (!acl[t]) continue;
            centre(p, t, c);
            found = apart(x[i], c) <= 1.5 * h;
        }
        missed += !found;
    }
    return (score){(double)missed / (double)n, far / marked};
}

static problem torus(bench *b)
{
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "torus";
    o.n_triangles = 20000;
    o.has_source = 1;
    o.source[0] = 3;
    return problem_surface(b, &o);
}

static void the_rule_marks_the_locus(void **state)
{
    problem p = torus(*state);
    problem_solve(&p);
    const score s = judge(&p);
    print_message("# missed %.2g %%, false area %.2g %%\n", 100 * s.missed, 100 * s.false_area);
    if (!(s.missed <= 0.02 && s.false_area <= 0.01)) {
        fail_msg("missed %g, false area %g", s.missed, s.false_area);
    }
    problem_free(&p);
}

/* The marks do not change with the unit of length. */
static void the_rule_knows_no_unit(void **state)
{
    problem p = torus(*state);
    const size_t nv = problem_vertices(&p), nt = problem_triangles(&p);
    double *x = malloc(3 * nv * sizeof *x);
    assert_non_null(x);
    for (size_t i = 0; i < 3 * nv; i++) x[i] = 1024 * dmk_mesh_vertices(p.mesh)[i];
    problem q = problem_create(*state, nv, x, nt, dmk_mesh_triangles(p.mesh));
    problem_solve(&p);
    problem_solve(&q);
    assert_memory_equal(dmk_result_acl(p.result, NULL), dmk_result_acl(q.result, NULL), nt);
    problem_free(&p);
    problem_free(&q);
    free(x);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_rule_marks_the_locus),
        cmocka_unit_test(the_rule_knows_no_unit),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
