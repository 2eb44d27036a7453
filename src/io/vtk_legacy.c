/* VTK's legacy format, text and binary (high byte first), versions 1 to 5: the points and cells of
 * PolyData and UnstructuredGrid; faces become triangles (see cells.h). Data on points and cells is
 * passed over. */
#include "io/cells.h"
#include "io/values.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct legacy {
    dmk_values in;
    bool has_offsets; /* since version 5 lists of cells are offsets and corners */
    bool is_grid;     /* UnstructuredGrid */
    dmk_soup *soup;
    int64_t *offset; /* n_cells + 1: where each cell's corners begin; the last is n_corner */
    int32_t *corner; /* n_corner */
    size_t n_cells, n_corner;
    dmk_corners corners;
    dmk_cells cells;
} legacy;

bool dmk_vtk_legacy_sniff(const dmk_file *file)
{
    static const char magic[] = "# vtk DataFile Version ";
    const dmk_text t = dmk_text_of(file);
    return t.end - t.at >= (ptrdiff_t)sizeof magic &&
           strncasecmp(t.at, magic, sizeof magic - 1) == 0;
}

/* ---- words ---- */

/* Go behind the next word if it is this, in whatever case. */
static bool take_word(legacy *v, const char *word)
{
    dmk_text *t = &v->in.text;
    if (!dmk_text_seek(t) || !dmk_text_is_in_any_case(t, word)) return false;
    t->at += strlen(word);
    return true;
}

/* Counts beside keywords are text in binary files too. */
static int read_count(legacy *v, const char *what, int64_t *n)
{
    dmk_text *t = &v->in.text;
    dmk_text_seek(t);
    const int rc = dmk_text_integer(t, what, n);
    return rc == DMK_OK && *n < 0 ? dmk_text_fail(t, "%s is negative", what) : rc;
}

static bool take_type(legacy *v, dmk_type *type)
{
    static const struct {
        const char *name;
        dmk_type type;
    } names[] = {{"char", DMK_INT8},
                 {"signed_char", DMK_INT8},
                 {"unsigned_char", DMK_UINT8},
                 {"short", DMK_INT16},
                 {"unsigned_short", DMK_UINT16},
                 {"int", DMK_INT32},
                 {"unsigned_int", DMK_UINT32},
                 {"long", DMK_INT64},
                 {"unsigned_long", DMK_UINT64},
                 {"vtktypeint64", DMK_INT64},
                 {"vtktypeuint64", DMK_UINT64},
                 {"vtkIdType", DMK_INT32}, /* 32 bits in files, whatever VTK computes with */
                 {"float", DMK_FLOAT32},
                 {"double", DMK_FLOAT64}};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (!take_word(v, names[i].name)) continue;
        *type = names[i].type;
        return true;
    }
    return false;
}

static int read_type(legacy *v, dmk_type *type)
{
    if (take_type(v, type)) return DMK_OK;
    return dmk_text_fail_word(&v->in.text,
                              "is not a supported number type; export float, double or int");
}

/* Binary data begins behind the end of the keyword's line. */
static void begin_data(legacy *v)
{
    if (v->in.binary) dmk_text_skip_line(&v->in.text);
}

/* ---- header ---- */

static int read_header(legacy *v)
{
    int rc = DMK_OK;
    double version;
    dmk_text *t = &v->in.text;
    if (!dmk_vtk_legacy_sniff(t->file)) { /* the suffix chose this reader */
        return dmk_text_fail(t, "no '# vtk DataFile Version' in the first line: not a file of VTK");
    }
    t->at += strlen("# vtk DataFile Version ");
    DMK_TRY(dmk_text_number(t, "the version", &version));
    v->has_offsets = version >= 5;
    dmk_text_skip_line(t);
    dmk_text_skip_line(t); /* the title, which may be anything */
    if (take_word(v, "BINARY")) {
        v->in.binary = true;
        v->in.swap = dmk_is_little_endian();
    } else if (!take_word(v, "ASCII")) {
        return dmk_text_fail(t, "neither ASCII nor BINARY in the third line");
    }
    if (!take_word(v, "DATASET")) return dmk_text_fail(t, "no DATASET; export PolyData");
    v->is_grid = take_word(v, "UNSTRUCTURED_GRID");
    if (!v->is_grid && !take_word(v, "POLYDATA")) {
        dmk_text_seek(t);
        rc = dmk_text_fail_word(
            t, "is neither POLYDATA nor UNSTRUCTURED_GRID; extract the surface first");
    }
done:
    return rc;
}

