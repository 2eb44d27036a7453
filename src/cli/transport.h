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

#endif
