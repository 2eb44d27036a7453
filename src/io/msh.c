/* Gmsh MSH, versions 2 and 4 (4.0 and 4.1), text and binary of both byte orders. Nodes become
 * vertices in the file's order; faces become triangles (see cells.h), of all surfaces of the model
 * together. Sections other than $Nodes and $Elements are passed over. */
#include "io/cells.h"
#include "io/values.h"

#include <stdlib.h>
#include <string.h>

/* Elements by Gmsh's type number. Curved faces are refused before their nodes are read. */
static const struct {
    uint8_t cell, n_nodes;
} elements[] = {
    [1] = {DMK_CELL_THIN, 2},     [2] = {DMK_CELL_POLYGON, 3},  [3] = {DMK_CELL_POLYGON, 4},
    [4] = {DMK_CELL_VOLUME, 4},   [5] = {DMK_CELL_VOLUME, 8},   [6] = {DMK_CELL_VOLUME, 6},
    [7] = {DMK_CELL_VOLUME, 5},   [8] = {DMK_CELL_THIN, 3},     [9] = {DMK_CELL_TRIANGLE6, 6},
    [10] = {DMK_CELL_CURVED, 0},  [11] = {DMK_CELL_VOLUME, 10}, [12] = {DMK_CELL_VOLUME, 27},
    [13] = {DMK_CELL_VOLUME, 18}, [14] = {DMK_CELL_VOLUME, 14}, [15] = {DMK_CELL_THIN, 1},
    [16] = {DMK_CELL_CURVED, 0},  [17] = {DMK_CELL_VOLUME, 20}, [18] = {DMK_CELL_VOLUME, 15},
    [19] = {DMK_CELL_VOLUME, 13}, [20] = {DMK_CELL_CURVED, 0},  [21] = {DMK_CELL_CURVED, 0},
    [22] = {DMK_CELL_CURVED, 0},  [23] = {DMK_CELL_CURVED, 0},  [24] = {DMK_CELL_CURVED, 0},
    [25] = {DMK_CELL_CURVED, 0},  [26] = {DMK_CELL_THIN, 4},    [27] = {DMK_CELL_THIN, 5},
    [28] = {DMK_CELL_THIN, 6},    [29] = {DMK_CELL_VOLUME, 20}, [30] = {DMK_CELL_VOLUME, 35},
    [31] = {DMK_CELL_VOLUME, 56}, [36] = {DMK_CELL_CURVED, 0},  [37] = {DMK_CELL_CURVED, 0},
    [92] = {DMK_CELL_VOLUME, 64}, [93] = {DMK_CELL_VOLUME, 125}};

/* Nodes go by tags, any positive numbers. */
typedef struct node {
    int64_t tag;
    int32_t vertex;
} node;

typedef struct msh {
    dmk_values in;
    int version;        /* 2 or 4 */
    bool is_parametric; /* $ParametricNodes of version 2 */
    bool is_40;         /* 4.0, whose blocks are built otherwise than those of 4.1 */
    dmk_type size;      /* of counts and tags in binary files of 4.1 */
    dmk_soup *soup;
    size_t vertex_room;
    node *node; /* soup->n_vertices, sorted by tag once all are read */
    dmk_corners corners;
    dmk_cells cells;
} msh;

bool dmk_msh_sniff(const dmk_file *file)
{
    static const char *const words[] = {"$MeshFormat", "$Comments", "$NOD"};
    dmk_text t = dmk_text_of(file);
    if (!dmk_text_seek(&t) || *t.at != '$') return false;
    for (int i = 0; i < 3; i++) {
        if (dmk_text_is(&t, words[i])) return true;
    }
    return false;
}

/* ---- sections ---- */

/* Behind the line "$EndNAME" of the section that began with "$NAME" at `name`. Binary data may hold
 * anything, so the whole word is looked for. */
static int skip_section(msh *m, const char *name, size_t n)
{
    dmk_text *t = &m->in.text;
    char end[64] = "$End";
    if (n < 2 || n > 48) {
        t->at = name;
        return dmk_text_fail_word(t, "is no section of MSH");
    }
    memcpy(end + 4, name + 1, n - 1);
    const char *p = memmem(t->at, (size_t)(t->end - t->at), end, n + 3);
    if (!p) return dmk_text_fail(t, "no %s after it: the file is cut short", end);
    t->at = p + n + 3;
    dmk_text_skip_line(t);
    return DMK_OK;
}

