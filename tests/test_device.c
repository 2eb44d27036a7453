/* Devices opened, used and given back. */
#include "device/internal.h"
#include "files.h"
#include "solver/memory.h"

#include <inttypes.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/resource.h>
#include <unistd.h>

/* What was asked for and not waited for, as after an error, ends before the device goes away: PoCL's
 * threads would go on with a part of a device that is no more. The device's own buffers go first: what wrote to them
 * last holds the queue as long as they are there, and is waited for, a second at most. */
static void destroyed_with_work_under_way(void **state)
{
    const size_t bytes = (size_t)8 << 20;
    fixture *f = *state;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.threads = 1; /* a part of the device */
    double least = 1;    /* seconds */
    for (int i = 0; i < 5; i++) {
        dmk_device *device = NULL;
        dmk_buffer *buffer = NULL;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
        assert_int_equal(dmk_buffer_create(f->ctx, device, bytes, NULL, &buffer), DMK_OK);
        for (int k = 0; k < 30; k++) {
            assert_int_equal(dmk_buffer_clear(f->ctx, device, buffer, bytes), DMK_OK);
        }
        dmk_buffer_destroy(&buffer);
        const double before = dmk_seconds();
        dmk_device_destroy(&device);
        least = fmin(least, dmk_seconds() - before);
    }
    assert_true(least < 0.5);
}

/* In a process that has not used OpenCL before, by several threads at the same moment: PoCL 3.1 tells those that come
 * second of no device, or of one that is not ready. The first of the tests, or it tells nothing. */
enum { AT_ONCE = 6 };

typedef struct crowd {
    pthread_barrier_t barrier;
    _Atomic int opened;
} crowd;

static void *one_of_many(void *argument)
{
    crowd *c = argument;
    dmk_context *ctx = NULL;
    dmk_device *device = NULL;
    const int rc = dmk_context_create(&ctx);
    pthread_barrier_wait(&c->barrier);
    if (rc == DMK_OK) c->opened += dmk_device_open(ctx, NULL, &device) == DMK_OK;
    dmk_device_destroy(&device);
    dmk_context_destroy(&ctx);
    return NULL;
}

static void opened_by_many_at_once(void **state)
{
    (void)state;
    crowd c = {.opened = 0};
    pthread_t thread[AT_ONCE];
    assert_int_equal(pthread_barrier_init(&c.barrier, NULL, AT_ONCE), 0);
    for (int i = 0; i < AT_ONCE; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, one_of_many, &c), 0);
    for (int i = 0; i < AT_ONCE; i++) pthread_join(thread[i], NULL);
    pthread_barrier_destroy(&c.barrier);
    assert_int_equal(c.opened, AT_ONCE);
}

/* In the CPU shape a launch has as many work-groups as any other, whatever it goes over: see dmk_launch_groups. */
static void launches_are_equally_wide(void **state)
{
    fixture *f = *state;
    dmk_device *device = NULL;
    dmk_buffer *list = NULL;
    const int32_t parts[2] = {0, 3};
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.shape = DMK_SHAPE_CPU;
    assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
    assert_int_equal(dmk_buffer_create(f->ctx, device, sizeof parts, parts, &list), DMK_OK);
    const size_t usual = dmk_launch_groups(device, (dmk_range){.items = 2});
    for (size_t items = 3; items < 100000000; items += items / 2) {
        const dmk_range all = {.items = items, .first = items / 3},
                        some = {.items = items, .parts = list, .n_parts = 2};
        assert_int_equal(dmk_launch_groups(device, all), usual);
        assert_int_equal(dmk_launch_groups(device, some), usual);
    }
    assert_int_equal(dmk_launch_groups(device, (dmk_range){.items = 1}), 1);
    dmk_buffer_destroy(&list);
    dmk_device_destroy(&device);
}

/* Kernels that a thread of the device's own builds are waited for by who wants one, and by who gives the device
 * back. */
