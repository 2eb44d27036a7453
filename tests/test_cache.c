/* The folder of kernel binaries: what is kept comes back, what is damaged or foreign does not, and
 * nothing that is wrong with the folder is more than a build from source. */
#include "device/internal.h"
#include "files.h"

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

static const char source[] = "kernel void twice(global int *x) { x[get_global_id(0)] *= 2; }\n";
static const char options[] = "-cl-std=CL1.2";

/* Whether binaries are the driver's own, of linked programs, as of all drivers but PoCL. */
static bool is_linked;

/* A device with one small program: asking for the binary of the whole one takes seconds on PoCL. */
typedef struct cabinet {
    fixture *f;
    dmk_device *dev;
    cl_program program;
} cabinet;

static cabinet cabinet_open(fixture *f, const char *folder)
{
    cabinet c = {.f = f};
    cl_int error;
    const char *text = source;
    dmk_device_options plain;
    dmk_device_options_init(&plain, sizeof plain);
    assert_int_equal(dmk_device_open(f->ctx, &plain, &c.dev), DMK_OK);
    c.program = clCreateProgramWithSource(c.dev->cl, 1, &text, NULL, &error);
    assert_int_equal(error, CL_SUCCESS);
    c.dev->pocl &= !is_linked;
    assert_int_equal(
        c.dev->pocl ? clCompileProgram(c.program, 1, &c.dev->id, options, 0, NULL, NULL, NULL, NULL)
                    : clBuildProgram(c.program, 1, &c.dev->id, options, NULL, NULL),
        CL_SUCCESS);
    snprintf(c.dev->cache, sizeof c.dev->cache, "%s", folder);
    return c;
}

static void cabinet_close(cabinet *c)
{
    clReleaseProgram(c->program);
    dmk_device_destroy(&c->dev);
}

static bool is_kept(const cabinet *c)
{
    cl_program p = NULL;
    cl_int error;
    if (dmk_cache_load(c->dev, options, &p) != DMK_OK) {
        assert_null(p);
        return false;
    }
    cl_kernel k = clCreateKernel(p, "twice", &error);
    assert_int_equal(error, CL_SUCCESS);
    clReleaseKernel(k);
    clReleaseProgram(p);
    return true;
}

/* The one file of the folder, in f->path. */
static char *get_binary(fixture *f, size_t *n)
{
    char find[300], name[300] = "";
    snprintf(find, sizeof find, "cd '%s' && ls", f->folder);
    FILE *list = popen(find, "r");
    assert_non_null(list);
    assert_non_null(fgets(name, sizeof name, list));
    pclose(list);
    name[strcspn(name, "\n")] = '\0';
    return get_file(f, name, n);
}

static void put_back(fixture *f, const char *data, size_t n)
{
    FILE *file = fopen(f->path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, n, file), n);
    fclose(file);
}

static void what_is_kept_comes_back(void **state)
{
    fixture *f = *state;
    cabinet c = cabinet_open(f, f->folder);
    assert_false(is_kept(&c));
    dmk_cache_store(c.dev, options, c.program);
    assert_int_equal(count_files(f), 1);
    assert_true(is_kept(&c));
    cabinet_close(&c);
    size_t n;
    free(get_binary(f, &n));
    unlink(f->path);
}

static void damage_is_seen(void **state)
{
    fixture *f = *state;
    size_t n;
    cabinet c = cabinet_open(f, f->folder);
    dmk_cache_store(c.dev, options, c.program);
    char *data = get_binary(f, &n);
    for (size_t length = 0; length < n; length += 1 + length / 3) {
        put_back(f, data, length);
        assert_false(is_kept(&c));
    }
    for (size_t at = 0; at < n; at += 1 + at / 2) {
        data[at] ^= 4;
        put_back(f, data, n);
        assert_false(is_kept(&c));
        data[at] ^= 4;
    }
    put_back(f, "foreign", 7);
    assert_false(is_kept(&c));
    put_back(f, data, n);
    assert_true(is_kept(&c));
    /* It is made anew over the damage. */
    put_back(f, data, n / 2);
    dmk_cache_store(c.dev, options, c.program);
    assert_true(is_kept(&c));
    unlink(f->path);
    /* A folder in its place. */
    assert_int_equal(mkdir(f->path, 0700), 0);
    assert_false(is_kept(&c));
    dmk_cache_store(c.dev, options, c.program);
    assert_false(is_kept(&c));
    assert_int_equal(count_files(f), 1);
    assert_int_equal(rmdir(f->path), 0);
    free(data);
    cabinet_close(&c);
}

