/* Force of a braided cylinder with corrections. Inputs: length, pressure.
 *
 * Coefficients: rest length, area, a, b, mu_1, mu_0, kappa_1, kappa_0, constant. No state. */
#ifndef MCK_TONDU_LOPEZ_H
#define MCK_TONDU_LOPEZ_H

#include "mck.h"

void mck_tondu_lopez_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
