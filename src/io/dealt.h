/* Files whose records have one size, of which several ranks read a range each. */
#ifndef DMK_DEALT_H
#define DMK_DEALT_H

#include "io/values.h"

/* Numbers of a file: number i stands at byte at + i * stride. */
typedef struct dmk_column {
    uint64_t at;
    size_t stride;
    dmk_type type;
} dmk_column;

/* What must stand in a column for the file to be as its layout says: first + i * step at i < n. */
typedef struct dmk_column_check {
    dmk_column column;
    size_t n;
    int64_t first, step;
} dmk_column_check;

enum { DMK_LAYOUT_CHECKS = 4 };

/* Where vertices and triangles stand in a file. */
typedef struct dmk_layout {
    size_t n_vertices, n_triangles;
    bool swap;
    dmk_column xyz[3], corner[3];
    dmk_column_check check[DMK_LAYOUT_CHECKS];
    int n_checks;
} dmk_layout;

/* From the beginning of a file: whether it has a layout. A binary PLY of triangles; a VTP of one piece, of triangles,
 * with appended raw data. */
bool dmk_ply_layout(dmk_context *context, const dmk_file *head, dmk_layout *layout);
bool dmk_vtk_layout(dmk_context *context, const dmk_file *head, dmk_layout *layout);

/* format.c: a file's triangles, as they are; its size, unpacked, is added to *bytes. */
int dmk_soup_read(dmk_context *context, const char *path, dmk_soup *soup, uint64_t *bytes);
/* Put the file's name in front of what the checks of the mesh said. */
int dmk_name_file(dmk_context *context, const char *path, int rc);
/* The mesh of a file's triangles, which are its own then, on all ranks or (NULL) on one; errors name the file. */
int dmk_soup_adopt(dmk_context *context, const char *path, const dmk_ranks *ranks, dmk_soup *soup,
                   dmk_mesh **mesh);
/* A rank's range of a file's vertices and triangles; who has it frees both arrays. */
typedef struct dmk_dealt {
    size_t n_vertices, n_triangles, all_vertices, all_triangles;
    double *xyz;
    int64_t *triangle;
} dmk_dealt;
/* *all: whether the file has a layout, and all ranks have read theirs; else nothing is kept. */
int dmk_dealt_read(dmk_context *context, const char *path, const dmk_ranks *ranks, dmk_dealt *own,
                   uint64_t *bytes, bool *all);
/* The same on every rank. Each reads its range of a file that has a layout; others are read by the first
 * rank, and sent. *bytes: what this rank has read of it. */
int dmk_soup_read_dealt(dmk_context *context, const char *path, const dmk_ranks *ranks,
                        dmk_soup *soup, uint64_t *bytes);

#endif
