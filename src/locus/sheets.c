/* The geodesics that reach each vertex, from the fan's hits. */
#include "locus/rays.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* In mean edges at the vertex: two geodesics whose beam is narrower are one, hit twice; geodesics
 * longer than the shortest by more than `overhang` are of no use. */
static const double same_width = 0.5, overhang = 3.0;
/* In lengths of the way: how wide the beam between two geodesics may be if they are neighbours. */
static const double neighbour_width = 2.0, neighbour_step = 1.3;

/* Radians: a larger difference of curvature between neighbours is a corner, not noise. */
static const double rough = 0.5;

int dmk_find_across(dmk_context *ctx, const dmk_mesh *m, int32_t **across)
{
    int rc;
    int32_t *first = NULL;
    DMK_TRY(DMK_NEW(ctx, first, (size_t)m->n_edges));
    DMK_TRY(DMK_NEW(ctx, *across, 3 * (size_t)m->n_triangles));
    for (int32_t e = 0; e < m->n_edges; e++)
        first[e] = -1;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        int32_t e = m->triangle_edge[h], other = first[e];
        (*across)[h] = other;
        if (other >= 0)
            (*across)[other] = h;
        else
            first[e] = h;
    }
done:
    free(first);
    return rc;
}

static int find_sizes(dmk_context *ctx, dmk_rays *r)
{
    int rc;
    const dmk_mesh *m = r->mesh;
    int32_t *count = NULL;
    DMK_TRY(DMK_NEW(ctx, count, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, r->size, (size_t)m->n_vertices));
    for (int32_t e = 0; e < m->n_edges; e++) {
        r->mean += m->length[e] / m->n_edges;
        for (int k = 0; k < 2; k++) {
            r->size[m->edge_vertex[2 * e + k]] += (float)m->length[e];
            count[m->edge_vertex[2 * e + k]]++;
        }
    }
    for (int32_t v = 0; v < m->n_vertices; v++)
        r->size[v] /= (float)dmk_max_i(1, count[v]);
done:
    free(count);
    return rc;
}

static int find_bends(dmk_context *ctx, dmk_rays *r)
{
    int rc;
    const dmk_mesh *m = r->mesh;
    DMK_TRY(DMK_NEW(ctx, r->bend, (size_t)m->n_vertices));
    for (int32_t v = 0; v < m->n_vertices; v++)
        r->bend[v] = 6.2831853f;
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        r->bend[m->triangle[h]] -= (float)atan2(1, dmk_cot(m, h));
    }
    for (int32_t h = 0; h < 3 * m->n_triangles; h++) {
        if (r->across[h] >= 0) continue;
        r->bend[m->triangle[h / 3 * 3 + (h % 3 + 1) % 3]] = 0;
        r->bend[m->triangle[h / 3 * 3 + (h % 3 + 2) % 3]] = 0;
    }
done:
    return rc;
}

/* How rough the mesh is: on a smooth surface neighbouring vertices have nearly the same curvature.
 */
static void find_noise(dmk_rays *r)
{
    const dmk_mesh *m = r->mesh;
    double sum = 0, n = 0;
    for (int32_t e = 0; e < m->n_edges; e++) {
        double d = fabs(r->bend[m->edge_vertex[2 * e]] - r->bend[m->edge_vertex[2 * e + 1]]);
        if (d > rough) continue;
        sum += d;
        n++;
    }
    r->noise = n > 0 ? sum / n : 0;
}

/* One sheet per geodesic: sort the hits of one vertex by length, then average those that belong to
 * one beam. Returns the number of sheets. */
static int32_t merge_hits(const dmk_rays *r, dmk_sheet *s, int32_t n, double size)
{
    int32_t kept = 0;
    for (int32_t i = 1; i < n; i++) {
        dmk_sheet x = s[i];
        int32_t j = i;
        for (; j > 0 && s[j - 1].distance > x.distance; j--)
            s[j] = s[j - 1];
        s[j] = x;
    }
    int weight[16];
    for (int32_t i = 0; i < n; i++) {
        int32_t j = 0;
        double turn = 0;
        for (; j < kept; j++) {
            turn = dmk_chart_turn(&r->chart, s[j].angle, s[i].angle);
            if (fabs(turn) * fmin(s[j].spread, s[i].spread) < same_width * size) break;
        }
        if (j == 16 || s[i].distance > s[0].distance + overhang * size) break;
        if (j == kept) {
            s[kept] = s[i];
            weight[kept++] = 1;
        } else {
            double part = 1.0 / ++weight[j];
            s[j].angle += part * turn;
            s[j].distance += part * (s[i].distance - s[j].distance);
            s[j].spread += part * (s[i].spread - s[j].spread);
        }
    }
    return kept;
}

