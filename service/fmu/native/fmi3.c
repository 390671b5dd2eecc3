/* Each function refuses what the standard does not allow, and says so to the importer's logger. */
#include "common.h"
#include "fmi3.h"

static void tell(const fmu *instance, int status, const char *category, const char *message)
{
    fmi3LogMessage *log = (fmi3LogMessage *)instance->callback;
    if (log)
        log(instance->environment, status, category, message);
}

static fmi3Instance refused(const char *function, void *environment, fmi3LogMessage *log, const char *reason)
{
    fmu nobody = {.log = tell, .callback = (void *)log, .environment = environment};
    fmu_refuse(&nobody, function, "%s", reason);
    return NULL;
}

const char *fmi3GetVersion(void)
{
    return "3.0";
}

fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)on;
    NEED_INSTANCE(c);
    return fmu_set_logging(c, __func__, count, categories);
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
                                         const fmi3ValueReference intermediate[], size_t intermediate_count,
                                         void *environment, fmi3LogMessage *log, void (*intermediate_update)(void))
{
    (void)visible;
    (void)logging;
    (void)early_return;
    (void)intermediate;
    (void)intermediate_update;
    if (event_mode)
        return refused(__func__, environment, log, "there is no event mode: eventModeUsed must be false");
    if (intermediate_count)
        return refused(__func__, environment, log, "there are no intermediate variables to require");
    return fmu_begin(__func__, name, token, resources, false, tell, (void *)log, environment);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, void *environment, fmi3LogMessage *log)
{
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    return refused(__func__, environment, log, "this FMU is for co-simulation, not for model exchange");
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                               fmi3Boolean visible, fmi3Boolean logging, void *environment,
                                               fmi3LogMessage *log, void (*clock_update)(void), void (*lock)(void),
                                               void (*unlock)(void))
{
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)clock_update;
    (void)lock;
    (void)unlock;
    return refused(__func__, environment, log, "this FMU is for co-simulation, not for scheduled execution");
}

void fmi3FreeInstance(fmi3Instance c)
{
    fmu_end(c);
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                       fmi3Float64 start_s, fmi3Boolean has_stop, fmi3Float64 stop_s)
{
    (void)has_tolerance;
    (void)tolerance;
    NEED_INSTANCE(c);
    if (fmu_set_times(c, __func__, start_s, has_stop, stop_s))
        return FMU_ERROR;
    return fmu_enter_initialisation(c, __func__);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance c)
{
    NEED_INSTANCE(c);
    return fmu_exit_initialisation(c, __func__);
}

fmi3Status fmi3Terminate(fmi3Instance c)
{
    NEED_INSTANCE(c);
    return fmu_terminate(c, __func__);
}

fmi3Status fmi3Reset(fmi3Instance c)
{
    NEED_INSTANCE(c);
    fmu_reset(c);
    return FMU_OK;
}

#define NEED_COUNT(c, count, value_count)                                                                        \
    do {                                                                                                         \
        if ((count) != (value_count))                                                                            \
            return fmu_refuse(c, __func__, "%g variables have %g values here: each has one", (double)(count),    \
                              (double)(value_count));                                                            \
    } while (0)

fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Float64 values[],
                          size_t value_count)
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    NEED_COUNT(c, count, value_count);
    GET_ALL(c, FMU_REAL, references, count, values, fmi3Float64);
    return FMU_OK;
}

fmi3Status fmi3GetBoolean(fmi3Instance c, const fmi3ValueReference references[], size_t count, fmi3Boolean values[],
                          size_t value_count)
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    NEED_COUNT(c, count, value_count);
    GET_ALL(c, FMU_BOOLEAN, references, count, values, fmi3Boolean);
    return FMU_OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Float64 values[], size_t value_count)
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    NEED_COUNT(c, count, value_count);
    SET_ALL(c, FMU_REAL, references, count, values[i]);
    return FMU_OK;
}

fmi3Status fmi3SetBoolean(fmi3Instance c, const fmi3ValueReference references[], size_t count,
                          const fmi3Boolean values[], size_t value_count)
{
    const unsigned char *bytes = (const unsigned char *)values; /* whatever they are: a Boolean must not be another */
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    NEED_COUNT(c, count, value_count);
    SET_ALL(c, FMU_BOOLEAN, references, count, bytes[i] ? 1.0 : 0.0);
    return FMU_OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    NEED_INSTANCE(c);
    NEED(c, state);
    return fmu_get_state(c, __func__, state);
}

fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    NEED_INSTANCE(c);
    NEED(c, state);
    return fmu_resume(c, __func__, state);
}

fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    NEED_INSTANCE(c);
    return fmu_free_state(state);
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size)
{
    NEED_INSTANCE(c);
    NEED(c, state && size);
    *size = sizeof *state;
    return FMU_OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    NEED_INSTANCE(c);
    NEED(c, state && bytes);
    return fmu_serialise(c, __func__, state, bytes, size);
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    NEED_INSTANCE(c);
    NEED(c, bytes && state);
    return fmu_deserialise(c, __func__, bytes, size, state);
}

fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 point_s, fmi3Float64 step_s, fmi3Boolean no_state_before,
                      fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached_s)
{
    (void)no_state_before;
    NEED_INSTANCE(c);
    if (event)
        *event = false;
    if (terminate)
        *terminate = false;
    if (early)
        *early = false;
    int status = fmu_step(c, __func__, point_s, step_s);
    if (reached_s)
        *reached_s = c->state.values[FMU_TIME];
    return status;
}
