/* Whatever surface the checks let through goes through all work of the host: order, hierarchy, start,
 * cut locus, paths, cut. The input is a recipe: a surface to begin with, then changes of its corners and
 * triangles, then the source. */
#include "fuzz.h"

#include "base/vec3.h"
#include "cut/cut.h"
#include "levels/coarsen.h"
#include "solver/start.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_VERTICES = 400, MAX_TRIANGLES = 800 };

typedef struct recipe {
    const uint8_t *at, *end;
    double xyz[3 * MAX_VERTICES];
    int32_t triangle[3 * MAX_TRIANGLES];
    int32_t nv, nt;
} recipe;

static dmk_context *ctx;
static recipe r;

static int take(void)
{
    return r.at < r.end ? *r.at++ : 0;
}

/* ---- surfaces to begin with ---- */

static void put_vertex(double x, double y, double z)
{
    if (r.nv == MAX_VERTICES) return;
    double *v = r.xyz + 3 * r.nv++;
    v[0] = x, v[1] = y, v[2] = z;
}

static void put_triangle(int32_t a, int32_t b, int32_t c)
{
    if (r.nt == MAX_TRIANGLES) return;
    int32_t *t = r.triangle + 3 * r.nt++;
    t[0] = a, t[1] = b, t[2] = c;
}

/* A ring of n corners between two poles. */
static void make_bipyramid(int n, double dx)
{
    int32_t first = r.nv;
    put_vertex(dx, 0, 1);
    put_vertex(dx, 0, -1);
    for (int i = 0; i < n; i++) put_vertex(dx + cos(6.2831853 * i / n), sin(6.2831853 * i / n), 0);
    for (int i = 0; i < n; i++) {
        int32_t a = first + 2 + i, b = first + 2 + (i + 1) % n;
        put_triangle(first, a, b);
        put_triangle(first + 1, b, a);
    }
}

/* m x n squares on a torus; open in the first or both directions if wanted. */
static void make_grid(int m, int n, bool open_u, bool open_v, bool twisted)
{
    for (int i = 0; i < m; i++) {
        for (int j = 0; j < n; j++) {
            double u = 6.2831853 * i / m, v = 6.2831853 * j / n;
            put_vertex((2 + cos(v)) * cos(u), (2 + cos(v)) * sin(u), sin(v));
        }
    }
    for (int i = 0; i < m - open_u; i++) {
        for (int j = 0; j < n - open_v; j++) {
            bool turn = twisted && i == m - 1; /* a Klein bottle */
            int i1 = (i + 1) % m, j1 = (j + 1) % n;
            int k = turn ? (n - j) % n : j, k1 = turn ? (n - j1) % n : j1;
            put_triangle(i * n + j, i1 * n + k, i1 * n + k1);
            put_triangle(i * n + j, i1 * n + k1, i * n + j1);
        }
    }
}

static void make_surface(int kind)
{
    int m = 3 + kind / 16 % 8, n = 3 + kind / 128 * 3;
    r.nv = r.nt = 0;
    switch (kind % 8) {
    case 0: make_bipyramid(m, 0); break;
    case 1: make_grid(m, n, false, false, false); break;
    case 2: make_grid(m, n, true, false, false); break;
    case 3: make_grid(m, n, true, true, false); break;
    case 4: make_grid(m, n, false, false, true); break;
    case 5: make_bipyramid(m, 0), make_bipyramid(m + 1, 4); break;
    case 6: make_bipyramid(40 + m, 0); break;
    default: make_grid(16, 12, false, false, false); break;
    }
}

/* ---- changes ---- */

static double special(int i)
{
    static const double values[] = {0,      -1,    1e-300, 1e300, 1e-12, 1e-8, 1e8,      NAN,
                                    1e-160, 1e160, 1e74,   1e-64, 0.5,   3,    INFINITY, 1 + 1e-15};
    return values[i % 16];
}

