/* The functions of FMI 3.0 that no unit has a use for: the host is told which capability of the FMU it overlooked. */
#include "fmi3.h"
#include "instance.h"

/* They have their parameters from the standard. */
#pragma GCC diagnostic ignored "-Wunused-parameter"

/* A function with the parameters that follow the instance. */
#define ABSENT(name, why, ...) \
    FMI3_Export fmi3Status name(fmi3Instance instance, __VA_ARGS__) { return (fmi3Status)unable(instance, why); }

/* One without. */
#define ABSENT_CALL(name, why) \
    FMI3_Export fmi3Status name(fmi3Instance instance) { return (fmi3Status)unable(instance, why); }

#define REFERENCES const fmi3ValueReference valueReferences[], size_t nValueReferences

/* --- types that no variable has: the slave names the variable and its type -------------------------------------- */

static fmi3Status refuse_type(Instance *own, const char *type, const fmi3ValueReference references[], size_t count) {
    if (!ready(own) || !there(own, references, count, sizeof *references, "value references")) return fmi3Error;
    WITH_PYTHON(status,
                CALL(own, NULL, "refuse_type", "(sN)", type, view(references, count, sizeof *references, VIEW_READ)));
    return (fmi3Status)status;
}

FMI3_Export fmi3Status fmi3GetBinary(fmi3Instance instance, REFERENCES, size_t valueSizes[], fmi3Binary values[],
                                     size_t nValues) {
    return refuse_type(instance, "Binary", valueReferences, nValueReferences);
}

FMI3_Export fmi3Status fmi3SetBinary(fmi3Instance instance, REFERENCES, const size_t valueSizes[],
                                     const fmi3Binary values[], size_t nValues) {
    return refuse_type(instance, "Binary", valueReferences, nValueReferences);
}

FMI3_Export fmi3Status fmi3GetClock(fmi3Instance instance, REFERENCES, fmi3Clock values[]) {
    return refuse_type(instance, "Clock", valueReferences, nValueReferences);
}

FMI3_Export fmi3Status fmi3SetClock(fmi3Instance instance, REFERENCES, const fmi3Clock values[]) {
    return refuse_type(instance, "Clock", valueReferences, nValueReferences);
}

/* --- modes ------------------------------------------------------------------------------------------------------ */

static const char NO_CONFIGURATION[] = "this FMU has no configuration mode: it has no structural parameters";
static const char NO_EVENTS[] = "this FMU has no event mode (hasEventMode is false)";

ABSENT_CALL(fmi3EnterConfigurationMode, NO_CONFIGURATION)
ABSENT_CALL(fmi3ExitConfigurationMode, NO_CONFIGURATION)
ABSENT_CALL(fmi3EnterEventMode, NO_EVENTS)
ABSENT_CALL(fmi3EnterStepMode, NO_EVENTS)
ABSENT_CALL(fmi3EvaluateDiscreteStates, NO_EVENTS)
ABSENT(fmi3UpdateDiscreteStates, NO_EVENTS, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation,
       fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged,
       fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime)

/* --- dependencies and derivatives ------------------------------------------------------------------------------- */

static const char NO_ELEMENT_DEPENDENCIES[] =
    "this FMU has no dependencies of single elements (providesPerElementDependencies is false)";

ABSENT(fmi3GetNumberOfVariableDependencies, NO_ELEMENT_DEPENDENCIES, fmi3ValueReference valueReference,
       size_t *nDependencies)
ABSENT(fmi3GetVariableDependencies, NO_ELEMENT_DEPENDENCIES, fmi3ValueReference dependent,
       size_t elementIndicesOfDependent[], fmi3ValueReference independents[], size_t elementIndicesOfIndependents[],
       fmi3DependencyKind dependencyKinds[], size_t nDependencies)
ABSENT(fmi3GetOutputDerivatives, "this FMU has no output derivatives (maxOutputDerivativeOrder is 0)", REFERENCES,
       const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues)

/* --- clocks ----------------------------------------------------------------------------------------------------- */

static const char NO_CLOCKS[] = "this FMU has no clocks: there are no variables of type Clock";

ABSENT(fmi3GetIntervalDecimal, NO_CLOCKS, REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetIntervalFraction, NO_CLOCKS, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
       fmi3IntervalQualifier qualifiers[])
ABSENT(fmi3GetShiftDecimal, NO_CLOCKS, REFERENCES, fmi3Float64 shifts[])
ABSENT(fmi3GetShiftFraction, NO_CLOCKS, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
ABSENT(fmi3SetIntervalDecimal, NO_CLOCKS, REFERENCES, const fmi3Float64 intervals[])
ABSENT(fmi3SetIntervalFraction, NO_CLOCKS, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(fmi3SetShiftDecimal, NO_CLOCKS, REFERENCES, const fmi3Float64 shifts[])
ABSENT(fmi3SetShiftFraction, NO_CLOCKS, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
ABSENT(fmi3ActivateModelPartition, "this FMU has no model partitions: its model description has no ScheduledExecution",
       fmi3ValueReference clockReference, fmi3Float64 activationTime)

/* --- model exchange --------------------------------------------------------------------------------------------- */

static const char NO_MODEL_EXCHANGE[] =
    "this FMU is for co-simulation only: its model description has no ModelExchange";

ABSENT_CALL(fmi3EnterContinuousTimeMode, NO_MODEL_EXCHANGE)
ABSENT(fmi3CompletedIntegratorStep, NO_MODEL_EXCHANGE, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
ABSENT(fmi3SetTime, NO_MODEL_EXCHANGE, fmi3Float64 time)
ABSENT(fmi3SetContinuousStates, NO_MODEL_EXCHANGE, const fmi3Float64 continuousStates[], size_t nContinuousStates)
ABSENT(fmi3GetContinuousStateDerivatives, NO_MODEL_EXCHANGE, fmi3Float64 derivatives[], size_t nContinuousStates)
ABSENT(fmi3GetEventIndicators, NO_MODEL_EXCHANGE, fmi3Float64 eventIndicators[], size_t nEventIndicators)
ABSENT(fmi3GetContinuousStates, NO_MODEL_EXCHANGE, fmi3Float64 continuousStates[], size_t nContinuousStates)
ABSENT(fmi3GetNominalsOfContinuousStates, NO_MODEL_EXCHANGE, fmi3Float64 nominals[], size_t nContinuousStates)
ABSENT(fmi3GetNumberOfEventIndicators, NO_MODEL_EXCHANGE, size_t *nEventIndicators)
ABSENT(fmi3GetNumberOfContinuousStates, NO_MODEL_EXCHANGE, size_t *nContinuousStates)
