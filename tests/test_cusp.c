/* Where a branch ends: the polynomial of a map and its derivatives, and the cusp that Newton's method finds in it. */
#include "../src/locus/cusp.c" /* for its static functions; the library's own are then left out */

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

/* The n-th derivative of x^p. */
static double derivative(double x, int p, int n)
{
    double value = 1;
    for (int i = 0; i < n; i++) value *= p - i;
    return n > p ? 0 : value * pow(x, p - n);
}

/* All monomials a^i r^j with i + 2 j <= 5, each once, and those of weight 5 last. */
static void monomials_and_derivatives(void **state)
{
    (void)state;
    int seen[6][3] = {{0}}, lighter = 0;
    for (int k = 0; k < N_TERMS; k++) {
        const int i = power[k][0], j = power[k][1];
        assert_true(i >= 0 && i <= 5 && j >= 0 && j <= 2 && i + 2 * j <= 5);
        assert_int_equal(seen[i][j]++, 0);
        lighter += i + 2 * j < 5;
        assert_true(k < N_TERMS - 3 ? lighter == k + 1 : i + 2 * j == 5);
    }
    const double a = 0.7, r = -1.3;
    for (int da = 0; da < 4; da++) {
        for (int dr = 0; dr < 3; dr++) {
            double value[N_TERMS];
            terms(a, r, da, dr, value);
            for (int k = 0; k < N_TERMS; k++) {
                const double exact =
                    derivative(a, power[k][0], da) * derivative(r, power[k][1], dr);
                assert_true(fabs(value[k] - exact) < 1e-13);
            }
        }
    }
}

/* Add f * (a - a0)^i (r - r0)^j to component c. */
static void add_shifted(double *map, int c, double f, int i, int j, double a0, double r0)
{
    static const int choose[4][4] = {{1, 0, 0, 0}, {1, 1, 0, 0}, {1, 2, 1, 0}, {1, 3, 3, 1}};
    for (int p = 0; p <= i; p++) {
        for (int q = 0; q <= j; q++) {
            const double part = choose[i][p] * pow(-a0, i - p) * choose[j][q] * pow(-r0, j - q);
            for (int k = 0; k < N_TERMS; k++)
                if (power[k][0] == p && power[k][1] == q) map[3 * k + c] += f * part;
        }
    }
}

/* The fold X = (r, s a^3 - a r) around (a0, r0), which has its cusp there for s > 0, and none that counts for s < 0. */
static bool find_in_fold(double s, double a0, double r0, double *a, double *r)
{
    double map[3 * N_TERMS] = {0};
    const dmk_patch patch = {.normal = {0, 0, 1}};
    add_shifted(map, 0, 1, 0, 1, a0, r0);
    add_shifted(map, 1, s, 3, 0, a0, r0);
    add_shifted(map, 1, -1, 1, 1, a0, r0);
    return find_cusp(&patch, map, a, r);
}

static void cusps_are_found(void **state)
{
    (void)state;
    for (int i = -4; i <= 4; i++) {
        for (int j = -4; j <= 4; j++) {
            double a, r;
            assert_true(find_in_fold(0.4, 0.2 * i, 0.2 * j, &a, &r));
            if (!(fabs(a - 0.2 * i) < 1e-9 && fabs(r - 0.2 * j) < 1e-9))
                fail_msg("(%g, %g) instead of (%g, %g)", a, r, 0.2 * i, 0.2 * j);
            assert_false(find_in_fold(-0.4, 0.2 * i, 0.2 * j, &a, &r));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(monomials_and_derivatives),
        cmocka_unit_test(cusps_are_found),
    };
    return cmocka_run_group_tests_name("cusp", tests, NULL, NULL);
}
