/* The disk in the plane: distance times direction at the source. On a polyhedron directions are not those of the
 * surface that it stands for: behind a saddle vertex all paths start in one direction, and near a conjugate point
 * they jump. So triangles turn over, or are flat, in the plane; around these, directions are averaged. What that
 * leaves are mostly triangles whose sides span so much of the circle that they dip below a vertex nearer to the source:
 * there each vertex goes where all of its triangles lie the right way round. */
#include "cut/cut.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of 300 disks, 30 tori, ellipsoids and quartics of 1,500 to 20,000 triangles from 10 sources each, 10 have such
 * triangles left; on 99 disks of scans and machine parts 53,300 triangles are. Rings: 1: 18 disks; 3: 54,500 triangles.
 * Patience 12: 14 disks; 50 takes no fewer and 4 % more moves. With 6 moves 59,800 triangles; with 24 49,900, and it
 * takes 1.4 times as long. */
enum {
    RINGS = 2,      /* around the corners of such triangles: that many move with them */
    PATIENCE = 25,  /* rounds: as many may leave no fewer of them */
    MOST_MOVES = 12 /* for each vertex, in the mean: on scans about what else it takes to cut */
};

/* A corner of a vertex: the triangle's others, counterclockwise; last: no triangle begins with `previous`. */
typedef struct wedge {
    int32_t next, previous, triangle;
    bool last;
} wedge;

typedef struct spot {
    double x, y; /* direction, of length 1; of the source 0 */
    double distance;
} spot;

typedef struct disk {
    const dmk_mesh *cut;
    double *best;    /* 2 for each vertex: where the fewest triangles are turned */
    spot *spot;      /* vertices, as they are now */
    bool *at_border; /* vertices */
    dmk_vertex_stars star;
    wedge *wedge;              /* 3 n_triangles: corners of the vertices, in rows as in the star */
    int32_t *turned, n_turned; /* triangles that are turned over, or flat */
    int32_t *moving, n_moving; /* vertices: of these, and in rings around */
    bool *moves;               /* vertices: is moving */
    int32_t *stale, n_stale;   /* vertices that have moved away from the best */
    bool *is_stale;            /* vertices */
    int64_t n_left;            /* moves, until it has to do */
} disk;

static bool is_source(const disk *d, int32_t v)
{
    return d->spot[v].distance == 0;
}

static bool are_turned(const double a[2], const double b[2], const double c[2])
{
    return !((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0);
}

static bool is_turned(const dmk_mesh *cut, const double *plane, int32_t t)
{
    const int32_t *v = cut->triangle + 3 * (size_t)t;
    return are_turned(plane + 2 * (size_t)v[0], plane + 2 * (size_t)v[1], plane + 2 * (size_t)v[2]);
}

size_t dmk_plane_flipped(const dmk_mesh *cut, const double *plane)
{
    size_t n = 0;
    for (int32_t t = 0; t < cut->n_triangles; t++) n += is_turned(cut, plane, t);
    return n;
}

static void put(const disk *d, int32_t v, double at[2])
{
    const spot *s = d->spot + v;
    at[0] = s->distance * s->x;
    at[1] = s->distance * s->y;
}

static void take(disk *d, int32_t v, const double at[2])
{
    const double distance = hypot(at[0], at[1]);
    d->spot[v] = (spot){at[0] / distance, at[1] / distance, distance};
    if (distance == 0) d->spot[v] = (spot){0};
}

/* Another direction, of any length. */
static void turn_to(disk *d, int32_t v, double x, double y)
{
    const double length = sqrt(x * x + y * y);
    if (!(length > 0)) return;
    d->spot[v].x = x / length;
    d->spot[v].y = y / length;
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
                let_move(d, d->wedge[i].next);
                let_move(d, d->wedge[i].previous);
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
        double a[2], b[2], c[2];
        put(d, v, a);
        for (int32_t k = d->star.row[v]; k < d->star.row[v + 1]; k++) {
            const wedge *w = d->wedge + k;
            if ((d->moves[w->next] && w->next < v) || (d->moves[w->previous] && w->previous < v))
                continue;
            put(d, w->next, b);
            put(d, w->previous, c);
            if (are_turned(a, b, c)) d->turned[d->n_turned++] = w->triangle;
        }
    }
}

