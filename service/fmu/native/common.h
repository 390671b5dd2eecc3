/* What both versions of FMI do alike, for lists of variables and for states, under the name of the calling function. */
#ifndef ROVER_COMMON_H
#define ROVER_COMMON_H

#include "fmu.h"

/* Of a function with an instance: leaves it with an error where there is none, or where a pointer is missing. */
#define NEED_INSTANCE(instance) \
    do {                        \
        if (!(instance))        \
            return FMU_ERROR;   \
    } while (0)
#define NEED(instance, pointer)                                                \
    do {                                                                       \
        if (!(pointer))                                                        \
            return fmu_refuse(instance, __func__, "an argument is missing: it is NULL"); \
    } while (0)
/* Values one by one: all of them are looked at before the first is set. */
#define GET_ALL(instance, kind, references, count, values, type)                                  \
    do {                                                                                          \
        for (size_t i = 0; i < (count); i++) {                                                    \
            double found;                                                                         \
            if (fmu_get(instance, __func__, kind, (references)[i], &found))                       \
                return FMU_ERROR;                                                                 \
            (values)[i] = (type)found;                                                            \
        }                                                                                         \
    } while (0)
#define SET_ALL(instance, kind, references, count, number_of)                                     \
    do {                                                                                          \
        for (size_t i = 0; i < (count); i++)                                                      \
            if (fmu_may_set(instance, __func__, kind, (references)[i], number_of))                \
                return FMU_ERROR;                                                                 \
        for (size_t i = 0; i < (count); i++)                                                      \
            fmu_put(instance, (references)[i], number_of);                                        \
    } while (0)

/* For a kind of variables of which there are none */
int fmu_none(const fmu *instance, const char *function, const char *kind, size_t count);
int fmu_set_logging(const fmu *instance, const char *function, size_t count, const char *const *categories);
int fmu_terminate(fmu *instance, const char *function);
int fmu_get_state(const fmu *instance, const char *function, fmu_kept **state);
int fmu_free_state(fmu_kept **state);
int fmu_serialise(const fmu *instance, const char *function, const fmu_kept *state, void *bytes, size_t size);
int fmu_deserialise(const fmu *instance, const char *function, const void *bytes, size_t size, fmu_kept **state);

#endif
