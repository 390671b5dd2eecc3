/* Steps of rovers side by side: states into lanes, through cells of time that are the same for all, and back. No guard:
 * lanes.c includes it after lanes_text.h for each kind of machine. */

/* Of rover_state what each lane has of its own */
#define ROVER_EACH(of)                                                                                             \
    of(x_m) of(speed_m_s) of(slip_path_m) of(path_m) of(dig) of(furthest_m) of(lowest_m) of(front_slip)              \
        of(frontier_m) of(front_rim_m_s) of(rear_rim_m_s) of(acceleration_m_s2) of(rate_per_s) of(front_rad_s)      \
        of(rear_rad_s) of(front_by_speed) of(rear_by_speed) of(height_m) of(next_height_m)

TARGET static void NAME(take_lane)(STATE *state, int lane, const rover_state *from)
{
#define TAKEN(field) state->field[lane] = from->field;
    ROVER_EACH(TAKEN)
#undef TAKEN
    for (int cell = 0; cell < ROVER_RUT_CELLS; cell++)
        state->ruts[cell][lane] = from->ruts[cell];
}

/* Torques and slopes become those of the step. */
TARGET static void NAME(take)(PLACE *place, STATE *state, const rover_steps_asked *asked)
{
    NAME(begin_place)(place, asked->law);
    state->cell_s = asked->pace.cell_s;
    state->within_s = asked->pace.within_s;
    state->event_s = asked->pace.event_s;
    state->offset = OF(0.0);
    for (int lane = 0; lane < LANES; lane++) {
        int of = lane < asked->lanes ? lane : 0;
        const rover_state *from = asked->states + of;
        const double *inputs = asked->inputs + of;
        NAME(take_lane)(state, lane, from);
        NAME(settle)(place, lane, from->mass_kg, inputs[0], inputs[asked->count]);
    }
}

TARGET static void NAME(give_back)(const STATE *state, const rover_steps_asked *asked)
{
    for (int lane = 0; lane < asked->lanes; lane++) {
        rover_state *to = asked->states + lane;
        to->slope_rad = asked->inputs[lane];
        to->torque_nm = asked->inputs[asked->count + lane];
        to->offset = 0.0;
        to->cell_s = state->cell_s;
        to->within_s = state->within_s;
        to->event_s = state->event_s;
        to->time_s += asked->pace.duration_s;
#define GIVEN(field) to->field = state->field[lane];
        ROVER_EACH(GIVEN)
#undef GIVEN
        for (int cell = 0; cell < ROVER_RUT_CELLS; cell++)
            to->ruts[cell] = state->ruts[cell][lane];
    }
}

/* As rover_advance does it with one rover. */
TARGET static void NAME(step)(const rover_steps_asked *asked)
{
    PLACE place;
    STATE state;
    NAME(take)(&place, &state, asked);
    const double until = asked->pace.duration_s;
    double anchor = -state.within_s, length = state.cell_s;
    int64_t number = 0;
    for (int first = 1;; first = 0, number++) {
        double start = anchor + (double)number * length;
        const int begins = !(state.cell_s > 0.0);
        NUMBER lost;
        if (begins) {
            state.cell_s = rover_cell_length(state.event_s, 0);
            lost = NAME(driven_cell)(&place, asked->law->weights, &state);
            if (first || state.cell_s != length) {
                anchor = start = first ? 0.0 : start;
                length = state.cell_s;
                number = 0;
            }
        } else {
            lost = NAME(lost_at)(state.rate_per_s, OF(state.cell_s));
        }
        NAME(rolled) ended = NAME(roll_driven)(&place, &state, length, lost);
        if (begins && asked->law->heights)
            state.next_height_m = NAME(height_of)(&place, &state, ended.x_m, ended.path_m, ended.dig);
        double end = start + length;
        if (end <= until + same_time_s)
            NAME(end_cell)(&place, &state, length, &ended, 1);
        else
            state.within_s = until - start;
        if (end >= until - same_time_s || !(end < until))
            break;
    }
    NAME(give_back)(&state, asked);
}
