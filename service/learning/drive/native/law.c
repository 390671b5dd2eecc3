/* The law for one rover: the texts, and its ruts. */
#include <math.h>

#include "law.h"

#include "one.h"
#define STATE rover_state
#define PLACE rover_place

ROVER_INLINE double rover_rut(const rover_state *state, uint64_t cell)
{
    return state->ruts[cell % ROVER_RUT_CELLS];
}

/* The sum of the bumps that hold a stuck rover, made once */
ROVER_INLINE void rover_need_stall(rover_place *place, const double *weights)
{
    rover_place_stall(place, weights);
}

/* Leaves the front slip on the ground that the front wheel has newly reached. */
static void rover_leave_ruts(rover_state *state, double before_m, double front_m)
{
    double start = state->frontier_m;
    front_m = rover_held(front_m, -most_m, most_m);
    if (!(front_m > start))
        return;
    if (start <= -most_m)
        start = before_m - 0.3;
    double newest = floor(front_m * per_rut_cell_m) + 1.0, oldest = ceil(start * per_rut_cell_m);
    if (!(oldest > newest - (ROVER_RUT_CELLS - 1)))
        oldest = newest - (ROVER_RUT_CELLS - 1);
    for (double cell = oldest; cell <= newest; cell += 1.0)
        state->ruts[(uint64_t)(int64_t)cell % ROVER_RUT_CELLS] = state->front_slip;
    state->frontier_m = front_m;
}

#include "axle_text.h"
#include "law_text.h"

#include "end.h"

static rover_rolled roll(const rover_place *place, const rover_state *state, double within_s, double lost)
{
    return state->brake == 0.0 ? rover_roll_driven(place, state, within_s, lost) : rover_roll_braked(state, within_s, lost);
}

double rover_law_height(rover_place *place, const rover_state *state)
{
    if (!place->heights)
        return 0.0;
    rover_place_at(place, state->mass_kg, state->slope_rad, state->torque_nm);
    return rover_height_of(place, state, state->x_m, state->path_m, state->dig);
}

void rover_law_cell(rover_place *place, const double *weights, rover_state *state)
{
    double lost;
    rover_place_at(place, state->mass_kg, state->slope_rad, state->torque_nm);
    if (state->brake != 0.0) {
        lost = rover_braked_cell(place, state);
    } else {
        rover_place_driven(place, weights);
        lost = rover_driven_cell(place, weights, state);
    }
    place->end = roll(place, state, state->cell_s, lost);
    place->rolled = 1;
    if (place->heights)
        state->next_height_m = rover_height_of(place, state, place->end.x_m, place->end.path_m, place->end.dig);
}

void rover_law_finish(rover_place *place, rover_state *state, double within_s)
{
    rover_rolled end = place->end;
    if (!place->rolled || within_s != state->cell_s)
        end = roll(place, state, within_s, rover_lost_at(state->rate_per_s, within_s));
    place->rolled = 0;
    rover_end_cell(place, state, within_s, &end, state->brake == 0.0);
}
