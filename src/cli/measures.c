/* Files of measures: one number a line, masses of vertices or densities of triangles by their number; or
 * lines `vertex I MASS` and `X,Y,Z MASS`; # begins a comment. FILE.vtp:NAME is an array of a VTP or VTU file. */
#include "transport.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Numbers of a line, between two of which are blanks, a comma or both, after the word `vertex` if it is there. */
typedef struct line {
    bool vertex;
    double number[5];
    int n; /* -1: something else is on the line, or nothing where a comma wants a number */
} line;

/* Past blanks and at most one comma; *comma: whether it is there. */
static char *skip_separator(char *text, bool *comma)
{
    text += strspn(text, " \t");
    *comma = *text == ',';
    return *comma ? text + 1 + strspn(text + 1, " \t") : text;
}

static line read_line(char *text)
{
    static const char word[] = "vertex";
    const size_t length = sizeof word - 1;
    line l = {.vertex = strncmp(text, word, length) == 0 && strchr(" \t,", text[length])};
    bool comma = false, apart = true; /* from what is before */
    if (l.vertex) text = skip_separator(text + length, &comma);
    while (l.n < 5 && apart) {
        char *end;
        l.number[l.n] = cli_decimal(text, &end);
        if (end == text) break;
        l.n++;
        text = skip_separator(end, &comma);
        apart = text > end;
    }
    /* A vertex has a whole number, which the library looks up. */
    const bool whole =
        !l.vertex || (fabs(l.number[0]) <= 1e15 && floor(l.number[0]) == l.number[0]);
    if (*text != '\0' || comma || !whole) l.n = -1;
    return l;
}

static int grow(void **list, size_t n, size_t size)
{
    if ((n & (n - 1)) != 0) return EXIT_OK; /* the room is a power of two */
    void *more = realloc(*list, (n ? 2 * n : 1) * size);
    if (!more) return cli_library_error(NULL, DMK_E_NOMEM);
    *list = more;
    return EXIT_OK;
}

static int add_value(cli_measure *m, int64_t number, double value)
{
    int code = grow((void **)&m->value, m->n_values, sizeof *m->value);
    if (code == EXIT_OK) code = grow((void **)&m->line, m->n_values, sizeof *m->line);
    if (code != EXIT_OK) return code;
    m->line[m->n_values] = number;
    m->value[m->n_values++] = value;
    return EXIT_OK;
}

typedef struct reading {
    const cli_ground *ground;
    const char *path;
    cli_measure *measure;
} reading;

/* The library's failure on a line. */
static int fail_line(const reading *r, int64_t number, int rc)
{
    return cli_error(cli_exit_code(rc), "%s:%lld: %s", r->path, (long long)number,
                     dmk_context_message(r->ground->context));
}

static int add_atom(const reading *r, int64_t number, const line *l)
{
    dmk_context *context = r->ground->context;
    const dmk_mesh *mesh = r->ground->mesh;
    cli_measure *m = r->measure;
    dmk_point p;
    const int masses = l->vertex ? 1 : 3; /* that many numbers stand before the mass */
    int code = grow((void **)&m->atom, m->n_atoms, sizeof *m->atom);
    if (code == EXIT_OK) code = grow((void **)&m->mass, m->n_atoms, sizeof *m->mass);
    if (code == EXIT_OK) code = grow((void **)&m->line, m->n_atoms, sizeof *m->line);
    if (code != EXIT_OK) return code;
    int rc = DMK_OK;
    if (l->vertex)
        rc = dmk_repairs_vertex_point(context, mesh, r->ground->did, (int64_t)l->number[0], &p);
    else if (!isfinite(l->number[0]) || !isfinite(l->number[1]) || !isfinite(l->number[2]))
        rc = dmk_mesh_project(context, mesh, l->number, &p);
    else /* found with the others of its kind: see find_places */
        p = (dmk_point){-1, {l->number[0], l->number[1], l->number[2]}};
    if (rc != DMK_OK) return fail_line(r, number, rc);
    m->line[m->n_atoms] = number;
    m->atom[m->n_atoms] = p;
    m->mass[m->n_atoms++] = l->n > masses ? l->number[masses] : 0;
    m->is_free = l->n == masses;
    return EXIT_OK;
}

