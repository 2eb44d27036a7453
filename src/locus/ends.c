/* Where the lines end: each branch is led to its cusp; a locus without extent becomes a point. */
#include "base/vec3.h"
#include "locus/cotree.h"

#include <stdlib.h>
#include <string.h>

enum { MAX_ROUTE = 256, MAX_FITS = 12 };

/* A branch around its end: its crossings in their order, the outermost last. */
typedef struct route {
    int32_t n, end, crossing[MAX_ROUTE]; /* crossing[end]: the last with the default excess */
} route;

/* The strongest crossing that hands on to i out of triangle `node`, -1: none. */
static int32_t child_of(const dmk_cotree *t, int32_t i, int32_t node)
{
    int32_t best = -1;
    for (int k = 0; k < 3; k++) {
        const int32_t j = t->on[3 * node + k];
        if (j < 0 || j == i || t->crossing[j].onward != i) continue;
        const dmk_crossing *a = &t->crossing[j], *b = &t->crossing[best < 0 ? j : best];
        if (best < 0 || a->worth > b->worth || (a->worth == b->worth && a->excess > b->excess))
            best = j;
    }
    return best;
}

/* A branch ends at crossing i, out of `node`: what comes from there is weaker than the default. */
static bool ends_at(const dmk_cotree *t, int32_t i, int32_t node)
{
    const dmk_crossing *c = &t->crossing[i];
    if (c->worth < t->strength || node >= t->geodesics->mesh->n_triangles) return false;
    const int32_t child = child_of(t, i, node);
    return child < 0 || t->crossing[child].worth < t->strength;
}

static double step(const dmk_cotree *t, int32_t i, int32_t j)
{
    return dmk_distance(t->crossing[i].xyz, t->crossing[j].xyz);
}

/* Inwards up to `reach`, and no farther than the branch nor past another, which the end would leave behind if it
 * were led there; outwards along the strongest way. */
static void find_route(const dmk_cotree *t, int32_t i, int32_t node, double reach, route *r)
{
    double length = 0;
    int32_t back[MAX_ROUTE / 2], n = 0, node_in = dmk_other_node(&t->crossing[i], node);
    for (int32_t j = i; n < MAX_ROUTE / 2 && length < reach;) {
        back[n++] = j;
        /* inwards of the last crossing lies the branch's other half */
        const int32_t next = j == t->last ? child_of(t, j, node_in) : t->crossing[j].onward;
        if (next < 0 || t->strength_of[next] != t->strength_of[i] ||
            (n > 1 && next == back[n - 2]) || dmk_branch_at(t, node_in) >= t->strength)
            break;
        length += step(t, j, next);
        if (j == t->last) break;
        node_in = dmk_other_node(&t->crossing[next], node_in);
        j = next;
    }
    r->n = 0;
    while (n > 0) r->crossing[r->n++] = back[--n];
    r->end = r->n - 1;
    for (int32_t j = child_of(t, i, node); j >= 0 && r->n < MAX_ROUTE; j = child_of(t, j, node)) {
        /* farther out all is one family, where the tree hangs on rounding */
        if (dmk_snap(t->crossing[j].excess, t->crossing[j].distance) == 0) break;
        r->crossing[r->n++] = j;
        node = dmk_other_node(&t->crossing[j], node);
        if (node >= t->geodesics->mesh->n_triangles) break;
    }
}

/* The triangle between the crossings k and k + 1 of the route; behind the last one that which it leads to. */
static int32_t triangle_after(const dmk_cotree *t, const route *r, int32_t k)
{
    const dmk_crossing *c = &t->crossing[r->crossing[k]];
    if (k + 1 == r->n) return c->node[c->outer];
    const int32_t *next = t->crossing[r->crossing[k + 1]].node;
    return c->node[0] == next[0] || c->node[0] == next[1] ? c->node[0] : c->node[1];
}

