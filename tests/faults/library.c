/* The library under faults: every allocation, every call for files and every OpenCL call fails in turn.
 * usage: library STRIDE    1: each call; N: about every N-th, other ones in each scenario
 * After each failure: a status that fits with a message, or a result as without it; nothing kept;
 * nothing half-written; and the device, the solver and the mesh as good as before. */
#include "faults.h"

#include "dmkcl.h"

#include <CL/cl.h>
#include <dirent.h>
#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static dmk_context *ctx;
static dmk_mesh *mesh;
static dmk_device *device;
static dmk_solver *solver;
static char folder[200], file[7][260];
static const char *const names[7] = {"mesh.off",  "mesh.ply",  "result.vtp", "result.vtu",
                                     "locus.obj", "locus.vtp", "locus.csv"};

static long tried, failed;

/* ---- a digest of what a scenario gives ---- */

static uint64_t digest(uint64_t h, const void *data, size_t n)
{
    const unsigned char *p = data;
    for (size_t i = 0; i < n; i++) h = (h ^ p[i]) * 0x100000001b3ULL;
    return h;
}

static uint64_t digest_file(uint64_t h, const char *path)
{
    unsigned char part[4096];
    size_t n;
    FILE *f = fopen(path, "rb");
    if (!f) return h;
    while ((n = fread(part, 1, sizeof part, f)) > 0) h = digest(h, part, n);
    fclose(f);
    return h;
}

static uint64_t digest_result(const dmk_result *r)
{
    size_t n;
    uint64_t h = 1;
    const double *x = dmk_result_density(r, &n);
    h = digest(h, x, n * sizeof *x);
    x = dmk_result_distance(r, &n);
    h = digest(h, x, n * sizeof *x);
    x = dmk_result_potential_mid(r, &n);
    return digest(h, x, n * sizeof *x);
}

/* ---- scenarios: a status, and the digest if it is DMK_OK ---- */

#define TRY(call)                                                                                  \
    if ((rc = (call)) != DMK_OK) goto done

static int read_gzip(uint64_t *h)
{
    int rc;
    dmk_mesh *m = NULL;
    dmk_mesh_info info;
    TRY(dmk_mesh_read(ctx, "tests/data/torus_5440.off.gz", &m));
    dmk_mesh_get_info(m, &info);
    *h = digest(1, dmk_mesh_vertices(m), 3 * info.n_vertices * sizeof(double));
done:
    dmk_mesh_destroy(&m);
    return rc;
}

static int read_back(const char *path, uint64_t *h)
{
    int rc;
    dmk_mesh *m = NULL;
    dmk_mesh_info info;
    TRY(dmk_mesh_read(ctx, path, &m));
    dmk_mesh_get_info(m, &info);
    *h = digest(*h, dmk_mesh_triangles(m), 3 * info.n_triangles * sizeof(int32_t));
done:
    dmk_mesh_destroy(&m);
    return rc;
}

/* Writers of meshes, and readers of what they wrote. */
static int write_meshes(uint64_t *h)
{
    int rc = DMK_OK;
    *h = 1;
    for (int i = 0; i < 2; i++) {
        TRY(dmk_mesh_write(ctx, mesh, file[i]));
        TRY(read_back(file[i], h));
    }
done:
    return rc;
}

static int make_surface(uint64_t *h)
{
    int rc;
    dmk_mesh *m = NULL;
    dmk_surface_options options;
    dmk_mesh_info info;
    dmk_surface_options_init(&options, sizeof options);
    options.name = "torus";
    options.n_triangles = 300;
    options.refine = 1;
    TRY(dmk_mesh_surface(ctx, &options, &m));
    dmk_mesh_get_info(m, &info);
    *h = digest(1, dmk_mesh_vertices(m), 3 * info.n_vertices * sizeof(double));
done:
    dmk_mesh_destroy(&m);
    return rc;
}

/* A device of its own, with all kernels. */
static int open_device(uint64_t *h)
{
    int rc;
    dmk_device *d = NULL;
    dmk_solver *s = NULL;
    dmk_device_options options;
    dmk_device_options_init(&options, sizeof options);
    options.threads = 1;
    TRY(dmk_device_open(ctx, &options, &d));
    TRY(dmk_solver_create(ctx, d, mesh, &s));
    *h = 1;
done:
    dmk_solver_destroy(&s);
    dmk_device_destroy(&d);
    return rc;
}

