/* A damped mass on a spring, pulled through another spring and damper: an FMI 2.0 co-simulation FMU in C.
 *
 *     m x'' + (c + c_c) x' + (k + k_c) x = F + k_c x_in + c_c v_in
 *
 * Integrated exactly for inputs that are polynomials of up to second degree over a step (input derivatives).
 *
 * Built with QUIRK as one of these numbers it takes the liberties that foreign FMUs take: */
#define COMMITS 1   /* what a step computed is kept only when it is told that nobody goes back before its begin */
#define RESETS 2    /* fmi2SetupExperiment gives every variable its default */
#define ENDS 3      /* asks for the end of the simulation from 50 ms on */
#define DIES 4      /* fmi2Fatal from 50 ms on */
#define REASONS 5   /* discards a step from 50 ms on and says why, as a message of that status */
#define LINES 6     /* takes first derivatives of inputs only */
#define LEAVES 7    /* ends the process from 50 ms on as if all were done: exit(0) */
#define BREAKS 8    /* writes where nobody may from 50 ms on */
#define TELLS 9     /* writes the calls that it gets to the file that the environment variable JOURNAL names */
#ifndef QUIRK
#define QUIRK 0
#endif
/* The variables, by value reference: 0 m, 1 k, 2 c, 3 k_c, 4 c_c; 5 F, 6 x_in, 7 v_in; 8 x, 9 v; 10 force. */
#include "fmi2Functions.h"
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { M, K, C, KC, CC, F, X_IN, V_IN, X, V, FORCE, COUNT };
enum { FIRST_INPUT = F, INPUTS = 3 };
#define N 5

typedef struct {
    fmi2Real values[COUNT];
    fmi2Real slopes[INPUTS], curvatures[INPUTS];
} State;

typedef struct {
    State state, committed;
    double reached;
    fmi2CallbackFunctions callbacks;
    char name[64];
} Body;

static void tell(fmi2Component c, const char *format, ...) {
    FILE *journal = QUIRK == TELLS && getenv("JOURNAL") ? fopen(getenv("JOURNAL"), "a") : NULL;
    if (journal == NULL) return;
    va_list arguments;
    va_start(arguments, format);
    fprintf(journal, "%s ", ((Body *)c)->name);
    vfprintf(journal, format, arguments);
    fputc('\n', journal);
    va_end(arguments);
    fclose(journal);
}

static fmi2Status fail(Body *body, const char *message) {
    tell(body, "fails");
    body->callbacks.logger(body->callbacks.componentEnvironment, body->name, fmi2Error, "logStatusError", "%s", message);
    return fmi2Error;
}

static void multiply(double a[N][N], double b[N][N], double out[N][N]) {
    double sum[N][N];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            sum[i][j] = 0.0;
            for (int k = 0; k < N; k++) sum[i][j] += a[i][k] * b[k][j];
        }
    memcpy(out, sum, sizeof sum);
}

/* exp(a) by its series, scaled and squared. */
static void exponential(double a[N][N], double out[N][N]) {
    double norm = 0.0, scaled[N][N], term[N][N];
    int squarings = 0;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) norm = fmax(norm, fabs(a[i][j]));
    while (norm > 0.02) { norm *= 0.5; squarings++; }
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            scaled[i][j] = ldexp(a[i][j], -squarings);
            term[i][j] = out[i][j] = i == j;
        }
    for (int order = 1; order <= 10; order++) {
        multiply(term, scaled, term);
        for (int i = 0; i < N; i++)
            for (int j = 0; j < N; j++) {
                term[i][j] /= order;
                out[i][j] += term[i][j];
            }
    }
    while (squarings--) multiply(out, out, out);
}

static double load(const State *s, const double *inputs) {
    return inputs[0] + s->values[KC] * inputs[1] + s->values[CC] * inputs[2];
}

static void update_force(State *s) {
    s->values[FORCE] = s->values[KC] * (s->values[X] - s->values[X_IN]) + s->values[CC] * (s->values[V] - s->values[V_IN]);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String location,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Body *body = calloc(1, sizeof *body);
    if (type != fmi2CoSimulation || strcmp(guid, GUID)) { free(body); return NULL; }
    body->callbacks = *callbacks;
    strncpy(body->name, name, sizeof body->name - 1);
    body->state.values[M] = 1.0;
    return body;
}

