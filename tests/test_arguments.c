/* Each public function with each of its arguments wrong in turn: DMK_E_ARG with a message, never a
 * crash. arguments.awk makes the calls from the header, so that a new function is tried as well. */
#include "base/base.h"
#include "solving.h"

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

static struct {
    bench b;
    problem p;
    dmk_locus *locus;
    dmk_geodesics *geodesics;
    dmk_transport *transport;
    dmk_pieces *pieces;  /* one, of a tetrahedron */
    dmk_measure measure; /* atoms at two vertices */
    dmk_point atoms[2];
    double atom_mass[2];
    dmk_path path;
    dmk_result_data data;
    char file[300];
    long scratch[1000]; /* for what is filled */
    void *none;         /* for objects that a call makes: it must stay NULL */
} good;

/* Ranks that nobody asks. */
static int no_exchange(void *user, const void *const *send, const size_t *send_bytes,
                       void *const *receive, const size_t *receive_bytes)
{
    (void)user, (void)send, (void)send_bytes, (void)receive, (void)receive_bytes;
    return 1;
}

static int no_gather(void *user, const void *mine, void *all, const size_t *bytes)
{
    (void)user, (void)mine, (void)all, (void)bytes;
    return 1;
}

static int no_largest(void *user, int32_t *value, size_t n)
{
    (void)user, (void)value, (void)n;
    return 1;
}

/* Ranks that are one, for pieces. */
static int only_gather(void *user, const void *mine, void *all, const size_t *bytes)
{
    (void)user;
    if (*bytes > 0) memcpy(all, mine, *bytes);
    return 0;
}

static int only_exchange(void *user, const void *const *send, const size_t *send_bytes,
                         void *const *receive, const size_t *receive_bytes)
{
    (void)user, (void)send, (void)send_bytes, (void)receive, (void)receive_bytes;
    return 0;
}

static int only_largest(void *user, int32_t *value, size_t n)
{
    (void)user, (void)value, (void)n;
    return 0;
}

static const dmk_ranks only = {
    .size = 1, .exchange = only_exchange, .gather = only_gather, .largest = only_largest};

#define ALONE .exchange = no_exchange, .gather = no_gather, .largest = no_largest
static const dmk_ranks alone = {.size = 1, ALONE};

#define SIZED(name) .struct_size = sizeof(dmk_##name##_options)

/* ---- right values, by type ---- */

#define good_dmk_context_p good.b.ctx
#define good_dmk_context_pp (void *)&good.none
#define good_dmk_mesh_p good.p.mesh
#define good_dmk_mesh_pp (void *)&good.none
#define good_dmk_repairs_p (void *)good.scratch
#define good_dmk_mesh_info_p (void *)good.scratch
#define good_dmk_point_p &good.p.source
#define fresh_dmk_point_p (void *)good.scratch
#define good_dmk_surface_options_p                                                                 \
    &(dmk_surface_options)                                                                         \
    {                                                                                              \
        SIZED(surface), .name = "sphere"                                                           \
    }
#define good_dmk_device_p good.b.dev
#define good_dmk_device_pp (void *)&good.none
#define good_dmk_device_info_p (void *)good.scratch
#define good_dmk_device_options_p                                                                  \
    &(dmk_device_options)                                                                          \
    {                                                                                              \
        SIZED(device)                                                                              \
    }
#define good_dmk_machine_info_p (void *)good.scratch
#define good_dmk_solver_p good.p.solver
#define good_dmk_solver_pp (void *)&good.none
#define good_dmk_solve_options_p &good.p.options
#define good_dmk_result_p good.p.result
#define good_dmk_result_pp (void *)&good.none
#define good_dmk_result_data_p &good.data
#define good_dmk_memory_p (void *)good.scratch
#define good_dmk_stats_p (void *)good.scratch
#define good_dmk_locus_p good.locus
#define good_dmk_locus_pp (void *)&good.none
#define good_dmk_locus_info_p (void *)good.scratch
#define good_dmk_locus_options_p                                                                   \
    &(dmk_locus_options)                                                                           \
    {                                                                                              \
        SIZED(locus)                                                                               \
    }