static int solve_with(dmk_solver *s, dmk_method method, uint64_t *h)
{
    int rc;
    dmk_point source;
    dmk_result *result = NULL;
    dmk_solve_options options;
    dmk_solve_options_init(&options, sizeof options);
    options.method = method;
    if (method != DMK_NEWTON) options.tolerance = 0.5, options.start = DMK_START_UNIFORM;
    TRY(dmk_mesh_vertex_point(ctx, mesh, 0, &source));
    TRY(dmk_solve(ctx, s, &source, &options, &result));
    *h = digest_result(result);
done:
    dmk_result_destroy(&result);
    return rc;
}

static int set_up_solver(uint64_t *h)
{
    int rc;
    dmk_solver *s = NULL;
    TRY(dmk_solver_create(ctx, device, mesh, &s));
    *h = 1;
done:
    dmk_solver_destroy(&s);
    return rc;
}

static int solve_newton(uint64_t *h)
{
    return solve_with(solver, DMK_NEWTON, h);
}
static int solve_inertial(uint64_t *h)
{
    return solve_with(solver, DMK_INERTIAL, h);
}

static dmk_result *solved;

static int find_locus(uint64_t *h)
{
    int rc;
    size_t n;
    dmk_locus *locus = NULL;
    dmk_locus_options options;
    dmk_locus_options_init(&options, sizeof options);
    TRY(dmk_locus_compute(ctx, mesh, solved, &options, &locus));
    const dmk_locus_vertex *v = dmk_locus_vertices(locus, &n);
    *h = 1;
    for (size_t i = 0; i < n; i++) *h = digest(*h, v[i].xyz, sizeof v[i].xyz);
    for (int i = 4; i < 7; i++) TRY(dmk_locus_write(ctx, locus, file[i]));
done:
    dmk_locus_destroy(&locus);
    return rc;
}

/* Distances from three sources, and where the nearest of them changes. */
static int find_set_locus(uint64_t *h)
{
    int rc;
    dmk_geodesics *g = NULL;
    dmk_locus *locus = NULL;
    dmk_locus_info info;
    dmk_point source[3];
    for (int i = 0; i < 3; i++) TRY(dmk_mesh_vertex_point(ctx, mesh, 100 * i, &source[i]));
    TRY(dmk_geodesics_create(ctx, mesh, 3, source, NULL, &g));
    TRY(dmk_geodesics_locus(ctx, g, NULL, &locus));
    dmk_locus_get_info(locus, &info);
    *h = digest(1, &info.length, sizeof info.length);
    TRY(dmk_locus_write(ctx, locus, file[5]));
done:
    dmk_locus_destroy(&locus);
    dmk_geodesics_destroy(&g);
    return rc;
}

static int find_path(uint64_t *h)
{
    int rc;
    dmk_path path = {0};
    dmk_point to;
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    TRY(dmk_mesh_vertex_point(ctx, mesh, (int64_t)info.n_vertices / 2, &to));
    TRY(dmk_path_compute(ctx, mesh, solved, 1, &to, &path));
    *h = digest(1, &path.length, sizeof path.length);
    TRY(dmk_path_write(ctx, mesh, &path, file[4]));
done:
    dmk_path_free(&path);
    return rc;
}

/* Of the result, and of geodesics with the cut locus. */
static int cut_open(uint64_t *h)
{
    int rc;
    dmk_mesh *cut = NULL, *same = NULL;
    dmk_geodesics *g = NULL;
    dmk_locus *locus = NULL;
    int32_t *origin = NULL;
    double *plane = NULL;
    dmk_point source;
    dmk_mesh_info info;
    TRY(dmk_cut(ctx, mesh, solved, NULL, &cut, &origin, NULL));
    TRY(dmk_mesh_vertex_point(ctx, mesh, 0, &source));
    TRY(dmk_geodesics_create(ctx, mesh, 1, &source, NULL, &g));
    TRY(dmk_geodesics_cut(ctx, g, NULL, &same, NULL, &plane, &locus));
    dmk_mesh_get_info(cut, &info);
    *h = digest(1, dmk_mesh_triangles(cut), 3 * info.n_triangles * sizeof(int32_t));
    dmk_mesh_get_info(same, &info);
    *h = digest(*h, plane, 2 * info.n_vertices * sizeof *plane);
    TRY(dmk_mesh_write(ctx, cut, file[0]));
done:
    dmk_mesh_destroy(&cut);
    dmk_mesh_destroy(&same);
    dmk_geodesics_destroy(&g);
    dmk_locus_destroy(&locus);
    free(origin);
    free(plane);
    return rc;
}

