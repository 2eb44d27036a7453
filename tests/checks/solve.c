/* Solve MESH from vertex 0 in a given shape and precision, by all methods, for checks of kernels:
 *     solve MESH cpu|gpu double|single
 * Steps are few: the same kernels run at each. */
#include "dmkcl.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static dmk_context *context;

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

int main(int argc, char **argv)
{
    dmk_device_options options;
    dmk_device *device = NULL;
    dmk_mesh *mesh = NULL;
    dmk_solver *solver = NULL;
    dmk_point source;
    if (argc != 4) return 3;
    dmk_device_options_init(&options, sizeof options);
    options.shape = strcmp(argv[2], "gpu") == 0 ? DMK_SHAPE_GPU : DMK_SHAPE_CPU;
    options.single_precision = strcmp(argv[3], "single") == 0;
    options.cache = "";
    ok(dmk_context_create(&context));
    ok(dmk_device_open(context, &options, &device));
    ok(dmk_mesh_read(context, argv[1], &mesh));
    ok(dmk_solver_create(context, device, mesh, &solver));
    ok(dmk_mesh_vertex_point(context, mesh, 0, &source));
    for (int method = DMK_NEWTON; method <= DMK_EULER; method++) {
        solve(solver, &source, (dmk_method)method, DMK_START_DISTANCE);
    }
    solve(solver, &source, DMK_EULER, DMK_START_UNIFORM);
    dmk_solver_destroy(&solver);
    dmk_mesh_destroy(&mesh);
    dmk_device_destroy(&device);
    dmk_context_destroy(&context);
    return 0;
}
