/* The active stress of a depolarised cell by somebody else: an FMI 2.0 co-simulation FMU in C, for a mesh of NODES nodes.
 *
 *     ds/dt = rate(p) (k (p - p_rest) - s),   rate(p) = slow + (fast - slow) exp(-exp(-slope (p - p_threshold)))
 *
 * Exact for a potential p that is held over a step. The variables, by value reference: 0 k in MPa/mV, 1 p_rest and
 * 2 p_threshold in mV, 3 slow and 4 fast in 1/ms, 5 slope in 1/mV; then the potential at all nodes in mV, the active stress
 * at all nodes in kPa, and its mean and maximum. */
#include "fmi2Functions.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PER_POTENTIAL, REST, THRESHOLD, SLOW, FAST, SLOPE, PARAMETERS };
enum { POTENTIAL = PARAMETERS, STRESS = POTENTIAL + NODES, MEAN = STRESS + NODES, MAX, COUNT };
#define MS_PER_S 1000.0
#define KPA_PER_MPA 1000.0

/* All values are in one array, which therefore is the state as well; the stress is kept in MPa next to it. */
typedef struct {
    fmi2Real values[COUNT];
    fmi2Real tension[NODES];
} State;

typedef struct {
    State state;
    fmi2CallbackFunctions callbacks;
    char name[64];
} Muscle;

static fmi2Status fail(Muscle *own, const char *message) {
    own->callbacks.logger(own->callbacks.componentEnvironment, own->name, fmi2Error, "logStatusError", "%s", message);
    return fmi2Error;
}

static void show(State *state) {
    double *values = state->values, sum = 0.0, largest = -INFINITY;
    for (int node = 0; node < NODES; node++) {
        values[STRESS + node] = KPA_PER_MPA * state->tension[node];
        sum += values[STRESS + node];
        largest = fmax(largest, values[STRESS + node]);
    }
    values[MEAN] = sum / NODES;
    values[MAX] = largest;
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    if (type != fmi2CoSimulation || strcmp(guid, GUID)) return NULL;
    Muscle *own = calloc(1, sizeof *own);
    if (own == NULL) return NULL;
    own->callbacks = *callbacks;
    strncpy(own->name, name, sizeof own->name - 1);
    const double start[PARAMETERS] = {0.005, -80.0, 0.0, 0.1, 1.0, 1.0};
    memcpy(own->state.values, start, sizeof start);
    for (int node = 0; node < NODES; node++) own->state.values[POTENTIAL + node] = -80.0;
    return own;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tol, fmi2Real b, fmi2Boolean s, fmi2Real e) {
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    show(&((Muscle *)c)->state);
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) { return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { return fail(c, "this FMU cannot be reset; instantiate another one"); }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT) return fail(c, "no such Real");
        value[i] = ((Muscle *)c)->state.values[vr[i]];
    }
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= STRESS) return fail(c, "no Real that can be set");
        ((Muscle *)c)->state.values[vr[i]] = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean no_undo) {
    State *state = &((Muscle *)c)->state;
    const double *values = state->values;
    for (int node = 0; node < NODES; node++) {
        const double potential = values[POTENTIAL + node];
        const double target = values[PER_POTENTIAL] * (potential - values[REST]);
        const double delay = exp(-exp(fmin(-values[SLOPE] * (potential - values[THRESHOLD]), 50.0)));
        const double rate = values[SLOW] + (values[FAST] - values[SLOW]) * delay;
        state->tension[node] -= (target - state->tension[node]) * expm1(-rate * step * MS_PER_S);
    }
    show(state);
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (*state == NULL) *state = malloc(sizeof(State));
    memcpy(*state, &((Muscle *)c)->state, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Muscle *)c)->state, state, sizeof(State));
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
    if (size != sizeof(State)) return fail(c, "no state of this FMU");
    if (*state == NULL) *state = malloc(sizeof(State));
    memcpy(*state, data, size);
    return fmi2OK;
}

#define NOTHING { return fmi2Error; }
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2Integer x[]) NOTHING
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2Boolean x[]) NOTHING
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2String x[]) NOTHING
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Integer x[]) NOTHING
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Boolean x[]) NOTHING
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2String x[]) NOTHING
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Integer o[],
                                       const fmi2Real x[]) NOTHING
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Integer o[],
                                        fmi2Real x[]) NOTHING
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t n,
                                        const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real x[]) NOTHING
fmi2Status fmi2CancelStep(fmi2Component c) NOTHING
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *x) NOTHING
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *x) NOTHING
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *x) NOTHING
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *x) NOTHING
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *x) NOTHING
