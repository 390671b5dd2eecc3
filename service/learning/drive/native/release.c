/* How fast a parked rover creeps when its wheels are released. */
#include <math.h>

#include "law.h"

static const double reference_mass_kg = 550.0, degrees = 180.0 / 3.14159265358979323846;

static double bump(double distance)
{
    return rover_exp(-0.5 * (distance * distance));
}

static double release_speed(const rover_release *release, double slope_rad, double mass_kg)
{
    double slope = rover_held(slope_rad, release->slope_rad[0], release->slope_rad[1]) * degrees, sum = 0.0;
    double mass = log(rover_held(mass_kg, release->mass_kg[0], release->mass_kg[1]) / reference_mass_kg);
    for (int64_t k = 0; k < release->masses; k++) {
        double alike = 0.0;
        for (int64_t i = 0; i < release->slopes; i++)
            alike += bump((slope - release->slope_deg[i]) / release->slope_length_deg)
                * release->weights[i * release->masses + k];
        sum += bump((mass - release->log_mass[k]) / release->mass_length) * alike;
    }
    return sum;
}

void rover_release_speeds(const rover_release *release, int64_t count, const double *slope_rad, const double *mass_kg,
                          double *speed_m_s)
{
    for (int64_t i = 0; i < count; i++)
        speed_m_s[i] = release_speed(release, slope_rad[i], mass_kg[i]);
}