static int read_format(msh *m)
{
    int rc;
    double version;
    int64_t is_binary, size, one;
    dmk_values *in = &m->in;
    DMK_TRY(dmk_values_number(in, DMK_FLOAT64, "the version", &version));
    DMK_TRY(dmk_values_integer(in, DMK_INT32, "the file type", &is_binary));
    DMK_TRY(dmk_values_integer(in, DMK_INT32, "the data size", &size));
    if (!(version >= 2 && version < 3) && !(version >= 4 && version < 5)) {
        return dmk_text_fail(&in->text, "version %.4g of MSH; export version 2 or 4", version);
    }
    m->version = (int)version;
    m->is_40 = version == 4.0;
    m->size = size == 4 ? DMK_UINT32 : DMK_UINT64;
    if ((is_binary != 0 && is_binary != 1) || (size != 8 && size != 4)) {
        return dmk_text_fail(&in->text, "a file type other than 0 and 1, or a data size other than "
                                        "4 and 8");
    }
    if (is_binary) {
        dmk_text_skip_line(&in->text);
        in->binary = true;
        DMK_TRY(dmk_values_integer(in, DMK_INT32, "the number 1", &one));
        in->swap = one != 1;
        if (one != 1 && one != 0x01000000) rc = dmk_values_fail(in, "not the number 1");
    }
done:
    return rc;
}

/* The first number of a section of version 2 is text in binary files too. */
static int read_text_count(msh *m, const char *what, int64_t *n)
{
    int rc;
    dmk_text_seek(&m->in.text);
    DMK_TRY(dmk_text_integer(&m->in.text, what, n));
    dmk_text_skip_line(&m->in.text);
done:
    return rc;
}

/* ---- nodes ---- */

/* Room for n nodes more, of which each takes at least a tag and three numbers. */
static int add_room(msh *m, int64_t n)
{
    int rc;
    dmk_context *ctx = m->in.text.context;
    const size_t tag = m->in.binary ? 4 : 2, number = m->in.binary ? 8 : 2;
    const size_t left = (size_t)(m->in.text.end - m->in.text.at);
    if (n < 0 || (uint64_t)n > (left + 1) / (tag + 3 * number) ||
        (uint64_t)n > (uint64_t)INT32_MAX - m->soup->n_vertices) {
        return dmk_values_fail(&m->in,
                               "%lld nodes do not fit into the %zu bytes that follow; the "
                               "file is cut short or its counts are wrong",
                               (long long)n, left);
    }
    const size_t need = m->soup->n_vertices + (size_t)n;
    size_t room = m->vertex_room;
    DMK_TRY(DMK_GROW_TRIPLES(ctx, m->soup->xyz, need, room));
    rc = DMK_GROW(ctx, m->node, need, m->vertex_room);
done:
    return rc;
}

static int read_tag(msh *m, dmk_type type, node *x)
{
    return dmk_values_integer(&m->in, type, "a node's tag", &x->tag);
}

/* What $ParametricNodes of version 2 say of a node: dimension and tag of its entity, a parameter
 * for each dimension of a curve or surface. */
static int skip_parameters(msh *m)
{
    int rc;
    int64_t dimension;
    DMK_TRY(dmk_values_integer(&m->in, DMK_INT32, "a node's dimension", &dimension));
    DMK_TRY(dmk_values_skip(&m->in, DMK_INT32, 1));
    if (dimension != 1 && dimension != 2) return DMK_OK;
    DMK_TRY(dmk_values_skip(&m->in, DMK_FLOAT64, (size_t)dimension));
done:
    return rc;
}

/* Coordinates of the next vertex, and n_more parameters that are passed over. */
static int read_place(msh *m, size_t v, size_t n_more)
{
    int rc = DMK_OK;
    m->node[v].vertex = (int32_t)v;
    for (size_t k = 0; k < 3; k++) {
        DMK_TRY(dmk_values_number(&m->in, DMK_FLOAT64, "a node's coordinate",
                                  &m->soup->xyz[3 * v + k]));
    }
    DMK_TRY(dmk_values_skip(&m->in, DMK_FLOAT64, n_more));
done:
    return rc;
}

/* n nodes, each with its tag before its position. */
static int read_mixed_nodes(msh *m, int64_t n, size_t n_more)
{
    int rc;
    DMK_TRY(add_room(m, n));
    for (int64_t i = 0; i < n; i++) {
        DMK_TRY(read_tag(m, DMK_INT32, &m->node[m->soup->n_vertices]));
        DMK_TRY(read_place(m, m->soup->n_vertices, n_more));
        if (m->is_parametric) DMK_TRY(skip_parameters(m));
        m->soup->n_vertices++;
    }
done:
    return rc;
}

/* n tags, then n positions. */
static int read_parted_nodes(msh *m, int64_t n, size_t n_more)
{
    int rc;
    const size_t first = m->soup->n_vertices;
    DMK_TRY(add_room(m, n));
    for (size_t i = 0; i < (size_t)n; i++) DMK_TRY(read_tag(m, m->size, &m->node[first + i]));
    for (size_t i = 0; i < (size_t)n; i++) DMK_TRY(read_place(m, first + i, n_more));
    m->soup->n_vertices += (size_t)n;
done:
    return rc;
}

