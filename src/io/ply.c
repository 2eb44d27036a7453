/* PLY: text and binary of both byte orders. Read: the coordinates x y z of the element "vertex" and
 * the list "vertex_indices" (or "vertex_index") of the element "face"; all else is skipped.
 * Written: the bare mesh binary in the machine's byte order, doubles as doubles; a result, which adds
 * u and distance to the vertices, mu and acl to the faces, as text.
 *
 * librply is not used: it parses text by the program's locale and trusts the header. */
#include "base/parallel.h"
#include "io/dealt.h"

#include <stdlib.h>
#include <string.h>

static const struct {
    const char *name, *other_name;
    dmk_type type;
} types[] = {{"char", "int8", DMK_INT8},        {"uchar", "uint8", DMK_UINT8},
             {"short", "int16", DMK_INT16},     {"ushort", "uint16", DMK_UINT16},
             {"int", "int32", DMK_INT32},       {"uint", "uint32", DMK_UINT32},
             {"float", "float32", DMK_FLOAT32}, {"double", "float64", DMK_FLOAT64}};

/* What a property is for: 0, 1, 2 are x, y, z. */
enum { ROLE_CORNERS = 3, ROLE_NONE = 4 };

typedef struct property {
    int type;        /* of the value, or of each item of a list */
    int length_type; /* of a list's length, or -1: no list */
    int role;
} property;

typedef struct element {
    const char *name; /* within the file's text, up to a blank */
    int64_t count;
    int first, n; /* its properties */
    bool is_vertex, is_face;
} element;

#define MAX_ELEMENTS 16
#define MAX_PROPERTIES 256

typedef struct ply {
    dmk_values in;
    int n_elements, n_properties;
    element element[MAX_ELEMENTS];
    property property[MAX_PROPERTIES];
} ply;

bool dmk_ply_sniff(const dmk_file *file)
{
    const dmk_text t = dmk_text_of(file);
    return t.end - t.at > 4 && memcmp(t.at, "ply", 3) == 0 &&
           (t.at[3] == '\n' || t.at[3] == '\r') && !dmk_stl_is_binary(file);
}

/* ---- header ---- */

/* The word, and the blanks behind it. */
static bool take_word(dmk_text *t, const char *word)
{
    if (!dmk_text_take(t, word)) return false;
    dmk_text_more(t);
    return true;
}

static int take_type(dmk_text *t)
{
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        if (take_word(t, types[i].name) || take_word(t, types[i].other_name)) {
            return (int)types[i].type;
        }
    }
    return -1;
}

static int read_format(ply *p)
{
    dmk_text *t = &p->in.text;
    p->in.binary = true;
    if (take_word(t, "ascii")) {
        p->in.binary = false;
    } else if (take_word(t, "binary_little_endian")) {
        p->in.swap = !dmk_is_little_endian();
    } else if (take_word(t, "binary_big_endian")) {
        p->in.swap = dmk_is_little_endian();
    } else {
        return dmk_text_fail(t, "the format is not ascii, binary_little_endian or "
                                "binary_big_endian");
    }
    return take_word(t, "1.0") ? DMK_OK : dmk_text_fail(t, "this is not version 1.0 of PLY");
}

static int read_element_line(ply *p)
{
    dmk_text *t = &p->in.text;
    if (p->n_elements == MAX_ELEMENTS) return dmk_text_fail(t, "too many elements; remove some");
    element *e = &p->element[p->n_elements++];
    *e = (element){.name = t->at, .first = p->n_properties};
    e->is_vertex = take_word(t, "vertex");
    e->is_face = !e->is_vertex && take_word(t, "face");
    if (!e->is_vertex && !e->is_face) {
        t->at += dmk_text_word(t);
        dmk_text_more(t);
    }
    int rc = dmk_text_integer(t, "the number of elements", &e->count);
    if (rc == DMK_OK && e->count < 0) rc = dmk_text_fail(t, "a negative number of elements");
    return rc;
}

