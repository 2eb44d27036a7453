/* STL, text and binary: triangles without shared vertices. Corners at exactly the same position become
 * one vertex (-0 and 0 are the same); vertices are numbered as they first appear. */
#include "io/io.h"

#include <stdlib.h>
#include <string.h>

#define HEADER_BYTES 84 /* 80 of title, then the number of triangles */
#define RECORD_BYTES 50 /* normal and corners as 12 floats, 2 of attributes */

static uint32_t decode32(const char *p)
{
    const unsigned char *b = (const unsigned char *)p;
    return (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

static uint64_t binary_size(const dmk_file *f)
{
    return HEADER_BYTES + (uint64_t)RECORD_BYTES * decode32(f->data + 80);
}

/* The size gives binary files away; some of them begin with "solid" as text does, or as other formats. */
bool dmk_stl_is_binary(const dmk_file *f)
{
    return f->size >= HEADER_BYTES && f->size == binary_size(f);
}

bool dmk_stl_sniff(const dmk_file *f)
{
    dmk_text t = dmk_text_of(f);
    return dmk_stl_is_binary(f) || (dmk_text_seek(&t) && dmk_text_is_in_any_case(&t, "solid"));
}

/* ---- corners, each a vertex until they are welded ---- */

typedef struct corners {
    dmk_soup *soup;
    size_t room; /* of soup->xyz, in vertices */
} corners;

static int corners_grow(dmk_context *ctx, corners *c, size_t n)
{
    if (n <= INT32_MAX) return DMK_GROW_TRIPLES(ctx, c->soup->xyz, n, c->room);
    return dmk_fail(ctx, DMK_E_MESH, "more than %d corners of triangles", INT32_MAX);
}

static int add_corner(dmk_context *ctx, corners *c, size_t corner, int32_t fan[2],
                      const double x[3])
{
    int rc = DMK_OK;
    dmk_soup *soup = c->soup;
    DMK_TRY(corners_grow(ctx, c, soup->n_vertices + 1));
    memcpy(soup->xyz + 3 * soup->n_vertices, x, 3 * sizeof *x);
    rc = dmk_soup_corner(ctx, soup, corner, fan, (int32_t)soup->n_vertices++);
done:
    return rc;
}

/* ---- the two kinds ---- */

static int read_binary(dmk_context *ctx, const dmk_file *f, corners *c)
{
    int rc = DMK_OK;
    uint32_t n = decode32(f->data + 80);
    DMK_TRY(corners_grow(ctx, c, 3 * (size_t)n));
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
            DMK_TRY(add_corner(ctx, c, k, fan, x));
        }
    }
done:
    return rc;
}

/* Corners are counted from one "outer loop" to the next; titles and normals are skipped. Nothing but the last word
 * tells a whole file from one that was cut short. */
static int read_text(dmk_text *t, corners *c)
{
    int rc = DMK_OK;
    bool ended = true;
    size_t corner = 0;
    int32_t fan[2] = {0, 0};
    while (dmk_text_seek(t)) {
        size_t n = dmk_text_word(t);
        if (dmk_text_is_in_any_case(t, "vertex")) {
            double x[3];
            t->at += 6;
            for (int i = 0; i < 3; i++) {
                dmk_text_seek(t);
                DMK_TRY(dmk_text_number(t, "a vertex coordinate", &x[i]));
            }
            DMK_TRY(add_corner(t->context, c, corner++, fan, x));
        } else if (dmk_text_is_in_any_case(t, "endloop") && corner < 3) {
            rc = dmk_text_fail(t, "a facet with %zu corners; remove it", corner);
            goto done;
        } else if (dmk_text_is_in_any_case(t, "loop")) {
            corner = 0;
            ended = false;
            t->at += 4;
        } else if (dmk_text_is_in_any_case(t, "solid") || dmk_text_is_in_any_case(t, "endsolid")) {
            ended = ended || n > strlen("solid");
            dmk_text_skip_line(t);
        } else {
            t->at += n ? n : 1;
        }
    }
    if (!ended) rc = dmk_text_fail(t, "the file ends before endsolid; it is cut short");
done:
    return rc;
}

/* Nothing in it was read as text; no text has a byte 0. */
static int refuse(dmk_context *ctx, const dmk_file *f)
{
    if (dmk_stl_is_binary(f) || f->size < HEADER_BYTES || !memchr(f->data, '\0', f->size))
        return dmk_fail(ctx, DMK_E_FORMAT, "%s: contains no facets: not a mesh in STL format",
                        f->path);
    return dmk_fail(
        ctx, DMK_E_FORMAT,
        "%s: %zu bytes, but binary STL of %lu facets has %llu; the file is cut short or "
        "lengthened, or its count is wrong",
        f->path, f->size, (unsigned long)decode32(f->data + 80),
        (unsigned long long)binary_size(f));
}

int dmk_stl_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    corners c = {.soup = soup};
    dmk_text t;
    DMK_TRY(dmk_text_open(ctx, file, &t));
    rc = dmk_stl_is_binary(file) ? read_binary(ctx, file, &c) : read_text(&t, &c);
    if (rc == DMK_OK && soup->n_triangles == 0) rc = refuse(ctx, file);
    if (rc == DMK_OK) rc = dmk_soup_weld(ctx, soup);
done:
    dmk_text_close(&t);
    return rc;
}
