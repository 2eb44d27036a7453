/* The cut locus as a graph: place, ends and topology against exact loci; borders; sources anywhere.
 */
#include "base/sets.h"
#include "base/vec3.h"
#include "cut/cut.h"
#include "geodesic/finer.h"
#include "locus/cotree.h"
#include "context.h"

#include <math.h>
#include <sched.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static dmk_context *ctx;
static const double pi = 3.14159265358979323846;

typedef struct scene {
    dmk_mesh *mesh; /* in memory order */
    dmk_geodesics *geodesics;
    double h;
    dmk_point source;
} scene;

/* Take over a mesh, the source being given by its old triangle. */
static scene scene_of(dmk_mesh *mesh, dmk_point source)
{
    scene s = {0};
    dmk_order order;
    assert_int_equal(dmk_order_create(ctx, mesh, 0, &order), DMK_OK);
    s.source = source;
    for (int32_t t = 0; t < order.mesh->n_triangles; t++) {
        if (order.triangle_old[t] == source.triangle) s.source.triangle = t;
    }
    s.mesh = order.mesh;
    order.mesh = NULL;
    dmk_order_free(&order);
    dmk_mesh_destroy(&mesh);
    for (int32_t e = 0; e < s.mesh->n_edges; e++) s.h += s.mesh->length[e] / s.mesh->n_edges;
    assert_int_equal(dmk_geodesics_create(ctx, s.mesh, 1, &s.source, NULL, &s.geodesics), DMK_OK);
    return s;
}

