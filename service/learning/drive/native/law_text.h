/* The law over one cell of time, for one rover or for several side by side (one.h): dv/dt = g (F - sin(slope) -
 * resistance), with traction F of two axles, each turning as fast as its motors and the soil agree on, and resistance
 * that depends on where the rover is and what it did before. */

/* Downwards to a whole number, which is small enough to be one in the last bits beside 2^52. */
TEXT NUMBER NAME(floor)(NUMBER number, BITS *whole)
{
    const double round = 0x1.8p52;
    NUMBER nearest = (number + round) - round;
    NUMBER found = PICK(nearest > number, nearest - 1.0, nearest);
    *whole = AS_BITS(found + round);
    return found;
}

/* The front slip where the rear wheel is: of the ring's cells, the oldest for what lies behind them. */
TEXT NUMBER NAME(slip_in_rut)(const STATE *state, NUMBER x_m)
{
    BITS cell;
    NUMBER newest = NAME(floor)(HELD(state->frontier_m, -most_m, most_m) * per_rut_cell_m, &cell) + 1.0;
    NUMBER at = NAME(held)(x_m * per_rut_cell_m, newest - (ROVER_RUT_CELLS - 1.0), newest - 1.0);
    NUMBER rest = at - NAME(floor)(at, &cell);
    NUMBER here = NAME(rut)(state, cell), next = NAME(rut)(state, cell + 1u);
    return here + rest * (next - here);
}

/* How far the rear wheels run in ruts: of the front wheels, or of their own where the rover came back. */
TEXT NUMBER NAME(in_ruts)(const PLACE *place, const STATE *state, NUMBER x_m)
{
    const rover_parameters *p = place->parameters;
    NUMBER ruts = NAME(smooth)((x_m - p->rut_begin_m) * place->per.rut_width);
    NUMBER back = state->furthest_m - x_m - 0.05;
    if (ANY(back > 0.0)) {
        NUMBER again = NAME(smooth)(back * (1.0 / 0.3)) * NAME(smooth)((x_m - state->lowest_m + 0.1) * (1.0 / 0.2));
        ruts = PICK(again > ruts, again, ruts);
    }
    return ruts;
}

TEXT NUMBER NAME(height_of)(const PLACE *place, const STATE *state, NUMBER x_m, NUMBER path_m, NUMBER dig)
{
    const NUMBER *part = place->ground.height;
    NUMBER ruts = NAME(in_ruts)(place, state, x_m), dug = dig / (1.0 + dig);
    NUMBER slip = HELD(NAME(slip_in_rut)(state, x_m), 0.0, 1.0);
    NUMBER far = NAME(exp)(path_m * (-1.0 / 0.4)), twice = far * far; /* near: over 0.1 m */
    NUMBER height = part[0] + ruts * (part[1] + dug * part[5] + slip * part[7]) + part[2] * (twice * twice)
        + part[3] * far + dug * (part[4] + dug * part[6]);
    MASK behind = x_m < 0.0;
    if (ANY(behind)) {
        NUMBER back = NAME(smooth)(x_m * (-1.0 / 0.3));
        height = PICK(behind, height + back * (part[8] + dug * part[9]), height);
    }
    return height;
}

/* Bounds that hold whatever the numbers are: resistance pushes a rover no more than its own traction does
 * (what it does to one that slides back is lost traction as well), wheels never drive beyond their speed without load,
 * nothing falls faster than freely. `power` is what drives, to no more than `top` speed; `resistance` all that resists. Returns
 * what is lost of the speed's distance from its end until the cell ends, as a fraction. */
