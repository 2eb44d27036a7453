/* PLY and STL, text and binary, and files packed by gzip. */
#include "files.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

/* ---- PLY ---- */

#define XYZ "property double x\nproperty double y\nproperty double z\n"
#define HEADER                                                                                     \
    "ply\nformat ascii 1.0\nelement vertex 4\n" XYZ                                                \
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
#define VERTICES "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"

static void test_ply_text_variants(void **state)
{
    static const char *const texts[] = {
        HEADER VERTICES "3 0 1 2\n3 0 2 3\n", HEADER VERTICES "3 0 1 2 3 0 2 3",
        "ply\nformat ascii 1.0\nelement vertex 4\n" XYZ "element face 1\n"
        "property list uchar int vertex_indices\nend_header \t\n" VERTICES "4 0 1 2 3\n\nthe end",
        "ply\rformat ascii 1.0\relement vertex 4\rproperty double x\rproperty double y\rproperty "
        "double z\r"
        "element face 1\rproperty list uchar int vertex_indices\rend_header\r0 0 0\r1 0 0\r1 1 "
        "0\r0 1 0\r"
        "4 0 1 2 3\r",
        /* another order, other names, other types, things of no use */
        "ply\r\nformat ascii 1.0\r\ncomment it's # mine\r\nobj_info x\r\nelement camera 1\r\n"
        "property float32 fov\r\nproperty list uint8 float64 pose\r\nelement face 1\r\n"
        "property uchar red\r\nproperty list uint uint16 vertex_index\r\n"
        "property list uchar float texcoord\r\nelement vertex 4\r\nproperty float quality\r\n"
        "property float64 z\r\nproperty int32 x\r\nproperty short y\r\nproperty list int int y\r\n"
        "element edge 1\r\nproperty int a\r\nend_header\r\n"
        "90 2 nan inf\r\n255 4 0 1 2 3 2 .5 .5\r\nnan 0 0 0 0\r\n1 0e5 1 0 2 8 9\r\n"
        "inf 0.0 1 1 1 7\r\n-1 -0e0 0 1 0\r\n7\r\n"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        dmk_mesh *m = read_text(*state, i == 1 ? "named.obj" : "m.ply", texts[i]);
        if (i == COUNT(texts) - 1) m->xyz[11] = 0; /* it is -0 */
        check_square(m);
    }
}

static size_t put_bytes(char *to, size_t at, const void *value, size_t n, bool swap)
{
    const char *from = value;
    for (size_t i = 0; i < n; i++) to[at + i] = from[swap ? n - 1 - i : i];
    return at + n;
}

/* The square in binary: float x, double y, short z, then a list that is skipped. */
static size_t make_binary_ply(char *to, bool big, const char *line_end)
{
    static const int16_t extra[2] = {10, 13};
    static const uint32_t faces[2][4] = {{3, 0, 1, 2}, {3, 0, 2, 3}};
    static const int one = 1;
    bool swap = big == (*(const char *)&one == 1);
    size_t n = (size_t)sprintf(
        to,
        "ply%sformat binary_%s_endian 1.0%selement vertex 4%sproperty float x%sproperty double y%s"
        "property short z%sproperty list uchar short extra%selement face 2%s"
        "property list uint uint vertex_indices%send_header%s",
        line_end, big ? "big" : "little", line_end, line_end, line_end, line_end, line_end,
        line_end, line_end, line_end, line_end);
    for (int v = 0; v < 4; v++) {
        float x = (float)square_xyz[3 * v];
        int16_t z = 0;
        n = put_bytes(to, n, &x, 4, swap);
        n = put_bytes(to, n, &square_xyz[3 * v + 1], 8, swap);
        n = put_bytes(to, n, &z, 2, swap);
        to[n++] = 2;
        for (int i = 0; i < 2; i++) n = put_bytes(to, n, &extra[i], 2, swap);
    }
    for (int t = 0; t < 2; t++) {
        for (int i = 0; i < 4; i++) n = put_bytes(to, n, &faces[t][i], 4, swap);
    }
    return n;
}

