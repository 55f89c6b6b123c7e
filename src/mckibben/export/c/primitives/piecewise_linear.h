/* Straight lines between knots.
 *
 * Coefficients: n knots, n values. No state. */
#ifndef MCK_PIECEWISE_LINEAR_H
#define MCK_PIECEWISE_LINEAR_H

#include "mck.h"

void mck_piecewise_linear_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                               *out);

#endif
