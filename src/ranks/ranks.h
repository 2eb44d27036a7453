/* One mesh on many ranks: what a rank has of it, and how it gets the rest; see README.md beside.
 *
 * A rank owns a run of the whole mesh's elements, edges and vertices (all numbered along the Morton
 * curve), and of the vertices and edges of the coarser levels. Beside them it holds ghosts: what
 * others own and its kernels read. Local numbers increase with whole ones; own elements, edges and
 * vertices begin at a multiple of a launch's part, with gaps before and behind. So every row has
 * its terms in the order of the whole mesh, every part of a sum holds the same items as without
 * ranks, and the bits of a solve do not depend on the number of ranks.
 *
 * All functions take a share that is NULL, the whole mesh on one rank, and then do nothing. Those
 * that send are collective: every rank calls them in the same order. */
#ifndef DMK_RANKS_H
#define DMK_RANKS_H

#include "device/device.h"
#include "levels/coarsen.h"
#include "mesh/mesh.h"

/* Items of one kind in the order of the whole mesh: whole numbers have 64 bits, local slots 32. */
typedef struct dmk_space {
    int64_t n_whole;            /* of all ranks */
    int64_t first, end;         /* the own ones */
    int32_t n;                  /* local slots, gaps among them */
    int32_t at_first;           /* slot of `first` */
    int32_t after;              /* slot of the first ghost from `end` on */
    int32_t n_ghosts, n_before; /* all, and those before `first`, whose slots are 0, 1 ... */
    int64_t *ghost;             /* n_ghosts: their whole numbers, increasing */
    int64_t *bound;             /* ranks + 1: rank r owns bound[r] .. bound[r + 1] - 1 */
} dmk_space;

/* Who sends what to whom for one kind of vectors. */
typedef struct dmk_halo {
    int32_t n_send, n_receive;
    int32_t *send_count, *receive_count; /* by rank */
    dmk_buffer *send, *receive;          /* slots on the device, by rank */
    int32_t *send_slot, *receive_slot;   /* of the rows: the same on the host; else NULL */
} dmk_halo;

/* The parts of a launch that reads ghosts: those that need them, and those that do not, which go ahead while the
 * ghosts are on their way. Nothing goes ahead where n_interior is 0. */
typedef struct dmk_split {
    dmk_buffer *interior, *boundary;
    size_t n_interior, n_boundary;
} dmk_split;

enum { DMK_SHARE_LEVELS = DMK_MAX_LEVELS + 1 };

typedef struct dmk_share {
    dmk_ranks ranks;
    dmk_device *device;
    dmk_kernel *pack[DMK_N_PROGRAMS], *unpack[DMK_N_PROGRAMS];
    int32_t part;        /* items of a launch's part */
    int32_t first_whole; /* levels from this one on are on all ranks */
    dmk_space element, edge;
    dmk_space vertex[DMK_SHARE_LEVELS],
        level_edge[DMK_SHARE_LEVELS]; /* by level, 0 = T; level_edge[0] is `edge` */
    int32_t vertex_row;               /* of the local rows */
    dmk_mesh mesh;                    /* what is packed */
    dmk_halo rows, vertices[DMK_SHARE_LEVELS], level_edges[DMK_SHARE_LEVELS];
    struct dmk_needs *needs; /* what the halos bring, until they are made */
    /* Of launches over T, and over a dealt level's vertices. */
    dmk_split elements, graph[DMK_SHARE_LEVELS];
    dmk_buffer *staging;
    char *host; /* four times as long: see halo.c */
    size_t staging_bytes;
    dmk_traffic traffic;
} dmk_share;

/* What a rank packs in place of the whole hierarchy; arrays of its own, but for levels that are whole.
 */
typedef struct dmk_local {
    dmk_hierarchy hierarchy;
    int32_t first_whole;
} dmk_local;

/* T as a rank has it: a mesh of its own elements and those at its own edges and vertices, in the order of the whole;
 * or the whole mesh. */
typedef struct dmk_ground {
    const dmk_mesh *mesh;
    double area;                            /* of the whole */
    const int64_t *element, *edge, *vertex; /* the items' whole numbers; NULL: the mesh is whole */
    const int64_t *bound[3]; /* of elements, edges, vertices; NULL with a whole mesh */
} dmk_ground;

static inline int64_t dmk_whole_number(const int64_t *number, int32_t i)
{
    return number ? number[i] : i;
}

/* From one level to the next: what a dmk_coarsening has, of own items alone, in whole numbers. */
typedef struct dmk_part {
    int64_t *prolong_index; /* 3 for each own fine vertex */
    float *prolong_weight;
    int32_t *restrict_row; /* by own coarse vertex */
    int64_t *restrict_fine;
    float *restrict_weight;
    int64_t *edge; /* 2 for each own coarse edge, whose smaller end is an own coarse vertex */
    int32_t *galerkin_row; /* by own coarse edge */
    int64_t *galerkin_edge;
    float *galerkin_coef;
    int32_t n_others;
    int64_t
        *other; /* 3 for each coarse edge of other ranks at own coarse vertices: number and ends */
} dmk_part;

