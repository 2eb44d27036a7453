#include "io/lines.h"

#include "base/parallel.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* Bytes of a chunk: some milliseconds of work. */
enum { CHUNK = 1 << 18 };

struct dmk_chunks {
    const dmk_lines *lines;
    int32_t n;
    const char **begin;            /* n + 1 */
    size_t *count[DMK_LINE_KINDS]; /* n + 1: records before each chunk */
    atomic_bool odd;
};

/* The text of a chunk. */
static dmk_text text_of(const struct dmk_chunks *c, int32_t k)
{
    dmk_text t = *c->lines->text;
    t.at = c->begin[k];
    t.end = c->begin[k + 1];
    return t;
}

static int count_chunk(dmk_context *own, int32_t k, void *data)
{
    struct dmk_chunks *c = data;
    dmk_text t = text_of(c, k);
    while (dmk_text_seek(&t)) {
        const int kind = c->lines->kind(&t);
        if (kind == DMK_LINE_ODD) atomic_store(&c->odd, true);
        if (kind >= 0) c->count[kind][k + 1]++;
        dmk_text_skip_line(&t);
    }
    return dmk_poll(own);
}

static int take_chunk(dmk_context *own, int32_t k, void *data)
{
    struct dmk_chunks *c = data;
    dmk_text t = text_of(c, k);
    size_t i[DMK_LINE_KINDS];
    for (int kind = 0; kind < DMK_LINE_KINDS; kind++) i[kind] = c->count[kind][k];
    while (!atomic_load_explicit(&c->odd, memory_order_relaxed) && dmk_text_seek(&t)) {
        const int kind = c->lines->kind(&t);
        if (kind >= 0 && !c->lines->take(&t, kind, i[kind]++, c->lines))
            atomic_store(&c->odd, true);
        dmk_text_skip_line(&t);
    }
    return dmk_poll(own);
}

/* Chunks end behind a line end. */
static void cut(const dmk_text *t, int32_t n, const char **begin)
{
    const size_t size = (size_t)(t->end - t->at);
    begin[0] = t->at;
    for (int32_t k = 1; k < n; k++) {
        const char *at = t->at + size / (size_t)n * (size_t)k;
        if (at < begin[k - 1]) at = begin[k - 1];
        const char *line_end = memchr(at, '\n', (size_t)(t->end - at));
        begin[k] = line_end ? line_end + 1 : t->end;
    }
    begin[n] = t->end;
}

int dmk_lines_count(dmk_context *ctx, dmk_lines *lines, struct dmk_chunks **chunks, bool *plain)
{
    int rc;
    struct dmk_chunks *c = NULL;
    DMK_TRY(DMK_NEW(ctx, c, 1));
    *chunks = c;
    c->lines = lines;
    c->n = (int32_t)((size_t)(lines->text->end - lines->text->at) / CHUNK) + 1;
    atomic_init(&c->odd, false);
    DMK_TRY(DMK_NEW(ctx, c->begin, (size_t)c->n + 1));
    cut(lines->text, c->n, c->begin);
    for (int kind = 0; kind < DMK_LINE_KINDS; kind++)
        DMK_TRY(DMK_NEW(ctx, c->count[kind], (size_t)c->n + 1));
    DMK_TRY(dmk_parallel_pieces(ctx, c->n, count_chunk, c));
    for (int kind = 0; kind < DMK_LINE_KINDS; kind++) {
        for (int32_t k = 0; k < c->n; k++) c->count[kind][k + 1] += c->count[kind][k];
        lines->n[kind] = c->count[kind][c->n];
    }
    *plain = !atomic_load(&c->odd);
done:
    return rc;
}

int dmk_lines_take(dmk_context *ctx, const dmk_lines *lines, struct dmk_chunks *c, bool *plain)
{
    int rc;
    c->lines = lines;
    DMK_TRY(dmk_parallel_pieces(ctx, c->n, take_chunk, c));
    *plain = !atomic_load(&c->odd);
done:
    return rc;
}

void dmk_chunks_free(struct dmk_chunks **chunks)
{
    struct dmk_chunks *c = *chunks;
    *chunks = NULL;
    if (!c) return;
    for (int kind = 0; kind < DMK_LINE_KINDS; kind++) free(c->count[kind]);
    free(c->begin);
    free(c);
}
