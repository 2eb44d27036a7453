/* A mesh file read by several ranks; see dealt.h. */
#include "io/dealt.h"

#include "base/parallel.h"
#include "mesh/mesh.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* The longest header that is looked through; those of common writers have some 1 kB. */
enum { HEAD = 65536 };

/* ---- ranges of a file ------------------------------------------------------------------------- */

typedef struct source {
    dmk_context *context;
    int fd;
    uint64_t size;  /* of the file */
    uint64_t bytes; /* that have been read */
} source;

/* Without a message: what cannot be read so is read by other means. */
static bool read_bytes(source *s, uint64_t from, size_t n, char *to)
{
    while (n > 0) {
        const ssize_t got = pread(s->fd, to, n, (off_t)from);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        from += (uint64_t)got;
        to += got;
        n -= (size_t)got;
        s->bytes += (uint64_t)got;
    }
    return true;
}

static bool open_source(source *s, const char *path)
{
    struct stat st;
    s->fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (s->fd < 0 || fstat(s->fd, &st) != 0 || !S_ISREG(st.st_mode)) return false;
    s->size = (uint64_t)st.st_size;
    return true;
}

/* Records begin .. end - 1 of columns of one stride, as they stand in the file. */
typedef struct window {
    char *data;
    uint64_t at; /* in the file */
} window;

static bool read_window(source *s, int n, const dmk_column *column, size_t begin, size_t end,
                        window *w)
{
    uint64_t first = UINT64_MAX, last = 0;
    *w = (window){0};
    if (begin == end) return true;
    for (int k = 0; k < n; k++) {
        const dmk_column *c = &column[k];
        const uint64_t to = c->at + (end - 1) * c->stride + dmk_type_bytes(c->type);
        if (c->at + begin * c->stride < first) first = c->at + begin * c->stride;
        if (to > last) last = to;
    }
    w->at = first;
    if (last > s->size || DMK_NEW(s->context, w->data, last - first) != DMK_OK) return false;
    return read_bytes(s, first, last - first, w->data);
}

static const char *in_window(const window *w, const dmk_column *c, size_t i)
{
    return w->data + (c->at + i * c->stride - w->at);
}

/* ---- own vertices and triangles ---------------------------------------------------------------- */

/* Rank r's records of n are first_of(r) .. first_of(r + 1) - 1. */
static size_t first_of(const dmk_ranks *ranks, int r, size_t n)
{
    return (size_t)dmk_even_bound((int64_t)n, r, ranks->size);
}

typedef struct range {
    size_t begin, end;
} range;

static range own_range(const dmk_ranks *ranks, size_t n)
{
    return (range){first_of(ranks, ranks->rank, n), first_of(ranks, ranks->rank + 1, n)};
}

static bool passes(const window *w, const dmk_layout *l, const dmk_column_check *c, range own)
{
    bool good = true;
    for (size_t i = own.begin; i < own.end && good; i++) {
        good = dmk_decode_integer(c->column.type, in_window(w, &c->column, i), l->swap) ==
               c->first + (int64_t)i * c->step;
    }
    return good;
}

/* What stands among the corners is read with them. */
static bool is_among_corners(const dmk_layout *l, const dmk_column_check *c)
{
    return c->n == l->n_triangles && c->column.stride == l->corner[0].stride;
}

static bool read_check(source *s, const dmk_layout *l, const dmk_column_check *c, range own)
{
    window w;
    const bool good =
        read_window(s, 1, &c->column, own.begin, own.end, &w) && passes(&w, l, c, own);
    free(w.data);
    return good;
}

static bool read_vertices(source *s, const dmk_layout *l, range own, double *xyz)
{
    window w;
    const bool good = read_window(s, 3, l->xyz, own.begin, own.end, &w);
    for (size_t i = own.begin; i < own.end && good; i++) {
        for (int k = 0; k < 3; k++)
            *xyz++ = dmk_decode_number(l->xyz[k].type, in_window(&w, &l->xyz[k], i), l->swap);
    }
    free(w.data);
    return good;
}

static bool read_triangles(source *s, const dmk_layout *l, range own, int64_t *triangle)
{
    window w;
    dmk_column column[3 + DMK_LAYOUT_CHECKS];
    int n = 3;
    memcpy(column, l->corner, sizeof l->corner);
    for (int k = 0; k < l->n_checks; k++)
        if (is_among_corners(l, &l->check[k])) column[n++] = l->check[k].column;
    bool good = read_window(s, n, column, own.begin, own.end, &w);
    for (int k = 0; k < l->n_checks && good; k++)
        good = !is_among_corners(l, &l->check[k]) || passes(&w, l, &l->check[k], own);
    for (size_t i = own.begin; i < own.end && good; i++) {
        for (int k = 0; k < 3; k++) {
            const char *at = in_window(&w, &l->corner[k], i);
            const double v = dmk_decode_number(l->corner[k].type, at, l->swap);
            good = good && v >= 0 && v < (double)l->n_vertices && v == (double)(int64_t)v;
            *triangle++ = good ? (int64_t)v : 0;
        }
    }
    free(w.data);
    return good;
}