/* The levels down to share->first_whole in parts, the ones from there on whole. */
typedef struct dmk_parts {
    dmk_part part[DMK_MAX_LEVELS];
    dmk_hierarchy whole; /* of level[first_whole - 1] at least the graph */
} dmk_parts;

void dmk_parts_free(dmk_parts *parts);

/* A share of an ordered mesh comes into being in steps. All ranks together, if no one has other work:
 *     begin, coarsen, deal, connect, fill, levels, forget;
 * or, where the first one comes later, the last one makes the hierarchy and its own share before the others:
 *     last rank: begin, (dmk_hierarchy_create of parts->whole), bound, cut, deal, fill, levels, hand, connect, forget
 *     others:    begin, hand, deal, fill, levels, connect, forget. */

/* Own ranges of rank `ranks->rank`. *share stays NULL where the mesh has no more parts than ranks: then every rank does
 * all of it, and so without levels, parts->whole.n = 0. */
int dmk_share_begin(dmk_context *context, const dmk_ranks *ranks, dmk_device *device,
                    const dmk_ground *ground, dmk_share **share);
/* Where rank r's own elements begin, of n; and its own edges or vertices, n in all, of which earlier ranks' elements
 * have `touched`, all of them with r = size, the `last`. */
int64_t dmk_bound_elements(int32_t part, int64_t n, int r, int size);
int64_t dmk_bound_touched(int32_t part, int64_t touched, int64_t n, bool last);
/* coarsen.c: the levels, of which each rank makes its part. Collective. */
int dmk_share_coarsen(dmk_context *context, dmk_share *share, const dmk_ground *ground,
                      int32_t coarsest, dmk_parts *parts);
/* levels.c: own ranges of all levels of a hierarchy that is whole here; and the own part of those that are dealt
 * out. */
int dmk_share_bound(dmk_context *context, dmk_share *share, const dmk_hierarchy *hierarchy);
int dmk_share_cut(dmk_context *context, const dmk_share *share, dmk_parts *parts);
/* hand.c: the parts of the last rank's hierarchy, which is whole in its `parts`, to all. Collective. */
int dmk_share_hand(dmk_context *context, dmk_share *share, dmk_parts *parts);
/* Ghosts and local slots. */
int dmk_share_deal(dmk_context *context, dmk_share *share, const dmk_ground *ground,
                   const dmk_parts *parts);
/* Who sends what to whom. Collective. */
int dmk_share_connect(dmk_context *context, dmk_share *share);
/* share->mesh. */
int dmk_share_fill(dmk_context *context, dmk_share *share, const dmk_ground *ground);
/* Before: that the ranks' devices are of one kind. */
int dmk_share_check_devices(dmk_context *context, const dmk_ranks *ranks, const dmk_device *device);
/* levels.c: the local hierarchy, without the mesh; the parts are used up. */
int dmk_share_levels(dmk_context *context, dmk_share *share, dmk_parts *parts, dmk_local *local);
/* Numbers on the coarser levels are not asked for any more, but how many vertices there are (multigrid.c). */
void dmk_share_forget(dmk_share *share);
void dmk_share_destroy(dmk_share **share);
void dmk_local_free(dmk_local *local);

/* ---- halo.c: bring the ghosts of vectors up to date, own values are only read ---- */

enum { DMK_PARCELS = 2 }; /* vectors that one message brings at most */

/* One or two vectors, whose ghosts come in one message from each rank; without a vector nothing does. */
typedef struct dmk_shipment {
    dmk_share *share;
    dmk_program program; /* of their precision */
    int n;
    const dmk_halo *halo[DMK_PARCELS];
    const dmk_buffer *x[DMK_PARCELS];
} dmk_shipment;

/* Vectors over the rows of T/2. */
dmk_shipment dmk_ship_rows(dmk_share *share, dmk_program program, const dmk_buffer *x);
dmk_shipment dmk_ship_two_rows(dmk_share *share, dmk_program program, const dmk_buffer *x,
                               const dmk_buffer *y);
/* x over the rows, and one over the vertices of level 0. */
dmk_shipment dmk_ship_up(dmk_share *share, const dmk_buffer *x, const dmk_buffer *coarse);
/* Over a level's vertices or edges, in single precision; levels that are whole need none ... */
dmk_shipment dmk_ship_vertices(dmk_share *share, int32_t level, const dmk_buffer *x);
dmk_shipment dmk_ship_edge_weights(dmk_share *share, int32_t level, const dmk_buffer *edge);
/* ... but for what own parts of the first whole one were computed of: all ranks get all of it. */
dmk_shipment dmk_ship_all(dmk_share *share, int32_t level, const dmk_buffer *x);

int dmk_send(dmk_context *context, dmk_shipment shipment);
/* In two halves: what is queued in between goes on meanwhile, and must not touch the ghosts. Its launch is over the
 * interior parts of the split, and where that has any `went_ahead` tells so. */
