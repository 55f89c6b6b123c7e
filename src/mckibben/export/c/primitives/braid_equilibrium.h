/* Where a braided muscle comes to rest, by Newton's method in a bracket; and the pressure for a
 * displacement, in closed form.
 *
 * Coefficients: load, stiffness, hardening, force per bar, a, b, least and largest contraction, rest
 * length, offset. No state. Inverse: the same; state: count of samples clipped. */
#ifndef MCK_BRAID_EQUILIBRIUM_H
#define MCK_BRAID_EQUILIBRIUM_H

#include "mck.h"

void mck_braid_equilibrium_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real
                                *out);

void mck_braid_equilibrium_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_braid_equilibrium_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                                        mck_real *out);

#endif
