/* Writing a file as a whole: see dmk_output in io.h. */
#include "io/io.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define BUFFER 65536
#define AT_ONCE ((size_t)16 << 20) /* bytes of a write: a disk takes some 50 ms */

struct dmk_output {
    dmk_context *context;
    char *path;
    dmk_outfile file;
    int error; /* errno of the first failing write, or 0 */
    int rc;    /* DMK_E_CANCELLED once the caller wants no more */
    dmk_numbers numbers;
    size_t fill;
    char buffer[BUFFER];
};

static void output_free(dmk_output *s)
{
    dmk_numbers_free(&s->numbers);
    free(s->path);
    free(s);
}

int dmk_output_open(dmk_context *ctx, const char *path, dmk_output **out)
{
    int rc;
    dmk_output *s = NULL;
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->context = ctx;
    DMK_TRY(dmk_alloc(ctx, "file name", strlen(path) + 1, 1, (void **)&s->path));
    memcpy(s->path, path, strlen(path) + 1);
    DMK_TRY(dmk_numbers_create(ctx, &s->numbers));
    int error = dmk_outfile_open(path, &s->file);
    while (error ==
           EINTR) { /* while it waited for the reader of a pipe: the caller may want to stop */
        DMK_TRY(dmk_report(ctx, &(dmk_progress){.stage = "write", .change = NAN, .gap = NAN}));
        error = dmk_outfile_open(path, &s->file);
    }
    if (error == DMK_OUTFILE_NOT_REGULAR) {
        rc = dmk_fail(ctx, DMK_E_IO,
                      "%s: exists and is neither a regular file nor a pipe or character device; "
                      "choose another name",
                      path);
    } else if (error != 0) {
        rc = dmk_fail(ctx, error == ENOMEM ? DMK_E_NOMEM : DMK_E_IO, "%s: cannot create: %s", path,
                      strerror(error));
    }
    if (rc != DMK_OK) goto done;
    *out = s;
    s = NULL;
done:
    if (s) output_free(s);
    return rc;
}

const char *dmk_output_path(const dmk_output *s)
{
    return s->path;
}

void dmk_output_fail(dmk_output *s, int error)
{
    if (!s->error) s->error = error;
}

static void write_out(dmk_output *s, const char *bytes, size_t n)
{
    while (n > 0 && !s->error && s->rc == DMK_OK) {
        s->rc = dmk_poll(s->context);
        if (s->rc != DMK_OK) return;
        ssize_t w = write(s->file.fd, bytes, n < AT_ONCE ? n : AT_ONCE);
        if (w < 0 && errno == EINTR) continue;
        if (w < 0) {
            s->error = errno;
            return;
        }
        bytes += w;
        n -= (size_t)w;
    }
}

void dmk_output_put(dmk_output *s, const void *bytes, size_t n)
{
    if (n > BUFFER - s->fill) {
        write_out(s, s->buffer, s->fill);
        s->fill = 0;
    }
    if (n > BUFFER) {
        write_out(s, bytes, n);
    } else if (n > 0) {
        memcpy(s->buffer + s->fill, bytes, n);
        s->fill += n;
    }
}

void dmk_output_text(dmk_output *s, const char *text)
{
    dmk_output_put(s, text, strlen(text));
}

void dmk_output_number(dmk_output *s, double value)
{
    char text[DMK_NUMBER_TEXT];
    if (s->rc != DMK_OK) return;
    int n = dmk_number_print(&s->numbers, value, text);
    dmk_output_put(s, text, (size_t)n);
}

void dmk_output_integer(dmk_output *s, int64_t value)
{
    char text[DMK_NUMBER_TEXT];
    int n = snprintf(text, sizeof text, "%lld", (long long)value);
    dmk_output_put(s, text, (size_t)n);
}

static int cannot_write(const dmk_output *s, const char *left)
{
    return dmk_fail(s->context, DMK_E_IO, "%s: cannot write: %s%s", s->path, strerror(s->error),
                    left);
}

int dmk_output_sync(dmk_output *s)
{
    write_out(s, s->buffer, s->fill);
    s->fill = 0;
    if (s->rc != DMK_OK) return s->rc;
    if (!s->error) s->error = dmk_outfile_sync(&s->file);
    return s->error ? cannot_write(s, "; nothing was written to it") : DMK_OK;
}

int dmk_output_detach(dmk_output **out, int rc, dmk_outfile *file)
{
    dmk_output *s = *out;
    if (!s) return rc;
    *out = NULL;
    if (rc == DMK_OK) rc = dmk_output_sync(s);
    *file = s->file;
    if (rc != DMK_OK) dmk_outfile_discard(file);
    output_free(s);
    return rc;
}

int dmk_output_close(dmk_output **out, int rc)
{
    dmk_output *s = *out;
    if (!s) return rc;
    *out = NULL;
    if (rc == DMK_OK) write_out(s, s->buffer, s->fill);
    if (rc == DMK_OK) rc = s->rc;
    const char *left = s->file.stream ? "" : "; nothing was written to it";
    if (rc != DMK_OK || s->error)
        dmk_outfile_discard(&s->file);
    else
        s->error = dmk_outfile_commit(&s->file);
    if (s->error) rc = cannot_write(s, left);
    output_free(s);
    return rc;
}
