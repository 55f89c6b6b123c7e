/* Pressure for a wished-for force at a measured length. Inputs: force, length.
 *
 * Coefficients: kind of law, how many numbers it has, the law's, then those of the friction, if any.
 * Kinds are 0 polynomial force, 1 Chou-Hannaford, 2 Tondu-Lopez without kappa_1. State: the
 * friction's. The output is NaN where pressure gives no force. */
#ifndef MCK_FORCE_FEEDFORWARD_H
#define MCK_FORCE_FEEDFORWARD_H

#include "mck.h"

void mck_force_feedforward_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_force_feedforward_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                *out);

#endif
