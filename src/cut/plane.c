/* The disk in the plane: distance times direction at the source. On a polyhedron directions are not those of the
 * surface that it stands for: behind a saddle vertex all paths start in one direction, and near a conjugate point
 * they jump. So triangles turn over, or are flat, in the plane; around these, directions are averaged. What that
 * leaves are mostly triangles whose sides span so much of the circle that they dip below a vertex nearer to the source:
 * there each vertex goes where all of its triangles lie the right way round. */
#include "cut/cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of 600 disks, 20 tori, ellipsoids and quartics of 1,000 to 87,000 triangles from 30 sources each, 5 have such
 * triangles left; with one ring 18, with four 20; with patience for 20 rounds 11. */
enum {
    RINGS = 2,      /* around the corners of such triangles: that many move with them */
    PATIENCE = 100, /* rounds: as many may leave no fewer of them */
    MOST_MOVES = 10 /* for each vertex, in the mean: on scans about what else it takes to cut */
};

typedef struct disk {
    const dmk_mesh *cut;
    double *best;                 /* 2 for each vertex: where the fewest triangles are turned */
    double *plane;                /* 2 for each vertex: as it is now */
    double *distance, *direction; /* vertices: the same as these */
    dmk_vertex_stars star;
    int32_t *turned, n_turned; /* triangles that are turned over, or flat */
    int32_t *moving, n_moving; /* vertices: of these, and in rings around */
    bool *moves;               /* vertices: is moving */
    int32_t *stale, n_stale;   /* vertices that have moved away from the best */
    bool *is_stale;            /* vertices */
    int64_t n_left;            /* moves, until it has to do */
} disk;

static bool is_source(const disk *d, int32_t v)
{
    return d->distance[v] == 0;
}

