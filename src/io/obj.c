/* Wavefront OBJ: "v x y z" and "f i j k ..." (once "fo") with i, i/t, i//n, i/t/n and negative (relative)
 * indices, long lines continued by a backslash; everything else is skipped. Cut loci are written as
 * "v" and "l" lines, a single point as "p". */
#include "io/lines.h"

#include <stdlib.h>
#include <string.h>

bool dmk_obj_sniff(const dmk_file *file)
{
    static const char *const words[] = {"v", "vn", "vt", "f", "o", "g", "s", "mtllib", "usemtl"};
    dmk_text t = dmk_text_of(file);
    if (!dmk_text_seek(&t)) return false;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        if (dmk_text_is(&t, words[i])) return true;
    }
    return false;
}

/* Like dmk_text_more, but a backslash before the line's end joins the next line. */
static bool more(dmk_text *t)
{
    while (dmk_text_more(t)) {
        if (*t->at != '\\') return true;
        const char *p = t->at + 1;
        if (p < t->end && *p == '\r') p++;
        if (p >= t->end || *p != '\n') return true;
        t->at = p + 1;
    }
    return false;
}

/* Number of "v" lines: the room for vertices, and the range of the faces' indices. */
static size_t count_vertices(dmk_text t)
{
    size_t n = 0;
    while (dmk_text_seek(&t)) {
        if (t.at[0] == 'v' && dmk_text_word(&t) == 1) n++;
        dmk_text_skip_line(&t);
    }
    return n;
}

static int read_vertex(dmk_text *t, double *xyz)
{
    int rc = DMK_OK;
    for (int k = 0; k < 3; k++) {
        more(t);
        DMK_TRY(dmk_text_number(t, "a vertex coordinate", &xyz[k]));
    }
done:
    return rc;
}

/* One corner: the vertex index, then anything behind a slash up to the next blank. `seen` vertices
 * came before this line and are what negative indices count from. */
static int read_corner(dmk_text *t, size_t n_vertices, size_t seen, int32_t *vertex)
{
    int64_t i;
    const char *p = t->at, *word_end = t->at + dmk_text_word(t);
    if (!dmk_integer_read(&p, word_end, &i) || (p < word_end && *p != '/')) {
        return dmk_text_fail_word(t,
                                  "where a face's vertex is expected: write i, i/t, i//n or i/t/n");
    }
    int64_t v = i > 0 ? i - 1 : (int64_t)seen + i;
    if (i == 0 || v < 0 || v >= (int64_t)n_vertices) {
        return dmk_text_fail(t,
                             "vertex %lld of a face is out of range: the file has %zu (OBJ "
                             "counts from 1)",
                             (long long)i, n_vertices);
    }
    *vertex = (int32_t)v;
    t->at = word_end;
    return DMK_OK;
}

static int read_face(dmk_text *t, dmk_soup *soup, size_t seen)
{
    int rc = DMK_OK;
    int32_t fan[2] = {0, 0}, vertex = 0;
    size_t n = 0;
    while (more(t)) {
        DMK_TRY(read_corner(t, soup->n_vertices, seen, &vertex));
        DMK_TRY(dmk_soup_corner(t->context, soup, n++, fan, vertex));
    }
    if (n < 3) rc = dmk_text_fail(t, "a face with %zu corners; remove it", n);
done:
    return rc;
}

/* ---- many lines at once: "v x y z" and "f i j k", i above 0, and nothing continued ---- */

enum { VERTEX, FACE };

static int kind_of_line(const dmk_text *t)
{
    const char *line_end = memchr(t->at, '\n', (size_t)(t->end - t->at));
    const char *end = line_end ? line_end : t->end;
    if (memchr(t->at, '\\', (size_t)(end - t->at)) || dmk_text_is(t, "fo")) return DMK_LINE_ODD;
    return dmk_text_is(t, "v") ? VERTEX : dmk_text_is(t, "f") ? FACE : DMK_LINE_NONE;
}

static bool take_line(dmk_text *t, int kind, size_t i, const dmk_lines *lines)
{
    t->at++;
    for (size_t k = 0; k < 3; k++) {
        int64_t v;
        if (!dmk_text_more(t)) return false;
        if (kind == VERTEX) {
            if (!dmk_text_take_number(t, &lines->soup->xyz[3 * i + k])) return false;
            continue;
        }
        const char *p = t->at, *word_end = t->at + dmk_text_word(t);
        if (!dmk_integer_read(&p, word_end, &v) || (p < word_end && *p != '/')) return false;
        if (v < 1 || (uint64_t)v > lines->n[VERTEX]) return false;
        lines->soup->triangle[3 * i + k] = (int32_t)(v - 1);
        t->at = word_end;
    }
    return kind == VERTEX || !dmk_text_more(t);
}

