/* The directions at the source: see dmk_chart in rays.h. */
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A weight below this puts the source on the edge or vertex itself. */
static const double on_edge = 1e-9;

/* Corners of t in its own plane: corner 0 at the origin, corner 1 on the x axis. */
static void lay_flat(const dmk_mesh *m, int32_t t, double xy[3][2])
{
    const double *l = m->length;
    const int32_t *e = m->triangle_edge + 3 * t;
    double height = 2 * m->area[t] / l[e[2]];
    xy[0][0] = xy[0][1] = xy[1][1] = 0;
    xy[1][0] = l[e[2]];
    xy[2][0] = dmk_cot(m, 3 * t) * height;
    xy[2][1] = height;
}

/* Append the sectors of triangle t seen from its point `w`, walking `count` edges counterclockwise
 * from corner `first`. */
static void add_sectors(const dmk_mesh *m, const int32_t *across, int32_t t, const double w[3],
                        int first, int count, dmk_chart *c)
{
    double xy[3][2], p[2];
    lay_flat(m, t, xy);
    for (int k = 0; k < 2; k++)
        p[k] = w[0] * xy[0][k] + w[1] * xy[1][k] + w[2] * xy[2][k];
    for (int i = 0; i < count; i++) {
        int a = (first + i) % 3, b = (a + 1) % 3, opposite = (a + 2) % 3;
        double ax = xy[a][0] - p[0], ay = xy[a][1] - p[1];
        double bx = xy[b][0] - p[0], by = xy[b][1] - p[1];
        dmk_chart_sector *s = c->sector + c->n_sectors++;
        s->angle[0] = c->total;
        c->total += atan2(ax * by - ay * bx, ax * bx + ay * by);
        s->angle[1] = c->total;
        s->radius[0] = hypot(ax, ay);
        s->radius[1] = hypot(bx, by);
        s->vertex[0] = m->triangle[3 * t + a];
        s->vertex[1] = m->triangle[3 * t + b];
        s->triangle = t;
        s->beyond = across[3 * t + opposite];
    }
}

/* The triangles around a vertex counterclockwise; at a border from its clockwise end. */
static void around_vertex(const dmk_mesh *m, const int32_t *across, int32_t t, int corner,
                          dmk_chart *c)
{
    int32_t first = 3 * t + corner, h = first, o;
    c->vertex = m->triangle[first];
    /* The clockwise neighbour lies across the edge from the vertex to corner + 1. */
    while ((o = across[h / 3 * 3 + (h % 3 + 2) % 3]) >= 0) {
        h = o / 3 * 3 + (o % 3 + 2) % 3;
        if (h == first) break;
    }
    first = h;
    do {
        int k = h % 3;
        double w[3] = {k == 0, k == 1, k == 2};
        add_sectors(m, across, h / 3, w, (k + 1) % 3, 1, c);
        o = across[h / 3 * 3 + (k + 1) % 3];
        c->closed = o >= 0;
        if (o >= 0) h = o / 3 * 3 + (o % 3 + 1) % 3;
    } while (o >= 0 && h != first);
}

/* The one or two triangles at an edge, from the end of the edge in t counterclockwise. */
static void around_edge(const dmk_mesh *m, const int32_t *across, int32_t t, int k,
                        const double w[3], dmk_chart *c)
{
    add_sectors(m, across, t, w, (k + 2) % 3, 2, c);
    int32_t o = across[3 * t + k];
    c->closed = o >= 0;
    if (o < 0) return;
    double w1[3] = {0, 0, 0};
    int k1 = o % 3;
    w1[(k1 + 1) % 3] = w[(k + 2) % 3];
    w1[(k1 + 2) % 3] = w[(k + 1) % 3];
    add_sectors(m, across, o / 3, w1, (k1 + 2) % 3, 2, c);
}

int dmk_chart_create(dmk_context *ctx, const dmk_mesh *m, const int32_t *across, const dmk_point *p,
                     dmk_chart *c)
{
    int rc, big = 0, n_small = 0, small = 0;
    memset(c, 0, sizeof *c);
    c->vertex = -1;
    c->closed = true;
    int32_t t = (int32_t)p->triangle, n = 6;
    for (int k = 0; k < 3; k++) {
        if (p->weight[k] > p->weight[big]) big = k;
        if (p->weight[k] < on_edge) n_small++, small = k;
    }
    if (n_small == 2) {
        n = 0;
        for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
            n += m->triangle[h] == m->triangle[3 * t + big];
        }
    }
    DMK_TRY(DMK_NEW(ctx, c->sector, (size_t)n));
    if (n_small == 2)
        around_vertex(m, across, t, big, c);
    else if (n_small == 1)
        around_edge(m, across, t, small, p->weight, c);
    else
        add_sectors(m, across, t, p->weight, 0, 3, c);
done:
    return rc;
}

void dmk_chart_free(dmk_chart *c)
{
    free(c->sector);
    memset(c, 0, sizeof *c);
}

double dmk_chart_turn(const dmk_chart *c, double a, double b)
{
    double d = b - a;
    return c->closed ? d - c->total * round(d / c->total) : d;
}
