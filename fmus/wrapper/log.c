/* See log.h. */
#include "log.h"
#include "python.h"

#include <stdlib.h>
#include <string.h>

static const char *const CATEGORIES[] = {"logStatusError", "logStatusWarning", "invalidInput"};
enum { CATEGORIES_COUNT = sizeof CATEGORIES / sizeof *CATEGORIES, ALL_CATEGORIES = (1 << CATEGORIES_COUNT) - 1 };

void open_log(Log *log, int enabled) { log->enabled = enabled ? ALL_CATEGORIES : 0; }

/* The bit of a category; 0 if it is unknown. */
static unsigned bit_of(const char *category) {
    for (unsigned place = 0; place < CATEGORIES_COUNT; place++) {
        if (strcmp(category, CATEGORIES[place]) == 0) return 1U << place;
    }
    return 0;
}

/* Reasons of failures are told even to a host of FMI 2 that asked for no log: without them it would have a number only.
 * One that has chosen its categories gets those. */
static int wanted(const Log *log, Status status, const char *category) {
    if (log->logger == NULL) return 0;
    return (log->enabled & bit_of(category)) != 0 || (status >= DISCARD && !log->chosen);
}

/* The text as FMI has it: a number sign is the mark of a value reference unless it is doubled. And in FMI 2 a message
 * is a printf format; with "%s" hosts whose logger cannot take arguments, those written in Python, would see just that.
 * To be freed. */
static char *escaped(const Log *log, const char *text) {
    char *copy = malloc(2 * strlen(text) + 1), *to = copy;
    if (copy == NULL) return NULL;
    for (const char *from = text; *from != '\0'; from++) {
        if (*from == '#' || (*from == '%' && log->printf_format)) *to++ = *from;
        *to++ = *from;
    }
    *to = '\0';
    return copy;
}

static void pass_on(const Log *log, Status status, const char *category, const char *text) {
    char *message = wanted(log, status, category) ? escaped(log, text) : NULL;
    if (message != NULL) log->write(log, status, category, message);
    free(message);
}

Status choose_categories(Log *log, int enabled, size_t count, const char *const *categories) {
    unsigned bits = count == 0 ? ALL_CATEGORIES : 0;
    if (count > 0 && categories == NULL) return refuse(log, "the log categories are NULL, and their number is not 0");
    for (size_t place = 0; place < count; place++) {
        unsigned bit = categories[place] == NULL ? 0 : bit_of(categories[place]);
        if (bit == 0) {
            return refuse(log,
                          "a log category is unknown; there are logStatusError, logStatusWarning and invalidInput");
        }
        bits |= bit;
    }
    log->enabled = enabled ? log->enabled | bits : log->enabled & ~bits;
    log->chosen = 1;
    return OK;
}

Status refuse(const Log *log, const char *text) {
    pass_on(log, ERROR, "logStatusError", text);
    return ERROR;
}

void tell(const Log *log, Status status, const char *category, const char *text) {
    void *thread = python.PyEval_SaveThread();
    pass_on(log, status, category, text);
    python.PyEval_RestoreThread(thread);
}

static void clear_exception(void) {
    PyObject *type = NULL, *value = NULL, *trace = NULL;
    python.PyErr_Fetch(&type, &value, &trace);
    python.Py_DecRef(type);
    python.Py_DecRef(value);
    python.Py_DecRef(trace);
}

Status tell_exception(const Log *log) {
    PyObject *type = NULL, *value = NULL, *trace = NULL;
    python.PyErr_Fetch(&type, &value, &trace);
    python.PyErr_NormalizeException(&type, &value, &trace);
    PyObject *text = value == NULL ? NULL : python.PyObject_Str(value);
    const char *words = text == NULL ? NULL : python.PyUnicode_AsUTF8AndSize(text, NULL);
    clear_exception(); /* whatever went wrong while the first exception was read */
    tell(log, ERROR, "logStatusError", words == NULL || *words == '\0' ? "an exception that says nothing" : words);
    python.Py_DecRef(text);
    python.Py_DecRef(type);
    python.Py_DecRef(value);
    python.Py_DecRef(trace);
    return ERROR;
}
