/* What slope, torque and mass decide, made once for as long as these stay. */
#include <math.h>

#include "law.h"

enum { SUMMED = 8 }; /* at once, and in the same order, on every machine */
/* Middle and spread of the shipped runs, so that lengths of one are of one kind: tan(slope), ln(torque ratio), ln(mass) */
static const double tangent_middle = 0.27, tangent_spread = 0.19;
static const double ratio_least = 0.05, ratio_middle = 0.37, ratio_spread = 0.55;
static const double reference_mass_kg = 550.0, mass_spread = 0.33, reference_load_kg = 275.0, unladen_mass_kg = 430.0;
static const double most_ratio = 1e3;

static double power(double base, double exponent)
{
    return rover_exp(exponent * log(base));
}

/* Weighted sums over a basis, for one or two rows of weights. Sums go along eight parts on every machine. */
ROVER_INLINE void basis_sums(const rover_basis *basis, const double *scaled, const double *weights, int rows, double *sums)
{
    const double *first = basis->centres, *second = first + basis->count, *third = second + basis->count;
    double at0 = scaled[0] * basis->scale[0], at1 = scaled[1] * basis->scale[1], at2 = scaled[2] * basis->scale[2];
    double partial[2][SUMMED] = {{0.0}};
    for (int64_t i = 0; i < basis->count; i += SUMMED) {
        double near[SUMMED];
        for (int part = 0; part < SUMMED; part++) {
            double u = at0 - first[i + part], v = at1 - second[i + part], w = at2 - third[i + part];
            near[part] = rover_exp(-(u * u + v * v + w * w));
        }
        for (int row = 0; row < rows; row++)
            for (int part = 0; part < SUMMED; part++)
                partial[row][part] += near[part] * weights[row * basis->count + i + part];
    }
    for (int row = 0; row < rows; row++) {
        const double *l = partial[row];
        sums[row] = ((l[0] + l[1]) + (l[2] + l[3])) + ((l[4] + l[5]) + (l[6] + l[7]));
    }
}

#define SUMS_PARAMETERS (const rover_law *law, const double *scaled, const double *weights, double *sums)
ROVER_INLINE void motion_sums SUMS_PARAMETERS
{
    basis_sums(&law->motion, scaled, weights, 2, sums);
}
ROVER_INLINE void stall_sums SUMS_PARAMETERS
{
    basis_sums(&law->stall, scaled, weights + 2 * law->motion.count, 1, sums);
}
ROVER_VERSIONS(motion_sums, SUMS_PARAMETERS, (law, scaled, weights, sums))
ROVER_VERSIONS(stall_sums, SUMS_PARAMETERS, (law, scaled, weights, sums))

void rover_place_begin(rover_place *place, const rover_law *law, const double *parameters, const double *heights)
{
    const rover_parameters *p = (const rover_parameters *)parameters;
    place->law = law;
    place->parameters = p;
    place->heights = heights;
    place->mass_kg = place->slope_rad = place->torque_nm = NAN;
    place->rolled = 0;
    place->per.rut_width = 1.0 / (p->rut_end_m - p->rut_begin_m);
    place->per.near = 1.0 / p->near_length_m;
    place->per.far = 1.0 / p->far_length_m;
    place->per.dig_length = 1.0 / p->dig_length_m;
    place->per.shear_slip = 1.0 / p->shear_slip_m;
    place->per.backing = 1.0 / p->backing_length_m;
    place->per.back_spin = 1.0 / p->back_spin_m_s;
    place->per.back_hold = 1.0 / p->back_hold_length_m;
    place->per.gate_width = 1.0 / p->gate_width_m_s;
    place->per.turning_speed = 1.0 / p->turning_speed_m_s;
    place->per.slip_lag = 1.0 / p->slip_lag_m;
    place->per.brake_speed = 1.0 / p->brake_speed_m_s;
    place->per.radius = 1.0 / law->wheel_radius_m;
}

/* Beyond what runs have shown, what was learned stays as it is at the edge: only weight, slope and torque still act. */
static double within_reach(const rover_law *law, int feature, double scaled)
{
    return rover_held(scaled, law->reach[2 * feature], law->reach[2 * feature + 1]);
}

static void place_mass(rover_place *place, double mass_kg)
{
    const rover_parameters *p = place->parameters;
    place->mass_kg = mass_kg;
    place->slope_rad = place->torque_nm = NAN;
    place->scaled[2] = within_reach(place->law, 2, log(mass_kg / reference_mass_kg) / mass_spread);
    place->ground.mass_scale = power(mass_kg / reference_mass_kg, p->mass_exponent);
    place->ground.front_slip_scale = power(mass_kg / reference_mass_kg, p->front_load_exponent) / p->front_slip_scale;
}

static void place_torque(rover_place *place, double torque_nm)
{
    const rover_law *law = place->law;
    place->torque_nm = torque_nm;
    double ratio = torque_nm / (place->mass_kg * law->gravity_m_s2 * law->wheel_radius_m);
    place->ratio = rover_held(ratio, 0.0, most_ratio);
    place->scaled[1] = within_reach(law, 1, log((place->ratio + ratio_least) / ratio_middle) / ratio_spread);
}

