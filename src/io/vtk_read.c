/* Reading VTK's XML files: VTP (PolyData) and VTU (UnstructuredGrid). All pieces become one mesh,
 * in their order; faces become triangles (see cells.h), of PolyData first polygons, then strips.
 * Of the data on points and cells the array that is asked for by name. */
#include "io/cells.h"
#include "io/dealt.h"
#include "io/vtk_xml.h"

#include <stdlib.h>
#include <string.h>

typedef struct vtk {
    dmk_context *context;
    const dmk_file *file;
    dmk_vtk_tags tags;
    dmk_soup *soup;
    size_t first, n_points; /* the piece's vertices */
    dmk_corners corners;
    dmk_cells cells;
} vtk;

bool dmk_vtk_sniff(const dmk_file *file)
{
    const size_t n = file->size < 4096 ? file->size : 4096;
    dmk_text t = dmk_text_of(file);
    return dmk_text_seek(&t) && *t.at == '<' && memmem(file->data, n, "<VTKFile", 8);
}

static int fail(const vtk *v, const char *what)
{
    return dmk_fail(v->context, DMK_E_FORMAT, "%s: %s", v->file->path, what);
}

static int read_points(vtk *v, const dmk_vtk_piece *p)
{
    int rc = DMK_OK;
    double *xyz = NULL;
    v->first = v->soup->n_vertices;
    v->n_points = (size_t)p->n_points;
    if (p->n_points == 0) return DMK_OK;
    if (!p->values[DMK_VTK_POINTS].there) return fail(v, "no array of points");
    if (v->n_points > INT32_MAX - v->first) return fail(v, "more points than 32 bits count");
    DMK_TRY(dmk_vtk_read_numbers(v->context, v->file, &v->tags.coding, &p->values[DMK_VTK_POINTS],
                                 "points", 3 * v->n_points, &xyz));
    if (v->first == 0) {
        free(v->soup->xyz);
        v->soup->xyz = xyz;
        xyz = NULL;
    } else {
        double *all = realloc(v->soup->xyz, 3 * (v->first + v->n_points) * sizeof *all);
        if (!all) {
            rc = dmk_fail(v->context, DMK_E_NOMEM, "out of memory: points");
            goto done;
        }
        memcpy(all + 3 * v->first, xyz, 3 * v->n_points * sizeof *xyz);
        v->soup->xyz = all;
    }
    v->soup->n_vertices += v->n_points;
done:
    free(xyz);
    return rc;
}

/* A list of cells: the corners of all, and where each cell's end. */
typedef struct list {
    int64_t *corner, *end, *type; /* type may be NULL */
    size_t n;
} list;

static void list_free(list *l)
{
    free(l->corner);
    free(l->end);
    free(l->type);
}

static int read_list(vtk *v, const dmk_vtk_piece *p, dmk_vtk_role corners, dmk_vtk_role ends,
                     int64_t n, list *l)
{
    int rc;
    const dmk_vtk_values *a = &p->values[corners], *b = &p->values[ends];
    const dmk_vtk_coding *coding = &v->tags.coding;
    if (!a->there || !b->there) return fail(v, "cells without connectivity or without offsets");
    l->n = (size_t)n;
    DMK_TRY(dmk_vtk_read_integers(v->context, v->file, coding, b, "offsets", l->n, &l->end));
    for (size_t i = 0; i < l->n; i++) {
        if (l->end[i] < (i > 0 ? l->end[i - 1] : 0)) return fail(v, "offsets that fall");
    }
    DMK_TRY(dmk_vtk_read_integers(v->context, v->file, coding, a, "connectivity",
                                  (size_t)l->end[l->n - 1], &l->corner));
done:
    return rc;
}

static int add_cell(vtk *v, const list *l, size_t i, dmk_cell cell)
{
    int rc;
    const size_t first = i > 0 ? (size_t)l->end[i - 1] : 0, n = (size_t)l->end[i] - first;
    const char *refusal = dmk_cell_refusal(cell, n);
    if (refusal) {
        return dmk_fail(v->context, DMK_E_FORMAT, "%s: cell %zu is %s", v->file->path, i, refusal);
    }
    DMK_TRY(dmk_corners_resize(v->context, &v->corners, n));
    for (size_t k = 0; k < n; k++) {
        const int64_t c = l->corner[first + k];
        if (c < 0 || (uint64_t)c >= v->n_points) {
            return dmk_fail(
                v->context, DMK_E_FORMAT,
                "%s: point %lld of cell %zu is out of range: there are %zu, counted from 0",
                v->file->path, (long long)c, i, v->n_points);
        }
        v->corners.vertex[k] = (int32_t)(v->first + (size_t)c);
    }
    rc = dmk_cell_add(v->context, v->soup, cell, &v->corners, &v->cells);
done:
    return rc;
}

