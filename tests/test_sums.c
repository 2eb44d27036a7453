/* Sums of more parts than are added one after the other: what ranks tell each other, sums of blocks for the most part,
 * gives the bits that one launch over all rows does. */
#include "meeting.h"
#include "solving.h"

#include "device/device.h"
#include "dmk_shared.h"
#include "ranks/ranks.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { EDGE_PARTS = 6000, VERTEX_PARTS = 2500, QUANTITIES = 2, SCALARS = 8 };

/* Partial sums of a launch over all rows, and what became of them there. */
typedef struct whole {
    dmk_device_options device;
    size_t real;
    int32_t part, n_edges, n_vertices, vertex_row, parts;
    char *dots, *range; /* 2 parts numbers: r.z and Ap.z; the maxima of u and -u */
    char beta[8 * SCALARS], ends[8 * SCALARS];
} whole;

static double number(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 16777216.0 - 0.3;
}

static dmk_buffer *vector(bench *b, dmk_program program, const whole *w, uint32_t seed)
{
    dmk_buffer *x;
    const size_t n = (size_t)w->vertex_row + (size_t)w->n_vertices,
                 padded = (n / DMK_WIDTH + 1) * DMK_WIDTH;
    double *value = calloc(padded, sizeof *value);
    assert_non_null(value);
    for (size_t i = 0; i < n; i++)
        if ((int32_t)i < w->n_edges || (int32_t)i >= w->vertex_row) value[i] = number(&seed);
    bench_ok(
        b, dmk_buffer_create(b->ctx, b->dev, padded * dmk_device_real(b->dev, program), NULL, &x));
    bench_ok(b, dmk_buffer_write_real(b->ctx, b->dev, program, x, padded, value));
    free(value);
    return x;
}

static dmk_buffer *zeros(dmk_context *ctx, dmk_device *dev, size_t bytes)
{
    dmk_buffer *x = NULL;
    void *none = calloc(bytes, 1);
    if (none && dmk_buffer_create(ctx, dev, bytes, none, &x) != DMK_OK) x = NULL;
    free(none);
    return x;
}

static dmk_kernel *kernel(bench *b, const char *name)
{
    dmk_kernel *k;
    bench_ok(b, dmk_kernel_get(b->ctx, b->dev, DMK_OUTER, name, &k));
    return k;
}

/* By one launch over all rows that adds up itself. */
static void sum_whole(bench *b, whole *w)
{
    const dmk_range rows = {.items = (size_t)(w->vertex_row + w->n_vertices)};
    const size_t table = QUANTITIES * (size_t)w->parts * w->real, state = SCALARS * w->real;
    dmk_buffer *r = vector(b, DMK_OUTER, w, 1), *ap = vector(b, DMK_OUTER, w, 2),
               *z = vector(b, DMK_INNER, w, 3), *done = zeros(b->ctx, b->dev, sizeof(int32_t)),
               *partial = zeros(b->ctx, b->dev, table), *to = zeros(b->ctx, b->dev, state);
    assert_true(dmk_launch_parts(b->dev, rows.items) == (size_t)w->parts);
    bench_ok(b, DMK_LAUNCH(b->ctx, b->dev, kernel(b, "cg_dots"), rows, DMK_INT(rows.items),
                           DMK_INT(1), DMK_BUF(r), DMK_BUF(ap), DMK_BUF(z), DMK_BUF(partial),
                           DMK_INT(1), DMK_BUF(to), DMK_BUF(done)));
    bench_ok(b, dmk_buffer_read(b->ctx, b->dev, partial, 0, table, w->dots));
    bench_ok(b, dmk_buffer_read(b->ctx, b->dev, to, 0, state, w->beta));
    bench_ok(b, DMK_LAUNCH(b->ctx, b->dev, kernel(b, "rows_range"), rows, DMK_INT(rows.items),
                           DMK_BUF(r), DMK_BUF(partial), DMK_INT(0), DMK_BUF(to), DMK_BUF(done)));
    bench_ok(b, dmk_buffer_read(b->ctx, b->dev, partial, 0, table, w->range));
    bench_ok(b, dmk_buffer_read(b->ctx, b->dev, to, 0, 2 * w->real, w->ends));
    dmk_buffer *all[] = {r, ap, z, done, partial, to};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) dmk_buffer_destroy(&all[i]);
}

/* ---- the same by ranks ------------------------------------------------------------------------ */

typedef struct seat {
    const whole *w;
    member m;
    int rc;
    bool same;
    int64_t bytes; /* that it has sent */
} seat;

/* Parts begin .. end - 1 are its own, behind `gap` parts of others. */
static int32_t own(dmk_space *space, int64_t *bound, const seat *s, int32_t n, int32_t gap)
{
    const int32_t part = s->w->part, size = s->m.all->size, parts = (n + part - 1) / part;
    for (int32_t r = 0; r <= size; r++) bound[r] = r < size ? parts * r / size * part : n;
    *space = (dmk_space){.n_whole = n, .bound = bound, .at_first = gap * part};
    space->first = bound[s->m.rank];
    space->end = bound[s->m.rank + 1];
    space->n = space->at_first + (dmk_space_own(space) + part - 1) / part * part + part;
    return space->n;
}

/* The own parts of the whole's at their places among others that are nobody's. */
static void take_parts(const dmk_share *share, const whole *w, const char *all, int32_t stride,
                       char *table)
{
    const dmk_space *space[2] = {&share->edge, &share->vertex[0]};
    const int32_t to[2] = {share->edge.at_first / w->part,
                           (share->vertex_row + share->vertex[0].at_first) / w->part};
    memset(table, 0x5a, QUANTITIES * (size_t)stride * w->real);
    for (int k = 0; k < QUANTITIES; k++) {
        for (int i = 0; i < 2; i++) {
            const int32_t begin = (i > 0 ? w->vertex_row : 0) / w->part + space[i]->first / w->part,
                          n = (space[i]->end - space[i]->first + w->part - 1) / w->part;
            memcpy(table + w->real * (size_t)(k * stride + to[i]),
                   all + w->real * (size_t)(k * w->parts + begin), w->real * (size_t)n);
        }
    }
}