static void test_ply_binary_variants(void **state)
{
    for (int big = 0; big < 2; big++) {
        char file[1024];
        size_t n = make_binary_ply(file, big != 0, "\n");
        check_square(read_bytes(*state, "m.ply", file, n));
        n = make_binary_ply(file, big != 0, "\r\n");
        check_square(read_bytes(*state, "m", file, n));
    }
}

/* Binary data may begin with what looks like a line end. */
static void test_ply_data_like_line_ends(void **state)
{
    static const char header[] = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
                                 "property uchar x\nproperty uchar y\nproperty uchar z\n"
                                 "element face 1\nproperty list uchar uchar vertex_index\n"
                                 "end_header\n";
    static const char data[] = "\r\n \n\r\n\t\t\t\3\0\1\2";
    static const double places[] = {13, 10, 32, 10, 13, 10, 9, 9, 9};
    char file[300];
    memcpy(file, header, sizeof header - 1);
    memcpy(file + sizeof header - 1, data, sizeof data - 1);
    dmk_mesh *m = read_bytes(*state, "m.ply", file, sizeof header + sizeof data - 2);
    assert_memory_equal(m->xyz, places, sizeof places);
    dmk_mesh_destroy(&m);
}

static void refuse_bytes(fixture *f, const void *content, size_t n, const char *message)
{
    dmk_mesh *m = NULL;
    put_file(f, "m.ply", content, n);
    assert_int_equal(dmk_mesh_read(f->ctx, path_of(f, "m.ply"), &m), DMK_E_FORMAT);
    assert_null(m);
    if (!strstr(dmk_context_message(f->ctx), message)) fail_msg("%s", dmk_context_message(f->ctx));
    remove_file(f, "m.ply");
}

/* Records of one size, read side by side, and what is not of that size or not right, one after the other. */
static void test_ply_binary_records(void **state)
{
#define RECORDS(faces)                                                                             \
    "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty uchar red\nproperty char "   \
    "x\n"                                                                                          \
    "property char y\nproperty char z\nelement face " faces                                        \
    "\nproperty uchar flag\nproperty list uchar char vertex_indices\nproperty short last\n"        \
    "end_header\n\11\0\0\0\11\1\0\0\11\1\1\0\11\0\1\0"
    static const char triangles[] = RECORDS("2") "\7\3\0\1\2xx\7\3\0\2\3xx";
    static const char quad[] = RECORDS("1") "\7\4\0\1\2\3xx";
    static const char wrong[] = RECORDS("2") "\7\3\0\1\2xx\7\3\0\2\4xx";
    static const char negative[] = RECORDS("2") "\7\3\0\1\2xx\7\3\0\2\377xx";
    static const char cut_short[] = RECORDS("2") "\7\3\0\1\2xx\7\3\0\2\3x";
    check_square(read_bytes(*state, "m.ply", triangles, sizeof triangles - 1));
    check_square(read_bytes(*state, "m.ply", quad, sizeof quad - 1));
    refuse_bytes(*state, wrong, sizeof wrong - 1, "vertex 4 is out of range [0, 3]");
    refuse_bytes(*state, negative, sizeof negative - 1, "vertex -1 is out of range [0, 3]");
    refuse_bytes(*state, cut_short, sizeof cut_short - 1, "the file ends before");
}

/* Lists before and behind what is read; single precision up to the end of the file. */
static void test_ply_binary_lists(void **state)
{
    static const char header[] =
        "ply\nformat binary_little_endian 1.0\nelement face 2\nproperty list char short a\n"
        "property list char uchar vertex_indices\nelement vertex 4\nproperty list char double b\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n";
    static const char faces[] = "\1aa\3\0\1\2\0\3\0\2\3";
    char file[400];
    size_t n = sizeof header - 1;
    memcpy(file, header, n);
    memcpy(file + n, faces, sizeof faces - 1);
    n += sizeof faces - 1;
    for (int v = 0; v < 4; v++) {
        const char length = v == 1;
        n = put_bytes(file, n, &length, 1, false);
        if (length > 0) n = put_bytes(file, n, &square_xyz[3], 8, false);
        for (int k = 0; k < 3; k++) {
            const float x = (float)square_xyz[3 * v + k];
            n = put_bytes(file, n, &x, 4, *(const char *)&(int){1} == 0);
        }
    }
    check_square(read_bytes(*state, "m.ply", file, n));
    refuse_bytes(*state, file, n - 1, "the file ends before");
}

