/* A discrete transfer function about an operating point, in transposed direct form.
 *
 * Coefficients: u_0, y_0, n + 1 of the numerator, n + 1 of the denominator with its leading 1; then
 * the n states at rest for an input of 1. State: n. */
#ifndef MCK_TRANSFER_FUNCTION_H
#define MCK_TRANSFER_FUNCTION_H

#include "mck.h"

void mck_transfer_function_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_transfer_function_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                *out);

#endif
