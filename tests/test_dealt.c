/* A mesh file read by several ranks, threads of this process: the mesh of dmk_mesh_read, of which each rank has read
 * its range of the bytes, or the first one all of it. */
#include "files.h"
#include "meeting.h"

#include "io/dealt.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { ROWS = 40, COLUMNS = 50, N_VERTICES = ROWS * COLUMNS };
enum { N_TRIANGLES = 2 * (ROWS - 1) * (COLUMNS - 1) };

/* A patch of a paraboloid. */
static double xyz[3 * N_VERTICES];
static int32_t triangle[3 * N_TRIANGLES];

static void make_patch(void)
{
    int32_t *t = triangle;
    for (int v = 0; v < N_VERTICES; v++) {
        const double x = v % COLUMNS, y = (double)(v / COLUMNS);
        memcpy(xyz + 3 * (size_t)v, (double[]){x, y, (x * x + y * y) / 64}, 3 * sizeof *xyz);
        if (v % COLUMNS == COLUMNS - 1 || v / COLUMNS == ROWS - 1) continue;
        const int32_t pair[6] = {v, v + 1, v + COLUMNS + 1, v, v + COLUMNS + 1, v + COLUMNS};
        memcpy(t, pair, sizeof pair);
        t += 6;
    }
}

typedef struct seat {
    const char *path;
    member m;
    dmk_soup soup;
    uint64_t bytes;
    int rc, mesh_rc, n_reports;
    char message[1024], mesh_message[1024];
} seat;

static int on_progress(const dmk_progress *report, void *n)
{
    if (strcmp(report->stage, "read") == 0) ++*(int *)n;
    return 0;
}

static void *sit(void *argument)
{
    seat *s = argument;
    dmk_context *ctx = NULL;
    dmk_mesh *mesh = NULL;
    const dmk_ranks ranks = ranks_of(&s->m, 0);
    s->rc = dmk_context_create(&ctx);
    if (s->rc == DMK_OK) s->rc = dmk_soup_read_dealt(ctx, s->path, &ranks, &s->soup, &s->bytes);
    snprintf(s->message, sizeof s->message, "%s", dmk_context_message(ctx));
    dmk_context_set_progress(ctx, on_progress, &s->n_reports);
    s->mesh_rc = dmk_mesh_read_dealt(ctx, s->path, &ranks, &mesh);
    snprintf(s->mesh_message, sizeof s->mesh_message, "%s", dmk_context_message(ctx));
    dmk_mesh_destroy(&mesh);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void sit_all(const char *path, int size, bool broken, seat seats[MOST_RANKS])
{
    meeting all = {.size = size, .broken = broken};
    for (int k = 0; k < size; k++) seats[k] = (seat){.path = path, .m = {.all = &all, .rank = k}};
    assert_int_equal(meet(&all, sit, seats, sizeof *seats), 0);
}

/* The file at f->path by 1 to MOST_RANKS ranks; `by_range`: each of several reads its share of `n` bytes and no more
 * than a header and some sizes beside. */
static void try_file(fixture *f, size_t n, bool by_range)
{
    seat seats[MOST_RANKS];
    for (int size = 1; size <= MOST_RANKS; size++) {
        sit_all(f->path, size, false, seats);
        for (int k = 0; k < size; k++) {
            seat *s = &seats[k];
            if (s->rc != DMK_OK) print_message("%s\n", s->message);
            assert_int_equal(s->rc, DMK_OK);
            assert_int_equal(s->mesh_rc, DMK_OK);
            assert_true(s->n_reports > 0);
            assert_int_equal(s->soup.n_vertices, N_VERTICES);
            assert_int_equal(s->soup.n_triangles, N_TRIANGLES);
            assert_memory_equal(s->soup.xyz, xyz, sizeof xyz);
            assert_memory_equal(s->soup.triangle, triangle, sizeof triangle);
            if (by_range)
                assert_in_range(s->bytes, n / (unsigned)size / 2, n / (unsigned)size + 65536 + 64);
            else if (k == 0)
                assert_true(s->bytes >= n);
            dmk_soup_free(&s->soup);
        }
    }
    remove(f->path);
}

/* ---- files ------------------------------------------------------------------------------------ */

static size_t size_of(const char *path)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    fseek(file, 0, SEEK_END);
    const long n = ftell(file);
    fclose(file);
    return (size_t)n;
}