static void other_options_are_foreign(void **state)
{
    fixture *f = *state;
    cl_program p = NULL;
    size_t n;
    cabinet c = cabinet_open(f, f->folder);
    dmk_cache_store(c.dev, options, c.program);
    assert_int_not_equal(dmk_cache_load(c.dev, "-cl-std=CL1.2 -DX", &p), DMK_OK);
    c.dev->info.driver[0] ^= 1; /* another driver */
    assert_false(is_kept(&c));
    c.dev->info.driver[0] ^= 1;
    assert_true(is_kept(&c));
    free(get_binary(f, &n));
    unlink(f->path);
    cabinet_close(&c);
}

static void bad_folders_are_no_error(void **state)
{
    fixture *f = *state;
    char in_file[320], deep[320];
    put_file(f, "file", "x", 1);
    snprintf(in_file, sizeof in_file, "%s/sub", f->path);
    snprintf(deep, sizeof deep, "%s/a/b", f->folder);
    const char *const bad[] = {"", in_file, "/proc/self/none", "/dev/null"};
    for (size_t i = 0; i < COUNT(bad); i++) {
        cabinet c = cabinet_open(f, bad[i]);
        dmk_cache_store(c.dev, options, c.program);
        assert_false(is_kept(&c));
        cabinet_close(&c);
    }
    cabinet c = cabinet_open(f, deep); /* made if missing */
    dmk_cache_store(c.dev, options, c.program);
    assert_true(is_kept(&c));
    cabinet_close(&c);
    char command[500];
    snprintf(command, sizeof command, "rm -r '%s'/a '%s'/file", f->folder, f->folder);
    assert_int_equal(system(command), 0);
}

static void *store_often(void *user)
{
    cabinet *c = user;
    for (int i = 0; i < 30; i++) {
        dmk_cache_store(c->dev, options, c->program);
        if (!is_kept(c)) return "not kept";
    }
    return NULL;
}

/* Two runs share the folder: each finds a whole binary at any time. */
static void two_share_the_folder(void **state)
{
    fixture *f = *state;
    fixture other = *f;
    size_t n;
    pthread_t thread;
    void *a, *b;
    assert_int_equal(dmk_context_create(&other.ctx), DMK_OK);
    cabinet one = cabinet_open(f, f->folder), two = cabinet_open(&other, f->folder);
    assert_int_equal(pthread_create(&thread, NULL, store_often, &two), 0);
    a = store_often(&one);
    pthread_join(thread, &b);
    assert_null(a);
    assert_null(b);
    assert_int_equal(count_files(f), 1);
    cabinet_close(&one);
    cabinet_close(&two);
    dmk_context_destroy(&other.ctx);
    free(get_binary(f, &n));
    unlink(f->path);
}

/* The signal that a file longer than allowed brings ends the run in the middle of it. */
static void a_run_that_is_killed_leaves_nothing(void **state)
{
    fixture *f = *state;
    size_t n;
    cabinet c = cabinet_open(f, f->folder);
    const pid_t child = fork();
    if (child == 0) {
        setrlimit(RLIMIT_CORE, &(struct rlimit){0, 0});
        setrlimit(RLIMIT_FSIZE, &(struct rlimit){100, 100});
        signal(SIGXFSZ, SIG_DFL);
        dmk_cache_store(c.dev, options, c.program);
        _exit(0);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status) && WTERMSIG(status) == SIGXFSZ);
    assert_false(is_kept(&c));
    dmk_cache_store(c.dev, options, c.program);
    assert_true(is_kept(&c));
    assert_int_equal(count_files(f), 1);
    cabinet_close(&c);
    free(get_binary(f, &n));
    unlink(f->path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(what_is_kept_comes_back),   TEST(damage_is_seen),
        TEST(other_options_are_foreign), TEST(bad_folders_are_no_error),
        TEST(two_share_the_folder),      TEST(a_run_that_is_killed_leaves_nothing),
    };
    int failed = cmocka_run_group_tests_name("cache", tests, NULL, NULL);
    is_linked = true;
    failed += cmocka_run_group_tests_name("cache of linked programs", tests, NULL, NULL);
    return failed;
}
