/* Reading a whole file into memory, unpacked. */
#include "io/io.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static int fail_errno(dmk_context *ctx, const char *path, const char *what)
{
    int code = errno == ENOMEM ? DMK_E_NOMEM : DMK_E_IO;
    return dmk_fail(ctx, code, "%s: %s: %s", path, what, strerror(errno));
}

/* A signal came while the system waited, for instance for the writer of a pipe: the caller may want to
 * stop. */
static int ask_to_go_on(dmk_context *ctx)
{
    return dmk_report(ctx, &(dmk_progress){.stage = "read", .change = NAN, .gap = NAN});
}

/* The standard input is taken as it is: a socket cannot be opened again, nor a file that this user may not open, and
 * what was read of a file before stays read. */
static int open_file(dmk_context *ctx, const char *path, int *fd)
{
    const bool given = strcmp(path, "/dev/stdin") == 0;
    while ((*fd = given ? fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                        : open(path, O_RDONLY | O_CLOEXEC)) < 0) {
        if (errno != EINTR) return fail_errno(ctx, path, "cannot open");
        int rc = ask_to_go_on(ctx);
        if (rc != DMK_OK) return rc;
    }
    return DMK_OK;
}

/* Half of the machine's memory: what is longer, as a pipe without an end, would fill it before it is refused. */
static size_t most_bytes(void)
{
    const long pages = sysconf(_SC_PHYS_PAGES), page = sysconf(_SC_PAGESIZE);
    return pages > 0 && page > 0 ? (size_t)pages / 2 * (size_t)page : SIZE_MAX / 4;
}

/* Bytes of a read: from the disk some 50 ms. */
#define AT_ONCE ((size_t)64 << 20)

/* Read to the end of fd. A size known beforehand is one buffer; a pipe makes the buffer grow. */
static int read_all(dmk_context *ctx, int fd, size_t expected, dmk_file *file)
{
    size_t room = expected + 1;
    for (;;) {
        if (file->size + 1 > room || !file->data) {
            if (file->data) room *= 2;
            if (room > most_bytes()) {
                return dmk_fail(ctx, DMK_E_NOMEM,
                                file->data ? "%s: out of memory: %zu bytes and no end"
                                           : "%s: out of memory: %zu bytes, but half of the memory "
                                             "is %zu, and no file may be longer",
                                file->path, file->data ? file->size : expected, most_bytes());
            }
            char *bigger = realloc(file->data, room + 1);
            if (!bigger) {
                return dmk_fail(ctx, DMK_E_NOMEM, "%s: out of memory: %zu bytes for the file",
                                file->path, room);
            }
            file->data = bigger;
        }
        const size_t left = room - file->size;
        ssize_t n = read(fd, file->data + file->size, left < AT_ONCE ? left : AT_ONCE);
        if (n < 0 && errno == EINTR) {
            int rc = ask_to_go_on(ctx);
            if (rc != DMK_OK) return rc;
            continue;
        }
        if (n < 0) return fail_errno(ctx, file->path, "cannot read");
        if (n == 0) break;
        file->size += (size_t)n;
        int rc = dmk_poll(ctx);
        if (rc != DMK_OK) return rc;
    }
    file->data[file->size] = '\0';
    return DMK_OK;
}

int dmk_file_load(dmk_context *ctx, const char *path, dmk_file *file)
{
    int fd;
    struct stat st;
    *file = (dmk_file){.path = path};
    int rc = open_file(ctx, path, &fd);
    if (rc != DMK_OK) return rc;
    if (fstat(fd, &st) != 0) {
        rc = fail_errno(ctx, path, "cannot open");
    } else if (S_ISDIR(st.st_mode)) {
        rc = dmk_fail(ctx, DMK_E_IO, "%s: cannot read: %s; name a mesh file in it", path,
                      strerror(EISDIR));
    } else if (S_ISCHR(st.st_mode) || S_ISBLK(st.st_mode)) {
        rc = dmk_fail(ctx, DMK_E_IO, "%s: is a device; name a mesh file, or a pipe", path);
    } else {
        rc = read_all(ctx, fd, S_ISREG(st.st_mode) ? (size_t)st.st_size : 65536, file);
    }
    close(fd);
    if (rc == DMK_OK && file->size == 0) {
        rc = dmk_fail(ctx, DMK_E_FORMAT, "%s: the file is empty", path);
    }
    if (rc == DMK_OK && dmk_gzip_sniff(file)) rc = dmk_gzip_unpack(ctx, file);
    if (rc != DMK_OK) dmk_file_free(file);
    return rc;
}

void dmk_file_free(dmk_file *file)
{
    free(file->data);
    file->data = NULL;
    file->size = 0;
}