static void built_in_the_background(void **state)
{
    fixture *f = *state;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.in_background = 1;
    for (int i = 0; i < 3; i++) {
        dmk_device *device = NULL;
        dmk_kernel *kernel = NULL;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
        if (i < 2)
            assert_int_equal(dmk_kernel_get(f->ctx, device, DMK_OUTER, "rows_apply", &kernel),
                             DMK_OK);
        if (i == 0)
            assert_int_equal(dmk_kernel_get(f->ctx, device, DMK_OUTER, "none", &kernel),
                             DMK_E_BUILD);
        dmk_device_destroy(&device);
        assert_null(device);
    }
}

/* In single precision both programs are the same one. */
static void built_once_where_they_are_the_same(void **state)
{
    fixture *f = *state;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    for (int single = 0; single < 2; single++) {
        dmk_device *device = NULL;
        options.single_precision = single;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
        assert_true((device->program[DMK_INNER] == device->program[DMK_OUTER]) ==
                    (dmk_device_real(device, DMK_OUTER) == sizeof(float)));
        dmk_device_destroy(&device);
    }
}

/* What is written where a buffer is mapped is the buffer's; single precision is not given as double. */
static void mapped(void **state)
{
    fixture *f = *state;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    for (int single = 0; single < 2; single++) {
        dmk_device *device = NULL;
        dmk_buffer *buffer = NULL;
        double *numbers = NULL, there[2];
        const double init[2] = {3, 4};
        dmk_device_info info;
        options.single_precision = single;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
        dmk_device_get_info(device, &info);
        assert_int_equal(dmk_buffer_create(f->ctx, device, sizeof init, init, &buffer), DMK_OK);
        assert_int_equal(dmk_buffer_map(f->ctx, device, buffer, 2, &numbers), DMK_OK);
        const bool can = !single && info.fp64 && strcmp(info.type, "CPU") == 0;
        assert_int_equal(numbers != NULL, can);
        if (numbers) {
            assert_true(numbers[0] == 3 && numbers[1] == 4);
            numbers[1] = 5;
            dmk_buffer_unmap(device, buffer, numbers);
            assert_int_equal(dmk_buffer_read(f->ctx, device, buffer, 0, sizeof there, there),
                             DMK_OK);
            assert_true(there[0] == 3 && there[1] == 5);
        }
        dmk_buffer_destroy(&buffer);
        dmk_device_destroy(&device);
    }
}

/* Transfers of nothing never reach the driver, which may refuse them, as PoCL 6 does. */
static void nothing_is_not_transferred(void **state)
{
    fixture *f = *state;
    dmk_device *device = NULL;
    dmk_buffer *buffer = NULL;
    double number = 3;
    assert_int_equal(dmk_device_open(f->ctx, NULL, &device), DMK_OK);
    assert_int_equal(dmk_buffer_create(f->ctx, device, sizeof number, &number, &buffer), DMK_OK);
    const dmk_device_work before = device->work;
    assert_int_equal(dmk_buffer_write(f->ctx, device, buffer, 0, 0, &number), DMK_OK);
    assert_int_equal(dmk_buffer_read(f->ctx, device, buffer, 0, 0, &number), DMK_OK);
    assert_memory_equal(&device->work, &before, sizeof before);
    dmk_buffer_destroy(&buffer);
    dmk_device_destroy(&device);
}

/* Messages of drivers that found no memory end with it: which messages, tests/test_environment.sh sees. */
static void a_bound_of_the_address_space_is_told(void **state)
{
    (void)state;
    struct rlimit before, bounded;
    assert_int_equal(getrlimit(RLIMIT_AS, &before), 0);
    bounded = before;
    bounded.rlim_cur = (rlim_t)1 << 46;
    if (before.rlim_cur == RLIM_INFINITY) assert_string_equal(dmk_space_hint(), "");
    if (before.rlim_max >= bounded.rlim_cur) {
        assert_int_equal(setrlimit(RLIMIT_AS, &bounded), 0);
        assert_non_null(strstr(dmk_space_hint(), "ulimit -v"));
        assert_int_equal(setrlimit(RLIMIT_AS, &before), 0);
    }
}