static int read_property_line(ply *p)
{
    static const char *const names[] = {"x", "y", "z"};
    dmk_text *t = &p->in.text;
    if (p->n_elements == 0) return dmk_text_fail(t, "a property before the first element");
    if (p->n_properties == MAX_PROPERTIES) {
        return dmk_text_fail(t, "too many properties; remove some");
    }
    element *e = &p->element[p->n_elements - 1];
    property *q = &p->property[p->n_properties++];
    e->n++;
    *q = (property){.length_type = -1, .role = ROLE_NONE};
    bool list = take_word(t, "list");
    if (list) q->length_type = take_type(t);
    q->type = take_type(t);
    const bool bad_length = q->length_type < 0 || dmk_type_is_float((dmk_type)q->length_type);
    if (q->type < 0 || (list && bad_length)) {
        return dmk_text_fail(t, "a property of unknown type");
    }
    for (int k = 0; k < 3 && e->is_vertex && !list; k++) {
        if (take_word(t, names[k])) q->role = k;
    }
    if (e->is_face && list && (take_word(t, "vertex_indices") || take_word(t, "vertex_index"))) {
        q->role = ROLE_CORNERS;
    }
    return DMK_OK;
}

/* Behind the header's last line, whose end is that of the first line: binary data may begin with
 * what looks like a line end. */
static int end_header(ply *p)
{
    dmk_text *t = &p->in.text;
    while (t->at < t->end && (*t->at == ' ' || *t->at == '\t')) t->at++;
    if (dmk_text_of(t->file).at[3] == '\r' && t->at < t->end && *t->at == '\r') t->at++;
    if (t->at >= t->end || *t->at != '\n') return dmk_text_fail(t, "the header does not end well");
    t->at++;
    return DMK_OK;
}

static int read_header(ply *p)
{
    int rc = DMK_OK;
    bool format = false;
    dmk_text *t = &p->in.text;
    for (dmk_text_skip_line(t); rc == DMK_OK && dmk_text_seek(t); dmk_text_skip_line(t)) {
        if (dmk_text_take(t, "end_header")) {
            if (!format) return dmk_text_fail(t, "the header names no format");
            return end_header(p);
        }
        if (take_word(t, "format")) {
            rc = read_format(p);
            format = true;
        } else if (take_word(t, "element")) {
            rc = read_element_line(p);
        } else if (take_word(t, "property")) {
            rc = read_property_line(p);
        } else if (!take_word(t, "comment") && !take_word(t, "obj_info")) {
            rc = dmk_text_fail_word(
                t,
                "is not a line of a PLY header; if it tells of nothing, put 'comment' before it");
        }
        if (rc != DMK_OK) return rc;
    }
    return dmk_text_fail(t, "the file ends within its header");
}

/* A whole number within 0 .. limit-1. */
static int read_whole(ply *p, int type, const char *what, int64_t limit, int64_t *value)
{
    double x;
    int rc = dmk_values_number(&p->in, (dmk_type)type, "a value", &x);
    if (rc != DMK_OK) return rc;
    if (x >= 0 && x < (double)limit && x == (double)(int64_t)x) {
        *value = (int64_t)x;
        return DMK_OK;
    }
    return dmk_values_fail(&p->in, "%s %.17g is out of range [0, %lld]", what, x,
                           (long long)limit - 1);
}

/* ---- elements ---- */

static int read_corners(ply *p, const property *q, int64_t n, dmk_soup *soup)
{
    int32_t fan[2] = {0, 0};
    if (n < 3) {
        return dmk_fail(p->in.text.context, DMK_E_FORMAT, "%s: a face with %lld corners; remove it",
                        p->in.text.file->path, (long long)n);
    }
    for (int64_t k = 0; k < n; k++) {
        int64_t v = 0;
        int rc = read_whole(p, q->type, "vertex", (int64_t)soup->n_vertices, &v);
        if (rc == DMK_OK) {
            rc = dmk_soup_corner(p->in.text.context, soup, (size_t)k, fan, (int32_t)v);
        }
        if (rc != DMK_OK) return rc;
    }
    return DMK_OK;
}

static int read_property(ply *p, const property *q, int64_t i, dmk_soup *soup)
{
    int rc;
    int64_t n = 0;
    if (q->role < 3) {
        return dmk_values_number(&p->in, (dmk_type)q->type, "a value", &soup->xyz[3 * i + q->role]);
    }
    if (q->length_type < 0) return dmk_values_skip(&p->in, (dmk_type)q->type, 1);
    DMK_TRY(read_whole(p, q->length_type, "length", INT32_MAX, &n));
    rc = q->role == ROLE_CORNERS ? read_corners(p, q, n, soup)
                                 : dmk_values_skip(&p->in, (dmk_type)q->type, (size_t)n);
done:
    return rc;
}

