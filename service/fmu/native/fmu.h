/* One instance of an FMU, whichever version of FMI asks: its variables, what it may be asked when, steps, and states
 * that can be kept. No globals: instances are as many as anybody likes, each used by one thread at a time. */
#ifndef ROVER_FMU_H
#define ROVER_FMU_H

#include <stdbool.h>

#include "law_file.h"

#define FMU_STATE_FORMAT 1
#define FMU_SHORTEST_S 1e-6 /* shorter steps are driven together with the next */

/* Values of fmi2Status and of fmi3Status */
enum { FMU_OK = 0, FMU_WARNING = 1, FMU_DISCARD = 2, FMU_ERROR = 3 };
enum { FMU_REAL, FMU_BOOLEAN };
enum { FMU_INSTANTIATED, FMU_INITIALISING, FMU_STEPPING, FMU_TERMINATED };

/* Variables by their value reference; service/fmu/variables.py has the same ones. */
enum {
    FMU_TIME,
    FMU_SLOPE, FMU_TORQUE, FMU_BRAKE,
    FMU_MASS, FMU_START_SPEED, FMU_PARKED,
    FMU_X, FMU_Y, FMU_SPEED, FMU_REAR, FMU_FRONT, FMU_SLIP, FMU_MOVING,
    FMU_VARIABLES
};

/* All that an instance remembers and its future depends on. Numbers only: it is copied and kept as it is. */
typedef struct {
    double mode, begun; /* one of those above; whether `rover` is one yet, which it is from the first step on */
    double stop_s;      /* the end that the importer told, or ROVER_MOST_S times a lot */
    double owed_s;      /* of steps that were too short to be driven */
    double values[FMU_VARIABLES];
    rover_state rover;
} fmu_state;

typedef struct fmu fmu;
typedef void fmu_logger(const fmu *instance, int status, const char *category, const char *message);

struct fmu {
    fmu_state state;
    fmu_law law;
    char *name;
    fmu_logger *log;
    void *callback, *environment; /* what `log` calls, and with what */
};

/* Makes an instance with start values. NULL, with the reason logged, where token or resources do not fit. */
fmu *fmu_begin(const char *function, const char *name, const char *token, const char *resources, bool is_uri,
               fmu_logger *log, void *callback, void *environment);
void fmu_end(fmu *instance);
/* Start values everywhere, as after instantiation */
void fmu_reset(fmu *instance);

/* Logs an error and returns it. Formats know %s, %u and %g. */
int fmu_refuse(const fmu *instance, const char *function, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* FMU_ERROR, logged, unless the instance is in this mode */
int fmu_require(const fmu *instance, const char *function, int mode);

int fmu_get(fmu *instance, const char *function, int kind, uint32_t reference, double *value);
/* Whether a variable may have a value now; then fmu_put gives it. */
int fmu_may_set(const fmu *instance, const char *function, int kind, uint32_t reference, double value);
void fmu_put(fmu *instance, uint32_t reference, double value);

/* From instantiated to initialising, and from there to stepping */
int fmu_set_times(fmu *instance, const char *function, double start_s, bool has_stop, double stop_s);
int fmu_enter_initialisation(fmu *instance, const char *function);
int fmu_exit_initialisation(fmu *instance, const char *function);
int fmu_step(fmu *instance, const char *function, double point_s, double step_s);

/* States apart from their instance. A kept one has FMU_KEPT_BYTES; to read it checks that it is whole, and of this
 * version. */
typedef struct {
    char magic[4];
    uint32_t format, checksum, bytes;
    double law;
    fmu_state state;
} fmu_kept;
void fmu_keep(const fmu *instance, fmu_kept *to);
int fmu_resume(fmu *instance, const char *function, const fmu_kept *from);
int fmu_check_kept(const fmu *instance, const char *function, const fmu_kept *kept);

#endif
