/* ln(u + offset), its tangent below 0.05.
 *
 * Coefficients: offset. No state. */
#ifndef MCK_LOGARITHM_H
#define MCK_LOGARITHM_H

#include "mck.h"

void mck_logarithm_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
