/* Mesh files as the commands read them: with --repair or without, and what is reported of them. */
#include "cli.h"

#include <limits.h>
#include <malloc.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>

typedef struct count {
    size_t n;
    const char *one, *many;
} count;

static void print_repairs(const char *path, const dmk_repairs *did)
{
    const count counts[] = {
        {did->merged_vertices, "vertex merged with a coincident one",
         "vertices merged with coincident ones"},
        {did->flipped_triangles, "zero-area triangle flipped", "zero-area triangles flipped"},
        {did->degenerate_triangles, "zero-area triangle dropped", "zero-area triangles dropped"},
        {did->duplicate_triangles, "duplicate triangle dropped", "duplicate triangles dropped"},
        {did->split_edges, "non-manifold edge split", "non-manifold edges split"},
        {did->turned_triangles, "triangle reoriented", "triangles reoriented"},
        {did->split_vertices, "vertex added at a non-manifold vertex",
         "vertices added at non-manifold vertices"},
        {did->seam_edges, "edge of two triangles cut open", "edges of two triangles cut open"},
    };
    const char *before = "";
    fprintf(stderr, "dmkcl: %s repaired: ", path);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        if (counts[i].n == 0) continue;
        fprintf(stderr, "%s%zu %s", before, counts[i].n,
                counts[i].n == 1 ? counts[i].one : counts[i].many);
        before = ", ";
    }
    fprintf(stderr, "%s\n", *before ? "" : "nothing needed repair");
}

/* Whoever asks for distances has to know what they are not. */
static void warn_of_seam(const char *path, const dmk_repairs *did)
{
    if (did->seam_edges == 0) return;
    fprintf(stderr,
            "dmkcl: warning: %s was cut open along %zu edge%s, for it has one side only: distances "
            "across this seam are not those of the surface\n",
            path, did->seam_edges, did->seam_edges == 1 ? "" : "s");
}

/* A mesh in pieces is most often one whose triangles do not share their vertices. */
static void warn_of_pieces(dmk_context *context, const char *path, const dmk_mesh *mesh,
                           bool repaired)
{
    dmk_mesh_info info, whole = {0};
    dmk_mesh *merged = NULL;
    dmk_mesh_get_info(mesh, &info);
    if (info.n_components < 2) return;
    if (!repaired &&
        dmk_mesh_repair(context, info.n_vertices, dmk_mesh_vertices(mesh), info.n_triangles,
                        dmk_mesh_triangles(mesh), NULL, &merged) == DMK_OK) {
        dmk_mesh_get_info(merged, &whole);
        dmk_mesh_destroy(&merged);
    }
    fprintf(stderr, "dmkcl: warning: %s is in %zu pieces", path, info.n_components);
    if (whole.n_components > 0 && whole.n_components < info.n_components) {
        fprintf(stderr, "; --repair, which merges coincident vertices, leaves %zu",
                whole.n_components);
    }
    fputc('\n', stderr);
}

/* Bytes, speed only. Beyond the first the C library takes memory from the system by the piece; beyond the second the
 * heap gives back what is free at its end. A solve of 273,000 triangles has 88,000 page faults, with halves of them
 * 97,000, with the C library's own 108,000 (and 373 MB for 387). */
static const int piece = 64 << 20, kept = 128 << 20;

void cli_keep_memory(void)
{
    mallopt(M_MMAP_THRESHOLD, piece);
    mallopt(M_TRIM_THRESHOLD, kept);
}

void cli_trim_memory(void)
{
    malloc_trim(0);
}

enum { LARGE = 500000 }; /* triangles */

/* Of a large mesh the larger arrays go back to the system when they are freed: a solve of 1,094,000 triangles takes
 * 901 MB and 3.26 s then, 956 MB and 3.39 s with 32 and 64 MB. */
static const int large_piece = 20 << 20, large_kept = 32 << 20;
/* Of ranks that have no more than a share of the mesh in the end, where memory counts most, all but the small ones: 290
 * MB for each of four, with the sizes above 318. One process takes 862 MB and 3.61 s so, and two ranks that have all of
 * the mesh 804,000 page faults for 505,000, and 0.3 s longer. */
static const int share_piece = 3 << 19, share_kept = 2 << 20;

static void return_memory(bool shares)
{
    mallopt(M_MMAP_THRESHOLD, shares ? share_piece : large_piece);
    mallopt(M_TRIM_THRESHOLD, shares ? share_kept : large_kept);
    cli_trim_memory();
}

static void save_memory(const dmk_mesh *mesh, bool shares)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    if (info.n_triangles >= LARGE) return_memory(shares);
}

/* Space of the heap that is used next, in huge pages: memory is taken only where it is written, and then with a fault
 * for each 2 MB. */
