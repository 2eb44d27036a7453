/* Mesh files as the commands read them: with --repair or without, and what is reported of them. */
#include "cli.h"
#include "ranks.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

/* A file as a rank sees it; a digest "" where there is none. */
typedef struct sight {
    int64_t inode, bytes, seconds, nanoseconds;
    char digest[40]; /* not 33: memcmp would meet what lies behind it */
} sight;

static sight look_at(const char *path, bool closely)
{
    struct stat file;
    sight s = {0};
    if (stat(path, &file) != 0 || !S_ISREG(file.st_mode)) return s;
    s = (sight){(int64_t)file.st_ino, (int64_t)file.st_size, (int64_t)file.st_mtim.tv_sec,
                (int64_t)file.st_mtim.tv_nsec, "?"};
    if (closely) cli_digest_file(path, s.digest);
    return s;
}

/* The first rank that sees another file there than the ranks before; -1: none does, or not all see one. */
static int find_another(const sight *all, int n, bool closely)
{
    int first = 0;
    while (first < n && !all[first].digest[0]) first++;
    for (int r = first + 1; r < n; r++) {
        if (!all[r].digest[0]) continue;
        if (closely ? strcmp(all[r].digest, all[first].digest) != 0
                    : memcmp(&all[r], &all[first], sizeof *all) != 0)
            return r;
    }
    return -1;
}

/* What is in the file is read only where it may be another one: copies on the ranks' own disks. */
int cli_check_same_file(const char *path)
{
    const dmk_ranks *ranks = cli_ranks();
    if (!ranks) return EXIT_OK;
    sight *all = calloc((size_t)ranks->size, sizeof *all);
    int rc = all ? DMK_OK : DMK_E_NOMEM, another = 0;
    for (int closely = 0; closely < 2 && another >= 0 && rc == DMK_OK; closely++) {
        const sight mine = look_at(path, closely);
        rc = cli_ranks_gather(&mine, all, sizeof mine);
        if (rc == DMK_OK) another = find_another(all, ranks->size, closely);
    }
    free(all);
    if (rc != DMK_OK) return cli_ranks_error(rc);
    if (another < 0) return EXIT_OK;
    return cli_error(EXIT_IO,
                     "'%s' on rank %d is another file than on the ranks before it: copy the same "
                     "one to all machines, or put it where all of them see it",
                     path, another);
}

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
    flockfile(stderr); /* one line, whoever else has something to say */
    fprintf(stderr, "dmkcl: %s repaired: ", path);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        if (counts[i].n == 0) continue;
        fprintf(stderr, "%s%zu %s", before, counts[i].n,
                counts[i].n == 1 ? counts[i].one : counts[i].many);
        before = ", ";
    }
    fprintf(stderr, "%s\n", *before ? "" : "nothing needed repair");
    funlockfile(stderr);
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
    flockfile(stderr);
    fprintf(stderr, "dmkcl: warning: %s is in %zu pieces", path, info.n_components);
    if (whole.n_components > 0 && whole.n_components < info.n_components) {
        fprintf(stderr, "; --repair, which merges coincident vertices, leaves %zu",
                whole.n_components);
    }
    fputc('\n', stderr);
    funlockfile(stderr);
}

int cli_read_mesh(dmk_context *context, const char *path, const cli_reading *how, dmk_repairs *did,
                  dmk_mesh **mesh)
{
    if (how->keep_memory) cli_make_room_for_file(path);
    const int rc = how->repair ? dmk_mesh_read_repaired(context, path, did, mesh)
                               : dmk_mesh_read_dealt(context, path, how->ranks, mesh);
    if (rc == DMK_OK && !how->keep_memory) cli_save_memory(*mesh, how->shares);
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
