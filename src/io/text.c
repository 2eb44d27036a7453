/* Scanning of text files, and their errors. */
#include "io/io.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

/* What some editors write before a text in UTF-8. */
static const char mark[] = "\xef\xbb\xbf";

dmk_text dmk_text_of(const dmk_file *file)
{
    dmk_text t = {.file = file, .at = file->data, .end = file->data + file->size};
    if (file->size >= strlen(mark) && memcmp(t.at, mark, strlen(mark)) == 0) t.at += strlen(mark);
    return t;
}

/* Data has bytes below these: the number of a triangle's corners is one. */
void dmk_file_end_lines(dmk_file *file)
{
    if (memchr(file->data, '\n', file->size)) return;
    for (size_t i = 0; i < file->size; i++)
        if ((unsigned char)file->data[i] < '\t') return;
    for (size_t i = 0; i < file->size; i++)
        if (file->data[i] == '\r') file->data[i] = '\n';
}

int dmk_text_open(dmk_context *ctx, const dmk_file *file, dmk_text *text)
{
    *text = dmk_text_of(file);
    text->context = ctx;
    return dmk_numbers_create(ctx, &text->numbers);
}

void dmk_text_close(dmk_text *text)
{
    dmk_numbers_free(&text->numbers);
}

int dmk_text_fail(const dmk_text *text, const char *format, ...)
{
    char what[512];
    va_list args;
    va_start(args, format);
    dmk_print_text(what, sizeof what, format, args);
    va_end(args);
    size_t line = 1; /* counted only here, so that scanning need not */
    for (const char *p = text->file->data; p < text->at; p++) line += *p == '\n';
    return dmk_fail(text->context, DMK_E_FORMAT, "%s:%zu: %s", text->file->path, line, what);
}

int dmk_text_fail_word(const dmk_text *text, const char *format, ...)
{
    enum { LONGEST = 40 };
    char what[512], word[LONGEST];
    const size_t length = dmk_text_word(text), n = length < LONGEST ? length : LONGEST;
    for (size_t i = 0; i < n; i++) /* of a binary file nothing goes to a terminal */
        word[i] = text->at[i] > ' ' && text->at[i] < 127 ? text->at[i] : '?';
    va_list args;
    va_start(args, format);
    dmk_print_text(what, sizeof what, format, args);
    va_end(args);
    return dmk_text_fail(text, "'%.*s' %s", (int)n, word, what);
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f';
}

bool dmk_text_more(dmk_text *text)
{
    const char *p = text->at, *end = text->end;
    while (p < end && is_blank(*p)) p++;
    if (p < end && *p == '#') {
        const char *line_end = memchr(p, '\n', (size_t)(end - p));
        p = line_end ? line_end : end;
    }
    text->at = p;
    return p < end && *p != '\n';
}

bool dmk_text_seek(dmk_text *text)
{
    while (!dmk_text_more(text)) {
        if (text->at >= text->end) return false;
        text->at++;
    }
    return true;
}

void dmk_text_skip_line(dmk_text *text)
{
    const char *line_end = memchr(text->at, '\n', (size_t)(text->end - text->at));
    text->at = line_end ? line_end + 1 : text->end;
}

bool dmk_text_ends(const dmk_text *text, const char *p)
{
    return p >= text->end || is_blank(*p) || *p == '\n' || *p == '#' || *p == '\\';
}

size_t dmk_text_word(const dmk_text *text)
{
    const char *p = text->at;
    while (!dmk_text_ends(text, p)) p++;
    return (size_t)(p - text->at);
}

bool dmk_text_is(const dmk_text *text, const char *word)
{
    const size_t n = strlen(word);
    return dmk_text_word(text) == n && memcmp(text->at, word, n) == 0;
}

bool dmk_text_is_in_any_case(const dmk_text *text, const char *word)
{
    const size_t n = strlen(word);
    return dmk_text_word(text) == n && strncasecmp(text->at, word, n) == 0;
}

bool dmk_text_take(dmk_text *text, const char *word)
{
    if (!dmk_text_is(text, word)) return false;
    text->at += strlen(word);
    return true;
}

/* Fail with what is at text->at instead of the number. */
static int fail_word(const dmk_text *text, const char *what, const char *wanted)
{
    if (text->at >= text->end) {
        return dmk_text_fail(text,
                             "the file ends before %s; it is cut short or its counts are "
                             "wrong",
                             what);
    }
    if (dmk_text_word(text) == 0) return dmk_text_fail(text, "%s is missing", what);
    return dmk_text_fail_word(text, "where %s is expected: write %s", what, wanted);
}

bool dmk_text_take_number(dmk_text *text, double *value)
{
    const char *p = text->at;
    if (!dmk_number_read(&text->numbers, &p, text->end, value) || !dmk_text_ends(text, p))
        return false;
    text->at = p;
    return true;
}

bool dmk_text_take_integer(dmk_text *text, int64_t *value)
{
    const char *p = text->at;
    if (!dmk_integer_read(&p, text->end, value) || !dmk_text_ends(text, p)) return false;
    text->at = p;
    return true;
}

int dmk_text_number(dmk_text *text, const char *what, double *value)
{
    if (dmk_text_take_number(text, value)) return DMK_OK;
    return fail_word(text, what, "a finite decimal number");
}

int dmk_text_integer(dmk_text *text, const char *what, int64_t *value)
{
    return dmk_text_take_integer(text, value) ? DMK_OK : fail_word(text, what, "an integer");
}
