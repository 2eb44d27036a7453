/* Files: every format both ways with all bits of a double, what is refused and how it is said,
 * whole files or none. */
#include "files.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

/* A tetrahedron whose coordinates need all their bits, and a vertex that is in no triangle. */
static const double xyz[15] = {
    1.0 / 3, -2.0 / 7, 1e-300,   1.1,     0.1,      0.30000000000000004,    -0.0, 1000.0 / 7,
    5e-324,  0.2,      -1.0 / 3, 1e5 / 3, 4.9e-320, 1.7976931348623157e308, -1e-5};
static const int32_t triangles[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2};

static dmk_mesh *make_mesh(fixture *f)
{
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 5, xyz, 4, triangles, &m), DMK_OK);
    return m;
}

/* ---- meshes both ways ---- */

static void test_meshes_keep_every_bit(void **state)
{
    static const char *const names[] = {"a.off", "a.obj", "A.OFF", "b.c.Obj",
                                        "a.ply", "a.vtp", "a.vtu"};
    fixture *f = *state;
    dmk_mesh *m = make_mesh(f);
    for (size_t i = 0; i < COUNT(names); i++) {
        assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, names[i])), DMK_OK);
        assert_int_equal(count_files(f), 1);
        dmk_mesh *back = read_mesh(f, names[i]);
        assert_int_equal(back->n_vertices, 5);
        assert_int_equal(back->n_triangles, 4);
        assert_memory_equal(back->xyz, xyz, sizeof xyz);
        assert_memory_equal(back->triangle, triangles, sizeof triangles);
        dmk_mesh_destroy(&back);
        remove_file(f, names[i]);
    }
    dmk_mesh_destroy(&m);
}

enum { LARGE = 120 };

/* A bent sheet of LARGE x LARGE vertices: each of its arrays is larger than every buffer. */
static dmk_mesh *make_large_mesh(fixture *f)
{
    double *x = calloc(3 * LARGE * LARGE, sizeof *x);
    int32_t *t = calloc(6 * LARGE * LARGE, sizeof *t);
    size_t n = 0;
    for (int v = 0; v < LARGE * LARGE; v++) {
        x[3 * v] = v / LARGE + sin(v) / 3;
        x[3 * v + 1] = v % LARGE + cos(v) / 3;
        x[3 * v + 2] = sin(3 * v) / 7;
    }
    for (int v = 0; v < LARGE * (LARGE - 1); v++) {
        if (v % LARGE == LARGE - 1) continue;
        const int32_t two[6] = {v, v + LARGE, v + 1, v + 1, v + LARGE, v + LARGE + 1};
        memcpy(t + 3 * n, two, sizeof two);
        n += 2;
    }
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_adopt(f->ctx, LARGE * LARGE, x, n, t, &m), DMK_OK);
    return m;
}

static void test_large_meshes(void **state)
{
    static const char *const names[] = {"m.off", "m.obj", "m.ply", "m.vtp", "m.vtu"};
    fixture *f = *state;
    dmk_mesh *m = make_large_mesh(f);
    size_t n_vertices = (size_t)m->n_vertices, n_triangles = (size_t)m->n_triangles;
    for (size_t i = 0; i < COUNT(names); i++) {
        assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, names[i])), DMK_OK);
        dmk_mesh *back = read_mesh(f, names[i]);
        assert_memory_equal(back->xyz, m->xyz, 3 * n_vertices * sizeof *m->xyz);
        assert_memory_equal(back->triangle, m->triangle, 3 * n_triangles * sizeof *m->triangle);
        dmk_mesh_destroy(&back);
        remove_file(f, names[i]);
    }
    dmk_mesh_destroy(&m);
}

/* ---- what is accepted ---- */

#define SQUARE "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

static void test_off_variants(void **state)
{
    static const char *const texts[] = {
        "OFF\n4 2 5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
        "OFF 4 2 5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3", /* no last line end */
        "# me\n\nOFF # kind\n# counts:\n4 2 0 # three\n\n0 0 0 # a\n1 0 0\n1 1 0\n\n0 1 0\n"
        "3 0 1 2 # f\n\n3 0 2 3\n# end\n",
        SQUARE "3 0 1 2\n3 0 2 3\n2 0 1\n", SQUARE "3 0 1 2\n3 0 2 3\n3 0 1 4\n",
        SQUARE "3 0 1 2\n3 0 2 3\n3 0 1\n",
        "OFF\r4 2 5 # caf\xe9\r0 0 0\r1 0 0\r1 1 0\r0 1 0\r3 0 1 2\r3 0 2 3",
        "OFF\r\n4 2 5\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n3 0 1 2\r\n3 0 2 3\r\n",
        "OFF\n4\t2\n  0. 0.0 0e5 1e0 0 0 +1 1 0 0 1 0\n3  0 1 2\n 3 0 2 3 \n", /* free form */
        "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0.5 0.5 0.5 1\n",
        "4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", /* no keyword */
        "COFF\n4 2 0\n0 0 0 1 2 3 4\n1 0 0 9 9 9 9\n1 1 0 .1 .2 .3 1\n0 1 0 0 0 0\n3 0 1 2\n"
        "3 0 2 3\n",
        "NOFF\n4 2 0\n0 0 0 0 0 1\n1 0 0 0 0 1\n1 1 0 0 0 1\n0 1 0 0 0 1\n3 0 1 2\n3 0 2 3\n",
        "STCNOFF\n4 2 0\n0 0 0 0 0 1 1 1 1 1 0 0\n1 0 0 0\n1 1 0 0\n0 1 0 0\n3 0 1 2\n3 0 2 3\n",
        /* colours that the keyword does not tell of */
        "OFF\n4 2 0\n0 0 0 4 5 6\n1 0 0 3 0 1\n1 1 0 3 0 1\n\n0 1 0 1 1 1\n3 0 1 2\n3 0 2 3\n",
        "OFF 4 1 0\n0 0 0 .1 .2 .3 1\n1 0 0 3 1 0 1\n1 1 0 3 0 1 1\n0 1 0 1 1 1 1\n4 0 1 2 3",
        "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"}; /* a quadrilateral */
    for (size_t i = 0; i < COUNT(texts); i++) check_square(read_text(*state, "m.off", texts[i]));
    check_square(
        read_text(*state, "named.obj", texts[0])); /* the content counts, then the suffix */
    check_square(read_text(*state, "named", texts[0]));
}

