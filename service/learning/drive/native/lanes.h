/* Scenarios of constant inputs side by side. */
#ifndef ROVER_LANES_H
#define ROVER_LANES_H

#include "law.h"

enum { ROVER_MOST_LANES = 16, TILE = 8 }; /* TILE: times that are written at once */

/* Some scenarios of a call, as rover_constant has them. */
typedef struct {
    const rover_law *law;
    int lanes;                        /* how many of them are asked for; the rest repeats the first */
    int64_t row[ROVER_MOST_LANES];    /* which ones */
    int64_t count;                    /* of scenarios in the call */
    const double *scenarios;
    int64_t times, stride;
    const double *time_s;
    const rover_wholes *wholes;       /* NULL where none are asked for */
    double *columns[5];               /* x, speed, front and rear wheel speed, height; NULL for what is not asked for */
} rover_lanes;

/* What rovers must share to be moved side by side: the cell they are in (0 for none), the time gone by in it and since
 * the last event, and how long they go on. */
typedef struct {
    double cell_s, within_s, event_s, duration_s;
} rover_pace;

/* Some rovers of a call of rover_step_fleet, one after the other there */
typedef struct {
    const rover_law *law;
    int lanes;                        /* how many; the rest repeats the first */
    rover_pace pace;
    int64_t count;                    /* of rovers in the call: the distance between rows of inputs */
    rover_state *states;              /* of the first */
    const double *inputs;
} rover_steps_asked;

/* Some routes of a call of rover_drives, one after the other there, and where what is said of them goes */
typedef struct {
    const rover_route *routes;        /* of the first lane */
    rover_lanes to;
} rover_routes_asked;

#endif