/* The corner that ends the half-edge opposite corner h, and whose triangle lies beyond it. */
static int32_t find_beyond(int32_t h)
{
    int32_t t = h / 3 * 3, a = r.triangle[t + (h + 1) % 3], b = r.triangle[t + (h + 2) % 3];
    for (int32_t g = 0; g < 3 * r.nt; g++) {
        int32_t s = g / 3 * 3;
        if (r.triangle[s + (g % 3 + 1) % 3] == b && r.triangle[s + (g % 3 + 2) % 3] == a) return g;
    }
    return -1;
}

static void flip_edge(int32_t h)
{
    int32_t g = find_beyond(h), t = h / 3 * 3;
    if (g < 0) return;
    int32_t c = r.triangle[h], d = r.triangle[g], a = r.triangle[t + (h % 3 + 1) % 3];
    int32_t b = r.triangle[t + (h % 3 + 2) % 3], s = g / 3 * 3;
    memcpy(r.triangle + t, (int32_t[3]){c, a, d}, sizeof(int32_t[3]));
    memcpy(r.triangle + s, (int32_t[3]){c, d, b}, sizeof(int32_t[3]));
}

static void split_edge(int32_t h, double part)
{
    int32_t g = find_beyond(h), v = r.nv, t = h / 3 * 3;
    if (r.nv == MAX_VERTICES || r.nt + 2 > MAX_TRIANGLES) return;
    int32_t c = r.triangle[h], a = r.triangle[t + (h % 3 + 1) % 3],
            b = r.triangle[t + (h % 3 + 2) % 3];
    const double *x = r.xyz + 3 * a, *y = r.xyz + 3 * b;
    put_vertex(x[0] + part * (y[0] - x[0]), x[1] + part * (y[1] - x[1]),
               x[2] + part * (y[2] - x[2]));
    memcpy(r.triangle + t, (int32_t[3]){c, a, v}, sizeof(int32_t[3]));
    put_triangle(c, v, b);
    if (g < 0) return;
    int32_t d = r.triangle[g];
    memcpy(r.triangle + g / 3 * 3, (int32_t[3]){d, b, v}, sizeof(int32_t[3]));
    put_triangle(d, v, a);
}

static void split_triangle(int32_t t, double part)
{
    int32_t v = r.nv, *c = r.triangle + 3 * t;
    if (r.nv == MAX_VERTICES || r.nt + 2 > MAX_TRIANGLES) return;
    double x[3];
    for (int i = 0; i < 3; i++) {
        x[i] = (1 - part) * r.xyz[3 * c[0] + i] +
               0.5 * part * (r.xyz[3 * c[1] + i] + r.xyz[3 * c[2] + i]);
    }
    put_vertex(x[0], x[1], x[2]);
    put_triangle(c[1], c[2], v);
    put_triangle(c[2], c[0], v);
    c[2] = v;
}

static void drop_triangle(int32_t t)
{
    if (r.nt < 2) return;
    r.nt--;
    memcpy(r.triangle + 3 * t, r.triangle + 3 * r.nt, sizeof(int32_t[3]));
}

/* b becomes a; what degenerates goes away. */
static void merge(int32_t a, int32_t b)
{
    for (int32_t i = 0; i < 3 * r.nt; i++) {
        if (r.triangle[i] == b) r.triangle[i] = a;
    }
    for (int32_t t = r.nt; t-- > 0;) {
        const int32_t *c = r.triangle + 3 * t;
        if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) drop_triangle(t);
    }
}

