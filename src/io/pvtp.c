/* VTK PolyData in pieces: files NAME_0000.vtp, NAME_0001.vtp ... of runs of the triangles, and NAME.pvtp, which names
 * them and is opened as one. The index gets its name last: with it all pieces are there. */
#include "io/vtk.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Triangles of a piece: some 20 MB, which a viewer's process reads in about a tenth of a second. */
enum { PIECE = 250000, NAME_ROOM = 32 };

/* A run of the triangles with the vertices at them. */
typedef struct piece {
    struct dmk_mesh mesh;
    dmk_fields fields;
    double *u, *distance, *direction, *plane;
    int32_t *nearest;
    int32_t *number; /* vertices of the whole mesh: -1, or their number here */
    int32_t *whole;  /* and back */
} piece;

static void piece_free(piece *p)
{
    free(p->mesh.xyz);
    free(p->mesh.triangle);
    free(p->u);
    free(p->distance);
    free(p->direction);
    free(p->plane);
    free(p->nearest);
    free(p->number);
    free(p->whole);
}

/* Vertices by first touch. */
static int take_triangles(dmk_context *ctx, const dmk_mesh *m, int32_t begin, int32_t end, piece *p)
{
    int rc;
    p->mesh.n_triangles = end - begin;
    DMK_TRY(DMK_NEW(ctx, p->number, (size_t)m->n_vertices));
    DMK_TRY(DMK_NEW(ctx, p->whole, 3 * (size_t)(end - begin)));
    DMK_TRY(DMK_NEW(ctx, p->mesh.triangle, 3 * (size_t)(end - begin)));
    for (int32_t v = 0; v < m->n_vertices; v++) p->number[v] = -1;
    for (int32_t h = 0; h < 3 * (end - begin); h++) {
        int32_t v = m->triangle[3 * (size_t)begin + (size_t)h];
        if (p->number[v] < 0) {
            p->number[v] = p->mesh.n_vertices;
            p->whole[p->mesh.n_vertices++] = v;
        }
        p->mesh.triangle[h] = p->number[v];
    }
    DMK_TRY(DMK_NEW(ctx, p->mesh.xyz, 3 * (size_t)p->mesh.n_vertices));
    for (int32_t v = 0; v < p->mesh.n_vertices; v++) {
        memcpy(p->mesh.xyz + 3 * (size_t)v, m->xyz + 3 * (size_t)p->whole[v], 3 * sizeof *m->xyz);
    }
done:
    return rc;
}

/* *part = the piece's vertices' values, n for each; NULL stays NULL. */
static int take_values(dmk_context *ctx, const piece *p, size_t n, const double *whole,
                       double **part)
{
    int rc;
    if (!whole) return DMK_OK;
    DMK_TRY(DMK_NEW(ctx, *part, n * (size_t)p->mesh.n_vertices));
    for (int32_t v = 0; v < p->mesh.n_vertices; v++) {
        memcpy(*part + n * (size_t)v, whole + n * (size_t)p->whole[v], n * sizeof *whole);
    }
done:
    return rc;
}

static int take_fields(dmk_context *ctx, const dmk_fields *f, int32_t begin, piece *p)
{
    int rc;
    DMK_TRY(take_values(ctx, p, 1, f->u, &p->u));
    DMK_TRY(take_values(ctx, p, 1, f->distance, &p->distance));
    DMK_TRY(take_values(ctx, p, 1, f->direction, &p->direction));
    DMK_TRY(take_values(ctx, p, 2, f->plane, &p->plane));
    if (f->nearest) {
        DMK_TRY(DMK_NEW(ctx, p->nearest, (size_t)p->mesh.n_vertices));
        for (int32_t v = 0; v < p->mesh.n_vertices; v++) p->nearest[v] = f->nearest[p->whole[v]];
    }
    p->fields = (dmk_fields){.mesh = &p->mesh,
                             .u = p->u,
                             .distance = p->distance,
                             .direction = p->direction,
                             .nearest = p->nearest,
                             .plane = p->plane};
    if (f->mu) p->fields.mu = f->mu + begin;
    if (f->acl) p->fields.acl = f->acl + begin;
    if (f->flux) p->fields.flux = f->flux + 3 * (size_t)begin;
done:
    return rc;
}

