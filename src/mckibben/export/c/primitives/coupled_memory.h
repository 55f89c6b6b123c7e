/* Lags and play operators of several inputs, read out by a polynomial.
 *
 * Coefficients: lags l, thresholds m, degree; l decays; m thresholds of every input; a row of readout
 * for every output. State: l times every input, m plays of each. */
#ifndef MCK_COUPLED_MEMORY_H
#define MCK_COUPLED_MEMORY_H

#include "mck.h"

void mck_coupled_memory_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_coupled_memory_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                             *out);

#endif
