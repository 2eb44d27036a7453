/* Gmsh MSH and the formats of VTK, made by hand: variants that are accepted, what is refused and
 * how it is said, and files with every cut and every wrong byte. What other programs write is read
 * in test_formats.sh. */
#include "files.h"
#include "io/values.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#define MSH2 "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
#define MSH40 "$MeshFormat\n4 0 8\n$EndMeshFormat\n"
#define MSH41 "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n"
#define LEGACY "# vtk DataFile Version 3.0\nsolid v OFF\nASCII\n"
#define POINTS "POINTS 4 float\n0 0 0 1 0 0 1 1 0\n0 1 0\n"
#define LEGACY5 "# vtk DataFile Version 5.1\n\nASCII\nDATASET POLYDATA\n"
#define ARRAY(type, name, text)                                                                    \
    "<DataArray type=\"" type "\" Name=\"" name "\" format=\"ascii\">" text "</DataArray>\n"
#define XYZ(text)                                                                                  \
    "<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">" text          \
    "</DataArray></Points>\n"
#define VTP(piece)                                                                                 \
    "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\">\n<PolyData>" \
    "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"2\">" piece "</Piece></PolyData></VTKFile>\n"
#define VTU(piece)                                                                                 \
    "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid><Piece NumberOfPoints=\"4\" "            \
    "NumberOfCells=\"2\">" piece "</Piece></UnstructuredGrid></VTKFile>\n"
#define POLYS                                                                                      \
    "<Polys>" ARRAY("Int32", "connectivity", "0 1 2 0 2 3")                                        \
        ARRAY("Int32", "offsets", "3 6") "</Polys>"

