/* An instance of an FMU, whose slave is written in Python: what both versions of FMI do with it.
 *
 * The FMU's resources hold `load.py` with a function instantiate(resources, token, fmi) that returns the slave. Each of
 * its methods returns (status, value, messages): a Status, what was asked for, and a list of (status, category, text)
 * for the host's logger. Arrays cross as memory views on the host's own buffers, valid during the call only. A method
 * that raises all the same is an error of the slave: ERROR, with the exception in the log.
 *
 * In what order calls are allowed, and what is wrong with their values, the slave knows. Here is checked what it cannot
 * see: pointers, and calls while the host is being asked for intermediate values. */
#ifndef COSIM_WRAPPER_INSTANCE_H
#define COSIM_WRAPPER_INSTANCE_H

#include "log.h"
#include "python.h"

#include <stddef.h>
#include <stdint.h>

typedef struct {
    Log log;
    PyObject *slave;
    int updating;  /* whether the host is being asked for intermediate values */
    char **texts;  /* what get_texts gave last */
    size_t texts_count;
} Instance;

/* A new instance in `size` bytes, zero behind the Instance that they begin with. `location` is a path or a file: URI,
 * `token` the GUID or the instantiation token, `log` is copied. NULL, with the reason in the log, if there is none. */
void *instantiate(size_t size, const Log *log, const char *location, const char *token, int fmi);

/* Give back all that the instance holds, its states too. */
void free_instance(Instance *own);

/* Whether the instance can take a call now; if not, the log has the reason. */
int ready(Instance *own);

/* Whether there is an array of `count` items of `size` bytes at `items`, called `what`; if not, the log has the reason.
 */
int there(Instance *own, const void *items, size_t count, size_t size, const char *what);

/* --- with the GIL ----------------------------------------------------------------------------------------------- */

/* Take the answer of a method: its messages to the log, its status as result, its value, if wanted, as a new reference.
 */
Status answered(Instance *own, PyObject *answer, PyObject **value);

/* Call a method, with further arguments in the manner of Py_BuildValue, "()" for none. */
#define CALL(own, value, ...) answered(own, python.PyObject_CallMethod((own)->slave, __VA_ARGS__), value)

/* A memory view on an array of the host, VIEW_READ or VIEW_WRITE. To be consumed by a call: "N"; one that could not be
 * made is NULL, which makes the call fail with its exception. */
PyObject *view(const void *items, size_t count, size_t size, int access);

/* --- whole calls ------------------------------------------------------------------------------------------------ */

/* `statement` with the GIL, its result in the new variable `status`. */
#define WITH_PYTHON(status, statement)       \
    int thread = python.PyGILState_Ensure(); \
    Status status = statement;               \
    python.PyGILState_Release(thread)

/* A method without arguments and value. */
Status simple(Instance *own, const char *method);

/* A method that reads or, with VIEW_WRITE, writes numbers: method(type, references, values). */
Status numbers(Instance *own, const char *method, const char *type, const uint32_t *references, size_t count,
               const void *values, size_t values_count, size_t size, int access);

Status get_texts(Instance *own, const uint32_t *references, size_t count, const char **values, size_t values_count);

Status set_texts(Instance *own, const uint32_t *references, size_t count, const char *const *values,
                 size_t values_count);

/* A method that multiplies with partial derivatives: method(unknowns, knowns, seed, sensitivity). */
Status derivatives(Instance *own, const char *method, const uint32_t *unknowns, size_t unknowns_count,
                   const uint32_t *knowns, size_t knowns_count, const double *seed, size_t seed_count,
                   double *sensitivity, size_t sensitivity_count);

/* The time that the slave has come to, in s. */
Status reached(Instance *own, double *time);

/* A call that no unit can answer; `why` names the capability. */
Status unable(Instance *own, const char *why);

#endif
