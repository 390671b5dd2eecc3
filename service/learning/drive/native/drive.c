/* From states and inputs to states later on: cells of time one after another, and what is asked within them. */
#include <math.h>
#include <string.h>

#include "drive.h"
#include "track.h"

static const double shortest_cell_s = 1e-4;
enum { ROVER_PIECE = 512 }; /* times that are written at once */

void rover_start(const rover_law *law, double mass_kg, double start_speed_m_s, rover_state *state)
{
    memset(state, 0, sizeof *state);
    state->format = ROVER_STATE_FORMAT;
    state->law = law->number;
    state->mass_kg = mass_kg;
    state->speed_m_s = start_speed_m_s;
    state->frontier_m = nowhere_m;
    state->front_rim_m_s = state->rear_rim_m_s = first_rim_m_s;
    for (int i = 0; i < ROVER_RUT_CELLS; i++)
        state->ruts[i] = 1.0;
}

double rover_cell_length(double event_s, int brake)
{
    double length = event_s < short_until_s - same_time_s ? short_cell_s : long_cell_s;
    return brake ? length / brake_cells : length;
}

/* Gives a state that has not moved yet the height it has under the inputs. */
static void need_height(rover_motion *motion, rover_state *state, const rover_inputs *inputs)
{
    if (state->height_known != 0.0)
        return;
    state->torque_nm = inputs->brake ? 0.0 : inputs->torque_nm;
    state->brake = inputs->brake ? 1.0 : 0.0;
    state->slope_rad = inputs->slope_rad;
    double middle = state->x_m + 0.5 * motion->place.law->wheelbase_m;
    if (motion->track)
        state->slope_rad = rover_slope_at(motion->track, &motion->interval, middle);
    state->height_m = rover_law_height(&motion->place, state);
    state->height_known = 1.0;
}

/* How long a new cell shall last. Where a caller brings a new slope each time, it lasts as long as the last one did:
 * what is said of a cell's middle is then true though the cell is to be cut. */
static double next_length(const rover_motion *motion, rover_state *state, const rover_inputs *inputs, int same)
{
    double length = rover_cell_length(same ? state->event_s : 0.0, inputs->brake);
    if (motion->track || !same || state->slope_rad == inputs->slope_rad)
        return length;
    return state->cut_s > shortest_cell_s && state->cut_s < length ? state->cut_s : length;
}

/* Sees to it that there is a cell with the present inputs: goes on with the one there is if it has them, else ends it
 * and begins one. Returns whether it began one. */
static int need_cell(rover_motion *motion, rover_state *state, const rover_inputs *inputs)
{
    double torque = inputs->brake ? 0.0 : inputs->torque_nm, brake = inputs->brake ? 1.0 : 0.0;
    need_height(motion, state, inputs);
    int same = state->torque_nm == torque && state->brake == brake;
    for (int open = state->cell_s > 0.0;; open = 0) {
        double length = open ? state->cell_s : next_length(motion, state, inputs, same);
        double middle = state->x_m + state->speed_m_s * length * 0.5 + 0.5 * motion->place.law->wheelbase_m;
        double slope = inputs->slope_rad;
        if (motion->track)
            slope = rover_slope_at(motion->track, &motion->interval, middle);
        if (open && same && state->slope_rad == slope && state->offset == inputs->offset)
            return 0;
        if (open) {
            state->cut_s = motion->track || !same || state->slope_rad == slope ? 0.0 : state->within_s;
            rover_law_finish(&motion->place, state, state->within_s);
            continue;
        }
        if (!same)
            state->event_s = 0.0;
        state->torque_nm = torque;
        state->brake = brake;
        state->slope_rad = slope;
        state->offset = inputs->offset;
        state->cell_s = length;
        rover_law_cell(&motion->place, motion->weights, state);
        return 1;
    }
}

void rover_motion_begin(rover_motion *motion, const rover_law *law, const double *numbers, const double *weights,
                        const double *heights, const rover_track *track)
{
    rover_place_begin(&motion->place, law, numbers, heights);
    motion->weights = weights;
    motion->track = track;
    motion->interval = 0;
}

