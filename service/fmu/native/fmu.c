#include <string.h>

#include "fmu.h"
#include "system.h"

static const double radians = 3.14159265358979323846 / 180.0, no_stop_s = 1e300;
static const double moves_m_s = 0.001, stands_m_s = 1e-9; /* as service/twin/moment.py */

enum { CLOCK, INPUT, PARAMETER, OUTPUT };

/* `least` to `most` is what may be set, `start` what an instance begins with. */
static const struct {
    const char *name, *unit;
    int kind, role;
    double least, most, start;
} variables[FMU_VARIABLES] = {
    [FMU_TIME] = {"time", " s", FMU_REAL, CLOCK, 0.0, 0.0, 0.0},
    [FMU_SLOPE] = {"slope_deg", " deg", FMU_REAL, INPUT, -45.0, 45.0, 0.0},
    [FMU_TORQUE] = {"torque_nm", " N m", FMU_REAL, INPUT, 0.0, 1e4, 0.0},
    [FMU_BRAKE] = {"brake", "", FMU_BOOLEAN, INPUT, 0.0, 1.0, 0.0},
    [FMU_MASS] = {"mass_kg", " kg", FMU_REAL, PARAMETER, 1.0, 1e4, 430.0},
    [FMU_START_SPEED] = {"start_speed_m_s", " m/s", FMU_REAL, PARAMETER, -5.0, 5.0, 0.0},
    [FMU_PARKED] = {"parked", "", FMU_BOOLEAN, PARAMETER, 0.0, 1.0, 1.0},
    [FMU_X] = {"x_m", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_Y] = {"y_m", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_SPEED] = {"speed_m_s", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_REAR] = {"rear_wheel_speed_rad_s", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_FRONT] = {"front_wheel_speed_rad_s", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_SLIP] = {"slip_ratio", "", FMU_REAL, OUTPUT, 0.0, 0.0, 0.0},
    [FMU_MOVING] = {"moving", "", FMU_BOOLEAN, OUTPUT, 0.0, 0.0, 0.0},
};
static const char *const roles[] = {"the time", "an input", "a parameter", "an output"};
static const char *const modes[] = {"before initialization", "in initialization mode", "in step mode",
                                    "after termination"};

static double size_of(double number)
{
    return number < 0.0 ? -number : number;
}

static bool is_finite(double number)
{
    return number - number == 0.0;
}

static int mode_of(const fmu *instance)
{
    return (int)instance->state.mode;
}

/* What is said of a rover whose six numbers are these */
static void show(fmu *instance, const double *outputs)
{
    double *values = instance->state.values, speed = outputs[ROVER_SPEED];
    double rims = (0.5 * instance->law.law.wheel_radius_m) * (outputs[ROVER_REAR] + outputs[ROVER_FRONT]);
    double rim_size = size_of(rims), speed_size = size_of(speed), larger = rim_size > speed_size ? rim_size : speed_size;
    values[FMU_X] = outputs[ROVER_X];
    values[FMU_Y] = outputs[ROVER_HEIGHT];
    values[FMU_SPEED] = speed;
    values[FMU_REAR] = outputs[ROVER_REAR];
    values[FMU_FRONT] = outputs[ROVER_FRONT];
    values[FMU_SLIP] = larger < stands_m_s ? 0.0 : (rims - speed) / larger;
    values[FMU_MOVING] = speed_size >= moves_m_s ? 1.0 : 0.0;
}

static void place_rover(const fmu *instance, rover_state *to)
{
    const double *values = instance->state.values;
    double slope = values[FMU_SLOPE] * radians, speed = values[FMU_START_SPEED];
    if (values[FMU_PARKED] != 0.0)
        rover_release_speeds(&instance->law.release, 1, &slope, &values[FMU_MASS], &speed);
    rover_start(&instance->law.law, values[FMU_MASS], speed, to);
}

/* Outputs of a rover that has not gone yet, under the present inputs */
static void show_start(fmu *instance)
{
    const double *values = instance->state.values;
    double always = 0.0, slope = values[FMU_SLOPE] * radians, outputs[ROVER_OUTPUTS];
    rover_track track = {1, &always, &slope};
    rover_controls controls = {1, &always, &values[FMU_TORQUE], &values[FMU_BRAKE]};
    rover_state rover;
    place_rover(instance, &rover);
    rover_drive(&instance->law.law, &rover, &track, &controls, 0.0, 1, &always, outputs);
    show(instance, outputs);
}

void fmu_reset(fmu *instance)
{
    memset(&instance->state, 0, sizeof instance->state);
    instance->state.stop_s = no_stop_s;
    for (int i = 0; i < FMU_VARIABLES; i++)
        instance->state.values[i] = variables[i].start;
}

static char *copied(const char *text)
{
    size_t bytes = strlen(text) + 1;
    char *to = fmu_allocate(bytes);
    return to ? memcpy(to, text, bytes) : NULL;
}