static void change(int what, int a, int b, int c)
{
    int32_t t = (a + 256 * (b & 3)) % r.nt, v = (a + 256 * (b & 1)) % r.nv, w = (b + 7 * c) % r.nv;
    static const double parts[] = {0.5, 1e-3, 1e-6, 1e-7, 1e-9, 1e-12, 1e-14, 0.999999};
    int32_t *p = r.triangle + 3 * t, s;
    switch (what % 14) {
    case 0: r.xyz[3 * v + b % 3] += (c - 128) / 256.0; break;
    case 1: r.xyz[3 * v + b % 3] = special(c); break;
    case 2:
    case 3: flip_edge(3 * t + c % 3); break;
    case 4:
    case 5: split_edge(3 * t + c % 3, parts[c / 4 % 8]); break;
    case 6: split_triangle(t, parts[c % 8]); break;
    case 7: drop_triangle(t); break;
    case 8: s = p[0], p[0] = p[1], p[1] = s; break;
    case 9: merge(v, w); break;
    case 10: put_triangle(p[0], p[1], p[2]); break;
    case 11:
        for (int i = 0; i < 3 * r.nv; i++) r.xyz[i] *= pow(10, (c - 128) / (b & 1 ? 1 : 16));
        break;
    case 12: put_vertex(a, b, c); break;
    default:
        for (int i = 0; i < r.nv; i++) r.xyz[3 * i + b % 3] *= special(c);
    }
}

/* ---- the work ---- */

static void check_locus(const dmk_locus *l, const dmk_mesh *m)
{
    dmk_locus_info info;
    dmk_mesh_info shape;
    size_t n_lines;
    const int32_t *offset, *index = dmk_locus_polylines(l, &offset, &n_lines);
    dmk_locus_get_info(l, &info);
    dmk_mesh_get_info(m, &shape);
    REQUIRE(isfinite(info.length) && info.length >= 0 && info.loops >= 0);
    for (size_t i = 0; i < info.n_vertices; i++) {
        const dmk_locus_vertex *v = dmk_locus_vertices(l, NULL) + i;
        REQUIRE(isfinite(v->xyz[0] + v->xyz[1] + v->xyz[2] + v->distance + v->meeting_angle +
                         v->source_angle));
        REQUIRE(v->strength >=
                0); /* never NaN; infinite on loops and between borders: not on spheres and disks */
        REQUIRE(isfinite(v->strength) || shape.euler < 1);
        REQUIRE(v->place.triangle >= 0 && v->place.triangle < m->n_triangles);
        REQUIRE(v->place.weight[0] >= 0 && v->place.weight[1] >= 0 && v->place.weight[2] >= 0);
    }
    for (size_t i = 0; n_lines > 0 && i < (size_t)offset[n_lines]; i++) {
        REQUIRE(index[i] >= 0 && (size_t)index[i] < info.n_vertices);
    }
}

static void check_path(const dmk_path *p, const dmk_mesh *m)
{
    REQUIRE(p->n >= 2 && isfinite(p->length) && p->length >= 0);
    for (size_t i = 0; i < p->n; i++) {
        const double *w = p->point[i].weight;
        REQUIRE(p->point[i].triangle >= 0 && p->point[i].triangle < m->n_triangles);
        REQUIRE(isfinite(w[0] + w[1] + w[2]) && fabs(w[0] + w[1] + w[2] - 1) < 1e-6);
    }
}

static bool all_finite(const double *x, int32_t n)
{
    for (int32_t i = 0; i < n; i++) {
        if (!isfinite(x[i])) return false;
    }
    return true;
}

/* The least altitude over the longest side of all triangles. */
static double thinnest(const dmk_mesh *m)
{
    double least = 1;
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const double *x[3];
        for (int k = 0; k < 3; k++) x[k] = m->xyz + 3 * m->triangle[3 * t + k];
        least = fmin(least, dmk_altitude_ratio(x[0], x[1], x[2]));
    }
    return least;
}

