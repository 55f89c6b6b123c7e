/* Pressure that acts, once the bladder has met the braid; and its inverse, by Newton's method.
 *
 * Coefficients: pressure over which the dead zone fades. No state. */
#ifndef MCK_CONTACT_H
#define MCK_CONTACT_H

#include "mck.h"

void mck_contact_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);
void mck_contact_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out);

#endif
