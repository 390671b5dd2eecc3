/* How fast a parked rover creeps when its wheels are released. */
#include <math.h>

#include "law.h"

enum { ROVER_MASSES = 4 }; /* bumps over the mass that are summed at once */

static const double reference_mass_kg = 550.0, degrees = 180.0 / 3.14159265358979323846;

static double bump(double distance)
{
    return rover_exp(-0.5 * (distance * distance));
}

static double release_speed(const rover_release *release, double slope_rad, double mass_kg)
{
    double slope = rover_held(slope_rad, release->slope_rad[0], release->slope_rad[1]) * degrees, sum = 0.0;
    double mass = log(rover_held(mass_kg, release->mass_kg[0], release->mass_kg[1]) / reference_mass_kg);
    for (int64_t first = 0; first < release->masses; first += ROVER_MASSES) {
        int64_t left = release->masses - first, some = left < ROVER_MASSES ? left : ROVER_MASSES;
        double alike[ROVER_MASSES] = {0.0};
        for (int64_t i = 0; i < release->slopes; i++) {
            double near = bump((slope - release->slope_deg[i]) / release->slope_length_deg);
            for (int64_t k = 0; k < some; k++)
                alike[k] += near * release->weights[i * release->masses + first + k];
        }
        for (int64_t k = 0; k < some; k++)
            sum += bump((mass - release->log_mass[first + k]) / release->mass_length) * alike[k];
    }
    return sum;
}

void rover_release_speeds(const rover_release *release, int64_t count, const double *slope_rad, const double *mass_kg,
                          double *speed_m_s)
{
    for (int64_t i = 0; i < count; i++)
        speed_m_s[i] = release_speed(release, slope_rad[i], mass_kg[i]);
}
