/* exp for one number or for several side by side: one.h says what the words in capitals are. No guard:
 * it is included once for each kind. Within 1 unit in the last place of the true value. */

/* x = k ln 2 + r with |r| <= ln(2)/2: gives 2^k and exp(r) - 1. For x in [-708, 709]; others are held there. */
TEXT void NAME(split_exp)(NUMBER x, NUMBER *power, NUMBER *rest)
{
    const double per_ln2 = 0x1.71547652b82fep+0, ln2_high = 0x1.62e42fec00000p-1, ln2_low = 0x1.d1cf79abc9e3bp-32;
    const double round = 0x1.8p52; /* adding it leaves the nearest whole number in the last bits */
    x = PICK(OF(-708.0) > x, -708.0, x);
    x = PICK(OF(709.0) < x, 709.0, x);
    NUMBER shifted = x * per_ln2 + round;
    NUMBER k = shifted - round;
    NUMBER r = (x - k * ln2_high) - k * ln2_low;
    /* (exp(r) - 1 - r) / r^2: interpolated at Chebyshev's points, off by 1.3e-17 at most */
    NUMBER r2 = r * r, r4 = r2 * r2;
    NUMBER a = 0x1.0000000000001p-1 + r * 0x1.5555555555556p-3, b = 0x1.5555555553d63p-5 + r * 0x1.11111111109b3p-7;
    NUMBER c = 0x1.6c16c1788bd90p-10 + r * 0x1.a01a01a7c41d5p-13, d = 0x1.a019b90d2ae7ap-16 + r * 0x1.71de0dae63bb3p-19;
    NUMBER e = 0x1.289185613a3d6p-22 + r * 0x1.af38a9b0ec855p-26;
    NUMBER sum = (a + r2 * b) + r4 * ((c + r2 * d) + r4 * e);
    *rest = r + r2 * sum;
    *power = AS_NUMBER((AS_BITS(shifted) + 1023u) << 52);
}

TEXT NUMBER NAME(exp)(NUMBER x)
{
    NUMBER power, rest;
    NAME(split_exp)(x, &power, &rest);
    return power + power * rest;
}

/* exp(x) - 1 without cancellation near zero */
TEXT NUMBER NAME(expm1)(NUMBER x)
{
    NUMBER power, rest;
    NAME(split_exp)(x, &power, &rest);
    return power * rest + (power - 1.0);
}

TEXT NUMBER NAME(tanh)(NUMBER x)
{
    NUMBER twice = PICK(x < 0.0, -2.0 * x, 2.0 * x), found = OF(1.0);
    MASK wanted = NOT(twice > 40.0); /* of others all bits are those of 1 */
    if (ANY(wanted)) {
        NUMBER more = NAME(expm1)(twice);
        found = PICK(wanted, more / (more + 2.0), found);
    }
    return PICK(x < 0.0, -found, found);
}

/* The number within two others; NaN becomes the lower one. */
TEXT NUMBER NAME(held)(NUMBER number, NUMBER low, NUMBER high)
{
    NUMBER above = PICK(number > low, number, low);
    return PICK(above < high, above, high);
}

TEXT NUMBER NAME(size)(NUMBER number)
{
    return AS_NUMBER(AS_BITS(number) & 0x7fffffffffffffffu);
}
