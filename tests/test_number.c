/* Numbers as text: correctly rounded, both ways, in any locale. */
#include "base/number.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

typedef struct fixture {
    dmk_context *ctx;
    dmk_numbers numbers;
} fixture;

static int setup(void **state)
{
    fixture *f = calloc(1, sizeof *f);
    *state = f;
    return dmk_context_create(&f->ctx) || dmk_numbers_create(f->ctx, &f->numbers);
}

static int teardown(void **state)
{
    fixture *f = *state;
    dmk_numbers_free(&f->numbers);
    dmk_context_destroy(&f->ctx);
    free(f);
    return 0;
}

static uint64_t bits(double x)
{
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static uint64_t next_random(uint64_t *s)
{
    *s ^= *s << 13;
    *s ^= *s >> 7;
    *s ^= *s << 17;
    return *s;
}

static double random_double(uint64_t *s)
{
    double x;
    do {
        uint64_t b = next_random(s);
        memcpy(&x, &b, sizeof x);
    } while (!isfinite(x));
    return x;
}

/* Read all of `text`; fail the test if anything is left. */
static double read_all(const fixture *f, const char *text)
{
    double x = NAN;
    const char *at = text, *end = text + strlen(text);
    assert_true(dmk_number_read(&f->numbers, &at, end, &x));
    assert_ptr_equal(at, end);
    return x;
}

static void check_like_strtod(const fixture *f, const char *text)
{
    double x = read_all(f, text), y = strtod(text, NULL);
    if (bits(x) != bits(y)) fail_msg("'%s' read as %a instead of %a", text, x, y);
}

/* Against the C library, in the forms that files have: magnitudes of coordinates, all magnitudes,
 * few digits, digits beyond what a double holds. */
static void test_reads_like_strtod(void **state)
{
    static const char *const formats[] = {"%.17g", "%.16g", "%.15g", "%.3g",  "%.19f",
                                          "%.18e", "%.25g", "%f",    "%.17e", "%.0f"};
    const fixture *f = *state;
    uint64_t s = 88172645463325252ULL;
    char text[512];
    for (int i = 0; i < 20000; i++) {
        double wide = random_double(&s), near = ldexp((double)(next_random(&s) >> 11), -50) - 4.0;
        for (size_t k = 0; k < sizeof formats / sizeof *formats; k++) {
            snprintf(text, sizeof text, formats[k], near);
            check_like_strtod(f, text);
            snprintf(text, sizeof text, formats[k], wide);
            check_like_strtod(f, text);
        }
        /* integer mantissa of any size over a small power of ten */
        snprintf(text, sizeof text, "%llue-%d", (unsigned long long)next_random(&s), i % 40);
        check_like_strtod(f, text);
    }
}

static void test_hard_cases(void **state)
{
    static const char *const texts[] = {
        "0", "-0", "0.000", "-0e99", "1", "+1", ".5", "5.", "-.5e-3", "1e22", "1e23", "123456e18",
        /* halfway between two doubles, and a hair beside */
        "9007199254740993", "9007199254740992.5", "9007199254740993.00000000000000000000001",
        "0.50000000000000005551115123125782702118158340454101562",
        "1.00000000000000011102230246251565404236316680908203125",
        "1.00000000000000011102230246251565404236316680908203124",
        "1.00000000000000011102230246251565404236316680908203126",
        /* the ends of the range */
        "1.7976931348623157e308", "1.7976931348623159e308", "1e400", "-1e400", "1e-400", "5e-324",
        "2.4703282292062327e-324", "2.2250738585072011e-308", "2.2250738585072014e-308",
        "1e99999999999999999999", "1e-99999999999999999999", "0e99999999999999999999",
        "0.00000000000000000000000000000000000000000000000000000000000000000000000001234567890123",
        "123456789012345678901234567890123456789012345678901234567890", "18446744073709551615e-27",
        "1000000000000000000e-27", "9999999999999999999e-1"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) check_like_strtod(*state, texts[i]);
    assert_true(signbit(read_all(*state, "-0.0")));
    /* An exponent that makes up for two million digits. */
    enum { ZEROS = 2000000 };
    char *text = malloc(ZEROS + 32);
    assert_non_null(text);
    memset(text, '0', ZEROS);
    memcpy(text, "0.", 2);
    for (int k = 0; k < 2; k++) {
        strcpy(text + ZEROS, k == 0 ? "1e1999999" : "1e20000000");
        check_like_strtod(*state, text);
    }
    free(text);
}

static void test_stops_where_the_number_ends(void **state)
{
    static const struct {
        const char *text;
        int length; /* 0: no number */
        double value;
    } cases[] = {{"1 2", 1, 1},     {"1e", 1, 1},           {"1e+", 1, 1},
                 {"1.5.5", 3, 1.5}, {"0x10", 1, 0},         {"2,5", 1, 2},
                 {"nan", 0, 0},     {"inf", 0, 0},          {"-", 0, 0},
                 {".", 0, 0},       {"-.e3", 0, 0},         {"", 0, 0},
                 {"e5", 0, 0},      {" 1", 0, 0},           {"--1", 0, 0},
                 {"1e5e5", 3, 1e5}, {"-1.25E+2/3", 8, -125}};
    const fixture *f = *state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        double x = 0;
        const char *at = cases[i].text;
        bool found = dmk_number_read(&f->numbers, &at, at + strlen(at), &x);
        assert_int_equal(found, cases[i].length > 0);
        assert_int_equal(at - cases[i].text, cases[i].length);
        if (found) assert_int_equal(bits(x), bits(cases[i].value));
    }
}

