#include "io/vtk_array.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

typedef struct reader {
    dmk_context *context;
    const dmk_file *file;
    const dmk_vtk_coding *coding;
    const dmk_vtk_values *values;
    const char *what;
} reader;

static int fail(const reader *r, const char *why)
{
    return dmk_fail(r->context, DMK_E_FORMAT, "%s: %s: %s", r->file->path, r->what, why);
}

static const char cut_short[] = "fewer bytes than it should have; the file is cut short or damaged";

/* ---- bytes, raw or as base64 ---- */

typedef struct stream {
    const char *at, *end;
    bool base64;
    unsigned char held[3]; /* decoded and not yet taken: the last n_held of the three */
    int n_held;
} stream;

static int digit_value(char c)
{
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : c == '=' ? 64 : -1;
}

/* Decode four digits into up to three bytes. Each piece that a writer encoded for itself ends with
 * its own '='. */
static bool refill(stream *s)
{
    uint32_t bits = 0;
    int n = 0, n_fill = 0;
    for (; n < 4 && s->at < s->end; s->at++) {
        const int value = digit_value(*s->at);
        if (value < 0 && (*s->at == ' ' || *s->at == '\n' || *s->at == '\r' || *s->at == '\t')) {
            continue;
        }
        if (value < 0 || (n_fill > 0 && value < 64)) return false;
        n_fill += value == 64;
        bits = bits << 6 | ((uint32_t)value & 63);
        n++;
    }
    if (n < 4 || n_fill > 2) return false;
    s->n_held = 3 - n_fill;
    bits >>= 8 * n_fill;
    for (int i = 2; i >= n_fill; i--, bits >>= 8) s->held[i] = (unsigned char)bits;
    return true;
}

static bool take(stream *s, void *to, size_t n)
{
    char *out = to;
    if (!s->base64) {
        if (n > (size_t)(s->end - s->at)) return false;
        memcpy(out, s->at, n);
        s->at += n;
        return true;
    }
    for (size_t i = 0; i < n; i++) {
        if (s->n_held == 0 && !refill(s)) return false;
        out[i] = (char)s->held[3 - s->n_held--];
    }
    return true;
}

/* No more bytes than this can follow. */
static size_t most_left(const stream *s)
{
    const size_t n = (size_t)(s->end - s->at);
    return s->base64 ? n / 4 * 3 + 3 : n;
}

static int open_stream(const reader *r, stream *s)
{
    const dmk_vtk_values *v = r->values;
    const dmk_vtk_coding *c = r->coding;
    *s = (stream){.at = v->at, .end = v->end, .base64 = true};
    if (v->storage != DMK_VTK_APPENDED) return DMK_OK;
    if (!c->appended) return fail(r, "appended data is referenced but missing");
    s->base64 = c->appended_base64;
    s->end = r->file->data + r->file->size;
    if (v->offset > (uint64_t)(s->end - c->appended)) return fail(r, cut_short);
    s->at = c->appended + v->offset;
    return DMK_OK;
}

static int take_sizes(const reader *r, stream *s, size_t n, uint64_t *size)
{
    char bytes[8];
    for (size_t i = 0; i < n; i++) {
        if (!take(s, bytes, dmk_type_bytes(r->coding->header_type))) return fail(r, cut_short);
        const int64_t x = dmk_decode_integer(r->coding->header_type, bytes, r->coding->swap);
        if (x < 0) return fail(r, "a size beyond all bounds; the file is damaged");
        size[i] = (uint64_t)x;
    }
    return DMK_OK;
}

/* ---- whole arrays ---- */

static int fail_size(const reader *r, uint64_t there, uint64_t wanted)
{
    return dmk_fail(r->context, DMK_E_FORMAT,
                    "%s: %s: %llu bytes where there should be %llu; the file is damaged",
                    r->file->path, r->what, (unsigned long long)there, (unsigned long long)wanted);
}

static int read_plain(const reader *r, stream *s, size_t bytes, char **data)
{
    int rc;
    uint64_t size = 0;
    DMK_TRY(take_sizes(r, s, 1, &size));
    if (size != bytes) return fail_size(r, size, bytes);
    if (bytes > most_left(s)) return fail(r, cut_short);
    DMK_TRY(DMK_NEW(r->context, *data, bytes));
    if (!take(s, *data, bytes)) rc = fail(r, cut_short);
done:
    return rc;
}

static int unpack_block(const reader *r, stream *s, uint64_t packed, char *to, uint64_t size)
{
    int rc;
    char *block = NULL;
    uLongf n = (uLongf)size;
    if (packed > most_left(s)) return fail(r, cut_short);
    DMK_TRY(DMK_NEW(r->context, block, (size_t)packed));
    if (!take(s, block, (size_t)packed)) {
        rc = fail(r, cut_short);
    } else {
        const int status = uncompress((Bytef *)to, &n, (const Bytef *)block, (uLong)packed);
        if (status == Z_MEM_ERROR) {
            rc = dmk_fail(r->context, DMK_E_NOMEM, "out of memory: unpacking");
        } else if (status != Z_OK || n != size) {
            rc = fail(r, "cannot be unpacked; the file is damaged");
        }
    }
done:
    free(block);
    return rc;
}

