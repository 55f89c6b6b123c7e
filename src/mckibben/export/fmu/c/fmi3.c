/* FMI 3.0 for co-simulation. What a unit of this kind has no use for is in fmi3_refused.c. */
#include <stdlib.h>

#include "fmi3Functions.h"
#include "unit.h"

#define TIME_REFERENCE (UNIT_STATUS + 1u)

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    (void)instance;
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath,
    fmi3Boolean visible, fmi3Boolean loggingOn, fmi3Boolean eventModeUsed,
    fmi3Boolean earlyReturnAllowed, const fmi3ValueReference requiredIntermediateVariables[],
    size_t nRequiredIntermediateVariables, fmi3InstanceEnvironment instanceEnvironment,
    fmi3LogMessageCallback logMessage, fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)instanceName;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)eventModeUsed;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)nRequiredIntermediateVariables;
    (void)instanceEnvironment;
    (void)logMessage;
    (void)intermediateUpdate;
    return unit_new(instantiationToken);
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined,
                                       fmi3Float64 tolerance, fmi3Float64 startTime,
                                       fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    const int begun = unit_start_at(instance, startTime);
    return begun && unit_enter(instance, UNIT_NEW, UNIT_STARTING) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    return unit_enter(instance, UNIT_STARTING, UNIT_RUNNING) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    return unit_enter(instance, UNIT_RUNNING, UNIT_ENDED) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    return unit_reset(instance) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, fmi3Float64 values[], size_t nValues)
{
    const unit *self = instance;
    if (self == NULL || nValues != nValueReferences) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues; i++) {
        if (valueReferences == NULL || values == NULL) {
            return fmi3Error;
        }
        if (valueReferences[i] == TIME_REFERENCE) {
            values[i] = self->time;
        } else if (!unit_get(self, valueReferences[i], &values[i])) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                          size_t nValueReferences, const fmi3Float64 values[], size_t nValues)
{
    if (nValues != nValueReferences) {
        return fmi3Error;
    }
    for (size_t i = 0; i < nValues; i++) {
        if (valueReferences == NULL || values == NULL ||
            !unit_set(instance, valueReferences[i], values[i])) {
            return fmi3Error;
        }
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference valueReferences[],
                        size_t nValueReferences, fmi3Int32 values[], size_t nValues)
{
    const unit *self = instance;
    for (size_t i = 0; i < nValues; i++) {
        if (self == NULL || valueReferences == NULL || values == NULL ||
            nValues != nValueReferences || valueReferences[i] != UNIT_STATUS) {
            return fmi3Error;
        }
        values[i] = self->status;
    }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint,
                      fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                      fmi3Boolean *eventHandlingNeeded, fmi3Boolean *terminateSimulation,
                      fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    unit *self = instance;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (eventHandlingNeeded == NULL || terminateSimulation == NULL || earlyReturn == NULL ||
        lastSuccessfulTime == NULL) {
        return fmi3Error;
    }
    *eventHandlingNeeded = fmi3False;
    *terminateSimulation = fmi3False;
    *earlyReturn = fmi3False;
    if (!unit_advance(self, currentCommunicationPoint, communicationStepSize)) {
        return fmi3Error;
    }
    *lastSuccessfulTime = self->time;
    return self->status == 0 ? fmi3OK : fmi3Warning;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    return unit_keep(instance, FMUState) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState)
{
    return unit_restore(instance, FMUState) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState)
{
    (void)instance;
    if (FMUState != NULL) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    (void)instance;
    (void)FMUState;
    if (size == NULL) {
        return fmi3Error;
    }
    *size = sizeof(unit);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState,
                                 fmi3Byte serializedState[], size_t size)
{
    (void)instance;
    return unit_to_bytes(FMUState, serializedState, size) ? fmi3OK : fmi3Error;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte serializedState[],
                                   size_t size, fmi3FMUState *FMUState)
{
    (void)instance;
    return unit_from_bytes(serializedState, size, FMUState) ? fmi3OK : fmi3Error;
}