static void test_integers(void **state)
{
    static const struct {
        const char *text;
        int length;
        int64_t value;
    } cases[] = {{"0", 1, 0},
                 {"-17/3", 3, -17},
                 {"+5", 2, 5},
                 {"007", 3, 7},
                 {"9223372036854775807", 19, INT64_MAX},
                 {"-9223372036854775807", 20, -INT64_MAX},
                 {"9223372036854775808", 0, 0},
                 {"99999999999999999999", 0, 0},
                 {"-", 0, 0},
                 {"", 0, 0},
                 {"x", 0, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int64_t n = 0;
        const char *at = cases[i].text;
        assert_int_equal(dmk_integer_read(&at, at + strlen(at), &n), cases[i].length > 0);
        assert_int_equal(at - cases[i].text, cases[i].length);
        assert_int_equal(n, cases[i].value);
    }
}

static void test_prints_the_shortest(void **state)
{
    static const struct {
        double value;
        const char *text;
    } cases[] = {{0.1, "0.1"},
                 {-0.0, "-0"},
                 {1.0 / 3, "0.3333333333333333"},
                 {3, "3"},
                 {1e300, "1e+300"},
                 {0.1 + 0.2, "0.30000000000000004"},
                 {INFINITY, "inf"},
                 {5e-324, "4.94065645841247e-324"}};
    const fixture *f = *state;
    char text[DMK_NUMBER_TEXT];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int n = dmk_number_print(&f->numbers, cases[i].value, text);
        assert_int_equal(n, strlen(text));
        assert_string_equal(text, cases[i].text);
    }
    uint64_t s = 362436069;
    for (int i = 0; i < 20000; i++) {
        double x = random_double(&s);
        dmk_number_print(&f->numbers, x, text);
        assert_int_equal(bits(read_all(f, text)), bits(x));
    }
}

/* Make a locale with decimal commas in a folder of ours, unless there is one, and switch to it. */
static bool use_decimal_commas(const char *folder)
{
    char command[300];
    if (setlocale(LC_ALL, "de_DE.UTF-8")) return true;
    snprintf(command, sizeof command,
             "localedef -i de_DE -f UTF-8 '%s'/de_DE.UTF-8 >/dev/null 2>&1", folder);
    int status = system(command);
    (void)status;
    setenv("LOCPATH", folder, 1);
    return setlocale(LC_ALL, "de_DE.UTF-8") != NULL;
}

static void test_any_locale(void **state)
{
    const fixture *f = *state;
    char folder[200], command[256], text[DMK_NUMBER_TEXT];
    const char *tmp = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/locale-XXXXXX", tmp ? tmp : "/tmp");
    assert_non_null(mkdtemp(folder));
    bool commas = use_decimal_commas(folder);
    char file[220], said[200];
    dmk_mesh *mesh;
    snprintf(file, sizeof file, "%s/a.msh", folder);
    FILE *msh = fopen(file, "w");
    assert_non_null(msh);
    fputs("$MeshFormat\n3.5 0 8\n$EndMeshFormat\n", msh);
    fclose(msh);
    assert_int_equal(dmk_mesh_read(f->ctx, file, &mesh), DMK_E_FORMAT);
    snprintf(said, sizeof said, "%s", dmk_context_message(f->ctx) + strlen(folder));
    snprintf(command, sizeof command, "rm -r '%s'", folder);
    assert_int_equal(system(command), 0);
    if (!commas) skip();
    char here[8], slow[32] = "1.25e-300";
    snprintf(here, sizeof here, "%.1f", 1.5);
    double fast_value = read_all(f, "1.5"), slow_value = read_all(f, slow);
    dmk_number_print(&f->numbers, 0.25, text);
    assert_int_equal(dmk_fail(f->ctx, DMK_E_ARG, "%g", 0.5), DMK_E_ARG);
    char after[8];
    snprintf(after, sizeof after, "%.1f", 1.5);
    setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
    assert_string_equal(here, "1,5"); /* the locale is in force, before and after */
    assert_string_equal(after, "1,5");
    assert_true(fast_value == 1.5 && slow_value == 1.25e-300);
    assert_string_equal(text, "0.25");
    assert_string_equal(dmk_context_message(f->ctx), "0.5");
    assert_string_equal(said, "/a.msh:2: version 3.5 of MSH; export version 2 or 4");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reads_like_strtod),           cmocka_unit_test(test_hard_cases),
        cmocka_unit_test(test_stops_where_the_number_ends), cmocka_unit_test(test_integers),
        cmocka_unit_test(test_prints_the_shortest),         cmocka_unit_test(test_any_locale),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
