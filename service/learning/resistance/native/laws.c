/* Traction: what an axle's wheels push with as a function of their slip, and the speed law that follows from it.
 *
 * The torque of an axle's two motors over the rover's weight and wheel radius, D = 2 q (1 - w/w0) with
 * q = tau/(m g R_w), balances n phi(s): n is the axle's static share of the weight, s = 1 - v/(R_w w) the slip. See
 * traction.py for where the curves phi come from. */
#include "laws.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "exponential.h"

static const double reference_load_kg = 275.0; /* at which slip scales are stated: half of 550 kg on one axle */
static const double least_share = 0.02;        /* of the weight, for an axle: a rover does not tip over here */
static const double least_ratio = 1e-4;        /* without torque the wheels would turn at any speed */
static const double stuck_below = 8.0;         /* sticking widths above the margin: beyond, < 0.001 of the resistance */

/* J(d) = 1 - (1 - exp(-d))/d, Janosi and Hanamoto's shear law averaged over the contact patch, continued as an odd
 * function (Wong, Theory of Ground Vehicles, 4th ed., eq. 2.59) */
ROVER_INLINE double mean_shear(double deformation)
{
    double size = fabs(deformation);
    size = size > 1e-6 ? size : 1e-6;
    double mean = rover_expm1(-size) / size + 1.0;
    return deformation > 0.0 ? mean : deformation < 0.0 ? -mean : 0.0;
}

ROVER_INLINE double held(double value, double lowest, double highest)
{
    value = value > lowest ? value : lowest; /* NaN becomes the lowest */
    return value < highest ? value : highest;
}

ROVER_INLINE double phi(const rover_curve *curve, double slip, double per_scale)
{
    double along = curve->linear * held(slip, -0.5, 1.0);
    double whole = curve->plateau * mean_shear(slip * per_scale) + curve->adhesion + along;
    /* a wheel that turns uphill while the rover slides back loses some of it */
    double back = held((slip - 1.0) / curve->backing_slip, 0.0, 1.0);
    return whole * (1.0 - curve->backing_loss * (back * back * (3.0 - 2.0 * back)));
}

/* 1 / (slip_scale f(load)); with an exponent of zero the load does not matter */
static double per_slip_scale(const rover_curve *curve, double load_kg)
{
    double factor = curve->load_exponent == 0.0 ? 1.0 : pow(load_kg / reference_load_kg, -curve->load_exponent);
    return 1.0 / (curve->slip_scale * factor);
}

void rover_traction(const rover_curve *curve, int64_t count, const double *slip, const double *load_kg, double lowest,
                    double highest, double *result)
{
    for (int64_t i = 0; i < count; i++)
        result[i] = phi(curve, held(slip[i], lowest, highest), per_slip_scale(curve, load_kg[i]));
}

void rover_mean_shear(int64_t count, const double *deformation, double *mean)
{
    for (int64_t i = 0; i < count; i++)
        mean[i] = mean_shear(deformation[i]);
}

/* n_f = (L_r cos th - h sin th)/L - d cos th and n_r = cos th - n_f, with the centre of mass rising with the load */
void rover_axle_shares(const rover_body *body, double angle_rad, double mass_kg, double *front, double *rear)
{
    double payload = (mass_kg - body->unladen_mass_kg) / body->unladen_mass_kg;
    double height = body->centre_height_m + body->height_rise_m * payload;
    double cosine = cos(angle_rad);
    double moment = body->centre_ahead_m * cosine - height * sin(angle_rad);
    double share = moment / body->wheelbase_m - body->share_shift * cosine;
    *front = held(share, least_share * cosine, (1.0 - least_share) * cosine);
    *rear = cosine - *front;
}

/* Where two balances exist, backwards, a wheel that spins and a standing one: take the spinning one while there is
 * one, and let the speeds rise. */
static void let_rise(double *speed, int64_t count, const double *slips)
{
    int64_t forward = 0;
    while (forward < count && slips[forward] > 1.0)
        forward++;
    for (int64_t i = forward - 2; i >= 0; i--)
        speed[i] = speed[i] < speed[i + 1] ? speed[i] : speed[i + 1];
    for (int64_t i = 1; i < count; i++)
        speed[i] = speed[i] > speed[i - 1] ? speed[i] : speed[i - 1];
}

/* One axle over the slip; no equation needs solving. At slip s the motors' law gives the rim speed
 * u = u_0 (1 - n phi(s)/(2 q)), and the rover moves at u (1 - s). */