#define FORMAT "ply\nformat ascii 1.0\n"
#define FACE "element face 1\nproperty list uchar int vertex_indices\n"

static const refusal ply_refusals[] = {
    {"m.ply", "ply\n", DMK_E_FORMAT, "m.ply:2: the file ends within its header"},
    {"m.ply", "ply\n\n", DMK_E_FORMAT, "m.ply:3: the file ends within its header"},
    {"m.ply", "ply\nformat ascii 2.0\n", DMK_E_FORMAT, "m.ply:2: this is not version 1.0"},
    {"m.ply", "ply\nformat utf 1.0\n", DMK_E_FORMAT, "m.ply:2: the format is not ascii"},
    {"m.ply", "ply\nend_header\n", DMK_E_FORMAT, "m.ply:2: the header names no format"},
    {"m.ply", FORMAT "hello\n", DMK_E_FORMAT,
     "m.ply:3: 'hello' is not a line of a PLY header; if it tells of nothing, put 'comment' before "
     "it"},
    {"m.ply", FORMAT "property int x\n", DMK_E_FORMAT, "m.ply:3: a property before"},
    {"m.ply", FORMAT "element vertex x\n", DMK_E_FORMAT, "m.ply:3: 'x' where the number"},
    {"m.ply", FORMAT "element vertex -1\n", DMK_E_FORMAT, "m.ply:3: a negative number"},
    {"m.ply", FORMAT "element vertex 1\nproperty real x\n", DMK_E_FORMAT, "m.ply:4: a property of"},
    {"m.ply", FORMAT "element vertex 1\nproperty list float int x\n", DMK_E_FORMAT,
     "m.ply:4: a property of unknown type"},
    {"m.ply", FORMAT "element vertex 1\n" XYZ "end_header\n0 0 0\n", DMK_E_FORMAT,
     "m.ply: its header has no element 'face', or more"},
    {"m.ply", FORMAT "element vertex 1\nproperty int x\n" FACE "end_header\n", DMK_E_FORMAT,
     "m.ply: its header has no vertices' x, y and z"},
    {"m.ply", FORMAT "element vertex 1000000000000\n" XYZ FACE "end_header\n0 0 0\n", DMK_E_FORMAT,
     "m.ply: 1000000000000 of element 'vertex' do not fit into the 6 bytes"},
    {"m.ply", HEADER VERTICES, DMK_E_FORMAT, "m.ply: 2 of element 'face' do not fit into the 1"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n", DMK_E_FORMAT, "m.ply:15: the file ends before"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n3 0 2 \n", DMK_E_FORMAT, "m.ply:16: the file ends before"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n3 0 2 4\n", DMK_E_FORMAT,
     "m.ply:15: vertex 4 is out of range [0, 3]"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n3 0 2 -1\n", DMK_E_FORMAT,
     "m.ply:15: vertex -1 is out of range [0, 3]"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n3 0 2 2.5\n", DMK_E_FORMAT, "m.ply:15: vertex 2.5 is"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n3 0 2 3\n3 1 2 3\n", DMK_E_FORMAT,
     "m.ply:16: a number behind all that the header counts; correct its counts or remove the rest"},
    {"m.ply", HEADER VERTICES "3 0 1 2\n2 0 2\n", DMK_E_FORMAT, "a face with 2 corners"},
    {"m.ply", HEADER "0 0 0\n1 0 0\n1 x 0\n0 1 0\n3 0 1 2\n3 0 2 3\n", DMK_E_FORMAT,
     "m.ply:12: 'x' where a value"},
};

static void test_ply_refusals(void **state)
{
    check_refusals(*state, ply_refusals, COUNT(ply_refusals));
}

