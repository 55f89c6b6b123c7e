/* A model as a co-simulation unit, whatever the version of the interface: inputs held over a step. */
#ifndef UNIT_H
#define UNIT_H

#include <stddef.h>

#include "unit_model.h"

/* Inputs have value references from 0, outputs behind them, then the status. */
#define UNIT_STATUS (UNIT_N_INPUTS + UNIT_N_OUTPUTS)

/* Where it is in its life: what may be called depends on it. */
enum { UNIT_NEW = 0, UNIT_STARTING = 1, UNIT_RUNNING = 2, UNIT_ENDED = 3 };

typedef struct {
    UNIT_MODEL model;
    double inputs[UNIT_N_INPUTS];
    double outputs[UNIT_N_OUTPUTS];
    double start;
    double time;
    double steps; /* taken since the start */
    int status;   /* of the last step: 0 good, 1 bad input, 2 bad output */
    int phase;
} unit;

/* All that return a number return 0 where they refuse, and then have changed nothing. Pointers may be
 * NULL. */

/* A new unit, if it is given its own token; NULL otherwise. */
unit *unit_new(const char *token);

int unit_reset(unit *self);

/* When the first step starts; before the unit starts. */
int unit_start_at(unit *self, double time);

/* Go from one phase to the next. */
int unit_enter(unit *self, int from, int to);

/* Go on by h, when running. A model with a sample time takes the steps that are due by then; one without takes one
 * step. Returns 0 where time goes back or by nothing, or by more than can be meant. */
int unit_advance(unit *self, double time, double h);

/* Keep a copy of a unit, where `kept` points or in new memory. Refuses where there is none. */
int unit_keep(const unit *self, void **kept);

/* Go back to what was kept; refuses what no unit can be. */
int unit_restore(unit *self, const void *kept);

/* As bytes, and back. */
int unit_to_bytes(const void *kept, void *bytes, size_t size);
int unit_from_bytes(const void *bytes, size_t size, void **kept);

/* Both refuse where there is no such variable. */
int unit_get(const unit *self, unsigned reference, double *value);
int unit_set(unit *self, unsigned reference, double value);

#endif