ROVER_INLINE void balance(const rover_axle *axle, const rover_laws *laws, const rover_curve *curve, double load_kg,
                          double ratio)
{
    const double per_scale = per_slip_scale(curve, load_kg), share = axle->share, most = 2.0 * ratio;
    const double per_most = 1.0 / most, rim_speed = laws->rim_speed_m_s;
    const rover_curve its = *curve;
    const double *restrict slips = laws->slips;
    double *restrict speed = axle->speed_m_s, *restrict torque = axle->torque, *restrict rim = axle->rim_m_s;
    for (int64_t i = 0; i < laws->slip_count; i++) {
        double demand = share * phi(&its, slips[i], per_scale);
        double turning = (1.0 - demand * per_most) * rim_speed;
        rim[i] = turning > 0.0 ? turning : 0.0;
        torque[i] = demand < most ? demand : most;
        speed[i] = rim[i] * (1.0 - slips[i]);
    }
}

ROVER_VERSIONS(balance,
               (const rover_axle *axle, const rover_laws *laws, const rover_curve *curve, double load_kg, double ratio),
               (axle, laws, curve, load_kg, ratio))

static void axle_begin(rover_axle *axle, const rover_laws *laws, const rover_curve *curve, double share,
                       double load_kg, double ratio)
{
    axle->share = share;
    ROVER_CALL(laws->vector_bits, balance, (axle, laws, curve, load_kg, ratio));
    let_rise(axle->speed_m_s, laws->slip_count, laws->slips);
}

