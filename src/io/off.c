/* OFF: [ST][C][N]OFF, counts (on the header's line or behind), one vertex x y z per entry, one
 * polygon "n i0 ... i(n-1)" per line. The keyword may be missing; comments start with '#'. Normals,
 * colours and texture coordinates are skipped; they need one vertex per line. Binary files and
 * other dimensions than 3 are refused. */
#include "io/lines.h"

#include <stdlib.h>
#include <string.h>

/* The shortest line of a vertex is "0 0 0\n", that of a face "1 0\n". */
#define VERTEX_BYTES 6
#define FACE_BYTES 4

typedef struct off_header {
    bool keyword; /* there is one */
    bool extras;  /* more numbers behind the three of a vertex */
    bool other_dimension;
} off_header;

/* Take the keyword at the start of the text, if it is one. */
static off_header take_keyword(dmk_text *t)
{
    off_header h = {0};
    const char *p = t->at, *word_end = t->at + dmk_text_word(t);
    size_t left = (size_t)(word_end - p);
    if (left >= 2 && memcmp(p, "ST", 2) == 0) p += 2, h.extras = true;
    if (p < word_end && *p == 'C') p++, h.extras = true;
    if (p < word_end && *p == 'N') p++, h.extras = true;
    if (p < word_end && *p == '4') p++, h.other_dimension = true;
    if (p < word_end && *p == 'n') p++, h.other_dimension = true;
    h.keyword = word_end - p == 3 && memcmp(p, "OFF", 3) == 0;
    if (!h.keyword) return (off_header){0};
    t->at = word_end;
    return h;
}

bool dmk_off_sniff(const dmk_file *file)
{
    dmk_text t = dmk_text_of(file);
    return dmk_text_seek(&t) && take_keyword(&t).keyword;
}

static int read_header(dmk_text *t, off_header *h)
{
    if (!dmk_text_seek(t)) return dmk_text_fail(t, "nothing but comments: not an OFF mesh");
    *h = take_keyword(t);
    if (h->other_dimension) {
        return dmk_text_fail(t, "vertices that are not in three dimensions; export plain OFF");
    }
    if (dmk_text_more(t) && dmk_text_is(t, "BINARY")) {
        return dmk_text_fail(t, "binary OFF is not read; export OFF as text");
    }
    return DMK_OK;
}

/* Counts that the rest of the file cannot hold are refused before anything is allocated. */
static int read_counts(dmk_text *t, int64_t *n_vertices, int64_t *n_faces)
{
    int rc;
    dmk_text_seek(t);
    DMK_TRY(dmk_text_integer(t, "the number of vertices", n_vertices));
    dmk_text_seek(t);
    DMK_TRY(dmk_text_integer(t, "the number of faces", n_faces));
    int64_t room = t->end - t->at + 1;
    if (*n_vertices < 0 || *n_faces < 0 || *n_vertices > room / VERTEX_BYTES ||
        *n_faces > room / FACE_BYTES ||
        *n_vertices * VERTEX_BYTES + *n_faces * FACE_BYTES > room + 1) {
        rc = dmk_text_fail(t,
                           "%lld vertices and %lld faces do not fit into the %lld bytes that "
                           "follow; the file is cut short or its counts are wrong",
                           (long long)*n_vertices, (long long)*n_faces, (long long)room - 1);
        goto done;
    }
    dmk_text_skip_line(t); /* the number of edges, which nobody needs */
done:
    return rc;
}

static int read_vertices(dmk_text *t, const off_header *h, dmk_soup *soup)
{
    int rc = DMK_OK;
    for (size_t i = 0; i < 3 * soup->n_vertices; i++) {
        dmk_text_seek(t);
        DMK_TRY(dmk_text_number(t, "a vertex coordinate", &soup->xyz[i]));
        if (h->extras && i % 3 == 2) dmk_text_skip_line(t);
    }
done:
    return rc;
}

static int read_face(dmk_text *t, dmk_soup *soup)
{
    int rc;
    int64_t n, v;
    int32_t fan[2] = {0, 0};
    dmk_text_seek(t);
    DMK_TRY(dmk_text_integer(t, "the number of a face's corners", &n));
    if (n < 3) {
        rc = dmk_text_fail(t, "a face with %lld corners; remove it, or put one vertex on a line",
                           (long long)n);
        goto done;
    }
    for (int64_t k = 0; k < n; k++) {
        dmk_text_more(t);
        DMK_TRY(dmk_text_integer(t, "a face's vertex", &v));
        if (v < 0 || (uint64_t)v >= soup->n_vertices) {
            rc = dmk_text_fail(
                t, "vertex %lld of a face is out of range: there are %zu, counted from 0",
                (long long)v, soup->n_vertices);
            goto done;
        }
        DMK_TRY(dmk_soup_corner(t->context, soup, (size_t)k, fan, (int32_t)v));
    }
    dmk_text_skip_line(t); /* a colour */
done:
    return rc;
}

