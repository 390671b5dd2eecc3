#include <string.h>

#include "common.h"
#include "system.h"

int fmu_none(const fmu *instance, const char *function, const char *kind, size_t count)
{
    return count ? fmu_refuse(instance, function, "there is no variable of type %s", kind) : FMU_OK;
}

int fmu_set_logging(const fmu *instance, const char *function, size_t count, const char *const *categories)
{
    for (size_t i = 0; categories && i < count; i++)
        if (!categories[i] || (strcmp(categories[i], "logStatusError") && strcmp(categories[i], "logStatusWarning")))
            return fmu_refuse(instance, function, "there is no log category %s, there are logStatusError and logStatusWarning",
                              categories[i] ? categories[i] : "NULL");
    return FMU_OK; /* errors are told always, and there is nothing else to tell */
}

int fmu_terminate(fmu *instance, const char *function)
{
    if (fmu_require(instance, function, FMU_STEPPING))
        return FMU_ERROR;
    instance->state.mode = FMU_TERMINATED;
    return FMU_OK;
}

static int need_room(const fmu *instance, const char *function, fmu_kept **state)
{
    if (!*state && !(*state = fmu_allocate(sizeof **state)))
        return fmu_refuse(instance, function, "there is not enough memory");
    return FMU_OK;
}

int fmu_get_state(const fmu *instance, const char *function, fmu_kept **state)
{
    if (need_room(instance, function, state))
        return FMU_ERROR;
    fmu_keep(instance, *state);
    return FMU_OK;
}

int fmu_free_state(fmu_kept **state)
{
    if (state) {
        fmu_free(*state);
        *state = NULL;
    }
    return FMU_OK;
}

int fmu_serialise(const fmu *instance, const char *function, const fmu_kept *state, void *bytes, size_t size)
{
    if (size < sizeof *state)
        return fmu_refuse(instance, function, "the state needs %g bytes, there are %g", (double)sizeof *state,
                          (double)size);
    memcpy(bytes, state, sizeof *state);
    return FMU_OK;
}

int fmu_deserialise(const fmu *instance, const char *function, const void *bytes, size_t size, fmu_kept **state)
{
    fmu_kept found;
    if (size != sizeof found)
        return fmu_refuse(instance, function, "a state has %g bytes, these are %g", (double)sizeof found, (double)size);
    memcpy(&found, bytes, sizeof found);
    if (fmu_check_kept(instance, function, &found) || need_room(instance, function, state))
        return FMU_ERROR;
    **state = found;
    return FMU_OK;
}