/* The last node at or below a value, 0 if there is none */
static int64_t node_below(const double *nodes, int64_t count, double value)
{
    int64_t low = 0, high = count;
    while (high - low > 1) {
        int64_t middle = (low + high) / 2;
        if (nodes[middle] <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Values of an axle's nodes at some rising speeds: straight between nodes, held past the ends */
static void axle_read(const rover_axle *axle, int64_t count, const double *values, int64_t some, const double *speed,
                      double *found)
{
    const double *nodes = axle->speed_m_s;
    int64_t at = node_below(nodes, count, speed[0]);
    for (int64_t i = 0; i < some; i++) {
        while (at + 1 < count && nodes[at + 1] <= speed[i])
            at++;
        int64_t next = at + 1 < count ? at + 1 : at;
        double beyond = speed[i] - nodes[at], width = nodes[next] - nodes[at];
        double fraction = beyond > 0.0 && width > 0.0 ? beyond / width : 0.0;
        found[i] = values[at] + fraction * (values[next] - values[at]);
    }
}

ROVER_INLINE double one_minus_tanh(double angle)
{
    return 2.0 / (1.0 + rover_exp(2.0 * angle));
}

/* Adds to an axle's torques what turns the resistance around where the rover slides back; with a wheel speed only that
 * of wheels that hardly turn */
ROVER_INLINE void stick(const rover_law *law, double share, const double *speed, const double *rim, double *torque)
{
    const double wheel = law->laws->sticking_wheel_m_s, per_wheel = wheel > 0.0 ? 1.0 / wheel : 0.0, per_speed = 1.0 / law->laws->sticking_speed_m_s;
    for (int i = 0; i < ROVER_SPEEDS; i++) {
        double turning = rim[i] * per_wheel;
        double direction = law->stuck * one_minus_tanh(speed[i] * per_speed);
        torque[i] += share * one_minus_tanh(turning * turning) * direction;
    }
}

ROVER_VERSIONS(stick, (const rover_law *law, double share, const double *speed, const double *rim, double *torque),
               (law, share, speed, rim, torque))

void rover_law_tabulate(rover_law *law, int64_t number)
{
    const rover_laws *laws = law->laws;
    const int64_t block = number / ROVER_SPEEDS, first = block * ROVER_SPEEDS, last = laws->speed_count - 1;
    double speed[ROVER_SPEEDS], torque[AXLES][ROVER_SPEEDS], rim[ROVER_SPEEDS];
    for (int i = 0; i < ROVER_SPEEDS; i++) {
        /* The law is held constant past its ends, and its slope there must say so. */
        int64_t at = first + i < 1 ? 1 : first + i;
        speed[i] = laws->speeds_m_s[at < last ? at : last - 1];
    }
    for (int axle = 0; axle < AXLES; axle++) {
        const rover_axle *one = &law->axles[axle];
        axle_read(one, laws->slip_count, one->torque, ROVER_SPEEDS, speed, torque[axle]);
        if (law->stuck > 0.0) {
            axle_read(one, laws->slip_count, one->rim_m_s, ROVER_SPEEDS, speed, rim);
            ROVER_CALL(laws->vector_bits, stick, (law, one->share, speed, rim, torque[axle]));
        }
    }
    for (int i = 0; i < ROVER_SPEEDS; i++) {
        law->virgin[first + i] = torque[FRONT][i] + torque[REAR][i] - law->sine;
        law->rut[first + i] = torque[FRONT][i] + torque[REAR_IN_RUT][i] - law->sine;
    }
    law->ready[block] = 1;
}

/* What the drive pushes with at a crawl on virgin soil, read between the laws' speeds and without sticking */
static double crawl_push(const rover_law *law)
{
    const rover_laws *laws = law->laws;
    const double *speeds = laws->speeds_m_s, asked = laws->margin_speed_m_s;
    int64_t low = node_below(speeds, laws->speed_count, asked);
    int64_t high = low + 1 < laws->speed_count ? low + 1 : low;
    double ends[2] = {speeds[low], speeds[high]}, front[2], rear[2];
    axle_read(&law->axles[FRONT], laws->slip_count, law->axles[FRONT].torque, 2, ends, front);
    axle_read(&law->axles[REAR], laws->slip_count, law->axles[REAR].torque, 2, ends, rear);
    double fraction = high > low && asked > ends[0] ? (asked - ends[0]) / (ends[1] - ends[0]) : 0.0;
    double push = front[0] + rear[0];
    return push + fraction * (front[1] + rear[1] - push);
}

double rover_mass_scale(const rover_laws *laws, double mass_kg)
{
    return pow(mass_kg / laws->reference_mass_kg, laws->mass_exponent);
}

void rover_law_begin(rover_law *law, double angle_rad, double ratio, double mass_kg)
{
    const rover_laws *laws = law->laws;
    double front, rear;
    rover_axle_shares(&laws->body, angle_rad, mass_kg, &front, &rear);
    ratio = ratio > least_ratio ? ratio : least_ratio;
    /* The load of the front wheels was found not to matter beyond the mass: half of it stands for it. */
    axle_begin(&law->axles[FRONT], laws, &laws->curves[FRONT], front, 0.5 * mass_kg, ratio);
    axle_begin(&law->axles[REAR], laws, &laws->curves[REAR], rear, rear * mass_kg, ratio);
    axle_begin(&law->axles[REAR_IN_RUT], laws, &laws->curves[REAR_IN_RUT], rear, rear * mass_kg, ratio);
    law->sine = sin(angle_rad);
    double scale = rover_mass_scale(laws, mass_kg);
    law->margin = crawl_push(law) - law->sine - laws->mean_resistance * scale + laws->mean_resistance;
    double above = (law->margin - laws->sticking_margin) / laws->sticking_width;
    law->stuck = above < stuck_below ? laws->mean_resistance * scale / (1.0 + rover_exp(above)) : 0.0;
    memset(law->ready, 0, (size_t)(laws->speed_count / ROVER_SPEEDS + 1));
}

static int64_t padded_speeds(const rover_laws *laws)
{
    return (laws->speed_count / ROVER_SPEEDS + 1) * ROVER_SPEEDS;
}

int64_t rover_law_doubles(const rover_laws *laws)
{
    return AXLES * 3 * laws->slip_count + 3 * padded_speeds(laws);
}

double *rover_law_place(rover_law *law, const rover_laws *laws, double *workspace)
{
    law->laws = laws;
    for (int axle = 0; axle < AXLES; axle++) {
        law->axles[axle].speed_m_s = workspace;
        law->axles[axle].torque = workspace + laws->slip_count;
        law->axles[axle].rim_m_s = workspace + 2 * laws->slip_count;
        workspace += 3 * laws->slip_count;
    }
    law->virgin = workspace;
    law->rut = workspace + padded_speeds(laws);
    law->ready = (unsigned char *)(workspace + 2 * padded_speeds(laws));
    return workspace + 3 * padded_speeds(laws);
}

int64_t rover_tabulate_laws(const rover_laws *laws, int64_t count, const double *angle_rad, const double *ratio,
                            const double *mass_kg, double *virgin, double *rut, double *margin, double *sine)
{
    double *workspace = malloc((size_t)rover_law_doubles(laws) * sizeof *workspace);
    if (!workspace)
        return ROVER_NO_MEMORY;
    rover_law law;
    rover_law_place(&law, laws, workspace);
    const size_t row = (size_t)laws->speed_count * sizeof(double);
    for (int64_t i = 0; i < count; i++) {
        rover_law_begin(&law, angle_rad[i], ratio[i], mass_kg[i]);
        for (int64_t number = 0; number < laws->speed_count; number += ROVER_SPEEDS)
            rover_law_tabulate(&law, number);
        memcpy(virgin + i * laws->speed_count, law.virgin, row);
        memcpy(rut + i * laws->speed_count, law.rut, row);
        margin[i] = law.margin;
        sine[i] = law.sine;
    }
    free(workspace);
    return ROVER_OK;
}
