/* dv/dt = g (F - sin(slope) - resistance): traction F of two axles, each turning as fast as its motors and the soil agree
 * on, and resistance that depends on where the rover is and what it did before. */
#include <math.h>

#include "exponential.h"
#include "law.h"

enum { LANES = 8 };
/* Middle and spread of the shipped runs, so that lengths of one are of one kind: tan(slope), ln(torque ratio), ln(mass) */
static const double tangent_middle = 0.27, tangent_spread = 0.19;
static const double ratio_least = 0.05, ratio_middle = 0.37, ratio_spread = 0.55;
static const double reference_mass_kg = 550.0, mass_spread = 0.33, reference_load_kg = 275.0, unladen_mass_kg = 430.0;
static const double slowest_m_s = 0.02;  /* slip is the difference of speeds over the faster one, at least this */
static const double turning_m_s = 0.03;  /* rim speed at which adhesion holds a wheel fully */
static const double early_knots_m[4] = {0.02, 0.08, 0.22, 0.5}, along_knots_m[3] = {1.05, 1.3, 1.7};
static const double full_slip = 1.0 + 1e-9; /* at rest slip is 1 but for rounding: it changes there as it does in motion */
static const double turned_m_s = 0.57;   /* from this rim speed on it does */
static const double close_m_s = 1e-8;
static const double locked_rim_m_s = 0.2;
static const double most_speed_m_s = 20.0, most_force = 4.0, most_ratio = 1e3, most_by_speed = 2.0, least_rate = 0.05, most_rate = 1e4;
static const double most_m = 1e9, most_dig = 1e3;
static const double gone = 30.0; /* exp(-gone) = 1e-13 of what holds a stuck rover: nothing */

static double smooth(double fraction)
{
    double held = rover_held(fraction, 0.0, 1.0);
    return held * held * (3.0 - 2.0 * held);
}

static double power(double base, double exponent)
{
    return rover_exp(exponent * log(base));
}

/* J(d) = 1 - (1 - exp(-d))/d, Janosi and Hanamoto's shear law averaged over the contact patch, continued as an odd
 * function (Wong, Theory of Ground Vehicles, 4th ed., eq. 2.59), and its slope */
static double mean_shear(double d, double *slope)
{
    double size = fabs(d);
    if (size < 1e-3) {
        *slope = 0.5 - size / 3.0;
        return d * (0.5 - size / 6.0);
    }
    double less = rover_expm1(-size), inverse = 1.0 / size, mean = -less * inverse; /* of exp over the patch */
    *slope = (mean - (less + 1.0)) * inverse;
    return d < 0.0 ? mean - 1.0 : 1.0 - mean;
}

/* The same on soil that is sheared already: 1 - left (1 - exp(-d))/d */
static double compacted_shear(double d, double left, double *slope)
{
    d = rover_held(d, -6.0, 60.0);
    if (fabs(d) < 1e-3) {
        *slope = left * (0.5 - d / 3.0);
        return 1.0 - left * (1.0 - d * (0.5 - d / 6.0));
    }
    double less = rover_expm1(-d), inverse = 1.0 / d, mean = -less * inverse;
    *slope = left * (mean - (less + 1.0)) * inverse;
    return 1.0 - left * mean;
}

/* One axle at one moment. phi(slip) = adhesion tanh(rim / turning) + grip (virgin + ruts (in ruts - virgin)) */
typedef struct {
    double share, torque; /* of the weight; of both motors, over weight and radius */
    double adhesion, plateau, per_slip, linear;
    double ruts, rut_plateau, rut_per_slip, rut_shift, rut_left, rut_more;
    double grip;
} axle;