/* Whether a measure may have this mass or density. */
static bool is_mass(const cli_measure *m, double value)
{
    return isfinite(value) && (value >= 0 || m->is_signed);
}

static const char a_mass[] =
    "expected a finite number from 0; without --to, one measure may be signed";

static int take_line(char *text, int64_t number, void *data)
{
    const reading *r = data;
    cli_measure *m = r->measure;
    text[strcspn(text, "#")] = '\0';
    const line l = read_line(text + strspn(text, " \t"));
    if (l.n == 0 && !l.vertex) return EXIT_OK;
    const bool alone = !l.vertex && l.n == 1 && m->n_atoms == 0;
    const bool has_mass = l.n == (l.vertex ? 2 : 4),
               is_place = has_mass || l.n == (l.vertex ? 1 : 3);
    if ((alone || has_mass) && !is_mass(m, l.number[l.n - 1])) {
        return cli_error(EXIT_USAGE, "%s:%lld: the mass %g; %s", r->path, (long long)number,
                         l.number[l.n - 1], a_mass);
    }
    if (alone) return add_value(m, number, l.number[0]);
    if (is_place && m->n_values == 0 && (m->n_atoms == 0 || m->is_free != has_mass)) {
        return add_atom(r, number, &l);
    }
    return cli_error(
        cli_exit_code(DMK_E_FORMAT), "%s:%lld: expected %s", r->path, (long long)number,
        m->n_values > 0 ? "one number, as on the lines before"
                        : "one number, `vertex I MASS` or `X,Y,Z MASS`, all with a mass or none");
}

/* Of n points and their nearest ones on the surface the first that is far from it, and how many are. */
static void warn_away(const cli_ground *g, const char *path, size_t n, const double *xyz,
                      const dmk_point *point)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(g->mesh, &info);
    size_t far = 0;
    for (size_t i = 0; i < n && !g->quiet; i++) {
        if (!(cli_offset(g->context, g->mesh, xyz + 3 * i, &point[i]) > info.mean_edge)) continue;
        if (far++ == 0) cli_warn_away(g->context, g->mesh, xyz + 3 * i, &point[i]);
    }
    if (far > 1)
        fprintf(stderr, "dmkcl: warning: so are those of %zu more points of %s\n", far - 1, path);
}

/* That places were not found: the first one that is not found alone either has its line. */
static int fail_places(const reading *r, int rc)
{
    const cli_measure *m = r->measure;
    dmk_context *context = r->ground->context;
    dmk_point p;
    for (size_t i = 0; rc == DMK_E_ARG && i < m->n_atoms; i++) {
        if (m->atom[i].triangle < 0 &&
            dmk_mesh_project(context, r->ground->mesh, m->atom[i].weight, &p) != DMK_OK)
            return fail_line(r, m->line[i], rc);
    }
    return cli_library_error(context, rc);
}

/* The points of the surface of all lines that have coordinates, which stand where a point has its weights. */
static int find_places(const reading *r)
{
    cli_measure *m = r->measure;
    size_t n = 0;
    double *xyz = calloc(m->n_atoms + 1, 3 * sizeof *xyz);
    dmk_point *point = calloc(m->n_atoms + 1, sizeof *point);
    int rc = xyz && point ? DMK_OK : DMK_E_NOMEM;
    for (size_t i = 0; rc == DMK_OK && i < m->n_atoms; i++) {
        if (m->atom[i].triangle < 0) memcpy(xyz + 3 * n++, m->atom[i].weight, 3 * sizeof *xyz);
    }
    if (rc == DMK_OK) rc = dmk_mesh_project_all(r->ground->context, r->ground->mesh, n, xyz, point);
    if (rc == DMK_OK) warn_away(r->ground, r->path, n, xyz, point);
    for (size_t i = m->n_atoms; rc == DMK_OK && i-- > 0;) {
        if (m->atom[i].triangle < 0) m->atom[i] = point[--n];
    }
    const bool room = xyz && point;
    free(xyz);
    free(point);
    if (!room) return cli_library_error(NULL, DMK_E_NOMEM);
    return rc == DMK_OK ? EXIT_OK : fail_places(r, rc);
}

