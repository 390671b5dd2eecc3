/* The resistance process in compiled form: what service/learning/resistance/library.py calls.
 *
 * No state, no globals: parameters come in as structs that the caller keeps and nobody changes, workspace is allocated
 * per call. SI units and radians. Sizes and pointers are the caller's promise (library.py keeps it); every number may
 * be anything, infinite or NaN included, and may change meanwhile, without a read or write out of bounds. The structs
 * are mirrored field by field in library.py: whoever changes one changes both, and ROVER_INTERFACE. */
#ifndef ROVER_ENGINE_H
#define ROVER_ENGINE_H

#include <stdint.h>

#define ROVER_INTERFACE 3

/* Loops that gain from wider vectors are compiled several times: for every machine, and for those with AVX2 or
 * AVX-512. Neither multiplications and additions are fused nor sums reordered: the bits are the same with all. */
#if defined(__x86_64__)
#define ROVER_AVX2 __attribute__((target("avx2")))
#define ROVER_AVX512 __attribute__((target("avx512f,avx512dq,avx512vl")))
#else
#define ROVER_AVX2
#define ROVER_AVX512
#endif
#define ROVER_INLINE static inline __attribute__((always_inline))
/* The wider versions of an inline function without result, and the call of the one for vectors of some bits */
#define ROVER_VERSIONS(name, parameters, arguments)                 \
    ROVER_AVX2 static void name##_avx2 parameters { name arguments; } \
    ROVER_AVX512 static void name##_avx512 parameters { name arguments; }
#define ROVER_CALL(bits, name, arguments)  \
    do {                                   \
        if ((bits) >= 512)                 \
            name##_avx512 arguments;       \
        else if ((bits) >= 256)            \
            name##_avx2 arguments;         \
        else                               \
            name arguments;                \
    } while (0)

enum { ROVER_OK = 0, ROVER_NO_MEMORY = 1, ROVER_BAD_TIME = 2 };
enum { ROVER_LANES = 16 };  /* tables are evaluated for so many knots at once */
enum { ROVER_SPEEDS = 16 }; /* and speed laws for so many speeds */
enum { FRONT, REAR, REAR_IN_RUT, AXLES };
enum { LEVEL, TRAVEL, RELEASE, RUT, STALL, PARTS };

/* A row of a block of tables */
typedef double rover_row[ROVER_LANES];

/* phi(s) = [adhesion + plateau J(s / (slip_scale f)) + linear clip(s, -0.5, 1)] [1 - backing_loss S((s - 1) / backing_slip)],
 * f = (load / 275 kg)^-load_exponent, S from 0 at 0 to 1 at 1 */
typedef struct {
    double adhesion, plateau, slip_scale, load_exponent, linear, backing_loss, backing_slip;
} rover_curve;

/* Where the weight is, see rover_axle_shares */
typedef struct {
    double wheelbase_m, centre_ahead_m, centre_height_m, height_rise_m, unladen_mass_kg, share_shift;
} rover_body;

/* Of the stall gate; names as in hyperparameters.py */
typedef struct {
    double margin, torque, mass, width;
} rover_gate;

/* What speed laws are made of: body, motors, hyperparameters (names as in hyperparameters.py), traction curves. */
typedef struct {
    int64_t vector_bits; /* rover_vector_bits(), or less */
    rover_body body;
    double rim_speed_m_s; /* without load */
    double reference_mass_kg, mass_exponent, mean_resistance;
    double sticking_margin, sticking_width, sticking_wheel_m_s, sticking_speed_m_s, margin_speed_m_s;
    rover_curve curves[AXLES];
    int64_t slip_count;
    const double *slips; /* falling */
    int64_t speed_count;
    const double *speeds_m_s; /* uniform, rising */
} rover_laws;

/* Knots on multiples of a step from `first_m` on. Of each cell of that uniform grid the knot at or before it; of each
 * knot its number of steps from the first and the inverse of the steps to the next one. */
