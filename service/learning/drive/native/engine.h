/* Motion of a rover along a track in compiled form: what service/learning/drive/library.py calls.
 *
 * No globals: what changes is the state that the caller hands over, everything else is read only. SI units and
 * radians. Sizes and pointers are the caller's promise (engine.py keeps it); every number may be anything, infinite or
 * NaN included, without a read or write out of bounds, and finite numbers give finite answers. The structs are mirrored
 * field by field in library.py: whoever changes one changes both, and ROVER_INTERFACE. A change of rover_state or of
 * what a state means changes ROVER_STATE_FORMAT too.
 *
 * Time is cut into cells, which are anchored at the last event: start or change of torque or brake. Within a cell the
 * equation of motion is linear in the speed (law.c), so position and speed at any time inside are known in closed form,
 * and a state holds the start of the present cell and the time within it. Inputs that change inside a cell end it
 * there. Therefore the same inputs give the same motion however it is cut into calls and times asked for. */
#ifndef ROVER_ENGINE_H
#define ROVER_ENGINE_H

#include <stdint.h>

#define ROVER_INTERFACE 5
#define ROVER_STATE_FORMAT 1
#define ROVER_RUT_CELLS 64
#define ROVER_HEIGHTS 37
#define ROVER_MOST_S 1e6 /* what goes on for longer ends there */

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

/* The law's numbers, all of them fitted; what they do is in law.c. Resistances, friction and adhesions are fractions of
 * the weight. */
typedef struct {
    /* traction: front axle, rear axle on virgin soil, rear axle in the ruts */
    double front_adhesion, front_plateau, front_slip_scale, front_load_exponent, front_linear;
    double rear_adhesion, rear_plateau, rear_slip_scale, rear_load_exponent, rear_linear;
    double rut_adhesion, rut_plateau, rut_slip_scale, rut_load_exponent, rut_slip_shift;
    double compaction, compaction_exponent, compaction_bend, compaction_adhesion;
    double share_shift, height_rise_m, rut_begin_m, rut_end_m, front_in_rut;
    double shear_lack, shear_slip_m;
    double backing_relief, backing_length_m;
    /* resistance */
    double resistance, rut_resistance, compaction_resistance, front_rut_resistance, speed_resistance, mass_exponent;
    double dig_length_m, dig[4];
    double near, near_length_m, far, far_length_m;
    double early[28], along[21]; /* seven numbers for each knot of the way since standstill, and of the position */
    double back[7];              /* the same for a rover that goes back */
    double turning_speed_m_s, free_resistance, free_rut_relief, free_ratio;
    double back_resistance, back_rut_relief, back_spin_relief, back_spin_m_s, back_hold_relief, back_hold_length_m;
    double gate_speed_m_s, gate_width_m_s;
    double slip_lag_m;
    double brake_friction, brake_speed_m_s;
} rover_parameters;

/* exp(-|scaled features - centre|^2), features times `scale`; centres are (3, count), count a multiple of 8 */
typedef struct {
    int64_t count;
    double scale[3];
    const double *centres;
} rover_basis;

/* A whole law. `weights` are those of the moving rover's resistance (motion.count), what ruts add (motion.count), and
 * those of the stuck rover's (stall.count). */
typedef struct {
    int64_t vector_bits; /* rover_vector_bits(), or less */
    double number;       /* tells laws apart: states belong to one */
    double gravity_m_s2, wheel_radius_m, wheelbase_m, centre_ahead_m, centre_height_m, rim_speed_m_s;
    double reach[6]; /* lowest and highest of each scaled feature; beyond, what was learned stays as at the edge */
    rover_basis motion, stall;
    const double *parameters; /* rover_parameters */
    const double *weights;
    const double *heights; /* what the rear wheel centre's height is made of, ROVER_HEIGHTS numbers */
} rover_law;