/* The unit square in all the ways one may write it. */
static const char *const squares[] = {
    MSH2 "$PhysicalNames\n1\n2 1 \"all\"\n$EndPhysicalNames\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n"
         "4 0 1 0\n$EndNodes\n$Elements\n3\n1 15 2 0 1 1\n2 2 2 1 1 1 2 3\n3 2 3 1 1 0 1 3 4\n"
         "$EndElements\n",
    "$Comments\nmine\n$EndComments\n" MSH2
    "$Nodes\r\n4\r\n9 0 0 0\r\n7 1 0 0\r\n100 1 1 0\r\n3 0 1 0\r\n"
    "$EndNodes\r\n$Elements\r\n1\r\n1 3 0 9 7 100 3\r\n$EndElements\r\n",
    MSH40
    "$Nodes\n2 4\n1 1 1 2\n1 0 0 0 .5\n2 1 0 0 .7\n1 2 1 2\n3 1 1 0 1 2\n4 0 1 0 1 2\n$EndNodes\n"
    "$Elements\n2 3\n1 1 1 1\n1 1 2\n1 2 2 2\n2 1 2 3\n3 1 3 4\n$EndElements\n",
    MSH41 "$Entities\n0 0 1 0\n1 0 0 0 1 1 0 0 0\n$EndEntities\n$Nodes\n2 4 1 8\n1 1 1 2\n5\n6\n"
          "0 0 0 .5\n1 0 0 .7\n2 1 0 2\n8\n1\n1 1 0\n0 1 0\n$EndNodes\n$Elements\n2 3 1 3\n1 1 1 "
          "1\n1 5 6\n"
          "2 1 2 2\n2 5 6 8\n3 5 8 1\n$EndElements\n$NodeData\nwhat ever\n$EndNodeData\n",
    LEGACY "DATASET POLYDATA\n" POINTS "VERTICES 1 2\n1 0\nPOLYGONS 2 8\n3 0 1 2\n3 0 2 3\n"
           "POINT_DATA 4\nwhat ever",
    LEGACY "DATASET POLYDATA\n" POINTS "POLYGONS 1 5\n4 0 1 2 3\n",
    LEGACY "DATASET UNSTRUCTURED_GRID\nFIELD f 2\na 2 2 int\n1 2 3 4\nb 1 1 double 7\n" POINTS
           "CELLS 3 9\n3 0 1 2 0 3 0 2 3\nCELL_TYPES 3\n5 0 5\n", /* an empty cell */
    LEGACY "dataset unstructured_grid\nFIELD f 1\na 1 2 int\n1 2\n" POINTS
           "CELLS 3 11\n2 0 1\n3 0 1 2 3 0 2 3\nCELL_TYPES 3\n3\n5 5\n",
    LEGACY "DATASET UNSTRUCTURED_GRID\n" POINTS "CELLS 1 5\n4 0 1 3 2\nCELL_TYPES 1\n8\n",
    LEGACY "DATASET POLYDATA\nFIELD f 4\na%20b 2 2 string\nPOINTS 1 float\n\n#%20\n\nb 3 3 bit\n"
           "0 1 0 1 0 1 0 1\n0 \nc 1 2 signed_char\n-2 1\nd 1 0 string\n" POINTS
           "POLYGONS 1 5\n4 0 1 2 3\n",
    /* names with what begins a comment elsewhere */
    LEGACY "DATASET POLYDATA\nFIELD #f 3\n#a 1 2 int\n1 2\nMETADATA\nCOMPONENT_NAMES\n#x\n\n"
           "b#c 1 1 int\n3\nd\\ 1 1 int\n4\n" POINTS "POLYGONS 1 5\n4 0 1 2 3\n",
    LEGACY5 POINTS "METADATA\nINFORMATION 0\n\nPOLYGONS 3 6\nOFFSETS vtktypeint64\n0 3 6\n"
                   "CONNECTIVITY vtktypeint64\n0 1 2 0 2 3\n",
    VTP(XYZ("0 0 0 1 0 0 1 1 0 0 1 0") POLYS),
    VTP(XYZ(
        "0 0 0 1 0 0 1 1 0 0 1 0<InformationKey name=\"x\"><Value>7 8</Value></InformationKey>\n")
            POLYS
        "<PointData><DataArray type=\"what\" Name=\"connectivity\" offset=\"x\"/></PointData>"),
    VTP(XYZ("<InformationKey name=\"x\"><Value>7 8</Value></InformationKey>0 0 0 1 0 0 1 1 0 0 1 0")
            POLYS),
    "\xef\xbb\xbf<!-- mine -->" VTU(XYZ("0 0 0 1 0 0 1 1 0 0 1 0") "<Cells>" ARRAY(
        "UInt8", "types", "5 5") ARRAY("Int64", "connectivity", "0 1 2 0 2 3")
                                        ARRAY("Int64", "offsets", "3 6") "</Cells>"),
    /* base64, of bytes with their number before them */
    VTP(XYZ("0 0 0 1 0 0 1 1 0 0 1 0") "<Polys><DataArray type=\"UInt8\" Name=\"connectivity\" "
                                       "format=\"binary\">\n BgAAAAABAgAC\n Aw== "
                                       "</DataArray><DataArray type=\"Int16\" Name=\"offsets\""
                                       " format=\"binary\">BAAAAAMABgA=</DataArray></Polys>"),
};

static void test_accepted(void **state)
{
    for (size_t i = 0; i < COUNT(squares); i++) check_square(read_text(*state, "m", squares[i]));
}

static void test_strips_and_second_order(void **state)
{
    static const int32_t strip[] = {0, 1, 3, 3, 1, 2}, six[] = {0, 3, 5, 3, 1, 4, 5, 4, 2, 3, 4, 5};
    dmk_mesh *m = read_text(*state, "m",
                            LEGACY "DATASET POLYDATA\n" POINTS "TRIANGLE_STRIPS 1 5\n4 0 1 3 2\n");
    assert_memory_equal(m->triangle, strip, sizeof strip);
    dmk_mesh_destroy(&m);
    m = read_text(*state, "m",
                  MSH2
                  "$Nodes\n6\n1 0 0 0\n2 2 0 0\n3 0 2 0\n4 1 0 0\n5 1 1 0\n6 0 1 0\n$EndNodes\n"
                  "$Elements\n1\n1 9 0 1 2 3 4 5 6\n$EndElements\n");
    assert_memory_equal(m->triangle, six, sizeof six);
    dmk_mesh_destroy(&m);
}

static void test_single_precision_text(void **state)
{
    dmk_mesh *m = read_text(*state, "m",
                            LEGACY "DATASET POLYDATA\nPOINTS 3 float\n0.1 0 0 1 0 0 1 1 0\n"
                                   "POLYGONS 1 4\n3 0 1 2\n");
    assert_true(m->xyz[0] == (double)0.1f);
    dmk_mesh_destroy(&m);
    m = read_text(*state, "m",
                  LEGACY "DATASET POLYDATA\nPOINTS 3 double\n0.1 0 0 1 0 0 1 1 0\n"
                         "POLYGONS 1 4\n3 0 1 2\n");
    assert_true(m->xyz[0] == 0.1);
    dmk_mesh_destroy(&m);
}

