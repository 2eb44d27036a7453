/* Triangles as the engines read them, and what radiates: see front.h. */
#include "geodesic/front.h"

#include "base/parallel.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Radians: an edge so near the rays is one. */
static const double same_direction = 1e-9;
/* Over the length of the edge: a range is taken so much wider. */
static const double margin = 1e-9;

/* Cosine and sine are those of one angle to the last bit, or turns would change lengths: at the shortest edges rounding
 * leaves area and scalar products few digits. */
static void facet_range(int32_t begin, int32_t end, void *data)
{
    const dmk_front *e = data;
    const dmk_mesh *m = e->g->mesh;
    const dmk_star *s = &e->g->star;
    const double scale = 1 / s->unit;
    for (int32_t t = begin; t < end; t++) {
        dmk_facet *f = e->facet + t;
        double area2, dot[3];
        dmk_measure_corners(m, scale, t, &area2, dot);
        for (int k = 0; k < 3; k++)
            f->length[k] = m->length[m->triangle_edge[3 * (size_t)t + (size_t)k]] * scale;
        for (int k = 0; k < 3; k++) {
            size_t h = 3 * (size_t)t + (size_t)k;
            double sides = 1 / (f->length[(k + 1) % 3] * f->length[(k + 2) % 3]);
            double c = dot[k] * sides, i = area2 * sides, turn = 1 / sqrt(c * c + i * i);
            f->cosine[k] = c * turn;
            f->sine[k] = i * turn;
            f->vertex[k] = m->triangle[h];
            f->twin[k] = s->twin[h];
        }
    }
}

static void clear_range(int32_t begin, int32_t end, void *data)
{
    const dmk_front *e = data;
    const dmk_star *s = &e->g->star;
    for (int32_t v = begin; v < end; v++) {
        e->pseudo_source[v] = s->first[v] >= 0 && dmk_front_bends(s, v);
        e->d[v] = INFINITY;
    }
}

int dmk_front_create(dmk_context *ctx, dmk_geodesics *g, dmk_front *e)
{
    int rc;
    const dmk_mesh *m = g->mesh;
    *e = (dmk_front){.g = g, .d = g->distance};
    DMK_TRY(DMK_NEW_UNSET(ctx, e->facet, (size_t)m->n_triangles));
    DMK_TRY(DMK_NEW(ctx, e->pseudo_source, (size_t)m->n_vertices));
    dmk_parallel(ctx, m->n_triangles, facet_range, e);
    dmk_parallel(ctx, m->n_vertices, clear_range, e);
done:
    if (rc != DMK_OK) dmk_front_free(e);
    return rc;
}

void dmk_front_free(dmk_front *e)
{
    free(e->facet);
    free(e->pseudo_source);
    memset(e, 0, sizeof *e);
}

dmk_sector dmk_front_site(const dmk_front *e, const dmk_site *site, int32_t k)
{
    dmk_sector s = site->sector[k];
    s.x /= e->g->star.unit;
    s.y /= e->g->star.unit;
    return s;
}

dmk_sector dmk_front_corner(const dmk_front *e, int32_t c)
{
    const dmk_facet *f = e->facet + c / 3;
    int k = c % 3, a = (k + 1) % 3, b = (k + 2) % 3;
    return (dmk_sector){f->length[b] * f->cosine[a], f->length[b] * f->sine[a], e->g->star.angle[c],
                        e->g->star.corner_angle[c], c};
}

int dmk_front_directions(const dmk_front *e, int32_t v, double back, double range[2][2])
{
    int n = 0;
    double total = e->g->star.total[v];
    if (!e->g->star.border[v]) {
        range[0][0] = fmod(back + M_PI, total);
        range[0][1] = range[0][0] + total - 2 * M_PI;
        return 1;
    }
    if (back - M_PI > -DMK_STRAIGHT) range[n][0] = -DMK_STRAIGHT, range[n++][1] = back - M_PI;
    if (back + M_PI < total + DMK_STRAIGHT)
        range[n][0] = back + M_PI, range[n++][1] = total + DMK_STRAIGHT;
    return n;
}

bool dmk_front_end(const dmk_front *e, const dmk_sector *c, bool last, double lo, double hi,
                   dmk_end *end)
{
    const dmk_star *s = &e->g->star;
    const dmk_facet *f = e->facet + c->half / 3;
    double at = last ? c->angle + c->span : c->angle,
           x = last ? f->length[c->half % 3] - c->x : c->x;
    if (lo > at + same_direction || hi < at - same_direction) return false;
    int32_t corner = last ? dmk_previous(c->half) : dmk_next(c->half);
    double inside = atan2(c->y, x);
    end->vertex = f->vertex[corner % 3];
    end->length = hypot(x, c->y);
    end->direction = at;
    end->back = s->angle[corner] + (last ? s->corner_angle[corner] - inside : inside);
    return true;
}

bool dmk_front_beam(const dmk_front *e, const dmk_sector *c, double lo, double hi, dmk_beam *b)
{
    double l = dmk_max(lo - c->angle, 0), r = dmk_min(hi - c->angle, c->span);
    const dmk_facet *f = e->facet + c->half / 3;
    b->half = f->twin[c->half % 3];
    if (!(r - l >= DMK_NO_WIDTH) || b->half < 0) return false;
    /* Seen from the other triangle the half-edge runs backwards. From the direction of its start to
     * a ray turned by t: the ray meets it at radius sin(t) / sin(t + angle there) from the start.
     */
    double length = f->length[c->half % 3], radius = hypot(c->x, c->y), start = atan2(c->y, c->x);
    b->hi = l <= 0 ? length : length - radius * sin(l) / sin(l + start);
    b->lo = r >= c->span ? 0 : length - radius * sin(r) / sin(r + start);
    b->lo = dmk_max(0, b->lo - margin * length);
    b->hi = dmk_min(length, b->hi + margin * length);
    b->x = length - c->x;
    b->y = -c->y;
    b->turn = c->angle - start;
    return true;
}

double dmk_front_turn(double direction, double total, bool border)
{
    if (border) return dmk_min(dmk_max(direction, 0), total);
    direction -= total * floor(direction / total);
    return direction < total ? direction : 0;
}
