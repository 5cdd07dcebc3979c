/* See instance.h. */
#include "instance.h"
#include "resources.h"
#include "text.h"

#include <stdlib.h>
#include <string.h>

/* --- life ------------------------------------------------------------------------------------------------------- */

/* The slave that the FMU's load.py, with the content `text`, makes; NULL with Python's exception set. */
static PyObject *loaded(const char *text, const char *path, const char *resources, const char *token, int fmi) {
    PyObject *scope = python.PyDict_New();
    if (scope == NULL) return NULL;
    PyObject *slave = NULL, *code = NULL, *done = NULL;
    if (python.PyDict_SetItemString(scope, "__builtins__", python.PyEval_GetBuiltins()) == 0) {
        code = python.Py_CompileString(text, path, FILE_INPUT);
    }
    if (code != NULL) done = python.PyEval_EvalCode(code, scope, scope);
    if (done != NULL) {
        PyObject *function = python.PyDict_GetItemString(scope, "instantiate");
        slave = python.PyObject_CallFunction(function, "ssi", resources, token, fmi);
    }
    python.Py_DecRef(done);
    python.Py_DecRef(code);
    python.Py_DecRef(scope);
    return slave;
}

static void forget_texts(Instance *own) {
    for (size_t place = 0; place < own->texts_count; place++) free(own->texts[place]);
    free(own->texts);
    own->texts = NULL;
    own->texts_count = 0;
}

/* The slave for an FMU in the folder `resources`; NULL, with the reason in the log, if there is none. */
static PyObject *new_slave(const Log *log, const char *resources, const char *token, int fmi) {
    char why[MESSAGE_SIZE];
    char *path = path_in(resources, "load.py");
    char *text = path == NULL ? NULL : content_of(path);
    PyObject *slave = NULL;
    if (text == NULL) {
        compose(why, sizeof why, "there is no file load.py in the resources of the FMU, ", resources, NULL);
        refuse(log, why);
    } else if (start_python(why, sizeof why) != 0) {
        refuse(log, why);
    } else {
        int thread = python.PyGILState_Ensure();
        slave = loaded(text, path, resources, token, fmi);
        if (slave == NULL) tell_exception(log);
        python.PyGILState_Release(thread);
    }
    free(text);
    free(path);
    return slave;
}

void *instantiate(size_t size, const Log *log, const char *location, const char *token, int fmi) {
    const char *wrong = NULL;
    if (log->name == NULL || *log->name == '\0') wrong = "an instance needs a name";
    if (token == NULL) wrong = "an instance needs the GUID or instantiation token of the model description";
    if (location == NULL) wrong = "this FMU needs the location of its resources";
    char *resources = wrong == NULL ? path_of(location) : NULL;
    if (wrong == NULL && resources == NULL) wrong = "the location of the resources is no file: URI";
    char *name = wrong == NULL ? copy_of(log->name) : NULL;
    Instance *own = wrong == NULL ? calloc(1, size) : NULL;
    if (wrong == NULL && (own == NULL || name == NULL)) wrong = "there is no memory for an instance";
    if (wrong != NULL) {
        refuse(log, wrong);
    } else {
        own->slave = new_slave(log, resources, token, fmi);
    }
    free(resources);
    if (own == NULL || name == NULL || own->slave == NULL) {
        free(name);
        free(own);
        return NULL;
    }
    own->log = *log;
    own->log.name = name;
    return own;
}

void free_instance(Instance *own) {
    int thread = python.PyGILState_Ensure();
    python.Py_DecRef(own->slave);
    python.PyGILState_Release(thread);
    forget_texts(own);
    free((char *)own->log.name);
    free(own);
}

/* --- what is checked here --------------------------------------------------------------------------------------- */

int ready(Instance *own) {
    if (own == NULL) return 0;
    if (!own->updating) return 1;
    refuse(&own->log, "while intermediate values are asked for, only fmi3SetFloat64 is allowed");
    return 0;
}

int there(Instance *own, const void *items, size_t count, size_t size, const char *what) {
    char why[256];
    if (items != NULL ? count <= PTRDIFF_MAX / size : count == 0) return 1;
    compose(why, sizeof why, "the array of ", what, items == NULL ? " is NULL" : " cannot be as long as was said",
            NULL);
    refuse(&own->log, why);
    return 0;
}