/* Refuse a count that the rest of the file cannot hold, each value being as short as can be. */
static int check_room(const ply *p, const element *e)
{
    int64_t least = 0;
    for (int k = e->first; k < e->first + e->n; k++) {
        const property *q = &p->property[k];
        int type = q->length_type < 0 ? q->type : q->length_type;
        least += p->in.binary ? (int64_t)dmk_type_bytes((dmk_type)type) : 2;
    }
    if (least == 0 || e->count <= (p->in.text.end - p->in.text.at + 1) / least) return DMK_OK;
    return dmk_fail(p->in.text.context, DMK_E_FORMAT,
                    "%s: %lld of element '%.*s' do not fit into the %td bytes that follow; the "
                    "file is cut short or its counts are wrong",
                    p->in.text.file->path, (long long)e->count, (int)strcspn(e->name, " \t\r\n"),
                    e->name, p->in.text.end - p->in.text.at);
}

/* Binary records of one size: vertices without lists, triangles without other lists. */
typedef struct records {
    const ply *p;
    const element *e;
    const char *begin;
    size_t size, offset[MAX_PROPERTIES]; /* bytes; of each property, at its number */
    dmk_soup *soup;
} records;

static bool have_one_size(records *r)
{
    r->size = 0;
    if (!r->p->in.binary) return false;
    for (int k = r->e->first; k < r->e->first + r->e->n; k++) {
        const property *q = &r->p->property[k];
        const size_t one = dmk_type_bytes((dmk_type)q->type);
        if (q->length_type >= 0 && q->role != ROLE_CORNERS) return false;
        r->offset[k] = r->size;
        r->size += q->length_type < 0 ? one : dmk_type_bytes((dmk_type)q->length_type) + 3 * one;
    }
    return true;
}

/* Take record i; whether it is another thing than a vertex or triangle. */
static bool is_odd(int32_t i, void *data)
{
    const records *r = data;
    const bool swap = r->p->in.swap;
    for (int k = r->e->first; k < r->e->first + r->e->n; k++) {
        const property *q = &r->p->property[k];
        const dmk_type type = (dmk_type)q->type, length = (dmk_type)q->length_type;
        const char *at = r->begin + (size_t)i * r->size + r->offset[k];
        if (q->role < 3)
            r->soup->xyz[3 * (size_t)i + (size_t)q->role] = dmk_decode_number(type, at, swap);
        if (q->role != ROLE_CORNERS) continue;
        if (dmk_decode_number(length, at, swap) != 3) return true;
        at += dmk_type_bytes(length);
        for (size_t c = 0; c < 3; c++, at += dmk_type_bytes(type)) {
            const double v = dmk_decode_number(type, at, swap);
            if (!(v >= 0 && v < (double)r->soup->n_vertices && v == (double)(int32_t)v))
                return true;
            r->soup->triangle[3 * (size_t)i + c] = (int32_t)v;
        }
    }
    return false;
}

/* By all threads; not done where a record has another size, or is wrong. */
static int read_records(ply *p, const element *e, dmk_soup *soup, bool *done)
{
    int rc = DMK_OK;
    dmk_context *ctx = p->in.text.context;
    records r = {.p = p, .e = e, .begin = p->in.text.at, .soup = soup};
    *done = e->n > 0 && e->count <= INT32_MAX && have_one_size(&r) &&
            (size_t)e->count * r.size <= (size_t)(p->in.text.end - r.begin);
    if (!*done) return DMK_OK;
    if (e->is_face) {
        DMK_TRY(DMK_NEW(ctx, soup->triangle, 3 * (size_t)e->count));
        soup->triangle_room = (size_t)e->count;
    }
    *done = dmk_parallel_first(ctx, (int32_t)e->count, is_odd, &r) < 0;
    if (!*done) goto done;
    if (e->is_face) soup->n_triangles = (size_t)e->count;
    p->in.text.at += (size_t)e->count * r.size;
done:
    return rc;
}

static int read_element(ply *p, const element *e, dmk_soup *soup)
{
    int rc;
    bool plain;
    DMK_TRY(check_room(p, e));
    if (e->is_vertex) DMK_TRY(DMK_NEW(p->in.text.context, soup->xyz, 3 * (size_t)e->count));
    DMK_TRY(read_records(p, e, soup, &plain));
    if (plain) return DMK_OK;
    for (int64_t i = 0; e->n > 0 && i < e->count; i++) {
        for (int k = e->first; k < e->first + e->n; k++) {
            DMK_TRY(read_property(p, &p->property[k], i, soup));
        }
    }
done:
    return rc;
}

