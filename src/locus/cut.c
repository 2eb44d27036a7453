/* Cutting: split the triangles at the points of the graph, then separate the corners of each vertex
 * that are not joined by an uncut edge. */
#include "base/sets.h"
#include "locus/cut.h"
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Points keep this part of an edge from its ends, so that no triangle becomes a needle; the locus
 * itself may come nearer. */
static const double margin = 0.15;

typedef struct knife {
    const dmk_mesh *mesh;
    int32_t *point;    /* n_edges: the new vertex on the edge, or -1 */
    double *xyz;       /* 3 per vertex of the split mesh */
    int32_t *triangle; /* 3 per triangle of the split mesh */
    uint8_t *side;     /* 3 per triangle: edge opposite the corner is to be cut */
    int32_t n_vertices, n_triangles;
} knife;

static void add(knife *k, int32_t a, int32_t b, int32_t c, int cut_a, int cut_b, int cut_c)
{
    int32_t *v = k->triangle + 3 * k->n_triangles;
    uint8_t *s = k->side + 3 * k->n_triangles++;
    v[0] = a, v[1] = b, v[2] = c;
    s[0] = (uint8_t)cut_a, s[1] = (uint8_t)cut_b, s[2] = (uint8_t)cut_c;
}

/* Three points on the edges: a star around a point between them. */
static void split_in_six(knife *k, const int32_t *v, const int32_t *p)
{
    int32_t c = k->n_vertices++;
    for (int i = 0; i < 3; i++) {
        double sum = 0;
        for (int j = 0; j < 3; j++)
            sum += k->xyz[3 * p[j] + i];
        k->xyz[3 * c + i] = sum / 3;
    }
    for (int i = 0; i < 3; i++) {
        int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        add(k, c, v[i], p[i2], 0, 1, 0);
        add(k, c, p[i1], v[i], 0, 0, 1);
    }
}

/* Height over the longest side: small for needles. */
static double plumpness(const knife *k, int32_t a, int32_t b, int32_t c)
{
    const double *x[3] = {k->xyz + 3 * (size_t)a, k->xyz + 3 * (size_t)b, k->xyz + 3 * (size_t)c};
    double side[3][3], longest = 0, n = 0;
    for (int i = 0; i < 3; i++) {
        double length = 0;
        for (int j = 0; j < 3; j++) {
            side[i][j] = x[(i + 1) % 3][j] - x[i][j];
            length += side[i][j] * side[i][j];
        }
        longest = fmax(longest, length);
    }
    for (int j = 0; j < 3; j++) {
        int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        double normal = side[0][j1] * side[1][j2] - side[0][j2] * side[1][j1];
        n += normal * normal;
    }
    return sqrt(n) / longest;
}

/* The part of a triangle between corners b, c and the points q on the side a-b and r on c-a, which
 * the cut joins: by the diagonal that leaves the plumper triangles. */
static void split_rest(knife *k, int32_t b, int32_t c, int32_t q, int32_t r)
{
    double from_q = fmin(plumpness(k, q, b, c), plumpness(k, q, c, r));
    double from_r = fmin(plumpness(k, r, q, b), plumpness(k, r, b, c));
    if (from_q >= from_r) {
        add(k, q, b, c, 0, 0, 0);
        add(k, q, c, r, 0, 1, 0);
    } else {
        add(k, r, q, b, 0, 0, 1);
        add(k, r, b, c, 0, 0, 0);
    }
}

/* p[i]: the point on the edge opposite corner i, or -1. */
static void split(knife *k, const int32_t *v, const int32_t *p)
{
    int n = (p[0] >= 0) + (p[1] >= 0) + (p[2] >= 0);
    if (n == 3) {
        split_in_six(k, v, p);
    } else if (n == 0) {
        add(k, v[0], v[1], v[2], 0, 0, 0);
    } else if (n == 1) {
        int i = p[0] >= 0 ? 0 : p[1] >= 0 ? 1 : 2, i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        add(k, v[i], v[i1], p[i], 0, 0, 0);
        add(k, v[i], p[i], v[i2], 0, 0, 0);
    } else {
        int i = p[0] < 0 ? 0 : p[1] < 0 ? 1 : 2, i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        add(k, v[i], p[i2], p[i1], 1, 0, 0);
        split_rest(k, v[i1], v[i2], p[i2], p[i1]);
    }
}

