/* Vertices that the fan missed: their triangles are so narrow that rays pass on both sides without
 * touching them, or they lie in the shadow of a border or a saddle vertex. */
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>

/* Longer than the guide by this many edges (as in dmk_ray_shoot), it is another family's. */
static const double slack = 3.0;

typedef struct repair {
    dmk_rays *rays;
    bool *missed;      /* n_vertices */
    int32_t *triangle; /* those with a missed corner */
    int32_t n_triangles, n_missed;
    dmk_sheet *found; /* n_vertices; distance HUGE_VAL: none */
} repair;

/* No distance may exceed a neighbour's by more than the edge between them (and rounding, and the
 * error of unfolding): then only longer geodesics were found. */
static void find_missed(repair *p)
{
    const dmk_rays *r = p->rays;
    const dmk_mesh *m = r->mesh;
    for (int32_t v = 0; v < m->n_vertices; v++)
        p->missed[v] = dmk_rays_first(r, v)->spread < 0;
    for (int32_t e = 0; e < m->n_edges; e++) {
        int32_t v = m->edge_vertex[2 * e], w = m->edge_vertex[2 * e + 1];
        if (p->missed[v] || p->missed[w]) continue;
        double rise = dmk_rays_first(r, w)->distance - dmk_rays_first(r, v)->distance;
        if (fabs(rise) > 1.05 * m->length[e]) p->missed[rise > 0 ? w : v] = true;
    }
    if (r->chart.vertex >= 0) p->missed[r->chart.vertex] = false;
    for (int32_t v = 0; v < m->n_vertices; v++)
        p->n_missed += p->missed[v];
    for (int32_t t = 0; t < m->n_triangles; t++) {
        const int32_t *v = m->triangle + 3 * t;
        if (p->missed[v[0]] || p->missed[v[1]] || p->missed[v[2]])
            p->triangle[p->n_triangles++] = t;
    }
}

/* The source of a and b lies, unfolded, at their distances from the two corners; the line from it
 * to corner k crosses the edge between them. */
bool dmk_rays_unfold(const dmk_rays *r, int32_t t, int k, const dmk_sheet *a, const dmk_sheet *b,
                     double beyond, dmk_sheet *c)
{
    const dmk_mesh *m = r->mesh;
    double length = m->length[m->triangle_edge[3 * t + k]];
    double turn = dmk_chart_turn(&r->chart, a->angle, b->angle);
    if (fabs(turn) * fmin(a->spread, b->spread) > 2 * length) return false;
    double x =
        (a->distance * a->distance - b->distance * b->distance + length * length) / (2 * length);
    double y2 = a->distance * a->distance - x * x;
    double height = 2 * m->area[t] / length, foot = dmk_cot(m, 3 * t + (k + 1) % 3) * height;
    double y = sqrt(fmax(y2, 0)), cross = x + (foot - x) * y / (y + height);
    if (y2 < 0 || cross < -beyond * length || cross > (1 + beyond) * length) return false;
    c->angle = a->angle + turn * cross / length;
    c->distance = hypot(foot - x, height + y);
    c->spread = 0.5 * (a->spread + b->spread);
    return true;
}

static void update_corner(repair *p, int32_t t, int k)
{
    const int32_t *v = p->rays->mesh->triangle + 3 * t;
    const dmk_sheet *a = dmk_rays_first(p->rays, v[(k + 1) % 3]);
    const dmk_sheet *b = dmk_rays_first(p->rays, v[(k + 2) % 3]);
    dmk_sheet c;
    if (!dmk_rays_unfold(p->rays, t, k, a, b, 0.3, &c)) return;
    if (dmk_ray_ended(p->rays, slack, c.distance, v[k])) return;
    if (c.distance < p->found[v[k]].distance) p->found[v[k]] = c;
}

