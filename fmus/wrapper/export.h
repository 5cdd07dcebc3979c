/* How a function of FMI becomes visible to the host; all others are the library's own. */
#ifndef COSIM_WRAPPER_EXPORT_H
#define COSIM_WRAPPER_EXPORT_H

#ifdef _WIN32
#define COSIM_EXPORT __declspec(dllexport)
#else
#define COSIM_EXPORT __attribute__((visibility("default")))
#endif

#endif
