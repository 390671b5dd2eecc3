/* Functions of FMI 2.0 for model exchange, which this FMU is not for: some importers look for them all the same. Only
 * the argument that is looked at is declared: on all platforms that are built for, the caller clears up the rest. */
#include "common.h"
#include "fmi2.h"

#define NOT_PROVIDED(function)                                                                              \
    FMU_EXPORT fmi2Status function(fmi2Component c);                                                        \
    fmi2Status function(fmi2Component c)                                                                    \
    {                                                                                                       \
        NEED_INSTANCE(c);                                                                                   \
        return fmu_refuse(c, __func__, "this FMU is for co-simulation, not for model exchange");            \
    }
NOT_PROVIDED(fmi2EnterEventMode)
NOT_PROVIDED(fmi2NewDiscreteStates)
NOT_PROVIDED(fmi2EnterContinuousTimeMode)
NOT_PROVIDED(fmi2CompletedIntegratorStep)
NOT_PROVIDED(fmi2SetTime)
NOT_PROVIDED(fmi2SetContinuousStates)
NOT_PROVIDED(fmi2GetDerivatives)
NOT_PROVIDED(fmi2GetEventIndicators)
NOT_PROVIDED(fmi2GetContinuousStates)
NOT_PROVIDED(fmi2GetNominalsOfContinuousStates)