/* The numbers at the head of a section of version 4: blocks and entities, in 4.1 the range of tags
 * too. */
static int read_head(msh *m, int64_t *n_blocks)
{
    int rc;
    const dmk_type type = m->is_40 ? DMK_UINT64 : m->size;
    DMK_TRY(dmk_values_integer(&m->in, type, "the number of blocks", n_blocks));
    DMK_TRY(dmk_values_skip(&m->in, type, m->is_40 ? 1 : 3));
    DMK_TRY(dmk_values_room(&m->in, "blocks", *n_blocks, 4, DMK_INT32));
done:
    return rc;
}

/* The head of a block: dimension and tag of its entity (the other way round in 4.0), a number that
 * says more, the count. */
static int read_block(msh *m, int64_t *dimension, int64_t *more, int64_t *count)
{
    int rc;
    int64_t two[2] = {0};
    DMK_TRY(dmk_values_integer(&m->in, DMK_INT32, "an entity", &two[0]));
    DMK_TRY(dmk_values_integer(&m->in, DMK_INT32, "an entity", &two[1]));
    DMK_TRY(dmk_values_integer(&m->in, DMK_INT32, "a block's type", more));
    DMK_TRY(dmk_values_integer(&m->in, m->is_40 ? DMK_UINT64 : m->size, "a block's size", count));
    *dimension = two[m->is_40 ? 1 : 0];
    if (*dimension < 0 || *dimension > 3) {
        rc = dmk_values_fail(&m->in, "a block of dimension %lld", (long long)*dimension);
    }
done:
    return rc;
}

static int read_nodes(msh *m)
{
    int rc;
    int64_t n = 0, n_blocks = 0, dimension = 0, parametric = 0;
    if (m->version == 2) {
        DMK_TRY(read_text_count(m, "the number of nodes", &n));
        return read_mixed_nodes(m, n, 0);
    }
    DMK_TRY(read_head(m, &n_blocks));
    for (int64_t b = 0; b < n_blocks; b++) {
        DMK_TRY(read_block(m, &dimension, &parametric, &n));
        const size_t n_more = parametric ? (size_t)dimension : 0;
        DMK_TRY(m->is_40 ? read_mixed_nodes(m, n, n_more) : read_parted_nodes(m, n, n_more));
    }
done:
    return rc;
}

static int by_tag(const void *a, const void *b)
{
    const node *x = a, *y = b;
    return (x->tag > y->tag) - (x->tag < y->tag);
}

/* So that find_vertex can search; tags that stand twice are refused. */
static int sort_nodes(msh *m)
{
    const size_t n = m->soup->n_vertices;
    bool sorted = true;
    for (size_t i = 1; i < n; i++) sorted = sorted && m->node[i - 1].tag < m->node[i].tag;
    if (!sorted) qsort(m->node, n, sizeof *m->node, by_tag);
    for (size_t i = 1; i < n; i++) {
        if (m->node[i - 1].tag == m->node[i].tag) {
            return dmk_values_fail(&m->in, "node %lld appears twice before",
                                   (long long)m->node[i].tag);
        }
    }
    return DMK_OK;
}

static int find_vertex(const msh *m, int64_t tag, int32_t *vertex)
{
    const size_t n = m->soup->n_vertices;
    const node key = {.tag = tag}, *x = NULL;
    if (n > 0) { /* most often tags count on from the first */
        const uint64_t guess = (uint64_t)tag - (uint64_t)m->node[0].tag;
        x = guess < n && m->node[guess].tag == tag ? &m->node[guess]
                                                   : bsearch(&key, m->node, n, sizeof key, by_tag);
    }
    if (!x) {
        return dmk_values_fail(&m->in, "node %lld of an element is not among the %zu in $Nodes",
                               (long long)tag, n);
    }
    *vertex = x->vertex;
    return DMK_OK;
}

/* ---- elements ---- */

static int check_type(const msh *m, int64_t type)
{
    const int64_t n = (int64_t)(sizeof elements / sizeof *elements);
    if (type > 0 && type < n && elements[type].cell != DMK_CELL_UNKNOWN) {
        const char *refusal = dmk_cell_refusal(elements[type].cell, elements[type].n_nodes);
        return refusal ? dmk_values_fail(&m->in, "%s", refusal) : DMK_OK;
    }
    return dmk_values_fail(&m->in, "elements of type %lld; export first-order triangles",
                           (long long)type);
}