/* The law of a folder, or of `resources` in it: some importers say where the FMU lies. */
static void *law_in(const char *folder, size_t *bytes)
{
    void *found = fmu_read(folder, FMU_LAW_FILE, bytes);
    return found ? found : fmu_read(folder, "resources/" FMU_LAW_FILE, bytes);
}

static int read_law(fmu *instance, const char *function, const char *resources, bool is_uri)
{
    void *content = NULL;
    size_t bytes = 0;
    if (!resources)
        return fmu_refuse(instance, function, "the folder of the resources is not said: it is NULL");
    for (int decode = 1; decode >= 0 && !content; decode--) {
        char *folder = is_uri ? fmu_path_of(resources, decode) : copied(resources);
        content = folder ? law_in(folder, &bytes) : NULL;
        fmu_free(folder);
    }
    if (!content)
        return fmu_refuse(instance, function, "%s cannot be read in %s", FMU_LAW_FILE, resources);
    const char *wrong = fmu_law_begin(&instance->law, content, bytes);
    return wrong ? fmu_refuse(instance, function, "%s in %s: %s", FMU_LAW_FILE, resources, wrong) : FMU_OK;
}

static int begin(fmu *instance, const char *function, const char *name, const char *token, const char *resources,
                 bool is_uri)
{
    if (!name || !*name)
        return fmu_refuse(instance, function, "the instance has no name");
    if (!(instance->name = copied(name)))
        return fmu_refuse(instance, function, "there is not enough memory");
    if (read_law(instance, function, resources, is_uri))
        return FMU_ERROR;
    if (!token || strcmp(token, instance->law.token))
        return fmu_refuse(instance, function, "the model description is of %s, the resources are of %s",
                          token ? token : "NULL", instance->law.token);
    return FMU_OK;
}

fmu *fmu_begin(const char *function, const char *name, const char *token, const char *resources, bool is_uri,
               fmu_logger *log, void *callback, void *environment)
{
    fmu *instance = fmu_allocate(sizeof *instance);
    if (!instance)
        return NULL;
    instance->log = log;
    instance->callback = callback;
    instance->environment = environment;
    if (begin(instance, function, name, token, resources, is_uri)) {
        fmu_end(instance);
        return NULL;
    }
    fmu_reset(instance);
    return instance;
}

void fmu_end(fmu *instance)
{
    if (!instance)
        return;
    fmu_law_end(&instance->law);
    fmu_free(instance->name);
    fmu_free(instance);
}

int fmu_require(const fmu *instance, const char *function, int mode)
{
    if (mode_of(instance) == mode)
        return FMU_OK;
    return fmu_refuse(instance, function, "allowed %s, not %s", modes[mode], modes[mode_of(instance)]);
}

static int known(const fmu *instance, const char *function, int kind, uint32_t reference)
{
    static const char *const kinds[] = {"number", "Boolean"};
    if (reference >= FMU_VARIABLES)
        return fmu_refuse(instance, function, "there is no variable with value reference %u", (unsigned int)reference);
    if (variables[reference].kind != kind)
        return fmu_refuse(instance, function, "%s is a %s", variables[reference].name, kinds[1 - kind]);
    return FMU_OK;
}

int fmu_get(fmu *instance, const char *function, int kind, uint32_t reference, double *value)
{
    if (known(instance, function, kind, reference))
        return FMU_ERROR;
    if (variables[reference].role == OUTPUT && mode_of(instance) < FMU_STEPPING)
        show_start(instance);
    *value = instance->state.values[reference];
    return FMU_OK;
}

int fmu_may_set(const fmu *instance, const char *function, int kind, uint32_t reference, double value)
{
    if (known(instance, function, kind, reference))
        return FMU_ERROR;
    int role = variables[reference].role, mode = mode_of(instance);
    const char *name = variables[reference].name, *unit = variables[reference].unit;
    if (role != INPUT && role != PARAMETER)
        return fmu_refuse(instance, function, "%s is %s: it cannot be set", name, roles[role]);
    if (mode == FMU_TERMINATED || (mode == FMU_STEPPING && role == PARAMETER))
        return fmu_refuse(instance, function, "%s is %s: it cannot be set %s", name, roles[role], modes[mode]);
    double least = variables[reference].least, most = variables[reference].most;
    if (!(value >= least && value <= most))
        return fmu_refuse(instance, function, "%s is %g, allowed is %g to %g%s", name, value, least, most, unit);
    return FMU_OK;
}

void fmu_put(fmu *instance, uint32_t reference, double value)
{
    instance->state.values[reference] = value;
}

int fmu_set_times(fmu *instance, const char *function, double start_s, bool has_stop, double stop_s)
{
    if (fmu_require(instance, function, FMU_INSTANTIATED))
        return FMU_ERROR;
    if (!is_finite(start_s))
        return fmu_refuse(instance, function, "the start time is %g, allowed is any finite number", start_s);
    if (has_stop && !(stop_s >= start_s))
        return fmu_refuse(instance, function, "the stop time is %g s, before the start at %g s", stop_s, start_s);
    instance->state.values[FMU_TIME] = start_s;
    instance->state.stop_s = has_stop && stop_s < no_stop_s ? stop_s : no_stop_s;
    return FMU_OK;
}

