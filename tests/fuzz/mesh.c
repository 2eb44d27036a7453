/* Every reader of the format table, and the checks behind it. The last byte of the input chooses the
 * suffix of the file that the bytes before it are put into. A mesh that is taken must be sound, and must
 * come back the same when it is written and read again. */
#include "fuzz.h"

#include "io/io.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MAX_NAMES = 32, MAX_SIZE = 8192 };

/* Readers, and how often each was tried and took a mesh: printed at the end. The suffix decides where the
 * content does not. */
static struct reader {
    const char *names; /* of format.c's table */
    bool (*sniff)(const dmk_file *file);
    unsigned long tried, taken;
} reader[] = {
    {"gzip", dmk_gzip_sniff, 0, 0},    {"PLY", dmk_ply_sniff, 0, 0},
    {"VTP, VTU", dmk_vtk_sniff, 0, 0}, {"VTK", dmk_vtk_legacy_sniff, 0, 0},
    {"MSH", dmk_msh_sniff, 0, 0},      {"OFF", dmk_off_sniff, 0, 0},
    {"OBJ", dmk_obj_sniff, 0, 0},      {"STL", dmk_stl_sniff, 0, 0},
};
#define N_READERS (sizeof reader / sizeof *reader)

static struct {
    dmk_context *ctx;
    char folder[200];
    char name[MAX_NAMES][240]; /* one file under the names of all formats that are read */
    struct reader *by_name[MAX_NAMES];
    int n_names, fd;
    char copy[240];
} it;

static void clear_folder(void)
{
    for (size_t i = 0; i < N_READERS; i++) {
        printf("reader %-8s %10lu tried %10lu taken\n", reader[i].names, reader[i].tried,
               reader[i].taken);
    }
    for (int i = 0; i < it.n_names; i++) unlink(it.name[i]);
    unlink(it.copy);
    rmdir(it.folder);
    dmk_context_destroy(&it.ctx);
}

static struct reader *find_reader(const char *name)
{
    for (size_t i = 0; i < N_READERS; i++) {
        if (strstr(reader[i].names, name)) return &reader[i];
    }
    fuzz_broken("every format has a row in the table of readers", name, 0);
    return NULL;
}

static void add_name(const char *format, const char *suffix, size_t n)
{
    it.by_name[it.n_names] = find_reader(format);
    snprintf(it.name[it.n_names], sizeof *it.name, "%s/mesh%.*s", it.folder, (int)n, suffix);
    if (it.n_names == 0)
        it.fd = open(it.name[0], O_RDWR | O_CREAT | O_TRUNC, 0600);
    else
        REQUIRE(link(it.name[0], it.name[it.n_names]) == 0);
    it.n_names++;
}

static void prepare(void)
{
    dmk_format_info format;
    bool memory = access("/dev/shm", W_OK) == 0;
    snprintf(it.folder, sizeof it.folder, "%s/dmkcl-fuzz-XXXXXX", memory ? "/dev/shm" : "/tmp");
    REQUIRE(mkdtemp(it.folder));
    REQUIRE(dmk_context_create(&it.ctx) == DMK_OK);
    for (size_t i = 0; dmk_format_get(i, &format) == DMK_OK; i++) {
        for (const char *s = format.suffixes; format.reads_mesh && *s && it.n_names < MAX_NAMES;) {
            size_t n = strcspn(s, " ");
            add_name(format.name, s, n);
            s += n + (s[n] == ' ');
        }
    }
    snprintf(it.copy, sizeof it.copy, "%s/copy.ply", it.folder);
    REQUIRE(it.n_names > 0 && it.fd >= 0);
    atexit(clear_folder);
}

static void check_sound(const dmk_mesh *m, const dmk_mesh_info *info)
{
    const int32_t *t = dmk_mesh_triangles(m);
    const double *x = dmk_mesh_vertices(m);
    REQUIRE(info->n_triangles > 0 && info->n_components > 0);
    REQUIRE(info->area > 0 && isfinite(info->area) && info->min_edge > 0);
    REQUIRE(info->min_angle >= 0 && info->max_angle <= 180);
    for (size_t i = 0; i < 3 * info->n_triangles; i++) {
        REQUIRE(t[i] >= 0 && (size_t)t[i] < info->n_vertices);
    }
    for (size_t i = 0; i < 3 * info->n_vertices; i++) REQUIRE(isfinite(x[i]));
}

static void check_places(const dmk_mesh *m)
{
    dmk_point p;
    const double centre[3] = {0.1, 0.2, 0.3};
    int64_t corner = dmk_mesh_triangles(m)[0];
    REQUIRE(dmk_mesh_vertex_point(it.ctx, m, corner, &p) == DMK_OK);
    int rc = dmk_mesh_project(it.ctx, m, centre, &p);
    if (rc != DMK_OK) return;
    REQUIRE(fabs(p.weight[0] + p.weight[1] + p.weight[2] - 1) < 1e-9);
    REQUIRE(p.weight[0] >= 0 && p.weight[1] >= 0 && p.weight[2] >= 0);
}

static void check_copy(const dmk_mesh *m, const dmk_mesh_info *info)
{
    dmk_mesh *copy = NULL;
    dmk_mesh_info same;
    REQUIRE(dmk_mesh_write(it.ctx, m, it.copy) == DMK_OK);
    REQUIRE(dmk_mesh_read(it.ctx, it.copy, &copy) == DMK_OK);
    dmk_mesh_get_info(copy, &same);
    REQUIRE(same.n_vertices == info->n_vertices && same.n_triangles == info->n_triangles);
    REQUIRE(memcmp(dmk_mesh_vertices(m), dmk_mesh_vertices(copy),
                   3 * info->n_vertices * sizeof(double)) == 0);
    REQUIRE(memcmp(dmk_mesh_triangles(m), dmk_mesh_triangles(copy),
                   3 * info->n_triangles * sizeof(int32_t)) == 0);
    dmk_mesh_destroy(&copy);
}

static struct reader *which_reader(const uint8_t *data, size_t size, int name)
{
    static char text[MAX_SIZE + 1];
    dmk_file file = {it.name[name], text, size};
    if (size <= MAX_SIZE) {
        memcpy(text, data, size);
        text[size] = '\0';
        for (size_t i = 0; i < N_READERS; i++) {
            if (reader[i].sniff(&file)) return &reader[i];
        }
    }
    return it.by_name[name];
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    dmk_mesh *m = NULL;
    dmk_mesh_info info;
    if (!it.ctx) prepare();
    if (size == 0) return 0;
    size--;
    REQUIRE(pwrite(it.fd, data, size, 0) == (ssize_t)size && ftruncate(it.fd, (off_t)size) == 0);
    int name = data[size] % it.n_names;
    struct reader *r = which_reader(data, size, name);
    r->tried++;
    int rc = dmk_mesh_read(it.ctx, it.name[name], &m);
    if (rc != DMK_OK) {
        REQUIRE(!m && (rc == DMK_E_FORMAT || rc == DMK_E_MESH));
        REQUIRE(*dmk_context_message(it.ctx));
        return 0;
    }
    r->taken++;
    dmk_mesh_get_info(m, &info);
    check_sound(m, &info);
    check_places(m);
    check_copy(m, &info);
    dmk_mesh_destroy(&m);
    return 0;
}
