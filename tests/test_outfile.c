/* Files come into being whole or not at all, whatever happens meanwhile; in both ways: without a
 * name until the end, and with one where the file system cannot do that. */
#include "base/outfile.h"
#include "files.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

/* The library's calls come here first. */
static bool no_tmpfile, no_proc;
static int n_syncs, sync_error;

int open(const char *path, int flags, ...)
{
    if (no_tmpfile && (flags & O_TMPFILE) == O_TMPFILE) {
        errno = EOPNOTSUPP;
        return -1;
    }
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0666);
}

int access(const char *path, int mode)
{
    if (no_proc && strncmp(path, "/proc/", 6) == 0) {
        errno = ENOENT;
        return -1;
    }
    return (int)syscall(SYS_faccessat, AT_FDCWD, path, mode);
}

/* Calls until there is no room but for half of what is to be written, 0: none; and what comes meanwhile. */
static int full_at;
static void (*meanwhile)(void);

ssize_t write(int fd, const void *from, size_t n)
{
    if (full_at > 0 && --full_at == 0) {
        errno = ENOSPC;
        if (meanwhile) meanwhile();
        return -1;
    }
    return syscall(SYS_write, fd, from, full_at == 1 ? n / 2 : n);
}

int fsync(int fd)
{
    n_syncs++;
    if (sync_error) errno = sync_error;
    return sync_error ? -1 : (int)syscall(SYS_fsync, fd);
}

static int begin(const char *path, const char *text, dmk_outfile *file)
{
    const int error = dmk_outfile_open(path, file);
    if (error == 0) assert_int_equal(write(file->fd, text, strlen(text)), strlen(text));
    return error;
}

static int put(const char *path, const char *text)
{
    dmk_outfile file;
    const int error = begin(path, text, &file);
    return error == 0 ? dmk_outfile_commit(&file) : error;
}

static void holds(fixture *f, const char *name, const char *text)
{
    size_t n;
    char *content = get_file(f, name, &n);
    assert_int_equal(n, strlen(text));
    assert_memory_equal(content, text, n);
    free(content);
}

static mode_t mode_of(fixture *f, const char *name)
{
    struct stat st;
    assert_int_equal(lstat(path_of(f, name), &st), 0);
    return st.st_mode;
}

static void whole_or_not_there(fixture *f)
{
    dmk_outfile file;
    n_syncs = 0;
    assert_int_equal(begin(path_of(f, "a"), "one", &file), 0);
    assert_int_equal(access(f->path, F_OK), -1);
    assert_int_equal(dmk_outfile_commit(&file), 0);
    assert_int_equal(n_syncs, 1); /* on the disk before it has its name */
    holds(f, "a", "one");
    assert_int_equal(begin(path_of(f, "a"), "two", &file), 0);
    holds(f, "a", "one");
    dmk_outfile_discard(&file);
    holds(f, "a", "one");
    assert_int_equal(put(path_of(f, "a"), "three"), 0);
    holds(f, "a", "three");
    sync_error = ENOSPC;
    assert_int_equal(put(path_of(f, "a"), "four"), ENOSPC);
    sync_error = EINVAL; /* a file system that cannot sync */
    assert_int_equal(put(path_of(f, "b"), "five"), 0);
    sync_error = 0;
    holds(f, "a", "three");
    holds(f, "b", "five");
    assert_int_equal(count_files(f), 2);
    remove_file(f, "a");
    remove_file(f, "b");
}

/* Two at a time: the last one that is done stays, and neither spoils the other. */
static void two_at_a_time(fixture *f)
{
    dmk_outfile one, two;
    assert_int_equal(begin(path_of(f, "a"), "one", &one), 0);
    assert_int_equal(begin(path_of(f, "a"), "two", &two), 0);
    assert_int_equal(dmk_outfile_commit(&two), 0);
    holds(f, "a", "two");
    assert_int_equal(dmk_outfile_commit(&one), 0);
    holds(f, "a", "one");
    assert_int_equal(count_files(f), 1);
    remove_file(f, "a");
}