int dmk_send_begin(dmk_context *context, dmk_shipment shipment);
int dmk_send_end(dmk_context *context, dmk_shipment shipment, bool went_ahead);
/* The rows of a local host vector. */
int dmk_share_ghosts(dmk_context *context, dmk_share *share, double *rows);

/* ---- sums.c ---- */

/* What a launch goes over: the elements, the rows of T/2, or T's vertices. */
typedef enum dmk_items { DMK_ELEMENTS, DMK_ROWS, DMK_VERTICES } dmk_items;

/* The partial sums that a launch over all of these left, `count` quantities one after the other, the last `maxima`
 * of them maxima: those of all ranks in the order of the whole mesh take their place, many of them as sums of blocks
 * (DMK_SUM_SHORT). *parts: their number, which without a share stays as it is. */
int dmk_share_parts(dmk_context *context, dmk_share *share, dmk_items items, int count, int maxima,
                    dmk_buffer *partial, int32_t *parts);
/* Room that dmk_share_parts takes for each quantity. */
size_t dmk_share_most_parts(const dmk_share *share);
/* Each of n values becomes the largest of all ranks. */
int dmk_share_largest(dmk_context *context, dmk_share *share, size_t n, int32_t *value);
/* The same of the number i of a buffer of integers. */
int dmk_share_flag(dmk_context *context, dmk_share *share, dmk_buffer *buffer, int32_t i);

/* Whole host vectors (edges, then vertices from `vertex_row` on) to local ones and back. */
void dmk_share_take(const dmk_share *share, bool rows, int32_t vertex_row, const double *whole,
                    double *local);
int dmk_share_give(dmk_context *context, dmk_share *share, bool rows, int32_t vertex_row,
                   const double *local, double *whole);

/* `add` adds to *sum what this rank has; rank after rank does, each to what the one before has left, so that sums
 * are those of one rank, to the bit. All have the sum then. */
int dmk_share_in_turn(dmk_context *context, dmk_share *share, double *sum,
                      void (*add)(void *data, double *sum), void *data);
/* The same before there is a share. */
int dmk_ranks_in_turn(dmk_context *context, const dmk_ranks *ranks, double *sum,
                      void (*add)(void *data, double *sum), void *data);
/* n own items of `item` bytes become those of all ranks, one rank's behind the other's, n_all of them; the
 * caller frees *all. */
int dmk_share_join(dmk_context *context, dmk_share *share, size_t n, size_t item, const void *own,
                   int32_t *n_all, void **all);

/* `bytes` of the first rank's data to all others; nothing for ranks of size 0 or 1. */
int dmk_ranks_spread(dmk_context *context, const dmk_ranks *ranks, void *data, size_t bytes);
/* Rank `from`'s data to all others. */
int dmk_ranks_spread_from(dmk_context *context, const dmk_ranks *ranks, int from, void *data,
                          size_t bytes);

/* ---- within the room ---- */

/* DMK_OK, or the failure of a call of share->ranks that gave `status`. */
int dmk_share_check(dmk_context *context, const dmk_share *share, int status);
/* space.c: local slots for n ghosts, in increasing order, and the own items. part > 1: see above. `spare`: gaps at the
 * end. */
int dmk_space_create(dmk_context *context, size_t n, const int64_t *ghost, int32_t part,
                     int32_t spare, dmk_space *space);
void dmk_space_free(dmk_space *space);
/* How many of n increasing numbers are below x. */
size_t dmk_count_below(const int64_t *number, size_t n, int64_t x);
/* The local slot of a whole number, or -1; and the whole number at a slot, or -1 for a gap. */
int32_t dmk_space_slot(const dmk_space *space, int64_t whole);
int64_t dmk_space_whole(const dmk_space *space, int32_t slot);
static inline bool dmk_space_owns(const dmk_space *s, int64_t whole)
{
    return whole >= s->first && whole < s->end;
}
static inline int32_t dmk_space_own(const dmk_space *s)
{
    return (int32_t)(s->end - s->first);
}

/* What a halo brings: ghosts of a space, to slots from `offset` on. */
typedef struct dmk_need {
    const dmk_space *space;
    size_t n;
    const int64_t *ghost; /* increasing */
    int32_t offset;
} dmk_need;
int dmk_halo_create(dmk_context *context, dmk_share *share, int n, const dmk_need *need,
                    dmk_halo *halo);
/* Its slots on the host, too. */
int dmk_halo_keep(dmk_context *context, const dmk_share *share, dmk_halo *halo);
void dmk_halo_free(dmk_halo *halo);

/* split.c: of T's elements by own rows; of a level's vertices by own neighbours, `edge` the ends of its edges. */
int dmk_split_elements(dmk_context *context, dmk_share *share);
int dmk_split_graph(dmk_context *context, dmk_share *share, int32_t level, int32_t n_edges,
                    const int32_t *edge);
void dmk_split_free(dmk_split *split);

#endif
