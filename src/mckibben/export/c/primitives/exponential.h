/* What undoes the logarithm.
 *
 * Coefficients: offset. No state. */
#ifndef MCK_EXPONENTIAL_H
#define MCK_EXPONENTIAL_H

#include "mck.h"

void mck_exponential_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