/* Where a rover is at times since the start of the present cell, and, if it is `moving`, how fast it and its wheels are. */
ROVER_INLINE void told_at(int moving, const rover_state *state, double start_s, int64_t count, const double *time_s,
                          const rover_columns *to)
{
    rover_state kept; /* of which only this is used: it stays in registers */
    kept.x_m = state->x_m;
    kept.speed_m_s = state->speed_m_s;
    kept.acceleration_m_s2 = state->acceleration_m_s2;
    kept.rate_per_s = state->rate_per_s;
    kept.cell_s = state->cell_s;
    double height = state->height_m, rise = (state->next_height_m - height) / kept.cell_s;
    double front = state->front_rad_s, front_by_speed = state->front_by_speed;
    double rear = state->rear_rad_s, rear_by_speed = state->rear_by_speed;
    double *restrict x_m = to->x_m, *restrict speed_m_s = to->speed_m_s, *restrict height_m = to->height_m;
    double *restrict front_rad_s = to->front_rad_s, *restrict rear_rad_s = to->rear_rad_s;
    for (int64_t i = 0; i < count; i++) {
        double speed, within = time_s[i] - start_s;
        within = within > kept.cell_s - same_time_s ? kept.cell_s : within;
        within = within > same_time_s ? within : 0.0;
        rover_moved_to(&kept, within, x_m + i, &speed);
        height_m[i] = height + rise * within;
        if (!moving)
            continue;
        speed_m_s[i] = speed;
        front_rad_s[i] = front + front_by_speed * (speed - kept.speed_m_s);
        rear_rad_s[i] = rear + rear_by_speed * (speed - kept.speed_m_s);
    }
}
#define TOLD_PARAMETERS \
    (const rover_state *state, double start_s, int64_t count, const double *time_s, const rover_columns *to)
#define TOLD_ARGUMENTS (state, start_s, count, time_s, to)
ROVER_INLINE void moved_at TOLD_PARAMETERS { told_at(1, state, start_s, count, time_s, to); }
ROVER_INLINE void placed_at TOLD_PARAMETERS { told_at(0, state, start_s, count, time_s, to); }
ROVER_VERSIONS(moved_at, TOLD_PARAMETERS, TOLD_ARGUMENTS)
ROVER_VERSIONS(placed_at, TOLD_PARAMETERS, TOLD_ARGUMENTS)

static void write_slopes(rover_motion *motion, double slope_rad, int64_t first, int64_t end, const rover_columns *to)
{
    if (!to->slope_rad)
        return;
    if (motion->track)
        rover_slopes_at(motion->track, &motion->interval, 0.5 * motion->place.law->wheelbase_m, end - first,
                        to->x_m + first, to->slope_rad + first);
    else
        for (int64_t i = first; i < end; i++)
            to->slope_rad[i] = slope_rad;
}

/* A column from number i on, or what takes its place where it is not asked for */
#define PART(column, number) (to->column ? to->column + i : unasked[number])

/* Adds up what is known of times from number `first` to before `end`: `part` begins there. */
static void turn(rover_turning *turning, int64_t first, int64_t end, const rover_columns *part)
{
    for (; turning->next < turning->count && turning->places[turning->next] < end; turning->next++) {
        int64_t i = turning->places[turning->next] - first;
        turning->last = part->front_rad_s[i] + part->rear_rad_s[i];
        turning->first = turning->next ? turning->first : turning->last;
        turning->sum += turning->last;
    }
}

/* The same where nothing but positions is written: looks at each time once more. */
static void turn_alone(rover_turning *turning, int64_t end, const rover_state *state, double start_s,
                       const double *time_s)
{
    double found[5];
    rover_columns one = {found, found + 1, found + 2, found + 3, found + 4, NULL, NULL};
    while (turning->next < turning->count && turning->places[turning->next] < end) {
        int64_t place = turning->places[turning->next];
        moved_at(state, start_s, 1, time_s + place, &one);
        turn(turning, place, place + 1, &one);
    }
}

/* Few times are told one by one. Of many, whose speeds nobody asked for, only the positions are. */
static void write(rover_motion *motion, const rover_state *state, double start_s, int64_t first, int64_t end,
                  const double *time_s, const rover_columns *to)
{
    int moving = to->speed_m_s != NULL;
    for (int64_t i = first; i < end; i += ROVER_PIECE) {
        double unasked[4][ROVER_PIECE];
        int64_t count = end - i < ROVER_PIECE ? end - i : ROVER_PIECE;
        rover_columns part = {to->x_m + i, PART(speed_m_s, 0), PART(front_rad_s, 1), PART(rear_rad_s, 2),
                              PART(height_m, 3), NULL, NULL};
        if (count < 4)
            moved_at(state, start_s, count, time_s + i, &part);
        else if (moving)
            ROVER_CALL(motion->place.law->vector_bits, moved_at, (state, start_s, count, time_s + i, &part));
        else
            ROVER_CALL(motion->place.law->vector_bits, placed_at, (state, start_s, count, time_s + i, &part));
        if (to->turning && (moving || count < 4))
            turn(to->turning, i, i + count, &part);
        else if (to->turning)
            turn_alone(to->turning, i + count, state, start_s, time_s);
    }
    write_slopes(motion, state->slope_rad, first, end, to);
}