/* Everything the future depends on, besides what the caller gives. Positions are of the rear wheel, along the track. */
typedef struct {
    double format, law, mass_kg;
    double time_s;                                    /* since the start */
    /* at the start of the present cell */
    double x_m, speed_m_s;
    double event_s;                                   /* time since the last event */
    double slip_path_m, path_m;                       /* wheels' and rover's way since the last standstill */
    double dig;                                       /* how deep slipping has dug, 0 for not at all */
    double furthest_m, lowest_m;                      /* of all positions */
    double front_slip, frontier_m;                    /* lagged slip; where the front wheel has been, -1e9: nowhere */
    double front_rim_m_s, rear_rim_m_s;               /* rim speeds; where the search for them begins */
    double cut_s;                                     /* after so long the last cell was cut by a new slope, or 0 */
    /* the present cell: dv/dt = acceleration - rate (v - speed) */
    double cell_s, within_s;                          /* its length, 0 for none; the time gone by in it */
    double slope_rad, torque_nm, brake, offset;       /* its inputs */
    double acceleration_m_s2, rate_per_s;
    double front_rad_s, rear_rad_s;                   /* wheel speeds, at the cell's start */
    double front_by_speed, rear_by_speed;             /* how they change with the rover's, rad/m */
    double height_known, height_m, next_height_m;     /* 1 once there is one; at the cell's start and end */
    double ruts[ROVER_RUT_CELLS];                     /* front slip of ground cells, by their number modulo 64 */
} rover_state;

/* Slope over the distance of the rover's middle from where the rear wheel started: linear between knots, constant beyond
 * them. */
typedef struct {
    int64_t count;
    const double *distance_m, *slope_rad;
} rover_track;

/* From `time_s` on, the first from the beginning; brake is 0 or 1. Times rise. */
typedef struct {
    int64_t count;
    const double *time_s, *torque_nm, *brake;
} rover_controls;

/* One drive of many. The state stays as it is. */
typedef struct {
    const rover_state *start;
    const rover_track *track;
    const rover_controls *controls;
    double offset;
} rover_route;

/* One run of a fit. At each `force_every`-th time after the first (none if 0) the state takes the position and speed
 * observed there. */
typedef struct {
    double mass_kg, start_speed_m_s;
    rover_track track;
    rover_controls controls;
    int64_t times;
    const double *time_s;
    int64_t force_every;
    const double *observed_x_m, *observed_speed_m_s;
} rover_run;

/* The speed of a parked rover when its wheels are released: bumps over the slope (deg) and ln(mass / 550 kg), whose
 * weights go by slope, then mass. Slope and mass are held within what runs have shown. */
typedef struct {
    int64_t slopes, masses;
    double slope_length_deg, mass_length, slope_rad[2], mass_kg[2];
    const double *slope_deg, *log_mass, *weights;
} rover_release;

/* What the whole way of each scenario comes to, told by ROVER_WHOLE_PARTS even parts of its horizon: x where the last
 * quarter begins and at the end, height there, the path's length, mean speed of all wheels (rad/s), and x at up to two
 * looks; (ROVER_WHOLE, scenario). Height and path are 0 under a law without heights. */
enum {
    ROVER_WHOLE_LATE, ROVER_WHOLE_END, ROVER_WHOLE_HEIGHT, ROVER_WHOLE_PATH, ROVER_WHOLE_WHEELS, ROVER_WHOLE_SEEN,
    ROVER_WHOLE = ROVER_WHOLE_SEEN + 2
};
#define ROVER_WHOLE_PARTS 400
typedef struct {
    const double *horizon_s; /* of each scenario */
    int64_t looks;
    double look_s[2];
    double *numbers;
} rover_wholes;

/* When one scenario is looked at: all times, rising, and which of them are shown, which the whole way is told by (evenly
 * spaced, from 0 to the horizon; `late` is the number of the one where the last part begins) and which are looks. */
typedef struct {
    int64_t times;
    const double *time_s;
    int64_t shown;
    const int64_t *shown_places;
    int64_t own;
    const int64_t *own_places;
    int64_t late;
    int64_t looks;
    const int64_t *look_places;
} rover_timetable;

int64_t rover_interface(void);
int64_t rover_state_format(void);
/* The bytes of a type above, by its name; 0 if there is none of that name. Of every one library.py has a mirror. */
int64_t rover_bytes(const char *name);
/* How wide this machine's vectors are, as far as is made use of: 128, 256 or 512. Slow in virtual machines: to be asked
 * once. */
int64_t rover_vector_bits(void);

/* Rows of what is said of a moment: ROVER_OUTPUTS numbers by time or rover */
enum { ROVER_X, ROVER_SPEED, ROVER_FRONT, ROVER_REAR, ROVER_HEIGHT, ROVER_SLOPE, ROVER_OUTPUTS };