/* Whether the system was asked for huge pages at an address: 1, 0, or -1 where it does not tell. */
static int is_in_huge_pages(const void *address)
{
    char line[512];
    uintptr_t begin, end;
    bool here = false;
    int found = -1;
    FILE *maps = access("/sys/kernel/mm/transparent_hugepage", F_OK) == 0
                     ? fopen("/proc/self/smaps", "r")
                     : NULL;
    while (maps && found < 0 && fgets(line, sizeof line, maps)) {
        if (sscanf(line, "%" SCNxPTR "-%" SCNxPTR " ", &begin, &end) == 2)
            here = (uintptr_t)address >= begin && (uintptr_t)address < end;
        else if (here && strncmp(line, "VmFlags:", 8) == 0)
            found = strstr(line, " hg") != NULL;
    }
    if (maps) fclose(maps);
    return found;
}

/* Arrays of 24 MB and buffers of a CPU, with numbers or without; but not arrays of 9 MB. */
static void large_memory_lies_in_huge_pages(void **state)
{
    enum { SMALL = 9 << 20, LARGE = 24 << 20, N = LARGE / sizeof(double) };
    fixture *f = *state;
    char *small = NULL, *grown = NULL;
    double *numbers = NULL;
    dmk_device *device = NULL;
    assert_int_equal(DMK_NEW(f->ctx, small, SMALL), DMK_OK);
    assert_int_equal(DMK_NEW(f->ctx, numbers, N), DMK_OK);
    assert_int_equal(DMK_NEW_UNSET(f->ctx, grown, LARGE), DMK_OK);
    assert_int_equal(dmk_device_open(f->ctx, NULL, &device), DMK_OK);
    const int known = is_in_huge_pages(small + SMALL / 2);
    if (known < 0) print_message("huge pages: the system does not tell of them\n");
    assert_int_not_equal(known, 1);
    assert_true(known < 0 || is_in_huge_pages(numbers + N / 2));
    assert_true(known < 0 || is_in_huge_pages(grown + LARGE / 2));
    for (size_t i = 0; i < N; i++) numbers[i] = (double)i;
    for (int filled = 0; filled < 2; filled++) {
        dmk_buffer *buffer = NULL;
        double *there = NULL;
        assert_int_equal(dmk_buffer_create(f->ctx, device, LARGE, filled ? numbers : NULL, &buffer),
                         DMK_OK);
        assert_int_equal(dmk_buffer_map(f->ctx, device, buffer, N, &there), DMK_OK);
        bool same = true;
        for (size_t i = 0; there && i < N; i++) same &= there[i] == (filled ? numbers[i] : 0);
        assert_true(same);
        assert_true(known < 0 || !there || is_in_huge_pages(there + N / 2));
        if (there) dmk_buffer_unmap(device, buffer, there);
        dmk_buffer_destroy(&buffer);
    }
    dmk_device_destroy(&device);
    free(small);
    free(numbers);
    free(grown);
}

/* The default is a GPU, where there is one that computes in double precision. */
static void the_best_device(void **state)
{
    (void)state;
    const dmk_device_info some[] = {
        {.type = "accelerator", .fp64 = 1, .compute_units = 900},
        {.type = "CPU", .fp64 = 1, .compute_units = 64},
        {.type = "GPU", .fp64 = 0, .compute_units = 500},
        {.type = "GPU", .fp64 = 1, .compute_units = 20},
        {.type = "GPU", .fp64 = 1, .compute_units = 30},
        {.type = "GPU", .fp64 = 1, .compute_units = 30},
    };
    assert_int_equal(dmk_device_best(some, 6, NULL), 4);
    assert_int_equal(dmk_device_best(some, 4, NULL), 3);
    assert_int_equal(dmk_device_best(some, 3, NULL), 1);  /* not the GPU in single precision ... */
    assert_int_equal(dmk_device_best(some, 3, "gpu"), 2); /* ... but when it is asked for */
    assert_int_equal(dmk_device_best(some, 6, "cpu"), 1);
    assert_int_equal(dmk_device_best(some, 1, "GPU"), 1); /* none */
}

