/* FMI 2.0 co-simulation for a slave written in Python.
 *
 * The FMU's resources hold `load.py` with a function instantiate(resources, guid) that returns the slave. Each of its methods
 * returns (status, value, messages): an fmi2Status, what was asked for, and a list of (status, category, text) for the
 * host's logger. Arrays cross as memory views on the host's own buffers, valid during the call only. A method that raises
 * all the same is an error of the slave: fmi2Error, with the exception in the log. */
#include "fmi2.h"
#include "python.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    fmi2CallbackFunctions callbacks;
    char *name;
    int logging;
    PyObject *slave;
    double reached;       /* the time that the slave has come to, in s */
    PyObject *packed;     /* bytes of the state `packed_of`, between asking for their number and fetching them */
    fmi2FMUstate packed_of;
    char **texts;         /* what fmi2GetString gave last */
    size_t texts_count;
} Instance;

/* --- the log -------------------------------------------------------------------------------------------------------- */

/* A message is a printf format. With "%s" hosts whose logger cannot take arguments, those written in Python, would see just
 * that; so the text is the format, its percent signs doubled. */
static void tell(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status, const char *category,
                 const char *text) {
    char *format = callbacks->logger == NULL ? NULL : malloc(2 * strlen(text) + 1);
    if (format == NULL) return;
    char *to = format;
    for (const char *from = text; *from != '\0'; from++) {
        if (*from == '%') *to++ = '%';
        *to++ = *from;
    }
    *to = '\0';
    callbacks->logger(callbacks->componentEnvironment, name, status, category, format);
    free(format);
}

/* Log the exception that Python has raised, and clear it. */
static void tell_exception(const fmi2CallbackFunctions *callbacks, const char *name) {
    PyObject *type = NULL, *value = NULL, *trace = NULL;
    python.PyErr_Fetch(&type, &value, &trace);
    python.PyErr_NormalizeException(&type, &value, &trace);
    PyObject *text = value == NULL ? NULL : python.PyObject_Str(value);
    const char *words = text == NULL ? NULL : python.PyUnicode_AsUTF8AndSize(text, NULL);
    tell(callbacks, name, fmi2Error, "logStatusError", words == NULL ? "an exception that says nothing" : words);
    python.Py_DecRef(text);
    python.Py_DecRef(type);
    python.Py_DecRef(value);
    python.Py_DecRef(trace);
    /* Whatever went wrong while the first exception was read. */
    python.PyErr_Fetch(&type, &value, &trace);
    python.Py_DecRef(type);
    python.Py_DecRef(value);
    python.Py_DecRef(trace);
}

/* Item `place` of a tuple as a text, valid as long as the tuple. */
static const char *text_at(PyObject *tuple, Py_ssize_t place) {
    PyObject *item = python.PyTuple_GetItem(tuple, place);
    return item == NULL ? NULL : python.PyUnicode_AsUTF8AndSize(item, NULL);
}

/* Take the answer of a method: its messages to the log, its status as result, its value, if wanted, as a new reference. */
static fmi2Status answered(Instance *own, PyObject *answer, PyObject **value) {
    if (value != NULL) *value = NULL;
    PyObject *first = answer == NULL ? NULL : python.PyTuple_GetItem(answer, 0);
    PyObject *second = first == NULL ? NULL : python.PyTuple_GetItem(answer, 1);
    PyObject *messages = second == NULL ? NULL : python.PyTuple_GetItem(answer, 2);
    if (messages == NULL) {
        tell_exception(&own->callbacks, own->name);
        python.Py_DecRef(answer);
        return fmi2Error;
    }
    fmi2Status status = (fmi2Status)python.PyLong_AsLong(first);
    Py_ssize_t count = python.PyList_Size(messages);
    for (Py_ssize_t place = 0; place < count; place++) {
        PyObject *message = python.PyList_GetItem(messages, place);
        fmi2Status weight = (fmi2Status)python.PyLong_AsLong(python.PyTuple_GetItem(message, 0));
        const char *category = text_at(message, 1), *text = text_at(message, 2);
        /* Reasons of failures are told even to a host that asked for no log: without them it would have a number only. */
        if ((own->logging || weight >= fmi2Discard) && category != NULL && text != NULL) {
            tell(&own->callbacks, own->name, weight, category, text);
        }
    }
    if (value != NULL) {
        python.Py_IncRef(second);
        *value = second;
    }
    python.Py_DecRef(answer);
    return status;
}

