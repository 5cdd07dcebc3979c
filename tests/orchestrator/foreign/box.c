/* An FMI 2.0 co-simulation FMU in C with variables of every type, whatever its description calls them.
 *
 * By value reference, of each type: 0 to 15 are inputs, 16 to 31 what a step makes of them:
 *
 *     Real      y' = u          (integrated exactly for an input that is held, or runs linearly by its derivative)
 *     Integer   y = u + 1
 *     Boolean   y = not u
 *     String    y = "<u>"
 *
 * and Real 32 is the time that was reached, 33 a parameter that does nothing, Boolean 33 whether anything was saved. */
#include "fmi2Functions.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COUNT 34
#define HALF 16
#define TEXT 200

typedef struct {
    double reals[COUNT], slopes[HALF];
    int integers[COUNT], booleans[COUNT];
    char texts[COUNT][TEXT];
} State;

typedef struct {
    State state;
    fmi2CallbackFunctions callbacks;
    char name[64];
} Box;

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static void tell(Box *box, fmi2Status status, const char *format, double number, const char *text) {
    box->callbacks.logger(box->callbacks.componentEnvironment, box->name, status, "logAll", format, number, text);
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Box *box = calloc(1, sizeof *box);
    box->callbacks = *callbacks;
    strncpy(box->name, name, sizeof box->name - 1);
    return box;
}
void fmi2FreeInstance(fmi2Component c) { free(c); }
#define FINE { return fmi2OK; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) FINE
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tol, fmi2Real b, fmi2Boolean s, fmi2Real e) FINE
fmi2Status fmi2EnterInitializationMode(fmi2Component c) FINE
fmi2Status fmi2Terminate(fmi2Component c) FINE
fmi2Status fmi2Reset(fmi2Component c) FINE

static void compute(State *s) {
    for (int i = 0; i < HALF; i++) {
        s->integers[HALF + i] = s->integers[i] + 1;
        s->booleans[HALF + i] = !s->booleans[i];
        snprintf(s->texts[HALF + i], TEXT, "<%.100s>", s->texts[i]);
    }
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    compute(&((Box *)c)->state);
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_undo) {
    State *s = &((Box *)c)->state;
    for (int i = 0; i < HALF; i++) {
        s->reals[HALF + i] += h * s->reals[i] + 0.5 * h * h * s->slopes[i];
        s->reals[i] += h * s->slopes[i];
    }
    s->reals[32] = time + h;
    compute(s);
#ifdef TALKS
    tell(c, fmi2OK, "at %.3f s: %s", time + h, "100 % of it\nand a second line");
    if (time == 0.0) tell(c, fmi2Warning, "50% done, %s %s %n", 0.0, "really");
#endif
    return fmi2OK;
}

#define ACCESS(Type, ctype, field)                                                                                   \
    fmi2Status fmi2Get##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, ctype value[]) {              \
        for (size_t i = 0; i < n; i++) value[i] = ((Box *)c)->state.field[vr[i]];                                    \
        return fmi2OK;                                                                                               \
    }                                                                                                                \
    fmi2Status fmi2Set##Type(fmi2Component c, const fmi2ValueReference vr[], size_t n, const ctype value[]) {        \
        for (size_t i = 0; i < n; i++) ((Box *)c)->state.field[vr[i]] = value[i];                                    \
        return fmi2OK;                                                                                               \
    }
ACCESS(Integer, fmi2Integer, integers)
ACCESS(Boolean, fmi2Boolean, booleans)
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Box *)c)->state.reals[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        ((Box *)c)->state.reals[vr[i]] = value[i];
        if (vr[i] < HALF) ((Box *)c)->state.slopes[vr[i]] = 0.0;
    }
    return fmi2OK;
}
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    for (size_t i = 0; i < n; i++) value[i] = ((Box *)c)->state.texts[vr[i]];
    return fmi2OK;
}
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    for (size_t i = 0; i < n; i++) snprintf(((Box *)c)->state.texts[vr[i]], TEXT, "%s", value[i]);
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (order[i] != 1) return fmi2Discard;
        ((Box *)c)->state.slopes[vr[i]] = value[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(State));
    ((Box *)c)->state.booleans[33] = 1;
    memcpy(*state, &((Box *)c)->state, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Box *)c)->state, state, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    free(*state);
    *state = NULL;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    *size = sizeof(State);
    return fmi2OK;
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte data[], size_t size) {
    memcpy(data, state, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte data[], size_t size, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, data, size);
    return fmi2OK;
}

#include "unused.h"
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *x) NOTHING
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *x) NOTHING
