/* How fast the wheels of an axle turn, and what they give: for one rover or for several side by side (one.h). */

TEXT NUMBER NAME(smooth)(NUMBER fraction)
{
    NUMBER held = HELD(fraction, 0.0, 1.0);
    return held * held * (3.0 - 2.0 * held);
}

/* J(d) = 1 - (1 - exp(-d))/d, Janosi and Hanamoto's shear law averaged over the contact patch, continued as an odd
 * function (Wong, Theory of Ground Vehicles, 4th ed., eq. 2.59), and its slope */
TEXT NUMBER NAME(mean_shear)(NUMBER d, NUMBER *slope)
{
    NUMBER size = NAME(size)(d);
    NUMBER less = NAME(expm1)(-size), inverse = 1.0 / size, mean = -less * inverse; /* of exp over the patch */
    NUMBER found = PICK(d < 0.0, mean - 1.0, 1.0 - mean);
    *slope = (mean - (less + 1.0)) * inverse;
    MASK small = size < 1e-3;
    if (ANY(small)) {
        *slope = PICK(small, 0.5 - size * (1.0 / 3.0), *slope);
        found = PICK(small, d * (0.5 - size * (1.0 / 6.0)), found);
    }
    return found;
}

/* The same on soil that is sheared already: 1 - left (1 - exp(-d))/d */
TEXT NUMBER NAME(compacted_shear)(NUMBER d, NUMBER left, NUMBER *slope)
{
    d = HELD(d, -6.0, 60.0);
    NUMBER less = NAME(expm1)(-d), inverse = 1.0 / d, mean = -less * inverse;
    NUMBER found = 1.0 - left * mean;
    *slope = left * (mean - (less + 1.0)) * inverse;
    MASK small = NAME(size)(d) < 1e-3;
    if (ANY(small)) {
        *slope = PICK(small, left * (0.5 - d * (1.0 / 3.0)), *slope);
        found = PICK(small, 1.0 - left * (1.0 - d * (0.5 - d * (1.0 / 6.0))), found);
    }
    return found;
}

/* One axle at one moment. phi(slip) = adhesion tanh(rim / turning) + grip (virgin + ruts (in ruts - virgin)). An axle
 * that knows no ruts has none of these numbers. */
typedef struct {
    int rutted;
    NUMBER share, torque; /* of the weight; of both motors, over weight and radius */
    NUMBER per_slip, grip;
    double adhesion, plateau, linear;
    NUMBER ruts, rut_per_slip, rut_left, rut_more;
    double rut_plateau, rut_shift;
} NAME(axle);

TEXT NUMBER NAME(virgin_shear)(const NAME(axle) *a, NUMBER slip, NUMBER *slope)
{
    NUMBER found = a->plateau * NAME(mean_shear)(slip * a->per_slip, slope);
    *slope *= a->plateau * a->per_slip;
    *slope += PICK((slip > -0.5) & (slip < full_slip), a->linear, 0.0);
    return found + a->linear * HELD(slip, -0.5, 1.0);
}

TEXT NUMBER NAME(shear_of_slip)(const NAME(axle) *a, NUMBER slip, NUMBER *slope)
{
    NUMBER virgin = OF(0.0), virgin_slope = OF(0.0);
    if (!a->rutted)
        return NAME(virgin_shear)(a, slip, slope);
    MASK partly = a->ruts < 1.0, none = a->ruts <= 0.0;
    if (ANY(partly)) {
        NUMBER there_slope, there = NAME(virgin_shear)(a, slip, &there_slope);
        virgin = PICK(partly, there, virgin);
        virgin_slope = PICK(partly, there_slope, virgin_slope);
    }
    *slope = virgin_slope;
    if (!ANY(NOT(none)))
        return virgin;
    NUMBER rut_slope, d = (slip - a->rut_shift) * a->rut_per_slip;
    NUMBER rut = a->rut_more + a->rut_plateau * NAME(compacted_shear)(d, a->rut_left, &rut_slope);
    rut_slope *= a->rut_plateau * a->rut_per_slip;
    *slope = PICK(none, virgin_slope, virgin_slope + a->ruts * (rut_slope - virgin_slope));
    return PICK(none, virgin, virgin + a->ruts * (rut - virgin));
}