static void test_obj_variants(void **state)
{
    static const char *const texts[] = {
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4",
        ("# me\nmtllib a.mtl\no thing\n  v 0 0 0 1.0\nv\t1 0 0 .5 .5 .5\r\nv 1 1 0 # c\nv 0 1 0\n"
         "vn 0 0 1\nvt 0 0\nvp 1 2\ng all\nusemtl red\ns off\nf 1/1 2/1 3/1\nf 1/1/1 3//1 4/\n"
         "l 1 2\n"),
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4 -2 4\n", /* relative */
        "f 1 2 3\nf 1 3 4\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n",      /* faces first */
        "v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3 4\r",
        "v 0 0 \\\n0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2\\\r\n 3\nf 1 \\\n\\\n3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nfo 1 3 4\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"};
    for (size_t i = 0; i < COUNT(texts); i++) check_square(read_text(*state, "m.obj", texts[i]));
    check_square(read_text(*state, "named.off", texts[0]));
    check_square(read_text(*state, "named", texts[2]));
}

static void test_polygons_become_fans(void **state)
{
    static const int32_t fan[] = {1, 2, 3, 1, 3, 4, 1, 4, 0};
    static const char *const texts[] = {
        "OFF\n5 1 0\n0 0 0\n2 0 0\n3 1 0\n1 2 0\n-1 1 0\n5 1 2 3 4 0\n",
        "v 0 0 0\nv 2 0 0\nv 3 1 0\nv 1 2 0\nv -1 1 0\nf 2 3 4 5 1\n"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        dmk_mesh *m = read_text(*state, "m", texts[i]);
        assert_int_equal(m->n_triangles, 3);
        assert_memory_equal(m->triangle, fan, sizeof fan);
        dmk_mesh_destroy(&m);
    }
}

/* A dart whose first corner sees its other side from outside, in each format that has polygons. */
static void test_polygons_that_are_no_fans(void **state)
{
#define DART "0 0 0 2 1 0 0 .5 0 -2 1 0"
    static const char *const texts[] = {
        "OFF\n4 1 0\n" DART "\n4 1 2 3 0\n",
        "v 0 0 0\nv 2 1 0\nv 0 .5 0\nv -2 1 0\nf 2 3 4 1\n",
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement "
        "vertex 4\nproperty float x\nproperty float y\nproperty float z\nend_header\n4 1 2 3 "
        "0\n" DART,
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n" DART
        "\nPOLYGONS 1 5\n4 1 2 3 0\n",
        "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" NumberOfPolys=\"1\">"
        "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">" DART
        "</DataArray></Points><Polys><DataArray type=\"Int32\" Name=\"connectivity\" "
        "format=\"ascii\">1 2 3 0</DataArray><DataArray type=\"Int32\" Name=\"offsets\" "
        "format=\"ascii\">4</DataArray></Polys></Piece></PolyData></VTKFile>",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 2 1 0\n3 0 .5 0\n4 -2 1 0\n"
        "$EndNodes\n$Elements\n1\n1 3 0 2 3 4 1\n$EndElements\n"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        dmk_mesh_info info;
        dmk_mesh *m = read_text(*state, "m", texts[i]);
        dmk_mesh_get_info(m, &info);
        if (info.n_triangles != 2 || fabs(info.area - 1) > 1e-12)
            fail_msg("text %zu: area %.17g", i, info.area);
        dmk_mesh_destroy(&m);
    }
}

/* Some editors write one before a text. */
static void test_skips_byte_order_marks(void **state)
{
    static const char *const texts[] = {
        "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n",
        "ply\r\nformat ascii 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n"
        "property float z\r\nelement face 2\r\nproperty list uchar int vertex_indices\r\n"
        "end_header\r\n0 0 0\r\n1 0 0\r\n1 1 0\r\n0 1 0\r\n3 0 1 2\r\n3 0 2 3\r\n",
        "solid\nloop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendsolid\n",
        "# vtk DataFile Version 3.0\nsquare\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0\n"
        "1 1 0 0 1 0\nPOLYGONS 2 8\n3 0 1 2\n3 0 2 3\n",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n"
        "$EndNodes\n$Elements\n2\n1 2 0 1 2 3\n2 2 0 1 3 4\n$EndElements\n"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        char text[512];
        snprintf(text, sizeof text, "\xef\xbb\xbf%s", texts[i]);
        check_square(read_text(*state, "m", text));
    }
}

