/* The equation of motion, one step at a time. */
#ifndef ROVER_MOTION_H
#define ROVER_MOTION_H

#include "engine.h"
#include "laws.h"
#include "scenario.h"

/* A process along its knots of travel at one scenario, evaluated block by block where somebody asks:
 * `scale` (`base` + what the process says). */
typedef struct {
    const rover_model *model;
    const rover_process *process;
    const rover_weights *weights;
    double base, scale;
    double *values;
    unsigned char *ready;
} rover_along;

/* What moves a rover. Slope, mass and torque act through `law` and `resistance`: to change them underway, set these
 * up anew; the state stays. What a step makes of a force is kept while rate and duration stay, as in steady motion. */
typedef struct {
    rover_law *law;
    rover_along *resistance;
    const double *blend; /* 0 on virgin soil, 1 in the ruts, at the cells of the resistance's knots */
    double gravity_m_s2, steepest;
    double per_travel, lowest_speed, per_speed, last_speed; /* of the uniform grids of knots and speeds */
    double rate_per_change;
    double kept_rate, kept_duration, speed_per_force, travel_per_force;
} rover_motion;

typedef struct {
    double travel_m, speed_m_s;
} rover_state;

void rover_along_begin(rover_along *along);
void rover_along_evaluate(rover_along *along, int64_t knot);
void rover_motion_begin(rover_motion *motion, const rover_model *model, rover_law *law, rover_along *resistance);

/* Advances the state by `duration_s`. `release` is the resistance beyond that along the travel at the middle of the
 * step; the speed stays within `bound_m_s`. */
void rover_step(rover_motion *motion, rover_state *state, double duration_s, double release, double bound_m_s);

/* Sums of LANES columns over the rows of a block (row, lane), each row with its weight */
void rover_weighted_sums(int64_t vector_bits, const double *block, const double *weights, int64_t rows,
                         double *sums);

/* The value at a `rover_place`: straight between knots */
static inline double rover_along_at(rover_along *along, double place)
{
    const rover_knots *knots = &along->process->knots;
    int64_t knot = knots->knot[(int64_t)place];
    if (!along->ready[(uint64_t)knot / ROVER_LANES])
        rover_along_evaluate(along, knot);
    if (!along->ready[(uint64_t)(knot + 1) / ROVER_LANES])
        rover_along_evaluate(along, knot + 1);
    double low = along->values[knot];
    return low + (place - knots->number[knot]) * knots->inverse[knot] * (along->values[knot + 1] - low);
}

/* Where a travel lies, in steps from the first knot, held to the knots: its whole steps are the number of a cell. */
static inline double rover_place(const rover_knots *knots, double travel_m, double per_step)
{
    double place = (travel_m - knots->first_m) * per_step, last = (double)knots->cell_count - 0.000001;
    if (place > 0.0 && place < last)
        return place;
    return place > 0.0 ? last : 0.0; /* NaN becomes the first knot */
}

#endif
