/* A polynomial NARX model, running free.
 *
 * Coefficients: lags of the output, inputs kept, operators k, centre and scale of input and of output,
 * k thresholds; degree; for every term its weight and, padded with -1, the places of its factors in
 * the state. State: past outputs, past inputs, operators. */
#ifndef MCK_NARX_POLYNOMIAL_H
#define MCK_NARX_POLYNOMIAL_H

#include "mck.h"

void mck_narx_polynomial_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_narx_polynomial_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                              *out);

#endif
