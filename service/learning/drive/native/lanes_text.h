/* Scenarios side by side: the words of one.h for LANES rovers, with instructions of TARGET, and what drives them. No
 * guard: lanes.c includes it for each kind of machine. The lanes of a vector do not know each other, so the bits do not
 * depend on how many there are, or on what the others do. */

#define TEXT TARGET ROVER_INLINE
#define JOINED(name, suffix) name##suffix
#define WITH_SUFFIX(name, suffix) JOINED(name, suffix)
#define NAME(name) WITH_SUFFIX(name, SUFFIX)

typedef double NAME(numbers) __attribute__((vector_size(8 * LANES)));
typedef int64_t NAME(masks) __attribute__((vector_size(8 * LANES)));
typedef uint64_t NAME(whole) __attribute__((vector_size(8 * LANES)));

#define NUMBER NAME(numbers)
#define MASK NAME(masks)
#define BITS NAME(whole)
#define OF(number) ((number) - (NUMBER){0.0})
#define PICK(mask, yes, no) NAME(pick)(mask, OF(yes), OF(no))
#define HELD(number, low, high) NAME(held)(number, OF(low), OF(high))
#define ANY(mask) NAME(any)(mask)
#define NOT(mask) (~(mask))
#define AS_BITS(number) ((BITS)(number))
#define AS_NUMBER(bits) ((NUMBER)(bits))
#define STATE NAME(state)
#define PLACE NAME(place)

TEXT NUMBER NAME(pick)(MASK mask, NUMBER yes, NUMBER no)
{
    return AS_NUMBER((AS_BITS(yes) & (BITS)mask) | (AS_BITS(no) & ~(BITS)mask));
}

TEXT int NAME(any)(MASK mask)
{
    int64_t some = 0;
    for (int lane = 0; lane < LANES; lane++)
        some |= mask[lane];
    return some != 0;
}

#include "exponential_text.h"
#include "ground_text.h"

/* What changes of rover_state. Cells are as long for all. */
typedef struct {
    double cell_s, within_s, event_s;
    NUMBER x_m, speed_m_s, slip_path_m, path_m, dig, furthest_m, lowest_m, front_slip, frontier_m;
    NUMBER front_rim_m_s, rear_rim_m_s, offset, acceleration_m_s2, rate_per_s, front_rad_s, rear_rad_s;
    NUMBER front_by_speed, rear_by_speed, height_m, next_height_m;
    double ruts[ROVER_RUT_CELLS + 1][LANES]; /* the last for what is left nowhere */
} STATE;

typedef struct {
    const rover_law *law;
    const rover_parameters *parameters;
    rover_reciprocals per;
    NAME(ground) ground;
    int stall_summed;
    rover_place one[LANES];
} PLACE;

TEXT NUMBER NAME(rut)(const STATE *state, BITS cell)
{
    NUMBER found;
    cell = cell % ROVER_RUT_CELLS;
    for (int lane = 0; lane < LANES; lane++)
        found[lane] = state->ruts[cell[lane]][lane];
    return found;
}

TARGET static void NAME(need_stall)(PLACE *place, const double *weights)
{
    if (place->stall_summed)
        return;
    for (int lane = 0; lane < LANES; lane++) {
        rover_place_stall(&place->one[lane], weights);
        place->ground.stall[lane] = place->one[lane].ground.stall;
    }
    place->stall_summed = 1;
}

TEXT void NAME(leave_ruts)(STATE *state, NUMBER before_m, NUMBER front_m);

#include "axle_text.h"
#include "law_text.h"

/* As for one rover in law.c: all lanes write as often as the one with most cells, what is too much goes nowhere. */
TEXT void NAME(leave_ruts)(STATE *state, NUMBER before_m, NUMBER front_m)
{
    NUMBER start = state->frontier_m;
    front_m = HELD(front_m, -most_m, most_m);
    MASK further = front_m > start;
    if (!ANY(further))
        return;
    start = PICK(start <= -most_m, before_m - 0.3, start);
    BITS cell;
    NUMBER newest = NAME(floor)(front_m * per_rut_cell_m, &cell) + 1.0;
    NUMBER oldest = -NAME(floor)(-(start * per_rut_cell_m), &cell), ring = newest - (ROVER_RUT_CELLS - 1.0);
    oldest = PICK(oldest > ring, oldest, ring);
    NUMBER left = state->front_slip;
    for (MASK more = further; ANY(more); oldest += 1.0) {
        const double round = 0x1.8p52;
        more = further & (oldest <= newest);
        cell = AS_BITS(oldest + round) % ROVER_RUT_CELLS;
        cell = (cell & (BITS)more) | ((BITS)NOT(more) & ROVER_RUT_CELLS);
        for (int lane = 0; lane < LANES; lane++)
            state->ruts[cell[lane]][lane] = left[lane];
    }
    state->frontier_m = PICK(further, front_m, state->frontier_m);
}

