/* A library context for a group of tests: the setup and teardown of cmocka_run_group_tests. */
#ifndef TEST_CONTEXT_H
#define TEST_CONTEXT_H

/* *state is a new dmk_context afterwards; context_teardown destroys it. 0, or -1 where there is none. */
int context_setup(void **state);
int context_teardown(void **state);

#endif
