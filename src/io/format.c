/* The table of formats, and reading and writing through it. */
#include "io/dealt.h"

#include "base/outfile.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Those that begin with long words of their own come before STL, whose title may be anything, and those with short
 * ones behind it. */
static const dmk_format formats[] = {
    {"PLY", ".ply", dmk_ply_sniff, dmk_ply_read, dmk_ply_write, dmk_ply_write, NULL},
    {"VTP", ".vtp", dmk_vtk_sniff, dmk_vtk_read, dmk_vtp_write, dmk_vtp_write, dmk_vtp_write_locus},
    {"PVTP", ".pvtp", NULL, NULL, dmk_pvtp_write, dmk_pvtp_write, NULL},
    {"VTU", ".vtu", dmk_vtk_sniff, dmk_vtk_read, dmk_vtu_write, dmk_vtu_write, NULL},
    {"VTK", ".vtk", dmk_vtk_legacy_sniff, dmk_vtk_legacy_read, NULL, NULL, NULL},
    {"MSH", ".msh", dmk_msh_sniff, dmk_msh_read, NULL, NULL, NULL},
    {"STL", ".stl", dmk_stl_sniff, dmk_stl_read, NULL, NULL, NULL},
    {"OFF", ".off .coff .noff", dmk_off_sniff, dmk_off_read, dmk_off_write, NULL, NULL},
    {"OBJ", ".obj", dmk_obj_sniff, dmk_obj_read, dmk_obj_write, NULL, dmk_obj_write_locus},
    {"CSV", ".csv", NULL, NULL, NULL, NULL, dmk_csv_write_locus},
};
#define N_FORMATS (sizeof formats / sizeof *formats)

int dmk_format_get(size_t index, dmk_format_info *info)
{
    if (index >= N_FORMATS || !info) return DMK_E_ARG;
    const dmk_format *f = &formats[index];
    *info = (dmk_format_info){f->name,
                              f->suffixes,
                              f->read_mesh != NULL,
                              f->write_mesh != NULL,
                              f->write_result != NULL,
                              f->write_locus != NULL};
    return DMK_OK;
}

/* Whether the first n_path characters of path end in one of the blank-separated suffixes, in
 * whatever case. */
static bool has_suffix(const char *path, size_t n_path, const char *suffixes)
{
    while (*suffixes) {
        size_t n = strcspn(suffixes, " ");
        if (n_path > n && strncasecmp(path + n_path - n, suffixes, n) == 0) return true;
        suffixes += n + (suffixes[n] == ' ');
    }
    return false;
}

/* Put the suffixes of the formats that can do something into text, for messages. */
enum { READ_MESH, WRITE_MESH, WRITE_RESULT, WRITE_LOCUS };
static bool can(const dmk_format *f, int what)
{
    switch (what) {
    case READ_MESH: return f->read_mesh != NULL;
    case WRITE_MESH: return f->write_mesh != NULL;
    case WRITE_RESULT: return f->write_result != NULL;
    default: return f->write_locus != NULL;
    }
}

static const char *list_suffixes(int what, char *text, size_t room)
{
    size_t n = 0;
    text[0] = '\0';
    for (size_t i = 0; i < N_FORMATS; i++) {
        if (!can(&formats[i], what)) continue;
        int w = snprintf(text + n, room - n, "%s%s", n ? " " : "", formats[i].suffixes);
        if (w < 0 || (size_t)w >= room - n) break;
        n += (size_t)w;
    }
    return text;
}

/* A packed file's format stands before ".gz"; nothing is written packed. */
static const dmk_format *find_by_suffix(const char *path, int what)
{
    size_t n = strlen(path);
    if (what == READ_MESH && has_suffix(path, n, ".gz")) n -= 3;
    for (size_t i = 0; i < N_FORMATS; i++) {
        if (can(&formats[i], what) && has_suffix(path, n, formats[i].suffixes)) return &formats[i];
    }
    return NULL;
}

/* By content, then by suffix. */
static int find_reader(dmk_context *ctx, const dmk_file *file, const dmk_format **format)
{
    char list[256];
    for (size_t i = 0; i < N_FORMATS; i++) {
        *format = &formats[i];
        if (formats[i].sniff && formats[i].sniff(file)) return DMK_OK;
    }
    *format = find_by_suffix(file->path, READ_MESH);
    if (*format) return DMK_OK;
    return dmk_fail(ctx, DMK_E_FORMAT,
                    "%s: neither its content nor its suffix is that of a mesh "
                    "format that is read (%s)",
                    file->path, list_suffixes(READ_MESH, list, sizeof list));
}