/* To write a result with: no edges, and all that has been told of it. */
static void test_reads_known(void **state)
{
    static const char text[] = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
    fixture *f = *state;
    dmk_mesh_info info, told;
    dmk_mesh *m = NULL;
    dmk_point p = {0};
    put_file(f, "m.off", text, sizeof text - 1);
    assert_int_equal(dmk_mesh_read(f->ctx, f->path, &m), DMK_OK);
    dmk_mesh_get_info(m, &info);
    dmk_mesh_destroy(&m);
    assert_int_equal(dmk_mesh_read_known(f->ctx, f->path, &info, &m), DMK_OK);
    dmk_mesh_get_info(m, &told);
    assert_memory_equal(&told, &info, sizeof info);
    assert_int_equal(dmk_mesh_check_edges(f->ctx, m), DMK_E_ARG);
    assert_int_equal(dmk_mesh_vertex_point(f->ctx, m, 3, &p), DMK_OK);
    assert_true(p.triangle == 1 && p.weight[2] == 1);
    check_square(m);
    info.n_triangles = 3;
    assert_int_equal(dmk_mesh_read_known(f->ctx, f->path, &info, &m), DMK_E_FORMAT);
    assert_non_null(strstr(dmk_context_message(f->ctx),
                           "m.off: 4 vertices and 2 triangles, but it had 4 and 3"));
    remove_file(f, "m.off");
}

/* A file that no memory holds is refused by its size, which a sparse one has at once. */
static void test_refuses_endless_files(void **state)
{
    fixture *f = *state;
    dmk_mesh *m = NULL;
    put_file(f, "m.off", "OFF", 3);
    if (truncate(path_of(f, "m.off"), (off_t)1 << 42) == 0) { /* where there may be one */
        assert_int_equal(dmk_mesh_read(f->ctx, f->path, &m), DMK_E_NOMEM);
        assert_non_null(strstr(dmk_context_message(f->ctx), "4398046511104 bytes, but half of"));
    }
    remove_file(f, "m.off");
}

/* A pipe has no size to ask for. */
static void test_reads_pipes(void **state)
{
    fixture *f = *state;
    int ends[2];
    char path[32];
    assert_int_equal(pipe(ends), 0);
    const char text[] = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    assert_int_equal(write(ends[1], text, sizeof text - 1), sizeof text - 1);
    close(ends[1]);
    snprintf(path, sizeof path, "/dev/fd/%d", ends[0]);
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_read(f->ctx, path, &m), DMK_OK);
    assert_int_equal(m->n_triangles, 1);
    dmk_mesh_destroy(&m);
    close(ends[0]);
}

/* ---- what is refused ---- */

static const refusal refusals[] = {
    {"m.off", "", DMK_E_FORMAT, "m.off: the file is empty"},
    {"m.off", "# nothing\n", DMK_E_FORMAT, "m.off:2: nothing but comments"},
    {"m.txt", "hello\n", DMK_E_FORMAT, "m.txt: neither its content nor its suffix"},
    {"m.txt", "hello\n", DMK_E_FORMAT, ".off .coff .noff "},
    {"m.off", "hello\n", DMK_E_FORMAT, "m.off:1: 'hello' where the number of vertices"},
    {"m.off", "OFF BINARY\n4 2 0\n", DMK_E_FORMAT, "m.off:1: binary OFF"},
    {"m.off", "4OFF\n4 2 0\n", DMK_E_FORMAT, "m.off:1: vertices that are not in three"},
    {"m.off", "nOFF\n4\n4 2 0\n", DMK_E_FORMAT, "m.off:1: vertices that are not in three"},
    {"m.off", "OFF\n", DMK_E_FORMAT, "m.off:2: the file ends before the number of vertices"},
    {"m.off", "OFF\n4\n", DMK_E_FORMAT, "m.off:3: the file ends before the number of faces"},
    {"m.off", "OFF\n4.5 2 0\n", DMK_E_FORMAT, "m.off:2: '4.5' where the number of vertices"},
    {"m.off", "OFF\n-4 2 0\n0 0 0\n", DMK_E_FORMAT, "m.off:2: -4 vertices"},
    {"m.off", "OFF\n4 -2 0\n0 0 0\n", DMK_E_FORMAT, "m.off:2: 4 vertices and -2 faces"},
    {"m.off", "OFF\n1000000000 2 0\n0 0 0\n", DMK_E_FORMAT, "m.off:2: 1000000000 vertices"},
    {"m.off", "OFF\n9223372036854775799 9223372036854775799 0\n0 0 0\n", DMK_E_FORMAT,
     "do not fit into the 9 bytes"},
    {"m.off", "OFF\n99999999999999999999 2 0\n", DMK_E_FORMAT, "m.off:2: '99999999999999999999'"},
    {"m.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 x 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", DMK_E_FORMAT,
     "m.off:5: 'x' where a vertex coordinate"},
    {"m.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 nan 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", DMK_E_FORMAT,
     "m.off:5: 'nan' where a vertex coordinate is expected: write a finite"},
    {"m.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1,5 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", DMK_E_FORMAT,
     "m.off:5: '1,5' where"},
    {"m.off", SQUARE "3 0 1 2\n3 0 2\n\n\n", DMK_E_FORMAT, "m.off:8: a face's vertex is missing"},
    {"m.off", SQUARE "3 0 1 2\n3 0 2 4\n", DMK_E_FORMAT,
     "m.off:8: vertex 4 of a face is out of range: there are 4, counted from 0"},
    {"m.off", SQUARE "3 0 1 2\n3 0 2 -1\n", DMK_E_FORMAT,
     "m.off:8: vertex -1 of a face is out of range: there are 4, counted from 0"},
    {"m.off", "OFF\n0 1 0\n3 0 0 0\n", DMK_E_FORMAT,
     "m.off:3: vertex 0 of a face is out of range: there are 0, counted from 0"},
    {"m.off", SQUARE "3 0 1 2\n3 0 2 3\n\n3 1 2 3\n", DMK_E_FORMAT,
     "m.off:10: a face behind the 2 that are counted; correct the count or remove it"},
    {"m.off", SQUARE "3 0 1 2\n2 0 2     \n", DMK_E_FORMAT, "m.off:8: a face with 2 corners"},
    {"m.off", SQUARE "3 0 1 2\n            ", DMK_E_FORMAT, "m.off:8: the file ends before"},
    {"m.off", SQUARE "3 0 1 2\n3 0 2 3.0\n", DMK_E_FORMAT, "m.off:8: '3.0' where a face's vertex"},
    {"m.off", "OFF\n4 0 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n", DMK_E_MESH, "m.off: 4 vertices and 0"},
    {"m.off", SQUARE "3 0 1 2\n3 0 1 3\n", DMK_E_MESH, "m.off: inconsistent orientation"},
    {"m.off", "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1e999 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", DMK_E_MESH,
     "m.off: vertex 2 lies at (1, inf, 0)"},
    {"m.obj", "", DMK_E_FORMAT, "m.obj: the file is empty"},
    {"m.obj", "hello\n", DMK_E_FORMAT, "m.obj: contains no faces"},
    {"m.obj", "v 0 0 0\nv 1 0 0\n", DMK_E_FORMAT, "m.obj: contains no faces"},
    {"m.obj", "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", DMK_E_FORMAT,
     "m.obj:2: a vertex coordinate is missing"},
    {"m.obj", "v 0 0 0\nv 1 y 0\nv 0 1 0\nf 1 2 3\n", DMK_E_FORMAT, "m.obj:2: 'y' where"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", DMK_E_FORMAT, "m.obj:4: vertex 4 of a face"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", DMK_E_FORMAT, "m.obj:4: vertex 0 of a face"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n", DMK_E_FORMAT, "m.obj:4: vertex -4 of"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", DMK_E_FORMAT, "m.obj:4: a face with 2"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3x\n", DMK_E_FORMAT, "m.obj:4: '3x' where a"},
    {"m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 3\n", DMK_E_MESH, "m.obj: triangles 0"},
};

static void test_refusals(void **state)
{
    check_refusals(*state, refusals, COUNT(refusals));
}

static void test_missing_files_and_folders(void **state)
{
    fixture *f = *state;
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_read(f->ctx, path_of(f, "none.off"), &m), DMK_E_IO);
    assert_non_null(strstr(dmk_context_message(f->ctx), "none.off: cannot open: No such file"));
    assert_int_equal(dmk_mesh_read(f->ctx, f->folder, &m), DMK_E_IO);
    assert_non_null(strstr(dmk_context_message(f->ctx), ": cannot read: Is a directory; name"));
    assert_int_equal(dmk_mesh_read(f->ctx, NULL, &m), DMK_E_ARG);
    assert_null(m);
}