/* What numbers are of: a column of a text does not say it, and is of the vertices if there are as many triangles. */
typedef enum owner { ANY, VERTICES, TRIANGLES } owner;

static const char *const owners[] = {"numbers", "numbers of points", "numbers of faces"};

/* How many vertices, or triangles, the mesh has in its file. */
static size_t count_in_file(const cli_ground *g, bool of_vertices)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(g->mesh, &info);
    if (!g->did->vertex_new) return of_vertices ? info.n_vertices : info.n_triangles;
    return of_vertices
               ? g->did->n_old_vertices
               : g->did->n_triangles + g->did->degenerate_triangles + g->did->duplicate_triangles;
}

/* Of vertices that a repair makes one the masses add up; what has one has to stay. */
static int add_up(const reading *r, double *now, int64_t *old)
{
    const dmk_repairs *did = r->ground->did;
    const cli_measure *m = r->measure;
    for (size_t v = 0; v < m->n_values; v++) {
        const int32_t new = did->vertex_new[v];
        if (m->value[v] == 0) continue;
        if (new < 0) {
            char at[CLI_TEXT_SIZE] = "";
            if (m->line) snprintf(at, sizeof at, ":%lld", (long long)m->line[v]);
            return cli_error(EXIT_USAGE, "%s%s: vertex %zu has mass, but is in no triangle",
                             r->path, at, v);
        }
        if (now[new] == 0) old[new] = (int64_t)v;
        now[new] += m->value[v];
    }
    return EXIT_OK;
}

/* From the file's numbers to those of the mesh that a repair made of it. */
static int repair_values(const reading *r, bool of_vertices)
{
    const dmk_repairs *did = r->ground->did;
    cli_measure *m = r->measure;
    const size_t n = of_vertices ? did->n_vertices : did->n_triangles;
    double *now = calloc(n + 1, sizeof *now);
    m->old = calloc(n + 1, sizeof *m->old);
    int code = now && m->old ? EXIT_OK : cli_library_error(NULL, DMK_E_NOMEM);
    for (size_t t = 0; !of_vertices && t < n && code == EXIT_OK; t++) {
        m->old[t] = did->triangle_old[t];
        now[t] = m->value[m->old[t]];
    }
    if (of_vertices && code == EXIT_OK) code = add_up(r, now, m->old);
    if (code != EXIT_OK) {
        free(now);
        return code;
    }
    free(m->value);
    m->value = now;
    m->n_values = n;
    return EXIT_OK;
}

static int settle(const reading *r, owner of)
{
    cli_measure *m = r->measure;
    const size_t n_vertices = count_in_file(r->ground, true);
    const size_t n_triangles = count_in_file(r->ground, false);
    m->measure.n_atoms = m->n_atoms;
    m->measure.atoms = m->atom;
    m->measure.atom_mass = m->is_free ? NULL : m->mass;
    if (m->n_atoms > 0) return EXIT_OK;
    const bool of_vertices = of != TRIANGLES && m->n_values == n_vertices;
    if (!of_vertices && (of == VERTICES || m->n_values != n_triangles)) {
        return cli_error(cli_exit_code(DMK_E_FORMAT),
                         "%s has %zu %s; expected one for each of %zu vertices (masses) or of "
                         "%zu triangles (densities)",
                         r->path, m->n_values, owners[of], n_vertices, n_triangles);
    }
    const int code = r->ground->did->vertex_new ? repair_values(r, of_vertices) : EXIT_OK;
    if (of_vertices)
        m->measure.vertex_mass = m->value;
    else
        m->measure.triangle_density = m->value;
    return code;
}

