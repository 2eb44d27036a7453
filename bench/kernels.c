/* Kernels beside a plain copy of as many bytes, on one device in one run.
 *
 * usage: bench-kernels [MESH.off]   (default: the quartic with 273,408 triangles)
 * The bytes of a kernel are what kernels/ says above it. The copy reads half of them and writes the other half.
 * Kernel and copy take turns; the least of the rounds counts. */
#include "solver/kernels.h"
#include "solver/setup.h"
#include "solver/iteration.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { ROUNDS = 40, REPEAT = 8, N_CASES = 7 };

typedef struct bench {
    dmk_context *ctx;
    dmk_device *device;
    dmk_mesh *mesh;
    dmk_order order;
    dmk_system *sys;
    dmk_buffer *from, *to; /* of the copy */
    dmk_kernel *copy;
    double row_places, graph_places; /* 8 * columns: entries of the row lists of T/2 and T */
} bench;

typedef struct measured {
    const char *name;
    int (*run)(bench *);
    double bytes;
    double seconds, copy_seconds;
} measured;

/* ---- the kernels ---------------------------------------------------------------------------- */

static int run_newton_elements(bench *b)
{
    return dmk_inner_elements(b->ctx, b->sys, DMK_NEWTON_MATRIX, b->sys->x);
}

static int run_rows(bench *b)
{
    dmk_system *s = b->sys;
    return dmk_inner_apply(b->ctx, s, DMK_ROWS, false);
}

static int run_stiffness(bench *b)
{
    int rc;
    DMK_TRY(dmk_inner_elements(b->ctx, b->sys, DMK_STIFFNESS, b->sys->x));
    DMK_TRY(run_rows(b));
done:
    return rc;
}

static int run_newton(bench *b)
{
    int rc;
    DMK_TRY(run_newton_elements(b));
    DMK_TRY(run_rows(b));
done:
    return rc;
}

static int run_chebyshev(bench *b)
{
    int rc;
    dmk_system *s = b->sys;
    DMK_TRY(dmk_inner_elements(b->ctx, s, DMK_NEWTON_MATRIX, s->x));
    DMK_TRY(dmk_rows_chebyshev(b->ctx, s, s->cg[DMK_INNER].r, s->x, s->x_old,
                               (dmk_chebyshev_step){0.2, 1, 1}));
done:
    return rc;
}

static int run_graph(bench *b)
{
    dmk_system *s = b->sys;
    dmk_level *l = &s->level[0];
    return dmk_graph_chebyshev(b->ctx, s, 0, l->x, l->x_old, (dmk_chebyshev_step){0.2, 1, 1});
}

static int run_energy(bench *b)
{
    dmk_system *s = b->sys;
    return dmk_element_energy(b->ctx, s, s->u, DMK_KEEP_Q | DMK_KEEP_G, 0, 0);
}

/* ---- what they move, as it stands above them in kernels/ -------------------------------------- */

static char *read_source(const char *path)
{
    FILE *file = fopen(path, "r");
    char *text = file ? calloc(1, 1 << 20) : NULL;
    if (text && fread(text, 1, (1 << 20) - 1, file) == 0) text[0] = 0;
    if (file) fclose(file);
    return text;
}

/* "24 E + 9 real E + real R bytes" in bytes. */
static double evaluate(const bench *b, const char *at, double real)
{
    const dmk_system *s = b->sys;
    double sum = 0;
    for (;;) {
        char *end;
        double term = strtod(at, &end);
        if (end == at) term = 1;
        at = end + strspn(end, " ");
        if (strncmp(at, "real ", 5) == 0) term *= real, at += 5;
        switch (*at) {
        case 'E': term *= s->n_elements; break;
        case 'R': term *= s->n_rows; break;
        case 'P': term *= b->row_places; break;
        case 'V': term *= s->level[0].n; break;
        case 'L': term *= b->graph_places; break;
        default: return 0;
        }
        sum += term;
        at += 1 + strspn(at + 1, " ");
        if (*at != '+') return sum;
        at += 1 + strspn(at + 1, " ");
    }
}

