/* Which of many places are nearest to one: for the verdict on one scenario, sooner than by arrays. */
#include "engine.h"

void rover_nearest(int64_t count, const double *places, double x, double y, double z, int64_t wanted, double *found)
{
    const double *first = places, *second = places + count, *third = places + 2 * count;
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++) {
        double a = first[i] - x, b = second[i] - y, c = third[i] - z, square = a * a + b * b + c * c;
        if (kept == wanted && !(square < found[2 * kept - 1]))
            continue;
        int64_t at = kept < wanted ? kept++ : kept - 1;
        for (; at > 0 && square < found[2 * at - 1]; at--) {
            found[2 * at] = found[2 * at - 2];
            found[2 * at + 1] = found[2 * at - 1];
        }
        found[2 * at] = (double)i;
        found[2 * at + 1] = square;
    }
}