Status unable(Instance *own, const char *why) { return own == NULL ? ERROR : refuse(&own->log, why); }

/* --- answers ---------------------------------------------------------------------------------------------------- */

/* Item `place` of a tuple as a text, valid as long as the tuple; NULL with Python's exception set. */
static const char *text_at(PyObject *tuple, Py_ssize_t place) {
    PyObject *item = python.PyTuple_GetItem(tuple, place);
    return item == NULL ? NULL : python.PyUnicode_AsUTF8AndSize(item, NULL);
}

/* Item `place` of a tuple as a status; -1 with Python's exception set. */
static long status_at(PyObject *tuple, Py_ssize_t place) {
    PyObject *item = python.PyTuple_GetItem(tuple, place);
    return item == NULL ? -1 : python.PyLong_AsLong(item);
}

/* Log a list of messages; -1 with Python's exception set if it is none. */
static int tell_all(const Log *log, PyObject *messages) {
    Py_ssize_t count = messages == NULL ? -1 : python.PyList_Size(messages);
    for (Py_ssize_t place = 0; place < count; place++) {
        PyObject *message = python.PyList_GetItem(messages, place);
        long status = message == NULL ? -1 : status_at(message, 0);
        const char *category = status < OK ? NULL : text_at(message, 1);
        const char *text = category == NULL ? NULL : text_at(message, 2);
        if (text == NULL) return -1;
        tell(log, (Status)status, category, text);
    }
    return count < 0 ? -1 : 0;
}

Status answered(Instance *own, PyObject *answer, PyObject **value) {
    if (value != NULL) *value = NULL;
    long status = answer == NULL ? -1 : status_at(answer, 0);
    PyObject *second = status < OK ? NULL : python.PyTuple_GetItem(answer, 1);
    int failed = second == NULL || tell_all(&own->log, python.PyTuple_GetItem(answer, 2)) != 0;
    if (failed) {
        python.Py_DecRef(answer);
        return tell_exception(&own->log);
    }
    if (value != NULL) {
        python.Py_IncRef(second);
        *value = second;
    }
    python.Py_DecRef(answer);
    return status > ERROR ? ERROR : (Status)status;
}

PyObject *view(const void *items, size_t count, size_t size, int access) {
    static char nothing[1];
    return python.PyMemoryView_FromMemory(count == 0 ? nothing : (char *)items, (Py_ssize_t)(count * size), access);
}

/* --- calls ------------------------------------------------------------------------------------------------------ */

static int references_there(Instance *own, const uint32_t *references, size_t count) {
    return there(own, references, count, sizeof *references, "value references");
}

Status simple(Instance *own, const char *method) {
    if (!ready(own)) return ERROR;
    WITH_PYTHON(status, CALL(own, NULL, method, "()"));
    return status;
}

Status numbers(Instance *own, const char *method, const char *type, const uint32_t *references, size_t count,
               const void *values, size_t values_count, size_t size, int access) {
    if (!references_there(own, references, count) || !there(own, values, values_count, size, "values")) return ERROR;
    WITH_PYTHON(status, CALL(own, NULL, method, "(sNN)", type, view(references, count, sizeof *references, VIEW_READ),
                             view(values, values_count, size, access)));
    return status;
}

Status derivatives(Instance *own, const char *method, const uint32_t *unknowns, size_t unknowns_count,
                   const uint32_t *knowns, size_t knowns_count, const double *seed, size_t seed_count,
                   double *sensitivity, size_t sensitivity_count) {
    if (!ready(own) || !there(own, unknowns, unknowns_count, sizeof *unknowns, "unknowns") ||
        !there(own, knowns, knowns_count, sizeof *knowns, "knowns") ||
        !there(own, seed, seed_count, sizeof *seed, "seed") ||
        !there(own, sensitivity, sensitivity_count, sizeof *sensitivity, "sensitivity")) {
        return ERROR;
    }
    WITH_PYTHON(status, CALL(own, NULL, method, "(NNNN)", view(unknowns, unknowns_count, sizeof *unknowns, VIEW_READ),
                             view(knowns, knowns_count, sizeof *knowns, VIEW_READ),
                             view(seed, seed_count, sizeof *seed, VIEW_READ),
                             view(sensitivity, sensitivity_count, sizeof *sensitivity, VIEW_WRITE)));
    return status;
}

