/* The points of the lines: see cotree.h. */
#include "base/vec3.h"
#include "locus/cotree.h"

#include <stdlib.h>
#include <string.h>

int dmk_end_by_triangle(const void *a, const void *b)
{
    return ((const dmk_end_point *)a)->triangle - ((const dmk_end_point *)b)->triangle;
}

const dmk_end_point *dmk_end_in(const dmk_cotree *t, int32_t triangle)
{
    const dmk_end_point key = {.triangle = triangle};
    if (t->n_ends == 0) return NULL;
    return bsearch(&key, t->end, (size_t)t->n_ends, sizeof key, dmk_end_by_triangle);
}

bool dmk_is_fork(const dmk_cotree *t, int32_t triangle)
{
    for (int k = 0; k < 3; k++) {
        const int32_t i = t->on[3 * triangle + k];
        if (i < 0 || t->strength_of[i] < t->strength) return false;
    }
    return true;
}

/* The families of a triangle's corners in the frame of its half-edge 3t, each seen from its corner into the middle of
 * the triangle: along a side it would depend on which one where paths come from behind. */
static void set_corners(const dmk_geodesics *g, int32_t triangle, dmk_family c[3])
{
    const int32_t h = 3 * triangle, *v = g->mesh->triangle + h;
    for (int k = 0; k < 3; k++) c[k] = (dmk_family){.arrival = g->arrival + v[k]};
    c[2].x[0] = dmk_length_of(g, h);
    dmk_apex(g, h, &c[0].x[0], &c[0].x[1]);
    for (int k = 0; k < 3; k++) {
        const double *x = c[k].x, *next = c[(k + 1) % 3].x,
                     half = 0.5 * g->star.corner_angle[h + k];
        const dmk_image own = dmk_image_from(g, v[k], c[k].arrival, g->star.angle[h + k] + half);
        const dmk_heading to = dmk_heading_of(atan2(next[1] - x[1], next[0] - x[0]) + half);
        c[k].image = (dmk_image){x[0] + own.x * to.x - own.y * to.y,
                                 x[1] + own.x * to.y + own.y * to.x, own.before};
    }
}

/* Angle at the image between the paths to the family's vertex and to (x, y). */
static double turn_to(const dmk_family *f, double x, double y)
{
    const double vx = f->x[0] - f->image.x, vy = f->x[1] - f->image.y;
    const double px = x - f->image.x, py = y - f->image.y;
    return atan2(vx * py - vy * px, vx * px + vy * py);
}

/* Direction at the source of the family's path to (x, y). */
static double direction_of(const dmk_family *f, double x, double y)
{
    return f->arrival->direction + (f->arrival->pseudo_source >= 0 ? 0 : turn_to(f, x, y));
}

/* What two families say of (x, y): directions, and the length of the shorter one. Directions at two sources are as far
 * apart as can be. */
static void set_families(const dmk_geodesics *g, const dmk_family *a, const dmk_family *b, double x,
                         double y, dmk_locus_vertex *v)
{
    v->distance =
        g->star.unit * fmin(dmk_image_length(&a->image, x, y), dmk_image_length(&b->image, x, y));
    v->source[0] = a->arrival->source;
    v->source[1] = b->arrival->source;
    v->angle[0] = direction_of(a, x, y);
    v->angle[1] = direction_of(b, x, y);
    const int32_t source = v->source[0];
    const double full = dmk_turn_around(g, source),
                 apart = fabs(dmk_turn_between(full, v->angle[0], v->angle[1]));
    v->source_angle = source == v->source[1] ? dmk_scale_around(g, source) * apart : M_PI;
    v->meeting_angle = dmk_meeting_angle(&a->image, &b->image, x, y);
}

static void set_place(const dmk_mesh *m, int32_t triangle, const double weight[3],
                      dmk_locus_vertex *v)
{
    v->place.triangle = triangle;
    for (int j = 0; j < 3; j++) v->xyz[j] = 0;
    for (int k = 0; k < 3; k++) {
        v->place.weight[k] = weight[k];
        for (int j = 0; j < 3; j++)
            v->xyz[j] += weight[k] * m->xyz[3 * (size_t)m->triangle[3 * triangle + k] + j];
    }
}

/* The two corners whose paths start in the most different directions; the least length of all three. */
static void set_widest(const dmk_cotree *t, int32_t triangle, dmk_locus_vertex *v)
{
    dmk_family c[3];
    dmk_locus_vertex best = *v;
    double least = HUGE_VAL;
    best.source_angle = -1;
    set_corners(t->geodesics, triangle, c);
    const double *w = v->place.weight, x = w[0] * c[0].x[0] + w[2] * c[2].x[0];
    for (int k = 0; k < 3; k++) {
        set_families(t->geodesics, &c[k], &c[(k + 1) % 3], x, w[0] * c[0].x[1], v);
        least = fmin(least, v->distance);
        if (v->source_angle > best.source_angle) best = *v;
    }
    *v = best;
    v->distance = least;
}