TARGET static void NAME(begin_place)(PLACE *place, const rover_law *law)
{
    rover_place_begin(&place->one[0], law, law->parameters, law->heights);
    for (int lane = 1; lane < LANES; lane++)
        place->one[lane] = place->one[0];
    place->law = law;
    place->parameters = place->one[0].parameters;
    place->per = place->one[0].per;
    place->stall_summed = 0;
}

/* Gives a lane what its place has. */
TEXT void NAME(lay_out)(PLACE *place, int lane)
{
    const double *from = (const double *)&place->one[lane].ground;
    double *to = (double *)&place->ground + lane;
    for (size_t i = 0; i < sizeof place->one->ground / sizeof *from; i++)
        to[i * LANES] = from[i];
}

/* Makes what mass, slope and torque of a lane decide. */
TARGET static void NAME(settle)(PLACE *place, int lane, double mass_kg, double slope_rad, double torque_nm)
{
    rover_place *of = &place->one[lane];
    rover_place_at(of, mass_kg, slope_rad, torque_nm);
    rover_place_driven(of, place->law->weights);
    NAME(lay_out)(place, lane);
}

/* The scenarios' places and their states at the start */
TARGET static void NAME(begin)(PLACE *place, STATE *state, const rover_lanes *asked)
{
    const rover_law *law = asked->law;
    memset(state, 0, sizeof *state);
    state->frontier_m = OF(nowhere_m);
    state->front_rim_m_s = state->rear_rim_m_s = OF(first_rim_m_s);
    for (int cell = 0; cell < ROVER_RUT_CELLS; cell++)
        for (int lane = 0; lane < LANES; lane++)
            state->ruts[cell][lane] = 1.0;
    NAME(begin_place)(place, law);
    for (int lane = 0; lane < LANES; lane++) {
        const double *one = asked->scenarios + asked->row[lane < asked->lanes ? lane : 0];
        NAME(settle)(place, lane, one[asked->count], one[0], one[2 * asked->count]);
        state->speed_m_s[lane] = one[3 * asked->count];
        state->offset[lane] = one[4 * asked->count];
    }
    if (law->heights)
        state->height_m = NAME(height_of)(place, state, state->x_m, state->path_m, state->dig);
}

TEXT NUMBER NAME(within)(const STATE *state, NUMBER within_s)
{
    NUMBER held = PICK(within_s > same_time_s, within_s, 0.0);
    return PICK(within_s > state->cell_s - same_time_s, state->cell_s, held);
}

/* What is true at times and not yet written: five columns, time, lane */
typedef struct {
    int64_t count;
    NUMBER values[5][TILE];
} NAME(tile);

/* Adds what is true at a time within the present cell; speeds of a rover that is `moving`. */
TEXT void NAME(add)(NAME(tile) *tile, int moving, const STATE *state, NUMBER per_rate_s, NUMBER rise, double within_s)
{
    double held = within_s > state->cell_s - same_time_s ? state->cell_s : within_s > same_time_s ? within_s : 0.0;
    NUMBER within = OF(held), lost = NAME(lost_at)(state->rate_per_s, within), x, speed;
    NAME(moved)(state, within, lost, per_rate_s, &x, &speed);
    tile->values[0][tile->count] = x;
    if (moving) {
        tile->values[1][tile->count] = speed;
        tile->values[2][tile->count] = state->front_rad_s + state->front_by_speed * (speed - state->speed_m_s);
        tile->values[3][tile->count] = state->rear_rad_s + state->rear_by_speed * (speed - state->speed_m_s);
    }
    tile->values[4][tile->count] = state->height_m + rise * held;
    tile->count++;
}

/* Writes a tile's times, of which `end` is the number of the one after the last, for lanes from `first` up to `last`. */
TEXT void NAME(flush)(const rover_lanes *asked, NAME(tile) *tile, int64_t end, int first, int last)
{
    int64_t count = tile->count;
    for (int column = 0; column < 5; column++)
        for (int lane = first; asked->columns[column] && lane < last; lane++) {
            double *to = asked->columns[column] + asked->row[lane] * asked->times + end - count;
            const double *from = (const double *)tile->values[column] + lane;
            if (count == TILE)
                for (int i = 0; i < TILE; i++)
                    to[i] = from[i * LANES];
            else
                for (int64_t i = 0; i < count; i++)
                    to[i] = from[i * LANES];
        }
    tile->count = 0;
}