void fmi2FreeInstance(fmi2Component c) {
    tell(c, "FreeInstance");
    free(c);
}
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String k[]) { return fmi2OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean t, fmi2Real tol, fmi2Real b, fmi2Boolean s, fmi2Real e) {
    tell(c, "SetupExperiment");
    if (QUIRK == RESETS) {
        memset(&((Body *)c)->state, 0, sizeof(State));
        ((Body *)c)->state.values[M] = 1.0;
    }
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    tell(c, "EnterInitializationMode");
    return fmi2OK;
}
fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    tell(c, "ExitInitializationMode");
    update_force(&((Body *)c)->state);
    ((Body *)c)->committed = ((Body *)c)->state;
    return fmi2OK;
}
fmi2Status fmi2Terminate(fmi2Component c) {
    tell(c, "Terminate");
    return fmi2OK;
}
fmi2Status fmi2Reset(fmi2Component c) { return fmi2OK; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= COUNT) return fail(c, "no such Real");
        value[i] = ((Body *)c)->state.values[vr[i]];
    }
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    State *s = &((Body *)c)->state;
    for (size_t i = 0; i < n; i++) {
        tell(c, "SetReal %u", vr[i]);
        if (vr[i] >= FORCE) return fail(c, "no Real that can be set");
        if (vr[i] == M && value[i] <= 0.0) return fail(c, "the mass has to be above zero, 100 % of it");
        s->values[vr[i]] = value[i];
        if (vr[i] >= FIRST_INPUT && vr[i] < FIRST_INPUT + INPUTS)
            s->slopes[vr[i] - FIRST_INPUT] = s->curvatures[vr[i] - FIRST_INPUT] = 0.0;
    }
    return fmi2OK;
}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    State *s = &((Body *)c)->state;
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < FIRST_INPUT || vr[i] >= FIRST_INPUT + INPUTS || order[i] < 1 || order[i] > 2)
            return fail(c, "no such input derivative");
        if (QUIRK == LINES && order[i] > 1) return fail(c, "no second derivatives");
        (order[i] == 1 ? s->slopes : s->curvatures)[vr[i] - FIRST_INPUT] = value[i];
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real h, fmi2Boolean no_undo) {
    State *s = &((Body *)c)->state;
    tell(c, "DoStep %.17g %.17g", time, h);
    if (QUIRK == COMMITS) {
        memcpy(((Body *)c)->committed.values + FIRST_INPUT, s->values + FIRST_INPUT, INPUTS * sizeof(double));
        if (no_undo) ((Body *)c)->committed = *s;
        else *s = ((Body *)c)->committed;
    }
    ((Body *)c)->reached = time;
    if (time > 0.0499) {
        if (QUIRK == LEAVES) exit(0);
        if (QUIRK == BREAKS) *(volatile int *)8 = 0;
        if (QUIRK == ENDS) return fmi2Discard;
        if (QUIRK == DIES) { fail(c, "beyond repair"); return fmi2Fatal; }
        if (QUIRK == REASONS) {
            ((Body *)c)->callbacks.logger(((Body *)c)->callbacks.componentEnvironment, ((Body *)c)->name, fmi2Discard,
                                          "logStatusDiscard", "%d %% too long", 40);
            return fmi2Discard;
        }
    }
    const double *v = s->values;
    double a[N][N] = {{0}}, e[N][N], z[N] = {v[X], v[V], load(s, v + F), load(s, s->slopes), load(s, s->curvatures)};
    a[0][1] = 1.0;
    a[1][0] = -(v[K] + v[KC]) / v[M];
    a[1][1] = -(v[C] + v[CC]) / v[M];
    a[1][2] = 1.0 / v[M];
    a[2][3] = a[3][4] = 1.0;
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) a[i][j] *= h;
    exponential(a, e);
    double x = 0.0, w = 0.0;
    for (int j = 0; j < N; j++) { x += e[0][j] * z[j]; w += e[1][j] * z[j]; }
    if (fabs(x) > 1e6) return fail(c, "the spring broke");
    s->values[X] = x;
    s->values[V] = w;
    for (int i = 0; i < INPUTS; i++) {
        s->values[FIRST_INPUT + i] += h * s->slopes[i] + 0.5 * h * h * s->curvatures[i];
        s->slopes[i] += h * s->curvatures[i];
    }
    update_force(s);
    return fmi2OK;
}

#ifdef WITH_STATE
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, &((Body *)c)->state, sizeof(State));
    return fmi2OK;
}
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    memcpy(&((Body *)c)->state, state, sizeof(State));
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
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, data, size);
    return fmi2OK;
}
#else
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) { return fmi2Error; }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) { return fmi2Error; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) { return fmi2Error; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) { return fmi2Error; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte d[], size_t n) { return fmi2Error; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte d[], size_t n, fmi2FMUstate *s) { return fmi2Error; }
#endif

#include "unused.h"
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2Integer x[]) NOTHING
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2Boolean x[]) NOTHING
fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference v[], size_t n, fmi2String x[]) NOTHING
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Integer x[]) NOTHING
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Boolean x[]) NOTHING
fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2String x[]) NOTHING
fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *x) {
    *x = ((Body *)c)->reached;
    return fmi2OK;
}
fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *x) {
    if (QUIRK != ENDS) return fail(c, "not known");
    *x = k == fmi2Terminated;
    return fmi2OK;
}