/* What the motors give beyond what the soil takes, and its slopes over rim speed and rover's speed */
TEXT NUMBER NAME(excess)(const NAME(axle) *a, double per_no_load, NUMBER rim, NUMBER speed, NUMBER *by_rim,
                         NUMBER *by_speed)
{
    NUMBER size = NAME(size)(speed);
    MASK turns = rim >= size;
    NUMBER faster = PICK(turns, rim, size);
    MASK slow = faster < slowest_m_s;
    NUMBER inverse = 1.0 / PICK(slow, slowest_m_s, faster);
    NUMBER slip = (rim - speed) * inverse, turned = slip * inverse;
    NUMBER slip_by_rim = PICK(NOT(slow) & turns, speed * inverse * inverse, inverse);
    NUMBER slip_by_speed = PICK(slow | turns, -inverse, -inverse - PICK(speed < 0.0, -turned, turned));
    MASK full = (slip > full_slip) | (slip < -full_slip);
    if (ANY(full)) {
        slip = PICK(full, PICK(slip > 1.0, 1.0, -1.0), slip);
        slip_by_rim = PICK(full, 0.0, slip_by_rim);
        slip_by_speed = PICK(full, 0.0, slip_by_speed);
    }
    NUMBER slope, soil = a->grip * NAME(shear_of_slip)(a, slip, &slope);
    slope *= a->grip;
    NUMBER turning = OF(1.0);
    MASK slowly = NOT(rim > turned_m_s);
    if (ANY(slowly))
        turning = PICK(slowly, NAME(tanh)(rim * (1.0 / turning_m_s)), 1.0);
    NUMBER soil_by_rim = slope * slip_by_rim + a->adhesion * (1.0 - turning * turning) * (1.0 / turning_m_s);
    NUMBER part = rim * per_no_load;
    MASK forwards = part >= 0.0, below = part < 1.0;
    NUMBER motors = PICK(part < 0.0, 1.0, PICK(below, 1.0 - part, 0.0));
    NUMBER motors_by_rim = PICK(forwards & below, -a->torque * per_no_load, 0.0);
    *by_rim = motors_by_rim - a->share * soil_by_rim - 1e-6;
    *by_speed = -a->share * slope * slip_by_speed;
    return a->torque * motors - a->share * (soil + a->adhesion * turning) - 1e-6 * rim;
}

/* The search for the rim speed at which an axle's motors and the soil agree */
typedef struct {
    NUMBER at, low, high, by_rim, by_speed;
    MASK going;
} NAME(search);

TEXT NAME(search) NAME(search_from)(double no_load, NUMBER speed, NUMBER rim)
{
    NUMBER reach = 1.6 * NAME(size)(speed) + 0.3;
    NAME(search) found = {.low = -reach, .high = PICK(reach > no_load, reach, no_load), .by_rim = OF(-1.0)};
    found.by_speed = OF(0.0);
    found.at = NAME(held)(rim, found.low, found.high);
    found.going = found.low < found.high; /* always */
    return found;
}

/* One step. Each rover stops where it would have alone. */
TEXT void NAME(search_on)(NAME(search) *s, const NAME(axle) *a, double per_no_load, NUMBER speed)
{
    NUMBER by_rim, by_speed, more = NAME(excess)(a, per_no_load, s->at, speed, &by_rim, &by_speed);
    s->by_rim = PICK(s->going, by_rim, s->by_rim);
    s->by_speed = PICK(s->going, by_speed, s->by_speed);
    MASK over = more > 0.0;
    s->low = PICK(over, s->at, s->low);
    s->high = PICK(over, s->high, s->at);
    NUMBER next = s->at - more / by_rim;
    /* A step too short to leave the bracket's end is one: halving would begin anew, at a root. */
    MASK newton = ((next > s->low) & (next < s->high)) | (NAME(size)(next - s->at) < none_m_s);
    next = PICK(newton, next, 0.5 * (s->low + s->high));
    NUMBER moved = NAME(size)(next - s->at);
    s->at = PICK(s->going, next, s->at);
    /* what is left then is some thirty times the square */
    s->going = s->going & NOT(moved < PICK(newton, close_m_s, none_m_s));
}

/* What the motors give at the rim speed found, and its slope over the rover's speed; `by_rover` is that of the rim
 * speed. */
TEXT NUMBER NAME(motors)(const NAME(search) *s, const NAME(axle) *a, double no_load, NUMBER *by_rover, NUMBER *slope)
{
    double per_no_load = 1.0 / no_load;
    NUMBER at = s->at, ratio = s->by_speed / s->by_rim, part = at * per_no_load;
    MASK turning = (at >= 0.0) & (at < no_load);
    *by_rover = HELD(-ratio, -most_by_speed, most_by_speed);
    *slope = PICK(turning, a->torque * per_no_load * ratio, 0.0);
    return PICK(at < 0.0, a->torque, PICK(turning, a->torque * (1.0 - part), 0.0));
}
