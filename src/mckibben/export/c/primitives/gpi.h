/* The generalised Prandtl-Ishlinskii (GPI) model, play operators between two envelopes, and its
 * exact inverse.
 *
 * Coefficients: for the rising, then the falling envelope its kind and how many numbers it has; n
 * thresholds; n weights; the numbers of the rising, then of the falling envelope. Kinds are 0 tanh
 * (slope, shift, offset), 1 exponential (rate, shift, offset), 2 piecewise linear (knots, values).
 * State: n operators, previous input.
 * Inverse: lowest and highest input first; state: operators, previous input, previous reference,
 * count of samples clipped. */
#ifndef MCK_GPI_H
#define MCK_GPI_H

#include "mck.h"

void mck_gpi_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_gpi_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_gpi_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_gpi_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

/* The input at a common envelope value z of n operators: of the envelope of the direction, or u. The
 * coefficients are those of the inverse. */
mck_real mck_gpi_branch(const mck_real *coefficients, int n, int direction, mck_real z, mck_real u);

#endif
