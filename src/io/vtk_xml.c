#include "io/vtk_xml.h"

#include <expat.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if XML_MAJOR_VERSION == 2 && XML_MINOR_VERSION < 9 /* later ones warn of the older names */
#define XML_GetCurrentLineNumber64 XML_GetCurrentLineNumber
#define XML_GetCurrentByteIndex64 XML_GetCurrentByteIndex
#define XML_GetCurrentByteCount64 XML_GetCurrentByteCount
#endif

/* Where in the tree of tags we are, as far as it matters. */
typedef enum part { NOWHERE, POINTS, POLYS, STRIPS, CELLS, POINT_DATA, CELL_DATA } part;

typedef struct walk {
    dmk_context *context;
    const dmk_file *file;
    XML_Parser parser;
    dmk_vtk_tags *tags;
    int rc;
    bool is_vtk;
    part in;
    dmk_vtk_values *values; /* of the DataArray we are in, or NULL */
    int depth;              /* of tags inside it */
} walk;

void dmk_vtk_tags_free(dmk_vtk_tags *tags)
{
    free(tags->piece);
    memset(tags, 0, sizeof *tags);
}

/* Fail with the line and end the walk; the first failure counts. */
static void fail(walk *w, const char *what, const char *detail)
{
    if (w->rc != DMK_OK) return;
    w->rc = dmk_fail(w->context, DMK_E_FORMAT, "%s:%lu: %s%.60s%s", w->file->path,
                     (unsigned long)XML_GetCurrentLineNumber64(w->parser), detail ? "'" : "",
                     detail ? detail : "", what);
    XML_StopParser(w->parser, XML_FALSE);
}

static const char *find(const char **attribute, const char *name)
{
    for (; *attribute; attribute += 2) {
        if (strcmp(attribute[0], name) == 0) return attribute[1];
    }
    return NULL;
}

static bool is(const char *text, const char *word)
{
    return text && strcmp(text, word) == 0;
}

/* A whole number from 0, or 0 if there is no such attribute. */
static int64_t find_count(walk *w, const char **attribute, const char *name)
{
    int64_t n = 0;
    const char *text = find(attribute, name);
    if (!text) return 0;
    const char *at = text, *end = text + strlen(text);
    if (!dmk_integer_read(&at, end, &n) || at != end || n < 0) {
        fail(w, "' is no whole number from 0", text);
        return 0;
    }
    return n;
}

/* ---- tags ---- */

static part find_part(const char *tag)
{
    return is(tag, "Points")      ? POINTS
           : is(tag, "Polys")     ? POLYS
           : is(tag, "Strips")    ? STRIPS
           : is(tag, "Cells")     ? CELLS
           : is(tag, "PointData") ? POINT_DATA
           : is(tag, "CellData")  ? CELL_DATA
                                  : NOWHERE;
}

static void open_file(walk *w, const char **attribute)
{
    const char *type = find(attribute, "type"), *order = find(attribute, "byte_order");
    const char *header = find(attribute, "header_type"), *packer = find(attribute, "compressor");
    dmk_vtk_coding *c = &w->tags->coding;
    w->is_vtk = true;
    if (!is(type, "PolyData") && !is(type, "UnstructuredGrid")) {
        fail(w, "' is neither PolyData nor UnstructuredGrid; extract the surface, in one file",
             type ? type : "?");
    }
    c->swap = is(order, "BigEndian") == dmk_is_little_endian();
    c->header_type = is(header, "UInt64") ? DMK_UINT64 : DMK_UINT32;
    if (header && !is(header, "UInt64") && !is(header, "UInt32")) {
        fail(w, "' is not a supported header_type; write UInt32 or UInt64", header);
    }
    c->packed = packer && *packer;
    if (c->packed && strcmp(packer, "vtkZLibDataCompressor") != 0) {
        fail(w, "' is not read; write with zlib or without compression", packer);
    }
}

static void open_piece(walk *w, const char **attribute)
{
    dmk_vtk_tags *tags = w->tags;
    w->rc = DMK_GROW(w->context, tags->piece, tags->n_pieces + 1, tags->room);
    if (w->rc != DMK_OK) {
        XML_StopParser(w->parser, XML_FALSE);
        return;
    }
    dmk_vtk_piece *p = &tags->piece[tags->n_pieces++];
    *p = (dmk_vtk_piece){.n_points = find_count(w, attribute, "NumberOfPoints"),
                         .n_polys = find_count(w, attribute, "NumberOfPolys"),
                         .n_strips = find_count(w, attribute, "NumberOfStrips"),
                         .n_cells = find_count(w, attribute, "NumberOfCells")};
    const int64_t n_verts = find_count(w, attribute, "NumberOfVerts");
    const int64_t n_lines = find_count(w, attribute, "NumberOfLines");
    p->n_thin = n_verts < INT32_MAX && n_lines < INT32_MAX ? n_verts + n_lines : INT32_MAX;
}

