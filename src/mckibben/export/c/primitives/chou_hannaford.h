/* Force of an inextensible braid. Inputs: length, pressure.
 *
 * Coefficients: force per bar and square length, square of b / 3, constant. No state. */
#ifndef MCK_CHOU_HANNAFORD_H
#define MCK_CHOU_HANNAFORD_H

#include "mck.h"

void mck_chou_hannaford_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                             *out);

#endif
