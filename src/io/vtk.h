/* What the VTK XML formats share: tags with arrays whose values follow at the end of the file as
 * raw appended binary, each array behind its length in bytes (UInt64). */
#ifndef DMK_VTK_H
#define DMK_VTK_H

#include "io/io.h"

#define DMK_VTK_ARRAYS 16

typedef enum dmk_vtk_type {
    DMK_VTK_UINT8,
    DMK_VTK_INT32,
    DMK_VTK_INT64,
    DMK_VTK_FLOAT64
} dmk_vtk_type;

typedef struct dmk_vtk {
    dmk_output *out;
    const char *kind;                 /* "PolyData" or "UnstructuredGrid" */
    const void *data[DMK_VTK_ARRAYS]; /* borrowed until dmk_vtk_end */
    uint64_t bytes[DMK_VTK_ARRAYS];
    int n_arrays;
    uint64_t offset; /* of the next array behind the start of the appended data */
    double source[3];
} dmk_vtk;

/* The first tags of a file: of the kind, and of its data set with these attributes. */
void dmk_vtk_head(dmk_output *out, const char *kind, const char *attributes);
void dmk_vtk_begin(dmk_vtk *vtk, dmk_output *out, const char *kind);
/* Close what dmk_vtk_begin opened and write the arrays' values. */
void dmk_vtk_end(dmk_vtk *vtk);

/* vtp.c: without the source, which may be in another piece. */
int dmk_vtp_write_piece(dmk_context *context, dmk_output *out, const dmk_fields *fields);

/* One array of n tuples. */
void dmk_vtk_array(dmk_vtk *vtk, dmk_vtk_type type, const char *name, int components,
                   const void *data, size_t n);
void dmk_vtk_points(dmk_vtk *vtk, const double *xyz, size_t n);
/* Cells of `corners` corners each; end[i] = corners * (i + 1) are their ends; types may be NULL. */
void dmk_vtk_cells(dmk_vtk *vtk, const char *tag, int corners, const int32_t *corner,
                   const int32_t *end, const uint8_t *types, size_t n_cells);
/* A file's result: the source as field data; point data u and distance; cell data mu (the active
 * scalar) and acl. Nothing for a bare mesh. */
void dmk_vtk_source(dmk_vtk *vtk, const dmk_fields *fields);
void dmk_vtk_result(dmk_vtk *vtk, const dmk_fields *fields);

/* The ends of n cells of equally many corners; freed by the caller. */
int dmk_vtk_ends(dmk_context *context, size_t n_cells, int corners, int32_t **end);

#endif