static double shear_of_slip(const axle *a, double slip, double *slope)
{
    double virgin = 0.0, virgin_slope = 0.0;
    if (a->ruts < 1.0) {
        virgin = a->plateau * mean_shear(slip * a->per_slip, &virgin_slope);
        virgin_slope *= a->plateau * a->per_slip;
        virgin += a->linear * rover_held(slip, -0.5, 1.0);
        virgin_slope += slip > -0.5 && slip < full_slip ? a->linear : 0.0;
        if (a->ruts <= 0.0) {
            *slope = virgin_slope;
            return virgin;
        }
    }
    double rut_slope, rut = a->rut_more + a->rut_plateau * compacted_shear((slip - a->rut_shift) * a->rut_per_slip,
                                                                           a->rut_left, &rut_slope);
    rut_slope *= a->rut_plateau * a->rut_per_slip;
    *slope = virgin_slope + a->ruts * (rut_slope - virgin_slope);
    return virgin + a->ruts * (rut - virgin);
}

/* What the motors give beyond what the soil takes, and its slopes over rim speed and rover's speed */
static double excess(const axle *a, double per_no_load, double rim, double speed, double *by_rim, double *by_speed)
{
    double size = fabs(speed), slip, slip_by_rim, slip_by_speed;
    double faster = rim >= size ? rim : size;
    int slow = faster < slowest_m_s;
    double inverse = 1.0 / (slow ? slowest_m_s : faster);
    slip = (rim - speed) * inverse;
    slip_by_rim = inverse;
    slip_by_speed = -inverse;
    if (!slow && rim >= size)
        slip_by_rim = speed * inverse * inverse;
    else if (!slow)
        slip_by_speed -= slip * inverse * (speed < 0.0 ? -1.0 : 1.0);
    if (slip > full_slip || slip < -full_slip) {
        slip = slip > 1.0 ? 1.0 : -1.0;
        slip_by_rim = slip_by_speed = 0.0;
    }
    double slope, soil = a->grip * shear_of_slip(a, slip, &slope);
    slope *= a->grip;
    double turning = rim > turned_m_s ? 1.0 : rover_tanh(rim * (1.0 / turning_m_s));
    double soil_by_rim = slope * slip_by_rim + a->adhesion * (1.0 - turning * turning) * (1.0 / turning_m_s);
    double part = rim * per_no_load, motors = part < 0.0 ? 1.0 : part < 1.0 ? 1.0 - part : 0.0;
    double motors_by_rim = part >= 0.0 && part < 1.0 ? -a->torque * per_no_load : 0.0;
    *by_rim = motors_by_rim - a->share * soil_by_rim - 1e-6;
    *by_speed = -a->share * slope * slip_by_speed;
    return a->torque * motors - a->share * (soil + a->adhesion * turning) - 1e-6 * rim;
}

/* Finds the rim speed at which motors and soil agree, from where it was last; returns what the motors give then, and its
 * slope over the rover's speed; `by_rover` is that of the rim speed. */
static double balance(const axle *a, double no_load, double speed, double *rim, double *by_rover, double *slope)
{
    double reach = 1.6 * fabs(speed) + 0.3, low = -reach, high = reach > no_load ? reach : no_load;
    double at = rover_held(*rim, low, high), by_rim = -1.0, by_speed = 0.0, per_no_load = 1.0 / no_load;
    for (int turn = 0; turn < 60; turn++) {
        double more = excess(a, per_no_load, at, speed, &by_rim, &by_speed);
        low = more > 0.0 ? at : low;
        high = more > 0.0 ? high : at;
        double before = at, next = at - more / by_rim;
        int newton = next > low && next < high;
        at = newton ? next : 0.5 * (low + high);
        double moved = fabs(at - before);
        if (moved < (newton ? close_m_s : 1e-12)) /* what is left then is some thirty times the square */
            break;
    }
    *rim = at;
    int turning = at >= 0.0 && at < no_load;
    *by_rover = rover_held(-by_speed / by_rim, -most_by_speed, most_by_speed);
    *slope = turning ? a->torque * per_no_load * (by_speed / by_rim) : 0.0;
    return at < 0.0 ? a->torque : turning ? a->torque * (1.0 - at * per_no_load) : 0.0;
}