/* Whatever stands in a file, reading ends well: whole files cut anywhere and with random bytes. */
static void test_damaged_files(void **state)
{
    static const char *const texts[] = {
        "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 # c\n3 0 2 3\n",
        "COFF 4 1\n0 0 0 1\n1 0 0 1\n1 1 0 1\n0 1 0 1\n4 0 1 2 3\n",
        "v 0 0 0\nv 1 0 \\\n0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf 1/1 3//2 4/1/1\n"};
    fixture *f = *state;
    uint64_t s = 1234567;
    for (size_t i = 0; i < COUNT(texts); i++) {
        size_t n = strlen(texts[i]);
        char text[256];
        for (size_t trial = 0; trial < n + 3000; trial++) {
            memcpy(text, texts[i], n);
            for (size_t k = n; k < trial; k += 1000) {
                s = s * 6364136223846793005ULL + 1442695040888963407ULL;
                text[(s >> 33) % n] = "0123456789-/.e# \n\\fv\0\377"[(s >> 48) % 23];
            }
            put_file(f, "m.off", text, trial < n ? trial : n);
            dmk_mesh *m = NULL;
            int rc = dmk_mesh_read(f->ctx, f->path, &m);
            assert_true((rc == DMK_OK) == (m != NULL));
            dmk_mesh_destroy(&m);
        }
    }
    remove_file(f, "m.off");
}

/* ---- results and cut loci ---- */

static const double mu[4] = {1.0 / 3, 0, 1e-300, 0.30000000000000004};
static const uint8_t acl[4] = {0, 1, 1, 0};
static const double u[5] = {0, -1.0 / 3, -2, -1e-9, -INFINITY};
static const double distance[5] = {0, 1.0 / 3, 2, 1e-9, INFINITY};

/* Start of an array's values in a VTK XML file with raw appended data; *n becomes its bytes. */
static const char *find_array(const char *content, const char *section, const char *name, size_t *n)
{
    char tag[64];
    uint64_t bytes;
    const char *at = strstr(content, section);
    snprintf(tag, sizeof tag, "Name=\"%s\"", name);
    if (!at || !(at = strstr(at, tag)) || !(at = strstr(at, "offset=\""))) {
        fail_msg("no array %s in %s", name, section);
        return NULL;
    }
    const char *data = strstr(content, "<AppendedData encoding=\"raw\">\n_") + 31;
    data += strtoull(at + 8, NULL, 10);
    memcpy(&bytes, data, sizeof bytes);
    *n = bytes;
    return data + sizeof bytes;
}

static void check_array(const char *content, const char *section, const char *name,
                        const void *values, size_t bytes)
{
    size_t n;
    const char *data = find_array(content, section, name, &n);
    assert_int_equal(n, bytes);
    assert_memory_equal(data, values, bytes);
}

