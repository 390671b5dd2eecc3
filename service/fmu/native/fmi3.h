/* FMI 3.0 for Co-Simulation: types and functions under the names that the standard gives them, in our words. */
#ifndef ROVER_FMI3_H
#define ROVER_FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "export.h"
#include "fmu.h"

typedef fmu *fmi3Instance;
typedef fmu_kept *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef double fmi3Float64;
typedef bool fmi3Boolean;
typedef const char *fmi3String;
typedef uint8_t fmi3Byte;
typedef int fmi3Status; /* FMU_OK, ... */

typedef void fmi3LogMessage(void *environment, fmi3Status status, fmi3String category, fmi3String message);

FMU_EXPORT const char *fmi3GetVersion(void);
FMU_EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance, fmi3Boolean, size_t, const fmi3String[]);
FMU_EXPORT fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources,
                                                    fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                                    fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                                    size_t intermediate_count, void *environment, fmi3LogMessage *,
                                                    void (*intermediate_update)(void));
FMU_EXPORT fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean logging, void *environment,
                                                     fmi3LogMessage *);
FMU_EXPORT fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources,
                                                          fmi3Boolean visible, fmi3Boolean logging, void *environment,
                                                          fmi3LogMessage *, void (*clock_update)(void),
                                                          void (*lock)(void), void (*unlock)(void));
FMU_EXPORT void fmi3FreeInstance(fmi3Instance);
FMU_EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance, fmi3Boolean, fmi3Float64 tolerance,
                                                  fmi3Float64 start_s, fmi3Boolean has_stop, fmi3Float64 stop_s);
FMU_EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance);
FMU_EXPORT fmi3Status fmi3Terminate(fmi3Instance);
FMU_EXPORT fmi3Status fmi3Reset(fmi3Instance);
FMU_EXPORT fmi3Status fmi3GetFloat64(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Float64[], size_t);
FMU_EXPORT fmi3Status fmi3SetFloat64(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3Float64[], size_t);
FMU_EXPORT fmi3Status fmi3GetBoolean(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Boolean[], size_t);
FMU_EXPORT fmi3Status fmi3SetBoolean(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3Boolean[], size_t);
FMU_EXPORT fmi3Status fmi3GetFMUState(fmi3Instance, fmi3FMUState *);
FMU_EXPORT fmi3Status fmi3SetFMUState(fmi3Instance, fmi3FMUState);
FMU_EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance, fmi3FMUState *);
FMU_EXPORT fmi3Status fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t *);
FMU_EXPORT fmi3Status fmi3SerializeFMUState(fmi3Instance, fmi3FMUState, fmi3Byte[], size_t);
FMU_EXPORT fmi3Status fmi3DeserializeFMUState(fmi3Instance, const fmi3Byte[], size_t, fmi3FMUState *);
FMU_EXPORT fmi3Status fmi3DoStep(fmi3Instance, fmi3Float64 point_s, fmi3Float64 step_s, fmi3Boolean no_state_before,
                                 fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached_s);

#endif
