/* A gain, one to three lags, perhaps a zero and a delay, about an operating point.
 *
 * Coefficients: order n, delay in samples, u_0, y_0, direct gains now and before, n of the output,
 * three times n of the inputs, n by n of the transition. State: n lags, past inputs, n to compute in. */
#ifndef MCK_PROCESS_MODEL_H
#define MCK_PROCESS_MODEL_H

#include "mck.h"

void mck_process_model_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_process_model_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

#endif
