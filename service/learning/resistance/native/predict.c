/* From scenarios to positions at the asked times. */
#include <math.h>
#include <stdlib.h>

#include "engine.h"
#include "laws.h"
#include "motion.h"
#include "scenario.h"

/* Steps last `step_s` until `until_s`: the release is fast, and past the training horizon nothing is. */
static const struct {
    double step_s, until_s;
} schedule[] = {{0.02, 2.0}, {0.05, 10.0}, {0.1, INFINITY}};
enum { STAGES = sizeof schedule / sizeof schedule[0] };
static const double speed_factor = 1.2;  /* times the no-load rim speed: a bound, not a model */
static const double most_steps = 5e7;     /* 58 days of horizon, 1.6 GB */

/* The steps of a horizon: they start the same for every horizon. */
typedef struct {
    int64_t stage_steps[STAGES], count;
} step_plan;

/* Everything one prediction needs room for */
typedef struct {
    const rover_model *model;
    rover_law law;
    rover_likeness like;
    rover_weights weights;
    double *along, *ready, *knot_values;            /* of either process */
    double *time_s, *release, *travel_m, *height_m; /* at the steps */
} workspace;

static int plan_steps(double horizon_s, int64_t refine, step_plan *plan)
{
    double start = 0.0;
    plan->count = 0;
    for (int stage = 0; stage < STAGES; stage++) {
        plan->stage_steps[stage] = 0;
        if (start >= horizon_s)
            continue;
        double end = horizon_s > start + schedule[stage].step_s ? horizon_s : start + schedule[stage].step_s;
        double length = (end < schedule[stage].until_s ? end : schedule[stage].until_s) - start;
        double steps = ceil(length * (double)refine / schedule[stage].step_s - 1e-9);
        if (!(steps >= 1.0 && steps <= most_steps))
            return ROVER_NO_MEMORY;
        plan->stage_steps[stage] = (int64_t)steps;
        plan->count += plan->stage_steps[stage];
        start = schedule[stage].until_s;
    }
    return ROVER_OK;
}

static void step_times(const step_plan *plan, int64_t refine, double *time_s)
{
    double start = 0.0;
    *time_s++ = 0.0;
    for (int stage = 0; stage < STAGES; stage++) {
        for (int64_t i = 1; i <= plan->stage_steps[stage]; i++)
            *time_s++ = start + (double)i * (schedule[stage].step_s / (double)refine);
        start = schedule[stage].until_s;
    }
}

int64_t rover_step_times(double horizon_s, int64_t refine, int64_t most, double *time_s)
{
    step_plan plan;
    if (plan_steps(horizon_s, refine, &plan) != ROVER_OK)
        return -1;
    if (plan.count + 1 <= most)
        step_times(&plan, refine, time_s);
    return plan.count + 1;
}

static int64_t blocks(int64_t count)
{
    return count / ROVER_LANES + 1;
}

static int64_t larger(int64_t one, int64_t two)
{
    return one > two ? one : two;
}

/* Allocates everything in one piece, to be freed by its first pointer; NULL if there is no memory. */
static double *allocate(workspace *work, const rover_model *model, int64_t steps)
{
    const rover_process *one = &model->resistance, *two = &model->height;
    const int64_t runs = model->run_count;
    const int64_t knots = blocks(larger(one->knots.knot_count, two->knots.knot_count)) * ROVER_LANES;
    const int64_t times = blocks(larger(one->time_count, two->time_count)) * ROVER_LANES;
    int64_t total = rover_law_doubles(&model->laws) + runs * (model->shape_count + 3) + 2 * knots + times;
    total += 4 * (steps + 1);
    double *memory = malloc((size_t)total * sizeof *memory);
    if (!memory)
        return NULL;
    work->model = model;
    work->like.near = rover_law_place(&work->law, &model->laws, memory);
    work->weights.travel = work->like.near + runs * model->shape_count;
    work->weights.time = work->weights.travel + runs;
    work->along = work->weights.time + 2 * runs;
    work->ready = work->along + knots;
    work->knot_values = work->ready + knots;
    work->time_s = work->knot_values + times;
    work->release = work->time_s + steps + 1;
    work->travel_m = work->release + steps + 1;
    work->height_m = work->travel_m + steps + 1;
    return memory;
}

