/* What an instance says to its host, in the categories that the model description declares. */
#ifndef COSIM_WRAPPER_LOG_H
#define COSIM_WRAPPER_LOG_H

#include <stddef.h>

/* A status, with the numbers that both versions of FMI give it. */
typedef enum { OK, WARNING, DISCARD, ERROR } Status;

typedef struct Log {
    /* Calls the host's logger in the way of its version of FMI; `text` is as the standard wants it. */
    void (*write)(const struct Log *, Status, const char *category, const char *text);
    void (*logger)(void); /* the host's, to be cast by `write`; NULL if it has none */
    void *environment;
    const char *name;
    unsigned enabled; /* a bit for each category */
    int chosen;        /* whether the host has chosen categories */
    int printf_format; /* whether percent signs have to be doubled */
} Log;

/* The log of an instance at its beginning. */
void open_log(Log *log, int enabled);

/* {fmi2,fmi3}SetDebugLogging, without the GIL. ERROR, and nothing changed, if a category is unknown. */
Status choose_categories(Log *log, int enabled, size_t count, const char *const *categories);

/* Say that a call fails, without the GIL. Returns ERROR. */
Status refuse(const Log *log, const char *text);

/* Pass on a message if the host wants it. With the GIL, which is released meanwhile: the logger may wait for another
 * thread, and that one for Python. */
void tell(const Log *log, Status status, const char *category, const char *text);

/* Log the exception that Python has raised, and clear it; with the GIL. Returns ERROR. */
Status tell_exception(const Log *log);

#endif
