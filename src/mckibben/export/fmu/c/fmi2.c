/* FMI 2.0 for co-simulation. What a unit of this kind has no use for is in fmi2_refused.c. */
#include <stdlib.h>

#include "fmi2Functions.h"
#include "unit.h"

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }

const char *fmi2GetVersion(void) { return fmi2Version; }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    (void)c;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi2OK;
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                              fmi2Boolean loggingOn)
{
    (void)instanceName;
    (void)fmuResourceLocation;
    (void)functions;
    (void)visible;
    (void)loggingOn;
    return fmuType == fmi2CoSimulation ? unit_new(fmuGUID) : NULL;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    return unit_start_at(c, startTime) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    return unit_enter(c, UNIT_NEW, UNIT_STARTING) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c)
{
    return unit_enter(c, UNIT_STARTING, UNIT_RUNNING) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2Terminate(fmi2Component c)
{
    return unit_enter(c, UNIT_RUNNING, UNIT_ENDED) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2Reset(fmi2Component c)
{
    return unit_reset(c) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    for (size_t i = 0; i < nvr; i++) {
        if (vr == NULL || value == NULL || !unit_get(c, vr[i], &value[i])) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[])
{
    for (size_t i = 0; i < nvr; i++) {
        if (vr == NULL || value == NULL || !unit_set(c, vr[i], value[i])) {
            return fmi2Error;
        }
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[])
{
    const unit *self = c;
    for (size_t i = 0; i < nvr; i++) {
        if (self == NULL || vr == NULL || value == NULL || vr[i] != UNIT_STATUS) {
            return fmi2Error;
        }
        value[i] = self->status;
    }
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    unit *self = c;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (!unit_advance(self, currentCommunicationPoint, communicationStepSize)) {
        return fmi2Error;
    }
    return self->status == 0 ? fmi2OK : fmi2Warning;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    (void)s;
    if (c == NULL || value == NULL) {
        return fmi2Error;
    }
    *value = fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    const unit *self = c;
    if (self == NULL || value == NULL) {
        return fmi2Error;
    }
    if (s != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = self->time;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    return unit_keep(c, FMUstate) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    return unit_restore(c, FMUstate) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate)
{
    (void)c;
    if (FMUstate != NULL) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    (void)c;
    (void)FMUstate;
    if (size == NULL) {
        return fmi2Error;
    }
    *size = sizeof(unit);
    return fmi2OK;
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[],
                                 size_t size)
{
    (void)c;
    return unit_to_bytes(FMUstate, bytes, size) ? fmi2OK : fmi2Error;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    (void)c;
    return unit_from_bytes(bytes, size, FMUstate) ? fmi2OK : fmi2Error;
}