#define good_dmk_geodesics_p good.geodesics
#define good_dmk_geodesics_pp (void *)&good.none
#define good_dmk_geodesics_info_p (void *)good.scratch
#define good_dmk_value_p (void *)good.scratch
#define good_dmk_geodesics_options_p                                                               \
    &(dmk_geodesics_options)                                                                       \
    {                                                                                              \
        SIZED(geodesics)                                                                           \
    }
#define good_dmk_transport_p good.transport
#define good_dmk_transport_pp (void *)&good.none
#define good_dmk_transport_info_p (void *)good.scratch
#define good_dmk_measure_p &good.measure
#define good_dmk_path_p &good.path
#define fresh_dmk_path_p (void *)good.scratch
#define good_dmk_format_info_p (void *)good.scratch
#define good_dmk_progress_fn NULL
#define good_dmk_ranks_p &alone
#define good_dmk_pieces_p good.pieces
#define good_dmk_pieces_pp (void *)&good.none
#define good_dmk_traffic_p (void *)good.scratch
#define good_void_p NULL
#define good_char_p good.file
#define good_double_p (double *)(void *)good.scratch
#define good_double_pp (void *)&good.none
#define good_int32_t_p (int32_t *)(void *)good.scratch
#define good_int32_t_pp (void *)&good.none
#define good_int64_t_p (int64_t *)(void *)good.scratch
#define good_size_t_p (size_t *)(void *)good.scratch
#define good_int_p (int *)(void *)good.scratch
#define good_size_t 0
#define good_n_points 1
#define good_n_sources 1
#define good_int64_t 0
#define good_int 0

/* ---- wrong values other than NULL ---- */

static const dmk_point wrong_dmk_point_p[] = {
    {-1, {1, 0, 0}},      {INT64_MAX, {1, 0, 0}}, {INT32_MAX, {1, 0, 0}},
    {0, {0, 0, 0}},       {0, {2, -1, 0}},        {0, {0, 0, 2}},
    {0, {NAN, 0.5, 0.5}}, {0, {1, 0, 1e-6}},      {0, {INFINITY, 0, 0}},
};
static const dmk_surface_options wrong_dmk_surface_options_p[] = {
    {.struct_size = 0},
    {.struct_size = sizeof(size_t)},
    {.struct_size = sizeof(dmk_surface_options) + 1},
    {.struct_size = SIZE_MAX & ~(size_t)7},
    {SIZED(surface), .name = NULL},
    {SIZED(surface), .name = ""},
    {SIZED(surface), .name = "cube"},
    {SIZED(surface), .name = "torus", .size = {NAN}},
    {SIZED(surface), .name = "torus", .size = {-1}},
    {SIZED(surface), .name = "torus", .size = {1, 2}},
    {SIZED(surface), .name = "sphere", .size = {INFINITY}},
    {SIZED(surface), .name = "sphere", .size = {1, 1}},
    {SIZED(surface), .name = "sphere", .refine = -1},
    {SIZED(surface), .name = "sphere", .refine = 13},
    {SIZED(surface), .name = "sphere", .refine = INT32_MAX},
    {SIZED(surface), .name = "sphere", .n_triangles = 1},
    {SIZED(surface), .name = "sphere", .n_triangles = SIZE_MAX},
    {SIZED(surface), .name = "sphere", .has_source = 1, .source = {NAN}},
    {SIZED(surface), .name = "sphere", .has_source = 1, .source = {0, 0, 0}},
};
static const dmk_device_options wrong_dmk_device_options_p[] = {
    {.struct_size = 0},
    {.struct_size = sizeof(size_t)},
    {.struct_size = sizeof(dmk_device_options) + 1},
    {.struct_size = SIZE_MAX & ~(size_t)7},
    {SIZED(device), .threads = -5},
    {SIZED(device), .threads = INT32_MIN},
    {SIZED(device), .shape = (dmk_shape)9},
    {SIZED(device), .shape = (dmk_shape)-1},
};
static const dmk_solve_options wrong_dmk_solve_options_p[] = {
    {.struct_size = 0},
    {.struct_size = sizeof(size_t)},
    {.struct_size = sizeof(dmk_solve_options) + 1},
    {.struct_size = SIZE_MAX & ~(size_t)7},
    {SIZED(solve), .method = (dmk_method)77},
    {SIZED(solve), .method = (dmk_method)-1},
    {SIZED(solve), .start = (dmk_start)99},
    {SIZED(solve), .start = (dmk_start)-1},
    {SIZED(solve), .dt = -0.1},
    {SIZED(solve), .dt = 1.1},
    {SIZED(solve), .dt = NAN},
    {SIZED(solve), .inertia = 1},
    {SIZED(solve), .inertia = NAN},
    {SIZED(solve), .tolerance = INFINITY},
    {SIZED(solve), .tolerance = -1},
    {SIZED(solve), .tolerance = NAN},
    {SIZED(solve), .tolerance = 1.1},
    {SIZED(solve), .gap_tolerance = -1},
    {SIZED(solve), .gap_tolerance = NAN},
    {SIZED(solve), .gap_tolerance = 1.1},
    {SIZED(solve), .cg_tolerance = -1},
    {SIZED(solve), .cg_tolerance = INFINITY},
    {SIZED(solve), .cg_tolerance = 1.1},
    {SIZED(solve), .max_steps = -1},
    {SIZED(solve), .threshold = -1},
    {SIZED(solve), .threshold = NAN},
    {SIZED(solve), .threshold = INFINITY},
};
static const dmk_locus_options wrong_dmk_locus_options_p[] = {
    {.struct_size = 0},
    {.struct_size = sizeof(size_t)},
    {.struct_size = sizeof(dmk_locus_options) + 1},
    {.struct_size = SIZE_MAX & ~(size_t)7},
    {SIZED(locus), .strength = NAN},
    {SIZED(locus), .strength = -1},
    {SIZED(locus), .strength = INFINITY}};
