/* Newton's pseudo time step: when it grows, stays and shrinks, and how well it is solved. */
#include "../src/solver/newton.c" /* for its static functions; the library's own are then left out */

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* The step after one of D = 80 that led from rho_before to rho. */
static double step_after(double rho_before, double rho)
{
    step_control p = {.D = 80, .longest = 150, .growth = 1.5, .rho_before = rho_before};
    choose_step(&p, rho);
    assert_true(p.rho_before == rho);
    assert_int_equal(p.shrunk, p.D < 80);
    return p.D;
}

static void steps_follow_rho(void **state)
{
    (void)state;
    assert_true(step_after(0, 1e-2) == 80);      /* the first rho */
    assert_true(step_after(1e-2, 8e-3) == 120);  /* less */
    assert_true(step_after(1e-2, 9.5e-3) == 80); /* about the same */
    assert_true(step_after(1e-2, 1.25e-2) == 80);
    assert_true(step_after(1e-2, 1.4e-2) == 40); /* more */
    assert_true(step_after(2e-4, 5.5e-4) == 80); /* more, but little */
    assert_true(step_after(2e-4, 6.5e-4) == 40);
}

/* CG iterations of a step of D of a control with four, and five where it is stiff. */
static int iterations(double D, int effort)
{
    step_control p = {.D = D, .brief = 5, .most = 4, .stiff = 100, .effort = effort};
    choose_step(&p, 1e-2);
    return p.iterations;
}

static void effort_is_a_least_number_of_iterations(void **state)
{
    static const int usual[][2] = {{4, 1}, {6, 2}, {30, 4}, {120, 5}}; /* D, iterations */
    (void)state;
    for (size_t i = 0; i < sizeof usual / sizeof *usual; i++) {
        assert_int_equal(iterations(usual[i][0], 0), usual[i][1]);
        assert_int_equal(iterations(usual[i][0], 3), usual[i][1] > 3 ? usual[i][1] : 3);
        assert_int_equal(iterations(usual[i][0], 100), 100);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(steps_follow_rho),
                                       cmocka_unit_test(effort_is_a_least_number_of_iterations)};
    return cmocka_run_group_tests_name("steps", tests, NULL, NULL);
}
