/* What law_text.h works with, for one rover or for several side by side. */

/* What only slope, torque and mass decide, numbers alone; place.c makes it. */
typedef struct {
    NUMBER sine, front_share, rear_share;
    NUMBER torque, share;              /* of both motors of an axle, over weight and radius; how much resists that drives */
    NUMBER mass_scale, front_slip_scale, rear_slip_scale, rut_slip_scale, compaction;
    NUMBER early[4], along[3];         /* at their knots */
    NUMBER back;                       /* what the scenario adds where the rover goes back */
    NUMBER digging;                    /* what digging does to the resistance */
    NUMBER motion, rut;                /* what the basis makes of it */
    NUMBER stall;                      /* once it was needed */
    NUMBER height[10];                 /* what the height's parts are multiplied with */
} NAME(ground);

/* Where a state is at a time in its cell, and how deep it has dug */
typedef struct {
    NUMBER x_m, speed_m_s, path_m, slip_path_m, dig;
} NAME(rolled);
