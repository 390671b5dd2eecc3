/* One scenario from rest: its motion at the times of an answer, and what its whole way comes to. */
#include <math.h>

#include "engine.h"

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
static double mean_wheel_speed(const double *front_rad_s, const double *rear_rad_s, int64_t count,
                               const int64_t *places)
{
    double sum = 0.0, ends = 0.0;
    for (int64_t i = 0; i < count; i++)
        sum += front_rad_s[places[i]] + rear_rad_s[places[i]];
    ends += front_rad_s[places[0]] + rear_rad_s[places[0]];
    ends += front_rad_s[places[count - 1]] + rear_rad_s[places[count - 1]];
    return (sum - 0.5 * ends) / (2.0 * (double)(count - 1));
}

/* Copies what is shown; whether all of it is finite. */
static int shown(const rover_timetable *table, const double *all, double *outputs)
{
    double zero = 0.0; /* stays it, unless a number is not finite */
    for (int row = 0; row < ROVER_SLOPE; row++, all += table->times, outputs += table->shown)
        for (int64_t i = 0; i < table->shown; i++) {
            outputs[i] = all[table->shown_places[i]];
            zero += outputs[i] * 0.0;
        }
    return zero == 0.0;
}

void rover_scenario(const rover_law *law, const rover_release *release, const rover_timetable *table, double slope_rad,
                    double mass_kg, double torque_nm, double *room, double *outputs, double *account)
{
    double start_speed_m_s;
    rover_release_speeds(release, 1, &slope_rad, &mass_kg, &start_speed_m_s);
    const double scenario[5] = {slope_rad, mass_kg, torque_nm, start_speed_m_s, 0.0};
    rover_constant(law, 1, scenario, table->times, table->time_s, 0, room);
    const double *x_m = room + ROVER_X * table->times, *height_m = room + ROVER_HEIGHT * table->times;
    const double *front = room + ROVER_FRONT * table->times, *rear = room + ROVER_REAR * table->times;
    const int64_t *own = table->own_places, *looks = table->look_places;
    account[ROVER_FINITE] = shown(table, room, outputs);
    account[ROVER_START_X] = x_m[own[0]];
    account[ROVER_LATE_X] = x_m[own[table->late]];
    account[ROVER_END_X] = x_m[own[table->own - 1]];
    account[ROVER_END_HEIGHT] = height_m[own[table->own - 1]];
    account[ROVER_PATH] = path_length(x_m, height_m, table->own, own);
    account[ROVER_WHEELS] = mean_wheel_speed(front, rear, table->own, own);
    account[ROVER_SEEN] = table->looks > 0 ? x_m[looks[0]] : 0.0;
    account[ROVER_SEEN_LATER] = table->looks > 1 ? x_m[looks[1]] : 0.0;
}