/* The first time from number `at` on that is later than the limit; they rise. */
ROVER_INLINE int64_t past(const double *time_s, int64_t at, int64_t times, double limit_s)
{
    enum { SOME = 16 };
    while (at + SOME < times && time_s[at + SOME] <= limit_s)
        at += SOME;
    while (at < times && time_s[at] <= limit_s)
        at++;
    return at;
}

int64_t rover_advance(rover_motion *motion, rover_state *state, const rover_inputs *inputs, double from_s,
                      double until_s, int64_t times, const double *time_s, const rover_columns *to, int64_t at)
{
    if (!(state->cell_s <= long_cell_s && state->within_s >= 0.0 && state->within_s <= state->cell_s))
        state->cell_s = state->within_s = 0.0; /* of no state that was made here */
    /* Cells of one length begin at anchor + number * length: times are not summed up. */
    double anchor = from_s - state->within_s, length = state->cell_s;
    int64_t number = 0;
    motion->place.rolled = 0;
    if (!(until_s - from_s > same_time_s))
        return at;
    for (int first_cell = 1;; first_cell = 0) {
        double start = anchor + (double)number * length;
        if (need_cell(motion, state, inputs) && (first_cell || state->cell_s != length)) {
            anchor = start = first_cell ? from_s : start;
            length = state->cell_s;
            number = 0;
        }
        double end = start + length;
        int whole = end <= until_s + same_time_s, last = end >= until_s - same_time_s;
        int64_t asked = at;
        at = past(time_s, at, times, (last ? until_s : end) + same_time_s);
        if (at > asked)
            write(motion, state, start, asked, at, time_s, to);
        if (whole)
            rover_law_finish(&motion->place, state, length);
        else
            state->within_s = until_s - start;
        if (last || !(end < until_s))
            return at;
        number++;
    }
}

/* What there is to say of a state as it is */
static void write_now(const rover_state *state, const rover_columns *to, int64_t i)
{
    double unasked[4][1];
    rover_columns one = {to->x_m + i, PART(speed_m_s, 0), PART(front_rad_s, 1), PART(rear_rad_s, 2), PART(height_m, 3),
                         NULL, NULL};
    if (state->cell_s > 0.0) {
        moved_at(state, 0.0, 1, &state->within_s, &one);
    } else {
        *one.x_m = state->x_m;
        *one.speed_m_s = state->speed_m_s;
        *one.front_rad_s = state->front_rad_s;
        *one.rear_rad_s = state->rear_rad_s;
        *one.height_m = state->height_m;
    }
    if (to->turning)
        turn(to->turning, i, i + 1, &one);
}

static rover_columns columns_of(double *outputs, int64_t count)
{
    rover_columns to = {outputs + ROVER_X * count,    outputs + ROVER_SPEED * count,  outputs + ROVER_FRONT * count,
                        outputs + ROVER_REAR * count, outputs + ROVER_HEIGHT * count, outputs + ROVER_SLOPE * count,
                        NULL};
    return to;
}

void rover_present(int64_t count, const rover_state *states, double *outputs)
{
    rover_columns to = columns_of(outputs, count);
    for (int64_t i = 0; i < count; i++) {
        write_now(states + i, &to, i);
        to.slope_rad[i] = states[i].slope_rad;
    }
}

static void write_present(rover_motion *motion, const rover_state *state, double slope_rad, int64_t at,
                          const rover_columns *to)
{
    write_now(state, to, at);
    write_slopes(motion, slope_rad, at, at + 1, to);
}

static void observe(rover_motion *motion, rover_state *state, double x_m, double speed_m_s)
{
    if (state->cell_s > 0.0)
        rover_law_finish(&motion->place, state, state->within_s);
    state->x_m = x_m;
    state->speed_m_s = speed_m_s;
}

static void write_nothing(int64_t times, const rover_columns *to, int64_t at)
{
    double *columns[] = {to->x_m, to->speed_m_s, to->front_rad_s, to->rear_rad_s};
    for (int column = 0; column < 4; column++)
        for (int64_t i = at; columns[column] && i < times; i++)
            columns[column][i] = NAN;
    if (to->turning)
        to->turning->sum = NAN;
}