static void refuses(fixture *f, const char *select, const char *cache, const char *words)
{
    dmk_device *device = NULL;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.select = select;
    options.cache = cache;
    assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(f->ctx), words));
    assert_null(device);
}

/* Kernels would be compiled each time, and nobody told. */
static void a_file_is_no_cache(void **state)
{
    refuses(*state, NULL, "README.md", "'README.md' is not a folder");
}

/* As of many GPUs; the numbers of devices come first. */
static void a_name_may_be_a_number(void **state)
{
    fixture *f = *state;
    dmk_device_info list[8];
    size_t n = 0;
    assert_int_equal(dmk_device_list(f->ctx, list, 8, &n), DMK_OK);
    char number[24] = "";
    for (const char *p = list[0].name; *p && strtoul(number, NULL, 10) < n; p++)
        snprintf(number, sizeof number, "%.*s", (int)dmk_min_i(20, (int)strspn(p, "0123456789")),
                 p);
    if (strtoul(number, NULL, 10) < n) skip();
    dmk_device *device = NULL;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.select = number;
    assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
    dmk_device_destroy(&device);
    options.select = "12345678901";
    assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_E_DEVICE);
    char words[80] = "no device 12345678901: there is one, number 0";
    if (n != 1)
        snprintf(words, sizeof words, "no device 12345678901: there are %zu, numbered from 0", n);
    assert_string_equal(dmk_context_message(f->ctx), words);
}

/* Each device of the list is the one that its number opens; no more are told than there is room for. */
static void devices_are_listed(void **state)
{
    fixture *f = *state;
    dmk_device_info list[8] = {0}, info;
    size_t n = 0, same = 0;
    assert_int_equal(dmk_device_list(f->ctx, list, 8, &n), DMK_OK);
    assert_true(n > 0 && n <= 8);
    for (size_t i = 0; i < 8; i++)
        assert_int_equal(i < n, list[i].name[0] != '\0' && list[i].platform[0] != '\0');
    for (size_t i = 0; i < n; i++) {
        char number[24];
        dmk_device *device = NULL;
        dmk_device_options options;
        dmk_device_options_init(&options, sizeof options);
        snprintf(number, sizeof number, "%zu", i);
        options.select = number;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
        dmk_device_get_info(device, &info);
        assert_string_equal(info.name, list[i].name);
        assert_string_equal(info.type, list[i].type);
        assert_int_equal(info.compute_units, list[i].compute_units);
        dmk_device_destroy(&device);
    }
    memset(list, 0, sizeof list);
    assert_int_equal(dmk_device_list(f->ctx, list, n - 1, &same), DMK_OK);
    assert_int_equal(same, n);
    assert_int_equal(list[n - 1].name[0], '\0');
}

/* As users write it; each kind that is there. */
static void a_device_by_its_kind(void **state)
{
    static const char *const kind[2] = {"cpu", "gpu"};
    fixture *f = *state;
    dmk_device_info list[8];
    size_t n;
    int n_opened = 0;
    assert_int_equal(dmk_device_list(f->ctx, list, 8, &n), DMK_OK);
    for (int k = 0; k < 2; k++) {
        dmk_device_info info;
        dmk_device *device = NULL;
        dmk_device_options options;
        dmk_device_options_init(&options, sizeof options);
        options.select = kind[k];
        const bool there = dmk_device_best(list, n < 8 ? n : 8, kind[k]) < n;
        assert_int_equal(dmk_device_open(f->ctx, &options, &device), there ? DMK_OK : DMK_E_DEVICE);
        if (!there) continue;
        dmk_device_get_info(device, &info);
        assert_int_equal(strcasecmp(info.type, kind[k]), 0);
        dmk_device_destroy(&device);
        n_opened++;
    }
    assert_true(n_opened > 0);
}

/* As of a variable that is not set: part of every name, but none that was chosen. */
static void no_name_is_no_device(void **state)
{
    refuses(*state, "", NULL, "'' is no number of a device, nor part of a name");
}

