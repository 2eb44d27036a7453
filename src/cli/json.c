/* JSON, written value by value. */
#include "cli.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>

/* File names are bytes; JSON is UTF-8: a byte that is not becomes U+DC80 .. U+DCFF, from which Python's
 * os.fsencode and the like give it back. */
static void quote(FILE *file, const char *text)
{
    fputc('"', file);
    for (; *text; text++) {
        const unsigned char c = (unsigned char)*text;
        const int n = dmk_utf8_length(text);
        if (n == 0) {
            fprintf(file, "\\udc%02x", c);
        } else if (n > 1) {
            fwrite(text, 1, (size_t)n, file);
            text += n - 1;
        } else if (c == '"' || c == '\\') {
            fprintf(file, "\\%c", c);
        } else if (c < 0x20) {
            fprintf(file, "\\u%04x", c);
        } else {
            fputc(c, file);
        }
    }
    fputc('"', file);
}

/* What stands before a value: the comma after the one before, a new line, the key. */
static void begin(cli_json *json, const char *key)
{
    if (json->depth > 0) {
        fputs(json->empty ? "" : json->one_line ? ", " : ",", json->file);
        if (!json->one_line) fprintf(json->file, "\n%*s", 2 * json->depth, "");
    }
    json->empty = false;
    if (key) {
        quote(json->file, key);
        fputs(": ", json->file);
    }
}

void json_open(cli_json *json, const char *key, char bracket)
{
    begin(json, key);
    fputc(bracket, json->file);
    json->depth++;
    json->empty = true;
}

void json_close(cli_json *json, char bracket)
{
    json->depth--;
    if (!json->empty && !json->one_line) fprintf(json->file, "\n%*s", 2 * json->depth, "");
    fputc(bracket == '{' ? '}' : ']', json->file);
    if (json->depth == 0) fputc('\n', json->file);
    json->empty = false;
}

void json_text(cli_json *json, const char *key, const char *value)
{
    begin(json, key);
    quote(json->file, value);
}

void json_integer(cli_json *json, const char *key, int64_t value)
{
    begin(json, key);
    fprintf(json->file, "%" PRId64, value);
}

/* The shortest of the forms that give the same bits back. */
static void print_number(FILE *file, double value)
{
    char text[40];
    if (!isfinite(value)) {
        fputs("null", file);
        return;
    }
    for (int digits = 15; digits <= 17; digits++) {
        snprintf(text, sizeof text, "%.*g", digits, value);
        if (strtod(text, NULL) == value) break;
    }
    fputs(text, file);
}

void json_number(cli_json *json, const char *key, double value)
{
    begin(json, key);
    print_number(json->file, value);
}

void json_bool(cli_json *json, const char *key, bool value)
{
    begin(json, key);
    fputs(value ? "true" : "false", json->file);
}

void json_numbers(cli_json *json, const char *key, const double *values, size_t n)
{
    begin(json, key);
    fputc('[', json->file);
    for (size_t i = 0; i < n; i++) {
        if (i > 0) fputs(", ", json->file);
        print_number(json->file, values[i]);
    }
    fputc(']', json->file);
}

void json_mesh(cli_json *json, const dmk_mesh_info *info)
{
    json_integer(json, "n_vertices", (int64_t)info->n_vertices);
    json_integer(json, "n_triangles", (int64_t)info->n_triangles);
    json_integer(json, "n_edges", (int64_t)info->n_edges);
    json_integer(json, "n_unused_vertices", (int64_t)info->n_unused_vertices);
    json_integer(json, "n_border_edges", (int64_t)info->n_border_edges);
    json_integer(json, "n_border_loops", (int64_t)info->n_border_loops);
    json_integer(json, "n_components", (int64_t)info->n_components);
    json_integer(json, "euler", info->euler);
    json_number(json, "area", info->area);
    json_number(json, "mean_edge", info->mean_edge);
    json_number(json, "min_edge", info->min_edge);
    json_number(json, "max_edge", info->max_edge);
    json_number(json, "min_angle", info->min_angle);
    json_number(json, "max_angle", info->max_angle);
    json_numbers(json, "box_min", info->box_min, 3);
    json_numbers(json, "box_max", info->box_max, 3);
}

void json_memory(cli_json *json, const dmk_mesh *mesh, bool single)
{
    dmk_memory memory;
    dmk_mesh_memory(mesh, single, &memory);
    json_open(json, "memory", '{');
    json_integer(json, "host", (int64_t)memory.host);
    json_integer(json, "device", (int64_t)memory.device);
    json_close(json, '{');
}