static int write_result(uint64_t *h)
{
    int rc;
    TRY(dmk_result_write(ctx, mesh, solved, file[2]));
    TRY(dmk_result_write(ctx, mesh, solved, file[3]));
    *h = 1;
done:
    return rc;
}

/* ---- what must hold after each ---- */

typedef struct scenario {
    const char *name;
    int (*run)(uint64_t *h);
    unsigned kinds; /* bits of 1 << fault_kind */
    int stride;     /* how much sparser than asked for: scenarios that take long */
} scenario;

static const scenario scenarios[] = {
    {"read", read_gzip, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"write", write_meshes, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"surface", make_surface, 1 << FAULT_MEMORY, 1},
    {"device", open_device, 1 << FAULT_MEMORY | 1 << FAULT_OPENCL, 1},
    {"set up", set_up_solver, 1 << FAULT_MEMORY | 1 << FAULT_OPENCL, 1},
    {"newton", solve_newton, 1 << FAULT_MEMORY | 1 << FAULT_OPENCL, 1},
    {"inertial", solve_inertial, 1 << FAULT_MEMORY | 1 << FAULT_OPENCL, 1},
    {"locus", find_locus, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"set locus", find_set_locus, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"path", find_path, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"cut", cut_open, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
    {"result", write_result, 1 << FAULT_MEMORY | 1 << FAULT_FILE, 1},
};
enum { N_SCENARIOS = sizeof scenarios / sizeof *scenarios };

static int count_entries(void)
{
    int n = -2;
    DIR *d = opendir(folder);
    while (d && readdir(d)) n++;
    if (d) closedir(d);
    return n;
}

static void remove_files(void)
{
    for (int i = 0; i < 7; i++) unlink(file[i]);
}

/* All files that are there are as they should be; 0 for each that is not there. */
static void digest_files(uint64_t h[7], int *n)
{
    *n = 0;
    for (int i = 0; i < 7; i++) {
        h[i] = access(file[i], F_OK) == 0 ? digest_file(1, file[i]) : 0;
        *n += h[i] != 0;
    }
}

static void complain(const scenario *s, const fault *f, const char *what, long number)
{
    static const char *const kinds[] = {"", "allocation", "file call", "OpenCL call"};
    failed++;
    printf("FAILED: %s, %s %ld%s, code %d: %s (%ld)\n", s->name, kinds[f->kind], f->at,
           f->lasting ? " and on" : "", f->code, what, number);
}

static bool fits(const scenario *s, const fault *f, int rc)
{
    const fault_kind kind = f->kind;
    if (kind == FAULT_OPENCL && f->code == CL_MEM_OBJECT_ALLOCATION_FAILURE && rc == DMK_E_DEVICE)
        return strcmp(s->name, "device") == 0; /* that does not open, for whatever reason */
    if (kind == FAULT_MEMORY) return rc == DMK_E_NOMEM;
    if (kind == FAULT_FILE) return rc == DMK_E_IO || rc == DMK_E_NOMEM;
    return rc == DMK_E_DEVICE || rc == DMK_E_BUILD || rc == DMK_E_NOMEM;
}

typedef struct reference {
    uint64_t h, file[7];
} reference;

/* One fault; the number of calls of its kind. */
static long try_one(const scenario *s, const fault *f, const reference *ref)
{
    uint64_t h = 0, now[7];
    int n_files, wrong = 0;
    long before = fault_live();
    remove_files();
    fault_arm(f);
    int rc = s->run(&h);
    long calls = fault_disarm();
    bool hit = calls >= f->at;
    tried += hit;
    digest_files(now, &n_files);
    for (int i = 0; i < 7; i++) wrong += now[i] && now[i] != ref->file[i];
    if (fault_live() != before) complain(s, f, "not given back", fault_live() - before);
    if (count_entries() != n_files) complain(s, f, "files left", count_entries() - n_files);
    if (wrong) complain(s, f, "half-written files", wrong);
    if (rc == DMK_OK && h != ref->h) complain(s, f, "success with another result", 0);
    if (rc != DMK_OK && !(hit && fits(s, f, rc))) complain(s, f, "status", rc);
    if (rc != DMK_OK && !*dmk_context_message(ctx)) complain(s, f, "no message", rc);
    if (rc != DMK_OK && strlen(dmk_context_message(ctx)) < 10) complain(s, f, "short message", rc);
    return calls;
}

/* The number of calls without a fault; what comes out must be as ever. */
static long count_calls(const scenario *s, const fault *like, const reference *ref)
{
    uint64_t h = 0;
    fault f = *like;
    f.at = 1L << 40;
    fault_arm(&f);
    int rc = s->run(&h);
    long calls = fault_disarm();
    if (rc != DMK_OK || h != ref->h)
        complain(s, like, "not as before once the faults are over", rc);
    return calls;
}

/* Every call, or about every stride-th: the first two, and others in each scenario. */
static void try_all(const scenario *s, fault f, const reference *ref, int stride)
{
    long calls = count_calls(s, &f, ref), n = 0;
    for (f.at = 1; f.at <= calls; n++) {
        try_one(s, &f, ref);
        f.at += stride == 1 || f.at < 2
                    ? 1
                    : stride - stride / 4 + (f.at * 7 + s->name[0]) % stride / 2;
    }
    count_calls(s, &f, ref);
    printf("%-9s %-8s %-7s code %4d: %5ld of %6ld calls\n", s->name,
           f.kind == FAULT_MEMORY ? "memory"
           : f.kind == FAULT_FILE ? "file"
                                  : "OpenCL",
           f.lasting ? "lasting" : "single", f.code, n, calls);
}

static void try_kind(const scenario *s, fault_kind kind, const reference *ref, int stride)
{
    static const int codes[4][3] = {
        {0},
        {ENOMEM},
        {ENOSPC, EIO},
        {CL_OUT_OF_RESOURCES, CL_MEM_OBJECT_ALLOCATION_FAILURE, CL_DEVICE_NOT_AVAILABLE}};
    for (int i = 0; i < 3 && codes[kind][i]; i++) {
        for (int lasting = 0; lasting < 2; lasting++) {
            try_all(s, (fault){kind, 1, lasting, codes[kind][i], 0, false}, ref,
                    stride == 1 ? 1 : stride * (1 + i));
        }
    }
}

static int prepare(void)
{
    int rc;
    dmk_point source;
    dmk_surface_options options;
    dmk_solve_options solve;
    dmk_device_options device_options;
    const char *tmp = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/faults-XXXXXX", tmp ? tmp : "/tmp");
    if (!mkdtemp(folder)) return DMK_E_IO;
    for (int i = 0; i < 7; i++) snprintf(file[i], sizeof file[i], "%s/%s", folder, names[i]);
    TRY(dmk_context_create(&ctx));
    dmk_surface_options_init(&options, sizeof options);
    dmk_device_options_init(&device_options, sizeof device_options);
    dmk_solve_options_init(&solve, sizeof solve);
    options.name = "torus";
    options.n_triangles = 700;
    TRY(dmk_mesh_surface(ctx, &options, &mesh));
    TRY(dmk_device_open(ctx, &device_options, &device));
    TRY(dmk_solver_create(ctx, device, mesh, &solver));
    TRY(dmk_mesh_vertex_point(ctx, mesh, 0, &source));
    TRY(dmk_solve(ctx, solver, &source, &solve, &solved));
done:
    return rc;
}

int main(int argc, char **argv)
{
    int stride = argc > 1 ? atoi(argv[1]) : 1, n;
    const char *only = argc > 2 ? argv[2] : NULL;
    if (prepare() != DMK_OK) {
        printf("cannot begin: %s\n", dmk_context_message(ctx));
        return 2;
    }
    for (int i = 0; i < N_SCENARIOS; i++) {
        const scenario *s = &scenarios[i];
        reference ref = {0};
        if (only && strcmp(only, s->name) != 0) continue;
        if (s->run(&ref.h) != DMK_OK) {
            printf("FAILED: %s without a fault: %s\n", s->name, dmk_context_message(ctx));
            failed++;
            continue;
        }
        digest_files(ref.file, &n);
        for (int kind = FAULT_MEMORY; kind <= FAULT_OPENCL; kind++) {
            if (s->kinds >> kind & 1) try_kind(s, (fault_kind)kind, &ref, stride * s->stride);
        }
    }
    remove_files();
    rmdir(folder);
    dmk_result_destroy(&solved);
    dmk_solver_destroy(&solver);
    dmk_device_destroy(&device);
    dmk_mesh_destroy(&mesh);
    dmk_context_destroy(&ctx);
    if (fault_live() != 0) {
        printf("FAILED: not given back at the end: %ld\n", fault_live());
        failed++;
    }
    printf("# tried %ld: failed %ld\n", tried, failed);
    return failed != 0;
}
