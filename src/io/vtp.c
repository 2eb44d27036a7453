/* VTK PolyData: meshes and results as polygons, cut loci as lines (a vertex without an edge as a
 * "vert"). */
#include "io/vtk.h"

#include <stdlib.h>

static void put_piece(dmk_output *out, size_t n_points, size_t n_verts, size_t n_lines,
                      size_t n_polys)
{
    dmk_output_text(out, "<Piece NumberOfPoints=\"");
    dmk_output_integer(out, (int64_t)n_points);
    dmk_output_text(out, "\" NumberOfVerts=\"");
    dmk_output_integer(out, (int64_t)n_verts);
    dmk_output_text(out, "\" NumberOfLines=\"");
    dmk_output_integer(out, (int64_t)n_lines);
    dmk_output_text(out, "\" NumberOfStrips=\"0\" NumberOfPolys=\"");
    dmk_output_integer(out, (int64_t)n_polys);
    dmk_output_text(out, "\">\n");
}

static int write_polygons(dmk_context *ctx, dmk_output *out, const dmk_fields *fields, bool source)
{
    int rc;
    dmk_vtk vtk;
    int32_t *end = NULL;
    const dmk_mesh *m = fields->mesh;
    size_t n_triangles = (size_t)m->n_triangles;
    DMK_TRY(dmk_vtk_ends(ctx, n_triangles, 3, &end));
    dmk_vtk_begin(&vtk, out, "PolyData");
    if (source) dmk_vtk_source(&vtk, fields);
    put_piece(out, (size_t)m->n_vertices, 0, 0, n_triangles);
    dmk_vtk_result(&vtk, fields);
    dmk_vtk_points(&vtk, m->xyz, (size_t)m->n_vertices);
    dmk_vtk_cells(&vtk, "Polys", 3, m->triangle, end, NULL, n_triangles);
    dmk_output_text(out, "</Piece>\n");
    dmk_vtk_end(&vtk);
done:
    free(end);
    return rc;
}

int dmk_vtp_write(dmk_context *ctx, dmk_output *out, const dmk_fields *fields)
{
    return write_polygons(ctx, out, fields, true);
}

int dmk_vtp_write_piece(dmk_context *ctx, dmk_output *out, const dmk_fields *fields)
{
    return write_polygons(ctx, out, fields, false);
}

enum { N_COLUMNS = 7 };

/* The values of a locus by columns. Cells are the n_single vertices of degree 0, then the edges. */
typedef struct columns {
    double *value;         /* 10*n_vertices: xyz interleaved, then the columns' values */
    int32_t *kind;         /* n_vertices */
    int32_t *corner;       /* n_single + 2*n_edges: the cells' vertices */
    double *cell_strength; /* n_single + n_edges */
    size_t n_single;
} columns;

static void columns_free(columns *k)
{
    free(k->value);
    free(k->kind);
    free(k->corner);
    free(k->cell_strength);
}

static int columns_fill(dmk_context *ctx, const dmk_curves *c, columns *k)
{
    int rc;
    size_t n = c->n_vertices;
    DMK_TRY(DMK_NEW(ctx, k->value, (3 + N_COLUMNS) * n));
    DMK_TRY(DMK_NEW(ctx, k->kind, n));
    DMK_TRY(DMK_NEW(ctx, k->corner, n + 2 * c->n_edges));
    DMK_TRY(DMK_NEW(ctx, k->cell_strength, n + c->n_edges));
    for (size_t v = 0; v < n; v++) {
        const dmk_locus_vertex *x = &c->vertex[v];
        const double scalar[N_COLUMNS] = {x->distance,      x->mu,           x->strength,
                                          x->meeting_angle, x->source_angle, x->angle[0],
                                          x->angle[1]};
        for (int i = 0; i < 3; i++) k->value[3 * v + (size_t)i] = x->xyz[i];
        for (size_t i = 0; i < N_COLUMNS; i++) k->value[(3 + i) * n + v] = scalar[i];
        k->kind[v] = x->kind;
        if (x->degree > 0) continue;
        k->cell_strength[k->n_single] = x->strength;
        k->corner[k->n_single++] = (int32_t)v;
    }
    for (size_t e = 0; e < c->n_edges; e++) {
        k->corner[k->n_single + 2 * e] = c->edge[e].vertex[0];
        k->corner[k->n_single + 2 * e + 1] = c->edge[e].vertex[1];
        k->cell_strength[k->n_single + e] = c->edge[e].strength;
    }
    rc = DMK_OK;
done:
    return rc;
}

static void put_locus_data(dmk_vtk *vtk, const dmk_curves *c, const columns *k)
{
    static const char *const names[N_COLUMNS] = {
        "distance", "mu", "strength", "meeting_angle", "source_angle", "angle0", "angle1"};
    size_t n = c->n_vertices;
    dmk_output_text(vtk->out, "<PointData>\n");
    if (c->bare) {
        dmk_vtk_array(vtk, DMK_VTK_FLOAT64, names[0], 1, k->value + 3 * n, n);
        dmk_output_text(vtk->out, "</PointData>\n");
        return;
    }
    for (size_t i = 0; i < N_COLUMNS; i++) {
        dmk_vtk_array(vtk, DMK_VTK_FLOAT64, names[i], 1, k->value + (3 + i) * n, n);
    }
    dmk_vtk_array(vtk, DMK_VTK_INT32, "kind", 1, k->kind, n);
    dmk_output_text(vtk->out, "</PointData>\n<CellData Scalars=\"strength\">\n");
    dmk_vtk_array(vtk, DMK_VTK_FLOAT64, "strength", 1, k->cell_strength, k->n_single + c->n_edges);
    dmk_output_text(vtk->out, "</CellData>\n");
}

int dmk_vtp_write_locus(dmk_context *ctx, dmk_output *out, const dmk_curves *c)
{
    int rc;
    dmk_vtk vtk;
    columns k = {0};
    int32_t *vert_end = NULL, *line_end = NULL;
    DMK_TRY(columns_fill(ctx, c, &k));
    DMK_TRY(dmk_vtk_ends(ctx, k.n_single, 1, &vert_end));
    DMK_TRY(dmk_vtk_ends(ctx, c->n_edges, 2, &line_end));
    dmk_vtk_begin(&vtk, out, "PolyData");
    put_piece(out, c->n_vertices, k.n_single, c->n_edges, 0);
    put_locus_data(&vtk, c, &k);
    dmk_vtk_points(&vtk, k.value, c->n_vertices);
    dmk_vtk_cells(&vtk, "Verts", 1, k.corner, vert_end, NULL, k.n_single);
    dmk_vtk_cells(&vtk, "Lines", 2, k.corner + k.n_single, line_end, NULL, c->n_edges);
    dmk_output_text(out, "</Piece>\n");
    dmk_vtk_end(&vtk);
done:
    columns_free(&k);
    free(vert_end);
    free(line_end);
    return rc;
}
