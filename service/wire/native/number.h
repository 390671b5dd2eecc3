/* One number to its text: first to a whole number of its last decimal, then to digits. In a header, so that both become
part of the loops that call them, for the decimals they know. */
#ifndef ROVER_NUMBER_H
#define ROVER_NUMBER_H

#include <stdint.h>
#include <string.h>

#define ALWAYS static inline __attribute__((always_inline))
#define USUAL 7 /* the decimals of most columns */

static const uint64_t powers[] = {
    1ull,
    10ull,
    100ull,
    1000ull,
    10000ull,
    100000ull,
    1000000ull,
    10000000ull,
    100000000ull,
    1000000000ull,
    10000000000ull,
    100000000000ull,
    1000000000000ull,
    10000000000000ull,
    100000000000000ull,
    1000000000000000ull,
};

/* What is written together: three digits with the number of zeros they end with, and up to two digits before the point
with one behind it (0.1, 12.3). */
#define TRIPLE(a, b, c) {'0' + a, '0' + b, '0' + c, c ? 0 : b ? 1 : a ? 2 : 3},
#define LEAD(a, b, c) {a ? '0' + a : '0' + b, a ? '0' + b : '.', a ? '.' : '0' + c, a ? '0' + c : 0},
#define TEN(one, a, b) \
    one(a, b, 0) one(a, b, 1) one(a, b, 2) one(a, b, 3) one(a, b, 4) one(a, b, 5) one(a, b, 6) one(a, b, 7) \
        one(a, b, 8) one(a, b, 9)
#define HUNDRED(one, a) \
    TEN(one, a, 0) TEN(one, a, 1) TEN(one, a, 2) TEN(one, a, 3) TEN(one, a, 4) TEN(one, a, 5) TEN(one, a, 6) \
        TEN(one, a, 7) TEN(one, a, 8) TEN(one, a, 9)
#define THOUSAND(one) \
    HUNDRED(one, 0) HUNDRED(one, 1) HUNDRED(one, 2) HUNDRED(one, 3) HUNDRED(one, 4) HUNDRED(one, 5) HUNDRED(one, 6) \
        HUNDRED(one, 7) HUNDRED(one, 8) HUNDRED(one, 9)
static const char triples[1000][4] = {THOUSAND(TRIPLE)}, leads[1000][4] = {THOUSAND(LEAD)};

/* What `value * scale` misses of the exact product (Dekker); neither is near the largest float64. */
ALWAYS double missed(double value, double scale, double product)
{
    double cut = 134217729.0 * value, high = cut - (cut - value), low = value - high;
    double cut_scale = 134217729.0 * scale, high_scale = cut_scale - (cut_scale - scale), low_scale = scale - high_scale;
    return ((high * high_scale - product) + high * low_scale + low * high_scale) + low * low_scale;
}

/* Below this a float64 has decimals; what is added to `magic` loses them, and the sum has the whole number in its low
bits. */
static const double most = 2251799813685248.0 /* 2^51 */, magic = 6755399441055744.0 /* 1.5 * 2^52 */;
static const uint64_t magic_bits = 0x4338000000000000;

/* The values times the scale as whole numbers, rounded. What it says is 0 where one of them may be wrong: where the
product is as near to two of them, or too large. */
ALWAYS int rounded(const double *values, int64_t count, double scale, int64_t *to)
{
    int64_t odd = 0;
    for (int64_t i = 0; i < count; i++) {
        double product = values[i] * scale, near = product + magic, rest = product - (near - magic);
        uint64_t bits;
        memcpy(&bits, &near, 8);
        to[i] = (int64_t)(bits - magic_bits); /* of what is too large anything */
        odd |= !(__builtin_fabs(product) < most) | !(__builtin_fabs(rest) < 0.5);
    }
    return !odd;
}

/* The same, as if the products were exact. 0 for a number that is none or not below `most`. */
static int rounded_exactly(const double *values, int64_t count, double scale, int64_t *to)
{
    rounded(values, count, scale, to);
    for (int64_t i = 0; i < count; i++) {
        double product = values[i] * scale;
        if (!(__builtin_fabs(product) < most))
            return 0;
        double rest = product - (double)to[i], more = missed(values[i], scale, product);
        to[i] += (rest == 0.5 && more > 0) - (rest == -0.5 && more < 0);
    }
    return 1;
}

/* Without zeros before it; below 10^18. */
static char *natural(char *to, uint64_t number)
{
    char digits[24], *at = digits + 20;
    do {
        *--at = (char)('0' + number % 10);
        number /= 10;
    } while (number);
    memcpy(to, at, (size_t)(digits + 20 - at));
    return to + (digits + 20 - at);
}

/* A whole number of 10^-7 as a number with up to seven decimals. */
ALWAYS char *usual(char *to, int64_t number, int64_t point)
{
    int64_t minus = number >> 63;
    *to = '-';
    to -= minus;
    uint64_t size = (uint64_t)((number ^ minus) - minus), lead = size / 1000000;
    uint32_t rest = (uint32_t)(size - lead * 1000000), first = rest / 1000, last = rest - first * 1000;
    if (__builtin_expect(lead < 1000, 1)) {
        memcpy(to, leads[lead], 4);
        to += 3 + (lead >= 100);
    } else {
        to = natural(to, lead / 10);
        *to++ = '.';
        *to++ = (char)('0' + lead % 10);
    }
    memcpy(to, triples[first], 4);
    memcpy(to + 3, triples[last], 4);
    if (__builtin_expect(last, 1))
        return to + 6 - triples[last][3];
    if (first)
        return to + 3 - triples[first][3];
    return to - (!point && to[-1] == '0' ? 2 : 0);
}

/* The same for other decimals, three digits at a time. */
static char *unusual(char *to, int64_t number, int64_t decimals, int64_t point)
{
    uint64_t size = number < 0 ? (uint64_t)-number : (uint64_t)number, before = size / powers[decimals];
    *to = '-';
    to = natural(to + (number < 0), before);
    uint64_t after = (size - before * powers[decimals]) * powers[15 - decimals];
    if (!after && !point)
        return to;
    *to++ = '.';
    uint64_t three;
    do {
        three = after / powers[12];
        after = after % powers[12] * 1000;
        memcpy(to, triples[three], 4);
        to += 3;
    } while (after);
    return to - (three ? triples[three][3] : 2);
}

#endif
