/* Solving dv/dt = g [F(v, x) - sin th - rho(x, t)], dx/dt = v step by step.
 *
 * Exponential Euler: within a step the right-hand side is linearised in v, which is solved exactly, so that the steep
 * rise of traction with slip sets no limit on the step. */
#include "motion.h"

#include <string.h>

#include "exponential.h"

static const double least_rate = 0.05; /* 1/s, of the linearised right-hand side */

ROVER_INLINE void sum_rows(const double *restrict block, const double *restrict weights, int64_t rows,
                           double *restrict sums)
{
    /* Even and odd rows apart: the order of additions is the same whatever the machine's vectors are. */
    double even[ROVER_LANES] = {0.0}, odd[ROVER_LANES] = {0.0};
    int64_t row = 0;
    for (; row + 1 < rows; row += 2, block += 2 * ROVER_LANES) {
        const double one = weights[row], two = weights[row + 1];
        for (int lane = 0; lane < ROVER_LANES; lane++) {
            even[lane] += one * block[lane];
            odd[lane] += two * block[ROVER_LANES + lane];
        }
    }
    for (int lane = 0; lane < ROVER_LANES; lane++)
        sums[lane] = even[lane] + odd[lane] + (row < rows ? weights[row] * block[lane] : 0.0);
}

ROVER_VERSIONS(sum_rows, (const double *block, const double *weights, int64_t rows, double *sums),
               (block, weights, rows, sums))

void rover_weighted_sums(int64_t vector_bits, const double *block, const double *weights, int64_t rows, double *sums)
{
    ROVER_CALL(vector_bits, sum_rows, (block, weights, rows, sums));
}

void rover_along_begin(rover_along *along)
{
    memset(along->ready, 0, (size_t)(along->process->knots.knot_count / ROVER_LANES + 1));
}

void rover_along_evaluate(rover_along *along, int64_t knot)
{
    const rover_process *process = along->process;
    const rover_weights *weights = along->weights;
    const int64_t block = knot / ROVER_LANES, runs = along->model->run_count;
    double *values = along->values + block * ROVER_LANES;
    const double *plateau = process->plateau + block * ROVER_LANES;
    double sums[ROVER_LANES];
    const double *rows = process->travel + block * runs * ROVER_LANES;
    rover_weighted_sums(along->model->laws.vector_bits, rows, weights->travel, runs, sums);
    for (int lane = 0; lane < ROVER_LANES; lane++)
        values[lane] = along->scale * (along->base + (weights->constant + weights->rut * plateau[lane] + sums[lane]));
    along->ready[block] = 1;
}

void rover_motion_begin(rover_motion *motion, const rover_model *model, rover_law *law, rover_along *resistance)
{
    const rover_laws *laws = &model->laws;
    motion->law = law;
    motion->resistance = resistance;
    motion->blend = model->blend;
    motion->gravity_m_s2 = model->gravity_m_s2;
    motion->steepest = -law->sine < 0.0 ? -law->sine : 0.0;
    motion->per_travel = 1.0 / resistance->process->knots.step_m;
    motion->lowest_speed = laws->speeds_m_s[0];
    motion->per_speed = 1.0 / (laws->speeds_m_s[1] - laws->speeds_m_s[0]);
    motion->rate_per_change = -motion->gravity_m_s2 * motion->per_speed;
    motion->last_speed = (double)laws->speed_count - 1.000001;
    motion->kept_rate = motion->kept_duration = -1.0;
}

/* F - sin th at a speed and its rise to the law's next speed */
ROVER_INLINE double push_at(rover_motion *motion, double speed, double rutted, double *change)
{
    rover_law *law = motion->law;
    double place = (speed - motion->lowest_speed) * motion->per_speed;
    if (!(place > 0.0 && place < motion->last_speed)) /* rarely: a branch is sooner than two comparisons in a row */
        place = place > 0.0 ? motion->last_speed : 0.0; /* NaN becomes the lowest */
    int64_t cell = (int64_t)place;
    rover_law_need(law, cell);
    rover_law_need(law, cell + 1);
    double fraction = place - (double)cell, low = law->virgin[cell], rise = law->virgin[cell + 1] - low;
    double push = low + fraction * rise;
    if (rutted > 0.0) {
        double other = law->rut[cell], other_rise = law->rut[cell + 1] - other;
        push += rutted * (other + fraction * other_rise - push);
        rise += rutted * (other_rise - rise);
    }
    *change = rise;
    return push;
}

/* Solves dv/dt = g f + rate (v_0 - v) over a step: what the force f adds to travel and speed, per unit of it. Apart, so
 * that steps that need it not are short. */
static __attribute__((noinline)) void respond(rover_motion *motion, double rate, double duration_s)
{
    double approach = -rover_expm1(-rate * duration_s), gain = motion->gravity_m_s2 / rate;
    motion->kept_rate = rate;
    motion->kept_duration = duration_s;
    motion->speed_per_force = gain * approach;
    motion->travel_per_force = gain * (duration_s - approach / rate);
}

void rover_step(rover_motion *motion, rover_state *state, double duration_s, double release, double bound_m_s)
{
    const rover_knots *knots = &motion->resistance->process->knots;
    const double x = state->travel_m, v = state->speed_m_s;
    double place = rover_place(knots, x + v * duration_s * 0.5, motion->per_travel), change;
    double resistance = rover_along_at(motion->resistance, place) + release;
    double force = push_at(motion, v, motion->blend[(int64_t)place], &change) - resistance;
    /* Soil and motors do not push a rover that slides back: it gains no more than gravity gives. */
    if (v < 0.0 && force < motion->steepest)
        force = motion->steepest;
    double rate = change * motion->rate_per_change;
    rate = rate > least_rate ? rate : least_rate;
    if (rate != motion->kept_rate || duration_s != motion->kept_duration)
        respond(motion, rate, duration_s);
    double after = v + force * motion->speed_per_force;
    if (!(after < bound_m_s && after > -bound_m_s))
        after = after > 0.0 ? bound_m_s : -bound_m_s;
    state->travel_m = x + v * duration_s + force * motion->travel_per_force;
    state->speed_m_s = after;
}