static void test_pieces_follow_each_other(void **state)
{
#define PIECE                                                                                      \
    "<Piece NumberOfPoints=\"3\" NumberOfPolys=\"1\">" XYZ("0 0 0 1 0 0 0 1 0") "<Polys>" ARRAY(   \
        "Int32", "connectivity", "0 1 2") ARRAY("Int32", "offsets", "3") "</Polys></Piece>"
    static const int32_t both[] = {0, 1, 2, 3, 4, 5};
    dmk_mesh *m =
        read_text(*state, "m.vtp",
                  "<VTKFile type=\"PolyData\"><PolyData>" PIECE PIECE "</PolyData></VTKFile>");
    assert_int_equal(m->n_vertices, 6);
    assert_memory_equal(m->triangle, both, sizeof both);
    dmk_mesh_destroy(&m);
}

/* Nodes of each element type by Gmsh's reference manual: those without a face are passed over, whatever their size. */
static void test_elements_without_faces(void **state)
{
    static const struct {
        int type, n_nodes;
    } others[] = {{1, 2},   {4, 4},   {5, 8},   {6, 6},   {7, 5},   {8, 3},   {11, 10}, {12, 27},
                  {13, 18}, {14, 14}, {15, 1},  {17, 20}, {18, 15}, {19, 13}, {26, 4},  {27, 5},
                  {28, 6},  {29, 20}, {30, 35}, {31, 56}, {92, 64}, {93, 125}};
    for (size_t i = 0; i < COUNT(others); i++) {
        char text[2000];
        int n = snprintf(text, sizeof text,
                         MSH2 "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 1 1 0\n4 0 1 0\n$EndNodes\n"
                              "$Elements\n3\n1 2 0 1 2 3\n2 %d 2 7 7",
                         others[i].type);
        for (int k = 0; k < others[i].n_nodes; k++) n += snprintf(text + n, 8, " %d", k + 1);
        snprintf(text + n, 60, "\n3 2 0 1 3 4\n$EndElements\n");
        check_square(read_text(*state, "m.msh", text));
    }
}

/* What version 2 says of a node: 0 to 2 parameters by the dimension of its entity. */
static void test_parameters_of_nodes(void **state)
{
    check_square(read_text(
        *state, "m.msh",
        MSH2 "$ParametricNodes\n4\n1 0 0 0 0 7\n2 1 0 0 1 7 .5\n3 1 1 0 2 7 .5 .6\n"
             "4 0 1 0 3 7\n$EndParametricNodes\n$Elements\n1\n1 3 0 1 2 3 4\n$EndElements\n"));
}

/* As little text as nodes can take: 99 of them, most in no triangle. */
static void test_short_nodes(void **state)
{
    char text[2000];
    size_t n = (size_t)snprintf(text, sizeof text, MSH2 "$Nodes\n99\n");
    for (int i = 1; i < 100; i++)
        n += (size_t)snprintf(text + n, sizeof text - n, "%d %d %d 0\n", i, i % 3 > 0, i % 2);
    snprintf(text + n, sizeof text - n, "$EndNodes\n$Elements\n1\n1 2 0 1 2 3\n$EndElements\n");
    dmk_mesh *m = read_text(*state, "m.msh", text);
    dmk_mesh_info info;
    dmk_mesh_get_info(m, &info);
    assert_int_equal(info.n_vertices, 99);
    assert_int_equal(info.n_triangles, 1);
    dmk_mesh_destroy(&m);
}

/* ---- binary ---- */

typedef struct bytes {
    char text[4000];
    size_t n;
    bool swap; /* numbers the other way round */
} bytes;

static void add(bytes *b, const char *text)
{
    b->n += (size_t)snprintf(b->text + b->n, sizeof b->text - b->n, "%s", text);
}

static void add_number(bytes *b, const void *number, size_t size)
{
    for (size_t k = 0; k < size; k++)
        b->text[b->n++] = ((const char *)number)[b->swap ? size - 1 - k : k];
}

