/* VTK PolyData in pieces: files NAME_0000.vtp, NAME_0001.vtp ... of runs of the triangles, and NAME.pvtp, which names
 * them and is opened as one. Pieces get their names, one by one, when all of them and the index are on the disk: what
 * fails before that leaves an earlier result as it was. The index gets its name last. */
#include "io/vtk.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Triangles of a piece: some 20 MB, which a viewer's process reads in about a tenth of a second. */
enum { PIECE = 250000, LINE_ROOM = 32 };

/* Of one index. */
typedef struct pieces {
    const char *path; /* of the index */
    char *name;       /* room for that of a piece */
    char *line;       /* and for the line that names it */
    size_t room, line_room;
    int32_t n, n_written;
    dmk_outfile *file; /* n, in no place yet */
    bool *fresh;       /* n: none was there before */
} pieces;

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

static const char *name_piece(const pieces *p, int32_t k)
{
    dmk_outfile_piece(p->path, k, p->name, p->room);
    return p->name;
}

static int write_piece(dmk_context *ctx, const dmk_fields *f, int32_t begin, int32_t end,
                       const char *name, dmk_outfile *file)
{
    int rc;
    piece p = {.number = NULL};
    dmk_output *out = NULL;
    DMK_TRY(take_triangles(ctx, f->mesh, begin, end, &p));
    DMK_TRY(take_fields(ctx, f, begin, &p));
    DMK_TRY(dmk_output_open(ctx, name, &out));
    rc = dmk_vtp_write_piece(ctx, out, &p.fields);
done:
    rc = dmk_output_detach(&out, rc, file);
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

/* The line of the index that names piece k: its name without the folder, as the value of an attribute. */
static const char *line_of(const pieces *p, int32_t k)
{
    const char *name = name_piece(p, k), *slash = strrchr(name, '/');
    size_t n = (size_t)snprintf(p->line, p->line_room, "<Piece Source=\"");
    for (const char *c = slash ? slash + 1 : name; *c; c++) {
        const char *word = *c == '&' ? "&amp;" : *c == '<' ? "&lt;" : *c == '"' ? "&quot;" : NULL;
        n += (size_t)snprintf(p->line + n, p->line_room - n, word ? "%s" : "%.1s", word ? word : c);
    }
    snprintf(p->line + n, p->line_room - n, "\"/>\n");
    return p->line;
}

static int pieces_create(dmk_context *ctx, const char *path, int32_t n_triangles, pieces *p)
{
    int rc;
    *p = (pieces){.path = path, .n = (int32_t)(((int64_t)n_triangles + PIECE - 1) / PIECE)};
    p->room = strlen(path) + DMK_PIECE_ROOM;
    p->line_room = p->room * strlen("&quot;") + LINE_ROOM;
    DMK_TRY(dmk_alloc(ctx, "file name", p->room, 1, (void **)&p->name));
    DMK_TRY(dmk_alloc(ctx, "file name", p->line_room, 1, (void **)&p->line));
    DMK_TRY(DMK_NEW(ctx, p->file, (size_t)p->n));
    DMK_TRY(DMK_NEW(ctx, p->fresh, (size_t)p->n));
done:
    return rc;
}

/* What has no place yet is gone then. */
static void pieces_free(pieces *p)
{
    for (int32_t k = 0; k < p->n_written; k++) dmk_outfile_discard(&p->file[k]);
    free(p->name);
    free(p->line);
    free(p->file);
    free(p->fresh);
}

static int place_pieces(dmk_context *ctx, pieces *p)
{
    for (int32_t k = 0; k < p->n; k++) {
        p->fresh[k] = access(name_piece(p, k), F_OK) != 0;
        const int error = dmk_outfile_commit(&p->file[k]);
        if (error == 0) continue;
        const int rc =
            dmk_fail(ctx, DMK_E_IO, "%s: cannot write: %s", name_piece(p, k), strerror(error));
        while (k-- > 0) {
            if (p->fresh[k]) unlink(name_piece(p, k));
        }
        return rc;
    }
    return DMK_OK;
}

/* Pieces that the index named before it had fewer; others with such a name are somebody's own. */
static void remove_stale(const pieces *p, const dmk_file *before)
{
    for (int32_t k = p->n; before->data && strstr(before->data, line_of(p, k)); k++)
        unlink(name_piece(p, k));
}

/* Only for remove_stale: an earlier index that is no such file, or cannot be read, is as good as none. */
static int load_index(dmk_context *ctx, const char *path, dmk_file *before)
{
    if (access(path, R_OK) != 0) return DMK_OK;
    return dmk_file_load(ctx, path, before) == DMK_E_CANCELLED ? DMK_E_CANCELLED : DMK_OK;
}

int dmk_pvtp_write(dmk_context *ctx, dmk_output *out, const dmk_fields *f)
{
    int rc;
    pieces p;
    dmk_file before = {0};
    const char *path = dmk_output_path(out);
    const int64_t n = f->mesh->n_triangles;
    DMK_TRY(pieces_create(ctx, path, f->mesh->n_triangles, &p));
    DMK_TRY(load_index(ctx, path, &before));
    dmk_vtk_head(out, "PPolyData", " GhostLevel=\"0\"");
    put_arrays(out, f);
    for (; p.n_written < p.n; p.n_written++) {
        const int32_t k = p.n_written;
        dmk_output_text(out, line_of(&p, k));
        DMK_TRY(write_piece(ctx, f, (int32_t)(n * k / p.n), (int32_t)(n * (k + 1) / p.n),
                            name_piece(&p, k), &p.file[k]));
    }
    dmk_output_text(out, "</PPolyData>\n</VTKFile>\n");
    DMK_TRY(dmk_output_sync(out));
    DMK_TRY(place_pieces(ctx, &p));
    remove_stale(&p, &before);
done:
    dmk_file_free(&before);
    pieces_free(&p);
    return rc;
}