/* Averages may have changed the order by rounding. */
static void shortest_first(dmk_sheet *s, int32_t n)
{
    for (int32_t i = 1; i < n; i++) {
        if (s[i].distance < s[0].distance) {
            dmk_sheet x = s[i];
            s[i] = s[0];
            s[0] = x;
        }
    }
}

/* Rows of sheets by vertex, by counting, with room for two more in each; a vertex without a hit
 * gets one sheet with spread < 0. */
static int collect(dmk_context *ctx, dmk_rays *r, const dmk_hit *hit, size_t n_hits)
{
    int rc;
    int32_t n = r->mesh->n_vertices, *fill = NULL;
    DMK_TRY(DMK_NEW(ctx, fill, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, r->row, (size_t)n + 1));
    DMK_TRY(DMK_NEW(ctx, r->n_sheets, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, r->sheet, n_hits + 3 * (size_t)n));
    for (size_t i = 0; i < n_hits; i++)
        fill[hit[i].vertex]++;
    for (int32_t v = 0; v < n; v++) {
        r->row[v + 1] = r->row[v] + dmk_max_i(1, fill[v]) + 2;
        fill[v] = r->row[v];
    }
    for (size_t i = 0; i < n_hits; i++)
        r->sheet[fill[hit[i].vertex]++] = hit[i].sheet;
    for (int32_t v = 0; v < n; v++) {
        dmk_sheet *s = r->sheet + r->row[v];
        int32_t hits = fill[v] - r->row[v];
        r->n_sheets[v] = hits ? (uint8_t)merge_hits(r, s, hits, r->size[v]) : 1;
        if (hits == 0)
            s->spread = -1;
        else
            shortest_first(s, r->n_sheets[v]);
    }
done:
    free(fill);
    return rc;
}

/* On a rough mesh go over to the smooth one. */
static int take_smooth(dmk_context *ctx, dmk_rays *r)
{
    int rc = dmk_rays_smooth(ctx, r, &r->smooth);
    if (rc != DMK_OK || !r->smooth) return rc;
    r->mesh = r->smooth;
    free(r->size);
    free(r->bend);
    r->size = r->bend = NULL;
    r->mean = 0;
    DMK_TRY(find_sizes(ctx, r));
    DMK_TRY(find_bends(ctx, r));
done:
    return rc;
}

int dmk_rays_create(dmk_context *ctx, const dmk_locus_input *in, dmk_rays *r)
{
    int rc;
    dmk_hit *hit = NULL;
    size_t n_hits = 0;
    memset(r, 0, sizeof *r);
    r->mesh = in->mesh;
    r->distance = in->distance;
    DMK_TRY(dmk_find_across(ctx, in->mesh, &r->across));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(find_sizes(ctx, r));
    DMK_TRY(find_bends(ctx, r));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(take_smooth(ctx, r));
    find_noise(r);
    DMK_TRY(dmk_chart_create(ctx, r->mesh, r->across, &in->source, &r->chart));
    DMK_TRY(dmk_rays_find_curvature(ctx, r));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_fan_shoot(ctx, r, &r->profile, &hit, &n_hits));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(collect(ctx, r, hit, n_hits));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_rays_repair(ctx, r));
    DMK_TRY(dmk_poll(ctx));
    DMK_TRY(dmk_rays_complete(ctx, r));
    DMK_TRY(dmk_poll(ctx));
done:
    free(hit);
    if (rc != DMK_OK) dmk_rays_free(r);
    return rc;
}

void dmk_rays_free(dmk_rays *r)
{
    dmk_chart_free(&r->chart);
    free(r->across);
    free(r->size);
    free(r->bend);
    free(r->curvature);
    dmk_profile_free(&r->profile);
    dmk_mesh_destroy(&r->smooth);
    free(r->row);
    free(r->n_sheets);
    free(r->sheet);
    memset(r, 0, sizeof *r);
}

int32_t dmk_rays_continue(const dmk_rays *r, const dmk_sheet *from, double length, int32_t v)
{
    int32_t best = -1;
    double least = neighbour_width * length;
    for (int32_t i = r->row[v]; i < r->row[v] + r->n_sheets[v]; i++) {
        const dmk_sheet *s = r->sheet + i;
        double width = dmk_rays_width(r, from, s);
        if (width < least && fabs(s->distance - from->distance) < neighbour_step * length) {
            least = width;
            best = i;
        }
    }
    return best;
}
