/* A file that comes into being whole or not at all; or, where there is no place to put one, a stream that is written
 * as it comes. POSIX only: the tool's own outputs use it as well. */
#ifndef DMK_OUTFILE_H
#define DMK_OUTFILE_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/stat.h>

/* Until it is committed the file has no name, where the file system can do that, and else one in
 * the same folder that the next run finds and removes if this one is killed. */
typedef struct dmk_outfile {
    int fd;      /* to be written to */
    char *path;  /* where it ends up: links are followed, so that they stay */
    char *name;  /* until then, or NULL */
    bool stream; /* written as it comes: what was written stays when the file is discarded */
} dmk_outfile;

enum { DMK_OUTFILE_NOT_REGULAR = -1 };

/* The number of the open descriptor that a path names (/dev/stdout, /dev/stderr, /dev/fd/N, /proc/self/fd/N), or -1. */
int dmk_outfile_descriptor(const char *path);
/* Whether `path` is a stream: a pipe, a character device, or one of these descriptors, which is written
 * from where it stands, whatever is behind it. */
bool dmk_outfile_is_stream(const char *path);
/* The file that `path` stands for, there or not: where its links lead. NULL if they lead nowhere; the caller frees
 * it. */
char *dmk_outfile_target(const char *path);
/* Open a new file for `path`, with the permissions of the file that is there, if any, or the stream that it is; a
 * pipe waits for its reader. 0; or errno, EINTR if a signal came while it waited; or DMK_OUTFILE_NOT_REGULAR for what
 * is neither: a folder, a block device, a socket. */
int dmk_outfile_open(const char *path, dmk_outfile *file);
/* Put what was written on the disk: 0 or errno. */
int dmk_outfile_sync(const dmk_outfile *file);
/* Put it on the disk, and in its place: 0 or errno, and then nothing has changed there. Closed in
 * any case. */
int dmk_outfile_commit(dmk_outfile *file);
/* As if it had never been. */
void dmk_outfile_discard(dmk_outfile *file);
/* Bytes at the end of a file that may be open for others to append to, too: 0; or errno, and nothing of them is there,
 * unless what another one wrote stands behind a part of them. */
int dmk_outfile_append(int fd, const void *bytes, size_t length);
/* Of what stat told: whether it is one file, whatever its names. */
static inline bool dmk_is_same_file(const struct stat *a, const struct stat *b)
{
    return a->st_dev == b->st_dev && a->st_ino == b->st_ino;
}
enum {
    DMK_PIECE_ROOM = 16
}; /* bytes that the name of a piece may be longer than that of the whole */
/* The name of piece k of a file in pieces: "dir/NAME.pvtp" -> "dir/NAME_0003.vtp". */
void dmk_outfile_piece(const char *path, int k, char *name, size_t size);
/* Whether an index in XML can name the pieces of `path`: their names are UTF-8 without control characters. */
bool dmk_outfile_can_index(const char *path);
/* Bytes of the UTF-8 character at `text`; 0 if none begins there (RFC 3629: no longer form than needed, no
 * surrogates, nothing above U+10FFFF). */
int dmk_utf8_length(const char *text);

#endif
