/* The slope under a rover on its track, and what its motors are told. */
#ifndef ROVER_TRACK_H
#define ROVER_TRACK_H

#include "engine.h"

/* Slope at a distance. Searching begins at the interval found last, which a rover seldom leaves far behind. */
static inline double rover_slope_at(const rover_track *track, int64_t *interval, double distance_m)
{
    int64_t last = track->count - 1, at = *interval;
    if (!(distance_m > track->distance_m[0]))
        return track->slope_rad[0];
    if (distance_m >= track->distance_m[last])
        return track->slope_rad[last];
    while (at < last - 1 && distance_m >= track->distance_m[at + 1])
        at++;
    while (at > 0 && distance_m < track->distance_m[at])
        at--;
    *interval = at;
    double width = track->distance_m[at + 1] - track->distance_m[at];
    double part = width > 0.0 ? (distance_m - track->distance_m[at]) / width : 1.0;
    return track->slope_rad[at] + part * (track->slope_rad[at + 1] - track->slope_rad[at]);
}

/* The slope that acts at each of some places of one rover, whose middle is `ahead_m` beyond them */
static inline void rover_slopes_at(const rover_track *track, int64_t *interval, double ahead_m, int64_t count,
                                   const double *x_m, double *slope_rad)
{
    for (int64_t i = 0; i < count; i++)
        slope_rad[i] = rover_slope_at(track, interval, x_m[i] + ahead_m);
}

/* The torque (N m) under a control: none where it brakes */
static inline double rover_told(const rover_controls *controls, int64_t control)
{
    return controls->brake[control] != 0.0 ? 0.0 : controls->torque_nm[control];
}

/* Whether nothing changes from one control to another */
static inline int rover_told_same(const rover_controls *controls, int64_t before, int64_t control)
{
    return rover_told(controls, before) == rover_told(controls, control)
        && (controls->brake[before] != 0.0) == (controls->brake[control] != 0.0);
}

#endif