/* "dir/NAME.pvtp" -> "dir/NAME_0003.vtp". */
static void name_piece(const char *path, int32_t k, size_t room, char *name)
{
    snprintf(name, room, "%.*s_%04d.vtp", (int)(strlen(path) - strlen(".pvtp")), path, k);
}

static int write_piece(dmk_context *ctx, const dmk_fields *f, int32_t begin, int32_t end,
                       const char *name)
{
    int rc;
    piece p = {.number = NULL};
    dmk_output *out = NULL;
    DMK_TRY(take_triangles(ctx, f->mesh, begin, end, &p));
    DMK_TRY(take_fields(ctx, f, begin, &p));
    DMK_TRY(dmk_output_open(ctx, name, &out));
    rc = dmk_vtp_write_piece(ctx, out, &p.fields);
done:
    rc = dmk_output_close(&out, rc);
    piece_free(&p);
    return rc;
}

static void put_array(dmk_output *out, const char *type, const char *name, const char *more)
{
    dmk_output_text(out, "<PDataArray type=\"");
    dmk_output_text(out, type);
    dmk_output_text(out, "\" Name=\"");
    dmk_output_text(out, name);
    dmk_output_text(out, "\"");
    dmk_output_text(out, more);
    dmk_output_text(out, "/>\n");
}

/* The arrays of dmk_vtk_result. */
static void put_arrays(dmk_output *out, const dmk_fields *f)
{
    if (f->plane) {
        dmk_output_text(out, "<PPointData TCoords=\"plane\">\n");
        put_array(out, "Float64", "plane", " NumberOfComponents=\"2\"");
        dmk_output_text(out, "</PPointData>\n");
    }
    if (f->nearest) {
        dmk_output_text(out, "<PPointData Scalars=\"distance\">\n");
        put_array(out, "Float64", "distance", "");
        put_array(out, "Float64", "direction", "");
        put_array(out, "Int32", "nearest", "");
        dmk_output_text(out, "</PPointData>\n");
    }
    if (f->mu) {
        dmk_output_text(out, "<PPointData>\n");
        put_array(out, "Float64", "u", "");
        if (f->distance) put_array(out, "Float64", "distance", "");
        dmk_output_text(out, "</PPointData>\n<PCellData Scalars=\"mu\">\n");
        put_array(out, "Float64", "mu", "");
        if (f->flux) put_array(out, "Float64", "flux", " NumberOfComponents=\"3\"");
        if (f->acl) put_array(out, "UInt8", "acl", "");
        dmk_output_text(out, "</PCellData>\n");
    }
    dmk_output_text(out, "<PPoints>\n");
    put_array(out, "Float64", "Points", " NumberOfComponents=\"3\"");
    dmk_output_text(out, "</PPoints>\n");
}

/* A file's name without its folder, as the value of an attribute. */
static void put_source(dmk_output *out, const char *name)
{
    const char *slash = strrchr(name, '/');
    dmk_output_text(out, "<Piece Source=\"");
    for (const char *c = slash ? slash + 1 : name; *c; c++) {
        const char *word = *c == '&' ? "&amp;" : *c == '<' ? "&lt;" : *c == '"' ? "&quot;" : NULL;
        if (word)
            dmk_output_text(out, word);
        else
            dmk_output_put(out, c, 1);
    }
    dmk_output_text(out, "\"/>\n");
}

int dmk_pvtp_write(dmk_context *ctx, dmk_output *out, const dmk_fields *f)
{
    int rc = DMK_OK;
    const char *path = dmk_output_path(out);
    int64_t n = f->mesh->n_triangles, n_pieces = (n + PIECE - 1) / PIECE;
    size_t room = strlen(path) + NAME_ROOM;
    int32_t written = 0;
    char *name = NULL;
    DMK_TRY(dmk_alloc(ctx, "file name", room, 1, (void **)&name));
    dmk_vtk_head(out, "PPolyData", " GhostLevel=\"0\"");
    put_arrays(out, f);
    for (; written < n_pieces; written++) {
        name_piece(path, written, room, name);
        put_source(out, name);
        DMK_TRY(write_piece(ctx, f, (int32_t)(n * written / n_pieces),
                            (int32_t)(n * (written + 1) / n_pieces), name));
    }
    dmk_output_text(out, "</PPolyData>\n</VTKFile>\n");
done:
    for (int32_t k = 0; rc != DMK_OK && k < written; k++) {
        name_piece(path, k, room, name);
        unlink(name);
    }
    free(name);
    return rc;
}
