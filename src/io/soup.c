/* The vertices and triangles that a reader collects. */
#include "io/io.h"

#include <stdlib.h>
#include <string.h>

enum { POLLED = 16384 }; /* triangles from one dmk_poll to the next: a few milliseconds */

void dmk_soup_free(dmk_soup *soup)
{
    free(soup->xyz);
    free(soup->triangle);
    free(soup->fan);
    memset(soup, 0, sizeof *soup);
}

/* The last triangle is the next one of a polygon. */
static int count_fan(dmk_context *ctx, dmk_soup *soup, size_t corner)
{
    int rc = DMK_OK;
    if (corner == 3) {
        DMK_TRY(DMK_GROW(ctx, soup->fan, soup->n_fans + 1, soup->fan_room));
        soup->fan[soup->n_fans++] = (struct dmk_fan){soup->n_triangles - 2, 1};
    }
    soup->fan[soup->n_fans - 1].n++;
done:
    return rc;
}

int dmk_soup_corner(dmk_context *ctx, dmk_soup *soup, size_t corner, int32_t fan[2], int32_t vertex)
{
    if (corner >= 2) {
        int rc = DMK_GROW_TRIPLES(ctx, soup->triangle, soup->n_triangles + 1, soup->triangle_room);
        if (rc == DMK_OK && soup->n_triangles % POLLED == 0) rc = dmk_poll(ctx);
        if (rc != DMK_OK) return rc;
        int32_t *t = soup->triangle + 3 * soup->n_triangles++;
        t[0] = fan[0];
        t[1] = fan[1];
        t[2] = vertex;
        if (corner > 2) rc = count_fan(ctx, soup, corner);
        if (rc != DMK_OK) return rc;
    }
    fan[corner == 0 ? 0 : 1] = vertex;
    return DMK_OK;
}

int dmk_soup_split(dmk_context *ctx, dmk_soup *soup)
{
    int rc = DMK_OK;
    size_t room = 0;
    int32_t *corner = NULL;
    for (size_t k = 0; k < soup->n_fans; k++) {
        const struct dmk_fan *f = soup->fan + k;
        int32_t *triangle = soup->triangle + 3 * f->first;
        DMK_TRY(DMK_GROW(ctx, corner, f->n + 2, room));
        corner[0] = triangle[0];
        for (size_t i = 0; i < f->n; i++) corner[i + 1] = triangle[3 * i + 1];
        corner[f->n + 1] = triangle[3 * f->n - 1];
        DMK_TRY(dmk_polygon_split(ctx, soup->xyz, f->n + 2, corner, triangle));
    }
done:
    free(corner);
    free(soup->fan);
    soup->fan = NULL;
    soup->n_fans = soup->fan_room = 0;
    return rc;
}
