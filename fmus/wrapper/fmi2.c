/* FMI 2.0 co-simulation, in terms of instance.h. */
#include "fmi2.h"
#include "instance.h"
#include "state.h"

#include <math.h>

/* --- life ------------------------------------------------------------------------------------------------------- */

static void write(const Log *log, Status status, const char *category, const char *text) {
    fmi2CallbackLogger logger = (fmi2CallbackLogger)log->logger;
    logger(log->environment, log->name, (fmi2Status)status, category, text);
}

FMI2_Export fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                                          fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                                          fmi2Boolean visible, fmi2Boolean loggingOn) {
    (void)visible;
    if (functions == NULL) return NULL;
    Log log = {.write = write,
               .environment = functions->componentEnvironment,
               .name = instanceName == NULL ? "" : instanceName,
               .printf_format = 1};
    log.logger = (void (*)(void))functions->logger;
    open_log(&log, loggingOn);
    if (fmuType != fmi2CoSimulation) {
        refuse(&log, "this FMU is for co-simulation only");
        return NULL;
    }
    return instantiate(sizeof(Instance), &log, fmuResourceLocation, fmuGUID, 2);
}

FMI2_Export void fmi2FreeInstance(fmi2Component c) {
    if (c == NULL) return;
    forget_states(c);
    free_instance(c);
}

FMI2_Export const char *fmi2GetTypesPlatform(void) { return "default"; }

FMI2_Export const char *fmi2GetVersion(void) { return "2.0"; }

FMI2_Export fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                                           const fmi2String categories[]) {
    Instance *own = c;
    return own == NULL ? fmi2Error : (fmi2Status)choose_categories(&own->log, loggingOn, nCategories, categories);
}

FMI2_Export fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                                           fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime) {
    (void)toleranceDefined, (void)tolerance;
    Instance *own = c;
    if (!ready(own)) return fmi2Error;
    double stop = stopTimeDefined ? stopTime : (double)INFINITY;
    WITH_PYTHON(status, CALL(own, NULL, "setup_experiment", "(dd)", startTime, stop));
    return (fmi2Status)status;
}

FMI2_Export fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    return (fmi2Status)simple(c, "enter_initialization_mode");
}

FMI2_Export fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    return (fmi2Status)simple(c, "exit_initialization_mode");
}

FMI2_Export fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)simple(c, "terminate"); }

FMI2_Export fmi2Status fmi2Reset(fmi2Component c) { return (fmi2Status)simple(c, "reset"); }

FMI2_Export fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                                  fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint;
    Instance *own = c;
    if (!ready(own)) return fmi2Error;
    WITH_PYTHON(status, CALL(own, NULL, "do_step", "(dd)", currentCommunicationPoint, communicationStepSize));
    return (fmi2Status)status;
}

/* --- values ----------------------------------------------------------------------------------------------------- */

#define GET_AND_SET(type)                                                                                    \
    FMI2_Export fmi2Status fmi2Get##type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,         \
                                         fmi2##type value[]) {                                               \
        if (!ready(c)) return fmi2Error;                                                                     \
        return (fmi2Status)numbers(c, "get_numbers", #type, vr, nvr, value, nvr, sizeof *value, VIEW_WRITE); \
    }                                                                                                        \
    FMI2_Export fmi2Status fmi2Set##type(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,         \
                                         const fmi2##type value[]) {                                         \
        if (!ready(c)) return fmi2Error;                                                                     \
        return (fmi2Status)numbers(c, "set_numbers", #type, vr, nvr, value, nvr, sizeof *value, VIEW_READ);  \
    }

GET_AND_SET(Real)
GET_AND_SET(Integer)
GET_AND_SET(Boolean)

FMI2_Export fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]) {
    return (fmi2Status)get_texts(c, vr, nvr, value, nvr);
}

FMI2_Export fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                     const fmi2String value[]) {
    return (fmi2Status)set_texts(c, vr, nvr, value, nvr);
}

FMI2_Export fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                   const fmi2Integer order[], const fmi2Real value[]) {
    Instance *own = c;
    if (!ready(own) || !there(own, vr, nvr, sizeof *vr, "value references") ||
        !there(own, order, nvr, sizeof *order, "orders") || !there(own, value, nvr, sizeof *value, "values")) {
        return fmi2Error;
    }
    WITH_PYTHON(status, CALL(own, NULL, "set_input_derivatives", "(NNN)", view(vr, nvr, sizeof *vr, VIEW_READ),
                             view(order, nvr, sizeof *order, VIEW_READ), view(value, nvr, sizeof *value, VIEW_READ)));
    return (fmi2Status)status;
}

FMI2_Export fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[],
                                                    size_t nUnknown, const fmi2ValueReference vKnown_ref[],
                                                    size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    return (fmi2Status)derivatives(c, "get_directional_derivative", vUnknown_ref, nUnknown, vKnown_ref, nKnown, dvKnown,
                                   nKnown, dvUnknown, nUnknown);
}

/* --- states ----------------------------------------------------------------------------------------------------- */

FMI2_Export fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)get_state(c, FMUstate);
}

FMI2_Export fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) {
    return (fmi2Status)set_state(c, FMUstate);
}

FMI2_Export fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) {
    return (fmi2Status)free_state(c, FMUstate);
}

FMI2_Export fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size) {
    return (fmi2Status)state_size(c, FMUstate, size);
}

FMI2_Export fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[],
                                             size_t size) {
    return (fmi2Status)serialize(c, FMUstate, serializedState, size);
}

FMI2_Export fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte serializedState[], size_t size,
                                               fmi2FMUstate *FMUstate) {
    return (fmi2Status)deserialize(c, serializedState, size, FMUstate);
}

/* --- what no unit has ------------------------------------------------------------------------------------------- */

FMI2_Export fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                                    const fmi2Integer order[], fmi2Real value[]) {
    (void)vr, (void)nvr, (void)order, (void)value;
    return (fmi2Status)unable(c, "this FMU has no output derivatives (maxOutputDerivativeOrder is 0)");
}

FMI2_Export fmi2Status fmi2CancelStep(fmi2Component c) {
    return (fmi2Status)unable(c, "a step that has returned cannot be cancelled (canRunAsynchronuously is false)");
}

/* --- asking for more after fmi2Discard -------------------------------------------------------------------------- */

FMI2_Export fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    (void)s, (void)value;
    return c == NULL ? fmi2Error : fmi2Discard; /* Nothing is ever pending. */
}

FMI2_Export fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    if (!ready(c) || !there(c, value, 1, sizeof *value, "status values")) return fmi2Error;
    return s == fmi2LastSuccessfulTime ? (fmi2Status)reached(c, value) : fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)s, (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}

FMI2_Export fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    if (!ready(c) || !there(c, value, 1, sizeof *value, "status values")) return fmi2Error;
    if (s != fmi2Terminated) return fmi2Discard;
    *value = fmi2False; /* No unit ends a simulation by itself. */
    return fmi2OK;
}

FMI2_Export fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    (void)s, (void)value;
    return c == NULL ? fmi2Error : fmi2Discard;
}
