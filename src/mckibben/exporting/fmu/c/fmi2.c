/* A model as a unit for co-simulation by FMI 2.0.
 *
 * Inputs have value references from 0, outputs behind them, then the status of the last step. Functions
 * that refuse have changed nothing. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "unit_model.h"

#define STATUS_REFERENCE (UNIT_N_INPUTS + UNIT_N_OUTPUTS)
#define MOST_STEPS 1e7 /* of the model in one communication step */

/* Where a unit is in its life: what may be called depends on it. */
enum { IS_NEW = 0, IS_STARTING = 1, IS_RUNNING = 2, HAS_ENDED = 3 };

typedef struct {
    UNIT_MODEL model;
    double inputs[UNIT_N_INPUTS];
    double outputs[UNIT_N_OUTPUTS];
    double start;
    double time;
    double steps; /* taken since the start */
    int status;   /* of the steps in the last communication step: all bits that were set */
    int phase;
} unit;

static const double first_inputs[UNIT_N_INPUTS] = UNIT_START;

/* Go from one phase to the next. */
static fmi2Status enter(unit *self, int from, int to)
{
    if (self == NULL || self->phase != from) {
        return fmi2Error;
    }
    self->phase = to;
    return fmi2OK;
}

static void take_step(unit *self)
{
    mck_real in[UNIT_N_INPUTS];
    mck_real out[UNIT_N_OUTPUTS];
    for (int i = 0; i < UNIT_N_INPUTS; i++) {
        in[i] = (mck_real)self->inputs[i];
    }
    self->status |= UNIT_STEP(&self->model, in, out);
    for (int i = 0; i < UNIT_N_OUTPUTS; i++) {
        self->outputs[i] = (double)out[i];
    }
    self->steps += 1.0;
}

/* Give the outputs of the first step, which is not taken yet: a unit that drives a valve has no output
 * before its first command. */
static void show_first(unit *self)
{
    self->status = 0;
    take_step(self);
    UNIT_INIT(&self->model);
    self->steps = 0.0;
}

/* Return whether a unit can be like this, as far as that is used: numbers of the model's memory may be
 * any, as inputs may. */
static int possible(const unit *self)
{
    return isfinite(self->start) && isfinite(self->time) && isfinite(self->steps) &&
           self->steps >= 0.0 && self->phase >= IS_NEW && self->phase <= HAS_ENDED &&
           self->status >= 0 && self->status <= 7;
}

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
    if (fmuType != fmi2CoSimulation || fmuGUID == NULL || strcmp(fmuGUID, UNIT_TOKEN) != 0) {
        return NULL;
    }
    unit *self = malloc(sizeof *self);
    (void)fmi2Reset(self);
    return self;
}

void fmi2FreeInstance(fmi2Component c) { free(c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance,
                               fmi2Real startTime, fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    unit *self = c;
    (void)toleranceDefined;
    (void)tolerance;
    (void)stopTimeDefined;
    (void)stopTime;
    if (self == NULL || self->phase != IS_NEW || !isfinite(startTime)) {
        return fmi2Error;
    }
    self->start = startTime;
    self->time = startTime;
    return fmi2OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c)
{
    const fmi2Status status = enter(c, IS_NEW, IS_STARTING);
    if (status == fmi2OK) {
        show_first(c);
    }
    return status;
}

fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return enter(c, IS_STARTING, IS_RUNNING); }

fmi2Status fmi2Terminate(fmi2Component c) { return enter(c, IS_RUNNING, HAS_ENDED); }

