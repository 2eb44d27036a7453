/* Numbers as text: the reader against strtod, which rounds rightly too; printing and reading back. */
#include "fuzz.h"

#include "base/number.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 4096 };

static dmk_context *ctx;
static dmk_numbers numbers;

static bool same(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0;
}

/* The text begins with a decimal number: digits, with a sign and a point or without. */
static bool looks_decimal(const char *p)
{
    if (*p == '+' || *p == '-') p++;
    if (p[0] == '0' && (p[1] == 'x' || p[1] == 'X')) return false; /* strtod would go on */
    if (*p == '.') p++;
    return *p >= '0' && *p <= '9';
}

static void check_number(const char *text, const char *end)
{
    double value;
    const char *at = text;
    char *their_end;
    bool good = dmk_number_read(&numbers, &at, end, &value);
    REQUIRE(at >= text && at <= end);
    if (!looks_decimal(text)) return;
    double expected = strtod(text, &their_end);
    REQUIRE(good && at == their_end && same(value, expected));
}

static void check_integer(const char *text, const char *end)
{
    int64_t value;
    const char *at = text;
    char *their_end;
    bool good = dmk_integer_read(&at, end, &value);
    REQUIRE(at >= text && at <= end);
    if (!good) return;
    REQUIRE(strtoll(text, &their_end, 10) == value && at == their_end);
}

static void check_print(double value)
{
    char text[DMK_NUMBER_TEXT];
    double back;
    int n = dmk_number_print(&numbers, value, text);
    REQUIRE(n > 0 && n < DMK_NUMBER_TEXT && text[n] == '\0');
    if (!isfinite(value)) return;
    const char *at = text;
    REQUIRE(dmk_number_read(&numbers, &at, text + n, &back) && at == text + n && same(value, back));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static char text[LONGEST + 1];
    double value;
    if (!ctx) REQUIRE(!dmk_context_create(&ctx) && !dmk_numbers_create(ctx, &numbers));
    if (size > LONGEST) size = LONGEST;
    memcpy(text, data, size);
    text[size] = '\0';
    size = strlen(text); /* beyond a NUL strtod does not look */
    check_number(text, text + size);
    check_integer(text, text + size);
    if (size < sizeof value) return 0;
    memcpy(&value, text, sizeof value);
    check_print(value);
    return 0;
}