static int32_t nearest_on(const dmk_cotree *t, const route *r, const double xyz[3])
{
    int32_t best = 0;
    double least = HUGE_VAL;
    for (int32_t k = 0; k < r->n; k++) {
        const double d = dmk_distance_squared(t->crossing[r->crossing[k]].xyz, xyz);
        if (d < least) least = d, best = k;
    }
    return best;
}

/* How far beyond its end a branch's cusp lies: did families meet at one angle all the way, the excess at the end would
 * be (1 - cos(alpha / 2)) times it, but for falls of d that count from there on. On smooth meshes of all sizes the way
 * is 0.95 to 1.2 of this. */
static double way_left(const dmk_cotree *t, const route *r)
{
    const int32_t i = r->crossing[r->end], behind = r->crossing[dmk_min_i(r->end + 1, r->n - 1)];
    const double excess =
        fmin(t->crossing[i].excess, t->crossing[behind].excess + step(t, i, behind));
    return excess / (1 - cos(0.5 * t->crossing[i].alpha));
}

/* A branch's own cusp lies up to 3 times the way left from its end, with 5 % noise too; one far out on scans is other
 * families', at up to 30 times. */
static bool reaches(const dmk_cotree *t, const route *r, int32_t cusp)
{
    double way = 0;
    for (int32_t k = r->end; k < cusp; k++) way += step(t, r->crossing[k], r->crossing[k + 1]);
    return way <= dmk_rules.gap * way_left(t, r);
}

/* `way` beyond the end along the route. */
static void point_beyond(const dmk_cotree *t, const route *r, double way, double xyz[3])
{
    double length = 0;
    int32_t k = r->end;
    while (k + 1 < r->n && (length = step(t, r->crossing[k], r->crossing[k + 1])) <= way)
        way -= length, k++;
    const double part = k + 1 < r->n ? way / length : 0, *x = t->crossing[r->crossing[k]].xyz;
    const double *y = t->crossing[r->crossing[k + (part > 0)]].xyz;
    for (int i = 0; i < 3; i++) xyz[i] = x[i] + part * (y[i] - x[i]);
}

/* Fits around the route's crossings until the cusp lies beside the crossing it was fitted around. */
static bool find_cusp(const dmk_cotree *t, dmk_patch *patch, const route *r, double xyz[3])
{
    const double h = t->mean_edge;
    int32_t k = r->end, tried = -1;
    for (int i = 0; i < MAX_FITS; i++) {
        const dmk_crossing *c = &t->crossing[r->crossing[k]];
        const int32_t v = t->geodesics->mesh->triangle[dmk_next(c->half)];
        const int32_t w = t->geodesics->mesh->triangle[dmk_previous(c->half)];
        const dmk_arrival *from = t->geodesics->arrival + v, *to = t->geodesics->arrival + w;
        const double full = dmk_turn_around(t->geodesics, from->source);
        const double half = 0.5 * dmk_turn_between(full, from->direction, to->direction);
        dmk_cusp cusp = {.angle = from->direction + half, .distance = c->distance};
        memcpy(cusp.xyz, c->xyz, sizeof cusp.xyz);
        int32_t next = k;
        if (dmk_cusp_fit(patch, c->half, &cusp)) {
            next = nearest_on(t, r, cusp.xyz);
            if (next == tried || step(t, r->crossing[next], r->crossing[k]) < 0.5 * h) {
                memcpy(xyz, cusp.xyz, sizeof cusp.xyz);
                return reaches(t, r, next);
            }
        } else { /* nothing to be seen from here: farther out */
            while (next + 1 < r->n && step(t, r->crossing[next], r->crossing[k]) < h) next++;
            if (next == k) return false;
        }
        tried = k;
        k = next;
    }
    return false;
}

static int add_end(dmk_context *ctx, dmk_cotree *t, dmk_end_point end)
{
    int rc = DMK_GROW(ctx, t->end, (size_t)t->n_ends + 1, t->end_room);
    if (rc == DMK_OK) t->end[t->n_ends++] = end;
    return rc;
}

