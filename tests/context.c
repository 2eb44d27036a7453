#include "context.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

int context_setup(void **state)
{
    dmk_context *ctx;
    if (dmk_context_create(&ctx) != DMK_OK) return -1;
    *state = ctx;
    return 0;
}

int context_teardown(void **state)
{
    dmk_context *ctx = *state;
    dmk_context_destroy(&ctx);
    return 0;
}

dmk_mesh *unit_square(dmk_context *ctx, double last)
{
    dmk_mesh *m;
    const double xyz[12] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, last, 0};
    const int32_t triangle[6] = {0, 1, 2, 0, 2, 3};
    assert_int_equal(dmk_mesh_create(ctx, 4, xyz, 2, triangle, &m), DMK_OK);
    return m;
}

dmk_geodesics *from_corner(dmk_context *ctx, const dmk_mesh *m, double weight)
{
    dmk_geodesics *g;
    const dmk_point p = {0, {1 - 2 * weight, weight, weight}};
    assert_int_equal(dmk_geodesics_create(ctx, m, 1, &p, NULL, &g), DMK_OK);
    return g;
}
