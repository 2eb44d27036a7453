/* A library context for a group of tests: the setup and teardown of cmocka_run_group_tests; and a small mesh. */
#ifndef TEST_CONTEXT_H
#define TEST_CONTEXT_H

#include <dmkcl.h>

/* *state is a new dmk_context afterwards; context_teardown destroys it. 0, or -1 where there is none. */
int context_setup(void **state);
int context_teardown(void **state);

/* Two triangles, (0, 0), (1, 0), (1, 1) and (0, 0), (1, 1), (0, last); the caller destroys it. */
dmk_mesh *unit_square(dmk_context *context, double last);
/* Distances from the first triangle's corner 0, or from a point that has `weight` of both others; the caller destroys
 * them. */
dmk_geodesics *from_corner(dmk_context *context, const dmk_mesh *mesh, double weight);

#endif