static void links_and_modes_stay(fixture *f)
{
    const mode_t mask = umask(0);
    umask(mask);
    assert_int_equal(put(path_of(f, "real"), "one"), 0);
    assert_int_equal(mode_of(f, "real") & 0777, 0666 & ~mask);
    assert_int_equal(chmod(f->path, 0640), 0);
    assert_int_equal(symlink("real", path_of(f, "link")), 0);
    assert_int_equal(symlink("link", path_of(f, "longer")), 0);
    assert_int_equal(put(f->path, "two"), 0);
    holds(f, "real", "two");
    assert_int_equal(mode_of(f, "real") & 0777, 0640);
    assert_true(S_ISLNK(mode_of(f, "link")) && S_ISLNK(mode_of(f, "longer")));
    /* A link to what is not there makes it. */
    remove_file(f, "real");
    assert_int_equal(put(path_of(f, "longer"), "three"), 0);
    holds(f, "real", "three");
    assert_true(S_ISLNK(mode_of(f, "link")));
    assert_int_equal(symlink("ring", path_of(f, "ring")), 0);
    assert_int_equal(put(f->path, "four"), ELOOP);
    remove_file(f, "ring");
    remove_file(f, "real");
    remove_file(f, "link");
    remove_file(f, "longer");
}

/* What a stream that is written as it comes has taken, from its reader's end. */
static void takes(const char *path, int reader, const char *text)
{
    char came[16] = {0};
    dmk_outfile file;
    assert_true(dmk_outfile_is_stream(path));
    assert_int_equal(begin(path, text, &file), 0);
    assert_int_equal(read(reader, came, sizeof came - 1), strlen(text));
    assert_string_equal(came, text);
    assert_int_equal(dmk_outfile_commit(&file), 0);
    assert_int_equal(begin(path, text, &file), 0);
    dmk_outfile_discard(&file); /* what was written stays */
    assert_int_equal(read(reader, came, sizeof came - 1), strlen(text));
}

static void streams_are_written_as_it_comes(fixture *f)
{
    int ends[2];
    char name[64], link[400];
    assert_int_equal(mkfifo(path_of(f, "pipe"), 0600), 0);
    const int reader = open(f->path, O_RDONLY | O_NONBLOCK);
    takes(f->path, reader, "one");
    snprintf(link, sizeof link, "%s/link", f->folder);
    assert_int_equal(symlink("pipe", link), 0);
    takes(link, reader, "two");
    assert_int_equal(close(reader) + unlink(link), 0);
    remove_file(f, "pipe");
    /* A descriptor goes on behind what was written. */
    const int fd = open(path_of(f, "a"), O_RDWR | O_CREAT | O_TRUNC);
    assert_int_equal(write(fd, "one", 3), 3);
    snprintf(name, sizeof name, "/dev/fd/%d", fd);
    assert_int_equal(put(name, "two"), 0);
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    assert_int_equal(put(name, "three"), 0);
    holds(f, "a", "onetwothree");
    close(fd);
    assert_int_equal(put(name, "four"), EBADF);
    remove_file(f, "a");
    assert_int_equal(pipe(ends), 0);
    snprintf(name, sizeof name, "/dev/fd/%d", ends[1]);
    takes(name, ends[0], "five");
    close(ends[0]);
    close(ends[1]);
    assert_int_equal(put("/dev/null", "six"), 0);
    assert_false(dmk_outfile_is_stream(path_of(f, "b")) || dmk_outfile_is_stream(f->folder));
    assert_false(dmk_outfile_is_stream("/dev/fd/x") || dmk_outfile_is_stream("/dev/fd/"));
    assert_int_equal(count_files(f), 0);
}

static void other_special_files_are_refused(fixture *f)
{
    dmk_outfile file;
    char missing[400];
    assert_int_equal(dmk_outfile_open(f->folder, &file), DMK_OUTFILE_NOT_REGULAR);
    snprintf(missing, sizeof missing, "%s/no/file", f->folder);
    assert_int_equal(dmk_outfile_open(missing, &file), ENOENT);
    assert_int_equal(file.fd, -1);
}

/* Ended by kill -9 while it writes: nothing is left, or something that the next run removes. */
static void killed_while_writing(fixture *f)
{
    dmk_outfile file;
    for (int i = 0; i < 3; i++) {
        const pid_t child = fork();
        if (child == 0) {
            if (begin(path_of(f, "a"), "half", &file) == 0) kill(getpid(), SIGKILL);
            _exit(1);
        }
        int status;
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_int_equal(WTERMSIG(status), SIGKILL);
        assert_int_equal(count_files(f), no_tmpfile || no_proc); /* of all these runs */
    }
    assert_int_equal(put(path_of(f, "b"), "whole"), 0);
    assert_int_equal(count_files(f), 1);
    remove_file(f, "b");
}

