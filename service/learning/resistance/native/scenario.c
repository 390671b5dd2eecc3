#include "scenario.h"

#include <math.h>

#include "exponential.h"

/* Middle and spread of the shipped runs, so that lengths of one are of one kind: tan(slope), ln(torque ratio), ln(mass) */
static const double tangent_middle = 0.27, tangent_spread = 0.19;
static const double torque_middle = 0.32, torque_spread = 0.55;
static const double mass_spread = 0.33;
static const double least_ratio = 1e-9;
static const double degrees = 57.295779513082320877;

ROVER_INLINE double held(double value, double lowest, double highest)
{
    value = value > lowest ? value : lowest; /* NaN becomes the lowest */
    return value < highest ? value : highest;
}

/* ((tan th - 0.27)/0.19, ln(q/0.32)/0.55, ln(m/m_ref)/0.33) */
static void scaled_features(double angle_rad, double mass_kg, double ratio, double reference_mass_kg, double *scaled)
{
    ratio = ratio > least_ratio ? ratio : least_ratio;
    scaled[0] = (tan(angle_rad) - tangent_middle) / tangent_spread;
    scaled[1] = log(ratio / torque_middle) / torque_spread;
    scaled[2] = log(mass_kg / reference_mass_kg) / mass_spread;
}

void rover_scaled_features(int64_t count, const double *angle_rad, const double *mass_kg, const double *ratio,
                           double reference_mass_kg, double *scaled)
{
    for (int64_t i = 0; i < count; i++)
        scaled_features(angle_rad[i], mass_kg[i], ratio[i], reference_mass_kg, scaled + 3 * i);
}

/* How near to stalling: a sigmoid of the drive margin, 0..1 */
static double stall_gate(const rover_gate *law, const double *scaled, double margin)
{
    double threshold = law->margin + law->torque * torque_spread * scaled[1];
    threshold += law->mass * mass_spread * scaled[2];
    return 1.0 / (1.0 + rover_exp((margin - threshold) / law->width));
}

void rover_stall_gate(const rover_gate *law, int64_t count, const double *scaled, const double *margin, double *gate)
{
    for (int64_t i = 0; i < count; i++)
        gate[i] = stall_gate(law, scaled + 3 * i, margin[i]);
}

/* (slope - 15 deg)/10 deg and the scaled log mass */
static void start_features(double angle_rad, double log_mass_scaled, double *features)
{
    features[0] = (angle_rad * degrees - 15.0) / 10.0;
    features[1] = log_mass_scaled;
}

void rover_start_features(int64_t count, const double *angle_rad, const double *log_mass_scaled, double *features)
{
    for (int64_t i = 0; i < count; i++)
        start_features(angle_rad[i], log_mass_scaled[i], features + 2 * i);
}

/* A Matern kernel of order 5/2 (Rasmussen and Williams, Gaussian Processes for Machine Learning, eq. 4.17), and a
 * linear one; differences along the two features, divided by lengths below */
ROVER_INLINE double start_shape(const double *inverse_lengths, const double *one, double slope, double mass)
{
    double along = (one[0] - slope) * inverse_lengths[0], across = (one[1] - mass) * inverse_lengths[1];
    double scaled = sqrt(5.0 * (along * along + across * across));
    double matern = (1.0 + scaled * (1.0 + scaled / 3.0)) * rover_exp(-scaled);
    return matern + 1.0 + (one[0] * slope + one[1] * mass);
}

void rover_start_shape(const double *inverse_lengths, int64_t ones, const double *one, int64_t twos, const double *two,
                       double *shape)
{
    for (int64_t i = 0; i < ones; i++)
        for (int64_t j = 0; j < twos; j++)
            shape[i * twos + j] = start_shape(inverse_lengths, one + 2 * i, two[2 * j], two[2 * j + 1]);
}

void rover_start(const rover_model *model, const rover_likeness *like, double *speed_m_s, double *height_m)
{
    enum { AT_ONCE = 64 };
    const int64_t runs = model->run_count;
    const double *restrict slope = model->start_features, *restrict mass = slope + runs;
    const double *restrict speeds = model->start_weights, *restrict heights = speeds + runs;
    double features[2], shape[AT_ONCE], speed = model->start_mean[0], height = model->start_mean[1];
    start_features(atan(like->scaled[0] * tangent_spread + tangent_middle), like->scaled[2], features);
    for (int64_t first = 0; first < runs; first += AT_ONCE) {
        int64_t some = runs - first < AT_ONCE ? runs - first : AT_ONCE;
        for (int64_t i = 0; i < some; i++)
            shape[i] = start_shape(model->start_inverse_lengths, features, slope[first + i], mass[first + i]);
        for (int64_t i = 0; i < some; i++) {
            speed += shape[i] * speeds[first + i];
            height += shape[i] * heights[first + i];
        }
    }
    *speed_m_s = speed;
    *height_m = height;
}

