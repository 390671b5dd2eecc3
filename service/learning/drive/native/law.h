/* The law: what moves a rover, made linear in the speed for one cell of time. Its texts (*_text.h) are compiled for one
 * rover (law.c) and for several side by side (lanes.c). */
#ifndef ROVER_LAW_H
#define ROVER_LAW_H

#include "engine.h"
#include "exponential.h"

#include "one.h"

#include "ground_text.h"

#include "end.h"

static const double slowest_m_s = 0.02;  /* slip is the difference of speeds over the faster one, at least this */
static const double turning_m_s = 0.03;  /* rim speed at which adhesion holds a wheel fully */
static const double early_knots_m[4] = {0.02, 0.08, 0.22, 0.5}, along_knots_m[3] = {1.05, 1.3, 1.7};
static const double full_slip = 1.0 + 1e-9; /* at rest slip is 1 but for rounding: it changes there as it does in motion */
static const double turned_m_s = 0.42;   /* from this rim speed on it does, but for 1e-12 */
static const double close_m_s = 1e-6, none_m_s = 1e-12; /* steps of rim speeds */
static const double locked_rim_m_s = 0.2, first_rim_m_s = 0.3, nowhere_m = -1e9;
static const double most_speed_m_s = 20.0, most_force = 4.0, most_by_speed = 2.0, least_rate = 0.05, most_rate = 1e4;
static const double most_m = 1e9, most_dig = 1e3;
static const double gone = 30.0; /* exp(-gone) = 1e-13 of something: nothing */
static const double per_rut_cell_m = 25.0; /* cells of ground whose ruts are known, by their number */
/* Cells of time are short until so long after an event; locked wheels need cells that are eight times shorter. */
static const double short_cell_s = 0.02, long_cell_s = 0.05, short_until_s = 0.3, brake_cells = 8.0;
static const double same_time_s = 1e-10;

/* One over what parameters are lengths, widths and speeds of */
typedef struct {
    double rut_width, near, far, dig_length, shear_slip, backing, back_spin, back_hold, gate_width, turning_speed;
    double slip_lag, brake_speed, radius;
} rover_reciprocals;

/* What only slope, torque and mass decide. Kept while these stay. */
typedef struct {
    const rover_law *law;
    const rover_parameters *parameters;
    const double *heights;
    rover_reciprocals per;
    double mass_kg, slope_rad, torque_nm; /* of which the rest was made; NaN before the first */
    double ratio;                         /* of the motors' torque to weight times radius */
    double scaled[3];
    int driven;                           /* whether there is what locked wheels do not need */
    int stall_summed;                     /* whether there is `stall` */
    rover_ground ground;
    int rolled;                           /* whether there is this: the end of the cell that was begun last */
    rover_rolled end;
} rover_place;

/* Begins to keep things for a law, whose parameters and heights are those given; heights may be NULL. */
void rover_place_begin(rover_place *place, const rover_law *law, const double *parameters, const double *heights);
/* Makes what slope, torque and mass decide, as far as they changed; then what a rover needs whose wheels are not locked,
 * and what one needs that barely moves. */
void rover_place_at(rover_place *place, double mass_kg, double slope_rad, double torque_nm);
void rover_place_driven(rover_place *place, const double *weights);
void rover_place_stall(rover_place *place, const double *weights);

/* Height of the rear wheel centre at a state's position, way and digging, under its slope and torque */
double rover_law_height(rover_place *place, const rover_state *state);
/* Acceleration, rate and wheel speeds of a new cell from a state on, whose inputs and length are set. */
void rover_law_cell(rover_place *place, const double *weights, rover_state *state);
/* Moves the state to a time in its cell and ends the cell there. Between a cell's begin and its end no other state may
 * use the place, unless `rolled` is set to 0. */
void rover_law_finish(rover_place *place, rover_state *state, double within_s);

/* Position and speed at a time within the present cell. */
ROVER_INLINE void rover_moved_to(const rover_state *state, double within_s, double *x_m, double *speed_m_s)
{
    double lost = -rover_expm1(-state->rate_per_s * within_s), inverse = 1.0 / state->rate_per_s;
    double reach = state->acceleration_m_s2 * inverse;
    *x_m = state->x_m + state->speed_m_s * within_s + reach * (within_s - lost * inverse);
    *speed_m_s = state->speed_m_s + reach * lost;
}

#endif