/* Weighted sums over a basis, for one or two rows of weights. Sums go along eight lanes on every machine. */
ROVER_INLINE void basis_sums(const rover_basis *basis, const double *scaled, const double *weights, int rows, double *sums)
{
    const double *first = basis->centres, *second = first + basis->count, *third = second + basis->count;
    double at0 = scaled[0] * basis->scale[0], at1 = scaled[1] * basis->scale[1], at2 = scaled[2] * basis->scale[2];
    double lanes[2][LANES] = {{0.0}};
    for (int64_t i = 0; i < basis->count; i += LANES) {
        double near[LANES];
        for (int lane = 0; lane < LANES; lane++) {
            double u = at0 - first[i + lane], v = at1 - second[i + lane], w = at2 - third[i + lane];
            near[lane] = rover_exp(-(u * u + v * v + w * w));
        }
        for (int row = 0; row < rows; row++)
            for (int lane = 0; lane < LANES; lane++)
                lanes[row][lane] += near[lane] * weights[row * basis->count + i + lane];
    }
    for (int row = 0; row < rows; row++) {
        const double *l = lanes[row];
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

/* Straight lines between values at knots, from zero at `low` to zero at `high`; flat up to the first knot if that is
 * `low` too. */
static double between_knots(int count, const double *knots, const double *values, double low, double high, double at)
{
    if (at <= low)
        return low < knots[0] ? 0.0 : values[0];
    if (at >= high)
        return 0.0;
    double before = low, value = 0.0;
    for (int i = 0; i < count; i++) {
        if (at < knots[i])
            return value + (at - before) / (knots[i] - before) * (values[i] - value);
        before = knots[i];
        value = values[i];
    }
    return value * (1.0 - (at - before) / (high - before));
}

void rover_place_begin(rover_place *place, const rover_law *law, const double *parameters, const double *heights)
{
    place->law = law;
    place->parameters = (const rover_parameters *)parameters;
    place->heights = heights;
    place->mass_kg = place->slope_rad = place->torque_nm = NAN;
    place->rolled = 0;
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
    place->mass_scale = power(mass_kg / reference_mass_kg, p->mass_exponent);
    place->front_slip_scale = power(mass_kg / reference_mass_kg, p->front_load_exponent) / p->front_slip_scale;
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
    place->sine = sine;
    place->scaled[0] = within_reach(law, 0, (sine / cosine - tangent_middle) / tangent_spread);
    double height = law->centre_height_m + p->height_rise_m * (place->mass_kg - unladen_mass_kg) / unladen_mass_kg;
    double front = (law->centre_ahead_m * cosine - height * sine) / law->wheelbase_m - p->share_shift * cosine;
    place->front_share = rover_held(front, 0.02, 0.98);
    place->rear_share = rover_held(cosine - place->front_share, 0.02, 1.0);
}

static void place_load(rover_place *place)
{
    const rover_parameters *p = place->parameters;
    double load = log(place->rear_share * place->mass_kg / reference_load_kg);
    place->rear_slip_scale = rover_exp(p->rear_load_exponent * load) / p->rear_slip_scale;
    place->rut_slip_scale = rover_exp(p->rut_load_exponent * load) / p->rut_slip_scale;
    place->compaction = p->compaction * rover_exp(p->compaction_exponent * load);
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
            place->early[knot] = sum;
        else if (knot < 7)
            place->along[knot - 4] = sum;
        else
            place->back = sum;
    }
}

/* The parts of the height are polynomials too. */
static void place_heights(rover_place *place)
{
    double f0 = place->scaled[0], f1 = place->scaled[1], f2 = place->scaled[2];
    const double *n = place->heights;
    double m = place->mass_kg / reference_mass_kg, *to = place->height;
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

/* Makes what slope, torque and mass of a state decide, as far as they changed. */
static void place_at(rover_place *place, const rover_state *state)
{
    int same = 1;
    if (place->mass_kg != state->mass_kg)
        place_mass(place, state->mass_kg);
    if (place->torque_nm != state->torque_nm) {
        place_torque(place, state->torque_nm);
        same = 0;
    }
    if (place->slope_rad != state->slope_rad) {
        place_slope(place, state->slope_rad);
        same = 0;
    }
    if (same)
        return;
    if (place->heights)
        place_heights(place);
    place->driven = place->stall_summed = 0;
}

/* What only a rover needs whose wheels are not locked */
static void place_driven(rover_place *place, const double *weights)
{
    if (place->driven)
        return;
    place_load(place);
    place_resistances(place);
    double sums[2];
    ROVER_CALL(place->law->vector_bits, motion_sums, (place->law, place->scaled, weights, sums));
    place->motion = sums[0];
    place->rut = sums[1];
    place->driven = 1;
}

/* What holds a rover that barely moves; its sum is made only for one that is slow enough for it. */
static double stuck_at(rover_place *place, const double *weights, double speed)
{
    double faster = (speed - place->parameters->gate_speed_m_s) / place->parameters->gate_width_m_s;
    if (faster > gone)
        return 0.0;
    if (!place->stall_summed) {
        ROVER_CALL(place->law->vector_bits, stall_sums, (place->law, place->scaled, weights, &place->stall));
        place->stall_summed = 1;
    }
    return place->stall / (1.0 + rover_exp(faster));
}

/* The front slip where the rear wheel is: of the ring's cells, the oldest for what lies behind them. */
static double slip_in_rut(const rover_state *state, double x_m)
{
    double newest = floor(rover_held(state->frontier_m, -most_m, most_m) / ROVER_RUT_CELL_M) + 1.0;
    double at = rover_held(x_m / ROVER_RUT_CELL_M, newest - (ROVER_RUT_CELLS - 1), newest - 1.0);
    double whole = floor(at), rest = at - whole;
    int64_t cell = (int64_t)whole;
    double here = state->ruts[(uint64_t)cell % ROVER_RUT_CELLS], next = state->ruts[(uint64_t)(cell + 1) % ROVER_RUT_CELLS];
    return here + rest * (next - here);
}

static double of_scenario(const double *numbers, const double *scaled)
{
    return numbers[0] + numbers[1] * scaled[0] + numbers[2] * scaled[1] + numbers[3] * scaled[2];
}

/* How far the rear wheels run in ruts: of the front wheels, or of their own where the rover came back. */
static double in_ruts(const rover_parameters *p, const rover_state *state, double x_m)
{
    double ruts = smooth((x_m - p->rut_begin_m) / (p->rut_end_m - p->rut_begin_m));
    double again = smooth((state->furthest_m - x_m - 0.05) / 0.3) * smooth((x_m - state->lowest_m + 0.1) / 0.2);
    return again > ruts ? again : ruts;
}

static double height_of(const rover_place *place, const rover_state *state, double x_m, double path_m, double dig)
{
    const double *part = place->height;
    double ruts = in_ruts(place->parameters, state, x_m), dug = dig / (1.0 + dig);
    double slip = rover_held(slip_in_rut(state, x_m), 0.0, 1.0), back = smooth(-x_m / 0.3);
    return part[0] + ruts * (part[1] + dug * part[5] + slip * part[7]) + part[2] * rover_exp(-path_m / 0.1)
        + part[3] * rover_exp(-path_m / 0.4) + dug * (part[4] + dug * part[6]) + back * (part[8] + dug * part[9]);
}

double rover_law_height(rover_place *place, const rover_state *state)
{
    if (!place->heights)
        return 0.0;
    place_at(place, state);
    return height_of(place, state, state->x_m, state->path_m, state->dig);
}

/* Bounds that hold whatever the numbers are: resistance pushes a rover no more than its own traction does
 * (what it does to one that slides back is lost traction as well), wheels never drive beyond their speed without load, nothing falls faster than freely. `power`
 * is what drives, to no more than `top` speed; `resistance` all that resists. */
static void bounded_cell(const rover_place *place, rover_state *state, double power, double top, double resistance,
                         double rate)
{
    double speed = state->speed_m_s, gravity = place->law->gravity_m_s2;
    power = rover_held(power, -most_force, most_force);
    resistance = rover_held(resistance, speed < 0.0 ? -most_force : power > 0.0 ? -power : 0.0, most_force);
    rate = rover_held(rate, least_rate, most_rate);
    double force = power - place->sine - resistance;
    double uphill = place->sine > 0.0 ? place->sine : 0.0, downhill = place->sine < 0.0 ? -place->sine : 0.0;
    double gain = gravity / rate * -rover_expm1(-rate * state->cell_s); /* of speed in the cell, per force */
    double faster = speed < top ? (top - speed) / gain : 0.0, slower = speed > 0.0 ? speed / gain : 0.0;
    /* Either gravity alone would do it, or it ends with the cell: at the top, or at rest. */
    force = rover_held(force, -(uphill > slower ? uphill : slower), downhill > faster ? downhill : faster);
    state->acceleration_m_s2 = gravity * force;
    state->rate_per_s = rate;
}

static void braked_cell(rover_place *place, rover_state *state)
{
    const rover_parameters *p = place->parameters;
    double sliding = rover_tanh(state->speed_m_s / p->brake_speed_m_s);
    double rate = place->law->gravity_m_s2 * p->brake_friction * (1.0 - sliding * sliding) / p->brake_speed_m_s;
    bounded_cell(place, state, 0.0, 0.0, p->brake_friction * sliding, rate);
    state->front_rim_m_s = state->rear_rim_m_s = locked_rim_m_s;
    state->front_rad_s = state->rear_rad_s = state->front_by_speed = state->rear_by_speed = 0.0;
}

static void driven_cell(rover_place *place, const double *weights, rover_state *state)
{
    const rover_parameters *p = place->parameters;
    const rover_law *law = place->law;
    place_driven(place, weights);
    double speed = state->speed_m_s, x = state->x_m + speed * state->cell_s * 0.5, no_load = law->rim_speed_m_s;
    double per_radius = 1.0 / law->wheel_radius_m;
    double ratio = place->ratio, share = ratio * ratio / (ratio * ratio + p->free_ratio * p->free_ratio);
    double backed = state->furthest_m - state->x_m; /* how far the rover has come down from its furthest point */

    double ruts = in_ruts(p, state, x);
    double front_ruts = smooth((state->frontier_m - (x + law->wheelbase_m) - 0.05) / 0.3);
    double slip = rover_held(slip_in_rut(state, x), 0.0, 0.95);
    slip = slip / (1.0 - p->compaction_bend * slip);

    axle front = {.share = place->front_share, .torque = 2.0 * ratio, .adhesion = p->front_adhesion, .grip = 1.0,
                  .plateau = p->front_plateau, .linear = p->front_linear};
    front.per_slip = place->front_slip_scale * (1.0 + p->front_in_rut * front_ruts);
    axle rear = {.share = place->rear_share, .torque = 2.0 * ratio, .adhesion = p->rear_adhesion, .grip = 1.0,
                 .plateau = p->rear_plateau, .per_slip = place->rear_slip_scale, .linear = p->rear_linear,
                 .ruts = ruts, .rut_plateau = p->rut_plateau, .rut_per_slip = place->rut_slip_scale,
                 .rut_shift = p->rut_slip_shift};
    rear.rut_left = rover_exp(-rover_held(place->compaction * slip, 0.0, 30.0));
    rear.rut_more = p->rut_adhesion + p->compaction_adhesion * slip - p->rear_adhesion;
    if (speed < 0.02)
        rear.grip = 1.0 - p->backing_relief * (1.0 - rover_exp(-backed / p->backing_length_m)) * smooth((0.02 - speed) / 0.04);
    double front_slope, rear_slope;
    double traction = balance(&front, no_load, speed, &state->front_rim_m_s, &state->front_by_speed, &front_slope);
    traction += balance(&rear, no_load, speed, &state->rear_rim_m_s, &state->rear_by_speed, &rear_slope);
    double rim = 0.5 * (state->front_rim_m_s + state->rear_rim_m_s);
    /* Ways and digging at the middle of the cell */
    double half_s = 0.5 * state->cell_s, way = fabs(speed) * half_s, slid = rim > speed ? (rim - speed) * half_s : 0.0;
    double path = state->path_m + way, dig = state->dig + (slid - state->dig * way) / p->dig_length_m;
    dig = rover_held(dig, 0.0, most_dig);
    double sheared = 1.0 - p->shear_lack * rover_exp(-(state->slip_path_m + slid) / p->shear_slip_m);
    traction *= sheared;
    double traction_slope = (front_slope + rear_slope) * sheared;
    state->front_rad_s = state->front_rim_m_s * per_radius;
    state->rear_rad_s = state->rear_rim_m_s * per_radius;
    state->front_by_speed *= per_radius;
    state->rear_by_speed *= per_radius;

    double slipping = rim > 1e-3 ? rover_held(1.0 - speed / rim, 0.0, 1.0) : 0.0;
    double turning = rover_tanh(speed / p->turning_speed_m_s);
    double level;
    if (speed >= 0.0) {
        double driven = place->mass_scale * (p->resistance - p->front_rut_resistance * front_ruts
                            + ruts * (p->rut_resistance + p->compaction_resistance * (slip - 0.5) - p->resistance))
            + p->speed_resistance * speed + place->motion + ruts * place->rut
            + of_scenario(p->dig, place->scaled) * (dig / (1.0 + dig) - slipping)
            + p->near * rover_exp(-path / p->near_length_m)
            + p->far * rover_exp(-path / p->far_length_m)
            + between_knots(4, early_knots_m, place->early, early_knots_m[0], 0.95, path)
            + between_knots(3, along_knots_m, place->along, 0.85, 2.4, x);
        double free = place->mass_scale * p->free_resistance * (1.0 - p->free_rut_relief * ruts);
        level = share * driven + (1.0 - share) * free;
    } else {
        double spin = state->rear_rim_m_s > 0.0 ? state->rear_rim_m_s : 0.0;
        level = place->mass_scale * (p->back_resistance * (1.0 - p->back_rut_relief * smooth(x / 0.3))
                                     - p->back_spin_relief * rover_tanh(spin / p->back_spin_m_s)
                                     - p->back_hold_relief * rover_exp(-backed / p->back_hold_length_m))
            + share * place->back;
    }
    double stuck = share * stuck_at(place, weights, speed);
    double level_slope = level * (1.0 - turning * turning) / p->turning_speed_m_s
        + (speed > 0.0 ? p->speed_resistance : 0.0);
    bounded_cell(place, state, traction - stuck, no_load, level * turning + state->offset,
                 -law->gravity_m_s2 * (traction_slope - level_slope));
}

static rover_rolled roll(const rover_place *place, const rover_state *state, double within_s)
{
    const rover_parameters *p = place->parameters;
    rover_rolled end = {.path_m = state->path_m, .slip_path_m = state->slip_path_m, .dig = state->dig};
    rover_moved(state, within_s, &end.x_m, &end.speed_m_s);
    double way = fabs(end.x_m - state->x_m);
    if (state->brake != 0.0) {
        if (fabs(end.speed_m_s) < 0.03) { /* a standstill */
            end.path_m = end.slip_path_m = 0.0;
            end.dig *= rover_exp(-within_s / 0.2);
        }
    } else {
        double faster = 0.5 * (end.speed_m_s - state->speed_m_s); /* at the middle */
        double rim = 0.5 * (state->front_rim_m_s + state->rear_rim_m_s
                            + (state->front_by_speed + state->rear_by_speed) * faster * place->law->wheel_radius_m);
        double slipped = (rim - state->speed_m_s - faster) * within_s;
        slipped = slipped > 0.0 ? slipped : 0.0;
        double kept = rover_exp(-way / p->dig_length_m);
        double dug = way > 1e-7 ? slipped / way * (1.0 - kept) : slipped / p->dig_length_m;
        end.path_m += way;
        end.slip_path_m += slipped;
        end.dig = rover_held(end.dig * kept + dug, 0.0, most_dig);
    }
    end.x_m = rover_held(end.x_m, -most_m, most_m);
    end.speed_m_s = rover_held(end.speed_m_s, -most_speed_m_s, most_speed_m_s);
    return end;
}

void rover_law_cell(rover_place *place, const double *weights, rover_state *state)
{
    place_at(place, state);
    if (state->brake != 0.0)
        braked_cell(place, state);
    else
        driven_cell(place, weights, state);
    if (place->heights) {
        place->end = roll(place, state, state->cell_s);
        place->rolled = 1;
        state->next_height_m = height_of(place, state, place->end.x_m, place->end.path_m, place->end.dig);
    }
}

/* Leaves the front slip on the ground that the front wheel has newly reached. */
static void leave_ruts(rover_state *state, double before_m, double front_m)
{
    double start = state->frontier_m;
    front_m = rover_held(front_m, -most_m, most_m);
    if (!(front_m > start))
        return;
    if (start <= -most_m)
        start = before_m - 0.3;
    double newest = floor(front_m / ROVER_RUT_CELL_M) + 1.0, oldest = ceil(start / ROVER_RUT_CELL_M);
    if (!(oldest > newest - (ROVER_RUT_CELLS - 1)))
        oldest = newest - (ROVER_RUT_CELLS - 1);
    for (double cell = oldest; cell <= newest; cell += 1.0)
        state->ruts[(uint64_t)(int64_t)cell % ROVER_RUT_CELLS] = state->front_slip;
    state->frontier_m = front_m;
}

void rover_law_finish(rover_place *place, rover_state *state, double within_s)
{
    const rover_parameters *p = place->parameters;
    rover_rolled end = place->rolled && within_s == state->cell_s ? place->end : roll(place, state, within_s);
    place->rolled = 0;
    double x = state->x_m, faster = end.speed_m_s - state->speed_m_s, middle = state->speed_m_s + 0.5 * faster;
    double radius = place->law->wheel_radius_m, front_rise = state->front_by_speed * faster;
    double rear_rise = state->rear_by_speed * faster, front = state->front_rim_m_s + 0.5 * radius * front_rise;
    state->front_rim_m_s += radius * front_rise;
    state->rear_rim_m_s += radius * rear_rise;
    state->front_rad_s += front_rise;
    state->rear_rad_s += rear_rise;
    state->height_m += within_s / state->cell_s * (state->next_height_m - state->height_m);
    state->x_m = end.x_m;
    state->speed_m_s = end.speed_m_s;
    state->path_m = end.path_m;
    state->slip_path_m = end.slip_path_m;
    state->dig = end.dig;
    state->event_s += within_s;
    state->cell_s = state->within_s = 0.0;
    state->furthest_m = end.x_m > state->furthest_m ? end.x_m : state->furthest_m;
    state->lowest_m = end.x_m < state->lowest_m ? end.x_m : state->lowest_m;
    if (state->brake != 0.0)
        return;
    double slip = front > 1e-3 ? rover_held((front - middle) / front, -0.2, 1.0) : 0.0;
    state->front_slip += (slip - state->front_slip) * -rover_expm1(-fabs(end.x_m - x) / p->slip_lag_m);
    leave_ruts(state, x + place->law->wheelbase_m, end.x_m + place->law->wheelbase_m);
}