/* What another process is writing, or what is not a file of ours, is left alone. */
static void others_files_are_left_alone(fixture *f)
{
    put_file(f, ".dmkcl-0.tmp", "another's", 9);
    const int fd = open(f->path, O_WRONLY);
    assert_int_equal(flock(fd, LOCK_EX), 0);
    assert_int_equal(symlink("nowhere", path_of(f, ".dmkcl-1.tmp")), 0);
    assert_int_equal(mkdir(path_of(f, ".dmkcl-2.tmp"), 0700), 0);
    assert_int_equal(put(path_of(f, "a"), "one"), 0);
    assert_int_equal(put(path_of(f, "a"), "two"), 0);
    holds(f, "a", "two");
    holds(f, ".dmkcl-0.tmp", "another's");
    assert_int_equal(count_files(f), 4);
    close(fd);
    assert_int_equal(put(path_of(f, "a"), "three"), 0); /* now it is a killed run's */
    assert_int_equal(count_files(f), 3);
    assert_int_equal(rmdir(path_of(f, ".dmkcl-2.tmp")), 0);
    remove_file(f, ".dmkcl-1.tmp");
    remove_file(f, "a");
}

/* The lowest descriptor that is free: the same before and after, if none is lost. */
static int free_descriptor(void)
{
    const int fd = dup(0);
    close(fd);
    return fd;
}

/* Without a name; with one; without /proc, which gives one to what has none. */
static void both_ways(fixture *f, void (*test)(fixture *))
{
    const int before = free_descriptor();
    for (int i = 0; i < 3; i++) {
        no_tmpfile = i == 1;
        no_proc = i == 2;
        test(f);
        assert_int_equal(count_files(f), 0);
        assert_int_equal(free_descriptor(), before);
    }
    no_tmpfile = no_proc = false;
}

/* Descriptor 0 is one as any other, also where a regular file lies behind it. */
static void descriptor_zero(fixture *f)
{
    const int before = dup(STDIN_FILENO), fd = open(path_of(f, "zero"), O_RDWR | O_CREAT);
    assert_true(fd >= 0 && dup2(fd, STDIN_FILENO) == STDIN_FILENO);
    assert_true(dmk_outfile_is_stream("/dev/fd/0") && dmk_outfile_is_stream("/proc/self/fd/0"));
    assert_int_equal(put("/dev/fd/0", "as it comes"), 0);
    if (before >= 0)
        dup2(before, STDIN_FILENO);
    else
        close(STDIN_FILENO);
    close(before);
    close(fd);
    holds(f, "zero", "as it comes");
    remove_file(f, "zero");
}

static int second;

static void append_second(void)
{
    assert_int_equal(syscall(SYS_write, second, "another one\n", 12), 12);
}

/* What one rank takes back is not another one's line. */
static void lines_of_two_runs(void **state)
{
    fixture *f = *state;
    size_t n;
    const char *path = path_of(f, "lines");
    const int first = open(path, O_WRONLY | O_CREAT | O_APPEND);
    second = open(path, O_WRONLY | O_APPEND);
    assert_int_equal(dmk_outfile_append(first, "one\n", 4), 0);
    assert_int_equal(dmk_outfile_append(second, "two\n", 4), 0);
    full_at = 2;
    assert_int_equal(dmk_outfile_append(first, "a line without room\n", 20), ENOSPC);
    char *text = get_file(f, "lines", &n);
    assert_true(n == 8 && memcmp(text, "one\ntwo\n", 8) == 0);
    free(text);
    full_at = 2;
    meanwhile = append_second;
    assert_int_equal(dmk_outfile_append(first, "a line without room\n", 20), ENOSPC);
    meanwhile = NULL;
    text = get_file(f, "lines", &n);
    assert_true(n == 30 && memcmp(text, "one\ntwo\na line witanother one\n", 30) == 0);
    free(text);
    close(first);
    close(second);
    remove_file(f, "lines");
}

#define BOTH(name)                                                                                 \
    static void test_##name(void **state)                                                          \
    {                                                                                              \
        both_ways(*state, name);                                                                   \
    }
BOTH(whole_or_not_there)
BOTH(two_at_a_time)
BOTH(links_and_modes_stay)
BOTH(streams_are_written_as_it_comes)
BOTH(other_special_files_are_refused)
BOTH(killed_while_writing)
BOTH(others_files_are_left_alone)
BOTH(descriptor_zero)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(test_whole_or_not_there),
        TEST(test_two_at_a_time),
        TEST(test_links_and_modes_stay),
        TEST(test_streams_are_written_as_it_comes),
        TEST(test_other_special_files_are_refused),
        TEST(test_killed_while_writing),
        TEST(test_others_files_are_left_alone),
        TEST(test_descriptor_zero),
        TEST(lines_of_two_runs),
    };
    return cmocka_run_group_tests_name("outfile", tests, NULL, NULL);
}