static void add_integers(bytes *b, const int32_t *integer, size_t n)
{
    for (size_t i = 0; i < n; i++) add_number(b, &integer[i], 4);
}

static void test_binary_msh(void **state)
{
    static const int32_t one = 1, run[] = {2, 2, 1, 8, 5, 1, 2, 3, 9, 5, 1, 3, 4};
    static const int32_t point[] = {15, 1, 0, 7, 1};
    for (int swap = 0; swap < 2; swap++) {
        bytes b = {.swap = swap};
        add(&b, "$MeshFormat\n2.2 1 8\n");
        add_integers(&b, &one, 1);
        add(&b, "\n$EndMeshFormat\n$Nodes\n4\n");
        for (int32_t v = 0; v < 4; v++) {
            const int32_t tag = v + 1;
            add_integers(&b, &tag, 1);
            for (int k = 0; k < 3; k++) add_number(&b, &square_xyz[3 * v + k], 8);
        }
        add(&b, "\n$EndNodes\n$Elements\n3\n");
        add_integers(&b, point, COUNT(point));
        add_integers(&b, run, COUNT(run));
        add(&b, "\n$EndElements\n");
        check_square(read_bytes(*state, "m.msh", b.text, b.n));
    }
}

/* Strings with their lengths in 1, 2, 4 and 8 bytes, the first no length itself, and nine bits in two bytes. */
static void add_field(bytes *b)
{
    static const char data[] = "\xc3"
                               "? b\xc0\x80\x01\n\x40\0\0\x02\n\n\0\0\0\0\0\0\0\x01"
                               "5\n"
                               "bits 3 3 bit\nPO\nsigned 2 1 signed_char\n56\n";
    add(b, "FIELD f 3\nnames 1 5 string\n");
    memcpy(b->text + b->n, data, sizeof data - 1);
    b->n += sizeof data - 1;
}

/* VTK's legacy format has the high byte first. */
static void test_binary_legacy(void **state)
{
    static const int32_t cells[] = {4, 0, 1, 2, 3};
    bytes b = {.swap = dmk_is_little_endian()};
    add(&b, "# vtk DataFile Version 3.0\nsquare\nBINARY\nDATASET POLYDATA\n");
    add_field(&b);
    add(&b, "POINTS 4 float\n");
    for (int k = 0; k < 12; k++) add_number(&b, &(float){(float)square_xyz[k]}, 4);
    add(&b, "\nPOLYGONS 1 5\n");
    add_integers(&b, cells, COUNT(cells));
    check_square(read_bytes(*state, "m.vtk", b.text, b.n));
}

static void add_base64(bytes *b, const unsigned char *data, size_t n)
{
    static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < n; i += 3) {
        uint32_t w = 0;
        for (size_t k = 0; k < 3; k++) w = w << 8 | (i + k < n ? data[i + k] : 0);
        for (size_t k = 0; k < 4; k++)
            b->text[b->n++] = i + k > n ? '=' : digit[w >> (18 - 6 * k) & 63];
    }
    b->text[b->n] = '\0';
}

/* A VTP whose points are packed in blocks of so many bytes; the packed size of the last is wrong by so many. */
static bytes packed_points(size_t block, uint32_t wrong)
{
    bytes b = {.n = 0};
    unsigned char packed[1000];
    uint32_t head[20] = {(uint32_t)((sizeof square_xyz + block - 1) / block), (uint32_t)block,
                         (uint32_t)(sizeof square_xyz % block)};
    size_t n = 0;
    for (uint32_t i = 0; i < head[0]; i++) {
        const size_t first = i * block, left = sizeof square_xyz - first;
        uLongf size = sizeof packed - n;
        assert_int_equal(compress(packed + n, &size, (const Bytef *)square_xyz + first,
                                  left < block ? left : block),
                         Z_OK);
        head[3 + i] = (uint32_t)size;
        n += size;
    }
    head[2] -= wrong;
    add(&b, "<VTKFile type=\"PolyData\" byte_order=\"LittleEndian\" "
            "compressor=\"vtkZLibDataCompressor\"><PolyData>"
            "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"2\"><Points><DataArray type=\"Float64\" "
            "NumberOfComponents=\"3\" format=\"binary\">");
    add_base64(&b, (const unsigned char *)head, (3 + head[0]) * sizeof *head);
    add_base64(&b, packed, n);
    add(&b, "</DataArray></Points>" POLYS "</Piece></PolyData></VTKFile>\n");
    return b;
}