/* More triangles than numbers of 32 bits count, in a file of zeros but for its header: said before any is read. */
static void test_too_many(void **state)
{
    static const char *const count[] = {"200000000", "3000000000"};
    fixture *f = *state;
    for (size_t i = 0; i < COUNT(count); i++) {
        seat seats[MOST_RANKS];
        FILE *file = fopen(path_of(f, "huge.ply"), "wb");
        assert_non_null(file);
        const int n = fprintf(file,
                              "ply\nformat binary_little_endian 1.0\nelement vertex 1000\n"
                              "property float x\nproperty float y\nproperty float z\n"
                              "element face %s\nproperty list uchar int vertex_indices\n"
                              "end_header\n",
                              count[i]);
        assert_int_equal(fclose(file), 0);
        assert_int_equal(truncate(f->path, n + 12000 + 13 * strtoll(count[i], NULL, 10)), 0);
        sit_all(f->path, 3, false, seats);
        for (int k = 0; k < 3; k++) {
            assert_int_equal(seats[k].rc, DMK_E_MESH);
            assert_int_equal(seats[k].mesh_rc, DMK_E_MESH);
            assert_non_null(strstr(seats[k].message, "too many for 32-bit indices"));
            assert_non_null(strstr(seats[k].message, "huge.ply: "));
            assert_non_null(strstr(seats[k].message, count[i]));
            assert_true(seats[k].bytes <= 65536);
        }
        remove(f->path);
    }
}

/* Ranks share the search for what is wrong at edges and vertices: who looks there, all say it. */
static void test_faulty(void **state)
{
    static const struct {
        const char *text, *message;
    } files[] = {{"OFF 7 8 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n2 0 0\n0 2 0\n0 0 2\n"
                  "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n3 0 5 4\n3 0 4 6\n3 0 6 5\n3 4 5 6\n",
                  "m.off: non-manifold vertex 0: triangles 0 and 4"},
                 {"OFF 7 8 0\n0 0 1\n1 0 0\n0 1 0\n0 0 2\n2 0 0\n0 2 0\n0 0 0\n"
                  "3 6 2 1\n3 6 1 3\n3 6 3 2\n3 1 2 3\n3 6 5 4\n3 6 4 0\n3 6 0 5\n3 4 5 0\n",
                  "m.off: non-manifold vertex 6: triangles 0 and 4"},
                 {"OFF 7 6 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n2 0 0\n0 2 0\n0 0 2\n"
                  "3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n3 4 5 6\n3 5 4 6\n",
                  "m.off: triangles 4 and 5 are duplicates, back to back"}};
    fixture *f = *state;
    for (size_t i = 0; i < COUNT(files); i++) {
        put_file(f, "m.off", files[i].text, strlen(files[i].text));
        for (int size = 1; size <= MOST_RANKS; size++) {
            seat seats[MOST_RANKS];
            sit_all(f->path, size, false, seats);
            for (int k = 0; k < size; k++) {
                assert_int_equal(seats[k].mesh_rc, DMK_E_MESH);
                if (!strstr(seats[k].mesh_message, files[i].message))
                    fail_msg("%s", seats[k].mesh_message);
                dmk_soup_free(&seats[k].soup);
            }
        }
        remove(f->path);
    }
}

static void test_written(void **state)
{
    static const struct {
        const char *name;
        bool by_range;
    } files[] = {{"m.ply", true}, {"m.vtp", true}, {"m.vtu", false}, {"m.off", false}};
    fixture *f = *state;
    for (size_t i = 0; i < COUNT(files); i++) {
        dmk_mesh *mesh;
        assert_int_equal(dmk_mesh_create(f->ctx, N_VERTICES, xyz, N_TRIANGLES, triangle, &mesh),
                         DMK_OK);
        assert_int_equal(dmk_mesh_write(f->ctx, mesh, path_of(f, files[i].name)), DMK_OK);
        dmk_mesh_destroy(&mesh);
        try_file(f, size_of(f->path), files[i].by_range);
    }
}

/* n bytes, the other way round. */
static void put_swapped(FILE *file, const void *value, size_t n)
{
    const char *at = value;
    while (n > 0) fputc(at[--n], file);
}

/* Single precision and a colour; an element before and one between; indices behind a flag, in the byte order that is
 * not ours. `corners` of triangle `odd`. */
static size_t put_foreign(fixture *f, int odd, uint8_t corners)
{
    FILE *file = fopen(path_of(f, "foreign.ply"), "wb");
    assert_non_null(file);
    fprintf(file, "ply\nformat binary_%s_endian 1.0\nelement camera 1\nproperty double fov\n",
            dmk_is_little_endian() ? "big" : "little");
    fprintf(file, "element vertex %d\nproperty uchar red\nproperty float z\nproperty float x\n",
            N_VERTICES);
    fprintf(file, "property float y\nelement light 2\nproperty short s\nelement face %d\n",
            N_TRIANGLES);
    fprintf(file, "property uchar flag\nproperty list uchar uint vertex_index\nend_header\n");
    put_swapped(file, &(double){1}, sizeof(double));
    for (size_t v = 0; v < N_VERTICES; v++) {
        const float p[3] = {(float)xyz[3 * v + 2], (float)xyz[3 * v], (float)xyz[3 * v + 1]};
        fputc(7, file);
        for (int k = 0; k < 3; k++) put_swapped(file, &p[k], sizeof *p);
    }
    for (int k = 0; k < 4; k++) fputc(9, file);
    for (int t = 0; t < N_TRIANGLES; t++) {
        fputc(1, file);
        fputc(t == odd ? corners : 3, file);
        for (size_t k = 0; k < 3; k++)
            put_swapped(file, &triangle[3 * (size_t)t + k], sizeof *triangle);
        for (int k = 3; t == odd && k < corners; k++) put_swapped(file, &triangle[0], 4);
    }
    fclose(file);
    return size_of(f->path);
}