TEXT NUMBER NAME(bounded_cell)(const PLACE *place, STATE *state, NUMBER power, double top, NUMBER resistance,
                               NUMBER rate)
{
    NUMBER speed = state->speed_m_s, sine = place->ground.sine;
    double gravity = place->law->gravity_m_s2;
    power = HELD(power, -most_force, most_force);
    NUMBER least = PICK(speed < 0.0, -most_force, PICK(power > 0.0, -power, 0.0));
    resistance = NAME(held)(resistance, least, OF(most_force));
    rate = HELD(rate, least_rate, most_rate);
    NUMBER force = power - sine - resistance;
    NUMBER uphill = PICK(sine > 0.0, sine, 0.0), downhill = PICK(sine < 0.0, -sine, 0.0);
    NUMBER lost = -NAME(expm1)(-rate * state->cell_s);
    NUMBER per_gain = rate / (gravity * lost); /* force, per speed gained in the cell */
    NUMBER faster = PICK(speed < top, (top - speed) * per_gain, 0.0), slower = PICK(speed > 0.0, speed * per_gain, 0.0);
    /* Either gravity alone would do it, or it ends with the cell: at the top, or at rest. */
    NUMBER lowest = -PICK(uphill > slower, uphill, slower);
    force = NAME(held)(force, lowest, PICK(downhill > faster, downhill, faster));
    state->acceleration_m_s2 = gravity * force;
    state->rate_per_s = rate;
    return lost;
}

/* Straight lines between values at knots, from zero at `low` to zero at `high`; flat up to the first knot if that is
 * `low` too. */
TEXT NUMBER NAME(between_knots)(int count, const double *knots, const NUMBER *values, double low, double high, NUMBER at)
{
    int flat = low >= knots[0];
    MASK inside = flat ? at < high : (at < high) & (at > low);
    if (!ANY(inside))
        return OF(0.0);
    NUMBER last = values[count - 1];
    NUMBER found = last * (1.0 - (at - knots[count - 1]) * (1.0 / (high - knots[count - 1])));
    for (int i = count - 1; i > 0; i--) {
        NUMBER before = values[i - 1];
        NUMBER here = before + (at - knots[i - 1]) * (1.0 / (knots[i] - knots[i - 1])) * (values[i] - before);
        found = PICK(at < knots[i], here, found);
    }
    NUMBER first = flat ? values[0] : (at - low) * (1.0 / (knots[0] - low)) * values[0];
    found = PICK(at < knots[0], first, found);
    return PICK(inside, found, 0.0);
}

/* What a rover that goes forwards resists with, as far as it is driven */
TEXT NUMBER NAME(driven_resistance)(const PLACE *place, NUMBER speed, NUMBER x, NUMBER path, NUMBER ruts,
                                    NUMBER front_ruts, NUMBER slip)
{
    const rover_parameters *p = place->parameters;
    const NAME(ground) *g = &place->ground;
    NUMBER base = p->resistance - p->front_rut_resistance * front_ruts
        + ruts * ((p->rut_resistance - p->resistance) + p->compaction_resistance * (slip - 0.5));
    NUMBER found = g->mass_scale * base + p->speed_resistance * speed + g->motion + ruts * g->rut;
    NUMBER near = path * place->per.near, far = path * place->per.far;
    if (ANY(near < gone))
        found += PICK(near < gone, p->near * NAME(exp)(-near), 0.0);
    if (ANY(far < gone))
        found += PICK(far < gone, p->far * NAME(exp)(-far), 0.0);
    found += NAME(between_knots)(4, early_knots_m, g->early, early_knots_m[0], 0.95, path);
    return found + NAME(between_knots)(3, along_knots_m, g->along, 0.85, 2.4, x);
}

/* The same of one that goes back, as far as the motors' torque tells */
TEXT NUMBER NAME(back_resistance)(const PLACE *place, NUMBER backed, NUMBER ruts, NUMBER rear_rim)
{
    const rover_parameters *p = place->parameters;
    const NAME(ground) *g = &place->ground;
    NUMBER spin = PICK(rear_rim > 0.0, rear_rim, 0.0);
    NUMBER level = p->back_resistance * (1.0 - p->back_rut_relief * ruts)
        - p->back_spin_relief * NAME(tanh)(spin * place->per.back_spin)
        - p->back_hold_relief * NAME(exp)(-backed * place->per.back_hold);
    return g->mass_scale * level + g->share * g->back;
}

