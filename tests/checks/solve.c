/* Solve MESH from vertex 0 in a given shape and precision, by all methods, and a transport, for checks of kernels:
 *     solve MESH cpu|gpu double|single [LARGER]
 * Steps are few: the same kernels run at each. Then the mesh with a needle and, in double precision, of needles, and
 * the larger mesh, of a launch's part of vertices for each, on two ranks, threads of this process. */
#include "meeting.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static _Thread_local dmk_context *context;

static void ok(int status)
{
    if (status == DMK_OK) return;
    fprintf(stderr, "%s: %s\n", dmk_status_text(status), dmk_context_message(context));
    exit(1);
}

static void solve(dmk_solver *solver, const dmk_point *source, dmk_method method, dmk_start start)
{
    dmk_solve_options options;
    dmk_result *result = NULL;
    dmk_stats stats;
    dmk_solve_options_init(&options, sizeof options);
    options.method = method;
    options.start = start;
    if (method != DMK_NEWTON) options.tolerance = 0.5;
    options.gap_tolerance = 0.3;
    ok(dmk_solve(context, solver, source, &options, &result));
    dmk_result_get_stats(result, &stats);
    printf("method %d, start %d: %d steps, cost %.17g to %.17g\n", method, start, stats.steps,
           stats.cost_lower, stats.cost_upper);
    if (!(stats.cost_lower > 0 && stats.cost_lower <= stats.cost_upper && stats.gap < 0.5)) exit(2);
    dmk_result_destroy(&result);
}

/* Newton's steps on the mesh with its vertices at x. */
static void solve_moved(dmk_device *device, const dmk_mesh *mesh, const double *x)
{
    dmk_mesh_info info;
    dmk_mesh *moved = NULL;
    dmk_solver *solver = NULL;
    dmk_point source;
    dmk_mesh_get_info(mesh, &info);
    ok(dmk_mesh_create(context, info.n_vertices, x, info.n_triangles, dmk_mesh_triangles(mesh),
                       &moved));
    ok(dmk_solver_create(context, device, moved, &solver));
    ok(dmk_mesh_vertex_point(context, moved, 0, &source));
    solve(solver, &source, DMK_NEWTON, DMK_START_DISTANCE);
    dmk_solver_destroy(&solver);
    dmk_mesh_destroy(&moved);
}

/* Where a needle forbids that parts are rounded: the last vertex next to another one; and on needles alone, stretched,
 * where coarse levels do without T in double precision. */
static void solve_needles(dmk_device *device, const dmk_mesh *mesh, bool single)
{
    dmk_mesh_info info;
    dmk_mesh_get_info(mesh, &info);
    const int32_t *triangle = dmk_mesh_triangles(mesh), last = (int32_t)info.n_vertices - 1;
    double *x = malloc(3 * info.n_vertices * sizeof *x);
    size_t h = 0;
    if (!x) exit(1);
    memcpy(x, dmk_mesh_vertices(mesh), 3 * info.n_vertices * sizeof *x);
    while (triangle[h] != last) h++;
    const int32_t next = triangle[h % 3 == 2 ? h - 2 : h + 1];
    for (int k = 0; k < 3; k++) x[3 * last + k] += 0.999 * (x[3 * next + k] - x[3 * last + k]);
    solve_moved(device, mesh, x);
    memcpy(x, dmk_mesh_vertices(mesh), 3 * info.n_vertices * sizeof *x);
    for (size_t v = 0; v < info.n_vertices; v++) x[3 * v] *= 40;
    if (!single) solve_moved(device, mesh, x);
    free(x);
}

/* Between measures: masses that grow with the vertices' numbers go where they fall. */
static void solve_transport(dmk_solver *solver, const dmk_mesh *mesh)
{
    dmk_mesh_info info;
    dmk_solve_options options;
    dmk_transport *transport = NULL;
    dmk_stats stats;
    dmk_mesh_get_info(mesh, &info);
    double *up = malloc(2 * info.n_vertices * sizeof *up);
    if (!up) exit(1);
    double *down = up + info.n_vertices;
    for (size_t v = 0; v < info.n_vertices; v++) {
        up[v] = (double)v;
        down[v] = (double)(info.n_vertices - 1 - v);
    }
    dmk_solve_options_init(&options, sizeof options);
    ok(dmk_solve_measures(context, solver, &(dmk_measure){.vertex_mass = up},
                          &(dmk_measure){.vertex_mass = down}, &options, &transport));
    dmk_transport_get_stats(transport, &stats);
    if (!(stats.cost_lower > 0 && stats.cost_lower <= stats.cost_upper && stats.gap < 0.5)) exit(2);
    dmk_transport_destroy(&transport);
    free(up);
}

typedef struct seat {
    dmk_device_options device;
    const char *mesh;
    member m;
} seat;

/* As one rank of a communicator, or alone. */
static void *sit(void *argument)
{
    seat *s = argument;
    dmk_device *device = NULL;
    dmk_mesh *mesh = NULL;
    dmk_solver *solver = NULL;
    dmk_point source;
    ok(dmk_context_create(&context));
    ok(dmk_device_open(context, &s->device, &device));
    ok(dmk_mesh_read(context, s->mesh, &mesh));
    ok(dmk_solver_create(context, device, mesh, &solver));
    ok(dmk_mesh_vertex_point(context, mesh, 0, &source));
    if (s->m.all) {
        const dmk_ranks ranks = ranks_of(&s->m, 1);
        ok(dmk_solver_set_ranks(context, solver, &ranks));
    }
    for (int method = DMK_NEWTON; method <= (s->m.all ? DMK_NEWTON : DMK_EULER); method++) {
        solve(solver, &source, (dmk_method)method, DMK_START_DISTANCE);
    }
    if (!s->m.all) {
        solve(solver, &source, DMK_EULER, DMK_START_UNIFORM);
        solve(solver, &source, DMK_NEWTON, DMK_START_UNIFORM); /* with one smoothing step, too */
        solve_transport(solver, mesh);
        solve_needles(device, mesh, s->device.single_precision);
    }
    dmk_solver_destroy(&solver);
    dmk_mesh_destroy(&mesh);
    dmk_device_destroy(&device);
    dmk_context_destroy(&context);
    return NULL;
}

int main(int argc, char **argv)
{
    meeting all = {.size = 2};
    seat seats[2] = {{.mesh = argv[1]}};
    if (argc < 4) return 3;
    dmk_device_options_init(&seats->device, sizeof seats->device);
    seats->device.shape = strcmp(argv[2], "gpu") == 0 ? DMK_SHAPE_GPU : DMK_SHAPE_CPU;
    seats->device.single_precision = strcmp(argv[3], "single") == 0;
    seats->device.cache = "";
    sit(seats);
    if (argc == 4) return 0;
    seats[1] = seats[0];
    for (int k = 0; k < 2; k++) {
        seats[k].m = (member){.all = &all, .rank = k};
        seats[k].mesh = argv[4];
    }
    return meet(&all, sit, seats, sizeof *seats) ? 4 : 0;
}