static bool is_turned(const dmk_mesh *cut, const double *plane, int32_t t)
{
    const int32_t *v = cut->triangle + 3 * (size_t)t;
    const double *a = plane + 2 * (size_t)v[0], *b = plane + 2 * (size_t)v[1],
                 *c = plane + 2 * (size_t)v[2];
    return !((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0);
}

size_t dmk_plane_flipped(const dmk_mesh *cut, const double *plane)
{
    size_t n = 0;
    for (int32_t t = 0; t < cut->n_triangles; t++) n += is_turned(cut, plane, t);
    return n;
}

/* The i-th of all vertices' corners. */
static int32_t corner_at(const disk *d, int32_t i)
{
    return d->star.triangle[i] / 4 * 3 + d->star.triangle[i] % 4;
}

static void move(disk *d, int32_t v, double direction)
{
    d->direction[v] = direction;
    d->plane[2 * v] = d->distance[v] * cos(direction);
    d->plane[2 * v + 1] = d->distance[v] * sin(direction);
    if (!d->is_stale[v]) d->stale[d->n_stale++] = v;
    d->is_stale[v] = true;
}

static void let_move(disk *d, int32_t v)
{
    if (d->moves[v] || is_source(d, v)) return;
    d->moves[v] = true;
    d->moving[d->n_moving++] = v;
}

/* The vertices of turned triangles, and some rings around. */
static void find_moving(disk *d, int rings)
{
    for (int32_t i = 0; i < d->n_moving; i++) d->moves[d->moving[i]] = false;
    d->n_moving = 0;
    for (int32_t i = 0; i < 3 * d->n_turned; i++)
        let_move(d, d->cut->triangle[3 * d->turned[i / 3] + i % 3]);
    for (int32_t begin = 0; rings > 0; rings--) {
        const int32_t end = d->n_moving;
        for (; begin < end; begin++) {
            const int32_t v = d->moving[begin];
            for (int32_t i = d->star.row[v]; i < d->star.row[v + 1]; i++) {
                let_move(d, d->cut->triangle[dmk_next(corner_at(d, i))]);
                let_move(d, d->cut->triangle[dmk_previous(corner_at(d, i))]);
            }
        }
    }
}

/* Of the moving vertices' triangles: no others can have changed. Each is looked at once, from its first corner that
 * moves. */
static void find_turned(disk *d)
{
    d->n_turned = 0;
    for (int32_t i = 0; i < d->n_moving; i++) {
        const int32_t v = d->moving[i];
        for (int32_t k = d->star.row[v]; k < d->star.row[v + 1]; k++) {
            const int32_t t = corner_at(d, k) / 3, *of = d->cut->triangle + 3 * t;
            const int32_t least = d->moves[of[0]] ? of[0] : d->moves[of[1]] ? of[1] : of[2];
            if (v == least && is_turned(d->cut, d->plane, t)) d->turned[d->n_turned++] = t;
        }
    }
}

/* From the vertex' direction to another one, the short way around. */
static double turn_to(const disk *d, int32_t v, double direction)
{
    return dmk_turn_between(2 * M_PI, d->direction[v], direction);
}

/* The mean of the own direction and the neighbours'. */
static void average(disk *d, int32_t v)
{
    double sum = 0;
    int n = 1;
    for (int32_t i = d->star.row[v]; i < d->star.row[v + 1]; i++) {
        const int32_t next = dmk_next(corner_at(d, i)), last = dmk_previous(corner_at(d, i));
        const int32_t w[2] = {d->cut->triangle[next], d->cut->triangle[last]};
        const bool at_border = d->cut->edge_triangle[2 * d->cut->triangle_edge[next] + 1] < 0;
        for (int k = 0; k < 1 + at_border; k++) { /* each neighbour once */
            if (is_source(d, w[k])) continue;
            sum += turn_to(d, v, d->direction[w[k]]);
            n++;
        }
    }
    move(d, v, d->direction[v] + sum / n);
}

/* The middle of the arc on which all triangles of the vertex lie the right way round. Of each it is that to the left
 * of the opposite side. Where there is none, between the two that are farthest apart. At a border no farther beyond
 * the neighbours than they are apart. */
static void centre(disk *d, int32_t v)
{
    double begin = -HUGE_VAL, end = HUGE_VAL, least = HUGE_VAL, most = -HUGE_VAL;
    for (int32_t i = d->star.row[v]; i < d->star.row[v + 1]; i++) {
        const int32_t w[2] = {d->cut->triangle[dmk_next(corner_at(d, i))],
                              d->cut->triangle[dmk_previous(corner_at(d, i))]};
        const double *a = d->plane + 2 * w[0], *b = d->plane + 2 * w[1];
        const double x = b[0] - a[0], y = b[1] - a[1];
        const double beyond = (a[0] * b[1] - a[1] * b[0]) / (d->distance[v] * hypot(x, y));
        for (int k = 0; k < 2; k++) {
            const double to = is_source(d, w[k]) ? 0 : turn_to(d, v, d->direction[w[k]]);
            least = fmin(least, to);
            most = fmax(most, to);
        }
        if (!(beyond < 1)) continue; /* anywhere on the circle */
        const double half = 0.5 * M_PI + asin(fmax(beyond, -1));
        const double middle = turn_to(d, v, atan2(x, -y));
        begin = fmax(begin, middle - half);
        end = fmin(end, middle + half);
    }
    if (begin == -HUGE_VAL) return;
    begin = fmax(begin, 2 * least - most);
    end = fmin(end, 2 * most - least);
    move(d, v, d->direction[v] + 0.5 * (begin + end));
}

/* What moved since the best, from one to the other. */
static void keep(disk *d, const double *from, double *to)
{
    for (int32_t i = 0; i < d->n_stale; i++) {
        const int32_t v = d->stale[i];
        memcpy(to + 2 * v, from + 2 * v, 2 * sizeof *to);
        d->direction[v] = atan2(from[2 * v + 1], from[2 * v]);
        d->is_stale[v] = false;
    }
    d->n_stale = 0;
}

/* Round after round, the best one stays. */
static int relax(dmk_context *ctx, disk *d, int rings, void (*step)(disk *, int32_t))
{
    int rc = DMK_OK;
    int32_t least = d->n_turned;
    for (int vain = 0; least > 0 && vain < PATIENCE && d->n_left > 0; vain++) {
        DMK_TRY(dmk_poll(ctx));
        find_moving(d, rings);
        d->n_left -= d->n_moving;
        for (int32_t i = 0; i < d->n_moving; i++) step(d, d->moving[i]);
        find_turned(d);
        if (d->n_turned >= least) continue;
        least = d->n_turned;
        vain = -1;
        keep(d, d->plane, d->best);
    }
    for (int32_t i = 0; i < d->n_stale; i++) let_move(d, d->stale[i]);
    keep(d, d->best, d->plane);
    find_turned(d);
done:
    return rc;
}

static int allocate(dmk_context *ctx, disk *d)
{
    int rc;
    const size_t n = (size_t)d->cut->n_vertices, n_triangles = (size_t)d->cut->n_triangles;
    DMK_TRY(DMK_NEW(ctx, d->plane, 2 * n));
    DMK_TRY(DMK_NEW(ctx, d->distance, n));
    DMK_TRY(DMK_NEW(ctx, d->direction, n));
    DMK_TRY(dmk_vertex_stars_create(ctx, d->cut, &d->star));
    DMK_TRY(DMK_NEW(ctx, d->turned, n_triangles));
    DMK_TRY(DMK_NEW(ctx, d->moving, n));
    DMK_TRY(DMK_NEW(ctx, d->moves, n));
    DMK_TRY(DMK_NEW(ctx, d->stale, n));
    DMK_TRY(DMK_NEW(ctx, d->is_stale, n));
done:
    return rc;
}

/* All as it is in the best; every turned triangle. */
static void begin(disk *d)
{
    const size_t n = (size_t)d->cut->n_vertices;
    memcpy(d->plane, d->best, 2 * n * sizeof *d->plane);
    for (size_t v = 0; v < n; v++) {
        d->distance[v] = hypot(d->best[2 * v], d->best[2 * v + 1]);
        d->direction[v] = atan2(d->best[2 * v + 1], d->best[2 * v]);
    }
    for (int32_t t = 0; t < d->cut->n_triangles; t++) {
        if (is_turned(d->cut, d->best, t)) d->turned[d->n_turned++] = t;
    }
}

int dmk_plane_unfold(dmk_context *ctx, const dmk_mesh *cut, double *plane)
{
    int rc;
    disk d = {.cut = cut, .best = plane, .n_left = MOST_MOVES * (int64_t)cut->n_vertices};
    if (dmk_plane_flipped(cut, plane) == 0) return DMK_OK;
    DMK_TRY(allocate(ctx, &d));
    begin(&d);
    for (int32_t before = INT32_MAX; d.n_turned > 0 && d.n_turned < before;) {
        before = d.n_turned;
        DMK_TRY(relax(ctx, &d, RINGS, average));
        DMK_TRY(relax(ctx, &d, 0, centre));
    }
done:
    free(d.plane);
    free(d.distance);
    free(d.direction);
    dmk_vertex_stars_free(&d.star);
    free(d.turned);
    free(d.moving);
    free(d.moves);
    free(d.stale);
    free(d.is_stale);
    return rc;
}