/* --- instances ------------------------------------------------------------------------------------------------------ */

static int hexadecimal(char digit) {
    if (digit >= '0' && digit <= '9') return digit - '0';
    if (digit >= 'a' && digit <= 'f') return digit - 'a' + 10;
    if (digit >= 'A' && digit <= 'F') return digit - 'A' + 10;
    return -1;
}

/* The path in a URI of the forms file:///path, file:/path and file://localhost/path, or a plain path; to be freed. */
static char *path_of(const char *uri) {
    const char *from = uri;
    int encoded = strncmp(uri, "file:", 5) == 0;
    if (encoded) {
        from += 5;
        if (strncmp(from, "//", 2) == 0) {
            from = strchr(from + 2, '/');
            if (from == NULL) return NULL;
        }
    }
    char *path = malloc(strlen(from) + 1), *to = path;
    if (path == NULL) return NULL;
    while (*from != '\0') {
        int high = encoded && from[0] == '%' ? hexadecimal(from[1]) : -1;
        int low = high < 0 ? -1 : hexadecimal(from[2]);
        *to++ = low < 0 ? *from : (char)(16 * high + low);
        from += low < 0 ? 1 : 3;
    }
    while (to > path + 1 && to[-1] == '/') to--;
    *to = '\0';
    return path;
}

/* The content of a text file, to be freed. */
static char *content_of(const char *path) {
    FILE *file = fopen(path, "rb");
    if (file == NULL) return NULL;
    char *text = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        long size = ftell(file);
        rewind(file);
        text = size < 0 ? NULL : malloc((size_t)size + 1);
        if (text != NULL) text[fread(text, 1, (size_t)size, file)] = '\0';
    }
    fclose(file);
    return text;
}

/* The slave that the FMU's load.py makes; NULL with Python's exception set. */
static PyObject *loaded(const char *text, const char *path, const char *resources, const char *guid) {
    PyObject *scope = python.PyDict_New();
    if (scope == NULL) return NULL;
    PyObject *slave = NULL, *code = NULL, *done = NULL;
    if (python.PyDict_SetItemString(scope, "__builtins__", python.PyEval_GetBuiltins()) == 0) {
        code = python.Py_CompileString(text, path, FILE_INPUT);
    }
    if (code != NULL) done = python.PyEval_EvalCode(code, scope, scope);
    if (done != NULL) {
        slave = python.PyObject_CallFunction(python.PyDict_GetItemString(scope, "instantiate"), "ss", resources, guid);
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

FMI2_Export fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                          fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                          fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible;
    if (functions == NULL) return NULL;
    const char *name = instanceName == NULL ? "" : instanceName;
    const char *wrong = NULL;
    if (*name == '\0') wrong = "an instance needs a name";
    if (fmuType != fmi2CoSimulation) wrong = "this FMU is for co-simulation only";
    if (fmuGUID == NULL) wrong = "an instance needs the GUID of the model description";
    if (fmuResourceLocation == NULL) wrong = "this FMU needs the location of its resources";
    char *resources = wrong == NULL ? path_of(fmuResourceLocation) : NULL;
    if (wrong == NULL && resources == NULL) wrong = "the location of the resources is no file: URI";
    char why[8192], *path = NULL, *text = NULL;
    if (wrong == NULL) {
        path = malloc(strlen(resources) + sizeof "/load.py");
        if (path != NULL) strcat(strcpy(path, resources), "/load.py");
        text = path == NULL ? NULL : content_of(path);
        if (text == NULL) {
            snprintf(why, sizeof why, "there is no file load.py in the resources of the FMU, %s", resources);
            wrong = why;
        } else if (start_python(why, sizeof why) != 0) {
            wrong = why;
        }
    }
    Instance *own = NULL;
    if (wrong == NULL) {
        int thread = python.PyGILState_Ensure();
        PyObject *slave = loaded(text, path, resources, fmuGUID);
        if (slave == NULL) {
            tell_exception(functions, name);
        } else if ((own = calloc(1, sizeof *own)) != NULL) {
            own->callbacks = *functions;
            own->name = strcpy(malloc(strlen(name) + 1), name);
            own->logging = loggingOn;
            own->slave = slave;
        }
        python.PyGILState_Release(thread);
    } else {
        tell(functions, name, fmi2Error, "logStatusError", wrong);
    }
    free(text);
    free(path);
    free(resources);
    return own;
}

FMI2_Export void fmi2FreeInstance(fmi2Component c) {
    Instance *own = c;
    if (own == NULL) return;
    int thread = python.PyGILState_Ensure();
    python.Py_DecRef(own->packed);
    python.Py_DecRef(own->slave);
    python.PyGILState_Release(thread);
    forget_texts(own);
    free(own->name);
    free(own);
}

FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }

FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                           const fmi2String categories[]) {
    (void)nCategories;
    (void)categories;
    if (c == NULL) return fmi2Error;
    ((Instance *)c)->logging = loggingOn;
    return fmi2OK;
}

/* --- calls that have no arrays -------------------------------------------------------------------------------------- */

/* Call a method with further arguments in the manner of Py_BuildValue, "()" for none. */
#define CALL(own, value, ...) answered(own, python.PyObject_CallMethod((own)->slave, __VA_ARGS__), value)

#define WITH_PYTHON(status, statement)          \
    int thread = python.PyGILState_Ensure();    \
    fmi2Status status = statement;              \
    python.PyGILState_Release(thread)

static fmi2Status simple(fmi2Component c, const char *method) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    WITH_PYTHON(status, CALL(own, NULL, method, "()"));
    return status;
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined;
    (void)tolerance;
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    own->reached = startTime;
    WITH_PYTHON(status, CALL(own, NULL, "setup_experiment", "(dd)", startTime, stopTimeDefined ? stopTime : (double)INFINITY));
    return status;
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return simple(c, "enter_initialization_mode"); }

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return simple(c, "exit_initialization_mode"); }

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c) { return simple(c, "terminate"); }

FMI2_Export fmi2Status fmi2Reset(fmi2Component c) { return simple(c, "reset"); }

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                                  fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    WITH_PYTHON(status, CALL(own, NULL, "do_step", "(dd)", currentCommunicationPoint, communicationStepSize));
    /* A step that fails leaves the slave as it was. */
    own->reached = currentCommunicationPoint + (status <= fmi2Warning ? communicationStepSize : 0.0);
    return status;
}

/* --- values --------------------------------------------------------------------------------------------------------- */

static PyObject *view(const void *data, size_t count, size_t size, int access) {
    static char nothing[1];
    return python.PyMemoryView_FromMemory(count == 0 ? nothing : (char *)data, (Py_ssize_t)(count * size), access);
}

static fmi2Status numbers(fmi2Component c, const char *method, const fmi2ValueReference vr[], size_t nvr, const void *values,
                          size_t size, int access) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    /* Consumed by the call: "N". A view that could not be made is NULL, which makes the call fail with its exception. */
    WITH_PYTHON(status, CALL(own, NULL, method, "(NN)", view(vr, nvr, sizeof *vr, VIEW_READ), view(values, nvr, size, access)));
    return status;
}

FMI2_Export fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]) {
    return numbers(c, "get_real", vr, nvr, value, sizeof *value, VIEW_WRITE);
}

FMI2_Export fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]) {
    return numbers(c, "get_integer", vr, nvr, value, sizeof *value, VIEW_WRITE);
}