/* Where no cusp is seen a noisy mesh's branch ends where its excess does, as far out as cusps are fitted. If a fitted
 * cusp falls short of that, it ends between: half way if noise is as strong as the default, less far if it is weaker,
 * and if it is stronger, for it adds to the excess. */
static void place_end(const dmk_cotree *t, dmk_patch *patch, const route *r, double xyz[3])
{
    const double way = way_left(t, r), noise = dmk_rules.noise * t->noise / t->strength;
    if (!find_cusp(t, patch, r, xyz)) {
        point_beyond(t, r, fmin(1, noise) * fmin(way, dmk_rules.window * t->mean_edge), xyz);
    } else if (dmk_distance(xyz, t->crossing[r->crossing[r->end]].xyz) < way) {
        double beyond[3];
        point_beyond(t, r, way, beyond);
        for (int k = 0; k < 3; k++) xyz[k] += 0.5 * fmin(noise, 1 / noise) * (beyond[k] - xyz[k]);
    }
}

/* On a border are the crossings of its edges alone, so that in a file, too, ends are told from these: an end inside a
 * triangle is moved off it, by at most a thirtieth of the triangle. */
static void keep_inside(const dmk_cotree *t, dmk_end_point *end)
{
    bool on_border = false;
    dmk_point_snap(end->weight);
    for (int k = 0; k < 3; k++) {
        const int32_t h = 3 * end->triangle + k, v = t->geodesics->mesh->triangle[h];
        on_border |= end->weight[k] == 0 && t->geodesics->star.twin[h] < 0;
        on_border |= end->weight[k] == 1 && t->loop[v] >= 0;
    }
    for (int k = 0; k < 3 && on_border; k++) end->weight[k] += 0.05 * (1 / 3.0 - end->weight[k]);
}

/* The branch's strength up to the crossing before the end; behind it, less than the default. */
static int lead_to(dmk_context *ctx, dmk_cotree *t, const route *r, const double xyz[3])
{
    const dmk_mesh *m = t->geodesics->mesh;
    const int32_t near = nearest_on(t, r, xyz);
    dmk_end_point end = {.triangle = -1};
    double least = HUGE_VAL;
    int32_t upto = 0;
    for (int32_t k = near > 0 ? near - 1 : 0; k <= near; k++) {
        double weight[3];
        const int32_t triangle = triangle_after(t, r, k);
        if (triangle >= m->n_triangles) continue;
        const double d = dmk_mesh_nearest_in(m, triangle, xyz, weight);
        if (!(d < least) || d > sqrt(2 * m->area[triangle])) continue;
        least = (1 - 1e-9) * d; /* on the edge between two: in the inner one */
        upto = k;
        end = (dmk_end_point){triangle, r->crossing[k], {weight[0], weight[1], weight[2]}};
    }
    if (end.triangle < 0) return DMK_OK;
    const double strength = t->strength_of[r->crossing[0]];
    for (int32_t k = 0; k <= upto; k++) t->strength_of[r->crossing[k]] = strength;
    for (int32_t k = upto + 1; k < r->n; k++) {
        const int32_t i = r->crossing[k];
        t->strength_of[i] = fmin(t->crossing[i].worth, nextafter(t->strength, 0));
    }
    keep_inside(t, &end);
    return add_end(ctx, t, end);
}

/* half: the locus is a short one, from its middle to an end; else NULL. */
static int find_end(dmk_context *ctx, dmk_cotree *t, dmk_patch *patch, const double *middle,
                    const double *half, int32_t i, int32_t node)
{
    route r;
    double xyz[3], out[3];
    find_route(t, i, node, half ? HUGE_VAL : dmk_rules.window * t->mean_edge, &r);
    if (half) {
        dmk_subtract(t->crossing[r.crossing[r.n - 1]].xyz, middle, out);
        const double side = dmk_dot(out, half) > 0 ? 1 : -1;
        for (int k = 0; k < 3; k++) xyz[k] = middle[k] + side * half[k];
    } else {
        place_end(t, patch, &r, xyz);
    }
    return lead_to(ctx, t, &r, xyz);
}

