/* Loads on T/2 from measures on the surface: the integral of each hat function. All sums run in the order of
 * the mesh and of the lists, so the same measure gives the same bits. */
#include "solver/measure.h"

#include "base/parallel.h"
#include "geodesic/geodesic.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Masses, and measures, that differ by less than this part of their sum are equal but for rounding; what differs by
 * more does so in 13 digits, and the sums' own rounding is behind them. */
static const double balanced = 1e-12;

/* ---- what is refused -------------------------------------------------------------------------- */

typedef struct check {
    dmk_context *ctx;
    const dmk_mesh *mesh;
    const int32_t *component; /* per vertex; -1: in no triangle */
    const char *name;         /* of the measure */
    bool is_signed;
    int32_t *found; /* the component, -1 before the first mass */
} check;

/* A mass, or a density, of `what` number i on component c. */
static int check_one(const check *k, const char *what, int64_t i, double value, int32_t c)
{
    if (!isfinite(value) || (value < 0 && !k->is_signed)) {
        return dmk_fail(k->ctx, DMK_E_ARG,
                        "the %s measure: %s %lld has the value %g; expected a finite number%s",
                        k->name, what, (long long)i, value,
                        k->is_signed ? "" : " from 0 (one signed measure may be given alone)");
    }
    if (value == 0) return DMK_OK;
    if (c < 0) {
        return dmk_fail(k->ctx, DMK_E_ARG,
                        "the %s measure: %s %lld has mass, but is in no triangle", k->name, what,
                        (long long)i);
    }
    if (*k->found < 0) *k->found = c;
    if (c == *k->found) return DMK_OK;
    return dmk_fail(k->ctx, DMK_E_ARG,
                    "the %s measure: %s %lld lies on component %d, other mass on component %d; "
                    "nothing can be moved "
                    "between them, so transport each by itself",
                    k->name, what, (long long)i, (int)c, (int)*k->found);
}

/* That a point of `what` number i lies in the mesh. */
static int check_point(const check *k, const char *what, size_t i, const dmk_point *point)
{
    char name[64];
    if (dmk_point_check(k->ctx, k->mesh, what, point) == DMK_OK) return DMK_OK;
    snprintf(name, sizeof name, "the %s measure: %s %zu", k->name, what, i);
    return dmk_point_check(k->ctx, k->mesh, name, point);
}

static int check_points(const check *k, const dmk_measure *m)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < m->n_atoms; i++) {
        DMK_TRY(check_point(k, "atom", i, &m->atoms[i]));
        DMK_TRY(check_one(k, "atom", (int64_t)i, m->atom_mass ? m->atom_mass[i] : 1,
                          dmk_mesh_component(k->mesh, (int32_t)m->atoms[i].triangle)));
    }
    if (m->n_lines > 0 && m->line_first[0] != 0) {
        return dmk_fail(k->ctx, DMK_E_ARG, "the %s measure: its lines begin at %d; expected 0",
                        k->name, (int)m->line_first[0]);
    }
    for (size_t l = 0; l < m->n_lines; l++) {
        const double density = m->line_density ? m->line_density[l] : 1;
        if (m->line_first[l + 1] < m->line_first[l] + 2) {
            return dmk_fail(k->ctx, DMK_E_ARG, "the %s measure: line %zu has fewer than two points",
                            k->name, l);
        }
        for (int32_t i = m->line_first[l]; i < m->line_first[l + 1]; i++) {
            DMK_TRY(check_point(k, "a point of line", l, &m->line_points[i]));
            const int32_t c = dmk_mesh_component(k->mesh, (int32_t)m->line_points[i].triangle);
            DMK_TRY(check_one(k, "line", (int64_t)l, density, c));
        }
    }
done:
    return rc;
}