/* A mesh and a result whose numbers need all their bits. */
static void test_ply_keeps_every_bit(void **state)
{
    static const double xyz[] = {1.0 / 3, -2.0 / 7, 1e-300, 1.1,      0.1,   0.30000000000000004,
                                 -0.0,    1e3 / 7,  5e-324, 4.9e-320, 1e308, -1e-5};
    static const int32_t t[] = {0, 1, 2};
    static const double mu[] = {1.0 / 7}, u[] = {0, -1.0 / 3, -1e-9, -INFINITY};
    static const double distance[] = {0, 1.0 / 3, 1e-9, INFINITY};
    static const uint8_t acl[] = {1};
    fixture *f = *state;
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 4, xyz, 1, t, &m), DMK_OK);
    dmk_fields fields = {.mesh = m, .mu = mu, .acl = acl, .u = u, .distance = distance};
    fields.source = (dmk_point){0, {1, 0, 0}};
    for (int result = 0; result < 2; result++) {
        const char *path = path_of(f, "m.ply");
        int rc = result ? dmk_fields_write(f->ctx, &fields, path) : dmk_mesh_write(f->ctx, m, path);
        assert_int_equal(rc, DMK_OK);
        dmk_mesh *back = read_mesh(f, "m.ply");
        assert_memory_equal(back->xyz, xyz, sizeof xyz);
        assert_memory_equal(back->triangle, t, sizeof t);
        dmk_mesh_destroy(&back);
        size_t n;
        char *content = get_file(f, "m.ply", &n);
        char *data = strstr(content, "end_header\n") + 11;
        if (!result) assert_int_equal(n, (size_t)(data - content) + 4 * 24 + 13);
        for (int v = 0; v < 4 && result; v++) {
            const double row[] = {xyz[3 * v], xyz[3 * v + 1], xyz[3 * v + 2], u[v], distance[v]};
            for (int k = 0; k < 5; k++) {
                const double value = strtod(data, &data);
                assert_memory_equal(&value, &row[k], 8);
            }
        }
        if (result) {
            assert_int_equal(strncmp(data, "\n3 0 1 2 ", 9), 0);
            const double value = strtod(data + 9, &data);
            assert_memory_equal(&value, mu, 8);
            assert_string_equal(data, " 1\n");
        }
        free(content);
        remove_file(f, "m.ply");
    }
    dmk_mesh_destroy(&m);
}

/* Properties that the header names from here to there. */
static int count_properties(const char *at, const char *end)
{
    int n = 0;
    for (; (at = strstr(at, "property ")) && at < end; at++) n++;
    return n;
}

/* Whatever a result has, each row has as many numbers as the header says, in its order. */
static void test_ply_rows_fit_their_header(void **state)
{
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 0, 1, 0}, mu[] = {3}, u[] = {4, 5, 6},
                        distance[] = {7, 8, 9};
    static const double direction[] = {10, 11, 12}, flux[] = {13, 14, 15};
    static const int32_t t[] = {0, 1, 2}, nearest[] = {16, 17, 18};
    static const uint8_t acl[] = {1};
    fixture *f = *state;
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 3, xyz, 1, t, &m), DMK_OK);
    const struct {
        dmk_fields fields;
        const char *vertex, *face; /* the last row of each */
    } cases[] = {
        {{m, .mu = mu, .u = u}, "\n0 1 0 6\n", "\n3 0 1 2 3\n"},
        {{m, .mu = mu, .u = u, .acl = acl, .distance = distance},
         "\n0 1 0 6 9\n",
         "\n3 0 1 2 3 1\n"},
        {{m, .mu = mu, .u = u, .flux = flux}, "\n0 1 0 6\n", "\n3 0 1 2 3 13 14 15\n"},
        {{m, .distance = distance, .direction = direction, .nearest = nearest},
         "\n0 1 0 9 12 18\n",
         "\n3 0 1 2\n"},
    };
    for (size_t i = 0; i < COUNT(cases); i++) {
        size_t n;
        assert_int_equal(dmk_fields_write(f->ctx, &cases[i].fields, path_of(f, "m.ply")), DMK_OK);
        char *content = get_file(f, "m.ply", &n);
        const char *vertex = strstr(content, "element vertex 3\n"),
                   *face = strstr(content, "element face 1\n");
        const char *end = strstr(content, "end_header\n"), *row = strstr(content, cases[i].vertex);
        assert_true(vertex && face && end && row && vertex < face && face < end && end < row);
        int blanks = 0;
        for (const char *c = row + 1; *c != '\n'; c++) blanks += *c == ' ';
        assert_int_equal(blanks + 1, count_properties(vertex, face));
        assert_string_equal(row + strlen(cases[i].vertex) - 1, cases[i].face);
        blanks = 0;
        for (const char *c = cases[i].face; *c; c++) blanks += *c == ' ';
        assert_int_equal(blanks - 2, count_properties(face, end)); /* the list is one */
        free(content);
        remove_file(f, "m.ply");
    }
    dmk_mesh_destroy(&m);
}