/* Newton's method, from the centre, for the point at which three families are equally long; corner 1 is the origin. On
 * a side within what the method leaves it is in the triangle, too. */
static bool find_fork(const dmk_family c[3], double weight[3])
{
    const double rest = 1e-9;
    double x = c[0].x[0] / 3 + c[2].x[0] / 3, y = c[0].x[1] / 3, step = HUGE_VAL;
    for (int i = 0; i < 20 && !(step < rest * c[2].x[0]); i++) {
        double l[3], g[3][2];
        for (int k = 0; k < 3; k++) {
            l[k] = dmk_image_length(&c[k].image, x, y);
            g[k][0] = (x - c[k].image.x) / (l[k] - c[k].image.before);
            g[k][1] = (y - c[k].image.y) / (l[k] - c[k].image.before);
        }
        const double a = g[1][0] - g[0][0], b = g[1][1] - g[0][1], p = l[0] - l[1];
        const double d = g[2][0] - g[0][0], e = g[2][1] - g[0][1], q = l[0] - l[2];
        const double det = a * e - b * d, dx = (p * e - b * q) / det, dy = (a * q - d * p) / det;
        if (!(fabs(det) > 1e-12)) return false;
        x += dx;
        y += dy;
        step = hypot(dx, dy);
    }
    weight[0] = y / c[0].x[1];
    weight[2] = (x - weight[0] * c[0].x[0]) / c[2].x[0];
    weight[1] = 1 - weight[0] - weight[2];
    const bool found =
        step < rest * c[2].x[0] && weight[0] > -rest && weight[1] > -rest && weight[2] > -rest;
    if (found) dmk_point_snap(weight);
    return found;
}

/* Weights of crossing i in one of its triangles. */
static void weights_in(const dmk_cotree *t, int32_t i, double at, int32_t triangle,
                       double weight[3])
{
    const int32_t h = t->crossing[i].half;
    const int32_t own = h / 3 == triangle ? h : t->geodesics->star.twin[h];
    if (own != h) at = 1 - at;
    weight[own % 3] = 0;
    weight[dmk_next(own) % 3] = 1 - at;
    weight[dmk_previous(own) % 3] = at;
}

static double share_of(const dmk_cotree *t, int32_t i, bool raw);

/* The foot of the weakest crossing on the line between the two others; raw: as they are found. */
static void find_foot(const dmk_cotree *t, int32_t triangle, bool raw, double weight[3])
{
    const int32_t *on = t->on + 3 * triangle;
    int weakest = 0;
    double p[3], q[3], from_i[3], from_j[3];
    for (int k = 1; k < 3; k++) {
        const dmk_crossing *a = &t->crossing[on[k]], *b = &t->crossing[on[weakest]];
        /* three loops are told apart by their angles */
        if (a->excess < b->excess || (a->excess == b->excess && a->alpha < b->alpha)) weakest = k;
    }
    const int32_t i = on[(weakest + 1) % 3], j = on[(weakest + 2) % 3];
    dmk_subtract(t->crossing[on[weakest]].xyz, t->crossing[i].xyz, p);
    dmk_subtract(t->crossing[j].xyz, t->crossing[i].xyz, q);
    double s = dmk_dot(p, q) / dmk_dot(q, q);
    s = s > 0.05 ? fmin(s, 0.95) : 0.05; /* not at a crossing: no line of length 0 */
    weights_in(t, i, share_of(t, i, raw), triangle, from_i);
    weights_in(t, j, share_of(t, j, raw), triangle, from_j);
    for (int k = 0; k < 3; k++) weight[k] = (1 - s) * from_i[k] + s * from_j[k];
}

static void fork_weights(const dmk_cotree *t, int32_t triangle, bool raw, double weight[3])
{
    dmk_family c[3];
    set_corners(t->geodesics, triangle, c);
    if (!dmk_is_fork(t, triangle) || !find_fork(c, weight)) find_foot(t, triangle, raw, weight);
}

void dmk_place_fork(const dmk_cotree *t, int32_t triangle, dmk_locus_vertex *v)
{
    double weight[3];
    fork_weights(t, triangle, false, weight);
    set_place(t->geodesics->mesh, triangle, weight, v);
    set_widest(t, triangle, v);
}

void dmk_place_end(const dmk_cotree *t, const dmk_end_point *end, dmk_locus_vertex *v)
{
    set_place(t->geodesics->mesh, end->triangle, end->weight, v);
    set_widest(t, end->triangle, v);
}