/* The part of a process that depends on time, at its knots up to the first one past `until_s` */
static void evaluate_times(workspace *work, const rover_process *process, double until_s)
{
    const int64_t rows = 2 * work->model->run_count;
    for (int64_t first = 0; first < process->time_count; first += ROVER_LANES) {
        const double *block = process->time + first * rows;
        rover_weighted_sums(work->model->laws.vector_bits, block, work->weights.time, rows, work->knot_values + first);
        int64_t next = first + ROVER_LANES;
        if (next < process->time_count && process->time_s[next - 1] > until_s)
            break;
    }
}

/* Reads the evaluated knots at a time, which must not fall from one call to the next; `at` remembers the place. */
static inline double read_time(const rover_process *process, const double *values, double time_s, int64_t *at)
{
    const double *knots = process->time_s;
    const int64_t last = process->time_count - 1;
    while (*at < last && knots[*at + 1] <= time_s)
        ++*at;
    if (*at == last || time_s < knots[0])
        return values[*at];
    double fraction = (time_s - knots[*at]) * process->time_inverse[*at];
    return values[*at] + fraction * (values[*at + 1] - values[*at]);
}

static rover_along along_travel(workspace *work, const rover_process *process, double base, double scale)
{
    unsigned char *ready = (unsigned char *)work->ready;
    rover_along along = {work->model, process, &work->weights, base, scale, work->along, ready};
    rover_along_begin(&along);
    return along;
}

/* Travel at the steps, from x = 0 */
static void integrate(workspace *work, const step_plan *plan, double scale, double start_speed_m_s)
{
    const rover_model *model = work->model;
    const rover_laws *laws = &model->laws;
    rover_weigh(model, &model->resistance, &work->like, &work->weights);
    evaluate_times(work, &model->resistance, work->time_s[plan->count]);
    rover_along resistance = along_travel(work, &model->resistance, laws->mean_resistance, scale);
    rover_motion motion;
    rover_motion_begin(&motion, model, &work->law, &resistance);
    rover_state state = {0.0, start_speed_m_s};
    int64_t at = 0, step = 0;
    for (; step < plan->count; step++) {
        double middle_s = 0.5 * (work->time_s[step] + work->time_s[step + 1]);
        work->release[step] = scale * read_time(&model->resistance, work->knot_values, middle_s, &at);
    }
    work->travel_m[step = 0] = 0.0;
    for (int stage = 0; stage < STAGES; stage++) {
        const double duration = schedule[stage].step_s / (double)model->refine;
        for (int64_t i = 0; i < plan->stage_steps[stage]; i++, step++) {
            double fall = model->gravity_m_s2 * work->time_s[step + 1], bound = speed_factor * laws->rim_speed_m_s;
            rover_step(&motion, &state, duration, work->release[step], bound > fall ? bound : fall);
            work->travel_m[step + 1] = state.travel_m;
        }
    }
}

/* Height at the steps: a process over the travel and the time, and how the run starts */
static void raise_wheel(workspace *work, int64_t steps, double start_height_m)
{
    const rover_model *model = work->model;
    const rover_knots *knots = &model->height.knots;
    const double per_step = 1.0 / knots->step_m;
    rover_weigh(model, &model->height, &work->like, &work->weights);
    evaluate_times(work, &model->height, work->time_s[steps]);
    rover_along along = along_travel(work, &model->height, start_height_m, 1.0);
    int64_t at = 0;
    work->height_m[0] = start_height_m;
    for (int64_t step = 1; step <= steps; step++) {
        double place = rover_place(knots, work->travel_m[step], per_step);
        work->height_m[step] = rover_along_at(&along, place);
        work->height_m[step] += read_time(&model->height, work->knot_values, work->time_s[step], &at);
    }
}