static void test_ply_results_are_meshes(void **state)
{
    static const double values[4] = {1, 2, 3, 4};
    fixture *f = *state;
    dmk_mesh *m = NULL;
    assert_int_equal(dmk_mesh_create(f->ctx, 4, square_xyz, 2, square_triangles, &m), DMK_OK);
    const dmk_fields fields = {.mesh = m, .mu = values, .u = values};
    assert_int_equal(dmk_fields_write(f->ctx, &fields, path_of(f, "m.ply")), DMK_OK);
    dmk_mesh_destroy(&m);
    check_square(read_mesh(f, "m.ply"));
    remove_file(f, "m.ply");
}

/* ---- STL ---- */

static void test_stl_text_variants(void **state)
{
    static const char *const texts[] = {
        "solid\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1 0 0\n"
        "   vertex 1 1 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n"
        "   vertex 0 0 0\n   vertex 1 1 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid\n",
        /* two parts, odd names, capitals, negative zeros, a quadrilateral */
        "SOLID vertex loop \\ x\r\nFACET NORMAL 0 0 1\r\nOUTER LOOP\r\nVERTEX 0 0 -0.0\r\n"
        "VERTEX 1e0 0 0\r\nVERTEX 1 1 0\r\nVERTEX -0 1 0\r\nENDLOOP\r\nENDFACET\r\n"
        "ENDSOLID vertex loop\r\nsolid b\r\nendsolid b",
        "solid a\rfacet\router loop\rvertex 0 0 0\rvertex 1 0 0\rvertex 1 1 0\rvertex 0 1 "
        "0\rendloop\r"
        "endfacet\rendsolid a\r"};
    for (size_t i = 0; i < COUNT(texts); i++) {
        check_square(read_text(*state, i ? "m" : "m.stl", texts[i]));
    }
}

static size_t make_binary_stl(char *to, const char *title)
{
    static const int one = 1;
    bool swap = *(const char *)&one != 1;
    uint32_t count = 2;
    memset(to, 0, 84);
    memcpy(to, title, strlen(title));
    size_t n = put_bytes(to, 80, &count, 4, swap);
    for (int t = 0; t < 2; t++) {
        memset(to + n, 0x55, 12);
        n += 12;
        for (int k = 0; k < 9; k++) {
            float x = (float)square_xyz[3 * square_triangles[3 * t + k / 3] + k % 3];
            n = put_bytes(to, n, &x, 4, swap);
        }
        to[n++] = 1;
        to[n++] = 2;
    }
    return n;
}

static void test_stl_binary_variants(void **state)
{
    static const char *const titles[] = {"ply\n", "OFF", "v 1", "# by us\nv 1", "o"};
    char file[300];
    size_t n = make_binary_stl(file, "a title");
    check_square(read_bytes(*state, "m.stl", file, n));
    n = make_binary_stl(file, "solid and yet binary");
    check_square(read_bytes(*state, "m", file, n));
    for (size_t i = 0; i < COUNT(titles); i++) {
        n = make_binary_stl(file, titles[i]);
        check_square(read_bytes(*state, "m", file, n));
    }
    fixture *f = *state;
    dmk_mesh *m = NULL;
    for (char count = 0; count < 4; count++) { /* of two triangles */
        if (count == 2) continue;
        char words[80];
        file[80] = count;
        snprintf(words, sizeof words, "m.stl: 184 bytes, but binary STL of %d facets has %d; ",
                 count, 84 + 50 * count);
        put_file(f, "m.stl", file, n);
        assert_int_equal(dmk_mesh_read(f->ctx, f->path, &m), DMK_E_FORMAT);
        assert_non_null(strstr(dmk_context_message(f->ctx), words));
    }
    remove_file(f, "m.stl");
}

