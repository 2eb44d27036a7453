/* Values of arrays in VTK's XML files: text, base64 or raw bytes, plain or packed by zlib, inline
 * or behind all tags as "appended data". */
#ifndef DMK_VTK_ARRAY_H
#define DMK_VTK_ARRAY_H

#include "io/values.h"

/* What the tags say that holds for all arrays. */
typedef struct dmk_vtk_coding {
    bool swap;            /* bytes stand the other way round than here */
    dmk_type header_type; /* of the sizes before the data: DMK_UINT32 or DMK_UINT64 */
    bool packed;          /* in blocks, by zlib */
    bool appended_base64; /* else raw */
    const char *appended; /* in the file: behind the underscore; NULL if there is none */
} dmk_vtk_coding;

typedef enum dmk_vtk_storage { DMK_VTK_TEXT, DMK_VTK_BASE64, DMK_VTK_APPENDED } dmk_vtk_storage;

typedef struct dmk_vtk_values {
    bool there; /* false: no such array */
    dmk_type type;
    dmk_vtk_storage storage;
    const char *at, *end; /* in the file: between the tags */
    uint64_t offset;      /* behind `appended` */
} dmk_vtk_values;

/* Read n values, exactly; `what` names them in errors. The arrays are made when it is known that
 * the file can hold so many, and are the caller's to free. */
int dmk_vtk_read_numbers(dmk_context *context, const dmk_file *file, const dmk_vtk_coding *coding,
                         const dmk_vtk_values *values, const char *what, size_t n, double **number);
int dmk_vtk_read_integers(dmk_context *context, const dmk_file *file, const dmk_vtk_coding *coding,
                          const dmk_vtk_values *values, const char *what, size_t n,
                          int64_t **integer);

#endif