static void test_packed_arrays(void **state)
{
    static const size_t blocks[] = {96, 48, 40, 24, 8, 1000};
    for (size_t i = 0; i < COUNT(blocks); i++) {
        const bytes b = packed_points(blocks[i], 0);
        check_square(read_bytes(*state, "m.vtp", b.text, b.n));
    }
    for (uint32_t wrong = 1; wrong <= 16;
         wrong *= 2) { /* the last block unpacks to more than it should */
        const bytes b = packed_points(40, wrong);
        const refusal r = {"m.vtp", b.text, DMK_E_FORMAT, "blocks that do not make up the array"};
        check_refusals(*state, &r, 1);
    }
}

/* Five blocks, of which the first four have 2^64 bytes together. */
static void test_blocks_beyond_all_bounds(void **state)
{
    static const uint64_t head[8] = {5, UINT64_C(1) << 62, sizeof square_xyz};
    bytes b = {.n = 0};
    add(&b, "<VTKFile type=\"PolyData\" header_type=\"UInt64\" "
            "compressor=\"vtkZLibDataCompressor\"><PolyData>"
            "<Piece NumberOfPoints=\"4\" NumberOfPolys=\"2\"><Points><DataArray type=\"Float64\" "
            "NumberOfComponents=\"3\" format=\"binary\">");
    add_base64(&b, (const unsigned char *)head, sizeof head);
    add(&b, "</DataArray></Points>" POLYS "</Piece></PolyData></VTKFile>\n");
    const refusal r = {"m.vtp", b.text, DMK_E_FORMAT, "blocks that do not make up the array"};
    if (dmk_is_little_endian()) check_refusals(*state, &r, 1);
}

/* Base64 comes in fours, of which one digit at least is none of the filling. */
static void test_wrong_base64(void **state)
{
    static const char *const ends[] = {"Aw", "A", "A===", "====", "Aw=A", "Aw.="};
    for (size_t i = 0; i < COUNT(ends); i++) {
        bytes b = {.n = 0};
        add(&b, "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" "
                "NumberOfPolys=\"2\">" XYZ("0 0 0 1 0 0 1 1 0 0 1 0") "<Polys>" ARRAY(
                    "Int8", "offsets", "3 6") "<DataArray type=\"UInt8\" Name=\"connectivity\" "
                                              "format=\"binary\">BgAAAAABAgACA");
        b.n--; /* the last digit is one of the ends' */
        add(&b, ends[i]);
        add(&b, "</DataArray></Polys></Piece></PolyData></VTKFile>");
        const refusal r = {"m.vtp", b.text, DMK_E_FORMAT, "connectivity: fewer bytes than"};
        check_refusals(*state, &r, 1);
    }
}

/* The data of cells are those of faces, wherever the points, lines and volumes beside them stand. */
static void test_arrays_of_faces(void **state)
{
#define RHO(values) "<CellData>" ARRAY("Float64", "rho", values) "</CellData>"
#define TYPES(types) "<Cells>" ARRAY("UInt8", "types", types) "</Cells>"
    static const char grid[] =
        "<VTKFile type=\"UnstructuredGrid\"><UnstructuredGrid>"
        "<Piece NumberOfCells=\"5\">" RHO("7 1 8 2 9")
            TYPES("3 5 10 9 1") "</Piece><Piece NumberOfCells=\"1\">" RHO("3")
                TYPES("22") "</Piece></UnstructuredGrid></VTKFile>";
    static const char poly[] = "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfVerts=\"1\" "
                               "NumberOfLines=\"1\" NumberOfPolys=\"2\" NumberOfStrips=\"1\">" RHO(
                                   "7 8 1 2 3") "</Piece></PolyData></VTKFile>";
    const char *const files[] = {grid, poly};
    fixture *f = *state;
    for (size_t i = 0; i < COUNT(files); i++) {
        double value[3];
        size_t n;
        int of_points = 1;
        put_file(f, "m", files[i], strlen(files[i]));
        assert_int_equal(dmk_array_read(f->ctx, path_of(f, "m"), "rho", 3, value, &n, &of_points),
                         DMK_OK);
        assert_int_equal(of_points, 0);
        assert_int_equal(n, 3);
        for (size_t k = 0; k < n; k++) assert_true(value[k] == (double)(k + 1));
        assert_int_equal(dmk_array_read(f->ctx, f->path, "rho", 2, value, &n, &of_points),
                         DMK_E_FORMAT);
        assert_non_null(strstr(dmk_context_message(f->ctx), "more than the 2 numbers"));
        remove_file(f, "m");
    }
}