static void place_slope(rover_place *place, double slope_rad)
{
    const rover_parameters *p = place->parameters;
    const rover_law *law = place->law;
    place->slope_rad = slope_rad;
    double sine = sin(slope_rad), cosine = cos(slope_rad);
    place->ground.sine = sine;
    place->scaled[0] = within_reach(law, 0, (sine / cosine - tangent_middle) / tangent_spread);
    double height = law->centre_height_m + p->height_rise_m * (place->mass_kg - unladen_mass_kg) / unladen_mass_kg;
    double front = (law->centre_ahead_m * cosine - height * sine) / law->wheelbase_m - p->share_shift * cosine;
    place->ground.front_share = rover_held(front, 0.02, 0.98);
    place->ground.rear_share = rover_held(cosine - place->ground.front_share, 0.02, 1.0);
}

static void place_load(rover_place *place)
{
    const rover_parameters *p = place->parameters;
    double load = log(place->ground.rear_share * place->mass_kg / reference_load_kg);
    place->ground.rear_slip_scale = rover_exp(p->rear_load_exponent * load) / p->rear_slip_scale;
    place->ground.rut_slip_scale = rover_exp(p->rut_load_exponent * load) / p->rut_slip_scale;
    place->ground.compaction = p->compaction * rover_exp(p->compaction_exponent * load);
}

/* Resistances that are polynomials of the features */
static void place_resistances(rover_place *place)
{
    const rover_parameters *p = place->parameters;
    double f0 = place->scaled[0], f1 = place->scaled[1], f2 = place->scaled[2];
    const double terms[7] = {1.0, f0, f1, f2, f0 * f0, f1 * f1, f0 * f1};
    for (int knot = 0; knot < 8; knot++) {
        const double *numbers = knot < 4 ? p->early + 7 * knot : knot < 7 ? p->along + 7 * (knot - 4) : p->back;
        double sum = 0.0;
        for (int term = 0; term < 7; term++)
            sum += numbers[term] * terms[term];
        if (knot < 4)
            place->ground.early[knot] = sum;
        else if (knot < 7)
            place->ground.along[knot - 4] = sum;
        else
            place->ground.back = sum;
    }
}

/* The parts of the height are polynomials too. */
static void place_heights(rover_place *place)
{
    double f0 = place->scaled[0], f1 = place->scaled[1], f2 = place->scaled[2];
    const double *n = place->heights;
    double m = place->mass_kg / reference_mass_kg, *to = place->ground.height;
    const double base[6] = {1.0, f0, m, f2 * f2, f0 * f2, f0 * f0};
    to[0] = n[35] * f1;
    to[1] = n[36] * f1;
    for (int term = 0; term < 6; term++) {
        to[0] += n[term] * base[term];
        to[1] += n[6 + term] * base[term];
    }
    to[2] = n[12] + n[13] * f0 + n[14] * f2 + n[15] * f1;
    to[3] = n[16] + n[17] * f0 + n[18] * f2 + n[19] * f1;
    to[4] = n[20] + n[21] * m + n[22] * f0;
    to[5] = n[23] + n[24] * m + n[25] * f0;
    to[6] = n[26] + n[27] * m;
    to[7] = n[28] + n[29] * m + n[30] * f0;
    to[8] = n[31] + n[32] * m + n[34] * f0;
    to[9] = n[33];
}

/* What only a rover needs whose wheels are not locked */
static void place_motors(rover_place *place)
{
    const rover_parameters *p = place->parameters;
    double ratio = place->ratio;
    place->ground.torque = 2.0 * ratio;
    place->ground.share = ratio * ratio / (ratio * ratio + p->free_ratio * p->free_ratio);
    place->ground.digging = p->dig[0] + p->dig[1] * place->scaled[0] + p->dig[2] * place->scaled[1]
        + p->dig[3] * place->scaled[2];
}

void rover_place_at(rover_place *place, double mass_kg, double slope_rad, double torque_nm)
{
    int same = 1;
    if (place->mass_kg != mass_kg)
        place_mass(place, mass_kg);
    if (place->torque_nm != torque_nm) {
        place_torque(place, torque_nm);
        same = 0;
    }
    if (place->slope_rad != slope_rad) {
        place_slope(place, slope_rad);
        same = 0;
    }
    if (same)
        return;
    if (place->heights)
        place_heights(place);
    place->driven = place->stall_summed = 0;
}

void rover_place_driven(rover_place *place, const double *weights)
{
    if (place->driven)
        return;
    place_load(place);
    place_resistances(place);
    place_motors(place);
    double sums[2];
    ROVER_CALL(place->law->vector_bits, motion_sums, (place->law, place->scaled, weights, sums));
    place->ground.motion = sums[0];
    place->ground.rut = sums[1];
    place->driven = 1;
}

void rover_place_stall(rover_place *place, const double *weights)
{
    if (place->stall_summed)
        return;
    ROVER_CALL(place->law->vector_bits, stall_sums, (place->law, place->scaled, weights, &place->ground.stall));
    place->stall_summed = 1;
}