/* Whether all that has the default strength lies within `reach` of the last crossing. */
static bool is_small(const dmk_cotree *t, double reach)
{
    if (t->last < 0) return false;
    for (int32_t i = 0; i < t->n; i++) {
        if (t->crossing[i].worth >= t->strength && step(t, i, t->last) > reach) return false;
    }
    return true;
}

/* The point: the middle of a short locus, or the last crossing. */
static int become_point(dmk_context *ctx, dmk_cotree *t, const double xyz[3])
{
    const dmk_mesh *m = t->geodesics->mesh;
    dmk_end_point best = {.triangle = t->crossing[t->last].node[0], .crossing = t->last};
    double least = HUGE_VAL, weight[3];
    for (int32_t i = 0; i < t->n; i++) { /* triangles near it have crossings near it */
        if (dmk_distance(t->crossing[i].xyz, xyz) > 2 * t->mean_edge && i != t->last) continue;
        for (int side = 0; side < 2; side++) {
            const int32_t triangle = t->crossing[i].node[side];
            const double d = triangle < m->n_triangles
                                 ? dmk_mesh_nearest_in(m, triangle, xyz, weight)
                                 : HUGE_VAL;
            if (!(d < least)) continue;
            least = d;
            best = (dmk_end_point){triangle, i, {weight[0], weight[1], weight[2]}};
        }
    }
    t->is_point = true;
    t->n_ends = 0;
    return add_end(ctx, t, best);
}

/* A small locus: a point, or an arc, with *half not 0, whose ends are found by themselves. What is strong is neither
 * where the fit leaves too much: it leaves 0.14 of half an arc at most, and 0.46 and more at a cube's corner. */
static int find_small(dmk_context *ctx, dmk_cotree *t, dmk_patch *patch, double middle[3],
                      double half[3])
{
    const dmk_crossing *c = &t->crossing[t->last];
    const bool strong = c->worth >= t->strength;
    double left;
    memcpy(middle, c->xyz, sizeof c->xyz);
    const bool fits = dmk_focus_fit(patch, c->half, middle, half, &left);
    const double reach = sqrt(dmk_dot(half, half)); /* an arc shorter than an edge is a point */
    const bool tree = strong && (!fits || left > 0.25 * reach + t->noise);
    if (tree) memset(half, 0, 3 * sizeof *half);
    if (tree || (strong && 2 * reach >= t->mean_edge)) return DMK_OK;
    return become_point(ctx, t, fits ? middle : c->xyz);
}

static int find_ends(dmk_context *ctx, dmk_cotree *t)
{
    int rc;
    dmk_patch *patch = NULL;
    double middle[3], half[3] = {0};
    DMK_TRY(dmk_patch_create(ctx, t, &patch));
    if (is_small(t, 2 * dmk_rules.window * t->mean_edge))
        DMK_TRY(find_small(ctx, t, patch, middle, half));
    const double *arc = dmk_dot(half, half) > 0 ? half : NULL;
    for (int32_t i = 0; i < t->n && !t->is_point; i++) {
        const dmk_crossing *c = &t->crossing[i];
        if (t->strength_of[i] < t->strength) continue; /* too weak, or beyond an end found before */
        for (int side = 0; side < 2 && c->outer >= 0; side++) {
            if (side != c->outer && i != t->last) continue;
            if (!ends_at(t, i, c->node[side])) continue;
            DMK_TRY(find_end(ctx, t, patch, middle, arc, i, c->node[side]));
        }
    }
    if (t->n_ends > 1) qsort(t->end, (size_t)t->n_ends, sizeof *t->end, dmk_end_by_triangle);
done:
    dmk_patch_free(&patch);
    return rc;
}

int dmk_cotree_complete(dmk_context *ctx, const dmk_geodesics *g, double mean_edge, dmk_cotree *t)
{
    int rc;
    DMK_TRY(dmk_cotree_create(ctx, g, mean_edge, t));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_cotree_peel(ctx, t));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_cotree_join(ctx, t));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(find_ends(ctx, t));
done:
    return rc;
}