/* No line end is in the file, and data is not the text of which carriage returns are made line ends. */
static void test_stl_carriage_returns(void **state)
{
    char file[300];
    const size_t n = make_binary_stl(file, "a title\r");
    for (size_t t = 0; t < 2; t++) file[84 + 50 * t + 12 + 8] = '\r'; /* the z of vertex 0 */
    dmk_mesh *m = read_bytes(*state, "m.stl", file, n);
    assert_true(m->xyz[2] == 0x1p-149 * '\r');
    dmk_mesh_destroy(&m);
}

/* More vertices than the first table of places holds; each is met six times. */
static void test_stl_joins_equal_corners(void **state)
{
    enum { N = 60 };
    char *text = malloc(400 * 2 * N * N), *p = text;
    p += sprintf(p, "solid grid\n");
    for (int i = 0; i < N * N; i++) {
        int x = i / N, y = i % N;
        const int corner[6][2] = {{x, y}, {x + 1, y},     {x + 1, y + 1},
                                  {x, y}, {x + 1, y + 1}, {x, y + 1}};
        for (int k = 0; k < 6; k++) {
            if (k % 3 == 0) p += sprintf(p, "facet normal 0 0 0\nouter loop\n");
            p += sprintf(p, "vertex %.17g %.17g %d\n", corner[k][0] / 3.0, corner[k][1] / 7.0,
                         corner[k][0] * corner[k][1]);
            if (k % 3 == 2) p += sprintf(p, "endloop\nendfacet\n");
        }
    }
    sprintf(p, "endsolid grid\n");
    dmk_mesh *m = read_text(*state, "m.stl", text);
    dmk_mesh_info info;
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_vertices, (N + 1) * (N + 1));
    assert_int_equal(info.n_border_edges, 4 * N);
    assert_int_equal(info.euler, 1);
    dmk_mesh_destroy(&m);
    free(text);
}

/* The last facet has two corners of the first, with so many others between that only the sort finds them. */
static void test_stl_joins_far_corners(void **state)
{
    enum { N = 30000 };
    char *text = malloc(100 * N), *p = text;
    p += sprintf(p, "solid\n");
    for (int i = 0; i < N; i++)
        p += sprintf(p, "loop\nvertex %d 0 0\nvertex %d 1 0\nvertex %d 0 1\nendloop\n", i, i, i);
    sprintf(p, "loop\nvertex 0 1 0\nvertex 0 0 0\nvertex 0 0 -1\nendloop\nendsolid\n");
    dmk_mesh *m = read_text(*state, "m.stl", text);
    dmk_mesh_info info;
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_vertices, 3 * N + 1);
    assert_int_equal(info.n_components, N);
    dmk_mesh_destroy(&m);
    free(text);
}

/* Places that the sort's hash does not tell apart in its last 20 bits (a table of hashes, as there is in
 * many a reader, takes them for one): it would compare each with each, 2e10 times. */
