/* The packed problem on the device: everything the kernels read, made once per mesh; and the work
 * arrays, made once too, so that nothing is allocated inside an iteration.
 *
 * Unknowns (rows) are the values of u on T/2: rows 0 .. n_edges-1 the edge midpoints, rows
 * vertex_row .. vertex_row+n_vertices-1 the vertices; rows between and behind are padding and stay 0.
 * Lengths are in units of the square root of the mesh's area, so the area is 1 and f sums to 0. */
#ifndef DMK_SYSTEM_H
#define DMK_SYSTEM_H

#include "device/device.h"
#include "levels/coarsen.h"
#include "mesh/mesh.h"

/* X(name, program): the kernels in use. */
#define DMK_KERNEL_LIST(X)                                                                         \
    X(element_stiffness, DMK_INNER)                                                                \
    X(element_newton, DMK_INNER)                                                                   \
    X(rows_apply, DMK_INNER)                                                                       \
    X(rows_residual, DMK_INNER)                                                                    \
    X(rows_chebyshev, DMK_INNER)                                                                   \
    X(cg_dots, DMK_INNER)                                                                        \
    X(cg_beta, DMK_INNER)                                                                          \
    X(cg_direction, DMK_INNER)                                                                     \
    X(cg_alpha, DMK_INNER)                                                                         \
    X(cg_step, DMK_INNER)                                                                          \
    X(smooth_first, DMK_INNER)                                                                     \
    X(graph_residual, DMK_INNER)                                                                   \
    X(graph_chebyshev, DMK_INNER)                                                                  \
    X(restrict_midpoints, DMK_INNER)                                                               \
    X(restrict_rows, DMK_INNER)                                                                    \
    X(prolong_midpoints, DMK_INNER)                                                                \
    X(prolong_rows, DMK_INNER)                                                                     \
    X(coarse_solve, DMK_INNER)                                                                     \
    X(links_from_triangles, DMK_INNER)                                                             \
    X(links_from_links, DMK_INNER)                                                                 \
    X(graph_weights, DMK_INNER)                                                                    \
    X(inverse_diagonal, DMK_INNER)                                                                 \
    X(element_stiffness, DMK_OUTER)                                                                \
    X(rows_apply, DMK_OUTER)                                                                       \
    X(dot_real, DMK_OUTER)                                                                         \
    X(cg_dots, DMK_OUTER)                                                                        \
    X(cg_beta, DMK_OUTER)                                                                          \
    X(cg_direction, DMK_OUTER)                                                                     \
    X(cg_alpha, DMK_OUTER)                                                                         \
    X(cg_step, DMK_OUTER)                                                                          \
    X(rows_range, DMK_OUTER)                                                                       \
    X(sum_partials, DMK_OUTER)                                                                     \
    X(scale_add, DMK_OUTER)                                                                        \
    X(element_energy, DMK_OUTER)                                                                   \
    X(element_measure, DMK_OUTER)                                                                  \
    X(element_prepare, DMK_OUTER)                                                                  \
    X(element_scale, DMK_OUTER)                                                                    \
    X(newton_prepare, DMK_OUTER)                                                                   \
    X(newton_update, DMK_OUTER)                                                                    \
    X(explicit_update, DMK_OUTER)                                                                  \
    X(rows_rhs, DMK_OUTER)                                                                         \
    X(rows_outer_residual, DMK_OUTER)                                                              \
    X(band_slopes, DMK_OUTER)                                                                      \
    X(band_map, DMK_OUTER)

#define DMK_KERNEL_ENUM(name, program) DMK_K_##program##_##name,
enum { DMK_KERNEL_LIST(DMK_KERNEL_ENUM) DMK_N_KERNELS };
#define DMK_KERNEL(sys, program, name) ((sys)->kernel[DMK_K_##program##_##name])
/* The same where the program is a variable: for kernels that both programs have. */
#define DMK_KERNEL_OF(sys, program, name)                                                          \
    ((program) == DMK_INNER ? DMK_KERNEL(sys, DMK_INNER, name) : DMK_KERNEL(sys, DMK_OUTER, name))

