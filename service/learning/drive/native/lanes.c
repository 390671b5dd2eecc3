/* Many scenarios: side by side, as many as the machine's vectors are good for. */
#include <math.h>
#include <string.h>

#include "drive.h"
#include "lanes.h"
#include "track.h"

#ifdef __has_builtin
#if __has_builtin(__builtin_elementwise_sqrt)
#define ROVER_ROOTS /* of all lanes at once */
#endif
#endif
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors are passed within this file alone */

enum { NARROW_LANES = 4, WIDE_LANES = 8, WIDEST_LANES = 16, FEWEST_STEPS = 3, FEWEST_ROUTES = 3 };

#define TARGET
#define SUFFIX _lanes
#define LANES NARROW_LANES
#include "lanes_text.h"
#include "steps_text.h"
#include "routes_text.h"
#include "end.h"

#if defined(__x86_64__)
#define TARGET ROVER_AVX2
#define SUFFIX _lanes_avx2
#define LANES WIDE_LANES
#include "lanes_text.h"
#include "steps_text.h"
#include "routes_text.h"
#include "end.h"

#define TARGET ROVER_AVX512
#define SUFFIX _lanes_avx512
#define LANES WIDEST_LANES
#include "lanes_text.h"
#include "steps_text.h"
#include "routes_text.h"
#include "end.h"
#else /* whose law asks for no more than 128 bits */
#define drive_lanes_avx2 drive_lanes
#define drive_lanes_avx512 drive_lanes
#define step_lanes_avx2 step_lanes
#define step_lanes_avx512 step_lanes
#define follow_lanes_avx2 follow_lanes
#define follow_lanes_avx512 follow_lanes
#endif

static int64_t most_lanes(int64_t bits)
{
    return bits >= 512 ? WIDEST_LANES : bits >= 256 ? WIDE_LANES : NARROW_LANES;
}

void rover_side_by_side(const rover_law *law, int64_t some, const int64_t *order, int64_t count, const double *scenarios,
                        int64_t times, const double *time_s, int64_t stride, int64_t columns, double *outputs,
                        const rover_wholes *wholes)
{
    const int64_t bits = law->vector_bits, most = most_lanes(bits);
    rover_lanes asked = {.law = law, .count = count, .scenarios = scenarios, .times = times, .stride = stride,
                         .time_s = time_s, .wholes = wholes};
    for (int column = 0; column < 5; column++)
        asked.columns[column] = column < columns ? outputs + column * count * times : NULL;
    if (columns == 2) {
        asked.columns[4] = asked.columns[1];
        asked.columns[1] = NULL;
    }
    for (int64_t first = 0; first < some; first += most) {
        asked.lanes = (int)(some - first < most ? some - first : most);
        for (int lane = 0; lane < asked.lanes; lane++)
            asked.row[lane] = order[first + lane];
        ROVER_CALL(bits, drive_lanes, (&asked));
    }
}

/* Whether a rover may be moved side by side with others of its pace: it drives, and begins a cell on its way whose
 * length the time since the last event tells. */
static int has_pace(const rover_state *state, int64_t count, const double *inputs, rover_pace *pace)
{
    double slope = inputs[0], torque = inputs[count], brake = inputs[2 * count], duration = inputs[3 * count];
    if (brake != 0.0 || state->brake != 0.0 || state->height_known == 0.0 || !(duration <= ROVER_MOST_S) || isnan(torque))
        return 0;
    int same = state->torque_nm == torque, open = state->cell_s != 0.0;
    if (open && !(state->cell_s > 0.0 && state->cell_s <= long_cell_s && state->within_s >= 0.0
                  && state->within_s <= state->cell_s))
        return 0;
    if (open && !(same && state->slope_rad == slope && state->offset == 0.0))
        return 0;
    if (!open && (state->within_s != 0.0 || (same && state->slope_rad != slope && state->cut_s != 0.0)))
        return 0;
    if (!(duration > same_time_s) || state->within_s + duration <= state->cell_s + same_time_s)
        return 0;
    pace->cell_s = state->cell_s;
    pace->within_s = state->within_s;
    pace->event_s = same ? state->event_s : 0.0;
    pace->duration_s = duration;
    return 1;
}

/* Moves the first of `left` rovers side by side with those that follow at its pace. Returns how many, or 0 if it must go
 * alone. */
