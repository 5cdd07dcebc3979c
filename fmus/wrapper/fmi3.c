/* FMI 3.0 co-simulation, in terms of instance.h; what no unit has is in fmi3_absent.c. */
#include "fmi3.h"
#include "instance.h"
#include "state.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* An instance, and how its host gives values of inputs at the end of a step. */
typedef struct {
    Instance shared;
    fmi3IntermediateUpdateCallback update; /* NULL if the host gives none */
    fmi3ValueReference *intermediate;      /* the variables that it gives */
    size_t intermediate_count;
    int update_failed; /* whether a value was refused in the update that is running */
} WithUpdate;

/* --- life ------------------------------------------------------------------------------------------------------- */

static void write(const Log *log, Status status, const char *category, const char *text) {
    ((fmi3LogMessageCallback)log->logger)(log->environment, (fmi3Status)status, category, text);
}

/* A log without an instance, of which those that are refused speak as well. */
static Log log_of(fmi3String name, fmi3Boolean enabled, fmi3InstanceEnvironment environment,
                  fmi3LogMessageCallback logger) {
    Log log = {.write = write, .logger = (void (*)(void))logger, .environment = environment, .name = name};
    open_log(&log, enabled);
    /* Who asks for no log is not called at all (FMI 3.0, section 2.3.1); in FMI 2 that is about debugging only. */
    log.chosen = 1;
    return log;
}

FMI3_Export fmi3Instance
fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
                            fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
                            fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
                            size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
                            fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate) {
    (void)visible, (void)earlyReturnAllowed;
    Log log = log_of(instanceName, loggingOn, instanceEnvironment, logMessage);
    size_t count = nRequiredIntermediateVariables;
    const char *wrong = NULL;
    if (eventModeUsed) wrong = "this FMU has no event mode (hasEventMode is false): eventModeUsed has to be fmi3False";
    if (count > 0 && requiredIntermediateVariables == NULL)
        wrong = "the array of required intermediate variables is NULL";
    if (count > PTRDIFF_MAX / sizeof(fmi3ValueReference))
        wrong = "there cannot be as many required intermediate variables";
    fmi3ValueReference *copy = wrong == NULL && count > 0 ? malloc(count * sizeof *copy) : NULL;
    if (wrong == NULL && count > 0 && copy == NULL)
        wrong = "there is no memory for the required intermediate variables";
    if (wrong != NULL) {
        refuse(&log, wrong);
        return NULL;
    }
    WithUpdate *own = instantiate(sizeof *own, &log, resourcePath, instantiationToken, 3);
    if (own == NULL) {
        free(copy);
        return NULL;
    }
    if (count > 0) memcpy(copy, requiredIntermediateVariables, count * sizeof *copy);
    own->intermediate = copy;
    own->intermediate_count = count;
    own->update = intermediateUpdate;
    return own;
}

FMI3_Export fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                                      fmi3String resourcePath, fmi3Boolean visible,
                                                      fmi3Boolean loggingOn,
                                                      fmi3InstanceEnvironment instanceEnvironment,
                                                      fmi3LogMessageCallback logMessage) {
    (void)instantiationToken, (void)resourcePath, (void)visible;
    Log log = log_of(instanceName, loggingOn, instanceEnvironment, logMessage);
    refuse(&log, "this FMU is for co-simulation only: its model description has no ModelExchange");
    return NULL;
}

FMI3_Export fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
    fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
    fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
    fmi3UnlockPreemptionCallback unlockPreemption) {
    (void)instantiationToken, (void)resourcePath, (void)visible, (void)clockUpdate, (void)lockPreemption,
        (void)unlockPreemption;
    Log log = log_of(instanceName, loggingOn, instanceEnvironment, logMessage);
    refuse(&log, "this FMU is for co-simulation only: its model description has no ScheduledExecution");
    return NULL;
}

FMI3_Export void fmi3FreeInstance(fmi3Instance instance) {
    WithUpdate *own = instance;
    /* An instance that its own step is still using stays. */
    if (own == NULL || !ready(&own->shared)) return;
    free(own->intermediate);
    forget_states(&own->shared);
    free_instance(&own->shared);
}