/* A slit of two edges at the farthest vertex, roughly opposite each other. */
static void slit(knife *k, const dmk_rays *r)
{
    const dmk_mesh *m = k->mesh;
    int32_t far = 0, h = 0, n = 0;
    for (int32_t v = 0; v < m->n_vertices; v++) {
        if (dmk_rays_first(r, v)->distance > dmk_rays_first(r, far)->distance) far = v;
    }
    while (m->triangle[h] != far)
        h++;
    for (int32_t g = h; n == 0 || g != h;
         n++) { /* counterclockwise over the edge after g's corner */
        int32_t o = r->across[g / 3 * 3 + (g % 3 + 1) % 3];
        g = o / 3 * 3 + (o % 3 + 1) % 3;
    }
    for (int32_t i = 0, g = h; i < n; i++) {
        int32_t own = g / 3 * 3 + (g % 3 + 1) % 3, o = r->across[own];
        if (i == 0 || i == n / 2) k->side[own] = k->side[o] = 1;
        g = o / 3 * 3 + (o % 3 + 1) % 3;
    }
}

/* Points on the edges that the graph crosses, then the split triangles. */
static int split_all(dmk_context *ctx, const dmk_mesh *m, const dmk_rays *r, const dmk_net *net,
                     const dmk_dual *dual, knife *k)
{
    int rc;
    int32_t n_points = 0;
    for (int32_t i = 0; i < net->n; i++)
        n_points += net->node[i].edge >= 0 && net->node[i].at.degree;
    DMK_TRY(DMK_NEW(ctx, k->point, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, k->xyz, 3 * ((size_t)m->n_vertices + 2 * (size_t)n_points)));
    DMK_TRY(DMK_NEW(ctx, k->triangle, 3 * ((size_t)m->n_triangles + 4 * (size_t)n_points)));
    DMK_TRY(DMK_NEW(ctx, k->side, 3 * ((size_t)m->n_triangles + 4 * (size_t)n_points)));
    k->mesh = m;
    k->n_vertices = m->n_vertices;
    memcpy(k->xyz, m->xyz, 3 * (size_t)m->n_vertices * sizeof *k->xyz);
    for (int32_t e = 0; e < m->n_edges; e++)
        k->point[e] = -1;
    for (int32_t i = 0; i < net->n; i++) {
        const dmk_node *node = &net->node[i];
        if (node->edge < 0 || node->at.degree == 0) continue;
        const int32_t *end = m->edge_vertex + 2 * node->edge;
        const int32_t *corner = m->triangle + 3 * node->at.place.triangle;
        double s = 0;
        for (int c = 0; c < 3; c++)
            s += corner[c] == end[1] ? node->at.place.weight[c] : 0;
        s = fmin(1 - margin, fmax(margin, s));
        for (int j = 0; j < 3; j++) {
            k->xyz[3 * k->n_vertices + j] =
                (1 - s) * m->xyz[3 * end[0] + j] + s * m->xyz[3 * end[1] + j];
        }
        k->point[node->edge] = k->n_vertices++;
    }
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *e = m->triangle_edge + 3 * t;
        split(k, m->triangle + 3 * t, (int32_t[3]){k->point[e[0]], k->point[e[1]], k->point[e[2]]});
    }
    if (n_points == 0 && dual->n_loops == 0 && m->n_border_edges == 0) slit(k, r);
done:
    return rc;
}

/* Number the classes of corners that uncut edges join; the first class of a vertex comes in the
 * vertices' order, further ones behind. */
