/* The law: what moves a rover, made linear in the speed for one cell of time. */
#ifndef ROVER_LAW_H
#define ROVER_LAW_H

#include "engine.h"
#include "exponential.h"

#define ROVER_RUT_CELL_M 0.04

/* Where a state is at a time in its cell, and how deep it has dug */
typedef struct {
    double x_m, speed_m_s, path_m, slip_path_m, dig;
} rover_rolled;

/* What only slope, torque and mass decide. Kept while these stay. */
typedef struct {
    const rover_law *law;
    const rover_parameters *parameters;
    const double *heights;
    double mass_kg, slope_rad, torque_nm; /* of which the rest was made; NaN before the first */
    double ratio;                         /* of the motors' torque to weight times radius */
    double sine, front_share, rear_share;
    double scaled[3];
    double mass_scale, front_slip_scale;
    double height[10];                    /* what its parts are multiplied with, see law_height */
    int driven;                           /* whether there are these, which locked wheels do not need: */
    double rear_slip_scale, rut_slip_scale, compaction;
    double early[4], along[3];            /* at their knots */
    double back;                          /* what the scenario adds where the rover goes back */
    double motion, rut;                   /* what the basis makes of it */
    int stall_summed;                     /* whether there is this */
    double stall;
    int rolled;                           /* whether there is this: the end of the cell that was begun last */
    rover_rolled end;
} rover_place;

/* Begins to keep things for a law, whose parameters and heights are those given; heights may be NULL. */
void rover_place_begin(rover_place *place, const rover_law *law, const double *parameters, const double *heights);
/* Height of the rear wheel centre at a state's position, way and digging, under its slope and torque */
double rover_law_height(rover_place *place, const rover_state *state);
/* Acceleration, rate and wheel speeds of a new cell from a state on, whose inputs and length are set. */
void rover_law_cell(rover_place *place, const double *weights, rover_state *state);
/* Moves the state to a time in its cell and ends the cell there. Between a cell's begin and its end no other state may
 * use the place, unless `rolled` is set to 0. */
void rover_law_finish(rover_place *place, rover_state *state, double within_s);

/* The number within two others; NaN becomes the lower one. */
ROVER_INLINE double rover_held(double number, double low, double high)
{
    double above = number > low ? number : low;
    return above < high ? above : high;
}

/* Position and speed at a time within the present cell. */
ROVER_INLINE void rover_moved(const rover_state *state, double within_s, double *x_m, double *speed_m_s)
{
    double lost = -rover_expm1(-state->rate_per_s * within_s), inverse = 1.0 / state->rate_per_s;
    double reach = state->acceleration_m_s2 * inverse;
    *x_m = state->x_m + state->speed_m_s * within_s + reach * (within_s - lost * inverse);
    *speed_m_s = state->speed_m_s + reach * lost;
}

#endif
