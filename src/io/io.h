/* Files of meshes, results and cut loci: one file per format, one row per format in format.c. */
#ifndef DMK_IO_H
#define DMK_IO_H

#include "base/base.h"
#include "base/number.h"
#include "base/outfile.h"
#include "mesh/mesh.h"

/* ---- reading ---- */

/* A whole file in memory. data[size] is a NUL, so that scanning may look one character ahead. */
typedef struct dmk_file {
    const char *path;
    char *data;
    size_t size;
} dmk_file;

int dmk_file_load(dmk_context *context, const char *path, dmk_file *file);
void dmk_file_free(dmk_file *file);
/* In a text whose lines end in carriage returns alone make line ends of them. */
void dmk_file_end_lines(dmk_file *file);
/* Whether a file is packed by gzip, and replacing its content by what was packed. */
bool dmk_gzip_sniff(const dmk_file *file);
int dmk_gzip_unpack(dmk_context *context, dmk_file *file);

/* A position in a text. Blanks are space, tab, CR, VT, FF; '#' starts a comment that runs to the end
 * of its line. */
typedef struct dmk_text {
    dmk_context *context;
    const dmk_file *file;
    const char *at, *end;
    dmk_numbers numbers;
} dmk_text;

/* From the beginning of the file, behind a byte order mark: enough to look at words. */
dmk_text dmk_text_of(const dmk_file *file);
/* To read numbers, too. */
int dmk_text_open(dmk_context *context, const dmk_file *file, dmk_text *text);
void dmk_text_close(dmk_text *text);
/* Fail with DMK_E_FORMAT and "path:line: ", the line being that of text->at. */
int dmk_text_fail(const dmk_text *text, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* The same, with the word at text->at in quotes before the text. */
int dmk_text_fail_word(const dmk_text *text, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
/* Skip blanks and comments, staying in the line; true if something is left in it. */
bool dmk_text_more(dmk_text *text);
/* Go to the next thing that is no blank, comment or line end; false at the end of the text. */
bool dmk_text_seek(dmk_text *text);
void dmk_text_skip_line(dmk_text *text);
/* Length of the word at text->at: up to a blank, line end, comment or backslash. */
size_t dmk_text_word(const dmk_text *text);
/* Whether that word is this one; in whatever case; and then go behind it. */
bool dmk_text_is(const dmk_text *text, const char *word);
bool dmk_text_is_in_any_case(const dmk_text *text, const char *word);
bool dmk_text_take(dmk_text *text, const char *word);
/* Whether a word ends at p: a blank, line end, comment or backslash stands there, or nothing. */
bool dmk_text_ends(const dmk_text *text, const char *p);
/* A number that ends with its word, at text->at, and then go behind it; false if there is none. */
bool dmk_text_take_number(dmk_text *text, double *value);
bool dmk_text_take_integer(dmk_text *text, int64_t *value);
/* The same, or fail; `what` names it in the error. */
int dmk_text_number(dmk_text *text, const char *what, double *value);
int dmk_text_integer(dmk_text *text, const char *what, int64_t *value);

/* What a reader hands over: vertices and triangles, checked for nothing yet but the index range. */
typedef struct dmk_soup {
    double *xyz;       /* 3*n_vertices */
    int32_t *triangle; /* 3*n_triangles */
    size_t n_vertices, n_triangles;
    size_t triangle_room; /* triangles that fit */
    struct dmk_fan {
        size_t first, n; /* triangles */
    } * fan;             /* n_fans: faces of more than three corners */
    size_t n_fans, fan_room;
} dmk_soup;

void dmk_soup_free(dmk_soup *soup);
/* Add the next corner of a polygon that began at `first` (its first two corners so far in fan[0],
 * fan[1]): from the third corner on each one closes a triangle with the first corner and the one
 * before it. */
int dmk_soup_corner(dmk_context *context, dmk_soup *soup, size_t corner, int32_t fan[2],
                    int32_t vertex);
/* Split polygons of which these fans would overlap in another way, once all vertices are known. */
int dmk_soup_split(dmk_context *context, dmk_soup *soup);
/* weld.c: vertices at exactly the same position (-0 and 0 are the same) become one; they are numbered as
 * they first appear. */
int dmk_soup_weld(dmk_context *context, dmk_soup *soup);

/* ---- writing ---- */

/* A file being written: under a temporary name beside `path` until dmk_output_close. Failures of the
 * put functions are kept and reported by dmk_output_close. */
typedef struct dmk_output dmk_output;

int dmk_output_open(dmk_context *context, const char *path, dmk_output **out);
const char *dmk_output_path(const dmk_output *out);
/* As if a write had failed with this errno. */
void dmk_output_fail(dmk_output *out, int error);
void dmk_output_put(dmk_output *out, const void *bytes, size_t n);
void dmk_output_text(dmk_output *out, const char *text);
void dmk_output_number(dmk_output *out, double value);
void dmk_output_integer(dmk_output *out, int64_t value);
/* With rc == DMK_OK: flush, sync, rename; else, or if any of that fails, remove the temporary.
 * Gives rc, or the first failure. *out may be NULL. */
int dmk_output_close(dmk_output **out, int rc);
/* What was put so far, onto the disk. */
int dmk_output_sync(dmk_output *out);
/* As dmk_output_close, but the file is not in its place yet: *file, to be committed or discarded, unless a failure has
 * discarded it. */
int dmk_output_detach(dmk_output **out, int rc, dmk_outfile *file);

/* ---- what is written, as plain borrowed arrays ---- */

typedef struct dmk_fields {
    const dmk_mesh *mesh;
    const double *mu;       /* n_triangles, or NULL for the bare mesh: then nothing below either */
    const uint8_t *acl;     /* n_triangles */
    const double *flux;     /* 3 n_triangles; then there is no distance and source: transport */
    const double *u;        /* n_vertices */
    const double *distance; /* n_vertices */
    dmk_point source;
    const double *direction; /* n_vertices; these two and distance without mu: geodesics */
    const int32_t *nearest;  /* n_vertices, or NULL */
    const double *plane;     /* 2*n_vertices: texture coordinates, or NULL */
} dmk_fields;

typedef struct dmk_curves {
    const dmk_locus_vertex *vertex; /* n_vertices */
    const dmk_locus_edge *edge;     /* n_edges */
    const int32_t *index;           /* offset[n_polylines] */
    const int32_t *offset;          /* n_polylines + 1 */
    size_t n_vertices, n_edges, n_polylines;
    bool bare; /* a path: of the vertices only position and distance mean anything */
} dmk_curves;

int dmk_fields_write(dmk_context *context, const dmk_fields *fields, const char *path);
int dmk_curves_write(dmk_context *context, const dmk_curves *curves, const char *path);

/* ---- formats ---- */

/* A column is NULL where the format does not do that. */
typedef struct dmk_format {
    const char *name, *suffixes; /* suffixes in lower case, blank-separated */
    bool (*sniff)(const dmk_file *file);
    int (*read_mesh)(dmk_context *context, const dmk_file *file, dmk_soup *soup);
    int (*write_mesh)(dmk_context *context, dmk_output *out, const dmk_fields *fields);
    int (*write_result)(dmk_context *context, dmk_output *out, const dmk_fields *fields);
    int (*write_locus)(dmk_context *context, dmk_output *out, const dmk_curves *curves);
} dmk_format;

bool dmk_off_sniff(const dmk_file *file);
int dmk_off_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);
int dmk_off_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);

