/* A file that comes into being whole or not at all. POSIX only: the tool's own outputs use it as
 * well. */
#ifndef DMK_OUTFILE_H
#define DMK_OUTFILE_H

/* Until it is committed the file has no name, where the file system can do that, and else one in
 * the same folder that the next run finds and removes if this one is killed. */
typedef struct dmk_outfile {
    int fd;     /* to be written to, from its begin */
    char *path; /* where it ends up: links are followed, so that they stay */
    char *name; /* until then, or NULL */
} dmk_outfile;

enum { DMK_OUTFILE_NOT_REGULAR = -1 };

/* Open a new file for `path`, with the permissions of the file that is there, if any. 0; or errno;
 * or DMK_OUTFILE_NOT_REGULAR for the path of a device, a pipe, a folder. */
int dmk_outfile_open(const char *path, dmk_outfile *file);
/* Put it on the disk, and in its place: 0 or errno, and then nothing has changed there. Closed in
 * any case. */
int dmk_outfile_commit(dmk_outfile *file);
/* As if it had never been. */
void dmk_outfile_discard(dmk_outfile *file);

#endif