void rover_follow(rover_motion *motion, rover_state *state, const rover_controls *controls, double slope_rad,
                  double offset, int64_t times, const double *time_s, const rover_run *run, const rover_columns *to)
{
    double now = 0.0;
    int64_t at = 0, control = 0;
    rover_inputs first = {controls->torque_nm[0], slope_rad, offset, controls->brake[0] != 0.0};
    need_height(motion, state, &first);
    for (; at < times && !(time_s[at] > same_time_s); at++)
        write_present(motion, state, slope_rad, at, to);
    while (at < times) {
        while (control + 1 < controls->count && controls->time_s[control + 1] <= now + same_time_s)
            control++;
        int64_t end = times, every = run ? run->force_every : 0;
        if (every > 0) /* the next time whose number is a multiple */
            end = (at + every - 1) / every * every + 1;
        end = end < times ? end : times;
        double until = time_s[end - 1];
        if (control + 1 < controls->count && controls->time_s[control + 1] < until)
            until = controls->time_s[control + 1];
        until = rover_held(until, now, ROVER_MOST_S);
        rover_inputs inputs = {controls->torque_nm[control], slope_rad, offset, controls->brake[control] != 0.0};
        int64_t before = at;
        at = rover_advance(motion, state, &inputs, now, until, end, time_s, to, at);
        if (at == end && every > 0 && (end - 1) % every == 0)
            observe(motion, state, run->observed_x_m[end - 1], run->observed_speed_m_s[end - 1]);
        if (at == before && !(until > now))
            break;
        state->time_s += until - now;
        now = until;
    }
    if (at < times) /* beyond all time, or no time at all */
        write_nothing(times, to, at);
}

void rover_drive(const rover_law *law, rover_state *state, const rover_track *track, const rover_controls *controls,
                 double offset, int64_t times, const double *time_s, double *outputs)
{
    rover_motion motion;
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, track);
    rover_columns to = columns_of(outputs, times);
    rover_follow(&motion, state, controls, 0.0, offset, times, time_s, NULL, &to);
}

void rover_constant(const rover_law *law, int64_t count, const double *scenarios, int64_t times, const double *time_s,
                    int64_t stride, double *outputs)
{
    rover_motion motion;
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, NULL);
    const double always = 0.0;
    for (int64_t i = 0; i < count; i++) {
        const double *one = scenarios + i;
        rover_state state;
        rover_start(law, one[count], one[3 * count], &state);
        rover_controls controls = {1, &always, &one[2 * count], &always};
        double *first = outputs + i * times;
        int64_t block = count * times;
        rover_columns to = {first, first + block, first + 2 * block, first + 3 * block, first + 4 * block, NULL, NULL};
        rover_follow(&motion, &state, &controls, one[0], one[4 * count], times, time_s + i * stride, NULL, &to);
    }
}

void rover_step_alone(rover_motion *motion, rover_state *state, int64_t count, const double *inputs)
{
    rover_inputs with = {inputs[count], inputs[0], 0.0, inputs[2 * count] != 0.0};
    double duration = rover_held(inputs[3 * count], 0.0, ROVER_MOST_S);
    rover_columns none = {0};
    rover_advance(motion, state, &with, 0.0, duration, 0, NULL, &none, 0);
    state->time_s += duration;
}

void rover_step(const rover_law *law, int64_t count, rover_state *states, const double *inputs,
                const rover_track *track, double *outputs)
{
    rover_motion motion;
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, track);
    rover_columns to = columns_of(outputs, count);
    for (int64_t i = 0; i < count; i++) {
        rover_step_alone(&motion, states + i, count, inputs + i);
        write_present(&motion, states + i, inputs[i], i, &to);
    }
}

void rover_sweep(const rover_law *law, int64_t rows, int64_t width, const double *numbers, int64_t runs,
                 const rover_run *run, const int64_t *offsets, int64_t stride, double *outputs)
{
    for (int64_t row = 0; row < rows; row++) {
        const double *these = numbers + row * width, *weights = these + sizeof(rover_parameters) / sizeof(double);
        for (int64_t i = 0; i < runs; i++) {
            rover_motion motion;
            rover_state state;
            rover_motion_begin(&motion, law, these, weights, NULL, &run[i].track);
            rover_start(law, run[i].mass_kg, run[i].start_speed_m_s, &state);
            double *first = outputs + row * stride + offsets[i];
            int64_t block = rows * stride;
            rover_columns to = {first, first + block, first + 2 * block, first + 3 * block, NULL, NULL, NULL};
            rover_follow(&motion, &state, &run[i].controls, 0.0, 0.0, run[i].times, run[i].time_s, &run[i], &to);
        }
    }
}