static void make_room(size_t bytes)
{
    enum { PAGE = 2 << 20, MOST = INT_MAX - 2 * PAGE };
    bytes = (bytes < MOST ? bytes : MOST) / PAGE * PAGE;
    if (bytes == 0) return;
    mallopt(M_MMAP_THRESHOLD, INT_MAX);
    mallopt(M_TRIM_THRESHOLD, INT_MAX);
    char *heap = malloc(bytes + PAGE);
    if (heap) madvise(heap + PAGE - (uintptr_t)heap % PAGE, bytes, MADV_HUGEPAGE);
    free(heap);
}

void cli_make_room(const dmk_mesh *mesh)
{
    enum { PER_TRIANGLE = 1024 };
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    const size_t size = info.n_triangles * PER_TRIANGLE;
    if (info.n_triangles >= LARGE) return;
    make_room(size);
    mallopt(M_MMAP_THRESHOLD, piece);
    mallopt(M_TRIM_THRESHOLD, kept + (int)size);
}

/* Distances take 7 to 20 bytes for each of the file; what is not used costs nothing. */
static void make_room_for_file(const char *path)
{
    enum { PER_BYTE = 24 };
    struct stat file;
    if (stat(path, &file) == 0 && S_ISREG(file.st_mode)) make_room((size_t)file.st_size * PER_BYTE);
}

int cli_read_mesh(dmk_context *context, const char *path, const cli_reading *how, dmk_repairs *did,
                  dmk_mesh **mesh)
{
    if (how->keep_memory) make_room_for_file(path);
    const int rc = how->repair ? dmk_mesh_read_repaired(context, path, did, mesh)
                               : dmk_mesh_read_dealt(context, path, how->ranks, mesh);
    if (rc == DMK_OK && !how->keep_memory) save_memory(*mesh, how->shares);
    if (rc != DMK_OK || how->quiet) return rc;
    if (how->progress) cli_progress_end(how->progress);
    if (how->repair) print_repairs(path, did);
    if (how->repair) warn_of_seam(path, did);
    warn_of_pieces(context, path, *mesh, how->repair);
    return rc;
}

double cli_offset(dmk_context *context, const dmk_mesh *mesh, const double xyz[3],
                  const dmk_point *point)
{
    double at[3];
    if (dmk_mesh_point_xyz(context, mesh, point, at) != DMK_OK) return 0;
    return hypot(hypot(at[0] - xyz[0], at[1] - xyz[1]), at[2] - xyz[2]);
}

void cli_warn_away(dmk_context *context, const dmk_mesh *mesh, const double xyz[3],
                   const dmk_point *point)
{
    char wanted[CLI_TEXT_SIZE], found[CLI_TEXT_SIZE];
    double at[3];
    dmk_mesh_info info;
    if (dmk_mesh_point_xyz(context, mesh, point, at) != DMK_OK) return;
    const double away = cli_offset(context, mesh, xyz, point);
    dmk_mesh_get_info(mesh, &info);
    if (!(away > info.mean_edge)) return;
    fprintf(stderr,
            "dmkcl: warning: (%s) is %.3g away from the surface; its nearest point (%s) is taken\n",
            cli_point(xyz, wanted), away, cli_point(at, found));
}

int cli_project(dmk_context *context, const dmk_mesh *mesh, const double xyz[3], bool quiet,
                dmk_point *point)
{
    const int rc = dmk_mesh_project(context, mesh, xyz, point);
    if (rc == DMK_OK && !quiet) cli_warn_away(context, mesh, xyz, point);
    return rc;
}

int64_t cli_vertex_now(const dmk_repairs *did, int64_t vertex)
{
    const bool moved = did->vertex_new && vertex >= 0 && (size_t)vertex < did->n_old_vertices;
    return moved ? did->vertex_new[vertex] : vertex;
}

int cli_vertex_point(dmk_context *context, const dmk_mesh *mesh, const dmk_repairs *did,
                     int64_t vertex, dmk_point *point)
{
    return dmk_mesh_vertex_point(context, mesh, cli_vertex_now(did, vertex), point);
}

void json_repairs(cli_json *json, const dmk_repairs *did)
{
    if (!did->vertex_new) return;
    json_open(json, "repairs", '{');
    json_integer(json, "merged_vertices", (int64_t)did->merged_vertices);
    json_integer(json, "flipped_triangles", (int64_t)did->flipped_triangles);
    json_integer(json, "degenerate_triangles", (int64_t)did->degenerate_triangles);
    json_integer(json, "duplicate_triangles", (int64_t)did->duplicate_triangles);
    json_integer(json, "split_edges", (int64_t)did->split_edges);
    json_integer(json, "turned_triangles", (int64_t)did->turned_triangles);
    json_integer(json, "split_vertices", (int64_t)did->split_vertices);
    json_integer(json, "seam_edges", (int64_t)did->seam_edges);
    json_close(json, '{');
}