/* Writes the times of a cell that begins at `start_s`, or keeps them in the tile if lanes share them: all are then as
 * far as the first. `at` is the number of each lane's next time, `until_s` its last one. */
TEXT void NAME(write)(const rover_lanes *asked, NAME(tile) *tile, const STATE *state, double start_s,
                      const double *until_s, int64_t *at)
{
    int shared = asked->stride == 0;
    double end = start_s + state->cell_s;
    NUMBER per_rate_s = 1.0 / state->rate_per_s, rise = (state->next_height_m - state->height_m) / state->cell_s;
    for (int lane = 0; lane < (shared ? 1 : asked->lanes); lane++) {
        const double *time = asked->time_s + asked->row[lane] * asked->stride;
        double limit = (end >= until_s[lane] - same_time_s ? until_s[lane] : end) + same_time_s;
        for (; at[lane] < asked->times && time[at[lane]] <= limit; ) {
            NAME(add)(tile, asked->columns[1] != NULL, state, per_rate_s, rise, time[at[lane]++] - start_s);
            if (tile->count == TILE)
                NAME(flush)(asked, tile, at[lane], lane, shared ? asked->lanes : lane + 1);
        }
        if (!shared && tile->count)
            NAME(flush)(asked, tile, at[lane], lane, lane + 1);
    }
}

/* What the whole way comes to so far: `part` is the number of each lane's next time, the rest is from its last one. */
typedef struct {
    NUMBER horizon_s, part, x_m, height_m, late_m, path_m, wheels, last_wheels, seen_m[2];
    int64_t looked;
} NAME(whole_way);

TEXT NUMBER NAME(root)(NUMBER number)
{
#ifdef ROVER_ROOTS
    return __builtin_elementwise_sqrt(number);
#else
    for (int lane = 0; lane < LANES; lane++)
        number[lane] = sqrt(number[lane]);
    return number;
#endif
}

/* Sets the horizons. Returns the last time to be driven to, which is `last_s` at least. */
TARGET static double NAME(begin_whole)(NAME(whole_way) *whole, const rover_lanes *asked, double last_s)
{
    for (int lane = 0; lane < LANES; lane++) {
        int64_t row = asked->row[lane < asked->lanes ? lane : 0];
        double horizon_s = rover_held(asked->wholes->horizon_s[row], 0.0, ROVER_MOST_S);
        whole->horizon_s[lane] = horizon_s;
        last_s = horizon_s > last_s ? horizon_s : last_s;
    }
    for (int64_t look = 0; look < asked->wholes->looks; look++) {
        double look_s = rover_held(asked->wholes->look_s[look], 0.0, ROVER_MOST_S);
        last_s = look_s > last_s ? look_s : last_s;
    }
    return last_s;
}

/* Adds the times of a cell that begins at `start_s`; of the last cell, all that are left. Without `heights` nothing is
 * said of them and of the path. */
TEXT void NAME(add_whole)(NAME(whole_way) *whole, const rover_wholes *asked, int heights, const STATE *state,
                          double start_s, int last)
{
    const double parts = ROVER_WHOLE_PARTS, late = 0.75 * ROVER_WHOLE_PARTS;
    double limit = start_s + state->cell_s + same_time_s;
    NUMBER per_rate_s = 1.0 / state->rate_per_s, rise = (state->next_height_m - state->height_m) / state->cell_s;
    NUMBER x, speed;
    for (;; whole->part += 1.0) {
        NUMBER time = whole->horizon_s * (whole->part / parts);
        MASK now = whole->part <= parts;
        if (!last)
            now = now & (time <= limit);
        if (!ANY(now))
            break;
        NUMBER within = NAME(within)(state, time - start_s);
        NAME(moved)(state, within, NAME(lost_at)(state->rate_per_s, within), per_rate_s, &x, &speed);
        NUMBER faster = speed - state->speed_m_s;
        NUMBER wheels = (state->front_rad_s + state->front_by_speed * faster)
            + (state->rear_rad_s + state->rear_by_speed * faster);
        if (heights) {
            NUMBER height = state->height_m + rise * within, along = x - whole->x_m, up = height - whole->height_m;
            whole->path_m = PICK(now, whole->path_m + NAME(root)(along * along + up * up), whole->path_m);
            whole->height_m = PICK(now, height, whole->height_m);
        }
        whole->wheels = PICK(now, whole->wheels + wheels, whole->wheels);
        whole->last_wheels = PICK(now, wheels, whole->last_wheels);
        whole->late_m = PICK(now & (whole->part <= late), x, whole->late_m);
        whole->x_m = PICK(now, x, whole->x_m);
        whole->part = PICK(now, whole->part, whole->part - 1.0);
    }
    for (; whole->looked < asked->looks && (last || asked->look_s[whole->looked] <= limit); whole->looked++) {
        NUMBER within = NAME(within)(state, OF(asked->look_s[whole->looked] - start_s));
        NAME(moved)(state, within, NAME(lost_at)(state->rate_per_s, within), per_rate_s, &x, &speed);
        whole->seen_m[whole->looked] = x;
    }
}