static int check_measure(const check *k, const dmk_measure *m)
{
    int rc = DMK_OK;
    if ((m->n_atoms > 0 && dmk_missing(k->ctx, "atoms", m->atoms)) ||
        (m->n_lines > 0 &&
         dmk_missing(k->ctx, "line_first", m->line_first, "line_points", m->line_points))) {
        return DMK_E_ARG;
    }
    if (dmk_measure_is_free(m) &&
        (m->vertex_mass || m->triangle_density || m->n_lines > 0 || m->uniform != 0)) {
        return dmk_fail(
            k->ctx, DMK_E_ARG,
            "the %s measure: its points without a mass take all that the other measure has, "
            "and leave nothing to its other parts",
            k->name);
    }
    for (int32_t v = 0; m->vertex_mass && v < k->mesh->n_vertices; v++)
        DMK_TRY(check_one(k, "vertex", v, m->vertex_mass[v], k->component[v]));
    for (int32_t t = 0; m->triangle_density && t < k->mesh->n_triangles; t++)
        DMK_TRY(check_one(k, "triangle", t, m->triangle_density[t],
                          dmk_mesh_component(k->mesh, (int32_t)t)));
    rc = check_points(k, m);
done:
    return rc;
}

/* The even part takes any component. */
static int check_even(const check *k, const dmk_measure *m)
{
    const int32_t anywhere = *k->found < 0 ? 0 : *k->found;
    return check_one(k, "the even part, number", 0, m->uniform, anywhere);
}

/* `part` of both measures, number `begin` first. */
static int check_both(check *k, const dmk_measure *const both[2], int begin,
                      int (*part)(const check *, const dmk_measure *))
{
    int rc = DMK_OK;
    for (int i = 0; i < 2 && rc == DMK_OK; i++) {
        const dmk_measure *m = both[i ^ begin];
        k->name = i ^ begin ? "second" : "first";
        if (m) rc = part(k, m);
    }
    return rc;
}

int dmk_measure_check(dmk_context *ctx, const dmk_mesh *mesh, const dmk_measure *from,
                      const dmk_measure *to, int32_t *component)
{
    int rc;
    int32_t *of_vertex = NULL;
    *component = -1;
    if (dmk_measure_is_free(from) && (!to || dmk_measure_is_free(to))) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "points without a mass take what the other measure has nearest to "
                        "them: the other measure is missing");
    }
    DMK_TRY(DMK_NEW(ctx, of_vertex, (size_t)mesh->n_vertices));
    for (int32_t v = 0; v < mesh->n_vertices; v++) of_vertex[v] = -1;
    for (int32_t t = 0; t < mesh->n_triangles; t++) {
        const int32_t c = dmk_mesh_component(mesh, t);
        for (int k = 0; k < 3; k++) of_vertex[mesh->triangle[3 * (size_t)t + (size_t)k]] = c;
    }
    const dmk_measure *both[2] = {from, to};
    check k = {ctx, mesh, of_vertex, NULL, !to, component};
    /* Masses show which component it is, before points that take them, and before the even parts, which take any. */
    DMK_TRY(check_both(&k, both, to && dmk_measure_is_free(from), check_measure));
    DMK_TRY(check_both(&k, both, 0, check_even));
    if (*component < 0) rc = dmk_fail(ctx, DMK_E_ARG, "the measures have no mass anywhere");
done:
    free(of_vertex);
    return rc;
}

/* ---- loads ------------------------------------------------------------------------------------ */

typedef struct load {
    dmk_context *ctx;
    const dmk_mesh *mesh; /* ordered */
    const dmk_order *order;
    dmk_vertex_stars stars;
    int32_t *number; /* new number of each triangle of the input, -1: not on the component */
    int32_t vertex_row;
    double *f;
    double *gross; /* the sum of the sizes of all that is added to f; NULL: not wanted */
} load;

static void add(const load *l, int32_t t, const double w[6], double factor)
{
    for (int k = 0; k < 3; k++) {
        l->f[l->vertex_row + l->mesh->triangle[3 * (size_t)t + (size_t)k]] += factor * w[k];
        l->f[l->mesh->triangle_edge[3 * (size_t)t + (size_t)k]] += factor * w[3 + k];
        if (l->gross) *l->gross += fabs(factor * w[k]) + fabs(factor * w[3 + k]);
    }
}