static void test_results(void **state)
{
    static const int32_t ends[] = {3, 6, 9, 12};
    static const uint8_t types[] = {5, 5, 5, 5};
    static const char *const names[] = {"r.vtp", "r.vtu"};
    fixture *f = *state;
    dmk_mesh *m = make_mesh(f);
    dmk_fields fields = {.mesh = m, .mu = mu, .acl = acl, .u = u, .distance = distance};
    fields.source = (dmk_point){2, {0, 0.25, 0.75}};
    double source[3];
    assert_int_equal(dmk_mesh_point_xyz(f->ctx, m, &fields.source, source), DMK_OK);
    for (size_t i = 0; i < COUNT(names); i++) {
        size_t n;
        assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, names[i])), DMK_OK);
        char *content = get_file(f, names[i], &n);
        const char *cells = i == 0 ? "<Polys>" : "<Cells>";
        assert_non_null(strstr(content, "NumberOfPoints=\"5\""));
        assert_non_null(strstr(content, i == 0 ? "NumberOfPolys=\"4\"" : "NumberOfCells=\"4\""));
        assert_non_null(strstr(content, "<CellData Scalars=\"mu\">"));
        check_array(content, "<CellData", "mu", mu, sizeof mu);
        check_array(content, "<CellData", "acl", acl, sizeof acl);
        check_array(content, "<PointData", "u", u, sizeof u);
        check_array(content, "<PointData", "distance", distance, sizeof distance);
        check_array(content, "<Points>", "Points", xyz, sizeof xyz);
        check_array(content, cells, "connectivity", triangles, sizeof triangles);
        check_array(content, cells, "offsets", ends, sizeof ends);
        if (i == 1) check_array(content, cells, "types", types, sizeof types);
        check_array(content, "<FieldData>", "source", source, sizeof source);
        check_array(content, "<FieldData>", "source_triangle", &fields.source.triangle, 8);
        check_array(content, "<FieldData>", "source_weight", fields.source.weight, 24);
        assert_string_equal(content + n - 28, "\n</AppendedData>\n</VTKFile>\n");
        free(content);
        remove_file(f, names[i]);
        /* the bare mesh */
        assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, names[i])), DMK_OK);
        content = get_file(f, names[i], &n);
        check_array(content, "<Points>", "Points", xyz, sizeof xyz);
        check_array(content, cells, "connectivity", triangles, sizeof triangles);
        assert_null(strstr(content, "mu"));
        free(content);
        remove_file(f, names[i]);
    }
    dmk_mesh_destroy(&m);
}

/* In pieces: the file that names them lists their arrays; they stand beside it, whatever it is called. */
static void test_results_in_pieces(void **state)
{
    fixture *f = *state;
    size_t n;
    dmk_mesh *m = make_mesh(f);
    dmk_fields fields = {.mesh = m, .mu = mu, .u = u, .distance = distance};
    fields.source = (dmk_point){2, {0, 0.25, 0.75}};
    assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, "a&b\"<.pvtp")), DMK_OK);
    assert_int_equal(count_files(f), 2);
    char *content = get_file(f, "a&b\"<.pvtp", &n);
    assert_non_null(
        strstr(content, "<Piece Source=\"a&amp;b&quot;&lt;_0000.vtp\"/>\n</PPolyData>"));
    for (int i = 0; i < 3; i++) {
        static const char *const names[] = {"mu", "u", "distance"};
        char word[60];
        snprintf(word, sizeof word, "<PDataArray type=\"Float64\" Name=\"%s\"/>", names[i]);
        const char *found = strstr(content, word);
        const char *begin = strstr(content, i == 0 ? "<PCellData" : "<PPointData");
        const char *end = strstr(content, i == 0 ? "</PCellData>" : "</PPointData>");
        if (!(found && begin && end && begin < found && found < end))
            fail_msg("%s in %s", word, content);
    }
    assert_non_null(
        strstr(content, "<PDataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"/>"));
    free(content);
    content = get_file(f, "a&b\"<_0000.vtp", &n);
    check_array(content, "<CellData", "mu", mu, sizeof mu);
    free(content);
    dmk_mesh *back = read_mesh(f, "a&b\"<_0000.vtp");
    assert_int_equal(back->n_vertices, 4); /* without the one in no triangle */
    assert_int_equal(back->n_triangles, m->n_triangles);
    dmk_mesh_destroy(&back);
    remove_file(f, "a&b\"<_0000.vtp");
    remove_file(f, "a&b\"<.pvtp");
    /* Of a name that XML cannot hold, or gives back as another one, viewers would find no piece. */
    assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, "a\tb.pvtp")), DMK_E_ARG);
    assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, "a\xff.pvtp")), DMK_E_ARG);
    assert_non_null(
        strstr(dmk_context_message(f->ctx), "only in UTF-8 without control characters"));
    assert_int_equal(count_files(f), 0);
    dmk_mesh_destroy(&m);
}

/* A strip of so many triangles: two pieces from a quarter of a million on. */
static dmk_mesh *strip(const fixture *f, int32_t n)
{
    dmk_mesh *m = NULL;
    double *place = calloc(3 * (size_t)n + 6, sizeof *place);
    int32_t *t = calloc(3 * (size_t)n, sizeof *t);
    assert_true(place && t);
    for (int32_t i = 0; i < n + 2; i++) {
        place[3 * i] = i / 2;
        place[3 * i + 1] = i % 2;
    }
    for (int32_t i = 0; i < n; i++) {
        t[3 * i] = i;
        t[3 * i + 1] = i + 1 + i % 2;
        t[3 * i + 2] = i + 2 - i % 2;
    }
    assert_int_equal(dmk_mesh_adopt(f->ctx, (size_t)n + 2, place, (size_t)n, t, &m), DMK_OK);
    return m;
}

/* Pieces that cannot be written leave those of the result before; fewer pieces leave none of more; an index that is
 * empty is replaced. */