/* A mesh that cannot fit is refused with what it needs and what there is. */
static void memory_is_looked_at_first(void **state)
{
    fixture *f = *state;
    dmk_device *device = NULL;
    dmk_device_info info;
    dmk_memory small, large;
    assert_int_equal(dmk_device_open(f->ctx, NULL, &device), DMK_OK);
    assert_int_equal(dmk_memory_check(f->ctx, device, 1000), DMK_OK);
    assert_int_equal(dmk_memory_check(f->ctx, device, INT64_C(100000000000)), DMK_E_NOMEM);
    /* On a CPU the host's and the device's together. */
    dmk_device_get_info(device, &info);
    assert_non_null(strstr(dmk_context_message(f->ctx),
                           strcmp(info.type, "CPU") == 0 ? "100000000000 triangles need about 69"
                                                         : "100000000000 triangles need about 47"));
    assert_non_null(strstr(dmk_context_message(f->ctx), "GB are available; use a coarser mesh"));
    dmk_solve_memory(1000, 1, &small);
    dmk_solve_memory(1000, 0, &large);
    assert_true(small.device < large.device);
    /* Exact distances take more, up to 450,000 triangles. */
    dmk_solve_memory(450000, 0, &small);
    dmk_solve_memory(450001, 0, &large);
    assert_true(small.host > large.host + 10000000);
    /* Needles take more in double precision. */
    static const double xyz[] = {0, 0, 0, 1, 0, 0, 1, 0.05, 0, 0, 0.05, 0};
    static const int32_t triangle[] = {0, 1, 2, 0, 2, 3};
    dmk_mesh *strip = NULL;
    dmk_solver *solver = NULL;
    dmk_memory plain, of[2];
    assert_int_equal(dmk_mesh_create(f->ctx, 4, xyz, 2, triangle, &strip), DMK_OK);
    for (int single = 0; single < 2; single++) {
        dmk_solve_memory(2, single, &plain);
        dmk_mesh_memory(strip, single, &of[single]);
        assert_int_equal(of[single].device, plain.device);
        assert_int_equal(of[single].host, plain.host + (single ? 0 : 3000));
    }
    /* Of which nothing is known without edges. */
    dmk_mesh_forget_edges(strip);
    assert_int_equal(dmk_solver_create(f->ctx, device, strip, &solver), DMK_E_ARG);
    assert_null(solver);
    dmk_mesh_memory(strip, 0, &of[0]);
    assert_true(of[0].host == plain.host && of[0].device > plain.device);
    assert_int_equal(dmk_memory_check_needles(f->ctx, 1000), DMK_OK);
    assert_int_equal(dmk_memory_check_needles(f->ctx, INT64_C(100000000000)), DMK_E_NOMEM);
    assert_non_null(strstr(dmk_context_message(f->ctx),
                           "100000000000 triangles, many of them needles, need about 150000.0 GB"));
    assert_non_null(strstr(dmk_context_message(f->ctx), "single precision"));
    dmk_mesh_destroy(&strip);
    dmk_device_destroy(&device);
}

/* ---- what a Newton step asks of the device ---------------------------------------------------- */

enum { MOST_STEPS = 32 };

typedef struct steps {
    const dmk_device *device;
    dmk_device_work at[MOST_STEPS]; /* when step k was reported */
    int cg[MOST_STEPS], n;
} steps;

static int count_step(const dmk_progress *progress, void *user)
{
    steps *s = user;
    if (progress->step > 0 && s->n < MOST_STEPS) {
        s->cg[s->n] = progress->cg_iterations;
        s->at[s->n++] = dmk_device_get_work(s->device);
    }
    return 0;
}

/* Of a launch a large GPU knows mostly the 5 microseconds that it takes, and a read stops it. For an iteration of CG
 * there are 3 launches, 8 for T/2 and the way down to T and up, 3 for T, 3 for each level between that and the tail,
 * 1 for the tail; in the CPU shape one more for T and for each of these levels. 6, and 1 for each of them, for all
 * else in a step. */
