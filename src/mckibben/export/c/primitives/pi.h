/* The Prandtl-Ishlinskii (PI) model, a weighted sum of n play operators, and its exact inverse.
 *
 * Coefficients: offset, n thresholds, n weights. State: n operators.
 * Inverse: lowest and highest input, offset, thresholds, weights; state: operators, previous
 * reference, count of samples clipped. */
#ifndef MCK_PI_H
#define MCK_PI_H

#include "mck.h"

void mck_pi_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_pi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_pi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_pi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
