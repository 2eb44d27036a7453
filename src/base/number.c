#include "base/number.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Exact in double up to 10^22 = 5^22 2^22, since 5^22 < 2^53. */
static const double power10[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                 1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* Powers of five that fit 64 bits: 5^0 .. 5^27. */
static const uint64_t power5[] = {1ULL,
                                  5ULL,
                                  25ULL,
                                  125ULL,
                                  625ULL,
                                  3125ULL,
                                  15625ULL,
                                  78125ULL,
                                  390625ULL,
                                  1953125ULL,
                                  9765625ULL,
                                  48828125ULL,
                                  244140625ULL,
                                  1220703125ULL,
                                  6103515625ULL,
                                  30517578125ULL,
                                  152587890625ULL,
                                  762939453125ULL,
                                  3814697265625ULL,
                                  19073486328125ULL,
                                  95367431640625ULL,
                                  476837158203125ULL,
                                  2384185791015625ULL,
                                  11920928955078125ULL,
                                  59604644775390625ULL,
                                  298023223876953125ULL,
                                  1490116119384765625ULL,
                                  7450580596923828125ULL};

int dmk_numbers_create(dmk_context *ctx, dmk_numbers *numbers)
{
    numbers->c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (!numbers->c) return dmk_fail(ctx, DMK_E_NOMEM, "out of memory: the \"C\" locale");
    return DMK_OK;
}

void dmk_numbers_free(dmk_numbers *numbers)
{
    if (numbers->c) freelocale(numbers->c);
    numbers->c = (locale_t)0;
}

/* m / 10^k, 0 < k <= 27, rounded once. With m and d = 5^k shifted to the top bit of 64, the
 * quotient q = m' 2^63 / d' lies in (2^62, 2^64): ten bits more than a double keeps. A lost
 * remainder goes into its lowest bit, far below the rounding position, so the conversion of q to
 * double is the one rounding; the power of two that remains is exact. */
static double divide_exactly(uint64_t m, int k)
{
    int shift_m = __builtin_clzll(m), shift_d = __builtin_clzll(power5[k]);
    uint64_t d = power5[k] << shift_d;
    __extension__ unsigned __int128 n = (unsigned __int128)(m << shift_m) << 63;
    uint64_t q = (uint64_t)(n / d);
    if (n % d) q |= 1;
    return ldexp((double)q, shift_d - shift_m - 63 - k);
}

/* A decimal number: sign, digits as an integer (up to 19 of them), power of ten. */
typedef struct decimal {
    uint64_t mantissa;
    int64_t exponent;
    bool negative, complete; /* complete: no digit was left out */
} decimal;

static bool is_digit(const char *p, const char *end)
{
    return p < end && (unsigned char)(*p - '0') < 10;
}

/* Take the digits at p into d; each one behind the point lowers the exponent. */
static const char *take_digits(const char *p, const char *end, bool fraction, decimal *d)
{
    for (; is_digit(p, end); p++) {
        if (d->mantissa < 1000000000000000000ULL) {
            d->mantissa = 10 * d->mantissa + (uint64_t)(*p - '0');
            d->exponent -= fraction;
        } else {
            d->complete = false;
            d->exponent += !fraction;
        }
    }
    return p;
}

/* The exponent part at p, if it is one; capped where no digits before it can make up for it. */
static const char *take_exponent(const char *p, const char *end, decimal *d)
{
    if (p >= end || (*p != 'e' && *p != 'E')) return p;
    const char *q = p + 1;
    bool negative = q < end && *q == '-';
    if (q < end && (*q == '-' || *q == '+')) q++;
    if (!is_digit(q, end)) return p;
    int64_t e = 0;
    for (; is_digit(q, end); q++) {
        if (e < 100000000000000000) e = 10 * e + (*q - '0');
    }
    d->exponent += negative ? -e : e;
    return q;
}

static const char *take_decimal(const char *p, const char *end, decimal *d)
{
    *d = (decimal){.complete = true};
    if (p < end && (*p == '-' || *p == '+')) d->negative = *p++ == '-';
    const char *first = p;
    p = take_digits(p, end, false, d);
    size_t n_digits = (size_t)(p - first);
    if (p < end && *p == '.') {
        const char *fraction = ++p;
        p = take_digits(p, end, true, d);
        n_digits += (size_t)(p - fraction);
    }
    return n_digits ? take_exponent(p, end, d) : NULL;
}

bool dmk_number_read(const dmk_numbers *numbers, const char **at, const char *end, double *value)
{
    decimal d;
    double x;
    const char *p = take_decimal(*at, end, &d);
    if (!p) return false;
    if (d.mantissa == 0) {
        x = 0;
    } else if (d.complete && d.mantissa < 1ULL << 53 && d.exponent >= -22 && d.exponent <= 22) {
        x = (double)d.mantissa; /* exact operands: one rounding */
        x = d.exponent < 0 ? x / power10[-d.exponent] : x * power10[d.exponent];
    } else if (d.complete && d.exponent < 0 && d.exponent >= -27) {
        x = divide_exactly(d.mantissa, (int)-d.exponent);
    } else {
        x = fabs(strtod_l(*at, NULL, numbers->c));
    }
    *value = d.negative ? -x : x;
    *at = p;
    return true;
}

bool dmk_integer_read(const char **at, const char *end, int64_t *value)
{
    const char *p = *at;
    bool negative = p < end && *p == '-';
    if (p < end && (*p == '-' || *p == '+')) p++;
    if (!is_digit(p, end)) return false;
    int64_t n = 0;
    for (; is_digit(p, end); p++) {
        const int digit = *p - '0';
        if (n > (INT64_MAX - digit) / 10) return false;
        n = 10 * n + digit;
    }
    *value = negative ? -n : n;
    *at = p;
    return true;
}

int dmk_number_print(const dmk_numbers *numbers, double value, char text[DMK_NUMBER_TEXT])
{
    locale_t before = uselocale(numbers->c);
    int n = 0;
    for (int digits = 15; digits <= 17; digits++) {
        double back = 0;
        const char *at = text;
        n = snprintf(text, DMK_NUMBER_TEXT, "%.*g", digits, value);
        if (!isfinite(value)) break;
        dmk_number_read(numbers, &at, text + n, &back);
        if (back == value) break;
    }
    uselocale(before);
    return n;
}