/* Room for the own range, and what stands there; false where it is not as it should be. */
static bool read_own(source *s, const dmk_layout *l, const dmk_ranks *ranks, dmk_dealt *own)
{
    const range vertices = own_range(ranks, l->n_vertices),
                triangles = own_range(ranks, l->n_triangles);
    for (int k = 0; k < l->n_checks; k++) {
        const dmk_column_check *c = &l->check[k];
        if (!is_among_corners(l, c) && !read_check(s, l, c, own_range(ranks, c->n))) return false;
    }
    own->n_vertices = vertices.end - vertices.begin;
    own->n_triangles = triangles.end - triangles.begin;
    return DMK_NEW(s->context, own->xyz, 3 * own->n_vertices) == DMK_OK &&
           DMK_NEW(s->context, own->triangle, 3 * own->n_triangles) == DMK_OK &&
           read_vertices(s, l, vertices, own->xyz) &&
           read_triangles(s, l, triangles, own->triangle);
}

static bool find_layout(source *s, const char *path, dmk_layout *l)
{
    dmk_file head = {.path = path};
    bool found = false;
    if (!open_source(s, path)) return false;
    head.size = s->size < HEAD ? (size_t)s->size : HEAD;
    if (DMK_NEW(s->context, head.data, head.size + 1) == DMK_OK &&
        read_bytes(s, 0, head.size, head.data)) {
        found = dmk_ply_sniff(&head)   ? dmk_ply_layout(s->context, &head, l)
                : dmk_vtk_sniff(&head) ? dmk_vtk_layout(s->context, &head, l)
                                       : false;
    }
    dmk_file_free(&head);
    return found && l->n_triangles > 0;
}

/* ---- all ranks together ------------------------------------------------------------------------ */

/* Counts of a layout: of files larger than any mesh here may be, too. */
typedef struct counts {
    uint64_t vertices, triangles; /* 0: no layout */
} counts;

/* Whether all ranks see the same layout. Of more than a mesh may have nothing is read. */
static int agree_on_layout(dmk_context *ctx, const char *path, const dmk_ranks *ranks, bool found,
                           const dmk_layout *l, bool *all)
{
    int rc;
    const counts own = {found ? l->n_vertices : 0, found ? l->n_triangles : 0};
    counts *seen = NULL;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, seen, (size_t)ranks->size));
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)ranks->size));
    for (int r = 0; r < ranks->size; r++) bytes[r] = sizeof own;
    DMK_TRY(dmk_ranks_check(ctx, ranks, ranks->gather(ranks->user, &own, seen, bytes)));
    *all = true;
    for (int r = 0; r < ranks->size; r++)
        *all = *all && seen[r].triangles > 0 && !memcmp(&seen[r], &seen[0], sizeof *seen);
    if (*all) rc = dmk_mesh_check_counts(ctx, l->n_vertices, l->n_triangles);
    if (rc != DMK_OK) rc = dmk_name_file(ctx, path, rc);
done:
    free(seen);
    free(bytes);
    return rc;
}

/* Whether it is so on all ranks. */
static int agree(dmk_context *ctx, const dmk_ranks *ranks, bool good, bool *all)
{
    int32_t bad = !good;
    const int rc = dmk_ranks_check(ctx, ranks, ranks->largest(ranks->user, &bad, 1));
    *all = bad == 0;
    return rc;
}

/* 3 numbers of `item` bytes for each of n records: everybody's one after the other. */
static int join(dmk_context *ctx, const dmk_ranks *ranks, size_t n, size_t item, const void *mine,
                void *all)
{
    int rc;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)ranks->size));
    for (int r = 0; r < ranks->size; r++)
        bytes[r] = 3 * item * (first_of(ranks, r + 1, n) - first_of(ranks, r, n));
    rc = dmk_ranks_check(ctx, ranks, ranks->gather(ranks->user, mine, all, bytes));
done:
    free(bytes);
    return rc;
}

static int make_room(dmk_context *ctx, size_t n_vertices, size_t n_triangles, dmk_soup *soup)
{
    int rc;
    soup->n_vertices = n_vertices;
    soup->n_triangles = soup->triangle_room = n_triangles;
    DMK_TRY(DMK_NEW(ctx, soup->xyz, 3 * n_vertices));
    DMK_TRY(DMK_NEW(ctx, soup->triangle, 3 * n_triangles));
done:
    return rc;
}

