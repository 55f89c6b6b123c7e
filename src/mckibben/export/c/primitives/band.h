/* A band round modelled outputs, shifted and scaled by the state of motion.
 *
 * In: what drives the model, then its outputs. Out: of every output itself, its lower, its upper end.
 *
 * Coefficients: driving inputs, outputs, plays, lags, bells, sharpness; ends of all inputs, lowest then
 * highest; widths of plays; what lags keep; mean and spread of what is seen; bells; weights of the shift,
 * then of the logarithm of the scale, output by output; limits, four an output; quantiles of scores.
 * State: plays and lags of the first driving input, then of the next; scratch: what is seen, terms. */
#ifndef MCK_BAND_H
#define MCK_BAND_H

#include "mck.h"

void mck_band_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_band_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
