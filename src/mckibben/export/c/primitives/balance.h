/* Muscles in parallel under load as a balance of forces: from displacements of n muscles to their
 * pressures, muscle by muscle; and back, as the minimum of a convex energy, by Newton's method with a
 * search along every step. Inputs: displacements (or pressures), what schedules, loads.
 *
 * Coefficients, state and scratch: see balance_law.h; counted are samples clipped or, of the inverse,
 * not solved. */
#ifndef MCK_BALANCE_H
#define MCK_BALANCE_H

#include "balance_law.h"
#include "mck.h"

void mck_balance_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_balance_step(const mck_part *part, mck_real *state, const mck_real *in, mck_real *out);

/* The step by itself; the first n numbers of scratch are then where the muscles are. */
void mck_balance_press(const mck_balance *f, const mck_real *in, mck_real *out);

void mck_balance_inverse_start(const mck_part *part, mck_real *state, const mck_real *in);
void mck_balance_inverse_step(const mck_part *part, mck_real *state, const mck_real *in,
                              mck_real *out);

#endif