/* Writes what the ways come to. The wheels stood still at the start; their mean is one of trapezoids, over both axles. */
TARGET static void NAME(write_whole)(const rover_lanes *asked, const NAME(whole_way) *whole)
{
    const double parts = ROVER_WHOLE_PARTS;
    for (int lane = 0; lane < asked->lanes; lane++) {
        double *to = asked->wholes->numbers + asked->row[lane];
        to[ROVER_WHOLE_LATE * asked->count] = whole->late_m[lane];
        to[ROVER_WHOLE_END * asked->count] = whole->x_m[lane];
        to[ROVER_WHOLE_HEIGHT * asked->count] = whole->height_m[lane];
        to[ROVER_WHOLE_PATH * asked->count] = whole->path_m[lane];
        to[ROVER_WHOLE_WHEELS * asked->count] = (whole->wheels[lane] - 0.5 * whole->last_wheels[lane]) / (2.0 * parts);
        for (int64_t look = 0; look < asked->wholes->looks; look++)
            to[(ROVER_WHOLE_SEEN + look) * asked->count] = whole->seen_m[look][lane];
    }
}

/* Writes the same at a time of one lane. */
static void NAME(put)(const rover_lanes *asked, const double *values, int64_t at, int lane)
{
    for (int column = 0; column < 5; column++)
        if (asked->columns[column])
            asked->columns[column][asked->row[lane] * asked->times + at] = values[column];
}

/* Times that were not met, since they do not rise or are no times: nobody knows what is true then. */
static void NAME(fill)(const rover_lanes *asked, const int64_t *at)
{
    const double none[5] = {NAN, NAN, NAN, NAN, NAN};
    for (int lane = 0; lane < asked->lanes; lane++)
        for (int64_t rest = at[asked->stride ? lane : 0]; rest < asked->times; rest++)
            NAME(put)(asked, none, rest, lane);
}

/* Drives the scenarios until the last time that is asked of any of them. */
TARGET static void NAME(drive)(const rover_lanes *asked)
{
    PLACE place;
    STATE state;
    NAME(tile) tile = {.count = 0};
    int64_t at[LANES] = {0};
    double until_s[LANES], last_s = 0.0;
    NAME(begin)(&place, &state, asked);
    NAME(whole_way) whole = {.part = OF(1.0), .height_m = state.height_m};
    for (int lane = 0; lane < asked->lanes; lane++) {
        const double *time = asked->time_s + asked->row[lane] * asked->stride;
        const double first[5] = {0.0, state.speed_m_s[lane], 0.0, 0.0, state.height_m[lane]};
        for (; at[lane] < asked->times && !(time[at[lane]] > same_time_s); at[lane]++)
            NAME(put)(asked, first, at[lane], lane);
        until_s[lane] = asked->times ? rover_held(time[asked->times - 1], 0.0, ROVER_MOST_S) : 0.0;
        last_s = until_s[lane] > last_s ? until_s[lane] : last_s;
    }
    if (asked->wholes)
        last_s = NAME(begin_whole)(&whole, asked, last_s);
    double anchor = 0.0, length = 0.0;
    for (int64_t number = 0; last_s > same_time_s; number++) {
        double start = anchor + (double)number * length, cell_s = rover_cell_length(state.event_s, 0);
        if (cell_s != length) {
            anchor = start;
            length = cell_s;
            number = 0;
        }
        state.cell_s = length;
        NUMBER lost = NAME(driven_cell)(&place, asked->law->weights, &state);
        NAME(rolled) end = NAME(roll_driven)(&place, &state, length, lost);
        if (asked->law->heights)
            state.next_height_m = NAME(height_of)(&place, &state, end.x_m, end.path_m, end.dig);
        NAME(write)(asked, &tile, &state, start, until_s, at);
        int last = !(start + length < last_s - same_time_s);
        if (asked->wholes)
            NAME(add_whole)(&whole, asked->wholes, asked->law->heights != NULL, &state, start, last);
        if (last)
            break;
        NAME(end_cell)(&place, &state, length, &end, 1);
    }
    NAME(flush)(asked, &tile, at[0], 0, asked->lanes);
    if (asked->wholes)
        NAME(write_whole)(asked, &whole);
    NAME(fill)(asked, at);
}