/* The mean of the neighbours' directions, as of unit vectors. */
static void average(disk *d, int32_t v)
{
    double x = 0, y = 0;
    for (int32_t i = d->star.row[v]; i < d->star.row[v + 1]; i++) {
        const wedge *w = d->wedge + i;
        x += d->spot[w->next].x;
        y += d->spot[w->next].y;
        if (w->last) {
            x += d->spot[w->previous].x;
            y += d->spot[w->previous].y;
        }
    }
    turn_to(d, v, x, y);
}

/* From the vertex' direction to (x, y), the short way around. */
static double angle_to(const spot *s, double x, double y)
{
    return atan2(s->x * y - s->y * x, s->x * x + s->y * y);
}

/* Where an arc begins, an angle above -2 pi and at most pi, whose half is at most pi. Compared without one. */
typedef struct bearing {
    int half_turns; /* that are full, downwards */
    double x, y;    /* of length 1 */
} bearing;

/* The arc's middle is (x, y), and to both sides it has an angle with this cosine and sine. */
static bearing begin_of(double x, double y, double c, double s)
{
    const bearing b = {0, x * c + y * s, y * c - x * s};
    const bool far = y < 0 && !(x > 0 && b.x > 0); /* else rounding has it above 0 */
    return (bearing){b.y < 0 ? -1 : far ? -2 : 0, b.x, b.y};
}

static void keep_last(bearing *last, bearing b)
{
    if (b.half_turns > last->half_turns ||
        (b.half_turns == last->half_turns && last->x * b.y > last->y * b.x))
        *last = b;
}

static double angle_of(bearing b)
{
    return atan2(b.y, b.x) - (b.half_turns < -1 ? 2 * M_PI : 0);
}

/* The middle of the arc on which all triangles of the vertex lie the right way round. Of each it is that to the left
 * of the opposite side. Where there is none, between the two that are farthest apart. At a border no farther beyond
 * the neighbours than they are apart. */
static void centre(disk *d, int32_t v)
{
    const spot *s = d->spot + v;
    const double inverse = 1 / s->distance;
    double least = HUGE_VAL, most = -HUGE_VAL;
    bearing first = {.half_turns = -3}, last = first; /* last: mirrored */
    for (int32_t i = d->star.row[v]; i < d->star.row[v + 1]; i++) {
        const int32_t w[2] = {d->wedge[i].next, d->wedge[i].previous};
        double p[2][2];
        for (int k = 0; k < 2; k++) {
            put(d, w[k], p[k]);
            if (!d->at_border[v]) continue;
            const double to = is_source(d, w[k]) ? 0 : angle_to(s, p[k][0], p[k][1]);
            least = fmin(least, to);
            most = fmax(most, to);
        }
        const double dx = p[1][0] - p[0][0], dy = p[1][1] - p[0][1];
        const double scale = 1 / sqrt(dx * dx + dy * dy);
        const double x = scale * (s->y * dx - s->x * dy), y = scale * (s->x * dx + s->y * dy);
        const double beyond = scale * inverse * (p[0][0] * p[1][1] - p[0][1] * p[1][0]);
        if (!(beyond < 1)) continue; /* anywhere on the circle */
        const double cosine = fmin(-beyond, 1), sine = sqrt(1 - cosine * cosine);
        keep_last(&first, begin_of(x, y, cosine, sine));
        keep_last(&last, begin_of(x, -y, cosine, sine));
    }
    if (first.half_turns < -2) return;
    double begin = angle_of(first), end = -angle_of(last);
    if (d->at_border[v]) {
        begin = fmax(begin, 2 * least - most);
        end = fmin(end, 2 * most - least);
    }
    const double by = 0.5 * (begin + end), c = cos(by), z = sin(by);
    turn_to(d, v, c * s->x - z * s->y, z * s->x + c * s->y);
}

/* What moved since the best becomes that, or goes back there. */
static void settle(disk *d, bool is_best)
{
    for (int32_t i = 0; i < d->n_stale; i++) {
        const int32_t v = d->stale[i];
        if (is_best)
            put(d, v, d->best + 2 * (size_t)v);
        else
            take(d, v, d->best + 2 * (size_t)v);
        d->is_stale[v] = false;
    }
    d->n_stale = 0;
}