/* What holds a rover that barely moves; its sum is made only where one is slow enough for it. */
TEXT NUMBER NAME(stuck_at)(PLACE *place, const double *weights, NUMBER speed)
{
    NUMBER faster = (speed - place->parameters->gate_speed_m_s) * place->per.gate_width;
    MASK slow = faster <= gone;
    if (!ANY(slow))
        return OF(0.0);
    NAME(need_stall)(place, weights);
    return PICK(slow, place->ground.stall / (1.0 + NAME(exp)(faster)), 0.0);
}

/* The axles' traction at a speed, and its slope over that */
TEXT NUMBER NAME(traction)(const PLACE *place, STATE *state, NUMBER ruts, NUMBER front_ruts, NUMBER slip, NUMBER backed,
                           NUMBER *slope)
{
    const rover_parameters *p = place->parameters;
    const NAME(ground) *g = &place->ground;
    NUMBER speed = state->speed_m_s;
    double no_load = place->law->rim_speed_m_s;
    NAME(axle) front = {.rutted = 0, .share = g->front_share, .torque = g->torque, .grip = OF(1.0)};
    front.adhesion = p->front_adhesion;
    front.plateau = p->front_plateau;
    front.linear = p->front_linear;
    front.per_slip = g->front_slip_scale * (1.0 + p->front_in_rut * front_ruts);
    NAME(axle) rear = {.rutted = 1, .share = g->rear_share, .torque = g->torque, .grip = OF(1.0)};
    rear.adhesion = p->rear_adhesion;
    rear.plateau = p->rear_plateau;
    rear.linear = p->rear_linear;
    rear.per_slip = g->rear_slip_scale;
    rear.ruts = ruts;
    rear.rut_plateau = p->rut_plateau;
    rear.rut_per_slip = g->rut_slip_scale;
    rear.rut_shift = p->rut_slip_shift;
    rear.rut_left = NAME(exp)(-HELD(g->compaction * slip, 0.0, 30.0));
    rear.rut_more = (p->rut_adhesion - p->rear_adhesion) + p->compaction_adhesion * slip;
    MASK stands = speed < 0.02;
    if (ANY(stands)) {
        NUMBER relief = p->backing_relief * (1.0 - NAME(exp)(-backed * place->per.backing));
        rear.grip = PICK(stands, 1.0 - relief * NAME(smooth)((0.02 - speed) * (1.0 / 0.04)), 1.0);
    }
    NAME(search) front_rim = NAME(search_from)(no_load, speed, state->front_rim_m_s);
    NAME(search) rear_rim = NAME(search_from)(no_load, speed, state->rear_rim_m_s);
    for (int turn = 0; turn < 60 && ANY(front_rim.going); turn++)
        NAME(search_on)(&front_rim, &front, 1.0 / no_load, speed);
    for (int turn = 0; turn < 60 && ANY(rear_rim.going); turn++)
        NAME(search_on)(&rear_rim, &rear, 1.0 / no_load, speed);
    NUMBER front_slope, rear_slope;
    NUMBER found = NAME(motors)(&front_rim, &front, no_load, &state->front_by_speed, &front_slope);
    found += NAME(motors)(&rear_rim, &rear, no_load, &state->rear_by_speed, &rear_slope);
    state->front_rim_m_s = front_rim.at;
    state->rear_rim_m_s = rear_rim.at;
    *slope = front_slope + rear_slope;
    return found;
}