/* The role of the array of that name, or DMK_VTK_N_ROLES for none. */
static dmk_vtk_role find_role(part in, const char *name, const char *wanted)
{
    const bool corners = is(name, "connectivity"), ends = is(name, "offsets");
    switch (in) {
    case POINTS: return DMK_VTK_POINTS;
    case POLYS: return corners ? DMK_VTK_POLY_CORNERS : ends ? DMK_VTK_POLY_ENDS : DMK_VTK_N_ROLES;
    case STRIPS:
        return corners ? DMK_VTK_STRIP_CORNERS : ends ? DMK_VTK_STRIP_ENDS : DMK_VTK_N_ROLES;
    case CELLS:
        if (is(name, "types")) return DMK_VTK_CELL_TYPES;
        return corners ? DMK_VTK_CELL_CORNERS : ends ? DMK_VTK_CELL_ENDS : DMK_VTK_N_ROLES;
    case POINT_DATA: return wanted && is(name, wanted) ? DMK_VTK_POINT_DATA : DMK_VTK_N_ROLES;
    case CELL_DATA: return wanted && is(name, wanted) ? DMK_VTK_CELL_DATA : DMK_VTK_N_ROLES;
    default: return DMK_VTK_N_ROLES;
    }
}

static void find_type(walk *w, const char *name, dmk_type *type)
{
    static const char *const names[] = {
        [DMK_INT8] = "Int8",      [DMK_UINT8] = "UInt8",   [DMK_INT16] = "Int16",
        [DMK_UINT16] = "UInt16",  [DMK_INT32] = "Int32",   [DMK_UINT32] = "UInt32",
        [DMK_INT64] = "Int64",    [DMK_UINT64] = "UInt64", [DMK_FLOAT32] = "Float32",
        [DMK_FLOAT64] = "Float64"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        if (!is(name, names[i])) continue;
        *type = (dmk_type)i;
        return;
    }
    fail(w, "' is not a supported number type", name ? name : "?");
}

static const char *tag_end(const walk *w)
{
    return w->file->data + XML_GetCurrentByteIndex64(w->parser) +
           XML_GetCurrentByteCount64(w->parser);
}

/* One more of the arrays that could have been asked for. Names stand in a message: those with other than plain text
 * are left out. */
static void note_array(walk *w, const char **attribute)
{
    char one[64];
    const char *name = find(attribute, "Name"), *parts = find(attribute, "NumberOfComponents");
    size_t used = strlen(w->tags->others);
    if (!w->tags->wanted || (w->in != POINT_DATA && w->in != CELL_DATA) || !name) return;
    if (parts && !is(parts, "1")) return;
    for (const char *c = name; *c; c++) {
        if ((unsigned char)*c < ' ' || *c == 127) return;
    }
    const int n = snprintf(one, sizeof one, "'%s'", name);
    if (n <= 2 || n >= (int)sizeof one || strstr(w->tags->others, one)) return;
    if (used + (size_t)n + sizeof ", " > sizeof w->tags->others) return;
    snprintf(w->tags->others + used, sizeof w->tags->others - used, "%s%s", used > 0 ? ", " : "",
             one);
}

static void open_array(walk *w, const char **attribute)
{
    const char *format = find(attribute, "format");
    note_array(w, attribute);
    const dmk_vtk_role role = find_role(w->in, find(attribute, "Name"), w->tags->wanted);
    if (role == DMK_VTK_N_ROLES || w->tags->n_pieces == 0) return;
    dmk_vtk_values *v = &w->tags->piece[w->tags->n_pieces - 1].values[role];
    if (v->there) {
        fail(w, "' appears twice (time steps are not read)", find(attribute, "Name"));
        return;
    }
    if (role == DMK_VTK_POINTS && find_count(w, attribute, "NumberOfComponents") != 3) {
        fail(w, "points without NumberOfComponents=\"3\"", NULL);
    }
    if (role >= DMK_VTK_POINT_DATA && find(attribute, "NumberOfComponents") &&
        find_count(w, attribute, "NumberOfComponents") > 1) {
        fail(w, "' has several components; expected one number for each", find(attribute, "Name"));
    }
    v->there = true;
    v->storage = is(format, "appended") ? DMK_VTK_APPENDED
                 : is(format, "binary") ? DMK_VTK_BASE64
                                        : DMK_VTK_TEXT;
    v->offset = (uint64_t)find_count(w, attribute, "offset");
    v->at = v->end = NULL;
    find_type(w, find(attribute, "type"), &v->type);
    w->values = v;
    w->depth = 0;
    v->at = tag_end(w);
}

