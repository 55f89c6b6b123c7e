/* The Prandtl-Ishlinskii model with weights that follow the rate of the input, and its inverse,
 * solved for every sample.
 *
 * Coefficients: smoothing, gain of the rate, offset, n thresholds, n weights by rate, n weights.
 * State: n operators, previous input, filtered rate.
 * Inverse: lowest and highest input behind; state: as forward, count of samples clipped. */
#ifndef MCK_RATE_DEPENDENT_PI_H
#define MCK_RATE_DEPENDENT_PI_H

#include "mck.h"

void mck_rate_dependent_pi_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_rate_dependent_pi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                *out);

void mck_rate_dependent_pi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_rate_dependent_pi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                        mck_real *out);

#endif