FMI2_Export fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]) {
    return numbers(c, "get_boolean", vr, nvr, value, sizeof *value, VIEW_WRITE);
}

FMI2_Export fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]) {
    return numbers(c, "set_real", vr, nvr, value, sizeof *value, VIEW_READ);
}

FMI2_Export fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]) {
    return numbers(c, "set_integer", vr, nvr, value, sizeof *value, VIEW_READ);
}

FMI2_Export fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]) {
    return numbers(c, "set_boolean", vr, nvr, value, sizeof *value, VIEW_READ);
}

/* Copy the bytes objects of a list to `value`; the copies live until the next call. */
static fmi2Status texts_to(Instance *own, PyObject *list, size_t count, fmi2String value[]) {
    forget_texts(own);
    own->texts = calloc(count == 0 ? 1 : count, sizeof *own->texts);
    if (own->texts == NULL) return fmi2Error;
    own->texts_count = count;
    for (size_t place = 0; place < count; place++) {
        char *bytes = NULL;
        Py_ssize_t size = 0;
        PyObject *item = python.PyList_GetItem(list, (Py_ssize_t)place);
        if (item == NULL || python.PyBytes_AsStringAndSize(item, &bytes, &size) != 0) {
            tell_exception(&own->callbacks, own->name);
            return fmi2Error;
        }
        own->texts[place] = malloc((size_t)size + 1);
        if (own->texts[place] == NULL) return fmi2Error;
        memcpy(own->texts[place], bytes, (size_t)size + 1);
        value[place] = own->texts[place];
    }
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    int thread = python.PyGILState_Ensure();
    PyObject *list = NULL;
    fmi2Status status = CALL(own, &list, "get_string", "(N)", view(vr, nvr, sizeof *vr, VIEW_READ));
    if (status <= fmi2Warning) {
        fmi2Status copied = texts_to(own, list, nvr, value);
        status = copied == fmi2OK ? status : copied;
    }
    python.Py_DecRef(list);
    python.PyGILState_Release(thread);
    return status;
}

FMI2_Export fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    int thread = python.PyGILState_Ensure();
    PyObject *list = python.PyList_New(0);
    for (size_t place = 0; list != NULL && place < nvr; place++) {
        const char *bytes = value[place] == NULL ? "" : value[place];
        PyObject *text = python.PyUnicode_DecodeUTF8(bytes, (Py_ssize_t)strlen(bytes), "replace");
        if (text != NULL) python.PyList_Append(list, text);
        python.Py_DecRef(text);
    }
    fmi2Status status = CALL(own, NULL, "set_string", "(NN)", view(vr, nvr, sizeof *vr, VIEW_READ), list);
    python.PyGILState_Release(thread);
    return status;
}

/* --- states --------------------------------------------------------------------------------------------------------- */

/* A state's bytes are kept between two calls; of a state that is given up, they are of no use. */
static void forget_packed(Instance *own) {
    python.Py_DecRef(own->packed);
    own->packed = NULL;
    own->packed_of = NULL;
}

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *own = c;
    if (own == NULL || FMUstate == NULL) return fmi2Error;
    int thread = python.PyGILState_Ensure();
    PyObject *state = NULL;
    fmi2Status status = CALL(own, &state, "get_state", "()");
    if (status <= fmi2Warning) {
        /* By the standard a state that is given is overwritten. */
        if (*FMUstate == own->packed_of) forget_packed(own);
        python.Py_DecRef(*FMUstate);
        *FMUstate = state;
    } else {
        python.Py_DecRef(state);
    }
    python.PyGILState_Release(thread);
    return status;
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    if (FMUstate == NULL) {
        tell(&own->callbacks, own->name, fmi2Error, "logStatusError", "no state was given to fmi2SetFMUstate");
        return fmi2Error;
    }
    WITH_PYTHON(status, CALL(own, NULL, "set_state", "(O)", (PyObject *)FMUstate));
    return status;
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    Instance *own = c;
    if (own == NULL) return fmi2Error;
    if (FMUstate == NULL || *FMUstate == NULL) return fmi2OK;
    int thread = python.PyGILState_Ensure();
    if (*FMUstate == own->packed_of) forget_packed(own);
    python.Py_DecRef(*FMUstate);
    *FMUstate = NULL;
    python.PyGILState_Release(thread);
    return fmi2OK;
}