double rover_held_mass(const rover_model *model, double mass_kg)
{
    double least = model->laws.reference_mass_kg * rover_exp(model->low[2] * mass_spread);
    double most = model->laws.reference_mass_kg * rover_exp(model->high[2] * mass_spread);
    return held(mass_kg, least / model->mass_reach, most * model->mass_reach);
}

/* exp(-distance^2/2) to each run, for each of the model's shapes */
ROVER_INLINE void draw_near(const rover_model *model, const rover_likeness *like)
{
    const int64_t runs = model->run_count;
    const double *restrict tangent = model->features, *restrict torque = tangent + runs, *restrict mass = torque + runs;
    for (int64_t shape = 0; shape < model->shape_count; shape++) {
        const double *per = model->half_inverse_square + 3 * shape;
        const double a = per[0], b = per[1], c = per[2], x = like->scaled[0], y = like->scaled[1], z = like->scaled[2];
        double *restrict near = like->near + shape * runs;
        for (int64_t run = 0; run < runs; run++) {
            double u = x - tangent[run], v = y - torque[run], w = z - mass[run];
            near[run] = rover_exp(-(a * (u * u) + b * (v * v) + c * (w * w)));
        }
    }
}

ROVER_VERSIONS(draw_near, (const rover_model *model, const rover_likeness *like), (model, like))

void rover_resemble(const rover_model *model, double angle_rad, double mass_kg, double ratio, double margin,
                    rover_likeness *like)
{
    scaled_features(angle_rad, mass_kg, ratio, model->laws.reference_mass_kg, like->scaled);
    for (int i = 0; i < 3; i++) {
        double least = model->low[i] - model->feature_margin, most = model->high[i] + model->feature_margin;
        like->scaled[i] = held(like->scaled[i], least, most);
    }
    like->gate = stall_gate(&model->stall_gate, like->scaled, margin);
    ROVER_CALL(model->laws.vector_bits, draw_near, (model, like));
}

/* Squared-exponential kernels; level and travel add a linear one, the near-stall parts are gated on both sides */
void rover_weigh(const rover_model *model, const rover_process *process, const rover_likeness *like,
                 rover_weights *weights)
{
    const int64_t runs = model->run_count;
    const double *restrict tangent = model->features, *restrict torque = tangent + runs, *restrict mass = torque + runs;
    const double *restrict gates = model->gate, *near[PARTS];
    const double *variance = process->variance;
    double *restrict travel = weights->travel, *restrict release = weights->time, *restrict stalling = release + runs;
    double level_scaled[3], travel_scaled[3], constant = 0.0, rut = 0.0;
    for (int part = 0; part < PARTS; part++)
        near[part] = like->near + process->shape[part] * runs;
    for (int i = 0; i < 3; i++) {
        level_scaled[i] = like->scaled[i] * process->level_inverse_square[i];
        travel_scaled[i] = like->scaled[i] * process->travel_inverse_square[i];
    }
    for (int64_t run = 0; run < runs; run++) {
        double stall = like->gate * gates[run] * near[STALL][run];
        double x = tangent[run], y = torque[run], z = mass[run];
        double level = near[LEVEL][run] + 1.0 + (level_scaled[0] * x + level_scaled[1] * y + level_scaled[2] * z);
        double along = near[TRAVEL][run] + 1.0 + (travel_scaled[0] * x + travel_scaled[1] * y + travel_scaled[2] * z);
        travel[run] = variance[TRAVEL] * along + process->stall_travel_variance * stall;
        release[run] = variance[RELEASE] * near[RELEASE][run];
        stalling[run] = variance[STALL] * stall;
        constant += (variance[LEVEL] * level + process->stall_level_variance * stall) * process->level[run];
        rut += variance[RUT] * near[RUT][run] * process->rut[run];
    }
    weights->constant = constant;
    weights->rut = rut;
}