static int64_t step_some(const rover_law *law, int64_t left, int64_t count, rover_state *states, const double *inputs)
{
    const int64_t bits = law->vector_bits, most = most_lanes(bits);
    rover_steps_asked asked = {.law = law, .count = count, .states = states, .inputs = inputs};
    if (left < FEWEST_STEPS || !has_pace(states, count, inputs, &asked.pace))
        return 0;
    for (asked.lanes = 1; asked.lanes < most && asked.lanes < left; asked.lanes++) {
        rover_pace first = asked.pace, other;
        if (!has_pace(states + asked.lanes, count, inputs + asked.lanes, &other) || first.cell_s != other.cell_s
            || first.within_s != other.within_s || first.event_s != other.event_s
            || first.duration_s != other.duration_s)
            break;
    }
    if (asked.lanes < FEWEST_STEPS)
        return 0;
    ROVER_CALL(bits, step_lanes, (&asked));
    return asked.lanes;
}

void rover_step_fleet(const rover_law *law, int64_t count, rover_state *states, const double *inputs, double *outputs)
{
    rover_motion motion;
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, NULL);
    for (int64_t i = 0, moved; i < count; i += moved) {
        moved = step_some(law, count - i, count, states + i, inputs + i);
        if (moved == 0) {
            rover_step_alone(&motion, states + i, count, inputs + i);
            moved = 1;
        }
    }
    rover_present(count, states, outputs);
    for (int64_t i = 0; i < count; i++)
        outputs[ROVER_SLOPE * count + i] = inputs[i];
}

/* Whether a drive may go side by side with others: it begins. */
static int may_join(const rover_route *route)
{
    const rover_state *start = route->start;
    if (start->cell_s != 0.0 || start->within_s != 0.0 || start->event_s != 0.0 || start->height_known != 0.0)
        return 0;
    for (int64_t i = 0; i < route->controls->count; i++)
        if (isnan(route->controls->torque_nm[i]))
            return 0;
    return 1;
}

/* Whether two have the same cells of time: they brake and change at the same times, each to what was not there before.
 * Changes that are at one time go alone. */
static int in_step(const rover_controls *one, const rover_controls *other)
{
    if (one->count != other->count || (one->brake[0] != 0.0) != (other->brake[0] != 0.0))
        return 0;
    for (int64_t i = 1; i < one->count; i++) {
        int apart = one->time_s[i] - (i > 1 ? one->time_s[i - 1] : 0.0) > 2.0 * same_time_s;
        if (!apart || one->time_s[i] != other->time_s[i] || (one->brake[i] != 0.0) != (other->brake[i] != 0.0)
            || rover_told_same(one, i - 1, i) != rover_told_same(other, i - 1, i))
            return 0;
    }
    return 1;
}

static void drive_alone(const rover_law *law, const rover_route *route, const rover_lanes *to, int64_t row)
{
    rover_motion motion;
    rover_state state = *route->start;
    double *columns[5];
    for (int column = 0; column < 5; column++)
        columns[column] = to->columns[column] ? to->columns[column] + row * to->times : NULL;
    rover_columns one = {columns[0], columns[1], columns[2], columns[3], columns[4], NULL, NULL};
    rover_motion_begin(&motion, law, law->parameters, law->weights, law->heights, route->track);
    rover_follow(&motion, &state, route->controls, 0.0, route->offset, to->times, to->time_s, NULL, &one);
}

void rover_drives(const rover_law *law, int64_t count, const rover_route *routes, int64_t times, const double *time_s,
                  int64_t columns, double *outputs)
{
    const int64_t bits = law->vector_bits, most = most_lanes(bits), block = count * times;
    rover_routes_asked asked = {.to = {.law = law, .times = times, .time_s = time_s}};
    rover_lanes *to = &asked.to;
    for (int column = 0; column < 5; column++)
        to->columns[column] = column < columns ? outputs + column * block : NULL;
    for (int64_t first = 0; first < count; first += to->lanes) {
        asked.routes = routes + first;
        to->row[0] = first;
        int joins = may_join(asked.routes);
        for (to->lanes = 1; joins && to->lanes < most && first + to->lanes < count; to->lanes++) {
            const rover_route *next = asked.routes + to->lanes;
            if (!may_join(next) || !in_step(asked.routes->controls, next->controls))
                break;
            to->row[to->lanes] = first + to->lanes;
        }
        if (to->lanes >= FEWEST_ROUTES)
            ROVER_CALL(bits, follow_lanes, (&asked));
        else
            drive_alone(law, asked.routes, to, first);
        if (to->lanes < FEWEST_ROUTES)
            to->lanes = 1;
    }
    for (int64_t i = 0; columns == ROVER_OUTPUTS && i < count; i++) {
        int64_t interval = 0;
        double *slope_rad = outputs + ROVER_SLOPE * block + i * times;
        rover_slopes_at(routes[i].track, &interval, 0.5 * law->wheelbase_m, times, outputs + i * times, slope_rad);
    }
}
