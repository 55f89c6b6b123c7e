#include "unit.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define MOST_STEPS 1e7 /* of the model in one communication step */

static const double first_inputs[UNIT_N_INPUTS] = UNIT_START;

unit *unit_new(const char *token)
{
    if (token == NULL || strcmp(token, UNIT_TOKEN) != 0) {
        return NULL;
    }
    unit *self = malloc(sizeof *self);
    (void)unit_reset(self);
    return self;
}

int unit_reset(unit *self)
{
    if (self == NULL) {
        return 0;
    }
    memset(self, 0, sizeof *self); /* gaps between its members too: they are serialised */
    UNIT_INIT(&self->model);
    for (int i = 0; i < UNIT_N_INPUTS; i++) {
        self->inputs[i] = first_inputs[i];
    }
    return 1;
}

int unit_start_at(unit *self, double time)
{
    if (self == NULL || self->phase != UNIT_NEW || !isfinite(time)) {
        return 0;
    }
    self->start = time;
    self->time = time;
    return 1;
}

int unit_enter(unit *self, int from, int to)
{
    if (self == NULL || self->phase != from) {
        return 0;
    }
    self->phase = to;
    return 1;
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
    if (self == NULL || self->phase != UNIT_RUNNING || !(h > 0.0) || !isfinite(time + h) ||
        time < self->time - 1e-6 * (h + 1.0)) {
        return 0;
    }
#ifdef UNIT_SAMPLE_TIME
    /* a hair early is in time: importers add up their steps */
    const double due = floor((time + h - self->start) / UNIT_SAMPLE_TIME + 1e-6);
    if (!(due - self->steps <= MOST_STEPS)) {
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
    if (self == NULL || value == NULL) {
        return 0;
    }
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
    if (self == NULL || self->phase == UNIT_ENDED || reference >= UNIT_N_INPUTS) {
        return 0;
    }
    self->inputs[reference] = value;
    return 1;
}

/* What serialised bytes may hold is checked as far as it is used: numbers of the model's memory may be
 * any, as inputs may. */
static int possible(const unit *self)
{
    return isfinite(self->start) && isfinite(self->time) && isfinite(self->steps) &&
           self->steps >= 0.0 && self->phase >= UNIT_NEW && self->phase <= UNIT_ENDED &&
           self->status >= 0 && self->status <= 2;
}

static int copied(const unit *from, void **kept)
{
    if (*kept == NULL) {
        *kept = malloc(sizeof *from);
    }
    if (*kept == NULL) {
        return 0;
    }
    memcpy(*kept, from, sizeof *from);
    return 1;
}

int unit_keep(const unit *self, void **kept)
{
    return self != NULL && kept != NULL && copied(self, kept);
}

int unit_restore(unit *self, const void *kept)
{
    if (self == NULL || kept == NULL || !possible(kept)) {
        return 0;
    }
    memcpy(self, kept, sizeof *self);
    return 1;
}

int unit_to_bytes(const void *kept, void *bytes, size_t size)
{
    if (kept == NULL || bytes == NULL || size < sizeof(unit)) {
        return 0;
    }
    memcpy(bytes, kept, sizeof(unit));
    return 1;
}

int unit_from_bytes(const void *bytes, size_t size, void **kept)
{
    if (bytes == NULL || kept == NULL || size != sizeof(unit)) {
        return 0;
    }
    unit *found = malloc(size); /* bytes may lie where a unit may not */
    if (found == NULL) {
        return 0;
    }
    memcpy(found, bytes, size);
    const int good = possible(found) && copied(found, kept);
    free(found);
    return good;
}