static int read_element(msh *m, int64_t type, dmk_type size)
{
    int rc;
    const dmk_cell cell = elements[type].cell;
    const size_t n = elements[type].n_nodes;
    if (cell == DMK_CELL_THIN || cell == DMK_CELL_VOLUME) {
        DMK_TRY(dmk_values_skip(&m->in, size, n));
    } else {
        DMK_TRY(dmk_corners_resize(m->in.text.context, &m->corners, n));
        for (size_t k = 0; k < n; k++) {
            int64_t tag = 0;
            DMK_TRY(dmk_values_integer(&m->in, size, "an element's node", &tag));
            DMK_TRY(find_vertex(m, tag, &m->corners.vertex[k]));
        }
    }
    rc = dmk_cell_add(m->in.text.context, m->soup, cell, &m->corners, &m->cells);
done:
    return rc;
}

/* Each with a number, a type and some tags of its own; in binary files type and number of tags are
 * given once for a run of elements. */
static int read_elements_2(msh *m)
{
    int rc;
    int64_t n = 0, type = 0, n_run = 1, n_tags = 0;
    dmk_values *in = &m->in;
    DMK_TRY(read_text_count(m, "the number of elements", &n));
    DMK_TRY(dmk_values_room(in, "elements", n, 3, DMK_INT32));
    for (int64_t i = 0; i < n; i += n_run) {
        if (!in->binary) DMK_TRY(dmk_values_skip(in, DMK_INT32, 1));
        DMK_TRY(dmk_values_integer(in, DMK_INT32, "an element's type", &type));
        DMK_TRY(check_type(m, type));
        if (in->binary)
            DMK_TRY(dmk_values_integer(in, DMK_INT32, "the number of elements", &n_run));
        DMK_TRY(dmk_values_integer(in, DMK_INT32, "the number of tags", &n_tags));
        if (n_run < 1 || n_run > n - i || n_tags < 0) {
            return dmk_values_fail(in, "a wrong number of elements or tags");
        }
        for (int64_t k = 0; k < n_run; k++) {
            DMK_TRY(dmk_values_skip(in, DMK_INT32, (size_t)n_tags + (in->binary ? 1 : 0)));
            DMK_TRY(read_element(m, type, DMK_INT32));
        }
    }
done:
    return rc;
}

static int read_elements_4(msh *m)
{
    int rc;
    int64_t n_blocks = 0, dimension = 0, type = 0, n = 0;
    const dmk_type size = m->is_40 ? DMK_INT32 : m->size;
    DMK_TRY(read_head(m, &n_blocks));
    for (int64_t b = 0; b < n_blocks; b++) {
        DMK_TRY(read_block(m, &dimension, &type, &n));
        DMK_TRY(check_type(m, type));
        DMK_TRY(dmk_values_room(&m->in, "elements", n, 1u + elements[type].n_nodes, size));
        for (int64_t i = 0; i < n; i++) {
            DMK_TRY(dmk_values_skip(&m->in, size, 1));
            DMK_TRY(read_element(m, type, size));
        }
    }
done:
    return rc;
}

/* ---- the file ---- */

static int read_section(msh *m)
{
    int rc = DMK_OK;
    dmk_text *t = &m->in.text;
    const char *name = t->at;
    const size_t n = dmk_text_word(t);
    if (*name != '$' && m->version == 0)
        return dmk_text_fail_word(t,
                                  "where $MeshFormat is expected, with which Gmsh's files begin; "
                                  "files of other programs that end in .msh are not read");
    if (*name != '$') return dmk_text_fail_word(t, "where a section ($Nodes) is expected");
    if (dmk_text_take(t, "$NOD"))
        return dmk_text_fail(t, "version 1 of MSH; export version 2 or 4");
    if (dmk_text_take(t, "$MeshFormat")) {
        DMK_TRY(read_format(m));
    } else if (m->version == 0) {
        t->at += n;
    } else if (dmk_text_take(t, "$Nodes") ||
               (m->is_parametric = m->version == 2 && dmk_text_take(t, "$ParametricNodes"))) {
        if (m->soup->n_vertices > 0) return dmk_values_fail(&m->in, "a second $Nodes");
        dmk_text_skip_line(t);
        DMK_TRY(read_nodes(m));
        DMK_TRY(sort_nodes(m));
    } else if (dmk_text_take(t, "$Elements")) {
        dmk_text_skip_line(t);
        DMK_TRY(m->version == 2 ? read_elements_2(m) : read_elements_4(m));
    } else {
        t->at += n;
    }
    DMK_TRY(skip_section(m, name, n));
done:
    return rc;
}

int dmk_msh_read(dmk_context *ctx, const dmk_file *file, dmk_soup *soup)
{
    int rc;
    msh m = {.soup = soup};
    DMK_TRY(dmk_text_open(ctx, file, &m.in.text));
    while (dmk_text_seek(&m.in.text)) DMK_TRY(read_section(&m));
    DMK_TRY(dmk_cells_end(ctx, file->path, soup, &m.cells));
done:
    dmk_text_close(&m.in.text);
    free(m.node);
    free(m.corners.vertex);
    return rc;
}
