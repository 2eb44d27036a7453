/* Inside the library: a mesh of which each rank has a piece, from its range of a file to its share of the order. All
 * numbers are whole ones; all calls are collective. */
#ifndef DMK_PIECES_H
#define DMK_PIECES_H

#include "ranks/post.h"

/* A triangle on its way. */
typedef struct dmk_tile {
    uint64_t key;      /* along the Morton curve */
    int64_t number;    /* in the input */
    int64_t vertex[3]; /* of the input */
    int64_t edge[3];   /* the same edges as mesh.c numbers them */
} dmk_tile;

struct dmk_pieces {
    dmk_ranks ranks;
    int64_t n_vertices, n_triangles, n_edges, n_components, n_used, n_border_edges, n_border_loops;
    dmk_measures measures;
    int64_t *vertex_bound, *edge_bound; /* of the input's, which ranks look after in even ranges */
    double *xyz;                        /* of own vertices by these */
    dmk_tile *tile;                     /* own triangles, along the curve */
    size_t n_tiles;
    int64_t *component; /* of each; NULL: there is one */
};

/* From the input's vertices and triangles, evenly dealt out: xyz and triangle become the pieces'. Checks all that
 * dmk_mesh_create checks. */
int dmk_pieces_adopt(dmk_context *context, const dmk_ranks *ranks, int64_t n_vertices, double *xyz,
                     int64_t n_triangles, int64_t *triangle, dmk_pieces **pieces);

/* curve.c: the corners of own tiles, 9 numbers for each. */
int dmk_pieces_corners(dmk_context *context, const dmk_pieces *pieces, double **xyz);
/* Tiles, which have these corners, along the curve in the box of them all, about as many on each rank. */
int dmk_pieces_sort(dmk_context *context, dmk_pieces *pieces, const double *xyz);
/* The first count[0] tiles to rank 0, the next ones to rank 1, and so on. */
int dmk_pieces_ship(dmk_context *context, dmk_pieces *pieces, const int32_t *count);
/* topology.c: edges, with all checks of them and of the vertices' stars; counts; components. */
int dmk_pieces_connect(dmk_context *context, dmk_pieces *pieces);
int dmk_pieces_find_components(dmk_context *context, dmk_pieces *pieces);

/* describe.c: what is measured of tiles that are still as the input has them, with these corners; and the border's
 * loops, of own border edges by their two ends. */
int dmk_pieces_measure(dmk_context *context, dmk_pieces *pieces, const double *xyz);
int dmk_pieces_count_loops(dmk_context *context, dmk_pieces *pieces, size_t n, const int64_t *end);

/* The failure whose key is the least of all ranks'; key INT64_MAX: none here. DMK_OK if there is none. `message` is
 * what the context says. */
int dmk_fail_first(dmk_context *context, const dmk_ranks *ranks, int64_t key);

/* ground.c: of the component of a triangle of the input, in order: elements, edges and vertices as dmk_order_create
 * numbers them, dealt out by parts of a device's launches. */
typedef struct dmk_plot {
    dmk_mesh mesh; /* own elements, and those at own edges and vertices */
    int64_t *element, *edge, *vertex, *bound[3];
    int64_t *element_old, *edge_old, *vertex_old; /* of own ones: the input's numbers */
    double area;                                  /* of the component */
    int64_t own[2];                               /* bound[0] of this rank */
} dmk_plot;

static inline bool dmk_plot_owns(const dmk_plot *plot, int32_t t)
{
    return plot->element[t] >= plot->own[0] && plot->element[t] < plot->own[1];
}

int dmk_plot_create(dmk_context *context, dmk_pieces *pieces, int64_t triangle, int32_t part,
                    dmk_plot *plot);
dmk_ground dmk_plot_ground(const dmk_plot *plot);
/* The areas of all elements, added up in their order. */
int dmk_plot_add_areas(dmk_context *context, const dmk_ranks *ranks, dmk_plot *plot, double *area);
/* All but the bounds and the input's numbers; and all. */
void dmk_plot_free_mesh(dmk_plot *plot);
void dmk_plot_free(dmk_plot *plot);
/* All of it on every rank, as dmk_order_create makes it; the plot is used up. */
int dmk_plot_unite(dmk_context *context, const dmk_ranks *ranks, dmk_plot *plot, dmk_order *order);
/* mollify.c: as dmk_mollify, in place. */
int dmk_plot_mollify(dmk_context *context, const dmk_ranks *ranks, dmk_plot *plot);

#endif
