/* The vertices and triangles that a reader collects. */
#include "io/io.h"

#include <stdlib.h>
#include <string.h>

enum { POLLED = 16384 }; /* triangles from one dmk_poll to the next: a few milliseconds */

void dmk_soup_free(dmk_soup *soup)
{
    free(soup->xyz);
    free(soup->triangle);
    memset(soup, 0, sizeof *soup);
}

/* Room for one more triangle at least. */
static int grow(dmk_context *ctx, dmk_soup *soup)
{
    if (soup->n_triangles < soup->triangle_room) return DMK_OK;
    size_t room = soup->triangle_room < 1024 ? 1024 : 2 * soup->triangle_room;
    int32_t *bigger = realloc(soup->triangle, 3 * room * sizeof *bigger);
    if (!bigger) {
        return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: %zu triangles of the file", room);
    }
    soup->triangle = bigger;
    soup->triangle_room = room;
    return DMK_OK;
}

int dmk_soup_corner(dmk_context *ctx, dmk_soup *soup, size_t corner, int32_t fan[2], int32_t vertex)
{
    if (corner >= 2) {
        int rc = grow(ctx, soup);
        if (rc == DMK_OK && soup->n_triangles % POLLED == 0) rc = dmk_poll(ctx);
        if (rc != DMK_OK) return rc;
        int32_t *t = soup->triangle + 3 * soup->n_triangles++;
        t[0] = fan[0];
        t[1] = fan[1];
        t[2] = vertex;
    }
    fan[corner == 0 ? 0 : 1] = vertex;
    return DMK_OK;
}