/* A text's numbers behind all that its header counts: a count is wrong. */
static int check_end(ply *p)
{
    double x;
    dmk_text *t = &p->in.text;
    const char *at = dmk_text_seek(t) ? t->at : t->end;
    if (!dmk_number_read(&t->numbers, &at, t->end, &x) || !dmk_text_ends(t, at)) return DMK_OK;
    return dmk_text_fail(
        t, "a number behind all that the header counts; correct its counts or remove the rest");
}

/* One element "vertex" with x, y, z, and one "face" with its corners. */
static int check_header(ply *p, dmk_soup *soup)
{
    int n_vertex = 0, n_face = 0, n_role[5] = {0};
    for (int i = 0; i < p->n_elements; i++) {
        n_vertex += p->element[i].is_vertex;
        n_face += p->element[i].is_face;
        if (p->element[i].is_vertex) soup->n_vertices = (size_t)p->element[i].count;
    }
    for (int k = 0; k < p->n_properties; k++) n_role[p->property[k].role]++;
    if (n_vertex == 1 && n_face == 1 && n_role[0] == 1 && n_role[1] == 1 && n_role[2] == 1 &&
        n_role[ROLE_CORNERS] == 1) {
        return DMK_OK;
    }
    const char *what = n_vertex != 1                                        ? "element 'vertex'"
                       : n_role[0] != 1 || n_role[1] != 1 || n_role[2] != 1 ? "vertices' x, y and z"
                       : n_face != 1                                        ? "element 'face'"
                                     : "faces' list 'vertex_indices'";
    return dmk_fail(p->in.text.context, DMK_E_FORMAT,
                    "%s: its header has no %s, or more than one: not a mesh of polygons",
                    p->in.text.file->path, what);
}

int dmk_ply_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    ply *p = NULL;
    DMK_TRY(DMK_NEW(ctx, p, 1));
    DMK_TRY(dmk_text_open(ctx, file, &p->in.text));
    DMK_TRY(read_header(p));
    DMK_TRY(check_header(p, soup));
    for (int i = 0; i < p->n_elements; i++) DMK_TRY(read_element(p, &p->element[i], soup));
    if (!p->in.binary) rc = check_end(p);
done:
    if (p) dmk_text_close(&p->in.text);
    free(p);
    return rc;
}

/* ---- by ranges ---- */

/* The columns of an element whose records begin at byte `at`. */
static void set_columns(const records *r, uint64_t at, dmk_layout *l)
{
    for (int k = r->e->first; k < r->e->first + r->e->n; k++) {
        const property *q = &r->p->property[k];
        const dmk_type type = (dmk_type)q->type;
        dmk_column c = {at + r->offset[k], r->size, type};
        if (q->role < 3) l->xyz[q->role] = c;
        if (q->role != ROLE_CORNERS) continue;
        c.type = (dmk_type)q->length_type;
        l->n_triangles = (size_t)r->e->count;
        l->check[l->n_checks++] = (dmk_column_check){c, l->n_triangles, 3, 0};
        c.at += dmk_type_bytes(c.type);
        c.type = type;
        for (size_t i = 0; i < 3; i++, c.at += dmk_type_bytes(type)) l->corner[i] = c;
    }
}

/* Up to the faces all records must be of one size. */
static bool set_layout(const ply *p, const dmk_soup *soup, dmk_layout *l)
{
    uint64_t at = (uint64_t)(p->in.text.at - p->in.text.file->data);
    l->swap = p->in.swap;
    l->n_vertices = soup->n_vertices;
    for (int i = 0; i < p->n_elements && (l->n_triangles == 0 || l->xyz[0].stride == 0); i++) {
        records r = {.p = p, .e = &p->element[i]};
        if (!have_one_size(&r)) return false;
        if (r.size > 0 && (uint64_t)r.e->count > (UINT64_MAX - at) / r.size) return false;
        set_columns(&r, at, l);
        at += (uint64_t)r.e->count * r.size;
    }
    return true;
}