/* A density that is linear on triangle t, d at its corners times the triangle's area. */
static void add_linear(const load *l, int32_t t, const double d[3])
{
    const double node[6] = {
        d[0], d[1], d[2], 0.5 * (d[1] + d[2]), 0.5 * (d[2] + d[0]), 0.5 * (d[0] + d[1])};
    double w[6] = {0};
    for (int s = 0; s < 4; s++) {
        const int *at = dmk_quarter[s];
        const double sum = node[at[0]] + node[at[1]] + node[at[2]];
        for (int k = 0; k < 3; k++) w[at[k]] += (sum + node[at[k]]) / 48;
    }
    add(l, t, w, 1);
}

/* Masses at vertices: those of the piecewise linear density that has them. Areas are taken by each other, so that
 * masses may have any unit. */
static int add_vertices(const load *l, const double *mass)
{
    int rc;
    struct vertex {
        double mass, area; /* a third of its triangles'; then 1 over it */
    } *of = NULL;
    const dmk_mesh *m = l->mesh;
    DMK_TRY(DMK_NEW(l->ctx, of, (size_t)m->n_vertices));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const double third = m->area[t] / 3;
        for (int k = 0; k < 3; k++) of[m->triangle[3 * (size_t)t + (size_t)k]].area += third;
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        of[v] = (struct vertex){mass[l->order->vertex_old[v]], 1 / of[v].area};
    for (int32_t t = 0; t < m->n_triangles; t++) {
        double d[3];
        for (int k = 0; k < 3; k++) {
            const struct vertex *v = &of[m->triangle[3 * (size_t)t + (size_t)k]];
            d[k] = v->mass * (m->area[t] * v->area);
        }
        add_linear(l, t, d);
    }
done:
    free(of);
    return rc;
}

/* The weights of a point on the corners of triangle t, if it lies in it. */
static bool weights_in(const load *l, const dmk_point *p, int32_t t, double w[3])
{
    const int32_t *mine = l->mesh->triangle + 3 * (size_t)l->number[p->triangle];
    const int32_t *corner = l->mesh->triangle + 3 * (size_t)t;
    w[0] = w[1] = w[2] = 0;
    for (int k = 0; k < 3; k++) {
        int at = 0;
        if (p->weight[k] == 0) continue;
        while (at < 3 && corner[at] != mine[k]) at++;
        if (at == 3) return false;
        w[at] = p->weight[k];
    }
    return true;
}

/* A triangle that holds both points, with their weights there; -1: none does. */
static int32_t shared_triangle(const load *l, const dmk_point *p, const dmk_point *q, double a[3],
                               double b[3])
{
    const int32_t t = l->number[p->triangle];
    for (int k = 0; k < 3; k++) {
        if (p->weight[k] == 0) continue;
        const int32_t v = l->mesh->triangle[3 * (size_t)t + (size_t)k];
        for (int32_t i = l->stars.row[v]; i < l->stars.row[v + 1]; i++) {
            const int32_t s = l->stars.triangle[i] / 4;
            if (weights_in(l, p, s, a) && weights_in(l, q, s, b)) return s;
        }
    }
    return -1;
}

static double length_in(const dmk_mesh *m, int32_t t, const double a[3], const double b[3])
{
    double square = 0;
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double side = m->length[m->triangle_edge[3 * (size_t)t + (size_t)k]];
        square -= (b[i] - a[i]) * (b[j] - a[j]) * side * side;
    }
    return sqrt(fmax(square, 0));
}

/* A straight line from a to b in triangle t: hat functions of T/2 are linear between the lines b_k = 1/2. */
static void add_segment(const load *l, int32_t t, const double a[3], const double b[3],
                        double density)
{
    double cut[5] = {0, 1}, w[6], mass = density * length_in(l->mesh, t, a, b);
    int n = 2;
    for (int k = 0; k < 3; k++) {
        const double s = (0.5 - a[k]) / (b[k] - a[k]);
        if (s > 0 && s < 1) cut[n++] = s;
    }
    for (int i = 1; i < n; i++) { /* a handful: by insertion */
        for (int j = i; j > 0 && cut[j] < cut[j - 1]; j--) {
            const double swap = cut[j];
            cut[j] = cut[j - 1];
            cut[j - 1] = swap;
        }
    }
    for (int i = 0; i < n; i++) {
        double p[3];
        for (int k = 0; k < 3; k++) p[k] = a[k] + cut[i] * (b[k] - a[k]);
        dmk_point_weights(p, w);
        const double part =
            (i + 1 < n ? cut[i + 1] - cut[i] : 0) + (i > 0 ? cut[i] - cut[i - 1] : 0);
        add(l, t, w, 0.5 * part * mass);
    }
}