static void test_pieces_stay_together(void **state)
{
    fixture *f = *state;
    size_t n;
    dmk_mesh *small = make_mesh(f), *large = strip(f, 300000);
    const double own = 7;
    assert_int_equal(dmk_mesh_write(f->ctx, small, path_of(f, "a.pvtp")), DMK_OK);
    char *before = get_file(f, "a_0000.vtp", &n);
    assert_int_equal(mkdir(path_of(f, "a_0001.vtp"), 0777), 0);
    assert_int_equal(dmk_mesh_write(f->ctx, large, path_of(f, "a.pvtp")), DMK_E_IO);
    assert_non_null(strstr(dmk_context_message(f->ctx), "a_0001.vtp: exists and is neither"));
    char *after = get_file(f, "a_0000.vtp", &n);
    assert_memory_equal(after, before, n);
    free(before);
    free(after);
    assert_int_equal(rmdir(path_of(f, "a_0001.vtp")), 0);
    assert_int_equal(dmk_mesh_write(f->ctx, large, path_of(f, "a.pvtp")), DMK_OK);
    put_file(f, "a_0002.vtp", &own, sizeof own);
    assert_int_equal(count_files(f), 4);
    assert_int_equal(dmk_mesh_write(f->ctx, small, path_of(f, "a.pvtp")), DMK_OK);
    assert_int_equal(count_files(f), 3);
    remove_file(f, "a_0002.vtp");
    put_file(f, "a.pvtp", "", 0);
    assert_int_equal(dmk_mesh_write(f->ctx, small, path_of(f, "a.pvtp")), DMK_OK);
    remove_file(f, "a_0000.vtp");
    remove_file(f, "a.pvtp");
    dmk_mesh_destroy(&small);
    dmk_mesh_destroy(&large);
}

/* Each piece has the values of its own triangles and vertices. */
static void test_pieces_have_their_values(void **state)
{
    enum { N = 300000, HALF = N / 2 };
    fixture *f = *state;
    size_t n;
    dmk_mesh *m = strip(f, N);
    double *values = malloc((4 * N + 3 * (N + 2)) * sizeof *values);
    assert_non_null(values);
    for (int i = 0; i < 4 * N + 3 * (N + 2); i++) values[i] = i;
    double *vectors = values + N, *of_vertices = vectors + 3 * N, *plane = of_vertices + N + 2;
    dmk_fields fields = {.mesh = m, .mu = values, .flux = vectors, .u = of_vertices};
    assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, "a.pvtp")), DMK_OK);
    char *content = get_file(f, "a_0001.vtp", &n);
    check_array(content, "<CellData", "mu", values + HALF, HALF * sizeof *values);
    check_array(content, "<CellData", "flux", vectors + 3 * HALF, 3 * HALF * sizeof *values);
    check_array(content, "<Points>", "Points", m->xyz + 3 * HALF, 3 * (HALF + 2) * sizeof *values);
    check_array(content, "<PointData", "u", of_vertices + HALF, (HALF + 2) * sizeof *values);
    free(content);
    assert_int_equal(dmk_cut_write(f->ctx, m, plane, path_of(f, "a.pvtp")), DMK_OK);
    content = get_file(f, "a_0001.vtp", &n);
    check_array(content, "<PointData", "plane", plane + 2 * HALF, 2 * (HALF + 2) * sizeof *values);
    free(content);
    remove_file(f, "a_0000.vtp");
    remove_file(f, "a_0001.vtp");
    remove_file(f, "a.pvtp");
    free(values);
    dmk_mesh_destroy(&m);
}

static void test_large_vtk_files(void **state)
{
    fixture *f = *state;
    size_t n;
    dmk_mesh *m = make_large_mesh(f);
    assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, "m.vtp")), DMK_OK);
    char *content = get_file(f, "m.vtp", &n);
    check_array(content, "<Points>", "Points", m->xyz, 24 * (size_t)m->n_vertices);
    check_array(content, "<Polys>", "connectivity", m->triangle, 12 * (size_t)m->n_triangles);
    free(content);
    remove_file(f, "m.vtp");
    dmk_mesh_destroy(&m);
}

/* A path of three vertices and one more vertex by itself. */
static const dmk_locus_vertex vertices[4] = {
    {{0, 1.0 / 3, 1},
     {0, {0.5, 0.5, 0}},
     2.5,
     1e-17,
     3.1,
     {0.25, -1.0 / 3},
     DMK_LOCUS_END,
     1,
     0.5,
     0.75,
     {0, 0}},
    {{1, 0, 1e-300}, {1, {1, 0, 0}}, 2.25, 0, 2.9, {1, 2}, DMK_LOCUS_ORDINARY, 2, 3, 2, {0, 0}},
    {{2, 0, 0}, {2, {0.25, 0.25, 0.5}}, 2, 3, 0.5, {-1, -2}, DMK_LOCUS_END, 1, 0, 1, {0, 0}},
    {{7, 8, 9}, {3, {0, 0, 1}}, 4, 0, 6.25, {0, 3}, DMK_LOCUS_POINT, 0, 1, 3, {0, 0}}};
static const dmk_locus_edge edges[2] = {{{0, 1}, 2.75}, {{1, 2}, 1.0 / 7}};
static const int32_t line_index[] = {0, 1, 2, 3};
static const int32_t line_offset[] = {0, 3, 4};
static const dmk_curves curves = {vertices, edges, line_index, line_offset, 4, 2, 2, false};

static void check_text_file(fixture *f, const char *name, const char *expected)
{
    size_t n;
    char *content = get_file(f, name, &n);
    assert_string_equal(content, expected);
    assert_int_equal(n, strlen(expected));
    free(content);
    remove_file(f, name);
}

