/* The generalised Bouc-Wen model with a reversible polynomial, in closed form; and its inverse,
 * solved for every sample.
 *
 * Coefficients: rate, exponent, weight, centre, scale, 1, five shape numbers, polynomial. State: z,
 * previous input.
 * Inverse: lowest and highest input behind; state: as forward, last input, count clipped. */
#ifndef MCK_GENERALIZED_BOUC_WEN_H
#define MCK_GENERALIZED_BOUC_WEN_H

#include "mck.h"

void mck_generalized_bouc_wen_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_generalized_bouc_wen_step(const mck_part *part, mck_real *state, const mck_real *in,
                                   mck_real *out);

void mck_generalized_bouc_wen_inverse_start(const mck_part *part, mck_real *state, const mck_real
                                            *in);
void mck_generalized_bouc_wen_inverse_step(const mck_part *part, mck_real *state, const mck_real
                                           *in, mck_real *out);

#endif
