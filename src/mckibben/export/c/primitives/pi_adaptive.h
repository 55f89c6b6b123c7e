/* The inverse of a Prandtl-Ishlinskii model that learns its weights and offset, see
 * learnt_operators.h. */
#ifndef MCK_PI_ADAPTIVE_H
#define MCK_PI_ADAPTIVE_H

#include "mck.h"

void mck_pi_adaptive_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_pi_adaptive_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

#endif