/* ---- parts ---- */

static int read_points(legacy *v)
{
    int rc;
    int64_t n;
    dmk_type type = DMK_INT8;
    if (v->soup->xyz) return dmk_text_fail(&v->in.text, "a second POINTS");
    DMK_TRY(read_count(v, "the number of points", &n));
    DMK_TRY(read_type(v, &type));
    begin_data(v);
    DMK_TRY(dmk_values_room(&v->in, "points", n, 3, type));
    DMK_TRY(DMK_NEW(v->in.text.context, v->soup->xyz, 3 * (size_t)n));
    v->soup->n_vertices = (size_t)n;
    for (size_t i = 0; i < 3 * (size_t)n; i++) {
        DMK_TRY(dmk_values_number(&v->in, type, "a point's coordinate", &v->soup->xyz[i]));
    }
done:
    return rc;
}

static int make_lists(legacy *v, size_t n_cells, size_t n_corner)
{
    int rc;
    free(v->offset);
    free(v->corner);
    v->offset = NULL;
    v->corner = NULL;
    v->n_cells = n_cells;
    v->n_corner = n_corner;
    DMK_TRY(DMK_NEW(v->in.text.context, v->offset, n_cells + 1));
    DMK_TRY(DMK_NEW(v->in.text.context, v->corner, n_corner));
done:
    return rc;
}

static int read_corner(legacy *v, dmk_type type, size_t k)
{
    int64_t i = 0;
    const int rc = dmk_values_index(&v->in, type, "a cell's point", v->soup->n_vertices, &i);
    v->corner[k] = (int32_t)i;
    return rc;
}

/* n cells as "k i1 ... ik", `size` numbers in all. */
static int read_counted_lists(legacy *v, int64_t n, int64_t size)
{
    int rc;
    begin_data(v);
    DMK_TRY(dmk_values_room(&v->in, "numbers of cells", size, 1, DMK_INT32));
    if (n > size) return dmk_values_fail(&v->in, "more cells than numbers for them");
    DMK_TRY(make_lists(v, (size_t)n, (size_t)(size - n)));
    size_t at = 0;
    for (size_t c = 0; c < v->n_cells; c++) {
        int64_t k = 0;
        DMK_TRY(dmk_values_index(&v->in, DMK_INT32, "the number of a cell's corners",
                                 v->n_corner - at + 1, &k));
        v->offset[c] = (int64_t)at;
        for (const size_t end = at + (size_t)k; at < end; at++) {
            DMK_TRY(read_corner(v, DMK_INT32, at));
        }
    }
    v->offset[v->n_cells] = (int64_t)at;
done:
    return rc;
}

/* "OFFSETS type", n numbers, "CONNECTIVITY type", size numbers. */
static int read_offset_lists(legacy *v, int64_t n, int64_t size)
{
    int rc;
    dmk_type type = DMK_INT8;
    dmk_text *t = &v->in.text;
    if (!take_word(v, "OFFSETS")) return dmk_text_fail(t, "no OFFSETS before the cells' corners");
    DMK_TRY(read_type(v, &type));
    begin_data(v);
    DMK_TRY(dmk_values_room(&v->in, "offsets", n, 1, type));
    DMK_TRY(dmk_values_room(&v->in, "corners", size, 1, DMK_INT8));
    DMK_TRY(make_lists(v, n > 0 ? (size_t)n - 1 : 0, (size_t)size));
    for (int64_t c = 0, before = 0; c < n; before = v->offset[c++]) {
        DMK_TRY(dmk_values_index(&v->in, type, "an offset", (size_t)size + 1, &v->offset[c]));
        if (v->offset[c] < before) return dmk_values_fail(&v->in, "offsets that fall");
    }
    if (!take_word(v, "CONNECTIVITY")) return dmk_text_fail(t, "no CONNECTIVITY after OFFSETS");
    DMK_TRY(read_type(v, &type));
    begin_data(v);
    DMK_TRY(dmk_values_room(&v->in, "corners", size, 1, type));
    for (size_t k = 0; k < v->n_corner; k++) DMK_TRY(read_corner(v, type, k));
done:
    return rc;
}