/* All tags stand before this one; what follows it need not be XML. */
static void open_appended(walk *w, const char **attribute)
{
    const char *p = tag_end(w), *end = w->file->data + w->file->size;
    w->tags->coding.appended_base64 = is(find(attribute, "encoding"), "base64");
    while (p < end && *p != '_' && *p != '<') p++;
    if (p < end && *p == '_') w->tags->coding.appended = p + 1;
    XML_StopParser(w->parser, XML_FALSE);
}

/* ---- the walk ---- */

/* The values of an array stand before its first child (which holds their range), or after it. */
static void end_values(walk *w)
{
    dmk_vtk_values *v = w->values;
    if (v->end) return;
    const char *end = w->file->data + XML_GetCurrentByteIndex64(w->parser);
    for (const char *p = v->at; p < end; p++) {
        if (*p != ' ' && *p != '\n' && *p != '\r' && *p != '\t') {
            v->end = end;
            return;
        }
    }
}

static void XMLCALL on_start(void *user, const char *name, const char **attribute)
{
    walk *w = user;
    if (w->rc != DMK_OK) return;
    if (w->values) {
        if (w->depth++ == 0) end_values(w);
    } else if (is(name, "VTKFile")) {
        open_file(w, attribute);
    } else if (!w->is_vtk) {
        fail(w, "' where <VTKFile> is expected: not a file of VTK", name);
    } else if (is(name, "Piece")) {
        open_piece(w, attribute);
    } else if (is(name, "AppendedData")) {
        open_appended(w, attribute);
    } else if (is(name, "DataArray")) {
        open_array(w, attribute);
    } else if (find_part(name) != NOWHERE) {
        w->in = find_part(name);
    }
}

static void XMLCALL on_end(void *user, const char *name)
{
    walk *w = user;
    if (w->rc != DMK_OK) return;
    if (w->values && w->depth > 0) {
        if (--w->depth == 0 && !w->values->end) w->values->at = tag_end(w);
    } else if (w->values) {
        end_values(w);
        if (!w->values->end) w->values->end = w->values->at; /* empty */
        w->values = NULL;
    } else if (find_part(name) != NOWHERE) {
        w->in = NOWHERE;
    }
}

/* Entities would make the text another than the file's bytes, and VTK writes none. */
static void XMLCALL on_doctype(void *user, const char *name, const char *system_id,
                               const char *public_id, int has_internal)
{
    (void)system_id, (void)public_id, (void)has_internal;
    fail(user, "' in a DOCTYPE; remove it", name);
}

static void parse(walk *w)
{
    const char *p = w->file->data;
    size_t left = w->file->size;
    enum XML_Status status = XML_STATUS_OK;
    while (left > 0 && status == XML_STATUS_OK) { /* expat counts in int */
        const size_t n = left < (size_t)1 << 30 ? left : (size_t)1 << 30;
        left -= n;
        status = XML_Parse(w->parser, p, (int)n, left == 0);
        p += n;
    }
    const enum XML_Error error = XML_GetErrorCode(w->parser);
    if (w->rc != DMK_OK || status != XML_STATUS_ERROR || error == XML_ERROR_ABORTED) return;
    if (error == XML_ERROR_NO_MEMORY) {
        w->rc = dmk_fail(w->context, DMK_E_NOMEM, "out of memory: reading XML");
        return;
    }
    const unsigned long line = (unsigned long)XML_GetCurrentLineNumber64(w->parser);
    if (error == XML_ERROR_NO_ELEMENTS || error == XML_ERROR_UNCLOSED_TOKEN)
        w->rc = dmk_fail(w->context, DMK_E_FORMAT,
                         "%s:%lu: the file ends before </VTKFile>; it is cut short", w->file->path,
                         line);
    else
        w->rc = dmk_fail(w->context, DMK_E_FORMAT, "%s:%lu: not well-formed XML: %s", w->file->path,
                         line, XML_ErrorString(error));
}

int dmk_vtk_tags_read(dmk_context *ctx, const dmk_file *file, dmk_vtk_tags *tags)
{
    walk w = {.context = ctx, .file = file, .tags = tags, .rc = DMK_OK};
    w.parser = XML_ParserCreate(NULL);
    if (!w.parser) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: reading XML");
    XML_SetUserData(w.parser, &w);
    XML_SetElementHandler(w.parser, on_start, on_end);
    XML_SetStartDoctypeDeclHandler(w.parser, on_doctype);
    parse(&w);
    XML_ParserFree(w.parser);
    return w.rc;
}