bool dmk_ply_layout(dmk_context *ctx, const dmk_file *head, dmk_layout *layout)
{
    int rc;
    bool found = false;
    dmk_soup soup = {0};
    ply *p = NULL;
    DMK_TRY(DMK_NEW(ctx, p, 1));
    DMK_TRY(dmk_text_open(ctx, head, &p->in.text));
    DMK_TRY(read_header(p));
    DMK_TRY(check_header(p, &soup));
    found = set_layout(p, &soup, layout);
done:
    if (p) dmk_text_close(&p->in.text);
    free(p);
    return found;
}

/* ---- writing ---- */

/* With values beside the mesh as text, which all readers take: those of meshio and Gmsh find no faces in binary
 * files with values. */
static bool is_text(const dmk_fields *f)
{
    return f->mu || f->nearest;
}

static void put_header(dmk_output *out, const dmk_fields *f)
{
    dmk_output_text(out, is_text(f)               ? "ply\nformat ascii 1.0\n"
                         : dmk_is_little_endian() ? "ply\nformat binary_little_endian 1.0\n"
                                                  : "ply\nformat binary_big_endian 1.0\n");
    dmk_output_text(out, "element vertex ");
    dmk_output_integer(out, f->mesh->n_vertices);
    dmk_output_text(out, "\nproperty double x\nproperty double y\nproperty double z\n");
    if (f->mu) dmk_output_text(out, "property double u\n");
    if (f->mu && f->distance) dmk_output_text(out, "property double distance\n");
    if (f->nearest) {
        dmk_output_text(
            out, "property double distance\nproperty double direction\nproperty int nearest\n");
    }
    dmk_output_text(out, "element face ");
    dmk_output_integer(out, f->mesh->n_triangles);
    dmk_output_text(out, "\nproperty list uchar int vertex_indices\n");
    if (f->mu) dmk_output_text(out, "property double mu\n");
    if (f->acl) dmk_output_text(out, "property uchar acl\n");
    if (f->flux) {
        dmk_output_text(out,
                        "property double flux_x\nproperty double flux_y\nproperty double flux_z\n");
    }
    dmk_output_text(out, "end_header\n");
}

static void put_mesh(dmk_output *out, const dmk_mesh *m)
{
    dmk_output_put(out, m->xyz, 3 * (size_t)m->n_vertices * sizeof *m->xyz);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        dmk_output_put(out, "\3", 1);
        dmk_output_put(out, m->triangle + 3 * (size_t)t, 3 * sizeof *m->triangle);
    }
}

/* n numbers, each with a blank before it. */
static void put_numbers(dmk_output *out, const double *value, int n)
{
    for (int i = 0; i < n; i++) {
        dmk_output_text(out, " ");
        dmk_output_number(out, value[i]);
    }
}

static void put_integer(dmk_output *out, int64_t value)
{
    dmk_output_text(out, " ");
    dmk_output_integer(out, value);
}

static void put_vertices(dmk_output *out, const dmk_fields *f)
{
    for (int32_t v = 0; v < f->mesh->n_vertices; v++) {
        const double *xyz = f->mesh->xyz + 3 * (size_t)v;
        dmk_output_number(out, xyz[0]);
        put_numbers(out, xyz + 1, 2);
        if (f->mu) put_numbers(out, &f->u[v], 1);
        if (f->mu && f->distance) put_numbers(out, &f->distance[v], 1);
        if (f->nearest) {
            put_numbers(out, &f->distance[v], 1);
            put_numbers(out, &f->direction[v], 1);
            put_integer(out, f->nearest[v]);
        }
        dmk_output_text(out, "\n");
    }
}

static void put_faces(dmk_output *out, const dmk_fields *f)
{
    for (int32_t t = 0; t < f->mesh->n_triangles; t++) {
        dmk_output_text(out, "3");
        for (int k = 0; k < 3; k++) put_integer(out, f->mesh->triangle[3 * (size_t)t + (size_t)k]);
        if (f->mu) put_numbers(out, &f->mu[t], 1);
        if (f->acl) put_integer(out, f->acl[t]);
        if (f->flux) put_numbers(out, f->flux + 3 * (size_t)t, 3);
        dmk_output_text(out, "\n");
    }
}

int dmk_ply_write(dmk_context *ctx, dmk_output *out, const dmk_fields *f)
{
    (void)ctx;
    put_header(out, f);
    if (is_text(f)) {
        put_vertices(out, f);
        put_faces(out, f);
    } else {
        put_mesh(out, f->mesh);
    }
    return DMK_OK;
}
