#include "unit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_STEPS 1e7 /* of the model in one communication step */

static const double first_inputs[UNIT_N_INPUTS] = UNIT_START;

void unit_reset(unit *self)
{
    UNIT_INIT(&self->model);
    for (int i = 0; i < UNIT_N_INPUTS; i++) {
        self->inputs[i] = first_inputs[i];
    }
    for (int i = 0; i < UNIT_N_OUTPUTS; i++) {
        self->outputs[i] = 0.0;
    }
    self->start = 0.0;
    self->time = 0.0;
    self->steps = 0.0;
    self->status = 0;
}

static void take_step(unit *self)
{
    mck_real in[UNIT_N_INPUTS];
    mck_real out[UNIT_N_OUTPUTS];
    for (int i = 0; i < UNIT_N_INPUTS; i++) {
        in[i] = (mck_real)self->inputs[i];
    }
    self->status = UNIT_STEP(&self->model, in, out);
    for (int i = 0; i < UNIT_N_OUTPUTS; i++) {
        self->outputs[i] = (double)out[i];
    }
    self->steps += 1.0;
}

int unit_advance(unit *self, double time, double h)
{
    if (!(h > 0.0) || !isfinite(h) || !isfinite(time) || time < self->time - 1e-6 * (h + 1.0)) {
        return 0;
    }
#ifdef UNIT_SAMPLE_TIME
    /* a hair early is in time: importers add up their steps */
    const double due = floor((time + h - self->start) / UNIT_SAMPLE_TIME + 1e-6);
    if (due - self->steps > MOST_STEPS) {
        return 0;
    }
    while (self->steps < due) {
        take_step(self);
    }
#else
    take_step(self);
#endif
    self->time = time + h;
    return 1;
}

int unit_get(const unit *self, unsigned reference, double *value)
{
    if (reference < UNIT_N_INPUTS) {
        *value = self->inputs[reference];
    } else if (reference < UNIT_STATUS) {
        *value = self->outputs[reference - UNIT_N_INPUTS];
    } else {
        return 0;
    }
    return 1;
}

int unit_set(unit *self, unsigned reference, double value)
{
    if (reference >= UNIT_N_INPUTS) {
        return 0;
    }
    self->inputs[reference] = value;
    return 1;
}

int unit_keep(const void *bytes, void **kept)
{
    if (*kept == NULL) {
        *kept = malloc(sizeof(unit));
    }
    if (*kept == NULL) {
        return 0;
    }
    memcpy(*kept, bytes, sizeof(unit));
    return 1;
}
