/* A compensator that looks ahead, for muscles with limits of pressure, its rate and the supply.
 *
 * Coefficients: model (0 pi, 1 gpi, 2 balance), samples N, muscles n, limits, states of the model and of
 * its inverse, numbers of the model and of its inverse, scratch of either, times that a plan is made;
 * n steps of pressure that tell slopes; n lowest pressures; limits, see supply.h; the model's numbers; its inverse's.
 * Inputs: n references N - 1 samples ahead, then what schedules, now.
 * State: the model's, N by n references not yet due, n last pressures, whether there are, plans made. */
#ifndef MCK_PREDICTIVE_H
#define MCK_PREDICTIVE_H

#include "mck.h"

void mck_predictive_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_predictive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
