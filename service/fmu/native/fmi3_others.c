/* Functions of FMI 3.0 that this FMU has no use for. The standard wants them there, and importers look for them. Only
 * the arguments that are looked at are declared: on all platforms that are built for, the caller clears up the rest. */
#include "common.h"
#include "fmi3.h"

#define NONE(function, kind)                                                                          \
    FMU_EXPORT fmi3Status function(fmi3Instance c, const fmi3ValueReference references[], size_t count); \
    fmi3Status function(fmi3Instance c, const fmi3ValueReference references[], size_t count)          \
    {                                                                                                 \
        (void)references;                                                                             \
        NEED_INSTANCE(c);                                                                             \
        return fmu_none(c, __func__, kind, count);                                                    \
    }
NONE(fmi3GetFloat32, "Float32")
NONE(fmi3SetFloat32, "Float32")
NONE(fmi3GetInt8, "Int8")
NONE(fmi3SetInt8, "Int8")
NONE(fmi3GetUInt8, "UInt8")
NONE(fmi3SetUInt8, "UInt8")
NONE(fmi3GetInt16, "Int16")
NONE(fmi3SetInt16, "Int16")
NONE(fmi3GetUInt16, "UInt16")
NONE(fmi3SetUInt16, "UInt16")
NONE(fmi3GetInt32, "Int32")
NONE(fmi3SetInt32, "Int32")
NONE(fmi3GetUInt32, "UInt32")
NONE(fmi3SetUInt32, "UInt32")
NONE(fmi3GetInt64, "Int64")
NONE(fmi3SetInt64, "Int64")
NONE(fmi3GetUInt64, "UInt64")
NONE(fmi3SetUInt64, "UInt64")
NONE(fmi3GetString, "String")
NONE(fmi3SetString, "String")
NONE(fmi3GetBinary, "Binary")
NONE(fmi3SetBinary, "Binary")
NONE(fmi3GetClock, "Clock")
NONE(fmi3SetClock, "Clock")
NONE(fmi3GetIntervalDecimal, "Clock")
NONE(fmi3SetIntervalDecimal, "Clock")
NONE(fmi3GetIntervalFraction, "Clock")
NONE(fmi3SetIntervalFraction, "Clock")
NONE(fmi3GetShiftDecimal, "Clock")
NONE(fmi3SetShiftDecimal, "Clock")
NONE(fmi3GetShiftFraction, "Clock")
NONE(fmi3SetShiftFraction, "Clock")

#define NOT_PROVIDED(function, reason)                     \
    FMU_EXPORT fmi3Status function(fmi3Instance c);        \
    fmi3Status function(fmi3Instance c)                    \
    {                                                      \
        NEED_INSTANCE(c);                                  \
        return fmu_refuse(c, __func__, reason);            \
    }
#define EXCHANGE "this FMU is for co-simulation, not for model exchange"
#define EVENTS "there is no event mode"
NOT_PROVIDED(fmi3GetNumberOfVariableDependencies, "dependencies are in the model description only")
NOT_PROVIDED(fmi3GetVariableDependencies, "dependencies are in the model description only")
NOT_PROVIDED(fmi3GetDirectionalDerivative, "directional derivatives are not provided")
NOT_PROVIDED(fmi3GetAdjointDerivative, "adjoint derivatives are not provided")
NOT_PROVIDED(fmi3GetOutputDerivatives, "derivatives of outputs are not provided")
NOT_PROVIDED(fmi3EnterConfigurationMode, "there are no structural parameters to configure")
NOT_PROVIDED(fmi3ExitConfigurationMode, "there are no structural parameters to configure")
NOT_PROVIDED(fmi3EnterEventMode, EVENTS)
NOT_PROVIDED(fmi3EnterStepMode, EVENTS ": step mode begins with fmi3ExitInitializationMode")
NOT_PROVIDED(fmi3EvaluateDiscreteStates, EVENTS)
NOT_PROVIDED(fmi3UpdateDiscreteStates, EVENTS)
NOT_PROVIDED(fmi3EnterContinuousTimeMode, EXCHANGE)
NOT_PROVIDED(fmi3CompletedIntegratorStep, EXCHANGE)
NOT_PROVIDED(fmi3SetTime, EXCHANGE)
NOT_PROVIDED(fmi3SetContinuousStates, EXCHANGE)
NOT_PROVIDED(fmi3GetContinuousStateDerivatives, EXCHANGE)
NOT_PROVIDED(fmi3GetEventIndicators, EXCHANGE)
NOT_PROVIDED(fmi3GetContinuousStates, EXCHANGE)
NOT_PROVIDED(fmi3GetNominalsOfContinuousStates, EXCHANGE)
NOT_PROVIDED(fmi3GetNumberOfEventIndicators, EXCHANGE)
NOT_PROVIDED(fmi3GetNumberOfContinuousStates, EXCHANGE)
NOT_PROVIDED(fmi3ActivateModelPartition, "this FMU is for co-simulation, not for scheduled execution")
