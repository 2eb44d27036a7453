/* The fan of rays: as dense as needed for every vertex to lie between two neighbouring rays that
 * are at most about one edge apart. The directions are cut into wedges of equal angle, each worked
 * on by itself, depth first, so that only a few rays are in memory and the result does not depend
 * on the number of threads. */
#include "locus/rays.h"

#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

enum { n_wedges = 64, max_depth = 20 };

/* In mean edges at the vertex: at this width a beam between two rays is narrow enough to place the
 * vertices in it; a wider one is split. Never narrower than needed: the vertices of a polyhedron
 * bend neighbouring rays by a little, so that very near ones may even cross. */
static const double fine_width = 0.6;
/* In mean edges: how much longer than the guide a ray may become. */
static const double slack = 3.0;
/* In mean edges at the vertex: two rays keep the width of their beam that far behind the last
 * vertex that both pass. */
static const double pick_up_way = 2.0;
/* Times `fine_width`: the rays' spread makes a beam that seems narrow wider than this. */
static const double strange = 3;

/* Times the square root of the number of triangles: most rays in one wedge. Where a surface curves
 * negatively, rays part so fast that one wedge may need many; rough meshes would take any number,
 * since rays part at their saddle vertices without end. */
static const double most_rays = 40, most_rays_rough = 4;

/* Most vertices that the rays of one wedge may pass: those of good meshes pass half as many as
 * there are triangles, those of rough small ones 8 times as many. Around a vertex with a large part
 * of all triangles each ray passes that many. */
static int64_t most_passes(int32_t n)
{
    return 2 * (int64_t)n + dmk_min_i(14 * dmk_min_i(n, 1000000), 2000000);
}

/* What the rays of a wedge found. */
typedef struct wedge_hits {
    dmk_hit *hit;
    size_t n, capacity;
    dmk_profile_ray *ray; /* n_rays: by angle */
    int32_t n_rays, ray_capacity;
} wedge_hits;

typedef struct crew {
    const dmk_rays *rays;
    wedge_hits wedge[n_wedges];
    atomic_int next, status;
} crew;

typedef struct worker {
    crew *crew;
    dmk_context *ctx; /* of the caller's thread, which asks whether to go on; else NULL */
    wedge_hits *out;
    int32_t *mark; /* n_vertices: index of the vertex in the last list marked */
    double
        *placed; /* 2*n_vertices: the last beam that was narrow enough at the vertex, as angles */
    int32_t n_left;      /* rays that may still be shot in this wedge, ... */
    int64_t passes_left; /* ... and vertices they may pass */
    dmk_ray ray[max_depth + 2];
} worker;

static int add_hit(wedge_hits *o, int32_t v, double angle, double distance, double spread)
{
    if (o->n == o->capacity) {
        size_t capacity = o->capacity ? 2 * o->capacity : 4096;
        dmk_hit *grown = realloc(o->hit, capacity * sizeof *grown);
        if (!grown) return DMK_E_NOMEM;
        o->hit = grown;
        o->capacity = capacity;
    }
    o->hit[o->n++] = (dmk_hit){{angle, distance, spread}, v};
    return DMK_OK;
}

static int add_ray(wedge_hits *o, const dmk_ray *ray)
{
    if (o->n_rays == o->ray_capacity) {
        int32_t capacity = o->ray_capacity ? 2 * o->ray_capacity : 256;
        dmk_profile_ray *grown = realloc(o->ray, (size_t)capacity * sizeof *grown);
        if (!grown) return DMK_E_NOMEM;
        o->ray = grown;
        o->ray_capacity = capacity;
    }
    o->ray[o->n_rays++] =
        (dmk_profile_ray){ray->angle, ray->until, ray->pass[ray->n - 1].x, ray->widest};
    return DMK_OK;
}

/* The vertex at (p->x, p->y) of the right ray and (q->x, q->y) of the left one lies between them.
 * Each ray's plane gives its distance with an error that grows with the square of its offset; the
 * two are weighted by the other's offset. */
static int hit_vertex(worker *w, const dmk_ray *right, const dmk_ray *left, const dmk_pass *p,
                      const dmk_pass *q)
{
    double width = p->y - q->y, s = p->y / width, turn = left->angle - right->angle;
    double distance = (1 - s) * hypot(p->x, p->y) + s * hypot(q->x, q->y);
    return add_hit(w->out, p->vertex, right->angle + s * turn, distance, width / turn);
}

/* The index of a vertex in the list marked last, or -1. */
static int32_t marked(const worker *w, const dmk_ray *ray, int32_t vertex)
{
    int32_t i = w->mark[vertex];
    return i < ray->n && ray->pass[i].vertex == vertex ? i : -1;
}

static void mark(worker *w, const dmk_ray *ray)
{
    for (int32_t i = 0; i < ray->n; i++)
        w->mark[ray->pass[i].vertex] = i;
}

/* The beam from `right` to `left` at vertex v: false if a beam that it is a part of was narrow
 * enough there; else, if this one is, remember it. */