static const dmk_format *find_by_name(const char *name)
{
    for (size_t i = 0; i < N_FORMATS; i++) {
        if (strcasecmp(formats[i].name, name) == 0) return &formats[i];
    }
    return NULL;
}

int dmk_context_set_format(dmk_context *ctx, const char *name)
{
    if (!ctx) return DMK_E_ARG;
    const dmk_format *f = name ? find_by_name(name) : NULL;
    const bool writes = f && (f->write_mesh || f->write_result || f->write_locus);
    if (name && (!writes || f->write_mesh == dmk_pvtp_write)) {
        return dmk_fail(ctx, DMK_E_ARG, "'%s' is not a format of single files that is written",
                        name);
    }
    ctx->format = f ? f->name : NULL;
    return DMK_OK;
}

/* By suffix, then by the context's choice; of a stream the one that holds everything. */
static int find_writer(dmk_context *ctx, const char *path, int what, const dmk_format **format)
{
    char list[256];
    const bool stream = dmk_outfile_is_stream(path);
    if (!*path) return dmk_fail(ctx, DMK_E_ARG, "'': expected the name of a file");
    *format = find_by_suffix(path, what);
    if (*format && (*format)->write_mesh == dmk_pvtp_write) {
        if (stream) {
            return dmk_fail(ctx, DMK_E_ARG,
                            "%s: PVTP is several files, and this is a pipe or device", path);
        }
        if (!dmk_outfile_can_index(path)) {
            return dmk_fail(ctx, DMK_E_ARG,
                            "%s: a PVTP file names its pieces, and can do so only in UTF-8 without "
                            "control characters; choose another name",
                            path);
        }
    }
    if (!*format && ctx->format) *format = find_by_name(ctx->format);
    if (!*format && stream) *format = find_by_name("VTP");
    if (*format && can(*format, what)) return DMK_OK;
    if (*format)
        return dmk_fail(ctx, DMK_E_ARG,
                        "%s: the format %s was chosen, and cannot hold this; use one of %s", path,
                        (*format)->name, list_suffixes(what, list, sizeof list));
    return dmk_fail(ctx, DMK_E_ARG, "%s: the suffix chooses the format; use one of %s", path,
                    list_suffixes(what, list, sizeof list));
}

int dmk_name_file(dmk_context *ctx, const char *path, int rc)
{
    char what[sizeof ctx->message];
    memcpy(what, ctx->message, sizeof what);
    return dmk_fail(ctx, rc, "%s: %s", path, what);
}

/* The file's triangles, as they are. */
int dmk_soup_read(dmk_context *ctx, const char *path, dmk_soup *soup, uint64_t *bytes)
{
    int rc;
    dmk_file file = {0};
    const dmk_format *format;
    DMK_TRY(dmk_file_load(ctx, path, &file));
    *bytes += file.size;
    dmk_file_end_lines(&file);
    DMK_TRY(find_reader(ctx, &file, &format));
    DMK_TRY(format->read_mesh(ctx, &file, soup));
    rc = dmk_soup_split(ctx, soup);
    if (rc == DMK_E_MESH) rc = dmk_name_file(ctx, path, rc);
done:
    dmk_file_free(&file);
    return rc;
}

int dmk_soup_adopt(dmk_context *ctx, const char *path, const dmk_ranks *ranks, dmk_soup *soup,
                   dmk_mesh **mesh)
{
    const int rc = dmk_mesh_adopt_together(ctx, ranks, soup->n_vertices, soup->xyz,
                                           soup->n_triangles, soup->triangle, mesh);
    *soup = (dmk_soup){0};
    return rc == DMK_OK ? DMK_OK : dmk_name_file(ctx, path, rc);
}