/* Speeds (m/s, positive uphill) at slopes and masses. */
void rover_release_speeds(const rover_release *release, int64_t count, const double *slope_rad, const double *mass_kg,
                          double *speed_m_s);
/* A rover that begins to move, at 0. */
void rover_start(const rover_law *law, double mass_kg, double start_speed_m_s, rover_state *state);
/* What there is to say of states, (ROVER_OUTPUTS, count). */
void rover_present(int64_t count, const rover_state *states, double *outputs);

/* Drives along a track under controls, both from now on as far as time goes: position, speed, wheel speeds (rad/s),
 * height and slope (ROVER_OUTPUTS, times) at times that rise, from 0; the state is then that at the last time. `offset` is added
 * to the resistance. */
void rover_drive(const rover_law *law, rover_state *state, const rover_track *track, const rover_controls *controls,
                 double offset, int64_t times, const double *time_s, double *outputs);

/* Many drives at the same times, each with the bits of `rover_drive`: (columns, route, times), all ROVER_OUTPUTS of them, or
 * x alone if `columns` is 1. Those that follow each other go side by side if they begin, and change and brake at the same
 * times. */
void rover_drives(const rover_law *law, int64_t count, const rover_route *routes, int64_t times, const double *time_s,
                  int64_t columns, double *outputs);

/* Scenarios of constant slope (rad), mass, torque and start speed, (5, scenario), the last row an offset: outputs
 * (5, scenario, time), without slope. `stride` is the distance between the scenarios' rows of times: `times`, or 0 where
 * all share one row. */
void rover_constant(const rover_law *law, int64_t count, const double *scenarios, int64_t times, const double *time_s,
                    int64_t stride, double *outputs);

/* The same side by side, sooner and to the bit, of those scenarios that `order` numbers, `some` of all `count`: alike ones
 * are to stand beside each other there. Outputs are (columns, scenario, time): 5, x and height if that is 2, x alone
 * if it is 1. `wholes` may be NULL. Threads may share a call's scenarios. */
void rover_side_by_side(const rover_law *law, int64_t some, const int64_t *order, int64_t count, const double *scenarios,
                        int64_t times, const double *time_s, int64_t stride, int64_t columns, double *outputs,
                        const rover_wholes *wholes);

/* What the way of one scenario comes to: x (m) at its start, where its last part begins and at its end, height there,
 * length of the path (m), mean wheel speed (rad/s), x at the first two looks; 1 if all that is shown is finite, else 0. */
enum {
    ROVER_START_X, ROVER_LATE_X, ROVER_END_X, ROVER_END_HEIGHT, ROVER_PATH, ROVER_WHEELS, ROVER_SEEN, ROVER_SEEN_LATER,
    ROVER_FINITE, ROVER_ACCOUNT
};

/* One scenario from rest, as `rover_constant` has it with the start speed of `rover_release_speeds`, and the account.
 * Outputs are (columns, times), of each row what is shown first: x and height, and if `columns` is 5 speed, front and
 * rear. */
void rover_scenario(const rover_law *law, const rover_release *release, const rover_timetable *table, double slope_rad,
                    double mass_kg, double torque_nm, int64_t columns, double *outputs, double *account);

/* The `wanted` places nearest to (x, y, z), nearest first, of equals the first one: number and squared distance of each
 * in `found`. `places` are `count` of them, all x, all y, all z. */
void rover_nearest(int64_t count, const double *places, double x, double y, double z, int64_t wanted, double *found);

/* Advances rovers, each by its own duration: inputs are slope (rad; not looked at where there is a track), torque,
 * brake and duration, (4, count). Outputs are (ROVER_OUTPUTS, count). */
void rover_step(const rover_law *law, int64_t count, rover_state *states, const double *inputs,
                const rover_track *track, double *outputs);

/* rover_step without a track, to the bit: sooner, as rovers that follow each other and whose cells of time are the same
 * go side by side. */
void rover_step_fleet(const rover_law *law, int64_t count, rover_state *states, const double *inputs, double *outputs);

/* Runs with each row of numbers (parameters, then weights; `width` of them): x, speed, front and rear wheel speed,
 * (4, row, stride), those of a run from its place in `offsets` on. */
void rover_sweep(const rover_law *law, int64_t rows, int64_t width, const double *numbers, int64_t runs,
                 const rover_run *run, const int64_t *offsets, int64_t stride, double *outputs);

#endif
