/* The approximate cut locus by the rule that needs no tolerance, against the locus of a torus: with tube
 * radius 1 around a circle of radius 2 and the source (3, 0, 0) it is the inner equator, the meridian
 * opposite, and the outer equator within pi / sqrt(3) of the point opposite. */
#include "solving.h"

#include "solver/acl.h"

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

enum { GRID = 80 };

/* A flat sheet of GRID lines each way; those across x are `ratio` times as far apart at vertex 0 as at the end. */
static problem sheet(bench *b, double ratio)
{
    static double x[3 * GRID * GRID];
    static int32_t t[6 * (GRID - 1) * (GRID - 1)];
    double at[GRID] = {0};
    size_t n = 0;
    for (int i = 1; i < GRID; i++) at[i] = at[i - 1] + pow(ratio, 1 - (double)i / GRID);
    for (int i = 0; i < GRID * GRID; i++) {
        x[3 * i] = at[i % GRID];
        x[3 * i + 1] = i / GRID;
        x[3 * i + 2] = 0;
        if (i % GRID == GRID - 1 || i / GRID == GRID - 1) continue;
        const int32_t square[] = {i, i + 1, i + GRID + 1, i, i + GRID + 1, i + GRID};
        for (int k = 0; k < 6; k++) t[n++] = square[k];
    }
    return problem_create(b, (size_t)(GRID * GRID), x, n / 3, t);
}

/* No two shortest paths meet on a flat sheet: all that is marked are the rows in which rays end, 3.6 %. */
static void what_does_not_meet_is_not_marked(void **state)
{
    problem p = sheet(*state, 1);
    problem_solve(&p);
    const uint8_t *acl = dmk_result_acl(p.result, NULL);
    double marked = 0, all = 0;
    for (size_t t = 0; t < problem_triangles(&p); t++) {
        all += problem_area(&p, t);
        if (acl[t]) marked += problem_area(&p, t);
    }
    if (!(marked <= 0.042 * all)) fail_msg("%g of the area is marked", marked / all);
    problem_free(&p);
}

/* Two families of parallel rays that meet at the angle 2 `half` on the line y = middle. */
static double roof(double half, const double x[3])
{
    return sin(half) * fabs(x[1] - (GRID / 2 - 0.5)) - cos(half) * x[0];
}

/* Marked triangles along such a line whose size is below, and not below, 1.2 times the mean. */
static void mark_roof(bench *b, double half, double share[2])
{
    problem p = sheet(b, 30);
    const dmk_mesh *m = p.mesh;
    const size_t nt = problem_triangles(&p);
    double *u = calloc((size_t)(m->n_vertices + m->n_edges), sizeof *u);
    double marked[2] = {0}, all[2] = {0}, area = 0;
    uint8_t *acl = malloc(nt);
    assert_true(u && acl);
    for (int32_t v = 0; v < m->n_vertices; v++) u[v] = roof(half, m->xyz + 3 * v);
    for (int32_t e = 0; e < m->n_edges; e++) {
        double mid[3];
        const int32_t *v = m->edge_vertex + 2 * e;
        for (int k = 0; k < 3; k++) mid[k] = (m->xyz[3 * v[0] + k] + m->xyz[3 * v[1] + k]) / 2;
        u[m->n_vertices + e] = roof(half, mid);
    }
    const dmk_acl_input in = {m, NULL, u, u + m->n_vertices};
    assert_int_equal(dmk_acl_mark(b->ctx, &in, 0, acl), DMK_OK);
    for (size_t t = 0; t < nt; t++) area += m->area[t] / (double)nt;
    for (size_t t = 0; t < nt; t++) {
        double c[3];
        const int large = sqrt(m->area[t] / area) > 1.2;
        centre(&p, t, c);
        if (fabs(c[1] - (GRID / 2 - 0.5)) > 0.5) continue;
        all[large]++;
        marked[large] += acl[t];
    }
    for (int k = 0; k < 2; k++) share[k] = marked[k] / all[k];
    free(u);
    free(acl);
    problem_free(&p);
}

/* The fainter a line, the smaller must be the triangles in which it is marked. */
static void faint_lines_are_marked_in_small_triangles(void **state)
{
    double share[2];
    mark_roof(*state, 0.09, share);
    print_message("# faint: %g of the small, %g of the large\n", share[0], share[1]);
    assert_true(share[0] > 0.9 && share[1] < 0.1);
    mark_roof(*state, 0.2, share);
    print_message("# clear: %g of the small, %g of the large\n", share[0], share[1]);
    assert_true(share[0] == 1 && share[1] == 1);
    mark_roof(*state, 0.035, share);
    assert_true(share[0] == 0 && share[1] == 0);
}

/* ---- crests ------------------------------------------------------------------------------------ */

/* The same rays, but those of slope `half` turn over evenly within `blur` of a line y = at; half grows along x, by this
 * logarithm a unit, and is what it is called in the middle. */
typedef struct crease {
    double at, half, blur, growth;
} crease;

