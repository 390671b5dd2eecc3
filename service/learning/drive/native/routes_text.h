/* Drives along tracks side by side: their cells of time are the same, as their controls change and brake at the same times,
 * and each lane looks up its own slope in each cell. No guard: lanes.c includes it after steps_text.h. */

/* Makes what the slope under each rover's middle decides in the middle of the cell, and its torque. Lanes that are not
 * asked for are as the first. */
TARGET static void NAME(meet)(PLACE *place, const STATE *state, const rover_routes_asked *asked, int64_t control,
                              int64_t *interval)
{
    const double ahead = 0.5 * place->law->wheelbase_m;
    for (int lane = 0; lane < asked->to.lanes; lane++) {
        const rover_route *route = asked->routes + lane;
        rover_place *of = &place->one[lane];
        double torque = rover_told(route->controls, control);
        double middle = state->x_m[lane] + state->speed_m_s[lane] * state->cell_s * 0.5 + ahead;
        double slope = rover_slope_at(route->track, interval + lane, middle);
        if (of->slope_rad == slope && of->torque_nm == torque && of->driven)
            continue;
        rover_place_at(of, route->start->mass_kg, slope, torque);
        if (route->controls->brake[control] == 0.0)
            rover_place_driven(of, place->law->weights);
        NAME(lay_out)(place, lane);
        place->stall_summed = 0;
    }
    for (int lane = asked->to.lanes; lane < LANES; lane++) {
        place->one[lane] = place->one[0];
        NAME(lay_out)(place, lane);
    }
}

TEXT NAME(rolled) NAME(roll)(const PLACE *place, const STATE *state, int brake, double within_s, NUMBER lost)
{
    return brake ? NAME(roll_braked)(state, within_s, lost) : NAME(roll_driven)(place, state, within_s, lost);
}

/* As rover_advance does it with one rover, under a control after another one. */
TARGET static void NAME(advance)(PLACE *place, STATE *state, const rover_routes_asked *asked, int64_t before,
                                 int64_t control, double from, double until, NAME(tile) *tile, int64_t *at,
                                 int64_t *interval)
{
    const rover_controls *controls = asked->routes->controls;
    const int brake = controls->brake[control] != 0.0, same = rover_told_same(controls, before, control);
    if (!(until - from > same_time_s))
        return;
    if (!same && state->cell_s > 0.0) {
        const int braked = controls->brake[before] != 0.0;
        NUMBER lost = NAME(lost_at)(state->rate_per_s, OF(state->within_s));
        NAME(rolled) ended = NAME(roll)(place, state, braked, state->within_s, lost);
        NAME(end_cell)(place, state, state->within_s, &ended, !braked);
    }
    if (!same)
        state->event_s = 0.0;
    double anchor = from - state->within_s, length = state->cell_s;
    int64_t number = 0;
    for (int first = 1;; first = 0, number++) {
        double start = anchor + (double)number * length;
        const int begins = !(state->cell_s > 0.0);
        NUMBER lost;
        if (begins) {
            state->cell_s = rover_cell_length(state->event_s, brake);
            NAME(meet)(place, state, asked, control, interval);
            lost = brake ? NAME(braked_cell)(place, state) : NAME(driven_cell)(place, place->law->weights, state);
            if (first || state->cell_s != length) {
                anchor = start = first ? from : start;
                length = state->cell_s;
                number = 0;
            }
        } else {
            lost = NAME(lost_at)(state->rate_per_s, OF(state->cell_s));
        }
        NAME(rolled) ended = NAME(roll)(place, state, brake, length, lost);
        if (begins && place->law->heights)
            state->next_height_m = NAME(height_of)(place, state, ended.x_m, ended.path_m, ended.dig);
        NAME(write)(&asked->to, tile, state, start, &until, at);
        double end = start + length;
        if (end <= until + same_time_s)
            NAME(end_cell)(place, state, length, &ended, !brake);
        else
            state->within_s = until - start;
        if (end >= until - same_time_s || !(end < until))
            return;
    }
}

/* As rover_follow does it with one rover. */
TARGET static void NAME(follow)(const rover_routes_asked *asked)
{
    const rover_lanes *to = &asked->to;
    const rover_controls *controls = asked->routes->controls;
    PLACE place;
    STATE state;
    NAME(tile) tile = {.count = 0};
    int64_t interval[LANES] = {0}, at[LANES] = {0}, control = 0;
    double now = 0.0;
    memset(&state, 0, sizeof state);
    NAME(begin_place)(&place, to->law);
    for (int lane = 0; lane < LANES; lane++) {
        const rover_route *route = asked->routes + (lane < to->lanes ? lane : 0);
        NAME(take_lane)(&state, lane, route->start);
        state.offset[lane] = route->offset;
    }
    NAME(meet)(&place, &state, asked, 0, interval);
    if (to->law->heights)
        state.height_m = NAME(height_of)(&place, &state, state.x_m, state.path_m, state.dig);
    for (; *at < to->times && !(to->time_s[*at] > same_time_s); ++*at)
        for (int lane = 0; lane < to->lanes; lane++) {
            const double first[5] = {state.x_m[lane], state.speed_m_s[lane], state.front_rad_s[lane],
                                     state.rear_rad_s[lane], state.height_m[lane]};
            NAME(put)(to, first, *at, lane);
        }
    while (*at < to->times) {
        int64_t before = *at, last = control;
        while (control + 1 < controls->count && controls->time_s[control + 1] <= now + same_time_s)
            control++;
        double until = to->time_s[to->times - 1];
        if (control + 1 < controls->count && controls->time_s[control + 1] < until)
            until = controls->time_s[control + 1];
        until = rover_held(until, now, ROVER_MOST_S);
        NAME(advance)(&place, &state, asked, last, control, now, until, &tile, at, interval);
        if (*at == before && !(until > now))
            break;
        now = until;
    }
    NAME(flush)(to, &tile, *at, 0, to->lanes);
    NAME(fill)(to, at);
}

#undef ROVER_EACH