/* The locus, the cut or a path. Only a mesh of needles may be refused a cut. */
static void follow(const dmk_mesh *m, dmk_geodesics *g)
{
    int rc;
    dmk_locus *locus = NULL;
    dmk_mesh *cut = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    dmk_path path = {0};
    switch (take() % 3) {
    case 0:
        rc = dmk_locus_trace(ctx, g, NULL, &locus, NULL);
        REQUIRE(rc == DMK_OK);
        check_locus(locus, m);
        break;
    case 1:
        rc = dmk_locus_cut(ctx, g, NULL, NULL, &cut, &origin, &plane);
        REQUIRE(rc == DMK_OK || thinnest(m) < 1e-6);
        REQUIRE(rc != DMK_OK || all_finite(plane, 2 * cut->n_vertices));
        break;
    default: {
        dmk_point to = {(take() * 7) % m->n_triangles, {0.25, 0.5, 0.25}};
        rc = dmk_geodesics_paths(ctx, g, 1, &to, &path);
        if (rc == DMK_OK) check_path(&path, m);
    }
    }
    REQUIRE(rc == DMK_OK || (rc == DMK_E_MESH && *dmk_context_message(ctx)));
    dmk_locus_destroy(&locus);
    dmk_mesh_destroy(&cut);
    free(origin);
    free(plane);
    dmk_path_free(&path);
}

static dmk_point choose_source(const dmk_mesh *m)
{
    static const double weights[6][3] = {
        {1, 0, 0},           {0, 0.5, 0.5},         {0.2, 0.3, 0.5},
        {0, 1e-9, 1 - 1e-9}, {1e-15, 0, 1 - 1e-15}, {0, 0, 1}};
    dmk_point p = {(take() * 3) % m->n_triangles, {0}};
    memcpy(p.weight, weights[take() % 6], sizeof p.weight);
    return p;
}

static void work(const dmk_mesh *m)
{
    dmk_hierarchy h;
    dmk_geodesics *g = NULL;
    double *mid = NULL, *mu = NULL;
    REQUIRE(DMK_NEW(ctx, mid, (size_t)m->n_edges) == DMK_OK);
    REQUIRE(DMK_NEW(ctx, mu, (size_t)m->n_triangles) == DMK_OK);
    dmk_point source = choose_source(m);
    REQUIRE(dmk_hierarchy_create(ctx, m, 8, &h) == DMK_OK);
    dmk_hierarchy_free(&h);
    if (dmk_geodesics_create(ctx, m, 1, &source, NULL, &g) != DMK_OK) {
        /* Of all the corpus one surface in ten thousand. */
        REQUIRE(
            strstr(dmk_context_message(ctx), "paths wind around the mesh's spikes without end"));
        goto done;
    }
    REQUIRE(g->tolerance == 0 || thinnest(m) < 1e-6);
    dmk_geodesics_midpoints(ctx, g, mid);
    REQUIRE(dmk_start_density(ctx, m, g, mid, mu, NULL) == DMK_OK);
    REQUIRE(all_finite(g->distance, m->n_vertices) && all_finite(mid, m->n_edges));
    for (int32_t t = 0; t < m->n_triangles; t++) REQUIRE(isfinite(mu[t]) && mu[t] > 0);
    follow(m, g);
done:
    dmk_geodesics_destroy(&g);
    free(mid);
    free(mu);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    dmk_mesh *m = NULL;
    dmk_order order;
    if (!ctx) REQUIRE(dmk_context_create(&ctx) == DMK_OK);
    r.at = data;
    r.end = data + size;
    make_surface(take());
    for (int n = take() % 32; n > 0 && r.at < r.end && r.nt > 0; n--) {
        int what = take(), a = take(), b = take();
        change(what, a, b, take());
    }
    int rc = dmk_mesh_create(ctx, (size_t)r.nv, r.xyz, (size_t)r.nt, r.triangle, &m);
    REQUIRE(rc == DMK_OK || (rc == DMK_E_MESH && *dmk_context_message(ctx)));
    if (rc != DMK_OK) return 0;
    int32_t component = dmk_mesh_component(m, take() % m->n_triangles);
    REQUIRE(dmk_order_create(ctx, m, component, &order) == DMK_OK);
    work(order.mesh);
    dmk_order_free(&order);
    dmk_mesh_destroy(&m);
    return 0;
}
