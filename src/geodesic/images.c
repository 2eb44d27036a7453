/* What families do at many edges at once, in plain loops for the processor's vectors. */
#include "geodesic/image.h"

#include <string.h>

/* Of the edges of a call, one number of each in every array. */
typedef struct ends {
    double turn[DMK_EDGES], x[DMK_EDGES], y[DMK_EDGES], before[DMK_EDGES], distance[DMK_EDGES];
} ends;

typedef struct apexes {
    double left[DMK_EDGES], right[DMK_EDGES], area[DMK_EDGES], x[DMK_EDGES], y[DMK_EDGES];
} apexes;

static void take_end(const dmk_geodesics *g, int32_t corner, double side, int k, ends *of)
{
    const int32_t v = g->mesh->triangle[corner];
    const dmk_ray ray = dmk_ray_from(g, v, g->arrival + v, g->star.angle[corner] + side);
    of->turn[k] = ray.turn;
    of->x[k] = ray.way;
    of->before[k] = ray.before;
    of->distance[k] = dmk_in_units(g, g->distance[v]);
}

static void take_apex(const dmk_geodesics *g, int32_t h, int k, apexes *of)
{
    of->left[k] = dmk_length_of(g, dmk_previous(h));
    of->right[k] = dmk_length_of(g, dmk_next(h));
    of->area[k] = dmk_in_units(g, dmk_in_units(g, g->mesh->area[h / 3]));
}

static void place_images(ends *of)
{
    for (int k = 0; k < DMK_EDGES; k++) {
        const dmk_heading to = dmk_heading_of(of->turn[k]);
        of->y[k] = of->x[k] * to.y;
        of->x[k] *= to.x;
    }
}

static void place_apexes(const double *length, apexes *of)
{
    for (int k = 0; k < DMK_EDGES; k++) {
        const double a = of->left[k], b = of->right[k];
        of->x[k] = 0.5 * (length[k] + (a - b) * (a + b) / length[k]);
        of->y[k] = 2 * of->area[k] / length[k];
    }
}

static double length_at(const ends *of, int k, double x, double y)
{
    const dmk_image image = {of->x[k], of->y[k], of->before[k]};
    return dmk_image_length(&image, x, y);
}

/* Images of the ends of n half-edges, n > 0, and their lengths; what is left of the arrays is filled with the last. */
static void take_images(const dmk_geodesics *g, int n, const int32_t *half, double *length, ends *a,
                        ends *b)
{
    for (int k = 0; k < DMK_EDGES; k++) {
        const int32_t h = half[k < n ? k : n - 1];
        length[k] = dmk_length_of(g, h);
        take_end(g, dmk_next(h), 0, k, a);
        take_end(g, dmk_previous(h), g->star.corner_angle[dmk_previous(h)], k, b);
    }
    place_images(a);
    place_images(b);
    for (int k = 0; k < DMK_EDGES; k++) {
        b->x[k] = length[k] - b->x[k];
        b->y[k] = -b->y[k];
    }
}

/* Corners opposite the half-edges, and beyond; beyond a border the former. */
static void take_apexes(const dmk_geodesics *g, int n, const int32_t *half, const double *length,
                        apexes *above, apexes *below)
{
    for (int k = 0; k < DMK_EDGES; k++) {
        const int32_t h = half[k < n ? k : n - 1], twin = g->star.twin[h];
        take_apex(g, h, k, above);
        take_apex(g, twin >= 0 ? twin : h, k, below);
    }
    place_apexes(length, above);
    place_apexes(length, below);
    for (int k = 0; k < DMK_EDGES; k++) {
        below->x[k] = length[k] - below->x[k];
        below->y[k] = -below->y[k];
    }
    for (int k = 0; k < n; k++) {
        if (g->star.twin[half[k]] >= 0) continue;
        below->x[k] = above->x[k];
        below->y[k] = above->y[k];
    }
}

__attribute__((flatten)) void dmk_jumps(const dmk_geodesics *g, int n, const int32_t *half,
                                        double tie, double *jump)
{
    double length[DMK_EDGES], found[DMK_EDGES];
    ends a, b;
    apexes above, below;
    if (n == 0) return;
    take_images(g, n, half, length, &a, &b);
    take_apexes(g, n, half, length, &above, &below);
    for (int k = 0; k < DMK_EDGES; k++) {
        const double a_at_end = length_at(&a, k, length[k], 0), b_at_start = length_at(&b, k, 0, 0);
        double differ = fabs(length_at(&a, k, 0, 0) - b_at_start);
        differ = dmk_max(differ, fabs(a_at_end - length_at(&b, k, length[k], 0)));
        differ = dmk_max(differ, fabs(length_at(&a, k, above.x[k], above.y[k]) -
                                      length_at(&b, k, above.x[k], above.y[k])));
        differ = dmk_max(differ, fabs(length_at(&a, k, below.x[k], below.y[k]) -
                                      length_at(&b, k, below.x[k], below.y[k])));
        found[k] = dmk_max(0, a_at_end - b.distance[k]) + dmk_max(0, b_at_start - a.distance[k]) +
                   tie * differ;
    }
    memcpy(jump, found, (size_t)n * sizeof *jump);
}

__attribute__((flatten)) void dmk_meet_many(const dmk_geodesics *g, int n, const int32_t *half,
                                            dmk_met *met)
{
    double length[DMK_EDGES];
    ends a, b;
    if (n == 0) return;
    take_images(g, n, half, length, &a, &b);
    for (int k = 0; k < DMK_EDGES; k++) {
        const dmk_image at_a = {a.x[k], a.y[k], a.before[k]}, at_b = {b.x[k], b.y[k], b.before[k]};
        const double x = dmk_meeting_alike(&at_a, &at_b, length[k]);
        met->x[k] = x;
        met->alpha[k] = dmk_meeting_angle(&at_a, &at_b, x, 0);
        met->distance[k] = dmk_image_length(&at_a, x, 0) + dmk_image_length(&at_b, x, 0);
    }
}
