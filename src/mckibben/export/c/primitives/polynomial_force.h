/* Force linear in pressure and polynomial in length. Inputs: length, pressure.
 *
 * Coefficients: centre, scale, number of g, g, h (ascending). No state. */
#ifndef MCK_POLYNOMIAL_FORCE_H
#define MCK_POLYNOMIAL_FORCE_H

#include "mck.h"

void mck_polynomial_force_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                               *out);

#endif
