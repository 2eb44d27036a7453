/* Where the families of an edge's two ends meet, one edge at a time: what images.c leaves over. */
#include "geodesic/image.h"

/* Where the families of both ends are equally long: where their images are equally far, if these begin alike, else by
 * Newton's method from there, by bisection where that leaves the bracket or does not end. Images are also seen from
 * where no path leads, so each may be the shorter one at the other's end: then at the end where they differ more. One
 * family, by rounding: in the middle. All of it whichever end is the start. */
static double find_meeting(const dmk_image *a, const dmk_image *b, double length)
{
    double lo = 0, hi = length, x = dmk_equally_far(a, b);
    const double alike = dmk_meeting_alike(a, b, length);
    if (!isnan(alike)) return alike;
    const double at_start = dmk_image_length(a, 0, 0), rounding = 1e-12 * at_start;
    const double flo = at_start - dmk_image_length(b, 0, 0);
    const double fhi = dmk_image_length(a, length, 0) - dmk_image_length(b, length, 0);
    if (fabs(flo) <= rounding && fabs(fhi) <= rounding) return 0.5 * length;
    if (flo >= 0 && fhi <= 0) return flo <= -fhi ? length : 0;
    if (flo >= 0) return 0; /* the start's own family is not the shorter one there */
    if (fhi <= 0) return length;
    if (!(x > 0 && x < length)) x = -flo * length / (fhi - flo);
    for (int i = 0; i < 60; i++) {
        const double la = dmk_image_length(a, x, 0), lb = dmk_image_length(b, x, 0), f = la - lb;
        if (f == 0) break;
        if (f < 0)
            lo = x;
        else
            hi = x;
        const double slope = (x - a->x) / (la - a->before) - (x - b->x) / (lb - b->before);
        double next = x - f / slope;
        if (!(i < 10 && next > lo && next < hi)) next = 0.5 * (lo + hi);
        const bool ends = fabs(next - x) <= 1e-12 * length;
        x = next;
        if (ends) break;
    }
    return dmk_snap(x, length); /* not beside where a family begins */
}

/* Of an end's two families that which leads on, the shorter one at the edge's other end, comes first. */
static void order_tied(dmk_family *first, dmk_family *second, double other_end)
{
    const dmk_image *a = &first->image, *b = &second->image;
    if (dmk_image_length(b, other_end, 0) >= dmk_image_length(a, other_end, 0)) return;
    const dmk_family was = *first;
    *first = *second;
    *second = was;
}

/* Ends that lie on the locus have a second family each. The edge is crossed where families meet at the largest angle,
 * at an end or between. */
static void meet_tied(const dmk_geodesics *g, int32_t h, dmk_meeting *m)
{
    const dmk_arrival *start = dmk_geodesics_tie(g, g->mesh->triangle[dmk_next(h)]),
                      *end = dmk_geodesics_tie(g, g->mesh->triangle[dmk_previous(h)]);
    dmk_family beside_a = {0}, beside_b = {0};
    if (!start && !end) return;
    if (start) {
        beside_a = (dmk_family){dmk_image_from_start(g, h, start), start, {0, 0}};
        order_tied(&m->a, &beside_a, m->length);
    }
    if (end) {
        beside_b = (dmk_family){dmk_image_from_end(g, h, end), end, {m->length, 0}};
        order_tied(&m->b, &beside_b, 0);
    }
    m->x = find_meeting(&m->a.image, &m->b.image, m->length);
    const double between = dmk_meeting_angle(&m->a.image, &m->b.image, m->x, 0);
    const double at_start = start ? dmk_meeting_angle(&m->a.image, &beside_a.image, 0, 0) : -1;
    const double at_end = end ? dmk_meeting_angle(&m->b.image, &beside_b.image, m->length, 0) : -1;
    if (at_end >= dmk_max(between, at_start)) {
        m->x = m->length;
        m->a = beside_b;
    } else if (at_start >= between) {
        m->x = 0;
        m->b = beside_a;
    }
}

dmk_meeting dmk_meet(const dmk_geodesics *g, int32_t h)
{
    const int32_t v = g->mesh->triangle[dmk_next(h)], w = g->mesh->triangle[dmk_previous(h)];
    dmk_meeting m = {.a = {dmk_image_at_start(g, h), g->arrival + v, {0, 0}},
                     .b = {dmk_image_at_end(g, h), g->arrival + w, {dmk_length_of(g, h), 0}}};
    m.length = m.b.x[0];
    m.x = find_meeting(&m.a.image, &m.b.image, m.length);
    /* behind a pseudo-source the paths are those to it, continued */
    const bool at_start = g->arrival[w].pseudo_source == v,
               at_end = g->arrival[v].pseudo_source == w;
    if (at_start) m.x = 0;
    if (at_end) m.x = m.length;
    m.alpha = dmk_meeting_angle(&m.a.image, &m.b.image, m.x, 0);
    if (!at_start && !at_end) meet_tied(g, h, &m);
    return m;
}
