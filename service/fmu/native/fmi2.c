/* Each function refuses what the standard does not allow, and says so to the importer's logger. */
#include "common.h"
#include "fmi2.h"

/* The logger formats its message as printf does: ours has nothing to be formatted (message.c). */
static void tell(const fmu *instance, int status, const char *category, const char *message)
{
    const fmi2CallbackFunctions *functions = instance->callback;
    if (functions && functions->logger)
        functions->logger(instance->environment, instance->name ? instance->name : "", status, category, message);
}

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t count, const fmi2String categories[])
{
    (void)on;
    NEED_INSTANCE(c);
    return fmu_set_logging(c, __func__, count, categories);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    (void)visible;
    (void)logging;
    void *environment = functions ? functions->componentEnvironment : NULL;
    if (type != fmi2CoSimulation) {
        fmu nobody = {.log = tell, .callback = (void *)functions, .environment = environment};
        fmu_refuse(&nobody, __func__, "this FMU is for co-simulation, not for model exchange");
        return NULL;
    }
    return fmu_begin(__func__, name, guid, resources, true, tell, (void *)functions, environment);
}

void fmi2FreeInstance(fmi2Component c)
{
    fmu_end(c);
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start_s,
                               fmi2Boolean has_stop, fmi2Real stop_s)
{
    (void)has_tolerance;
    (void)tolerance;
    NEED_INSTANCE(c);
    return fmu_set_times(c, __func__, start_s, has_stop != 0, stop_s);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    NEED_INSTANCE(c);
    return fmu_enter_initialisation(c, __func__);
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    NEED_INSTANCE(c);
    return fmu_exit_initialisation(c, __func__);
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    NEED_INSTANCE(c);
    return fmu_terminate(c, __func__);
}

fmi2Status fmi2Reset(fmi2Component c)
{
    NEED_INSTANCE(c);
    fmu_reset(c);
    return FMU_OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Real values[])
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    GET_ALL(c, FMU_REAL, references, count, values, fmi2Real);
    return FMU_OK;
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count, fmi2Boolean values[])
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    GET_ALL(c, FMU_BOOLEAN, references, count, values, fmi2Boolean);
    return FMU_OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference references[], size_t count, const fmi2Real values[])
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    SET_ALL(c, FMU_REAL, references, count, values[i]);
    return FMU_OK;
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference references[], size_t count,
                          const fmi2Boolean values[])
{
    NEED_INSTANCE(c);
    NEED(c, !count || (references && values));
    SET_ALL(c, FMU_BOOLEAN, references, count, values[i] ? 1.0 : 0.0);
    return FMU_OK;
}

#define NONE(function, kind, values)                                                                        \
    fmi2Status function(fmi2Component c, const fmi2ValueReference references[], size_t count, values)       \
    {                                                                                                       \
        (void)references;                                                                                   \
        (void)unused;                                                                                       \
        NEED_INSTANCE(c);                                                                                   \
        return fmu_none(c, __func__, kind, count);                                                          \
    }
NONE(fmi2GetInteger, "Integer", fmi2Integer unused[])
NONE(fmi2SetInteger, "Integer", const fmi2Integer unused[])
NONE(fmi2GetString, "String", fmi2String unused[])
NONE(fmi2SetString, "String", const fmi2String unused[])

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    NEED_INSTANCE(c);
    NEED(c, state);
    return fmu_get_state(c, __func__, state);
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    NEED_INSTANCE(c);
    NEED(c, state);
    return fmu_resume(c, __func__, state);
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    NEED_INSTANCE(c);
    return fmu_free_state(state);
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size)
{
    NEED_INSTANCE(c);
    NEED(c, state && size);
    *size = sizeof *state;
    return FMU_OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
{
    NEED_INSTANCE(c);
    NEED(c, state && bytes);
    return fmu_serialise(c, __func__, state, bytes, size);
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
{
    NEED_INSTANCE(c);
    NEED(c, bytes && state);
    return fmu_deserialise(c, __func__, bytes, size, state);
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknowns[], size_t unknown_count,
                                        const fmi2ValueReference knowns[], size_t known_count, const fmi2Real seed[],
                                        fmi2Real values[])
{
    (void)unknowns;
    (void)unknown_count;
    (void)knowns;
    (void)known_count;
    (void)seed;
    (void)values;
    NEED_INSTANCE(c);
    return fmu_refuse(c, __func__, "directional derivatives are not provided");
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                       const fmi2Integer orders[], const fmi2Real values[])
{
    (void)references;
    (void)orders;
    (void)values;
    NEED_INSTANCE(c);
    return count ? fmu_refuse(c, __func__, "inputs are constant during a step: they cannot be interpolated") : FMU_OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference references[], size_t count,
                                        const fmi2Integer orders[], fmi2Real values[])
{
    (void)references;
    (void)orders;
    (void)values;
    NEED_INSTANCE(c);
    return count ? fmu_refuse(c, __func__, "derivatives of outputs are not provided") : FMU_OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point_s, fmi2Real step_s, fmi2Boolean no_state_before)
{
    (void)no_state_before;
    NEED_INSTANCE(c);
    return fmu_step(c, __func__, point_s, step_s);
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    NEED_INSTANCE(c);
    return fmu_refuse(c, __func__, "no step is pending: each has ended when fmi2DoStep returns");
}

static fmi2Status not_pending(fmi2Component c, const char *function)
{
    fmu_refuse(c, function, "no step is pending: each has ended when fmi2DoStep returns");
    return FMU_DISCARD;
}

fmi2Status fmi2GetStatus(fmi2Component c, fmi2StatusKind kind, fmi2Status *value)
{
    (void)kind;
    (void)value;
    NEED_INSTANCE(c);
    return not_pending(c, __func__);
}

fmi2Status fmi2GetRealStatus(fmi2Component c, fmi2StatusKind kind, fmi2Real *value)
{
    NEED_INSTANCE(c);
    NEED(c, value);
    if (kind != fmi2LastSuccessfulTime)
        return not_pending(c, __func__);
    *value = c->state.values[FMU_TIME];
    return FMU_OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, fmi2StatusKind kind, fmi2Integer *value)
{
    (void)kind;
    (void)value;
    NEED_INSTANCE(c);
    return not_pending(c, __func__);
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, fmi2StatusKind kind, fmi2Boolean *value)
{
    NEED_INSTANCE(c);
    NEED(c, value);
    if (kind != fmi2Terminated)
        return not_pending(c, __func__);
    *value = 0;
    return FMU_OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, fmi2StatusKind kind, fmi2String *value)
{
    (void)kind;
    (void)value;
    NEED_INSTANCE(c);
    return not_pending(c, __func__);
}
