/* The tags of VTK's XML files of PolyData and UnstructuredGrid. */
#ifndef DMK_VTK_XML_H
#define DMK_VTK_XML_H

#include "io/vtk_array.h"

/* The arrays of one piece of the data set that are read: of a mesh, and the one that is asked for by name. */
typedef enum dmk_vtk_role {
    DMK_VTK_POINTS,
    DMK_VTK_POLY_CORNERS,
    DMK_VTK_POLY_ENDS,
    DMK_VTK_STRIP_CORNERS,
    DMK_VTK_STRIP_ENDS,
    DMK_VTK_CELL_CORNERS,
    DMK_VTK_CELL_ENDS,
    DMK_VTK_CELL_TYPES,
    DMK_VTK_POINT_DATA,
    DMK_VTK_CELL_DATA,
    DMK_VTK_N_ROLES
} dmk_vtk_role;

typedef struct dmk_vtk_piece {
    int64_t n_points, n_polys, n_strips, n_cells, n_thin; /* as its tag says; 0 if it does not */
    dmk_vtk_values values[DMK_VTK_N_ROLES];
} dmk_vtk_piece;

typedef struct dmk_vtk_tags {
    dmk_vtk_coding coding;
    dmk_vtk_piece *piece; /* n_pieces */
    size_t n_pieces, room;
    const char *wanted; /* name of the array of data, or NULL: none */
    char others[512];   /* where one is wanted: those of one number each, as far as they fit */
} dmk_vtk_tags;

/* Find out where everything stands; only `wanted` may be set before. dmk_vtk_tags_free also after a failure. */
int dmk_vtk_tags_read(dmk_context *context, const dmk_file *file, dmk_vtk_tags *tags);
void dmk_vtk_tags_free(dmk_vtk_tags *tags);

#endif
