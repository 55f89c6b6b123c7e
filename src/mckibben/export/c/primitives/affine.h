/* y = gain u + offset.
 *
 * Coefficients: gain, offset. No state. */
#ifndef MCK_AFFINE_H
#define MCK_AFFINE_H

#include "mck.h"

void mck_affine_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
