/* From the host's mesh and hierarchy to the arrays of a system: what setup.c and the pack_*.c share. */
#ifndef DMK_PACKER_H
#define DMK_PACKER_H

#include "solver/system.h"

/* The packer's state: shorter calls below. */
typedef struct packer {
    dmk_context *ctx;
    dmk_device *dev;
    const dmk_mesh *mesh;
    const dmk_ground *ground; /* with ranks: that mesh, or this one's part of it */
    dmk_system *sys;
    bool spend; /* free the hierarchy's arrays as soon as they are packed */
} packer;

/* count items of `size` bytes, which stay as they are. */
static inline int dmk_pack(const packer *p, size_t count, size_t size, const void *data,
                           dmk_buffer **b)
{
    return dmk_buffer_create(p->ctx, p->dev, count * size, data, b);
}

/* A work array of n numbers, zeroed. */
static inline int dmk_pack_work(const packer *p, dmk_program program, size_t n, dmk_buffer **b)
{
    return dmk_buffer_create_real(p->ctx, p->dev, program, n, b);
}

/* pack_mesh.c: elements and rows of p->mesh. */
int dmk_pack_mesh(const packer *p);

/* pack_levels.c: a graph's rows: neighbours with their edge numbers. Edges from a row to itself are none. */
int dmk_pack_graph(const packer *p, int32_t n, int32_t n_edges, const int32_t *edge_vertex,
                   dmk_level *level);
/* Right-hand side and iterates of a level's V-cycle. */
int dmk_pack_vectors(const packer *p, dmk_level *level);
/* The hierarchy's level i, which is the system's next one, and the transfer to it. */
int dmk_pack_level(const packer *p, dmk_hierarchy *hierarchy, int32_t i);
/* What follows from all levels; with those of the hierarchy before. */
int dmk_pack_coarsest(const packer *p, const dmk_hierarchy *hierarchy);
int dmk_pack_levels(const packer *p, dmk_hierarchy *hierarchy);

#endif