typedef struct {
    double first_m, step_m;
    int64_t cell_count, knot_count;
    const int32_t *knot;
    const double *number, *inverse;
} rover_knots;

/* A solved Gaussian process, see tables.py. Tables are blocks of rows: (block, run, lane). */
typedef struct {
    int64_t shape[PARTS];                           /* which of the model's shapes each part has */
    double variance[PARTS];                         /* that of STALL: of the part that depends on time */
    double stall_level_variance, stall_travel_variance;
    double level_inverse_square[3], travel_inverse_square[3]; /* of the lengths, for the linear kernels */
    const double *level, *rut;                      /* (run,) */
    const double *travel;                           /* (block, run, lane) at `knots` */
    const double *plateau;                          /* at `knots`, what the rut part is multiplied with */
    const double *time;                             /* (block, 2 run, lane) at `time_s`: release, then stall */
    rover_knots knots;
    int64_t time_count;
    const double *time_s, *time_inverse;            /* knots, and the inverse of the time to the next one */
} rover_process;

/* A whole model. Features are (3, run), start features and weights (2, run). */
typedef struct {
    rover_laws laws;
    rover_gate stall_gate;
    double gravity_m_s2;
    int64_t run_count, shape_count, refine;
    double low[3], high[3];             /* of the runs' scaled features */
    double feature_margin, mass_reach; /* as in hyperparameters.py */
    const double *features, *gate, *half_inverse_square; /* the last: (shape, 3), 1 / (2 length^2) */
    const double *blend;                                 /* rut_blend at the cells of the resistance's knots */
    const double *start_features, *start_weights;
    double start_mean[2], start_inverse_lengths[2];
    rover_process resistance, height;
} rover_model;

int64_t rover_interface(void);
/* The bytes of a type above, by its name; 0 if there is none of that name. Of every one library.py has a mirror. */
int64_t rover_bytes(const char *name);
/* How wide this machine's vectors are, as far as is made use of: 128, 256 or 512. Slow in virtual machines: to be asked
 * once. */
int64_t rover_vector_bits(void);

/* Times of the integration's steps from 0 to the horizon or just past it, where all fit into `most`; returns their
 * number, or -1 for a horizon that is too long. `refine` cuts each step; below 1 there are none, and -1 is returned. */
int64_t rover_step_times(double horizon_s, int64_t refine, int64_t most, double *time_s);

/* Predicts x and y, (2, scenario, time), in metres for scenarios (3, scenario): slope angle (rad), mass (kg), torque
 * ratio. `stride` is the distance between the scenarios' rows of times: `times`, or 0 where all share one row. Times
 * rise, as a rule; they need not. */
int64_t rover_predict(const rover_model *model, int64_t count, const double *scenarios, int64_t times,
                      const double *time_s, int64_t stride, double *positions);

/* F - sin(angle) of scenarios at all the laws' speeds, (scenario, speed), and margin and sine, (scenario,). */
int64_t rover_tabulate_laws(const rover_laws *laws, int64_t count, const double *angle_rad, const double *ratio,
                            const double *mass_kg, double *virgin, double *rut, double *margin, double *sine);

/* Parts of these, for fitting. */
void rover_axle_shares(const rover_body *body, double angle_rad, double mass_kg, double *front, double *rear);
void rover_traction(const rover_curve *curve, int64_t count, const double *slip, const double *load_kg, double lowest,
                    double highest, double *phi);
void rover_mean_shear(int64_t count, const double *deformation, double *mean);
void rover_scaled_features(int64_t count, const double *angle_rad, const double *mass_kg, const double *ratio,
                           double reference_mass_kg, double *scaled);
void rover_stall_gate(const rover_gate *law, int64_t count, const double *scaled, const double *margin, double *gate);
void rover_start_features(int64_t count, const double *angle_rad, const double *log_mass_scaled, double *features);
void rover_start_shape(const double *inverse_lengths, int64_t ones, const double *one, int64_t twos, const double *two,
                       double *shape);

#endif