static Status read_time(Instance *own, double *time) {
    PyObject *value = NULL;
    Status status = CALL(own, &value, "reached", "()");
    double found = status <= WARNING ? python.PyFloat_AsDouble(value) : 0.0;
    if (status <= WARNING && python.PyErr_Occurred() != NULL) status = tell_exception(&own->log);
    if (status <= WARNING) *time = found;
    python.Py_DecRef(value);
    return status;
}

Status reached(Instance *own, double *time) {
    WITH_PYTHON(status, read_time(own, time));
    return status;
}

/* --- texts ------------------------------------------------------------------------------------------------------ */

/* Copy the bytes objects of a list to `values`; the copies live until the next call. */
static Status texts_to(Instance *own, PyObject *list, size_t count, const char **values) {
    forget_texts(own);
    own->texts = calloc(count == 0 ? 1 : count, sizeof *own->texts);
    own->texts_count = own->texts == NULL ? 0 : count;
    for (size_t place = 0; place < own->texts_count; place++) {
        char *bytes = NULL;
        Py_ssize_t size = 0;
        PyObject *item = python.PyList_GetItem(list, (Py_ssize_t)place);
        if (item == NULL || python.PyBytes_AsStringAndSize(item, &bytes, &size) != 0) return tell_exception(&own->log);
        own->texts[place] = malloc((size_t)size + 1);
        if (own->texts[place] == NULL) return ERROR;
        memcpy(own->texts[place], bytes, (size_t)size + 1);
        values[place] = own->texts[place];
    }
    return own->texts == NULL ? ERROR : OK;
}

static Status read_texts(Instance *own, const uint32_t *references, size_t count, const char **values,
                         size_t values_count) {
    PyObject *list = NULL;
    Status status = CALL(own, &list, "get_strings", "(N)", view(references, count, sizeof *references, VIEW_READ));
    if (status <= WARNING) {
        Py_ssize_t found = python.PyList_Size(list);
        Status copied = ERROR;
        if (found < 0) {
            copied = tell_exception(&own->log);
        } else if ((size_t)found != values_count) {
            tell(&own->log, ERROR, "invalidInput", "the variables have another number of values than was asked for");
        } else {
            copied = texts_to(own, list, values_count, values);
        }
        status = copied == OK ? status : copied;
    }
    python.Py_DecRef(list);
    return status;
}

Status get_texts(Instance *own, const uint32_t *references, size_t count, const char **values, size_t values_count) {
    if (!ready(own) || !references_there(own, references, count)) return ERROR;
    if (!there(own, values, values_count, sizeof *values, "values")) return ERROR;
    WITH_PYTHON(status, read_texts(own, references, count, values, values_count));
    return status;
}

/* A list of the texts; NULL with Python's exception set if one is no UTF-8. */
static PyObject *list_of(const char *const *values, size_t count) {
    PyObject *list = python.PyList_New(0);
    for (size_t place = 0; list != NULL && place < count; place++) {
        PyObject *text = python.PyUnicode_DecodeUTF8(values[place], (Py_ssize_t)strlen(values[place]), NULL);
        if (text == NULL || python.PyList_Append(list, text) != 0) {
            python.Py_DecRef(list);
            list = NULL;
        }
        python.Py_DecRef(text);
    }
    return list;
}

static Status write_texts(Instance *own, const uint32_t *references, size_t count, const char *const *values,
                          size_t values_count) {
    PyObject *list = list_of(values, values_count);
    if (list == NULL) return tell_exception(&own->log);
    return CALL(own, NULL, "set_strings", "(NN)", view(references, count, sizeof *references, VIEW_READ), list);
}

Status set_texts(Instance *own, const uint32_t *references, size_t count, const char *const *values,
                 size_t values_count) {
    if (!ready(own) || !references_there(own, references, count)) return ERROR;
    if (!there(own, values, values_count, sizeof *values, "values")) return ERROR;
    for (size_t place = 0; place < values_count; place++) {
        if (values[place] == NULL) return refuse(&own->log, "a text to be set is NULL; an empty one is \"\"");
    }
    WITH_PYTHON(status, write_texts(own, references, count, values, values_count));
    return status;
}