bool dmk_obj_sniff(const dmk_file *file);
int dmk_obj_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);
int dmk_obj_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);
int dmk_obj_write_locus(dmk_context *context, dmk_output *out, const dmk_curves *curves);

bool dmk_ply_sniff(const dmk_file *file);
int dmk_ply_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);
int dmk_ply_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);

bool dmk_stl_is_binary(const dmk_file *file);
bool dmk_stl_sniff(const dmk_file *file);
int dmk_stl_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);

bool dmk_msh_sniff(const dmk_file *file);
int dmk_msh_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);

bool dmk_vtk_legacy_sniff(const dmk_file *file);
int dmk_vtk_legacy_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);

/* VTP and VTU. */
bool dmk_vtk_sniff(const dmk_file *file);
int dmk_vtk_read(dmk_context *context, const dmk_file *file, dmk_soup *soup);
int dmk_vtp_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);
int dmk_vtp_write_locus(dmk_context *context, dmk_output *out, const dmk_curves *curves);
/* Several VTP files and one that names them; nothing reads it. */
int dmk_pvtp_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);
int dmk_vtu_write(dmk_context *context, dmk_output *out, const dmk_fields *fields);

int dmk_csv_write_locus(dmk_context *context, dmk_output *out, const dmk_curves *curves);

#endif