static double bent(const crease *c, int n, const double x[3])
{
    double sum = -x[0];
    for (int i = 0; i < n; i++) {
        const double y = fabs(x[1] - c[i].at), b = c[i].blur;
        sum += sin(c[i].half * exp(c[i].growth * (x[0] - GRID / 2.0))) *
               (y < b ? (y * y + b * b) / (2 * b) : y);
    }
    return sum;
}

typedef struct crest {
    double
        found; /* share of a line's middle third within 1.5 of which a triangle's centre is marked */
    double reach; /* the farthest from it of those within 8 */
} crest;

/* What is marked along the first of n lines on a sheet of unit squares, mu being `mu` times the root of a triangle's
 * area. */
static crest mark_creases(bench *b, const crease *c, int n, double mu)
{
    problem p = sheet(b, 1);
    const dmk_mesh *m = p.mesh;
    const size_t nt = problem_triangles(&p);
    double *u = calloc((size_t)(m->n_vertices + m->n_edges), sizeof *u),
           *density = calloc(nt, sizeof *density);
    uint8_t *acl = malloc(nt);
    bool seen[GRID] = {false};
    crest found = {0, 0};
    assert_true(u && density && acl);
    for (int32_t v = 0; v < m->n_vertices; v++) u[v] = bent(c, n, m->xyz + 3 * v);
    for (int32_t e = 0; e < m->n_edges; e++) {
        double mid[3];
        const int32_t *v = m->edge_vertex + 2 * e;
        for (int k = 0; k < 3; k++) mid[k] = (m->xyz[3 * v[0] + k] + m->xyz[3 * v[1] + k]) / 2;
        u[m->n_vertices + e] = bent(c, n, mid);
    }
    for (size_t t = 0; t < nt; t++) density[t] = mu * sqrt(m->area[t]);
    const dmk_acl_input in = {m, density, u, u + m->n_vertices};
    assert_int_equal(dmk_acl_mark(b->ctx, &in, 0, acl), DMK_OK);
    for (size_t t = 0; t < nt; t++) {
        double x[3];
        centre(&p, t, x);
        const double y = fabs(x[1] - c[0].at);
        if (!acl[t] || x[0] < GRID / 3 || x[0] > 2 * GRID / 3 || y > 8) continue;
        if (y <= 1.5) seen[(int)x[0]] = true;
        found.reach = fmax(found.reach, y);
    }
    for (int i = GRID / 3; i < 2 * GRID / 3; i++) found.found += 3.0 * seen[i] / GRID;
    free(u);
    free(density);
    free(acl);
    problem_free(&p);
    return found;
}

/* A line on which rays turn within two triangles is a crest of their convergence, however faint; where mu is large,
 * rays end far away; and beside a stronger one it is a part of that. */
static void crests_are_marked(void **state)
{
    const double y = GRID / 2 - 0.5;
    const crease clear = {y, 0.09, 1, 0}, faint = {y, 0.06, 1, 0}, wide = {y, 0.19, 2, 0},
                 level = {y, 0.14, 2, 0};
    const crease beside[2] = {{y, 0.12, 1, 0}, {y + 4, 0.17, 1, 0}},
                 apart_from[2] = {clear, {y + 8, 0.3, 1, 0}};
    /* Where rays part on both sides, a line on which they hardly meet is a crest, too. */
    const crease parted[3] = {faint, {y - 4, -0.1, 2, 0}, {y + 4, -0.1, 2, 0}};
    /* The locus' end, and rays that focus before they meet: a ninth of that line is marked. */
    const crease slow = {y, 0.35, 2, -0.06}, fast = {y, 0.35, 2, -0.11};
    const struct {
        const crease *line;
        int n;
        double mu, found, reach;
    } cases[] = {{&clear, 1, 20, 1, 0.2},  {&clear, 1, 35, 0, 0},  {&faint, 1, 1, 0, 0},
                 {&wide, 1, 1, 1, 0.9},    {&level, 1, 1, 0, 0},   {beside, 2, 1, 0, 4.2},
                 {apart_from, 2, 1, 1, 8}, {parted, 3, 1, 1, 0.2}, {&slow, 1, 1, 1, 0.2},
                 {&fast, 1, 1, 0.11, 0.2}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const crest c = mark_creases(*state, cases[i].line, cases[i].n, cases[i].mu);
        print_message("# %g of the line found, up to %g beside\n", c.found, c.reach);
        if (!(fabs(c.found - cases[i].found) < 0.02 && c.reach <= cases[i].reach))
            fail_msg("case %zu: %g found, %g beside", i, c.found, c.reach);
    }
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
        cmocka_unit_test(what_does_not_meet_is_not_marked),
        cmocka_unit_test(faint_lines_are_marked_in_small_triangles),
        cmocka_unit_test(crests_are_marked),
        cmocka_unit_test(the_rule_knows_no_unit),
    };
    return cmocka_run_group_tests(tests, bench_setup, bench_teardown);
}
