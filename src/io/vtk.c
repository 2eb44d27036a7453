#include "io/vtk.h"

#include "io/values.h"

#include <errno.h>
#include <string.h>

static const struct {
    const char *name;
    size_t bytes;
} types[] = {[DMK_VTK_UINT8] = {"UInt8", 1},
             [DMK_VTK_INT32] = {"Int32", 4},
             [DMK_VTK_INT64] = {"Int64", 8},
             [DMK_VTK_FLOAT64] = {"Float64", 8}};

void dmk_vtk_head(dmk_output *out, const char *kind, const char *attributes)
{
    dmk_output_text(out, "<?xml version=\"1.0\"?>\n<VTKFile type=\"");
    dmk_output_text(out, kind);
    dmk_output_text(out, "\" version=\"1.0\" byte_order=\"");
    dmk_output_text(out, dmk_is_little_endian() ? "LittleEndian" : "BigEndian");
    dmk_output_text(out, "\" header_type=\"UInt64\">\n<");
    dmk_output_text(out, kind);
    dmk_output_text(out, attributes);
    dmk_output_text(out, ">\n");
}

void dmk_vtk_begin(dmk_vtk *vtk, dmk_output *out, const char *kind)
{
    memset(vtk, 0, sizeof *vtk);
    vtk->out = out;
    vtk->kind = kind;
    dmk_vtk_head(out, kind, "");
}

void dmk_vtk_end(dmk_vtk *vtk)
{
    dmk_output_text(vtk->out, "</");
    dmk_output_text(vtk->out, vtk->kind);
    dmk_output_text(vtk->out, ">\n<AppendedData encoding=\"raw\">\n_");
    for (int i = 0; i < vtk->n_arrays; i++) {
        dmk_output_put(vtk->out, &vtk->bytes[i], sizeof vtk->bytes[i]);
        dmk_output_put(vtk->out, vtk->data[i], vtk->bytes[i]);
    }
    dmk_output_text(vtk->out, "\n</AppendedData>\n</VTKFile>\n");
}

void dmk_vtk_array(dmk_vtk *vtk, dmk_vtk_type type, const char *name, int components,
                   const void *data, size_t n)
{
    dmk_output *s = vtk->out;
    if (vtk->n_arrays == DMK_VTK_ARRAYS) {
        dmk_output_fail(s, E2BIG);
        return;
    }
    dmk_output_text(s, "<DataArray type=\"");
    dmk_output_text(s, types[type].name);
    dmk_output_text(s, "\" Name=\"");
    dmk_output_text(s, name);
    if (components > 1) { /* meshio makes columns of scalars that say 1 */
        dmk_output_text(s, "\" NumberOfComponents=\"");
        dmk_output_integer(s, components);
    }
    dmk_output_text(s, "\" NumberOfTuples=\"");
    dmk_output_integer(s, (int64_t)n);
    dmk_output_text(s, "\" format=\"appended\" offset=\"");
    dmk_output_integer(s, (int64_t)vtk->offset);
    dmk_output_text(s, "\"/>\n");
    uint64_t bytes = (uint64_t)n * (uint64_t)components * types[type].bytes;
    vtk->data[vtk->n_arrays] = data;
    vtk->bytes[vtk->n_arrays++] = bytes;
    vtk->offset += sizeof bytes + bytes;
}

void dmk_vtk_points(dmk_vtk *vtk, const double *xyz, size_t n)
{
    dmk_output_text(vtk->out, "<Points>\n");
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "Points", 3, xyz, n);
    dmk_output_text(vtk->out, "</Points>\n");
}

void dmk_vtk_cells(dmk_vtk *vtk, const char *tag, int corners, const int32_t *corner,
                   const int32_t *end, const uint8_t *cell_types, size_t n_cells)
{
    dmk_output_text(vtk->out, "<");
    dmk_output_text(vtk->out, tag);
    dmk_output_text(vtk->out, ">\n");
    /* Behind the others, meshio (5.3) would take the types of a closed surface of genus 1 for its corners. */
    if (cell_types) dmk_vtk_array(vtk, DMK_VTK_UINT8, "types", 1, cell_types, n_cells);
    dmk_vtk_array(vtk, DMK_VTK_INT32, "connectivity", 1, corner, n_cells * (size_t)corners);
    dmk_vtk_array(vtk, DMK_VTK_INT32, "offsets", 1, end, n_cells);
    dmk_output_text(vtk->out, "</");
    dmk_output_text(vtk->out, tag);
    dmk_output_text(vtk->out, ">\n");
}

/* Where a point on the mesh lies in space. */
static void locate(const dmk_mesh *m, const dmk_point *p, double xyz[3])
{
    for (int i = 0; i < 3; i++) {
        xyz[i] = 0;
        for (int k = 0; k < 3; k++) {
            xyz[i] += p->weight[k] * m->xyz[3 * (size_t)m->triangle[3 * p->triangle + k] + i];
        }
    }
}

void dmk_vtk_source(dmk_vtk *vtk, const dmk_fields *f)
{
    if (!f->mu || f->flux) return;
    locate(f->mesh, &f->source, vtk->source);
    dmk_output_text(vtk->out, "<FieldData>\n");
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "source", 3, vtk->source, 1);
    dmk_vtk_array(vtk, DMK_VTK_INT64, "source_triangle", 1, &f->source.triangle, 1);
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "source_weight", 3, f->source.weight, 1);
    dmk_output_text(vtk->out, "</FieldData>\n");
}

/* Only mu is an active scalar, so that viewers colour by it. */
void dmk_vtk_result(dmk_vtk *vtk, const dmk_fields *f)
{
    size_t n_vertices = (size_t)f->mesh->n_vertices, n_triangles = (size_t)f->mesh->n_triangles;
    if (f->plane) {
        dmk_output_text(vtk->out, "<PointData TCoords=\"plane\">\n");
        dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "plane", 2, f->plane, n_vertices);
        dmk_output_text(vtk->out, "</PointData>\n");
    }
    if (f->nearest) {
        dmk_output_text(vtk->out, "<PointData Scalars=\"distance\">\n");
        dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "distance", 1, f->distance, n_vertices);
        dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "direction", 1, f->direction, n_vertices);
        dmk_vtk_array(vtk, DMK_VTK_INT32, "nearest", 1, f->nearest, n_vertices);
        dmk_output_text(vtk->out, "</PointData>\n");
    }
    if (!f->mu) return;
    dmk_output_text(vtk->out, "<PointData>\n");
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "u", 1, f->u, n_vertices);
    if (f->distance) dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "distance", 1, f->distance, n_vertices);
    dmk_output_text(vtk->out, "</PointData>\n<CellData Scalars=\"mu\">\n");
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "mu", 1, f->mu, n_triangles);
    if (f->flux) dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "flux", 3, f->flux, n_triangles);
    if (f->acl) dmk_vtk_array(vtk, DMK_VTK_UINT8, "acl", 1, f->acl, n_triangles);
    dmk_output_text(vtk->out, "</CellData>\n");
}

int dmk_vtk_ends(dmk_context *ctx, size_t n_cells, int corners, int32_t **end)
{
    int rc;
    int32_t *e = NULL;
    DMK_TRY(DMK_NEW(ctx, e, n_cells));
    for (size_t i = 0; i < n_cells; i++) e[i] = (int32_t)(i + 1) * corners;
    *end = e;
done:
    return rc;
}