static int sum_share(seat *s, dmk_context *ctx, dmk_device *dev, dmk_share *share, bool maxima)
{
    int rc = DMK_E_NOMEM;
    const whole *w = s->w;
    dmk_kernel *k;
    char got[8 * SCALARS];
    int32_t parts = (share->vertex_row + share->vertex[0].n) / w->part;
    const size_t table = QUANTITIES * (size_t)parts * w->real,
                 most = QUANTITIES * dmk_share_most_parts(share) * w->real;
    char *local = malloc(table);
    dmk_buffer *partial = zeros(ctx, dev, table > most ? table : most),
               *to = zeros(ctx, dev, SCALARS * w->real);
    if (!local || !partial || !to) goto done;
    take_parts(share, w, maxima ? w->range : w->dots, parts, local);
    DMK_TRY(dmk_buffer_write(ctx, dev, partial, 0, table, local));
    DMK_TRY(dmk_share_parts(ctx, share, DMK_ROWS, QUANTITIES, maxima ? 2 : 0, partial, &parts));
    DMK_TRY(dmk_kernel_get(ctx, dev, DMK_OUTER, maxima ? "sum_partials" : "cg_beta", &k));
    const dmk_range once = {.items = 1};
    if (maxima)
        DMK_TRY(DMK_LAUNCH(ctx, dev, k, once, DMK_INT(parts), DMK_INT(2), DMK_INT(2),
                           DMK_BUF(partial), DMK_BUF(to), DMK_INT(0)));
    else
        DMK_TRY(DMK_LAUNCH(ctx, dev, k, once, DMK_INT(parts), DMK_INT(1), DMK_BUF(partial),
                           DMK_BUF(to)));
    DMK_TRY(dmk_buffer_read(ctx, dev, to, 0, SCALARS * w->real, got));
    s->same = s->same &&
              !memcmp(got, maxima ? w->ends : w->beta, (size_t)(maxima ? 2 : SCALARS) * w->real);
done:
    free(local);
    dmk_buffer_destroy(&partial);
    dmk_buffer_destroy(&to);
    return rc;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    dmk_device *dev = NULL;
    int64_t edge[MOST_RANKS + 1], vertex[MOST_RANKS + 1];
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = dmk_device_open(ctx, &s->w->device, &dev);
    dmk_share share = {.ranks = ranks_of(&s->m, 0), .device = dev, .part = s->w->part};
    share.vertex_row = own(&share.edge, edge, s, s->w->n_edges, 3) + s->w->part;
    own(&share.vertex[0], vertex, s, s->w->n_vertices, 1);
    s->same = true;
    if (s->rc == DMK_OK) s->rc = sum_share(s, ctx, dev, &share, false);
    if (s->rc == DMK_OK) s->rc = sum_share(s, ctx, dev, &share, true);
    s->bytes = share.traffic.sum_bytes;
    if (s->rc != DMK_OK) print_message("%s\n", dmk_context_message(ctx));
    dmk_device_destroy(&dev);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void try_sums(bench *b, whole *w, int32_t edge_parts, int32_t more_edges)
{
    w->n_edges = edge_parts * w->part + more_edges;
    w->n_vertices = VERTEX_PARTS * w->part + 13;
    w->vertex_row = (w->n_edges / w->part + 1) * w->part;
    w->parts = w->vertex_row / w->part + VERTEX_PARTS + 1;
    const size_t table = QUANTITIES * (size_t)w->parts * w->real;
    w->dots = malloc(table);
    w->range = malloc(table);
    assert_true(w->dots && w->range);
    sum_whole(b, w);
    for (int size = 1; size <= MOST_RANKS; size++) {
        meeting all = {.size = size};
        seat seats[MOST_RANKS];
        for (int k = 0; k < size; k++) seats[k] = (seat){.w = w, .m = {.all = &all, .rank = k}};
        assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
        for (int k = 0; k < size; k++) {
            assert_int_equal(seats[k].rc, DMK_OK);
            assert_true(seats[k].same);
            /* Twice two quantities; at each end of a run there may be a block with others. */
            const int64_t blocks = w->parts / size / DMK_SUM_BLOCK + 4 * DMK_SUM_BLOCK + 4;
            const bool is_long = w->parts > DMK_SUM_SHORT;
            assert_true((seats[k].bytes <= 4 * (int64_t)w->real * blocks) == is_long);
        }
    }
    free(w->dots);
    free(w->range);
}

static void test_blocks(void **state)
{
    bench *b = *state;
    for (int k = 0; k < 4; k++) {
        whole w = {.device = {.struct_size = sizeof w.device,
                              .single_precision = k % 2,
                              .shape = k < 2 ? DMK_SHAPE_AUTO : DMK_SHAPE_GPU}};
        bench own_device = *b;
        bench_open(&own_device, &w.device);
        w.real = dmk_device_real(own_device.dev, DMK_OUTER);
        w.part = (int32_t)dmk_launch_part(own_device.dev);
        try_sums(&own_device, &w, EDGE_PARTS, 77);
        try_sums(&own_device, &w, EDGE_PARTS, 0); /* the part behind the edges is nobody's */
        try_sums(&own_device, &w, EDGE_PARTS / 2, 77);
        bench_close(&own_device);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_blocks)};
    return cmocka_run_group_tests_name("sums", tests, bench_setup, bench_teardown);
}
