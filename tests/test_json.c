/* JSON as the tool writes it: every value, key and bracket, whatever the numbers and texts are. */
#include "../src/cli/json.c"

#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

static char *text;
static size_t size;

static cli_json begin_text(void)
{
    return (cli_json){.file = open_memstream(&text, &size)};
}

static void is_text(cli_json *json, const char *expected)
{
    fclose(json->file);
    assert_string_equal(text, expected);
    free(text);
}

static void structure(void **state)
{
    (void)state;
    cli_json json = begin_text();
    json_open(&json, NULL, '{');
    json_integer(&json, "a", -7);
    json_open(&json, "list", '[');
    json_close(&json, '[');
    json_open(&json, "b", '[');
    json_text(&json, NULL, "x");
    json_bool(&json, NULL, true);
    json_bool(&json, NULL, false);
    json_close(&json, '[');
    json_numbers(&json, "c", (double[]){1, 0.5}, 2);
    json_numbers(&json, "d", NULL, 0);
    json_close(&json, '{');
    is_text(&json,
            "{\n  \"a\": -7,\n  \"list\": [],\n  \"b\": [\n    \"x\",\n    true,\n    false\n  ],\n"
            "  \"c\": [1, 0.5],\n  \"d\": []\n}\n");
}

static void number_is(double value, const char *expected)
{
    cli_json json = begin_text();
    json_number(&json, NULL, value);
    is_text(&json, expected);
}

static void numbers(void **state)
{
    (void)state;
    number_is(NAN, "null");
    number_is(INFINITY, "null");
    number_is(-INFINITY, "null");
    number_is(0, "0");
    number_is(-0.0, "-0");
    number_is(0.1, "0.1");
    number_is(-2.5, "-2.5");
    number_is(1e300, "1e+300");
    number_is(1.0 / 3, "0.3333333333333333");
    number_is(0.1 + 0.2, "0.30000000000000004");
    number_is(DBL_MIN, "2.2250738585072014e-308");
    number_is(DBL_MAX, "1.7976931348623157e+308");
    for (int i = 0; i < 1000; i++) { /* each comes back as it was */
        const double value = ldexp(1 + i / 1009.0, i % 200 - 100);
        cli_json json = begin_text();
        json_number(&json, NULL, value);
        fclose(json.file);
        assert_true(strtod(text, NULL) == value);
        free(text);
    }
}

static void quoted_is(const char *value, const char *expected)
{
    cli_json json = begin_text();
    json_text(&json, NULL, value);
    is_text(&json, expected);
}

static void texts(void **state)
{
    (void)state;
    quoted_is("", "\"\"");
    quoted_is("a b", "\"a b\"");
    quoted_is("\"\\/", "\"\\\"\\\\/\"");
    quoted_is("\x01\n\t\x1f\x7f", "\"\\u0001\\u000a\\u0009\\u001f\x7f\"");
    quoted_is("\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80", "\"\xc3\xa4\xe2\x82\xac\xf0\x9f\x98\x80\"");
    quoted_is("\xff\x80z", "\"\\udcff\\udc80z\"");
    quoted_is("\xc0\xaf\xc1\x80", "\"\\udcc0\\udcaf\\udcc1\\udc80\""); /* longer than needed */
    quoted_is("\xe0\x9f\xbf\xe0\xa0\x80",
              "\"\\udce0\\udc9f\\udcbf\xe0\xa0\x80\""); /* U+07FF so, U+0800 */
    quoted_is("\xed\x9f\xbf\xed\xa0\x80",
              "\"\xed\x9f\xbf\\udced\\udca0\\udc80\""); /* U+D7FF, a surrogate */
    quoted_is("\xf0\x8f\xbf\xbf", "\"\\udcf0\\udc8f\\udcbf\\udcbf\"");
    quoted_is("\xf4\x8f\xbf\xbf\xf4\x90\x80\x80",
              "\"\xf4\x8f\xbf\xbf\\udcf4\\udc90\\udc80\\udc80\"");
    quoted_is("\xe2\x82", "\"\\udce2\\udc82\"");
    quoted_is("\xc3(", "\"\\udcc3(\"");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(structure), cmocka_unit_test(numbers),
                                       cmocka_unit_test(texts)};
    return cmocka_run_group_tests_name("json", tests, NULL, NULL);
}
