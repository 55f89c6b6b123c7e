/* The Duhem model with polynomials, in closed form; and its inverse, solved for every sample.
 *
 * Coefficients: alpha, centre, scale, n ascending of the curve tended to while rising, n while
 * falling; then, for a virgin start, n of the middle curve. State: output, previous input.
 * Inverse: lowest and highest input behind; state: as forward, last input, count clipped. */
#ifndef MCK_DUHEM_H
#define MCK_DUHEM_H

#include "mck.h"

void mck_duhem_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_duhem_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

void mck_duhem_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_duhem_inverse_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                            *out);

#endif
