/* Drawings in SVG format. */
#include "cli.h"

#include <math.h>
#include <stdlib.h>

enum { SIZE = 1000, MARGIN = 20 }; /* pixels, of the longer side and around */

typedef struct frame {
    double left, top, scale, size[2]; /* size: in pixels, the margin included */
} frame;

static frame frame_of(const double *plane, size_t n)
{
    double low[2] = {0, 0}, high[2] = {0, 0}; /* the source is at the origin */
    for (size_t i = 0; i < 2 * n; i++) {
        low[i % 2] = fmin(low[i % 2], plane[i]);
        high[i % 2] = fmax(high[i % 2], plane[i]);
    }
    const double side = fmax(high[0] - low[0], high[1] - low[1]);
    frame f = {low[0], high[1], side > 0 ? SIZE / side : 1, {0}};
    for (int k = 0; k < 2; k++) f.size[k] = f.scale * (high[k] - low[k]) + 2 * MARGIN;
    return f;
}

/* Pixels grow downwards. */
static void put_point(FILE *stream, const frame *f, char command, const double *x)
{
    fprintf(stream, "%c%.2f %.2f", command, MARGIN + f->scale * (x[0] - f->left),
            MARGIN + f->scale * (f->top - x[1]));
}

static int by_value(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* The edges of all triangles, each as its smaller and its larger vertex, in order: those inside are there twice. */
static uint64_t *sort_edges(const int32_t *triangle, size_t n_triangles)
{
    uint64_t *edge = calloc(3 * n_triangles + 2, sizeof *edge);
    if (!edge) return NULL;
    for (size_t h = 0; h < 3 * n_triangles; h++) {
        const uint32_t a = (uint32_t)triangle[h],
                       b = (uint32_t)triangle[h % 3 == 2 ? h - 2 : h + 1];
        edge[h] = a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a;
    }
    qsort(edge, 3 * n_triangles, sizeof *edge, by_value);
    return edge;
}

/* One path of the edges on the border, or of those inside. */
static void put_edges(FILE *stream, const frame *f, const uint64_t *edge, size_t n,
                      const double *plane, bool border)
{
    fprintf(stream, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"%s\" d=\"",
            border ? "#b02020" : "#9098a8", border ? "2" : "0.4");
    for (size_t i = 0; i < n; i++) {
        const bool twice = i + 1 < n && edge[i] == edge[i + 1];
        if (twice != border) {
            put_point(stream, f, 'M', plane + 2 * (edge[i] >> 32));
            put_point(stream, f, 'L', plane + 2 * (edge[i] & UINT32_MAX));
            fputc('\n', stream);
        }
        i += twice;
    }
    fputs("\"/>\n", stream);
}

int cli_draw_plane(const dmk_mesh *cut, const double *plane, const char *path)
{
    cli_file file;
    dmk_mesh_info info;
    dmk_mesh_get_info(cut, &info);
    const frame f = frame_of(plane, info.n_vertices);
    uint64_t *edge = sort_edges(dmk_mesh_triangles(cut), info.n_triangles);
    if (!edge) return cli_library_error(NULL, DMK_E_NOMEM);
    const int code = cli_file_open(path, &file);
    if (code != EXIT_OK) {
        free(edge);
        return code;
    }
    fprintf(file.stream,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %.2f %.2f\" "
            "stroke-linecap=\"round\" stroke-linejoin=\"round\">\n",
            f.size[0], f.size[1]);
    for (int border = 0; border < 2; border++)
        put_edges(file.stream, &f, edge, 3 * info.n_triangles, plane, border);
    fprintf(file.stream, "<circle cx=\"%.2f\" cy=\"%.2f\" r=\"5\"/>\n</svg>\n",
            MARGIN - f.scale * f.left, MARGIN + f.scale * f.top);
    free(edge);
    return cli_file_close(&file);
}
