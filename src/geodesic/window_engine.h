/* What window.c, lanes.c, shares.c and step.c share. Internal to src/geodesic. */
#ifndef DMK_GEODESIC_WINDOW_ENGINE_H
#define DMK_GEODESIC_WINDOW_ENGINE_H

#include "base/heap.h"
#include "geodesic/front.h"

#include <math.h>
#include <stdatomic.h>

/* An interval of a half-edge, all of whose points see the root straight, unfolded at (x, y), y < 0: the last
 * pseudo-source, or the source. From an edge that is a source rays are parallel: then (x, y) is the unit vector back
 * along them, and `base` the length of the way at the half-edge's start, beside the rays or among them. */
typedef struct window {
    double lo, hi, x, y;
    double base;   /* length of the path up to the root */
    double turn;   /* direction of the frame's x axis at a source that is the root */
    double length; /* of the half-edge */
    int32_t half;
    int32_t root; /* the pseudo-source, or ~number of the source */
    bool odd;     /* its next step is known not to be plain */
    bool parallel;
} window;

/* The path that gave a vertex its distance. */
typedef struct trace {
    double at;    /* where it crosses the half-edge */
    double x, y;  /* from the root to the vertex, in its frame; else directions at source, vertex */
    double turn;  /* of the window */
    int32_t half; /* entered last; one of the two below */
    int32_t root; /* of the window */
} trace;
/* One of two shortest paths to a vertex, if d is its distance in the end. */
typedef struct tied {
    double d;
    int32_t vertex;
    trace trace;
} tied;
/* Only bounded so far; by no window: inside the source's triangle, or along an edge from the root. */
enum { UNREACHED = -2, STRAIGHT = -1 };

/* What the rule of one split asks of a vertex, kept apart for the cache. `turn` is odd while it is written. */
typedef struct split {
    double at;
    int32_t half;
    uint32_t turn;
} split;

/* Over the length of the edge: where rays pass the corner above nearer than this, a path around their end may be no
 * longer (reach_around of step.c), and their step is not plain (lanes.c). The root of DMK_SAME_LENGTH: with less,
 * vertices behind one of next to 2 pi are lost (test_geodesic.c), with more some steps are slower. */
#define DMK_BESIDE 1e-6

/* Where the corner above a half-edge a-b lies: at a + z (b - a), z = p + iq a complex number. `along` is p, or 1 - p
 * where that is less than a half, which the lowest bit tells: the other one follows, and the one that may be small is
 * exact. */
typedef struct corner {
    double along, q;
} corner;

/* All that two plain steps ask of the mesh, a cache line: the corner above a half-edge, those above the half-edges on
 * the triangle's left and right side, and where the rays are then. */
typedef struct stride {
    corner here, beyond_left, beyond_right;
    /* the half-edges on the other sides: lower half the left one, upper half the right; beyond the left, the right side
     */
    int64_t next_left, next_right;
} stride;

struct engine;
struct lanes;

/* The loop of lanes.c, which has one form for each width of the processor's vectors. */
typedef int advance(const struct engine *e, struct lanes *lanes, int most);
enum { DMK_FORMS = 3 };

typedef struct engine {
    dmk_front front;
    trace *trace;
    split *split;
    void *room; /* of `stride` */
    stride *stride;
    advance *advance;        /* the fastest that the processor has */
    dmk_heap pseudo_sources; /* reached, to radiate */
    bool shared;             /* by several threads at the moment */
    int n_threads;
    int64_t limit;          /* of windows */
    _Atomic int64_t n_made; /* windows, in whole pieces of each worker */
} engine;

/* Windows that wait for a thread. What is no atomic is the lock's. */
typedef struct shares {
    window *window;
    _Atomic size_t n;
    size_t room;
    int n_begun;           /* threads, so far */
    _Atomic int n_working; /* threads that have windows */
    _Atomic int n_waiting; /* and that have none */
    _Atomic bool locked, stopped;
} shares;

/* Steps that are not plain are mostly waits for memory: so many windows wait for theirs at a time. Speed only. */
enum { LATE = 8 };

/* A thread's own, in cache lines that no other thread's share: it is written at each step. */
typedef struct worker {
    dmk_context *ctx;
    engine *e;
    window *stack;
    size_t n_stack, capacity;
    shares *shares;    /* with other threads, or NULL */
    window late[LATE]; /* windows that wait for what their next step reads, in a ring */
    uint32_t n_late, oldest;
    dmk_heap_item *reached; /* pseudo-sources */
    size_t n_reached, reached_room;
    tied *tied;
    size_t n_tied, tied_room;
    int64_t n_made;
    int64_t n_run, n_dropped; /* lanes.c: steps and dropped windows since `period` was set */
    int period;               /* of the filter; 0: not known */
    char apart[128];
} worker;

static inline bool dmk_windows_spent(const engine *e)
{
    return e->n_made > e->limit;
}

/* The distance of v as other threads have left it. */
static inline double dmk_windows_known(const engine *e, int32_t v)
{
    double d;
    __atomic_load(e->front.d + v, &d, __ATOMIC_ACQUIRE);
    return d;
}

/* step.c: a way of length d to vertex v, kept if it is the shortest, or as long. */
int dmk_windows_reach(worker *me, int32_t v, double d, trace t);
/* Of equally short ways one, whichever comes first. */
bool dmk_windows_first(const trace *a, const trace *b);
/* Children of w into o[0..1]; the vertex above is reached. *n: how many. */
int dmk_windows_step(worker *me, const window *w, window *o, int *n);
int dmk_windows_push(worker *me, const window *w);
/* Windows, between looks at whether there are too many: speed only. */
enum { DMK_PIECE = 65536 };
/* n windows more, fewer than a piece; DMK_E_CANCELLED if the caller wants no more. */
int dmk_windows_count(worker *me, int64_t n);

/* lanes.c: what the engine needs for it, and its memory back. */
int dmk_lanes_create(dmk_context *context, engine *e);
void dmk_lanes_free(engine *e);
/* Run down the windows on the stack and shared ones, `most` steps; the rest is on the stack then. */
int dmk_lanes_run(worker *me, int64_t most);

/* shares.c. The first windows of one of n_threads threads. */
int dmk_shares_begin(worker *me, int n_threads);
/* For an empty stack: shared windows, if there are any now. */
int dmk_shares_take(worker *me);
/* Half of the stack, if others wait. */
int dmk_shares_give(worker *me);
/* The thread has no window: shared ones, as soon as there are some. *more: false if there will not be any. */
int dmk_shares_wait(worker *me, bool *more);
/* Whoever waits is to end. */
void dmk_shares_stop(shares *s);

#endif