static void test_locus_as_obj(void **state)
{
    fixture *f = *state;
    const char *places = "v 0 0.3333333333333333 1\nv 1 0 1e-300\nv 2 0 0\nv 7 8 9\n";
    char expected[256];
    assert_int_equal(dmk_curves_write(f->ctx, &curves, path_of(f, "l.obj")), DMK_OK);
    snprintf(expected, sizeof expected, "%sl 1 2 3\np 4\n", places);
    check_text_file(f, "l.obj", expected);
    /* one point, with no polyline for it */
    dmk_curves point = {.vertex = vertices + 3, .n_vertices = 1};
    assert_int_equal(dmk_curves_write(f->ctx, &point, path_of(f, "l.obj")), DMK_OK);
    check_text_file(f, "l.obj", "v 7 8 9\np 1\n");
}

static void test_locus_as_csv(void **state)
{
    fixture *f = *state;
    assert_int_equal(dmk_curves_write(f->ctx, &curves, path_of(f, "l.csv")), DMK_OK);
    check_text_file(
        f, "l.csv",
        "x,y,z,triangle,w0,w1,w2,distance,mu,strength,angle0,angle1,kind,degree,meeting_angle,"
        "source_angle\n"
        "0,0.3333333333333333,1,0,0.5,0.5,0,2.5,1e-17,3.1,0.25,-0.3333333333333333,1,1,0.5,0.75\n"
        "1,0,1e-300,1,1,0,0,2.25,0,2.9,1,2,0,2,3,2\n"
        "2,0,0,2,0.25,0.25,0.5,2,3,0.5,-1,-2,1,1,0,1\n"
        "7,8,9,3,0,0,1,4,0,6.25,0,3,3,0,1,3\n");
}

static void test_path_as_csv(void **state)
{
    fixture *f = *state;
    dmk_curves path = curves;
    path.bare = true;
    assert_int_equal(dmk_curves_write(f->ctx, &path, path_of(f, "p.csv")), DMK_OK);
    check_text_file(f, "p.csv",
                    "x,y,z,triangle,w0,w1,w2,distance\n"
                    "0,0.3333333333333333,1,0,0.5,0.5,0,2.5\n"
                    "1,0,1e-300,1,1,0,0,2.25\n"
                    "2,0,0,2,0.25,0.25,0.5,2\n"
                    "7,8,9,3,0,0,1,4\n");
}

/* A surface cut open: its places in the plane are texture coordinates. */
static void test_cut_as_obj(void **state)
{
    static const double plane[] = {0, 0.5, 2, 0, 2.5, 2, 0, 2};
    fixture *f = *state;
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 4, square_xyz, 2, square_triangles, &m), DMK_OK);
    assert_int_equal(dmk_cut_write(f->ctx, m, plane, path_of(f, "c.obj")), DMK_OK);
    check_text_file(f, "c.obj",
                    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0.5\nvt 2 0\nvt 2.5 2\nvt 0 2\n"
                    "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
    dmk_mesh_destroy(&m);
}

static void test_locus_as_vtp(void **state)
{
    fixture *f = *state;
    size_t n;
    assert_int_equal(dmk_curves_write(f->ctx, &curves, path_of(f, "l.vtp")), DMK_OK);
    char *content = get_file(f, "l.vtp", &n);
    assert_non_null(strstr(content, "NumberOfVerts=\"1\" NumberOfLines=\"2\""));
    static const double places[] = {0, 1.0 / 3, 1, 1, 0, 1e-300, 2, 0, 0, 7, 8, 9};
    check_array(content, "<Points>", "Points", places, sizeof places);
    check_array(content, "<PointData>", "distance", (double[]){2.5, 2.25, 2, 4}, 32);
    check_array(content, "<PointData>", "mu", (double[]){1e-17, 0, 3, 0}, 32);
    check_array(content, "<PointData>", "strength", (double[]){3.1, 2.9, 0.5, 6.25}, 32);
    check_array(content, "<PointData>", "meeting_angle", (double[]){0.5, 3, 0, 1}, 32);
    check_array(content, "<PointData>", "source_angle", (double[]){0.75, 2, 1, 3}, 32);
    check_array(content, "<PointData>", "angle0", (double[]){0.25, 1, -1, 0}, 32);
    check_array(content, "<PointData>", "angle1", (double[]){-1.0 / 3, 2, -2, 3}, 32);
    check_array(content, "<PointData>", "kind", (int32_t[]){1, 0, 1, 3}, 16);
    check_array(content, "<CellData", "strength", (double[]){6.25, 2.75, 1.0 / 7}, 24);
    check_array(content, "<Verts>", "connectivity", (int32_t[]){3}, 4);
    check_array(content, "<Verts>", "offsets", (int32_t[]){1}, 4);
    check_array(content, "<Lines>", "connectivity", (int32_t[]){0, 1, 1, 2}, 16);
    check_array(content, "<Lines>", "offsets", (int32_t[]){2, 4}, 8);
    free(content);
    remove_file(f, "l.vtp");
}

/* ---- whole files or none ---- */