/* 0 if nothing is said above it. */
static double moved(const bench *b, const char *kernel, double real)
{
    static const char *const sources[] = {"kernels/operator.cl", "kernels/multigrid.cl",
                                          "kernels/density.cl", "kernels/vector.cl"};
    char head[64];
    double bytes = 0;
    snprintf(head, sizeof head, "KERNEL %s(", kernel);
    for (size_t i = 0; i < sizeof sources / sizeof *sources && bytes == 0; i++) {
        char *text = read_source(sources[i]), *at = text ? strstr(text, head) : NULL;
        if (at) {
            *at = 0;
            char *said = NULL, *begin = text;
            while ((begin = strstr(begin, " moves "))) said = begin += 7;
            /* No other kernel comes in between. */
            if (said && !strstr(said, "\nKERNEL ")) bytes = evaluate(b, said, real);
        }
        free(text);
    }
    if (bytes == 0) fprintf(stderr, "bench-kernels: nothing is said above kernel %s\n", kernel);
    return bytes;
}

static void model(const bench *b, measured *m)
{
    const double real = (double)dmk_device_real(b->device, DMK_OUTER);
    const double stiffness = moved(b, "element_stiffness", 4),
                 newton = moved(b, "element_newton", 4), rows = moved(b, "inner_apply", 4),
                 smoother = moved(b, "rows_chebyshev", 4);
    m[0] = (measured){"operator A", run_stiffness, stiffness + rows, 1e9, 1e9};
    m[1] = (measured){"Newton operator M", run_newton, newton + rows, 1e9, 1e9};
    m[2] = (measured){"smoother step, T/2", run_chebyshev, newton + smoother, 1e9, 1e9};
    m[3] = (measured){"smoother step, T", run_graph, moved(b, "graph_chebyshev", 4), 1e9, 1e9};
    m[4] = (measured){"energy", run_energy, moved(b, "element_energy", real), 1e9, 1e9};
    /* The two phases of M by themselves. */
    m[5] = (measured){"M, elements", run_newton_elements, newton, 1e9, 1e9};
    m[6] = (measured){"M, rows", run_rows, rows, 1e9, 1e9};
}

/* ---- the system ----------------------------------------------------------------------------- */

static int quartic(bench *b)
{
    dmk_surface_options o;
    dmk_surface_options_init(&o, sizeof o);
    o.name = "quartic";
    o.refine = 3;
    return dmk_mesh_surface(b->ctx, &o, &b->mesh);
}

/* Entries of the row lists with n_pad rows. */
static int places_of(bench *b, const dmk_buffer *slice, int32_t n_pad, double *places)
{
    int32_t columns = 0;
    int rc = dmk_buffer_read(b->ctx, b->device, slice, sizeof columns * (size_t)(n_pad / 8),
                             sizeof columns, &columns);
    *places = 8.0 * columns;
    return rc;
}

static int fill(bench *b, dmk_program program, dmk_buffer *buffer, int32_t n, double from,
                double to)
{
    int rc;
    double *v = NULL;
    DMK_TRY(DMK_NEW(b->ctx, v, (size_t)n));
    for (int32_t i = 0; i < n; i++) v[i] = from + (to - from) * (i % 1000) / 1000;
    DMK_TRY(dmk_buffer_write_real(b->ctx, b->device, program, buffer, (size_t)n, v));
done:
    free(v);
    return rc;
}

static int prepare(bench *b, const char *path)
{
    int rc;
    dmk_device_options o;
    dmk_device_options_init(&o, sizeof o);
    DMK_TRY(dmk_device_open(b->ctx, &o, &b->device));
    DMK_TRY(path ? dmk_mesh_read(b->ctx, path, &b->mesh) : quartic(b));
    DMK_TRY(dmk_order_create(b->ctx, b->mesh, 0, &b->order));
    DMK_TRY(dmk_system_create(b->ctx, b->device, b->order.mesh, &b->sys));
    dmk_system *s = b->sys;
    if (s->without_T) {
        rc = dmk_fail(b->ctx, DMK_E_ARG, "a mesh of needles, whose solver has no T; take another");
        goto done;
    }
    DMK_TRY(dmk_system_allocate(b->ctx, s));
    DMK_TRY(places_of(b, s->slice, s->n_rows_pad, &b->row_places));
    DMK_TRY(places_of(b, s->level[0].slice, s->level[0].n_pad, &b->graph_places));
    DMK_TRY(fill(b, DMK_OUTER, s->mu, s->n_elements, 0.1, 1));
    DMK_TRY(fill(b, DMK_OUTER, s->u, s->n_rows, -1, 1));
    DMK_TRY(fill(b, DMK_INNER, s->x, s->n_rows, -1, 1));
    DMK_TRY(fill(b, DMK_INNER, s->level[0].x, s->level[0].n, -1, 1));
    DMK_TRY(fill(b, DMK_INNER, s->rank_one, 6 * s->n_elements, 0.1, 1));
    DMK_TRY(dmk_element_prepare(b->ctx, s));
    DMK_TRY(dmk_inverse_diagonal(b->ctx, s));
    DMK_TRY(dmk_multigrid_refresh(b->ctx, s, DMK_STIFFNESS));
done:
    return rc;
}

