/* VTK UnstructuredGrid: meshes and results as triangle cells. */
#include "io/vtk.h"

#include <stdlib.h>
#include <string.h>

#define VTK_TRIANGLE 5

int dmk_vtu_write(dmk_context *ctx, dmk_output *out, const dmk_fields *fields)
{
    int rc;
    dmk_vtk vtk;
    int32_t *end = NULL;
    uint8_t *types = NULL;
    const dmk_mesh *m = fields->mesh;
    size_t n_triangles = (size_t)m->n_triangles;
    DMK_TRY(dmk_vtk_ends(ctx, n_triangles, 3, &end));
    DMK_TRY(DMK_NEW(ctx, types, n_triangles));
    memset(types, VTK_TRIANGLE, n_triangles);
    dmk_vtk_begin(&vtk, out, "UnstructuredGrid");
    dmk_vtk_source(&vtk, fields);
    dmk_output_text(out, "<Piece NumberOfPoints=\"");
    dmk_output_integer(out, m->n_vertices);
    dmk_output_text(out, "\" NumberOfCells=\"");
    dmk_output_integer(out, m->n_triangles);
    dmk_output_text(out, "\">\n");
    dmk_vtk_result(&vtk, fields);
    dmk_vtk_points(&vtk, m->xyz, (size_t)m->n_vertices);
    dmk_vtk_cells(&vtk, "Cells", 3, m->triangle, end, types, n_triangles);
    dmk_output_text(out, "</Piece>\n");
    dmk_vtk_end(&vtk);
done:
    free(end);
    free(types);
    return rc;
}
