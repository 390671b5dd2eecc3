/* How a scenario resembles the training runs: features, and what the Gaussian processes make of them. */
#ifndef ROVER_SCENARIO_H
#define ROVER_SCENARIO_H

#include "engine.h"
#include "laws.h"

/* One scenario as the processes see it: held features (3), stall gate, and exp(-distance^2/2) to each run for each of
 * the model's shapes, (shape, run). */
typedef struct {
    double scaled[3], gate;
    double *near;
} rover_likeness;

/* One process at one scenario: a constant, a rut part, and weights of the runs' tables. */
typedef struct {
    double constant, rut;
    double *travel; /* (run,) */
    double *time;   /* (2 run,): release, then stall */
} rover_weights;

/* The mass for the laws of traction and resistance: these reach further than the features do. */
double rover_held_mass(const rover_model *model, double mass_kg);
/* The scenario's features, held to the training ranges, and what follows from them. */
void rover_resemble(const rover_model *model, double angle_rad, double mass_kg, double ratio, double margin,
                    rover_likeness *like);
/* kernels.scenario_kernels between the scenario and all runs, with the runs' sums where these are numbers. */
void rover_weigh(const rover_model *model, const rover_process *process, const rover_likeness *like,
                 rover_weights *weights);
/* Speed (m/s) and height (m) at release. */
void rover_start(const rover_model *model, const rover_likeness *like, double *speed_m_s, double *height_m);

#endif