static int prepare_copy(bench *b, const measured *m)
{
    int rc;
    double most = 0;
    for (int i = 0; i < N_CASES; i++) most = fmax(most, m[i].bytes);
    size_t bytes = (size_t)most / 2 + 4096;
    DMK_TRY(dmk_buffer_create(b->ctx, b->device, bytes, NULL, &b->from));
    DMK_TRY(dmk_buffer_create(b->ctx, b->device, bytes, NULL, &b->to));
    /* From single to single precision in this program: a plain copy. */
    DMK_TRY(dmk_kernel_get(b->ctx, b->device, DMK_INNER, "narrow_copy", &b->copy));
done:
    return rc;
}

/* ---- timing --------------------------------------------------------------------------------- */

static int run_copy(bench *b, double bytes)
{
    int32_t n = (int32_t)(bytes / 8); /* numbers read; as many written */
    return DMK_LAUNCH(b->ctx, b->device, b->copy, ((dmk_range){.items = (size_t)n}), DMK_INT(n),
                      DMK_BUF(b->from), DMK_BUF(b->to));
}

/* A blocking read ends when all queued work is done. */
static int wait(bench *b)
{
    float one;
    return dmk_buffer_read(b->ctx, b->device, b->to, 0, sizeof one, &one);
}

/* Each goes once before it is timed, so that what the caches hold of it does not depend on the one before: the
 * copy's buffers are the same for all, a kernel's arrays are its own. */
static int turn(bench *b, measured *m)
{
    int rc;
    DMK_TRY(m->run(b));
    DMK_TRY(wait(b));
    double begin = dmk_seconds();
    for (int i = 0; i < REPEAT; i++) DMK_TRY(m->run(b));
    DMK_TRY(wait(b));
    m->seconds = fmin(m->seconds, (dmk_seconds() - begin) / REPEAT);
    DMK_TRY(run_copy(b, m->bytes));
    DMK_TRY(wait(b));
    begin = dmk_seconds();
    for (int i = 0; i < REPEAT; i++) DMK_TRY(run_copy(b, m->bytes));
    DMK_TRY(wait(b));
    m->copy_seconds = fmin(m->copy_seconds, (dmk_seconds() - begin) / REPEAT);
done:
    return rc;
}

static void print_table(const bench *b, const measured *m)
{
    dmk_device_info info;
    dmk_device_get_info(b->device, &info);
    printf("%s (driver %s), %d compute units, %d triangles\n\n", info.name, info.driver,
           info.compute_units, b->order.mesh->n_triangles);
    printf("| kernel | MB | ms | GB/s | copy, ms | ratio | at most 1.5 |\n"
           "|---|--:|--:|--:|--:|--:|---|\n");
    for (int i = 0; i < N_CASES; i++) {
        double ratio = m[i].seconds / m[i].copy_seconds;
        printf("| %s | %.1f | %.3f | %.1f | %.3f | %.2f | %s |\n", m[i].name, m[i].bytes / 1e6,
               1e3 * m[i].seconds, 1e-9 * m[i].bytes / m[i].seconds, 1e3 * m[i].copy_seconds, ratio,
               ratio <= 1.5 ? "ok" : "missed");
    }
}

int main(int argc, char **argv)
{
    int rc;
    bench b = {0};
    measured m[N_CASES];
    setenv("POCL_AFFINITY", "1", 0); /* as the tool does */
    DMK_TRY(dmk_context_create(&b.ctx));
    DMK_TRY(prepare(&b, argc > 1 ? argv[1] : NULL));
    model(&b, m);
    DMK_TRY(prepare_copy(&b, m));
    for (int r = 0; r < ROUNDS; r++) {
        for (int i = 0; i < N_CASES; i++) DMK_TRY(turn(&b, &m[i]));
    }
    print_table(&b, m);
done:
    if (rc != DMK_OK) fprintf(stderr, "bench-kernels: %s\n", dmk_context_message(b.ctx));
    dmk_buffer_destroy(&b.from);
    dmk_buffer_destroy(&b.to);
    dmk_system_destroy(&b.sys);
    dmk_order_free(&b.order);
    dmk_mesh_destroy(&b.mesh);
    dmk_device_destroy(&b.device);
    dmk_context_destroy(&b.ctx);
    return rc == DMK_OK ? 0 : 1;
}
