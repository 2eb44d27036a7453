/* Cells of files that hold more than surfaces (Gmsh, VTK): faces become triangles, points and lines
 * are passed over, and so are volume cells where there are faces too. */
#ifndef DMK_CELLS_H
#define DMK_CELLS_H

#include "io/io.h"

typedef enum dmk_cell {
    DMK_CELL_UNKNOWN = 0, /* so that gaps in tables are unknown */
    DMK_CELL_THIN,        /* points and lines */
    DMK_CELL_POLYGON,     /* corners in order */
    DMK_CELL_STRIP,       /* each corner from the third on makes a triangle with the two before */
    DMK_CELL_PIXEL,       /* a quadrilateral by rows: corners 0 1 3 2 in order */
    DMK_CELL_TRIANGLE6,   /* corners, then the points on edges 01, 12, 20: four triangles */
    DMK_CELL_CURVED,      /* faces with more points on their edges or inside: refused */
    DMK_CELL_VOLUME
} dmk_cell;

/* What was passed over. */
typedef struct dmk_cells {
    size_t n_thin, n_volume;
} dmk_cells;

/* The cell of VTK's type number. */
dmk_cell dmk_cell_of_vtk(int64_t type);

/* Corners of one cell. The room grows as needed; freed with free(). */
typedef struct dmk_corners {
    int32_t *vertex;
    size_t n, room;
} dmk_corners;
int dmk_corners_resize(dmk_context *context, dmk_corners *corners, size_t n);

/* What stands after "path: " or "path:line: " when the cell is refused; NULL if it is not: for
 * unknown and curved cells and for faces with too few corners. */
const char *dmk_cell_refusal(dmk_cell cell, size_t n_corners);
/* Add the triangles of a cell that is not refused. */
int dmk_cell_add(dmk_context *context, dmk_soup *soup, dmk_cell cell, const dmk_corners *corners,
                 dmk_cells *cells);
/* At the end of the file: fail if it had no triangle, and say what it had. */
int dmk_cells_end(dmk_context *context, const char *path, const dmk_soup *soup,
                  const dmk_cells *cells);

#endif