FMI3_Export const char *fmi3GetVersion(void) { return "3.0"; }

FMI3_Export fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                                           const fmi3String categories[]) {
    Instance *own = instance;
    return own == NULL ? fmi3Error : (fmi3Status)choose_categories(&own->log, loggingOn, nCategories, categories);
}

FMI3_Export fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                                   fmi3Float64 tolerance, fmi3Float64 startTime,
                                                   fmi3Boolean stopTimeDefined, fmi3Float64 stopTime) {
    (void)toleranceDefined, (void)tolerance;
    Instance *own = instance;
    if (!ready(own)) return fmi3Error;
    double stop = stopTimeDefined ? stopTime : (double)INFINITY;
    WITH_PYTHON(status, CALL(own, NULL, "enter_initialization_mode", "(dd)", startTime, stop));
    return (fmi3Status)status;
}

FMI3_Export fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) {
    return (fmi3Status)simple(instance, "exit_initialization_mode");
}

FMI3_Export fmi3Status fmi3Terminate(fmi3Instance instance) { return (fmi3Status)simple(instance, "terminate"); }

FMI3_Export fmi3Status fmi3Reset(fmi3Instance instance) { return (fmi3Status)simple(instance, "reset"); }

/* --- steps ------------------------------------------------------------------------------------------------------ */

static Status worst(Status one, Status other) { return one > other ? one : other; }

static Status move(Instance *own, const char *method, double time, double step) {
    WITH_PYTHON(status, CALL(own, NULL, method, "(dd)", time, step));
    return status;
}

/* Ask the host for inputs at the end of the step, outside of Python, for the host may be written in it. ERROR if a
 * value was refused: with the old one the step would have gone on to a wrong result. */
static Status update(WithUpdate *own, double time) {
    fmi3Boolean early = fmi3False;
    fmi3Float64 early_time = time;
    own->update_failed = 0;
    own->shared.updating = 1;
    own->update(own->shared.log.environment, time, fmi3True, fmi3False, fmi3False, fmi3False, &early, &early_time);
    own->shared.updating = 0;
    if (!own->update_failed) return OK;
    return refuse(&own->shared.log, "the step is not taken: an intermediate value was refused");
}

FMI3_Export fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                                  fmi3Float64 communicationStepSize, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                  fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                                  fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime) {
    (void)noSetFMUStatePriorToCurrentPoint;
    WithUpdate *own = instance;
    /* No unit has events, ends a simulation by itself, or returns early. */
    if (eventHandlingNeeded != NULL) *eventHandlingNeeded = fmi3False;
    if (terminateSimulation != NULL) *terminateSimulation = fmi3False;
    if (earlyReturn != NULL) *earlyReturn = fmi3False;
    if (own == NULL || !ready(&own->shared)) return fmi3Error;
    double time = currentCommunicationPoint, step = communicationStepSize;
    Status status = OK;
    if (own->update != NULL && own->intermediate_count > 0) {
        status = move(&own->shared, "prepare_step", time, step);
        if (status <= WARNING) status = worst(status, update(own, time + step));
    }
    if (status <= WARNING) status = worst(status, move(&own->shared, "do_step", time, step));
    if (lastSuccessfulTime != NULL) status = worst(status, reached(&own->shared, lastSuccessfulTime));
    return (fmi3Status)status;
}

/* --- values ----------------------------------------------------------------------------------------------------- */

#define GET(type)                                                                                                      \
    FMI3_Export fmi3Status fmi3Get##type(fmi3Instance instance, const fmi3ValueReference valueReferences[],            \
                                         size_t nValueReferences, fmi3##type values[], size_t nValues) {               \
        if (!ready(instance)) return fmi3Error;                                                                        \
        return (fmi3Status)numbers(instance, "get_numbers", #type, valueReferences, nValueReferences, values, nValues, \
                                   sizeof *values, VIEW_WRITE);                                                        \
    }

#define SET(type)                                                                                                      \
    FMI3_Export fmi3Status fmi3Set##type(fmi3Instance instance, const fmi3ValueReference valueReferences[],            \
                                         size_t nValueReferences, const fmi3##type values[], size_t nValues) {         \
        if (!ready(instance)) return fmi3Error;                                                                        \
        return (fmi3Status)numbers(instance, "set_numbers", #type, valueReferences, nValueReferences, values, nValues, \
                                   sizeof *values, VIEW_READ);                                                         \
    }

