/* FMI 2.0 for Co-Simulation: types and functions under the names that the standard gives them, in our words. */
#ifndef ROVER_FMI2_H
#define ROVER_FMI2_H

#include <stddef.h>

#include "export.h"
#include "fmu.h"

typedef fmu *fmi2Component;
typedef fmu_kept *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef int fmi2Status;     /* FMU_OK, ... */
typedef int fmi2StatusKind; /* below */
typedef int fmi2Type;

enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated };
enum { fmi2ModelExchange, fmi2CoSimulation };

typedef void fmi2Logger(void *environment, fmi2String instance, fmi2Status status, fmi2String category,
                        fmi2String message, ...);
typedef struct {
    fmi2Logger *logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(void *, fmi2Status);
    void *componentEnvironment;
} fmi2CallbackFunctions;

FMU_EXPORT const char *fmi2GetTypesPlatform(void);
FMU_EXPORT const char *fmi2GetVersion(void);
FMU_EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component, fmi2Boolean, size_t, const fmi2String[]);
FMU_EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                         const fmi2CallbackFunctions *, fmi2Boolean visible, fmi2Boolean logging);
FMU_EXPORT void fmi2FreeInstance(fmi2Component);
FMU_EXPORT fmi2Status fmi2SetupExperiment(fmi2Component, fmi2Boolean, fmi2Real tolerance, fmi2Real start_s,
                                          fmi2Boolean has_stop, fmi2Real stop_s);
FMU_EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component);
FMU_EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component);
FMU_EXPORT fmi2Status fmi2Terminate(fmi2Component);
FMU_EXPORT fmi2Status fmi2Reset(fmi2Component);
FMU_EXPORT fmi2Status fmi2GetReal(fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]);
FMU_EXPORT fmi2Status fmi2GetInteger(fmi2Component, const fmi2ValueReference[], size_t, fmi2Integer[]);
FMU_EXPORT fmi2Status fmi2GetBoolean(fmi2Component, const fmi2ValueReference[], size_t, fmi2Boolean[]);
FMU_EXPORT fmi2Status fmi2GetString(fmi2Component, const fmi2ValueReference[], size_t, fmi2String[]);
FMU_EXPORT fmi2Status fmi2SetReal(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]);
FMU_EXPORT fmi2Status fmi2SetInteger(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Integer[]);
FMU_EXPORT fmi2Status fmi2SetBoolean(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Boolean[]);
FMU_EXPORT fmi2Status fmi2SetString(fmi2Component, const fmi2ValueReference[], size_t, const fmi2String[]);
FMU_EXPORT fmi2Status fmi2GetFMUstate(fmi2Component, fmi2FMUstate *);
FMU_EXPORT fmi2Status fmi2SetFMUstate(fmi2Component, fmi2FMUstate);
FMU_EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component, fmi2FMUstate *);
FMU_EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t *);
FMU_EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, fmi2Byte[], size_t);
FMU_EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *);
FMU_EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component, const fmi2ValueReference[], size_t,
                                                   const fmi2ValueReference[], size_t, const fmi2Real[], fmi2Real[]);
FMU_EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component, const fmi2ValueReference[], size_t,
                                                  const fmi2Integer[], const fmi2Real[]);
FMU_EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component, const fmi2ValueReference[], size_t,
                                                   const fmi2Integer[], fmi2Real[]);
FMU_EXPORT fmi2Status fmi2DoStep(fmi2Component, fmi2Real point_s, fmi2Real step_s, fmi2Boolean no_state_before);
FMU_EXPORT fmi2Status fmi2CancelStep(fmi2Component);
FMU_EXPORT fmi2Status fmi2GetStatus(fmi2Component, fmi2StatusKind, fmi2Status *);
FMU_EXPORT fmi2Status fmi2GetRealStatus(fmi2Component, fmi2StatusKind, fmi2Real *);
FMU_EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component, fmi2StatusKind, fmi2Integer *);
FMU_EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component, fmi2StatusKind, fmi2Boolean *);
FMU_EXPORT fmi2Status fmi2GetStringStatus(fmi2Component, fmi2StatusKind, fmi2String *);

#endif
