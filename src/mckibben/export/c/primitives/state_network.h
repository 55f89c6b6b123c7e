/* A state-space model in continuous time of a linear part and tanh units, by Runge-Kutta substeps.
 *
 * Coefficients: substep by rate, how many, 1 where the input is held between samples and 0 where it
 * goes in a straight line, states n, units, offset and scale of the input, of the output; then weights,
 * row by row: n + 2 a state, n + 2 a unit, as many as units a state. State: n states, last input.
 * Scratch: 3 n. */
#ifndef MCK_STATE_NETWORK_H
#define MCK_STATE_NETWORK_H

#include "mck.h"

void mck_state_network_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_state_network_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

#endif
