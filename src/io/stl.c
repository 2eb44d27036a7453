/* STL, text and binary: triangles without shared vertices. Corners at exactly the same place become
 * one vertex (-0 and 0 are the same); vertices are numbered as they first appear. */
#include "io/io.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define HEADER_BYTES 84 /* 80 of title, then the number of triangles */
#define RECORD_BYTES 50 /* normal and corners as 12 floats, 2 of attributes */

static uint32_t decode32(const char *p)
{
    const unsigned char *b = (const unsigned char *)p;
    return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

/* The size gives binary files away; some of them begin with "solid" as text does. */
static bool is_binary(const dmk_file *f)
{
    return f->size >= HEADER_BYTES &&
           f->size == HEADER_BYTES + (uint64_t)RECORD_BYTES * decode32(f->data + 80);
}

/* Whether the n characters at p are the word, in whatever case. */
static bool is_word(const char *p, size_t n, const char *word)
{
    return strlen(word) == n && strncasecmp(p, word, n) == 0;
}

bool dmk_stl_sniff(const dmk_file *f)
{
    dmk_text t = {.file = f, .at = f->data, .end = f->data + f->size};
    return is_binary(f) || (dmk_text_seek(&t) && is_word(t.at, dmk_text_word(&t), "solid"));
}

/* ---- joining equal places ---- */

typedef struct weld {
    int32_t *slot; /* n_slots, open addressing: vertex or -1 */
    size_t n_slots, vertex_room;
} weld;

static size_t hash(const double x[3])
{
    uint64_t h = 0, b;
    for (int k = 0; k < 3; k++) {
        memcpy(&b, &x[k], sizeof b);
        h = (h ^ b) * 0x9e3779b97f4a7c15ULL;
        h ^= h >> 32;
    }
    return (size_t)h;
}

/* The slot that holds the vertex at x, or the empty one where it belongs. */
static int32_t *find_slot(const weld *w, const dmk_soup *soup, const double x[3])
{
    for (size_t i = hash(x) & (w->n_slots - 1);; i = (i + 1) & (w->n_slots - 1)) {
        int32_t *s = &w->slot[i];
        if (*s < 0 || memcmp(soup->xyz + 3 * (size_t)*s, x, 3 * sizeof *x) == 0) return s;
    }
}

/* Double the table and the vertices' room: at most half of the slots are ever taken. */
static int weld_grow(dmk_context *ctx, weld *w, dmk_soup *soup)
{
    int rc;
    size_t room = w->vertex_room ? 2 * w->vertex_room : 1024;
    int32_t *slot = NULL;
    DMK_TRY(DMK_NEW(ctx, slot, 2 * room));
    double *xyz = realloc(soup->xyz, 3 * room * sizeof *xyz);
    if (!xyz || room > INT32_MAX) {
        free(slot);
        return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: %zu vertices of the file", room);
    }
    soup->xyz = xyz;
    free(w->slot);
    *w = (weld){slot, 2 * room, room};
    for (size_t i = 0; i < w->n_slots; i++) slot[i] = -1;
    for (size_t v = 0; v < soup->n_vertices; v++) {
        *find_slot(w, soup, soup->xyz + 3 * v) = (int32_t)v;
    }
done:
    return rc;
}

static int add_corner(dmk_context *ctx, weld *w, dmk_soup *soup, size_t place, int32_t fan[2],
                      double x[3])
{
    int rc = DMK_OK;
    if (soup->n_vertices == w->vertex_room) DMK_TRY(weld_grow(ctx, w, soup));
    for (int k = 0; k < 3; k++) x[k] += 0.0; /* -0 becomes 0 */
    int32_t *slot = find_slot(w, soup, x);
    if (*slot < 0) {
        *slot = (int32_t)soup->n_vertices;
        memcpy(soup->xyz + 3 * soup->n_vertices++, x, 3 * sizeof *x);
    }
    rc = dmk_soup_corner(ctx, soup, place, fan, *slot);
done:
    return rc;
}

/* ---- the two kinds ---- */

static int read_binary(dmk_context *ctx, const dmk_file *f, weld *w, dmk_soup *soup)
{
    int rc = DMK_OK;
    uint32_t n = decode32(f->data + 80);
    for (uint32_t t = 0; t < n; t++) {
        const char *p = f->data + HEADER_BYTES + (size_t)t * RECORD_BYTES + 12;
        int32_t fan[2] = {0, 0};
        for (size_t k = 0; k < 3; k++) {
            double x[3];
            for (int i = 0; i < 3; i++, p += 4) {
                uint32_t bits = decode32(p);
                float value;
                memcpy(&value, &bits, sizeof value);
                x[i] = (double)value;
            }
            DMK_TRY(add_corner(ctx, w, soup, k, fan, x));
        }
    }
done:
    return rc;
}

/* Corners are counted from one "outer loop" to the next; titles and normals are skipped. */
static int read_text(dmk_text *t, weld *w, dmk_soup *soup)
{
    int rc = DMK_OK;
    size_t place = 0;
    int32_t fan[2] = {0, 0};
    while (dmk_text_seek(t)) {
        size_t n = dmk_text_word(t);
        if (is_word(t->at, n, "vertex")) {
            double x[3];
            t->at += 6;
            for (int i = 0; i < 3; i++) {
                dmk_text_seek(t);
                DMK_TRY(dmk_text_number(t, "a vertex coordinate", &x[i]));
            }
            DMK_TRY(add_corner(t->context, w, soup, place++, fan, x));
        } else if (is_word(t->at, n, "endloop") && place < 3) {
            rc = dmk_text_fail(t, "a facet with %zu corners; remove it", place);
            goto done;
        } else if (is_word(t->at, n, "loop")) {
            place = 0;
            t->at += 4;
        } else if (is_word(t->at, n, "solid") || is_word(t->at, n, "endsolid")) {
            dmk_text_skip_line(t);
        } else {
            t->at += n ? n : 1;
        }
    }
done:
    return rc;
}

int dmk_stl_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    weld w = {0};
    dmk_text t;
    DMK_TRY(dmk_text_open(ctx, file, &t));
    rc = is_binary(file) ? read_binary(ctx, file, &w, soup) : read_text(&t, &w, soup);
    if (rc == DMK_OK && soup->n_triangles == 0) {
        rc = dmk_fail(ctx, DMK_E_FORMAT,
                      "%s: no facet in it: not STL, or a binary file that is cut short",
                      file->path);
    }
done:
    dmk_text_close(&t);
    free(w.slot);
    return rc;
}