static void test_refusals(void **state)
{
#define NODES "$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 1 1 0\n$EndNodes\n"
#define GOOD XYZ("0 0 0 1 0 0 1 1 0 0 1 0")
    static const refusal cases[] = {
        {"m.msh", "$NOD\n1\n", DMK_E_FORMAT, "m.msh:1: version 1 of MSH; export version 2 or 4"},
        {"m.msh", "$MeshFormat\n3 0 8\n$EndMeshFormat\n", DMK_E_FORMAT, "version 3 of MSH"},
        {"m.msh", "$MeshFormat\n1e300 0 8\n$EndMeshFormat\n", DMK_E_FORMAT,
         "version 1e+300 of MSH"},
        {"m.msh", "$MeshFormat\n2.2 2 8\n$EndMeshFormat\n", DMK_E_FORMAT,
         "a file type other than 0 and 1"},
        {"m.msh", "$MeshFormat\n2.2 0 5\n$EndMeshFormat\n", DMK_E_FORMAT,
         "a data size other than 4 and 8"},
        {"m", "$ABC\n2.2 0 8\n$EndABC\n", DMK_E_FORMAT, "m: neither its content nor its suffix"},
        {"m.msh", "$MeshFormat\n2.2 0 8\n", DMK_E_FORMAT, "no $EndMeshFormat after it"},
        {"m.msh", MSH2 "Nodes\n", DMK_E_FORMAT, "m.msh:4: 'Nodes' where a section"},
        {"m.msh", MSH2 "$Nodes\n3\n1 0 0 0\n", DMK_E_FORMAT, "3 nodes do not fit into"},
        {"m.msh", MSH2 "$Nodes\n2\n1 0 0 0\n1 1 0 0\n$EndNodes\n", DMK_E_FORMAT,
         "node 1 appears twice"},
        {"m.msh", MSH2 NODES "$Elements\n1\n1 2 0 1 2 4\n$EndElements\n", DMK_E_FORMAT,
         "node 4 of an element is not among the 3 in $Nodes"},
        {"m.msh", MSH2 NODES "$Elements\n1\n1 10 0 1 2 4\n$EndElements\n", DMK_E_FORMAT,
         "high order"},
        {"m.msh", MSH2 NODES "$Elements\n1\n1 99 0 1 2 4\n$EndElements\n", DMK_E_FORMAT,
         "of type 99"},
        {"m.msh", MSH2 NODES "$Elements\n2\n1 15 0 1\n2 4 0 1 2 3 1\n$EndElements\n", DMK_E_FORMAT,
         "1 volume cells (tetrahedra or the like) and no face; extract the surface"},
        {"m.msh", MSH2 NODES, DMK_E_FORMAT, "contains no faces"},
        {"m.msh", MSH41 "$Nodes\n1 3 1 3\n7 1 0 3\n", DMK_E_FORMAT, "a block of dimension 7"},
        {"m.msh", MSH41 "$Nodes\n9999999999999 3 1 3\n", DMK_E_FORMAT, "blocks do not fit into"},
        {"m.vtk", "\n+", DMK_E_FORMAT, "m.vtk:1: no '# vtk DataFile Version'"},
        {"m.msh", "\n+", DMK_E_FORMAT, "m.msh:2: '+' where $MeshFormat is expected"},
        {"m.vtu", "\n+", DMK_E_FORMAT, "not well-formed XML"},
        {"m.vtk", "# vtk DataFile Version 3.0\nx\nTEXT\n", DMK_E_FORMAT,
         "m.vtk:3: neither ASCII nor"},
        {"m.vtk", LEGACY "DATASET RECTILINEAR_GRID\n", DMK_E_FORMAT,
         "'RECTILINEAR_GRID' is neither"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nFIELD f 1\na 0 2 int\n1 2\n" POINTS, DMK_E_FORMAT,
         "an array of 0 components"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nFIELD f 1\na 1 8796093022208 bit\n1\n", DMK_E_FORMAT,
         "an array of 8796093022208 tuples"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nFIELD f 1\na 1 2 string\nx\n", DMK_E_FORMAT,
         "m.vtk:8: the file ends before its strings"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nFIELD f 1\na 1 1 variant\n6 3\n" POINTS, DMK_E_FORMAT,
         "m.vtk:6: 'variant' is the type of an array of data whose length is not known here; "
         "export the mesh "
         "without field data"},
        {"m.vtk",
         "# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nFIELD f 1\na 1 2 "
         "string\n\xc1x\xc2x",
         DMK_E_FORMAT, "the file ends within a string"},
        {"m.vtk",
         "# vtk DataFile Version 3.0\n\nBINARY\nDATASET POLYDATA\nFIELD f 1\na 1 2 "
         "string\n\xc1x\x80",
         DMK_E_FORMAT, "the file ends within a string"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nPOINTS 1 bit\n0", DMK_E_FORMAT,
         "'bit' is not a supported number type"},
        {"m.vtk", LEGACY "DATASET POLYDATA\nPOINTS 5 float\n0 0 0", DMK_E_FORMAT,
         "5 points do not fit"},
        {"m.vtk", LEGACY "DATASET POLYDATA\n" POINTS "POLYGONS 1 4\n3 0 1 4\n", DMK_E_FORMAT,
         "m.vtk:9: a cell's point is 4, out of range: there are 4, counted from 0"},
        {"m.vtk", LEGACY "DATASET POLYDATA\n" POINTS "POLYGONS 1 4\n9 0 1 2\n", DMK_E_FORMAT,
         "corners is 9"},
        {"m.vtk", LEGACY "DATASET POLYDATA\n" POINTS "POLYGONS 1 3\n2 0 1\n", DMK_E_FORMAT,
         "cell 0 is a face with too few corners"},
        {"m.vtk",
         LEGACY5 POINTS "POLYGONS 3 6\nOFFSETS int\n0 6 3\nCONNECTIVITY int\n0 1 2 0 2 3\n",
         DMK_E_FORMAT, "offsets that fall"},
        {"m.vtk",
         LEGACY "DATASET UNSTRUCTURED_GRID\n" POINTS "CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n22\n",
         DMK_E_FORMAT, "cell 0 is a face with too few corners"},
        {"m.vtk",
         LEGACY "DATASET UNSTRUCTURED_GRID\n" POINTS "CELLS 1 4\n3 0 1 2\nCELL_TYPES 2\n5 5\n",
         DMK_E_FORMAT, "2 cell types for 1 cells"},
        {"m.vtk",
         LEGACY "DATASET UNSTRUCTURED_GRID\n" POINTS "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n",
         DMK_E_FORMAT, "1 volume cells"},
        {"m.vtp", "<VTKFile type=\"PolyData\"><PolyData>", DMK_E_FORMAT,
         "m.vtp:1: the file ends before </VTKFile>; it is cut short"},
        {"m.vtp", "<VTKFile type=\"Poly", DMK_E_FORMAT, "m.vtp:1: the file ends before </VTKFile>"},
        {"m.vtp", "<VTKFile type=\"PolyData\"></Mesh>", DMK_E_FORMAT,
         "not well-formed XML: mismatched tag"},
        {"m.vtp", "<html><VTKFile/></html>", DMK_E_FORMAT, "m.vtp:1: 'html' where <VTKFile>"},
        {"m.vtp", "<VTKFile type=\"ImageData\"></VTKFile>", DMK_E_FORMAT,
         "'ImageData' is neither PolyData nor UnstructuredGrid"},
        {"m.vtp", "<!DOCTYPE a [<!ENTITY b \"c\">]><VTKFile type=\"PolyData\"/>", DMK_E_FORMAT,
         "DOCTYPE"},
        {"m.vtp", VTP(POLYS), DMK_E_FORMAT, "no array of points"},
        {"m.vtp", VTP(XYZ("0 0 0 1 0 0 1 1 0 0 1") POLYS), DMK_E_FORMAT,
         "m.vtp:3: points: 12 numbers do not fit into the 21 bytes"},
        {"m.vtp", VTP(XYZ("0 0 0 1 0 0 1 1 0 0  1 ") POLYS), DMK_E_FORMAT,
         "the file ends before points"},
        {"m.vtp",
         VTP(GOOD "<Polys>" ARRAY("Int8", "connectivity", "0 1 2 0 2 4")
                 ARRAY("Int8", "offsets", "3 6") "</Polys>"),
         DMK_E_FORMAT, "point 4 of cell 1 is out of range: there are 4, counted from 0"},
        {"m.vtp",
         VTP(GOOD "<Polys>" ARRAY("Int8", "connectivity", "0 1 2 0 2 3")
                 ARRAY("Int8", "offsets", "3 2") "</Polys>"),
         DMK_E_FORMAT, "offsets that fall"},
        {"m.vtp", VTP(GOOD "<Polys>" ARRAY("Int8", "offsets", "3 6") "</Polys>"), DMK_E_FORMAT,
         "cells without connectivity"},
        {"m.vtp", VTP(GOOD "<Polys>" ARRAY("Int9", "offsets", "3 6") "</Polys>"), DMK_E_FORMAT,
         "'Int9' is not a supported number type"},
        {"m.vtp",
         VTP(GOOD "<Polys><DataArray type=\"Int8\" Name=\"offsets\" format=\"appended\" "
                  "offset=\"0\"/><DataArray type=\"Int8\" Name=\"connectivity\" "
                  "format=\"appended\" offset=\"0\"/></Polys>"),
         DMK_E_FORMAT, "offsets: appended data is referenced but missing"},
        {"m.vtp",
         VTP(GOOD "<Polys><DataArray type=\"UInt8\" Name=\"offsets\" format=\"binary\">"
                  "BgAAAAABAgACAw==</DataArray><DataArray type=\"Int8\" "
                  "Name=\"connectivity\"></DataArray></Polys>"),
         DMK_E_FORMAT, "offsets: 6 bytes where there should be 2"},
        {"m.vtu",
         VTU(GOOD "<Cells>" ARRAY("UInt8", "types", "5 5")
                 ARRAY("Int64", "connectivity", "0 1 2 0 2 3 1 2")
                     ARRAY("Int64", "offsets", "4 8") "</Cells>") "x",
         DMK_E_FORMAT, "junk"},
        {"m.vtu",
         VTU(GOOD "<Cells>" ARRAY("UInt8", "types", "10 69")
                 ARRAY("Int64", "connectivity", "0 1 2 0 2 3 1 2")
                     ARRAY("Int64", "offsets", "4 8") "</Cells>"),
         DMK_E_FORMAT, "cell 1 is a curved face"},
    };
    check_refusals(*state, cases, COUNT(cases));
}

