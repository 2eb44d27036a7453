/* Which mesh edges the cut locus crosses: a spanning tree of the vertices along edges whose ends
 * are reached by one family of geodesics; the dual of the other edges is a graph on the triangles
 * that is connected and has first Betti number 2g, whatever the strengths; its weak ends are
 * stripped. */
#include "base/sets.h"
#include "locus/net.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In radians times the cube root of (mesh edge / distance): two geodesics of one family that end at
 * neighbouring vertices may differ by as much, near where they meet. */
static const double least_turn = 1.0;
/* Rays that go apart this many times faster than in the plane do not cross by chance. */
static const double hyperbolic = 3;
/* In mean edges: cusps known no better than this do not tell whether two rays are of one family. */
static const double doubtful = 1.5;
static const double pi = 3.14159265358979323846;
/* A branch with a cusp of the rays on its way back to the source is there from that cusp on; it is
 * kept from so far behind it on, in mesh edges times the threshold. */
static const double least_depth = 0.2;
/* On a rough mesh the bends add up as in a random walk: so many times the roughness times the
 * square root of (distance / mesh edge). */
static const double noise_turn = 4.0;

double dmk_rays_walk(const dmk_rays *r, double distance, double size)
{
    return noise_turn * r->noise * sqrt(distance / size);
}

/* How far the angle between two geodesics exceeds what the mesh may make of one family's, as a
 * ratio. Where rays go apart faster than in the plane, small angles are large differences: the
 * angle counts by how much faster. Where cusps are not known well enough to find the branches that
 * come from one, it counts by the square of that from `hyperbolic` times on. */
static double find_excess(const dmk_rays *r, const dmk_sheet *a, const dmk_sheet *b, double size)
{
    double turn = fabs(dmk_chart_turn(&r->chart, a->angle, b->angle));
    double mean = 0.5 * (a->distance + b->distance);
    double wide = fmax(1, fmin(a->spread, b->spread) / mean),
           fast = wide * fmax(1, wide / hyperbolic);
    bool rough = r->smooth || r->profile.doubt > doubtful * r->mean;
    double by_bend = turn * (rough ? fast : 1) / (least_turn * cbrt(size / mean));
    double by_noise = turn * (r->smooth ? wide : fast) / dmk_rays_walk(r, mean, size);
    return fmin(by_bend, by_noise);
}

/* The width of the beam between the geodesics to the ends of edge e, in mesh edges, brought below
 * the threshold where they may be of one family. *held: by theory they are of two, as the rays
 * between them have a cusp on their way here. */
static double find_strength(const dmk_rays *r, int32_t e, double threshold, bool *held)
{
    const dmk_mesh *m = r->mesh;
    int32_t v = m->edge_vertex[2 * e], w = m->edge_vertex[2 * e + 1];
    const dmk_sheet *a = dmk_rays_first(r, v), *b = dmk_rays_first(r, w);
    double size = fmax(m->length[e], fmax(r->size[v], r->size[w]));
    double ratio = dmk_rays_width(r, a, b) / size, mean = 0.5 * (a->distance + b->distance);
    double least = least_depth * threshold * size;
    const dmk_cusp *cusp = dmk_rays_cusp(r, a->angle, b->angle, 0, mean - least);
    double depth = cusp ? mean - cusp->distance : 0;
    *held = cusp && depth > cusp->doubt;
    if (ratio > threshold) {
        double excess = find_excess(r, a, b, size);
        if (excess < 1) ratio = threshold * excess;
    }
    return *held ? fmax(ratio, depth / (least_depth * size)) : ratio;
}

/* Where x lies between a and b, as a share, by its logarithm: rays that go apart fast differ by
 * angles that are small and smaller. */
static double place(double x, double a, double b)
{
    return x <= a ? 0 : fmin(1, log(x / a) / log(b / a));
}

/* All strengths. The triangles around the source are of one family by definition. order: by angle
 * among weak edges, so that the tree does not cross the ridges that continue the locus beyond its
 * ends, by strength among strong ones. */
static void find_strengths(const dmk_rays *r, double threshold, dmk_dual *d, uint16_t *order)
{
    const dmk_mesh *m = r->mesh;
    for (int32_t e = 0; e < m->n_edges; e++) {
        const dmk_sheet *a = dmk_rays_first(r, m->edge_vertex[2 * e]);
        const dmk_sheet *b = dmk_rays_first(r, m->edge_vertex[2 * e + 1]);
        double turn = fabs(dmk_chart_turn(&r->chart, a->angle, b->angle));
        double ratio = find_strength(r, e, threshold, &d->held[e]);
        bool weak = ratio <= threshold;
        d->strength[e] = (float)ratio;
        order[e] =
            (uint16_t)(weak ? 4095 * place(turn, 1e-8, pi) : 4096 + 4095 * place(ratio, 1, 1e5));
    }
    for (int32_t i = 0; i < r->chart.n_sectors; i++) {
        const int32_t *e = m->triangle_edge + 3 * r->chart.sector[i].triangle;
        for (int k = 0; k < 3; k++) {
            d->strength[e[k]] = 0;
            d->held[e[k]] = false;
            order[e[k]] = 0;
        }
    }
}