static const double wrong_offset[] = {-1};
static const int32_t no_edge[] = {0, INT32_MAX};
static const dmk_geodesics_options wrong_dmk_geodesics_options_p[] = {
    {.struct_size = 0},
    {.struct_size = sizeof(size_t)},
    {.struct_size = sizeof(dmk_geodesics_options) + 1},
    {.struct_size = SIZE_MAX & ~(size_t)7},
    {SIZED(geodesics), .offset = wrong_offset},
    {SIZED(geodesics), .tolerance = NAN},
    {SIZED(geodesics), .tolerance = -1},
    {SIZED(geodesics), .tolerance = 1},
    {SIZED(geodesics), .n_lines = 1, .line = NULL},
    {SIZED(geodesics), .n_lines = 1, .line = no_edge},
};
static const dmk_point an_atom[] = {{0, {1, 0, 0}}}, no_atom[] = {{-1, {1, 0, 0}}};
static const double a_mass[] = {1}, no_mass[] = {0}, bad_mass[] = {NAN};
static const int32_t short_line[] = {0, 1};
static const dmk_measure wrong_dmk_measure_p[] = {
    {.n_atoms = 1},
    {.n_atoms = 1, .atoms = no_atom, .atom_mass = a_mass},
    {.n_atoms = 1, .atoms = an_atom, .atom_mass = no_mass},
    {.n_atoms = 1, .atoms = an_atom, .atom_mass = bad_mass},
    {.n_lines = 1, .line_first = short_line, .line_points = an_atom},
    {.n_lines = 1},
    {.uniform = NAN},
    {.uniform = 3}, /* another mass than the other one's */
};
static const dmk_ranks wrong_dmk_ranks_p[] = {
    {.size = 0, ALONE},
    {.size = -1, ALONE},
    {.size = 2, .rank = 2, ALONE},
    {.size = 2, .rank = -1, ALONE},
    {.size = 1, .gather_below = -1, ALONE},
    {.size = 1, .exchange = no_exchange, .gather = no_gather},
};
static const int wrong_int[] = {-1, INT32_MIN};
/* As many as the plane of the mesh asks for: a call may read them all. */
static const double wrong_double_p[][4096] = {{NAN}, {0, INFINITY}, {0, 0, -INFINITY}};
static const int64_t wrong_int64_t[] = {-1, INT64_MIN, INT64_MAX, INT32_MAX};
static const size_t wrong_size_t[] = {SIZE_MAX, SIZE_MAX / 2, (size_t)1 << 40};

