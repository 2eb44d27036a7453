/* dmkcl transport: measures as files. */
#ifndef DMK_CLI_TRANSPORT_H
#define DMK_CLI_TRANSPORT_H

#include "cli.h"

typedef struct cli_measure {
    double *value; /* n_values: of vertices or triangles */
    size_t n_values;
    dmk_point *atom; /* n_atoms, with their masses */
    double *mass;
    size_t n_atoms;
    int64_t *line;       /* of the file: of each value, or of each atom; NULL: of an array */
    int64_t *old;        /* of a repaired mesh: the value in the file that each value comes from */
    bool is_free;        /* no atom has a mass */
    bool is_signed;      /* masses may be below 0 */
    dmk_measure measure; /* of these */
} cli_measure;

/* The mesh that measures are on, and how it came from its file, whose vertices and triangles they count. */
typedef struct cli_ground {
    dmk_context *context;
    const dmk_mesh *mesh;
    const dmk_repairs *did; /* zero without a repair */
    bool quiet;
} cli_ground;

/* `path` may be "uniform": the area of the mesh, spread evenly. is_signed: masses may be below 0. The exit code; free
 * in any case. */
int cli_measure_read(const cli_ground *ground, const char *path, bool is_signed,
                     cli_measure *measure);
void cli_measure_free(cli_measure *measure);
/* The line of what the library calls `kind` (vertex, triangle, atom) and *number, which becomes that of the file; 0:
 * none is known. */
int64_t cli_measure_line(const cli_measure *measure, const char *kind, int64_t *number);

#endif