static int read_lists(legacy *v)
{
    int rc;
    int64_t n, size;
    DMK_TRY(read_count(v, "the number of cells", &n));
    DMK_TRY(read_count(v, "the size of the cells", &size));
    DMK_TRY(v->has_offsets ? read_offset_lists(v, n, size) : read_counted_lists(v, n, size));
done:
    return rc;
}

/* Hand cell c of the lists to the soup. */
static int add_cell(legacy *v, size_t c, dmk_cell cell)
{
    int rc;
    const size_t first = (size_t)v->offset[c], n = (size_t)v->offset[c + 1] - first;
    const char *refusal = dmk_cell_refusal(cell, n);
    if (refusal) return dmk_values_fail(&v->in, "cell %zu is %s", c, refusal);
    DMK_TRY(dmk_corners_resize(v->in.text.context, &v->corners, n));
    if (n > 0) memcpy(v->corners.vertex, v->corner + first, n * sizeof *v->corner);
    rc = dmk_cell_add(v->in.text.context, v->soup, cell, &v->corners, &v->cells);
done:
    return rc;
}

static int read_poly_cells(legacy *v, dmk_cell cell)
{
    int rc;
    DMK_TRY(read_lists(v));
    for (size_t c = 0; c < v->n_cells; c++) DMK_TRY(add_cell(v, c, cell));
done:
    return rc;
}

static int read_cell_types(legacy *v)
{
    int rc;
    int64_t n, type = 0;
    DMK_TRY(read_count(v, "the number of cell types", &n));
    begin_data(v);
    if ((size_t)n != v->n_cells) {
        return dmk_values_fail(&v->in, "%lld cell types for %zu cells", (long long)n, v->n_cells);
    }
    for (size_t c = 0; c < v->n_cells; c++) {
        DMK_TRY(dmk_values_integer(&v->in, DMK_INT32, "a cell's type", &type));
        DMK_TRY(add_cell(v, c, dmk_cell_of_vtk(type)));
    }
done:
    return rc;
}

/* ---- arrays of data, which nobody needs ---- */

/* To the next name; a # begins no comment here. */
static void seek_name(dmk_text *t)
{
    while (t->at < t->end && (unsigned char)*t->at <= ' ') t->at++;
}

static void skip_name(dmk_text *t)
{
    seek_name(t);
    while (t->at < t->end && (unsigned char)*t->at > ' ') t->at++;
}

/* Up to an empty line; names of components stand there, too. */
static void skip_metadata(dmk_text *t)
{
    do {
        dmk_text_skip_line(t);
        while (t->at < t->end && (*t->at == ' ' || *t->at == '\t' || *t->at == '\r')) t->at++;
    } while (t->at < t->end && *t->at != '\n');
}

/* A binary string comes behind its length, high byte first; the two highest bits say how many bytes that has. */
static int skip_binary_string(legacy *v)
{
    dmk_text *t = &v->in.text;
    const size_t left = (size_t)(t->end - t->at);
    const size_t n = left > 0 ? (size_t)8 >> ((unsigned char)*t->at >> 6) : 1;
    uint64_t length = 0;
    for (size_t i = 0; i < n && i < left; i++) length = length << 8 | (unsigned char)t->at[i];
    length &= UINT64_MAX >> (64 - 8 * n + 2);
    if (n > left || length > left - n)
        return dmk_values_fail(&v->in, "the file ends within a string; it is cut short or damaged");
    t->at += n + length;
    return DMK_OK;
}

