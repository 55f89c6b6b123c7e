/* y = -u. No coefficients, no state. */
#ifndef MCK_NEGATIVE_H
#define MCK_NEGATIVE_H

#include "mck.h"

void mck_negative_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