static int separate(dmk_context *ctx, const dmk_mesh *whole, const knife *k, dmk_mesh **cut,
                    int32_t **origin)
{
    int rc;
    int32_t n = 3 * k->n_triangles, *parent = NULL, *number = NULL, *first = NULL, *tri = NULL;
    int32_t *from = NULL, n_new = k->n_vertices;
    double *xyz = NULL;
    DMK_TRY(DMK_NEW(ctx, parent, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, number, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, first, (size_t)k->n_vertices));
    DMK_TRY(DMK_NEW(ctx, tri, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, from, (size_t)k->n_vertices + (size_t)n));
    for (int32_t c = 0; c < n; c++)
        parent[c] = c;
    for (int32_t e = 0; e < whole->n_edges; e++) {
        int32_t corner[2][2], t[2] = {whole->edge_triangle[2 * e], whole->edge_triangle[2 * e + 1]};
        bool uncut = t[1] >= 0;
        for (int s = 0; s < 2 && uncut; s++) {
            for (int i = 0; i < 3; i++) {
                int32_t h = 3 * t[s] + i;
                if (whole->triangle_edge[h] == e && k->side[h]) uncut = false;
                if (whole->triangle[h] == whole->edge_vertex[2 * e]) corner[s][0] = h;
                if (whole->triangle[h] == whole->edge_vertex[2 * e + 1]) corner[s][1] = h;
            }
        }
        for (int i = 0; uncut && i < 2; i++)
            dmk_set_unite(parent, corner[0][i], corner[1][i]);
    }
    DMK_TRY(dmk_poll(ctx));
    for (int32_t v = 0; v < k->n_vertices; v++) {
        first[v] = -1;
        from[v] = v;
    }
    for (int32_t c = 0; c < n; c++) {
        int32_t v = k->triangle[c];
        if (parent[c] == c) {
            number[c] = first[v] < 0 ? v : n_new;
            if (first[v] >= 0) from[n_new++] = v;
            first[v] = c;
        }
        tri[c] = number[dmk_set_find(parent, c)];
    }
    DMK_TRY(DMK_NEW(ctx, xyz, 3 * (size_t)n_new));
    for (int32_t v = 0; v < n_new; v++)
        memcpy(xyz + 3 * v, k->xyz + 3 * from[v], 3 * sizeof *xyz);
    for (int32_t v = 0; v < n_new; v++)
        from[v] = from[v] < k->mesh->n_vertices ? from[v] : -1;
    DMK_TRY(dmk_poll(ctx));
    rc = dmk_mesh_adopt(ctx, (size_t)n_new, xyz, (size_t)k->n_triangles, tri, cut);
    xyz = NULL;
    tri = NULL;
    if (rc != DMK_OK || !origin) goto done;
    *origin = from;
    from = NULL;
done:
    free(parent);
    free(number);
    free(first);
    free(tri);
    free(from);
    free(xyz);
    return rc;
}

/* The split mesh as a mesh of its own, for its edges. */
static int join_split(dmk_context *ctx, const knife *k, dmk_mesh **whole)
{
    return dmk_mesh_create(ctx, (size_t)k->n_vertices, k->xyz, (size_t)k->n_triangles, k->triangle,
                           whole);
}

int dmk_locus_cut(dmk_context *ctx, const dmk_locus_input *in, const dmk_locus_options *opt,
                  dmk_mesh **cut, int32_t **origin)
{
    int rc;
    dmk_rays rays = {0};
    dmk_dual dual = {0};
    dmk_net net = {0};
    knife k = {0};
    dmk_mesh *whole = NULL;
    double threshold = dmk_locus_threshold(opt);
    DMK_TRY(dmk_rays_create(ctx, in, &rays));
    DMK_TRY(dmk_dual_create(ctx, &rays, threshold, &dual));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_net_create(ctx, &rays, &dual, threshold, &net));
    dmk_net_strip(&net);
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(split_all(ctx, in->mesh, &rays, &net, &dual, &k));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(join_split(ctx, &k, &whole));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(separate(ctx, whole, &k, cut, origin));
done:
    dmk_mesh_destroy(&whole);
    free(k.point);
    free(k.xyz);
    free(k.triangle);
    free(k.side);
    dmk_net_free(&net);
    dmk_dual_free(&dual);
    dmk_rays_free(&rays);
    return rc;
}