static scene surface(const char *name, int refine, const double source[3])
{
    dmk_surface_options o;
    dmk_mesh *mesh = NULL;
    dmk_point p;
    dmk_surface_options_init(&o, sizeof o);
    o.name = name;
    o.refine = refine;
    memcpy(o.source, source, sizeof o.source);
    o.has_source = 1;
    if (dmk_mesh_surface(ctx, &o, &mesh) != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    assert_int_equal(dmk_mesh_vertex_point(ctx, mesh, 0, &p), DMK_OK);
    return scene_of(mesh, p);
}

static void free_scene(scene *s)
{
    dmk_geodesics_destroy(&s->geodesics);
    dmk_mesh_destroy(&s->mesh);
}

/* With this strength; 0: the default. */
static dmk_locus *trace_with(const scene *s, double strength)
{
    dmk_locus *l = NULL;
    const dmk_locus_options o = {.struct_size = sizeof o, .strength = strength};
    if (dmk_locus_trace(ctx, s->geodesics, &o, &l, NULL) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    return l;
}

static dmk_locus *trace(const scene *s)
{
    return trace_with(s, 0);
}

/* Whether the corners on which a point rests are among those of triangle t. */
static bool lies_in(const dmk_mesh *m, const dmk_point *p, int32_t t)
{
    for (int k = 0; k < 3; k++) {
        const int32_t v = m->triangle[3 * p->triangle + k], *c = m->triangle + 3 * t;
        if (p->weight[k] > 0 && v != c[0] && v != c[1] && v != c[2]) return false;
    }
    return true;
}

/* Every edge runs inside one triangle: both ends lie in it. */
static void check_segments(const scene *s, const dmk_locus *l)
{
    size_t n;
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    const dmk_locus_edge *e = dmk_locus_edges(l, &n);
    for (size_t i = 0; i < n; i++) {
        bool inside = false;
        for (int32_t t = 0; t < s->mesh->n_triangles && !inside; t++)
            inside = lies_in(s->mesh, &v[e[i].vertex[0]].place, t) &&
                     lies_in(s->mesh, &v[e[i].vertex[1]].place, t);
        assert_true(inside);
    }
}

/* What holds for every locus: counts agree with the arrays, polylines with the edges, kinds with degrees; edges have a
 * length, also where lines run through vertices of the mesh. */
static dmk_locus_info check_object(const dmk_locus *l)
{
    dmk_locus_info info;
    size_t n_vertices, n_edges, n_lines, used = 0;
    const int32_t *offset, *index = dmk_locus_polylines(l, &offset, &n_lines);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n_vertices);
    const dmk_locus_edge *e = dmk_locus_edges(l, &n_edges);
    dmk_locus_get_info(l, &info);
    assert_int_equal(n_vertices, info.n_vertices);
    assert_int_equal(n_edges, info.n_edges);
    assert_int_equal(n_lines, info.n_polylines);
    int32_t *degree = calloc(n_vertices + 1, sizeof *degree);
    double *strongest = calloc(n_vertices + 1, sizeof *strongest);
    for (size_t i = 0; i < n_edges; i++) {
        for (int k = 0; k < 2; k++) {
            double *of = &strongest[e[i].vertex[k]];
            degree[e[i].vertex[k]]++;
            *of = fmax(*of, e[i].strength);
        }
        const dmk_locus_vertex *a = &v[e[i].vertex[0]], *b = &v[e[i].vertex[1]];
        assert_true(dmk_distance(a->xyz, b->xyz) >= 1e-12 * a->distance);
    }
    for (size_t i = 0; i < n_vertices; i++) {
        const int kind[] = {DMK_LOCUS_POINT, DMK_LOCUS_END, DMK_LOCUS_ORDINARY, DMK_LOCUS_BRANCH};
        assert_int_equal(degree[i], v[i].degree);
        assert_int_equal(v[i].kind, kind[dmk_min_i(degree[i], 3)]);
        assert_true(degree[i] > 0 || n_vertices == 1);
        assert_true(fabs(v[i].place.weight[0] + v[i].place.weight[1] + v[i].place.weight[2] - 1) <
                    1e-12);
        assert_true(isfinite(v[i].distance) && v[i].strength >= 0);
        assert_true(degree[i] == 0 || v[i].strength == strongest[i]);
    }
    for (size_t i = 0; i < n_lines; i++) {
        used += (size_t)(offset[i + 1] - offset[i] - 1);
        for (int32_t k = offset[i] + 1; k < offset[i + 1] - 1; k++) {
            assert_int_equal(v[index[k]].degree, 2);
        }
    }
    assert_int_equal(used, n_edges);
    free(degree);
    free(strongest);
    return info;
}

/* ---- places --------------------------------------------------------------------------------- */

/* Distance from the exact locus of the torus R = 2, r = 1 seen from (3, 0, 0), in space. */
static double torus_error(const double *x)
{
    double rho = hypot(x[0], x[1]), phi = atan2(x[1], x[0]), tip = pi / sqrt(3);
    double inner = hypot(rho - 1, x[2]);
    double meridian = hypot(hypot(x[0] + 2, x[2]) - 1, x[1]);
    double outer = hypot(rho - 3, x[2]);
    if (x[0] > 0) meridian = HUGE_VAL;
    if (fabs(phi) < tip) {
        outer = hypot(hypot(x[0] - 3 * cos(tip), fabs(x[1]) - 3 * sin(tip)), x[2]);
    }
    return fmin(inner, fmin(meridian, outer));
}

static void check_torus(const dmk_locus *l, double h)
{
    dmk_locus_info info = check_object(l);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    double sum = 0;
    assert_int_equal(info.loops, 2);
    assert_int_equal(info.components, 1);
    assert_int_equal(info.endpoints, 2);
    assert_in_range(info.branch_points, 2, 4); /* four-valent ones, or pairs just beside */
    assert_true(fabs(info.length / 20.5331303505 - 1) < 0.02);
    for (size_t i = 0; i < info.n_vertices; i++) {
        double error = torus_error(v[i].xyz) / h;
        sum += error / (double)info.n_vertices;
        assert_true(error < 1.5);
        if (v[i].kind != DMK_LOCUS_END) continue;
        double x = v[i].xyz[0] - 3 * cos(pi / sqrt(3)),
               y = fabs(v[i].xyz[1]) - 3 * sin(pi / sqrt(3));
        assert_true(hypot(hypot(x, y), v[i].xyz[2]) < 2 * h);
    }
    assert_true(sum < 0.1);
}

static void test_torus(void **state)
{
    (void)state;
    scene s = surface("torus", 1, (double[3]){3, 0, 0});
    dmk_locus *l = trace(&s);
    check_torus(l, s.h);
    dmk_locus_info info;
    dmk_locus_get_info(l, &info);
    check_segments(&s, l);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* The same with the source inside a triangle and on an edge next to (3, 0, 0): the exact locus
 * moves by as little. */
static void test_source_anywhere(void **state)
{
    (void)state;
    const double weights[][3] = {{0.02, 0.03, 0.95}, {0, 0.02, 0.98}, {0.97, 0, 0.03}};
    for (int i = 0; i < 3; i++) {
        scene s = surface("torus", 1, (double[3]){3, 0, 0});
        int32_t t = (int32_t)s.source.triangle, corner = 0, big = i == 2 ? 0 : 2;
        while (s.source.weight[corner] < 0.5) corner++;
        for (int k = 0; k < 3; k++) s.source.weight[(corner + k) % 3] = weights[i][(big + k) % 3];
        s.source.triangle = t;
        dmk_locus *l = trace(&s);
        check_torus(l, s.h);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* Vertices off the torus by 5 % of an edge, in all directions: the same locus, on the mesh given. */
static void test_noise(void **state)
{
    (void)state;
    scene smooth = surface("torus", 1, (double[3]){3, 0, 0});
    const dmk_mesh *m = smooth.mesh;
    uint32_t random = 1;
    for (int32_t i = 0; i < 3 * m->n_vertices; i++) {
        double sum = 0; /* of twelve equal distributions, nearly normal */
        for (int k = 0; k < 12; k++) {
            random = random * 1664525u + 1013904223u;
            sum += random / 4294967296.0 - 0.5;
        }
        m->xyz[i] += 0.05 * smooth.h * sum;
    }
    dmk_mesh *mesh = NULL;
    int rc = dmk_mesh_create(ctx, (size_t)m->n_vertices, m->xyz, (size_t)m->n_triangles,
                             m->triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    scene s = scene_of(mesh, smooth.source);
    dmk_locus *l = trace(&s);
    check_torus(l, s.h);
    size_t n;
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        assert_int_equal(dmk_mesh_point_xyz(ctx, s.mesh, &v[i].place, x), DMK_OK);
        assert_true(hypot(hypot(x[0] - v[i].xyz[0], x[1] - v[i].xyz[1]), x[2] - v[i].xyz[2]) <
                    1e-12);
    }
    dmk_locus_destroy(&l);
    free_scene(&s);
    free_scene(&smooth);
}

static void check_point(const char *name, int refine, const double source[3])
{
    scene s = surface(name, refine, source);
    dmk_locus *l = trace(&s);
    dmk_locus_info info = check_object(l);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    assert_int_equal(info.n_vertices, 1);
    assert_int_equal(info.n_edges, 0);
    assert_int_equal(info.components, 1);
    assert_int_equal(v->kind, DMK_LOCUS_POINT);
    double x[3];
    dmk_mesh_point_xyz(ctx, s.mesh, &s.source, x);
    double d = hypot(hypot(v->xyz[0] + x[0], v->xyz[1] + x[1]), v->xyz[2] + x[2]);
    assert_true(d < 0.1 * s.h);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

static void test_point(void **state)
{
    (void)state;
    check_point("sphere", 1, (double[3]){0, 0, 1});
    check_point("sphere", 2, (double[3]){0.6, 0, 0.8});
    check_point("ellipsoid", 2, (double[3]){-sqrt(1.0 / 75), 0, sqrt(2.0 / 3)});
}

static void test_quartic(void **state)
{
    (void)state;
    scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    dmk_locus *l = trace(&s);
    dmk_locus_info info = check_object(l);
    assert_int_equal(info.loops, 0);
    assert_int_equal(info.components, 1);
    assert_int_equal(info.endpoints, 6);
    assert_true(fabs(info.length / 7.53604640 - 1) < 0.05);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* A sphere of radius 1 + sum of height * sin(phase + direction . x). */
typedef struct bump {
    double height, phase, direction[3];
} bump;

static scene bumpy_sphere(const bump bumps[6], int refine, const double source[3])
{
    dmk_surface_options o;
    dmk_mesh *ball = NULL, *mesh = NULL;
    dmk_point p;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "sphere";
    o.refine = refine;
    o.has_source = 1;
    memcpy(o.source, source, sizeof o.source);
    assert_int_equal(dmk_mesh_surface(ctx, &o, &ball), DMK_OK);
    for (int32_t v = 0; v < ball->n_vertices; v++) {
        double *x = ball->xyz + 3 * v, r = 1;
        for (int k = 0; k < 6; k++) {
            const double *d = bumps[k].direction;
            r += bumps[k].height * sin(bumps[k].phase + d[0] * x[0] + d[1] * x[1] + d[2] * x[2]);
        }
        for (int k = 0; k < 3; k++) x[k] *= r;
    }
    int rc = dmk_mesh_create(ctx, (size_t)ball->n_vertices, ball->xyz, (size_t)ball->n_triangles,
                             ball->triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    dmk_mesh_destroy(&ball);
    assert_int_equal(dmk_mesh_vertex_point(ctx, mesh, 0, &p), DMK_OK);
    return scene_of(mesh, p);
}

/* The number of ends is the same on finer meshes; the length is within 2 %. */
static void check_bumpy(const bump bumps[6], const double source[3], int refine, int ends,
                        double length)
{
    for (int finest = refine + 1; refine <= finest; refine++) {
        scene s = bumpy_sphere(bumps, refine, source);
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        assert_int_equal(info.loops, 0);
        assert_int_equal(info.components, 1);
        assert_int_equal(info.endpoints, ends);
        assert_int_equal(info.branch_points, ends - 2);
        assert_true(fabs(info.length / length - 1) < 0.02);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* Short branches, one of them of the strength of a third of a mesh edge on the coarser mesh. 1.3 million triangles
 * have 7 ends, too, of strength 0.003 or more, and the length 9.65; an eighth is of 0.0005 at most there, a tenth of
 * an edge, and less on finer meshes. */
static void test_narrow(void **state)
{
    static const bump bumps[6] = {
        {0.082, 4.37, {5.10, -6.39, 1.05}},   {0.061, 1.84, {-1.42, -1.13, -0.54}},
        {0.053, 0.01, {-5.05, -0.58, -2.16}}, {0.074, 6.11, {8.31, 0.56, -0.88}},
        {0.022, 1.87, {-0.70, -1.67, -2.64}}, {0.069, 1.97, {-0.98, 1.20, -0.60}},
    };
    (void)state;
    check_bumpy(bumps, (double[3]){-0.58, -0.07, -0.81}, 3, 7, 9.75);
}

/* A branch of a quarter of the whole length where geodesics have gone apart so much that its two leave the
 * source 0.02 radians from each other. */
static void test_hyperbolic(void **state)
{
    static const bump bumps[6] = {
        {-0.134, 5.95, {1.78, 0.65, 0.99}},  {-0.158, 4.24, {-0.26, 1.50, -2.39}},
        {0.411, 0.85, {3.20, -0.81, -0.52}}, {-0.022, 2.46, {-1.22, -1.87, -0.53}},
        {0.013, 4.03, {1.40, 0.57, 1.69}},   {-0.296, 1.44, {-1.37, 1.18, -0.89}},
    };
    (void)state;
    check_bumpy(bumps, (double[3]){-0.65, -0.44, -0.63}, 2, 5, 5.41);
}

/* ---- topology ------------------------------------------------------------------------------- */

/* The boundary of a plate of unit cubes, some of them left out, each face cut n by n. Corners that
 * coincide are found by their lattice place. */
typedef struct plate {
    int n, width, depth;
    int32_t *number; /* lattice place -> vertex, -1 */
    double *xyz;
    int32_t *triangle, n_vertices, n_triangles;
} plate;

static int32_t corner_of(plate *p, int x, int y, int z)
{
    int32_t *slot = p->number + ((z * (p->depth * p->n + 1)) + y) * (p->width * p->n + 1) + x;
    if (*slot < 0) {
        *slot = p->n_vertices++;
        double at[3] = {(double)x / p->n, (double)y / p->n, (double)z / p->n};
        memcpy(p->xyz + 3 * *slot, at, sizeof at);
    }
    return *slot;
}

/* The face of the unit cube at (x, y) towards `side`: 0, 1 +-x, 2, 3 +-y, 4, 5 +-z. */
static void add_face(plate *p, int x, int y, int side)
{
    int axis = side / 2, a = (axis + 1) % 3, b = (axis + 2) % 3, base[3] = {x, y, 0};
    for (int i = 0; i < p->n * p->n; i++) {
        int32_t c[4];
        for (int k = 0; k < 4; k++) {
            int at[3] = {base[0] * p->n, base[1] * p->n, 0};
            at[axis] += side % 2 == 0 ? p->n : 0;
            at[a] += i % p->n + (k == 1 || k == 2);
            at[b] += i / p->n + (k > 1);
            c[k] = corner_of(p, at[0], at[1], at[2]);
        }
        int32_t out[6] = {c[0], c[1], c[2], c[0], c[2], c[3]},
                in[6] = {c[0], c[2], c[1], c[0], c[3], c[2]};
        memcpy(p->triangle + 3 * p->n_triangles, side % 2 == 0 ? out : in, sizeof out);
        p->n_triangles += 2;
    }
}

/* In the second row each second cube is left out. */
static scene cubes(int width, int depth, int n, dmk_point source)
{
    plate p = {.n = n, .width = width, .depth = depth};
    size_t places = (size_t)((p.width * n + 1) * (p.depth * n + 1) * (n + 1));
    p.number = malloc(places * sizeof *p.number);
    p.xyz = malloc(3 * places * sizeof *p.xyz);
    p.triangle = malloc((size_t)(p.width * p.depth * 6 * n * n * 2 * 3) * sizeof *p.triangle);
    memset(p.number, -1, places * sizeof *p.number);
    for (int y = 0; y < p.depth; y++) {
        for (int x = 0; x < p.width; x++) {
            if (y == 1 && x % 2 == 1) continue;
            const int step[4][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}};
            for (int side = 0; side < 6; side++) {
                int u = side < 4 ? x + step[side][0] : -1, v = side < 4 ? y + step[side][1] : -1;
                bool inside =
                    u >= 0 && u < p.width && v >= 0 && v < p.depth && !(v == 1 && u % 2 == 1);
                if (!inside) add_face(&p, x, y, side);
            }
        }
    }
    dmk_mesh *mesh = NULL;
    int rc =
        dmk_mesh_create(ctx, (size_t)p.n_vertices, p.xyz, (size_t)p.n_triangles, p.triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(p.number);
    free(p.xyz);
    free(p.triangle);
    return scene_of(mesh, source);
}

/* A surface of genus `holes`. */
static scene plate_scene(int holes, int n)
{
    return cubes(2 * holes + 1, 3, n, (dmk_point){3, {0.3, 0.3, 0.4}});
}

/* Corners off by up to `size`, in all directions. */
static scene shaken(scene smooth, double size, uint32_t random)
{
    const dmk_mesh *m = smooth.mesh;
    dmk_mesh *mesh = NULL;
    for (int32_t i = 0; i < 3 * m->n_vertices; i++) {
        random = random * 1664525u + 1013904223u;
        m->xyz[i] += size * (random / 2147483648.0 - 1);
    }
    int rc = dmk_mesh_create(ctx, (size_t)m->n_vertices, m->xyz, (size_t)m->n_triangles,
                             m->triangle, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    scene s = scene_of(mesh, smooth.source);
    free_scene(&smooth);
    return s;
}

/* On coarse, rough meshes ends are led past forks, whose other branches stay connected all the same. */
static void test_connected(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < 400; i++) {
        scene s = shaken(plate_scene(i % 2, 1 + i / 2 % 2), 0.4 / (1 + i / 2 % 2), i);
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        if (info.components != 1 || info.loops != 2 * (i % 2))
            fail_msg("mesh %u: %zu pieces, %d loops", i, info.components, (int)info.loops);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* The largest difference in h between the distances of a locus' vertices, or of those in triangles alone, and the exact
 * ones of their places. */
static double distances_off(const scene *s, const dmk_locus *l, bool all)
{
    double most = 0;
    for (size_t i = 0; i < l->info.n_vertices; i++) {
        dmk_value exact;
        const dmk_locus_vertex *v = &l->vertex[i];
        if (!all && v->degree == 2) continue;
        assert_int_equal(dmk_geodesics_at(ctx, s->geodesics, 1, &v->place, &exact), DMK_OK);
        most = fmax(most, fabs(v->distance - exact.distance) / s->h);
    }
    return most;
}

/* From the middle of a cube's top the locus are the four edges down from it and the diagonals below. Each vertex tells
 * of the families that meet there, also where both ends of a crossed edge lie on the locus and know other ones. */
static void check_families(void)
{
    int n_below = 0;
    scene s = cubes(1, 1, 10, (dmk_point){910, {1, 0, 0}});
    dmk_locus *l = trace(&s);
    check_object(l);
    for (size_t i = 0; i < l->info.n_vertices; i++) {
        const dmk_locus_vertex *v = &l->vertex[i];
        const double r = fabs(v->xyz[0] - 0.5), aside = atan2(r, 2 - r);
        if (v->xyz[2] > 1e-9 || r < 0.06 || r > 0.44)
            continue; /* near its ends a line is averaged */
        assert_true(fabs(fabs(v->xyz[1] - 0.5) - r) < 1e-9);
        assert_true(fabs(v->meeting_angle - pi / 2 - 2 * aside) < 1e-9);
        assert_true(fabs(v->source_angle - pi / 2 + 2 * aside) < 1e-9);
        n_below++;
    }
    assert_int_equal(n_below, 28); /* seven on each of the four lines */
    assert_true(distances_off(&s, l, true) < 1e-9);
    dmk_locus_destroy(&l);
    free_scene(&s);
    s = surface("torus", 3, (double[3]){3, 0, 0});
    l = trace(&s);
    assert_true(distances_off(&s, l, false) < 0.06);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* From a corner of a cube the locus is the three edges and the three diagonals of faces at the opposite corner. It is
 * no point there, though it reaches hardly farther than what is fitted for one. The second face begins there. */
static void test_cube(void **state)
{
    (void)state;
    for (int n = 6; n <= 12; n += 2) {
        scene s = cubes(1, 1, n, (dmk_point){2 * n * n, {1, 0, 0}});
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        assert_int_equal(info.endpoints, 6);
        assert_true(info.length > 7.2426 - 22.0 / n && info.length < 7.2426);
        for (size_t i = 0; i < info.n_vertices; i++) {
            const double *x = l->vertex[i].xyz;
            const double a = 1 - x[0], b = 1 - x[1], c = 1 - x[2], most = dmk_max(a, dmk_max(b, c));
            const double least = fmin(a, fmin(b, c)), middle = a + b + c - most - least;
            if (least > 1e-9 || fmin(middle, most - middle) > 0.5 / n)
                fail_msg("(%g, %g, %g) is on none of the six lines", x[0], x[1], x[2]);
        }
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
    /* A cube of edges as long as its faces has a point where no less strength is asked for. */
    scene s = cubes(1, 1, 1, (dmk_point){2, {1, 0, 0}});
    dmk_locus *l = trace(&s);
    assert_int_equal(check_object(l).n_vertices, 1);
    dmk_locus_destroy(&l);
    l = trace_with(&s, 0.01 * s.h);
    const dmk_locus_info info = check_object(l);
    assert_int_equal(info.endpoints, 6);
    assert_true(info.length > 6 && info.length < 7.2426);
    dmk_locus_destroy(&l);
    free_scene(&s);
    s = cubes(1, 1, 4, (dmk_point){59, {0, 1, 0}}); /* from an edge: (0, 1/4, 1) */
    l = trace(&s);
    assert_true(check_object(l).length > 4);
    dmk_locus_destroy(&l);
    free_scene(&s);
    s = cubes(
        1, 1, 2,
        (dmk_point){
            5, {0.5, 0.5, 0}}); /* four branches meet at one vertex, and are no pair beside it */
    l = trace(&s);
    const dmk_locus_info four = check_object(l);
    int n_four = 0;
    for (size_t i = 0; i < four.n_vertices; i++) n_four += l->vertex[i].degree == 4;
    assert_int_equal(n_four, 1);
    assert_int_equal(four.endpoints, four.branch_points + 3);
    dmk_locus_destroy(&l);
    free_scene(&s);
    check_families();
}

/* The first triangle of a cube of twelve is cut into 3^k around its middle, so that nearly all edges are tiny. */
static scene uneven_cube(int k, dmk_point source)
{
    scene plain = cubes(1, 1, 1, (dmk_point){0, {1, 0, 0}});
    const size_t nt = (size_t)(11 + pow(3, k)), nv = 8 + (nt - 12) / 2;
    double *xyz = malloc(3 * nv * sizeof *xyz);
    int32_t *triangle = malloc(3 * nt * sizeof *triangle);
    memcpy(xyz, plain.mesh->xyz, 24 * sizeof *xyz);
    memcpy(triangle, plain.mesh->triangle, 36 * sizeof *triangle);
    int32_t v = 8, n = 12, parts = 1; /* of triangle 0: itself, and those from 12 on */
    for (int round = 0; round < k; round++, parts *= 3) {
        for (int32_t i = 0; i < parts; i++, v++) {
            int32_t *t = triangle + 3 * (i == 0 ? 0 : 11 + i);
            for (int j = 0; j < 3; j++)
                xyz[3 * v + j] = (xyz[3 * t[0] + j] + xyz[3 * t[1] + j] + xyz[3 * t[2] + j]) / 3;
            memcpy(triangle + 3 * n++, (int32_t[]){v, t[1], t[2]}, 3 * sizeof *triangle);
            memcpy(triangle + 3 * n++, (int32_t[]){t[0], v, t[2]}, 3 * sizeof *triangle);
            t[2] = v;
        }
    }
    dmk_mesh *mesh = NULL;
    if (dmk_mesh_create(ctx, nv, xyz, nt, triangle, &mesh) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(triangle);
    free_scene(&plain);
    return scene_of(mesh, source);
}

/* At a corner; on an edge, and where it is bisected; in a triangle, and in its middle. */
static const dmk_point uneven_source[] = {{5, {1, 0, 0}},
                                          {5, {0.7, 0.3, 0}},
                                          {5, {0, 0.5, 0.5}},
                                          {5, {0.2, 0.3, 0.5}},
                                          {5, {0.5, 0.25, 0.25}}};

/* Where edges are long beside the mean one the locus is that of the same surface with shorter ones, and in the
 * triangles and directions of the mesh: of the two at each place one is that of the shortest path. */
static void test_uneven(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof uneven_source / sizeof *uneven_source; i++) {
        scene s = uneven_cube(6, uneven_source[i]);
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        check_segments(&s, l);
        const double full = dmk_turn_around(s.geodesics, 0);
        if (i == 0) assert_int_equal(info.endpoints, 6);
        assert_true(info.length > 2 && info.length < 6);
        int n_off = 0;
        for (size_t j = 0; j < info.n_vertices; j++) {
            dmk_value value;
            const dmk_locus_vertex *v = &l->vertex[j];
            double xyz[3];
            assert_int_equal(dmk_mesh_point_xyz(ctx, s.mesh, &v->place, xyz), DMK_OK);
            assert_true(dmk_distance(xyz, v->xyz) < 1e-9);
            assert_int_equal(dmk_geodesics_at(ctx, s.geodesics, 1, &v->place, &value), DMK_OK);
            const double at = value.direction * 2 * pi / full;
            const double off = fmin(fabs(remainder(at - v->angle[0], 2 * pi)),
                                    fabs(remainder(at - v->angle[1], 2 * pi)));
            n_off += off > 0.05;
        }
        assert_true(4 * n_off <= (int)info.n_vertices); /* near forks there is a third family */
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* n unit squares and behind them m rectangles of 10 : 1. */
static scene strip_of(int n, int m)
{
    dmk_mesh *mesh = NULL;
    const size_t nv = 2 * (size_t)(n + m) + 2, nt = nv - 2;
    double *xyz = calloc(3 * nv, sizeof *xyz);
    int32_t *triangle = malloc(3 * nt * sizeof *triangle);
    for (int i = 0; i <= n + m; i++) {
        const int32_t a = 2 * i, two[6] = {a, a + 2, a + 3, a, a + 3, a + 1};
        xyz[6 * i] = xyz[6 * i + 3] = i <= n ? i : n + 10 * (i - n);
        xyz[6 * i + 4] = 1;
        if (i < n + m) memcpy(triangle + 6 * i, two, sizeof two);
    }
    if (dmk_mesh_create(ctx, nv, xyz, nt, triangle, &mesh) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(triangle);
    return scene_of(mesh, (dmk_point){40, {0.2, 0.3, 0.5}});
}

/* A tenth of the edges' length in edges of more than four mean ones asks for finer triangles, with none of more than
 * two: 0.13 here, then 0.07; and so do fewer than 5000 triangles. Distances stay. */
static void test_finer(void **state)
{
    (void)state;
    const int size[4][2] = {{2600, 57}, {2600, 29}, {2510, 0}, {2490, 0}};
    for (int i = 0; i < 4; i++) {
        dmk_finer f;
        scene s = strip_of(size[i][0], size[i][1]);
        assert_int_equal(dmk_finer_create(ctx, s.geodesics, &f), DMK_OK);
        assert_int_equal(f.mesh != NULL, i == 0 || i == 3);
        for (int32_t v = 0; v < s.mesh->n_vertices && f.mesh; v++)
            assert_true(fabs(f.geodesics->distance[v] - s.geodesics->distance[v]) < 1e-10);
        if (f.mesh) assert_true(f.mesh->info.max_edge < 2 * s.h && f.mesh->info.max_edge > s.h);
        dmk_finer_free(&f);
        free_scene(&s);
    }
}

/* Parts of a sliver may be flat though it is not itself: then there is no finer mesh. */
static void test_finer_sliver(void **state)
{
    (void)state;
    const double xyz[] = {0, 0, 0, 1, 0, 0, 0.5, 0.8, 0, 0.25, -2e-8, 0};
    const int32_t triangle[] = {0, 1, 2, 0, 3, 1};
    dmk_mesh *mesh = NULL;
    dmk_finer f;
    assert_int_equal(dmk_mesh_create(ctx, 4, xyz, 2, triangle, &mesh), DMK_OK);
    scene s = scene_of(mesh, (dmk_point){0, {0, 0, 1}});
    assert_int_equal(dmk_finer_create(ctx, s.geodesics, &f), DMK_OK);
    assert_null(f.mesh);
    dmk_finer_free(&f);
    dmk_locus *l = trace(&s);
    check_object(l);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

static void test_genus(void **state)
{
    (void)state;
    for (int genus = 0; genus < 4; genus++) {
        scene s = plate_scene(genus, 6);
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        assert_int_equal(info.loops, 2 * genus);
        assert_int_equal(info.components, 1);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* ---- borders -------------------------------------------------------------------------------- */

/* A cylinder of radius 1 and height 2 from n by n/3 squares, or the same strip left flat. */
static scene strip(int n, bool closed)
{
    int m = n / 3 + 1, columns = closed ? n : n + 1;
    double *xyz = malloc(3 * (size_t)(columns * m) * sizeof *xyz);
    int32_t *tri = malloc(6 * (size_t)(n * (m - 1)) * sizeof *tri), k = 0;
    for (int i = 0; i < columns; i++) {
        for (int j = 0; j < m; j++) {
            double a = 2 * pi * (i + 0.3 * (j % 2)) / n, *x = xyz + 3 * (i * m + j);
            x[0] = closed ? cos(a) : a;
            x[1] = closed ? sin(a) : 0;
            x[2] = 2.0 * j / (m - 1);
        }
    }
    for (int i = 0; i < n; i++) {
        for (int j = 0; j + 1 < m; j++) {
            int32_t a = i * m + j, b = (i + 1) % columns * m + j;
            int32_t six[6] = {a, b, b + 1, a, b + 1, a + 1};
            memcpy(tri + 6 * k++, six, sizeof six);
        }
    }
    dmk_mesh *mesh = NULL;
    int rc = dmk_mesh_create(ctx, (size_t)(columns * m), xyz, 2 * (size_t)k, tri, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(tri);
    return scene_of(mesh, (dmk_point){k, {0.2, 0.3, 0.5}});
}

/* Whether a point lies on a border, by its weights alone. */
static bool is_on_border(const dmk_mesh *m, const bool *border, const dmk_point *p)
{
    for (int k = 0; k < 3; k++) {
        const int64_t h = 3 * p->triangle + k;
        if (p->weight[k] == 0 && m->edge_triangle[2 * m->triangle_edge[h] + 1] < 0) return true;
        if (p->weight[k] == 1 && border[m->triangle[h]]) return true;
    }
    return false;
}

/* Of a disk the locus whose points on the border are one is a tree, also by what a file tells of it. */
static void check_disk(const scene *s, const dmk_locus *l)
{
    size_t n, n_edges;
    const dmk_mesh *m = s->mesh;
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    const dmk_locus_edge *edge = dmk_locus_edges(l, &n_edges);
    bool *border = calloc((size_t)m->n_vertices, sizeof *border);
    int32_t *parent = calloc(n + 1, sizeof *parent);
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * e + 1] >= 0) continue;
        border[m->edge_vertex[2 * e]] = border[m->edge_vertex[2 * e + 1]] = true;
    }
    for (size_t i = 0; i <= n; i++) parent[i] = (int32_t)i;
    for (size_t i = 0; i < n; i++) {
        if (is_on_border(m, border, &v[i].place)) dmk_set_unite(parent, (int32_t)i, (int32_t)n);
    }
    for (size_t i = 0; i < n_edges; i++) {
        const int32_t a = edge[i].vertex[0], b = edge[i].vertex[1];
        assert_true(dmk_set_unite(parent, a, b));
    }
    free(parent);
    free(border);
}

/* Rough ground: branches that the border cuts off have lines or none; no vertex lies alone, and no end inside a
 * triangle on the border. */
static void check_ground(void)
{
    enum { N = 12 };
    double xyz[3 * (N + 1) * (N + 1)];
    int32_t triangle[6 * N * N], n = 0;
    uint32_t random = 1;
    for (int v = 0; v < (N + 1) * (N + 1); v++) {
        const double place[3] = {v % (N + 1), v / (N + 1), 0}; /* half an edge up and down */
        for (int k = 0; k < 3; k++) {
            random = random * 1664525u + 1013904223u;
            xyz[3 * v + k] = place[k] + (k < 2 ? 0.15 : 0.8) * (random / 2147483648.0 - 1);
        }
    }
    for (int i = 0; i < N * N; i++) {
        const int32_t a = i / N * (N + 1) + i % N;
        const int32_t two[6] = {a, a + 1, a + N + 2, a, a + N + 2, a + N + 1};
        for (int k = 0; k < 6; k++) triangle[n++] = two[k];
    }
    for (int64_t t = 0; t < 2 * N * N; t += 20) {
        dmk_mesh *m = NULL;
        assert_int_equal(
            dmk_mesh_create(ctx, sizeof xyz / sizeof *xyz / 3, xyz, 2 * N * N, triangle, &m),
            DMK_OK);
        scene s = scene_of(m, (dmk_point){t, {0.3, 0.3, 0.4}});
        for (int all = 0; all < 2; all++) {
            dmk_locus *l = trace_with(&s, all ? 1e-9 * s.h : 0);
            const dmk_locus_info info = check_object(l);
            const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
            for (size_t i = 0; i < info.n_vertices; i++) assert_true(v[i].degree > 0);
            if (!all) check_disk(&s, l);
            dmk_locus_destroy(&l);
        }
        free_scene(&s);
    }
}

/* On the cylinder the locus is the opposite straight line, from border to border; on the flat strip
 * there is none. */
static void test_border(void **state)
{
    (void)state;
    scene s = strip(90, true);
    dmk_locus *l = trace(&s);
    dmk_locus_info info = check_object(l);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    double p[3];
    dmk_mesh_point_xyz(ctx, s.mesh, &s.source, p);
    assert_int_equal(info.loops, 0);
    assert_int_equal(info.components, 1);
    assert_int_equal(info.endpoints, 2);
    assert_true(fabs(info.length - 2) < 0.02);
    for (size_t i = 0; i < info.n_vertices; i++) {
        double opposite =
            hypot(v[i].xyz[0] + p[0] / hypot(p[0], p[1]), v[i].xyz[1] + p[1] / hypot(p[0], p[1]));
        assert_true(opposite < 0.1 * s.h);
        bool ends = fabs(v[i].xyz[2]) < 1e-12 || fabs(v[i].xyz[2] - 2) < 1e-12;
        assert_int_equal(v[i].kind, ends ? DMK_LOCUS_END : DMK_LOCUS_ORDINARY);
    }
    dmk_locus_destroy(&l);
    free_scene(&s);
    s = strip(60, false);
    l = trace(&s);
    info = check_object(l);
    assert_int_equal(info.n_vertices, 0);
    dmk_locus_destroy(&l);
    free_scene(&s);
    check_ground();
}

/* ---- paths ---------------------------------------------------------------------------------- */

static void point_xyz(const dmk_mesh *m, const dmk_point *p, double *x)
{
    assert_int_equal(dmk_mesh_point_xyz(ctx, m, p, x), DMK_OK);
}

/* From the source, edge by edge, to the point; as long as its pieces; no shorter than the chord; on
 * the sphere as long as the great circle, to the second order of the mesh. */
static void test_path(void **state)
{
    (void)state;
    enum { n = 20 };
    scene s = surface("sphere", 2, (double[3]){0, 0, 1});
    dmk_point to[n];
    dmk_path path[n];
    for (int i = 0; i < n; i++) {
        to[i] = (dmk_point){(s.mesh->n_triangles - 1) * (int64_t)i / (n - 1), {0.2, 0.3, 0.5}};
    }
    to[1].weight[0] = 1, to[1].weight[1] = to[1].weight[2] = 0;
    to[2].weight[0] = 0, to[2].weight[1] = 0.5;
    if (dmk_geodesics_paths(ctx, s.geodesics, n, to, path) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    for (int i = 0; i < n; i++) {
        double sum = 0, x[3], y[3];
        point_xyz(s.mesh, &path[i].point[0], x);
        assert_true(fabs(x[2] - 1) < 1e-12);
        for (size_t k = 1; k < path[i].n; k++) {
            point_xyz(s.mesh, &path[i].point[k], y);
            double piece = hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
            assert_true(piece < 3 * s.h);
            sum += piece;
            memcpy(x, y, sizeof x);
        }
        assert_int_equal(path[i].point[path[i].n - 1].triangle, to[i].triangle);
        assert_true(fabs(sum - path[i].length) < 1e-13);
        double circle = acos(x[2] / hypot(hypot(x[0], x[1]), x[2]));
        assert_true(fabs(path[i].length - circle) < s.h * s.h);
        dmk_path_free(&path[i]);
    }
    free_scene(&s);
}

/* Lengths of the paths to n points. */
static void path_lengths(const scene *s, int n, const dmk_point *to, double *length)
{
    dmk_path *path = malloc((size_t)n * sizeof *path);
    int rc = dmk_geodesics_paths(ctx, s->geodesics, (size_t)n, to, path);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    for (int i = 0; i < n; i++) {
        double sum = 0, x[3], y[3];
        for (size_t k = 0; k < path[i].n; k++, memcpy(x, y, sizeof x)) {
            point_xyz(s->mesh, &path[i].point[k], y);
            if (k > 0) sum += hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
        }
        assert_true(fabs(sum - path[i].length) < 1e-13 * (1 + sum));
        length[i] = path[i].length;
        dmk_path_free(&path[i]);
    }
    free(path);
}

/* Triangles (apex, i, i + 1) of a crown of n points on the unit circle, up and down by `height`,
 * each cut into k * k: flat but for the apex. */
static scene crown(int n, int k, double height)
{
    int32_t per = (k + 1) * (k + 2) / 2, n_triangles = 0;
    double *xyz = malloc(3 * (size_t)(n * per) * sizeof *xyz);
    int32_t *number = malloc((size_t)(n * per) * sizeof *number), n_vertices = 0;
    int32_t *tri = malloc(3 * (size_t)(n * k * k) * sizeof *tri);
    for (int s = 0; s < n; s++) {
        double a[2] = {2 * pi * s / n, 2 * pi * (s + 1) / n};
        for (int i = 0; i <= k; i++) {
            for (int j = 0; j <= i; j++) { /* the first of a row is the last of the side before */
                int32_t *slot = number + s * per + i * (i + 1) / 2 + j;
                if (i == 0 && s > 0)
                    *slot = number[0];
                else if (j == 0 && s > 0)
                    *slot = number[(s - 1) * per + i * (i + 1) / 2 + i];
                else if (i > 0 && j == i && s == n - 1)
                    *slot = number[i * (i + 1) / 2];
                else {
                    double p = (double)(i - j) / k, q = (double)j / k, *x = xyz + 3 * n_vertices;
                    x[0] = p * cos(a[0]) + q * cos(a[1]);
                    x[1] = p * sin(a[0]) + q * sin(a[1]);
                    x[2] = (s % 2 ? p - q : q - p) * height;
                    *slot = n_vertices++;
                }
            }
        }
        for (int i = 0; i < k; i++) {
            for (int j = 0; j <= i; j++) {
                const int32_t *up = number + s * per + i * (i + 1) / 2 + j, *down = up + i + 1;
                memcpy(tri + 3 * n_triangles++, (int32_t[3]){up[0], down[0], down[1]}, 12);
                if (j == i) continue;
                memcpy(tri + 3 * n_triangles++, (int32_t[3]){up[0], down[1], up[1]}, 12);
            }
        }
    }
    dmk_mesh *mesh = NULL;
    int rc = dmk_mesh_create(ctx, (size_t)n_vertices, xyz, (size_t)n_triangles, tri, &mesh);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    free(xyz);
    free(number);
    free(tri);
    return scene_of(mesh, (dmk_point){k * k / 2, {0.2, 0.3, 0.5}});
}

/* Polar coordinates about the crown's apex, angles counting the cone's own angle. */
static void crown_polar(const double *x, int n, double height, double *radius, double *angle)
{
    double sector = floor(atan2(x[1], x[0]) / (2 * pi / n) + (x[1] < 0 ? n : 0));
    double a[2][3];
    for (int i = 0; i < 2; i++) {
        double at = 2 * pi * (sector + i) / n;
        a[i][0] = cos(at);
        a[i][1] = sin(at);
        a[i][2] = fmod(sector + i, 2) > 0.5 ? height : -height;
    }
    double side = 1 + height * height, dot = 0, whole = 0;
    for (int k = 0; k < 3; k++) {
        dot += a[0][k] * x[k];
        whole += a[0][k] * a[1][k];
    }
    *radius = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
    *angle = sector * acos(whole / side) + acos(fmin(1, fmax(-1, dot / (*radius * sqrt(side)))));
}

/* Behind a vertex with far more than 2 pi around it all paths bend there. */
static void test_path_saddle(void **state)
{
    (void)state;
    enum { n = 10, n_points = 200 };
    const double height = 0.7;
    scene s = crown(n, 8, height);
    dmk_point to[n_points];
    double length[n_points], x[3], whole, r0, a0;
    int bent = 0;
    crown_polar((double[]){cos(-1e-12), sin(-1e-12), -height}, n, height, &r0, &whole);
    assert_true(whole > 2.5 * pi);
    point_xyz(s.mesh, &s.source, x);
    crown_polar(x, n, height, &r0, &a0);
    for (int i = 0; i < n_points; i++)
        to[i] =
            (dmk_point){(s.mesh->n_triangles - 1) * (int64_t)i / (n_points - 1), {0.1, 0.7, 0.2}};
    path_lengths(&s, n_points, to, length);
    for (int i = 0; i < n_points; i++) {
        double r, a;
        point_xyz(s.mesh, &to[i], x);
        crown_polar(x, n, height, &r, &a);
        double turn = fabs(a - a0);
        turn = fmin(turn, whole - turn);
        double exact = turn < pi ? sqrt(r * r + r0 * r0 - 2 * r * r0 * cos(turn)) : r + r0;
        bent += turn >= pi;
        assert_true(fabs(length[i] - exact) < 1e-12);
    }
    assert_true(bent > 20);
    /* They all leave in one direction, there is no cut locus. */
    dmk_locus *l = trace(&s);
    dmk_locus_info info = check_object(l);
    assert_int_equal(info.n_vertices, 0);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* From corner to corner over a box of 1 x 3 x 1: the hypotenuse of an unfolding, 3 and 1 + 1. */
static void test_path_box(void **state)
{
    (void)state;
    scene s = plate_scene(0, 5);
    dmk_point corner[2];
    const double at[2][3] = {{0, 0, 0}, {1, 3, 1}};
    double length;
    for (int i = 0; i < 2; i++)
        assert_int_equal(dmk_mesh_project(ctx, s.mesh, at[i], &corner[i]), DMK_OK);
    s.source = corner[0];
    dmk_geodesics_destroy(&s.geodesics);
    assert_int_equal(dmk_geodesics_create(ctx, s.mesh, 1, &s.source, NULL, &s.geodesics), DMK_OK);
    path_lengths(&s, 1, &corner[1], &length);
    assert_true(fabs(length - sqrt(13)) < 1e-13);
    free_scene(&s);
}

/* On a rough torus with and without holes: lengths to neighbouring points differ by no more than
 * their distance. Paths that are minimal only among their neighbours, or that a vertex has
 * diverted, break this. */
static void test_path_rough(void **state)
{
    (void)state;
    for (int holes = 0; holes < 2; holes++) {
        scene smooth = surface("torus", 0, (double[3]){3, 0, 0}), s;
        dmk_mesh *mesh = NULL, *m = smooth.mesh;
        int32_t n = 0, *tri = malloc(3 * (size_t)m->n_triangles * sizeof *tri);
        for (int32_t t = 0; t < m->n_triangles; t++) {
            const int32_t *v = m->triangle + 3 * t;
            if (holes && (v[0] % 150 == 99 || v[1] % 150 == 99 || v[2] % 150 == 99)) continue;
            memcpy(tri + 3 * n++, m->triangle + 3 * t, 3 * sizeof *tri);
        }
        for (int32_t i = 0; i < 3 * m->n_vertices; i++)
            m->xyz[i] += 0.15 * smooth.h * sin(1e5 * (i + 1.5) * (i + 1.5));
        int rc = dmk_mesh_create(ctx, (size_t)m->n_vertices, m->xyz, (size_t)n, tri, &mesh);
        if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
        s = scene_of(mesh, (dmk_point){0, {0.2, 0.3, 0.5}});
        enum { n_triangles = 60, per = 3 };
        dmk_point to[n_triangles * per];
        double length[n_triangles * per], x[2][3];
        for (int i = 0; i < n_triangles * per; i++) {
            int k = i % per;
            int64_t t = (s.mesh->n_triangles - 1) * (int64_t)(i / per) / (n_triangles - 1);
            to[i] =
                (dmk_point){t, {k == 0 ? 0.98 : 0.01, k == 1 ? 0.98 : 0.01, k == 2 ? 0.98 : 0.01}};
        }
        path_lengths(&s, n_triangles * per, to, length);
        for (int i = 0; i < n_triangles * per; i++) {
            int j = i / per * per + (i + 1) % per;
            point_xyz(s.mesh, &to[i], x[0]);
            point_xyz(s.mesh, &to[j], x[1]);
            double step = hypot(hypot(x[0][0] - x[1][0], x[0][1] - x[1][1]), x[0][2] - x[1][2]);
            assert_true(fabs(length[i] - length[j]) < step * (1 + 1e-12));
        }
        free(tri);
        free_scene(&s);
        free_scene(&smooth);
    }
}

/* ---- cutting -------------------------------------------------------------------------------- */

/* Cut open: a disk, of the same area, whose vertices lie where those of the mesh they stem from do, at their
 * distance from the middle of the plane. */
static void check_cut(scene *s, size_t most_flipped)
{
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    dmk_mesh_info before, after, split; /* split: of the mesh whose triangles are */
    dmk_finer f;
    int rc = dmk_locus_cut(ctx, s->geodesics, NULL, NULL, &cut, &origin, &plane);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    dmk_mesh_get_info(s->mesh, &before);
    dmk_mesh_get_info(cut, &after);
    assert_int_equal(dmk_finer_create(ctx, s->geodesics, &f), DMK_OK);
    dmk_mesh_get_info(f.geodesics->mesh, &split);
    dmk_finer_free(&f);
    assert_true(split.min_angle > 0.5 * before.min_angle); /* Rivara 1984 */
    assert_int_equal(after.n_components, 1);
    assert_int_equal(after.n_border_loops, 1);
    assert_int_equal(after.euler, 1);
    assert_true(fabs(after.area / before.area - 1) < 1e-12);
    assert_true(after.min_angle > 0.1 * split.min_angle); /* no slivers */
    for (size_t v = 0; v < after.n_vertices; v++) {
        if (origin[v] < 0) continue;
        assert_memory_equal(cut->xyz + 3 * v, s->mesh->xyz + 3 * origin[v], 3 * sizeof *cut->xyz);
        assert_true(fabs(hypot(plane[2 * v], plane[2 * v + 1]) -
                         s->geodesics->distance[origin[v]]) < 1e-12);
    }
    assert_in_range(dmk_cut_flipped(cut, plane), 0, most_flipped);
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
    free_scene(s);
}

/* A disk around the source with n corners at distance 1 from it, and beyond `ears` sides a third of them apart one
 * triangle each, with a corner at `distance` in the plane. */
static dmk_mesh *fan_of(int n, int ears, double distance, double *plane)
{
    double *xyz = calloc(3 * (size_t)(n + 1 + ears), sizeof *xyz);
    int32_t *triangle = calloc(3 * (size_t)(n + ears), sizeof *triangle);
    dmk_mesh *fan = NULL;
    for (int v = 0; v < n + ears; v++) {
        const int side = (v - n) * (n / 3); /* of an ear */
        const double a = 2 * pi / n * (v < n ? v : side + 0.5), r = v < n ? 1 : 2;
        const int32_t corners[2][3] = {{0, 1 + v, 1 + (v + 1) % n},
                                       {1 + side, 1 + v, 1 + (side + 1) % n}};
        memcpy(triangle + 3 * v, corners[v >= n], sizeof *corners);
        for (int k = 0; k < 2; k++) {
            const double x = k == 0 ? cos(a) : sin(a);
            xyz[3 * (v + 1) + k] = r * x;
            plane[2 * (v + 1) + k] = (v < n ? 1 : distance) * x;
        }
    }
    plane[0] = plane[1] = 0;
    assert_int_equal(
        dmk_mesh_create(ctx, (size_t)(n + 1 + ears), xyz, (size_t)(n + ears), triangle, &fan),
        DMK_OK);
    free(xyz);
    free(triangle);
    return fan;
}

/* A corner that is turned over the next one comes back, at its distance, with what is up to two rings around the
 * triangle, and nothing else. */
static void test_unfold(void **state)
{
    (void)state;
    enum { N = 16 };
    double plane[2 * (N + 1)], before[2 * (N + 1)];
    dmk_mesh *fan = fan_of(N, 0, 0, plane);
    plane[2 * 8] = cos(2 * pi / N * 8.5);
    plane[2 * 8 + 1] = sin(2 * pi / N * 8.5);
    memcpy(before, plane, sizeof plane);
    assert_int_equal(dmk_plane_flipped(fan, plane), 1);
    assert_int_equal(dmk_plane_unfold(ctx, fan, plane), DMK_OK);
    assert_int_equal(dmk_plane_flipped(fan, plane), 0);
    for (int v = 0; v <= N; v++) {
        const bool stays = memcmp(plane + 2 * v, before + 2 * v, 2 * sizeof *plane) == 0;
        assert_true(fabs(hypot(plane[2 * v], plane[2 * v + 1]) - (v > 0)) < 1e-12);
        assert_int_equal(stays, v < 6 || v > 11); /* 8 and 9 of the triangle */
    }
    dmk_mesh_destroy(&fan);
}

static int count_calls(const dmk_progress *progress, void *user)
{
    (void)progress;
    ++*(int *)user;
    return 0;
}

/* How many rounds it takes to unfold that as far as it goes. */
static int count_rounds(const dmk_mesh *disk, double *plane)
{
    int calls = 0;
    const double every = ctx->poll_every;
    ctx->progress = count_calls;
    ctx->progress_user = &calls;
    ctx->poll_every = 0;
    ctx->stage = "cut";
    assert_int_equal(dmk_plane_unfold(ctx, disk, plane), DMK_OK);
    ctx->progress = NULL;
    ctx->poll_every = every;
    ctx->stage = NULL;
    return calls;
}

/* Three corners that lie beyond sides nearer to the source than these can come, all three: after 25 rounds in vain of
 * either kind it gives up, and on few vertices after 12 moves for each, the last one of them with middles of arcs. */
static void test_unfold_in_vain(void **state)
{
    (void)state;
    static const struct {
        int n, rounds;
    } cases[] = {{3000, 50}, {24, 18}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double plane[2 * 3004], before[2 * 3004];
        dmk_mesh *fan = fan_of(cases[i].n, 3, 0.01, plane);
        memcpy(before, plane, sizeof plane);
        const int rounds = count_rounds(fan, plane);
        assert_int_equal(dmk_plane_flipped(fan, plane), 3);
        assert_memory_equal(plane, before, 2 * (size_t)fan->n_vertices * sizeof *plane);
        if (rounds != cases[i].rounds) fail_msg("%d vertices: %d rounds", cases[i].n, rounds);
        dmk_mesh_destroy(&fan);
    }
}

/* Middles of arcs that spread over the disk: 103 rounds where nothing ends that, 69 where it takes two rows, and 28
 * with half a row, which leaves more turned over. */
static void test_unfold_wild(void **state)
{
    (void)state;
    scene s = plate_scene(1, 6);
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    assert_int_equal(dmk_locus_cut(ctx, s.geodesics, NULL, NULL, &cut, &origin, &plane), DMK_OK);
    assert_int_equal(dmk_plane_flipped(cut, plane), 2);
    assert_in_range(count_rounds(cut, plane), 30, 40);
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
    free_scene(&s);
}

/* The plane has the directions of the geodesics, also where the cut was found on finer triangles. */
static void check_directions(const scene *s)
{
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL, n = 0, n_off = 0;
    double *plane = NULL;
    const double scale = 2 * pi / dmk_turn_around(s->geodesics, 0);
    assert_int_equal(dmk_locus_cut(ctx, s->geodesics, NULL, NULL, &cut, &origin, &plane), DMK_OK);
    for (int32_t v = 0; v < cut->n_vertices; v++) {
        if (origin[v] < 0 || s->geodesics->distance[origin[v]] == 0) continue;
        const double at = scale * s->geodesics->arrival[origin[v]].direction;
        n++;
        n_off += fabs(remainder(atan2(plane[2 * v + 1], plane[2 * v]) - at, 2 * pi)) > 0.01;
    }
    assert_true(n > 100 && 10 * n_off < n);
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
}

/* Of a vertex whose path starts in another direction than those around it: up to 0.7 radians off that is how it is, by
 * more its direction is turned to theirs. */
static void test_sides(void **state)
{
    (void)state;
    scene s = surface("quartic", 0, (double[3]){0.533843, 0.800764, 0.844080});
    const dmk_mesh *m = s.mesh;
    const size_t n_half = 3 * (size_t)m->n_triangles, n = (size_t)m->n_vertices;
    bool *crossed = calloc(n_half, sizeof *crossed);
    double *turn = malloc(n * sizeof *turn);
    int32_t far = 0;
    for (int32_t v = 0; v < m->n_vertices; v++)
        if (fabs(s.geodesics->distance[v] - 1) < fabs(s.geodesics->distance[far] - 1)) far = v;
    for (int i = 0; i < 4; i++) {
        const double off = 0.6 + 0.2 * (i % 2), was = s.geodesics->arrival[far].direction;
        s.geodesics->arrival[far].direction += i < 2 ? off : -off;
        assert_int_equal(dmk_cut_sides(ctx, s.geodesics, crossed, turn), DMK_OK);
        s.geodesics->arrival[far].direction = was;
        for (int32_t v = 0; v < m->n_vertices; v++) {
            const double to = v == far && off > 0.7 ? (i < 2 ? -off : off) : 0;
            assert_true(fabs(turn[v] - to) < (to == 0 ? 1e-300 : 0.1));
        }
    }
    free(crossed);
    free(turn);
    free_scene(&s);
}

/* Of the surface cut open in the plane, over the mean one on it. */
static double longest_edge(const scene *s)
{
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL, longest = 0;
    assert_int_equal(dmk_locus_cut(ctx, s->geodesics, NULL, NULL, &cut, &origin, &plane), DMK_OK);
    for (int32_t e = 0; e < cut->n_edges; e++) {
        const int32_t *v = cut->edge_vertex + 2 * e;
        const double *a = plane + 2 * v[0], *b = plane + 2 * v[1];
        longest = fmax(longest, hypot(a[0] - b[0], a[1] - b[1]) / s->h);
    }
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
    return longest;
}

/* On smooth surfaces no triangle is turned over: behind saddle vertices, at the ends of branches, where the cut leaves
 * vertices on the side that their paths do not come by. None lies far off, either. */
static void test_cut_smooth(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double size[3];
        size_t n;
        int refine;
        dmk_point source;
        double longest;
    } cases[] = {
        {"torus", {2, 1}, 0, 1, {3283, {1, 0, 0}}, 2},
        {"torus", {3, 1}, 0, 1, {9784, {1, 0, 0}}, 20},
        {"torus", {2, 1}, 20000, 0, {1270, {0.3282, 0.6718, 0}}, 22},
        {"torus", {3, 0.5}, 3000, 1, {7136, {1, 0, 0}}, 2},
        {"torus", {1.3, 1}, 1500, 1, {3987, {0.1297, 0.3807, 0.4896}}, 5},
        {"ellipsoid", {0.5, 0.8, 1}, 0, 1, {1844, {0.1628, 0.3635, 0.4737}}, 20},
        {"ellipsoid", {0.9, 1, 1.2}, 0, 1, {1862, {1, 0, 0}}, 25},
        {"quartic", {0.5, 1, 1.5}, 0, 1, {6935, {0.3328, 0.6672, 0}}, 20},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        dmk_surface_options o;
        dmk_mesh *mesh = NULL;
        dmk_order order;
        dmk_surface_options_init(&o, sizeof o);
        o.name = cases[i].name;
        o.n_triangles = cases[i].n;
        o.refine = cases[i].refine;
        memcpy(o.size, cases[i].size, sizeof o.size);
        assert_int_equal(dmk_mesh_surface(ctx, &o, &mesh), DMK_OK);
        assert_int_equal(dmk_order_create(ctx, mesh, 0, &order), DMK_OK);
        dmk_point source = cases[i].source;
        source.triangle = order.triangle_old[source.triangle];
        dmk_order_free(&order);
        scene s = scene_of(mesh, source);
        const double longest = longest_edge(&s);
        if (!(longest < cases[i].longest)) fail_msg("case %zu: %g", i, longest);
        check_cut(&s, 0);
    }
}

static void test_cut(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        scene s = uneven_cube(6, uneven_source[2 * i]);
        check_directions(&s);
        check_cut(&s, SIZE_MAX);
    }
    for (int genus = 0; genus < 4; genus++) {
        scene s = plate_scene(genus, 6);
        check_cut(&s, SIZE_MAX);
    }
    scene s = plate_scene(133, 1);
    check_cut(&s, SIZE_MAX);
    s = surface("torus", 1, (double[3]){3, 0, 0});
    check_cut(&s, 0);
    s = surface("torus", 0, (double[3]){1.2, 0.3, 0.9});
    check_cut(&s, 0);
    s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    check_cut(&s, 0);
    s = surface("quartic", 1, (double[3]){0.1, 0.9, -0.4});
    check_cut(&s, 0);
    s = surface("sphere", 1, (double[3]){0, 0, 1});
    check_cut(&s, SIZE_MAX);
    s = strip(90, true);
    check_cut(&s, 0);
    s = strip(60, false);
    check_cut(&s, 0);
}

/* The cut of a closed surface is as long as the locus, but for what margins move, and for ends inside triangles, which
 * it does not go to: whatever the surface's own triangles show. */
static void check_cut_length(void)
{
    static const struct {
        int width, depth, n;
        double strength;
    } cases[] = {{1, 1, 1, 0.25}, {1, 1, 1, 0.02}, {3, 1, 1, 0},
                 {5, 2, 1, 0},    {2, 2, 3, 0},    {3, 3, 1, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s =
            cubes(cases[i].width, cases[i].depth, cases[i].n, (dmk_point){3, {0.3, 0.3, 0.4}});
        const dmk_locus_options o = {.struct_size = sizeof o, .strength = cases[i].strength};
        dmk_mesh *cut = NULL;
        dmk_locus *l = NULL;
        int32_t *origin = NULL;
        double *plane = NULL, seam = 0;
        assert_int_equal(dmk_locus_trace(ctx, s.geodesics, &o, &l, NULL), DMK_OK);
        assert_int_equal(dmk_locus_cut(ctx, s.geodesics, &o, NULL, &cut, &origin, &plane), DMK_OK);
        for (int32_t e = 0; e < cut->n_edges; e++)
            seam += cut->edge_triangle[2 * e + 1] < 0 ? 0.5 * cut->length[e] : 0;
        assert_true(l->info.length > 0.4);
        if (!(fabs(seam - l->info.length) < 0.02 * l->info.length + 0.05 * s.h))
            fail_msg("case %zu: %g for %g", i, seam, l->info.length);
        free(origin);
        free(plane);
        dmk_locus_destroy(&l);
        dmk_mesh_destroy(&cut);
        free_scene(&s);
    }
}

/* Where parts of finer triangles have no area the mesh's own are cut. */
static void check_cut_flat(void)
{
    scene s = cubes(1, 1, 1, (dmk_point){3, {0.3, 0.3, 0.4}});
    dmk_mesh *flat = NULL, *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    for (int32_t v = 0; v < s.mesh->n_vertices; v++) s.mesh->xyz[3 * v + 2] *= 1e-8;
    assert_int_equal(dmk_mesh_create(ctx, (size_t)s.mesh->n_vertices, s.mesh->xyz,
                                     (size_t)s.mesh->n_triangles, s.mesh->triangle, &flat),
                     DMK_OK);
    scene t = scene_of(flat, s.source);
    if (dmk_locus_cut(ctx, t.geodesics, NULL, NULL, &cut, &origin, &plane) != DMK_OK)
        fail_msg("%s", dmk_context_message(ctx));
    assert_in_range(cut->n_triangles, 12, 40);
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
    free_scene(&s);
    free_scene(&t);
}

/* Spheres of few triangles, from every vertex and the middle of every triangle: the locus crosses hardly an
 * edge. */
static void test_cut_coarse(void **state)
{
    (void)state;
    static const double tetrahedron[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    static const int32_t four[] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    static const double octahedron[] = {1, 0,  0, 0, 1, 0,   -1, 0, 0,
                                        0, -1, 0, 0, 0, 1.7, 0,  0, -0.4};
    static const int32_t eight[] = {0, 1, 4, 1, 2, 4, 2, 3, 4, 3, 0, 4,
                                    1, 0, 5, 2, 1, 5, 3, 2, 5, 0, 3, 5};
    for (int which = 0; which < 2; which++) {
        const size_t n = which ? 8 : 4;
        for (size_t i = 0; i < 4 * n; i++) {
            dmk_mesh *mesh = NULL;
            int rc = dmk_mesh_create(ctx, which ? 6 : 4, which ? octahedron : tetrahedron, n,
                                     which ? eight : four, &mesh);
            if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
            const int64_t t = (int64_t)(i / 4);
            const int k = (int)(i % 4);
            scene s = scene_of(mesh, k == 3 ? (dmk_point){t, {0.3, 0.3, 0.4}}
                                            : (dmk_point){t, {k == 0, k == 1, k == 2}});
            check_cut(&s, SIZE_MAX);
        }
    }
    check_cut_length();
    check_cut_flat();
}

/* ---- accuracy ------------------------------------------------------------------------------- */

/* Part of bench/results/accuracy.md again: mean distance of the vertices from the exact locus of the torus, and
 * largest distance of an end from an exact one, in edges. A tenth worse than there fails. */
static void test_accuracy_torus(void **state)
{
    (void)state;
    scene s = surface("torus", 2, (double[3]){3, 0, 0});
    dmk_locus *l = trace(&s);
    size_t n;
    double mean = 0, tip = 0;
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    for (size_t i = 0; i < n; i++) {
        mean += torus_error(v[i].xyz) / s.h / (double)n;
        if (v[i].kind != DMK_LOCUS_END) continue;
        const double x = v[i].xyz[0] - 3 * cos(pi / sqrt(3)),
                     y = fabs(v[i].xyz[1]) - 3 * sin(pi / sqrt(3));
        tip = fmax(tip, hypot(hypot(x, y), v[i].xyz[2]) / s.h);
    }
    print_message("mean %.4f h, tip %.3f h\n", mean, tip);
    assert_true(mean < 0.0058 && tip < 0.14);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* The six ends of the quartic's locus, by the conjugate times of geodesics on the smooth surface: the largest distance
 * of one from the locus' ends, in h. */
static double worst_end(scene s)
{
    static const double ends[6][3] = {
        {0.4683107, 0.3039515, -0.98553039}, {-0.78399097, 0.1895918, -0.88768626},
        {-0.99572722, 0.3162848, 0.2889888}, {-0.79292888, -0.88141667, 0.1831174},
        {0.4671088, -0.98622572, 0.2824221}, {0.2370719, -0.82932336, -0.85073076},
    };
    dmk_locus *l = trace(&s);
    size_t n;
    double worst = 0;
    const dmk_locus_vertex *v = dmk_locus_vertices(l, &n);
    for (int k = 0; k < 6; k++) {
        double least = HUGE_VAL;
        for (size_t i = 0; i < n; i++) {
            if (v[i].kind != DMK_LOCUS_END) continue;
            const double *x = v[i].xyz, *e = ends[k];
            least = fmin(least, hypot(hypot(x[0] - e[0], x[1] - e[1]), x[2] - e[2]) / s.h);
        }
        worst = fmax(worst, least);
    }
    dmk_locus_destroy(&l);
    free_scene(&s);
    return worst;
}

static void test_accuracy_ends(void **state)
{
    (void)state;
    const double worst =
        worst_end(surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080}));
    print_message("ends %.3f h\n", worst);
    assert_true(worst < 0.55);
}

/* The same where the vertices are off by 2 % of an edge. */
static void test_noisy_ends(void **state)
{
    (void)state;
    double mean = 0, most = 0;
    for (uint32_t seed = 0; seed < 8; seed++) {
        scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
        const double worst = worst_end(shaken(s, 0.02 * s.h, seed));
        mean += worst / 8;
        most = fmax(most, worst);
    }
    print_message("ends %.3f h, in the mean %.3f h\n", most, mean);
    assert_true(most < 0.9 && mean < 0.61);
}

/* Near an umbilic the locus is an arc, and the nearer the shorter: as long on two meshes, down to some edges; one
 * shorter than an edge is a point. */
static void test_short_arc(void **state)
{
    (void)state;
    double length[2], h = 0;
    for (int i = 0; i < 2; i++) {
        scene s =
            surface("ellipsoid", 2 + i, (double[3]){-sqrt(1.0 / 75) + 0.04, 0, sqrt(2.0 / 3)});
        dmk_locus *l = trace(&s);
        dmk_locus_info info = check_object(l);
        assert_int_equal(info.endpoints, 2);
        assert_int_equal(info.branch_points, 0);
        length[i] = info.length;
        h = fmax(h, s.h);
        assert_true(info.length < 4 * s.h);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
    assert_true(fabs(length[0] - length[1]) < 0.5 * h);
    check_point("ellipsoid", 1, (double[3]){-sqrt(1.0 / 75), 0, sqrt(2.0 / 3)});
    scene s = surface("ellipsoid", 1, (double[3]){-sqrt(1.0 / 75) + 0.02, 0, sqrt(2.0 / 3)});
    dmk_locus *l = trace(&s); /* an arc of 0.6 edges */
    assert_int_equal(check_object(l).n_vertices, 1);
    dmk_locus_destroy(&l);
    free_scene(&s);
}

/* ---- the rules ------------------------------------------------------------------------------ */

/* tie: an edge's jump is what each end's family is too long at the other, and 0.03 of the largest difference of the
 * two at the corners beside the edge. */
static void test_tie(void **state)
{
    (void)state;
    scene s = surface("torus", 0, (double[3]){3, 0, 0});
    const dmk_geodesics *g = s.geodesics;
    const double unit = g->star.unit;
    int n = 0;
    for (int32_t h = 0; h < 3 * s.mesh->n_triangles; h++) {
        const double length = s.mesh->length[s.mesh->triangle_edge[h]] / unit;
        const int32_t v = s.mesh->triangle[dmk_next(h)], w = s.mesh->triangle[dmk_previous(h)];
        const dmk_image a = dmk_image_at_start(g, h), b = dmk_image_at_end(g, h);
        double at[4][2] = {{0, 0}, {length, 0}}, most = 0;
        dmk_apex(g, h, &at[2][0], &at[2][1]);
        dmk_apex(g, g->star.twin[h], &at[3][0], &at[3][1]);
        at[3][0] = length - at[3][0];
        at[3][1] = -at[3][1];
        for (int k = 0; k < 4; k++)
            most = fmax(most, fabs(dmk_image_length(&a, at[k][0], at[k][1]) -
                                   dmk_image_length(&b, at[k][0], at[k][1])));
        if (most < 1e-6) continue;
        const double beyond = fmax(0, dmk_image_length(&a, length, 0) - g->distance[w] / unit) +
                              fmax(0, dmk_image_length(&b, 0, 0) - g->distance[v] / unit);
        double jump;
        dmk_jumps(g, 1, &h, dmk_rules.tie, &jump);
        assert_true(fabs((jump - beyond) / most - 0.03) < 1e-6);
        n++;
    }
    assert_true(n > 1000);
    free_scene(&s);
}

/* angle: inwards a branch's worth grows by (1 - cos(alpha / 2)) of its length less what it would be at 0.126; alpha is
 * the harmonic mean of both ends'. */
static void test_angle(void **state)
{
    (void)state;
    scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    dmk_cotree t = {0};
    int n = 0, exact = 0;
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
    for (int32_t i = 0; i < s.mesh->n_triangles; i++) {
        const int32_t *on = t.on + 3 * i;
        for (int k = 0; k < 3; k++) {
            if (on[k] < 0 || on[(k + 1) % 3] < 0 || on[(k + 2) % 3] >= 0) continue;
            const dmk_crossing *from = &t.crossing[on[k]], *to = &t.crossing[on[(k + 1) % 3]];
            if (to->onward == on[k]) {
                const dmk_crossing *swap = from;
                from = to;
                to = swap;
            }
            if (&t.crossing[from->onward] != to || !(from->worth < to->worth)) continue;
            double step = 0;
            for (int j = 0; j < 3; j++)
                step += (from->xyz[j] - to->xyz[j]) * (from->xyz[j] - to->xyz[j]);
            const double half = from->alpha * to->alpha / (from->alpha + to->alpha);
            const double gain = cos(0.063) - cos(half);
            exact += fabs(to->worth - from->worth - gain * sqrt(step)) < 1e-9 * s.h;
            n++;
        }
    }
    assert_true(n > 100 && exact > 0.9 * n);
    dmk_cotree_free(&t);
    free_scene(&s);
}

/* The locus' length in h on a bumpy sphere, from several of its vertices. */
typedef struct length_from {
    int32_t source;
    double length;
} length_from;

static void check_lengths(const length_from *of, int n)
{
    for (int i = 0; i < n; i++) {
        dmk_mesh *mesh = NULL;
        dmk_point p;
        assert_int_equal(dmk_mesh_read(ctx, "tests/data/rough.off", &mesh), DMK_OK);
        assert_int_equal(dmk_mesh_vertex_point(ctx, mesh, of[i].source, &p), DMK_OK);
        scene s = scene_of(mesh, p);
        dmk_locus *l = trace(&s);
        assert_true(fabs(check_object(l).length / s.h - of[i].length) < 0.8);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* off: joints on a bumpy sphere. By 1.5 the locus from the third source is 9.0 h shorter; by 6 the four are 3.7, 6.3,
 * 2.4 and 1.1 h longer. And the angle at which an edge's jump counts as much as being off a line: from the third 7.8 h
 * shorter with half of it, from the fourth 2.0 h longer with twice as much. */
static void test_off(void **state)
{
    (void)state;
    check_lengths((length_from[]){{962, 272.8}, {1147, 274.7}, {1480, 261.6}, {148, 236.2}}, 4);
}

/* No branch is led to another's cusp: 10 h of false lines, as with twice the bound; with half of it true ends are cut
 * by 4 h. */
static void test_reaches(void **state)
{
    (void)state;
    check_lengths(&(length_from){222, 245.2}, 1);
}

/* From n vertices of the mesh, 9 at most, with other first corners; backwards: vertices and triangles in the other
 * order; flipped: the other side up. */
static dmk_locus_info trace_numbered(const dmk_mesh *m, size_t n, const int32_t *source,
                                     bool backwards, bool flipped)
{
    const int32_t last = m->n_vertices - 1;
    scene s = {0};
    dmk_point at[9];
    double *xyz = malloc(3 * (size_t)m->n_vertices * sizeof *xyz);
    int32_t *triangle = malloc(3 * (size_t)m->n_triangles * sizeof *triangle);
    for (int32_t v = 0; v <= last; v++)
        memcpy(xyz + 3 * (backwards ? last - v : v), m->xyz + 3 * v, 3 * sizeof *xyz);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *corner = m->triangle + 3 * t, to = backwards ? m->n_triangles - 1 - t : t;
        for (int k = 0; k < 3; k++) {
            const int32_t v = corner[((flipped ? 2 * k : k) + to) % 3];
            triangle[3 * to + k] = backwards ? last - v : v;
        }
    }
    assert_int_equal(
        dmk_mesh_create(ctx, (size_t)m->n_vertices, xyz, (size_t)m->n_triangles, triangle, &s.mesh),
        DMK_OK);
    for (size_t i = 0; i < n; i++) {
        const int32_t v = backwards ? last - source[i] : source[i];
        assert_int_equal(dmk_mesh_vertex_point(ctx, s.mesh, v, &at[i]), DMK_OK);
    }
    assert_int_equal(dmk_geodesics_create(ctx, s.mesh, n, at, NULL, &s.geodesics), DMK_OK);
    dmk_locus *l = trace(&s);
    const dmk_locus_info info = check_object(l);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    for (size_t i = 0; i < info.n_vertices; i++)
        assert_true(v[i].source_angle >= 0 && v[i].source_angle <= pi &&
                    (v[i].source_angle == pi || v[i].source[0] == v[i].source[1]) &&
                    v[i].angle[0] >= 0 && v[i].angle[1] >= 0 && (n > 1 || v[i].angle[1] < 2 * pi));
    dmk_locus_destroy(&l);
    free_scene(&s);
    free(xyz);
    free(triangle);
    return info;
}

/* n_sets sets of n sources. */
static void check_numbering(const dmk_mesh *m, size_t n_sets, size_t n, const int32_t *source)
{
    double h = 0;
    for (int32_t e = 0; e < m->n_edges; e++) h += m->length[e] / m->n_edges;
    for (const int32_t *from = source; from < source + n_sets * n; from += n) {
        const dmk_locus_info a = trace_numbered(m, n, from, false, false);
        for (int i = 0; i < 3; i++) {
            const dmk_locus_info b = trace_numbered(m, n, from, i != 1, i != 0);
            if (fabs(a.length - b.length) > 5e-3 * h || a.endpoints != b.endpoints ||
                a.branch_points != b.branch_points || a.loops != b.loops)
                fail_msg("from vertex %d: %.9g h, %zu ends; otherwise %.9g, %zu", (int)*from,
                         a.length / h, a.endpoints, b.length / h, b.endpoints);
        }
    }
}

/* Which vertex or corner has the lower number is nothing to the locus. On the bumpy sphere it would be 0.02 to 5 h:
 * which of two edges that jump alike joins the tree, to which side a crossing goes where both families or neither are
 * the shorter one, from where a fork's families and a cusp's surroundings are seen, how far out a branch is followed,
 * of several sources where directions begin; on the torus which of three loops a fork is left out of; and on the blocks
 * of 20 triangles, traced on finer ones, which of a ring's vertices a cusp is fitted to: 0.01 to 0.5 h. */
static void test_numbering(void **state)
{
    (void)state;
    dmk_mesh *mesh = NULL;
    assert_int_equal(dmk_mesh_read(ctx, "tests/data/rough.off", &mesh), DMK_OK);
    check_numbering(mesh, 10, 1, (int32_t[]){0, 102, 427, 533, 597, 734, 960, 1174, 1387, 1921});
    check_numbering(mesh, 1, 9, (int32_t[]){0, 102, 427, 533, 597, 734, 960, 1174, 1387});
    dmk_mesh_destroy(&mesh);
    scene s = surface("torus", 0, (double[3]){3, 0, 0});
    s = shaken(s, 0.1 * s.h, 1);
    check_numbering(s.mesh, 3, 1, (int32_t[]){0, 226, 400});
    free_scene(&s);
    for (uint32_t random = 1; random <= 12; random++) {
        s = shaken(cubes(2, 1, 1, (dmk_point){0, {1, 0, 0}}), 0.25, random);
        check_numbering(s.mesh, 3, 1, (int32_t[]){0, 5, 9});
        free_scene(&s);
    }
}

/* From which excess on falls of d count: 5 * 0.2 h. With half of it branches of noise are as strong as the surface's on
 * the first torus, with twice as much the surface's are as weak as those of noise on the quartic: 54 and 17 ends. Falls
 * that wait are not lost where a branch joins one of more, as on the second torus: 47 ends. */
static void test_falls(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double from[3], size;
        uint32_t seed;
        size_t ends, branches;
    } cases[] = {{"torus", {3, 0, 0}, 0.2, 5, 2, 4},
                 {"quartic", {0.533843, 0.800764, 0.844080}, 0.15, 5, 6, 4},
                 {"torus", {3, 0, 0}, 0.2, 0, 3, 5}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene s = surface(cases[i].name, 1, cases[i].from);
        s = shaken(s, cases[i].size * s.h, cases[i].seed);
        dmk_locus *l = trace(&s);
        const dmk_locus_info info = check_object(l);
        assert_true(info.endpoints == cases[i].ends && info.branch_points == cases[i].branches);
        assert_true(info.strength > 0.5 * s.h);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* Falls wait from an excess of 0.2 h on, which a joint's crossings need not have. Where they begin to count, above the
 * default of a noisy mesh, a branch's end has so much excess at once: by all of it the end is 8.6 h off, by that
 * without them 4.8. */
static void test_falls_begin(void **state)
{
    (void)state;
    size_t n = 0;
    dmk_cotree t;
    scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    s = shaken(s, 0.18 * s.h, 7);
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
    for (int32_t i = 0; i < t.n; i++) {
        n += t.crossing[i].fall > 0;
        assert_true(t.crossing[i].fall == 0 || t.crossing[i].excess >= 0.2 * s.h);
    }
    assert_true(n > 100);
    dmk_cotree_free(&t);
    free_scene(&s);
    s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    assert_true(worst_end(shaken(s, 0.16 * s.h, 7)) < 6);
}

/* On several blocks of triangles of either size: what is peeled first, and by how many threads, changes nothing; and
 * all that is handed on has come from a crossing that is handed on to. */
static void test_blocks(void **state)
{
    (void)state;
    scene s = surface("torus", 3, (double[3]){3, 0, 0});
    dmk_cotree one = {0}, many = {0};
    assert_true(s.mesh->n_triangles > 2 * 4 * 32768);
    assert_int_equal(dmk_context_set_threads(ctx, 1), DMK_OK);
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &one), DMK_OK);
    assert_int_equal(dmk_context_set_threads(ctx, 4), DMK_OK);
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &many), DMK_OK);
    assert_int_equal(dmk_context_set_threads(ctx, 0), DMK_OK);
    assert_int_equal(one.n, many.n);
    assert_memory_equal(one.crossing, many.crossing, (size_t)one.n * sizeof *one.crossing);
    for (int32_t i = 0; i < one.n; i++) {
        const dmk_crossing *c = &one.crossing[i],
                           *on = &one.crossing[c->onward < 0 ? i : c->onward];
        assert_true((c->excess < HUGE_VAL) == (c->outer >= 0));
        assert_true(c->excess <= on->excess && c->worth <= on->worth && c->worth <= c->excess);
    }
    dmk_cotree_free(&one);
    dmk_cotree_free(&many);
    free_scene(&s);
}

/* gap: the default is sqrt(5) times the strongest of a noisy mesh's own branches, and the next is 5 times as strong. */
static void test_gap(void **state)
{
    (void)state;
    int raised = 0;
    for (uint32_t seed = 0; seed < 4; seed++) {
        scene s = shaken(surface("torus", 1, (double[3]){3, 0, 0}), 0.008, seed);
        dmk_cotree t = {0};
        double own = 0, next = HUGE_VAL;
        assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
        for (int32_t i = 0; i < s.mesh->n_triangles; i++) {
            const double b = dmk_branch_at(&t, i);
            if (b < t.strength)
                own = fmax(own, b);
            else
                next = fmin(next, b);
        }
        if (t.strength > 0.21 * s.h) {
            assert_true(fabs(t.strength - sqrt(5) * own) < 1e-9 * s.h && next >= 5 * own);
            raised++;
        }
        dmk_cotree_free(&t);
        free_scene(&s);
    }
    assert_true(raised > 0);
}

/* noise: from an umbilic all of the branches are the mesh's own. The strongest is of 0.24 edges and raises the default
 * where it is 33 times the median of the jumps, on a noisy mesh, and of 0.22 and does not where it is 55 times. */
static void test_noise_level(void **state)
{
    (void)state;
    for (int noisy = 0; noisy < 2; noisy++) {
        scene s = surface("ellipsoid", 2, (double[3]){-sqrt(1.0 / 75), 0, sqrt(2.0 / 3)});
        s = shaken(s, (noisy ? 0.035 : 0.02) * s.h, noisy ? 4 : 6);
        dmk_cotree t = {0};
        double own = 0;
        assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
        for (int32_t i = 0; i < s.mesh->n_triangles; i++) {
            const double b = dmk_branch_at(&t, i);
            if (b < HUGE_VAL) own = fmax(own, b);
        }
        assert_true(fabs(own / t.noise - (noisy ? 33 : 55)) < 1 && own > 0.2 * s.h);
        assert_true(fabs(t.strength - (noisy ? sqrt(5) * own : 0.2 * s.h)) < 1e-9 * s.h);
        dmk_cotree_free(&t);
        free_scene(&s);
    }
}

/* width: a crossing's place hangs on the line within half an edge, and on nothing beyond. */
static void test_width(void **state)
{
    (void)state;
    scene s = surface("torus", 1, (double[3]){3, 0, 0});
    dmk_cotree t = {0};
    double reach = 0;
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
    for (int32_t i = 0; i < t.n; i++) {
        const dmk_crossing *c = &t.crossing[i];
        if (c->onward < 0 || t.strength_of[i] < t.strength) continue;
        const double *v = s.mesh->xyz + 3 * s.mesh->triangle[dmk_next(c->half)],
                     *w = s.mesh->xyz + 3 * s.mesh->triangle[dmk_previous(c->half)];
        dmk_locus_vertex before, after;
        double length = 0;
        dmk_place_crossing(&t, i, &before);
        for (int32_t j = c->onward, last = i; j >= 0 && length < 2 * s.h;
             j = t.crossing[j].onward) {
            dmk_crossing *x = &t.crossing[j];
            double kept[3], step = 0;
            memcpy(kept, x->xyz, sizeof kept);
            for (int k = 0; k < 3; k++) x->xyz[k] += 1e-3 * (w[k] - v[k]);
            dmk_place_crossing(&t, i, &after);
            memcpy(x->xyz, kept, sizeof kept);
            if (memcmp(before.xyz, after.xyz, sizeof after.xyz) != 0) reach = fmax(reach, length);
            for (int k = 0; k < 3; k++) step += pow(x->xyz[k] - t.crossing[last].xyz[k], 2);
            length += sqrt(step);
            last = j;
        }
    }
    assert_true(reach > 0.45 * s.h && reach < 0.501 * s.h);
    dmk_cotree_free(&t);
    free_scene(&s);
}

static double apart(const double *a, const double *b)
{
    return hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
}

/* margin: the points of a cut keep 0.15 of their edges to the ends, and no more. */
static void test_margin(void **state)
{
    (void)state;
    scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    const dmk_mesh *m = s.mesh;
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL, least = 1;
    assert_int_equal(dmk_locus_cut(ctx, s.geodesics, NULL, NULL, &cut, &origin, &plane), DMK_OK);
    for (int32_t v = 0; v < cut->n_vertices; v++) {
        for (int32_t e = 0; e < m->n_edges && origin[v] < 0; e++) {
            const double *x = cut->xyz + 3 * v, length = m->length[e];
            const double *a = m->xyz + 3 * m->edge_vertex[2 * e],
                         *b = m->xyz + 3 * m->edge_vertex[2 * e + 1];
            if (fabs(x[0] - a[0]) > length || fabs(x[1] - a[1]) > length) continue;
            const double to_a = apart(x, a), to_b = apart(x, b);
            if (to_a + to_b < length * (1 + 1e-12)) least = fmin(least, fmin(to_a, to_b) / length);
        }
    }
    assert_true(fabs(least - 0.15) < 1e-9);
    free(origin);
    free(plane);
    dmk_mesh_destroy(&cut);
    free_scene(&s);
}

/* ---- a scan --------------------------------------------------------------------------------- */

enum { MOST_POINTS = 8000 };

/* Points of this kind in a file of bench/scan.py. */
static int read_jumps(int source, const char *kind, double (*x)[3])
{
    char path[64], word[8];
    double p[3];
    int n = 0;
    snprintf(path, sizeof path, "tests/data/rough-%d.jumps", source);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    while (n < MOST_POINTS && fscanf(f, "%7s %lf %lf %lf", word, &p[0], &p[1], &p[2]) == 4) {
        if (strcmp(word, kind) == 0) memcpy(x[n++], p, sizeof p);
    }
    fclose(f);
    assert_in_range(n, 50, MOST_POINTS - 1);
    return n;
}

/* Points along the locus, a quarter of an edge apart at most, and what length each stands for. */
static int sample(const dmk_locus *l, double h, double (*x)[3], double *weight)
{
    size_t n_edges;
    int n = 0;
    const dmk_locus_edge *e = dmk_locus_edges(l, &n_edges);
    const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
    for (size_t i = 0; i < n_edges; i++) {
        const double *a = v[e[i].vertex[0]].xyz, *b = v[e[i].vertex[1]].xyz, length = apart(a, b);
        const int pieces = (int)ceil(4 * length / h);
        for (int k = 0; k < pieces; k++, n++) {
            assert_true(n < MOST_POINTS);
            for (int j = 0; j < 3; j++) x[n][j] = a[j] + (k + 0.5) / pieces * (b[j] - a[j]);
            weight[n] = length / pieces;
        }
    }
    return n;
}

/* Share of the weight of points farther than `reach` from all of others. */
static double far_share(int n, double (*x)[3], const double *weight, int m, double (*y)[3],
                        double reach)
{
    double all = 0, far = 0;
    for (int i = 0; i < n; i++) {
        bool near = false;
        for (int k = 0; k < m && !near; k++) near = apart(x[i], y[k]) <= reach;
        all += weight ? weight[i] : 1;
        if (!near) far += weight ? weight[i] : 1;
    }
    return far / all;
}

/* Part of bench/results/scan.csv again: a mesh as scans are, by the jumps that its judge found. */
static void test_scan(void **state)
{
    (void)state;
    static double x[MOST_POINTS][3], y[MOST_POINTS][3], weight[MOST_POINTS];
    for (int source = 0; source <= 1708; source += 1708) {
        char line[512];
        double wrong = -1, missed = -1;
        int row, ends = -1;
        FILE *f = fopen("bench/results/scan.csv", "r");
        assert_non_null(f);
        while (fgets(line, sizeof line, f)) {
            double w, m;
            int e;
            if (sscanf(line, "rough,%d,%*d,%lf,%lf,%*d,%*f,%*f,%d", &row, &w, &m, &e) == 4 &&
                row == source)
                wrong = w, missed = m, ends = e;
        }
        fclose(f);
        assert_true(wrong >= 0);
        dmk_mesh *mesh = NULL;
        dmk_point p;
        assert_int_equal(dmk_mesh_read(ctx, "tests/data/rough.off", &mesh), DMK_OK);
        assert_int_equal(dmk_mesh_vertex_point(ctx, mesh, source, &p), DMK_OK);
        scene s = scene_of(mesh, p);
        dmk_locus *l = trace(&s);
        const int n = sample(l, s.h, x, weight);
        int m = read_jumps(source, "weak", y);
        const double now = far_share(n, x, weight, m, y, 3 * s.h);
        m = read_jumps(source, "strong", y);
        const double lost = far_share(m, y, NULL, n, x, 3 * s.h);
        print_message("false %.4f, missed %.4f\n", now, lost);
        assert_true(now <= wrong + 0.005 && lost <= missed + 0.005);
        assert_int_equal(check_object(l).endpoints, ends);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* ---- the rest ------------------------------------------------------------------------------- */

/* The strength asked for: whole branches go, and what stays is what has this strength in the locus with less. */
static void check_strengths(scene s)
{
    const double multiples[] = {0.02, 0.1, 0.2, 0.3, 1, 1.8, 2.55, 3, 100};
    dmk_locus *all = trace_with(&s, multiples[0] * s.h);
    size_t n_all;
    const dmk_locus_edge *e = dmk_locus_edges(all, &n_all);
    const dmk_locus_vertex *v = dmk_locus_vertices(all, NULL);
    for (size_t i = 0; i < sizeof multiples / sizeof *multiples; i++) {
        dmk_locus *l = trace_with(&s, multiples[i] * s.h);
        dmk_locus_info info = check_object(l);
        check_segments(&s, l);
        size_t n = 0;
        double length = 0;
        for (size_t k = 0; k < n_all; k++) {
            if (e[k].strength < multiples[i] * s.h) continue;
            length += dmk_distance(v[e[k].vertex[0]].xyz, v[e[k].vertex[1]].xyz);
            n++;
        }
        /* forks with branches weaker than the default lie on lines that have no vertex there without them */
        assert_true(n >= info.n_edges);
        assert_true(fabs(info.length - length) < 1e-9);
        assert_true(info.strength == multiples[i] * s.h && info.loops == 0 && info.components == 1);
        dmk_locus_destroy(&l);
    }
    dmk_locus_destroy(&all);
    free_scene(&s);
}

static void test_strength(void **state)
{
    (void)state;
    check_strengths(surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080}));
    for (uint32_t random = 1; random <= 8; random++)
        check_strengths(shaken(surface("sphere", 0, (double[3]){0, 0, 1}), 0.1, random));
}

/* A cone of this total angle around its tip, with sides of length 1, from 24 rings of 36 points; the source is one of
 * ring 10. */
static scene cone(double angle)
{
    enum { RAYS = 36, RINGS = 24 };
    static double xyz[3 * (1 + RINGS * RAYS)];
    static int32_t triangle[3 * RAYS * (2 * RINGS - 1)];
    int32_t n = 0;
    dmk_mesh *m = NULL;
    const double radius = sin(angle / RAYS / 2) / sin(pi / RAYS), down = sqrt(1 - radius * radius);
    for (int32_t i = 0; i < RINGS * RAYS; i++) {
        const double r = (i / RAYS + 1.0) / RINGS, a = 2 * pi * (i % RAYS) / RAYS;
        const int32_t next = i / RAYS * RAYS + (i + 1) % RAYS, out[2] = {i + RAYS, next + RAYS};
        memcpy(xyz + 3 * (i + 1), (double[]){r * radius * cos(a), r * radius * sin(a), -r * down},
               3 * sizeof *xyz);
        const int32_t tip[3] = {0, i + 1, next + 1},
                      two[6] = {i + 1, out[0] + 1, out[1] + 1, i + 1, out[1] + 1, next + 1};
        if (i < RAYS) memcpy(triangle + 3 * n++, tip, sizeof tip);
        if (i >= (RINGS - 1) * RAYS) continue;
        memcpy(triangle + 3 * n, two, sizeof two);
        n += 2;
    }
    const int rc = dmk_mesh_create(ctx, sizeof xyz / sizeof *xyz / 3, xyz, (size_t)n, triangle, &m);
    if (rc != DMK_OK) fail_msg("%s", dmk_context_message(ctx));
    dmk_point p;
    assert_int_equal(dmk_mesh_vertex_point(ctx, m, 1 + 9 * RAYS, &p), DMK_OK);
    return scene_of(m, p);
}

/* Along the line opposite d is hypot(r - x, y). What a pointed cone's branch is worth at r, before d rises, without its
 * falls. */
static double before_falls(double first, double r, double x, double y)
{
    return 0.998 * (r - first) - (hypot(first - x, y) - hypot(r - x, y));
}

/* The locus is the straight line opposite, and begins on the first ring. On a blunt cone the distance grows along it,
 * on a pointed one it falls as far as r0 cos(angle / 2). The strength is the excess, but for 0.002 of the length and
 * for what falls before there is an excess of 0.2 h. */
static void check_cones(void)
{
    const double angles[] = {4, 2.5, 1};
    for (size_t k = 0; k < sizeof angles / sizeof *angles; k++) {
        scene s = cone(angles[k]);
        dmk_locus *l = trace(&s);
        const dmk_locus_info info = check_object(l);
        const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL);
        const double r0 = 10 / 24.0, first = 1 / 24.0, x = r0 * cos(angles[k] / 2),
                     y = r0 * sin(angles[k] / 2), nearest = fmax(first, x);
        assert_int_equal(info.endpoints, 2);
        for (size_t i = 0; i < info.n_vertices; i++) {
            const double r = sqrt(dmk_dot(v[i].xyz, v[i].xyz));
            assert_true(fabs(v[i].distance - hypot(r - x, y)) < 1e-9);
            const double round = 2 * atan2(r * sin(angles[k] / 2), r0 - r * cos(angles[k] / 2));
            assert_true(fabs(v[i].source_angle - fmin(round, 2 * pi - round)) < 1e-9);
        }
        double counts = first;
        while (counts < nearest && before_falls(first, counts, x, y) < 0.2 * s.h) counts += 1e-5;
        const double strength =
            0.998 * (1 - first) - hypot(1 - x, y) - hypot(first - x, y) + 2 * hypot(counts - x, y);
        assert_true(fabs(v[0].strength - strength) < 0.05 * strength);
        dmk_locus_destroy(&l);
        free_scene(&s);
    }
}

/* The excess handed on is what it stands for: d(x) + l(x, c) - d(c), x the end of the branch behind c, up to
 * the turns of the line from edge to edge. */
static void test_excess(void **state)
{
    (void)state;
    scene s = surface("ellipsoid", 2, (double[3]){-0.151128, -0.350718, 0.295520});
    dmk_cotree t = {0};
    assert_int_equal(dmk_cotree_complete(ctx, s.geodesics, s.h, &t), DMK_OK);
    assert_int_equal(t.n, s.mesh->n_triangles - 1);
    assert_int_equal(t.n_ends, 2);
    assert_true(t.last >= 0);
    int far = 0;
    for (int32_t i = 0; i < t.n; i++) {
        const dmk_crossing *c = &t.crossing[i];
        assert_true(c->excess >= 0 && t.strength_of[i] >= 0 && c->alpha <= pi + 1e-12);
        assert_true(c->onward < 0 || c->excess <= t.crossing[c->onward].excess);
        if (c->onward < 0 || c->excess < t.strength) continue;
        double length = 0;
        int32_t end = i;
        for (int32_t j = i; j != t.last; j = t.crossing[j].onward) {
            const double *a = t.crossing[j].xyz, *b = t.crossing[t.crossing[j].onward].xyz;
            length += hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
            end = t.crossing[j].onward;
        }
        const double grown = c->distance + length - t.crossing[end].distance;
        const double excess = t.crossing[end].excess - c->excess;
        if (t.strength_of[i] < t.strength_of[t.last] || length < 10 * s.h) continue;
        far++;
        /* the last crossing has the larger excess of its two sides */
        assert_true(excess <= grown * 1.1);
    }
    assert_true(far > 20);
    dmk_cotree_free(&t);
    free_scene(&s);
    check_cones();
}

static void test_threads(void **state)
{
    (void)state;
    scene s = surface("quartic", 1, (double[3]){0.533843, 0.800764, 0.844080});
    cpu_set_t all, one;
    dmk_locus *a = trace(&s);
    assert_int_equal(sched_getaffinity(0, sizeof all, &all), 0);
    CPU_ZERO(&one);
    for (int i = 0; i < CPU_SETSIZE && CPU_COUNT(&one) == 0; i++) {
        if (CPU_ISSET(i, &all)) CPU_SET(i, &one);
    }
    assert_int_equal(sched_setaffinity(0, sizeof one, &one), 0);
    dmk_locus *b = trace(&s);
    assert_int_equal(sched_setaffinity(0, sizeof all, &all), 0);
    size_t n, m;
    const dmk_locus_vertex *v = dmk_locus_vertices(a, &n), *w = dmk_locus_vertices(b, &m);
    assert_int_equal(n, m);
    for (size_t i = 0; i < n; i++) assert_memory_equal(v[i].xyz, w[i].xyz, sizeof v[i].xyz);
    dmk_locus_destroy(&a);
    dmk_locus_destroy(&b);
    free_scene(&s);
}

static int setup(void **state)
{
    const int rc = context_setup(state);
    ctx = *state;
    return rc;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_torus),
        cmocka_unit_test(test_source_anywhere),
        cmocka_unit_test(test_point),
        cmocka_unit_test(test_quartic),
        cmocka_unit_test(test_narrow),
        cmocka_unit_test(test_hyperbolic),
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_cube),
        cmocka_unit_test(test_uneven),
        cmocka_unit_test(test_finer),
        cmocka_unit_test(test_finer_sliver),
        cmocka_unit_test(test_genus),
        cmocka_unit_test(test_connected),
        cmocka_unit_test(test_border),
        cmocka_unit_test(test_path),
        cmocka_unit_test(test_path_saddle),
        cmocka_unit_test(test_path_box),
        cmocka_unit_test(test_path_rough),
        cmocka_unit_test(test_unfold),
        cmocka_unit_test(test_unfold_in_vain),
        cmocka_unit_test(test_unfold_wild),
        cmocka_unit_test(test_cut_smooth),
        cmocka_unit_test(test_sides),
        cmocka_unit_test(test_cut),
        cmocka_unit_test(test_cut_coarse),
        cmocka_unit_test(test_strength),
        cmocka_unit_test(test_accuracy_torus),
        cmocka_unit_test(test_accuracy_ends),
        cmocka_unit_test(test_noisy_ends),
        cmocka_unit_test(test_short_arc),
        cmocka_unit_test(test_excess),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_tie),
        cmocka_unit_test(test_noise_level),
        cmocka_unit_test(test_angle),
        cmocka_unit_test(test_off),
        cmocka_unit_test(test_reaches),
        cmocka_unit_test(test_numbering),
        cmocka_unit_test(test_gap),
        cmocka_unit_test(test_falls),
        cmocka_unit_test(test_falls_begin),
        cmocka_unit_test(test_width),
        cmocka_unit_test(test_margin),
        cmocka_unit_test(test_scan),
        cmocka_unit_test(test_blocks),
    };
    return cmocka_run_group_tests(tests, setup, context_teardown);
}
