/* Motion through cells of time under inputs that change. */
#ifndef ROVER_DRIVE_H
#define ROVER_DRIVE_H

#include "law.h"

/* One call's motion. Where there is no track, the slope is an input. */
typedef struct {
    rover_place place;
    const double *weights;
    const rover_track *track;
    int64_t interval; /* of the track, where the last slope was found */
} rover_motion;

typedef struct {
    double torque_nm, slope_rad, offset;
    int brake;
} rover_inputs;

/* The wheels' speeds of both axles (rad/s), added up at the times of `count` rising places: `next` of them are passed. */
typedef struct {
    int64_t count;
    const int64_t *places;
    int64_t next;
    double sum, first, last;
} rover_turning;

/* Where outputs go, by time; all but x may be NULL. */
typedef struct {
    double *x_m, *speed_m_s, *front_rad_s, *rear_rad_s, *height_m, *slope_rad;
    rover_turning *turning;
} rover_columns;

/* How long a cell is that begins so long after an event */
double rover_cell_length(double event_s, int brake);
void rover_motion_begin(rover_motion *motion, const rover_law *law, const double *numbers, const double *weights,
                        const double *heights, const rover_track *track);
/* Moves a state from a time to another one under the same inputs, and writes what is asked of the times after the
 * first and up to the last: those from number `at` on. Returns the number of the next one. */
int64_t rover_advance(rover_motion *motion, rover_state *state, const rover_inputs *inputs, double from_s,
                      double until_s, int64_t times, const double *time_s, const rover_columns *to, int64_t at);
/* Follows controls from time 0 to the last one asked for. `run` says when the state is set to what was observed; NULL
 * for never. */
void rover_follow(rover_motion *motion, rover_state *state, const rover_controls *controls, double slope_rad,
                  double offset, int64_t times, const double *time_s, const rover_run *run, const rover_columns *to);

/* One rover of rover_step, whose inputs are `count` numbers apart */
void rover_step_alone(rover_motion *motion, rover_state *state, int64_t count, const double *inputs);

#endif