/* In text each string is a line, which may be empty. */
static int skip_strings(legacy *v, uint64_t n)
{
    int rc = DMK_OK;
    dmk_text *t = &v->in.text;
    dmk_text_skip_line(t);
    for (uint64_t i = 0; i < n && rc == DMK_OK; i++) {
        if (v->in.binary) {
            rc = skip_binary_string(v);
        } else if (t->at < t->end) {
            dmk_text_skip_line(t);
        } else {
            rc = dmk_text_fail(t, "the file ends before its strings");
        }
    }
    return rc;
}

/* "components tuples type" and the numbers: in binary files eight bits to a byte. */
static int skip_array(legacy *v)
{
    int rc;
    int64_t components, tuples;
    dmk_type type = DMK_UINT8;
    dmk_text *t = &v->in.text;
    DMK_TRY(read_count(v, "the number of components", &components));
    DMK_TRY(read_count(v, "the number of tuples", &tuples));
    if (components < 1 || components > 1 << 20) {
        return dmk_text_fail(t, "an array of %lld components", (long long)components);
    }
    if (tuples > INT64_MAX >> 20)
        return dmk_text_fail(t, "an array of %lld tuples", (long long)tuples);
    const uint64_t n = (uint64_t)components * (uint64_t)tuples;
    if (take_word(v, "string")) return skip_strings(v, n);
    if (take_word(v, "bit")) {
        begin_data(v);
        return dmk_values_skip(&v->in, type, v->in.binary ? n / 8 + (n % 8 > 0) : n);
    }
    if (!take_type(v, &type)) {
        return dmk_text_fail_word(
            t, "is the type of an array of data whose length is not known here; export "
               "the mesh without field data");
    }
    begin_data(v);
    DMK_TRY(dmk_values_room(&v->in, "tuples", tuples, (size_t)components, DMK_INT8));
    rc = dmk_values_skip(&v->in, type, n);
done:
    return rc;
}

/* "FIELD name n", then n times a name and an array. */
static int skip_field(legacy *v)
{
    int rc;
    int64_t n;
    dmk_text *t = &v->in.text;
    skip_name(t);
    DMK_TRY(read_count(v, "the number of arrays", &n));
    for (int64_t i = 0; i < n; i++) {
        seek_name(t);
        if (dmk_text_is_in_any_case(t, "METADATA")) skip_metadata(t); /* of the array before */
        skip_name(t);
        DMK_TRY(skip_array(v));
    }
done:
    return rc;
}

/* ---- the file ---- */

static int read_part(legacy *v, bool *done)
{
    dmk_text *t = &v->in.text;
    if (take_word(v, "POINTS")) return read_points(v);
    if (take_word(v, "FIELD")) return skip_field(v);
    if (take_word(v, "METADATA")) {
        skip_metadata(t);
        return DMK_OK;
    }
    if (take_word(v, "POINT_DATA") || take_word(v, "CELL_DATA")) {
        *done = true;
        return DMK_OK;
    }
    if (v->is_grid) {
        if (take_word(v, "CELLS")) return read_lists(v);
        if (take_word(v, "CELL_TYPES")) return read_cell_types(v);
    } else {
        if (take_word(v, "VERTICES") || take_word(v, "LINES")) {
            return read_poly_cells(v, DMK_CELL_THIN);
        }
        if (take_word(v, "POLYGONS")) return read_poly_cells(v, DMK_CELL_POLYGON);
        if (take_word(v, "TRIANGLE_STRIPS")) return read_poly_cells(v, DMK_CELL_STRIP);
    }
    return dmk_text_fail_word(t, "does not belong in this kind of data set");
}

int dmk_vtk_legacy_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    bool done = false;
    legacy v = {.soup = soup};
    DMK_TRY(dmk_text_open(ctx, file, &v.in.text));
    DMK_TRY(read_header(&v));
    while (!done && dmk_text_seek(&v.in.text)) DMK_TRY(read_part(&v, &done));
    DMK_TRY(dmk_cells_end(ctx, file->path, soup, &v.cells));
done:
    dmk_text_close(&v.in.text);
    free(v.offset);
    free(v.corner);
    free(v.corners.vertex);
    return rc;
}