/* In a shadow: the direction of the neighbour from which the guide rises most steeply. */
static void borrow_corner(repair *p, int32_t t, int k, float *slope)
{
    const dmk_rays *r = p->rays;
    const dmk_mesh *m = r->mesh;
    const int32_t *v = m->triangle + 3 * t;
    for (int j = 1; j < 3; j++) {
        int32_t w = v[(k + j) % 3], e = m->triangle_edge[3 * t + (k + 3 - j) % 3];
        if (p->missed[w]) continue;
        float rise = (float)((r->distance[v[k]] - r->distance[w]) / m->length[e]);
        if (p->found[v[k]].distance < HUGE_VAL && rise <= slope[v[k]]) continue;
        slope[v[k]] = rise;
        p->found[v[k]] = *dmk_rays_first(r, w);
        p->found[v[k]].distance = r->distance[v[k]];
    }
}

/* Take over what one sweep found. Returns how many vertices it helped. */
static int32_t accept(repair *p)
{
    const dmk_rays *r = p->rays;
    int32_t n = 0;
    for (int32_t i = 0; i < 3 * p->n_triangles; i++) {
        int32_t v = r->mesh->triangle[3 * p->triangle[i / 3] + i % 3];
        if (!p->missed[v] || p->found[v].distance == HUGE_VAL) continue;
        dmk_sheet *s = r->sheet + r->row[v];
        if (s->spread >= 0 && r->row[v] + r->n_sheets[v] < r->row[v + 1]) {
            s[r->n_sheets[v]++] = s[0];
        }
        s[0] = p->found[v];
        p->missed[v] = false;
        n++;
    }
    return n;
}

/* Keep the triangles that still have a missed corner. */
static void drop_done(repair *p)
{
    int32_t kept = 0;
    for (int32_t i = 0; i < p->n_triangles; i++) {
        const int32_t *v = p->rays->mesh->triangle + 3 * p->triangle[i];
        if (p->missed[v[0]] || p->missed[v[1]] || p->missed[v[2]])
            p->triangle[kept++] = p->triangle[i];
    }
    p->n_triangles = kept;
}

/* slope == NULL: from triangles; else borrow. */
static int32_t sweep(repair *p, float *slope)
{
    for (int32_t i = 0; i < 3 * p->n_triangles; i++) {
        int32_t t = p->triangle[i / 3];
        const int32_t *v = p->rays->mesh->triangle + 3 * t;
        int k = i % 3;
        if (!p->missed[v[k]]) continue;
        if (slope)
            borrow_corner(p, t, k, slope);
        else if (!p->missed[v[(k + 1) % 3]] && !p->missed[v[(k + 2) % 3]])
            update_corner(p, t, k);
    }
    int32_t helped = accept(p);
    drop_done(p);
    return helped;
}

int dmk_rays_repair(dmk_context *ctx, dmk_rays *r)
{
    int rc;
    repair p = {.rays = r};
    float *slope = NULL;
    size_t n = (size_t)r->mesh->n_vertices;
    if (r->chart.vertex >= 0) r->sheet[r->row[r->chart.vertex]] = (dmk_sheet){0, 0, 0};
    DMK_TRY(DMK_NEW(ctx, p.missed, n));
    DMK_TRY(DMK_NEW(ctx, p.triangle, (size_t)r->mesh->n_triangles));
    find_missed(&p);
    if (p.n_missed == 0) goto done;
    DMK_TRY(DMK_NEW(ctx, p.found, n));
    DMK_TRY(DMK_NEW(ctx, slope, n));
    for (size_t v = 0; v < n; v++)
        p.found[v].distance = HUGE_VAL;
    for (int32_t helped; p.n_missed > 0; p.n_missed -= helped) {
        helped = sweep(&p, NULL);
        if (helped > 0) continue;
        helped = sweep(&p, slope);
        if (helped == 0) break;
        r->n_unreached += (size_t)helped;
    }
done:
    free(p.missed);
    free(p.triangle);
    free(p.found);
    free(slope);
    return rc;
}