/* A new cell of a rover that drives or rolls. Returns what bounded_cell does. */
TEXT NUMBER NAME(driven_cell)(PLACE *place, const double *weights, STATE *state)
{
    const rover_parameters *p = place->parameters;
    const rover_law *law = place->law;
    const NAME(ground) *g = &place->ground;
    NUMBER speed = state->speed_m_s, x = state->x_m + speed * state->cell_s * 0.5;
    NUMBER backed = state->furthest_m - state->x_m; /* how far the rover has come down from its furthest point */
    NUMBER ruts = NAME(in_ruts)(place, state, x);
    NUMBER front_ruts = NAME(smooth)((state->frontier_m - (x + law->wheelbase_m) - 0.05) * (1.0 / 0.3));
    NUMBER slip = HELD(NAME(slip_in_rut)(state, x), 0.0, 0.95);
    slip = slip / (1.0 - p->compaction_bend * slip);
    NUMBER traction_slope, traction = NAME(traction)(place, state, ruts, front_ruts, slip, backed, &traction_slope);
    NUMBER rim = 0.5 * (state->front_rim_m_s + state->rear_rim_m_s);
    /* Ways and digging at the middle of the cell */
    double half_s = 0.5 * state->cell_s;
    NUMBER way = NAME(size)(speed) * half_s, slid = PICK(rim > speed, (rim - speed) * half_s, 0.0);
    NUMBER path = state->path_m + way, dig = state->dig + (slid - state->dig * way) * place->per.dig_length;
    dig = HELD(dig, 0.0, most_dig);
    NUMBER sheared = 1.0 - p->shear_lack * NAME(exp)(-(state->slip_path_m + slid) * place->per.shear_slip);
    traction *= sheared;
    traction_slope *= sheared;
    state->front_rad_s = state->front_rim_m_s * place->per.radius;
    state->rear_rad_s = state->rear_rim_m_s * place->per.radius;
    state->front_by_speed *= place->per.radius;
    state->rear_by_speed *= place->per.radius;

    MASK forwards = speed >= 0.0;
    NUMBER level = OF(0.0);
    if (ANY(forwards)) {
        NUMBER slipping = PICK(rim > 1e-3, HELD(1.0 - speed / rim, 0.0, 1.0), 0.0);
        NUMBER driven = NAME(driven_resistance)(place, speed, x, path, ruts, front_ruts, slip)
            + g->digging * (dig / (1.0 + dig) - slipping);
        NUMBER free = g->mass_scale * (p->free_resistance * (1.0 - p->free_rut_relief * ruts));
        level = PICK(forwards, g->share * driven + (1.0 - g->share) * free, level);
    }
    if (ANY(NOT(forwards))) {
        NUMBER back = NAME(back_resistance)(place, backed, NAME(smooth)(x * (1.0 / 0.3)), state->rear_rim_m_s);
        level = PICK(forwards, level, back);
    }
    NUMBER stuck = g->share * NAME(stuck_at)(place, weights, speed);
    NUMBER turning = NAME(tanh)(speed * place->per.turning_speed);
    NUMBER level_slope = level * (1.0 - turning * turning) * place->per.turning_speed
        + PICK(speed > 0.0, p->speed_resistance, 0.0);
    return NAME(bounded_cell)(place, state, traction - stuck, law->rim_speed_m_s, level * turning + state->offset,
                              -law->gravity_m_s2 * (traction_slope - level_slope));
}

/* Position and speed at a time in a cell, and what is lost until then of the speed's distance from its end */
TEXT NUMBER NAME(lost_at)(NUMBER rate_per_s, NUMBER within_s)
{
    return -NAME(expm1)(-rate_per_s * within_s);
}

TEXT void NAME(moved)(const STATE *state, NUMBER within_s, NUMBER lost, NUMBER per_rate_s, NUMBER *x_m, NUMBER *speed_m_s)
{
    NUMBER reach = state->acceleration_m_s2 * per_rate_s;
    *x_m = state->x_m + state->speed_m_s * within_s + reach * (within_s - lost * per_rate_s);
    *speed_m_s = state->speed_m_s + reach * lost;
}

/* Where a rover that is not braked is at a time in its cell */
TEXT NAME(rolled) NAME(roll_driven)(const PLACE *place, const STATE *state, double within_s, NUMBER lost)
{
    NAME(rolled) end;
    NAME(moved)(state, OF(within_s), lost, 1.0 / state->rate_per_s, &end.x_m, &end.speed_m_s);
    NUMBER way = NAME(size)(end.x_m - state->x_m);
    NUMBER faster = 0.5 * (end.speed_m_s - state->speed_m_s); /* at the middle */
    NUMBER rim = 0.5 * (state->front_rim_m_s + state->rear_rim_m_s
                        + (state->front_by_speed + state->rear_by_speed) * faster * place->law->wheel_radius_m);
    NUMBER slipped = (rim - state->speed_m_s - faster) * within_s;
    slipped = PICK(slipped > 0.0, slipped, 0.0);
    NUMBER kept = NAME(exp)(-way * place->per.dig_length), dug = slipped * place->per.dig_length;
    dug = PICK(way > 1e-7, slipped / way * (1.0 - kept), dug);
    end.path_m = state->path_m + way;
    end.slip_path_m = state->slip_path_m + slipped;
    end.dig = HELD(state->dig * kept + dug, 0.0, most_dig);
    end.x_m = HELD(end.x_m, -most_m, most_m);
    end.speed_m_s = HELD(end.speed_m_s, -most_speed_m_s, most_speed_m_s);
    return end;
}

