/* The law of a version, as `resources/law.bin` has it (service/fmu/law_file.py writes it). */
#ifndef ROVER_LAW_FILE_H
#define ROVER_LAW_FILE_H

#include <stddef.h>

#include "engine.h"

#define FMU_LAW_FILE "law.bin"
#define FMU_LAW_FORMAT 1
#define FMU_TOKEN_BYTES 64

typedef struct {
    rover_law law;
    rover_release release;
    char token[FMU_TOKEN_BYTES + 1]; /* tells versions apart; modelDescription.xml has the same one */
    void *content;                   /* what the law's addresses lie in */
} fmu_law;

/* Takes over the content, and gives it back in fmu_law_end. NULL, or what is wrong with it. */
const char *fmu_law_begin(fmu_law *to, void *content, size_t bytes);
void fmu_law_end(fmu_law *law);

/* CRC-32 as zip archives have it */
uint32_t fmu_checksum(const void *content, size_t bytes);

#endif