static bool take_over(worker *w, int32_t v, const dmk_ray *right, const dmk_ray *left, bool narrow)
{
    double *placed = w->placed + 2 * (size_t)v;
    if (placed[0] <= right->angle && left->angle <= placed[1]) return false;
    if (narrow) {
        placed[0] = right->angle;
        placed[1] = left->angle;
    }
    return true;
}

/* Two rays that come near to each other where the rays between them are far apart are none that
 * belong together: a branch of the locus lies between. */
static bool strangers(const dmk_ray *right, const dmk_ray *left, const dmk_pass *p,
                      const dmk_pass *q, double size)
{
    return fabs(left->angle - right->angle) * fmax(p->spread, q->spread) >
           strange * fine_width * size;
}

/* Compare two neighbouring rays through the vertices that both pass. *split: they are too far apart
 * somewhere (or pass no common vertex over a longer way). */
static int compare(worker *w, const dmk_ray *right, const dmk_ray *left, bool *split)
{
    const dmk_rays *rays = w->crew->rays;
    double end = right->pass[right->n - 1].x - rays->mean;
    int32_t alone = 0;
    *split = false;
    mark(w, right);
    for (int32_t j = 0; j < left->n; j++) {
        const dmk_pass *q = left->pass + j, *p;
        bool alive = 0.98 * q->x < rays->distance[q->vertex] + 0.5 * slack * rays->mean;
        int32_t mine = marked(w, right, q->vertex);
        if (mine < 0) {
            alone = alive && q->x < end ? alone + 1 : 0;
            if (alone > 8) *split = true;
            continue;
        }
        p = right->pass + mine;
        alone = 0;
        double width = p->y - q->y, size = rays->size[q->vertex];
        bool narrow = width <= fine_width * size && !strangers(right, left, p, q, size);
        if (fabs(p->x - q->x) > size) continue;
        if (!take_over(w, q->vertex, right, left, narrow)) continue;
        if (alive && !narrow) *split = true;
        if (!narrow || p->y < 0 || q->y >= 0) continue;
        if (hit_vertex(w, right, left, p, q) != DMK_OK) return DMK_E_NOMEM;
    }
    return DMK_OK;
}

/* Vertices that `ray` passes on the side of `other`, which passes beyond them without touching
 * their triangles (narrow ones): inside, if nearer than the width of the beam at the last common
 * vertex. */
static int pick_up(worker *w, const dmk_ray *ray, const dmk_ray *other)
{
    const dmk_rays *rays = w->crew->rays;
    double width = -1, last = 0, turn = other->angle - ray->angle, side = turn > 0 ? 1 : -1;
    mark(w, other);
    for (int32_t i = 0; i < ray->n; i++) {
        const dmk_pass *p = ray->pass + i;
        int32_t j = marked(w, other, p->vertex);
        double y = side * p->y;
        if (j >= 0) {
            width = strangers(ray, other, p, other->pass + j, rays->size[p->vertex])
                        ? -1
                        : y - side * other->pass[j].y;
            last = p->x;
        } else if (y >= 0 && y < width && p->x < last + pick_up_way * rays->size[p->vertex] &&
                   width <= 1.5 * fine_width * rays->size[p->vertex]) {
            const dmk_ray *right = turn > 0 ? ray : other, *left = turn > 0 ? other : ray;
            if (!take_over(w, p->vertex, right, left, true)) continue;
            double angle = ray->angle + turn * y / width, spread = width / fabs(turn);
            int rc = add_hit(w->out, p->vertex, angle, hypot(p->x, p->y), spread);
            if (rc != DMK_OK) return rc;
        }
    }
    return DMK_OK;
}

/* Vertices between two rays; where these are too far apart, shoot one between and go on by halves.
 */
static int bisect(worker *w, const dmk_ray *right, const dmk_ray *left, int depth)
{
    bool split = false;
    int rc = w->ctx ? dmk_poll(w->ctx) : DMK_OK;
    if (rc == DMK_OK) rc = atomic_load(&w->crew->status);
    if (rc == DMK_OK) rc = compare(w, right, left, &split);
    if (rc == DMK_OK) rc = pick_up(w, right, left);
    if (rc == DMK_OK) rc = pick_up(w, left, right);
    if (rc != DMK_OK || !split || depth == max_depth || w->n_left-- <= 0 || w->passes_left <= 0)
        return rc;
    dmk_ray *mid = &w->ray[2 + depth];
    rc = dmk_ray_shoot(w->crew->rays, 0.5 * (right->angle + left->angle), slack, mid);
    w->passes_left -= mid->n;
    if (rc == DMK_OK) rc = bisect(w, right, mid, depth + 1);
    if (rc == DMK_OK) rc = add_ray(w->out, mid); /* after those to the right: in order */
    if (rc == DMK_OK) rc = bisect(w, mid, left, depth + 1);
    return rc;
}

/* The right side of wedge i. Around a closed chart the wedges are turned a little, because edges at
 * the source lie at angle 0 and vertices on a side are met only up to rounding. */
static double wedge_side(const dmk_chart *c, int i)
{
    return (i + (c->closed ? 0.381966 : 0)) * c->total / n_wedges;
}