/* ---- what may be so ---- */

/* The header says that these may be NULL, though not wrong; or, behind the "", the caller gives no size of
 * them. */
static bool may_be(const char *function, const char *argument, bool null)
{
    static const char *const list[] = {
        "dmk_context_set_progress fn",
        "dmk_context_set_progress user",
        "dmk_context_set_format format",
        "dmk_device_list infos",
        "dmk_solve options",
        "dmk_solve_measures options",
        "dmk_solve_measures to",
        "dmk_solver_create device",
        "dmk_solver_set_ranks ranks",
        "dmk_mesh_read_dealt ranks",
        "dmk_pieces_read ranks",
        "dmk_device_open options",
        "dmk_locus_compute options",
        "dmk_geodesics_locus options",
        "dmk_geodesics_cut options",
        "dmk_geodesics_cut origin",
        "dmk_geodesics_cut plane",
        "dmk_geodesics_cut locus",
        "dmk_cut options",
        "dmk_cut origin",
        "dmk_mesh_repair repair",
        "dmk_mesh_read_repaired repair",
        "dmk_cut plane",
        "dmk_geodesics_create options",
        "",
        /* Lengths of the caller's arrays, and xyz where the mesh is looked at later. */
        "dmk_device_list capacity",
        "dmk_cut_write plane",
        "dmk_mesh_repair n_vertices",
        "dmk_mesh_repair n_triangles",
        "dmk_mesh_repair xyz",
        "dmk_path_compute n_points",
        "dmk_geodesics_at n_points",
        "dmk_geodesics_paths n_points",
        "dmk_geodesics_create n_sources",
        "dmk_mesh_create xyz",
        "dmk_pieces_create xyz",
        /* Masses of 0, and those that differ, are found by the transport: the rest is the same call's. */
        "dmk_measures_check from",
        "dmk_measures_check to",
    };
    char both[200];
    snprintf(both, sizeof both, "%s %s", function, argument);
    for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
        if (!*list[i]) null = true;
        if (null && strcmp(both, list[i]) == 0) return true;
    }
    return false;
}

/* ---- the calls ---- */

static int n_calls, n_bad;
static sigjmp_buf crashed;

static void on_crash(int number)
{
    siglongjmp(crashed, number);
}

static void complain(const char *function, const char *argument, size_t index, const char *what)
{
    print_error("%s, argument %s, value %zu: %s\n", function, argument, index, what);
    n_bad++;
}

static void check_status(const char *function, const char *argument, size_t index, bool null,
                         int status)
{
    char name[64];
    const char *message = dmk_context_message(good.b.ctx);
    snprintf(name, sizeof name, "`%s`", argument);
    const bool too_many =
        !null && (strcmp(function, "dmk_mesh_create") == 0 || /* for any mesh */
                  (strcmp(function, "dmk_pieces_create") == 0 && *argument == 'n'));
    if (status != (too_many ? DMK_E_MESH : DMK_E_ARG))
        complain(function, argument, index, "another status than DMK_E_ARG");
    if (strcmp(argument, "context") == 0 || strcmp(function, "dmk_format_get") == 0) return;
    if (strcmp(function, "dmk_context_create") == 0) return;
    if (!*message) complain(function, argument, index, "no message");
    if (null && !strstr(message, name)) complain(function, argument, index, message);
    if (good.none) complain(function, argument, index, "something was made");
}