/* `name`: of the measure, as in errors. */
static int add_lines(load *l, const dmk_measure *m, const char *name)
{
    int rc = DMK_OK;
    if (m->n_lines > 0) DMK_TRY(dmk_vertex_stars_create(l->ctx, l->mesh, &l->stars));
    for (size_t k = 0; k < m->n_lines; k++) {
        const double density = m->line_density ? m->line_density[k] : 1;
        if (density == 0) continue; /* it may lie on another component */
        for (int32_t i = m->line_first[k]; i + 1 < m->line_first[k + 1]; i++) {
            double a[3], b[3];
            const int32_t t = shared_triangle(l, &m->line_points[i], &m->line_points[i + 1], a, b);
            if (t < 0) {
                rc =
                    dmk_fail(l->ctx, DMK_E_ARG,
                             "the %s measure: points %d and %d of line %zu lie in no common "
                             "triangle",
                             name, (int)(i - m->line_first[k]), (int)(i + 1 - m->line_first[k]), k);
                goto done;
            }
            add_segment(l, t, a, b, density);
        }
    }
done:
    return rc;
}

static void add_atom(const load *l, const dmk_point *p, double mass)
{
    double w[6];
    /* It may lie on another component. */
    if (mass == 0) return;
    dmk_point_weights(p->weight, w);
    add(l, l->number[p->triangle], w, mass);
}

/* What the load `other` has nearest to each point of m, by the exact distances to the mesh's vertices; edges
 * between two points' vertices are halved. */
static int add_free(const load *l, const dmk_measure *m, const double *other, double *mass)
{
    int rc;
    dmk_point *point = NULL;
    dmk_geodesics *geodesics = NULL;
    DMK_TRY(DMK_NEW(l->ctx, point, m->n_atoms));
    for (size_t i = 0; i < m->n_atoms; i++) {
        point[i] = m->atoms[i];
        point[i].triangle = l->number[point[i].triangle];
        mass[i] = 0;
    }
    DMK_TRY(dmk_geodesics_create(l->ctx, l->mesh, m->n_atoms, point, NULL, &geodesics));
    const dmk_arrival *arrival = dmk_geodesics_arrivals(geodesics, NULL);
    for (int32_t v = 0; v < l->mesh->n_vertices; v++)
        mass[arrival[v].source] += other[l->vertex_row + v];
    for (int32_t e = 0; e < l->mesh->n_edges; e++) {
        for (int k = 0; k < 2; k++)
            mass[arrival[l->mesh->edge_vertex[2 * (size_t)e + (size_t)k]].source] += 0.5 * other[e];
    }
    for (size_t i = 0; i < m->n_atoms; i++) add_atom(l, &m->atoms[i], mass[i]);
done:
    free(point);
    dmk_geodesics_destroy(&geodesics);
    return rc;
}

static int add_measure(load *l, const dmk_measure *m, const char *name)
{
    int rc = DMK_OK;
    double whole = 0;
    if (m->vertex_mass) DMK_TRY(add_vertices(l, m->vertex_mass));
    for (int32_t t = 0; m->uniform != 0 && t < l->mesh->n_triangles; t++) whole += l->mesh->area[t];
    for (int32_t t = 0; (m->triangle_density || whole > 0) && t < l->mesh->n_triangles; t++) {
        double mass = whole > 0 ? m->uniform * (l->mesh->area[t] / whole) : 0;
        if (m->triangle_density)
            mass += m->triangle_density[l->order->triangle_old[t]] * dmk_area_in_space(l->mesh, t);
        add_linear(l, t, (const double[3]){mass, mass, mass});
    }
    for (size_t i = 0; m->atom_mass && i < m->n_atoms; i++)
        add_atom(l, &m->atoms[i], m->atom_mass[i]);
    DMK_TRY(add_lines(l, m, name));
done:
    return rc;
}

/* The second measure, by another thread. */
typedef struct other {
    load l;
    const dmk_measure *measure;
} other;

