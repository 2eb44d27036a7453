/* Files written under another name, or under none, and then put in place at once; and streams. */
#include "base/outfile.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum {
    MOST_LINKS = 40,  /* one after the other, as the kernel follows them */
    MOST_NAMES = 1000 /* of files being written in one folder at a time */
};

static char *copy(const char *text, size_t n)
{
    char *p = malloc(n + 1);
    if (!p) return NULL;
    memcpy(p, text, n);
    p[n] = '\0';
    return p;
}

/* Characters of the folder in a path, its last slash included; 0: the current folder. */
static size_t folder_length(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? (size_t)(slash - path) + 1 : 0;
}

int dmk_outfile_descriptor(const char *path)
{
    static const char *const folders[] = {"/dev/fd/", "/proc/self/fd/"};
    if (strcmp(path, "/dev/stdout") == 0) return STDOUT_FILENO;
    if (strcmp(path, "/dev/stderr") == 0) return STDERR_FILENO;
    for (size_t i = 0; i < sizeof folders / sizeof *folders; i++) {
        const size_t n = strlen(folders[i]);
        if (strncmp(path, folders[i], n) != 0) continue;
        const size_t digits = strspn(path + n, "0123456789");
        if (digits > 0 && digits < 9 && !path[n + digits]) return (int)strtol(path + n, NULL, 10);
    }
    return -1;
}

/* Where a link leads: absolute, or from the folder it lies in. */
static char *follow(const char *link)
{
    char target[PATH_MAX];
    const ssize_t n = readlink(link, target, sizeof target);
    if (n < 0 || n == sizeof target) return NULL;
    const size_t folder = target[0] == '/' ? 0 : folder_length(link);
    char *path = malloc(folder + (size_t)n + 1);
    if (!path) return NULL;
    memcpy(path, link, folder);
    memcpy(path + folder, target, (size_t)n);
    path[folder + (size_t)n] = '\0';
    return path;
}

/* The file that `path` stands for, there or not, and its mode: 0 if it is not there. A descriptor's path stays. */
static int resolve(const char *path, char **resolved, mode_t *mode)
{
    struct stat st;
    char *at = copy(path, strlen(path));
    *mode = 0;
    for (int i = 0;
         at && dmk_outfile_descriptor(at) < 0 && lstat(at, &st) == 0 && S_ISLNK(st.st_mode); i++) {
        errno = ELOOP;
        char *next = i < MOST_LINKS ? follow(at) : NULL;
        free(at);
        at = next;
    }
    *resolved = at;
    if (!at) return errno ? errno : ENOMEM;
    if (dmk_outfile_descriptor(at) >= 0) return DMK_OUTFILE_NOT_REGULAR;
    if (stat(at, &st) != 0) return 0;
    *mode = st.st_mode & 07777;
    return S_ISREG(st.st_mode) ? 0 : DMK_OUTFILE_NOT_REGULAR;
}

char *dmk_outfile_target(const char *path)
{
    char *at;
    mode_t mode;
    resolve(path, &at, &mode);
    return at;
}

/* ---- streams --------------------------------------------------------------------------------- */

/* Of a path without links that is no regular file. */
static bool is_stream(const char *path)
{
    struct stat st;
    if (dmk_outfile_descriptor(path) >= 0) return true;
    return stat(path, &st) == 0 && (S_ISCHR(st.st_mode) || S_ISFIFO(st.st_mode));
}

bool dmk_outfile_is_stream(const char *path)
{
    char *at;
    mode_t mode;
    const bool is = resolve(path, &at, &mode) == DMK_OUTFILE_NOT_REGULAR && is_stream(at);
    free(at);
    return is;
}

static int open_stream(dmk_outfile *file)
{
    const int fd = dmk_outfile_descriptor(file->path);
    if (!is_stream(file->path)) return DMK_OUTFILE_NOT_REGULAR;
    file->stream = true;
    file->fd =
        fd >= 0 ? fcntl(fd, F_DUPFD_CLOEXEC, 0) : open(file->path, O_WRONLY | O_NOCTTY | O_CLOEXEC);
    return file->fd >= 0 ? 0 : errno;
}

/* ---- names until the end -------------------------------------------------------------------- */

static bool is_named(int fd, const char *name)
{
    struct stat a, b;
    return fstat(fd, &a) == 0 && lstat(name, &b) == 0 && dmk_is_same_file(&a, &b);
}

/* Remove what a killed run has left under this name: whoever writes holds a lock. */
static bool reclaim(const char *name)
{
    struct stat st;
    bool gone = false;
    const int fd = open(name, O_WRONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) return errno == ENOENT;
    if (fstat(fd, &st) == 0 && S_ISREG(st.st_mode) && st.st_uid == geteuid() &&
        flock(fd, LOCK_EX | LOCK_NB) == 0 && is_named(fd, name)) {
        gone = unlink(name) == 0;
    }
    close(fd);
    return gone;
}

/* Give the file of *fd the name, or make one (*fd < 0). 0, errno, or EEXIST if somebody has it. */
static int take_name(const char *name, int *fd)
{
    char self[64];
    if (*fd >= 0) {
        snprintf(self, sizeof self, "/proc/self/fd/%d", *fd);
        return linkat(AT_FDCWD, self, AT_FDCWD, name, AT_SYMLINK_FOLLOW) == 0 ? 0 : errno;
    }
    const int made = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (made < 0) return errno;
    flock(made, LOCK_EX); /* where there are no locks, nothing is reclaimed */
    if (is_named(made, name)) {
        *fd = made;
        return 0;
    }
    close(made); /* reclaimed before the lock was there */
    return EEXIST;
}

