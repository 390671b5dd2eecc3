/* What leaves the library: nothing but the functions of the standard. */
#ifndef ROVER_EXPORT_H
#define ROVER_EXPORT_H

#if defined(_WIN32)
#define FMU_EXPORT __declspec(dllexport)
#else
#define FMU_EXPORT __attribute__((visibility("default")))
#endif

#endif
