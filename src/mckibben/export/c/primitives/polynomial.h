/* A polynomial of the centred and scaled input, and its inverse by Newton's method in a bracket.
 *
 * Coefficients: centre, scale, ascending polynomial. No state.
 * Inverse: centre, scale, lowest and highest argument, ascending polynomial; state: count of samples
 * clipped. */
#ifndef MCK_POLYNOMIAL_H
#define MCK_POLYNOMIAL_H

#include "mck.h"

void mck_polynomial_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_polynomial_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_polynomial_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                 *out);

#endif