/* The line that leaves a crossing to one side, up to an end, a fork or the length wanted. */
enum { MAX_WALK = 32 };
typedef struct walk {
    int n;
    double x[MAX_WALK + 1][3], s[MAX_WALK + 1]; /* points and arc length */
} walk;

static void go(const dmk_cotree *t, int32_t i, int32_t node, double length, walk *w)
{
    w->n = 1;
    w->s[0] = 0;
    memcpy(w->x[0], t->crossing[i].xyz, sizeof w->x[0]);
    while (node < t->geodesics->mesh->n_triangles && w->n <= MAX_WALK && w->s[w->n - 1] < length) {
        int32_t next = -1, n = 0;
        for (int k = 0; k < 3; k++) {
            const int32_t j = t->on[3 * node + k];
            if (j < 0 || j == i || t->strength_of[j] < t->strength) continue;
            next = j;
            n++;
        }
        const dmk_end_point *end = n == 0 ? dmk_end_in(t, node) : NULL;
        if (n == 0 && !end) return;
        dmk_locus_vertex v;
        double weight[3];
        if (n > 1) fork_weights(t, node, true, weight);
        if (n != 1) set_place(t->geodesics->mesh, node, end ? end->weight : weight, &v);
        memcpy(w->x[w->n], n == 1 ? t->crossing[next].xyz : v.xyz, sizeof v.xyz);
        w->s[w->n] = w->s[w->n - 1] + dmk_distance(w->x[w->n - 1], w->x[w->n]);
        w->n++;
        if (n != 1) return;
        node = dmk_other_node(&t->crossing[next], node);
        i = next;
    }
}

/* Add to `sum` the integral of the position over the first `length` of the walk. */
static void integrate(const walk *w, double length, double sum[3])
{
    for (int j = 1; j < w->n && w->s[j - 1] < length; j++) {
        const double piece = w->s[j] - w->s[j - 1], part = fmin(piece, length - w->s[j - 1]);
        if (!(piece > 0)) continue;
        for (int k = 0; k < 3; k++)
            sum[k] += part * (w->x[j - 1][k] + 0.5 * part / piece * (w->x[j][k] - w->x[j - 1][k]));
    }
}

/* Where on its edge the crossing goes; raw: is. */
static double share_of(const dmk_cotree *t, int32_t i, bool raw)
{
    const dmk_crossing *c = &t->crossing[i];
    const dmk_mesh *m = t->geodesics->mesh;
    walk side[2];
    double length = dmk_rules.width * t->mean_edge, mean[3] = {0}, edge[3], to[3];
    if (raw || t->strength_of[i] < t->strength) return c->share;
    for (int k = 0; k < 2; k++) {
        go(t, i, c->node[k], length, &side[k]);
        length = fmin(length, side[k].s[side[k].n - 1]);
    }
    if (!(length > 0)) return c->share;
    for (int k = 0; k < 2; k++) integrate(&side[k], length, mean);
    for (int k = 0; k < 3; k++) mean[k] /= 2 * length;
    const double *v = m->xyz + 3 * (size_t)m->triangle[dmk_next(c->half)];
    const double *w = m->xyz + 3 * (size_t)m->triangle[dmk_previous(c->half)];
    dmk_subtract(w, v, edge);
    dmk_subtract(mean, v, to);
    return dmk_snap(dmk_dot(to, edge) / dmk_dot(edge, edge), 1);
}

void dmk_place_crossing(const dmk_cotree *t, int32_t i, dmk_locus_vertex *v)
{
    const dmk_crossing *c = &t->crossing[i];
    const int32_t h = c->half;
    const dmk_meeting m = dmk_meet(t->geodesics, h);
    const double share = share_of(t, i, false);
    double weight[3];
    weights_in(t, i, share, h / 3, weight);
    set_place(t->geodesics->mesh, h / 3, weight, v);
    set_families(t->geodesics, &m.a, &m.b, share * m.length, 0, v);
    v->strength = t->strength_of[i];
}

int dmk_seam_create(dmk_context *ctx, const dmk_cotree *t, const dmk_locus_options *opt,
                    dmk_seam **seam)
{
    const double strength = dmk_strength_asked(t, opt);
    const size_t size = sizeof(dmk_seam), item = sizeof *(*seam)->point;
    size_t n = 0;
    for (int32_t i = 0; i < t->n; i++) n += dmk_is_drawn(t, i, strength);
    const int rc = dmk_alloc(ctx, "seam", 1, size + n * item, (void **)seam);
    if (rc != DMK_OK) return rc;
    **seam = (dmk_seam){.asked = opt ? opt->strength : 0, .is_tree = t->last >= 0};
    for (int32_t i = 0; i < t->n; i++)
        if (dmk_is_drawn(t, i, strength))
            (*seam)->point[(*seam)->n++] =
                (struct dmk_seam_point){t->crossing[i].half, share_of(t, i, false)};
    return DMK_OK;
}
