/* What library.py asks before anything else: whether it and this engine fit each other, and how wide vectors are. */
#if defined(__x86_64__)
#include <cpuid.h>
#endif
#include <string.h>

#include "engine.h"

int64_t rover_interface(void)
{
    return ROVER_INTERFACE;
}

int64_t rover_state_format(void)
{
    return ROVER_STATE_FORMAT;
}

#define BYTES(type) {#type, sizeof(type)}

int64_t rover_bytes(const char *name)
{
    static const struct {
        const char *name;
        int64_t bytes;
    } known[] = {BYTES(rover_parameters), BYTES(rover_basis),    BYTES(rover_law), BYTES(rover_state),  BYTES(rover_route),
                 BYTES(rover_track),      BYTES(rover_controls), BYTES(rover_run),
                 BYTES(rover_release),    BYTES(rover_wholes), BYTES(rover_timetable)};
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (!strcmp(name, known[i].name))
            return known[i].bytes;
    return 0;
}

int64_t rover_vector_bits(void)
{
    int64_t bits = 128;
#if defined(__x86_64__)
    const unsigned int wide = 0x6, wider = 0xe6; /* registers that the system keeps */
    const unsigned int avx512 = bit_AVX512F | bit_AVX512DQ | bit_AVX512VL;
    unsigned int a, b, c, d, low, high;
    if (!__get_cpuid(1, &a, &b, &c, &d) || !(c & bit_OSXSAVE))
        return bits;
    __asm__("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    if (!__get_cpuid_count(7, 0, &a, &b, &c, &d) || !(b & bit_AVX2) || (low & wide) != wide)
        return bits;
    bits = (b & avx512) == avx512 && (low & wider) == wider ? 512 : 256;
#endif
    return bits;
}