static int read_faces(vtk *v, const dmk_vtk_piece *p, dmk_vtk_role corners, dmk_vtk_role ends,
                      int64_t n, dmk_cell cell)
{
    int rc;
    list l = {0};
    if (n == 0) return DMK_OK;
    DMK_TRY(read_list(v, p, corners, ends, n, &l));
    for (size_t i = 0; i < l.n; i++) DMK_TRY(add_cell(v, &l, i, cell));
done:
    list_free(&l);
    return rc;
}

static int read_cells(vtk *v, const dmk_vtk_piece *p)
{
    int rc;
    list l = {0};
    if (p->n_cells == 0) return DMK_OK;
    if (!p->values[DMK_VTK_CELL_TYPES].there) return fail(v, "cells without types");
    DMK_TRY(read_list(v, p, DMK_VTK_CELL_CORNERS, DMK_VTK_CELL_ENDS, p->n_cells, &l));
    DMK_TRY(dmk_vtk_read_integers(v->context, v->file, &v->tags.coding,
                                  &p->values[DMK_VTK_CELL_TYPES], "types", l.n, &l.type));
    for (size_t i = 0; i < l.n; i++) DMK_TRY(add_cell(v, &l, i, dmk_cell_of_vtk(l.type[i])));
done:
    list_free(&l);
    return rc;
}

static int read_piece(vtk *v, const dmk_vtk_piece *p)
{
    int rc;
    DMK_TRY(read_points(v, p));
    DMK_TRY(
        read_faces(v, p, DMK_VTK_POLY_CORNERS, DMK_VTK_POLY_ENDS, p->n_polys, DMK_CELL_POLYGON));
    DMK_TRY(
        read_faces(v, p, DMK_VTK_STRIP_CORNERS, DMK_VTK_STRIP_ENDS, p->n_strips, DMK_CELL_STRIP));
    DMK_TRY(read_cells(v, p));
    v->cells.n_thin += (size_t)p->n_thin;
done:
    return rc;
}

int dmk_vtk_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    vtk v = {.context = ctx, .file = file, .soup = soup};
    DMK_TRY(dmk_vtk_tags_read(ctx, file, &v.tags));
    for (size_t i = 0; i < v.tags.n_pieces; i++) DMK_TRY(read_piece(&v, &v.tags.piece[i]));
    DMK_TRY(dmk_cells_end(ctx, file->path, soup, &v.cells));
done:
    dmk_vtk_tags_free(&v.tags);
    free(v.corners.vertex);
    return rc;
}

/* ---- by ranges ---- */

/* Numbers of an array of appended raw data, `each` in a record; the size that stands before them is checked. */
static void set_column(const vtk *v, const dmk_vtk_values *a, size_t n, size_t each, dmk_layout *l,
                       dmk_column *column)
{
    const dmk_type type = v->tags.coding.header_type;
    const uint64_t at = (uint64_t)(v->tags.coding.appended - v->file->data) + a->offset;
    const size_t size = dmk_type_bytes(a->type);
    l->check[l->n_checks++] = (dmk_column_check){{at, 1, type}, 1, (int64_t)(n * each * size), 0};
    for (size_t k = 0; k < each; k++)
        column[k] = (dmk_column){at + dmk_type_bytes(type) + k * size, each * size, a->type};
}

/* One piece of triangles alone, in raw bytes behind the tags. */
static bool is_plain(const dmk_vtk_tags *tags)
{
    static const dmk_vtk_role wanted[] = {DMK_VTK_POINTS, DMK_VTK_POLY_CORNERS, DMK_VTK_POLY_ENDS};
    const dmk_vtk_piece *p = tags->piece;
    if (tags->n_pieces != 1 || !tags->coding.appended || tags->coding.appended_base64 ||
        tags->coding.packed || p->n_strips + p->n_cells + p->n_thin > 0)
        return false;
    for (int k = 0; k < 3; k++) {
        const dmk_vtk_values *a = &p->values[wanted[k]];
        if (!a->there || a->storage != DMK_VTK_APPENDED) return false;
    }
    return true;
}

bool dmk_vtk_layout(dmk_context *ctx, const dmk_file *head, dmk_layout *l)
{
    vtk v = {.context = ctx, .file = head};
    dmk_column ends;
    const bool found = dmk_vtk_tags_read(ctx, head, &v.tags) == DMK_OK && is_plain(&v.tags);
    if (found) {
        const dmk_vtk_piece *p = v.tags.piece;
        l->swap = v.tags.coding.swap;
        l->n_vertices = (size_t)p->n_points;
        l->n_triangles = (size_t)p->n_polys;
        set_column(&v, &p->values[DMK_VTK_POINTS], l->n_vertices, 3, l, l->xyz);
        set_column(&v, &p->values[DMK_VTK_POLY_CORNERS], l->n_triangles, 3, l, l->corner);
        set_column(&v, &p->values[DMK_VTK_POLY_ENDS], l->n_triangles, 1, l, &ends);
        l->check[l->n_checks++] = (dmk_column_check){ends, l->n_triangles, 3, 3};
    }
    dmk_vtk_tags_free(&v.tags);
    return found;
}

