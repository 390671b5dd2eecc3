/* exp without libm: short enough to stand inside loops, where compilers turn it into vector instructions, and the same
 * bits on every machine. */
#ifndef ROVER_EXPONENTIAL_H
#define ROVER_EXPONENTIAL_H

#include "one.h"

#include "exponential_text.h"

#include "end.h"

#endif
