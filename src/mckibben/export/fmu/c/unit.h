/* A model as a co-simulation unit, whatever the version of the interface: inputs held over a step. */
#ifndef UNIT_H
#define UNIT_H

#include <stddef.h>

#include "unit_model.h"

/* Inputs have value references from 0, outputs behind them, then the status. */
#define UNIT_STATUS (UNIT_N_INPUTS + UNIT_N_OUTPUTS)

typedef struct {
    UNIT_MODEL model;
    double inputs[UNIT_N_INPUTS];
    double outputs[UNIT_N_OUTPUTS];
    double start;
    double time;
    double steps; /* taken since the start */
    int status;   /* of the last step: 0 good, 1 bad input, 2 bad output */
} unit;

void unit_reset(unit *self);

/* Go on by h. A model with a sample time takes the steps that are due by then; one without takes one
 * step. Returns 0 where time goes back or by nothing, or by more than can be meant. */
int unit_advance(unit *self, double time, double h);

/* Keep a copy of a unit, where `kept` points or in new memory; bytes may be one's own or serialised.
 * Returns 0 where there is no memory. */
int unit_keep(const void *bytes, void **kept);

/* Both return 0 where there is no such variable. */
int unit_get(const unit *self, unsigned reference, double *value);
int unit_set(unit *self, unsigned reference, double value);

#endif