/* A new cell of a rover whose wheels are locked. Returns what bounded_cell does. */
TEXT NUMBER NAME(braked_cell)(const PLACE *place, STATE *state)
{
    const rover_parameters *p = place->parameters;
    NUMBER sliding = NAME(tanh)(state->speed_m_s * place->per.brake_speed);
    NUMBER rate = place->law->gravity_m_s2 * p->brake_friction * (1.0 - sliding * sliding) * place->per.brake_speed;
    state->front_rim_m_s = state->rear_rim_m_s = OF(locked_rim_m_s);
    state->front_rad_s = state->rear_rad_s = state->front_by_speed = state->rear_by_speed = OF(0.0);
    return NAME(bounded_cell)(place, state, OF(0.0), 0.0, p->brake_friction * sliding, rate);
}

/* Where such a one is at a time in its cell */
TEXT NAME(rolled) NAME(roll_braked)(const STATE *state, double within_s, NUMBER lost)
{
    NAME(rolled) end = {.path_m = state->path_m, .slip_path_m = state->slip_path_m, .dig = state->dig};
    NAME(moved)(state, OF(within_s), lost, 1.0 / state->rate_per_s, &end.x_m, &end.speed_m_s);
    MASK stands = NAME(size)(end.speed_m_s) < 0.03;
    if (ANY(stands)) {
        end.path_m = PICK(stands, 0.0, end.path_m);
        end.slip_path_m = PICK(stands, 0.0, end.slip_path_m);
        end.dig = PICK(stands, end.dig * NAME(exp)(OF(-within_s / 0.2)), end.dig);
    }
    end.x_m = HELD(end.x_m, -most_m, most_m);
    end.speed_m_s = HELD(end.speed_m_s, -most_speed_m_s, most_speed_m_s);
    return end;
}

/* Moves the state to where it is at a time in its cell. `rutting`: the front wheels
 * turn, and leave ruts. */
TEXT void NAME(end_cell)(const PLACE *place, STATE *state, double within_s, const NAME(rolled) *end, int rutting)
{
    NUMBER x = state->x_m, faster = end->speed_m_s - state->speed_m_s, middle = state->speed_m_s + 0.5 * faster;
    double radius = place->law->wheel_radius_m, ahead = place->law->wheelbase_m;
    NUMBER front_rise = state->front_by_speed * faster, rear_rise = state->rear_by_speed * faster;
    NUMBER front = state->front_rim_m_s + 0.5 * radius * front_rise;
    state->front_rim_m_s += radius * front_rise;
    state->rear_rim_m_s += radius * rear_rise;
    state->front_rad_s += front_rise;
    state->rear_rad_s += rear_rise;
    state->height_m += within_s / state->cell_s * (state->next_height_m - state->height_m);
    state->x_m = end->x_m;
    state->speed_m_s = end->speed_m_s;
    state->path_m = end->path_m;
    state->slip_path_m = end->slip_path_m;
    state->dig = end->dig;
    state->event_s += within_s;
    state->cell_s = state->within_s = 0.0;
    state->furthest_m = PICK(end->x_m > state->furthest_m, end->x_m, state->furthest_m);
    state->lowest_m = PICK(end->x_m < state->lowest_m, end->x_m, state->lowest_m);
    if (!rutting)
        return;
    NUMBER slip = PICK(front > 1e-3, HELD((front - middle) / front, -0.2, 1.0), 0.0);
    NUMBER learned = -NAME(expm1)(-NAME(size)(end->x_m - x) * place->per.slip_lag);
    state->front_slip += (slip - state->front_slip) * learned;
    NAME(leave_ruts)(state, x + ahead, end->x_m + ahead);
}