static void test_stl_places_of_one_hash(void **state)
{
    enum { N = 80000 }; /* triangles: 2.4e5 places */
    const uint64_t factor = 0x9e3779b97f4a7c15ULL;
    unsigned char *file = calloc(1, 84 + (size_t)50 * N), *p = file + 84;
    uint64_t inverse = factor;
    for (int k = 0; k < 5; k++) inverse *= 2 - factor * inverse; /* modulo 2^64 */
    for (int t = 0; t < N; t++, p += 50) {
        for (int k = 0; k < 3; k++) {
            float x[3] = {(float)(t + 1), (float)(k + 1), 0};
            uint64_t h = 0, b;
            for (int i = 0; i < 2; i++) {
                double d = (double)x[i];
                memcpy(&b, &d, sizeof b);
                h = (h ^ b) * factor;
                h ^= h >> 32;
            }
            /* z = 1 + m / 2^23: its bits are 0x3ff0... + m << 29. The last 29 bits of (h ^ z) * factor
             * are known, and m is chosen so that bits 32..51 are the last 20 of them. */
            uint64_t low = h & 0x1fffffff, known = low * factor, carry = known >> 29;
            uint64_t want = ((known & 0xfffff) << 3) - carry;
            uint64_t m = (want * inverse ^ h >> 29) & 0x7fffff;
            x[2] = 1 + (float)m / 8388608;
            memcpy(p + 12 + 12 * k, x, sizeof x);
        }
    }
    for (int i = 0; i < 4; i++) file[80 + i] = (unsigned char)(N >> (8 * i));
    dmk_mesh *m = read_bytes(*state, "m.stl", file, 84 + (size_t)50 * N);
    dmk_mesh_info info;
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_vertices, 3 * N);
    dmk_mesh_destroy(&m);
    free(file);
}

#define FACET "solid a\nfacet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\n"

static const refusal stl_refusals[] = {
    {"m.stl", "solid\nendsolid\n", DMK_E_FORMAT, "m.stl: contains no facets"},
    {"m.stl", "facet\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n", DMK_E_FORMAT,
     "m.stl:5: a facet with 2 corners"},
    {"m.stl", "solid\nouter loop\nvertex 0 0 a\n", DMK_E_FORMAT, "m.stl:3: 'a' where a vertex"},
    {"m.stl", "solid\nouter loop\nvertex 0 0", DMK_E_FORMAT, "m.stl:3: the file ends before"},
    {"m.stl", FACET "outer loop\nvertex 0 0 0\nvertex 1 0 0\n", DMK_E_FORMAT,
     "m.stl:11: the file ends before endsolid; it is cut short"},
    {"m.stl", FACET "facet normal", DMK_E_FORMAT, "m.stl:8: the file ends before endsolid"},
    {"m.stl", FACET, DMK_E_FORMAT, "m.stl:8: the file ends before endsolid"},
    {"m.stl", FACET "endsolid\nsolid b\nloop\n", DMK_E_FORMAT, "m.stl:11: the file ends before"},
    {"m.stl", "solid\nloop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 0\nendloop\nendsolid",
     DMK_E_MESH, "m.stl: triangle 0 (vertices 0 1 0) is degenerate"},
};

static void test_stl_refusals(void **state)
{
    check_refusals(*state, stl_refusals, COUNT(stl_refusals));
}

/* ---- gzip ---- */

static void put_packed(fixture *f, const char *name, const char *text, const char *mode)
{
    gzFile z = gzopen(path_of(f, name), mode);
    assert_non_null(z);
    assert_int_equal(gzwrite(z, text, (unsigned)strlen(text)), strlen(text));
    assert_int_equal(gzclose(z), Z_OK);
}

/* Zeros behind the end, as tapes leave them. */
static void put_zeros(fixture *f, const char *name)
{
    static const char zeros[512];
    FILE *file = fopen(path_of(f, name), "ab");
    assert_non_null(file);
    assert_int_equal(fwrite(zeros, 1, sizeof zeros, file), sizeof zeros);
    assert_int_equal(fclose(file), 0);
}

static void test_gzip(void **state)
{
    fixture *f = *state;
    put_packed(f, "m.off.gz", "OFF 4 2 0\n" VERTICES "3 0 1 2\n3 0 2 3\n", "wb");
    check_square(read_mesh(f, "m.off.gz"));
    remove_file(f, "m.off.gz");
    /* the suffix before .gz counts where the content does not decide; two packed parts, padded */
    put_packed(f, "m.OFF.GZ", "4 2 0\n" VERTICES, "wb");
    put_zeros(f, "m.OFF.GZ");
    put_packed(f, "m.OFF.GZ", "3 0 1 2\n3 0 2 3\n", "ab");
    put_zeros(f, "m.OFF.GZ");
    check_square(read_mesh(f, "m.OFF.GZ"));
    remove_file(f, "m.OFF.GZ");
    /* mostly blanks: a thousand times its packed size */
    size_t n = 5000000;
    char *text = malloc(n + 1);
    memset(text, ' ', n);
    memcpy(text, HEADER, sizeof HEADER - 1);
    static const char body[] = VERTICES "3 0 1 2 3 0 2 3";
    memcpy(text + n + 1 - sizeof body, body, sizeof body);
    put_packed(f, "m.gz", text, "wb");
    check_square(read_mesh(f, "m.gz"));
    remove_file(f, "m.gz");
    free(text);
}

