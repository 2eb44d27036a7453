/* How long a part of a device waits, when it is given back, for a driver that holds its queue: by a clock and a queue
 * of the test's own. */
#include "device/internal.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <time.h>

static cl_int queue_info(cl_command_queue queue, cl_command_queue_info what, size_t size,
                         void *value, size_t *got);
static int pass_time(const struct timespec *asked, struct timespec *left);

#define clGetCommandQueueInfo queue_info
#define nanosleep pass_time
#include "../src/device/open.c" /* for its static functions; the library's own are then left out */
#undef clGetCommandQueueInfo
#undef nanosleep

#include <cmocka.h>

static double passed;   /* seconds */
static int held, fails; /* how often the queue is still held when asked; whether it answers */

static cl_int queue_info(cl_command_queue queue, cl_command_queue_info what, size_t size,
                         void *value, size_t *got)
{
    (void)queue, (void)got;
    assert_int_equal(what, CL_QUEUE_REFERENCE_COUNT);
    assert_int_equal(size, sizeof(cl_uint));
    *(cl_uint *)value = held > 0 ? 2 : 1;
    if (held > 0) held--;
    return fails ? CL_INVALID_COMMAND_QUEUE : CL_SUCCESS;
}

static int pass_time(const struct timespec *asked, struct timespec *left)
{
    (void)left;
    passed += (double)asked->tv_sec + 1e-9 * (double)asked->tv_nsec;
    return 0;
}

static double wait_while(int times, int failing)
{
    const dmk_device device = {.is_sub_device = 1};
    passed = 0;
    held = times;
    fails = failing;
    wait_for_events(&device);
    return passed;
}

static void waits_a_second_at_most(void **state)
{
    (void)state;
    assert_true(wait_while(0, 0) == 0);
    const double brief = wait_while(3, 0);
    assert_true(brief > 2.5e-4 && brief < 3.5e-4);
    const double all = wait_while(1 << 30, 0);
    assert_true(all > 0.9 && all < 1.1);
    assert_true(wait_while(1 << 30, 1) == 0); /* a queue that does not answer */
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(waits_a_second_at_most)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