/* Behind the last face that is counted a line like one more tells that the count is wrong; what else stands there is
 * passed over. */
static int check_end(dmk_text t, const dmk_soup *soup, int64_t n_faces)
{
    int64_t n = 0, v;
    if (!dmk_text_seek(&t)) return DMK_OK;
    const char *line = t.at;
    if (!dmk_text_take_integer(&t, &n) || n < 3) return DMK_OK;
    for (int64_t k = 0; k < n; k++) {
        if (!dmk_text_more(&t) || !dmk_text_take_integer(&t, &v)) return DMK_OK;
        if (v < 0 || (uint64_t)v >= soup->n_vertices) return DMK_OK;
    }
    t.at = line;
    return dmk_text_fail(&t,
                         "a face behind the %lld that are counted; correct the count or remove it",
                         (long long)n_faces);
}

/* ---- many lines at once: every vertex and every triangle on a line of its own ---- */

static int kind_of_line(const dmk_text *t)
{
    (void)t;
    return 0;
}

/* Line i of the body: n_vertices times three numbers, then n_faces times "3 i j k" and whatever follows. */
static bool take_line(dmk_text *t, int kind, size_t i, const dmk_lines *lines)
{
    (void)kind;
    const off_header *h = lines->reader;
    dmk_soup *soup = lines->soup;
    int64_t v[4];
    if (i < soup->n_vertices) {
        for (size_t k = 0; k < 3; k++) {
            if (!dmk_text_more(t) || !dmk_text_take_number(t, &soup->xyz[3 * i + k])) return false;
        }
        return h->extras || !dmk_text_more(t);
    }
    i -= soup->n_vertices;
    for (size_t k = 0; k < 4; k++) {
        if (!dmk_text_more(t) || !dmk_text_take_integer(t, &v[k])) return false;
        if (k > 0 && (v[k] < 0 || (uint64_t)v[k] >= soup->n_vertices)) return false;
        if (k > 0) soup->triangle[3 * i + k - 1] = (int32_t)v[k];
    }
    return v[0] == 3;
}

/* Where there are just as many lines as vertices and faces, each has its own, and what else stands in one of a vertex
 * is a colour, whatever the keyword. */
static int read_plain(const dmk_text *t, off_header *h, dmk_soup *soup, bool *plain)
{
    int rc;
    struct dmk_chunks *chunks = NULL;
    dmk_lines lines = {
        .text = t, .soup = soup, .reader = h, .kind = kind_of_line, .take = take_line};
    DMK_TRY(dmk_lines_count(t->context, &lines, &chunks, plain));
    *plain = lines.n[0] == soup->n_vertices + soup->triangle_room;
    h->extras = h->extras || *plain;
    if (*plain) DMK_TRY(dmk_lines_take(t->context, &lines, chunks, plain));
    if (*plain) soup->n_triangles = soup->triangle_room;
done:
    dmk_chunks_free(&chunks);
    return rc;
}

int dmk_off_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    dmk_text t;
    off_header h;
    bool plain;
    int64_t n_vertices, n_faces;
    DMK_TRY(dmk_text_open(ctx, file, &t));
    DMK_TRY(read_header(&t, &h));
    DMK_TRY(read_counts(&t, &n_vertices, &n_faces));
    DMK_TRY(DMK_NEW_UNSET(ctx, soup->xyz, 3 * (size_t)n_vertices));
    DMK_TRY(DMK_NEW_UNSET(ctx, soup->triangle, 3 * (size_t)n_faces));
    soup->n_vertices = (size_t)n_vertices;
    soup->triangle_room = (size_t)n_faces;
    DMK_TRY(read_plain(&t, &h, soup, &plain));
    if (plain) goto done;
    DMK_TRY(read_vertices(&t, &h, soup));
    for (int64_t f = 0; f < n_faces; f++) DMK_TRY(read_face(&t, soup));
    rc = check_end(t, soup, n_faces);
done:
    dmk_text_close(&t);
    return rc;
}

int dmk_off_write(dmk_context *ctx, dmk_output *out, const dmk_fields *fields)
{
    (void)ctx;
    const dmk_mesh *m = fields->mesh;
    dmk_output_text(out, "OFF\n");
    dmk_output_integer(out, m->n_vertices);
    dmk_output_text(out, " ");
    dmk_output_integer(out, m->n_triangles);
    dmk_output_text(out, " 0\n");
    for (int32_t i = 0; i < 3 * m->n_vertices; i++) {
        dmk_output_number(out, m->xyz[i]);
        dmk_output_text(out, i % 3 == 2 ? "\n" : " ");
    }
    for (int32_t t = 0; t < m->n_triangles; t++) {
        dmk_output_text(out, "3");
        for (int k = 0; k < 3; k++) {
            dmk_output_text(out, " ");
            dmk_output_integer(out, m->triangle[3 * t + k]);
        }
        dmk_output_text(out, "\n");
    }
    return DMK_OK;
}
