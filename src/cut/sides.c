/* Directions on the sides of the cut. It does not run just between the families of paths everywhere: where two that are
 * about as long reach the same vertices, as behind a saddle vertex on the cut locus, it leaves some with those that the
 * other one reaches. In the plane they would lie far off, among the triangles of the other side. So directions are
 * taken on from neighbour to neighbour on the same side, away from the source; a vertex has that of its own path where
 * that is of one family with a neighbour's, else that of the neighbours' family which is the shortest there. */
#include "base/heap.h"
#include "base/parallel.h"
#include "cut/cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Radians: directions of neighbours that differ by more are of two families, on tori by 2.1 to 2.4. 0.2 to 1.4 does as
 * well there; with 1.4 scans have 7 % more triangles turned over in the plane, with 0.35 2 % fewer. */
static const double apart = 0.7;

typedef struct sides {
    const dmk_geodesics *g;
    const bool *crossed; /* 3 n_triangles: half-edges that the cut crosses */
    double *turn;  /* n_vertices: from the direction of a vertex' own path to that of its side */
    bool *known;   /* n_vertices */
    bool *waits;   /* n_vertices: has been put into the heap */
    dmk_heap heap; /* vertices by distance */
    int32_t *left, n_left; /* vertices without a nearer one that is known */
    size_t room;           /* for these */
} sides;

dmk_polar dmk_polar_of(const dmk_geodesics *g, int32_t v, const dmk_image *image, double at,
                       double x, double y)
{
    const double length = dmk_image_length(image, at, 0);
    const double longer = length / (length - image->before);
    const double vx = (at - image->x) * longer, vy = -image->y * longer;
    const double px = vx + x - at, py = vy + y;
    const double turn = atan2(vx * py - vy * px, vx * px + vy * py);
    return (dmk_polar){g->star.unit * dmk_image_length(image, x, y),
                       dmk_turn_scale(g) * (g->arrival[v].direction + turn)};
}

/* What a half-edge's one end says of the other, v: its family, as it is on its side, there. */
typedef struct said {
    double length, to; /* of its path; from the direction of v's own */
} said;

static said family_of(const sides *s, int32_t h, bool from_start)
{
    const dmk_geodesics *g = s->g;
    const int32_t start = g->mesh->triangle[dmk_next(h)], end = g->mesh->triangle[dmk_previous(h)];
    const int32_t w = from_start ? start : end, v = from_start ? end : start;
    if (g->distance[w] == 0) return (said){0, 0};
    const double length = dmk_length_of(g, h);
    const dmk_image image = from_start ? dmk_image_at_start(g, h) : dmk_image_at_end(g, h);
    const dmk_polar p =
        dmk_polar_of(g, w, &image, from_start ? 0 : length, from_start ? length : 0, 0);
    const double own = dmk_turn_scale(g) * g->arrival[v].direction;
    return (said){p.distance, dmk_turn_between(2 * M_PI, own, p.direction + s->turn[w])};
}

/* From the neighbours on its side that are known, and nearer to the source if so wanted: true if one is of the
 * family of v's own path; else `best` is what the shortest says, of infinite length if there is none. */
static bool is_reached(const sides *s, int32_t v, bool from_nearer, said *best)
{
    const dmk_geodesics *g = s->g;
    const int32_t first = g->star.first[v];
    *best = (said){HUGE_VAL, 0};
    for (int32_t c = first, next, n = 0; c >= 0 && (c != first || n == 0); c = next, n++) {
        next = dmk_star_next(&g->star, c);
        for (int k = 0; k < (next < 0 ? 2 : 1); k++) { /* each neighbour once */
            const int32_t h = k == 0 ? dmk_previous(c) : dmk_next(c);
            const int32_t w = g->mesh->triangle[k == 0 ? dmk_next(c) : dmk_previous(c)];
            if (s->crossed[h] || !s->known[w]) continue;
            if (from_nearer && g->distance[w] >= g->distance[v]) continue;
            const said says = family_of(s, h, k == 1);
            if (fabs(says.to) < apart) return true;
            if (says.length < best->length) *best = says;
        }
    }
    return false;
}