static void test_damaged_gzip(void **state)
{
    fixture *f = *state;
    put_packed(f, "m.gz", "OFF 4 2 0\n" VERTICES "3 0 1 2\n3 0 2 3\n", "wb");
    size_t n, n_refused = 0;
    char *content = get_file(f, "m.gz", &n);
    for (size_t i = 0; i < 2 * n; i++) {
        dmk_mesh *m = NULL;
        if (i >= n) content[i - n] ^= 0x10;
        put_file(f, "m.gz", content, i < n ? i : n);
        int rc = dmk_mesh_read(f->ctx, f->path, &m);
        if (i >= n) content[i - n] ^= 0x10;
        /* a few bits mean nothing: the date, and what fills up the last byte of data */
        if (i < n) assert_int_equal(rc, DMK_E_FORMAT);
        if (rc == DMK_OK) check_square(m);
        n_refused += rc != DMK_OK;
    }
    assert_true(n_refused > 2 * n - 10);
    assert_non_null(strstr(dmk_context_message(f->ctx), "m.gz: damaged: cannot unpack it"));
    free(content);
    remove_file(f, "m.gz");
}

/* ---- damaged files ---- */

/* Whatever stands in a file, reading ends well: whole files cut anywhere and with random bytes. */
static void test_damaged_files(void **state)
{
    fixture *f = *state;
    char files[4][1024];
    size_t n[4];
    uint64_t s = 987654321;
    n[0] = (size_t)sprintf(files[0], HEADER VERTICES "3 0 1 2\n3 0 2 3\n");
    n[1] = make_binary_ply(files[1], false, "\n");
    n[2] = make_binary_stl(files[2], "title");
    n[3] = (size_t)sprintf(files[3], "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n"
                                     "vertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\nendsolid\n");
    for (size_t i = 0; i < 4; i++) {
        for (size_t trial = 0; trial < n[i] + 2000; trial++) {
            char bytes[1024];
            memcpy(bytes, files[i], n[i]);
            for (size_t k = n[i]; k < trial; k += 700) {
                s = s * 6364136223846793005ULL + 1442695040888963407ULL;
                bytes[(s >> 33) % n[i]] = "0123456789-.e \n\\\0\377\177\200"[(s >> 48) % 20];
            }
            put_file(f, "m.stl", bytes, trial < n[i] ? trial : n[i]);
            dmk_mesh *m = NULL;
            int rc = dmk_mesh_read(f->ctx, f->path, &m);
            assert_true((rc == DMK_OK) == (m != NULL));
            dmk_mesh_destroy(&m);
        }
    }
    remove_file(f, "m.stl");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_ply_text_variants),
        TEST(test_ply_binary_variants),
        TEST(test_ply_binary_records),
        TEST(test_ply_binary_lists),
        TEST(test_ply_results_are_meshes),
        TEST(test_ply_data_like_line_ends),
        TEST(test_ply_refusals),
        TEST(test_ply_keeps_every_bit),
        TEST(test_ply_rows_fit_their_header),
        TEST(test_stl_text_variants),
        TEST(test_stl_binary_variants),
        TEST(test_stl_carriage_returns),
        TEST(test_stl_joins_equal_corners),
        TEST(test_stl_joins_far_corners),
        TEST(test_stl_places_of_one_hash),
        TEST(test_stl_refusals),
        TEST(test_gzip),
        TEST(test_damaged_gzip),
        TEST(test_damaged_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