static void count_launches(fixture *f, dmk_shape shape, size_t n_triangles, int n_large)
{
    const int each = shape == DMK_SHAPE_CPU ? 4 : 3;
    steps s = {.n = 0};
    dmk_mesh *mesh = NULL;
    dmk_device *device = NULL;
    dmk_solver *solver = NULL;
    dmk_result *result = NULL;
    dmk_point source;
    dmk_stats stats;
    dmk_device_options options;
    dmk_surface_options surface;
    dmk_device_options_init(&options, sizeof options);
    dmk_surface_options_init(&surface, sizeof surface);
    surface.name = "ellipsoid";
    surface.n_triangles = n_triangles;
    surface.refine = 1;
    options.shape = shape;
    assert_int_equal(dmk_mesh_surface(f->ctx, &surface, &mesh), DMK_OK);
    assert_int_equal(dmk_mesh_vertex_point(f->ctx, mesh, 0, &source), DMK_OK);
    assert_int_equal(dmk_device_open(f->ctx, &options, &device), DMK_OK);
    assert_int_equal(dmk_solver_create(f->ctx, device, mesh, &solver), DMK_OK);
    s.device = device;
    dmk_context_set_progress(f->ctx, count_step, &s);
    assert_int_equal(dmk_solve(f->ctx, solver, &source, NULL, &result), DMK_OK);
    dmk_context_set_progress(f->ctx, NULL, NULL);
    dmk_result_get_stats(result, &stats);
    assert_in_range(stats.levels, 4, 8);
    assert_in_range(s.n, 3, MOST_STEPS);
    for (int k = 1; k < s.n; k++) {
        const dmk_device_work *a = &s.at[k - 1], *b = &s.at[k];
        const int launches = s.cg[k] * (3 + 8 + each + each * n_large + 1) + 6 + n_large;
        print_message("# step %d: %lld launches, %lld reads, %lld writes\n", k + 1,
                      (long long)(b->launches - a->launches), (long long)(b->reads - a->reads),
                      (long long)(b->writes - a->writes));
        assert_int_equal(b->launches - a->launches, launches);
        assert_int_equal(b->reads - a->reads, 1);
        assert_int_equal(b->writes - a->writes, 0); /* no inverse by the host */
    }
    dmk_result_destroy(&result);
    dmk_solver_destroy(&solver);
    dmk_device_destroy(&device);
    dmk_mesh_destroy(&mesh);
}

static void launches_of_a_step(void **state)
{
    /* The level below T has some 1,000 rows; 3,000 and 6,000, on both sides of the tail's line. */
    static const size_t n[3] = {3000, 9000, 18000};
    for (int i = 0; i < 3; i++) {
        count_launches(*state, DMK_SHAPE_CPU, n[i], i == 2);
        count_launches(*state, DMK_SHAPE_GPU, n[i], i == 2);
    }
}

#ifdef __SANITIZE_ADDRESS__
/* The leak checker crashes on the way in which PoCL's threads of a part of a device end here (signal 11 in
 * the checker's own thread). Other tests look for leaks of devices. */
const char *__asan_default_options(void);
const char *__asan_default_options(void)
{
    return "detect_leaks=0";
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {TEST(opened_by_many_at_once),
                                       TEST(launches_are_equally_wide),
                                       TEST(destroyed_with_work_under_way),
                                       TEST(built_in_the_background),
                                       TEST(mapped),
                                       TEST(nothing_is_not_transferred),
                                       TEST(a_bound_of_the_address_space_is_told),
                                       TEST(built_once_where_they_are_the_same),
                                       TEST(large_memory_lies_in_huge_pages),
                                       TEST(the_best_device),
                                       TEST(a_name_may_be_a_number),
                                       TEST(devices_are_listed),
                                       TEST(a_file_is_no_cache),
                                       TEST(a_device_by_its_kind),
                                       TEST(no_name_is_no_device),
                                       TEST(launches_of_a_step),
                                       TEST(memory_is_looked_at_first)};
    return cmocka_run_group_tests_name("device", tests, NULL, NULL);
}