/* Whether there is something that says it. */
static bool set_turn(sides *s, int32_t v, bool from_nearer)
{
    said best;
    s->turn[v] = 0;
    if (is_reached(s, v, from_nearer, &best)) return true;
    if (best.length < HUGE_VAL) s->turn[v] = best.to;
    return best.length < HUGE_VAL;
}

/* Vertices that no nearer neighbour's own path reaches; all count as known. */
static void find_odd(int32_t begin, int32_t end, void *data)
{
    sides *s = data;
    said best;
    for (int32_t v = begin; v < end; v++)
        s->waits[v] = s->g->star.first[v] >= 0 && !is_reached(s, v, true, &best);
}

static int wait(dmk_context *ctx, sides *s, int32_t v)
{
    s->waits[v] = true;
    return dmk_heap_push(ctx, &s->heap, s->g->distance[v], v);
}

/* Farther ones that have relied on v's own path. */
static int push_farther(dmk_context *ctx, sides *s, int32_t v)
{
    int rc = DMK_OK;
    const dmk_geodesics *g = s->g;
    const int32_t first = g->star.first[v];
    for (int32_t c = first, n = 0; c >= 0 && (c != first || n == 0); n++) {
        const int32_t w[2] = {g->mesh->triangle[dmk_next(c)], g->mesh->triangle[dmk_previous(c)]};
        for (int k = 0; k < 2; k++)
            if (!s->waits[w[k]] && g->distance[w[k]] > g->distance[v]) DMK_TRY(wait(ctx, s, w[k]));
        c = dmk_star_next(&g->star, c);
    }
done:
    return rc;
}

/* All but a few are reached by a nearer neighbour's own path; these few, and those beyond that may rely on them, one
 * after another by distance. */
static int set_from_nearer(dmk_context *ctx, sides *s)
{
    int rc = DMK_OK;
    const int32_t n = s->g->mesh->n_vertices;
    const dmk_site *site = s->g->source;
    memset(s->known, true, (size_t)n * sizeof *s->known);
    memset(s->turn, 0, (size_t)n * sizeof *s->turn);
    dmk_parallel(ctx, n, find_odd, s);
    for (int32_t i = 0; i < site->n_sectors; i++) {
        s->waits[s->g->mesh->triangle[dmk_next(site->sector[i].half)]] = false;
        s->waits[s->g->mesh->triangle[dmk_previous(site->sector[i].half)]] = false;
    }
    if (site->vertex >= 0) s->waits[site->vertex] = false;
    for (int32_t v = 0; v < n; v++)
        if (s->waits[v]) DMK_TRY(wait(ctx, s, v));
    while (s->heap.n > 0) {
        const int32_t v = dmk_heap_pop(&s->heap).item;
        s->known[v] = set_turn(s, v, true);
        if (!s->known[v]) DMK_TRY(DMK_GROW(ctx, s->left, (size_t)s->n_left + 1, s->room));
        if (!s->known[v]) s->left[s->n_left++] = v;
        if (!s->known[v] || s->turn[v] != 0) DMK_TRY(push_farther(ctx, s, v));
    }
done:
    return rc;
}

int dmk_cut_sides(dmk_context *ctx, const dmk_geodesics *g, const bool *crossed, double *turn)
{
    int rc;
    const size_t n_vertices = (size_t)g->mesh->n_vertices;
    sides s = {.g = g, .crossed = crossed, .turn = turn};
    DMK_TRY(DMK_NEW_UNSET(ctx, s.known, n_vertices));
    DMK_TRY(DMK_NEW(ctx, s.waits, n_vertices));
    DMK_TRY(set_from_nearer(ctx, &s));
    /* those without nearer ones from all, until none is left that has some */
    for (int32_t before = INT32_MAX; s.n_left > 0 && s.n_left < before;) {
        const int32_t n = before = s.n_left;
        s.n_left = 0;
        DMK_TRY(dmk_poll(ctx));
        for (int32_t i = 0; i < n; i++) {
            const int32_t v = s.left[i];
            s.known[v] = set_turn(&s, v, false);
            if (!s.known[v]) s.left[s.n_left++] = v;
        }
    }
done:
    free(s.known);
    free(s.waits);
    free(s.left);
    dmk_heap_free(&s.heap);
    return rc;
}
