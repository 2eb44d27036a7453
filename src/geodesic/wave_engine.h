/* What wave.c, envelope.c and shard.c share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_WAVE_ENGINE_H
#define DMK_GEODESIC_WAVE_ENGINE_H

#include "geodesic/front.h"

#include "base/crew.h"
#include "base/heap.h"

#include <math.h>

/* What the tolerance allows; lengths over the edge's. */
typedef struct allowance {
    double error; /* of the distance, over the distance */
    double step;  /* jump of the distance where a gap between neighbours is closed */
    double gap;   /* its width */
    double slope; /* change of the slope at a merged window's ends: more leaves gaps behind */
} allowance;

typedef struct wave {
    double lo, hi, o, ux, uy, k, D;
    double direction,
        turn; /* at the source: direction + turn * psi, psi the angle of the front seen from o */
    double error, detour; /* see dmk_wave_improve */
    int32_t half, next;   /* next in the half-edge's list */
    int32_t source, root;
} wave;

typedef struct mark {
    double direction, x, y,
        at;       /* (x, y): the ray at the vertex in the frame of c-a; at: where it crosses */
    int32_t half; /* STRAIGHT: x is the direction back; UNREACHED */
    int32_t source, root;
} mark;
enum { UNREACHED = -2, STRAIGHT = -1 };

/* Visits are mostly waits for memory: what the visits to come will read is fetched in two steps, as where the second
 * part lies is in the first. */
enum { FAR = 8, NEAR = 4 }; /* ahead; speed only */

/* Half-edges of a bucket, in their order, so many together that a chain of them costs few cache misses. */
enum { BLOCK = 30 };
typedef struct block {
    int32_t half[BLOCK], n, next; /* next: of the bucket, or of the free blocks; -1: none */
} block;

typedef struct bucket {
    int32_t first, last; /* blocks, -1: none */
} bucket;

/* What a visit finds: a window of another half-edge, a value of a vertex. */
typedef struct child {
    wave wave;
    double key;
} child;

typedef struct hit {
    mark mark;
    double d, error, detour;
    int32_t vertex;
} hit;

/* What the visits of a shard's half-edges find for one shard. */
typedef struct finds {
    child *child;
    hit *hit;
    size_t n_children, n_hits, child_room, hit_room;
} finds;

/* Half-edges and vertices are dealt out to shards, so many of them whatever the number of threads. Visits read the
 * state as it was when the round began, and what they find is entered when all have ended, shard by shard in the same
 * order: the result does not depend on the threads. Each shard is one thread's at a time, mostly the same one's. There
 * are as many as a crew has members: merging 1.09M triangles, 2 / 4 / 8 take two threads 0.257 / 0.268 / 0.288 s. */
enum { SHARDS = DMK_MOST_CREW };

typedef struct shard {
    dmk_context own;
    int rc;
    wave *pool; /* windows of its half-edges */
    size_t n_pool, pool_room;
    int32_t *free; /* windows of the pool, the next one last */
    size_t n_free, free_room;
    block *block;
    size_t n_blocks, block_room;
    int32_t free_block;
    bucket *bucket;
    size_t n_buckets, bucket_room;
    int32_t *taken; /* half-edges of the bucket */
    size_t n_taken, taken_room;
    wave *list, *merged; /* of the half-edge that is visited */
    size_t list_room, merged_room;
    finds finds[SHARDS];
    dmk_heap_item *reached; /* pseudo-sources */
    size_t n_reached, reached_room;
    int64_t n_made, n_looks;
    int64_t n_over; /* its vertices over the tolerance, those at the front, too */
    bool keeps;     /* a half-edge wants to keep windows */
    char apart[128];
} shard;

typedef struct engine {
    dmk_front front;
    int64_t most_looks, most_over;
    int64_t count_at; /* when so many are over, the next look at which ones */
    allowance allow;
    double *error;    /* n_vertices */
    double *detour;   /* n_vertices: part of the error in the end */
    mark *mark;       /* n_vertices */
    double *radiated; /* n_vertices: at this distance */
    int32_t *head;    /* of each half-edge: its windows, in its shard's pool */
    int32_t *kept;    /* of each half-edge: windows that have run on; NULL while none keeps them */
    uint8_t *visits;  /* of each half-edge, up to `often` */
    shard *shard;     /* SHARDS */
    size_t current;   /* bucket */
    double width, least;
    size_t most_buckets; /* the last one has the rest, far behind other sources' offsets */
    dmk_heap pseudo_sources;
    dmk_crew crew;
    bool enters; /* the round enters what was found; else it visits */
} engine;

/* Triangles that are neighbours in memory are of one shard, so many at a time, and the vertices that belong to as many,
 * which are half their number; each shard has some of every front. Speed only. */
enum { TOGETHER = 512 };

static inline int dmk_waves_shard(int32_t half)
{
    return half / (3 * TOGETHER) % SHARDS;
}

static inline int dmk_waves_shard_of_vertex(int32_t v)
{
    return v / (TOGETHER / 2) % SHARDS;
}

/* What is kept has this in `next` while it is in the list of the half-edge that is visited. */
enum { KEPT = -2 };

/* All values are lengths of ways, up to what merging has changed: the error. A way may be longer than the shortest one
 * of its kind by its detour, where no straight one was seen. Whether this one is the shortest. A longer one that may be
 * too long by more than it is behind may be the shortest in truth, so the larger error counts; of the detours the least
 * one does. */
static inline bool dmk_wave_improve(double *known, double *error, double *detour, double d,
                                    double its_error, double its_detour)
{
    if (!(d < *known)) {
        *error = dmk_max(*error, its_error + *known - d);
        *detour = dmk_min(*detour, its_detour + d - *known);
        return false;
    }
    if (*known < INFINITY) {
        its_error = dmk_max(its_error, *error + d - *known);
        its_detour = dmk_min(its_detour, *detour + *known - d);
    }
    *known = d;
    *error = its_error;
    *detour = its_detour;
    return true;
}

/* envelope.c: when a half-edge of this length, whose ends are reached by `most`, is to be visited for the window. */
double dmk_wave_key(const wave *w, double length, double most);
/* Visit a half-edge of the shard `me`: the lower envelope of its windows, merged, and their steps into the triangle
 * above. The engine's state is read only, but for this half-edge's; what is found is in me->finds. */
int dmk_waves_visit(shard *me, const engine *e, int32_t half);

/* shard.c: a copy of the window at the head of a list of its half-edge. */
int dmk_shard_store(dmk_context *context, shard *s, const wave *w, int32_t *head);
/* The half-edge waits in the bucket of the key, or the current one if that is past. */
int dmk_shard_schedule(dmk_context *context, const engine *e, shard *s, int32_t half, double key);
/* The half-edges of the current bucket, as they are now, into me->taken. */
int dmk_shard_take(const engine *e, shard *me);
void dmk_shard_free(shard *s);

#endif
