/* Speed laws: what the wheels push with at each speed, tabulated where somebody asks. */
#ifndef ROVER_LAWS_H
#define ROVER_LAWS_H

#include "engine.h"

/* One axle over the slip: speeds of the rover (rising), torques and rim speeds, each of laws->slip_count nodes. */
typedef struct {
    double *speed_m_s, *torque, *rim_m_s;
    double share;
} rover_axle;

/* The law of one scenario; virgin and rut are valid in those blocks of ROVER_SPEEDS that are marked in `ready`. */
typedef struct {
    const rover_laws *laws;
    rover_axle axles[AXLES];
    double sine, margin, stuck; /* stuck: the resistance that turns around near stall, 0 where the wheels climb */
    double *virgin, *rut;
    unsigned char *ready;
} rover_law;

/* What the resistance is multiplied with at a mass */
double rover_mass_scale(const rover_laws *laws, double mass_kg);
/* So many doubles a law needs, `ready` flags included. */
int64_t rover_law_doubles(const rover_laws *laws);
/* A law in such a workspace; returns what follows it. */
double *rover_law_place(rover_law *law, const rover_laws *laws, double *workspace);
/* Sets a law up for a scenario: nothing is tabulated yet, margin and sine are known. */
void rover_law_begin(rover_law *law, double angle_rad, double ratio, double mass_kg);
/* Tabulates the block of a speed's number. */
void rover_law_tabulate(rover_law *law, int64_t number);

static inline void rover_law_need(rover_law *law, int64_t number)
{
    if (!law->ready[(uint64_t)number / ROVER_SPEEDS])
        rover_law_tabulate(law, number);
}

#endif