/* The bytes of a state, made once for the two calls that need them. */
static fmi2Status packed(Instance *own, fmi2FMUstate state, char **bytes, Py_ssize_t *size) {
    fmi2Status status = fmi2OK;
    if (own->packed == NULL || own->packed_of != state) {
        forget_packed(own);
        status = CALL(own, &own->packed, "state_to_bytes", "(O)", (PyObject *)state);
        if (status > fmi2Warning) {
            forget_packed(own);
            return status;
        }
        own->packed_of = state;
    }
    if (python.PyBytes_AsStringAndSize(own->packed, bytes, size) != 0) {
        tell_exception(&own->callbacks, own->name);
        return fmi2Error;
    }
    return status;
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    Instance *own = c;
    if (own == NULL || FMUstate == NULL || size == NULL) return fmi2Error;
    char *bytes = NULL;
    Py_ssize_t count = 0;
    WITH_PYTHON(status, packed(own, FMUstate, &bytes, &count));
    *size = (size_t)count;
    return status;
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size) {
    Instance *own = c;
    if (own == NULL || FMUstate == NULL) return fmi2Error;
    int thread = python.PyGILState_Ensure();
    char *bytes = NULL;
    Py_ssize_t count = 0;
    fmi2Status status = packed(own, FMUstate, &bytes, &count);
    if (status <= fmi2Warning && (size_t)count > size) {
        tell(&own->callbacks, own->name, fmi2Error, "logStatusError", "the array is too small for the serialized state");
        status = fmi2Error;
    }
    if (status <= fmi2Warning) memcpy(serializedState, bytes, (size_t)count);
    forget_packed(own);
    python.PyGILState_Release(thread);
    return status;
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                               fmi2FMUstate *FMUstate) {
    Instance *own = c;
    if (own == NULL || FMUstate == NULL) return fmi2Error;
    int thread = python.PyGILState_Ensure();
    PyObject *state = NULL;
    PyObject *bytes = python.PyBytes_FromStringAndSize(serializedState, (Py_ssize_t)size);
    fmi2Status status = CALL(own, &state, "state_from_bytes", "(N)", bytes);
    if (status <= fmi2Warning) {
        *FMUstate = state;
    } else {
        python.Py_DecRef(state);
    }
    python.PyGILState_Release(thread);
    return status;
}

/* --- what no unit has ----------------------------------------------------------------------------------------------- */

static fmi2Status unable(fmi2Component c, const char *what) {
    Instance *own = c;
    if (own != NULL) tell(&own->callbacks, own->name, fmi2Error, "logStatusError", what);
    return fmi2Error;
}

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                                    const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                                    const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    return unable(c, "this FMU has no directional derivatives (providesDirectionalDerivative is false)");
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                   const fmi2Integer order[], const fmi2Real value[]) {
    (void)vr, (void)nvr, (void)order, (void)value;
    return unable(c, "this FMU takes no input derivatives (canInterpolateInputs is false); see its parameter "
                     "input_interpolation");
}

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                    const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)nvr, (void)order, (void)value;
    return unable(c, "this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c) {
    return unable(c, "a step that has returned cannot be cancelled (canRunAsynchronuously is false)");
}

/* --- asking for more after fmi2Discard ------------------------------------------------------------------------------ */

FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard; /* Nothing is ever pending. */
}

FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    if (c == NULL || s != fmi2LastSuccessfulTime) return fmi2Discard;
    *value = ((Instance *)c)->reached;
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (c == NULL || s != fmi2Terminated) return fmi2Discard;
    *value = fmi2False; /* No unit ends a simulation by itself. */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)c, (void)s, (void)value;
    return fmi2Discard;
}