/* The first rank's data to all. */
static int spread(dmk_context *ctx, const dmk_ranks *ranks, const void *mine, void *all, size_t n)
{
    int rc;
    size_t *bytes = NULL;
    DMK_TRY(DMK_NEW(ctx, bytes, (size_t)ranks->size));
    bytes[0] = n;
    rc = dmk_ranks_check(ctx, ranks, ranks->gather(ranks->user, mine, all, bytes));
done:
    free(bytes);
    return rc;
}

/* How the first rank's reading went. */
typedef struct news {
    int64_t rc, n_vertices, n_triangles;
    char message[sizeof((dmk_context *)0)->message];
} news;

/* What has no layout: the first rank's soup, or its failure. */
static int read_once(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_soup *soup,
                     uint64_t *bytes)
{
    int rc;
    dmk_soup first = {0};
    news mine = {0}, said = {0};
    if (ranks->rank == 0) {
        mine.rc = dmk_soup_read(ctx, path, &first, bytes);
        mine.n_vertices = (int64_t)first.n_vertices;
        mine.n_triangles = (int64_t)first.n_triangles;
        memcpy(mine.message, ctx->message, sizeof mine.message);
    }
    DMK_TRY(spread(ctx, ranks, &mine, &said, sizeof said));
    if (said.rc != DMK_OK) {
        rc = dmk_fail(ctx, (int)said.rc, "%s", said.message);
        goto done;
    }
    DMK_TRY(make_room(ctx, (size_t)said.n_vertices, (size_t)said.n_triangles, soup));
    DMK_TRY(spread(ctx, ranks, first.xyz, soup->xyz, 3 * soup->n_vertices * sizeof *soup->xyz));
    rc = spread(ctx, ranks, first.triangle, soup->triangle,
                3 * soup->n_triangles * sizeof *soup->triangle);
done:
    dmk_soup_free(&first);
    return rc;
}

static void dealt_free(dmk_dealt *own)
{
    free(own->xyz);
    free(own->triangle);
    *own = (dmk_dealt){0};
}

int dmk_dealt_read(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_dealt *own,
                   uint64_t *bytes, bool *all)
{
    int rc;
    dmk_layout l = {0};
    source s = {.context = ctx, .fd = -1};
    bool good = find_layout(&s, path, &l);
    DMK_TRY(agree_on_layout(ctx, path, ranks, good, &l, all));
    good = *all && read_own(&s, &l, ranks, own);
    own->all_vertices = l.n_vertices;
    own->all_triangles = l.n_triangles;
    *bytes = s.bytes;
    rc = agree(ctx, ranks, good, all);
done:
    if (s.fd >= 0) close(s.fd);
    if (rc != DMK_OK || !*all) dealt_free(own);
    return rc;
}

/* Own triangles as all of them have them. */
static int narrow(dmk_context *ctx, const dmk_dealt *own, int32_t **triangle)
{
    int rc;
    DMK_TRY(DMK_NEW(ctx, *triangle, 3 * own->n_triangles));
    for (size_t i = 0; i < 3 * own->n_triangles; i++) (*triangle)[i] = (int32_t)own->triangle[i];
done:
    return rc;
}

int dmk_soup_read_dealt(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_soup *soup,
                        uint64_t *bytes)
{
    int rc;
    bool all;
    dmk_dealt own = {0};
    int32_t *triangle = NULL;
    DMK_TRY(dmk_dealt_read(ctx, path, ranks, &own, bytes, &all));
    if (!all) {
        rc = read_once(ctx, path, ranks, soup, bytes);
        goto done;
    }
    DMK_TRY(narrow(ctx, &own, &triangle));
    DMK_TRY(make_room(ctx, own.all_vertices, own.all_triangles, soup));
    DMK_TRY(join(ctx, ranks, own.all_vertices, sizeof *own.xyz, own.xyz, soup->xyz));
    rc = join(ctx, ranks, own.all_triangles, sizeof *triangle, triangle, soup->triangle);
done:
    free(triangle);
    dealt_free(&own);
    return rc;
}

int dmk_mesh_read_dealt(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_mesh **mesh)
{
    int rc;
    uint64_t bytes = 0;
    dmk_soup soup = {0};
    if (dmk_missing(ctx, "path", path, "mesh", mesh)) return DMK_E_ARG;
    if (ranks && dmk_ranks_given(ctx, ranks) != DMK_OK) return DMK_E_ARG;
    if (!ranks || ranks->size == 1) return dmk_mesh_read(ctx, path, mesh);
    DMK_TRY(dmk_stage_begin(ctx, "read"));
    DMK_TRY(dmk_soup_read_dealt(ctx, path, ranks, &soup, &bytes));
    rc = dmk_soup_adopt(ctx, path, ranks, &soup, mesh);
done:
    dmk_stage_end(ctx);
    dmk_soup_free(&soup);
    return rc;
}
