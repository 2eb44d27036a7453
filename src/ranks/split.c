/* Interior and boundary of a launch: by parts, so that kernels need not know of it. */
#include "ranks/ranks.h"

#include <stdlib.h>
#include <string.h>

/* Whether a local slot holds an item of another rank. */
static bool is_ghost(const dmk_space *s, int32_t slot)
{
    const int64_t whole = dmk_space_whole(s, slot);
    return whole >= 0 && !dmk_space_owns(s, whole);
}

static int upload(dmk_context *ctx, const dmk_share *share, size_t n, const int32_t *list,
                  dmk_buffer **buffer)
{
    return dmk_buffer_create(ctx, share->device, n * sizeof *list, list, buffer);
}

/* The lists from a mark for each part. */
static int list_parts(dmk_context *ctx, const dmk_share *share, size_t n, const uint8_t *boundary,
                      dmk_split *split)
{
    int rc;
    int32_t *inner = NULL, *outer = NULL;
    DMK_TRY(DMK_NEW(ctx, inner, n));
    DMK_TRY(DMK_NEW(ctx, outer, n));
    for (size_t p = 0; p < n; p++) {
        if (boundary[p])
            outer[split->n_boundary++] = (int32_t)p;
        else
            inner[split->n_interior++] = (int32_t)p;
    }
    DMK_TRY(upload(ctx, share, split->n_interior, inner, &split->interior));
    DMK_TRY(upload(ctx, share, split->n_boundary, outer, &split->boundary));
done:
    free(inner);
    free(outer);
    return rc;
}

int dmk_split_elements(dmk_context *ctx, dmk_share *s)
{
    int rc;
    const dmk_mesh *m = &s->mesh;
    const size_t n = dmk_launch_parts(s->device, (size_t)m->n_triangles + 1); /* one of padding */
    uint8_t *boundary = NULL;
    DMK_TRY(DMK_NEW(ctx, boundary, n));
    for (int32_t t = 0; t < m->n_triangles; t++) {
        for (size_t h = 3 * (size_t)t; h < 3 * (size_t)t + 3; h++) {
            if (is_ghost(&s->vertex[0], m->triangle[h]) || is_ghost(&s->edge, m->triangle_edge[h]))
                boundary[t / s->part] = 1;
        }
    }
    rc = list_parts(ctx, s, n, boundary, &s->elements);
done:
    free(boundary);
    return rc;
}

int dmk_split_graph(dmk_context *ctx, dmk_share *s, int32_t level, int32_t n_edges,
                    const int32_t *edge)
{
    int rc;
    const dmk_space *vertex = &s->vertex[level];
    const size_t n = dmk_launch_parts(s->device, (size_t)vertex->n);
    uint8_t *boundary = NULL;
    DMK_TRY(DMK_NEW(ctx, boundary, n));
    for (int32_t k = 0; k < n_edges; k++) {
        const int32_t *end = edge + 2 * (size_t)k;
        if (!is_ghost(vertex, end[0]) && !is_ghost(vertex, end[1])) continue;
        boundary[end[0] / s->part] = boundary[end[1] / s->part] = 1;
    }
    rc = list_parts(ctx, s, n, boundary, &s->graph[level]);
done:
    free(boundary);
    return rc;
}

void dmk_split_free(dmk_split *split)
{
    dmk_buffer_destroy(&split->interior);
    dmk_buffer_destroy(&split->boundary);
    memset(split, 0, sizeof *split);
}