/* The call for index 0 to n - 1 of its list of wrong values, or once with NULL. */
#define TRY(function, argument, n, null, ...)                                                      \
    for (volatile size_t index = 0; index < (n); index++) {                                        \
        if (may_be(#function, #argument, null)) break;                                             \
        const int number = sigsetjmp(crashed, 1);                                                  \
        n_calls++;                                                                                 \
        if (number == 0) {                                                                         \
            __VA_ARGS__                                                                            \
        } else {                                                                                   \
            complain(#function, #argument, index, strsignal(number));                              \
        }                                                                                          \
    }
#define STATUS(function, argument, n, null, call)                                                  \
    TRY(function, argument, n, null, {                                                             \
        good.none = NULL;                                                                          \
        dmk_fail(good.b.ctx, 0, "%s", "");                                                         \
        check_status(#function, #argument, index, null, (function)call);                           \
    })
#define POINTER(function, argument, n, null, call)                                                 \
    TRY(function, argument, n, null, {                                                             \
        const void *pointer = (function)call;                                                      \
        if (null && pointer && strcmp(#argument, "n") != 0 && strcmp(#argument, "offset") != 0) {  \
            check_text(#function, #argument, pointer);                                             \
        }                                                                                          \
    })
#define NOTHING(function, argument, n, null, call)                                                 \
    TRY(function, argument, n, null, { (function) call; })
#define UNKNOWN(function, type)                                                                    \
    complain(#function, #type, 0, "good_TYPE is missing in test_arguments.c");

/* Of what is not there nothing is given but a text. */
static void check_text(const char *function, const char *argument, const char *text)
{
    if (strcmp(function, "dmk_context_message") != 0 || !*text) {
        complain(function, argument, 0, "something of nothing");
    }
}

static void wrong_arguments_are_refused(void **state)
{
    (void)state;
    const struct sigaction action = {.sa_handler = on_crash, .sa_flags = SA_NODEFER};
    struct sigaction before[2];
    sigaction(SIGSEGV, &action, &before[0]);
    sigaction(SIGFPE, &action, &before[1]);
#include "arguments.h"
    sigaction(SIGSEGV, &before[0], NULL);
    sigaction(SIGFPE, &before[1], NULL);
    print_message("%d calls\n", n_calls);
    assert_true(n_calls > 150);
    assert_int_equal(n_bad, 0);
}

/* ---- the rest of what the header says of arguments ---- */

static void options_may_be_missing(void **state)
{
    (void)state;
    problem *p = &good.p;
    dmk_device *device = NULL;
    dmk_result *result = NULL;
    dmk_locus *locus = NULL, *of_set = NULL;
    dmk_mesh *cut = NULL;
    dmk_geodesics *geodesics = NULL;
    bench_ok(&good.b, dmk_device_open(good.b.ctx, NULL, &device));
    bench_ok(&good.b, dmk_solve(good.b.ctx, p->solver, &p->source, NULL, &result));
    bench_ok(&good.b, dmk_locus_compute(good.b.ctx, p->mesh, result, NULL, &locus));
    bench_ok(&good.b, dmk_geodesics_create(good.b.ctx, p->mesh, 1, &p->source, NULL, &geodesics));
    bench_ok(&good.b, dmk_geodesics_locus(good.b.ctx, geodesics, NULL, &of_set));
    bench_ok(&good.b, dmk_cut(good.b.ctx, p->mesh, result, NULL, &cut, NULL, NULL));
    assert_memory_equal(dmk_result_density(result, NULL), problem_mu(p),
                        problem_triangles(p) * sizeof(double));
    dmk_mesh_destroy(&cut);
    bench_ok(&good.b, dmk_geodesics_cut(good.b.ctx, geodesics, NULL, &cut, NULL, NULL, NULL));
    dmk_mesh_destroy(&cut);
    dmk_geodesics_destroy(&geodesics);
    dmk_locus_destroy(&locus);
    dmk_locus_destroy(&of_set);
    dmk_result_destroy(&result);
    dmk_device_destroy(&device);
    size_t n = 0;
    bench_ok(&good.b, dmk_device_list(good.b.ctx, NULL, 0, &n));
    assert_true(n > 0);
    bench_ok(&good.b, dmk_path_compute(good.b.ctx, p->mesh, p->result, 0, &p->source, &good.path));
}

/* Programs compiled against an older header, with fewer members, and a newer one, with more. */
static void option_structs_may_be_older_and_newer(void **state)
{
    (void)state;
    struct {
        dmk_solve_options known;
        double more[2];
    } newer;
    union {
        dmk_solve_options all;
        unsigned char bytes[sizeof(dmk_solve_options)];
    } older;
    const size_t end = offsetof(dmk_solve_options, inertia);
    dmk_result *result = NULL;
    memset(&older, 0x55, sizeof older);
    dmk_solve_options_init(&older.all, end);
    assert_int_equal(older.all.struct_size, end);
    assert_int_equal(older.bytes[end], 0x55);
    bench_ok(&good.b, dmk_solve(good.b.ctx, good.p.solver, &good.p.source, &older.all, &result));
    dmk_result_destroy(&result);

    dmk_solve_options_init(&newer.known, sizeof newer);
    assert_int_equal(newer.known.struct_size, sizeof newer);
    assert_true(newer.known.inertia < 0 && newer.more[1] == 0);
    bench_ok(&good.b, dmk_solve(good.b.ctx, good.p.solver, &good.p.source, &newer.known, &result));
    dmk_result_destroy(&result);
    newer.more[1] = 1;
    assert_int_equal(dmk_solve(good.b.ctx, good.p.solver, &good.p.source, &newer.known, &result),
                     DMK_E_ARG);
    assert_non_null(strstr(dmk_context_message(good.b.ctx), "newer dmkcl.h"));
    assert_null(result);
}

static void nothing_may_be_destroyed(void **state)
{
    (void)state;
    void *none = NULL;
    dmk_context_destroy((dmk_context **)&none);
    dmk_mesh_destroy((dmk_mesh **)&none);
    dmk_device_destroy((dmk_device **)&none);
    dmk_solver_destroy((dmk_solver **)&none);
    dmk_result_destroy((dmk_result **)&none);
    dmk_locus_destroy((dmk_locus **)&none);
    dmk_geodesics_destroy((dmk_geodesics **)&none);
    dmk_path_free(&(dmk_path){0});
    assert_null(none);
}

/* Accessors give zeros for NULL. */
#define ZEROS(get, type)                                                                           \
    do {                                                                                           \
        static const type zero;                                                                    \
        type found;                                                                                \
        memset(&found, 0x55, sizeof found);                                                        \
        get;                                                                                       \
        assert_memory_equal(&found, &zero, sizeof found);                                          \
    } while (0)

static void nothing_has_zeros(void **state)
{
    (void)state;
    ZEROS(dmk_mesh_get_info(NULL, &found), dmk_mesh_info);
    ZEROS(dmk_device_get_info(NULL, &found), dmk_device_info);
    ZEROS(dmk_geodesics_get_info(NULL, &found), dmk_geodesics_info);
    ZEROS(dmk_mesh_memory(NULL, 0, &found), dmk_memory);
    ZEROS(dmk_result_get_stats(NULL, &found), dmk_stats);
    ZEROS(dmk_transport_get_stats(NULL, &found), dmk_stats);
    ZEROS(dmk_transport_get_info(NULL, &found), dmk_transport_info);
    ZEROS(dmk_solver_get_traffic(NULL, &found), dmk_traffic);
    ZEROS(dmk_pieces_get_info(NULL, &found), dmk_mesh_info);
    ZEROS(dmk_locus_get_info(NULL, &found), dmk_locus_info);
}

/* ---- forks ---- */

/* Exit status of `work` in a forked child; 99: it has not ended within 20 s. */
static int in_child(int (*work)(void))
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        alarm(20); /* ends the child */
        _exit(work());
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 99;
}

static int refused(int rc)
{
    return rc == DMK_E_DEVICE && strstr(dmk_context_message(good.b.ctx), "fork") ? 0 : 1;
}

static int child_solves(void)
{
    dmk_result *result = NULL;
    return refused(dmk_solve(good.b.ctx, good.p.solver, &good.p.source, NULL, &result)) || result;
}

static int child_transports(void)
{
    dmk_transport *transport = NULL;
    const dmk_measure even = {.uniform = 1}, at = {.n_atoms = 1, .atoms = &good.p.source};
    return refused(dmk_solve_measures(good.b.ctx, good.p.solver, &even, &at, NULL, &transport)) ||
           transport;
}

static int child_makes_solver(void)
{
    dmk_solver *solver = NULL;
    return refused(dmk_solver_create(good.b.ctx, good.b.dev, good.p.mesh, &solver)) || solver;
}

static int child_opens(void)
{
    dmk_device *device = NULL;
    size_t n;
    return refused(dmk_device_open(good.b.ctx, NULL, &device)) || device ||
           refused(dmk_device_list(good.b.ctx, NULL, 0, &n));
}

static int child_gives_back(void)
{
    dmk_solver_destroy(&good.p.solver);
    dmk_device_destroy(&good.b.dev);
    dmk_context_destroy(&good.b.ctx);
    return 0;
}

static int child_reads_and_writes(void)
{
    dmk_mesh *mesh = NULL;
    dmk_locus *locus = NULL;
    int rc = dmk_mesh_read(good.b.ctx, good.file, &mesh);
    if (rc == DMK_OK) rc = dmk_locus_compute(good.b.ctx, good.p.mesh, good.p.result, NULL, &locus);
    if (rc == DMK_OK) rc = dmk_mesh_write(good.b.ctx, mesh, good.file);
    dmk_locus_destroy(&locus);
    dmk_mesh_destroy(&mesh);
    return rc != DMK_OK;
}

static void a_forked_child_has_no_device(void **state)
{
    (void)state;
    assert_int_equal(in_child(child_solves), 0);
    assert_int_equal(in_child(child_transports), 0);
    assert_int_equal(in_child(child_makes_solver), 0);
    assert_int_equal(in_child(child_opens), 0);
    assert_int_equal(in_child(child_gives_back), 0);
    assert_int_equal(in_child(child_reads_and_writes), 0);
    problem_solve(&good.p); /* nothing has happened here */
}

/* ---- the objects ---- */

static int setup(void **state)
{
    (void)state;
    const char *folder = getenv("TMPDIR");
    bench_open(&good.b, NULL);
    good.p = problem_file(&good.b, "tests/data/sphere_1280.off");
    problem_solve(&good.p);
    good.data = result_data(good.p.result);
    dmk_point end = {7, {0.5, 0.25, 0.25}};
    bench_ok(&good.b, dmk_locus_compute(good.b.ctx, good.p.mesh, good.p.result, NULL, &good.locus));
    bench_ok(&good.b, dmk_geodesics_create(good.b.ctx, good.p.mesh, 1, &good.p.source, NULL,
                                           &good.geodesics));
    good.measure = (dmk_measure){.n_atoms = 2, .atoms = good.atoms, .atom_mass = good.atom_mass};
    bench_ok(&good.b, dmk_mesh_vertex_point(good.b.ctx, good.p.mesh, 0, &good.atoms[0]));
    bench_ok(&good.b, dmk_mesh_vertex_point(good.b.ctx, good.p.mesh, 100, &good.atoms[1]));
    good.atom_mass[0] = 1;
    good.atom_mass[1] = -1;
    static const double corner[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    static const int64_t face[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    bench_ok(&good.b, dmk_pieces_create(good.b.ctx, &only, 4, corner, 4, face, &good.pieces));
    bench_ok(&good.b, dmk_solve_measures(good.b.ctx, good.p.solver, &good.measure, NULL, NULL,
                                         &good.transport));
    good.atom_mass[1] = 1;
    bench_ok(&good.b,
             dmk_path_compute(good.b.ctx, good.p.mesh, good.p.result, 1, &end, &good.path));
    snprintf(good.file, sizeof good.file, "%s/arguments-%ld.vtp", folder ? folder : "/tmp",
             (long)getpid());
    bench_ok(&good.b, dmk_mesh_write(good.b.ctx, good.p.mesh, good.file));
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    unlink(good.file);
    dmk_path_free(&good.path);
    dmk_geodesics_destroy(&good.geodesics);
    dmk_transport_destroy(&good.transport);
    dmk_pieces_destroy(&good.pieces);
    dmk_locus_destroy(&good.locus);
    problem_free(&good.p);
    bench_close(&good.b);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_arguments_are_refused),
        cmocka_unit_test(options_may_be_missing),
        cmocka_unit_test(option_structs_may_be_older_and_newer),
        cmocka_unit_test(nothing_may_be_destroyed),
        cmocka_unit_test(nothing_has_zeros),
        cmocka_unit_test(a_forked_child_has_no_device),
    };
    return cmocka_run_group_tests_name("arguments", tests, setup, teardown);
}