int dmk_mesh_read(dmk_context *ctx, const char *path, dmk_mesh **mesh)
{
    int rc;
    uint64_t bytes = 0;
    dmk_soup soup = {0};
    if (dmk_missing(ctx, "path", path, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_stage_begin(ctx, "read"));
    DMK_TRY(dmk_soup_read(ctx, path, &soup, &bytes));
    rc = dmk_soup_adopt(ctx, path, NULL, &soup, mesh);
done:
    dmk_stage_end(ctx);
    dmk_soup_free(&soup);
    return rc;
}

int dmk_mesh_read_repaired(dmk_context *ctx, const char *path, dmk_repairs *repair, dmk_mesh **mesh)
{
    int rc;
    uint64_t bytes = 0;
    dmk_soup soup = {0};
    if (dmk_missing(ctx, "path", path, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_stage_begin(ctx, "read"));
    DMK_TRY(dmk_soup_read(ctx, path, &soup, &bytes));
    if (soup.n_triangles == 0) {
        rc = dmk_fail(ctx, DMK_E_MESH, "%s: %zu vertices and 0 triangles: nothing to repair", path,
                      soup.n_vertices);
        goto done;
    }
    DMK_TRY(dmk_stage_begin(ctx, "repair"));
    rc = dmk_mesh_repair(ctx, soup.n_vertices, soup.xyz, soup.n_triangles, soup.triangle, repair,
                         mesh);
    if (rc != DMK_OK) rc = dmk_name_file(ctx, path, rc);
done:
    dmk_stage_end(ctx);
    dmk_soup_free(&soup);
    return rc;
}

int dmk_mesh_read_known(dmk_context *ctx, const char *path, const dmk_mesh_info *info,
                        dmk_mesh **mesh)
{
    int rc;
    uint64_t bytes = 0;
    dmk_soup soup = {0};
    if (dmk_missing(ctx, "path", path, "info", info, "mesh", mesh)) return DMK_E_ARG;
    DMK_TRY(dmk_mesh_check_counts(ctx, info->n_vertices, info->n_triangles));
    DMK_TRY(dmk_stage_begin(ctx, "read"));
    DMK_TRY(dmk_soup_read(ctx, path, &soup, &bytes));
    if (soup.n_vertices != info->n_vertices || soup.n_triangles != info->n_triangles) {
        rc = dmk_fail(ctx, DMK_E_FORMAT,
                      "%s: %zu vertices and %zu triangles, but it had %zu and %zu: it has been "
                      "changed; start again",
                      path, soup.n_vertices, soup.n_triangles, info->n_vertices, info->n_triangles);
        goto done;
    }
    rc = dmk_mesh_adopt_known(ctx, info, soup.xyz, soup.triangle, mesh);
    soup = (dmk_soup){0};
done:
    dmk_stage_end(ctx);
    dmk_soup_free(&soup);
    return rc;
}

static int write_fields(dmk_context *ctx, const dmk_fields *fields, const char *path, int what)
{
    int rc;
    dmk_output *out = NULL;
    const dmk_format *f;
    DMK_TRY(find_writer(ctx, path, what, &f));
    DMK_TRY(dmk_stage_begin(ctx, "write"));
    DMK_TRY(dmk_output_open(ctx, path, &out));
    rc = (what == WRITE_MESH ? f->write_mesh : f->write_result)(ctx, out, fields);
done:
    rc = dmk_output_close(&out, rc);
    dmk_stage_end(ctx);
    return rc;
}

int dmk_mesh_write(dmk_context *ctx, const dmk_mesh *mesh, const char *path)
{
    if (dmk_missing(ctx, "mesh", mesh, "path", path)) return DMK_E_ARG;
    return write_fields(ctx, &(dmk_fields){.mesh = mesh}, path, WRITE_MESH);
}

int dmk_cut_write(dmk_context *ctx, const dmk_mesh *cut, const double *plane, const char *path)
{
    if (dmk_missing(ctx, "cut", cut, "plane", plane, "path", path)) return DMK_E_ARG;
    return write_fields(ctx, &(dmk_fields){.mesh = cut, .plane = plane}, path, WRITE_MESH);
}

int dmk_fields_write(dmk_context *ctx, const dmk_fields *fields, const char *path)
{
    return write_fields(ctx, fields, path, WRITE_RESULT);
}

int dmk_curves_write(dmk_context *ctx, const dmk_curves *curves, const char *path)
{
    int rc;
    dmk_output *out = NULL;
    const dmk_format *f;
    DMK_TRY(find_writer(ctx, path, WRITE_LOCUS, &f));
    DMK_TRY(dmk_stage_begin(ctx, "write"));
    DMK_TRY(dmk_output_open(ctx, path, &out));
    rc = f->write_locus(ctx, out, curves);
done:
    rc = dmk_output_close(&out, rc);
    dmk_stage_end(ctx);
    return rc;
}