/* One graph level of the hierarchy; level 0 of the array is T. */
typedef struct dmk_level {
    int32_t n, n_pad, n_links;
    dmk_buffer *slice, *neighbour, *number; /* rows: neighbours and links (filler: link n_links) */
    dmk_buffer *weight;                     /* link weights by row, refreshed */
    dmk_buffer *link;                       /* n_links (+ spare 0s): link weights, refreshed */
    dmk_buffer *inv_diag, *rhs, *x, *x_old, *residual;
    /* To the finer level: T/2 for the first. */
    dmk_buffer *restrict_slice, *restrict_entry, *restrict_weight; /* graph levels */
    dmk_buffer *prolong_index, *prolong_weight;                    /* 3 per finer row */
    dmk_buffer *galerkin_row, *galerkin_link, *galerkin_coef;
} dmk_level;

enum { DMK_SYSTEM_LEVELS = DMK_MAX_LEVELS + 1 };

typedef struct dmk_system {
    dmk_device *device;
    dmk_kernel *kernel[DMK_N_KERNELS];
    int32_t n_elements, n_elements_pad, n_edges, n_vertices, vertex_row, n_rows, n_rows_pad;
    int fine_degree; /* of the smoother on T/2: 2, or 3 on meshes with many needles */
    double unit; /* length of one unit of the packed problem, in the mesh's unit */

    /* The mesh: see operator.cl. real = the outer program's type. */
    dmk_buffer *index;            /* 6 per element */
    dmk_buffer *cot, *area;       /* real, 3 and 1 per element */
    dmk_buffer *slice, *slot;     /* rows -> places in 6-per-element arrays */
    dmk_buffer *ends;             /* 2 per row: vertices (on T) whose mean is the row's value */
    dmk_buffer *edge_place;       /* 2 per edge: places in 3-per-element arrays */
    dmk_buffer *corner_slice, *corner_slot; /* vertices -> places in 3-per-element arrays */

    /* State, in real: density, potential, load; gradient products and energies of the elements. */
    dmk_buffer *mu, *u, *f, *g, *q, *out_real, *weight_real;
    dmk_buffer *before; /* mu of the step before, or a copy kept by the certificate */
    /* Single precision: coefficients of the inner operator, contributions, V-cycle on T/2. */
    dmk_buffer *weight, *rank_one, *out, *link, *diag_coarse;
    dmk_buffer *inv_diag, *x, *x_old, *residual;
    /* Conjugate gradients, inner and outer. */
    struct {
        dmk_buffer *r, *p, *ap, *narrow; /* narrow: r in single precision (= r if it is) */
    } cg[DMK_N_PROGRAMS];
    dmk_buffer *w; /* the inner solution */
    dmk_buffer *partial, *state, *scalars;

    dmk_level level[DMK_SYSTEM_LEVELS];
    int32_t n_levels;
    int32_t n_coarse_links;      /* of the coarsest level, for its inverse */
    int32_t *coarse_link_vertex; /* 2 per link */
    dmk_buffer *coarse_inverse;  /* n_pad columns */
} dmk_system;

/* Numbers in a vector over the rows of the mesh's system, padding included (n_rows_pad). */
size_t dmk_system_rows(const dmk_mesh *mesh);
/* Pack an ordered, connected mesh with its hierarchy. */
int dmk_system_create(dmk_context *context, dmk_device *device, const dmk_mesh *mesh,
                      dmk_system **system);
void dmk_system_destroy(dmk_system **system);

/* Where element t's k-th of K numbers lies. */
static inline size_t dmk_place(int32_t t, int k, int K)
{
    return (size_t)(t / 8) * 8 * (size_t)K + 8 * (size_t)k + (size_t)(t % 8);
}

#endif