/* ---- data ---- */

/* Which of the n cells that a piece has data of are faces. In PolyData thin cells come first, in grids anywhere. */
static int find_faces(const vtk *v, const dmk_vtk_piece *p, size_t n, bool *is_face)
{
    int rc;
    int64_t *type = NULL;
    for (size_t i = 0; i < n; i++) is_face[i] = i >= (size_t)p->n_thin;
    if (p->n_cells == 0) return DMK_OK;
    if (!p->values[DMK_VTK_CELL_TYPES].there) return fail(v, "cells without types");
    DMK_TRY(dmk_vtk_read_integers(v->context, v->file, &v->tags.coding,
                                  &p->values[DMK_VTK_CELL_TYPES], "types", n, &type));
    for (size_t i = 0; i < n; i++) {
        const dmk_cell cell = dmk_cell_of_vtk(type[i]);
        is_face[i] = cell != DMK_CELL_THIN && cell != DMK_CELL_VOLUME;
    }
done:
    free(type);
    return rc;
}

/* The piece's part of the array, behind the *n numbers that are there: of points all, of cells those of faces. */
static int read_part(const vtk *v, const dmk_vtk_piece *p, dmk_vtk_role role, size_t room,
                     double *values, size_t *n)
{
    int rc;
    double *part = NULL;
    bool *is_face = NULL;
    const bool cells = role == DMK_VTK_CELL_DATA;
    const size_t all = (size_t)(!cells           ? p->n_points
                                : p->n_cells > 0 ? p->n_cells
                                                 : p->n_thin + p->n_polys + p->n_strips);
    if (all == 0) return DMK_OK;
    if (!p->values[role].there) return fail(v, "an array of data that is not in all pieces");
    DMK_TRY(dmk_vtk_read_numbers(v->context, v->file, &v->tags.coding, &p->values[role],
                                 v->tags.wanted, all, &part));
    DMK_TRY(DMK_NEW(v->context, is_face, all));
    if (cells) DMK_TRY(find_faces(v, p, all, is_face));
    for (size_t i = 0; i < all; i++) {
        if (cells && !is_face[i]) continue;
        if (*n == room) {
            rc = dmk_fail(v->context, DMK_E_FORMAT,
                          "%s: the array '%s' has more than the %zu numbers expected",
                          v->file->path, v->tags.wanted, room);
            goto done;
        }
        values[(*n)++] = part[i];
    }
done:
    free(part);
    free(is_face);
    return rc;
}

static bool has(const dmk_vtk_tags *tags, dmk_vtk_role role)
{
    for (size_t i = 0; i < tags->n_pieces; i++) {
        if (tags->piece[i].values[role].there) return true;
    }
    return false;
}

int dmk_array_read(dmk_context *ctx, const char *path, const char *name, size_t room,
                   double *values, size_t *n, int *of_points)
{
    int rc;
    dmk_file file = {0};
    if (dmk_missing(ctx, "path", path, "name", name, "values", values, "n", n, "of_points",
                    of_points)) {
        return DMK_E_ARG;
    }
    if (room > INT32_MAX)
        return dmk_fail(ctx, DMK_E_ARG, "room for %zu numbers: no mesh has so many", room);
    vtk v = {.context = ctx, .file = &file, .tags = {.wanted = name}};
    *n = 0;
    DMK_TRY(dmk_file_load(ctx, path, &file));
    if (!dmk_vtk_sniff(&file)) {
        rc = fail(&v, "arrays by name are read from VTP and VTU files only");
        goto done;
    }
    DMK_TRY(dmk_vtk_tags_read(ctx, &file, &v.tags));
    const dmk_vtk_role role =
        has(&v.tags, DMK_VTK_POINT_DATA) ? DMK_VTK_POINT_DATA : DMK_VTK_CELL_DATA;
    *of_points = role == DMK_VTK_POINT_DATA;
    if (!has(&v.tags, role)) {
        const char *others = v.tags.others;
        rc = dmk_fail(ctx, DMK_E_FORMAT, "%s: no array '%s' on points or cells; it has %s", path,
                      name, *others ? others : "none of one number each");
        goto done;
    }
    for (size_t i = 0; i < v.tags.n_pieces; i++)
        DMK_TRY(read_part(&v, &v.tags.piece[i], role, room, values, n));
done:
    dmk_vtk_tags_free(&v.tags);
    dmk_file_free(&file);
    return rc;
}
