#include "io/values.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static const uint8_t type_bytes[] = {
    [DMK_INT8] = 1,   [DMK_UINT8] = 1, [DMK_INT16] = 2,  [DMK_UINT16] = 2,  [DMK_INT32] = 4,
    [DMK_UINT32] = 4, [DMK_INT64] = 8, [DMK_UINT64] = 8, [DMK_FLOAT32] = 4, [DMK_FLOAT64] = 8};

size_t dmk_type_bytes(dmk_type type)
{
    return type_bytes[type];
}

bool dmk_type_is_float(dmk_type type)
{
    return type == DMK_FLOAT32 || type == DMK_FLOAT64;
}

bool dmk_is_little_endian(void)
{
    static const int one = 1;
    return *(const char *)&one == 1;
}

typedef union number {
    int8_t i1;
    uint8_t u1;
    int16_t i2;
    uint16_t u2;
    int32_t i4;
    uint32_t u4;
    int64_t i8;
    uint64_t u8;
    float f4;
    double f8;
    char byte[8];
} number;

static number load(dmk_type type, const char *p, bool swap)
{
    number v = {0};
    const size_t n = type_bytes[type];
    for (size_t i = 0; i < n; i++) v.byte[swap ? n - 1 - i : i] = p[i];
    return v;
}

double dmk_decode_number(dmk_type type, const char *p, bool swap)
{
    const number v = load(type, p, swap);
    if (type == DMK_FLOAT64) return v.f8;
    if (type == DMK_FLOAT32) return (double)v.f4;
    if (type == DMK_UINT64) return (double)v.u8;
    return (double)dmk_decode_integer(type, p, swap);
}

int64_t dmk_decode_integer(dmk_type type, const char *p, bool swap)
{
    const number v = load(type, p, swap);
    double x;
    switch (type) {
    case DMK_INT8: return v.i1;
    case DMK_UINT8: return v.u1;
    case DMK_INT16: return v.i2;
    case DMK_UINT16: return v.u2;
    case DMK_INT32: return v.i4;
    case DMK_UINT32: return v.u4;
    case DMK_INT64: return v.i8;
    case DMK_UINT64: return v.u8 > INT64_MAX ? -1 : (int64_t)v.u8;
    default: x = dmk_decode_number(type, p, swap); return x > -9e18 && x < 9e18 ? (int64_t)x : -1;
    }
}

/* ---- a position in a file ---- */

int dmk_values_fail(const dmk_values *values, const char *format, ...)
{
    const dmk_text *t = &values->text;
    char what[512];
    va_list args;
    va_start(args, format);
    dmk_print_text(what, sizeof what, format, args);
    va_end(args);
    if (!values->binary) return dmk_text_fail(t, "%s", what);
    return dmk_fail(t->context, DMK_E_FORMAT, "%s: byte %td: %s", t->file->path,
                    t->at - t->file->data, what);
}

/* The next n binary values of the type, or NULL with the error recorded. */
static const char *take(dmk_values *values, dmk_type type, size_t n, const char *what)
{
    dmk_text *t = &values->text;
    const char *p = t->at;
    if (n > (size_t)(t->end - p) / type_bytes[type]) {
        dmk_values_fail(values, "the file ends before %s; it is cut short or its counts are wrong",
                        what);
        return NULL;
    }
    t->at += n * type_bytes[type];
    return p;
}

int dmk_values_number(dmk_values *values, dmk_type type, const char *what, double *value)
{
    if (!values->binary) {
        dmk_text_seek(&values->text);
        const int rc = dmk_text_number(&values->text, what, value);
        if (type == DMK_FLOAT32) *value = (double)(float)*value;
        return rc;
    }
    const char *p = take(values, type, 1, what);
    if (!p) return DMK_E_FORMAT;
    *value = dmk_decode_number(type, p, values->swap);
    return DMK_OK;
}

int dmk_values_integer(dmk_values *values, dmk_type type, const char *what, int64_t *value)
{
    if (!values->binary) {
        dmk_text_seek(&values->text);
        return dmk_text_integer(&values->text, what, value);
    }
    const char *p = take(values, type, 1, what);
    if (!p) return DMK_E_FORMAT;
    *value = dmk_decode_integer(type, p, values->swap);
    return DMK_OK;
}

int dmk_values_index(dmk_values *values, dmk_type type, const char *what, size_t limit,
                     int64_t *value)
{
    const int rc = dmk_values_integer(values, type, what, value);
    if (rc != DMK_OK || (*value >= 0 && (uint64_t)*value < limit)) return rc;
    return dmk_values_fail(values, "%s is %lld, out of range: there are %zu, counted from 0", what,
                           (long long)*value, limit);
}

int dmk_values_skip(dmk_values *values, dmk_type type, size_t n)
{
    dmk_text *t = &values->text;
    if (values->binary) return take(values, type, n, "its data") ? DMK_OK : DMK_E_FORMAT;
    for (size_t i = 0; i < n; i++) {
        if (!dmk_text_seek(t)) return dmk_values_fail(values, "the file ends before its data");
        const size_t word = dmk_text_word(t);
        t->at += word ? word : 1;
    }
    return DMK_OK;
}

int dmk_values_room(const dmk_values *values, const char *what, int64_t count, size_t numbers,
                    dmk_type type)
{
    /* A number of a text takes a blank and a digit. */
    const size_t least = numbers * (values->binary ? type_bytes[type] : 2);
    const size_t left = (size_t)(values->text.end - values->text.at);
    if (count >= 0 && (uint64_t)count <= left / least) return DMK_OK;
    return dmk_values_fail(values,
                           "%lld %s do not fit into the %zu bytes that follow; the file is "
                           "cut short or its counts are wrong",
                           (long long)count, what, left);
}
