/* What wave.c and envelope.c share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_WAVE_H
#define DMK_GEODESIC_WAVE_H

#include "geodesic/front.h"
#include "geodesic/heap.h"

#include "base/crew.h"

#include <math.h>

/* What the tolerance allows; lengths over the edge's. */
typedef struct allowance {
    double error; /* of the distance, over the distance */
    double step;  /* jump of the distance where a gap between neighbours is closed */
    double slope; /* change of the slope at a merged window's ends: more leaves gaps behind */
} allowance;

typedef struct wave {
    double lo, hi, o, ux, uy, k, D;
    double direction,
        turn; /* at the source: direction + turn * psi, psi the angle of the front seen from o */
    double error;
    int32_t half, next; /* next in the half-edge's list */
    int32_t source, root;
} wave;

typedef struct mark {
    double direction, x, y,
        at;       /* (x, y): the ray at the vertex in the frame of c-a; at: where it crosses */
    int32_t half; /* STRAIGHT: x is the direction back; UNREACHED */
    int32_t source, root;
} mark;
enum { UNREACHED = -2, STRAIGHT = -1 };

/* Half-edges of a bucket, in their order, so many together that a chain of them costs few cache misses. */
enum { BLOCK = 30 };
typedef struct block {
    int32_t half[BLOCK], n, next; /* next: of the bucket, or of the free blocks; -1: none */
} block;

typedef struct bucket {
    int32_t first, last; /* blocks, -1: none */
} bucket;

/* What a visit sends to the next half-edges: see `worker`. */
typedef struct child {
    wave wave;
    double key;
} child;

typedef struct hit {
    mark mark;
    double d, error;
    int32_t vertex;
} hit;

/* Half-edges of a bucket are visited in chunks, on all threads. Visits read the state as it was when the round began,
 * and what they find is entered when all have ended, in the order of the half-edges: the result does not depend on the
 * threads. */
enum { CHUNK = 32 }; /* half-edges; speed only: 16 takes the same time */

typedef struct counts {
    size_t spent, child, hit, kept;
} counts;

/* What one thread finds in its chunks of a round. */
typedef struct worker {
    dmk_context own;
    int rc;
    wave *list, *merged; /* of the half-edge that is visited */
    size_t list_room, merged_room;
    int32_t *spent; /* windows of the pool to give back */
    child *child;
    hit *hit;
    wave *kept;
    counts n, room;
    int64_t n_looks;
    bool keeps; /* a half-edge wants to keep windows */
} worker;

/* Where a chunk's finds lie. */
typedef struct finds {
    int member;
    counts from, to;
} finds;

typedef struct engine {
    dmk_front front;
    allowance allow;
    double *error;    /* n_vertices */
    mark *mark;       /* n_vertices */
    double *radiated; /* n_vertices: at this distance */
    int32_t *head;    /* of each half-edge: its windows */
    int32_t *kept;    /* of each half-edge: windows that have run on; NULL while none keeps them */
    uint8_t *visits;  /* of each half-edge, up to `often` */
    wave *pool;
    size_t n_pool, pool_room;
    int32_t *free; /* windows of the pool, the next one last */
    size_t n_free, free_room;
    block *block;
    size_t n_blocks, block_room;
    int32_t free_block;
    bucket *bucket;
    size_t n_buckets, bucket_room, current;
    double width, least;
    size_t most_buckets; /* the last one has the rest, far behind other sources' offsets */
    dmk_heap pseudo_sources;
    int32_t *taken; /* half-edges of the bucket */
    size_t n_taken, taken_room;
    finds *finds; /* of each chunk of them */
    size_t finds_room;
    worker *worker;
    dmk_crew crew;
    int64_t n_made, n_looks;
    double closed; /* angle around the source if it is one point inside: directions are mod that;
                      else 0 */
} engine;

/* What is kept has this in `next` while it is in the list of the half-edge that is visited. */
enum { KEPT = -2 };

/* All values are lengths of paths up to their error, so the best estimate of any of them counts. Whether this one is
 * the shortest. */
static inline bool dmk_wave_improve(double *known, double *error, double d, double its_error,
                                    double excess)
{
    if (!(d < *known)) {
        *error = dmk_min(*error, its_error + excess + d - *known);
        return false;
    }
    if (*known < INFINITY) excess = dmk_min(excess, *error + *known - d);
    *known = d;
    *error = its_error + excess;
    return true;
}

/* envelope.c: when a half-edge of this length, whose ends are reached by `most`, is to be visited for the window. */
double dmk_wave_key(const wave *w, double length, double most);
/* Visit a half-edge: the lower envelope of its windows, merged, and their steps into the triangle above. The engine's
 * state is read only, but for the lists of this half-edge; what is found is the worker's. */
int dmk_waves_visit(worker *me, const engine *e, int32_t half);

#endif