static int add_other(dmk_context *own, void *data)
{
    other *o = data;
    o->l.ctx = own;
    const int rc = add_measure(&o->l, o->measure, "second");
    dmk_vertex_stars_free(&o->l.stars);
    return rc;
}

static double sum_of(const double *f, size_t n)
{
    double sum = 0;
    for (size_t i = 0; i < n; i++) sum += f[i];
    return sum;
}

/* That a sum of masses has overflowed. */
static int too_large(dmk_context *ctx, const char *name)
{
    return dmk_fail(ctx, DMK_E_ARG, "the %s measure has more mass than a number can hold", name);
}

/* f = a signed measure over the half of its variation; 0 where it is rounding alone. */
static int balance_signed(dmk_context *ctx, size_t n, double *f, double gross, double *mass)
{
    double sum = sum_of(f, n), size = 0;
    for (size_t i = 0; i < n; i++) size += fabs(f[i]);
    if (!isfinite(gross)) return too_large(ctx, "first");
    if (fabs(sum) > balanced * gross) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "the signed measure has the total mass %.13g: expected 0, unless a second "
                        "measure is given",
                        sum);
    }
    const bool moves = size > balanced * gross;
    *mass = moves ? size / 2 : 0;
    for (size_t i = 0; i < n; i++) f[i] = moves ? f[i] / *mass : 0;
    return DMK_OK;
}

static int balance(dmk_context *ctx, size_t n, bool normalise, double *f, const double *g,
                   double *mass)
{
    const double a = sum_of(f, n), b = sum_of(g, n);
    *mass = a;
    if (!isfinite(a) || !isfinite(b)) return too_large(ctx, isfinite(a) ? "second" : "first");
    if (!(a > 0 && b > 0)) {
        return dmk_fail(ctx, DMK_E_ARG, "the %s measure has no mass", a > 0 ? "second" : "first");
    }
    if (!normalise && fabs(a - b) > balanced * a + balanced * b) {
        return dmk_fail(ctx, DMK_E_ARG,
                        "the masses differ: %.13g to be moved, %.13g at the target; make them "
                        "equal, or ask for the "
                        "second to be scaled (normalise)",
                        a, b);
    }
    double moved = 0;
    for (size_t i = 0; i < n; i++) {
        f[i] = f[i] / a - g[i] / b;
        moved += fabs(f[i]);
    }
    if (moved < balanced * 2) memset(f, 0, n * sizeof *f); /* of two masses of 1 */
    return DMK_OK;
}

int dmk_measure_load(dmk_context *ctx, size_t n_triangles, const dmk_order *order,
                     const dmk_system *s, const dmk_measure *from, const dmk_measure *to,
                     bool normalise, double *f, double *mass, double *atom_mass)
{
    int rc;
    const size_t n = (size_t)s->whole.n_rows_pad;
    load l = {
        .ctx = ctx, .mesh = order->mesh, .order = order, .vertex_row = s->whole.vertex_row, .f = f};
    double *g = NULL, gross = 0;
    dmk_task task = {0};
    if (!to) l.gross = &gross;
    DMK_TRY(DMK_NEW(ctx, g, n));
    DMK_TRY(DMK_NEW(ctx, l.number, n_triangles));
    for (size_t t = 0; t < n_triangles; t++) l.number[t] = -1;
    for (int32_t t = 0; t < order->mesh->n_triangles; t++) l.number[order->triangle_old[t]] = t;
    memset(f, 0, n * sizeof *f);
    other second = {l, to};
    second.l.f = g;
    if (to) dmk_task_begin(ctx, &task, add_other, &second);
    rc = add_measure(&l, from, "first");
    DMK_TRY(dmk_task_end(ctx, &task, rc));
    l.f = g;
    if (to && dmk_measure_is_free(to)) DMK_TRY(add_free(&l, to, f, atom_mass));
    l.f = f;
    if (dmk_measure_is_free(from)) DMK_TRY(add_free(&l, from, g, atom_mass));
    rc = to ? balance(ctx, n, normalise, f, g, mass) : balance_signed(ctx, n, f, gross, mass);
done:
    free(g);
    free(l.number);
    dmk_vertex_stars_free(&l.stars);
    return rc;
}