static void test_refuses_to_write(void **state)
{
    static const struct {
        const char *name;
        int status;
        const char *message;
    } cases[] = {{"m.xyz", DMK_E_ARG, "m.xyz: the suffix chooses the format; use one of .ply"},
                 {"m", DMK_E_ARG, "suffix"},
                 {"m.csv", DMK_E_ARG, "suffix"},
                 {"none/m.off", DMK_E_IO, "none/m.off: cannot create: No such file"},
                 {"folder.off", DMK_E_IO, "folder.off: exists and is neither a regular file nor"}};
    fixture *f = *state;
    dmk_mesh *m = make_mesh(f);
    assert_int_equal(mkdir(path_of(f, "folder.off"), 0777), 0);
    for (size_t i = 0; i < COUNT(cases); i++) {
        assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, cases[i].name)), cases[i].status);
        assert_non_null(strstr(dmk_context_message(f->ctx), cases[i].message));
        assert_int_equal(count_files(f), 1);
    }
    assert_int_equal(dmk_context_set_format(f->ctx, "pvtp"), DMK_E_ARG);
    assert_int_equal(dmk_context_set_format(f->ctx, "STL"), DMK_E_ARG);
    assert_int_equal(dmk_context_set_format(f->ctx, ".off"), DMK_E_ARG);
    assert_int_equal(dmk_context_set_format(f->ctx, "csv"), DMK_OK); /* which holds no mesh */
    assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, "m")), DMK_E_ARG);
    assert_int_equal(dmk_mesh_write(f->ctx, m, "/dev/null"), DMK_E_ARG);
    assert_non_null(
        strstr(dmk_context_message(f->ctx), "the format CSV was chosen, and cannot hold"));
    assert_int_equal(dmk_context_set_format(f->ctx, "off"), DMK_OK);
    assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, "m")), DMK_OK);
    assert_int_equal(dmk_context_set_format(f->ctx, NULL), DMK_OK);
    assert_int_equal(dmk_mesh_write(f->ctx, m, path_of(f, "m")), DMK_E_ARG);
    remove_file(f, "m");
    assert_int_equal(rmdir(path_of(f, "folder.off")), 0);
    assert_int_equal(dmk_fields_write(f->ctx, &(dmk_fields){.mesh = m}, path_of(f, "r.off")),
                     DMK_E_ARG);
    assert_int_equal(dmk_curves_write(f->ctx, &curves, path_of(f, "l.vtu")), DMK_E_ARG);
    assert_int_equal(dmk_mesh_write(f->ctx, m, ""), DMK_E_ARG);
    assert_string_equal(dmk_context_message(f->ctx), "'': expected the name of a file");
    assert_int_equal(dmk_mesh_write(f->ctx, m, NULL), DMK_E_ARG);
    assert_int_equal(dmk_mesh_write(f->ctx, NULL, f->path), DMK_E_ARG);
    dmk_mesh_destroy(&m);
}

/* The disk is full (here: a limit of file sizes): the old file stays, nothing else is left. */
static void test_full_disk(void **state)
{
    fixture *f = *state;
    dmk_mesh *m = make_mesh(f);
    struct rlimit before, tiny;
    put_file(f, "m.off", "old", 3);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tiny = (struct rlimit){20, before.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tiny), 0);
    int rc = dmk_mesh_write(f->ctx, m, f->path);
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(rc, DMK_E_IO);
    assert_non_null(strstr(dmk_context_message(f->ctx),
                           "m.off: cannot write: File too large; nothing was written to it"));
    assert_int_equal(count_files(f), 1);
    check_text_file(f, "m.off", "old");
    dmk_mesh_destroy(&m);
}

/* Writing over a link replaces the file it names; the file's mode stays. */
static void test_links_and_modes(void **state)
{
    fixture *f = *state;
    dmk_mesh *m = make_mesh(f);
    struct stat st;
    put_file(f, "real.off", "old", 3);
    assert_int_equal(chmod(f->path, 0640), 0);
    assert_int_equal(symlink("real.off", path_of(f, "link.off")), 0);
    assert_int_equal(dmk_mesh_write(f->ctx, m, f->path), DMK_OK);
    assert_int_equal(lstat(f->path, &st), 0);
    assert_true(S_ISLNK(st.st_mode));
    assert_int_equal(stat(path_of(f, "real.off"), &st), 0);
    assert_int_equal(st.st_mode & 0777, 0640);
    assert_true(st.st_size > 100);
    assert_int_equal(count_files(f), 2);
    remove_file(f, "link.off");
    remove_file(f, "real.off");
    dmk_mesh_destroy(&m);
}

static void test_format_table(void **state)
{
    dmk_format_info info;
    size_t n = 0, readers = 0;
    (void)state;
    for (; dmk_format_get(n, &info) == DMK_OK; n++) {
        assert_true(info.name[0] && info.suffixes[0] == '.');
        assert_true(info.reads_mesh || info.writes_mesh || info.writes_result || info.writes_locus);
        readers += info.reads_mesh != 0;
    }
    assert_true(n >= 5 && readers >= 2);
    assert_int_equal(dmk_format_get(0, &info), DMK_OK);
    assert_string_equal(info.name, "PLY");
    assert_true(info.reads_mesh && info.writes_mesh && info.writes_result && !info.writes_locus);
    assert_int_equal(dmk_format_get(n, &info), DMK_E_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_meshes_keep_every_bit),
        TEST(test_large_meshes),
        TEST(test_off_variants),
        TEST(test_obj_variants),
        TEST(test_polygons_become_fans),
        TEST(test_polygons_that_are_no_fans),
        TEST(test_reads_known),
        TEST(test_refuses_endless_files),
        TEST(test_skips_byte_order_marks),
        TEST(test_reads_pipes),
        TEST(test_refusals),
        TEST(test_missing_files_and_folders),
        TEST(test_damaged_files),
        TEST(test_results),
        TEST(test_results_in_pieces),
        TEST(test_pieces_stay_together),
        TEST(test_pieces_have_their_values),
        TEST(test_large_vtk_files),
        TEST(test_locus_as_obj),
        TEST(test_locus_as_csv),
        TEST(test_path_as_csv),
        TEST(test_cut_as_obj),
        TEST(test_locus_as_vtp),
        TEST(test_refuses_to_write),
        TEST(test_full_disk),
        TEST(test_links_and_modes),
        TEST(test_format_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