/* Round after round, the best one stays. It ends in vain, when no more moves than so many are left, or where middles
 * of arcs run wild: more than a row across the disk, of that many triangles, are turned beside the fewest. Without that
 * row 39 of the disks above have some left; without end it takes a sixth longer. */
static int relax(dmk_context *ctx, disk *d, int64_t n_left, int rings,
                 void (*step)(disk *, int32_t))
{
    int rc = DMK_OK;
    int32_t least = d->n_turned;
    const double row = sqrt(d->cut->n_vertices);
    for (int vain = 0; least > 0 && vain < PATIENCE && d->n_left > n_left; vain++) {
        DMK_TRY(dmk_poll(ctx));
        find_moving(d, rings);
        d->n_left -= d->n_moving;
        for (int32_t i = 0; i < d->n_moving; i++) step(d, d->moving[i]);
        find_turned(d);
        if (step == centre && d->n_turned > least + row) break;
        if (d->n_turned >= least) continue;
        least = d->n_turned;
        vain = -1;
        settle(d, true);
    }
    for (int32_t i = 0; i < d->n_stale; i++) let_move(d, d->stale[i]);
    settle(d, false);
    find_turned(d);
done:
    return rc;
}

/* Each vertex' corners, one beside the other. */
static int find_wedges(dmk_context *ctx, disk *d)
{
    int rc;
    const dmk_mesh *m = d->cut;
    const int32_t n = 3 * m->n_triangles;
    DMK_TRY(dmk_vertex_stars_create(ctx, m, &d->star));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->wedge, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, d->at_border, (size_t)m->n_vertices));
    for (int32_t i = 0; i < n; i++) {
        const int32_t t = d->star.triangle[i] / 4, corner = 3 * t + d->star.triangle[i] % 4;
        const int32_t edge = m->triangle_edge[dmk_next(corner)];
        const bool last = m->edge_triangle[2 * (size_t)edge + 1] < 0;
        d->wedge[i] =
            (wedge){m->triangle[dmk_next(corner)], m->triangle[dmk_previous(corner)], t, last};
        if (last) d->at_border[m->triangle[corner]] = true;
    }
done:
    return rc;
}

static int begin(dmk_context *ctx, disk *d)
{
    int rc;
    const size_t n = (size_t)d->cut->n_vertices;
    DMK_TRY(find_wedges(ctx, d));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->spot, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->turned, (size_t)d->cut->n_triangles));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->moving, n));
    DMK_TRY(DMK_NEW(ctx, d->moves, n));
    DMK_TRY(DMK_NEW_UNSET(ctx, d->stale, n));
    DMK_TRY(DMK_NEW(ctx, d->is_stale, n));
    for (int32_t v = 0; v < d->cut->n_vertices; v++) take(d, v, d->best + 2 * (size_t)v);
    for (int32_t t = 0; t < d->cut->n_triangles; t++)
        if (is_turned(d->cut, d->best, t)) d->turned[d->n_turned++] = t;
done:
    return rc;
}

int dmk_plane_unfold(dmk_context *ctx, const dmk_mesh *cut, double *plane)
{
    int rc;
    disk d = {.cut = cut, .best = plane, .n_left = MOST_MOVES * (int64_t)cut->n_vertices};
    if (dmk_plane_flipped(cut, plane) == 0) return DMK_OK;
    DMK_TRY(begin(ctx, &d));
    for (int32_t before = INT32_MAX; d.n_turned > 0 && d.n_turned < before;) {
        before = d.n_turned;
        /* a move of each vertex is kept for the middles: with none 62,900 triangles are left */
        DMK_TRY(relax(ctx, &d, cut->n_vertices, RINGS, average));
        DMK_TRY(relax(ctx, &d, 0, 0, centre));
    }
done:
    dmk_vertex_stars_free(&d.star);
    free(d.wedge);
    free(d.at_border);
    free(d.spot);
    free(d.turned);
    free(d.moving);
    free(d.moves);
    free(d.stale);
    free(d.is_stale);
    return rc;
}
