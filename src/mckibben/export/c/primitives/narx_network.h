/* A NARX model with one hidden layer, running free.
 *
 * Coefficients: lags of the output, inputs kept, operators k, centre and scale of input and of output,
 * k thresholds; number n of regressors, of units, whether they are wavelets; n places in the state;
 * bias, n linear; for every unit n weights, shift, output. State: past outputs, past inputs,
 * operators. */
#ifndef MCK_NARX_NETWORK_H
#define MCK_NARX_NETWORK_H

#include "mck.h"

void mck_narx_network_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_narx_network_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                           *out);

#endif