/* The edges sorted by `order` (below 8192), by counting. */
static int sort_edges(dmk_context *ctx, int32_t n_edges, const uint16_t *order, int32_t *sorted)
{
    int rc;
    int32_t *start = NULL;
    DMK_TRY(DMK_NEW(ctx, start, 8193));
    for (int32_t e = 0; e < n_edges; e++)
        start[order[e] + 1]++;
    for (int k = 0; k < 8192; k++)
        start[k + 1] += start[k];
    for (int32_t e = 0; e < n_edges; e++)
        sorted[start[order[e]]++] = e;
done:
    free(start);
    return rc;
}

/* Kruskal's tree; dual->kept becomes true for the edges outside of it. */
static int span(dmk_context *ctx, const dmk_rays *r, double threshold, dmk_dual *d)
{
    int rc;
    const dmk_mesh *m = r->mesh;
    int32_t *parent = NULL, *sorted = NULL;
    uint16_t *order = NULL;
    DMK_TRY(DMK_NEW(ctx, parent, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, order, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, sorted, (size_t)m->n_edges));
    find_strengths(r, threshold, d, order);
    DMK_TRY(sort_edges(ctx, m->n_edges, order, sorted));
    for (int32_t v = 0; v < m->n_vertices; v++)
        parent[v] = v;
    for (int32_t i = 0; i < m->n_edges; i++) {
        int32_t e = sorted[i];
        d->kept[e] = !dmk_set_unite(parent, m->edge_vertex[2 * e], m->edge_vertex[2 * e + 1]);
    }
done:
    free(parent);
    free(order);
    free(sorted);
    return rc;
}

/* Strip triangles with one kept edge as long as that edge is weak. Borders are no triangles: an arc
 * that ends there stays. */
static int prune(dmk_context *ctx, const dmk_mesh *m, double threshold, dmk_dual *d)
{
    int rc;
    int32_t *stack = NULL, top = 0;
    DMK_TRY(DMK_NEW(ctx, stack, (size_t)m->n_triangles));
    memset(d->degree, 0, (size_t)m->n_triangles);
    for (int32_t h = 0; h < 3 * m->n_triangles; h++)
        d->degree[h / 3] += d->kept[m->triangle_edge[h]];
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (d->degree[t] == 1) stack[top++] = t;
    }
    while (top > 0) {
        int32_t t = stack[--top], e = -1;
        if (d->degree[t] != 1) continue;
        for (int k = 0; k < 3; k++) {
            if (d->kept[m->triangle_edge[3 * t + k]]) e = m->triangle_edge[3 * t + k];
        }
        if (d->strength[e] >= threshold || d->held[e]) continue;
        int32_t other =
            m->edge_triangle[2 * e] == t ? m->edge_triangle[2 * e + 1] : m->edge_triangle[2 * e];
        d->kept[e] = false;
        d->degree[t] = 0;
        if (other >= 0 && --d->degree[other] == 1) stack[top++] = other;
    }
done:
    free(stack);
    return rc;
}

static int count_border_loops(dmk_context *ctx, const dmk_mesh *m, int32_t *n_loops)
{
    int rc;
    int32_t *parent = NULL;
    *n_loops = 0;
    DMK_TRY(DMK_NEW(ctx, parent, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++)
        parent[v] = v;
    for (int32_t e = 0; e < m->n_edges; e++) {
        if (m->edge_triangle[2 * e + 1] >= 0) continue;
        *n_loops += 1 - dmk_set_unite(parent, m->edge_vertex[2 * e], m->edge_vertex[2 * e + 1]);
    }
done:
    free(parent);
    return rc;
}

/* Euler count: edges - nodes + 1 of the kept graph, border loops being nodes, against 2g of the
 * surface with its border loops closed by disks. Connected, since stripping ends disconnects
 * nothing: the count would be too large otherwise. */
static int check(dmk_context *ctx, const dmk_mesh *m, dmk_dual *d)
{
    int64_t nodes = d->n_loops, edges = 0;
    for (int32_t t = 0; t < m->n_triangles; t++)
        nodes += d->degree[t] > 0;
    for (int32_t e = 0; e < m->n_edges; e++)
        edges += d->kept[e];
    d->n_kept = (int32_t)edges;
    d->betti = edges > 0 || nodes > 0 ? edges - nodes + 1 : 0;
    int64_t euler = (int64_t)m->n_vertices - m->n_edges + m->n_triangles + d->n_loops;
    if (d->betti == 2 - euler) return DMK_OK;
    return dmk_fail(ctx, DMK_E_MESH,
                    "the cut locus has first Betti number %lld where the surface asks for %lld: is "
                    "the mesh connected and a manifold?",
                    (long long)d->betti, (long long)(2 - euler));
}

int dmk_dual_create(dmk_context *ctx, const dmk_rays *r, double threshold, dmk_dual *d)
{
    int rc;
    const dmk_mesh *m = r->mesh;
    memset(d, 0, sizeof *d);
    DMK_TRY(DMK_NEW(ctx, d->strength, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, d->kept, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, d->held, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, d->degree, (size_t)m->n_triangles));

    DMK_TRY(span(ctx, r, threshold, d));
    DMK_TRY(count_border_loops(ctx, m, &d->n_loops));
    DMK_TRY(prune(ctx, m, threshold, d));
    DMK_TRY(check(ctx, m, d));
done:
    if (rc != DMK_OK) dmk_dual_free(d);
    return rc;
}

void dmk_dual_free(dmk_dual *d)
{
    free(d->strength);
    free(d->kept);
    free(d->held);
    free(d->degree);
    memset(d, 0, sizeof *d);
}