/* Whether the name of n bytes is that of a file with arrays. */
static bool has_arrays(const char *path, size_t n)
{
    return n > 4 &&
           (strncasecmp(path + n - 4, ".vtp", 4) == 0 || strncasecmp(path + n - 4, ".vtu", 4) == 0);
}

/* The colon before the array's name, which may have some, too: the first one behind a file that is there, or if none
 * is, behind the name of one. */
static const char *find_colon(const char *path)
{
    const char *found = NULL;
    for (const char *colon = strchr(path, ':'); colon; colon = strchr(colon + 1, ':')) {
        if (!has_arrays(path, (size_t)(colon - path))) continue;
        char *file = strndup(path, (size_t)(colon - path));
        const bool there = file && cli_is_file(file);
        free(file);
        if (there) return colon;
        if (!found) found = colon;
    }
    return found;
}

/* FILE.vtp:NAME, if it is of that form: the array of that name. */
static bool read_array(const reading *r, int *code)
{
    cli_measure *m = r->measure;
    const char *path = r->path, *colon = find_colon(path);
    if (!colon && has_arrays(path, strlen(path))) {
        *code = cli_error(EXIT_USAGE, "%s: name the array in it that is the measure: %s:NAME", path,
                          path);
        return true;
    }
    if (!colon) return false;
    const size_t n_vertices = count_in_file(r->ground, true);
    const size_t n_triangles = count_in_file(r->ground, false);
    const size_t room = n_vertices > n_triangles ? n_vertices : n_triangles;
    char *file = strndup(path, (size_t)(colon - path));
    m->value = calloc(room, sizeof *m->value);
    if (file && m->value) {
        int of_points;
        const int rc = dmk_array_read(r->ground->context, file, colon + 1, room, m->value,
                                      &m->n_values, &of_points);
        *code = rc == DMK_OK ? EXIT_OK : cli_library_error(r->ground->context, rc);
        for (size_t i = 0; *code == EXIT_OK && i < m->n_values; i++) {
            if (is_mass(m, m->value[i])) continue;
            *code = cli_error(EXIT_USAGE, "%s: number %zu is %g; %s", path, i, m->value[i], a_mass);
        }
        if (*code == EXIT_OK) *code = settle(r, of_points ? VERTICES : TRIANGLES);
    } else {
        *code = cli_library_error(NULL, DMK_E_NOMEM);
    }
    free(file);
    return true;
}

int cli_measure_read(const cli_ground *ground, const char *path, bool is_signed, cli_measure *m)
{
    reading r = {ground, path, m};
    *m = (cli_measure){.is_signed = is_signed};
    if (strcmp(path, "uniform") == 0) {
        dmk_mesh_info info;
        dmk_mesh_get_info(ground->mesh, &info);
        m->measure.uniform = info.area;
        return EXIT_OK;
    }
    int code = EXIT_OK;
    if (read_array(&r, &code)) return code;
    code = cli_read_lines(path, take_line, &r);
    if (code == EXIT_OK) code = find_places(&r);
    return code == EXIT_OK ? settle(&r, ANY) : code;
}

void cli_measure_free(cli_measure *m)
{
    free(m->value);
    free(m->atom);
    free(m->mass);
    free(m->line);
    free(m->old);
    *m = (cli_measure){.n_atoms = 0};
}

int64_t cli_measure_line(const cli_measure *m, const char *kind, int64_t *number)
{
    const size_t n = m->n_atoms > 0 ? m->n_atoms : m->n_values;
    if ((strcmp(kind, "atom") == 0) != (m->n_atoms > 0) || *number < 0 || (size_t)*number >= n)
        return 0;
    if (m->old) *number = m->old[*number];
    return m->line ? m->line[*number] : 0;
}