/* Whatever is wrong with a file, it is read or refused in words; sanitizers see the rest. */
static void read_somehow(fixture *f, const char *text, size_t n)
{
    dmk_mesh *m = NULL;
    put_file(f, "m", text, n);
    const int rc = dmk_mesh_read(f->ctx, path_of(f, "m"), &m);
    assert_true((rc == DMK_OK) == (m != NULL));
    if (rc != DMK_OK) assert_true(strlen(dmk_context_message(f->ctx)) > 10);
    dmk_mesh_destroy(&m);
    remove_file(f, "m");
}

static void test_every_cut(void **state)
{
    for (size_t i = 0; i < COUNT(squares); i++) {
        for (size_t n = 1; n < strlen(squares[i]); n++) read_somehow(*state, squares[i], n);
    }
}

static void test_every_wrong_byte(void **state)
{
    static const char wrong[] = {'9', ' ', '<', '\0'};
    for (size_t i = 0; i < COUNT(squares); i++) {
        const size_t n = strlen(squares[i]);
        char *text = strdup(squares[i]);
        for (size_t k = 0; k < n; k++) {
            text[k] = wrong[(i + k) % sizeof wrong];
            read_somehow(*state, text, n);
            text[k] = squares[i][k];
        }
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_accepted),
        TEST(test_strips_and_second_order),
        TEST(test_single_precision_text),
        TEST(test_pieces_follow_each_other),
        TEST(test_elements_without_faces),
        TEST(test_parameters_of_nodes),
        TEST(test_short_nodes),
        TEST(test_binary_msh),
        TEST(test_binary_legacy),
        TEST(test_packed_arrays),
        TEST(test_blocks_beyond_all_bounds),
        TEST(test_wrong_base64),
        TEST(test_arrays_of_faces),
        TEST(test_refusals),
        TEST(test_every_cut),
        TEST(test_every_wrong_byte),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
