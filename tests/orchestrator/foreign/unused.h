/* The functions of FMI 2.0 that no FMU here has a use for, and NOTHING for those that one of them has none for. */
#include "fmi2Functions.h"

#define NOTHING { return fmi2Error; }
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference v[], size_t n, const fmi2Integer o[],
                                        fmi2Real x[]) NOTHING
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[], size_t n,
                                        const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real x[]) NOTHING
fmi2Status fmi2CancelStep(fmi2Component c) NOTHING
fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *x) NOTHING
fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *x) NOTHING
fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *x) NOTHING
