/* Writing a file as a whole: see dmk_output in io.h. */
#include "io/io.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define BUFFER 65536

struct dmk_output {
    dmk_context *context;
    char *path;      /* where it ends up; links followed */
    char *temporary; /* where it is written, in the same folder */
    int fd;
    int error; /* errno of the first failing write, or 0 */
    dmk_numbers numbers;
    size_t fill;
    char buffer[BUFFER];
};

static void sink_free(dmk_output *s)
{
    if (s->fd >= 0) close(s->fd);
    dmk_numbers_free(&s->numbers);
    free(s->path);
    free(s->temporary);
    free(s);
}

/* Follow links to an existing file, so that renaming replaces the file and not a link to it, and
 * refuse what is not a file. *mode becomes that of the file there. */
static int resolve(dmk_context *ctx, const char *path, char **resolved, mode_t *mode)
{
    struct stat st;
    *mode = 0;
    if (stat(path, &st) != 0) {
        *resolved = strdup(path);
    } else if (!S_ISREG(st.st_mode)) {
        return dmk_fail(ctx, DMK_E_IO, "%s: is not a regular file; choose another name", path);
    } else {
        *mode = st.st_mode & 0777;
        *resolved = realpath(path, NULL);
    }
    return *resolved ? DMK_OK : dmk_fail(ctx, DMK_E_NOMEM, "%s: out of memory", path);
}

/* A name that nobody has: the process number makes clashes rare, O_EXCL makes them harmless. */
static int open_temporary(dmk_output *s, const char *path)
{
    size_t room = strlen(s->path) + 48;
    int rc = dmk_alloc(s->context, "file name", room, 1, (void **)&s->temporary);
    if (rc != DMK_OK) return rc;
    for (int i = 0; i < 100; i++) {
        snprintf(s->temporary, room, "%s.%ld-%d.tmp", s->path, (long)getpid(), i);
        s->fd = open(s->temporary, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (s->fd >= 0) return DMK_OK;
        if (errno != EEXIST) break;
    }
    return dmk_fail(s->context, DMK_E_IO, "%s: cannot create: %s", path, strerror(errno));
}

int dmk_output_open(dmk_context *ctx, const char *path, dmk_output **out)
{
    int rc;
    mode_t mode;
    dmk_output *s = NULL;
    DMK_TRY(DMK_NEW(ctx, s, 1));
    s->context = ctx;
    s->fd = -1;
    DMK_TRY(dmk_numbers_create(ctx, &s->numbers));
    DMK_TRY(resolve(ctx, path, &s->path, &mode));
    DMK_TRY(open_temporary(s, path));
    if (mode) (void)!fchmod(s->fd, mode); /* as it was, if we may */
    *out = s;
    s = NULL;
done:
    if (s) sink_free(s);
    return rc;
}

static void write_out(dmk_output *s, const char *bytes, size_t n)
{
    while (n > 0 && !s->error) {
        ssize_t w = write(s->fd, bytes, n);
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
    int n = dmk_number_print(&s->numbers, value, text);
    dmk_output_put(s, text, (size_t)n);
}

void dmk_output_integer(dmk_output *s, int64_t value)
{
    char text[DMK_NUMBER_TEXT];
    int n = snprintf(text, sizeof text, "%lld", (long long)value);
    dmk_output_put(s, text, (size_t)n);
}

int dmk_output_close(dmk_output **out, int rc)
{
    dmk_output *s = *out;
    if (!s) return rc;
    *out = NULL;
    if (rc == DMK_OK) {
        write_out(s, s->buffer, s->fill);
        if (!s->error && fsync(s->fd) != 0 && errno != EINVAL && errno != ENOTSUP) s->error = errno;
        int fd = s->fd;
        s->fd = -1;
        if (close(fd) != 0 && !s->error) s->error = errno;
        if (!s->error && rename(s->temporary, s->path) != 0) s->error = errno;
        if (s->error) {
            rc = dmk_fail(s->context, DMK_E_IO, "%s: cannot write: %s; nothing was written",
                          s->path, strerror(s->error));
        }
    }
    if (rc != DMK_OK) unlink(s->temporary);
    sink_free(s);
    return rc;
}