int fmu_enter_initialisation(fmu *instance, const char *function)
{
    if (fmu_require(instance, function, FMU_INSTANTIATED))
        return FMU_ERROR;
    instance->state.mode = FMU_INITIALISING;
    return FMU_OK;
}

int fmu_exit_initialisation(fmu *instance, const char *function)
{
    if (fmu_require(instance, function, FMU_INITIALISING))
        return FMU_ERROR;
    show_start(instance);
    instance->state.mode = FMU_STEPPING;
    const double *values = instance->state.values;
    if (values[FMU_PARKED] != 0.0 && values[FMU_START_SPEED] != 0.0 && instance->log) {
        instance->log(instance, FMU_WARNING, "logStatusWarning",
                      "start_speed_m_s is not looked at, since parked is true: the rover is let go from rest");
        return FMU_WARNING;
    }
    return FMU_OK;
}

static void advance(fmu *instance, double duration_s)
{
    fmu_state *state = &instance->state;
    const double *values = state->values;
    double outputs[ROVER_OUTPUTS];
    double inputs[4] = {values[FMU_SLOPE] * radians, values[FMU_TORQUE], values[FMU_BRAKE], duration_s};
    if (state->begun == 0.0)
        place_rover(instance, &state->rover);
    state->begun = 1.0;
    rover_step(&instance->law.law, 1, &state->rover, inputs, NULL, outputs);
    show(instance, outputs);
}

int fmu_step(fmu *instance, const char *function, double point_s, double step_s)
{
    fmu_state *state = &instance->state;
    double now = state->values[FMU_TIME], tolerance = 1e-6 * (1.0 + size_of(now));
    if (fmu_require(instance, function, FMU_STEPPING))
        return FMU_ERROR;
    if (!(size_of(point_s - now) <= tolerance))
        return fmu_refuse(instance, function, "the step begins at %g s, the last one ended at %g s", point_s, now);
    if (!(step_s > 0.0 && step_s <= ROVER_MOST_S))
        return fmu_refuse(instance, function, "the step takes %g s, allowed is more than 0 and up to %g s", step_s,
                          ROVER_MOST_S);
    if (point_s + step_s > state->stop_s + tolerance)
        return fmu_refuse(instance, function, "the step ends at %g s, after the stop time of %g s", point_s + step_s,
                          state->stop_s);
    state->owed_s += step_s;
    if (state->owed_s >= FMU_SHORTEST_S) {
        advance(instance, state->owed_s);
        state->owed_s = 0.0;
    }
    state->values[FMU_TIME] = point_s + step_s;
    return FMU_OK;
}

static uint32_t checksum_of(const fmu_kept *kept)
{
    return fmu_checksum(&kept->law, sizeof *kept - offsetof(fmu_kept, law));
}

void fmu_keep(const fmu *instance, fmu_kept *to)
{
    memset(to, 0, sizeof *to);
    memcpy(to->magic, "RVFS", 4);
    to->format = 100 * FMU_STATE_FORMAT + ROVER_STATE_FORMAT;
    to->bytes = sizeof *to;
    to->law = instance->law.law.number;
    to->state = instance->state;
    to->checksum = checksum_of(to);
}

/* Whether values and mode are such as an instance can have; the engine takes any numbers of a rover. */
static bool is_sound(const fmu_state *state)
{
    bool holds = state->mode >= FMU_INSTANTIATED && state->mode <= FMU_TERMINATED
        && state->mode == (double)(int)state->mode && is_finite(state->values[FMU_TIME]) && is_finite(state->stop_s)
        && state->owed_s >= 0.0 && state->owed_s < FMU_SHORTEST_S;
    for (int i = 0; i < FMU_VARIABLES; i++)
        if (variables[i].role == INPUT || variables[i].role == PARAMETER)
            holds = holds && state->values[i] >= variables[i].least && state->values[i] <= variables[i].most;
    return holds;
}

int fmu_check_kept(const fmu *instance, const char *function, const fmu_kept *kept)
{
    if (memcmp(kept->magic, "RVFS", 4))
        return fmu_refuse(instance, function, "this is no state of this FMU");
    if (kept->format != 100 * FMU_STATE_FORMAT + ROVER_STATE_FORMAT || kept->bytes != sizeof *kept)
        return fmu_refuse(instance, function, "the state was made by another release");
    if (kept->checksum != checksum_of(kept))
        return fmu_refuse(instance, function, "the state is damaged: its checksum is another one");
    if (kept->law != instance->law.law.number)
        return fmu_refuse(instance, function, "the state belongs to another model, or to another version of this one");
    return is_sound(&kept->state) ? FMU_OK : fmu_refuse(instance, function, "the state has values that cannot be");
}

int fmu_resume(fmu *instance, const char *function, const fmu_kept *from)
{
    if (fmu_check_kept(instance, function, from))
        return FMU_ERROR;
    instance->state = from->state;
    return FMU_OK;
}