/* A name in the folder of the path that nobody has, for the file of *fd or a new one. */
static int find_name(const char *path, int *fd, char **name)
{
    const size_t folder = folder_length(path), room = folder + 32;
    char *text = malloc(room);
    if (!text) return ENOMEM;
    int error = EEXIST;
    for (int i = 0; i < MOST_NAMES && error == EEXIST; i++) {
        snprintf(text, room, "%.*s.dmkcl-%d.tmp", (int)folder, path, i);
        error = take_name(text, fd);
        if (error == EEXIST && reclaim(text)) error = take_name(text, fd);
    }
    if (error == 0)
        *name = text;
    else
        free(text);
    return error;
}

/* ---- the file ------------------------------------------------------------------------------- */

/* A file without a name, which /proc can give one later; else one with a name. */
static int open_new(dmk_outfile *file)
{
    char self[64];
    const size_t n = folder_length(file->path);
    char *folder = n ? copy(file->path, n) : copy(".", 1);
    if (!folder) return ENOMEM;
    file->fd = open(folder, O_TMPFILE | O_WRONLY | O_CLOEXEC, 0666);
    free(folder);
    if (file->fd >= 0) {
        snprintf(self, sizeof self, "/proc/self/fd/%d", file->fd);
        flock(file->fd, LOCK_EX);
        if (access(self, F_OK) == 0) return 0;
        close(file->fd);
        file->fd = -1;
    }
    return find_name(file->path, &file->fd, &file->name);
}

static void give_back(dmk_outfile *file)
{
    if (file->fd >= 0) close(file->fd);
    free(file->path);
    free(file->name);
    *file = (dmk_outfile){.fd = -1};
}

int dmk_outfile_open(const char *path, dmk_outfile *file)
{
    mode_t mode;
    *file = (dmk_outfile){.fd = -1};
    errno = 0;
    int error = resolve(path, &file->path, &mode);
    if (error == 0)
        error = open_new(file);
    else if (error == DMK_OUTFILE_NOT_REGULAR)
        error = open_stream(file);
    if (error != 0)
        give_back(file);
    else if (mode)
        (void)!fchmod(file->fd, mode & 0777); /* if we may */
    return error;
}

/* Some file systems cannot sync, and say so by these two; streams need not. */
int dmk_outfile_sync(const dmk_outfile *file)
{
    if (file->stream || fsync(file->fd) == 0 || errno == EINVAL || errno == ENOTSUP) return 0;
    return errno;
}

int dmk_outfile_commit(dmk_outfile *file)
{
    int error = dmk_outfile_sync(file);
    bool placed = file->stream;
    if (error == 0 && !file->name && !placed) { /* at once where nothing is to be replaced */
        error = take_name(file->path, &file->fd);
        placed = error == 0;
        if (error == EEXIST) error = find_name(file->path, &file->fd, &file->name);
    }
    if (error == 0 && !placed && rename(file->name, file->path) != 0) error = errno;
    if (error != 0 && file->name) unlink(file->name);
    give_back(file);
    return error;
}

void dmk_outfile_discard(dmk_outfile *file)
{
    if (file->name) unlink(file->name);
    give_back(file);
}

/* The n bytes from `begin` on, if they are the last ones. */
static void take_back(int fd, off_t begin, size_t n)
{
    struct stat st;
    if (fstat(fd, &st) == 0 && st.st_size == begin + (off_t)n) (void)!ftruncate(fd, begin);
}

int dmk_outfile_append(int fd, const void *bytes, size_t length)
{
    off_t begin = 0;
    for (size_t n = 0; n < length;) {
        const ssize_t written = write(fd, (const char *)bytes + n, length - n);
        if (written < 0 && errno == EINTR) continue;
        if (written < 0) {
            const int error = errno;
            if (n > 0) take_back(fd, begin, n);
            return error;
        }
        if (n == 0) begin = lseek(fd, 0, SEEK_CUR) - written;
        n += (size_t)written;
    }
    return 0;
}

void dmk_outfile_piece(const char *path, int k, char *name, size_t size)
{
    snprintf(name, size, "%.*s_%04d.vtp", (int)(strlen(path) - strlen(".pvtp")), path, k);
}

bool dmk_outfile_can_index(const char *path)
{
    const char *slash = strrchr(path, '/');
    for (const char *c = slash ? slash + 1 : path; *c;) {
        const int n = dmk_utf8_length(c);
        if (n == 0 || (unsigned char)*c < 0x20) return false;
        c += n;
    }
    return true;
}

int dmk_utf8_length(const char *text)
{
    const unsigned char *c = (const unsigned char *)text;
    const int n = c[0] < 0x80   ? 1
                  : c[0] < 0xc2 ? 0
                  : c[0] < 0xe0 ? 2
                  : c[0] < 0xf0 ? 3
                  : c[0] < 0xf5 ? 4
                                : 0;
    for (int i = 1; i < n; i++) {
        if (c[i] < 0x80 || c[i] > 0xbf) return 0;
    }
    if ((c[0] == 0xe0 && c[1] < 0xa0) || (c[0] == 0xed && c[1] > 0x9f)) return 0;
    if ((c[0] == 0xf0 && c[1] < 0x90) || (c[0] == 0xf4 && c[1] > 0x8f)) return 0;
    return n;
}
