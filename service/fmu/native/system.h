/* All that an FMU asks of the system: memory, and one file read whole. On Windows that is kernel32 alone, so no runtime
 * library need be there. */
#ifndef ROVER_SYSTEM_H
#define ROVER_SYSTEM_H

#include <stddef.h>

void *fmu_allocate(size_t bytes); /* zeroed; NULL if there is none */
void fmu_free(void *memory);

/* A file of a folder, in memory that the caller releases; NULL if it cannot be read. The folder is UTF-8, with or
 * without a separator at its end. */
void *fmu_read(const char *folder, const char *name, size_t *bytes);

/* The path that a file URI means, in memory that the caller releases; NULL if there is none. What is no URI is taken
 * for a path. `decode` says whether %20 means a blank. */
char *fmu_path_of(const char *uri, int decode);

#endif
