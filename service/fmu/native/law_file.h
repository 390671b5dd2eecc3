/* The law of a version, as `resources/law.bin` has it (service/fmu/law_file.py writes it). */
#ifndef ROVER_LAW_FILE_H
#define ROVER_LAW_FILE_H

#include <stddef.h>

#include "engine.h"

#define FMU_LAW_FILE "law.bin"
#define FMU_LAW_FORMAT 1
#define FMU_TOKEN_BYTES 64

/* How fast a parked rover creeps when its wheels are released: bumps over the slope (deg) and ln(mass / 550 kg). */
typedef struct {
    int64_t slopes, masses;
    double slope_length_deg, mass_length, slope_rad[2], mass_kg[2];
    const double *slope_deg, *log_mass, *weights;
} fmu_release_speeds;

typedef struct {
    rover_law law;
    fmu_release_speeds release;
    char token[FMU_TOKEN_BYTES + 1]; /* tells versions apart; modelDescription.xml has the same one */
    void *content;                   /* what the law's addresses lie in */
} fmu_law;

/* Takes over the content, and gives it back in fmu_law_end. NULL, or what is wrong with it. */
const char *fmu_law_begin(fmu_law *to, void *content, size_t bytes);
void fmu_law_end(fmu_law *law);
/* m/s, positive uphill */
double fmu_release_speed(const fmu_law *law, double slope_rad, double mass_kg);

/* CRC-32 as zip archives have it */
uint32_t fmu_checksum(const void *content, size_t bytes);

#endif