static void *work(void *data)
{
    worker *w = data;
    crew *c = w->crew;
    for (int i; (i = atomic_fetch_add(&c->next, 1)) < n_wedges && atomic_load(&c->status) == 0;) {
        w->out = &c->wedge[i];
        w->n_left = (int32_t)((c->rays->smooth ? most_rays_rough : most_rays) *
                              sqrt(c->rays->mesh->n_triangles));
        w->passes_left = most_passes(c->rays->mesh->n_triangles);
        double right = wedge_side(&c->rays->chart, i), left = wedge_side(&c->rays->chart, i + 1);
        int rc = dmk_ray_shoot(c->rays, right, slack, &w->ray[0]);
        if (rc == DMK_OK) rc = dmk_ray_shoot(c->rays, left, slack, &w->ray[1]);
        if (rc == DMK_OK) rc = add_ray(w->out, &w->ray[0]);
        if (rc == DMK_OK) rc = bisect(w, &w->ray[0], &w->ray[1], 0);
        if (rc != DMK_OK) atomic_store(&c->status, rc);
    }
    return NULL;
}

static int count_threads(void)
{
    cpu_set_t set;
    int n = sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
    return n < 1 ? 1 : n > 16 ? 16 : n;
}

static int run_crew(dmk_context *ctx, crew *c)
{
    int rc, n = count_threads(), started = 0;
    worker *w = NULL;
    pthread_t *thread = NULL;
    DMK_TRY(DMK_NEW(ctx, w, (size_t)n));
    DMK_TRY(DMK_NEW(ctx, thread, (size_t)n));
    for (int i = 0; i < n; i++) {
        w[i].crew = c;
        size_t n_vertices = (size_t)c->rays->mesh->n_vertices;
        DMK_TRY(DMK_NEW(ctx, w[i].mark, n_vertices));
        DMK_TRY(DMK_NEW(ctx, w[i].placed, 2 * n_vertices));
        for (size_t v = 0; v < n_vertices; v++)
            w[i].placed[2 * v + 1] = -1;
    }
    w[n - 1].ctx = ctx;
    while (started < n - 1 && pthread_create(&thread[started], NULL, work, &w[started]) == 0) {
        started++;
    }
    work(&w[n - 1]);
    for (int i = 0; i < started; i++)
        pthread_join(thread[i], NULL);
    rc = atomic_load(&c->status);
    if (rc == DMK_E_NOMEM) rc = dmk_fail(ctx, rc, "out of memory for the rays of the cut locus");
done:
    for (int i = 0; w && i < n; i++) {
        free(w[i].mark);
        free(w[i].placed);
        for (int k = 0; k < max_depth + 2; k++)
            free(w[i].ray[k].pass);
    }
    free(w);
    free(thread);
    return rc;
}

/* The rays of all wedges, from angle 0 on. */
static int join_profiles(dmk_context *ctx, const crew *c, dmk_profile *p)
{
    int rc;
    double whole = c->rays->chart.total;
    int32_t n = 0, at = 0, over = 0;
    for (int i = 0; i < n_wedges; i++)
        n += c->wedge[i].n_rays;
    p->n = n;
    DMK_TRY(DMK_NEW(ctx, p->ray, (size_t)n));
    /* The last wedge of a closed chart reaches beyond the whole turn. */
    const wedge_hits *last = &c->wedge[n_wedges - 1];
    while (over < last->n_rays && last->ray[last->n_rays - 1 - over].angle >= whole)
        over++;
    for (int32_t i = last->n_rays - over; i < last->n_rays; i++) {
        p->ray[at] = last->ray[i];
        p->ray[at++].angle -= whole;
    }
    for (int k = 0; k < n_wedges; k++) {
        for (int32_t i = 0; i < c->wedge[k].n_rays && at < n; i++)
            p->ray[at++] = c->wedge[k].ray[i];
    }
    /* The curvature of a mesh that was rough tells nothing of cusps. */
    if (!c->rays->smooth) rc = dmk_profile_find_cusps(ctx, c->rays->mean, p);
done:
    return rc;
}

int dmk_fan_shoot(dmk_context *ctx, const dmk_rays *rays, dmk_profile *profile, dmk_hit **hit,
                  size_t *n_hits)
{
    int rc;
    crew *c = NULL;
    size_t n = 0;
    DMK_TRY(DMK_NEW(ctx, c, 1));
    c->rays = rays;
    DMK_TRY(run_crew(ctx, c));
    DMK_TRY(join_profiles(ctx, c, profile));
    for (int i = 0; i < n_wedges; i++)
        n += c->wedge[i].n;
    DMK_TRY(DMK_NEW(ctx, *hit, n));
    *n_hits = n;
    n = 0;
    for (int i = 0; i < n_wedges; i++) {
        if (c->wedge[i].n) memcpy(*hit + n, c->wedge[i].hit, c->wedge[i].n * sizeof **hit);
        n += c->wedge[i].n;
    }
done:
    for (int i = 0; c && i < n_wedges; i++) {
        free(c->wedge[i].hit);
        free(c->wedge[i].ray);
    }
    free(c);
    return rc;
}
