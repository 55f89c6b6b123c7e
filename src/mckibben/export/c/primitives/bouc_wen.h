/* The normalised Bouc-Wen model with a reversible polynomial, in closed form; and its inverse, solved
 * for every sample.
 *
 * Coefficients: rate, sigma, exponent, weight, centre, scale, polynomial. State: z, previous input.
 * Inverse: lowest and highest input behind; state: as forward, last input, count clipped. */
#ifndef MCK_BOUC_WEN_H
#define MCK_BOUC_WEN_H

#include "mck.h"

void mck_bouc_wen_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_bouc_wen_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_bouc_wen_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_bouc_wen_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                               *out);

#endif