fmi2Status fmi2Reset(fmi2Component c)
{
    unit *self = c;
    if (self == NULL) {
        return fmi2Error;
    }
    memset(self, 0, sizeof *self); /* gaps between its members too: they are serialised */
    UNIT_INIT(&self->model);
    memcpy(self->inputs, first_inputs, sizeof first_inputs);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[])
{
    const unit *self = c;
    for (size_t i = 0; i < nvr; i++) {
        if (self == NULL || vr == NULL || value == NULL || vr[i] >= STATUS_REFERENCE) {
            return fmi2Error;
        }
        value[i] = vr[i] < UNIT_N_INPUTS ? self->inputs[vr[i]] : self->outputs[vr[i] - UNIT_N_INPUTS];
    }
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[])
{
    unit *self = c;
    for (size_t i = 0; i < nvr; i++) {
        if (self == NULL || self->phase == HAS_ENDED || vr == NULL || value == NULL ||
            vr[i] >= UNIT_N_INPUTS) {
            return fmi2Error;
        }
        self->inputs[vr[i]] = value[i];
    }
    if (self != NULL && self->phase == IS_STARTING) {
        show_first(self);
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[])
{
    const unit *self = c;
    for (size_t i = 0; i < nvr; i++) {
        if (self == NULL || vr == NULL || value == NULL || vr[i] != STATUS_REFERENCE) {
            return fmi2Error;
        }
        value[i] = self->status;
    }
    return fmi2OK;
}

/* A model with a sample time takes the steps that are due by the end of the communication step; one
 * without takes one step. */
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint,
                      fmi2Real communicationStepSize, fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    unit *self = c;
    const double time = currentCommunicationPoint;
    const double h = communicationStepSize;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (self == NULL || self->phase != IS_RUNNING || !(h > 0.0) || !isfinite(time + h) ||
        time < self->time - 1e-6 * (h + 1.0)) {
        return fmi2Error;
    }
#ifdef UNIT_SAMPLE_TIME
    /* a hair early is in time: importers add up their steps */
    const double due = floor((time + h - self->start) / UNIT_SAMPLE_TIME + 1e-6);
    if (!(due - self->steps <= MOST_STEPS)) {
        return fmi2Error;
    }
    if (self->steps < due) {
        self->status = 0;
    }
    while (self->steps < due) {
        take_step(self);
    }
#else
    self->status = 0;
    take_step(self);
#endif
    self->time = time + h;
    return (self->status & (UNIT_BAD_INPUT | UNIT_BAD_OUTPUT)) == 0 ? fmi2OK : fmi2Warning;
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
    if (c == NULL || FMUstate == NULL) {
        return fmi2Error;
    }
    if (*FMUstate == NULL) {
        *FMUstate = malloc(sizeof(unit));
    }
    if (*FMUstate == NULL) {
        return fmi2Error;
    }
    memcpy(*FMUstate, c, sizeof(unit));
    return fmi2OK;
}

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate)
{
    if (c == NULL || FMUstate == NULL || !possible(FMUstate)) {
        return fmi2Error;
    }
    memcpy(c, FMUstate, sizeof(unit));
    return fmi2OK;
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
    if (FMUstate == NULL || bytes == NULL || size < sizeof(unit)) {
        return fmi2Error;
    }
    memcpy(bytes, FMUstate, sizeof(unit));
    return fmi2OK;
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size,
                                   fmi2FMUstate *FMUstate)
{
    (void)c;
    if (bytes == NULL || FMUstate == NULL || size != sizeof(unit)) {
        return fmi2Error;
    }
    unit *found = malloc(size); /* bytes may lie where a unit may not */
    if (found == NULL) {
        return fmi2Error;
    }
    memcpy(found, bytes, size);
    const fmi2Status status = possible(found) ? fmi2GetFMUstate(found, FMUstate) : fmi2Error;
    free(found);
    return status;
}

/* What a unit without other variables, derivatives and steps that wait has no use for. */

#define REFUSED_VALUES(name, values)                                                              \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, values)           \
    {                                                                                             \
        (void)c, (void)vr, (void)nvr, (void)value;                                                \
        return fmi2Error;                                                                         \
    }

REFUSED_VALUES(fmi2GetBoolean, fmi2Boolean value[])
REFUSED_VALUES(fmi2GetString, fmi2String value[])
REFUSED_VALUES(fmi2SetInteger, const fmi2Integer value[])
REFUSED_VALUES(fmi2SetBoolean, const fmi2Boolean value[])
REFUSED_VALUES(fmi2SetString, const fmi2String value[])

#define REFUSED_DERIVATIVES(name, values)                                                         \
    fmi2Status name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,                   \
                    const fmi2Integer order[], values)                                            \
    {                                                                                             \
        (void)c, (void)vr, (void)nvr, (void)order, (void)value;                                   \
        return fmi2Error;                                                                         \
    }

REFUSED_DERIVATIVES(fmi2SetRealInputDerivatives, const fmi2Real value[])
REFUSED_DERIVATIVES(fmi2GetRealOutputDerivatives, fmi2Real value[])

#define REFUSED_STATUS(name, type)                                                                \
    fmi2Status name(fmi2Component c, const fmi2StatusKind s, type *value)                         \
    {                                                                                             \
        (void)c, (void)s, (void)value;                                                            \
        return fmi2Error;                                                                         \
    }

REFUSED_STATUS(fmi2GetIntegerStatus, fmi2Integer)
REFUSED_STATUS(fmi2GetBooleanStatus, fmi2Boolean)
REFUSED_STATUS(fmi2GetStringStatus, fmi2String)

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[],
                                        size_t nUnknown, const fmi2ValueReference known[],
                                        size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    (void)c, (void)unknown, (void)nUnknown, (void)known, (void)nKnown, (void)dvKnown;
    (void)dvUnknown;
    return fmi2Error;
}

fmi2Status fmi2CancelStep(fmi2Component c)
{
    (void)c;
    return fmi2Error;
}