static int read_plain(const dmk_text *t, dmk_soup *soup, bool *plain)
{
    int rc;
    struct dmk_chunks *chunks = NULL;
    dmk_lines lines = {.text = t, .soup = soup, .kind = kind_of_line, .take = take_line};
    DMK_TRY(dmk_lines_count(t->context, &lines, &chunks, plain));
    *plain = *plain && lines.n[FACE] > 0;
    if (!*plain) goto done;
    DMK_TRY(DMK_NEW(t->context, soup->xyz, 3 * lines.n[VERTEX]));
    DMK_TRY(DMK_NEW(t->context, soup->triangle, 3 * lines.n[FACE]));
    DMK_TRY(dmk_lines_take(t->context, &lines, chunks, plain));
    if (*plain) {
        soup->n_vertices = lines.n[VERTEX];
        soup->n_triangles = soup->triangle_room = lines.n[FACE];
    } else {
        dmk_soup_free(soup);
    }
done:
    dmk_chunks_free(&chunks);
    return rc;
}

int dmk_obj_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    dmk_text t;
    size_t seen = 0;
    bool plain;
    DMK_TRY(dmk_text_open(ctx, file, &t));
    DMK_TRY(read_plain(&t, soup, &plain));
    if (plain) goto done;
    soup->n_vertices = count_vertices(t);
    DMK_TRY(DMK_NEW(ctx, soup->xyz, 3 * soup->n_vertices));
    while (dmk_text_seek(&t)) {
        if (dmk_text_take(&t, "v")) {
            DMK_TRY(read_vertex(&t, soup->xyz + 3 * seen));
            seen++;
        } else if (dmk_text_take(&t, "f") || dmk_text_take(&t, "fo")) {
            DMK_TRY(read_face(&t, soup, seen));
        }
        dmk_text_skip_line(&t);
    }
    if (soup->n_triangles == 0) {
        rc = dmk_fail(
            ctx, DMK_E_FORMAT,
            "%s: contains no faces (\"f\" lines): not a mesh in OBJ format, or not in UTF-8",
            file->path);
    }
done:
    dmk_text_close(&t);
    return rc;
}

static void put_vertex(dmk_output *out, const double *xyz)
{
    dmk_output_text(out, "v");
    for (int k = 0; k < 3; k++) {
        dmk_output_text(out, " ");
        dmk_output_number(out, xyz[k]);
    }
    dmk_output_text(out, "\n");
}

/* One line of n vertex indices, which OBJ counts from 1. */
static void put_indices(dmk_output *out, const char *word, const int32_t *index, size_t n)
{
    dmk_output_text(out, word);
    for (size_t k = 0; k < n; k++) {
        dmk_output_text(out, " ");
        dmk_output_integer(out, (int64_t)index[k] + 1);
    }
    dmk_output_text(out, "\n");
}

static void put_plane(dmk_output *out, const double *plane, int32_t n)
{
    for (int32_t v = 0; v < n; v++) {
        dmk_output_text(out, "vt ");
        dmk_output_number(out, plane[2 * (size_t)v]);
        dmk_output_text(out, " ");
        dmk_output_number(out, plane[2 * (size_t)v + 1]);
        dmk_output_text(out, "\n");
    }
}

/* A face with texture coordinates: one for each vertex. */
static void put_textured(dmk_output *out, const int32_t *vertex)
{
    dmk_output_text(out, "f");
    for (int k = 0; k < 3; k++) {
        dmk_output_text(out, " ");
        dmk_output_integer(out, (int64_t)vertex[k] + 1);
        dmk_output_text(out, "/");
        dmk_output_integer(out, (int64_t)vertex[k] + 1);
    }
    dmk_output_text(out, "\n");
}

int dmk_obj_write(dmk_context *ctx, dmk_output *out, const dmk_fields *fields)
{
    (void)ctx;
    const dmk_mesh *m = fields->mesh;
    for (int32_t v = 0; v < m->n_vertices; v++) put_vertex(out, m->xyz + 3 * (size_t)v);
    if (fields->plane) put_plane(out, fields->plane, m->n_vertices);
    for (int32_t t = 0; t < m->n_triangles; t++) {
        if (fields->plane)
            put_textured(out, m->triangle + 3 * (size_t)t);
        else
            put_indices(out, "f", m->triangle + 3 * (size_t)t, 3);
    }
    return DMK_OK;
}

int dmk_obj_write_locus(dmk_context *ctx, dmk_output *out, const dmk_curves *c)
{
    (void)ctx;
    for (size_t v = 0; v < c->n_vertices; v++) put_vertex(out, c->vertex[v].xyz);
    for (size_t k = 0; k < c->n_polylines; k++) {
        size_t n = (size_t)(c->offset[k + 1] - c->offset[k]);
        put_indices(out, n > 1 ? "l" : "p", c->index + c->offset[k], n);
    }
    if (c->n_polylines == 0) {
        for (int32_t v = 0; v < (int32_t)c->n_vertices; v++) put_indices(out, "p", &v, 1);
    }
    return DMK_OK;
}
