#include "io/cells.h"

#include <stdlib.h>

dmk_cell dmk_cell_of_vtk(int64_t type)
{
    static const uint8_t cells[] = {
        [0] = DMK_CELL_THIN,       [1] = DMK_CELL_THIN,    [2] = DMK_CELL_THIN,
        [3] = DMK_CELL_THIN,       [4] = DMK_CELL_THIN,    [5] = DMK_CELL_POLYGON,
        [6] = DMK_CELL_STRIP,      [7] = DMK_CELL_POLYGON, [8] = DMK_CELL_PIXEL,
        [9] = DMK_CELL_POLYGON,    [10] = DMK_CELL_VOLUME, [11] = DMK_CELL_VOLUME,
        [12] = DMK_CELL_VOLUME,    [13] = DMK_CELL_VOLUME, [14] = DMK_CELL_VOLUME,
        [15] = DMK_CELL_VOLUME,    [16] = DMK_CELL_VOLUME, [21] = DMK_CELL_THIN,
        [22] = DMK_CELL_TRIANGLE6, [23] = DMK_CELL_CURVED, [24] = DMK_CELL_VOLUME,
        [25] = DMK_CELL_VOLUME,    [26] = DMK_CELL_VOLUME, [27] = DMK_CELL_VOLUME,
        [28] = DMK_CELL_CURVED,    [29] = DMK_CELL_VOLUME, [30] = DMK_CELL_CURVED,
        [31] = DMK_CELL_VOLUME,    [32] = DMK_CELL_VOLUME, [33] = DMK_CELL_VOLUME,
        [34] = DMK_CELL_CURVED,    [35] = DMK_CELL_THIN,   [36] = DMK_CELL_CURVED,
        [37] = DMK_CELL_VOLUME,    [42] = DMK_CELL_VOLUME, [68] = DMK_CELL_THIN,
        [69] = DMK_CELL_CURVED,    [70] = DMK_CELL_CURVED, [71] = DMK_CELL_VOLUME,
        [72] = DMK_CELL_VOLUME,    [73] = DMK_CELL_VOLUME, [74] = DMK_CELL_VOLUME,
        [75] = DMK_CELL_THIN,      [76] = DMK_CELL_CURVED, [77] = DMK_CELL_CURVED,
        [78] = DMK_CELL_VOLUME,    [79] = DMK_CELL_VOLUME, [80] = DMK_CELL_VOLUME,
        [81] = DMK_CELL_VOLUME};
    return type >= 0 && type < (int64_t)sizeof cells ? (dmk_cell)cells[type] : DMK_CELL_UNKNOWN;
}

int dmk_corners_resize(dmk_context *ctx, dmk_corners *corners, size_t n)
{
    corners->n = n;
    return DMK_GROW(ctx, corners->vertex, n, corners->room);
}

const char *dmk_cell_refusal(dmk_cell cell, size_t n)
{
    const size_t least = cell == DMK_CELL_TRIANGLE6 ? 6 : cell == DMK_CELL_PIXEL ? 4 : 3;
    switch (cell) {
    case DMK_CELL_UNKNOWN: return "a cell of unknown type; export triangles";
    case DMK_CELL_CURVED: return "a curved face of high order; export first-order triangles";
    case DMK_CELL_THIN:
    case DMK_CELL_VOLUME: return NULL;
    default: return n < least ? "a face with too few corners; remove it" : NULL;
    }
}

static int add_triangle(dmk_context *ctx, dmk_soup *soup, int32_t a, int32_t b, int32_t c)
{
    int32_t fan[2] = {a, b};
    return dmk_soup_corner(ctx, soup, 2, fan, c);
}

static int add_polygon(dmk_context *ctx, dmk_soup *soup, const dmk_corners *c)
{
    int rc = DMK_OK;
    int32_t fan[2] = {0, 0};
    for (size_t k = 0; k < c->n && rc == DMK_OK; k++) {
        rc = dmk_soup_corner(ctx, soup, k, fan, c->vertex[k]);
    }
    return rc;
}

/* Every second triangle of a strip runs the other way round. */
static int add_strip(dmk_context *ctx, dmk_soup *soup, const dmk_corners *c)
{
    int rc = DMK_OK;
    for (size_t k = 0; k + 2 < c->n && rc == DMK_OK; k++) {
        const int32_t *v = c->vertex + k;
        rc = add_triangle(ctx, soup, v[k % 2], v[1 - k % 2], v[2]);
    }
    return rc;
}

static int add_pattern(dmk_context *ctx, dmk_soup *soup, const dmk_corners *c,
                       const uint8_t pattern[][3], size_t n)
{
    int rc = DMK_OK;
    const int32_t *v = c->vertex;
    for (size_t i = 0; i < n && rc == DMK_OK; i++) {
        rc = add_triangle(ctx, soup, v[pattern[i][0]], v[pattern[i][1]], v[pattern[i][2]]);
    }
    return rc;
}

int dmk_cell_add(dmk_context *ctx, dmk_soup *soup, dmk_cell cell, const dmk_corners *c,
                 dmk_cells *cells)
{
    static const uint8_t pixel[2][3] = {{0, 1, 3}, {0, 3, 2}};
    static const uint8_t six[4][3] = {{0, 3, 5}, {3, 1, 4}, {5, 4, 2}, {3, 4, 5}};
    switch (cell) {
    case DMK_CELL_POLYGON: return add_polygon(ctx, soup, c);
    case DMK_CELL_STRIP: return add_strip(ctx, soup, c);
    case DMK_CELL_PIXEL: return add_pattern(ctx, soup, c, pixel, 2);
    case DMK_CELL_TRIANGLE6: return add_pattern(ctx, soup, c, six, 4);
    case DMK_CELL_VOLUME: cells->n_volume++; return DMK_OK;
    default: cells->n_thin++; return DMK_OK;
    }
}

int dmk_cells_end(dmk_context *ctx, const char *path, const dmk_soup *soup, const dmk_cells *cells)
{
    if (soup->n_triangles > 0) return DMK_OK;
    if (cells->n_volume > 0) {
        return dmk_fail(ctx, DMK_E_FORMAT,
                        "%s: %zu volume cells (tetrahedra or the like) and no face; extract the "
                        "surface first",
                        path, cells->n_volume);
    }
    return dmk_fail(ctx, DMK_E_FORMAT,
                    "%s: contains no faces, only %zu points and lines; export the "
                    "triangles",
                    path, cells->n_thin);
}
