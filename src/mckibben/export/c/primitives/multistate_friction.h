/* Friction elements that switch with the direction of motion. Inputs: length, pressure.
 *
 * Coefficients: sample time, pressure gain, reference pressure; for every element stiffness, damping
 * and limit lengthening, then shortening; a limit of 0 where it does not act. State: n deflections,
 * previous length; scratch: n. */
#ifndef MCK_MULTISTATE_FRICTION_H
#define MCK_MULTISTATE_FRICTION_H

#include "mck.h"

void mck_multistate_friction_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_multistate_friction_step(const mck_part *part, mck_real *state, const mck_real *in,
                                  mck_real *out);

#endif