/* fmi3SetFloat64 is a function of its own, below. */
#define OTHER_TYPES(X) X(Float32) X(Int8) X(UInt8) X(Int16) X(UInt16) X(Int32) X(UInt32) X(Int64) X(UInt64) X(Boolean)

GET(Float64)
OTHER_TYPES(GET)
OTHER_TYPES(SET)

/* Whether the host has named all these as variables that it gives during an update; if not, the log has the reason. */
static int announced(WithUpdate *own, const fmi3ValueReference references[], size_t count) {
    for (size_t place = 0; place < count; place++) {
        size_t named = 0;
        while (named < own->intermediate_count && own->intermediate[named] != references[place]) named++;
        if (named == own->intermediate_count) {
            refuse(&own->shared.log,
                   "a variable to be set is none of the requiredIntermediateVariables of the instantiation");
            return 0;
        }
    }
    return 1;
}

static Status set_at_end(WithUpdate *own, const fmi3ValueReference references[], size_t count,
                         const fmi3Float64 values[], size_t values_count) {
    Instance *shared = &own->shared;
    if (!there(shared, references, count, sizeof *references, "value references") ||
        !announced(own, references, count) || !there(shared, values, values_count, sizeof *values, "values")) {
        return ERROR;
    }
    WITH_PYTHON(status, CALL(shared, NULL, "set_at_end", "(NN)", view(references, count, sizeof *references, VIEW_READ),
                             view(values, values_count, sizeof *values, VIEW_READ)));
    return status;
}

FMI3_Export fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                      size_t nValueReferences, const fmi3Float64 values[], size_t nValues) {
    WithUpdate *own = instance;
    if (own == NULL) return fmi3Error;
    if (!own->shared.updating) {
        return (fmi3Status)numbers(&own->shared, "set_numbers", "Float64", valueReferences, nValueReferences, values,
                                   nValues, sizeof *values, VIEW_READ);
    }
    Status status = set_at_end(own, valueReferences, nValueReferences, values, nValues);
    if (status > WARNING) own->update_failed = 1;
    return (fmi3Status)status;
}

FMI3_Export fmi3Status fmi3GetString(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                     size_t nValueReferences, fmi3String values[], size_t nValues) {
    return (fmi3Status)get_texts(instance, valueReferences, nValueReferences, values, nValues);
}

FMI3_Export fmi3Status fmi3SetString(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                                     size_t nValueReferences, const fmi3String values[], size_t nValues) {
    return (fmi3Status)set_texts(instance, valueReferences, nValueReferences, values, nValues);
}

FMI3_Export fmi3Status fmi3GetDirectionalDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                    size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                                    const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                                    size_t nSensitivity) {
    return (fmi3Status)derivatives(instance, "get_directional_derivative", unknowns, nUnknowns, knowns, nKnowns, seed,
                                   nSeed, sensitivity, nSensitivity);
}

FMI3_Export fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[],
                                                size_t nUnknowns, const fmi3ValueReference knowns[], size_t nKnowns,
                                                const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[],
                                                size_t nSensitivity) {
    return (fmi3Status)derivatives(instance, "get_adjoint_derivative", unknowns, nUnknowns, knowns, nKnowns, seed,
                                   nSeed, sensitivity, nSensitivity);
}

/* --- states ----------------------------------------------------------------------------------------------------- */

FMI3_Export fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return (fmi3Status)get_state(instance, FMUState);
}

FMI3_Export fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) {
    return (fmi3Status)set_state(instance, FMUState);
}

FMI3_Export fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) {
    return (fmi3Status)free_state(instance, FMUState);
}

FMI3_Export fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size) {
    return (fmi3Status)state_size(instance, FMUState, size);
}

FMI3_Export fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[],
                                             size_t size) {
    return (fmi3Status)serialize(instance, FMUState, serializedState, size);
}

FMI3_Export fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[], size_t size,
                                               fmi3FMUState *FMUState) {
    return (fmi3Status)deserialize(instance, serializedState, size, FMUState);
}