/* The number of blocks, the size of all but the last, that of the last (0: as the others), the
 * packed size of each, and then the blocks. */
static int read_packed(const reader *r, stream *s, size_t bytes, char **data)
{
    int rc;
    uint64_t head[3] = {0}, *packed = NULL;
    DMK_TRY(take_sizes(r, s, 1, head));
    if (head[0] == 0) return bytes == 0 ? DMK_NEW(r->context, *data, 0) : fail(r, cut_short);
    DMK_TRY(take_sizes(r, s, 2, head + 1));
    const uint64_t n = head[0], size = head[1], last = head[2] ? head[2] : size;
    if (n > most_left(s) / dmk_type_bytes(r->coding->header_type)) return fail(r, cut_short);
    if (last > bytes || (n > 1 && size > (bytes - last) / (n - 1)) ||
        (n - 1) * (n > 1 ? size : 0) + last != bytes) {
        return fail(r, "blocks that do not make up the array; the file is damaged");
    }
    if (bytes / 2000 > most_left(s)) return fail(r, cut_short); /* zlib packs 1032 to 1 at best */
    DMK_TRY(DMK_NEW(r->context, packed, (size_t)n));
    DMK_TRY(DMK_NEW(r->context, *data, bytes));
    DMK_TRY(take_sizes(r, s, (size_t)n, packed));
    for (uint64_t b = 0; b < n; b++) {
        DMK_TRY(unpack_block(r, s, packed[b], *data + b * size, b + 1 < n ? size : last));
    }
done:
    free(packed);
    return rc;
}

static int read_bytes(const reader *r, size_t n, char **data)
{
    int rc;
    stream s;
    const size_t size = dmk_type_bytes(r->values->type);
    if (n > SIZE_MAX / 16) return fail(r, "a count beyond all bounds");
    DMK_TRY(open_stream(r, &s));
    rc = (r->coding->packed ? read_packed : read_plain)(r, &s, n * size, data);
done:
    return rc;
}

static int open_text(const reader *r, size_t n, dmk_text *t)
{
    int rc = dmk_text_open(r->context, r->file, t);
    t->at = r->values->at;
    t->end = r->values->end;
    if (rc == DMK_OK && n > ((size_t)(t->end - t->at) + 1) / 2) {
        rc = dmk_text_fail(t,
                           "%s: %zu numbers do not fit into the %td bytes that follow; the file "
                           "is cut short or its counts are wrong",
                           r->what, n, t->end - t->at);
    }
    return rc;
}

/* The array's numbers as a position to read them from: its text, or its bytes unpacked into *data. */
static int open_values(const reader *r, size_t n, dmk_values *in, char **data)
{
    int rc;
    *in = (dmk_values){.binary = r->values->storage != DMK_VTK_TEXT, .swap = r->coding->swap};
    if (!in->binary) return open_text(r, n, &in->text);
    DMK_TRY(read_bytes(r, n, data));
    in->text.at = *data;
    in->text.end = *data + n * dmk_type_bytes(r->values->type);
done:
    return rc;
}

static void close_values(dmk_values *in, char *data)
{
    if (!in->binary) dmk_text_close(&in->text);
    free(data);
}

int dmk_vtk_read_numbers(dmk_context *ctx, const dmk_file *file, const dmk_vtk_coding *coding,
                         const dmk_vtk_values *values, const char *what, size_t n, double **number)
{
    int rc;
    char *data = NULL;
    dmk_values in;
    const reader r = {ctx, file, coding, values, what};
    DMK_TRY(open_values(&r, n, &in, &data));
    DMK_TRY(DMK_NEW(ctx, *number, n));
    for (size_t i = 0; i < n; i++) DMK_TRY(dmk_values_number(&in, values->type, what, *number + i));
done:
    close_values(&in, data);
    return rc;
}

int dmk_vtk_read_integers(dmk_context *ctx, const dmk_file *file, const dmk_vtk_coding *coding,
                          const dmk_vtk_values *values, const char *what, size_t n,
                          int64_t **integer)
{
    int rc;
    char *data = NULL;
    dmk_values in;
    const reader r = {ctx, file, coding, values, what};
    DMK_TRY(open_values(&r, n, &in, &data));
    DMK_TRY(DMK_NEW(ctx, *integer, n));
    for (size_t i = 0; i < n; i++)
        DMK_TRY(dmk_values_integer(&in, values->type, what, *integer + i));
done:
    close_values(&in, data);
    return rc;
}
