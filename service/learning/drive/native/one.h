/* The words of the texts (*_text.h) for one rover: numbers are numbers, a mask is a condition. A text is written once
 * and compiled for one rover and for several side by side (lanes.h), so that both have the same bits: the same
 * operations in the same order. `if (ANY(mask))` is a branch here, and there one that is taken if any of them needs it.
 * end.h takes the words back. */
#include <stdint.h>
#include <string.h>

#include "engine.h"

#ifndef ROVER_ONE_H
#define ROVER_ONE_H
ROVER_INLINE uint64_t rover_bits(double number)
{
    uint64_t bits;
    memcpy(&bits, &number, sizeof bits);
    return bits;
}
ROVER_INLINE double rover_of_bits(uint64_t bits)
{
    double number;
    memcpy(&number, &bits, sizeof number);
    return number;
}
#endif

#define TEXT ROVER_INLINE
#define NAME(name) rover_##name
#define NUMBER double
#define MASK int
#define BITS uint64_t
#define OF(number) (number)                     /* the same number for each */
#define PICK(mask, yes, no) ((mask) ? (yes) : (no)) /* of each the one or the other */
#define HELD(number, low, high) NAME(held)(number, OF(low), OF(high))
#define ANY(mask) (mask)
#define NOT(mask) (!(mask))
#define AS_BITS(number) rover_bits(number)
#define AS_NUMBER(bits) rover_of_bits(bits)
