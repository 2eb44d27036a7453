/* The tangent cut locus: for each direction at the source, how far its geodesic stays minimal. */
#include "solve.h"

#include <math.h>
#include <stdlib.h>

static const double turn = 2 * M_PI;

typedef struct tangent_row {
    double angle; /* radians, in [0, 2 pi) */
    const dmk_locus_vertex *vertex;
} tangent_row;

static int by_angle(const void *a, const void *b)
{
    const tangent_row *x = a, *y = b;
    if (x->angle != y->angle) return x->angle < y->angle ? -1 : 1;
    return (x->vertex > y->vertex) - (x->vertex < y->vertex);
}

/* Two rows for each vertex: the outermost of the minimal geodesics that meet there. */
static void fill(const dmk_locus_vertex *vertex, size_t n, tangent_row *row)
{
    for (size_t i = 0; i < 2 * n; i++) {
        row[i].vertex = &vertex[i / 2];
        row[i].angle = fmod(row[i].vertex->angle[i % 2], turn);
        if (row[i].angle < 0) row[i].angle += turn;
        if (row[i].angle >= turn) row[i].angle = 0; /* of -1e-17 the sum is rounded to a turn */
    }
}

int solve_tangent(const dmk_locus *locus, const char *path)
{
    size_t n;
    const dmk_locus_vertex *vertex = dmk_locus_vertices(locus, &n);
    tangent_row *row = calloc(2 * n + 1, sizeof *row);
    if (!row) return cli_library_error(NULL, DMK_E_NOMEM);
    fill(vertex, n, row);
    qsort(row, 2 * n, sizeof *row, by_angle);
    cli_file file;
    int code = cli_file_open(path, &file);
    if (code == EXIT_OK) {
        fprintf(file.stream, "angle,time,x,y,z,kind\n");
        for (size_t i = 0; i < 2 * n; i++) {
            const dmk_locus_vertex *v = row[i].vertex;
            fprintf(file.stream, "%.17g,%.17g,%.17g,%.17g,%.17g,%d\n", row[i].angle, v->distance,
                    v->xyz[0], v->xyz[1], v->xyz[2], (int)v->kind);
        }
        code = cli_file_close(&file);
    }
    free(row);
    return code;
}