static void test_foreign(void **state)
{
    fixture *f = *state;
    try_file(f, put_foreign(f, -1, 3), true);
}

/* A polygon far behind: all ranks see what one of them saw. */
static void test_polygon(void **state)
{
    fixture *f = *state;
    seat seats[MOST_RANKS];
    put_foreign(f, N_TRIANGLES - 5, 4);
    sit_all(f->path, 3, false, seats);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(seats[k].rc, DMK_OK);
        assert_int_equal(seats[k].soup.n_triangles, N_TRIANGLES + 1);
        assert_memory_equal(seats[k].soup.triangle, seats[0].soup.triangle,
                            3 * (N_TRIANGLES + 1) * sizeof *triangle);
    }
    for (int k = 0; k < 3; k++) dmk_soup_free(&seats[k].soup);
    remove(f->path);
}

/* Failures are the first rank's, with its words, on all. */
static void refused(fixture *f, int status, const char *message)
{
    seat seats[MOST_RANKS];
    sit_all(f->path, 3, false, seats);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(seats[k].rc, status);
        if (!strstr(seats[k].message, message)) print_message("%s\n", seats[k].message);
        assert_non_null(strstr(seats[k].message, message));
        dmk_soup_free(&seats[k].soup);
    }
    remove(f->path);
}

/* Two pieces in raw bytes: no rank takes the first for the whole. */
static void test_two_pieces(void **state)
{
#define ARRAY(type, name, more, offset)                                                            \
    "<DataArray type=\"" type "\" Name=\"" name "\" " more "format=\"appended\" offset=\"" offset  \
    "\"/>"
#define PIECE                                                                                      \
    "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\"><Points>" ARRAY(                              \
        "Int8", "Points", "NumberOfComponents=\"3\" ",                                             \
        "0") "</Points><Polys>" ARRAY("Int8", "connectivity", "", "13")                            \
        ARRAY("Int8", "offsets", "", "20") "</Polys></Piece>"
    static const char text[] = "<VTKFile type=\"PolyData\"><PolyData>" PIECE PIECE
                               "</PolyData><AppendedData encoding=\"raw\">_"
                               "\11\0\0\0\0\0\0\1\0\0\0\1\0\3\0\0\0\0\1\2\1\0\0\0\3";
    fixture *f = *state;
    seat seats[MOST_RANKS];
    put_file(f, "m.vtp", text, sizeof text - 1);
    sit_all(f->path, 3, false, seats);
    for (int k = 0; k < 3; k++) {
        if (seats[k].rc != DMK_OK) print_message("%s\n", seats[k].message);
        assert_int_equal(seats[k].rc, DMK_OK);
        assert_int_equal(seats[k].soup.n_vertices, 6);
        assert_int_equal(seats[k].soup.n_triangles, 2);
        dmk_soup_free(&seats[k].soup);
    }
    remove(f->path);
}

static void test_refused(void **state)
{
    fixture *f = *state;
    path_of(f, "none.ply");
    refused(f, DMK_E_IO, "cannot open");
    const size_t n = put_foreign(f, -1, 3);
    assert_int_equal(truncate(f->path, (off_t)n - 5), 0);
    refused(f, DMK_E_FORMAT, "cut short");
    put_foreign(f, N_TRIANGLES / 2, 2);
    refused(f, DMK_E_FORMAT, "2 corners");
    put_file(f, "m.vtp", "<VTKFile", 8);
    refused(f, DMK_E_FORMAT, "the file ends before </VTKFile>; it is cut short");
}

static void test_lost_touch(void **state)
{
    fixture *f = *state;
    seat seats[MOST_RANKS];
    put_foreign(f, -1, 3);
    sit_all(f->path, 2, true, seats);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(seats[k].rc, DMK_E_DEVICE);
        assert_non_null(strstr(seats[k].message, "lost touch"));
    }
    remove(f->path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_written),    TEST(test_faulty),  TEST(test_foreign),    TEST(test_polygon),
        TEST(test_two_pieces), TEST(test_refused), TEST(test_lost_touch), TEST(test_too_many)};
    make_patch();
    return cmocka_run_group_tests_name("dealt", tests, NULL, NULL);
}
