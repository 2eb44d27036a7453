/* DMKCL_TEST=PATTERN, with * and ?, runs of a test program only the tests whose names match. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>

#include <cmocka.h>

__attribute__((constructor)) static void take_filter(void)
{
    if (getenv("DMKCL_TEST")) cmocka_set_test_filter(getenv("DMKCL_TEST"));
}
