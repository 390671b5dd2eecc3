/* Many scenarios: side by side, as many as the machine's vectors are good for. */
#include <math.h>
#include <string.h>

#include "drive.h"
#include "lanes.h"

#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_sqrt)
#define ROVER_ROOTS /* of all lanes at once */
#endif
#endif
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed within this file alone */

enum { NARROW_LANES = 4, WIDE_LANES = 8, WIDEST_LANES = 16 };

#define TARGET
#define SUFFIX _lanes
#define LANES NARROW_LANES
#include "lanes_text.h"
#include "end.h"

#if defined(__x86_64__)
#define TARGET ROVER_AVX2
#define SUFFIX _lanes_avx2
#define LANES WIDE_LANES
#include "lanes_text.h"
#include "end.h"

#define TARGET ROVER_AVX512
#define SUFFIX _lanes_avx512
#define LANES WIDEST_LANES
#include "lanes_text.h"
#include "end.h"
#else /* whose law asks for no more than 128 bits */
#define drive_lanes_avx2 drive_lanes
#define drive_lanes_avx512 drive_lanes
#endif

void rover_side_by_side(const rover_law *law, int64_t some, const int64_t *order, int64_t count, const double *scenarios,
                        int64_t times, const double *time_s, int64_t stride, int64_t columns, double *outputs,
                        const rover_wholes *wholes)
{
    const int64_t bits = law->vector_bits, most = bits >= 512 ? WIDEST_LANES : bits >= 256 ? WIDE_LANES : NARROW_LANES;
    rover_lanes asked = {.law = law, .count = count, .scenarios = scenarios, .times = times, .stride = stride,
                         .time_s = time_s, .wholes = wholes};
    for (int column = 0; column < 5; column++)
        asked.columns[column] = column < columns ? outputs + column * count * times : NULL;
    for (int64_t first = 0; first < some; first += most) {
        asked.lanes = (int)(some - first < most ? some - first : most);
        for (int lane = 0; lane < asked.lanes; lane++)
            asked.row[lane] = order[first + lane];
        ROVER_CALL(bits, drive_lanes, (&asked));
    }
}
