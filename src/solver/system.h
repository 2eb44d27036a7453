/* The packed problem on the device: everything the kernels read, made once per mesh; and the work
 * arrays, made once too, so that nothing is allocated inside an iteration.
 *
 * Unknowns (rows) are the values of u on T/2: rows 0 .. n_edges-1 the edge midpoints, rows
 * vertex_row .. vertex_row+n_vertices-1 the vertices, which begin with a launch's part; rows between and
 * behind are padding and stay 0. With a share of the mesh (see ranks/) all that is packed is local, with
 * ghosts and gaps among the rows and elements; `whole` counts the mesh's.
 * Lengths are in units of the square root of the mesh's area, so the area is 1 and f sums to 0. */
#ifndef DMK_SYSTEM_H
#define DMK_SYSTEM_H

#include "device/device.h"
#include "levels/coarsen.h"
#include "mesh/mesh.h"
#include "ranks/ranks.h"
#include "solver/slots.h"

#include "dmk_shared.h"

struct dmk_kernels; /* kernels.h */

/* The inner operator, whose coefficients element_prepare or newton_prepare left in the system. */
typedef enum dmk_operator { DMK_STIFFNESS, DMK_NEWTON_MATRIX } dmk_operator;

/* One graph level of the hierarchy; level 0 of the array is T, or of a system without T, T/2. */
typedef struct dmk_level {
    int32_t n, n_pad, n_edges;
    dmk_buffer *slice, *neighbour, *number; /* rows: neighbours and edges (filler: edge n_edges) */
    dmk_buffer *weight;                     /* edge weights by row, refreshed */
    dmk_buffer *edge;                       /* n_edges (+ spare 0s): edge weights, refreshed */
    dmk_buffer *inv_diag, *rhs, *x, *x_old;
    /* To the finer level: T/2 for the first. */
    dmk_buffer *restrict_slice, *restrict_entry, *restrict_weight; /* graph levels */
    dmk_buffer *prolong_index, *prolong_weight;                    /* 3 per finer row */
    dmk_buffer *galerkin_row, *galerkin_edge, *galerkin_coef;
} dmk_level;

enum { DMK_SYSTEM_LEVELS = DMK_MAX_LEVELS + 1 };

/* A level's arrays, in the order of dmk_shared.h. */
enum { DMK_LEVEL_ARRAYS = DMK_TAIL_FIELDS - DMK_TAIL_SLICE };
void dmk_level_arrays(dmk_level *level, dmk_buffer **array[DMK_LEVEL_ARRAYS]);

/* Rows up to which levels are done in one launch. A launch takes a GPU some 5 microseconds, in which one
 * work-group does a pass over these. */
enum { DMK_TAIL_MOST = 4096 };

typedef struct dmk_system {
    dmk_device *device;
    struct dmk_kernels *kernels;
    dmk_share *share; /* NULL: all is the whole mesh's */
    dmk_counts whole; /* of host vectors over the whole mesh */
    int32_t n_elements, n_elements_pad, n_edges, n_vertices, vertex_row, n_rows, n_rows_pad;
    double sharpest;   /* largest cotangent, of either sign */
    int usual_degree;  /* of the smoother on T/2: 2, or 3 on meshes with many flat triangles */
    int fine_degree;   /* of that of the present solve: the usual one, or 1 (iteration.h, light) */
    int newton_degree; /* the same for Newton's matrix: 1 or 2, as its steps want it (newton.c) */
    double unit;       /* length of one unit of the packed problem, in the mesh's unit */

    /* The mesh: see operator.cl. real = the outer program's type. */
    dmk_buffer *index;        /* 6 per element */
    dmk_buffer *cot, *area;   /* real, 3 and 1 per element */
    dmk_buffer *slice, *slot; /* rows -> slots in 6-per-element arrays */
    dmk_buffer *ends;         /* 2 per row: vertices (on T) whose mean is the row's value */

    /* State, in real: density, potential, right-hand side; energies of the elements. */
    dmk_buffer *mu, *u, *f, *q, *weight_real;
    dmk_buffer *out_real; /* 6 per element: g = K u, then parts of a sum */
    dmk_buffer *before;   /* mu of the step before, of explicit steps */
    /* Single precision: coefficients of the inner operator, contributions, V-cycle on T/2. */
    dmk_buffer *weight, *rank_one, *out; /* out: out_real's memory */
    dmk_buffer *load;               /* real, of T's vertices: see nested.cl; rank_one's memory */
    dmk_buffer *edge, *diag_coarse; /* 3 per element, until CG begins: its p and ap */
    dmk_buffer *inv_diag, *x, *x_old;
    /* Conjugate gradients, inner and outer. */
    struct {
        dmk_buffer *r, *p, *ap, *narrow; /* narrow: r in single precision (= r if it is) */
    } cg[DMK_N_PROGRAMS];
    dmk_buffer *w; /* the inner solution; the outer r where that is wider */
    dmk_buffer *partial, *state, *scalars;
    dmk_buffer *done; /* parts of a launch that have left their sums */

    dmk_level level[DMK_SYSTEM_LEVELS];
    int32_t n_levels;
    bool of_needles; /* levels without T pay */
    /* Without T level 0 is T/2's graph, whose vectors are those of the rows: see fine_graph.h. */
    bool without_T;
    dmk_buffer *weight_wide, *rank_one_real; /* then: coefficients in the outer precision */
    int32_t elements_at;
    dmk_buffer *share_slot;
    /* Levels from this one on are done by one work-group in one launch (n_levels: none): their arrays are parts
     * of tail_arena, laid out by tail_table (dmk_shared.h). */
    int32_t tail;
    dmk_buffer *tail_arena, *tail_table;
    int32_t n_coarse_edges;      /* of the coarsest level, for its inverse */
    int32_t *coarse_edge_vertex; /* 2 per edge */
    dmk_buffer *coarse_inverse;  /* n_pad columns */
    /* n * n numbers to find it in; NULL: the host does, where the device has no double precision or n is too large
     * for one work-group. */
    dmk_buffer *dense;
} dmk_system;

/* What a mesh's system on this device counts. */
dmk_counts dmk_system_counts(const dmk_device *device, const dmk_mesh *mesh);
void dmk_system_destroy(dmk_system **system);
/* mu, u and f, zeroed; and with them all work arrays. Nothing to do for what is there; on failure nothing
 * is. */
int dmk_system_allocate_state(dmk_context *context, dmk_system *system);
int dmk_system_allocate(dmk_context *context, dmk_system *system);
/* The start from nothing, u = 0 and mu = 1, in their arrays, which are made if need be; not collective. */
int dmk_system_start_even(dmk_context *context, dmk_system *system);
void dmk_system_release(dmk_system *system);

/* Vectors over the whole mesh's rows (whole.n_rows_pad numbers, edges at 0, vertices at
 * whole.vertex_row) or elements (whole.n_elements_pad) to the device and back, which with a share is
 * collective. */
int dmk_rows_write(dmk_context *context, dmk_system *system, dmk_buffer *rows, const double *whole);
int dmk_rows_read(dmk_context *context, dmk_system *system, const dmk_buffer *rows, double *whole);
int dmk_elements_write(dmk_context *context, dmk_system *system, dmk_buffer *elements,
                       const double *whole);
/* The same value for all elements that a rank has; not collective. */
int dmk_elements_fill(dmk_context *context, dmk_system *system, dmk_buffer *elements, double value);
int dmk_elements_read(dmk_context *context, dmk_system *system, const dmk_buffer *elements,
                      double *whole);

#endif