/* The step that a time lies in, from 0 to steps - 1; `near` is a guess, best a little below */
static int64_t step_of(const double *time_s, int64_t steps, double asked, int64_t near)
{
    int64_t low = 0, high = steps;
    if (time_s[near] <= asked) {
        low = near;
        for (int more = 1; more <= 4 && near + more <= steps; more++) {
            if (asked < time_s[near + more])
                return near + more - 1;
            low = near + more < steps ? near + more : steps - 1;
        }
    }
    while (high - low > 1) {
        int64_t middle = (low + high) / 2;
        if (time_s[middle] <= asked)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Reads the steps at the asked times, x and y. Here it is decided what lies between steps: a straight line. */
static void sample(const workspace *work, int64_t steps, int64_t times, const double *asked, double *restrict x_m,
                   double *restrict y_m)
{
    const double *time = work->time_s;
    for (int64_t first = 0, end, step = 0; first < times; first = end) {
        double from = asked[first];
        if (steps == 0 || from >= time[steps] || from < time[0]) { /* held past the ends */
            int64_t at = steps == 0 || from < time[0] ? 0 : steps;
            x_m[first] = work->travel_m[at];
            y_m[first] = work->height_m[at];
            end = first + 1;
            continue;
        }
        step = step_of(time, steps, from, step);
        const double low = time[step], high = time[step + 1], width = high - low;
        const double x = work->travel_m[step], y = work->height_m[step];
        const double x_slope = (work->travel_m[step + 1] - x) / width, y_slope = (work->height_m[step + 1] - y) / width;
        for (end = first + 1; end < times && asked[end] >= low && asked[end] < high;)
            end++;
        for (int64_t i = first; i < end; i++) {
            x_m[i] = x_slope * (asked[i] - low) + x;
            y_m[i] = y_slope * (asked[i] - low) + y;
        }
    }
}

static void predict_one(workspace *work, const step_plan *plan, double angle_rad, double mass_kg, double ratio)
{
    const rover_model *model = work->model;
    const double held_mass_kg = rover_held_mass(model, mass_kg);
    double start_speed, start_height;
    rover_law_begin(&work->law, angle_rad, ratio, held_mass_kg);
    rover_resemble(model, angle_rad, mass_kg, ratio, work->law.margin, &work->like);
    rover_start(model, &work->like, &start_speed, &start_height);
    integrate(work, plan, rover_mass_scale(&model->laws, held_mass_kg), start_speed);
    raise_wheel(work, plan->count, start_height);
}

/* The largest of the times; negative if one is not a number or infinite */
static double horizon(int64_t times, const double *time_s)
{
    double most = 0.0, suspect = 0.0;
    for (int64_t i = 0; i < times; i++) {
        most = time_s[i] > most ? time_s[i] : most;
        suspect += time_s[i] * 0.0; /* NaN, where the time is not a finite number */
    }
    return suspect == 0.0 ? most : -1.0;
}

int64_t rover_predict(const rover_model *model, int64_t count, const double *scenarios, int64_t times,
                      const double *time_s, int64_t stride, double *positions)
{
    const double *angle_rad = scenarios, *mass_kg = scenarios + count, *ratio = scenarios + 2 * count;
    double longest = 0.0, *x_m = positions, *y_m = positions + count * times;
    for (int64_t row = 0; row < (stride ? count : 1); row++) {
        double one = horizon(times, time_s + row * stride);
        if (one < 0.0)
            return ROVER_BAD_TIME;
        longest = one > longest ? one : longest;
    }
    step_plan plan;
    workspace work;
    if (plan_steps(longest, model->refine, &plan) != ROVER_OK)
        return ROVER_NO_MEMORY;
    double *memory = allocate(&work, model, plan.count);
    if (!memory)
        return ROVER_NO_MEMORY;
    step_times(&plan, model->refine, work.time_s); /* those of shorter horizons are the first of these */
    for (int64_t row = 0; row < count; row++) {
        const double *asked = time_s + row * stride;
        if (stride) {
            double one = horizon(times, asked); /* again: were it longer now, the steps would not fit */
            plan_steps(one < longest ? one : longest, model->refine, &plan);
        }
        predict_one(&work, &plan, angle_rad[row], mass_kg[row], ratio[row]);
        sample(&work, plan.count, times, asked, x_m + row * times, y_m + row * times);
    }
    free(memory);
    return ROVER_OK;
}
