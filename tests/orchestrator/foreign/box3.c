/* An FMI 3.0 co-simulation FMU in C with variables of every type but binaries and clocks.
 *
 * A variable has a value reference below 32 in its type, and up to 4 values. A step makes of each variable with an even
 * reference the one that follows: a number more by 1, a Boolean's contrary, and a text in brackets.
 *
 * Built with UPDATES it asks for inputs four times in a step, if the host lets it: what Float64 0 and 2 are then, it
 * gives as Float64 17, 19, 21, 23 and 25, 27, 29, 31. */
#include "fmi3PlatformTypes.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define COUNT 32
#define WIDTH 4
#define TEXT 100

typedef int fmi3Status;
typedef void (*Log)(void *, fmi3Status, fmi3String, fmi3String);
typedef void (*Update)(void *, fmi3Float64, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean, fmi3Boolean *,
                       fmi3Float64 *);
#ifndef UPDATES
#define UPDATES 0
#endif

typedef struct {
    fmi3Float32 Float32[COUNT][WIDTH];
    fmi3Float64 Float64[COUNT][WIDTH];
    fmi3Int8 Int8[COUNT][WIDTH];
    fmi3UInt8 UInt8[COUNT][WIDTH];
    fmi3Int16 Int16[COUNT][WIDTH];
    fmi3UInt16 UInt16[COUNT][WIDTH];
    fmi3Int32 Int32[COUNT][WIDTH];
    fmi3UInt32 UInt32[COUNT][WIDTH];
    fmi3Int64 Int64[COUNT][WIDTH];
    fmi3UInt64 UInt64[COUNT][WIDTH];
    fmi3Boolean Boolean[COUNT][WIDTH];
    char String[COUNT][WIDTH][TEXT];
    Update update;
    void *env;
} Box;

const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment env,
                                         Log log, Update update) {
    log(env, 0, "logAll", "made, 100% of it");
    Box *box = calloc(1, sizeof(Box));
    box->env = env;
    box->update = n ? update : NULL;
    return box;
}
void fmi3FreeInstance(fmi3Instance c) { free(c); }

static void compute(Box *box) {
    for (int v = 0; v < COUNT; v += 2)
        for (int i = 0; i < WIDTH; i++) {
            box->Float32[v + 1][i] = box->Float32[v][i] + 1;
            box->Float64[v + 1][i] = box->Float64[v][i] + 1;
            box->Int8[v + 1][i] = box->Int8[v][i] + 1;
            box->UInt8[v + 1][i] = box->UInt8[v][i] + 1;
            box->Int16[v + 1][i] = box->Int16[v][i] + 1;
            box->UInt16[v + 1][i] = box->UInt16[v][i] + 1;
            box->Int32[v + 1][i] = box->Int32[v][i] + 1;
            box->UInt32[v + 1][i] = box->UInt32[v][i] + 1;
            box->Int64[v + 1][i] = box->Int64[v][i] + 1;
            box->UInt64[v + 1][i] = box->UInt64[v][i] + 1;
            box->Boolean[v + 1][i] = !box->Boolean[v][i];
            snprintf(box->String[v + 1][i], TEXT, "<%.90s>", box->String[v][i]);
        }
}
int fmi3ExitInitializationMode(fmi3Instance c) { compute(c); return 0; }
int fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 h, fmi3Boolean final, fmi3Boolean *event,
               fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    Box *box = c;
    double seen[2][4] = {{0}};
    for (int k = 0; UPDATES && box->update && k < 4; k++) {
        fmi3Boolean asked = 0;
        fmi3Float64 when = 0.0;
        box->update(box->env, time + (k + 1) * h / 4.0, 1, 0, k == 3, 0, &asked, &when);
        for (int i = 0; i < 2; i++) seen[i][k] = box->Float64[2 * i][0];
    }
    compute(c);
    for (int k = 0; UPDATES && k < 4; k++)
        for (int i = 0; i < 2; i++) box->Float64[17 + 8 * i + 2 * k][0] = seen[i][k];
    *event = *terminate = 0;
    *early = EARLY && time > 1.5;
    *reached = *early ? time + 0.5 * h : time + h;
    return final ? 0 : 3;
}

#define ACCESS(Type)                                                                                                 \
    int fmi3Get##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3##Type value[], size_t m) {       \
        for (size_t k = 0; k < m; k++) value[k] = ((Box *)c)->Type[vr[n == m ? k : 0]][n == m ? 0 : k];              \
        return 0;                                                                                                    \
    }                                                                                                                \
    int fmi3Set##Type(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3##Type value[], size_t m) { \
        for (size_t k = 0; k < m; k++) ((Box *)c)->Type[vr[n == m ? k : 0]][n == m ? 0 : k] = value[k];              \
        return 0;                                                                                                    \
    }
ACCESS(Float32) ACCESS(Float64) ACCESS(Int8) ACCESS(UInt8) ACCESS(Int16) ACCESS(UInt16) ACCESS(Int32) ACCESS(UInt32)
ACCESS(Int64) ACCESS(UInt64) ACCESS(Boolean)
int fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String value[], size_t m) {
    for (size_t k = 0; k < m; k++) value[k] = ((Box *)c)->String[vr[n == m ? k : 0]][n == m ? 0 : k];
    return 0;
}
int fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String value[], size_t m) {
    for (size_t k = 0; k < m; k++) snprintf(((Box *)c)->String[vr[n == m ? k : 0]][n == m ? 0 : k], TEXT, "%s", value[k]);
    return 0;
}

#define FINE(name) int fmi3##name() { return 0; }
#define NOTHING(name) int fmi3##name() { return 3; }
FINE(SetDebugLogging) FINE(EnterInitializationMode) FINE(Terminate) FINE(Reset)
void *fmi3InstantiateModelExchange() { return 0; }
void *fmi3InstantiateScheduledExecution() { return 0; }
NOTHING(EnterEventMode) NOTHING(GetBinary) NOTHING(SetBinary) NOTHING(GetClock) NOTHING(SetClock)
NOTHING(GetNumberOfVariableDependencies) NOTHING(GetVariableDependencies) NOTHING(GetFMUState) NOTHING(SetFMUState)
NOTHING(FreeFMUState) NOTHING(SerializedFMUStateSize) NOTHING(SerializeFMUState) NOTHING(DeserializeFMUState)
NOTHING(GetDirectionalDerivative) NOTHING(GetAdjointDerivative) NOTHING(EnterConfigurationMode)
NOTHING(ExitConfigurationMode) NOTHING(GetIntervalDecimal) NOTHING(GetIntervalFraction) NOTHING(GetShiftDecimal)
NOTHING(GetShiftFraction) NOTHING(SetIntervalDecimal) NOTHING(SetIntervalFraction) NOTHING(SetShiftDecimal)
NOTHING(SetShiftFraction) NOTHING(EvaluateDiscreteStates) NOTHING(UpdateDiscreteStates)
NOTHING(EnterContinuousTimeMode) NOTHING(CompletedIntegratorStep) NOTHING(SetTime) NOTHING(SetContinuousStates)
NOTHING(GetContinuousStateDerivatives) NOTHING(GetEventIndicators) NOTHING(GetContinuousStates)
NOTHING(GetNominalsOfContinuousStates) NOTHING(GetNumberOfEventIndicators) NOTHING(GetNumberOfContinuousStates)
NOTHING(EnterStepMode) NOTHING(GetOutputDerivatives) NOTHING(ActivateModelPartition)
