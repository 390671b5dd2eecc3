/* One scenario from rest: its motion at the times of an answer, and what its whole way comes to. */
#include <math.h>
#include <string.h>

#include "drive.h"

static double path_length(const double *x_m, const double *height_m, int64_t count, const int64_t *places)
{
    double sum = 0.0;
    for (int64_t i = 1; i < count; i++) {
        double along = x_m[places[i]] - x_m[places[i - 1]], up = height_m[places[i]] - height_m[places[i - 1]];
        sum += sqrt(along * along + up * up);
    }
    return sum;
}

/* Mean over both axles and evenly spaced times, by trapezoids */
static double mean_wheel_speed(const rover_turning *of)
{
    return (of->sum - 0.5 * (of->first + of->last)) / (2.0 * (double)(of->count - 1));
}

/* Moves what is shown to the front of its row, eight at a time: what is not shown lies between them seldom. */
static void gather(const rover_timetable *table, double *row)
{
    enum { MANY = 8 };
    const int64_t *from = table->shown_places;
    for (int64_t i = 0; i < table->shown;) {
        double some[MANY];
        if (i + MANY <= table->shown && from[i + MANY - 1] - from[i] == MANY - 1) {
            memcpy(some, row + from[i], sizeof some);
            memcpy(row + i, some, sizeof some);
            i += MANY;
        } else {
            row[i] = row[from[i]];
            i++;
        }
    }
}

/* Whether all are: in none of them every bit of the exponent is set, so that one more carries into the sign. */
#define FINITE_PARAMETERS (int64_t count, const double *numbers, uint64_t *carried)
ROVER_INLINE void carry FINITE_PARAMETERS
{
    uint64_t some = 0;
    for (int64_t i = 0; i < count; i++)
        some |= (rover_bits(numbers[i]) & 0x7ff0000000000000u) + 0x0010000000000000u;
    *carried = some;
}
ROVER_VERSIONS(carry, FINITE_PARAMETERS, (count, numbers, carried))

static int are_finite(int64_t vector_bits, int64_t count, const double *numbers)
{
    uint64_t carried;
    ROVER_CALL(vector_bits, carry, (count, numbers, &carried));
    return !(carried >> 63);
}

void rover_scenario(const rover_law *law, const rover_release *release, const rover_timetable *table, double slope_rad,
                    double mass_kg, double torque_nm, int64_t columns, double *outputs, double *account)
{
    const int64_t *own = table->own_places, *looks = table->look_places, times = table->times;
    const double always = 0.0;
    double start_speed_m_s, *x_m = outputs, *height_m = outputs + times, *speed_m_s = NULL;
    rover_motion motion;
    rover_state state;
    rover_controls controls = {1, &always, &torque_nm, &always};
    rover_turning turning = {table->own, own, 0, 0.0, 0.0, 0.0};
    if (columns > 2)
        speed_m_s = outputs + 2 * times;
    rover_columns to = {x_m, speed_m_s, speed_m_s ? speed_m_s + times : NULL, speed_m_s ? speed_m_s + 2 * times : NULL,
                        height_m, NULL, &turning};
    rover_release_speeds(release, 1, &slope_rad, &mass_kg, &start_speed_m_s);
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, NULL);
    rover_start(law, mass_kg, start_speed_m_s, &state);
    rover_follow(&motion, &state, &controls, slope_rad, 0.0, times, table->time_s, NULL, &to);
    account[ROVER_START_X] = x_m[own[0]];
    account[ROVER_LATE_X] = x_m[own[table->late]];
    account[ROVER_END_X] = x_m[own[table->own - 1]];
    account[ROVER_END_HEIGHT] = height_m[own[table->own - 1]];
    account[ROVER_PATH] = path_length(x_m, height_m, table->own, own);
    account[ROVER_WHEELS] = mean_wheel_speed(&turning);
    account[ROVER_SEEN] = table->looks > 0 ? x_m[looks[0]] : 0.0;
    account[ROVER_SEEN_LATER] = table->looks > 1 ? x_m[looks[1]] : 0.0;
    account[ROVER_FINITE] = 1.0;
    for (double *row = outputs; row < outputs + columns * times; row += times) {
        gather(table, row);
        if (!are_finite(law->vector_bits, table->shown, row))
            account[ROVER_FINITE] = 0.0;
    }
}
